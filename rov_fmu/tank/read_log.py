"""Read a log in any format into `Log`s, one for each piece between two restarts of its clock.

The content of the file tells its format, not its name.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES, EXTERNAL, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.io.columns import NEUTRAL, NO_OUTPUT
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import shown
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import MeasuredQuantity
from rov_fmu.tank.channels import channels_of, of_scalar
from rov_fmu.tank.clocks import LATE, in_rows
from rov_fmu.tank.columns import (
    COMMAND,
    INPUTS,
    THRUSTERS,
    ColumnNames,
    LogColumn,
    columns_of_log,
    is_of_inputs,
    thruster_commands,
)
from rov_fmu.tank.commands import Commanded, Series, at_rest, commands_of, wrench_of
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.log import Channel, Commands, Log, Source
from rov_fmu.tank.readers.ardusub_frames import frame_of, misfits
from rov_fmu.tank.readers.content import Content, Piece, described_topics
from rov_fmu.tank.readers.no_measurement import measured_only
from rov_fmu.tank.readers.parsers import guarded, open_table, read_topics
from rov_fmu.tank.readers.tables import read_table


@guarded
def read_logs(
    path: Path,
    layout: Layout,
    names: ColumnNames,
    axis: Axis | None = None,
    *,
    is_part: bool = False,
) -> list[Log]:
    """Read a log of several axes, or of `axis`, or one file of a dive. Raises DataFileError.

    The commands are those of the thrusters of the layout.
    """
    entries = names.topics
    if lines := open_table(path):
        content, entries = read_table(path, layout, axis, names, lines, is_part=is_part)
    else:
        content = read_topics(path, {name.partition(".")[0] for name in (*entries, *names.valid)})
    content.split_by_clock()
    _move_to_neutral(content, entries)
    content.findings += [about(path.name, "clock restarts", at=f"{piece.since:.4g}") for piece in content.pieces[1:]]
    return [_log(path, content, piece, layout, entries, names, axis) for piece in content.pieces]


def _log(
    path: Path,
    content: Content,
    piece: Piece,
    layout: Layout,
    entries: Mapping[str, LogColumn],
    names: ColumnNames,
    axis: Axis | None,
) -> Log:
    """Return the log of a piece: what `entries` say of its fields, and what is recognised besides."""
    is_first, keys = piece is content.pieces[0], names.keys
    file = path.name if is_first else f"{path.name} (from {piece.since:.4g} s)"
    topics, not_measured = measured_only(file, piece.topics, entries, names.valid)
    piece = replace(piece, topics=topics)
    named, told, labels = _meant(path, piece, entries)
    thrusters = [thruster.name for thruster in layout.thrusters]
    topics = [] if any(not entry.quantity for entry in entries.values()) else piece.topics
    commanded = Commanded()
    if not layout.has_wrench:
        commanded = commands_of(path.with_name(file), topics, thrusters, piece.parameters, keys)
    if layout.has_wrench or not (layout.axes or commanded.series):  # nothing is known of the vehicle
        forces = wrench_of(path.with_name(file), topics, layout.bare_axes or [*AXES.values()], keys)
        commanded = forces if forces.series else commanded
    without_thruster = (content.without_thruster if is_first else {}) or commanded.without_thruster
    config = piece.parameters.last("FRAME_CONFIG")
    begin = min((float(topic.time.min()) for topic in piece.topics if len(topic.time)), default=0.0) - piece.since
    fields = [*labels.values()]
    source = commanded.sender or Source(" ... ".join(dict.fromkeys([*fields[:1], *fields[-1:]])))
    series = told or commanded.series
    findings = [
        *content.findings * is_first,
        *not_measured,
        *commanded.findings,
        *_findings(file, layout, series, labels, begin),
        *misfits(file, layout, commanded.without_pulse, without_thruster, config),
    ]
    channels = channels_of(
        piece.topics, commanded.sender, commanded.other_vehicles, named, piece.parameters.specific_gravity
    )
    used = {channel.source.topic for channel in channels} | {*commanded.topics}
    used |= {piece.fields[field] for field in entries.keys() & piece.fields.keys()}
    commands = None
    if series:
        rows, values = in_rows(series)
        thrusters, fractions = thruster_commands(layout, values)
        commands = Commands.of_rows(thrusters, rows, fractions * keys.signs(thrusters), source)
    unread = content.unread | described_topics(topic for topic in piece.topics if topic.source.topic not in used)
    return Log(
        file,
        commands,
        tuple(channels),
        axis,
        follows_axis=COMMAND in series,
        findings=tuple(findings),
        unread=unread,
        frame=frame_of(config),
        names=content.names or frozenset(piece.fields),
        start=begin,
    )


def _move_to_neutral(content: Content, entries: Mapping[str, LogColumn]) -> None:
    """Move the pulses of outputs that rest elsewhere than at the usual neutral pulse to this one, and tell it."""
    fields = (pair for piece in content.pieces for topic in piece.topics for pair in topic.full_fields())
    pulses = grouped((field, values) for field, values in fields if field in entries and entries[field].is_pulse)
    rests, findings = at_rest(content.file, {field: np.concatenate(parts) for field, parts in pulses.items()})
    content.findings += findings
    for field, rest in rests.items():
        for part in pulses[field]:
            part[~np.isin(part, NO_OUTPUT)] += NEUTRAL - rest


def _meant(
    path: Path, piece: Piece, entries: Mapping[str, LogColumn]
) -> tuple[list[Channel], dict[str, Series], dict[str, str]]:
    """Return the channels and the commands that `entries` say that fields are, and the fields of the commands.

    Raises DataFileError where numbers that are no marks are beyond any vehicle.
    """
    channels: list[Channel] = []
    commands: dict[str, Series] = {}
    labels: dict[str, str] = {}
    for topic in piece.topics:
        for field, values in topic.full_fields():
            if entry := entries.get(field):
                converted = np.array([*map(entry.convert, values.tolist())]) if entry.convert else values
                told = np.isfinite(converted) | bool(topic.source.kind)  # NaN in a message stops a motor
                if quantity := entry.quantity:
                    if not topic.source.kind:
                        _check_bounds(path, field, quantity, converted)
                    source = replace(topic.source, topic=field)
                    gravity = piece.parameters.specific_gravity
                    channels += of_scalar(quantity, source, topic.time, converted, gravity=gravity)
                elif told.any():
                    labels[entry.name] = field
                    time = topic.time if told.all() else topic.time[told]
                    commands[entry.name] = time, np.nan_to_num(converted[told])
    return channels, commands, labels


def _check_bounds(path: Path, field: str, quantity: MeasuredQuantity, values: Array) -> None:
    """Raise DataFileError for numbers in a table beyond the bounds of a quantity."""
    beyond = values[(values < quantity.minimum) | (values > quantity.maximum)]
    if len(beyond):
        allowed = f"must be within {quantity.minimum:g} ... {quantity.maximum:g} {quantity.unit}"
        count = f", as in {len(beyond)} rows" if len(beyond) > 1 else ""
        raise DataFileError(f"{path}, column {shown(field)} = {beyond[0]:g} {quantity.unit}{count}: {allowed}")


def _findings(
    file: str, layout: Layout, series: Mapping[str, Series], labels: Mapping[str, str], begin: float
) -> Iterator[Finding]:
    """Yield a finding for each column or thruster with commands beyond ±1, which become ±1, and for each without any,
    or without any at first.

    `labels` has the column or field of each input, thruster or axis that rov.toml or a table names, and the log begins
    at `begin`, s.
    """
    first = min((time[0] for time, _ in series.values()), default=0.0)
    for name, (time, values) in series.items():
        title = labels.get(name, f"thruster {name}")
        if time[0] > first + LATE:
            yield about(file, "late command", column=title, at=f"{time[0] - begin:.4g}")
        count = int((np.abs(values) > 1.0 + 1e-9).sum())
        if count and name not in EXTERNAL:
            yield about(file, "beyond full thrust", column=title, count=count)
    expected = INPUTS if is_of_inputs(layout, series) else THRUSTERS
    missing = {*layout.commands, *layout.curve_of} - series.keys()
    for title, column in columns_of_log(layout, None).items() if series and COMMAND not in series else ():
        if column.commands == expected and column.name in missing:
            yield about(file, "missing column", column=title)
