"""A study from its plan to its results."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from rov_fmu.fmus.instance import LoadError
from rov_fmu.io.messages import FileError, InputError, shown
from rov_fmu.io.numbers import WORKERS
from rov_fmu.report.progress import StudyProgress
from rov_fmu.study.plan.model import Model, read_model, vehicle_fmu, vehicle_model
from rov_fmu.study.plan.plan import Plan, PlanError, load_plan
from rov_fmu.study.plan.study import prepare
from rov_fmu.study.results.store import Store
from rov_fmu.study.run.local import do_here
from rov_fmu.study.run.system import SystemModel, half_step_words, read_system
from rov_fmu.study.run.work import Work
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import load_vehicle

if TYPE_CHECKING:
    from rov_fmu.study.results.results import Results

Engine = Literal["lanes", "fmu"]
_MOST_PARTS = 10_000
"""The largest number of parts of a study."""


def run_study(
    plan: Path | str,
    folder: Path | str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    engine: Engine | None = None,
    part: tuple[int, int] | str | None = None,
    merge: bool = False,
    on_progress: Callable[[StudyProgress], None] = lambda _: None,
) -> "Results":
    """Do the missing runs of a study, and open its results.

    - `plan`, `folder`: the plan (TOML), and the folder of the results, which the same call continues.
    - `workers`: the number of processes on this machine, or of threads for a vehicle; by default the number of cores.
    - `scheduler`: the address of a Dask scheduler that is used instead.
    - `engine`: "lanes" for a vehicle in this process, the default for a plan with `vehicle` and no scheduler; "fmu" for
      its FMU in processes. The rows are equal within rounding.
    - `part`: (3, 64), or "3/64", for the third of 64 parts, which may run beside each other.
    - `merge`: True to do no run, and check that the files of all runs are in `folder`.
    - `on_progress`: called with the state of the runs.

        rov_fmu.run_study("plan.toml", "results", workers=2).runs  # a pandas data frame, a row for each run

    Raises FileError with a line for each reason, InputError about an argument, BuildError if a vehicle cannot be
    compiled, StudyError if the workers are lost, WriteError, and KeyboardInterrupt. Finished runs are kept, and the
    same call continues from there.
    """
    from rov_fmu.study.results.results import Results

    how: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "engine": engine, "part": part, "merge": merge}
    return Results(do_study(Path(plan), Path(folder), on_progress, **how).store.folder)


def do_study(
    path: Path,
    folder: Path,
    on_progress: Callable[[StudyProgress], None] = lambda _: None,
    on_warning: Callable[[str], None] = lambda _: None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    engine: Engine | None = None,
    part: tuple[int, int] | str | None = None,
    merge: bool = False,
    force: bool = False,
) -> Work:
    """Do the missing runs, or merge parts; return what was done.

    `on_warning` is called with each warning. `force` allows replacing the work of others that has the name of a file of
    the results.
    """
    number, parts = _numbers_of(part)
    if workers is not None:
        WORKERS.checked("workers", workers)
    if engine not in (None, *get_args(Engine)):
        raise InputError(f"engine = {shown(engine)}: must be one of {', '.join(get_args(Engine))}")
    has_scheduler = scheduler is not None
    for is_wrong, words in (
        (has_scheduler and workers, "leave --workers out, because the scheduler already has its workers"),
        (has_scheduler and engine == "lanes", "leave --scheduler out, because --engine lanes runs in this process"),
        (merge and part, "leave --part out, because --merge does no run"),
    ):
        if is_wrong:
            raise InputError(f"study: {words}")
    plan = load_plan(path)
    model = _model(plan, path, engine or ("lanes" if plan.vehicle and not has_scheduler else "fmu"))
    study, design = prepare(plan, path, model)
    for warning in study.about["warnings"]:
        on_warning(warning)
    store = Store(folder, force=force)
    span = (number - 1) * design.runs // parts, number * design.runs // parts
    with store.held(f"-{number}-of-{parts}" if part else ""):
        missing = store.describe(study.about, span)
        if merge:
            store.check_complete(study.about)
        work = Work(study, design, store, missing, span[1] - span[0], on_progress)
        try:
            if missing and scheduler is not None:
                from rov_fmu.study.run.cluster import do_on_cluster

                do_on_cluster(work, scheduler)
            elif missing:
                do_here(work, workers)
        except LoadError as error:
            raise FileError(f"{model.name}: cannot be run: {error}") from error
    if work.turned:
        on_warning(f"in {work.turned} of {work.runs} runs the vehicle turned over: phi or theta passed 90 degrees")
    if isinstance(model, SystemModel) and work.runs and (words := half_step_words(study, model, design.rows(0, 1)[0])):
        on_warning(words)
    return work


def _numbers_of(part: tuple[int, int] | str | None) -> tuple[int, int]:
    """Return the number of a part, and that of all parts. Raises InputError."""
    text = "1/1" if part is None else str(part).strip("()").replace(", ", "/")
    match = re.fullmatch(r"(\d{1,5})/(\d{1,5})", text)
    number, count = map(int, match.groups()) if match else (0, 0)
    if not 1 <= number <= count <= _MOST_PARTS:
        raise InputError(f"part = {shown(part)}: must be a part and their number, such as 3/64, at most {_MOST_PARTS}")
    return number, count


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
