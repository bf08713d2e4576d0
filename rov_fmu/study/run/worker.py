"""The work of a Dask worker: it unpacks the FMU, and returns the rows of many runs, done in a child process."""

import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import current_thread, main_thread
from time import perf_counter

from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from rov_fmu.study.plan.figures import Array
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.run.child import Child
from rov_fmu.study.run.run import Rows, rows_of


class _Pool:
    """The child processes of one worker. Each is lent to one thread at a time, and then used again."""

    def __init__(self, job: Job, folder: Path) -> None:
        self.job = replace(job, model=replace(job.model, content=b""))
        self._folder = Path(tempfile.mkdtemp(prefix="fmu-", dir=folder)).absolute()
        job.model.unpack(self._folder)
        self._idle: list[Child] = []

    @contextmanager
    def lent(self) -> Iterator[Child]:
        """Lend a child process. Raises LoadError."""
        child = self._idle.pop() if self._idle else Child(str(self._folder), self.job)
        yield child
        self._idle.append(child)

    def close(self) -> None:
        """End the processes and delete the files."""
        for child in self._idle:
            child.close()
        shutil.rmtree(self._folder, ignore_errors=True)


_POOLS: dict[str, _Pool] = {}
"""The pools of this process, by the key of the study."""


class Delivery(WorkerPlugin):
    """Brings a study to every worker, including those that are started or restarted later."""

    def __init__(self, job: Job, own_cluster: bool) -> None:
        self.name = job.key
        self._job, self._own = job, own_cluster

    def setup(self, worker: Worker) -> None:
        """Prepare a worker; Dask calls this when the worker starts."""
        if self._own and current_thread() is main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the process that started the workers handles Ctrl-C
        _POOLS[self.name] = _Pool(self._job, Path(worker.local_directory))

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002 (Dask passes it)
        """Clean up; Dask calls this when the study ends."""
        if pool := _POOLS.pop(self.name, None):
            pool.close()


def do_runs(key: str, first: int, values: Array) -> Rows:
    """Do the runs from number `first` on, one for each row of values. Raises LoadError."""
    pool = _POOLS[key]
    with pool.lent() as child:
        began = perf_counter()
        found = child.runs(values)
        seconds = perf_counter() - began
    return rows_of(pool.job, first, values, found, seconds)
