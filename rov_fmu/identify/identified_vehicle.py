"""The vehicle of a fit, with the sources, intervals and correlations of its coefficients."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rov_fmu import __version__
from rov_fmu.equation.catalogue import REVERSE
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, Part, VehicleAxis
from rov_fmu.identify.beginning import Tests
from rov_fmu.identify.given import GivenVehicle
from rov_fmu.identify.likelihood.curves import Quadratic, nearest
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.objective import changed
from rov_fmu.identify.likelihood.parameters import LEAST_LAG
from rov_fmu.identify.likelihood.posterior import QUANTILE, around
from rov_fmu.identify.result import Coefficient, Interval
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.description import Provenance
from rov_fmu.vehicle.schema import NOT_GIVEN, UNTUNED, Estimated
from rov_fmu.vehicle.uncertainty import NORMAL
from rov_fmu.vehicle.vehicle import Vehicle

_DEAD_BAND = ("c_0", f"c_0{REVERSE}")
"""The keys of dead bands."""
_DIGITS = 6
"""The significant digits of the numbers of a result, and the decimals of correlations, which may be very close to 1.
They are more than any test gives, but few enough to be equal on every machine."""
_TOLD = 0.8
"""A coefficient is identified where its standard error is at most this share of that of its prior."""
EXACT_BAND = 0.01
"""A dead band is never claimed to better than this command: thrust begins gradually."""


def identified_vehicle(tests: Tests, fit: Fit) -> tuple[Vehicle, dict[str, Coefficient]]:
    """Return the vehicle with its sources, intervals and correlations, and the coefficients that the fit changes.

    These have intervals where the tests determine them.
    """
    given, kept = tests.given, fit.kept
    layout = _layout(tests, fit)
    values = {name: float(value) for name, value in _in_file(fit, kept.z).items()}
    values |= {  # a file has no smaller exponent
        c.coefficient("n_V"): max(values[c.coefficient("n_V")], 1.0) for c in layout.curves if "n_V" in c.keys
    }
    rov = Vehicle(layout, {name: values.get(name, given.base.get(name, 1.0)) for name in layout.coefficients})
    known = {name: q for name, q in given.known.items() if name in layout.coefficients}
    changed = _changed(fit, rov)
    coefficients = {one.name: one for one in _coefficients(fit, rov, changed)}
    identified = {name: one.interval for name, one in coefficients.items() if one.interval}
    sources = dict.fromkeys(layout.coefficients, NOT_GIVEN) | {name: q.source for name, q in known.items()}
    base = given.description.base_quantities
    sources |= {name: base[name].source for name in layout.coefficients if name in base and name not in known}
    for curve in (c for c in layout.curves if "n_V" in c.keys):
        asked = given.description.tables.known.get(curve.coefficient("V_0"))
        reference = asked.source if asked else layout.voltage_source
        for key, source in (("V_0", reference), ("n_V", "The usual exponent, which [priors] takes as exact")):
            if sources[curve.coefficient(key)] == NOT_GIVEN:
                sources[curve.coefficient(key)] = source
    intervals = {name: q.interval for name, q in known.items() if q.interval}
    estimates: dict[str, Estimated] = {}
    names = [name for name in changed if name in identified or name in intervals]
    for name in changed:
        sources[name] = _SOURCE if name in identified else f"{sources[name]}; adapted to the tests"
        if name not in names:
            sources[name] = "Assumed: the tests do not determine it"
    if names:
        held = [  # a file without a dead band has an exact one of 0
            name
            for name, (*_, key) in fit.known.layout.keys_in_file.items()
            if name not in names and (name in changed or key in _DEAD_BAND)
        ]
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
                correlation=others,
            )
    validity = given.description.tables.validity
    made = Provenance(tool=f"rov-fmu {__version__} identify", method=METHOD, hash="SHA3-256", inputs=dict(tests.inputs))
    vehicle = replace(
        rov,
        **dict(given.head),
        sources=sources,
        command_range=validity.command_range if validity else fit.command_range,
        alternatives={},
        data=None,
        limits=given.description.limits,
        intervals=intervals,
        estimates=estimates,
        provenance=made,
        measured_from=_data(fit),
    )
    return vehicle, coefficients


def with_own_inputs(vehicle: Vehicle, given: GivenVehicle) -> Vehicle:
    """Return the vehicle of the file: in place of the forces of a wrench, it has the thrusters of rov.toml.

    Without these, its inputs are the loads from outside, X_ext ... Other vehicles are returned as they are. The curves
    of the thrusters are those of rov.toml and hold for all commands, unless its [validity] says otherwise.
    """
    if not vehicle.layout.has_wrench:
        return vehicle
    own, tables = given.thrusters or Layout((), (), ()), given.description.tables
    layout = replace(vehicle.layout, curves=own.curves, thrusters=own.thrusters, mix=own.mix)
    kept, places = layout.coefficients, layout.keys_in_file
    thrust = {
        name: quantity
        for name, quantity in tables.quantities(layout).items()
        if quantity and places[name][0] in ("arm", "curves")
    }
    vehicle = vehicle.with_(layout)
    numbers = {**dict.fromkeys(kept, UNTUNED), **vehicle.coefficients}
    sources = {**dict.fromkeys(kept, NOT_GIVEN), **vehicle.sources}
    return replace(
        vehicle,
        coefficients=numbers | {name: quantity.value for name, quantity in thrust.items()},
        sources=sources | {name: quantity.source for name, quantity in thrust.items()},
        intervals={**vehicle.intervals, **{name: q.interval for name, q in thrust.items() if q.interval}},
        command_range=vehicle.command_range if tables.validity else (0.0, 1.0),
    )


def rounded(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with meaningful digits. Rounding keeps each value within its interval."""

    def short(value: float) -> float:
        return float(f"{value:.{_DIGITS}g}")

    low, high = vehicle.command_range
    return replace(
        vehicle,
        coefficients={name: short(value) for name, value in vehicle.coefficients.items()},
        command_range=(short(low), short(high)),
        intervals={name: (short(low), short(high)) for name, (low, high) in vehicle.intervals.items()},
        estimates={
            name: Estimated(
                error=short(row.error),
                correlation={other: r for other, value in row.correlation.items() if (r := round(value, _DIGITS))},
            )
            for name, row in vehicle.estimates.items()
        },
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


def _in_file(fit: Fit, z: Array) -> dict[str, Any]:
    """Return the coefficients of the vehicle file for the coordinates of the parameters."""
    table = fit.kept.table
    coefficients = table.coefficients(z)
    for one in _quadratics(fit, z):
        coefficients |= one.coefficients
    return coefficients | {name: table.base[name] for name in table.exact}


def _quadratics(fit: Fit, z: Array) -> Iterator[Quadratic]:
    """Yield the curves of the file for those that bend. A file has no shapes of curves: it has the nearest ones."""
    table, (low, high) = fit.kept.table, fit.command_range
    vehicle, shapes = table.model(z)
    for curve in fit.known.curves:
        if curve.name in shapes.of:
            bands = shapes.dead_bands[curve.name]
            yield from nearest(curve, partial(shapes.forces, vehicle, curve), bands, low, high)


def _changed(fit: Fit, vehicle: Vehicle) -> list[str]:
    """Return the names of the coefficients of the vehicle that the parameters change."""
    parameters = fit.posterior.table.parameters
    moves = [(n, 0.1 * parameters[n].deviation + 0.01) for n in fit.posterior.of_vehicle]
    values = _in_file(fit, changed(fit.posterior.z, [(0, 0.0), *moves]))
    return [name for name in vehicle.coefficients if np.ptp(values[name]) > 0.0]


def _numbers(fit: Fit, names: Sequence[str]) -> tuple[Array, Array, Array]:
    """Return some coefficients of the vehicle file, their covariance, and their covariance by the prior.

    The forces of a measured curve that bends differ from those of the file by a misfit, which is uncertain, too. The
    covariance of a_t and b_t contains it: the mean variance of the forces grows by the mean square of the misfit. The
    scale of the forces of other curves is an assumption, whose error is much larger than their misfit.
    """

    def measured(z: Array) -> list[Quadratic]:
        some = (one for one in _quadratics(fit, z) if one.curve.name in fit.known.measured_curves)
        return [one for one in some if {*one.coefficients} <= {*names}]

    def values(z: Array) -> Array:
        coefficients, misfits = _in_file(fit, z), [one.misfit for one in measured(z)]
        return np.vstack([*(np.broadcast_to(coefficients[name], z.shape[1]) for name in names), *misfits])

    found, covariance, prior = fit.averaged.numbers(values)
    first, own = len(names), slice(len(names))
    for one in measured(fit.averaged.z[:, None]):
        here = slice(first, first := first + len(one.misfit))
        places = [names.index(name) for name in one.coefficients]
        mean_square = float(np.mean(found[here] ** 2 + np.diag(covariance[here, here])))
        covariance[np.ix_(places, places)] += one.covariance(mean_square)
    return found[own], covariance[own, own], prior[own, own]


def _layout(tests: Tests, fit: Fit) -> Layout:
    """Return the layout without the effects that are absent."""
    table = fit.kept.table
    present = {(p.kind, p.of) for n, p in enumerate(table.parameters) if n not in fit.posterior.absent}
    base, own = tests.given.base, tests.given.description.known
    coefficients: dict[str, float] = table.coefficients(fit.kept.z)

    def has(part: Part, key: str) -> bool:
        name = part.coefficient(key)
        if key not in part.keys or name in own:
            return key in part.keys
        value = coefficients[name]
        by_value = {"V_0": with_voltage, "n_V": with_voltage, "F_0": value != 0.0, "T": value != LEAST_LAG}
        by_value |= dict.fromkeys(("d", f"d{REVERSE}"), value > 0.0)
        if key in by_value:
            return by_value[key]
        if isinstance(part, Curve) and key in _DEAD_BAND:
            is_kept = key == "c_0" or name in base or ("dead band astern", part.name) in present
            return is_kept and value > 0.0
        if isinstance(part, VehicleAxis) and key.endswith(REVERSE):
            return name in base or ("drag astern", part.axis.name) in present
        if isinstance(part, Curve) and key in (f"a_t{REVERSE}", f"b_t{REVERSE}"):
            is_measured = name in tests.given.known or fit.known.measured_curves.get(part.name, False)
            return name in base or is_measured or ("reverse thrust", part.name) in present
        return True

    layout = table.layout
    exponents = (coefficients[c.coefficient("n_V")] for c in layout.curves if "n_V" in c.keys)
    with_voltage = tests.given.vehicle.layout.voltage is not None or any(n > 0.0 for n in exponents)
    return replace(
        layout.with_keys(has),
        voltage=layout.voltage if with_voltage else None,
        mix=tests.given.vehicle.layout.mix,
        pulse=tests.given.vehicle.layout.pulse,
        has_dead_time=tests.given.vehicle.layout.has_dead_time,
    )


def _data(fit: Fit) -> str:
    """Return what the vehicle was identified from, in words."""
    dives = sum(not one.log.follows_axis for one in fit.objective.logs)
    parts = ["a dive log" if dives == 1 else f"{dives} dive logs"] if dives else []
    if fit.objective.rows or dives < len(fit.objective.logs):
        parts.insert(0, "tank tests")
    return " and ".join(parts) or "given values"


def _coefficients(fit: Fit, vehicle: Vehicle, changed: Sequence[str]) -> Iterator[Coefficient]:
    """Yield the coefficients that the fit changes, with intervals where the tests determine them."""
    if not changed:
        return
    _, covariance, prior = _numbers(fit, changed)
    began = _in_file(fit, np.array([p.mean for p in fit.posterior.table.parameters]))
    for n, name in enumerate(changed):
        error, before = float(np.sqrt(covariance[n, n])), float(np.sqrt(prior[n, n]))
        told = error / before if before > 0.0 else 0.0
        declaration, value = vehicle.layout.coefficients[name], vehicle[name]
        interval = _interval(vehicle, name, error) if told <= _TOLD and error > 0.0 else None
        unit = "" if declaration.unit == "1" else f" {declaration.unit}"
        yield Coefficient(name, value, interval, declaration.unit, f"{began[name]:.4g} ± {before:.2g}{unit}", told)


def _interval(vehicle: Vehicle, name: str, error: float) -> Interval:
    """Return the 95 % interval of a coefficient within its bounds."""
    declaration, key = vehicle.layout.coefficients[name], vehicle.layout.keys_in_file[name][-1]
    if key in _DEAD_BAND:
        error = max(error, EXACT_BAND / QUANTILE)
    low, high = around(vehicle[name], error, positive=declaration.minimum >= 0.0 and key not in ("T", *_DEAD_BAND))
    return max(low, declaration.minimum), min(high, declaration.maximum)
