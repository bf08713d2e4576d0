"""<modelName>_OspModelDescription.xml: the variables in groups that are connected as one (OSP-IS 1.0.1).

libcosim and the OSP tools look for it beside the FMU. The variables stay what modelDescription.xml says they are.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from rov_fmu.io.templates import render
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, Layout

# The element of a group by the unit of its variables, in the order that the schema prescribes.
_ELEMENTS = {
    "1": "Generic",
    "N": "Force",
    "N.m": "Torque",
    "m/s": "LinearVelocity",
    "rad/s": "AngularVelocity",
    "m": "LinearDisplacement",
    "rad": "AngularDisplacement",
}
_MOST = 3  # variables of a group

Members = Mapping[str, str | None]
"""Variables of a group, at most one an axis, and their axes: of the body, or north, east, down."""


def _groups(layout: Layout) -> Iterator[tuple[str, Members]]:
    """The groups by name, those too of which the vehicle has nothing.

    There is no mechanical port of force and velocity: velocities are through the water, power needs them over ground.
    """
    commands = list(layout.commands)
    for n in range(0, len(commands), _MOST):
        number = f"_{n // _MOST + 1}" if len(commands) > _MOST else ""
        yield f"thruster_commands{number}", dict.fromkeys(commands[n : n + _MOST])
    along = tuple(zip((SURGE, SWAY, HEAVE), "xyz", strict=True))
    yield "external_force", {axis.external: letter for axis, letter in along}
    for thruster in layout.thrusters:
        only = [letter for part, (_, letter) in zip(thruster.direction, along, strict=True) if abs(part) > 1.0 - 1e-9]
        yield f"thrust_{thruster.name}", {f"F_{thruster.name}": next(iter(only), None)}
    yield "external_torque", {"N_ext": "z"}
    for curve in layout.turning_curves:
        yield f"{curve.name}_torque", {f"tau_{curve.name}": "z"}
    yield "current", {"V_N": "x", "V_E": "y"}
    yield "velocity", {axis.velocity: letter for axis, letter in along}
    yield "yaw_rate", {"r": "z"}
    yield "position", {"x": "x", "y": "y"}
    yield "depth", {"z": "z"}
    yield "heading", {"psi": "z"}


def osp_model_description(layout: Layout) -> bytes:
    """The XML document: every input and output in one group. UTF-8, indented, the same bytes for the same vehicle."""
    unit_of = {name: meta.unit for name, meta in (layout.inputs | layout.state | layout.thrust).items()}
    groups = []
    for name, candidates in _groups(layout):
        if members := {variable: axis for variable, axis in candidates.items() if variable in unit_of}:
            (unit,) = {unit_of[variable] for variable in members}  # which they share
            groups.append((_ELEMENTS[unit], name, unit, members))
    order = list(_ELEMENTS.values())
    groups.sort(key=lambda group: order.index(group[0]))
    return render("osp.xml.j2", groups=groups).encode()


def osp_path(fmu: Path, identifier: str) -> Path:
    """Where the tools look for the description of an FMU."""
    return fmu.with_name(f"{identifier}_OspModelDescription.xml")
