"""What today's identification needs of a folder of tests: its tables, its recordings, and the vehicle they concern."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from rov_fmu.identify.adapter.narrowing import Given, Narrowed, Tested, narrowed
from rov_fmu.identify.adapter.recording import Recording, recordings_of, signal_name
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.model.layout import AXES, Layout
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.findings import SENTENCES, Finding, refusals
from rov_fmu.tank.folder import KINDS, Folder, file_hash, read_folder
from rov_fmu.tank.log import Log
from rov_fmu.tank.readers.tank_tables import Row
from rov_fmu.vehicle.vehicle import VehicleFileError


@dataclass(frozen=True)
class TankTests:
    """All tests of a folder."""

    folder: Path
    given: Given
    thrust: Mapping[str, tuple[Row, ...]]
    """Forces by thrust curve."""
    steady: Mapping[str, tuple[Row, ...]]
    """Steady velocities by axis."""
    time_constants: Mapping[str, tuple[Row, ...]]
    """Time constants by axis."""
    recordings: Mapping[str, tuple[Recording, ...]]
    """Recordings by axis."""
    dives: int
    """The number of logs of several axes, or with a command for each thruster."""
    inputs: Mapping[str, str]
    """The SHA-256 hash of every file read, by its name."""
    tested: Tested
    """The curves and axes that the files test, including curves that the vehicle does not need."""
    findings: tuple[Finding, ...] = ()
    """What was left out of the vehicle and of the files."""

    def without(
        self, recordings: Collection[Recording], axes: Collection[str], findings: Iterable[Finding]
    ) -> "TankTests | None":
        """Return the tests without some recordings, and without all tests of some axes; the findings say why.

        Returns None where nothing is left from which a vehicle could be identified.
        """
        remaining = {
            name: kept
            for name, some in self.recordings.items()
            if name not in axes and (kept := tuple(r for r in some if r not in recordings))
        }
        # Without its recordings, an axis may have too few other tests.
        for gone in ({*axes}, {*axes, *(name for name in self.recordings if name not in remaining)}):
            tested = replace(
                self.tested,
                steady={name: back for name, back in self.tested.steady.items() if name not in gone},
                time_constants=[name for name in self.tested.time_constants if name not in gone],
                logs=[*remaining],
            )
            vehicle = narrowed(self.given.description, tested, self.folder)
            if vehicle.given and (tested.axes or tested.thrust):
                curves = {curve.name for curve in vehicle.given.rov.layout.curves}
                return replace(
                    self,
                    given=vehicle.given,
                    thrust={name: rows for name, rows in self.thrust.items() if name in curves},
                    steady={name: rows for name, rows in self.steady.items() if name not in gone},
                    time_constants={name: rows for name, rows in self.time_constants.items() if name not in gone},
                    recordings=remaining,
                    tested=tested,
                    findings=(*self.findings, *findings, *(f for f in vehicle.findings if f not in self.findings)),
                )
        return None


def kind_of_data(tests: TankTests) -> str:
    """Return what a vehicle was identified from: tank tests, a dive log, or both."""
    parts = ["a dive log" if tests.dives == 1 else f"{tests.dives} dive logs"] if tests.dives else []
    recordings = {r.file for r in chain(*tests.recordings.values())}
    if any((tests.thrust, tests.steady, tests.time_constants, len(recordings) > tests.dives)):
        parts.insert(0, "tank tests")
    return " and ".join(parts) or "given values"


def load_tank_tests(folder: Path, check_inputs: Callable[[Sequence[Path]], None] = lambda _: None) -> TankTests:
    """Read a folder. Raises DataFileError or VehicleFileError with a line for every mistake.

    `check_inputs` is called with every file that the identification reads, before any test is read.
    """
    found = read_folder(folder, check_inputs)
    description = found.rov_file.description
    recordings = _recordings(found) if description else {}
    tested = _tested(found, recordings)
    vehicle = Narrowed(None)
    # If no axis was found, it may be in a file that could not be read.
    if description and (tested.axes or not found.mistakes):
        vehicle = narrowed(description, tested, folder)
    in_tests = [*found.mistakes, *vehicle.test_mistakes]
    mistakes = [*found.rov_file_mistakes, *found.mistakes, *vehicle.rov_file_mistakes, *vehicle.test_mistakes]
    if mistakes:
        raise (DataFileError if in_tests else VehicleFileError)(*mistakes)
    assert vehicle.given
    return _tests(found, recordings, vehicle.given, tested, vehicle.findings)


def _recordings(found: Folder) -> dict[str, list[Recording]]:
    """Return the recordings of all logs by axis, and add findings about useless ones, and mistakes, to the folder."""
    description = found.rov_file.description
    assert description
    by_axis: dict[str, list[Recording]] = {}
    usable, findings, mistakes = recordings_of_logs(found.path, found.logs, description.layout, description.logged)
    found.findings += findings
    if not (usable or found.rows):
        found.mistakes += mistakes
    for log in found.logs:
        for axis in () if log.axis else description.layout.kinds.keys() - description.logged.kinds.keys():
            names = (signal_name(AXES[axis], quantity) for quantity in (AXES[axis].position, "velocity"))
            if axis not in ("roll", "pitch") and any(map(log.used, names)):
                found.findings.append(Finding("together", axis, file=log.file, names={"axis": axis}))
    for recording in usable:
        by_axis.setdefault(recording.axis.name, []).append(recording)
    return by_axis


def recordings_of_logs(
    folder: Path, logs: Sequence[Log], layout: Layout, logged: Layout
) -> tuple[list[Recording], list[Finding], list[str]]:
    """Return the recordings of logs, findings about useless ones, and the lines to refuse a folder that has no others.

    `layout` is for the logs of one axis, and `logged` for those of several.
    """
    results = [(log, *recordings_of(log, layout if log.axis else logged)) for log in logs]
    findings, refused = [], []
    for log, recordings, own in results:
        if not recordings:
            left_out = [finding for finding in log.findings if finding.kind == "channel left out"]
            reasons = own or [Finding("nothing measured", file=log.file)]
            refused += refusals([*left_out, *reasons], folder, SENTENCES)
            findings += reasons
        else:
            findings += own
    return [recording for _, recordings, _ in results for recording in recordings], findings, refused


def _tested(found: Folder, recordings: Mapping[str, Sequence[Recording]]) -> Tested:
    """Return what the files test."""
    description = found.rov_file.description
    windows = description.tables.windows if description else {}

    def subjects(kind: str) -> list[str]:
        return [subject for other, subject in found.files if other == kind]

    def has_backward_rows(kind: str, subject: str) -> bool:
        low, _ = windows.get(f"thrust_{subject}" if kind == "thrust" else subject, (-1.0, 1.0))
        return any(low <= row.command < 0.0 for row in found.rows.get((kind, subject), ()))

    return Tested(
        {name: (found.files["thrust", name][0], has_backward_rows("thrust", name)) for name in subjects("thrust")},
        {name: has_backward_rows("steady", name) for name in subjects("steady")},
        subjects("time_constant"),
        [*filter(None, subjects("log")), *recordings],
    )


def _tests(
    found: Folder,
    recordings: Mapping[str, Sequence[Recording]],
    given: Given,
    tested: Tested,
    findings: Iterable[Finding],
) -> TankTests:
    """Return all tests; `findings` are those about the vehicle."""
    curves = {curve.name for curve in given.rov.layout.curves}
    rows: dict[str, dict[str, tuple[Row, ...]]] = {kind: {} for kind in KINDS}
    for (kind, subject), some in found.rows.items():
        if kind != "thrust" or subject in curves:
            rows[kind][subject] = tuple(some)
    cancelling = {finding.axis for finding in found.findings if finding.kind == "cancelling thrusters"}
    wanted = () if given.description.tables.base else cancelling  # a base may have axes that the logs do not concern
    about = (
        Finding("axis not pushed", f.axis) if f.kind == "axis left out" and f.axis in wanted else f for f in findings
    )
    path = given.description.tables.base
    base = {given.description.base_name: file_hash(path)} if path else {}
    return TankTests(
        found.path,
        given,
        thrust=rows["thrust"],
        steady=rows["steady"],
        time_constants=rows["time_constant"],
        recordings={name: tuple(some) for name, some in recordings.items()},
        dives=sum(not log.follows_axis for log in found.logs),
        inputs={ROV_FILE: found.inputs[ROV_FILE]} | base | found.inputs,
        tested=tested,
        findings=(*about, *found.findings),
    )
