"""The command `rov-fmu study`: the study with its progress, the page, and a run for Foxglove."""

import logging
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rov_fmu.io.messages import FileError, StudyError
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import console, paragraph, print_end, shell_words
from rov_fmu.report.progress import StudyParts, parts
from rov_fmu.study.plan.plan import PlanError, load_plan
from rov_fmu.study.results.store import PAGE, STUDY, is_description
from rov_fmu.study.run.run_study import do_study
from rov_fmu.vehicle.shipped import named_in

if TYPE_CHECKING:
    from rov_fmu.study.results.results import Results


def study_plan(
    plan: Path,
    output: Path,
    workers: int | None,
    scheduler: str | None,
    run: int | None,
    part: tuple[int, int] | None,
    *,
    force: bool,
    **how: Any,
) -> None:
    """Do the missing runs of a study, and write and print what came of it. `run` is written for Foxglove, too.

    A part has no page. Raises StudyError if no run is complete, and what `study` raises.
    """
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # after Ctrl-C it tells of connections that Dask closed
    motion = output / f"run-{run}.mcap"
    targets = [(path, "") for path in (output / PAGE, output / STUDY, motion if run is not None else None)]
    check = partial(check_targets, targets if output.is_dir() else (), force=force, is_ours=is_description)
    check([plan])
    read = load_plan(plan)
    check([plan, *(plan.parent / name for name in read.files)])
    vehicle = read.vehicle
    if run is not None and not vehicle:
        raise FileError(f"{plan}: --mcap {run}: the plan must have `vehicle`, whose picture the file shows")
    with parts() as shown:
        work = do_study(
            plan,
            output,
            workers,
            scheduler,
            StudyParts(shown).update,
            lambda message: shown.print(f"warning: {message}"),
            part=part,
            force=force,
            **how,
        )
    if part:
        words = f"part {part[0]} of {part[1]} is complete: {work.runs} runs now, {work.failed} failed"
        paragraph(console(), f"{shell_words(output)}: {words}")
        return
    from rov_fmu.study.results.page import study_page
    from rov_fmu.study.results.results import Results
    from rov_fmu.study.results.summary import print_summary

    results = Results(output)
    files = write_whole(Output(output / PAGE, sealed(study_page(results), "study").encode()), force=force)
    print_summary(results, work.runs, work.elapsed)
    if vehicle and run is not None:
        content = _motion_of(results, run, named_in(plan, "vehicle", vehicle, PlanError))
        files |= write_whole(Output(motion, content), force=force)
    print_end(files, "open it in a browser")
    if len(results.failed) + len(results.incomplete) == len(results.runs):
        raise StudyError(f"{output}: no run is complete with all its figures")


def _motion_of(results: "Results", run: int, vehicle: Path) -> bytes:
    """Return the motion of a run as the content of an MCAP file. Raises FileError if the run has no outputs."""
    from rov_fmu.interface.model import load

    if not results.outputs or (motion := results.trajectories([run])).empty:
        raise FileError(f"{results.folder}: --mcap {run}: there is no such run with outputs, which [keep] names")
    return load(vehicle).to_mcap(motion)
