"""Where a vehicle rests against something: the surface, the bottom, a deck, a wall, or a hand.

Its motion there does not follow from thrust, drag and weight, so these times are left out before a fit. A contradiction
tells them: the push would move the vehicle, and it does not move so. What a push does is learnt from the log itself,
along heave from the depth, and along surge and sway from a measured velocity, whose integral is the way. The
acceleration is a c|c| - b w|w| - d w + e, with the command c and the rate w, and another a astern, which would be taken
for a load. In heave, e is the load. In surge and sway it is what a current does by the heading, and the coupling with
the turn.

Horizontally, a vehicle must stand still. Something that slides along an oblique wall is not told, and no wall is where
nothing measures a velocity.

At the beginning or the end of a log, thrusters that are off contradict their commands, too. A surface stops only a push
up, and a bottom only one down: other pushes without an answer count against a rest there, except in air. Where a push
moves the vehicle, there is water. A sensor that takes all above it for the surface looks like a rest at the surface.

A right dive has no such contradiction: of 165 logs that were tried, among them four flights of the real ArduSub, only
the two of a dive from the surface and of a test on deck are touched, and of 400 drawn ones none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.io.messages import MOST, first_of, listed
from rov_fmu.tank.arrays import Array, Flags, Indices, true_runs, usual_range
from rov_fmu.tank.clocks import held
from rov_fmu.tank.columns import push_along
from rov_fmu.tank.findings import about
from rov_fmu.tank.log import Channel, Commands, Log
from rov_fmu.tank.quality import without_spans

USUAL_HEIGHT = 0.25
"""The height of a vehicle whose base tells none, m. In air, it is above the surface by more than one."""
_NEAR, _STILL = 2.0, 0.4
"""A vehicle that rests stays within the first number of heights, and touches again within the second one: it tilts, the
surface has waves, and a bottom is not level."""
_STEP, _HALF = 0.2, 4
"""Motion and push are compared every so many seconds, over so many steps to either side: a second derivative of a depth
with noise of 1 cm is then known to 0.03 m/s^2."""
_MOVES = 0.1
"""The push of a log is learnt where the rate exceeds this share of a large one: rests would spoil it."""
_SIGNIFICANT, _LEAST_STEPS = 3.0, 40
"""An acceleration that a push should give counts above so many standard errors, and is learnt from so many steps."""
_SLOW = 0.3
"""The motion contradicts the push where it shows less than this share of that acceleration, and else agrees with it."""
_STANDS = 0.1
"""A vehicle stands still along surge or sway where drag takes less than this share of the push."""
_LEAST, _LEAST_HORIZONTAL = 1.2, 3.0
"""The least time of contradiction in a rest in heave, and in surge or sway, s. Of the right dives, none has 1.2 s in
heave. A DVL without lock shows 0 for about 3 s, and 2 s along surge would cost a right dive with a stale one 23 s."""
_IDLE, _FLOATS, _AVERAGED = 0.03, 0.5, 1.0
"""Without a push: the largest command, how far the load must be able to move a vehicle that is free, m, and the time
over which a depth is averaged, s."""
_ROUNDS = 30
"""How often the samples are weighed anew by their errors."""
_LEAST_PIECE = 5.0
"""A part of a log between two rests that is shorter than this, s, is left out, too."""


def without_rests(log: Log, layout: Layout, height: float = USUAL_HEIGHT) -> list[Log]:
    """Return the pieces of a log in which the vehicle rests against nothing, with a finding that says what is left out.

    `layout` tells which thrusters push along which axis, and `height` is that of the vehicle, m.
    """
    if log.axis or not log.commands:
        return [log]
    rests = list[tuple[float, float, str]]()
    for axis in (SURGE, SWAY, HEAVE):
        shown = (c for c in log.shown if c.quantity.axis is axis and c.quantity.is_velocity is (axis is not HEAVE))
        for channel in shown if layout.has(axis) else ():
            if channel.count:
                rests += _rests(_course(log, log.commands, channel, axis, layout), axis, height)
    spans, against = list[tuple[float, float]](), list[dict[str, None]]()
    for start, end, where in sorted(rests):
        if spans and start < spans[-1][1] + _LEAST_PIECE:
            spans[-1] = spans[-1][0], max(end, spans[-1][1])
        else:
            spans.append((start, end))
            against.append({})
        against[-1][where] = None
    words = [
        f"from {start - log.begin:.4g} to {end - log.begin:.4g} s ({listed(where)})"
        for (start, end), where in zip(spans, against, strict=True)
    ]
    left = sum(end - start for start, end in spans)
    finding = about(log.file, "rests", rests=", ".join(first_of(words, MOST)), left=f"{left:.0f}")
    return without_spans(log, spans, [finding], _LEAST_PIECE) or [log]


@dataclass(frozen=True, eq=False)
class _Course:
    """The motion along an axis in n equal steps of time, and what it would be by the push."""

    time: Array
    """n: s."""
    place: Array
    """n: the depth, or the way ahead or to starboard, m."""
    push: Array
    """n: the command along the axis."""
    given: Array
    """n: the acceleration by the push and what else acts on a vehicle at rest, m/s^2; NaN where it is not known."""
    share: Array
    """n: how much of it the motion shows; NaN where this acceleration is not significant."""
    drag: Array
    """n: the share of it that overcomes drag."""
    law: tuple[float, float, float]
    """The acceleration of a vehicle at rest without a push, m/s^2, 0 if it is not significant, and what the quadratic
    and the linear drag take of it."""


def _course(log: Log, commands: Commands, channel: Channel, axis: Axis, layout: Layout) -> _Course:
    """Return the motion that a channel shows."""
    times, values = channel.samples
    if channel.quantity.is_velocity:
        values = np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(times)))
    time = np.arange(times[0], times[-1], _STEP)
    others = [np.ones(len(time))]
    shown = {(c.quantity.axis, c.quantity.is_velocity): np.interp(time, *c.samples) for c in log.shown if c.count}
    heading = shown.get((YAW, False))
    if axis is not HEAVE and heading is not None:
        others = [np.cos(heading), np.sin(heading)]
        across = shown.get((SWAY if axis is SURGE else SURGE, True))
        if across is not None and len(time) > 1:
            others.append(np.gradient(heading, _STEP) * across)
    in_rows = commands.in_rows
    forces = {name: c if layout.has_wrench else c * np.abs(c) for name, c in in_rows.items()}
    thrusts = [
        push_along(layout, axis, {n: bound(f, 0.0) for n, f in forces.items()}) for bound in (np.maximum, np.minimum)
    ]
    place = np.interp(time, times, values)
    push = held(commands.rows, push_along(layout, axis, in_rows), time)
    return _Course(time, place, push, *_shares(time, place, commands.rows, thrusts, times, others))


def _rests(course: _Course, axis: Axis, height: float) -> Iterator[tuple[float, float, str]]:
    """Yield the start and the end of each rest, s, and against what it is in words."""
    time, place, push, given = course.time, course.place, course.push, course.given
    is_depth, near, still = axis is HEAVE, _NEAR * height, _STILL * height
    agrees = course.share > _SLOW
    slow = (course.share < _SLOW) & (is_depth | (np.abs(course.drag) < _STANDS))
    for start, end in true_runs(slow):  # shorter ones come from pushes that change within a window
        slow[start : end + 1] = end - start >= _HALF // 2
    least = _LEAST if is_depth else _LEAST_HORIZONTAL
    top = float(place[agrees].min(initial=np.inf))  # above, no push moves it

    def side_of(at: float) -> int:
        """Return 1 at the surface, below which a vehicle is free, -1 at the bottom, and 0 between."""
        return is_depth * (1 if at < min(near, top + height) else -1 if at > place.max() - height else 0)

    def in_air(at: float) -> bool:
        return is_depth and at < min(-height, top)

    rests = np.zeros(len(time), bool)

    def leave_out(start: int, end: int, own: Indices) -> None:
        """Leave out a stay from the last agreement of motion and push before some steps of it to the first one after
        them."""
        free = start + np.flatnonzero(agrees[start : end + 1])
        before, after = free[free < own[0]], free[free > own[-1]]
        rests[before[-1] if len(before) else start : after[0] + 1 if len(after) else end + 1] = True

    for start, end in true_runs(_stays(place, slow, near, still)):
        own, free = (start + np.flatnonzero(some[start : end + 1]) for some in (slow, agrees))
        at = float(np.median(place[own]))
        is_between = agrees[: own[0]].any() and agrees[own[-1] :].any()
        away = 0 if is_between or in_air(at) else np.sum(given[own] * side_of(at) >= 0.0)
        count = len(own) - away
        if count * _STEP >= least and count > away + np.sum(np.abs(place[free] - at) < still):
            leave_out(start, end, own)
    if is_depth:
        rests |= _unpushed(course, still)
    for start, end in true_runs(rests):  # nothing that dives is above the surface, or below a bottom
        side = side_of(at := float(np.median(place[start : end + 1])))
        for first, last in true_runs(side * (place - at) < near) if side else ():
            touching = first + np.flatnonzero(side * (place[first : last + 1] - at) < still)
            if len(touching):
                leave_out(first, last, touching)
    for start, end in true_runs(rests):
        if in_air(float(np.median(place[start : end + 1]))):
            rests[_moved_by_hand(push, start, -1) : _moved_by_hand(push, end, 1) + 1] = True
    for start, end in true_runs(rests):
        at = float(np.median(place[start : end + 1]))
        where = f"at a depth of {at:.3g} m" if is_depth else f"no motion in {axis.name}"
        where = "on deck" if in_air(at) else "at the surface" if is_depth and at < near else where
        yield float(time[start]), float(time[end]), where


def _stays(place: Array, slow: Flags, near: float, still: float) -> Flags:
    """Return when the vehicle is within `near`, m, of a place where its motion contradicts the push, from when it comes
    there until it leaves. Places that are closer than `still`, m, are one."""
    stays, anchor = np.zeros(len(place), bool), np.inf
    for n in np.flatnonzero(slow).tolist():
        if not stays[n] or abs(place[n] - anchor) > still:
            anchor = float(place[n])
            left = np.flatnonzero(np.abs(place - anchor) >= near)
            k = int(np.searchsorted(left, n))
            stays[left[k - 1] + 1 if k else 0 : left[k] if k < len(left) else None] = True
    return stays


def _shares(
    time: Array, place: Array, rows: Array, thrusts: Sequence[Array], times: Array, others: Sequence[Array]
) -> tuple[Array, Array, Array, tuple[float, float, float]]:
    """Return the acceleration that the push and others give a vehicle at rest, m/s^2, how much of it the motion shows,
    and the share that overcomes drag, at equal steps of time; then the law without a push, as `_Course` has it.

    All numbers are means over the same window, with the weights that a second derivative has in it.
    """
    count, size = len(time), 2 * _HALF + 1
    given, share, drag = np.full((3, count), np.nan)
    if count <= size:
        return given, share, drag, (0.0, 0.0, 0.0)
    steps = _STEP * np.arange(-_HALF, _HALF + 1)
    curve, weights = steps**2 - np.mean(steps**2), (1.0 - (steps / (steps[-1] + _STEP)) ** 2) ** 2
    windows = sliding_window_view(place, size)
    rate, acceleration = windows @ steps / (steps @ steps), 2.0 * windows @ curve / (curve @ curve)
    inside = np.append(rows, rows[-1] + 1.0)
    acting = []
    for thrust in thrusts:
        impulse = np.append(0.0, np.cumsum(thrust * np.diff(inside)))  # its integral is exact between rows
        ends = np.interp(np.append(time - 0.5 * _STEP, time[-1] + 0.5 * _STEP), inside, impulse)
        acting.append(np.diff(ends) / _STEP)
    acting = [sliding_window_view(one, size) @ (weights / weights.sum()) for one in (*acting, *others)]
    gap = np.diff(times, prepend=times[0])[np.minimum(np.searchsorted(times, time), len(times) - 1)]
    known = (gap < _HALF * _STEP)[_HALF:-_HALF]
    causes = np.column_stack([*acting, -rate * np.abs(rate), -rate])
    _, large = usual_range(np.abs(rate))
    if np.sum(moving := known & (np.abs(rate) > _MOVES * large)) < _LEAST_STEPS:
        return given, share, drag, (0.0, 0.0, 0.0)
    some, shown = causes[moving], acceleration[moving]
    weight = np.ones(len(some))
    for _ in range(_ROUNDS):  # towards the least sum of absolute errors, which a rest among the samples hardly moves
        found, *_ = np.linalg.lstsq(some * np.sqrt(weight)[:, None], shown * np.sqrt(weight), rcond=None)
        errors = np.abs(shown - some @ found)
        noise = max(1.4826 * float(np.median(errors)), 1e-6)
        weight = 1.0 / np.maximum(errors / noise, 0.5)
    spread = np.linalg.pinv((some * weight[:, None]).T @ some) * size * weight.mean()  # neighbours share their samples
    error = noise * np.sqrt(1.0 + np.einsum("ni,ij,nj->n", causes, spread, causes))
    push, slowed = causes[:, :-2] @ found[:-2], causes[:, -2:] @ found[-2:]
    given[_HALF:-_HALF] = push
    is_told = known & (np.abs(push) > _SIGNIFICANT * error)
    share[_HALF:-_HALF][is_told] = ((acceleration - slowed) / push)[is_told]
    drag[_HALF:-_HALF][is_told] = (slowed / push)[is_told]
    is_loaded = abs(found[2]) > _SIGNIFICANT * noise * np.sqrt(spread[2, 2])
    load, square, linear = (float(one) for one in found[[2, -2, -1]])
    return given, share, drag, (load * is_loaded, max(square, 0.0), max(linear, 0.0))


def _unpushed(course: _Course, still: float) -> Flags:
    """Return when a vehicle that its load moves stays at the least or the largest depth of the log without a push, for
    so long that the load alone would have moved it far if it were free."""
    load, square, linear = course.law
    place, found = course.place, np.zeros(len(course.time), bool)
    if not load:
        return found
    steady = 2.0 * abs(load) / (linear + np.sqrt(linear**2 + 4.0 * square * abs(load)) or 1e-9)
    width = round(_AVERAGED / _STEP)
    mean = np.convolve(np.pad(place, width, mode="edge"), np.ones(width) / width, mode="same")[width:-width]
    stays = (np.abs(course.push) < _IDLE) & (np.abs(np.gradient(mean, _STEP)) < max(_SLOW * steady, 0.01))
    for start, end in true_runs(stays):
        rate = way = 0.0
        for _ in range(start, end):
            rate += _STEP * (abs(load) - square * rate * rate - linear * rate)
            way += _STEP * rate
        if way > _FLOATS and np.ptp(place[start : end + 1]) < _SLOW * way:
            found[start : end + 1] = True
    dived = place[~found & (place > -still)]
    least, largest = float(dived.min(initial=np.inf)), float(dived.max(initial=-np.inf))
    for start, end in true_runs(found):
        at = float(np.median(place[start : end + 1]))
        if least + still < at < largest - still:
            found[start : end + 1] = False
        elif (load < 0.0) == (at > 0.5 * (least + largest)):  # something else brought it there, against the load
            found[_moved_by_hand(course.push, start, -1) : start] = True
    return found


def _moved_by_hand(told: Array, at: int, side: int) -> int:
    """Return until when a vehicle that left a deck is lowered by hand or by a crane: until its command changes.
    With -1 for `side`, since when it is lifted, or brought to where it rests."""
    changes = np.flatnonzero(told[at::side] != told[at])
    return at + side * int(changes[0]) if len(changes) else at
