"""The uncertainty of everything that follows from the parameters, and the evidence for effects.

The posterior is normal in the coordinates of the parameters, with the inverse of the Fisher information of J / 2 as its
covariance. Intervals take Student's distribution with 10 degrees of freedom, because the noise is estimated as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import exp, log

import numpy as np

from rov_fmu.identify.likelihood.objective import changed
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.result import KEPT, Interval
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import quantile

DEGREES_OF_FREEDOM = 10.0
QUANTILE = quantile(DEGREES_OF_FREEDOM)
"""Half the width of a 95 % interval in standard errors."""
_LEAST = 1e-10
"""The least eigenvalue of the scaled information: what is below is rounding."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """A normal distribution of the p coordinates."""

    table: Table
    z: Array
    covariance: Array

    @classmethod
    def of(cls, table: Table, z: Array, information: Array) -> "Posterior":
        """Return the posterior for the second derivatives of J."""
        scale = np.sqrt(np.diag(information) / 2.0)  # parameters differ by many orders of magnitude
        values, vectors = np.linalg.eigh(information / 2.0 / np.outer(scale, scale))
        root = vectors / np.sqrt(np.maximum(values, _LEAST)) / scale[:, None]
        return cls(table, z, root @ root.T)

    @cached_property
    def errors(self) -> Array:
        """The standard errors of the coordinates."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def evidence(self, place: int) -> float:
        """Return 2 ln of the Bayes factor for an effect (Savage and Dickey): posterior against prior where it is 0.

        The posterior is that of the most probable vehicle without the effect. Where this has parameters at their
        bounds, it is less probable than a normal distribution without bounds would have it.
        """
        p = self.table.parameters[place]
        assert p.null is not None
        _, after = self._nearest([place])
        before = ((p.mean - p.null) / p.deviation) ** 2
        return float(after - before + 2.0 * log(self.errors[place] / p.deviation))

    def without(self, places: Sequence[int]) -> "Posterior":
        """Return the posterior given that some effects are absent."""
        if not places:
            return self
        gone, C = np.array(places), self.covariance
        regression = np.linalg.solve(C[np.ix_(gone, gone)], C[gone]).T
        covariance = C - regression @ C[gone]
        covariance[gone] = covariance[:, gone] = 0.0
        return Posterior(self.table, self._nearest(places)[0], 0.5 * (covariance + covariance.T))

    def _nearest(self, absent: Sequence[int]) -> tuple[Array, float]:
        """Return the most probable coordinates without some effects, within their bounds, and how far they are away.

        That is the square of their distance in standard deviations. A coordinate that would leave its bounds stays
        at them, and the others move on with it.
        """
        low, high = (np.array([getattr(p, key) for p in self.table.parameters]) for key in ("low", "high"))
        ends = {n: self.table.parameters[n].null or 0.0 for n in absent}
        while True:
            places, C = [*ends], self.covariance
            move = np.array([*ends.values()]) - self.z[places]
            weight = np.linalg.solve(C[np.ix_(places, places)], move)
            z = self.z + C[:, places] @ weight
            z[places] = [*ends.values()]
            beyond = np.flatnonzero((z < low) | (z > high))
            if not beyond.size:
                return z, float(move @ weight)
            ends |= zip(beyond.tolist(), np.clip(z, low, high)[beyond].tolist(), strict=True)

    @cached_property
    def absent(self) -> tuple[int, ...]:
        """The places of the optional effects without evidence.

        The effect with the least evidence is left out first, and the evidence of the others is that without it: two
        effects of which either explains the data are not both left out.
        """
        optional = [n for n, p in enumerate(self.table.parameters) if p.null is not None]
        gone: list[int] = []
        while True:
            rest = self.without(gone)
            found = {n: rest.evidence(n) for n in optional if n not in gone}
            least = min(found, key=lambda n: found[n], default=None)
            if least is None or found[least] > KEPT:
                return tuple(gone)
            gone.append(least)

    @cached_property
    def averaged(self) -> "Posterior":
        """The posterior averaged over the models with and without each effect that lacks evidence.

        Both models have the same prior probability (Hoeting et al. 1999, doi:10.1214/ss/1009212519). The mean and the
        covariance are those of the mixture.
        """
        found = self
        for n in self.absent:
            share = 1.0 / (1.0 + exp(-0.5 * found.evidence(n)))
            without = found.without([n])
            shift = found.z - without.z
            covariance = share * found.covariance + (1.0 - share) * without.covariance
            covariance = covariance + share * (1.0 - share) * np.outer(shift, shift)
            found = Posterior(self.table, without.z + share * shift, covariance)
        return found

    def slopes(self, function: Callable[[Array], Array]) -> Array:
        """Return the derivatives of m numbers of the vehicle with respect to the p coordinates, m x p.

        The function returns m x n numbers for p x n coordinates.
        """
        places = [*self.of_vehicle]
        steps = 0.05 * self.errors[places] + 1e-9
        moves = [(k, sign * step) for sign in (1.0, -1.0) for k, step in zip(places, steps.tolist(), strict=True)]
        up, down = np.split(function(changed(self.z, moves)), 2, axis=1)
        found = np.zeros((len(up), len(self.z)))
        found[:, places] = (up - down) / (2.0 * steps)
        return found

    @cached_property
    def of_vehicle(self) -> tuple[int, ...]:
        """The places of the parameters of the vehicle itself: neither of one log nor of noise."""
        return tuple(n for n, p in enumerate(self.table.parameters) if p.of_motion and p.log is None)

    def numbers(self, values: Callable[[Array], Array]) -> tuple[Array, Array, Array]:
        """Return some numbers of the vehicle, their covariance, and their covariance by the prior.

        The function returns m x n numbers for p x n coordinates.
        """
        G = self.slopes(values)
        prior = np.array([p.deviation**2 for p in self.table.parameters])
        return values(self.z[:, None])[:, 0], G @ self.covariance @ G.T, (G * prior) @ G.T


def around(value: float, error: float, *, positive: bool = False) -> Interval:
    """Return the 95 % interval of a number. For a positive number, its logarithm has the symmetric distribution."""
    half = QUANTILE * error
    if positive and value > 0.0:
        factor = float(np.exp(min(half / value, 50.0)))
        return value / factor, value * factor
    return value - half, value + half


def number(p: Parameter, z: float) -> float:
    """Return the number that a coordinate stands for."""
    return float(np.exp(z)) if p.is_log else float(z)
