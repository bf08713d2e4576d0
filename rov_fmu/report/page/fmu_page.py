"""documentation/index.html: one page that stands alone, with the numbers and plots of the vehicle it is about."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Decimal
from functools import partial
from itertools import chain, groupby
from math import isclose, isfinite
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.engine.simulation import simulate
from rov_fmu.fmu.archive import REPORT
from rov_fmu.fmu.reference_results import TOLERANCE
from rov_fmu.fmu.variables import variables
from rov_fmu.model.layout import ARM, Axis, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.report.page import equations
from rov_fmu.report.page.live import Flown, live
from rov_fmu.report.page.pictures import pictures
from rov_fmu.report.plots.drawing import draw_thrusters, scenes
from rov_fmu.report.plots.steps import (
    Step,
    draw_curve,
    draw_steps,
    finish,
    held_commands,
    measured_step,
    tables_by_axis,
)
from rov_fmu.report.plots.svg import LIGHT, image, inline_svg, svg_file
from rov_fmu.report.templates import page
from rov_fmu.vehicle.published import Cell, ResponseTable, untuned
from rov_fmu.vehicle.vehicle import Vehicle

_PANEL = (3.7, 2.9)  # inches
_FRAMES = {
    "from_above.svg": "The vehicle from above: x forward, y to starboard",
    "from_starboard.svg": "The vehicle from starboard: x forward, z down",
}


# ---- The page ------------------------------------------------------------------------------------------------------


def documentation(vehicle: Vehicle, *, native: bool, fmi: int = 2, module: bytes | None = None) -> dict[str, bytes]:
    """The page and the pictures by their path in the FMU. Raises FileError."""
    text = documentation_page(vehicle, native=native, fmi=fmi, module=module)
    return {"documentation/index.html": text.encode(), **pictures(vehicle.rov)}


def documentation_page(vehicle: Vehicle, *, native: bool = True, fmi: int = 2, module: bytes | None = None) -> str:
    """The page of a vehicle as HTML, of the native FMU in a version of FMI or the one in pure Python.

    `module`: the model as WebAssembly; without it nothing flies.

    Without a data folder it goes without tables and measurements.
    """
    rov, layout = vehicle.rov, vehicle.layout
    tables = tables_by_axis(vehicle)
    held = held_commands(vehicle, tables.values())
    axes = [form.axis for form in layout.axes]
    first = axes[0]
    start = {name: 0.3 * sign for name, sign in layout.signs(first).items()}
    rest = dict.fromkeys([*layout.inputs, *layout.state], 0.0)
    own = [(label, path) for name, label in _FRAMES.items() if (path := vehicle.picture(name))]
    return page(
        "index.html.j2",
        vehicle=vehicle,
        layout=layout,
        is_tuned=_is_tuned(rov),
        native=native,
        fmi=fmi,
        report=REPORT if vehicle.provenance and vehicle.provenance.report else None,
        groups=[list(group) for _, group in groupby(variables(rov), lambda v: (v.causality, v.variability, v.initial))],
        reversing=_reversing,
        equations=equations.of(layout),
        mathml=equations.MathML(layout),
        choices=equations.choices,
        mirrored=_mirrored(layout),
        has={*chain(*(form.keys for form in layout.axes), *(curve.keys for curve in layout.curves))},
        unplaced=[t.name for t in layout.thrusters if t.position is None and not t.arm],
        arm=[rov[name] for name in ARM] if layout.has_arm else None,
        live=live([Flown(vehicle, module)]) if module else None,
        tables=[(table, _agreement(table)) for table in tables.values()],
        start=start,
        tolerance=f"{TOLERANCE:g}",
        first=first,
        moved=float(simulate(rov, np.array([0.0, 10.0]), start, [first.velocity]).values[0, 0, -1]),
        moves_at_rest=any(rov.derivatives(rest, rest).values()),
        held=held,
        motions=[motion for axis in axes for motion in _motions(rov, axis, held)],
        frames=[image(label, path) for label, path in own],
        thrusters=[
            inline_svg(f"Thrusters {view}", partial(_draw, partial(draw_thrusters, rov=rov, scene=scene)), scene.inches)
            for view, scene in scenes(rov).items()
        ],
        curves=[_plot(f"Thrust curve: {c.name}", partial(draw_curve, rov=rov, curve=c)) for c in layout.curves],
        steady=[
            _plot(
                f"V_ss over the command: {a.name}",
                partial(plot_steady, vehicle=vehicle, axis=a, table=tables.get(a.name)),
            )
            for a in axes
        ],
        steps=[
            _plot(
                f"Step responses: {a.name}",
                partial(plot_steps, rov=rov, axis=a, commands=held, table=tables.get(a.name)),
            )
            for a in axes
        ],
    )


@dataclass(frozen=True)
class Motion:
    """What held commands come to, along one axis and in one direction."""

    axis: Axis
    way: str
    """In words where the two directions differ."""
    signs: Mapping[str, float]
    responses: Sequence[tuple[float, float]]
    """V_ss and Tau for each command."""
    beside: Sequence[tuple[Axis, float]]
    """Other axes that the last command pushes too, and the force or torque."""


def _motions(rov: Rov, axis: Axis, commands: Sequence[Decimal]) -> Iterator[Motion]:
    two = differs_by_direction(rov, axis)
    for sign, way in ((1.0, axis.positive), (-1.0, axis.negative))[: 1 + two]:
        signs = {name: sign * of for name, of in rov.layout.signs(axis).items()}
        responses = [rov.response(axis, sign * float(c) / 100.0) for c in commands]
        last = sign * float(commands[-1]) / 100.0
        yield Motion(axis, f" {way}" if two else "", signs, responses, list(_beside(rov, axis, last)))


def _beside(rov: Rov, axis: Axis, command: float) -> Iterator[tuple[Axis, float]]:
    """The other axes that the commands of one push, as where thrust in reverse is weaker."""
    F = rov.commanded(rov.held_inputs(axis, command))
    for other in (form.axis for form in rov.layout.axes if form.axis is not axis):
        pushes = [rov.effect(t, other) * F[t.name] for t in rov.layout.drivers(other)]
        if abs(sum(pushes)) > 1e-3 * sum(map(abs, pushes)):
            yield other, sum(pushes)


def differs_by_direction(rov: Rov, axis: Axis) -> bool:
    """Whether a negative command gives another motion than the mirror image of the positive one."""
    for c in (0.1, 0.3, 0.6, 1.0):
        (V, Tau), (back, Tau_back) = rov.response(axis, c), rov.response(axis, -c)
        if not (isclose(V, -back, rel_tol=1e-9) and isclose(Tau, Tau_back, rel_tol=1e-9)):
            return True
    return False


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


def _reversing(layout: Layout, values: Mapping[str, float]) -> list[tuple[str, float]]:
    """Thrust curves that point backward at small commands, and the command at which they turn."""
    found = []
    for curve in layout.curves:
        for end, words in (("", ""), ("_reverse", " in reverse")):
            a, b = (values.get(curve.coefficient(key + end), 0.0) for key in ("a_t", "b_t"))
            if b < 0.0 < a and f"a_t{end}" in curve.keys:
                dead = values.get(curve.coefficient("c_0" + end), 0.0) if "c_0" in curve.keys else 0.0
                found.append((f"{curve.name} thrust{words}", dead - b / a))
    return found


def _mirrored(layout: Layout) -> str:
    """Which thrust and drag are in reverse the mirror image of forward."""
    found = []
    for what, of, same, n in (
        ("thrust", "of curve", [c.name for c in layout.curves if "a_t_reverse" not in c.keys], len(layout.curves)),
        ("drag", "in", [f.axis.name for f in layout.axes if "a_d_reverse" not in f.keys], len(layout.axes)),
    ):
        if same:
            found.append(what if len(same) == n else f"{what} {of} {', '.join(same)}")
    return " and ".join(found)


def _is_tuned(rov: Rov) -> bool:
    return any(rov[name] != 1.0 for name, meta in rov.layout.coefficients.items() if meta.tunable)


# ---- Plots ---------------------------------------------------------------------------------------------------------


def plot_steady(ax: Axes, vehicle: Vehicle, axis: Axis, table: ResponseTable | None) -> None:
    """V_ss over the command: with and without tuning, the measured points, the range they hold for."""
    rov, (low, high) = vehicle.rov, (100.0 * end for end in vehicle.command_range)
    least = -100 if differs_by_direction(rov, axis) else 0
    ax.axvspan(low, high, label="range of the model", facecolor=LIGHT["band"], edgecolor="none", zorder=0)
    if least:
        ax.axvspan(-high, -low, facecolor=LIGHT["band"], edgecolor="none", zorder=0)
    commands = range(least, 101, 2)
    models = [("tuned α and β", rov, "blue", "-")]
    if _is_tuned(rov):
        models.insert(0, ("α = β = 1", untuned(rov), "grey", "--"))
    for label, model, color, dashes in models:
        V_ss = [model.response(axis, c / 100.0)[0] for c in commands]
        name = label if len(models) > 1 else None
        ax.plot(commands, V_ss, dashes, label=name, color=LIGHT[color], linewidth=1.8)
    if table and table.steady:
        points = [(float(c), float(V)) for c, V in table.steady.items()]
        ax.plot(*zip(*points, strict=True), "o", label="measured", color=LIGHT["orange"], markersize=5.0, zorder=5)
    finish(ax, rf"{axis.name.capitalize()}: $V_{{ss}}$ ({axis.unit})", "command (%)")
    ax.set_xlim(least, 100)


def plot_steps(ax: Axes, rov: Rov, axis: Axis, commands: Sequence[Decimal], table: ResponseTable | None) -> None:
    """Velocity after steps of the command from rest, with the measured V_ss and Tau."""
    steps = [measured_step(table, c) for c in commands]
    if differs_by_direction(rov, axis):
        steps += [Step(-step.command) for step in steps]
    draw_steps(ax, axis, steps, [(rov, "-")])
    ax.set_title(f"{axis.name.capitalize()}: ${axis.velocity}$ ({axis.unit})", loc="left")


def steady_picture(vehicle: Vehicle) -> str:
    """V_ss of all axes side by side as an SVG file."""
    tables, axes = tables_by_axis(vehicle), [form.axis for form in vehicle.layout.axes]

    def draw(figure: Figure) -> None:
        for ax, axis in zip(figure.subplots(1, len(axes), squeeze=False)[0], axes, strict=True):
            plot_steady(ax, vehicle, axis, tables.get(axis.name))

    return svg_file(draw, (len(axes) * _PANEL[0], _PANEL[1]), salt="steady") + "\n"


def _draw(draw: Callable[[Axes], None], figure: Figure) -> None:
    draw(figure.subplots())


def _plot(label: str, draw: Callable[[Axes], None]) -> Markup:
    return inline_svg(label, partial(_draw, draw), _PANEL)
