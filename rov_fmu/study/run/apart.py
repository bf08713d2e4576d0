"""Runs in a process of their own: that the FMU ends it, or does not return, is then the reason of a run."""

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread, Timer
from typing import Any, BinaryIO

import fmpy
import numpy.typing as npt

from rov_fmu.study.plan.model import Model
from rov_fmu.study.run.simulator import LoadError, Manoeuvre, RunError, Simulator


class Apart:
    """As a Simulator, in another process. Raises LoadError."""

    def __init__(self, folder: str, model: Model, manoeuvre: Manoeuvre, time_limit: float) -> None:
        self._what, self._limit = (folder, model, manoeuvre), time_limit
        self._start()

    def run(self, values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Every recorded variable at every communication point. Raises RunError, also where the process ends."""
        try:
            found: dict[str, npt.NDArray[Any]] = self._asked("run", list(values))
        except _EndedError as ended:
            self._start()
            raise RunError(str(ended)) from ended
        return found

    def reset(self) -> None:
        """Make ready for the next run."""
        self._ready("reset")

    def renew(self) -> None:
        """Go on with another instance."""
        self._ready("renew")

    def free(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe
            with suppress(OSError):  # of what was not sent
                pipe.close()

    def _ready(self, by: str) -> None:
        try:
            self._asked(by)
        except _EndedError:
            self._start()

    def _start(self) -> None:
        command, pipe = [sys.executable, "-m", __name__], subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
        try:
            self._answer()  # that it has started, which takes its time
        except _EndedError as ended:
            raise LoadError(f"another process of Python cannot be started: {ended}") from ended
        try:
            self._asked(*self._what)
        except _EndedError as ended:
            raise LoadError(str(ended)) from ended

    def _asked(self, *request: Any) -> Any:
        """What the process answers. Raises what it raised, and _EndedError where it has ended or takes too long."""
        process = self._process
        late: list[bool] = []

        def end() -> None:
            late.append(True)
            process.kill()

        timer = Timer(self._limit, end)
        timer.start()
        try:
            assert process.stdin
            pickle.dump(request, process.stdin)
            process.stdin.flush()
            return self._answer()
        except (_EndedError, OSError) as ended:
            cause = f"ended its process: {self._cause()}"
            raise _EndedError(
                f"the FMU {f'did not return within time_limit = {self._limit:g} s' if late else cause}"
            ) from ended
        finally:
            timer.cancel()

    def _answer(self) -> Any:
        """The next one. Raises it where it is an exception, and _EndedError with the cause where none comes."""
        assert self._process.stdout
        try:
            answer = pickle.load(self._process.stdout)
        except (EOFError, pickle.UnpicklingError) as error:
            raise _EndedError(self._cause()) from error
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _cause(self) -> str:
        """Why the process has ended."""
        code = self._process.wait()
        self.free()
        if code < 0:
            with suppress(ValueError):
                return signal.Signals(-code).name
        return f"exit code {code}"


class _EndedError(Exception):
    """The other process is no more: why."""


def _answers(requests: "SimpleQueue[Any]", answers: BinaryIO) -> None:
    """Do what is asked for, and tell what has come of it."""
    simulator: Any = None
    while True:
        request = requests.get()
        try:
            if simulator is None:
                folder, model, manoeuvre = request
                description = fmpy.read_model_description(folder, validate=False)
                simulator = Simulator(folder, description, model, manoeuvre)
                answer = None
            else:
                name, *arguments = request
                answer = getattr(simulator, name)(*arguments)
        except (LoadError, RunError) as error:
            answer = error
        _tell(answers, answer)


def _tell(answers: BinaryIO, answer: Any) -> None:
    pickle.dump(answer, answers, pickle.HIGHEST_PROTOCOL)
    answers.flush()


def _main() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the FMU may print
    _tell(answers, None)
    requests: SimpleQueue[Any] = SimpleQueue()

    def listen() -> None:
        """Whoever asks may end while the FMU does not return."""
        with suppress(EOFError):
            while True:
                requests.put(pickle.load(sys.stdin.buffer))
        os._exit(0)

    Thread(target=listen, daemon=True).start()
    _answers(requests, answers)


if __name__ == "__main__":
    _main()
