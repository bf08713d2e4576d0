"""The plots of the identification report: each fit with its 95 % band, and its residuals below."""

from collections.abc import Iterator, Sequence
from math import log

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.identify.identification import AxisResult, Comparison, Identification
from rov_fmu.identify.points.curve_fit import CurveFit
from rov_fmu.identify.points.response_fit import holding_force, responses
from rov_fmu.identify.points.thrust_fit import ThrustFit, forces
from rov_fmu.report.findings import Known
from rov_fmu.report.plots.residuals import finish_residuals, with_residuals
from rov_fmu.report.plots.steps import Step, draw_steps, evenly
from rov_fmu.report.plots.svg import LIGHT, with_formulas
from rov_fmu.report.templates import pretty_unit, text
from rov_fmu.tank.arrays import Array, Flags

_WIDEST = 5.0
"""Intervals are drawn from a fifth of the value to five times the value. An arrow marks an end beyond this."""
_TICKS = [n / 1000 for n in (1, 2, 3, 5, 10, 20, 30, 40, 50, 100, 150, 200, 300, 400, 500, 750, 1000, 2000, 3000, 4000)]
"""The relative deviations that may be labelled."""
_STANDARD_ERRORS = 1.96
"""Half the width of a 95 % interval in standard errors."""


def plot_thrust(figure: Figure, results: Identification, fit: ThrustFit) -> None:
    """Plot force over command, and the curve of the vehicle if recordings have moved it away from the fit."""
    rov = results.vehicle.rov
    curve = rov.layout.curves_by_name[fit.curve.name]
    moved = curve != fit.curve or not all(np.isclose(rov[name], value, rtol=1e-9) for name, value in fit.values.items())
    above, below, x = _fitted(figure, fit, 100.0, "grey" if moved else "blue", "fit to the forces")
    if moved:
        above.plot(100.0 * x, forces(curve, rov.coefficients, x), color=LIGHT["blue"], label="with the recordings")
    _finish(above, below, "Force (N)", "command (%)", "residual (N)")


def plot_drag(figure: Figure, results: Identification, result: AxisResult) -> None:
    """Plot the thrust at each measured V_ss, the drag of the vehicle, and the fit to these forces alone, (11)-(16)."""
    assert result.drag
    axis, load, rov = result.axis, pretty_unit(result.axis.load), results.vehicle.rov
    above, below, v = _fitted(figure, result.drag, 1.0, "grey", "fit to these forces")
    alpha = rov[axis.coefficient("alpha")]
    above.plot(v, [holding_force(rov, axis, x) for x in v.tolist()], color=LIGHT["blue"], label="model")
    other = results.against.rov if results.against and results.against.layout.has(axis) else None
    if other and (scale := other[axis.coefficient("alpha")]):
        scaled = [holding_force(other, axis, x) * alpha / scale for x in v.tolist()]
        above.plot(v, scaled, ":", color=LIGHT["teal"], label="compared")
    title = f"Drag ({load}) over ${axis.velocity}$"
    _finish(above, below, title, f"velocity ({axis.unit})", f"residual ({load})")


def _fitted(figure: Figure, fit: CurveFit, scale: float, color: str, label: str) -> tuple[Axes, Axes, Array]:
    """Draw a fit and its residuals. Returns both parts of the plot, and the numbers over which the fit is drawn."""
    above, below = with_residuals(figure, 2.6)
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
    """Plot the size of V_ss or Tau over that of the command, and the relative errors below."""
    axis, points, which = result.axis, comparison.points if comparison else (), int(quantity == "Tau")
    above, below = with_residuals(figure, 2.6) if points else (figure.subplots(), None)
    at = [abs(p.command) for p in points] or list(results.vehicle.command_range)
    c = np.linspace(max(0.5 * min(at), 0.01), min(max(at) + 0.05, 1.0), 46)
    tested = (c >= min(at)) & (c <= max(at))
    curve = responses(axis, results.vehicle.rov, c)[:, which]
    if fit := result.recordings or result.response:
        low, high = fit.band(c)[2 * which :][:2]
        _band(above, 100.0 * c, np.maximum(low, 0.0), high, "blue")
    above.plot(100.0 * c, curve, color=LIGHT["blue"], label="model")
    reverse = responses(axis, results.vehicle.rov, -c)[:, which] * (1.0 if which else -1.0)
    if any(p.command < 0.0 for p in points) and not np.allclose(reverse, curve, rtol=0.01):
        above.plot(100.0 * c, reverse, "-.", color=LIGHT["blue"], linewidth=1.0, label="model, negative commands")
    if results.against and results.against.layout.has(axis):
        other = responses(axis, results.against.rov, c)[:, which]
        above.plot(100.0 * c, other, "--", color=LIGHT["grey"], label="compared")
    top = [*(abs(p.value) for p in points), *curve[tested][np.isfinite(curve[tested])].tolist()]
    above.set_ylim(0.0, 1.25 * max(top, default=1.0) or 1.0)
    if comparison and below:
        x, y = 100.0 * np.array(at), np.array([abs(p.value) for p in points])
        counts = np.array([p.weight > 0.0 for p in points])
        errors = _STANDARD_ERRORS * np.array([p.error or 0.0 for p in points])
        _bars(above, x, y, errors)
        _dots(above, x, y, counts, label="measured")
        off = np.abs(comparison.model) / y
        _bars(below, x, 100.0 * (off - 1.0), 100.0 * off * errors / y)
        _dots(below, x, 100.0 * (off - 1.0), counts)
        _diamonds(below, x, 100.0 * (np.abs(comparison.leave_one_out) / y - 1.0))
    title = "$Tau$ (s)" if quantity == "Tau" else rf"$V_{{ss}}$ ({axis.unit})"
    _finish(above, below, title, "command (%)", "error (%)")


def plot_steps(figure: Figure, results: Identification, result: AxisResult) -> None:
    """Plot the size of the velocity after up to four steps of the command from rest, with the measured points."""
    tested = sorted({round(abs(p.command), 6) for p in result.points})
    steps = []
    for command in evenly(tested):
        here = [p for p in result.points if round(abs(p.command), 6) == command]
        V_ss, Tau = ([abs(p.value) for p in here if p.quantity == quantity] for quantity in ("V_ss", "Tau"))
        steps.append(Step(command, V_ss, Tau))
    ax: Axes = figure.subplots()
    draw_steps(ax, result.axis, steps, [(results.vehicle.rov, "-")])
    with_formulas(ax.set_title(f"Steps: ${result.axis.velocity}$ ({result.axis.unit})", loc="left"))


def plot_known(figure: Figure, found: Sequence[Known]) -> None:
    """Plot the intervals of coefficients relative to their values. An arrow marks an interval beyond the plot."""
    ax: Axes = figure.subplots()
    ends = [abs(log(max(end, 1.0 / _WIDEST))) for k in found for end in k.relative or ()]
    reach = min(max([1.15 * end for end in ends], default=0.0), log(_WIDEST)) or log(_WIDEST)
    for row, k in enumerate(found):
        low, high = (log(max(end, 1e-9)) for end in k.relative or (0.0, 1e9))
        color = LIGHT["blue"] if max(-low, high) <= reach else LIGHT["orange"]
        dashes = (0, (1.0, 1.0)) if k.relative is None else "-"
        ax.plot(
            [max(low, -reach), min(high, reach)],
            [row, row],
            color=color,
            linewidth=6.0,
            alpha=0.4,
            linestyle=dashes,
            solid_capstyle="butt",
            dash_capstyle="butt",
        )
        for is_beyond, at, arrow in ((-low > reach, -reach, "<"), (high > reach, reach, ">")):
            if is_beyond:
                ax.plot([at], [row], arrow, color=color, markersize=6.0, clip_on=False)
        if k.relative:
            ax.plot([0.0], [row], "o", color=color, markersize=4.5)
    ax.axvline(0.0, color=LIGHT["muted"], linewidth=0.8, zorder=0)
    ticks = [0.0, *_ticks(_TICKS, reach), *_ticks([-t for t in _TICKS if t < 1.0], reach)]
    ax.set_xticks([log(1.0 + t) for t in ticks], [text(100.0 * t, "+g") + " %" if t else "value" for t in ticks])
    ax.set_yticks(range(len(found)), [k.name for k in found])
    ax.set(xlim=(-reach, reach), ylim=(len(found) - 0.4, -0.6))
    ax.tick_params(axis="y", labelcolor=LIGHT["ink"])


def _ticks(sizes: Sequence[float], reach: float) -> Iterator[float]:
    """Yield the outermost tick within reach. There is no room for more ticks."""
    within = [size for size in sizes if abs(log(1.0 + size)) <= reach]
    yield from within[-1:]


def _band(ax: Axes, x: Array, low: Array, high: Array, color: str) -> None:
    """Draw a 95 % band if it is finite."""
    if np.isfinite(low).all() and np.isfinite(high).all():
        ax.fill_between(x, low, high, color=LIGHT[color], alpha=0.18, linewidth=0.0, label="95 %")


def _finish(above: Axes, below: Axes | None, title: str, x: str, y: str) -> None:
    """Add title, labels and legend."""
    with_formulas(above.set_title(title, loc="left"))
    (below or above).set_xlabel(x)
    above.locator_params(nbins=6)
    if below:
        finish_residuals(below, y)
    above.legend(loc="best")


def _dots(ax: Axes, x: Array, y: Array, counts: Flags, label: str = "") -> None:
    """Draw points: those that count are filled, those of weight 0 are hollow."""
    for which, face, name in ((counts, LIGHT["orange"], label), (~counts, "none", label and f"{label}, weight 0")):
        if which.any():
            ax.plot(
                x[which],
                y[which],
                "o",
                color=LIGHT["orange"],
                markerfacecolor=face,
                markersize=4.5,
                zorder=5,
                label=name or None,
            )


def _bars(ax: Axes, x: Array, y: Array, errors: Array) -> None:
    """Draw the intervals of points whose error is known."""
    if (there := errors > 0.0).any():
        ax.errorbar(x[there], y[there], errors[there], fmt="none", ecolor=LIGHT["orange"], elinewidth=1.1, capsize=2.0)


def _diamonds(ax: Axes, x: Array, y: Array) -> None:
    """Draw the leave-one-thrust-out predictions or residuals."""
    ax.plot(x, y, "D", color=LIGHT["violet"], markerfacecolor="none", markersize=4.0, zorder=4)
