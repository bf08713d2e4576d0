"""The ROV of the paper: axes, coefficients and variables, declared once, and the exact step (standard library only).

Signs and symbols follow Fossen/SNAME and the paper: body frame x forward, y starboard, z down; earth frame
north-east-down; u, w, r are surge, heave and yaw velocity through the water. Heave is positive down.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import cos, inf, pi, sin

from .path import turning_step
from .riccati import Riccati

# ---- Axes ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Axis:
    """One axis, and how one command drives it alone: the single declaration of its symbols, units and words.

    A test of an axis is one number held over time, a fraction -1 ... 1 of full thrust; positive moves the vehicle
    forward, down, or its bow to starboard.
    """

    name: str
    velocity: str
    """Symbol: u, w or r. The coefficients of the axis are a_d_<velocity> ... beta_<velocity>."""
    unit: str
    """Of the velocity."""
    positive: str
    """Direction of a positive velocity, force or torque."""
    position: str
    """What a sensor measures along the axis; its rate is the velocity."""
    position_unit: str
    load: str
    """Unit of force or torque."""
    external: str
    """The input that acts on it beside the thrust."""
    inertia: str
    """The coefficient that resists acceleration: m_rov or I_r."""
    signs: Mapping[str, float]
    """Of the thruster commands that a test holds."""
    thruster: str
    """rear or top: its thrust is a_t_<thruster>, b_t_<thruster>."""
    equations: tuple[str, str]
    """Of the paper: drag, motion."""

    def coefficient(self, kind: str) -> str:
        """Name of a coefficient of the axis: kind is a_d, b_d, alpha or beta."""
        return f"{kind}_{self.velocity}"

    @property
    def push(self) -> str:
        """What its thrusters give."""
        return "thrust" if self.load == "N" else "torque"

    @property
    def thrust_names(self) -> tuple[str, str]:
        """The coefficients of its thrust curve."""
        return f"a_t_{self.thruster}", f"b_t_{self.thruster}"

    def inputs(self, command: float) -> "Inputs":
        """The inputs that hold a command (fraction of full thrust)."""
        return Inputs(**{name: sign * command for name, sign in self.signs.items()})

    def held(self, coefficients: "Coefficients", command: float) -> Riccati:
        """The motion under a held command, (18)."""
        return axes(coefficients, self.inputs(command))[list(AXES).index(self.name)]

    def response(self, coefficients: "Coefficients", command: float) -> tuple[float, float]:
        """Signed V_ss, and Tau (17) in s from rest, in closed form."""
        motion = self.held(coefficients, command)
        return motion.steady_velocity(), motion.time_constant()

    def force(self, coefficients: "Coefficients", command: float) -> float:
        """Thrust (N) or torque (N.m) before the tuning α, by (9), (10) and (4)."""
        F = thrust(coefficients, self.inputs(command))
        return {"u": F.F_l + F.F_r, "w": F.F_t, "r": F.tau_rear}[self.velocity]


SURGE = Axis("surge", "u", "m/s", "forward", "distance", "m", "N", "X_ext", "m_rov", {"u_l": 1.0, "u_r": 1.0}, "rear",
             ("(14)", "(18a)"))  # fmt: skip
HEAVE = Axis("heave", "w", "m/s", "down", "depth", "m", "N", "Z_ext", "m_rov", {"u_t": 1.0}, "top", ("(15)", "(18b)"))
YAW = Axis("yaw", "r", "rad/s", "bow to starboard", "heading", "rad", "N.m", "N_ext", "I_r", {"u_l": 1.0, "u_r": -1.0},
           "rear", ("(16)", "(18c)"))  # fmt: skip
AXES = {axis.name: axis for axis in (SURGE, HEAVE, YAW)}


# ---- Coefficients and variables --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Meta:
    """What a coefficient or a variable is: SI unit, words, the values allowed (both ends included), a typical size."""

    unit: str
    description: str
    minimum: float = -inf
    maximum: float = inf
    nominal: float = 1.0
    tunable: bool = False


def _coefficient(unit: str, description: str, minimum: float, maximum: float, *, tunable: bool = False) -> float:
    value: float = field(metadata={"meta": Meta(unit, description, minimum, maximum, tunable=tunable)})
    return value


def _variable(unit: str, description: str, nominal: float = 1.0, limit: float = inf) -> float:
    value: float = field(default=0.0, metadata={"meta": Meta(unit, description, -limit, limit, nominal)})
    return value


def _curve(name: str, kind: str, thruster: str, equation: str) -> float:
    return _coefficient("N", f"{name} thrust coefficient {kind} of the {thruster}, {equation}", -1e6, 1e6)


def _drag(name: str, kind: str, power: str, axis: Axis) -> float:
    unit = f"{axis.load}.s{power}/{axis.position_unit}{power}"
    return _coefficient(unit, f"{name} drag coefficient {kind} of {axis.name}, {axis.equations[0]}", 0.0, 1e6)


def _tuning(symbol: str, scales: str, axis: Axis) -> float:
    words = f"Tuning {symbol}_{axis.velocity}: scales {scales} in {axis.name}, {axis.equations[1]}"
    return _coefficient("1", words, 0.0, 1e3, tunable=True)


def _command(which: str, positive: str) -> float:
    words = f"{which.capitalize()} thruster command u_{which[0]}, positive {positive}; saturates at ±1"
    return _variable("1", words, limit=1.0)


def _load(axis: Axis, examples: str, nominal: float) -> float:
    return _variable(axis.load, f"Load from outside in {axis.name} ({examples}), positive {axis.positive}", nominal)


def _velocity(axis: Axis, of_what: str = " through the water") -> float:
    words = f"{axis.name.capitalize()} velocity {axis.velocity}{of_what}, positive {axis.positive}"
    return _variable(axis.unit, words)


@dataclass(frozen=True)
class Coefficients:
    """The identified coefficients of one vehicle (Table 9)."""

    m_rov: float = _coefficient("kg", "Mass m_rov, (3a), (3b)", 1e-3, 1e6)
    I_r: float = _coefficient("kg.m2", "Moment of inertia about the vertical axis I_r, (3c)", 1e-6, 1e6)
    R: float = _coefficient("m", "Distance from the centre of mass to a rear thruster R, (4)", 0.0, 100.0)
    gamma: float = _coefficient(
        "rad", "Angle of the rear thrusters' force about the centre of mass γ, (4)", 0.0, pi / 2
    )
    a_t_rear: float = _curve("Quadratic", "a_t", "rear pair", "(9)")
    b_t_rear: float = _curve("Linear", "b_t", "rear pair", "(9)")
    a_t_top: float = _curve("Quadratic", "a_t", "top thruster", "(10)")
    b_t_top: float = _curve("Linear", "b_t", "top thruster", "(10)")
    a_d_u: float = _drag("Quadratic", "a_d", "2", SURGE)
    b_d_u: float = _drag("Linear", "b_d", "", SURGE)
    a_d_w: float = _drag("Quadratic", "a_d", "2", HEAVE)
    b_d_w: float = _drag("Linear", "b_d", "", HEAVE)
    a_d_r: float = _drag("Quadratic", "a_d", "2", YAW)
    b_d_r: float = _drag("Linear", "b_d", "", YAW)
    alpha_u: float = _tuning("α", SURGE.push, SURGE)
    beta_u: float = _tuning("β", "acceleration", SURGE)
    alpha_w: float = _tuning("α", HEAVE.push, HEAVE)
    beta_w: float = _tuning("β", "acceleration", HEAVE)
    alpha_r: float = _tuning("α", YAW.push, YAW)
    beta_r: float = _tuning("β", "acceleration", YAW)


@dataclass(frozen=True)
class Inputs:
    """Commands (fractions of full thrust, beyond ±1 saturated), loads from outside (N, N, N.m), current (m/s)."""

    u_l: float = _command("left", "forward")
    u_r: float = _command("right", "forward")
    u_t: float = _command("top", "down")
    X_ext: float = _load(SURGE, "tether, contact", 10.0)
    Z_ext: float = _load(HEAVE, "tether, ballast", 10.0)
    N_ext: float = _load(YAW, "tether, contact", 1.0)
    V_N: float = _variable("m/s", "Velocity of a steady horizontal current, northward")
    V_E: float = _variable("m/s", "Velocity of a steady horizontal current, eastward")


@dataclass(frozen=True)
class State:
    """Velocity through the water (m/s, m/s, rad/s) and pose in the earth frame (m, m, m, rad; psi is not wrapped)."""

    u: float = _velocity(SURGE)
    w: float = _velocity(HEAVE)
    r: float = _velocity(YAW, "")
    x: float = _variable("m", "Position north x", 10.0)
    y: float = _variable("m", "Position east y", 10.0)
    z: float = _variable("m", "Depth z, positive down", 10.0)
    psi: float = _variable("rad", "Heading ψ, positive north to east, not wrapped")


@dataclass(frozen=True)
class Thrust:
    """Force of each thruster (N) and the torque of the rear pair (N.m), before the tuning α."""

    F_l: float = _variable("N", "Thrust of the left thruster F_l, half of (9) for the pair")
    F_r: float = _variable("N", "Thrust of the right thruster F_r, half of (9) for the pair")
    F_t: float = _variable("N", "Thrust of the top thruster F_t, (10), positive down")
    tau_rear: float = _variable("N.m", "Torque of the rear thrusters τ_rear, (4), positive bow to starboard")


def declared(struct: type) -> dict[str, Meta]:
    """The members of one of these classes, in their order."""
    return {f.name: f.metadata["meta"] for f in fields(struct)}


COEFFICIENTS = declared(Coefficients)


# ---- The model -------------------------------------------------------------------------------------------------------


def saturate(command: float) -> float:
    """A thruster command within ±1."""
    return max(-1.0, min(1.0, command))


def thruster_force(a_t: float, b_t: float, command: float) -> float:
    """Thrust (2): a_t |c| c + b_t c in N."""
    c = saturate(command)
    return (a_t * abs(c) + b_t) * c


def thrust(k: Coefficients, i: Inputs) -> Thrust:
    """Thrust of the commands: half of (9) for each rear thruster, (10) for the top one, torque by (4)."""
    F_l = 0.5 * thruster_force(k.a_t_rear, k.b_t_rear, i.u_l)
    F_r = 0.5 * thruster_force(k.a_t_rear, k.b_t_rear, i.u_r)
    F_t = thruster_force(k.a_t_top, k.b_t_top, i.u_t)
    return Thrust(F_l, F_r, F_t, k.R * sin(k.gamma) * (F_l - F_r))


def axes(k: Coefficients, i: Inputs) -> tuple[Riccati, Riccati, Riccati]:
    """Surge, heave and yaw under held inputs, (18): m v' = β (α F + F_ext - a_d |v| v - b_d v)."""
    F = thrust(k, i)

    def axis(m: float, beta: float, a_d: float, b_d: float, force: float) -> Riccati:
        g = beta / m
        return Riccati(g * a_d, g * b_d, g * force)

    return (
        axis(k.m_rov, k.beta_u, k.a_d_u, k.b_d_u, k.alpha_u * (F.F_l + F.F_r) + i.X_ext),
        axis(k.m_rov, k.beta_w, k.a_d_w, k.b_d_w, k.alpha_w * F.F_t + i.Z_ext),
        axis(k.I_r, k.beta_r, k.a_d_r, k.b_d_r, k.alpha_r * F.tau_rear + i.N_ext),
    )


def derivatives(k: Coefficients, i: Inputs, s: State) -> State:
    """Time derivatives of the state: (18) and the kinematics, the current added to the horizontal velocity."""
    surge, heave, yaw = axes(k, i)
    return State(
        u=surge.acceleration(s.u),
        w=heave.acceleration(s.w),
        r=yaw.acceleration(s.r),
        x=s.u * cos(s.psi) + i.V_N,
        y=s.u * sin(s.psi) + i.V_E,
        z=s.w,
        psi=s.r,
    )


def step(k: Coefficients, i: Inputs, s: State, h: float) -> State:
    """The state after h > 0 seconds with the inputs held, exact up to rounding whatever the length of h."""
    surge, heave, yaw = axes(k, i)
    if s.r == 0.0 and yaw.C == 0.0:
        (u, ahead), aside, r, turn = surge.advance(s.u, h), 0.0, 0.0, 0.0
    else:
        ahead, aside, u, r, turn = turning_step(surge, yaw, s.u, s.r, h)
    w, depth = heave.advance(s.w, h)
    c, d = cos(s.psi), sin(s.psi)
    return State(
        u=u,
        w=w,
        r=r,
        x=s.x + (ahead * c - aside * d) + i.V_N * h,
        y=s.y + (ahead * d + aside * c) + i.V_E * h,
        z=s.z + depth,
        psi=s.psi + turn,
    )
