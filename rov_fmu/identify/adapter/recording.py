"""What today's identification needs of a log: a recording of each axis, with all times on one grid."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rov_fmu.identify.adapter.smoothing import velocity, without_spikes
from rov_fmu.io.messages import MOST
from rov_fmu.model.layout import PITCH, ROLL, SURGE, SWAY, YAW, Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import COMMAND
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import LEAST_SAMPLES, Channel, Log
from rov_fmu.tank.quality import gaps, scales_differ, unwrapped

CONTEXT = {"voltage": "V", "roll": "rad", "pitch": "rad", "depth": "m", "distance": "m"}
"""The conditions that a recording may contain, with their units: the voltage of the battery, the angles of roll and
pitch, the depth, and the distance over ground from the start of the log."""
_CONDITIONS = {ROLL.position: "roll", PITCH.position: "pitch", "surge distance": "distance"}
"""The names of conditions, by the name of the quantity where it differs."""
_SAME_COMMAND = 0.005
"""The largest difference of equal commands, as a fraction of the full command: two steps of a pulse of 1 µs."""
_LEAST_CHANGE = 0.02
"""The smallest change of thrust that counts, as a fraction of the full command. Smaller changes are due to a heading or
depth controller, or to rounded pulses."""


def signal_name(axis: Axis, quantity: str) -> str:
    """Return the name of a measured quantity: surge velocity, surge distance, depth, heading."""
    return f"{axis.name} {quantity}" if quantity in ("velocity", "distance") else quantity


@dataclass(frozen=True, eq=False)
class Recording:
    """Commands and motion over time, n samples in SI units; a heading is unwrapped."""

    file: str
    axis: Axis
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading."""
    time: Array
    """n times in s, ascending from 0."""
    command: Array | None
    """n: the command of the axis, a fraction of the full command, held until the next. Every input that drives the axis
    has this command, with the sign that moves the vehicle in the positive direction. None if the thrusters had
    different commands."""
    values: Array
    """n: NaN where the sensor has no value."""
    thrusters: Mapping[str, Array] = field(default_factory=dict)
    """n each, by thruster: the command of the thruster, if logged; otherwise all thrusters follow `command`."""
    beside: Mapping[str, Array] = field(default_factory=dict)
    """n each: the logged u, v, r and psi, smoothed and interpolated; u and v are over ground."""
    context: Mapping[str, Array] = field(default_factory=dict)
    """n values each: the logged conditions, interpolated between their samples. The names are keys of CONTEXT."""
    clock: str = ""
    """The file whose clock gave the times of the measurements, if it differs from the clock of the commands. Empty if
    both have the same clock."""

    @property
    def is_position(self) -> bool:
        """True when the values are positions."""
        return self.quantity != "velocity"

    @property
    def unit(self) -> str:
        """The unit of the values."""
        return self.axis.position_unit if self.is_position else self.axis.unit

    def reaching(self, layout: Layout) -> Array:
        """Return the command of each thruster, within ±1: n x thrusters of the layout."""
        if self.thrusters:
            still = np.zeros(len(self.time))
            return np.column_stack([self.thrusters.get(thruster.name, still) for thruster in layout.thrusters])
        assert self.command is not None
        gains = axis_gains(layout, self.axis)
        return np.asarray(np.clip(np.outer(self.command, [*gains.values()]), -1.0, 1.0))


def axis_gains(layout: Layout, axis: Axis) -> dict[str, float]:
    """Return the command of each thruster for a command of 1 along an axis."""
    signs = layout.signs(axis)
    return {t.name: sum(g * signs.get(u, 0.0) for u, g in layout.gains[t.name].items()) for t in layout.thrusters}


def recordings_of(log: Log, layout: Layout) -> tuple[list[Recording], list[Finding]]:
    """Return a recording of every axis that a log measures, and a finding for each one that is useless."""
    recordings, findings = [], []
    for axis in [log.axis] if log.axis else [form.axis for form in layout.axes]:
        for channel in _main_channels(log.channels, axis):
            recording = _recording(log, layout, axis, channel)
            if useless := _why_useless(recording, layout):
                findings.append(useless)
            else:
                recordings.append(recording)
                findings += _gaps_of(recording)
                if recording.is_position:
                    findings += scales_differ(log.file, channel, log.channels)
    return recordings, findings


def _main_channels(channels: Iterable[Channel], axis: Axis) -> Iterator[Channel]:
    """Yield the channel of an axis from each file: the position, unless only the velocity has enough samples."""
    own = [channel for channel in channels if channel.quantity.axis == axis and not channel.unused]
    for file in dict.fromkeys(channel.file for channel in own):
        found = sorted((c for c in own if c.file == file), key=lambda channel: channel.quantity.is_velocity)
        yield from [c for c in found if c.count >= LEAST_SAMPLES][:1] or found[-1:]


def _recording(log: Log, layout: Layout, axis: Axis, channel: Channel) -> Recording:
    """Return a recording of an axis at the times of commands and measurements."""
    commands = log.commands
    assert commands
    time = np.union1d(commands.rows, channel.time)
    time = time[(commands.rows[0] <= time) & ((time <= commands.rows[-1]) | (time < commands.end))]
    logged = dict(zip(commands.thrusters, commands.at(time).T, strict=True))
    command = logged[COMMAND] if log.follows_axis else command_of(layout, axis, logged)
    values = np.full(len(time), np.nan)
    known = np.isin(channel.time, time)
    values[np.searchsorted(time, channel.time[known])] = unwrapped(channel)[known]
    quantity = "velocity" if channel.quantity.is_velocity else axis.position
    start = time[0] if len(time) else 0.0
    return Recording(
        channel.file or log.file,
        axis,
        quantity,
        time - start,
        command,
        values,
        {} if log.follows_axis else logged,
        {} if log.follows_axis else _beside(time, log.channels),
        _context(time, log.channels),
        channel.file if channel.file in log.other_clocks else "",
    )


def _beside(time: Array, channels: Iterable[Channel]) -> dict[str, Array]:
    """Interpolate the smoothed velocities in surge, sway and yaw, and the heading, at the times of a recording."""
    found: dict[str, Array] = {}
    for channel in channels:
        axis, there = channel.quantity.axis, channel.there
        if channel.unused or axis not in (SURGE, SWAY, YAW) or there.sum() < LEAST_SAMPLES or not len(time):
            continue
        at, values, is_position = channel.time[there], unwrapped(channel)[there], not channel.quantity.is_velocity
        even, rate = velocity(at, without_spikes(values), is_position=is_position)
        found[axis.velocity] = np.interp(time, even, rate)
        if channel.quantity.name == "heading":
            found["psi"] = np.interp(time, at, values)
    return found


def _context(time: Array, channels: Iterable[Channel]) -> dict[str, Array]:
    """Interpolate the conditions among the channels at the times of a recording."""
    found: dict[str, Array] = {}
    for channel in channels:
        name, there = _CONDITIONS.get(channel.quantity.name, channel.quantity.name), channel.there
        if name in CONTEXT and there.any() and not channel.unused:
            values = unwrapped(channel)[there]
            found[name] = np.interp(time, channel.time[there], values - values[0] if name == "distance" else values)
    return found


def _why_useless(recording: Recording, layout: Layout) -> Finding | None:
    """Return the finding that says why a recording is useless, or None."""
    found = Finding("", axis=recording.axis.name, file=recording.file, names={"quantity": recording.quantity})
    values = recording.values[np.isfinite(recording.values)]
    if len(values) < LEAST_SAMPLES:
        return replace(found, kind="too few samples", numbers={"count": len(values), "least": LEAST_SAMPLES})
    if not recording.thrusters:  # `check_recording` looks at the motion in a test of one axis
        return None
    if np.ptp(values) == 0.0:
        return replace(found, kind="constant motion")
    drivers = layout.drivers(recording.axis)
    if not drivers:
        return replace(found, kind="no thruster", names={})
    if not _is_driven(layout, recording.axis, recording.thrusters):
        moved = any(np.ptp(recording.thrusters[t.name]) > _LEAST_CHANGE for t in drivers)
        return replace(found, kind="cancelling thrusters" if moved else "constant push", names={})
    return None


def _gaps_of(recording: Recording) -> list[Finding]:
    """Return a finding about the gaps in a recording, or none."""
    found = gaps(recording.time, recording.values)
    shown = [f"{end - start:.3g} s from {start:.4g} s on" for start, end in found[:MOST]]
    if more := len(found) - len(shown):
        shown.append(f"{more} more")
    names, numbers = {"gaps": ", ".join(shown)}, {"count": len(found)}
    return [Finding("gaps", recording.axis.name, file=recording.file, names=names, numbers=numbers)] if found else []


def command_of(layout: Layout, axis: Axis, thrusters: Mapping[str, Array]) -> Array | None:
    """Return the command of the axis that leads to these commands of the thrusters; None if there is none."""
    gains = axis_gains(layout, axis)
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
        pushing: Sequence[tuple[float, Array]] = [
            (t.effect(axis) / strongest, thrusters[t.name]) for t in drivers if t.curve == curve
        ]
        for side in (1.0, -1.0):
            for power in (1, 2):
                pushes = (effect * np.clip(side * command, 0.0, 1.0) ** power for effect, command in pushing)
                if np.ptp(sum(pushes, np.zeros(1))) > _LEAST_CHANGE:
                    return True
    return False
