"""The page documentation/index.html of an FMU: one file with the numbers and plots of its vehicle."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from itertools import groupby
from math import isclose
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.c.compile import INTERFACES
from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.units import in_degrees
from rov_fmu.fmu.archive import CARD
from rov_fmu.fmu.card import card, card_text, reversing
from rov_fmu.fmu.content import REPORT
from rov_fmu.fmu.reference_results import TOLERANCE
from rov_fmu.fmu.variables import variables
from rov_fmu.report.page.equations import equations_of
from rov_fmu.report.page.live import FlyingVehicle, live
from rov_fmu.report.page.pictures import pictures
from rov_fmu.report.plots.drawing import draw_thrusters
from rov_fmu.report.plots.geometry import scenes
from rov_fmu.report.plots.steps import (
    draw_curve,
    draw_steps,
    from_zero,
    held_commands,
)
from rov_fmu.report.plots.svg import LIGHT, add_legend, image, inline_svg, name_axes, shade
from rov_fmu.report.templates import page
from rov_fmu.vehicle.steady import speed_table
from rov_fmu.vehicle.vehicle import Vehicle

_PANEL = (3.7, 2.9)  # inches
_PICTURES = {
    "from_above.svg": "The vehicle from above: x forward, y to starboard",
    "from_starboard.svg": "The vehicle from starboard: x forward, z down",
}


# ---- The page ------------------------------------------------------------------------------------------------------


def documentation(vehicle: Vehicle, **how: Any) -> dict[str, bytes]:
    """Return the page, as `documentation_page` does, and the pictures by their path in the FMU. Raises FileError."""
    return {
        "documentation/index.html": documentation_page(vehicle, **how).encode(),
        CARD: card_text(vehicle).encode(),
        **pictures(vehicle),
    }


def documentation_page(
    vehicle: Vehicle, *, native: bool = True, fmi: int = 2, interface: str = "both", module: bytes | None = None
) -> str:
    """Return the page as HTML, for the native FMU of a version of FMI or for the FMU in pure Python.

    `interface` is one of INTERFACES; the FMU in pure Python has only Co-Simulation, whatever it says. `module` is the
    model as WebAssembly; without it the page has no live section. Raises FileError.
    """
    layout = vehicle.layout
    held = held_commands(vehicle)
    first = vehicle.shown_axis
    driven = [axis for axis in layout.bare_axes if layout.signs(axis)]
    told = [axis for axis in driven if axis not in vehicle.unidentified]
    start = layout.example(first)
    return page(
        "index.html.j2",
        vehicle=vehicle,
        layout=layout,
        is_tuned=_is_tuned(vehicle),
        native=native,
        fmi=fmi,
        kinds=INTERFACES[interface if native else "cs"],
        report=REPORT if vehicle.provenance and vehicle.provenance.report else None,
        groups=[
            list(group) for _, group in groupby(variables(vehicle), lambda v: (v.causality, v.variability, v.initial))
        ],
        reversing=reversing,
        settable=[v.name for v in variables(vehicle) if v.name in layout.state and v.initial == "exact"]
        + [*layout.initial],
        card=card(vehicle),
        speeds=[*speed_table(vehicle)],
        equations=[[*line.rows()] for line in equations_of(layout)],
        unplaced=[t.name for t in layout.thrusters if t.position is None and not t.arm],
        live=live([FlyingVehicle(vehicle, module)]) if module and layout.actuators else None,
        start=start,
        tolerance=f"{TOLERANCE:g}",
        first=first,
        moved=float(simulate(vehicle, np.array([0.0, 10.0]), start, [first.velocity]).values[0, 0, -1]),
        moves_at_rest=any(vehicle.derivatives(layout.usual_inputs, layout.at_rest).values()),
        held=held,
        motions=[motion for axis in told for motion in _motions(vehicle, axis, held)],
        frames=[image(label, path) for name, label in _PICTURES.items() if (path := vehicle.picture(name))],
        thrusters=[
            _plot(f"Thrusters {view}", partial(draw_thrusters, vehicle=vehicle, scene=scene), scene.inches)
            for view, scene in scenes(vehicle).items()
        ],
        curves=[_plot(f"Thrust curve: {c.name}", partial(draw_curve, vehicle=vehicle, curve=c)) for c in layout.curves],
        steady=[
            _plot(
                f"V_ss over the command: {a.name}",
                partial(plot_steady, vehicle=vehicle, axis=a),
            )
            for a in told
        ],
        steps=[
            _plot(
                f"Step responses: {a.name}",
                partial(plot_steps, vehicle=vehicle, axis=a, commands=held),
            )
            for a in told
        ],
    )


@dataclass(frozen=True)
class HeldMotion:
    """The motion that held commands lead to, along one axis and in one direction."""

    axis: Axis
    direction: str
    """The direction in words, after a space; nothing if both directions give the same motion."""
    signs: Mapping[str, float]
    """The sign of each command."""
    responses: Sequence[tuple[float, float]]
    """V_ss and Tau for each command."""
    side_effects: Sequence[tuple[Axis, float]]
    """The other axes that the last command pushes too, and the force or torque along them."""


def _motions(vehicle: Vehicle, axis: Axis, commands: Sequence[Decimal]) -> Iterator[HeldMotion]:
    """Yield the motion along an axis, for each direction if they differ. The commands are in percent."""
    directions = [(1.0, "")]
    if differs_by_direction(vehicle, axis):
        directions = [(1.0, f" {axis.positive}"), (-1.0, f" {axis.negative}")]
    for sign, words in directions:
        signs = {name: sign * one for name, one in vehicle.layout.signs(axis).items()}
        fractions = [sign * float(c) / 100.0 for c in commands]
        responses = [vehicle.response(axis, fraction) for fraction in fractions]
        yield HeldMotion(axis, words, signs, responses, list(vehicle.side_effects(axis, fractions[-1])))


def differs_by_direction(vehicle: Vehicle, axis: Axis) -> bool:
    """Return True if the motion under a negative command is not the mirror image of that under a positive one."""
    for c in (0.1, 0.3, 0.6, 1.0):
        (V, Tau), (back, Tau_back) = vehicle.response(axis, c), vehicle.response(axis, -c)
        if not (isclose(V, -back, rel_tol=1e-9) and isclose(Tau, Tau_back, rel_tol=1e-9)):
            return True
    return False


def _is_tuned(vehicle: Vehicle) -> bool:
    """Return True unless each alpha and beta is 1."""
    return any(vehicle[name] != 1.0 for name in vehicle.layout.tuning)


# ---- Plots ---------------------------------------------------------------------------------------------------------


def plot_steady(ax: Axes, vehicle: Vehicle, axis: Axis) -> None:
    """Plot V_ss over the command with and without tuning, and the range of valid commands."""
    low = 100.0 * vehicle.command_range[0]
    astern, ahead = (100.0 * end for end in vehicle.tested_along(axis))
    factor, unit = in_degrees(axis.unit)
    least = -100 if differs_by_direction(vehicle, axis) else 0
    if (low, ahead) != (0.0, 100.0):
        shade(ax, low, max(low, ahead), "valid commands")
        if least:
            shade(ax, min(astern, -low), -low)
    commands = range(least, 101, 2)
    models = [("tuned", vehicle, "blue", "-")]
    if _is_tuned(vehicle):
        models.insert(0, ("without tuning", vehicle.untuned, "grey", "--"))
    for label, model, color, dashes in models:
        V_ss = [factor * model.response(axis, c / 100.0)[0] for c in commands]
        name = label if len(models) > 1 else None
        ax.plot(commands, V_ss, dashes, label=name, color=LIGHT[color], linewidth=1.8)
    name_axes(ax, f"steady {axis.name} velocity", unit, "command (%)")
    from_zero(ax)
    ax.set_xlim(least, 100)


def plot_steps(ax: Axes, vehicle: Vehicle, axis: Axis, commands: Sequence[Decimal]) -> None:
    """Plot the velocity after steps of the command from rest."""
    steps = [float(c) / 100.0 for c in commands]
    if differs_by_direction(vehicle, axis):
        steps += [-c for c in steps]
    draw_steps(ax, axis, steps, vehicle)


def _plot(label: str, draw: Callable[[Axes], None], size: tuple[float, float] = _PANEL) -> Markup:
    """Return one plot as inline SVG, with a legend if there is something to tell apart."""

    def drawn(figure: Figure) -> None:
        draw(figure.subplots())
        add_legend(figure)

    return inline_svg(label, drawn, size)
