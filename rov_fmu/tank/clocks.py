"""Clocks: where a clock restarted, the times of messages without one, and the values that hold at a time."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rov_fmu.tank.arrays import Array, true_runs

Name = TypeVar("Name")
Number = TypeVar("Number", bound=np.generic)

LEAST_AFTER = 10
"""The least number of messages in a row after a restart. Fewer messages are only out of order."""
AGAIN = 0.5
"""The least number of earlier messages that have times in the range of these messages, as a share of their number."""
_FAR, _INTERVALS = 3600.0, 1000.0
"""A time is far from another one if both this time, s, and this many usual intervals are between them."""
_OTHER_CLOCK = 1.0
"""If the times of messages and of their arrival differ by more than this, they come from different clocks, s."""
LATE = 1.0
"""A command begins late if its first value comes later after that of another one, s."""
_LEAST_GAP, _GAP_INTERVALS = 1.0, 10.0
"""A gap is longer than this time, s, and than this many usual intervals."""


def restarts(stamps: Iterable[Array]) -> list[float]:
    """Return the arrival times from which clocks restart, s, ascending.

    `stamps` has n x 2 times of each topic: of the message, and of its arrival, in the order of arrival. A restart is
    between two messages of each topic that shows it, and what several topics show at once is one restart.
    """
    intervals = []
    for pairs in stamps:
        stamp, arrival = pairs[np.isfinite(pairs).all(axis=1)].T
        intervals += [(float(arrival[row]), float(arrival[row - 1])) for row in restart_rows(stamp)]
    times: list[float] = []
    for last, first in sorted(intervals):
        if not times or first > times[-1]:
            times.append(last)
    return times


def restart_rows(time: Array) -> list[int]:
    """Return the rows from which times go on that are earlier than those before.

    Messages that only arrived late fill a gap between earlier ones. After a restart, times occur a second time, or are
    all earlier than before. `restarts` of fmu_src/live/recording.js must do the same.
    """
    if not len(time):
        return []
    goes_on = np.append(False, (time < np.maximum.accumulate(time))[1:] & (np.diff(time) >= 0.0))
    for first, end in true_runs(goes_on):
        start = first - 1  # this row goes back, the others go on
        before, last, count = time[:start], time[end], end - start + 1
        again = ((before >= time[start]) & (before <= last)).sum() >= AGAIN * count
        if count >= LEAST_AFTER and (again or last < before.min()):
            return [start, *(start + row for row in restart_rows(time[start:]))]
    return []


def parts_of_clock(time: Array) -> NDArray[np.intp]:
    """Return the number of the part of a log to which each time belongs, in the order of time.

    Parts are far from each other: a clock was set between them, or the log was interrupted. A few times that are far
    from all others, as one with a flipped bit, belong to none, and have -1. So have NaN and infinite times.
    """
    known = np.where(np.isfinite(time), time, np.nan)
    order = np.argsort(known)  # NaN comes last
    steps = np.diff(known[order])
    usual = float(np.median(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 0.0
    part = np.cumsum(np.append(0, steps > max(_FAR, _INTERVALS * usual)))[: len(time)]
    size = np.bincount(part, np.isfinite(known[order]))
    is_kept = size >= min(LEAST_AFTER, size.max(initial=1.0))
    number = np.empty(len(time), np.intp)
    number[order] = np.where(is_kept, np.cumsum(is_kept) - 1, -1)[part]
    number[np.isnan(known)] = -1
    return number


def first_in_each(time: Array, rate: float, begin: float | None = None) -> NDArray[np.intp]:
    """Return the first row in each interval that has rows, of a number of intervals per second (1/s). The first one
    begins at `begin`, or else at the first row; `time` ascends.

    The work grows with the rows, and not with the time between them, which a clock that is set can make a century.
    """
    if not len(time):
        return np.empty(0, np.intp)
    number = np.floor((time - (time[0] if begin is None else begin)) * rate + 1e-6)
    return np.append(0, np.flatnonzero(np.diff(number)) + 1)


def usual_delay(pairs: Array) -> float:
    """Return the median time from a message to its arrival, s, from n x 2 times of both.

    It is 0 where the two have the same clock, which is not that of a simulation.
    """
    delays = pairs[:, 1] - pairs[:, 0]
    delay = float(np.median(delays[np.isfinite(delays)])) if np.isfinite(delays).any() else 0.0
    return delay if abs(delay) > _OTHER_CLOCK else 0.0


def gaps(time: Array, values: Array) -> list[tuple[float, float]]:
    """Return the last time before each gap in the measurements and the first time after it, s.

    A gap is longer than 1 s and than ten usual intervals between two measurements.
    """
    at = time[np.isfinite(values)]
    intervals = np.diff(at)
    if not len(intervals):
        return []
    (before,) = np.nonzero(intervals > max(_LEAST_GAP, _GAP_INTERVALS * float(np.median(intervals))))
    return [(float(at[n]), float(at[n + 1])) for n in before]


def ascending(time: Array, *values: Array) -> tuple[Array, ...]:
    """Return times in order, and the values with them; the last finite value counts where a time is repeated."""
    times, inverse = np.unique(time, return_inverse=True)
    merged = np.full((len(values), len(times)), np.nan)
    for row, column in zip(merged, values, strict=True):
        there = np.isfinite(column)
        row[inverse[there]] = column[there]
    return times, *merged


def held(time: Array, values: NDArray[Number], at: Array) -> NDArray[Number]:
    """Return the values that hold at some times, each until the next one. The first one holds before it, too."""
    if np.array_equal(time, at):
        return values
    return values[np.maximum(np.searchsorted(time, at, side="right") - 1, 0)]


def in_rows(series: Mapping[Name, tuple[Array, Array]]) -> tuple[Array, dict[Name, Array]]:
    """Return the times of all series, from the first one at which each has a value, and the values that hold then.

    A series that begins more than a second after the first one is 0 until then.
    """
    begins = {name: float(time[0]) for name, (time, _) in series.items()}
    late = min(begins.values()) + LATE
    clocks = {id(time): time for time, _ in series.values()}  # the columns of a table share one array of times
    rows = np.unique(np.concatenate([*clocks.values()]))
    rows = rows[rows >= max(begin for begin in begins.values() if begin <= late)]
    values = {name: held(time, numbers, rows) for name, (time, numbers) in series.items()}
    return rows, {
        name: np.where(rows < begins[name], 0.0, own) if begins[name] > late else own for name, own in values.items()
    }
