"""Times of day as times: with a date or without one, over midnight, by 12 hours, or in minutes and seconds.

What a form means shows in a whole column, and not in a cell: whether the day or the month comes first, and whether a
clock that goes back goes on with the next day. A time that nothing tells is refused. `seconds` of
rov_fmu/tank/columns.py reads what is in the form of ISO 8601.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from functools import cache
from math import inf, nan
from typing import Any

import numpy as np

from rov_fmu.io.columns import Columns, KnownColumns
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import meanings, words_for, words_in
from rov_fmu.tank.columns import DATE, TIME

CLOCK = (
    r"(?<![0-9:])([0-9]{1,4})((?::[0-5][0-9]){1,2})([.,][0-9]+|:[0-9]{3})?"
    r"(?: *([ap])\.? ?m\b\.?)?(?: *(?:z|utc|gmt)\b)?(?![0-9:])"
)
"""A time of day: the first number, one or two others, decimals or milliseconds, and the first letter of AM or PM."""
BETWEEN = r"^[\sT,;_-]+|[\sT,;_-]+$"
"""What may stand between a date and a time of day."""
DAYS = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%Y%m%d", "%d.%m.%Y", "%d.%m.%y"),
    *("%m/%d/%Y", "%d/%m/%Y", "%m/%d/%y", "%d/%m/%y", "%y/%m/%d"),
    *("%m-%d-%Y", "%d-%m-%Y", "%m-%d-%y", "%d-%m-%y", "%y-%m-%d"),
    *("%d %b %Y", "%d-%b-%Y", "%d-%b-%y", "%b %d %Y", "%b %d, %Y", "%d %B %Y", "%B %d %Y", "%B %d, %Y"),
)
"""The forms of dates, as `strptime` has them."""
FIRST_ROWS = 100
"""The number of rows, with the header, that tell which columns have times of day and dates."""
HOW = "write seconds, a time of day such as 10:08:02.5, or 2026-05-01T10:08:02.5"
"""How a time is written that can be read."""
_LONG = 3.0
"""The number of parts of a time of day with hours, minutes and seconds."""
_DAY, _HALF_DAY, _HOUR, _MINUTE = 86400.0, 43200.0, 3600.0, 60.0
_EPOCH = datetime(1970, 1, 1).toordinal()
_FIND = re.compile(CLOCK, re.IGNORECASE)
_TITLES = ("time", "timestamp", "t", "date")


def time_rules_of_page() -> dict[str, Any]:
    """Return the rules by which recording.js, of the page that flies, reads times of day."""
    return {
        "pattern": CLOCK,
        "between": BETWEEN,
        "days": DAYS,
        "firstRows": FIRST_ROWS,
        "titles": [*_TITLES, *words_for("time"), *words_for("date")],
        "dates": ["date", *words_for("date")],
    }


def time_columns(rows: Sequence[Sequence[str]], renamed: Mapping[str, str]) -> dict[str, str]:
    """Return what the headers of a time of day and of its date stand for, if no other header has these names.

    `rows` are the first ones of a table, with its header; a time of day needs no unit.
    """
    titles = [renamed.get(title, title) for title in rows[0]]
    cells = [next((row[n] for row in rows[1:] if n < len(row) and row[n]), "") for n in range(len(titles))]
    found: dict[str, str] = {}
    if not any(map(KnownColumns({"time": TIME}).has, titles)):
        words = {
            title: meanings(words_in(title)) for title, cell in zip(titles, cells, strict=True) if _FIND.search(cell)
        }
        times = sorted(
            (own for own in words if set(_TITLES).intersection(words[own])), key=lambda own: words[own] != ["time"]
        )
        found |= dict.fromkeys(times[:1], "time [s]")
    if not any(map(KnownColumns({"date": DATE}).has, titles)):
        dates = (
            title
            for title, cell in zip(titles, cells, strict=True)
            if title not in found
            and "date" in meanings(words_in(title))
            and any(_ordinal(_rest(cell), form) for form in DAYS)
        )
        found |= dict.fromkeys([*dates][:1], "date")
    return found


def times_of_day(table: Columns) -> Array | None:
    """Return the times of a table whose column `time` has times of day, s; None for another one. Raises DataFileError.

    They count since 1970, or, where no date is told, since the first midnight. NaN stands for a cell that is none.
    """
    count = len(table.lines)
    if 2 * len(table.unread["time"]) <= np.count_nonzero(np.isfinite(table.values["time"])):
        return None
    numbers = np.full((count, 4), nan)
    inside, beside = [""] * count, [""] * count
    for row, cells in enumerate(table.rows()):
        if match := _FIND.search(cells["time"]):
            numbers[row] = _numbers(match)
            inside[row], beside[row] = _rest(cells["time"]), _rest(cells.get("date", ""))
    days = _days(table, "time", inside)
    if days is None:
        numbers[[bool(text) for text in inside]] = nan
        days = _days(table, "date", beside)
    rows = np.flatnonzero(np.isfinite(numbers[:, 0]) & (days is None or np.isfinite(days)))
    if not rows.size:
        return None
    first, after, parts, half = numbers[rows].T
    is_short = parts < _LONG
    is_minutes = is_short.any() and bool((parts > 2.0).any() or first[is_short].max() >= 24.0)
    if is_short.any() and not is_minutes and not half.any() and days is None:
        row = int(rows[is_short.argmax()])
        raise table.error(row, "time", "may be hours and minutes, or minutes and seconds: write hours:minutes:seconds")
    hours = np.where(half > 0.0, first % 12.0 + 12.0 * (half > 1.0), first)
    unit = np.where(is_short, _MINUTE if is_minutes else _HOUR, _HOUR)
    clock = unit * hours + np.where(is_short, unit / 60.0, 1.0) * after
    times = np.full(count, nan)
    times[rows] = _since(None if days is None else days[rows], clock, _period(first, half, unit))
    return times


def _numbers(match: re.Match[str]) -> tuple[float, float, float, float]:
    """Return the first number of a time of day; the others in the unit of the last one; 3 for hours, minutes and
    seconds, 2 for two numbers, and more with decimals; 1 or 2 for AM or PM."""
    others = [*map(float, match[2].split(":")[1:])]
    decimals = float(f"0.{match[3][1:]}") if match[3] else 0.0
    after = 60.0 * others[0] + others[1] if len(others) > 1 else others[0]
    parts = _LONG if len(others) > 1 else 2.5 if match[3] else 2.0
    return float(match[1]), after + decimals, parts, {"a": 1.0, "p": 2.0}.get((match[4] or "").lower(), 0.0)


def _period(first: Array, half: Array, unit: Array) -> float:
    """Return the time after which a clock begins again, s: a day, half a day if 1 follows 12, or an hour of minutes.
    What exceeds these counts since the start, and never begins again."""
    if (unit == _MINUTE).all():
        return _HOUR if first.max() < 60.0 else inf
    is_of_12 = not half.any() and first.min() >= 1.0 and first.max() <= 12.0
    if is_of_12 and ((first[:-1] == 12.0) & (first[1:] == 1.0)).any():
        return _HALF_DAY
    return _DAY if first.max() < 24.0 else inf


def _since(days: Array | None, clock: Array, period: float) -> Array:
    """Return times from n days since 1970 and times of day, s. Where the days do not change with the clock, as where
    the date is that of the start, only the first one counts."""
    if days is None:
        return _going_on(clock, period)
    later, on = np.diff(days), np.diff(clock)
    is_apart = ((later == 0.0) & (on < -0.5 * _DAY)) | ((later != 0.0) & (on >= 0.0) & (on < _MINUTE))
    if period == _DAY and not is_apart.any():
        return _DAY * days + clock
    start: float = _DAY * days[0]
    return start + _going_on(clock, period)


def _going_on(clock: Array, period: float) -> Array:
    """Return the times of a clock that begins again after a period: each is the nearest to the one before it."""
    if period == inf:
        return clock
    goes_on: Array = np.unwrap(clock % period, period=period)
    return goes_on


# ---- Dates -----------------------------------------------------------------------------------------------------------


def _rest(text: str) -> str:
    """Return the text without a time of day: the date, or nothing."""
    return re.sub(BETWEEN, "", " ".join(_FIND.sub(" ", text).split()))


@cache
def _ordinal(text: str, form: str) -> int | None:
    """Return the number of days since 1970 of a date, or None for one in another form."""
    with suppress(ValueError):
        return datetime.strptime(text, form).toordinal() - _EPOCH
    return None


def _days(table: Columns, column: str, texts: Sequence[str]) -> Array | None:
    """Return the days since 1970 in a column of texts without times of day; None if they are no dates.

    Of several forms, that is meant with which the days are nearest to each other. Where the days only tell how they
    follow each other, the first one is 0. Raises DataFileError where they do not tell that, either.
    """
    distinct = dict.fromkeys(filter(None, texts))
    read = {form: {text: day for text in distinct if (day := _ordinal(text, form)) is not None} for form in DAYS}
    most = max(map(len, read.values()))
    if not most:
        return None
    possible = [np.array([days.get(text, nan) for text in texts]) for days in read.values() if len(days) == most]
    spans = [np.ptp(days[np.isfinite(days)]) for days in possible]
    first, *others = [days for days, span in zip(possible, spans, strict=True) if span == min(spans)]
    row = int(np.isfinite(first).argmax())
    if any(not np.array_equal(days - days[row], first - first[row], equal_nan=True) for days in others):
        raise table.error(row, column, "may begin with the day or with the month: write 2026-05-01")
    return first - first[row] if any(days[row] != first[row] for days in others) else first
