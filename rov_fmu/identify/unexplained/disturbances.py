"""What is slow and not explained by the model: forces, changes of all thrust, and velocities over ground."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from rov_fmu.equation.catalogue import AXES, HEAVE, Axis
from rov_fmu.identify.likelihood.filter import DivergedError, FilterRun
from rov_fmu.identify.likelihood.kinds import SLOW
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.parameters import HORIZONTAL, Parameter
from rov_fmu.identify.likelihood.posterior import Posterior, around
from rov_fmu.identify.likelihood.solve import ENOUGH, Minimum, evidence, minimise
from rov_fmu.identify.result import KEPT, Disturbance, UnknownForce
from rov_fmu.io.groups import grouped
from rov_fmu.tank.arrays import Array, rms
from rov_fmu.tank.clocks import held

_LITTLE = 0.05
"""A slow force is compared with at least this share of full thrust, and a slow velocity with as many m/s."""
_STEPS = 8
"""The most derivatives of a fit without a slow process."""


def followed(objective: Objective, z: Array) -> list[FilterRun]:
    """Return a run through each log with the states of the filter."""
    return [objective.run(z, n, with_states=True) for n in range(len(objective.logs))]


def disturbances(
    objective: Objective,
    best: Minimum,
    posterior: Posterior,
    runs: Sequence[FilterRun],
    fitted: Sequence[Axis],
    *,
    refines: bool = True,
) -> Iterator[Disturbance]:
    """Yield each slow process of the model in each log that has it, with the evidence for it: those along the axes that
    are fitted, and along no axis. The evidence is rough unless it `refines` the fits without them."""
    for index, p in enumerate(objective.table.parameters):
        if p.kind in SLOW:
            gain, error = _evidence(objective, best, index, _STEPS if refines else 1), float(posterior.errors[index])
            in_logs = [_disturbance(objective, n, best.z, p, runs, gain, error) for n in range(len(runs))]
            yield from (one for one in in_logs if one and (one.axis is None or one.axis in fitted))


def largest(some: Iterable[Disturbance]) -> Iterator[Disturbance]:
    """Yield each slow process as it is in the log where it is largest."""
    for own in grouped(((one.kind, one.of), one) for one in some).values():
        yield max(own, key=lambda one: one.share)


def unknown_forces(objective: Objective, runs: Sequence[FilterRun]) -> Iterator[UnknownForce]:
    """Yield the slow force along each axis of each log."""
    for number, (sampled, run) in enumerate(zip(objective.logs, runs, strict=True)):
        first, time = objective.filters[number].force, objective.records[number].time
        for index, form in enumerate(sampled.layout.axes, first):
            yield UnknownForce(form.axis, sampled.file, time, run.states[:, index], run.deviations[:, index])


def _evidence(objective: Objective, best: Minimum, index: int, steps: int) -> float:
    """Return 2 ln of the Bayes factor of a slow process, from a fit of all other parameters without it, in some steps.

    The fit ends as soon as it is certain whether the evidence is strong: where the minimum within reach is not low
    enough, or where J is low enough already. The information about the other parameters is taken to be the same without
    it, because that about small sizes is rough.
    """
    without, with_it = objective.without([index]), evidence(objective, best)

    def gain(end: Minimum) -> float:
        return with_it - evidence(without, replace(end, information=best.information))

    z = np.clip(best.z, without.low, without.high)
    try:
        end = replace(best, z=z, value=without.value(z, objective.runs(z, best.runs)))
        for n in range(steps):
            start, near = end, () if n else best.data
            if gain(start) <= KEPT:
                break
            end = minimise(without, start.z, near=near, most=1, last=False, promises=lambda one, _: gain(one) <= KEPT)
            if n and start.value - end.value < ENOUGH:
                break
        return gain(end)
    except DivergedError:
        return inf


def thrust_along(objective: Objective, z: Array, number: int, time: Array, axis: Axis | None) -> Array:
    """Return the thrust along an axis that the model commands, N or N m; without an axis, the largest command."""
    sampled, record = objective.logs[number], objective.records[number]
    inputs = held(record.told, record.inputs, time)
    names = [*sampled.layout.inputs]
    if axis is None:
        thrusters = [names.index(f"u_{thruster.name}") for thruster in sampled.layout.thrusters]
        return np.asarray(np.max(np.abs(inputs[:, thrusters]), axis=1))
    return sampled.thrust(objective.table.coefficients(z), inputs)[:, sampled.layout.bare_axes.index(axis)]


def _disturbance(
    objective: Objective,
    number: int,
    z: Array,
    parameter: Parameter,
    runs: Sequence[FilterRun],
    evidence: float,
    error: float,
) -> Disturbance | None:
    """Return a slow process in one log; None if the log does not have it. `error` is that of ln of its size."""
    sampled, run, time = objective.logs[number], runs[number], objective.records[number].time
    slow = SLOW[parameter.kind]
    columns = objective.filters[number].indices_of(slow.acts_as, parameter.of)
    if not columns or (sampled.record.wanders and parameter.of == HORIZONTAL):
        return None
    axis = AXES.get(parameter.of)
    states = run.states[:, columns]
    acting, unit, usual = states, parameter.unit, 1.0
    if slow.acts_as == "gain":
        acting = np.expm1(states)
    elif slow.acts_as == "force":
        assert axis
        unit = axis.load
        thrust = rms(thrust_along(objective, z, number, time[::10], axis))
        usual = max(thrust, _LITTLE * objective.table.full[axis.name])
    else:
        speeds = [
            n
            for n, form in enumerate(sampled.layout.axes)
            if not form.axis.is_rotation and (form.axis is HEAVE) == (axis is HEAVE)
        ]
        usual = max(rms(np.linalg.norm(run.states[:, speeds], axis=1)), _LITTLE)
    size = float(np.sqrt(np.mean(np.sum(acting**2, axis=1))))
    return Disturbance(
        parameter.kind,
        parameter.of,
        parameter.kind,
        size,
        around(size, size * error, positive=True),
        unit,
        evidence,
        axis=axis,
        file=sampled.file,
        share=size / usual,
    )
