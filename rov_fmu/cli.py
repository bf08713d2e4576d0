"""The command rov-fmu: build, simulate, fly, prove, study, identify, tune, schema, tables, figures."""

import sys
import warnings
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import inf, isfinite, nan, nextafter
from pathlib import Path
from tempfile import mkdtemp
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from rov_fmu import __version__
from rov_fmu.engine.compile import OTHER_NAMES, PLATFORMS, BuildError, OptionError
from rov_fmu.io.file_kinds import PAGE, VEHICLE_FILE, check_written
from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import FileError, InputError, ProofError, StudyError, did_you_mean, shown
from rov_fmu.io.output import check_targets, write_whole
from rov_fmu.model.layout import AXES
from rov_fmu.process import exit_code
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY, find_vehicle

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from rov_fmu.build import Built
    from rov_fmu.study.run.cluster import Progress as StudyProgress

_EXIT_CODES = {
    FileError: 2,
    InputError: 2,
    OSError: 2,
    click.ClickException: 2,
    OptionError: 2,
    BuildError: 1,
    ProofError: 1,
    StudyError: 1,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 done, 1 build, proof or study failed, 2 bad input, 130 interrupted."""
    return exit_code("rov-fmu", lambda: _commands.main(arguments, "rov-fmu", standalone_mode=False), _EXIT_CODES)


def _vehicles(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    names = [CompletionItem(name) for name in SHIPPED if name.startswith(incomplete)]
    return [CompletionItem(incomplete, type="file"), *names]  # bash forgets what comes before "file"


_vehicle = partial(
    click.argument, "vehicle", callback=lambda _, __, given: find_vehicle(given), shell_complete=_vehicles
)


class _Choice(click.Choice[Any]):
    """One of several words; a line lists them, and names the one that an unknown word probably means."""

    def __init__(self, choices: Sequence[Any], also: Mapping[str, str] | None = None) -> None:
        """`also` has other words for the choices."""
        super().__init__(choices)
        self._also = also

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:  # noqa: ARG002
        """What is wrong with a word."""
        names = [str(choice) for choice in self.choices]
        return f"{shown(value)} must be one of {', '.join(names)}{did_you_mean(str(value), names, also=self._also)}"

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None) -> str:  # noqa: ARG002
        """What there is to choose from."""
        return f"Choose one of {', '.join(map(str, self.choices))}."


def _number(words: str, low: float = -inf, high: float = inf, kind: type[float] = float) -> Callable[[str], float]:
    """The type of an option that takes a finite number within bounds; `words` say what is allowed."""

    def number(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = nan
        if not (low <= value <= high and isfinite(value)):
            raise click.BadParameter(f"{shown(text)} must be {words}")
        return value

    return number


_FILE = click.Path(path_type=Path, readable=False)  # what cannot be read is told where it is read


@click.group(no_args_is_help=False, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rov-fmu")
def _commands() -> None:
    """An identified underwater vehicle (ROV) as an FMU.

    VEHICLE is a vehicle file (TOML) or the name of a vehicle that ships.
    """


@_commands.command("build")
@_vehicle(default=str(VIDEORAY))
@click.option(
    "-o",
    "--output",
    type=_FILE,
    metavar="FILE.fmu",
    help="Where to write it; <identifier>.fmu by default, of FMI 3.0 <identifier>.fmi3.fmu.",
)
@click.option(
    "--backend",
    type=_Choice(["native", "pythonfmu"], {"python": "pythonfmu", "c": "native"}),
    default="native",
    show_default=True,
    help="Compiled C, or pure Python with PythonFMU (FMI 2.0 alone).",
)
@click.option(
    "--fmi",
    type=_Choice([2, 3], {"2.0": "2", "3.0": "3"}),
    default=2,
    show_default=True,
    help="Version of FMI: 2.0 or 3.0.",
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    type=_Choice(["host", *PLATFORMS], OTHER_NAMES),
    metavar="NAME",
    help=f"host, {', '.join(PLATFORMS)}; may be repeated (default: all).",
)
@click.option(
    "--osp",
    is_flag=True,
    help="Also write <identifier>_OspModelDescription.xml beside it (OSP-IS 1.0.1; FMI 2.0 alone).",
)
def _build(vehicle: Path, output: Path | None, backend: str, fmi: int, platforms: tuple[str, ...], osp: bool) -> None:
    """Build the FMU of a vehicle: the VideoRay Pro 4 by default."""
    if backend == "pythonfmu" and platforms:
        raise click.UsageError("--platform: the PythonFMU flavour is the same for all platforms")
    from rov_fmu.build import build, chosen_platforms
    from rov_fmu.vehicle.vehicle import load_vehicle

    started = perf_counter()
    loaded = load_vehicle(vehicle)
    chosen = chosen_platforms(platforms, fmi) if backend == "native" else []
    with _progress(chosen) as done:
        built = build(
            loaded, output, platforms=chosen, backend=backend, fmi=fmi, osp=osp, inputs=[vehicle], on_compiled=done
        )
    _print_built(built, perf_counter() - started)


@contextmanager
def _progress(platforms: Sequence[str]) -> Iterator[Callable[[str], None]]:
    """A line a platform that is being compiled, on a terminal only; yields what to call when one is done."""
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    with _shown(SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()) as progress:
        if progress is None:
            yield lambda _: None
        else:
            tasks = {name: progress.add_task(f"compiling {name}", total=1) for name in platforms}
            yield lambda name: progress.update(tasks[name], completed=1)


@contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    """One bar, on a terminal only; yields what to call with what comes next, and the share that is done (0 ... 1)."""
    from rich.progress import BarColumn, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TextColumn("{task.description}")
    with _shown(*columns) as progress:
        if progress is None:
            yield lambda *_: None
        else:
            task = progress.add_task("reading", total=1.0)
            yield lambda words, share: progress.update(task, description=words, completed=share)


@contextmanager
def _shown(*columns: "ProgressColumn") -> "Iterator[Progress | None]":
    """Progress on a terminal, gone when it ends, however that is; None where there is none."""
    from rich.progress import Progress

    from rov_fmu.report.console import console

    out = console()
    if not out.is_terminal:
        yield None
        return
    progress = Progress(*columns, console=out, transient=True)
    progress.start()
    with cleaned_up(progress.stop):
        yield progress


def _print_built(built: "Built", seconds: float) -> None:
    """Files, sizes, times, and what the FMU showed when it was run."""
    from rich.text import Text

    from rov_fmu.report.console import console

    out = console()
    out.print(Text.assemble((str(built.path), "bold"), f"  {built.size / 1000:.0f} kB  {built.guid}"), soft_wrap=True)
    for name, size in built.binaries.items():
        out.print(f"  {name:<14}{size / 1000:6.0f} kB{built.seconds[name]:7.1f} s")
    out.print(f"  {built.note}")
    for path in built.beside:
        out.print(Text(str(path), "bold"), soft_wrap=True)
    out.print(f"  built in {seconds:.1f} s")


@_commands.command("simulate")
@_vehicle(default=str(VIDEORAY))
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="An input that is held, a coefficient, or a state at the start, in SI units; may be repeated.",
)
@click.option(
    "--input",
    "commands",
    type=_FILE,
    metavar="COMMANDS.csv",
    help="Inputs over time: the time (s) in the first column; each row is held up to the next one.",
)
@click.option(
    "--stop",
    type=_number("a number from 1e-6 (s)", 1e-6),
    help="The end, s; by default the last time of COMMANDS.csv, or 10.",
)
@click.option(
    "--step",
    type=_number("a number from 1e-6 (s)", 1e-6),
    help="The time between two results, s; 0.01 by default. It does not change the motion.",
)
@click.option("-o", "--output", type=_FILE, metavar="RESULT.csv", help="Table of the results to write, or .parquet.")
@click.option(
    "--plot",
    is_flag=False,
    flag_value=Path(),
    type=_FILE,
    metavar="[FILE.png]",
    help="Plot to write (.png, .svg, .pdf), after VEHICLE; without FILE it opens in a browser.",
)
def _simulate(
    vehicle: Path,
    settings: tuple[str, ...],
    commands: Path | None,
    stop: float | None,
    step: float | None,
    output: Path | None,
    plot: Path | None,
) -> None:
    """Simulate a vehicle without an FMU: the VideoRay Pro 4 by default.

    Inputs and states that are not set are 0. Without -o and --plot the values at the end are printed.
    """
    from rov_fmu.interface.command import check_targets_of, plot_output, print_final, run, table_output
    from rov_fmu.interface.model import load

    opens = plot == Path()
    check_targets_of(output, None if opens else plot, [path for path in (vehicle, commands) if path])
    loaded = load(vehicle)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = run(loaded, settings, commands, stop, step)
    for warning in caught:
        click.echo(f"rov-fmu: warning: {warning.message}", err=True)
    picture = Path(mkdtemp(prefix="rov-fmu-"), "simulation.svg") if opens else plot
    outputs = [table_output(result, output)] if output else []
    write_whole(*outputs, *([plot_output(result, picture)] if picture else []))
    if opens and picture:
        _open(picture)
    if not (output or picture):
        print_final(loaded, result)


@_commands.command("fly")
@_vehicle(default=str(VIDEORAY))
@click.option(
    "--against",
    callback=lambda _, __, given: given and find_vehicle(given),
    metavar="OTHER.toml",
    help="Another vehicle, which flies the same commands as a ghost. A recording is chosen on the page itself.",
    shell_complete=_vehicles,
)
@click.option(
    "-o",
    "--output",
    type=_FILE,
    metavar="PAGE.html",
    help="Where to write the page, in place of opening it in a browser.",
)
def _fly(vehicle: Path, against: Path | None, output: Path | None) -> None:
    """Fly a vehicle in a browser, without building an FMU: the VideoRay Pro 4 by default."""
    from rov_fmu.fmu.module import module
    from rov_fmu.io.output import Output
    from rov_fmu.report.page.live import Flown, fly_page
    from rov_fmu.vehicle.vehicle import load_vehicle

    paths = [vehicle, *([against] if against else [])]
    loaded = [load_vehicle(path) for path in paths]
    if output:
        check_targets([output], [*paths, *(file for one in loaded for file in one.files)])
        check_written(output, PAGE)
    page = fly_page([Flown(one, module(one.rov)) for one in loaded]).encode()
    path = output or Path(mkdtemp(prefix="rov-fmu-"), f"{loaded[0].identifier}.html")
    write_whole(Output(path, page))
    if output:
        click.echo(path)
    else:
        _open(path)


def _open(path: Path) -> None:
    """Print the path of a file, and open it in a browser."""
    click.echo(path)
    if not webbrowser.open(path.as_uri()):
        told = (
            "no browser could be opened: open this file, which needs no other, in a browser here or on another machine"
        )
        click.echo(f"rov-fmu: {told}; -o PAGE.html writes it where you want it", err=True)


@_commands.command("prove")
@click.argument("fmu", type=_FILE)
@click.option(
    "--interface",
    type=_Choice(["co-simulation", "model-exchange"], {"cs": "co-simulation", "me": "model-exchange"}),
    help="The first of these that it has, by default.",
)
@click.option(
    "--tolerance", type=_number("a number above 0", nextafter(0.0, 1.0)), help="In place of the experiments' own."
)
def _prove(fmu: Path, interface: str | None, tolerance: float | None) -> None:
    """Run the experiments that an FMU carries (FMI-LS-REF): any FMU that carries some."""
    from rov_fmu.fmu.proof import prove
    from rov_fmu.report.console import print_proof

    with _bar() as done:
        findings = prove(fmu, interface, tolerance, done)
    print_proof(findings)
    if wrong := sum(not finding.passed for finding in findings):
        raise ProofError(f"{fmu}: {wrong} of {len(findings)} results are not as expected")


@_commands.command("study")
@click.argument("plan", type=_FILE)
@click.option("-o", "--output", type=_FILE, required=True, metavar="RESULTS", help="Folder of the results.")
@click.option(
    "--workers",
    type=_number("a whole number from 1 to 1024", 1, 1024, int),
    metavar="N",
    help="Processes on this machine; as many as it has cores by default.",
)
@click.option("--scheduler", metavar="ADDRESS", help="A scheduler of Dask instead, tcp://host:8786.")
def _study(plan: Path, output: Path, workers: int | None, scheduler: str | None) -> None:
    """Do the runs of PLAN (TOML): a sweep, or what is uncertain, over any FMU for Co-Simulation.

    RESULTS has the tables runs and trajectories (Parquet) and the page study.html. What is done is kept: the same
    command goes on where an earlier one ended.
    """
    if workers and scheduler is not None:
        raise click.UsageError("study: --scheduler has the workers that it has: leave --workers out")
    try:
        from rov_fmu.study.results.page import page_output, see_place
        from rov_fmu.study.results.summary import print_summary
        from rov_fmu.study.run.run_study import run_study
    except ModuleNotFoundError as error:
        raise click.UsageError(f"study: needs {error.name}: pip install 'rov-fmu[study]'") from error
    see_place(output)
    with _runs_bar() as (tell, warn):
        spent, results = run_study(plan, output, workers, scheduler, tell, warn)
    write_whole(page_output(results))
    print_summary(results, spent)
    if len(results.failed) + len(results.incomplete) == len(results.runs):
        raise StudyError(f"{output}: no run is done, with all its figures")


@contextmanager
def _runs_bar() -> "Iterator[tuple[Callable[[StudyProgress], None], Callable[[str], None]]]":
    """A bar of runs with their rate and the time left, on a terminal only.

    Yields what to call with the progress, and with a warning, which is printed above the bar.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeRemainingColumn

    columns = (
        SpinnerColumn(),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with _shown(*columns) as progress:

        def warn(text: str) -> None:
            line = f"rov-fmu: warning: {text}"
            if progress is not None and sys.stderr and sys.stderr.isatty():
                progress.console.print(line, soft_wrap=True)
            else:
                click.echo(line, err=True)

        if progress is None:
            yield lambda _: None, warn
            return
        task = progress.add_task("starting the workers", total=None)
        began: list[tuple[float, int]] = []

        def tell(now: "StudyProgress") -> None:
            if not began:
                began.append((perf_counter(), now.done))
                if now.dashboard:
                    progress.console.print(f"what the workers do: {now.dashboard}", soft_wrap=True)
            start, before = began[0]
            rate = (now.done - before) / max(perf_counter() - start, 1e-3)
            words = f"{rate:.3g} runs/s{f', {now.failed} failed' if now.failed else ''}"
            progress.update(task, total=now.total, completed=now.done, description=words)

        yield tell, warn


@_commands.command("identify")
@click.argument("folder", type=_FILE)
@click.option("-o", "--output", type=_FILE, metavar="VEHICLE.toml", help="Vehicle file to write.")
@click.option(
    "--report",
    type=_FILE,
    metavar="REPORT.html",
    help="Report to write; a build puts it into the FMU of the vehicle file.",
)
@click.option("--force", is_flag=True, help="Replace files that identify did not write, or that have changed since.")
def _identify(folder: Path, output: Path | None, report: Path | None, force: bool) -> None:
    """Identify a vehicle from FOLDER of tank tests: rov.toml and thrust_, steady_, ... .csv."""
    from rov_fmu.identify.identify import identify
    from rov_fmu.io.seal import check_replaced
    from rov_fmu.report.console_results import print_identification
    from rov_fmu.tank.tank_tests import load_tank_tests
    from rov_fmu.vehicle.writer import check_report, vehicle_output

    if output and report:
        check_report(output, report)
    targets, replaced = [path for path in (output, report) if path], list[str]()

    def check_outputs(inputs: Sequence[Path]) -> None:
        check_targets(targets, inputs)
        for path, kind in ((output, VEHICLE_FILE), (report, PAGE)):
            if path:
                check_written(path, kind)
        replaced.extend(check_replaced(targets, force=force))

    with _bar() as done:
        tests = load_tank_tests(folder, check_outputs)
        identification = identify(tests, done)
        done("each recording predicted by the others", 0.97)
        _ = [result.held_out for result in identification.axes]  # now, and not when it is printed
        identified, outputs = identification.vehicle, []
        if report:
            from rov_fmu.report.report import report_output

            done("drawing the report", 1.0)
            outputs.append(report_output(identification, report))
    if report:
        assert identified.provenance
        identified = replace(identified, provenance=replace(identified.provenance, report=report))
    if output:
        outputs.append(vehicle_output(identified, output))
    write_whole(*outputs)
    for told in replaced:
        click.echo(told)
    print_identification(identification)


@_commands.command("tune")
@_vehicle()
@click.option("--axis", required=True, type=_Choice(list(AXES), {axis.velocity: name for name, axis in AXES.items()}))
@click.option(
    "--command",
    type=_number("a number within -1 ... 1 and not 0, a fraction of full thrust: 30 % is 0.3"),
    help="Held by every input that drives the axis, positive along it: 30 % of full thrust is 0.3.",
)
@click.option(
    "--v-ss",
    type=_number("a number (V_ss in m/s or rad/s)"),
    help="Wanted steady velocity at this command, m/s or rad/s.",
)
@click.option(
    "--tau", type=_number("a number (Tau in s)"), help="Wanted time constant at this command, s; without it beta stays."
)
@click.option(
    "--points", type=_FILE, metavar="POINTS.csv", help="Many wanted points instead: command, velocity, time constant."
)
@click.option("-o", "--output", type=_FILE, metavar="TUNED.toml", help="Vehicle file to write.")
def _tune(
    vehicle: Path,
    axis: str,
    command: float | None,
    v_ss: float | None,
    tau: float | None,
    points: Path | None,
    output: Path | None,
) -> None:
    """Find alpha and beta of an axis for a wanted response."""
    from rov_fmu.identify.tuning import TuningError, implausible, read_points, tune, tune_over, tuned_values
    from rov_fmu.report.console_results import print_tuning
    from rov_fmu.vehicle.vehicle import load_vehicle
    from rov_fmu.vehicle.writer import write_tuned

    if points is not None and (command, v_ss, tau) != (None, None, None):
        raise click.UsageError("tune: --points stands instead of --command, --v-ss and --tau")
    loaded, tested = load_vehicle(vehicle), AXES[axis]
    if not loaded.layout.has(tested):
        raise click.UsageError(f"tune: {vehicle}: --axis {axis}: the vehicle has only {', '.join(loaded.layout.kinds)}")
    if output:
        check_targets([output], filter(None, (points,)))
        check_written(output, VEHICLE_FILE)
    try:
        if points is not None:
            tuning = tune_over(loaded.rov, tested, read_points(points, loaded.rov, tested))
        elif command is not None and v_ss is not None:
            tuning = tune(loaded.rov, tested, command, v_ss, tau)
        else:
            raise click.UsageError("tune: give --command and --v-ss (and --tau), or --points")
    except TuningError as error:
        raise click.UsageError(f"tune: {error}") from error
    if output:
        write_tuned(vehicle, output, *tuned_values(tuning))
    print_tuning(tuning)
    for told in implausible(tuning):
        click.echo(f"rov-fmu: warning: {told}", err=True)


@_commands.command("schema")
def _schema() -> None:
    """Print the JSON schema of the vehicle file, for editors."""
    from rov_fmu.vehicle.json_schema import json_schema_text

    click.echo(json_schema_text(), nl=False)


@_commands.command("tables")
@_vehicle(default=str(VIDEORAY))
def _tables(vehicle: Path) -> None:
    """Print Tables 6-8 of the paper: printed, computed, measured."""
    from rov_fmu.report.console import print_tables
    from rov_fmu.vehicle.published import load_tables
    from rov_fmu.vehicle.vehicle import load_vehicle

    loaded = load_vehicle(vehicle)
    print_tables(loaded, load_tables(loaded))


@_commands.command("figures")
@click.argument("folder", type=_FILE)
def _figures(folder: Path) -> None:
    """Redraw the paper's figures, as far as it prints their data, into FOLDER, which is there already."""
    from rov_fmu.report.plots.paper_figures import write_figures

    print(*write_figures(folder), sep="\n")
