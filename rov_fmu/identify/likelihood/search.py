"""The search for the structure: an alarm, and a search among the hypotheses, which are compared by J.

Noise hides a wrong structure: a slow force, a slow gain and coloured noise explain each next sample, and the
innovations look right. Predictions over 10 s do not: relative to the noise of the sensor, their errors are near 1 where
the structure is right. Above ALARM, each hypothesis changes the model, J is minimised anew, and 2 ln of the Bayes
factor (Laplace approximation), with the prior probability, decides. What wins is part of the model.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from math import inf, log, nan

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.hypotheses import HYPOTHESES, Model, Variant, in_order
from rov_fmu.identify.likelihood.kinds import INERTIA, WHITE, WIDTH
from rov_fmu.identify.likelihood.objective import OUTLYING, Data, Objective, cost, with_samples
from rov_fmu.identify.likelihood.parameters import Table
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.likelihood.records import AHEAD, LEAST_COMMAND, unchanged
from rov_fmu.identify.likelihood.solve import QUICK, Minimum, evidence, evidence_at, minimise, scaled, total
from rov_fmu.identify.result import ALARM, least_error
from rov_fmu.tank.arrays import Array, rms
from rov_fmu.tank.clocks import first_in_each, held

WINS, CLOSE = 6.0, 10.0
"""The 2 ln of the odds from which a hypothesis wins, and up to which one that does not is within the intervals."""
SETTLING = 5.0
"""Predictions begin with what the filter knows after this time, s."""
_MOST, _ROUNDS = 3, 6
"""The most hypotheses that may hold at once, and the most times that one is added or takes the place of another."""
_FITTED = 2
"""The most hypotheses that change the thrust that are fitted in a round, for each place at which J compares them."""
_FAR = 100.0
"""Where one has won, others are not fitted whose J is so much above its own."""
_FORCE, _LOUD = 0.03, 1.0
"""The size of the slow forces, relative to full thrust, and how many deviations of the prior the white noise is above
its mean where J compares hypotheses before any fit."""
_FARTHEST = 3.0
"""The most by which parameters adapt to a hypothesis there, in deviations of their priors."""
_LATE, _NARROWEST, _HALF = 0.05, 0.2, 0.5
"""How much earlier or later commands that change between rows act along an axis (standard error), relative to the
window in which they change; the narrowest window, relative to the time between two rows; and the command whose time
constant this changes."""
MOST_OF_ROW = 0.5
"""Commands that change within more than this part of the time between two rows are momentary values: they change at any
time."""
_SCALE = 0.01
"""The standard error of the scale of a sensor in a log of an autopilot, whose estimates it has."""
_IDLE_STEP = 0.1
"""The time between two values of the unknown force that tell when commands do not act, s."""
_IDLE = 0.5
"""Commands may not act where the unknown force makes up for their thrust but for this share of its square."""
_LONGEST_IDLE = 0.5
"""Commands do not act during at most this share of a log, at its beginning or at its end."""

Search = Callable[[Objective, Mapping[int, float]], Minimum]
"""A function that minimises J of thinned logs from a start in which some parameters, by their places, have numbers."""
Key = tuple[str, str, str]
Starts = Mapping[Variant, float | None]
"""Hypotheses that hold together, with the coordinates from which their parameters begin; None if one has none."""


# ---- The alarm -------------------------------------------------------------------------------------------------------


def structure(objective: Objective, best: Minimum, *, ahead: bool = False) -> dict[Axis, float]:
    """Return how much larger the errors along each axis are than the noise of the sensor: near 1 for a right structure.

    The fit has seen these data, so only its structure can be wrong. The errors are those of predictions over 10 s, even
    where noise explains each next sample. Outliers do not count. The noise is at least 1 % of the motion.

    The motion in a log whose commands change between its rows cannot be predicted over 10 s, least of all a heading
    that is unstable without them. The errors of such a log are the innovations of a filter without slow processes,
    relative to its own standard deviations. If `ahead` is True, they are those of predictions over 10 s there, too, as
    long as the log has no short force, which stands for these commands.
    """
    found: dict[Axis, float] = {}
    for n, (one, record) in enumerate(zip(objective.logs, objective.records, strict=True)):
        usual = (np.abs(best.data[n].normalised) < OUTLYING) & (record.time >= record.time[0] + SETTLING)
        places = [usual & (record.sensor == number) for number in range(len(one.measured))]
        least = [
            least_error(m.noise, unchanged(record.time[at], record.value[at], AHEAD)) if at.sum() >= 10 else nan
            for m, at in zip(one.measured, places, strict=True)
        ]
        try:
            if one.is_momentary or (one.lost and not ahead):
                run = objective.run(_without_slow_noise(objective.table, best.z), n)
                errors = run.innovations / np.sqrt(run.variances)
            else:
                run = objective.run(best.z, n, begin=SETTLING, span=AHEAD)
                errors = run.innovations / np.array(least)[record.sensor]
        except DivergedError:
            errors = np.full(len(record.time), inf)
        for m, at in zip(one.measured, places, strict=True):
            if at.sum() >= 10:
                found[m.sensor.axis] = max(found.get(m.sensor.axis, 0.0), rms(errors[at]))
    return found


def _without_slow_noise(table: Table, z: Array) -> Array:
    """Return the parameters with no slow processes. Coloured noise and short forces are at most as large as usual."""
    quiet = z.copy()
    for n, p in enumerate(table.parameters):
        if p.of_kind.hides_structure:
            quiet[n] = min(z[n], p.mean)
        elif p.of_kind.is_size:
            quiet[n] = p.low
    return quiet


def windows(objective: Objective, z: Array) -> dict[str, float]:
    """Return the part of the time between two rows in which a command may change, of each log that loses commands."""
    found = {one.log.file: objective.table.get(z, WIDTH, one.log.file) for one in objective.logs if one.lost}
    return {file: 1.0 if width > MOST_OF_ROW else max(float(width), _NARROWEST) for file, width in found.items()}


def unseen_errors(objective: Objective, z: Array, before: Mapping[str, float]) -> Array:
    """Return the covariance of the parameters by errors that a log does not show if its commands change between rows.

    Along each axis, commands act a small part of their window earlier or later, because a stick and a controller change
    them at other times. The axis then answers earlier or later, as if it had another inertia, and a fast axis the more.
    Such a log also has the estimates of an autopilot, whose scale is not exact. With a scale s, a velocity v reads s v,
    as if the drag were a/s² and b/s, and the inertia m/s.

    `before` has the windows of the fit without hypotheses, because straight lines between rows do not show them.
    """
    now, parameters = windows(objective, z), objective.table.parameters
    widths = [one.interval * (before if one.is_momentary else now)[one.log.file] for one in objective.logs if one.lost]
    found = np.zeros((len(z), len(z)))
    if not widths:
        return found
    vehicle, shapes = objective.table.model(z)
    for axis in vehicle.layout.bare_axes:
        time = float(shapes.motions(vehicle, axis, np.array([_HALF])).response()[1][0])
        own = np.array([p.of_kind.speed_power * (p.of == axis.name) for p in parameters])
        found += _SCALE**2 * np.outer(own, own)
        if 0.0 < time < inf:
            is_inertia = np.array([p.kind == INERTIA and p.of == axis.name for p in parameters])
            found += np.diag(is_inertia * (_LATE * max(widths) / time) ** 2)
    return found


def with_shared(layout: Layout, errors: Mapping[Axis, float]) -> dict[Axis, float]:
    """Return the error of each axis. Where nothing measures one, it is the largest of those that share a thruster.

    Where both are measured, a fault of the thrusters shows in both. What shows in one alone acts on this one alone,
    such as waves or a tether.
    """
    return {
        axis: errors[axis]
        if axis in errors
        else max((error for other, error in errors.items() if layout.shares_thrusters(axis, other)), default=0.0)
        for axis in layout.bare_axes
    }


# ---- Before any fit --------------------------------------------------------------------------------------------------


def timed(model: Model, objective: Objective, best: Array, variant: Variant) -> Variant:
    """Return a hypothesis with the times between which the commands of its files act, if it has times.

    The filter follows an unknown force r with a slow process of the largest size. Before and after, r makes up for the
    thrust T. The sum of r² - (r + T)² - T²/2 from the beginning of a log, and that from its end, are largest where the
    commands begin and cease to act. A position tells r late. So only axes with measured velocities count where there
    are some.
    """
    if not HYPOTHESES[variant.kind].has_times:
        return variant
    table, z, found = objective.table, best.copy(), {}
    for n, p in enumerate(table.parameters):
        if (kind := p.of_kind).is_size:
            z[n] = p.high if kind.slow and kind.slow.acts_as == "force" else p.low
    coefficients = table.coefficients(best)
    for n, one in enumerate(model.logs):
        if one.log.file not in variant.of:
            continue
        scale = np.array([float(table.force_unit(z, form.axis)) for form in one.layout.axes])
        prompt = {m.sensor.axis for m in one.measured if m.sensor.is_velocity} or {*one.layout.bare_axes}
        scale[[form.axis not in prompt for form in one.layout.axes]] = inf
        first, time = objective.filters[n].force, objective.records[n].time
        at = first_in_each(time, 1.0 / _IDLE_STEP)
        force = objective.run(z, n, with_states=True).states[at, first : first + len(one.layout.axes)]
        r, T = force / scale, one.thrust(coefficients, held(one.record.told, one.record.inputs, time[at])) / scale
        gain = _IDLE_STEP * np.sum(r**2 - (r + T) ** 2 - _IDLE * T**2, axis=1)

        def rows(gain: Array) -> int:
            total = np.cumsum(gain)
            most = int(np.argmax(total))
            is_idle = total[most] > _IDLE * LEAST_COMMAND**2 and most < _LONGEST_IDLE * len(gain)
            return most if is_idle else 0

        begins, ends = rows(gain), rows(gain[::-1])
        if begins or ends:
            begin, end = time[at][begins] if begins else -inf, time[at][-1 - ends] if ends else inf
            found[one.log.file] = float(begin), float(end)
    return replace(variant, of=tuple(found), acting=tuple(found.values()))


class Comparison:
    """J of thinned logs with each set of hypotheses, before it is fitted, at one place.

    The vehicle adapts to a set by one linear step of the scales of thrust, drag and inertia.
    """

    def __init__(self, model: Model, held: Starts, place: Mapping[Key, float]) -> None:
        """`model` is without hypotheses. At the place, some are held, and parameters that it lacks have their means."""
        self.model, self.place = model, place
        self.objective = model.applied(*held).objective(thinned=True)
        self.z, self.data = self._start(self.objective, held), list[Data]()
        self.free = np.flatnonzero([p.of_kind.adapts for p in self.objective.table.parameters])
        with suppress(DivergedError):
            self.data = self.objective.data(self.z, self.objective.runs(self.z), exact=False)
        self.values = dict[frozenset[tuple[Variant, float | None]], float]()

    def value(self, starts: Starts) -> float:
        """Return J with some hypotheses; inf where a motion diverges."""
        key = frozenset(starts.items())
        if key not in self.values:
            self.values[key] = inf
            with suppress(DivergedError):
                self.values[key] = self._value(starts)
        return self.values[key]

    def _value(self, starts: Starts) -> float:
        objective = self.model.applied(*starts).objective(thinned=True)
        z = self._start(objective, starts)
        runs = objective.runs(z)
        if not self.data:
            return objective.value(z, runs)
        data = with_samples(self.data, objective.samples(z, runs))
        gradient, information = total(self.objective, self.z, data)
        free, end = self.free, self.z.copy()
        most = _FARTHEST * self.objective.deviation[free]
        end[free] += np.clip(-np.linalg.solve(information[np.ix_(free, free)], gradient[free]), -most, most)
        end = np.clip(end, self.objective.low, self.objective.high)
        change = end - self.z
        costs = [cost(one.innovations + one.slopes @ change[[*one.places]], one.variances) for one in data]
        return self.objective.prior(end) + sum(costs)

    def _start(self, objective: Objective, starts: Starts) -> Array:
        """Return the place with the coordinates from which the parameters of some hypotheses begin."""
        z = coordinates(self.place, objective.table)
        for place, start in numbers_of(objective.table, starts).items():
            z[place] = start
        return z


def rough(table: Table) -> dict[Key, float]:
    """Return a place near the means of the priors, with noise that is large enough for a rough vehicle.

    A fit without the right hypothesis bends the vehicle until wrong ones look right.
    """
    place = {p.key: p.mean + _LOUD * p.deviation for p in table.parameters if p.kind == WHITE}
    forces = (p for p in table.parameters if (slow := p.of_kind.slow) and slow.acts_as == "force")
    return place | {p.key: log(_FORCE) for p in forces}


def place_of(table: Table, z: Array) -> dict[Key, float]:
    """Return the coordinates of all parameters by their keys."""
    return dict(zip((p.key for p in table.parameters), z.tolist(), strict=True))


def coordinates(place: Mapping[Key, float], table: Table) -> Array:
    """Return the coordinates of a place. Parameters that it lacks have their means."""
    return np.array([place.get(p.key, p.mean) for p in table.parameters])


def numbers_of(table: Table, starts: Starts) -> dict[int, float]:
    """Return the places of the parameters of some hypotheses, with the coordinates from which they begin."""
    return {
        place: start
        for one, start in starts.items()
        if start is not None and (place := table.place(*one.parameter)) is not None
    }


# ---- The search ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Adopted:
    """A hypothesis that won."""

    variant: Variant
    odds: float
    """2 ln of its posterior odds against the best model without it."""


@dataclass(frozen=True, eq=False)
class Trial:
    """The fit with some hypotheses."""

    starts: Starts
    """The hypotheses, with the coordinates at which their parameters end."""
    model: Model
    objective: Objective
    minimum: Minimum
    score: float
    """2 ln of the posterior probability, but for a constant."""
    quick: float
    """2 ln of the evidence of thinned logs."""
    absent: frozenset[Variant] = frozenset()
    """The hypotheses for which its parameters are no evidence: they end near where these are absent."""


@dataclass(frozen=True, eq=False)
class Explained:
    """The fit with the hypotheses that won."""

    trial: Trial
    adopted: tuple[Adopted, ...]
    rivals: tuple[Posterior, ...]
    """The fits with hypotheses that did not win, and whose odds are near even."""


def fitted(model: Model, starts: Starts, prior: float, search: Search, enough: float = -inf) -> Trial | None:
    """Return the minimum of J with some hypotheses for all samples, from that for thinned logs.

    `prior` is 2 ln of their prior probability, and `search` fits thinned logs. The result is None if a motion diverges,
    or if the evidence of thinned logs is below `enough`.
    """
    model = model.applied(*starts)
    thinned, objective = model.objective(thinned=True), model.objective()
    with suppress(DivergedError):
        end = search(thinned, numbers_of(thinned.table, starts))
        quick = evidence_at(thinned, end)
        if quick > enough:
            full = minimise(objective, scaled(objective, end.z), last=False)
            return _trial(starts, model, objective, full, prior, quick)
    return None


def refitted(model: Model, starts: Starts, prior: float, near: Trial) -> Trial | None:
    """Return the minimum of J with some hypotheses for all samples, from a fit that they hardly move.

    It ends where the evidence within reach is clearly below that of this fit. The result is None if a motion diverges.
    """
    model, least = model.applied(*starts), near.score - CLOSE - prior
    objective = model.objective()

    def promises(value: float, information: Array) -> bool:
        return evidence(objective, value, information) > least

    with suppress(DivergedError):
        start = coordinates(place_of(near.objective.table, near.minimum.z), objective.table)
        full, quick = minimise(objective, start, last=False, promises=promises), -inf
        if promises(full.value, full.information):
            thinned = model.objective(thinned=True)
            quick = evidence_at(thinned, minimise(thinned, full.z, enough=QUICK, last=False))
        return _trial(starts, model, objective, full, prior, quick)
    return None


def _trial(starts: Starts, model: Model, objective: Objective, full: Minimum, prior: float, quick: float) -> Trial:
    """Return the fit with some hypotheses, whose parameters are where it ends."""
    places = {one: objective.table.place(*one.parameter) for one in starts}
    ends = {one: None if place is None else float(full.z[place]) for one, place in places.items()}
    posterior = Posterior.of(objective.table, full.z, full.information)
    absent = (one for one, place in places.items() if place is not None and posterior.evidence(place) <= WINS)
    return Trial(ends, model, objective, full, evidence_at(objective, full) + prior, quick, frozenset(absent))


def settled(plain: Trial, search: Search) -> tuple[Trial, tuple[Adopted, ...]]:
    """Return the fit without the samples that would mislead the search, and the hypotheses that leave these out.

    Only J of the other samples is compared.
    """
    adopted = list[Adopted]()
    if max(structure(plain.objective, plain.minimum, ahead=True).values(), default=0.0) > ALARM:
        for kind in (kind for kind, hypothesis in HYPOTHESES.items() if hypothesis.is_first):
            variants = [Variant(kind, of) for of in HYPOTHESES[kind].variants(plain.model.known, plain.model.logs)]
            for one in variants:
                prior = 2.0 * log(HYPOTHESES[kind].probability / len(variants))
                trial = fitted(plain.model, {one: None}, prior, search)
                if trial and (odds := trial.score - plain.score - _left_out(plain, trial.objective)) > WINS:
                    adopted.append(Adopted(one, odds))
                    plain = replace(trial, starts={}, score=trial.score - prior)
    return plain, tuple(adopted)


def _left_out(trial: Trial, objective: Objective) -> float:
    """Return the part of J of the samples that another objective leaves out."""
    gone = 0.0
    for old, new, data in zip(trial.objective.records, objective.records, trial.minimum.data, strict=False):
        if len(new.time) < len(old.time):
            places = ~np.isin(old.time + 1j * old.sensor, new.time + 1j * new.sensor)
            gone += cost(data.innovations[places], data.variances[places])
    return gone


class StructureSearch:
    """The search among sets of hypotheses, each of which changes the same model.

    In each round, a hypothesis is added, leaves, or takes the place of one that won before: what explains most as long
    as the others are unknown may be wrong.
    """

    def __init__(self, plain: Trial, search: Search) -> None:
        """`plain` is the fit without hypotheses; `search` fits thinned logs from a start with much noise."""
        self.model, self.search = plain.model, search
        self.now = self.plain = plain
        self.tried: dict[frozenset[Variant], Trial | None] = {frozenset(): plain}
        self.lost = dict[Variant | None, float]()
        """The hypotheses that were added and made a fit worse, with the fall of J that promised something else."""

    def explained(self) -> Explained:
        """Try the hypotheses where the alarm asks for it, and return the fit with those that win."""
        rivals = list[Trial]()
        for _ in range(_ROUNDS):
            fits = self._round()
            best = max(fits, key=self._gain, default=self.now)
            if self._gain(best) <= 0.0:
                rivals = [one for one in fits if one.score > self.now.score - CLOSE]
                break
            self.now = self._without_absent(best)
        now, trials = self.now, [one for one in self.tried.values() if one]
        adopted = (
            Adopted(variant, now.score - max(one.score for one in trials if variant not in one.starts))
            for variant in in_order(now.starts)
        )
        posteriors = (Posterior.of(one.objective.table, one.minimum.z, one.minimum.information) for one in rivals)
        return Explained(now, tuple(adopted), tuple(posteriors))

    def _gain(self, other: Trial) -> float:
        """Return by how much another fit is better than it must be. With fewer hypotheses, it may be a little worse."""
        return other.score - self.now.score - (-WINS if len(other.starts) < len(self.now.starts) else WINS)

    def _without_absent(self, trial: Trial) -> Trial:
        """Return a fit without the hypotheses for which it has no evidence, from there, unless it is clearly worse.

        Such a fit is better than the last one because it ended in another minimum, which needs no hypothesis.
        """
        rest = {one: start for one, start in trial.starts.items() if one not in trial.absent}
        if len(rest) == len(trial.starts):
            return trial
        other, before = refitted(self.model, rest, self._prior(rest), trial), self.tried.get(frozenset(rest))
        if not other or (before and before.score >= other.score):
            return trial
        self.tried[frozenset(rest)] = other
        return other if other.score > trial.score - WINS else trial

    @cached_property
    def variants(self) -> list[Variant]:
        """All hypotheses."""
        known, logs, plain = self.model.known, self.model.logs, self.plain
        kinds = ((kind, one) for kind, one in HYPOTHESES.items() if not one.is_first)
        every = (Variant(kind, of) for kind, one in kinds for of in one.variants(known, logs))
        some = (timed(self.model, plain.objective, plain.minimum.z, one) for one in every)
        return [one for one in some if one.of or not HYPOTHESES[one.kind].has_times]

    @property
    def _smaller(self) -> list[Starts]:
        """The hypotheses that won, and then all of them but one."""
        starts = self.now.starts
        return [starts, *({other: start for other, start in starts.items() if other is not one} for one in starts)]

    @cached_property
    def rough(self) -> Comparison:
        """J near the means of the priors."""
        return Comparison(self.model, {}, rough(self.plain.objective.table))

    def _prior(self, variants: Iterable[Variant]) -> float:
        """Return 2 ln of the prior probability of some hypotheses."""
        kinds = [one.kind for one in self.variants]
        return sum(2.0 * log(HYPOTHESES[one.kind].probability / kinds.count(one.kind)) for one in variants)

    def _round(self) -> list[Trial]:
        """Return fits with other sets of hypotheses, where the alarm asks for them.

        If one set has won by far, sets whose J falls much less before any fit wait for the next round.
        """
        fits, won = list[Trial](), -inf
        for starts, gain in [*self._promising()]:
            if gain < won - _FAR:
                continue
            is_shown, prior = gain > -inf, self._prior(starts)
            if is_shown:
                enough = max(one.quick for one in (self.now, *fits)) - WINS
                trial = fitted(self.model, starts, prior, self.search, enough)
                # Without a trial, the evidence of thinned logs is not enough.
                is_worse = trial.score < self.now.score if trial else enough < self.now.quick
                if is_worse and starts.keys() > self.now.starts.keys():
                    self.lost[self._new(starts)] = gain
            else:
                trial = refitted(self.model, starts, prior, self.now)
            self.tried[frozenset(starts)] = trial
            if trial:
                fits.append(trial)
                if is_shown and trial.score > self.now.score + _FAR:
                    won = max(won, gain)
        return fits

    def _promising(self) -> Iterator[tuple[Starts, float]]:
        """Yield the sets that are worth a fit, with the fall of J that tells so before any fit.

        The best of those that change the thrust come first, and then all others, whose fall is -inf: J hardly tells it.
        """
        now = self.now
        predicted = filtered = max(structure(now.objective, now.minimum, ahead=True).values(), default=0.0)
        if any(one.lost and not one.is_momentary for one in now.model.logs):
            filtered = max(structure(now.objective, now.minimum).values(), default=0.0)
        shown, others = list[Starts](), list[Starts]()
        # A hypothesis that won first may not be needed beside one that won later, and then no alarm tells it.
        (shown if filtered > ALARM else others).extend(self._smaller[1:])
        for one in self.variants if predicted > min(one.alarm for one in HYPOTHESES.values()) else ():
            hypothesis = HYPOTHESES[one.kind]
            if (filtered if hypothesis.changes_thrust else predicted) <= hypothesis.alarm:
                continue
            for some in self._smaller if hypothesis.changes_thrust else [now.starts]:
                if len(some) < _MOST and not any(one.excludes(other) for other in some):
                    sets = [{**some, one: start} for start in hypothesis.starts or (None,)]
                    (shown if hypothesis.changes_thrust else others).extend(sets)
        shown = [some for some in shown if frozenset(some) not in self.tried]
        if shown:
            yield from self._ranked(shown)
        yield from ((some, -inf) for some in others if frozenset(some) not in self.tried)

    def _ranked(self, sets: Sequence[Starts]) -> Iterator[tuple[Starts, float]]:
        """Yield the best sets at either of two places with the fall of J at the better one, the largest fall first.

        Of the starts of one set, the best one counts. A hypothesis that made a fit worse is tried again only where J
        falls by more than it did before that fit.
        """
        now = self.now
        at_fit = Comparison(self.model, now.starts, place_of(now.objective.table, now.minimum.z))
        found = ([_fall(at, now.starts, some) for at in (self.rough, at_fit)] for some in sets)
        falls = {n: some for n, some in enumerate(found) if max(some) > self.lost.get(self._new(sets[n]), -inf)}
        chosen = dict[frozenset[Variant], int]()
        for place in (0, 1):
            best = dict[frozenset[Variant], int]()
            for n in sorted(falls, key=lambda one: falls[one][place], reverse=True):
                if falls[n][place] > 0.0:
                    best.setdefault(frozenset(sets[n]), n)
            for key, n in islice(best.items(), _FITTED):
                chosen.setdefault(key, n)
        order = sorted(((max(falls[n]), n) for n in chosen.values()), reverse=True)
        yield from ((sets[n], fall) for fall, n in order)

    def _new(self, starts: Starts) -> Variant | None:
        """Return the hypothesis of a set that is not among those that won; None if there is none."""
        return next(iter(starts.keys() - self.now.starts.keys()), None)


def _fall(at: Comparison, before: Starts, after: Starts) -> float:
    """Return by how much J falls from some hypotheses to others; -inf where a motion diverges."""
    value = at.value(after)
    return at.value(before) - value if value < inf else -inf
