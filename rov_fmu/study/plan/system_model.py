"""The system (SSP) that a study runs. Its variables are those of all components, with the names component.variable."""

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

from rov_fmu.bridges.system.connections import Connection
from rov_fmu.bridges.system.master import Name, busy, folders_of
from rov_fmu.bridges.system.part import Part
from rov_fmu.bridges.system.ssp import read_ssp
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.fmus.variable import Value, Variable
from rov_fmu.io.reading import read_bytes
from rov_fmu.study.plan.model import Model


@dataclass(frozen=True, kw_only=True)
class SystemModel(Model):
    """A system, whose content is that of the SSP."""

    sources: Mapping[str, str]
    """The path of the FMU of each component in the SSP."""
    values: Mapping[str, Mapping[str, Value]]
    """The start values of each component."""
    connections: Sequence[Connection]

    def unpack(self, folder: Path) -> None:
        """Unpack the FMU of each component into a folder of its own. Raises FileError."""
        with zipfile.ZipFile(BytesIO(self.content)) as archive:  # read_ssp has checked it
            for name, own in folders_of(folder, self.sources).items():
                unpack_fmu(BytesIO(archive.read(self.sources[name])), Path(f"{self.name}: {name}"), own)

    def running(self, folder: str) -> str:
        """Return the component that a process ran which did not return."""
        return busy(folder, self.sources)


def split(name: str) -> Name:
    """Return the component and the variable of a name."""
    component, _, own = name.partition(".")
    return component, own


def read_system(path: Path) -> SystemModel:
    """Read a system. Raises FileError."""
    system = read_ssp(path)
    connected = {one.end for one in system.connections}
    variables = {
        f"{component}.{name}": _variable(
            component, part, name, system.values[component], (component, name) in connected
        )
        for component, part in system.parts.items()
        for name in part.variables
        if part.variables[name].kind != "String"
    }
    return SystemModel(
        name=path.name,
        content=read_bytes(path),
        variables=variables,
        sources=system.sources,
        values=system.values,
        connections=system.connections,
    )


def _variable(component: str, part: Part, name: str, values: Mapping[str, Value], connected: bool) -> Variable:
    """Return a variable of a component with its start value in the system. One that is connected cannot be set."""
    own = part.variables[name]
    return replace(
        own,
        name=f"{component}.{name}",
        start=float(values.get(name, own.start)),
        can_be_set=own.can_be_set and not connected,
        causality="connected" if connected else own.causality,
    )
