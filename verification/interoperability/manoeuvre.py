"""The manoeuvres that every importer flies, one for each vehicle, and their reference by the step in Python.

Inputs are held over each communication step. A runner finds the FMU as `rov.fmu`, and beside it:

- `parameters.csv`: name, value; to be set before the initialization.
- `manoeuvre.csv`: a row for each communication point with the inputs of the step that starts there. When `detour` is 1,
  an importer that supports states saves the state, takes a step with the commands of `detour.csv` (name, value), and
  restores the state. The detour must not change the result.
- `jumps.csv`: the same inputs for tools that interpolate, with rows only where the inputs change, two for each jump.
- `outputs.txt`: the names of the outputs, one in each line.

It writes `result.csv`: time and all outputs at each communication point, at the end of the step that leads there. Of
several rows for one time the first counts; rows between communication points are allowed.
"""

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import cycle
from pathlib import Path

import numpy as np
import pandas as pd

from rov_fmu.equation.catalogue import AXES
from rov_fmu.io.messages import FileError
from rov_fmu.io.toml_file import read_toml
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.references.vehicles import EVERY_OPTION, IDENTIFIED

VEHICLES = {**SHIPPED, "identified": IDENTIFIED, "every_option": EVERY_OPTION}
"""The vehicle files by name."""
POINTS_A_SECOND = 10
STEP = 1.0 / POINTS_A_SECOND
TIMES = [n / POINTS_A_SECOND for n in range(301)]
"""The communication points (s)."""
DETOUR = 15.0


class ResultError(Exception):
    """A result that cannot be compared, in one line."""


@dataclass(frozen=True)
class Manoeuvre:
    """The manoeuvre of a vehicle."""

    vehicle: str
    """The name of a vehicle of VEHICLES."""
    parameters: Mapping[str, float]
    """The parameters that differ from the vehicle file."""
    phases: Mapping[float, Mapping[str, float]]
    """The inputs from each time (s) on, as manoeuvres.toml explains them."""

    @cached_property
    def rov(self) -> Vehicle:
        """The vehicle with its own parameters."""
        return load_vehicle(VEHICLES[self.vehicle])

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """The names of the outputs."""
        return (*self.rov.layout.state, *self.rov.layout.calculated)

    def inputs_at(self, time: float) -> dict[str, float]:
        """Return all inputs of the step that starts at a time."""
        layout = self.rov.layout
        inputs = layout.usual_inputs | dict.fromkeys(layout.commands, 0.0)
        for name, value in self.phases[max(start for start in self.phases if start <= time)].items():
            if name == "voltage":
                inputs[name] = value
                continue
            parts = layout.signs(AXES[name]) if name in AXES else {name: 1.0}
            inputs |= {part: round(inputs[part] + sign * value, 9) for part, sign in parts.items()}
        return inputs | {name: layout.command_of(inputs[name]) for name in layout.commands}

    def write_files(self, folder: Path) -> None:
        """Write the files that the runners read."""
        layout = self.rov.layout
        _write(folder / "parameters.csv", ("name", "value"), self.parameters.items())
        ends = cycle(map(layout.command_of, (1.0, -1.0)))
        _write(folder / "detour.csv", ("name", "value"), zip(layout.commands, ends, strict=False))
        (folder / "outputs.txt").write_text("".join(f"{name}\n" for name in self.outputs))
        _write(
            folder / "manoeuvre.csv",
            ("time", *layout.inputs, "detour"),
            ((t, *self.inputs_at(t).values(), int(t == DETOUR)) for t in TIMES),
        )
        _write(folder / "jumps.csv", ("time", *layout.inputs), self.corners)

    @property
    def corners(self) -> list[list[float]]:
        """The time and all inputs at the start and the end of each phase, for importers that interpolate linearly."""
        starts = sorted(self.phases)
        return [
            [time, *self.inputs_at(start).values()]
            for start, end in zip(starts, [*starts[1:], TIMES[-1]], strict=True)
            for time in (start, end)
        ]

    @cached_property
    def reference(self) -> list[dict[str, float]]:
        """The time and the outputs at each communication point by the step in Python."""
        rov, inputs = self.rov.with_(**self.parameters), self.inputs_at(0.0)
        state: Mapping[str, float] = rov.layout.at_rest
        memory = rov.memory()
        rows = []
        for time in TIMES:
            if time > 0.0:
                state = memory.step(rov, inputs, state, time - STEP, STEP)
            rows.append({"time": time, **state, **rov.calculated({**inputs, **memory.delayed}, state)})
            inputs = self.inputs_at(time)
        return rows

    def difference(self, result: Path) -> float:
        """Return the largest difference of any output at any communication point (SI units). Raises ResultError."""
        try:
            table = pd.read_csv(result, dtype=float)
        except (OSError, ValueError) as error:
            raise ResultError(f"{result.name} cannot be read: {error}") from error
        if missing := [name for name in ("time", *self.outputs) if name not in table]:
            raise ResultError(f"{result.name} has no column {missing[0]}")
        expected = pd.DataFrame(self.reference, index=TIMES)[[*self.outputs]]
        rows = table.reindex(table.time.searchsorted(expected.index - 1e-6)).set_index(expected.index)
        if not (is_there := (rows.time - expected.index).abs() < 1e-6).all():
            raise ResultError(f"{result.name} has no row for t = {is_there.idxmin()}")
        values = rows[expected.columns].to_numpy()
        for n, k in np.argwhere(~np.isfinite(values)):
            raise ResultError(f"{result.name} has {self.outputs[k]} = {values[n, k]} at t = {TIMES[n]}")
        return float(np.abs(values - expected.to_numpy()).max())


def _write(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


MANOEUVRES = {
    name: Manoeuvre(name, found["parameters"], {float(start): inputs for start, inputs in found["phases"].items()})
    for name, found in read_toml(Path(__file__).with_name("manoeuvres.toml"), FileError).items()
}
"""The manoeuvres by the name of the vehicle."""
