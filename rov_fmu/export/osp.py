"""<modelName>_OspModelDescription.xml: the variables in groups that are connected as one (OSP-IS 1.0.1).

libcosim and the OSP tools look for it beside the FMU. The variables stay what modelDescription.xml says they are.
"""

from collections.abc import Mapping
from pathlib import Path

from rov_fmu.export.interface import Variable
from rov_fmu.files.templates import render

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

# name: its variables, at most one an axis, and their axes: of the body, or north, east, down. There is no mechanical
# port of force and velocity: u and w are through the water, and power needs them over ground.
_GROUPS: dict[str, dict[str, str | None]] = {
    "thruster_commands": {"u_l": None, "u_r": None, "u_t": None},
    "external_force": {"X_ext": "x", "Z_ext": "z"},
    "left_thrust": {"F_l": "x"},
    "right_thrust": {"F_r": "x"},
    "top_thrust": {"F_t": "z"},
    "external_torque": {"N_ext": "z"},
    "rear_torque": {"tau_rear": "z"},
    "current": {"V_N": "x", "V_E": "y"},
    "velocity": {"u": "x", "w": "z"},
    "yaw_rate": {"r": "z"},
    "position": {"x": "x", "y": "y"},
    "depth": {"z": "z"},
    "heading": {"psi": "z"},
}


def osp_model_description(variables: tuple[Variable, ...]) -> bytes:
    """The XML document: every input and output in one group. UTF-8, indented, the same bytes for the same arguments."""
    by_name = {v.name: v for v in variables}
    units = {name: _unit(axes, by_name) for name, axes in _GROUPS.items()}
    order = list(_ELEMENTS)
    groups = [(_ELEMENTS[units[name]], name, units[name], _GROUPS[name])
              for name in sorted(_GROUPS, key=lambda name: order.index(units[name]))]  # fmt: skip
    return render("osp.xml.j2", groups=groups).encode()


def _unit(names: Mapping[str, str | None], by_name: Mapping[str, Variable]) -> str:
    """The unit that the variables of a group share."""
    (unit,) = {by_name[name].unit for name in names}
    return unit


def osp_path(fmu: Path, identifier: str) -> Path:
    """Where the tools look for the description of an FMU."""
    return fmu.with_name(f"{identifier}_OspModelDescription.xml")
