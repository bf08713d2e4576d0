"""What a log tests, and what it tells nothing about."""

from collections.abc import Mapping

import numpy as np
import pytest

from rov_fmu.identify.likelihood.records import driven_axes, recorded
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.log import Channel, Log
from tests.tank.logs import channel, commands, log
from tests.vehicles import VIDEORAY

TIME: Array = np.linspace(0.0, 19.9, 200)
STEP: Array = np.where(TIME > 5.0, 0.4, 0.0)
MOTION: Mapping[str, Array] = {"surge velocity": 0.1 * STEP, "depth": 0.3 * TIME, "heading": 0.2 * np.sin(TIME)}


def dive(left: Array, right: Array, top: Array, *channels: Channel) -> Log:
    """A dive of the VideoRay."""
    return log(commands(TIME, {"l": left, "r": right, "t": top}), *channels)


def moving(*names: str) -> list[Channel]:
    return [channel(name, TIME, MOTION[name]) for name in names]


def few(values: Array) -> Array:
    """The values without all but 19 samples."""
    return np.where(np.arange(len(values)) < 19, values, np.nan)


CASES: Mapping[str, tuple[Log, list[str], list[str]]] = {
    "all axes": (dive(STEP, 0.0 * STEP, STEP, *moving(*MOTION)), ["surge", "heave", "yaw"], []),
    "thrusters that cancel": (
        dive(STEP, STEP, 0.0 * STEP, *moving(*MOTION)),
        ["surge"],
        [
            "nothing is learnt about heave: the thrust along it never changes",
            "nothing is learnt about yaw: its thrusters cancel each other all the time",
        ],
    ),
    "a thrust that never changes": (
        dive(0.0 * STEP, 0.0 * STEP, 0.3 + 0.0 * STEP, *moving("depth")),
        [],
        ["nothing is learnt about heave: the thrust along it never changes"],
    ),
    "a sensor that stands still": (
        dive(STEP, STEP, STEP, channel("depth", TIME, 0.0 * TIME + 1.5), *moving("surge velocity")),
        ["surge"],
        ["the depth never changes, so it is left out"],
    ),
    "too few samples": (
        dive(STEP, STEP, STEP, channel("depth", TIME, few(MOTION["depth"])), *moving("surge velocity")),
        ["surge"],
        ["the depth has 19 samples and needs at least 20, so it is left out"],
    ),
    "a gap": (
        dive(STEP, STEP, STEP, channel("depth", TIME, np.where(abs(TIME - 10.0) < 2.0, np.nan, MOTION["depth"]))),
        ["heave"],
        ["1 gap in the depth: 4.1 s from 8 s on"],
    ),
    "measured before the first command": (
        dive(STEP, STEP, STEP, channel("depth", TIME - 18.0, MOTION["depth"])),
        ["heave"],
        [],
    ),
    "measured after the last command": (
        dive(STEP, STEP, STEP, channel("depth", TIME + 18.3, MOTION["depth"])),
        [],
        ["the depth has 18 samples and needs at least 20, so it is left out"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_log_tests_the_axes_that_it_pushes_and_measures(case: str) -> None:
    one, axes, told = CASES[case]
    tested, findings = driven_axes(one, VIDEORAY.layout)
    assert [axis.name for axis in tested] == axes
    assert [line.removeprefix("a.csv: ") for line in sentences(findings, SENTENCES)] == told
    assert (recorded(one, VIDEORAY.layout) is None) is (not axes)


def test_the_channels_of_an_axis_that_is_not_pushed_still_tell_how_the_vehicle_moved() -> None:
    one = recorded(dive(STEP, STEP, 0.0 * STEP, *moving(*MOTION)), VIDEORAY.layout)
    assert one
    assert [sensor.axis.name for sensor in one.record.sensors] == ["surge", "heave", "yaw"]
