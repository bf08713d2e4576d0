"""Ctrl-C in a terminal: every command ends at once, with one line, and leaves no process and no file."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import psutil
import pytest

from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, ROOT, TESTS, endless_compiler, without_progress
from tests.often import spread
from tests.recordings import PLANS, run, write_log

fcntl = pytest.importorskip("fcntl", reason="terminals and signals are POSIX")
termios = pytest.importorskip("termios", reason="terminals and signals are POSIX")

LINE = "rov-fmu: interrupted, no file is half-written\n"
LINE_OF_A_STUDY = LINE
PATIENCE = 300.0
"""The seconds until a test gives up; no test depends on the speed of the machine."""


class Command:
    """A command in its own terminal; its stderr is read separately, or is the terminal too."""

    def __init__(
        self,
        arguments: list[str],
        folder: Path,
        is_controlled: bool = True,
        environment: Mapping[str, str] | None = None,
        stderr: int | None = subprocess.PIPE,
    ) -> None:
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
            stderr=inside if stderr is None else stderr,
            text=True,
            env=os.environ | {"TERM": "xterm", "TMPDIR": str(self.temporary)} | dict(environment or {}),
            start_new_session=True,
            preexec_fn=own_terminal,  # noqa: PLW1509
        )
        os.close(inside)
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

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

    def children(self) -> list[psutil.Process]:
        with suppress(psutil.Error):
            children = psutil.Process(self.process.pid).children(recursive=True)
            return [child for child in children if "_serve" in " ".join(child.cmdline())]
        return []

    def press_ctrl_c(self, code: int = 130) -> str:
        """Press Ctrl-C and return what the command prints until all its processes have ended."""
        return self._ended_by(lambda: os.write(self._terminal, b"\x03"), code)

    def __enter__(self) -> "Command":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()

    def terminate(self) -> str:
        return self._ended_by(self.process.terminate)

    def _ended_by(self, action: Callable[[], object], code: int = 130) -> str:
        children = psutil.Process(self.process.pid).children(recursive=True)
        action()
        _, err = self.process.communicate(timeout=PATIENCE)
        self._reader.join(PATIENCE)
        _, alive = psutil.wait_procs(children, PATIENCE)
        assert not alive
        assert self.process.returncode == code, err
        assert not [*self.temporary.iterdir()]
        return without_progress(err or "")


_MOMENTS = (None, 0.0, 0.02, 0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0)
"""Seconds after the first process for the runs of a study has started; None is when the first runs are written."""


@pytest.mark.long
@pytest.mark.parametrize("later", spread(_MOMENTS, (), [None]))
@pytest.mark.parametrize("end", [Command.press_ctrl_c, pytest.param(Command.terminate, marks=pytest.mark.weekly)])
def test_a_study_ends_with_one_line(
    end: Callable[[Command], str], later: float | None, videoray_fmu: Path, tmp_path: Path
) -> None:
    plan, results = tmp_path / "plan.toml", tmp_path / "results"
    plan.write_text(f"""fmu = "{Path(shutil.copy(videoray_fmu, tmp_path)).name}"
stop_time = 20.0
step = 0.01
runs = 100000
seed = 1
vary = {{ m_rov.normal = {{ mean = 6.57, sd = 0.05 }} }}
set = {{ u_l = 0.3 }}
figures = {{ V = "u[-1]" }}
""")
    arguments = ["-m", "rov_fmu", "study", str(plan), "-o", str(results), "--workers", "2"]
    with Command(arguments, tmp_path, is_controlled=end is Command.press_ctrl_c) as study:
        if later is None:
            study.wait_until(lambda: [*results.glob("runs/*.parquet")])
        else:
            study.wait_until(lambda: (results / "study.json").exists() and study.children())
            time.sleep(later)
        assert end(study) == LINE_OF_A_STUDY
    if later == 0.0:
        assert not results.exists()
    assert not [*results.glob("*/.*")]


@pytest.mark.long
def test_a_compiler_ends_with_its_command(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    arguments = ["-m", "rov_fmu", "build", str(BARE), "-o", str(tmp_path / "out" / "x.fmu")]
    with Command(arguments, tmp_path, environment=endless_compiler(tmp_path)) as begun:
        begun.wait_until((tmp_path / "number").exists)
        assert begun.press_ctrl_c() == LINE
    assert not [*(tmp_path / "out").iterdir()]


@pytest.mark.parametrize("moment", spread((b"start 1", b"heave", b"dra"), (), [b"start 1"]))
def test_an_interrupted_identification_keeps_the_old_file(moment: bytes, tmp_path: Path) -> None:
    """The moment is a word beside the bar; the last one is the drawing of the report."""
    folder, output = Path(shutil.copytree(TESTS, tmp_path / "tests")), tmp_path / "out" / "rov.toml"
    rov, random = load_vehicle(VIDEORAY), np.random.default_rng(0)
    for n, plan in enumerate(PLANS["heave"]):  # so that it works for long enough
        write_log(folder, str(n), run(rov, HEAVE, plan, 10.0).noisy(random))
    output.parent.mkdir()
    output.write_bytes(b"the old one")
    report = str(output.with_name("report.html"))
    arguments = ["-m", "rov_fmu", "identify", str(folder), "--force", "-o", str(output), "--report", report]
    with Command(arguments, tmp_path, environment={"NO_COLOR": "1"}, stderr=None) as identification:
        identification.wait_until(lambda: moment in identification.shown)
        identification.press_ctrl_c()
        shown = identification.shown.decode().replace("\r\n", "\n")
    assert shown.endswith(LINE)
    shown = shown.removesuffix(LINE)
    assert shown.rstrip().endswith("\x1b[2K"), "the lines of the progress are gone"
    assert "\x1b[?25h" in shown, "the cursor is back"
    assert [*output.parent.iterdir()] == [output]
    assert output.read_bytes() == b"the old one"


_SLOW_END = """
import os, sys, time
from rov_fmu.process import run_process
class Slow:
    def __del__(self, write=os.write, sleep=time.sleep):
        write(1, b"done")
        sleep(0.3)
slow = Slow()
sys.exit(run_process("rov-fmu", lambda: 1))
"""
"""A command whose modules take time to free after it is done."""


def test_a_signal_after_the_end_of_a_command_keeps_its_exit_code() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        with subprocess.Popen([sys.executable, "-c", _SLOW_END], cwd=ROOT, stdout=subprocess.PIPE) as process:
            assert process.stdout
            assert process.stdout.read(4) == b"done"
            process.send_signal(number)
            assert process.wait(PATIENCE) == 1


def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    (tmp_path / "click.py").write_text(f"import pathlib, time\npathlib.Path({str(begun)!r}).touch()\ntime.sleep(600)\n")
    with Command(["-m", "rov_fmu", "list"], tmp_path, environment={"PYTHONPATH": str(tmp_path)}) as command:
        command.wait_until(begun.exists)
        assert command.press_ctrl_c() == LINE


def test_ctrl_c_is_the_usual_end_of_sitl(tmp_path: Path) -> None:
    with Command(["-m", "rov_fmu", "sitl", "bluerov2", "--port", "0"], tmp_path) as command:
        command.wait_until(lambda: b"Ctrl-C ends it" in command.shown)
        assert "interrupted" not in command.press_ctrl_c(0)
    assert b"s of flight" in command.shown
