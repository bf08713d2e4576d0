"""Thrusters, commands and sensors that contradict the vehicle of rov.toml, by the regression of each axis.

A fit with a wrong sign takes minutes and explains nothing, and a sign needs no fit. The acceleration along an axis is
regressed on the push that rov.toml expects of all thrusters there, and again on the push that a mistake would give. If
the errors become smaller by far, it is told. Mistakes that explain the same, such as two thrusters that push the other
way and a depth of the other sign, are told together.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import combinations

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, Axis
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import listed
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.commands import LogKeys
from rov_fmu.tank.description import Description
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.inspection.outputs import GUESSED, Effects, regression
from rov_fmu.tank.log import Log

_DOUBTFUL, _CERTAIN = 5.0, 10.0
"""A contradiction is told from so many standard errors on, and no fit is made from so many on."""
_STEPS, _MOST = 2, 3
"""So many mistakes may come together, and so many that explain the same are told."""
_HIGH, _DEEP = -1.0, 5.0
"""The depth has the right sign if it is never above the first number, m, and once beyond the second."""
FRAME = "up and down, and port and starboard, have the other meaning (north-east-down is not east-north-up)"
"""What is wrong where a frame forward, to starboard, down is read as one forward, to port, up, or the other way."""


def contradictions(logs: Iterable[Log], description: Description) -> Iterator[Finding]:
    """Yield a finding for each file that contradicts the description: `signs` if it is certain, or `doubtful signs`."""
    for file, pieces in grouped((log.whole_file, log) for log in logs).items():
        yield from _contradiction(file, pieces, description)


def _contradiction(file: str, logs: Sequence[Log], description: Description) -> Iterator[Finding]:
    """Yield a finding if the logs of a file contradict the description."""
    thrusters = {thruster.name: thruster for thruster in description.layout.thrusters}
    told = dict.fromkeys(name for log in logs if log.commands for name in log.commands.thrusters)
    names = [name for name in told if name in thrusters]
    pushes = {axis: np.array([thrusters[name].effect(axis) for name in names]) for axis in GUESSED}
    fits = {axis: fit for axis in GUESSED if pushes[axis].any() and (fit := regression(logs, axis, names))}
    depths = [channel.samples[1] for log in logs if (channel := log.used(HEAVE.position))]
    high, deep = np.quantile(np.concatenate(depths), (0.01, 0.99)) if depths else (0.0, 0.0)
    sure = {HEAVE} if high > _HIGH and deep > _DEEP else set[Axis]()
    expected = np.array([pushes[axis] for axis in fits])
    steps, turned, explained = list[str](), set[str](), 0.0
    for _ in range(_STEPS if fits else 0):
        tried = [*_mistakes(expected, names, [*fits], sure)]
        gains = [_gain([*fits.values()], expected, changed) for changed, _, _ in tried]
        if (most := max(gains)) < _DOUBTFUL**2:
            break
        alike = [one for gain, one in zip(gains, tried, strict=True) if gain > most - _DOUBTFUL**2]
        if not all(words for _, words, _ in alike):  # the fit finds the angle of a sensor
            return
        expected, explained = tried[gains.index(most)][0], explained + most
        steps.append(", or ".join(words for _, words, _ in alike[:_MOST]))
        turned ^= {*alike[0][2]}
    if steps:
        errors, what = explained**0.5, f"the assumed {description.base_name}" if description.assumed else "rov.toml"
        kind = "signs" if errors >= _CERTAIN else "doubtful signs"
        why = "; and ".join(steps) + (_in_logs(turned, names, description.tables.logs) if turned else "")
        yield about(file, kind, what=what, errors=errors, why=why)


def _gain(fits: Sequence[Effects], expected: Array, changed: Array) -> float:
    """Return the squared standard errors by which changed effects (axes x thrusters) explain the motion better."""
    total = 0.0
    for fit, old, new in zip(fits, expected, changed, strict=True):
        before, after = fit.unexplained(old), fit.unexplained(new)
        if before != after:
            total += fit.independent * (before - after) / min(before, after)
    return total


def _mistakes(
    expected: Array, names: Sequence[str], axes: Sequence[Axis], sure: Iterable[Axis]
) -> Iterator[tuple[Array, str, Sequence[str]]]:
    """Yield the effects (axes x thrusters) that each mistake gives, what is told about it, and which thrusters push the
    other way. Nothing is told of a velocity sensor that is turned.

    The sensors along the axes that are `sure` have the right sign.
    """
    groups = [tuple(np.flatnonzero(row).tolist()) for row in (*expected, expected.any(axis=0))]
    for some in dict.fromkeys([*((n,) for n in range(len(names))), *combinations(range(len(names)), 2), *groups]):
        changed = expected.copy()
        changed[:, some] *= -1.0
        turned = [names[n] for n in some]
        yield changed, f"the push of {listed(turned)} has the other sign", turned
    own = [axis for axis in axes if axis not in sure]
    for other in dict.fromkeys([*((axis,) for axis in own), tuple(axis for axis in own if axis is not SURGE)]):
        signs = np.array([-1.0 if axis in other else 1.0 for axis in axes])
        positive = listed(f"{axis.name} ({axis.positive} is positive)" for axis in other)
        yield (
            signs[:, None] * expected,
            f"{positive}: {FRAME if len(other) > 1 else 'the sensor has the other sign'}",
            (),
        )
    for pair in map(list, combinations(range(len(names)), 2)):
        changed = expected.copy()
        changed[:, pair] = expected[:, pair[::-1]]
        yield changed, f"the commands of {listed(names[n] for n in pair)} are exchanged", ()
    if {SURGE, SWAY} <= {*axes}:
        both = [axes.index(SURGE), axes.index(SWAY)]
        for angle in np.radians([45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0]):
            changed, (c, s) = expected.copy(), (np.cos(angle), np.sin(angle))
            changed[both] = np.array([[c, s], [-s, c]]) @ expected[both]
            yield changed, "", ()


def _in_logs(turned: Collection[str], names: Sequence[str], keys: LogKeys) -> str:
    """Return what to write where some thrusters push the other way."""
    wires, mounted = (
        json.dumps([name for name in names if (name in turned) != (name in given)])
        for given in (keys.reversed, keys.mounted)
    )
    return (
        f". Write reversed = {wires} into [logs] of rov.toml if wires are swapped, so that they push astern in place "
        f"of ahead, or mounted = {mounted} if they are mounted the other way"
    )
