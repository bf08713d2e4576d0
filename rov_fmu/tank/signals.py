"""From commands and measured motion, each with times of its own, to a recording of every axis that they tell of."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rov_fmu.model.layout import SURGE, SWAY, YAW, Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import velocity, without_spikes

LEAST_SAMPLES = 20
_SAME = 0.005  # of full thrust: two steps of a pulse of 1 µs
_LEAST_CHANGE = 0.02  # of full thrust: less is what holds a heading or a depth, or the rounding of a pulse


@dataclass(frozen=True, eq=False)
class Commands:
    """What reaches the thrusters, held from its time to the next."""

    time: Array
    """n: s, ascending."""
    thrusters: Mapping[str, Array]
    """n each: within ±1."""


@dataclass(frozen=True, eq=False)
class Signal:
    """What a sensor measured along an axis; SI units."""

    axis: Axis
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading."""
    time: Array
    """n: s, ascending."""
    values: Array
    """n: NaN where there is none; a heading may wrap."""


def recordings_of(
    file: str, layout: Layout, commands: Commands, signals: Iterable[Signal], only: Axis | None = None
) -> tuple[tuple[Recording, ...], tuple[str, ...]]:
    """A recording of every signal that can tell something, or of one axis, and why there is none of the others."""
    found, reasons, signals = [], [], list(signals)
    for signal in (signal for signal in signals if only in (None, signal.axis)):
        recording = _recording(file, layout, commands, signal, signals)
        if reason := useless(recording, layout):
            reasons.append(f"no recording of {signal.axis.name}: {reason}")
        else:
            found.append(recording)
    return tuple(found), tuple(reasons)


def useless(recording: Recording, layout: Layout) -> str | None:
    """Why a recording tells nothing of its axis."""
    there = np.isfinite(recording.values)
    if there.sum() < LEAST_SAMPLES:
        return f"{there.sum()} samples of {recording.quantity}, at least {LEAST_SAMPLES} are needed"
    if np.ptp(recording.values[there]) == 0.0:
        return f"the {recording.quantity} never changes"
    if not _is_driven(layout, recording.axis, recording.thrusters):
        return "what the thrusters do along it never changes"
    return None


def _recording(file: str, layout: Layout, commands: Commands, signal: Signal, others: Iterable[Signal]) -> Recording:
    """At the times of both, while the commands are known: the last one for as long as they usually are held."""
    time = np.union1d(commands.time, signal.time)
    end = commands.time[-1] + (np.median(np.diff(commands.time)) if len(commands.time) > 1 else 0.0)
    time = time[(commands.time[0] <= time) & (time < end)]
    thrusters = dict(commands.thrusters)  # shared by the recordings of a log with one column of time
    if not np.array_equal(time, commands.time):
        held = np.searchsorted(commands.time, time, side="right") - 1
        thrusters = {name: values[held] for name, values in thrusters.items()}
    values = np.full(len(time), np.nan)
    known = np.isin(signal.time, time)
    values[np.searchsorted(time, signal.time[known])] = signal.values[known]
    if signal.quantity == "heading":
        values = unwrapped(values)
    start = time[0] if len(time) else 0.0
    command = command_of(layout, signal.axis, thrusters)
    return Recording(
        file, signal.axis, signal.quantity, time - start, command, values, thrusters, _beside(time, others)
    )


def _beside(time: Array, signals: Iterable[Signal]) -> dict[str, Array]:
    """Velocities along the surface, about the vertical, and the heading, at other times than their own."""
    found = {}
    for signal in (s for s in signals if s.axis in (SURGE, SWAY, YAW)):
        there = np.isfinite(signal.values)
        if there.sum() < LEAST_SAMPLES or not len(time):
            continue
        at, values, is_position = signal.time[there], signal.values[there], signal.quantity != "velocity"
        values = np.unwrap(values) if signal.quantity == "heading" else values
        even, rate = velocity(at, without_spikes(values), is_position=is_position)
        found[signal.axis.velocity] = np.interp(time, even, rate)
        if signal.quantity == "heading":
            found["psi"] = np.interp(time, at, values)
    return found


def unwrapped(heading: Array) -> Array:
    """Without jumps of a turn (rad); NaN stays."""
    found, there = heading.copy(), np.isfinite(heading)
    found[there] = np.unwrap(heading[there])
    return found


def command_of(layout: Layout, axis: Axis, thrusters: Mapping[str, Array]) -> Array | None:
    """The command of the axis that gives these of the thrusters; None where their pattern is another at any time."""
    signs = layout.signs(axis)
    gains = {t.name: sum(g * signs.get(u, 0.0) for u, g in layout.gains[t.name].items()) for t in layout.thrusters}
    driven = [name for name, gain in gains.items() if gain]
    if not driven:
        return None
    last = min(driven, key=lambda name: abs(gains[name]))  # to saturate
    command = np.clip(thrusters[last] / gains[last], -1.0, 1.0)
    off = (np.abs(np.clip(command * gain, -1.0, 1.0) - thrusters[name]) for name, gain in gains.items())
    return command if all((distance <= _SAME).all() for distance in off) else None


def _is_driven(layout: Layout, axis: Axis, thrusters: Mapping[str, Array]) -> bool:
    """Whether the push along the axis changes, whatever the thrust curves: the sums of both their terms, of thrusters
    of one curve ahead and in reverse, are not all constant."""
    drivers = layout.drivers(axis)
    strongest = max(abs(t.effect(axis)) for t in drivers)
    for curve in {t.curve for t in drivers}:
        of = [(t.effect(axis) / strongest, thrusters[t.name]) for t in drivers if t.curve == curve]
        for side in (1.0, -1.0):
            for power in (1, 2):
                pushes = [effect * np.clip(side * command, 0.0, 1.0) ** power for effect, command in of]
                if np.ptp(np.sum(pushes, axis=0)) > _LEAST_CHANGE:
                    return True
    return False
