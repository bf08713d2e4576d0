"""A log: what was commanded and what was measured in one dive or one test, each with its own times.

Nothing in a log is resampled or copied onto the times of something else. Every format is read into this type, and
identification, `inspect`, the flight page and `simulate` use it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation.catalogue import Axis
from rov_fmu.tank.arrays import Array, Flags, spread
from rov_fmu.tank.catalogue import MeasuredQuantity
from rov_fmu.tank.clocks import gaps, held
from rov_fmu.tank.findings import Finding, about

LEAST_SAMPLES = 20
"""The smallest number of samples from which something can be identified."""

_TURN = 2.0 * pi + 0.3
"""The largest range of a wrapped angle, rad: noise and filters exceed a turn a little where the angle wraps."""
_DECIMALS = 12
"""The decimal places of a command. What is beyond them is rounding."""
_LONG, _LONG_INTERVALS, _CHANGING, _REGULAR = 1.0, 10.0, 0.9, 2.0
"""Commands are told only where they change if two conditions hold. Somewhere no command comes for longer than the first
number, s, and for longer than the second number of usual intervals of the measurements. And either at least the third
share of the rows change a command, or the rows come at irregular times: the upper quartile of their intervals is more
than the fourth number times the lower one."""


@dataclass(frozen=True, order=True)
class Source:
    """Who sent messages or a channel, and in which frames."""

    topic: str
    """The topic, the message, or the header of the column, or of the first and the last one; empty for a table."""
    kind: str = ""
    """The type of the messages."""
    vehicle: str = ""
    """The MAVLink system or the ROS namespace; empty where a log can only be of one vehicle."""
    part: str = ""
    """The part of the vehicle that sent it, such as `core 1` of the estimator or `component 154`."""
    frames: tuple[str, str] = ("", "")
    """The frames that the header names: of a pose, such as `map`, and of a twist."""

    def __str__(self) -> str:
        return f"{self.topic} ({self.part})" if self.part else self.topic


@dataclass(frozen=True, eq=False)
class Channel:
    """The measurements of one quantity by one source, in SI units and in the frames of the model."""

    quantity: MeasuredQuantity
    source: Source
    time: Array
    """n: s, ascending, all different."""
    values: Array
    """n: NaN where there is no measurement. Angles may wrap."""
    file: str = ""
    """The file that it is from, in a dive of several files."""
    of_log: int = 0
    """The number of measurements in the whole log; 0 where this is no piece of one."""
    unused: str = ""
    """Why the channel is not used, such as `a setpoint`; empty for a channel that is used."""
    derived_from: str = ""
    """The quantity that the sensor measures, with what is assumed, such as `pressure, for fresh water`, if the values
    are computed from it."""

    @cached_property
    def there(self) -> Flags:
        """n: True where there is a measurement."""
        return np.isfinite(self.values)

    @cached_property
    def samples(self) -> tuple[Array, Array]:
        """The times and the values of the measurements that there are."""
        return self.time[self.there], self.values[self.there]

    @cached_property
    def unwrapped(self) -> tuple[Array, Array]:
        """The same, but an angle has no jumps of a full turn.

        It is already continuous if it ranges over clearly more than a turn, or if it never jumps by more than half a
        turn between two samples (gaps excepted). Such an angle stays as it is. Across a gap, the smaller turn is taken.
        """
        time, values = self.samples
        jumps = np.abs(np.diff(values)) > pi
        jumps[np.isin(time[:-1], [start for start, _ in gaps(time, values)])] = False
        is_wrapped = self.quantity.wraps and jumps.any() and spread(values) < _TURN
        return time, np.unwrap(values) if is_wrapped else values

    @property
    def count(self) -> int:
        """The number of samples with a measurement."""
        return int(self.there.sum())


@dataclass(frozen=True, eq=False)
class Commands:
    """The commands of the thrusters as changes: each value holds until the next change of that thruster."""

    thrusters: tuple[str, ...]
    """The names of the thrusters; only `command` in a log of one axis, whose thrusters all follow it."""
    rows: Array
    """The times at which the log tells commands, s, ascending. The last command holds for one more usual interval."""
    time: Array
    """n: the time of the row at which a change is told first, s, ascending."""
    since: Array
    """n: the time of the row before, at which the old command still held; the change happened between the two."""
    thruster: NDArray[np.intp]
    """n: the index of the thruster that changes."""
    value: Array
    """n: the new command, a fraction of the full command within ±1. That of a wrench is in N or N.m until all logs of a
    folder are read, whose largest force is full command."""
    source: Source = field(default_factory=lambda: Source(""))

    @property
    def interval(self) -> float:
        """The usual time between two rows, s."""
        return float(np.median(np.diff(self.rows))) if len(self.rows) > 1 else 0.0

    @property
    def end(self) -> float:
        """The time until which the last commands hold, s."""
        return float(self.rows[-1]) + self.interval

    @property
    def in_rows(self) -> dict[str, Array]:
        """The command of each thruster in each row, by its name."""
        return dict(zip(self.thrusters, self.at(self.rows).T, strict=True))

    @property
    def largest(self) -> dict[str, float]:
        """The size of the largest command of each thruster."""
        by_thruster = (np.abs(self.value[self.thruster == n]) for n in range(len(self.thrusters)))
        return {name: float(own.max(initial=0.0)) for name, own in zip(self.thrusters, by_thruster, strict=True)}

    def relative_to(self, full: Mapping[str, float]) -> "Commands":
        """Return the commands divided by a full command of each thruster, or by 1 where that is 0."""
        each = np.array([full[name] or 1.0 for name in self.thrusters])
        return replace(self, value=self.value / each[self.thruster])

    def at(self, time: Array) -> Array:
        """Return the command of each thruster at some times, times x thrusters; 0 before its first change."""
        by_thruster = (self.thruster == n for n in range(len(self.thrusters)))
        begun = np.asarray(time) >= self.rows[0]
        return np.column_stack([begun * held(self.time[own], self.value[own], time) for own in by_thruster])

    def held_while(self, measured: Array) -> "Commands":
        """Return the commands with a row at each time of a measurement if they are told only where they change.

        Then nearly every row is another command, or rows come at any time, and long times have none. The last command
        holds until the measurements (s, ascending) end.
        """
        times = measured[measured >= self.rows[0]]
        usual = float(np.median(np.diff(times))) if len(times) > 1 else np.inf
        intervals = np.diff(self.rows, append=max(self.rows[-1], times[-1] if len(times) else -np.inf))
        lower, upper = np.quantile(intervals, (0.25, 0.75))
        is_regular = len({*self.time}) < _CHANGING * len(self.rows) and upper <= _REGULAR * lower
        if is_regular or intervals.max() <= max(_LONG, _LONG_INTERVALS * usual):
            return self
        rows = np.union1d(self.rows, times)
        return Commands.of_rows(self.thrusters, rows, self.at(rows), self.source)

    @classmethod
    def of_rows(cls, thrusters: Sequence[str], rows: Array, values: Array, source: Source) -> "Commands":
        """Return the changes in rows of commands: `rows` has n times (s), `values` is n x thrusters within ±1.

        Values that differ by rounding alone are the same command.
        """
        values = np.round(values, _DECIMALS)
        changes = np.vstack([np.ones((1, len(thrusters)), bool), values[1:] != values[:-1]])
        row, thruster = np.nonzero(changes)
        since = rows[np.maximum(row - 1, 0)]
        return cls(tuple(thrusters), rows, rows[row], since, thruster, values[row, thruster], source)


@dataclass(frozen=True, eq=False)
class Log:
    """What one dive, or one test of an axis, commanded and measured."""

    file: str
    """The name of the file, or of the part of it: `dive.tlog (from 41 s)`."""
    commands: Commands | None
    """None where the log has no commands, such as one file of a dive."""
    channels: tuple[Channel, ...]
    """All channels, those that are preferred first."""
    axis: Axis | None = None
    """The only axis that the log is a test of; None for a dive."""
    follows_axis: bool = False
    """True if the log has one command, which all thrusters of its axis follow."""
    findings: tuple[Finding, ...] = ()
    """What was left out, taken or doubted."""
    unread: Mapping[str, str] = field(default_factory=dict)
    """A description of everything that is not recognised, by name."""
    frame: str = ""
    """The frame of ArduSub that the log tells, such as `vectored`; empty where it tells none."""
    names: frozenset[str] = frozenset()
    """The keys that the tables [columns], [topics] and [valid] of rov.toml may have for this log."""
    start: float | None = None
    """The time of the log's clock at which its file begins, s; None: with the first command or measurement."""

    @cached_property
    def begin(self) -> float:
        """The time of the log's clock, s, from which all times that are told count: also those of a piece of a file."""
        if self.start is not None:
            return self.start
        firsts = [channel.time[0] for channel in self.channels if len(channel.time)]
        return float(min([*self.commands.rows[:1], *firsts] if self.commands else firsts, default=0.0))

    @property
    def whole_file(self) -> str:
        """The name of the file, also of a part of it."""
        return self.file.partition(" (from ")[0]

    def used(self, name: str) -> Channel | None:
        """Return the channel that is used for a quantity, by the quantity's name, or None if nothing measures it."""
        return next((c for c in self.channels if c.quantity.name == name and not c.unused and c.count), None)

    def without(self, axes: Collection[str]) -> "Log":
        """Return the log without the channels of some axes, which rov.toml leaves out."""
        kept = (c for c in self.channels if c.quantity.axis is None or c.quantity.axis.name not in axes)
        findings = (about(self.file, "leave out", axis) for axis in axes)
        return replace(self, channels=tuple(kept), findings=(*self.findings, *findings))

    @cached_property
    def shown(self) -> tuple[Channel, ...]:
        """The channels of axes that are used, with the measurements during the commands; angles do not jump."""
        if self.commands is None or not self.commands.time.size:
            return ()
        begin, end = float(self.commands.rows[0]), self.commands.end
        found = []
        for channel in self.channels:
            axis = channel.quantity.axis
            if axis and not channel.unused and self.axis in (None, axis):
                time, values = channel.unwrapped
                inside = (time >= begin) & (time <= end)
                found.append(replace(channel, time=time[inside], values=values[inside]))
        return tuple(found)

    @property
    def tilt(self) -> tuple[Channel, Channel] | None:
        """The roll and the pitch, if the log has both. Where neither ever changes, nothing measures them."""
        roll, pitch = self.used("roll angle"), self.used("pitch angle")
        return (roll, pitch) if roll and pitch and any(np.ptp(one.samples[1]) for one in (roll, pitch)) else None
