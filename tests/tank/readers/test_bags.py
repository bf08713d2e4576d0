"""Bags of ROS 1 and ROS 2, which the tests write with rosbags."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.readers.bags import _RC_OUT
from tests.tank.logs import Read, axes, commanded, measured, read_log, used
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, TIME

START = 1_700_000_000.0  # s since 1970
LATE = 0.03  # s, from the header to the arrival
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU = np.diag([1.0, -1.0, -1.0])
Messages = Iterable[tuple[str, float, Any]]


class Ros:
    """Makes and writes messages of one version of ROS."""

    def __init__(self, version: int) -> None:
        self.version = version
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        self.store.register(get_types_from_msg(_RC_OUT, "mavros_msgs/msg/RCOut"))

    def message(self, kind: str, **fields: Any) -> Any:
        """Make a message; fields that are not given are zero."""
        return self.store.types[kind](**{name: fields.get(name, self._zero(*form)) for name, form in self._form(kind)})

    def _form(self, kind: str) -> Any:
        return [(name, form) for name, form in self.store.fielddefs[kind][1]]

    def _zero(self, form: Any, what: Any) -> Any:
        if form.name == "BASE":
            return "" if what[0] == "string" else 0
        if form.name == "NAME":
            return self.message(what)
        count = what[1] if form.name == "ARRAY" else 0
        return (
            np.zeros(count)
            if what[0][1][0] == "float64"
            else np.zeros(count, what[0][1][0])
            if what[0][0].name == "BASE"
            else []
        )

    def header(self, time: float, frame: str = "") -> Any:
        nanoseconds = round((START + time) * 1e9)
        stamp = self.message("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        return self.message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def vector(self, kind: str, values: Iterable[float]) -> Any:
        return self.message(f"geometry_msgs/msg/{kind}", **dict(zip("xyz", map(float, values), strict=True)))

    def quaternion(self, R: Any) -> Any:
        return self.message("geometry_msgs/msg/Quaternion", **dict(zip("wxyz", motion.quaternion(R), strict=True)))

    def odometry(self, header: Any, place: Iterable[float], R: Any, velocity: Iterable[float]) -> Any:
        pose = self.message(
            "geometry_msgs/msg/Pose", position=self.vector("Point", place), orientation=self.quaternion(R)
        )
        twist = self.message("geometry_msgs/msg/Twist", linear=self.vector("Vector3", velocity))
        return self.message(
            "nav_msgs/msg/Odometry",
            header=header,
            child_frame_id="rov/base_link",
            pose=self.message("geometry_msgs/msg/PoseWithCovariance", pose=pose),
            twist=self.message("geometry_msgs/msg/TwistWithCovariance", twist=twist),
        )

    def write(self, folder: Path, messages: Messages, suffix: str = ".db3") -> Path:
        """Write a bag, and return the path of its file."""
        found = sorted(messages, key=lambda entry: entry[1])
        path = folder / "dive.bag" if self.version == 1 else folder / "dive"
        plugin = StoragePlugin.MCAP if suffix == ".mcap" else StoragePlugin.SQLITE3
        with Writer1(path) if self.version == 1 else Writer2(path, version=9, storage_plugin=plugin) as writer:
            connections: dict[str, Any] = {}
            for topic, time, message in found:
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                pack = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
                writer.write(connections[topic], round((START + time + LATE) * 1e9), pack(message, kind))
        return path if self.version == 1 else next(path.glob(f"*{suffix}"))


def pulses(ros: Ros, n: int) -> Any:
    channels = np.array([round(1500 + 400 * c[n]) for c in motion.THRUSTERS.values()] + [0] * 10, np.uint16)
    return ros.message("mavros_msgs/msg/RCOut", header=ros.header(TIME[n]), channels=channels)


def array(ros: Ros, n: int) -> Any:
    return ros.message("std_msgs/msg/Float64MultiArray", data=np.array([c[n] for c in motion.THRUSTERS.values()]))


def dive(ros: Ros, *, ned: bool = False, commands: Callable[[Ros, int], Any] | None = pulses) -> Messages:
    """Yield the messages of a dive, in the frames of REP 103 or in those of the sea."""
    earth, body = (np.eye(3), np.eye(3)) if ned else (ENU, FLU)
    for n, (time, R) in enumerate(zip(TIME, motion.rotations(), strict=True)):
        place = earth @ [motion.NORTH[n], motion.EAST[n], motion.DEPTH[n]]
        velocity = body @ [motion.U[n], motion.V[n], motion.W[n]]
        header = ros.header(time, "world_ned" if ned else "world")
        yield "/odom", time, ros.odometry(header, place, earth @ R @ body, velocity)
        if commands:
            yield "/thrusters", time, commands(ros, n)
        if n % 10 == 0 or n == len(TIME) - 1:
            yield (
                "/battery",
                time,
                ros.message("sensor_msgs/msg/BatteryState", header=ros.header(time), voltage=motion.VOLTAGE[n]),
            )


def told(log: Read) -> tuple[str, ...]:
    return sentences(log.findings, SENTENCES)


@pytest.mark.parametrize("ned", [False, True])
def test_a_bag_is_read_in_si_units_and_in_the_frames_of_the_sea(ned: bool, tmp_path: Path) -> None:
    """Frames that are named ned are those already."""
    log = read_log(Ros(2).write(tmp_path, dive(Ros(2), ned=ned)), BLUEROV2)
    motion.check(log)
    assert told(log) == (
        "dive.db3: the commands of the thrusters are those of /thrusters",
        "dive.db3: the log does not tell the directions of the motors (MOT_n_DIRECTION), so every thruster is taken to "
        "push ahead above its neutral pulse",
    )


def test_commands_without_a_header_have_the_time_of_their_arrival(tmp_path: Path) -> None:
    ros = Ros(2)
    path = ros.write(tmp_path, dive(ros, commands=array))
    log = read_log(path, BLUEROV2)
    assert f"{path.name}: 100 messages of /thrusters without a time in the header: the time of arrival is used" in (
        told(log)
    )
    commands = log.log.commands
    assert commands is not None
    (step,) = np.flatnonzero(np.diff(commanded(log.log, "5")))
    first = used(log.log, "depth").time[0]
    assert commands.rows[step + 1] - first == pytest.approx(TIME[10] + LATE - TIME[0], abs=1e-6)


def test_a_topic_for_each_thruster_a_depth_sensor_and_an_imu(tmp_path: Path) -> None:
    """The topics count from 0; the IMU measures the attitude, and the pressure is not needed."""
    ros = Ros(2)
    messages: list[tuple[str, float, Any]] = []
    for n, (time, R) in enumerate(zip(TIME, motion.rotations(), strict=True)):
        number = ros.store.types["std_msgs/msg/Float64"]
        pulse = 1500.0 + 400.0 * np.array([*motion.THRUSTERS.values()])[:, n]
        messages += [(f"/rov/thruster{k}/input", time, number(data=float(value))) for k, value in enumerate(pulse)]
        messages += [("/bar30/depth", time, number(data=float(motion.DEPTH[n])))]
        header = ros.header(time, "imu_link")
        imu = ros.message("sensor_msgs/msg/Imu", header=header, orientation=ros.quaternion(ENU @ R @ FLU))
        pressure = ros.message("sensor_msgs/msg/FluidPressure", header=header, fluid_pressure=2e5)
        battery = ros.message("sensor_msgs/msg/BatteryState", header=header, voltage=motion.VOLTAGE[n])
        messages += [("/imu", time - LATE, imu), ("/pressure", time, pressure), ("/battery", time - LATE, battery)]
    log = read_log(ros.write(tmp_path, messages), BLUEROV2).log
    assert axes(log) == ["heave", "roll", "pitch", "yaw"]
    assert measured(log, "depth") == pytest.approx(motion.DEPTH)
    assert commanded(log, "6", used(log, "depth").time) == pytest.approx(motion.THRUSTERS["6"])
    assert measured(log, "heading") == pytest.approx(motion.HEADING, abs=1e-6)
    late = used(log, "depth").time - used(log, "heading").time
    assert late == pytest.approx(LATE * np.ones(len(TIME)), abs=1e-6)
    assert measured(log, "pitch angle").min() == pytest.approx(-0.2, abs=1e-3)


def test_the_table_of_topics_names_what_is_not_known(tmp_path: Path) -> None:
    """A driver publishes percent, and an altitude in cm that is negative below the surface."""
    ros = Ros(2)
    commands = [[100.0 * c[n] for c in motion.THRUSTERS.values()] for n in range(len(TIME))]
    messages: list[tuple[str, float, Any]] = []
    for n, time in enumerate(TIME):
        messages += [("/out", time, ros.message("std_msgs/msg/Float64MultiArray", data=np.array(commands[n])))]
        messages += [("/alt", time, ros.vector("Vector3", [0.0, 0.0, -100.0 * motion.DEPTH[n]]))]
    path = ros.write(tmp_path, messages)
    with pytest.raises(DataFileError, match="no commands of thrusters were found"):
        read_log(path, BLUEROV2)
    table = {f"/out.data[{n}]": f"u_{n + 1} [%]" for n in range(6)} | {"/alt.z": "-depth [cm]"}
    names, mistakes = names_of(BLUEROV2, RovTables(topics=table))
    assert not mistakes
    log = read_log(path, BLUEROV2, names=names)
    assert axes(log.log) == ["heave"]
    assert measured(log.log, "depth") == pytest.approx(motion.DEPTH)
    assert commanded(log.log, "2") == pytest.approx(motion.THRUSTERS["2"])
    assert log.log.names >= table.keys()
