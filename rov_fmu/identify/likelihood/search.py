"""The search for the structure: an alarm, and a search among the hypotheses, which are compared by J.

Noise hides a wrong structure: a slow force, a slow gain and coloured noise explain each next sample, and the
innovations look right. Predictions over 10 s do not: relative to the noise of the sensor, their errors are near 1 where
the structure is right. Above ALARM, each hypothesis changes the model, J is minimised anew, and 2 ln of the Bayes
factor (Laplace approximation), with the prior probability, decides. What wins is part of the model.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass
from functools import cache, cached_property, reduce
from math import hypot, inf, log, nan, sqrt
from operator import itemgetter

import numpy as np
from scipy.special import chdtri

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.filter import DivergedError, Record
from rov_fmu.identify.likelihood.hypotheses import (
    HYPOTHESES,
    Of,
    Start,
    Starts,
    Suspect,
    apart,
    applied,
    dive_commands,
    row_of,
    thrusters_alike,
)
from rov_fmu.identify.likelihood.kinds import (
    INERTIA,
    NEUTRAL,
    OWN_CURVE,
    POWER,
    POWER_ASTERN,
    SHORTEST_LAG,
    WHITE,
    WIDTH,
)
from rov_fmu.identify.likelihood.objective import OUTLYING, Objective, cost, with_samples
from rov_fmu.identify.likelihood.parameters import Table
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior
from rov_fmu.identify.likelihood.records import AHEAD, LEAST_COMMAND, unchanged
from rov_fmu.identify.likelihood.solve import (
    QUICK,
    REST,
    Minimum,
    evidence,
    louder,
    minimise,
    scaled,
    start_of,
    total_information,
)
from rov_fmu.identify.result import ALARM, CONSTANTS, KEPT, USUAL, WRONG, least_error, moves
from rov_fmu.tank.arrays import Array, Flags, rms
from rov_fmu.tank.clocks import first_in_each, held

WINS = KEPT
"""The 2 ln of the odds from which a hypothesis wins."""
SETTLING = 5.0
"""Predictions begin with what the filter knows after this time, s."""
_MOST, _ROUNDS = 3, 6
"""The most hypotheses that may hold at once, and the most times that one is added or takes the place of another."""
_FITTED = 5
"""The most hypotheses that change the thrust that are fitted in a round."""
_FAR = CONSTANTS["far"].value
"""Where one has won, others are not fitted whose J is so much above its own."""
_FORCE, _LOUD = 0.03, 1.0
"""The size of the slow forces, relative to full thrust, and how many deviations of the prior the white noise is above
its mean where J compares hypotheses before any fit."""
_FARTHEST = 3.0
"""The most by which parameters adapt to a hypothesis there, in deviations of their priors."""
_SOON = 2.0
"""The time of predictions that tell what a fast axis does, and after a step of the commands, s."""
_LEAST_STEP, _APART, _FEWEST_STEPS = 0.08, 0.6, 4
"""The least step of a command along an axis, the time between two, s, and the fewest steps that tell their spread."""
_FEWEST, _FEWEST_IN_STEP = 10, 6
"""The fewest samples of a sensor that tell its errors, and those after a step."""
_LOG_STEP, _LEAST_WEIGHT = 0.01, 0.5**-2
"""The step of a derivative by ln of the inertia, and the least weight of what a step tells about it."""
_BESIDE = 1e-3
"""How near the number of a hypothesis may be to its bounds, relative to the range between them."""
_HALF = 0.5
"""The command whose time constant changes where commands act earlier or later."""
MOST_OF_ROW = CONSTANTS["most of row"].value
"""Commands that change within more than this part of the time between two rows are momentary values: they change at any
time."""
_FORMS = (POWER, POWER_ASTERN)
LEAST_LACK = 0.01
"""What the structure lacks is at least this standard error of the logarithms of speeds and inertias."""
_IDLE_STEP = 0.1
"""The time between two values of the unknown force that tell when commands do not act, s."""
_IDLE = 0.5
"""Commands may not act where the unknown force makes up for their thrust but for this share of its square."""
_LONGEST_IDLE = 0.5
"""Commands do not act during at most this share of a log, at its beginning or at its end."""


# ---- The alarm -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Misfit:
    """The errors of predictions along an axis, the largest ones of its sensors."""

    ratio: float = 0.0
    """R: over 10 s, relative to the noise of the sensor. It is near 1 for a right structure, and 0 where nothing tells
    it."""
    lack: float = 0.0
    """Over 10 s, beyond the noise, relative to the motion: the root of (e² - σ²) / motion²; 0 where nothing moves. The
    motion is that of the log in which the axis moves most: one in which it hardly moves tells little of a scale."""
    soon: float = 0.0
    """R₂: over 2 s, relative to the noise; 0 where nothing tells it."""
    spread: float = 0.0
    """The standard deviation of ln of the inertia from step to step of the commands, beyond the noise."""

    def or_larger(self, other: "Misfit") -> "Misfit":
        """Return the larger one of each number."""
        return Misfit(*map(max, astuple(self), astuple(other)))

    @property
    def widens(self) -> tuple[float, float]:
        """The errors by which intervals become wider: of all that concerns an axis, and of its times."""
        soon = min(self.soon, WRONG) if self.soon > CONSTANTS["soon"].value else 0.0
        return self.ratio, max(self.ratio, soon)


def structure(objective: Objective, best: Minimum, *, ahead: bool = False, late: bool = False) -> dict[Axis, Misfit]:
    """Return how much larger the errors along each axis are than the noise of the sensor.

    The fit has seen these data, so only its structure can be wrong. The errors are those of predictions over 10 s, even
    where noise explains each next sample. Outliers do not count. The noise is at least 1 % of the motion.

    The motion in a log whose commands change between its rows cannot be predicted over 10 s, least of all a heading
    that is unstable without them. The errors of such a log are the innovations of a filter without slow processes,
    relative to its own standard deviations, and say nothing about the motion. If `ahead` is True, they are those of
    predictions over 10 s there, too, as long as the log has no short force, which stands for these commands.

    If `late` is True, errors that the filter expects do not count, because a command changed at an unknown time between
    two rows. The alarm counts them: what the structure lacks may look like lateness, and would silence it.
    """
    found: dict[Axis, Misfit] = {}
    errors_of = dict[tuple[Axis, bool], list[tuple[float, float]]]()
    for n, (sampled, record) in enumerate(zip(objective.logs, objective.records, strict=True)):
        begin, counts = usual(best, n, record)
        masks = [counts & (record.sensor == number) for number in range(len(sampled.measured))]
        motion = [unchanged(record.time[at], record.value[at], AHEAD) if at.sum() >= _FEWEST else nan for at in masks]
        noise_of = (hypot(m.noise, objective.table.wander(best.z, sampled, m.sensor)) for m in sampled.measured)
        least = [least_error(noise, change) for noise, change in zip(noise_of, motion, strict=True)]
        is_motion = not (sampled.is_momentary or (sampled.lost and not ahead))
        try:
            if is_motion:
                run = objective.run(best.z, n, begin=begin, span=AHEAD)
                expected = _expected(objective, best.z, n, begin, AHEAD) if late else 0.0
                errors = run.innovations / np.maximum(np.array(least)[record.sensor], expected)
            else:
                run = objective.run(_without_slow_noise(objective.table, best.z), n)
                errors = run.innovations / np.sqrt(run.variances)
        except DivergedError:
            errors = np.full(len(record.time), inf)
        for m, at, noise, change in zip(sampled.measured, masks, least, motion, strict=True):
            if at.sum() >= _FEWEST:
                R = rms(errors[at])
                found[m.axis] = Misfit(R).or_larger(found.get(m.axis, Misfit()))
                if is_motion and moves(noise, change):
                    both = noise * sqrt(max(R**2 - 1.0, 0.0)), change
                    errors_of.setdefault((m.axis, m.sensor.is_velocity), []).append(both)
    for (axis, _), some in errors_of.items():
        most, motion = np.max(some, axis=0).tolist()
        found[axis] = found[axis].or_larger(Misfit(0.0, most / motion))
    return found


def with_steps(objective: Objective, best: Minimum, misfits: Mapping[Axis, Misfit]) -> dict[Axis, Misfit]:
    """Return the misfits with what predictions over 2 s tell, and the steps of the commands within them.

    Over 10 s, the noise of the sensor is at least 1 % of the motion, which hides what a fast axis does. Over 2 s, it is
    at least 0.2 % of the motion within them, so that a sensor almost without noise asks of no model what nobody needs.
    Logs whose commands change between the rows tell nothing about it.

    What makes each step of the commands another one, such as a wake, an inertia that grows, or lags that differ, is
    seen by regressing the errors after a step on their derivative by ln of the inertia. If the results differ by more
    than noise, their standard deviation beyond it (DerSimonian and Laird 1986, doi:10.1016/0197-2456(86)90046-2) is an
    error of the inertia in any other step, which does not become smaller with the number of steps.
    """
    table, found = objective.table, {**misfits}
    inertias = {axis: n for axis in table.layout.bare_axes if (n := table.index(INERTIA, axis.name)) is not None}
    axes, indices = [*inertias], [*inertias.values()]
    results: dict[tuple[Axis, float], list[tuple[float, float]]] = {}
    for n, (sampled, record) in enumerate(zip(objective.logs, objective.records, strict=True)):
        if sampled.is_momentary or sampled.lost:
            continue
        begin, counts = usual(best, n, record)
        for span in (_SOON, AHEAD):
            try:
                run = objective.run(best.z, n, begin=begin, span=span)
                steps = np.full(len(indices), _LOG_STEP)
                slopes = objective.changes(best.z, n, indices, steps, run, begin, span)
            except DivergedError:
                continue
            part = np.floor((record.time - record.time[0] - begin) / span)
            for number, m in enumerate(sampled.measured):
                own, axis = record.sensor == number, m.axis
                noise = hypot(m.noise, table.wander(best.z, sampled, m.sensor))
                at = counts & own
                if span == _SOON and at.sum() >= _FEWEST:
                    least = CONSTANTS["least soon"].value * unchanged(record.time[at], record.value[at], _SOON)
                    expected = _expected(objective, best.z, n, begin, _SOON)[at]
                    soon = Misfit(soon=rms(run.innovations[at] / np.maximum(expected, max(noise, least))))
                    found[axis] = soon.or_larger(found.get(axis, Misfit()))
                if axis in inertias:
                    pairs = np.column_stack([run.innovations, slopes[:, axes.index(axis)]]) / noise
                    drifts = 1 if m.sensor.is_velocity else 2
                    after = _after_steps(table.push(best.z, sampled, axis), sampled.record.told, record.time)
                    chosen = (own & (part >= 0.0) & one for one in after)
                    every = (_of_step(pairs[at], record.time[at], part[at], drifts) for at in chosen)
                    results.setdefault((axis, span), []).extend(one for one in every if one[1] > _LEAST_WEIGHT)
    for (axis, _), steps_of in results.items():
        values, weights = np.reshape(steps_of, (-1, 2)).T
        spread = Misfit(spread=min(_spread(values, weights), 1.0))
        found[axis] = spread.or_larger(found.get(axis, Misfit()))
    return found


def _expected(objective: Objective, z: Array, n: int, begin: float, span: float) -> Array:
    """Return the standard deviations that the filter expects of the errors of predictions of a log by a right
    structure: of sensors, of where a prediction begins, and of commands whose time of change no row tells."""
    return np.sqrt(objective.run(_without_slow_noise(objective.table, z), n, begin=begin, span=span).variances)


def _after_steps(push: Array, told: Array, time: Array) -> Iterator[Flags]:
    """Yield, for each step of a command along an axis, which samples follow it within 2 s and before the next one."""
    at = list[float]()
    for after in told[1:][np.abs(np.diff(push)) > _LEAST_STEP].tolist():
        if not at or after - at[-1] > _APART:
            at.append(after)
    for after, end in zip(at, [*at[1:], inf], strict=False):
        yield (time >= after) & (time < min(after + _SOON, end))


def _of_step(pairs: Array, time: Array, part: Array, drifts: int) -> tuple[float, float]:
    """Return the change of a parameter that explains the errors after a step, and its weight; 0 where it tells nothing.

    `pairs` has n errors and their derivatives, relative to the noise. A prediction does not know the velocity from
    which it begins, nor where it is about a position. So a constant in each part of the samples is left out, and the
    time where `drifts` is 2.
    """
    X = np.array([(part == one) * (time - time[0]) ** power for one in np.unique(part) for power in range(drifts)]).T
    if len(time) < max(X.shape[-1] + 3, _FEWEST_IN_STEP):
        return 0.0, 0.0
    error, slope = (pairs - X @ np.linalg.lstsq(X, pairs, rcond=None)[0]).T
    weight = float(slope @ slope)
    return float(slope @ error) / max(weight, 1e-300), weight


def _spread(values: Array, weights: Array) -> float:
    """Return the standard deviation of values beyond their errors; 0 if noise alone may well make them differ so."""
    free, total_weight = len(values) - 1, weights.sum()
    if free < _FEWEST_STEPS - 1:
        return 0.0
    chi2 = float(weights @ (values - weights @ values / total_weight) ** 2)
    least = chdtri(free, CONSTANTS["steps"].value)
    return sqrt((chi2 - free) / (total_weight - weights @ weights / total_weight)) if chi2 > least else 0.0


def usual(best: Minimum, n: int, record: Record) -> tuple[float, Flags]:
    """Return when the predictions of a log begin, s after its first sample, and which of its samples count."""
    begin = SETTLING + _late(record)
    return begin, (np.abs(best.data[n].normalised) < OUTLYING) & record.after(begin)


def _late(record: Record) -> float:
    """Return how long after the first sample of a log all sensors have begun, s; 0 if this is most of the log.

    A prediction that begins without velocities is worse than the model.
    """
    first = [record.time[record.sensor == n][:1] for n in range(len(record.sensors))]
    late = float(np.concatenate(first).max() - record.time[0])
    return late if late < 0.5 * (record.time[-1] - record.time[0]) else 0.0


def worst(found: Mapping[Axis, Misfit]) -> float:
    """Return the largest error R of all axes; 0 where nothing tells it."""
    return max((one.ratio for one in found.values()), default=0.0)


def _without_slow_noise(table: Table, z: Array) -> Array:
    """Return the parameters without what disturbs the motion slowly. Coloured noise and short forces are at most as
    large as usual."""
    quiet = z.copy()
    for n, p in enumerate(table.parameters):
        if p.of_kind.hides_structure:
            quiet[n] = min(z[n], p.mean)
        elif p.of_kind.is_size and not p.of_kind.is_of_sensor:
            quiet[n] = p.low
    return quiet


def windows(objective: Objective, z: Array) -> dict[str, float]:
    """Return the part of the time between rows in which a command may change, of each log that does not tell when."""
    found = {one.file: objective.table.get(z, WIDTH, one.file) for one in objective.logs if one.lost}
    return {
        file: 1.0 if width > MOST_OF_ROW else max(float(width), CONSTANTS["narrowest"].value)
        for file, width in found.items()
    }


def unseen_errors(objective: Objective, z: Array, before: Mapping[str, float], misfits: Mapping[Axis, Misfit]) -> Array:
    """Return the covariance of the parameters by errors that do not become smaller with the number of samples.

    What the structure of an axis lacks acts on speeds and distances as a scale s, with which the drag is a/s² and b/s,
    and the inertia m/s. It acts on times as a scale of the inertia alone. It is as large in unseen data, so it has the
    size of the errors over 10 s. The inertia also has the spread of the steps. Drag with another power than 2 is only
    near what an unusual hull has, such as one whose drag falls at a speed, so that it lacks something, too.

    Where commands change between the rows of a log, or rows are means, they act a small part of their window earlier or
    later along each axis, because a stick and a controller change them at other times. The axis then answers earlier or
    later, as if it had another inertia, and a fast axis the more.

    A lag of the thrusters and one that all sensors share change the motion alike, and only what acts between them tells
    one from the other. Where all logs have such commands, this is a force that makes up for what their rows lack. So
    the lag has a standard error of the shortest one that rows show, and its interval contains what all sensors share.

    `before` has the windows of the fit without hypotheses, because straight lines between rows do not show them.
    """
    now, parameters = windows(objective, z), objective.table.parameters
    widths = [one.interval * (before if one.is_momentary else now)[one.file] for one in objective.logs if one.lost]
    found = np.zeros((len(z), len(z)))
    vehicle, shapes = objective.table.model(z)
    for axis, misfit in misfits.items():
        powers = [abs(float(z[n])) for n, p in enumerate(parameters) if p.of == axis.name and p.kind in _FORMS]
        form = CONSTANTS["form"].value * max(powers, default=0.0)
        lack = hypot(LEAST_LACK, form, min(CONSTANTS["lack"].value * misfit.lack, 1.0))
        scale = np.array([p.of_kind.speed_power * (p.of == axis.name) for p in parameters])
        is_inertia = np.array([p.of == axis.name and p.kind == INERTIA for p in parameters])
        found += lack**2 * np.outer(scale, scale) + np.diag((lack**2 + misfit.spread**2) * is_inertia)
        time = float(shapes.motions(vehicle, axis, np.array([_HALF])).response()[1][0])
        if widths and 0.0 < time < inf:
            found += np.diag(is_inertia * (CONSTANTS["late"].value * max(widths) / time) ** 2)
    shortest = min((one.interval if one.lost else 0.0 for one in objective.logs), default=0.0) * SHORTEST_LAG
    lags = np.array([p.of_kind.is_lag * (-1.0 if p.part else 1.0) for p in parameters])  # those of sensors have a part
    if shortest and lags.max() > 0.0:
        shared = min(z[lags < 0.0], default=0.0)
        found += (shortest**2 + (shared / QUANTILE) ** 2) * np.outer(lags, lags)
    return found


def with_shared(layout: Layout, errors: Mapping[Axis, Misfit]) -> dict[Axis, Misfit]:
    """Return the misfit of each axis. Where nothing measures one, it is the largest of those that share a thruster.

    Where both are measured, a fault of the thrusters shows in both. What shows in one alone acts on this one alone,
    such as waves or a tether.
    """

    def shared(axis: Axis) -> Misfit:
        along = (error for other, error in errors.items() if layout.shares_thrusters(axis, other))
        return reduce(Misfit.or_larger, along, Misfit())

    return {axis: errors[axis] if axis in errors else shared(axis) for axis in layout.bare_axes}


# ---- Before any fit --------------------------------------------------------------------------------------------------


def times_of(objective: Objective, best: Array, files: Of) -> dict[str, tuple[float, float]]:
    """Return the times between which the commands of those files act in which they do not always act, s.

    The filter follows an unknown force r with a slow process of the largest size. Before and after, r makes up for the
    thrust T. The sum of r² - (r + T)² - T²/2 from the beginning of a log, and that from its end, are largest where the
    commands begin and cease to act. A position tells r late. So only axes with measured velocities count where there
    are some.
    """
    table, z, found = objective.table, best.copy(), {}
    for n, p in enumerate(table.parameters):
        if (kind := p.of_kind).is_size and not p.is_fixed:
            z[n] = p.high if kind.slow and kind.slow.acts_as == "force" else p.low
    coefficients = table.coefficients(best)
    for n, sampled in enumerate(objective.logs):
        if sampled.file not in files:
            continue
        scale = np.array([float(table.force_unit(z, form.axis)) for form in sampled.layout.axes])
        prompt = {m.axis for m in sampled.measured if m.sensor.is_velocity} or {*sampled.layout.bare_axes}
        scale[[form.axis not in prompt for form in sampled.layout.axes]] = inf
        first, time = objective.filters[n].force, objective.records[n].time
        at = first_in_each(time, 1.0 / _IDLE_STEP)
        force = objective.run(z, n, with_states=True).states[at, first : first + len(sampled.layout.axes)]
        inputs = held(sampled.record.told, sampled.record.inputs, time[at])
        r, T = force / scale, sampled.thrust(coefficients, inputs) / scale
        gain = _IDLE_STEP * np.sum(r**2 - (r + T) ** 2 - _IDLE * T**2, axis=1)

        def rows(gain: Array) -> int:
            total = np.cumsum(gain)
            most = int(np.argmax(total))
            is_idle = total[most] > _IDLE * LEAST_COMMAND**2 and most < _LONGEST_IDLE * len(gain)
            return most if is_idle else 0

        begins, ends = rows(gain), rows(gain[::-1])
        if begins or ends:
            begin, end = time[at][begins] if begins else -inf, time[at][-1 - ends] if ends else inf
            found[sampled.file] = float(begin), float(end)
    return found


def rough(table: Table) -> Array:
    """Return a point near the means of the priors, with noise that is large enough for a rough vehicle.

    A fit without the right hypothesis bends the vehicle until wrong ones look right.
    """
    z = table.each("mean")
    for n, p in enumerate(table.parameters):
        if p.kind == WHITE:
            z[n] += _LOUD * p.deviation
        elif (slow := p.of_kind.slow) and slow.acts_as == "force":
            z[n] = log(_FORCE)
    return z


def begun(objective: Objective, z: Array, starts: Starts) -> Array:
    """Return a point where the rows of some hypotheses begin, and those of all others are where they are fixed."""
    found = z.copy()
    for suspect, start in starts.items():
        if (n := row_of(objective, suspect)) is not None:
            found[n] = start
    return np.clip(found, objective.low, objective.high)


def comparison(plain: Objective, held: Starts, point: Array) -> Callable[[Starts], float]:
    """Return the function that gives J of thinned logs with a set of hypotheses, before it is fitted, near a point.

    The vehicle adapts to a set by one linear step of the scales of thrust, drag and inertia. The derivatives are those
    with the hypotheses that are held. J is infinite where a motion diverges.
    """
    objective = applied(plain, held, thinned=True)
    z, free = begun(objective, point, held), np.flatnonzero(objective.table.each("of_kind.adapts"))
    most = _FARTHEST * objective.deviation[free]
    try:
        slopes = objective.data(z, objective.runs(z), exact=False)
    except DivergedError:
        slopes = []

    @cache
    def value(some: frozenset[tuple[Suspect, Start]]) -> float:
        changed = applied(plain, dict(some), thinned=True)
        start = begun(changed, z, dict(some))
        try:
            runs = changed.runs(start)
            if not slopes:
                return changed.value(start, runs)
            data = with_samples(slopes, changed.samples(start, runs))
            gradient, information = total_information(objective, z, data)
        except DivergedError:
            return inf
        end = z.copy()
        end[free] += np.clip(-np.linalg.solve(information[np.ix_(free, free)], gradient[free]), -most, most)
        change = (end := np.clip(end, objective.low, objective.high)) - z
        costs = [cost(one.innovations + one.slopes @ change[[*one.indices]], one.variances) for one in data]
        return objective.prior(end) + sum(costs)

    return lambda starts: value(frozenset(starts.items()))


# ---- The search ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class StructureFit:
    """The fit with some hypotheses."""

    starts: Starts
    """The hypotheses, with the coordinates at which their rows end."""
    objective: Objective
    minimum: Minimum
    score: float
    """2 ln of the posterior probability, but for a constant."""
    quick: float
    """2 ln of the evidence of thinned logs."""

    @cached_property
    def misfits(self) -> dict[Axis, Misfit]:
        """The errors of predictions over 10 s along each axis."""
        return structure(self.objective, self.minimum)

    @cached_property
    def predicted(self) -> float:
        """The largest error of predictions over 10 s of all axes, also where commands change between rows."""
        return worst(structure(self.objective, self.minimum, ahead=True))

    @cached_property
    def is_hopeless(self) -> bool:
        """True if the model is wrong along all axes, so that no answer is worth much."""
        return bool(self.misfits) and all(one.ratio > WRONG for one in self.misfits.values())

    @cached_property
    def posterior(self) -> Posterior:
        """With all effects."""
        return Posterior.of(self.objective.table, self.minimum.z, self.minimum.information)

    @property
    def needed(self) -> Starts:
        """The hypotheses but those for whose rows there is no evidence: they end near where these are absent."""
        rows = {suspect: row_of(self.objective, suspect) for suspect in self.starts}
        return {one: self.starts[one] for one, n in rows.items() if n is None or self.posterior.evidence(n) > WINS}


def fitted(
    near: StructureFit, plain: Objective, starts: Starts, prior: float, enough: float = -inf
) -> StructureFit | None:
    """Return the minimum of J with some hypotheses for all samples, from that for thinned logs.

    `plain` is J without hypotheses, and `prior` 2 ln of the prior probability of these. If its logs are thinned, so are
    those of the result. Each parameter begins where the fit `near` ended, or at its prior mean if the hypotheses change
    that. Where they change the thrust, the noise begins as in a first fit: that of a wrong model explains what the
    right one would. If a motion diverges from there, all begin as in a first fit. The result is None if a motion
    diverges, or if the evidence of thinned logs is below `enough`: a fit that will not come there is given up.
    """
    thinned = applied(plain, starts, thinned=True)
    ended = {(p.key, p.mean): z for p, z in zip(near.objective.table.parameters, near.minimum.z, strict=True)}
    there = np.array([ended.get((p.key, p.mean), p.mean) for p in thinned.table.parameters])
    if any(HYPOTHESES[kind].changes_thrust for kind, _ in starts.keys() ^ near.starts.keys()):
        there = louder(thinned, there)

    def promises(end: Minimum, gain: float) -> bool:
        return evidence(thinned, end) + REST * gain > enough

    with suppress(DivergedError):
        first, other = (begun(thinned, z, starts) for z in (there, start_of(thinned)))
        end = minimise(thinned, first, elsewhere=[other], enough=QUICK, last=False, promises=promises)
        quick = evidence(thinned, end)
        if quick > enough:
            objective = thinned
            if not plain.is_thinned:
                objective = applied(plain, starts)
                end = minimise(objective, scaled(objective, end.z), last=False)
            rows = {suspect: row_of(objective, suspect) for suspect in starts}
            ends = {one: starts[one] if n is None else float(end.z[n]) for one, n in rows.items()}
            return StructureFit(ends, objective, end, evidence(objective, end) + prior, quick)
    return None


class StructureSearch:
    """The search among sets of hypotheses, each of which changes the same model.

    In each round, a hypothesis is added, leaves, or takes the place of one that won before: what explains most as long
    as the others are unknown may be wrong.
    """

    def __init__(
        self,
        plain: StructureFit,
        on_fit: Callable[[], None] = lambda: None,
        most: float = inf,
    ) -> None:
        """`plain` is the fit without hypotheses; `on_fit` is called before each other fit. A search for what is wrong
        with a model along all axes ends after `most` fits. One on thinned logs ends as soon as something explains an
        axis: another one goes on from there with all samples."""
        self.plain, self.on_fit, self.most = plain, on_fit, most
        self.now = plain
        """The fit with the hypotheses that won."""
        self.tried: dict[frozenset[Suspect], StructureFit | None] = {frozenset(): plain}
        self.refuted = dict[Suspect, Start]()
        """The hypotheses that were more probable than others, but do not explain the errors over 10 s."""

    def begin_with(self, other: "StructureSearch") -> None:
        """Begin with what a search on thinned logs found. The sets that it gave up are not fitted again."""
        starts = other.now.starts
        self.tried |= {key: None for key, fit in other.tried.items() if not fit}
        if starts and (fit := fitted(other.now, self.plain.objective, starts, self._prior(starts))):
            self.tried[frozenset(starts)] = self.now = fit

    def run(self) -> None:
        """Try the hypotheses where the alarm asks for it.

        Evidence is relative to the hypotheses that are known: one of them always wins where the model lacks something
        else. One that explains nothing leaves, and what it kept from being tried is tried without it.
        """
        rounds = iter(range(_ROUNDS))
        while True:
            self._search(rounds)
            doubtful = {one: z for one, z in self.now.starts.items() if not self._explains(one)}
            if not doubtful:
                break
            self.refuted |= doubtful
            self.now = max(self._valid, key=lambda one: one.score - WINS * len(one.starts))

    def _search(self, rounds: Iterable[int]) -> None:
        """Add, drop and replace hypotheses as long as the fit becomes better, for some rounds."""
        for number in rounds:
            is_explained = self.plain.objective.is_thinned and not self.now.is_hopeless
            if is_explained or (number > 0 and self.has_ended):
                break
            fits = self._round()
            best = max(fits, key=self._gain, default=self.now)
            if self._gain(best) <= 0.0:
                break
            self.now = self._with_needed(best)

    @property
    def has_ended(self) -> bool:
        """True if a model that nobody could use has taken enough fits. They are counted and not timed, because the
        result must not depend on the machine."""
        return len(self.tried) > self.most and self.now.is_hopeless

    @property
    def odds(self) -> dict[Suspect, float]:
        """2 ln of the posterior odds of each hypothesis that won, against the best model without it."""
        return {
            one: self.now.score - max(fit.score for fit in self._valid if one not in fit.starts)
            for one in self.now.starts
        }

    @property
    def _valid(self) -> list[StructureFit]:
        """The fits without hypotheses that were refuted."""
        return [one for one in self.tried.values() if one and not one.starts.keys() & self.refuted]

    @cached_property
    def apart(self) -> dict[str, bool]:
        """Whether the data tell each thruster from all others."""
        return apart(self.plain.objective, self.plain.minimum.z)

    @property
    def alike(self) -> tuple[Of, ...]:
        """The groups of commanded thrusters along one axis that the data do not tell apart."""
        layout, logs = self.plain.objective.table.layout, self.plain.objective.logs
        unknown = {name for name, is_apart in self.apart.items() if not is_apart}
        same = thrusters_alike(layout, [*map(dive_commands, logs)])
        names = {name for group in same if unknown.intersection(group) for name in group}
        along = [layout.thrusters_along(axis) for axis in layout.bare_axes]
        groups = (tuple(t.name for t in some if t.name in names) for some in along)
        return tuple(dict.fromkeys(group for group in groups if len(group) > 1))

    def _best_of(self, some: Collection[Suspect]) -> StructureFit:
        """Return the most probable fit with only some of these hypotheses."""
        fits = (one for one in self.tried.values() if one and one.starts.keys() <= {*some})
        return max(fits, key=lambda one: one.score)

    def _explains(self, suspect: Suspect) -> bool:
        """Return False for a hypothesis whose number is at its bound, and for one about the thrust without which the
        errors of the fit are hardly larger.

        The loss by errors is the sum of ln R of the axes that it acts on, as in the score of predictions: it is 0 where
        noise alone is left (R = 1). A hypothesis that explains the errors takes away at least half of it. A lag hardly
        shows in the errors over 10 s, and J sees it, if the model is right about an axis.
        """
        (kind, of), layout = suspect, self.now.objective.table.layout
        if self._is_at_bound(suspect):
            return False
        before, after = self._best_of(self.now.starts.keys() - {suspect}).misfits, self.now.misfits
        if not HYPOTHESES[kind].changes_thrust or HYPOTHESES[kind].has_times:
            return bool(of) or not after or any(one.ratio <= ALARM for one in after.values())
        ill = [t for t in layout.thrusters if t.name in of or not of]
        on = {axis for axis in before if any(t in layout.thrusters_along(axis) for t in ill)}
        others = all(after[axis].ratio <= max(ALARM, before[axis].ratio) for axis in before.keys() - on)
        if not on:  # nothing tells these errors
            return others
        if max(before[axis].ratio for axis in on) <= min(USUAL, HYPOTHESES[kind].alarm):
            return False
        old, new = (sum(log(max(fit[axis].ratio, 1.0)) for axis in on) for fit in (before, after))
        explains = new <= 0.5 * old
        return others and explains and all(after[axis].ratio <= ALARM for axis in on)

    def _is_at_bound(self, suspect: Suspect) -> bool:
        """Return True if the number of a hypothesis would be farther, but for a bound of the search."""
        if (n := row_of(self.now.objective, suspect)) is None:
            return False
        end, p = self.now.starts[suspect], self.now.objective.table.parameters[n]
        bounds = {p.low, p.high}.difference(HYPOTHESES[suspect[0]].ends)
        return isinstance(end, float) and any(abs(end - bound) < _BESIDE * (p.high - p.low) for bound in bounds)

    def _gain(self, other: StructureFit) -> float:
        """Return by how much another fit is better than it must be. With fewer hypotheses, it may be a little worse."""
        return other.score - self.now.score - (-WINS if len(other.starts) < len(self.now.starts) else WINS)

    def _with_needed(self, fit: StructureFit) -> StructureFit:
        """Return a fit without the hypotheses for which it has no evidence, from there, unless it is clearly worse.

        Such a fit is better than the last one because it ended in another minimum, which needs no hypothesis.
        """
        rest = fit.needed
        if len(rest) == len(fit.starts):
            return fit
        key = frozenset(rest)
        other, before = fitted(fit, self.plain.objective, rest, self._prior(rest)), self.tried.get(key)
        if not other or (before and before.score >= other.score):
            return fit
        self.tried[key] = other
        return other if other.score > fit.score - WINS else fit

    @cached_property
    def suspects(self) -> dict[Suspect, Sequence[Start]]:
        """All hypotheses, with where each may begin."""
        objective, found = self.plain.objective, dict[Suspect, Sequence[Start]]()
        for kind, one in HYPOTHESES.items():
            for of in one.suspects(objective.table.known, objective.logs):
                if one.has_times:
                    if times := times_of(objective, self.plain.minimum.z, of):
                        found[kind, tuple(times)] = (tuple(times.values()),)
                elif not one.is_contrast or all(map(self.apart.get, of)):
                    found[kind, of] = one.starts or (None,)
        return found

    @property
    def _smaller(self) -> list[Starts]:
        """The hypotheses that won, and then all of them but one."""
        starts = self.now.starts
        return [starts, *({other: start for other, start in starts.items() if other is not one} for one in starts)]

    @cached_property
    def _rough(self) -> Callable[[Starts], float]:
        """J near the means of the priors."""
        return comparison(self.plain.objective, {}, rough(self.plain.objective.table))

    def _prior(self, some: Iterable[Suspect]) -> float:
        """Return 2 ln of the prior probability of some hypotheses."""
        kinds = [kind for kind, _ in self.suspects]
        return sum(2.0 * log(HYPOTHESES[kind].probability / kinds.count(kind)) for kind, _ in some)

    def _round(self) -> list[StructureFit]:
        """Return fits with other sets of hypotheses, where the alarm asks for them."""
        fits = list[StructureFit]()
        for starts in self._promising():
            # What explains a model that is wrong along all axes is far better, also on few samples.
            enough = max(one.quick for one in (self.now, *fits)) + (_FAR if self.now.is_hopeless else -WINS)
            self.on_fit()
            fit = fitted(self.now, self.plain.objective, starts, self._prior(starts), enough)
            self.tried[frozenset(starts)] = fit
            fits += [fit] if fit else []
        return fits

    def _promising(self) -> Iterator[Starts]:
        """Yield the sets that are worth a fit: of those that change the thrust, those for which J falls most before any
        fit, at the last one or near the means of the priors; and all others."""
        now = self.now
        predicted, filtered = now.predicted, worst(now.misfits)
        shown, others = list[Starts](), list[Starts]()
        # A hypothesis that won first may not be needed beside one that won later, and then no alarm tells it.
        (shown if filtered > ALARM else others).extend(self._smaller[1:])
        for (kind, of), starts in self.suspects.items():
            hypothesis = HYPOTHESES[kind]
            is_alarm = (filtered if hypothesis.changes_thrust else predicted) > hypothesis.alarm
            for some in self._smaller if is_alarm and (kind, of) not in self.refuted else ():
                excludes = any(
                    (kind == other or {kind, other} <= {OWN_CURVE, NEUTRAL}) and (not of or {*of} & {*own})
                    for other, own in some
                )
                if len(some) < _MOST and not excludes:
                    sets = [{**some, (kind, of): start} for start in starts]
                    (shown if hypothesis.changes_thrust else others).extend(sets)
        best = dict[frozenset[Suspect], tuple[float, Starts]]()
        if shown := [some for some in shown if frozenset(some) not in self.tried]:
            for J in (self._rough, comparison(self.plain.objective, now.starts, now.minimum.z)):
                before = J(now.starts)
                for some in shown:
                    fall = float(np.nan_to_num(before - J(some), nan=-inf, neginf=-inf))
                    best[frozenset(some)] = max(
                        best.get(frozenset(some), (-inf, some)), (fall, some), key=itemgetter(0)
                    )
        ranked = sorted(best.values(), key=itemgetter(0), reverse=True)
        yield from (some for n, (fall, some) in enumerate(ranked[:_FITTED]) if fall > 0.0 or n == 0)
        yield from (some for some in others if frozenset(some) not in self.tried)
