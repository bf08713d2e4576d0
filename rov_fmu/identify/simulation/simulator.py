"""Simulate recordings as a function of the fitted parameters, with derivatives."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.effect import Effect, with_effects
from rov_fmu.identify.least_squares import external, internal
from rov_fmu.identify.points.tables import Table
from rov_fmu.identify.simulation.flight import Flight, unmixed
from rov_fmu.identify.simulation.limits import MotionError
from rov_fmu.identify.simulation.prepared import PreparedRecording
from rov_fmu.model.layout import REVERSE
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import is_factor

_CHANGE = 1e-6
"""The relative change of a parameter for its derivative. The motion is exact, so the relative error of the derivative
is about 1e-6."""


@dataclass(frozen=True, eq=False)
class Output:
    """The simulated values of a recording, n each."""

    values: Array
    velocity: Array
    """The velocity through the water."""


@dataclass(frozen=True, eq=False)
class FlightPlace:
    """A flight, with the indices of its recordings in the data, of its parameters in x, and of its samples in the
    residuals."""

    flight: Flight
    members: list[int]
    own: slice
    rows: NDArray[np.intp]
    shared: list[int]
    """The places of the other parameters that act on it."""

    @property
    def own_places(self) -> list[int]:
        """The places of its own parameters."""
        return [*range(self.own.start, self.own.stop)]


@dataclass(frozen=True, eq=False)
class Simulator:
    """Recordings as a function of x: coefficients (internal parameters), extras, then values at the start.

    The residuals are modelled less measured values of one recording after the other, in standard deviations (sigma, one
    per recording). They are followed by the residuals of the tables, by those of the priors of the extras, and of the
    values at the start.
    """

    data: tuple[PreparedRecording, ...]
    base: Rov
    names: tuple[str, ...]
    extras: tuple[Effect, ...]
    sigma: Array
    likely: Array | None = None
    """The prior standard deviation of each effect, infinite for an effect without a prior. None if no effect has a
    prior."""
    tables: tuple[Table, ...] = ()
    expected: Mapping[Effect, float] = field(default_factory=dict)
    """The prior means of effects, if they differ from `Effect.likely`."""

    # ---- Parameters ----

    @property
    def shared(self) -> int:
        """The number of parameters in x that do not belong to one flight."""
        return len(self.names) + len(self.extras)

    @property
    def size(self) -> int:
        """The number of parameters."""
        return int(self.flights[-1].own.stop)

    @cached_property
    def rows(self) -> list[slice]:
        """The rows of the residuals of each recording."""
        return [slice(*ends) for ends in pairwise(np.cumsum([0, *(len(d.time) for d in self.data)]).tolist())]

    @cached_property
    def recordings(self) -> list[list[int]]:
        """The places in the data of the pieces of each recording, which follow each other."""
        found: dict[int, list[int]] = {}
        for n, d in enumerate(self.data):
            found.setdefault(id(d.recording), []).append(n)
        return list(found.values())

    @cached_property
    def flights(self) -> list[FlightPlace]:
        """The flights of all files and pieces."""
        groups: dict[tuple[str, int], list[int]] = {}
        for n, d in enumerate(self.data):
            groups.setdefault((d.recording.file, d.piece), []).append(n)
        found, first, layout = [], self.shared, self._vehicle.layout
        for members in groups.values():
            flight = Flight(layout, tuple(self.data[n] for n in members))
            own = slice(first, first + len(flight.start))
            shared = [n for n in range(self.shared) if self._acts(n, flight)]
            rows = np.concatenate([np.arange(self.rows[n].start, self.rows[n].stop) for n in members])
            found.append(FlightPlace(flight, members, own, rows, shared))
            first = own.stop
        return found

    @cached_property
    def _vehicle(self) -> Rov:
        """The vehicle with all extras and one command for each thruster."""
        rov = with_effects(self.base, {extra: extra.neutral for extra in self.extras})
        layout = unmixed(rov.layout)
        return Rov(layout, {name: rov[name] for name in layout.coefficients})

    def _acts(self, n: int, flight: Flight) -> bool:
        """Return True when a parameter may act on the recordings of a flight."""
        if n >= len(self.names):
            extra = self.extras[n - len(self.names)]
            if extra.is_of_file or extra.is_delay:
                return any(extra.concerns(d.recording) for d in flight.members)
        if flight.is_linked:
            return True
        axes = [d.axis for d in flight.members]
        curves = {curve.name for axis in axes for curve in curves_of(self.base.layout, axis)}
        if n >= len(self.names):
            return self.extras[n - len(self.names)].of in {*curves, *(axis.name for axis in axes)}
        concerned = (*curves, *(axis.velocity for axis in axes))
        return self.names[n].endswith(tuple(f"_{of}{end}" for of in concerned for end in ("", REVERSE)))

    def rov(self, x: Array) -> Rov:
        """Return the vehicle with the coefficients and extras of x."""
        return with_effects(self.base.replaced(external(self.names, x)), self.extra_values(x))

    def extra_values(self, x: Array) -> dict[Effect, float]:
        """Return the extras of x."""
        return dict(zip(self.extras, x[len(self.names) : self.shared].tolist(), strict=True))

    def start(
        self,
        coefficients: Mapping[str, float],
        extras: Mapping[Effect, float],
        known: Mapping[tuple[str, float, str], float] = MappingProxyType({}),
    ) -> Array:
        """Return x with these numbers; values at the start that are not `known` are the first measured ones."""
        shared = [*internal(self.names, coefficients), *(extras.get(extra, extra.neutral) for extra in self.extras)]
        starts = (known.get(key, value) for key, value in self._starts())
        return np.array([*shared, *starts])

    def starts(self, x: Array) -> dict[tuple[str, float, str], float]:
        """Return the values at the start by file, time and variable."""
        keys = [key for key, _ in self._starts()]
        return dict(zip(keys, x[self.shared :].tolist(), strict=True))

    def _starts(self) -> Iterator[tuple[tuple[str, float, str], float]]:
        for place in self.flights:
            first = place.flight.members[0]
            for name, value in place.flight.start.items():
                yield (first.recording.file, float(first.time[0]), name), value

    def places_of(self, extras: Collection[Effect]) -> list[int]:
        """Return the places in x of all parameters except the effects that are not given."""
        other = {n for n, extra in enumerate(self.extras, len(self.names)) if extra not in extras}
        return [n for n in range(self.size) if n not in other]

    # ---- Motion ----

    def run(self, x: Array) -> list[Output]:
        """Simulate every recording. Raises MotionError."""
        outputs: list[Output | None] = [None] * len(self.data)
        for place in self.flights:
            values, velocities = (self._simulated(place, x[None, :], through_water=k) for k in (False, True))
            for n, value, velocity in zip(place.members, values, velocities, strict=True):
                if not np.isfinite(value).all():
                    raise MotionError("the motion cannot be computed with these coefficients")
                outputs[n] = Output(value[0], velocity[0])
        return [output for output in outputs if output]

    def _simulated(self, place: FlightPlace, X: Array, *, through_water: bool = False) -> list[Array]:
        """Return the outputs of the recordings of a flight for V sets of parameters."""
        values: dict[str, Array] = {}
        for n in place.shared:
            if n < len(self.names):
                values[self.names[n]] = np.exp(X[:, n]) if is_factor(self.names[n]) else X[:, n]
        for n, name in enumerate(place.flight.start, place.own.start):
            values[name] = X[:, n]
        delays = np.tile([d.delay for d in place.flight.members], (len(X), 1))
        for n in place.shared:
            if n < len(self.names):
                continue
            extra, numbers = self.extras[n - len(self.names)], X[:, n]
            if extra.is_delay:
                concerned = [extra.concerns(d.recording) for d in place.flight.members]
                delays += np.outer(numbers, concerned)
            elif extra.input:
                values[extra.input] = values.get(extra.input, 0.0) + numbers
            else:
                values |= extra.coefficients({**self._vehicle.coefficients, **values}, numbers)
        times = [tuple(row) for row in delays.tolist()]
        return place.flight.outputs(self._vehicle, values, times, through_water=through_water)

    def of_flight(self, place: FlightPlace, X: Array) -> Array:
        """Return the residuals of the samples of a flight for V sets of parameters, V x samples."""
        values = self._simulated(place, X)
        parts = []
        for n, value in zip(place.members, values, strict=True):
            r = (value - self.data[n].values) / self.sigma[n]
            if shared := self._by_switches[n]:
                S, M = shared
                r -= (r @ S) @ M @ S.T
            parts.append(r)
        return np.concatenate(parts, axis=1)

    @cached_property
    def _by_switches(self) -> list[tuple[Array, Array] | None]:
        """The matrices S and M of each recording with which r - S M S'r is white; None where no switch is uncertain.

        The residuals r have the covariance I + S S'. M has the eigenvectors of S'S and the eigenvalues
        (1 - 1/sqrt(1 + s)) / s, so I - S M S' is the symmetric inverse root of the covariance.
        """
        found: list[tuple[Array, Array] | None] = []
        for d, sigma in zip(self.data, self.sigma, strict=True):
            if d.shifts is None:
                found.append(None)
                continue
            S = d.shifts / sigma
            s, V = np.linalg.eigh(S.T @ S)
            root = np.sqrt(1.0 + np.maximum(s, 0.0))
            found.append((S, (V / (root * (1.0 + root))) @ V.T))
        return found

    def slopes_of_flight(self, place: FlightPlace, x: Array, columns: Sequence[int]) -> tuple[Array, Array]:
        """Return the residuals of a flight (n) and their derivatives by some parameters (n x columns).

        For the derivatives by delays, the simulation begins at a fixed time. The values at the start compensate for
        this.
        """
        steps = _CHANGE * np.maximum(np.abs(x[columns]), 0.01)
        X = np.tile(x, (len(columns) + 1, 1))
        X[np.arange(1, len(X)), columns] += steps
        steps = X[np.arange(1, len(X)), columns] - x[columns]
        r = self.of_flight(place, X)
        return r[0], ((r[1:] - r[0]) / steps[:, None]).T

    def residuals(self, x: Array) -> Array:
        """Return the residuals, see the class; NaN where the motion cannot be computed: the search steps back."""
        found = np.empty(self._count)
        for place in self.flights:
            found[place.rows] = self.of_flight(place, x[None, :])[0]
        found[self._of_tables] = self._residuals_of_tables(x)
        if not np.isfinite(found[: self._measured]).all():
            return np.full(self._count, np.nan)
        found[self._measured :] = self._priors @ x - self._expected
        return found

    def jacobian(self, x: Array) -> Array:
        """Return the Jacobian of the residuals."""
        J = np.zeros((self._count, len(x)))
        for place in self.flights:
            columns = [*place.shared, *place.own_places]
            J[place.rows[:, None], columns] = self.slopes_of_flight(place, x, columns)[1]
        for n in range(self.shared) if self.tables else ():
            changed = x.copy()
            changed[n] += _CHANGE * max(abs(x[n]), 0.01)
            change = self._residuals_of_tables(changed) - self._residuals_of_tables(x)
            J[self._of_tables, n] = change / (changed[n] - x[n])
        J[self._measured :] = self._priors
        return J

    def _residuals_of_tables(self, x: Array) -> Array:
        """Return the residuals of the tables, one after the other."""
        if not self.tables:
            return np.zeros(0)
        rov = self.rov(x)
        return np.concatenate([table.residuals(rov) for table in self.tables])

    # ---- Priors ----

    @property
    def _count(self) -> int:
        """The number of residuals."""
        return self._measured + len(self._expected)

    @property
    def _measured(self) -> int:
        """The number of samples and measurements of tables."""
        return int(self.rows[-1].stop) + self.count_of_tables

    @property
    def _of_tables(self) -> slice:
        """The rows of the residuals of the tables."""
        return slice(self._measured - self.count_of_tables, self._measured)

    @property
    def count_of_tables(self) -> int:
        """The number of measurements of tables."""
        return sum(map(len, self.tables))

    @cached_property
    def _prior(self) -> tuple[Array, Array]:
        """The matrix P and the vector e of the residuals P x - e of extras and values at the start."""
        rows: list[Array] = []
        expected: list[float] = []
        for n, value, deviation in self._likely():
            rows.append(np.eye(1, self.size, n)[0] / deviation)
            expected.append(value / deviation)
        return np.array(rows).reshape(-1, self.size), np.array(expected)

    def _likely(self) -> Iterator[tuple[int, float, float]]:
        """Yield the place, the likely value and its deviation of each parameter with a prior."""
        if self.likely is not None:
            for n, extra in enumerate(self.extras):
                if np.isfinite(self.likely[n]):
                    yield len(self.names) + n, self.expected.get(extra, extra.likely), float(self.likely[n])
        for place in self.flights:
            for n, name in enumerate(place.flight.start, place.own.start):
                if name in place.flight.start_prior:
                    yield n, *place.flight.start_prior[name]

    def prior_rows(self, place: FlightPlace) -> NDArray[np.intp]:
        """Return the rows of the residuals of the priors of the values at the start of a flight."""
        return self._measured + np.flatnonzero(np.any(self._priors[:, place.own] != 0.0, axis=1))

    def deviations_of(self, place: FlightPlace, x: Array) -> Array:
        """Return the residuals of the priors of the values at the start of a flight."""
        rows = self.prior_rows(place) - self._measured
        return np.asarray(self._priors[rows] @ x - self._expected[rows])

    def priors_of(self, place: FlightPlace) -> Array:
        """Return the derivatives of these residuals by the values at the start of the flight."""
        return np.asarray(self._priors[self.prior_rows(place) - self._measured, place.own])

    @property
    def _priors(self) -> Array:
        return self._prior[0]

    @property
    def _expected(self) -> Array:
        return self._prior[1]
