"""A function run in a process of its own, which may die of what it runs."""

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from itertools import chain
from queue import Empty, SimpleQueue
from threading import Thread
from typing import IO, Any, TypeVar

from rov_fmu.files.messages import brief

_Answer = TypeVar("_Answer")
_START = "import sys; sys.path = sys.argv[1:]; from rov_fmu.export.apart import _serve; _serve()"


class DiedError(Exception):
    """The process ended before the function did: by what signal, or with what exit code."""


def apart(function: Callable[..., Iterator[_Answer]], *arguments: Any) -> Generator[_Answer]:
    """What a function at the top of a module yields, none of it None. Raises DiedError.

    The process ends with the generator. It is not one of multiprocessing's, which run the caller's script once more
    where that has no `if __name__ == "__main__"`.
    """
    command = [sys.executable, "-c", _START, *sys.path]
    answers: SimpleQueue[Any] = SimpleQueue()
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said)
        assert process.stdin
        assert process.stdout

        def talk(to: Any, of: Any) -> None:
            with suppress(OSError, EOFError, pickle.UnpicklingError):  # it died, maybe amid an answer
                pickle.dump((function, arguments), to)
                to.flush()
                while (answer := pickle.load(of)) is not None:
                    answers.put(answer)
                answers.put(None)
            answers.put(DiedError)

        listener = Thread(target=talk, args=(process.stdin, process.stdout), daemon=True)
        listener.start()
        try:
            while (answer := _next(answers)) is not None:
                if answer is DiedError:
                    raise DiedError(_end(process.wait()) + _last_words(said))
                yield answer
        finally:
            process.kill()
            process.wait()
            listener.join()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError):  # what it did not read
                    pipe.close()


def _next(answers: SimpleQueue[Any]) -> Any:
    while True:
        with suppress(Empty):
            return answers.get(timeout=0.1)  # on Windows an interrupt comes between two waits


def _end(code: int) -> str:
    if code < 0:
        return f"signal {-code} ({signal.strsignal(-code)})"
    return f"exit code {code if code < 256 else hex(code)}"


def _last_words(said: IO[bytes]) -> str:
    said.seek(max(0, said.seek(0, os.SEEK_END) - 1000))
    lines = said.read().decode(errors="replace").strip().split("\n")
    return f": {brief(lines[-1].strip())}" if lines[-1] else ""


def _serve() -> None:
    """The other side. What it runs has neither standard input nor output: they are for questions and answers."""
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nothing, stream)
    function, arguments = pickle.load(asked)

    def end_with_the_other() -> None:
        asked.read()  # to the end, which comes when no one is there to ask
        os._exit(1)

    Thread(target=end_with_the_other, daemon=True).start()
    for answer in chain(function(*arguments), [None]):
        pickle.dump(answer, answers)
        answers.flush()
