"""Commands that are killed, interrupted, run at once, or cannot print: whole files, and at most one line."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rov_fmu.vehicle.shipped import VIDEORAY
from tests.commands import COMMANDS, ROOT, start, without_progress
from tests.often import spread

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals, pipes and shells are POSIX")
OLD = b"the old one"


# ---- Killed ----------------------------------------------------------------------------------------------------------


def _kill(process: subprocess.Popen[str], folder: Path, after: float | None) -> None:
    """Kill a process after some seconds, or as soon as a draft is in the folder."""
    deadline = time.monotonic() + (300.0 if after is None else after)
    while time.monotonic() < deadline and not (after is None and list(folder.glob(".*.part"))):
        assert after is not None or process.poll() is None
        time.sleep(0.001)
    process.kill()
    process.communicate(timeout=300)


@pytest.mark.parametrize(
    ("keys", "moments"),
    [
        pytest.param([("identify", "output"), ("identify", "report")], 1, marks=pytest.mark.long),
        pytest.param([("identify", "output"), ("identify", "report")], 20, marks=pytest.mark.weekly),
        pytest.param([("build", "output")], 20, marks=pytest.mark.weekly),
    ],
)
def test_a_killed_command_leaves_whole_files_and_the_next_one_is_right(
    keys: list[tuple[str, str]], moments: int, tmp_path: Path
) -> None:
    """It is killed as it writes, and at moments of which most are near its end."""
    commands = [COMMANDS[key] for key in keys]

    def started(folder: Path) -> subprocess.Popen[str]:
        folder.mkdir(exist_ok=True)
        words = dict.fromkeys(
            word for command in commands for word in command.arguments(folder / command.name, "--force")
        )
        return start([*words], stdout=subprocess.DEVNULL)

    def contents(folder: Path) -> list[bytes]:
        return [(folder / command.name).read_bytes() for command in commands]

    def whole(folder: Path) -> list[bytes]:
        process = started(folder)
        assert without_progress(process.communicate(timeout=300)[1]) == ""
        assert process.returncode == 0
        return contents(folder)

    began = time.monotonic()
    expected = whole(tmp_path / "whole")
    took = time.monotonic() - began
    for n in range(moments):
        folder = tmp_path / str(n)
        process = started(folder)
        for command in commands:
            (folder / command.name).write_bytes(OLD)
        _kill(process, folder, took * (n / moments) ** 0.5 if n else None)
        assert all(content in (OLD, new) for content, new in zip(contents(folder), expected, strict=True))
    assert whole(folder) == expected


# ---- Interrupted -----------------------------------------------------------------------------------------------------


_INTERRUPTING = "os.kill(os.getpid(), signal.SIGINT); time.sleep({})"


ACTIONS = {
    "text": f"exec({_INTERRUPTING.format(600.0)!r})",
    "finalizer": f"type('Ended', (), {{'__del__': lambda _: exec({_INTERRUPTING.format(0.0)!r})}})()",
    "caught": f"""
    try:
        {_INTERRUPTING.format(0.1)}
    except BaseException:
        pass""",
}
"""Code in which a KeyboardInterrupt would be lost or turned into something else."""


@pytest.mark.parametrize("action", ACTIONS.values(), ids=ACTIONS)
def test_no_code_can_make_something_else_of_an_interrupt(action: str, tmp_path: Path) -> None:
    check_interrupted(f"def action():\n    {action}\n    time.sleep(600.0)", tmp_path)


def check_interrupted(action: str, folder: Path) -> None:
    """Run a function `action` as the process of a command, and check that it ends as an interrupted one."""
    (folder / "interrupted.py").write_text(
        "import os, signal, sys, time\nfrom pathlib import Path\nfrom rov_fmu.process import exit_code, run_process\n"
        f"{action}\nsys.exit(run_process('rov-fmu', lambda: exit_code('rov-fmu', action, {{OSError: 2}})))\n"
    )
    ran = subprocess.run(
        [sys.executable, "-m", "interrupted"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ | {"PYTHONPATH": str(ROOT)},  # this checkout, whichever is installed
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert (ran.returncode, without_progress(ran.stderr)) == (130, "rov-fmu: interrupted, no file is half-written\n")


_QUICK = (("tune", "output"),)


@pytest.mark.parametrize(
    "key",
    spread([key for key in COMMANDS if key[0] != "sitl"], _QUICK, [("identify", "report")]),
    ids=" ".join,
)
def test_an_interrupt_before_the_last_move_leaves_nothing(key: tuple[str, str], tmp_path: Path) -> None:
    """A flight without an autopilot writes no log. The cache of the compiler is elsewhere."""
    command = COMMANDS[key]
    target = tmp_path / "out" / command.name
    target.parent.mkdir()
    action = f"""
def interrupt(_):
    if any(Path({str(target.parent)!r}).iterdir()):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(600.0)
os.fsync = interrupt
def action():
    from rov_fmu.cli import main
    main({command.arguments(target, "--force")!r})
"""
    check_interrupted(action, tmp_path)
    assert not any(target.parent.iterdir())


def test_an_interrupt_between_two_moves_waits_for_the_second(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    action = f"""
def replace(self, target):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.5)
    self.rename(target)
Path.replace = replace
def action():
    from rov_fmu.io.output import Output, write_whole
    write_whole(*(Output(Path({str(out)!r}, name), b"new") for name in ("rov.toml", "report.html")))
    time.sleep(600.0)
"""
    check_interrupted(action, tmp_path)
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "rov.toml"]


# ---- What is printed -------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_output_that_nobody_reads_or_that_has_no_room() -> None:
    end, start_ = os.pipe()
    os.close(end)
    process = start(["list"], stdout=start_)
    os.close(start_)
    _, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (1, "")
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        process = start(["list"], stdout=full)
        _, err = process.communicate(timeout=300)
    assert (
        without_progress(err)
        == "rov-fmu: the output, or a temporary file: cannot be written: No space left on device\n"
    )
    assert process.returncode == 2


def test_a_terminal_with_ascii_only_gets_every_line(tmp_path: Path) -> None:
    path = tmp_path / "Röv \udcff.toml"
    try:
        path.write_text(VIDEORAY.read_text(encoding="utf-8").replace("VideoRay Pro 4", "Röv α"), encoding="utf-8")
    except OSError:
        pytest.skip("a file system that takes Unicode alone")
    shutil.copytree(VIDEORAY.parent, tmp_path, dirs_exist_ok=True)
    ascii_ = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii", "COLUMNS": "3"}
    for file, code, shown in (
        (path, 0, "What holds a steady speed of R\\xf6v \\u03b1, "),
        (f"{path}x", 2, "R\\udcc3\\udcb6v \\udcff.tomlx: there is no such file"),
    ):
        process = start(["simulate", str(file), "--find", "surge=0.3"], environment=ascii_, stdout=subprocess.PIPE)
        out, err = process.communicate(timeout=300)
        assert process.returncode == code
        assert (out + err).isascii()
        assert (err if code else out).replace(f"rov-fmu: {tmp_path}/", "").startswith(shown)
        assert (out if code else err) == ""
        assert err.count("\n") == bool(code)
