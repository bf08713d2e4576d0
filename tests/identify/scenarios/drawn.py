"""Vehicles that are drawn anew with each seed, in water that does what the model of a log knows, or what it lacks.

Two thrusters drive surge and yaw, and a third one may drive heave. The simulator is written out here (Runge-Kutta steps
of 20 ms), and shares no line with the identification. The folders are small, so that hundreds can be identified.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import copysign, cos, exp, log, sin, sqrt
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.signal import lfilter

from rov_fmu.identify.assess import COMMANDS
from tests.folders import THRUSTER
from tests.identify.scenarios.scenario import (
    NOTHING_SPECIAL,
    VOLTAGE,
    Expected,
    Given,
    Table,
    Truths,
    answer_names,
    write_folder,
)
from verification.references.pool import Array

_STEP, _ROW = 0.02, 5
"""The step of the simulator, s, and the number of steps between two rows of a log."""
_NOISE = {"surge": 0.008, "yaw": np.radians(0.4), "heave": 0.006}
"""The noise of the sensors: surge velocity (m/s), heading (rad), and depth (m)."""
_HEADERS = {"surge": "surge velocity [m/s]", "yaw": "heading [deg]", "heave": "depth [m]"}
_PLACE = 'position = {{ value = [-0.15, {0}, 0.0], unit = "m", source = "drawn" }}\n'


@dataclass(frozen=True)
class Battery:
    """A battery of 16 V whose voltage is logged."""

    exponent: float
    """Thrust is proportional to this power of the voltage: 0 for thrusters whose speed is regulated."""
    sag: float = 0.0
    """The share of the voltage that is lost until the end of a log."""
    droop: float = 0.0
    """The share that is lost at full command of all thrusters."""
    noise: float = 0.03
    """V."""

    def voltage(self, asked: Sequence[float], part: float) -> float:
        """Return the voltage after a part of a log, V."""
        load = sum(c * c for c in asked) / len(asked)
        return VOLTAGE * (1.0 - self.sag * part - self.droop * load)


@dataclass(frozen=True)
class Fault:
    """What the water or the logger does, of which the identification is told nothing."""

    rotor: bool = False
    """The speed of the rotor lags behind, and not its force."""
    health: tuple[float, float] = (1.0, 1.0)
    """The factor of the thrust of each thruster of the pair: 0 is dead, -1 reversed."""
    is_swapped: bool = False
    slew: float = np.inf
    """How fast the thrusters follow a command, 1/s."""
    saturation: float = 1.0
    """The largest command that the thrusters follow."""
    tether: float = 0.0
    """The stiffness of a tether, N/m."""
    sag: float = 0.0
    """The share of the thrust that is lost until the end of a log."""
    unit: float = 1.0
    """The factor of a logged velocity."""
    late: float = 0.0
    """How much later than the clock of the commands that of the sensors is, s; a multiple of the time of a row."""
    filter: float = 0.0
    """The time constant of a filter in each sensor, s."""
    current: float = 0.0
    """m/s."""
    battery: Battery = Battery(0.0)


@dataclass(frozen=True)
class Body:
    """The numbers of a vehicle by axis: inertia without and with added mass, drag, load; and those of its thrusters."""

    dry: Mapping[str, float]
    inertia: Mapping[str, float]
    drag: Mapping[str, tuple[float, float, float]]
    """Quadratic, linear, and the factor of both astern."""
    load: float
    """In heave, N."""
    arm: float
    full: float
    """The thrust of a thruster at full command, N."""
    astern: float
    dead_band: float
    loss: float
    """The share of the full thrust that is lost per speed of advance, s/m."""
    lag: float
    power: float = 2.0
    """Thrust is proportional to this power of a command beyond the dead band."""

    def beyond(self, command: float) -> float:
        """Return a command beyond the dead band, relative to the full one."""
        size = (abs(command) - self.dead_band) / (1.0 - self.dead_band)
        return copysign(size, command) if size > 0.0 else 0.0

    def force(self, command: float) -> float:
        """Return the thrust of a thruster at rest, N."""
        e = self.beyond(command)
        return copysign(self.full * (self.astern if command < 0.0 else 1.0) * abs(e) ** self.power, e)

    def answers(self, axis: str, command: float, health: Sequence[float], *, rotor: bool) -> tuple[float, float, float]:
        """Return V_ss, the time to 63 % of it, and the stopping distance of the axis alone, by quadrature.

        The loss of thrust is in proportion to the command, or with `rotor` to the rotor's speed.
        """
        signs = {"surge": (1.0, 1.0), "yaw": (1.0, -1.0), "heave": (1.0,)}[axis]  # port turns it to starboard
        lever = self.arm if axis == "yaw" else 1.0
        pair = [(h, sign * command, sign * lever) for h, sign in zip(health, signs, strict=False)]
        push = sum(h * self.force(c) * lever for h, c, lever in pair) + (self.load if axis == "heave" else 0.0)
        turns = abs(self.beyond(command) if rotor else command)
        loss = sum(
            h * self.loss * self.full * (self.astern if c < 0.0 else 1.0) * turns * lever**2 for h, c, lever in pair
        )
        a, b, ratio = self.drag[axis]
        if push < 0.0:
            a, b = ratio * a, ratio * b
        F, B, M = abs(push), b + loss, self.inertia[axis]
        V = (sqrt(B * B + 4.0 * a * F) - B) / (2.0 * a)
        rise, _ = quad(lambda v: M / (F - (B + a * v) * v), 0.0, (1.0 - exp(-1.0)) * V)
        return copysign(V, push), rise, M / a * log((a * V + b) / (0.1 * a * V + b))


def drawn_body(random: np.random.Generator, load: float, lag: float | None, power: float) -> Body:
    """Draw a vehicle of 6 to 14 kg. `load` is relative to the full thrust."""
    mass, full = random.uniform(6.0, 14.0), random.uniform(18.0, 40.0)
    dry = {"surge": mass, "heave": mass, "yaw": mass * random.uniform(0.014, 0.024)}
    added = {"surge": (1.2, 1.6), "heave": (1.5, 2.2), "yaw": (1.3, 1.9)}
    fast = {"surge": (1.2, 1.7), "heave": (0.6, 1.0), "yaw": (3.0, 5.0)}
    arm = random.uniform(0.12, 0.2)
    push = {"surge": 2.0 * full, "heave": full, "yaw": 1.8 * full * arm}
    drag = {}
    for axis, (low, high) in fast.items():
        V, linear = random.uniform(low, high), random.uniform(0.08, 0.25)
        astern = random.uniform(0.9, 1.15) if axis != "yaw" else 1.0
        drag[axis] = ((1.0 - linear) * push[axis] / V**2, linear * push[axis] / V, astern)
    inertia = {axis: dry[axis] * random.uniform(*limits) for axis, limits in added.items()}
    loss = random.uniform(0.0, 0.15)
    T = random.uniform(0.05, 0.2) if lag is None else lag
    shape = random.uniform(0.7, 1.0), random.uniform(0.02, 0.06)
    return Body(dry, inertia, drag, load * full, arm, full, *shape, loss, T, power)


@dataclass(frozen=True)
class Drawn:
    """Two logs of a vehicle of its own for each seed, and a table of the forces of its thrusters."""

    axes: tuple[str, ...] = ("surge", "yaw")
    sensors: tuple[str, ...] = ("surge", "yaw")
    """The axes that a sensor shows: the velocity in surge, the heading, and the depth."""
    fault: Fault = Fault()
    load: float = 0.0
    """Relative to the full thrust of a thruster."""
    lag: float | None = None
    power: float = 2.0
    """Of the thrust over the command."""
    alone: bool = False
    """True if each log drives one axis only."""
    seconds: float = 60.0
    has_voltage: bool = False
    """True if the logs have the voltage of the battery."""
    expected: Expected = NOTHING_SPECIAL

    def truths(self, seed: int) -> Truths:
        """Return the answers of each axis that a sensor shows, those of a weak or dead thruster with its weakness.

        A battery that sags has its average thrust: logs without its voltage do not show which of it is the full one.
        """
        body = self._body(np.random.default_rng(seed))
        battery = self.fault.battery
        thrust = 1.0 if self.has_voltage else (1.0 - 0.5 * battery.sag) ** battery.exponent
        body = replace(body, full=body.full * (1.0 - 0.5 * self.fault.sag) * thrust)
        health = [abs(h) for h in self.fault.health]
        found: dict[tuple[str, str], float] = {}
        for axis in self.sensors:
            for command in COMMANDS:
                names = [(axis, name) for name in answer_names(command)]
                followed = copysign(min(abs(command), self.fault.saturation), command)
                found |= zip(names, body.answers(axis, followed, health, rotor=self.fault.rotor), strict=True)
        return found

    def _body(self, random: np.random.Generator) -> Body:
        return drawn_body(random, self.load * random.choice([-1.0, 1.0]), self.lag, self.power)

    def write(self, seed: int, folder: Path) -> None:
        """Write the logs, the table and rov.toml."""
        random = np.random.default_rng(seed)
        body = self._body(random)
        tables: dict[str, Table] = {"thrust_main.csv": self._pulled(body, random)}
        for n in range(2):
            driven = (self.axes[n % len(self.axes)],) if self.alone else self.axes
            tables[f"dive_{n}.csv"] = self._log(body, self._commands(random, driven), random)
        hardware = f'\n[body]\nm_rov = {{ value = {body.dry["surge"]:.6g}, unit = "kg", source = "weighed" }}\n'
        hardware += f'I_r = {{ value = {body.dry["yaw"]:.6g}, unit = "kg.m2", source = "drawn" }}\n\n[curves.main]\n'
        for name, y in (("port", -body.arm), ("stbd", body.arm)):
            hardware += THRUSTER.format(name=name, x=1.0, y=0.0, z=0.0).replace("t200", "main") + _PLACE.format(y)
        if "heave" in self.axes:
            hardware += THRUSTER.format(name="top", x=0.0, y=0.0, z=1.0).replace("t200", "main")
        hardware += "".join(f"[axes.{axis}]\n" for axis in self.axes)
        at = {"V_0_main": Given(VOLTAGE, "V")} if self.has_voltage else {}
        write_folder(folder, tables, hardware=hardware, known=at, fit=["voltage"] * self.has_voltage)

    def _pulled(self, body: Body, random: np.random.Generator) -> Table:
        """Return measured forces with errors of 1.5 %, and 0.3 % of the full force."""
        commands = np.array([-1.0, -0.8, -0.6, -0.4, -0.25, -0.15, -0.08, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 1.0])
        forces = np.array([body.force(c) for c in commands.tolist()])
        errors = 0.015 * forces, 0.003 * body.full
        forces = forces + sum(error * random.standard_normal(len(forces)) for error in errors)
        return {"command [%]": 100.0 * commands, "force [N]": forces}

    def _commands(self, random: np.random.Generator, driven: Sequence[str]) -> Array:
        """Return the commands of port, starboard and top in each row: levels of the axes that are held for a while."""
        rows = round(self.seconds / _STEP / _ROW)
        sticks = {axis: np.zeros(rows) for axis in ("surge", "yaw", "heave")}
        for axis in driven:
            at = 30
            while at < rows:
                end = at + int(random.integers(8, 50))
                most = 0.35 if axis == "yaw" else 0.65
                sticks[axis][at:end] = random.choice([0.0, -1.0, 1.0], p=[0.25, 0.35, 0.4]) * random.uniform(0.15, most)
                at = end
        surge, yaw = sticks["surge"], sticks["yaw"]
        return np.asarray(np.round(np.clip([surge + yaw, surge - yaw, sticks["heave"]], -1.0, 1.0), 3))

    def _log(self, body: Body, commands: Array, random: np.random.Generator) -> Table:
        """Return the columns of a log."""
        motion = flown(body, self.fault, commands, random.uniform(-3.0, 3.0))
        time = np.arange(commands.shape[1]) * _STEP * _ROW
        names = ("port", "stbd", "top")[: 2 + ("heave" in self.axes)]
        table = {"time [s]": time} | {f"{n} [%]": 100.0 * c for n, c in zip(names, commands, strict=False)}
        for axis in self.sensors:
            values = _shown(motion[axis], self.fault) + _NOISE[axis] * random.standard_normal(len(time))
            if axis == "surge":
                values = self.fault.unit * values
            table[_HEADERS[axis]] = np.degrees(values) % 360.0 if axis == "yaw" else values
        if self.has_voltage:
            table["voltage [V]"] = motion["voltage"] + self.fault.battery.noise * random.standard_normal(len(time))
        return table


def flown(body: Body, fault: Fault, commands: Array, heading: float) -> dict[str, Array]:
    """Return the surge velocity over ground, heading, depth and voltage at each row. The commands are 3 x rows."""
    arms, health = (-body.arm, body.arm, 0.0), (*fault.health, 1.0)
    last = commands.shape[1] * _ROW

    def rates(y: Sequence[float], asked: Sequence[float], thrust: float) -> list[float]:
        u, w, r, north, east, _, psi, *rotors = y
        X = N = Z = 0.0
        lagging = []
        for n, (state, c, arm) in enumerate(zip(rotors, asked, arms, strict=True)):
            v_a = w if n == 2 else u - arm * r
            e = body.beyond(c)
            if fault.rotor:
                goal, force, turns = e, copysign(abs(state) ** body.power, state), abs(state)
            else:
                goal, force, turns = copysign(abs(e) ** body.power, e), state, abs(c)
            lagging.append((goal - state) / body.lag)
            F = (
                thrust
                * health[n]
                * body.full
                * (body.astern if state < 0.0 else 1.0)
                * (force - body.loss * turns * v_a)
            )
            X, N, Z = (X, N, Z + F) if n == 2 else (X + F, N - arm * F, Z)
        X -= fault.tether * (north * cos(psi) + east * sin(psi))
        Z += body.load
        found = []
        for axis, v, F in (("surge", u, X), ("heave", w, Z), ("yaw", r, N)):
            a, b, astern = body.drag[axis]
            found.append((F - (astern if v < 0.0 else 1.0) * (a * abs(v) + b) * v) / body.inertia[axis])
        return [*found, u * cos(psi) + fault.current, u * sin(psi), w, r, *lagging]

    y, followed = [*[0.0] * 6, heading, *[0.0] * 3], [0.0] * 3
    rows = []
    for step in range(last):
        if step % _ROW == 0:
            volts = fault.battery.voltage(commands[:, step // _ROW].tolist(), step / last)
            rows.append((y[0] + fault.current * cos(y[6]), y[6], 10.0 + y[5], volts))
            asked = np.clip(commands[:, step // _ROW], -fault.saturation, fault.saturation).tolist()
            if fault.is_swapped:
                asked = [asked[1], asked[0], asked[2]]
        most = fault.slew * _STEP
        followed = [f + min(max(a - f, -most), most) for f, a in zip(followed, asked, strict=True)]
        volts = fault.battery.voltage(followed, step / last)
        thrust = (1.0 - fault.sag * step / last) * (volts / VOLTAGE) ** fault.battery.exponent
        k1 = rates(y, followed, thrust)
        k2 = rates([a + 0.5 * _STEP * b for a, b in zip(y, k1, strict=True)], followed, thrust)
        k3 = rates([a + 0.5 * _STEP * b for a, b in zip(y, k2, strict=True)], followed, thrust)
        k4 = rates([a + _STEP * b for a, b in zip(y, k3, strict=True)], followed, thrust)
        y = [a + _STEP / 6.0 * (b + 2.0 * (c + d) + e) for a, b, c, d, e in zip(y, k1, k2, k3, k4, strict=True)]
    return dict(zip(("surge", "yaw", "heave", "voltage"), np.array(rows).T, strict=True))


def _shown(true: Array, fault: Fault) -> Array:
    """Return what a sensor without noise shows in each row."""
    rows = np.maximum(np.arange(len(true)) - round(fault.late / (_STEP * _ROW)), 0)
    kept = exp(-_STEP * _ROW / fault.filter) if fault.filter else 0.0
    return np.asarray(true[0] + lfilter([1.0 - kept], [1.0, -kept], true[rows] - true[0]))
