"""The results of a study as pandas data frames."""

from collections.abc import Sequence
from functools import cached_property
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.dataset as ds

from rov_fmu.io.messages import FileError, shown
from rov_fmu.study.plan.plan import RUN, STATUS, TIME
from rov_fmu.study.results.store import RUNS, TRAJECTORIES, Store
from rov_fmu.study.run.run import FAILED, INCOMPLETE

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_AT_ONCE = 5_000_000
"""The number of trajectory values in memory at a time."""


class Results:
    """The results of the finished runs of a study. Raises FileError if the folder holds no study.

    The data frames are `runs`, `failed`, `incomplete`, `trajectories()`, `bands()` and `sensitivity()`.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._store = Store(self.folder)
        study = self._store.description()
        self.parameters: tuple[str, ...] = tuple(study["columns"]["parameters"])
        """The varied variables, columns of `runs`."""
        self.figures: tuple[str, ...] = tuple(study["columns"]["figures"])
        """The figures, columns of `runs`."""
        self.outputs: tuple[str, ...] = tuple(study["columns"]["outputs"])
        """The kept outputs, columns of `trajectories`."""
        self.title: str | None = study.get("title")
        """The title that the plan gives."""
        self.planned: int = study["runs"]
        """The number of runs of the whole study."""
        self.plan: dict[str, Any] = study["plan"]
        """The part of the plan that the results depend on."""
        self.units: dict[str, str] = study["units"]
        """The units of parameters and outputs."""
        self.descriptions: dict[str, str] = study["descriptions"]
        """The FMU's descriptions of parameters and outputs."""
        self.model: str = study["model"]
        """The name of the FMU's file."""
        self.fmu: str = study["fmu"]
        """SHA-256 of the FMU."""
        self.groups: tuple[tuple[str, ...], ...] = tuple(map(tuple, study["groups"]))
        """The parameters; correlated ones form one group."""
        self.warnings: tuple[str, ...] = tuple(study["warnings"])
        """Sentences about properties of the results that a reader may not expect."""
        self.made_by: str = study["made_by"]
        """The name and the version of this tool."""
        self._points: int = study["points"]

    @cached_property
    def runs(self) -> pd.DataFrame:
        """The runs in order, indexed by their number: parameters, figures, status, reason."""
        table = self._dataset(RUNS).to_table()
        return table.to_pandas().sort_values(RUN).set_index(RUN)  # type: ignore[no-any-return]

    def trajectories(self, runs: Sequence[int] | None = None) -> pd.DataFrame:
        """Return the kept outputs with a row for each `run` and time `t` (s), of the given runs, or of all runs that
        ended."""
        rows = None if runs is None else ds.field(RUN).isin([*runs])
        table = self._dataset(TRAJECTORIES).to_table(filter=rows)
        return table.to_pandas().sort_values([RUN, TIME], kind="stable").reset_index(drop=True)  # type: ignore[no-any-return]

    def bands(self, output: str, quantiles: Sequence[float] = QUANTILES) -> pd.DataFrame:
        """Return quantiles of an output over the runs (columns) at each time (s, the index). Raises FileError."""
        if output not in self.outputs:
            others = _others(self.outputs, "[keep]")
            raise FileError(f"{self.folder}: no trajectory of {shown(output)} is kept{others}")
        trajectories = self._dataset(TRAJECTORIES)
        times = np.unique(trajectories.head(self._points, columns=[TIME])[TIME].to_numpy())
        ended = trajectories.count_rows() // max(len(times), 1)
        block = max(1, _AT_ONCE // max(ended, 1))
        found = []
        for start in range(0, len(times), block):
            low, high = times[start], times[min(start + block, len(times)) - 1]
            part = trajectories.to_table(
                columns=[TIME, output], filter=(ds.field(TIME) >= low) & (ds.field(TIME) <= high)
            )
            values = part[output].to_numpy().reshape(ended, -1)  # each run has all times, one after another
            with np.errstate(all="ignore"):  # about numbers that are infinite, or nearly so
                found.append(np.quantile(values, quantiles, axis=0).T)
        return pd.DataFrame(np.concatenate(found), pd.Index(times, name=TIME), pd.Index(quantiles, name="quantile"))

    def sensitivity(self, figure: str, seed: int = 1) -> pd.DataFrame:
        """Return the Sobol indices of a figure by parameter: S1, ST, and the half widths of their 95 % intervals.

        The sampler must be saltelli; `seed` must not be 0. Correlated parameters have one index together, because the
        variance that is due to one of them alone is not defined. A block of runs counts if all of its runs have the
        figure. Raises FileError.
        """
        from SALib.analyze import sobol

        if figure not in self.figures:
            others = _others(self.figures, "[figures]")
            raise FileError(f"{self.folder}: there is no figure {shown(figure)}{others}")
        if self.runs[figure].nunique() == 1:
            raise FileError(f"{self.folder}: {figure} is the same in all runs")
        if self.plan["sampler"] != "saltelli":
            raise FileError(f'{self.folder}: Sobol indices need sampler = "saltelli" in the plan')
        names = [", ".join(group) for group in self.groups]
        block = len(names) + 2
        values = self.runs[figure].reindex(range(self.planned)).to_numpy().reshape(-1, block)
        whole = values[np.isfinite(values).all(axis=1)]
        if len(whole) < 2:
            raise FileError(f"{self.folder}: too few runs have {figure}")
        problem = {"num_vars": len(names), "names": names}
        with np.errstate(all="ignore"):
            found = sobol.analyze(problem, whole.ravel(), calc_second_order=False, seed=seed)
        columns = {"S1": "S1", "S1_95": "S1_conf", "ST": "ST", "ST_95": "ST_conf"}
        return pd.DataFrame({name: found[key] for name, key in columns.items()}, pd.Index(names))

    @property
    def failed(self) -> pd.DataFrame:
        """The runs that failed, with their reasons."""
        return self.runs[self.runs[STATUS] == FAILED]

    @property
    def incomplete(self) -> pd.DataFrame:
        """The runs that ended but lack a figure, with their reasons."""
        return self.runs[self.runs[STATUS] == INCOMPLETE]

    def _dataset(self, name: str) -> Any:
        """Open the files of a table in the order of their runs."""
        if not (paths := sorted(str(path) for path in (self.folder / name).glob("part-*.parquet"))):
            raise FileError(f"{self.folder / name}: holds no results yet")
        return ds.dataset(paths)


def statistics(values: Any, quantiles: Sequence[float]) -> tuple[list[float], float, float]:
    """Return the quantiles, the mean, and the standard deviation of finite numbers; NaN where there are too few."""
    if not values.size:
        return [nan] * len(quantiles), nan, nan
    with np.errstate(all="ignore"):
        sd = float(values.std(ddof=1)) if values.size > 1 else nan
        return np.quantile(values, quantiles).tolist(), float(values.mean()), sd


def _others(names: Sequence[str], table: str) -> str:
    """Return the end of a message about an unknown name: the existing names."""
    return f", only {', '.join(names)}" if names else f", nor any other: the plan has no {table}"
