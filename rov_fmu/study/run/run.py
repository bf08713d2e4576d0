"""What runs give: figures, kept outputs, how they ended, and their rows as a Parquet file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from rov_fmu.study.plan.figures import Array, Figures
from rov_fmu.study.plan.plan import REASON, RUN, STATUS, TIME, TRAJECTORY
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.results.store import nested, parquet

DONE, INCOMPLETE, FAILED = "done", "incomplete", "failed"
"""The statuses of a run: complete; it ended, but a figure cannot be computed; it did not end."""


@dataclass(frozen=True)
class Run:
    """What a run gave."""

    status: str
    reason: str
    """Why a figure is missing, or why the run did not end; otherwise empty."""
    figures: Sequence[float]
    kept: Sequence[npt.NDArray[Any]] = ()
    """The values of each kept output, if the run ended."""
    turned: bool = False
    """True if the vehicle turned over: it rolled or pitched by more than 90 degrees."""


def failed_run(job: Job, reason: str) -> Run:
    """Return a run that did not end."""
    return Run(FAILED, reason, [np.nan] * len(job.plan.figures))


class Evaluation:
    """Makes runs of the outputs that a plan needs, for one thread at a time."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._figures = Figures(job.plan.figures, job.plan.times)
        self._points = np.array(job.plan.kept_points, int)

    def run(self, values: Sequence[float], outputs: Mapping[str, npt.NDArray[Any]]) -> Run:
        """Return the run that has these values of the varied variables, and these outputs over time."""
        job = self._job
        figures, reason = self._figures.of({**dict(zip(job.varied, values, strict=True)), **outputs})
        kept = [outputs[name][self._points] for name in job.plan.kept]
        turned = any(np.any(np.abs(outputs[name]) > 0.5 * np.pi) for name in job.angles)
        return Run(INCOMPLETE if reason else DONE, reason, figures, kept, turned)


@dataclass(frozen=True)
class Rows:
    """The rows of consecutive runs."""

    content: bytes
    """The Parquet file."""
    failed: int
    turned: int
    """The number of runs in which the vehicle turned over."""
    seconds: float
    """The time that the runs took."""


def rows_of(job: Job, first: int, values: Array, found: Sequence[Run], seconds: float) -> Rows:
    """Return the rows of runs from number `first` on, with the varied values of each.

    Missing figures are null, because DuckDB and Polars skip it in a median but treat NaN as a large number.
    """
    figures = np.array([run.figures for run in found], float).T
    columns = [
        np.arange(first, first + len(values)),
        *values.T,
        *(pa.array(column, mask=np.isnan(column)) for column in figures),
        [run.status for run in found],
        [run.reason or None for run in found],
    ]
    numbers = [(name, pa.float64()) for name in (*job.varied, *job.plan.figures)]
    schema = pa.schema([(RUN, pa.int64()), *numbers, (STATUS, pa.string()), (REASON, pa.string())])
    table = pa.table([pa.array(column) for column in columns], schema=schema)
    if job.plan.kept:
        table = table.append_column(TRAJECTORY, _trajectories(job, found))
    failed, turned = sum(run.status == FAILED for run in found), sum(run.turned for run in found)
    return Rows(parquet(table, job.study, first), failed, turned, seconds)


def _trajectories(job: Job, found: Sequence[Run]) -> pa.StructArray:
    """Return the kept times and outputs of each run as lists; null for a run that did not end."""
    times = job.plan.times[np.array(job.plan.kept_points, int)]
    ended = np.array([run.status != FAILED for run in found], bool)
    lists = {TIME: np.tile(times, ended.sum())}
    for index, name in enumerate(job.plan.kept):
        none = np.empty(0, job.model.variables[name].dtype)
        lists[name] = np.concatenate([none, *(run.kept[index] for run in found if run.status != FAILED)])
    return nested(ended, lists)
