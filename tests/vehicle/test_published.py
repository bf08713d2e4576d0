"""Tables 6–8: V_ss and Tau from trajectories of the FMU against closed form, printed and measured values."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from math import e, isclose
from pathlib import Path

import pytest
from scipy.optimize import brentq

from rov_fmu.cli import main
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.published import Cell, ResponseTable, load_tables
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import ALONE
from tests.fmi import OK
from tests.fmi2 import Fmu
from tests.vehicles import with_axes

DATA = VIDEORAY.parent / "tables"


# ---- The printed values, and their deviations from Table 9 ----------------------------------------------------------


@dataclass(frozen=True)
class Band:
    """The range of the simulated minus the printed value, which is one unit of the last printed digit wide."""

    low: float
    high: float
    reason: str


def off(low: float, reason: str) -> Band:
    """Return the band of a printed value that is smaller than the simulated one by `low` to `low` + 0.01."""
    return Band(low, low + 0.01, reason)


ROUNDED = Band(-0.005, 0.005, "the paper rounds")
TRUNCATED = Band(0.0, 0.01, "the paper cuts digits off")
TAU_W = (
    "Not from Table 9: its α_w, β_w make Tau 1.59 to 1.60 times as long as without them, the printed Tau are 1.68 to "
    "1.79 times as long; the paper does not tell how it read Tau."
)
TAU_R = "Table 9 gives 1 to 4 % more; the paper does not tell how it read Tau, and prints two of heave's here."
V_R = "Not from Table 9: 5 % more at 20 %, 1 to 2 % less at 30 and 50 %, although 70 % agrees; no α_r gives all four."

# For each axis and command in %: V_ss and Tau of the non-linear model, V_ss and Tau of the scaled model; each as the
# printed value and its band.
CELLS: dict[tuple[str, int], tuple[tuple[str, Band], ...]] = {
    ("heave", 20): (("0.10", ROUNDED), ("1.76", off(0.25, TAU_W)), ("0.11", ROUNDED), ("3.08", off(0.13, TAU_W))),
    ("heave", 30): (("0.16", ROUNDED), ("1.33", off(0.05, TAU_W)), ("0.17", ROUNDED), ("2.23", off(-0.03, TAU_W))),
    ("heave", 50): (("0.28", ROUNDED), ("0.80", off(0.05, TAU_W)), ("0.30", ROUNDED), ("1.40", off(-0.05, TAU_W))),
    ("heave", 70): (("0.39", TRUNCATED), ("0.58", off(0.03, TAU_W)), ("0.42", TRUNCATED), ("1.04", off(-0.06, TAU_W))),
    ("yaw", 20): (("0.93", ROUNDED), ("0.39", off(0.01, TAU_R)), ("1.10", off(-0.06, V_R)), ("3.08", off(0.05, TAU_R))),
    ("yaw", 30): (("1.47", ROUNDED), ("0.29", TRUNCATED), ("1.61", off(0.03, V_R)), ("2.23", off(0.07, TAU_R))),
    ("yaw", 50): (("2.57", ROUNDED), ("0.19", TRUNCATED), ("2.82", off(0.03, V_R)), ("1.46", off(0.04, TAU_R))),
    ("yaw", 70): (("3.68", ROUNDED), ("0.14", TRUNCATED), ("4.07", ROUNDED), ("1.10", off(0.01, TAU_R))),
}

# Table 8 is lost, so surge is compared with the V_ss measured in Table 4: command in %, and the relative deviations of
# the non-linear and the scaled model from it. The paper tunes around 30 % by fits that give low commands more weight
# (section 5), and states that surge deviates above. At 20 % the measured velocity needs more thrust than (9) gives.
SURGE: dict[int, tuple[float, float]] = {
    20: (-0.278, -0.211),
    30: (-0.075, +0.006),
    40: (-0.003, +0.080),
    50: (+0.129, +0.218),
    60: (+0.117, +0.202),
    70: (+0.082, +0.161),
}
SURGE_BAND = 0.0005  # half a unit of the last digit of these deviations

MODELS = ("non_linear", "scaled")
ROWS = [*CELLS, *(("surge", command) for command in SURGE)]


# ---- The step tests of the paper, with the FMU -----------------------------------------------------------------------


def simulated(fmu: Fmu, vehicle: Vehicle, axis: str, command: int, model: str) -> tuple[float, float]:
    """Simulate V_ss and Tau of an axis from rest at a command in % with one of the models, without the closed form."""
    own = vehicle.layout.kinds[axis].axis
    values = {name: sign * command / 100.0 for name, sign in vehicle.layout.signs(own).items()}
    if model == "non_linear":
        values |= dict.fromkeys(vehicle.layout.tuning, 1.0)

    def velocity(time: float) -> float:
        with fmu.instance() as instance:
            instance.start(values)
            assert time == 0.0 or instance.step(0.0, time) == OK
            return instance.get([own.velocity])[0]

    V_ss = velocity(1000.0)
    assert isclose(V_ss, velocity(999.0), rel_tol=1e-15)
    return V_ss, float(brentq(lambda time: velocity(time) - (1.0 - 1.0 / e) * V_ss, 0.0, 100.0, xtol=1e-15))


@pytest.fixture(scope="module")
def tables(vehicle: Vehicle) -> Mapping[str, ResponseTable]:
    return {table.axis.name: table for table in load_tables(vehicle)}


def cells_of(tables: Mapping[str, ResponseTable], axis: str, command: int, model: str) -> tuple[Cell, Cell]:
    row = next(row for row in tables[axis].rows if row.command == command)
    response = getattr(row, model)
    return response.V_ss, response.Tau


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("axis", "command"), ROWS)
def test_trajectory_gives_the_closed_form_and_the_printed_cells(
    axis: str, command: int, model: str, fmu: Fmu, vehicle: Vehicle, tables: Mapping[str, ResponseTable]
) -> None:
    found = simulated(fmu, vehicle, axis, command, model)
    closed_form = [cell.computed for cell in cells_of(tables, axis, command, model)]
    assert found == pytest.approx(closed_form, rel=1e-9, abs=0.0)
    number = MODELS.index(model)
    if axis == "surge":
        deviation = found[0] / float(tables["surge"].steady[Decimal(command)]) - 1.0
        assert deviation == pytest.approx(SURGE[command][number], rel=0.0, abs=SURGE_BAND)
        return
    for value, (printed, band) in zip(found, CELLS[axis, command][2 * number : 2 * number + 2], strict=True):
        assert band.low <= value - float(printed) <= band.high, f"{value} for {printed}: {band}"


# ---- The files ---------------------------------------------------------------------------------------------------


def test_files_hold_the_printed_cells(tables: Mapping[str, ResponseTable]) -> None:
    assert [(axis, int(row.command)) for axis, table in tables.items() for row in table.rows] == ROWS
    assert [(t.number, t.steady_number, t.axis.name, t.axis.unit) for t in tables.values()] == [
        (6, 3, "heave", "m/s"),
        (7, 5, "yaw", "rad/s"),
        (8, 4, "surge", "m/s"),
    ]
    for (axis, command), expected in CELLS.items():
        cells = [cell for model in MODELS for cell in cells_of(tables, axis, command, model)]
        assert [str(cell.printed) for cell in cells] == [printed for printed, _ in expected]
        assert [cell.rounds_to_printed for cell in cells] == [band is ROUNDED for _, band in expected]
    measured = {axis: [row.scaled.V_ss.measured for row in table.rows] for axis, table in tables.items()}
    assert [*map(str, measured["yaw"])] == ["1.34", "1.51", "2.61", "4.06"]
    assert str(tables["heave"].steady[Decimal(50)]) == "0.28", "downward, which comes last"
    assert measured["surge"] == [*tables["surge"].steady.values()], "its table of responses has no measured V_ss"


# ---- rov-fmu tables -------------------------------------------------------------------------------------


def test_vehicle_without_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(ALONE, encoding="utf-8")
    assert main(["tables", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "vehicle.data" in err
    with pytest.raises(DataFileError, match="Tables 6-8 are of surge, heave and yaw, it has no heave"):
        load_tables(replace(with_axes("ur"), data=DATA))


HEAVE, YAW, SURGE_STEADY = "table6_heave_response.csv", "table7_yaw_response.csv", "table4_surge_steady.csv"
# The file, the text to replace, its replacement, and what the one line must contain.
BAD_TABLES: dict[str, tuple[str, str, str, str]] = {
    "text for a number": (HEAVE, "1.76", "slow", "line 2 … 'non-linear Tau [s]' … 'slow' … number"),
    "negative velocity": (SURGE_STEADY, "0.31", "-0.31", "line 2 … 'forward [m/s]' … = -0.31 … negative"),
    "command twice": (HEAVE, "\n30,", "\n20.0,", "line 3 … 'command [%]' … = 20.0 … above"),
    "no command": (HEAVE, "\n30,", "\n0,", "line 3 … 'command [%]' … = 0: must be above 0 and at most 100"),
    "a command beyond full": (HEAVE, "\n30,", "\n100.1,", "line 3 … = 100.1: must be above 0 and at most 100"),
}


def tables_with(tmp_path: Path, name: str, change: Callable[[str], bytes]) -> tuple[Path, Path]:
    """Copy the VideoRay's vehicle file, change one of its tables, and return the paths of both."""
    shutil.copytree(VIDEORAY.parent, tmp_path, dirs_exist_ok=True)
    vehicle_file, folder = tmp_path / VIDEORAY.name, tmp_path / DATA.name
    (folder / name).write_bytes(change((DATA / name).read_text(encoding="utf-8")))
    return vehicle_file, folder / name


def test_full_command_and_no_motion_are_allowed(tmp_path: Path) -> None:
    vehicle_file, _ = tables_with(tmp_path, SURGE_STEADY, lambda text: text.replace("20,0.31", "100,0").encode())
    (*_, surge) = load_tables(load_vehicle(vehicle_file))
    assert surge.steady[Decimal(100)] == 0


@pytest.mark.parametrize("case", BAD_TABLES)
def test_bad_table_is_one_clear_line(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name, old, new, named = BAD_TABLES[case]

    def change(text: str) -> bytes:
        assert old in text
        return text.replace(old, new, 1).encode()

    vehicle_file, table = tables_with(tmp_path, name, change)
    assert main(["tables", str(vehicle_file)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert all(word in err for word in (str(table), *named.split(" … ")))
