"""The results of a study as pandas data frames."""

import json
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
from rov_fmu.io.reading import read_text
from rov_fmu.study.plan import FAILED, INCOMPLETE, RUN, RUNS, STATUS, STUDY, TIME, TRAJECTORY

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_ENDED = ds.field(STATUS) != FAILED
_FORMAT = ds.ParquetFileFormat(
    default_fragment_scan_options=ds.ParquetFragmentScanOptions(page_checksum_verification=True)
)


class Results:
    """The results of the finished runs of a study. Raises FileError if the folder holds no study.

    The data frames are `runs`, `failed`, `incomplete`, `trajectories()` and `bands()`.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        try:
            self._study = study = json.loads(read_text(self.folder / STUDY))
            self.parameters, self.figures, self.outputs = (
                tuple(study["columns"][key]) for key in ("parameters", "figures", "outputs")
            )
            self.title, self.model, self.made_by = study["title"], study["model"], study["made_by"]
            self.planned: int = study["runs"]
            self.plan: dict[str, Any] = study["plan"]
            self.units: dict[str, str] = study["units"]
            self.descriptions: dict[str, str] = study["descriptions"]
            self.warnings: tuple[str, ...] = tuple(study["warnings"])
            self._files = [path for name in study["files"] if (path := self.folder / RUNS / name).exists()]
        except (ValueError, LookupError, TypeError, RecursionError) as error:
            words = "is not the description of a study of this version: name another folder, or use --force"
            raise FileError(f"{self.folder / STUDY}: {words}") from error

    @cached_property
    def runs(self) -> pd.DataFrame:
        """The runs in order, indexed by their number: parameters, figures, status, reason."""
        columns = {name: ds.field(name) for name in self._rows.schema.names if name != TRAJECTORY}
        return self._table(columns).to_pandas().set_index(RUN)  # type: ignore[no-any-return]

    @property
    def failed(self) -> pd.DataFrame:
        """The runs that failed, with their reasons."""
        return self.runs[self.runs[STATUS] == FAILED]

    @property
    def incomplete(self) -> pd.DataFrame:
        """The runs that ended but lack a figure, with their reasons."""
        return self.runs[self.runs[STATUS] == INCOMPLETE]

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
            raise FileError(f"{self.folder}: no trajectory of {shown(output)} is kept, only {', '.join(self.outputs)}")
        times = self.trajectories(self.runs.index[self.runs[STATUS] != FAILED].tolist()[:1])[TIME].to_numpy()
        lists = self._table({output: ds.field(TRAJECTORY, output)}, _ENDED)[output]
        with np.errstate(all="ignore"):  # about numbers that are infinite, or nearly so
            found = np.quantile(pc.list_flatten(lists).to_numpy().reshape(-1, len(times)), quantiles, axis=0).T
        return pd.DataFrame(found, pd.Index(times, name=TIME), pd.Index(quantiles, name="quantile"))

    @cached_property
    def _rows(self) -> Any:
        if not self._files:
            raise FileError(f"{self.folder / RUNS}: holds no results yet")
        try:
            return ds.dataset([*map(str, self._files)], format=_FORMAT)
        except (pa.ArrowException, OSError) as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> FileError:
        words = "remove the file that is damaged, and its runs are done again"
        return FileError(f"{self.folder / RUNS}: {brief(reason_of(error))}: {words}")

    def _table(self, columns: Mapping[str, Any], rows: Any = None) -> pa.Table:
        """Return columns of rows. Raises FileError about a damaged file."""
        try:
            return self._rows.to_table(columns=columns, filter=rows)
        except (pa.ArrowException, OSError) as error:
            raise self._damaged(error) from error


def statistics(column: "pd.Series[float]") -> dict[str, float]:
    """Return what pandas tells of the numbers of a column: count, mean, std, min, max, and QUANTILES, such as "5%".

    They are NaN where there are too few.
    """
    with np.errstate(all="ignore"):
        return column.describe(percentiles=[*QUANTILES]).to_dict()  # type: ignore[return-value]
