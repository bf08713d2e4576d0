"""Read the messages of bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap), and of any MCAP file, such as those of BlueOS and
Blueye: their definitions tell how to decode them.

The catalogue says which types of messages are read and what they measure. Frames are those of REP 103 (forward, left,
up in east, north, up), unless the name of the frame says otherwise. The vehicle is the first part of a topic's name,
its namespace.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from math import nan
from pathlib import Path
from shutil import copyfileobj
from typing import Any

import numpy as np

from rov_fmu.tank.catalogue import is_known_kind
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.content import Content, described_topics, topic_of
from rov_fmu.tank.readers.mavlink import MavlinkMessage, read_messages
from rov_fmu.tank.readers.recordings import (
    ZSTD,
    Damage,
    Raw,
    Stream,
    bag_messages,
    database_messages,
    mcap_messages,
)
from rov_fmu.tank.readers.ulog import fields_of, velocity_frames

_LONGEST = 32
"""Longer arrays in messages are images or clouds, and are not read."""
_COVARIANCE = 6
"""The number of rows and columns of the covariance of a pose or a twist, of which the variances are read."""
_FIRST = 100
"""The number of messages of an unknown topic whose ranges are told."""
_DEFINITIONS = {
    "mavros_msgs/msg/RCOut": "std_msgs/Header header\nuint8 rssi\nuint16[] channels\n",
}
"""The definitions of types beside those of ROS 2, for bags without definitions."""
_IDL = f"{'=' * 80}\nIDL: "
"""What is before each of several definitions in IDL."""
_MAVLINK_TOPIC = re.compile(r"mavlink/(\d+)/(\d+)/(\w+)")
"""The topics of BlueOS: system, component and kind of the message."""
_PX4 = re.compile(r"px4_msgs/(?:msg/)?(\w+)")
"""The types of PX4's topics in ROS 2, whose fields are those of its own logs."""
_SECONDS, _NANOSECONDS = ("sec", "secs", "seconds"), ("nanosec", "nsec", "nsecs", "nanos")
"""The names of the parts of a time stamp."""

Decode = Callable[[bytes], Any]
"""Returns a message as an object or a mapping of its fields. Raises any exception for one that is damaged."""


def _read(messages: Callable[[Path, Damage], Iterator[Raw]], path: Path, named: Collection[str]) -> Content:
    """Read those messages of a recorder's file that the catalogue knows, and those of the topics in `named`."""
    damage, unknown = Damage(), _Unknown()
    content = read_messages(path, _decoded(messages(path, damage), named, unknown), named)
    content.unread |= unknown.described()
    if damage.is_cut and not (content.unread or any(piece.topics for piece in content.pieces)):
        raise ValueError("it has no whole message")
    if damage.is_cut:
        content.add_cut()
    return content


read_bag, read_database, read_mcap = (
    partial(_read, messages) for messages in (bag_messages, database_messages, mcap_messages)
)
"""Read a bag of ROS 1, the database of a bag of ROS 2, or an MCAP file, written by ROS or by others."""


def unpack(path: Path, to: Path) -> None:
    """Write the file that zstd compressed, such as a bag of ROS 2 with `--compression-mode file`. Raises ZstdError."""
    import zstandard

    with path.open("rb") as packed, to.open("wb") as file:
        copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True), file)


class _Unknown:
    """The topics that nobody knows, and their first messages."""

    def __init__(self) -> None:
        self.counts: Counter[Source] = Counter()
        self.rows: dict[Source, list[Mapping[str, float]]] = {}

    def add(self, stream: Stream, decode: Decode | None, raw: bytes) -> None:
        """Add a message. It is listed even if it is damaged, or if there is no decoder."""
        source = Source(stream.topic, stream.kind or stream.encoding)
        self.counts[source] += 1
        if decode and self.counts[source] <= _FIRST:
            with suppress(Exception):
                self.rows.setdefault(source, []).append(dict(_numbers("", decode(raw))))

    def described(self) -> dict[str, str]:
        """Return descriptions of the topics, and of the range of each number in their first messages."""
        rows = {source: self.rows.get(source, []) for source in self.counts}
        topics = [topic_of(source, np.arange(float(len(own))), own) for source, own in rows.items()]
        return described_topics(topics, {source.topic: count for source, count in self.counts.items()})


def _decoded(messages: Iterator[Raw], named: Collection[str], unknown: _Unknown) -> Iterator[MavlinkMessage | None]:
    """Yield the messages that are read, and None for a damaged one."""
    decoders: dict[Stream, Decode | None] = {}
    frames: dict[Stream, tuple[str, str]] = {}
    for stream, time, raw in messages:
        if stream not in decoders:
            decoders[stream] = _decoder(stream)
        decode, match = decoders[stream], _MAVLINK_TOPIC.fullmatch(stream.topic)
        kind = _kind_of(stream)
        is_read = stream.topic in named or is_known_kind(kind)
        if not decode or not (match or is_read):
            unknown.add(stream, decode, raw)
            continue
        try:
            message = decode(raw)
            if match:
                yield _of_mavlink(match, message["message"], time * 1e-9)
                continue
            if stream not in frames:
                frames[stream] = _frames(message, kind)
            namespace, _, _ = stream.topic.strip("/").rpartition("/")[0].partition("/")
            source = Source(stream.topic, kind or stream.topic, namespace, frames=frames[stream])
            numbers = dict(_numbers("", message))
            if kind != stream.kind:
                numbers = fields_of(kind, numbers, frames[stream])
            yield MavlinkMessage(source, time * 1e-9, numbers, stamp=_stamp(message))
        except MemoryError:
            raise
        except Exception:  # a parser may raise anything on damaged bytes
            yield None


# ---- Decoders --------------------------------------------------------------------------------------------------------


def _decoder(stream: Stream) -> Decode | None:
    """Return what decodes the messages of a stream; None for an encoding or a definition that is not known."""
    makers = {"json": lambda _: json.loads, "protobuf": _of_protobuf, "cdr": _of_ros, "ros1": _of_ros}
    try:
        return makers[stream.encoding](stream) if stream.encoding in makers else None
    except (MemoryError, ModuleNotFoundError):
        raise
    except Exception:  # a definition that is damaged
        return None


def _of_protobuf(stream: Stream) -> Decode | None:
    from mcap.records import Schema
    from mcap_protobuf.decoder import DecoderFactory

    schema = Schema(id=1, name=stream.kind, encoding=stream.language, data=stream.definition)
    return DecoderFactory().decoder_for(stream.encoding, schema)


def _of_ros(stream: Stream) -> Decode | None:
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    text = stream.definition.decode()
    store = get_typestore(Stores.EMPTY if text else Stores.ROS2_HUMBLE)
    if not text:
        for kind, definition in _DEFINITIONS.items():
            store.register(get_types_from_msg(definition, kind))
    elif stream.language.endswith("msg"):
        store.register(get_types_from_msg(text, stream.kind))
    else:
        for part in text.split(_IDL):
            store.register(get_types_from_idl(part.partition("\n")[2] if text.startswith(_IDL) else part))
    kind = re.sub(r"^(\w+)/(\w+)$", r"\1/msg/\2", stream.kind)
    if kind not in store.fielddefs:
        return None
    deserialize = store.deserialize_ros1 if stream.encoding == "ros1" else store.deserialize_cdr
    return lambda raw: deserialize(_unpacked(raw), kind)


def _unpacked(raw: bytes) -> bytes:
    """Return a message, which a bag may have compressed on its own. Raises ZstdError for a damaged one."""
    if not raw.startswith(ZSTD):
        return raw
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(raw)


def _of_mavlink(topic: re.Match[str], body: Any, arrival: float) -> MavlinkMessage:
    """Return a message of BlueOS, with the sender in the name of the topic. Raises an exception for a damaged one."""
    system, component, kind = topic.groups()
    parameter = _text(body["param_id"]) if kind == "PARAM_VALUE" else ""
    source = Source(topic[0], kind, system, f"component {component}")
    return MavlinkMessage(source, arrival, dict(_numbers("", body)), parameter)


def _text(value: Any) -> str:
    """Return a text that JSON may give as a list of characters or codes."""
    return "".join(chr(c) if isinstance(c, int) else str(c) for c in value).rstrip("\0")


# ---- The parts of a message ------------------------------------------------------------------------------------------


def _part(message: Any, *names: str) -> Any:
    """Return the first field of a message that has one of these names, or None."""
    found = (message.get(name) if isinstance(message, Mapping) else getattr(message, name, None) for name in names)
    return next((part for part in found if part is not None), None)


def _stamp(message: Any) -> float:
    """Return the time of a message, s, by its header or its field `timestamp`; NaN without one, and for 0."""
    stamp = _part(_part(message, "header"), "stamp") or _part(message, "timestamp")
    seconds, nanoseconds = _part(stamp, *_SECONDS), _part(stamp, *_NANOSECONDS)
    return (seconds + (nanoseconds or 0) * 1e-9 if seconds is not None else 0.0) or nan


def _kind_of(stream: Stream) -> str:
    """Return the type of messages; that of PX4 as its own logs have it, such as vehicle_odometry."""
    match = _PX4.fullmatch(stream.kind)
    return re.sub(r"(?<!^)(?=[A-Z])", "_", match[1]).lower() if match else stream.kind


def _frames(message: Any, kind: str) -> tuple[str, str]:
    """Return the frames of the pose and of the twist in a message.

    A child frame is that of the body: of the rotation of a pose, and of the twist in odometry. Otherwise, the frame in
    the header is that in which the numbers are given, or, in a message of an IMU or a wrench, the body's.
    """
    if (number := _part(message, "velocity_frame")) is not None:
        return velocity_frames(number)
    frame, child = f"{_part(_part(message, 'header'), 'frame_id') or ''}", f"{_part(message, 'child_frame_id') or ''}"
    return ("", frame) if re.search("Imu|Twist|Wrench", kind) else (frame, child)


def _numbers(field: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their paths, except those of the header and of the layout of an array."""
    if isinstance(value, bool | int | float | np.number):
        yield field, float(value)
    elif isinstance(value, np.ndarray | Sequence):
        is_covariance = field.endswith("covariance") and len(value) == _COVARIANCE**2
        if is_covariance or (len(value) <= _LONGEST and not isinstance(value, str | bytes)):
            for n in range(0, len(value), _COVARIANCE + 1 if is_covariance else 1):
                yield from _numbers(f"{field}[{n}]", value[n])
    else:
        for name, inner in _fields(value):
            if name not in ("header", "layout"):
                yield from _numbers(f"{field}.{name}" if field else name, inner)


def _fields(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a structure with their names. A structure of protobuf that was not sent has none."""
    if isinstance(value, Mapping):
        yield from ((f"{name}", inner) for name, inner in value.items())
    elif form := getattr(value, "DESCRIPTOR", None):
        for field in getattr(form, "fields", ()):
            if not field.has_presence or value.HasField(field.name):
                yield field.name, getattr(value, field.name)
    else:
        yield from getattr(value, "__dict__", {}).items()
