"""Write a system of FMUs for co-simulation tools, as SSP 1.0, and read it from SSP."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from rov_fmu.bridges.system.connections import Connection, SystemStructure, checked_connection
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.fmu.archive import archive
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.fmus.variable import Value
from rov_fmu.io.csv_table import number_of
from rov_fmu.io.file_kinds import SYSTEM, check_suffix
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, shown
from rov_fmu.io.paths import inside
from rov_fmu.io.reading import check_size, read_bytes, root_of_xml
from rov_fmu.io.templates import render

PARAMETER_SET = "initial_values"
"""The name of every component's parameter set. Ecos uses the sets of one name."""
_STRUCTURE = "SystemStructure.ssd"
_MOST_BYTES = 40_000_000
"""The largest structure or parameter set that is read."""


@dataclass(frozen=True)
class Component:
    """An FMU, its start values and its connectors."""

    fmu: str
    """The name of its file."""
    content: bytes
    values: Mapping[str, Value]
    inputs: Sequence[str]
    outputs: Sequence[str]
    types: Mapping[str, str] = field(default_factory=dict)
    """The types of SSP of the connectors that are not Real."""


@dataclass(frozen=True)
class System:
    """Components that are stepped together every `step` seconds until `stop`."""

    name: str
    components: Mapping[str, Component]
    step: float
    stop: float
    connections: Sequence[Connection] = ()


# ---- Writing ---------------------------------------------------------------------------------------------------------


def ssp_content(system: System) -> bytes:
    """Return the SSP archive: the structure, and for each component its FMU and a parameter set (SSV)."""
    files = {_STRUCTURE: _rendered("SystemStructure.ssd.j2", system=system).encode()}
    for name, component in system.components.items():
        files[f"resources/{component.fmu}"] = component.content
        if component.values:
            files[f"resources/{name}.ssv"] = parameter_set(component).encode()
    return archive(files)


def parameter_set(component: Component) -> str:
    """Return the parameter set (SSV) of a component."""
    return _rendered("ParameterSet.ssv.j2", component=component)


def _rendered(template: str, **content: Component | System) -> str:
    return render(template, Path(__file__).parents[1] / "templates", parameter_set=PARAMETER_SET, **content)


# ---- Reading ---------------------------------------------------------------------------------------------------------


_READ = dict(
    line.split(": ")
    for line in """\
SystemStructureDescription: System
System: Connectors ParameterBindings Elements Connections
Elements: Component System
Component: Connectors ParameterBindings
Connectors: Connector
Connector: Real Integer Boolean String Enumeration
Connections: Connection
Connection: LinearTransformation
ParameterBindings: ParameterBinding
ParameterBinding: ParameterValues ParameterMapping
ParameterValues: ParameterSet
ParameterSet: Parameters
Parameters: Parameter
Parameter: Real Integer Boolean String Enumeration
ParameterMapping: ParameterMapping MappingEntry
MappingEntry: LinearTransformation""".splitlines()
)
"""The elements of SSP 1.0 that are read, each with its children."""
_PASSED = (
    "Annotations Units Enumerations DefaultExperiment ElementGeometry SystemGeometry ConnectorGeometry "
    "ConnectionGeometry GraphicalElements id description version author fileversion copyright license generationTool "
    "generationDateAndTime"
)
"""The elements and attributes that do not change what a system does."""
_ATTRIBUTES = (
    "name kind source target value unit prefix factor offset startElement startConnector endElement endConnector "
    "suppressUnitConversion type implementation sourceBase"
)
"""The attributes that are read."""
_ONLY = {
    "type": ("fmu-sharedlibrary", "parameter-set", "parameter-mapping"),
    "implementation": ("any", "CoSimulation"),
    "sourceBase": ("SSD",),
}
"""The ends of the values that an attribute may have."""
_INTO, _OUT_OF = ("input of a system", "parameter of a system"), ("output", "output of a system")
"""The kinds of connectors that data come from: those of a system inside of it, and those of what is in it."""
_TRUTH = {"true": True, "1": True, "false": False, "0": False}


class _Given(NamedTuple):
    """The value of a parameter, its unit, and its file and line."""

    value: Value
    unit: str
    where: str


class _Way(NamedTuple):
    """How a connector gets its value from another one."""

    source: str
    factor: float = 1.0
    offset: float = 0.0
    suppressed: bool = False
    """True if units are not to be converted."""

    def after(self, other: "_Way") -> "_Way":
        """Return the whole way, which begins with another."""
        offset = self.offset + self.factor * other.offset
        return _Way(other.source, self.factor * other.factor, offset, self.suppressed or other.suppressed)

    def brings(self, given: _Given) -> _Given:
        """Return what becomes of a value on the way. Raises ValueError."""
        value = given.value
        if self[1:3] != (1.0, 0.0):
            if not isinstance(value, float):
                raise ValueError(f"{given.where}{shown(value)} is no number, and cannot be transformed")
            value = self.factor * value + self.offset
        return _Given(value, "" if self.suppressed else given.unit, given.where)


def read_ssp(path: Path) -> SystemStructure:
    """Read an SSP 1.0 of FMUs: all of it, or FileError names what is not read, with its file and line.

    The name of a component of a system in the system begins with the name of that.
    """
    check_suffix(path, SYSTEM)
    with temporary_folder("ssp-") as unpacked:
        folder = Path(unpacked)
        unpack_fmu(BytesIO(read_bytes(path)), path, folder, SYSTEM)
        try:
            return _Reader(folder, path).structure()
        except ValueError as error:
            if isinstance(error, FileError):
                raise
            raise FileError(f"{path}: {error}") from error


class _Reader:
    """The systems of an SSP, which become one. Its methods raise FileError, or ValueError with only the reason.

    In it, `a.b.y` is the connector y of the component b of the system a.
    """

    def __init__(self, folder: Path, path: Path) -> None:
        self._folder, self._path = folder, path
        self._parts: dict[str, SystemFmu] = {}
        self._files: dict[str, SystemFmu] = {}
        self._sources: dict[str, str] = {}
        self._kinds: dict[str, str] = {}
        self._units: dict[str, str] = {}
        self._given: dict[str, _Given] = {}
        self._ways: dict[str, _Way] = {}

    def structure(self) -> SystemStructure:
        """Return the system, whose connections join components, with their start values."""
        for system in self._root(_STRUCTURE, "SystemStructureDescription").iterfind("{*}System"):
            self._system(system, "")
        parts = {_flat(place): part for place, part in self._parts.items()}
        if not parts or len(parts) < len(self._parts):
            raise ValueError(f"{_STRUCTURE}: {'two components have one name' if parts else 'has no component'}")
        for key in self._given.keys() - self._kinds.keys():
            raise ValueError(f"{self._given[key].where}there is no parameter or connector {shown(key)}")
        found = SystemStructure(parts, {name: {} for name in parts}, [], self._sources)
        ends = {f"{place}.{name}": (place, name) for place, part in self._parts.items() for name in part.variables}
        for end, (place, name) in ends.items():
            part, values = self._parts[place], found.values[_flat(place)]
            way, given = self._followed(end, ends)
            if given:
                try:
                    _check_units(given.unit, part.variables[name].unit)
                    values[name] = part.start_value(name, given.value)
                except ValueError as error:
                    raise ValueError(f"{given.where}start value of {end}: {error}") from error
            if way.source in ends and way.source != end:
                source, output = ends[way.source]
                one = Connection((_flat(source), output), (_flat(place), name), way.factor, way.offset)
                found.connections.append(checked_connection(one, parts, unlike=way.suppressed))
        return found

    def _followed(self, end: str, ends: Container[str]) -> tuple[_Way, _Given | None]:
        """Return the whole way to a variable through the connectors of systems, and its start value."""
        way, given, seen = _Way(end), self._given.get(end), {end}
        while way.source in self._ways:
            way = way.after(self._ways[way.source])
            if way.source in seen:
                raise ValueError(f"{_STRUCTURE}: {way.source} is connected to itself")
            seen.add(way.source)
            if way.source in self._given and way.source not in ends:
                given = way.brings(self._given[way.source])
        return way, given

    def _system(self, system: Any, place: str) -> None:
        """Read a system: what is in it first, for what is said of the whole takes precedence."""
        for one in system.iterfind("{*}Connectors/{*}Connector"):
            self._kinds[f"{place}{one.get('name')}"] = f"{one.get('kind')} of a system"
        self._connectors(system, place)
        for element in (*system.iterfind("{*}Elements/{*}Component"), *system.iterfind("{*}Elements/{*}System")):
            name, kind = element.get("name", ""), etree.QName(element).localname
            if not name or "." in name or f"{place}{name}" in self._parts:  # a.b is the variable b of the component a
                rule = "must not be empty, have a point, or be that of another component"
                raise ValueError(f"{_at(_STRUCTURE, element)}the name of a component, {shown(name)}, {rule}")
            (self._system if kind == "System" else self._component)(element, f"{place}{name}.")
        for one in system.iterfind("{*}Connections/{*}Connection"):
            self._connect(one, place)
        self._bindings(system, place)

    def _component(self, element: Any, place: str) -> None:
        source, place = element.get("source", ""), place.removesuffix(".")
        if source not in self._files:
            content = self._file(source).read_bytes()
            self._files[source] = SystemFmu.open(Path(f"{self._path}: {place}"), content)
        part = self._parts[place] = self._files[source]
        self._sources[_flat(place)] = source
        self._kinds |= {f"{place}.{name}": one.causality for name, one in part.variables.items()}
        self._units |= {f"{place}.{name}": one.unit for name, one in part.variables.items()}
        self._connectors(element, f"{place}.")
        self._bindings(element, f"{place}.")

    def _connectors(self, element: Any, place: str) -> None:
        """Note the units of connectors; of a component, they must be those of the FMU."""
        for one in element.iterfind("{*}Connectors/{*}Connector"):
            for kind in one.iterfind("*[@unit]"):
                end = f"{place}{one.get('name')}"
                _check_units(
                    kind.get("unit"), self._units.setdefault(end, kind.get("unit")), f"{_at(_STRUCTURE, one)}{end} "
                )

    def _connect(self, one: Any, place: str) -> None:
        """Note what a connector gets from another: their kinds tell the direction, and not which is written first."""
        where, ends, sources = _at(_STRUCTURE, one), list[str](), list[str]()
        for key in ("start", "end"):
            element = one.get(f"{key}Element")
            end = ".".join(filter(None, [element, one.get(f"{key}Connector")]))
            ends.append(f"{place}{end}")
            if ends[-1] not in self._kinds:
                raise ValueError(f"{where}there is no connector {shown(ends[-1])}")
            if self._kinds[ends[-1]] in (_OUT_OF if element else _INTO):
                sources.append(ends[-1])
        if len(sources) != 1:
            raise ValueError(f"{where}{' and '.join(ends)}: one must be an output, and the other an input")
        (target,) = {*ends} - {*sources}
        if target in self._ways:
            raise ValueError(f"{where}{target} takes one connection, and has one with {self._ways[target].source}")
        way = self._ways[target] = _Way(sources[0], *_linear(one, where))
        if not way.suppressed and any(" of a system" in self._kinds[end] for end in ends):
            first, second = (self._units.get(end, "") for end in ends)
            _check_units(first, second, f"{where}{ends[0]} ")

    def _bindings(self, element: Any, place: str) -> None:
        """Note the values that are given to a system or a component, over those that are given in it."""
        for binding in element.iterfind("{*}ParameterBindings/{*}ParameterBinding"):
            file, values = self._inner(binding, "ParameterSet")
            prefix = binding.get("prefix", "")
            found = {prefix + one.get("name", ""): _given(one, _at(file, one)) for one in values.iter("{*}Parameter")}
            if (mapping := binding.find("{*}ParameterMapping")) is not None:
                file, entries = self._inner(mapping, "ParameterMapping")
                given, found = found, {}
                for one in entries.iter("{*}MappingEntry"):
                    where, source = _at(file, one), one.get("source")
                    if source not in given:
                        raise ValueError(f"{where}there is no parameter {shown(source)}")
                    found[one.get("target", "")] = _Way(source, *_linear(one, where)).brings(given[source])
            self._given |= {f"{place}{name}": one for name, one in found.items()}

    def _inner(self, element: Any, kind: str) -> tuple[str, Any]:
        """Return the file and the root of the parameters or the mapping that stand in an element or in their file."""
        if source := element.get("source"):
            return source, self._root(source, kind)
        if (root := element.find(f".//{{*}}{kind}")) is None:
            raise ValueError(f"{_at(_STRUCTURE, element)}there is no {kind}")
        return _STRUCTURE, root

    def _file(self, name: str) -> Path:
        """Return the path of a file of the unpacked SSP."""
        try:
            path = inside(self._folder, name)
        except ValueError as error:
            raise ValueError(f"source = {shown(name)}: {error}") from error
        if not path.is_file():
            raise ValueError(f"source = {shown(name)}: there is no such file in the archive")
        return path

    def _root(self, name: str, kind: str) -> Any:
        """Return the root element of a file, all of which is read."""
        path = self._file(name)
        check_size(name, path.stat().st_size, _MOST_BYTES, ValueError)
        try:
            root = root_of_xml(path.read_bytes())
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
        if etree.QName(root).localname != kind:
            raise ValueError(f"{_at(name, root)}must begin with <{kind}>")
        _check(root, name)
        return root


def _at(file: str, element: Any) -> str:
    """Return the file and the line of an element, as the beginning of a message."""
    return f"{file}: line {element.sourceline}: "


def _flat(place: str) -> str:
    """Return the name that a component has in the one system."""
    return place.replace(".", "_")


def _check(element: Any, file: str) -> None:
    """Raise ValueError for the first attribute or child that is not read."""
    name = etree.QName(element).localname
    for key, value in element.attrib.items():
        is_read = key in _ATTRIBUTES.split() and value.endswith(_ONLY.get(key, ""))
        if not (is_read or key in _PASSED.split() or "{" in key):
            raise ValueError(f"{_at(file, element)}{key} = {shown(value)} of {name} is not read")
    for child in element.iterchildren("*"):
        own = etree.QName(child).localname
        if own in _READ.get(name, "").split():
            _check(child, file)
        elif own not in _PASSED.split():
            raise ValueError(f"{_at(file, child)}{own} in {name} is not read")


def _check_units(first: str, second: str, of: str = "") -> None:
    """Raise ValueError for two units of different names."""
    if first and second and first != second:
        raise ValueError(f"{of}is in {first}, and not in {second}: no unit is converted")


def _given(parameter: Any, where: str) -> _Given:
    """Return the value of a parameter. Raises ValueError."""
    for kind in parameter.iterchildren("*"):
        text, unit = kind.get("value", ""), kind.get("unit", "")
        match etree.QName(kind).localname:
            case "Boolean" if text in _TRUTH:
                return _Given(_TRUTH[text], unit, where)
            case "String":
                return _Given(text, unit, where)
            case "Real" | "Integer" | "Enumeration" if (number := number_of(text.strip())) is not None:
                return _Given(number, unit, where)
    raise ValueError(f"{where}{parameter.get('name')} must be a finite number, a Boolean or a text")


def _linear(one: Any, where: str) -> tuple[float, float, bool]:
    """Return factor and offset of a connection or an entry of a mapping, and whether units are not to be converted.

    Raises ValueError.
    """
    found = one.find("{*}LinearTransformation")
    texts = ("1", "0") if found is None else (found.get("factor", "1"), found.get("offset", "0"))
    factor, offset = (number_of(text.strip()) for text in texts)
    if factor is None or offset is None:
        raise ValueError(f"{where}LinearTransformation: factor and offset must be finite numbers")
    return factor, offset, _TRUTH.get(one.get("suppressUnitConversion", ""), False)
