"""Child processes for code that may crash, hang or exhaust the machine: FMUs, and parsers of logs.

`multiprocessing` is not used: it refuses to start processes in Dask's workers, and it would import the caller's script
once more.
"""

import errno
import os
import pickle
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic
from traceback import format_exception
from typing import IO, Any, Literal

from rov_fmu.io.interrupts import UNINTERRUPTED, cleaned_up, temporary_folder
from rov_fmu.io.messages import RovError, reason_of

_POLL = 0.1
"""The longest single wait for an answer, s. It is short, because Windows delivers Ctrl-C only between waits."""
_NO_MEMORY = re.compile("(?i)NoMem|bad_alloc|(?:out of|not enough|cannot allocate|unable to allocate) memory")
"""How the exceptions of compiled libraries say that there is no memory; they are no MemoryError."""
_PATHS = ("PATH", "TMPDIR", "TEMP", "TMP", "XDG_CACHE_HOME", "ZIG_LIB_DIR", "CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH")
"""The variables that name folders, and that a compiler, a parser or an FMU reads."""
_PROGRAM = "import sys; sys.path[:] = {}; from rov_fmu.io.child_process import _serve; _serve()"


@dataclass(frozen=True)
class Limits:
    """What a child process may use; None stands for no limit. Only the time is limited on all systems.

    Linux limits memory and disk too. On other systems these limits have no effect: Windows has no setrlimit, and
    macOS ignores the limit of memory.
    """

    time: float | None = None
    """The time of each call, s of `ChildProcess.clock`."""
    memory: int | None = None
    """The address space of the process, in bytes. It includes about 0.3 GB for Python and NumPy, most of it unused."""
    disk: int | None = None
    """The size of each file that the process writes, in bytes."""

    @contextmanager
    def applied(self, pid: int = 0) -> Iterator[None]:
        """Limit the memory and the files of this process or of another one, and of those that it starts."""
        if sys.platform != "linux":
            yield
            return
        import resource

        before = []
        for kind, most in ((resource.RLIMIT_AS, self.memory), (resource.RLIMIT_FSIZE, self.disk)):
            if most is not None:
                soft, hard = resource.prlimit(pid, kind)
                before.append((kind, (soft, hard)))
                resource.prlimit(pid, kind, (most if soft == resource.RLIM_INFINITY else min(most, soft), hard))
        try:
            yield
        finally:
            with suppress(ProcessLookupError):  # the other process has ended
                for kind, bounds in before:
                    resource.prlimit(pid, kind, bounds)


class ChildError(RovError):
    """A child process that ended, or that exceeded a limit.

    The text is a predicate without a subject: `ended its process: SIGSEGV`, `needs more than 60 s`.
    """


class LimitError(ChildError):
    """A child process that exceeded a limit."""

    def __init__(self, limit: Literal["time", "memory", "disk"], limits: Limits) -> None:
        unit, words = {"time": (1.0, "s"), "memory": (1e9, "GB of memory"), "disk": (1e9, "GB of disk space")}[limit]
        super().__init__(f"needs more than {getattr(limits, limit) / unit:.3g} {words}")
        self.limit = limit


class ChildProcess:
    """An object that lives in a process of its own, where its methods are called.

    Messages are pickled. What the child process prints is dropped. It works in a folder of its own, which is removed
    when it ends, with its temporary files. Ctrl-C in a terminal does not reach it; it ends with this process.
    """

    def __init__(
        self, make: Callable[..., object], *arguments: Any, limits: Limits = Limits(), temporary: str | None = None
    ) -> None:
        """Start the process and make the object there. Raises ChildError, and what `make` raises.

        The limits hold for `make` and for each call. The time does not include the start of Python. Its folder
        lies in the folder `temporary`, if it is given. A process that may be killed gives one that another one removes.
        """
        self._limits = limits
        self._answers: SimpleQueue[Any] = SimpleQueue()
        self._waited = 0.0
        self._open = ExitStack()
        folder = self._open.enter_context(temporary_folder("rov-fmu-child-", temporary))
        folders = dict.fromkeys(("TMPDIR", "TEMP", "TMP", "SQLITE_TMPDIR"), folder)
        # A thread of OpenBLAS for each processor would reserve some 40 MB each.
        threads = {"OPENBLAS_NUM_THREADS": "1"} if limits.memory else {}
        with UNINTERRUPTED:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM.format([*map(os.path.abspath, sys.path)])],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=inherited({**folders, **threads}),
                cwd=folder,
                start_new_session=True,
            )
            self._open.enter_context(cleaned_up(self._kill))
        Thread(target=self._receive, daemon=True).start()
        try:
            self._send((make, arguments, limits))
            self._answer(Limits())  # Python has started and has imported the module of `make`
            self._answer(limits)
        except BaseException:
            self.close()
            raise

    def call(self, method: str, *arguments: Any, limits: Limits | None = None) -> Any:
        """Return what a method of the object returns, within other limits than those of the process if they are given.

        Raises its exceptions; after a ChildError the process is gone.
        """
        self._send((method, arguments, limits := limits or self._limits))
        return self._answer(limits)

    def clock(self) -> float:
        """Return the time of the wall clock without that in which the process waited for a processor, s.

        So a limit does not depend on what else the machine does. Only Linux tells it, of the thread of the calls.
        """
        with suppress(OSError, ValueError, IndexError):  # another system, or the process is gone
            told = Path(f"/proc/{self._process.pid}/schedstat").read_text(encoding="ascii")
            self._waited = 1e-9 * float(told.split()[1])
        return monotonic() - self._waited

    def close(self) -> None:
        """End the process, with those that it has started, and remove its temporary files."""
        self._open.close()

    def _kill(self) -> None:
        kill(self._process)
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

    def _answer(self, limits: Limits) -> Any:
        began = self.clock()
        while True:
            with suppress(Empty):
                answer = self._answers.get(timeout=_POLL)
                break
            if limits.time is not None and self.clock() - began > limits.time:
                self.close()
                raise LimitError("time", limits)
        if answer is None:
            how = cause(self._process.wait())
            self.close()
            raise ChildError(f"ended its process: {how}")
        result, error, exceeded, there = answer
        if exceeded:
            self.close()
            raise LimitError(exceeded, limits)
        if error:
            raise error from RuntimeError(f"in the child process:\n{there}")
        return result


class Functions:
    """The object of a child process that calls functions. They must be importable, since they are pickled by name."""

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return what a function returns."""
        return function(*arguments)


def inherited(changes: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of this process, with changes, for a process that works in another folder.

    There, a relative path would lead elsewhere, as `.venv/bin` of a PATH or `tmp` of a TMPDIR. So paths are absolute.
    """
    lists = {name: os.environ[name].split(os.pathsep) for name in _PATHS if os.environ.get(name)}
    return {
        **os.environ,
        **{name: os.pathsep.join(map(os.path.abspath, some)) for name, some in lists.items()},
        **changes,
    }


def kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process that leads a session of its own, with the processes that it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError, PermissionError):  # it has ended; macOS refuses this for a zombie
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def cause(exit_code: int) -> str:
    """Return in words how a process ended: the name of the signal that ended it, or its exit code."""
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


# ---- In the child process --------------------------------------------------------------------------------------------


def _serve() -> None:
    """Make the object and call its methods as long as the parent process lives."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    too_large: list[int] = []  # a file has become larger than the limit, even if a library does not tell why it failed
    if sys.platform == "linux":
        signal.signal(signal.SIGXFSZ, lambda number, _: too_large.append(number))
    answers = os.fdopen(os.dup(1), "wb")
    requests: SimpleQueue[Any] = SimpleQueue()

    def receive() -> None:
        """Queue the requests of the parent. When the parent has ended, end this process, even if a call hangs."""
        for request in _messages(sys.stdin.buffer):
            requests.put(request)
        os._exit(0)

    Thread(target=receive, daemon=True).start()
    function, arguments, limits = requests.get()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)  # an FMU or a parser may print
    os.dup2(nowhere, 2)
    _send(answers, (None, None, None, ""))
    target: Any = None
    while True:
        too_large.clear()
        try:
            with limits.applied():  # also of what takes memory while it is packed
                result = function(*arguments)
                if target is None:
                    target, result = result, None
                answer = pickle.dumps((result, None, None, ""), pickle.HIGHEST_PROTOCOL)
        except Exception as error:
            exceeded = _exceeded(error, limits) or ("disk" if too_large else None)
            there = "".join(format_exception(error))
            answer = pickle.dumps((None, None if exceeded else _portable(error), exceeded, there))
        result = None
        answers.write(answer)
        answers.flush()
        del answer  # the memory is free before the next call
        method, arguments, limits = requests.get()
        function = getattr(target, method)


def _exceeded(error: BaseException | None, limits: Limits) -> str | None:
    """Return the limit that an exception, or one that it follows from, is about."""
    while error:
        if limits.memory and (isinstance(error, MemoryError) or _NO_MEMORY.search(f"{type(error).__name__} {error}")):
            return "memory"
        if limits.disk and isinstance(error, OSError) and error.errno == errno.EFBIG:
            return "disk"
        error = error.__cause__ or error.__context__
    return None


def _portable(error: Exception) -> Exception:
    """Return an exception that can be sent: itself, or one with its text where pickle fails, as for many libraries."""
    try:
        pickle.loads(pickle.dumps(error))
        return error
    except Exception:
        return RuntimeError(reason_of(error))
