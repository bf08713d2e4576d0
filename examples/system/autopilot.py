"""Depth hold and heading hold for the VideoRay, the two PID loops of its console, as a PythonFMU slave.

Each sample takes depth and heading from the sensors and gives the three thruster commands one sample later. A loop
works on force (N) or torque (N.m) and follows a reference model, which starts where the vehicle is when the hold is
switched on, so that nothing jumps. The thrust curve (2), inverted, turns force into command. PythonFMU writes no units;
they are in the descriptions.
"""

from dataclasses import dataclass
from math import isnan, nan, pi, remainder, sin, sqrt

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

FULL_TURN = 2.0 * pi

# name: start, description
_INPUTS: dict[str, tuple[float | bool, str]] = {
    "z": (0.0, "Measured depth (m)"),
    "psi": (0.0, "Measured heading (rad), wrapped or not"),
    "z_ref": (0.0, "Depth to hold (m)"),
    "psi_ref": (0.0, "Heading to hold (rad)"),
    "surge": (0.0, "Stick forward, -1 ... 1: command of both rear thrusters"),
    "heave": (0.0, "Stick down, -1 ... 1: command of the top thruster while depth hold is off"),
    "yaw": (0.0, "Stick to starboard, -1 ... 1: opposite commands of the rear thrusters while heading hold is off"),
    "depth_hold": (False, "Depth hold is on"),
    "heading_hold": (False, "Heading hold is on"),
    "sag": (0.0, "Drop of the battery's voltage, by which the largest command falls (1)"),
}
_OUTPUTS = {
    "u_l": (0.0, "Left thruster command, positive forward"),
    "u_r": (0.0, "Right thruster command, positive forward"),
    "u_t": (0.0, "Top thruster command, positive down"),
    "z_d": (0.0, "Depth that the reference model wants now (m)"),
    "psi_d": (0.0, "Heading that the reference model wants now (rad)"),
}
_PARAMETERS = {
    "K_p_z": (60.0, "Depth hold: proportional gain (N/m)"),
    "K_i_z": (30.0, "Depth hold: integral gain (N/(m.s))"),
    "K_d_z": (45.0, "Depth hold: derivative gain (N.s/m)"),
    "omega_z": (0.6, "Depth hold: natural frequency of the reference model (rad/s)"),
    "w_max": (0.25, "Depth hold: most heave velocity of the reference (m/s)"),
    "K_p_psi": (1.5, "Heading hold: proportional gain (N.m/rad)"),
    "K_i_psi": (0.8, "Heading hold: integral gain (N.m/(rad.s))"),
    "K_d_psi": (0.8, "Heading hold: derivative gain (N.m.s/rad)"),
    "omega_psi": (1.0, "Heading hold: natural frequency of the reference model (rad/s)"),
    "r_max": (0.3, "Heading hold: most yaw velocity of the reference (rad/s)"),
    "T_t": (1.0, "Tracking time of the anti-windup (s)"),
    "u_max": (1.0, "Most of a command with a full battery, 0 ... 1"),
    "u_rate": (4.0, "Most change of a command (1/s)"),
    "a_t_rear": (42.9, "Quadratic thrust coefficient of the rear pair (N)"),
    "b_t_rear": (2.711, "Linear thrust coefficient of the rear pair (N)"),
    "a_t_top": (6.494, "Quadratic thrust coefficient of the top thruster (N)"),
    "b_t_top": (0.0513, "Linear thrust coefficient of the top thruster (N)"),
    "R": (0.22, "Distance from the centre of mass to a rear thruster (m)"),
    "gamma": (0.423, "Angle of the rear thrusters' force about the centre of mass (rad)"),
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

    u_l: float
    u_r: float
    u_t: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.depth = Hold()
        self.heading = Hold(FULL_TURN)
        for causality, variability, variables in (
            (Fmi2Causality.input, Fmi2Variability.continuous, _INPUTS),
            (Fmi2Causality.output, Fmi2Variability.discrete, _OUTPUTS),
            (Fmi2Causality.parameter, Fmi2Variability.tunable, _PARAMETERS),
        ):
            for name, (start, text) in variables.items():
                setattr(self, name, start)
                kind, changes = (Boolean, Fmi2Variability.discrete) if start is False else (Real, variability)
                self.register_variable(kind(name, description=text, causality=causality, variability=changes))

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
