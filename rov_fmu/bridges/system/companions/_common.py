"""What companions have in common. The FMU of each contains this file, too."""

import json
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Variability, Real

Variables = dict[str, tuple[str, float | bool, str, str]]
"""Causality, start value, unit and description by name."""
LEVELS = 16
"""The levels of a profile of the water; a file may have more rows."""
DIRECTIONS = ("northward", "eastward", "downward")
VELOCITY, ACCELERATION = ("V_N", "V_E", "V_D"), ("A_N", "A_E", "A_D")
WATER = tuple(zip(VELOCITY, DIRECTIONS, strict=True))


def shape_of(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the shape of a companion, shape.json among its resources, by the arguments of its slave."""
    file = Path(str(arguments.get("resources")), "shape.json")
    shape: dict[str, Any] = json.loads(file.read_text("utf-8")) if file.is_file() else {}
    return shape


def register(slave: Any, variables: Variables, parameters: str = "tunable", step: float = 0.02) -> None:
    """Give a slave its variables, its author, and a default experiment with a step, s."""
    slave.author, slave.variables = "rov-fmu", variables
    slave.default_experiment = DefaultExperiment(start_time=0.0, stop_time=60.0, step_size=step)
    for name, (causality, start, _, text) in variables.items():
        setattr(slave, name, start)
        kind, changes = (Boolean, "discrete") if start is False else (Real, "continuous")
        how = Fmi2Variability[parameters if causality == "parameter" else changes]
        slave.register_variable(kind(name, description=text, causality=Fmi2Causality[causality], variability=how))


def check(slave: Any) -> None:
    """Raise ValueError if a parameter is outside of the limits that its description has as min and max."""
    for name, (low, high) in slave.limits.items():
        if not low <= getattr(slave, name) <= high:
            raise ValueError(f"{name} must be from {low:g} to {high:g}: {getattr(slave, name):g}")


def add_places(slave: Any, shape: dict[str, Any], place: Callable[[str], Variables]) -> Variables:
    """Give a slave a place in the water for each whom it serves, with the terminals `places`; return the variables.

    The names of all but the first place end with the name of whom it serves.
    """
    slave.suffixes = ["", *(f"_{name}" for name in shape.get("places", ()))]
    variables: Variables = {}
    for suffix in slave.suffixes:
        variables |= place(suffix)
        for port, names in slave.places:
            slave.terminals.append((f"{port}{suffix}", [f"{name}{suffix}" for name in names], names))
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
