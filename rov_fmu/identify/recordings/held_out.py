"""How well a fit predicts data it was not fitted to: each recording is predicted by a fit to the others."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import inf

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import velocity
from rov_fmu.identify.effects.effect import Effect, Setting, delay_of
from rov_fmu.identify.least_squares import covariance, estimate
from rov_fmu.identify.recordings.prediction_errors import Errors, Key, errors_of, joined
from rov_fmu.identify.simulation.limits import MotionError
from rov_fmu.identify.simulation.prepared import PreparedRecording, undivided
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.identify.simulation.solver import settled, solve
from rov_fmu.tank.arrays import Array

_AHEAD = 10.0
"""How far ahead the short predictions reach, s."""
_LEAD = 5.0
"""The time before a prediction from which its initial velocity and position are estimated, s. For a shorter recording
it is a third of the recording."""
_FEWEST = 8
"""The smallest number of samples of a half."""
_MOST = 30
"""The largest number of predictions of 10 s in a recording."""


@dataclass(frozen=True, eq=False)
class Part:
    """A recording or a part of it, n samples, whose first `start` samples give the state from which it is predicted."""

    data: PreparedRecording
    start: int
    values: Array
    """The predicted values of the sensor, n."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """The prediction of one recording by a fit to the others."""

    whole: Part
    """The whole recording, or half of it."""
    coefficients: Mapping[str, float]
    """The coefficients of the vehicle by the fit to the others."""
    errors_of_fit: Mapping[str, float]
    """The standard errors of the fitted coefficients among them, if the noise is white."""
    ahead: Callable[[], list[Part]]
    """Return the predictions of 10 s. Raises MotionError."""

    @property
    def recording(self) -> Recording:
        """The recording; the prediction may be of a half of it."""
        return self.whole.data.recording

    @property
    def time(self) -> Array:
        """The time of the samples, s."""
        return self.whole.data.time

    @property
    def measured(self) -> Array:
        """The smoothed velocity of the sensor, n."""
        return self.whole.data.velocity

    @cached_property
    def predicted(self) -> Array:
        """The predicted velocity, smoothed in the same way, n."""
        even, smooth = velocity(self.time, self.whole.values, is_position=self.recording.is_position)
        return np.interp(self.time, even, smooth)

    @property
    def error(self) -> float:
        """The mean square error of the velocity over 10 s (or over the whole recording, if it is shorter), relative to
        that of no change."""
        predicted, unchanged, _ = of_velocity(self.errors).rms
        return (predicted / unchanged) ** 2 if unchanged > 0.0 else 0.0

    @cached_property
    def errors(self) -> dict[Key, Errors]:
        """The errors over the whole recording, and those of predictions of 10 s where it is long enough for them."""
        whole = errors_of(self.whole.data, self.whole.values, self.whole.start)
        found: dict[Key, Errors] = {("whole recording", quantity): errors for quantity, errors in whole.items()}
        try:
            parts = [errors_of(part.data, part.values, part.start) for part in self.ahead()]
        except MotionError:
            return found
        return found | joined({("10 s", quantity): e for quantity, e in part.items()} for part in parts)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The predictions of the recordings of an axis, or of the two halves of a single one."""

    predictions: tuple[Prediction, ...]
    by_halves: bool
    failed: tuple[str, ...] = ()
    """The files whose prediction cannot be computed."""

    @cached_property
    def errors(self) -> dict[Key, Errors]:
        """The errors of all predictions together."""
        return joined(prediction.errors for prediction in self.predictions)


def of_velocity(errors: Mapping[Key, Errors]) -> Errors:
    """Return the errors of the velocity over 10 s, or over whole recordings where none is long enough for that."""
    return errors.get(("10 s", "velocity"), errors["whole recording", "velocity"])


def hold_out(model: Simulator, x: Array, on_step: Callable[[], None] | None = None) -> dict[str, HeldOut]:
    """Predict the recordings of every file by a fit to the others, which starts near the solution x; by axis.

    A single file is divided into halves. `on_step` is called at each step of a search.
    """
    whole = undivided(model.data)
    files = list(dict.fromkeys(d.recording.file for d in whole))
    by_halves = len(files) == 1
    if by_halves:
        end = float(np.median(np.concatenate([d.time for d in whole])))  # as many samples before as after, despite gaps
        halves = [_half(whole, end, later=later) for later in (False, True)]
        pieces = [_half(model.data, end, later=later) for later in (False, True)]
        groups = [(halves[n], pieces[n], pieces[1 - n]) for n in (0, 1)]
    else:
        groups = [
            (
                [d for d in whole if d.recording.file == file],
                [d for d in model.data if d.recording.file == file],
                [d for d in model.data if d.recording.file != file],
            )
            for file in files
        ]
    found: dict[str, list[Prediction]] = {d.axis.name: [] for d in whole}
    failed: dict[str, list[str]] = {d.axis.name: [] for d in whole}
    for unseen, own, seen in groups:
        try:
            for prediction in _predictions(model, x, unseen, own, seen, on_step=on_step):
                found[prediction.recording.axis.name].append(prediction)
        except MotionError:
            for d in unseen:
                failed[d.axis.name].append(d.recording.file)
    return {axis: HeldOut(tuple(found[axis]), by_halves, tuple(dict.fromkeys(failed[axis]))) for axis in found}


def _half(data: Sequence[PreparedRecording], end: float, *, later: bool) -> list[PreparedRecording]:
    """Return the samples of recordings before a time, or those from this time on."""
    halves = [d.part((d.time >= end) == later) for d in data]
    return [half for half in halves if len(half.time) >= _FEWEST]


def _predictions(
    model: Simulator,
    x: Array,
    unseen: Sequence[PreparedRecording],
    own: Sequence[PreparedRecording],
    seen: Sequence[PreparedRecording],
    *,
    on_step: Callable[[], None] | None = None,
) -> Iterator[Prediction]:
    """Yield the predictions of recordings that were made together by a fit to the pieces that are seen.

    Their own pieces tell their current, which is independent of the vehicle. An effect that the others do not show is
    that of the fit to all, such as the thrust in reverse where only this recording goes astern. Raises MotionError.
    """
    sigma = {id(d.recording): float(s) for d, s in zip(model.data, model.sigma, strict=True)}

    def of(data: Sequence[PreparedRecording], base: Simulator) -> Simulator:
        return replace(base, data=tuple(data), sigma=np.array([sigma[id(d.recording)] for d in data]))

    if not seen:
        return
    seen = [d.thinned() for d in seen]
    extras = tuple(e for e in model.extras if not e.is_of_file or any(e.concerns(d.recording) for d in seen))
    setting = Setting([d.recording for d in seen], model.base)
    values = model.extra_values(x)
    usual = np.array([extra.prior(setting) for extra in extras])
    others = of(seen, replace(model, extras=extras, likely=usual, expected=values))
    first = others.start(model.rov(x).coefficients, values, model.starts(x))
    solution = solve(others, first, "linear", 1e-4, on_step)
    fitted = others.extra_values(solution.x)
    late = [_delayed(d, fitted) for d in unseen]
    flow = tuple(e for e in model.extras if e.is_current and any(e.concerns(d.recording) for d in late))
    alone = of(late, Simulator(tuple(late), others.rov(solution.x), (), flow, np.ones(len(late))))
    if flow:
        currents = of([_delayed(d, fitted).thinned() for d in own], alone)
        values = currents.extra_values(solve(currents, currents.start({}, values), "linear", 1e-4, on_step).x)
    errors = estimate(others.names, solution.x, covariance(solution.jacobian.T @ solution.jacobian), inf, 1.0).errors
    begin, end = min(float(d.time[0]) for d in late), max(float(d.time[-1]) for d in late)
    seconds = min(_LEAD, (end - begin) / 3.0)
    starts = [_lead(d, begin, seconds) or max(3, len(d.time) // 3) for d in late]
    ((*parts,),) = _predicted(alone, values, [list(zip(late, starts, strict=True))])
    ahead = cache(lambda: _predicted(alone, values, [*_windows(late)]))
    for n, part in enumerate(parts):

        def own_windows(n: int = n) -> list[Part]:
            return [part for window in ahead() for part in window if part.data.recording is late[n].recording]

        yield Prediction(part, alone.base.coefficients, errors, own_windows)


def _delayed(data: PreparedRecording, values: Mapping[Effect, float]) -> PreparedRecording:
    """Return a recording with the delay of its axis that was fitted to the others."""
    of_axis = {effect: value for effect, value in values.items() if not effect.is_of_file}
    return replace(data, delay=delay_of(of_axis, data.recording))


# ---- Predictions from a state that the data up to their start give ---------------------------------------------------


def _predicted(
    model: Simulator, values: Mapping[Effect, float], windows: Sequence[Sequence[tuple[PreparedRecording, int]]]
) -> list[list[Part]]:
    """Predict windows of recordings. The values at the start of each window are fitted to its first samples.

    Raises MotionError.
    """
    sigma = {id(d.recording): s for d, s in zip(model.data, model.sigma.tolist(), strict=True)}
    data = [replace(d, piece=n) for n, window in enumerate(windows) for d, _ in window]
    starts = [start for window in windows for _, start in window]
    noise = np.array([sigma[id(d.recording)] for d in data])
    if not data:
        return []
    leads = [d.part(slice(start)).thinned() for d, start in zip(data, starts, strict=True)]
    before = replace(model, data=tuple(leads), sigma=noise)
    fitted = settled(before, before.start({}, values))
    after = replace(model, data=tuple(data), sigma=noise)
    outputs = after.run(after.start({}, values, before.starts(fitted)))
    parts = iter(Part(d, start, o.values) for d, start, o in zip(data, starts, outputs, strict=True))
    return [[next(parts) for _ in window] for window in windows]


def _windows(data: Sequence[PreparedRecording]) -> Iterator[list[tuple[PreparedRecording, int]]]:
    """Yield windows spaced evenly along recordings that were made together: the lead of a prediction and 10 s more."""
    first, last = min(float(d.time[0]) for d in data), max(float(d.time[-1]) for d in data) - _LEAD - _AHEAD
    for begin in np.arange(first, last + 1e-9, max(_AHEAD, (last - first) / _MOST)).tolist():
        window = []
        for d in data:
            part = d.part((begin <= d.time) & (d.time < begin + _LEAD + _AHEAD))
            start = _lead(part, begin, _LEAD) if len(part.time) > 3 else 0
            if start and len(part.time) > 2 * start:  # most of the samples are there
                window.append((part, start))
        if len(window) == len(data):
            yield window


def _lead(data: PreparedRecording, begin: float, seconds: float) -> int:
    """Return the number of samples in the first seconds; 0 where most of them are missing, or fewer than three."""
    count = int(np.searchsorted(data.time, begin + seconds, side="right"))
    return count if count >= max(3.0, 0.5 * seconds / float(np.median(np.diff(data.time)))) else 0
