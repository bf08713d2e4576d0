"""The FMU or the vehicle that a study runs, and its variables."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any

from rov_fmu.c.compile import LANES_FILE
from rov_fmu.c.library import engine_sources
from rov_fmu.fmu.variables import variables
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, did_you_mean, shown
from rov_fmu.io.reading import read_bytes
from rov_fmu.prove.description import read_description
from rov_fmu.prove.runs import NUMBERS
from rov_fmu.prove.unpacking import unpack_fmu
from rov_fmu.vehicle.vehicle import Vehicle

TYPES = {
    2: {"Real": "f8", "Integer": "i4", "Enumeration": "i4", "Boolean": "i4"},
    3: {kind: kind.lower() for kind in NUMBERS if kind[-1].isdigit()} | {"Enumeration": "i8", "Boolean": "?"},
}
"""The NumPy type of each numeric type of variable, by the version of FMI."""
_WHOLE = ("Integer", "Enumeration", "Int")
_FUNCTIONS = {2: {"Enumeration": "Integer"}, 3: {"Enumeration": "Int64"}}


@dataclass(frozen=True)
class Variable:
    """A numeric variable of an FMU."""

    name: str
    reference: int
    type: str
    """The name of its type in FMI."""
    causality: str
    can_be_set: bool
    """True when it can be set before a run."""
    is_continuous: bool
    minimum: float
    maximum: float
    unit: str
    start: float
    """The start value, or 0 if the FMU gives none."""
    description: str = ""

    @property
    def is_whole(self) -> bool:
        """True when it holds only whole numbers."""
        return self.type.removeprefix("U").startswith(_WHOLE)

    def wrong(self, value: float) -> str:
        """Return why the variable cannot have this value, or an empty text."""
        if self.type == "Boolean" and value not in (0.0, 1.0):
            return "must be true or false, or 1 or 0"
        if self.is_whole and value != int(value):
            return "must be a whole number"
        if not self.minimum <= value <= self.maximum:
            return f"must be within {self.minimum:.12g} ... {self.maximum:.12g}{f' {self.unit}' * (self.unit != '1')}"
        return ""

    def dtype(self, version: int) -> str:
        """Return the NumPy name of its type."""
        return TYPES[version][self.type]

    def function(self, version: int) -> str:
        """Return the suffix of its FMI functions, such as Real in fmi2GetReal."""
        return _FUNCTIONS[version].get(self.type, self.type)


@dataclass(frozen=True)
class Model:
    """An FMU for Co-Simulation, or a vehicle with the variables of its FMU."""

    name: str
    """The name of its file."""
    content: bytes
    """The FMU; or of a vehicle, everything that its motion depends on."""
    version: int
    """The version of FMI, 2 or 3."""
    variables: Mapping[str, Variable]
    """The numeric variables, by name."""
    vehicle: Vehicle | None = None
    """The vehicle that the engine runs without an FMU."""

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return sha256(self.content).hexdigest()

    def unpack(self, folder: Path) -> None:
        """Unpack the FMU into a folder. Raises FileError."""
        unpack_fmu(BytesIO(self.content), Path(self.name), folder)


def read_model(path: Path) -> Model:
    """Read an FMU. Raises FileError if it cannot be unpacked, or is not for Co-Simulation of FMI 2.0 or 3.0."""
    content = read_bytes(path)
    with temporary_folder("fmu-") as folder:
        unpack_fmu(BytesIO(content), path, Path(folder))
        description = read_description(path, Path(folder))
    version = {"2": 2, "3": 3}.get(description.fmiVersion[:1])
    if version is None:
        raise FileError(f"{path}: is of FMI {description.fmiVersion}, and not of 2.0 or 3.0")
    if description.coSimulation is None:
        raise FileError(f"{path}: is not for Co-Simulation")
    variables = {
        v.name: variable(v) for v in description.modelVariables if v.type in TYPES[version] and not v.dimensions
    }
    return Model(path.name, content, version, variables)


def vehicle_fmu(vehicle: Vehicle) -> Model:
    """Build the FMU of a vehicle for this machine, and read it. Raises BuildError."""
    from rov_fmu.build import build_fmu

    with temporary_folder("fmu-") as folder:
        return read_model(build_fmu(vehicle, Path(folder, f"{vehicle.identifier}.fmu"), platforms=["host"]).path)


def vehicle_model(vehicle: Vehicle) -> Model:
    """Return a vehicle that runs in the engine, with the variables that its FMU of FMI 2.0 has.

    A quaternion cannot be set, because the FMU computes the attitude at the start from the Euler angles.
    """
    has = {
        v.name: Variable(
            v.name,
            v.value_reference,
            "Real",
            v.causality,
            v.causality == "input" or v.initial == "exact",
            v.variability == "continuous",
            -inf if v.minimum is None else v.minimum,
            inf if v.maximum is None else v.maximum,
            v.unit,
            v.start or 0.0,
            v.description,
        )
        for v in variables(vehicle)
    }
    parts = [engine_sources(vehicle.layout, LANES_FILE), {name: vehicle[name] for name in vehicle.layout.coefficients}]
    return Model(f"{vehicle.identifier}.fmu", json.dumps(parts).encode(), 2, has, vehicle)


def unsettable(name: str, has: Mapping[str, Variable]) -> str:
    """Return why no variable of this name can be set, or an empty text."""
    if name not in has:
        return unknown(name, has)
    return "" if has[name].can_be_set else "it cannot be set, because the FMU computes it"


def unknown(name: str, names: Mapping[str, object]) -> str:
    """Return the message about a name that the FMU does not have."""
    return f"the FMU has no variable {shown(name)} that is a number{did_you_mean(name, names, 3)}"


def variable(v: Any) -> Variable:
    """Return a variable of FMPy's."""
    can_be_set = v.causality == "input" or (v.variability != "constant" and v.initial in ("exact", "approx"))
    declared = v.declaredType
    low, high, unit = (getattr(v, key) or getattr(declared, key, None) for key in ("min", "max", "unit"))
    return Variable(
        v.name,
        v.valueReference,
        v.type,
        v.causality,
        can_be_set,
        v.variability == "continuous",
        -inf if low is None else float(low),
        inf if high is None else float(high),
        unit or "1",
        _number(v.start),
        v.description or "",
    )


def _number(start: Any) -> float:
    """Return a start value that FMPy read as a number, or 0."""
    try:
        return float({"true": 1.0, "false": 0.0}.get(str(start), start))
    except (TypeError, ValueError):
        return 0.0
