"""Combine commands and measured motion, each with its own times, into a recording of every axis."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rov_fmu.model.layout import SURGE, SWAY, YAW, Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import velocity, without_spikes

LEAST_SAMPLES = 20
_SAME_COMMAND = 0.005
"""The largest difference of equal commands, as a fraction of full thrust: two steps of a pulse of 1 µs."""
_LEAST_CHANGE = 0.02
"""The smallest change of thrust that counts, as a fraction of full thrust. Smaller changes hold a heading or a depth,
or are the rounding of a pulse."""


@dataclass(frozen=True, eq=False)
class Commands:
    """The commands of the thrusters; each is held until the next."""

    time: Array
    """n: s, ascending."""
    thrusters: Mapping[str, Array]
    """n each, by thruster, within ±1."""


@dataclass(frozen=True, eq=False)
class Signal:
    """The measurements of a sensor along an axis, in SI units."""

    axis: Axis
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading."""
    time: Array
    """n: s, ascending."""
    values: Array
    """n: NaN where there is no measurement; a heading may wrap."""


def recordings_of(
    file: str, layout: Layout, commands: Commands, signals: Iterable[Signal], only: Axis | None = None
) -> tuple[tuple[Recording, ...], tuple[Finding, ...]]:
    """Return a recording of every useful signal, and a finding for each useless one; `only` selects one axis."""
    recordings, findings, signals = [], [], list(signals)
    for signal in signals:
        if only in (None, signal.axis):
            recording = _recording(file, layout, commands, signal, signals)
            finding = why_useless(recording, layout)
            if finding:
                findings.append(finding)
            else:
                recordings.append(recording)
    return tuple(recordings), tuple(findings)


def why_useless(recording: Recording, layout: Layout) -> Finding | None:
    """Return the reason why nothing can be identified from a recording, or None."""
    found = Finding("", axis=recording.axis.name, file=recording.file, names={"quantity": recording.quantity})
    values = recording.values[np.isfinite(recording.values)]
    if len(values) < LEAST_SAMPLES:
        return replace(found, kind="too few samples", numbers={"count": len(values), "least": LEAST_SAMPLES})
    if np.ptp(values) == 0.0:
        return replace(found, kind="constant motion")
    if not _is_driven(layout, recording.axis, recording.thrusters):
        return replace(found, kind="constant push", names={})
    return None


def _recording(file: str, layout: Layout, commands: Commands, signal: Signal, others: Iterable[Signal]) -> Recording:
    """Return a recording at the times of commands and signal.

    The last command counts for as long as a command is usually held.
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
    values[np.searchsorted(time, signal.time[known])] = signal.values[known]
    if signal.quantity == "heading":
        values = unwrapped(values)
    start = time[0] if len(time) else 0.0
    command = command_of(layout, signal.axis, thrusters)
    return Recording(
        file, signal.axis, signal.quantity, time - start, command, values, thrusters, _beside(time, others)
    )


def _beside(time: Array, signals: Iterable[Signal]) -> dict[str, Array]:
    """Interpolate the smoothed velocities in surge, sway and yaw, and the heading, at the times of a recording."""
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
    """Return the heading (rad) without jumps of a full turn; NaN stays NaN."""
    found, there = heading.copy(), np.isfinite(heading)
    found[there] = np.unwrap(heading[there])
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
    """Return True when the push along the axis changes for any thrust curves.

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
