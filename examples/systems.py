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
    groups: Sequence[str] = ()
    """The connections for OSP, between variable groups of the components."""


def write_ssp(path: Path, system: System) -> None:
    """Write the SSP archive: the structure, with a parameter binding for each component, and the FMUs."""
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", _render("SystemStructure.ssd.j2", system))
        for component in system.components.values():
            archive.write(component.fmu, f"resources/{component.fmu.name}")


def write_osp(path: Path, system: System) -> None:
    """Write the OSP configuration. The FMUs and their OSP model descriptions are in the same folder."""
    path.write_text(_render("OspSystemStructure.xml.j2", system), encoding="utf-8")


def _render(template: str, system: System) -> str:
    return render(template, Path(__file__).parent / "templates", system=system, parameter_set=PARAMETER_SET)
