"""How far the model of each axis may be trusted: held-out predictions, answers and verdicts."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, log

import numpy as np
from scipy.stats.qmc import Sobol

from rov_fmu.c.filter import DivergedError, Run
from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.likelihood.curves import NO_SHAPES, Motions, Shapes
from rov_fmu.identify.likelihood.objective import Objective, Part
from rov_fmu.identify.likelihood.parameters import Table
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior
from rov_fmu.identify.likelihood.solve import Minimum, refits
from rov_fmu.identify.result import (
    DISAGREEMENT,
    MOST_UNKNOWN,
    Answer,
    Disturbance,
    Effect,
    Point,
    Prediction,
    Slip,
    Verdict,
    coverage_of,
    relative_error,
)
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.description import Word
from rov_fmu.vehicle.uncertainty import LEVEL, NORMAL
from rov_fmu.vehicle.vehicle import Vehicle

COMMANDS = (0.3, -0.3, 0.5, -0.5)
"""The commands whose answers are judged."""
ANSWERED = (*COMMANDS, 1.0, -1.0)
"""The commands of all answers. Full thrust is often beyond the tests, so it does not count for the verdict."""
AHEAD, SETTLING = 10.0, 5.0
"""Positions are predicted over this time, s. Whole logs are predicted from the data of the first seconds on."""
_LEAST_GAIN = 0.03
"""Thrust is never predicted to better than 3 %: batteries and water differ from day to day."""
_LEAST_CURRENT = 0.02
"""The current of an unseen log is never known to better than this, m/s."""
_LOST = 1.8
"""The largest standard deviation of a heading, rad: that of a direction about which nothing is known."""
_OF_THRUST = 0.7
"""The relative change of V_ss by that of the thrust: between 0.5, if drag is quadratic, and 1, if it is linear."""
_EXPONENT = 0.15
"""The standard deviation of ln V_ss per ln of a command beyond those of the tests: thrust and drag grow with powers
of the command and the velocity that are known to about a tenth each."""
_WIDEST_HALF = 50.0
"""The largest half-width of an interval of a logarithm."""
EXACT = 0.01
"""No answer is claimed to better than 1 %."""
_STOPPED = 0.1
_DRAWS = 256
"""The number of vehicles that are drawn from the estimates of a vehicle file."""
GOOD, USABLE = 0.8, 0.6
"""The least coverage of the bands for each verdict."""
_WIDEST = {"good": 0.15, "usable": 0.3}
"""The largest half-width of the best interval of V_ss for each verdict, relatively."""
_FARTHEST = {"good": 0.2, "usable": 0.4}
"""The largest error (RMS) of V_ss, predicted from the other commands of the tables, for each verdict, relatively."""
_MOVING = 3.0
"""A quantity moves if its change is larger than so many standard deviations of its sensor's noise."""


# ---- Held-out predictions --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _LeftOut:
    """A part of the data that is left out: a log, or a half of the only log."""

    log: int
    chosen: slice
    words: str


def predictions(objective: Objective, best: Minimum, against: Vehicle | None = None) -> Iterator[Prediction]:
    """Yield the prediction of each quantity of each log by a fit to all other data, and by a vehicle to compare with.

    That vehicle may have seen the log. It is left out where it has other thrusters or coefficients.
    """
    other = _other(objective.table, against)
    left_out = [*_left_out(objective)]
    found = refits(objective, best, [rest for _, rest in left_out])
    for (part, _), without in zip(left_out, found, strict=True):
        covariance = Posterior.of(objective.table, without.z, without.information).covariance
        if len(objective.logs) > 1:
            covariance = _with_currents(objective, best, covariance, part.log)
        yield from _predicted(objective, part, cautious(objective, without.z), covariance, other)


def _left_out(objective: Objective) -> Iterator[tuple[_LeftOut, Part]]:
    """Yield what is left out, and the rest of the data."""
    logs, rows = objective.whole.logs, objective.whole.rows
    if len(logs) == 1:
        half = len(objective.records[0].time) // 2
        first, second = slice(half), slice(half, None)
        yield _LeftOut(0, second, "the first half"), Part(logs, rows, first)
        yield _LeftOut(0, first, "the second half"), Part(logs, rows, second)
    elif logs:
        words = "the other log" if len(logs) == 2 else f"the other {len(logs) - 1} logs"
        for n in logs:
            yield _LeftOut(n, slice(None), words), Part([m for m in logs if m != n], rows)


def _other(table: Table, against: Vehicle | None) -> Table | None:
    """Return a table whose coefficients are those of another vehicle, None where this table does not have them all."""
    if not against or against.layout.gains != table.layout.gains:
        return None
    is_whole = len(against.with_(table.layout).coefficients) == len(against.coefficients)
    return table.of_vehicle(against) if is_whole else None


def _with_currents(objective: Objective, best: Minimum, covariance: Array, number: int) -> Array:
    """Return the covariance with the variance of the current of an unseen log: about as large as in the other logs."""
    found = covariance.copy()
    for n, p in enumerate(objective.table.parameters):
        if p.kind == "current" and p.log == number:
            found[n], found[:, n] = 0.0, 0.0
            found[n, n] = unseen_current(objective.table, best.z, covariance, p.of)
    return found


def unseen_current(table: Table, z: Array, covariance: Array, file: str) -> float:
    """Return the variance of the current of an unseen log: about as large as in the other logs of a table."""
    currents = [n for n, p in enumerate(table.parameters) if p.kind == "current" and p.of != file]
    return _LEAST_CURRENT**2 + float(np.mean([z[n] ** 2 + covariance[n, n] for n in currents]))


def cautious(objective: Objective, z: Array) -> Array:
    """Return the parameters with at least the least change of thrust."""
    moved = z.copy()
    place = objective.table.place("slow gain")
    if place is not None:
        moved[place] = max(moved[place], log(_LEAST_GAIN))
    return moved


def _predicted(
    objective: Objective, part: _LeftOut, z: Array, covariance: Array, other: Table | None
) -> Iterator[Prediction]:
    """Yield the predictions of one part over its whole length, and of its positions over a shorter time."""
    one, record = objective.logs[part.log], objective.records[part.log]
    inside = np.zeros(len(record.time), bool)
    inside[part.chosen] = True
    begin = max(float(record.time[inside][0] - record.time[0]), 0.0) + SETTLING
    for span in (inf, AHEAD):
        try:
            off_all, deviations = ahead(objective, part.log, z, covariance, begin, span)
            usual = _usual_noise(objective, z)
            compared = objective.run(usual, part.log, table=other, begin=begin, span=span) if other else None
        except DivergedError:
            continue
        later = inside & (record.time >= record.time[0] + begin)
        for number, m in enumerate(one.measured):
            at = later & (record.sensor == number)
            if at.sum() < 10 or (span < inf and m.sensor.is_velocity):
                continue
            off, deviation = off_all[at], deviations[at]
            measured = record.value[at]
            yield Prediction(
                axis=m.sensor.axis,
                file=one.log.file,
                quantity=m.channel.quantity.name,
                unit=m.channel.quantity.unit,
                is_position=not m.sensor.is_velocity,
                span=span,
                by=part.words,
                time=record.time[at],
                measured=measured,
                predicted=measured - off,
                deviation=deviation,
                unchanged=_unchanged(record.time[at], measured, span),
                noise=objective.table.get(z, "white noise", m.channel.quantity.name),
                error=float(np.sqrt(np.mean(off**2))),
                coverage=float(np.mean(np.abs(off) <= NORMAL * deviation)),
                compared=measured - compared.innovations[at] if compared else None,
            )


def _usual_noise(objective: Objective, z: Array) -> Array:
    """Return the parameters with the means of the priors of the noise, for a vehicle that was not fitted.

    The noise of a fit is too small for it: the filter would explain its errors by a thrust that fades to 0.
    """
    of_motion = np.array([parameter.of_motion for parameter in objective.table.parameters])
    return np.where(of_motion, z, objective.mean)


def ahead(
    objective: Objective, number: int, z: Array, covariance: Array, begin: float, span: float
) -> tuple[Array, Array]:
    """Return measured minus predicted for each sample of a log, and the standard deviation of each prediction.

    The predictions start anew at `begin` (s after the first sample) and after each `span`. The deviations contain the
    noise and the uncertainty of the parameters. Raises DivergedError.
    """
    run = objective.run(z, number, begin=begin, span=span)
    slopes = _slopes(objective, number, z, covariance, run, begin, span)
    deviations = np.sqrt(run.variances + np.einsum("ni,ij,nj->n", slopes, covariance, slopes))
    wraps = np.array([m.channel.quantity.wraps for m in objective.logs[number].measured])
    lost = wraps[objective.records[number].sensor]
    return run.innovations, np.where(lost, np.minimum(deviations, _LOST), deviations)


def _slopes(
    objective: Objective, number: int, z: Array, covariance: Array, run: Run, begin: float, span: float
) -> Array:
    """Return the derivatives of the predictions of a log with respect to the parameters of the motion, n x p."""
    found = np.zeros((len(objective.records[number].time), len(z)))
    parameters = enumerate(objective.table.parameters)
    places = [k for k, p in parameters if p.of_motion and objective.concerns(p, number)]
    steps = 0.3 * np.sqrt(np.maximum(np.diag(covariance)[places], 0.0)) + 1e-9
    found[:, places] = objective.changes(z, number, places, steps, run, begin, span)
    return found


def _unchanged(time: Array, values: Array, span: float) -> float:
    """Return the RMS change of a quantity since the start of its prediction."""
    if span == inf:
        return float(np.sqrt(np.mean((values - values[0]) ** 2)))
    first = np.searchsorted(time, time[0] + span * np.floor((time - time[0]) / span))
    return float(np.sqrt(np.mean((values - values[first]) ** 2)))


# ---- Answers ---------------------------------------------------------------------------------------------------------


def answers(
    posteriors: Sequence[Posterior], axis: Axis, vehicle: Vehicle, pushes: Sequence[float] = (), strongest: float = 1.0
) -> tuple[Answer, ...]:
    """Return how fast, how long and how far the vehicle goes, for the usual commands of an axis.

    `pushes`, if they are given, are the pushes of these commands relative to the full push of the fit. The values are
    those of the vehicle file, and each interval contains those of all posteriors. They are wider for commands beyond
    the strongest one of the tests.
    """

    def values(vehicle: Vehicle, shapes: Shapes) -> Array:
        rest = shapes.motions(vehicle, axis, np.zeros(1))
        if not pushes:
            return _responses(shapes.motions(vehicle, axis, np.array(ANSWERED)), rest)
        full = shapes.motions(vehicle, axis, np.ones(1)).of
        push = np.reshape(pushes, (-1, *[1] * (full["C"].ndim - 1)))
        return _responses(Motions({**full, "C": rest.of["C"] + push * (full["C"] - rest.of["C"])}), rest)

    def intervals(posterior: Posterior) -> tuple[Array, Array]:
        """Return the logarithms of the ends of all intervals."""

        def logarithms(z: Array) -> Array:
            some = values(*posterior.table.model(z))
            with np.errstate(divide="ignore", invalid="ignore"):  # a speed of 0 has no logarithm
                return np.log(np.abs(some)).reshape(3 * len(some), -1)

        with np.errstate(invalid="ignore"):
            slopes = posterior.slopes(logarithms)
        slopes = np.where(np.isfinite(slopes), slopes, 0.0)
        variances = np.einsum("ni,ij,nj->n", slopes, posterior.covariance, slopes).reshape(len(ANSWERED), 3)
        # Thrust that changes slowly changes V_ss and Tau by at least half as much: V_ss² grows like the thrust.
        variances[:, :2] += (_OF_THRUST * posterior.table.get(posterior.z, "slow gain")) ** 2
        sizes = np.abs(pushes or ANSWERED)
        variances += ((_EXPONENT * np.log(np.maximum(sizes / strongest, 1.0))) ** 2)[:, None]
        half = np.minimum(np.maximum(QUANTILE * np.sqrt(variances), EXACT), _WIDEST_HALF)
        middle = logarithms(posterior.z[:, None]).reshape(half.shape)
        return middle - half, middle + half

    of_file = values(vehicle, NO_SHAPES)
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = np.log(np.abs(of_file))
        lows, highs = zip(*map(intervals, posteriors), strict=True)
        low, high = (np.where(np.isfinite(end), end, middle) for end in (np.min(lows, axis=0), np.max(highs, axis=0)))
        ends = np.exp(np.stack([np.minimum(low, middle - EXACT), np.maximum(high, middle + EXACT)], axis=-1))
    found = []
    for command, (V, rise, stop), intervals_of in zip(ANSWERED, of_file.tolist(), ends.tolist(), strict=True):
        steady, of_rise, of_stop = map(tuple, intervals_of)
        signed = steady if V >= 0.0 else (-steady[1], -steady[0])
        found.append(Answer(axis, command, (V, signed), (rise, of_rise), (stop, of_stop)))
    return tuple(a for a in found if a.steady[0] and isfinite(a.steady[0]) and isfinite(a.rise[0]))


def pushes_of_thrusters(wrench: Vehicle, own: Vehicle, axis: Axis) -> tuple[float, ...]:
    """Return how hard the usual commands of the thrusters push along an axis, relative to the full force of a wrench.

    It is empty unless the logs have a wrench, whose full command is its largest force, and the vehicle has thrusters.
    """
    if not (wrench.layout.has_wrench and own.layout.thrusters):
        return ()

    def push(vehicle: Vehicle, command: float) -> float:
        at_rest, pushed = NO_SHAPES.motions(vehicle, axis, np.array([0.0, command])).of["C"].tolist()
        return float(pushed - at_rest)

    return tuple(push(own, command) / push(wrench, 1.0) for command in ANSWERED)


def answers_of_file(vehicle: Vehicle, axis: Axis) -> tuple[Answer, ...]:
    """Return the answers of a vehicle file, without those that are not finite.

    The intervals contain 95 % of the vehicles that its estimates allow; a file without estimates has none, so that they
    have no width.
    """
    known = vehicle.uncertainty
    drawn = known.drawn(Sobol(max(len(known.names), 1), seed=1).random(_DRAWS)[:, : len(known.names)])
    drawn = np.vstack([[vehicle[name] for name in known.names], drawn])
    rovs = replace(vehicle, coefficients={**vehicle.coefficients, **dict(zip(known.names, drawn.T, strict=True))})
    pushed, rest = (NO_SHAPES.motions(rovs, axis, np.array(some)) for some in (ANSWERED, (0.0,)))
    responses = _responses(pushed, rest).reshape(len(ANSWERED), 3, -1)
    found = []
    for command, values in zip(ANSWERED, responses, strict=True):
        ends = np.quantile(values[:, 1:], (0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL), axis=1) if known.names else values.T
        low, high = ends[0].tolist(), ends[-1].tolist()
        steady, rise, stop = zip(values[:, 0].tolist(), zip(low, high, strict=True), strict=True)
        found.append(Answer(axis, command, steady, rise, stop))
    return tuple(a for a in found if a.steady[0] and isfinite(a.steady[0]) and isfinite(a.rise[0]))


def _responses(motions: Motions, rest: Motions) -> Array:
    """Return V_ss, Tau and the stopping distance, from V_ss to a tenth of it: commands x 3, or commands x 3 x n."""
    V, Tau = motions.response()
    return np.stack([V, Tau, rest.stopping_distance(V, _STOPPED)], axis=1)


# ---- Verdicts --------------------------------------------------------------------------------------------------------


def _exceeded(value: float, largest: Mapping[str, float]) -> tuple[Word, float] | None:
    """Return the verdict for a value that exceeds the largest one for `good`, and the largest one that it exceeds."""
    if value > largest["usable"]:
        return "do not use", largest["usable"]
    return ("usable", largest["good"]) if value > largest["good"] else None


def verdict(
    found: Sequence[Prediction],
    given: Sequence[Answer],
    slow: Sequence[Disturbance],
    difference: float,
    slips: Sequence[Slip] = (),
    steady: Sequence[Point] = (),
    effects: Sequence[Effect] = (),
    misfits: Sequence[str] = (),
) -> Verdict:
    """Return whether the model of an axis may be trusted.

    It is judged by its predictions, its intervals, what is unknown, two starts, mistakes in the files of the axis, the
    steady velocities of its tables, each predicted without the rows of the same command, the sizes of effects, and
    `misfits`, the logs whose motors are not the thrusters along the axis.
    """
    reasons = [f"The motors of {file} are not the thrusters of the vehicle." for file in misfits]
    word: Word = "do not use" if misfits else "good"

    def lower(to: Word, reason: str) -> None:
        nonlocal word
        order: list[Word] = ["good", "usable", "do not use"]
        word = max(word, to, key=order.index)
        reasons.append(reason)

    judged = [p for p in found if p.is_judged]
    if judged:
        coverage = coverage_of(judged)
        to: Word = "good" if coverage >= GOOD else "usable" if coverage >= USABLE else "do not use"
        lower(to, f"The 95% bands contain {coverage:.0%} of the unseen samples.")
        moving = [p for p in judged if p.unchanged > _MOVING * p.noise]
        worse = [p for p in moving if p.error > p.unchanged]
        if worse and len(worse) * 2 > len(moving):
            lower("do not use", f"A prediction of no change is better for the {worse[0].quantity} in {worse[0].file}.")
        elif worse:
            lower("usable", f"A prediction of no change is better for the {worse[0].quantity} in {worse[0].file}.")
    unknown = [d for d in slow if d.kept]
    if sum(d.share for d in unknown) > MOST_UNKNOWN:
        largest = max(unknown, key=lambda d: d.share)
        is_turn = largest.axis is not None and largest.axis.is_rotation
        sentences = {
            "gain": "The thrust changes for an unknown reason by {:.0%}",
            "force": f"An unknown slow {'torque' if is_turn else 'force'} is as large as {{:.0%}} of the thrusters'",
            "velocity": "An unknown slow velocity over ground is as large as {:.0%} of the vehicle's",
        }
        lower("do not use", f"{sentences[largest.kind].format(largest.share)} in {largest.file}.")
    widths = [(a.steady[1][1] - a.steady[1][0]) / abs(a.steady[0]) for a in given if a.command in COMMANDS]
    if not widths:
        lower("do not use", "No steady velocity is determined.")
    elif exceeded := _exceeded(0.5 * min(widths), _WIDEST):
        lower(exceeded[0], f"The steady velocities are known to no better than {exceeded[1]:.0%}.")
    off = relative_error(steady, "held_out")
    if exceeded := _exceeded(off, _FARTHEST):
        lower(exceeded[0], f"The other commands predict a V_ss of the tables with an error of {off:.0%} (RMS).")
    for effect in effects:
        if effect.is_unusual:
            lower("usable", f"The {effect.name} is unusual.")
    for slip in slips:
        wrong = f"The {slip.quantity} in {slip.file} seems to have another unit or sign"
        lower("do not use", f"{wrong}, and all axes are fitted to this log.")
    if difference > DISAGREEMENT:
        lower("do not use", "Two starts of the fit led to different vehicles.")
    if not reasons:
        reasons.append("The tables determine the steady velocities; no unseen motion was predicted.")
    return Verdict(word, tuple(reasons))
