"""Fit the parameters of a simulator: the shared ones by SciPy, the values at the start of each flight within.

The values at the start of a flight affect only this flight, so they are fitted again for every set of shared parameters
(variable projection, Golub and Pereyra 1973, with Kaufman's approximation of the derivatives). The search then has few
parameters, however many pieces there are, and a flight never starts far from its measurements.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rov_fmu.identify.least_squares import Loss, Solution, minimize
from rov_fmu.identify.simulation.limits import MotionError, limits
from rov_fmu.identify.simulation.simulator import FlightPlace, Simulator
from rov_fmu.tank.arrays import Array

HUBER = 2.5
"""Residuals larger than this many standard deviations count linearly, not squared."""
_FINE = 1e-5
"""With a larger tolerance, a fit only searches for a start, and need not end at the bounds."""
_ITERATIONS = 12
_HALVINGS = 6
_STEEPEST = 1e140
"""A bound of derivatives whose squares and products do not overflow."""
_NO_MOTION = "the motion cannot be computed with these coefficients"


def solve(
    model: Simulator, start: Array, loss: Loss, tolerance: float = 1e-8, on_step: Callable[[], None] | None = None
) -> Solution:
    """Return the best fit within the limits; with a large tolerance, a fit near it.

    `on_step` is called at each step of the search. Raises MotionError.
    """
    low, high = limits(model.base, model.data, model.names, model.extras, len(start))
    x = np.clip(start, low, high)
    if not np.isfinite(model.residuals(x)).all():
        raise MotionError(_NO_MOTION)
    search = _Search(model, x, robust=loss == "huber", tolerance=tolerance, on_step=on_step)
    p = model.shared
    if p:
        found = minimize(
            search.residuals,
            x[:p],
            (low[:p], high[:p]),
            jacobian=search.jacobian,
            loss=loss,
            threshold=HUBER,
            tolerance=tolerance,
            methods=("trf",) if tolerance > _FINE else ("trf", "dogbox"),
        )
        x = search.settled(found.x)
    else:
        x = search.settled(x[:0])
    return Solution(x, *search.linear(x))


def settled(model: Simulator, x: Array) -> Array:
    """Return the parameters with the values at the start that fit best. Raises MotionError."""
    if not np.isfinite(model.residuals(x)).all():
        raise MotionError(_NO_MOTION)
    return _Search(model, x, robust=False, tolerance=1e-6).settled(x[: model.shared])


@dataclass(frozen=True, eq=False)
class _Inverse:
    """The first-order change of the best values at the start of a flight, by residuals and by shared parameters."""

    by_residuals: Array
    """own x rows: the change of the values at the start for each residual."""
    by_shared: Array
    """own x shared."""


class _Search:
    """The residuals as a function of the shared parameters alone."""

    def __init__(
        self,
        model: Simulator,
        x: Array,
        *,
        robust: bool,
        tolerance: float,
        on_step: Callable[[], None] | None = None,
    ) -> None:
        self.model, self.robust, self.on_step = model, robust, on_step
        self.precision = min(1e-3, 0.1 * tolerance)
        self.begin = x
        """The parameters of the last derivatives, from which the values at the start are sought."""
        self.inverses: list[_Inverse | None] = [None] * len(model.flights)
        """The inverse of each flight at these parameters, if there were derivatives already."""
        self.last: Array | None = None
        """The parameters of the last call."""
        self.known: tuple[Array, Array] | None = None
        """The residuals and the Jacobian at the parameters of the last derivatives."""

    def residuals(self, shared: Array) -> Array:
        """Return the residuals with the best values at the start."""
        return self.model.residuals(self.settled(shared))

    def jacobian(self, shared: Array) -> Array:
        """Return the derivatives of the residuals, without what the values at the start absorb."""
        model, p = self.model, self.model.shared
        r, J = self.linear(self.settled(shared))
        if not (np.abs(J) < _STEEPEST).all():
            raise MotionError(_NO_MOTION)
        found = J[:, :p].copy()
        for n, place in enumerate(model.flights):
            rows = np.concatenate([place.rows, model.prior_rows(place)])
            weights, own = self._weights(r[rows])[:, None], J[rows, place.own]
            inverse = np.linalg.pinv(weights * own) * weights.T
            by_shared = -inverse @ found[rows]
            self.inverses[n] = _Inverse(inverse, by_shared)
            found[rows] += own @ by_shared
        return found

    def linear(self, x: Array) -> tuple[Array, Array]:
        """Return the residuals and the Jacobian of all parameters; SciPy asks for the same ones repeatedly."""
        if self.known is None or not np.array_equal(x, self.begin):
            if self.on_step:
                self.on_step()
            self.begin, self.known = x.copy(), (self.model.residuals(x), self.model.jacobian(x))
        return self.known

    def settled(self, shared: Array) -> Array:
        """Return all parameters, with the values at the start that fit best to the shared ones."""
        if self.known and np.array_equal(shared, self.begin[: len(shared)]):
            return self.begin
        if self.last is None or not np.array_equal(shared, self.last[: len(shared)]):
            self.last = self.begin.copy()
            self.last[: len(shared)] = shared
            for place, inverse in zip(self.model.flights, self.inverses, strict=True):
                if not inverse or not self._settle_by(inverse, place, self.last):
                    self._settle(place, self.last)
        return self.last

    def _settle_by(self, inverse: _Inverse, place: FlightPlace, x: Array) -> bool:
        """Fit the values at the start of a flight with the derivatives of other parameters; Return False if this
        fails."""
        r, here = self._residuals_of(place, x), x[place.own].copy()
        x[place.own] += inverse.by_shared @ (x - self.begin)[: self.model.shared]
        linear, cost = self._residuals_of(place, x), self._cost(r)
        if self._cost(linear) < cost:
            r, cost = linear, self._cost(linear)
        else:
            x[place.own] = here
        for _ in range(_ITERATIONS):
            before = x[place.own].copy()
            x[place.own] -= inverse.by_residuals @ r
            r = self._residuals_of(place, x)
            now = self._cost(r)
            if not now <= (1.0 + self.precision) * cost:
                x[place.own] = before
                return False
            if cost - now < self.precision * cost:
                return True
            cost = now
        return False

    def _settle(self, place: FlightPlace, x: Array) -> None:
        """Fit the values at the start of a flight by the Gauss-Newton method, with steps that are halved until they
        help."""
        own = place.own_places
        for _ in range(_ITERATIONS):
            r, J = self.model.slopes_of_flight(place, x, own)
            J = np.concatenate([J, self.model.priors_of(place)])
            r = np.concatenate([r, self.model.deviations_of(place, x)])
            if not np.isfinite(r).all() or not np.isfinite(J).all():
                return
            cost, weights = self._cost(r), self._weights(r)
            step = np.linalg.lstsq(weights[:, None] * J, -weights * r, rcond=None)[0]
            before = x[own].copy()
            for halving in range(_HALVINGS):
                x[own] = before + 0.5**halving * step
                now = self._cost(self._residuals_of(place, x))
                if now < cost:
                    break
            else:
                x[own] = before
                return
            if cost - now < self.precision * cost:
                return

    def _residuals_of(self, place: FlightPlace, x: Array) -> Array:
        """Return the residuals of a flight, and those of the priors of its values at the start."""
        return np.concatenate([self.model.of_flight(place, x[None, :])[0], self.model.deviations_of(place, x)])

    def _weights(self, r: Array) -> Array:
        """Return the square roots of the weights with which least squares equal the robust fit."""
        return np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(r), 1e-9))) if self.robust else np.ones(len(r))

    def _cost(self, r: Array) -> float:
        size = np.abs(r)
        far = (2.0 * size - HUBER) * HUBER if self.robust else r * r
        cost = float(np.sum(np.where(size > HUBER, far, r * r)))
        return cost if np.isfinite(cost) else np.inf
