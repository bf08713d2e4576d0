"""Combine commands and measured motion, each with its own times, into a recording of every axis."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from rov_fmu.io.messages import MOST
from rov_fmu.model.layout import PITCH, ROLL, SURGE, SWAY, YAW, Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.recording import CONTEXT, Recording
from rov_fmu.tank.smoothing import velocity, without_spikes

LEAST_SAMPLES = 20
_SAME_COMMAND = 0.005
"""The largest difference of equal commands, as a fraction of the full command: two steps of a pulse of 1 µs."""
_LEAST_CHANGE = 0.02
"""The smallest change of thrust that counts, as a fraction of the full command. Smaller changes are due to a heading or
depth controller, or to rounded pulses."""
_LEAST_GAP, _GAP_INTERVALS = 1.0, 10.0
"""A gap is longer than this time, s, and than this many usual intervals."""
_ROUNDING = 0.01
_TURN = 2.0 * pi + 2.0 * _ROUNDING
"""What rounding may add to the bounds of a wrapped angle, and the width of these bounds, rad."""
_APART = 2.0
"""The time over which changes of a position are compared with a velocity, s."""
_SAME_SCALE, _CLEAR = 0.01, 4.0
"""The scales of two sensors differ if the difference exceeds this share, and this number of standard errors."""
_WRAPPING = (YAW.position, ROLL.position)
_CONTEXT = {ROLL.position: "roll", PITCH.position: "pitch"}
"""The names of roll and pitch among the conditions."""


@dataclass(frozen=True, eq=False)
class Commands:
    """The commands of the thrusters; each is held until the next."""

    time: Array
    """n: s, ascending."""
    thrusters: Mapping[str, Array]
    """n each, by thruster, within ±1."""


@dataclass(frozen=True, eq=False)
class Signal:
    """The measurements of a sensor, in SI units."""

    axis: Axis | None
    """The axis of the motion; None for a condition that is no motion."""
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading, roll angle, pitch angle; without an axis,
    a key of CONTEXT."""
    time: Array
    """n: s, ascending."""
    values: Array
    """n: NaN where there is no measurement; a heading and a roll angle may wrap."""

    def unwrapped(self) -> Array:
        """Return the values without jumps of a full turn; NaN stays NaN."""
        return unwrapped(self.time, self.values) if self.quantity in _WRAPPING else self.values


def recordings_of(
    file: str,
    layout: Layout,
    commands: Commands,
    signals: Iterable[Signal],
    only: Axis | None = None,
    others: Sequence[Signal] = (),
) -> tuple[tuple[Recording, ...], tuple[Finding, ...]]:
    """Return a recording of every useful signal, and a finding for each useless one; `only` selects one axis.

    Signals of other files, and of axes that the vehicle does not have, are only used as conditions of the recordings.
    """
    recordings, findings, signals = [], [], list(signals)
    for axis in [only] if only else [form.axis for form in layout.axes]:
        for signal in main_signals(signals, axis):
            recording = _recording(file, layout, commands, axis, signal, (*signals, *others))
            if useless := why_useless(recording, layout):
                findings.append(useless)
            else:
                recordings.append(recording)
                findings += gaps_of(recording)
                if recording.is_position:
                    findings += _on_scales(file, signal, axis, signals)
    return tuple(recordings), tuple(findings)


def main_signals(signals: Iterable[Signal], axis: Axis) -> list[Signal]:
    """Return the signal of an axis, if there is one: the position, unless only the velocity has enough samples."""
    found = sorted((s for s in signals if s.axis == axis), key=lambda signal: signal.quantity == "velocity")
    return [s for s in found if _count(s) >= LEAST_SAMPLES][:1] or found[-1:]


def why_useless(recording: Recording, layout: Layout) -> Finding | None:
    """Return the finding that says why a recording is useless, or None."""
    found = Finding("", axis=recording.axis.name, file=recording.file, names={"quantity": recording.quantity})
    values = recording.values[np.isfinite(recording.values)]
    if len(values) < LEAST_SAMPLES:
        return replace(found, kind="too few samples", numbers={"count": len(values), "least": LEAST_SAMPLES})
    if np.ptp(values) == 0.0:
        return replace(found, kind="constant motion")
    if not _is_driven(layout, recording.axis, recording.thrusters):
        moved = any(np.ptp(recording.thrusters[t.name]) > _LEAST_CHANGE for t in layout.drivers(recording.axis))
        return replace(found, kind="cancelling thrusters" if moved else "constant push", names={})
    return None


def _on_scales(file: str, position: Signal, axis: Axis, signals: Iterable[Signal]) -> list[Finding]:
    """Return a finding if a position changes by another factor than 1 of what the velocity in the same log says.

    The changes of the position over short times are compared with the integral of the velocity; a constant current is
    allowed for. Logs with roll or pitch are left out, because there the velocity has another direction.
    """
    quantities = {_CONTEXT.get(signal.quantity, signal.quantity) for signal in signals}
    velocities = [s for s in signals if s.axis == axis and s.quantity == "velocity" and _count(s) >= LEAST_SAMPLES]
    if not velocities or {"roll", "pitch"} & quantities:
        return []
    there, measured = np.isfinite(position.values), np.isfinite(velocities[0].values)
    time, values = position.time[there], position.unwrapped()[there]
    at, v = velocities[0].time[measured], velocities[0].values[measured]
    ends = np.arange(max(time[0], at[0]), min(time[-1], at[-1]), _APART)
    rows = np.unique(np.searchsorted(time, ends))
    if len(rows) <= LEAST_SAMPLES:
        return []
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (v[1:] + v[:-1]))])
    A = np.column_stack([np.diff(np.interp(time[rows], at, travelled)), np.diff(time[rows])])
    (scale, _), squares, rank, _ = np.linalg.lstsq(A, np.diff(values[rows]), rcond=None)
    if rank < A.shape[1]:
        return []
    error = np.sqrt(np.linalg.inv(A.T @ A)[0, 0] * squares[0] / (len(A) - 2))
    if abs(scale - 1.0) < max(_SAME_SCALE, _CLEAR * error):
        return []
    names, numbers = {"quantity": position.quantity}, {"factor": float(scale)}
    return [Finding("scales differ", axis.name, file=file, names=names, numbers=numbers)]


def _count(signal: Signal) -> int:
    """Return the number of samples with a measurement."""
    return int(np.isfinite(signal.values).sum())


def _recording(
    file: str, layout: Layout, commands: Commands, axis: Axis, signal: Signal, others: Sequence[Signal]
) -> Recording:
    """Return a recording of an axis at the times of commands and signal.

    The last command holds for the usual time between two commands.
    """
    time = np.union1d(commands.time, signal.time)
    end = commands.time[-1] + (np.median(np.diff(commands.time)) if len(commands.time) > 1 else 0.0)
    time = time[(commands.time[0] <= time) & (time < end)]
    thrusters = dict(commands.thrusters)  # shared by the recordings of a log with one column of time
    if not np.array_equal(time, commands.time):
        held = np.searchsorted(commands.time, time, side="right") - 1
        thrusters = {name: values[held] for name, values in thrusters.items()}
    values = np.full(len(time), np.nan)
    known = np.isin(signal.time, time)
    values[np.searchsorted(time, signal.time[known])] = signal.unwrapped()[known]
    start = time[0] if len(time) else 0.0
    command, beside, context = command_of(layout, axis, thrusters), _beside(time, others), context_at(time, others)
    return Recording(file, axis, signal.quantity, time - start, command, values, thrusters, beside, context)


def _beside(time: Array, signals: Iterable[Signal]) -> dict[str, Array]:
    """Interpolate the smoothed velocities in surge, sway and yaw, and the heading, at the times of a recording."""
    found = {}
    for signal in signals:
        there = np.isfinite(signal.values)
        if not signal.axis or signal.axis not in (SURGE, SWAY, YAW) or there.sum() < LEAST_SAMPLES or not len(time):
            continue
        at, values, is_position = signal.time[there], signal.unwrapped()[there], signal.quantity != "velocity"
        even, rate = velocity(at, without_spikes(values), is_position=is_position)
        found[signal.axis.velocity] = np.interp(time, even, rate)
        if signal.quantity == "heading":
            found["psi"] = np.interp(time, at, values)
    return found


def context_at(time: Array, signals: Iterable[Signal]) -> dict[str, Array]:
    """Interpolate the conditions among the signals at the times of a recording."""
    found = {}
    for signal in signals:
        name, there = _CONTEXT.get(signal.quantity, signal.quantity), np.isfinite(signal.values)
        if name in CONTEXT and there.any() and not (name == "distance" and signal.axis not in (None, SURGE)):
            values = signal.unwrapped()[there]
            found[name] = np.interp(time, signal.time[there], values - values[0] if name == "distance" else values)
    return found


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


def gaps_of(recording: Recording) -> list[Finding]:
    """Return a finding about the gaps in a recording, or none."""
    found = gaps(recording.time, recording.values)
    shown = [f"{end - start:.3g} s from {start:.4g} s on" for start, end in found[:MOST]]
    if more := len(found) - len(shown):
        shown.append(f"{more} more")
    names, numbers = {"gaps": ", ".join(shown)}, {"count": len(found)}
    return [Finding("gaps", recording.axis.name, file=recording.file, names=names, numbers=numbers)] if found else []


def unwrapped(time: Array, angle: Array) -> Array:
    """Return an angle (rad) without jumps of a full turn; NaN stays NaN.

    An angle is already continuous if it is not within -180° ... 180° or 0° ... 360°, or if it never jumps by more than
    half a turn between two samples (gaps excepted). Such an angle stays as it is. Across a gap, the smaller turn is
    assumed.
    """
    found, there = angle.copy(), np.isfinite(angle)
    values = angle[there]
    jumps = np.abs(np.diff(values)) > pi
    jumps[np.isin(time[there][:-1], [start for start, _ in gaps(time, angle)])] = False
    in_one_turn = any(((low <= values) & (values <= low + _TURN)).all() for low in (-pi - _ROUNDING, -_ROUNDING))
    if jumps.any() and in_one_turn:
        found[there] = np.unwrap(values)
    return found


def command_of(layout: Layout, axis: Axis, thrusters: Mapping[str, Array]) -> Array | None:
    """Return the command of the axis that leads to these commands of the thrusters; None if there is none."""
    signs = layout.signs(axis)
    gains = {t.name: sum(g * signs.get(u, 0.0) for u, g in layout.gains[t.name].items()) for t in layout.thrusters}
    driven = [name for name, gain in gains.items() if gain]
    if not driven:
        return None
    reference = min(driven, key=lambda name: abs(gains[name]))  # the last thruster to saturate
    command = np.clip(thrusters[reference] / gains[reference], -1.0, 1.0)
    errors = (np.abs(np.clip(command * gain, -1.0, 1.0) - thrusters[name]) for name, gain in gains.items())
    return command if all((error <= _SAME_COMMAND).all() for error in errors) else None


def _is_driven(layout: Layout, axis: Axis, thrusters: Mapping[str, Array]) -> bool:
    """Return True if the thrust along the axis changes, whatever the coefficients of the thrust curves are.

    Thrust has a linear and a quadratic term in each direction. For the thrusters of one curve, the sum of one of these
    terms must change.
    """
    drivers = layout.drivers(axis)
    strongest = max(abs(t.effect(axis)) for t in drivers)
    for curve in {t.curve for t in drivers}:
        pushing = [(t.effect(axis) / strongest, thrusters[t.name]) for t in drivers if t.curve == curve]
        for side in (1.0, -1.0):
            for power in (1, 2):
                pushes = [effect * np.clip(side * command, 0.0, 1.0) ** power for effect, command in pushing]
                if np.ptp(np.sum(pushes, axis=0)) > _LEAST_CHANGE:
                    return True
    return False
