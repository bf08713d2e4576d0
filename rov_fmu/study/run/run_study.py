"""A study from its plan to its results."""

import sys
from collections.abc import Callable
from hashlib import sha256
from multiprocessing import current_process
from pathlib import Path

from rov_fmu.build import build
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.output import Output, write_whole
from rov_fmu.io.reading import read_bytes
from rov_fmu.study.plan.model import Model, read_model
from rov_fmu.study.plan.plan import Plan, load_plan
from rov_fmu.study.plan.prepared import prepare, vehicle_file
from rov_fmu.study.plan.system_model import read_system
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
    """Do the missing runs of a study, and open its results.

    - `plan`, `folder`: the plan (TOML), and the folder of the results, which the same call continues.
    - `workers`: the number of processes on this machine, by default the number of cores.
    - `scheduler`: the address of a Dask scheduler that is used instead.
    - `on_progress`: called with the state of the runs.

        rov_fmu.run_study("plan.toml", "results", workers=2).runs  # a pandas data frame, a row for each run

    Worker processes import the calling script, so a script must call this below `if __name__ == "__main__":`.

    Raises FileError with a line for each reason, BuildError if the FMU of a vehicle cannot be built, StudyError if the
    workers are lost, WriteError, and KeyboardInterrupt. Finished runs are kept, and the same call continues from there.
    """
    if getattr(current_process(), "_inheriting", False):
        sys.exit(1)  # a worker imports a script without that line; its parent prints the message
    _, results = run_study(Path(plan), Path(folder), workers, scheduler, on_progress)
    return results


def run_study(
    path: Path,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    on_progress: Callable[[Progress], None],
    on_warning: Callable[[str], None] = lambda _: None,
    *,
    force: bool = False,
) -> tuple[Spent, Results]:
    """Do the missing runs; return their times and the results. `on_warning` is called with each warning.

    `force` allows replacing the work of others that has the name of a file of the results.
    """
    plan = load_plan(path)
    store = Store(folder, force=force)
    model = _model(plan, path)
    prepared = prepare(plan, path, model)
    for warning in prepared.warnings:
        on_warning(warning)
    with store.held():
        job, design = prepared.job, prepared.design
        named = [model.variables[name] for name in (*design.names, *job.recorded)]
        store.belongs_to(
            prepared.mark,
            sha256(model.content).hexdigest(),
            plan.vehicle,
            design.runs,
            columns={"parameters": design.names, "figures": [*plan.figures], "outputs": plan.kept},
            points=len(plan.kept_points),
            model=model.name,
            title=plan.title,
            units={variable.name: variable.unit for variable in named},
            descriptions={variable.name: variable.description for variable in named},
            groups=design.groups,
            warnings=prepared.warnings,
        )
        if plan.vehicle:
            fmu = Output(folder / model.name, model.content)
            write_whole(fmu, force=force, is_ours=lambda there: read_bytes(there) == fmu.content)
        spent = execute(job, design, store, workers, scheduler, on_progress)
        if spent.turned:
            count = f"in {spent.turned} of {spent.runs} runs"
            on_warning(f"{count} the vehicle turned over: phi or theta passed 90 degrees")
        return spent, Results(folder)


def _model(plan: Plan, path: Path) -> Model:
    """Read the FMU or the system that the plan names, or build the FMU of its vehicle."""
    if plan.fmu:
        return read_model(path.parent / plan.fmu)
    if plan.system:
        return read_system(path.parent / plan.system)
    assert plan.vehicle
    vehicle = load_vehicle(vehicle_file("vehicle", plan.vehicle, path))
    with temporary_folder("fmu-") as folder:
        built = build(vehicle, Path(folder, f"{vehicle.identifier}.fmu"), platforms=["host"])
        return read_model(built.path)
