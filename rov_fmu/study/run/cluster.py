"""Do the runs of a study on Dask workers, in tasks of about a second, and write the rows of each task as it ends.

A worker unpacks the FMU once, and has a child process for each of its threads.
"""

import asyncio
import logging
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from math import ceil
from pathlib import Path
from threading import current_thread, main_thread
from time import perf_counter
from typing import Any

import dask
from distributed import Client, LocalCluster, Security, Worker, as_completed, rpc
from distributed.comm.core import CommClosedError
from distributed.diagnostics.plugin import WorkerPlugin
from distributed.utils import silence_logging_cmgr

from rov_fmu.fmus.instance import Array, LoadError
from rov_fmu.io.interrupts import ctrl_c_withheld, temporary_folder
from rov_fmu.io.messages import FileError, RovError, StudyError, brief, reason_of
from rov_fmu.study.plan.study import Study
from rov_fmu.study.results.store import Span
from rov_fmu.study.run.child import Child
from rov_fmu.study.run.run import Rows, rows_of
from rov_fmu.study.run.work import Work

_TASK = 1.0
"""The seconds that a task should take."""
_LEAST = 0.2
"""The least seconds of a task, also when few runs remain."""
_AHEAD = 3
"""The number of tasks submitted for each thread, so that no thread waits for the next one."""
_GUARD = 'a script calls study under `if __name__ == "__main__":`, for each worker begins by importing it'
_WAIT = 10.0
"""The seconds within which a scheduler must answer."""


def do_on_cluster(work: Work, workers: int | None, scheduler: str | None) -> None:
    """Do all missing runs, on so many workers of this machine or on those of a scheduler.

    Raises FileError, LoadError, StudyError, WriteError, and KeyboardInterrupt.
    """
    began = perf_counter()
    with _client(workers, scheduler) as client:
        try:
            client.register_plugin(Delivery(work.study, own_cluster=scheduler is None))
        except Exception as error:  # whatever a worker may raise
            needs = "a worker cannot run the study. It needs the same version of rov-fmu[study] as this machine"
            raise StudyError(f"{needs}: {brief(reason_of(error))}") from error
        work.started = perf_counter() - began
        work.dashboard = client.dashboard_link or ""
        try:
            with work.watched(lambda: len(client.nthreads())):
                _do_tasks(work, client)
        except RovError:
            raise
        except Exception as error:  # a client that has lost its scheduler raises various exceptions
            if isinstance(error, CancelledError | OSError) or client.status != "running":
                raise StudyError("the connection to the scheduler is lost. Finished runs are kept") from error
            raise
        finally:
            work.elapsed = perf_counter() - began - work.started
            if scheduler is not None:
                with suppress(Exception):  # that scheduler may be gone
                    client.unregister_worker_plugin(work.study.key)


def _do_tasks(work: Work, client: Client) -> None:
    """Give the missing runs to the workers, and write their rows. Dask repeats a task whose worker died."""
    seconds = _TASK  # of a run, by the last task; the first tasks have one run each
    spans, coming = dict[Any, Span](), as_completed(loop=client.loop)

    try:
        while work.missing or spans:
            threads = sum(client.nthreads().values()) or 1
            while work.missing and len(spans) < _AHEAD * threads:
                size = max(min(ceil(_TASK / seconds), ceil(work.left / threads)), ceil(_LEAST / seconds))
                first, end = work.take(size)
                future = client.submit(do_runs, work.study.key, first, work.design.rows(first, end), pure=False)
                spans[future] = first, end
                coming.add(future)
            future = next(coming)
            first, end = spans.pop(future)
            try:
                rows: Rows = future.result()
            except (LoadError, CancelledError, CommClosedError):
                raise
            except Exception as error:  # the cluster raises various exceptions
                raise StudyError(f"the workers are lost: {brief(reason_of(error))}") from error
            work.write((first, end), rows)
            seconds = max(rows.seconds / (end - first), 1e-6)
            del future, rows  # otherwise they stay in memory
    finally:
        with suppress(Exception):  # a client that is closed raises
            client.cancel([*spans], force=True)


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
        _local_cluster(workers) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _local_cluster(workers: int | None) -> LocalCluster:
    """Start workers on this machine. Raises StudyError."""
    script = getattr(sys.modules["__main__"], "__file__", None)
    if script and not Path(script).exists():
        raise StudyError(f"workers cannot be started, because {script} is not a file; {_GUARD}")
    try:
        with ctrl_c_withheld():
            return LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
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


# ---- On a worker -----------------------------------------------------------------------------------------------------


class Delivery(WorkerPlugin):
    """Brings a study to every worker, including those that are started or restarted later."""

    def __init__(self, study: Study, own_cluster: bool) -> None:
        self.name, self._study, self._own = study.key, study, own_cluster
        self._idle = list[Child]()
        """The child processes that no thread uses."""

    def setup(self, worker: Worker) -> None:
        """Prepare a worker; Dask calls this when the worker starts."""
        if self._own and current_thread() is main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the process that started the workers handles Ctrl-C
        self._folder = Path(tempfile.mkdtemp(prefix="fmu-", dir=worker.local_directory)).absolute()
        self._study = self._study.unpacked(self._folder)
        _DELIVERED[self.name] = self

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002 (Dask passes it)
        """Clean up; Dask calls this when the study ends."""
        if _DELIVERED.pop(self.name, None):
            for child in self._idle:
                child.close()
            shutil.rmtree(self._folder, ignore_errors=True)

    def rows(self, first: int, values: Array) -> Rows:
        """Do the runs from number `first` on, one for each row of values. Raises LoadError."""
        child = self._idle.pop() if self._idle else Child(str(self._folder), self._study)
        began = perf_counter()
        found = child.runs(values)
        seconds = perf_counter() - began
        self._idle.append(child)
        return rows_of(self._study, first, values, found, seconds)


_DELIVERED: dict[str, Delivery] = {}
"""The studies of this process, by their keys."""


def do_runs(key: str, first: int, values: Array) -> Rows:
    """Do the runs of a study that this worker has."""
    return _DELIVERED[key].rows(first, values)
