"""Read bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap) with rosbags, and MCAP files of JSON messages, such as BlueOS's.

The catalogue says which types of messages are read and what they measure. Frames are those of REP 103 (forward, left,
up in east, north, up), unless the name of the frame says otherwise. The vehicle is the first part of a topic's name,
its namespace.
"""

import json
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from itertools import islice
from math import nan
from pathlib import Path
from shutil import copyfileobj
from typing import Any

import numpy as np

from rov_fmu.tank.catalogue import is_known
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.content import Content, Messages, content_of, described, topic_of
from rov_fmu.tank.readers.mavlink import Message, read_messages

_LONGEST = 32
"""Longer arrays in messages are covariances, images or clouds, and are not read."""
_FIRST = 100
"""The number of messages of an unknown topic whose ranges are told."""
_RC_OUT = "std_msgs/Header header\nuint8 rssi\nuint16[] channels\n"
"""The definition of mavros_msgs/RCOut, for bags without definitions."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""The first bytes of what zstd compressed. A message of ROS 2 begins with 0."""
_MAVLINK_TOPIC = re.compile(r"mavlink/(\d+)/(\d+)/(\w+)")
"""The topics of BlueOS: system, component and kind of the message."""


def read_bag(path: Path, named: Collection[str]) -> Content:
    """Read the messages that the catalogue knows, and those of the topics in `named`."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(_RC_OUT, "mavros_msgs/msg/RCOut"))
    sources: dict[str, Source] = {}
    messages: Messages = {}
    damaged = 0
    with AnyReader([path], default_typestore=store) as reader:
        read = [c for c in reader.connections if c.topic in named or is_known(c.msgtype)]
        others = {c.topic: c for c in reader.connections if c not in read}
        counts = {topic: connection.msgcount for topic, connection in others.items()}
        unread = described((_first_messages(reader, connection) for connection in others.values()), counts)
        for connection, arrival, raw in reader.messages(read) if read else ():
            try:
                message: Any = reader.deserialize(_unpacked(raw), connection.msgtype)
            except Exception:  # a damaged message, or one of an unknown type
                damaged += 1
                continue
            topic, header = connection.topic, getattr(message, "header", None)
            stamp = header.stamp.sec + header.stamp.nanosec * 1e-9 if header else 0.0
            if topic not in sources:
                frames = _frames(message, connection.msgtype)
                namespace, _, _ = topic.strip("/").rpartition("/")[0].partition("/")
                sources[topic] = Source(topic, connection.msgtype, namespace, frames=frames)
            numbers = dict(_numbers("", message))
            messages.setdefault(sources[topic], []).append((stamp or nan, arrival * 1e-9, numbers))
    content = content_of(path.name, messages, damaged=damaged)
    content.unread = unread
    return content


def _unpacked(raw: bytes) -> bytes:
    """Return a message, which a bag may have compressed on its own. Raises ZstdError for a damaged one."""
    if not raw.startswith(ZSTD):
        return raw
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(raw)


def unpack(path: Path, to: Path) -> None:
    """Write the file that zstd compressed, such as a bag of ROS 2 with `--compression-mode file`. Raises ZstdError."""
    import zstandard

    with path.open("rb") as packed, to.open("wb") as file:
        copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True), file)


def _frames(message: Any, kind: str) -> tuple[str, str]:
    """Return the frames of the pose and of the twist in a message.

    A child frame is that of the body: of the rotation of a pose, and of the twist in odometry. Otherwise, the frame in
    the header is that in which the numbers are given, or, in a message of an IMU or a wrench, the body's.
    """
    header = getattr(message, "header", None)
    frame, child = (header.frame_id if header else ""), getattr(message, "child_frame_id", "")
    return ("", frame) if re.search("Imu|Twist|Wrench", kind) else (frame, child)


def _numbers(place: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their paths, except those of the header and of the layout of an array."""
    if isinstance(value, bool | int | float | np.number):
        yield place, float(value)
    elif isinstance(value, np.ndarray | list | tuple):
        if len(value) <= _LONGEST:
            for n, one in enumerate(value):
                yield from _numbers(f"{place}[{n}]", one)
    else:
        fields = value if isinstance(value, Mapping) else getattr(value, "__dict__", {})
        for name, inner in fields.items():
            if name not in ("header", "layout"):
                yield from _numbers(f"{place}.{name}" if place else name, inner)


def _first_messages(reader: Any, connection: Any) -> Topic:
    """Return the first messages of a topic, as far as they can be read."""
    rows: list[Mapping[str, float]] = []
    with suppress(Exception):  # a message that is damaged, or of an unknown type
        for _, _, raw in islice(reader.messages([connection]), _FIRST):
            rows.append(dict(_numbers("", reader.deserialize(_unpacked(raw), connection.msgtype))))
    return topic_of(Source(connection.topic, connection.msgtype), np.arange(float(len(rows))), rows)


# ---- MCAP with JSON --------------------------------------------------------------------------------------------------


def read_mcap(path: Path, named: Collection[str]) -> Content:
    """Read an MCAP file: a bag of ROS, or messages in JSON.

    Those of BlueOS are MAVLink messages, with the sender in the name of the topic.
    """
    from mcap.reader import make_reader

    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        if summary and any(channel.message_encoding == "json" for channel in summary.channels.values()):
            messages = (_of_json(channel.topic, raw) for _, channel, raw in reader.iter_messages())
            return read_messages(path, messages, named)
    return read_bag(path, named)


def _of_json(topic: str, raw: Any) -> Message | None:
    """Return a message in JSON, or None if it is damaged."""
    match = _MAVLINK_TOPIC.fullmatch(topic)
    system, component, kind = match.groups() if match else ("", "", topic)
    try:
        document = json.loads(raw.data)
        body = document["message"] if match else document
        parameter = _text(body["param_id"]) if kind == "PARAM_VALUE" else ""
        source = Source(topic, kind, system, component and f"component {component}")
        return Message(source, raw.log_time * 1e-9, dict(_numbers("", body)), parameter)
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _text(value: Any) -> str:
    """Return a text that JSON may give as a list of characters or codes."""
    return "".join(chr(c) if isinstance(c, int) else str(c) for c in value).rstrip("\0")
