"""What a log tests, what it tells nothing about, and what the filter reads of it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.identify.likelihood.records import driven_axes, recorded, typical
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Channel, Log
from rov_fmu.tank.quality import without_spans
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle, without_surface
from tests.tank.logs import channel, commands, log
from tests.vehicles import VIDEORAY

TIME: Array = np.linspace(0.0, 19.9, 200)
STEP: Array = np.where(TIME > 5.0, 0.4, 0.0)
MOTION: Mapping[str, Array] = {"surge velocity": 0.1 * STEP, "depth": 0.3 * TIME, "heading": 0.2 * np.sin(TIME)}
FADING: Array = 0.3 * np.exp(-0.2 * TIME)
DECAYS = (
    "the motion in {} slows down without thrust, which tells drag relative to inertia, but not the velocities that the "
    "thrusters give"
)


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
    "free decays": (
        dive(0.0 * STEP, 0.0 * STEP, STEP, channel("surge velocity", TIME, FADING), *moving("depth")),
        ["surge", "heave"],
        [DECAYS.format("surge")],
    ),
    "a free decay by a position": (
        dive(0.0 * STEP, 0.0 * STEP, STEP, channel("heading", TIME, np.cumsum(0.1 * FADING))),
        ["yaw"],
        [DECAYS.format("yaw")],
    ),
    "a swing that fades": (
        dive(0.0 * STEP, 0.0 * STEP, STEP, channel("yaw velocity", TIME, FADING * np.sin(3.0 * TIME))),
        ["yaw"],
        [DECAYS.format("yaw")],
    ),
    **{
        f"no free decay: {words}": (
            dive(push, push, 0.0 * STEP, channel("surge velocity", TIME, speed)),
            [],
            ["nothing is learnt about surge: the thrust along it never changes"],
        )
        for words, push, speed in (
            ("too slow", 0.0 * STEP, 0.3 * FADING),
            ("it drifts on", 0.0 * STEP, 0.4 - 0.2 * TIME / 19.9),
            ("it gets faster", 0.0 * STEP, FADING[::-1]),
            ("a constant thrust", 0.3 + 0.0 * STEP, FADING),
        )
    },
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
    read, axes, told = CASES[case]
    tested, findings = driven_axes(read, VIDEORAY.layout)
    assert [axis.name for axis in tested] == axes
    assert [line.removeprefix("a.csv: ") for line in sentences(findings)] == told
    assert (recorded(read, VIDEORAY.layout) is None) is (not axes)


def test_the_channels_of_an_axis_that_is_not_pushed_still_tell_how_the_vehicle_moved() -> None:
    sampled = recorded(dive(STEP, STEP, 0.0 * STEP, *moving(*MOTION)), VIDEORAY.layout)
    assert sampled
    assert [sensor.axis.name for sensor in sampled.record.sensors] == ["surge", "heave", "yaw"]


FAST: Array = 0.02 * np.arange(1000.0)
DEPTH = 2.0 + 0.3 * FAST + 0.01 * np.random.default_rng(0).standard_normal(1000)


def test_the_filter_reads_averages_of_fast_samples_and_all_slow_ones() -> None:
    """Of 50 samples per second and 10, 20 are kept and 10; a first fit has 5 single ones of both."""
    channels = channel("depth", FAST, DEPTH), *moving("surge velocity")
    sampled = recorded(dive(STEP, 0.0 * STEP, STEP, *channels), VIDEORAY.layout)
    assert sampled
    full, thin, depth = sampled.record, sampled.thinned, sampled.measured[0]
    groups = np.floor(20.0 * FAST + 1e-6)
    for told, of in ((full.time, FAST), (full.value, DEPTH)):
        assert told[full.sensor == 0] == pytest.approx([of[groups == n].mean() for n in range(400)])
    assert full.value[full.sensor == 1] == pytest.approx(MOTION["surge velocity"])
    assert thin.time == pytest.approx(np.repeat(0.2 * np.arange(100.0), 2))
    assert thin.value[thin.sensor == 0] == pytest.approx(DEPTH[::10])
    assert np.all(np.diff(full.time) >= 0.0)
    assert sampled.shows_horizontal
    assert depth.noise == pytest.approx(0.01, rel=0.1)
    assert full.start == VIDEORAY.layout.at_rest | {"z": DEPTH[0]}
    usual = {"w": 0.3, "r": 0.3, "psi": 0.1, "z": 3.0 * depth.noise, "u": 0.03 + 3.0 * sampled.measured[1].noise}
    assert full.errors == usual, "a horizontal position that no sensor measures is not followed"
    assert [*full.since] == [0.0, TIME[50]]
    assert full.inputs[:, [*VIDEORAY.layout.inputs].index("u_l")].tolist() == [0.0, 0.4]
    assert [typical([sampled], axis) for axis in (HEAVE, SURGE, YAW)] == pytest.approx([0.3, 0.04, 0.0], rel=0.1)


@pytest.mark.parametrize(("speed", "start", "error"), [(0.8, 0.8, 0.7), (0.5, 0.0, 0.3)])
def test_a_vehicle_that_moves_at_the_start_begins_with_the_velocity_of_its_position(
    speed: float, start: float, error: float
) -> None:
    sampled = recorded(dive(STEP, STEP, STEP, channel("depth", TIME, 1.0 + speed * TIME)), VIDEORAY.layout)
    assert sampled
    assert (sampled.record.start["w"], sampled.record.errors["w"]) == pytest.approx((start, error))


def test_a_free_decay_begins_with_the_velocity_of_its_position_however_small() -> None:
    sampled = recorded(CASES["a free decay by a position"][0], VIDEORAY.layout)
    assert sampled
    mean = float(np.mean(FADING[1:11]))
    assert (sampled.record.start["r"], sampled.record.errors["r"]) == pytest.approx((mean, 0.3 + 0.5 * mean), rel=0.02)


def test_a_voltage_has_a_row_for_each_thousandth_and_tilt_is_an_input() -> None:
    layout = replace(VIDEORAY.layout, voltage=16.0)
    volts, pitch = 16.0 - 0.006 * np.arange(200.0), 0.1 * np.sin(TIME)
    more = (
        channel("voltage", TIME, volts),
        channel("pitch angle", TIME, pitch),
        channel("roll angle", TIME[::2], TIME[::2]),
    )
    sampled = recorded(dive(STEP, STEP, STEP, *more, *moving("depth")), layout)
    assert sampled
    changed = sampled.record.inputs[:, [*layout.inputs].index("voltage")]
    steps = -np.diff(changed) / changed[:-1]
    assert 0.001 < min(steps) < max(steps) < 0.0015
    assert changed == pytest.approx(np.interp(sampled.record.told, TIME, volts))
    assert sampled.record.tilt == pytest.approx(np.array([TIME, np.minimum(TIME, TIME[198]), pitch]))


def test_the_attitude_at_the_start_is_that_of_the_first_angles() -> None:
    layout, angles = (
        load_vehicle(SHIPPED["bluerov2_heavy"]).layout,
        {"heading": 1.1, "pitch angle": -0.2, "roll angle": 0.3},
    )
    channels = [channel(name, TIME, value + 0.01 * np.sin(TIME)) for name, value in angles.items()]
    sampled = recorded(
        log(commands(TIME, {t.name: STEP for t in layout.thrusters}), *channels, *moving("depth")), layout
    )
    assert sampled
    x, y, z, w = Rotation.from_euler("ZYX", [*angles.values()]).as_quat()
    assert [sampled.record.start[name] for name in QUATERNION] == pytest.approx([w, x, y, z])
    assert {sampled.record.errors[name] for name in QUATERNION} == {0.1}


LAYOUT = without_surface(load_vehicle(SHIPPED["bluerov2"])).layout
PUSH: Array = 0.3 + 0.2 * np.sin(2.0 * TIME)
DRIVEN = {"1": -PUSH, "2": -PUSH, "3": PUSH, "4": PUSH, "5": PUSH, "6": PUSH}
SECONDS = TIME[::10]
TRACK = (
    channel("surge distance", SECONDS, 0.4 * SECONDS + 0.02 * SECONDS**2),
    channel("sway distance", SECONDS, 0.1 * np.sin(SECONDS)),
)


def test_a_piece_keeps_the_few_positions_of_a_log_that_has_enough() -> None:
    """A log of 20 positions is cut at 5 s. A log that has 19 in all has none that count, whole or in pieces."""
    whole = log(commands(TIME, DRIVEN), *TRACK, *moving("heading"))
    few_of = (replace(one, time=one.time[:-1], values=one.values[:-1]) for one in TRACK)
    for dive_of, are_read in ((whole, True), (replace(whole, channels=(*few_of, *moving("heading"))), False)):
        for piece in (dive_of, *without_spans(dive_of, [(4.9, 5.2)], [])):
            axes, findings = driven_axes(piece, LAYOUT)
            assert (SURGE in axes) == are_read, piece.file
            assert ("too few samples" in {one.kind for one in findings}) != are_read
    short = without_spans(whole, [(3.1, 3.2)], [])[0]  # four positions
    assert SURGE in driven_axes(short, LAYOUT)[0]
    assert SURGE not in driven_axes(without_spans(whole, [(2.1, 2.2)], [])[0], LAYOUT)[0]


@pytest.mark.parametrize(
    ("changes", "is_unknown"),
    [
        ({}, True),
        ({"commands": commands(TIME, {name: c * (TIME > 1.0) for name, c in DRIVEN.items()})}, False),
        ({"channels": (*moving("heading", "depth"),)}, False),
        ({"channels": (*moving("heading", "surge velocity"), channel("sway velocity", TIME, 0.1 * STEP))}, False),
    ],
    ids=["driven", "at rest", "not shown", "measured velocities"],
)
def test_a_dive_that_begins_in_motion_counts_from_when_its_velocity_is_known(
    changes: dict[str, Any], is_unknown: bool
) -> None:
    sampled = recorded(replace(log(commands(TIME, DRIVEN), *TRACK, *moving("heading")), **changes), LAYOUT)
    assert sampled
    for record in (sampled.record, sampled.thinned):
        assert record.in_motion == is_unknown
        assert (record.time[record.uncounted] - record.time[0] >= 5.0) == is_unknown
        assert (record.uncounted == 0) != is_unknown
    if SURGE in {m.axis for m in sampled.measured}:
        is_measured = any(m.axis is SURGE and m.sensor.is_velocity for m in sampled.measured)
        assert (sampled.record.errors["u"] >= 1.0) == is_unknown
        assert (sampled.record.errors["u"] < 0.1) == is_measured
    short = replace(sampled.record, time=sampled.record.time[sampled.record.time < 4.0])  # half of it counts
    assert short.time[short.uncounted] - short.time[0] == pytest.approx(2.0 * is_unknown, abs=0.11)


def test_thrusters_of_a_dive_that_begins_driven_begin_with_about_their_force() -> None:
    """What they got before is unknown, so that its error is as large. Thrusters at rest stay certain."""
    vehicle = without_surface(load_vehicle(SHIPPED["bluerov2"]))
    driven = {**DRIVEN, "6": 0.0 * PUSH}
    sampled = recorded(log(commands(TIME, driven), *TRACK, *moving("heading")), LAYOUT)
    assert sampled
    begun = sampled.with_thrust(vehicle.coefficients)
    forces = vehicle.commanded(LAYOUT.usual_inputs | {f"u_{name}": float(c[0]) for name, c in driven.items()})
    for record in (begun.record, begun.thinned):
        for name, F in forces.items():
            assert record.start.get(f"F_{name}", 0.0) == pytest.approx(F)
            assert record.start.get(f"n_{name}", 0.0) == driven[name][0]
            if F:
                assert record.errors[f"F_{name}"] == pytest.approx(abs(F))
                assert record.errors[f"n_{name}"] == pytest.approx(abs(driven[name][0]))
        assert record.errors.get("F_6") == sampled.record.errors.get("F_6")
        assert {k: v for k, v in record.start.items() if k[:2] not in ("F_", "n_")} == {
            k: v for k, v in sampled.record.start.items() if k[:2] not in ("F_", "n_")
        }
