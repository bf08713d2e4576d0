"""A vehicle file without thrusters: its inputs are the loads from outside, and what needs thrusters is refused."""

from pathlib import Path

import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import write_vehicle

TEXT = """
format = 2

[vehicle]
name = "Drifter"
identifier = "drifter"
version = "1.0"
description = "A float that is pushed"
source = "Made up"

[validity]
command_min = 0.0
command_max = 1.0

[body]
m_rov = { value = 10.0, unit = "kg", source = "Made up" }

[axes.surge]
a_d = { value = 20.0, unit = "N.s2/m2", source = "Made up" }
b_d = { value = 0.0, unit = "N.s/m", source = "Made up" }
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "drifter.toml"
    file.write_text(TEXT, encoding="utf-8")
    return file


def test_it_moves_under_its_load_and_is_written_again(path: Path) -> None:
    rov = rov_fmu.load(path)
    assert [*rov.layout.inputs] == ["X_ext", "V_N", "V_E"]
    result = rov.simulate([0.0, 60.0], {"X_ext": 5.0})
    assert result["u"][-1] == pytest.approx((5.0 / 20.0) ** 0.5)
    write_vehicle(rov, path.with_name("again.toml"))
    assert load_vehicle(path.with_name("again.toml")).coefficients == rov.coefficients


def test_a_part_of_thrusters_needs_the_rest(path: Path) -> None:
    path.write_text(f"{TEXT}\n[inputs.ahead]\nl = 1.0\n", encoding="utf-8")
    with pytest.raises(VehicleFileError) as caught:
        load_vehicle(path)
    assert "thruster: this key is missing" in str(caught.value)
    assert "curves: this key is missing" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("sitl", "has no thrusters, so there is nothing that ArduSub could drive"),
        ("simulate --set surge=0.3", "no thruster drives this axis"),
        (
            "tune --axis surge --command 0.5 --v-ss 0.4",
            "no thruster drives this axis, so it cannot",
        ),
    ],
)
def test_what_needs_thrusters_is_refused(
    path: Path, capsys: pytest.CaptureFixture[str], arguments: str, words: str
) -> None:
    command, *rest = arguments.split()
    assert main([command, str(path), *rest]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
