"""The command `rov-fmu study`: the study with its progress and the page."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rov_fmu.io.messages import StudyError
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import console, paragraph, print_end, print_table, shell_words, table, text
from rov_fmu.report.progress import StudyParts, parts
from rov_fmu.study.plan import REASON, STUDY, load_plan
from rov_fmu.study.run import do_study

if TYPE_CHECKING:
    from rov_fmu.study.results import Results

_PAGE = "study.html"
_SHOWN = ("5%", "50%", "95%", "mean")
"""What is shown of a figure."""
_FAILURES = 5
"""The number of reasons that are shown, the most frequent first."""


def study_plan(plan: Path, output: Path, *, part: str | None, force: bool, **how: Any) -> None:
    """Do the missing runs of a study, and write and print what came of it.

    A part has no page. Raises StudyError if no run is complete, and what `do_study` raises.
    """
    targets = [(output / _PAGE, ""), (output / STUDY, "")] if output.is_dir() else ()
    check = partial(check_targets, targets, force=force, is_ours=lambda path: path.name == STUDY)  # do_study tells
    check([plan])
    check([plan, *(plan.parent / name for name in load_plan(plan).files)])
    with parts() as shown:
        done = do_study(plan, output, StudyParts(shown).update, part=part, force=force, **how)
        for warning in done.warnings:
            shown.print(f"warning: {warning}")
    if part:
        words = f"part {part.replace('/', ' of ')} is complete: {done.runs} runs now, {done.failed} failed"
        paragraph(console(), f"{shell_words(output)}: {words}")
        return
    from rov_fmu.study.page import study_page
    from rov_fmu.study.results import Results

    results = Results(output)
    files = write_whole(Output(output / _PAGE, sealed(study_page(results), "study").encode()), force=force)
    print_summary(results)
    print_end(files, "open it in a browser")
    if len(results.failed) + len(results.incomplete) == len(results.runs):
        raise StudyError(f"{output}: no run is complete with all its figures")


def print_summary(results: "Results") -> None:
    """Print the number of runs, the quantiles of the figures, and why runs failed or figures are missing."""
    from rov_fmu.study.results import statistics

    out, runs = console(), results.runs
    counts = f"{len(runs)} runs, {len(results.failed)} failed, {len(results.incomplete)} incomplete"
    paragraph(out, f"{shell_words(results.folder)}: {counts}")
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
