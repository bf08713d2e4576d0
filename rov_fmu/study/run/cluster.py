"""Do the runs of a study on Dask workers, in tasks of about a second, and write the rows of each task as it ends."""

import asyncio
import logging
import sys
from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Any

import dask
from distributed import Client, LocalCluster, Security, as_completed, rpc
from distributed.comm.core import CommClosedError
from distributed.utils import silence_logging_cmgr

from rov_fmu.fmus.instance import LoadError
from rov_fmu.io.interrupts import ctrl_c_withheld, temporary_folder
from rov_fmu.io.messages import FileError, StudyError, brief, reason_of
from rov_fmu.io.output import WriteError
from rov_fmu.study.run.run import Rows
from rov_fmu.study.run.work import Work
from rov_fmu.study.run.worker import Delivery, do_runs

_TASK = 1.0
"""The seconds that a task should take."""
_LEAST = 0.2
"""The least seconds of a task, also when few runs remain."""
_AHEAD = 3
"""The number of tasks submitted for each thread, so that no thread waits for the next one."""
_GONE = (CancelledError, CommClosedError)
"""Exceptions of Dask when the scheduler is gone."""
_GUARD = 'a script calls study under `if __name__ == "__main__":`, for each worker begins by importing it'
_WAIT = 10.0
"""The seconds within which a scheduler must answer."""


def do_on_cluster(work: Work, workers: int | None, scheduler: str | None) -> None:
    """Do all missing runs, on so many workers of this machine or on those of a scheduler.

    Raises FileError, LoadError, StudyError, WriteError, and KeyboardInterrupt.
    """
    job, spent, begin = work.job, work.spent, perf_counter()
    with _client(workers, scheduler) as client:
        try:
            client.register_plugin(Delivery(job, own_cluster=scheduler is None))
        except Exception as error:  # whatever a worker may raise
            needs = "a worker cannot run the study. It needs the same version of rov-fmu[study] as this machine"
            raise StudyError(f"{needs}: {brief(reason_of(error))}") from error
        spent.started = perf_counter() - begin
        begin += spent.started
        work.dashboard = client.dashboard_link or ""
        try:
            with work.watched(lambda: len(client.nthreads())):
                _Tasks(client, work).do()
        except (FileError, LoadError, StudyError, WriteError):
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


@dataclass
class _Tasks:
    """Gives the missing runs to the workers and writes their rows."""

    client: Client
    work: Work
    seconds: float = _TASK
    """The time of a run, by the last task; the first tasks have one run each."""
    futures: dict[Any, tuple[int, int]] = field(default_factory=dict)
    """For each future: its first run, and the run after its last one."""

    def do(self) -> None:
        """Do all missing runs."""
        coming = as_completed(loop=self.client.loop)
        try:
            self._submit(coming)
            for future in coming:
                self._take(future)
                del future  # otherwise its rows stay in memory
                self._submit(coming)
        finally:
            with suppress(Exception):  # a client that is closed raises
                self.client.cancel(list(self.futures), force=True)

    def _submit(self, coming: Any) -> None:
        """Submit tasks until every thread has enough."""
        work = self.work
        try:
            threads = sum(self.client.nthreads().values()) or 1
        except OSError as error:
            raise CommClosedError("no answer") from error
        while work.missing and len(self.futures) < _AHEAD * threads:
            size = max(min(ceil(_TASK / self.seconds), ceil(work.left / threads)), ceil(_LEAST / self.seconds))
            first, end = work.take(size)
            future = self.client.submit(do_runs, work.job.key, first, work.design.rows(first, end), pure=False)
            self.futures[future] = first, end
            coming.add(future)

    def _take(self, future: Any) -> None:
        """Write the rows of a task. Dask itself repeats a task whose worker died."""
        first, end = self.futures.pop(future)
        try:
            rows: Rows = future.result()
        except (LoadError, *_GONE):
            raise
        except Exception as error:  # the cluster raises various exceptions
            raise StudyError(f"the workers are lost: {brief(reason_of(error))}") from error
        self.work.write(first, end, rows)
        self.seconds = max(rows.seconds / (end - first), 1e-6)


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Client]:
    """Connect to a scheduler, or start workers on this machine with one thread each. Raises FileError."""
    if scheduler is not None:
        _check_scheduler(scheduler)
        with silence_logging_cmgr(logging.CRITICAL), Client(scheduler, timeout=_WAIT, set_as_default=False) as client:
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
