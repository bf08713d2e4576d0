"""docs/sensors.md: its plan is a dive, its table tells the start values, and its distances are those of the system."""

import re
from pathlib import Path

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder

from rov_fmu.bridges.system.sensors import sensors_model
from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ROOT

PAGE = (ROOT / "docs" / "sensors.md").read_text(encoding="utf-8")
WAVES = (ROOT / "docs" / "waves.md").read_text(encoding="utf-8")


def block(page: str, language: str) -> str:
    first, *_ = re.findall(rf"^```{language}\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    return str(first)


def test_the_plan_of_the_page_is_a_dive_with_a_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sticks.py").write_text(block(PAGE, "python"), encoding="utf-8")
    FmuBuilder.build_FMU("sticks.py", dest=".")
    Path("dive.toml").write_text(block(PAGE, "toml").replace("stop_time = 60", "stop_time = 6"), encoding="utf-8")
    assert main(["system", "dive.toml", "-o", "dive.ssp", "--run"]) == 0
    header, *rows = Path("dive_sensors.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("time [s],u_1 [1],u_2 [1],u_3 [1],u_4 [1],u_5 [1],u_6 [1],depth [m],north velocity [m/s]")
    commands = np.array([row.split(",")[1:7] for row in rows], float)
    assert (np.ptp(commands, axis=0) > 0.1).all()
    assert sum(not row.split(",")[8] for row in rows) == 301 - 30, "velocities are told 5 times per second"


def test_the_table_of_the_page_has_the_start_values() -> None:
    start = {one.name: one.start for one in sensors_model(load_vehicle(SHIPPED["bluerov2"]), 0.02).variables}
    for words, name, value in (
        ("each second, 0.5 s late", "rate_position", 1.0),
        ("0.5 s late", "delay_position", 0.5),
        ("in steps of 0.1 m", "resolution_position", 0.1),
        ("20 Hz, 2 mm of noise", "rate_depth", 20.0),
        ("2 mm of noise", "noise_depth", 0.002),
        ("5 Hz, an offset of 1 mm/s", "rate_velocity", 5.0),
        ("an offset of 1 mm/s", "wander_velocity", 0.001),
        ("lock from 0.05 to 50 m", "altitude_least", 0.05),
        ("lock from 0.05 to 50 m", "altitude_most", 50.0),
        ("100 Hz, 0.2° of roll and pitch", "rate_attitude", 100.0),
        ("0.2° of roll and pitch", "wander_tilt", np.radians(0.2)),
        ("1° of heading", "wander_heading", np.radians(1.0)),
    ):
        assert words in PAGE
        assert start[name] == pytest.approx(value, rel=0.03), name


TRUE_POSITION = (
    ", ".join(f"{name}_position = 0" for name in ("rate", "delay", "noise", "wander", "resolution")) + ", outliers = 0"
)
FAILS = f"{TRUE_POSITION}, lost_from_velocity = 20, lost_for_velocity = 20"


@pytest.mark.parametrize(
    ("told", "start"),
    [
        pytest.param("`ideal = 1`", "ideal = 1", marks=pytest.mark.weekly),
        pytest.param("as they start, but with the true position", TRUE_POSITION, marks=pytest.mark.weekly),
        pytest.param("the same, and the DVL fails for 20 s", FAILS, marks=pytest.mark.long),
        pytest.param("as they start, with the USBL", "", marks=pytest.mark.weekly),
    ],
)
def test_the_heavy_keeps_station_as_the_page_says(
    told: str, start: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (distance,) = re.findall(rf"^\| {re.escape(told)} \| (\S+) cm \|$", PAGE, re.MULTILINE)
    heavy = SHIPPED["bluerov2_heavy"]
    for path in heavy.parent.iterdir():
        tmp_path.joinpath(path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    Path("my_rov.toml").write_text(f"waves = true\n{heavy.read_text(encoding='utf-8')}", encoding="utf-8")
    between = """
  ["rov.pose", "sensors.true_pose"], ["rov.velocity", "sensors.true_velocity"],
  ["rov.body_velocity", "sensors.true_body_velocity"], ["sensors.valid", "autopilot.valid"],
"""
    plan = block(WAVES, "toml")
    for name in ("pose", "velocity", "body_velocity"):
        plan = plan.replace(f'"rov.{name}", "autopilot.{name}"', f'"sensors.{name}", "autopilot.{name}"')
    plan = plan.replace("connect = [", f"connect = [{between}")
    plan += f'\n[component.sensors]\ncompanion = "sensors"\nfor = "rov"\nstart = {{ {start} }}\n'
    Path("plan.toml").write_text(plan, encoding="utf-8")
    assert main(["system", "plan.toml", "-o", "my.ssp", "--run"]) == 0
    motion = np.genfromtxt("my.csv", delimiter=",", names=True, deletechars="")
    off = np.sqrt(motion["rov.x"] ** 2 + motion["rov.y"] ** 2 + (motion["rov.z"] - 3.0) ** 2)
    assert 100.0 * off.max() == pytest.approx(float(distance), rel=0.02)
