"""What a system must know about each of its FMUs: variables, terminals, units, and what follows an input at once."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any

from lxml import etree

from rov_fmu.fmu.terminals import FOLDER
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, brief, did_you_mean, shown
from rov_fmu.io.reading import root_of_xml
from rov_fmu.prove.description import described, read_description
from rov_fmu.prove.runs import REAL
from rov_fmu.prove.unpacking import unpack_fmu

_TERMINALS = f"{FOLDER}/terminalsAndIcons.xml"
_MOST_BYTES = 4_000_000
"""The largest file of terminals that is read."""
_BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "factor", "offset")
"""What makes two units the same. Radians are 1: exporters differ in whether they count them."""
_NOT_CONNECTED = ("Binary", "Clock")

Value = float | int | bool | str


@dataclass(frozen=True)
class Part:
    """An FMU for Co-Simulation."""

    content: bytes
    description: Any
    """FMPy's."""
    terminals: Mapping[str, Mapping[str, str]]
    """The variables by the names of the members, for each terminal."""
    factors: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """By what a variable is multiplied to be the member of a terminal, where this is not 1."""

    @cached_property
    def variables(self) -> dict[str, Any]:
        """FMPy's variables by name, without arrays."""
        return {v.name: v for v in self.description.modelVariables if not v.dimensions and v.type not in _NOT_CONNECTED}

    @cached_property
    def direct(self) -> dict[str, list[str]]:
        """The inputs that each output follows without a step, as far as the FMU says so."""
        inputs = {v.name for v in self.variables.values() if v.causality == "input"}
        return {
            one.variable.name: [v.name for v in one.dependencies if v.name in inputs]
            for one in self.description.outputs
            if one.dependencies
        }

    def names(self, causality: str) -> list[str]:
        """Return the names of the variables of a causality."""
        return [name for name, v in self.variables.items() if v.causality == causality]

    def unit(self, name: str) -> tuple[str, tuple[float, ...] | None]:
        """Return the unit of a variable and what it consists of; an empty text and None where the FMU does not say."""
        v = self.variables[name]
        unit = v.unit or getattr(v.declaredType, "unit", None) or ""
        base = self._bases.get(unit)
        return unit, tuple(float(getattr(base, key)) for key in _BASES) if base else None

    @cached_property
    def _bases(self) -> dict[str, Any]:
        return {one.name: one.baseUnit for one in self.description.unitDefinitions}

    def with_ports(self, ports: Mapping[str, Mapping[str, tuple[str, float]]]) -> "Part":
        """Return the FMU with more terminals, for each the variable and the factor of each member. Raises ValueError
        with the port and the reason."""
        for port, members in ports.items():
            if port in self.variables or port in self.terminals:
                raise ValueError(f"{port}: the FMU has a variable or a terminal of this name")
            for name, _ in members.values():
                if name not in self.variables:
                    raise ValueError(f"{port}: {self.unknown(name)}")
        named = {port: {member: name for member, (name, _) in members.items()} for port, members in ports.items()}
        factors = {(port, member): factor for port, one in ports.items() for member, (_, factor) in one.items()}
        return replace(self, terminals={**self.terminals, **named}, factors=factors)

    def unknown(self, name: str) -> str:
        """Return the message about a name that the FMU does not have."""
        names = [*self.variables, *self.terminals]
        return f"the FMU has no variable or terminal {shown(name)}{did_you_mean(name, names, 3)}"

    def start_value(self, name: str, value: Value) -> Value:
        """Return a start value as the type of a variable has it. Raises ValueError with the reason."""
        if name not in self.variables:
            raise ValueError(self.unknown(name))
        v = self.variables[name]
        is_free = v.causality in ("input", "parameter") or v.initial in ("exact", "approx")
        if not is_free or v.variability == "constant":
            raise ValueError("cannot be set, because the FMU computes it")
        kind = kind_of(v)
        if kind == "String":
            if not isinstance(value, str):
                raise ValueError("must be text in quotes")
            return value
        if isinstance(value, str) or (kind == "Boolean") != isinstance(value, bool):
            raise ValueError("must be true or false" if kind == "Boolean" else "must be a number")
        if kind == "Boolean":
            return value
        if kind == "Integer" and value != int(value):
            raise ValueError("must be a whole number")
        low, high = (getattr(v, key) or getattr(v.declaredType, key, None) for key in ("min", "max"))
        if not float(low or -inf) <= value <= float(high or inf):
            raise ValueError(f"must be within {low or '-inf'} ... {high or 'inf'} {self.unit(name)[0]}".rstrip())
        return int(value) if kind == "Integer" else float(value)


def kind_of(variable: Any) -> str:
    """Return the type of SSP of a variable: Real, Integer, Boolean or String."""
    kind: str = variable.type
    return "Real" if kind in REAL else kind if kind in ("Boolean", "String") else "Integer"


def read_part(path: Path, content: bytes, where: str = "", *, is_ours: bool = False) -> Part:
    """Return an FMU from its content. Raises FileError.

    - `path`, `where`: the file that it is from, and where it is in this file, in words for messages.
    - `is_ours`: True for one that this process has just made, so that it needs no child process to read it.
    """
    path = Path(f"{path}{where}")
    with temporary_folder("fmu-") as folder:
        unpack_fmu(BytesIO(content), path, Path(folder))
        description = described(folder) if is_ours else read_description(path, Path(folder))
        terminals = _terminals(Path(folder, _TERMINALS), path)
    if description.fmiVersion[:1] not in ("2", "3"):
        raise FileError(f"{path}: is of FMI {description.fmiVersion}, and not of 2.0 or 3.0")
    if description.coSimulation is None:
        raise FileError(f"{path}: is not for Co-Simulation")
    return Part(content, description, terminals)


def _terminals(file: Path, fmu: Path) -> dict[str, dict[str, str]]:
    """Return the variables of each terminal by the names of the members. Raises FileError."""
    if not file.is_file():
        return {}
    if file.stat().st_size > _MOST_BYTES:
        raise FileError(f"{fmu}: {_TERMINALS} has more than {_MOST_BYTES} bytes, the most that are read")
    try:
        root = root_of_xml(file.read_bytes())
    except etree.XMLSyntaxError as error:
        raise FileError(f"{fmu}: {_TERMINALS}: not XML: {brief(error.msg)}") from error
    return {
        terminal.get("name", ""): {
            member.get("memberName", ""): member.get("variableName", "")
            for member in terminal.findall("TerminalMemberVariable")
        }
        for terminal in root.findall("Terminals/Terminal")
    }
