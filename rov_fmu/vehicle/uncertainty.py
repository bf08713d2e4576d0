"""How well the coefficients of a vehicle are known, and how far they hang together: what vehicles are drawn by.

They are normal about their values, correlated; α and β, positive factors, by their logarithms.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, log

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.special import ndtri, stdtrit

from rov_fmu.model.layout import TUNING, Declaration
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.schema import Estimated

Array = NDArray[np.float64]

LEVEL = 0.95
"""Of every interval."""
LEAST_EIGENVALUE = -1e-3
"""Of a matrix of correlations; 0 but for the digits written."""
_EDGE = 1e-12  # uniform numbers are as far from 0 and 1: a sequence of Sobol begins at 0


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Of p coefficients that have an interval, in SI units and in the order of the vehicle's."""

    names: tuple[str, ...]
    values: Array
    """p."""
    errors: Array
    """p: standard errors of normal distributions; of α and β the value times that of the logarithm."""
    correlation: Array
    """p x p; none where the file does not give it."""
    bounds: Array
    """p x 2: what is physical."""

    def drawn(self, uniform: Array) -> Array:
        """n x p: coefficients from independent uniform numbers (n x p, 0 to 1), those of any sampler.

        One that would pass a bound stops there, and the rest are what the fit would make of them with it held: where
        linear and quadratic drag are hardly told apart, the sum of both stays what it is. A row depends on its own
        numbers alone, to the bit, and a coefficient that is correlated with no other on its own column.
        """
        squares, V = np.linalg.eigh(self.correlation)
        root = (V * np.sqrt(np.maximum(squares, 0.0))) @ V.T  # the root that is one, whatever eigenvectors are found
        root /= np.linalg.norm(root, axis=1, keepdims=True)
        scores = self._held(_times(ndtri(np.clip(uniform, _EDGE, 1.0 - _EDGE)), root.T))
        off = self.errors * scores
        low, high = self.bounds.T
        return np.asarray(np.clip(np.where(self._is_factor, self._scaled(off), self.values + off), low, high))

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Its coefficients, those that are correlated together; what is in different groups is independent."""
        _, group = connected_components(self.correlation != 0.0, directed=False)
        return tuple(
            tuple(name for name, of in zip(self.names, group.tolist(), strict=True) if of == n)
            for n in dict.fromkeys(group.tolist())
        )

    def part(self, names: Sequence[str]) -> "Uncertainty":
        """Of some of them; of the others nothing is known then."""
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
        return np.array([is_factor(name) for name in self.names], bool) & (self.values > 0.0)

    def _scaled(self, off: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(self.values * np.exp(off / self.values))

    def _held(self, free: Array) -> Array:
        """n x p: normal scores with those beyond a bound at it, the others by their correlation with these."""
        low, high = self._ends()
        edges, scores, held = np.clip(free, low, high), free.copy(), np.zeros(free.shape, bool)
        while (beyond := ((scores < low) | (scores > high)) & ~held).any():
            held |= beyond
            for some in np.unique(held[beyond.any(axis=1)], axis=0):
                rows = (held == some).all(axis=1)
                by = np.linalg.pinv(self.correlation[np.ix_(some, some)], hermitian=True) @ self.correlation[some]
                scores[rows] = free[rows] + _times((edges - free)[rows][:, some], by)
        return np.where(held, edges, scores)

    def _ends(self) -> tuple[Array, Array]:
        """p and p: the normal scores of the bounds."""
        ends = []
        with np.errstate(divide="ignore", invalid="ignore"):
            for bound, none in zip(self.bounds.T, (-inf, inf), strict=True):
                far = np.where(self._is_factor, self.values * np.log(bound / self.values), bound - self.values)
                ends.append(np.where(self.errors > 0.0, far / self.errors, none))
        return ends[0], ends[1]


NOTHING = Uncertainty((), np.zeros(0), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 2)))
"""Of no coefficient."""


def uncertainty(
    rov: Rov, intervals: Mapping[str, tuple[float, float]], estimates: Mapping[str, Estimated]
) -> Uncertainty:
    """By what a vehicle file gives."""
    metas = rov.layout.coefficients
    names = tuple(name for name in metas if name in intervals)
    errors = [
        estimates[name].error if name in estimates else _reach(name, rov[name], intervals[name], metas[name]) / _NORMAL
        for name in names
    ]
    return Uncertainty(
        names,
        np.array([rov[name] for name in names]),
        np.array(errors),
        correlation(names, estimates),
        np.array([(metas[name].minimum, metas[name].maximum) for name in names]).reshape(-1, 2),
    )


def correlation(names: Sequence[str], estimates: Mapping[str, Estimated]) -> Array:
    """p x p: of named coefficients."""
    place = {name: n for n, name in enumerate(names)}
    found = np.eye(len(names))
    for name in place.keys() & estimates.keys():
        for other, value in estimates[name].correlation.items():
            found[place[name], place[other]] = found[place[other], place[name]] = value
    return found


def least_eigenvalue(estimates: Mapping[str, Estimated]) -> float:
    """Of the matrix of all correlations: below 0, no numbers have them."""
    return float(np.linalg.eigvalsh(correlation([*estimates], estimates))[0])


def _times(rows: Array, matrix: Array) -> Array:
    """The product, of which a row has the same bits however many others there are, as that of BLAS has not."""
    found = np.zeros((len(rows), matrix.shape[1]))
    for column, factors in zip(rows.T, matrix, strict=True):
        found += column[:, None] * factors
    return found


def is_factor(name: str) -> bool:
    """Whether a coefficient is a positive factor, α or β, which errs by its logarithm."""
    return name.startswith(tuple(f"{key}_" for key in TUNING))


def quantile(degrees_of_freedom: float) -> float:
    """How many standard errors a 95 % interval reaches (Student)."""
    return float(stdtrit(degrees_of_freedom, 0.5 + 0.5 * LEVEL))


_NORMAL = quantile(inf)


def _reach(name: str, value: float, interval: tuple[float, float], meta: Declaration) -> float:
    """Half the interval, or where a bound cuts it the other side of it; of a factor the value times the logarithm's."""
    (low, high), by_logarithm = interval, is_factor(name) and value > 0.0
    sides = [value * log(high / value) if by_logarithm else high - value] if high < meta.maximum else []
    if low > meta.minimum:
        sides.append(value * log(value / low) if by_logarithm else value - low)
    return sum(sides) / len(sides) if sides else max(high - value, value - low)
