"""An extended Kalman filter that estimates states, current and uncertain coefficients: docs/filter.md shows it."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
import numpy as np

import rov_fmu
from rov_fmu.interface.model import VehicleModel

Array = np.ndarray[Any, Any]

vehicle = rov_fmu.load("videoray_refit")
known = vehicle.uncertainty
layout = vehicle.layout
STATES, LOADS, CURRENT = list(layout.state), ["X_ext", "Z_ext", "N_ext"], ["V_N", "V_E"]
NAMES = [*STATES, *CURRENT, *known.names]
PLACE = {name: n for n, name in enumerate(NAMES)}

H, STEPS = 0.5, 180
"""The step of the filter, s, and the number of steps of a flight."""
DEPTH = 3.0
"""At the start, m."""
START = {"x": 1.0, "y": 1.0, "z": 0.1, "psi": 0.1}
"""Standard deviations of the start, m and rad."""
WAVES = np.array([0.5, 0.3, 0.02])
"""Of the loads in each step, N and N.m."""
SPEED, WANDER = 0.15, 0.003 * np.sqrt(H)
"""Of the current at the start, and of its change in a step, m/s."""
NOISE = {"z": 0.03, "psi": np.radians(2.0), "x": 0.5, "y": 0.5}
"""Of the sensors, m and rad."""
FIX = 4
"""Depth and compass are read in every step, the acoustic position in every fourth."""

time = H * np.arange(STEPS + 1)
leg = (time[:-1] // 15.0).astype(int)
ahead = np.array([0.35, 0.5, 0.3, 0.45])[leg % 4]
turn = np.where(time[:-1] % 15.0 < 2.0, np.array([0.0, 0.03, -0.03, -0.03, 0.03])[leg % 5], 0.0)
down = np.array([0.3, -0.3, 0.2])[leg % 3]
commands = np.column_stack([ahead + turn, ahead - turn, down])

_FOLDER = TemporaryDirectory(ignore_cleanup_errors=True)


@cache
def unpacked() -> str:
    """Return the folder of the FMU, which is built once."""
    folder = Path(_FOLDER.name)
    return str(fmpy.extract(vehicle.build(folder / "rov.fmu", platforms="host").path, folder / "rov"))


def fly(random: np.random.Generator) -> Array:
    """Return the true states, current and coefficients of one flight of the FMU (times x NAMES)."""
    coefficients = known.drawn(random.random((1, len(known.names))))[0]
    start = {name: random.normal(0.0, deviation) for name, deviation in START.items()}
    start["z"] += DEPTH
    current = random.normal(0.0, SPEED, 2) + np.cumsum(random.normal(0.0, WANDER, (STEPS + 1, 2)), axis=0)
    loads = random.normal(0.0, WAVES, (STEPS + 1, len(WAVES)))
    names = ["time", *layout.commands, *LOADS, *CURRENT]
    inputs = np.zeros(STEPS + 1, [(name, float) for name in names])
    held = np.hstack([np.vstack([commands, commands[-1:]]), loads, current])
    for name, column in zip(names, [time, *held.T], strict=True):
        inputs[name] = column
    values = {**start, **dict(zip(known.names, coefficients, strict=True))}
    flown = fmpy.simulate_fmu(
        unpacked(), stop_time=time[-1], output_interval=H, start_values=values, input=inputs, output=STATES
    )
    states = np.column_stack([flown[name] for name in STATES])
    return np.hstack([states, current, np.tile(coefficients, (STEPS + 1, 1))])


def step_of(rov: VehicleModel, inputs: dict[str, float], state: dict[str, float]) -> tuple[Array, ...]:
    """Return the states after a step, and their derivatives by the states, the inputs and the uncertain coefficients.

    The derivatives are central differences of `simulate_many`, one-sided at the end of a coefficient's range.
    """
    at = {**state, **inputs, **{name: rov[name] for name in known.names}}
    values = np.array([*at.values()])
    away = 1e-5 * np.maximum(np.abs(values), 0.01)
    low, high = np.vstack([np.full((len(at) - len(known.names), 2), [-np.inf, np.inf]), known.bounds]).T
    up, down = (np.clip(values + part, low, high) - values for part in (away, -away))
    rows = dict(zip(at, (values + np.vstack([0.0 * away, np.diag(up), np.diag(down)])).T, strict=True))
    given, start, own = ({name: rows[name] for name in names} for names in (inputs, state, known.names))
    held = {name: row[:, None] for name, row in given.items()}
    moved = rov.simulate_many([0.0, H], held, start=start, coefficients=own, record=STATES)
    ends = np.array([moved[name][:, 1] for name in STATES])
    slopes = (ends[:, 1 : len(at) + 1] - ends[:, len(at) + 1 :]) / (up - down)
    return ends[:, 0], *np.split(slopes, [len(state), len(state) + len(inputs)], axis=1)


def estimate(truth: Array, random: np.random.Generator, *, uncertain: bool = True) -> tuple[Array, Array]:
    """Filter the sensors of a flight. Return the estimates (times x NAMES) and their covariances.

    Without `uncertain`, the coefficients are taken for exact.
    """
    n, m = len(STATES), len(STATES) + len(CURRENT)
    by_current, by_load = ([[*layout.inputs].index(name) for name in names] for names in (CURRENT, LOADS))
    s = np.concatenate((np.zeros(m), known.values))
    s[PLACE["z"]] = DEPTH
    P = np.zeros((len(s), len(s)))
    for name, deviation in {**START, **dict.fromkeys(CURRENT, SPEED)}.items():
        P[PLACE[name], PLACE[name]] = deviation**2
    if uncertain:
        P[m:, m:] = known.errors[:, None] * known.correlation * known.errors
    estimates, covariances = [s], [P]
    for k in range(STEPS):
        # Predict with the step of the model.
        rov = vehicle.with_(**dict(zip(known.names, np.clip(s[m:], *known.bounds.T).tolist(), strict=True)))
        now = dict(zip([*layout.commands, *CURRENT], [*commands[k], *s[n:m]], strict=True))
        state = dict(zip(STATES, s.tolist(), strict=False))
        after, by_state, by_input, by_coefficient = step_of(rov, layout.usual_inputs | now, state)
        F, Q = np.eye(len(s)), np.zeros_like(P)
        F[:n] = np.hstack([by_state, by_input[:, by_current], by_coefficient])
        Q[:n, :n] = by_input[:, by_load] @ np.diag(WAVES**2) @ by_input[:, by_load].T
        Q[n:m, n:m] = WANDER**2 * np.eye(2)
        s = np.concatenate((after, s[n:]))
        P = F @ P @ F.T + Q
        # Correct with the sensors.
        seen = [name for name in NOISE if name not in ("x", "y") or (k + 1) % FIX == 0]
        places, deviations = [PLACE[name] for name in seen], np.array([NOISE[name] for name in seen])
        C, R = np.eye(len(s))[places], np.diag(deviations**2)
        measured = truth[k + 1, places] + random.normal(0.0, deviations)
        K = np.linalg.solve(C @ P @ C.T + R, C @ P).T
        s = s + K @ (measured - C @ s)
        P = (np.eye(len(s)) - K @ C) @ P @ (np.eye(len(s)) - K @ C).T + K @ R @ K.T
        estimates.append(s)
        covariances.append(P)
    return np.array(estimates), np.array(covariances)
