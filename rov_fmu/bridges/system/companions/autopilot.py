"""Depth hold and heading hold for the VideoRay, the two PID loops of its console, as a PythonFMU slave.

Each sample takes depth and heading from the sensors and gives the three thruster commands one sample later. A loop
works on force (N) or torque (N.m) and follows a reference model, which starts where the vehicle is when the hold is
switched on, so that nothing jumps. The thrust curve (2), inverted, turns force into command.
"""

from dataclasses import dataclass
from math import isnan, nan, pi, remainder, sin, sqrt

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

FULL_TURN = 2.0 * pi

# name: causality, start, unit, description
VARIABLES: dict[str, tuple[str, float | bool, str, str]] = {
    "z": ("input", 0.0, "m", "Measured depth"),
    "psi": ("input", 0.0, "rad", "Measured heading, wrapped or not"),
    "z_ref": ("input", 0.0, "m", "Depth to hold"),
    "psi_ref": ("input", 0.0, "rad", "Heading to hold"),
    "surge": ("input", 0.0, "1", "Stick forward, -1 ... 1: command of both rear thrusters"),
    "heave": ("input", 0.0, "1", "Stick down, -1 ... 1: command of the top thruster while depth hold is off"),
    "yaw": (
        "input",
        0.0,
        "1",
        "Stick to starboard, -1 ... 1: opposite commands of the rear thrusters while heading hold is off",
    ),
    "depth_hold": ("input", False, "1", "Depth hold is on"),
    "heading_hold": ("input", False, "1", "Heading hold is on"),
    "sag": ("input", 0.0, "1", "Drop of the battery's voltage, by which the largest command falls"),
    "u_l": ("output", 0.0, "1", "Left thruster command, positive forward"),
    "u_r": ("output", 0.0, "1", "Right thruster command, positive forward"),
    "u_t": ("output", 0.0, "1", "Top thruster command, positive down"),
    "z_d": ("output", 0.0, "m", "Depth that the reference model wants now"),
    "psi_d": ("output", 0.0, "rad", "Heading that the reference model wants now"),
    "K_p_z": ("parameter", 60.0, "N/m", "Depth hold: proportional gain"),
    "K_i_z": ("parameter", 30.0, "N/(m.s)", "Depth hold: integral gain"),
    "K_d_z": ("parameter", 45.0, "N.s/m", "Depth hold: derivative gain"),
    "omega_z": ("parameter", 0.6, "rad/s", "Depth hold: natural frequency of the reference model"),
    "w_max": ("parameter", 0.25, "m/s", "Depth hold: most heave velocity of the reference"),
    "K_p_psi": ("parameter", 1.5, "N.m/rad", "Heading hold: proportional gain"),
    "K_i_psi": ("parameter", 0.8, "N.m/(rad.s)", "Heading hold: integral gain"),
    "K_d_psi": ("parameter", 0.8, "N.m.s/rad", "Heading hold: derivative gain"),
    "omega_psi": ("parameter", 1.0, "rad/s", "Heading hold: natural frequency of the reference model"),
    "r_max": ("parameter", 0.3, "rad/s", "Heading hold: most yaw velocity of the reference"),
    "T_t": ("parameter", 1.0, "s", "Tracking time of the anti-windup"),
    "u_max": ("parameter", 1.0, "1", "Most of a command with a full battery, 0 ... 1"),
    "u_rate": ("parameter", 4.0, "1/s", "Most change of a command"),
    "a_t_rear": ("parameter", 42.9, "N", "Quadratic thrust coefficient of the rear pair"),
    "b_t_rear": ("parameter", 2.711, "N", "Linear thrust coefficient of the rear pair"),
    "a_t_top": ("parameter", 6.494, "N", "Quadratic thrust coefficient of the top thruster"),
    "b_t_top": ("parameter", 0.0513, "N", "Linear thrust coefficient of the top thruster"),
    "R": ("parameter", 0.22, "m", "Distance from the centre of mass to a rear thruster"),
    "gamma": ("parameter", 0.423, "rad", "Angle of the rear thrusters' force about the centre of mass"),
}


def clamp(value: float, limit: float) -> float:
    """The value within ± limit."""
    return max(-limit, min(limit, value))


@dataclass(frozen=True)
class Thruster:
    """The thrust curve (2) of one thruster: a |c| c + b c."""

    a: float
    b: float

    def force(self, command: float) -> float:
        """Thrust (N) of a command."""
        return (self.a * abs(command) + self.b) * command

    def command(self, force: float) -> float:
        """The command that gives this thrust."""
        root = self.b + sqrt(self.b**2 + 4.0 * self.a * abs(force))
        return 2.0 * force / root if root > 0.0 else 0.0


@dataclass
class Hold:
    """A PID loop behind a second-order reference model, for a depth or, with a period, for an angle."""

    period: float | None = None
    on: bool = False
    measured: float = nan
    rate: float = 0.0
    reference: float = 0.0
    reference_rate: float = 0.0
    integral: float = 0.0

    def sample(self, value: float, on: bool, applied: float, h: float) -> None:
        """Take a measurement; where the hold goes on, start with the motion there is and the force that is applied."""
        self.rate = 0.0 if isnan(self.measured) else self._difference(value, self.measured) / h
        self.measured = value
        if not on:
            self.reference, self.reference_rate = value, 0.0
        elif not self.on:
            self.reference, self.reference_rate, self.integral = value, self.rate, applied
        self.on = on

    def demand(self, K_p: float, K_d: float) -> float:
        """The force (torque) that the loop wants."""
        return K_p * self._error() + self.integral + K_d * (self.reference_rate - self.rate)

    def advance(self, target: float, omega: float, rate_max: float, K_i: float, excess: float, h: float) -> None:
        """Integrate the error, less what the thrusters cannot give (per second), then move the reference on."""
        self.integral += h * (K_i * self._error() - excess)
        # Limited, the way to go makes the reference rate settle at its limit.
        way = clamp(self._difference(target, self.reference), 2.0 * rate_max / omega)
        self.reference_rate += h * omega * (omega * way - 2.0 * self.reference_rate)
        self.reference += h * self.reference_rate

    def _error(self) -> float:
        return self._difference(self.reference, self.measured)

    def _difference(self, a: float, b: float) -> float:
        return a - b if self.period is None else remainder(a - b, self.period)


class Autopilot(Fmi2Slave):  # type: ignore[misc]
    """The slave: sensors and sticks in, thruster commands out."""

    author = "rov-fmu"
    description = "Depth hold and heading hold: two PID loops from depth and heading to thruster commands"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=0.05)
    variables = VARIABLES
    terminals = (("pose", ("z", "psi")), ("thrusters", ("u_l", "u_r", "u_t")))

    u_l: float
    u_r: float
    u_t: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.depth = Hold()
        self.heading = Hold(FULL_TURN)
        changes = {"input": Fmi2Variability.continuous, "output": Fmi2Variability.discrete}
        for name, (causality, start, _, text) in VARIABLES.items():
            setattr(self, name, start)
            variability = changes.get(causality, Fmi2Variability.tunable)
            kind, variability = (Boolean, Fmi2Variability.discrete) if start is False else (Real, variability)
            how = {"causality": Fmi2Causality[causality], "variability": variability}
            self.register_variable(kind(name, description=text, **how))

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Sample the sensors at the start of the step; the commands are there at its end."""
        h = step_size
        rear = Thruster(0.5 * self.a_t_rear, 0.5 * self.b_t_rear)
        top = Thruster(self.a_t_top, self.b_t_top)
        arm = 2.0 * self.R * sin(self.gamma)  # torque per newton of difference from the mean of the two

        Z = top.force(self.u_t)
        N = 0.5 * arm * (rear.force(self.u_l) - rear.force(self.u_r))
        self.depth.sample(self.z, self.depth_hold, Z, h)
        self.heading.sample(self.psi, self.heading_hold, N, h)

        Z_d = self.depth.demand(self.K_p_z, self.K_d_z) if self.depth_hold else top.force(self.heave)
        N_d = self.heading.demand(self.K_p_psi, self.K_d_psi) if self.heading_hold else arm * rear.force(self.yaw)
        u_most = self.u_max * (1.0 - self.sag)
        most = rear.force(u_most)
        turning = clamp(N_d / arm, most)
        ahead = clamp(rear.force(self.surge), most - abs(turning))  # heading goes before speed

        change = self.u_rate * h
        wanted = {"u_t": top.command(Z_d), "u_l": rear.command(ahead + turning), "u_r": rear.command(ahead - turning)}
        for name, command in wanted.items():
            before = getattr(self, name)
            setattr(self, name, clamp(before + clamp(command - before, change), u_most))

        if self.depth_hold:
            excess = (Z_d - top.force(self.u_t)) / self.T_t
            self.depth.advance(self.z_ref, self.omega_z, self.w_max, self.K_i_z, excess, h)
        if self.heading_hold:
            excess = (N_d - 0.5 * arm * (rear.force(self.u_l) - rear.force(self.u_r))) / self.T_t
            self.heading.advance(self.psi_ref, self.omega_psi, self.r_max, self.K_i_psi, excess, h)
        self.z_d, self.psi_d = self.depth.reference, self.heading.reference
        return True
