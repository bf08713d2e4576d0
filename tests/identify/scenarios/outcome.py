"""Fly a scenario, write its logs, identify the vehicle, and keep what is judged."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from rov_fmu.identify.adapter.tank_tests import load_tank_tests
from rov_fmu.identify.effects import catalogue as effects
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.identify import identify
from rov_fmu.io.messages import FileError
from rov_fmu.model.rov import Rov
from rov_fmu.tank.findings import Finding
from tests.folders import HEAD, folder_of
from tests.identify.scenarios.catalogue import Logs, Scenario, Sensor, voltage
from tests.recordings import PLANS
from verification.references import pool, rigid_pool
from verification.references.pool import Array, Commands, Conditions

Random = np.random.Generator
Motion = Mapping[str, Array]

ALARMS = frozenset({"unexplained", "poor prediction", "scales differ"})
"""The kinds of findings that say that the model does not explain the data, or that the data contradict each other."""
EFFECTS = frozenset(effects.EFFECTS)
"""The kinds of findings that report an effect in the model or taken out of the data."""

_PATTERNS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "videoray": {"surge": {"l": 1.0, "r": 1.0}, "heave": {"t": 1.0}, "yaw": {"l": 1.0, "r": -1.0}},
    "bluerov2_heavy": {
        "surge": {"1": -1.0, "2": -1.0, "3": 1.0, "4": 1.0},
        "sway": {"1": 1.0, "2": -1.0, "3": 1.0, "4": -1.0},
        "yaw": {"1": 1.0, "2": -1.0, "3": -1.0, "4": 1.0},
        "heave": {"5": 1.0, "6": 1.0, "7": 1.0, "8": 1.0},
        "roll": {"5": 1.0, "6": -1.0, "7": 1.0, "8": -1.0},
        "pitch": {"5": -1.0, "6": -1.0, "7": 1.0, "8": 1.0},
    },
}
"""The thrusters that a stick or a test of each axis drives, with their signs, by vehicle."""
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
_UNITS = {"m": ("m", 1.0), "rad": ("deg", 180.0 / np.pi)}
"""The unit of a logged position, and its factor, by the unit of the position."""


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


def flights(scenario: Scenario, random: Random) -> Iterator[Flight]:
    """Yield the recordings of a scenario."""
    logs, patterns, given = scenario.logs, _PATTERNS[scenario.vehicle], scenario.conditions
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


def moved(truth: Rov, commands: Commands, at: Array, conditions: Conditions) -> Motion:
    """Return the motion at ascending times, with the surge and sway velocity over ground as `u ground`, `v ground`."""
    simulate = rigid_pool.motion if truth.layout.has_attitude else pool.motion
    found = simulate(truth, commands, np.maximum(at, 0.0), conditions)
    if "phi" not in found:
        tilts = [conditions.tilt.at(t)[:2] if conditions.tilt else (0.0, 0.0) for t in at.tolist()]
        found["phi"], found["theta"] = np.array(tilts).T
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


def write(scenario: Scenario, seed: int, folder: Path) -> Path:
    """Write rov.toml and the logs of a scenario to a folder."""
    random, truth = np.random.default_rng(seed), scenario.truth
    tables = {}
    for flight in flights(scenario, random):
        table = _table(scenario, truth, flight, random)
        lines = [",".join(table)]
        lines += [",".join("" if np.isnan(x) else f"{x:.8g}" for x in row) for row in zip(*table.values(), strict=True)]
        tables[flight.file] = "\n".join(lines) + "\n"
    return folder_of(folder, f'base = "{scenario.vehicle}"\n{HEAD}{scenario.rov_file}', tables)


def _table(scenario: Scenario, truth: Rov, flight: Flight, random: Random) -> dict[str, Array]:
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
        noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], noise)
    values = sensor.scale * values + sensor.noise * noise
    if sensor.resolution:
        values = np.round(values / sensor.resolution) * sensor.resolution
    if sensor.axis.is_rotation and sensor.wraps:
        values = (values + np.pi) % (2.0 * np.pi) - np.pi
    if sensor.quantity != "velocity":
        values = _UNITS[sensor.axis.position_unit][1] * values
    return np.where(np.arange(len(rows)) % sensor.every == 0, values, np.nan)


# ---- Identification --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Estimate:
    """A coefficient as it was identified, with its 95 % interval."""

    value: float
    interval: tuple[float, float] | None


@dataclass(frozen=True)
class Outcome:
    """What the identification of one seed of a scenario gave."""

    coefficients: Mapping[str, Estimate]
    """The coefficients that are judged; empty where the identification was refused."""
    rov: Rov | None
    """The identified vehicle; None where the identification was refused."""
    findings: tuple[Finding, ...]
    sentences: tuple[str, ...]
    error: str
    """The message of a refusal or of a crash, or which intervals exclude their values; empty without."""
    seconds: float
    """The processor time of reading and identification."""

    @property
    def alarms(self) -> tuple[Finding, ...]:
        """The findings that say that the model does not explain the data."""
        return tuple(finding for finding in self.findings if finding.kind in ALARMS)


def outcome(scenario: Scenario, seed: int, folder: Path) -> Outcome:
    """Write the logs of a scenario to a folder and identify the vehicle from them."""
    write(scenario, seed, folder)
    begin = time.process_time()
    try:
        found = identify(load_tank_tests(folder))
    except FileError as error:
        return Outcome({}, None, (), (), str(error), time.process_time() - begin)
    except Exception as error:  # a crash is judged like a refusal, so that the other seeds are still run
        return Outcome({}, None, (), (), f"{type(error).__name__}: {error}", time.process_time() - begin)
    seconds, vehicle = time.process_time() - begin, found.vehicle
    coefficients = {
        name: Estimate(vehicle.rov[name], vehicle.intervals.get(name))
        for name in scenario.coefficients
        if name in vehicle.rov.coefficients
    }
    wrong = [name for name, (low, high) in vehicle.intervals.items() if not low <= vehicle.rov[name] <= high]
    excluded = f"intervals exclude their values: {', '.join(wrong)}" if wrong else ""
    return Outcome(coefficients, vehicle.rov, found.findings, sentences(found.findings), excluded, seconds)
