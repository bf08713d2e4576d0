"""What Ctrl-C must not cut in two, and what must be cleaned up when it ends the process."""

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
"""A thread holds this lock while it does something that an interrupt must not cut in two. See `clean_up_everything`."""
_PENDING: list[tuple[Callable[[], object], str]] = []
"""What is still to be cleaned up, in the order in which it began, with what the user should know then."""
_ATTEMPTS = 50
"""How often a folder is removed while a thread may still be writing into it."""
_PAUSE = 0.01
"""Seconds between two attempts."""


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
def temporary_folder(prefix: str) -> Iterator[str]:
    """Make a folder for temporary files; it is removed when the block ends or an interrupt ends the process."""
    with ExitStack() as stack:
        with UNINTERRUPTED:
            folder = tempfile.mkdtemp(prefix=prefix)
            stack.enter_context(cleaned_up(partial(_remove, folder)))
        yield folder


def clean_up_everything() -> list[str]:
    """Clean up whatever is pending, the latest first, because the process is about to end; return the notes.

    The caller holds UNINTERRUPTED until the process has ended. Every other thread has therefore finished what must not
    be interrupted, and none begins anything more that would have to be cleaned up.
    """
    for clean, _ in reversed(_PENDING):
        with suppress(Exception):
            clean()
    return [note for _, note in _PENDING if note]


@contextmanager
def ctrl_c_withheld() -> Iterator[None]:
    """Start processes in this block that Ctrl-C in a terminal does not reach: this process ends them.

    They, and the threads that are started here, inherit that SIGINT is blocked. Windows has no such inheritance.
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

    Its start ends with SIGINT not blocked, so it comes before SIGINT is blocked. Its warning that it had to remove some
    is no news after an interrupt.
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
    for _ in range(_ATTEMPTS):
        shutil.rmtree(folder, ignore_errors=True)
        if not Path(folder).exists():
            return
        time.sleep(_PAUSE)
