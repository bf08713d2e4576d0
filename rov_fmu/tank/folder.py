"""Read and check a folder of tank tests with its rov.toml.

The name of a file, in small or capital letters, gives the kind of test and the tested thrust curve or axis. Any text
may follow after another underscore, and any suffix:

    thrust_<curve>*.csv                        command, force                  bollard pull, (6)-(10)
    steady_<surge|sway|heave|yaw>*.csv         command, velocity               Tables 3-5
    time_constant_<surge|sway|heave|yaw>*.csv  command, time constant          (17), Tables 6-8
    log_<surge|sway|heave|yaw>*.csv            time, command, and distance, depth or heading, or velocity
    any other log (rov_fmu/tank/read_log.py)   time, commands, and the motion of several axes

A bag of ROS 2 may be in a folder of its own. The files of the tables [dives] of rov.toml may have any names.

A command is that of an axis, or, in a test of a thrust curve, that of all thrusters that were tested together.
"""

import hashlib
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.units import in_degrees
from rov_fmu.io.csv_table import DataFileError, UnreadableFileError
from rov_fmu.io.file_kinds import OWN_SUFFIXES, TESTS, check_suffix
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import FileError, brief, did_you_mean, lines_on, listed, only
from rov_fmu.io.reading import open_file
from rov_fmu.io.toml_file import join_names, key_line
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.channels import in_body_frame, with_one_source
from rov_fmu.tank.columns import COMMAND, TABLES, TIME, ColumnNames, columns_of, has_column, names_of
from rov_fmu.tank.description import (
    NO_ROV_FILE,
    ROV_FILE,
    UNUSED,
    Dive,
    Draft,
    Requests,
    RovFile,
    read_rov_file,
)
from rov_fmu.tank.findings import Finding, about, sentences
from rov_fmu.tank.log import Channel, Commands, Log
from rov_fmu.tank.quality import checked_log, uninterrupted
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.listing import NOT_OPENED, Listing, has_usual_suffix, is_bag, list_files
from rov_fmu.tank.readers.parsers import header_of, one_parser
from rov_fmu.tank.readers.tank_tables import Row, read_rows
from rov_fmu.tank.rest import USUAL_HEIGHT, without_rests
from rov_fmu.vehicle.quantity import Quantity
from rov_fmu.vehicle.vehicle import VehicleFileError

KINDS = (*TABLES, "log")
"""The words that the name of a file begins with."""
_PIECE = 2**20
"""The number of bytes that are hashed at a time: a file may be larger than the memory."""
_LACKING = {
    "columns": "no CSV file has such a column",
    "topics": "no log has such a topic and field",
    "valid": "no log has such a column or field",
    "leave_out": "there is no such log",
}
"""What is wrong with a name in a table of rov.toml that no file has."""
_DAY = 86400.0
_LOADS = "The vehicle has these loads as inputs, and neither thrusters nor their lag"
_OWN_THRUSTERS = f"The vehicle has the thrusters of {ROV_FILE} as inputs, whose thrust and lag these logs do not tell"


@dataclass
class Folder:
    """The tests in a folder, and the mistakes in its files."""

    path: Path
    rov_file: RovFile
    names: ColumnNames = field(default_factory=ColumnNames)
    """The tables of rov.toml that explain logs."""
    files: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    """The names of files by kind of test and by curve or axis, including files that cannot be read."""
    rows: dict[tuple[str, str], list[Row]] = field(default_factory=dict)
    """The rows of tables by kind of test and by curve or axis."""
    logs: list[Log] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    """The SHA3-256 of each file by its name."""
    findings: list[Finding] = field(default_factory=list)
    mistakes: list[str] = field(default_factory=list)
    """A line for every mistake in a file of tests."""
    unreadable: list[str] = field(default_factory=list)
    """A line for every log that cannot be read. They are mistakes only if nothing else is left, or if there are other
    mistakes, which may follow from them."""
    rov_file_mistakes: list[str] = field(default_factory=list)
    """A line for every mistake in rov.toml."""
    originals: dict[tuple[str, ...], str] = field(default_factory=dict)
    """The first file (or the files of the first dive) with each content, by kind and hash."""
    known: set[str] = field(default_factory=set)
    """The keys that the tables [columns], [topics] and [valid] may have."""

    @property
    def layout(self) -> Layout | None:
        """The largest layout that the vehicle can have; None where it is unknown."""
        return self.rov_file.layout

    @property
    def logged(self) -> Layout | None:
        """The layout with the axes that a log of several axes may measure."""
        return self.rov_file.description.logged if self.rov_file.description else None

    @property
    def voltages(self) -> list[Array]:
        """The samples of the voltage of each log that has one, V."""
        return [c.samples[1] for log in self.logs if (c := log.used("voltage"))]

    def counts(self, kind: str, subject: str, command: float) -> bool:
        """Return True if a command in a table is inside the window of rov.toml."""
        windows = self.rov_file.tables.windows
        low, high = windows.get(f"thrust_{subject}" if kind == "thrust" else subject, (-1.0, 1.0))
        return low <= command <= high

    def astern(self, kind: str) -> dict[str, bool]:
        """Return whether commands astern count in the tables of a kind, by curve or axis."""
        return {
            subject: any(
                row.command < 0.0 and self.counts(kind, subject, row.command)
                for row in self.rows.get((kind, subject), ())
            )
            for other, subject in self.files
            if other == kind
        }

    def read(self, path: Path) -> None:
        """Read one file."""
        try:
            digest = file_hash(path)
            kind, subject = self._kind_and_subject(path)
            # Two curves or axes may have equal tables: a vehicle may be as fast in surge as in sway.
            if self._is_copy(path.name, ("log", digest) if kind == "log" else (kind, subject, digest)):
                return
            self.inputs[path.name] = digest
            self.files.setdefault((kind, subject), []).append(path.name)
            axis = AXES.get(subject)
            if kind != "log":
                rows, known, told = read_rows(path, kind, axis, self.names.columns)
                self.findings += told
                self.rows.setdefault((kind, subject), []).extend(rows)
                self.known |= known
            elif layout := self.layout if axis else self.logged:
                self._add(read_logs(path, layout, self.names, axis))
        except FileError as error:
            is_table = parts_of_name(path)[0] in TABLES
            if isinstance(error, UnreadableFileError) and not is_table:
                self.unreadable += str(error).splitlines()
                self.findings.append(unreadable(path, error))
            else:
                self.mistakes += str(error).splitlines()

    def read_all(self, paths: Iterable[Path]) -> None:
        """Read some files and the dives of several files, and check their logs."""
        with one_parser():
            for path in paths:
                self.read(path)
            for dive in self.rov_file.tables.dives.values():
                self.read_dive(dive)
        if self.mistakes or not (self.logs or self.rows):
            self.mistakes += self.unreadable
        left_out = self.rov_file.tables.leave_out
        self.logs = [log.without(left_out.get(log.whole_file, ())) for log in self.logs]
        self.logs = [piece for log in self.logs for piece in uninterrupted(checked_log(log))]
        if self.layout and self.layout.has_wrench:
            self._relate_to_full_force()
        if (layout := self.logged) and (description := self.rov_file.description):
            own = description.base_quantities.get("height")
            height = own.value if own else USUAL_HEIGHT
            self.logs = [piece for log in self.logs for piece in without_rests(log, layout, height)]
        self.findings += [finding for log in self.logs for finding in log.findings]

    def _relate_to_full_force(self) -> None:
        """Make the forces of a wrench fractions of the largest ones in all logs, which become the vehicle's thrust."""
        description = self.rov_file.description
        assert description
        largest = dict.fromkeys(description.layout.curves_by_name, 0.0)
        for name, most in (pair for log in self.logs if log.commands for pair in log.commands.largest.items()):
            largest[name] = max(most, largest[name])
        self.logs = [replace(log, commands=log.commands and log.commands.relative_to(largest)) for log in self.logs]
        source = "The largest force in the logs"
        known = {
            curve.coefficient(key): Quantity(value=value, unit="N", source=source)
            for curve in description.layout.curves
            for key, value in (("a_t", 0.0), ("b_t", largest[curve.name] or 1.0))
        }
        self.rov_file = replace(self.rov_file, description=replace(description, known={**description.known, **known}))
        if self.logs:
            forces = ((axis.external, axis.load) for axis in description.layout.bare_axes)
            told = [f"{name} = {largest[name]:.3g} {unit}" for name, unit in forces if largest.get(name)]
            inputs = _OWN_THRUSTERS if description.thrusters else _LOADS
            self.findings.append(Finding("wrench", words={"full": listed(told) or "there is none", "inputs": inputs}))

    def read_dive(self, dive: Dive) -> None:
        """Read the files of a dive together."""
        try:
            paths = [self.path / part for part in dive.files]
            digests = dict(zip(dive.files, map(file_hash, paths), strict=True))
            if self._is_copy(join_names(dive.files), ("dive", *sorted(digests.values()))):
                return
            self.inputs |= digests
            if layout := self.logged:
                self._add([joined_dive(self.path, dive, layout, self.names)])
        except FileError as error:
            self.mistakes += str(error).splitlines()

    def _is_copy(self, name: str, content: tuple[str, ...]) -> bool:
        """Return True, and add a finding, if an earlier file has the same content. The same data must not count
        twice."""
        if content not in self.originals:
            self.originals[content] = name
            return False
        self.findings.append(about(name, "copy", original=self.originals[content]))
        return True

    def _add(self, logs: Sequence[Log]) -> None:
        """Add the pieces of a log that have commands. Raises DataFileError if none has."""
        if not any(log.commands for log in logs):
            raise DataFileError(
                f"{self.path / logs[0].file}: no commands of thrusters were found. `rov-fmu inspect` "
                "lists the content of the log. Name the commands in the table [topics] of rov.toml"
            )
        self.known = self.known.union(*(log.names for log in logs))
        self.logs += [log for log in logs if log.commands]

    def unknown_names(self) -> Iterator[str]:
        """Yield a line for each entry of [columns], [topics] and [valid] that no file has, and for each log in
        [leave_out] that is none."""
        for table, what in _LACKING.items():
            names: Mapping[str, object] = getattr(self.rov_file.tables, table)
            known = self.inputs.keys() if table == "leave_out" else self.known
            free = sorted(known - names.keys())
            for name, value in names.items():
                if name not in known:
                    yield key_line(f"{table}.{name}", f"{what}{only(name, free) if free else ''}", value)

    def missing_columns(self, requests: Requests) -> Iterator[str]:
        """Yield a line for each key of [fit] that needs a column which a log does not have."""
        for key, quantities in requests.quantities.items():
            for name in quantities:
                lacking = sorted({log.file for log in self.logs if not log.used(name)})
                if lacking or not self.logs:
                    column = f"the column {name} [{in_degrees(QUANTITIES[name].unit)[1]}]"
                    none = f"there is none in {brief(join_names(lacking))}" if lacking else "there is no log"
                    yield key_line(f"fit.{key}", f"every log must have {column}, but {none}")

    def _kind_and_subject(self, path: Path) -> tuple[str, str]:
        """Return the kind of test and its curve or axis. The axis is empty for a log of several axes. Raises
        DataFileError."""
        curves = [curve.name for curve in self.layout.curves] if self.layout else None
        kind, subject = parts_of_name(path, curves)
        if kind != "log" and path.name.isprintable() and has_log(path, kind, self.names.columns):
            kind, subject = "log", subject if subject in AXES else ""
        axes = self.layout.by_name if self.layout else AXES
        known = [*((curves or []) if kind == "thrust" else axes)]
        if not (kind and path.name.isprintable() and (subject or known)):
            subjects = [*(curves or []), *(self.logged.by_name if self.logged else AXES)]
            hint = did_you_mean(path.stem.lower().partition("_")[0], KINDS, also={"time": "time_constant"})
            # A text of another suffix may be no test at all, and its owner is only warned.
            failure = DataFileError if has_usual_suffix(path) else UnreadableFileError
            raise failure(
                f"{path}: neither a log, which has a column 'time [s]', nor a table, whose name begins with "
                f"thrust_<curve>, steady_<axis> or time_constant_<axis>, of {listed(subjects, 'or')}{hint}"
            )
        if kind != "log" and self.layout and self.layout.has_wrench:
            instead = f"{ROV_FILE} has none: write [curves.<name>] and [[thruster]]"
            if self.rov_file.tables.thruster:
                instead = "those of the logs are forces on the body, by `wrench` in [logs]: move it to another folder"
            raise DataFileError(f"{path}: its commands are of thrusters, and {instead}")
        if not subject and kind != "log":
            word = path.stem.lower().removeprefix(f"{kind}_").partition("_")[0]
            what = "a thrust curve" if kind == "thrust" else "an axis"
            whose = "this" if self.layout else "any"
            hint = did_you_mean(word, known)
            raise DataFileError(
                f"{path}: {word or repr('')} is not {what} of {whose} vehicle, only {listed(known)}{hint}"
            )
        if self.layout and subject in AXES and kind != "thrust" and not self.layout.signs(AXES[subject]):
            raise DataFileError(f"{path}: no thruster of the vehicle drives {subject}")
        return kind, subject


def folder_and_files(paths: Sequence[Path]) -> tuple[Path, list[Path]]:
    """Return the folder of tests, and the logs in it that are named; no log if the whole folder is. A bag may be named
    by its own folder. Raises DataFileError."""
    folders: dict[Path, list[Path]] = {}
    for path in paths:
        if not path.exists():
            raise DataFileError(f"{path}: there is no such file and no such folder")
        if not (path.is_dir() or path.is_file()):
            raise DataFileError(f"{path}: {NOT_OPENED}")
        if path.suffix.lower() in OWN_SUFFIXES and path.is_file():
            check_suffix(path, TESTS, DataFileError)
        is_whole_bag = path.is_dir() and is_bag(path)
        folder = path if path.is_dir() and not is_whole_bag else path.parent
        folder = folder.parent if is_bag(folder) else folder
        folders.setdefault(folder, []).extend(list_files(path).tests if is_whole_bag else [path])
    (folder, files), *others = folders.items()
    if others or (folder in files and len(paths) > 1):
        raise DataFileError(f"{paths[1]}: is not beside {paths[0]}: copy all logs of a vehicle into one folder")
    return folder, [] if folder in files else files


def read_folder(
    folder: Path,
    check_inputs: Callable[[Sequence[Path]], None] = lambda _: None,
    base: Path | None = None,
    files: Collection[Path] = (),
    draft: Draft | None = None,
) -> Folder:
    """Read a folder, or some `files` in it. Raises DataFileError or VehicleFileError if it cannot be read at all.

    `check_inputs` is called with every file that is read, before any test is read. `base` replaces that of rov.toml,
    and `draft` all of rov.toml.
    """
    rov_file = _read_description(folder, base, draft)
    if files:
        named = {file.name for file in files}
        used = {name: dive for name, dive in rov_file.tables.dives.items() if not named.isdisjoint(dive.files)}
        rov_file = replace(rov_file, tables=rov_file.tables.model_copy(update={"dives": used}))
    found = Folder(folder, rov_file, rov_file_mistakes=[*rov_file.mistakes])
    mistakes, tables, dives = found.rov_file_mistakes, rov_file.tables, rov_file.tables.dives
    own = [] if draft else [folder / ROV_FILE]
    found.inputs = {path.name: file_hash(path) for path in own}
    found.names, wrong_names = names_of(found.layout, tables)
    if wrong_names or not rov_file.explains_files:  # each file would be refused for what rov.toml should explain
        raise VehicleFileError(*mistakes, *lines_on(folder / ROV_FILE, wrong_names))
    parts = {name for dive in dives.values() for name in dive.files}
    listing = Listing(folder, [*files]) if files else list_files(folder, parts)
    paths = [path for path in listing.tests if path.name not in parts]
    if not paths and not dives:
        raise VehicleFileError(*mistakes, *listing.no_tests())
    check_inputs([*own, *paths, *(folder / part for part in parts), *([tables.base] if tables.base else [])])
    found.read_all(paths)
    found.findings += listing.findings
    unused = [key for key in UNUSED if getattr(tables, key) is not None]
    found.findings += [about(f"{key} in {ROV_FILE}", "other files", reason=UNUSED[key]) for key in unused]
    if found.mistakes:  # they may follow from files that are not read
        found.mistakes += listing.lines("unreadable file")
    if (description := rov_file.description) and not (mistakes or found.mistakes):
        mistakes += lines_on(description.path, found.unknown_names() if not files else ())
        mistakes += lines_on(description.path, found.missing_columns(description.requests))
    return found


def unreadable(path: Path, error: FileError) -> Finding:
    """Return the finding about a file that cannot be read, with the first reason."""
    first, *_ = str(error).splitlines()
    return about(path.name, "unreadable file", reason=first.removeprefix(str(path)).lstrip(":, "))


def _read_description(folder: Path, base: Path | None, draft: Draft | None) -> RovFile:
    """Read rov.toml, and explain its purpose where there is none beside tests."""
    path = folder / ROV_FILE
    try:
        return read_rov_file(path, base, draft)
    except VehicleFileError:
        if path.exists():
            raise
        listing = list_files(folder)
        if not listing.tests:
            raise DataFileError(*listing.no_tests()) from None
        words = (
            "there is no such file. It must give the vehicle's name, and everything that no test determines, "
            "such as the mass"
        )
        raise VehicleFileError(f"{path}: {words}") from None


def joined_dive(folder: Path, dive: Dive, layout: Layout, names: ColumnNames) -> Log:
    """Read the log of a dive of several files. Raises DataFileError."""
    paths = [folder / part for part in dive.files]
    logs = [log for path in paths for log in read_logs(path, layout, names, is_part=True)]
    return together(paths[0], logs, dive.other_clock)


# ---- One log ---------------------------------------------------------------------------------------------------------

_NOT_TOLD = {"missing column", "unknown direction", "time of arrival"}
"""The findings that a flight or a simulation does not need."""


def description_beside(path: Path) -> RovFile:
    """Return what the rov.toml beside a log says. Raises FileError if there is no log."""
    with open_file(path):
        described = path.parent / ROV_FILE
        return read_rov_file(described) if described.exists() else NO_ROV_FILE


def one_log(path: Path, layout: Layout, rov_file: RovFile, *, is_part: bool = False) -> Log:
    """Return a log up to the first restart of its clock, and warn of what is left out. Raises FileError.

    Of a dive of several files, all are read, whichever is named. `is_part` is true where a log of commands alone will
    do. The tables [columns], [topics], [valid], [dives] and [logs] of the rov.toml beside the log are obeyed.
    """
    names, wrong = names_of(layout, rov_file.tables)
    if wrong or not rov_file.explains_files:
        raise VehicleFileError(*(lines_on(path.parent / ROV_FILE, wrong) or rov_file.mistakes))
    dives = [dive for dive in rov_file.tables.dives.values() if path.name in dive.files]
    if dives:
        log, others = joined_dive(path.parent, dives[0], layout, names), []
    else:
        log, *others = read_logs(path, layout, names, axis_in_name(path), is_part=is_part)
    told = [f"{path}: only the part before the clock restarts is used"] * bool(others)
    for sentence in (*told, *sentences(f for f in log.findings if f.kind not in _NOT_TOLD)):
        warnings.warn(sentence, UserWarning, stacklevel=4)
    return log


# ---- Files -----------------------------------------------------------------------------------------------------------


def together(path: Path, logs: Sequence[Log], other_clock: Collection[str] = ()) -> Log:
    """Return the log of a dive of several files, of which one has the commands. Raises DataFileError.

    If the times of a file, or of files that the same sensors wrote one after the other, do not overlap with those of
    the commands, the first sample is moved to the first command.
    """
    commanding = [log for log in logs if log.commands]
    if len(commanding) != 1:
        which = join_names(log.file for log in commanding) or "none"
        raise DataFileError(
            f"{path}: exactly one file of the dive must have the commands. The files with commands are: {which}"
        )
    commands = commanding[0].commands
    assert commands
    parts, channels = list[Log](), list[Channel]()
    for group in _by_sensor(logs):
        is_other = any(log.file in other_clock for log in group)
        moved = group if group[0].commands else _on_clock(group, commands, is_other=is_other)
        parts += moved
        own = grouped(
            ((c.quantity.name, c.source, c.derived_from), (log.file, c)) for log in moved for c in log.channels
        )
        channels += [_one_after_another(pairs) for pairs in own.values()]
    return replace(
        commanding[0],
        start=min(log.begin for log in parts),
        channels=tuple(with_one_source(in_body_frame(channels))),
        findings=tuple(finding for log in parts for finding in log.findings),
        names=frozenset().union(*(log.names for log in parts)),
        unread={name: what for log in parts for name, what in log.unread.items()},
    )


def _by_sensor(logs: Sequence[Log]) -> Iterator[Sequence[Log]]:
    """Yield the logs in groups: files without commands of the same channels, if each begins after the end of the one
    before it, are of the same sensors and have the same clock."""
    kinds = ((log.commands and log.file, frozenset((c.quantity.name, c.source) for c in log.channels)) for log in logs)
    for group in grouped(zip(kinds, logs, strict=True)).values():
        ordered = sorted(group, key=lambda log: _ends(log)[0])
        follows = all(_ends(one)[1] < _ends(other)[0] for one, other in pairwise(ordered))
        yield from [ordered] if follows else ([log] for log in group)


def _ends(log: Log) -> tuple[float, float]:
    """Return the first and the last time of what a log measures, s; the first is later if it measures nothing."""
    times = [channel.samples[0] for channel in log.channels if channel.count]
    return min((time[0] for time in times), default=inf), max((time[-1] for time in times), default=-inf)


def _one_after_another(pairs: Sequence[tuple[str, Channel]]) -> Channel:
    """Return the channel of one quantity of one sensor, whose samples are in several files, each with its name."""
    (file, first), *others = pairs
    if not others:
        return replace(first, file=file)  # the columns of a file share their times
    return replace(
        first,
        file=join_names(dict.fromkeys(name for name, _ in pairs)),
        time=np.concatenate([part.time for _, part in pairs]),
        values=np.concatenate([part.values for _, part in pairs]),
    )


def _on_clock(logs: Sequence[Log], commands: Commands, *, is_other: bool) -> Sequence[Log]:
    """Return files of a dive that share a clock on that of the commands, with a finding if it is another one.

    Of two clocks of the same time of day, one may tell no date.
    """
    starts, ends = zip(*map(_ends, logs), strict=True)
    start, end = min(starts), max(ends)
    if start > end:
        return logs
    first, last = commands.rows[0], commands.rows[-1]
    possible = (0.0, _DAY * round((first - start) / _DAY))
    overlap = next((by for by in possible if start + by <= last and first <= end + by), None)
    if overlap == 0.0 and not is_other:
        return logs
    moved = float(first - start) if overlap is None else overlap
    kind = "aligned clock" if overlap is None else "other clock"
    return [
        replace(
            log,
            start=log.begin + moved,
            channels=tuple(replace(channel, time=channel.time + moved) for channel in log.channels),
            findings=(*log.findings, about(log.file, kind)),
        )
        for log in logs
    ]


def kind_of_table(path: Path, columns: Mapping[str, str]) -> str:
    """Return the kind of the table of tank tests in a file, or an empty text for a log."""
    kind, _ = parts_of_name(path)
    return kind if kind in TABLES and not has_log(path, kind, columns) else ""


def has_log(path: Path, kind: str, columns: Mapping[str, str]) -> bool:
    """Return True if a file has a column of times, as a log has, and not what a table of this kind measures.

    `columns` is the table [columns] of rov.toml. Raises DataFileError if the name tells no kind.
    """
    try:
        titles = header_of(path)
    except DataFileError:
        if kind:
            return False  # the table is read with its mistakes
        raise
    if titles is None:
        return True
    header = [columns.get(title, title) for title in titles]
    measured = columns_of(kind) if kind else {}
    measured.pop(COMMAND, None)
    return has_column(header, {"time": TIME}) and not has_column(header, measured)


def parts_of_name(path: Path, curves: Iterable[str] | None = None) -> tuple[str, str]:
    """Split the name of a file into the kind of test and the longest curve or axis name that follows, if any.

    Without curves, any name may be that of a curve.
    """
    stem = path.stem.lower()
    for kind in KINDS:
        if (rest := stem.removeprefix(f"{kind}_")) != stem:
            names = AXES if kind != "thrust" else [rest] if curves is None else curves
            fitting = (name for name in names if f"{rest}_".startswith(f"{name.lower()}_"))
            return kind, max(fitting, key=len, default="")
    return "", ""


def axis_in_name(path: Path) -> Axis | None:
    """Return the axis that the name of a file contains."""
    return next((AXES[word] for word in path.stem.lower().split("_") if word in AXES), None)


def file_hash(path: Path, kind: str = "sha3_256") -> str:
    """Return the hash of a file, of a kind that hashlib has. Raises DataFileError."""
    digest = hashlib.new(kind)
    with open_file(path, DataFileError) as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()
