"""A current that depends on depth and time, as a PythonFMU slave, for a vehicle and for its tether.

Without a file it is V(z) = speed (1 - z / seabed)^exponent in one direction, which grows within `rise`. The exponent
is 1/7 in a tidal stream, and 0 makes the water move alike at all depths. A file has rows of time, depth and velocity:
between them the velocity is on straight lines, and outside of them it is that of the nearest row.
"""

import json
from bisect import bisect_right
from math import cos, sin
from pathlib import Path

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

LEVELS = range(1, 7)

# name: causality, start, unit, description
VARIABLES: dict[str, tuple[str, float, str, str]] = {
    "z": ("input", 0.0, "m", "Depth of the vehicle"),
    "V_N": ("output", 0.0, "m/s", "Velocity of the water at this depth, northward"),
    "V_E": ("output", 0.0, "m/s", "Velocity of the water at this depth, eastward"),
    "speed": ("parameter", 0.3, "m/s", "Speed at the surface; without a file"),
    "direction": ("parameter", 0.0, "rad", "Direction that the water runs to, from north to east; without a file"),
    "exponent": ("parameter", 1.0 / 7.0, "1", "Exponent of the profile; without a file"),
    "rise": ("parameter", 0.0, "s", "Time in which the current grows from nothing; without a file"),
    "seabed": ("parameter", 100.0, "m", "Depth of the seabed, to which the levels reach"),
}
PROFILE = {
    f"{name}_{n}": ("output", 0.0, unit, f"{what} at level {n} of the water, level 1 at the top")
    for n in LEVELS
    for name, unit, what in (("depth", "m", "Depth"), ("V_N", "m/s", "Current north"), ("V_E", "m/s", "Current east"))
}
VARIABLES |= PROFILE

Rows = list[list[float]]


class Current(Fmi2Slave):  # type: ignore[misc]
    """The slave. Its outputs are those of the end of a step, at the depth of the vehicle when the step began."""

    author = "rov-fmu"
    description = "A current that depends on depth and time"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=0.02)
    variables = VARIABLES
    columns = ("time", "z", "V_N", "V_E")
    """Those of a file, which becomes table.json: for each time the depth and the velocity of each row."""
    terminals = (("pose", ("z",)), ("current", ("V_N", "V_E")), ("profile", tuple(PROFILE)))

    z: float
    speed: float
    direction: float
    exponent: float
    rise: float
    seabed: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        for name, (causality, start, _, text) in VARIABLES.items():
            setattr(self, name, start)
            changes = Fmi2Variability.tunable if causality == "parameter" else Fmi2Variability.continuous
            kind = {"causality": Fmi2Causality[causality], "variability": changes}
            self.register_variable(Real(name, description=text, **kind))
        table = Path(str(arguments.get("resources")), "table.json")
        rows: list[tuple[float, Rows]] = json.loads(table.read_text("utf-8")) if table.is_file() else []
        self.times, self.profiles = [time for time, _ in rows], [profile for _, profile in rows]

    def exit_initialization_mode(self) -> None:
        """Begin with the water at the start."""
        self._set(0.0)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Compute the current at the end of the step."""
        self._set(current_time + step_size)
        return True

    def _set(self, t: float) -> None:
        self.V_N, self.V_E = self._velocity(t, self.z)
        for n in LEVELS:
            depth = self.seabed * (n - 1) / (len(LEVELS) - 1)
            for name, value in zip(("depth", "V_N", "V_E"), (depth, *self._velocity(t, depth)), strict=True):
                setattr(self, f"{name}_{n}", value)

    def _velocity(self, t: float, z: float) -> list[float]:
        """Return the velocity of the water at a depth, north and east."""
        if not self.times:
            share = max(0.0, 1.0 - max(z, 0.0) / self.seabed) ** self.exponent
            speed = self.speed * share * (min(1.0, t / self.rise) if self.rise > 0.0 else 1.0)
            return [speed * cos(self.direction), speed * sin(self.direction)]
        n = bisect_right(self.times, t)
        before, after = max(n - 1, 0), min(n, len(self.times) - 1)
        return between(
            self.times[before], at(self.profiles[before], z), self.times[after], at(self.profiles[after], z), t
        )


def at(profile: Rows, z: float) -> list[float]:
    """Return the velocity at a depth of a profile, whose rows have a depth and a velocity."""
    n = bisect_right([depth for depth, *_ in profile], z)
    (a, *above), (b, *below) = profile[max(n - 1, 0)], profile[min(n, len(profile) - 1)]
    return between(a, above, b, below, z)


def between(a: float, above: list[float], b: float, below: list[float], x: float) -> list[float]:
    """Return the values at x on a straight line from those at a to those at b."""
    share = (x - a) / (b - a) if b > a else 0.0
    return [p + share * (q - p) for p, q in zip(above, below, strict=True)]
