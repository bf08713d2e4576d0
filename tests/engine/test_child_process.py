"""An object in a process of its own (rov_fmu/engine/child_process.py)."""

import os
import signal
import time

import pytest

from rov_fmu.engine.child_process import ChildError, ChildProcess


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

    def end(self, code: int) -> None:
        os._exit(code)

    def kill(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def pid(self) -> int:
        return os.getpid()


def test_methods_return_and_raise_as_in_this_process_and_the_object_remembers() -> None:
    child = ChildProcess(Counter, 2, time_limit=60.0)
    try:
        assert child.call("pid") != os.getpid()
        assert (child.call("add", 3), child.call("add", 2, 10)) == (5, 25)
        with pytest.raises(LookupError, match="not here"):
            child.call("fail", "not here")
        assert child.call("add", 0) == 25
    finally:
        child.close()


def test_what_the_object_raises_as_it_is_made_is_raised() -> None:
    with pytest.raises(ValueError, match="must not be negative"):
        ChildProcess(Counter, -1)


@pytest.mark.parametrize(
    ("method", "arguments", "cause"),
    [("end", (3,), "exit code 3"), ("end", (0,), "exit code 0"), ("kill", (), "SIGKILL")],
)
def test_the_end_of_the_process_is_told_with_its_cause(method: str, arguments: tuple[int, ...], cause: str) -> None:
    child = ChildProcess(Counter, 0)
    with pytest.raises(ChildError, match=f"^the FMU ended its process: {cause}$"):
        child.call(method, *arguments)


def test_a_call_beyond_its_time_limit_ends_the_process() -> None:
    child = ChildProcess(Counter, 0, time_limit=0.3)
    pid, began = child.call("pid"), time.monotonic()
    with pytest.raises(ChildError, match=r"^the FMU did not return within time_limit = 0\.3 s$"):
        child.call("hang")
    assert 0.3 <= time.monotonic() - began < 5.0
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
