"""The OSP model description contains every input and output in the groups of OSP-IS 1.0.1."""

import pytest
from lxml import etree

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
        axes = [axis for variable in group if (axis := variable.get("axis"))]
        assert set(axes) <= {"x", "y", "z"}
        assert len(set(axes)) == len(axes)


# ---- rov-fmu build --osp -------------------------------------------------------------------------------------------
