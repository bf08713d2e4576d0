"""The exact motion of axes over many short steps at once, and its derivatives (NumPy).

Within a step v' = C + sum of D_k e^(-κ_k t) - B v - A |v| v: drag on a constant inertia, a held force, and lagging
forces. Each step is a Taylor series, as in rov_fmu/model/step.py, and so are its derivatives by the velocity at its
start and by A, B, C, D_k and κ_k. A reversal is a root of the series, and the step continues from there with the drag
of the other direction.

The steps depend on each other through their velocities only, v_(n+1) = Φ_n(v_n), so Newton's method over all of them at
once needs a linear recursion: a triangular system with two diagonals.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

from rov_fmu.tank.arrays import Array, Flags

ORDER = 8
REACH = 0.25
"""The largest rate times length of a step; the error of its series is then below 1e-9 of its velocity."""
ROUGH = 0.4
"""The largest rate times length in the search for a start; the error is then below 1e-4, with a third of the steps."""
_ITERATIONS = 60


class MotionError(ArithmeticError):
    """The motion cannot be computed with these coefficients."""


@dataclass(frozen=True, eq=False)
class Steps:
    """N steps of one or more successive runs, in SI units."""

    h: Array
    """N: the length, s."""
    first: NDArray[np.intp]
    """The step that each run begins with."""
    A: Array
    """2 x N: quadratic drag ahead and in reverse."""
    B: Array
    """2 x N: linear drag ahead and in reverse."""
    C: Array
    """N: the acceleration by the held forces."""
    D: Array
    """K x N: the acceleration of lagging forces at the start of the step, which decays."""
    kappa: Array
    """K x N: the rates of decay, 1/s."""

    def part(self, which: Flags | slice) -> "Steps":
        """Return some of the steps as one run."""
        lines = {key: getattr(self, key)[..., which] for key in ("h", "A", "B", "C", "D", "kappa")}
        return replace(self, first=np.array([0]), **lines)


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of the end velocity or distance of N steps by v at the start, A, B, C, D_k and κ_k."""

    v: Array
    A: Array
    """2 x N, like B."""
    B: Array
    C: Array
    D: Array
    """K x N, like kappa."""
    kappa: Array

    def part(self, which: slice) -> "Slopes":
        """Return the derivatives of some of the steps."""
        return Slopes(*(getattr(self, key)[..., which] for key in ("v", "A", "B", "C", "D", "kappa")))


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion over the steps."""

    steps: Steps
    v: Array
    """N: the velocity at the start of each step."""
    end: Array
    """N: the velocity at its end."""
    distance: Array
    """N: the distance covered in it."""

    def slopes(self) -> tuple[Slopes, Slopes]:
        """Return the derivatives of the velocity at the end of each step, and of the distance."""
        _, _, *found = _flow(self.steps, self.v, tangents=True)
        assert found[0] is not None
        assert found[1] is not None
        return found[0], found[1]


def motion(steps: Steps, starts: Array, *guesses: Array, precision: float = 1e-12) -> Motion:
    """Compute the motion of every run from its initial velocity; a guess is about the velocity at each step (N).

    Raises MotionError.
    """
    with np.errstate(all="ignore"):
        for begin in (*guesses, _steady(steps)):
            if found := _newton(steps, starts, begin, precision):
                return found
    raise MotionError("the motion cannot be computed with these coefficients")


def _newton(steps: Steps, starts: Array, guess: Array, precision: float) -> Motion | None:
    """Solve for all steps at once by Newton's method; return None where it does not converge."""
    v = guess.copy()
    v[steps.first] = starts
    weaker = {key: np.broadcast_to(getattr(steps, key).min(axis=0), steps.A.shape) for key in ("A", "B")}
    all_of = replace(steps, C=np.abs(steps.C) + np.abs(steps.D).sum(axis=0), **weaker)
    most = 1.2 * max(float(_steady(all_of).max()), float(np.abs(starts).max()))  # no motion goes beyond
    for _ in range(_ITERATIONS):
        end, distance, slopes, _ = _flow(steps, v, tangents=False)
        assert slopes is not None
        gap = np.zeros_like(v)
        gap[1:] = end[:-1] - v[1:]
        gap[steps.first] = 0.0
        change = recursion(slopes.v, gap, steps.first)
        v = np.clip(v + change, -most, most)
        size = np.abs(v).max()
        if not np.isfinite(size):
            return None
        if np.abs(change).max() <= precision * size or size == 0.0:
            return Motion(steps, v, end, distance)
    return None


def _steady(steps: Steps) -> Array:
    """Return the velocity at which drag balances the held force; from above, Newton's method always converges."""
    forward = steps.C >= 0.0
    A, B = (np.where(forward, of[0], of[1]) for of in (steps.A, steps.B))
    size = np.abs(steps.C)
    v = 2.0 * size / np.maximum(B + np.sqrt(B * B + 4.0 * A * size), 1e-12)
    return np.asarray(np.where(forward, v, -v))


def recursion(factor: Array, terms: Array, first: NDArray[np.intp] | None = None) -> Array:
    """Solve x_(n+1) = factor_n x_n + terms_(n+1), x_0 = terms_0, which starts again at `first`; terms is N or N x P."""
    ab = np.ones((2, len(factor)))
    ab[1] = -factor
    if first is not None:
        ab[1, first[1:] - 1] = 0.0
    found, _ = dtbtrs(ab, terms, uplo="L", diag="U")
    return np.asarray(found)


def _flow(steps: Steps, v: Array, *, tangents: bool) -> tuple[Array, Array, Slopes | None, Slopes | None]:
    """Return the end velocity and distance of each step, and the derivatives of both, by v alone or by everything."""
    forward = (v > 0.0) | ((v == 0.0) & (steps.C + steps.D.sum(axis=0) >= 0.0))
    c = _series(steps, v, forward)
    found = _Piece(steps, c, forward, tangents)
    end = found.end
    turned = np.where(forward, end < 0.0, end > 0.0) & (v != 0.0)
    if not turned.any():
        return end, found.distance, *found.slopes
    part, distance = steps.part(turned), found.distance
    share = _root(c[:, turned])
    early = replace(part, h=share * part.h)
    before = _Piece(early, _series(early, v[turned], forward[turned]), forward[turned], tangents)
    fall = np.exp(-part.kappa * early.h)
    late = replace(part, h=part.h - early.h, D=part.D * fall)
    rest, back = np.zeros(len(share)), ~forward[turned]
    after = _Piece(late, _series(late, rest, back), back, tangents)
    end[turned], distance[turned] = after.end, before.distance + after.distance
    for whole, one, two in zip(found.slopes, before.slopes, _of_start(after, early, fall, part), strict=True):
        if whole is None or one is None or two is None:
            continue
        is_distance = whole is found.slopes[1]
        for key in ("v", "A", "B", "C", "D", "kappa"):
            direct = 0.0 if key == "v" else getattr(two, key)
            through = two.v * getattr(before.slopes[0], key)
            getattr(whole, key)[..., turned] = through + direct + (getattr(one, key) if is_distance else 0.0)
    return end, distance, *found.slopes


def _of_start(after: "_Piece", early: Steps, fall: Array, part: Steps) -> list[Slopes | None]:
    """Convert the slopes of the second part of a step to derivatives by D and κ at the start of the whole step."""

    def moved(slopes: Slopes) -> Slopes:
        return replace(slopes, D=slopes.D * fall, kappa=slopes.kappa - slopes.D * early.h * part.D * fall)

    return [slopes and (moved(slopes) if len(slopes.D) else slopes) for slopes in after.slopes]


def _series(steps: Steps, v: Array, forward: Flags) -> Array:
    """Return the coefficients of v over t/h, ORDER + 1 x N."""
    a, b = _drag(steps, forward)
    x, falling = -steps.kappa * steps.h, steps.D * steps.h
    c = np.zeros((ORDER + 1, len(v)))
    c[0] = v
    for n in range(ORDER):
        c[n + 1] = -b * c[n] - a * _product(c, c, n)
        if n == 0:
            c[1] += steps.C * steps.h
        if len(falling):
            c[n + 1] += falling.sum(axis=0)
            falling = falling * x / (n + 1)
        c[n + 1] /= n + 1
    return c


def _drag(steps: Steps, forward: Flags) -> tuple[Array, Array]:
    """Return h A and h B of the direction, A with the sign of the direction."""
    a = np.where(forward, steps.A[0], -steps.A[1]) * steps.h
    return a, np.where(forward, steps.B[0], steps.B[1]) * steps.h


class _Piece:
    """The end velocity, distance and derivatives of a series."""

    def __init__(self, steps: Steps, c: Array, forward: Flags, tangents: bool) -> None:
        self.end = np.asarray(c.sum(axis=0))
        self.distance = np.asarray(steps.h * (_MEANS @ c))
        self._steps, self._c, self._drag = steps, c, _drag(steps, forward)
        self.slopes = self._all(forward) if tangents else (self._by_start(), None)

    def _by_start(self) -> Slopes:
        none = np.zeros((0, len(self.end)))
        by_v = self._tangent(None, np.ones((1, len(self.end)))).sum(axis=0)[0]
        return Slopes(by_v, none, none, none, none, none)

    def _all(self, forward: Flags) -> tuple[Slopes, Slopes]:
        steps, c = self._steps, self._c
        h, K, N = steps.h, len(steps.D), len(steps.h)
        terms = np.zeros((ORDER, 4 + 2 * K, N))
        sign, falls = np.where(forward, h, -h), np.ones_like(steps.D)
        terms[0, 3] = h
        for n in range(ORDER):
            terms[n, 1] = -sign * _product(c, c, n)
            terms[n, 2] = -h * c[n]
            terms[n, 4 : 4 + K] = h * falls
            if n + 1 < ORDER:
                terms[n + 1, 4 + K :] = -steps.D * h * h * falls
            falls = falls * (-steps.kappa * h) / (n + 1)
        start = np.zeros((4 + 2 * K, N))
        start[0] = 1.0
        g = self._tangent(terms, start)
        both = np.vstack([forward, ~forward])
        found = []
        for rows in (g.sum(axis=0), h * np.einsum("k,kqn->qn", _MEANS, g)):
            found.append(Slopes(rows[0], both * rows[1], both * rows[2], rows[3], rows[4 : 4 + K], rows[4 + K :]))
        return found[0], found[1]

    def _tangent(self, terms: Array | None, start: Array) -> Array:
        """Return the solution of the linearized equation, ORDER + 1 x Q x N, from Q x N at the start."""
        c, (a, b) = self._c, self._drag
        g = np.zeros((ORDER + 1, *start.shape))
        g[0] = start
        for n in range(ORDER):
            g[n + 1] = -b * g[n] - 2.0 * a * np.einsum("kn,kqn->qn", c[: n + 1], g[n::-1])
            if terms is not None:
                g[n + 1] += terms[n]
            g[n + 1] /= n + 1
        return g


_MEANS = 1.0 / np.arange(1.0, ORDER + 2.0)


def _product(a: Array, b: Array, n: int) -> Array:
    """Return coefficient n of a product of two series."""
    return np.asarray(np.einsum("kn,kn->n", a[: n + 1], b[n::-1]))


def _root(c: Array) -> Array:
    """Return the root between 0 and 1 of polynomials that change their sign there: Newton's method within bounds."""
    low, high = np.zeros_like(c[0]), np.ones_like(c[0])
    new = t = 0.5 * (low + high)
    for _ in range(60):
        value, slope = c[-1], np.zeros_like(t)
        for x in c[-2::-1]:
            slope = slope * t + value
            value = value * t + x
        before = np.sign(value) == np.sign(c[0])
        low, high = np.where(before, t, low), np.where(before, high, t)
        new = t - value / np.where(slope == 0.0, np.inf, slope)
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        if np.abs(new - t).max() <= 1e-15:
            break
        t = new
    return np.asarray(new)
