"""Logs that are damaged, or made to exhaust the machine: one line each, within the budget, and no file is left."""

import os
import re
import sqlite3
import struct
import sys
import tempfile
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from scipy.io import savemat

from rov_fmu.io.child_process import Limits
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.inspection.inspection import inspect
from rov_fmu.tank.readers import parsers
from rov_fmu.tank.readers.content import Content
from rov_fmu.tank.readers.parsers import budget_for, format_of, header_of, one_parser, read_topics
from tests.tank.logs import read_log
from tests.tank.readers.motion import BLUEROV2, DIVE
from tests.tank.readers.writers import Ros, bag, flash


def read(path: Path) -> object:
    return header_of(path) if format_of(path).open else read_topics(path, ())


def _ulog(path: Path, *formats: str, data: bytes = bytes(100)) -> Path:
    """Write a ULog with these formats and one message of the first."""
    name = formats[0].partition(":")[0].encode()
    pieces = [(b"F", text.encode()) for text in formats]
    pieces += [(b"A", struct.pack("<BH", 0, 0) + name), (b"D", struct.pack("<H", 0) + data)]
    content = b"ULog\x01\x12\x35\x01" + bytes(8)
    path.write_bytes(content + b"".join(struct.pack("<H", len(text)) + kind + text for kind, text in pieces))
    return path


def _nested_ulog(folder: Path) -> Path:
    """Write a message of 65,535 structures of 65,535 structures."""
    formats = ("a:uint64_t timestamp;b[65535] z;", "b:c[65535] y;", "c:uint8_t[65535] x;")
    return _ulog(folder / "a.ulg", *formats)


def _endless_database(folder: Path) -> Path:
    """Write a bag whose definitions of messages are a view without an end, which SQLite sorts on the disk."""
    path = bag(".db3")(folder, DIVE)
    with sqlite3.connect(path) as base:
        base.execute("DROP TABLE message_definitions")
        base.execute(
            "CREATE VIEW message_definitions AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT "
            "x AS id, 'a/msg/B' AS topic_type, 'ros2msg' AS encoding, 'uint8 a' AS encoded_message_definition, "
            "'' AS type_description_hash FROM c"
        )
    base.close()
    return path


def _compressed_zeros(folder: Path) -> Path:
    """Write a bag with a message of 500 MB in 16 kB."""
    ros = Ros(2)
    unopened = Writer(folder / "zeros", version=9, storage_plugin=StoragePlugin.MCAP)
    unopened.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with unopened as writer:
        kind = "std_msgs/msg/Float64MultiArray"
        topic = writer.add_connection("/thruster", kind, typestore=ros.store)
        writer.write(topic, 0, bytes(500_000_000))
    return next((folder / "zeros").glob("*.mcap"))


def _packed_zeros(folder: Path) -> Path:
    """Write a bag of 500 MB, which zstd compressed to 16 kB."""
    path = folder / "zeros.db3.zstd"
    path.write_bytes(zstandard.compress(b"SQLite format 3\0" + bytes(500_000_000)))
    return path


def _variables(folder: Path) -> Path:
    """Write variables of MATLAB with 500 MB of zeros in 500 kB."""
    path = folder / "zeros.mat"
    savemat(path, {"time": np.zeros(62_500_000)}, do_compression=True)
    return path


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory and disk")
@pytest.mark.parametrize("write", [_nested_ulog, _endless_database, _compressed_zeros, _packed_zeros, _variables])
def test_a_small_file_that_exhausts_the_machine_is_one_line(
    write: Callable[[Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    path = write(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setattr(parsers, "_PARSER", parsers._Parser())  # which begins after the folder of its files has changed
    monkeypatch.setattr(parsers, "budget_for", lambda _: Limits(10.0, 450_000_000, 20_000_000))
    # A library that gets no more memory may also abort its process.
    limits = r"needs more than (10 s|0\.45 GB of memory|0\.02 GB of disk space) to be read|ended its process: SIGABRT"
    with pytest.raises(DataFileError, match=limits):
        read(path)
    good = bag(".db3")(tmp_path / "good", DIVE)
    assert read_topics(good, ()).pieces
    assert not [*temporary.iterdir()]


def test_all_that_reads_a_file_shares_one_budget(tmp_path: Path) -> None:
    """A file that was written anew has one of its own."""
    path = tmp_path / "a.csv"
    with one_parser():
        path.write_text("time [s]\n", encoding="utf-8")
        assert header_of(path) == ["time [s]"]
        (key,) = (key for key in parsers._PARSER.spent if key[1] == path.stat().st_ino)
        assert 0.0 <= parsers._PARSER.spent[key] < 30.0
        parsers._PARSER.spent[key] = 31.0
        for use in (lambda: header_of(path), lambda: inspect(path, [BLUEROV2])):
            with pytest.raises(DataFileError, match=r"a\.csv: needs more than 30 s to be read$"):
                use()
        path.write_text("time [s],depth [m]\n", encoding="utf-8")
        assert header_of(path) == ["time [s]", "depth [m]"]


@pytest.mark.parametrize(("kept", "counts"), [(10**6, (1, 2)), (0, (3, 4))])
def test_a_log_that_several_functions_use_is_parsed_once(
    kept: int, counts: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each gets a content of its own. What is too large is not kept, nor is what stood in the file before."""
    path, parsed, parse = flash(tmp_path, DIVE), [], parsers._parsed

    def counted(path: Path, named: Collection[str]) -> Content:
        parsed.append(path)
        return parse(path, named)

    parser = parsers._Parser()
    parser.is_child = True
    monkeypatch.setattr(parsers, "_PARSER", parser)
    monkeypatch.setattr(parsers, "_KEPT", kept)
    monkeypatch.setattr(parsers, "_parsed", counted)
    whole = len(read_topics(path, ()).pieces[0].topics)
    read_topics(path, ()).pieces[0].topics.clear()
    assert whole
    assert len(read_topics(path, ()).pieces[0].topics) == whole
    assert len(parsed) == counts[0]
    os.utime(path, (0.0, 0.0))
    assert read_topics(path, ()).pieces
    assert len(parsed) == counts[1]


def test_what_is_packed_must_be_a_log(tmp_path: Path) -> None:
    path = tmp_path / "dive.zstd"
    for content, told in (
        (b"time [s],u_1 [%]\n0,1\n", "is a CSV file, and not a log with messages"),
        (b"\0\0", "its first bytes are those of none"),
        (b"", "the file is empty"),
    ):
        path.write_bytes(zstandard.compress(content))
        with pytest.raises(DataFileError, match=f"^{re.escape(str(path))}, unpacked: {told}"):
            read(path)


def test_a_file_that_is_gone_as_it_is_read_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time [s]\n", encoding="utf-8")
    call = parsers._Parser.call

    def late(*arguments: Any) -> object:
        path.unlink()
        return call(*arguments)

    monkeypatch.setattr(parsers._Parser, "call", late)
    with pytest.raises(DataFileError, match="there is no such file"):
        header_of(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes among its files")
def test_a_pipe_is_no_file(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    os.mkfifo(path)
    with pytest.raises(DataFileError, match="is a device or a pipe, and must be a file"):
        read(path)


def test_the_budget_of_a_large_log_grows_with_its_size(tmp_path: Path) -> None:
    assert (budget_for(0).memory, budget_for(50_000_000).memory) == (10**9, 10**9)
    assert budget_for(200_000_000) == Limits(time=430.0, memory=2_200_000_000, disk=10**9)
    with one_parser():
        path = flash(tmp_path, DIVE)
        assert len({id(parsers._PARSER._child) for _ in range(2) if read_topics(path, ()).pieces}) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
def test_a_log_that_exceeds_its_budget_is_one_line_and_the_next_one_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = flash(tmp_path, DIVE)
    assert read_topics(path, ()).pieces  # from then on the process has imported the parser
    os.utime(path, (0.0, 0.0))  # it is another file then, of which the process has no content
    with monkeypatch.context() as patch:
        patch.setattr(parsers, "budget_for", lambda _: Limits(memory=1_000_000))
        with pytest.raises(DataFileError) as error:
            read(path)
    assert str(error.value) == f"{path}: needs more than 0.001 GB of memory to be read"
    assert read_topics(path, ()).pieces


def test_messages_without_a_time_or_an_output_are_no_traceback(tmp_path: Path) -> None:
    time = struct.pack("<Q", 10**6)
    for name, format_of_message in (
        ("none.ulg", "actuator_motors:float[12] control;"),
        ("no_control.ulg", "actuator_motors:uint64_t timestamp;float other;"),
        ("no_output.ulg", "actuator_outputs:uint64_t timestamp;uint32_t noutputs;"),
        ("text.ulg", "actuator_motors:uint64_t timestamp;char[12] control;"),
    ):
        path = _ulog(tmp_path / name, format_of_message, data=time + bytes(200))
        with pytest.raises(DataFileError, match="no commands of thrusters"):
            read_log(path, BLUEROV2)
        assert all(one.path == path for one in inspect(path, [BLUEROV2]))
