"""The joint covariance of all identified coefficients: fits that share a thrust curve have correlated errors."""

from collections.abc import Iterable, Mapping

import numpy as np

from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.thrust_fit import ThrustFit
from rov_fmu.tank.arrays import Array


class Together:
    """The covariance of the identifiable coefficients of several fits, in SI units.

    Student's distribution accounts for fits to few data. Here the normal distribution is used with correspondingly
    larger errors, so that the errors of several fits can be combined.
    """

    def __init__(self, thrust: Iterable[ThrustFit], results: Iterable[AxisResult]) -> None:
        """Add the fits to recordings, which include thrust curves; then the other curves; then the fits to points."""
        self.names: tuple[str, ...] = ()
        self.covariance: Array = np.zeros((0, 0))
        chosen = [*results]
        for result in chosen:
            if result.recordings:  # axes that were fitted together share this estimate
                self._add(result.recordings.together.as_normal())
        for fit in thrust:
            self._add(fit.estimate.as_normal())
        for result in chosen:
            if result.response and result.chosen == "points":
                self._add(result.response.given_thrust.as_normal(), result.response.by_thrust)
        for result in chosen:
            for name, by in result.recordings.disagreement.items() if result.recordings else ():
                self._widen(name, by)

    def _add(self, found: Estimate, by: Mapping[str, Array] | None = None) -> None:
        """Add an independent estimate, except for its dependence `by` on coefficients that were added before."""
        places = [
            n for n, (name, error) in enumerate(found.errors.items()) if np.isfinite(error) and name not in self.names
        ]
        if not places:
            return
        none = np.zeros(len(places))
        gains = np.array([by[n][places] if by and n in by else none for n in self.names]).reshape(-1, len(places)).T
        both = gains @ self.covariance
        own = found.covariance[np.ix_(places, places)] + both @ gains.T
        self.names += tuple(found.names[n] for n in places)
        self.covariance = np.block([[self.covariance, both.T], [both, own]])

    def _widen(self, name: str, by: float) -> None:
        """Increase the standard error of a coefficient by a factor."""
        n = self.names.index(name)
        self.covariance[n, :] *= by
        self.covariance[:, n] *= by

    def error(self, name: str) -> float:
        """Return the standard error of a coefficient."""
        n = self.names.index(name)
        return float(np.sqrt(self.covariance[n, n]))

    def correlation(self, name: str, others: Iterable[str]) -> dict[str, float]:
        """Return the correlation of a coefficient with others, by name, where it is not zero."""
        place = {name: n for n, name in enumerate(self.names)}
        found = {}
        for other in others:
            n, m = place.get(name), place.get(other)
            if n is not None and m is not None and (shared := float(self.covariance[n, m])):
                found[other] = shared / float(np.sqrt(self.covariance[n, n] * self.covariance[m, m]))
        return {other: min(max(value, -1.0), 1.0) for other, value in found.items()}
