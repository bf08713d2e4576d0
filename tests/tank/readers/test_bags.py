"""Bags of ROS 1 and ROS 2, which the tests write with rosbags."""

from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.readers.listing import list_files
from tests.tank.logs import Read, axes, commanded, measured, read_log
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME
from tests.tank.readers.writers import Ros, messages_of, outputs


def told(log: Read) -> tuple[str, ...]:
    return sentences(log.findings)


def test_frames_that_are_named_ned_are_those_of_the_sea_already(tmp_path: Path) -> None:
    log = read_log(Ros(2).write(tmp_path, messages_of(Ros(2), DIVE, ned=True)), BLUEROV2)
    motion.check(log.log)
    assert told(log) == (
        "dive.db3: the commands of the thrusters are those of /thrusters",
        "dive.db3: the log does not tell the directions of the motors (MOT_n_DIRECTION), so every thruster is taken to "
        "push ahead above its neutral pulse",
    )


COMPRESSED = [
    (1, ".bag", (Writer1.CompressionFormat.BZ2,)),
    (1, ".bag", (Writer1.CompressionFormat.LZ4,)),
    (2, ".db3", (CompressionMode.MESSAGE, CompressionFormat.ZSTD)),
    (2, ".mcap", (CompressionMode.MESSAGE, CompressionFormat.ZSTD)),
    (2, ".mcap", (CompressionMode.FILE, CompressionFormat.ZSTD)),
    (2, ".mcap", (CompressionMode.STORAGE, CompressionFormat.ZSTD)),
]
"""The version of ROS, the suffix, and the compression: of the pieces of a file, of each message or of the file."""


@pytest.mark.parametrize(("version", "suffix", "compression"), COMPRESSED)
def test_compressed_bags_are_those_that_were_compressed(
    version: int, suffix: str, compression: tuple[Any, ...], tmp_path: Path
) -> None:
    ros = Ros(version)
    path = ros.write(tmp_path, messages_of(ros, DIVE), suffix, *compression)
    assert path in list_files(tmp_path).tests
    log = read_log(path, BLUEROV2)
    motion.check(log.log)
    assert [finding.kind for finding in log.findings] == ["source of commands", "unknown direction"]


def test_a_damaged_message_is_left_out(tmp_path: Path) -> None:
    """A message of one byte stands among those of 64 bits."""
    ros = Ros(2)
    messages = [*messages_of(ros, DIVE), ("/battery", 5.0, ros.message("std_msgs/msg/Bool"))]
    log = read_log(ros.write(tmp_path, messages), BLUEROV2)
    motion.check(log.log)
    assert "dive.db3: 1 damaged piece left out" in told(log)


def test_the_table_of_topics_names_what_is_not_known(tmp_path: Path) -> None:
    """A driver publishes percent, and an altitude in cm that is negative below the surface."""
    ros = Ros(2)
    messages: list[tuple[str, float, Any]] = []
    for n, time in enumerate(TIME):
        messages += [("/out", time, ros.message("std_msgs/msg/Float64MultiArray", data=0.25 * DIVE.pulses[n] - 375.0))]
        messages += [("/alt", time, ros.vector("Vector3", [0.0, 0.0, -100.0 * motion.DEPTH[n]]))]
    path = ros.write(tmp_path, messages)
    table = {f"/out.data[{n}]": f"u_{n + 1} [%]" for n in range(6)} | {"/alt.z": "-depth [cm]"}
    names, mistakes = names_of(BLUEROV2, RovTables(topics=table))
    assert not mistakes
    log = read_log(path, BLUEROV2, names=names)
    assert axes(log.log) == ["heave"]
    assert measured(log.log, "depth") == pytest.approx(motion.DEPTH)
    assert commanded(log.log, "2") == pytest.approx(motion.THRUSTERS["2"])
    assert log.log.names >= table.keys()
    assert log.log.commands
    assert log.log.commands.source.topic == "/out.data[0] ... /out.data[5]"
    messages += [("/rc/out", time, outputs(ros, DIVE, n)) for n, time in enumerate(TIME)]
    names, _ = names_of(BLUEROV2, RovTables(topics={"/alt.z": "-depth [cm]"}))
    found = read_log(ros.write(tmp_path / "autopilot", messages), BLUEROV2, names=names).log
    assert commanded(found, "2") == pytest.approx(motion.THRUSTERS["2"])
    assert (axes(found), [*found.unread]) == (["heave"], ["/out", *(f"/out.data[{n}]" for n in range(6))])
