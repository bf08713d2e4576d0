"""What the autopilot does while a measurement is not valid, and when it is valid again."""

from pathlib import Path

import numpy as np
import pytest

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.autopilot.law import SENSORS as LAW_SENSORS
from rov_fmu.autopilot.pilot import Pilot
from rov_fmu.bridges.autopilot.fmu import VALID, autopilot_fmu
from rov_fmu.c.stepper import Stepper
from rov_fmu.fmu.variables import units_of
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
    measured, moved, acts = zip(*rows, strict=True)
    return np.array(measured), np.array(moved), np.array(acts)


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


def by_late_sensors(name: str, delay: int, noise: float = 0.0) -> tuple[Array, Array]:
    """Return depth and heading, and the commands, of a vehicle in Python; the sensors are late by some steps.

    It goes 1 m down and 90 degrees to starboard; with noise, it stays where it is.
    """
    rov, random = load_vehicle(SHIPPED[name]), np.random.default_rng(1)
    pilot = Pilot(autopilot_of(rov)).hold(depth=10.0 if noise else 11.0, heading=0.0 if noise else 0.5 * np.pi)
    names = [one for one in LAW_SENSORS if one in rov.layout.places]
    stepper = Stepper(rov, {"z": 10.0}, names)
    size = {"m/s": noise, "rad/s": 0.1 * noise}
    units = units_of(rov.layout)
    now, past, rows, commands = stepper.recorded(), list[dict[str, float]](), [], []
    for _ in range(round(25.0 / H)):
        noisy = [x + size.get(units[one], 0.0) * random.standard_normal() for one, x in zip(names, now, strict=True)]
        past.append(dict(zip(names, noisy, strict=True)))
        made = pilot.step(past[max(0, len(past) - 1 - delay)], H)
        now = stepper.step([*(rov.layout.usual_inputs | made).values()], H)
        rows.append([now[names.index(one)] for one in ("z", "psi")])
        commands.append([*made.values()])
    return np.array(rows), np.array(commands)


@pytest.mark.parametrize("name", [*SHIPPED])
def test_vehicles_hold_with_late_and_noisy_measurements_as_the_page_says(name: str) -> None:
    """0.1 s late they hold; 0.2 s late the depth is held, and the heading swings; noise moves the thrusters more."""
    seen, _ = by_late_sensors(name, 5)
    assert seen[:, 0].max() < 11.01
    assert np.degrees(seen[:, 1].max()) < 91.0
    assert np.ptp(seen[-300:], axis=0).max() < 1e-3
    late, _ = by_late_sensors(name, 10)
    assert late[:, 0].max() < 11.02
    swings = np.degrees(np.ptp(late[-300:, 1]))
    assert 4.5 < swings < 37.5
    seen, commands = by_late_sensors(name, 0, 0.03)
    assert 100.0 * seen[100:, 0].std() < 0.35
    assert np.degrees(seen[100:, 1].std()) < 0.025
    assert 0.085 < np.diff(commands[100:], axis=0).std() / np.sqrt(2.0) < 0.215
