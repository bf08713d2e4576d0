"""The answers about each axis that an owner asks for: how fast it goes, how soon, and how far until it stops."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import isfinite

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.parts import Curve
from rov_fmu.identify.likelihood.curves import QUADRATIC_DRAG, Drags, Motions
from rov_fmu.identify.likelihood.kinds import LAG
from rov_fmu.identify.likelihood.objective import Objective, TableRow, modelled
from rov_fmu.identify.likelihood.parameters import Table
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior, variances_of
from rov_fmu.identify.result import CONSTANTS, LEAST_TESTED, Answer, Tested, are_alike, is_extrapolated
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

COMMANDS = (0.3, -0.3, 0.5, -0.5, 1.0, -1.0)
"""The commands of the answers. The strongest tested ones are added."""
_EXPONENT = 0.1
"""The standard deviation of ln V_ss per ln of a command beyond those of the tests: thrust grows with a power of the
command that is known to about a tenth. The power of drag is a parameter of its own."""
_WIDEST_HALF = 50.0
"""The largest half-width of an interval of a logarithm."""
ROCKING = CONSTANTS["rocking"].value
"""No V_ss is claimed to better than this where the vehicle may have rocked unseen."""
_BY_DRAG = np.array([1.0, 1.0, 2.0, 1.0])
"""How much V_ss, the time, the way and the time with the lag change with quadratic drag, relative to V_ss: its square
and that of the time are inversely proportional to this drag, and so is the way."""
_STOPPED = 0.1
_GRID = np.linspace(0.0, 1.0, 101)
"""The commands among which the one is found that holds a speed."""
_DIFFERENT = np.array([0.15, 0.3, 0.3])
"""Two vehicles differ along an axis if ln of a V_ss, a time or a stopping distance does by more: the half-widths up to
which these are *good*."""


def tested_commands(objective: Objective, z: Array) -> dict[Axis, Tested]:
    """Return the strongest command along each axis, astern and ahead, that logs and steady tables of this axis test.

    That of a table is its command. That of a log is the command which holds the speed that the vehicle reached for long
    enough, but at most the strongest one that its thrusters got. Tables of thrust, other axes and single thrusters do
    not count.
    """
    vehicle, shapes = objective.table.model(z)
    ends = {axis: [0.0, 0.0] for axis in vehicle.layout.bare_axes}
    for row in objective.rows:
        if not isinstance(row.subject, Curve) and row.quantity == "V_ss":
            ends[row.subject][row.command > 0.0] = max(ends[row.subject][row.command > 0.0], abs(row.command))
    for n, sampled in enumerate(objective.logs):
        for axis, speeds in objective.reached(z, n).items():
            push = objective.table.push(z, sampled, axis)
            for is_ahead, (sign, reached) in enumerate(zip((-1.0, 1.0), speeds, strict=True)):
                if reached:
                    held = sign * shapes.motions(vehicle, axis, sign * _GRID).response()[0]
                    tested = np.interp(reached, np.maximum.accumulate(np.nan_to_num(held)), _GRID)
                    ends[axis][is_ahead] = max(ends[axis][is_ahead], min(float(tested), float(np.max(sign * push))))
    return {axis: (astern, ahead) for axis, (astern, ahead) in ends.items()}


def strongest_of(tested: Tested, command: float) -> float:
    """Return the strongest tested command in the direction of a command; without any, that in the other direction."""
    own = tested[command > 0.0]
    return max(own if own >= LEAST_TESTED else max(tested), LEAST_TESTED)


def beyond_tests(commands: Sequence[float], tested: Tested) -> Array:
    """Return the standard errors of ln V_ss because commands are stronger than those of the tests."""
    ratios = [abs(command) / strongest_of(tested, command) for command in commands]
    return _EXPONENT * np.log(np.maximum(ratios, 1.0))


def commands_of_answers(tested: Tested) -> list[float]:
    """Return the usual commands, and the strongest tested ones that differ from them, in whole percent."""
    strongest = [round(sign * end, 2) for sign, end in zip((-1.0, 1.0), tested, strict=True) if end >= LEAST_TESTED]
    return [*COMMANDS, *(c for c in strongest if not any(are_alike(c, usual) for usual in COMMANDS))]


def _responses_of(
    vehicle: Vehicle,
    shapes: Drags,
    axis: Axis,
    commands: Sequence[float],
    pushes: Sequence[float] = (),
    *,
    with_lag: bool = False,
) -> Array:
    """Return V_ss, Tau and the stopping distance for c commands, or pushes relative to the full one: c x 3 (x n).

    `with_lag` adds the time with the lag of the thrusters.
    """
    rest = shapes.motions(vehicle, axis, np.zeros(1))
    if not pushes:
        responses = _responses(shapes.motions(vehicle, axis, np.array(commands)), rest)
        if not with_lag:
            return responses
        times = modelled([TableRow("", axis, "Tau", c, 1.0, 1.0) for c in commands], vehicle, shapes)
        return np.concatenate([responses, times[:, None]], axis=1)
    full, C = shapes.motions(vehicle, axis, np.ones(1)), rest.of["C"]
    push = np.reshape(pushes, (-1, *[1] * (C.ndim - 1)))
    return _responses(replace(full, of={**full.of, "C": C + push * (full.of["C"] - C)}), rest)


def logarithms(
    table: Table,
    axis: Axis,
    commands: Sequence[float],
    pushes: Sequence[float] = (),
    *,
    with_lag: bool = False,
) -> Callable[[Array], Array]:
    """Return the function that gives ln of V_ss, Tau and the stopping distance for c commands.

    It returns 3 c x n numbers for p x n coordinates, or 4 c x n `with_lag`, which adds the time with the lag.
    """

    def of(z: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.log(np.abs(_responses_of(*table.model(z), axis, commands, pushes, with_lag=with_lag)))
        return values.reshape(values.shape[0] * values.shape[1], -1)

    return of


def differs(ends: Sequence[tuple[Table, Array]], axis: Axis, tested: Tested) -> bool:
    """Return True if coordinates belong to vehicles whose answers within the tests differ along an axis."""
    commands = [c for c in commands_of_answers(tested) if not is_extrapolated(c, tested)]
    if not commands:
        return False
    one, other = (logarithms(table, axis, commands)(z[:, None]).reshape(-1, 3) for table, z in ends)
    return bool(np.any(np.abs(one - other) > _DIFFERENT))


def answers(
    posteriors: Sequence[Posterior],
    axis: Axis,
    vehicle: Vehicle,
    tested: Tested,
    commands: Sequence[float] = COMMANDS,
    pushes: Sequence[float] = (),
    least: float = 0.0,
    speeds: Mapping[str, float] | None = None,
) -> tuple[Answer, ...]:
    """Return how fast, how long and how far the vehicle goes, for some commands of an axis.

    `pushes`, if they are given, are the pushes of these commands relative to the full push of the fit, and `tested` is
    in this unit. The values are those of the vehicle file, and each interval contains those of all posteriors. It is
    never narrower than what drag does that changes V_ss by `least`, and wider for commands beyond the strongest tested
    one.

    Where drag has another power, the file has the nearest quadratic drag up to the largest tested speeds, `speeds`. An
    interval reaches as far to either side of the value as this drag changes the answer.

    The lag and the time without it share what the tests tell about their sum, so the interval of the time with the lag
    is its own, and contains the times with both ends of that of the lag. Thrusters beside logs with a wrench have none:
    no test shows their lag.
    """
    curves = {vehicle.layout.curve_of[t.name] for t in vehicle.layout.thrusters_along(axis)}
    with_lag = not pushes and any(curve.has_lag for curve in curves)
    of_file = _responses_of(vehicle, QUADRATIC_DRAG, axis, commands, pushes, with_lag=with_lag)
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.log(np.abs(of_file))
    beyond, ends = beyond_tests(pushes or commands, tested) ** 2, list[Array]()
    of_table = partial(logarithms, axis=axis, commands=commands, pushes=pushes, with_lag=with_lag)

    def fitted(table: Table, z: Array) -> Array:
        return of_table(table)(z[:, None]).reshape(own.shape)

    for posterior in posteriors:
        with np.errstate(invalid="ignore"):  # the logarithm of a speed of 0, or of one that never ends
            slopes = posterior.slopes(of_table(posterior.table))
            middle = fitted(posterior.table, posterior.z)
            misfit = np.abs(fitted(posterior.table.of_file(posterior.z, speeds or {}), posterior.z) - middle)
        slopes = np.where(np.isfinite(slopes), slopes, 0.0)
        variances = variances_of(slopes, posterior.covariance).reshape(own.shape)
        variances += beyond[:, None]
        half = np.minimum(QUANTILE * np.sqrt(variances), _WIDEST_HALF)
        half = np.maximum(half, least * _BY_DRAG[: half.shape[1]])
        ends += [middle - half, middle + half, own - misfit, own + misfit]
        # Where a lag is at its bound, no derivative shows it.
        if (lag := posterior.table.index(LAG)) is not None:
            for end in posterior.ends(lag)[1:]:
                z = posterior.z.copy()
                z[lag] = end
                ends.append(fitted(posterior.table, z))
    low, high = (np.exp(of([np.where(np.isfinite(one), one, own) for one in ends], axis=0)) for of in (np.min, np.max))
    low[:, 0], high[:, 0] = np.where(of_file[:, 0] < 0.0, (-high[:, 0], -low[:, 0]), (low[:, 0], high[:, 0]))
    return _finite(axis, commands, of_file, low, high)


def push_of_thrusters(wrench: Vehicle, own: Vehicle, axis: Axis) -> Callable[[float], float] | None:
    """Return how hard a command of the thrusters pushes along an axis, relative to the full force of a wrench.

    It is None unless the logs have a wrench, whose full command is its largest force, and the vehicle has thrusters.
    """
    if not (wrench.layout.has_wrench and own.layout.thrusters):
        return None

    def push(vehicle: Vehicle, command: float) -> float:
        at_rest, pushed = QUADRATIC_DRAG.motions(vehicle, axis, np.array([0.0, command])).of["C"].tolist()
        return float(pushed - at_rest)

    return lambda command: push(own, command) / push(wrench, 1.0)


def commands_that_push(push: Callable[[float], float], tested: Tested) -> Tested:
    """Return the commands of the thrusters that push as hard as the strongest tested ones of a wrench."""
    astern, ahead = (
        float(np.interp(end, np.maximum.accumulate([sign * push(sign * c) for c in _GRID.tolist()]), _GRID))
        for sign, end in zip((-1.0, 1.0), tested, strict=True)
    )
    return astern, ahead


def _finite(axis: Axis, commands: Sequence[float], values: Array, low: Array, high: Array) -> tuple[Answer, ...]:
    """Return the answers that are finite, for c commands: c x 3 or 4 values and the ends of their intervals."""
    finite = []
    for command, numbers in zip(commands, np.stack([values, low, high], axis=-1).tolist(), strict=True):
        steady, rise, stop, *lagged = ((value, (least, most)) for value, least, most in numbers)
        if steady[0] and isfinite(steady[0]) and isfinite(rise[0]):
            finite.append(Answer(axis, command, steady, rise, stop, *lagged))
    return tuple(finite)


def _responses(motions: Motions, rest: Motions) -> Array:
    """Return V_ss, Tau and the stopping distance, from V_ss to a tenth of it: commands x 3, or commands x 3 x n."""
    V, Tau = motions.response()
    return np.stack([V, Tau, rest.stopping_distance(V, _STOPPED)], axis=1)
