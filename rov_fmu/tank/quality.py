"""What is told about the channels of a log: their sources, sensors that froze, jumps, gaps, and its pieces."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, YAW
from rov_fmu.equation.units import in_degrees
from rov_fmu.io.messages import MOST, first_of, listed
from rov_fmu.tank.arrays import Array, Indices
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
_AROUND_JUMP = np.array([[-2, -1, 0], [1, 2, 3]])
"""The three samples before and after a jump, from the sample before it."""


def checked_log(log: Log) -> Log:
    """Return the log without the values that must be wrong, with findings about these and about doubtful channels."""
    channels, frozen = _without_frozen(log)
    findings = [*log.findings, *frozen]
    used = [channel for channel in channels if not channel.unused]
    findings += [about(log.file, "depth by pressure", by=one.derived_from) for one in used if one.derived_from]
    findings += [_jumps(log, one) for one in _resets(used)]
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
    interruption = about(log.file, "interruption", gaps=gaps_in_words(silent, log.begin))
    resets = {pair for one in _resets(log.channels) if one.divides for pair in one.times}
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
    pieces = list[Log]()
    edges = [-np.inf, *(edge for span in spans for edge in span), np.inf]
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        rows = commands.rows[(commands.rows >= start) & (commands.rows <= end)]
        channels = [
            replace(
                channel, time=channel.time[at], values=channel.values[at], of_log=max(channel.of_log, channel.count)
            )
            for channel in log.channels
            if (at := (channel.time >= start) & (channel.time <= end) & channel.there).any()
        ]
        if len(rows) and (not least or rows[-1] - rows[0] > least):
            piece = replace(
                log,
                file=f"{log.whole_file} (from {start - log.begin:.4g} s)" if start > -np.inf else log.file,
                commands=Commands.of_rows(commands.thrusters, rows, commands.at(rows), commands.source),
                channels=tuple(channels),
                findings=() if pieces else (*log.findings, *why),
                start=log.begin,
            )
            pieces.append(piece)
    return pieces


def gaps_in_words(found: Sequence[tuple[float, float]], begin: float) -> str:
    """Return how long the first gaps are, and when they begin after a time, s."""
    return ", ".join(first_of([f"{end - start:.3g} s from {start - begin:.4g} s on" for start, end in found], MOST))


@dataclass(frozen=True)
class _Resets:
    """The jumps of a position or of an attitude, as by resets of a filter or of a sensor."""

    channels: Sequence[Channel]
    """One, or the angles of an attitude."""
    times: Sequence[tuple[float, float]]
    """Before and after each jump, s."""
    sizes: Sequence[float]
    """m or rad. That of an attitude is the angle by which it turns."""

    @property
    def divides(self) -> bool:
        """True for a depth and for angles, whose resets divide a log. Those of other positions may come often."""
        axis = self.channels[0].quantity.axis
        return axis is not None and (axis is HEAVE or axis.is_rotation)


def _resets(channels: Sequence[Channel]) -> Iterator[_Resets]:
    """Yield the jumps of each position that jumps.

    Angles that are measured at the same times are one attitude, because roll and heading change by half a turn where
    the bow passes through the vertical, although the vehicle hardly turns.
    """
    groups: dict[tuple[str, bytes], list[Channel]] = {}
    for channel in channels:
        if not channel.unused and channel.quantity.unit in ("m", "rad"):
            name = channel.quantity.unit if channel.quantity.unit == "rad" else channel.quantity.name
            groups.setdefault((name, channel.samples[0].tobytes()), []).append(channel)
    for group in groups.values():
        time, values = group[0].unwrapped
        path: Array | Rotation = values
        if len(group) > 1 and len(time):
            angles = {channel.quantity.axis: channel.samples[1] for channel in group}
            ordered = [angles.get(axis, np.zeros(len(time))) for axis in (YAW, PITCH, ROLL)]
            path = Rotation.from_euler("ZYX", np.column_stack(ordered))
        at = jumps(time, path)
        if len(at):
            steps = _steps(path, at, at + 1)
            sizes = np.linalg.norm(steps, axis=-1) if isinstance(path, Rotation) else steps[:, 0]
            yield _Resets(group, [*zip(time[at].tolist(), time[at + 1].tolist(), strict=True)], sizes.tolist())


def _jumps(log: Log, resets: _Resets) -> Finding:
    """Return a finding about the jumps of a position or of an attitude."""
    channel, *others = resets.channels
    axis, (factor, unit) = channel.quantity.axis, in_degrees(channel.quantity.unit)
    sign = "" if others else "+"
    told = [
        f"{factor * size:{sign}.3g} {unit} at {end - log.begin:.4g} s"
        for size, (_, end) in zip(resets.sizes, resets.times, strict=True)
    ]
    words = ", ".join(first_of(told, MOST)) + _ANOTHER * resets.divides
    quantity, name = ("attitude", "") if others else (channel.quantity.name, axis.name if axis else "")
    return about(log.file, "jumps", name, quantity=quantity, jumps=words, count=len(resets.times))


def jumps(time: Array, path: Array | Rotation) -> Indices:
    """Return the indices of the samples after which a quantity jumps, as by a reset of a filter or of a sensor.

    `path` is in m, rad or m/s, without jumps of a full turn, or it has attitudes.
    """
    from scipy.ndimage import maximum_filter  # imported here because it is slow

    every = np.arange(len(time))
    steps = _steps(path, every[:-1], every[1:]) if len(time) else np.zeros((0, 1))
    if len(time) < LEAST_SAMPLES or not steps.any():
        return np.zeros(0, np.intp)
    intervals = np.diff(time)
    sizes = np.linalg.norm(steps, axis=-1)
    usual = _FASTER * np.quantile(sizes / intervals, 0.95)
    least = max(_LEAST_JUMP, _FASTER * float(np.median(sizes[sizes != 0.0])))
    rates = sizes / intervals
    beside = _FASTER * maximum_filter(rates, footprint=[1, 0, 1], mode="constant")
    sudden: Indices = np.flatnonzero((sizes > least) & (rates > np.maximum(beside, usual)))
    around = np.clip(sudden[:, None, None] + _AROUND_JUMP, 0, len(time) - 1)
    before, after = np.moveaxis(np.median(_steps(path, sudden[:, None, None], around), axis=2), 1, 0)
    stays = np.linalg.norm(after - before, axis=-1) > 0.5 * sizes[sudden]
    return np.asarray(sudden[stays])


def _steps(path: Array | Rotation, start: Indices, end: Indices) -> Array:
    """Return what is between some samples of a path: ... x 1 differences, or ... x 3 rotation vectors, rad."""
    if not isinstance(path, Rotation):
        return np.asarray((path[end] - path[start])[..., None])
    start, end = np.broadcast_arrays(start, end)
    turns = path[start.ravel()].inv() * path[end.ravel()]
    return np.asarray(turns.as_rotvec().reshape(*end.shape, 3))


# ---- Frozen sensors --------------------------------------------------------------------------------------------------


def _without_frozen(log: Log) -> tuple[list[Channel], list[Finding]]:
    """Return the channels without the values of sensors that froze together, and a finding about these.

    A single constant sensor may be right: for example the depth at the surface, or a coarse heading at rest.
    """
    used = [channel for channel in log.channels if not channel.unused and len(channel.time)]
    first = min((float(channel.time[0]) for channel in used), default=0.0)
    last = max((float(channel.time[-1]) for channel in used), default=0.0)
    frozen = {channel: at for channel in used if (at := _frozen_from(channel, last - first)) is not None}
    groups = ({c: at for c, at in frozen.items() if start <= at <= start + _TOGETHER} for start in frozen.values())
    together = max(groups, key=len, default={})
    names = [channel.quantity.name for channel in together]
    if len({*names}) < 2:
        return [*log.channels], []
    kept = [replace(c, values=np.where(c.time < together.get(c, np.inf), c.values, np.nan)) for c in log.channels]
    start, end = min(together.values()) - log.begin, last - log.begin
    return kept, [about(log.file, "frozen sensors", sensors=listed(names), start=start, end=end)]


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
