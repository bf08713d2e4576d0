"""Figures 5-9 and 11 of the paper, redrawn as far as it prints their data: `rov-fmu figures docs`.

Its curves are those of the printed equations. Of the points only V_ss and Tau are printed (Tables 3-7); the force at a
measured velocity is that of the thrust curve, (11)-(13). The forces behind the thrust curves (Figures 4-6) and every
recording (Figures 3, 10, 11) are not printed, and not drawn.
"""

from decimal import Decimal
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.files.output import Output, write_whole
from rov_fmu.identify.quadratic_fit import fit_quadratic
from rov_fmu.motion.rov import SURGE
from rov_fmu.pages.fmu_page import steady_picture
from rov_fmu.pages.plots import draw_steps, measured_step
from rov_fmu.pages.svg import LIGHT, svg_file
from rov_fmu.vehicle.published import ResponseTable, load_tables, untuned
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

NAME = "paper_figures.svg"
_SIZE = (11.1, 9.6)  # inches
_STEPS = (30, 50, 70)  # %
_NOT_PRINTED = (
    "Not printed in the paper, so not drawn:",
    "• Figure 4 (reverse thrust)",
    "• the forces behind Figures 5 and 6",
    "• the recordings of Figure 11",
    "• Tau of surge (Table 8)",
)


def write_figures(folder: Path) -> list[Path]:
    """Write the figures as one SVG file, and V_ss of the three axes as another. Raises WriteError."""
    vehicle = load_vehicle(VIDEORAY)
    pictures = {
        NAME: svg_file(partial(_draw, vehicle=vehicle), _SIZE, salt=NAME) + "\n",
        f"{vehicle.identifier}.svg": steady_picture(vehicle),
    }
    outputs = [Output(folder / name, text.encode()) for name, text in pictures.items()]
    write_whole(*outputs)
    return [output.path for output in outputs]


def _draw(figure: Figure, vehicle: Vehicle) -> None:
    tables = {table.axis.name: table for table in load_tables(vehicle)}
    panels = figure.subplots(3, 3)
    _rear_thrust(panels[0, 0], vehicle)
    _top_thrust(panels[0, 1], vehicle)
    _notes(panels[0, 2])
    for ax, (number, axis, equation) in zip(
        panels[1], ((7, "surge", "(14)"), (8, "heave", "(15)"), (9, "yaw", "(16)")), strict=True
    ):
        _drag(ax, vehicle, tables[axis], f"Figure {number}: {axis} drag", equation)
    for ax, (title, axis) in zip(
        panels[2],
        (("Figure 11a: heave", "heave"), ("Figure 11b: yaw", "yaw"), ("Surge, likewise: not in the paper", "surge")),
        strict=True,
    ):
        _steps(ax, vehicle, tables[axis], title)


def _rear_thrust(ax: Axes, vehicle: Vehicle) -> None:
    k, other = vehicle.coefficients, vehicle.alternatives["unweighted_rear_thrust"].values
    _curve(ax, 100.0, (0.0, 1.0), other["a_t_rear"], other["b_t_rear"], "--", "grey", "all points (8)")
    _curve(ax, 100.0, (0.0, 1.0), k.a_t_rear, k.b_t_rear, "-", "blue", "weighted (9)")
    _finish(ax, "Figure 5: forward thrust", "command (%)", "$F_l + F_r$ (N)")


def _top_thrust(ax: Axes, vehicle: Vehicle) -> None:
    k = vehicle.coefficients
    _curve(ax, 100.0, (0.0, 1.0), k.a_t_top, k.b_t_top, "-", "blue", "(10)")
    _finish(ax, "Figure 6: downward thrust", "command (%)", "$F_t$ (N)")


def _notes(ax: Axes) -> None:
    ax.set_axis_off()
    ax.text(0.0, 0.92, "\n".join(_NOT_PRINTED), transform=ax.transAxes, va="top", linespacing=1.7, color=LIGHT["muted"])


def _drag(ax: Axes, vehicle: Vehicle, table: ResponseTable, title: str, equation: str) -> None:
    axis, k = table.axis, vehicle.coefficients
    names = (axis.coefficient("a_d"), axis.coefficient("b_d"))
    v = np.array([float(V) for V in table.steady.values()])
    force = np.array([axis.force(k, float(c) / 100.0) for c in table.steady])
    free = fit_quadratic(names, v, force).unbounded
    end = 1.1 * float(v.max())
    _curve(ax, 1.0, (0.0, end), *free, "--", "grey", "least squares of the points")
    _curve(ax, 1.0, (0.0, end), getattr(k, names[0]), getattr(k, names[1]), "-", "blue", equation)
    ax.plot(v, force, "o", color=LIGHT["orange"], markersize=4.5, zorder=5, label=f"Table {table.steady_number}")
    _finish(ax, title, f"${axis.velocity}$ ({axis.unit})", "torque (N·m)" if axis.load == "N.m" else "force (N)")


def _steps(ax: Axes, vehicle: Vehicle, table: ResponseTable, title: str) -> None:
    axis, k = table.axis, vehicle.coefficients
    draw_steps(ax, axis, [measured_step(table, Decimal(command)) for command in _STEPS], [(untuned(k), "--"), (k, "-")])
    if axis is not SURGE:  # there it would stand in the way
        for look, label in (("--", "non-linear"), ("-", "scaled"), (":", "measured $V_{ss}$"), ("o", "measured $Tau$")):
            ax.plot([], [], look, color=LIGHT["muted"], markersize=5.0, label=label)
    end = ax.get_xlim()[1]
    _finish(ax, title, "time (s)", f"${axis.velocity}$ ({axis.unit})", where="lower right")
    ax.set_xlim(0.0, end)


def _curve(
    ax: Axes, scale: float, ends: tuple[float, float], a: float, b: float, dashes: str, color: str, label: str
) -> None:
    x = np.linspace(*ends, 61)
    ax.plot(scale * x, a * np.abs(x) * x + b * x, dashes, color=LIGHT[color], linewidth=1.8, label=label)


def _finish(ax: Axes, title: str, x: str, y: str, where: str = "upper left") -> None:
    ax.set(xlabel=x, ylabel=y)
    ax.set_xlim(left=0.0)
    if ax.dataLim.y0 >= 0.0:
        ax.set_ylim(bottom=0.0)
    ax.locator_params(nbins=6)
    ax.set_title(title, loc="left")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc=where)
