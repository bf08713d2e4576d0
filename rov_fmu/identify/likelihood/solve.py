"""Minimise the objective by Fisher scoring, damped in units of the prior (Levenberg-Marquardt)."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import log
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rov_fmu.identify.likelihood.filter import DivergedError, FilterRun
from rov_fmu.identify.likelihood.objective import Data, DataPart, Objective, Samples, with_samples
from rov_fmu.identify.result import KEPT
from rov_fmu.tank.arrays import Array

Chosen = NDArray[np.bool_]
_Key = TypeVar("_Key")
OnStep = Callable[[int], None]
"""A function that is called with the number of each step of a fit."""

MOST_STEPS = 30
ENOUGH = 0.3
"""The fit ends when a step reduces J by less. 1 is one unit of 2 ln of the likelihood."""
QUICK = 8.0
"""The reduction of J by new derivatives at which a quick fit ends."""
REST = 3.0
"""J may still fall by so many times what it fell by in the last step: the sum of steps that each gain 3/4 of the one
before. A fit that cannot come close to the best one by this is given up."""
_TRIALS = ((0.0, 1.0), (0.0, 0.4), (0.0, 0.1), (0.03, 1.0), (0.3, 1.0), (3.0, 1.0), (100.0, 1.0), (1e4, 1.0))
"""The steps that are tried together: the damping in units of the information of the prior, and the share of the step.
Data that are far more exact than the prior make a step short by its share alone."""
_CAREFUL = 2
"""The number of the start for a motion that diverges from others: a heavier vehicle with less drag."""
_LARGEST = 4.0
"""The largest change in one step, in standard deviations of the prior."""
_UP = 0.5
"""The largest growth of the logarithm of a slow process in one step: J grows like the square of the size."""
_WITH_SAME, _SLOW = 3, 0.3
"""The most steps with the same derivatives, and the share of their reduction of J that another one must be worth."""
_STALLED = 2
"""A search ends when new derivatives reduce J by too little so often in turn: at a kink they may fail by chance."""
_REFIT_STEPS, _REFIT_ENOUGH, _REFIT_FAR = 8, 0.1, 2.0
"""The most steps of a fit to a part of the data, the expected reduction of J at which it ends, and the reduction by a
step from which the next one has new derivatives."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the objective is least. p parameters."""

    z: Array
    value: float
    """J."""
    runs: Sequence[FilterRun]
    data: Sequence[Data]
    """The innovations of each log, and then of the rows of tables, with their derivatives."""
    information: Array
    """p x p: the second derivatives of J, with those of the prior."""


def minimise(
    objective: Objective,
    start: Array,
    on_step: OnStep = lambda _: None,
    *,
    elsewhere: Sequence[Array] = (),
    **how: Any,
) -> Minimum:
    """Minimise J from a start. Raises DivergedError.

    If a motion diverges at the start, the fit begins `elsewhere`. Then the vehicle of the start has noise as in a first
    fit, and then the values of a careful start: rounding decides whether motions that no sensor measures diverge beside
    exact measurements, so they do on one processor and not on another. The other options are those of `_minimised`.
    """
    for z in (start, *elsewhere, louder(objective, start)):
        with suppress(DivergedError):
            return _minimised(objective, z, on_step, **how)
    return _minimised(objective, start_of(objective, _CAREFUL), on_step, **how)


def _minimised(
    objective: Objective,
    start: Array,
    on_step: OnStep,
    *,
    near: Sequence[Data] = (),
    most: int = MOST_STEPS,
    enough: float = ENOUGH,
    last: bool = True,
    promises: Callable[[Minimum, float], bool] | None = None,
) -> Minimum:
    """Minimise J from a start. Raises DivergedError at the start.

    All runs take the steps of the first one: J jumps by a few units where other parameters need other steps. The first
    derivatives are those `near` the start, if they are given. The fit ends when derivatives twice in turn reduce J by
    less than `enough`, the second time exact ones. It ends early if
    `promises` returns False. This gets the minimum within reach, and the reduction of J by the derivatives before,
    which is infinite at first. Data and information of a `last` fit have exact derivatives: those of the step before if
    J hardly fell, and otherwise others, after one more step with them, unless motions beside the minimum diverge. Those
    of a fit that is not the last are of the step before.
    """
    z = np.clip(start, objective.low, objective.high)
    runs = objective.runs(z)
    now, stalled = Minimum(z, objective.value(z, runs), runs, near, np.diag(2.0 / objective.deviation**2)), 0
    gain = np.inf
    for count in range(1, most + 1):
        on_step(count)
        try:
            if near and count == 1:
                data = with_samples(near, objective.samples(z, runs))
            else:
                data = objective.data(now.z, now.runs, exact=stalled > 0)
            information = total_information(objective, now.z, data)[1]
        except DivergedError:
            if count == 1:
                raise
            break
        before = now = replace(now, data=data, information=information)
        if promises and not promises(_within_reach(objective, now), gain):
            break
        now = _descended(objective, now)
        gain = before.value - now.value
        stalled = stalled + 1 if gain < enough else 0
        if stalled == _STALLED:
            break
    if last and not (stalled == _STALLED and gain < ENOUGH):
        try:
            now = _descended(objective, replace(now, data=objective.data(now.z, now.runs)))
        except DivergedError:  # beside the minimum; the derivatives of the step before are near
            if not now.data:
                raise
    if last:
        now = replace(
            now, runs=objective.runs(now.z, now.runs), information=total_information(objective, now.z, now.data)[1]
        )
    return now


def refined(objective: Objective, near: Minimum) -> Minimum:
    """Return a minimum after a step with exact derivatives, or as it is if motions beside it diverge."""
    with suppress(DivergedError):
        return _minimised(objective, scaled(objective, near.z), lambda _: None, near=near.data, most=0)
    return near


def start_of(objective: Objective, number: int = 0) -> Array:
    """Return the coordinates at which a start begins."""
    return np.asarray(objective.mean + objective.deviation * objective.table.each("of_kind.starts")[:, number])


def louder(objective: Objective, z: Array) -> Array:
    """Return the same vehicle with noise that is at least that of a first fit."""
    return np.where(objective.table.each("of_motion"), z, np.maximum(z, start_of(objective)))


def least_from(objective: Objective, start: Array, on_step: OnStep = lambda _: None, than: float = np.inf) -> Minimum:
    """Return the lower of two minima: the one from a start, and the one from there with larger dead bands.

    In the valley between both, J has a kink wherever the dead band passes a command of the tests. A fit that will not
    come below `than`, or the second one below the first, is given up.
    """

    def least(start: Array, than: float, on_step: OnStep) -> Minimum:
        def promises(end: Minimum, gain: float) -> bool:
            return end.value - REST * gain < than

        return minimise(objective, start, on_step=on_step, enough=QUICK, last=False, promises=promises)

    end = least(start, than, on_step)
    larger = objective.table.with_larger_dead_bands(end.z)
    if end.value > than or np.array_equal(larger, end.z):
        return end
    other = least(larger, end.value, lambda step: on_step(step + MOST_STEPS))
    return min(end, other, key=lambda found: found.value)


def _descended(objective: Objective, start: Minimum) -> Minimum:
    """Return a point with a smaller J, after a few steps with the same derivatives, or the same point.

    Each step is the best of some that are damped differently, which run in the lanes of the filter together.
    """
    now = start
    of_motion = objective.table.each("of_motion")
    for count in range(_WITH_SAME):
        free = of_motion if count == 0 else np.ones(len(now.z), bool)
        gradient, information = total_information(objective, now.z, now.data)
        moved = []
        for damping, share in _TRIALS:
            change = share * (_step(objective, now.z, gradient, information, free, damping) - now.z)
            moved.append(now.z + change / max(float(np.max(np.abs(change) / objective.deviation)) / _LARGEST, 1.0))
        trials = objective.trials(np.array(moved).T, [objective.whole] * len(moved), start.runs)
        least = min(range(len(moved)), key=lambda n: trials[n][0])
        value, samples = trials[least]
        gain = now.value - value
        if not gain > 0.0:
            continue
        runs = [replace(run, innovations=off, variances=S) for run, (off, S) in zip(now.runs, samples, strict=False)]
        data = with_samples(now.data, samples)
        now = Minimum(moved[least], value, runs, data, information)
        if count > 0 and gain < _SLOW * (start.value - value):
            break
    return now


def _within_reach(objective: Objective, minimum: Minimum) -> Minimum:
    """Return what is reached if the next step reduces J by twice what is expected of it."""
    gradient, information = total_information(objective, minimum.z, minimum.data)
    change = _step(objective, minimum.z, gradient, information, np.ones(len(minimum.z), bool), 0.0) - minimum.z
    value = minimum.value + 2.0 * float(gradient @ change + 0.5 * change @ information @ change)
    return replace(minimum, z=minimum.z + change, value=value)


def refits(
    objective: Objective, best: Minimum, parts: Sequence[DataPart], absent: Sequence[Collection[int]] = ()
) -> list[Minimum]:
    """Minimise J for some parts of the data, each from the minimum for all data, without the noise.

    If `absent` is given, it has the indices of the effects that each fit is without. All fits take their damped steps
    together, so that the lanes of the filter are full. The derivatives are those at the minimum for all data, which are
    exact, as long as a fit is near it, and always if it is without effects. A fit to most of the data needs two steps.
    """
    free = objective.table.each("of_motion")
    fits = [
        _Refit(objective.of(part).without(gone), part, best, is_inside=not gone)
        for part, gone in zip(parts, absent or [()] * len(parts), strict=True)
    ]
    for _ in range(_REFIT_STEPS):
        active = [fit for fit in fits if fit.proposes(free) > _REFIT_ENOUGH or fit.value == np.inf]
        if not active:
            break
        moved = np.array([fit.moved for fit in active]).T
        for fit, trial in zip(active, objective.trials(moved, [fit.part for fit in active], best.runs), strict=True):
            fit.judge(*trial)
    return [
        Minimum(fit.z, fit.value, fit.runs, fit.data, total_information(fit.objective, fit.z, fit.data)[1])
        for fit in fits
    ]


class _Refit:
    """A fit to a part of the data, between two steps."""

    def __init__(self, objective: Objective, part: DataPart, best: Minimum, *, is_inside: bool) -> None:
        self.objective, self.part, self.z, self.is_inside = objective, part, best.z, is_inside
        self.runs: Sequence[FilterRun] = [best.runs[n] for n in part.logs]
        self.data = _data_of(part, best)
        self.value = objective.value(self.z, self.runs) if is_inside else np.inf
        self.damping = 0.0

    def proposes(self, free: Chosen) -> float:
        """Find the next step, which changes no parameter by more than the largest change, and the expected gain."""
        gradient, information = total_information(self.objective, self.z, self.data)
        while True:
            self.moved = _step(self.objective, self.z, gradient, information, free, self.damping)
            change = self.moved - self.z
            if not np.max(np.abs(change) / self.objective.deviation) > _LARGEST:
                break
            self.damping = max(4.0 * self.damping, 1e-3)
        return -float(gradient @ change + 0.5 * change @ information @ change)

    def judge(self, value: float, samples: Sequence[Samples]) -> None:
        """Take the step if J falls, with new derivatives if it falls by much. Otherwise, the next step is shorter."""
        if not value < self.value:
            self.damping = max(8.0 * self.damping, 1.0)
            return
        gain, self.z, self.value, self.damping = self.value - value, self.moved, value, self.damping / 8.0
        self.data = with_samples(self.data, samples)
        if self.is_inside and _REFIT_FAR < gain < np.inf:
            with suppress(DivergedError):
                self.runs = self.objective.runs(self.z, self.runs)
                self.data = self.objective.data(self.z, self.runs, exact=False, of_noise=self.data)


def _data_of(part: DataPart, best: Minimum) -> list[Data]:
    """Return the data of a minimum for a part of its logs and rows."""
    rows = [best.data[-1].part(part.rows)] if part.rows else []
    return [*(best.data[n] for n in part.logs), *rows]


def information_of(objective: Objective, best: Minimum, part: DataPart) -> Array:
    """Return the information of a part of the data at the minimum for all, with that of the prior."""
    return total_information(objective.of(part), best.z, _data_of(part, best))[1]


def total_information(objective: Objective, z: Array, data: Sequence[Data]) -> tuple[Array, Array]:
    """Return the gradient and the information of J, with those of the prior.

    Raises DivergedError where they are no numbers: a motion nearly overflows.
    """
    weight = 1.0 / objective.deviation**2
    size = len(z)
    gradient, information = np.zeros(size), np.zeros((size, size))
    for n, some in enumerate(data):
        g, H = some.information(objective.chosen(n))
        gradient, information = gradient + g, information + H
    if not np.isfinite(information).all() or not np.isfinite(gradient).all():
        raise DivergedError
    curvature = [
        _size_curvature(g, 2.0 * (z[n] - parameter.mean) / parameter.deviation**2, 2.0 / parameter.deviation**2)
        if parameter.of_kind.is_size
        else 0.0
        for n, (parameter, g) in enumerate(zip(objective.table.parameters, gradient, strict=True))
    ]
    diagonal = np.maximum(np.diag(information) + 2.0 * weight, curvature)
    np.fill_diagonal(information, diagonal)
    return gradient + 2.0 * weight * (z - objective.mean), information


def _size_curvature(data: float, prior: float, prior_slope: float) -> float:
    """Return the second derivative of J with which a Newton step of the logarithm of a small size ends at its minimum.

    `data` and `prior` are the two parts of the first derivative. The part of the data grows like the square of the
    size, exp(2 z), so that a step towards the prior would go much too far: its expected second derivative is 0.
    """
    if data <= 0.0 or data + prior >= 0.0:
        return 0.0
    end = -prior / prior_slope  # the mean of the prior
    change: float = brentq(lambda step: data * np.exp(2.0 * step) + prior + prior_slope * step, 0.0, min(end, 20.0))
    return -(data + prior) / max(change, 1e-3)


def _step(objective: Objective, z: Array, gradient: Array, information: Array, free: Chosen, damping: float) -> Array:
    """Return the end of a damped step. What would leave its bounds stays at them, and the others move on without it."""
    weight, moving = 2.0 / objective.deviation**2, free & objective.free
    is_size = objective.table.each("of_kind.is_size")
    change = np.clip(z, objective.low, objective.high) - z  # an effect that becomes absent is beyond
    moving &= ~((z <= objective.low) & (gradient > 0.0)) & ~((z >= objective.high) & (gradient < 0.0)) & (change == 0.0)
    for _ in range(len(z)):
        part = np.flatnonzero(moving)
        H = information[np.ix_(part, part)] + damping * np.diag(weight[part])
        held = information[np.ix_(part, np.flatnonzero(~moving))] @ change[~moving]
        change[part] = -_solved(H, gradient[part] + held)
        ends = np.clip(z + change, objective.low, np.minimum(objective.high, np.where(is_size, z + _UP, np.inf)))
        beyond = moving & (ends != z + change)
        change = np.where(beyond, ends - z, change)
        if not beyond.any():
            break
        moving &= ~beyond
    return z + change


def _solved(H: Array, right: Array) -> Array:
    """Return the solution of H x = right: the shortest one where exact data leave no digit of H for the priors."""
    try:
        found = np.linalg.solve(H, right)
    except np.linalg.LinAlgError:
        size = 1.0 / np.sqrt(np.diag(H))
        found = size * np.linalg.lstsq(size[:, None] * H * size, size * right)[0]
    return np.asarray(found, np.float64)


def evidence(objective: Objective, minimum: Minimum) -> float:
    """Return 2 ln of the probability of all data by a model, but for a constant, from the minimum of its J."""
    free, widths = objective.free, objective.deviation
    return laplace(minimum.value, (0.5 * widths[:, None] * minimum.information * widths)[np.ix_(free, free)])


def laplace(J: float, information: Array) -> float:
    """Return 2 ln of the probability of data by the Laplace approximation, but for a constant.

    `information` has the second derivatives of J/2 at its minimum, p x p, in units of the deviations of the priors. A
    parameter about which the data tell nothing does not change the result.
    """
    return -J - float(np.linalg.slogdet(information).logabsdet)


def best_explanations(evidence: Mapping[_Key, float]) -> list[_Key]:
    """Return which explanations of a list are told, the best first: those near the best, if they are better than none.

    `evidence` has 2 ln of the Bayes factor of each against none. Before the data, none of them is as probable as all
    together, and each is as probable as any other.
    """
    least = max(KEPT + 2.0 * log(len(evidence)), max(evidence.values()) - KEPT)
    return [key for key in sorted(evidence, key=evidence.__getitem__, reverse=True) if evidence[key] > least]


def scaled(objective: Objective, z: Array) -> Array:
    """Return the parameters with the scales of thrust, drag, load and inertia that their priors prefer.

    Motion does not tell these scales, and steps of the fit, which are short where the data have kinks, hardly move
    them. The parameters stay if J would not fall: measured forces, and axes with exact coefficients, tell the scales.
    """
    directions = objective.table.scales_of_forces(z)
    if not directions.any():
        return z
    weighted = directions / objective.deviation
    changes = np.linalg.lstsq(weighted.T, (objective.mean - z) / objective.deviation, rcond=None)[0]
    moved = objective.table.with_scales(z, changes)
    moved = np.clip(moved, objective.low, objective.high)
    with suppress(DivergedError):
        before, after = (objective.value(one, objective.runs(one)) for one in (z, moved))
        return moved if after < before else z
    return z
