"""The motion of a rigid body in water in six degrees of freedom, written out independently of the package.

The equations are those of Fossen, Handbook of Marine Craft and Hydrodynamics and Motion Control (2nd edition, 2021):

    M v' + C(v) v + D v + D_q(|v|) v + g(eta) = tau,    eta' = J(eta) v + current,

with 6x6 matrices, the velocities v = (u, v, w, p, q, r) through the water, and a quaternion for the attitude. `rates`
uses only + - * / and abs, so the numbers may be floats or numbers of mpmath. No formula of rov_fmu/equation/ is used.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpmath import mp
from scipy.integrate import solve_ivp

Number = Any  # a float or a number of mpmath
Vector = Sequence[Number]
Matrix = Sequence[Sequence[Number]]
Floats = np.ndarray[Any, np.dtype[np.float64]]

VELOCITIES = "uvwpqr"
"""The symbols of the six velocities, in Fossen's order."""


def zeros() -> list[list[float]]:
    """Return a 6x6 matrix of zeros."""
    return [[0.0] * 6 for _ in range(6)]


@dataclass(frozen=True)
class Propeller:
    """A thruster. Its force along its direction is f - d v_a, with the speed of advance v_a at its place."""

    position: Vector
    """The position in the body frame, m."""
    direction: Vector
    """The direction of a positive force, a unit vector."""
    target: Number = 0.0
    """The steady force f in water at rest, N."""
    advance: Number = 0.0
    """d: the loss of force per speed of advance, N.s/m."""
    lag: Number = 0.0
    """The time constant of f, s. When it is not 0, f is a state."""


@dataclass(frozen=True)
class Body:
    """A vehicle with held commands. Axes that it does not have are held at rest."""

    axes: str
    """The symbols of the velocities that the vehicle has."""
    mass: Matrix
    """The mass matrix, rigid body and added mass together, about the origin of the body frame."""
    linear: Matrix = field(default_factory=zeros)
    """The linear damping D for v_j > 0: the force along axis i is -D_ij v_j."""
    linear_astern: Matrix = field(default_factory=zeros)
    """The linear damping for v_j < 0."""
    ahead: Matrix = field(default_factory=zeros)
    """The quadratic damping for v_j > 0: the force along axis i is -D_ij |v_j| v_j."""
    astern: Matrix = field(default_factory=zeros)
    """The quadratic damping for v_j < 0."""
    bilinear: Mapping[tuple[str, str, str], Number] = field(default_factory=dict)
    """Forces along the first axis proportional to the product of the other two velocities: ("v", "u", "v") is Y_uv."""
    fins: Mapping[tuple[str, str], Number] = field(default_factory=dict)
    """Forces along the first axis proportional to |u| times the second velocity."""
    propellers: Sequence[Propeller] = ()
    alpha: Vector = (1.0,) * 6
    """The tuning of the thrust along each axis, (18)."""
    load: Vector = (0.0,) * 6
    """Loads from outside in the body frame, N and N.m."""
    weight: Number = 0.0
    buoyancy: Number = 0.0
    centre_of_gravity: Vector = (0.0, 0.0, 0.0)
    centre_of_buoyancy: Vector = (0.0, 0.0, 0.0)
    current: Vector = (0.0, 0.0, 0.0)
    """The velocity of the water, north, east and down, m/s."""

    @property
    def places(self) -> list[int]:
        """The places of the vehicle's axes among the six."""
        return [VELOCITIES.index(name) for name in self.axes]

    @property
    def inverse(self) -> Matrix:
        """The inverse of the part of the mass matrix that belongs to the vehicle's axes."""
        part = [[self.mass[i][j] for j in self.places] for i in self.places]
        inverse = np.linalg.inv(part) if isinstance(part[0][0], float) else mp.matrix(part) ** -1
        return inverse.tolist()  # type: ignore[no-any-return]


def rigid_body_mass(m: float, inertia: Matrix, centre: Vector) -> list[list[float]]:
    """Return the mass matrix of a rigid body. The inertia is about the origin, not the centre."""
    S = skew(centre)
    found = zeros()
    for i in range(3):
        found[i][i] = m
        for j in range(3):
            found[i][3 + j], found[3 + i][j], found[3 + i][3 + j] = -m * S[i][j], m * S[i][j], inertia[i][j]
    return found


def skew(a: Vector) -> list[list[Number]]:
    """Return the matrix S(a) of a cross product: S(a) b = a x b."""
    return [[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]]


def cross(a: Vector, b: Vector) -> list[Number]:
    """Return a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def times(A: Matrix, x: Vector) -> list[Number]:
    """Return the product of a matrix and a vector."""
    return [sum((a * b for a, b in zip(row, x, strict=True)), start=0 * x[0]) for row in A]


def coriolis(M: Matrix, nu: Vector) -> list[list[Number]]:
    """Return C(v) of a mass matrix: skew symmetric, so it does no work."""
    momentum = times(M, nu)
    upper, lower = skew(momentum[:3]), skew(momentum[3:])
    return [
        [*([0] * 3), *(-x for x in upper[0])],
        [*([0] * 3), *(-x for x in upper[1])],
        [*([0] * 3), *(-x for x in upper[2])],
        *([*(-x for x in upper[i]), *(-x for x in lower[i])] for i in range(3)),
    ]


def rotation(quaternion: Vector) -> list[list[Number]]:
    """Return the matrix from the body to the earth frame of a quaternion (scalar first) of any length."""
    e, a, b, c = quaternion
    n = e * e + a * a + b * b + c * c
    return [
        [1 - 2 * (b * b + c * c) / n, 2 * (a * b - c * e) / n, 2 * (a * c + b * e) / n],
        [2 * (a * b + c * e) / n, 1 - 2 * (a * a + c * c) / n, 2 * (b * c - a * e) / n],
        [2 * (a * c - b * e) / n, 2 * (b * c + a * e) / n, 1 - 2 * (a * a + b * b) / n],
    ]


def quaternion_of(phi: Number, theta: Number, psi: Number) -> list[Number]:
    """Return the quaternion of Euler angles (zyx), in numbers of mpmath."""
    half = [mp.mpf(angle) / 2 for angle in (phi, theta, psi)]
    (cp, ct, cs), (sp, st, ss) = map(mp.cos, half), map(mp.sin, half)
    return [
        cp * ct * cs + sp * st * ss,
        sp * ct * cs - cp * st * ss,
        cp * st * cs + sp * ct * ss,
        cp * ct * ss - sp * st * cs,
    ]


def euler_angles(R: Matrix) -> tuple[Number, Number, Number]:
    """Return the Euler angles phi, theta and psi (zyx) of a rotation matrix, in numbers of mpmath."""
    theta = mp.atan2(-R[2][0], mp.hypot(R[2][1], R[2][2]))
    return mp.atan2(R[2][1], R[2][2]), theta, mp.atan2(R[1][0], R[0][0])


def forces(body: Body, nu: Vector, R: Matrix, lagging: Vector) -> list[Number]:
    """Return the right side of the equation for all six axes, without the Coriolis terms."""
    tau = list(body.load)
    for j in range(6):
        linear, quadratic = (body.linear_astern, body.astern) if nu[j] < 0 else (body.linear, body.ahead)
        for i in range(6):
            tau[i] = tau[i] - (linear[i][j] + quadratic[i][j] * abs(nu[j])) * nu[j]
    for (axis, first, second), factor in body.bilinear.items():
        tau[VELOCITIES.index(axis)] += factor * nu[VELOCITIES.index(first)] * nu[VELOCITIES.index(second)]
    for (axis, other), factor in body.fins.items():
        tau[VELOCITIES.index(axis)] += factor * abs(nu[0]) * nu[VELOCITIES.index(other)]
    states = iter(lagging)
    for propeller in body.propellers:
        flow = cross(nu[3:], propeller.position)
        speed = sum(n * (v + f) for n, v, f in zip(propeller.direction, nu[:3], flow, strict=True))
        force = (next(states) if propeller.lag else propeller.target) - propeller.advance * speed
        wrench = [*propeller.direction, *cross(propeller.position, propeller.direction)]
        tau = [t + a * x * force for t, a, x in zip(tau, body.alpha, wrench, strict=True)]
    down = R[2]  # the unit vector downward in the body frame
    for force, centre in ((body.weight, body.centre_of_gravity), (-body.buoyancy, body.centre_of_buoyancy)):
        tau = [t + force * x for t, x in zip(tau, [*down, *cross(centre, down)], strict=True)]
    return tau


def rates(body: Body, inverse: Matrix, state: Vector) -> list[Number]:
    """Return the time derivatives of a state: six velocities, quaternion, position, then the forces with a lag."""
    nu, quaternion, lagging = list(state[:6]), list(state[6:10]), list(state[13:])
    R = rotation(quaternion)
    C = times(coriolis(body.mass, nu), nu)
    right = [t - c for t, c in zip(forces(body, nu, R, lagging), C, strict=True)]
    places = body.places
    acceleration: list[Number] = [0 * nu[0]] * 6
    for i, value in zip(places, times(inverse, [right[i] for i in places]), strict=True):
        acceleration[i] = value
    e, (a, b, c), (p, q, r) = quaternion[0], quaternion[1:], nu[3:]
    turning = [
        (-a * p - b * q - c * r) / 2,
        (e * p + b * r - c * q) / 2,
        (e * q + c * p - a * r) / 2,
        (e * r + a * q - b * p) / 2,
    ]
    moving = [x + current for x, current in zip(times(R, nu[:3]), body.current, strict=True)]
    targets = [(p.target, p.lag) for p in body.propellers if p.lag]
    return [*acceleration, *turning, *moving, *((f - x) / T for (f, T), x in zip(targets, lagging, strict=True))]


def integrate(body: Body, state: Vector, seconds: float, tolerance: float = 1e-13) -> Floats:
    """Return the state after some seconds by DOP853, which is started again at each reversal of a velocity."""
    inverse = [[float(x) for x in row] for row in body.inverse]
    y, t = np.array(state, float), 0.0

    def rate(_: float, y: Floats) -> list[float]:
        return rates(body, inverse, y.tolist())

    while t < seconds:
        moving = [i for i in body.places if y[i] != 0.0 or rate(t, y)[i] != 0.0]
        events = [_reversal(i, t, rate(t, y)[i]) for i in moving]
        found = solve_ivp(rate, (t, seconds), y, "DOP853", events=events, rtol=tolerance, atol=1e-15)
        y, t = found.y[:, -1], float(found.t[-1])
        for i, reversals in zip(moving, found.t_events, strict=True):
            if reversals.size:
                y[i] = 0.0
    return y


def _reversal(i: int, start: float, rate: float) -> Callable[[float, Floats], float]:
    """Return the event at which velocity i changes its sign after `start`. A velocity of 0 has the sign of its rate."""

    def event(t: float, y: Floats) -> float:
        return rate if t == start and y[i] == 0.0 else float(y[i])

    event.terminal = True  # type: ignore[attr-defined]
    return event
