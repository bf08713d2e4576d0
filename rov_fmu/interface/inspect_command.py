"""The command `rov-fmu inspect`: what logs contain, on the terminal, as a page and as a draft of rov.toml."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.inspection.inspected import Inspected, inspect_logs
from rov_fmu.io.file_kinds import PAGE
from rov_fmu.io.messages import FileError
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.tank.folder import folder_and_files
from rov_fmu.tank.readers.parsers import one_parser


@one_parser()
def inspect_tests(
    paths: Sequence[Path], report: Path | None, *, drafts: bool, force: bool
) -> tuple[Inspected, dict[Path, str]]:
    """Inspect logs, and write the page, and the draft of rov.toml or what it lacks, if they are asked for.

    `force` allows replacing a page that rov-fmu did not write. Returns what the logs contain, and the files that were
    written, each with what it replaced. Raises FileError, and WriteError if a file cannot be written.
    """
    check_targets([(report, PAGE)], paths, force=force)
    inspected = inspect_logs(paths)
    outputs = []
    if report:
        from rov_fmu.report.inspection_page import inspection_page  # imports Matplotlib, which takes a second

        outputs.append(Output(report, sealed(inspection_page(inspected), "inspect").encode()))
    if drafts and inspected.text:
        outputs.append(inspected.completed)
    written = write_whole(*outputs, force=True)
    if inspected.path in written:
        written[inspected.path] = ""  # what was there is in the completed file
    if inspected.is_enough and not inspected.missing and (inspected.own or not drafts):  # a draft is edited first
        inspected = _tried(paths, inspected)
    return inspected, written


def _tried(paths: Sequence[Path], inspected: Inspected) -> Inspected:
    """Return what logs contain, with a warning for each reason why `identify` refuses them, which comes next."""
    folder, files = folder_and_files(paths)
    try:
        load_tests(folder, files=files, draft=None if inspected.own else inspected.draft_for(None))
    except FileError as error:
        lines = str(error).splitlines()
        reasons = {warning: warning.rpartition("left out as unreadable: ")[2] for warning in inspected.warnings}
        others = [one for one, reason in reasons.items() if not any(line.endswith(reason) for line in lines)]
        return replace(inspected, warnings=[*others, *lines], is_refused=True)
    return inspected
