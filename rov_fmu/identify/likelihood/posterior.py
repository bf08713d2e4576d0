"""The uncertainty of everything that follows from the parameters, and the evidence for effects.

The posterior is normal in the coordinates of the parameters, with the inverse of the Fisher information of J / 2 as its
covariance. Intervals take Student's distribution with 10 degrees of freedom, because the noise is estimated as well.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.likelihood.kinds import INERTIA
from rov_fmu.identify.likelihood.objective import derivatives, leading
from rov_fmu.identify.likelihood.parameters import Table
from rov_fmu.identify.result import CONSTANTS, Interval
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import quantile

DEGREES_OF_FREEDOM = 10.0
QUANTILE = quantile(DEGREES_OF_FREEDOM)
"""Half the width of a 95 % interval in standard errors."""
_WORST = 1e3
"""The largest error of predictions that counts. It is infinite where a motion diverges."""
_LEAST = 1e-10
"""The least eigenvalue of the scaled information: what is below is rounding."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """A normal distribution of the p coordinates."""

    table: Table
    z: Array
    covariance: Array

    absent: frozenset[int] = frozenset()
    """The indices of the effects without which J was minimised: their coordinates have no errors."""

    @classmethod
    def of(cls, table: Table, z: Array, information: Array, absent: Collection[int] = ()) -> "Posterior":
        """Return the posterior for the second derivatives of J.

        Scales of forces, of which the motion tells nothing, are coordinates of their own in place of one of their
        parameters. What the priors tell of them would be lost in rounding beside what exact data tell of each.
        """
        free = [n for n, p in enumerate(table.parameters) if n not in absent and not p.is_fixed]
        basis, scales = np.eye(len(free)), table.scales_of_forces(z)[:, free]
        for column, n in leading(scales).items():
            basis[:, column] = scales[n] / scales[n, column]
        H = basis.T @ information[np.ix_(free, free)] @ basis / 2.0
        sizes = np.sqrt(np.diag(H))  # parameters differ by many orders of magnitude
        values, vectors = np.linalg.eigh(H / np.outer(sizes, sizes))
        root = basis @ (vectors / np.sqrt(np.maximum(values, _LEAST)) / sizes[:, None])
        covariance = np.zeros_like(information)
        covariance[np.ix_(free, free)] = root @ root.T
        return cls(table, z, covariance, frozenset(absent))

    def widened(self, ratios: Mapping[Axis, tuple[float, float]], unseen: Array) -> "Posterior":
        """Return the posterior with larger errors of what concerns axes whose structure is wrong.

        `ratios` are the errors of predictions along each axis, relative to the noise, and those of what changes its
        times, the inertia and lags: what is fast changes no steady velocity. They are 0 where nothing tells. As with
        Birge's ratio (Birge 1932, doi:10.1103/PhysRev.40.207), the information of the data falls, by 1 + n (R² - 1):
        what the structure lacks is the same in n samples in turn, while noise differs from sample to sample. What
        thrusters lack shows along all axes that they drive.

        `unseen` is the covariance of the parameters by errors that the data do not show.
        """
        wider = self._with_less_information(ratios)
        is_free = np.diag(self.covariance) > 0.0  # what is fixed or absent has no error
        unseen = unseen * np.outer(is_free, is_free)
        return replace(wider, covariance=wider.covariance + unseen) if unseen.any() else wider

    def _with_less_information(self, ratios: Mapping[Axis, tuple[float, float]]) -> "Posterior":
        parameters = self.table.parameters
        usual, fast = (self._errors_by_name({axis: both[n] for axis, both in ratios.items()}) for n in (0, 1))
        of = [fast if p.of_kind.is_lag or p.kind == INERTIA else usual for p in parameters]
        errors = [min(own.get(p.of, own[""]), _WORST) * p.of_motion for own, p in zip(of, parameters, strict=True)]
        factors = np.sqrt(1.0 + CONSTANTS["alike"].value * np.maximum(np.square(errors) - 1.0, 0.0))
        if np.all(factors == 1.0):
            return self
        prior = np.diag(1.0 / self.table.each("deviation") ** 2)
        data = self._inverse - prior
        return self.of(self.table, self.z, 2.0 * (prior + data / np.outer(factors, factors)), self.absent)

    def _errors_by_name(self, ratios: Mapping[Axis, float]) -> dict[str, float]:
        """Return the error of what concerns an axis, a thruster or a curve, by its name, and of all else as that of an
        empty name, which is the largest."""
        layout, of = self.table.layout, {axis.name: ratio for axis, ratio in ratios.items()}
        of[""] = max(ratios.values(), default=0.0)
        for t in layout.thrusters:
            along = [ratio for axis, ratio in ratios.items() if ratio and t in layout.thrusters_along(axis)]
            for name in (t.name, t.curve) if along else ():
                of[name] = min([of.get(name, _WORST), *along])
        return of

    @property
    def _inverse(self) -> Array:
        """The inverse of the covariance; 0 for what has no error, because it is fixed or absent."""
        found, free = np.zeros_like(self.covariance), np.ix_(*[np.flatnonzero(np.diag(self.covariance) > 0.0)] * 2)
        found[free] = np.linalg.inv(self.covariance[free])
        return found

    @cached_property
    def errors(self) -> Array:
        """The standard errors of the coordinates."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def error(self, index: int) -> float:
        """Return the standard error of a coordinate, which is never less than its kind says."""
        kind = self.table.parameters[index].of_kind
        least = max(kind.finest, kind.roughest * abs(float(self.z[index])))
        return max(float(self.errors[index]), least / QUANTILE)

    def ends(self, index: int) -> Array:
        """Return a coordinate and the two ends of its 95 % interval."""
        z = float(self.z[index])
        return np.array([z, *around(z, self.error(index))])

    @property
    def lasting(self) -> frozenset[int]:
        """The indices of the effects that every vehicle has, unless the data tell that they are smaller than usual.

        Weak evidence is no reason to leave them out: the other effects may stand in their place.
        """
        some = [(n, p) for n, p in enumerate(self.table.parameters) if p.is_effect and p.of_kind.is_in_all]
        return frozenset(n for n, p in some if self.ends(n)[2] >= p.of_kind.mean)

    def shared(self, index: int, others: Sequence[int]) -> float:
        """Return the share of the variance of a coordinate that the knowledge of others would take away."""
        with_others = self.covariance[index, [*others]]
        of_others = np.linalg.pinv(self.covariance[np.ix_(others, others)], hermitian=True)
        return float(with_others @ of_others @ with_others / max(self.covariance[index, index], 1e-300))

    def evidence(self, index: int) -> float:
        """Return 2 ln of the Bayes factor for an effect (Savage and Dickey): prior to posterior where it is absent.

        It is what the Laplace approximation gives for models with and without it. Both densities are taken as normal
        beyond the bounds, too. So a null at a bound, such as a health of 1 or a lag of 0, counts as one inside, here
        and wherever J decides. If the part of the prior beyond it did not count, the evidence would be larger by up to
        2 ln 2 = 1.4, with which a log of thrusters with a slew limit showed a lag of a sensor that is not there.
        """
        p, error = self.table.parameters[index], self.error(index)
        assert p.null is not None
        after, before = ((self.z[index] - p.null) / error) ** 2, ((p.mean - p.null) / p.deviation) ** 2
        return float(after - before + 2.0 * log(error / p.deviation))

    def without(self, index: int) -> "Posterior":
        """Return the posterior given that an effect is absent."""
        column, null = self.covariance[:, index], self.table.parameters[index].null
        assert null is not None
        share = column / max(column[index], 1e-300)
        z, covariance = self.z - share * (self.z[index] - null), self.covariance - np.outer(share, column)
        return replace(self, z=z, covariance=covariance, absent=self.absent | {index})

    def slopes(self, function: Callable[[Array], Array]) -> Array:
        """Return the derivatives of m numbers of the vehicle with respect to the p coordinates, m x p.

        The function returns m x n numbers for p x n coordinates.
        """
        indices = [*self.of_vehicle]
        steps = 0.05 * self.errors[indices] + 1e-9
        some = derivatives(function, self.z, indices, steps)
        found = np.zeros((len(some), len(self.z)))
        found[:, indices] = some
        return found

    @cached_property
    def of_vehicle(self) -> tuple[int, ...]:
        """The indices of the free parameters of the vehicle itself: neither of one log nor of noise."""
        parameters = enumerate(self.table.parameters)
        return tuple(n for n, p in parameters if p.of_motion and p.log is None and not p.is_fixed)

    def numbers(self, values: Callable[[Array], Array]) -> tuple[Array, Array, Array]:
        """Return some numbers of the vehicle, their covariance, and their covariance by the prior.

        The function returns m x n numbers for p x n coordinates.
        """
        G = self.slopes(values)
        prior = self.table.each("deviation") ** 2
        return values(self.z[:, None])[:, 0], G @ self.covariance @ G.T, (G * prior) @ G.T


def variances_of(slopes: Array, covariance: Array) -> Array:
    """Return the variances of m numbers with these derivatives (m x p) with respect to coordinates, m."""
    return np.asarray(np.einsum("ni,ij,nj->n", slopes, covariance, slopes))


def around(value: float, error: float, *, positive: bool = False) -> Interval:
    """Return the 95 % interval of a number. For a positive number, its logarithm has the symmetric distribution."""
    half = QUANTILE * error
    if positive and value > 0.0:
        factor = float(np.exp(min(half / value, 50.0)))
        return value / factor, value * factor
    return value - half, value + half


def hull(*intervals: Interval) -> Interval:
    """Return the smallest interval that contains some intervals."""
    lows, highs = zip(*intervals, strict=True)
    return min(lows), max(highs)
