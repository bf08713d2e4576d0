"""Measure the speed and the accuracy of the FMU and of other solvers, and print one table."""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
from rich.console import Console

from rov_fmu.build import build_fmu
from rov_fmu.c.compile import BuildError, host_platform
from rov_fmu.c.simulation import usable_cores
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.process import exit_code
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle, without_surface

from . import picture, runs, taylor
from .page import Section, machine, print_sections
from .plain_c import PlainC, measurable
from .steps import Steps


@dataclass(frozen=True)
class Effort:
    """The numbers of repetitions and runs."""

    repetitions: int = 25
    commands: int = 16384
    known: int = 64  # commands whose results are compared with 50 digits; with few, RK4 looks more exact than it is
    study_runs: tuple[int, ...] = (1000, 10_000, 100_000)


_HOW = """Medians of repetitions in turn: processor time on one core.
A cell's second number is the error at the end of a held command against 50 digits, in SI units. Commands are held
for 1 s, or for the step where it is longer; at steps of 1 s and more fmi2DoStep includes fmi2SetReal.
"""
_QUICK = Effort(3, 1024, study_runs=(100, 400))


@click.command(help=__doc__)
@click.option("--quick", is_flag=True, help="Few repetitions: to see that all of it runs.")
@click.option(
    "--picture",
    "picture_file",
    type=click.Path(path_type=Path),
    metavar="FILE.svg",
    help="Also draw cost against error there (docs/cost_error.svg is one).",
)
def _command(quick: bool, picture_file: Path | None) -> None:
    check_targets([(picture_file, "")], force=True)
    if host_platform() is None:
        raise BuildError("there is no binary for this machine to measure")
    print(machine())
    print(_HOW)
    with tempfile.TemporaryDirectory(prefix="benchmarks-", ignore_cleanup_errors=True) as folder:
        found = list(_measure(Path(folder), _QUICK if quick else Effort(), picture_file))
    print_sections(found)


def _measure(folder: Path, effort: Effort, picture_file: Path | None) -> Iterator[Section]:
    say = Console(stderr=True).status
    rov = load_vehicle(VIDEORAY)
    heavy = without_surface(load_vehicle(SHIPPED["bluerov2_heavy"]))  # the other solvers and the references have none
    if measurable():
        with say("steps in plain C"):
            steps = Steps(rov, heavy, effort.commands, effort.known)
            plain_c, heavy_c = (PlainC(one, Path(tempfile.mkdtemp(dir=folder))) for one in (rov, heavy))
            steps.measure(plain_c, heavy_c, effort.repetitions)
            yield from steps.sections()
            if picture_file:
                write_whole(Output(picture_file, picture.cost_error_picture(steps).encode()), force=True)
    else:
        yield [["Plain C: not measured, the programs are written for Linux on x86-64"]]
    for one in (rov, heavy):
        with say(f"many of {one.name}"):
            for cores in sorted({1, usable_cores()}):
                sizes = [*((h, taylor.VEHICLES) for h in taylor.STEPS), (1.0, taylor.MANY)]
                found = [taylor.many_vehicles(one, h, effort.repetitions, cores, number) for h, number in sizes]
                yield taylor.section(one.name, found)
    with say("studies"):
        native = build_fmu(rov, folder / "native.fmu", platforms=["host"]).path
        yield runs.studies(native, folder, effort.study_runs)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 measured, 1 there is nothing to measure, 2 bad input, 130 interrupted."""
    codes = {BuildError: 1, OSError: 2, click.ClickException: 2}
    return exit_code(
        "benchmarks", lambda: _command(arguments, "python -m verification.benchmarks", standalone_mode=False), codes
    )


if __name__ == "__main__":
    sys.exit(main())
