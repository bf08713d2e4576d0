"""The command `rov-fmu simulate`: what its options mean, and what it writes and prints."""

from collections.abc import Sequence
from io import BytesIO, StringIO
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.interface.arguments import TIME
from rov_fmu.interface.model import VehicleModel
from rov_fmu.interface.result import Result
from rov_fmu.io.messages import FileError, InputError, did_you_mean, shown
from rov_fmu.io.output import Output, check_targets
from rov_fmu.io.reading import read_text
from rov_fmu.io.time_series import Series, series
from rov_fmu.report.console import console, table

STOP, STEP = 10.0, 0.01
"""The default end of a simulation and the time between two results, s: those of the FMU's default experiment."""
_SHORTEST = 1e-6  # s
_MOST_TIMES = 1_000_000
_TABLES, _PICTURES = (".csv", ".parquet"), (".png", ".svg", ".pdf")


def check_targets_of(output: Path | None, plot: Path | None, inputs: Sequence[Path]) -> None:
    """Raise InputError about a file to write whose suffix does not say how, or WriteError if it cannot be written."""
    for option, path, suffixes in (("--output", output, _TABLES), ("--plot", plot, _PICTURES)):
        if path and path.suffix.lower() not in suffixes:
            raise InputError(f"{option} {path}: the name must end with {', '.join(suffixes[:-1])} or {suffixes[-1]}")
    check_targets(filter(None, (output, plot)), inputs)


def run(
    vehicle: VehicleModel, settings: Sequence[str], commands: Path | None, stop: float | None, step: float | None
) -> Result:
    """Simulate a vehicle as the options say. Raises InputError, FileError, BuildError."""
    inputs: dict[str, Any] = {}
    if commands:
        times, *columns = _read_commands(commands, vehicle).items()
        inputs = {TIME: times[1], **dict(columns)}
        stop = times[1][-1] if stop is None else stop
        if stop < _SHORTEST:
            raise FileError(
                f"{commands}: the last time is {stop:g} s, and must be at least {_SHORTEST:g}, without --stop"
            )
    coefficients: dict[str, float] = {}
    start: dict[str, float] = {}
    layout = vehicle.layout
    for name, value in _read_settings(settings, [*layout.inputs, *layout.state, *layout.coefficients]).items():
        if name in inputs:
            raise InputError(f"--set {name}: {commands} has this input, too")
        (inputs if name in layout.inputs else start if name in layout.state else coefficients)[name] = value
    end, step = STOP if stop is None else stop, STEP if step is None else step
    if end / step > _MOST_TIMES:
        raise InputError(f"--step {step:g}: gives more than {_MOST_TIMES} results up to {end:g} s")
    time = np.round(step * np.arange(int(end / step) + 2), 12)  # 0.3, and not 3 * 0.1 = 0.30000000000000004
    time = np.append(time[time < end - 1e-9], end)
    return vehicle.with_(**coefficients).simulate(time, inputs, start=start)


def _read_settings(settings: Sequence[str], names: Sequence[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for text in settings:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise InputError(f"--set {text}: must be NAME=VALUE, such as u_l=0.3")
        if name not in names:
            hint = did_you_mean(name, names)
            raise InputError(f"--set {text}: the vehicle has no such input, state or coefficient{hint}")
        if name in found:
            raise InputError(f"--set {text}: {name} is set before")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = nan
        if not isfinite(found[name]):
            raise InputError(f"--set {text}: {shown(value)} must be a finite number")
    return found


def _read_commands(path: Path, vehicle: VehicleModel) -> Series:
    """Read a table of commands: the time (s) in the first column, and an input by its name in each other one."""
    inputs = vehicle.layout.inputs

    def error(reason: str) -> FileError:
        return FileError(f"{path}: {reason}")

    def check_column(name: str) -> None:
        if name not in inputs:
            raise error(
                f"column {shown(name)}: there is no such input, only {', '.join(inputs)}{did_you_mean(name, inputs)}"
            )

    return series(read_text(path), error, check_column)


def table_output(result: Result, path: Path) -> Output:
    """Return the file of a result: a column for the time and one for each variable. Raises InputError."""
    if path.suffix.lower() == ".parquet":
        try:
            import pyarrow  # noqa: F401

            content = result.to_dataframe().reset_index().to_parquet(index=False)
        except ImportError as error:
            raise InputError(
                f"--output {path}: Parquet needs pandas and pyarrow: pip install pandas pyarrow"
            ) from error
        return Output(path, content)
    text = StringIO()
    text.write(f"{','.join([TIME, *result.names])}\n")
    for row in zip(result.time.tolist(), *(values.tolist() for values in result.values()), strict=True):
        text.write(f"{','.join(map(repr, row))}\n")
    return Output(path, text.getvalue().encode())


def plot_output(result: Result, path: Path) -> Output:
    """Return the plot of a result as a file."""
    from matplotlib.figure import Figure

    picture = BytesIO()
    result.plot(figure=Figure(layout="constrained")).savefig(picture, format=path.suffix[1:].lower())
    return Output(path, picture.getvalue())


def print_final(vehicle: VehicleModel, result: Result) -> None:
    """Print the values at the end."""
    found = table(f"{vehicle.name} after {result.time[-1] - result.time[0]:g} s", "variable", ["value"], ["unit"])
    for name, values in result.items():
        found.add_row(name, f"{values[-1]:.6g}", "" if result.units[name] == "1" else result.units[name])
    console().print(found)
