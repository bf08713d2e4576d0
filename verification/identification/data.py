"""What all methods get: recordings of a vehicle, split into training and test, and what its owner tells in rov.toml.

Every method reads the same samples, with the times, units and frames that this project's readers give them.
"""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.given import Tests
from rov_fmu.identify.likelihood.hypotheses import applied
from rov_fmu.identify.likelihood.objective import Objective, TableRow
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import SampledLog, recorded
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.toml_file import read_toml
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.folder import file_hash, read_folder

PARTS = ("training", "test")

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


@dataclass(frozen=True, eq=False)
class Split:
    """A data set as the methods get it."""

    name: str
    tests: Tests
    """The folder of the training, as `rov-fmu identify` reads it."""
    known: Prior
    """What is known before any recording of the training is fitted."""
    rows: Sequence[TableRow]
    training: Sequence[SampledLog]
    test: Sequence[SampledLog]
    truth: Truth


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
    return Split(data_set.name, tests, known, rows, logs, acting, data_set.truth)
