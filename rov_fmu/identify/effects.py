"""The optional effects with their evidence, and what the fit found about loggers and sensors."""

from collections.abc import Iterator
from dataclasses import replace
from math import hypot, inf, log, sqrt

import numpy as np

from rov_fmu.equation.catalogue import PITCH, REVERSE, ROLL
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.hypotheses import HYPOTHESES, Start, Suspect, in_order, probability, row_of
from rov_fmu.identify.likelihood.kinds import LAG, OFFSET, SHORTEST_LAG, STRENGTH, WIDTH
from rov_fmu.identify.likelihood.parameters import Parameter, Table, with_same_lag
from rov_fmu.identify.likelihood.posterior import QUANTILE, around, hull
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.identify.likelihood.search import MOST_OF_ROW
from rov_fmu.identify.result import CONSTANTS, Estimate, IdentifiedEffect, Interval, Logging, SensorNoise, Structure
from rov_fmu.io.groups import grouped

_OUTLIER = 6.0
"""A sample is an outlier if it is so many standard deviations beside its prediction."""
_SHARED = CONSTANTS["shared"].value
"""A time is not told from another one whose knowledge would take away this share of its variance."""


def optional_effects(fit: Fit) -> Iterator[IdentifiedEffect]:
    """Yield all optional effects with their evidence, beside those that are kept.

    That of a hypothesis about the structure, which is no effect of unusual size, is that with which it won.
    """
    yield from _strengths(fit)
    file, odds = fit.file.posterior, {row_of(fit.objective, one): value for one, value in fit.odds.items()}
    for n, p in enumerate(file.table.parameters):
        if not (p.is_effect and p.of_kind.words):
            continue
        value, interval = _number(fit, n)
        posterior = fit.posterior if n in file.absent else file
        name = p.of_kind.words + (f" {p.part}" if p.part else "") + _beside_base(file.table, p)
        is_right = any(axis.name == p.of and one.ratio < 1.0 for axis, one in fit.structure.items())
        is_usual = p.log is not None or p.of_kind.is_of_structure or (p.of_kind.is_usual_if_right and is_right)
        beyond = 0.0 if is_usual else abs(posterior.z[n] - p.mean) / (p.of_kind.unusual * p.deviation)
        evidence, least = odds.get(n, posterior.evidence(n)), _shortest(fit, p)
        sensors = (m for one in fit.objective.logs for m in one.measured if with_same_lag(m.sensor) == p.part)
        axes = frozenset(m.axis.name for m in sensors)
        yield IdentifiedEffect(p.kind, p.of, name, value, interval, p.unit, evidence, float(beyond), least, axes=axes)


def _strengths(fit: Fit) -> Iterator[IdentifiedEffect]:
    """Yield the force of each thruster relative to that of another one of its type.

    Only such a ratio is told, because how strong all of them are together hardly changes the motion. The other one is
    the middle one of those that push along the same axes, so that one that is ill has a ratio to a whole one.
    """
    table, level = fit.posterior.table, [axis for axis in fit.known.fitted if axis not in (ROLL, PITCH)]
    rows = {t.name: table.index(STRENGTH, t.name) for t in table.layout.thrusters}
    free = {name: n for name, n in rows.items() if n is not None and not table.parameters[n].is_fixed}
    along = {name: {a for a in level for t in table.layout.thrusters_along(a) if t.name == name} for name in free}
    types = {name: table.shared(table.layout.curve_of[name].name) for name in free}
    for name, n in free.items():
        alike = [other for other in free if types[other] == types[name] and along[other] & along[name]]
        middle = sorted(alike, key=lambda one: fit.file.posterior.z[free[one]])[len(alike) // 2 :]
        if middle and middle[0] != name:
            yield _strength(fit, name, middle[0], n, free[middle[0]])


def _strength(fit: Fit, name: str, other: str, n: int, m: int) -> IdentifiedEffect:
    """Return the force of a thruster relative to another one, by their covariance. Its evidence is that their
    difference is not 0."""
    ratios, ends = list[float](), list[Interval]()
    for posterior in fit.posteriors:
        kind, C, one, two = posterior.table.parameters[n].of_kind, posterior.covariance, *posterior.z[[n, m]]
        ratios.append(float(one / two))
        errors = [
            max(sqrt(C[n, n] - 2.0 * r * C[n, m] + r * r * C[m, m]), kind.finest / QUANTILE) for r in (ratios[-1], 1.0)
        ]
        low, high = around(ratios[-1], errors[0] / two)
        ends.append((max(low, 0.0), high))
    own, of_other = (posterior.table.parameters[k] for k in (n, m))
    before = hypot(own.deviation, of_other.deviation)
    evidence = ((one - two) / errors[1]) ** 2 - ((own.mean - of_other.mean) / before) ** 2
    evidence = float(evidence + 2.0 * log(errors[1] / before))
    words = f"force relative to that of {other}"
    return IdentifiedEffect(STRENGTH, name, words, ratios[0], hull(*ends), "1", evidence, beside=other)


def _number(fit: Fit, n: int) -> Estimate:
    """Return the number of a parameter within its bounds: that of the file, and an interval that holds for all fits."""
    p = fit.posterior.table.parameters[n]
    posteriors = (fit.posterior,) if n in fit.file.posterior.absent else fit.posteriors
    numbers = [p.number(np.clip(one.ends(n), p.low, p.high)) for one in posteriors]
    numbers = [(np.exp(one) if p.of_kind.is_ratio else one).tolist() for one in numbers]
    return numbers[0][0], hull(*((low, high) for _, low, high in numbers))


def _beside_base(table: Table, p: Parameter) -> str:
    """Return what a ratio of astern to ahead is relative to, in words, where the base itself has one."""
    part = {**table.layout.by_name, **table.layout.curves_by_name}.get(p.of)
    if not (part and p.of_kind.is_ratio):
        return ""
    names = ((part.coefficient(key), part.coefficient(key.removesuffix(REVERSE))) for key in p.of_kind.keys)
    differs = any(table.base.get(astern) != table.base.get(ahead) for astern, ahead in names)
    return ", as a multiple of that of the base" if differs else ""


def structures_of(fit: Fit) -> Iterator[Structure]:
    """Yield the hypotheses about the structure that won, with the numbers of their rows."""
    parameters = fit.objective.table.parameters
    for suspect in in_order(fit.odds):
        structure, n = _named(fit, suspect, fit.starts[suspect], fit.odds[suspect]), row_of(fit.objective, suspect)
        if n is not None:
            structure = replace(structure, value=_number(fit, n)[0], unit=parameters[n].unit)
        yield structure
    if files := tuple(one.file for one in fit.objective.logs if one.lost and _changes_anywhere(fit, one)):
        yield _named(fit, ("momentary commands", files), None, inf)


def _named(fit: Fit, suspect: Suspect, start: Start, odds: float) -> Structure:
    """Return a hypothesis with 2 ln of its odds and what its sentence says."""
    kind, of = suspect
    words = HYPOTHESES[kind].in_words(fit.known, fit.objective.logs, of, start)
    return Structure(kind, words.pop("of"), probability(odds), words=tuple(words.items()))


def _changes_anywhere(fit: Fit, sampled: SampledLog) -> bool:
    """Return True if commands that hold surely change within more than half of the time between two rows."""
    index = fit.posterior.table.index(WIDTH, sampled.file)
    if sampled.is_momentary or index is None:
        return False
    _, low, _ = fit.posterior.ends(index)
    return bool(low > MOST_OF_ROW)


def _shortest(fit: Fit, p: Parameter) -> float:
    """Return the time constant whose corner frequency is that of the samples that show it, s.

    A lag that is shorter changes samples no more than the model between them does.
    """
    intervals = [
        float(np.median(np.diff(sampled.record.time[sampled.record.sensor == n])))
        for sampled in fit.objective.logs
        for n, m in enumerate(sampled.measured)
        if p.of_kind.is_lag and p.part in ("", with_same_lag(m.sensor))
    ]
    return min(intervals, default=-inf) * SHORTEST_LAG


def loggers_of(fit: Fit) -> Iterator[Logging]:
    """Yield how long after their rows the commands of each log act, s, without the dead time and lag of the vehicle."""
    posterior, table = fit.file.posterior, fit.file.posterior.table
    lag = table.index(LAG)
    # a delay that the vehicle does not keep belongs to the logger
    delay = float(posterior.z[lag]) if lag in posterior.absent else 0.0
    for sampled in fit.objective.logs:
        index = table.index(OFFSET, sampled.file)
        if index is None:
            continue
        offset, (low, high) = _number(fit, index)
        width = table.get(posterior.z, WIDTH, sampled.file) * sampled.interval
        yield Logging(sampled.file, sampled.interval, offset + delay, (low + delay, high + delay), width)


def command_times(fit: Fit) -> tuple[str, ...]:
    """Return, in words, a time from a command to what a sensor shows, and the others that the logs do not tell from it.

    The interval of the first one then contains both its absence and its usual size. To know one of the others would
    take away a tenth of its variance. There are none if the logs tell the first one.
    """
    posterior, parameters = fit.posterior, fit.posterior.table.parameters
    times = grouped((p.of_kind.time, n) for n, p in enumerate(parameters) if p.of_kind.time and not p.is_fixed)
    for n in posterior.lasting - fit.file.posterior.absent:
        own, null = parameters[n].of_kind.time, parameters[n].null
        assert null is not None
        if posterior.ends(n)[1] <= null:
            others = (name for name, some in times.items() if name != own and posterior.shared(n, some) > _SHARED)
            return own, *others
    return ()


def sensors_of(fit: Fit) -> Iterator[SensorNoise]:
    """Yield the noise and the outliers of each measured quantity over all logs."""
    objective, table = fit.objective, fit.posterior.table
    seen = grouped(
        (m.quantity.name, (m, np.abs(data.normalised[record.sensor == number]) > _OUTLIER))
        for sampled, record, data in zip(objective.logs, objective.records, fit.best.data, strict=False)
        for number, m in enumerate(sampled.measured)
    )
    for name, some in seen.items():
        m, noise = some[0][0], table.noise(fit.best.z, name)
        count = sum(len(m.channel.values) for m, _ in some)
        outliers = float(np.mean(np.concatenate([is_far for _, is_far in some])))
        wander = max(float(table.wander(fit.best.z, one, m.sensor)) for one in objective.logs)
        yield SensorNoise(m.axis, name, m.quantity.unit, *noise, count, outliers, wander)
