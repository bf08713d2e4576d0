"""The command rov-fmu: list, build, simulate, fly, sitl, export, prove, system, study, identify, inspect, tune, schema.

Each command is a short function that imports its modules only when it is called. Therefore `--help` and completion are
fast.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from math import inf
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from rov_fmu.c.compile import BACKENDS, FMI_VERSIONS, INTERFACES, OTHER_NAMES, PLATFORMS, BuildError, OptionError
from rov_fmu.equation.catalogue import AXES
from rov_fmu.interface.export_command import EXPORTS, export
from rov_fmu.io.messages import (
    FileError,
    InputError,
    ProofError,
    StudyError,
    did_you_mean,
    listed,
    one_line,
    print_message,
    shown,
)
from rov_fmu.io.numbers import TIME_LIMITS, TOLERANCES, WORKERS, NumberRange
from rov_fmu.io.program import program
from rov_fmu.process import exit_code
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY, find_vehicle, shipped_name

if TYPE_CHECKING:
    from rov_fmu.build import Built

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
    """Run the command line and return its exit code.

    It is 0 when the command is done, 1 when a build, a proof or a study failed, 2 for bad input, and 130 when the
    command was interrupted.
    """

    def run() -> None:
        with _warnings_printed():
            _commands.main(arguments, "rov-fmu", standalone_mode=False)

    return exit_code("rov-fmu", run, _EXIT_CODES)


# ---- Types of arguments and options ----------------------------------------------------------------------------------


def _complete_vehicle(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Complete the name of a vehicle that ships, or the path of a file."""
    names = [CompletionItem(name) for name in SHIPPED if name.startswith(incomplete)]
    return [CompletionItem(incomplete, type="file"), *names]  # bash forgets what comes before "file"


_vehicle = partial(
    click.argument, "vehicle", callback=lambda _, __, given: find_vehicle(given), shell_complete=_complete_vehicle
)


def _find_given(_: click.Context, __: click.Parameter, given: str | None) -> Path | None:
    """Return the vehicle file of an option, if it is given."""
    return None if given is None else find_vehicle(given)


_DEFAULT = "no vehicle is given"


def _or_videoray(context: click.Context, _: click.Parameter, given: str | None) -> Path:
    """Return the vehicle file that is given, or that of the VideoRay, which a command that is done then tells."""
    context.meta[_DEFAULT] = given is None
    return VIDEORAY if given is None else find_vehicle(given)


_vehicle_or_videoray = partial(_vehicle, required=False, callback=_or_videoray)


class _Choice(click.Choice[Any]):
    """One of several words. A wrong word leads to one line that lists the choices and names the most similar one."""

    def __init__(self, choices: Sequence[Any], also: Mapping[str, str] | None = None) -> None:
        """`also` maps other words that people use to the choices."""
        super().__init__(choices)
        self._also = also

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:  # noqa: ARG002
        """Return the message about a word that is not a choice."""
        names = [str(choice) for choice in self.choices]
        return f"{shown(value)} must be one of {', '.join(names)}{did_you_mean(str(value), names, also=self._also)}"

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None) -> str:  # noqa: ARG002
        """Return the message about an option that is missing."""
        return f"Choose one of {', '.join(map(str, self.choices))}."


def _one_of(numbers: NumberRange) -> Callable[[str], float]:
    """Return the type of an option that takes one of these numbers."""

    def number(text: str) -> float:
        try:
            return numbers.checked("", numbers.kind(text))  # type: ignore[no-any-return]
        except ValueError:
            raise click.BadParameter(f"{shown(text)} must be {numbers.allowed}") from None

    return number


def _number(allowed: str, least: float = -inf, most: float = inf, kind: type[float] = float) -> Callable[[str], float]:
    """Return the type of an option that takes a finite number within bounds; `allowed` describes it in messages."""
    return _one_of(NumberRange(allowed, least, most, kind))


def _seconds(least: str) -> Callable[[str], float]:
    """Return the type of an option that takes a time, s."""
    return _number(f"a number of at least {least} s", float(least))


def _setting(text: str) -> str:
    """Return the text of an option that sets a value."""
    if "=" not in text:
        raise click.BadParameter(f"{shown(text)} must be NAME=VALUE, such as u_l=0.3")
    return text


_FILE = click.Path(path_type=Path, readable=False)  # whether it can be read is checked by the code that reads it
_file_option = partial(click.option, type=_FILE)
_output_option = partial(_file_option, "-o", "--output")
_force_option = partial(
    click.option,
    "--force",
    is_flag=True,
    help="Replace files that rov-fmu did not write, or that have changed since.",
)
_set_option = partial(click.option, "--set", "settings", multiple=True, type=_setting, metavar="NAME=VALUE")


_GONE = {
    ("sdf",): "rov-fmu export --to sdf",
    ("tables",): "python -m verification.tables in a checkout",
    ("identify", "--inspect"): "rov-fmu inspect",
    ("identify", "--draft"): "rov-fmu inspect --draft",
}
"""The words of commands of earlier versions, and what does the same now."""
_SECTIONS = {
    "What most people do": ("identify", "fly", "build"),
    "Your vehicle": ("inspect", "tune", "simulate", "list"),
    "At work": ("sitl", "system", "study"),
    "For others": ("export", "prove", "schema"),
}
"""The commands in the order of the help: what most people do comes first."""


class _Command(click.Command):
    """A command with an example, which is the end of its help."""

    def __init__(self, *, example: str, **options: Any) -> None:
        super().__init__(epilog=f"Example: {example}", **options)
        self.example = example


class _Commands(click.Group):
    """The commands by their sections. Without a command, the help is printed.

    It shows the complete summary of each command, and its example.
    """

    command_class = _Command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write each section. Click would cut the summaries to a line."""
        for title, names in _SECTIONS.items():
            rows: list[tuple[str, str]] = []
            for command in (self.commands[name] for name in names):
                assert isinstance(command, _Command)
                rows += [(command.name or "", command.get_short_help_str(limit=1000)), ("", command.example)]
            with formatter.section(title):
                formatter.write_dl(rows)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Return the command that the arguments name. Raises UsageError with what a command that is gone is now."""
        for words, now in _GONE.items():
            if args[0] == words[0] and {*words} <= {*args}:
                raise click.UsageError(f"{' '.join(words)} is gone: use {now}")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names of the commands in the order of the sections."""
        return [name for names in _SECTIONS.values() for name in names]


def _tell_version(context: click.Context, _: click.Parameter, is_asked: bool) -> None:
    if is_asked:
        click.echo(program())
        context.exit()


@click.group(
    cls=_Commands,
    no_args_is_help=False,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_tell_version,
    help="Show the version and exit.",
)
@click.pass_context
def _commands(context: click.Context) -> None:
    """Make an FMU of an identified underwater vehicle (ROV).

    VEHICLE is a vehicle file (TOML) or the name of a vehicle that ships, which `rov-fmu list` lists. An example follows
    what each command does.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@_commands.result_callback()
@click.pass_context
def _done(context: click.Context, _: object) -> None:
    """Tell that the vehicle is the VideoRay because none was given."""
    if context.meta.get(_DEFAULT):
        print_message(f"rov-fmu: {_DEFAULT}, so this is the VideoRay")


# ---- build -----------------------------------------------------------------------------------------------------------


@_commands.command("build", example="rov-fmu build bluerov2 -o bluerov2.fmu")
@_vehicle_or_videoray()
@_output_option(
    metavar="FILE.fmu",
    help="File to write. The default is <identifier>.fmu, or <identifier>.fmi3.fmu for FMI 3.0.",
)
@click.option(
    "--backend",
    type=_Choice(BACKENDS, {"python": "pythonfmu", "c": "native"}),
    default="native",
    show_default=True,
    help="Compiled C, or Python with PythonFMU (FMI 2.0 only).",
)
@click.option(
    "--fmi",
    type=_Choice(FMI_VERSIONS, {"2.0": "2", "3.0": "3"}),
    default=2,
    show_default=True,
    help="Version of FMI.",
)
@click.option(
    "--interface",
    type=_Choice([*INTERFACES], {"co-simulation": "cs", "model-exchange": "me"}),
    help="Co-Simulation, Model Exchange or both. The default is both, or cs for Python.",
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    type=_Choice(["host", *PLATFORMS], OTHER_NAMES),
    metavar="NAME",
    help=f"Platform to compile for: host, {', '.join(PLATFORMS)}. It may be repeated; the default is all with 64 bits.",
)
@_force_option()
def _build(vehicle: Path, **options: Any) -> None:
    """Build the FMU of a vehicle. The default is the VideoRay Pro 4."""
    if options["backend"] == "pythonfmu" and options["platforms"]:
        raise click.UsageError("--platform: the PythonFMU flavour is the same for all platforms")
    from rov_fmu.build import build_fmu
    from rov_fmu.report.progress import compiling
    from rov_fmu.vehicle.vehicle import load_vehicle

    started = perf_counter()
    loaded = load_vehicle(vehicle)
    with compiling() as (begin, done):
        built = build_fmu(loaded, inputs=[vehicle], on_content=begin, on_compiled=done, **options)
    _print_built(built, perf_counter() - started)


def _print_built(built: "Built", seconds: float) -> None:
    """Print the size of the FMU and of its binaries, the times, what it did when it was run, and what to do next."""
    from rov_fmu.report.console import console, paragraph, print_end, shell_words

    out = console()
    if built.lost:
        paragraph(out, f"Replaced {shell_words(built.path)}, which also had {listed(built.lost)}.")
    size = f"{built.size / 1000:.0f} kB, built in {seconds:.1f} s, GUID {built.guid}"
    paragraph(out, f"{shell_words(built.path)}: {size}")
    if len(built.seconds) > 1:
        paragraph(out, "The compilers ran in parallel. Each time is that from their start to the end of one:")
    for name, size_of_binary in built.binaries.items():
        time = f"{built.seconds[name]:7.1f} s" if name in built.seconds else ", compiled for the wheel"
        out.print(f"  {name:<14}{size_of_binary / 1000:6.0f} kB{time}")
    paragraph(out, built.note)
    following = shell_words("rov-fmu", "prove", built.path) if built.was_run else ""
    print_end(built.written, following)


# ---- list ------------------------------------------------------------------------------------------------------------


@_commands.command("list", example="rov-fmu list")
@click.argument("folder", type=_FILE, default=".")
def _list(folder: Path) -> None:
    """List the vehicles and companions that ship, and a folder's files.

    Each file is listed with what it is for. The default is the current folder.
    """
    from rov_fmu.bridges.system.system_command import companions
    from rov_fmu.io.file_kinds import kind_of, use_of
    from rov_fmu.io.toml_file import read_toml
    from rov_fmu.report.console import console, print_table, table
    from rov_fmu.vehicle.vehicle import load_vehicle

    if not folder.is_dir():
        raise FileError(f"{folder}: must be a folder")
    files: list[tuple[str, ...]] = []
    for path in sorted(folder.iterdir()):
        keys: Iterable[str] = ()
        if path.suffix.lower() == ".toml" and path.is_file():
            with suppress(FileError):
                keys = read_toml(path, FileError)
        if path.is_file() and (kind := kind_of(path, keys)):
            files.append((one_line(path.name), kind, use_of(kind)))
    vehicles = [(name, load_vehicle(path).description) for name, path in SHIPPED.items()]
    for titles, rows in {
        ("VEHICLE", "what it is"): vehicles,
        ("COMPANION", "what it is; `rov-fmu system --list` has its variables"): companions().items(),
        ("FILE", "what it is", "what it is for"): files,
    }.items():
        shown_table = table("", titles[0], [], titles[1:])
        for row in rows:
            shown_table.add_row(*row)
        if rows:
            print_table(shown_table)
            console().print()


# ---- simulate --------------------------------------------------------------------------------------------------------


@_commands.command("simulate", example="rov-fmu simulate bluerov2 --set surge=0.3 --plot")
@_vehicle_or_videoray()
@_set_option(
    help="Set an input, a coefficient, or a state at the start, in SI units. The name of an axis commands all "
    "thrusters that drive it: surge=0.3 is 30 % ahead. It may be repeated.",
)
@_file_option(
    "--input",
    "commands",
    metavar="FILE",
    help="Inputs over time: any log that identify reads, or a table (.csv) of the time (s) and of inputs (0.3 is a "
    "command of 30 %). Each row is held up to the next one.",
)
@click.option(
    "--stop",
    type=_seconds("1e-6"),
    help="Time at the end, s. The default is the last time of --input FILE, or 10.",
)
@click.option(
    "--step",
    type=_seconds("1e-6"),
    help="Time between two results, s, which does not change the motion. The default is 0.01.",
)
@_output_option(
    metavar="RESULT.csv",
    help="Results to write (.csv or .parquet).",
)
@_file_option(
    "--plot",
    is_flag=False,
    flag_value=Path(),
    metavar="[FILE.png]",
    help=("Plot to write (.png, .svg, .pdf). Put this option after VEHICLE. Without FILE, a browser shows the plot."),
)
@click.option(
    "--find",
    "wanted",
    multiple=True,
    metavar="AXIS=SPEED",
    help="Print the command, thrust and electric power that hold a speed (m/s, rad/s) along an axis, such as "
    "surge=1.0, in place of a simulation. It may be repeated.",
)
@_force_option()
def _simulate(vehicle: Path, wanted: tuple[str, ...], **options: Any) -> None:
    """Simulate a vehicle without an FMU, or find the thrust for a speed. The default is the VideoRay Pro 4.

    Inputs that are not set have their usual values, and states start at 0. Without -o and --plot the values at the end
    are printed.
    """
    from rov_fmu.interface.simulate_command import find_speeds, simulate_vehicle

    if not wanted:
        simulate_vehicle(vehicle, **options)
        return
    if others := [name for name, value in options.items() if value not in (None, False) and name != "settings"]:
        option = {"commands": "input"}.get(others[0], others[0])
        raise click.UsageError(f"simulate: --find simulates nothing: leave --{option} out")
    find_speeds(vehicle, wanted, options["settings"])


@contextmanager
def _warnings_printed() -> Iterator[None]:
    """Print the warnings for the user as they come, each in one line and once."""
    told = set[str]()

    def tell(message: Warning | str, *_: object) -> None:
        if str(message) not in told:
            told.add(str(message))
            _warn(str(message))

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = tell  # type: ignore[assignment]
        yield


def _warn(message: str) -> None:
    print_message(f"rov-fmu: warning: {message}")


# ---- fly -------------------------------------------------------------------------------------------------------------


@_commands.command("fly", example="rov-fmu fly bluerov2")
@_vehicle_or_videoray()
@click.option(
    "--against",
    callback=_find_given,
    metavar="OTHER.toml",
    help=("Another vehicle, which is shown as a ghost and gets the same commands."),
    shell_complete=_complete_vehicle,
)
@_file_option(
    "--recording",
    metavar="LOG",
    help="A log that identify reads, with the rov.toml beside it: the vehicle flies its commands beside what was "
    "measured.",
)
@_output_option(metavar="PAGE.html", help="Page to write; no browser is opened.")
@_force_option()
def _fly(
    vehicle: Path,
    against: Path | None,
    recording: Path | None,
    output: Path | None,
    *,
    force: bool,
) -> None:
    """Fly a vehicle in a browser, without building an FMU. The default is the VideoRay Pro 4."""
    from rov_fmu.interface.fly_command import open_in_browser, write_fly_page
    from rov_fmu.report.console import print_end

    files = write_fly_page([vehicle, against] if against else [vehicle], recording, output, force=force)
    if output:
        print_end(files, "open it in a browser")
    else:
        open_in_browser(next(iter(files)), "-o PAGE.html")


# ---- sitl ------------------------------------------------------------------------------------------------------------


@_commands.command("sitl", example="rov-fmu sitl bluerov2 --log dive.csv")
@_vehicle()
@click.option(
    "--frame",
    metavar="FRAME",
    help="Frame of ArduSub, such as vectored_6dof. The default is the first frame that fits.",
)
@click.option(
    "--servo",
    "servos",
    multiple=True,
    metavar="N=NAME",
    help="Servo N drives this thruster, fin or input; N=-NAME reverses it. It may be repeated.",
)
@_set_option(
    help="Set an input (a current: V_N, V_E), a coefficient, or a state at the start, in SI units.",
)
@click.option(
    "--bottom",
    type=_number("a number from -1e6 to 1e6 (m)", -1e6, 1e6),
    default="20",
    show_default=True,
    help="Depth of the bottom, m.",
)
@_file_option(
    "--log",
    metavar="LOG.csv",
    help="Log to write, which identify reads. Each restart of the autopilot begins another log.",
)
@_file_option(
    "--parameters",
    metavar="ROV.parm",
    help="File of ArduSub's parameters for this vehicle to write, for sim_vehicle.py --add-param-file.",
)
@click.option("--force", is_flag=True, help="Replace logs and parameters that exist.")
@click.option(
    "--log-rate",
    type=_number("a number from 1 to 100 (Hz)", 1.0, 100.0),
    default="10",
    show_default=True,
    help="Rows of the log per second.",
)
@click.option(
    "--duration",
    type=_seconds("0.001"),
    help="End after this time of the simulation, s (real time without packets). The default is to end with Ctrl-C.",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on; 0.0.0.0 is all.")
@click.option(
    "--port",
    type=_number("a whole number from 0 to 65535", 0, 65535, int),
    default="9002",  # to which ArduPilot sends its servo packets
    show_default=True,
    help="UDP port to listen on; 0 takes a free one.",
)
def _sitl(vehicle: Path, **options: Any) -> None:
    """Simulate a vehicle for ArduPilot's simulator, which runs ArduSub with --model JSON.

    ArduSub is started in another terminal. With --duration, or at Ctrl-C, the log is written.
    """
    from rov_fmu.interface.sitl_command import serve

    serve(vehicle, **options)


# ---- export ----------------------------------------------------------------------------------------------------------


class _OptionOf(click.Option):
    """An option that one format of `--to` has: its help says so, and all others refuse it."""

    def __init__(self, names: Sequence[str], *, only: str, help: str, **more: Any) -> None:
        super().__init__(names, help=f"{help} ({only}).", callback=self._check, **more)
        self._only = only

    def _check(self, context: click.Context, _: click.Parameter, given: Any) -> Any:
        to = context.params.get("to")
        if given not in (None, False) and to != self._only:
            raise click.UsageError(f"--to {to}: leave out {self.opts[0]}, because only {self._only} has it")
        return given


_option_of = partial(click.option, cls=_OptionOf)


@_commands.command("export", example="rov-fmu export bluerov2 --to mujoco")
@_vehicle_or_videoray()
@click.option(
    "--to",
    required=True,
    is_eager=True,
    type=_Choice([*EXPORTS], {one.also: one.name for one in EXPORTS.values() if one.also}),
    help=f"{listed((one.words for one in EXPORTS.values()), 'or')}.",
)
@_output_option(
    metavar="PATH",
    help="File or folder to write. The default is the identifier with the name of the format, such as "
    "<identifier>_mujoco or <identifier>.sdf.",
)
@_option_of(
    "--draws",
    only="mujoco",
    type=_number("a whole number from 1 to 1e6", 1, 10**6, int),
    metavar="N",
    help="Also draw N sets of coefficients from what the logs know, with their correlations",
)
@_option_of(
    "--seed",
    only="mujoco",
    type=_number("a whole number from 0", 0, 2**63, int),
    metavar="N",
    help="Seed of the draws, 0 by default",
)
@_option_of(
    "--gains",
    only="ardusub-gains",
    type=_FILE,
    metavar="FILE.param",
    help="The parameters that the vehicle has, whose gains are to be beaten. The default is those of the firmware",
)
@_set_option(help="Set a coefficient in SI units, such as the dead time T_d=0.02. It may be repeated.")
@_option_of("--world", "in_world", only="sdf", is_flag=True, help="Add a world with water, which Gazebo can run")
@_option_of(
    "--added-mass",
    only="sdf",
    type=_Choice(["link", "plugin"]),
    help="Added mass in the link (engine DART, the default), or in the Hydrodynamics plugin",
)
@_force_option(
    help="Replace files that rov-fmu did not write, or that have changed since. Draw also where the verdict of an axis "
    "is neither good nor usable."
)
def _export(vehicle: Path, to: str, output: Path | None, **options: Any) -> None:
    """Write a vehicle for another simulator or a thruster manager, or its gains for ArduSub.

    The default is the VideoRay Pro 4.
    """
    from rov_fmu.report.console import console, paragraph, print_end, print_table

    exported, written = export(vehicle, to, output, **options)
    if exported.table:
        print_table(exported.table)
    if exported.notes:
        paragraph(console(), f"{exported.heading}:")
    for note in exported.notes:
        paragraph(console(), f"- {note}")
    for warning in exported.warnings:
        _warn(warning)
    print_end(written, exported.following)


# ---- prove -----------------------------------------------------------------------------------------------------------


@_commands.command("prove", example="rov-fmu prove bluerov2.fmu")
@click.argument("fmu", type=_FILE)
@click.option(
    "--interface",
    type=_Choice(["co-simulation", "model-exchange"], {"cs": "co-simulation", "me": "model-exchange"}),
    help="Interface to use. The default is the first that the FMU has.",
)
@click.option(
    "--tolerance",
    type=_one_of(TOLERANCES),
    help="Tolerance instead of that of each experiment.",
)
@click.option(
    "--time-limit",
    type=_one_of(TIME_LIMITS),
    metavar="SECONDS",
    default=60.0,
    help="Time for each experiment. The default is 60 s.",
)
def _prove(fmu: Path, **options: Any) -> None:
    """Run the experiments that an FMU of any exporter contains (FMI-LS-REF), and compare the results."""
    if str(fmu) in SHIPPED and not fmu.exists():
        raise FileError(f"{fmu}: must be an FMU. `rov-fmu build {fmu}` builds one from the vehicle with this name")
    from rov_fmu.interface.prove_command import print_proof_of

    print_proof_of(fmu, **options)


# ---- system ----------------------------------------------------------------------------------------------------------


@_commands.command("system", example="rov-fmu system plan.toml -o dive.ssp --run")
@click.argument("plan", type=_FILE, required=False)
@_output_option(metavar="FILE.ssp", help="System to write.")
@click.option("--run", "runs", is_flag=True, help="Run it, also with half the step, and write FILE.csv and FILE.svg.")
@click.option("--list", "lists", is_flag=True, help="List the companions that ship, with their variables.")
@_force_option()
def _system(plan: Path | None, output: Path | None, *, runs: bool, lists: bool, force: bool) -> None:
    """Connect vehicles, their companions and other FMUs to a system (SSP), as PLAN (TOML) says.

    Units, causalities and connections are checked. FMUs are programs: --run runs those of others, too, in a process
    with limits, which is no sandbox.
    """
    from rov_fmu.bridges.system.system_command import list_companions, write_system

    if lists:
        list_companions()
    elif plan is None or output is None:
        raise click.UsageError("system: needs PLAN and -o FILE.ssp, or --list")
    else:
        write_system(plan, output, runs=runs, force=force)


# ---- study -----------------------------------------------------------------------------------------------------------


@_commands.command("study", example="rov-fmu study plan.toml -o results")
@click.argument("plan", type=_FILE)
@_output_option(required=True, metavar="RESULTS", help="Folder of the results.")
@click.option(
    "--workers",
    type=_one_of(WORKERS),
    metavar="N",
    help="Number of processes, or of threads for a vehicle. The default is the number of cores.",
)
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler to use, tcp://host:8786.")
@click.option(
    "--part",
    metavar="K/N",
    help="Do part K of N alone, as in --part 3/64, also beside others.",
)
@_force_option()
def _study(plan: Path, output: Path, **options: Any) -> None:
    """Run a vehicle or any FMU for Co-Simulation many times, as PLAN (TOML) says: a sweep, or a sample of parameters.

    RESULTS gets the table runs (Parquet) and the page study.html. Runs that are done are kept: the
    same command continues a study that was interrupted.
    """
    try:
        from rov_fmu.study.study_command import study_plan
    except ModuleNotFoundError as error:
        raise click.UsageError(f"study: needs {error.name}: pip install 'rov-fmu[study]'") from error
    study_plan(plan, output, **options)


# ---- identify --------------------------------------------------------------------------------------------------------


_tests_argument = partial(click.argument, "tests", nargs=-1, required=True, type=_FILE)


@_commands.command("identify", example="rov-fmu identify tests -o my_rov.toml --report my_rov.html")
@_tests_argument(metavar="TESTS...")
@_output_option(metavar="VEHICLE.toml", help="Vehicle file to write.")
@_file_option(
    "--report",
    metavar="REPORT.html",
    help="Report to write, which a build puts into the FMU.",
)
@click.option(
    "--base",
    callback=_find_given,
    metavar="VEHICLE",
    help="Vehicle to begin from, in place of the `base` of rov.toml: a vehicle file anywhere, or one that ships.",
    shell_complete=_complete_vehicle,
)
@_force_option()
def _identify(
    tests: tuple[Path, ...],
    output: Path | None,
    report: Path | None,
    base: Path | None,
    force: bool,
) -> None:
    """Identify a vehicle from TESTS: a folder of tank tests or dive logs with its rov.toml, or one log or several.

    Without a rov.toml, the vehicle that the logs seem to be of is assumed, and the printout begins with what that is.
    """
    from rov_fmu.identify.findings import by_heading
    from rov_fmu.interface.identify_command import identify_tests
    from rov_fmu.report.console import print_end, shell_words
    from rov_fmu.report.console_results import print_identification
    from rov_fmu.report.progress import parts

    with parts() as shown:
        identification, files = identify_tests(
            tests, output, report, base=base, force=force, begin=shown.begin, on_answer=shown.tell
        )
    print_identification(identification)
    name = identification.vehicle.identifier
    given = ["--base", shipped_name(base) or base] if base else []
    whole = "identify", *tests, *given, "-o", f"{name}.toml", "--report", report or f"{name}.html"
    following = shell_words("rov-fmu", *(("build", output) if output else whole))
    if by_heading(identification.findings)["Warnings"]:
        following = f"check the warnings, then {following}"
    print_end(files, following)


# ---- inspect ---------------------------------------------------------------------------------------------------------


@_commands.command("inspect", example="rov-fmu inspect dive.csv --draft")
@_tests_argument(metavar="LOG...")
@_file_option("--report", metavar="PAGE.html", help="Page to write, with pictures of the logs.")
@click.option(
    "--draft",
    "drafts",
    is_flag=True,
    help="Write a draft of rov.toml beside the logs, or complete the one that is there.",
)
@_force_option()
def _inspect(tests: tuple[Path, ...], report: Path | None, *, drafts: bool, force: bool) -> None:
    """List what LOGs contain, or all logs in a folder, and what no fit can learn from them. Nothing is identified."""
    from rov_fmu.interface.inspect_command import inspect_tests, next_steps
    from rov_fmu.report.console import print_end
    from rov_fmu.report.console_log import print_inspected

    inspected, files = inspect_tests(tests, report, drafts=drafts, force=force)
    print_inspected(inspected, with_draft=not drafts)
    print_end(files, ", then ".join(next_steps(inspected, tests, drafts=drafts)))
    if not (drafts or any(one.commands or one.channels for one in inspected.logs)):
        raise FileError(f"{tests[0]}: nothing that is recognised as a log or a table of tests")


# ---- tune ------------------------------------------------------------------------------------------------------------


@_commands.command("tune", example="rov-fmu tune my_rov.toml --axis surge --command 0.5 --v-ss 0.8")
@_vehicle()
@click.option(
    "--axis",
    required=True,
    type=_Choice(list(AXES), {axis.velocity: name for name, axis in AXES.items()}),
    help="Axis to tune.",
)
@click.option(
    "--command",
    type=_number("a number within -1 ... 1 and not 0, a fraction of the full command: 30 % is 0.3"),
    help=(
        "Held command of every input that drives the axis; positive is the positive direction of the "
        "axis. 30 % of the full command is 0.3."
    ),
)
@click.option(
    "--v-ss",
    "V_ss",
    type=_number("a number (V_ss in m/s or rad/s)"),
    help="Wanted steady velocity at this command, m/s or rad/s.",
)
@click.option(
    "--tau",
    "Tau",
    type=_number("a number (Tau in s)"),
    help="Wanted time constant at this command, s. Without it beta stays as it is.",
)
@_file_option(
    "--points",
    metavar="POINTS.csv",
    help="Table of many wanted points instead, with columns for command, velocity and time constant.",
)
@_output_option(metavar="TUNED.toml", help="Vehicle file to write.")
@_force_option()
def _tune(vehicle: Path, axis: str, output: Path | None, **wanted: Any) -> None:
    """Find alpha and beta of an axis that give a wanted response."""
    from rov_fmu.identify.findings import result_sentences
    from rov_fmu.identify.tuning import implausible
    from rov_fmu.interface.tune_command import tune_vehicle
    from rov_fmu.report.console import print_end, shell_words
    from rov_fmu.report.console_results import print_tuning

    tuning, files = tune_vehicle(vehicle, AXES[axis], output=output, **wanted)
    print_tuning(tuning)
    for message in result_sentences(implausible(tuning)):
        _warn(message)
    following = shell_words("rov-fmu", "build", output) if output else "add -o TUNED.toml to write the tuned vehicle"
    print_end(files, following)


# ---- schema ----------------------------------------------------------------------------------------------------------


@_commands.command("schema", example="rov-fmu schema")
def _schema() -> None:
    """Print the JSON schema of the vehicle file, for editors."""
    from rov_fmu.vehicle.json_schema import json_schema_text

    click.echo(json_schema_text(), nl=False)
