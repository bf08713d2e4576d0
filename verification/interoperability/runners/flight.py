"""The files of the manoeuvre and the loop over its steps, for the runners in Python (standard library only)."""

import csv
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

FMU = "rov.fmu"
OUTPUTS = tuple(Path("outputs.txt").read_text().split())
AT_START = {"eta": 1.0}
"""The states that do not begin at 0: the quaternion is that of a level vehicle which heads north."""


@dataclass(frozen=True)
class Step:
    """One communication step: from `start` to `end` with the inputs held."""

    start: float
    end: float
    inputs: dict[str, float]
    detour: bool

    @property
    def length(self) -> float:
        """The length of the step (s)."""
        return self.end - self.start


def parameters() -> dict[str, float]:
    """Return the parameters to set before the initialization."""
    return _values("parameters.csv")


def detour() -> dict[str, float]:
    """Return the commands of the detour."""
    return _values("detour.csv")


def steps() -> list[Step]:
    """Return the communication steps."""
    rows = [{name: float(value) for name, value in row.items()} for row in _read("manoeuvre.csv")]
    return [Step(row.pop("time"), after["time"], row, bool(row.pop("detour"))) for row, after in pairwise(rows)]


def fly(
    advance: Callable[[Step], object], outputs: Callable[[], Sequence[float]], files: Sequence[str] = ("result.csv",)
) -> None:
    """Take every step and write a file for each ROV. `outputs` returns the outputs of all ROVs, one after the other."""
    rows = [(0.0, outputs())]
    for step in steps():
        advance(step)
        rows.append((step.end, outputs()))
    for n, path in enumerate(files):
        write(([time, *values[n * len(OUTPUTS) : (n + 1) * len(OUTPUTS)]] for time, values in rows), path)


def write(rows: Iterable[Iterable[float]], path: str = "result.csv") -> None:
    """Write rows of time and outputs."""
    with Path(path).open("w", newline="") as file:
        csv.writer(file).writerows([("time", *OUTPUTS), *rows])


def _values(path: str) -> dict[str, float]:
    return {row["name"]: float(row["value"]) for row in _read(path)}


def _read(path: str) -> list[dict[str, str]]:
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))
