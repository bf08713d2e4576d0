"""How a command line ends: its exit code, and one line about what went wrong.

Little is imported at the top, because Python itself prints a traceback at Ctrl-C until `run_process` is called.
"""

import os
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread

_INTERRUPTED = "interrupted, no file is half-written"
_POLL = 0.5
"""Seconds after which the main thread looks for signals itself: on Windows they do not end a wait."""


def exit_code(program: str, action: Callable[[], None], codes: Mapping[type[Exception], int]) -> int:
    """Do the action and return the exit code: 0 done, 130 interrupted, 1 nobody reads the output, else from `codes`.

    OSError is among the codes. The messages of the other exceptions are printed as they are.
    """
    from click import Abort, ClickException

    from rov_fmu.io.messages import one_line
    from rov_fmu.io.output import WriteError

    try:
        try:
            action()
        finally:
            if sys.stdout:  # --help leaves by SystemExit
                sys.stdout.flush()
    except (KeyboardInterrupt, Abort) as interrupt:
        if isinstance(interrupt.__cause__, EOFError):  # click aborts then, too
            raise interrupt.__cause__ from None
        return _say(program, _INTERRUPTED, 130)
    except BrokenPipeError:
        _end_output()
        return 1  # as Rich does
    except OSError as error:
        _end_output()
        about = one_line(os.fsdecode(error.filename or "the output, or a temporary file"))
        written = isinstance(error, WriteError) or not error.filename
        reason = f"{'cannot be written: ' if written else ''}{one_line(error.strerror or str(error))}"
        return _say(program, f"{about}: {reason}", codes[OSError])
    except tuple(codes) as error:
        text = error.format_message() if isinstance(error, ClickException) else str(error)
        return _say(program, text, next(code for kind, code in codes.items() if isinstance(error, kind)))
    return 0


def run_process(program: str, main: Callable[[], int]) -> int:
    """Run a command line as a process of its own, in a thread; the main thread waits for its end, Ctrl-C or SIGTERM.

    Python would raise KeyboardInterrupt wherever the main thread happens to be, and drop it where that is a finalizer,
    for example. So a signal raises nothing here: the main thread cleans up and ends the process.
    """
    events: SimpleQueue[int | BaseException | signal.Signals] = SimpleQueue()

    def run() -> None:
        try:
            events.put(main())
        except BaseException as error:  # the main thread raises it
            events.put(error)

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # a shell may start a job in the background so
            signal.signal(number, lambda number, _: events.put(signal.Signals(number)))
    for stream in (sys.stdout, sys.stderr):
        if stream:  # a terminal without Greek letters gets \u03b1
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    Thread(target=run, daemon=True).start()
    while True:
        try:
            event = events.get(timeout=_POLL)
        except Empty:
            continue
        if isinstance(event, signal.Signals):
            _end_interrupted(program)
        elif isinstance(event, BaseException):
            raise event
        else:
            return event


def _end_interrupted(program: str) -> None:
    """End all child processes, clean up, say so in one line, and end the process without waiting for any thread."""
    from rov_fmu.io.interrupts import UNINTERRUPTED, clean_up_everything

    with UNINTERRUPTED:  # no other thread begins or says anything more
        try:
            _kill_children()
            _say(program, "; ".join([_INTERRUPTED, *clean_up_everything()]), 130)
            # Dask restarts the workers. One that starts now prints a traceback when this process ends in between.
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            _kill_children()  # those that started before, with the terminal as their stderr
        finally:
            os._exit(130)


def _kill_children() -> None:
    """Kill the worker processes.

    While a thread of Dask starts a worker, multiprocessing does not list it yet. Such a worker would print a traceback
    when this process ends, so psutil, which Dask imports, finds it.
    """
    from multiprocessing import active_children

    for child in active_children():
        with suppress(ValueError):  # another thread has just seen it end
            child.kill()
    if "psutil" in sys.modules:
        import psutil

        for process in psutil.Process().children():
            with suppress(psutil.Error):  # it has ended
                if any("spawn_main" in part for part in process.cmdline()):
                    process.kill()


def _say(program: str, message: str, code: int) -> int:
    from rov_fmu.io.interrupts import UNINTERRUPTED

    with UNINTERRUPTED:
        for line in message.splitlines():
            print(f"{program}: {line}", file=sys.stderr)
    return code


def _end_output() -> None:
    """Send further output nowhere, since it cannot be written, or Python would try again at its end."""
    try:
        if sys.stdout:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
