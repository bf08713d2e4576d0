"""The ROV of the paper: thrust, three axes and the pose, stepped exactly (standard library only).

Signs and symbols follow Fossen/SNAME and the paper: body frame x forward, y starboard, z down; earth frame
north-east-down; u, w, r are surge, heave and yaw velocity through the water. Heave is positive down.
"""

from dataclasses import dataclass, field, fields
from itertools import pairwise
from math import cos, inf, isfinite, nan, pi, remainder, sin, sqrt, tau

from . import riccati


@dataclass(frozen=True)
class Meta:
    """What a coefficient is: its SI unit, its place in the paper, and the values allowed, both ends included."""

    unit: str
    description: str
    minimum: float
    maximum: float
    tunable: bool = False


def _coefficient(unit: str, description: str, minimum: float, maximum: float, tunable: bool = False) -> float:
    meta = Meta(unit, description, minimum, maximum, tunable)
    value: float = field(metadata={"meta": meta})
    return value


@dataclass(frozen=True)
class Coefficients:
    """The identified coefficients of one vehicle (Table 9), the single declaration of names, units and bounds."""

    m_rov: float = _coefficient("kg", "Mass m_rov, (3a), (3b)", 1e-3, 1e6)
    I_r: float = _coefficient("kg.m2", "Moment of inertia about the vertical axis I_r, (3c)", 1e-6, 1e6)
    R: float = _coefficient("m", "Distance from the centre of mass to a rear thruster R, (4)", 0.0, 100.0)
    gamma: float = _coefficient(
        "rad", "Angle of the rear thrusters' force about the centre of mass γ, (4)", 0.0, pi / 2
    )
    a_t_rear: float = _coefficient("N", "Quadratic thrust coefficient a_t of the rear pair, (9)", -1e6, 1e6)
    b_t_rear: float = _coefficient("N", "Linear thrust coefficient b_t of the rear pair, (9)", -1e6, 1e6)
    a_t_top: float = _coefficient("N", "Quadratic thrust coefficient a_t of the top thruster, (10)", -1e6, 1e6)
    b_t_top: float = _coefficient("N", "Linear thrust coefficient b_t of the top thruster, (10)", -1e6, 1e6)
    a_d_u: float = _coefficient("N.s2/m2", "Quadratic drag coefficient a_d of surge, (14)", 0.0, 1e6)
    b_d_u: float = _coefficient("N.s/m", "Linear drag coefficient b_d of surge, (14)", 0.0, 1e6)
    a_d_w: float = _coefficient("N.s2/m2", "Quadratic drag coefficient a_d of heave, (15)", 0.0, 1e6)
    b_d_w: float = _coefficient("N.s/m", "Linear drag coefficient b_d of heave, (15)", 0.0, 1e6)
    a_d_r: float = _coefficient("N.m.s2/rad2", "Quadratic drag coefficient a_d of yaw, (16)", 0.0, 1e6)
    b_d_r: float = _coefficient("N.m.s/rad", "Linear drag coefficient b_d of yaw, (16)", 0.0, 1e6)
    alpha_u: float = _coefficient("1", "Tuning α_u: scales thrust in surge, (18a)", 0.0, 1e3, True)
    beta_u: float = _coefficient("1", "Tuning β_u: scales acceleration in surge, (18a)", 0.0, 1e3, True)
    alpha_w: float = _coefficient("1", "Tuning α_w: scales thrust in heave, (18b)", 0.0, 1e3, True)
    beta_w: float = _coefficient("1", "Tuning β_w: scales acceleration in heave, (18b)", 0.0, 1e3, True)
    alpha_r: float = _coefficient("1", "Tuning α_r: scales torque in yaw, (18c)", 0.0, 1e3, True)
    beta_r: float = _coefficient("1", "Tuning β_r: scales acceleration in yaw, (18c)", 0.0, 1e3, True)


COEFFICIENTS: dict[str, Meta] = {f.name: f.metadata["meta"] for f in fields(Coefficients)}


@dataclass(frozen=True)
class Inputs:
    """Commands (fractions of full thrust, beyond ±1 saturated), loads from outside (N, N, N.m), current (m/s)."""

    u_l: float = 0.0
    u_r: float = 0.0
    u_t: float = 0.0
    X_ext: float = 0.0
    Z_ext: float = 0.0
    N_ext: float = 0.0
    V_N: float = 0.0
    V_E: float = 0.0


@dataclass(frozen=True)
class State:
    """Velocity through the water (m/s, m/s, rad/s) and pose in the earth frame (m, m, m, rad; psi is not wrapped)."""

    u: float = 0.0
    w: float = 0.0
    r: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    psi: float = 0.0


@dataclass(frozen=True)
class Thrust:
    """Force of each thruster (N) and the torque of the rear pair (N.m), before the tuning α."""

    F_l: float
    F_r: float
    F_t: float
    tau_rear: float


@dataclass(frozen=True)
class Axis:
    """One axis under a held force: v' = C - B v - A |v| v."""

    A: float
    B: float
    C: float

    def acceleration(self, v: float) -> float:
        """v' (18)."""
        return self.C - (self.B + self.A * abs(v)) * v

    def advance(self, v: float, h: float) -> tuple[float, float]:
        """Velocity after h > 0 seconds and the distance (angle) covered."""
        return riccati.advance(self.A, self.B, self.C, v, h)

    def velocity(self, v: float, h: float) -> float:
        """Velocity after h seconds."""
        return self.advance(v, h)[0]

    def distance(self, v: float, h: float) -> float:
        """Distance (angle) covered in h seconds."""
        return self.advance(v, h)[1]

    def steady_velocity(self) -> float:
        """V_ss."""
        return riccati.steady_velocity(self.A, self.B, self.C)

    def time_constant(self) -> float:
        """Tau of (17), from rest."""
        return riccati.time_constant(self.A, self.B, self.C)

    def turning_time(self, v: float) -> float:
        """When the force brings the motion to rest and turns it; infinite where it does not."""
        if (v <= 0.0 or self.C >= 0.0) and (v >= 0.0 or self.C <= 0.0):  # a product would underflow
            return inf
        return riccati.time_to_rest(self.A, self.B, -abs(self.C), abs(v))


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


def axes(k: Coefficients, i: Inputs) -> tuple[Axis, Axis, Axis]:
    """Surge, heave and yaw under held inputs, (18): m v' = β (α F + F_ext - a_d |v| v - b_d v)."""
    F = thrust(k, i)

    def axis(m: float, beta: float, a_d: float, b_d: float, force: float) -> Axis:
        g = beta / m
        return Axis(g * a_d, g * b_d, g * force)

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


_Rule = tuple[tuple[float, float], ...]

# Gauss-Legendre rules on [-1, 1], positive nodes: the short one for panels over which little changes.
_GAUSS_4 = (
    (0.33998104358485626, 0.6521451548625461),
    (0.8611363115940526, 0.34785484513745385),
)
_GAUSS_8 = (
    (0.18343464249564980, 0.36268378337836198),
    (0.52553240991632899, 0.31370664587788729),
    (0.79666647741362674, 0.22238103445337447),
    (0.96028985649753623, 0.10122853629037626),
)
_EPS = 2.0**-52
_MOST_PIECES = 100_000  # of a part of a turn: 12,900 seen on the way from 1e30 rad/s to 1e-28 rad/s
_ORDER = 8  # terms of the expansion at the ends of a fast turn


_Motion = tuple[float, float, float, float, float]  # distance ahead and aside, u, r, angle turned


def turning_step(surge: Axis, yaw: Axis, u: float, r: float, h: float) -> _Motion:
    """Distance covered in h seconds ahead and to starboard of the first heading, then u, r and the angle turned.

    The distance is the integral of u e^(i turn). It is cut where surge or yaw come to rest, and each part into
    Gauss-Legendre panels on the exact velocity and turn, short against the time constants and the turn rate. Where the
    vehicle turns fast against the changes of velocity (in a steady turn at the latest) the two ends of the part are
    enough, by parts over the heading. What cannot be computed, for it overflows, is NaN.
    """
    ahead = aside = turn = 0.0
    surge_turns, yaw_turns = surge.turning_time(u), yaw.turning_time(r)
    cuts = sorted(t for t in (surge_turns, yaw_turns) if t < h)
    for start, end in pairwise([0.0, *cuts, h]):
        if end > start:
            ahead, aside, u, r, turn = _planar_leg(surge, yaw, (ahead, aside, u, r, turn), end - start)
        # At rest to the last digit, or what follows would take the branch of before the turn.
        u = 0.0 if end == surge_turns else u
        r = 0.0 if end == yaw_turns else r
    return ahead, aside, u, r, turn


def _planar_leg(surge: Axis, yaw: Axis, motion: _Motion, rest: float) -> _Motion:
    """The part of a turning step in which surge and yaw keep their signs."""
    ahead, aside, u, r, turned = motion
    u_end, left = surge.advance(u, rest)
    r_end, angle = yaw.advance(r, rest)
    turn = turned + angle
    for _ in range(_MOST_PIECES):
        if not (isfinite(left) and isfinite(angle)):
            break
        if abs(angle) < _EPS / 4 or abs(left) <= _EPS / 16 * (abs(ahead) + abs(aside)):
            length, (a, b) = rest, (left, 0.0)
        else:
            length, (a, b) = _longest_piece(surge, yaw, u, r, rest)
        c, d = cos(turned), sin(turned)
        ahead, aside = ahead + (a * c - b * d), aside + (a * d + b * c)
        if length == rest:
            return ahead, aside, u_end, r_end, turn
        rest -= length
        u = surge.velocity(u, length)
        r, gone = yaw.advance(r, length)
        turned = remainder(turned + gone, tau)  # rounded as a small angle
        left, angle = surge.distance(u, rest), yaw.distance(r, rest)
    return nan, nan, u_end, r_end, nan


def _longest_piece(surge: Axis, yaw: Axis, u: float, r: float, rest: float) -> tuple[float, tuple[float, float]]:
    """The start of the remaining time that one formula covers, and the integral of u e^(i turn) over it.

    Two good ends vouch for what lies between them only if the turn does not slow down much.
    """
    bending = max(_rate(surge, u), _rate(yaw, r))
    turning = _turning_rate(yaw, r)
    # a time over which eight nodes give the integral to rounding
    panel = min(1.0 / bending if bending > 0.0 else inf, 2.0 / turning if turning > 0.0 else inf)
    drag = _drag(surge, u), _drag(yaw, r)
    if panel < rest and (at_start := _radius_derivatives(surge, yaw, drag, u, r)):
        length = min(rest, _slowing_time(yaw, r))
        while length > panel:
            u_end, r_end = surge.velocity(u, length), yaw.velocity(r, length)
            if at_end := _radius_derivatives(surge, yaw, drag, u_end, r_end):
                (a, b), (c, d) = _by_parts(at_start, 0.0), _by_parts(at_end, yaw.distance(r, length))
                return length, (c - a, d - b)
            length *= 0.25
    length = min(rest, panel)
    is_short = length * bending < 0.08 and length * turning < 0.14
    return length, _panel(surge, yaw, u, r, length, _GAUSS_4 if is_short else _GAUSS_8)


def _settled(axis: Axis, v: float) -> bool:
    """Whether v is the steady velocity, up to rounding; that of a subnormal v is told at 2^1000 times its size."""
    rate = abs(axis.acceleration(v))
    slope = axis.B + 2.0 * axis.A * abs(v)
    return rate <= 16.0 * _EPS * abs(axis.C) or 2.0**1000 * rate <= 2.0**-72 * (1.0 + slope)


def _rate(axis: Axis, v: float) -> float:
    """How fast the velocity bends (1/s): its solution is analytic within 2/rate."""
    return 0.0 if _settled(axis, v) else axis.B + 2.0 * axis.A * abs(v) + 2.0 * sqrt(axis.A * abs(axis.C))


def _turning_rate(yaw: Axis, r: float) -> float:
    """How fast the direction changes (rad/s): by the turn rate, and by its growth from rest, turn ~ r' t^2/2."""
    return abs(r) + (0.0 if _settled(yaw, r) else 2.0 * sqrt(abs(yaw.acceleration(r))))


def _slowing_time(yaw: Axis, r: float) -> float:
    """A time (s) in which the turn rate keeps half of its size: what slows it down is strongest at the start."""
    rate = yaw.acceleration(r)
    return inf if _settled(yaw, r) or (r > 0.0) == (rate > 0.0) else 0.5 * abs(r / rate)


def _panel(surge: Axis, yaw: Axis, u: float, r: float, h: float, rule: _Rule) -> tuple[float, float]:
    """The integral of u e^(i turn) over one panel by Gauss-Legendre quadrature."""
    half = 0.5 * h
    ahead = aside = 0.0
    for node, weight in rule:
        for t in (half - half * node, half + half * node):
            distance = half * weight * surge.velocity(u, t)
            angle = yaw.distance(r, t)
            ahead += distance * cos(angle)
            aside += distance * sin(angle)
    return ahead, aside


def _by_parts(g: list[float], turn: float) -> tuple[float, float]:
    """The antiderivative of u e^(i turn) by parts over the heading: e^(i turn) (-i g + g' + i g'' - g(3) - ...)."""
    real = sum((1.0, -1.0)[n // 2 % 2] * g[n] for n in range(1, _ORDER, 2))
    imag = sum((-1.0, 1.0)[n // 2 % 2] * g[n] for n in range(0, _ORDER, 2))
    c, d = cos(turn), sin(turn)
    return real * c - imag * d, real * d + imag * c


def _radius_derivatives(surge: Axis, yaw: Axis, drag: tuple[float, float], u: float, r: float) -> list[float] | None:
    """The radius of the turn g = u/r and its derivatives by the heading; None where they do not fall off.

    They come from the Taylor series of u and r in time: d/d(heading) = (1/r) d/dt. Time is counted in radians at the
    turn rate of the start, in which no coefficient overflows that matters.
    """
    if abs(r) <= max(_rate(surge, u), _rate(yaw, r)):
        return None
    series, turning = _taylor(surge, drag[0], u, r), [c / r for c in _taylor(yaw, drag[1], r, r)]
    g: list[float] = []
    for _ in range(_ORDER + 1):
        quotient: list[float] = []
        for n, c in enumerate(series):
            quotient.append(c - sum(quotient[j] * turning[n - j] for j in range(n)))
        g.append(quotient[0] / r)
        series = [n * c for n, c in enumerate(quotient)][1:]
    # Two orders are looked at, for at rest every other one vanishes.
    largest = max(map(abs, g))
    return g if isfinite(largest) and all(abs(last) <= _EPS * largest for last in g[-2:]) else None


def _drag(axis: Axis, v: float) -> float:
    """Quadratic drag with the sign that it has in the direction of v, or of the start from rest."""
    return axis.A if v > 0.0 or (v == 0.0 and axis.C >= 0.0) else -axis.A


def _taylor(axis: Axis, A: float, v: float, rate: float) -> list[float]:
    """Taylor coefficients of v by rate t from v' = C - B v - A v^2; a settled axis is constant."""
    if _settled(axis, v):
        return [v] + [0.0] * _ORDER
    c, a, b = [v], A / rate, axis.B / rate
    for n in range(_ORDER):
        square = sum(a * c[j] * c[n - j] for j in range(n + 1))
        c.append(((axis.C / rate if n == 0 else 0.0) - b * c[n] - square) / (n + 1))
    return c
