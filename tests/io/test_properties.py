"""A table of numbers is the same in any usual dialect, and a mistake in it is told where it stands."""

import random
from math import isnan, nan
from pathlib import Path

import pytest

from rov_fmu.io.columns import Column, read_columns
from rov_fmu.io.csv_table import DataFileError
from tests.often import often

BEFORE = {  # what may stand before the header, and the number of lines that are told
    "sep={}\n": 0,
    '"SEP={}"\n\n': 0,
    "Tank of Odense\n": 1,
    "# rate: 10 Hz\n#\n# 1 2\n": 3,
    "Instrument{0}CTD\nRate [Hz]{0}10\nDate{0}2024-05-11\n\nNote{0}\n": 4,
    'Diameter 5" tube\n': 1,
    "sep={}\n# by hand\n": 1,
    "": 0,
}
PROSE = {"Recorded on Monday, with a DVL, and a tether\n\n": 1, "Location: Odense, Denmark\n": 1, "# rate, 10 Hz\n": 1}
"""The same with commas, where these do not separate the columns."""
DIALECTS = [(";", ","), (";", "."), ("\t", ","), ("\t", "."), (",", ".")]
"""What separates columns, and decimals."""
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "cp1252")
HEADERS = ("{} [{}]", "{}[{}]", "  {}  [ {} ] ", '"{} [{}]"', "# {} [{}]")


def cell(rng: random.Random, value: float, decimal: str) -> str:
    """Return a number, or a blank, as some program writes it."""
    text = rng.choice(["", "-", "nan", "NaN"]) if isnan(value) else rng.choice([f"{value:.17g}", f"{value:.16e}"])
    return rng.choice(["{}", " {} ", '"{}"'] if text else ["{}"]).format(text.replace(".", decimal))


@often("tables", 60, 2000)
def test_a_table_is_the_same_in_any_dialect(tables: int, tmp_path: Path) -> None:
    rng, path = random.Random(tables), tmp_path / "some.csv"
    for _ in range(tables):
        (separator, decimal), encoding = rng.choice(DIALECTS), rng.choice(ENCODINGS)
        before, told = rng.choice([*(BEFORE | (PROSE if separator != "," else {})).items()])
        names = [rng.choice([str.upper, str.lower, str.capitalize])(name) for name in ("angle", "pulse")]
        first, *others = [rng.choice(HEADERS[:-1]) for _ in names]
        header = separator.join(
            [rng.choice([first, HEADERS[-1]]).format(names[0], "°"), others[0].format(names[1], "µs")]
        )
        rows = [
            [rng.uniform(-1e3, 1e3), rng.choice([rng.gauss(0.0, 1e-3), 1500.0, nan])] for _ in range(rng.randint(2, 5))
        ]
        lines = [separator.join(cell(rng, value, decimal) for value in row) for row in rows]
        blank = rng.randrange(len(lines))
        lines.insert(blank, rng.choice(["", separator]))
        text = before.format(separator) + "\n".join([header, *lines, ""])
        path.write_bytes(text.replace("\n", rng.choice(["\n", "\r\n"])).encode(encoding))
        columns = {"angle": Column({"°": 1.0}), "pulse": Column({"µs": 1.0}, blanks=True)}
        table = read_columns(path, columns)
        read = [[*row] for row in zip(*table.values.values(), strict=True)]
        for found, expected in zip(read, rows, strict=True):
            assert found == pytest.approx(expected, rel=1e-15, nan_ok=True), text
        assert [text == ("",) for text in table.texts("pulse")] == [isnan(pulse) for _, pulse in rows]
        start = before.count("\n") + 2
        assert [*table.lines] == [n for n in range(start, start + len(lines)) if n != start + blank], text
        assert ("code page" in table.assumed) == (encoding == "cp1252")
        assert table.assumed.get("lines before header", {}).get("count", 0) == told, text
        where = f"line {table.lines[0]}, column '.*' = "
        with pytest.raises(DataFileError, match=f"{where}.*must be at least 2000"):
            read_columns(path, columns | {"angle": Column({"°": 1.0}, minimum=2000.0)})
