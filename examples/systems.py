"""Write a system of FMUs for co-simulation tools, as an SSP 1.0 archive or as an OSP configuration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from zipfile import ZipFile

from rov_fmu.io.templates import render

PARAMETER_SET = "initial_values"
"""The name of every component's parameter set. Ecos uses the sets of one name."""


@dataclass(frozen=True)
class Component:
    """An FMU, its start values and its connectors."""

    fmu: Path
    values: Mapping[str, float | bool]
    inputs: Sequence[str]
    outputs: Sequence[str]


@dataclass(frozen=True)
class System:
    """Components that are stepped together every `step` seconds until `stop`."""

    name: str
    components: Mapping[str, Component]
    step: float
    stop: float
    connections: Mapping[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    """The connections from outputs to inputs, each given by component and variable."""
    groups: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """The connections for OSP between variable groups of two components, which stand for all connections of the two."""

    @property
    def single_connections(self) -> list[tuple[tuple[str, str], tuple[str, str]]]:
        """The connections that no group stands for."""
        grouped = [{*pair} for pair in self.groups.values()]
        return [(start, end) for start, end in self.connections.items() if {start[0], end[0]} not in grouped]


def write_ssp(path: Path, system: System) -> None:
    """Write the SSP archive: the structure, and for each component its FMU and a parameter set (SSV)."""
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", _rendered("SystemStructure.ssd.j2", system=system))
        for name, component in system.components.items():
            archive.write(component.fmu, f"resources/{component.fmu.name}")
            archive.writestr(f"resources/{name}.ssv", parameter_set(component))


def parameter_set(component: Component) -> str:
    """Return the parameter set (SSV) of a component."""
    return _rendered("ParameterSet.ssv.j2", component=component)


def write_osp(path: Path, system: System) -> None:
    """Write the OSP configuration. The FMUs and their OSP model descriptions are in the same folder."""
    path.write_text(_rendered("OspSystemStructure.xml.j2", system=system), encoding="utf-8")


def _rendered(template: str, **content: Component | System) -> str:
    return render(template, Path(__file__).parent / "templates", parameter_set=PARAMETER_SET, **content)
