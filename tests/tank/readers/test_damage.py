"""Files of recorders that lost their power, and files that are damaged in places: what is whole is read."""

import shutil
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Writer1

from rov_fmu.cli import main
from rov_fmu.io.csv_table import UnreadableFileError
from rov_fmu.io.messages import FileError
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.folder import folder_and_files
from rov_fmu.tank.readers import parsers
from rov_fmu.tank.readers.listing import list_files
from rov_fmu.tank.readers.parsers import guarded, one_parser, read_topics
from tests.often import spread
from tests.tank.logs import Read, measured, read_log
from tests.tank.readers.motion import BLUEROV2, DEPTH, DIVE
from tests.tank.readers.writers import Ros, bag, flash, messages_of


def mcap(compression: CompressionType | None) -> Callable[[Path], Path]:
    """Return a writer of an MCAP file with many chunks, or without any for None."""

    def write(folder: Path) -> Path:
        path = folder / "many.mcap"
        with bag(".mcap")(folder, DIVE).open("rb") as source, path.open("wb") as file:
            chunks = {"chunk_size": 20_000, "compression": compression} if compression else {"use_chunking": False}
            writer = Writer(file, **chunks)
            writer.start(profile="ros2", library="test")
            numbers: dict[str, int] = {}
            for schema, channel, message in make_reader(source).iter_messages():
                if schema and channel.topic not in numbers:
                    known = writer.register_schema(schema.name, schema.encoding, schema.data)
                    numbers[channel.topic] = writer.register_channel(channel.topic, "cdr", known)
                writer.add_message(numbers[channel.topic], message.log_time, message.data, message.publish_time)
            writer.finish()  # type: ignore[no-untyped-call]
        return path

    return write


def bag_of_chunks(*compression: Writer1.CompressionFormat) -> Callable[[Path], Path]:
    """Return a writer of a bag of ROS 1 with many chunks."""

    def write(folder: Path) -> Path:
        ros = Ros(1)
        with pytest.MonkeyPatch.context() as patch:
            init = Writer1.__init__

            def small(writer: Writer1, path: Path) -> None:
                init(writer, path)
                writer.chunk_threshold = 20_000

            patch.setattr(Writer1, "__init__", small)
            return ros.write(folder, messages_of(ros, DIVE), ".bag", *compression)

    return write


def database(folder: Path) -> Path:
    return bag(".db3")(folder, DIVE)


RECORDED = {
    "MCAP": mcap(CompressionType.NONE),
    "MCAP with zstd": mcap(CompressionType.ZSTD),
    "MCAP with lz4": mcap(CompressionType.LZ4),
    "MCAP without chunks": mcap(None),
    "MCAP of one chunk": lambda folder: bag(".mcap")(folder, DIVE),
    "ROS 1": bag_of_chunks(),
    "ROS 1 with lz4": bag_of_chunks(Writer1.CompressionFormat.LZ4),
    "ROS 1 with bz2": bag_of_chunks(Writer1.CompressionFormat.BZ2),
    "ROS 2": database,
}
"""A writer of each kind of file that a recorder leaves."""
CUT = "ends amid its messages, as after a loss of power. The "


def _depths(log: Read) -> int:
    """Return the number of depths that were read, which must all be those of the dive."""
    values = measured(log.log, "depth")
    indices = np.abs(DEPTH - values[:, None]).argmin(axis=1)
    assert (np.diff(indices) > 0).all()
    assert values == pytest.approx(DEPTH[indices], abs=1e-5)
    return len(values)


CUT_FILES = ("MCAP with zstd", "MCAP without chunks", "ROS 1 with lz4", "ROS 2")
"""Those of the default tests: each way of storing messages, and of compressing chunks."""


@pytest.mark.parametrize("name", spread([name for name in RECORDED if "of one" not in name], CUT_FILES, CUT_FILES))
def test_a_file_that_was_cut_is_read_up_to_the_cut(name: str, tmp_path: Path) -> None:
    """Its end is missing, or the disk has zeros there."""
    path = RECORDED[name](tmp_path)
    whole = path.read_bytes()
    share = 0.6
    for end in (b"", bytes(30_000)):
        path.write_bytes(whole[: int(share * len(whole))] + end)
        log = read_log(path, BLUEROV2)
        count = _depths(log)
        assert 30 <= count < 100
        assert any(CUT in line for line in sentences(log.findings))


def test_what_a_parser_prints_of_a_log_is_told_as_damage(tmp_path: Path) -> None:
    path = flash(tmp_path, DIVE)
    content = bytearray(path.read_bytes())
    assert not read_topics(path, []).findings
    middle = len(content) // 2
    content[middle : middle + 40] = b"\xa5" * 40
    path.write_bytes(content)
    assert [(one.kind, one.file) for one in read_topics(path, []).findings] == [("damaged log", path.name)]


@pytest.mark.parametrize("name", ["MCAP with zstd", "MCAP without chunks"])
def test_what_is_behind_a_damage_is_told_as_missing(name: str, tmp_path: Path) -> None:
    """A kB of other bytes stands in the middle of a whole file."""
    path = RECORDED[name](tmp_path)
    whole = bytearray(path.read_bytes())
    middle = len(whole) // 3
    for other in (b"\xff", b"\0"):
        whole[middle : middle + 1000] = other * 1000
        path.write_bytes(whole)
        log = read_log(path, BLUEROV2)
        assert 0 < _depths(log) < 100
        assert any(CUT in line for line in sentences(log.findings))


def test_an_error_of_ours_is_not_told_as_damage(tmp_path: Path) -> None:
    """A parser of somebody else may raise anything, a reader of ours only what damaged bytes lead to."""
    path = tmp_path / "log.ulg"
    path.write_bytes(b"ULog\x01\x12\x35" + bytes(50))
    ours = {"__name__": "ours"}
    exec(compile("def fail(error): raise error", parsers.__file__, "exec"), ours)

    def theirs(error: Exception) -> None:
        raise error

    for fail, error in (
        (theirs, AttributeError("x")),
        (theirs, IndexError("x")),
        (ours["fail"], ValueError("x")),
        (ours["fail"], struct.error("x")),
    ):
        told = pytest.raises(UnreadableFileError, match="begins as a ULog, but is damaged or was cut short")
        with told, parsers._damage_told(path):
            fail(error)  # type: ignore[operator]
    for other in (AttributeError("x"), TypeError("x"), FileError("x")):
        with pytest.raises(type(other), match=r"^x$"), parsers._damage_told(path):
            ours["fail"](other)  # type: ignore[operator]


@guarded
def _defect(_: Path) -> None:
    raise IndexError("tuple index out of range")


def test_a_defect_is_told_as_one_with_its_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "dive.csv").write_text("time [s]\n0\n", encoding="utf-8")
    monkeypatch.setattr(
        "rov_fmu.interface.inspect_command.inspect_tests", lambda *_, **__: _defect(tmp_path / "dive.csv")
    )
    assert main(["inspect", str(tmp_path)]) == 1
    err = capsys.readouterr().err
    assert 'raise IndexError("tuple index out of range")' in err  # in the child process
    assert err.endswith(
        "this is a defect of the program, and not of your files: please report it, with all the lines above\n"
    )


@pytest.mark.long
def test_the_longer_a_file_is_the_more_is_read(tmp_path: Path) -> None:
    for name in ("MCAP with zstd", "ROS 2"):
        folder = tmp_path / name
        folder.mkdir()
        path = RECORDED[name](folder)
        whole = path.read_bytes()
        counts = []
        with one_parser():
            for share in (0.3, 0.5, 0.7, 0.9):
                path.write_bytes(whole[: int(share * len(whole))])
                pieces = read_topics(path, ()).pieces
                counts.append(sum(len(topic.time) for piece in pieces for topic in piece.topics))
        assert counts == sorted(counts)
        assert counts[0] < counts[-1]


def test_changes_that_a_database_has_not_taken_over_are_read(tmp_path: Path) -> None:
    """A recorder that lost its power leaves its last messages in the file of changes, and the folder as it is."""
    path = database(tmp_path)
    folder = tmp_path / "found"
    folder.mkdir()
    with sqlite3.connect(path) as base:
        base.execute("PRAGMA journal_mode=WAL")
        base.execute("PRAGMA wal_autocheckpoint=0")
        times = [time for (time,) in base.execute("SELECT timestamp FROM messages ORDER BY timestamp")]
        half = times[len(times) // 2]
        rows = base.execute("SELECT * FROM messages WHERE timestamp > ?", (half,)).fetchall()
        base.execute("DELETE FROM messages WHERE timestamp > ?", (half,))
        base.commit()
        base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        base.executemany(f"INSERT INTO messages VALUES ({','.join('?' * len(rows[0]))})", rows)
        base.commit()
        for end in ("", "-wal", "-shm"):
            shutil.copy(f"{path}{end}", folder)
    base.close()
    left = folder / path.name
    before = {part.name: part.read_bytes() for part in folder.iterdir()}
    assert _depths(read_log(left, BLUEROV2)) == 100
    assert {part.name: part.read_bytes() for part in folder.iterdir()} == before
    assert (list_files(folder).tests, list_files(folder).others) == ([left], {})


@pytest.mark.parametrize("suffix", [".db3", ".mcap"])
def test_a_bag_without_metadata_is_its_folder(suffix: str, tmp_path: Path) -> None:
    found = bag(suffix)(tmp_path, DIVE)
    path = found.rename(found.with_name(f"dive_0{suffix}"))
    (path.parent / "metadata.yaml").unlink()
    assert list_files(tmp_path).tests == [path]
    assert folder_and_files([path.parent]) == folder_and_files([path]) == (tmp_path, [path])
    assert _depths(read_log(path, BLUEROV2)) == 100
