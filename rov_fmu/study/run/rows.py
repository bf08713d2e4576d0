"""The rows of runs, as Parquet files."""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd  # noqa: F401 (PyArrow would import it at the first table, which takes a third of a second)
import pyarrow as pa
import pyarrow.parquet as pq

from rov_fmu.study.plan.figures import Array
from rov_fmu.study.plan.plan import REASON, RUN, STATUS, TIME
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.run.run import FAILED, Run


@dataclass(frozen=True)
class Rows:
    """The rows of consecutive runs, as Parquet files."""

    runs: bytes
    trajectories: bytes | None
    failed: int
    turned: int
    """The number of runs in which the vehicle turned over."""
    seconds: float
    """The time that the runs took."""


def rows_of(job: Job, first: int, values: Array, found: Sequence[Run], seconds: float) -> Rows:
    """Return the rows of runs from number `first` on, with the varied values of each."""
    trajectories = _trajectories(job, first, found) if job.plan.kept else None
    failed, turned = sum(run.status == FAILED for run in found), sum(run.turned for run in found)
    return Rows(_runs(job, first, values, found), trajectories, failed, turned, seconds)


def _runs(job: Job, first: int, values: Array, found: Sequence[Run]) -> bytes:
    """Return the table with one row for each run.

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
