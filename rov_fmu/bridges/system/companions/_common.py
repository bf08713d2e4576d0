"""What companions have in common. The FMU of each contains this file, too."""

import json
from bisect import bisect_right
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

Variables = dict[str, tuple[str, float | bool, str, str]]
"""Causality, start value, unit and description by name."""
Group = tuple[str, Sequence[str], Sequence[str]]
"""The name of a group of variables, these, and the names of the members; none if these are the same."""
LEVELS = 16
"""The levels of a profile of the water; a file may have more rows."""
DIRECTIONS = ("northward", "eastward", "downward")
VELOCITY, ACCELERATION = ("V_N", "V_E", "V_D"), ("A_N", "A_E", "A_D")
WATER = tuple(zip(VELOCITY, DIRECTIONS, strict=True))


class Companion(Fmi2Slave):  # type: ignore[misc]
    """What a companion is, and what it has if its class says nothing else."""

    description: str
    variables: Variables
    points: Sequence[str] = ()
    """The ports, whose variables end with the name of the port and are in the order of a vehicle's."""
    places: Sequence[tuple[str, Sequence[str]]] = ()
    """The terminals that each one whom it serves has for itself; those of all but the first end with its name."""
    behind: str | None = None
    """The terminal of each place that takes the water to which it adds."""
    nodes = 0
    """The number of points at which it feels waves."""
    columns: tuple[str, ...] = ()
    """Those of its file, if it takes one."""
    limits: ClassVar[dict[str, tuple[float, float]]] = {}
    """The least and the greatest value of parameters."""
    needs = ""
    """A package that it imports."""

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.terminals: list[Group] = []
        file = Path(str(arguments.get("resources")), "shape.json")
        self.shape: dict[str, Any] = json.loads(file.read_text("utf-8")) if file.is_file() else {}
        """Whom and what it serves: the arguments of `companion`, which its FMU has as a resource."""

    def enter_initialization_mode(self) -> None:
        """Compute the outputs, because importers pass them on before the end of the initialization."""
        self.exit_initialization_mode()

    def register(self, variables: Variables, parameters: str = "tunable", step: float = 0.02) -> None:
        """Take its variables with the start values of its shape, its author, and a default experiment."""
        given, (stop, step) = self.shape.get("start", {}), self.shape.get("experiment", (60.0, step))
        variables = {name: (kind, given.get(name, own), *about) for name, (kind, own, *about) in variables.items()}
        self.author, self.variables = "rov-fmu", variables
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=stop, step_size=step)
        for name, (causality, start, _, text) in variables.items():
            setattr(self, name, start)
            kind, changes = (Boolean, "discrete") if isinstance(start, bool) else (Real, "continuous")
            how = Fmi2Variability[parameters if causality == "parameter" else changes]
            self.register_variable(kind(name, description=text, causality=Fmi2Causality[causality], variability=how))

    def check(self) -> None:
        """Raise ValueError if a parameter is outside of its limits, which the description has as min and max."""
        for name, (low, high) in self.limits.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} must be from {low:g} to {high:g}: {getattr(self, name):g}")

    def add_places(self, place: Callable[[str], Variables]) -> Variables:
        """Take a place in the water for each whom it serves, with its terminals; return the variables."""
        self.suffixes = ["", *(f"_{name}" for name in self.shape.get("places", ()))]
        variables: Variables = {}
        for suffix in self.suffixes:
            variables |= place(suffix)
            for port, names in self.places:
                self.terminals.append((f"{port}{suffix}", [f"{name}{suffix}" for name in names], names))
        return variables


def profile(levels: int, causality: str) -> Variables:
    """Return the variables of the levels of the water. The last one is that above the first one which is no deeper."""
    found: Variables = {}
    for n in range(1, max(levels, LEVELS) + 1):
        found[f"depth_{n}"] = (causality, 0.0, "m", f"Depth of level {n} of the water, level 1 at the top")
        found |= {f"{name}_{n}": (causality, 0.0, "m/s", f"Velocity at level {n}, {to}") for name, to in WATER}
    return found


def at(rows: list[list[float]], x: float) -> list[float]:
    """Return the values at x on straight lines between rows, which begin with their x; outside, of the nearest row."""
    n = bisect_right([row[0] for row in rows], x)
    (a, *above), (b, *below) = rows[max(n - 1, 0)], rows[min(n, len(rows) - 1)]
    share = (x - a) / (b - a) if b > a else 0.0
    return [p + share * (q - p) for p, q in zip(above, below, strict=True)]
