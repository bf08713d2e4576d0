"""Read logs of one test or of a whole dive, in any format, into recordings."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.file_kinds import BAG_SUFFIXES, MAVLINK_SUFFIXES, ULOG_SUFFIX
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import SENTENCES, Finding, refusals
from rov_fmu.tank.formats.bags import read_bag
from rov_fmu.tank.formats.content import Content, Wanted
from rov_fmu.tank.formats.csv_columns import Names
from rov_fmu.tank.formats.csv_log import mixed_inputs, read_csv
from rov_fmu.tank.formats.mavlink import read_mavlink
from rov_fmu.tank.formats.ulog import read_ulog
from rov_fmu.tank.frozen import without_frozen
from rov_fmu.tank.recording import CLOCK_ERROR, Recording
from rov_fmu.tank.signals import LEAST_SAMPLES, Commands, Signal, context_at, gaps_of, main_signals, recordings_of

READERS: dict[str, Callable[[Path, Wanted], Content]] = {
    **dict.fromkeys(MAVLINK_SUFFIXES, read_mavlink),
    ULOG_SUFFIX: read_ulog,
    **dict.fromkeys(BAG_SUFFIXES, read_bag),
}
"""The function that reads a log, by the suffix of the file. Other logs are CSV."""


@dataclass(frozen=True)
class Log:
    """The recordings of a log."""

    recordings: tuple[Recording, ...]
    findings: tuple[Finding, ...] = ()
    """What was left out, and why."""
    known: frozenset[str] = frozenset()
    """The keys that the tables [columns] and [topics] may have for this log."""


def read_content(path: Path, layout: Layout, names: Names) -> Content:
    """Read a log of several axes, or one file of a dive. The commands in the result are those of the thrusters.

    Raises DataFileError.
    """
    read = READERS.get(path.suffix.lower())
    if not read:
        content, _ = read_csv(path, layout, None, names, is_part=True)
        return _without_frozen(content)
    content = read(path, Wanted([t.name for t in layout.thrusters], names.topics))
    if content.commands:
        logged, named = content.commands, {"time": content.commands.time, **content.commands.thrusters}
        if layout.mix and logged.thrusters.keys() <= {*layout.commands}:
            thrusters = mixed_inputs(layout, named)
        else:
            still = np.zeros_like(logged.time)
            thrusters = {t.name: named.get(t.name, still) for t in layout.thrusters}
            missing = (name for name in thrusters if name not in named)
            content.findings += [Finding("missing column", file=path.name, names={"column": name}) for name in missing]
        content.commands = Commands(logged.time, thrusters)
    return _without_frozen(content)


def _without_frozen(content: Content) -> Content:
    """Leave out the values of sensors after they froze together, and add a finding."""
    content.signals, frozen = without_frozen(content.file, content.signals)
    content.findings += frozen
    return content


def read_log(path: Path, layout: Layout, axis: Axis | None = None, names: Names = Names()) -> Log:  # noqa: B008 (frozen)
    """Read a recording of every axis that the log measures, or only of `axis`. Raises DataFileError."""
    if path.suffix.lower() in READERS:
        content = read_content(path, layout, names)
    else:
        content, command = read_csv(path, layout, axis, names)
        content = _without_frozen(content)
        if axis and command is not None:
            recording = _recording_of_axis(path, axis, content.signals, command[1])
            return Log((recording,), (*content.findings, *gaps_of(recording)), frozenset(content.known))
    if not content.commands:
        raise DataFileError(
            f"{path}: no commands of thrusters were found. `rov-fmu identify --inspect` lists the content of "
            "the log. Name the commands in the table [topics] of rov.toml"
        )
    recordings, useless = recordings_of(path.name, layout, content.commands, content.signals, axis)
    if not recordings:
        reasons = refusals(useless, path.parent, SENTENCES) or [f"{path}: nothing measured of any axis"]
        raise DataFileError(*reasons)
    return Log(recordings, (*content.findings, *useless), frozenset(content.known))


def read_dive(paths: Sequence[Path], other_clock: Iterable[str], layout: Layout, names: Names) -> Log:
    """Read a dive of several files. One of them has the commands. Raises DataFileError.

    The recordings of a file with another clock than the commands have the name of this file as `clock`. If its times do
    not overlap with those of the commands, its first sample is moved to the first command.
    """
    contents = [read_content(path, layout, names) for path in paths]
    commanding = [content for content in contents if content.commands]
    if len(commanding) != 1:
        which = join_names(content.file for content in commanding) or "none"
        raise DataFileError(
            f"{paths[0]}: exactly one file of the dive must have the commands. The files with commands are: {which}"
        )
    (commands,) = (content.commands for content in commanding if content.commands)
    findings, signals = [], {}
    for content in contents:
        findings += content.findings
        signals[content.file] = content.signals
        times = [s.time[np.isfinite(s.values)] for s in content.signals if np.isfinite(s.values).any()]
        if content in commanding or not times:
            continue
        start, end = min(time[0] for time in times), max(time[-1] for time in times)
        overlap = start <= commands.time[-1] and commands.time[0] <= end
        if content.file in other_clock or not overlap:
            kind = "other clock" if overlap else "aligned clock"
            findings.append(Finding(kind, file=content.file, numbers={"most": CLOCK_ERROR}))
        if not overlap:
            moved = commands.time[0] - start
            signals[content.file] = [replace(signal, time=signal.time + moved) for signal in content.signals]
    clocks = {finding.file for finding in findings if finding.kind in ("other clock", "aligned clock")}
    recordings: list[Recording] = []
    for file, own in signals.items():
        others = [signal for other, found in signals.items() if other != file for signal in found]
        found, useless = recordings_of(file, layout, commands, own, others=others)
        recordings += [replace(recording, clock=file if file in clocks else "") for recording in found]
        findings += useless
    if not recordings:
        reasons = [finding for finding in findings if finding.axis]
        raise DataFileError(*refusals(reasons, paths[0].parent, SENTENCES) or [f"{paths[0]}: nothing measured"])
    return Log(tuple(recordings), tuple(findings), frozenset().union(*(content.known for content in contents)))


def _recording_of_axis(path: Path, axis: Axis, signals: Sequence[Signal], command: Array) -> Recording:
    """Return the recording of an axis whose thrusters follow one command. Raises DataFileError."""
    (signal,) = main_signals(signals, axis)
    if (count := int(np.isfinite(signal.values).sum())) < LEAST_SAMPLES:
        raise DataFileError(f"{path}: {count} samples of {signal.quantity}, at least {LEAST_SAMPLES} are needed")
    time, context = signal.time - signal.time[0], context_at(signal.time, signals)
    return Recording(path.name, axis, signal.quantity, time, command, signal.unwrapped(), context=context)
