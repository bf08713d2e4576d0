"""How a command line ends: its exit code, and one line on what went wrong."""

import os
import signal
import sys
from _thread import interrupt_main
from collections.abc import Callable, Mapping
from threading import Timer
from typing import Any, NoReturn

from rov_fmu.files.messages import one_line
from rov_fmu.files.output import WriteError

_SOON = 0.01
"""s, after which a finalizer has ended."""


def exit_code(program: str, action: Callable[[], None], codes: Mapping[type[Exception], int]) -> int:
    """Do what is asked for: 0 done, 130 interrupted, 1 no one reads what is printed, or the code of what is raised.

    OSError is among the codes. The messages of the others are printed as they are, as is that of an interrupt.
    """
    from click import Abort, ClickException  # late: where it is not installed, the command line can say so

    try:
        try:
            action()
        finally:
            if sys.stdout:  # --help leaves by SystemExit
                sys.stdout.flush()
    except (KeyboardInterrupt, Abort) as interrupt:
        exec("")  # CPython ends by SIGINT, whatever is asked for, if the last text that was executed was interrupted
        return _say(program, "\n".join(["interrupted, no file is half-written", *map(str, interrupt.args)]), 130)
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


def run_process(main: Callable[[], int]) -> NoReturn:
    """Run a command line that is a process of its own."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ended from outside, it cleans up as at Ctrl-C
    sys.unraisablehook = _interrupt_again
    for stream in (sys.stdout, sys.stderr):
        if stream:  # a terminal without Greek letters gets \u03b1
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    sys.exit(main())


def _interrupt_again(ignored: Any) -> None:
    """Python ignores what a finalizer raises, an interrupt that comes meanwhile among it: it comes again."""
    if isinstance(ignored.exc_value, KeyboardInterrupt):
        Timer(_SOON, _interrupt).start()
    else:
        sys.__unraisablehook__(ignored)


def _interrupt() -> None:
    if hasattr(signal, "pthread_kill"):  # which ends a wait, too
        os.kill(os.getpid(), signal.SIGINT)
    else:
        interrupt_main()


def _say(program: str, message: str, code: int) -> int:
    for line in message.splitlines():
        print(f"{program}: {line}", file=sys.stderr)
    return code


def _end_output() -> None:
    """Where what is printed has no place to go, Python shall not try again as it ends."""
    try:
        if sys.stdout:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
