"""Minimise the objective by Fisher scoring, damped in units of the prior (Levenberg-Marquardt)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rov_fmu.engine.filter import DivergedError, Run
from rov_fmu.identify.objective import Data, Objective
from rov_fmu.tank.arrays import Array

Chosen = NDArray[np.bool_]

MOST_STEPS = 40
_LARGEST = 2.0
"""The largest change in one step, in standard deviations of the prior."""
_ENOUGH = 0.5
"""The fit ends when a step is expected to reduce J by less. 1 is one unit of 2 ln of the likelihood."""


_FAR = 300.0
"""Until a step reduces J by less, the derivatives are those with frozen gains."""
_REJECTED, _NEAR = 3, 5.0
"""It also ends when so many steps in turn do not reduce J, although a small reduction is expected: J has kinks where a
change of a command coincides with a sample."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the objective is least. p parameters."""

    z: Array
    value: float
    """J."""
    runs: Sequence[Run]
    data: Sequence[Data]
    """The innovations of each log, and then of the rows of tables, with their derivatives."""
    information: Array
    """p x p: the second derivatives of J, with those of the prior."""
    has_converged: bool
    steps: int


def minimise(
    objective: Objective,
    start: Array,
    fixed: Sequence[bool] | None = None,
    on_step: Callable[[int], None] = lambda _: None,
    most: int = MOST_STEPS,
) -> Minimum:
    """Minimise J from a start; parameters that are fixed keep their value. Raises DivergedError at the start."""
    free = np.ones(len(start), bool) if fixed is None else ~np.asarray(fixed, bool)
    z = np.clip(start, objective.low, objective.high)
    runs = objective.runs(z)
    value = objective.value(z, runs)
    damping, has_converged, count, is_near = 30.0, False, 0, False
    data = objective.data(z, runs, exact=False)
    gradient, information = total(objective, z, data)
    for count in range(1, most + 1):
        on_step(count)
        rejected = 0
        while damping < 1e8:
            moved = _step(objective, z, gradient, information, free, damping)
            if np.max(np.abs(moved - z) / objective.deviation) > _LARGEST:
                damping = max(4.0 * damping, 1e-3)
                continue
            expected = -float(gradient @ (moved - z) + 0.5 * (moved - z) @ information @ (moved - z))
            if is_near and expected < _ENOUGH and damping <= 1e-2:
                has_converged = True
                break
            try:
                tried = objective.runs(moved)
                new = objective.value(moved, tried)
            except DivergedError:
                new = np.inf
            if new < value:
                gain = (value - new) / max(expected, 1e-9)
                has_converged = is_near and value - new < _ENOUGH and expected < _NEAR and damping < 1.0
                is_near |= value - new < _FAR
                z, value, runs = moved, new, tried
                damping = damping / 8.0 if gain > 0.5 else damping
                break
            rejected += 1
            if not is_near and rejected >= _REJECTED:
                is_near = True
                break
            if expected < _ENOUGH or (rejected >= _REJECTED and expected < _NEAR):
                has_converged = is_near
                is_near = True
                break
            damping = max(4.0 * damping, 1e-3)
        else:
            break
        if has_converged:
            break
        data = objective.data(z, runs, exact=is_near)
        gradient, information = total(objective, z, data)
    data = objective.data(z, runs)
    _, information = total(objective, z, data)
    return Minimum(z, value, runs, data, information, has_converged, count)


def total(objective: Objective, z: Array, data: Sequence[Data]) -> tuple[Array, Array]:
    """Return the gradient and the information of J, with those of the prior."""
    weight = 1.0 / objective.deviation**2
    gradient, information = 2.0 * weight * (z - objective.mean), np.diag(2.0 * weight)
    for some in data:
        g, H = some.information()
        gradient, information = gradient + g, information + H
    return gradient, information


def _step(objective: Objective, z: Array, gradient: Array, information: Array, free: Chosen, damping: float) -> Array:
    """Return the end of a damped step. What would leave its bounds stays at them, and the others move on without it."""
    weight, moving = 2.0 / objective.deviation**2, free.copy()
    moving &= ~((z <= objective.low) & (gradient > 0.0)) & ~((z >= objective.high) & (gradient < 0.0))
    change = np.zeros(len(z))
    for _ in range(len(z)):
        part = np.flatnonzero(moving)
        H = information[np.ix_(part, part)] + damping * np.diag(weight[part])
        held = information[np.ix_(part, np.flatnonzero(~moving))] @ change[~moving]
        change[part] = -np.linalg.solve(H, gradient[part] + held)
        ends = np.clip(z + change, objective.low, objective.high)
        beyond = moving & (ends != z + change)
        change = np.where(beyond, ends - z, change)
        if not beyond.any():
            break
        moving &= ~beyond
    return z + change
