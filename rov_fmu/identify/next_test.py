"""The test that would tell most: add the information of a proposed test, and compare the intervals."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, isfinite

import numpy as np

from rov_fmu.equation.alone import AxisAlone
from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.assess import beyond_tests
from rov_fmu.identify.likelihood.curves import Motions
from rov_fmu.identify.likelihood.filter import DivergedError, Record
from rov_fmu.identify.likelihood.objective import Data, DataPart, Objective
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior, variances_of
from rov_fmu.identify.result import Answer, NextTest, Tested, half_width
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import TankLimits

_COMMANDS = (0.3, -0.3, 0.5, -0.5)
"""The commands whose speeds a test should tell."""
_STRENGTHS = (0.2, 0.4, 0.6, 0.8, 1.0)
_HOLD, _REST = 8.0, 4.0
"""How long a command is held, and the rest after it, s."""
_COASTING, _STEP = 60.0, 0.02
"""The coasting after a test that stays within the tank, and the step with which it is simulated, s."""
_RATE = 10.0
"""The samples per second of the proposed test."""


def next_test(
    objective: Objective,
    posterior: Posterior,
    axis: Axis,
    limits: TankLimits,
    answers: Sequence[Answer],
    tested: Tested = (1.0, 1.0),
) -> NextTest | None:
    """Return the test that narrows the least certain steady velocity of an axis most; None without a log of it.

    The intervals of the answers are those that people see. They may be wider than the posterior says, for example
    because the thrust changes slowly; a test does not narrow this part, but for what a stronger command than those
    `tested` adds.
    """
    number = next((n for n, one in enumerate(objective.logs) if axis.name in one.layout.by_name), None)

    def motions(z: Array, commands: Sequence[float]) -> Motions:
        vehicle, shapes = posterior.table.model(z)
        return shapes.motions(vehicle, axis, np.array(commands))

    def logarithms(z: Array) -> Array:
        return np.log(np.abs(motions(z, _COMMANDS).response()[0]))

    speeds, _ = motions(posterior.z, _COMMANDS).response()
    if number is None or not (np.isfinite(speeds).all() and speeds.all()):
        return None
    slopes = posterior.slopes(logarithms)
    known = _widths(slopes, posterior.covariance)
    shown = {a.command: half_width(a.steady) for a in answers}
    now = np.array([shown.get(c, one) for c, one in zip(_COMMANDS, known, strict=True)])
    rest = np.maximum(now**2 - known**2, 0.0)
    beyond = QUANTILE**2 * beyond_tests(_COMMANDS, tested) ** 2
    worst = int(np.argmax(now))
    tests = []
    for strength in _STRENGTHS:
        held = motions(posterior.z, (0.0, strength, -strength)).of.items()
        hold = _hold([AxisAlone.of({key: float(each[n]) for key, each in held}) for n in range(3)], axis, limits)
        if strength > limits.command_max or hold < 2.0:
            continue
        try:
            more = _information(objective, number, posterior.z, axis, strength, hold)
        except DivergedError:
            continue
        words = f"hold {strength:.0%} of {axis.name} for {hold:.0f} s, rest, then -{strength:.0%} for {hold:.0f} s"
        shorter = beyond - QUANTILE**2 * beyond_tests(_COMMANDS, _at_least(tested, strength)) ** 2
        then = np.sqrt(_widths(slopes, posterior.with_more(more).covariance) ** 2 + np.maximum(rest - shorter, 0.0))
        target = f"the speed at {_COMMANDS[worst]:.0%}"
        tests.append(NextTest(axis, words, target, float(now[worst]), float(then[worst])))
    return min(tests, key=lambda test: test.then, default=None)


def _widths(slopes: Array, covariance: Array) -> Array:
    """Return the relative half-widths of some intervals."""
    return QUANTILE * np.sqrt(variances_of(slopes, covariance))


def _at_least(tested: Tested, strength: float) -> Tested:
    """Return the strongest commands after a test of both directions."""
    astern, ahead = tested
    return max(astern, strength), max(ahead, strength)


def _hold(motions: Sequence[AxisAlone], axis: Axis, limits: TankLimits) -> float:
    """Return how long a command can be held ahead and then astern within the tank, s.

    `motions` are those without thrust, ahead and astern.
    """
    longest = min(_HOLD, limits.duration / 3.0)
    if axis.is_rotation or not isfinite(limits.tank_length):
        return longest
    holds = np.arange(longest, 0.0, -0.5).tolist()
    return next((hold for hold in holds if _length(motions, hold) <= limits.tank_length), 0.0)


def _length(motions: Sequence[AxisAlone], hold: float) -> float:
    """Return the length that a test and the coasting after it cover, m, by semi-implicit Euler steps."""
    rest, ahead, astern = motions
    v, position, positions = 0.0, 0.0, [0.0]
    for motion, seconds in ((ahead, hold), (rest, _REST), (astern, hold), (rest, _COASTING)):
        for _ in range(round(seconds / _STEP)):
            v += _STEP * motion.acceleration(v)
            position += _STEP * v
            positions.append(position)
    return max(positions) - min(positions)


def _information(objective: Objective, number: int, z: Array, axis: Axis, strength: float, hold: float) -> Array:
    """Return the information of a test about the parameters: two held commands with the sensors of a log."""
    sampled, layout = objective.logs[number], objective.logs[number].layout
    edges = np.array([0.0, 2.0, 2.0 + hold, 2.0 + hold + _REST, 2.0 + 2.0 * hold + _REST])
    inputs = np.zeros((len(edges), len(layout.inputs)))
    names = [*layout.inputs]
    for n, command in enumerate((0.0, strength, 0.0, -strength, 0.0)):
        for name, value in (layout.usual_inputs | layout.commands_along(axis, command)).items():
            if name in layout.commands or name == "voltage":
                inputs[n, names.index(name)] = value
    time = np.arange(0.0, edges[-1] + 2.0, 1.0 / _RATE)
    sensors = sampled.record.sensors
    count = len(sensors)
    record = Record(
        sensors,
        np.repeat(time, count),
        np.zeros(len(time) * count),
        np.tile(np.arange(count, dtype=np.intc), len(time)),
        edges - sampled.interval,
        edges,
        inputs,
        layout.at_rest,
        sampled.record.errors,
    )
    proposed = objective.of(DataPart([number], []))
    proposed.logs, proposed.records = [replace(sampled, record=record)], [record]
    free = proposed.run(z, 0, begin=0.0)
    proposed.records = [replace(record, value=-free.innovations)]
    run = proposed.run(z, 0)
    parameters = enumerate(objective.table.parameters)
    concerned = [k for k, p in parameters if p.of_motion and p.log is None and objective.concerns(p, number)]
    steps = np.array([objective.table.parameters[k].step for k in concerned])
    # Where all innovations are 0, it does not matter that the gains of the filter would change, too.
    inside = z.copy()
    inside[concerned] = np.maximum(z[concerned], objective.low[concerned] + steps)
    slopes = proposed.changes(inside, 0, concerned, steps, run, begin=-1.0, span=inf)
    data = Data(run.innovations, run.variances, slopes, np.zeros_like(slopes), concerned, len(z))
    return data.information(slice(None))[1]
