"""A study from its plan to its results."""

import sys
from collections.abc import Callable
from multiprocessing import current_process
from pathlib import Path

from rov_fmu.build import build
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.output import Output, write_whole
from rov_fmu.study.plan.model import Model, read_model
from rov_fmu.study.plan.plan import Plan, digest, load_plan
from rov_fmu.study.plan.prepared import prepare, vehicle_file
from rov_fmu.study.results.results import Results
from rov_fmu.study.results.store import Store
from rov_fmu.study.run.cluster import Progress, Spent, execute
from rov_fmu.vehicle.vehicle import load_vehicle


def study(
    plan: Path | str,
    folder: Path | str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> Results:
    """Do what is missing of a study, and open its results.

    `workers` are processes on this machine, as many as it has cores by default; `scheduler` is the address of a
    scheduler of Dask in place of them. On this machine other processes are started, so a script that calls this has
    its `if __name__ == "__main__":`.

    Raises FileError with a line for each reason, BuildError where the FMU of a vehicle cannot be built, StudyError
    where the workers are lost, WriteError, KeyboardInterrupt; what is done is kept, and the same call goes on from
    there.
    """
    if getattr(current_process(), "_inheriting", False):
        sys.exit(1)  # in a worker that imports a script without it: the process that has started this one tells why
    _, results = run_study(Path(plan), Path(folder), workers, scheduler, on_progress)
    return results


def run_study(
    path: Path,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    on_progress: Callable[[Progress], None],
    on_warning: Callable[[str], None] = lambda _: None,
) -> tuple[Spent, Results]:
    """The same, and where the time went; warnings are told before the first run."""
    plan = load_plan(path)
    store = Store(folder)
    model = _model(plan, path)
    prepared = prepare(plan, path, model)
    for warning in prepared.warnings:
        on_warning(warning)
    with store.held():
        job, design = prepared.job, prepared.design
        columns = {"parameters": design.names, "figures": [*job.figures], "outputs": job.kept}
        told = {"groups": design.groups, "warnings": prepared.warnings}
        named = [model.variables[name] for name in (*design.names, *job.manoeuvre.recorded)]
        words = {"units": {v.name: v.unit for v in named}, "descriptions": {v.name: v.description for v in named}}
        more = {"points": len(job.kept_points), "model": model.name, **words}
        store.belongs_to(prepared.mark, digest(model.content), plan.vehicle, design.runs, columns, **more, **told)
        if plan.vehicle:
            write_whole(Output(folder / model.name, model.content))
        spent = execute(job, design, store, workers, scheduler, on_progress)
        return spent, Results(folder)


def _model(plan: Plan, path: Path) -> Model:
    """The FMU that the plan names, or that of its vehicle."""
    if plan.fmu:
        return read_model(path.parent / plan.fmu)
    assert plan.vehicle
    vehicle = load_vehicle(vehicle_file("vehicle", plan.vehicle, path))
    with temporary_folder("fmu-") as folder:
        built = build(vehicle, Path(folder, f"{vehicle.identifier}.fmu"), platforms=["host"])
        return read_model(built.path)
