"""The files with Tables 3-8 of the paper; tests/paper has what the FMU gives."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import ALONE
from tests.paper.test_paper import NON_LINEAR, ROWS, SCALED, closed_form
from tests.vehicles import with_axes
from verification.published import Cell, ResponseTable, load_tables

DATA = VIDEORAY.parent / "tables"
MODELS = {"non_linear": NON_LINEAR, "scaled": SCALED}


# ---- The files ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tables(vehicle: Vehicle) -> Mapping[str, ResponseTable]:
    """The tables of the velocities w, r and u."""
    return {table.axis.velocity: table for table in load_tables(vehicle)}


def cells_of(tables: Mapping[str, ResponseTable], axis: str, command: int, model: str) -> tuple[Cell, Cell]:
    row = next(row for row in tables[axis].rows if row.command == command)
    response = getattr(row, model)
    return response.V_ss, response.Tau


def test_the_files_hold_the_printed_cells_and_the_tables_have_the_computed_ones(
    tables: Mapping[str, ResponseTable],
) -> None:
    assert [(axis, int(row.command)) for axis, table in tables.items() for row in table.rows] == [
        (axis, command) for axis, command, _ in ROWS
    ]
    assert [(t.number, t.steady_number, t.axis.name, t.axis.unit) for t in tables.values()] == [
        (6, 3, "heave", "m/s"),
        (7, 5, "yaw", "rad/s"),
        (8, 4, "surge", "m/s"),
    ]
    for axis, command, cells in ROWS:
        for (name, model), printed in zip(MODELS.items(), (cells[:6:3], cells[6::3]), strict=True):
            found = cells_of(tables, axis, command, name)
            assert [cell.computed for cell in found] == pytest.approx(closed_form(model, axis, command / 100.0))
            if axis == "u":  # Table 8 is lost
                assert [cell.printed for cell in found] == [None, None]
                assert str(tables["u"].steady[Decimal(command)]) == printed[0]
                continue
            assert [str(cell.printed) for cell in found] == printed
            rounded = [f"{cell.computed:.2f}" == text for cell, text in zip(found, printed, strict=True)]
            assert [cell.rounds_to_printed for cell in found] == rounded
    measured = {axis: [row.scaled.V_ss.measured for row in table.rows] for axis, table in tables.items()}
    assert [*map(str, measured["r"])] == ["1.34", "1.51", "2.61", "4.06"]
    assert str(tables["w"].steady[Decimal(50)]) == "0.28", "downward, which comes last"
    assert measured["u"] == [*tables["u"].steady.values()], "its table of responses has no measured V_ss"


def test_the_vehicle_file_tells_how_far_steady_velocities_are_off(vehicle: Vehicle) -> None:
    cells = [row.scaled.V_ss for table in load_tables(vehicle) for row in table.rows]
    worst = max(abs(cell.from_measured) for cell in cells if cell.from_measured is not None)
    said = f"Steady velocities are up to {worst:.0%} off the measured ones of Tables 3 to 5."
    assert said.replace("%", " %") in vehicle.limits


# ---- Mistakes -------------------------------------------------------------------------------------


def test_vehicle_without_tables(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(ALONE, encoding="utf-8")
    with pytest.raises(DataFileError, match=r"vehicle\.data"):
        load_tables(load_vehicle(path))
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


@pytest.mark.parametrize("case", BAD_TABLES)
def test_bad_table_is_one_clear_line(case: str, tmp_path: Path) -> None:
    name, old, new, named = BAD_TABLES[case]

    def change(text: str) -> bytes:
        assert old in text
        return text.replace(old, new, 1).encode()

    vehicle_file, table = tables_with(tmp_path, name, change)
    with pytest.raises(DataFileError) as error:
        load_tables(load_vehicle(vehicle_file))
    assert "\n" not in str(error.value)
    assert all(word in str(error.value) for word in (str(table), *named.split(" … ")))
