"""Fit drag, β and optional effects to whole recordings: simulated against measured output (output error).

The fit compares what the sensor measures, such as a depth and not its derivative, so white noise stays white. Commands
and motion determine A, B and C of v' = C - B v - A |v| v, and with given thrust, inertia and α also a_d, b_d and β.
Load, delay, current, lag and different coefficients in reverse are fitted where they are identifiable. Motion under
many commands also determines the shape of the thrust curve, so a tested curve takes part with its uncertainty, and all
axes that share it are fitted at once. Each recording adds its initial velocity and position.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf

import numpy as np
from threadpoolctl import threadpool_limits

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.coupling import EAST, NORTH, is_in_flow
from rov_fmu.identify.effects.extras import Extra
from rov_fmu.identify.least_squares import Estimate, Loss, external
from rov_fmu.identify.recordings.held_out import HeldOut, hold_out
from rov_fmu.identify.recordings.limits import check_limits
from rov_fmu.identify.recordings.recordings_fit import Effect, RecordingsFit, effects_of, estimate_of, part_of
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis
from rov_fmu.identify.recordings.runs import PreparedRecording, axes_of, prepare
from rov_fmu.identify.recordings.selection import candidates, earn_their_place, likely
from rov_fmu.identify.recordings.simulator import Simulator, solve
from rov_fmu.identify.recordings.trajectory import MotionError
from rov_fmu.model.layout import YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import robust_deviation, white_noise

_BETAS = (0.03, 0.1, 0.3, 1.0, 3.0)  # starts
_DELAYS = (0.0, 0.3)
_STARTS = 3
_BEYOND_DOUBT = 100.0
"""The value of Wald's statistic from which no held-out prediction is needed."""
_GOOD = 1.5
"""The cost per sample of a fit that cannot become much better; white noise has 1.36."""
_FEW = 200
"""The number of samples of a recording in the search for a start."""
_LONG = 100.0
"""The length of a recording in the search for a start, s."""


def fit_recordings(
    recordings: Sequence[Recording],
    base: Rov,
    known: Collection[str] = (),
    thrust: Estimate | None = None,
    loss: Loss = "huber",
    lag: Collection[str] = (),
) -> tuple[RecordingsFit, ...]:
    """Fit the unknown drag and β of every recorded axis, and optional effects; `base` has the other coefficients.

    `thrust` is the estimate of tested curves; `lag` has the curves whose lag is fitted. The intervals account for the
    correlation of the residuals. Raises MotionError or NoFitError.
    """
    order = list(base.layout.kinds)
    data = tuple(prepare(r, base) for r in sorted(recordings, key=lambda r: order.index(r.axis.name)))
    with threadpool_limits(1, user_api="blas"):  # threads make such small systems slower
        return _Fit(data, base, known, thrust, loss).choose(tuple(candidates(data, base, known, lag)))


def drag_and_beta(base: Rov, axis: Axis, known: Collection[str] = ()) -> tuple[str, ...]:
    """Return the names of the unknown coefficients of drag and β of an axis."""
    form = base.layout.kinds[axis.name]
    names = (form.coefficient(key) for key in ("a_d", "b_d", "a_d_reverse", "b_d_reverse", "beta"))
    return tuple(name for name in dict.fromkeys(names) if name not in known)


@dataclass(frozen=True, eq=False)
class _Fit:
    """The recordings of some axes, and the fits of different models to them."""

    data: tuple[PreparedRecording, ...]
    base: Rov
    known: Collection[str]
    thrust: Estimate | None
    loss: Loss

    @property
    def axes(self) -> list[Axis]:
        """The recorded axes."""
        return axes_of(self.data)

    @property
    def names(self) -> tuple[str, ...]:
        """The coefficients to fit: those of thrust, then those of each axis."""
        drag = (name for axis in self.axes for name in drag_and_beta(self.base, axis, self.known))
        return (*(self.thrust.names if self.thrust else ()), *drag)

    def choose(self, extras: tuple[Extra, ...]) -> tuple[RecordingsFit, ...]:
        """Find a start, fit all extras, and leave out those that the data do not justify."""
        coefficients, values = dict(self.thrust.named if self.thrust else {}), {e: _begin(e) for e in extras}
        noise = np.array([_at_least(white_noise(d.values), d) for d in self.data])
        for axis in self.axes:
            alone = replace(self, data=tuple(_glimpse(d) for d in self.data if d.axis is axis), thrust=None)
            near, found = alone.near(axis, extras, noise[[d.axis is axis for d in self.data]])
            coefficients |= near
            values |= found
        model = replace(self, data=tuple(d.thinned() for d in self.data)).model(extras, noise, with_prior=True)
        x = solve(model, model.start(coefficients, values), "linear", 1e-4).x
        check_limits(self.base, model.data, model.names, extras, x)
        noise = self.noise(extras, x)
        whole = self.analysed(
            self.model(extras, noise, with_prior=True), x, 1e-5
        )  # unidentifiable extras settle slowly
        kept, x = earn_their_place(whole)
        chosen = self.analysed(self.model(kept, noise), x)
        while (fewer := earn_their_place(chosen))[0] != kept:  # extras were dropped to first order only
            kept, x = fewer
            chosen = self.analysed(self.model(kept, noise), x)
        chosen = self.simplest(chosen, noise)
        kept = chosen.model.extras
        if (better := self.voted(chosen)) != kept:
            x = chosen.x[chosen.model.places_of(better)]
            kept, chosen = better, self.analysed(self.model(better, noise), x)
        check_limits(self.base, self.data, chosen.model.names, kept, chosen.x)
        effects = effects_of(whole, kept) | effects_of(chosen, kept)
        return tuple(self._result(axis, chosen, effects) for axis in self.axes)

    def simplest(self, analysis: ResidualAnalysis, noise: Array) -> ResidualAnalysis:
        """Drop groups of extras that are not justified together, by the Bayesian criterion.

        Load, current and coefficients by direction can replace each other, so each may be significant although all of
        them explain nothing: motion in one direction is the same with more current, more load and less linear drag.
        """
        kept = analysis.model.extras
        currents = {e for e in kept if e.kind == "current"}
        others = {e for e in kept if e.kind == "load" or e.pairs()} if currents else set()
        each = np.log(max(analysis.degrees_of_freedom, 8.0))
        for dropped in dict.fromkeys(map(frozenset, (currents | others, others, currents))):
            if len(dropped) > 1:  # the effect of such extras is not linear, so Wald's statistic does not hold
                without = tuple(e for e in kept if e not in dropped)
                start = analysis.x[analysis.model.places_of(without)]
                other = self.analysed(self.model(without, noise), start, 1e-4)
                if analysis.gain(other) < each * len(dropped):
                    return self.analysed(other.model, other.x)
        return analysis

    def voted(self, analysis: ResidualAnalysis) -> tuple[Extra, ...]:
        """Return the extras without ratios by direction that do not improve the held-out predictions."""
        kept = analysis.model.extras
        doubtful = [e for e in kept if e.pairs() and analysis.significance(e) < _BEYOND_DOUBT]
        least = self._missed(analysis, kept) if doubtful else inf
        for extra in doubtful:
            without = tuple(e for e in kept if e != extra)
            if (missed := self._missed(analysis, without)) <= least:
                kept, least = without, missed
        return kept

    def _missed(self, analysis: ResidualAnalysis, extras: Collection[Extra]) -> float:
        """Return the sum of the errors of the held-out predictions; infinite where one cannot be computed."""
        found = [self.held_out(axis, analysis, extras) for axis in self.axes]
        return inf if any(each.failed for each in found) else sum(p.error for each in found for p in each.predictions)

    def held_out(self, axis: Axis, analysis: ResidualAnalysis, extras: Collection[Extra]) -> HeldOut:
        """Predict each recording of an axis by the others, with the thrust curve of the fit to all."""
        rov, values = analysis.model.rov(analysis.x), analysis.model.extra_values(analysis.x)
        data = tuple(_in_flow(d, values) for d in self.data if d.axis is axis)
        alone = replace(self, data=data, base=self.base.replaced(_common(rov, self.base)), thrust=None)
        curves = {curve.name for curve in curves_of(self.base.layout, axis)}
        own = tuple(
            e
            for e in extras
            if e.kind not in (NORTH, EAST)
            and (e.of in (axis.name, *curves) or any(e.concerns(d.recording) for d in data))
        )
        noise = analysis.model.sigma[[d.axis is axis for d in self.data]]
        model = alone.model(own, noise)
        x = model.start(dict(rov.coefficients), values)
        initial = [analysis.x[place] for d, _, place, _ in analysis.model.places if d.axis is axis]
        return hold_out(model, np.concatenate([x[: model.shared], *initial]))

    def near(self, axis: Axis, extras: Sequence[Extra], noise: Array) -> tuple[dict[str, float], dict[Extra, float]]:
        """Find coefficients of one axis and the extras that act on it from many starts, with fixed thrust."""
        own = {axis.name, *(curve.name for curve in curves_of(self.base.layout, axis))}
        concerned = tuple(
            e
            for e in extras
            if e.of in own
            # a current acts horizontally
            or (e.is_current and axis is not YAW and any(e.concerns(d.recording) for d in self.data))
        )
        model = self.model(concerned, noise, with_prior=True)
        delay = Extra("delay", axis.name)
        begin = {e: _begin(e) for e in concerned}
        starts = [model.start(self.guess(axis, beta), {**begin, delay: s}) for beta in _BETAS for s in _DELAYS]
        costs = sorted(((_cost(model, x), n) for n, x in enumerate(starts)))
        near = [starts[n] for cost, n in costs[:_STARTS] if np.isfinite(cost)]
        if not near:
            raise MotionError(f"the motion in {axis.name} cannot be computed with any coefficients")
        x = near[0]
        for start in near:
            try:
                x = min(x, solve(model, start, "linear", 1e-4).x, key=lambda x: _cost(model, x))
            except MotionError:  # this start is too far off
                continue
            if _cost(model, x) < _GOOD * len(model.residuals(x)):
                break
        return external(model.names, x), model.extra_values(x)

    def guess(self, axis: Axis, beta: float) -> dict[str, float]:
        """Return a start with half linear, half quadratic drag, so that the strongest force gives the highest speed."""
        data = [d for d in self.data if d.axis is axis]
        fastest = max(data, key=lambda d: d.speed)
        force = self.base.strongest(axis)
        if fastest.recording.command is not None:
            force = max(abs(self.base.force(axis, c)) for c in _ends(fastest.recording.command)) or force
        drag = self.base[axis.coefficient("alpha")] * force / fastest.speed
        kinds = {"a_d": 0.5 * drag / fastest.speed, "b_d": 0.5 * drag, "beta": beta}
        return {
            name: kinds[next(key for key in kinds if name.startswith(key))]
            for name in drag_and_beta(self.base, axis, self.known)
        }

    def first_in(self, recording: Recording) -> Axis | None:
        """Return the first axis in a file along which the current is seen."""
        file = recording.file
        return next((d.axis for d in self.data if d.recording.file == file and is_in_flow(d.recording)), None)

    def model(self, extras: tuple[Extra, ...], noise: Array, *, with_prior: bool = False) -> Simulator:
        """Return the model with these extras; the prior pulls them to their neutral values."""
        deviations = likely(extras, self.data, self.base) if with_prior else None
        return Simulator(self.data, self.base, self.names, extras, noise, self.thrust, deviations)

    def analysed(self, model: Simulator, start: Array, tolerance: float = 1e-8) -> ResidualAnalysis:
        """Fit the model and analyse the residuals."""
        return ResidualAnalysis(model, solve(model, start, self.loss, tolerance), robust=self.loss == "huber")

    def noise(self, extras: tuple[Extra, ...], x: Array) -> Array:
        """Return the robust standard deviation of each recording's residuals."""
        plain = self.model(extras, np.ones(len(self.data)))
        residuals = plain.residuals(x)
        return np.array([_at_least(robust_deviation(residuals[rows]), d) for d, rows, *_ in plain.places])

    def _result(self, axis: Axis, analysis: ResidualAnalysis, effects: dict[Extra, Effect]) -> RecordingsFit:
        curves = {curve.name for curve in curves_of(self.base.layout, axis)}
        own = [d.recording for d in self.data if d.axis is axis]
        flows = {e.of for e in effects if e.kind in (NORTH, EAST)} - {r.file for r in own if self.first_in(r) is axis}
        of_axis = {
            e: effect
            for e, effect in effects.items()
            if e.of in curves or (any(map(e.concerns, own)) and not (e.kind in (NORTH, EAST) and e.of in flows))
        }
        rov, together = analysis.model.rov(analysis.x), estimate_of(analysis)
        return RecordingsFit(
            axis,
            rov,
            together,
            part_of(together, axis, rov),
            tuple(s for s in analysis.simulations if s.recording.axis is axis),
            tuple(of_axis.values()),
            partial(self.held_out, axis, analysis, analysis.model.extras),
        )


def _cost(model: Simulator, x: Array) -> float:
    """Return the cost of a robust fit; infinite where the motion cannot be computed."""
    cost = float(np.sum(np.sqrt(1.0 + model.residuals(x) ** 2)))
    return cost if np.isfinite(cost) else float("inf")


def _ends(command: Array) -> tuple[float, float]:
    return float(command.min()), float(command.max())


def _in_flow(data: PreparedRecording, values: Mapping[Extra, float]) -> PreparedRecording:
    """Set the current of the recording's file to the fitted one, which is independent of the vehicle."""
    of: dict[str, float] = {e.kind: value for e, value in values.items() if e.concerns(data.recording)}
    return replace(data, current=(of.get(NORTH, 0.0), of.get(EAST, 0.0)))


def _glimpse(data: PreparedRecording) -> PreparedRecording:
    """Return a short part of a recording, to search for a start."""
    return data.liveliest(_LONG).thinned(_FEW)


def _begin(extra: Extra) -> float:
    """Return the start of the search for an extra."""
    return {"lag": 0.1, "dead band": 0.02}.get(extra.kind, extra.neutral)


def _at_least(noise: float, data: PreparedRecording) -> float:
    return max(noise, 1e-6 * float(np.ptp(data.values)), 1e-12)


def _common(rov: Rov, base: Rov) -> dict[str, float]:
    """Return the coefficients of `rov` that `base` has too."""
    return {name: rov[name] for name in base.coefficients}
