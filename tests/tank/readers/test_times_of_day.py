"""Times of day in a table, with a date or without one, are the times that a person reads in them."""

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import ColumnNames
from rov_fmu.tank.inspection.inspection import inspect
from rov_fmu.tank.read_log import read_logs
from tests.tank.logs import measured
from tests.tank.readers.motion import BLUEROV2

START = datetime(2025, 10, 8, 23, 59, 57, tzinfo=timezone.utc)
AT = [START + timedelta(seconds=0.25 * n) for n in range(40)]
"""Ten seconds over midnight."""


def hundredths(at: datetime) -> str:
    return f"{at:%S}.{at.microsecond // 10_000:02}"


CLOCKS: dict[str, Callable[[datetime], str]] = {
    "24 hours": lambda at: f"{at:%H:%M}:{hundredths(at)}",
    "a comma": lambda at: f"{at:%H:%M}:{hundredths(at)}".replace(".", ","),
    "UTC": lambda at: f"{at:%H:%M}:{hundredths(at)} UTC",
}
DATES = {
    "ISO": "%Y-%m-%d",
    "a slash": "%Y/%m/%d",
    "no mark": "%Y%m%d",
    "day.month.year": "%d.%m.%Y",
}
TITLES = {"time [s]": "date", "Time": "Date", "Uhrzeit": "Datum", "UTC Time [hh:mm:ss]": "UTC date"}


def times(folder: Path, titles: str, rows: Sequence[str]) -> Array:
    """Return the times of a depth in a table that only has these columns before it and a command."""
    path = folder / "dive.csv"
    lines = [f"{titles};u_5 [%];depth [m]", *(f"{row};{n % 7};{0.1 * n:.3f}" for n, row in enumerate(rows))]
    path.write_text("\n".join(lines), encoding="utf-8")
    (log,) = read_logs(path, BLUEROV2, ColumnNames(), is_part=True)
    assert measured(log, "depth") == pytest.approx(0.1 * np.arange(len(rows)))
    (channel,) = (one for one in log.channels if one.quantity.name == "depth")
    return channel.time


SINCE_1970 = [at.timestamp() for at in AT]
SINCE_MIDNIGHT = [time - SINCE_1970[0] + 86397.0 for time in SINCE_1970]


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_time_of_day_goes_on_over_midnight(clock: str, tmp_path: Path) -> None:
    for title in TITLES:
        assert times(tmp_path, title, [CLOCKS[clock](at) for at in AT]) == pytest.approx(SINCE_MIDNIGHT)


@pytest.mark.parametrize(
    ("date", "clock"),
    [
        pytest.param(date, clock, marks=() if c == d % len(CLOCKS) else pytest.mark.weekly)
        for d, date in enumerate(DATES)
        for c, clock in enumerate(CLOCKS)
    ],
)
def test_a_date_may_stand_in_its_own_column_or_before_the_time(date: str, clock: str, tmp_path: Path) -> None:
    """It changes at midnight."""
    own = [(at.strftime(DATES[date]), CLOCKS[clock](at)) for at in AT]
    for title, of_date in TITLES.items():
        assert times(tmp_path, f"{of_date};{title}", [";".join(row) for row in own]) == pytest.approx(
            SINCE_1970, abs=1e-5
        )
    assert times(tmp_path, "Timestamp", [" ".join(row) for row in own]) == pytest.approx(SINCE_1970, abs=1e-5)


def test_a_date_that_is_that_of_the_start_or_of_another_zone_does_not_count_twice(tmp_path: Path) -> None:
    clock = CLOCKS["24 hours"]
    rows = [f"{START:%Y-%m-%d};{clock(at)}" for at in AT]
    assert times(tmp_path, "date;time [s]", rows) == pytest.approx(SINCE_1970, abs=1e-5)
    rows = [f"{at + timedelta(seconds=2):%Y-%m-%d};{clock(at)}" for at in AT]
    assert times(tmp_path, "date;time [s]", rows) == pytest.approx(SINCE_1970, abs=1e-5)


ODD: dict[str, Callable[[datetime], str]] = {
    "AM or PM": lambda at: f"{at:%I:%M}:{hundredths(at)} {at:%p}",
    "hours and minutes": lambda at: f"{at:%H:%M}",
    "minutes and seconds": lambda at: f"{at:%M}:{hundredths(at)}",
    "the month first": lambda at: f"{at:%m/%d/%Y %H:%M}:{hundredths(at)}",
    "a year of two digits": lambda at: f"{at:%d.%m.%y %H:%M}:{hundredths(at)}",
    "the month in letters": lambda at: f"{at:%d %b %Y %H:%M}:{hundredths(at)}",
    "a date with AM or PM": lambda at: f"{at:%Y-%m-%d %I:%M}:{hundredths(at)} {at:%p}",
    "another zone": lambda at: f"{at:%H:%M}:{hundredths(at)} CET",
    "a word": lambda at: f"late at {at:%S}",
}


@pytest.mark.parametrize("form", ODD)
def test_a_time_in_another_form_is_refused_in_one_line_that_says_what_to_write(form: str, tmp_path: Path) -> None:
    rows = [ODD[form](at) for at in AT]
    for title in ("time [s]", *(["Time"] if form != "a word" else [])):
        with pytest.raises(DataFileError) as error:
            times(tmp_path, title, rows)
        reason = "is no time, and no row has both a time and a command; write seconds, a time of day such as 10:08:02.5"
        place = f"{tmp_path / 'dive.csv'}, line 2, column 'time [s]' = {rows[0]}"
        assert f"{error.value}" == f"{place}: {reason}, or 2026-05-01T10:08:02.5"


def test_cells_that_are_damaged_have_no_time(tmp_path: Path) -> None:
    rows = [CLOCKS["24 hours"](at) for at in AT]
    rows[5], rows[9] = "23:5", "x"
    path = tmp_path / "dive.csv"
    path.write_text("\n".join(["Time,u_5 [%],depth [m]", *(f"{row},{n},{n}" for n, row in enumerate(rows))]))
    (log,) = read_logs(path, BLUEROV2, ColumnNames())
    assert {finding.kind: finding.words for finding in log.findings}["rows without time"]["count"] == 2


def test_the_columns_of_the_time_are_listed_as_such(tmp_path: Path) -> None:
    rows = [f"{START:%d.%m.%Y};{CLOCKS['24 hours'](at)};{n}" for n, at in enumerate(AT)]
    (tmp_path / "dive.csv").write_text("\n".join(["Datum;Uhrzeit;Tiefe [m]", *rows]), encoding="utf-8")
    (seen,) = inspect(tmp_path / "dive.csv", [BLUEROV2])
    assert seen.unread == {}
    assert seen.columns == {"Uhrzeit": "time [s]", "Datum": "date", "Tiefe [m]": "depth [m]"}
    assert [row.name for row in seen.channels] == ["depth"]
