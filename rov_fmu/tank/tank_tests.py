"""A folder of tank tests and what is given beforehand (rov.toml), read and checked.

The name of a file, in small or capital letters, says what it holds and of which thrust curve or axis of the vehicle;
what follows an underscore is free:

    thrust_<curve>*.csv                        command, force                  bollard pull, (6)-(10)
    steady_<surge|sway|heave|yaw>*.csv         command, velocity               Tables 3-5
    time_constant_<surge|sway|heave|yaw>*.csv  command, time constant          (17), Tables 6-8
    log_<surge|sway|heave|yaw>*.csv            time, command, and distance, depth or heading, or velocity
    log_*.csv, *.bin, *.tlog                   time, commands, and the motion of several axes

Commands are those of an Axis; a command of a thrust curve is that of all thrusters that were tested together.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import FileError, did_you_mean
from rov_fmu.io.reading import read_bytes
from rov_fmu.model.layout import AXES, Axis, Layout
from rov_fmu.tank.given import ROV_FILE, Said, read_said
from rov_fmu.tank.logs import read_log
from rov_fmu.tank.narrowing import Given, Tested, narrowed
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.tables import Row, read_rows
from rov_fmu.vehicle.vehicle import VehicleFileError

_KINDS = ("thrust", "steady", "time_constant", "log")
"""What the name of a file begins with."""
_LOGS = (".bin", ".tlog")


@dataclass(frozen=True)
class TankTests:
    """All tests of a folder."""

    folder: Path
    given: Given
    thrust: Mapping[str, tuple[Row, ...]]
    """By curve of the vehicle."""
    steady: Mapping[str, tuple[Row, ...]]
    """By axis, as the next two."""
    time_constants: Mapping[str, tuple[Row, ...]]
    recordings: Mapping[str, tuple[Recording, ...]]
    inputs: Mapping[str, str]
    """SHA-256 of every file read, by its name."""
    notes: tuple[str, ...] = ()
    """What was left out of the vehicle and of the files, in sentences."""


def load_tank_tests(folder: Path, check_inputs: Callable[[Sequence[Path]], None] = lambda _: None) -> TankTests:
    """Read a folder. Raises DataFileError, VehicleFileError with a line for everything that is wrong.

    `check_inputs` is called with every file that the identification reads, before any test is read.
    """
    if not folder.is_dir():
        what = "is a file, and must be a folder" if folder.exists() else "there is no such folder"
        raise DataFileError(f"{folder}: {what} with {ROV_FILE} and tests of a vehicle")
    said, of_vehicle = _said(folder / ROV_FILE)
    found = _Found(folder, said.layout if said else None)
    paths = sorted(path for path in folder.iterdir() if path.name.lower().endswith((".csv", *_LOGS)))
    if not paths:
        raise VehicleFileError(*of_vehicle, f"{folder}: there are no tests (*.csv, *.bin, *.tlog) in this folder")
    check_inputs([folder / ROV_FILE, *paths, *filter(None, (said.against, said.base) if said else ())])
    for path in paths:
        found.read(path)
    given, missing, notes = None, list[str](), list[str]()
    tested = found.tested(said)
    if said and (tested.axes or not found.problems):  # otherwise it is a file that cannot be read that has the axes
        given, missing, notes = narrowed(said, tested, folder)
    if problems := [*of_vehicle, *found.problems, *missing]:
        all_of_vehicle = all(line.startswith(str(folder / ROV_FILE)) for line in problems)
        raise (VehicleFileError if all_of_vehicle else DataFileError)(*problems)
    assert given
    return found.tests(given, notes)


def _said(path: Path) -> tuple[Said | None, list[str]]:
    try:
        return read_said(path)
    except VehicleFileError as error:
        if not path.exists():
            words = "No such file: it must tell the vehicle's name and what no test does, such as its mass"
            raise VehicleFileError(f"{path}: {words}") from None
        if not path.is_file():
            raise
        return None, str(error).splitlines()


# ---- Files -----------------------------------------------------------------------------------------------------------


@dataclass
class _Found:
    """What the files of a folder hold, one after the other, and what is wrong with them."""

    folder: Path
    layout: Layout | None
    """Of all that the vehicle may have; None where that is not known."""
    problems: list[str] = field(default_factory=list)
    files: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    """By kind of test and what it is of, as the next; those that cannot be read too."""
    rows: dict[tuple[str, str], list[Row]] = field(default_factory=dict)
    recordings: dict[str, list[Recording]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)

    def read(self, path: Path) -> None:
        """Read one file."""
        try:
            self.inputs[path.name] = _hash(path)
            kind, of = self._name(path)
            self.files.setdefault((kind, of), []).append(path.name)
            if kind == "log":
                self._log(path, AXES.get(of))
            else:
                self.rows.setdefault((kind, of), []).extend(read_rows(path, kind, AXES.get(of)))
        except FileError as error:
            self.problems += str(error).splitlines()

    def _log(self, path: Path, axis: Axis | None) -> None:
        if not self.layout:
            return
        log = read_log(path, self.layout, axis)
        self.notes += log.notes
        for recording in log.recordings:
            self.recordings.setdefault(recording.axis.name, []).append(recording)

    def _name(self, path: Path) -> tuple[str, str]:
        """CoefficientKind of test, and the curve or axis it is of; no axis where a log tells itself."""
        curves = [curve.name for curve in self.layout.curves] if self.layout else None
        kind, of = _parts(path.stem.lower(), curves)
        if path.suffix.lower() in _LOGS:
            kind, of = "log", of if kind == "log" else ""
        axes = [*(self.layout.kinds if self.layout else AXES)]
        known = (curves or []) if kind == "thrust" else axes
        if not (kind and path.name.isprintable()) or not (of or known):
            hint = did_you_mean(path.stem.lower().partition("_")[0], _KINDS, also={"time": "time_constant"})
            raise DataFileError(
                f"{path}: no name of a test; thrust_ begins one, then {_either(curves or ['the name of a curve'])}, or "
                f"steady_, time_constant_ or log_, then {_either(axes)}, then _ and any printable characters{hint}"
            )
        if not of and kind != "log":
            word = path.stem.lower().removeprefix(f"{kind}_").partition("_")[0]
            what = (
                f"{'a thrust curve' if kind == 'thrust' else 'an axis'} of {'this' if self.layout else 'any'} vehicle"
            )
            hint = did_you_mean(word, known)
            raise DataFileError(f"{path}: {word or repr('')} is not {what}, only {_either(known, 'and')}{hint}")
        if self.layout and of in AXES and kind != "thrust" and not self.layout.signs(AXES[of]):
            raise DataFileError(f"{path}: no thruster of the vehicle drives {of}")
        return kind, of

    def tested(self, said: Said | None) -> Tested:
        """What there are tests of."""

        def of(kind: str) -> list[str]:
            return [what for which, what in self.files if which == kind]

        def backward(kind: str, what: str) -> bool:
            low = said.windows.get(f"thrust_{what}" if kind == "thrust" else what, (-1.0, 1.0))[0] if said else -1.0
            return any(low <= row.command < 0.0 for row in self.rows.get((kind, what), ()))

        return Tested(
            {name: (self.files["thrust", name][0], backward("thrust", name)) for name in of("thrust")},
            {name: backward("steady", name) for name in of("steady")},
            of("time_constant"),
            [*filter(None, of("log")), *self.recordings],
        )

    def tests(self, given: Given, notes: Iterable[str]) -> TankTests:
        """All of it."""
        curves = {curve.name for curve in given.rov.layout.curves}

        def rows(kind: str) -> dict[str, tuple[Row, ...]]:
            return {
                of: tuple(found)
                for (which, of), found in self.rows.items()
                if which == kind and (kind != "thrust" or of in curves)
            }

        recordings = {name: tuple(found) for name, found in self.recordings.items()}
        inputs = {ROV_FILE: _hash(self.folder / ROV_FILE)}
        inputs |= {given.base_name: _hash(given.base)} if given.base else {}
        parts = rows("thrust"), rows("steady"), rows("time_constant"), recordings
        return TankTests(self.folder, given, *parts, inputs | self.inputs, (*notes, *self.notes))


def _parts(stem: str, curves: Iterable[str] | None) -> tuple[str, str]:
    """What the name of a file says: kind of test, and the longest name of a curve or axis that follows, if any.

    Without curves any name may be that of one.
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
    return hashlib.sha256(read_bytes(path, DataFileError)).hexdigest()
