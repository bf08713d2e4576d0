"""documentation/index.html: one page that stands alone, with the numbers and plots of the vehicle it is about."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from decimal import ROUND_DOWN, Decimal
from functools import partial
from itertools import groupby
from math import isfinite
from typing import Any

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.export.archive import REPORT
from rov_fmu.export.interface import Variable, variables
from rov_fmu.motion.rov import AXES, Axis, Coefficients, Inputs, State, step
from rov_fmu.pages.plots import draw_steps, evenly, finish, measured_step
from rov_fmu.pages.svg import LIGHT, inline_file, inline_svg, svg_file
from rov_fmu.pages.templates import page
from rov_fmu.vehicle.published import Cell, ResponseTable, load_tables, untuned
from rov_fmu.vehicle.vehicle import Vehicle

_PANEL = (3.7, 2.9)  # inches


# ---- The page ------------------------------------------------------------------------------------------------------


def documentation(vehicle: Vehicle, *, native: bool) -> dict[str, bytes]:
    """The page by its path in the FMU. Raises FileError."""
    text = documentation_page(vehicle, variables(vehicle.coefficients), native=native)
    return {"documentation/index.html": text.encode()}


def documentation_page(vehicle: Vehicle, variables: tuple[Variable, ...], *, native: bool = True) -> str:
    """The page of a vehicle as HTML, of the native FMU or the one in pure Python.

    Without a data folder it goes without tables and measurements.
    """
    tables = tables_by_axis(vehicle)
    commands = _commands(vehicle, tables.values())
    steady, steps = (
        [_plot(f"{label}: {name}", partial(draw, axis=axis, table=tables.get(name))) for name, axis in AXES.items()]
        for label, draw in (
            ("V_ss over the command", partial(plot_steady, vehicle=vehicle)),
            ("Step responses", partial(plot_steps, k=vehicle.coefficients, commands=commands)),
        )
    )
    return page(
        "index.html.j2",
        vehicle=vehicle,
        native=native,
        report=REPORT if vehicle.provenance and vehicle.provenance.report else None,
        groups=[list(group) for _, group in groupby(variables, lambda v: (v.causality, v.variability, v.initial))],
        values=asdict(vehicle.coefficients),
        reversing=_reversing,
        tables=[(table, _agreement(table)) for table in tables.values()],
        moved=step(vehicle.coefficients, Inputs(u_l=0.3, u_r=0.3), State(), 10.0),
        held=commands,
        frames=[
            inline_file("The vehicle from above: x forward, y to starboard", vehicle.picture("from_above.svg")),
            inline_file("The vehicle from starboard: x forward, z down", vehicle.picture("from_starboard.svg")),
        ],
        steady=steady,
        steps=steps,
    )


def tables_by_axis(vehicle: Vehicle) -> dict[str, ResponseTable]:
    """The published tables of a vehicle by axis, none without a data folder. Raises DataFileError."""
    return {table.axis.name: table for table in load_tables(vehicle)} if vehicle.data else {}


def _commands(vehicle: Vehicle, tables: Iterable[ResponseTable]) -> list[Decimal]:
    """Up to four commands (%) for the step responses: those that all tables hold, else across the range."""
    rows = [{row.command for row in table.rows} for table in tables]
    common = sorted(set.intersection(*rows)) if rows else []
    if len(common) < 2:
        low, high = (max(1, round(100.0 * end)) for end in vehicle.command_range)
        common = [Decimal(c) for c in range(low, high + 1)]
    return evenly(common)


def _agreement(table: ResponseTable) -> dict[str, Any]:
    """How many cells are printed, as computed and rounded, or as computed and cut off; the farthest and its place."""
    cells = [
        (cell, f"{model} {quantity}", row.command)
        for row in table.rows
        for model, response in (("non-linear", row.non_linear), ("scaled", row.scaled))
        for quantity, cell in (("V_ss", response.V_ss), ("Tau", response.Tau))
        if cell.printed is not None
    ]
    return {
        "printed": len(cells),
        "rounded": sum(cell.rounds_to_printed for cell, *_ in cells),
        "cut_off": sum(_is_cut_off(cell) for cell, *_ in cells),
        "farthest": max(cells, key=lambda c: abs(c[0].from_printed or 0.0), default=None),
    }


def _is_cut_off(cell: Cell) -> bool:
    if cell.printed is None or cell.rounds_to_printed or not isfinite(cell.computed):
        return False
    return Decimal(cell.computed).quantize(cell.printed, ROUND_DOWN) == cell.printed


def _reversing(values: Mapping[str, float]) -> list[tuple[str, float]]:
    """Thrust curves a_t |c| c + b_t c that point backward at small commands, and the command at which they turn."""
    curves = [(name.removeprefix("a_t_"), a, values.get(f"b_t_{name.removeprefix('a_t_')}", 0.0))
              for name, a in values.items() if name.startswith("a_t_")]  # fmt: skip
    return [(thruster, -b / a) for thruster, a, b in curves if b < 0.0 < a]


# ---- Plots ---------------------------------------------------------------------------------------------------------


def plot_steady(ax: Axes, vehicle: Vehicle, axis: Axis, table: ResponseTable | None) -> None:
    """V_ss over the command: both models, the measured points, and the range of the identification."""
    low, high = (100.0 * end for end in vehicle.command_range)
    ax.axvspan(low, high, label="identified range", facecolor=LIGHT["band"], edgecolor="none", zorder=0)
    commands = range(0, 101, 2)
    for label, k, color, dashes in (
        ("non-linear, α = β = 1", untuned(vehicle.coefficients), "grey", "--"),
        ("scaled, tuned α and β", vehicle.coefficients, "blue", "-"),
    ):
        V_ss = [axis.response(k, c / 100.0)[0] for c in commands]
        ax.plot(commands, V_ss, dashes, label=label, color=LIGHT[color], linewidth=1.8)
    if table and table.steady:
        points = [(float(c), float(V)) for c, V in table.steady.items()]
        ax.plot(*zip(*points, strict=True), "o", label="measured", color=LIGHT["orange"], markersize=5.0, zorder=5)
    finish(ax, rf"{axis.name.capitalize()}: $V_{{ss}}$ ({axis.unit})", "command (%)")
    ax.set_xlim(0, 100)


def plot_steps(ax: Axes, k: Coefficients, axis: Axis, commands: Sequence[Decimal], table: ResponseTable | None) -> None:
    """Velocity after steps of the command from rest, with the measured V_ss and Tau."""
    draw_steps(ax, axis, [measured_step(table, c) for c in commands], [(k, "-")])
    ax.set_title(f"{axis.name.capitalize()}: ${axis.velocity}$ ({axis.unit})", loc="left")


def steady_picture(vehicle: Vehicle) -> str:
    """V_ss of the three axes side by side as an SVG file."""
    tables = tables_by_axis(vehicle)

    def draw(figure: Figure) -> None:
        for ax, axis in zip(figure.subplots(1, 3), AXES.values(), strict=True):
            plot_steady(ax, vehicle, axis, tables.get(axis.name))

    return svg_file(draw, (3 * _PANEL[0], _PANEL[1]), salt="steady") + "\n"


def _plot(label: str, draw: Callable[[Axes], None]) -> Markup:
    return inline_svg(label, lambda figure: draw(figure.subplots()), _PANEL)
