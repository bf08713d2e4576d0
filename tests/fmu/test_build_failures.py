"""A build that fails prints one clear line, returns an exit code, keeps an old FMU and leaves no temporary files."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.c import compile as fmu_compile
from rov_fmu.cli import main
from tests.commands import BARE, ROOT, Capsys, endless_compiler
from tests.often import spread

_SCRIPT = str(ROOT / "build_fmu.py")
_OLD = b"the old one"


def _build(output: Path, *arguments: str) -> int:
    return main(["build", str(BARE), "--platform", "host", "--force", "-o", str(output), *arguments])


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """Return the path of an FMU that already exists, alone in its folder."""
    path = tmp_path / "target" / "rov.fmu"
    path.parent.mkdir()
    path.write_bytes(_OLD)
    return path


def _untouched(old: Path) -> bool:
    return old.read_bytes() == _OLD and list(old.parent.iterdir()) == [old]


def _one_line(capsys: Capsys) -> str:
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let builds in this process pack an empty library, for failures that come after the compilation."""
    monkeypatch.setattr("rov_fmu.build.compile_all", lambda platforms, *_: dict.fromkeys(platforms, b""))


@pytest.mark.usefixtures("without_page", "uncompiled")
def test_an_fmu_that_is_not_valid_does_not_replace_the_old_one(
    old: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    def invalid(_path: str) -> list[str]:
        return ["something is wrong with it"]

    monkeypatch.setattr("fmpy.validation.validate_fmu", invalid)
    assert _build(old) == 1
    assert "not valid: something is wrong with it" in _one_line(capsys)

    def interrupted(_path: str) -> list[str]:
        raise KeyboardInterrupt

    monkeypatch.setattr("fmpy.validation.validate_fmu", interrupted)
    assert _build(old) == 130
    assert capsys.readouterr().err.lstrip("\n") == "rov-fmu: interrupted, no file is half-written\n"  # after ^C
    assert _untouched(old)


@pytest.mark.usefixtures("without_page")
def test_a_compile_error_is_printed_with_the_compilers_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    broken = tmp_path / "c"
    shutil.copytree(fmu_compile.C_SOURCES, broken)
    (broken / "step.c").write_text("int no semicolon", encoding="utf-8")
    monkeypatch.setattr("rov_fmu.c.source.C_SOURCES", broken)
    assert _build(tmp_path / "rov.fmu") == 1
    error = capsys.readouterr().err
    assert error.startswith(f"rov-fmu: {fmu_compile.host_platform()}: the compiler failed")
    assert "step.c:1" in error
    assert not (tmp_path / "rov.fmu").exists()


@pytest.mark.usefixtures("without_page", "uncompiled")
@pytest.mark.parametrize(("owner", "function"), [(os, "fsync"), (Path, "replace")], ids=["fsync", "replace"])
def test_a_full_disk_leaves_the_old_fmu(
    old: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys, owner: object, function: str
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("rov_fmu.build._check", lambda *_: "")
    monkeypatch.setattr(owner, function, full)
    assert _build(old) == 2
    assert "No space left on device" in _one_line(capsys)
    assert _untouched(old)


def _run(old: Path, folder: Path, **environment: str) -> subprocess.Popen[str]:
    """Start the script as another process, with its temporary files in a folder of the test."""
    (folder / "tmp").mkdir()
    return subprocess.Popen(
        [sys.executable, _SCRIPT, str(BARE), "--platform", "host", "--force", "-o", str(old)],
        env=os.environ | {"TMPDIR": str(folder / "tmp")} | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        # a shell starts background processes with interrupts ignored, and their children inherit this
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )


def _is_running(process: int) -> bool:
    """Return True if a process exists and is not a zombie."""
    stat = Path(f"/proc/{process}/stat")
    try:
        return stat.read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def _wait_until(is_so: Callable[[], object], process: subprocess.Popen[str] | None = None) -> None:
    """Wait for something, while a process runs. No test depends on the speed of the machine."""
    deadline = time.monotonic() + 120.0
    while not is_so():
        assert time.monotonic() < deadline
        assert process is None or process.poll() is None
        time.sleep(0.001)


@pytest.mark.skipif(sys.platform != "linux", reason="signals are POSIX, /proc is Linux")
@pytest.mark.parametrize("signal_", spread([signal.SIGINT, signal.SIGTERM], (), [signal.SIGINT]))
def test_an_interrupted_build_ends_at_once_and_leaves_nothing(
    old: Path, tmp_path: Path, signal_: signal.Signals
) -> None:
    """While a compiler runs that only the interrupt can end."""
    number = tmp_path / "number"
    process = _run(old, tmp_path, **endless_compiler(tmp_path))
    _wait_until(number.exists, process)
    process.send_signal(signal_)
    _, error = process.communicate(timeout=120)
    assert process.returncode == 130
    assert error == "rov-fmu: interrupted, no file is half-written\n"
    # the compiler was killed, but may still be ending
    _wait_until(lambda: not _is_running(int(number.read_text(encoding="utf-8"))))
    assert list((tmp_path / "tmp").iterdir()) == []
    assert _untouched(old)
