"""<modelName>_OspModelDescription.xml: the variables in groups that are connected as one (OSP-IS 1.0.1).

libcosim and the OSP tools look for it beside the FMU. The variables stay what modelDescription.xml says they are.
"""

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
    unit_of = {v.name: v.unit for v in variables}
    groups = []
    for name, members in _GROUPS.items():
        (unit,) = {unit_of[variable] for variable in members}  # which they share
        groups.append((_ELEMENTS[unit], name, unit, members))
    order = list(_ELEMENTS.values())
    groups.sort(key=lambda group: order.index(group[0]))
    return render("osp.xml.j2", groups=groups).encode()


def osp_path(fmu: Path, identifier: str) -> Path:
    """Where the tools look for the description of an FMU."""
    return fmu.with_name(f"{identifier}_OspModelDescription.xml")
