"""Fit drag, β and optional effects to whole recordings: simulated against measured output (output error).

The fit compares what the sensor measures, such as a depth and not its derivative, so white noise stays white. Commands
and motion determine A, B and C of v' = C - B v - A |v| v, and with given thrust, inertia and α also a_d, b_d and β.
Load, delay, current, lag and different coefficients in reverse are fitted where they are identifiable. Motion under
many commands also determines the shape of the thrust curve, so the measured forces are residuals of the same fit, and
all axes that share a tested curve are fitted together. Each recording adds two parameters: its initial velocity and
position.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import count
from math import inf

import numpy as np
from threadpoolctl import threadpool_limits

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import robust_deviation, white_noise
from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.attitude import Attitude
from rov_fmu.identify.effects.current import Current, CurrentNorth, is_in_flow
from rov_fmu.identify.effects.delay import Delay
from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.identify.effects.lag import Lag
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.effects.reverse import ReverseDrag, ReverseThrust
from rov_fmu.identify.least_squares import Loss
from rov_fmu.identify.points.tables import Table, TableForces, TablePoints
from rov_fmu.identify.recordings.dead_bands import with_secants
from rov_fmu.identify.recordings.held_out import HeldOut, hold_out
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, RecordingsFit, effects_of, estimate_of, part_of
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis
from rov_fmu.identify.recordings.selection import candidates, earn_their_place, likely
from rov_fmu.identify.recordings.switches import allow_for_switches
from rov_fmu.identify.simulation.first_guess import DELAYS, first_guess
from rov_fmu.identify.simulation.limits import check_limits, check_thrust
from rov_fmu.identify.simulation.prepared import PreparedRecording, axes_of, divided, prepare, some_pieces
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.identify.simulation.solver import settled, solve
from rov_fmu.io.messages import Progress, silent
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import AXES, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import NO_REQUESTS, Requests

_BEYOND_DOUBT = 100.0
"""Effects with a larger Wald statistic need no confirmation by held-out predictions."""
_STEPS = 30
"""The number of steps of a search after which half of the work seems to be done."""
_ITERATIONS = 6
"""The number of iterations of the noise estimate, if times of switches are uncertain."""
_PIECE = 5.0
"""The length of a piece of a recording, s, where the axes act on each other. The coupling makes a vehicle that moves
ahead unstable in yaw, so small errors grow quickly, and the simulation of a long piece tells little."""


def fit_recordings(
    recordings: Sequence[Recording],
    base: Rov,
    known: Collection[str] = (),
    forces: Sequence[TableForces] = (),
    loss: Loss = "huber",
    requests: Requests = NO_REQUESTS,
    points: Sequence[TablePoints] = (),
    on_progress: Progress = silent,
) -> tuple[RecordingsFit, ...]:
    """Fit the unknown drag and β of every recorded axis, and optional effects; `base` has the other coefficients.

    `requests` are those of [fit]. `forces` of tested curves and `points` of tables are residuals of the same fit. The
    intervals account for the correlation of the residuals. `on_progress` is called at each step of a search. Raises
    MotionError or NoFitError.
    """
    order = list(base.layout.kinds)
    recordings = sorted(recordings, key=lambda r: order.index(r.axis.name))
    setting = Setting(recordings, base, known, requests)
    data = tuple(replace(prepare(r, base), attitude=Attitude.of(r) if requests.attitude else None) for r in recordings)
    data = divided(data, _PIECE if base.layout.is_linked else inf)
    with threadpool_limits(1, user_api="blas"):  # threads make such small systems slower
        on_step = _counting(data, on_progress)
        return _Fit(data, base, known, loss, on_step, tuple(forces), tuple(points)).choose(tuple(candidates(setting)))


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
    loss: Loss
    on_step: Callable[[], None]
    """A function that is called at each step of a search."""
    forces: tuple[TableForces, ...] = ()
    points: tuple[TablePoints, ...] = ()

    @property
    def axes(self) -> list[Axis]:
        """The recorded axes."""
        return axes_of(self.data)

    @property
    def names(self) -> tuple[str, ...]:
        """The coefficients to fit: those of thrust, then those of each axis."""
        drag = (name for axis in self.axes for name in drag_and_beta(self.base, axis, self.known))
        return (*(name for table in self.forces for name in table.fitted.names), *drag)

    def choose(self, extras: tuple[Effect, ...]) -> tuple[RecordingsFit, ...]:
        """Find a start and the times of switches, fit all extras, and leave out those that the data do not justify."""
        noise = np.array([_at_least(white_noise(d.values), d) for d in self.data])
        some = some_pieces(self.data)
        sample = replace(self, data=tuple(self.data[n].thinned() for n in some))
        model = sample.model(extras, noise[some], with_prior=True)
        start = min((settled(model, start) for start in self.starts(model)), key=lambda x: _cost(model, x))
        x = solve(model, start, "linear", 1e-4, self.on_step).x
        check_limits(self.base, model.data, model.names, extras, x)
        common = tuple(e for e in extras if e.is_current or not e.is_of_file)  # the others would explain some switches
        plain = sample.model(common, noise[some], with_prior=True)
        found = solve(plain, x[model.places_of(common)], "linear", 1e-4, self.on_step).x
        allowing = replace(self, data=allow_for_switches(*self.of_all_pieces(plain, found, noise)))
        return allowing.chosen(extras, self.of_all_pieces(model, x, noise)[1])

    def of_all_pieces(self, model: Simulator, x: Array, noise: Array) -> tuple[Simulator, Array]:
        """Return the model with all samples of all pieces, and its parameters, derived from a fit to some of the
        pieces."""
        whole = self.model(model.extras, noise, with_prior=True)
        start = whole.start(model.rov(x).coefficients, model.extra_values(x), model.starts(x))
        without_spikes = replace(whole, data=tuple(d.thinned() for d in self.data))
        return whole, settled(without_spikes, start)

    def chosen(self, extras: tuple[Effect, ...], x: Array) -> tuple[RecordingsFit, ...]:
        """Fit all effects, starting from x, and leave out those that the data do not justify."""
        noise = self.noise(extras, x)
        if any(d.shifts is not None for d in self.data):  # x was fitted without the allowance for switches
            x = solve(self.model(extras, noise, with_prior=True), x, self.loss, 1e-4, self.on_step).x
            noise = self.noise(extras, x)
        everything = self.model(extras, noise, with_prior=True)
        whole = self.analysed(everything, x, 1e-4)  # effects that are not identifiable settle slowly
        kept, x = earn_their_place(whole)
        chosen = self.reduced(self.analysed(self.model(kept, noise), x), noise)
        chosen = self.exchanged(self.simplest(chosen, noise), extras, noise)
        chosen = self.reduced(chosen, noise)  # without a wrong effect, others may not be justified
        kept = chosen.model.extras
        if (better := self.voted(chosen)) != kept:
            x = chosen.x[chosen.model.places_of(better)]
            kept, chosen = better, self.analysed(self.model(better, noise), x)
        check_limits(self.base, self.data, chosen.model.names, kept, chosen.x)
        check_thrust(chosen.model.rov(chosen.x), self.data)
        effects = effects_of(whole, kept) | effects_of(chosen, kept)
        held_out = cache(lambda: self.held_out(chosen, kept))
        return tuple(self._result(axis, chosen, effects, held_out) for axis in self.axes)

    def starts(self, model: Simulator) -> Iterator[Array]:
        """Yield the starts of the search: the first guess, and that without delays where the guess has some."""
        for delays in (DELAYS, (0.0,)):
            coefficients = {name: value for table in self.forces for name, value in table.fitted.named.items()}
            values = {e: e.begin for e in model.extras}
            late = False
            for axis in self.axes:
                guess, delay = first_guess(axis, self.data, self.base, delays)
                coefficients |= {name: guess[_key(name)] for name in drag_and_beta(self.base, axis, self.known)}
                slow = any(isinstance(e, Lag) and e.of in self._own(axis) for e in model.extras)
                begin = {Load(axis.name): guess["F_0"], Delay(axis.name): delay - Lag.begin * slow}
                values |= {e: value for e, value in begin.items() if e in values}
                late |= delay != 0.0
            yield model.start(coefficients, values)
            if not late:
                return

    def reduced(self, analysis: ResidualAnalysis, noise: Array) -> ResidualAnalysis:
        """Leave out the extras that the data do not justify, and fit the others again, until all are justified."""
        while (fewer := earn_their_place(analysis))[0] != analysis.model.extras:
            analysis = self.analysed(self.model(fewer[0], noise), fewer[1])
        return analysis

    def simplest(self, analysis: ResidualAnalysis, noise: Array) -> ResidualAnalysis:
        """Drop groups of extras that are not justified together, by the Bayesian criterion.

        Load, current and coefficients by direction can replace each other, so each of them may be significant although
        all together explain nothing. For example, motion in one direction stays the same with more current, more load
        and less linear drag.
        """
        kept = analysis.model.extras
        currents: set[Effect] = {e for e in kept if type(e) is Current}
        others = {e for e in kept if isinstance(e, Load) or e.pairs()} if currents else set()
        each = np.log(max(analysis.degrees_of_freedom, 8.0))
        for dropped in dict.fromkeys(map(frozenset, (currents | others, others, currents))):
            if len(dropped) > 1:  # the effect of such extras is not linear, so Wald's statistic does not hold
                without = tuple(e for e in kept if e not in dropped)
                start = analysis.x[analysis.model.places_of(without)]
                other = self.analysed(self.model(without, noise), start, 1e-4)
                if analysis.gain(other) < each * len(dropped):
                    return self.analysed(other.model, other.x)
        return analysis

    def exchanged(self, analysis: ResidualAnalysis, extras: tuple[Effect, ...], noise: Array) -> ResidualAnalysis:
        """Exchange drag in reverse for thrust in reverse where this explains the recordings better.

        Both change the steady velocity alike, so noise may have led to the wrong one.
        """
        kept = analysis.model.extras
        for drag in (e for e in kept if isinstance(e, ReverseDrag)):
            own = self._own(AXES[drag.of])
            for thrust in (e for e in extras if isinstance(e, ReverseThrust) and e.of in own and e not in kept):
                others = tuple(thrust if e == drag else e for e in kept)
                values = {**analysis.model.extra_values(analysis.x), thrust: thrust.begin}
                model = self.model(others, noise)
                start = model.start(
                    analysis.model.rov(analysis.x).coefficients, values, analysis.model.starts(analysis.x)
                )
                if (other := self.analysed(model, start)).cost.sum() < analysis.cost.sum():
                    analysis, kept = other, others
                    break
        return analysis

    def voted(self, analysis: ResidualAnalysis) -> tuple[Effect, ...]:
        """Return the extras without ratios by direction that do not improve the held-out predictions."""
        kept = analysis.model.extras
        doubtful = [e for e in kept if e.pairs() and analysis.significance(e) < _BEYOND_DOUBT]
        least = self._missed(analysis, kept) if doubtful else inf
        for extra in doubtful:
            without = tuple(e for e in kept if e != extra)
            if (missed := self._missed(analysis, without)) <= least:
                kept, least = without, missed
        return kept

    def _missed(self, analysis: ResidualAnalysis, extras: Collection[Effect]) -> float:
        """Return the sum of the errors of the held-out predictions; infinite where one cannot be computed."""
        found = self.held_out(analysis, extras).values()
        return inf if any(each.failed for each in found) else sum(p.error for each in found for p in each.predictions)

    def _own(self, axis: Axis) -> set[str]:
        """Return the names of an axis and of its thrust curves."""
        return {axis.name, *(curve.name for curve in curves_of(self.base.layout, axis))}

    def held_out(self, analysis: ResidualAnalysis, extras: Collection[Effect]) -> dict[str, HeldOut]:
        """Predict the recordings of each file by a fit to the others. The thrust curves are those of the fit to all.
        Returns the results by axis."""
        rov, values = analysis.model.rov(analysis.x), analysis.model.extra_values(analysis.x)
        base = self.base.replaced(_common(rov, self.base))
        found: dict[str, HeldOut] = {}
        for axes in self.blocks:
            data = tuple(d for d in self.data if d.axis in axes)
            alone = replace(self, data=data, base=base, forces=(), points=())
            of = {name for axis in axes for name in self._own(axis)}
            own = tuple(e for e in extras if e.of in of or any(e.concerns(d.recording) for d in data))
            model = alone.model(own, analysis.model.sigma[[d.axis in axes for d in self.data]])
            start = model.start(rov.coefficients, values, analysis.model.starts(analysis.x))
            found |= hold_out(model, start, self.on_step)
        return found

    @property
    def blocks(self) -> list[list[Axis]]:
        """The recorded axes in groups that move independently of each other."""
        return [self.axes] if self.base.layout.is_linked or self.data[0].attitude else [[axis] for axis in self.axes]

    def first_in(self, recording: Recording) -> Axis | None:
        """Return the first axis in a file along which the current is seen."""
        file = recording.file
        return next((d.axis for d in self.data if d.recording.file == file and is_in_flow(d.recording)), None)

    def model(self, extras: tuple[Effect, ...], noise: Array, *, with_prior: bool = False) -> Simulator:
        """Return the model with these extras; the prior pulls them to their neutral values."""
        deviations = likely(extras, Setting([d.recording for d in self.data], self.base), all_of_them=with_prior)
        tables: tuple[Table, ...] = (*self.forces, *self.points)
        return Simulator(self.data, self.base, self.names, extras, noise, deviations, tables)

    def analysed(self, model: Simulator, start: Array, tolerance: float = 1e-8) -> ResidualAnalysis:
        """Fit the model and analyse the residuals."""
        solution = solve(model, start, self.loss, tolerance, self.on_step)
        return with_secants(ResidualAnalysis(model, solution, robust=self.loss == "huber"))

    def noise(self, extras: tuple[Effect, ...], x: Array) -> Array:
        """Return the robust standard deviation of each recording's noise, by the residuals at x.

        Where times of switches are uncertain, the residuals depend on the noise that is sought, so it is iterated.
        """
        found = np.array([_at_least(white_noise(d.values), d) for d in self.data])
        uncertain = any(d.shifts is not None for d in self.data)
        for _ in range(_ITERATIONS if uncertain else 1):
            model = self.model(extras, found)
            residuals = model.residuals(x)
            for pieces in model.recordings:
                white = np.concatenate([residuals[model.rows[n]] for n in pieces])
                found[pieces] = _at_least(found[pieces[0]] * robust_deviation(white), self.data[pieces[0]])
        return found

    def _result(
        self,
        axis: Axis,
        analysis: ResidualAnalysis,
        effects: dict[Effect, FittedEffect],
        held_out: Callable[[], dict[str, HeldOut]],
    ) -> RecordingsFit:
        curves = {curve.name for curve in curves_of(self.base.layout, axis)}
        own = [d.recording for d in self.data if d.axis is axis]
        flows = {e.of for e in effects if isinstance(e, CurrentNorth)}
        flows -= {r.file for r in own if self.first_in(r) is axis}
        of_axis = {
            e: effect
            for e, effect in effects.items()
            if e.of in curves or (any(map(e.concerns, own)) and not (isinstance(e, CurrentNorth) and e.of in flows))
        }
        rov, together = analysis.model.rov(analysis.x), estimate_of(analysis)
        return RecordingsFit(
            axis,
            rov,
            together,
            part_of(together, axis, rov),
            tuple(s for s in analysis.simulations if s.recording.axis is axis),
            tuple(of_axis.values()),
            lambda: held_out()[axis.name],
            points=sum(len(each.points) for each in self.points if each.axis is axis),
            between_rows=any(d.between_rows for d in self.data if d.axis is axis),
        )


def _counting(data: Sequence[PreparedRecording], on_progress: Progress) -> Callable[[], None]:
    """Return a function that reports another step of the search; how many there will be is not known."""
    axes, steps = join_names(axis.name for axis in axes_of(data)), count(1)

    def on_step() -> None:
        n = next(steps)
        on_progress(f"recordings of {axes}, step {n}", n / (n + _STEPS))

    return on_step


def _key(name: str) -> str:
    """Return the key of a coefficient of drag, or of β."""
    return next(key for key in ("a_d", "b_d", "beta") if name.startswith(key))


def _at_least(noise: float, data: PreparedRecording) -> float:
    return max(noise, 1e-6 * float(np.ptp(data.values)), 1e-12)


def _cost(model: Simulator, x: Array) -> float:
    """Return the sum of the squares of the residuals."""
    r = model.residuals(x)
    return float(r @ r)


def _common(rov: Rov, base: Rov) -> dict[str, float]:
    """Return the coefficients of `rov` that `base` has too."""
    return {name: rov[name] for name in base.coefficients}
