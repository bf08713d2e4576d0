"""Unpack an FMU that may come from anyone.

The files stay in their folder, their size is limited, and the attributes of the model description are checked.
"""

import os
import re
import stat
import zipfile
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import IO, Any

from lxml import etree

from rov_fmu.io.messages import FileError, brief, shown
from rov_fmu.io.reading import open_file

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
_MOST_REFERENCE = 2**32 - 1
_INDICES = ("derivative", "index", "dependencies", "clocks", "valueReference")
"""The attributes that name other variables, such as those in the model structure and in dimensions."""
_FINITE = ("nominal", "factor", "offset", "gain", "startTime", "stopTime", "tolerance", "stepSize")
_RANGES: dict[str | tuple[str, str], tuple[int, int]] = {
    **dict.fromkeys(("numberOfEventIndicators", "numberOfContinuousStates"), (0, _MOST_VARIABLES)),
    **dict.fromkeys((("BaseUnit", key) for key in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")), (-1000, 1000)),
    ("Dimension", "start"): (0, 2**64 - 1),
}
"""The least and the largest whole number of an attribute, in elements of any kind or of one kind."""
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

    if isinstance(archive, Path):
        with open_file(archive) as file:
            return unpack_fmu(file, fmu, folder)
    try:
        with zipfile.ZipFile(archive) as zipped:
            if reason := refusal(zipped):
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


def refusal(zipped: zipfile.ZipFile) -> str:
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
# FMPy converts attributes without a check. What the schema of FMI forbids is accepted if it does no harm, because many
# exporters take it lightly.


def _check_description(fmu: Path, folder: Path) -> None:
    """Check modelDescription.xml, and the size of buildDescription.xml, in the folder of an unpacked FMU.

    Raises FileError, which names the FMU by the path `fmu`, with one line about the first mistake.
    """
    for name in (_FILE, "sources/buildDescription.xml"):
        if (path := folder / name).is_file() and (size := path.stat().st_size) > _MOST_BYTES:
            raise FileError(f"{fmu}: {name}: has {size / 1e6:.3g} MB; at most {_MOST_BYTES / 1e6:g} MB are read")
    if not (folder / _FILE).is_file():
        return  # FMPy's message says so

    def error(reason: str) -> FileError:
        return FileError(f"{fmu}: {_FILE}: {reason}")

    parts = 0
    elements = etree.iterparse(str(folder / _FILE), events=("start",), resolve_entities=False, no_network=True)
    try:
        for _, element in elements:
            parts += 1 + len(element.attrib)
            if parts > _MOST_PARTS:
                raise error(f"has more than {_MOST_PARTS} elements and attributes, the most that are read")
    except etree.XMLSyntaxError as mistake:
        raise error(f"not XML: {mistake.msg}") from mistake
    _Description(elements.root, error).check()


class _Description:
    """The checks of a model description. They raise what `error` returns."""

    def __init__(self, root: Any, error: Callable[[str], FileError]) -> None:
        self._root, self._error = root, error
        self._version = root.get("fmiVersion", "")[:1]
        self._references: set[int] = set()
        self._named: dict[int, str] = {}
        """The variables that others name by their number, each with the place where it is first named."""

    def check(self) -> None:
        """Check all elements. A few lines of entities can stand for gigabytes of text, so these are refused."""
        root, dtd = self._root, self._root.getroottree().docinfo.internalDTD
        for entity in dtd.iterentities() if dtd is not None else ():
            raise self._error(f"defines the entity {shown(entity.name)}; no model description needs one")
        if root.tag != "fmiModelDescription":
            raise self._error(f"must begin with <fmiModelDescription>, and not with <{root.tag}>")
        if not self._version:
            raise self._error("fmiVersion is missing")
        variables = root.findall("ModelVariables/*")
        self._check_variables(variables)
        for definition in root.iterfind("TypeDefinitions/*"):
            self._check_element(definition, _label(definition), _kind(definition), "TypeDefinitions")
        self._check_element(root, root.tag)
        known = range(1, len(variables) + 1) if self._version == "2" else self._references
        rule = f"an index from 1 to {len(variables)}" if self._version == "2" else "the value reference of a variable"
        for number, place in self._named.items():
            if number not in known and self._version != "1":
                raise self._error(f"{place}: {number}: must be {rule}")

    def _check_variables(self, variables: Sequence[Any]) -> None:
        """Check the variables, their names and their value references."""
        if len(variables) > _MOST_VARIABLES:
            raise self._error(f"has more than {_MOST_VARIABLES} variables, the most that are read")
        names: set[str] = set()
        for number, variable in enumerate(variables, start=1):
            of = f"variable {number}"
            for key in ("name", "valueReference"):
                if key not in variable.attrib:
                    raise self._error(f"{of}: {key} is missing")
                of = f"variable {shown(variable.get('name'))}"
            kind = _kind(variable)
            if kind == "ScalarVariable":
                raise self._error(f"{of}: must contain one of {', '.join(_TYPES)}")
            self._references.add(
                self._whole(f"{of}: valueReference", variable.get("valueReference"), 0, _MOST_REFERENCE)
            )
            for name in (x.get("name", "") for x in (variable, *variable.iterchildren("Alias"))):
                if name in names:
                    raise self._error(f"{of}: name = {shown(name)}: another variable has this name")
                names.add(name)
            self._check_element(variable, of, kind, "ModelVariables")

    def _check_element(self, element: Any, of: str, kind: str = "", part: str = "") -> None:
        """Check the attributes of an element and of those inside. What other tools wrote into annotations is theirs.

        `of` is what the attributes belong to, for messages. `kind` is the type of a variable or of a type definition,
        and `part` is ModelVariables or TypeDefinitions.
        """
        for key, text in element.attrib.items():
            self._check(element.tag, f"{of}: {key}", key, text, kind, part)
        for inner in element.iterchildren("*"):
            if inner.tag not in ("ModelVariables", "TypeDefinitions", "Tool") and "Annotation" not in inner.tag:
                self._check_element(inner, of if part else _label(inner), kind, part)

    def _check(self, tag: str, place: str, key: str, text: str, kind: str, part: str) -> None:
        """Check an attribute of an element. The other arguments are those of `_check_element`."""
        if key in _INDICES:
            for word in text.split() or [text] * (key != "dependencies"):  # an output may depend on nothing
                number = self._whole(place, word, 0, _MOST_REFERENCE)
                if self._version != "2" or key != "valueReference":
                    self._named.setdefault(number, place)
        elif key in _FINITE:
            self._number(place, text)
        elif ends := _RANGES.get(key, _RANGES.get((tag, key))):
            self._whole(place, text, *ends)
        elif key in ("min", "max", "start") and part:
            for value in text.split() if self._version == "3" else [text]:
                self._value(place, value, kind, may_be_nan=key == "start")
        elif part == "ModelVariables" and text not in (words := _WORDS.get(self._version, {}).get(key, (text,))):
            raise self._error(f"{place} = {shown(text)}: must be one of {', '.join(words)}")

    def _value(self, place: str, text: str, kind: str, *, may_be_nan: bool) -> None:
        """Check a bound or a start value of a type. Text, bytes and clocks have no numbers."""
        if kind in ("Real", "Float32", "Float64"):
            if text not in (_INFINITE if may_be_nan else _INFINITE[:2]):
                self._number(place, text)
        elif kind == "Boolean":
            if text not in ("true", "false", "1", "0"):
                raise self._error(f"{place} = {shown(text)}: must be true or false")
        elif size := re.fullmatch(r"(U?)Int(\d+)", _STORED_AS.get((self._version, kind), kind)):
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


def _label(element: Any) -> str:
    """Return an element in words: its tag, and its name if it has one."""
    return f"{element.tag} {shown(element.get('name'))}" if "name" in element.attrib else str(element.tag)


def _kind(element: Any) -> str:
    """Return the type of a variable or of a type definition: that of an element inside it, or in FMI 3.0 its own."""
    kinds = [x.tag.removesuffix("Type") for x in (*element.iterchildren("*"), element)]
    return next((str(kind) for kind in kinds if kind in _TYPES), str(kinds[-1]))
