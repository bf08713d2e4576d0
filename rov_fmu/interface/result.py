"""The result of a simulation: arrays by the names of the variables, which can become a data frame or a plot."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.io.messages import InputError, UnknownNameError, only
from rov_fmu.model.attitude import QUATERNION

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_DASH = 4.0
"""The length of a dash, in widths of a line."""


@dataclass(frozen=True, repr=False, eq=False)
class Result(Mapping[str, Array]):
    """The trajectories of one vehicle or of many: a mapping from the names of variables to arrays, `result["u"]`.

    The arrays are in SI units. They have the shape (times,), or (vehicles, times) for many vehicles.
    """

    time: Array
    """The output times, s."""
    arrays: Mapping[str, Array]
    """The arrays by name."""
    units: Mapping[str, str]
    """The SI unit of each variable, by its name; "1" for commands that are fractions."""
    states: tuple[str, ...]
    """The recorded variables that are states."""
    failed: NDArray[np.intp]
    """The numbers of the vehicles whose motion could not be computed to the end; their arrays end with NaN."""

    def __getitem__(self, name: str) -> Array:
        """Return the values of a variable. Raises UnknownNameError, a KeyError, if it was not recorded."""
        if name not in self.arrays:
            raise UnknownNameError(f"{name}: this variable was not recorded{only(str(name), self.arrays)}")
        return self.arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.arrays)

    def __len__(self) -> int:
        return len(self.arrays)

    def __repr__(self) -> str:
        first = next(iter(self.arrays.values()))
        vehicles = f"{len(first)} vehicles, " if first.ndim == 2 else ""
        failed = f", {len(self.failed)} failed" if len(self.failed) else ""
        span = f"{len(self.time)} times from {self.time[0]:g} to {self.time[-1]:g} s"
        return f"<Result: {vehicles}{span}{failed}; {', '.join(self.arrays)}>"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the recorded variables."""
        return tuple(self.arrays)

    @property
    def final(self) -> dict[str, Array]:
        """The recorded states at the last time, by name: the `start` of a simulation that continues this one.

        For a vehicle with roll or pitch, it also contains psi_0, so that the heading continues. It does not contain
        changes of commands that are still waiting for the dead time.
        """
        found = {name: self.arrays[name][..., -1][()] for name in self.states}
        return found | (
            {"psi_0": self.arrays["psi"][..., -1][()]} if {*QUATERNION, "psi"} <= self.arrays.keys() else {}
        )

    def to_dataframe(self) -> "pd.DataFrame":
        """Return a pandas data frame with a column for each variable.

        Its index is the time; for many vehicles, the number of the vehicle and the time. Raises ImportError where
        pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError as error:
            raise ImportError("to_dataframe() needs pandas: pip install pandas") from error
        first = next(iter(self.arrays.values()))
        index: pd.Index = pd.Index(self.time, name="time")
        if first.ndim == 2:
            index = pd.MultiIndex.from_product([range(len(first)), self.time], names=["vehicle", "time"])
        return pd.DataFrame({name: values.ravel() for name, values in self.arrays.items()}, index)

    def plot(self, names: str | Sequence[str] | None = None, figure: "Figure | None" = None) -> "Figure":
        """Plot variables over time, one panel for each unit, and return the figure of Matplotlib.

        `names` are the variables; the default is all. The default of `figure` is a new figure of pyplot.
        """
        if figure is None:
            import matplotlib.pyplot as plt

            figure = plt.figure(layout="constrained")
        chosen = self.names if names is None else (names,) if isinstance(names, str) else tuple(names)
        if not chosen:
            raise InputError("names: must name a variable")
        by_unit: dict[str, dict[str, Array]] = {}
        for name in chosen:
            by_unit.setdefault(self.units[name] if name in self else "", {})[name] = self[name]
        figure.set_size_inches(7.0, 1.0 + 1.6 * len(by_unit))
        panels = figure.subplots(len(by_unit), sharex=True, squeeze=False)[:, 0]
        for panel, (unit, variables) in zip(panels, by_unit.items(), strict=True):
            dashes = _dashes([*variables.values()])
            for n, (name, values) in enumerate(variables.items()):
                lines = panel.plot(
                    self.time,
                    values.T,
                    color=f"C{n % 10}",
                    linestyle=dashes[n],
                    linewidth=1.0,
                    alpha=1.0 if values.ndim == 1 else 0.3,
                )
                lines[0].set_label(name)
            low, high = panel.dataLim.intervaly
            if max(abs(low), abs(high)) > 0.0 and high - low < 1e-3 * max(abs(low), abs(high)):  # constant
                panel.set_ylim(min(0.0, 1.1 * low), max(0.0, 1.1 * high))
            panel.set_ylabel("" if unit == "1" else unit)
            panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        panels[-1].set_xlabel("time (s)")
        return figure


def _dashes(curves: Sequence[Array]) -> list[Any]:
    """Return the line style of each curve of a panel.

    If curves coincide, the first is solid and the others are dashed on top of it, so that all are visible.
    """
    scale = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in curves), default=0.0)
    groups: list[list[int]] = []
    for n, values in enumerate(curves):
        same = (group for group in groups if np.allclose(values, curves[group[0]], 0.0, 5e-3 * scale, equal_nan=True))
        if (group := next(same, None)) is not None:
            group.append(n)
        else:
            groups.append([n])
    found: list[Any] = ["-"] * len(curves)
    for group in groups:
        for place, n in enumerate(group[1:], 1):
            found[n] = (-_DASH * place, (_DASH, _DASH * (len(group) - 1)))
    return found
