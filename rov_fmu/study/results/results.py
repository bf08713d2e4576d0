"""The results of a study as data frames of pandas."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.dataset as ds

from rov_fmu.io.messages import FileError, shown
from rov_fmu.study.plan.figure_units import figure_unit
from rov_fmu.study.results.store import RUNS, TRAJECTORIES, Store
from rov_fmu.study.run.worker import FAILED, INCOMPLETE, RUN, STATUS, TIME

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_AT_ONCE = 20_000_000
"""Numbers of a trajectory that are in memory at a time."""


class Results:
    """What a study has come to, as far as it is done. Raises FileError where the folder holds none.

    As data frames: `runs`, `failed`, `incomplete`, `trajectories()`, `bands()`, `sensitivity()`. What they are of:
    `parameters` (what was varied), `figures`, `outputs` (what was kept), `units`, `figure_units`, `descriptions`,
    `groups` (correlated together), `planned` (runs), `plan`, `model` (the FMU's file) and its digest `fmu`,
    `warnings`, `made_by`, `folder`.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._store = Store(self.folder)
        told = self._store.description()
        self.parameters: tuple[str, ...] = tuple(told["columns"]["parameters"])
        """What was varied; columns of `runs`."""
        self.figures: tuple[str, ...] = tuple(told["columns"]["figures"])
        """What was computed; columns of `runs`."""
        self.outputs: tuple[str, ...] = tuple(told["columns"]["outputs"])
        """What was kept; columns of `trajectories`."""
        self.planned: int = told["runs"]
        """Runs of the whole study."""
        self.plan: dict[str, Any] = told["plan"]
        """As the results depend on it."""
        self.units: dict[str, str] = told["units"]
        """Of parameters and outputs."""
        self.figure_units: dict[str, str] = {
            name: figure_unit(text, self.units) for name, text in self.plan["figures"].items()
        }
        """Nothing where a figure's expression does not tell it."""
        self.descriptions: dict[str, str] = told["descriptions"]
        """Of parameters and outputs, as the FMU has them."""
        self.model: str = told["model"]
        """The name of the FMU's file."""
        self.fmu: str = told["fmu"]
        """SHA-256 of the FMU."""
        self.groups: tuple[tuple[str, ...], ...] = tuple(map(tuple, told["groups"]))
        """The parameters; those that are correlated together."""
        self.warnings: tuple[str, ...] = tuple(told["warnings"])
        """What the results have in them that a reader may not expect, in sentences."""
        self.made_by: str = told["made_by"]
        self._points: int = told["points"]

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row a run, in order, by its number: parameters, figures, status, reason."""
        table = self._dataset(RUNS).to_table()
        return table.to_pandas().sort_values(RUN).set_index(RUN)  # type: ignore[no-any-return]

    def trajectories(self, runs: Sequence[int] | None = None) -> pd.DataFrame:
        """A row a run and time (s, columns `run` and `t`), of all runs that ended or of these: the kept outputs."""
        rows = None if runs is None else ds.field(RUN).isin([*runs])
        table = self._dataset(TRAJECTORIES).to_table(filter=rows)
        return table.to_pandas().sort_values([RUN, TIME], kind="stable").reset_index(drop=True)  # type: ignore[no-any-return]

    def bands(self, output: str, quantiles: Sequence[float] = QUANTILES) -> pd.DataFrame:
        """Quantiles of an output over the runs (columns) at each time (s, the index). Raises FileError."""
        if output not in self.outputs:
            others = f", only {', '.join(self.outputs)}" if self.outputs else ", nor any other: the plan has no [keep]"
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
            values = part[output].to_numpy().reshape(ended, -1)  # times go through from run to run
            found.append(np.quantile(values, quantiles, axis=0).T)
        return pd.DataFrame(np.concatenate(found), pd.Index(times, name=TIME), pd.Index(quantiles, name="quantile"))

    def sensitivity(self, figure: str, seed: int = 1) -> pd.DataFrame:
        """Sobol indices of a figure by parameter: S1, ST, and the half widths of their 95 % intervals (seed not 0).

        A study by sampler saltelli has them. Parameters that are correlated have one together, for the variance that
        is due to one of them alone is not defined. A block of runs counts where the figure is known in all of it.
        Raises FileError.
        """
        from SALib.analyze import sobol

        if figure not in self.figures:
            others = (
                f", only {', '.join(self.figures)}" if self.figures else ", nor any other: the plan has no [figures]"
            )
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
        found = sobol.analyze(problem, whole.ravel(), calc_second_order=False, seed=seed)
        columns = {"S1": "S1", "S1_95": "S1_conf", "ST": "ST", "ST_95": "ST_conf"}
        return pd.DataFrame({name: found[key] for name, key in columns.items()}, pd.Index(names))

    @property
    def failed(self) -> pd.DataFrame:
        """The runs that failed, with their reasons."""
        return self.runs[self.runs[STATUS] == FAILED]

    @property
    def incomplete(self) -> pd.DataFrame:
        """The runs that ended, and have not all figures, with their reasons."""
        return self.runs[self.runs[STATUS] == INCOMPLETE]

    def _dataset(self, name: str) -> Any:
        """Files in the order of their runs."""
        if not (paths := sorted(str(path) for path in (self.folder / name).glob("part-*.parquet"))):
            raise FileError(f"{self.folder / name}: holds no results yet")
        return ds.dataset(paths)
