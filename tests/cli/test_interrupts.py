"""Ctrl-C in a terminal: every command ends at once, with one line, and leaves no process and no file."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from typing import Any

import psutil
import pytest

from tests.commands import BARE, ROOT, TESTS

fcntl = pytest.importorskip("fcntl", reason="terminals and signals are POSIX")
termios = pytest.importorskip("termios", reason="terminals and signals are POSIX")

LINE = "rov-fmu: interrupted, no file is half-written\n"
LINE_OF_A_STUDY = "rov-fmu: interrupted, no file is half-written; the same command continues the study\n"
PATIENCE = 300.0
"""The seconds until a test gives up; no test depends on the speed of the machine."""


class Command:
    """A command in its own terminal; its stderr is read separately."""

    def __init__(self, arguments: list[str], folder: Path, is_controlled: bool = True, **environment: str) -> None:
        """`is_controlled` makes the terminal control the command, so that all its processes end with the first one."""
        self.temporary = folder / "temporary files"
        self.temporary.mkdir()
        self.shown = b""
        self._terminal, inside = os.openpty()

        def own_terminal() -> None:
            # a shell that starts a process in the background makes it ignore interrupts, and children inherit that
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            if is_controlled:
                fcntl.ioctl(inside, termios.TIOCSCTTY, 0)

        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=ROOT,
            stdin=inside,
            stdout=inside,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"TERM": "xterm", "TMPDIR": str(self.temporary)} | environment,
            start_new_session=True,
            preexec_fn=own_terminal,  # noqa: PLW1509
        )
        os.close(inside)
        Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        with suppress(OSError):  # on Linux the end of a terminal is an error
            while part := os.read(self._terminal, 4096):
                self.shown += part
        os.close(self._terminal)

    def wait_until(self, is_so: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not is_so():
            assert time.monotonic() < deadline
            assert self.process.poll() is None, self.process.communicate()[1]
            time.sleep(0.002)

    def workers(self) -> list[psutil.Process]:
        with suppress(psutil.Error):
            children = psutil.Process(self.process.pid).children(recursive=True)
            kinds = ("spawn_main", "child_process")  # of a study, of a proof
            return [child for child in children if any(kind in " ".join(child.cmdline()) for kind in kinds)]
        return []

    def press_ctrl_c(self) -> str:
        """Press Ctrl-C and return what the command prints until all its processes have ended."""
        return self._ended_by(lambda: os.write(self._terminal, b"\x03"))

    def terminate(self) -> str:
        return self._ended_by(self.process.terminate)

    def _ended_by(self, action: Callable[[], object]) -> str:
        children = psutil.Process(self.process.pid).children(recursive=True)
        action()
        _, err = self.process.communicate(timeout=PATIENCE)
        _, alive = psutil.wait_procs(children, PATIENCE)
        assert not alive
        assert self.process.returncode == 130, err
        assert not [*self.temporary.iterdir()]
        return str(err)


@contextmanager
def command(arguments: list[str], folder: Path, is_controlled: bool = True, **environment: str) -> Iterator[Command]:
    begun = Command(arguments, folder, is_controlled, **environment)
    try:
        yield begun
    finally:
        begun.process.kill()


def _plan(folder: Path, fmu: Path) -> Path:
    path = folder / "plan.toml"
    path.write_text(f"""fmu = "{Path(shutil.copy(fmu, folder)).name}"
stop_time = 20.0
step = 0.01
runs = 100000
seed = 1
vary = {{ m_rov.normal = {{ mean = 6.57, sd = 0.05 }} }}
figures = {{ V = "u[-1]" }}
""")
    return path


def _long(*values: float) -> list[Any]:
    return [pytest.param(value, marks=pytest.mark.long) for value in values]


@pytest.mark.parametrize("later", [0.0, *_long(0.02, 0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0)])
@pytest.mark.parametrize("end", [Command.press_ctrl_c, pytest.param(Command.terminate, marks=pytest.mark.long)])
def test_a_study_that_starts_its_workers_ends_with_one_line(
    end: Callable[[Command], str], later: float, videoray_fmu: Path, tmp_path: Path
) -> None:
    plan, results = _plan(tmp_path, videoray_fmu), tmp_path / "results"
    arguments = ["-m", "rov_fmu", "study", str(plan), "-o", str(results), "--workers", "2"]
    with command(arguments, tmp_path, is_controlled=end is Command.press_ctrl_c) as study:
        study.wait_until(study.workers)
        time.sleep(later)
        assert end(study) == LINE_OF_A_STUDY
    if later == 0.0:
        assert not results.exists()


@pytest.mark.parametrize("end", [Command.press_ctrl_c, Command.terminate])
def test_a_study_that_runs_ends_with_one_line(
    end: Callable[[Command], str], videoray_fmu: Path, tmp_path: Path
) -> None:
    plan, results = _plan(tmp_path, videoray_fmu), tmp_path / "results"
    arguments = ["-m", "rov_fmu", "study", str(plan), "-o", str(results), "--workers", "2"]
    with command(arguments, tmp_path, is_controlled=end is Command.press_ctrl_c) as study:
        study.wait_until(lambda: [*results.glob("runs/part-*.parquet")])
        assert end(study) == LINE_OF_A_STUDY
    assert not [*results.glob("*/.*")]


_SLOW_RESTARTS = """
import os, sys, time
from multiprocessing import util
from rov_fmu import process
from rov_fmu.__main__ import run
class Slow:
    def __getattr__(self, name):
        return end if name == "_exit" else getattr(os, name)
def end(code):
    time.sleep(0.5)
    os._exit(code)
def start(*arguments, start=util.spawnv_passfds):
    pid = start(*arguments)
    if interrupted:
        time.sleep(3.0)
    return pid
def kill(kill=process._kill_children):
    interrupted.append(True)
    kill()
interrupted, slow = [], Slow()
process.os, process._kill_children, util.spawnv_passfds = slow, kill, start
sys.exit(run())
"""
"""The command, but a worker that is restarted after the interrupt waits for its data until the process has ended."""


@pytest.mark.long
def test_a_worker_that_dask_restarts_prints_nothing(videoray_fmu: Path, tmp_path: Path) -> None:
    plan, results = _plan(tmp_path, videoray_fmu), tmp_path / "results"
    arguments = ["-c", _SLOW_RESTARTS, "study", str(plan), "-o", str(results), "--workers", "2"]
    with command(arguments, tmp_path, is_controlled=False) as study:
        study.wait_until(lambda: [*results.glob("runs/part-*.parquet")])
        assert study.terminate() == LINE_OF_A_STUDY


def _endless_compiler(folder: Path) -> str:
    """A folder for PYTHONPATH, with a compiler that never ends and has a child process."""
    zig = folder / "endless" / "ziglang" / "zig"
    zig.parent.mkdir(parents=True)
    zig.with_name("__init__.py").touch()
    zig.write_text(f"#!/bin/sh\nsleep 6000 &\ntouch '{folder}/begun'\nwait\n", encoding="utf-8")
    zig.chmod(0o755)
    return str(zig.parent.parent)


@pytest.mark.parametrize("name", ["build", "fly"])
def test_a_compiler_ends_with_its_command(name: str, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    arguments = ["-m", "rov_fmu", name, str(BARE), "-o", str(tmp_path / "out" / "x")]
    with command(arguments, tmp_path, PYTHONPATH=_endless_compiler(tmp_path)) as begun:
        begun.wait_until((tmp_path / "begun").exists)
        assert begun.press_ctrl_c() == LINE
    assert not [*(tmp_path / "out").iterdir()]


@pytest.mark.parametrize("later", [0.0, *_long(0.1, 0.2, 0.3)])
def test_a_proof_that_starts_its_process_ends_with_one_line(later: float, videoray_fmu: Path, tmp_path: Path) -> None:
    with command(["-m", "rov_fmu", "prove", str(videoray_fmu)], tmp_path) as proof:
        proof.wait_until(proof.workers)
        for worker in proof.workers():  # it stands still, for a proof takes a second only
            worker.suspend()
        time.sleep(later)
        assert proof.press_ctrl_c() == LINE


def test_an_identification_ends_with_one_line(tmp_path: Path) -> None:
    folder, output = Path(shutil.copytree(TESTS, tmp_path / "tests")), tmp_path / "out" / "rov.toml"
    output.parent.mkdir()
    with command(["-m", "rov_fmu", "identify", str(folder), "-o", str(output)], tmp_path) as identification:
        identification.wait_until(lambda: b"\xe2\x94\x81" in identification.shown)  # the bar
        assert identification.press_ctrl_c() == LINE
        shown = identification.shown
    assert shown.rstrip().endswith(b"\x1b[2K"), "the bar is gone"
    assert b"\x1b[?25h" in shown, "the cursor is back"
    assert not [*output.parent.iterdir()]


def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    (tmp_path / "click.py").write_text(f"import pathlib, time\npathlib.Path({str(begun)!r}).touch()\ntime.sleep(600)\n")
    with command(["-m", "rov_fmu", "tables"], tmp_path, PYTHONPATH=str(tmp_path)) as tables:
        tables.wait_until(begun.exists)
        assert tables.press_ctrl_c() == LINE


_WARNING = """
import sys, time
import rov_fmu.study.run.run_study as run
from rov_fmu.cli import main
from rov_fmu.io.messages import FileError
def warns(plan, output, workers, scheduler, tell, warn):
    time.sleep(0.5)  # until the bar is there
    warn("the plan is odd")
    time.sleep(0.5)
    raise FileError("that is all")
run.run_study = warns
sys.stderr = sys.stdout
sys.exit(main(["study", "plan.toml", "-o", sys.argv[1]]))
"""


def test_a_warning_is_printed_above_the_bar(tmp_path: Path) -> None:
    """The warning is not appended to the line of the bar: that line is cleared before."""
    with command(["-c", _WARNING, str(tmp_path / "results")], tmp_path) as study:
        study.process.communicate(timeout=PATIENCE)
        assert study.process.returncode == 2
        deadline = time.monotonic() + PATIENCE
        while b"that is all\r\n" not in study.shown:
            assert time.monotonic() < deadline
            time.sleep(0.01)
    bar, warning, after = study.shown.partition(b"rov-fmu: warning: the plan is odd\r\n")
    assert warning
    assert b"starting the workers" in bar
    assert b"starting the workers" in after
    assert bar.endswith(b"\r\x1b[2K")
