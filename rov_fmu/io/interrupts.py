"""Protects actions that Ctrl-C must not interrupt half-way, and cleans up when Ctrl-C ends the process."""

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import RLock

UNINTERRUPTED = RLock()
"""A thread holds this lock during an action that must not be interrupted half-way.

The main thread takes it and keeps it when it ends the process; see `clean_up_everything`."""
_PENDING: list[tuple[Callable[[], object], bool]] = []
"""Functions that still have to clean up, the oldest first; and whether an interrupt is the usual end of their work."""
_ATTEMPTS = 50
"""The number of attempts to remove a folder, since a thread may still be writing into it."""
_PAUSE = 0.01
"""The time between two attempts, in seconds."""


@contextmanager
def cleaned_up(clean: Callable[[], object], *, ends_usually: bool = False) -> Iterator[None]:
    """Call `clean` when the block ends, and also when an interrupt ends the process within the block.

    `ends_usually` is true if an interrupt is the usual end of the block.
    """
    with UNINTERRUPTED:
        _PENDING.append((clean, ends_usually))
    try:
        yield
    finally:
        with UNINTERRUPTED:
            _PENDING.remove((clean, ends_usually))
            clean()


@contextmanager
def temporary_folder(prefix: str, parent: str | None = None) -> Iterator[str]:
    """Make a folder for temporary files; it is removed when the block ends or an interrupt ends the process.

    It lies in `parent`, or where the system has temporary files.
    """
    with ExitStack() as stack:
        with UNINTERRUPTED:
            folder = str(
                Path(tempfile.mkdtemp(prefix=prefix, dir=parent)).absolute()
            )  # `TMPDIR=.` gives a relative one
            stack.enter_context(cleaned_up(partial(_remove, folder)))
        yield folder


def clean_up_everything() -> bool:
    """Call all pending functions, the latest first, because the process is about to end. Returns True if an interrupt
    is its usual end, and each of these functions succeeds.

    The caller holds UNINTERRUPTED until the process has ended. So every other thread has finished its protected action,
    and no thread begins another one.
    """
    done = 0
    for clean, _ in reversed(_PENDING):
        with suppress(Exception):
            clean()
            done += 1
    return done == len(_PENDING) and any(usual for _, usual in _PENDING)


def _remove(folder: str) -> None:
    """Remove a folder, in several attempts if necessary."""
    for _ in range(_ATTEMPTS):
        shutil.rmtree(folder, ignore_errors=True)
        if not Path(folder).exists():
            return
        time.sleep(_PAUSE)
