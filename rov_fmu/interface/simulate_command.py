"""The command `rov-fmu simulate`: the meaning of its options, the files that it writes, and what it prints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from math import ceil, floor, isfinite, log10, nan
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, TypeVar

from rov_fmu.equation.layout import Layout
from rov_fmu.equation.words import AFLOAT, LEFT_WATER
from rov_fmu.interface.arguments import STEP, TIME, name_at_start, result_times
from rov_fmu.interface.model import VehicleModel, load
from rov_fmu.interface.result import Result
from rov_fmu.io.messages import FileError, InputError, one_line, only, print_message, shown, wrapped
from rov_fmu.io.numbers import csv_of
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import console, paragraph, print_end, print_table, shell_words, table
from rov_fmu.vehicle.shipped import shipped_name
from rov_fmu.vehicle.steady import Steady
from rov_fmu.vehicle.vehicle import Vehicle

AnyVehicle = TypeVar("AnyVehicle", bound=Vehicle)

_STOP = 10.0
"""The default end of a simulation, s, as in the FMU's default experiment."""
_SHORTEST = 1e-6
"""The shortest simulation, s."""
_MOST_RESULTS = 1_000_000
_TABLE_SUFFIXES, _PLOT_SUFFIXES = (".csv", ".parquet"), (".png", ".svg", ".pdf")


def simulate_vehicle(
    path: Path,
    *,
    settings: Sequence[str],
    commands: Path | None,
    stop: float | None,
    step: float | None,
    output: Path | None,
    plot: Path | None,
    force: bool,
) -> None:
    """Simulate the vehicle of a file, and write or print what is asked for.

    - `settings`, `commands`: what --set has, and the file of --input.
    - `stop`, `step`: the time at the end, and that between two results, s.
    - `plot`: the picture; an empty path for one that a browser shows.

    Raises FileError, InputError, BuildError, WriteError.
    """
    opens, vehicle = plot == Path(), load(path)
    check_outputs(output, None if opens else plot, [path, *vehicle.files, *filter(None, [commands])], force=force)
    result = simulation_of(vehicle, settings, commands, stop, step)
    if vehicle.layout.has_only_water and "z" in result and (above := result["z"] < -AFLOAT).any():
        print_message(f"rov-fmu: {LEFT_WATER.format(f'{result.time[above.argmax()]:g}')}")
    picture = Path(mkdtemp(prefix="rov-fmu-"), "simulation.svg") if opens else plot
    outputs = []
    if output:
        outputs.append(_table_output(result, output))
    if picture:
        outputs.append(_plot_output(result, picture, title(vehicle, settings, commands)))
    written = write_whole(*outputs, force=force)
    if opens and picture:
        from rov_fmu.interface.fly_command import open_in_browser  # imported here because pages are slow

        open_in_browser(picture, "--plot FILE.svg")
    if output or picture:
        following = "" if opens else "open the plot" if plot else "add --plot to see the curves"
        print_end({path: old for path, old in written.items() if path in (output, plot)}, following)
    else:
        print_final(vehicle, result, has_no_input=not commands and not _moves(settings, vehicle.layout))


def find_speeds(path: Path, wanted: Sequence[str], settings: Sequence[str]) -> None:
    """Print the command, the thrust and the electric power that steady speeds take, each given as `surge=1.0`.

    `settings` may have coefficients, loads and the voltage. Raises FileError, InputError.
    """
    vehicle, given = with_settings(load(path), settings)
    chosen = vehicle.layout.commands.keys() | vehicle.layout.by_name.keys() | given.start.keys()
    for name in (name for name in (*given.inputs, *given.start) if name in chosen):
        raise InputError(f"--set {name}: --find chooses commands and states itself")
    rows = [_found(vehicle, text, given.inputs) for text in wanted]
    power = [] if rows[0].power is None else ["power"]
    found = table("", "axis", ["speed", "command", "thrust", *power])
    for row in rows:
        cells = [f"{row.velocity:.4g} {row.axis.unit}", f"{row.command:.4f}", f"{row.thrust:.4g} {row.axis.load}"]
        found.add_row(row.axis.name, *cells, *([] if row.power is None else [f"{row.power:.4g} W"]))
    paragraph(console(), f"What holds a steady speed of {vehicle.name}, each axis alone:")
    print_table(found)
    for row in rows:
        low, high = vehicle.tested_along(row.axis)
        if not low <= row.command <= high:
            paragraph(console(), f"- {row.axis.name}: tests had commands from {low:.0%} to {high:.0%}, not beyond")
        for other, push in vehicle.side_effects(row.axis, row.command):
            words = f"this command also pushes {other.name} with {push:.3g} {other.load}, which is left out here"
            paragraph(console(), f"- {row.axis.name}: {words}")
    first = f"{rows[0].axis.name}={rows[0].command:.4f}"
    sets = [word for setting in (first, *settings) for word in ("--set", setting)]
    print_end({}, shell_words("rov-fmu", "simulate", shipped_name(path) or path, *sets))


def _found(vehicle: VehicleModel, text: str, inputs: Mapping[str, float]) -> Steady:
    """Return the steady motion for a text such as `surge=1.0`. Raises InputError."""
    name, _, value = (part.strip() for part in text.partition("="))
    try:
        velocity = float(value)
    except ValueError:
        velocity = nan
    if name in vehicle.layout.by_name and not isfinite(velocity):
        unit = vehicle.layout.by_name[name].axis.unit
        raise InputError(f"--find {text}: {shown(value)} must be a finite number, {unit}")
    try:
        return vehicle.find(name, velocity, inputs)
    except InputError as error:
        raise InputError(f"--find {text}: {error}") from error


def check_outputs(output: Path | None, plot: Path | None, inputs: Sequence[Path], *, force: bool = False) -> None:
    """Check the paths of the table and of the plot before the simulation.

    Raises InputError if the suffix of a path is not that of a known format, and WriteError if it cannot be written.
    """
    for option, path, suffixes in (("--output", output, _TABLE_SUFFIXES), ("--plot", plot, _PLOT_SUFFIXES)):
        if path and path.suffix.lower() not in suffixes:
            last = "; put --plot without a file after VEHICLE" if option == "--plot" and not path.suffix else ""
            endings = f"{', '.join(suffixes[:-1])} or {suffixes[-1]}"
            raise InputError(f"{option} {path}: the name must end with {endings}{last}")
    check_targets([(output, ""), (plot, "")], inputs, force=force)


def simulation_of(
    vehicle: VehicleModel,
    settings: Sequence[str],
    commands: Path | None,
    stop: float | None,
    step: float | None,
) -> Result:
    """Simulate a vehicle as the options say. Raises InputError, FileError, BuildError."""
    inputs: dict[str, Any] = {}
    if commands:
        from rov_fmu.interface.command_files import read_inputs  # imported here because readers of logs are slow

        inputs = {**read_inputs(commands, vehicle.layout)}
        if stop is None:
            stop = float(inputs[TIME][-1])
        if stop < _SHORTEST:
            raise FileError(
                f"{commands}: the last time is {stop:g} s, and must be at least {_SHORTEST:g}, without --stop"
            )
    changed, given = with_settings(vehicle, settings)
    for name in given.inputs:
        if name in inputs:
            raise InputError(f"--set {name}: {commands} has this input, too")
    if stop is not None and step is None and stop / STEP > _MOST_RESULTS:
        ends = f"--stop {stop:g}" if commands is None or stop != inputs[TIME][-1] else f"{commands}, up to {stop:g} s,"
        raise InputError(f"{ends} needs a longer --step than {STEP:g} s: at least {_least_step(stop):g} s")
    stop, step = _STOP if stop is None else stop, STEP if step is None else step
    if stop / step > _MOST_RESULTS:
        raise InputError(f"--step {step:g}: gives more than {_MOST_RESULTS} results up to {stop:g} s")
    return changed.simulate(result_times(stop, step), inputs | given.inputs, start=given.start)


def _least_step(stop: float) -> float:
    """Return the shortest allowed time between results for a simulation of this length, s, rounded up to three
    digits."""
    least = stop / _MOST_RESULTS
    digit = 10.0 ** (floor(log10(least)) - 2)
    return ceil(round(least / digit, 6)) * digit


@dataclass(frozen=True)
class Settings:
    """The values of the options --set, by name."""

    inputs: dict[str, float]
    """The inputs; the name of an axis stands for the commands that drive it."""
    start: dict[str, float]
    coefficients: dict[str, float]


def with_settings(vehicle: AnyVehicle, settings: Sequence[str]) -> tuple[AnyVehicle, Settings]:
    """Return a vehicle with the coefficients of the options --set, and what else they set. Raises InputError.

    A dead time T_d may be set where the file has none.
    """
    if any(text.partition("=")[0].strip() == "T_d" for text in settings):
        vehicle = vehicle.with_(replace(vehicle.layout, has_dead_time=True))
    given = read_settings(settings, vehicle.layout)
    return vehicle.with_(**given.coefficients), given


def read_settings(settings: Sequence[str], layout: Layout) -> Settings:
    """Return the values of the options --set: inputs, initial values and coefficients. Raises InputError."""
    variables = {**layout.inputs, **layout.state, **layout.initial, **layout.coefficients}
    names = [*layout.by_name, *variables]
    values: dict[str, float] = {}
    for text in settings:
        given, _, value = (part.strip() for part in text.partition("="))
        name = name_at_start(given, layout)
        if name not in names and name in layout.calculated:
            raise InputError(f"--set {text}: {name} is an output, which cannot be set")
        if name not in names:
            known = only(name, names)
            raise InputError(f"--set {text}: the vehicle has no such input, axis, state or coefficient{known}")
        if name in values:
            raise InputError(f"--set {text}: {name} is set twice")
        try:
            values[name] = float(value)
        except ValueError:
            values[name] = nan
        if not isfinite(values[name]):
            percent = _percent(value) if name in layout.by_name or variables[name].unit == "1" else ""
            raise InputError(f"--set {text}: {shown(value)} must be a finite number{percent}")
    kinds = (layout.inputs | layout.by_name, layout.state | layout.initial, layout.coefficients)
    return Settings(*({name: value for name, value in values.items() if name in own} for own in kinds))


def _percent(text: str) -> str:
    """Return a hint for a value in percent, or an empty text."""
    try:
        number = float(text.removesuffix("%")) if text.endswith("%") else nan
    except ValueError:
        number = nan
    return f": {number:.6g} % is {number / 100.0:.6g}" if isfinite(number) else ""


def _moves(settings: Sequence[str], layout: Layout) -> bool:
    """Return True if an option --set has an input or a state, so that the vehicle may move, and not a coefficient."""
    return any(setting.partition("=")[0].strip() not in layout.coefficients for setting in settings)


def title(vehicle: VehicleModel, settings: Sequence[str], commands: Path | None) -> str:
    """Return the title of a plot: the vehicle, and what the options set."""
    given = [f"commands of {shell_words(commands.name)}"] if commands else []
    given += map(one_line, settings)
    return f"{vehicle.name}: {', '.join(given) or 'no commands'}"


def _table_output(result: Result, path: Path) -> Output:
    """Return the table of a result: a column for the time and one for each variable. Raises InputError."""
    if path.suffix.lower() == ".parquet":
        try:
            import pyarrow  # noqa: F401

            content = result.to_dataframe().reset_index().to_parquet(index=False)
        except ImportError as error:
            raise InputError(
                f"--output {path}: Parquet needs pandas and pyarrow: pip install pandas pyarrow"
            ) from error
        return Output(path, content)
    rows = zip(result.time.tolist(), *(values.tolist() for values in result.values()), strict=True)
    return Output(path, csv_of([TIME, *result.names], rows).encode())


def _plot_output(result: Result, path: Path, title: str) -> Output:
    """Return the plot of a result, in the format of the path's suffix."""
    from matplotlib.figure import Figure

    from rov_fmu.report.plots.svg import without_font_warnings

    figure = result.plot(figure=Figure(layout="constrained"))
    figure.suptitle(wrapped(title, 90), fontsize="medium", parse_math=False)
    picture = BytesIO()
    with without_font_warnings():
        figure.savefig(picture, format=path.suffix[1:].lower())
    content = picture.getvalue()
    return Output(path, sealed(content.decode(), "simulate").encode() if path.suffix.lower() == ".svg" else content)


def print_final(vehicle: VehicleModel, result: Result, *, has_no_input: bool) -> None:
    """Print the values at the end as a table, and how to set a command if the simulation has no input at all."""
    ends = table(f"{vehicle.name} after {result.time[-1]:g} s", "variable", ["value"], ["unit"])
    for name, values in result.items():
        ends.add_row(name, f"{values[-1] + 0.0:.6g}", result.units[name])  # -0 becomes 0
    print_table(ends)
    if has_no_input:
        name = next(iter(vehicle.layout.commands))
        paragraph(console(), f"No command is set: try --set {name}={vehicle.layout.command_of(0.3):g}")
