"""Dives of vehicles as owners have them: another vehicle with each seed, whose thrust is no polynomial of the command.

The four axes surge, sway, heave and yaw are coupled, and thrust follows the command with a lag. The identification
knows the masses and where the thrusters are, and thrust either by the file of a similar vehicle or by a table of
measured forces.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import copysign, pi
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES, HEAVE, SURGE, SWAY, YAW
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
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
from tests.identify.scenarios.tank import driven, moved, tilted
from tests.recordings import with_more
from tests.vehicles import extended
from verification.references.pool import NOTHING, Array, Commands, Conditions

Plan = Sequence[tuple[float, Mapping[str, float]]]
"""How long each command is held (s), and the command of each axis."""

_FOUR = (SURGE, SWAY, HEAVE, YAW)
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
_FAINT_TORQUE = 1e-12
"""An unstable heading turns to one side at last, as that of any real vehicle does, N.m."""


# ---- Vehicles --------------------------------------------------------------------------------------------------------


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


@dataclass(frozen=True)
class Kind:
    """A vehicle of some size, with its own curves in place of those of its file."""

    path: Path
    curves: Mapping[str, Curve]
    other: Mapping[str, float] = field(default_factory=dict)
    """Coefficients that differ from those of the file, which is then known as that of a similar vehicle. Without any,
    forces of the thrusters are measured."""
    hold: float = 6.0
    """How long a command of a test is held, s."""
    rest: float = 4.0
    every: int = 1
    """The velocities are measured in every row, in every second row ..."""
    has_rotors: bool = False
    """True if the speed of the rotor lags behind, and thrust is proportional to its square."""

    @cached_property
    def vehicle(self) -> Vehicle:
        """The vehicle, with the lags of its curves."""
        lags = {f"T_{name}": curve.lag for name, curve in self.curves.items()}
        return load_vehicle(self.path).with_(**{**self.other, **lags})

    @property
    def hardware(self) -> str:
        """The tables of the vehicle's file without what is to be identified."""
        _, body, tables = self.path.read_text(encoding="utf-8").partition("[body]")
        return re.sub(r"^(m_a|a_d|b_d|F_0|[ab]_t(_reverse)?|T) = .*\n", "", body + tables, flags=re.M)

    def drawn(self, random: np.random.Generator) -> "Kind":
        """Return a vehicle with thrust curves that are drawn beside those of its kind."""
        return replace(self, curves={name: curve.drawn(random) for name, curve in self.curves.items()})

    def steady(self, axis: str, command: float) -> float:
        """Return V_ss at a command, at which curves of straight lines push like those of the vehicle."""
        lines: dict[str, float] = {}
        for name, curve in self.curves.items():
            lines |= {f"a_t_{name}": 0.0, f"a_t_{name}_reverse": 0.0, f"c_0_{name}": 0.0}
            lines[f"b_t_{name}"] = curve.force(abs(command)) / abs(command)
            lines[f"b_t_{name}_reverse"] = curve.force(-abs(command)) / -abs(command)
        return extended(self.vehicle, **lines).response(AXES[axis], command)[0]


LIKE_BLUEROV2 = Kind(
    SHIPPED["bluerov2"],
    {"t200": Curve(51.5, 40.0)},
    {"m_rov": 12.6, "I_r": 0.28, "F_0_w": -1.6}
    | {"m_a_u": 6.0, "m_a_v": 11.0, "m_a_w": 15.5, "m_a_r": 0.2}
    | {"a_d_u": 21.0, "a_d_v": 38.0, "a_d_w": 60.0, "a_d_r": 1.7}
    | {"b_d_u": 5.0, "b_d_v": 7.5, "b_d_w": 6.0, "b_d_r": 0.12},
)
SMALL = Kind(Path(__file__).with_name("rov_of_2_kg.toml"), {"motor": Curve(6.0, 4.5)})
AUV = Kind(
    Path(__file__).with_name("auv_of_100_kg.toml"),
    {"main": Curve(62.0, 46.0, lag=0.3), "tunnel": Curve(40.0, 36.0, lag=0.25)},
    hold=12.0,
    rest=10.0,
    every=2,
    has_rotors=True,
)


# ---- Dives -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Owner:
    """Three dives of a vehicle of a kind. The first two are for the fit, and the third is held out by hand."""

    kind: Kind = LIKE_BLUEROV2
    conditions: Conditions = NOTHING
    """Saturation, a changing thrust, a tether and rocking act. Delays and currents do not."""
    waves: float = 0.0
    """The amplitude of the water's motion in waves, m. The vehicle, which is as heavy as the water, moves with it."""
    columns: tuple[str, ...] = ()
    """More columns: voltage, roll, pitch."""
    expected: Expected = field(default_factory=lambda: Expected(like_owners=True))

    def truths(self, seed: int) -> Truths:
        """Return V_ss of each axis, and the lag of thrusters that have one."""
        kind = self.kind.drawn(np.random.default_rng(seed))
        found = {(axis.name, steady_name(c)): kind.steady(axis.name, c) for axis in _FOUR for c in COMMANDS}
        if not kind.has_rotors:
            found |= {("", f"T_{name}"): curve.lag for name, curve in kind.curves.items()}
        return found

    def write(self, seed: int, folder: Path) -> None:
        """Write the dives of the fit and rov.toml, and the third dive to the folder UNSEEN."""
        random = np.random.default_rng(seed)
        kind = self.kind.drawn(random)
        *dives, held_out = [self._table(kind, plan, random) for plan in _plans(kind, random)]
        files = {f"dive_{n}.csv": table for n, table in enumerate(dives, 1)}
        fit = ("lag", *["voltage"] * ("voltage" in self.columns), *["attitude"] * ("roll" in self.columns))
        known = {f"V_0_{name}": Given(VOLTAGE, "V") for name in kind.curves if "voltage" in self.columns}
        if kind.other:
            known |= {"m_rov": Given(kind.vehicle["m_rov"], "kg"), "I_r": Given(kind.vehicle["I_r"], "kg.m2")}
            write_folder(folder, files, base=kind.path.stem, known=known, fit=fit)
        else:
            files |= {f"thrust_{name}.csv": _pulled(curve, random) for name, curve in kind.curves.items()}
            write_folder(folder, files, hardware=kind.hardware, known=known, fit=fit)
        (folder / UNSEEN).mkdir()
        (folder / UNSEEN / "dive_3.csv").write_text(csv_text(held_out), encoding="utf-8")

    def _table(self, kind: Kind, plan: Plan, random: np.random.Generator) -> dict[str, Array]:
        """Return the columns of a dive. Commands are logged before the thrusters saturate."""
        commands, seconds = commanded(kind, plan)
        time = np.arange(0.0, seconds, 1.0 / _RATE)
        curves = {name: curve.force for name, curve in kind.curves.items()}
        conditions = replace(self.conditions, curves=curves, has_rotors=kind.has_rotors)
        motion = moved(with_more(kind.vehicle, F_0_r=_FAINT_TORQUE), commands, time, conditions)
        phi, theta = tilted(conditions, time)
        phase, psi = 2.0 * pi * time / _WAVES, motion["psi"]
        drift = self.waves * 2.0 * pi / _WAVES * np.cos(phase)
        true = {
            "depth [m]": 14.0 + motion["z"] + self.waves * np.cos(phase),
            "heading [deg]": np.degrees(psi),
            "yaw velocity [deg/s]": np.degrees(motion["r"]),
            "surge velocity [m/s]": motion["u"] + drift * np.cos(psi),
            "sway velocity [m/s]": motion["v"] - drift * np.sin(psi),
            "voltage [V]": np.array([voltage(t, DIVE) for t in time.tolist()]),
            "roll [deg]": np.degrees(phi),
            "pitch [deg]": np.degrees(theta),
        }
        pulses = {f"u_{name} [us]": np.round(1500.0 + 400.0 * values) for name, values in commands.at(time).items()}
        table = {"time [s]": time, **pulses}
        for header, values in true.items():
            quantity, _, _ = header.partition(" [")
            if quantity in ("voltage", "roll", "pitch") and quantity not in self.columns:
                continue
            measured = values + _NOISE[header] * random.standard_normal(len(time))
            missing = quantity.endswith("velocity") & (np.arange(len(time)) % kind.every > 0)
            table[header] = np.where(missing, np.nan, measured % 360.0 if quantity == "heading" else measured)
        return table


def commanded(kind: Kind, plan: Plan) -> tuple[Commands, float]:
    """Return the commands of a plan, and how long it lasts (s)."""
    ends = np.cumsum([hold for hold, _ in plan])
    asked = {thruster.name: np.zeros(len(plan)) for thruster in kind.vehicle.layout.thrusters}
    for n, (_, axes) in enumerate(plan):
        for axis, command in axes.items():
            for name, sign in driven(kind.vehicle, AXES[axis]).items():
                asked[name][n] += sign * command
    thrusters = {name: np.clip(values, -1.0, 1.0) for name, values in asked.items()}
    return Commands(np.concatenate([[0.0], ends[:-1]]), thrusters), float(ends[-1])


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
        pair = random.choice([axis.name for axis in _FOUR], 2, replace=False).tolist()
        hold = random.uniform(1.0, 4.0) * kind.hold / 6.0
        free.append((hold, {axis: random.uniform(-0.4, 0.4) for axis in pair}))
    yield [*free, (5.0, {})]
