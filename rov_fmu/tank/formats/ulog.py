"""Read logs of PX4 (.ulg) with pyulog.

What is recognised, of several topics in this order:

    commands   actuator_motors (fractions), actuator_outputs (pulses)
    attitude   vehicle_attitude, vehicle_odometry
    velocity   vehicle_local_position, vehicle_odometry; rates from vehicle_odometry, vehicle_angular_velocity
    depth      vehicle_local_position, vehicle_odometry
    voltage    battery_status

Thruster n of the vehicle is output n. Times are those of the sample, where a message has one, and otherwise of the
message.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import brief
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.formats.content import Content, Topic, Wanted, ascending, content_of, fraction, together
from rov_fmu.tank.formats.motion import attitude_signals, position_signals, rotations, to_body, velocity_signals
from rov_fmu.tank.signals import Commands, Signal

_OUTPUTS = {"actuator_motors": "control", "actuator_outputs": "output"}
_MOTION = (
    "vehicle_attitude",
    "vehicle_local_position",
    "vehicle_odometry",
    "vehicle_angular_velocity",
    "battery_status",
)
_NED, _BODY = 1.0, 3.0
"""The numbers of the frames of vehicle_odometry: of the earth, and of the body."""


def read_ulog(path: Path, wanted: Wanted) -> Content:
    """Read what is recognised in a ULog, and what the table [topics] names. Raises DataFileError."""
    try:
        from pyulog import ULog
    except ImportError:
        raise DataFileError(f"{path}: logs of PX4 need pyulog: pip install 'rov-fmu[px4]'") from None
    if not path.stat().st_size:
        raise DataFileError(f"{path}: the file is empty")
    printed = io.StringIO()
    try:
        with path.open("rb") as file, redirect_stdout(printed):  # pyulog prints about damage
            log = ULog(file)
    except Exception as error:  # a parser may raise anything on bytes that are not a log
        raise DataFileError(f"{path}: cannot be read as a ULog: {brief(str(error)) or type(error).__name__}") from error
    topics = [_topic(data) for data in log.data_list]
    signals = list(_signals(topics))
    commands = None if wanted.names_commands else _commands(path, topics, wanted)
    content = content_of(path.name, topics, wanted, commands, signals)
    content.unread = {
        topic.name: f"{len(topic.time)} messages: {brief(', '.join(topic.fields))}"
        for topic in topics
        if topic.kind not in (*_OUTPUTS, *_MOTION)
    }
    if log.file_corruption or printed.getvalue():
        content.findings.append(Finding("damaged log", file=path.name))
    for dropout in log.dropouts[:1]:
        numbers = {"count": len(log.dropouts), "longest": max(dropout.duration for dropout in log.dropouts) / 1000.0}
        content.findings.append(Finding("dropouts", file=path.name, numbers=numbers))
    return content


def _topic(data: object) -> Topic:
    """Return a topic; the name of every instance but the first ends with its number."""
    name, instance, fields = data.name, data.multi_id, data.data  # type: ignore[attr-defined]
    stamp = fields["timestamp"].astype(float)
    if "timestamp_sample" in fields:
        stamp = np.where(fields["timestamp_sample"] > 0, fields["timestamp_sample"].astype(float), stamp)
    names = [key for key in fields if not key.startswith("timestamp")]
    time, *columns = ascending(stamp * 1e-6, *(fields[key].astype(float) for key in names))
    return Topic(f"{name}_{instance}" if instance else name, name, time, dict(zip(names, columns, strict=True)))


def _commands(path: Path, topics: Sequence[Topic], wanted: Wanted) -> Commands | None:
    """Return the commands of the thrusters, from the instance whose outputs change most, of the first kind of outputs
    that the log has."""
    for kind, array in _OUTPUTS.items():
        outputs = [
            (topic.time, np.array([values for name, values in topic.fields.items() if name.startswith(f"{array}[")]))
            for topic in topics
            if topic.kind == kind
        ]
        if outputs:
            time, values = max(outputs, key=lambda pair: float(np.ptp(np.nan_to_num(pair[1]), axis=1).sum()))
            used = len(wanted.thrusters) or int(np.isfinite(values).any(axis=1).sum())
            named = wanted.named(fraction(str(path), kind, values[:used]))
            return together({name: (time, output) for name, output in named.items()})
    return None


def _signals(topics: Sequence[Topic]) -> Iterator[Signal]:
    """Yield the signals of the first instance of each topic."""
    found: dict[str, Topic] = {}
    for topic in topics:
        found.setdefault(topic.kind, topic)
    attitude: tuple[Array, Array] | None = None
    for kind in _MOTION:
        if kind not in found:
            continue
        topic = found[kind]
        time, fields = topic.time, topic.fields
        if (quaternion := topic.columns(*(f"q[{n}]" for n in range(4)))) is not None:
            R = rotations(quaternion)
            attitude = attitude or (time, R)
            yield from attitude_signals(time, R)
        if kind == "vehicle_local_position":
            yield from _local_position(topic, attitude)
        elif kind == "vehicle_odometry":
            yield from _odometry(topic, attitude)
        elif kind == "vehicle_angular_velocity":
            yield from velocity_signals(time, None, topic.columns("xyz[0]", "xyz[1]", "xyz[2]"))
        elif kind == "battery_status" and "voltage_v" in fields:
            yield Signal(None, "voltage", time, np.where(fields["voltage_v"] > 0.0, fields["voltage_v"], np.nan))


def _local_position(topic: Topic, attitude: tuple[Array, Array] | None) -> Iterator[Signal]:
    """Yield depth and velocities where the filter says that it knows them."""

    def known(names: Sequence[str], flags: Sequence[str]) -> Array | None:
        values = topic.columns(*names)
        for column, flag in enumerate(flags if values is not None else ()):
            assert values is not None
            values[topic.fields.get(flag, np.ones(len(values))) == 0.0, column] = np.nan
        return values

    if (position := known("xyz", ("xy_valid", "xy_valid", "z_valid"))) is not None:
        yield from position_signals(topic.time, position)
    velocity = known(("vx", "vy", "vz"), ("v_xy_valid", "v_xy_valid", "v_z_valid"))
    if velocity is not None and attitude:
        yield from velocity_signals(topic.time, to_body(topic.time, velocity, *attitude), None)


def _odometry(topic: Topic, attitude: tuple[Array, Array] | None) -> Iterator[Signal]:
    """Yield depth and velocities; velocities in another frame than earth or body are left out."""
    position, linear, angular = (
        topic.columns(*(f"{name}[{n}]" for n in range(3))) for name in ("position", "velocity", "angular_velocity")
    )
    if position is not None:
        yield from position_signals(topic.time, position)
    frame = topic.fields.get("velocity_frame", np.full(len(topic.time), _NED))
    if linear is not None and attitude:
        turned = to_body(topic.time, linear, *attitude)
        linear = np.where((frame == _BODY)[:, None], linear, np.where((frame == _NED)[:, None], turned, np.nan))
        yield from velocity_signals(topic.time, linear, None)
    yield from velocity_signals(topic.time, None, angular)
