"""The experiments that an FMU carries by the layered standard FMI-LS-REF, read from the archive; any FMU's."""

import posixpath
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lxml import etree

from rov_fmu.io.messages import FileError, shown
from rov_fmu.io.time_series import Series, number, series

NAME = "org.fmi-standard.fmi-ls-ref"
FOLDER = f"extra/{NAME}"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
_LOOSE = 1e-3
"""The tolerance where neither experiment nor FMU has one."""
_STEPS = 500
"""Communication steps where nothing tells their length."""
_MOST_STEPS = 1_000_000
"""Communication steps of an experiment; FMPy takes minutes for so many."""
_NOT_READ = ("String", "Binary", "Clock")
"""Types of variables that no column of numbers holds."""


@dataclass(frozen=True)
class Experiment:
    """What is done, and what it must come to."""

    name: str
    start: float
    stop: float
    step: float
    tolerance: float
    parameters: Mapping[str, str]
    stimuli: Series | None
    references: Series | None


@dataclass(frozen=True)
class _Place:
    """A file in the FMU."""

    fmu: Path
    member: str

    def error(self, reason: str) -> FileError:
        return FileError(f"{self.fmu}: {self.member}: {reason}")

    def beside(self, source: str | None) -> "_Place":
        """What a URI in this file leads to."""
        try:
            parts = urlsplit(source or "")
        except ValueError:
            parts = urlsplit("")
        if not parts.path or parts.scheme or parts.netloc or parts.path.startswith("/"):
            raise self.error(f"source = {shown(source)} does not lead to a file in the FMU")
        return _Place(self.fmu, posixpath.normpath(posixpath.join(posixpath.dirname(self.member), unquote(parts.path))))


class Carried:
    """What an FMU that can be unpacked carries beside its model. Raises FileError."""

    def __init__(self, fmu: Path) -> None:
        self._manifest = _Place(fmu, MANIFEST)
        self._description = _Place(fmu, "modelDescription.xml")
        try:
            self._archive = zipfile.ZipFile(fmu)
        except zipfile.BadZipFile as error:
            raise FileError(f"{fmu}: is no FMU, or a damaged one: {error}") from error
        if MANIFEST not in self._archive.namelist():
            raise self._manifest.error("there is no such file: the FMU carries no reference results")

    def experiments(self, description: Any) -> list[Experiment]:
        """All but those for uncertainty; `description` is FMPy's of the FMU."""
        variables = {v.name: v for v in description.modelVariables}
        found: list[Experiment] = []
        for related in _children(self._xml(self._manifest, "fmiReferences"), "Related"):
            role, _, purpose = related.get("role", "").partition("/")
            if role == "experiment" and purpose != "uncertainty-analysis":
                place = self._manifest.beside(related.get("source"))
                found += self._read(place, description.defaultExperiment, variables)
        if not any(experiment.references for experiment in found):
            raise self._manifest.error("names no experiment with expected results")
        return found

    def _read(self, place: _Place, default: Any, variables: Mapping[str, Any]) -> Iterator[Experiment]:
        for element in _children(self._xml(place, "Experiments"), "Experiment"):
            name = element.get("name", "")
            parts = {etree.QName(child).localname: child for child in element if isinstance(child.tag, str)}
            kinds = parts.keys() - {"TransientSimulation", "Parameters", "Stimuli", "References", "Annotations"}
            if kinds:
                raise place.error(f"experiment {shown(name)}: {', '.join(sorted(kinds))} cannot be run")
            # the times stand in a child of their own in drafts after 1.0.0-beta.1
            given = dict(element.attrib) | dict(getattr(parts.get("TransientSimulation"), "attrib", {}))

            def setting(key: str, fallback: float, given: Mapping[str, str] = given, name: str = name) -> float:
                if key in given:
                    return number(given[key], f"experiment {shown(name)}: {key}", place.error)
                value: str | None = getattr(default, key, None)
                return number(value, f"DefaultExperiment: {key}", self._description.error) if value else fallback

            start = setting("startTime", 0.0)
            stop = setting("stopTime", start + 1.0)
            step = setting("stepSize", (stop - start) / _STEPS)
            tolerance = setting("tolerance", _LOOSE)
            if not (stop > start and step > 0.0 and tolerance > 0.0):
                raise place.error(f"experiment {shown(name)}: must go on from its start, in steps, with a tolerance")
            steps = (stop - start) / step
            if not steps <= _MOST_STEPS:
                told = f"stepSize = {step:g} s takes {steps:.3g} steps from {start:g} to {stop:g} s"
                raise place.error(f"experiment {shown(name)}: {told}; at most {_MOST_STEPS} are run")
            files = {
                part: place.beside(parts[part].get("source"))
                for part in ("Parameters", "Stimuli", "References")
                if part in parts
            }
            parameters = self._parameters(files["Parameters"], variables) if "Parameters" in files else {}
            stimuli = self._series(files["Stimuli"], variables) if "Stimuli" in files else None
            references = self._series(files["References"], variables) if "References" in files else None
            yield Experiment(name, start, stop, step, tolerance, parameters, stimuli, references)

    def _parameters(self, place: _Place, variables: Mapping[str, Any]) -> dict[str, str]:
        """A parameter set in the format of SSP."""
        found = {}
        for element in self._xml(place, "ParameterSet").iter("{*}Parameter"):
            name, value = element.get("name", ""), next(iter(element), None)
            variable = _variable(place, name, variables)
            if value is None or value.get("value") is None:
                raise place.error(f"parameter {shown(name)}: has no value")
            if value.get("unit") not in (None, variable.unit):
                raise place.error(f"parameter {shown(name)}: is in {value.get('unit')}, and not in {variable.unit}")
            found[name] = value.get("value")
            if variable.type not in ("String", "Boolean"):
                number(found[name], f"parameter {shown(name)}", place.error)
        return found

    def _series(self, place: _Place, variables: Mapping[str, Any]) -> Series:
        """A CSV file: the time in the first column, a variable of the FMU in each other."""

        def check_column(name: str) -> None:
            variable = _variable(place, name, variables)
            if variable.type in _NOT_READ or getattr(variable, "dimensions", None):
                raise place.error(f"column {shown(name)}: the variable is no single number")

        return series(self._text(place), place.error, check_column)

    def _text(self, place: _Place) -> str:
        try:
            return self._archive.read(place.member).decode("utf-8-sig")
        except KeyError:
            raise place.error("there is no such file in the FMU") from None
        except UnicodeDecodeError as error:
            raise place.error(f"not UTF-8 text, at byte {error.start}") from error

    def _xml(self, place: _Place, root: str) -> Any:
        """The root element of an XML file."""
        try:
            found = etree.fromstring(
                self._text(place).encode(), etree.XMLParser(resolve_entities=False, no_network=True)
            )
        except etree.XMLSyntaxError as error:
            raise place.error(f"not XML: {error}") from error
        if (name := etree.QName(found).localname) != root:
            raise place.error(f"must begin with <{root}>, and not with <{name}>")
        return found


def _children(element: Any, name: str) -> list[Any]:
    return element.findall(f"{{*}}{name}")  # type: ignore[no-any-return]


def _variable(place: _Place, name: str, variables: Mapping[str, Any]) -> Any:
    if name not in variables:
        raise place.error(f"the FMU has no variable {shown(name)}")
    return variables[name]
