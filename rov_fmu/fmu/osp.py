"""Write <modelName>_OspModelDescription.xml, which groups variables that are connected as a whole (OSP-IS 1.0.1).

libcosim and the OSP tools look for it in the folder of the FMU. It changes nothing in modelDescription.xml.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import EARTH, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, over_ground_name
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Point
from rov_fmu.equation.units import UNITS, parsed_unit
from rov_fmu.io.templates import render

_PORT = "LinearMechanicalPort"
"""The element of OSP-IS for a force and a velocity, which comes after those of one unit."""
_MAX_MEMBERS = 3
"""The largest number of variables in a group."""

Members = Mapping[str, str | None]
"""The variables of a group, each with its axis in the body frame or in NED; at most one variable for an axis."""


def _groups(layout: Layout) -> Iterator[tuple[str, Members]]:
    """Yield the name and members of every group, including members that this vehicle does not have."""
    commands = list(layout.commands)
    for n in range(0, len(commands), _MAX_MEMBERS):
        number = f"_{n // _MAX_MEMBERS + 1}" if len(commands) > _MAX_MEMBERS else ""
        yield f"thruster_commands{number}", dict.fromkeys(commands[n : n + _MAX_MEMBERS])
    yield "battery", {"voltage": None}
    along = tuple(zip((SURGE, SWAY, HEAVE), "xyz", strict=True))
    yield "external_force", {axis.external: letter for axis, letter in along}
    for thruster in layout.thrusters:
        only = [
            letter for part, (_, letter) in zip(thruster.direction.value, along, strict=True) if abs(part) > 1.0 - 1e-9
        ]
        yield f"thrust_{thruster.name}", {f"F_{thruster.name}": next(iter(only), None)}
        yield f"rotor_{thruster.name}", {f"n_{thruster.name}": None}
    about = tuple(zip((ROLL, PITCH, YAW), "xyz", strict=True))
    yield "external_torque", {axis.external: letter for axis, letter in about}
    for curve in layout.turning_curves:
        yield f"{curve.name}_torque", {f"tau_{curve.name}": "z"}
    yield "current", {"V_N": "x", "V_E": "y", "V_D": "z"}
    yield "velocity", {over_ground_name(direction): letter for letter, (direction, _) in EARTH.items()}
    yield "velocity_through_water", {axis.velocity: letter for axis, letter in along}
    yield "angular_velocity" if layout.has_attitude else "yaw_rate", {axis.velocity: letter for axis, letter in about}
    yield "position", {"x": "x", "y": "y"}
    yield "depth", {"z": "z"}
    yield "attitude" if layout.has_attitude else "heading", {"phi": "x", "theta": "y", "psi": "z"}
    scalar, *vector = QUATERNION
    yield "quaternion_scalar", {scalar: None}
    yield "quaternion_vector", dict.fromkeys(vector)
    yield "validity", {"outside": None}
    for point in layout.points:
        yield f"{point.name}_position", {point.coordinate(axis): axis for axis in "xyz"}


class _Group(NamedTuple):
    """A group of variables of one unit, or a port with two such groups."""

    element: str
    name: str
    members: Mapping[str, str | None] = MappingProxyType({})
    unit: str = ""
    parts: tuple["_Group", ...] = ()


def _port(point: Point) -> _Group:
    """Return the port of a point: a force that acts there goes in, and the velocity over ground comes out."""
    force = {point.force(direction): axis for axis, (direction, _) in EARTH.items()}
    velocity = {point.coordinate(over_ground_name(direction)): axis for axis, (direction, _) in EARTH.items()}
    parts = _Group("Force", "force", force, "N"), _Group("LinearVelocity", "linear_velocity", velocity, "m/s")
    return _Group(_PORT, f"point_{point.name}", parts=parts)


def osp_model_description(layout: Layout) -> bytes:
    """Return the XML document. Every input and output is in one group; those that `_groups` lacks have their own."""
    declared = layout.inputs | layout.state | layout.calculated
    units = {name: one.unit for name, one in declared.items()}
    ports = [*map(_port, layout.points)]
    groups = [*ports]
    in_ports = {variable for port in ports for part in port.parts for variable in part.members}
    possible = [*_groups(layout)]
    placed = in_ports.union(*(members for _, members in possible))
    possible += [(variable, {variable: None}) for variable in units if variable not in placed]
    names = [*(name for name, _ in possible), *(port.name for port in ports)]
    for name, candidates in possible:
        if members := {variable: candidates[variable] for variable in units if variable in candidates}:
            (unit,) = {units[variable] for variable in members}
            # the name of a curve or a thruster may make a name that another group has
            unique = name if names.count(name) == 1 else "_".join((name, *members))
            groups.append(_Group(parsed_unit(unit).element, unique, members, unit))
    grouped = [variable for group in groups for variable in group.members]
    assert sorted([*grouped, *in_ports]) == sorted(units), "every variable must be in one group"
    order = [*(unit.element for unit in UNITS.values()), _PORT]
    groups.sort(key=lambda group: order.index(group.element))
    return render("osp.xml.j2", groups=groups).encode()


def osp_path(fmu: Path, identifier: str) -> Path:
    """Return the path at which the tools look for the description of an FMU."""
    return fmu.with_name(f"{identifier}_OspModelDescription.xml")
