"""documentation/index.html: one page that stands alone, with the numbers and plots of the vehicle it is about.

`python -m fmu_src.documentation docs` draws the picture of the README anew.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from decimal import ROUND_DOWN, Decimal
from functools import partial
from itertools import groupby
from math import ceil, e, isfinite
from pathlib import Path

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from models.dynamics import COEFFICIENTS, Coefficients, Inputs, State, axes, step
from models.figures import LIGHT, PALETTE, inline_svg, svg_file
from models.pages import RAISED, environment, pretty_unit
from models.tables import EXPERIMENTS, Cell, Experiment, ResponseTable, load_tables, untuned
from models.vehicle import VIDEORAY, Alternative, Vehicle, load_vehicle

from . import icon
from .interface import Variable

_STEPS = ("teal", "blue", "violet", "orange")
_PANEL, _FRAME = (3.7, 2.9), (3.7, 2.45)  # inches
_SHOWN = sorted(EXPERIMENTS, key=lambda x: "uwr".index(x.velocity))
REPORT = "identification.html"
"""Beside the page, where the vehicle file names a report."""
_P = 1.0 - 1.0 / e  # of V_ss, reached after Tau (17)


# ---- The page ------------------------------------------------------------------------------------------------------


def documentation_page(vehicle: Vehicle, variables: tuple[Variable, ...], *, native: bool = True) -> str:
    """The page of a vehicle as HTML, of the native FMU or the one in pure Python.

    Without a data folder it goes without tables and measurements.
    """
    tables = load_tables(vehicle) if vehicle.data else ()
    measured = _by_axis(tables)
    commands = _commands(vehicle, tables)
    templates = environment("fmu_src", number=number, unit=pretty_unit, percent=percent, fixed=fixed)
    return templates.get_template("index.html.j2").render(
        vehicle=vehicle,
        native=native,
        report=REPORT if vehicle.provenance and vehicle.provenance.report else None,
        groups=[list(group) for _, group in groupby(variables, lambda v: (v.causality, v.variability, v.initial))],
        coefficients=[(name, meta, getattr(vehicle.coefficients, name)) for name, meta in COEFFICIENTS.items()],
        alternatives=[_alternative(a) for a in vehicle.alternatives.values()],
        reversing=_reversing(asdict(vehicle.coefficients)),
        palette=PALETTE,
        tables=[(table, _agreement(table)) for table in tables],
        moved=step(vehicle.coefficients, Inputs(u_l=0.3, u_r=0.3), State(), 10.0),
        manoeuvres=[_manoeuvre(vehicle, x, commands) for x in _SHOWN],
        frames=[
            _plot("The vehicle from above: x forward, y to starboard", frame_from_above, _FRAME),
            _plot("The vehicle from starboard: x forward, z down", frame_from_starboard, _FRAME),
        ],
        steady=[
            _plot(
                f"V_ss over the command: {x.axis}",
                partial(plot_steady, vehicle=vehicle, x=x, table=measured.get(x.axis)),
            )
            for x in _SHOWN
        ],
        steps=[
            _plot(
                f"Step responses: {x.axis}",
                partial(plot_steps, k=vehicle.coefficients, x=x, commands=commands, table=measured.get(x.axis)),
            )
            for x in _SHOWN
        ],
    )


def number(value: float | None) -> str:
    """A number of a table: exact where it is short, powers of ten where it is long."""
    if value is None:
        return ""
    text = f"{value:.6g}" if len(repr(value)) > 9 else repr(value).removesuffix(".0")
    mantissa, _, exponent = (f"{value:g}" if abs(value) >= 1e5 else text).partition("e")
    if exponent:
        mantissa = {"1": "", "-1": "-"}.get(mantissa, f"{mantissa}·")
        text = f"{mantissa}10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", "−")


def fixed(value: float, digits: int) -> str:
    """A number with so many decimals."""
    return f"{value:.{digits}f}".replace("-", "−").replace("inf", "∞")


def percent(value: float | None) -> str:
    """A deviation, signed."""
    return "" if value is None else f"{100.0 * value:+.1f} %".replace("-", "−").replace("inf", "∞")


def _by_axis(tables: Iterable[ResponseTable]) -> dict[str, ResponseTable]:
    return {table.axis: table for table in tables}


def _commands(vehicle: Vehicle, tables: Iterable[ResponseTable]) -> list[Decimal]:
    """Up to four commands (%) for the step responses: those that all tables hold, else across the range."""
    rows = [{row.command for row in table.rows} for table in tables]
    common = sorted(set.intersection(*rows)) if rows else []
    if len(common) < 2:
        low, high = (max(1, round(100.0 * end)) for end in vehicle.command_range)
        common = [Decimal(c) for c in range(low, high + 1)]
    last = len(_STEPS) - 1
    return sorted({common[round((len(common) - 1) * n / last)] for n in range(last + 1)})


@dataclass(frozen=True)
class _Agreement:
    """How the printed cells of a table compare with the computed ones."""

    printed: int
    rounded: int
    """Printed as computed, rounded to the printed digits."""
    cut_off: int
    """Not that, but the computed digits without rounding."""
    farthest: tuple[Cell, str, Decimal] | None
    """Cell, what it is, and its command."""


def _agreement(table: ResponseTable) -> _Agreement:
    cells = [
        (cell, f"{model} {quantity}", row.command)
        for row in table.rows
        for model, response in (("non-linear", row.non_linear), ("scaled", row.scaled))
        for quantity, cell in (("V_ss", response.V_ss), ("Tau", response.Tau))
        if cell.printed is not None
    ]
    farthest = max(cells, key=lambda c: abs(c[0].from_printed or 0.0), default=None)
    rounded = sum(cell.rounds_to_printed for cell, *_ in cells)
    cut_off = sum(_is_cut_off(cell) for cell, *_ in cells)
    return _Agreement(len(cells), rounded, cut_off, farthest)


def _is_cut_off(cell: Cell) -> bool:
    if cell.printed is None or cell.rounds_to_printed or not isfinite(cell.computed):
        return False
    return Decimal(cell.computed).quantize(cell.printed, ROUND_DOWN) == cell.printed


@dataclass(frozen=True)
class _Manoeuvre:
    """What a held command does."""

    experiment: Experiment
    commands: str
    responses: Sequence[tuple[Decimal, float, float]]
    """Command (%), V_ss and Tau."""


def _manoeuvre(vehicle: Vehicle, x: Experiment, commands: Iterable[Decimal]) -> _Manoeuvre:
    held = ", ".join(f"{name} = {'−' if sign < 0 else ''}c" for name, sign in x.signs.items())
    return _Manoeuvre(x, held, [(c, *x.response(vehicle.coefficients, c)) for c in commands])


@dataclass(frozen=True)
class _Alternative:
    description: str
    values: Mapping[str, float]
    reversing: Sequence[tuple[str, float]]


def _alternative(alternative: Alternative) -> _Alternative:
    return _Alternative(alternative.description, alternative.values, _reversing(alternative.values))


def _reversing(values: Mapping[str, float]) -> list[tuple[str, float]]:
    """Thrust curves a_t |c| c + b_t c that point backward at small commands, and the command at which they turn."""
    curves = [(name.removeprefix("a_t_"), a, values.get(f"b_t_{name.removeprefix('a_t_')}", 0.0))
              for name, a in values.items() if name.startswith("a_t_")]  # fmt: skip
    return [(thruster, -b / a) for thruster, a, b in curves if b < 0.0 < a]


# ---- Plots ---------------------------------------------------------------------------------------------------------


def plot_steady(ax: Axes, vehicle: Vehicle, x: Experiment, table: ResponseTable | None) -> None:
    """V_ss over the command: both models, the measured points, and the range of the identification."""
    low, high = (100.0 * end for end in vehicle.command_range)
    ax.axvspan(low, high, label="identified range", facecolor=LIGHT["band"], edgecolor="none", zorder=0)
    commands = range(0, 101, 2)
    for label, k, color, dashes in (
        ("non-linear, α = β = 1", untuned(vehicle.coefficients), "grey", "--"),
        ("scaled, tuned α and β", vehicle.coefficients, "blue", "-"),
    ):
        V_ss = [x.response(k, Decimal(c))[0] for c in commands]
        ax.plot(commands, V_ss, dashes, label=label, color=LIGHT[color], linewidth=1.8)
    if table and table.steady:
        points = [(float(c), float(V)) for c, V in table.steady.items()]
        ax.plot(*zip(*points, strict=True), "o", label="measured", color=LIGHT["orange"], markersize=5.0, zorder=5)
    _scale(ax, 100, "command (%)")
    ax.set_title(rf"{x.axis.capitalize()}: $V_{{ss}}$ ({x.unit})", loc="left")
    ax.legend(loc="upper left")


def plot_steps(
    ax: Axes, k: Coefficients, x: Experiment, commands: Sequence[Decimal], table: ResponseTable | None
) -> None:
    """Velocity after steps of the command from rest, with the measured V_ss and Tau."""
    rows = {row.command: row.scaled for row in table.rows} if table else {}
    times = [x.response(k, c)[1] for c in commands]
    times += [float(T) for c in commands if c in rows and (T := rows[c].Tau.measured) is not None]
    end = ceil(3.3 * max((t for t in times if isfinite(t)), default=3.0))
    for role, c in zip(_STEPS, commands, strict=False):
        color = LIGHT[role]
        axis = axes(k, x.inputs(c))["uwr".index(x.velocity)]
        t = [end * (n / 45) ** 1.5 for n in range(46)]  # closer where the curve bends
        v = [0.0, *(axis.velocity(0.0, moment) for moment in t[1:])]
        ax.plot(t, v, color=color, linewidth=1.8)
        ax.text(1.015 * end, v[-1], f"{c} %", color=color, va="center", fontsize=8.5)
        V_ss, Tau = (rows[c].V_ss.measured, rows[c].Tau.measured) if c in rows else (None, None)
        if V_ss is not None:
            ax.plot([0, end], [float(V_ss)] * 2, ":", color=color, linewidth=1.2)
            if Tau is not None:
                ax.plot(float(Tau), _P * float(V_ss), "o", color=color, markersize=5.5, zorder=5)
    _scale(ax, end, "time (s)")
    ax.set_title(f"{x.axis.capitalize()}: ${x.velocity}$ ({x.unit})", loc="left")


def _scale(ax: Axes, end: int, label: str) -> None:
    ax.set(xlim=(0, end), xlabel=label)
    ax.locator_params(nbins=6)
    if ax.dataLim.y0 >= 0.0:
        ax.set_ylim(bottom=0.0)


def frame_from_above(ax: Axes) -> None:
    """The horizontal plane: x and y, surge and yaw, the rear thrusters."""
    _body_axes(ax, "$y$")
    icon.from_above(ax)
    icon.arrow(ax, (20.5, -8.0), (20.5, 8.0), color=LIGHT["ink"], bend=-0.25)
    _label(ax, 22.5, 10.0, "$ψ, r$")
    for y, name in ((-10.6, "l"), (10.6, "r")):
        icon.arrow(ax, (-1.0, y), (9.0, y), width=2.2)
        _label(ax, 12.5, y, f"$F_{name}$", icon.FORCE)


def frame_from_starboard(ax: Axes) -> None:
    """The vertical plane: x and z, surge and heave, the top thruster."""
    _body_axes(ax, "$z, w$")
    icon.from_starboard(ax)
    icon.arrow(ax, (-3.0, -18.0), (-3.0, -10.5), width=2.2)
    _label(ax, 0.5, -15.0, "$F_t$", icon.FORCE)


def _body_axes(ax: Axes, down: str) -> None:
    icon.bare(ax, (-26.0, 36.0), (22.5, -18.5))
    for tip in ((28.0, 0.0), (3.5, 18.0)):
        icon.arrow(ax, (3.5, 0.0), tip, color=LIGHT["ink"])
    _label(ax, 32.5, 0.0, "$x, u$")
    _label(ax, 3.5, 20.5, down)


def _label(ax: Axes, x: float, y: float, text: str, color: str = LIGHT["ink"]) -> None:
    ax.text(x, y, text, color=color, ha="center", va="center", fontsize=11, zorder=10)


def steady_picture(vehicle: Vehicle) -> str:
    """V_ss of the three axes side by side as an SVG file."""
    measured = _by_axis(load_tables(vehicle) if vehicle.data else ())

    def draw(figure: Figure) -> None:
        for ax, x in zip(figure.subplots(1, 3), _SHOWN, strict=True):
            plot_steady(ax, vehicle, x, measured.get(x.axis))

    return svg_file(draw, (3 * _PANEL[0], _PANEL[1]), salt="steady") + "\n"


def _plot(label: str, draw: Callable[[Axes], None], size: tuple[float, float] = _PANEL) -> Markup:
    return inline_svg(label, lambda figure: draw(figure.subplots()), size)


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the picture of the README."""
    parser = argparse.ArgumentParser(prog="python -m fmu_src.documentation", description=main.__doc__)
    parser.add_argument("folder", type=Path, help="where to write <identifier>.svg")
    vehicle = load_vehicle(VIDEORAY)
    target: Path = parser.parse_args(arguments).folder / f"{vehicle.identifier}.svg"
    target.write_text(steady_picture(vehicle), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
