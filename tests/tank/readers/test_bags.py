"""Bags of ROS 1 and ROS 2, which the tests write with rosbags."""

import bz2
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from struct import pack
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode
from rosbags.typesys import get_types_from_msg
from scipy.spatial.transform import Rotation

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import VehicleAxis
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.inspection.inspection import inspect
from rov_fmu.tank.readers.listing import list_files
from rov_fmu.tank.readers.recordings import Damage, Stream, bag_messages
from tests.commands import ROOT
from tests.tank.logs import Read, axes, commanded, measured, read_log
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME
from tests.tank.readers.writers import RATES, Ros, messages_of, outputs, write_mcap

DVLS = {
    "dvl_msgs/msg/DVL": "std_msgs/Header header\nfloat64 time\ngeometry_msgs/Vector3 velocity\nfloat64 fom\n"
    "float64 altitude\nbool velocity_valid\nint64 status\n",
    "marine_acoustic_msgs/msg/Dvl": "std_msgs/Header header\nuint8 velocity_mode\ngeometry_msgs/Vector3 velocity\n"
    "float64[9] velocity_covar\nuint8 num_good_beams\nbool beam_ranges_valid\nbool beam_velocities_valid\n",
}
"""The parts of the definitions of a DVL's messages that matter here."""


def told(log: Read) -> tuple[str, ...]:
    return sentences(log.findings)


def test_frames_that_are_named_ned_are_those_of_the_sea_already(tmp_path: Path) -> None:
    log = read_log(Ros(2).write(tmp_path, messages_of(Ros(2), DIVE, ned=True)), BLUEROV2)
    motion.check(log.log)
    assert told(log) == (
        "dive.db3: the commands of the thrusters are those of /thrusters",
        "dive.db3: the log does not tell the directions of the motors (MOT_n_DIRECTION), so every thruster is taken to "
        "push ahead above its neutral pulse. [logs] in rov.toml may name those that do not: reversed = [...]",
    )


PX4 = {
    "px4_msgs/msg/VehicleOdometry": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] position\nfloat32[4] q\n"
    "uint8 velocity_frame\nfloat32[3] velocity\nfloat32[3] angular_velocity\n",
    "px4_msgs/msg/ActuatorOutputs": "uint64 timestamp\nuint32 noutputs\nfloat32[16] output\n",
}
"""The parts of the definitions of PX4's messages in ROS 2 that matter here."""


@pytest.mark.parametrize(("number", "moved"), [(1, DIVE.over_ground), (3, DIVE.velocity), (2, None)])
@pytest.mark.parametrize("suffix", [".db3", ".mcap"])
def test_messages_of_px4_in_a_bag_are_those_of_its_own_logs(
    number: int, moved: Any, suffix: str, tmp_path: Path
) -> None:
    """A velocity in another frame than those of the earth and the body is not used."""
    ros = Ros(2)
    for kind, definition in PX4.items():
        ros.store.register(get_types_from_msg(definition, kind))

    def messages() -> Iterator[tuple[str, float, Any]]:
        for n, time in enumerate(TIME.tolist()):
            odometry = {
                "timestamp": 10**15 + n,
                "position": DIVE.position[n],
                "q": Rotation.from_matrix(DIVE.rotation[n]).as_quat(scalar_first=True),
                "velocity": (DIVE.velocity if moved is None else moved)[n],
                "angular_velocity": RATES,
            }
            single = {key: np.asarray(own, np.float32) for key, own in odometry.items() if key != "timestamp"}
            stamp = {"timestamp": odometry["timestamp"], "velocity_frame": number}
            yield "/fmu/out/vehicle_odometry", time, ros.message("px4_msgs/msg/VehicleOdometry", **stamp, **single)
            pulses = np.append(DIVE.pulses[n], np.zeros(10)).astype(np.float32)
            yield (
                "/fmu/out/actuator_outputs",
                time,
                ros.message("px4_msgs/msg/ActuatorOutputs", noutputs=6, output=pulses),
            )

    log = read_log(ros.write(tmp_path, messages(), suffix), BLUEROV2)
    assert not [name for name in log.log.unread if "timestamp" in name]
    if moved is None:
        assert "surge velocity" not in {channel.quantity.name for channel in log.log.channels}
        return
    assert measured(log.log, "surge velocity") == pytest.approx(DIVE.velocity[:, 0], abs=1e-5)
    assert measured(log.log, "depth") == pytest.approx(motion.DEPTH, abs=1e-5)
    assert measured(log.log, "heading") == pytest.approx(motion.HEADING, abs=1e-5)
    assert commanded(log.log, "5") == pytest.approx(motion.THRUSTERS["5"], abs=2e-3)


COMPRESSED = [
    (1, ".bag", (Writer1.CompressionFormat.BZ2,)),
    (1, ".bag", (Writer1.CompressionFormat.LZ4,)),
    (2, ".db3", (CompressionMode.MESSAGE, CompressionFormat.ZSTD)),
    (2, ".mcap", (CompressionMode.MESSAGE, CompressionFormat.ZSTD)),
    (2, ".mcap", (CompressionMode.FILE, CompressionFormat.ZSTD)),
    (2, ".mcap", (CompressionMode.STORAGE, CompressionFormat.ZSTD)),
]
"""The version of ROS, the suffix, and the compression: of the pieces of a file, of each message or of the file."""


@pytest.mark.parametrize(
    ("version", "suffix", "compression"),
    [pytest.param(*one, marks=pytest.mark.long if n % 3 else ()) for n, one in enumerate(COMPRESSED)],
)
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


FORCES = {
    "X_ext": motion.COMMAND,
    "Y_ext": -motion.COMMAND,
    "Z_ext": 2.0 * motion.COMMAND,
    "N_ext": 0.1 * motion.COMMAND,
}


def blueye() -> Iterator[tuple[str, str, float, Mapping[str, Any]]]:
    """Yield the messages of a dive of a Blueye."""
    for n, time in enumerate(TIME.tolist()):
        roll, pitch, yaw = np.degrees(DIVE.euler[n]).tolist()
        rates = {"surge_rate": motion.U[n], "sway_rate": motion.V[n], "yaw_rate": 0.3, "is_valid": n >= 10}
        force = dict(zip(("surge", "sway", "heave", "yaw"), (float(own[n]) for own in FORCES.values()), strict=True))
        told = {
            "ControlForce": {"control_force": force},
            "Depth": {"depth": {"value": float(DIVE.position[n, 2])}},
            "Attitude": {"attitude": {"roll": roll, "pitch": pitch, "yaw": yaw}},
            "PositionEstimate": {"position_estimate": {"heading": float(motion.HEADING[n]), **rates}},
        }
        yield from ((f"{name}Tel", f"blueye.protocol.{name}Tel", time, fields) for name, fields in told.items())


def test_the_forces_and_the_motion_of_a_blueye(tmp_path: Path) -> None:
    """Forces are along the body, forward, starboard and down; `inspect` finds them before a vehicle is known."""
    path = write_mcap(tmp_path / "dive.mcap", "protobuf", blueye())
    layout = Layout.of_wrench(map(VehicleAxis, (SURGE, SWAY, HEAVE, YAW)))
    log = read_log(path, layout).log
    for name, values in FORCES.items():
        assert commanded(log, name) == pytest.approx(values)
    assert measured(log, "depth") == pytest.approx(DIVE.position[:, 2])
    assert measured(log, "roll angle") == pytest.approx(motion.ROLL)
    assert measured(log, "heading") == pytest.approx(motion.HEADING)
    for name, values in {"surge": motion.U, "sway": motion.V, "yaw": np.full(100, 0.3)}.items():
        assert measured(log, f"{name} velocity") == pytest.approx(values[10:])
    (found,) = inspect(path, [BLUEROV2])
    assert {one.name: one.high for one in found.commands if one.high} == {
        name: pytest.approx(values.max()) for name, values in FORCES.items() if values.max()
    }
    assert not found.unread


@pytest.mark.parametrize("encoding", ["json", "protobuf", "flatbuffer"])
def test_messages_of_an_own_kind_are_listed_and_rov_toml_names_them(encoding: str, tmp_path: Path) -> None:
    messages = [
        (
            topic,
            f"own.{topic.title()}",
            time,
            {"data": {"down": float(motion.DEPTH[n]), "push": float(motion.COMMAND[n])}},
        )
        for n, time in enumerate(TIME.tolist())
        for topic in ("sensor", "mixer")
    ]
    path = write_mcap(tmp_path / "dive.mcap", encoding, messages)
    (found,) = inspect(path, [BLUEROV2])
    fields = {"sensor.data.down": "1 to 1.99", "mixer.data.push": "0 to 0.25"} if encoding != "flatbuffer" else {}
    assert {"sensor": "own.Sensor, 100 messages", **fields}.items() <= found.unread.items()
    later = ("sensor", "own.Sensor", TIME[-1] + 1.0, {"data": {"down": 9.0, "push": 9.0}})
    (more,) = inspect(write_mcap(tmp_path / "more.mcap", encoding, [*messages, later]), [BLUEROV2])
    assert (
        more.unread.get("sensor.data.down", "1 to 1.99 in the first 100 messages")
        == "1 to 1.99 in the first 100 messages"
    )
    assert (more.unread["sensor"], more.unread["mixer"]) == ("own.Sensor, 101 messages", "own.Mixer, 100 messages")
    if fields:
        names, _ = names_of(BLUEROV2, RovTables(topics={"sensor.data.down": "depth [m]", "mixer.data.push": "u_5 [1]"}))
        log = read_log(path, BLUEROV2, names=names).log
        assert measured(log, "depth") == pytest.approx(motion.DEPTH)
        assert commanded(log, "5") == pytest.approx(motion.COMMAND)


def test_depth_and_heading_of_mavros_and_velocities_of_a_dvl(tmp_path: Path) -> None:
    """A DVL says itself which of its velocities are valid, and a flag of its beams says nothing about them."""
    ros = Ros(2)
    for kind, text in DVLS.items():
        ros.store.register(get_types_from_msg(text, kind))
    number = ros.store.types["std_msgs/msg/Float64"]
    for kind, known in {"dvl_msgs/msg/DVL": TIME >= 2.0, "marine_acoustic_msgs/msg/Dvl": TIME < 8.0}.items():
        messages: list[tuple[str, float, Any]] = []
        for n, (time, is_known) in enumerate(zip(TIME, known.tolist(), strict=True)):
            told = {"velocity_valid": is_known, "velocity_mode": 1 if is_known else 2, "num_good_beams": 4}
            told = {name: value for name, value in told.items() if name in DVLS[kind]}
            velocity = ros.vector("Vector3", DIVE.velocity[n] if is_known else [0.0] * 3)
            degrees = float(np.degrees(motion.HEADING[n]) % 360.0)
            messages += [
                ("/mavros/rc/out", time, outputs(ros, DIVE, n)),
                ("/mavros/global_position/rel_alt", time, number(data=-motion.DEPTH[n])),
                ("/mavros/global_position/compass_hdg", time, number(data=degrees)),
                ("/dvl/data", time, ros.message(kind, header=ros.header(time, "dvl"), velocity=velocity, **told)),
            ]
        log = read_log(ros.write(tmp_path / kind.partition("_")[0], messages), BLUEROV2).log
        assert measured(log, "depth") == pytest.approx(motion.DEPTH)
        assert measured(log, "heading") == pytest.approx(motion.HEADING)
        for axis, values in zip(("surge", "sway", "heave"), DIVE.velocity.T, strict=True):
            assert measured(log, f"{axis} velocity") == pytest.approx(values[known])


def _fields(**fields: bytes) -> bytes:
    named = [f"{name}=".encode() + value for name, value in fields.items()]
    return b"".join(pack("<I", len(field)) + field for field in named)


def _record(data: bytes, **fields: bytes) -> bytes:
    """Return a record of a bag of ROS 1, as its format 2.0 describes it: a header of fields, and data."""
    header = _fields(**fields)
    return pack("<I", len(header)) + header + pack("<I", len(data)) + data


@pytest.mark.parametrize("compression", ["none", "bz2"])
def test_a_bag_without_an_index_is_read_by_what_is_inside_rosbags(compression: str, tmp_path: Path) -> None:
    """The bytes are written here. A new rosbags may change what is inside it, so that only tried versions are taken."""
    definition = _fields(type=b"std_msgs/Float64", message_definition=b"float64 data\n")
    own = _record(definition, op=b"\x07", conn=pack("<I", 3), topic=b"/depth")
    for n in range(3):
        at = pack("<II", 100 + n, 500_000_000)
        own += _record(pack("<d", 0.5 * n), op=b"\x02", conn=pack("<I", 3), time=at)
    packed = bz2.compress(own) if compression == "bz2" else own
    chunk = _record(packed, op=b"\x05", compression=compression.encode(), size=pack("<I", len(own)))
    head = _record(b" " * 9, op=b"\x03", index_pos=pack("<Q", 0), conn_count=pack("<I", 0), chunk_count=pack("<I", 0))
    path, damage = tmp_path / "dive.bag", Damage()
    path.write_bytes(b"#ROSBAG V2.0\n" + head + chunk)
    messages = [*bag_messages(path, damage)]
    assert damage.is_cut, "its header tells of no index"
    stream = Stream("/depth", "std_msgs/Float64", "ros1", "ros1msg", b"float64 data\n")
    expected = [(stream, (100 + n) * 10**9 + 500_000_000, pack("<d", 0.5 * n)) for n in range(3)]
    assert messages == expected
    (asked,) = re.findall(r'"rosbags(>=[^"]+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert re.fullmatch(r">=0\.11\.7,<0\.12", asked), "try what is inside the next version before it is allowed"
