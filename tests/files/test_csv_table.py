"""What is told of a number is told in the unit of its column, whatever the first unit is; bounds may be touched."""

from math import pi
from pathlib import Path

import pytest

from rov_fmu.files.csv_table import Column, DataFileError, read_columns

# Of 0.5 to 2 turns, or 0.25 at least where there is no bound.
TURNS = {"turn": 1.0, "deg": 360.0}
BOUNDED, LEAST = Column(TURNS, minimum=0.5, maximum=2.0), Column(TURNS, least=0.25)


def _file(folder: Path, *cells: str) -> Path:
    path = folder / "some.csv"
    path.write_text("\n".join(("angle [deg]", *cells)), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("column", "cell", "told"),
    [
        (BOUNDED, "179.9", "must be at least 180"),
        (BOUNDED, "720.1", "must be at most 720"),
        (LEAST, "89.9", "must be 0, or 90 at least, or -90 at most"),
        (LEAST, "-89.9", "must be 0, or 90 at least, or -90 at most"),
    ],
)
def test_bounds_are_told_in_the_unit_of_the_column(column: Column, cell: str, told: str, tmp_path: Path) -> None:
    path = _file(tmp_path, "360", "", cell)
    with pytest.raises(DataFileError) as error:
        read_columns(path, {"angle": column})
    assert str(error.value) == f"{path}, line 4, column 'angle [deg]' = {cell!r}: {told}"


def test_a_bound_is_within(tmp_path: Path) -> None:
    assert read_columns(_file(tmp_path, "180", "720"), {"angle": BOUNDED}).values == {"angle": [0.5, 2.0]}
    assert read_columns(_file(tmp_path, "-90", "0", "90"), {"angle": LEAST}).values == {"angle": [-0.25, 0.0, 0.25]}


def test_a_number_found_wrong_later_is_told_as_it_stands(tmp_path: Path) -> None:
    path = _file(tmp_path, "90", "-45")
    table = read_columns(path, {"angle": Column({"rad": 1.0, "deg": 180.0 / pi})})
    assert table.values["angle"] == pytest.approx([pi / 2.0, -pi / 4.0], rel=1e-15)
    assert str(table.error(1, "angle", "too far")) == f"{path}, line 3, column 'angle [deg]' = -45: too far"
