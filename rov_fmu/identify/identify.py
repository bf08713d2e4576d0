"""Identify a vehicle from a folder of tank tests and dive logs: log -> likelihood -> posterior -> vehicle.

The objective is stated in objective.py, and the priors in parameters.py. This file is the order of the work.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rov_fmu import __version__
from rov_fmu.engine.filter import DivergedError
from rov_fmu.identify import assess
from rov_fmu.identify.beginning import Tests, begin, load_tests
from rov_fmu.identify.curves import NO_SHAPES, fitted
from rov_fmu.identify.findings import facts, findings_of, warnings
from rov_fmu.identify.next_test import next_test
from rov_fmu.identify.objective import Objective, TableRow
from rov_fmu.identify.parameters import LEAST_LAG, Beginning, Parameter, table_of
from rov_fmu.identify.posterior import Posterior, around, named, number
from rov_fmu.identify.records import Measured, Recorded
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
)
from rov_fmu.identify.solve import Minimum, minimise
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import Progress, silent
from rov_fmu.model.layout import REVERSE, Axis, Curve, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.checks import no_thrust
from rov_fmu.vehicle.schema import NOT_GIVEN, Estimated
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, load_vehicle

_TOLD = 0.8
"""A coefficient is identified where its standard error is at most this share of that of its prior."""
_ROW_STEPS = 10
"""The steps of a fit without the rows of one command."""
_QUIET, _LOUD = 0.0, 2.0
"""Two starts: at the means of the priors, and with slow forces and noise larger by so many deviations."""

__all__ = ["identify", "load_tests"]


@dataclass(frozen=True, eq=False)
class Fit:
    """The objective at its minimum."""

    known: Beginning
    objective: Objective
    best: Minimum
    posterior: Posterior
    """With all effects, also those without evidence: the intervals are wide enough for these."""
    kept: Posterior
    """Given that the effects without evidence are absent: the values of the vehicle."""
    difference: float
    """How much larger J is at the end of the second start."""


def identify(tests: Tests, on_progress: Progress = silent) -> Identification:
    """Identify a vehicle from its tests. Raises DataFileError if nothing can be identified, and VehicleFileError."""
    path = tests.given.description.tables.against
    against = load_vehicle(path) if path else None
    on_progress("reading the logs", 0.0)
    known, logs, rows = begin(tests)
    fit = fit_all(tests, known, logs, rows, on_progress)
    on_progress("predicting what was left out", 0.85)
    predicted = [*assess.predictions(fit.objective, fit.best, fit.posterior)]
    slow = [*assess.disturbances(fit.objective, fit.best, fit.posterior)]
    vehicle = _vehicle(tests, fit)
    for curve in vehicle.layout.curves:
        if mistake := next(no_thrust(curve, vehicle.rov.coefficients, f"thrust_{curve.name}*.csv"), None):
            raise DataFileError(f"{tests.folder.path}: {mistake}")
    axes = []
    for n, axis in enumerate(known.fitted):
        on_progress(f"what to measure next of {axis.name}", 0.9 + 0.1 * n / len(known.fitted))
        axes.append(_axis(tests, fit, vehicle, axis, predicted, slow))
    names, correlation = _correlation(vehicle)
    found = Identification(
        folder=replace(tests.folder, findings=[*tests.findings]),
        inputs=tests.inputs,
        vehicle=vehicle,
        against=against,
        axes=tuple(axes),
        curves={curve.name: tuple(_known(fit, vehicle, _of_curve(curve))) for curve in known.curves},
        forces=tuple(_points(tests, fit, vehicle.rov, "thrust")),
        effects=tuple(_effects(fit)),
        disturbances=tuple(slow),
        logging=tuple(_logging(fit)),
        sensors=tuple(_sensors(fit)),
        correlation=(names, correlation),
        objective=fit.best.value,
        agreement=fit.difference,
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
    ends = []
    for n, louder in enumerate((_QUIET, _LOUD)):

        def show(step: int, n: int = n) -> None:
            on_progress(f"start {n + 1} of 2", 0.25 * n + 0.25 * min(step / 20.0, 1.0))

        start = quick.mean + louder * quick.deviation * [p.kind == "slow force" for p in table.parameters]
        try:
            ends.append(minimise(quick, start, on_step=show))
        except DivergedError:
            continue
    if not ends:
        raise DataFileError(f"{tests.folder.path}: no simulation of the logs stays finite. Are units and signs right?")
    ends.sort(key=lambda end: end.value)

    def show_full(step: int) -> None:
        on_progress("all samples", 0.5 + 0.35 * min(step / 10.0, 1.0))

    best = minimise(full, ends[0].z, on_step=show_full)
    posterior = Posterior.of(table, best.z, best.information)
    difference = ends[-1].value - ends[0].value if len(ends) > 1 else np.inf
    apart = np.abs(ends[-1].z - ends[0].z) / posterior.errors
    if max((apart[n] for n in posterior.of_vehicle), default=0.0) < 2.0:
        difference = 0.0
    return Fit(known, full, best, posterior, posterior.without(posterior.absent), float(difference))


# ---- The vehicle -----------------------------------------------------------------------------------------------------


def _vehicle(tests: Tests, fit: Fit) -> Vehicle:
    """Return the vehicle with its sources, intervals and correlations."""
    given, kept = tests.given, fit.kept
    layout = _layout(tests, fit)
    coefficients = kept.table.coefficients(kept.z.tolist())
    coefficients |= _curves_in_file(fit, coefficients)
    coefficients |= {  # a file has no smaller exponent
        c.coefficient("n_V"): max(coefficients[c.coefficient("n_V")], 1.0) for c in layout.curves if "n_V" in c.keys
    }
    rov = Rov(layout, {name: coefficients.get(name, given.base.get(name, 1.0)) for name in layout.coefficients})
    known = {name: q for name, q in given.known.items() if name in layout.coefficients}
    identified = [*_identified(fit, rov)]
    sources = dict.fromkeys(layout.coefficients, NOT_GIVEN) | {name: q.source for name, q in known.items()}
    base = given.description.base_quantities
    sources |= {name: base[name].source for name in layout.coefficients if name in base and name not in known}
    intervals = {name: q.interval for name, q in known.items() if q.interval}
    estimates: dict[str, Estimated] = {}
    names = [one.name for one in identified]
    changed = named(kept.table, rov.coefficients)
    for name in changed:
        if name not in names:
            sources[name] = "Assumed: the tests do not determine it"
    if names:
        _, covariance, _ = fit.posterior.coefficients(names)
        errors = np.sqrt(np.diag(covariance))
        for n, name in enumerate(names):
            sources[name] = _SOURCE
            interval = identified[n].interval
            assert interval
            intervals[name] = interval
            others = {
                other: float(np.clip(covariance[n, m] / (errors[n] * errors[m]), -1.0, 1.0))
                for m, other in enumerate(names[:n])
                if errors[n] * errors[m] > 0.0
            }
            estimates[name] = Estimated(
                error=float(errors[n]), correlation={k: round(v, 6) for k, v in others.items() if abs(v) > 1e-6}
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


METHOD = (
    "maximum a posteriori by an extended Kalman filter with slow forces and coloured noise (docs/identify-method.md)"
)
_SOURCE = "Identified from the tests, as the method says"


def _curves_in_file(fit: Fit, coefficients: Mapping[str, float]) -> dict[str, float]:
    """Return a_t and b_t of each curve whose shape was fitted: those nearest to it over the tested commands."""
    table, z = fit.kept.table, fit.kept.z.tolist()
    shapes, low, high = table.shapes(z), *_command_range(fit)
    rov = Rov(table.layout, coefficients)
    found: dict[str, float] = {}
    for curve in fit.known.curves:
        if curve.name in shapes.of:
            c_0 = coefficients.get(curve.coefficient("c_0"), 0.0)

            def force(command: float, curve: Curve = curve) -> float:
                return shapes.force(rov, curve, command)

            found |= fitted(curve, force, c_0, low, high)
    return found


def _layout(tests: Tests, fit: Fit) -> Layout:
    """Return the layout without the effects that are absent."""
    table = fit.kept.table
    present = {(p.kind, p.of) for n, p in enumerate(table.parameters) if n not in fit.posterior.absent}
    base = tests.given.base
    coefficients = table.coefficients(fit.kept.z.tolist())

    def has_axis_key(axis: Axis, key: str) -> bool:
        if key == "F_0":
            return coefficients[axis.coefficient(key)] != 0.0
        if key.endswith(REVERSE):
            return axis.coefficient(key) in base or ("drag astern", axis.name) in present
        return True

    def has_curve_key(curve: Curve, key: str) -> bool:
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
    with_voltage = tests.given.rov.layout.voltage is not None or ("voltage", "") in present
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
    names = [n for n in named(fit.posterior.table, rov.coefficients) if not n.startswith("alpha_")]
    for one in _known_of(fit, rov, names):
        if one.interval:
            yield one


def _known_of(fit: Fit, rov: Rov, names: Sequence[str]) -> Iterator[Known]:
    """Yield coefficients with their intervals, where the tests determine them."""
    if not names:
        return
    _, covariance, prior = fit.posterior.coefficients(names)
    began = fit.posterior.table.coefficients([p.mean for p in fit.posterior.table.parameters])
    for n, name in enumerate(names):
        error, before = float(np.sqrt(covariance[n, n])), float(np.sqrt(prior[n, n]))
        told = error / before if before > 0.0 else 0.0
        declaration = rov.layout.coefficients[name]
        value = rov[name]
        low, high = around(value, error, positive=declaration.minimum >= 0.0 and not name.startswith(("c_0", "T_")))
        interval: Interval | None = max(low, declaration.minimum), min(high, declaration.maximum)
        if not told <= _TOLD or not error > 0.0:
            interval = None
        unit = "" if declaration.unit == "1" else f" {declaration.unit}"
        yield Known(name, value, interval, declaration.unit, f"{began[name]:.4g} ± {before:.2g}{unit}", told)


def _known(fit: Fit, vehicle: Vehicle, names: Sequence[str]) -> Iterator[Known]:
    changed = set(named(fit.posterior.table, vehicle.rov.coefficients))
    yield from _known_of(fit, vehicle.rov, [n for n in names if n in changed])


def _of_curve(curve: Curve) -> list[str]:
    return [curve.coefficient(key) for key in curve.keys]


def _correlation(vehicle: Vehicle) -> tuple[tuple[str, ...], Array]:
    from rov_fmu.vehicle.uncertainty import correlation

    names = tuple(vehicle.estimates)
    return names, correlation(names, vehicle.estimates)


# ---- Parts of the result ---------------------------------------------------------------------------------------------


def _axis(
    tests: Tests,
    fit: Fit,
    vehicle: Vehicle,
    axis: Axis,
    predicted: Sequence[Prediction],
    slow: Sequence[Disturbance],
) -> AxisResult:
    own = tuple(p for p in predicted if p.axis is axis)
    kept = replace(fit.posterior, z=fit.kept.z)
    answers = assess.answers(kept, axis)
    forces = [d for d in slow if d.axis is axis and d.kind == "force"]
    names = [axis.coefficient(key) for key in (*vehicle.layout.kinds[axis.name].keys, "beta")]
    points = [
        *_points(tests, fit, vehicle.rov, "steady", axis.name),
        *_points(tests, fit, vehicle.rov, "time_constant", axis.name),
    ]
    return AxisResult(
        axis=axis,
        verdict=assess.verdict(own, answers, forces, fit.difference),
        answers=answers,
        known=tuple(_known(fit, vehicle, names)),
        predictions=own,
        points=tuple(points),
        next_test=next_test(fit.objective, kept, axis, tests.given.description.tables.limits),
    )


def _points(tests: Tests, fit: Fit, rov: Rov, kind: str, only: str | None = None) -> Iterator[Point]:
    """Yield the rows of tables with what the vehicle says about them, also held out."""
    quantity = {"thrust": "force", "steady": "V_ss", "time_constant": "Tau"}[kind]
    held_out = _held_out_rows(fit)
    by_key = {(id_of(row), row.command): value for row, value in zip(fit.objective.rows, held_out, strict=True)}
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
            out = by_key.get((id_of(one), row.command), np.nan)
            counts = tests.counts(kind, subject, row.command)
            numbers = row.command, row.value, one.model(rov, NO_SHAPES), out
            yield Point(subject, quantity, unit, row.file, *numbers, counts)  # type: ignore[arg-type]


def id_of(row: TableRow) -> tuple[str, str]:
    """Return what tells the tables apart."""
    return row.quantity, row.subject.name


def _held_out_rows(fit: Fit) -> Array:
    """Return the value of each row of the tables by the information of all rows of other commands of its axis."""
    objective, rows = fit.objective, fit.objective.rows
    found = np.full(len(rows), np.nan)
    if not rows:
        return found
    groups: dict[tuple[str, str, float], list[int]] = {}
    for n, row in enumerate(rows):
        kind = "force" if row.quantity == "force" else "motion"
        groups.setdefault((kind, row.subject.name, abs(row.command)), []).append(n)
    for members in groups.values():
        chosen = np.array(members)
        others = [row for n, row in enumerate(rows) if n not in members]
        z = minimise(Objective(objective.table, objective.logs, others, thinned=True), fit.best.z, most=_ROW_STEPS).z
        rov = Rov(objective.table.layout, objective.table.coefficients(z.tolist()))
        shapes = objective.table.shapes(z.tolist())
        found[chosen] = [rows[n].model(rov, shapes) for n in members]
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
        if (dead := table.place("dead time")) is not None:
            total[dead] = 1.0
        offset, error = float(total @ posterior.z), float(np.sqrt(total @ posterior.covariance @ total))
        width = table.get(posterior.z.tolist(), "logging width", one.log.file) * one.interval
        yield Logging(one.log.file, one.interval, offset, around(offset, error), width)


def _sensors(fit: Fit) -> Iterator[Sensor]:
    z, table = fit.best.z.tolist(), fit.posterior.table
    counts: dict[str, int] = {}
    first: dict[str, Measured] = {}
    for one in fit.objective.logs:
        for m in one.measured:
            name = m.channel.quantity.name
            counts[name] = counts.get(name, 0) + len(m.channel.values)
            first.setdefault(name, m)
    for name, m in first.items():
        white = table.get(z, "white noise", name)
        coloured = white * table.get(z, "coloured noise", name)
        time = table.get(z, "correlation time", name)
        yield Sensor(m.sensor.axis, name, m.channel.quantity.unit, white, coloured, time, counts[name])
