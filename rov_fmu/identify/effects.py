"""The optional effects with their evidence, and what the fit found about loggers and sensors."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf, pi

import numpy as np

from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.hypotheses import Variant, probability
from rov_fmu.identify.likelihood.kinds import KINDS
from rov_fmu.identify.likelihood.parameters import Parameter, with_same_lag
from rov_fmu.identify.likelihood.posterior import QUANTILE, around, hull
from rov_fmu.identify.likelihood.records import SampledChannel, SampledLog
from rov_fmu.identify.likelihood.search import MOST_OF_ROW
from rov_fmu.identify.result import Effect, Logging, SensorNoise, Structure

_OUTLIER = 6.0
"""A sample is an outlier if it is so many standard deviations beside its prediction."""


def effects_of(fit: Fit) -> Iterator[Effect]:
    """Yield all optional effects with their evidence, beside those that are kept."""
    file = fit.file.posterior
    for n, p in enumerate(file.table.parameters):
        if not p.is_effect:
            continue
        kind, posteriors = KINDS[p.kind], fit.posteriors if n not in file.absent else (fit.posterior,)
        posterior, values = posteriors[0], [p.offset + p.factor * float(one.z[n]) for one in posteriors]
        errors = [p.factor * max(one.errors[n], kind.finest / QUANTILE) for one in posteriors]
        value, (low, high) = values[0], hull(*map(around, values, errors))
        if kind.is_ratio or p.is_log:
            value, low, high = np.exp([value, low, high]).tolist()
        name = kind.words + (f" {p.part}" if p.part else "")
        beyond = abs(posterior.z[n] - p.mean) / p.deviation if p.log is None else 0.0
        evidence, least = posterior.evidence(n), _shortest(fit, p)
        yield Effect(p.kind, p.of, name, value, (low, high), p.unit, evidence, float(beyond), least)


def structures_of(fit: Fit) -> Iterator[Structure]:
    """Yield the hypotheses about the structure that won, with the numbers of their parameters."""
    posterior, objective = fit.posterior, fit.objective
    for one in fit.adopted:
        structure, place = _named(fit, one.variant, one.odds), posterior.table.place(*one.variant.parameter)
        if place is not None:
            p = posterior.table.parameters[place]
            low, high = around(float(posterior.z[place]), posterior.errors[place])
            ends = np.clip([posterior.z[place], low, high], p.low, p.high)
            value, low, high = (np.exp(ends) if p.is_log else ends).tolist()
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
    place = fit.posterior.table.place("logging width", one.log.file)
    if one.is_momentary or place is None:
        return False
    return around(float(fit.posterior.z[place]), fit.posterior.errors[place])[0] > MOST_OF_ROW


def _shortest(fit: Fit, p: Parameter) -> float:
    """Return the time constant whose corner frequency is that of the samples that show it, s.

    A lag that is shorter changes samples no more than the model between them does.
    """
    intervals = [
        float(np.median(np.diff(one.record.time[one.record.sensor == n])))
        for one in fit.objective.logs
        for n, m in enumerate(one.measured)
        if KINDS[p.kind].is_lag and p.part in ("", with_same_lag(m.sensor))
    ]
    return min(intervals, default=-inf) / (2.0 * pi)


def loggers_of(fit: Fit) -> Iterator[Logging]:
    """Yield how long after their rows the commands of each log act, s, without the dead time and lag of the vehicle."""
    posterior, table = fit.file.posterior, fit.file.posterior.table
    for one in fit.objective.logs:
        place = table.place("logging offset", one.log.file)
        if place is None:
            continue
        offset, lag = float(posterior.z[place]), table.place("lag")
        if lag in posterior.absent:  # a delay that the vehicle does not keep belongs to the logger
            offset += float(posterior.z[lag])
        width = table.get(posterior.z, "logging width", one.log.file) * one.interval
        yield Logging(one.log.file, one.interval, offset, around(offset, posterior.errors[place]), width)


def sensors_of(fit: Fit) -> Iterator[SensorNoise]:
    """Yield the noise and the outliers of each measured quantity over all logs."""
    z, table = fit.best.z, fit.posterior.table
    counts: dict[str, int] = {}
    outlying: dict[str, list[bool]] = {}
    first: dict[str, SampledChannel] = {}
    logs = fit.objective.logs
    for one, record, data in zip(logs, fit.objective.records, fit.best.data[: len(logs)], strict=True):
        for place, m in enumerate(one.measured):
            name = m.channel.quantity.name
            counts[name] = counts.get(name, 0) + len(m.channel.values)
            far = np.abs(data.normalised[record.sensor == place]) > _OUTLIER
            outlying.setdefault(name, []).extend(far.tolist())
            first.setdefault(name, m)
    for name, m in first.items():
        white = table.get(z, "white noise", name)
        coloured = white * table.get(z, "coloured noise", name)
        time = table.get(z, "correlation time", name)
        share = float(np.mean(outlying[name]))
        yield SensorNoise(m.sensor.axis, name, m.channel.quantity.unit, white, coloured, time, counts[name], share)
