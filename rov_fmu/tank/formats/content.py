"""The content of a log, independent of the vehicle: topics, commands and signals, each with its own times."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rov_fmu.io.csv_table import NO_OUTPUT, Conversion, DataFileError, pulses
from rov_fmu.io.messages import shown
from rov_fmu.model.layout import Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.signals import LEAST_SAMPLES, Commands, Signal

PULSE_RANGE = 800.0, 2200.0
"""The range of pulses that speed controllers get, µs."""


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one topic of a bag or of a ULog."""

    name: str
    kind: str
    """The type of the messages."""
    time: Array
    """n: s, ascending, all different."""
    fields: Mapping[str, Array]
    """n each: the numbers by their place in a message, such as `pose.pose.position.x` or `channels[0]`."""
    frames: tuple[str, ...] = ()
    """The frames that a header names: of the pose, and, in odometry, of the body."""

    def columns(self, *names: str) -> Array | None:
        """Return n x names numbers, or None if the messages lack one of the fields."""
        return np.column_stack([self.fields[name] for name in names]) if {*names} <= self.fields.keys() else None


@dataclass(frozen=True)
class Entry:
    """The meaning of a field by an entry of [topics]: a command, or the signal of a sensor."""

    name: str
    """The name of the column that a CSV file would have."""
    axis: Axis | None
    quantity: str
    """Empty for a command."""
    convert: Conversion


@dataclass(frozen=True)
class Wanted:
    """The information about the vehicle that a reader needs."""

    thrusters: Sequence[str] = ()
    """The names of the columns of commands of the thrusters, in order. Without names they are numbered from 1."""
    entries: Mapping[str, Entry] = field(default_factory=dict)
    """The table [topics], by topic and field: `/bar30/depth.data`."""

    @property
    def names_commands(self) -> bool:
        """True if [topics] names commands. They replace the commands that would be recognised."""
        return any(not entry.quantity for entry in self.entries.values())

    def named(self, outputs: Iterable[Array]) -> dict[str, Array]:
        """Return the outputs of the thrusters by name."""
        found = list(outputs)
        names = self.thrusters or [str(n) for n in range(1, len(found) + 1)]
        return dict(zip(names, found, strict=False))


@dataclass(eq=False)
class Content:
    """What a log contains."""

    file: str
    commands: Commands | None = None
    """The commands by the names of their columns, or None if the log has none."""
    signals: list[Signal] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    unread: dict[str, str] = field(default_factory=dict)
    """A description of everything that is not recognised, by name."""
    known: set[str] = field(default_factory=set)
    """The keys of the tables [columns] or [topics] that the log has."""


def content_of(
    file: str, topics: Sequence[Topic], wanted: Wanted, commands: Commands | None, signals: Iterable[Signal]
) -> Content:
    """Return the content of topics: what the table [topics] says of them, and what is recognised besides.

    Of several signals of the same quantity the first with enough samples is taken; those of the table come first.
    """
    fields = {f"{topic.name}.{name}": (topic, values) for topic in topics for name, values in topic.fields.items()}
    content = Content(file, commands, known={*fields})
    mapped, named = [], {}
    for source, entry in wanted.entries.items():
        if source in fields:
            topic, values = fields[source]
            converted = np.array([entry.convert(value) for value in values.tolist()])
            if entry.quantity:
                mapped.append(Signal(entry.axis, entry.quantity, topic.time, converted))
            else:
                named[entry.name] = topic.time, converted
    if named:
        content.commands = together(named)
    found: dict[tuple[Axis | None, str], Signal] = {}
    for signal in (*mapped, *signals):
        key = signal.axis, signal.quantity
        if key not in found or np.isfinite(found[key].values).sum() < LEAST_SAMPLES:
            found[key] = signal
    content.signals = list(found.values())
    return content


def together(series: Mapping[str, tuple[Array, Array]]) -> Commands:
    """Combine commands with different times into held commands at common times. They begin when every thruster has a
    command."""
    time = np.unique(np.concatenate([times for times, _ in series.values()]))
    time = time[time >= max(times[0] for times, _ in series.values())]
    held = {
        name: np.clip(np.nan_to_num(values[np.searchsorted(times, time, side="right") - 1]), -1.0, 1.0)
        for name, (times, values) in series.items()
    }
    return Commands(time, held)


def fraction(file: str, source: str, outputs: Array) -> Array:
    """Return outputs as fractions of the full command. Their size shows whether they are fractions or pulses.

    NaN, and a pulse that means no output, become 0. Raises DataFileError.
    """
    values = np.nan_to_num(outputs)
    if (np.abs(values) <= 1.0).all():
        return values
    low, high = PULSE_RANGE
    if (np.isin(values, NO_OUTPUT) | ((low <= values) & (values <= high))).all():
        return np.array([*map(pulses(), values.ravel().tolist())]).reshape(values.shape)
    raise DataFileError(
        f"{file}, {shown(source)}: outputs between {values.min():g} and {values.max():g} are neither fractions within "
        "-1 ... 1 nor pulses in us: name their unit in the table [topics] of rov.toml"
    )


def ascending(time: Array, *values: Array) -> tuple[Array, ...]:
    """Return times in order, and the values with them; the last value counts where a time is repeated."""
    order = np.argsort(time, kind="stable")
    last = np.append(np.diff(time[order]) > 0.0, True)
    return tuple(array[order][last] for array in (time, *values))
