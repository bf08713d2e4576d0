"""Where a vehicle rests against something in depth: the surface, the bottom, a deck, or a hand.

Its motion there does not follow from thrust, drag and weight, so these times are left out before a fit. Mostly a
contradiction tells them: the vehicle hardly moves by a command that moves it elsewhere. Nothing else is assumed about
the vehicle than that an equal command, held for long enough, gives about an equal velocity.

"Elsewhere" is at another depth. A right dive has no such contradiction: of 57 logs that were tried, the rule touches
none, and with 2.5 s for _LEAST it would touch one. Horizontal rests cannot be told so: a current that turns with the
heading stops a vehicle, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.equation.layout import Layout
from rov_fmu.io.messages import MOST, first_of
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.columns import push_along
from rov_fmu.tank.findings import about
from rov_fmu.tank.log import Channel, Commands, Log
from rov_fmu.tank.quality import without_spans

USUAL_HEIGHT = 0.25
"""The height of a vehicle whose base tells none, m. Its depth at the surface is less than this and _BESIDE."""
_STEP, _HALF, _BEFORE = 0.2, 4, 12
"""Motion and commands are compared every so many seconds. A velocity is that over so many steps to either side, and a
command is steady if it was so for so many steps before: 2.4 s, which is more than usual time constants."""
_MEAN = 5
"""A command is the mean of so many steps, because a controller of the depth never holds it."""
_STEADY, _EQUAL = 0.06, 0.04
"""A push is steady if it changes by less than the first number, and two are equal that differ by less than the second
one, relative to the full push."""
_LEAST_PUSH = 0.1
"""A motion against the push is usual only below this push: that of the load."""
_BAND = 0.45
"""A vehicle that rests stays within this distance, m. Elsewhere is twice as far."""
_LEAST = 3.0
"""The least time for which a vehicle rests, s. Shorter contacts hardly count in a fit."""
_SLOW, _AGREES, _ALIKE = 0.45, 0.6, 0.6
"""A velocity contradicts the usual one under an equal push below the first share of it, and agrees with it above the
second one. A velocity is usual if more than the third share of all has half of it."""
_MOST_AGREEING = 1.0 / 3.0
"""The most time with agreeing velocities, relative to that with contradicting ones."""
_BESIDE, _ABOVE, _BELOW, _DEEP = 0.25, 0.35, 0.1, 1.0
"""A depth counts from the surface if the least one is between -_ABOVE and _BELOW, and the largest one exceeds _DEEP, m.
The vehicle is at the surface while its depth is less than its height and _BESIDE. Above -_ABOVE it is in the air."""
_STILL = 0.1
"""The depth of a vehicle on a deck or on the bottom changes by less than this, m."""
_USUAL_RATE = 0.06
"""The least usual rate of the depth, m/s."""
_LEAST_PIECE = 5.0
"""A part of a log between two rests that is shorter than this, s, is left out, too."""


@dataclass(frozen=True, eq=False)
class _Course:
    """The motion along an axis and the command for it, at equal steps of time; n numbers each."""

    time: Array
    place: Array
    """The depth, or the distance by the measured velocity, m."""
    speed: Array
    push: Array
    """Relative to full thrust, with its sign."""
    told: Array
    """The push as the log tells it, and not a mean."""
    steady: Flags
    """True where the push was steady for long enough, and the motion is measured without a gap."""


def without_rests(log: Log, layout: Layout, height: float = USUAL_HEIGHT) -> list[Log]:
    """Return the pieces of a log in which the vehicle rests against nothing, with a finding that says what is left out.

    `layout` tells which thrusters push along which axis, and `height` is that of the vehicle, m.
    """
    if log.axis or not log.commands:
        return [log]
    rests = sorted(_rests(log, log.commands, layout, height))
    spans, words = list[tuple[float, float]](), list[str]()
    first = float(log.commands.rows[0])
    for start, end, why in rests:
        if spans and start <= spans[-1][1]:
            spans[-1] = spans[-1][0], max(end, spans[-1][1])
        else:
            spans.append((start, end))
        words.append(f"from {start - first:.4g} to {end - first:.4g} s ({why})")
    left = sum(end - start for start, end in spans)
    finding = about(log.file, "rests", rests=", ".join(first_of(words, MOST)), left=f"{left:.0f}")
    return (without_spans(log, spans, finding, _LEAST_PIECE) if spans else []) or [log]


def _rests(log: Log, commands: Commands, layout: Layout, height: float) -> Iterator[tuple[float, float, str]]:
    """Yield the start and the end of each rest, s, and against what it is in words."""
    for channel in log.shown:
        if channel.quantity.axis is HEAVE and layout.has(HEAVE) and channel.count and not channel.quantity.is_velocity:
            yield from _vertical(_course(channel, commands, push_along(layout, HEAVE, commands.in_rows)), height)


def _vertical(course: _Course, height: float) -> Iterator[tuple[float, float, str]]:
    """Yield the rests at the surface or on a deck, and those elsewhere."""
    time, depth, free = course.time, course.place, np.ones(len(course.time), bool)
    if not len(time):
        return
    least, largest = float(depth.min()), float(depth.max())
    begins, ends = (_is_still(depth[::side], least) for side in (1, -1))
    from_surface = largest > _DEEP and least < _BELOW and (least > -_ABOVE or begins or ends)
    for start, end in _runs(depth < height + _BESIDE) if from_surface else ():
        if (end - start) * _STEP > _LEAST:
            in_air = float(depth[start : end + 1].min()) < -_ABOVE
            first = _moved_by_hand(course.told, start, -1) if in_air else start
            last = _moved_by_hand(course.told, end, 1)
            free[first : last + 1] = False
            yield float(time[first]), float(time[last]), "on deck" if in_air else "at the surface"
    for start, end in _contradicting(course, free):
        where = f"at a depth of {np.median(depth[start : end + 1]):.3g} m"
        yield float(time[start]), float(time[end]), f"{where}, hardly moving by a push that moves it elsewhere"


def _is_still(depth: Array, least: float) -> bool:
    """Return True if a vehicle begins with a rest at the least depth."""
    first = depth[: int(_LEAST / _STEP)]
    return bool(np.ptp(first) < _STILL and first.min() < least + _STILL)


def _moved_by_hand(told: Array, at: int, side: int) -> int:
    """Return until when a vehicle that left the surface or a deck without a command is lowered by hand or by a crane:
    until the vertical command changes. With -1 for `side`, since when it is lifted."""
    later = told[at::side]
    before = told[::-side][len(told) - 1 - at if side > 0 else at :][: int(_LEAST / _STEP)]
    if abs(later[0]) > _LEAST_PUSH or np.ptp(before) > 0.0:
        return at
    changes = np.flatnonzero(later != later[0])
    return at + side * int(changes[0] if len(changes) else len(later) - 1)


def _course(channel: Channel, commands: Commands, push: Array) -> _Course:
    """Return the motion that a channel shows beside the push of some commands in their rows."""
    times, values = channel.samples
    time = np.arange(times[0], times[-1], _STEP)
    count, size = len(time), 2 * _HALF + 1
    measured, rates = np.interp(time, times, values), np.zeros(count)
    told = push[np.maximum(np.searchsorted(commands.rows, time, side="right") - 1, 0)]
    mean = sliding_window_view(np.pad(told, _MEAN // 2, mode="edge"), _MEAN).mean(1) if count else told
    steady = np.zeros(count, bool)
    if count > size:
        window = sliding_window_view(measured, size)
        steps = _STEP * np.arange(-_HALF, _HALF + 1)
        weights = np.full(size, 1.0 / size) if channel.quantity.is_velocity else steps / (steps @ steps)
        rates[_HALF:-_HALF] = window @ weights
        held = sliding_window_view(np.pad(mean, (_BEFORE, _HALF), mode="edge"), _BEFORE + _HALF + 1)
        gap = np.diff(times, prepend=times[0])[np.minimum(np.searchsorted(times, time), len(times) - 1)]
        steady = (held.max(1) - held.min(1) < _STEADY) & (gap < _HALF * _STEP)
        steady[:_HALF] = steady[-_HALF:] = False
    place = np.cumsum(rates) * _STEP if channel.quantity.is_velocity else measured
    return _Course(time, place, rates, mean, told, steady)


def _contradicting(course: _Course, free: Flags) -> Iterator[tuple[int, int]]:
    """Yield the first and the last step of each stay where equal pushes move the vehicle less than elsewhere.

    Only `free` steps are compared. Where equal pushes elsewhere tell nothing, weaker ones in the same direction do: the
    stronger one must move the vehicle, too. Where a vehicle has rested on the bottom, it touches it whenever it comes
    so deep again.
    """
    place, apart = course.place, 2.0 * _BAND
    at = np.flatnonzero(course.steady & free)
    push, speed, there = course.push[at], course.speed[at], place[at]
    cells = np.column_stack([np.round(push / (0.5 * _EQUAL)), np.round(there / (0.2 * apart))])
    cells, cell = np.unique(cells, axis=0, return_inverse=True)
    shares = np.full(len(course.time), np.nan)  # speeds relative to the usual ones
    for n in range(len(cells)):
        own = np.flatnonzero(cell.ravel() == n)
        p, away = float(push[own].mean()), np.abs(there - there[own].mean()) > apart
        equal = away & (np.abs(push - p) < _EQUAL)
        weaker = away & (push * np.sign(p) > _LEAST_PUSH) & (np.abs(push) < abs(p))
        for some in (equal, weaker):
            middle = float(np.median(speed[some])) if np.sum(some) * _STEP > 1.0 else 0.0
            is_usual = abs(middle) > _USUAL_RATE and np.mean(speed[some] / middle > 0.5) > _ALIKE
            if is_usual and (middle * p > 0.0 or abs(p) < _LEAST_PUSH):
                shares[at[own]] = speed[own] / middle
                break
    slow = shares < _SLOW
    stays, anchor = np.zeros(len(slow), bool), np.inf
    for n in np.flatnonzero(slow).tolist():
        if not stays[n] or abs(course.place[n] - anchor) > _STILL:
            anchor = course.place[n]
            left = np.flatnonzero(np.abs(course.place - anchor) >= _BAND)
            k = int(np.searchsorted(left, n))
            stays[left[k - 1] + 1 if k else 0 : left[k] if k < len(left) else None] = True
    for start, end in _runs(stays):
        contradicting = _STEP * np.sum(slow[start : end + 1])
        agreeing = _STEP * np.sum(shares[start : end + 1] > _AGREES)
        stays[start : end + 1] = contradicting >= _LEAST and agreeing < _MOST_AGREEING * contradicting
    for start, end in _runs(stays):
        if (bottom := float(np.median(place[start : end + 1]))) > place.max() - _STILL:
            for first, last in _runs(np.abs(place - bottom) < _BAND):
                stays[first : last + 1] |= np.any(np.abs(place[first : last + 1] - bottom) < _STILL)
    yield from _runs(stays)


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of true values."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return [(int(start), int(end) - 1) for start, end in edges.reshape(-1, 2)]
