"""Running a command line and ending it with an exit code, and with one line about an error or an interrupt.

Most imports are inside functions, because Python prints a traceback at Ctrl-C until `run_process` is called.
"""

import os
import signal
import sys
from collections.abc import Callable, Mapping
from queue import Empty, SimpleQueue
from threading import Thread
from traceback import format_exception

_INTERRUPTED = "interrupted, no file is half-written"
_DEFECT = "this is a defect of the program, and not of your files: please report it, with all the lines above"
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_POLL = 0.5
"""The longest wait of the main thread in seconds; on Windows, a signal does not end a wait."""


def exit_code(program: str, action: Callable[[], None], codes: Mapping[type[Exception], int]) -> int:
    """Do the action and return its exit code.

    The code is 0 if the action succeeds, 130 if it is interrupted, 1 if nobody reads the output, and otherwise the one
    that `codes` has for the exception. `codes` includes OSError; the messages of the others are printed unchanged.

    Another exception is a defect of the program and not a mistake of the user: its traceback is printed with a request
    to report it, and the code is 1.
    """
    from click import Abort, ClickException

    from rov_fmu.io.messages import one_line
    from rov_fmu.io.output import WriteError

    try:
        try:
            action()
        finally:
            if sys.stdout:  # also after SystemExit, with which --help ends
                sys.stdout.flush()
    except (KeyboardInterrupt, Abort) as interrupt:
        if isinstance(interrupt.__cause__, EOFError):  # click also raises Abort at the end of the input
            raise interrupt.__cause__ from None
        return _print_error(program, _INTERRUPTED, 130)
    except BrokenPipeError:
        _end_output()
        return 1  # the code that Rich uses
    except OSError as error:
        _end_output()
        about = one_line(os.fsdecode(error.filename or "the output, or a temporary file"))
        is_output = isinstance(error, WriteError) or not error.filename
        reason = f"{'cannot be written: ' if is_output else ''}{one_line(error.strerror or str(error))}"
        return _print_error(program, f"{about}: {reason}", codes[OSError])
    except tuple(codes) as error:
        text = one_line(error.format_message()) if isinstance(error, ClickException) else str(error)
        return _print_error(program, text, next(code for kind, code in codes.items() if isinstance(error, kind)))
    except ModuleNotFoundError:  # an installation that is not complete
        raise
    except Exception as error:
        return _print_error(program, f"{''.join(format_exception(error))}{_DEFECT}", 1)
    return 0


def run_process(program: str, main: Callable[[], int]) -> int:
    """Run a command line in a thread, while the main thread waits for its end, Ctrl-C or SIGTERM.

    Python would raise KeyboardInterrupt at any place in the main thread, and ignore it in some, such as a finalizer. So
    a signal raises nothing here: the main thread cleans up and ends the process. A signal that comes when the command
    is done changes nothing: the exit code is that of the command.
    """
    events: SimpleQueue[int | BaseException | signal.Signals] = SimpleQueue()

    def run() -> None:
        try:
            events.put(main())
        except BaseException as error:  # the main thread raises it again
            events.put(error)

    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # a shell may ignore signals for a background job
            signal.signal(number, lambda number, _: events.put(signal.Signals(number)))
    for stream in (sys.stdout, sys.stderr):
        if stream:  # α becomes \u03b1 on a terminal without Greek letters
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    Thread(target=run, daemon=True).start()
    while True:
        try:
            event = events.get(timeout=_POLL)
        except Empty:
            continue
        if isinstance(event, signal.Signals):
            _end_interrupted(program)
        for number in _SIGNALS:  # everything is done, and Python would end with the signal while it frees its modules
            signal.signal(number, signal.SIG_IGN)
        if isinstance(event, BaseException):
            raise event
        assert isinstance(event, int)
        return event


def _end_interrupted(program: str) -> None:
    """Clean up, print one line unless this is the usual end, and end the process without waiting for any thread."""
    from rov_fmu.io.interrupts import UNINTERRUPTED, clean_up_everything

    with UNINTERRUPTED:  # no other thread begins or prints anything more
        code = 130
        try:
            if clean_up_everything():
                code = 0
                sys.stdout.flush()
            else:
                _print_error(program, _INTERRUPTED, code)
        finally:
            os._exit(code)


def _print_error(program: str, message: str, code: int) -> int:
    """Print the lines of a message to stderr, and return the exit code."""
    from rov_fmu.io.interrupts import UNINTERRUPTED
    from rov_fmu.io.messages import print_message

    with UNINTERRUPTED:
        for line in message.splitlines():
            print_message(f"{program}: {line}")
    return code


def _end_output() -> None:
    """Discard further output if it cannot be written, because Python would otherwise try again when it ends."""
    try:
        if sys.stdout:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
