"""The plot of a system, and the line in the terminal, show how well an autopilot holds a vehicle."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import autopilot_model
from rov_fmu.bridges.system import run
from rov_fmu.bridges.system.connections import SystemStructure, connected
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.bridges.system.sensors import sensors_model
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.bridges.system.fmus import described, described_model

ROV = load_vehicle(VIDEORAY)


@pytest.fixture(scope="module")
def held() -> SystemStructure:
    """A VideoRay whose depth and heading are held, at 10 m and south."""
    pilot = autopilot_model(autopilot_of(ROV)).begun({"mode_w": 2, "ref_z": 10, "mode_r": 2, "ref_psi": np.pi}, 1, 0.1)
    content = {"rov": described(ROV), "pilot": described_model(pilot, [])}
    parts = {name: SystemFmu.open(Path(name), one, is_ours=True) for name, one in content.items()}
    lines = (
        ("rov.pose", "pilot.pose"),
        ("rov.body_velocity", "pilot.body_velocity"),
        ("pilot.thrusters", "rov.thrusters"),
    )
    return SystemStructure(
        parts, {name: {} for name in parts}, [c for ends in lines for c in connected(*ends, 1.0, parts)]
    )


def motion(structure: SystemStructure) -> tuple[list[tuple[str, str]], np.ndarray]:
    """Return what is read and rows in which it changes; the depth ends at 9.96 m, the heading comes from the west."""
    read = run.recorded_names(structure)
    rows = np.outer(np.linspace(0.0, 1.0, 5), np.ones(len(read)))
    rows[:, read.index(("rov", "z"))] = [0.0, 9.0, 9.96, 10.01, 10.0]
    rows[:, read.index(("rov", "psi"))] = [np.pi, -np.pi, -3.1, -np.pi, np.pi]
    return read, rows


def test_what_is_held_is_told_from_its_aims(held: SystemStructure) -> None:
    read, rows = motion(held)
    found = run.deviations(held, read, rows)
    assert found.keys() == {("rov", "z"), ("rov", "psi")}
    np.testing.assert_allclose(found["rov", "z"], [-10.0, -1.0, -0.04, 0.01, 0.0], atol=1e-12)
    np.testing.assert_allclose(found["rov", "psi"], [0.0, 0.0, np.pi - 3.1, 0.0, 0.0], atol=1e-12)
    words = "from half of the run on: at most 4 cm and 2.4 deg from the aims of the autopilot"
    assert run.held_words(held, read, rows) == words
    free = SystemStructure(held.parts, {**held.values, "pilot": {"mode_w": 1.0, "mode_r": 0.0}}, held.connections)
    assert run.held_words(free, read, rows) == ""


def test_with_sensors_it_is_the_truth_that_is_told_from_its_aim(held: SystemStructure) -> None:
    sensors = SystemFmu.open(Path("s"), described_model(sensors_model(ROV, 0.1), []), is_ours=True)
    parts = {**held.parts, "sensors": sensors}
    lines = [("rov.pose", "sensors.true_pose"), ("sensors.pose", "pilot.pose"), ("pilot.thrusters", "rov.thrusters")]
    system = SystemStructure(parts, held.values, [c for ends in lines for c in connected(*ends, 1.0, parts)])
    found = run.deviations(system, *motion(system))
    assert found.keys() == {("rov", "z"), ("rov", "psi")}
    np.testing.assert_allclose(found["rov", "z"], [-10.0, -1.0, -0.04, 0.01, 0.0], atol=1e-12)


def test_the_plot_has_the_deviations_first_and_everything_once(
    held: SystemStructure, monkeypatch: pytest.MonkeyPatch
) -> None:
    def panels(draw: Callable[[Figure], None], *_: object, **__: object) -> str:
        draw(figure := Figure())
        shown = [(axes.get_title("left"), [line.get_label() for line in axes.lines]) for axes in figure.axes]
        return str([one for one in shown if one[1]])

    monkeypatch.setattr(run, "svg_file", panels)
    read, rows = motion(held)
    drawn = run.picture(held, read, [], 0.1, rows)
    assert drawn.startswith("[('Place of rov from its aim (m)', ['z']), ('Angle of rov from its aim (°)', ['psi'])")
    assert drawn.count("'z'") == drawn.count("'psi'") == 1
    assert "u_l" in drawn
    assert "'x', 'y'" in drawn, "what is not held is told as it is"
    assert "vg_N" not in drawn
    assert "'u'" not in drawn
    rows[:, read.index(("pilot", "u_l"))] = np.inf
    assert "u_l" not in run.picture(held, read, [], 0.1, rows), "it does not change"
    chosen = run.picture(held, read, ["rov.u", "rov.z"], 0.1, rows)
    assert chosen == "[('Velocity of rov (m/s)', ['u']), ('Place of rov (m)', ['z'])]"
