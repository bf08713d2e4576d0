"""From a folder of tank tests to a vehicle: thrust, then drag and β of every axis, and what is not identifiable.

An axis with recordings takes its coefficients from them (output error), and they have a say in the thrust curve too;
one without, from the measured points V_ss and Tau. The points, of tables and of recordings, are fitted in either case,
so the two can be set side by side.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rov_fmu import __version__
from rov_fmu.files.csv_table import DataFileError
from rov_fmu.identify import diagnostics
from rov_fmu.identify.identification import AxisResult, Identification, count
from rov_fmu.identify.least_squares import Estimate, quantile
from rov_fmu.identify.output_error import RecordingsFit, fit_recordings
from rov_fmu.identify.quadratic_fit import QuadraticFit, fit_quadratic
from rov_fmu.identify.response_fit import Point, drag_and_beta, fit_response, free_coefficients
from rov_fmu.identify.simulator import prepare
from rov_fmu.identify.step_responses import AGAINST, StepResponse, steps
from rov_fmu.identify.tank_tests import AXES, THRUSTERS, VELOCITIES, Recording, TankTests, thrust_names, thruster_of
from rov_fmu.motion.layout import Axis
from rov_fmu.motion.rov import Rov
from rov_fmu.vehicle.paper import PAPER
from rov_fmu.vehicle.sense import no_thrust
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, load_vehicle

_LEAST_PUSH = 1e-6
"""N or N m, less than moves any vehicle: what is fitted to it would overflow."""


def identify(tests: TankTests) -> Identification:
    """Identify a vehicle from its tests. Raises DataFileError, VehicleFileError."""
    given, known = tests.given, tests.given.known
    against = load_vehicle(given.against) if given.against else None
    thrust = {thruster: fit for thruster in THRUSTERS if (fit := _thrust(tests, thruster))}
    values = dict.fromkeys(PAPER.coefficients, 1.0) | {name: q.value for name, q in known.items()}  # to begin with
    sources = {name: q.source for name, q in known.items()}
    intervals = {name: q.interval for name, q in known.items() if q.interval}
    for fit in thrust.values():
        weighted = "(7)" if 0.0 in fit.weights else "(6)"
        forces = count(int(fit.counts.sum()), "force")
        values |= fit.estimate.named
        sources |= dict.fromkeys(fit.estimate.names, f"{weighted} over {forces}")
        intervals |= fit.estimate.intervals
    results: list[AxisResult] = []
    for thruster in THRUSTERS:
        by_axis = _fit_recordings(tests, thruster, Rov(PAPER, {**values}), thrust.get(thruster))
        for recorded in by_axis.values():  # the last word on the thrust curve too
            values |= recorded.estimate.named
            intervals |= recorded.estimate.intervals
            if f"a_t_{thruster}" in recorded.estimate.names:
                also = f"{sources[f'a_t_{thruster}'].split(',')[0]}, and the recordings"
                sources |= dict.fromkeys(thrust_names(recorded.axis), also)
        for axis in (axis for axis in AXES.values() if thruster_of(axis) == thruster):
            result = _axis(tests, axis, Rov(PAPER, {**values}), by_axis.get(axis.name), thrust.get(thruster))
            results.append(result)
            if result.response and result.chosen == "points":
                fitted = result.response
                values |= {n: fitted.rov[n] for n in (*fitted.estimate.names, *fitted.assumed)}
                intervals |= fitted.estimate.intervals
            sources |= dict.fromkeys(drag_and_beta(axis, known), result.method[0].upper() + result.method[1:])
            sources |= result.assumed
    for curve in PAPER.curves:
        place = "rov.toml" if f"a_t_{curve.name}" in known else f"thrust_{curve.name}*.csv"
        if backward := [*no_thrust(curve, values, place)]:
            raise DataFileError(f"{tests.folder}: {backward[0]}")
    results.sort(key=lambda result: list(AXES).index(result.axis.name))
    warnings = [f"{t} thrust: {words}" for t, fit in thrust.items() for words in diagnostics.on_thrust(t, fit)]
    warnings += [w for result in results for w in result.warnings]
    method = "; ".join(f"{result.axis.name}: {result.method}" for result in results)
    vehicle = Vehicle(
        **dict(given.head),
        rov=Rov(PAPER, {**values}),
        sources=sources,
        command_range=given.command_range or _command_range(results),
        alternatives={},
        data=None,
        limits=given.limits,
        intervals=intervals,
        provenance=Provenance(f"rov-fmu {__version__} identify", method, tests.inputs, tuple(warnings)),
    )
    return Identification(tests, vehicle, thrust, tuple(results), against)


def _thrust(tests: TankTests, thruster: str) -> QuadraticFit | None:
    """The thrust curve of a thruster, None where it is given."""
    names = (f"a_t_{thruster}", f"b_t_{thruster}")
    rows = tests.thrust.get(thruster, ())
    if names[0] in tests.given.known:
        if rows:
            raise DataFileError(f"{tests.folder}: rov.toml gives {', '.join(names)}, but there is {rows[0].file} too")
        return None
    if not rows:
        raise DataFileError(f"{tests.folder}: no thrust_{thruster}*.csv, and rov.toml does not give {names[0]}")
    weights = np.array([_weight(tests, f"thrust_{thruster}", row.command) for row in rows])
    if len({abs(row.command) for row, weight in zip(rows, weights, strict=True) if weight and row.command}) < 2:
        raise DataFileError(f"{tests.folder}: thrust_{thruster}*.csv: two commands at least must count")
    return fit_quadratic(names, np.array([r.command for r in rows]), np.array([r.value for r in rows]), weights)


def _fit_recordings(
    tests: TankTests, thruster: str, base: Rov, thrust: QuadraticFit | None
) -> dict[str, RecordingsFit]:
    """The fits of the axes that a thruster drives, by axis, where they were recorded."""
    recordings: list[Recording] = []
    for axis in AXES.values():
        if thruster_of(axis) == thruster and drag_and_beta(axis, tests.given.known):
            recordings += tests.recordings.get(axis.name, ())
    for recording in recordings:
        path, values = tests.folder / recording.file, recording.values[np.isfinite(recording.values)]
        still = "command" if not recording.command.any() else recording.quantity if np.ptp(values) == 0.0 else None
        if still:
            raise DataFileError(f"{path}: {still} never changes: nothing is identifiable")
        _check_thrust(tests, recording.axis, base, [1.0])
        speed = prepare(recording, base).speed
        if not VELOCITIES[0] <= speed <= VELOCITIES[1]:
            raise DataFileError(
                f"{path}: {recording.quantity} tells of a velocity of {speed:.3g} "
                f"{recording.axis.unit}: must be {VELOCITIES[0]:g} at least and {VELOCITIES[1]:g} at most"
            )
        found = steps(recording)
        if found and all(step.note == AGAINST for step in found):
            raise DataFileError(f"{path}: moves against the command; forward, down, to starboard is +")
    if not recordings:
        return {}
    fits = fit_recordings(recordings, base, tests.given.known, _thrust_uncertainty(thrust))
    return {fit.axis.name: fit for fit in fits}


def _check_thrust(tests: TankTests, axis: Axis, base: Rov, commands: Sequence[float]) -> None:
    """Where the vehicle moves, the thruster must push it there, at one command at least."""
    forces = [base.force(axis, command) for command in commands]
    if commands and all(np.sign(c) * force < _LEAST_PUSH for force, c in zip(forces, commands, strict=True)):
        raise DataFileError(
            f"{tests.folder}: the thrust curve of {thruster_of(axis)} gives {forces[0]:.3g} {axis.load} at a command "
            f"of {commands[0]:.0%}, where {axis.name} needs a push that way"
        )


def _thrust_uncertainty(thrust: QuadraticFit | None) -> Estimate | None:
    """The thrust curve as something measured; None where there is no telling how well, or it is exact.

    Few forces tell their own scatter badly, which Student's distribution counts; from here on the normal one is used.
    """
    if thrust is None or not np.isfinite(thrust.estimate.covariance).all():
        return None
    exact = np.sqrt(np.diag(thrust.estimate.covariance)).max() < 1e-6 * np.abs(thrust.estimate.values).max()
    few = quantile(thrust.estimate.degrees_of_freedom) / quantile(np.inf)
    return None if exact else replace(thrust.estimate, covariance=few**2 * thrust.estimate.covariance)


def _axis(
    tests: TankTests, axis: Axis, base: Rov, fitted: RecordingsFit | None, thrust: QuadraticFit | None
) -> AxisResult:
    known = tests.given.known
    found = tuple(step for recording in tests.recordings.get(axis.name, ()) for step in steps(recording))
    points = _points(tests, axis, found)
    wanted = set(drag_and_beta(axis, known))
    uncertain = _thrust_uncertainty(thrust)
    of_thrust = uncertain.covariance if uncertain else None
    if fitted and uncertain:
        of_thrust = fitted.estimate.part(thrust_names(axis)).covariance
    used = [p for p in points if p.weight > 0.0]
    _check_thrust(tests, axis, base, [p.command for p in used])
    steady = [p for p in used if p.quantity == "V_ss"]
    enough = bool(steady) or wanted <= {axis.coefficient("beta")}
    identifiable = enough and free_coefficients(axis, used, known)[0]
    response = fit_response(axis, points, base, known, of_thrust) if identifiable else None
    if not fitted and not response and (missing := sorted(wanted - {axis.coefficient("beta")})):
        raise DataFileError(
            f"{tests.folder}: no steady_{axis.name}*.csv or log_{axis.name}*.csv that counts, and rov.toml does not "
            f"give {', '.join(missing)}"
        )
    drag = None
    if steady:
        x, y = np.array([p.value for p in steady]), np.array([base.force(axis, p.command) for p in steady])
        force = base[axis.coefficient("alpha")] * y
        groups = np.array([abs(p.command) for p in steady])
        drag = fit_quadratic((axis.coefficient("a_d"), axis.coefficient("b_d")), x, force, groups=groups)
    assumed = dict(response.assumed) if response and not fitted else {}
    if (alpha := axis.coefficient("alpha")) not in known:
        assumed[alpha] = "Not identifiable: the tests give the ratio of drag to thrust only; assumed 1"
    if not fitted and not response and (beta := axis.coefficient("beta")) not in known:
        assumed[beta] = "Not identifiable from these tests; assumed 1"
    result = AxisResult(axis, points, found, drag, response, fitted, assumed, ())
    return replace(result, warnings=tuple(f"{axis.name}: {w}" for w in diagnostics.on_axis(result, base, thrust)))


def _points(tests: TankTests, axis: Axis, found: tuple[StepResponse, ...]) -> tuple[Point, ...]:
    """Rows of the tables, then the responses of the recordings."""
    points = [
        Point(quantity, row.command, row.value, _weight(tests, axis.name, row.command), f"{row.file}, line {row.line}")
        for quantity, rows in (("V_ss", tests.steady), ("Tau", tests.time_constants))
        for row in rows.get(axis.name, ())
    ]
    for step in found:
        weight, source = _weight(tests, axis.name, step.command), f"{step.file}, {step.start:.1f} s"
        for quantity, value, error in (("V_ss", step.V_ss, step.V_ss_error), ("Tau", step.Tau, step.Tau_error)):
            if value is not None:
                points.append(Point(quantity, step.command, value, weight, source, error))
    return tuple(points)


def _weight(tests: TankTests, window: str, command: float) -> float:
    low, high = tests.given.windows.get(window, (-1.0, 1.0))
    return float(low - 1e-9 <= command <= high + 1e-9)


def _command_range(results: list[AxisResult]) -> tuple[float, float]:
    """From the weakest to the strongest command that counts."""
    used = [abs(p.command) for result in results for p in result.points if p.weight > 0.0]
    recorded = [s.recording.command for result in results if result.recordings for s in result.recordings.simulations]
    commands = set(np.round(np.abs(np.concatenate([used, *recorded])), 6).tolist())
    commands -= {0.0}
    low, high = min(commands, default=0.0), max(commands, default=1.0)
    return (low, high) if low < high else (max(low - 0.05, 0.0), min(high + 0.05, 1.0))
