"""What all methods get: recordings of a vehicle, split into training and test, and what its owner tells in rov.toml.

Every method reads the same samples, with the times, units and frames that this project's readers give them, and the
same thrust along each axis, computed from the commands by the thrust curves and the geometry of rov.toml.
"""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.given import Tests
from rov_fmu.identify.likelihood.hypotheses import applied
from rov_fmu.identify.likelihood.objective import Objective, TableRow
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import SampledChannel, SampledLog, recorded
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.toml_file import read_toml
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.folder import file_hash, read_folder
from rov_fmu.vehicle.vehicle import Vehicle

STEP = 0.05
"""The step of the grid on which simple methods simulate, s."""
_WINDOW = 0.5
"""The state at an instant is the end of straight lines through the samples of this time before it, s."""
PARTS = ("training", "test")
_NAMES = ("columns", "topics", "dives")
"""The tables of rov.toml that only say what the columns of the recordings mean."""

Truth = Mapping[tuple[str, str], float]
"""True numbers by axis and name: ("surge", "V_ss 30 %")."""


class DataSet(Protocol):
    """Recordings of one vehicle with a fixed split."""

    @property
    def name(self) -> str:
        """The name of the data set."""

    @property
    def truth(self) -> Truth:
        """The true coefficients, where they are known."""

    @property
    def idle(self) -> Mapping[str, float]:
        """How long no command acts in some test recordings, s after the first row of commands."""

    def write(self, part: str, data: Path | None, folder: Path) -> None:
        """Write rov.toml and the recordings of a part (training or test) to a folder. Raises DataFileError."""


@dataclass(frozen=True)
class Recorded:
    """Public measurements, of which the user has a copy."""

    name: str
    origin: str
    """The repository and the folder with the files."""
    rov: str
    """The text of rov.toml."""
    recordings: Mapping[str, Mapping[str, str]]
    """By recording, in the order of time: its files with their SHA-256."""
    tables: Mapping[str, str] = field(default_factory=dict)
    """The texts of tables of tank tests by file."""
    truth: Truth = field(default_factory=dict)
    idle: Mapping[str, float] = field(default_factory=dict)

    def of_part(self, part: str) -> list[str]:
        """Return the names of the recordings of a part: every third one is for the test."""
        return [name for n, name in enumerate(self.recordings) if (n % 3 == 2) == (part == "test")]

    def write(self, part: str, data: Path | None, folder: Path) -> None:
        """Write rov.toml and copies of the recordings of a part. Raises DataFileError about a missing or other file."""
        assert data
        text = self.rov
        for name in self.of_part(part):
            files = self.recordings[name]
            for file, expected in files.items():
                shutil.copyfile(self._found(data, file, expected), folder / file)
            if len(files) > 1:
                text += f"\n[dives.{name}]\nfiles = {[*files]}\n"
        for file, content in {ROV_FILE: text, **self.tables}.items():
            (folder / file).write_text(content, encoding="utf-8")

    def _found(self, data: Path, file: str, expected: str) -> Path:
        """Return the file with this name and this SHA-256 anywhere in a folder."""
        paths = sorted(data.rglob(file)) or [data / file]
        found = {file_hash(path, "sha256"): path for path in paths}
        if expected not in found:
            wrong = f"has the SHA-256 {next(iter(found))[:12]}... and must have {expected[:12]}..."
            raise DataFileError(f"{paths[0]}: {wrong}, that of the file of {self.origin}")
        return found[expected]


def published(folder: Path) -> Recorded:
    """Return the recordings that a folder describes: recordings.toml, rov.toml, and tables of tank tests."""
    told = read_toml(folder / "recordings.toml", DataFileError)
    rov = (folder / ROV_FILE).read_text(encoding="utf-8")
    tables = {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.csv"))}
    return Recorded(folder.name, told["origin"], rov, told["recordings"], tables, idle=told.get("idle", {}))


# ---- Recordings ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording, with the thrust along each axis by rov.toml."""

    log: SampledLog
    axes: Sequence[Axis]
    pushes: Array
    """m x axes: the thrust from each row of the log's commands on, N or N m."""

    @property
    def name(self) -> str:
        return self.log.log.file

    @property
    def channels(self) -> Sequence[SampledChannel]:
        return self.log.measured

    @cached_property
    def grid(self) -> Array:
        """Times from the first to the last sample, s."""
        time = self.log.record.time
        return np.asarray(np.arange(time[0], time[-1] + STEP, STEP))

    def forces(self, time: Array) -> Array:
        """Return the thrust along each axis at some times, times x axes."""
        row = np.searchsorted(self.log.record.told, time, side="right") - 1
        return np.asarray(np.where(row[..., None] < 0, 0.0, self.pushes[np.maximum(row, 0)]))

    def samples(self, axis: Axis, *, is_velocity: bool) -> tuple[Array, Array] | None:
        """Return the times and the values of the sensor of a motion, or None."""
        record = self.log.record
        for n, sensor in enumerate(record.sensors):
            if sensor.axis is axis and sensor.is_velocity == is_velocity:
                own = record.sensor == n
                return record.time[own], record.value[own]
        return None

    def state(self, instant: float) -> tuple[Array, Array]:
        """Return the position and the velocity of each axis at an instant, by the samples before it."""
        found = np.zeros((2, len(self.axes)))
        for n, axis in enumerate(self.axes):
            for is_velocity in (False, True):
                if samples := self.samples(axis, is_velocity=is_velocity):
                    value, slope = _line(*samples, instant)
                    found[int(is_velocity), n] = value
                    if not is_velocity:
                        found[1, n] = slope
        return found[0], found[1]


def _line(time: Array, values: Array, instant: float) -> tuple[float, float]:
    """Return the end and the slope of a straight line through the last samples before an instant."""
    end = int(np.searchsorted(time, instant))
    begin = max(min(int(np.searchsorted(time, instant - _WINDOW)), end - 2), 0)
    t, y = time[begin:end] - instant, values[begin:end]
    if len(t) < 3:
        return (float(y[-1]), 0.0) if len(t) else (0.0, 0.0)
    slope, value = np.polyfit(t, y, 1)
    return float(value), float(slope)


@dataclass(frozen=True, eq=False)
class Split:
    """A data set as the methods get it."""

    name: str
    tests: Tests
    """The folder of the training, as `rov-fmu identify` reads it."""
    known: Prior
    """What is known before any recording of the training is fitted."""
    rows: Sequence[TableRow]
    training: Sequence[Recording]
    test: Sequence[Recording]
    truth: Truth
    edits: Mapping[bool, int]
    """How many values a person entered into rov.toml: True, all of them; False, those that say what columns mean."""

    def push(self, axis: Axis, command: float) -> float:
        """Return the thrust along an axis for its command by rov.toml, N or N m."""
        vehicle = Vehicle(self.known.layout, self.known.coefficients)
        return vehicle.force(axis, command)


def split_of(data_set: DataSet, data: Path | None, into: Path) -> Split:
    """Read a data set by way of a folder for each part. Raises DataFileError and VehicleFileError."""
    folders = {part: into / data_set.name.replace(" ", "_") / part for part in PARTS}
    for part, folder in folders.items():
        folder.mkdir(parents=True)
        data_set.write(part, data, folder)
    tests = load_tests(folders["training"])
    known, logs, rows = begin(tests)
    unseen = [found for log in read_folder(folders["test"]).logs if (found := recorded(log, known.layout))]
    begins = {log.log.file: log.record.told[0] + data_set.idle.get(Path(log.log.file).stem, -np.inf) for log in unseen}
    off = {("idle commands", (*begins,)): tuple((t, np.inf) for t in begins.values())}
    acting = applied(Objective.of_known(known, unseen, rows), off).logs
    training, test = ([_recording(known, log) for log in some] for some in (logs, acting))
    tables = read_toml(folders["training"] / ROV_FILE, DataFileError)
    count = {name: _leaves(value) for name, value in tables.items() if name != "vehicle"}
    names = sum(count.get(name, 0) for name in _NAMES)
    edits = {True: sum(count.values()), False: names}
    return Split(data_set.name, tests, known, rows, training, test, data_set.truth, edits)


def _recording(known: Prior, log: SampledLog) -> Recording:
    vehicle, names = log.vehicle(known.coefficients), [*log.layout.inputs]
    axes = [form.axis for form in log.layout.axes]
    rows = log.record.inputs.tolist()
    forces = [vehicle.commanded(log.layout.usual_inputs | dict(zip(names, row, strict=True))) for row in rows]
    return Recording(log, axes, np.array([[vehicle.along(axis, F) for axis in axes] for F in forces]))


def _leaves(value: object) -> int:
    """Return the number of values in a table of TOML. A quantity with its unit and its source is one value."""
    if isinstance(value, Mapping) and "value" not in value:
        return sum(map(_leaves, value.values()))
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return sum(map(_leaves, value))
    return 1
