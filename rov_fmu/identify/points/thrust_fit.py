"""Fit a thrust curve to measured forces, (6), (7), with reverse coefficients and a dead band where justified."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import inf

import numpy as np
from scipy.linalg import block_diag

from rov_fmu.identify.least_squares import (
    Estimate,
    Solution,
    bounds,
    estimate_alike,
    leave_one_out,
    minimize,
)
from rov_fmu.identify.points.choice import MARGIN, Choice, aicc
from rov_fmu.identify.points.curve_fit import CurveFit
from rov_fmu.identify.points.forms import with_keys
from rov_fmu.model.layout import REVERSE, Curve
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.vehicle.checks import no_thrust

_DIGITS = 1e-5
"""The resolution of a scale, relative to the strongest force."""
_EXACT = 1e-6
"""Errors of coefficients below this share of the largest coefficient are rounding errors."""
_WEAKEST = 3.0
"""The weakest command must not exceed the dead band by more than this factor. Stronger commands hardly determine the
dead band."""
_GRID = {1: 24, 2: 8}
"""The number of values of a dead band in the grid of starts, by the number of fitted dead bands."""


@dataclass(frozen=True, eq=False)
class ThrustFit(CurveFit):
    """Force (N) of all `together` thrusters of a curve over command; the estimate has the fitted coefficients."""

    curve: Curve
    """The curve with the keys that the forces justify, and the known ones."""
    values: Mapping[str, float]
    """Every coefficient of the curve but the lag, by name."""
    choices: tuple[Choice, ...] = ()
    """The possible extensions of the curve, and whether it has them."""

    @property
    def is_uncertain(self) -> bool:
        """True if the scatter of the forces gives finite errors of the coefficients, beyond those of rounding."""
        found = self.estimate
        if not found.names or not np.isfinite(found.covariance).all():
            return False
        return bool(np.sqrt(np.diag(found.covariance)).max() >= _EXACT * np.abs(found.values).max())

    def value(self, x: Array) -> Array:
        """Return the curve at x."""
        return forces(self.curve, self.values, x)

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the curve by the fitted coefficients, n x p."""
        return _slopes(self.curve, self.values, x, self.estimate.names)


def fit_thrust(
    curve: Curve, x: Array, y: Array, weights: Array | None = None, known: Mapping[str, float] | None = None
) -> ThrustFit:
    """Fit forces y over commands x by least squares, (6), (7); the information criterion chooses the form.

    `known` has the given coefficients of the curve by name; they are not fitted.
    """
    weights = np.ones_like(x) if weights is None else weights
    data = _Data(x, y, weights, dict(known or {}))
    plain, *others = (_Candidate(data, form) for form in _forms(curve, data.known))
    candidates = [plain, *(other for other in others if other.is_identifiable)]
    # A dead band is preferred to a curve that points backward, unless it is much worse.
    least = min(c.aicc for c in candidates)
    sound = [c for c in candidates if not c.points_backward and c.aicc <= least + 2.0 * MARGIN] or candidates
    best = min(c.aicc for c in sound)
    near = [c for c in sound if c.aicc <= best + MARGIN]
    chosen = min(near, key=lambda c: (len(c.names), c.aicc))
    return replace(chosen.fit, choices=tuple(_choices(chosen, candidates)))


def forces(curve: Curve, values: Mapping[str, float], x: Array) -> Array:
    """Return the forces of all `together` thrusters (N), (2)."""
    return _slopes(curve, values, x, _linear(curve)) @ [values[name] for name in _linear(curve)]


def measured(fits: Iterable[ThrustFit]) -> Estimate | None:
    """Return the joint estimate of curves; None where their uncertainty is unknown or zero.

    Student's distribution accounts for few forces; here the errors are increased for the normal distribution instead.
    """
    found = [fit.estimate.as_normal() for fit in fits if fit.is_uncertain]
    if not found:
        return None
    names, values = (np.concatenate([getattr(e, key) for e in found]) for key in ("names", "values"))
    degrees, noise = min(e.degrees_of_freedom for e in found), max(e.noise for e in found)
    return Estimate(tuple(names.tolist()), values, block_diag(*(e.covariance for e in found)), degrees, noise)


# ---- Forms -----------------------------------------------------------------------------------------------------------

_BY_DIRECTION = ("a_t" + REVERSE, "b_t" + REVERSE)
_DEAD_BANDS = ((), ("c_0",), ("c_0", "c_0" + REVERSE))


def _forms(curve: Curve, known: Collection[str]) -> Iterable[Curve]:
    """Return the plain form (known keys, a_t and b_t) and then those with more keys."""
    given = {key for key in curve.keys if key == "T" or curve.coefficient(key) in known}
    dead_bands = ((),) if "c_0" in given else _DEAD_BANDS  # a given one holds in both directions
    sets = (given | {"a_t", "b_t", *reverse, *dead} for reverse, dead in product(((), _BY_DIRECTION), dead_bands))
    return [with_keys(curve, keys) for keys in dict.fromkeys(map(frozenset, sets))]


def _linear(curve: Curve) -> list[str]:
    """Return the names of the coefficients that the force is linear in."""
    return [curve.coefficient(key) for key in curve.keys if key.startswith(("a_t", "b_t"))]


def _slopes(curve: Curve, values: Mapping[str, float], x: Array, names: Iterable[str]) -> Array:
    """Return the derivatives of the forces by named coefficients of the curve, n x p."""
    columns = {name: np.zeros(len(x)) for name in names}
    for side, end in ((x > 0.0, ""), (x < 0.0, REVERSE)):
        a_t, b_t, c_0 = (curve.coefficient(key + end) for key in ("a_t", "b_t", "c_0"))
        m, sign = np.maximum(np.abs(x[side]) - values.get(c_0, 0.0), 0.0), np.sign(x[side])
        for name, slope in ((a_t, m * m), (b_t, m)):
            if name in columns:
                columns[name][side] += sign * slope
        if c_0 in columns:
            columns[c_0][side] -= sign * (m > 0.0) * (2.0 * values[a_t] * m + values[b_t])
    return np.column_stack([*columns.values()])


# ---- Fits ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Data:
    x: Array
    y: Array
    weights: Array
    known: Mapping[str, float]

    def levels(self, *ends: str) -> Array:
        """Return the absolute values of the commands that count, forward (""), in reverse, or both."""
        signs = [-1.0 if end else 1.0 for end in ends]
        return np.unique(np.round(np.abs(self.x[(self.weights > 0.0) & np.isin(np.sign(self.x), signs)]), 6))


class _Candidate:
    """One form of the curve, fitted."""

    def __init__(self, data: _Data, curve: Curve) -> None:
        self.data, self.curve = data, curve
        self.names = tuple(n for k in curve.keys if k != "T" and (n := curve.coefficient(k)) not in data.known)
        self._everything = np.ones(len(data.x), bool)
        ends = [self._solve(self._everything, dead) for dead in self._starts()]
        self._solution = min(ends, key=lambda end: float(end.residuals @ end.residuals))
        self.values = self._named(self._solution.x)

    @cached_property
    def aicc(self) -> float:
        """The information criterion over the forces that count."""
        r, count = self._solution.residuals, int((self.data.weights > 0.0).sum())
        least = _DIGITS * float(np.abs(np.sqrt(self.data.weights) * self.data.y).max(initial=1e-300))
        return aicc(float(r @ r), count, len(self.names), least)

    @property
    def is_identifiable(self) -> bool:
        """True when all coefficients are identifiable and plausible for a thruster."""
        if not np.isfinite(self._estimate.covariance).all() or [*no_thrust(self.curve, self.values, "")]:
            return False
        ends = ("", REVERSE) if "a_t" + REVERSE in self.curve.keys or "c_0" + REVERSE in self.curve.keys else None
        dead = {end: self.values.get(self.curve.coefficient("c_0" + end), 0.0) for end in ("", REVERSE)}
        for end in ends or ():
            if (self.data.levels(end) > dead[end]).sum() < 2:
                return False
        for end in ("", REVERSE):
            if self.curve.coefficient("c_0" + end) in self.names:
                levels = self.data.levels(end) if "c_0" + REVERSE in self.curve.keys else self.data.levels("", REVERSE)
                if levels.min(initial=inf) > _WEAKEST * dead[end]:
                    return False
        return True

    @property
    def points_backward(self) -> bool:
        """True when weak commands push in the opposite direction, which no thruster does."""
        pairs = ((self.curve.coefficient("a_t" + end), self.curve.coefficient("b_t" + end)) for end in ("", REVERSE))
        return any(self.values[b_t] < 0.0 < self.values[a_t] for a_t, b_t in pairs)

    @cached_property
    def _estimate(self) -> Estimate:
        return estimate_alike(self.names, self._solution, int((self.data.weights > 0.0).sum()))

    @cached_property
    def fit(self) -> ThrustFit:
        """The result."""
        data = self.data
        groups: Array = np.abs(data.x).round(6)
        out = leave_one_out(groups, self._without)
        return ThrustFit(data.x, data.y, data.weights, self._estimate, out, self.curve, self.values)

    def _without(self, out: Flags) -> Array | None:
        """Predict some points by the fit to the others."""
        rest = ~out & (self.data.weights > 0.0)
        J = _slopes(self.curve, self.values, self.data.x[rest], self.names)
        if np.linalg.matrix_rank(J) < len(self.names):
            return None
        values = self._named(self._solve(rest, {n: self.values[n] for n in self.names if n.startswith("c_0")}).x)
        return forces(self.curve, values, self.data.x[out])

    def _named(self, free: Array) -> dict[str, float]:
        return {**self.data.known, **dict(zip(self.names, free.tolist(), strict=True))}

    def _starts(self) -> list[dict[str, float]]:
        """Return the dead bands to start from: the best of a grid."""
        names = [name for name in self.names if name.startswith("c_0")]
        if not names:
            return [{}]
        weakest = self.data.levels("", REVERSE)[:-1]
        grid = np.linspace(0.0, min(float(weakest.max(initial=0.1)), 0.85), _GRID[len(names)])
        starts = [dict(zip(names, dead, strict=True)) for dead in product(grid.tolist(), repeat=len(names))]
        costs = [float(np.sum(self._linear(self._everything, dead).residuals ** 2)) for dead in starts]
        return [starts[n] for n in np.argsort(costs)[:3]]

    def _linear(self, used: Flags, dead: Mapping[str, float]) -> Solution:
        """Fit all other coefficients for given dead bands."""
        x, root = self.data.x[used], np.sqrt(self.data.weights[used])
        fixed, free = {**self.data.known, **dead}, [n for n in _linear(self.curve) if n in self.names]
        zero = {**dict.fromkeys(_linear(self.curve), 0.0), **fixed}
        J = root[:, None] * _slopes(self.curve, zero, x, free)
        r = root * (forces(self.curve, zero, x) - self.data.y[used])
        found = dict(zip(free, np.linalg.lstsq(J, -r, rcond=None)[0].tolist(), strict=True)) | dict(dead)
        return Solution(np.array([found[n] for n in self.names]), r + J @ [found[n] for n in free], J)

    def _solve(self, used: Flags, dead: Mapping[str, float]) -> Solution:
        """Fit all coefficients, starting from these dead bands; with a dead band, b_t must not be negative."""
        start = self._linear(used, dead)
        if not dead:
            return start
        x, y, root = self.data.x[used], self.data.y[used], np.sqrt(self.data.weights[used])
        low, high = bounds(self.names)
        low[[name.startswith("b_t") for name in self.names]] = 0.0
        return minimize(
            lambda free: root * (forces(self.curve, self._named(free), x) - y),
            start.x,
            (low, high),
            jacobian=lambda free: root[:, None] * _slopes(self.curve, self._named(free), x, self.names),
        )


def _choices(chosen: _Candidate, candidates: list[_Candidate]) -> Iterable[Choice]:
    """Compare the best form with each extension and the best form without it."""
    for key, what in (
        ("a_t" + REVERSE, "a curve of its own in reverse"),
        ("c_0", "a dead band"),
        ("c_0" + REVERSE, "a dead band of its own in reverse"),
    ):
        having = {has: [c for c in candidates if (key in c.curve.keys) is has] for has in (False, True)}
        if all(having.values()):
            without, with_it = (min(having[has], key=lambda c: c.aicc) for has in (False, True))
            errors = without.fit.leave_one_out_error, with_it.fit.leave_one_out_error
            yield Choice(what, key in chosen.curve.keys, without.aicc - with_it.aicc, errors)
