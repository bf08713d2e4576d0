"""The messages in the files of recorders: bags of ROS 1 (.bag) and ROS 2 (.db3), and MCAP.

A recorder that loses its power leaves a file without an index, which ends amid a message or with zeros. Therefore a
file is read from its beginning to its end, and an index only tells where the next piece begins after a damaged one.
"""

import sqlite3
import struct
from bisect import bisect_right
from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import IO, Any
from zlib import crc32

from rov_fmu.io.messages import RovError

ZSTD = b"\x28\xb5\x2f\xfd"
"""The first bytes of what zstd compressed. A message of ROS 2 begins with 0."""
WAL = "-wal"
"""What SQLite appends to the name of a database for that of the file with the latest changes."""
_SLICE = 1 << 16
"""The number of bytes that are decompressed at once, so that what is before a damage is not lost."""
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END, _PRIVATE = 3, 4, 5, 6, 15, 128
"""Opcodes of MCAP. Those from the last one on are for the records of others; 0 is none."""
_CHUNK_HEAD = struct.Struct("<QQQII")
"""The head of a chunk: first and last time, size and checksum of its records, length of the compression's name."""
_BAG_BEGIN = len("#ROSBAG V2.0\n")
_BAG_MESSAGE, _BAG_CHUNK, _BAG_CHUNK_INFO, _BAG_CONNECTION = 2, 5, 6, 7
"""Kinds of records in a bag of ROS 1."""


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

    pieces: int = 0
    """The number of damaged pieces amid the others."""
    is_cut: bool = False
    """True if the file ends before its end mark."""


Raw = tuple[Stream, int, bytes]
"""A message: its stream, when it was recorded, ns, and its bytes."""


class _DamagedError(RovError):
    """There is no whole record where one is expected."""


def _end_of(file: IO[bytes]) -> int:
    """Return where the bytes of a file end that are not zeros, which a disk may have kept free for it."""
    end = file.seek(0, 2)
    while end > 0:
        begin = max(end - _SLICE, 0)
        file.seek(begin)
        if content := file.read(end - begin).rstrip(b"\0"):
            return begin + len(content)
        end = begin
    return 0


def _walk(
    file: IO[bytes], begin: int, records: Callable[[], Iterator[Raw]], starts: list[int], damage: Damage
) -> Iterator[Raw]:
    """Yield the messages of the records from an offset on. After a damaged one, go on at the next of the pieces whose
    starts an index tells."""
    known = sorted(starts)
    file.seek(begin)
    while True:
        try:
            yield from records()
            return
        except _DamagedError:
            after = bisect_right(known, file.tell())
            if after == len(known):
                damage.is_cut = True
                return
            damage.pieces += 1
            file.seek(known[after])


def _decompressed(content: bytes, compression: str) -> bytes:
    """Return what was compressed, as far as it is whole. Raises _DamagedError for an unknown compression."""
    import zstandard
    from lz4.frame import LZ4FrameDecompressor

    if compression in ("", "none"):
        return content
    makers = {"zstd": zstandard.ZstdDecompressor().decompressobj, "lz4": LZ4FrameDecompressor, "bz2": BZ2Decompressor}
    if compression not in makers:
        raise _DamagedError
    decompressor, found = makers[compression](), bytearray()
    try:
        for begin in range(0, len(content), _SLICE):
            found += decompressor.decompress(content[begin : begin + _SLICE])
    except MemoryError:
        raise
    except Exception as error:
        if "memory" in str(error) or "allocation" in str(error):
            raise MemoryError from error
    return bytes(found)


# ---- MCAP ------------------------------------------------------------------------------------------------------------


def mcap_messages(path: Path, damage: Damage) -> Iterator[Raw]:
    """Yield the messages of an MCAP file in their order in the file."""
    from mcap.reader import SeekingReader

    with path.open("rb") as file:
        summary: Any = None
        with suppress(Exception):  # a file without a summary
            summary = SeekingReader(file).get_summary()
        mcap = _Mcap(damage)
        if summary:
            mcap.schemas |= summary.schemas
            for channel in summary.channels.values():
                mcap.add_channel(channel)
        end = _end_of(file)
        starts = [chunk.chunk_start_offset for chunk in summary.chunk_indexes] if summary else []
        yield from _walk(file, len(_MCAP_MAGIC), lambda: mcap.messages(file, end), starts, damage)


class _Mcap:
    """The schemas and channels that an MCAP file has declared so far."""

    def __init__(self, damage: Damage) -> None:
        self.damage = damage
        self.schemas: dict[int, Any] = {}
        self.streams: dict[int, Stream] = {}

    def add_channel(self, channel: Any) -> None:
        """Add a channel, whose schema is known already if it has one."""
        schema = self.schemas.get(channel.schema_id)
        kind, language, definition = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
        self.streams[channel.id] = Stream(channel.topic, kind, channel.message_encoding, language, definition)

    def messages(self, file: IO[bytes], end: int, *, is_chunk: bool = False, is_trusted: bool = True) -> Iterator[Raw]:
        """Yield the messages in the records from the offset of the file on. Raises _DamagedError.

        `is_trusted` is False in a damaged chunk, of which only the schemas and channels are used.
        """
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Schema

        while not is_chunk or file.tell() < end:
            begin, head = file.tell(), file.read(9)
            opcode, length = struct.unpack("<BQ", head) if len(head) == 9 else (0, 0)
            if opcode == _DATA_END:
                return
            if not (0 < opcode < _DATA_END or opcode >= _PRIVATE):
                raise _DamagedError
            left = end - file.tell()
            after = file.tell() + min(length, left)
            content = file.read(min(length, left)) if opcode in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK) else b""
            file.seek(after)
            if opcode == _CHUNK and not is_chunk:
                yield from self._of_chunk(content, is_whole=length <= left)
            if length > left:
                file.seek(begin)
                raise _DamagedError
            if opcode == _MESSAGE and is_trusted:
                channel, _, log_time, _ = struct.unpack_from("<HIQQ", content.ljust(22, b"\0"))
                if channel in self.streams:
                    yield self.streams[channel], log_time, content[22:]
                else:
                    self.damage.pieces += 1
            with suppress(Exception):  # a damaged one
                if opcode == _SCHEMA:
                    schema = Schema.read(ReadDataStream(BytesIO(content)))
                    self.schemas[schema.id] = schema
                elif opcode == _CHANNEL:
                    self.add_channel(Channel.read(ReadDataStream(BytesIO(content))))

    def _of_chunk(self, content: bytes, *, is_whole: bool) -> Iterator[Raw]:
        """Yield the messages of a chunk, of which the end may be missing."""
        if len(content) < _CHUNK_HEAD.size:
            return
        _, _, size, checksum, length = _CHUNK_HEAD.unpack_from(content)
        name, packed = content[_CHUNK_HEAD.size :][:length], content[_CHUNK_HEAD.size + length + 8 :]
        try:
            records = _decompressed(packed, name.decode(errors="replace"))
            is_sound = len(records) == size and checksum in (0, crc32(records))
            is_trusted = is_sound or not (is_whole and checksum)
            yield from self.messages(BytesIO(records), len(records), is_chunk=True, is_trusted=is_trusted)
            self.damage.pieces += is_whole and not is_sound
        except _DamagedError:
            self.damage.pieces += is_whole


# ---- Bags of ROS 1 ---------------------------------------------------------------------------------------------------


def bag_messages(path: Path, damage: Damage) -> Iterator[Raw]:
    """Yield the messages of a bag of ROS 1 in their order in the file."""
    with path.open("rb") as file:
        bag = _Bag(damage)
        end = file.seek(0, 2)
        file.seek(_BAG_BEGIN)
        fields, _ = bag.record(file, end)
        index = int.from_bytes(fields.get(b"index_pos", b""), "little")
        starts: list[int] = []
        if 0 < index <= end:
            file.seek(index)
            with suppress(Exception):  # an index that is damaged, too
                starts = bag.read_index(file, end)
        else:
            damage.is_cut, end = True, _end_of(file)
        yield from _walk(file, _BAG_BEGIN, lambda: bag.messages(file, end), starts, damage)


class _Bag:
    """The connections that a bag of ROS 1 has declared so far."""

    def __init__(self, damage: Damage) -> None:
        self.damage = damage
        self.streams: dict[bytes, Stream] = {}

    def record(self, file: IO[bytes], end: int) -> tuple[dict[bytes, bytes], int]:
        """Return the fields of the header of the next record, and the length of its data. Raises _DamagedError."""
        length = self._length(file)
        if not 0 < length <= end - file.tell():
            raise _DamagedError
        return _fields(file.read(length)), self._length(file)

    def read_index(self, file: IO[bytes], end: int) -> list[int]:
        """Return where the chunks begin, by the index from the offset of the file on, and add its connections. Raises
        _DamagedError."""
        found = []
        while file.tell() < end:
            fields, length = self.record(file, end)
            data = file.read(length)
            if fields[b"op"][0] == _BAG_CHUNK_INFO:
                found.append(int.from_bytes(fields[b"chunk_pos"], "little"))
            elif fields[b"op"][0] == _BAG_CONNECTION:
                self._add_connection(fields, data)
        return found

    def _add_connection(self, fields: dict[bytes, bytes], data: bytes) -> None:
        """Add a connection by the fields of its header and its data. Raises _DamagedError."""
        own = _fields(data)
        topic, kind = (text.decode(errors="replace") for text in (fields.get(b"topic", b""), own.get(b"type", b"")))
        topic = "/" * topic.startswith("/") + "/".join(filter(None, topic.split("/")))
        definition = own.get(b"message_definition", b"")
        self.streams[fields.get(b"conn", b"")] = Stream(topic, kind, "ros1", "ros1msg", definition)

    def messages(self, file: IO[bytes], end: int) -> Iterator[Raw]:
        """Yield the messages in the records from the offset of the file on. Raises _DamagedError."""
        while (begin := file.tell()) < end:
            fields, length = self.record(file, end)
            kind, left = fields.get(b"op", b"\0")[0], end - file.tell()
            data = file.read(min(length, left)) if kind in (_BAG_MESSAGE, _BAG_CHUNK, _BAG_CONNECTION) else b""
            if kind == _BAG_CHUNK:
                compression = fields.get(b"compression", b"").decode(errors="replace")
                records = _decompressed(data, compression)
                is_sound = len(records) == int.from_bytes(fields.get(b"size", b""), "little")
                try:
                    yield from self.messages(BytesIO(records), len(records))
                except _DamagedError:
                    is_sound = False
                self.damage.pieces += length <= left and not is_sound
            if length > left:
                file.seek(begin)
                raise _DamagedError
            if kind == _BAG_CONNECTION:
                self._add_connection(fields, data)
            elif kind == _BAG_MESSAGE:
                stream, time = self.streams.get(fields.get(b"conn", b"")), fields.get(b"time", b"")
                if stream and len(time) == 8:
                    seconds, nanoseconds = struct.unpack("<II", time)
                    yield stream, seconds * 10**9 + nanoseconds, data
                else:
                    self.damage.pieces += 1
            elif kind != _BAG_CHUNK:
                file.seek(length, 1)

    def _length(self, file: IO[bytes]) -> int:
        content = file.read(4)
        if len(content) < 4:
            raise _DamagedError
        return int.from_bytes(content, "little")


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Return the fields of a header in a bag of ROS 1. Raises _DamagedError."""
    found, offset = {}, 0
    while offset < len(header):
        length = int.from_bytes(header[offset : offset + 4], "little")
        name, is_field, value = header[offset + 4 : offset + 4 + length].partition(b"=")
        if not is_field:
            raise _DamagedError
        found[name] = value
        offset += 4 + length
    return found


# ---- Bags of ROS 2 ---------------------------------------------------------------------------------------------------


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
            yield from _rows(base, damage)


def _rows(base: sqlite3.Connection, damage: Damage) -> Iterator[Raw]:
    """Yield the messages from the first one on, and, where the file is damaged, those from the last one back to it."""
    definitions: dict[str, tuple[str, bytes]] = {}
    with suppress(sqlite3.OperationalError):  # bags before ROS 2 Iron have none
        rows = base.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        definitions = {kind: (language, f"{text}".encode()) for kind, language, text in rows}
    topics = base.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
    streams = {key: Stream(name, kind, form, *definitions.get(kind, ())) for key, name, kind, form in topics}
    last, later = None, []
    query = "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id"
    try:
        for number, topic, time, data in base.execute(query):
            last = number
            if topic in streams:
                yield streams[topic], time, data
    except sqlite3.DatabaseError:
        with suppress(sqlite3.DatabaseError):
            for number, topic, time, data in base.execute(f"{query} DESC"):
                if number == last:
                    break
                if topic in streams:
                    later.append((streams[topic], time, data))
        damage.pieces += bool(later)
        damage.is_cut = not later
        yield from reversed(later)
