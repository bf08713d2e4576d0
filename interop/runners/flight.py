"""The files of the manoeuvre, for the runners in Python (standard library only)."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

FMU = "videoray.fmu"
OUTPUTS = ("u", "w", "r", "x", "y", "z", "psi", "F_l", "F_r", "F_t", "tau_rear")
FULL = {"u_l": 1.0, "u_r": -1.0, "u_t": 1.0}
"""The commands of the detour."""


@dataclass(frozen=True)
class Step:
    """One communication step: from `start` to `end` with the inputs held."""

    start: float
    end: float
    inputs: dict[str, float]
    detour: bool


def parameters() -> dict[str, float]:
    """The parameters to set before the initialization."""
    with Path("parameters.csv").open(newline="") as file:
        return {row["name"]: float(row["value"]) for row in csv.DictReader(file)}


def steps() -> Iterator[Step]:
    """The communication steps."""
    with Path("manoeuvre.csv").open(newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    for row, following in pairwise(rows):
        detour, start = row.pop("detour"), row.pop("time")
        yield Step(start, following["time"], row, bool(detour))


def write(rows: list[dict[str, float]], path: str = "result.csv") -> None:
    """Write time and outputs; the first row holds the names."""
    with Path(path).open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
