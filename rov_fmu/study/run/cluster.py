"""The runs of a study on workers of Dask: in tasks of about a second, and their rows written as they come."""

import asyncio
import logging
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, Security, as_completed, rpc
from distributed.comm.core import CommClosedError
from distributed.utils import silence_logging_cmgr

from rov_fmu.io.interrupts import ctrl_c_withheld, temporary_folder
from rov_fmu.io.messages import FileError, StudyError, brief
from rov_fmu.io.output import WriteError
from rov_fmu.study.plan.sampling import Design
from rov_fmu.study.results.store import Store
from rov_fmu.study.run.simulator import LoadError
from rov_fmu.study.run.worker import Delivery, Job, Part, Trial, do_runs, lost_runs, try_out

_TASK = 1.0
"""Seconds that a task shall take."""
_LEAST = 0.2
"""Seconds that a task takes at least, where the runs come to their end."""
_AHEAD = 3
"""Tasks by thread that are given out, so that none waits for the next one."""
_CHANCES = 3
"""How often workers may die until all runs are done apart from them, and then those of a task until it is given up."""
_GONE = (CancelledError, CommClosedError)
"""What Dask raises where there is no scheduler any more."""
_GUARD = 'a script calls study under `if __name__ == "__main__":`, for each worker begins by importing it'
_WAIT = 10.0
"""Seconds until a scheduler, or a worker of it, must have answered."""


@dataclass(frozen=True)
class Progress:
    """How far a study is."""

    done: int
    """Runs, those of before included."""
    total: int
    failed: int
    """Of those that were done this time."""
    dashboard: str
    """Dask's page on what its workers do; nothing where there is none."""


@dataclass
class Spent:
    """Where the time went."""

    runs: int = 0
    failed: int = 0
    started: float = 0.0
    """Seconds that it took to start the workers."""
    elapsed: float = 0.0
    """Seconds from then until the last run was done."""
    working: float = 0.0
    """Seconds of all workers together."""
    simulating: float = 0.0
    """Seconds of these that the FMU took."""


def execute(
    job: Job,
    design: Design,
    store: Store,
    workers: int | None = None,
    scheduler: str | None = None,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Spent:
    """Do the runs that are missing in the store. Raises FileError, StudyError, WriteError, and KeyboardInterrupt."""
    spent, begin = Spent(), perf_counter()
    missing = deque(store.missing(design.runs))
    if not missing:
        return spent
    with _client(workers, scheduler) as client:
        _deliver(client, Delivery(job, own_cluster=scheduler is None))
        spent.started = perf_counter() - begin
        begin += spent.started
        try:
            _Runs(client, job, design, store, missing, spent, on_progress).do()
        except (FileError, StudyError, WriteError):
            raise
        except Exception as error:  # of a client that is closed, for it has lost its scheduler, this and that
            if isinstance(error, _GONE) or client.status != "running":
                raise StudyError("the scheduler is gone; what is done is kept") from error
            raise
        finally:
            spent.elapsed = perf_counter() - begin
            if scheduler is not None:
                with suppress(Exception):  # that scheduler may be gone
                    client.unregister_worker_plugin(job.key)
    return spent


class _Runs:
    """The runs that are under way."""

    def __init__(
        self,
        client: Client,
        job: Job,
        design: Design,
        store: Store,
        missing: deque[tuple[int, int]],
        spent: Spent,
        on_progress: Callable[[Progress], None],
    ) -> None:
        self._client, self._job, self._design, self._store = client, job, design, store
        self._missing, self._spent, self._tell = missing, spent, on_progress
        self._there = design.runs - sum(end - first for first, end in missing)
        self._futures: dict[Any, tuple[int, int, bool]] = {}
        """First run, the one after the last, whether they are done apart from their worker."""
        self._lost: deque[tuple[int, int]] = deque()
        """Runs whose worker died, to be done apart."""
        self._deaths = 0
        self._chances: Counter[int] = Counter()
        self._resets, self._seconds = False, _TASK

    def do(self) -> None:
        """All of them."""
        self._report()
        trial = self._trial()
        self._resets, self._seconds = trial.resets, max(trial.seconds, 1e-6)
        coming = as_completed(loop=self._client.loop, raise_errors=False)
        try:
            self._give(coming)
            for future in coming:
                self._take(future)
                del future  # or its rows would stay
                self._give(coming)
        finally:
            with suppress(Exception):  # a client that is closed raises
                self._client.cancel(list(self._futures), force=True)

    def _trial(self) -> Trial:
        first = self._missing[0][0]
        rows = self._design.rows(first, min(first + 8, self._design.runs))
        for apart in (False, True):
            try:
                return self._client.submit(try_out, self._job.key, rows, apart, pure=False).result()
            except LoadError as error:
                raise FileError(f"{self._job.model.name}: cannot be run: {error}") from error
            except KilledWorker:
                self._deaths += 1
        return Trial(False, _TASK)

    def _give(self, coming: Any) -> None:
        """Have enough under way."""
        try:
            threads = sum(self._client.nthreads().values()) or 1
        except OSError as error:
            raise CommClosedError("no answer") from error
        while (self._lost or self._missing) and len(self._futures) < _AHEAD * threads:
            if self._lost:
                self._submit(coming, *self._lost.popleft(), apart=True)
                continue
            first, end = self._missing.popleft()
            left = sum(b - a for a, b in self._missing) + end - first
            size = max(min(ceil(_TASK / self._seconds), ceil(left / threads)), ceil(_LEAST / self._seconds))
            if end - first > size:
                self._missing.appendleft((first + size, end))
                end = first + size
            self._submit(coming, first, end, apart=self._deaths >= _CHANCES)

    def _submit(self, coming: Any, first: int, end: int, apart: bool) -> None:
        rows = self._design.rows(first, end)
        future = self._client.submit(do_runs, self._job.key, first, rows, self._resets, apart, pure=False)
        self._futures[future] = first, end, apart
        coming.add(future)

    def _take(self, future: Any) -> None:
        """Write what has come; what was lost is done again."""
        first, end, apart = self._futures.pop(future)
        try:
            part: Part = future.result()
        except KilledWorker as error:
            self._again(first, end, apart, error)
            return
        except LoadError as error:
            raise FileError(f"{self._job.model.name}: cannot be run on a worker: {error}") from error
        except _GONE:
            raise
        except Exception as error:  # of the cluster
            raise StudyError(f"the workers are lost: {brief(str(error) or type(error).__name__)}") from error
        self._write(first, end, part)
        self._spent.working += part.seconds
        self._spent.simulating += part.simulating
        self._seconds = max(part.seconds / (end - first), 1e-6)

    def _again(self, first: int, end: int, apart: bool, error: KilledWorker) -> None:
        """Runs whose worker died are done apart from it: it is told then which of them is the cause, and why."""
        self._deaths += 1
        self._chances[first] += apart
        if self._chances[first] < _CHANCES:
            self._lost.append((first, end))
            return
        rows = self._design.rows(first, end)
        self._write(first, end, lost_runs(self._job, first, rows, f"its worker died: {brief(str(error))}"))

    def _write(self, first: int, end: int, part: Part) -> None:
        self._store.write(first, end, part.runs, part.trajectories)
        self._spent.runs += end - first
        self._spent.failed += part.failed
        self._report()

    def _report(self) -> None:
        link = self._client.dashboard_link
        self._tell(Progress(self._there + self._spent.runs, self._design.runs, self._spent.failed, link or ""))


def _deliver(client: Client, delivery: Delivery) -> None:
    try:
        client.register_plugin(delivery)
    except Exception as error:  # whatever a worker may raise
        told = brief(str(error))
        raise StudyError(f"a worker cannot take the study; it needs the same rov-fmu[study] as here: {told}") from error


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Client]:
    """Workers of this machine, a process and a thread each, or those of a scheduler. Raises FileError."""
    if scheduler is not None:
        _see(scheduler)
        with silence_logging_cmgr(logging.CRITICAL), Client(scheduler, timeout=_WAIT, set_as_default=False) as client:
            try:
                client.wait_for_workers(1, timeout=_WAIT)
            except TimeoutError:
                raise FileError(f"--scheduler {scheduler}: it has no workers") from None
            yield client
        return
    settings = {
        "distributed.scheduler.allowed-failures": 0,  # a task is divided then, until the run is found
        "distributed.worker.memory.terminate": False,
        "distributed.worker.profile.enabled": False,  # it takes the interpreter from the steps a hundred times a second
    }
    with (
        temporary_folder("study-") as folder,
        dask.config.set({**settings, "temporary-directory": folder}),
        _started(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _started(**options: Any) -> LocalCluster:
    """Start the workers. Raises StudyError."""
    script = getattr(sys.modules["__main__"], "__file__", None)
    if script and not Path(script).exists():
        raise StudyError(f"workers cannot be started of {script}, which is no file; {_GUARD}")
    try:
        with ctrl_c_withheld():
            return LocalCluster(**options)
    except RuntimeError:
        raise StudyError(f"the workers do not start; {_GUARD}") from None


def _see(scheduler: str) -> None:
    """That a scheduler answers: a client without one waits, and says more than a line. Raises FileError."""

    async def ask() -> bool:
        async with rpc(scheduler, connection_args=Security().get_connection_args("client")) as there:
            return bool((await asyncio.wait_for(there.identity(), _WAIT))["type"] == "Scheduler")

    try:
        with ThreadPoolExecutor(1) as other:  # a notebook has a loop of its own in this thread
            is_there = other.submit(asyncio.run, ask()).result()
    except Exception:  # whatever else is there may answer
        is_there = False
    if not is_there:
        raise FileError(f"--scheduler {scheduler}: no scheduler of Dask answers there")
