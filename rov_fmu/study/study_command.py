"""The command `rov-fmu study`: the study with its progress and the page."""

import logging
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rov_fmu.io.messages import StudyError
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import console, paragraph, print_end, print_table, shell_words, table, text
from rov_fmu.report.progress import StudyParts, parts, per_second
from rov_fmu.study.plan.plan import REASON, load_plan
from rov_fmu.study.results.store import PAGE, STUDY, is_description
from rov_fmu.study.run.run_study import do_study

if TYPE_CHECKING:
    from rov_fmu.study.results.results import Results

_SHOWN = ("5%", "50%", "95%", "mean")
"""What is shown of a figure."""
_FAILURES = 5
"""The number of reasons that are shown, the most frequent first."""


def study_plan(
    plan: Path,
    output: Path,
    *,
    part: str | None,
    force: bool,
    **how: Any,
) -> None:
    """Do the missing runs of a study, and write and print what came of it.

    A part has no page. Raises StudyError if no run is complete, and what `study` raises.
    """
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # after Ctrl-C it tells of connections that Dask closed
    targets = [(path, "") for path in (output / PAGE, output / STUDY)]
    check = partial(check_targets, targets if output.is_dir() else (), force=force, is_ours=is_description)
    check([plan])
    read = load_plan(plan)
    check([plan, *(plan.parent / name for name in read.files)])
    with parts() as shown:
        work = do_study(
            plan,
            output,
            StudyParts(shown).update,
            lambda message: shown.print(f"warning: {message}"),
            part=part,
            force=force,
            **how,
        )
    if part:
        words = f"part {part.replace('/', ' of ')} is complete: {work.runs} runs now, {work.failed} failed"
        paragraph(console(), f"{shell_words(output)}: {words}")
        return
    from rov_fmu.study.results.page import study_page
    from rov_fmu.study.results.results import Results

    results = Results(output)
    files = write_whole(Output(output / PAGE, sealed(study_page(results), "study").encode()), force=force)
    print_summary(results, work.runs, work.elapsed)
    print_end(files, "open it in a browser")
    if len(results.failed) + len(results.incomplete) == len(results.runs):
        raise StudyError(f"{output}: no run is complete with all its figures")


def print_summary(results: "Results", now: int, seconds: float) -> None:
    """Print the number of runs, the speed, the quantiles of the figures, and why runs failed or figures are missing.

    `now` is the number of runs that were done now, in so many seconds.
    """
    from rov_fmu.study.results.results import statistics

    out, runs = console(), results.runs
    counts = f"{len(runs)} runs, {len(results.failed)} failed, {len(results.incomplete)} incomplete"
    paragraph(out, f"{shell_words(results.folder)}: {counts}")
    if now:
        rate = per_second(now / max(seconds, 1e-3))
        paragraph(out, f"  {now:,} of them now, in {seconds:.1f} s; {rate}")
    if results.figures:
        shown = table("", "figure", [*_SHOWN, "runs"])
        for name in results.figures:
            told = statistics(runs[name])
            shown.add_row(name, *(text(told[key], ".5g") for key in _SHOWN), f"{told['count']:.0f}")
        print_table(shown)
    reasons = runs[REASON].value_counts()
    for reason, count in reasons.head(_FAILURES).items():
        paragraph(out, f"  {count} runs: {reason}")
    if len(others := reasons[_FAILURES:]):
        paragraph(out, f"  {others.sum()} runs: other reasons ({len(others)}), which are on the page")
