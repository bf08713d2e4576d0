"""Unpack an FMU that may come from anyone.

The files stay in their folder, their size is limited, and the attributes of the model description are checked.
"""

import os
import re
import stat
import zipfile
from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path
from typing import IO, Any
from xml.parsers import expat

from rov_fmu.io.messages import FileError, brief, shown

_MOST_UNPACKED = 2_000_000_000
"""The size of all files."""
_MOST_RATIO = 100
"""The size of all files, relative to that of the archive, if it is above _SMALL."""
_SMALL = 100_000_000
"""Bytes that an archive may unpack to, however well it is compressed."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The compression that FMI allows. Python takes memory without limit for other methods."""
_FILE = "modelDescription.xml"
_MOST_VARIABLES = 100_000
"""FMPy takes about 6 s and 0.4 GB for this number."""
_MOST_BYTES = 40_000_000
"""The largest size of a file of XML that FMPy reads."""
_MOST_PARTS = 3_000_000
"""The largest number of elements and attributes. Each takes about 0.1 kB of FMPy's memory."""
_LONGEST = 1_000_000
"""The largest number of characters in an attribute."""
_INDICES = ("derivative", "index", "dependencies", "clocks")
"""The attributes that name other variables, besides the value references in the model structure and in dimensions."""
_FINITE = ("nominal", "factor", "offset", "gain", "startTime", "stopTime", "tolerance", "stepSize")
_COUNTS = ("numberOfEventIndicators", "numberOfContinuousStates")
_EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_INFINITE = ("INF", "-INF", "NaN")
"""How XML writes numbers that are not finite."""
_INITIAL = ("exact", "approx", "calculated")
_VARIABILITY = ("constant", "fixed", "tunable", "discrete", "continuous")
_CAUSALITY = ("parameter", "calculatedParameter", "input", "output", "local", "independent")
_WORDS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "1": {
        "causality": ("input", "output", "internal", "none"),
        "variability": ("constant", "parameter", "discrete", "continuous"),
    },
    "2": {"causality": _CAUSALITY, "variability": _VARIABILITY, "initial": _INITIAL},
    "3": {"causality": ("structuralParameter", *_CAUSALITY), "variability": _VARIABILITY, "initial": _INITIAL},
}
"""The words that an attribute may have, by the version of FMI."""
_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
"""The types of FMI 1.0 and 2.0, each an element inside its variable."""
_STORED_AS = {
    **{(version, kind): "Int32" for version in "12" for kind in ("Integer", "Enumeration")},
    ("3", "Enumeration"): "Int64",
}
"""The whole numbers that hold a value, by the version of FMI and the type."""


def unpack_fmu(archive: Path | IO[bytes], fmu: Path, folder: Path) -> Any:
    """Unpack an FMU into a folder, and return FMPy's description of it.

    Raises FileError, which names the FMU by the path `fmu`, if it is damaged, if a file would lie outside the folder or
    is a link, or if the files take too much space.
    """
    import fmpy

    try:
        with zipfile.ZipFile(archive) as zipped:
            if reason := _refusal(zipped):
                raise FileError(f"{fmu}: {reason}")
            zipped.extractall(folder)
    except FileError:
        raise
    except OSError as error:
        where = f": {os.path.relpath(error.filename, folder)}" if error.filename else ""
        raise FileError(f"{fmu}: cannot be unpacked: {error.strerror or error}{where}") from error
    except Exception as error:  # zipfile raises many kinds on damaged or encrypted archives
        raise FileError(f"{fmu}: is not an FMU, or is damaged: {brief(str(error))}") from error
    _check_description(fmu, folder)
    try:
        return fmpy.read_model_description(str(folder), validate=False)
    except Exception as error:  # what FMPy raises
        reason = str(error).replace(f"{folder}{os.sep}", "")
        raise FileError(f"{fmu}: is not an FMU that FMPy can read: {brief(reason)}") from error


def _refusal(zipped: zipfile.ZipFile) -> str:
    """Return the reason why an archive is refused, or an empty text if it is not."""
    members = zipped.infolist()
    for member in members:
        name = member.orig_filename
        if name.startswith("/") or ".." in name.split("/") or any(c in name for c in "\\:\0"):
            return f"member {shown(name)}: a path in an FMU must be relative, with forward slashes and without .."
        if stat.S_IFMT(member.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR):
            return f"member {shown(name)}: is a link or a special file; an FMU must have files and folders only"
        if member.compress_type not in _METHODS:
            return f"member {shown(name)}: must be stored or deflated, the compression that FMI allows"
    total = sum(member.file_size for member in members)
    packed = zipped.start_dir
    if total > _MOST_UNPACKED:
        return f"would take {total / 1e9:.3g} GB unpacked; at most {_MOST_UNPACKED / 1e9:g} GB are allowed"
    if total > max(_SMALL, _MOST_RATIO * packed):
        return (
            f"would take {total / 1e6:.3g} MB unpacked, {total / packed:.0f} times the size of the archive; "
            f"above {_SMALL / 1e6:g} MB at most {_MOST_RATIO} times are allowed"
        )
    return ""


# ---- The model description -------------------------------------------------------------------------------------------
#
# FMPy converts attributes without a check, and keeps the whole file in memory. Here the file is a stream of elements,
# so the check needs no memory, and ends at the first mistake. It accepts what the schema of FMI forbids if that does
# no harm, because many exporters take it lightly.


def _check_description(fmu: Path, folder: Path) -> None:
    """Check modelDescription.xml, and the size of buildDescription.xml, in the folder of an unpacked FMU.

    Raises FileError, which names the FMU by the path `fmu`, with one line about the first mistake.
    """
    for name in (_FILE, "sources/buildDescription.xml"):
        if (path := folder / name).is_file() and (size := path.stat().st_size) > _MOST_BYTES:
            raise FileError(f"{fmu}: {name}: has {size / 1e6:.3g} MB; at most {_MOST_BYTES / 1e6:g} MB are read")
    if not (folder / _FILE).is_file():
        return  # FMPy's message says so
    description = _Description(lambda reason: FileError(f"{fmu}: {_FILE}: {reason}"))
    parser = expat.ParserCreate()
    parser.StartElementHandler = description.begin
    parser.EndElementHandler = description.end
    parser.EntityDeclHandler = description.refuse_entity
    try:
        with (folder / _FILE).open("rb") as file:
            parser.ParseFile(file)
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{fmu}: {_FILE}: not XML: {error}") from error
    description.check_references()


class _Description:
    """What is known of a model description while its elements pass by. All methods raise what `error` returns."""

    def __init__(self, error: Callable[[str], FileError]) -> None:
        self._error = error
        self._path: list[str] = []
        self._parts = self._variables = 0
        self._version = ""
        self._names: set[str] = set()
        self._references: set[int] = set()
        self._named: dict[int, str] = {}
        """The variables that others name by their number, each with the place where it is first named."""
        self._of = ""
        """The variable, type or element that attributes belong to, for messages."""
        self._type = ""

    def refuse_entity(self, name: str, *_: object) -> None:
        """Refuse entities: a few lines of them can stand for gigabytes of text."""
        raise self._error(f"defines the entity {shown(name)}; no model description needs one")

    def begin(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Check an element and its attributes. What other tools wrote into annotations is theirs."""
        self._parts += 1 + len(attributes)
        if self._parts > _MOST_PARTS:
            raise self._error(f"has more than {_MOST_PARTS} elements and attributes, the most that are read")
        self._path.append(tag)
        if len(self._path) == 1:
            self._check_root(tag, attributes)
        if any("Annotation" in name or name == "Tool" for name in self._path):
            return
        inside = self._path[1] if len(self._path) > 1 else ""
        if inside == "ModelVariables" and len(self._path) == 3:
            self._check_variable(tag, attributes)
        elif inside not in ("ModelVariables", "TypeDefinitions") or len(self._path) == 3:
            self._of = f"{tag} {shown(attributes['name'])}" if "name" in attributes else tag
        if inside == "ModelVariables" and len(self._path) == 4 and tag in _TYPES and not self._type:
            self._type = tag
        if inside == "TypeDefinitions":
            self._type = tag.removesuffix("Type")
        for key, text in attributes.items():
            if len(text) > _LONGEST:
                raise self._error(f"{self._of}: {key}: has {len(text)} characters; at most {_LONGEST} are allowed")
            self._check(tag, key, text)

    def end(self, tag: str) -> None:
        """Leave an element."""
        if tag == "ScalarVariable" and len(self._path) == 3 and not self._type:
            raise self._error(f"{self._of}: must contain one of {', '.join(_TYPES)}")
        self._path.pop()

    def check_references(self) -> None:
        """Check that every variable that is named by its number exists."""
        if self._version == "2":
            rule, known = f"must be an index from 1 to {self._variables}", range(1, self._variables + 1)
        else:
            rule, known = "must be the value reference of a variable", self._references  # type: ignore[assignment]
        for number, place in self._named.items():
            if number not in known:
                raise self._error(f"{place}: {number}: {rule}")

    def _check_root(self, tag: str, attributes: Mapping[str, str]) -> None:
        if tag != "fmiModelDescription":
            raise self._error(f"must begin with <fmiModelDescription>, and not with <{tag}>")
        if not attributes.get("fmiVersion"):
            raise self._error("fmiVersion is missing")
        self._version = attributes["fmiVersion"][:1]

    def _check_variable(self, tag: str, attributes: Mapping[str, str]) -> None:
        self._variables += 1
        if self._variables > _MOST_VARIABLES:
            raise self._error(f"has more than {_MOST_VARIABLES} variables, the most that are read")
        self._type = "" if tag == "ScalarVariable" else tag
        self._of = f"variable {self._variables}"
        for key in ("name", "valueReference"):
            if key not in attributes:
                raise self._error(f"{self._of}: {key} is missing")
            self._of = f"variable {shown(attributes['name'])}"

    def _check(self, tag: str, key: str, text: str) -> None:
        """Check an attribute. The type of a variable, which comes first in FMI 3.0, determines that of its values."""
        place = f"{self._of}: {key}"
        is_of_variable = self._path[1:2] == ["ModelVariables"]
        is_own = is_of_variable and len(self._path) == 3
        if key == "name" and (is_own or (is_of_variable and tag == "Alias")):
            if text in self._names:
                raise self._error(f"{place} = {shown(text)}: another variable has this name")
            self._names.add(text)
        elif key == "valueReference":
            self._references_of(place, text, is_own=is_own)
        elif key in _INDICES:
            if text.strip() or key != "dependencies":  # an output may depend on nothing
                self._references_of(place, text, is_own=False)
        elif key in _FINITE:
            self._number(place, text)
        elif key in _COUNTS:
            self._whole(place, text, 0, _MOST_VARIABLES)
        elif key in _EXPONENTS and tag == "BaseUnit":
            self._whole(place, text, -1000, 1000)
        elif key == "start" and tag == "Dimension":
            self._whole(place, text, 0, 2**64 - 1)
        elif key in ("min", "max", "start") and (is_of_variable or self._path[1:2] == ["TypeDefinitions"]):
            for value in text.split() if self._version == "3" else [text]:
                self._value(place, value, may_be_nan=key == "start")
        elif is_of_variable and text not in (words := _WORDS.get(self._version, {}).get(key, (text,))):
            raise self._error(f"{place} = {shown(text)}: must be one of {', '.join(words)}")

    def _references_of(self, place: str, text: str, *, is_own: bool) -> None:
        for word in text.split() or [text]:
            number = self._whole(place, word, 0, 2**32 - 1)
            if is_own:
                self._references.add(number)
            elif self._version != "1":
                self._named.setdefault(number, place)

    def _value(self, place: str, text: str, *, may_be_nan: bool) -> None:
        """Check a bound or a start value of the current type. Text, bytes and clocks have no numbers."""
        if self._type in ("Real", "Float32", "Float64"):
            if text not in (_INFINITE if may_be_nan else _INFINITE[:2]):
                self._number(place, text)
        elif self._type == "Boolean":
            if text not in ("true", "false", "1", "0"):
                raise self._error(f"{place} = {shown(text)}: must be true or false")
        elif size := re.fullmatch(r"(U?)Int(\d+)", _STORED_AS.get((self._version, self._type), self._type)):
            span = 2 ** int(size[2])
            self._whole(place, text, *((0, span - 1) if size[1] else (-span // 2, span // 2 - 1)))

    def _number(self, place: str, text: str) -> None:
        try:
            is_number = isfinite(float(text)) and text.isascii()
        except ValueError:
            is_number = False
        if not is_number:
            raise self._error(f"{place} = {shown(text)}: must be a finite number")

    def _whole(self, place: str, text: str, low: int, high: int) -> int:
        text = text.strip()
        if re.fullmatch(r"[+-]?[0-9]{1,30}", text) and low <= (number := int(text)) <= high:
            return number
        raise self._error(f"{place} = {shown(text)}: must be a whole number from {low} to {high}")
