"""What runs give: figures, kept outputs, how they ended, and their rows as a Parquet file."""

from collections.abc import Mapping, Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from rov_fmu.study.plan.figures import Array, Figures
from rov_fmu.study.plan.plan import REASON, RUN, STATUS, TIME, TRAJECTORY
from rov_fmu.study.plan.study import Study
from rov_fmu.study.results.store import parquet

DONE, INCOMPLETE, FAILED = "done", "incomplete", "failed"
"""The statuses of a run: complete; it ended, but a figure cannot be computed; it did not end."""


class Run(NamedTuple):
    """What a run gave."""

    status: str
    reason: str | None = None
    """Why a figure is missing, or why the run did not end."""
    figures: Sequence[float | None] = ()
    """The figures, if the run ended. One that cannot be computed is None."""
    kept: Mapping[str, npt.NDArray[Any]] | None = None
    """The values of each kept output, if the run ended."""
    turned: bool = False
    """True if the vehicle turned over: it rolled or pitched by more than 90 degrees."""


class Evaluation:
    """Makes runs of the outputs that a plan needs, for one thread at a time."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._figures = Figures(study.plan.figures, study.plan.times)
        self._points = np.array(study.plan.kept_points, int)

    def run(self, values: Sequence[float], outputs: Mapping[str, npt.NDArray[Any]]) -> Run:
        """Return the run that has these values of the varied variables, and these outputs over time."""
        study = self._study
        figures, reason = self._figures.of({**dict(zip(study.varied, values, strict=True)), **outputs})
        kept = {name: outputs[name][self._points] for name in study.plan.kept}
        turned = any(np.any(np.abs(outputs[name]) > 0.5 * np.pi) for name in study.angles)
        return Run(INCOMPLETE if reason else DONE, reason or None, figures, kept, turned)


class Rows(NamedTuple):
    """The rows of consecutive runs."""

    content: bytes
    """The Parquet file."""
    failed: int
    turned: int
    """The number of runs in which the vehicle turned over."""
    seconds: float
    """The time that the runs took."""


def rows_of(study: Study, first: int, values: Array, found: Sequence[Run], seconds: float) -> Rows:
    """Return the rows of runs from number `first` on, with the varied values of each.

    Missing figures are null, because DuckDB and Polars skip it in a median but treat NaN as a large number.
    """
    plan = study.plan
    numbers = (*study.varied, *plan.figures)
    kinds = {RUN: pa.int64(), **dict.fromkeys(numbers, pa.float64()), STATUS: pa.string(), REASON: pa.string()}
    times = {TIME: plan.times[np.array(plan.kept_points, int)]}
    if plan.kept:
        lists = {TIME: "f8", **{name: study.model.variables[name].dtype for name in plan.kept}}
        kinds[TRAJECTORY] = pa.struct([(name, pa.list_(pa.from_numpy_dtype(kind))) for name, kind in lists.items()])
    rows = [
        {
            **dict(zip(numbers, (*own, *run.figures), strict=False)),  # a run that failed has no figures
            RUN: number,
            STATUS: run.status,
            REASON: run.reason,
            TRAJECTORY: run.kept and {**times, **run.kept},
        }
        for number, own, run in zip(count(first), values.tolist(), found, strict=False)
    ]
    table = pa.Table.from_pylist(rows, pa.schema(kinds))
    failed, turned = sum(run.status == FAILED for run in found), sum(run.turned for run in found)
    return Rows(parquet(table, study.about, first), failed, turned, seconds)
