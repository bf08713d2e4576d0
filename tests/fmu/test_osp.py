"""The OSP model description contains every input and output in the groups of OSP-IS 1.0.1."""

from dataclasses import replace
from pathlib import Path

import pytest
from lxml import etree

from rov_fmu.cli import main
from rov_fmu.equation.layout import Layout
from rov_fmu.fmu.osp import osp_model_description, osp_path
from rov_fmu.fmu.variables import unit_of, variables
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE
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


@pytest.fixture(scope="module")
def groups(vehicle: Vehicle) -> list[etree._Element]:
    return groups_of(vehicle.layout)


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


@pytest.mark.parametrize(
    ("name", "element", "members"),
    [
        ("thruster_commands", "Generic", {"u_l": None, "u_r": None, "u_t": None}),
        ("external_force", "Force", {"X_ext": "x", "Z_ext": "z"}),
        ("thrust_t", "Force", {"F_t": "z"}),
        ("rear_torque", "Torque", {"tau_rear": "z"}),
        ("current", "LinearVelocity", {"V_N": "x", "V_E": "y"}),
        ("velocity", "LinearVelocity", {"u": "x", "w": "z"}),
        ("yaw_rate", "AngularVelocity", {"r": "z"}),
        ("position", "LinearDisplacement", {"x": "x", "y": "y"}),
        ("depth", "LinearDisplacement", {"z": "z"}),
        ("heading", "AngularDisplacement", {"psi": "z"}),
    ],
)
def test_what_systems_connect_by(
    groups: list[etree._Element], name: str, element: str, members: dict[str, str | None]
) -> None:
    (group,) = [group for group in groups if group.get("name") == name]
    assert group.tag == NAMESPACE + element
    assert {variable.get("ref"): variable.get("axis") for variable in group} == members


def test_the_names_of_groups_differ_whatever_the_names_of_curves_and_thrusters_are() -> None:
    """The torque of a curve `external` is in another group than the torque from outside."""
    layout = VEHICLES["VideoRay"].layout
    first, second = layout.curves
    renamed = replace(
        layout,
        curves=(replace(first, name="external"), second),
        thrusters=tuple(
            t.model_copy(update={"curve": {first.name: "external"}.get(t.curve, t.curve)}) for t in layout.thrusters
        ),
    )
    found = [group.get("name") for group in groups_of(renamed)]
    assert len({*found}) == len(found)
    assert {"external_torque_N_ext", "external_torque_tau_external"} <= {*found}


# ---- rov-fmu build --osp -------------------------------------------------------------------------------------------


def _build(path: Path) -> int:
    return main(["build", str(BARE), "--platform", "host", "-o", str(path), "--osp"])


@pytest.mark.usefixtures("without_page")
def test_the_option_writes_it_to_the_folder_of_the_fmu(tmp_path: Path) -> None:
    vehicle = load_vehicle(BARE)
    assert _build(tmp_path / "rov.fmu") == 0
    # libcosim looks for the name of the model, not of the archive
    path = tmp_path / "bare_OspModelDescription.xml"
    assert sorted(tmp_path.iterdir()) == [path, tmp_path / "rov.fmu"]
    assert osp_path(tmp_path / "rov.fmu", vehicle.identifier) == path
    assert path.read_bytes() == osp_model_description(vehicle.layout)
