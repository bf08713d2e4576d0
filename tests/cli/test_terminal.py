"""What commands show on a terminal of 80 and of 120 columns, without colour, and in a pipe."""

import os
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest

from rov_fmu.cli import _commands
from tests.commands import BARE, ROOT
from tests.folders import small_folder
from tests.often import spread

if sys.platform == "win32":
    pytest.skip("a pseudo-terminal is POSIX", allow_module_level=True)

import fcntl
import pty
import termios

import pyte

_WIDE, _TALL = 300, 300
"""The size of the screen that output is drawn on. It is larger than the terminal, so that long lines stay long."""
_VARIES = re.compile(r"\d+(?:[.:]\d+)*")
"""Times differ from run to run."""


def on_a_terminal(arguments: Sequence[str], columns: int, folder: Path) -> tuple[str, list[tuple[str, ...]]]:
    """Run a command in a folder, on a pseudo-terminal of some columns.

    Return all characters, with the control sequences, and the lines of the screen after each piece of output.
    """
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "rov_fmu", *arguments],
        cwd=folder,
        env=_environment(),
        stdin=its,
        stdout=its,
        stderr=its,
    )
    os.close(its)
    screen = pyte.Screen(_WIDE, _TALL)
    stream, raw, moments = pyte.ByteStream(screen), b"", list[tuple[str, ...]]()
    with suppress(OSError):  # Linux raises it when the process has closed its side
        while piece := os.read(ours, 65536):
            stream.feed(piece)
            raw += piece
            moments.append(_lines(screen))
    os.close(ours)
    process.wait()
    return raw.decode(), moments


def _lines(screen: pyte.Screen) -> tuple[str, ...]:
    """Return the lines of a screen up to the last one with a letter."""
    rows = (screen.buffer[y] for y in range(max(screen.buffer, default=-1) + 1))
    text = "\n".join("".join(row[x].data for x in range(max(row, default=-1) + 1)).rstrip() for row in rows)
    return tuple(text.rstrip("\n").split("\n"))


def _environment() -> dict[str, str]:
    """Return the environment of a user's terminal."""
    unset = {"COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"}
    inherited = {name: value for name, value in os.environ.items() if name not in unset}
    return inherited | {"PYTHONPATH": str(ROOT), "TERM": "xterm-256color"}


def words_in_a_pipe(arguments: Sequence[str], folder: Path) -> set[str]:
    """Return the words that a command prints in a pipe, with its numbers replaced."""
    ran = subprocess.run(
        [sys.executable, "-m", "rov_fmu", *arguments],
        cwd=folder,
        env=_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert "\x1b" not in ran.stdout + ran.stderr
    return {_VARIES.sub("0", word) for word in (ran.stdout + ran.stderr).split()}


@pytest.fixture
def folder(tmp_path: Path, videoray_fmu: Path) -> Path:
    """Return a folder with what the commands read, under short names."""
    small_folder(tmp_path / "tests")
    (tmp_path / "bare.toml").write_bytes(BARE.read_bytes())
    (tmp_path / "videoray.fmu").symlink_to(videoray_fmu)
    (tmp_path / "mistake.toml").write_text(f"nmae = 1\n{BARE.read_text(encoding='utf-8')}", encoding="utf-8")
    return tmp_path


_TUNE = "tune videoray --axis heave --command 0.3 --v-ss 0.2"
OFTEN = ["identify tests --report found.html -o found.toml --force", "build mistake.toml", "study --help"]
"""Progress with files, an error, and a help. The other commands are run every week."""
COMMANDS = [
    "build mistake.toml",
    "",
    "list",
    f"{_TUNE} -o tuned.toml",
    "build videorey",
    "build bare.toml --platform host",
    "build --platform amiga",
    "simulate bare.toml --set u_t=1.5",
    "simulate bare.toml --set u_x=1",
    "simulate videoray -o result.csv --plot result.png",
    "identify tests",
    "identify nowhere",
    "identify tests --report found.html -o found.toml --force",
    "fly bare.toml -o page.html",
    "export bluerov2_heavy --to sdf --world",
    "sitl bluerov2 --duration 0.01 --port 70000",
    "prove videoray.fmu",
    "prove videoray.fmu --tolerance 1e-300",
    "prove bare.toml",
    _TUNE,
    "tune videoray --axis surge --command 0.3 --v-ss 0.5 --tau 0.6",
    "tune videoray --axis heave",
    "study bare.toml -o results",
    *(f"{name} --help" for name in _commands.commands),
]


@pytest.mark.parametrize("columns", [80, pytest.param(120, marks=pytest.mark.weekly)])
@pytest.mark.parametrize("words", spread(COMMANDS, (), OFTEN))
def test_no_line_is_too_long_no_word_is_broken_and_no_progress_is_left(words: str, columns: int, folder: Path) -> None:
    arguments = words.split()
    unwritten = shutil.copytree(folder, folder / "unwritten", symlinks=True)
    raw, moments = on_a_terminal(arguments, columns, folder)
    assert max(len(line) for moment in moments for line in moment) <= columns
    at_the_end = "\n".join(moments[-1])
    assert not re.search(r"✓|\d:\d\d:\d\d|[━╸╺⠀-⣿]|about \d+:\d\d left", at_the_end)
    assert raw.rfind("\x1b[?25l") <= raw.rfind("\x1b[?25h"), "the cursor is back"
    if "--help" not in arguments:  # Click fills the lines of a help up to 80 columns
        seen = {_VARIES.sub("0", word) for word in at_the_end.split() if set(word) != {"─"}}  # rules are no words
        assert seen - words_in_a_pipe(arguments, unwritten) <= {"the", "widest", "of", *at_the_end.split("…")[1:]}
