"""Commands on a pseudo-terminal: what the user sees, at any moment and in the end."""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyte

from tests.commands import ROOT

_WIDE, _TALL = 400, 1000
"""The size of the screen that the output is drawn on, where a line that is too long is not wrapped."""


@dataclass(frozen=True)
class Shown:
    """What a command showed on a terminal."""

    code: int
    raw: str
    """All characters, with the control sequences."""
    moments: tuple[tuple[str, ...], ...]
    """The lines of the screen after each piece of output."""

    @property
    def lines(self) -> tuple[str, ...]:
        """The lines of the screen at the end."""
        return self.moments[-1]

    @property
    def longest(self) -> str:
        """The longest line of any moment."""
        return max((line for moment in self.moments for line in moment), key=len, default="")


def on_a_terminal(
    arguments: Sequence[str], columns: int, folder: Path, environment: Mapping[str, str] | None = None
) -> Shown:
    """Run a command on a pseudo-terminal of some columns, in a folder."""
    unset = {"COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"}
    inherited = {name: value for name, value in os.environ.items() if name not in unset}
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "rov_fmu", *arguments],
        cwd=folder,
        env=inherited | {"PYTHONPATH": str(ROOT), "TERM": "xterm-256color"} | dict(environment or {}),
        stdin=its,
        stdout=its,
        stderr=its,
    )
    os.close(its)
    screen = pyte.Screen(_WIDE, _TALL)
    stream, raw, moments = pyte.ByteStream(screen), b"", list[tuple[str, ...]]()
    while piece := _read(ours):
        stream.feed(piece)
        raw += piece
        moments.append(tuple(line.rstrip() for line in screen.display[: screen.cursor.y + 1]))
    os.close(ours)
    return Shown(process.wait(), raw.decode(), tuple(moments) or ((),))


def _read(terminal: int) -> bytes:
    """Return the next output, and nothing at the end."""
    try:
        return os.read(terminal, 65536)
    except OSError:  # Linux raises it when the process has closed the other side
        return b""
