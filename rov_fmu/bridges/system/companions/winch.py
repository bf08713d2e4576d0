"""A winch as a PythonFMU slave: it tells a tether how long it is to be."""

from typing import ClassVar

from rov_fmu.bridges.system.companions._common import Companion, Variables

# name: causality, start, unit, description
VARIABLES: Variables = {
    "speed": ("input", 0.0, "m/s", "Speed that is asked for, positive to pay out"),
    "tension": ("input", 0.0, "N", "Tension of the tether at the winch"),
    "length": ("output", 60.0, "m", "Length of the tether that hangs out"),
    "length_0": ("parameter", 60.0, "m", "Length at the start"),
    "fastest": ("parameter", 0.5, "m/s", "Largest speed"),
    "acceleration": ("parameter", 0.5, "m/s2", "Largest acceleration"),
    "render": ("parameter", 0.0, "N", "Tension beyond which it pays out at its largest speed; 0: none"),
}


class Winch(Companion):
    """The slave. It begins at rest."""

    description = "A winch: from a speed to the length of a tether"
    limits: ClassVar = {
        "length_0": (0.01, 1e6),
        "fastest": (0.0, 100.0),
        "acceleration": (1e-3, 1e3),
        "render": (0.0, 1e9),
    }

    speed: float
    tension: float
    length_0: float
    fastest: float
    acceleration: float
    render: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.turning = 0.0
        self.register(VARIABLES)

    def exit_initialization_mode(self) -> None:
        """Begin with the length at the start. Raises ValueError for a winch that cannot be."""
        self.check()
        self.length = self.length_0

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Turn for a step."""
        asked = self.fastest if 0.0 < self.render < self.tension else self.speed
        most = self.acceleration * step_size
        change = min(max(asked, -self.fastest), self.fastest) - self.turning
        self.turning += min(max(change, -most), most)
        self.length = max(self.length + self.turning * step_size, 0.01)
        return True
