"""Identify a vehicle from a folder of tank tests: thrust curves, then drag and β of every axis.

An axis with recordings takes its coefficients from them (output error) and from the points of its tables. The
recordings also correct the thrust curves. An axis without recordings takes its coefficients from the measured points
V_ss and Tau. The points of tables are fitted in either case, for comparison.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rov_fmu import __version__
from rov_fmu.identify import diagnostics
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import TankTests, kind_of_data
from rov_fmu.identify.driving import connected, curves_of
from rov_fmu.identify.findings import FIRST, facts, sentences, warnings
from rov_fmu.identify.identification import AxisResult, Identification
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.next_test import NOISE, NextTest, Sensor, next_test
from rov_fmu.identify.points.drag_forms import Point, drag_and_beta, free_coefficients
from rov_fmu.identify.points.quadratic_fit import fit_quadratic
from rov_fmu.identify.points.response_fit import ResponseFit, fit_response
from rov_fmu.identify.points.step_responses import StepResponse, steps
from rov_fmu.identify.points.tables import TableForces, TablePoints
from rov_fmu.identify.points.thrust_fit import ThrustFit, fit_thrust, measured
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit, count
from rov_fmu.identify.simulation.limits import MotionError, NoFitError
from rov_fmu.identify.slips.search import beta_out_of_range, weak_thrust
from rov_fmu.identify.together import Together
from rov_fmu.identify.usable import UnusableError, check_push, check_recording, check_slips, is_pushed
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import Progress, part, silent
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import REVERSE, Axis, Curve
from rov_fmu.model.rov import Rov
from rov_fmu.tank.findings import Finding
from rov_fmu.vehicle.checks import no_thrust
from rov_fmu.vehicle.schema import NOT_GIVEN, Estimated
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, load_vehicle

_CHECKED, _FITTED = 0.1, 0.9
"""The share of the work that is done when units and signs are checked, and when the recordings are fitted."""
_SATURATED = 0.2
"""If a recording cannot be fitted and its thrusters were at full command for more than this share of the time,
saturation is the likely cause."""
_MEAN_VOLTAGE = "Mean voltage of the recordings"
_ASSUMED_ALPHA = "Not identifiable, because tests of motion give only the ratio of drag to thrust. Assumed to be 1"
_ASSUMED_BETA = "Not identifiable from these tests; assumed 1"


def identify(tests: TankTests, on_progress: Progress = silent) -> Identification:
    """Identify a vehicle from its tests.

    Unusable tests are left out, with a finding. Raises DataFileError if no usable test remains or if the unit or sign
    of a file is certainly wrong, and VehicleFileError.
    """
    while True:
        try:
            return _identify(tests, on_progress)
        except UnusableError as unusable:
            tests = unusable.left_out_of(tests)


def _identify(tests: TankTests, on_progress: Progress) -> Identification:
    """Identify a vehicle from all tests. Raises UnusableError, DataFileError, VehicleFileError."""
    given = tests.given
    named = given.description.tables.against
    against = load_vehicle(named) if named else None
    on_progress("thrust curves", 0.0)
    thrust = {curve.name: fit for curve in given.rov.layout.curves if (fit := _thrust(tests, curve))}
    found = _Found(tests)
    for fit in thrust.values():
        found.take_thrust(fit)
    results: list[AxisResult] = []
    doubts: list[Finding] = []
    groups = [*connected(given.rov.layout, tilts=given.requests.attitude)]
    for n, (_, axes) in enumerate(groups):
        on_progress(f"units and signs of {_named(axes)}", _CHECKED * n / len(groups))
        doubts += check_slips(tests, axes, found.rov)
        for recording in _recordings(tests, axes):
            check_push(tests.folder, recording.axis, found.rov, [1.0])
            check_recording(tests.folder, recording, found.rov)
    samples = [sum(len(recording.time) for recording in _recordings(tests, axes)) for _, axes in groups]
    shares = [_CHECKED + (_FITTED - _CHECKED) * sum(samples[:n]) / max(sum(samples), 1) for n in range(len(groups) + 1)]
    for n, (curves, axes) in enumerate(groups):
        of_group = part(on_progress, shares[n], shares[n + 1])
        of_group(f"recordings of {_named(axes)}", 0.0)
        tested = {curve.name: thrust[curve.name] for curve in curves if curve.name in thrust}
        recorded, apart = _fit_recordings(tests, _recordings(tests, axes), found.rov, tested, of_group)
        doubts += apart
        for fit_of_axis in recorded.values():  # these replace the tested thrust curves
            found.take_recordings(fit_of_axis)
        for axis in axes:
            result = _axis(tests, axis, found.rov, recorded.get(axis.name), tested)
            results.append(result)
            found.take(result)
    for curve in found.rov.layout.curves:
        place = "rov.toml" if f"a_t_{curve.name}" in given.known else f"thrust_{curve.name}*.csv"
        if backward := [*no_thrust(curve, found.rov.coefficients, place)]:
            raise DataFileError(f"{tests.folder}: {backward[0]}")
    results.sort(key=lambda result: [*given.rov.layout.kinds].index(result.axis.name))
    fitted = [result.axis for result in results if result.estimate]
    weak = weak_thrust(found.rov, thrust, fitted)
    explained = {finding.axis for finding in weak}
    uncoupled = diagnostics.on_coupling(tests.recordings, found.rov.layout)
    findings = [*weak, *uncoupled, *tests.findings]
    findings += (f for f in doubts if f.kind != "wrong scale" or f.axis not in explained)
    for name, fit in thrust.items():
        findings += diagnostics.on_thrust(name, fit, found.rov)
    for result in results:
        findings += result.findings
    findings += diagnostics.on_turning(results, found.rov)
    findings += diagnostics.on_voltage(found.rov, given.requests)
    unexplained = [axis for axis in fitted if axis.name not in explained]
    findings += filter(None, (beta_out_of_range(found.rov, axis, found.intervals) for axis in unexplained))
    drifting = {finding.axis for finding in findings if finding.names.get("cause") == "drift"}
    for n, result in enumerate(results):
        on_progress(f"what to measure next of {result.axis.name}", _FITTED + (1.0 - _FITTED) * n / len(results))
        test = _next_test(tests, result, found.rov, thrust, repeat=result.axis.name in drifting)
        results[n] = replace(result, next_test=test)
    findings.sort(key=lambda finding: finding.kind not in FIRST)
    vehicle = found.vehicle(results, Together(thrust.values(), results), findings)
    return Identification(tests, vehicle, thrust, tuple(results), against, tuple(findings))


@dataclass
class _Found:
    """The vehicle as far as it is known, with the source of each number."""

    tests: TankTests
    tested: dict[str, str] = field(default_factory=dict)
    """The sources of coefficients that come from thrust tests."""
    rov: Rov = field(init=False)
    sources: dict[str, str] = field(init=False)
    intervals: dict[str, tuple[float, float]] = field(init=False)

    def __post_init__(self) -> None:
        given = self.tests.given
        self.rov = given.rov
        known = {name: q.source for name, q in given.known.items()}
        self.sources = dict.fromkeys(given.rov.layout.coefficients, NOT_GIVEN) | known
        self.intervals = {name: q.interval for name, q in given.known.items() if q.interval}

    def take_thrust(self, fit: ThrustFit) -> None:
        """Take the thrust curve from tests."""
        self.rov = self.rov.extended(fit.values)
        weighted = "(7)" if 0.0 in fit.weights else "(6)"
        forces = count(int(fit.counts.sum()), "force")
        source = f"{weighted} over {forces}"
        self._take(fit.estimate, source)
        self.tested |= dict.fromkeys(fit.estimate.names, source)

    def take_recordings(self, fit: RecordingsFit) -> None:
        """Take the coefficients from recordings, which also correct tested thrust curves."""
        values = {name: fit.rov[name] for name in fit.estimate.names}
        curves = [c for c in fit.rov.layout.curves if c.coefficient("n_V") in values]
        if curves:  # with the exponent, the vehicle also gets a battery and V_0
            self.rov = Rov(replace(self.rov.layout, voltage=fit.rov.layout.voltage), self.rov.coefficients)
        for curve in curves:
            V_0 = curve.coefficient("V_0")
            values[V_0] = fit.rov[V_0]
            is_given = curve.name in self.tests.given.requests.measured_at
            self.sources[V_0] = "Given in rov.toml" if is_given else _MEAN_VOLTAGE
        self.rov = self.rov.extended(values)
        for name in fit.estimate.names:
            tested = self.tested.get(name)
            self.sources[name] = f"{tested}, and the recordings" if tested else _capitalized(fit.method)
            self.intervals.pop(name, None)  # the interval from the forces only is no longer valid
        self.intervals |= fit.estimate.intervals

    def take(self, result: AxisResult) -> None:
        """Take the chosen fit of an axis."""
        if result.response and result.chosen == "points":
            fitted = result.response
            self.rov = self.rov.extended({n: fitted.rov[n] for n in (*fitted.estimate.names, *fitted.assumed)})
            self._take(fitted.estimate, _capitalized(result.method))
        self.sources |= result.assumed

    def _take(self, estimate: Estimate, source: str) -> None:
        self.sources |= dict.fromkeys(estimate.names, source)
        self.intervals |= estimate.intervals

    def _estimates(self, together: Together) -> dict[str, Estimated]:
        """Return the standard errors and correlations of the identified coefficients, and those kept from the base."""
        given = self.tests.given
        path = given.description.tables.base
        base = load_vehicle(path) if path else None
        rows = base.estimates if base else {}
        kept = {
            name
            for name in rows
            if base and (q := given.known.get(name)) and (q.value, q.interval) == (base.rov[name], base.intervals[name])
        }
        found: dict[str, Estimated] = {}
        for name in self.rov.layout.coefficients:
            if name in kept:
                others = {other: value for other, value in rows[name].correlation.items() if other in kept}
                found[name] = Estimated(error=rows[name].error, correlation=others)
            elif name in together.names and name in self.intervals:
                found[name] = Estimated(error=together.error(name), correlation=together.correlation(name, found))
        return found

    def vehicle(self, results: Sequence[AxisResult], together: Together, findings: Sequence[Finding]) -> Vehicle:
        """Return the vehicle with its provenance."""
        given, names = self.tests.given, self.rov.layout.coefficients
        validity = given.description.tables.validity
        method = "; ".join(f"{result.axis.name}: {result.method}" for result in results)
        made = Provenance(
            f"rov-fmu {__version__} identify",
            method,
            self.tests.inputs,
            warnings=warnings(findings),
            facts=facts(findings),
            data=kind_of_data(self.tests),
        )
        fits = [result.recordings for result in results if result.recordings]
        delays = sentences(finding for fit in fits for finding in diagnostics.on_delay(fit))
        return Vehicle(
            **dict(given.head),
            rov=Rov(self.rov.layout, {name: self.rov[name] for name in names}),
            sources={name: self.sources[name] for name in names},
            command_range=validity.command_range if validity else _command_range(results, self.rov),
            alternatives={},
            data=None,
            limits=(*given.description.limits, *delays),
            intervals={name: self.intervals[name] for name in names if name in self.intervals},
            estimates=self._estimates(together),
            provenance=made,
            voltage_source="" if self.rov.layout.voltage is None else _MEAN_VOLTAGE,
            thruster_sources=given.thruster_sources,
        )


def _named(axes: Iterable[Axis]) -> str:
    return join_names(axis.name for axis in axes)


def _capitalized(words: str) -> str:
    return words[0].upper() + words[1:]


# ---- Thrust and recordings -------------------------------------------------------------------------------------------


def _thrust(tests: TankTests, curve: Curve) -> ThrustFit | None:
    """Fit a thrust curve; return None where there are no tests of it."""
    rows, window = tests.thrust.get(curve.name, ()), f"thrust_{curve.name}"
    if not rows:
        return None
    weights = np.array([_weight(tests, window, row.command) for row in rows])
    if len({abs(row.command) for row, weight in zip(rows, weights, strict=True) if weight and row.command}) < 2:
        raise DataFileError(f"{tests.folder}: {window}*.csv: at least two commands must count")
    commands, forces = (np.array([getattr(row, key) for row in rows]) for key in ("command", "value"))
    return fit_thrust(curve, commands, forces, weights, {name: q.value for name, q in tests.given.known.items()})


def _recordings(tests: TankTests, axes: Iterable[Axis]) -> list[Recording]:
    """Return the recordings of the axes of which drag or β is unknown."""
    wanted = (axis for axis in axes if drag_and_beta(axis, tests.given.known))
    return [recording for axis in wanted for recording in tests.recordings.get(axis.name, ())]


def _fit_recordings(
    tests: TankTests, recordings: Sequence[Recording], base: Rov, thrust: Mapping[str, ThrustFit], on_progress: Progress
) -> tuple[dict[str, RecordingsFit], list[Finding]]:
    """Fit recordings of axes that share thrust curves; return the fits by axis, and findings if the axes had to be
    fitted separately.

    Where no vehicle fits all recordings, each axis is fitted alone. Raises UnusableError with the recordings that
    cannot be fitted alone either.
    """
    if not recordings:
        return {}, []

    def fit(some: Sequence[Recording]) -> dict[str, RecordingsFit]:
        requests, known = tests.given.requests, tests.given.known
        tested = [table for each in thrust.values() if (table := TableForces.of(each))]
        points = _table_points(tests, dict.fromkeys(recording.axis for recording in some), base)
        fits = fit_recordings(some, base, known, tested, requests=requests, points=points, on_progress=on_progress)
        return {found.axis.name: found.widened() for found in fits}

    try:
        return fit(recordings), []
    except (NoFitError, MotionError) as error:
        together = error
    axes = list(dict.fromkeys(recording.axis for recording in recordings))
    apart: dict[str, RecordingsFit] = {}
    for n, axis in enumerate(axes):
        own = [recording for recording in recordings if recording.axis is axis]
        on_progress(f"recordings of {axis.name} alone", n / len(axes))
        if len(axes) == 1:
            raise _unusable(tests, own, base, together, fit)
        try:
            apart |= fit(own)
        except (NoFitError, MotionError) as error:
            raise _unusable(tests, own, base, error, fit) from None
    return apart, [Finding("fitted apart", axis.name, names={"reason": str(together)}) for axis in axes]


def _table_points(tests: TankTests, axes: Iterable[Axis], base: Rov) -> list[TablePoints]:
    """Return the points of tables that take part in the fit to the recordings of these axes.

    Tau has no closed form where the thrusters lag, so it takes no part there.
    """
    found, lag = [], tests.given.requests.lag
    for axis in axes:
        lags = any(curve.has_lag or curve.name in lag for curve in curves_of(base.layout, axis))
        tables = (p for p in _points(tests, axis, ()) if not lags or p.quantity == "V_ss")
        points = [p for p in tables if is_pushed(axis, base, p.command)]
        response = _response(axis, points, base, tests.given.known, None)
        if response and (of_tables := TablePoints.of(response)):
            found.append(of_tables)
    return found


def _unusable(
    tests: TankTests,
    recordings: Sequence[Recording],
    base: Rov,
    error: NoFitError | MotionError,
    fit: Callable[[Sequence[Recording]], object],
) -> UnusableError:
    """Return an error with the recordings of an axis that cannot be fitted even alone (or with all of them, if each
    can), and with the likely cause.

    Recordings with another reason than the first one are found when the rest is fitted again.
    """
    alone: dict[str, list[Recording]] = {}
    for recording in recordings if len(recordings) > 1 else ():
        try:
            fit([recording])
        except (NoFitError, MotionError) as its_error:
            alone.setdefault(_reason(its_error), []).append(recording)
    reason, wrong = next(iter(alone.items()), (_reason(error), list(recordings)))
    files, axis = join_names(dict.fromkeys(recording.file for recording in wrong)), wrong[0].axis
    names = {"reason": reason.partition(". ")[0], "cause": _likely_cause(wrong, base)}
    return UnusableError(f"{tests.folder}: {files}: {reason}", Finding("no fit", axis.name, names=names), axis, wrong)


def _reason(error: NoFitError | MotionError) -> str:
    """Return why there is no fit, and what to check."""
    return error.reason if isinstance(error, NoFitError) else f"{error}. Check the units and signs"


def _likely_cause(recordings: Sequence[Recording], base: Rov) -> str:
    """Return the most likely reason why a fit fails."""
    full = max(float(np.mean(np.abs(r.reaching(base.layout)).max(axis=1) >= 0.999)) for r in recordings)
    if full > _SATURATED:
        return (
            f"The thrusters are at full command for {full:.0%} of the time. There, the electric current may limit them"
        )
    return (
        "Check the units and signs, the order, directions and dead band of the thrusters, and whether "
        "the tether was taut"
    )


# ---- One axis --------------------------------------------------------------------------------------------------------


def _axis(
    tests: TankTests, axis: Axis, base: Rov, fitted: RecordingsFit | None, thrust: Mapping[str, ThrustFit]
) -> AxisResult:
    known = tests.given.known
    found = tuple(step for recording in tests.recordings.get(axis.name, ()) for step in steps(recording))
    points = _points(tests, axis, [_in_time(step, fitted) for step in found])
    driving = {curve.name: thrust[curve.name] for curve in curves_of(base.layout, axis) if curve.name in thrust}
    check_push(tests.folder, axis, base, [p.command for p in points if p.weight > 0.0])
    points = tuple(p if is_pushed(axis, base, p.command) else replace(p, weight=0.0) for p in points)
    used = [p for p in points if p.weight > 0.0]
    if fitted:  # the fit uses every sample, so points that were read off the recordings add no information
        points = tuple(replace(p, weight=0.0) if p.is_read_off else p for p in points)
    response = _response(axis, points, base, known, _thrust_of(fitted, driving))
    wanted = set(drag_and_beta(axis, known))
    if not fitted and not response and (missing := sorted(wanted - {axis.coefficient("beta")})):
        names = {"drag": ", ".join(missing)}
        raise UnusableError(
            f"{tests.folder}: no steady_{axis.name}*.csv or log_{axis.name}*.csv that counts, and rov.toml does not "
            f"give {names['drag']}",
            Finding("no tests of drag", axis.name, names=names),
            axis,
        )
    drag = None
    if steady := [p for p in used if p.quantity == "V_ss"]:
        x, y = np.array([p.value for p in steady]), np.array([base.force(axis, p.command) for p in steady])
        force = base[axis.coefficient("alpha")] * y
        groups = np.array([abs(p.command) for p in steady])
        drag = fit_quadratic((axis.coefficient("a_d"), axis.coefficient("b_d")), x, force, groups=groups)
    assumed = dict(response.assumed) if response and not fitted else {}
    if points or fitted:
        alpha, beta = axis.coefficient("alpha"), axis.coefficient("beta")
        assumed |= {} if alpha in known else {alpha: _ASSUMED_ALPHA}
        assumed |= {} if fitted or response or beta in known else {beta: _ASSUMED_BETA}
    result = AxisResult(axis, points, found, drag, response, fitted, assumed, ())
    return replace(result, findings=tuple(diagnostics.on_axis(result, base, driving)))


def _response(
    axis: Axis, points: Sequence[Point], base: Rov, known: Mapping[str, object], thrust: Estimate | None
) -> ResponseFit | None:
    """Fit the points; return None where there are too few."""
    used = [p for p in points if p.weight > 0.0]
    wanted = set(drag_and_beta(axis, known))
    enough = any(p.quantity == "V_ss" for p in used) or wanted <= {axis.coefficient("beta")}
    if not enough or not free_coefficients(axis, used, known)[0]:
        return None
    return fit_response(axis, points, base, known, thrust)


def _thrust_of(fitted: RecordingsFit | None, thrust: Mapping[str, ThrustFit]) -> Estimate | None:
    """Return the estimate of an axis's thrust curves, from its recordings where there are any."""
    uncertain = measured(thrust.values())
    return fitted.estimate.part(uncertain.names) if fitted and uncertain else uncertain


def _in_time(step: StepResponse, fitted: RecordingsFit | None) -> StepResponse:
    """Subtract the delay of the commands from the time constant, because the model has no delay."""
    delay = fitted.delay_of(step.file) if fitted else 0.0
    return replace(step, Tau=step.Tau - delay) if step.Tau is not None and step.Tau > delay else step


def _points(tests: TankTests, axis: Axis, found: Sequence[StepResponse]) -> tuple[Point, ...]:
    """Return the rows of the tables, then the responses of the recordings."""
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


def _next_test(
    tests: TankTests, result: AxisResult, rov: Rov, thrust: Mapping[str, ThrustFit], *, repeat: bool
) -> NextTest | None:
    """Return the test that would help an axis most, with the sensor of its recordings or a typical one."""
    if result.estimate is None:
        return None
    fit = result.recordings
    quantity = fit.simulations[0].recording.quantity if fit else result.axis.position
    noise = max(s.noise * np.sqrt(s.correlation_time) for s in fit.simulations) if fit else NOISE[quantity]
    sensor, limits = Sensor(quantity, max(float(noise), 1e-9)), tests.given.description.tables.limits
    driving = {curve.name for curve in curves_of(rov.layout, result.axis)}
    scales = {name: fit.estimate.noise for name, fit in thrust.items() if name in driving and fit.estimate.noise > 0.0}
    return next_test(result.axis, rov, result.estimate, sensor, limits, scales, repeat=repeat)


def _weight(tests: TankTests, window: str, command: float) -> float:
    low, high = tests.given.description.tables.windows.get(window, (-1.0, 1.0))
    return float(low - 1e-9 <= command <= high + 1e-9)


def _command_range(results: Sequence[AxisResult], rov: Rov) -> tuple[float, float]:
    """Return the weakest command that counts and is beyond every dead band, and the strongest one."""

    def used() -> Iterator[float]:
        for result in results:
            yield from (abs(p.command) for p in result.points if p.weight > 0.0)
            for s in result.recordings.simulations if result.recordings else ():
                recording = s.recording
                command = recording.command if recording.command is not None else recording.reaching(rov.layout)
                yield from np.unique(np.abs(command)).tolist()

    names = [curve.coefficient(key) for curve in rov.layout.curves for key in ("c_0", "c_0" + REVERSE)]
    widest = max((rov.coefficients.get(name, 0.0) for name in names), default=0.0)
    commands = {round(c, 6) for c in used() if c > widest} - {0.0}
    low, high = min(commands, default=0.0), max(commands, default=1.0)
    return (low, high) if low < high else (max(low - 0.05, 0.0), min(high + 0.05, 1.0))
