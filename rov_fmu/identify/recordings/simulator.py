"""Simulate recordings as a function of the fitted parameters, with derivatives."""

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from rov_fmu.identify.effects.coupling import EAST, NORTH, Current
from rov_fmu.identify.effects.extras import Extra, with_extras
from rov_fmu.identify.least_squares import Estimate, Loss, Solution, external, internal, minimize
from rov_fmu.identify.recordings.limits import limits
from rov_fmu.identify.recordings.runs import ForcedRun, PreparedRecording, at_samples, forced_run, joined, steps_of
from rov_fmu.identify.recordings.sensitivity import Sensitivity
from rov_fmu.identify.recordings.trajectory import REACH, Motion, MotionError, motion
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording

HUBER = 2.5
"""Residuals beyond so many standard deviations count linearly, not by their square."""

Slopes = dict[str | Extra | int, Array]
"""Derivatives by coefficient (internal), extra, and initial value (0: velocity, 1: position), n each."""


@dataclass(frozen=True, eq=False)
class Output:
    """The simulated values of a recording, n each, and their derivatives."""

    values: Array
    velocity: Array
    """The velocity through the water."""
    slopes: Slopes = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Simulator:
    """Recordings as a function of x: coefficients (internal parameters), extras, then initial values.

    The residuals are modelled less measured values of one recording after the other, in standard deviations (sigma, one
    per recording). They are followed by the residuals of the measured thrust coefficients, and by those of the extras.
    """

    data: tuple[PreparedRecording, ...]
    base: Rov
    names: tuple[str, ...]
    extras: tuple[Extra, ...]
    sigma: Array
    thrust: Estimate | None = None
    likely: Array | None = None
    """The prior standard deviation of each extra; None without a prior."""
    _last: dict[str, tuple[Array, list[ForcedRun], Motion]] = field(default_factory=dict, init=False, repr=False)

    @property
    def places(self) -> list[tuple[PreparedRecording, slice, slice, float]]:
        """Each recording with its rows of the residuals, its initial values in x and its standard deviation."""
        rows = np.cumsum([0, *(len(d.time) for d in self.data)]).tolist()
        initial = np.cumsum([self.shared, *(d.initial_count for d in self.data)]).tolist()
        slices = ([slice(*ends) for ends in pairwise(bounds)] for bounds in (rows, initial))
        return list(zip(self.data, *slices, self.sigma.tolist(), strict=True))

    @property
    def shared(self) -> int:
        """The number of parameters in x that are not initial values."""
        return len(self.names) + len(self.extras)

    def rov(self, x: Array) -> Rov:
        """Return the vehicle with the coefficients and extras of x."""
        return with_extras(self.base.replaced(external(self.names, x)), self.extra_values(x))

    def extra_values(self, x: Array) -> dict[Extra, float]:
        """Return the extras of x."""
        return dict(zip(self.extras, x[len(self.names) : self.shared].tolist(), strict=True))

    def start(self, coefficients: dict[str, float], extras: dict[Extra, float]) -> Array:
        """Return x with these numbers, the first measured positions, and the velocities there."""
        shared = [*internal(self.names, coefficients), *(extras.get(extra, extra.neutral) for extra in self.extras)]
        initial = (np.array([d.velocity[0], d.values[0]][: d.initial_count]) for d in self.data)
        return np.concatenate([np.array(shared), *initial])

    def places_of(self, extras: Collection[Extra]) -> list[int]:
        """Return the indices in x of everything except the other extras."""
        p = len(self.names)
        other = {n for n, extra in enumerate(self.extras, p) if extra not in extras}
        return [n for n in range(self.shared + sum(d.initial_count for d in self.data)) if n not in other]

    # ---- Forward ----

    def run(self, x: Array, *, slopes: bool = False) -> list[Output]:
        """Simulate every recording. Raises MotionError."""
        rov, values = self.rov(x), self.extra_values(x)
        forced, moved = self._moved(x, rov)
        by_end, by_distance = moved.slopes() if slopes else (None, None)
        outputs, ends = [], pairwise([*moved.steps.first.tolist(), len(moved.steps.h)])
        for f, (d, _, initial, _), place in zip(forced, self.places, ends, strict=True):
            here, current = slice(*place), self._sum(values, d.recording, "current")
            v = np.append(moved.v[here], moved.end[here][-1])[f.run.sample]
            found: Slopes = {}
            if d.recording.is_position:
                output = x[initial][1] + at_samples(f.run, moved.distance[here]) + current * (d.time - d.time[0])
            else:
                output = v + current
            output = output + self._flow(values, d) @ d.carried
            if by_end is not None and by_distance is not None:
                sensitivity = Sensitivity(rov, f, moved.steps.part(here), by_end.part(here), by_distance.part(here))
                found = self._slopes(rov, x, d, sensitivity)
            outputs.append(Output(output, v, found))
        return outputs

    def _moved(self, x: Array, rov: Rov) -> tuple[list[ForcedRun], Motion]:
        """Compute the motion, and keep it for its derivatives and as a guess for the next x."""
        last = self._last.get("last")
        if last is not None and np.array_equal(last[0], x):
            return last[1], last[2]
        values = self.extra_values(x)
        starts = np.array([x[place.start] for _, _, place, _ in self.places])
        forced = [
            forced_run(rov, d, self._sum(values, d.recording, "delay"), v, self._flow(values, d))
            for d, v in zip(self.data, starts, strict=True)
        ]
        pairs = list(zip(forced, self.data, strict=True))
        steps = joined([steps_of(rov, f, self._sum(values, d.recording, "load")) for f, d in pairs])
        guesses = [np.concatenate([np.interp(f.run.start, d.time, d.velocity) for f, d in pairs])]
        if last is not None and len(last[2].v) == len(guesses[0]):
            guesses.insert(0, last[2].v)
        precision = 1e-12 if all(d.reach <= REACH for d in self.data) else 1e-7
        moved = motion(steps, starts, *guesses, precision=precision)
        self._last["last"] = x.copy(), forced, moved
        return forced, moved

    def _sum(self, values: dict[Extra, float], recording: Recording, kind: str) -> float:
        """Add the extras of a kind in a recording, without the load of an axis, which is a coefficient."""
        found = (extra for extra in self.extras if extra.kind == kind and extra.concerns(recording))
        return sum(values[extra] for extra in found if kind != "load" or extra.is_of_file)

    def _flow(self, values: dict[Extra, float], data: PreparedRecording) -> Current:
        """Return the current north and east in a recording."""
        north, east = (self._sum(values, data.recording, kind) for kind in (NORTH, EAST))
        return data.current[0] + north, data.current[1] + east

    def _slopes(self, rov: Rov, x: Array, data: PreparedRecording, sensitivity: Sensitivity) -> Slopes:
        """Return the derivatives; a coefficient in reverse depends on its ratio and on the coefficient ahead."""
        ratios = {extra: value for extra, value in self.extra_values(x).items() if extra.pairs()}
        own_names = ("lag", "dead band")
        named = {e: next(iter(e.coefficients(rov, 0.0))) for e in self.extras if e.kind in own_names}
        inner = [name for extra in ratios for name, _ in extra.pairs()]
        own = [extra for extra in self.extras if extra.concerns(data.recording)]
        found = sensitivity.by(data, [*self.names, *inner, *named.values()], own)
        for extra, ratio in ratios.items():
            for reverse, forward in extra.pairs():
                if (slope := found.pop(reverse, None)) is not None:
                    found[extra] = found.get(extra, 0.0) + rov[forward] * slope
                    if forward in self.names:
                        found[forward] = found[forward] + ratio * slope
        for extra, name in named.items():
            if (slope := found.pop(name, None)) is not None:
                found[extra] = slope
        return found

    def residuals(self, x: Array) -> Array:
        """Return the residuals, see the class; NaN where the motion cannot be computed: the search steps back."""
        try:
            outputs = self.run(x)
        except MotionError:
            return np.full(self._size, np.nan)
        parts = [
            (output.values - d.values) / sigma for output, (d, _, _, sigma) in zip(outputs, self.places, strict=True)
        ]
        if self.thrust:
            parts.append(self._whitening @ (x[self._of_thrust] - self.thrust.values))
        if self.likely is not None:
            neutral = np.array([extra.neutral for extra in self.extras])
            parts.append((x[len(self.names) : self.shared] - neutral) / self.likely)
        return np.concatenate(parts)

    def jacobian(self, x: Array) -> Array:
        """Return the Jacobian of the residuals."""
        J = np.zeros((self._size, len(x)))
        shared: list[str | Extra] = [*self.names, *self.extras]
        columns = {key: n for n, key in enumerate(shared)}
        for output, (_, rows, initial, sigma) in zip(self.run(x, slopes=True), self.places, strict=True):
            for key, slope in output.slopes.items():
                J[rows, initial.start + key if isinstance(key, int) else columns[key]] = slope / sigma
        if self.thrust:
            first = sum(len(d.time) for d in self.data)
            J[first : first + len(self._of_thrust), self._of_thrust] = self._whitening
        if self.likely is not None:
            J[self._size - len(self.extras) :, len(self.names) : self.shared] = np.diag(1.0 / self.likely)
        return J

    @property
    def _size(self) -> int:
        """The number of residuals."""
        with_prior = len(self.extras) if self.likely is not None else 0
        return sum(len(d.time) for d in self.data) + (len(self.thrust.names) if self.thrust else 0) + with_prior

    @cached_property
    def _of_thrust(self) -> list[int]:
        assert self.thrust
        return [self.names.index(name) for name in self.thrust.names]

    @cached_property
    def _whitening(self) -> Array:
        assert self.thrust
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.thrust.covariance)))


def solve(model: Simulator, start: Array, loss: Loss, tolerance: float = 1e-8) -> Solution:
    """Return the best fit within the limits; a large tolerance gives a fit near it. Raises MotionError."""
    inside = limits(model.base, model.data, model.names, model.extras, len(start))
    start = np.clip(start, *inside)
    if not np.isfinite(model.residuals(start)).all():
        raise MotionError("the motion cannot be computed with these coefficients")
    return minimize(
        model.residuals,
        start,
        inside,
        jacobian=model.jacobian,
        loss=loss,
        threshold=HUBER,
        tolerance=tolerance,
        far=True,
    )
