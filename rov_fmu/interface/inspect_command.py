"""The command `rov-fmu inspect`: what logs contain, on the terminal, as a page and as a draft of rov.toml."""

from collections.abc import Sequence
from pathlib import Path

from rov_fmu.identify.inspection.inspected import Inspected, inspect_logs
from rov_fmu.io.file_kinds import PAGE, check_written
from rov_fmu.io.output import check_replaced, check_targets, page_output, write_whole


def inspect_tests(
    paths: Sequence[Path], report: Path | None, *, drafts: bool, force: bool
) -> tuple[Inspected, list[str], list[Path]]:
    """Inspect logs, and write the page, and the draft of rov.toml or what it lacks, if they are asked for.

    `force` allows replacing a page that rov-fmu did not write. Returns what the logs contain, a line for each file that
    was replaced, and the files that were written. Raises FileError, and WriteError if a file cannot be written.
    """
    replaced: list[str] = []
    if report:
        check_written(report, PAGE)
        check_targets([report], paths)
        replaced += check_replaced([report], force=force)
    inspected = inspect_logs(paths)
    outputs = []
    if report:
        from rov_fmu.report.inspection_page import inspection_page  # imports Matplotlib, which takes a second

        outputs.append(page_output(report, inspection_page(inspected), "inspect"))
    if drafts and inspected.text:
        outputs.append(inspected.completed)
    write_whole(*outputs, force=True)
    return inspected, replaced, [one.path for one in outputs]
