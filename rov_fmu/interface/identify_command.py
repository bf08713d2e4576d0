"""The command `rov-fmu identify`: from logs and tank tests to the vehicle file and the report."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from rov_fmu.identify.identify import identify, load_tests
from rov_fmu.identify.inspection.inspected import inspect_paths
from rov_fmu.identify.progress import OnAnswer
from rov_fmu.identify.result import Identification
from rov_fmu.interface.arguments import checked_paths
from rov_fmu.io.file_kinds import PAGE, VEHICLE_FILE
from rov_fmu.io.messages import Progress, silent
from rov_fmu.io.output import Output, check_targets, sealed, write_whole
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.folder import folder_and_files
from rov_fmu.tank.readers.parsers import one_parser
from rov_fmu.vehicle.shipped import find_vehicle
from rov_fmu.vehicle.writer import check_report, vehicle_output


def identify_folder(
    tests: str | Path | Sequence[str | Path],
    *,
    base: str | Path | None = None,
    output: str | Path | None = None,
    report: str | Path | None = None,
    force: bool = False,
    on_progress: Progress = silent,
) -> Identification:
    """Identify a vehicle, as `rov-fmu identify` does.

    - `tests`: a folder of tank tests or dive logs with its rov.toml, or one log or several of one folder.
    - `base`: the vehicle to begin from, in place of that which rov.toml names: a name or a path.
    - `output`, `report`: the vehicle file and the report to write.
    - `force`: True to replace files that rov-fmu did not write, or that have changed since.
    - `on_progress`: called with the name of each step, and the share of its part of the work that is done.

        found = rov_fmu.identify_folder("my_tests", output="my_rov.toml", report="my_rov.html")
        rov_fmu.load(found.vehicle).response("surge", 0.3)  # m/s, s

    Raises FileError, InputError, WriteError, and BuildError where the filter cannot be compiled.
    """
    paths = checked_paths("tests", tests)
    given = [None if one is None else Path(one) for one in (output, report)]
    found = find_vehicle(base) if base else None
    return identify_tests(paths, *given, base=found, force=force, begin=lambda _: on_progress)[0]


def identify_tests(
    paths: Sequence[Path],
    vehicle: Path | None,
    report: Path | None,
    *,
    base: Path | None = None,
    force: bool,
    begin: Callable[[str], Progress],
    on_answer: OnAnswer | None = None,
) -> tuple[Identification, dict[Path, str]]:
    """Identify a vehicle from a folder of tank tests, or from logs in one folder, and write the files that are asked
    for.

    These are the vehicle file and the report. `base` replaces the vehicle to begin from that rov.toml names. Without a
    rov.toml, the vehicle that the logs seem to be of is assumed.

    `force` allows replacing files that `identify` did not write, or that were changed since. `begin` is called with the
    name of each part of the work, and returns the function that takes the progress of this part. `on_answer` is called
    with each axis and what is known about it so far.

    Returns the identification, and the files that were written, each with what it replaced. Raises FileError. Raises
    WriteError if a file cannot be written; most such cases are found before the work begins.
    """
    if vehicle and report:
        check_report(vehicle, report)
    targets = [(vehicle, VEHICLE_FILE), (report, PAGE)]
    check_targets(targets, force=True)  # whose files they are matters once the inputs are known

    def check_outputs(inputs: Sequence[Path]) -> None:
        """Check the files to write as soon as the input files are known."""
        check_targets(targets, inputs, force=force)

    begin("reading the tests")
    folder, files = folder_and_files(paths)
    with one_parser():
        draft = None if (folder / ROV_FILE).exists() else inspect_paths(paths).draft_for(base)
        tests = load_tests(folder, check_outputs, base, files, draft)
    identification = identify(tests, begin("identifying the vehicle"), on_answer)
    outputs = []
    if vehicle:
        identified = identification.vehicle
        if report:
            assert identified.provenance
            identified = replace(identified, provenance=identified.provenance.model_copy(update={"report": report}))
        outputs.append(vehicle_output(identified, vehicle))
    if report:
        from rov_fmu.report.report import report_page  # imports Matplotlib, which takes a second

        page = report_page(identification, begin("drawing the report"))
        outputs.append(Output(report, sealed(page, "identify").encode()))
    return identification, write_whole(*outputs, force=force)
