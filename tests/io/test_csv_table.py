"""Mistakes in a CSV file are told as they stand in it, in its own units; rows may grow, and files may be large."""

import tracemalloc
from collections.abc import Callable
from math import isnan
from pathlib import Path

import pytest

from rov_fmu.io.columns import Column, Columns, read_columns
from rov_fmu.io.csv_table import LARGEST, DataFileError, read_series
from rov_fmu.tank.readers.tables import grown_rows, read_start
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.often import often
from tests.tank.logs import read_log


def _file(folder: Path, text: str) -> Path:
    path = folder / "some.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("sign", "cell", "reason"),
    [
        ("", "179.9", "must be at least 180"),
        ("", "720.1", "must be at most 720"),
        ("-", "-179.9", "must be at most -180"),
        ("-", "-720.1", "must be at least -720"),
        ("", "-89.9", "must be 0, or 90 at least, or -90 at most"),
        ("-", "89.9", "must be 0, or 90 at least, or -90 at most"),
    ],
)
def test_bounds_are_printed_in_the_unit_of_the_file(sign: str, cell: str, reason: str, tmp_path: Path) -> None:
    """A minus sign before the header turns the sign of the numbers."""
    path = _file(tmp_path, f"{sign}angle [deg]\n{sign}360\n\n{sign}180\n{sign}720\n{cell}")
    turns = {"turn": 1.0, "deg": 360.0}
    column = Column(turns, least=0.25) if "or" in reason else Column(turns, minimum=0.5, maximum=2.0)
    with pytest.raises(DataFileError) as error:
        read_columns(path, {"angle": column})
    assert str(error.value) == f"{path}, line 6, column '{sign}angle [deg]' = {cell!r}: {reason}"


# ---- Forms of files --------------------------------------------------------------------------------------------------

LENGTH, MAYBE = Column({"m": 1.0, "cm": 100.0}), Column({"s": 1.0}, blanks=True)


def _table(folder: Path, text: str, **also: Column) -> Columns:
    return read_columns(_file(folder, text), {"length": LENGTH, **also})


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        *((f"length [m];time [s]\n{cell};1\n", "must be a number$") for cell in ("1.234,5", "1,2,3", "1e400", "٣")),
        *(
            (f"length [m];time [s]\n{cell};1\n", "leave out the row if nothing was measured$")
            for cell in ("-", "nan", "")
        ),
        ("length [m],time [s]\n0,5,25\n", r"column 3 = '25': there is no such column \(are these decimal commas\?"),
        (
            'length [m],time [s]\n"1,500",25\n',
            "= '1,500': must be a number without a comma, which may separate decimals",
        ),
        ("time [s]\n1\n", r"line 1: 'length \[m\]' is missing$"),
        (
            "0,1\n",
            "line 1 = '0, 1': no header; these lines look like numbers, and a table needs a line above them that names",
        ),
        ("", "the file is empty"),
    ],
)
def test_what_is_no_table_of_numbers_is_refused(rows: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match=reason):
        _table(tmp_path, rows, time=MAYBE)


QUOTED = {
    '"0,35",1\n"2",2\n': [0.35, 2.0],
    '" ,5 ",3\n"1,500","0,1"\n"-2,250",2\n': [0.5, 1.5, -2.25],
    '0.25,2\n"1,5e1",1\n': [0.25, 15.0],
    '0.5,"0,25"\n': [0.5],
}
"""Rows with numbers in quotes, whose commas are decimal commas, and the first column of each."""


@pytest.mark.parametrize("rows", QUOTED)
def test_decimal_commas_in_quotes(rows: str, tmp_path: Path) -> None:
    """A comma before three decimals is one where another number shows that commas separate no thousands."""
    table = _table(tmp_path, f"length [m],time [s]\n{rows}", time=MAYBE)
    assert [*table.values["length"]] == QUOTED[rows]
    series = read_series(_file(tmp_path, f"time,u\n{rows}".replace("-2,2", "2,2")), lambda _: None)
    assert [*series["time"]] == sorted(map(abs, QUOTED[rows]))


def test_all_mistakes_are_reported_together(tmp_path: Path) -> None:
    with pytest.raises(DataFileError) as error:
        _table(tmp_path, "length [m],time [s]\nlong,1\n2,late\n3,4,5\n", time=MAYBE)
    where = ("line 2, column 'length [m]' = 'long'", "line 3, column 'time [s]' = 'late'", "line 4, column 3 = '5'")
    lines = str(error.value).splitlines()
    assert len(lines) == 3
    assert all(place in line for place, line in zip(where, lines, strict=True))
    with pytest.raises(DataFileError) as error:
        _table(tmp_path, "length [ft],tim [s]\n", time=MAYBE)
    assert len(str(error.value).splitlines()) == 2
    for header, hint in {"note [1]": ". The other columns are 'note [1]'!", "tim": "; is it the column 'tim'?"}.items():
        with pytest.raises(DataFileError) as error:
            read_columns(_file(tmp_path, f"{header}\n1\n"), {"length": LENGTH, "time": MAYBE}, others=True, hint="!")
        assert str(error.value).endswith(f", line 1: 'length [m]' is missing, and so is 'time [s]'{hint}")


def test_a_loose_reading_counts_texts_that_are_not_numbers(tmp_path: Path) -> None:
    path = _file(tmp_path, "length [m],time [s],mode\n1,2,a\nx,,b\n,3\n1,2,3,4\n")
    table = read_columns(path, {"length": LENGTH, "time": MAYBE}, others=True, loose=True)
    assert [*table.lines] == [2, 3, 4]
    assert [[isnan(value) for value in table.values[name]] for name in ("length", "time")] == [
        [False, True, True],
        [False, True, False],
    ]
    assert len(read_columns(_file(tmp_path, "length [m]\n1,2\n3\n"), {"length": LENGTH}, loose=True).lines) == 1
    assert ({name: [*rows] for name, rows in table.unread.items()}, table.torn) == ({"length": [1], "time": []}, 1)


def test_a_row_is_never_skipped(tmp_path: Path) -> None:
    """Two tables in one file: the first has no units."""
    path = _file(tmp_path, "long,late\n1,2\n3,4\nlength [m],time [s]\n5,6\n")
    with pytest.raises(DataFileError, match="line 1, column 1 = 'long'"):
        read_columns(path, {"length": LENGTH, "time": MAYBE})
    assert _header(_file(tmp_path, "Timestamp,depth\n,\n--.--,-\ns,m\n2024-05-11 10:00:00.1,--.--\n")) == [
        "Timestamp",
        "depth",
    ]


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"length [m]\n\x81\n"])
def test_what_is_in_no_encoding_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "some.csv"
    path.write_bytes(content)
    with pytest.raises(DataFileError) as error:
        read_columns(path, {"length": LENGTH})
    assert str(error.value) == f"{path}: is no text in UTF-8, UTF-16 or code page 1252. Save it as UTF-8"


# ---- Rows that grow --------------------------------------------------------------------------------------------------

TITLES = ("time [s]", "roll [deg]", "mode", "depth [m]", "volts [V]", "fix")
SI = {name: Column({unit: 1.0}) for name, unit in (("time", "s"), ("roll", "deg"), ("depth", "m"), ("volts", "V"))}


def _header(path: Path) -> list[str]:
    return read_start(path, None, 1)[0]


def _cells(n: int) -> list[str]:
    """Return a row of a logger, whose columns have their own forms and sizes."""
    return [
        f"{0.1 * n:.3f}",
        f"{(37 * n) % 11 - 5:.1f}",
        "MANUAL",
        f"{-2 - 0.013 * n:.2f}",
        f"{15.9 - n / 1e4:.4f}",
        str(n % 3),
    ]


def _grown(rows: int, *steps: tuple[int, int, int], short: int = 0) -> str:
    """Return a log that grows: from row n on, so many cells are inserted before a column of the header. `short` is a
    row that was cut."""
    text = ",".join(TITLES)
    for n in range(rows):
        cells = _cells(n)
        for start, index, more in sorted(steps, key=lambda step: -step[1]):
            cells[index:index] = [str(90 + i) for i in range(more)] if n >= start else []
        text += "\n" + ",".join(cells[:3] if short and n == short else cells)
    return text + "\n"


@pytest.mark.parametrize("index", range(len(TITLES) + 1))
@pytest.mark.parametrize("start", [3, 40])
def test_columns_that_are_inserted_later_leave_the_others_right_or_blank(
    start: int, index: int, tmp_path: Path
) -> None:
    """A cell is never taken for that of another column. All that are far from the insertion are read."""
    table = read_columns(_file(tmp_path, _grown(90, (start, index, 2))), SI, others=True, loose=True, grown=grown_rows)
    wanted = [_cells(n) for n in range(90)]
    for column, name in ((0, "time"), (1, "roll"), (3, "depth"), (4, "volts")):
        read = [(value, float(row[column])) for value, row in zip(table.values[name], wanted, strict=True)]
        assert all(value == true or (isnan(value) and n >= start) for n, (value, true) in enumerate(read))
        if abs(column + 0.5 - index) > 2.0:
            assert all(value == true for value, true in read)
    told = table.assumed["grown rows"]
    assert (told["line"], told["cells"], told["columns"]) == (str(start + 2), "8", "6")


def test_columns_may_be_inserted_twice_and_a_row_cut(tmp_path: Path) -> None:
    text = _grown(120, (20, 5, 1), (70, 6, 2), short=100)
    table = read_columns(_file(tmp_path, text), SI, others=True, loose=True, grown=grown_rows)
    rows = [n for n in range(120) if n != 100]
    assert [*table.values["time"]] == [float(_cells(n)[0]) for n in rows]
    assert [*table.values["depth"]] == [float(_cells(n)[3]) for n in rows]
    assert table.torn == 1
    assert [cells["depth"] for cells in table.rows()] == [_cells(n)[3] for n in rows]


def test_rows_that_cannot_be_assigned_are_left_out_or_refused_in_one_line(tmp_path: Path) -> None:
    """All cells are alike, or fewer than three rows are before or after the insertion, or the number of cells goes up
    and down."""
    for n in (80, 1):
        rows = [[str(i % 7)] * (3 if i < n else 5) for i in range(100)]
        path = _file(tmp_path, "\n".join(["time [s],length [m],x", *map(",".join, rows)]))
        columns = {"time": MAYBE, "length": LENGTH}
        if n == 80:
            table = read_columns(path, columns, others=True, loose=True, grown=grown_rows)
            assert (table.torn, len(table.lines), table.assumed) == (20, 80, {})
            continue
        with pytest.raises(DataFileError) as error:
            read_columns(path, columns, others=True, loose=True, grown=grown_rows)
        rest = "'1': there is no such column (are these decimal commas? They need ; between the columns, or quotes)"
        more = "and 99 rows have more cells than the header, which has 3. Complete the header"
        assert str(error.value) == f"{path}, line 3, column 4 = {rest}, {more}"
    ragged = [",".join(_cells(n) + ["1", "2"] * (n % 2)) for n in range(41)]
    table = read_columns(
        _file(tmp_path, "\n".join([",".join(TITLES), *ragged])), SI, others=True, loose=True, grown=grown_rows
    )
    assert (table.torn, table.assumed) == (20, {})
    table = read_columns(_file(tmp_path, _grown(90, (88, 2, 2))), SI, others=True, loose=True, grown=grown_rows)
    assert (table.torn, table.assumed) == (2, {})


# ---- Variables over time ---------------------------------------------------------------------------------------------

SERIES = {
    "0,1\n1,2\n": ", line 1 = '0, 1': no header; these lines look like numbers, and a table needs a line above them "
    "that names the columns",
    "time,u [%]\n0,1\n": ", line 1, column 'u [%]': must be 'u' without a unit; a command of 30 % is 0.3 here",
    "time [ms],u\n0,1\n": ", line 1, column 'time [ms]': must be the time in s, which is the unit here",
    "time,u,u\n0,1,1\n": ", line 1, column 'u': this column occurs twice",
    "time,u\n0,1\n1,2,3\n": ", line 3, column 3 = '3': there is no such column (are these decimal commas? They need ; "
    "between the columns, or quotes)",
    "time,u\n0,1\n1\n": ", line 3, column 'u' = '': must be a finite number",
    "time,u\n0,1\n2,1\n1,1\n": ", line 4: the time goes back",
    "time\n0\n": ": no columns beside the time",
    "time,u\n": ": no rows below the header",
}


def test_variables_over_time(tmp_path: Path) -> None:
    path = _file(tmp_path, "time [s],u,on\n\n0,1,true\n0,.5,False\n1.5,-2e-1,1\n")
    series = read_series(path, lambda _: None)
    assert {name: [*values] for name, values in series.items()} == {
        "time [s]": [0.0, 0.0, 1.5],
        "u": [1.0, 0.5, -0.2],
        "on": [1.0, 0.0, 1.0],
    }
    assert [*series.lines] == [3, 4, 5]
    for text, reason in SERIES.items():
        with pytest.raises(DataFileError) as error:
            read_series(_file(tmp_path, text), lambda _: None)
        assert str(error.value) == f"{path}{reason}"


# ---- Large files -----------------------------------------------------------------------------------------------------


def _log(path: Path, rows: int) -> int:
    """Write a log of eight pulses, depth and heading, as autopilots do; return its size in bytes."""
    names = "time [s]", *(f"u_{n} [us]" for n in range(1, 9)), "depth [m]", "heading [deg]"
    pulses = "1523,1477,1500,1612,1388,1500,1550,1450", "1420,1477,1560,1612,1450,1550,1550,1480"
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(names) + "\n")
        file.writelines(
            f"{0.1 * n:.2f},{pulses[n // 50 % 2]},{1.0 + 1e-5 * n:.3f},{n % 360:.1f}\n" for n in range(rows)
        )
    return path.stat().st_size


def _peak(action: Callable[[], object]) -> int:
    """Return the largest number of bytes that Python and NumPy held at once during an action."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@often("rows", 3_000, 40_000)
def test_a_log_takes_at_most_six_times_its_size_in_memory(rows: int, tmp_path: Path) -> None:
    path, layout = tmp_path / "log_dive.csv", load_vehicle(SHIPPED["bluerov2"]).layout
    size = _log(path, rows)
    read_log(path, layout)  # imports modules, which should not count
    columns = {"time": Column({"s": 1.0}), "depth": Column({"m": 1.0})}
    assert _peak(lambda: read_columns(path, columns, others=True, loose=True, grown=grown_rows)) < 3 * size
    assert _peak(lambda: read_log(path, layout)) < 6 * size


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "some.csv"
    with path.open("wb") as file:
        file.truncate(LARGEST + 1_000_000)  # a sparse file, which takes no space on the disk
    with pytest.raises(DataFileError) as error:
        read_columns(path, {"length": LENGTH})
    assert str(error.value) == f"{path}: has 501,000,000 bytes; at most 500,000,000 are read"


def test_a_line_of_numbers_before_the_header_is_refused_in_one_line(tmp_path: Path) -> None:
    path = _file(tmp_path, "Date:;03.05.2026;\n1;2;3\n\ncommand [%];force [N];remark\n-50;-3;ok\n50;5;ok\n")
    with pytest.raises(DataFileError, match=r"line 2, column 3 = '3': there is no such column.*Complete the header$"):
        read_columns(path, {"a": Column({"1": 1.0})}, others=True, loose=True, renamed={"Date:": "a [1]"})
