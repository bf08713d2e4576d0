"""A study from its plan to its results."""

import sys
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import current_process
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rov_fmu.fmus.instance import LoadError
from rov_fmu.io.messages import FileError
from rov_fmu.study.plan.model import Model, read_model, vehicle_fmu, vehicle_model
from rov_fmu.study.plan.plan import Plan, PlanError, load_plan
from rov_fmu.study.plan.prepared import Prepared, prepare
from rov_fmu.study.results.store import Store, identity
from rov_fmu.study.run.lanes import do_in_lanes
from rov_fmu.study.run.system import SystemModel, half_step_words, read_system
from rov_fmu.study.run.work import Progress, Spent, Work
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import load_vehicle

if TYPE_CHECKING:
    from rov_fmu.study.results.results import Results

Engine = Literal["lanes", "fmu"]


def run_study(
    plan: Path | str,
    folder: Path | str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    engine: Engine | None = None,
    part: tuple[int, int] | None = None,
    merge: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> "Results":
    """Do the missing runs of a study, and open its results.

    - `plan`, `folder`: the plan (TOML), and the folder of the results, which the same call continues.
    - `workers`: the number of processes on this machine, or of threads for a vehicle; by default the number of cores.
    - `scheduler`: the address of a Dask scheduler that is used instead.
    - `engine`: "lanes" for a vehicle in this process, the default for a plan with `vehicle` and no scheduler; "fmu" for
      its FMU on Dask workers. The rows are equal within rounding.
    - `part`: (3, 64) for the third of 64 parts, which may run beside each other.
    - `merge`: True to do no run, and check that the files of all runs are in `folder`.
    - `on_progress`: called with the state of the runs.

        rov_fmu.run_study("plan.toml", "results", workers=2).runs  # a pandas data frame, a row for each run

    Dask's workers import the calling script, so a script must call this below `if __name__ == "__main__":`.

    Raises FileError with a line for each reason, BuildError if a vehicle cannot be compiled, StudyError if the workers
    are lost, WriteError, and KeyboardInterrupt. Finished runs are kept, and the same call continues from there.
    """
    if getattr(current_process(), "_inheriting", False):
        sys.exit(1)  # a worker imports a script without that line; its parent prints the message
    from rov_fmu.study.results.results import Results

    _, store = do_study(
        Path(plan),
        Path(folder),
        workers,
        scheduler,
        on_progress,
        engine=engine,
        part=part,
        merge=merge,
    )
    return Results(store.folder)


def do_study(
    path: Path,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    on_progress: Callable[[Progress], None] = lambda _: None,
    on_warning: Callable[[str], None] = lambda _: None,
    *,
    engine: Engine | None = None,
    part: tuple[int, int] | None = None,
    merge: bool = False,
    force: bool = False,
) -> tuple[Spent, Store]:
    """Do the missing runs, or merge parts; return the times, and the folder of the results.

    `on_warning` is called with each warning. `force` allows replacing the work of others that has the name of a file of
    the results.
    """
    plan = load_plan(path)
    engine = engine or ("lanes" if plan.vehicle and scheduler is None else "fmu")
    model = _model(plan, path, engine)
    prepared = prepare(plan, path, model)
    for warning in prepared.warnings:
        on_warning(warning)
    store, (number, parts) = Store(folder, force=force), part or (1, 1)
    first, last = ((number - at) * prepared.design.runs // parts for at in (1, 0))
    description = _description(plan, prepared, model, engine)
    with store.held(f"-{number}-of-{parts}" if part else ""):
        store.describe(description, (first, last))
        if merge:
            store.check_complete(description)
            return Spent(), store
        job = replace(prepared.job, study=identity(description))
        work = Work(job, prepared.design, store, first, last, on_progress)
        try:
            if not work.missing:
                pass
            elif model.vehicle:
                do_in_lanes(work, model.vehicle, workers)
            else:
                from rov_fmu.study.run.cluster import do_on_cluster

                do_on_cluster(work, workers, scheduler)
        except LoadError as error:
            raise FileError(f"{model.name}: cannot be run: {error}") from error
    if work.spent.turned:
        count = f"in {work.spent.turned} of {work.spent.runs} runs"
        on_warning(f"{count} the vehicle turned over: phi or theta passed 90 degrees")
    if isinstance(model, SystemModel) and work.spent.runs and (words := half_step_words(prepared.job, model)):
        on_warning(words)
    return work.spent, store


def _description(plan: Plan, prepared: Prepared, model: Model, engine: Engine) -> dict[str, Any]:
    """Return the description of the study in its results, as JSON values."""
    job, design = prepared.job, prepared.design
    named = [model.variables[name] for name in (*design.names, *job.recorded)]
    return {
        "runs": design.runs,
        "plan": dict(prepared.mark),
        "fmu": model.digest,
        "engine": engine,
        "vehicle": plan.vehicle,
        "columns": {"parameters": design.names, "figures": [*plan.figures], "outputs": plan.kept},
        "model": model.name,
        "title": plan.title,
        "units": {variable.name: variable.unit or "1" for variable in named},
        "descriptions": {variable.name: variable.description for variable in named},
        "groups": design.groups,
        "warnings": prepared.warnings,
    }


def _model(plan: Plan, path: Path, engine: Engine) -> Model:
    """Read the FMU or the system that the plan names, or the vehicle, whose FMU is built if the engine is "fmu"."""
    if engine == "lanes" and not plan.vehicle:
        raise FileError(f"{path}: --engine lanes: the plan must have `vehicle`, which runs without an FMU")
    if plan.fmu:
        return read_model(path.parent / plan.fmu)
    if plan.system:
        return read_system(path.parent / plan.system)
    assert plan.vehicle
    vehicle = load_vehicle(named_in(path, "vehicle", plan.vehicle, PlanError))
    return vehicle_model(vehicle) if engine == "lanes" else vehicle_fmu(vehicle)
