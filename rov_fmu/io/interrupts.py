"""Protects actions that Ctrl-C must not interrupt half-way, and cleans up when Ctrl-C ends the process."""

import os
import shutil
import signal
import sys
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
_PENDING: list[tuple[Callable[[], object], str]] = []
"""Functions that still have to clean up, the oldest first, each with a note for the user."""
_ATTEMPTS = 50
"""The number of attempts to remove a folder, since a thread may still be writing into it."""
_PAUSE = 0.01
"""The time between two attempts, in seconds."""


@contextmanager
def cleaned_up(clean: Callable[[], object], note: str = "") -> Iterator[None]:
    """Call `clean` when the block ends, and also when an interrupt ends the process within the block.

    The line about the interrupt ends with the note.
    """
    entry = clean, note
    with UNINTERRUPTED:
        _PENDING.append(entry)
    try:
        yield
    finally:
        with UNINTERRUPTED:
            _PENDING.remove(entry)
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


def clean_up_everything() -> list[str]:
    """Call all pending functions, the latest first, because the process is about to end, and return their notes.

    The caller holds UNINTERRUPTED until the process has ended. So every other thread has finished its protected action,
    and no thread begins another one.
    """
    for clean, _ in reversed(_PENDING):
        with suppress(Exception):
            clean()
    return [note for _, note in _PENDING if note]


@contextmanager
def ctrl_c_withheld() -> Iterator[None]:
    """Block SIGINT, so that Ctrl-C in a terminal does not reach the processes that are started in the block.

    These processes, and threads that are started here, inherit the blocked signal; this process ends them. On Windows
    the block has no effect.
    """
    if sys.platform == "win32":
        yield
        return
    _start_resource_tracker()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_resource_tracker() -> None:
    """Start Python's helper process that removes the semaphores of a process which has ended.

    Starting it unblocks SIGINT, so it must be started first. Its warning about semaphores that it had to remove is
    switched off, because they are expected after an interrupt.
    """
    from multiprocessing.resource_tracker import ensure_running

    given = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join([*([given] if given else []), "ignore:resource_tracker:UserWarning"])
    try:
        ensure_running()
    finally:
        del os.environ["PYTHONWARNINGS"]
        if given is not None:
            os.environ["PYTHONWARNINGS"] = given


def _remove(folder: str) -> None:
    """Remove a folder, in several attempts if necessary."""
    for _ in range(_ATTEMPTS):
        shutil.rmtree(folder, ignore_errors=True)
        if not Path(folder).exists():
            return
        time.sleep(_PAUSE)
