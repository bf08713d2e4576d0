"""What the autopilot does while a measurement is not valid, and when it is valid again."""

from pathlib import Path

import numpy as np
import pytest

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import VALID, autopilot_fmu
from rov_fmu.c.stepper import Stepper
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.bridges.autopilot.test_gains import begun

HEAVY, H = load_vehicle(SHIPPED["bluerov2_heavy"]), 0.02
LAYOUT = HEAVY.layout
SENSORS = [*LAYOUT.pose, *LAYOUT.velocities, *LAYOUT.over_ground]
STATION = {"mode_u": 2.0, "mode_v": 2.0, "mode_w": 2.0, "mode_r": 2.0, "ref_z": 3.0}
CURRENT = 0.2
LOST, BACK, END = 500, 1500, 3000
"""The steps at which a measurement is lost, is back, and the flight ends."""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "autopilot.fmu"
    path.write_bytes(autopilot_fmu(autopilot_of(HEAVY), ["host"]))
    return path


def flown(fmu: Path, flag: str | None, **start: float) -> tuple[Array, Array, Array]:
    """Return what is measured, the commands and `is_held_` of each axis, by step, in a current from the south.

    Between LOST and BACK, one measurement is not valid and keeps its values.
    """
    pilot, reference = begun(fmu, 2, STATION | start)
    rov = Stepper(HEAVY, {"z": 3.0}, SENSORS)
    others = LAYOUT.usual_inputs | {"V_N": CURRENT}
    now = rov.recorded()
    told, rows = now, []
    held = [reference[f"is_held_{axis}"] for axis in "uvwpqr"]
    keeps = {"valid_position": "x y", "valid_depth": "z vg_D", "valid_velocity": "u v w vg_N vg_E"}.get(flag or "", "")
    for n in range(END):
        is_lost = flag is not None and LOST <= n < BACK
        told = [
            old if is_lost and name in keeps.split() else new for name, old, new in zip(SENSORS, told, now, strict=True)
        ]
        pilot.setReal([reference[name] for name in SENSORS], told)
        if flag:
            pilot.setReal([reference[flag]], [0.0 if is_lost else 1.0])
        pilot.doStep(n * H, H)
        commands = pilot.getReal([reference[name] for name in LAYOUT.commands])
        rows.append((now, commands, pilot.getReal(held)))
        given = others | dict(zip(LAYOUT.commands, commands, strict=True))
        now = rov.step([*given.values()], H)
    pilot.terminate()
    pilot.freeInstance()
    return tuple(np.array(one) for one in zip(*rows, strict=True))


def of(measured: Array, name: str) -> Array:
    return measured[:, SENSORS.index(name)]


def test_a_velocity_that_is_lost_leaves_surge_and_sway_to_the_stick(fmu: Path) -> None:
    measured, commands, held = flown(fmu, "valid_velocity")
    x = of(measured, "x")
    assert (held[:, :2] == np.where((np.arange(END) < LOST) | (np.arange(END) >= BACK), 1.0, 0.0)[:, None]).all()
    assert (held[:, 2:] == 1.0).all(), "depth and attitude go on"
    assert abs(x[LOST]) < 0.05
    assert x[BACK] == pytest.approx(CURRENT * (BACK - LOST) * H, rel=0.15), "it drifts with the current"
    assert abs(of(measured, "z")[LOST:] - 3.0).max() < 0.02
    assert abs(x[-1]) < 0.1, "and comes back"
    jump = np.abs(commands[BACK] - commands[BACK - 1]).max()
    assert jump < 1e-3
    thrust = commands * np.abs(commands)  # roughly, as a share of the largest one
    assert np.abs(np.diff(thrust[BACK:], axis=0)).max() < 0.15, "it fades in"
    ahead = flown(fmu, "valid_velocity", stick_u=0.1)[0]
    assert of(ahead, "x")[BACK] > x[BACK] + 1.0, "the stick acts"


def test_a_position_that_is_lost_leaves_the_rate_over_ground(fmu: Path) -> None:
    measured, commands, held = flown(fmu, "valid_position")
    assert (held[LOST:BACK, :2] == 0.0).all()
    x = of(measured, "x")
    assert abs(x[BACK] - x[LOST]) < 0.05, "it stands against the current"
    assert np.abs(np.diff(commands[LOST - 1 :], axis=0)).max() < 1e-3, "nothing jumps"


@pytest.mark.parametrize(("flag", "axes"), [("valid_depth", "w"), ("valid_attitude", "pqr")])
def test_a_depth_or_an_attitude_that_is_lost_leaves_its_axes_to_the_stick(fmu: Path, flag: str, axes: str) -> None:
    held = flown(fmu, flag)[2]
    assert (held[LOST] == [0.0 if axis in axes else 1.0 for axis in "uvwpqr"]).all()
    assert (held[BACK] == 1.0).all()


def test_valid_measurements_change_nothing(fmu: Path) -> None:
    one, other = flown(fmu, None), flown(fmu, "valid_position")
    assert (one[1][:LOST] == other[1][:LOST]).all()
    assert [*VALID] == ["valid_position", "valid_depth", "valid_velocity", "valid_attitude"]
