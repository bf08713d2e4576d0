"""Identify a vehicle from a folder of tank tests and dive logs: log -> likelihood -> posterior -> vehicle.

The objective is stated in objective.py, and the priors in parameters.py. This file is the order of the work.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from rov_fmu import __version__
from rov_fmu.engine.filter import DivergedError
from rov_fmu.identify import assess
from rov_fmu.identify.beginning import Tests, begin, load_tests
from rov_fmu.identify.disturbances import disturbances
from rov_fmu.identify.findings import facts, findings_of, warnings
from rov_fmu.identify.likelihood.curves import NO_SHAPES, fitted
from rov_fmu.identify.likelihood.objective import Objective, TableRow
from rov_fmu.identify.likelihood.parameters import LEAST_LAG, Beginning, Parameter, table_of
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior, around, number
from rov_fmu.identify.likelihood.records import Measured, Recorded
from rov_fmu.identify.likelihood.solve import ENOUGH, Minimum, minimise
from rov_fmu.identify.next_test import next_test
from rov_fmu.identify.result import (
    AxisResult,
    Disturbance,
    Effect,
    Identification,
    Interval,
    Known,
    Logging,
    Point,
    Prediction,
    Sensor,
    Slip,
)
from rov_fmu.identify.slips import slips
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import Progress, silent
from rov_fmu.model.layout import REVERSE, SURGE, SWAY, Axis, Curve, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.checks import no_thrust
from rov_fmu.vehicle.schema import NOT_GIVEN, Estimated
from rov_fmu.vehicle.uncertainty import NORMAL, correlation
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, load_vehicle

_TOLD = 0.8
"""A coefficient is identified where its standard error is at most this share of that of its prior."""
_ROW_STEPS = 10
"""The steps of a fit without the rows of one command."""
_EXACT_BAND = 0.01
"""A dead band is never claimed to better than this command: thrust begins gradually."""
_OUTLIER = 6.0
"""A sample is an outlier if it is so many standard deviations beside its prediction."""
_SAME = 0.01
"""Two ends of fits are the same vehicle if they differ by less than this share of the prior's deviation."""
_QUICK = 4.0
"""The reduction of J by a step at which a quick fit ends."""
_STARTS: tuple[Mapping[str, float], ...] = (
    {"slow": 1.0, "white": 2.0},
    {"slow": 1.0, "white": 4.0, "quadratic": 0.7},
)
"""Two starts: how many deviations of their priors some kinds of parameters are above their means, by their first word.

With much noise, J has few minima far from the data.
"""
_CAREFUL = {"slow": 1.0, "white": 4.0, "quadratic": -1.0, "linear": -1.0, "inertia": 1.0}
"""The start if the motion diverges from both others: a heavier vehicle with less drag."""

__all__ = ["identify", "load_tests"]


@dataclass(frozen=True, eq=False)
class Fit:
    """The objective at its minimum."""

    known: Beginning
    objective: Objective
    best: Minimum
    posterior: Posterior
    """With all effects, also those without evidence."""
    averaged: Posterior
    """Averaged over the presence of the effects without evidence: the intervals are wide enough for these."""
    kept: Posterior
    """Given that the effects without evidence are absent: the values of the vehicle."""
    difference: float
    """How much larger J is at the end of the second start."""


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
    fit = fit_all(tests, known, logs, rows, on_progress)
    on_progress("predicting what was left out", 0.85)
    predicted = [*assess.predictions(fit.objective, fit.best, fit.posterior)]
    slow = [*disturbances(fit.objective, fit.best, fit.posterior)]
    vehicle = _vehicle(tests, fit)
    for curve in vehicle.layout.curves:
        if mistake := next(no_thrust(curve, vehicle.rov.coefficients, f"thrust_{curve.name}*.csv"), None):
            raise DataFileError(f"{tests.folder.path}: {mistake}")
    wrong = slips(tests, known, fit.objective, fit.best.z)
    held_out = _held_out_rows(fit)
    axes = []
    for n, axis in enumerate(known.fitted):
        on_progress(f"what to measure next of {axis.name}", 0.9 + 0.1 * n / len(known.fitted))
        axes.append(_axis(tests, fit, vehicle, axis, predicted, slow, wrong, held_out))
    names = tuple(vehicle.estimates)
    found = Identification(
        folder=replace(tests.folder, findings=[*tests.findings]),
        inputs=tests.inputs,
        vehicle=vehicle,
        against=against,
        axes=tuple(axes),
        curves={curve.name: tuple(_known(fit, vehicle, _of_curve(curve))) for curve in known.curves},
        forces=tuple(_points(tests, held_out, vehicle.rov, "thrust")),
        effects=tuple(_effects(fit)),
        disturbances=tuple(slow),
        logging=tuple(_logging(fit)),
        sensors=tuple(_sensors(fit)),
        correlation=(names, correlation(names, vehicle.estimates)),
        objective=fit.best.value,
        agreement=fit.difference,
        slips=wrong,
    )
    findings = findings_of(found)
    provenance = vehicle.provenance
    assert provenance
    told = replace(provenance, warnings=warnings(findings), facts=facts(findings))
    return replace(found, findings=findings, vehicle=replace(vehicle, provenance=told))


# ---- The fit ---------------------------------------------------------------------------------------------------------


def fit_all(
    tests: Tests, known: Beginning, logs: Sequence[Recorded], rows: Sequence[TableRow], on_progress: Progress = silent
) -> Fit:
    """Fit all logs and tables: two starts on thinned logs, and the better one to the end on all samples."""
    table = table_of(known, logs, sorted({row.noise for row in rows}))
    quick = Objective(table, logs, rows, thinned=True)
    full = Objective(table, logs, rows)
    ends: list[Minimum] = []
    for n, louder in enumerate((*_STARTS, _CAREFUL)):
        if n == len(_STARTS) and ends:
            break

        def show(step: int, n: int = n) -> None:
            words = f"start {n + 1} of 2" if n < len(_STARTS) else "a more careful start"
            on_progress(words, 0.25 * min(n, 1) + 0.25 * min(step / 20.0, 1.0))

        start = quick.mean + quick.deviation * [louder.get(p.kind.split()[0], 0.0) for p in table.parameters]
        try:
            ends.append(minimise(quick, start, on_step=show, enough=_QUICK, last=False))
        except DivergedError:
            continue
    if not ends:
        raise DataFileError(f"{tests.folder.path}: no simulation of the logs stays finite. Are units and signs right?")
    ends.sort(key=lambda end: end.value)

    def show_full(step: int) -> None:
        on_progress("all samples", 0.5 + 0.35 * min(step / 10.0, 1.0))

    best = minimise(full, _scaled(known, full, ends[0].z), on_step=show_full)
    scaled = _scaled(known, full, best.z)
    if full.prior(scaled) < full.prior(best.z) - ENOUGH:
        best = minimise(full, scaled, on_step=show_full, most=2)
    posterior = Posterior.of(table, best.z, best.information)
    difference = ends[-1].value - ends[0].value if len(ends) > 1 else np.inf
    apart = np.abs(ends[-1].z - ends[0].z) / np.maximum(posterior.errors, _SAME * full.deviation)
    if max((apart[n] for n in posterior.of_vehicle), default=0.0) < 2.0:
        difference = 0.0
    kept = posterior.without(posterior.absent)
    averaged = replace(posterior.averaged, z=kept.z)
    return Fit(known, full, best, posterior, averaged, kept, float(difference))


def _scaled(known: Beginning, objective: Objective, z: Array) -> Array:
    """Return the parameters with the common scale of thrust, drag, load and inertia that their priors prefer.

    The data do not tell this scale, and steps of the fit, which are short where the data have kinks, hardly move it.
    """
    kinds = ("thrust scale", "inertia", "quadratic drag", "linear drag")
    curves = {t.curve for axis in known.fitted for t in known.layout.drivers(axis)}
    everything = [*(("thrust scale", name) for name in curves), *((k, a.name) for k in kinds[1:] for a in known.fitted)]
    if any(objective.table.place(kind, of) is None for kind, of in everything) or objective.rows:
        return z
    direction = np.zeros(len(z))
    for n, p in enumerate(objective.table.parameters):
        if p.kind in kinds:
            direction[n] = 1.0
        elif p.kind == "load":
            axis = next(axis for axis in known.fitted if axis.name == p.of)
            direction[n] = z[n] + known.coefficients[axis.coefficient("F_0")] / known.full[p.of]
    weight = direction / objective.deviation**2
    moved = z - direction * float(weight @ (z - objective.mean)) / float(weight @ direction)
    return np.clip(moved, objective.low, objective.high)


# ---- The vehicle -----------------------------------------------------------------------------------------------------


def _vehicle(tests: Tests, fit: Fit) -> Vehicle:
    """Return the vehicle with its sources, intervals and correlations."""
    given, kept = tests.given, fit.kept
    layout = _layout(tests, fit)
    coefficients = _in_file(fit, kept.z)
    coefficients |= {  # a file has no smaller exponent
        c.coefficient("n_V"): max(coefficients[c.coefficient("n_V")], 1.0) for c in layout.curves if "n_V" in c.keys
    }
    rov = Rov(layout, {name: coefficients.get(name, given.base.get(name, 1.0)) for name in layout.coefficients})
    known = {name: q for name, q in given.known.items() if name in layout.coefficients}
    identified = {one.name: one.interval for one in _identified(fit, rov) if one.interval}
    sources = dict.fromkeys(layout.coefficients, NOT_GIVEN) | {name: q.source for name, q in known.items()}
    base = given.description.base_quantities
    sources |= {name: base[name].source for name in layout.coefficients if name in base and name not in known}
    intervals = {name: q.interval for name, q in known.items() if q.interval}
    estimates: dict[str, Estimated] = {}
    changed = _changed(fit, rov)
    names = [name for name in changed if name in identified or name in intervals]
    for name in changed:
        sources[name] = _SOURCE if name in identified else f"{sources[name]}; adapted to the tests"
        if name not in names:
            sources[name] = "Assumed: the tests do not determine it"
    if names:
        held = [name for name in changed if name not in names and not name.startswith("alpha_")]
        _, covariance, _ = _numbers(fit, [*names, *held])
        marginal = np.sqrt(np.diag(covariance))
        covariance = _given_the_last(covariance, len(names))
        errors = np.sqrt(np.diag(covariance))
        for n, name in enumerate(names):
            intervals[name] = identified.get(name) or _interval(rov, name, float(marginal[n]))
            others = {
                other: float(np.clip(covariance[n, m] / (errors[n] * errors[m]), -1.0, 1.0))
                for m, other in enumerate(names[:n])
                if errors[n] * errors[m] > 0.0
            }
            estimates[name] = Estimated(
                error=float(errors[n]) * QUANTILE / NORMAL,
                correlation={k: round(v, 6) for k, v in others.items() if abs(v) > 1e-6},
            )
    validity = given.description.tables.validity
    made = Provenance(f"rov-fmu {__version__} identify", METHOD, tests.inputs, data=_data(fit))
    return Vehicle(
        **dict(given.head),
        rov=rov,
        sources=sources,
        command_range=validity.command_range if validity else _command_range(fit),
        alternatives={},
        data=None,
        limits=given.description.limits,
        intervals=intervals,
        estimates=estimates,
        provenance=made,
        voltage_source="" if layout.voltage is None else "Mean voltage of the logs",
        thruster_sources=given.thruster_sources,
    )


def _given_the_last(covariance: Array, count: int) -> Array:
    """Return the covariance of the first numbers, given the values of the others.

    The vehicle file has these others without an error. Drag that shares the error of a thrust curve must not be drawn
    with this error beside a curve that stays.
    """
    first, last = slice(count), slice(count, None)
    regression = covariance[first, last] @ np.linalg.pinv(covariance[last, last], hermitian=True)
    found = covariance[first, first] - regression @ covariance[last, first]
    np.fill_diagonal(found, np.maximum(np.diag(found), 0.0))
    return np.asarray(found)


METHOD = (
    "maximum a posteriori by an extended Kalman filter with slow forces and coloured noise (docs/identify-method.md)"
)
_SOURCE = "Identified from the tests, as the method says"


def _in_file(fit: Fit, z: Array) -> dict[str, float]:
    """Return the coefficients of the vehicle file for the coordinates of the parameters.

    A file has no shapes of curves: a_t and b_t are those of the nearest curve over the tested commands.
    """
    table, (low, high) = fit.kept.table, _command_range(fit)
    coefficients = table.coefficients(z.tolist())
    shapes, rov = table.shapes(z.tolist()), Rov(table.layout, coefficients)
    for curve in fit.known.curves:
        if curve.name in shapes.of:
            c_0 = coefficients.get(curve.coefficient("c_0"), 0.0)

            def force(command: float, curve: Curve = curve) -> float:
                return shapes.force(rov, curve, command)

            coefficients |= fitted(curve, force, c_0, low, high)
    return coefficients | {name: table.base[name] for name in table.exact}


def _changed(fit: Fit, rov: Rov) -> list[str]:
    """Return the names of the coefficients of the vehicle that the parameters change."""
    z, changed = fit.posterior.z, dict[str, None]()
    before = _in_file(fit, z)
    for n in fit.posterior.of_vehicle:
        moved = z.copy()
        moved[n] += 0.1 * fit.posterior.table.parameters[n].deviation + 0.01
        changed |= dict.fromkeys(name for name, value in _in_file(fit, moved).items() if value != before[name])
    return [name for name in rov.coefficients if name in changed]


def _numbers(fit: Fit, names: Sequence[str]) -> tuple[Array, Array, Array]:
    """Return some coefficients of the vehicle file, their covariance, and their covariance by the prior."""

    def values(z: Array) -> Array:
        coefficients = _in_file(fit, z)
        return np.array([coefficients[name] for name in names])

    return fit.averaged.numbers(values)


def _layout(tests: Tests, fit: Fit) -> Layout:
    """Return the layout without the effects that are absent."""
    table = fit.kept.table
    present = {(p.kind, p.of) for n, p in enumerate(table.parameters) if n not in fit.posterior.absent}
    base, own = tests.given.base, tests.given.description.known
    coefficients = table.coefficients(fit.kept.z.tolist())

    def has_axis_key(axis: Axis, key: str) -> bool:
        if axis.coefficient(key) in own:
            return True
        if key == "F_0":
            return coefficients[axis.coefficient(key)] != 0.0
        if key.endswith(REVERSE):
            return axis.coefficient(key) in base or ("drag astern", axis.name) in present
        return True

    def has_curve_key(curve: Curve, key: str) -> bool:
        if curve.coefficient(key) in own:
            return True
        if key.startswith("c_0"):
            return coefficients[curve.coefficient(key)] > 0.0
        if key in ("V_0", "n_V"):
            return with_voltage
        if key == "T":
            return coefficients[curve.coefficient(key)] > LEAST_LAG * 1.0001
        if key in (f"a_t{REVERSE}", f"b_t{REVERSE}"):
            is_measured = curve.coefficient(key) in tests.given.known or _has_backward_rows(tests, curve)
            return curve.coefficient(key) in base or is_measured or ("reverse thrust", curve.name) in present
        return True

    layout = table.layout
    exponents = (coefficients[c.coefficient("n_V")] for c in layout.curves if "n_V" in c.keys)
    with_voltage = tests.given.rov.layout.voltage is not None or any(n > 0.0 for n in exponents)
    return replace(
        layout,
        voltage=layout.voltage if with_voltage else None,
        mix=tests.given.rov.layout.mix,
        pulse=tests.given.rov.layout.pulse,
        has_dead_time=tests.given.rov.layout.has_dead_time,
        axes=tuple(replace(f, keys=tuple(k for k in f.keys if has_axis_key(f.axis, k))) for f in layout.axes),
        curves=tuple(replace(c, keys=tuple(k for k in c.keys if has_curve_key(c, k))) for c in layout.curves),
    )


def _has_backward_rows(tests: Tests, curve: Curve) -> bool:
    return any(name == curve.name and any(row.command < 0.0 for row in rows) for name, rows in tests.rows("thrust"))


def _data(fit: Fit) -> str:
    """Return what the vehicle was identified from, in words."""
    dives = sum(not one.log.follows_axis for one in fit.objective.logs)
    parts = ["a dive log" if dives == 1 else f"{dives} dive logs"] if dives else []
    if fit.objective.rows or dives < len(fit.objective.logs):
        parts.insert(0, "tank tests")
    return " and ".join(parts) or "given values"


def _command_range(fit: Fit) -> tuple[float, float]:
    """Return the weakest and the strongest command of the tests."""
    used = [abs(row.command) for row in fit.objective.rows]
    for one in fit.objective.logs:
        assert one.log.commands
        used += np.abs(one.log.commands.value).tolist()
    used = [round(c, 6) for c in used if c > 1e-3]
    low, high = min(used, default=0.0), max(used, default=1.0)
    return (low, high) if low < high else (max(low - 0.05, 0.0), min(high + 0.05, 1.0))


def _identified(fit: Fit, rov: Rov) -> Iterator[Known]:
    """Yield the coefficients of the vehicle that the tests determine."""
    names = [name for name in _changed(fit, rov) if not name.startswith("alpha_")]
    for one in _known_of(fit, rov, names):
        if one.interval:
            yield one


def _known_of(fit: Fit, rov: Rov, names: Sequence[str]) -> Iterator[Known]:
    """Yield coefficients with their intervals, where the tests determine them."""
    if not names:
        return
    _, covariance, prior = _numbers(fit, names)
    began = _in_file(fit, np.array([p.mean for p in fit.posterior.table.parameters]))
    for n, name in enumerate(names):
        error, before = float(np.sqrt(covariance[n, n])), float(np.sqrt(prior[n, n]))
        told = error / before if before > 0.0 else 0.0
        declaration, value = rov.layout.coefficients[name], rov[name]
        interval: Interval | None = _interval(rov, name, error)
        if not told <= _TOLD or not error > 0.0:
            interval = None
        unit = "" if declaration.unit == "1" else f" {declaration.unit}"
        yield Known(name, value, interval, declaration.unit, f"{began[name]:.4g} ± {before:.2g}{unit}", told)


def _interval(rov: Rov, name: str, error: float) -> Interval:
    """Return the 95 % interval of a coefficient within its bounds."""
    declaration = rov.layout.coefficients[name]
    if name.startswith("c_0"):
        error = max(error, _EXACT_BAND / QUANTILE)
    low, high = around(rov[name], error, positive=declaration.minimum >= 0.0 and not name.startswith(("c_0", "T_")))
    return max(low, declaration.minimum), min(high, declaration.maximum)


def _known(fit: Fit, vehicle: Vehicle, names: Sequence[str]) -> Iterator[Known]:
    changed = _changed(fit, vehicle.rov)
    yield from _known_of(fit, vehicle.rov, [n for n in names if n in changed])


def _of_curve(curve: Curve) -> list[str]:
    return [curve.coefficient(key) for key in curve.keys]


# ---- Parts of the result ---------------------------------------------------------------------------------------------


def _axis(
    tests: Tests,
    fit: Fit,
    vehicle: Vehicle,
    axis: Axis,
    predicted: Sequence[Prediction],
    slow: Sequence[Disturbance],
    wrong: Sequence[Slip],
    held_out: "_HeldOut",
) -> AxisResult:
    own = tuple(p for p in predicted if p.axis is axis)
    answers = assess.answers(fit.averaged, axis, vehicle.rov)
    unknown = [d for d in slow if d.axis is axis or d.kind == "gain" or (d.axis is None and axis in (SURGE, SWAY))]
    files = [one.log.file for one in fit.objective.logs if any(m.sensor.axis is axis for m in one.measured)]
    names = [axis.coefficient(key) for key in (*vehicle.layout.kinds[axis.name].keys, "beta")]
    points = [
        *_points(tests, held_out, vehicle.rov, "steady", axis.name),
        *_points(tests, held_out, vehicle.rov, "time_constant", axis.name),
    ]
    return AxisResult(
        axis=axis,
        verdict=assess.verdict(own, answers, unknown, fit.difference, [s for s in wrong if s.file in files]),
        answers=answers,
        known=tuple(_known(fit, vehicle, names)),
        predictions=own,
        points=tuple(points),
        next_test=next_test(fit.objective, fit.averaged, axis, tests.given.description.tables.limits),
    )


_HeldOut = Mapping[tuple[str, str, float], float]
"""The value of a row by a fit without it, by the quantity, the curve or axis, and the command."""


def _points(tests: Tests, held_out: _HeldOut, rov: Rov, kind: str, only: str | None = None) -> Iterator[Point]:
    """Yield the rows of tables with what the vehicle says about them, also held out."""
    quantity = {"thrust": "force", "steady": "V_ss", "time_constant": "Tau"}[kind]
    for subject, rows in tests.rows(kind):
        if only and subject != only:
            continue
        for row in rows:
            of: Curve | Axis = (
                next(c for c in rov.layout.curves if c.name == subject)
                if kind == "thrust"
                else rov.layout.kinds[subject].axis
            )
            one = TableRow(f"{quantity} of {subject}", of, quantity, row.command, row.value, 1.0)
            unit = "N" if kind == "thrust" else "s" if kind == "time_constant" else rov.layout.kinds[subject].axis.unit
            out = held_out.get((quantity, subject, row.command), np.nan)
            counts = tests.counts(kind, subject, row.command)
            numbers = row.command, row.value, one.model(rov, NO_SHAPES), out
            yield Point(subject, quantity, unit, row.file, *numbers, counts)  # type: ignore[arg-type]


def _held_out_rows(fit: Fit) -> _HeldOut:
    """Return the value of each row of the tables by a fit without all rows of the same size of the command."""
    objective, rows = fit.objective, fit.objective.rows
    found: dict[tuple[str, str, float], float] = {}
    groups: dict[tuple[str, str, float], list[int]] = {}
    for n, row in enumerate(rows):
        kind = "force" if row.quantity == "force" else "motion"
        groups.setdefault((kind, row.subject.name, abs(row.command)), []).append(n)
    for members in groups.values():
        others = [row for n, row in enumerate(rows) if n not in members]
        z = minimise(
            Objective(objective.table, objective.logs, others, thinned=True),
            fit.best.z,
            most=_ROW_STEPS,
            with_noise=False,
        ).z
        rov = Rov(objective.table.layout, objective.table.coefficients(z.tolist()))
        shapes = objective.table.shapes(z.tolist())
        for row in (rows[n] for n in members):
            found[row.quantity, row.subject.name, row.command] = row.model(rov, shapes)
    return found


def _effects(fit: Fit) -> Iterator[Effect]:
    """Yield all optional effects with their evidence, beside those that are kept."""
    table, gone = fit.posterior.table, fit.posterior.absent
    for n, p in enumerate(table.parameters):
        if p.null is None:
            continue
        posterior = fit.posterior.without([m for m in gone if m != n])
        factor, unit = _in_units(fit.known, p)
        value, error = number(p, posterior.z[n]) * factor, posterior.errors[n] * factor
        if p.kind == "dead band":
            error = max(error, _EXACT_BAND / QUANTILE)
        if p.kind == "load":
            axis = next(axis for axis in fit.known.fitted if axis.name == p.of)
            value += fit.known.coefficients[axis.coefficient("F_0")]
        if p.kind in ("reverse thrust", "drag astern"):
            low, high = (float(np.exp(end)) for end in around(value, error))
            yield Effect(p.kind, p.of, _WORDS[p.kind], float(np.exp(value)), (low, high), "1", posterior.evidence(n))
            continue
        yield Effect(
            p.kind,
            p.of,
            " ".join(filter(None, (_WORDS[p.kind], f"to the {p.part}" if p.part else ""))),
            value,
            around(value, error),
            unit,
            posterior.evidence(n),
        )


_WORDS = {
    "reverse thrust": "thrust astern relative to thrust ahead",
    "dead band": "dead band",
    "lag": "time constant of the thrusters",
    "dead time": "dead time of the commands",
    "drag astern": "drag astern relative to drag ahead",
    "load": "constant load",
    "current": "current",
    "voltage": "exponent of thrust over voltage",
}


def _in_units(known: Beginning, p: Parameter) -> tuple[float, str]:
    """Return what turns the number of an effect into its unit, and the unit."""
    if p.kind == "load":
        return known.full[p.of], next(axis for axis in known.fitted if axis.name == p.of).load
    return 1.0, p.unit


def _logging(fit: Fit) -> Iterator[Logging]:
    posterior, table = fit.posterior, fit.posterior.table
    for one in fit.objective.logs:
        place = table.place("logging offset", one.log.file)
        if place is None:
            continue
        total = np.zeros(len(posterior.z))
        total[place] = 1.0
        dead = table.place("dead time")
        if dead is not None and dead in posterior.absent:  # the vehicle keeps none, so the logger has all of it
            total[dead] = 1.0
        offset, error = float(total @ posterior.z), float(np.sqrt(total @ posterior.covariance @ total))
        width = table.get(posterior.z.tolist(), "logging width", one.log.file) * one.interval
        yield Logging(one.log.file, one.interval, offset, around(offset, error), width)


def _sensors(fit: Fit) -> Iterator[Sensor]:
    z, table = fit.best.z.tolist(), fit.posterior.table
    counts: dict[str, int] = {}
    outlying: dict[str, list[bool]] = {}
    first: dict[str, Measured] = {}
    for one, record, data in zip(fit.objective.logs, fit.objective.records, fit.best.data, strict=False):
        for number, m in enumerate(one.measured):
            name = m.channel.quantity.name
            counts[name] = counts.get(name, 0) + len(m.channel.values)
            far = np.abs(data.normalised[record.sensor == number]) > _OUTLIER
            outlying.setdefault(name, []).extend(far.tolist())
            first.setdefault(name, m)
    for name, m in first.items():
        white = table.get(z, "white noise", name)
        coloured = white * table.get(z, "coloured noise", name)
        time = table.get(z, "correlation time", name)
        share = float(np.mean(outlying[name]))
        yield Sensor(m.sensor.axis, name, m.channel.quantity.unit, white, coloured, time, counts[name], share)
