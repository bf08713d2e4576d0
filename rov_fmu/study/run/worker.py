"""The work of a Dask worker: it unpacks the FMU, and returns the rows of many runs, done in a child process."""

import io
import shutil
import signal
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from threading import current_thread, main_thread
from time import perf_counter

import numpy as np
import pandas as pd  # noqa: F401 (PyArrow would import it at the first table, which takes a third of a second)
import pyarrow as pa
import pyarrow.parquet as pq
from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from rov_fmu.prove.runs import Array
from rov_fmu.study.run.child import FAILED, Child, Run
from rov_fmu.study.run.simulator import Job

RUN, STATUS, REASON, TIME = "run", "status", "reason", "t"
"""The columns that every study has."""


@dataclass(frozen=True)
class Part:
    """The rows of consecutive runs, as Parquet files."""

    runs: bytes
    trajectories: bytes | None
    failed: int
    turned: int
    """The number of runs in which the vehicle turned over."""
    seconds: float
    """The time that the runs took."""


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


def do_runs(key: str, first: int, rows: Array) -> Part:
    """Do the runs from number `first` on, one for each row of values. Raises LoadError."""
    pool = _POOLS[key]
    with pool.lent() as child:
        began = perf_counter()
        found = child.runs(rows)
        seconds = perf_counter() - began
    trajectories = _trajectories(pool.job, first, found) if pool.job.plan.kept else None
    failed, turned = sum(run.status == FAILED for run in found), sum(run.turned for run in found)
    return Part(_runs(pool.job, first, rows, found), trajectories, failed, turned, seconds)


def _runs(job: Job, first: int, rows: Array, found: Sequence[Run]) -> bytes:
    """Return the table with one row for each run.

    Missing figures are null, because DuckDB and Polars skip it in a median but treat NaN as a large number.
    """
    figures = np.array([run.figures for run in found], float).T
    columns = [
        np.arange(first, first + len(rows)),
        *rows.T,
        *(pa.array(column, mask=np.isnan(column)) for column in figures),
        [run.status for run in found],
        [run.reason or None for run in found],
    ]
    numbers = [(name, pa.float64()) for name in (*job.varied, *job.plan.figures)]
    schema = pa.schema([(RUN, pa.int64()), *numbers, (STATUS, pa.string()), (REASON, pa.string())])
    return _parquet(pa.table([pa.array(column) for column in columns], schema=schema))


def _trajectories(job: Job, first: int, found: Sequence[Run]) -> bytes:
    """Return the table with a row for each kept time of each run that ended."""
    times = job.plan.times[np.array(job.plan.kept_points, int)]
    ended = [n for n, run in enumerate(found) if run.status != FAILED]
    table = {RUN: np.repeat(np.array(ended, int) + first, len(times)), TIME: np.tile(times, len(ended))}
    for index, name in enumerate(job.plan.kept):
        none = np.empty(0, job.model.variables[name].dtype(job.model.version))
        table[name] = np.concatenate([none, *(found[n].kept[index] for n in ended)])
    return _parquet(pa.table(table))


def _parquet(table: pa.Table) -> bytes:
    file = io.BytesIO()
    pq.write_table(table, file, compression="zstd")
    return file.getvalue()
