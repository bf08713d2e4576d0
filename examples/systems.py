"""A system of FMUs as files for co-simulation tools: an SSP 1.0 archive, an OSP configuration beside the FMUs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from zipfile import ZipFile

from rov_fmu.io.templates import render

PARAMETER_SET = "initial_values"
"""The name of every component's parameter set: Ecos takes those of one name."""


@dataclass(frozen=True)
class Component:
    """An FMU, the values that it starts with, and its connectors."""

    fmu: Path
    values: Mapping[str, float | bool]
    inputs: Sequence[str]
    outputs: Sequence[str]


@dataclass(frozen=True)
class System:
    """Components, stepped at once every `step` seconds until `stop`."""

    name: str
    components: Mapping[str, Component]
    step: float
    stop: float
    connections: Mapping[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    """From output to input: component and variable."""
    groups: Sequence[str] = ()
    """The same for OSP: variable groups that all components have."""


def write_ssp(path: Path, system: System) -> None:
    """Write the SSP archive: the structure, with one parameter binding a component, and the FMUs."""
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", _render("SystemStructure.ssd.j2", system))
        for component in system.components.values():
            archive.write(component.fmu, f"resources/{component.fmu.name}")


def write_osp(path: Path, system: System) -> None:
    """Write the OSP configuration; the FMUs and their OSP model descriptions stand beside it."""
    path.write_text(_render("OspSystemStructure.xml.j2", system), encoding="utf-8")


def _render(template: str, system: System) -> str:
    return render(template, Path(__file__).parent / "templates", system=system, parameter_set=PARAMETER_SET)
