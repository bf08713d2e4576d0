"""What the structure of the model may lack: one table of hypotheses, which are compared by J.

Noise hides a wrong structure: a slow force, a slow gain and coloured noise explain each next sample, and the
innovations look right. Predictions over 10 s do not: relative to the noise of the sensor, their errors are near 1 where
the structure is right. Above ALARM, each hypothesis changes the model, J is minimised anew, and 2 ln of the Bayes
factor (Laplace approximation), with the prior probability, decides. What wins is part of the model.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp, inf, log, nan

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.curves import NO_SHAPES
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.objective import OUTLYING, Objective, TableRow, cost
from rov_fmu.identify.likelihood.parameters import Table, table_of
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import AHEAD, LEAST_COMMAND, SampledLog, unchanged
from rov_fmu.identify.likelihood.solve import Minimum, evidence, minimise, scaled
from rov_fmu.identify.result import ALARM, least_error
from rov_fmu.io.numbers import percent, significant
from rov_fmu.tank.arrays import Array, rms
from rov_fmu.tank.clocks import first_in_each

WINS, CLOSE = 6.0, 10.0
"""The 2 ln of the odds from which a hypothesis wins, and up to which one that does not is within the intervals."""
SETTLING = 5.0
"""Predictions begin with what the filter knows after this time, s."""
_FITTED = 2
"""The most hypotheses that change the thrust that are fitted."""
_FAR = 100.0
"""A hypothesis that does not change the thrust is not fitted to all samples if its 2 ln of the evidence of thinned logs
is so much below the largest one. Thinned logs hardly tell such a hypothesis."""
_STEP = 0.5
"""The time between two values of the unknown force, s."""
_SHARES = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
"""The shares of a change of the thrust of which the best is taken."""
_SMALL = 1e-3
"""An unknown force, relative to full thrust, that explains itself."""
_MOST = 3
"""The most hypotheses that may hold at once."""
_LATE, _NARROWEST, _HALF = 0.05, 0.2, 0.5
"""How much earlier or later commands that change between rows act along an axis (standard error), relative to the
window in which they change; the narrowest window, relative to the time between two rows; and the command whose time
constant this changes."""
MOST_OF_ROW = 0.5
"""Commands that change within more than this part of the time between two rows are momentary values: they change at any
time."""
_SCALE = 0.01
"""The standard error of the scale of a sensor in a log of an autopilot, whose estimates it has."""
_FINEST = 0.05
"""The time between two rows within which a slew limit moves a command, s."""
_IDLE_STEP = 0.1
"""The time between two values of the unknown force that tell when commands do not act, s."""
_IDLE = 0.5
"""Commands may not act where the unknown force makes up for their thrust but for this share of its square."""
_LONGEST_IDLE = 0.5
"""Commands do not act during at most this share of a log, at its beginning or at its end."""

Logs = Sequence[SampledLog]
Of = tuple[str, ...]
Change = Callable[[Prior, Logs, "Variant"], tuple[Prior, Logs]]
Search = Callable[[Objective, Mapping[int, float]], Minimum]
"""A function that minimises J of thinned logs from a start in which some parameters, by their places, have numbers."""


@dataclass(frozen=True)
class Hypothesis:
    """How the model may be wrong, and what changes it."""

    probability: float
    """The prior probability of all its variants together: how many folders have it."""
    variants: Callable[[Prior, Logs], Iterator[Of]]
    """What may have it: thrusters, or files."""
    change: Change
    """The model with it."""
    starts: tuple[float, ...] = ()
    """The coordinates from which its parameter begins; empty if it has none."""
    sentence: str = ""
    """What is told, with `of`, the thrusters or files, `value`, the number of the parameter, and `odds`."""
    most: float = inf
    """A number of its parameter above this one is told as an effect alone."""
    alarm: float = ALARM
    """The error over 10 s, relative to the noise, above which it is tried."""
    changes_thrust: bool = True
    """True if it changes the steady thrust, so that the unknown force shows how likely it is. Others are always fitted
    to thinned logs."""
    has_times: bool = False
    """True if it holds at the beginning and the end of logs, and the unknown force tells until and from when."""
    is_first: bool = False
    """True if it leaves out samples, which would mislead all others. So it is tried before these."""


@dataclass(frozen=True)
class Variant:
    """A hypothesis about some thrusters or files."""

    kind: str
    """Its key in HYPOTHESES, which is also the kind of its parameter."""
    of: Of
    acting: tuple[tuple[float, float], ...] = ()
    """When the commands of each of the files begin to act, and when they end, s."""

    @property
    def parameter(self) -> tuple[str, str]:
        """The kind of its parameter, and what has it."""
        return self.kind, self.of[0] if self.of else ""

    def applied(self, known: Prior, logs: Logs) -> tuple[Prior, Logs]:
        """Return what is known before the fit, and the logs, if this is so."""
        return HYPOTHESES[self.kind].change(known, logs, self)


# ---- The changes -----------------------------------------------------------------------------------------------------


def _with_parameter(kind: str) -> Change:
    def change(known: Prior, logs: Logs, variant: Variant) -> tuple[Prior, Logs]:
        return replace(known, assumed=(*known.assumed, (kind, variant.parameter[1]))), logs

    return change


def _momentary(known: Prior, logs: Logs, variant: Variant) -> tuple[Prior, Logs]:
    coefficients, full = known.coefficients, known.full
    return known, [one.with_lines(coefficients, full) if one.log.file in variant.of else one for one in logs]


def _settled(known: Prior, logs: Logs, variant: Variant) -> tuple[Prior, Logs]:
    return known, [
        one.settled_at(at) if one.log.file in variant.of and (at := one.jump) is not None else one for one in logs
    ]


def _without_idle(known: Prior, logs: Logs, variant: Variant) -> tuple[Prior, Logs]:
    """Return the logs without the commands that do not act."""
    times = dict(zip(variant.of, variant.acting, strict=True))

    def acting(one: SampledLog) -> SampledLog:
        begin, end = times.get(one.log.file, (-inf, inf))
        acts = (one.record.told >= begin) & (one.record.told < end)
        return one.with_inputs(np.where(acts[:, None], one.record.inputs, 0.0))

    return known, [acting(one) for one in logs]


def _permuted(places: Callable[[Of], tuple[Of, float]]) -> Change:
    """Return the change of the commands of some thrusters to those of others, with a sign."""

    def change(known: Prior, logs: Logs, variant: Variant) -> tuple[Prior, Logs]:
        others, sign = places(variant.of)
        found = []
        for one in logs:
            inputs, names = one.record.inputs.copy(), [*one.layout.inputs]
            for thruster, other in zip(variant.of, others, strict=True):
                if {f"u_{thruster}", f"u_{other}"} <= {*names}:
                    inputs[:, names.index(f"u_{thruster}")] = sign * one.record.inputs[:, names.index(f"u_{other}")]
            found.append(one.with_inputs(inputs))
        return known, found

    return change


def _with_rotors(known: Prior, logs: Logs, _: Variant) -> tuple[Prior, Logs]:
    def lagging(layout: Layout) -> Layout:
        return replace(layout, curves=tuple(replace(curve, lag="speed") for curve in layout.curves))

    return (
        replace(known, layout=lagging(known.layout), curves=[replace(curve, lag="speed") for curve in known.curves]),
        [replace(one, layout=lagging(one.layout)) for one in logs],
    )


def _slewing(known: Prior, logs: Logs, variant: Variant) -> tuple[Prior, Logs]:
    known, logs = _with_parameter("slew limit")(known, logs, variant)
    return known, [one if one.log.follows_axis else one.refined(_FINEST) for one in logs]


# ---- What may have them ----------------------------------------------------------------------------------------------


def commands_of(one: SampledLog) -> dict[str, Array]:
    """Return the commands of a dive's thrusters, by their names, in each row.

    It is empty for a log of one axis, whose thrusters all follow one command: no contrast tells them apart.
    """
    if one.log.follows_axis:
        return {}
    names = [*one.layout.inputs]
    return {t.name: one.record.inputs[:, names.index(f"u_{t.name}")] for t in one.layout.thrusters}


def _momentary_files(_: Prior, logs: Logs) -> Iterator[Of]:
    """Yield the files with momentary commands."""
    files = [one.log.file for one in logs if one.lost and not one.is_momentary]
    if files:
        yield tuple(files)


def _with_commands_at_ends(_: Prior, logs: Logs) -> Iterator[Of]:
    """Yield the files whose first or last row has a command."""
    files = [one.log.file for one in logs if np.abs(one.record.inputs[[0, -1]]).max() > LEAST_COMMAND]
    if files:
        yield tuple(files)


def _with_jumps(_: Prior, logs: Logs) -> Iterator[Of]:
    """Yield each file in which a horizontal velocity jumps."""
    yield from ((one.log.file,) for one in logs if one.jump is not None)


def lost_in_words(lost: Mapping[str, float], interval: float) -> dict[str, str]:
    """Return how much of the command along which axis is lost between rows that are so far apart, s."""
    axis = max(lost, key=lambda one: lost[one])
    return {"share": percent(lost[axis]), "axis": axis, "rate": significant(1.0 / interval, 2)}


def _thrusters(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield each thruster that the logs command, one of those that no log tells apart."""
    seen = list[Array]()
    for thruster in known.layout.thrusters:
        shown = _signature(known, logs, thruster.name)
        if shown is not None and not any(np.array_equal(shown, other) for other in seen):
            seen.append(shown)
            yield (thruster.name,)


def _signature(known: Prior, logs: Logs, name: str) -> Array | None:
    """Return the effects of a thruster along the axes times its commands in the logs; None if nothing commands it."""
    effects = [t.effect(form.axis) for t in known.layout.thrusters if t.name == name for form in known.layout.axes]
    values = [c[name] for one in logs if name in (c := commands_of(one))]
    commands = np.concatenate(values) if values else np.zeros(1)
    if not any(effects) or np.ptp(commands) < LEAST_COMMAND:
        return None
    sign = 1.0 if next(filter(None, effects)) > 0.0 else -1.0
    return np.outer(np.round(np.multiply(effects, sign), 9), sign * commands)


def twins(known: Prior, logs: Logs, name: str) -> list[str]:
    """Return the thrusters that no log tells from one of them, with its name."""
    shown = {t.name: _signature(known, logs, t.name) for t in known.layout.thrusters}
    own = shown[name]
    return [other for other, one in shown.items() if one is not None and own is not None and np.array_equal(own, one)]


def _pairs(known: Prior, logs: Logs) -> Iterator[Of]:
    alone = [of[0] for of in _thrusters(known, logs)]
    for pair in combinations(alone, 2):
        commands = [[commands_of(one).get(name, np.zeros(1)) for name in pair] for one in logs]
        if not all(np.array_equal(first, second) for first, second in commands):
            yield pair


def _commanded(known: Prior, logs: Logs) -> Iterator[Of]:
    if [*_thrusters(known, logs)]:
        yield ()


def _lagging(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield one variant, about all thrusters, if all forces may lag, and no curve is a table or a wrench's force."""
    curves = known.layout.curves
    if (
        logs
        and curves
        and not known.layout.has_wrench
        and all(c.has_lag and not (c.has_rotors or c.tables) for c in curves)
    ):
        yield ()


HYPOTHESES = {
    "unsettled velocity": Hypothesis(
        0.05,
        _with_jumps,
        _settled,
        sentence=(
            "{of}: the measured velocity is not that of the vehicle before it jumps, as of an estimator without a "
            "position{odds}. It is left out until then. Begin a dive when the estimator has its position"
        ),
        changes_thrust=False,
        is_first=True,
    ),
    "momentary commands": Hypothesis(
        0.2,
        _momentary_files,
        _momentary,
        sentence=(
            "{of}: the log has momentary commands: about {share} of the {axis} command is lost between its rows "
            "({rate} per second). Fly in MANUAL, or log at 50 Hz"
        ),
        changes_thrust=False,
    ),
    "idle commands": Hypothesis(
        0.05,
        _with_commands_at_ends,
        _without_idle,
        sentence=(
            "{of}: the commands do not act before and after, as if the thrusters were off{odds}. They count as 0 "
            "there. Record while the thrusters are on"
        ),
        has_times=True,
    ),
    "rotor lag": Hypothesis(
        0.07,
        _lagging,
        _with_rotors,
        sentence=(
            "all thrusters: the speed of the rotors lags behind the command, and not the force{odds}. The vehicle file "
            'says so by lag = "speed"'
        ),
        alarm=1.3,
        changes_thrust=False,
    ),
    "health": Hypothesis(
        0.1,
        _thrusters,
        lambda known, logs, variant: _with_parameter("health")(
            replace(known, exact=known.exact - {known.layout.health[variant.of[0]]}), logs, variant
        ),
        (0.0,),
        "thruster {of}: its force is {value} of that of a whole one{odds}. Check it for weed and damage",
        most=0.79,
    ),
    "reversed commands": Hypothesis(
        0.03,
        _thrusters,
        _permuted(lambda of: (of, -1.0)),
        sentence=(
            "thruster {of}: it pushes against its commands in the logs{odds}. Check its direction, the order of its "
            "wires, and its propeller"
        ),
    ),
    "swapped commands": Hypothesis(
        0.03,
        _pairs,
        _permuted(lambda of: (of[::-1], 1.0)),
        sentence="thrusters {of}: their commands are swapped in the logs{odds}. Check the order of their columns",
    ),
    "command limit": Hypothesis(
        0.03,
        _commanded,
        _with_parameter("command limit"),
        (0.4, 0.6, 0.8),
        "all thrusters: beyond a command of {value}, they push no more{odds}. Check the limits of the speed "
        "controllers, and use only commands below",
    ),
    "slew limit": Hypothesis(
        0.03,
        _commanded,
        _slewing,
        (log(0.3), log(1.0), log(3.0)),
        "all thrusters: commands act at a rate of at most {value}, where 1 is full command{odds}. Check the ramp of "
        "the speed controllers, or a limit in the autopilot",
    ),
}
"""All hypotheses about the structure, by the kind of their parameter. Each is tried after the alarm."""


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
        if p.kind in ("coloured noise", "short force"):
            quiet[n] = min(z[n], p.mean)
        elif p.is_slow_size:
            quiet[n] = p.low
    return quiet


def windows(objective: Objective, z: Array) -> dict[str, float]:
    """Return the part of the time between two rows in which a command may change, of each log that loses commands."""
    found = {one.log.file: objective.table.get(z, "logging width", one.log.file) for one in objective.logs if one.lost}
    return {file: 1.0 if width > MOST_OF_ROW else max(float(width), _NARROWEST) for file, width in found.items()}


def unseen_errors(objective: Objective, z: Array, before: Mapping[str, float]) -> Array:
    """Return the covariance of the parameters by errors that logs do not show whose commands change between rows.

    Along each axis, commands act a small part of their window earlier or later: a stick moves it otherwise than a
    controller. The axis answers so much earlier or later, as if its inertia were other: the more so the faster it is.
    And such logs have the estimates of an autopilot, whose scale is not exact either. With a scale s, all velocities v
    are s v, as if the drag were a/s² and b/s, and the inertia m/s.

    `before` has the windows of the fit without hypotheses: straight lines between rows leave them open.
    """
    now, parameters = windows(objective, z), objective.table.parameters
    widths = [one.interval * (before if one.is_momentary else now)[one.log.file] for one in objective.logs if one.lost]
    found = np.zeros((len(z), len(z)))
    if not widths:
        return found
    vehicle, shapes = objective.table.model(z)
    powers = {"quadratic drag": 2.0, "linear drag": 1.0, "inertia": 1.0}
    for axis in vehicle.layout.bare_axes:
        time = float(shapes.motions(vehicle, axis, np.array([_HALF])).response()[1][0])
        own = np.array([powers.get(p.kind, 0.0) * (p.of == axis.name) for p in parameters])
        found += _SCALE**2 * np.outer(own, own)
        if 0.0 < time < inf:
            is_inertia = np.array([p.kind == "inertia" and p.of == axis.name for p in parameters])
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


def probability(odds: float) -> float:
    """Return the probability for 2 ln of the odds."""
    return 1.0 / (1.0 + exp(min(max(-0.5 * odds, -50.0), 50.0)))


# ---- The trial -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Model:
    """What is fitted: what is known before, the logs, and the rows of tables."""

    known: Prior
    logs: Logs
    rows: Sequence[TableRow]

    @property
    def table(self) -> Table:
        """All parameters."""
        return table_of(self.known, self.logs, sorted({row.noise for row in self.rows}))

    def objective(self, *, thinned: bool = False) -> Objective:
        """Return J. Raises BuildError."""
        return Objective(self.table, self.logs, self.rows, thinned=thinned)

    def applied(self, variant: Variant) -> "Model":
        """Return the model if a hypothesis is true."""
        known, logs = variant.applied(self.known, self.logs)
        return replace(self, known=known, logs=logs)


@dataclass(frozen=True)
class Adopted:
    """A hypothesis that won."""

    variant: Variant
    odds: float
    """2 ln of its posterior odds against the model without it."""


@dataclass(frozen=True, eq=False)
class Explained:
    """The model with the hypotheses that won."""

    model: Model
    objective: Objective
    minimum: Minimum
    adopted: tuple[Adopted, ...] = ()
    rivals: tuple[Posterior, ...] = ()
    """The fits with hypotheses that did not win, and whose odds are near even."""


def explained(model: Model, full: Objective, near: Minimum, search: Search) -> Explained:
    """Try the hypotheses where the alarm asks for it, and return the model with those that win, one after the other.

    `near` is the minimum of `full`. `search` fits thinned logs from a start with much noise.
    """
    now = _begun(Explained(model, full, near), search)
    for _ in range(_MOST):
        fits = [_fitted(now, one, z) for one, z in _likely(now, search)]
        if not (fits := [one for one in fits if one]):
            break
        best = max(fits, key=lambda one: one.adopted[-1].odds)
        if best.adopted[-1].odds <= WINS:
            rivals = [one for one in fits if one.adopted[-1].odds > -CLOSE]
            posteriors = [Posterior.of(one.objective.table, one.minimum.z, one.minimum.information) for one in rivals]
            return replace(now, rivals=tuple(posteriors))
        now = best
    return now


def _begun(now: Explained, search: Search) -> Explained:
    """Return the model with what must be known before other hypotheses are compared."""
    if max(structure(now.objective, now.minimum, ahead=True).values(), default=0.0) <= ALARM:
        return now
    for kind in (kind for kind, hypothesis in HYPOTHESES.items() if hypothesis.is_first):
        for variant in [Variant(kind, of) for of in HYPOTHESES[kind].variants(now.model.known, now.model.logs)]:
            with suppress(DivergedError):
                quick = search(now.model.applied(variant).objective(thinned=True), {})
                other = _fitted(now, variant, quick)
                now = other if other and other.adopted[-1].odds > WINS else now
    return now


def _left_out(now: Explained, objective: Objective) -> float:
    """Return the part of J of the samples that another objective leaves out. Only J of the others is compared."""
    total = 0.0
    for old, new, data in zip(now.objective.records, objective.records, now.minimum.data, strict=False):
        if len(new.time) < len(old.time):
            gone = ~np.isin(old.time + 1j * old.sensor, new.time + 1j * new.sensor)
            total += cost(data.innovations[gone], data.variances[gone])
    return total


def _likely(now: Explained, search: Search) -> Iterator[tuple[Variant, Minimum]]:
    """Yield the hypotheses that are worth a fit to all samples, with their minima for thinned logs.

    Of the variants that change the thrust, those are fitted that explain most of the unknown force, which the filter
    follows with a slow process of the largest size.
    """
    model = now.model
    predicted = filtered = max(structure(now.objective, now.minimum, ahead=True).values(), default=0.0)
    if any(one.lost and not one.is_momentary for one in model.logs):
        filtered = max(structure(now.objective, now.minimum).values(), default=0.0)
    variants = {
        Variant(kind, of): [*hypothesis.starts] or [nan]
        for kind, hypothesis in HYPOTHESES.items()
        if not hypothesis.is_first and (filtered if hypothesis.changes_thrust else predicted) > hypothesis.alarm
        for of in hypothesis.variants(model.known, model.logs)
    }
    unknown = (
        Unknown(model, now.objective, now.minimum.z)
        if any(HYPOTHESES[one.kind].changes_thrust for one in variants)
        else None
    )
    if unknown:
        timed = [(unknown.timed(one), starts) for one, starts in variants.items()]
        variants = {one: starts for one, starts in timed if one.of or not HYPOTHESES[one.kind].has_times}
    ranked = {one: starts for one, starts in variants.items() if HYPOTHESES[one.kind].changes_thrust}
    gains = {
        (one, start): unknown.explained(one, start) for one, starts in ranked.items() for start in starts if unknown
    }
    best = {one: max(starts, key=lambda start: gains.get((one, start), inf)) for one, starts in variants.items()}
    order = sorted(best, key=lambda one: -gains.get((one, best[one]), inf))
    fits = []
    for one in order[: _FITTED + len(variants) - len(ranked)]:
        objective = model.applied(one).objective(thinned=True)
        own = objective.table.place(*one.parameter)
        with suppress(DivergedError):
            fits.append((one, objective, search(objective, {} if own is None else {own: best[one]})))
    most = max((_evidence(objective, end) for _, objective, end in fits), default=-inf)
    for one, objective, end in fits:
        if _evidence(objective, end) > most - (WINS if one in ranked else _FAR):
            yield one, end


class Unknown:
    """The unknown force along each axis, and how much of it a change of the commands explains."""

    def __init__(self, model: Model, objective: Objective, best: Array) -> None:
        self.model, table, z = model, objective.table, best.copy()
        for n, p in enumerate(table.parameters):
            if p.kind == "slow force":
                z[n] = p.high
            elif p.is_slow_size:
                z[n] = p.low
        self.vehicle, _ = table.model(best)
        self.scale = {axis.name: float(table.force_unit(z, axis)) for axis in table.layout.bare_axes}
        self.time, self.force, self.at_samples = [], [], []
        for n, one in enumerate(model.logs):
            first, record = objective.filters[n].force, objective.records[n]
            at = first_in_each(record.time, 1.0 / _STEP)
            run = objective.run(z, n, with_states=True)
            force = run.states[:, first : first + len(one.layout.axes)]
            self.at_samples.append((record.time, force))
            self.time.append(record.time[at])
            self.force.append(force[at])
        self.before = [
            self._thrust(one, one.record.inputs, time) for one, time in zip(model.logs, self.time, strict=True)
        ]

    def _thrust(self, one: SampledLog, inputs: Array, time: Array) -> Array:
        """Return the thrust along each axis of a log at some times: n x axes."""
        rows = np.maximum(np.searchsorted(one.record.told, time, side="right") - 1, 0)
        found, names = np.zeros((len(time), len(one.layout.axes))), [*one.layout.inputs]
        for t in one.layout.thrusters:
            curve = one.layout.curve_of[t.name]
            forces = NO_SHAPES.forces(self.vehicle, curve, inputs[rows, names.index(f"u_{t.name}")]) / curve.n_thrusters
            effects = [self.vehicle.effect(t, form.axis) for form in one.layout.axes]
            found += self.vehicle[one.layout.health[t.name]] * np.outer(forces, effects)
        return found

    def timed(self, variant: Variant) -> Variant:
        """Return a hypothesis with the times between which the commands of its files act, if it has times.

        Before and after, the unknown force r makes up for the thrust T. The sum of r² - (r + T)² - T²/2 from the
        beginning of a log, and that from its end, are largest where the commands begin and cease to act. A position
        tells r late. So only axes with measured velocities count where there are some.
        """
        if not HYPOTHESES[variant.kind].has_times:
            return variant
        found = {}
        for n, one in enumerate(self.model.logs):
            if one.log.file not in variant.of:
                continue
            scale = np.array([self.scale[form.axis.name] for form in one.layout.axes])
            time, force = self.at_samples[n]
            at = first_in_each(time, 1.0 / _IDLE_STEP)
            prompt = {m.sensor.axis for m in one.measured if m.sensor.is_velocity} or {*one.layout.bare_axes}
            scale[[form.axis not in prompt for form in one.layout.axes]] = inf
            r, T = force[at] / scale, self._thrust(one, one.record.inputs, time[at]) / scale
            gain = _IDLE_STEP * np.sum(r**2 - (r + T) ** 2 - _IDLE * T**2, axis=1)

            def rows(gain: Array) -> int:
                total = np.cumsum(gain)
                most = int(np.argmax(total))
                is_idle = total[most] > _IDLE * LEAST_COMMAND**2 and most < _LONGEST_IDLE * len(gain)
                return most if is_idle else 0

            first, last = rows(gain), rows(gain[::-1])
            if first or last:
                begin, end = time[at][first] if first else -inf, time[at][-1 - last] if last else inf
                found[one.log.file] = float(begin), float(end)
        return replace(variant, of=tuple(found), acting=tuple(found.values()))

    def explained(self, variant: Variant, start: float) -> float:
        """Return how much more probable the unknown force is with a hypothesis: the sum over all axes of N ln (r²/s²).

        r is the force, and s what the change of the thrust leaves of it; of a hypothesis with a parameter, the share of
        the change that leaves least along each axis, because the fit has adapted to the wrong structure elsewhere.
        """
        model, found = self.model.applied(variant), dict[str, list[Array]]()
        table = model.table
        z = np.array([p.mean for p in table.parameters])
        if (place := table.place(*variant.parameter)) is not None:
            z[place] = start
        for n, one in enumerate(model.logs):
            if variant.kind == "health":
                change = (start - 1.0) * self._thrust(*_alone(one, variant.of[0]), self.time[n])
            else:
                change = self._thrust(one, table.followed(z, one), self.time[n]) - self.before[n]
            for k, form in enumerate(one.layout.axes):
                name = form.axis.name
                found.setdefault(name, []).append(np.array([self.force[n][:, k], change[:, k]]) / self.scale[name])
        both = [np.concatenate(pairs, axis=1) for pairs in found.values()]

        def gain(share: float, r: Array, change: Array) -> float:
            rest = r - share * change
            return len(r) * log((np.mean(r**2) + _SMALL**2) / (np.mean(rest**2) + _SMALL**2))

        shares = _SHARES if place is not None else (1.0,)
        return sum(max(gain(share, *pair) for share in shares) for pair in both)


def _alone(one: SampledLog, thruster: str) -> tuple[SampledLog, Array]:
    """Return a log, and its inputs with the commands of one thruster alone."""
    inputs, place = np.zeros_like(one.record.inputs), [*one.layout.inputs].index(f"u_{thruster}")
    inputs[:, place] = one.record.inputs[:, place]
    return one, inputs


def _fitted(now: Explained, one: Variant, quick: Minimum) -> Explained | None:
    """Return the minimum of J with a hypothesis for all samples, from that for thinned logs; None if it diverges."""
    model = now.model.applied(one)
    objective, hypothesis = model.objective(), HYPOTHESES[one.kind]
    try:
        end = minimise(objective, scaled(objective, quick.z), last=False)
    except DivergedError:
        return None
    count = sum(1 for _ in hypothesis.variants(now.model.known, now.model.logs))
    gained = _evidence(objective, end) - _evidence(now.objective, now.minimum) - _left_out(now, objective)
    odds = gained + 2.0 * log(hypothesis.probability / count)
    return Explained(model, objective, end, (*now.adopted, Adopted(one, odds)))


def _evidence(objective: Objective, minimum: Minimum) -> float:
    return evidence(objective, minimum.value, minimum.information)
