"""Measure the speed and the accuracy of the FMU and of other solvers, and print one table."""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import fmpy
from rich.console import Console
from rich.status import Status

from rov_fmu.build import build
from rov_fmu.c.compile import BuildError, host_platform
from rov_fmu.c.simulation import usable_cores
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.process import exit_code
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from verification.references.fmpy_slave import fmpy_slave

from . import archive, fleet, importer, picture, sections
from .page import Section, machine, print_sections
from .plain_c import PlainC, measurable
from .steps import HeavyPlan, Measured, Plan, TaylorPlan
from .studies import Study
from .taylor import STEPS, many_vehicles
from .work import Work


@dataclass(frozen=True)
class Effort:
    """The numbers of repetitions and runs."""

    repetitions: int = 25
    commands: int = 16384
    known: int = 64  # commands whose results are compared with 50 digits
    manoeuvres: int = 5  # repetitions of what Python steps
    runs: int = 100_000
    runs_in_fmpy: int = 2000
    loads: int = 20
    study_runs: tuple[int, ...] = (10_000, 1000, 100_000)  # one that is compared with the runs alone, then few and many
    all_platforms: bool = True


_HOW = """Medians of repetitions in turn: processor time on one core, of builds and loading the time on the clock.
A cell's second number is the error at the end of a held command against 50 digits, in SI units. Commands are held
for 1 s, or for the step where it is longer; at steps of 1 s and more fmi2DoStep includes fmi2SetReal, and fmi3DoStep
fmi3SetFloat64.
"""
_FLEETS = {0.8: load_vehicle(VIDEORAY), 1.0: load_vehicle(SHIPPED["bluerov2_heavy"])}
"""Vehicles by the promised ratio of the cost of many of them to that of heyoka's best batches."""
_QUICK = Effort(3, 1024, 8, 1, 1000, 100, 3, (200, 100, 400), all_platforms=False)


@click.command(help=__doc__)
@click.option("--quick", is_flag=True, help="Few repetitions, only this machine's binary: to see that all of it runs.")
@click.option(
    "--picture",
    "picture_file",
    type=click.Path(path_type=Path),
    metavar="FILE.svg",
    help="Also draw cost against error there (docs/cost_error.svg is one).",
)
def _command(quick: bool, picture_file: Path | None) -> None:
    check_targets(filter(None, (picture_file,)))
    if host_platform() is None:
        raise BuildError("there is no binary for this machine to measure")
    print(machine())
    print(_HOW)
    with tempfile.TemporaryDirectory(prefix="benchmarks-", ignore_cleanup_errors=True) as folder:
        found = list(_measure(Path(folder), _QUICK if quick else Effort(), picture_file))
    print_sections(found)


def _measure(folder: Path, effort: Effort, picture_file: Path | None) -> Iterator[Section]:
    rov, say = load_vehicle(VIDEORAY), Console(stderr=True).status
    plain_c = PlainC(rov, Path(tempfile.mkdtemp(dir=folder))) if measurable() else None
    if plain_c:
        with say("steps in plain C"):
            plan = Plan(rov, effort.commands, effort.known)
            measured = Measured(plain_c, plan.jobs, effort.repetitions)
            yield from sections.plain_c(plan, measured)
            if picture_file:
                write_whole(Output(picture_file, picture.cost_error_picture(plan, measured).encode()))
        with say("a vehicle with six axes and lag in plain C"):
            heavy = load_vehicle(SHIPPED["bluerov2_heavy"])
            heavier = HeavyPlan(heavy, effort.commands, max(4, effort.known // 4))
            heavy_c = PlainC(heavy, Path(tempfile.mkdtemp(dir=folder)))
            measured_heavy = Measured(heavy_c, heavier.jobs, effort.repetitions)
            yield sections.heavy(heavier, measured_heavy)
        with say("heyoka beside it"):
            series = TaylorPlan(rov, effort.commands, effort.known)
            yield sections.taylor(series, measured_series := Measured(plain_c, series.jobs, effort.repetitions))
    else:
        yield [["Plain C: not measured, the programs are written for Linux on x86-64"]]
    yield from _many(effort, say)
    with say("building"):
        native, python = folder / "native.fmu", folder / "python.fmu"
        build(rov, python, backend="pythonfmu")
        builds = {"for this machine": archive.build(native, ["host"])}
        if effort.all_platforms:
            builds["for all platforms"] = archive.build(folder / "all.fmu", [])
        folders = {name: folder / name for name in (importer.NATIVE, importer.PYTHONFMU)}
        loaded = archive.load(native, folders[importer.NATIVE], effort.loads)
        fmpy.extract(str(python), str(folders[importer.PYTHONFMU]))
    with say("a manoeuvre through FMPy"):
        manoeuvre = Work(rov, straight=False, hold=1.0, commands=round(importer.STOP), starts=1)
        simulated = importer.simulate(folders, manoeuvre, effort.manoeuvres)
        yield sections.through_fmpy(simulated, importer.step_through(folders, manoeuvre, effort.manoeuvres))
    with say("many instances and runs"):
        variations, runs = fleet.Variations(rov, effort.runs), {}
        if plain_c:
            yield sections.instances(fleet.instances(plain_c, effort.repetitions))
            runs["plain C"] = fleet.in_c(plain_c, variations, effort.repetitions)
        slave = fmpy_slave(folders[importer.NATIVE])
        runs["FMPy"] = fleet.through_fmpy(slave, variations, effort.runs_in_fmpy, effort.manoeuvres)
        slave.freeInstance()
        yield sections.variations(runs)
    with say("studies"):
        study, (beside, *others) = Study(native, folder), effort.study_runs
        pairs = [*study.pairs(beside, effort.manoeuvres)]
        yield sections.studies(pairs, [study.cost(count, workers=2) for count in sorted([beside, *others])])
    yield from sections.archive(builds, loaded)
    if plain_c:
        yield sections.promises(plan, measured, heavier, measured_heavy, series, measured_series)


def _many(effort: Effort, say: Callable[[str], Status]) -> Iterator[Section]:
    for limit, rov in _FLEETS.items():
        with say(f"many of {rov.name}"):
            for cores in sorted({1, usable_cores()}):
                found = [many_vehicles(rov, h, effort.repetitions, cores) for h in STEPS]
                yield sections.many(rov.name, found, limit)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 measured, 1 there is nothing to measure, 2 bad input, 130 interrupted."""
    codes = {BuildError: 1, OSError: 2, click.ClickException: 2}
    return exit_code(
        "benchmarks", lambda: _command(arguments, "python -m verification.benchmarks", standalone_mode=False), codes
    )


if __name__ == "__main__":
    sys.exit(main())
