"""The OSP model description contains every input and output in the groups of OSP-IS 1.0.1."""

import pytest
from lxml import etree

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY
from rov_fmu.equation.layout import Layout
from rov_fmu.fmu.osp import osp_model_description
from rov_fmu.fmu.variables import unit_of, variables
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import SIX, VEHICLES

NAMESPACE = "{https://open-simulation-platform.com/OspModelDescription/1.0.1}"

# The elements for motion in the sequence of the schema, with the dimension of their variables.
SEQUENCE = {
    "Generic": {},
    "Force": {"kg": 1, "m": 1, "s": -2},
    "Torque": {"kg": 1, "m": 2, "s": -2},
    "LinearVelocity": {"m": 1, "s": -1},
    "AngularVelocity": {"rad": 1, "s": -1},
    "LinearDisplacement": {"m": 1},
    "AngularDisplacement": {"rad": 1},
}


LETTERS = {
    name: letter
    for letter, names in {
        "x": "u p x phi X_ext K_ext V_N",
        "y": "v q y theta Y_ext M_ext V_E",
        "z": "w r z psi Z_ext N_ext V_D",
    }.items()
    for name in names.split()
}
"""The axis along or about which each variable acts, in the body frame or in NED; torques of curves act about z."""


def groups_of(layout: Layout) -> list[etree._Element]:
    root = etree.fromstring(osp_model_description(layout))
    assert root.tag == f"{NAMESPACE}OspModelDescription"
    assert dict(root.attrib) == {"version": "1.0"}
    (parent,) = root
    assert parent.tag == f"{NAMESPACE}VariableGroups"
    return list(parent)


def references(group: etree._Element) -> list[str]:
    assert {variable.tag for variable in group} == {f"{NAMESPACE}Variable"}
    return [variable.get("ref") for variable in group]


@pytest.mark.parametrize("rov", [*VEHICLES.values(), SIX], ids=[*VEHICLES, "six axes"])
def test_every_input_and_output_is_in_one_group(rov: Vehicle) -> None:
    """The variables of a group have the same causality and unit, and different axes."""
    groups = groups_of(rov.layout)
    declared = {v.name: v for v in variables(rov)}
    grouped = sorted(name for group in groups for name in references(group))
    assert grouped == sorted(v.name for v in declared.values() if v.causality in {"input", "output"})
    names = [group.get("name") for group in groups]
    assert all(names)
    assert len(set(names)) == len(names)
    for group in groups:
        members = [declared[name] for name in references(group)]
        assert 1 <= len(members) <= 3
        assert len({v.causality for v in members}) == 1
        assert [v.unit for v in members] == [variable.get("unit") for variable in group]
        (unit,) = {v.unit for v in members}
        assert unit_of(unit).exponents == SEQUENCE[group.tag.removeprefix(NAMESPACE)]
    order = [[*SEQUENCE].index(group.tag.removeprefix(NAMESPACE)) for group in groups]
    assert order == sorted(order)
    axes = {variable.get("ref"): variable.get("axis") for group in groups for variable in group}
    directions = {f"F_{one.name}": map(one.effect, (SURGE, SWAY, HEAVE)) for one in rov.layout.thrusters}
    along = {
        name: next((letter for letter, x in zip("xyz", parts, strict=True) if abs(x) > 0.999), None)
        for name, parts in directions.items()
    }
    about = {f"tau_{curve.name}": "z" for curve in rov.layout.turning_curves}
    assert axes == {name: (LETTERS | along | about).get(name) for name in axes}
