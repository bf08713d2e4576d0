"""The plots of the identification report: every fit with its 95 % band, and its residuals below."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.identify.identification import AxisResult, Comparison, Identification
from rov_fmu.identify.least_squares import Array, Flags
from rov_fmu.identify.output_error import Simulation
from rov_fmu.identify.quadratic_fit import QuadraticFit, quadratic
from rov_fmu.identify.response_fit import holding_force, responses
from rov_fmu.identify.step_responses import velocity, without_spikes
from rov_fmu.pages.plots import Step, draw_steps, evenly
from rov_fmu.pages.svg import LIGHT
from rov_fmu.pages.templates import pretty_unit

_BINS = 300  # of a recording: as many as one can see


def plot_thrust(figure: Figure, results: Identification, fit: QuadraticFit) -> None:
    """Force over command, and the curve of the vehicle where recordings have moved it away from the fit."""
    curve = [results.vehicle.rov[name] for name in fit.estimate.names]
    moved = not np.allclose(curve, (fit.a, fit.b), rtol=1e-9)
    above, below, x = _quadratic(figure, fit, 100.0, "grey" if moved else "blue", "fit to the forces")
    if moved:
        above.plot(100.0 * x, quadratic(x) @ curve, color=LIGHT["blue"], label="with the recordings")
    _finish(above, below, "Force (N)", "command (%)", "residual (N)")


def plot_drag(figure: Figure, results: Identification, result: AxisResult) -> None:
    """Thrust at measured V_ss: the drag that the vehicle takes, and the fit to these forces alone as in (11)-(16)."""
    assert result.drag
    axis, load, rov = result.axis, pretty_unit(result.axis.load), results.vehicle.rov
    above, below, v = _quadratic(figure, result.drag, 1.0, "grey", "fit to these forces")
    a, b, alpha = (rov[axis.coefficient(key)] for key in ("a_d", "b_d", "alpha"))
    above.plot(v, quadratic(v) @ (a, b), color=LIGHT["blue"], label="model")
    other = results.against.rov if results.against and results.against.layout.has(axis) else None
    if other and (scale := other[axis.coefficient("alpha")]):
        scaled = [holding_force(other, axis, x) * alpha / scale for x in v.tolist()]
        above.plot(v, scaled, ":", color=LIGHT["teal"], label="compared")
    title = f"Drag ({load}) over ${axis.velocity}$"
    _finish(above, below, title, f"velocity ({axis.unit})", f"residual ({load})")


def _quadratic(figure: Figure, fit: QuadraticFit, scale: float, color: str, label: str) -> tuple[Axes, Axes, Array]:
    """Both parts of the plot of a fit, and over which numbers it is drawn."""
    above, below = _two(figure)
    x = np.linspace(min(0.0, 1.05 * fit.x.min()), max(0.0, 1.05 * fit.x.max()), 61)
    _band(above, scale * x, *fit.band(x), color)
    above.plot(scale * x, fit.value(x), "--" if color == "grey" else "-", color=LIGHT[color], label=label)
    _dots(above, scale * fit.x, fit.y, fit.counts, label="measured")
    _dots(below, scale * fit.x, fit.residuals, fit.counts)
    _diamonds(below, scale * fit.x, fit.y - fit.leave_one_out)
    return above, below, x


def plot_response(
    figure: Figure, results: Identification, result: AxisResult, quantity: str, comparison: Comparison | None
) -> None:
    """V_ss or Tau over command, signs dropped, and below the relative errors."""
    axis, points, which = result.axis, comparison.points if comparison else (), int(quantity == "Tau")
    above, below = _two(figure) if points else (figure.subplots(), None)
    at = [abs(p.command) for p in points] or list(results.vehicle.command_range)
    c = np.linspace(max(0.5 * min(at), 0.01), min(max(at) + 0.05, 1.0), 46)
    tested = (c >= min(at)) & (c <= max(at))
    curve = responses(axis, results.vehicle.rov, c)[:, which]
    if fit := result.recordings or result.response:
        low, high = fit.band(c)[2 * which :][:2]
        _band(above, 100.0 * c, np.maximum(low, 0.0), high, "blue")
    above.plot(100.0 * c, curve, color=LIGHT["blue"], label="model")
    if results.against and results.against.layout.has(axis):
        other = responses(axis, results.against.rov, c)[:, which]
        above.plot(100.0 * c, other, "--", color=LIGHT["grey"], label="compared")
    top = [*(abs(p.value) for p in points), *curve[tested][np.isfinite(curve[tested])].tolist()]
    above.set_ylim(0.0, 1.25 * max(top, default=1.0) or 1.0)
    if comparison and below:
        x, y = 100.0 * np.array(at), np.array([abs(p.value) for p in points])
        counts = np.array([p.weight > 0.0 for p in points])
        _dots(above, x, y, counts, label="measured")
        _dots(below, x, 100.0 * (np.abs(comparison.model) / y - 1.0), counts)
        _diamonds(below, x, 100.0 * (np.abs(comparison.leave_one_out) / y - 1.0))
    title = "$Tau$ (s)" if quantity == "Tau" else rf"$V_{{ss}}$ ({axis.unit})"
    _finish(above, below, title, "command (%)", "error (%)")


def plot_steps(figure: Figure, results: Identification, result: AxisResult) -> None:
    """Steps of the command from rest, up to four, with what was measured of them; signs dropped."""
    tested = sorted({round(abs(p.command), 6) for p in result.points})
    steps = []
    for command in evenly(tested):
        here = [p for p in result.points if round(abs(p.command), 6) == command]
        V_ss, Tau = ([abs(p.value) for p in here if p.quantity == quantity] for quantity in ("V_ss", "Tau"))
        steps.append(Step(command, V_ss, Tau))
    ax: Axes = figure.subplots()
    draw_steps(ax, result.axis, steps, [(results.vehicle.rov, "-")])
    ax.set_title(f"Steps: ${result.axis.velocity}$ ({result.axis.unit})", loc="left")


def plot_recording(figure: Figure, result: AxisResult, simulation: Simulation) -> None:
    """Velocity of a recording and of the model, and below the residuals of the measured samples."""
    recording, axis = simulation.recording, result.axis
    above, below = _two(figure, (2.2, 1.0))
    for hold in (step for step in result.steps if step.file == recording.file):
        above.axvspan(hold.start, hold.end, facecolor=LIGHT["band"], edgecolor=LIGHT["page"], zorder=0)
        above.text(
            0.5 * (hold.start + hold.end), 1.0, f"{100.0 * hold.command:g} %".replace("-", "−"), fontsize=8.5,
            transform=above.get_xaxis_transform(), ha="center", va="top", color=LIGHT["muted"],
        )  # fmt: skip
    time, v = velocity(simulation.time, without_spikes(simulation.measured), is_position=recording.is_position)
    thin = slice(None, None, max(1, len(time) // (2 * _BINS)))
    above.plot(time[thin], v[thin], color=LIGHT["orange"], linewidth=2.6, alpha=0.6, label="measured")
    thin = slice(None, None, max(1, len(simulation.time) // (2 * _BINS)))
    above.plot(simulation.time[thin], simulation.velocity[thin], color=LIGHT["blue"], linewidth=1.2, label="model")
    above.margins(y=0.18)
    parts = np.array_split(np.arange(len(simulation.time)), min(_BINS, len(simulation.time)))
    low, high = ([pick(simulation.residuals[part]) for part in parts] for pick in (np.min, np.max))
    t = [simulation.time[part[0]] for part in parts]
    below.fill_between(t, low, high, color=LIGHT["orange"], linewidth=0.6)
    _finish(above, below, f"${axis.velocity}$ ({axis.unit})", "time (s)", f"residual ({recording.unit})")
    above.set_xlim(float(simulation.time[0]), float(simulation.time[-1]))


def _band(ax: Axes, x: Array, low: Array, high: Array, color: str) -> None:
    if np.isfinite(low).all() and np.isfinite(high).all():
        ax.fill_between(x, low, high, color=LIGHT[color], alpha=0.18, linewidth=0.0, label="95 %")


def _two(figure: Figure, heights: tuple[float, float] = (2.6, 1.0)) -> tuple[Axes, Axes]:
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=heights)
    below.axhline(0.0, color=LIGHT["muted"], linewidth=0.8)
    return above, below


def _finish(above: Axes, below: Axes | None, title: str, x: str, y: str) -> None:
    above.set_title(title, loc="left")
    (below or above).set_xlabel(x)
    above.locator_params(nbins=6)
    if below:
        below.set_ylabel(y)
        below.locator_params(axis="y", nbins=3)
        reach = 1.15 * max(map(abs, below.get_ylim()))
        below.set_ylim(-reach, reach)
    above.legend(loc="best")


def _dots(ax: Axes, x: Array, y: Array, counts: Flags, label: str = "") -> None:
    """Points that count are filled."""
    for which, face, name in ((counts, LIGHT["orange"], label), (~counts, "none", label and f"{label}, weight 0")):
        if which.any():
            ax.plot(x[which], y[which], "o", color=LIGHT["orange"], markerfacecolor=face, markersize=4.5, zorder=5,
                    label=name or None)  # fmt: skip


def _diamonds(ax: Axes, x: Array, y: Array) -> None:
    """Leave-one-thrust-out."""
    ax.plot(x, y, "D", color=LIGHT["violet"], markerfacecolor="none", markersize=4.0, zorder=4)
