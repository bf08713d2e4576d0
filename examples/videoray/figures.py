"""Draw the figures of the paper whose data it prints, for publications: python -m examples.videoray.figures FOLDER

The curves are those of the printed equations. The only printed points are V_ss and Tau (Tables 3-7); the force at a
measured velocity is that of the thrust curve, (11)-(13). The forces behind the thrust curves (Figures 4-6) and all
recordings (Figures 3, 10, 11) are not printed, so they are not drawn.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.equation.alone import RISE
from rov_fmu.equation.units import in_degrees
from rov_fmu.io.messages import listed
from rov_fmu.io.output import Output, write_whole
from rov_fmu.report.plots.steps import after_step, draw_steps, from_zero
from rov_fmu.report.plots.svg import LIGHT, LINES, add_knots, add_legend, name_axes, saved, with_even_text
from rov_fmu.report.templates import pretty_unit
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.published import ResponseTable, tables_by_axis

COLUMNS = {"single": 3.5, "double": 7.16}
"""The widths of the columns of a journal, in inches: those of the IEEE (89 and 182 mm)."""
FORMATS: dict[str, dict[str, Any]] = {
    "svg": {"metadata": {"Date": None, "Creator": None}},
    "pdf": {"metadata": {"CreationDate": None, "Creator": None, "Producer": None}},
    "png": {"metadata": {"Software": None}, "dpi": 300},
}
"""The options of Matplotlib for each format. Without dates and versions, the same figures have the same bytes."""
_EMBEDDED = {"svg.fonttype": "path", "pdf.fonttype": 42}
_TEXT_SIZE = 8.0  # points, in print
_RATIO, _WIDE_RATIO = 0.78, 0.5
"""The height of a plot divided by its width: in one column, and if a single plot fills both columns."""
_STEPS = (30, 50, 70)  # %
_PAPER = "Enevoldsen et al. (2018)"
_STEP_FIGURES = {
    "heave": ("figure_11a", ", Figure 11a"),
    "yaw": ("figure_11b", ", Figure 11b"),
    "surge": ("surge_steps", ", which shows no such figure"),
}
"""The name of the figure and its reference in the caption, by axis."""


@dataclass(frozen=True)
class PaperFigure:
    """A figure: the name of its file, its caption, and the function that draws each of its plots."""

    name: str
    caption: str
    plots: tuple[Callable[[Axes], None], ...]

    def content(self, file_format: str, column: str) -> bytes:
        """Return the figure in a format of FORMATS, as wide as a column of COLUMNS, with its fonts embedded."""
        columns = len(self.plots) if column == "double" else 1
        rows, width = len(self.plots) // columns, COLUMNS[column]
        height = rows * width / columns * (_WIDE_RATIO if column == "double" and columns == 1 else _RATIO)
        draw = with_even_text(partial(self._draw, rows=rows, columns=columns), _TEXT_SIZE)
        return saved(
            draw,
            (width, height),
            background="white",
            margin=0.04,
            salt=self.name,
            style=_EMBEDDED,
            format=file_format,
            **FORMATS[file_format],
        )

    def _draw(self, figure: Figure, rows: int, columns: int) -> None:
        for ax, plot in zip(np.ravel(figure.subplots(rows, columns)), self.plots, strict=True):
            plot(ax)
        add_legend(figure, 4 if columns > 1 or figure.get_figwidth() > COLUMNS["single"] else 2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line: write every figure into a folder, with its caption beside it as text."""
    parser = argparse.ArgumentParser(prog="python -m examples.videoray.figures", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the figures go; it is created if it does not exist")
    parser.add_argument("--format", choices=FORMATS, default="svg", help="default: %(default)s")
    parser.add_argument("--column", choices=COLUMNS, default="single", help="the width; default: %(default)s")
    parser.add_argument("--force", action="store_true", help="replace files that this command did not write")
    options = parser.parse_args(arguments)
    folder: Path = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    outputs = []
    for figure in paper_figures():
        picture = figure.content(options.format, options.column)
        outputs.append(Output(folder / f"{figure.name}.{options.format}", picture))
        outputs.append(Output(folder / f"{figure.name}.txt", f"{figure.caption}\n".encode()))
    write_whole(*outputs, force=options.force)
    print(f"Wrote {len(outputs) // 2} figures to {folder}, each with its caption in a text file beside it.")
    return 0


def paper_figures() -> Iterator[PaperFigure]:
    """Yield Figures 5 to 9 and 11 of the paper, the steps of surge, and V_ss of the paper's model and of the refit."""
    vehicle, refit = load_vehicle(VIDEORAY), load_vehicle(SHIPPED["videoray_refit"])
    k, tables = vehicle, tables_by_axis(vehicle)
    unweighted = vehicle.alternatives["unweighted_rear_thrust"].values
    yield PaperFigure(
        "figure_5",
        "Forward thrust of both rear thrusters over the command: the weighted curve (9) and the curve of all points "
        f"(8) of {_PAPER}, Figure 5. The paper does not print the measured forces.",
        (partial(_rear_thrust, k=k, unweighted=(unweighted["a_t_rear"], unweighted["b_t_rear"])),),
    )
    yield PaperFigure(
        "figure_6",
        f"Downward thrust of the top thruster over the command: curve (10) of {_PAPER}, Figure 6. The paper does not "
        "print the measured forces.",
        (partial(_top_thrust, k=k),),
    )
    for number, axis in zip((7, 8, 9), vehicle.layout.by_name, strict=True):
        table = tables[axis]
        kind = "torque" if table.axis.is_rotation else "force"
        yield PaperFigure(
            f"figure_{number}",
            f"Drag {kind} in {axis} over the steady velocity: curve {table.axis.equations[0]} of {_PAPER}, Figure "
            f"{number}, and the curve of least squares through the points. A point is a measured velocity of Table "
            f"{table.steady_number} and the {kind} that the thrust curve gives.",
            (partial(_drag, k=k, table=table),),
        )
    for axis, (name, source) in _STEP_FIGURES.items():
        yield PaperFigure(
            name,
            f"Velocity in {axis} after steps of the command to {listed(map(str, _STEPS))} %: the non-linear model "
            f"(dashed) and the scaled model (solid) of {_PAPER}{source}. Dotted: measured V_ss. "
            f"{_measured_taus(tables[axis])} The paper does not print the recordings.",
            (partial(_steps, k=k, table=tables[axis]),),
        )
    axes = [form.axis.name for form in vehicle.layout.axes]
    yield PaperFigure(
        "steady_velocity",
        f"Steady velocity over the command in {listed(axes)}: the model of {_PAPER} (dashed), the model refitted to "
        "all measured V_ss and Tau (solid), and the measured V_ss (points).",
        tuple(partial(_steady, k=k, refit=refit, table=tables[axis]) for axis in axes),
    )


def _measured_taus(table: ResponseTable) -> str:
    """Return the part of a caption about the measured time constants, of which the paper has some or none."""
    without = [command for command in _STEPS if not _measured(table, command)[1]]
    if len(without) == len(_STEPS):
        return "The paper has no measured Tau."
    missing = f"; there is none at {listed(map(str, without))} %" if without else ""
    return f"Points: measured Tau, at 63 % of the measured V_ss{missing}."


def _steady(ax: Axes, k: Vehicle, refit: Vehicle, table: ResponseTable) -> None:
    """Draw V_ss over the command along an axis: the paper's model, the refit, and the paper's measurements."""
    axis, commands = table.axis, range(0, 101, 2)
    factor, unit = in_degrees(axis.unit)
    for rov, label, dashes, color in ((k, "model of the paper", "--", "grey"), (refit, "refitted model", "-", "blue")):
        V_ss = [factor * rov.response(axis, command / 100.0)[0] for command in commands]
        ax.plot(commands, V_ss, dashes, color=LIGHT[color], linewidth=1.8, label=label)
    points = [(float(command), factor * float(V)) for command, V in table.steady.items()]
    ax.plot(*zip(*points, strict=True), "o", color=LIGHT["orange"], markersize=4.0, zorder=5, label="measured")
    name_axes(ax, f"steady {axis.name} velocity", unit, "command (%)")
    from_zero(ax)
    ax.set_xlim(0, 100)


def _rear_thrust(ax: Axes, k: Vehicle, unweighted: tuple[float, float]) -> None:
    _curve(ax, 100.0, 1.0, unweighted, "--", "grey", "thrust fitted to all points")
    _curve(ax, 100.0, 1.0, (k["a_t_rear"], k["b_t_rear"]), "-", "blue", "thrust fitted with weights")
    name_axes(ax, "thrust of both rear thrusters", "N", "command (%)")
    from_zero(ax)


def _top_thrust(ax: Axes, k: Vehicle) -> None:
    _curve(ax, 100.0, 1.0, (k["a_t_top"], k["b_t_top"]), "-", "blue", None)
    name_axes(ax, "thrust of the top thruster", "N", "command (%)")
    from_zero(ax)


def _drag(ax: Axes, k: Vehicle, table: ResponseTable) -> None:
    axis = table.axis
    factor, unit = in_degrees(axis.unit)
    v = np.array([float(V) for V in table.steady.values()])
    force = np.array([k.force(axis, float(c) / 100.0) for c in table.steady])
    end = 1.1 * float(v.max())
    through, *_ = np.linalg.lstsq(np.column_stack([v**2, v]), force, rcond=None)
    own = k[axis.coefficient("a_d")], k[axis.coefficient("b_d")]
    _curve(ax, factor, end, through, "--", "grey", "drag fitted to all points")
    _curve(ax, factor, end, own, "-", "blue", "drag of the paper")
    ax.plot(factor * v, force, "o", color=LIGHT["orange"], markersize=4.5, zorder=5, label="measured velocity")
    kind = "torque" if axis.is_rotation else "force"
    name_axes(ax, f"drag {kind}", axis.load, f"{axis.name} velocity ({pretty_unit(unit)})")
    from_zero(ax)
    if unit == "m/s":
        add_knots(ax, "x")


def _steps(ax: Axes, k: Vehicle, table: ResponseTable) -> None:
    commands = sorted(float(command) / 100.0 for command in _STEPS)
    draw_steps(ax, table.axis, commands, k)
    end, factor = ax.get_xlim()[1], in_degrees(table.axis.unit)[0]
    t = [end * (n / 45) ** 1.5 for n in range(46)]
    looks = {"--": "non-linear model", "-": "scaled model", ":": "measured steady velocity"}
    for command, role in zip(sorted(_STEPS, key=float), LINES, strict=False):
        color, (V_ss, Tau) = LIGHT[role], _measured(table, command)
        v = factor * np.array(after_step(k.untuned, table.axis, float(command) / 100.0, t))
        ax.plot(t, v, "--", color=color, linewidth=1.0)
        for V in V_ss:
            ax.plot([0, end], [factor * V, factor * V], ":", color=color, linewidth=1.2)
        if V_ss and Tau:
            at = RISE * factor * (sum(V_ss) / len(V_ss))
            ax.plot(Tau, [at] * len(Tau), "o", color=color, markersize=5.0, zorder=5)
            looks["o"] = "measured time constant"
    for look, label in looks.items():
        ax.plot([], [], look, color=LIGHT["muted"], markersize=5.0, label=label)


def _measured(table: ResponseTable, command: float | str) -> tuple[list[float], list[float]]:
    """Return the measured V_ss and Tau of a command, %."""
    rows = [row.scaled for row in table.rows if row.command == Decimal(command)]
    V_ss = [float(row.V_ss.measured) for row in rows if row.V_ss.measured is not None]
    return V_ss, [float(row.Tau.measured) for row in rows if row.Tau.measured is not None]


def _curve(
    ax: Axes, scale: float, end: float, curve: Sequence[float], dashes: str, color: str, label: str | None
) -> None:
    a, b = curve
    x = np.linspace(0.0, end, 61)
    ax.plot(scale * x, a * x**2 + b * x, dashes, color=LIGHT[color], linewidth=1.8, label=label)


if __name__ == "__main__":
    sys.exit(main())
