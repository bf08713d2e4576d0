"""Damages logs and tables, and looks whether each is read, or refused in one line, within a minute and 2 GB.

A file is read as `rov-fmu inspect` reads it, in this process, so that the next file costs no start. The time
is that of the wall clock; the memory is that of this process and of the child process that reads, counted together.
"""

import random
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

from rov_fmu.cli import main
from rov_fmu.tank.readers.parsers import one_parser

from .campaign import FindingError

MOST_SECONDS, MOST_MEMORY = 60.0, 2e9
"""The longest time (s) and the largest memory (bytes) that a file may take."""
_STRUCTURE = 2000
"""Most of the structure of a file is in so many bytes at its start."""


@dataclass
class Tried:
    """What became of the damaged copies of a file."""

    read: int = 0
    refused: int = 0
    seconds: float = 0.0
    """The longest time, s."""
    memory: float = 0.0
    """The largest memory, bytes; 0 where the system does not tell it."""
    lines: list[str] = field(default_factory=list)
    """The lines in which files were refused."""


def damaged(content: bytes, seed: int) -> bytes:
    """Return a file cut short, with bits and bytes changed, or with pieces taken away, repeated, moved or swapped."""
    chance = random.Random(seed)
    start = chance.randrange(len(content))
    end = min(start + chance.choice((1, 8, 100, 1000)), len(content))
    to = chance.randrange(len(content))
    piece = content[start:end]
    changes: list[Callable[[], bytes]] = [
        lambda: content[:start],
        lambda: content[:start] + content[end:],
        lambda: content[:end] + piece * chance.choice((1, 2, 100)) + content[end:],
        lambda: content[:to] + piece + content[to:],
        lambda: content[:to] + piece + content[to + len(piece) :],
        lambda: content[:start] + bytes(len(piece)) + content[end:],
        *[lambda: _changed(content, chance)] * 6,
    ]
    return chance.choice(changes)()


def _changed(content: bytes, chance: random.Random) -> bytes:
    """Return a file with a few flipped bits or other bytes, half of them at its start."""
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 3, 30))):
        place = chance.randrange(chance.choice((min(_STRUCTURE, len(changed)), len(changed))))
        changed[place] = chance.choice((changed[place] ^ 1 << chance.randrange(8), 0, 255, chance.randrange(256)))
    return bytes(changed)


def try_damaged(path: Path, seeds: Iterable[int], folder: Path) -> Tried:
    """Damage a file once for each seed, and read it. Raises FindingError with the first file that breaks a promise."""
    content, tried = path.read_bytes(), Tried()
    copy = folder / f"damaged{''.join(path.suffixes)}"
    with one_parser():
        for seed in seeds:
            copy.write_bytes(damaged(content, seed))
            try:
                line, seconds, memory = _inspected(copy)
            except Exception as error:
                raise FindingError(f"{path.name}, seed {seed}: {type(error).__name__}: {error}", [copy]) from error
            tried.read += not line
            tried.refused += bool(line)
            tried.lines += [line] * bool(line)
            tried.seconds, tried.memory = max(tried.seconds, seconds), max(tried.memory, memory)
            if seconds > MOST_SECONDS or memory > MOST_MEMORY:
                raise FindingError(f"{path.name}, seed {seed}: {seconds:.0f} s and {memory / 1e9:.1f} GB", [copy])
    return tried


def _inspected(path: Path) -> tuple[str, float, float]:
    """Return the line that refuses a file, empty for one that is read, the time (s) and the memory (bytes).

    Raises what the command raises, and AssertionError for another message.
    """
    printed, told = StringIO(), StringIO()
    begin = time.monotonic()
    before = forget_peaks()
    with redirect_stdout(printed), redirect_stderr(told):
        code = main(["inspect", str(path)])
    seconds, memory = time.monotonic() - begin, peak_since(before)
    lines = told.getvalue().splitlines()
    assert code in (0, 2), f"exit code {code}: {lines}"
    if code and not (lines and all(line.startswith(f"rov-fmu: {path}") and line.isprintable() for line in lines)):
        raise AssertionError(f"no clear line: {lines}")
    return lines[0] if code else "", seconds, memory


def _processes() -> list[Path]:
    """Return the folder of this process in /proc, and those of its children."""
    texts = ((task / "children").read_text(encoding="ascii") for task in Path("/proc/self/task").iterdir())
    return [Path("/proc/self"), *(Path("/proc", child) for text in texts for child in text.split())]


def _largest_that_ended() -> int:
    """Return the largest peak of the memory of all children that ended since this process began, KiB."""
    import resource  # not on Windows

    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss


def forget_peaks() -> int:
    """Begin to measure the memory anew, and return what `peak_since` needs: the peak of children that ended, KiB."""
    if sys.platform != "linux":
        return 0
    for process in _processes():
        (process / "clear_refs").write_text("5", encoding="ascii")
    return _largest_that_ended()


def peak_since(before: int) -> float:
    """Return the peaks of the memory of this process and of its children together, bytes; 0 on other systems than
    Linux.

    Of the children that ended, Linux tells only the largest peak since this process began. It counts if it is larger
    than `before`, what `forget_peaks` returned: larger programs may have ended earlier.
    """
    if sys.platform != "linux":
        return 0.0
    rows = [(process / "status").read_text(encoding="utf-8").splitlines() for process in _processes()]
    own, *children = (int(row.split()[1]) for status in rows for row in status if row.startswith("VmHWM"))
    ended = _largest_that_ended()
    return 1024.0 * (own + max(sum(children), ended if ended > before else 0))
