"""The results of a study as pandas data frames."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds

from rov_fmu.io.messages import FileError, brief, reason_of, shown
from rov_fmu.study.plan.plan import RUN, STATUS, TIME, TRAJECTORY
from rov_fmu.study.results.store import RUNS, Store, old_rows
from rov_fmu.study.run.run import FAILED, INCOMPLETE

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_ENDED = ds.field(STATUS) != FAILED
_FORMAT = ds.ParquetFileFormat(
    default_fragment_scan_options=ds.ParquetFragmentScanOptions(page_checksum_verification=True)
)
_AT_ONCE = 5_000_000
"""The number of trajectory values in memory at a time."""


class Results:
    """The results of the finished runs of a study. Raises FileError if the folder holds no study.

    The data frames are `runs`, `failed`, `incomplete`, `trajectories()`, `bands()` and `sensitivity()`.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._store = Store(self.folder)
        self._study = study = self._store.description()
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

    @cached_property
    def runs(self) -> pd.DataFrame:
        """The runs in order, indexed by their number: parameters, figures, status, reason."""
        columns = {name: ds.field(name) for name in self._rows.schema.names if name != TRAJECTORY}
        return self._table(columns).to_pandas().set_index(RUN)  # type: ignore[no-any-return]

    def trajectories(self, runs: Sequence[int] | None = None) -> pd.DataFrame:
        """Return the kept outputs with a row for each `run` and time `t` (s), of the given runs, or of all runs that
        ended."""
        names = (TIME, *self.outputs)
        columns = {RUN: ds.field(RUN), **{name: ds.field(TRAJECTORY, name) for name in names}}
        table = self._table(columns, _ENDED if runs is None else _ENDED & ds.field(RUN).isin([*runs]))
        counts = pc.list_value_length(table[TIME]).to_numpy()
        lists = {name: pc.list_flatten(table[name]) for name in names}
        return pa.table({RUN: np.repeat(table[RUN].to_numpy(), counts), **lists}).to_pandas()  # type: ignore[no-any-return]

    def bands(self, output: str, quantiles: Sequence[float] = QUANTILES) -> pd.DataFrame:
        """Return quantiles of an output over the runs (columns) at each time (s, the index). Raises FileError."""
        if output not in self.outputs:
            others = _others(self.outputs, "[keep]")
            raise FileError(f"{self.folder}: no trajectory of {shown(output)} is kept{others}")
        ended = self.runs.index[self.runs[STATUS] != FAILED].tolist()
        times = self.trajectories(ended[:1])[TIME].to_numpy()
        block, found = max(1, _AT_ONCE // max(len(ended), 1)), []
        for start in range(0, len(times), block):
            part = pc.list_slice(ds.field(TRAJECTORY, output), start, start + block)
            lists = self._table({output: part}, _ENDED)[output]
            values = pc.list_flatten(lists).to_numpy().reshape(len(ended), -1)
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

    @cached_property
    def _rows(self) -> Any:
        """The rows of all files, in the order of the runs. Raises FileError about a file that cannot count."""
        if self._study["format"] == 1:
            return ds.dataset(old_rows(self.folder, self.outputs))
        if not (files := self._store.checked(self._study)):
            raise FileError(f"{self.folder / RUNS}: holds no results yet")
        return ds.dataset([*map(str, files)], format=_FORMAT)

    def _table(self, columns: Mapping[str, Any], rows: Any = None) -> pa.Table:
        """Return columns of rows. Raises FileError about a damaged file."""
        try:
            return self._rows.to_table(columns=columns, filter=rows)
        except (pa.ArrowException, OSError) as error:
            self._store.checked(self._study, whole=True)  # it names the file
            raise FileError(f"{self.folder / RUNS}: {brief(reason_of(error))}") from error


def statistics(column: "pd.Series[float]") -> dict[str, float]:
    """Return what pandas tells of the numbers of a column: count, mean, std, min, max, and QUANTILES, such as "5%".

    They are NaN where there are too few.
    """
    with np.errstate(all="ignore"):
        return column.describe(percentiles=[*QUANTILES]).to_dict()  # type: ignore[return-value]


def _others(names: Sequence[str], table: str) -> str:
    """Return the end of a message about an unknown name: the existing names."""
    return f", only {', '.join(names)}" if names else f", nor any other: the plan has no {table}"
