"""terminalsAndIcons/terminalsAndIcons.xml: the variables in terminals, which tools connect as one (FMI 3.0, 2.4.9).

FMI 2.0.4 takes the file as FMI 3.0 defines it, fmiVersion="3.0" included, so it is the same in FMUs of both versions.
There is no terminalKind: the standard defines none, and one of our own would only keep others from connecting.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from rov_fmu.io.templates import render
from rov_fmu.model.layout import Layout

FOLDER = "terminalsAndIcons"
ICON = f"{FOLDER}/icon.png"
SIGNAL = "signal"
"""Name of the picture of a terminal, without its ending."""


@dataclass(frozen=True)
class Terminal:
    """Variables of one causality; a plug is connected whole, of a bus whatever the other side has too."""

    name: str
    causality: str
    rule: str
    description: str
    members: tuple[str, ...]


def terminals(layout: Layout) -> list[Terminal]:
    """Those of which the vehicle has members: every input and output in one."""
    loads = tuple(form.axis.external for form in layout.axes)
    current = tuple(name for name in layout.inputs if name not in {*layout.commands, *loads})
    thrust = layout.lagging | layout.thrust
    found = [
        Terminal("thrusters", "input", "bus", "Commands to the thrusters, -1 to 1", tuple(layout.commands)),
        Terminal("load", "input", "bus", "Forces and torque from outside, body frame", loads),
        Terminal("current", "input", "bus", "Velocity of the water, north and east", current),
        Terminal("body_velocity", "output", "plug", "Velocity through the water, body frame", tuple(layout.velocities)),
        Terminal("pose", "output", "plug", "Position north, east, down, and heading", tuple(layout.pose)),
        Terminal("thrust", "output", "bus", "Forces and torques of the thrusters", tuple(thrust)),
    ]
    return [terminal for terminal in found if terminal.members]


def terminals_and_icons(layout: Layout) -> bytes:
    """The XML document: inputs on the left of the icon, outputs on its right. The same bytes for the same vehicle."""
    placed = [place for causality, x in (("input", -120), ("output", 100)) for place in _placed(layout, causality, x)]
    return render("terminalsAndIcons.xml.j2", placed=placed, icon=SIGNAL).encode()


def _placed(layout: Layout, causality: str, x: int) -> Iterator[tuple[Terminal, dict[str, int]]]:
    """Terminals with the corners of their pictures, evenly from the top down."""
    side = [terminal for terminal in terminals(layout) if terminal.causality == causality]
    for n, terminal in enumerate(side, start=1):
        y = 100 - 200 * n // (len(side) + 1)
        yield terminal, {"x1": x, "y1": y - 10, "x2": x + 20, "y2": y + 10}
