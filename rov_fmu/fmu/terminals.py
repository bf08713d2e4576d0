"""Write terminalsAndIcons.xml, which groups variables into terminals, which are connected as a whole (FMI 3.0, 2.4.9).

FMI 2.0.4 uses the file of FMI 3.0, including fmiVersion="3.0", so it is the same in FMUs of both versions. There is no
terminalKind: the standard defines none, and our own kind would only prevent connections to others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from rov_fmu.equation.catalogue import CURRENT, CURRENT_DOWN, ELEVATION, WATER_ACCELERATION
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Point
from rov_fmu.equation.words import point_declarations, point_words
from rov_fmu.io.templates import render

FOLDER = "terminalsAndIcons"
ICON = f"{FOLDER}/icon.png"
SIGNAL = "signal"
"""The name of the picture of a terminal, without its suffix."""


@dataclass(frozen=True)
class Terminal:
    """A group of variables: inputs, outputs, or both for a port.

    A plug is connected as a whole. Of a bus, the variables that both sides have are connected.
    """

    name: str
    causality: str
    """input, output or port."""
    rule: str
    description: str
    variables: tuple[str, ...]
    names: tuple[str, ...] = ()
    """The names of the members, if they differ from those of the variables: those of a tether are the same."""

    @property
    def members(self) -> dict[str, str]:
        """The names of the members by those of the variables."""
        return dict(zip(self.variables, self.names or self.variables, strict=True))


def terminals(layout: Layout) -> list[Terminal]:
    """Return the terminals of a vehicle. Every input and output is in exactly one."""
    battery = ("voltage",) if layout.voltage is not None else ()
    loads = tuple(axis.external for axis in layout.bare_axes)
    current = tuple(name for name in CURRENT | CURRENT_DOWN if name in layout.inputs)
    waves = tuple(name for name in WATER_ACCELERATION | ELEVATION if name in layout.inputs)
    thrust = tuple(layout.lagging | layout.thrust)
    water, turned = ("north, east and down", "quaternion") if layout.has_attitude else ("north and east", "heading")
    actuators = "thrusters and fins" if layout.fins else "thrusters"
    commands = "pulse widths" if layout.pulse else "-1 to 1"
    over_ground = tuple(layout.over_ground)
    groups = [
        Terminal("thrusters", "input", "bus", f"Commands to the {actuators}, {commands}", tuple(layout.commands)),
        Terminal("battery", "input", "bus", "Voltage of the battery", battery),
        Terminal("load", "input", "bus", "Forces and torque from outside, body frame", loads),
        Terminal("current", "input", "bus", f"Velocity of the water, {water}", current),
        Terminal("waves", "input", "bus", "Acceleration of the water, and elevation of its surface", waves),
        Terminal("body_velocity", "output", "plug", "Velocity through the water, body frame", tuple(layout.velocities)),
        Terminal("velocity", "output", "plug", "Velocity over ground, north, east and down", over_ground),
        Terminal("pose", "output", "plug", f"Position north, east, down, and {turned}", tuple(layout.pose)),
        Terminal("attitude", "output", "plug", "Euler angles: roll, pitch and heading", tuple(layout.angles)),
        Terminal("thrust", "output", "bus", "Forces and torques of the thrusters", thrust),
        Terminal("electric", "output", "bus", "Electric current and power of the thrusters", tuple(layout.electric)),
        Terminal(
            "validity", "output", "plug", "How far the motion is beyond what was identified", tuple(layout.outside)
        ),
    ]
    groups += map(port_of, layout.points)
    placed = {name for terminal in groups for name in terminal.members}
    for causality, declared in (("input", layout.inputs), ("output", layout.state | layout.calculated)):
        rest = tuple(name for name in declared if name not in placed)
        groups.append(Terminal(f"other_{causality}s", causality, "bus", f"Other {causality}s", rest))
    return [terminal for terminal in groups if terminal.members]


def port_of(point: Point) -> Terminal:
    """Return the terminal of a point: the force on the vehicle goes in, then its place and its velocity come out."""
    words = f"Force on the vehicle at the {point_words(point)['point']}, north, east and down; its place and velocity"
    port = tuple(name for part in point_declarations(point) for name in part)
    names = tuple("".join(name.rsplit(f"_{point.name}", 1)) for name in port)
    return Terminal(f"point_{point.name}", "port", "bus", words, port, names)


def terminals_and_icons(layout: Layout) -> bytes:
    """Return the XML document of a vehicle."""
    return terminals_document(terminals(layout), SIGNAL)


def terminals_document(declared: Sequence[Terminal], icon: str = "") -> bytes:
    """Return the XML document of terminals, with the name of their picture if they have one."""
    return render("terminalsAndIcons.xml.j2", terminals=declared, icon=icon).encode()
