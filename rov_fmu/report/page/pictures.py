"""The pictures in an FMU, drawn from the vehicle's thrusters: the icon, the diagram, the icon of a terminal."""

from collections.abc import Sequence
from functools import partial

from matplotlib.figure import Figure

from rov_fmu.fmu.terminals import FOLDER, ICON, SIGNAL
from rov_fmu.report.plots.drawing import draw_icon, draw_thrusters
from rov_fmu.report.plots.geometry import Scene, scenes
from rov_fmu.report.plots.png import png_file
from rov_fmu.report.plots.svg import LIGHT, Draw, svg_file
from rov_fmu.vehicle.vehicle import Vehicle

_ICON, _SIGNAL = (2.0, 2.0), (0.2, 0.2)  # inches


def pictures(vehicle: Vehicle) -> dict[str, bytes]:
    """Return all pictures by their path in the FMU."""
    icon, (draw, size) = partial(_icon, vehicle=vehicle), _views(vehicle)
    return {
        "documentation/diagram.png": png_file(draw, size, background="white", margin=0.05),
        ICON: png_file(icon, _ICON, background="none"),
        f"{FOLDER}/icon.svg": svg_file(icon, _ICON, salt="icon", background="none", margin=0.0).encode(),
        f"{FOLDER}/{SIGNAL}.png": png_file(_signal, _SIGNAL, background="none"),
    }


def diagram(vehicle: Vehicle) -> str:
    """Return the thrusters and axes of a vehicle as SVG, from above and from the side."""
    draw, size = _views(vehicle)
    return svg_file(draw, size, salt="diagram", background="white", margin=0.05)


def _views(vehicle: Vehicle) -> tuple[Draw, tuple[float, float]]:
    """Return the function that draws all views of a vehicle, and the size of its figure in inches."""
    views = list(scenes(vehicle).values())
    widths, heights = zip(*(scene.inches for scene in views), strict=True)
    return partial(_diagram, vehicle=vehicle, views=views), (sum(widths), max(heights))


def _diagram(figure: Figure, vehicle: Vehicle, views: Sequence[Scene]) -> None:
    """Draw the thrusters and axes, one view beside the other."""
    for ax, scene in zip(figure.subplots(1, len(views)), views, strict=True):
        draw_thrusters(ax, vehicle, scene)
        ax.set_anchor("NW")


def _icon(figure: Figure, vehicle: Vehicle) -> None:
    draw_icon(figure.subplots(), vehicle)


def _signal(figure: Figure) -> None:
    """Draw a triangle in the direction of signals, from left to right."""
    ax = figure.subplots()
    ax.fill([0.0, 1.0, 0.0], [0.0, 0.5, 1.0], color=LIGHT["blue"], linewidth=0.0)
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    ax.set_axis_off()
