"""The optional effects with their evidence, and what the fit found about loggers and sensors."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf, pi

import numpy as np

from rov_fmu.equation.catalogue import REVERSE
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.hypotheses import Variant, probability
from rov_fmu.identify.likelihood.kinds import LAG, OFFSET, WIDTH
from rov_fmu.identify.likelihood.parameters import Parameter, Table, with_same_lag
from rov_fmu.identify.likelihood.posterior import around, hull
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.identify.likelihood.search import MOST_OF_ROW
from rov_fmu.identify.result import Effect, Logging, SensorNoise, Structure
from rov_fmu.io.groups import grouped

_OUTLIER = 6.0
"""A sample is an outlier if it is so many standard deviations beside its prediction."""


def effects_of(fit: Fit) -> Iterator[Effect]:
    """Yield all optional effects with their evidence, beside those that are kept."""
    file = fit.file.posterior
    for n, p in enumerate(file.table.parameters):
        if not p.is_effect:
            continue
        posteriors, kind = (fit.posterior,) if n in file.absent else fit.posteriors, p.of_kind
        numbers = [p.number(one.ends(n)) for one in posteriors]
        numbers = [(np.exp(one) if kind.is_ratio else one).tolist() for one in numbers]
        posterior, value, interval = posteriors[0], numbers[0][0], hull(*((low, high) for _, low, high in numbers))
        name = kind.words + (f" {p.part}" if p.part else "") + _beside_base(file.table, p)
        beyond = abs(posterior.z[n] - p.mean) / p.deviation if p.log is None else 0.0
        evidence, least = posterior.evidence(n), _shortest(fit, p)
        yield Effect(p.kind, p.of, name, value, interval, p.unit, evidence, float(beyond), least)


def _beside_base(table: Table, p: Parameter) -> str:
    """Return what a ratio of astern to ahead is relative to, in words, where the base itself has one."""
    part = {**table.layout.by_name, **table.layout.curves_by_name}.get(p.of)
    if not (part and p.of_kind.is_ratio):
        return ""
    names = ((part.coefficient(key), part.coefficient(key.removesuffix(REVERSE))) for key in p.of_kind.keys)
    differs = any(table.base.get(astern) != table.base.get(ahead) for astern, ahead in names)
    return ", as a multiple of that of the base" if differs else ""


def structures_of(fit: Fit) -> Iterator[Structure]:
    """Yield the hypotheses about the structure that won, with the numbers of their parameters."""
    posterior, objective = fit.posterior, fit.objective
    for one in fit.adopted:
        structure, place = _named(fit, one.variant, one.odds), posterior.table.place(*one.variant.parameter)
        if place is not None:
            p = posterior.table.parameters[place]
            value, low, high = p.number(np.clip(posterior.ends(place), p.low, p.high)).tolist()
            structure = replace(structure, value=value, interval=(low, high), unit=p.unit)
        yield structure
    if files := tuple(one.log.file for one in objective.logs if one.lost and _changes_anywhere(fit, one)):
        yield _named(fit, Variant("momentary commands", files), inf)


def _named(fit: Fit, variant: Variant, odds: float) -> Structure:
    """Return a hypothesis with 2 ln of its odds and what its sentence says."""
    words = variant.in_words(fit.known, fit.objective.logs)
    return Structure(variant.kind, words.pop("of"), probability(odds), words=tuple(words.items()))


def _changes_anywhere(fit: Fit, one: SampledLog) -> bool:
    """Return True if commands that hold surely change within more than half of the time between two rows."""
    place = fit.posterior.table.place(WIDTH, one.log.file)
    if one.is_momentary or place is None:
        return False
    _, low, _ = fit.posterior.ends(place)
    return bool(low > MOST_OF_ROW)


def _shortest(fit: Fit, p: Parameter) -> float:
    """Return the time constant whose corner frequency is that of the samples that show it, s.

    A lag that is shorter changes samples no more than the model between them does.
    """
    intervals = [
        float(np.median(np.diff(one.record.time[one.record.sensor == n])))
        for one in fit.objective.logs
        for n, m in enumerate(one.measured)
        if p.of_kind.is_lag and p.part in ("", with_same_lag(m.sensor))
    ]
    return min(intervals, default=-inf) / (2.0 * pi)


def loggers_of(fit: Fit) -> Iterator[Logging]:
    """Yield how long after their rows the commands of each log act, s, without the dead time and lag of the vehicle."""
    posterior, table = fit.file.posterior, fit.file.posterior.table
    for one in fit.objective.logs:
        place = table.place(OFFSET, one.log.file)
        if place is None:
            continue
        offset, lag = float(posterior.z[place]), table.place(LAG)
        if lag in posterior.absent:  # a delay that the vehicle does not keep belongs to the logger
            offset += float(posterior.z[lag])
        width = table.get(posterior.z, WIDTH, one.log.file) * one.interval
        yield Logging(one.log.file, one.interval, offset, around(offset, posterior.errors[place]), width)


def sensors_of(fit: Fit) -> Iterator[SensorNoise]:
    """Yield the noise and the outliers of each measured quantity over all logs."""
    objective, table = fit.objective, fit.posterior.table
    seen = grouped(
        (m.channel.quantity.name, (m, np.abs(data.normalised[record.sensor == place]) > _OUTLIER))
        for one, record, data in zip(objective.logs, objective.records, fit.best.data, strict=False)
        for place, m in enumerate(one.measured)
    )
    for name, some in seen.items():
        m, noise = some[0][0], table.noise(fit.best.z, name)
        count = sum(len(m.channel.values) for m, _ in some)
        outliers = float(np.mean(np.concatenate([is_far for _, is_far in some])))
        yield SensorNoise(m.sensor.axis, name, m.channel.quantity.unit, *noise, count, outliers)
