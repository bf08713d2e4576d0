"""One axis under a held force: steady velocity and time constant in closed form (standard library only).

With thrust, quadratic and linear drag and a constant inertia, equation (18) of each axis is a scalar Riccati equation

    v' = C - B v - A |v| v,        A >= 0, B >= 0,

with A in 1/m (1/rad for yaw), B in 1/s and C in m/s2 (rad/s2).
"""

from dataclasses import dataclass
from math import atanh, e, hypot, inf, isinf, sqrt

RISE = 1.0 - 1.0 / e
"""The share of V_ss that is reached after Tau, (17)."""


def steady_velocity(A: float, B: float, C: float) -> float:
    """Return the velocity V_ss at which drag balances the force, A |V| V + B V = C; infinite without drag."""
    if C < 0.0:
        return -steady_velocity(A, B, -C)
    if C == 0.0:
        return 0.0
    root = hypot(B, 2.0 * sqrt(A) * sqrt(C))
    return 2.0 * C / (B + root) if B + root > 0.0 else inf


def time_constant(A: float, B: float, C: float) -> float:
    """Return Tau of (17), the time from rest until the velocity is (1 - 1/e) V_ss; infinite without drag.

    With D = B + 2 A V_ss and p = 1 - 1/e, Tau = (2/D) artanh(p D / (D + (1 - p) B)).
    """
    V = steady_velocity(A, B, C)
    if isinf(V) or (D := B + 2.0 * A * abs(V)) == 0.0:
        return inf
    q = 1.0 / e
    return 2.0 * atanh((1.0 - q) / (1.0 + q * (B / D))) / D


@dataclass(frozen=True)
class Riccati:
    """One axis under a held force: v' = C - B v - A |v| v."""

    A: float
    B: float
    C: float
    reverse: tuple[float, float] | None = None
    """A and B for v < 0, if they differ."""

    def drag(self, sign: float) -> tuple[float, float]:
        """Return A and B for velocities of this sign."""
        return self.reverse if self.reverse and sign < 0.0 else (self.A, self.B)

    def acceleration(self, v: float) -> float:
        """Return v', (18)."""
        A, B = self.drag(v)
        return self.C - (B + A * abs(v)) * v

    def steady_velocity(self) -> float:
        """Return V_ss."""
        return steady_velocity(*self.drag(self.C), self.C)

    def time_constant(self) -> float:
        """Return Tau of (17), from rest."""
        return time_constant(*self.drag(self.C), self.C)
