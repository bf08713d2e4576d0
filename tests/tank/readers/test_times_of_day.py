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
    "milliseconds": lambda at: f"{at:%H:%M:%S}:{at.microsecond // 1000:03}",
    "AM and PM": lambda at: f"{at:%I:%M}:{hundredths(at)} {at:%p}",
    "a.m. and p.m.": lambda at: f"{int(f'{at:%I}')}:{at:%M}:{hundredths(at)} {f'{at:%p}'[0].lower()}.m.",
    "UTC": lambda at: f"{at:%H:%M}:{hundredths(at)} UTC",
}
DATES = {
    "ISO": "%Y-%m-%d",
    "a slash": "%Y/%m/%d",
    "no mark": "%Y%m%d",
    "day.month.year": "%d.%m.%Y",
    "day.month.year of two digits": "%d.%m.%y",
    "month/day/year": "%m/%d/%Y",
    "day/month/year": "%d/%m/%Y",
    "month/day/year of two digits": "%m/%d/%y",
    "a month in letters": "%d-%b-%Y",
    "a month before the day": "%b %d, %Y",
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
    """It changes at midnight, which also tells whether the day or the month comes first."""
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


def test_where_the_month_is_not_told_only_the_time_of_day_is_read(tmp_path: Path) -> None:
    rows = [f"10/8/2025;{at:%H:%M:%S}.{at.microsecond:06}" for at in (at - timedelta(hours=12) for at in AT)]
    assert times(tmp_path, "Date;Time", rows) == pytest.approx(np.array(SINCE_MIDNIGHT) - 43200.0)


def test_a_clock_of_12_hours_without_am_and_pm_goes_on_at_one(tmp_path: Path) -> None:
    at = [datetime(2025, 10, 8, 12, 59, 57) + timedelta(seconds=0.25 * n) for n in range(40)]
    for title, before in (("time [s]", ""), ("date;time [s]", "2025-10-08;")):
        read = times(tmp_path, title, [f"{before}{one:%I:%M}:{hundredths(one)}" for one in at])
        assert np.diff(read) == pytest.approx(0.25)


MINUTES: dict[str, tuple[Callable[[int], str], float]] = {
    "decimals": (lambda n: f"{(59 * 60 + 57 + n // 4) // 60 % 60:02}:{(57 + n // 4) % 60:02}.{n % 4 * 25:02}", 0.25),
    "more than 24": (lambda n: f"{30 + (n + 50) // 60}:{(n + 50) % 60:02}", 1.0),
    "then hours": (lambda n: f"59:{n + 50}" if n < 10 else f"1:00:{n - 10:02}", 1.0),
}


@pytest.mark.parametrize("name", MINUTES)
def test_minutes_and_seconds(name: str, tmp_path: Path) -> None:
    form, step = MINUTES[name]
    assert np.diff(times(tmp_path, "Time", [form(n) for n in range(40)])) == pytest.approx(step)


def test_hours_and_minutes_beside_a_date_and_hours_beyond_a_day(tmp_path: Path) -> None:
    read = times(tmp_path, "Date;Time", [f"2025-10-08;{10 + n // 60}:{n % 60:02}" for n in range(40)])
    assert np.diff(read) == pytest.approx(60.0)
    read = times(tmp_path, "Time", [f"{n + 23}:30:00" for n in range(40)])
    assert np.diff(read) == pytest.approx(3600.0)


UNTOLD = {
    "two numbers": (
        [f"10:{n:02}" for n in range(10)],
        "may be hours and minutes, or minutes and seconds: write hours:minutes:seconds",
    ),
    "a word": (
        [f"late{n}" for n in range(10)],
        "is no time, and no row has both a time and a command. Otherwise, write seconds, a time of day such as "
        "10:08:02.5, or 2026-05-01T10:08:02.5",
    ),
    "day or month": (
        [f"{1 + n % 2:02}/{2 - n % 2:02}/2025 10:08:{n:02}" for n in range(10)],
        "may begin with the day or with the month: write 2026-05-01",
    ),
}


@pytest.mark.parametrize("name", UNTOLD)
def test_a_time_that_is_not_told_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    rows, reason = UNTOLD[name]
    with pytest.raises(DataFileError) as error:
        times(tmp_path, "time [s]", rows)
    assert str(error.value) == f"{tmp_path / 'dive.csv'}, line 2, column 'time [s]' = {rows[0]}: {reason}"


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
