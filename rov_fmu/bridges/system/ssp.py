"""Write a system of FMUs for co-simulation tools, as SSP 1.0, and read it from SSP."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import Any

from lxml import etree

from rov_fmu.bridges.system.connections import Connection, SystemStructure, checked_connection
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.fmu.archive import archive
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.fmus.variable import Value
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


def read_ssp(path: Path) -> SystemStructure:
    """Read an SSP 1.0 whose components are FMUs, without systems in the system. Raises FileError."""
    check_suffix(path, SYSTEM)
    with temporary_folder("ssp-") as unpacked:
        folder = Path(unpacked)
        unpack_fmu(BytesIO(read_bytes(path)), path, folder, SYSTEM)
        try:
            return _structure(folder, path)
        except ValueError as error:
            if isinstance(error, FileError):
                raise
            raise FileError(f"{path}: {error}") from error


def _structure(folder: Path, path: Path) -> SystemStructure:
    """Return the system in a folder. Raises FileError, or ValueError with only the reason."""
    root = _root(folder, _STRUCTURE)
    parts: dict[str, SystemFmu] = {}
    read: dict[str, SystemFmu] = {}
    values: dict[str, dict[str, Value]] = {}
    sources: dict[str, str] = {}
    for element in root.iterfind("{*}System/{*}Elements/*"):
        name = element.get("name", "")
        if etree.QName(element).localname != "Component":
            raise ValueError(f"{_STRUCTURE}: {shown(name)} is no component: systems in systems are not read")
        if not name or "." in name or name in parts:  # a.b is the variable b of the component a
            rule = "must not be empty, have a point, or be that of another component"
            raise ValueError(f"{_STRUCTURE}: the name of a component, {shown(name)}, {rule}")
        source = sources[name] = element.get("source", "")
        if source not in read:
            read[source] = SystemFmu.open(Path(f"{path}: {name}"), _file(folder, source).read_bytes())
        part = parts[name] = read[source]
        values[name] = {}
        for binding in element.iterfind("{*}ParameterBindings/{*}ParameterBinding"):
            own = binding.get("source")
            for given in (_root(folder, own) if own else binding).iterfind(".//{*}Parameters/{*}Parameter"):
                key = given.get("name", "")
                try:
                    values[name][key] = part.start_value(key, _value(given))
                except ValueError as error:
                    raise ValueError(f"start value of {name}.{key}: {error}") from error
    if not parts:
        raise ValueError(f"{_STRUCTURE}: has no component")
    connections = [_connection(one, parts) for one in root.iterfind("{*}System/{*}Connections/{*}Connection")]
    return SystemStructure(parts, values, connections, sources)


def _file(folder: Path, name: str) -> Path:
    """Return the path of a file of an unpacked system. Raises ValueError."""
    try:
        path = inside(folder, name)
    except ValueError as error:
        raise ValueError(f"source = {shown(name)}: {error}") from error
    if not path.is_file():
        raise ValueError(f"source = {shown(name)}: there is no such file in the archive")
    return path


def _root(folder: Path, name: str) -> Any:
    """Return the root element of a file of an unpacked system. Raises ValueError."""
    path = _file(folder, name)
    check_size(name, path.stat().st_size, _MOST_BYTES, ValueError)
    try:
        return root_of_xml(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def _value(parameter: Any) -> Value:
    """Return the value of a parameter. Raises ValueError."""
    for kind in parameter:
        text = kind.get("value", "")
        match etree.QName(kind).localname:
            case "Boolean":
                return bool(text in ("true", "1"))
            case "String":
                return str(text)
            case "Real" | "Integer" | "Enumeration" if isfinite(number := float(text)):
                return number
    raise ValueError("must be a finite number, a Boolean or a text")


def _connection(one: Any, parts: Mapping[str, SystemFmu]) -> Connection:
    """Return a connection. Raises ValueError."""
    keys = "startElement", "startConnector", "endElement", "endConnector"
    start, output, end, name = (one.get(key, "") for key in keys)
    changed = one.find("{*}LinearTransformation")
    factor = 1.0 if changed is None else float(changed.get("factor", 1.0))
    if (changed is not None and float(changed.get("offset", 0.0))) or not isfinite(factor):
        raise ValueError(f"the connection from {start}.{output}: only a finite factor without an offset is read")
    return checked_connection(Connection((start, output), (end, name), factor), parts)
