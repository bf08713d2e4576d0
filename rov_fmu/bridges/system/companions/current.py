"""A current that depends on depth and time, as a PythonFMU slave, for vehicles and tethers.

Without a file it is V(z) = speed (1 - z / seabed)^exponent in one direction, which grows within `rise`. The exponent
is 1/7 in a tidal stream, and 0 makes the water move alike at all depths. A file has rows of time, depth and velocity:
between them the velocity is on straight lines, and outside of them it is that of the nearest row.

Each vehicle has a place in the water, where it asks for the velocity. A tether gets the profile as a whole: the levels
between which the velocity is on straight lines. They are the rows of the file, or lie close where the profile bends.
"""

from bisect import bisect_right
from math import cos, sin
from typing import ClassVar

from rov_fmu.bridges.system.companions._common import (
    LEVELS,
    WATER,
    Companion,
    Variables,
    at,
    profile,
)

# name: causality, start, unit, description
VARIABLES: Variables = {
    "speed": ("parameter", 0.3, "m/s", "Speed at the surface; without a file"),
    "direction": ("parameter", 0.0, "rad", "Direction that the water runs to, from north to east; without a file"),
    "exponent": ("parameter", 1.0 / 7.0, "1", "Exponent of the profile; without a file"),
    "rise": ("parameter", 0.0, "s", "Time in which the current grows from nothing; without a file"),
    "seabed": ("parameter", 100.0, "m", "Depth of the seabed, to which the levels reach"),
}


def place(suffix: str) -> Variables:
    """Return the variables of a place in the water."""
    found: Variables = {f"z{suffix}": ("input", 0.0, "m", "Depth of the vehicle")}
    return found | {f"{name}{suffix}": ("output", 0.0, "m/s", f"Velocity of the water, {to}") for name, to in WATER}


Rows = list[list[float]]


class Current(Companion):
    """The slave. Its outputs are those of the end of a step, at the depth of the vehicle when the step began."""

    description = "A current that depends on depth and time"
    columns = ("time", "z", "V_N", "V_E", "V_D")
    """Those of a file, of which V_D may be left out. Its rows are those of shape.json, by their times."""
    places = (("pose", ("z",)), ("current", ("V_N", "V_E", "V_D")))
    limits: ClassVar = {"speed": (-100.0, 100.0), "exponent": (0.0, 100.0), "rise": (0.0, 1e6), "seabed": (0.01, 1e6)}

    speed: float
    direction: float
    exponent: float
    rise: float
    seabed: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.times: list[float] = [time for time, _ in self.shape.get("rows", ())]
        self.profiles: list[Rows] = [rows for _, rows in self.shape.get("rows", ())]
        self.levels = profile(self.shape.get("levels", 0), "output")
        self.terminals = [("profile", [*self.levels], ())]
        places = self.add_places(place)
        self.register(place("") | VARIABLES | self.levels | places)

    def exit_initialization_mode(self) -> None:
        """Begin with the water at the start. Raises ValueError for a current that cannot be."""
        self.check()
        self._set(0.0)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Compute the current at the end of the step."""
        self._set(current_time + step_size)
        return True

    def _set(self, t: float) -> None:
        for suffix in self.suffixes:
            self._put(suffix, self._velocity(t, getattr(self, f"z{suffix}")))
        depths = self._depths(t)
        for n in range(1, len(self.levels) // 4 + 1):
            depth = depths[min(n, len(depths)) - 1]
            setattr(self, f"depth_{n}", depth)
            self._put(f"_{n}", self._velocity(t, depth))

    def _put(self, suffix: str, velocity: list[float]) -> None:
        for (name, _), value in zip(WATER, velocity, strict=True):
            setattr(self, f"{name}{suffix}", value)

    def _depths(self, t: float) -> list[float]:
        """Return the depths of the levels, from above to the seabed."""
        if not self.times:  # the profile bends most at the seabed
            return [self.seabed * (1.0 - (1.0 - n / (LEVELS - 1)) ** 4) for n in range(LEVELS)]
        before, after = self._around(t)
        depths = depths_of(self.profiles[before], self.profiles[after])
        return [*(z for z in depths if z < self.seabed), self.seabed]

    def _around(self, t: float) -> tuple[int, int]:
        """Return the numbers of the times before and after a time."""
        n = bisect_right(self.times, t)
        return max(n - 1, 0), min(n, len(self.times) - 1)

    def _velocity(self, t: float, z: float) -> list[float]:
        """Return the velocity of the water at a depth, north, east and down."""
        if not self.times:
            share = max(0.0, 1.0 - max(z, 0.0) / self.seabed) ** self.exponent
            speed = self.speed * share * (min(1.0, t / self.rise) if self.rise > 0.0 else 1.0)
            return [speed * cos(self.direction), speed * sin(self.direction), 0.0]
        return at([[self.times[n], *at(self.profiles[n], z)] for n in self._around(t)], t)


def depths_of(*profiles: Rows) -> list[float]:
    """Return the depths of the rows of some profiles, from above."""
    return sorted({depth for rows in profiles for depth, *_ in rows})
