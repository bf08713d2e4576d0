"""Least squares, with the covariance, correlation and 95 % intervals of the parameters.

The fits themselves are SciPy's. The positive factors α and β are fitted by their logarithms, other coefficients as they
are.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, isfinite, log, nan, sqrt
from typing import Any, Literal

import numpy as np
from scipy.optimize import least_squares

from rov_fmu.model.layout import AXIS, CURVE, TUNING, CoefficientKind
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.vehicle.uncertainty import is_factor, quantile

Loss = Literal["huber", "linear"]
_RANK = 1e-6
"""Singular values below this fraction of the largest belong to coefficients that are not identifiable."""
_LEAST_FACTOR = 1e-6
"""The smallest α or β of a fit."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """p fitted coefficients in SI units."""

    names: tuple[str, ...]
    values: Array
    """p values."""
    covariance: Array
    """p x p; infinite where a coefficient is not identifiable."""
    degrees_of_freedom: float
    """The number of independent measurements minus the number of parameters."""
    noise: float
    """Standard deviation of the residuals, in their unit."""

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    @property
    def student(self) -> float:
        """The width of an interval by Student's distribution, relative to that by the normal distribution.

        A fit to few data underestimates their scatter by chance. An error times this factor allows for that.
        """
        return quantile(self.degrees_of_freedom) / quantile(inf)

    def as_normal(self) -> "Estimate":
        """Return the estimate with larger errors, so that the normal distribution gives the same 95 % intervals."""
        if not self.degrees_of_freedom > 0.0:
            return self
        return replace(self, covariance=self.student**2 * self.covariance)

    @property
    def named(self) -> dict[str, float]:
        """The values by name."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    def part(self, names: Sequence[str]) -> "Estimate":
        """Return the estimate of some of the coefficients."""
        place = [self.names.index(name) for name in names]
        return replace(
            self, names=tuple(names), values=self.values[place], covariance=self.covariance[np.ix_(place, place)]
        )

    @property
    def errors(self) -> dict[str, float]:
        """The standard errors by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        """The correlation matrix, p x p; NaN where a coefficient is not identifiable."""
        variance = np.diag(self.covariance)
        error = np.sqrt(np.where(np.isfinite(variance), variance, nan))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.covariance / np.outer(error, error))

    def interval(self, name: str) -> tuple[float, float] | None:
        """Return the 95 % interval, cut at the physical bounds; None where the coefficient is not identifiable."""
        value, error = self[name], self.errors[name]
        if not isfinite(error) or not self.degrees_of_freedom > 0.0:
            return None
        reach = quantile(self.degrees_of_freedom) * error
        kind = kind_of(name)
        if is_factor(name):
            ratio = exp(min(reach / value, 100.0))
            return value / ratio, min(kind.maximum, value * ratio)
        return max(kind.minimum, value - reach), min(kind.maximum, value + reach)

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """The 95 % intervals by name, of the coefficients that have one."""
        return {name: found for name in self.names if (found := self.interval(name))}

    @property
    def at_bound(self) -> tuple[str, ...]:
        """The coefficients at a physical bound."""
        return tuple(n for n, value in self.named.items() if value in (kind_of(n).minimum, kind_of(n).maximum))

    def half_band(self, slopes: Array) -> Array:
        """Return half the width of the 95 % band of numbers with these derivatives by the coefficients (... x p).

        The band is of first order, and infinite where a coefficient is not identifiable.
        """
        if self.degrees_of_freedom <= 0.0 or not np.isfinite(self.covariance).all():
            return np.full(slopes.shape[:-1], np.inf)
        variance = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        return np.asarray(quantile(self.degrees_of_freedom) * np.sqrt(np.maximum(variance, 0.0)))


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution of a nonlinear fit in internal parameters (logarithms of factors)."""

    x: Array
    residuals: Array
    jacobian: Array
    """The Jacobian of the residuals without the loss."""


def kind_of(name: str) -> CoefficientKind:
    """Return the declaration of a coefficient of any curve or axis."""
    return next(kind for key, kind in (CURVE | AXIS | TUNING).items() if name.startswith(f"{key}_"))


def internal(names: Sequence[str], values: Mapping[str, float]) -> Array:
    """Convert named coefficients to internal parameters."""
    return np.array([log(values[n]) if is_factor(n) else values[n] for n in names])


def external(names: Sequence[str], x: Array) -> dict[str, float]:
    """Convert internal parameters to named coefficients; x may contain further parameters after them."""
    return {n: exp(value) if is_factor(n) else value for n, value in zip(names, x.tolist(), strict=False)}


def bounds(names: Sequence[str], free: int = 0) -> tuple[Array, Array]:
    """Return lower and upper bounds of internal parameters, followed by `free` unbounded ones."""
    low = [log(_LEAST_FACTOR) if is_factor(n) else kind_of(n).minimum for n in names]
    high = [log(kind_of(n).maximum) if is_factor(n) else kind_of(n).maximum for n in names]
    return np.array(low + [-np.inf] * free), np.array(high + [np.inf] * free)


def minimize(
    residuals: Callable[[Array], Array],
    start: Array,
    limits: tuple[Array, Array],
    *,
    jacobian: Callable[[Array], Array] | None = None,
    loss: Loss = "linear",
    threshold: float = 1.0,
    tolerance: float = 1e-10,
    methods: Sequence[Literal["trf", "dogbox"]] = ("dogbox",),
) -> Solution:
    """Solve bounded least squares with SciPy.

    With a robust loss, residuals beyond the threshold count less than their square. The methods are used one after
    another. "trf" stays away from the bounds, which helps if the start is far from the solution. "dogbox" can end at a
    bound.
    """
    low, high = limits
    start = np.clip(start, low, high)
    options: dict[str, Any] = {"jac": jacobian or "3-point", "bounds": limits}
    ends = {"xtol": 1e-4 * tolerance, "ftol": 0.01 * tolerance, "gtol": 0.01 * tolerance}
    for method in methods:
        result = least_squares(
            residuals,
            start,
            method=method,
            x_scale="jac",
            loss=loss,
            f_scale=threshold,
            max_nfev=100,
            **ends,
            **options,
        )
        start = np.clip(result.x, low, high)
    plain = least_squares(residuals, start, method="dogbox", max_nfev=1, **options)
    return Solution(start, plain.fun, plain.jac)


def fit_named(residuals: Callable[[dict[str, float]], Array], start: Mapping[str, float]) -> Solution:
    """Fit residuals that are a function of named coefficients."""
    names = tuple(start)
    return minimize(lambda x: residuals(external(names, x)), internal(names, start), bounds(names))


def covariance(gram: Array, meat: Array | None = None) -> Array:
    """Return G^-1 M G^-1, or G^-1 without M, for G = J'J; unidentifiable parameters get an infinite variance."""
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0.0] = 1.0
    squares, V = np.linalg.eigh(gram / np.outer(scale, scale))
    identifiable = squares > _RANK**2 * max(squares.max(initial=0.0), 1e-300)
    inverse = (V[:, identifiable] / squares[identifiable]) @ V[:, identifiable].T / np.outer(scale, scale)
    result = inverse if meat is None else inverse @ meat @ inverse
    for n in np.flatnonzero(np.linalg.norm(V[:, identifiable], axis=1) < 1.0 - 1e-6):
        result[n, :] = result[:, n] = 0.0
        result[n, n] = np.inf
    return np.asarray(result)


def propagated(jacobian: Array, of_known: Array, of_known_covariance: Array) -> Array:
    """Return the covariance of the parameters that is due to the uncertainty of numbers taken as known."""
    by_known = gain(jacobian, of_known)
    return np.asarray(by_known @ of_known_covariance @ by_known.T)


def gain(jacobian: Array, of_known: Array) -> Array:
    """Return the derivatives of the fitted parameters by numbers taken as known."""
    return np.asarray(-np.linalg.pinv(jacobian) @ of_known)


def estimate(names: Sequence[str], x: Array, of_x: Array, degrees_of_freedom: float, noise: float) -> Estimate:
    """Return the estimate of the first parameters, from internal parameters and their covariance."""
    p = len(names)
    values = np.array([external(names, x)[n] for n in names])
    slope = np.array([value if is_factor(n) else 1.0 for n, value in zip(names, values, strict=True)])
    return Estimate(tuple(names), values, of_x[:p, :p] * np.outer(slope, slope), degrees_of_freedom, noise)


def estimate_alike(
    names: Sequence[str], solution: Solution, count: int, thrust: tuple[Array, Array] | None = None
) -> Estimate:
    """Return the estimate for `count` measurements with equal errors, estimated from the residuals.

    `thrust` is the Jacobian of the residuals by coefficients taken as known, and the covariance of these.
    """
    degrees, J = float(count - len(names)), solution.jacobian
    noise = sqrt(float(solution.residuals @ solution.residuals) / degrees) if degrees > 0.0 else nan
    of_x = covariance(J.T @ J) if degrees > 0.0 else np.full((len(names), len(names)), np.inf)
    of_x[np.isfinite(of_x)] *= noise**2  # noise may be 0, and 0 times infinity is NaN
    if thrust is not None:
        of_x = of_x + propagated(J, *thrust)
    return estimate(names, solution.x, of_x, degrees, noise)


def scaled(columns: Array) -> Array:
    """Return the nonzero columns, scaled to length 1."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, size > 0.0] / size[size > 0.0])


def basis(columns: Array, least: float) -> Array:
    """Return an orthonormal basis of the space of the columns, without directions whose singular value is below
    `least`."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, s > least])


def leave_one_out(groups: Array, predict: Callable[[Flags], Array | None]) -> Array:
    """Predict the values of each group by a fit without this group. NaN if too few data remain (`predict` returns
    None)."""
    found = np.full(len(groups), np.nan)
    for group in np.unique(groups):
        out = groups == group
        if (predicted := predict(out)) is not None:
            found[out] = predicted
    return found


def rms(errors: Array) -> float:
    """Return the root mean square; NaN for an empty array."""
    return float(np.sqrt(np.mean(errors**2))) if errors.size else nan
