"""Which channels follow from topics: frames, attitude, contradictions, and which of several sources is used."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES, Message
from rov_fmu.tank.channels import Topic, channels_of, frames_of, of_scalar
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Channel, Log, Source
from rov_fmu.tank.quality import checked_log
from tests.tank.logs import used
from tests.tank.readers import motion
from tests.tank.readers.motion import DIVE, TIME
from tests.tank.readers.writers import ENU, FLU

NED = np.eye(3)


def topic(name: str, time: Array, fields: str, values: Array, source: Source | None = None) -> Topic:
    """Return a topic whose fields are the columns of values."""
    return Topic(source or Source(name, name), time, dict(zip(fields.split(), values.T, strict=True)))


def found(topics: Sequence[Topic], quantity: str) -> Channel:
    (channel,) = (channel for channel in channels_of(topics, None) if channel.quantity.name == quantity)
    return channel


@pytest.mark.parametrize(
    ("names", "earth", "body"),
    [
        (("", ""), ENU, FLU),
        (("map", "base_link"), ENU, FLU),
        (("world_ned", ""), NED, NED),
        (("world_ned", "base_link_flu"), NED, FLU),
        (("map", "base_link_frd"), ENU, NED),
        (("", "imu_frd"), NED, NED),
        (("", "imu_ned"), NED, NED),
    ],
)
def test_names_of_frames(names: tuple[str, str], earth: Array, body: Array) -> None:
    """Of the earth and of the body; those of the sea are NED for both."""
    np.testing.assert_equal(frames_of(Message("", (), ""), Source("/odom", frames=names)), [earth, body])


QUATERNION = Rotation.from_matrix(DIVE.rotation).as_quat(scalar_first=True)
"""n x 4: w, x, y, z."""


@pytest.mark.parametrize("frame", ["map", "odom_ned"])
def test_a_twist_in_a_frame_of_the_earth_is_rotated_by_the_attitude(frame: str) -> None:
    """The attitude needs 20 samples. Its first and last one hold beyond its times."""
    over_ground = DIVE.over_ground @ (NED if "ned" in frame else ENU)
    source = Source("/velocity", "geometry_msgs/msg/TwistStamped", frames=("", frame))
    twist = topic("", TIME, "twist.linear.x twist.linear.y twist.linear.z", over_ground, source)
    for count, reason in (
        (20, ""),
        (19, "its frame is {}, and the log has no attitude to rotate it into that of the body"),
    ):
        attitude = topic("vehicle_attitude", TIME[50 : 50 + count], "q[0] q[1] q[2] q[3]", QUATERNION[50 : 50 + count])
        sway = found([attitude, twist], "sway velocity")
        assert sway.unused == reason.format(frame)
        if not reason:
            assert sway.values[50:70] == pytest.approx(motion.V[50:70], abs=1e-9)
            early = DIVE.rotation[50].T @ DIVE.over_ground[49]
            assert sway.values[49] == pytest.approx(early[1], abs=1e-9)


VELOCITY, PLACE, NOISE = DIVE.velocity, DIVE.position, np.random.default_rng(0).standard_normal((100, 3))
OF_SCALE = "it contradicts the positions in the same messages by its scale, signs or axes"
OF_EARTH = "it contradicts the positions in the same messages, unless it is in a frame of the earth, not of the body"


@pytest.mark.parametrize(
    ("velocity", "position", "words"),
    [
        (VELOCITY, PLACE, ""),
        (1.29 * VELOCITY, PLACE, ""),
        (1.31 * VELOCITY, PLACE, OF_SCALE),
        (VELOCITY * [1.0, -1.0, -1.0], PLACE, OF_SCALE),
        (1.5 * VELOCITY[:80], PLACE[:80], ""),
        (1.5 * VELOCITY[:83], PLACE[:83], OF_SCALE),
        (DIVE.over_ground, PLACE, OF_EARTH),
        (VELOCITY, PLACE + 0.3 * NOISE, ""),
        (0.2 * VELOCITY, 0.1 * PLACE, ""),
        (0.6 * VELOCITY, 0.3 * PLACE, OF_SCALE),
        (np.where(TIME[:, None] == TIME[50], np.nan, 1.5 * VELOCITY), PLACE, ""),
        (np.where(TIME[:, None] == TIME[50], 0.0, 1.5 * VELOCITY), PLACE, ""),
    ],
    ids=[
        "right",
        "29 %",
        "31 %",
        "signs",
        "7 s",
        "8 s",
        "earth",
        "noise",
        "2 cm/s",
        "7 cm/s",
        "a blank",
        "no attitude",
    ],
)
def test_a_velocity_that_contradicts_the_positions_is_not_used(velocity: Array, position: Array, words: str) -> None:
    fields = " ".join(
        f"{name}[{n}]" for name, count in (("q", 4), ("position", 3), ("velocity", 3)) for n in range(count)
    )
    attitude = np.where(velocity.any(axis=1, keepdims=True), QUATERNION[: len(velocity)], np.nan)
    values = np.hstack([attitude, position, velocity])
    source = Source("/odom", "vehicle_odometry", frames=("ned", "frd"))
    assert found([topic("", TIME[: len(velocity)], fields, values, source)], "surge velocity").unused == words


def test_the_first_source_with_20_samples_that_change_is_used() -> None:
    """If there is none, it is the first."""
    time = np.arange(20.0)
    few, constant, good = (np.where(time < 19, time, np.nan), np.ones(20), time)
    for first, second, best in (
        (few, good, "CTUN"),
        (constant, good, "CTUN"),
        (good, good + 1.0, "VFR_HUD"),
        (few, constant, "VFR_HUD"),
    ):
        topics = [topic("CTUN", time, "Alt", second[:, None]), topic("VFR_HUD", time, "alt", first[:, None])]
        reasons = {channel.source.topic: channel.unused for channel in channels_of(topics, None)}
        assert reasons == dict.fromkeys(("VFR_HUD", "CTUN"), f"{best} is used") | {best: ""}


def test_what_is_of_another_vehicle_or_part_or_no_measurement_is_not_used() -> None:
    """The commands are of component 1 of vehicle 1. Of its components, only 154 tells the altitude."""
    angles = np.column_stack([motion.ROLL, motion.PITCH, motion.HEADING])
    sources = {
        Source("ATTITUDE", "ATTITUDE", "1", "component 154"): "component 1, which sent the commands, sent it too",
        Source("ATTITUDE", "ATTITUDE", "1", "component 1"): "",
        Source("ATTITUDE", "ATTITUDE", "2", "component 1"): "it is of 2, another vehicle",
        Source("target", "ATTITUDE", "1", "component 1"): "its name has the word target, so it is no measurement of "
        "the vehicle",
    }
    topics = [topic("", TIME, "roll pitch yaw", angles, source) for source in sources]
    topics += [topic("", TIME, "alt", -motion.DEPTH[:, None], Source("VFR_HUD", "VFR_HUD", "1", "component 154"))]
    channels = channels_of(topics, Source("RCOU", "RCOU", "1", "component 1"), ["2"])
    assert {one.source: one.unused for one in channels if one.quantity.name == "heading"} == sources
    assert [one.unused for one in channels if one.quantity.name == "depth"] == [""]


def test_a_depth_sensor_and_an_imu() -> None:
    orientation = Rotation.from_matrix(ENU @ DIVE.rotation @ FLU).as_quat()
    fields = " ".join(f"orientation.{letter}" for letter in "xyzw")
    imu = topic("", TIME, fields, orientation, Source("/imu", "sensor_msgs/msg/Imu"))
    assert np.unwrap(found([imu], "heading").values) == pytest.approx(motion.HEADING)
    assert found([imu], "pitch angle").values == pytest.approx(motion.PITCH)
    for name, quantities in (("/bar30/depth", {"depth"}), ("/depths", set())):
        sensor = topic("", TIME, "data", motion.DEPTH[:, None], Source(name, "std_msgs/msg/Float64"))
        assert {channel.quantity.name for channel in channels_of([sensor], None)} == quantities


def test_of_several_barometers_the_one_in_the_water_tells_the_depth() -> None:
    def barometer(name: str, pascals: Array) -> Topic:
        return topic("", TIME, "fluid_pressure", pascals[:, None], Source(name, "sensor_msgs/msg/FluidPressure"))

    hull, water = barometer("/hull", 100900.0 + 15.0 * np.sin(7.0 * TIME)), barometer("/bar30", WATER)
    alone = checked_log(Log("a", None, tuple(channels_of([hull], None))))
    reason = (
        "its pressure changes by only 3 mm of water and is that of the air, so the barometer seems to be inside the "
    )
    reason += "hull"
    assert sentences(alone.findings) == (
        f"a: /hull is left out for depth: {reason}",
        "a: pressure from /hull, 10 Hz",
    )
    both = checked_log(Log("a", None, tuple(channels_of([hull, water], None))))
    assert used(both, "depth").values == pytest.approx(motion.DEPTH)
    assert sentences(both.findings) == (
        "a: the depth is computed from the pressure, for fresh water (1000 kg/m3). In sea water the true depth is 2.5 "
        "% smaller",
        "a: pressure from /bar30, 10 Hz; also in /hull, not used",
        f"a: depth from /bar30, 10 Hz; also in /hull ({reason}), not used",
    )


AIR = 101325.0
WATER = AIR + 9806.65 * motion.DEPTH


@pytest.mark.parametrize(
    ("low", "high", "reason"),
    [
        (100.0, 1003.1, "its pressures of 100 ... 1003 are below 1 % of an atmosphere"),
        (100.0, 1023.4, ""),
        (106094.9, 106289.9, "its pressure changes by only 20 mm of water and is that of the air"),
        (96165.1, 96360.1, "its pressure changes by only 20 mm of water and is that of the air"),
        (106297.6, 106492.6, ""),
        (101128.0, 101325.0, ""),
    ],
)
def test_pressures_that_tell_no_depth(low: float, high: float, reason: str) -> None:
    pressure, depth = of_scalar(QUANTITIES["pressure"], Source("p"), np.arange(2.0), np.array([low, high]))
    assert not pressure.unused
    assert depth.unused.partition(", so the")[0] == reason


def test_values_that_no_sensor_shows_are_left_out_and_repeated_times_merged() -> None:
    values = np.array([1.0, np.nan, 3.0, np.inf, 2e12])
    found = Topic.of_messages(Source("a"), np.array([2.0, 2.0, 1.0, 3.0, 4.0]), {"x": values})
    np.testing.assert_equal([found.time, found.fields["x"]], [[1.0, 2.0, 3.0, 4.0], [3.0, 1.0, np.nan, np.nan]])
