"""The vehicle of a fit, with the sources, intervals and correlations of its coefficients."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import inf, isclose
from os.path import commonpath
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.equation.catalogue import COUPLED_AXES, HEAVE, PITCH, REVERSE, ROLL
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import EVERY_COMMAND, Curve, Part, Range, SourcedVector
from rov_fmu.identify.given import Tests
from rov_fmu.identify.likelihood.curves import Quadratic
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.kinds import ABSENT, EFFECTS, EXACT_BAND, OWN_KEYS
from rov_fmu.identify.likelihood.objective import changed
from rov_fmu.identify.likelihood.parameters import ADAPTED
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior, around, hull
from rov_fmu.identify.result import Identification, IdentifiedCoefficient, Interval
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import brief
from rov_fmu.io.numbers import with_interval
from rov_fmu.io.program import program
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import MeasuredQuantity
from rov_fmu.tank.description import DRAFTED, ROV_FILE
from rov_fmu.vehicle.checks import check_surface
from rov_fmu.vehicle.description import LEAST_RANGE, UNIT_OF_RANGE, Provenance
from rov_fmu.vehicle.schema import NOT_GIVEN, UNDETERMINED, UNTUNED, Basis, Estimated
from rov_fmu.vehicle.uncertainty import NORMAL
from rov_fmu.vehicle.vehicle import Vehicle, read_vehicle
from rov_fmu.vehicle.writer import vehicle_text

_DEAD_BAND = ("c_0", f"c_0{REVERSE}")
"""The keys of dead bands."""
_WITHOUT_OUTLIERS = (0.005, 0.995)
"""The quantiles between which a quantity counts as tested."""
_DIGITS = (6, 9, 17)
"""The significant digits of the numbers of a result, and the decimals of correlations, which may be very close to 1:
more than most tests give, and few enough to be equal on every machine. The others are for very exact data."""
_UNCHANGED = 1e-5
"""The relative difference from the base below which a coefficient is that of the base: less than people print."""
_TOLD = 0.8
"""A coefficient is identified where its standard error is at most this share of that of its prior."""
_SAME = 0.1
"""The difference of J that makes no other vehicle; 1 is one unit of 2 ln of the likelihood."""


def identified_vehicle(tests: Tests, fit: Fit) -> tuple[Vehicle, dict[str, IdentifiedCoefficient]]:
    """Return the vehicle with its sources, intervals and correlations, and the coefficients that the fit changes.

    These have intervals where the tests determine them.
    """
    file = fit.file.posterior
    layout = _layout(tests, fit)
    values = {name: float(value) for name, value in _in_file(file, fit, file.z).items()}
    rov = Vehicle(layout, {name: values.get(name, tests.base.get(name, 1.0)) for name in layout.coefficients})
    changed = _changed(file, rov)
    # A file without a dead band has an exact one of 0.
    bands = [name for name, (*_, key) in fit.known.layout.keys_in_file.items() if key in _DEAD_BAND]
    every = [*dict.fromkeys((*changed, *bands))]
    numbers = [_numbers(posterior, fit, every) for posterior in fit.posteriors] if changed else []
    coefficients = {one.name: one for one in _coefficients(fit, rov, changed, numbers)}
    forms = (form for form in layout.axes if form.axis in fit.known.unseen)
    unseen = {form.coefficient(key) for form in forms for key in (*form.keys, "beta")}
    identified = {name: one.interval for name, one in coefficients.items() if one.interval and name not in unseen}
    base = tests.description.base_quantities
    given = {**base, **tests.known}
    sources = {name: given[name].source if name in given else NOT_GIVEN for name in layout.coefficients}
    if tests.description.assumed:
        of_base = {*base} & {*sources}
        sources |= {name: f"Assumed, as in {tests.description.base_name}: {sources[name]}" for name in of_base}
    for curve in (c for c in layout.curves if "n_V" in c.keys):
        asked = tests.description.tables.known.get(curve.coefficient("V_0"))
        reference = asked.source if asked else layout.voltage_source
        for key, source in (("V_0", reference), ("n_V", "The usual exponent, which [priors] takes as exact")):
            if sources[curve.coefficient(key)] == NOT_GIVEN:
                sources[curve.coefficient(key)] = source
    intervals = {name: q.interval for name, q in tests.known.items() if q.interval}
    estimates: dict[str, Estimated] = {}
    names = [name for name in changed if name in identified or name in intervals]
    for name in changed:
        if name in identified:
            sources[name] = _SOURCE
        elif name not in {*names, *unseen}:
            sources[name] = UNDETERMINED
        elif not isclose(rov[name], tests.base.get(name, inf), rel_tol=_UNCHANGED):
            sources[name] += ADAPTED
    if names:
        held = [name for name in every if name not in {*names, *unseen}]
        indices = [every.index(name) for name in (*names, *held)]
        of_file, full = numbers
        shift = full.values - of_file.values
        whole = full.covariance + np.outer(shift, shift)
        covariance = _given_the_last(whole[np.ix_(indices, indices)], len(names))
        errors = np.sqrt(np.diag(covariance))
        for n, name in enumerate(names):
            intervals[name] = identified.get(name) or _interval(rov, name, indices[n], numbers)
            others = {
                other: float(np.clip(covariance[n, m] / (errors[n] * errors[m]), -1.0, 1.0))
                for m, other in enumerate(names[:n])
                if errors[n] * errors[m] > 0.0
            }
            estimates[name] = Estimated(error=float(errors[n]) * QUANTILE / NORMAL, correlation=others)
    validity = tests.description.tables.validity
    made = Provenance(tool=f"{program()} identify", method=METHOD, hash="SHA3-256", inputs=dict(tests.folder.inputs))
    vehicle = replace(
        rov,
        **_head(tests),
        basis={name: Basis(source, intervals.get(name), estimates.get(name)) for name, source in sources.items()},
        command_range=validity.command_range if validity else fit.command_range,
        tested=validity.tested if validity else {},
        alternatives={},
        data=None,
        limits=tests.description.limits,
        provenance=made,
        measured_from=_data(fit),
    )
    return vehicle, coefficients


def _head(tests: Tests) -> dict[str, Any]:
    """Return [vehicle] of rov.toml. Where nobody has changed the description of a draft, it and the source name the
    files that are used, which may have changed since."""
    head = dict(tests.description.tables.vehicle or ())
    if head and head["description"] == DRAFTED.format(head["source"]):
        unused = {log.whole_file for log in tests.folder.logs if not any(c.quantity.axis for c in log.channels)}
        unused |= {ROV_FILE, tests.description.base_name}
        files = [name for name in tests.folder.inputs if name not in unused]
        head["source"] = brief(", ".join(files))
        head["description"] = DRAFTED.format(head["source"])
    return head


def with_own_inputs(vehicle: Vehicle, tests: Tests) -> Vehicle:
    """Return the vehicle of the file: in place of the forces of a wrench, it has the thrusters of rov.toml.

    Without these, its inputs are the loads from outside, X_ext ... Other vehicles are returned as they are. The curves
    of the thrusters are those of rov.toml and hold for all commands, unless its [validity] says otherwise.
    """
    if not vehicle.layout.has_wrench:
        return vehicle
    own, tables = tests.thrusters or Layout((), (), ()), tests.description.tables
    layout = replace(vehicle.layout, curves=own.curves, thrusters=own.thrusters, mix=own.mix)
    kept, keys_in_file = layout.coefficients, layout.keys_in_file
    thrust = {
        name: quantity
        for name, quantity in tables.quantities(layout).items()
        if quantity and keys_in_file[name][0] in ("arm", "curves", "thruster")
    }
    vehicle = vehicle.with_(layout)
    numbers = {**dict.fromkeys(kept, UNTUNED), **vehicle.coefficients}
    basis = {**dict.fromkeys(kept, Basis(NOT_GIVEN)), **vehicle.basis}
    return replace(
        vehicle,
        coefficients=numbers | {name: quantity.value for name, quantity in thrust.items()},
        basis=basis | {name: Basis(quantity.source, quantity.interval) for name, quantity in thrust.items()},
        command_range=vehicle.command_range if tables.validity else (0.0, 1.0),
    )


def vehicle_of_file(fit: Fit, vehicle: Vehicle, folder: Path) -> Vehicle:
    """Return the vehicle with meaningful digits, after a check that its file, when it is read, is the fit.

    Rounding keeps each value within its interval, and J, which very exact data change with the seventh digit. Both J
    are computed with the same steps of the filter, because those on the way to the minimum may have been others. The
    drag is that of the file. Raises RuntimeError: this program is wrong then.
    """
    top = Path(commonpath([folder.resolve(), *(path.resolve().parent for path in vehicle.files)]))
    objective, least = fit.file.objective, fit.file.minimum
    near = copy(objective)
    near.table = objective.table.of_file(least.z, fit.speeds)
    of_fit = near.value(least.z, near.runs(least.z, least.runs))
    for digits in _DIGITS:
        short = _rounded(vehicle, digits)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read = read_vehicle(top / "vehicle.toml", vehicle_text(short, top).encode())
        near = objective.with_thrusters(read.layout.thrusters)
        near.table = near.table.of_vehicle(read)
        rise = near.value(least.z, near.runs(least.z, least.runs)) - of_fit
        if abs(rise) < _SAME:
            return short
    raise RuntimeError(f"{folder}: J of the vehicle file differs by {rise:.3g} from that of the fit")


def _rounded(vehicle: Vehicle, digits: int) -> Vehicle:
    def short(value: float) -> float:
        return float(f"{value:.{digits}g}")

    def ends(interval: tuple[float, float]) -> tuple[float, float]:
        return short(interval[0]), short(interval[1])

    def estimate(row: Estimated) -> Estimated:
        correlation = {other: r for other, value in row.correlation.items() if (r := round(value, digits))}
        return Estimated(error=short(row.error), correlation=correlation)

    def vector(one: SourcedVector | None) -> Any:
        if one is None or not one.source.endswith(ADAPTED):
            return one
        x, y, z = map(short, one.value)
        return SourcedVector((x, y, z), one.source)

    thrusters = (
        replace(t, direction=vector(t.direction), position=vector(t.position)) for t in vehicle.layout.thrusters
    )
    return replace(
        vehicle,
        layout=replace(vehicle.layout, thrusters=tuple(thrusters)),
        coefficients={name: short(value) for name, value in vehicle.coefficients.items()},
        command_range=ends(vehicle.command_range),
        basis={
            name: Basis(one.source, one.interval and ends(one.interval), one.estimate and estimate(one.estimate))
            for name, one in vehicle.basis.items()
        },
    )


def _given_the_last(covariance: Array, count: int) -> Array:
    """Return the covariance of the first numbers, given the values of the others.

    The vehicle file has these others without an error. Drag that shares the error of a thrust curve must not be drawn
    with this error beside a curve that stays.
    """
    first, last = slice(count), slice(count, None)
    regression = covariance[first, last] @ np.linalg.pinv(covariance[last, last], hermitian=True)
    conditional = covariance[first, first] - regression @ covariance[last, first]
    np.fill_diagonal(conditional, np.maximum(np.diag(conditional), 0.0))
    return conditional


METHOD = (
    "maximum a posteriori by an extended Kalman filter with slow forces and coloured noise (docs/identify-method.md)"
)
_SOURCE = "Identified from the tests, as the method says"


def _in_file(posterior: Posterior, fit: Fit, z: Array) -> dict[str, Any]:
    """Return the coefficients of a vehicle file for the coordinates of the parameters."""
    coefficients = posterior.table.coefficients(z)
    for quadratic in posterior.table.nearest_drags(z, fit.speeds):
        coefficients |= quadratic.coefficients
    return coefficients | {name: posterior.table.base[name] for name in posterior.table.exact}


def _changed(posterior: Posterior, vehicle: Vehicle) -> list[str]:
    """Return the names of the coefficients of the vehicle that the parameters change.

    They move both ways from the means of their priors, because a bound may hide what a parameter does where the fit
    ended: a neutral that is off may leave no dead band.
    """
    table = posterior.table
    sizes = [(n, 0.1 * table.parameters[n].deviation + 0.01) for n in posterior.of_vehicle]
    moves = [(n, sign * size) for n, size in sizes for sign in (1.0, -1.0)]
    values = table.coefficients(changed(table.each("mean"), moves))
    return [name for name in vehicle.coefficients if name in values and np.ptp(values[name]) > 0.0]


@dataclass(frozen=True, eq=False)
class _Numbers:
    """Some coefficients of a vehicle file by a posterior."""

    values: Array
    covariance: Array
    prior: Array
    """Their covariance by the prior."""


def _numbers(posterior: Posterior, fit: Fit, names: Sequence[str]) -> _Numbers:
    """Return some coefficients of a vehicle file.

    Drag with another power differs from that of the file by a misfit, which is uncertain, too. The covariance of a_d
    and b_d contains it: the mean variance of the drag grows by the mean square of the misfit.
    """

    def measured(z: Array) -> list[Quadratic]:
        drags = posterior.table.nearest_drags(z, fit.speeds)
        return [one for one in drags if {*one.coefficients} <= {*names}]

    def values(z: Array) -> Array:
        coefficients, misfits = _in_file(posterior, fit, z), [one.misfit for one in measured(z)]
        return np.vstack([*(np.broadcast_to(coefficients[name], z.shape[1]) for name in names), *misfits])

    means, covariance, prior = posterior.numbers(values)
    first, own = len(names), slice(len(names))
    for quadratic in measured(posterior.z[:, None]):
        here = slice(first, first := first + len(quadratic.misfit))
        indices = [names.index(name) for name in quadratic.coefficients]
        mean_square = float(np.mean(means[here] ** 2 + np.diag(covariance[here, here])))
        covariance[np.ix_(indices, indices)] += quadratic.covariance(mean_square)
    return _Numbers(means[own], covariance[own, own], prior[own, own])


def _layout(tests: Tests, fit: Fit) -> Layout:
    """Return the layout without the effects that are absent, and with the surface of the base where it can be."""
    file = fit.file.posterior
    table = file.table
    parameters = [p for n, p in enumerate(table.parameters) if n not in file.absent]
    present = {(p.kind, p.of) for p in parameters}
    lasting = {key for p in parameters if p.of_kind.is_in_all for key in p.of_kind.keys}
    base, given = tests.base, tests.description.known
    coefficients: dict[str, float] = table.coefficients(file.z)

    def has(part: Part, key: str) -> bool:
        if isinstance(part, Curve) and part.name in table.known.own_curves:
            shared = table.layout.curves_by_name[table.known.own_curves[part.name][0]]
            ahead = key.removesuffix(REVERSE)
            # The ratio of the thrust astern is one of d, too: where the others have one d both ways, this one has two.
            return key in part.keys and (ahead in OWN_KEYS or has(shared, ahead if ahead == "d" else key))
        name = part.coefficient(key)
        if key not in part.keys or name in given:
            return key in part.keys
        if key in ("V_0", "n_V"):
            return with_voltage
        if key not in lasting and coefficients[name] == ABSENT.get(key.removesuffix(REVERSE)):
            return False
        effects = {effect: kind.keys for effect, kind in EFFECTS.items() if key in kind.keys}
        if not key.endswith(REVERSE) or not effects:
            return True
        _, of, _ = table.layout.keys_in_file[name]
        others = {part.name_of(other) for keys in effects.values() for other in keys}
        return not (others.isdisjoint(base) and present.isdisjoint((effect, of) for effect in effects))

    layout = table.layout
    exponents = (coefficients[c.coefficient("n_V")] for c in layout.curves if "n_V" in c.keys)
    with_voltage = tests.layout.voltage is not None or any(n > 0.0 for n in exponents)
    kept, own = layout.with_keys(has), tests.layout
    written = replace(
        kept,
        axes=tuple(form for form in kept.axes if own.has(form.axis)),
        coupled=layout.coupled and all(map(own.has, COUPLED_AXES)),
        curves=tuple(curve if curve.has_lag else replace(curve, lag="force") for curve in kept.curves),
        thrusters=table.thrusters_in_file(file.z),
        is_uncertain=False,
        restoring=tuple(key for key in layout.restoring if key in base or coefficients[key]),
        voltage=layout.voltage if with_voltage else None,
        mix=own.mix,
        waves=tests.description.layout.waves,
    )
    surfaced = replace(written, surface=tests.description.layout.surface)
    return written if any(check_surface(surfaced)) else surfaced


def _data(fit: Fit) -> str:
    """Return what the vehicle was identified from, in words. The pieces of a dive between rests are one log."""
    logs = [one.log for one in fit.objective.logs]
    dives = len({log.whole_file for log in logs if not log.follows_axis})
    parts = ["a dive log" if dives == 1 else f"{dives} dive logs"] if dives else []
    if fit.objective.rows or any(log.follows_axis for log in logs):
        parts.insert(0, "tank tests")
    return " and ".join(parts) or "given values"


def _coefficients(
    fit: Fit, vehicle: Vehicle, changed: Sequence[str], numbers: Sequence[_Numbers]
) -> Iterator[IdentifiedCoefficient]:
    """Yield the coefficients that the fit changes, with intervals where the tests determine them.

    They come first among the `numbers` by the posteriors.
    """
    began = _in_file(fit.posterior, fit, np.array([p.mean for p in fit.posterior.table.parameters]))
    for n, name in enumerate(changed):
        error, before = (float(np.sqrt(C[n, n])) for C in (numbers[-1].covariance, numbers[-1].prior))
        told = error / before if before > 0.0 else 0.0
        declaration, value = vehicle.layout.coefficients[name], vehicle[name]
        interval = _interval(vehicle, name, n, numbers) if told <= _TOLD and error > 0.0 else None
        unit = "" if declaration.unit == "1" else f" {declaration.unit}"
        centre, _, _ = with_interval(began[name], (began[name] - before, began[name] + before))
        yield IdentifiedCoefficient(
            name, value, interval, declaration.unit, f"{float(centre):g} ± {before:.2g}{unit}", told
        )


def _interval(vehicle: Vehicle, name: str, index: int, numbers: Iterable[_Numbers]) -> Interval:
    """Return the smallest interval of a coefficient with the 95 % intervals of all posteriors, within its bounds."""
    declaration, key = vehicle.layout.coefficients[name], vehicle.layout.keys_in_file[name][-1]
    least = EXACT_BAND / QUANTILE if key in _DEAD_BAND else 0.0
    positive = declaration.minimum >= 0.0 and key not in ("T", *_DEAD_BAND)
    ends = [
        around(one.values[index], max(one.covariance[index, index] ** 0.5, least), positive=positive) for one in numbers
    ]
    low, high = hull((vehicle[name], vehicle[name]), *ends)
    return float(max(low, declaration.minimum)), float(min(high, declaration.maximum))


# ---- The ranges of the tests -----------------------------------------------------------------------------------------


def tested_ranges(identification: Identification) -> Iterator[Range]:
    """Yield the range of the commands, and those of each velocity, of roll and pitch and of the depth in the tests.

    The ends have three digits, and an end that is next to nothing is no range.
    """
    used = (c for log in identification.folder.logs for c in log.channels if not c.unused)
    ends_of = [
        (name, float(np.nanquantile(channel.values, share)))
        for channel in used
        if (name := _variable(channel.quantity))
        for share in _WITHOUT_OUTLIERS
    ]
    steady = ((one.axis, p) for one in identification.axes for p in one.points if p.quantity == "V_ss")
    ends_of += [(axis.velocity, p.measured) for axis, p in steady]
    found = grouped(ends_of).items()
    ranges = {name: tuple(float(f"{end:.3g}") for end in (min(ends), max(ends))) for name, ends in found}
    if some := {name: ends for name, ends in ranges.items() if max(map(abs, ends)) >= LEAST_RANGE}:
        yield Range(EVERY_COMMAND, 0.0, identification.vehicle.command_range[1])
        yield from (Range(name, *some[name]) for name in UNIT_OF_RANGE if name in some)


def _variable(quantity: MeasuredQuantity) -> str:
    """Return the variable of the FMU that a sensor measures, if its range tells where the vehicle was identified."""
    if quantity.axis is None:
        return ""
    return quantity.axis.velocity if quantity.is_velocity else _POSITIONS.get(quantity.axis, "")


_POSITIONS = {HEAVE: "z", ROLL: "phi", PITCH: "theta"}
"""The variables of the depth and of the angles from the level."""
