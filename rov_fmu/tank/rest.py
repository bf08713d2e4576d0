"""Where a vehicle rests against something in depth: the surface, the bottom, a deck, or a hand.

Its motion there does not follow from thrust, drag and weight, so these times are left out before a fit. A contradiction
tells them: the push would move the vehicle, and it does not move so. What a push does is learnt from the log itself,
where the depth changes: the acceleration is a c|c| - b w|w| - d w + e, with the command c and the rate w of the depth.

At the beginning or the end of a log, thrusters that are off contradict their commands, too. A surface stops only a push
up, and a bottom only one down: other pushes without an answer count against a rest there, except in air.

A right dive has no such contradiction: of 46 logs with a depth that were tried, among them four flights of the real
ArduSub, none is touched. Horizontal rests cannot be told so: a current that turns with the heading stops a vehicle,
too.
"""

from collections.abc import Iterator

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
"""The height of a vehicle whose base tells none, m. One that rests stays within two heights, and in air it is above the
surface by more than one."""
_STEP, _HALF = 0.2, 4
"""Motion and push are compared every so many seconds, over so many steps to either side."""
_MOVES, _STILL = 0.05, 0.1
"""The push of a log is learnt where the rate of the depth exceeds the first number, m/s. A vehicle touches again where
its depth differs by less than the second one, m."""
_SIGNIFICANT, _LEAST_STEPS = 3.0, 40
"""An acceleration that a push should give counts above so many standard errors, and is learnt from so many steps."""
_SLOW, _AGREES = 0.3, 0.6
"""The motion contradicts the push where it shows less than the first share of that acceleration, and agrees with it
above the second one."""
_LEAST_PUSH = 0.1
"""The command, as a share of the full one, with which a vehicle leaves a deck by itself."""
_LEAST = 1.0
"""The least time of contradiction in a rest, s: of the right dives, none has 0.8 s. Shorter contacts hardly count."""
_ROUNDS = 30
"""How often the samples are weighed anew by their errors."""
_LEAST_PIECE = 5.0
"""A part of a log between two rests that is shorter than this, s, is left out, too."""


def without_rests(log: Log, layout: Layout, height: float = USUAL_HEIGHT) -> list[Log]:
    """Return the pieces of a log in which the vehicle rests against nothing, with a finding that says what is left out.

    `layout` tells which thrusters push along which axis, and `height` is that of the vehicle, m.
    """
    if log.axis or not log.commands or not layout.has(HEAVE):
        return [log]
    depths = [c for c in log.shown if c.quantity.axis is HEAVE and c.count and not c.quantity.is_velocity]
    rests = [rest for channel in depths for rest in _rests(channel, log.commands, layout, height)]
    spans, words = list[tuple[float, float]](), list[str]()
    first = float(log.commands.rows[0])
    for start, end, why in sorted(rests):
        spans.append((start, end))
        words.append(f"from {start - first:.4g} to {end - first:.4g} s ({why})")
    left = sum(end - start for start, end in spans)
    finding = about(log.file, "rests", rests=", ".join(first_of(words, MOST)), left=f"{left:.0f}")
    return (without_spans(log, spans, finding, _LEAST_PIECE) if spans else []) or [log]


def _rests(depth: Channel, commands: Commands, layout: Layout, height: float) -> Iterator[tuple[float, float, str]]:
    """Yield the start and the end of each rest, s, and against what it is in words."""
    times, values = depth.samples
    time = np.arange(times[0], times[-1], _STEP)
    place = np.interp(time, times, values)
    push = push_along(layout, HEAVE, commands.in_rows)
    shares, given = _shares(time, place, commands.rows, push, times)
    near, slow, agrees = 2.0 * height, shares < _SLOW, shares > _AGREES
    for start, end in _runs(slow):  # shorter ones come from pushes that change within a window
        slow[start : end + 1] = end - start >= _HALF // 2
    stays = _stays(place, slow, near)

    def side_of(at: float) -> float:
        """Return 1 at the surface, below which a vehicle is free, -1 at the bottom, and 0 between."""
        return 1.0 if at < near else -1.0 if at > place.max() - height else 0.0

    rests = np.zeros(len(time), bool)
    for start, end in _runs(stays):
        own, free = start + np.flatnonzero(slow[start : end + 1]), start + np.flatnonzero(agrees[start : end + 1])
        at = float(np.median(place[own]))
        is_between = agrees[: own[0]].any() and agrees[own[-1] :].any()
        away = 0 if is_between or at < -height else np.sum(given[own] * side_of(at) >= 0.0)
        if (len(own) - away) * _STEP >= _LEAST and len(own) - away > len(free) + away:
            first, last = free[free < own[0]], free[free > own[-1]]
            rests[first[-1] + 1 if len(first) else start : last[0] if len(last) else end + 1] = True
    told = push[np.maximum(np.searchsorted(commands.rows, time, side="right") - 1, 0)]
    for start, end in _runs(rests):  # nothing that dives is above the surface, or below a bottom
        side = side_of(at := float(np.median(place[start : end + 1])))
        for first, last in _runs(side * (place - at) < near) if side else ():
            rests[first : last + 1] |= bool(np.any(side * (place[first : last + 1] - at) < _STILL))
    for start, end in _runs(rests):
        if np.median(place[start : end + 1]) < -height:
            rests[_moved_by_hand(told, start, -1) : _moved_by_hand(told, end, 1) + 1] = True
    for start, end in _runs(rests):
        at = float(np.median(place[start : end + 1]))
        where = f"at a depth of {at:.3g} m, hardly moving by a push that moves it elsewhere"
        where = "on deck" if at < -height else "at the surface" if at < near else where
        yield float(time[start]), float(time[end]), where


def _stays(place: Array, slow: Flags, near: float) -> Flags:
    """Return when the vehicle is within a distance, m, of a place where its motion contradicts the push, from when it
    comes there until it leaves."""
    stays, anchor = np.zeros(len(place), bool), np.inf
    for n in np.flatnonzero(slow).tolist():
        if not stays[n] or abs(place[n] - anchor) > _STILL:
            anchor = float(place[n])
            left = np.flatnonzero(np.abs(place - anchor) >= near)
            k = int(np.searchsorted(left, n))
            stays[left[k - 1] + 1 if k else 0 : left[k] if k < len(left) else None] = True
    return stays


def _shares(time: Array, place: Array, rows: Array, push: Array, times: Array) -> tuple[Array, Array]:
    """Return how much of the acceleration that the push gives elsewhere the motion shows at equal steps of time, and
    this acceleration, m/s^2. The share is NaN where that is not significant, or where the depth is not measured without
    a gap at some `times`, s.

    All numbers are means over the same window, with the weights that a second derivative has in it.
    """
    count, size = len(time), 2 * _HALF + 1
    shares, given = np.full((2, count), np.nan)
    if count <= size:
        return shares, given
    steps = _STEP * np.arange(-_HALF, _HALF + 1)
    curve, weights = steps**2 - np.mean(steps**2), (1.0 - (steps / (steps[-1] + _STEP)) ** 2) ** 2
    windows = sliding_window_view(place, size)
    rate, acceleration = windows @ steps / (steps @ steps), 2.0 * windows @ curve / (curve @ curve)
    inside = np.append(rows, rows[-1] + 1.0)
    impulse = np.append(0.0, np.cumsum(push * np.abs(push) * np.diff(inside)))  # its integral is exact between rows
    ends = np.interp(np.append(time - 0.5 * _STEP, time[-1] + 0.5 * _STEP), inside, impulse)
    thrust = sliding_window_view(np.diff(ends) / _STEP, size) @ (weights / weights.sum())
    gap = np.diff(times, prepend=times[0])[np.minimum(np.searchsorted(times, time), len(times) - 1)]
    known = (gap < _HALF * _STEP)[_HALF:-_HALF]
    causes = np.column_stack([thrust, np.ones_like(rate), -rate * np.abs(rate), -rate])
    if np.sum(moving := known & (np.abs(rate) > _MOVES)) < _LEAST_STEPS:
        return shares, given
    some, shown = causes[moving], acceleration[moving]
    weight = np.ones(len(some))
    for _ in range(_ROUNDS):  # towards the least sum of absolute errors, which a rest among the samples hardly moves
        found, *_ = np.linalg.lstsq(some * np.sqrt(weight)[:, None], shown * np.sqrt(weight), rcond=None)
        errors = np.abs(shown - some @ found)
        noise = max(1.4826 * float(np.median(errors)), 1e-6)
        weight = 1.0 / np.maximum(errors / noise, 0.5)
    spread = np.linalg.pinv((some * weight[:, None]).T @ some) * size * weight.mean()  # neighbours share their samples
    error = noise * np.sqrt(1.0 + np.einsum("ni,ij,nj->n", causes, spread, causes))
    given[_HALF:-_HALF] = causes[:, :2] @ found[:2]
    is_told = known & (np.abs(given[_HALF:-_HALF]) > _SIGNIFICANT * error)
    answer = acceleration - causes[:, 2:] @ found[2:]
    shares[_HALF:-_HALF][is_told] = (answer / given[_HALF:-_HALF])[is_told]
    return shares, given


def _moved_by_hand(told: Array, at: int, side: int) -> int:
    """Return until when a vehicle that left a deck without a push is lowered by hand or by a crane: until the vertical
    command changes. With -1 for `side`, since when it is lifted."""
    changes = np.flatnonzero(told[at::side] != told[at])
    return at + side * int(changes[0]) if len(changes) and abs(told[at]) < _LEAST_PUSH else at


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of true values."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return [(int(start), int(end) - 1) for start, end in edges.reshape(-1, 2)]
