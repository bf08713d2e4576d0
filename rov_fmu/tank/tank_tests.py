"""Read and check a folder of tank tests with its rov.toml.

The name of a file, in small or capital letters, gives the kind of test and the tested thrust curve or axis. Any text
may follow after another underscore:

    thrust_<curve>*.csv                        command, force                  bollard pull, (6)-(10)
    steady_<surge|sway|heave|yaw>*.csv         command, velocity               Tables 3-5
    time_constant_<surge|sway|heave|yaw>*.csv  command, time constant          (17), Tables 6-8
    log_<surge|sway|heave|yaw>*.csv            time, command, and distance, depth or heading, or velocity
    *.csv, *.bin, *.tlog, *.ulg,               time, commands, and the motion of several axes
    *.bag, *.db3, *.mcap

A bag of ROS 2 may be in a folder of its own. The files of the tables [dives] of rov.toml may have any names.

A command is that of an axis, or, in a test of a thrust curve, that of all thrusters that were tested together.
"""

import hashlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from rov_fmu.io.csv_table import DataFileError, find_column, read_header
from rov_fmu.io.file_kinds import LOG_SUFFIXES
from rov_fmu.io.messages import FileError, brief, did_you_mean, lines_on
from rov_fmu.io.toml_file import join_names, key_line
from rov_fmu.model.layout import AXES, Axis, Layout
from rov_fmu.tank.columns import TIME
from rov_fmu.tank.description import ROV_FILE, Description, Dive, Requests, RovFile, read_description
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.formats.csv_columns import Names, names_of
from rov_fmu.tank.logs import Log, read_dive, read_log
from rov_fmu.tank.narrowing import Given, Narrowed, Tested, narrowed
from rov_fmu.tank.recording import CONTEXT, Recording
from rov_fmu.tank.tables import TABLES, Row, read_rows
from rov_fmu.vehicle.vehicle import VehicleFileError

_KINDS = (*TABLES, "log")
"""The words that the name of a file begins with."""


@dataclass(frozen=True)
class TankTests:
    """All tests of a folder."""

    folder: Path
    given: Given
    thrust: Mapping[str, tuple[Row, ...]]
    """Forces by thrust curve."""
    steady: Mapping[str, tuple[Row, ...]]
    """Steady velocities by axis."""
    time_constants: Mapping[str, tuple[Row, ...]]
    """Time constants by axis."""
    recordings: Mapping[str, tuple[Recording, ...]]
    """Recordings by axis."""
    inputs: Mapping[str, str]
    """The SHA-256 hash of every file read, by its name."""
    tested: Tested
    """The curves and axes that the files test, including curves that the vehicle does not need."""
    findings: tuple[Finding, ...] = ()
    """What was left out of the vehicle and of the files."""

    def without(
        self, recordings: Collection[Recording], axes: Collection[str], findings: Iterable[Finding]
    ) -> "TankTests | None":
        """Return the tests without some recordings, and without all tests of some axes; the findings say why.

        Returns None where nothing is left from which a vehicle could be identified.
        """
        remaining = {
            name: kept
            for name, some in self.recordings.items()
            if name not in axes and (kept := tuple(r for r in some if r not in recordings))
        }
        # Without its recordings, an axis may have too few other tests.
        for gone in ({*axes}, {*axes, *(name for name in self.recordings if name not in remaining)}):
            tested = replace(
                self.tested,
                steady={name: back for name, back in self.tested.steady.items() if name not in gone},
                time_constants=[name for name in self.tested.time_constants if name not in gone],
                logs=[*remaining],
            )
            vehicle = narrowed(self.given.description, tested, self.folder)
            if vehicle.given and (tested.axes or tested.thrust):
                curves = {curve.name for curve in vehicle.given.rov.layout.curves}
                return replace(
                    self,
                    given=vehicle.given,
                    thrust={name: rows for name, rows in self.thrust.items() if name in curves},
                    steady={name: rows for name, rows in self.steady.items() if name not in gone},
                    time_constants={name: rows for name, rows in self.time_constants.items() if name not in gone},
                    recordings=remaining,
                    tested=tested,
                    findings=(*self.findings, *findings, *(f for f in vehicle.findings if f not in self.findings)),
                )
        return None


def kind_of_data(tests: TankTests) -> str:
    """Return what a vehicle was identified from: tank tests, a dive log, or both."""
    dives = len(_dives(tests))
    parts = ["a dive log" if dives == 1 else f"{dives} dive logs"] if dives else []
    recordings = {r.file for r in chain(*tests.recordings.values())}
    if any((tests.thrust, tests.steady, tests.time_constants, len(recordings) > dives)):
        parts.insert(0, "tank tests")
    return " and ".join(parts) or "given values"


def _dives(tests: TankTests) -> set[str]:
    """Return the recordings of dives: those of several axes, or with a command for each thruster."""
    axes: dict[str, set[str]] = {}
    for r in chain(*tests.recordings.values()):
        axes.setdefault(r.file, set()).add(r.axis.name)
    by_thrusters = {r.file for r in chain(*tests.recordings.values()) if r.thrusters}
    return {file for file, names in axes.items() if len(names) > 1} | by_thrusters


def load_tank_tests(folder: Path, check_inputs: Callable[[Sequence[Path]], None] = lambda _: None) -> TankTests:
    """Read a folder. Raises DataFileError or VehicleFileError with a line for every mistake.

    `check_inputs` is called with every file that the identification reads, before any test is read.
    """
    if not folder.is_dir():
        what = "is a file, and must be a folder" if folder.exists() else "there is no such folder"
        raise DataFileError(f"{folder}: {what} with {ROV_FILE} and tests of a vehicle")
    rov_file = _read_description(folder / ROV_FILE)
    description, description_mistakes, dives = rov_file.description, [*rov_file.mistakes], rov_file.dives
    names, wrong_names = names_of(description.layout if description else None, rov_file.columns, rov_file.topics)
    if wrong_names or not rov_file.explains_files:  # each file would be refused for what rov.toml should explain
        raise VehicleFileError(*description_mistakes, *lines_on(folder / ROV_FILE, wrong_names))
    parts = {name for dive in dives.values() for name in dive.files}
    in_folders = (path for bag in folder.glob("*/metadata.yaml") for path in bag.parent.iterdir())
    paths = sorted(
        path
        for path in (*folder.iterdir(), *in_folders)
        if path.name.lower().endswith((".csv", *LOG_SUFFIXES)) and path.name not in parts
    )
    if not paths and not dives:
        patterns = ", ".join(f"*{suffix}" for suffix in (".csv", *LOG_SUFFIXES))
        raise VehicleFileError(*description_mistakes, f"{folder}: there are no tests ({patterns}) in this folder")
    named_vehicles = (description.against, description.base) if description else ()
    check_inputs([folder / ROV_FILE, *paths, *(folder / part for part in parts), *filter(None, named_vehicles)])
    reader = _Reader(folder, description.layout if description else None, names=names)
    if description:
        reader.logged = description.logged
    for path in paths:
        reader.read(path)
    for name, dive in dives.items():
        reader.read_dive(name, dive)
    if description and not (description_mistakes or reader.mistakes):
        description_mistakes += lines_on(description.path, reader.unknown_names(rov_file))
        description_mistakes += lines_on(description.path, reader.missing_columns(description.requests))
    vehicle = Narrowed(None)
    tested = reader.tested(description)
    # If no axis was found, it may be in a file that could not be read.
    if description and (tested.axes or not reader.mistakes):
        vehicle = narrowed(description, tested, folder)
    in_tests = [*reader.mistakes, *vehicle.test_mistakes]
    if mistakes := [*description_mistakes, *reader.mistakes, *vehicle.rov_file_mistakes, *vehicle.test_mistakes]:
        raise (DataFileError if in_tests else VehicleFileError)(*mistakes)
    assert vehicle.given
    return reader.tests(vehicle.given, tested, vehicle.findings)


def _read_description(path: Path) -> RovFile:
    """Read rov.toml, and explain its purpose where there is none."""
    try:
        return read_description(path)
    except VehicleFileError:
        if path.exists():
            raise
        words = (
            "there is no such file. It must give the vehicle's name, and everything that no test determines, "
            "such as the mass"
        )
        raise VehicleFileError(f"{path}: {words}") from None


# ---- Files -----------------------------------------------------------------------------------------------------------


@dataclass
class _Reader:
    """Reads the files of a folder one after the other, and collects their tests and mistakes."""

    folder: Path
    layout: Layout | None
    """The largest layout that the vehicle can have; None where it is unknown."""
    mistakes: list[str] = field(default_factory=list)
    files: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    """The names of files by kind of test and by curve or axis, including files that cannot be read."""
    rows: dict[tuple[str, str], list[Row]] = field(default_factory=dict)
    """The rows of tables by kind of test and by curve or axis."""
    recordings: dict[str, list[Recording]] = field(default_factory=dict)
    """Recordings by axis."""
    findings: list[Finding] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    """The hash of each file by its name."""
    originals: dict[tuple[str, ...], str] = field(default_factory=dict)
    """The first file (or the files of the first dive) with each content, by kind and hash."""
    logged: Layout | None = None
    """The layout with the axes that a log of several axes may have recordings of."""
    names: Names = field(default_factory=Names)
    known: set[str] = field(default_factory=set)
    """The keys that the tables [columns] and [topics] may have."""

    def read(self, path: Path) -> None:
        """Read one file."""
        try:
            digest = _hash(path)
            kind, subject = self._kind_and_subject(path)
            # Two curves or axes may have equal tables: a vehicle may be as fast in surge as in sway.
            if self._is_copy(path.name, ("log", digest) if kind == "log" else (kind, subject, digest)):
                return
            self.inputs[path.name] = digest
            self.files.setdefault((kind, subject), []).append(path.name)
            if kind == "log":
                self._read_log(path, AXES.get(subject))
            else:
                rows, known = read_rows(path, kind, AXES.get(subject), self.names.columns)
                self.rows.setdefault((kind, subject), []).extend(rows)
                self.known |= known
        except FileError as error:
            self.mistakes += str(error).splitlines()

    def read_dive(self, name: str, dive: Dive) -> None:
        """Read the files of a dive together."""
        try:
            key, paths = f"dives.{name}", [self.folder / part for part in dive.files]
            for other in dive.other_clock:
                if other not in dive.files:
                    reason = f"must be one of its files{did_you_mean(other, dive.files)}"
                    raise DataFileError(*self._in_rov_file(f"{key}.other_clock", reason, other))
            for part, path in zip(dive.files, paths, strict=True):
                if path.name != part or not path.is_file():
                    reason = "there is no such file in this folder"
                    raise DataFileError(*self._in_rov_file(f"{key}.files", reason, part))
            digests = dict(zip(dive.files, map(_hash, paths), strict=True))
            if self._is_copy(join_names(dive.files), ("dive", *sorted(digests.values()))):
                return
            self.inputs |= digests
            if self.logged:
                self._add(read_dive(paths, dive.other_clock, self.logged, self.names))
        except FileError as error:
            self.mistakes += str(error).splitlines()

    def _is_copy(self, name: str, content: tuple[str, ...]) -> bool:
        """Return True, and add a finding, if an earlier file has the same content. The same data must not count
        twice."""
        if content not in self.originals:
            self.originals[content] = name
            return False
        self.findings.append(Finding("copy", file=name, names={"original": self.originals[content]}))
        return True

    def _in_rov_file(self, key: str, reason: str, value: str) -> list[str]:
        return lines_on(self.folder / ROV_FILE, [key_line(key, reason, value)])

    def unknown_names(self, rov_file: RovFile) -> Iterator[str]:
        """Yield a line for each entry of [columns] and [topics] that no file has."""
        for table, names in (("columns", rov_file.columns), ("topics", rov_file.topics)):
            free = self.known - names.keys()
            for name, value in names.items():
                if name not in self.known:
                    is_header = table == "columns"
                    what = "no CSV file has such a column" if is_header else "no log has such a topic and field"
                    yield key_line(f"{table}.{name}", f"{what}{did_you_mean(name, free)}", value)

    def missing_columns(self, requests: Requests) -> Iterator[str]:
        """Yield a line for each key of [fit] that needs a column which a log does not have."""
        recordings = [recording for some in self.recordings.values() for recording in some]
        for key, columns in requests.columns.items():
            for name in columns:
                lacking = sorted({r.file for r in recordings if name not in r.context})
                if lacking or not recordings:
                    column = f"the column {name} [{CONTEXT[name].replace('rad', 'deg')}]"
                    none = f"there is none in {brief(join_names(lacking))}" if lacking else "there is no log"
                    yield key_line(f"fit.{key}", f"every log must have {column}, but {none}")

    def _read_log(self, path: Path, axis: Axis | None) -> None:
        if layout := self.layout if axis else self.logged:
            self._add(read_log(path, layout, axis, self.names))

    def _add(self, log: Log) -> None:
        self.known |= log.known
        self.findings += log.findings
        for recording in log.recordings:
            self.recordings.setdefault(recording.axis.name, []).append(recording)

    def _kind_and_subject(self, path: Path) -> tuple[str, str]:
        """Return the kind of test and its curve or axis. The axis is empty for a log of several axes. Raises
        DataFileError."""
        curves = [curve.name for curve in self.layout.curves] if self.layout else None
        kind, subject = _parts(path.stem.lower(), curves)
        if path.suffix.lower() in LOG_SUFFIXES:
            kind, subject = "log", subject if kind == "log" else ""
        axes = [*(self.layout.kinds if self.layout else AXES)]
        known = (curves or []) if kind == "thrust" else axes
        if not kind and path.name.isprintable():
            header = read_header(path)
            if not header:
                raise DataFileError(f"{path}: the file is empty")
            if self._has_times(header):
                return "log", ""
        if not (kind and path.name.isprintable()) or not (subject or known):
            hint = did_you_mean(path.stem.lower().partition("_")[0], _KINDS, also={"time": "time_constant"})
            listed = [*(curves or []), *(self.logged.kinds if self.logged else axes)]
            raise DataFileError(
                f"{path}: neither a log, which has a column 'time [s]', nor a table, whose name begins with "
                f"thrust_<curve>, steady_<axis> or time_constant_<axis>, of {_either(listed)}{hint}"
            )
        if not subject and kind != "log":
            word = path.stem.lower().removeprefix(f"{kind}_").partition("_")[0]
            what = "a thrust curve" if kind == "thrust" else "an axis"
            whose = "this" if self.layout else "any"
            hint = did_you_mean(word, known)
            raise DataFileError(
                f"{path}: {word or repr('')} is not {what} of {whose} vehicle, only {_either(known, 'and')}{hint}"
            )
        if self.layout and subject in AXES and kind != "thrust" and not self.layout.signs(AXES[subject]):
            raise DataFileError(f"{path}: no thruster of the vehicle drives {subject}")
        return kind, subject

    def _has_times(self, header: Iterable[str]) -> bool:
        """Return True if the header of a CSV file has the column of times that a log has."""
        for title in header:
            try:
                if find_column(self.names.columns.get(title, title), {"time": TIME}, others=True):
                    return True
            except ValueError:  # times without a known unit
                return True
        return False

    def tested(self, description: Description | None) -> Tested:
        """Return what the files test."""
        windows = description.windows if description else {}

        def subjects(kind: str) -> list[str]:
            return [subject for other, subject in self.files if other == kind]

        def has_backward_rows(kind: str, subject: str) -> bool:
            low, _ = windows.get(f"thrust_{subject}" if kind == "thrust" else subject, (-1.0, 1.0))
            return any(low <= row.command < 0.0 for row in self.rows.get((kind, subject), ()))

        return Tested(
            {name: (self.files["thrust", name][0], has_backward_rows("thrust", name)) for name in subjects("thrust")},
            {name: has_backward_rows("steady", name) for name in subjects("steady")},
            subjects("time_constant"),
            [*filter(None, subjects("log")), *self.recordings],
        )

    def tests(self, given: Given, tested: Tested, findings: Iterable[Finding]) -> TankTests:
        """Return all tests; `findings` are those about the vehicle."""
        curves = {curve.name for curve in given.rov.layout.curves}
        rows: dict[str, dict[str, tuple[Row, ...]]] = {kind: {} for kind in _KINDS}
        for (kind, subject), found in self.rows.items():
            if kind != "thrust" or subject in curves:
                rows[kind][subject] = tuple(found)
        cancelling = {finding.axis for finding in self.findings if finding.kind == "cancelling thrusters"}
        wanted = () if given.description.base else cancelling  # a base may have axes that the logs do not concern
        about = (
            Finding("axis not pushed", f.axis) if f.kind == "axis left out" and f.axis in wanted else f
            for f in findings
        )
        inputs = {ROV_FILE: _hash(self.folder / ROV_FILE)}
        if given.description.base:
            inputs[given.description.base_name] = _hash(given.description.base)
        return TankTests(
            self.folder,
            given,
            thrust=rows["thrust"],
            steady=rows["steady"],
            time_constants=rows["time_constant"],
            recordings={name: tuple(found) for name, found in self.recordings.items()},
            inputs=inputs | self.inputs,
            tested=tested,
            findings=(*about, *self.findings),
        )


def _parts(stem: str, curves: Iterable[str] | None) -> tuple[str, str]:
    """Split the name of a file into the kind of test and the longest curve or axis name that follows, if any.

    Without curves, any name may be that of a curve.
    """
    for kind in _KINDS:
        if (rest := stem.removeprefix(f"{kind}_")) != stem:
            names = AXES if kind != "thrust" else [rest] if curves is None else curves
            fitting = (name for name in names if f"{rest}_".startswith(f"{name.lower()}_"))
            return kind, max(fitting, key=len, default="")
    return "", ""


def _either(names: Iterable[str], last_word: str = "or") -> str:
    *first, last = [*names] or [""]
    return f"{', '.join(first)} {last_word} {last}" if first else last


def _hash(path: Path) -> str:
    found = hashlib.sha256()
    try:
        with path.open("rb") as file:  # in pieces, because a bag may be larger than the memory
            while piece := file.read(2**20):
                found.update(piece)
    except OSError as error:
        raise DataFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    return found.hexdigest()
