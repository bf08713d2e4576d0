"""The command `rov-fmu inspect`: what logs contain, on the terminal, as a page and as a draft of rov.toml."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.inspection.inspected import Inspected, inspect_paths
from rov_fmu.interface.arguments import checked_paths
from rov_fmu.io.file_kinds import PAGE
from rov_fmu.io.messages import FileError, listed
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.report.console import shell_words
from rov_fmu.tank.description import Draft
from rov_fmu.tank.findings import REFUSED, sentences
from rov_fmu.tank.folder import folder_and_files
from rov_fmu.tank.readers.parsers import one_parser


def inspect_logs(logs: str | Path | Sequence[str | Path]) -> Inspected:
    """Return what logs contain, and what no fit can learn from them, as `rov-fmu inspect` does.

    - `logs`: a folder, or one log or several of one folder. What cannot be read is among the warnings.

        found = rov_fmu.inspect_logs("dive.csv")
        found.warnings, found.undetermined, found.text  # sentences, and the draft of rov.toml

    Raises FileError if no log can be read.
    """
    return inspect_paths(checked_paths("logs", logs))


@one_parser()
def inspect_tests(
    paths: Sequence[Path], report: Path | None, *, drafts: bool, force: bool
) -> tuple[Inspected, dict[Path, str]]:
    """Inspect logs, and write the page, and the draft of rov.toml or what it lacks, if they are asked for.

    `force` allows replacing a page that rov-fmu did not write. Returns what the logs contain, and the files that were
    written, each with what it replaced. Raises FileError, and WriteError if a file cannot be written.
    """
    check_targets([(report, PAGE)], paths, force=force)
    inspected = inspect_paths(paths)
    drafts = drafts and bool(inspected.text)
    if inspected.is_enough and not inspected.missing and (inspected.own or not drafts):  # a draft is edited first
        inspected = _tried(paths, inspected, drafts=drafts)
    outputs = []
    if report:
        from rov_fmu.report.inspection_page import inspection_page  # imports Matplotlib, which takes a second

        steps = next_steps(inspected, paths, drafts=drafts)
        outputs.append(Output(report, sealed(inspection_page(inspected, steps), "inspect").encode()))
    if drafts:
        outputs.append(inspected.completed)
    written = write_whole(*outputs, force=True)
    if inspected.path in written:
        written[inspected.path] = ""  # what was there is in the completed file
    return inspected, written


def next_steps(inspected: Inspected, paths: Sequence[Path], *, drafts: bool) -> list[str]:
    """Return what to do next, in words or as command lines. With `drafts`, the draft of rov.toml is written."""
    is_new = drafts and bool(inspected.text) and not inspected.own
    if not drafts and not (inspected.is_enough and (inspected.own or not inspected.unknown)):
        return [shell_words("rov-fmu", "inspect", *paths, "--draft")]
    if inspected.unknown and not is_new:
        return [*inspected.missing, f"write into {inspected.path} what these headers mean: {listed(inspected.unknown)}"]
    return ["edit this draft"] * is_new + inspected.missing + [shell_words("rov-fmu", "identify", *paths)]


def _tried(paths: Sequence[Path], inspected: Inspected, *, drafts: bool) -> Inspected:
    """Return what logs contain, with a warning for each reason why `identify` refuses them, which comes next. With
    `drafts`, rov.toml has what it lacked."""
    folder, files = folder_and_files(paths)
    try:
        as_written = Draft(inspected.completed.content.decode(), "") if drafts else None
        draft = as_written if inspected.own else inspected.draft_for(None)
        found = load_tests(folder, files=files, draft=draft).folder.findings
    except FileError as error:
        lines = str(error).splitlines()
        reasons = {warning: warning.rpartition("left out as unreadable: ")[2] for warning in inspected.warnings}
        others = [one for one, reason in reasons.items() if not any(line.endswith(reason) for line in lines)]
        return replace(inspected, warnings=[*others, *lines], is_refused=True)
    told = [finding for finding in found if finding.kind in (*REFUSED, "doubtful signs")]
    is_refused = any(finding.kind in REFUSED for finding in told)
    return replace(inspected, warnings=[*inspected.warnings, *sentences(told)], is_refused=is_refused)
