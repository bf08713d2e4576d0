"""Which channels follow from topics: frames, attitude, contradictions, and which of several sources is used."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.channels import Topic, channels_of, frames_of
from rov_fmu.tank.log import Channel, Source
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
    ("frames", "earth", "body"),
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
def test_names_of_frames(frames: tuple[str, str], earth: Array, body: Array) -> None:
    found = frames_of(Source("/odom", frames=frames))
    assert [matrix.tolist() for matrix in found] == [earth.tolist(), body.tolist()]


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
    ],
    ids=["right", "29 %", "31 %", "signs", "7 s", "8 s", "of the earth", "noise", "2 cm/s", "7 cm/s", "a blank"],
)
def test_a_velocity_that_contradicts_the_positions_is_not_used(velocity: Array, position: Array, words: str) -> None:
    fields = " ".join(
        f"{name}[{n}]" for name, count in (("q", 4), ("position", 3), ("velocity", 3)) for n in range(count)
    )
    values = np.hstack([QUATERNION[: len(velocity)], position, velocity])
    source = Source("/odom", "vehicle_odometry", frames=("ned", "frd"))
    assert found([topic("", TIME[: len(velocity)], fields, values, source)], "surge velocity").unused == words


def test_the_first_source_with_20_samples_that_change_is_used() -> None:
    """If there is none, it is the first."""
    time = np.arange(20.0)
    few, constant, good = (np.where(time < 19, time, np.nan), np.ones(20), time)
    for first, second, used in (
        (few, good, "CTUN"),
        (constant, good, "CTUN"),
        (good, good + 1.0, "VFR_HUD"),
        (few, constant, "VFR_HUD"),
    ):
        topics = [topic("CTUN", time, "Alt", second[:, None]), topic("VFR_HUD", time, "alt", first[:, None])]
        reasons = {channel.source.topic: channel.unused for channel in channels_of(topics, None)}
        assert reasons == dict.fromkeys(("VFR_HUD", "CTUN"), f"{used} is used") | {used: ""}
