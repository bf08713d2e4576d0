"""Read logs of ArduSub with pymavlink: telemetry of a ground station (.tlog), and DataFlash logs of the vehicle, as it
writes them (.bin) and as ground stations convert them to text (.log).

The catalogue says which messages are read and what they measure. The autopilot's filter marks velocities that it does
not know (EKF_STATUS_REPORT, XKF4), and XKF4.PI names the core of the filter that the autopilot used.
"""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.tank.arrays import Flags
from rov_fmu.tank.catalogue import is_known_kind
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.clocks import held
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.content import Content, Messages, content_of

_WRAP = 2.0**32 * 1e-6
"""The time after which the clock of SERVO_OUTPUT_RAW restarts at 0, s."""
_PER_PORT = 16
"""The outputs that SERVO_OUTPUT_RAW has for each port."""
_STATUS = {"EKF_STATUS_REPORT", "XKF4", "NKF4"}
"""The messages about the state of the filter."""
_VELOCITY_KNOWN, _CONSTANT_POSITION = 2, 128
"""Flags of the filter: it knows the horizontal velocity; it assumes that the vehicle does not move."""
_INSTANCES = {"C": "core", "I": "instance", "Inst": "instance", "Instance": "instance"}
"""The fields of a DataFlash message with the number of the filter's core, or of the sensor or battery."""
_FLAGS = ("flags", "flags.bits", "SS")
"""The fields with these flags, in a .tlog, in JSON and in a DataFlash log."""
_HORIZONTAL = {"vx", "vy", "VN", "VE", "x", "y", "PN", "PE"}
"""The fields that are unknown where the filter does not know the horizontal velocity: it then holds the position."""


@dataclass
class MavlinkMessage:
    """A message of MAVLink, from a .tlog or in JSON, or of a DataFlash log."""

    source: Source
    arrival: float
    """When it was logged, s."""
    numbers: Mapping[str, float]
    parameter: str = ""
    """The name of the parameter that it tells."""
    stamp: float = nan
    """The time that its header states, s; NaN for a message of MAVLink, whose numbers may have it."""


def read_telemetry(path: Path, named: Collection[str]) -> Content:
    """Read the messages in a log of a ground station that the catalogue knows, and those that `named` has."""
    return read_messages(path, _telemetry(path), named)


def _is_read(named: Collection[str], *names: str) -> bool:
    """Return True for a kind or a topic that the catalogue or rov.toml knows."""
    return any(is_known_kind(name) or name in _STATUS or name in named for name in names)


def read_messages(path: Path, messages: Iterable[MavlinkMessage | None], named: Collection[str]) -> Content:
    """Return the content of a log of messages; None stands for a damaged one.

    Those of MAVLink have times since the vehicle was booted, or none.
    """
    rows: Messages = {}
    parameters: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    others, damaged = Counter[str](), 0
    boots: dict[str, float] = {}
    for message in messages:
        if message is None:
            damaged += 1
            continue
        source, arrival, numbers = message.source, message.arrival, message.numbers
        if message.parameter:
            value = numbers.get("param_value", numbers.get("Value", nan))
            parameters[message.parameter].append((arrival, value))
        elif not _is_read(named, source.kind, source.topic):
            others[source.topic] += 1
        else:
            boot = numbers.get("time_boot_ms", numbers.get("TimeUS", nan) * 1e-3) * 1e-3
            stamp = message.stamp if isfinite(message.stamp) else boot
            if isfinite(boot):
                boots[source.vehicle] = boot - arrival
            elif source.kind == "SERVO_OUTPUT_RAW":
                stamp = numbers.get("time_usec", nan) * 1e-6
                if isfinite(stamp) and source.vehicle in boots:
                    stamp += _WRAP * round((boots[source.vehicle] + arrival - stamp) / _WRAP)
            source, numbers = _of_port(source, numbers)
            rows.setdefault(source, []).append((stamp, arrival, numbers))
    rows = dict(sorted(rows.items(), key=lambda row: row[0].part))  # the first instance is the main
    content = content_of(path.name, rows, parameters)
    content.count("damaged pieces", damaged)
    content.unread = {topic: f"{count} messages" for topic, count in others.items()}
    for piece in content.pieces:
        piece.topics = _of_primary_core([*_with_known_velocities(piece.topics, content)])
    return content


def _of_port(source: Source, numbers: Mapping[str, float]) -> tuple[Source, Mapping[str, float]]:
    """Return outputs with their numbers among those of all ports, and a topic for each port but the first."""
    port = int(numbers.get("port", 0.0)) if source.kind == "SERVO_OUTPUT_RAW" else 0
    if not port:
        return source, numbers
    servos = {f"servo{n}_raw": f"servo{n + _PER_PORT * port}_raw" for n in range(1, _PER_PORT + 1)}
    moved = {servos[name]: value for name, value in numbers.items() if name in servos}
    return replace(source, topic=f"{source.topic}_{port}"), moved


def _numbers(message: Any) -> Mapping[str, float]:
    values = {name: getattr(message, name, nan) for name in message.get_fieldnames()}
    return {name: float(value) if isinstance(value, int | float) else nan for name, value in values.items()}


def read_dataflash(path: Path, named: Collection[str]) -> Content:
    """Read the messages in a log of the vehicle that the catalogue knows, and those that `named` has."""
    from pymavlink.DFReader import DFReader_binary

    class Reader(DFReader_binary):  # type: ignore[misc]
        init_clock = DFReader_binary.init_clock_usec  # since boot, without a search for the time of a GPS
        init_arrays_fast = DFReader_binary.init_arrays  # the output of the compiled one cannot be redirected

    with closing(Reader(str(path))) as reader:
        counts = {name: reader.counts[kind] for kind, name in reader.id_to_name.items() if reader.counts[kind]}
        return _of_dataflash(path, reader, counts, named)


def read_dataflash_text(path: Path, named: Collection[str]) -> Content:
    """Read the same messages in a log that was converted to text."""
    from pymavlink.DFReader import DFReader_text

    class Reader(DFReader_text):  # type: ignore[misc]
        init_clock = DFReader_text.init_clock_usec  # since boot, as in the log of the vehicle

    reader = Reader(str(path))
    with closing(reader.filehandle):
        return _of_dataflash(path, reader, reader.counts, named)


def _of_dataflash(path: Path, reader: Any, counts: Mapping[str, int], named: Collection[str]) -> Content:
    """Return the content of a log of the vehicle; `counts` has the number of messages of each kind."""
    wanted = ["PARM", *(name for name in counts if _is_read(named, name))]
    content = read_messages(path, _messages(reader, wanted), named)
    content.unread = {name: f"{count} messages" for name, count in counts.items() if name not in (*wanted, "FMT")}
    return content


def _messages(reader: Any, wanted: Collection[str]) -> Iterator[MavlinkMessage | None]:
    """Yield the messages of some kinds in a log of the vehicle. One without a time is damaged."""
    while message := reader.recv_match(type=wanted):
        try:
            kind, numbers = message.get_type(), _numbers(message)
        except ValueError:  # a text that is no number
            yield None
            continue
        part = next((f"{word} {numbers[key]:g}" for key, word in _INSTANCES.items() if key in numbers), "")
        arrival = numbers.get("TimeUS", nan) * 1e-6
        parameter = str(message.Name) if kind == "PARM" else ""
        yield MavlinkMessage(Source(kind, kind, part=part), arrival, numbers, parameter) if isfinite(arrival) else None


def _telemetry(path: Path) -> Iterator[MavlinkMessage | None]:
    """Yield the messages in a log of a ground station."""
    from pymavlink import mavutil

    with closing(mavutil.mavlogfile(str(path))) as log:
        while message := log.recv_msg():
            kind = message.get_type()
            source = Source(kind, kind, str(message.get_srcSystem()), f"component {message.get_srcComponent()}")
            parameter = str(message.param_id) if kind == "PARAM_VALUE" else ""
            is_damaged = kind == "BAD_DATA"
            yield (
                None if is_damaged else MavlinkMessage(source, float(message._timestamp), _numbers(message), parameter)
            )


# ---- The filter ------------------------------------------------------------------------------------------------------


def _while_valid(topic: Topic, state: Topic, is_valid: Flags, names: Collection[str]) -> Topic:
    """Return a topic with NaN for some fields at the times when the state of the filter makes them invalid."""
    now = held(state.time, is_valid, topic.time)
    masked = {name: np.where(now, topic.fields[name], nan) for name in names}
    return replace(topic, fields={**topic.fields, **masked})


def _with_known_velocities(topics: Sequence[Topic], content: Content) -> Iterator[Topic]:
    """Make the horizontal velocities NaN at the times when the filter said that it does not know them."""
    states = {replace(t.source, topic=""): t for t in topics if t.source.kind in _STATUS}
    unknown = 0
    for topic in topics:
        kind = f"{topic.source.kind[:-1]}4" if topic.source.kind.endswith("KF1") else "EKF_STATUS_REPORT"
        state = states.get(replace(topic.source, topic="", kind=kind))
        flags = [state.fields[name] for name in _FLAGS if name in state.fields] if state else []
        names = _HORIZONTAL & topic.fields.keys()
        if not state or not flags or not names:
            yield topic
            continue
        numbers = np.nan_to_num(flags[0]).astype(int)
        is_known = numbers & (_VELOCITY_KNOWN | _CONSTANT_POSITION) == _VELOCITY_KNOWN
        unknown += int((~held(state.time, is_known, topic.time)).sum())
        yield _while_valid(topic, state, is_known, names)
    content.count("unknown velocity", unknown)


def _of_primary_core(topics: list[Topic]) -> list[Topic]:
    """Return the topics, with the cores of the filter replaced by the one that the autopilot used at each time."""
    states = {topic.source.kind: topic for topic in reversed(topics) if "PI" in topic.fields}
    found = [topic for topic in topics if topic.source.kind not in _STATUS]
    for kind, state in states.items():
        cores = [topic for topic in found if topic.source.kind == kind.replace("KF4", "KF1")]
        if len(cores) > 1:
            found = [topic for topic in found if topic not in cores]
            found += _primary(state, {topic.source.part.removeprefix("core "): topic for topic in cores})
    return found


def _primary(state: Topic, cores: Mapping[str, Topic]) -> Iterator[Topic]:
    """Yield the core that was the primary one at each time, and the single cores, which are not used then."""
    primary = state.fields["PI"]
    used = [core for core in cores if float(core) in primary]
    if not used:
        yield from cores.values()
        return
    words, first = " and ".join(used), cores[used[0]]
    valid = [_while_valid(topic, state, primary == float(core), topic.fields) for core, topic in cores.items()]
    columns = {name: np.concatenate([topic.fields[name] for topic in valid]) for name in first.fields}
    source = replace(first.source, part=f"core {words}, the primary one")
    yield Topic.of_messages(source, np.concatenate([topic.time for topic in valid]), columns)
    others = (topic for core, topic in cores.items() if [core] != used)
    yield from (replace(topic, unused=f"the autopilot used core {words}") for topic in others)
