"""The messages in the files of recorders: bags of ROS 1 (.bag) and ROS 2 (.db3), and MCAP.

A recorder that loses its power leaves a file that ends amid a message or a chunk: what is before it is read.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from io import BytesIO
from os import SEEK_CUR
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import BinaryIO

ZSTD = b"\x28\xb5\x2f\xfd"
"""The first bytes of what zstd compressed. A message of ROS 2 begins with 0."""
WAL = "-wal"
"""What SQLite appends to the name of a database for that of the file with the latest changes."""


@dataclass(frozen=True)
class Stream:
    """The messages of one type in a topic."""

    topic: str
    kind: str
    """The type of the messages."""
    encoding: str
    """How a message is written: `cdr`, `ros1`, `json` or `protobuf`. Others are not read."""
    language: str = ""
    """The language of the definition: `ros1msg`, `ros2msg`, `ros2idl` or `protobuf`; empty without a definition."""
    definition: bytes = b""


@dataclass
class Damage:
    """What a file has lost."""

    is_cut: bool = False
    """True if the file ends before its end mark, or is damaged from some place on."""


Raw = tuple[Stream, int, bytes]
"""A message: its stream, when it was recorded, ns, and its bytes."""


def mcap_messages(path: Path, damage: Damage) -> Iterator[Raw]:
    """Yield the messages of an MCAP file in their order in the file, up to a damage."""
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import StreamReader

    schemas, streams = dict[int, Schema](), dict[int, Stream]()
    with path.open("rb") as file:
        records = StreamReader(file, validate_crcs=True, record_size_limit=path.stat().st_size).records
        while True:
            try:
                record = next(records, None)
            except MemoryError:
                raise
            except Exception:  # the library and its decompressors raise many kinds
                damage.is_cut = True
                return
            if record is None:
                return
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                schema = schemas.get(record.schema_id)
                kind, language, definition = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
                streams[record.id] = Stream(record.topic, kind, record.message_encoding, language, definition)
            elif isinstance(record, Message) and record.channel_id in streams:
                yield streams[record.channel_id], record.log_time, record.data


def bag_messages(path: Path, damage: Damage) -> Iterator[Raw]:
    """Yield the messages of a bag of ROS 1 in their order in the file, up to a damage. It needs no index."""
    from rosbags.rosbag1.reader import Header, RecordType, decompressors, read_bytes, read_uint32

    streams: dict[int, Stream] = {}

    def records(file: BinaryIO) -> Iterator[Raw]:
        while file.read(1):
            file.seek(-1, SEEK_CUR)
            head = Header.read(file)
            kind = head.get_uint8("op")
            if kind == RecordType.CONNECTION:
                more = Header.read(file)
                own = more.get_string("type"), "ros1", "ros1msg", more["message_definition"]
                streams[head.get_uint32("conn")] = Stream(head.get_string("topic"), *own)
                continue
            data = read_bytes(file, read_uint32(file))
            if kind == RecordType.CHUNK:
                yield from records(BytesIO(decompressors[head.get_string("compression")](data)))
            elif kind == RecordType.MSGDATA:
                yield streams[head.get_uint32("conn")], head.get_time("time"), data
            elif kind == RecordType.BAGHEADER:
                damage.is_cut = not head.get_uint64("index_pos")

    with path.open("rb") as file:
        file.readline()
        try:
            yield from records(file)
        except MemoryError:
            raise
        except Exception:  # the library and its decompressors raise many kinds
            damage.is_cut = True


def database_messages(path: Path, damage: Damage) -> Iterator[Raw]:
    """Yield the messages of the database of a bag of ROS 2 in their order in the file, with those that SQLite has not
    yet moved from its file of latest changes to it. Raises sqlite3.Error if it has no topics."""
    changes = path.with_name(path.name + WAL)
    with TemporaryDirectory() as folder:
        copy, options = Path(folder) / "bag", "immutable=1"
        if changes.is_file():  # they would be moved in the user's folder
            copyfile(changes, copy.with_name(copy.name + WAL))
            copyfile(path, copy)
            path, options = copy, "mode=rw"
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?{options}", uri=True)) as base:
            base.text_factory = lambda text: text.decode(errors="replace")
            base.execute("PRAGMA writable_schema=ON")  # so that a file that was cut is opened
            definitions: dict[str, tuple[str, bytes]] = {}
            with suppress(sqlite3.OperationalError):  # bags before ROS 2 Iron have none
                rows = base.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
                definitions = {kind: (language, f"{text}".encode()) for kind, language, text in rows}
            topics = base.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            streams = {key: Stream(name, kind, form, *definitions.get(kind, ())) for key, name, kind, form in topics}
            try:
                for topic, time, data in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
                    if topic in streams:
                        yield streams[topic], time, data
            except sqlite3.DatabaseError:
                damage.is_cut = True
