"""Tank tests and dives of the vehicles that ship, with sensors and disturbances, flown by an independent integrator."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path
from typing import Literal

import numpy as np

from rov_fmu.equation.catalogue import AXES, HEAVE, PITCH, ROLL, SURGE, YAW, Axis
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.identify.scenarios.scenario import (
    COMMANDS,
    EXACT_THRUST,
    NOTHING_SPECIAL,
    Expected,
    Given,
    Truths,
    steady_name,
    voltage,
    write_folder,
)
from tests.recordings import PLANS, coloured, with_more
from verification.references import pool, rigid_pool
from verification.references.pool import NOTHING, Array, Commands, Conditions

Random = np.random.Generator
Motion = Mapping[str, Array]

TRUTHS = {
    "videoray": load_vehicle(SHIPPED["videoray"]).with_(beta_u=0.8),
    "bluerov2_heavy": load_vehicle(SHIPPED["bluerov2_heavy"]).with_(z_B=-0.05),
}
"""The true vehicles. β of the VideoRay in surge differs from 1, where a fit may start. The centre of buoyancy of the
Heavy lies 5 cm above that of mass, so that a pilot without an autopilot can fly it."""

# ---- Scenarios -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sensor:
    """A sensor along or about an axis, with a column in every log."""

    axis: Axis
    quantity: str
    """`velocity` over ground, or the position along the axis: distance, depth, heading, roll angle, pitch angle."""
    noise: float
    """The standard deviation, SI units."""
    every: int = 1
    """The sensor measures in every row, in every second row ..."""
    late: float = 0.0
    """How much later than the clock of the commands its clock is, s."""
    scale: float = 1.0
    """The factor of its values."""
    resolution: float = 0.0
    """The smallest difference of its values, SI units; 0 for none."""
    wraps: bool = False
    """True when an angle is logged within ±180°; otherwise it is continuous."""


@dataclass(frozen=True)
class Logs:
    """The logs of a scenario, and the errors of their times and values."""

    plan: Literal["steps", "pilot"] = "steps"
    """`steps`: tests of each axis alone, by PLANS of tests/recordings.py. `pilot`: all axes at once."""
    axes: tuple[Axis, ...] = (SURGE, HEAVE, YAW)
    """The axes that are tested."""
    count: int = 3
    """The number of recordings (of each axis, with `steps`)."""
    seconds: float = 60.0
    rate: float = 20.0
    """Rows per second."""
    between_rows: bool = False
    """True when commands switch at any time, not only at rows."""
    scatter: float = 0.0
    """The scatter of the times of the rows, as a share of the time between two rows."""
    jitter: float = 0.0
    """The standard deviation of the error of each time stamp, s."""
    gaps: int = 0
    """The number of gaps of 4 s in each recording, while the vehicle is driven."""
    correlation_time: float = 0.0
    """The correlation time of the noise, s; 0 for white noise."""
    columns: tuple[str, ...] = ()
    """More columns, which are measured without noise: voltage, roll, pitch."""


@dataclass(frozen=True)
class Tank:
    """Logs of a vehicle that ships. The identification knows nothing of `more` and `conditions`."""

    vehicle: str = "videoray"
    logs: Logs = Logs()
    sensors: tuple[Sensor, ...] = ()
    more: Mapping[str, float] = field(default_factory=dict)
    """Other coefficients of the true vehicle."""
    conditions: Conditions = NOTHING
    currents: tuple[tuple[float, float], ...] = ()
    """The current of each recording, where they differ."""
    known: Mapping[str, Given] = field(default_factory=dict)
    """What rov.toml gives besides the base."""
    fit: tuple[str, ...] = ()
    priors: Mapping[str, float] = field(default_factory=lambda: EXACT_THRUST)
    expected: Expected = NOTHING_SPECIAL

    @property
    def truth(self) -> Vehicle:
        """The true vehicle."""
        return with_more(TRUTHS[self.vehicle], **self.more)

    @property
    def recorded(self) -> tuple[Axis, ...]:
        """The axes with a sensor, in the order of the states."""
        there = {sensor.axis.name for sensor in self.sensors} & {axis.name for axis in self.logs.axes}
        return tuple(axis for axis in AXES.values() if axis.name in there)

    def write(self, seed: int, folder: Path) -> None:
        """Write rov.toml and the logs."""
        random, truth = np.random.default_rng(seed), self.truth
        tables = {flight.file: _table(self, truth, flight, random) for flight in flights(self, random)}
        write_folder(folder, tables, base=self.vehicle, known=self.known, fit=self.fit, priors=self.priors)

    def truths(self) -> Truths:
        """Return drag, β and V_ss of each axis, and the lags that are asked for. Roll and pitch have no V_ss.

        With a logged voltage, V_ss is that at the voltage of the measured thrust.
        """
        truth = self.truth
        found: dict[tuple[str, str], float] = {}
        for axis in self.recorded:
            names = [axis.coefficient(key) for key in ("a_d", "b_d", "beta")]
            found |= {(axis.name, name): truth[name] for name in names}
            if axis not in (ROLL, PITCH):
                found |= {(axis.name, steady_name(c)): truth.response(axis, c)[0] for c in COMMANDS}
        return found | {("", name): value for name, value in self.more.items() if name.startswith("T_")}


_STICKS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "videoray": {"surge": (0.7, 5.0), "heave": (0.7, 6.0), "yaw": (0.3, 3.0)},
    "bluerov2_heavy": {
        "surge": (0.24, 5.0),
        "sway": (0.24, 5.0),
        "heave": (0.35, 5.0),
        "roll": (0.06, 1.5),
        "pitch": (0.06, 1.5),
        "yaw": (0.14, 3.0),
    },
}
"""The largest deflection of each stick, and the typical time for which it stays (s), by vehicle."""
_REST = 3.0
"""The time before the first command of a pilot, s."""
_GAP = 4.0
_UNITS = {"m": ("m", 1.0), "rad": ("deg", 180.0 / pi)}
"""The unit of a logged position, and its factor, by the unit of the position."""


def driven(k: Vehicle, axis: Axis) -> dict[str, float]:
    """Return the thrusters that a stick or a test of an axis drives, with their signs.

    Those of the Heavy that push sideways take no part in roll and pitch.
    """
    rolls = axis in (ROLL, PITCH)
    return {
        thruster.name: k.layout.signs(axis)[f"u_{thruster.name}"]
        for thruster in k.layout.thrusters
        if f"u_{thruster.name}" in k.layout.signs(axis) and (thruster.direction.value[2] or not rolls)
    }


# ---- Flights ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Flight:
    """One recording before it is measured: the commands, and when rows are logged."""

    file: str
    commands: Commands
    command: Array | None
    """The command of the axis since each switch, in a test of one axis."""
    time: Array
    """n: the true times of the rows, s."""
    sensors: tuple[Sensor, ...]
    conditions: Conditions


def flights(scenario: Tank, random: Random) -> Iterator[Flight]:
    """Yield the recordings of a scenario."""
    logs, given = scenario.logs, scenario.conditions
    patterns = {axis.name: driven(TRUTHS[scenario.vehicle], axis) for axis in logs.axes}
    conditions = [replace(given, current=current) for current in scenario.currents] or [given] * logs.count
    if logs.plan == "pilot":
        for n in range(logs.count):
            sticks = {axis.name: _stick(random, logs, *_STICKS[scenario.vehicle][axis.name]) for axis in logs.axes}
            switches = np.unique(np.concatenate([times for times, _ in sticks.values()]))
            thrusters: dict[str, Array] = {}
            for name, (times, levels) in sticks.items():
                held = levels[np.searchsorted(times, switches, side="right") - 1]
                for thruster, sign in patterns[name].items():
                    thrusters[thruster] = thrusters.get(thruster, np.zeros(len(switches))) + sign * held
            thrusters = {name: np.clip(values, -1.0, 1.0) for name, values in thrusters.items()}
            commands = Commands(switches, thrusters)
            yield Flight(f"log_{n}.csv", commands, None, _rows(random, logs, commands), scenario.sensors, conditions[n])
        return
    for axis in logs.axes:
        sensors = tuple(sensor for sensor in scenario.sensors if sensor.axis is axis)
        for n, plan in enumerate(PLANS[axis.name][: logs.count]):
            levels, holds = (np.array(column) for column in zip(*plan, strict=True))
            switches = np.concatenate([[0.0], np.cumsum(holds)[:-1]])
            if logs.between_rows:
                switches[1:] += random.uniform(0.0, 1.0 / logs.rate, len(switches) - 1)
            commands = Commands(switches, {name: sign * levels for name, sign in patterns[axis.name].items()})
            rows = _rows(random, logs, commands)
            yield Flight(f"log_{axis.name}_{n}.csv", commands, levels, rows, sensors, conditions[n])


def _stick(random: Random, logs: Logs, most: float, hold: float) -> tuple[Array, Array]:
    """Return when a stick moves, and where it stays: a third of the time in the middle, else on alternating sides."""
    at, side, times, levels = _REST, most, [0.0], [0.0]
    while at < logs.seconds:
        level = 0.0 if random.random() < 1.0 / 3.0 else side * random.uniform(0.4, 1.0)
        side = -side if level else side
        times.append(at if logs.between_rows else round(at * logs.rate) / logs.rate)
        levels.append(level)
        at += hold * random.uniform(0.5, 1.5)
    return np.array(times), np.array(levels)


def _rows(random: Random, logs: Logs, commands: Commands) -> Array:
    """Return the true times of the rows."""
    n = round(logs.seconds * logs.rate)
    time = (np.arange(n) + logs.scatter * random.uniform(-0.5, 0.5, n) * (np.arange(n) > 0)) / logs.rate
    if logs.gaps:
        driven = np.any([values != 0.0 for values in commands.thrusters.values()], axis=0)
        ends = np.append(commands.switches[1:], logs.seconds)
        long = driven & (ends - commands.switches > _GAP + 2.0)
        for hold in random.choice(np.flatnonzero(long), logs.gaps, replace=False):
            begin = random.uniform(commands.switches[hold] + 1.0, ends[hold] - _GAP - 1.0)
            time = time[(time < begin) | (time > begin + _GAP)]
    return time


def tilted(conditions: Conditions, at: Array) -> Array:
    """Return roll and pitch of a vehicle that has neither axis."""
    return np.array([conditions.tilt.at(t)[:2] if conditions.tilt else (0.0, 0.0) for t in at.tolist()]).T


def moved(truth: Vehicle, commands: Commands, at: Array, conditions: Conditions) -> Motion:
    """Return the motion at ascending times, with the surge and sway velocity over ground as `u ground`, `v ground`."""
    simulate = rigid_pool.motion if truth.layout.has_attitude else pool.motion
    found = simulate(truth, commands, np.maximum(at, 0.0), conditions)
    if "phi" not in found:
        found["phi"], found["theta"] = tilted(conditions, at)
    (north, east), phi, theta, psi = conditions.current, found["phi"], found["theta"], found["psi"]
    along = north * np.cos(psi) + east * np.sin(psi)
    across = east * np.cos(psi) - north * np.sin(psi)
    found["u ground"] = found["u"] + along * np.cos(theta)
    if "v" in found:
        found["v ground"] = found["v"] + across * np.cos(phi) + along * np.sin(theta) * np.sin(phi)
    return found


_PLACES = {"distance": "x", "depth": "z", "heading": "psi", "roll angle": "phi", "pitch angle": "theta"}


def true_values(sensor: Sensor, motion: Motion) -> Array:
    """Return what a sensor without errors measures. A distance is that north, on a straight course."""
    if sensor.quantity == "velocity":
        return motion.get(f"{sensor.axis.velocity} ground", motion[sensor.axis.velocity])
    return motion[_PLACES[sensor.quantity]]


# ---- Logs ------------------------------------------------------------------------------------------------------------


def _table(scenario: Tank, truth: Vehicle, flight: Flight, random: Random) -> dict[str, Array]:
    """Return the columns of a log by their headers."""
    logs, rows = scenario.logs, flight.time
    stamps = rows + logs.jitter * random.standard_normal(len(rows))
    table = {"time [s]": stamps}
    if flight.command is not None:
        held = np.searchsorted(flight.commands.switches, rows + 1e-9, side="right") - 1
        table["command [%]"] = 100.0 * flight.command[held]
    else:
        followed = flight.commands.at(rows + 1e-9)
        table |= {f"u_{t.name} [%]": 100.0 * followed[t.name] for t in truth.layout.thrusters}
    lates = {sensor.late for sensor in flight.sensors} | {0.0}
    at = np.unique(np.concatenate([rows - late for late in lates]))
    motion = moved(truth, flight.commands, at, flight.conditions)
    for sensor in flight.sensors:
        values = true_values(sensor, motion)[np.searchsorted(at, rows - sensor.late)]
        table[_header(sensor, flight)] = _measured(sensor, values, rows, logs, random)
    there = np.searchsorted(at, rows)
    for name in logs.columns:
        if name == "voltage":
            table["voltage [V]"] = np.array([voltage(t) for t in rows.tolist()])
        else:
            table[f"{name} [deg]"] = np.degrees(motion["phi" if name == "roll" else "theta"][there])
    return table


def _header(sensor: Sensor, flight: Flight) -> str:
    """Return the header of a sensor's column."""
    axis = sensor.axis
    if sensor.quantity == "velocity":
        return f"velocity [{axis.unit}]" if flight.command is not None else f"{axis.name} velocity [{axis.unit}]"
    unit, _ = _UNITS[axis.position_unit]
    name = sensor.quantity.removesuffix(" angle")
    return f"{name} [{unit}]" if flight.command is not None or name != "distance" else f"{axis.name} {name} [{unit}]"


def _measured(sensor: Sensor, values: Array, rows: Array, logs: Logs, random: Random) -> Array:
    """Return the values of a sensor in the rows, with noise and in the unit of the log; NaN where it has none."""
    noise = random.standard_normal(len(rows))
    if logs.correlation_time:
        colour = np.exp(-1.0 / (logs.rate * logs.correlation_time))
        noise = coloured(noise, float(colour))
    values = sensor.scale * values + sensor.noise * noise
    if sensor.resolution:
        values = np.round(values / sensor.resolution) * sensor.resolution
    if sensor.axis.is_rotation and sensor.wraps:
        values = (values + np.pi) % (2.0 * np.pi) - np.pi
    if sensor.quantity != "velocity":
        values = _UNITS[sensor.axis.position_unit][1] * values
    return np.where(np.arange(len(rows)) % sensor.every == 0, values, np.nan)
