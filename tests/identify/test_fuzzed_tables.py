"""Fuzzed folders of tank tests lead to a vehicle with finite numbers, or to one clear line without any output."""

import re
import shutil
from math import isfinite
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle
from tests.commands import TESTS, Capsys, without_progress
from tests.damage import changed_bytes, changed_cells, changed_course, changed_lines, changed_toml, fuzz
from tests.often import often, spread
from tests.recordings import run, write_log

pytestmark = pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # such a vehicle is seldom good

LOG = "log_heave_a.csv"


@pytest.fixture
def tests(tmp_path: Path) -> Path:
    """Return a small folder with all kinds of tests in heave."""
    folder = Path(shutil.copytree(TESTS, tmp_path / "tests", ignore=shutil.ignore_patterns("*surge*", "*yaw*")))
    rov = re.sub(r"^[ab]_t_top .*$", "", (folder / "rov.toml").read_text(encoding="utf-8"), flags=re.M)
    (folder / "rov.toml").write_text(rov, encoding="utf-8")
    (folder / "thrust_top.csv").write_text(
        "command [%],force [N]\n20,0.27\n50,1.65\n70,3.2\n-50,-1.6\n", encoding="utf-8"
    )
    recording = run(load_vehicle(VIDEORAY), HEAVE, ((0.0, 2.0), (0.3, 6.0), (-0.5, 6.0)), 5.0)
    write_log(folder, "a", recording.noisy(np.random.default_rng(1)))
    return folder


def mutated(folder: Path, to: Path, data: st.DataObject) -> None:
    """Copy the folder with one of its files changed."""
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(folder, to)
    path = to / data.draw(st.sampled_from(sorted(path.name for path in folder.glob("*.[ct][so][vm]*"))))
    numbers = [changed_cells, changed_course] if path.suffix == ".csv" else [changed_toml]
    change = data.draw(st.sampled_from([*numbers * 2, changed_lines, changed_bytes]))
    path.write_bytes(change(path.read_bytes(), data))


def check_line(text: str, folder: Path) -> None:
    """Check that the message is one printable line of limited length that names a file or the folder."""
    assert str(folder) in text
    for line in text.splitlines():
        assert line.isprintable()
        assert len(line.replace(str(folder), "")) < 350


def output_or_one_line(arguments: list[str], out: Path, folder: Path, capsys: Capsys) -> str:
    """Run a command, and check for an output, which is then removed, or for one clear line. Return the line.

    Only `tune` warns, about implausible results.
    """
    out.unlink(missing_ok=True)
    code = main([*arguments, str(out)])
    printed, err = capsys.readouterr()
    said = without_progress(err)
    assert out.exists() == (code == 0)
    if code:
        assert (code, printed) == (2, "")
        check_line(said.removesuffix("\n"), folder)
        return said
    assert not re.search(r"\b(nan|inf)\b", printed)
    assert all(line.startswith(("rov-fmu: warning: ", " ")) for line in said.splitlines())
    if out.suffix == ".toml":
        assert all(isfinite(value) for value in load_vehicle(out).coefficients.values())
    out.unlink()
    assert arguments[0] == "tune" or not said
    return ""


@often("examples", 6, 30, 2000)
def test_any_folder_is_read_or_one_clear_line(examples: int, tests: Path, tmp_path: Path) -> None:
    folder = tmp_path / "changed"

    def check(data: st.DataObject) -> None:
        mutated(tests, folder, data)
        try:
            found = load_tests(folder)
        except (DataFileError, VehicleFileError) as error:
            check_line(str(error), folder)
            return
        for rows in found.folder.rows.values():
            assert all(isfinite(row.value) and -1.0 <= row.command <= 1.0 for row in rows)
        for log in found.folder.logs:
            assert log.commands
            assert np.isfinite(log.commands.rows).all()
            assert all(np.isfinite(channel.time).all() for channel in log.channels)

    fuzz(check, examples)


@pytest.mark.parametrize("examples", [2, pytest.param(30, marks=pytest.mark.weekly)])
@pytest.mark.parametrize("only", spread(["rov.toml", "steady_heave_down.csv", LOG], ["rov.toml"]))
def test_any_folder_is_identified_or_one_clear_line(
    only: str, examples: int, tests: Path, tmp_path: Path, capsys: Capsys
) -> None:
    folder = tmp_path / "changed"
    if only != LOG:
        (tests / LOG).unlink()
    original = (tests / only).read_bytes()
    changes = [changed_toml] if only == "rov.toml" else [changed_course, changed_course, changed_cells]

    def check(data: st.DataObject) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(tests, folder)
        (folder / only).write_bytes(data.draw(st.sampled_from(changes))(original, data))
        output_or_one_line(["identify", str(folder), "-o"], tmp_path / "rov.toml", folder, capsys)

    fuzz(check, examples)


N = np.arange(100.0)
HEADER = "time [s],command [%],depth [m]"
T, STEP, RAMP = 0.1 * N, 30.0 * (N > 20.0), 0.01 * N
# Recordings of 100 samples that no filter and no fit was made for: time, command in % and depth.
STRANGE = {
    "a gap of years between steps of nanoseconds": (np.where(N < 50.0, 1e-7 * N, 1e9 + N), STEP, RAMP),
    "nanoseconds": (1e-9 * N, STEP, RAMP),
    "years": (1e7 * N, STEP, RAMP),
    "a spike": (T, STEP, 5.0 * (N == 50.0)),
    "a jump": (T, STEP, 5.0 * (N > 50.0)),
    "subnormal numbers": (T, STEP, 5e-324 * N),
    "growth without end": (T, STEP, np.exp(0.1 * N)),
    "noise alone": (T, 100.0 * np.sin(77.0 * N), np.sin(33.0 * N)),
    "a command at the end alone": (T, 30.0 * (N == 99.0), RAMP),
}


@pytest.mark.parametrize("case", spread(STRANGE, [*STRANGE][::2], STRANGE))
def test_a_strange_recording_is_identified_or_one_clear_line(
    case: str, tests: Path, tmp_path: Path, capsys: Capsys
) -> None:
    np.savetxt(tests / LOG, np.column_stack(STRANGE[case]), "%r", ",", header=HEADER, comments="")
    said = output_or_one_line(["identify", str(tests), "--report"], tmp_path / "report.html", tests, capsys)
    assert not said or LOG in said


HARDLY = ("20,0;50,0", "20,-0.001;50,0.01;70,3", "20,1;50,1;70,0.5;100,-0.02", "20,0;50,0;-50,-1.6", "20,0;50,1e-200")


@pytest.mark.parametrize("forces", spread(HARDLY, ["20,0;50,0"], ["20,0;50,1e-200"]))
def test_a_thrust_curve_that_hardly_pushes_is_one_clear_line_or_a_vehicle(
    forces: str, tests: Path, tmp_path: Path, capsys: Capsys
) -> None:
    rows = forces.replace(";", "\n")
    (tests / "thrust_top.csv").write_text(f"command [%],force [N]\n{rows}\n", encoding="utf-8")
    said = output_or_one_line(["identify", str(tests), "-o"], tmp_path / "rov.toml", tests, capsys)
    assert not said or "the thrust curve of top gives" in said or "thrust_top*.csv: must give a force above 0" in said
