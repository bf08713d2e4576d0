"""Identify a vehicle from a folder of tank tests and dive logs: log -> likelihood -> posterior -> vehicle.

The objective is stated in objective.py, and the priors in parameters.py. This file is the order of the work.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from rov_fmu.equation.catalogue import SURGE, SWAY, Axis
from rov_fmu.equation.parts import Part
from rov_fmu.identify import assess
from rov_fmu.identify.beginning import Tests, begin, load_tests
from rov_fmu.identify.effects import effects_of, loggers_of, sensors_of
from rov_fmu.identify.findings import beyond_thrusters, told
from rov_fmu.identify.identified_vehicle import identified_vehicle, rounded, with_own_inputs
from rov_fmu.identify.likelihood.fit import Fit, fit_all
from rov_fmu.identify.next_test import next_test
from rov_fmu.identify.result import AxisResult, Coefficient, Disturbance, Effect, Identification, Prediction, Slip
from rov_fmu.identify.rows import HeldOut, held_out_rows, points_of
from rov_fmu.identify.unexplained.disturbances import disturbances, followed, unknown_forces
from rov_fmu.identify.unexplained.slips import slips
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import Progress, moving, silent
from rov_fmu.tank.findings import MISFITS
from rov_fmu.vehicle.checks import no_thrust
from rov_fmu.vehicle.uncertainty import correlation
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

__all__ = ["identify", "load_tests"]


def identify(tests: Tests, on_progress: Progress = silent) -> Identification:
    """Identify a vehicle from its tests. Raises DataFileError if nothing can be identified, and VehicleFileError."""
    with threadpool_limits(limits=1, user_api="blas"):  # the matrices are small: more threads would wait for each other
        return _identify(tests, on_progress)


def _identify(tests: Tests, on_progress: Progress) -> Identification:
    path = tests.given.description.tables.against
    against = load_vehicle(path) if path else None
    on_progress("reading the logs", 0.0)
    known, logs, rows = begin(tests)
    if not (known.fitted or known.curves):
        own = ", ".join(sorted(tests.given.description.known))
        raise DataFileError(f"{tests.folder.path}: nothing is identifiable: rov.toml gives all that it tests ({own})")
    fit = fit_all(tests.folder.path, known, logs, rows, on_progress)
    show = moving(on_progress, "predicting what was left out", 0.88, 0.95)
    show(0)
    predicted = []
    for prediction in assess.predictions(fit.objective, fit.best, against):
        predicted.append(prediction)
        show(len(predicted))
    runs = followed(fit.objective, fit.best.z)
    unexplained = disturbances(fit.objective, fit.best, fit.posterior, runs)
    slow = [one for one in unexplained if one.axis is None or one.axis in known.fitted]
    vehicle, coefficients = identified_vehicle(tests, fit)
    for curve in vehicle.layout.curves:
        if mistake := next(no_thrust(curve, vehicle.coefficients, f"thrust_{curve.name}*.csv"), None):
            raise DataFileError(f"{tests.folder.path}: {mistake}")
    wrong = slips(tests, known, fit.objective, fit.best.z)
    held_out = held_out_rows(fit)
    effects = tuple(effects_of(fit))
    of_file = with_own_inputs(vehicle, tests.given)
    axes = []
    for n, axis in enumerate(known.fitted):
        on_progress(f"what to measure next of {axis.name}", 0.95 + 0.05 * n / len(known.fitted))
        one = _axis(tests, fit, vehicle, coefficients, axis, predicted, slow, wrong, held_out, effects)
        if pushes := assess.pushes_of_thrusters(vehicle, of_file, axis):
            strongest = fit.command_range[1]
            one = replace(one, answers=assess.answers(fit.averaged, axis, vehicle, pushes, strongest))
        if against and against.layout.has(axis):
            one = replace(one, compared=assess.answers_of_file(against, axis))
        axes.append(one)
    names, by_name = tuple(vehicle.estimates), vehicle.layout.curves_by_name
    found = Identification(
        folder=replace(tests.folder, findings=[*tests.findings, *beyond_thrusters(vehicle, of_file)]),
        inputs=tests.inputs,
        vehicle=rounded(of_file),
        against=against,
        axes=tuple(axes),
        curves={curve.name: _those_of(coefficients, by_name[curve.name]) for curve in known.curves},
        forces=tuple(points_of(tests, held_out, vehicle, "thrust")),
        effects=effects,
        disturbances=tuple(slow),
        logging=tuple(loggers_of(fit)),
        sensors=tuple(sensors_of(fit)),
        correlation=(names, correlation(names, vehicle.estimates)),
        objective=fit.best.value,
        agreement=fit.difference,
        unknown_forces=tuple(unknown_forces(fit.objective, runs)),
        slips=wrong,
    )
    return told(found)


def _axis(
    tests: Tests,
    fit: Fit,
    vehicle: Vehicle,
    coefficients: Mapping[str, Coefficient],
    axis: Axis,
    predicted: Sequence[Prediction],
    slow: Sequence[Disturbance],
    wrong: Sequence[Slip],
    held_out: HeldOut,
    effects: Sequence[Effect],
) -> AxisResult:
    own = tuple(p for p in predicted if p.axis is axis)
    is_told = _is_thrust_told(tests, vehicle, axis)
    answers = assess.answers(fit.averaged, axis, vehicle, strongest=fit.command_range[1]) if is_told else ()
    unknown = [d for d in slow if d.axis is axis or d.kind == "gain" or (d.axis is None and axis in (SURGE, SWAY))]
    files = [one.log.file for one in fit.objective.logs if any(m.sensor.axis is axis for m in one.measured)]
    misfits = [f.file for f in tests.findings if f.kind in MISFITS and f.axis == axis.name and f.file in files]
    drivers = {thruster.curve for thruster in vehicle.layout.thrusters_along(axis)}
    acting = [effect for effect in effects if effect.of in {"", axis.name, *drivers}]
    steady, times = ([*points_of(tests, held_out, vehicle, kind, axis.name)] for kind in ("steady", "time_constant"))
    limits = tests.given.description.tables.limits
    return AxisResult(
        axis=axis,
        verdict=assess.verdict(
            own, answers, unknown, fit.difference, [s for s in wrong if s.file in files], steady, acting, misfits
        ),
        answers=answers,
        known=_those_of(coefficients, vehicle.layout.by_name[axis.name], "beta"),
        predictions=own,
        points=(*steady, *times),
        next_test=next_test(fit.objective, fit.averaged, axis, limits, answers) if is_told else None,
    )


def _is_thrust_told(tests: Tests, vehicle: Vehicle, axis: Axis) -> bool:
    """Return False if the thrust along an axis is the largest force of the logs, and none of them has any."""
    drivers = {thruster.name for thruster in vehicle.layout.thrusters_along(axis)}
    largest = (most for log in tests.folder.logs if log.commands for most in log.commands.largest.items())
    return not vehicle.layout.has_wrench or any(most for name, most in largest if name in drivers)


def _those_of(coefficients: Mapping[str, Coefficient], part: Part, *more: str) -> tuple[Coefficient, ...]:
    """Return the coefficients of a curve or an axis, of those that the fit changes. `more` are keys beside its own."""
    names = map(part.coefficient, (*part.keys, *more))
    return tuple(coefficients[name] for name in names if name in coefficients)
