"""A child process for code that may crash or hang, such as the library of an FMU.

`multiprocessing` is not used: it refuses to start processes in Dask's workers, and it would import the caller's script
once more.
"""

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic
from typing import IO, Any

from rov_fmu.io.interrupts import UNINTERRUPTED, cleaned_up

_POLL = 0.1
"""The longest single wait for an answer, s. It is short, because Windows delivers Ctrl-C only between waits."""
_PROGRAM = "import sys; sys.path[:] = {}; from rov_fmu.engine.child_process import _serve; _serve()"


class ChildError(Exception):
    """The child process has ended, or did not answer within the time limit. The text says which."""


class ChildProcess:
    """An object that lives in a process of its own, where its methods are called.

    Messages are pickled. What the child process prints to stdout is dropped. Ctrl-C in a terminal does not reach it; it
    ends with this process.
    """

    def __init__(self, make: Callable[..., object], *arguments: Any, time_limit: float | None = None) -> None:
        """Start the process and make the object there. Raises ChildError, and what `make` raises.

        The time limit (s) holds for `make` and for each call. It does not include the start of Python.
        """
        self._time_limit = time_limit
        self._answers: SimpleQueue[Any] = SimpleQueue()
        self._open = ExitStack()
        with UNINTERRUPTED:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM.format(sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
            self._open.enter_context(cleaned_up(self._kill))
        Thread(target=self._receive, daemon=True).start()
        try:
            self._send((make, arguments))
            self._answer(None)  # Python has started and has imported the module of `make`
            self._answer(time_limit)
        except BaseException:
            self.close()
            raise

    def call(self, method: str, *arguments: Any) -> Any:
        """Return what a method of the object returns. Raises its exceptions; after a ChildError the process is gone."""
        self._send((method, arguments))
        return self._answer(self._time_limit)

    def close(self) -> None:
        """End the process."""
        self._open.close()

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()
        assert self._process.stdin
        with suppress(OSError):  # a message that was not sent
            self._process.stdin.close()

    def _send(self, message: Any) -> None:
        assert self._process.stdin
        with suppress(OSError):  # the process has ended; the answer says why
            _send(self._process.stdin, message)

    def _receive(self) -> None:
        assert self._process.stdout
        for answer in _messages(self._process.stdout):
            self._answers.put(answer)
        self._answers.put(None)  # the process has ended

    def _answer(self, time_limit: float | None) -> Any:
        end = None if time_limit is None else monotonic() + time_limit
        while True:
            with suppress(Empty):
                answer = self._answers.get(timeout=_POLL)
                break
            if end is not None and monotonic() > end:
                self.close()
                raise ChildError(f"the FMU did not return within time_limit = {time_limit:g} s")
        if answer is None:
            cause = _cause(self._process.wait())
            self.close()
            raise ChildError(f"the FMU ended its process: {cause}")
        result, error = answer
        if error:
            raise error
        return result


def _cause(exit_code: int) -> str:
    if exit_code < 0:
        with suppress(ValueError):
            return signal.Signals(-exit_code).name
    return f"exit code {exit_code}"


def _send(pipe: IO[bytes], message: Any) -> None:
    pickle.dump(message, pipe, pickle.HIGHEST_PROTOCOL)
    pipe.flush()


def _messages(pipe: IO[bytes]) -> Iterator[Any]:
    """Yield the messages of a pipe until the process at its other end has ended."""
    with pipe, suppress(Exception):  # a message that was cut off fails in many ways
        while True:
            yield pickle.load(pipe)


def _serve() -> None:
    """Make the object and call its methods as long as the parent process lives. This is the child process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # an FMU may print
    requests: SimpleQueue[Any] = SimpleQueue()

    def receive() -> None:
        """Queue the requests of the parent. When the parent has ended, end this process, even if the FMU hangs."""
        for request in _messages(sys.stdin.buffer):
            requests.put(request)
        os._exit(0)

    Thread(target=receive, daemon=True).start()
    function, arguments = requests.get()
    _send(answers, (None, None))
    made: Any = None
    while True:
        try:
            result, error = function(*arguments), None
        except Exception as raised:
            result, error = None, raised
        if made is None:
            made, result = result, None
        _send(answers, (result, error))
        method, arguments = requests.get()
        function = getattr(made, method)
