"""What runs give: figures, kept outputs, how they ended, and their rows as a Parquet file."""

from collections.abc import Callable, Mapping, Sequence
from itertools import count
from time import perf_counter
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

    columns: Mapping[str, Any]
    """The status, reason, figures and trajectory, by column. A run that failed has the first two."""
    turned: bool = False
    """True if the vehicle turned over: it rolled or pitched by more than 90 degrees."""


def lost(reason: object) -> Run:
    """Return a run that did not end."""
    return Run({STATUS: FAILED, REASON: str(reason)})


class Evaluation:
    """Makes runs of the outputs that a plan needs, for one thread at a time."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._figures = Figures(study.plan.figures, study.plan.times)
        self._points = np.array(study.plan.kept_points, int)

    def run(self, values: Sequence[float], outputs: Mapping[str, npt.NDArray[Any]]) -> Run:
        """Return the run that has these values of the varied variables, and these outputs over time."""
        study, plan = self._study, self._study.plan
        figures, reason = self._figures.of({**dict(zip(study.varied, values, strict=True)), **outputs})
        kept = {TIME: plan.times, **{name: outputs[name] for name in plan.kept}}
        columns = {
            **dict(zip(plan.figures, figures, strict=True)),
            STATUS: INCOMPLETE if reason else DONE,
            REASON: reason or None,
            TRAJECTORY: {name: values[self._points] for name, values in kept.items()},
        }
        return Run(columns, any(np.any(np.abs(outputs[name]) > 0.5 * np.pi) for name in study.angles))


class Rows(NamedTuple):
    """The rows of consecutive runs."""

    content: bytes
    """The Parquet file."""
    failed: int
    turned: int
    """The number of runs in which the vehicle turned over."""
    seconds: float
    """The time that the runs took."""


def rows_of(study: Study, runs: Callable[[Array], Sequence[Run]], first: int, values: Array) -> Rows:
    """Do the runs from number `first` on, one for each row of values, and return their rows.

    Missing figures are null, because DuckDB and Polars skip it in a median but treat NaN as a large number.
    """
    plan, numbers = study.plan, dict.fromkeys((*study.varied, *study.plan.figures), pa.float64())
    kinds = {RUN: pa.int64(), **numbers, STATUS: pa.string(), REASON: pa.string()}
    if plan.kept:
        lists = {TIME: "f8", **{name: study.model.variables[name].dtype for name in plan.kept}}
        kinds[TRAJECTORY] = pa.struct([(name, pa.list_(pa.from_numpy_dtype(kind))) for name, kind in lists.items()])
    began = perf_counter()
    found = runs(values)
    seconds = perf_counter() - began
    rows = [
        {RUN: number, **dict(zip(study.varied, own, strict=True)), **run.columns}
        for number, own, run in zip(count(first), values.tolist(), found, strict=False)
    ]
    table = pa.Table.from_pylist(rows, pa.schema(kinds))
    failed, turned = sum(run.columns[STATUS] == FAILED for run in found), sum(run.turned for run in found)
    return Rows(parquet(table, study.about, first), failed, turned, seconds)
