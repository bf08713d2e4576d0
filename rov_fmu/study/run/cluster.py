"""Do the runs of a study on Dask workers, in tasks of about a second, and write the rows of each task as it ends."""

import asyncio
import logging
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from threading import Event, Thread
from time import perf_counter
from typing import Any

import dask
from distributed import Client, LocalCluster, Security, as_completed, rpc
from distributed.comm.core import CommClosedError
from distributed.utils import silence_logging_cmgr

from rov_fmu.io.interrupts import ctrl_c_withheld, temporary_folder
from rov_fmu.io.messages import FileError, StudyError, brief, reason_of
from rov_fmu.io.output import WriteError
from rov_fmu.study.plan.sampling import Design
from rov_fmu.study.results.store import Store
from rov_fmu.study.run.simulator import Job, LoadError
from rov_fmu.study.run.worker import Delivery, Part, do_runs

_TASK = 1.0
"""The seconds that a task should take."""
_LEAST = 0.2
"""The least seconds of a task, also when few runs remain."""
_AHEAD = 3
"""The number of tasks submitted for each thread, so that no thread waits for the next one."""
_GONE = (CancelledError, CommClosedError)
"""Exceptions of Dask when the scheduler is gone."""
_GUARD = 'a script calls study under `if __name__ == "__main__":`, for each worker begins by importing it'
_WATCH = 2.0
"""The seconds after which it is asked again whether workers are there."""
_WAIT = 10.0
"""The seconds within which a scheduler or a worker must answer."""


@dataclass(frozen=True)
class Progress:
    """The progress of a study."""

    done: int
    """The number of runs that are done, including those of earlier calls."""
    total: int
    failed: int
    """The number of runs that failed in this call."""
    dashboard: str
    """The address of Dask's page about its workers, or an empty text."""
    has_workers: bool = True
    """False while no worker is there, so that nothing is done."""


@dataclass
class Spent:
    """The runs that one call did, and the time that it took."""

    runs: int = 0
    failed: int = 0
    turned: int = 0
    """The number of these runs in which the vehicle turned over."""
    started: float = 0.0
    """The seconds until the workers had started."""
    elapsed: float = 0.0
    """The seconds from then until the last run was done."""


def execute(
    job: Job,
    design: Design,
    store: Store,
    workers: int | None,
    scheduler: str | None,
    on_progress: Callable[[Progress], None],
) -> Spent:
    """Do the runs that are missing in the store. Raises FileError, StudyError, WriteError, and KeyboardInterrupt."""
    spent, begin = Spent(), perf_counter()
    missing = deque(store.missing(design.runs))
    if not missing:
        return spent
    with _client(workers, scheduler) as client:
        try:
            client.register_plugin(Delivery(job, own_cluster=scheduler is None))
        except Exception as error:  # whatever a worker may raise
            needs = "a worker cannot run the study. It needs the same version of rov-fmu[study] as this machine"
            raise StudyError(f"{needs}: {brief(reason_of(error))}") from error
        spent.started = perf_counter() - begin
        begin += spent.started
        try:
            _Runs(client, job, design, store, missing, spent, on_progress).do()
        except (FileError, StudyError, WriteError):
            raise
        except Exception as error:  # a client that has lost its scheduler raises various exceptions
            if isinstance(error, _GONE) or client.status != "running":
                raise StudyError("the connection to the scheduler is lost. Finished runs are kept") from error
            raise
        finally:
            spent.elapsed = perf_counter() - begin
            if scheduler is not None:
                with suppress(Exception):  # that scheduler may be gone
                    client.unregister_worker_plugin(job.key)
    return spent


@dataclass
class _Runs:
    """Gives the missing runs to the workers and writes their rows."""

    client: Client
    job: Job
    design: Design
    store: Store
    missing: deque[tuple[int, int]]
    spent: Spent
    on_progress: Callable[[Progress], None]
    seconds: float = _TASK
    """The time of a run, by the last task; the first tasks have one run each."""
    futures: dict[Any, tuple[int, int]] = field(default_factory=dict)
    """For each future: its first run, and the run after its last one."""

    def do(self) -> None:
        """Do all missing runs."""
        self.done_before = self.design.runs - sum(end - first for first, end in self.missing)
        self._report()
        coming, ended = as_completed(loop=self.client.loop), Event()
        Thread(target=self._watch, args=(ended,), daemon=True).start()
        try:
            self._submit_tasks(coming)
            for future in coming:
                self._take(future)
                del future  # otherwise its rows stay in memory
                self._submit_tasks(coming)
        finally:
            ended.set()
            with suppress(Exception):  # a client that is closed raises
                self.client.cancel(list(self.futures), force=True)

    def _submit_tasks(self, coming: Any) -> None:
        """Submit tasks until every thread has enough."""
        try:
            threads = sum(self.client.nthreads().values()) or 1
        except OSError as error:
            raise CommClosedError("no answer") from error
        while self.missing and len(self.futures) < _AHEAD * threads:
            first, end = self.missing.popleft()
            remaining = sum(b - a for a, b in self.missing) + end - first
            size = max(min(ceil(_TASK / self.seconds), ceil(remaining / threads)), ceil(_LEAST / self.seconds))
            if end - first > size:
                self.missing.appendleft((first + size, end))
                end = first + size
            future = self.client.submit(do_runs, self.job.key, first, self.design.rows(first, end), pure=False)
            self.futures[future] = first, end
            coming.add(future)

    def _take(self, future: Any) -> None:
        """Write the rows of a task. Dask itself repeats a task whose worker died."""
        first, end = self.futures.pop(future)
        try:
            part: Part = future.result()
        except LoadError as error:
            raise FileError(f"{self.job.model.name}: cannot be run: {error}") from error
        except _GONE:
            raise
        except Exception as error:  # the cluster raises various exceptions
            raise StudyError(f"the workers are lost: {brief(reason_of(error))}") from error
        self.store.write(first, end, part.runs, part.trajectories)
        self.spent.runs += end - first
        self.spent.failed += part.failed
        self.spent.turned += part.turned
        self.seconds = max(part.seconds / (end - first), 1e-6)
        self._report()

    def _watch(self, ended: Event) -> None:
        """Report again and again while no worker is there, until the runs end."""
        with suppress(Exception):  # a client that is closed, or has lost its scheduler, raises
            while not ended.wait(_WATCH):
                if not self.client.nthreads() and not ended.is_set():
                    self._report(has_workers=False)

    def _report(self, *, has_workers: bool = True) -> None:
        done, link = self.done_before + self.spent.runs, self.client.dashboard_link or ""
        self.on_progress(Progress(done, self.design.runs, self.spent.failed, link, has_workers))


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Client]:
    """Connect to a scheduler, or start workers on this machine with one thread each. Raises FileError."""
    if scheduler is not None:
        _check_scheduler(scheduler)
        with silence_logging_cmgr(logging.CRITICAL), Client(scheduler, timeout=_WAIT, set_as_default=False) as client:
            try:
                client.wait_for_workers(1, timeout=_WAIT)
            except TimeoutError:
                raise FileError(f"--scheduler {scheduler}: it has no workers") from None
            yield client
        return
    settings = {
        "distributed.worker.memory.terminate": False,
        "distributed.worker.profile.enabled": False,  # it interrupts the steps a hundred times a second
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
    """Start workers on this machine. Raises StudyError."""
    script = getattr(sys.modules["__main__"], "__file__", None)
    if script and not Path(script).exists():
        raise StudyError(f"workers cannot be started, because {script} is not a file; {_GUARD}")
    try:
        with ctrl_c_withheld():
            return LocalCluster(**options)
    except RuntimeError:
        raise StudyError(f"the workers do not start; {_GUARD}") from None


def _check_scheduler(scheduler: str) -> None:
    """Raise FileError if no scheduler answers. Without this check, the client would wait and print many lines."""

    async def ask() -> bool:
        async with rpc(scheduler, connection_args=Security().get_connection_args("client")) as there:
            return bool((await asyncio.wait_for(there.identity(), _WAIT))["type"] == "Scheduler")

    try:
        with ThreadPoolExecutor(1) as other:  # in a notebook, this thread already has an event loop
            is_there = other.submit(asyncio.run, ask()).result()
    except Exception:  # another kind of server may answer anything
        is_there = False
    if not is_there:
        raise FileError(f"--scheduler {scheduler}: no scheduler of Dask answers there")
