"""The work of a Dask worker: it unpacks the FMU, has an instance for each thread, and returns the rows of many runs."""

import io
import os
import shutil
import signal
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Lock, Thread, current_thread, get_ident, main_thread
from time import monotonic, perf_counter

import numpy as np
import numpy.typing as npt
import pandas as pd  # noqa: F401 (PyArrow would import it at the first table, which takes a third of a second)
import pyarrow as pa
import pyarrow.parquet as pq
from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from rov_fmu.fmu.proof import DISK
from rov_fmu.io.child_process import Limits
from rov_fmu.study.plan.figures import Figures
from rov_fmu.study.plan.model import Model
from rov_fmu.study.run.separate_simulator import SeparateSimulator
from rov_fmu.study.run.simulator import Manoeuvre, RunError, Simulator

Array = npt.NDArray[np.float64]
RUN, STATUS, REASON, TIME = "run", "status", "reason", "t"
"""The columns that every study has."""
DONE, INCOMPLETE, FAILED = "done", "incomplete", "failed"
"""The statuses of a run: complete; it ended, but a figure cannot be computed; it did not end."""
_TRIED = 8
"""The number of runs that are tried until one ends."""


@dataclass(frozen=True)
class Job:
    """Everything that a worker must know about a study; it is sent to each worker once."""

    key: str
    """Distinguishes this study from others on the same workers."""
    model: Model
    manoeuvre: Manoeuvre
    figures: Mapping[str, str]
    kept: Sequence[str]
    """The outputs whose trajectories are kept."""
    kept_points: Sequence[int]
    """The numbers of the communication points at which they are kept."""
    time_limit: float
    """The seconds that a run may take."""


@dataclass(frozen=True)
class Part:
    """The rows of consecutive runs, as Parquet files."""

    runs: bytes
    trajectories: bytes | None
    failed: int
    seconds: float
    """The time that the worker took."""


@dataclass(frozen=True)
class Trial:
    """The properties of an FMU that are measured before the study."""

    resets: bool
    """True if a run after a reset is bit-identical to a run of a new instance."""
    seconds: float
    """The time that a run takes."""


class InstancePool:
    """The instances of the FMU on one worker. Each is lent to one thread at a time, and then used again."""

    def __init__(self, job: Job, folder: Path, is_watched: bool) -> None:
        self.job = job
        self._folder = Path(tempfile.mkdtemp(prefix="fmu-", dir=folder))
        self._description = job.model.unpack(self._folder)
        self._idle: dict[bool, list[tuple[Simulator | SeparateSimulator, Figures]]] = {False: [], True: []}
        self._one_only = Lock() if job.model.once_per_process else nullcontext()
        self._is_watched = is_watched
        self._ends: dict[int, float] = {}
        self._closed = Event()
        if is_watched:
            Thread(target=self._watch, daemon=True).start()

    @contextmanager
    def lent(self, separate: bool) -> Iterator[tuple[Simulator | SeparateSimulator, Figures]]:
        """Lend an instance that is ready for a run; a separate one lives in a child process. Raises LoadError.

        On a worker that Dask does not restart, all instances are separate.
        """
        separate = separate or not self._is_watched
        with nullcontext() if separate else self._one_only:
            try:
                self.begin(separate)
                yield (tools := self._tools(separate))
                self._idle[separate].append(tools)
            finally:
                self._ends.pop(get_ident(), None)

    def begin(self, separate: bool) -> None:
        """Start the time limit of a run. A worker whose run exceeds it ends its own process."""
        if self._is_watched and not separate:
            self._ends[get_ident()] = monotonic() + self.job.time_limit

    def close(self) -> None:
        """Free the instances and delete the files."""
        self._closed.set()
        for simulator, _ in (*self._idle[False], *self._idle[True]):
            simulator.free()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _tools(self, separate: bool) -> tuple[Simulator | SeparateSimulator, Figures]:
        if self._idle[separate]:
            return self._idle[separate].pop()
        job, folder = self.job, str(self._folder)
        simulator = (
            SeparateSimulator(folder, replace(job.model, content=b""), job.manoeuvre, job.time_limit)
            if separate
            else Simulator(folder, self._description, job.model, job.manoeuvre)
        )
        return simulator, Figures(job.figures, job.manoeuvre.times)

    def _watch(self) -> None:
        while not self._closed.wait(min(1.0, 0.25 * self.job.time_limit)):
            now = monotonic()
            if any(end < now for end in [*self._ends.values()]):
                os._exit(1)


_POOLS: dict[str, InstancePool] = {}
"""The pools of this process, by the key of the study."""


class Delivery(WorkerPlugin):
    """Brings a study to every worker, including those that are started or restarted later."""

    def __init__(self, job: Job, own_cluster: bool) -> None:
        self.name = job.key
        self._job, self._own = job, own_cluster

    def setup(self, worker: Worker) -> None:
        """Prepare a worker; Dask calls this when the worker starts."""
        self._limited = ExitStack()
        if self._own and current_thread() is main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the process that started the workers handles Ctrl-C
            warnings.simplefilter("ignore", RuntimeWarning)  # from NumPy: a NaN becomes the reason of its run
            self._limited.enter_context(Limits(disk=DISK).applied())  # Dask itself limits the memory
        _POOLS[self.name] = InstancePool(self._job, Path(worker.local_directory), is_watched=worker.nanny is not None)

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002 (Dask passes it)
        """Clean up; Dask calls this when the study ends."""
        if pool := _POOLS.pop(self.name, None):
            pool.close()
        self._limited.close()


def try_out(key: str, rows: Array, separate: bool) -> Trial:
    """Measure a run, and find out whether the FMU can be reset between runs. Raises LoadError."""
    pool = _POOLS[key]
    with pool.lent(separate) as (simulator, _):
        start = perf_counter()
        for values in rows[:_TRIED]:
            pool.begin(separate)
            simulator.renew()
            try:
                first = {name: recorded.copy() for name, recorded in simulator.run(values).items()}
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


def do_runs(key: str, first: int, rows: Array, resets: bool, separate: bool) -> Part:
    """Do the runs from number `first` on, one for each row of values. Raises LoadError."""
    began = perf_counter()
    pool = _POOLS[key]
    job = pool.job
    m = job.manoeuvre
    figures = np.full((len(rows), len(job.figures)), np.nan)
    points = np.array(job.kept_points, int)
    all_points = len(points) == m.steps + 1
    kept = [np.empty((len(rows), len(points)), job.model.variables[name].dtype(job.model.version)) for name in job.kept]
    statuses, reasons, ended = [], [], np.ones(len(rows), bool)
    with pool.lent(separate) as (simulator, figures_of):
        for n, values in enumerate(rows):
            pool.begin(separate)
            try:
                run = simulator.run(values)
            except RunError as error:
                statuses.append(FAILED)
                reasons.append(str(error))
                ended[n] = False
                continue
            for place, name in zip(kept, job.kept, strict=True):
                place[n] = run[name] if all_points else run[name][points]
            figures[n], reason = figures_of.of({**dict(zip(m.varied, values.tolist(), strict=True)), **run})
            statuses.append(INCOMPLETE if reason else DONE)
            reasons.append(reason)
            if resets:
                simulator.reset()
            else:
                simulator.renew()
    trajectories = None
    if job.kept:
        whole = slice(None) if ended.all() else ended  # a slice makes no copy
        numbers = np.arange(first, first + len(rows))[whole]
        long = {RUN: np.repeat(numbers, len(points)), TIME: np.tile(m.times[points], len(numbers))}
        long |= {name: place[whole].ravel() for name, place in zip(job.kept, kept, strict=True)}
        trajectories = _parquet(pa.table(long), [RUN, TIME])
    table = _runs_table(job, first, rows, figures, statuses, reasons)
    return Part(table, trajectories, int((~ended).sum()), perf_counter() - began)


def lost_runs(job: Job, first: int, rows: Array, reason: str) -> Part:
    """Return the rows of failed runs, all with one reason."""
    count = len(rows)
    none = np.full((count, len(job.figures)), np.nan)
    return Part(_runs_table(job, first, rows, none, [FAILED] * count, [reason] * count), None, count, 0.0)


def _runs_table(
    job: Job, first: int, rows: Array, figures: Array, statuses: Sequence[str], reasons: Sequence[str]
) -> bytes:
    """Return the table with one row for each run.

    Missing figures are null, because DuckDB and Polars skip it in a median but treat NaN as a large number.
    """
    columns = [
        np.arange(first, first + len(rows)),
        *rows.T,
        *(pa.array(column, mask=np.isnan(column)) for column in figures.T),
        statuses,
        pa.array(reasons, pa.string(), mask=np.array(reasons) == ""),
    ]
    numbers = [(name, pa.float64()) for name in (*job.manoeuvre.varied, *job.figures)]
    schema = pa.schema([(RUN, pa.int64()), *numbers, (STATUS, pa.string()), (REASON, pa.string())])
    return _parquet(pa.table([pa.array(column) for column in columns], schema=schema), [STATUS, REASON])


def _parquet(table: pa.Table, repeated: Sequence[str]) -> bytes:
    """Return a table as a Parquet file; the columns with repeated values are encoded as a dictionary."""
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
