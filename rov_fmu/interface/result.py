"""A simulation and its result: arrays by the names of the variables, which can become a data frame or a plot."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rov_fmu.c.simulation import reasons, simulate, usable_cores
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.units import in_degrees, parsed_unit
from rov_fmu.fmu.variables import units_of
from rov_fmu.interface.arguments import (
    Inputs,
    checked_inputs,
    checked_record,
    checked_start,
    checked_times,
    checked_values,
    duration_times,
    number_of_vehicles,
)
from rov_fmu.io.messages import InputError, UnknownNameError, only
from rov_fmu.io.numbers import WORKERS
from rov_fmu.vehicle.vehicle import Vehicle, check_coefficients

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from rov_fmu.autopilot.figures import Aim

Array = NDArray[np.float64]
_SMALL = ("thrust", "command")
"""The quantities of all thrusters, which share a small panel."""
_WORDS = {axis.velocity: axis.name for axis in AXES.values()} | {
    "x": "north",
    "y": "east",
    "z": "depth",
    "phi": "roll",
    "theta": "pitch",
    "psi": "heading",
}
"""The variables that have a name in words."""
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
    final: Mapping[str, Array]
    """The states at the last time, by name: the `start` of a simulation that continues this one.

    It also contains the heading psi_0 of a vehicle with roll or pitch, and the commands that act after the dead time,
    but not those that still wait for it: `VehicleModel.stepper` keeps them. Of many vehicles, it has what was
    recorded, and the attitude."""
    failed: NDArray[np.intp]
    """The numbers of the vehicles whose motion could not be computed to the end; their arrays end with NaN."""
    commands: Mapping[str, Array] = field(default_factory=dict)
    """The commands of one vehicle at the times, as its inputs have them; empty for many vehicles."""
    command_unit: str = "1"
    """Their unit: 1 for fractions, us for pulse widths."""
    aims: "Mapping[str, Aim]" = field(default_factory=dict)
    """What an autopilot held, by name, with the rise time and the overshoot: that of `VehicleModel.hold`."""

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
        aims = "".join(f"; {name}: {aim.told(1.0, self.units[aim.variable])}" for name, aim in self.aims.items())
        return f"<Result: {vehicles}{span}{failed}; {', '.join(self.arrays)}{aims}>"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the recorded variables."""
        return tuple(self.arrays)

    def to_dataframe(self) -> "pd.DataFrame":
        """Return a pandas data frame with a column for each variable.

        Its index is the time, s; for many vehicles, the number of the vehicle and the time. Raises ImportError where
        pandas is not installed.

            rov.simulate(10.0, {"surge": 0.3}).to_dataframe().to_csv("run.csv")
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
        """Plot variables over time, one panel for each quantity, and return the figure of Matplotlib.

        - `names`: the variables. The default is all that are ever different from 0, without the quaternion, and the
          commands. Angles are in degrees, and knots stand beside m/s.
        - `figure`: the figure to draw into. The default is a new one of pyplot.

            rov.simulate(10.0, {"surge": 0.3}).plot(["u", "x"]).savefig("run.png")
        """
        from matplotlib.style import context

        from rov_fmu.report.plots.svg import STYLE

        with context(STYLE):
            if figure is None:
                import matplotlib.pyplot as plt

                figure = plt.figure(layout="constrained")
            self._draw(figure, names)
        return figure

    def _draw(self, figure: "Figure", names: str | Sequence[str] | None) -> None:
        from rov_fmu.report.plots.svg import LIGHT, LINES, draw_commands, name_axes

        moving = [name for name in self.names if name not in QUATERNION and np.any(self.arrays[name])]
        chosen = moving or self.names[:1] if names is None else [names] if isinstance(names, str) else [*names]
        if not chosen:
            raise InputError("names: must name a variable")
        panels: dict[tuple[str, str], dict[str, Array]] = {}
        for name in dict.fromkeys(chosen):
            values = self[name]
            factor, unit = in_degrees(self.units[name])
            quantity = "thrust" if name.startswith("F_") and unit == "N" else parsed_unit(self.units[name]).words
            panels.setdefault((quantity, unit), {})[name] = factor * values
        commands = {name: values for name, values in self.commands.items() if names is None and np.any(values)}
        heights = [0.6 if quantity in _SMALL else 1.0 for quantity, _ in panels] + [0.6] * bool(commands)
        figure.set_size_inches(8.0, 1.0 + 1.6 * sum(heights))
        axes = figure.subplots(len(heights), sharex=True, squeeze=False, height_ratios=heights)[:, 0]
        for panel, ((quantity, unit), curves) in zip(axes, panels.items(), strict=False):
            dashes = _dashes([*curves.values()])
            for n, (name, values) in enumerate(curves.items()):
                faint = 1.0 if values.ndim == 1 else 0.3
                lines = panel.plot(
                    self.time,
                    values.T,
                    color=LIGHT[LINES[n % len(LINES)]],
                    linestyle=dashes[n],
                    linewidth=1.2,
                    alpha=faint,
                )
                lines[0].set_label(f"{_WORDS[name]} ({name})" if name in _WORDS else name)
                for aim in (aim for aim in self.aims.values() if aim.variable == name):
                    factor, _ = in_degrees(self.units[name])
                    words = aim.told(factor, unit).replace(": ", ":\n").replace(", ", ",\n")
                    color = lines[0].get_color()
                    panel.axhline(factor * aim.value, color=color, linestyle=":", linewidth=1.0, label=words)
            low, high = panel.dataLim.intervaly
            if max(abs(low), abs(high)) > 0.0 and high - low < 1e-3 * max(abs(low), abs(high)):  # constant
                panel.set_ylim(min(0.0, 1.1 * low), max(0.0, 1.1 * high))
            name_axes(panel, quantity, unit)
            panel.legend(loc="center left", bbox_to_anchor=(1.16, 0.5))
        if commands:
            draw_commands(axes[-1], self.time, commands, self.command_unit)
        axes[-1].set_xlabel("time (s)")


def simulated_result(
    vehicle: Vehicle,
    time: ArrayLike,
    inputs: Inputs,
    start: Mapping[str, Any],
    coefficients: Mapping[str, Any],
    record: str | Sequence[str] | None,
    *,
    workers: int | None,
    many: bool,
    lanes: bool = False,
) -> Result:
    """Return a simulation of one vehicle, or of many: the work of `VehicleModel.simulate` and of `simulate_many`."""
    layout = vehicle.layout
    check_coefficients(layout, vehicle.coefficients)  # `dataclasses.replace` does not check them
    times = checked_times("time", duration_times(time) if np.ndim(time) == 0 else time)
    step_times, input_values = checked_inputs(layout, times, inputs, many=many)
    values: dict[str, Array] = {
        **input_values,
        **checked_start(start, layout, many=many),
        **checked_values("coefficients", coefficients, layout.coefficients, many=many),
    }
    units = units_of(layout)
    recorded = checked_record(record, layout, units)
    vehicles = number_of_vehicles(values)
    try:
        attitude = QUATERNION if layout.has_attitude else ()
        going = (*layout.state, *layout.continued, *layout.memory)
        others = (*attitude, *layout.continued) if many else (*going, *layout.commands)
        recording = [*recorded, *(name for name in others if name not in recorded)]
        cores = usable_cores() if workers is None else WORKERS.checked("workers", workers)
        trajectories = simulate(vehicle, step_times, values, recording, vehicles=vehicles, workers=cores, lanes=lanes)
    except MemoryError as error:
        size = 8e-9 * vehicles * len(step_times) * len(recorded)
        raise InputError(
            f"time, record: the result needs {size:.3g} GB, which is more than the available memory. Record "
            "fewer variables"
        ) from error
    if attitude:
        quaternion = trajectories.values[[recording.index(name) for name in attitude]]
        _warn_if_turned_over(vehicle.name, step_times, quaternion)
    rows, failed = trajectories.values, np.flatnonzero(trajectories.failed < len(step_times))
    ends = {name: (row if many else row[0])[..., -1][()] for name, row in zip(recording, rows, strict=True)}
    if len(step_times) > len(times):
        rows = rows[..., np.searchsorted(step_times, times)]
    if len(failed) and not many:
        first = int(np.argmax(np.isnan(rows[0, 0])))
        until, length = f"time[{first}] = {times[first]:g} s", times[first] - times[first - 1]
        raise InputError(f"the motion cannot be computed up to {until}: {reasons(layout, length)}")
    return Result(
        times,
        {name: row if many else row[0] for name, row in zip(recorded, rows, strict=False)},
        {name: units[name] for name in recorded},
        {f"{name}_0" if name in layout.continued else name: ends[name] for name in going if name in ends},
        failed,
        {} if many else {name: rows[recording.index(name)][0] for name in layout.commands},
        "us" if layout.pulse else "1",
    )


def _warn_if_turned_over(name: str, times: Array, quaternion: Array) -> None:
    """Warn when a vehicle that begins upright turns over. The quaternion has the shape (4, vehicles, times)."""
    _, roll, pitch, _ = np.square(quaternion) / np.square(quaternion).sum(axis=0)
    over = roll + pitch > 0.5  # the cosine of the tilt, R_33 = 1 - 2 (roll + pitch), is negative
    turned = over.any(axis=1) & ~over[:, 0]
    if turned.any():
        when = f"{times[over[turned].any(axis=0).argmax()]:g} s"
        warnings.warn(
            f"{name} turns over at {when}: nothing holds it level. On a real one, an autopilot does, with the "
            "vertical thrusters; command them as well, or command less thrust",
            UserWarning,
            stacklevel=4,
        )


def _dashes(curves: Sequence[Array]) -> list[Any]:
    """Return the line style of each curve of a panel.

    If curves coincide, the first is solid and the others are dashed on top of it, so that all are visible.
    """
    scale = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in curves), default=0.0)
    groups: list[list[int]] = []
    for n, values in enumerate(curves):
        for group in groups:
            if np.allclose(values, curves[group[0]], 0.0, 5e-3 * scale, equal_nan=True):
                group.append(n)
                break
        else:
            groups.append([n])
    styles: list[Any] = ["-"] * len(curves)
    for group in groups:
        for place, n in enumerate(group[1:], 1):
            styles[n] = (-_DASH * place, (_DASH, _DASH * (len(group) - 1)))
    return styles
