"""What a worker does: it has the FMU unpacked, an instance a thread, and makes the rows of many runs at a time."""

import io
import os
import shutil
import signal
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Lock, Thread, current_thread, get_ident, main_thread
from time import monotonic, perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd  # noqa: F401 (PyArrow does, which takes a third of a second, at the first table)
import pyarrow as pa
import pyarrow.parquet as pq
from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from rov_fmu.study.plan.figures import Figures
from rov_fmu.study.plan.model import Model
from rov_fmu.study.run.separate_simulator import SeparateSimulator
from rov_fmu.study.run.simulator import Manoeuvre, RunError, Simulator

Array = npt.NDArray[np.float64]
RUN, STATUS, REASON, TIME = "run", "status", "reason", "t"
"""Columns that every study has."""
DONE, INCOMPLETE, FAILED = "done", "incomplete", "failed"
"""Statuses: all there; the run was done, and a figure cannot be computed; the run was not done to its end."""
_TRIED = 8
"""Runs of which one that ends is sought, to try the FMU with."""


@dataclass(frozen=True)
class Job:
    """All that workers must know of a study; it travels to each of them once."""

    key: str
    """Of this study among others on the same workers."""
    model: Model
    manoeuvre: Manoeuvre
    figures: Mapping[str, str]
    kept: Sequence[str]
    """Outputs of which the trajectory is kept."""
    kept_points: Sequence[int]
    """At which communication points."""
    time_limit: float
    """Seconds that a run may take."""

    @property
    def runs_schema(self) -> pa.Schema:
        """Of the table with a row a run."""
        numbers = [(name, pa.float64()) for name in (*self.manoeuvre.varied, *self.figures)]
        return pa.schema([(RUN, pa.int64()), *numbers, (STATUS, pa.string()), (REASON, pa.string())])


@dataclass(frozen=True)
class Part:
    """The rows of some runs, one after another, as Parquet files."""

    runs: bytes
    trajectories: bytes | None
    failed: int
    seconds: float
    """How long a worker had to do with it."""
    simulating: float
    """How much of that the FMU took."""


@dataclass(frozen=True)
class Trial:
    """What was found of the FMU before the study."""

    resets: bool
    """Whether a run after a reset is to the bit the one in a new instance."""
    seconds: float
    """That a run takes."""


class InstancePool:
    """The FMU on one worker. Instances are lent to a thread at a time, and used again."""

    def __init__(self, job: Job, folder: Path, is_watched: bool) -> None:
        self.job = job
        self._folder = Path(tempfile.mkdtemp(prefix="fmu-", dir=folder))
        self._description = job.model.unpack(self._folder)
        self._idle: dict[bool, list[tuple[Simulator | SeparateSimulator, Figures]]] = {False: [], True: []}
        self._one_only = Lock() if job.model.once_per_process else None
        self._is_watched = is_watched
        self._ends: dict[int, float] = {}
        self._closed = Event()
        if is_watched:
            Thread(target=self._watch, daemon=True).start()

    @contextmanager
    def lent(self, apart: bool) -> Iterator[tuple[Simulator | SeparateSimulator, Figures]]:
        """An instance, ready for a run; in a process of its own where asked for. Raises LoadError.

        A worker that nobody starts again when its process ends has all of them so.
        """
        apart = apart or not self._is_watched
        if self._one_only and not apart:
            self._one_only.acquire()
        try:
            self.begin(apart)
            yield (tools := self._tools(apart))
            self._idle[apart].append(tools)
        finally:
            self._ends.pop(get_ident(), None)
            if self._one_only and not apart:
                self._one_only.release()

    def begin(self, apart: bool) -> None:
        """A run begins: the worker's process ends where it takes too long, for nothing else ends such a run."""
        if self._is_watched and not apart:
            self._ends[get_ident()] = monotonic() + self.job.time_limit

    def close(self) -> None:
        """End the instances; the files go."""
        self._closed.set()
        for simulator, _ in (*self._idle[False], *self._idle[True]):
            simulator.free()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _tools(self, apart: bool) -> tuple[Simulator | SeparateSimulator, Figures]:
        if self._idle[apart]:
            return self._idle[apart].pop()
        job, folder = self.job, str(self._folder)
        simulator = (
            SeparateSimulator(folder, replace(job.model, content=b""), job.manoeuvre, job.time_limit)
            if apart
            else Simulator(folder, self._description, job.model, job.manoeuvre)
        )
        return simulator, Figures(job.figures, job.manoeuvre.times)

    def _watch(self) -> None:
        while not self._closed.wait(min(1.0, 0.25 * self.job.time_limit)):
            now = monotonic()
            if any(end < now for end in [*self._ends.values()]):
                os._exit(1)


_SHOPS: dict[str, InstancePool] = {}
"""Of this process, by the key of the study."""


class Delivery(WorkerPlugin):
    """Brings a study to every worker, those that come later or anew among them."""

    def __init__(self, job: Job, own_cluster: bool) -> None:
        self.name = job.key
        self._job, self._own = job, own_cluster

    def setup(self, worker: Worker) -> None:
        """Called on a worker as it comes."""
        if self._own and current_thread() is main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that has started these
            warnings.simplefilter("ignore", RuntimeWarning)  # of NumPy: what is NaN is told of the run
        _SHOPS[self.name] = InstancePool(self._job, Path(worker.local_directory), is_watched=worker.nanny is not None)

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002 (as it is called)
        """Called as the study ends."""
        if shop := _SHOPS.pop(self.name, None):
            shop.close()


def try_out(key: str, rows: Array, apart: bool) -> Trial:
    """Whether a run after a reset, which came after another run, is as the first one. Raises LoadError."""
    shop = _SHOPS[key]
    with shop.lent(apart) as (simulator, _):
        start = perf_counter()
        for values in rows[:_TRIED]:
            shop.begin(apart)
            simulator.renew()
            try:
                first = _copied(simulator.run(values))
                taken = perf_counter() - start
                for other in (rows[-1], values):
                    simulator.reset()
                    again = simulator.run(other)
            except RunError:
                start = perf_counter()
                continue
            same = all(np.array_equal(first[name], again[name], equal_nan=True) for name in first)
            simulator.renew()
            return Trial(same, taken)
        simulator.renew()
        return Trial(False, (perf_counter() - start) / len(rows[:_TRIED]))


def do_runs(key: str, first: int, rows: Array, resets: bool, apart: bool) -> Part:
    """Do the runs from this number on, a row of values each; in a process of their own or not. Raises LoadError."""
    began, simulating, failed = perf_counter(), 0.0, 0
    shop = _SHOPS[key]
    job = shop.job
    m = job.manoeuvre
    figures = np.full((len(rows), len(job.figures)), np.nan)
    points = np.array(job.kept_points, int)
    every = len(points) == m.steps + 1
    kept = [np.empty((len(rows), len(points)), job.model.variables[name].dtype(job.model.version)) for name in job.kept]
    statuses, reasons, ended = [], [], np.ones(len(rows), bool)
    with shop.lent(apart) as (simulator, figures_of):
        for n, values in enumerate(rows):
            shop.begin(apart)
            start = perf_counter()
            try:
                run = simulator.run(values)
            except RunError as error:
                statuses.append(FAILED)
                reasons.append(str(error))
                ended[n] = False
                continue
            finally:
                simulating += perf_counter() - start
            for place, name in zip(kept, job.kept, strict=True):
                place[n] = run[name] if every else run[name][points]
            reason = ""
            if job.figures:
                figures[n], reason = figures_of.of({**dict(zip(m.varied, values.tolist(), strict=True)), **run})
            statuses.append(INCOMPLETE if reason else DONE)
            reasons.append(reason)
            start = perf_counter()
            if resets:
                simulator.reset()
            else:
                simulator.renew()
            simulating += perf_counter() - start
    numbers = np.arange(first, first + len(rows))
    table = _runs_table(job, first, rows, figures, statuses, reasons)
    trajectories = None
    if job.kept:
        whole = slice(None) if ended.all() else ended  # which is no copy
        times = np.tile(m.times[points], int(ended.sum()))
        long = {RUN: np.repeat(numbers[whole], len(points)), TIME: times}
        long |= {name: place[whole].ravel() for name, place in zip(job.kept, kept, strict=True)}
        trajectories = _parquet(pa.table(long), [RUN, TIME])
    failed = int((~ended).sum())
    return Part(_parquet(table, [STATUS, REASON]), trajectories, failed, perf_counter() - began, simulating)


def lost_runs(job: Job, first: int, rows: Array, reason: str) -> Part:
    """The rows of runs that came to no end."""
    count = len(rows)
    none = np.full((count, len(job.figures)), np.nan)
    table = _runs_table(job, first, rows, none, [FAILED] * count, [reason] * count)
    return Part(_parquet(table, [STATUS, REASON]), None, count, 0.0, 0.0)


def _runs_table(
    job: Job, first: int, rows: Array, figures: Array, statuses: Sequence[str], reasons: Sequence[str]
) -> pa.Table:
    """What is not there is null, which a median of DuckDB or Polars leaves out; NaN it takes for a great number."""
    columns = [
        np.arange(first, first + len(rows)),
        *rows.T,
        *(pa.array(column, mask=np.isnan(column)) for column in figures.T),
        statuses,
        pa.array(reasons, pa.string(), mask=np.array(reasons) == ""),
    ]
    return pa.table([pa.array(column) for column in columns], schema=job.runs_schema)


def _copied(run: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    return {name: values.copy() for name, values in run.items()}


def _parquet(table: pa.Table, repeated: Sequence[str]) -> bytes:
    """A file; columns in which values come again and again are written as a dictionary."""
    doubles = [field.name for field in table.schema if pa.types.is_floating(field.type) and field.name not in repeated]
    file = io.BytesIO()
    pq.write_table(
        table,
        file,
        compression="zstd",
        compression_level=1,
        use_dictionary=list(repeated),
        use_byte_stream_split=doubles,
    )
    return file.getvalue()
