"""Writers of logs in every format that is read, and a dive of the BlueROV2 in each of them."""

import json
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.json_format import ParseDict
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.readers.bags import _DEFINITIONS

RATES = np.array([0.1, -0.2, 0.3])
"""The velocities in roll, pitch and yaw that logs state beside the angles, rad/s."""


@dataclass
class Dive:
    """A dive of the BlueROV2, with a row each 0.1 s."""

    start: float
    """The time since the vehicle was booted, s."""
    pulses: Array
    """N x 6, whole µs."""
    euler: Array
    """N x 3: roll, pitch and heading."""
    velocity: Array
    """N x 3: in surge, sway and heave."""
    voltage: Array
    time: Array
    """N: since the start, s."""
    origin: tuple[float, float, float] = (3.0, -2.0, 5.0)

    @property
    def rotation(self) -> Array:
        """N x 3 x 3: from the body (forward, starboard, down) to north, east, down."""
        return np.asarray(Rotation.from_euler("ZYX", self.euler[:, ::-1]).as_matrix())

    @property
    def over_ground(self) -> Array:
        """N x 3: the velocity to the north, to the east and down."""
        return np.asarray(np.einsum("nij,nj->ni", self.rotation, self.velocity))

    @property
    def position(self) -> Array:
        """N x 3: north, east, down."""
        rate = self.over_ground
        steps = 0.5 * np.diff(self.time)[:, None] * (rate[1:] + rate[:-1])
        travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        return np.asarray(np.array(self.origin) + travelled)


# ---- Text ------------------------------------------------------------------------------------------------------------


def table(path: Path, titles: str, *columns: Array) -> Path:
    """Write a CSV file."""
    rows = (",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([titles, *rows]) + "\n", encoding="utf-8")
    return path


TITLES = ["time [s]", *(f"u_{n} [us]" for n in range(1, 7)), "depth [m]", "roll [rad]", "pitch [rad]", "heading [rad]"]
TITLES += ["surge velocity [m/s]", "sway velocity [m/s]", "heave velocity [m/s]", "voltage [V]"]


VARIABLES = {
    ("pwm." if title.startswith("u_") else "") + title.partition(" [")[0].replace(" ", "_"): title for title in TITLES
}
"""What the variables of MATLAB mean, whose names have no units; [columns] of rov.toml says it."""


def columns(dive: Dive) -> list[Array]:
    moved = [dive.position[:, 2], *dive.euler.T, *dive.velocity.T, dive.voltage]
    return [dive.start + dive.time, *dive.pulses.T, *moved]


def csv(folder: Path, dive: Dive) -> Path:
    return table(folder / "dive.csv", ",".join(TITLES), *columns(dive))


def matlab(folder: Path, dive: Dive) -> Path:
    """Write vectors of MATLAB, with the pulses in a structure."""
    own = dict(zip(VARIABLES, columns(dive), strict=True))
    pulses = {name.removeprefix("pwm."): own.pop(name) for name in VARIABLES if name.startswith("pwm.")}
    savemat(folder / "dive.mat", {**own, "pwm": pulses})
    return folder / "dive.mat"


def cockpit_lines(dive: Dive) -> list[str]:
    """Return the sentences that VideoRay Cockpit exports, with the checksums of NMEA, but with more digits."""
    lines = []
    for time, depth, (roll, pitch, yaw) in zip(dive.time, dive.position[:, 2], np.degrees(dive.euler), strict=True):
        date = datetime(2026, 9, 14, 10, 8, 2) + timedelta(seconds=float(time))
        cells = f"PVRND,{date:%m/%d/%Y,%H:%M:%S.%f},{depth:.6f},{yaw % 360.0:.5f},{pitch:.5f},{roll:.5f}"
        checksum = 0
        for byte in cells.encode():
            checksum ^= byte
        lines.append(f"${cells}*{checksum:02X}")
    return lines


def cockpit(folder: Path, dive: Dive) -> Path:
    (folder / "vr.txt").write_text("\r\n".join([*cockpit_lines(dive), ""]), encoding="utf-8", newline="")
    return folder / "vr.txt"


def dvl_reports(dive: Dive, *, is_dated: bool = True) -> list[dict[str, Any]]:
    """Return the reports of a DVL A50: a velocity, and a position by dead reckoning, of each row."""
    reports: list[dict[str, Any]] = []
    for time, (vx, vy, vz), place, angles in zip(
        dive.time, dive.velocity, dive.position, np.degrees(dive.euler), strict=True
    ):
        velocity = {"time": 100.0, "vx": vx, "vy": vy, "vz": vz, "fom": 0.001, "altitude": 1.2, "velocity_valid": True}
        dated = {"time_of_validity": round(1e6 * (BOOT + time))} if is_dated else {}
        reports.append({**velocity, **dated, "transducers": [{"id": 0}], "type": "velocity", "format": "json_v3.1"})
        moved = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), (*place, *angles), strict=True))
        reports.append({"ts": BOOT + time, **moved, "std": 0.01, "type": "position_local", "status": 0})
    return reports


def dvl(folder: Path, dive: Dive) -> Path:
    lines = "".join(f"{json.dumps(report)}\n" for report in dvl_reports(dive))
    (folder / "dvl.json").write_text(lines, encoding="utf-8")
    return folder / "dvl.json"


# ---- MAVLink ---------------------------------------------------------------------------------------------------------

BOOT = 1_700_000_000.0
"""When the vehicle began to count, s since 1970."""
LATE = 0.05
"""How late messages reach the ground station, s."""


def pulse(command: float) -> int:
    return round(1500.0 + 400.0 * command)


def write_tlog(path: Path, messages: Iterable[tuple[float, Any]], system: int = 1) -> Path:
    """Write messages with the times of their arrival: eight bytes, big-endian µs, then the message."""
    writer = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
    with path.open("ab") as file:
        for time, message in messages:
            file.write(struct.pack(">Q", round((BOOT + LATE + time) * 1e6)) + message.pack(writer))
    return path


def servos(time: float, *pulses: int, port: int = 0) -> tuple[float, Any]:
    outputs = [*pulses, *[0] * (16 - len(pulses))]
    stamp = round(time * 1e6) % 2**32
    return time, mavlink.MAVLink_servo_output_raw_message(stamp, port, *outputs)


def altitude(time: float, metres: float) -> tuple[float, Any]:
    return time, mavlink.MAVLink_global_position_int_message(
        round(time * 1e3), 0, 0, 0, round(metres * 1e3), 0, 0, 0, 0
    )


def attitude(time: float, yaw: float) -> tuple[float, Any]:
    return time, mavlink.MAVLink_attitude_message(round(time * 1e3), 0.1, -0.2, yaw, 0.0, 0.0, 0.0)


def parameter(name: str, value: float) -> tuple[float, Any]:
    return 1.0, mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0)


def _mavlink(dive: Dive) -> Iterator[tuple[float, str, dict[str, float]]]:
    """Yield the time, the name and the fields of each message."""
    for n, time in enumerate(dive.start + dive.time):
        servos = {f"servo{k}_raw": int(pulse) for k, pulse in enumerate(dive.pulses[n], start=1)}
        yield time, "SERVO_OUTPUT_RAW", {"time_usec": round(time * 1e6) % 2**32, "port": 0, **servos}
        boot = {"time_boot_ms": round(time * 1e3)}
        angles = dict(zip(("roll", "pitch", "yaw"), dive.euler[n].tolist(), strict=True))
        rates = dict(zip(("rollspeed", "pitchspeed", "yawspeed"), RATES, strict=True))
        yield time, "ATTITUDE", {**boot, **angles, **rates}
        local = [*dive.position[n].tolist(), *dive.over_ground[n].tolist()]
        yield time, "LOCAL_POSITION_NED", {**boot, **dict(zip(("x", "y", "z", "vx", "vy", "vz"), local, strict=True))}
        yield time, "SYS_STATUS", {"voltage_battery": round(1000.0 * dive.voltage[n])}


def tlog(folder: Path, dive: Dive) -> Path:
    messages = []
    for time, name, fields in _mavlink(dive):
        kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
        messages.append((time, kind(**{key: fields.get(key, 0) for key in kind.fieldnames})))
    return write_tlog(folder / "dive.tlog", messages)


def blueos(folder: Path, dive: Dive) -> Path:
    path = folder / "blueos.mcap"
    with path.open("wb") as file:
        writer, channels = Writer(file), {}
        writer.start(profile="", library="blueos")
        for time, name, fields in _mavlink(dive):
            topic = f"mavlink/1/1/{name}"
            if topic not in channels:
                schema = writer.register_schema(topic.replace("/", "."), "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            data = json.dumps({"header": {"system_id": 1, "component_id": 1}, "message": {"type": name, **fields}})
            stamp = round((BOOT + time) * 1e9)
            writer.add_message(channels[topic], stamp, data.encode(), stamp)
        told = {"type": "PARAM_VALUE", "param_id": [*b"MOT_1_DIRECTION\0"], "param_value": 1.0}
        kept = writer.register_channel("mavlink/1/1/PARAM_VALUE", "json", schema)
        for data in (json.dumps({"message": told}), "damaged", "[]"):
            writer.add_message(kept, stamp - 5 * 10**9, data.encode(), stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _form_of(name: str, fields: Mapping[str, Any]) -> DescriptorProto:
    """Return the definition of a structure of protobuf with such fields."""
    form = DescriptorProto(name=name)
    for number, (key, value) in enumerate(fields.items(), start=1):
        field = form.field.add(name=key, number=number, label=FieldDescriptorProto.LABEL_OPTIONAL)
        if isinstance(value, Mapping):
            form.nested_type.append(_form_of(f"Of_{key}", value))
            field.type, field.type_name = FieldDescriptorProto.TYPE_MESSAGE, f"Of_{key}"
        else:
            is_flag = isinstance(value, bool)
            field.type = FieldDescriptorProto.TYPE_BOOL if is_flag else FieldDescriptorProto.TYPE_DOUBLE
    return form


def write_mcap(path: Path, encoding: str, messages: Iterable[tuple[str, str, float, Mapping[str, Any]]]) -> Path:
    """Write an MCAP file without a profile: the topic, the type, the time since START, and the fields of each message.

    An encoding beside `json` and `protobuf` is one that nobody knows.
    """
    with path.open("wb") as file:
        writer, channels, kinds = Writer(file), {}, {}
        writer.start(profile="", library="test")
        for topic, kind, time, fields in messages:
            if topic not in channels:
                package, _, name = kind.rpartition(".")
                form = FileDescriptorProto(name=f"{kind}.proto", package=package, syntax="proto3")
                form.message_type.append(_form_of(name, fields))
                pool = DescriptorPool()
                pool.Add(form)
                kinds[topic] = GetMessageClass(pool.FindMessageTypeByName(kind))
                definition = FileDescriptorSet(file=[form]).SerializeToString()
                language, data = {"protobuf": ("protobuf", definition)}.get(encoding, ("jsonschema", b"{}"))
                schema = writer.register_schema(kind, language, data)
                channels[topic] = writer.register_channel(topic, encoding, schema)
            text = json.dumps(fields)
            raw = ParseDict(fields, kinds[topic]()).SerializeToString() if encoding == "protobuf" else text.encode()
            stamp = round((START + time) * 1e9)
            writer.add_message(channels[topic], stamp, raw, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


# ---- DataFlash -------------------------------------------------------------------------------------------------------

# Type, name, format and columns, as ArduSub 4.1 declares them.
FORMATS = {
    "RCOU": (150, "QHHHHHHHHHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6,C7,C8,C9,C10,C11,C12,C13,C14"),
    "ATT": (152, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "XKF1": (154, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "BAT": (156, "QBf", "TimeUS,Inst,Volt"),
    "RCO2": (157, "QHHHH", "TimeUS,C15,C16,C17,C18"),
    "RCO3": (158, "QHHHHHHHHHHHHHH", f"TimeUS,{','.join(f'C{n}' for n in range(19, 33))}"),
    "PARM": (155, "QNff", "TimeUS,Name,Value,Default"),
}
CODES = {"Q": "Q", "H": "H", "h": "h", "f": "f", "c": "h", "C": "H", "B": "B", "I": "I", "e": "i", "N": "16s"}


def packed(name: str, *values: Any) -> bytes:
    """Pack one message: A3 95, its type, its numbers; c, C and e are hundredths."""
    kind, form, _ = FORMATS[name]
    stored = [round(100 * v) if f in "cCe" else v for f, v in zip(form, values, strict=True)]
    return b"\xa3\x95" + bytes([kind]) + struct.pack("<" + "".join(CODES[f] for f in form), *stored)


def dataflash(path: Path, messages: Iterable[bytes]) -> Path:
    """Write a log, which begins with the formats of messages."""
    declared = {"FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"), **FORMATS}
    content = b""
    for name, (kind, form, columns) in declared.items():
        length = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(CODES[f] for f in form))
        content += b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", kind, length, name.encode(), form.encode(), columns.encode()
        )
    path.write_bytes(content + b"".join(messages))
    return path


def dataflash_text(path: Path, messages: Iterable[tuple[Any, ...]]) -> Path:
    """Write a log as ground stations convert it to text: a line for each message, with its numbers in their units."""
    declared = [(128, "BBnNZ", "FMT", "Type,Length,Name,Format,Columns")]
    declared += [(kind, form, name, columns) for name, (kind, form, columns) in FORMATS.items()]
    lines = [f"FMT, {kind}, 89, {name}, {form}, {columns}" for kind, form, name, columns in declared]
    for name, *values in messages:
        lines.append(", ".join([name, *(v.decode() if isinstance(v, bytes) else f"{v:.16g}" for v in values)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def rcou(time: float, *pulses: int) -> bytes:
    return packed("RCOU", round(time * 1e6), *pulses, *[0] * (14 - len(pulses)))


def _flash_messages(dive: Dive) -> Iterator[tuple[Any, ...]]:
    """Yield the name and the values of each message."""
    yield "PARM", round(dive.start * 1e6), b"MOT_1_DIRECTION", 1.0, 0.0
    for n, time in enumerate(dive.start + dive.time):
        degrees, stamp = np.degrees(dive.euler[n]), round(time * 1e6)
        heading = degrees[2] % 360.0
        yield "RCOU", stamp, *dive.pulses[n].astype(int).tolist(), *[0] * 8
        yield "ATT", stamp, 0.0, degrees[0], 0.0, degrees[1], 0.0, heading, 0.0, 0.0, 3
        filtered = [*degrees[:2], heading, *dive.over_ground[n], 0.0, *dive.position[n], 0.0, 0.0, 0.0, 0.0]
        yield "XKF1", stamp, 0, *filtered
        yield "BAT", stamp, 0, dive.voltage[n]


def flash(folder: Path, dive: Dive) -> Path:
    return dataflash(folder / "dive.bin", (packed(*message) for message in _flash_messages(dive)))


def flash_text(folder: Path, dive: Dive) -> Path:
    return dataflash_text(folder / "dive.log", _flash_messages(dive))


# ---- ULog ------------------------------------------------------------------------------------------------------------

ULOG_BOOT = 100.0  # s, at the beginning of the log
ULOG_FORMATS = {
    "actuator_motors": "float[12] control",
    "actuator_outputs": "uint32_t noutputs;uint8_t[4] _padding0;float[16] output",
    "vehicle_attitude": "uint64_t timestamp_sample;float[4] q",
    "vehicle_odometry": "float[4] q;float[3] position;float[3] velocity;float[3] angular_velocity;"
    "uint8_t velocity_frame",
    "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;bool v_xy_valid",
    "vehicle_angular_velocity": "float[3] xyz",
    "battery_status": "float voltage_v",
    "cpuload": "float load",
}
ULOG_CODES = {"float": "f", "uint64_t": "Q", "uint32_t": "I", "uint8_t": "B", "bool": "?"}


class ULogWriter:
    """Collects messages."""

    def __init__(self, **parameters: int) -> None:
        self.content = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", round(ULOG_BOOT * 1e6))
        for name, value in parameters.items():
            self.parameter(name, value)
        for name, fields in ULOG_FORMATS.items():
            self._add(b"F", f"{name}:uint64_t timestamp;{fields};".encode())
        for n, name in enumerate(ULOG_FORMATS):
            self._add(b"A", struct.pack("<BH", 0, n) + name.encode())

    def _add(self, kind: bytes, payload: bytes) -> None:
        self.content += struct.pack("<H", len(payload)) + kind + payload

    def parameter(self, name: str, value: int) -> None:
        key = f"int32_t {name}".encode()
        self._add(b"P", bytes([len(key)]) + key + struct.pack("<i", value))

    def message(self, name: str, time: float, *values: float) -> None:
        form = ""
        for field in ULOG_FORMATS[name].split(";"):
            kind, _, count = field.split(" ")[0].partition("[")
            form += f"{int(count.rstrip(']')) if count else 1}{ULOG_CODES[kind]}"
        stamp = round((ULOG_BOOT + time) * 1e6)
        packed = struct.pack(f"<Q{form}", stamp, *values)
        self._add(b"D", struct.pack("<H", [*ULOG_FORMATS].index(name)) + packed)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.content)
        return path


def ulog_of(
    dive: Dive, velocity: str = "vehicle_local_position", *, pulses: bool = True, **parameters: int
) -> ULogWriter:
    """Return the messages of a dive. The attitude is published 2 ms after it was sampled, or stands in the odometry."""
    log = ULogWriter(**parameters)
    for n, time in enumerate(dive.time):
        if pulses:
            log.message("actuator_outputs", time, 6, *[0] * 4, *dive.pulses[n], *[0.0] * 10)
        else:
            log.message("actuator_motors", time, *(dive.pulses[n] - 1500.0) / 400.0, *[np.nan] * 6)
        quaternion = Rotation.from_matrix(dive.rotation[n]).as_quat(scalar_first=True)
        if velocity == "vehicle_local_position":
            log.message("vehicle_attitude", time + 0.002, round((ULOG_BOOT + time) * 1e6), *quaternion)
            log.message("vehicle_angular_velocity", time, *RATES)
            log.message(velocity, time, *dive.position[n], *dive.over_ground[n], True)
        else:
            frame, moved = (3, dive.velocity) if velocity == "body" else (1, dive.over_ground)
            log.message("vehicle_odometry", time, *quaternion, *dive.position[n], *moved[n], *RATES, frame)
        log.message("battery_status", time, dive.voltage[n])
        log.message("cpuload", time, 0.5)
    return log


def ulog(folder: Path, dive: Dive) -> Path:
    return ulog_of(dive).write(folder / "dive.ulg")


# ---- ROS -------------------------------------------------------------------------------------------------------------

START = 1_700_000_000.0  # s since 1970
ARRIVAL = 0.03  # s, from the header to the arrival
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU = np.diag([1.0, -1.0, -1.0])
Messages = Iterable[tuple[str, float, Any]]


class Ros:
    """Makes and writes messages of one version of ROS."""

    def __init__(self, version: int) -> None:
        self.version = version
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        for kind, definition in _DEFINITIONS.items():
            self.store.register(get_types_from_msg(definition, kind))

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
        return self.message(
            "geometry_msgs/msg/Quaternion", **dict(zip("xyzw", Rotation.from_matrix(R).as_quat().tolist(), strict=True))
        )

    def odometry(self, header: Any, place: Iterable[float], R: Any, *velocities: Iterable[float]) -> Any:
        pose = self.message(
            "geometry_msgs/msg/Pose", position=self.vector("Point", place), orientation=self.quaternion(R)
        )
        linear, angular = (self.vector("Vector3", velocity) for velocity in velocities)
        twist = self.message("geometry_msgs/msg/Twist", linear=linear, angular=angular)
        return self.message(
            "nav_msgs/msg/Odometry",
            header=header,
            child_frame_id="rov/base_link",
            pose=self.message("geometry_msgs/msg/PoseWithCovariance", pose=pose),
            twist=self.message("geometry_msgs/msg/TwistWithCovariance", twist=twist),
        )

    def write(self, folder: Path, messages: Messages, suffix: str = ".db3", *compression: Any) -> Path:
        """Write a bag, and return the path of its file. The compression is what `set_compression` of rosbags takes."""
        found = sorted(messages, key=lambda entry: entry[1])
        path = folder / "dive.bag" if self.version == 1 else folder / "dive"
        plugin = StoragePlugin.MCAP if suffix == ".mcap" else StoragePlugin.SQLITE3
        unopened = Writer1(path) if self.version == 1 else Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            unopened.set_compression(*compression)
        with unopened as writer:
            connections: dict[str, Any] = {}
            for topic, time, message in found:
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                pack = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
                writer.write(connections[topic], round((START + time + ARRIVAL) * 1e9), pack(message, kind))
        return path if self.version == 1 else next(path.glob(f"*{suffix}*"))


def outputs(ros: Ros, dive: Dive, n: int) -> Any:
    channels = np.append(dive.pulses[n], np.zeros(10)).astype(np.uint16)
    return ros.message("mavros_msgs/msg/RCOut", header=ros.header(dive.time[n]), channels=channels)


def messages_of(
    ros: Ros, dive: Dive, *, ned: bool = False, commands: Callable[[Ros, Dive, int], Any] = outputs
) -> Messages:
    """Yield the messages of a dive, in the frames of REP 103 or in those of the sea."""
    earth, body = (np.eye(3), np.eye(3)) if ned else (ENU, FLU)
    for n, (time, R) in enumerate(zip(dive.time, dive.rotation, strict=True)):
        header = ros.header(time, "world_ned" if ned else "world")
        pose, velocities = (earth @ dive.position[n], earth @ R @ body), (body @ dive.velocity[n], body @ RATES)
        yield "/odom", time, ros.odometry(header, *pose, *velocities)
        yield "/thrusters", time, commands(ros, dive, n)
        battery = ros.message("sensor_msgs/msg/BatteryState", header=ros.header(time), voltage=dive.voltage[n])
        yield "/battery", time, battery


def bag(suffix: str) -> Callable[[Path, Dive], Path]:
    """Return a writer of bags."""

    def write(folder: Path, dive: Dive) -> Path:
        ros = Ros(1 if suffix == ".bag" else 2)
        return ros.write(folder, messages_of(ros, dive), suffix)

    return write


def packed_bag(folder: Path, dive: Dive) -> Path:
    """Write a bag of ROS 2 as `ros2 bag record --compression-mode file` leaves it."""
    ros = Ros(2)
    return ros.write(folder, messages_of(ros, dive), ".db3", CompressionMode.FILE, CompressionFormat.ZSTD)


LOGS: Mapping[str, Callable[[Path, Dive], Path]] = {
    ".bin": flash,
    ".tlog": tlog,
    ".ulg": ulog,
    **{suffix: bag(suffix) for suffix in (".bag", ".db3", ".mcap")},
    ".zstd": packed_bag,
}
"""The logs that have a suffix of their own, and that a parser of somebody else reads."""
SEEDS: Mapping[str, Callable[[Path, Dive], Path]] = {
    "a DataFlash log": flash,
    "a DataFlash log in text": flash_text,
    "a telemetry log": tlog,
    "a ULog": ulog,
    "a bag of ROS 1": bag(".bag"),
    "a bag of ROS 2": bag(".db3"),
    "an MCAP file": bag(".mcap"),
    "a file that zstd compressed": packed_bag,
    "a .mat file": matlab,
    "an export of VideoRay Cockpit": cockpit,
    "a log of Water Linked's DVL": dvl,
    "a CSV file": csv,
}
"""A writer for every format, by its name in rov_fmu/tank/readers/parsers.py."""
