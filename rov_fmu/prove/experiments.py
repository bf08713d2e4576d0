"""Read the experiments in an unpacked FMU of any exporter. Their format is the layered standard FMI-LS-REF."""

import posixpath
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from io import StringIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lxml import etree

from rov_fmu.fmu.archive import MANIFEST
from rov_fmu.io.csv_table import Series, finite, read_series
from rov_fmu.io.messages import FileError, shown
from rov_fmu.io.reading import check_size, root_of_xml

DEFAULT_TOLERANCE = 1e-3
"""The tolerance if neither the experiment nor the FMU has one."""
DEFAULT_STEPS = 500
"""The number of communication steps if neither the experiment nor the FMU has a step size."""
MOST_STEPS = 1_000_000
"""The largest number of communication steps of an experiment. FMPy needs minutes for this number."""
_MOST_EXPERIMENTS = 1000
_MOST_BYTES = 20_000_000
"""The largest size of a file of the experiments."""
_NON_NUMERIC = ("String", "Binary", "Clock")
"""The types whose variables cannot be columns of numbers."""


class NoResultsError(FileError):
    """An FMU without expected results."""


@dataclass(frozen=True)
class Experiment:
    """A simulation to run, and the expected results."""

    name: str
    start: float
    stop: float
    step: float
    tolerance: float
    parameters: Mapping[str, str]
    stimuli: Series | None
    references: Series | None


@dataclass(frozen=True)
class _Member:
    """A file in the FMU."""

    fmu: Path
    folder: Path
    path: str

    def __str__(self) -> str:
        return f"{self.fmu}: {self.path}"

    def error(self, reason: str) -> FileError:
        return FileError(f"{self}: {reason}")

    def number(self, text: str, what: str) -> float:
        """Return a text in this file as a finite number. Raises FileError, which says what it is the text of."""
        try:
            return finite(text)
        except ValueError as error:
            raise self.error(f"{what} = {shown(text)}: {error}") from error

    def resolve(self, source: str | None) -> "_Member":
        """Return the file to which a relative URI in this file leads."""
        try:
            parts = urlsplit(source or "")
        except ValueError:
            parts = urlsplit("")
        path = posixpath.normpath(posixpath.join(posixpath.dirname(self.path), unquote(parts.path)))
        is_outside = path.startswith(("..", "/")) or any(c in path for c in "\\:\0")
        if not parts.path or parts.scheme or parts.netloc or is_outside:
            raise self.error(f"source = {shown(source)} does not lead to a file in the FMU")
        return replace(self, path=path)

    def text(self) -> str:
        """Return the text in this file. Raises FileError."""
        path = self.folder / self.path
        if not path.is_file():
            raise self.error("there is no such file in the FMU")
        check_size(f"{self}:", path.stat().st_size, _MOST_BYTES)
        try:
            return path.read_bytes().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise self.error(f"is not UTF-8 text, at byte {error.start}") from error

    def xml(self, root: str) -> Any:
        """Return the root element of this file, which must have the name `root`."""
        content = self.text().encode()
        try:
            element = root_of_xml(content)
        except ValueError as error:
            raise self.error(str(error)) from error
        if (name := etree.QName(element).localname) != root:
            raise self.error(f"must begin with <{root}>, and not with <{name}>")
        return element


def read_experiments(fmu: Path, folder: Path, description: Any) -> list[Experiment]:
    """Return all experiments in an unpacked FMU except those of uncertainty analyses.

    `description` is FMPy's description of the FMU. Raises FileError, which names the FMU by the path `fmu`.
    """
    manifest = _Member(fmu, folder, MANIFEST)
    if not Path(folder, MANIFEST).is_file():
        reason = "the FMU carries no reference results, as those that `rov-fmu system` makes for a plan"
        raise NoResultsError(f"{manifest}: there is no such file: {reason}")
    reader = _Reader(description)
    experiments = list[Experiment]()
    for related in manifest.xml("fmiReferences").iterfind("{*}Related"):
        role, _, purpose = related.get("role", "").partition("/")
        if role == "experiment" and purpose != "uncertainty-analysis":
            experiments += reader.read(manifest.resolve(related.get("source")))
    if len(experiments) > _MOST_EXPERIMENTS:
        raise manifest.error(f"names {len(experiments)} experiments; at most {_MOST_EXPERIMENTS} are run")
    if not any(experiment.references for experiment in experiments):
        raise NoResultsError(f"{manifest}: names no experiment with expected results")
    return experiments


class _Reader:
    """The files of the experiments of an FMU. All methods raise FileError."""

    def __init__(self, description: Any) -> None:
        """`description` is FMPy's description of the FMU."""
        self._variables, self._default = {v.name: v for v in description.modelVariables}, description.defaultExperiment
        self._series = cache(self._read_series)
        """Returns the content of a CSV file, which many experiments may have."""

    def read(self, member: _Member) -> Iterator[Experiment]:
        """Read a file of experiments."""
        root = member.xml("Experiments")
        for element in root.iterfind("{*}Experiment"):
            name = element.get("name", "")
            where = f"experiment {shown(name)}"
            parts = {etree.QName(child).localname: child for child in element if isinstance(child.tag, str)}
            parts.pop("Annotations", None)
            if unknown := parts.keys() - {"TransientSimulation", "Parameters", "Stimuli", "References"}:
                raise member.error(f"{where}: {', '.join(sorted(unknown))} cannot be run")
            # drafts after 1.0.0-beta.1 have the times in a child element
            given = {**element.attrib, **getattr(parts.pop("TransientSimulation", None), "attrib", {})}
            numbers = {
                key: member.number(str(text), f"{where}: {key}")
                for key in ("startTime", "stopTime", "stepSize", "tolerance")
                if (text := given.get(key, getattr(self._default, key, None))) is not None
            }
            start = numbers.get("startTime", 0.0)
            stop = numbers.get("stopTime", start + 1.0)
            step = numbers.get("stepSize", (stop - start) / DEFAULT_STEPS)
            tolerance = numbers.get("tolerance", DEFAULT_TOLERANCE)
            if reason := _why_not_run(start, stop, step, tolerance):
                raise member.error(f"{where}: {reason}")
            files = {part: member.resolve(one.get("source")) for part, one in parts.items()}
            parameters = self._parameters(files["Parameters"]) if "Parameters" in files else {}
            stimuli, references = (
                self._series(files[part]) if part in files else None for part in ("Stimuli", "References")
            )
            yield Experiment(name, start, stop, step, tolerance, parameters, stimuli, references)

    def _parameters(self, member: _Member) -> dict[str, str]:
        """Read a parameter set in the format of SSP, and return its values as text by name."""
        values = {}
        for element in member.xml("ParameterSet").iter("{*}Parameter"):
            name, value = element.get("name", ""), next(iter(element), None)
            if not (variable := self._variables.get(name)):
                raise member.error(f"the FMU has no variable {shown(name)}")
            if value is None or (text := value.get("value")) is None:
                raise member.error(f"parameter {shown(name)}: has no value")
            if (unit := value.get("unit")) not in (None, variable.unit):
                raise member.error(f"parameter {shown(name)}: is in {unit}, and not in {variable.unit}")
            values[name] = text
            if variable.type not in ("String", "Boolean"):
                member.number(text, f"parameter {shown(name)}")
        return values

    def _read_series(self, member: _Member) -> Series:
        """Read a CSV file whose first column is the time and whose other columns are variables of the FMU."""

        def why_wrong(name: str) -> str | None:
            if not (variable := self._variables.get(name)):
                return "the FMU has no such variable"
            if variable.type in _NON_NUMERIC or getattr(variable, "dimensions", None):
                return "the variable is not a single number"
            return None

        return read_series(str(member), why_wrong, partial(StringIO, member.text(), newline=""))


def _why_not_run(start: float, stop: float, step: float, tolerance: float) -> str:
    """Return why an experiment with these settings is not run, or an empty text."""
    steps = (stop - start) / step if step > 0.0 else 0.0
    if not (steps > 0.0 and tolerance > 0.0):
        return "must go on from its start, in steps, with a tolerance"
    if tolerance >= 1.0:
        return f"tolerance = {tolerance:g}: must be less than 1, or nothing would be compared"
    if steps > MOST_STEPS:
        length = f"from {start:g} to {stop:g} s; at most {MOST_STEPS} are run"
        return f"stepSize = {step:g} s takes {steps:.3g} steps {length}"
    return ""
