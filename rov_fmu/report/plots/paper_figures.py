"""Redraw Figures 5-9 and 11 of the paper as far as it prints their data: `rov-fmu figures docs`.

The curves are those of the printed equations. The only printed points are V_ss and Tau (Tables 3-7); the force at a
measured velocity is that of the thrust curve, (11)-(13). The forces behind the thrust curves (Figures 4-6) and all
recordings (Figures 3, 10, 11) are not printed, so they are not drawn.
"""

from decimal import Decimal
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.identify.points.quadratic_fit import fit_quadratic, quadratic
from rov_fmu.io.output import Output, write_whole
from rov_fmu.model.layout import SURGE
from rov_fmu.model.rov import Rov
from rov_fmu.report.plots.steps import draw_steps, finish, measured_step, tables_by_axis
from rov_fmu.report.plots.svg import LIGHT, svg_file
from rov_fmu.vehicle.published import ResponseTable, untuned
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

NAME = "paper_figures.svg"
_SIZE = (11.1, 9.6)  # inches
_STEADY_SIZE = (11.1, 2.9)  # inches
_STEPS = (30, 50, 70)  # %
_STEP_TITLES = {
    "heave": "Figure 11a: heave",
    "yaw": "Figure 11b: yaw",
    "surge": "Surge, likewise: not in the paper",
}
_NOT_PRINTED = (
    "Not printed in the paper, so not drawn:",
    "• Figure 4 (reverse thrust)",
    "• the forces behind Figures 5 and 6",
    "• the recordings of Figure 11",
    "• Tau of surge (Table 8)",
)


def write_figures(folder: Path) -> list[Path]:
    """Write an SVG file with the figures, and one with V_ss of the paper's model and of the refit; return their paths.

    Raises WriteError.
    """
    vehicle, refit = load_vehicle(VIDEORAY), load_vehicle(SHIPPED["videoray_refit"])
    steady = partial(_draw_steady, vehicle=vehicle, refit=refit.rov)
    pictures = {
        NAME: svg_file(partial(_draw, vehicle=vehicle), _SIZE, salt=NAME) + "\n",
        f"{vehicle.identifier}.svg": svg_file(steady, _STEADY_SIZE, salt="steady") + "\n",
    }
    outputs = [Output(folder / name, text.encode()) for name, text in pictures.items()]
    write_whole(*outputs)
    return [output.path for output in outputs]


def _draw_steady(figure: Figure, vehicle: Vehicle, refit: Rov) -> None:
    """Draw V_ss over the command for every axis: the paper's model, the refit, and the paper's measurements."""
    tables, commands = tables_by_axis(vehicle), range(0, 101, 2)
    models = [("paper's model", vehicle.rov, "grey", "--"), ("refit", refit, "blue", "-")]
    for ax, axis in zip(figure.subplots(1, len(tables)), (form.axis for form in vehicle.layout.axes), strict=True):
        for label, rov, color, dashes in models:
            V_ss = [rov.response(axis, command / 100.0)[0] for command in commands]
            ax.plot(commands, V_ss, dashes, label=label, color=LIGHT[color], linewidth=1.8)
        points = [(float(command), float(V)) for command, V in tables[axis.name].steady.items()]
        ax.plot(*zip(*points, strict=True), "o", label="measured", color=LIGHT["orange"], markersize=5.0, zorder=5)
        finish(ax, f"{axis.name.capitalize()}: $V_{{ss}}$ ({axis.unit})", "command (%)")
        ax.set_xlim(0, 100)


def _draw(figure: Figure, vehicle: Vehicle) -> None:
    k, other, tables = vehicle.rov, vehicle.alternatives["unweighted_rear_thrust"], tables_by_axis(vehicle)
    (rear, top, notes), drag, steps = figure.subplots(3, 3)
    unweighted = other.values["a_t_rear"], other.values["b_t_rear"]
    _curve(rear, 100.0, 1.0, unweighted, "--", "grey", "all points (8)")
    _curve(rear, 100.0, 1.0, (k["a_t_rear"], k["b_t_rear"]), "-", "blue", "weighted (9)")
    finish(rear, "Figure 5: forward thrust", "command (%)", "$F_l + F_r$ (N)")
    _curve(top, 100.0, 1.0, (k["a_t_top"], k["b_t_top"]), "-", "blue", "(10)")
    finish(top, "Figure 6: downward thrust", "command (%)", "$F_t$ (N)")
    notes.set_axis_off()
    notes.text(
        0.0, 0.92, "\n".join(_NOT_PRINTED), transform=notes.transAxes, va="top", linespacing=1.7, color=LIGHT["muted"]
    )
    for number, ax, axis in zip((7, 8, 9), drag, vehicle.layout.kinds, strict=True):
        _drag(ax, k, tables[axis], f"Figure {number}: {axis} drag")
    for ax, (axis, title) in zip(steps, _STEP_TITLES.items(), strict=True):
        _steps(ax, k, tables[axis], title)


def _drag(ax: Axes, k: Rov, table: ResponseTable, title: str) -> None:
    axis = table.axis
    names = (axis.coefficient("a_d"), axis.coefficient("b_d"))
    v = np.array([float(V) for V in table.steady.values()])
    force = np.array([k.force(axis, float(c) / 100.0) for c in table.steady])
    end = 1.1 * float(v.max())
    _curve(ax, 1.0, end, fit_quadratic(names, v, force).unbounded, "--", "grey", "least squares of the points")
    _curve(ax, 1.0, end, (k[names[0]], k[names[1]]), "-", "blue", axis.equations[0])
    ax.plot(v, force, "o", color=LIGHT["orange"], markersize=4.5, zorder=5, label=f"Table {table.steady_number}")
    finish(ax, title, f"${axis.velocity}$ ({axis.unit})", "torque (N·m)" if axis.load == "N.m" else "force (N)")


def _steps(ax: Axes, k: Rov, table: ResponseTable, title: str) -> None:
    axis = table.axis
    draw_steps(ax, axis, [measured_step(table, Decimal(command)) for command in _STEPS], [(untuned(k), "--"), (k, "-")])
    if axis is not SURGE:  # in the plot of surge the legend would hide the curves
        for look, label in (("--", "non-linear"), ("-", "scaled"), (":", "measured $V_{ss}$"), ("o", "measured $Tau$")):
            ax.plot([], [], look, color=LIGHT["muted"], markersize=5.0, label=label)
    finish(ax, title, "time (s)", f"${axis.velocity}$ ({axis.unit})", where="lower right")


def _curve(ax: Axes, scale: float, end: float, curve: tuple[float, float], dashes: str, color: str, label: str) -> None:
    x = np.linspace(0.0, end, 61)
    ax.plot(scale * x, quadratic(x) @ curve, dashes, color=LIGHT[color], linewidth=1.8, label=label)
