"""Checks whether the tables of a vehicle file describe a vehicle; each mistake gives one line."""

from collections.abc import Iterator, Mapping, Sequence
from math import sin
from typing import Any, TypeVar

from pydantic_core import ErrorDetails

from rov_fmu.io.messages import did_you_mean, shown
from rov_fmu.io.toml_file import Strict, Toml, entry_label, join_names, key_line, validate
from rov_fmu.model.layout import (
    ARM,
    AXIS,
    BODY,
    CURVE,
    LEAST_BETA,
    REVERSE,
    SURGE,
    SWAY,
    YAW,
    Axis,
    CoefficientKind,
    Curve,
    Declaration,
    Layout,
)
from rov_fmu.vehicle.geometry import check_axes, check_inputs, check_thruster_places, check_variable_names
from rov_fmu.vehicle.quantity import Quantity, within
from rov_fmu.vehicle.schema import Estimated, Hardware, Parts, given_quantities

_Model = TypeVar("_Model", bound=Hardware)
_TABLES_OF_TABLES = ("curves", "thruster", "axes", "inputs", "alternatives", "estimates", "known", "windows")
"""If an entry of one of these tables has a mistake, the other entries can still be checked."""


def readable_parts(
    data: Toml, problems: Sequence[ErrorDetails], context: Mapping[str, object], model: type[_Model]
) -> tuple[_Model, set[str]]:
    """Return the file without the tables that have a mistake of form, and the names of its top tables that have one."""
    parts: dict[str, Any] = dict(data)
    wrong: dict[str, set[int | str | None]] = {}
    for place in (problem["loc"] for problem in problems):
        wrong.setdefault(str(place[0]), set()).add(place[1] if len(place) > 1 else None)
    for name, wrong_entries in wrong.items():
        table = parts.pop(name, None)
        if name in _TABLES_OF_TABLES and None not in wrong_entries:
            if isinstance(table, list):
                parts[name] = [entry for n, entry in enumerate(table) if n not in wrong_entries]
            elif isinstance(table, dict):
                parts[name] = {key: entry for key, entry in table.items() if key not in wrong_entries}
    readable, _ = validate(parts, model, **context)
    assert readable is not None, "every table with a mistake is left out"
    return readable, {*wrong}


def check_parts(parts: Parts, lost: set[str], data: Toml) -> Iterator[str]:
    """Yield a line for each mistake. A check that needs one of the `lost` tables, which have a mistake, is left out."""
    wrong_names = [*_check_names(parts, lost, data)]
    yield from wrong_names
    yield from _check_keys(parts)
    yield from _check_needed_tables(parts, lost)
    if lost & {"thruster", "axes", "inputs"} or not parts.axis_tables:
        return
    layout = parts.layout
    wrong_places = [*check_thruster_places(layout), *_check_arm(parts, layout)]
    yield from wrong_places or check_axes(layout)
    if not (wrong_places or wrong_names):
        yield from check_inputs(layout)
    wrong_coupling = [*_check_coupling(parts, layout)]
    yield from wrong_coupling
    if not (wrong_names or wrong_coupling or lost & {"curves", "arm", "body"}):
        yield from check_variable_names(layout)
        for title, alternative in parts.alternatives.items():
            yield from check_quantities(f"alternatives.{title}", alternative.quantities, layout.coefficients)
        if "estimates" not in lost:
            yield from _check_estimates(parts.estimates, parts.quantities(layout))


def check_names_and_keys(parts: Hardware, lost: set[str], data: Toml) -> Iterator[str]:
    """Yield a line for each wrong name, and for each key that needs another key which is missing.

    These checks do not need all the coefficients of the vehicle.
    """
    yield from _check_names(parts, lost, data)
    yield from _check_keys(parts)


# ---- Names and keys --------------------------------------------------------------------------------------------------


def _check_names(parts: Hardware, lost: set[str], data: Toml) -> Iterator[str]:
    """Check the names of thrusters, curves and inputs."""
    entries = data["thruster"] if isinstance(data.get("thruster"), list) else []
    thrusters = [(n, entry) for n, entry in enumerate(entries) if isinstance(entry, dict)]
    names = [(n, entry["name"]) for n, entry in thrusters if isinstance(entry.get("name"), str)]
    yield from _check_distinct([(f"thruster#{n + 1}", name) for n, name in names], ".name")
    curves = list(data["curves"]) if isinstance(data.get("curves"), dict) else []
    yield from _check_distinct([(f"curves.{name}", name) for name in curves])
    yield from _check_distinct([(f"inputs.{name}", name) for name in parts.inputs])
    for n, entry in thrusters:
        if curves and isinstance(curve := entry.get("curve"), str) and curve not in curves:
            reason = f"there is no such curve, only {join_names(curves)}{did_you_mean(curve, curves)}"
            yield key_line(f"{entry_label('thruster', entries, n)}.curve", reason, curve)
    if "thruster" in lost:
        return
    used = {thruster.curve for thruster in parts.thruster}
    for name in parts.curves:
        if name not in used:
            yield key_line(f"curves.{name}", "no thruster has this curve")
    if "inputs" not in lost:
        yield from _check_gains(parts.inputs, [name for _, name in names])


def _check_distinct(names: Sequence[tuple[str, str]], key: str = "") -> Iterator[str]:
    """Check that no two names are equal, also without regard to case. Each name follows the label of its table."""
    first_of: dict[str, tuple[str, str]] = {}
    for label, name in names:
        first, other = first_of.setdefault(name.casefold(), (label, name))
        if label != first:
            alike = "this name" if other == name else f"the name {shown(other)}: they differ only in case"
            yield key_line(f"{label}{key}", f"{first} has {alike}", name)


def _check_gains(inputs: Mapping[str, Mapping[str, float]], names: Sequence[str]) -> Iterator[str]:
    """Check that each input drives thrusters that exist; if all do, check that each thruster has an input."""
    wrong = False
    for name, gains in inputs.items():
        for driven in gains:
            if driven not in names:
                reason = f"there is no such thruster, only {join_names(names)}{did_you_mean(driven, names)}"
                yield key_line(f"inputs.{name}.{driven}", reason)
                wrong = True
        if not any(gains.values()):
            yield key_line(f"inputs.{name}", "drives no thruster: give one a gain other than 0")
            wrong = True
    if wrong or not inputs:
        return
    for name in names:
        if not any(gains.get(name) for gains in inputs.values()):
            yield key_line(f"inputs: no input drives the thruster {name}", "give a gain other than 0 in one of them")


def _check_keys(parts: Hardware) -> Iterator[str]:
    """Check that each key of a curve or an axis has the other keys that it needs."""
    for name, curve in parts.curves.items():
        quantities = given_quantities(curve, CURVE)
        unpaired = [*_check_reverse_pairs(f"curves.{name}", quantities)]
        yield from unpaired
        if not unpaired and {"a_t", "b_t"} <= quantities.keys():
            thrust = Curve(name, tuple(quantities))
            values = {thrust.coefficient(key): q.value for key, q in quantities.items()}
            yield from no_thrust(thrust, values, f"curves.{name}")
        if curve.c_0_reverse and not curve.c_0:
            yield key_line(f"curves.{name}.c_0", "this key is missing, and c_0_reverse is there")
    for axis, table in parts.axis_tables.items():
        yield from _check_reverse_pairs(f"axes.{axis.name}", given_quantities(table, AXIS))


def _check_needed_tables(parts: Parts, lost: set[str]) -> Iterator[str]:
    """Check that [body], [arm] and [axes] hold what the vehicle needs, and nothing else."""
    if "axes" in lost:
        return
    if not parts.axis_tables:
        yield key_line("axes", "must have at least one of surge, sway, heave, yaw")
        return
    if parts.body:
        inertias = {axis.inertia: axis for axis in reversed(parts.axis_tables)}
        yield from _check_needed_keys("body", parts.body, BODY, inertias)
    if lost & {"thruster", "arm"}:
        return
    has_arm = parts.layout.has_arm
    if parts.arm:
        yield from _check_needed_keys("arm", parts.arm, ARM, dict.fromkeys(ARM, YAW) if has_arm else {})
    elif has_arm:
        yield key_line("arm", "this table with R and gamma is missing, and a thruster has the key arm")


def _check_reverse_pairs(table: str, keys: Mapping[str, Quantity]) -> Iterator[str]:
    """Check that the quadratic and the linear coefficient in reverse are both given, or neither."""
    for one, other in (("a_t", "b_t"), ("b_t", "a_t"), ("a_d", "b_d"), ("b_d", "a_d")):
        if one + REVERSE in keys and other + REVERSE not in keys:
            yield key_line(f"{table}.{other}{REVERSE}", f"this key is missing, and {one}{REVERSE} is there")


def no_thrust(curve: Curve, values: Mapping[str, float], place: str) -> Iterator[str]:
    """Yield a line for each direction in which full command gives no force, or a force of the wrong sign."""
    has_reverse = any(key.endswith(REVERSE) for key in curve.keys)
    for end in ("", REVERSE) if has_reverse else ("",):
        a_t, b_t, c_0 = (curve.coefficient(key + end) for key in ("a_t", "b_t", "c_0"))
        m = 1.0 - values.get(c_0, 0.0)
        force = (values[a_t] * m + values[b_t]) * m
        if force <= 0.0:
            direction = " in reverse" if end else ""
            reason = f"must give a force above 0 at full command{direction}, but {a_t} and {b_t} give {force:g} N"
            yield key_line(place, reason)


def _check_needed_keys(
    name: str, table: Strict, kinds: Mapping[str, CoefficientKind], needed: Mapping[str, Axis]
) -> Iterator[str]:
    """Check that a table has the coefficients that are needed, each by an axis, and no others."""
    quantities = given_quantities(table, kinds)
    for key in kinds:
        if key in needed and key not in quantities:
            yield key_line(f"{name}.{key}", f"this key is missing, and the vehicle has {needed[key].name}")
        elif key in quantities and key not in needed:
            yield key_line(f"{name}.{key}", "nothing of this vehicle needs it")


# ---- Arm, coupling, coefficients -------------------------------------------------------------------------------------


def _check_arm(parts: Parts, layout: Layout) -> Iterator[str]:
    """Check that the arm R sin γ is not zero."""
    if layout.has_arm and parts.arm and parts.arm.R and parts.arm.gamma:
        for name, factor in (("R", parts.arm.R.value), ("gamma", sin(parts.arm.gamma.value))):
            if factor == 0.0:
                yield key_line(f"arm.{name}.value", "must be more than 0, or the arm R sin γ is none", factor)


def _check_coupling(parts: Parts, layout: Layout) -> Iterator[str]:
    """Check that a coupled vehicle has the axes for it, and that β leaves each of them a finite inertia."""
    if not layout.coupled:
        return
    coupled = (SURGE, SWAY, YAW)
    if missing := [axis.name for axis in coupled if not layout.has(axis)]:
        yield key_line("body.coupling", f"needs surge, sway and yaw; there is no {' and no '.join(missing)}")
        return
    for axis in coupled:
        beta = parts.axis_tables[axis].beta
        if beta and beta.value < LEAST_BETA:
            reason = f"must be at least {LEAST_BETA:g} where axes are coupled"
            yield key_line(f"axes.{axis.name}.beta.value", reason, beta.value)


def _check_estimates(rows: Mapping[str, Estimated], quantities: Mapping[str, Quantity | None]) -> Iterator[str]:
    """Check that each estimate is of a coefficient with an interval, and that the correlations are possible."""
    mistakes = []
    for name, row in rows.items():
        key, quantity = f"estimates.{name}", quantities.get(name)
        if name not in quantities:
            hint = did_you_mean(name, quantities)
            mistakes.append(key_line(key, f"there is no such coefficient of this vehicle{hint}"))
        elif not (quantity and quantity.interval):
            mistakes.append(key_line(key, f"{name} has no interval, so it is no estimate"))
        for other, value in row.correlation.items():
            if reason := _wrong_correlation(name, other, rows):
                mistakes.append(key_line(f"{key}.correlation.{other}", reason, value))
    yield from mistakes
    if mistakes or not any(row.correlation for row in rows.values()):
        return
    from rov_fmu.vehicle.uncertainty import LEAST_EIGENVALUE, least_eigenvalue  # NumPy, which few files need

    if (least := least_eigenvalue(rows)) < LEAST_EIGENVALUE:
        yield key_line(
            "estimates", f"these correlations contradict each other: the least eigenvalue is {least:.3g}, not 0"
        )


def _wrong_correlation(name: str, other: str, rows: Mapping[str, Estimated]) -> str | None:
    """Return why the row of a coefficient cannot give its correlation with the other one, or None if it can."""
    if other == name:
        return "of a coefficient with itself is 1 and is not given"
    if other not in rows:
        return f"there is no such coefficient in this table{did_you_mean(other, rows)}"
    if name in rows[other].correlation and [*rows].index(other) < [*rows].index(name):
        return f"estimates.{other} gives it already"
    return None


def check_quantities(
    table: str, found: Mapping[str, Quantity], declarations: Mapping[str, Declaration]
) -> Iterator[str]:
    """Yield a line for each coefficient that is unknown, has a wrong unit, or is out of its bounds."""
    for name, quantity in found.items():
        key = f"{table}.{name}"
        if (declaration := declarations.get(name)) is None:
            yield key_line(key, f"there is no such coefficient of this vehicle{did_you_mean(name, declarations)}")
            continue
        if quantity.unit != declaration.unit:
            yield key_line(f"{key}.unit", f"must be {declaration.unit!r}", quantity.unit)
        try:
            within(quantity.value, declaration)
        except ValueError as error:
            yield key_line(f"{key}.value", str(error), quantity.value)
