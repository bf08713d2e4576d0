"""The VideoRay is the vehicle of the paper; all mistakes of its file are told together, and its folders are its own."""

import re
import shutil
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.vehicle.schema import NOT_GIVEN
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from tests.commands import ALONE
from tests.paper.test_paper import TABLE_9, WHOLE
from tests.vehicles import extended, sources_of

TEXT = VIDEORAY.read_text(encoding="utf-8")


def test_videoray_is_the_vehicle_of_the_paper(vehicle: Vehicle) -> None:
    assert vehicle.coefficients == TABLE_9 | WHOLE
    layout, ahead = vehicle.layout, (1.0, 0.0, 0.0)
    assert [*layout.by_name] == ["surge", "heave", "yaw"]
    assert {curve.name: (curve.keys, curve.n_thrusters) for curve in layout.curves} == {
        "rear": (("a_t", "b_t"), 2),
        "top": (("a_t", "b_t"), 1),
    }
    assert {t.name: (t.curve, t.direction.value, t.arm, t.position) for t in layout.thrusters} == {
        "l": ("rear", ahead, "port", None),
        "r": ("rear", ahead, "starboard", None),
        "t": ("top", (0.0, 0.0, 1.0), None, None),
    }
    assert set(vehicle.sources) == set(TABLE_9 | WHOLE)
    assert all("Table 9" in vehicle.sources[name] for name in TABLE_9)
    assert {vehicle.sources[name] for name in WHOLE} == {NOT_GIVEN}
    assert {one.name: [*sources_of(one)] for one in vehicle.layout.thrusters} == {n: ["direction"] for n in "lrt"}
    assert [a.values for a in vehicle.alternatives.values()] == [{"a_t_rear": 100.3, "b_t_rear": -27.09}]
    assert vehicle.command_range == (0.2, 0.7)


def test_a_turn_pushes_ahead_where_thrust_astern_is_weaker(vehicle: Vehicle) -> None:
    def weaker(share: float) -> Vehicle:
        return extended(vehicle, **{f"{key}_rear_reverse": share * vehicle[f"{key}_rear"] for key in ("a_t", "b_t")})

    ((axis, push),) = weaker(0.5).side_effects(YAW, 0.5)
    assert axis is SURGE
    assert push == pytest.approx(0.25 * vehicle.force(SURGE, 0.5))
    assert [*weaker(0.999).side_effects(YAW, 0.5), *vehicle.side_effects(SURGE, 0.5)] == []
    assert replace(vehicle, coefficients={**vehicle.coefficients, "beta_w": 0.0}).effective_inertia(HEAVE) == inf


def refusal(path: Path) -> str:
    """Return the message about a vehicle file that is refused."""
    with pytest.raises(VehicleFileError) as caught:
        load_vehicle(path)
    return str(caught.value)


def test_every_mistake_in_a_file_is_reported(tmp_path: Path) -> None:
    """Mistakes of form and contradictions are reported together."""
    path = tmp_path / "bad.toml"
    text = ALONE.replace("m_rov = { value = 6.57", "m_rov = { value = -1.0").replace('"kg.m2"', '"lb"')
    text = text.replace("command_min = 0.2", "command_min = 20").replace("R = {", "radius = {")
    text = text.replace("[vehicle]", '[vehicle]\ndata = "nowhere"').replace('curve = "top"', 'curve = "bottom"')
    path.write_text(text, encoding="utf-8")
    lines = refusal(path).splitlines()
    wrong = (
        "vehicle.data = 'nowhere'",
        "validity.command_min = 20",
        "body.m_rov.value = -1.0",
        "body.I_r.unit = 'lb'",
        "arm.R: ",
        "arm.radius",
        "thruster.t.curve = 'bottom'",
        "curves.top: no thruster",
    )
    assert len(lines) == len(wrong)
    for line, words in zip(lines, wrong, strict=True):
        assert line.startswith(f"{path}: {words}")


def test_the_tables_and_pictures_of_a_vehicle_are_its_files(tmp_path: Path) -> None:
    for folder in ("tables", "pictures"):
        shutil.copytree(VIDEORAY.parent / folder, tmp_path, dirs_exist_ok=True)
    path = tmp_path / "here.toml"
    path.write_text(re.sub(r'^(data|pictures) = "\w+"', r'\1 = "."', TEXT, flags=re.M), encoding="utf-8")
    (tmp_path / "here.fmu").touch()
    files = load_vehicle(path).files
    assert {tmp_path / "table3_heave_steady.csv", tmp_path / "model.png"} < {*files}
    assert {file.suffix for file in files} == {".csv", ".png", ".svg"}
