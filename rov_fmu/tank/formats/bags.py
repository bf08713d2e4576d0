"""Read bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap) with rosbags.

What is recognised, of several topics in this order:

    commands   a number for each thruster, in topics whose names have `thruster` or `motor` and its number; an array of
               numbers in a topic of thrusters, motors, actuators or commands; mavros_msgs/RCOut
    depth      a number in a topic with `depth` in its name, odometry, a pose, sensor_msgs/FluidPressure
    attitude   odometry, a pose, sensor_msgs/Imu
    velocity   odometry, a twist; rates from sensor_msgs/Imu too
    voltage    sensor_msgs/BatteryState

Frames are those of REP 103 (forward, left, up in east, north, up) and are converted to forward, starboard, down in
north, east, down. A frame whose name has the word `ned` or `frd` is taken as it is.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.io.csv_table import NO_OUTPUT, DataFileError
from rov_fmu.io.messages import brief
from rov_fmu.model.layout import HEAVE
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.formats.content import Content, Topic, Wanted, ascending, content_of, fraction, together
from rov_fmu.tank.formats.motion import attitude_signals, position_signals, rotations, velocity_signals
from rov_fmu.tank.signals import Commands, Signal

_ENU: Array = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Turns east, north, up into north, east, down."""
_FLU: Array = np.diag([1.0, -1.0, -1.0])
"""Turns forward, left, up into forward, starboard, down."""
_ATMOSPHERE, _PRESSURE_GRADIENT = 101325.0, 1000.0 * 9.80665
"""The pressure above the water, Pa, and its gradient in fresh water, Pa/m."""
_LONGEST = 32
"""Longer arrays in messages are covariances, images or clouds, and are not read."""
_OTHER_CLOCK = 1.0
"""If the times of headers and of arrival differ by more than this, they come from different clocks, s."""
_REPAIR = {".bag": "rosbag reindex", ".db3": "sqlite3 .recover", ".mcap": "mcap recover"}
"""The commands that repair bags."""
_THRUSTER = re.compile(r"(?:thruster|motor|propeller|thrust)s?\D*(\d+)", re.IGNORECASE)
_ACTUATORS = re.compile("thrust|motor|actuator|propeller|pwm|command|cmd", re.IGNORECASE)
_READ = re.compile(
    r"(?:std_msgs/.*(?:Float|U?Int)\d+(?:MultiArray)?(?:Stamped)?|mavros_msgs/.*RCOut"
    r"|geometry_msgs/.*(?:Pose|Twist).*Stamped|nav_msgs/.*Odometry|sensor_msgs/.*(?:Imu|FluidPressure|BatteryState))"
)
"""The types of messages that may be recognised."""
_RC_OUT = "std_msgs/Header header\nuint8 rssi\nuint16[] channels\n"
"""The definition of mavros_msgs/RCOut, for bags without definitions."""


def read_bag(path: Path, wanted: Wanted) -> Content:
    """Read what is recognised in a bag, and what the table [topics] names. Raises DataFileError."""
    try:
        import rosbags.highlevel  # noqa: F401 (to give a clear message)
    except ImportError:
        raise DataFileError(f"{path}: bags need rosbags: pip install 'rov-fmu[ros]'") from None
    if path.is_file() and not path.stat().st_size:
        raise DataFileError(f"{path}: the file is empty")
    named = {source.rpartition(".")[0] for source in wanted.entries} | {*wanted.entries}
    try:
        topics, unread, findings = _topics(path, {name.partition(".")[0] for name in named})
    except Exception as error:  # a parser may raise anything on bytes that are not a bag
        reason = brief(str(error)) or type(error).__name__
        hint = f"; after a recording that was cut short, `{_REPAIR[path.suffix.lower()]}` may repair it"
        raise DataFileError(f"{path}: cannot be read as a bag: {reason}{hint}") from error
    measured = {topic.name: [*_signals(topic)] for topic in sorted(topics, key=_rank)}
    signals = [signal for found in measured.values() for signal in found]
    commands, source = (None, []) if wanted.names_commands else _commands(path, topics, wanted)
    content = content_of(path.name, topics, wanted, commands, signals)
    content.findings, content.unread = findings, unread
    for topic in topics:
        if topic.name not in source and not measured[topic.name]:
            content.unread[topic.name] = f"{topic.kind}, {len(topic.time)} messages: {brief(', '.join(topic.fields))}"
    if source:
        names = {"source": ", ".join(source)}
        content.findings.append(Finding("source of commands", file=path.name, names=names))
    if any(_rank(topic) == _PRESSURE for topic in topics) and not any(_is_depth(topic) for topic in topics):
        content.findings.append(Finding("depth by pressure", file=path.name))
    return content


# ---- Messages --------------------------------------------------------------------------------------------------------


def _topics(path: Path, named: set[str]) -> tuple[list[Topic], dict[str, str], list[Finding]]:
    """Return the topics that may be recognised or are named, a description of the others, and findings."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(_RC_OUT, "mavros_msgs/msg/RCOut"))
    rows: defaultdict[str, list[dict[str, float]]] = defaultdict(list)
    stamps: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    kinds: dict[str, str] = {}
    frames: dict[str, tuple[str, ...]] = {}
    unread: dict[str, str] = {}
    damaged = 0
    with AnyReader([path], default_typestore=store) as reader:
        for connection in reader.connections:
            kinds[connection.topic] = connection.msgtype
        read = [c for c in reader.connections if c.topic in named or _READ.fullmatch(c.msgtype)]
        for connection in reader.connections:
            if connection not in read:
                count = f"{connection.msgcount} messages"
                unread[connection.topic] = ": ".join([f"{connection.msgtype}, {count}", *_example(reader, connection)])
        for connection, arrival, raw in reader.messages(read) if read else ():
            try:
                message: Any = reader.deserialize(raw, connection.msgtype)
            except Exception:  # a damaged message, or one of an unknown type
                damaged += 1
                continue
            topic, header = connection.topic, getattr(message, "header", None)
            stamp = header.stamp.sec + header.stamp.nanosec * 1e-9 if header else 0.0
            stamps[topic].append((stamp or np.nan, arrival * 1e-9))
            rows[topic].append(dict(_numbers("", message)))
            if header and topic not in frames:
                frames[topic] = (header.frame_id, *filter(None, [getattr(message, "child_frame_id", "")]))
    findings = [Finding("damaged pieces", file=path.name, numbers={"count": damaged})] if damaged else []
    times, late = _times({topic: np.array(pairs) for topic, pairs in stamps.items()})
    if late:
        numbers = {"count": sum(len(rows[topic]) for topic in late)}
        names = {"topics": brief(", ".join(late))}
        findings.append(Finding("time of arrival", file=path.name, names=names, numbers=numbers))
    topics = []
    for name, found in rows.items():
        keys = dict.fromkeys(key for row in found for key in row)
        columns = [np.array([row.get(key, np.nan) for row in found]) for key in keys]
        time, *columns = ascending(times[name], *columns)
        topics.append(Topic(name, kinds[name], time, dict(zip(keys, columns, strict=True)), frames.get(name, ())))
    return topics, unread, findings


def _times(stamps: Mapping[str, Array]) -> tuple[dict[str, Array], list[str]]:
    """Return the times of each topic: of the headers, or of the arrival; and the topics with times of the arrival.

    Where headers are of another clock than arrivals, such as that of a simulation, the arrivals are moved to it.
    """
    pairs = np.concatenate([*stamps.values(), np.empty((0, 2))])
    stamped = pairs[np.isfinite(pairs[:, 0])]
    delay = float(np.median(stamped[:, 1] - stamped[:, 0])) if len(stamped) else 0.0
    delay = delay if abs(delay) > _OTHER_CLOCK else 0.0
    times, late = {}, []
    for topic, both in stamps.items():
        header, arrival = both.T
        if np.isnan(header).any():
            late.append(topic)
        times[topic] = np.where(np.isnan(header), arrival - delay, header)
    return times, late


def _numbers(place: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their paths, except those of the header."""
    if isinstance(value, int | float | np.number):
        yield place, float(value)
    elif isinstance(value, np.ndarray | list | tuple):
        if len(value) <= _LONGEST:
            for n, one in enumerate(value):
                yield from _numbers(f"{place}[{n}]", one)
    else:
        for name in getattr(value, "__dataclass_fields__", ()):
            if name not in ("header", "__msgtype__"):
                yield from _numbers(f"{place}.{name}" if place else name, getattr(value, name))


def _example(reader: Any, connection: Any) -> Iterator[str]:
    """Yield the names of the numbers in the first message of a topic, as far as it can be read."""
    try:
        _, _, raw = next(reader.messages([connection]))
        yield brief(", ".join(name for name, _ in _numbers("", reader.deserialize(raw, connection.msgtype))))
    except Exception:  # no message, or one of an unknown type
        return


# ---- What is recognised ----------------------------------------------------------------------------------------------

_PRESSURE = 4


def _rank(topic: Topic) -> int:
    """Return the rank of a topic among those with the same quantity; the lowest is taken."""
    order = (_is_depth(topic), "Odometry" in topic.kind, "Stamped" in topic.kind, "Imu" in topic.kind)
    return order.index(True) if any(order) else _PRESSURE if "FluidPressure" in topic.kind else _PRESSURE + 1


def _is_depth(topic: Topic) -> bool:
    return "data" in topic.fields and "depth" in topic.name.lower()


def _signals(topic: Topic) -> Iterator[Signal]:
    """Yield the signals of a topic."""
    time, fields = topic.time, topic.fields
    earth, body = _frames(topic)
    if _is_depth(topic):
        yield Signal(HEAVE, HEAVE.position, time, fields["data"])
    if "fluid_pressure" in fields:
        yield Signal(HEAVE, HEAVE.position, time, (fields["fluid_pressure"] - _ATMOSPHERE) / _PRESSURE_GRADIENT)
    if "BatteryState" in topic.kind:
        yield Signal(None, "voltage", time, fields["voltage"])
    for pose in ("pose.pose.", "pose.", ""):
        if (position := topic.columns(*(f"{pose}position.{c}" for c in "xyz"))) is not None:
            yield from position_signals(time, position @ earth.T)
        quaternion = topic.columns(*(f"{pose}orientation.{c}" for c in "wxyz"))
        if quaternion is not None and not (fields.get("orientation_covariance[0]", np.zeros(1)) < 0.0).any():
            yield from attitude_signals(time, earth @ rotations(quaternion) @ body)
    for twist in ("twist.twist.", "twist."):
        linear, angular = (topic.columns(*(f"{twist}{kind}.{c}" for c in "xyz")) for kind in ("linear", "angular"))
        if linear is not None and angular is not None:
            yield from velocity_signals(time, linear @ body, angular @ body)
    if (rates := topic.columns(*(f"angular_velocity.{c}" for c in "xyz"))) is not None:
        yield from velocity_signals(time, None, rates @ body)


def _is_used(output: Array) -> bool:
    return not np.isin(output, NO_OUTPUT).all()


def _frames(topic: Topic) -> tuple[Array, Array]:
    """Return two rotation matrices: from the earth frame of the topic to north, east, down, and from its body frame to
    forward, starboard, down."""
    earth, body = topic.frames if len(topic.frames) > 1 else ("", *topic.frames[:1], "")[:2]
    earth_words, body_words = ({*re.split("[^a-z]+", name.lower())} for name in (earth, body))
    is_frd = bool(body_words & {"ned", "frd"}) or ("ned" in earth_words and "flu" not in body_words)
    is_ned = "ned" in earth_words or (not earth and is_frd)
    return np.eye(3) if is_ned else _ENU, np.eye(3) if is_frd else _FLU


def _commands(path: Path, topics: Sequence[Topic], wanted: Wanted) -> tuple[Commands | None, list[str]]:
    """Return the commands of the thrusters and the topics they come from. Raises DataFileError."""
    single = {
        int(found[1]): topic
        for topic in topics
        if topic.fields.keys() == {"data"} and not _is_depth(topic) and (found := _THRUSTER.search(topic.name))
    }
    if single:
        ordered = [single[n] for n in sorted(single)]
        values = wanted.named(fraction(str(path), topic.name, topic.fields["data"]) for topic in ordered)
        times = (topic.time for topic in ordered)
        series = {name: (time, output) for time, (name, output) in zip(times, values.items(), strict=False)}
        return together(series), [topic.name for topic in ordered]
    for array, pattern in (("data", _ACTUATORS), ("channels", re.compile(""))):
        for topic in topics:
            if f"{array}[0]" in topic.fields and pattern.search(topic.name):
                outputs = [values for name, values in topic.fields.items() if name.startswith(f"{array}[")]
                count = len(wanted.thrusters) or max(n for n, one in enumerate([True, *map(_is_used, outputs)]) if one)
                used = wanted.named(fraction(str(path), topic.name, np.array(outputs[:count])))
                return together({name: (topic.time, values) for name, values in used.items()}), [topic.name]
    return None, []
