"""Axes that no thruster drives alone: those of fins, and the sway of two thrusters with a toe-in."""

from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.adapter.tank_tests import TankTests, load_tank_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.vehicle.vehicle import VehicleFileError
from tests.commands import ROOT

HEAD = '[vehicle]\nname = "T"\nidentifier = "t"\nversion = "1.0"\ndescription = "t"\nsource = "t"\n'
TOE_IN = f"""{HEAD}[body]
m_rov = {{ value = 8.0, unit = "kg", source = "Weighed" }}
I_r = {{ value = 0.16, unit = "kg.m2", source = "CAD" }}
[curves.main]
a_t = {{ value = 30.0, unit = "N", source = "Maker" }}
b_t = {{ value = 3.0, unit = "N", source = "Maker" }}
[[thruster]]
name = "l"
curve = "main"
direction = {{ value = [0.97, 0.24, 0], source = "CAD" }}
position = {{ value = [-0.2, -0.12, 0], unit = "m", source = "CAD" }}
[[thruster]]
name = "r"
curve = "main"
direction = {{ value = [0.97, -0.24, 0], source = "CAD" }}
position = {{ value = [-0.2, 0.12, 0], unit = "m", source = "CAD" }}
"""


def read_tests(folder: Path, rov: str, header: str) -> TankTests:
    """Write rov.toml and a log whose columns all change."""
    (folder / "rov.toml").write_text(rov, encoding="utf-8")
    count = len(header.split(","))
    rows = (",".join(f"{np.sin(0.1 * n * (k + 1)):.4f}" for k in range(1, count)) for n in range(200))
    lines = (f"{0.1 * n:.1f},{row}" for n, row in enumerate(rows))
    (folder / "log_dive.csv").write_text("\n".join([header, *lines]), encoding="utf-8")
    return load_tank_tests(folder)


def test_the_sway_of_two_thrusters_with_a_toe_in_is_left_out(tmp_path: Path) -> None:
    header = "time [s],u_l [1],u_r [1],surge velocity [m/s],sway velocity [m/s],heading [rad]"
    tests = read_tests(tmp_path, TOE_IN, header)
    assert tests.recordings.keys() == {"surge", "yaw"}
    assert tests.given.rov.layout.kinds.keys() == {"surge", "yaw"}
    (warning,) = (line for line in by_heading(tests.findings)["Warnings"] if "sway" in line)
    assert "the motion in sway is left out, because the thrusters drive it only together with other axes" in warning


def test_sway_that_is_declared_is_named_as_the_wrong_table(tmp_path: Path) -> None:
    header = "time [s],u_l [1],u_r [1],surge velocity [m/s],sway velocity [m/s],heading [rad]"
    with pytest.raises(VehicleFileError, match=r"rov\.toml: axes\.sway: the thrusters cancel: .* together with yaw;"):
        read_tests(tmp_path, f"{TOE_IN}[axes.sway]\n", header)


def test_the_fins_of_a_base_stay_and_are_not_fitted(tmp_path: Path) -> None:
    base = ROOT / "examples" / "remus100" / "remus100.toml"
    (tmp_path / "remus100.toml").write_bytes(base.read_bytes())
    header = "time [s],u_prop [1],u_rudder [1],u_plane [1],surge velocity [m/s],heading [rad]"
    tests = read_tests(tmp_path, f'base = "remus100.toml"\n{HEAD}', header)
    assert tests.recordings.keys() == {"surge"}
    assert {"rudder", "plane"} <= tests.given.thruster_sources.keys()
    told = " ".join(by_heading(tests.findings)["Warnings"])
    assert "rudder and plane: the lift of fins is not fitted" in told
    assert "the recording of yaw is left out: no thruster drives it" in told


def test_an_input_of_a_couple_that_drives_no_tested_axis_is_left_out_with_its_thrusters(tmp_path: Path) -> None:
    """The thrusters n1 and n2 push to the sides, and turn the vehicle together."""
    rov = TOE_IN.partition("[[thruster]]")[0]
    for name, direction, at in (("y", [0, 1, 0], 0.0), ("n1", [0, 1, 0], 0.5), ("n2", [0, -1, 0], -0.5)):
        rov += f'[[thruster]]\nname = "{name}"\ncurve = "main"\ndirection = {{ value = {direction}, source = "CAD" }}\n'
        rov += f'position = {{ value = [{at}, 0, 0], unit = "m", source = "CAD" }}\n'
    rov += "[inputs]\nside = { y = 1.0 }\nturn = { n1 = 1.0, n2 = 1.0 }\n"
    tests = read_tests(tmp_path, rov, "time [s],u_side [1],u_turn [1],sway velocity [m/s]")
    assert [thruster.name for thruster in tests.given.rov.layout.thrusters] == ["y"]
    assert [*tests.given.rov.layout.mix] == ["side"]
