"""What a slow force or a slow change of thrust follows: the voltage, the depth, the distance, or nothing that is known.

A slow process f has the covariance q² exp(-|Δt| / τ). A cause c(t) explains it if f = k c + rest, with a much smaller
rest. Both models are compared by the likelihood of f over all logs, with a prior of k: k c is about as large as f.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from rov_fmu.equation.catalogue import SURGE, SWAY, Axis
from rov_fmu.identify.likelihood.filter import FilterRun
from rov_fmu.identify.likelihood.kinds import Process
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.solve import best_explanations, laplace
from rov_fmu.tank.arrays import Array, spread
from rov_fmu.tank.clocks import first_in_each, held

_CHANNELS = {"voltage": "the voltage", "roll angle": "the roll", "pitch angle": "the pitch", "depth": "the depth"}
"""The channels that may be causes, and their names."""
_STEP = 1.0
"""The usual time between two values that are compared, s."""
_LEAST = 3.0
"""A log tells something about causes if it is longer than so many time constants of the slow process."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """The slow process in one log, and what it may follow, at the same times."""

    time: Array
    slow: Array
    causes: Mapping[str, Array]

    def constants(self, time_constant: float) -> float:
        """Return the number of time constants that the log tells of. A gap counts as one at most."""
        return float(np.minimum(np.diff(self.time) / time_constant, 1.0).sum())


def cause_of(objective: Objective, z: Array, runs: Sequence[FilterRun], slow: Process, axis: Axis | None) -> str:
    """Return what a slow process follows in words, such as `the voltage`, or an empty text.

    `runs` has the states of the filter for each log. Without an axis the process is a change of all thrust.
    """
    time_constant = slow.time_constant
    pieces = [
        _piece(objective, z, n, run, index, axis)
        for n, run in enumerate(runs)
        for index in objective.filters[n].indices_of(slow.acts_as, axis.name if axis else "")
    ]
    pieces = [piece for piece in pieces if piece.constants(time_constant) > _LEAST]
    if not pieces:
        return ""
    common = set.intersection(*(set(piece.causes) for piece in pieces))
    effective = sum(piece.constants(time_constant) for piece in pieces)
    evidence = {name: _evidence(pieces, name, time_constant, effective) for name in sorted(common)}
    names = best_explanations(evidence)
    return names[0] if len(names) == 1 else ""


def _piece(objective: Objective, z: Array, number: int, run: FilterRun, index: int, axis: Axis | None) -> _Piece:
    sampled, record = objective.logs[number], objective.records[number]
    time = record.time[first_in_each(record.time, 1.0 / _STEP)]

    def at(times: Array, values: Array) -> Array:
        return np.interp(time, times, values)

    causes = {"the time": time - time[0]}
    for quantity, words in _CHANNELS.items():
        channel = sampled.log.used(quantity)
        if channel and channel.count > 2 and spread(channel.values):
            causes[words] = at(*channel.samples)
    thrust = thrust_along(objective, z, number, time, axis)
    if axis is None:
        causes["the command"] = np.abs(thrust)
    else:
        causes["the command"] = thrust
        distance = _distance(objective, number, run, time, axis)
        if distance is not None:
            causes["the distance"] = distance
        if "the voltage" in causes:
            causes["the voltage"] = (causes["the voltage"] - causes["the voltage"].mean()) * thrust
    return _Piece(time, at(record.time, run.states[:, index]), causes)


def thrust_along(objective: Objective, z: Array, number: int, time: Array, axis: Axis | None) -> Array:
    """Return the thrust along an axis that the model commands, N or N m; without an axis, the largest command."""
    sampled, record = objective.logs[number], objective.records[number]
    inputs = held(record.told, record.inputs, time)
    names = [*sampled.layout.inputs]
    if axis is None:
        thrusters = [names.index(f"u_{thruster.name}") for thruster in sampled.layout.thrusters]
        return np.asarray(np.max(np.abs(inputs[:, thrusters]), axis=1))
    return sampled.thrust(objective.table.coefficients(z), inputs)[:, sampled.layout.bare_axes.index(axis)]


def _distance(objective: Objective, number: int, run: FilterRun, time: Array, axis: Axis) -> Array | None:
    """Return the distance from the start along surge or sway, which a tether resists; None along other axes."""
    states, record = objective.filters[number].vehicle_states, objective.records[number]
    if axis not in (SURGE, SWAY) or not {"x", "y"} <= {*states}:
        return None

    def at(name: str) -> Array:
        return np.interp(time, record.time, run.states[:, states.index(name)])

    x, y = at("x"), at("y")
    psi = at("psi") if "psi" in states else np.zeros(len(time))
    north, east = x - x[0], y - y[0]
    ahead, starboard = north * np.cos(psi) + east * np.sin(psi), east * np.cos(psi) - north * np.sin(psi)
    return np.asarray(ahead if axis is SURGE else starboard)


def _evidence(pieces: Sequence[_Piece], name: str, time_constant: float, effective: float) -> float:
    """Return 2 ln of the Bayes factor of a cause against none. `effective` is the number N of independent values.

    Neighbouring values of a filter's estimate say nearly the same, so that only one in each time constant counts. J is
    N ln r + k², with the share r of the power of f that is left by k c. The prior of k has the deviation 1 if c has the
    power of f. The variance of the rest, which is estimated in both models, costs the same in both.
    """
    beside_mean = ((one.time, one.causes[name] - one.causes[name].mean()) for one in pieces)
    f = np.concatenate([independent(one.time, one.slow, time_constant) for one in pieces])
    c = np.concatenate([independent(*one, time_constant) for one in beside_mean])
    power = float(c @ c) * float(f @ f)
    if power <= 0.0:
        return 0.0
    left = max(1.0 - float(c @ f) ** 2 / power, 1e-12)
    return laplace(effective * log(left) + 1.0 - left, np.array([[effective / left + 1.0]]))


def independent(time: Array, values: Array, time_constant: float) -> Array:
    """Return independent values of equal variance from those of a process with a time constant, which depends on its
    past only by its last value."""
    kept = np.exp(-np.diff(time) / time_constant)
    new = np.sqrt(np.maximum(1.0 - kept**2, 1e-6))
    return np.append(values[:1], (values[1:] - kept * values[:-1]) / new)
