"""An object in a process of its own (rov_fmu.io.child_process.py)."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path
from pickle import PicklingError

import pytest

from rov_fmu.io.child_process import ChildError, ChildProcess, Functions, LimitError, Limits


class Counter:
    """An object that counts, fails, hangs, or ends its process."""

    def __init__(self, start: int) -> None:
        if start < 0:
            raise ValueError("must not be negative")
        print("started")  # would damage the messages if it were not dropped
        self.n = start

    def add(self, a: int, b: int = 1) -> int:
        print("adding")
        self.n += a * b
        return self.n

    def fail(self, text: str) -> None:
        raise LookupError(text)

    def hang(self) -> None:
        time.sleep(60.0)

    def spin(self, seconds: float) -> None:
        began = time.process_time()
        while time.process_time() - began < seconds:
            pass

    def end(self, code: int) -> None:
        os._exit(code)

    def kill(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def leave_a_file(self) -> None:
        Path(os.environ["TMPDIR"], "left").touch()
        Path("left in the folder where it works").touch()

    def pid(self) -> int:
        return os.getpid()

    def unsendable(self) -> object:
        return lambda: self.n

    def zeros(self, size: int) -> bytes:
        return bytes(size)


def test_methods_return_and_raise_as_in_this_process_and_the_object_remembers() -> None:
    with closing(ChildProcess(Counter, 2, limits=Limits(time=60.0))) as child:
        assert child.call("pid") != os.getpid()
        assert (child.call("add", 3), child.call("add", 2, 10)) == (5, 25)
        with pytest.raises(LookupError, match="not here"):
            child.call("fail", "not here")
        with pytest.raises((AttributeError, RuntimeError, PicklingError), match="lambda"):
            child.call("unsendable")
        assert child.call("add", 0) == 25
    with pytest.raises(ValueError, match="must not be negative"):
        ChildProcess(Counter, -1)


@pytest.mark.skipif(sys.platform != "linux", reason="the process is killed with a signal of POSIX")
@pytest.mark.parametrize(("method", "arguments", "cause"), [("end", (3,), "exit code 3"), ("kill", (), "SIGKILL")])
def test_the_end_of_the_process_is_told_with_its_cause_and_its_files_are_removed(
    method: str, arguments: tuple[int, ...], cause: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    child = ChildProcess(Counter, 0)
    child.call("leave_a_file")
    assert len([*tmp_path.rglob("left*")]) == 2
    with pytest.raises(ChildError, match=f"^ended its process: {cause}$"):
        child.call(method, *arguments)
    assert not [*tmp_path.iterdir()]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
def test_a_result_counts_twice_as_it_is_packed_within_the_memory_of_the_call() -> None:
    """The caller needs no more memory for it than that, either."""
    with closing(ChildProcess(Counter, 0, limits=Limits(memory=600_000_000))) as child:
        assert len(child.call("zeros", 100_000_000)) == 100_000_000
        with pytest.raises(LimitError, match=r"0\.6 GB of memory"):
            child.call("zeros", 400_000_000)


def test_a_call_beyond_its_time_limit_ends_the_process() -> None:
    child = ChildProcess(Counter, 0, limits=Limits(time=0.3))
    pid, began = child.call("pid"), time.monotonic()
    with pytest.raises(ChildError, match=r"^needs more than 0\.3 s$"):
        child.call("hang")
    assert 0.3 <= time.monotonic() - began < 5.0
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells how long a process waits for a processor")
def test_a_busy_machine_makes_no_time_limit_shorter() -> None:
    """Three others share a processor with a call, which takes four times as long by the wall clock."""
    spins = [sys.executable, "-c", "while True: pass"]
    others = [subprocess.Popen(spins, start_new_session=True) for _ in range(3)]
    try:
        with closing(ChildProcess(Counter, 0, limits=Limits(time=0.5))) as child:
            for pid in (child.call("pid"), *(one.pid for one in others)):
                os.sched_setaffinity(pid, {min(os.sched_getaffinity(0))})
            began = time.monotonic()
            child.call("spin", 0.2)
            assert time.monotonic() - began > 0.5
    finally:
        for one in others:
            one.kill()
            one.wait()


def _write(size: int, path: str) -> None:
    Path(path).write_bytes(bytes(size))


def _opaque() -> None:
    class OpaqueError(Exception):
        """An exception that pickle cannot send, since its class is local."""

    raise OpaqueError("the reason")


def _swallowed() -> None:
    try:
        bytes(10**12)
    except MemoryError:
        raise ValueError("a parser hides the cause") from None


def _lost(size: int, path: str) -> None:
    with suppress(OSError):
        _write(size, path)
    raise ValueError("a parser tells nothing of the cause")


def _length(size: int) -> int:
    return len(bytes(size))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory and files")
def test_a_call_beyond_its_memory_or_disk_is_ended_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    limits = Limits(time=60.0, memory=500_000_000, disk=1_000_000)
    with closing(ChildProcess(Functions, limits=limits)) as child:
        assert Path(child.call("call", os.getenv, "TMPDIR")).parent == tmp_path
        assert child.call("call", len, bytes(10**7)) == 10**7
        assert child.call("call", _length, 7 * 10**8, limits=Limits(memory=2 * 10**9)) == 7 * 10**8
    for function, arguments, reason in (
        (bytes, (10**9,), r"needs more than 0\.5 GB of memory"),
        (_swallowed, (), r"needs more than 0\.5 GB of memory"),
        *(
            (write, (2_000_000, str(tmp_path / "large")), r"needs more than 0\.001 GB of disk space")
            for write in (_write, _lost)
        ),
    ):
        with closing(ChildProcess(Functions, limits=limits)) as child, pytest.raises(ChildError, match=f"^{reason}$"):
            child.call("call", function, *arguments)
    assert [file.name for file in tmp_path.iterdir()] == ["large"]
    with (
        closing(ChildProcess(Functions, limits=limits)) as child,
        pytest.raises(RuntimeError, match=r"^the reason$"),
    ):
        child.call("call", _opaque)
