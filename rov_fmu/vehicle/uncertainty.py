"""Standard errors and correlations of a vehicle's coefficients, and random draws of vehicles from them.

The coefficients have a normal distribution around their values. For α and β, which are positive factors, the logarithm
has the normal distribution.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, log

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.special import ndtri, stdtrit

from rov_fmu.equation.catalogue import TUNING, Declaration
from rov_fmu.equation.layout import Layout
from rov_fmu.io.groups import grouped
from rov_fmu.vehicle.schema import Estimated

Array = NDArray[np.float64]

LEVEL = 0.95
"""The confidence level of every interval."""
LEAST_EIGENVALUE = -1e-3
"""The least eigenvalue of a valid matrix of correlations, which is below 0 only because files have rounded numbers."""
_EDGE = 1e-12
"""The least distance of a uniform number from 0 and 1, where normal scores are infinite. Sobol sequences start at 0."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The joint distribution of the p coefficients that have an interval, in SI units and in the vehicle's order."""

    names: tuple[str, ...]
    values: Array
    """The p values of the vehicle file."""
    errors: Array
    """The p standard errors; for α and β, the value times the standard error of the logarithm."""
    correlation: Array
    """The p x p correlations, which are 0 where the file gives none."""
    bounds: Array
    """The p x 2 physical bounds."""

    def drawn(self, uniform: Array) -> Array:
        """Return n x p coefficients, made from independent uniform numbers (n x p, 0 to 1) of any sampler.

        - `uniform`: a row for each vehicle, and a column for each of the p `names`.

            known = rov_fmu.load("videoray_refit").uncertainty
            known.drawn(np.random.default_rng(1).random((1000, len(known.names)))).std(axis=0)  # SI units

        A coefficient that would exceed a bound is held there, and the others become what a fit would give with this one
        held: if the data hardly separate linear and quadratic drag, the sum of both is preserved. Each row depends, to
        the last bit, only on its own numbers, and an uncorrelated coefficient depends only on its own column.
        """
        eigenvalues, V = np.linalg.eigh(self.correlation)
        root = (V * np.sqrt(np.maximum(eigenvalues, 0.0))) @ V.T  # symmetric, so it does not depend on the choice of V
        root /= np.linalg.norm(root, axis=1, keepdims=True)
        return self.at(self._hold_at_bounds(_product(ndtri(np.clip(uniform, _EDGE, 1.0 - _EDGE)), root.T)))

    def at(self, scores: Array) -> Array:
        """Return the coefficients that differ from the values by some standard errors each, within the bounds.

        - `scores`: p numbers, or a row of them for each vehicle.

            known = rov_fmu.load("videoray_refit").uncertainty
            known.at(2.0 * known.correlation[0])  # the first one by two standard errors, and what follows from it
        """
        deviations, (low, high) = self.errors * scores, self.bounds.T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scaled = self.values * np.exp(deviations / self.values)
        return np.asarray(np.clip(np.where(self._is_factor, scaled, self.values + deviations), low, high))

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """The names in groups of correlated coefficients; coefficients of different groups are independent."""
        _, numbers = connected_components(self.correlation != 0.0)
        return tuple(map(tuple, grouped(zip(numbers.tolist(), self.names, strict=True)).values()))

    def part(self, names: Sequence[str]) -> "Uncertainty":
        """Return the distribution of some of the coefficients.

        - `names`: the names of these coefficients, in any order.

            rov_fmu.load("videoray_refit").uncertainty.part(["a_d_u", "b_d_u"]).correlation
        """
        place = [self.names.index(name) for name in names]
        return Uncertainty(
            tuple(names),
            self.values[place],
            self.errors[place],
            self.correlation[np.ix_(place, place)],
            self.bounds[place],
        )

    @property
    def _is_factor(self) -> NDArray[np.bool_]:
        """A mask of the coefficients that are a factor, α or β, with a positive value."""
        return np.array([is_factor(name) for name in self.names], bool) & (self.values > 0.0)

    def _hold_at_bounds(self, free: Array) -> Array:
        """Return n x p normal scores, with those beyond a bound held there and the others conditioned on these."""
        low, high = self._scores_of_bounds()
        edges, scores, fixed = np.clip(free, low, high), free.copy(), np.zeros(free.shape, bool)
        while (beyond := ((scores < low) | (scores > high)) & ~fixed).any():
            fixed |= beyond
            for pattern in np.unique(fixed[beyond.any(axis=1)], axis=0):
                rows = (fixed == pattern).all(axis=1)
                within_fixed = self.correlation[np.ix_(pattern, pattern)]
                regression = np.linalg.pinv(within_fixed, hermitian=True) @ self.correlation[pattern]
                scores[rows] = free[rows] + _product((edges - free)[rows][:, pattern], regression)
        return np.where(fixed, edges, scores)

    def _scores_of_bounds(self) -> tuple[Array, Array]:
        """Return the normal scores of the lower and of the upper bounds."""
        low, high = self.bounds.T
        return self._scores(low, -inf), self._scores(high, inf)

    def _scores(self, bound: Array, without_error: float) -> Array:
        """Return the normal scores of some bounds, with a given score where the standard error is 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.where(self._is_factor, self.values * np.log(bound / self.values), bound - self.values)
            return np.where(self.errors > 0.0, distance / self.errors, without_error)


NOTHING = Uncertainty((), np.zeros(0), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 2)))
"""The distribution of no coefficients."""


def uncertainty(
    layout: Layout,
    coefficients: Mapping[str, float],
    intervals: Mapping[str, tuple[float, float]],
    estimates: Mapping[str, Estimated],
) -> Uncertainty:
    """Return the distribution of the coefficients by the intervals and estimates of a vehicle file."""
    declarations = layout.coefficients
    names = tuple(name for name in declarations if name in intervals)
    errors = []
    for name in names:
        if name in estimates:
            errors.append(estimates[name].error)
        else:
            errors.append(_half_width(name, coefficients[name], intervals[name], declarations[name]) / NORMAL)
    return Uncertainty(
        names,
        np.array([coefficients[name] for name in names]),
        np.array(errors),
        correlation(names, estimates),
        np.array([(declarations[name].minimum, declarations[name].maximum) for name in names]).reshape(-1, 2),
    )


def correlation(names: Sequence[str], estimates: Mapping[str, Estimated]) -> Array:
    """Return the matrix of correlations of some coefficients."""
    place = {name: n for n, name in enumerate(names)}
    matrix = np.eye(len(names))
    for name in place.keys() & estimates.keys():
        for other, value in estimates[name].correlation.items():
            matrix[place[name], place[other]] = matrix[place[other], place[name]] = value
    return matrix


def least_eigenvalue(estimates: Mapping[str, Estimated]) -> float:
    """Return the least eigenvalue of the matrix of all correlations. It is never negative for possible correlations."""
    return float(np.linalg.eigvalsh(correlation([*estimates], estimates))[0])


def _product(rows: Array, matrix: Array) -> Array:
    """Return the product of two matrices. Unlike with BLAS, no bit of a row depends on the number of rows."""
    product = np.zeros((len(rows), matrix.shape[1]))
    for column, factors in zip(rows.T, matrix, strict=True):
        product += column[:, None] * factors
    return product


def is_factor(name: str) -> bool:
    """Return True for the positive factors α and β, for which the standard error is that of the logarithm."""
    return name.startswith(tuple(f"{key}_" for key in TUNING))


def quantile(degrees_of_freedom: float) -> float:
    """Return the half-width of a 95 % interval in standard errors, by Student's distribution."""
    return float(stdtrit(degrees_of_freedom, 0.5 + 0.5 * LEVEL))


NORMAL = quantile(inf)
"""Half the width of a 95 % interval in standard errors, by the normal distribution."""


def _half_width(name: str, value: float, interval: tuple[float, float], declaration: Declaration) -> float:
    """Return half the width of an interval; for a factor, the value times half the width in logarithms.

    A side that ends at a physical bound is cut, so only the other side counts. If both are cut, the larger one counts.
    """
    low, high = interval
    logarithmic = is_factor(name) and value > 0.0
    sides = []
    if high < declaration.maximum:
        sides.append(value * log(high / value) if logarithmic else high - value)
    if low > declaration.minimum:
        sides.append(value * log(value / low) if logarithmic else value - low)
    return sum(sides) / len(sides) if sides else max(high - value, value - low)
