"""Interrupts that come at a bad moment."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread


@contextmanager
def held_interrupts(tell: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Tell of interrupts, and raise KeyboardInterrupt at the end.

    Raised at any moment, one could leave a lock of threads locked, or one of two files in its place.
    """
    came: list[int] = []

    def interrupted(number: int, _: object) -> None:
        came.append(number)
        tell()

    here = current_thread() is main_thread()
    taken = [s for s in (signal.SIGINT, signal.SIGTERM) if here and signal.getsignal(s) is signal.default_int_handler]
    try:
        for number in taken:
            signal.signal(number, interrupted)
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.default_int_handler)
        if came:
            raise KeyboardInterrupt
