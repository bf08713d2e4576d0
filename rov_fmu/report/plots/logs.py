"""The plot of a log: the commands, what was measured, and, after an identification, what was predicted."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.equation.units import in_degrees
from rov_fmu.identify.result import Prediction
from rov_fmu.io.groups import grouped
from rov_fmu.report.plots.svg import LIGHT, draw_commands, name_axes
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.clocks import gaps
from rov_fmu.tank.log import Channel, Log
from rov_fmu.vehicle.uncertainty import NORMAL

MOST_SAMPLES = 400
"""More samples than this would not be visible."""
_PANEL, _EDGES = 1.1, 1.8
"""The height of a panel, and of the commands with the axis of time, inches."""
_NARROW = 5.0
"""In a figure of at most this width, inches, the legend has a second row."""
_MOST_LINES = 8
"""Of more commands than this, only those that change are drawn."""


def height_of(log: Log | None, predictions: Sequence[Prediction] = (), *, measured: bool = True) -> float:
    """Return the height of the plot of a log, inches."""
    panels = len({(p.quantity, p.span) for p in predictions}) + (
        len(_unpredicted(log, predictions)) if log and measured else 0
    )
    return _EDGES + _PANEL * max(panels, 1)


def plot_log(figure: Figure, log: Log | None, predictions: Sequence[Prediction] = (), *, measured: bool = True) -> None:
    """Plot the predictions of a log with their bands, those of both halves of it in one panel, and, if `measured`, its
    other channels, above the commands of its thrusters."""
    groups = grouped(((p.quantity, p.span), p) for p in predictions).values()
    channels = _unpredicted(log, predictions) if log and measured else []
    commands = log.commands if log else None
    times = [commands.rows] if commands else [*(p.time for p in predictions), *(c.samples[0] for c in channels)]
    since = min((float(time[0]) for time in times), default=0.0)  # clocks may count from 1970
    count = len(groups) + len(channels) + bool(commands)
    panels = figure.subplots(count, sharex=True, squeeze=False)[:, 0]
    for panel, own in zip(panels, groups, strict=False):
        for n, p in enumerate(own):
            _draw_prediction(panel, p, since, is_named=not n)
    for panel, channel in zip(panels[len(groups) :], channels, strict=False):
        _draw_channel(panel, channel, since)
    if commands:
        time = np.linspace(float(commands.rows[0]), commands.end, MOST_SAMPLES)
        values = dict(zip(commands.thrusters, commands.at(time).T, strict=True))
        if len(values) > _MOST_LINES:
            values = {name: own for name, own in values.items() if np.ptp(own) > 0.0} or values
        is_force = any(name.endswith("_ext") for name in values)
        named = {name if name == "command" or is_force else f"u_{name}": own for name, own in values.items()}
        draw_commands(panels[-1], time - since, named, "N, N.m" if is_force and _is_absolute(log) else "1")
    panels[-1].set_xlabel("time (s)")
    if predictions:
        ends = min(p.time[0] for p in predictions), max(p.time[-1] for p in predictions)
        panels[-1].set_xlim(ends[0] - since, ends[1] - since)
        columns = 4 if figure.get_figwidth() > _NARROW else 2
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=columns)


def _is_absolute(log: Log | None) -> bool:
    """Return True for the forces of a log before they are related to the largest ones of a folder."""
    return bool(log and log.commands and max(log.commands.largest.values(), default=0.0) > 1.0)


def _unpredicted(log: Log, predictions: Sequence[Prediction]) -> list[Channel]:
    """Return the channels that are used, that change, and of which there is no prediction."""
    predicted = {p.quantity for p in predictions}
    used = (c for c in log.channels if not c.unused and c.count and c.quantity.name not in predicted)
    return [c for c in used if np.ptp(c.samples[1]) > 0.0 and not (predictions and c.quantity.axis is None)]


def _draw_channel(ax: Axes, channel: Channel, since: float) -> None:
    factor, unit = in_degrees(channel.quantity.unit)
    time, values = channel.unwrapped
    some = slice(None, None, max(1, len(time) // (5 * MOST_SAMPLES)))
    time, values = time[some] - since, factor * values[some]
    breaks = np.searchsorted(time, [start - since for start, _ in gaps(*channel.samples)], side="right")
    ax.plot(np.insert(time, breaks, np.nan), np.insert(values, breaks, np.nan), color=LIGHT["orange"], label="measured")
    ax.margins(x=0.0, y=0.12)
    name_axes(ax, channel.quantity.name, unit)


def _draw_prediction(ax: Axes, shown: Prediction, since: float, *, is_named: bool) -> None:
    """Draw what was measured of an unseen log and what was predicted, with the 95 % band."""
    names = ("measured", "predicted, with 95 % band") if is_named else (None, None)
    factor, unit = in_degrees(shown.unit)
    some = slice(None, None, max(1, len(shown.time) // MOST_SAMPLES))
    time, half = shown.time[some] - since, factor * NORMAL * shown.deviation[some]
    predicted = factor * shown.predicted[some]
    fill_band(ax, time, predicted - half, predicted + half)
    ax.plot(time, factor * shown.measured[some], color=LIGHT["orange"], linewidth=2.6, alpha=0.6, label=names[0])
    ax.plot(time, predicted, color=LIGHT["blue"], linewidth=1.3, label=names[1])
    ax.margins(x=0.0, y=0.12)
    name_axes(ax, f"{shown.quantity}{shown.ahead}", unit)


def fill_band(ax: Axes, x: Array, low: Array, high: Array) -> None:
    """Draw a band between two lines."""
    ax.fill_between(x, low, high, color=LIGHT["blue"], alpha=0.25, linewidth=0.0)
