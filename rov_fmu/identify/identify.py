"""Identify a vehicle from a folder of tank tests and dive logs: log -> likelihood -> posterior -> vehicle.

The objective is stated in objective.py, and the priors in parameters.py. This file is the order of the work.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from rov_fmu.equation.catalogue import AXES, COUPLED_AXES, Axis
from rov_fmu.equation.parts import Part
from rov_fmu.identify import assess
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.effects import command_times, loggers_of, optional_effects, sensors_of, structures_of
from rov_fmu.identify.findings import UNLOGGED, beyond_thrusters, is_commanded, is_unlogged, may_rock, told
from rov_fmu.identify.given import Tests, thrusters_along_no_other
from rov_fmu.identify.held_out import held_out, held_out_rows, points_of, predictions
from rov_fmu.identify.identified_vehicle import identified_vehicle, vehicle_of_file, with_own_inputs
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.fit import Fit, fit_all
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.progress import OnAnswer, ProgressReport
from rov_fmu.identify.result import (
    ALARM,
    Answer,
    AxisOfBase,
    AxisResult,
    Identification,
    IdentifiedCoefficient,
    MeasuredPoint,
    Prediction,
    Slip,
    Tested,
)
from rov_fmu.identify.unexplained.disturbances import disturbances, followed, largest, unknown_forces
from rov_fmu.identify.unexplained.slips import Fits, slips
from rov_fmu.identify.verdict import MOST_GAIN, most_inertia, verdict
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import Progress, silent
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.findings import MISFITS, REFUSED, sentences
from rov_fmu.vehicle.checks import no_thrust
from rov_fmu.vehicle.uncertainty import correlation
from rov_fmu.vehicle.vehicle import Vehicle

__all__ = ["identify", "load_tests"]


def identify(tests: Tests, on_progress: Progress = silent, on_answer: OnAnswer | None = None) -> Identification:
    """Identify a vehicle from its tests. Raises DataFileError if nothing can be identified, and VehicleFileError.

    `on_answer` is called with each axis and a first answer as soon as a fit stands, and again as it improves.
    """
    with threadpool_limits(limits=1, user_api="blas"):  # the matrices are small: more threads would wait for each other
        try:
            return _identify(tests, on_progress, on_answer)
        except DivergedError:
            reason = "no simulation of the logs stays finite. Are units and signs right?"
            raise DataFileError(f"{tests.folder.path}: {reason}") from None


def _identify(tests: Tests, on_progress: Progress, on_answer: OnAnswer | None) -> Identification:
    if lines := sentences(finding for finding in tests.folder.findings if finding.kind in REFUSED):
        raise DataFileError(*(f"{tests.folder.path}: {line}" for line in lines))
    on_progress("reading the logs", 0.0)
    known, logs, rows = begin(tests)
    if not (known.fitted or known.curves):
        own = ", ".join(sorted(tests.description.known))
        raise DataFileError(f"{tests.folder.path}: nothing is identifiable: rov.toml gives all that it tests ({own})")
    wrong, scaled = tuple[Slip, ...](), Fits()

    def is_mistaken(objective: Objective, z: Array, errors: Array) -> bool:
        nonlocal wrong
        found, left = slips(tests, objective, z, errors, {}, scaled)
        wrong = found if left <= ALARM else ()
        return bool(wrong)

    work = ProgressReport(on_progress, on_answer)
    fit = fit_all(known, logs, rows, work, is_mistaken)
    show = work.steps("predicting what was left out")
    show(0)
    predicted = []
    out = [] if fit.has_ended else held_out(fit.objective, fit.best)  # nobody should use what it predicts
    for prediction in predictions(fit.objective, fit.best, out):
        predicted.append(prediction)
        show(len(predicted))
    runs = followed(fit.objective, fit.best.z)
    refines = not fit.has_ended
    slow = tuple(disturbances(fit.objective, fit.best, fit.posterior, runs, known.fitted, refines=refines))
    vehicle, coefficients = identified_vehicle(tests, fit)
    for curve in vehicle.layout.curves:
        if mistake := next(no_thrust(curve, vehicle.coefficients, f"thrust_{curve.name}*.csv"), None):
            raise DataFileError(f"{tests.folder.path}: {mistake}")
    wrong = wrong or slips(tests, fit.objective, fit.best.z, fit.posterior.errors, fit.starts, scaled)[0]
    points = [*points_of(tests, held_out_rows(fit.objective, fit.best), vehicle)]
    names, by_name = tuple(vehicle.estimates), vehicle.layout.curves_by_name
    found = Identification(
        folder=tests.folder,
        vehicle=with_own_inputs(vehicle, tests),
        axes=(),
        curves={curve.name: _those_of(coefficients, by_name[curve.name]) for curve in fit.known.curves},
        forces=tuple(p for p in points if p.quantity == "force"),
        effects=tuple(optional_effects(fit)),
        disturbances=slow,
        logging=tuple(loggers_of(fit)),
        sensors=tuple(sensors_of(fit)),
        correlation=(names, correlation(names, vehicle.estimates)),
        objective=fit.best.value,
        unknown_forces=tuple(unknown_forces(fit.objective, runs)),
        slips=wrong,
        structures=tuple(structures_of(fit)),
        alike=fit.alike,
        has_ended=fit.has_ended,
        times=command_times(fit),
    )
    axes, tested = [], assess.tested_commands(fit.objective, fit.best.z)
    for axis in known.fitted:
        axes.append(_axis(found, tests, fit, vehicle, coefficients, axis, tested[axis], predicted, points))
    found = replace(found, disturbances=tuple(largest(slow)))
    of_file = found.vehicle
    if not tests.description.tables.validity:
        ends = {one.axis.name: (0.0 - round(one.tested[0], 2), round(one.tested[1], 2)) for one in axes}
        of_file = replace(of_file, tested=ends)
    of_file = vehicle_of_file(fit, of_file, tests.folder.path)
    folder = replace(tests.folder, findings=[*tests.folder.findings, *beyond_thrusters(vehicle, of_file)])
    of_base = tuple(_of_base(tests, fit, of_file))
    return told(replace(found, folder=folder, vehicle=of_file, axes=tuple(axes), axes_of_base=of_base))


def _axis(
    found: Identification,
    tests: Tests,
    fit: Fit,
    vehicle: Vehicle,
    coefficients: Mapping[str, IdentifiedCoefficient],
    axis: Axis,
    tested: Tested,
    predicted: Sequence[Prediction],
    points: Sequence[MeasuredPoint],
) -> AxisResult:
    """Return what concerns an axis, of the logs that show it; `found` has what concerns all axes, also the disturbances
    in all logs, and `vehicle` is that of the fit."""
    # The thrust of a wrench is the largest force in the logs, if there is any.
    is_told = not vehicle.layout.has_wrench or is_commanded(axis, vehicle.layout, tests.folder.logs)
    files = [one.file for one in fit.objective.logs if any(m.axis is axis for m in one.measured)]
    driving = [(one.log.whole_file, len(one.driven)) for one in fit.objective.logs if axis in one.driven]
    mixed = dict.fromkeys(file for file, count in driving if count > 1)
    slow = [*largest(d for d in found.disturbances if d.concerns(axis) and d.file in files)]
    is_steady = all(d.share <= MOST_GAIN for d in slow if d.changes_thrust and d.kept)
    push = assess.push_of_thrusters(vehicle, found.vehicle, axis)
    least = assess.ROCKING if may_rock(tests.folder, axis) else 0.0
    answers: tuple[Answer, ...] = ()
    tested_own = assess.commands_that_push(push, tested) if push else tested
    if is_told and is_steady:
        commands = assess.commands_of_answers(tested_own)
        pushes = [push(c) for c in commands] if push else []
        every = assess.answers(fit.posteriors, axis, vehicle, tested, commands, pushes, least, fit.speeds)
        answers = tuple(a for a in every if abs(a.command) <= round(fit.most_followed, 2))
    misfits = [f.file for f in tests.folder.findings if f.kind in MISFITS and f.axis == axis.name and f.file in files]
    drivers = {thruster.curve for thruster in vehicle.layout.thrusters_along(axis)}
    acting = [effect for effect in found.effects if effect.of in {"", axis.name, *drivers}]
    concerned = {axis, *(COUPLED_AXES if vehicle.layout.coupled and axis in COUPLED_AXES else ())}
    is_other = assess.differs(fit.ends, axis, tested)
    result = AxisResult(
        axis=axis,
        answers=answers,
        tested=tested_own,
        known=_those_of(coefficients, vehicle.layout.by_name[axis.name], "beta"),
        predictions=tuple(p for p in predicted if p.axis is axis),
        points=tuple(p for p in points if p.subject == axis.name and p.quantity != "force"),
        structure=fit.structure[axis].ratio,
        soon=fit.structure[axis].soon,
        disturbances=slow,
        effects=acting,
        slips=[s for s in found.slips if s.file in files and _axis_of(s) in {None, *concerned}],
        has_voltage=bool(tests.folder.voltages),
        misfits=misfits,
        inertia=most_inertia(vehicle, axis, coefficients.get(axis.coefficient("beta"))),
        alone=[*dict.fromkeys(file for file, _ in driving if file not in mixed)],
        mixed=[*mixed],
        is_assumed=bool(tests.description.assumed),
        difference=fit.difference if is_other else 0.0,
    )
    return replace(result, verdict=verdict(result))


def _axis_of(slip: Slip) -> Axis | None:
    """Return the axis that a mistake in a log concerns; None if its quantity moves along none."""
    return QUANTITIES[slip.quantity].axis


def _of_base(tests: Tests, fit: Fit, vehicle: Vehicle) -> Iterator[AxisOfBase]:
    """Yield the axes that no test identifies.

    The vehicle has those of its base and of rov.toml, of which a fit may change the drag because other axes depend on
    them. It lacks those about which nothing is known.
    """
    description = tests.description
    shown = {c.quantity.axis for log in tests.folder.logs for c in log.channels if not c.unused}
    shown |= {m.axis for one in fit.objective.logs for m in one.measured}
    lacking = [AXES[f.axis] for f in tests.folder.findings if f.kind in ("axis left out", "axis not pushed")]
    for axis in (*(axis for axis in vehicle.layout.bare_axes if axis not in fit.known.fitted), *lacking):
        is_of_file = axis.coefficient("a_d") in description.known
        told = "nothing in the logs shows it" if tests.folder.logs else "no test shows it"
        if axis.name in tests.axes:
            told = "no test changes it"
        elif axis in shown:
            is_lost = is_unlogged(axis, description.layout, tests.folder.logs)
            told = UNLOGGED if is_lost else "nothing in the logs drives it"
        source = ROV_FILE if is_of_file else description.base_name
        lost = thrusters_along_no_other(description.layout, [axis], vehicle.layout.bare_axes) if axis in lacking else ()
        yield AxisOfBase(axis, "" if axis in lacking else source, told, tuple(lost))


def _those_of(
    coefficients: Mapping[str, IdentifiedCoefficient], part: Part, *more: str
) -> tuple[IdentifiedCoefficient, ...]:
    """Return the coefficients of a curve or an axis, of those that the fit changes. `more` are keys beside its own."""
    names = map(part.coefficient, (*part.keys, *more))
    return tuple(coefficients[name] for name in names if name in coefficients)
