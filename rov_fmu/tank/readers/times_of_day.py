"""Times of day as times: hours, minutes and seconds, with a date beside them or over midnight without one.

`seconds` of rov_fmu/tank/columns.py reads what is in the form of ISO 8601. Other forms are refused.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from functools import cache
from math import isfinite, nan
from typing import Any

import numpy as np

from rov_fmu.io.columns import Columns, KnownColumns
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import meanings, words_for, words_in
from rov_fmu.tank.columns import DATE, TIME

CLOCK = r"(?<![0-9:])([0-9]{1,2})((?::[0-5][0-9]){2})([.,][0-9]+)?(?: *(?:z|utc|gmt)\b)?(?![0-9:])"
"""A time of day: hours, minutes and seconds, and decimals."""
BETWEEN = r"^[\sT,;_-]+|[\sT,;_-]+$"
"""What may stand between a date and a time of day."""
DAYS = ("%Y-%m-%d", "%Y/%m/%d", "%Y%m%d", "%d.%m.%Y")
"""The forms of dates, as `strptime` has them: those of which nobody has to ask whether the day comes first."""
FIRST_ROWS = 100
"""The number of rows, with the header, that tell which columns have times of day and dates."""
HOW = "write seconds, a time of day such as 10:08:02.5, or 2026-05-01T10:08:02.5"
"""How a time is written that can be read."""
_DAY = 86400.0
_EPOCH = datetime(1970, 1, 1).toordinal()
_FIND = re.compile(CLOCK, re.IGNORECASE)
LIKE = r"[0-9]:[0-5][0-9]"
"""What a time of day contains in any form. A column of it is that of the time, also where its form is refused."""
_TITLES = ("time", "timestamp", "t", "date")


def time_rules_of_page() -> dict[str, Any]:
    """Return the rules by which recording.js, of the page that flies, reads times of day."""
    return {
        "pattern": CLOCK,
        "like": LIKE,
        "between": BETWEEN,
        "days": DAYS,
        "how": HOW,
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
    words = {title: meanings(words_in(title)) for title in titles}
    below, found = dict(zip(titles, cells, strict=True)), dict[str, str]()
    if not any(map(KnownColumns({"time": TIME}).has, titles)):
        times = (own for own in words if {*_TITLES} & {*words[own]} and re.search(LIKE, below[own]))
        found |= dict.fromkeys(sorted(times, key=lambda own: words[own] != ["time"])[:1], "time [s]")
    if not any(map(KnownColumns({"date": DATE}).has, titles)):
        dates = [
            own for own in words if own not in found and "date" in words[own] and isfinite(_day(_rest(below[own])))
        ]
        found |= dict.fromkeys(dates[:1], "date")
    return found


def times_of_day(table: Columns) -> Array | None:
    """Return the times of a table whose column `time` has times of day, s; None for another one.

    They count since 1970, or, where no date is told, since the first midnight. NaN stands for a cell that is none, and
    for one with more than a date beside the time: 1:00:00 PM is not at 1 o'clock.
    """
    if 2 * len(table.unread["time"]) <= np.count_nonzero(np.isfinite(table.values["time"])):
        return None
    clock, days = np.full((2, len(table.lines)), nan)
    for row, cells in enumerate(table.rows()):
        match, beside = _FIND.search(cells["time"]), _rest(cells["time"])
        if match and (not beside or isfinite(_day(beside))):
            minutes, seconds = map(float, match[2].split(":")[1:])
            decimals = float(f"0.{match[3][1:]}") if match[3] else 0.0
            clock[row] = 3600.0 * float(match[1]) + 60.0 * minutes + seconds + decimals
            days[row] = _day(beside or _rest(cells.get("date", "")))
    there = np.isfinite(clock)
    if not there.any():
        return None
    goes_on = np.unwrap(clock[there] % _DAY, period=_DAY) if clock[there].max() < _DAY else clock[there]
    own = days[there]
    is_dated = np.isfinite(own).all()
    is_apart = np.any((np.diff(own) == 0.0) & (np.diff(clock[there]) < -0.5 * _DAY))  # the date is that of the start
    clock[there] = _DAY * own + clock[there] if is_dated and not is_apart else goes_on + _DAY * np.nan_to_num(own[0])
    return clock


def _rest(text: str) -> str:
    """Return the text without a time of day: the date, or nothing."""
    return re.sub(BETWEEN, "", " ".join(_FIND.sub(" ", text).split()))


@cache
def _day(text: str) -> float:
    """Return the number of days since 1970 of a date; NaN for another text."""
    for form in DAYS:
        with suppress(ValueError):
            return float(datetime.strptime(text, form).toordinal() - _EPOCH)
    return nan
