"""The motion of a rigid body in water in six degrees of freedom, written out independently of the package.

The equations are those of Fossen, Handbook of Marine Craft and Hydrodynamics and Motion Control (2nd edition, 2021):

    M v' + C(v) v + D v + D_q(|v|) v + g(eta) = tau,    eta' = J(eta) v + current,

with 6x6 matrices, the velocities v = (u, v, w, p, q, r) through the water, and a quaternion for the attitude. `rates`
uses only + - * / and abs, so the arrays may contain floats, or numbers of mpmath or gmpy2 as objects. No formula of
rov_fmu/equation/ is used.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from mpmath import mp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Number = Any  # a float, or a number of mpmath or gmpy2
Array = NDArray[Any]
Floats = NDArray[np.float64]

VELOCITIES = "uvwpqr"
"""The symbols of the six velocities, in Fossen's order."""


@dataclass(frozen=True, eq=False)
class Body:
    """A vehicle with held commands and n thrusters. Axes that it does not have are held at rest."""

    axes: str
    """The symbols of the velocities that the vehicle has."""
    mass: Array
    """The mass matrix, rigid body and added mass together, about the origin of the body frame."""
    linear: Array
    """The linear damping D for v_j > 0: the force along axis i is -D_ij v_j."""
    linear_astern: Array
    """The linear damping for v_j < 0."""
    ahead: Array
    """The quadratic damping for v_j > 0: the force along axis i is -D_ij |v_j| v_j."""
    astern: Array
    """The quadratic damping for v_j < 0."""
    bilinear: Mapping[tuple[int, int, int], Number]
    """The force along axis i by the product of two velocities, B_ijk v_j v_k: Y_uv is that of (1, 0, 1)."""
    fins: Array
    """6: the force along axis i by the fins is f_i |u| u."""
    wrenches: Array
    """n x 6: the force and the moment of 1 N of each thruster. Their product with v is the speed of advance there."""
    targets: Array
    """n: the steady force of each thruster in water at rest, N; or the steady speed of its rotor, if that lags."""
    advances: Array
    """n: the loss of force per speed of advance, N.s/m."""
    lags: Array
    """n: the time constant of each force, s. Where it is not 0, the force, or the speed of the rotor, is a state."""
    alpha: Array
    """6: the tuning of the thrust along each axis, (18)."""
    load: Array
    """6: loads from outside in the body frame, N and N.m."""
    weight: Number
    buoyancy: Number
    centre_of_gravity: Array
    centre_of_buoyancy: Array
    current: Array
    """The velocity of the water, north, east and down, m/s."""
    rotors: Array
    """2 x 3 x n: a, b and d ahead, and astern. The force at the speed n of the rotor is (a |n| + b) n - d |n| v_a."""
    has_rotor: Array
    """n: True for a thruster whose rotor lags in speed, so that the speed is its state."""
    points: Sequence[tuple[Array, Array]] = ()
    """Positions in the body frame at which forces act, m, and the forces in the earth frame, N."""
    displaced: tuple[Number, Array] = (0, np.zeros(3))
    """The mass of the displaced water less that of the vehicle, kg, and the same of mass times centre, kg m."""
    acceleration: Array = field(default_factory=lambda: np.zeros(3))
    """The acceleration of the water, north, east and down, m/s2."""

    @cached_property
    def places(self) -> list[int]:
        """The places of the vehicle's axes among the six."""
        return [VELOCITIES.index(name) for name in self.axes]

    @cached_property
    def reversing(self) -> list[int]:
        """The places in a state of what changes coefficients where it reverses: velocities, and speeds of rotors."""
        return [*self.places, *(13 + n for n in np.flatnonzero(self.has_rotor[self.lags != 0]).tolist())]

    @cached_property
    def inverse(self) -> Array:
        """The inverse of the part of the mass matrix that belongs to the vehicle's axes."""
        part = self.mass[np.ix_(self.places, self.places)]
        return np.linalg.inv(part) if part.dtype == float else np.array((mp.matrix(part.tolist()) ** -1).tolist())

    @cached_property
    def righting(self) -> Array:
        """6 x 3: the force and the moment of weight and buoyancy by the unit vector downward in the body frame."""
        moment = self.weight * self.centre_of_gravity - self.buoyancy * self.centre_of_buoyancy
        return np.vstack([np.eye(3) * (self.weight - self.buoyancy), skew(moment)])


def rigid_body_mass(m: Number, inertia: Array, centre: Array) -> Array:
    """Return the mass matrix of a rigid body. The inertia is about the origin, not the centre."""
    S = skew(centre)
    return np.block([[np.eye(3) * m, S * -m], [S * m, inertia]])


def skew(a: Array) -> Array:
    """Return the matrix S(a) of a cross product: S(a) b = a x b."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def coriolis(M: Array, nu: Array) -> Array:
    """Return C(v) v of a mass matrix. It is perpendicular to v, so it does no work."""
    momentum, v, omega = M @ nu, nu[:3], nu[3:]
    P, H = skew(momentum[:3]), skew(momentum[3:])
    return -np.concatenate([P @ omega, P @ v + H @ omega])


def rotation(quaternion: Sequence[Number] | Array) -> Array:
    """Return the matrix from the body to the earth frame of a quaternion (scalar first) of any length."""
    q: Array = np.asarray(quaternion)
    S = skew(q[1:])
    turned: Array = np.eye(3) + (q[0] * S + S @ S) * 2 / (q @ q)
    return turned


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


def of_point(at: Array, R: Array, nu: Array, position: Array, current: Array) -> Array:
    """Return the position of a point of the body in the earth frame, and its velocity over ground."""
    return np.concatenate([position + R @ at, R @ (nu[:3] + skew(nu[3:]) @ at) + current])


def euler_angles(R: Array) -> tuple[Number, Number, Number]:
    """Return the Euler angles phi, theta and psi (zyx) of a rotation matrix, in numbers of mpmath."""
    theta = mp.atan2(-R[2][0], mp.hypot(R[2][1], R[2][2]))
    return mp.atan2(R[2][1], R[2][2]), theta, mp.atan2(R[1][0], R[0][0])


def forces(body: Body, nu: Array, R: Array, lagging: Array, signs: Array | None = None) -> Array:
    """Return the right side of the equation for all six axes, without the Coriolis terms.

    `signs` are those of the velocities and of what lags, if others shall choose the coefficients.
    """
    has_lag = body.lags != 0
    side = np.where(np.concatenate([nu, lagging]) < 0, -1, 1) if signs is None else signs
    linear, quadratic = (
        np.where(side[:6] < 0, back, ahead)
        for back, ahead in ((body.linear_astern, body.linear), (body.astern, body.ahead))
    )
    damping = (linear + quadratic * (side[:6] * nu)) @ nu
    state, turns = body.targets.copy(), np.ones(len(has_lag), int)
    state[has_lag], turns[has_lag] = lagging, side[6:]
    a, b, d = np.where(turns < 0, body.rotors[1], body.rotors[0])
    steady = np.where(body.has_rotor, (a * (turns * state) + b) * state, state)
    advances = np.where(body.has_rotor, d * (turns * state), body.advances)
    thrust = body.alpha * ((steady - advances * (body.wrenches @ nu)) @ body.wrenches)
    fins = body.fins * (side[0] * nu[0] * nu[0])
    tau: Array = body.load - damping + fins + thrust + body.righting @ R[2]
    for at, F in body.points:
        tau += np.concatenate([R.T @ F, skew(at) @ (R.T @ F)])
    mass, moment = body.displaced
    tau += np.concatenate([mass * (R.T @ body.acceleration), skew(moment) @ (R.T @ body.acceleration)])
    for (i, j, k), factor in body.bilinear.items():
        tau[i] += factor * nu[j] * nu[k]
    return tau


def rates(body: Body, inverse: Array, state: Array, signs: Array | None = None) -> Array:
    """Return the time derivatives of a state: six velocities, quaternion, position, then what lags.

    `signs` are those of the velocities and of what lags, if others shall choose the coefficients.
    """
    nu, quaternion, lagging = state[:6], state[6:10], state[13:]
    R = rotation(quaternion)
    right = forces(body, nu, R, lagging, signs) - coriolis(body.mass, nu)
    acceleration = 0 * nu
    acceleration[body.places] = inverse @ right[body.places]
    e, vector, omega = quaternion[0], quaternion[1:], nu[3:]
    turning = np.concatenate([[-vector @ omega], e * omega + skew(vector) @ omega]) / 2
    moving = R @ nu[:3] + body.current
    has_lag = body.lags != 0
    lags = (body.targets[has_lag] - lagging) / body.lags[has_lag]
    return np.concatenate([acceleration, turning, moving, lags])


def integrate(body: Body, state: Sequence[float], seconds: float, tolerance: float = 1e-13) -> Floats:
    """Return the state after some seconds by DOP853, which is started again at each reversal of a velocity or rotor."""
    y, t = np.array(state, float), 0.0

    def rate(_: float, y: Floats) -> Floats:
        return rates(body, body.inverse, y)

    while t < seconds:
        moving = [i for i in body.reversing if y[i] != 0.0 or rate(t, y)[i] != 0.0]
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
