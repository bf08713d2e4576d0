"""The dive that most tests of log formats write, and what must be read of it."""

from collections.abc import Collection

import numpy as np
import pytest

from rov_fmu.equation.layout import Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Log
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.tank.readers import writers
from tests.tank.readers.writers import RATES, Dive

BLUEROV2: Layout = load_vehicle(SHIPPED["bluerov2"]).layout
TIME: Array = np.linspace(0.0, 9.9, 100)
COMMAND: Array = np.where(TIME > 0.95, 0.25, 0.0)
THRUSTERS = {"1": COMMAND, "2": -COMMAND, "3": 0.5 * COMMAND, "4": COMMAND, "5": 2.0 * COMMAND, "6": 1.6 * COMMAND}
ROLL, PITCH, HEADING = 0.1 + 0.01 * TIME, -0.2 + 0.02 * TIME, 2.0 + 0.3 * TIME
DEPTH = 1.0 + 0.1 * TIME
U, V = 0.3 + 0.02 * TIME, -0.1 + 0.01 * TIME
W = (0.1 + np.sin(PITCH) * U - np.sin(ROLL) * np.cos(PITCH) * V) / (np.cos(ROLL) * np.cos(PITCH))
"""The velocity in heave with which the depth grows by 0.1 m/s, whatever roll and pitch are."""
VOLTAGE = 16.0 - 0.05 * TIME
DIVE = Dive(
    start=50.0,
    pulses=1500.0 + 400.0 * np.column_stack([*THRUSTERS.values()]),
    euler=np.column_stack([ROLL, PITCH, HEADING]),
    velocity=np.column_stack([U, V, W]),
    voltage=VOLTAGE,
    time=TIME,
    origin=(5.0, 7.0, 1.0),
)


_RATES = {"roll velocity", "pitch velocity", "yaw velocity"}
PLACES = ("surge distance", "sway distance", "distance")
"""How far north and east the vehicle is of its first place, and how far away."""
LACKING: dict[object, set[str]] = {
    writers.flash: _RATES,
    writers.flash_text: _RATES,
    writers.csv: {*_RATES, *PLACES},
}
"""The quantities that the logs of some writers do not have."""


def expected(dive: Dive = DIVE) -> dict[str, tuple[Array, float]]:
    """Return what the sensors measure, within the resolution of the formats: 0.01 degrees, 1 mV, numbers of 32 bits."""
    axes = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")
    rates, moved = np.tile(RATES, (len(dive.time), 1)), (dive.position[:, :2] - dive.position[0, :2]).T
    return {
        "depth": (dive.position[:, 2], 1e-5),
        **{name: (values, 1e-5) for name, values in zip(PLACES, (*moved, np.hypot(*moved)), strict=True)},
        **{name: (dive.euler[:, n], 1e-4) for n, name in enumerate(("roll angle", "pitch angle", "heading"))},
        **{f"{axis} velocity": (dive.velocity[:, n], 4e-4) for n, axis in enumerate(axes[0])},
        **{f"{axis} velocity": (rates[:, n], 1e-6) for n, axis in enumerate(axes[1])},
        "voltage": (dive.voltage, 1e-3),
    }


def check(log: Log, dive: Dive = DIVE, lacking: Collection[str] = ()) -> None:
    """Check all channels of a log but those of lacking quantities, and the commands; times within 1 ms."""
    commands = log.commands
    assert commands is not None
    start = commands.rows[0]
    assert commands.rows - start == pytest.approx(dive.time, abs=1e-3)
    assert commands.thrusters == tuple("123456")
    fractions = (dive.pulses - 1500.0) / 400.0
    row, thruster = np.nonzero(np.vstack([np.ones((1, 6), bool), np.diff(fractions, axis=0) != 0.0]))
    assert commands.thruster.tolist() == thruster.tolist()
    assert commands.time - start == pytest.approx(dive.time[row], abs=1e-3)
    assert commands.since - start == pytest.approx(dive.time[np.maximum(row - 1, 0)], abs=1e-3)
    assert commands.value == pytest.approx(fractions[row, thruster], abs=1e-6)
    measured = expected(dive)
    used = [channel for channel in log.channels if not channel.unused]
    assert sorted(channel.quantity.name for channel in used) == sorted(measured.keys() - {*lacking})
    for channel in used:
        name, (values, within) = channel.quantity.name, measured[channel.quantity.name]
        assert channel.time - start == pytest.approx(dive.time, abs=1e-3), name
        difference = channel.values - values
        if channel.quantity.wraps:
            difference = (difference + np.pi) % (2.0 * np.pi) - np.pi
        assert np.abs(difference).max() < within, name
