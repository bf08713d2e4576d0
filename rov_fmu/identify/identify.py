"""From a folder of tank tests to a vehicle: thrust, then drag and β of every axis, with what the data do not tell.

An axis with recordings takes its coefficients from them (output error), and they have a say in the thrust curve too;
one without, from the measured points V_ss and Tau. The points, of tables and of recordings, are fitted in either case,
so the two can be set side by side.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

from rov_fmu import __version__
from rov_fmu.files.csv_table import DataFileError
from rov_fmu.identify import diagnostics
from rov_fmu.identify.identification import AxisResult, Identification, count
from rov_fmu.identify.least_squares import LEVEL, Estimate
from rov_fmu.identify.output_error import RecordingsFit, fit_recordings
from rov_fmu.identify.quadratic_fit import QuadraticFit, fit_quadratic
from rov_fmu.identify.response_fit import Point, fit_response, free_coefficients
from rov_fmu.identify.simulator import prepare
from rov_fmu.identify.step_responses import AGAINST, StepResponse, steps
from rov_fmu.identify.tank_tests import LEAST_VELOCITY, MOST_VELOCITY, THRUSTERS, Recording, Row, TankTests
from rov_fmu.motion.rov import AXES, COEFFICIENTS, Axis, Coefficients
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, load_vehicle


def identify(experiments: TankTests) -> Identification:
    """Identify a vehicle from its tests. Raises DataFileError, VehicleFileError."""
    rov = experiments.rov
    against = load_vehicle(rov.against) if rov.against else None
    thrust = {thruster: fit for thruster in THRUSTERS if (fit := _thrust(experiments, thruster))}
    values = dict.fromkeys(COEFFICIENTS, 1.0)  # to begin with
    values |= {name: value for fit in thrust.values() for name, value in fit.estimate.named.items()}
    values |= {name: known.value for name, known in rov.known.items()}
    sources = {name: known.source for name, known in rov.known.items()}
    intervals = {name: known.interval for name, known in rov.known.items() if known.interval}
    for fit in thrust.values():
        weighted = "(7)" if 0.0 in fit.weights else "(6)"
        forces = count(int((fit.weights > 0.0).sum()), "force")
        sources |= dict.fromkeys(fit.estimate.names, f"{weighted} over {forces}")
        intervals |= fit.estimate.intervals
    axes: list[AxisResult] = []
    for thruster in THRUSTERS:
        base = Coefficients(**values)
        by_axis = _recordings(experiments, thruster, base, thrust.get(thruster))
        for recorded in by_axis.values():  # the last word on the thrust curve too
            values |= {name: getattr(recorded.coefficients, name) for name in recorded.estimate.names}
            intervals |= recorded.estimate.intervals
            if f"a_t_{thruster}" in recorded.estimate.names:
                also = f"{sources[f'a_t_{thruster}'].split(',')[0]}, and the recordings"
                sources |= dict.fromkeys((f"a_t_{thruster}", f"b_t_{thruster}"), also)
        for axis in AXES.values():
            if axis.thruster != thruster:
                continue
            fitted = by_axis.get(axis.name)
            result = _axis(experiments, axis, Coefficients(**values), fitted, thrust.get(thruster))
            axes.append(result)
            if result.response and not fitted:
                values |= {n: getattr(result.response.coefficients, n) for n in result.response.estimate.names}
                values |= {n: getattr(result.response.coefficients, n) for n in result.response.held}
                intervals |= result.response.estimate.intervals
            sources |= dict.fromkeys(
                (n for kind in ("a_d", "b_d", "beta") if (n := axis.coefficient(kind)) not in rov.known),
                result.method[0].upper() + result.method[1:],
            )
            sources |= result.held
    axes.sort(key=lambda axis: list(AXES).index(axis.axis.name))
    warnings = [w for thruster, fit in thrust.items() for w in diagnostics.on_thrust(thruster, fit)]
    warnings += [w for axis in axes for w in axis.warnings]
    method = "; ".join(f"{axis.axis.name}: {axis.method}" for axis in axes)
    vehicle = Vehicle(
        name=rov.name,
        identifier=rov.identifier,
        version=rov.version,
        description=rov.description,
        source=rov.source,
        coefficients=Coefficients(**values),
        sources=sources,
        command_range=rov.command_range or _command_range(axes),
        alternatives={},
        data=None,
        limits=rov.limits,
        intervals=intervals,
        provenance=Provenance(f"rov-fmu {__version__} identify", method, experiments.inputs, tuple(warnings)),
    )
    return Identification(experiments, vehicle, thrust, tuple(axes), against)


def _thrust(experiments: TankTests, thruster: str) -> QuadraticFit | None:
    """The thrust curve of a thruster, None where it is given."""
    names = (f"a_t_{thruster}", f"b_t_{thruster}")
    rows = experiments.thrust.get(thruster, ())
    if names[0] in experiments.rov.known:
        if rows:
            raise DataFileError(
                f"{experiments.folder}: rov.toml gives {', '.join(names)}, but there is {rows[0].file} too"
            )
        return None
    if not rows:
        raise DataFileError(f"{experiments.folder}: no thrust_{thruster}*.csv, and rov.toml does not give {names[0]}")
    weights = np.array([_weight(experiments, f"thrust_{thruster}", row.command) for row in rows])
    if len({abs(row.command) for row, weight in zip(rows, weights, strict=True) if weight and row.command}) < 2:
        raise DataFileError(f"{experiments.folder}: thrust_{thruster}*.csv: two commands at least must count")
    return fit_quadratic(names, np.array([r.command for r in rows]), np.array([r.value for r in rows]), weights)


def _recordings(
    experiments: TankTests, thruster: str, base: Coefficients, thrust: QuadraticFit | None
) -> dict[str, RecordingsFit]:
    """The fits of the axes that a thruster drives, by axis, where they were recorded."""
    recordings: list[Recording] = []
    for m in AXES.values():
        wanted = {m.coefficient(kind) for kind in ("a_d", "b_d", "beta")} - set(experiments.rov.known)
        if m.thruster == thruster and wanted:
            recordings += experiments.recordings.get(m.name, ())
    for recording in recordings:
        values = recording.values[np.isfinite(recording.values)]
        still = "command" if not recording.command.any() else recording.quantity if np.ptp(values) == 0.0 else None
        if still:
            raise DataFileError(f"{experiments.folder / recording.file}: {still} never changes: nothing can be learnt")
        _check_thrust(experiments, recording.axis, base, [1.0])
        speed = prepare(recording, base).speed
        if not LEAST_VELOCITY <= speed <= MOST_VELOCITY:
            raise DataFileError(
                f"{experiments.folder / recording.file}: {recording.quantity} tells of a velocity of {speed:.3g} "
                f"{recording.axis.unit}: must be {LEAST_VELOCITY:g} at least and {MOST_VELOCITY:g} at most"
            )
        found = steps(recording)
        if found and all(step.note == AGAINST for step in found):
            raise DataFileError(
                f"{experiments.folder / recording.file}: moves against the command; forward, down, to starboard is +"
            )
    if not recordings:
        return {}
    fits = fit_recordings(recordings, base, experiments.rov.known, _uncertain(thrust))
    return {fit.axis.name: fit for fit in fits}


def _check_thrust(experiments: TankTests, m: Axis, base: Coefficients, commands: Sequence[float]) -> None:
    """Where the vehicle moves, the thruster must push it there, at one command at least."""
    forces = [m.force(base, command) for command in commands]
    if commands and all(force * command <= 0.0 for force, command in zip(forces, commands, strict=True)):
        raise DataFileError(
            f"{experiments.folder}: the thrust curve of {m.thruster} gives {forces[0]:.3g} {m.load} at a command of "
            f"{commands[0]:.0%}, where {m.name} needs a push that way"
        )


def _uncertain(thrust: QuadraticFit | None) -> Estimate | None:
    """The thrust curve as something measured; None where there is no telling how well, or it is exact.

    Few forces tell their own scatter badly, which Student's distribution counts; from here on the normal one is used.
    """
    if thrust is None or not np.isfinite(thrust.estimate.covariance).all():
        return None
    exact = np.sqrt(np.diag(thrust.estimate.covariance)).max() < 1e-6 * np.abs(thrust.estimate.values).max()
    few = float(student.ppf(0.5 + 0.5 * LEVEL, thrust.estimate.freedom) / normal.ppf(0.5 + 0.5 * LEVEL))
    return None if exact else replace(thrust.estimate, covariance=few**2 * thrust.estimate.covariance)


def _axis(
    experiments: TankTests,
    m: Axis,
    base: Coefficients,
    fitted: RecordingsFit | None,
    thrust: QuadraticFit | None,
) -> AxisResult:
    known = experiments.rov.known
    found = tuple(step for recording in experiments.recordings.get(m.name, ()) for step in steps(recording))
    points = _points(experiments, m, found)
    wanted = {m.coefficient(kind) for kind in ("a_d", "b_d", "beta")} - set(known)
    uncertain = _uncertain(thrust)
    of_thrust = uncertain.covariance if uncertain else None
    if fitted and uncertain:
        of_thrust = fitted.estimate.of(m.thrust_names).covariance
    used = [p for p in points if p.weight > 0.0]
    _check_thrust(experiments, m, base, [p.command for p in used])
    steady = [p for p in used if p.quantity == "V_ss"]
    told = free_coefficients(m, used, known)[0] if steady or wanted <= {m.coefficient("beta")} else ()
    response = fit_response(m, points, base, known, of_thrust) if told else None
    if not fitted and not response and (missing := sorted(wanted - {m.coefficient("beta")})):
        raise DataFileError(
            f"{experiments.folder}: no steady_{m.name}*.csv or log_{m.name}*.csv that counts, and rov.toml does not "
            f"give {', '.join(missing)}"
        )
    drag = None
    if steady:
        x, y = np.array([p.value for p in steady]), np.array([m.force(base, p.command) for p in steady])
        alpha = getattr(base, m.coefficient("alpha"))
        groups = np.array([abs(p.command) for p in steady])
        drag = fit_quadratic((m.coefficient("a_d"), m.coefficient("b_d")), x, alpha * y, groups=groups)
    held = dict(response.held) if response and not fitted else {}
    if m.coefficient("alpha") not in known:
        held[m.coefficient("alpha")] = "The data tell drag against thrust only, so thrust is taken as it is"
    if not fitted and not response and m.coefficient("beta") not in known:
        held[m.coefficient("beta")] = "No test tells it; taken as 1"
    result = AxisResult(m, points, found, drag, response, fitted, held, ())
    return replace(result, warnings=tuple(diagnostics.on_axis(result, base, thrust)))


def _points(experiments: TankTests, m: Axis, found: tuple[StepResponse, ...]) -> tuple[Point, ...]:
    """Rows of the tables, then what the recordings tell."""

    def weight(command: float) -> float:
        return _weight(experiments, m.name, command)

    def point(quantity: str, row: Row) -> Point:
        return Point(quantity, row.command, row.value, weight(row.command), f"{row.file}, line {row.line}")

    points = [point("V_ss", row) for row in experiments.steady.get(m.name, ())]
    points += [point("Tau", row) for row in experiments.time_constants.get(m.name, ())]
    for step in found:
        source = f"{step.file}, {step.start:.1f} s"
        if step.V_ss is not None:
            points.append(Point("V_ss", step.command, step.V_ss, weight(step.command), source, step.V_ss_error))
        if step.Tau is not None:
            points.append(Point("Tau", step.command, step.Tau, weight(step.command), source, step.Tau_error))
    return tuple(points)


def _weight(experiments: TankTests, window: str, command: float) -> float:
    low, high = experiments.rov.windows.get(window, (-1.0, 1.0))
    return float(low - 1e-9 <= command <= high + 1e-9)


def _command_range(axes: list[AxisResult]) -> tuple[float, float]:
    """From the weakest to the strongest command that counts."""
    commands = {round(abs(p.command), 6) for axis in axes for p in axis.points if p.weight > 0.0}
    for axis in axes:
        for simulation in axis.recordings.simulations if axis.recordings else ():
            commands |= set(np.round(np.abs(simulation.recording.command), 6).tolist()) - {0.0}
    low, high = min(commands, default=0.0), max(commands, default=1.0)
    return (low, high) if low < high else (max(low - 0.05, 0.0), min(high + 0.05, 1.0))
