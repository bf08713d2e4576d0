"""Command line: python -m models tables | identify | tune | figures."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from .command_line import exit_code, run_process
from .files import check_targets, write_whole
from .manoeuvres import MANOEUVRES
from .messages import FileError
from .vehicle import VIDEORAY, load_vehicle


class _OptionError(ValueError):
    """Options that do not go together."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 done, 2 bad input, 130 interrupted."""

    def run() -> None:
        options = _parser().parse_args(arguments)
        options.run(options)

    return exit_code("models", run, {FileError: 2, _OptionError: 2, OSError: 2})


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m models", description="What is known of a vehicle.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    tables = commands.add_parser("tables", help="Tables 6-8 of the paper: printed, computed, measured")
    tables.add_argument("vehicle", nargs="?", type=Path, default=VIDEORAY, metavar="VEHICLE.toml",
                        help="vehicle file (default: the VideoRay Pro 4)")  # fmt: skip
    tables.set_defaults(run=_tables)

    identify = commands.add_parser("identify", help="a folder of tank tests to a vehicle file")
    identify.add_argument("folder", type=Path, metavar="FOLDER", help="rov.toml and thrust_, steady_, ... .csv")
    identify.add_argument("-o", "--output", type=Path, metavar="VEHICLE.toml", help="vehicle file to write")
    identify.add_argument("--report", type=Path, metavar="REPORT.html",
                          help="report to write; build_fmu.py puts it into the FMU of the vehicle file")  # fmt: skip
    identify.set_defaults(run=_identify)

    tune = commands.add_parser("tune", help="alpha and beta for a wanted response")
    tune.add_argument("vehicle", type=Path, metavar="VEHICLE.toml", help="vehicle file")
    tune.add_argument("--axis", required=True, choices=list(MANOEUVRES))
    tune.add_argument("--command", type=float, help="fraction of full thrust: 30 %% is 0.3")
    tune.add_argument("--v-ss", type=float, help="wanted steady velocity at this command, m/s or rad/s")
    tune.add_argument("--tau", type=float, help="wanted time constant at this command, s; without it beta stays")
    tune.add_argument("--points", type=Path, metavar="POINTS.csv",
                      help="many wanted points instead: command, velocity, time constant")  # fmt: skip
    tune.add_argument("-o", "--output", type=Path, metavar="TUNED.toml", help="vehicle file to write")
    tune.set_defaults(run=_tune)

    figures = commands.add_parser("figures", help="the paper's figures, redrawn as far as it prints their data")
    figures.add_argument("folder", type=Path, metavar="FOLDER", help="where to write paper_figures.svg")
    figures.set_defaults(run=_figures)
    return parser


def _tables(options: argparse.Namespace) -> None:
    from .printing import print_tables
    from .tables import load_tables

    vehicle = load_vehicle(options.vehicle)
    print_tables(vehicle, load_tables(vehicle))


def _identify(options: argparse.Namespace) -> None:
    from .experiments import load_experiments
    from .identification import identify
    from .printing_results import print_identification
    from .writer import vehicle_output

    experiments = load_experiments(options.folder)
    check_targets(filter(None, (options.output, options.report)), experiments.files)
    identification = identify(experiments)
    vehicle, outputs = identification.vehicle, []
    if options.report:
        from .report import report_output

        outputs.append(report_output(identification, options.report))
        assert vehicle.provenance
        vehicle = replace(vehicle, provenance=replace(vehicle.provenance, report=options.report))
    if options.output:
        outputs.append(vehicle_output(vehicle, options.output))
    write_whole(*outputs)
    print_identification(identification)


def _tune(options: argparse.Namespace) -> None:
    from .printing_results import print_tuning
    from .tuning import TuningError, read_points, tune, tune_over
    from .writer import write_tuned

    single = (options.command, options.v_ss)
    if options.points is None and None in single:
        raise _OptionError("tune: give --command and --v-ss (and --tau), or --points")
    if options.points is not None and (*single, options.tau) != (None, None, None):
        raise _OptionError("tune: --points stands instead of --command, --v-ss and --tau")
    vehicle, manoeuvre = load_vehicle(options.vehicle), MANOEUVRES[options.axis]
    check_targets(filter(None, (options.output,)), filter(None, (options.points,)))
    try:
        if options.points is None:
            tuning = tune(vehicle.coefficients, manoeuvre, *single, options.tau)
        else:
            tuning = tune_over(vehicle.coefficients, manoeuvre, read_points(options.points, manoeuvre))
    except TuningError as error:
        raise _OptionError(f"tune: {error}") from error
    if options.output:
        write_tuned(options.vehicle, options.output, tuning)
    print_tuning(tuning)


def _figures(options: argparse.Namespace) -> None:
    from .paper_figures import write_figures

    print(write_figures(options.folder))


if __name__ == "__main__":
    run_process(main)
