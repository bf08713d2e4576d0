"""Suggest the next test: the recording that would narrow the widest interval most, by its Fisher information."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

import numpy as np

from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.recordings.runs import prepare
from rov_fmu.identify.recordings.simulator import Simulator
from rov_fmu.identify.recordings.trajectory import MotionError
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.vehicle.uncertainty import is_factor

_COMMANDS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
_RATE = 10.0  # Hz
_HOLDS = 5.0, 60.0
"""The shortest and the longest hold, s."""
_VAGUE = 1e3
"""The assumed standard error of a coefficient that is not identifiable yet, relative to its value."""
NOISE = {"distance": 0.02, "depth": 0.01, "heading": 0.01, "velocity": 0.02}
"""The noise of a typical sensor (m, rad, m/s), where there is no recording."""


@dataclass(frozen=True)
class Sensor:
    """The sensor of a test."""

    quantity: str
    noise: float
    """The standard deviation of a sample at 10 Hz, increased for correlated noise."""


@dataclass(frozen=True)
class NextTest:
    """An experiment, and its effect on the widest interval of an axis."""

    axis: Axis
    coefficient: str
    interval: tuple[float, float] | None
    """The present interval; None where the coefficient is not identifiable yet."""
    width: float
    """Half the width of the interval relative to the value; infinite where there is none."""
    narrowed: float
    """The width of the interval after the test, relative to the present width."""
    words: str


def next_test(axis: Axis, rov: Rov, found: Estimate, sensor: Sensor) -> NextTest | None:
    """Return the best of many tests; None where nothing is fitted or nothing moves."""
    if not found.names:
        return None
    error = np.sqrt(np.diag(found.covariance))
    size = np.maximum(np.abs(found.values), 1e-9)
    relative = np.where(np.isfinite(error), error / size, inf)
    widest = int(np.argmax(relative))
    error = np.maximum(np.where(np.isfinite(error), error, _VAGUE * size), 1e-12 * size)
    prior = np.where(np.isfinite(found.covariance), found.covariance, 0.0) / np.outer(error, error)
    prior[np.diag_indices(len(size))] = 1.0  # in present standard errors
    before = np.linalg.pinv(prior, hermitian=True)
    internal = error * [1.0 / v if is_factor(n) else 1.0 for n, v in zip(found.names, found.values, strict=True)]
    best: tuple[float, str] = (inf, "")
    for words, command in _tests(axis, rov):
        information = _information(axis, rov, found.names, sensor, command) * np.outer(internal, internal)
        if np.isfinite(information).all():
            after = np.linalg.pinv(before + information, hermitian=True)
            best = min(best, (float(np.sqrt(np.clip(after[widest, widest], 0.0, 1.0))), words))
    if not best[1]:
        return None
    return NextTest(axis, found.names[widest], found.interval(found.names[widest]), float(relative[widest]), *best)


def _tests(axis: Axis, rov: Rov) -> Iterator[tuple[str, Array]]:
    """Yield tests of steps from rest in one or both directions: a phrase, and the command at each sample."""
    for level in _COMMANDS:
        if not rov.force(axis, level) or not rov.force(axis, -level):
            continue
        Taus = [rov.response(axis, c)[1] for c in (level, -level)]
        hold = float(np.clip(round(4.0 * max(Taus)), *_HOLDS)) if np.isfinite(Taus).all() else _HOLDS[1]
        for ways in ((level,), (level, -level)):
            levels = [0.0, *(c for way in ways for c in (way, 0.0))]
            command = np.repeat(levels, round(hold * _RATE))
            both = " and ".join(f"{c:.0%}" for c in ways)
            step = "steps" if len(ways) > 1 else "a step"
            yield (
                f"a recording of {step} from rest at {both}, {hold:g} s each, with {hold:g} s of rest after each",
                command,
            )


def _information(axis: Axis, rov: Rov, names: tuple[str, ...], sensor: Sensor, command: Array) -> Array:
    """Return the information of a recording about the coefficients, with unknown initial values; or NaN."""
    time, values = np.arange(len(command)) / _RATE, np.zeros(len(command))
    recording = Recording("", axis, sensor.quantity, time, command, values)
    model = Simulator((prepare(recording, rov),), rov, names, (), np.array([sensor.noise]))
    x = model.start(dict(rov.coefficients), {})
    try:
        J = model.jacobian(x)
    except MotionError:
        return np.full((len(names), len(names)), np.nan)
    p, gram = len(names), J.T @ J
    cross = gram[:p, p:]
    return np.asarray(gram[:p, :p] - cross @ np.linalg.pinv(gram[p:, p:]) @ cross.T)
