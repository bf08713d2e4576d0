"""Dives of vehicles as owners have them: another vehicle with each seed, flown by equations that are written out here.

The four axes surge, sway, heave and yaw are coupled. Thrust is no polynomial of the command, and follows it with a lag.
The identification knows the masses and where the thrusters are, and thrust either by the file of a similar vehicle or
by a table of measured forces. Nothing here uses the mathematics of the package.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import copysign, cos, pi, radians, sin, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from tests.folders import HEAD
from tests.identify.scenarios.scenario import (
    COMMANDS,
    UNSEEN,
    VOLTAGE,
    Expected,
    Given,
    Truths,
    csv_text,
    steady_name,
    voltage,
    write_folder,
)
from verification.references.pool import NOTHING, Array, Conditions

Plan = Sequence[tuple[float, Mapping[str, float]]]
"""How long each command is held (s), and the command of each axis."""

AXES = ("surge", "sway", "heave", "yaw")
_UNITS = (("kg", "N.s2/m2", "N.s/m"),) * 3 + (("kg.m2", "N.m.s2/rad2", "N.m.s/rad"),)
"""The units of added mass, quadratic and linear drag of each axis."""
_RATE = 10.0
"""Rows per second."""
_NOISE = {
    "depth [m]": 0.012,
    "heading [deg]": 0.8,
    "yaw velocity [deg/s]": 0.6,
    "surge velocity [m/s]": 0.012,
    "sway velocity [m/s]": 0.012,
    "voltage [V]": 0.03,
    "roll [deg]": 0.3,
    "pitch [deg]": 0.3,
}
"""The standard deviation of each sensor, in the unit of its column."""
DIVE = 110.0
"""About how long a dive lasts, s. A battery that sags loses 10 % within it."""
_WAVES = 6.0
"""The period of waves, s."""


# ---- Vehicles --------------------------------------------------------------------------------------------------------


Four = tuple[float, float, float, float]
"""A number of each axis."""


@dataclass(frozen=True)
class Curve:
    """The thrust of a propeller: a power of the command beyond a dead band."""

    ahead: float
    """The thrust at full command, N."""
    astern: float
    exponent: float = 1.45
    dead_band: float = 0.06
    lag: float = 0.12
    """s."""

    def force(self, command: float) -> float:
        """Return the steady thrust, N."""
        beyond = max(abs(command) - self.dead_band, 0.0) / (1.0 - self.dead_band)
        return copysign((self.ahead if command > 0.0 else self.astern) * beyond**self.exponent, command)

    def drawn(self, random: np.random.Generator) -> "Curve":
        """Return a curve drawn beside this one."""
        return Curve(
            self.ahead * random.uniform(0.92, 1.08),
            self.astern * random.uniform(0.92, 1.08),
            random.uniform(1.38, 1.55),
            random.uniform(0.045, 0.085),
            self.lag * random.uniform(2.0 / 3.0, 4.0 / 3.0),
        )


class Thruster(NamedTuple):
    """A thruster, with its direction and its position in the body frame (m)."""

    curve: str
    direction: tuple[float, float, float]
    position: tuple[float, float, float]


@dataclass(frozen=True)
class Kind:
    """A vehicle of some size."""

    mass: float
    """kg."""
    turning: float
    """The moment of inertia about the vertical, kg.m2."""
    added: Four
    quadratic: Four
    linear: Four
    load: float
    """The net weight, positive down, N."""
    curves: Mapping[str, Curve]
    thrusters: tuple[Thruster, ...]
    hold: float = 6.0
    """How long a command of a test is held, s."""
    rest: float = 4.0
    every: int = 1
    """The velocities are measured in every row, in every second row ..."""
    has_rotors: bool = False
    """True if the speed of the rotor lags behind, and thrust is proportional to its square."""
    base: str = ""
    """The file of a similar vehicle. Without it, forces of the thrusters are measured."""

    @property
    def inertia(self) -> Array:
        """The mass or the moment of inertia of each axis with its added mass."""
        return np.add([self.mass, self.mass, self.mass, self.turning], self.added)

    @property
    def arms(self) -> Array:
        """4 x n: the force or torque on each axis by 1 N of each thruster."""
        columns = []
        for thruster in self.thrusters:
            (x, y, _), direction = thruster.position, np.array(thruster.direction)
            dx, dy, dz = direction / np.linalg.norm(direction)
            columns.append([dx, dy, dz, x * dy - y * dx])
        return np.array(columns).T

    @property
    def mix(self) -> dict[str, Array]:
        """The sign with which each thruster follows the command of an axis."""
        return dict(zip(AXES, np.sign(np.round(self.arms, 9)), strict=True))

    def forces(self, commands: Array) -> list[float]:
        """Return the steady thrust of each thruster, N."""
        return [self.curves[t.curve].force(c) for t, c in zip(self.thrusters, commands.tolist(), strict=True)]

    def steady(self, axis: str, command: float) -> float:
        """Return V_ss at a command of an axis: a V² + b V = F."""
        n = AXES.index(axis)
        a, b = self.quadratic[n], self.linear[n]
        F = float(self.arms[n] @ self.forces(self.mix[axis] * command)) + self.load * (axis == "heave")
        return copysign((sqrt(b * b + 4.0 * a * abs(F)) - b) / (2.0 * a), F)


def _vectored(scale: float, curve: str) -> tuple[Thruster, ...]:
    """Return four thrusters at 45° and two vertical ones, as a BlueROV2 has them at a scale of 1."""
    x, y = 0.156 * scale, 0.111 * scale
    corners = ((-1, 1, x, y), (-1, -1, x, -y), (1, 1, -x, y), (1, -1, -x, -y))
    level = [Thruster(curve, (dx, dy, 0.0), (px, py, 0.0)) for dx, dy, px, py in corners]
    return (*level, *(Thruster(curve, (0.0, 0.0, 1.0), (0.0, side, 0.0)) for side in (y, -y)))


_LIKE_BLUEROV2 = Kind(
    mass=12.6,
    turning=0.28,
    added=(6.0, 11.0, 15.5, 0.2),
    quadratic=(21.0, 38.0, 60.0, 1.7),
    linear=(5.0, 7.5, 6.0, 0.12),
    load=-1.6,
    curves={"t200": Curve(51.5, 40.0)},
    thrusters=_vectored(1.0, "t200"),
    base="similar.toml",
)
_WU = replace(
    _LIKE_BLUEROV2,
    mass=11.5,
    turning=0.16,
    added=(5.5, 12.7, 14.57, 0.12),
    quadratic=(18.18, 21.66, 36.99, 1.55),
    linear=(4.03, 6.22, 5.18, 0.07),
    load=-2.0,
)
"""The similar vehicle: a BlueROV2 by Wu (2018)."""
_T200 = {
    "a_t": (29.30, "N"),
    "b_t": (31.51, "N"),
    "a_t_reverse": (21.76, "N"),
    "b_t_reverse": (25.52, "N"),
    "c_0": (0.0872, "1"),
    "T": (0.0287, "s"),
}
"""The maker's thrust at 16 V, and a lag by von Benzon et al. (2022)."""
SMALL = Kind(
    mass=2.0,
    turning=0.012,
    added=(1.1, 1.8, 2.2, 0.01),
    quadratic=(8.0, 13.0, 16.0, 0.06),
    linear=(1.0, 1.5, 1.5, 0.01),
    load=-0.1,
    curves={"motor": Curve(6.0, 4.5)},
    thrusters=_vectored(0.5, "motor"),
)
"""A ROV of 2 kg."""
AUV = Kind(
    mass=100.0,
    turning=18.0,
    added=(8.0, 70.0, 70.0, 14.0),
    quadratic=(25.0, 180.0, 180.0, 60.0),
    linear=(8.0, 30.0, 30.0, 12.0),
    load=-2.0,
    curves={"main": Curve(62.0, 46.0, lag=0.3), "tunnel": Curve(40.0, 36.0, lag=0.25)},
    thrusters=(
        *(Thruster("main", (1.0, 0.0, 0.0), (-0.55, side, 0.0)) for side in (-0.3, 0.3)),
        *(Thruster("tunnel", (0.0, 0.0, 1.0), (x, 0.0, 0.0)) for x in (0.5, -0.5)),
        *(Thruster("tunnel", (0.0, 1.0, 0.0), (x, 0.0, 0.0)) for x in (0.45, -0.45)),
    ),
    hold=12.0,
    rest=10.0,
    every=2,
    has_rotors=True,
)
"""An AUV of 100 kg. Its rotors need a while to reach their speed."""


# ---- Files -----------------------------------------------------------------------------------------------------------


def _hardware(kind: Kind, curve: Mapping[str, tuple[float, str]] = {}) -> str:
    """Return the tables of the hardware; with the numbers of a thrust curve, those of a whole vehicle."""
    masses = {"m_rov": (kind.mass, "kg"), "I_r": (kind.turning, "kg.m2")}
    text = f"[body]\n{_entries(masses)}coupling = true\n"
    text += "".join(f"[curves.{name}]\n{_entries(curve)}" for name in kind.curves)
    for number, thruster in enumerate(kind.thrusters, 1):
        text += f'[[thruster]]\nname = "{number}"\ncurve = "{thruster.curve}"\n'
        text += f'direction = {{ value = {[*thruster.direction]}, source = "drawn" }}\n'
        text += f'position = {{ value = {[*thruster.position]}, unit = "m", source = "drawn" }}\n'
    for n, axis in enumerate(AXES):
        numbers = zip(("m_a", "a_d", "b_d"), (kind.added[n], kind.quadratic[n], kind.linear[n]), _UNITS[n], strict=True)
        coefficients = {key: (value, unit) for key, value, unit in numbers}
        load = {"F_0": (kind.load, "N")} if axis == "heave" else {}
        text += f"[axes.{axis}]\n" + (_entries(coefficients | load) if curve else "")
    return text


def _entries(quantities: Mapping[str, tuple[float, str]]) -> str:
    """Return the lines of quantities with their units."""
    return "".join(
        f'{name} = {{ value = {value}, unit = "{unit}", source = "measured" }}\n'
        for name, (value, unit) in quantities.items()
    )


@dataclass(frozen=True)
class Owner:
    """Three dives of a vehicle of a kind. The first two are for the fit, and the third is held out by hand."""

    kind: Kind = _LIKE_BLUEROV2
    conditions: Conditions = NOTHING
    """Saturation, a changing thrust, a tether and rocking act. Delays and currents do not."""
    waves: float = 0.0
    """The amplitude of the water's motion in waves, m. The vehicle, which is as heavy as the water, moves with it."""
    columns: tuple[str, ...] = ()
    """More columns: voltage, roll, pitch."""
    expected: Expected = field(default_factory=lambda: Expected(like_owners=True))

    def vehicle(self, random: np.random.Generator) -> Kind:
        """Return a vehicle with thrust curves that are drawn beside those of its kind."""
        return replace(self.kind, curves={name: curve.drawn(random) for name, curve in self.kind.curves.items()})

    def truths(self, seed: int) -> Truths:
        """Return V_ss of each axis, and the lag of thrusters that have one."""
        vehicle = self.vehicle(np.random.default_rng(seed))
        found = {(axis, steady_name(c)): vehicle.steady(axis, c) for axis in AXES for c in COMMANDS}
        if not vehicle.has_rotors:
            found |= {("", f"T_{name}"): curve.lag for name, curve in vehicle.curves.items()}
        return found

    def write(self, seed: int, folder: Path) -> None:
        """Write the dives of the fit, rov.toml and what it needs, and the third dive to the folder UNSEEN."""
        random = np.random.default_rng(seed)
        vehicle = self.vehicle(random)
        tables = [self._table(vehicle, plan, random) for plan in _plans(self.kind, random)]
        *dives, held_out = tables
        files = {f"dive_{n}.csv": table for n, table in enumerate(dives, 1)}
        fit = ("lag", *["voltage"] * ("voltage" in self.columns), *["attitude"] * ("roll" in self.columns))
        known = {f"V_0_{name}": Given(VOLTAGE, "V") for name in vehicle.curves if "voltage" in self.columns}
        if self.kind.base:
            known |= {"m_rov": Given(vehicle.mass, "kg"), "I_r": Given(vehicle.turning, "kg.m2")}
            write_folder(folder, files, base=self.kind.base, known=known, fit=fit)
            similar = f"format = 2\n{HEAD}[validity]\ncommand_min = 0.0\ncommand_max = 1.0\n{_hardware(_WU, _T200)}"
            (folder / self.kind.base).write_text(similar, encoding="utf-8")
        else:
            files |= {f"thrust_{name}.csv": _pulled(curve, random) for name, curve in vehicle.curves.items()}
            write_folder(folder, files, hardware=_hardware(vehicle), known=known, fit=fit)
        (folder / UNSEEN).mkdir()
        (folder / UNSEEN / "dive_3.csv").write_text(csv_text(held_out), encoding="utf-8")

    def _table(self, vehicle: Kind, plan: Plan, random: np.random.Generator) -> dict[str, Array]:
        """Return the columns of a dive."""
        time, commands, states = fly(vehicle, plan, self.conditions)
        tilts = np.array(
            [self.conditions.tilt.at(t)[:2] if self.conditions.tilt else (0.0, 0.0) for t in time.tolist()]
        )
        phase, psi = 2.0 * pi * time / _WAVES, states[:, 7]
        drift = self.waves * 2.0 * pi / _WAVES * np.cos(phase)
        true = {
            "depth [m]": 14.0 + states[:, 6] + self.waves * np.cos(phase),
            "heading [deg]": np.degrees(psi),
            "yaw velocity [deg/s]": np.degrees(states[:, 3]),
            "surge velocity [m/s]": states[:, 0] + drift * np.cos(psi),
            "sway velocity [m/s]": states[:, 1] - drift * np.sin(psi),
            "voltage [V]": np.array([voltage(t, DIVE) for t in time.tolist()]),
            "roll [deg]": np.degrees(tilts[:, 0]),
            "pitch [deg]": np.degrees(tilts[:, 1]),
        }
        pulses = {f"u_{n} [us]": np.round(1500.0 + 400.0 * column) for n, column in enumerate(commands.T, 1)}
        table = {"time [s]": time, **pulses}
        for header, values in true.items():
            quantity, _, _ = header.partition(" [")
            if quantity in ("voltage", "roll", "pitch") and quantity not in self.columns:
                continue
            measured = values + _NOISE[header] * random.standard_normal(len(time))
            missing = quantity.endswith("velocity") & (np.arange(len(time)) % vehicle.every > 0)
            table[header] = np.where(missing, np.nan, measured % 360.0 if quantity == "heading" else measured)
        return table


def _pulled(curve: Curve, random: np.random.Generator) -> dict[str, Array]:
    """Return a table of measured forces of one thruster, each with an error of 1 %."""
    commands = np.array([-100.0, -80.0, -60.0, -40.0, -25.0, -15.0, 15.0, 25.0, 40.0, 60.0, 80.0, 100.0])
    forces = np.array([curve.force(0.01 * c) for c in commands.tolist()])
    return {"command [%]": commands, "force [N]": forces * (1.0 + 0.01 * random.standard_normal(len(forces)))}


def _plans(kind: Kind, random: np.random.Generator) -> Iterator[Plan]:
    """Yield the plans of three dives: steps of surge and yaw, steps of heave and sway, and two axes at once."""

    def steps(axis: str, levels: Sequence[float]) -> list[tuple[float, Mapping[str, float]]]:
        first = kind.rest + random.uniform(0.0, 1.0 / _RATE)  # commands switch between rows
        return [(first, {}), *(part for c in levels for part in ((kind.hold, {axis: c}), (kind.rest, {})))]

    yield steps("surge", (0.25, -0.25, 0.4, -0.4, 0.6, -0.6)) + steps("yaw", (0.2, -0.2, 0.35, -0.35))
    yield steps("heave", (0.2, -0.25, 0.35, -0.35, 0.5)) + steps("sway", (0.25, -0.25, 0.4, -0.4, 0.6, -0.6))
    free: list[tuple[float, Mapping[str, float]]] = [(3.0, {})]
    for _ in range(40):
        pair = random.choice(AXES, 2, replace=False).tolist()
        hold = random.uniform(1.0, 4.0) * kind.hold / 6.0
        free.append((hold, {axis: random.uniform(-0.4, 0.4) for axis in pair}))
    yield [*free, (5.0, {})]


# ---- Motion ----------------------------------------------------------------------------------------------------------


def fly(vehicle: Kind, plan: Plan, conditions: Conditions = NOTHING) -> tuple[Array, Array, Array]:
    """Return the times of n rows (s), the commands that they tell, and the states: u, v, w, r, x, y, z, psi, thrust.

    Positions are relative to the start. The integration begins anew with each command.
    """
    ends = np.cumsum([hold for hold, _ in plan])
    asked = [
        sum((c * vehicle.mix[axis] for axis, c in axes.items()), np.zeros(len(vehicle.thrusters))) for _, axes in plan
    ]
    commands = np.clip(asked, -1.0, 1.0)
    time = np.arange(0.0, ends[-1], 1.0 / _RATE)
    states, state, start = np.empty((len(time), 8 + len(vehicle.thrusters))), np.zeros(8 + len(vehicle.thrusters)), 0.0
    state[7] = radians(37.0)
    states[0] = state
    for end, command in zip(ends.tolist(), commands, strict=True):
        inside = (time > start) & (time <= end)
        rates = _rates(vehicle, np.clip(command, -conditions.saturation, conditions.saturation), conditions)
        at = np.append(time[inside], end)
        solution = solve_ivp(rates, (start, end), state, "DOP853", t_eval=np.unique(at), rtol=1e-8, atol=1e-10)
        assert solution.success, solution.message
        states[inside], state, start = solution.y.T[: inside.sum()], solution.y[:, -1], end
    return time, commands[np.searchsorted(ends, time, side="right")], states


def _rates(vehicle: Kind, command: Array, conditions: Conditions) -> Callable[[float, Array], Array]:
    """Return the function of time and state that gives the derivatives under held commands."""
    M, a, b, arms = vehicle.inertia, np.array(vehicle.quadratic), np.array(vehicle.linear), vehicle.arms
    steady = np.array(vehicle.forces(command))
    lags = np.array([vehicle.curves[t.curve].lag for t in vehicle.thrusters])
    stiffness = np.array(conditions.tether)

    def derivatives(time: float, state: Array) -> Array:
        nu, place, psi, thrust = state[:4], state[4:7], float(state[7]), state[8:]
        u, v, _, r = nu.tolist()
        phi, theta, theta_rate = conditions.tilt.at(time) if conditions.tilt else (0.0, 0.0, 0.0)
        cf, sf, ct, st, cp, sp = cos(phi), sin(phi), cos(theta), sin(theta), cos(psi), sin(psi)
        R = np.array(
            [
                [cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf],
                [sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf],
                [-st, ct * sf, ct * cf],
            ]
        )
        force = arms @ (thrust * np.abs(thrust) if vehicle.has_rotors else thrust) - (a * np.abs(nu) + b) * nu
        force[:3] += R.T @ (np.array([0.0, 0.0, vehicle.load]) - stiffness * place)
        force += [M[1] * v * r, -M[0] * u * r, 0.0, (M[0] - M[1]) * u * v]
        goal = steady * (conditions.thrust(time) if conditions.thrust else 1.0)
        if vehicle.has_rotors:
            goal = np.sign(goal) * np.sqrt(np.abs(goal))
        turn = (r + theta_rate * sf) / (cf * ct)
        return np.concatenate([force / M, R @ nu[:3], [turn], (goal - thrust) / lags])

    return derivatives
