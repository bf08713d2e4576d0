"""The manoeuvre that every importer flies, declared once, and what `rov_fmu.motion.rov` makes of it.

Inputs are held over each communication step. A runner finds three files:

- `parameters.csv`: name, value; to be set before the initialization.
- `manoeuvre.csv`: a row for each communication point with the inputs of the step that starts there. Where `detour` is
  1, an importer that can saves the state, takes a step with full commands, and restores: it must leave no trace.
- `jumps.csv`: the same inputs for tools that interpolate: the corners only, two rows where the inputs jump.

It leaves `result.csv`: time and all outputs at each communication point, at the end of the step that leads there. Of
several rows for one time the first counts; rows between communication points are allowed.
"""

import csv
from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path

from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

POINTS = 301
POINTS_A_SECOND = 10
STEP = 1.0 / POINTS_A_SECOND
DETOUR = 15.0
ROV = load_vehicle(VIDEORAY).rov
OUTPUTS = (*ROV.layout.state, *ROV.layout.thrust)

PARAMETERS = {"m_rov": 7.2, "I_r": 0.12, "a_d_u": 3.5, "b_d_w": 0.9,
              "alpha_u": 1.0, "beta_w": 0.7, "alpha_r": 1.1, "beta_r": 0.25}  # fmt: skip

# The inputs from each time (s) on. They start with rest, so that it does not matter when the first ones are set.
PHASES: dict[float, dict[str, float]] = {
    0.0: {},
    1.0: {"u_l": 0.3, "u_r": 0.3},
    4.0: {"u_l": 0.7, "u_r": 0.6, "u_t": 0.4},
    8.0: {"u_l": 0.5, "u_r": 0.2, "u_t": 0.2},
    11.0: {"u_l": -0.3, "u_r": 0.3, "u_t": -0.5},
    14.0: {"u_l": -0.5, "u_r": -0.4, "u_t": -0.2},
    17.0: {"u_l": 0.4, "u_r": 0.4, "X_ext": -6.0, "Z_ext": 3.0, "N_ext": 0.2, "V_N": 0.3, "V_E": -0.2},
    21.0: {"u_l": 1.0, "u_r": -1.0, "u_t": 1.0, "X_ext": -6.0, "Z_ext": 3.0, "N_ext": 0.2, "V_N": 0.3, "V_E": -0.2},
    25.0: {"u_l": -0.2, "u_r": -0.2, "V_N": 0.3, "V_E": -0.2},
    28.0: {"V_N": 0.3, "V_E": -0.2},
}


class ResultError(Exception):
    """A result that cannot be compared, in one line."""


def times() -> list[float]:
    """The communication points (s)."""
    return [n / POINTS_A_SECOND for n in range(POINTS)]


def inputs_at(time: float) -> dict[str, float]:
    """All inputs of the step that starts at a time."""
    return dict.fromkeys(ROV.layout.inputs, 0.0) | PHASES[max(start for start in PHASES if start <= time)]


def write_files(folder: Path) -> None:
    """Write what the runners read."""
    _write(folder / "parameters.csv", ("name", "value"), PARAMETERS.items())
    names = list(ROV.layout.inputs)
    _write(
        folder / "manoeuvre.csv",
        ("time", *names, "detour"),
        ((t, *inputs_at(t).values(), int(t == DETOUR)) for t in times()),
    )
    starts = sorted(PHASES)
    corners = [(t, inputs_at(start)) for start, end in zip(starts, [*starts[1:], times()[-1]], strict=True)
               for t in (start, end)]  # fmt: skip
    _write(folder / "jumps.csv", ("time", *names), ((t, *inputs.values()) for t, inputs in corners))


def reference() -> list[dict[str, float]]:
    """Time and outputs at each communication point by `rov_fmu.motion.rov`."""
    rov, state, inputs = ROV.replaced(PARAMETERS), dict.fromkeys(ROV.layout.state, 0.0), inputs_at(0.0)
    rows = []
    for time in times():
        if time > 0.0:
            state = rov.step(inputs, state, STEP)
        rows.append({"time": time, **state, **rov.thrust(inputs, state)})
        inputs = inputs_at(time)
    return rows


def difference(result: Path, expected: Sequence[dict[str, float]]) -> float:
    """The largest difference of any output at any communication point, in SI units. Raises ResultError."""
    try:
        with result.open(newline="") as file:
            rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    except (OSError, TypeError, ValueError, AttributeError) as error:
        raise ResultError(f"{result.name} cannot be read: {error}") from error
    if missing := [name for name in ("time", *OUTPUTS) if not rows or name not in rows[0]]:
        raise ResultError(f"{result.name} has no column {missing[0]}")
    largest, remaining = 0.0, iter(rows)
    for point in expected:
        row = next((row for row in remaining if row["time"] > point["time"] - 1e-6), None)
        if row is None or row["time"] > point["time"] + 1e-6:
            raise ResultError(f"{result.name} has no row for t = {point['time']}")
        if strange := [name for name in OUTPUTS if not isfinite(row[name])]:
            raise ResultError(f"{result.name} has {strange[0]} = {row[strange[0]]} at t = {point['time']}")
        largest = max(largest, *(abs(row[name] - point[name]) for name in OUTPUTS))
    return largest


def _write(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])
