"""The plots of recordings: measured, modelled and predicted velocity, the residuals, and one step in detail."""

from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.identify.adapter.smoothing import velocity, without_spikes
from rov_fmu.identify.driving import thrust_along
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.model.rov import Rov
from rov_fmu.report.plots.residuals import finish_residuals, with_residuals
from rov_fmu.report.plots.svg import LIGHT, with_formulas
from rov_fmu.report.templates import text
from rov_fmu.tank.arrays import Array

_BINS = 300
"""The parts of a recording in which residuals are summarised; more of them cannot be seen in the plot."""
_BEFORE = 1.0
"""The time shown before a step, s."""
_WINDOWS = (0.2, 0.3, 0.5, 0.8, 1.2)
"""The windows for smoothing a step, s."""
_VISIBLE = 0.02
"""Noise up to this share of a change of velocity does not hide the change."""
_SETTLED = 0.3
"""A ramped command reaches its new value within this time, s."""
_FROM_REST = 1.25
"""The factor by which a step from rest is preferred, because it shows a delay better."""


def plot_recording(figure: Figure, result: AxisResult, simulation: Simulation) -> None:
    """Plot the measured, modelled and predicted velocity of a recording, and the residuals of its samples below."""
    recording, axis = simulation.recording, result.axis
    above, below = with_residuals(figure, 2.2)
    for hold in (step for step in result.steps if step.file == recording.file):
        above.axvspan(hold.start, hold.end, facecolor=LIGHT["band"], edgecolor=LIGHT["page"], zorder=0)
        _write_at_top(above, 0.5 * (hold.start + hold.end), text(hold.command, ".0%"), "center")
    above.plot(*_thin(*measured(simulation)), color=LIGHT["orange"], linewidth=2.6, alpha=0.6, label="measured")
    above.plot(*_thin(*modelled(simulation)), color=LIGHT["blue"], linewidth=1.2, label="model")
    label: str | None = "predicted"
    for p in result.held_out.predictions if result.held_out else ():
        if p.recording.file == recording.file:
            above.plot(*_thin(p.time, p.predicted), "--", color=LIGHT["violet"], linewidth=1.0, label=label)
            label = None
    above.margins(y=0.18)
    parts = np.array_split(np.arange(len(simulation.time)), min(_BINS, len(simulation.time)))
    low, high = ([pick(simulation.residuals[part]) for part in parts] for pick in (np.min, np.max))
    below.fill_between([simulation.time[part[0]] for part in parts], low, high, color=LIGHT["orange"], linewidth=0.6)
    with_formulas(above.set_ylabel(f"${axis.velocity}$ ({axis.unit})"))
    above.set_xlim(float(simulation.time[0]), float(simulation.time[-1]))
    above.locator_params(nbins=6)
    below.set_xlabel("time (s)")
    finish_residuals(below, f"residual ({recording.unit})")
    _legend(above)


def measured(simulation: Simulation, window: float = 0.5) -> tuple[Array, Array]:
    """Return evenly spaced times and the measured velocity at them, smoothed over a window (s)."""
    values, is_position = without_spikes(simulation.measured), simulation.recording.is_position
    return velocity(simulation.time, values, is_position=is_position, window=window)


def modelled(simulation: Simulation, window: float = 0.5) -> tuple[Array, Array]:
    """Return evenly spaced times and the velocity of the model as the sensor would measure it, smoothed in the same
    way."""
    is_position = simulation.recording.is_position
    return velocity(simulation.time, simulation.modelled, is_position=is_position, window=window)


def _write_at_top(ax: Axes, x: float, words: str, align: Literal["center", "right"]) -> None:
    """Write a few words at the upper edge of a plot; right-aligned words end a little before x."""
    ax.annotate(
        words,
        (x, 1.0),
        (-4.0 if align == "right" else 0.0, 0.0),  # points
        xycoords=ax.get_xaxis_transform(),
        textcoords="offset points",
        fontsize=8.5,
        ha=align,
        va="top",
        color=LIGHT["muted"],
    )


def _legend(ax: Axes) -> None:
    """Put the legend above the plot, where it hides nothing."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2, columnspacing=1.2)


def _thin(time: Array, values: Array) -> tuple[Array, Array]:
    """Return as many samples as can be seen in the plot."""
    some = slice(None, None, max(1, len(time) // (2 * _BINS)))
    return time[some], values[some]


# ---- One step close up -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CommandStep:
    """A change of the commands of a recording."""

    simulation: Simulation
    at: float
    """The time of the change in the recording, s."""
    strength: float
    """The change of the force or torque along the axis, N or N m; a step from rest counts more."""
    words: str
    """The command (or force) before and after the change."""
    Tau: float
    """The approximate time constant of the response, s."""


def clearest_step(fit: RecordingsFit) -> CommandStep | None:
    """Return the strongest step in the recordings of an axis, preferably one from rest; None if there is no step."""
    found = [step for s in fit.simulations if (step := _strongest(s, fit.rov))]
    return max(found, key=lambda step: step.strength, default=None)


def _strongest(simulation: Simulation, rov: Rov) -> CommandStep | None:
    """Return the strongest step in a recording, or None if there is no step far enough from its ends."""
    recording, axis = simulation.recording, simulation.recording.axis
    data = prepare(recording, rov)
    force = thrust_along(rov, axis, data.commands)
    at = data.switches[1:]
    after = force[np.searchsorted(data.switches, at + _SETTLED, side="right") - 1]
    strength = np.abs(after - force[:-1]) * np.where(force[:-1] == 0.0, _FROM_REST, 1.0)
    strength[(at < simulation.time[0] + 0.5 * _BEFORE) | (at > simulation.time[-1] - _BEFORE)] = 0.0
    if not strength.size or strength.max() <= 0.0:
        return None
    n = int(strength.argmax())
    unit, scale, ends = axis.load, 1.0, (force[n], after[n])
    command, held = recording.command, 1.0
    if command is not None:
        place = np.searchsorted(recording.time, [at[n] - 1e-9, at[n] + _SETTLED], side="right") - 1
        unit, scale, ends = "%", 100.0, (command[place[0]], command[place[1]])
        held = float(ends[1] or np.abs(command).max())
    words = " → ".join(f"{scale * end:.3g}".replace("-", "−") for end in ends) + f" {unit}"
    Tau = rov.response(axis, held)[1]
    return CommandStep(simulation, float(at[n]), float(strength[n]), words, Tau if isfinite(Tau) and Tau > 0.0 else 1.0)


def plot_step(figure: Figure, result: AxisResult, step: CommandStep) -> None:
    """Plot the velocity around a change of the command, up to three time constants after it, and the fitted delay."""
    axis = result.axis
    delay = result.recordings.delay_of(step.simulation.recording.file) if result.recordings else 0.0
    low, high = -_BEFORE, max(3.0 * step.Tau, _BEFORE) + max(delay, 0.0)
    ax: Axes = figure.subplots()
    ax.axvline(0.0, color=LIGHT["muted"], linewidth=1.2)
    _write_at_top(ax, 0.0, step.words, "right")
    if delay:
        label = f"delay {text(delay, '.2f')} s"
        ax.axvspan(0.0, delay, facecolor=LIGHT["violet"], edgecolor="none", alpha=0.25, zorder=0, label=label)
    window = _window(step.simulation)
    for (time, v), color, width, label in (
        (measured(step.simulation, window), "orange", 2.6, "measured"),
        (modelled(step.simulation, window), "blue", 1.4, "model"),
    ):
        near = (time >= step.at + low) & (time <= step.at + high)
        alpha = 0.6 if color == "orange" else 1.0
        ax.plot(*_thin(time[near] - step.at, v[near]), color=LIGHT[color], linewidth=width, alpha=alpha, label=label)
    ax.margins(y=0.14)
    ax.set(xlim=(low, high), xlabel="time after the change of the command (s)")
    with_formulas(ax.set_ylabel(f"${axis.velocity}$ ({axis.unit})"))
    ax.locator_params(nbins=6)
    _legend(ax)


def _window(simulation: Simulation) -> float:
    """Return the shortest smoothing window (s) with which noise does not hide the changes of the velocity."""
    from scipy.signal import savgol_coeffs

    rate = (len(simulation.time) - 1) / float(simulation.time[-1] - simulation.time[0])
    visible = _VISIBLE * float(np.ptp(simulation.velocity))
    for window in _WINDOWS[:-1]:
        n = max(2 * int(0.5 * window * rate) + 1, 5)
        kernel = savgol_coeffs(n, 3, deriv=int(simulation.recording.is_position), delta=1.0 / rate)
        if simulation.noise * float(np.linalg.norm(kernel)) < visible:
            return window
    return _WINDOWS[-1]
