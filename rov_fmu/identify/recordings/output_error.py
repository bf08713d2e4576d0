"""Drag, β and what else acts, from whole recordings: the simulated output against the measured one (output error).

What the sensor measures is fitted, depth or heading and not its derivative, so white noise of the sensor stays white.
Commands and motion tell A, B and C of v' = C - B v - A |v| v: with thrust, inertia and α given, a_d, b_d and β; and the
load, the delay, the current, the lag, and what differs in reverse, as far as they show. Motion under many commands
tells the shape of the thrust curve too, so a curve from tests takes part, as uncertain as they left it; then all axes
that share it are fitted at once. Each recording adds its first velocity and position.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.coupling import EAST, NORTH, is_in_flow
from rov_fmu.identify.effects.extras import Extra
from rov_fmu.identify.least_squares import Estimate, Loss, external
from rov_fmu.identify.recordings.held_out import HeldOut, hold_out
from rov_fmu.identify.recordings.limits import refuse_nonsense
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

_BETAS = (0.03, 0.1, 0.3, 1.0, 3.0)  # to begin with
_DELAYS = (0.0, 0.3)
_STARTS = 3
_BEYOND_DOUBT = 100.0  # of Wald's statistic: no recording has to be left out to see it
_GOOD = 1.5  # cost of a sample: white noise has 1.36, so there is nothing better to find
_FEW = 200  # samples of a recording, to begin with
_LONG = 100.0  # s of a recording, to begin with


def fit_recordings(
    recordings: Sequence[Recording],
    base: Rov,
    known: Collection[str] = (),
    thrust: Estimate | None = None,
    loss: Loss = "huber",
    lag: Collection[str] = (),
) -> tuple[RecordingsFit, ...]:
    """Fit what is not known of drag and β of every axis recorded, and what else acts; `base` holds the rest, and α.

    `thrust` is the estimate of curves by tests, where they are not known; `lag` has the curves whose lag is sought.
    The intervals count the correlation that the residuals have beyond white noise. Raises MotionError,
    NoFitError.
    """
    order = list(base.layout.kinds)
    data = tuple(prepare(r, base) for r in sorted(recordings, key=lambda r: order.index(r.axis.name)))
    with threadpool_limits(1, user_api="blas"):  # for systems this small threads only get in each other's way
        return _Fit(data, base, known, thrust, loss).choose(tuple(candidates(data, base, known, lag)))


def drag_and_beta(base: Rov, axis: Axis, known: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the coefficients of drag and β of an axis, as far as they are not known."""
    form = base.layout.kinds[axis.name]
    names = (form.coefficient(key) for key in ("a_d", "b_d", "a_d_reverse", "b_d_reverse", "beta"))
    return tuple(name for name in dict.fromkeys(names) if name not in known)


@dataclass(frozen=True, eq=False)
class _Fit:
    """The recordings of some axes, to fit one model or another to."""

    data: tuple[PreparedRecording, ...]
    base: Rov
    known: Collection[str]
    thrust: Estimate | None
    loss: Loss

    @property
    def axes(self) -> list[Axis]:
        """Those recorded."""
        return axes_of(self.data)

    @property
    def names(self) -> tuple[str, ...]:
        """The coefficients to find: of thrust, then of each axis."""
        drag = (name for axis in self.axes for name in drag_and_beta(self.base, axis, self.known))
        return (*(self.thrust.names if self.thrust else ()), *drag)

    def choose(self, extras: tuple[Extra, ...]) -> tuple[RecordingsFit, ...]:
        """Begin near, look for every extra, and leave out what does not earn its place."""
        coefficients, values = dict(self.thrust.named if self.thrust else {}), {e: _begin(e) for e in extras}
        noise = np.array([_at_least(white_noise(d.values), d) for d in self.data])
        for axis in self.axes:
            alone = replace(self, data=tuple(_glimpse(d) for d in self.data if d.axis is axis), thrust=None)
            near, found = alone.near(axis, extras, noise[[d.axis is axis for d in self.data]])
            coefficients |= near
            values |= found
        model = replace(self, data=tuple(d.thinned() for d in self.data)).model(extras, noise, said=True)
        x = solve(model, model.start(coefficients, values), "linear", 1e-4).x
        refuse_nonsense(self.base, model.data, model.names, extras, x)
        noise = self.noise(extras, x)
        whole = self.analysed(self.model(extras, noise, said=True), x, 1e-5)  # what cannot be told is slow to settle
        kept, x = earn_their_place(whole)
        chosen = self.analysed(self.model(kept, noise), x)
        while (fewer := earn_their_place(chosen))[0] != kept:  # what was dropped was so to first order
            kept, x = fewer
            chosen = self.analysed(self.model(kept, noise), x)
        chosen = self.simplest(chosen, noise)
        kept = chosen.model.extras
        if (better := self.voted(chosen)) != kept:
            x = chosen.x[chosen.model.places_of(better)]
            kept, chosen = better, self.analysed(self.model(better, noise), x)
        refuse_nonsense(self.base, self.data, chosen.model.names, kept, chosen.x)
        effects = effects_of(whole, kept) | effects_of(chosen, kept)
        return tuple(self._result(axis, chosen, effects) for axis in self.axes)

    def simplest(self, analysis: ResidualAnalysis, noise: Array) -> ResidualAnalysis:
        """Without extras that together tell too little, by the Bayesian criterion.

        Load, current and what differs by direction stand in for each other, so each may pass alone and yet all of them
        tell nothing: motion one way is the same with more current, more load and less linear drag.
        """
        kept = analysis.model.extras
        currents = {e for e in kept if e.kind == "current"}
        others = {e for e in kept if e.kind == "load" or e.pairs()} if currents else set()
        each = np.log(max(analysis.degrees_of_freedom, 8.0))
        for dropped in dict.fromkeys(map(frozenset, (currents | others, others, currents))):
            if len(dropped) > 1:  # Wald's statistic will not do: what stands in for each other is far from linear
                without = tuple(e for e in kept if e not in dropped)
                start = analysis.x[analysis.model.places_of(without)]
                other = self.analysed(self.model(without, noise), start, 1e-4)
                if analysis.gain(other) < each * len(dropped):
                    return self.analysed(other.model, other.x)
        return analysis

    def voted(self, analysis: ResidualAnalysis) -> tuple[Extra, ...]:
        """The extras without those that differ by direction and do not help to predict a recording by the others."""
        kept = analysis.model.extras
        for extra in (e for e in kept if e.pairs() and analysis.significance(e) < _BEYOND_DOUBT):
            without = tuple(e for e in kept if e != extra)
            errors = [
                sum(p.error for axis in self.axes for p in self.held_out(axis, analysis, some).predictions)
                for some in (kept, without)
            ]
            kept = kept if errors[0] < errors[1] else without
        return kept

    def held_out(self, axis: Axis, analysis: ResidualAnalysis, extras: Collection[Extra]) -> HeldOut:
        """Each recording of an axis by the others, the thrust curve as all of them have it."""
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
        """Coefficients of one axis and the extras that act on it, thrust as it is, from many starts."""
        own = {axis.name, *(curve.name for curve in curves_of(self.base.layout, axis))}
        concerned = tuple(
            e
            for e in extras
            if e.of in own
            # what flows is felt along the surface
            or (e.is_current and axis is not YAW and any(e.concerns(d.recording) for d in self.data))
        )
        model = self.model(concerned, noise, said=True)
        delay = Extra("delay", axis.name)
        begin = {e: _begin(e) for e in concerned}
        starts = [model.start(self.guess(axis, beta), {**begin, delay: late}) for beta in _BETAS for late in _DELAYS]
        costs = sorted(((_cost(model, x), n) for n, x in enumerate(starts)))
        near = [starts[n] for cost, n in costs[:_STARTS] if np.isfinite(cost)]
        if not near:
            raise MotionError(f"the motion in {axis.name} cannot be computed with any coefficients")
        x = near[0]
        for start in near:
            try:
                x = min(x, solve(model, start, "linear", 1e-4).x, key=lambda x: _cost(model, x))
            except MotionError:  # a start too far off; the others are not
                continue
            if _cost(model, x) < _GOOD * len(model.residuals(x)):
                break
        return external(model.names, x), model.extra_values(x)

    def guess(self, axis: Axis, beta: float) -> dict[str, float]:
        """Drag half linear, half quadratic, such that the strongest force gives about the highest speed."""
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
        """The axis that tells of the current in a file."""
        file = recording.file
        return next((d.axis for d in self.data if d.recording.file == file and is_in_flow(d.recording)), None)

    def model(self, extras: tuple[Extra, ...], noise: Array, *, said: bool = False) -> Simulator:
        """With these extras; `said` whether they are likely to be none."""
        far = likely(extras, self.data, self.base) if said else None
        return Simulator(self.data, self.base, self.names, extras, noise, self.thrust, far)

    def analysed(self, model: Simulator, start: Array, tolerance: float = 1e-8) -> ResidualAnalysis:
        """The best fit."""
        return ResidualAnalysis(model, solve(model, start, self.loss, tolerance), robust=self.loss == "huber")

    def noise(self, extras: tuple[Extra, ...], x: Array) -> Array:
        """Standard deviation of each recording's residuals, robust."""
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
    """Of a robust fit; infinite where the motion cannot be computed."""
    cost = float(np.sum(np.sqrt(1.0 + model.residuals(x) ** 2)))
    return cost if np.isfinite(cost) else float("inf")


def _ends(command: Array) -> tuple[float, float]:
    return float(command.min()), float(command.max())


def _in_flow(data: PreparedRecording, values: Mapping[Extra, float]) -> PreparedRecording:
    """With the current of its file, which is found by several axes and tells nothing of the vehicle."""
    of: dict[str, float] = {e.kind: value for e, value in values.items() if e.concerns(data.recording)}
    return replace(data, current=(of.get(NORTH, 0.0), of.get(EAST, 0.0)))


def _glimpse(data: PreparedRecording) -> PreparedRecording:
    """A little of a recording, to begin with."""
    return data.liveliest(_LONG).thinned(_FEW)


def _begin(extra: Extra) -> float:
    """Where the search for an extra starts."""
    return {"lag": 0.1, "dead band": 0.02}.get(extra.kind, extra.neutral)


def _at_least(noise: float, data: PreparedRecording) -> float:
    return max(noise, 1e-6 * float(np.ptp(data.values)), 1e-12)


def _common(rov: Rov, base: Rov) -> dict[str, float]:
    """The numbers of a vehicle that another one has too."""
    return {name: rov[name] for name in base.coefficients}
