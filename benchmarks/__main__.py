"""Measure what the FMU costs and how exact it is, beside other ways to the same motion, and print one table."""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import fmpy
from rich.console import Console

from checks.fmi2 import fmpy_slave
from rov_fmu.build import build
from rov_fmu.export.compile import BuildError, host_platform
from rov_fmu.files.output import Output, check_targets, write_whole
from rov_fmu.process import exit_code, run_process
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

from . import archive, fleet, importer, picture, promises, sections
from .page import Page, machine
from .plain_c import Programs, measurable
from .steps import Measured, Plan
from .work import Work


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    repetitions: int = 25
    commands: int = 16384
    known: int = 64
    """Commands whose ends are compared with 50 digits."""
    manoeuvres: int = 5
    """Repetitions of what Python steps."""
    runs: int = 100_000
    runs_in_fmpy: int = 2000
    loads: int = 20
    all_platforms: bool = True


_HOW = """Medians of repetitions in turn: processor time on one core, of builds and loading the time on the clock.
A cell's second number is the error at the end of a held command against 50 digits, in SI units. Commands are held
for 1 s, or for the step where it is longer; at steps of 1 s and more fmi2DoStep includes fmi2SetReal.
"""
_QUICK = Effort(3, 1024, 8, 1, 1000, 100, 3, all_platforms=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 measured, 1 there is nothing to measure, 2 bad input, 130 interrupted."""
    return exit_code("benchmarks", lambda: _run(arguments), {BuildError: 1, OSError: 2})


def _run(arguments: Sequence[str] | None) -> None:
    options = _parser().parse_args(arguments)
    check_targets(filter(None, (options.picture,)))
    if host_platform() is None:
        raise BuildError("there is no binary for this machine to measure")
    page = Page()
    print(machine())
    print(_HOW)
    with tempfile.TemporaryDirectory(prefix="benchmarks-", ignore_cleanup_errors=True) as folder:
        _measure(page, load_vehicle(VIDEORAY), Path(folder), _QUICK if options.quick else Effort(), options.picture)
    page.print()


def _measure(page: Page, vehicle: Vehicle, folder: Path, effort: Effort, picture_file: Path | None) -> None:
    k = vehicle.coefficients
    say = Console(stderr=True).status
    programs = Programs(vehicle, Path(tempfile.mkdtemp(dir=folder))) if measurable() else None
    if programs:
        with say("steps in plain C"):
            plan = Plan(k, effort.commands, effort.known)
            measured = Measured(programs, plan.jobs, effort.repetitions)
            sections.plain_c(page, plan, measured)
            sections.at_equal_error(page, plan, measured)
            if picture_file:
                write_whole(Output(picture_file, picture.cost_error_picture(plan, measured).encode()))
    else:
        page.section("Plain C: not measured, the programs are written for Linux on x86-64")
    with say("building"):
        builds = _build(vehicle, folder, effort)
        folders = {name: folder / name for name in (importer.NATIVE, importer.PYTHONFMU)}
        loaded = archive.load(folder / "native.fmu", folders[importer.NATIVE], effort.loads)
        fmpy.extract(str(folder / "python.fmu"), str(folders[importer.PYTHONFMU]))
    with say("a manoeuvre through FMPy"):
        manoeuvre = Work(k, straight=False, hold=1.0, commands=round(importer.STOP), starts=1)
        simulated = importer.simulate(folders, manoeuvre, effort.manoeuvres)
        stepped = importer.step_through(folders, manoeuvre, effort.manoeuvres)
        sections.through_fmpy(page, simulated, stepped)
    with say("many instances and runs"):
        variations, runs = fleet.Variations(k, effort.runs), {}
        if programs:
            instances, runs["plain C"] = fleet.in_c(programs, variations, effort.repetitions)
            sections.instances(page, instances)
        slave = fmpy_slave(folders[importer.NATIVE])
        runs["FMPy"] = fleet.through_fmpy(slave, variations, effort.runs_in_fmpy, effort.manoeuvres)
        slave.freeInstance()
        sections.variations(page, runs)
    sections.archive(page, builds, loaded)
    if programs:
        promises.section(page, promises.promises(plan, measured))


def _build(vehicle: Vehicle, folder: Path, effort: Effort) -> dict[str, archive.Built]:
    """native.fmu for this machine and python.fmu in the folder; what was measured of the native ones."""
    build(vehicle, folder / "python.fmu", backend="pythonfmu")
    builds = {"for this machine": archive.build(folder / "native.fmu", ["host"])}
    if effort.all_platforms:
        builds["for all platforms"] = archive.build(folder / "all.fmu", [])
    return builds


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true",
                        help="few repetitions and only this machine's binary: to see that all of it runs")  # fmt: skip
    parser.add_argument("--picture", type=Path, metavar="FILE.svg",
                        help="also draw cost against error there (docs/cost_error.svg is the README's)")  # fmt: skip
    return parser


if __name__ == "__main__":
    run_process(main)
