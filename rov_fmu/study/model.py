"""The FMU or the vehicle that a study runs, and its variables."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from math import inf
from pathlib import Path

from rov_fmu.c.compile import LANES_FILE
from rov_fmu.c.library import engine_sources
from rov_fmu.fmu.variables import variables
from rov_fmu.fmus.fmu import Fmu
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.fmus.variable import Variable
from rov_fmu.io.messages import did_you_mean, shown
from rov_fmu.vehicle.vehicle import Vehicle


@dataclass(frozen=True)
class Model:
    """An FMU for Co-Simulation, or a vehicle with the variables of its FMU."""

    name: str
    """The name of its file."""
    content: bytes
    """The FMU; or of a vehicle, everything that its motion depends on."""
    variables: Mapping[str, Variable]
    """The numeric variables, by name."""
    vehicle: Vehicle | None = None
    """The vehicle that the engine runs without an FMU."""

    def unpack(self, folder: Path) -> None:
        """Unpack the FMU into a folder. Raises FileError."""
        unpack_fmu(BytesIO(self.content), Path(self.name), folder)

    def running(self, folder: str) -> str:  # noqa: ARG002 (a system has a folder for each FMU)
        """Return in words what a process ran that did not return."""
        return "the FMU"


def read_model(path: Path) -> Model:
    """Read an FMU. Raises FileError if it cannot be unpacked, or is not for Co-Simulation of FMI 2.0 or 3.0."""
    fmu = Fmu.open(path)
    return Model(path.name, fmu.content, {name: v for name, v in fmu.variables.items() if v.kind != "String"})


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
            v.nominal or 0.0,
        )
        for v in variables(vehicle)
    }
    parts = [engine_sources(vehicle.layout, LANES_FILE), {name: vehicle[name] for name in vehicle.layout.coefficients}]
    return Model(f"{vehicle.identifier}.fmu", json.dumps(parts).encode(), has, vehicle)


def unsettable(name: str, has: Mapping[str, Variable]) -> str:
    """Return why no variable of this name can be set, or an empty text."""
    if name not in has:
        return unknown(name, has)
    return "" if has[name].can_be_set else "it cannot be set, because the FMU computes it"


def unknown(name: str, names: Mapping[str, object]) -> str:
    """Return the message about a name that the FMU does not have."""
    return f"the FMU has no variable {shown(name)} that is a number{did_you_mean(name, names, 3)}"
