"""What is told about the channels of a log: their sources, sensors that froze, jumps, gaps, and its pieces."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.equation.units import in_degrees
from rov_fmu.io.messages import MOST, first_of, listed
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.clocks import gaps
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.log import LEAST_SAMPLES, Channel, Commands, Log

_MOST_SOURCES = 4
"""The largest number of sources that are not used and told."""
_LEAST_SHARE, _LEAST_TIME = 0.2, 5.0
"""A sensor is frozen if it keeps its last value for more than this share of the log, and for more than this time, s."""
_CHANGING, _TURNING, _VISIBLE = 0.5, 0.2, 1.5
"""The noise of a sensor is visible if three conditions hold. At least the first share of the samples differ from the
sample before. At least the second share of the changes have the opposite sign of the change before. The median change
is more than the third number times the smallest change, which is the resolution of the sensor."""
_TOGETHER = 2.0
"""Sensors froze together if they froze within this time, s."""
_LEAST_JUMP = 0.2
"""The smallest jump, m, rad or m/s."""
_ANOTHER = ". What follows counts as another log"
"""The end of the sentence about jumps that divide a log."""
_FASTER = 5.0
"""A quantity jumps where it changes this many times as fast as around there, by this many usual steps, and stays there:
its median over three samples changes by half of the jump or more."""
_FASTER_VELOCITY = 2.0
"""How many times as fast as 95 % of the time a velocity changes where it jumps, because thrusters change it quickly.
Other quantities change _FASTER times as fast."""
_AROUND = 5
"""The acceleration around a sample is the median of so many, which follows one that begins at once."""


def checked_log(log: Log) -> Log:
    """Return the log without the values that must be wrong, with findings about these and about doubtful channels."""
    channels, frozen = _without_frozen(log.file, log.channels)
    findings = [*log.findings, *frozen]
    used = [channel for channel in channels if not channel.unused]
    findings += [about(log.file, "depth by pressure", by=one.derived_from) for one in used if one.derived_from]
    findings += [finding for channel in used if (finding := _jumps(log.file, channel))]
    findings += source_findings(log.file, channels)
    measured = np.unique(np.concatenate([np.empty(0), *{id(c.time): c.time for c in channels}.values()]))
    commands = log.commands and log.commands.held_while(measured)
    return replace(log, commands=commands, channels=tuple(channels), findings=tuple(findings))


# ---- Sources ---------------------------------------------------------------------------------------------------------


def source_findings(file: str, channels: Sequence[Channel]) -> Iterator[Finding]:
    """Yield a finding for each source that is used, with its quantities and the sources that are not used for them, and
    one for each source that is left out although no other one of its quantities is used.

    The column of a table, which has only its header for a source, is not worth a sentence if it has no rival.
    """
    used = {channel.quantity.name for channel in channels if not channel.unused}
    groups: dict[tuple[str, str, str], list[Channel]] = {}
    for channel in channels:
        kind = "channel left out" if channel.unused else "source"
        words = channel.unused or _others(channel, channels)
        is_told = channel.quantity.name not in used if channel.unused else channel.source.kind or words
        if is_told:
            groups.setdefault((kind, str(channel.source), words), []).append(channel)
    for (kind, source, words), own in sorted(groups.items(), key=lambda group: group[0][0]):
        quantities = listed(dict.fromkeys(channel.quantity.name for channel in own))
        yield about(file, kind, quantities=quantities, source=source, words=words, rate=rate(own[0].samples[0]))


def rate(time: Array) -> float:
    """Return the usual number of samples in a second, 1/s; 0 for less than two samples."""
    intervals = np.diff(time)
    return 1.0 / float(np.median(intervals)) if len(intervals) else 0.0


def _others(channel: Channel, channels: Sequence[Channel]) -> str:
    """Return words about the other sources of the same quantity, which are not used, or an empty text."""
    own, rivals = str(channel.source), f"{channel.source} is used"
    told = dict.fromkeys(
        f"{other.source}{'' if other.unused == rivals else f' ({other.unused})'}"
        for other in channels
        if other.unused and other.quantity == channel.quantity and str(other.source) != own
    )
    return f"; also in {', '.join(first_of([*told], _MOST_SOURCES))}, not used" if told else ""


# ---- Gaps, angles and jumps ------------------------------------------------------------------------------------------


def uninterrupted(log: Log) -> list[Log]:
    """Return the pieces of a log with commands between the gaps in which it tells neither these nor a measurement, and
    between resets of its depth or of an angle, which no motion explains.

    What was commanded in a gap is unknown. If the last command held there, the motion after it would contradict it.
    """
    commands = log.commands
    assert commands  # a folder keeps no other log
    told = np.unique(np.concatenate([commands.rows, *(channel.samples[0] for channel in log.channels)]))
    silent = gaps(told, told)
    interruption = about(log.file, "interruption", gaps=gaps_in_words(silent, float(commands.rows[0])))
    resets = {pair for channel in log.channels if _divides(channel) for pair in _resets(channel)}
    return without_spans(log, sorted({*silent, *resets}), [interruption] if silent else [])


def without_spans(
    log: Log, spans: Sequence[tuple[float, float]], why: Sequence[Finding], least: float = 0.0
) -> list[Log]:
    """Return the pieces of a log with commands beside some spans of time (s, ascending), the first one with findings
    that say why. Pieces that are not longer than `least`, s, are left out."""
    commands = log.commands
    assert commands
    if not spans:
        return [log]
    first = min(float(commands.rows[0]), *(float(c.time[0]) for c in log.channels if len(c.time)))
    pieces = list[Log]()
    edges = [-np.inf, *(edge for span in spans for edge in span), np.inf]
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        rows = commands.rows[(commands.rows >= start) & (commands.rows <= end)]
        channels = [
            replace(channel, time=channel.time[at], values=channel.values[at])
            for channel in log.channels
            if (at := (channel.time >= start) & (channel.time <= end) & channel.there).any()
        ]
        if len(rows) and (not least or rows[-1] - rows[0] > least):
            piece = replace(
                log,
                file=f"{log.file} (from {start - first:.4g} s)" if start > -np.inf else log.file,
                commands=Commands.of_rows(commands.thrusters, rows, commands.at(rows), commands.source),
                channels=tuple(channels),
                findings=() if pieces else (*log.findings, *why),
            )
            pieces.append(piece)
    return pieces


def gaps_in_words(found: Sequence[tuple[float, float]], begin: float) -> str:
    """Return how long the first gaps are, and when they begin after a time, s."""
    return ", ".join(first_of([f"{end - start:.3g} s from {start - begin:.4g} s on" for start, end in found], MOST))


def _resets(channel: Channel) -> list[tuple[float, float]]:
    """Return the times before and after each jump of a position, s."""
    if channel.unused or channel.quantity.unit not in ("m", "rad"):
        return []
    time, values = channel.unwrapped
    return [(float(time[n]), float(time[n + 1])) for n in jumps(time, values)]


def _divides(channel: Channel) -> bool:
    """Return True for a depth or an angle, whose resets divide a log. Those of other positions may come often."""
    axis = channel.quantity.axis
    return axis is not None and (axis is HEAVE or axis.is_rotation)


def _jumps(file: str, channel: Channel) -> Finding | None:
    """Return a finding about the jumps of a position: resets of a filter or of a sensor."""
    if not (resets := _resets(channel)):
        return None
    axis, (factor, unit) = channel.quantity.axis, in_degrees(channel.quantity.unit)
    steps = factor * np.diff(np.interp(resets, *channel.unwrapped)).ravel()
    told = [
        f"{step:+.3g} {unit} at {end - channel.time[0]:.4g} s" for step, (_, end) in zip(steps, resets, strict=True)
    ]
    words = ", ".join(first_of(told, MOST)) + _ANOTHER * _divides(channel)
    name = axis.name if axis else ""
    return about(file, "jumps", name, quantity=channel.quantity.name, jumps=words, count=len(resets))


def jumps(time: Array, values: Array, *, is_velocity: bool = False) -> NDArray[np.intp]:
    """Return the indices of the samples after which a quantity jumps, as by a reset of a filter or of a sensor.

    `values` are in m, rad or m/s, without jumps of a full turn. A velocity jumps by what differs from the acceleration
    around it, which may be as large where a command changes.
    """
    from scipy.ndimage import maximum_filter, median_filter  # imported here because it is slow

    steps = np.diff(values)
    if len(values) < LEAST_SAMPLES or not steps.any():
        return np.zeros(0, np.intp)
    rates = steps / np.diff(time)
    usual = (_FASTER_VELOCITY if is_velocity else _FASTER) * np.quantile(np.abs(rates), 0.95)
    least = max(_LEAST_JUMP, _FASTER * float(np.median(np.abs(steps[steps != 0.0]))))
    if is_velocity:
        rates = rates - median_filter(rates, _AROUND, mode="nearest")
        steps = rates * np.diff(time)
        values = np.append(0.0, np.cumsum(steps))
    rates = np.abs(rates)
    beside = _FASTER * maximum_filter(rates, footprint=[1, 0, 1], mode="constant")
    sudden = (np.abs(steps) > least) & (rates > np.maximum(beside, usual))
    around = np.pad(median_filter(values, 3, mode="nearest"), 1, "edge")
    return np.flatnonzero(sudden & (np.abs(around[3:] - around[:-3]) > 0.5 * np.abs(steps)))


# ---- Frozen sensors --------------------------------------------------------------------------------------------------


def _without_frozen(file: str, channels: Sequence[Channel]) -> tuple[list[Channel], list[Finding]]:
    """Return the channels without the values of sensors that froze together, and a finding about these.

    A single constant sensor may be right: for example the depth at the surface, or a coarse heading at rest.
    """
    used = [channel for channel in channels if not channel.unused and len(channel.time)]
    first = min((float(channel.time[0]) for channel in used), default=0.0)
    last = max((float(channel.time[-1]) for channel in used), default=0.0)
    frozen = {channel: at for channel in used if (at := _frozen_from(channel, last - first)) is not None}
    groups = ({c: at for c, at in frozen.items() if start <= at <= start + _TOGETHER} for start in frozen.values())
    together = max(groups, key=len, default={})
    names = [channel.quantity.name for channel in together]
    if len({*names}) < 2:
        return [*channels], []
    kept = [replace(c, values=np.where(c.time < together.get(c, np.inf), c.values, np.nan)) for c in channels]
    start = min(together.values()) - first
    return kept, [about(file, "frozen sensors", sensors=listed(names), start=start, end=last - first)]


def _frozen_from(channel: Channel, duration: float) -> float | None:
    """Return the time after which a sensor with visible noise keeps its last value exactly, or None."""
    time, values = channel.samples
    steps = np.diff(values)
    start = int(np.max(np.flatnonzero(steps), initial=-1)) + 1
    if start < LEAST_SAMPLES or time[-1] - time[start] <= max(_LEAST_TIME, _LEAST_SHARE * duration):
        return None
    return float(time[start]) if _is_noisy(steps[:start]) else None


def _is_noisy(steps: Array) -> bool:
    """Return True if the noise of a sensor is visible. Without noise, a slow motion in coarse steps may simply have
    ended."""
    changes = steps[steps != 0.0]
    sizes = np.abs(changes)
    turning = np.count_nonzero(changes[1:] * changes[:-1] < 0.0)
    changing = len(changes) >= _CHANGING * len(steps) and turning >= _TURNING * len(changes)
    return bool(changing and np.median(sizes) > _VISIBLE * sizes.min())
