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
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import cycle
from math import isfinite
from pathlib import Path

from rov_fmu.equation.catalogue import AXES
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
    """The inputs from each time (s) on. The name of an axis stands for a command to all thrusters that drive it.
    Commands are fractions, also if the vehicle takes pulse widths.

    The first phase has no inputs, so that it does not matter when an importer sets the first inputs.
    """

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
        starts = sorted(self.phases)
        corners = [
            (t, self.inputs_at(start))
            for start, end in zip(starts, [*starts[1:], TIMES[-1]], strict=True)
            for t in (start, end)
        ]
        _write(folder / "jumps.csv", ("time", *layout.inputs), ((t, *inputs.values()) for t, inputs in corners))

    @cached_property
    def reference(self) -> list[dict[str, float]]:
        """The time and the outputs at each communication point by the step in Python."""
        rov, inputs = self.rov.replaced(self.parameters), self.inputs_at(0.0)
        state: Mapping[str, float] = rov.layout.at_rest
        line = rov.delay_line()
        rows = []
        for time in TIMES:
            if time > 0.0:
                state = line.step(rov, inputs, state, time - STEP, STEP)
            rows.append({"time": time, **state, **rov.calculated({**inputs, **line.delayed}, state)})
            inputs = self.inputs_at(time)
        return rows

    def difference(self, result: Path) -> float:
        """Return the largest difference of any output at any communication point (SI units). Raises ResultError."""
        try:
            with result.open(newline="") as file:
                return max(self._differences(filter(None, csv.reader(file)), result.name))
        except (OSError, ValueError, IndexError) as error:
            raise ResultError(f"{result.name} cannot be read: {error}") from error

    def _differences(self, rows: Iterator[list[str]], file: str) -> Iterator[float]:
        """Yield the largest difference of any output at each communication point. Raises ResultError."""
        header = next(rows, [])
        if missing := [name for name in ("time", *self.outputs) if name not in header]:
            raise ResultError(f"{file} has no column {missing[0]}")
        time, columns = header.index("time"), [header.index(name) for name in self.outputs]
        for point in self.reference:
            row = next((row for row in rows if float(row[time]) > point["time"] - 1e-6), None)
            if row is None or float(row[time]) > point["time"] + 1e-6:
                raise ResultError(f"{file} has no row for t = {point['time']}")
            values = {name: float(row[column]) for name, column in zip(self.outputs, columns, strict=True)}
            if strange := [name for name, value in values.items() if not isfinite(value)]:
                raise ResultError(f"{file} has {strange[0]} = {values[strange[0]]} at t = {point['time']}")
            yield max(abs(value - point[name]) for name, value in values.items())


def _write(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


_CURRENT = {"V_N": 0.3, "V_E": -0.2}
_LOADS = {"X_ext": -6.0, "Z_ext": 3.0, "N_ext": 0.2, **_CURRENT}
_LOADS_OF_SIX = {**_LOADS, "Y_ext": 8.0, "K_ext": 0.5, "M_ext": -0.4, "V_D": 0.1}

_VIDEORAY = Manoeuvre(
    "videoray",
    {
        "m_rov": 7.2,
        "I_r": 0.12,
        "a_d_u": 3.5,
        "b_d_w": 0.9,
        "alpha_u": 1.0,
        "beta_w": 0.7,
        "alpha_r": 1.1,
        "beta_r": 0.25,
    },
    {
        0.0: {},
        1.0: {"surge": 0.3},
        4.0: {"u_l": 0.7, "u_r": 0.6, "u_t": 0.4},
        8.0: {"u_l": 0.5, "u_r": 0.2, "u_t": 0.2},
        11.0: {"yaw": -0.3, "heave": -0.5},
        14.0: {"u_l": -0.5, "u_r": -0.4, "u_t": -0.2},
        17.0: {"surge": 0.4, **_LOADS},
        21.0: {"yaw": 1.0, "heave": 1.0, **_LOADS},
        25.0: {"surge": -0.2, **_CURRENT},
        28.0: _CURRENT,
    },
)

# The beginning and the end of a flight of the BlueROV2s: commands along four axes, and two thrusters in a current.
_FOUR_AXES: dict[float, dict[str, float]] = {
    0.0: {},
    1.0: {"surge": 0.4, "heave": 0.3},
    4.0: {"surge": 0.3, "yaw": 0.15, "heave": 0.2},
    8.0: {"sway": 0.4, "yaw": -0.25, "heave": 0.07},  # in the dead band
    11.0: {"surge": -0.5, "sway": -0.2, "yaw": 0.05, "heave": -0.4},
    14.0: {"sway": -0.4, "yaw": -0.1, "heave": 0.2},
}
_IN_A_CURRENT = {
    25.0: {"u_1": 0.5, "u_6": -0.3, **_CURRENT},
    28.0: {"u_2": 0.2, **_CURRENT},
}

# Buoyancy acts high above the centre of mass, so that the vehicle tilts but does not turn over.
_HEAVY = Manoeuvre(
    "bluerov2_heavy",
    {
        "m_rov": 14.5,
        "a_d_v": 190.0,
        "b_d_r": 0.1,
        "m_a_u": 7.0,
        "B": 134.0,
        "z_B": -0.2,
        "a_t_t200_reverse": 20.0,
        "c_0_t200": 0.1,
        "T_t200": 0.15,
        "alpha_v": 0.9,
        "beta_w": 0.7,
        "alpha_r": 1.1,
        "beta_r": 0.8,
    },
    {
        **_FOUR_AXES,
        17.0: {"surge": 0.35, "sway": 0.1, **_LOADS_OF_SIX},
        21.0: {"yaw": 1.0, "heave": 1.0, **_LOADS_OF_SIX},
        **_IN_A_CURRENT,
    },
)

# Beyond what was identified in the middle, so that the output `outside` changes.
_IDENTIFIED = Manoeuvre(
    "identified",
    {
        "m_rov": 12.0,
        "a_d_v": 24.0,
        "b_d_r": 0.1,
        "m_a_u": 6.0,
        "c_0_t200": 0.1,
        "T_t200": 0.15,
        "alpha_v": 0.9,
        "beta_w": 0.7,
        "alpha_r": 1.1,
        "beta_r": 0.8,
    },
    {
        **_FOUR_AXES,
        17.0: {"surge": 0.35, "sway": 0.1, "Y_ext": 8.0, **_LOADS},
        21.0: {"yaw": 1.0, "heave": 1.0, "Y_ext": 8.0, **_LOADS},
        **_IN_A_CURRENT,
    },
)

_EVERY_OPTION = Manoeuvre(
    "every_option",
    {
        "m_rov": 21.0,
        "a_d_v": 80.0,
        "B": 206.5,
        "W": 206.0,
        "T_d": 0.17,
        "d_pair": 5.0,
        "lift_rudder": 8.0,
        "beta_u": 0.9,
    },
    {
        0.0: {},
        1.0: {"u_ahead": 0.4, "u_down": 0.3, "u_rudder": 0.3, "u_turn": 0.1, "u_side": 0.2, "u_plane": 0.2},
        4.0: {
            "u_ahead": 0.3,
            "u_down": 0.2,
            "u_rudder": 0.1,
            "u_turn": 0.05,
            "u_side": 0.1,
            "u_plane": 0.1,
            "voltage": 13.0,
        },
        8.0: {
            "u_ahead": 0.5,
            "u_down": -0.5,
            "u_rudder": -0.7,
            "u_turn": -0.3,
            "u_side": -0.6,
            "u_plane": -0.5,
            "voltage": 15.5,
        },
        11.0: {"u_ahead": -0.5, "u_down": 0.4, "u_turn": 0.4, "u_side": 0.7, "K_ext": 1.5, "M_ext": 2.0},
        14.0: {"u_ahead": -0.3, "u_rudder": 0.5, "u_plane": 0.6, "K_ext": -2.0, "M_ext": -3.0, "voltage": 17.0},
        17.0: {"u_ahead": 0.6, "u_turn": -0.2, **_LOADS_OF_SIX},
        21.0: {"u_ahead": 1.0, "u_down": 1.0, "u_rudder": 1.2, **_LOADS_OF_SIX},
        25.0: {"u_side": 0.3, "u_plane": -0.2, "voltage": 14.0, **_CURRENT},
        28.0: _CURRENT,
    },
)

MANOEUVRES = {manoeuvre.vehicle: manoeuvre for manoeuvre in (_VIDEORAY, _HEAVY, _IDENTIFIED, _EVERY_OPTION)}
"""The manoeuvres by the name of the vehicle."""
