"""Dives of the VideoRay with disturbances that its model does not contain, integrated by SciPy's DOP853."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import copysign, cos, pi, sin

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from rov_fmu.identify.adapter.recording import Recording, command_of
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from tests.pool import NOISE, PATTERNS
from tests.recordings import PLANS
from tests.vehicles import VIDEORAY
from verification.references.pool import Array

RATE, SECONDS = 20.0, 60.0
TIME: Array = np.arange(round(RATE * SECONDS)) / RATE
SENSORS: Mapping[str, tuple[Axis, str]] = {
    "u": (SURGE, "velocity"),
    "x": (SURGE, "distance"),
    "w": (HEAVE, "velocity"),
    "z": (HEAVE, "depth"),
    "psi": (YAW, "heading"),
}
_STATE = ("u", "w", "r", "x", "z", "psi")
_PITCHING = 2.0 * pi / 11.0
"""The angular frequency of pitch, rad/s."""


@dataclass(frozen=True)
class Disturbance:
    """What acts in a dive; there is nothing by default."""

    sag: float = 0.0
    """The part of the voltage, and of the thrust, that is lost over the dive."""
    tether: float = 0.0
    """The force towards the start per distance, N/m."""
    tilt: float = 0.0
    """The amplitude of pitch and roll, rad."""
    saturation: float = 1.0
    """The command from which the thrust no longer grows."""
    scale: float = 1.0
    """The scale of the sensors of positions."""
    delay: float = 0.0
    """The time from a command to its effect, s."""
    lag: float = 0.0
    """The time constant of the thrust, s."""
    load: float = 0.0
    """The constant force down, N."""
    current: float = 0.0
    """The velocity of the water ahead, m/s."""
    reverse: float = 1.0
    """The ratio of the thrust in reverse to that ahead."""

    def context(self, t: Array) -> dict[str, Array]:
        """Return the voltage, pitch and roll at times."""
        pitch, roll = self.tilt * np.sin(_PITCHING * t), self.tilt * np.sin(2.0 * pi / 7.0 * t + 1.0)
        return {"voltage": 16.0 * (1.0 - self.sag * t / SECONDS), "pitch": pitch, "roll": roll}


@dataclass(frozen=True, eq=False)
class Dive:
    """The motion of a dive without noise, in SI units."""

    disturbance: Disturbance
    commands: Mapping[str, Array]
    motion: Mapping[str, Array]

    def recorded(
        self,
        random: np.random.Generator,
        file: str,
        sensors: Sequence[str],
        *,
        colour: float = 0.0,
        every: int = 1,
        logged: bool = False,
    ) -> list[Recording]:
        """Return the recordings of some sensors.

        `colour` is the correlation of the noise of successive samples. Every so many rows are logged, so a command may
        have changed before its row. With `logged`, the log has the voltage, pitch and roll.
        """
        rows, found = slice(None, None, every), []
        commands = {name: values[rows] for name, values in self.commands.items()}
        beside = {key: self.motion[key][rows] for key in ("u", "r", "psi")}
        context = {key: values[rows] for key, values in self.disturbance.context(TIME).items()} if logged else {}
        for name in sensors:
            axis, quantity = SENSORS[name]
            white = random.standard_normal(len(TIME))
            errors = NOISE[quantity] * lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white)
            values = self.motion[name] * (self.disturbance.scale if name in "xz" else 1.0) + errors
            command = command_of(VIDEORAY.layout, axis, commands)
            found.append(Recording(file, axis, quantity, TIME[rows], command, values[rows], commands, beside, context))
        return found


def along(axis: Axis, plan: int) -> dict[str, Array]:
    """Return the commands of a plan along one axis, in both directions."""
    command = np.concatenate([np.full(round(hold * RATE), c) for c, hold in PLANS[axis.name][plan]])
    return {name: PATTERNS[axis.name].get(name, 0.0) * command for name in "lrt"}


def by_hand(seed: int) -> dict[str, Array]:
    """Return the commands of a pilot, who moves three sticks every few seconds."""
    random = np.random.default_rng(seed)

    def stick(most: float, hold: float) -> Array:
        found, side = np.zeros(round(2.0 * RATE)), most
        while len(found) < len(TIME):
            level = 0.0 if random.random() < 1 / 3 else side * random.uniform(0.4, 1.0)
            side = -side if level else side
            found = np.append(found, np.full(round(RATE * hold * random.uniform(0.5, 1.5)), level))
        return found[: len(TIME)]

    ahead, aside, down = stick(0.45, 5.0), stick(0.2, 3.0), stick(0.6, 5.0)
    return {"l": ahead + aside, "r": ahead - aside, "t": down}


def dive(commands: Mapping[str, Array], disturbance: Disturbance) -> Dive:
    """Dive from rest with the commands of the thrusters at the times, each held until the next."""
    table = np.column_stack([commands[name] for name in "lrt"])
    switches = np.concatenate([[0], np.flatnonzero(np.any(np.diff(table, axis=0) != 0.0, axis=1)) + 1])
    delayed = TIME[switches] + disturbance.delay
    bounds = [0.0, *delayed[delayed < TIME[-1]].tolist(), float(TIME[-1])]
    state, found = np.zeros(len(_STATE) + 3), np.zeros((len(_STATE) + 3, len(TIME)))
    for (start, end), held in zip(pairwise(bounds), [np.zeros(3), *table[switches]], strict=False):
        if end > start:
            inside = np.logical_and(start < TIME, end >= TIME)
            at = np.union1d(TIME[inside], [end])
            steps = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-10, "t_eval": at}
            solution = solve_ivp(_rates, (start, end), state, args=(held, disturbance), **steps)
            assert solution.success, solution.message
            found[:, inside], state = solution.y[:, : int(inside.sum())], solution.y[:, -1]
    motion = dict(zip(_STATE, found, strict=False))
    return Dive(disturbance, commands, motion | {"u": motion["u"] + disturbance.current})


def _rates(t: float, state: Array, command: Array, d: Disturbance) -> list[float]:
    """Return the derivatives of the velocities through the water, the pose, and the lagging thrust."""
    k, (u, w, r, x, z, _, *lagging) = VIDEORAY, state.tolist()
    volts, pitch, roll = (float(values) for values in d.context(np.array(t)).values())
    steady = [volts / 16.0 * _thrust(*each, d) for each in zip(("rear", "rear", "top"), command.tolist(), strict=True)]
    left, right, top = lagging if d.lag else steady
    X = k["alpha_u"] * (left + right) - d.tether * x - _drag("u", u)
    Z = k["alpha_w"] * top + d.load - d.tether * z - _drag("w", w)
    N = k["alpha_r"] * k["R"] * sin(k["gamma"]) * (left - right) - _drag("r", r)
    q = d.tilt * _PITCHING * cos(_PITCHING * t)
    return [
        k["beta_u"] * X / k["m_rov"] - q * w,
        k["beta_w"] * Z / k["m_rov"] + q * u,
        k["beta_r"] * N / k["I_r"],
        u + d.current,
        w * cos(pitch) * cos(roll) - u * sin(pitch),
        r * cos(roll) / cos(pitch),
        *((F - f) / d.lag if d.lag else 0.0 for F, f in zip(steady, lagging, strict=True)),
    ]


def _thrust(curve: str, command: float, d: Disturbance) -> float:
    c = min(abs(command), d.saturation)
    force = (VIDEORAY[f"a_t_{curve}"] * c + VIDEORAY[f"b_t_{curve}"]) * c / (2.0 if curve == "rear" else 1.0)
    return copysign(force * (d.reverse if command < 0.0 else 1.0), command)


def _drag(v: str, speed: float) -> float:
    return (VIDEORAY[f"a_d_{v}"] * abs(speed) + VIDEORAY[f"b_d_{v}"]) * speed
