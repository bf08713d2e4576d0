"""Whether what a vehicle file says makes sense as a vehicle: a line for everything that does not."""

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
from rov_fmu.vehicle.geometry import coincidences, geometry, mixed, places
from rov_fmu.vehicle.quantity import Quantity, within
from rov_fmu.vehicle.schema import Hardware, Parts, given

_Form = TypeVar("_Form", bound=Hardware)
_PARTS = ("curves", "thruster", "axes", "inputs", "alternatives", "estimates", "known", "windows")
"""Tables of tables: where one of them has a mistake the others can still be judged."""


def readable_parts(
    data: Toml, problems: Sequence[ErrorDetails], context: Mapping[str, object], form: type[_Form]
) -> tuple[_Form, set[str]]:
    """The file without the tables that have a mistake of form, and the names of the top tables that have one."""
    parts: dict[str, Any] = dict(data)
    wrong: dict[str, set[int | str | None]] = {}
    for place in (problem["loc"] for problem in problems):
        wrong.setdefault(str(place[0]), set()).add(place[1] if len(place) > 1 else None)
    for name, bad in wrong.items():
        table = parts.pop(name, None)
        if name in _PARTS and None not in bad:
            if isinstance(table, list):
                parts[name] = [entry for n, entry in enumerate(table) if n not in bad]
            elif isinstance(table, dict):
                parts[name] = {key: entry for key, entry in table.items() if key not in bad}
    readable, _ = validate(parts, form, **context)
    assert readable is not None, "all that has a mistake is left out"
    return readable, {*wrong}


def check_parts(parts: Parts, lost: set[str], data: Toml) -> Iterator[str]:
    """A line for all that makes no sense; what needs a table that has a mistake is not judged."""
    named = [*_names(parts, lost, data)]
    yield from named
    yield from _keys(parts)
    yield from _needs(parts, lost)
    if lost & {"thruster", "axes", "inputs"} or not parts.axis_tables:
        return
    layout = parts.layout
    placed = [*places(layout), *_lever(parts, layout)]
    yield from placed or geometry(layout)
    if not (placed or named):
        yield from mixed(layout)
    coupled = [*_coupling(parts, layout)]
    yield from coupled
    if not (named or coupled or lost & {"curves", "arm", "body"}):
        yield from coincidences(layout)
        for title, alternative in parts.alternatives.items():
            yield from check_quantities(f"alternatives.{title}", alternative.quantities, layout.coefficients)
        if "estimates" not in lost:
            yield from _estimates(parts, layout)


def check_names_and_keys(parts: Hardware, lost: set[str], data: Toml) -> Iterator[str]:
    """A line for names that are none or double, and for keys that need others, whether or not all of it is given."""
    yield from _names(parts, lost, data)
    yield from _keys(parts)


# ---- Names and keys --------------------------------------------------------------------------------------------------


def _names(parts: Hardware, lost: set[str], data: Toml) -> Iterator[str]:
    """Of thrusters, curves and inputs."""
    entries = data["thruster"] if isinstance(data.get("thruster"), list) else []
    found = [(n, entry) for n, entry in enumerate(entries) if isinstance(entry, dict)]
    named = [(n, entry["name"]) for n, entry in found if isinstance(entry.get("name"), str)]
    yield from _alike("thruster", [(f"#{n + 1}", name) for n, name in named])
    curves = list(data["curves"]) if isinstance(data.get("curves"), dict) else []
    yield from _alike("curves", [(f".{name}", name) for name in curves])
    yield from _alike("inputs", [(f".{name}", name) for name in parts.inputs])
    for n, entry in found:
        if curves and isinstance(curve := entry.get("curve"), str) and curve not in curves:
            reason = f"there is no such curve, only {join_names(curves)}{did_you_mean(curve, curves)}"
            yield key_line(f"{entry_label('thruster', entries, n)}.curve", reason, curve)
    if "thruster" in lost:
        return
    for name in parts.curves:
        if name not in {thruster.curve for thruster in parts.thruster}:
            yield key_line(f"curves.{name}", "no thruster has this curve")
    if "inputs" not in lost:
        yield from _gains(parts.inputs, [name for _, name in named])


def _alike(table: str, names: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Names that one before has too, but for upper and lower case."""
    before: dict[str, tuple[str, str]] = {}
    for key, name in names:
        first, other = before.setdefault(name.casefold(), (key, name))
        if key != first:
            alike = "this name" if other == name else f"the name {shown(other)}: they differ only in case"
            yield key_line(f"{table}{key}{'.name' if table == 'thruster' else ''}", f"{table}{first} has {alike}", name)


def _gains(inputs: Mapping[str, Mapping[str, float]], names: Sequence[str]) -> Iterator[str]:
    """Inputs that drive what is not there, or nothing; and only where there are none, thrusters that none drives."""
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
    for name in names if inputs and not wrong else ():
        if not any(gains.get(name) for gains in inputs.values()):
            yield key_line(f"inputs: no input drives the thruster {name}", "give a gain other than 0 in one of them")


def _keys(parts: Hardware) -> Iterator[str]:
    """Keys that need others."""
    for name, curve in parts.curves.items():
        quantities = given(curve, CURVE)
        yield from (lame := [*_pairs(f"curves.{name}", quantities)])
        if not lame and {"a_t", "b_t"} <= quantities.keys():
            form = Curve(name, tuple(quantities))
            values = {form.coefficient(key): q.value for key, q in quantities.items()}
            yield from no_thrust(form, values, f"curves.{name}")
        if curve.c_0_reverse and not curve.c_0:
            yield key_line(f"curves.{name}.c_0", "this key is missing, and c_0_reverse is there")
    for axis, table in parts.axis_tables.items():
        yield from _pairs(f"axes.{axis.name}", given(table, AXIS))


def _needs(parts: Parts, lost: set[str]) -> Iterator[str]:
    """Tables that others need, or that have no use."""
    if "axes" in lost:
        return
    if not parts.axis_tables:
        yield key_line("axes", "must have at least one of surge, sway, heave, yaw")
        return
    if parts.body:
        yield from _needed("body", parts.body, BODY, {axis.inertia: axis for axis in reversed(parts.axis_tables)})
    if "thruster" not in lost and "arm" not in lost:
        turned = {key: YAW for key in ARM if parts.layout.has_arm}
        if parts.arm:
            yield from _needed("arm", parts.arm, ARM, turned)
        elif turned:
            yield key_line("arm", "this table with R and gamma is missing, and a thruster says arm")


def _pairs(table: str, keys: Mapping[str, Quantity]) -> Iterator[str]:
    """a and b in reverse come together."""
    for one, other in (("a_t", "b_t"), ("b_t", "a_t"), ("a_d", "b_d"), ("b_d", "a_d")):
        if one + REVERSE in keys and other + REVERSE not in keys:
            yield key_line(f"{table}.{other}{REVERSE}", f"this key is missing, and {one}{REVERSE} is there")


def no_thrust(curve: Curve, values: Mapping[str, float], place: str) -> Iterator[str]:
    """A line where full command gives no thrust its way, as coefficients of the wrong sign do."""
    for end in ("", REVERSE) if any(key.endswith(REVERSE) for key in curve.keys) else ("",):
        a_t, b_t, c_0 = (curve.coefficient(key + end) for key in ("a_t", "b_t", "c_0"))
        m = 1.0 - values.get(c_0, 0.0)
        if (force := (values[a_t] * m + values[b_t]) * m) <= 0.0:
            where_to = " in reverse" if end else ""
            reason = f"must give a force above 0 at full command{where_to}, but {a_t} and {b_t} give {force:g} N"
            yield key_line(place, reason)


def _needed(
    name: str, table: Strict, kinds: Mapping[str, CoefficientKind], needed: Mapping[str, Axis]
) -> Iterator[str]:
    has = given(table, kinds)
    for key in kinds:
        if key in needed and key not in has:
            yield key_line(f"{name}.{key}", f"this key is missing, and the vehicle has {needed[key].name}")
        elif key in has and key not in needed:
            yield key_line(f"{name}.{key}", "nothing of this vehicle needs it")


# ---- Arm, coupling, coefficients -------------------------------------------------------------------------------------


def _lever(parts: Parts, layout: Layout) -> Iterator[str]:
    """The arm, where there is one."""
    if layout.has_arm and parts.arm and parts.arm.R and parts.arm.gamma:
        for name, lever in (("R", parts.arm.R.value), ("gamma", sin(parts.arm.gamma.value))):
            if lever == 0.0:
                yield key_line(f"arm.{name}.value", "must be more than 0, or the arm R sin γ is none", lever)


def _coupling(parts: Parts, layout: Layout) -> Iterator[str]:
    """Whether what is coupled is there, and has a finite inertia."""
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


def _estimates(parts: Parts, layout: Layout) -> Iterator[str]:
    """Estimates of what the vehicle does not have or nothing is estimated of, and correlations that cannot be."""
    wrong, found, rows = False, parts.quantities(layout), parts.estimates
    for name, row in rows.items():
        key, quantity = f"estimates.{name}", found.get(name)
        reasons = []
        if name not in found:
            reasons.append(key_line(key, f"there is no such coefficient of this vehicle{did_you_mean(name, found)}"))
        elif not (quantity and quantity.interval):
            reasons.append(key_line(key, f"{name} has no interval, so it is no estimate"))
        for other, value in row.correlation.items():
            reason = "of a coefficient with itself is 1 and is not given" if other == name else ""
            if other not in rows:
                reason = reason or f"there is no such coefficient in this table{did_you_mean(other, rows)}"
            if reason or (name in rows[other].correlation and list(rows).index(name) > list(rows).index(other)):
                reason = reason or f"estimates.{other} gives it already"
                reasons.append(key_line(f"{key}.correlation.{other}", reason, value))
        wrong |= bool(reasons)
        yield from reasons
    if not wrong and any(row.correlation for row in rows.values()):
        from rov_fmu.vehicle.uncertainty import LEAST_EIGENVALUE, least_eigenvalue  # NumPy, which few files need

        if (least := least_eigenvalue(rows)) < LEAST_EIGENVALUE:
            yield key_line(
                "estimates", f"no numbers have these correlations: the least eigenvalue is {least:.3g}, not 0"
            )


def check_quantities(table: str, found: Mapping[str, Quantity], metas: Mapping[str, Declaration]) -> Iterator[str]:
    """Coefficients by name that the vehicle does not have, or in another unit, or out of bounds."""
    for name, quantity in found.items():
        key = f"{table}.{name}"
        if (meta := metas.get(name)) is None:
            yield key_line(key, f"there is no such coefficient of this vehicle{did_you_mean(name, metas)}")
            continue
        if quantity.unit != meta.unit:
            yield key_line(f"{key}.unit", f"must be {meta.unit!r}", quantity.unit)
        try:
            within(quantity.value, meta)
        except ValueError as error:
            yield key_line(f"{key}.value", str(error), quantity.value)
