"""Checks that the tables of a vehicle file describe a possible vehicle. Each mistake gives one line."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import sin
from typing import Any

from rov_fmu.equation.catalogue import (
    ARM,
    AXES,
    AXIS,
    BODY,
    BY_VELOCITY,
    COUPLED_AXES,
    CURVE,
    HEAVE,
    LEAST_BETA,
    PITCH,
    REPLACED_BY_TABLE,
    RESTORING,
    REVERSE,
    ROLL,
    SURGE,
    SWAY,
    YAW,
    Axis,
    Declaration,
    cross_declaration,
    cross_name,
    cross_of,
)
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve
from rov_fmu.equation.words import point_declarations
from rov_fmu.io.messages import did_you_mean, listed, only, shown
from rov_fmu.io.toml_file import Strict, Toml, entry_label, join_names, key_line
from rov_fmu.vehicle import schema
from rov_fmu.vehicle.geometry import check_axes, check_inputs, check_thruster_places
from rov_fmu.vehicle.quantity import Quantity, derivative_hint, within
from rov_fmu.vehicle.schema import Body, Estimated, File, Tables, given_quantities


def check_parts(parts: File, lost: set[str], data: Toml) -> Iterator[str]:
    """Yield a line for each mistake.

    `lost` are the tables that could not be read. Checks that need one of them are left out.
    """
    wrong_names = [*_check_names(parts, lost, data)]
    yield from wrong_names
    yield from _check_keys(parts)
    if "curves" not in lost and "battery" not in lost:
        yield from check_tables_of_thrust(parts)
    if "curves" not in lost:
        yield from _check_electric_currents(parts)
    if "axes" not in lost:
        yield from _check_cross(parts)
        for name in parts.validity.stated if parts.validity else ():
            if name not in (names := [axis.name for axis in parts.axis_tables]):
                reason = f"the vehicle has no such axis, only {', '.join(names)}"
                yield key_line(f"validity.stated.{name}", reason)
    yield from _check_needed_tables(parts, lost)
    if lost & {"thruster", "axes", "inputs"} or not parts.axis_tables:
        return
    layout = parts.layout
    wrong_fins = [] if "fin" in lost else [*_check_fins(parts, layout)]
    yield from wrong_fins
    wrong_places = [*check_thruster_places(layout), *_check_arm(parts, layout)]
    yield from wrong_places or check_axes(layout)
    if not (wrong_places or wrong_names):
        yield from check_inputs(layout)
    wrong_coupling = [*_check_coupling(parts, layout)]
    yield from wrong_coupling
    yield from check_surface(layout)
    yield from _check_waves(layout)
    if not (wrong_names or wrong_fins or wrong_coupling or lost & {"curves", "arm", "body"}):
        yield from check_distinct_names(layout)
        for title, alternative in parts.alternatives.items():
            yield from check_quantities(f"alternatives.{title}", alternative.quantities, layout.coefficients)
        if "estimates" not in lost:
            yield from _check_estimates(parts.estimates, parts.quantities(layout))


def check_distinct_names(layout: Layout) -> Iterator[str]:
    """Yield a line about the first coefficient or point with a name in the FMU that another part has.

    Thrust astern of the curve `main`, a_t_main_reverse, has the name of thrust ahead of the curve `main_reverse`. The
    point `B` has the name x_B of the centre of buoyancy, also where a vehicle does not give this.
    """
    places = {f"F_{thruster.name}": f"thruster.{thruster.name}" for thruster in layout.thrusters}
    places |= {layout.curve_of[name].lagging(name): f"thruster.{name}" for name in layout.curve_of}
    places |= {name: f"body.{name}" for name in RESTORING}
    names = [(name, ".".join(keys)) for name, keys, _ in layout.declared]
    for point in layout.points:
        names += [(name, f"point.{point.name}") for part in point_declarations(point) for name in part]
    for name, place in names:
        if (first := places.setdefault(name, place)) != place:
            yield key_line(place, f"has the name {name} in the FMU, which {first} has too: rename one of them")
            return


def check_surface(layout: Layout) -> Iterator[str]:
    """Check that a vehicle with a surface moves up and down, and that its thrust is quadratic there."""
    if layout.surface and not layout.has(HEAVE):
        yield key_line("surface", "the vehicle does not move up and down: give axes.heave, or leave this table out")
    for curve in (curve for curve in layout.curves if layout.surface and curve.has_rotors):
        reason = "must be 'force' with a surface, where thrust by the speed of a rotor is no quadratic"
        yield key_line(f"curves.{curve.name}.lag", reason, curve.lag)


def _check_waves(layout: Layout) -> Iterator[str]:
    """Check that the water's acceleration moves a vehicle in waves, and that its current carries it."""
    if layout.waves and not layout.has(SURGE, SWAY, HEAVE):
        yield key_line("waves", "the vehicle does not move along an axis, so that no wave moves it", True)
    if layout.waves and layout.current_passes:
        reason = 'must be false with current = "passes", which would lose what the water\'s acceleration does'
        yield key_line("waves", reason, True)


def check_names_and_keys(parts: Tables, lost: set[str], data: Toml) -> Iterator[str]:
    """Yield a line for each wrong name, and for each key that needs another key which is missing.

    These checks do not need all the coefficients of the vehicle.
    """
    yield from _check_names(parts, lost, data)
    yield from _check_keys(parts)
    if "axes" not in lost:
        yield from _check_cross(parts)


# ---- Names and keys --------------------------------------------------------------------------------------------------


def _check_names(parts: Tables, lost: set[str], data: Toml) -> Iterator[str]:
    """Check the names of thrusters, curves and inputs."""
    entries = _entries(data, "thruster", list)
    thrusters = [(n, entry) for n, entry in enumerate(entries) if isinstance(entry, dict)]
    names = {f"thruster#{n + 1}": entry["name"] for n, entry in thrusters if isinstance(entry.get("name"), str)}
    yield from _check_distinct([*names.items()], ".name")
    curves = [*_entries(data, "curves", dict)]
    yield from _check_distinct([(f"curves.{name}", name) for name in curves])
    yield from _check_distinct([(f"inputs.{name}", name) for name in parts.inputs])
    yield from _check_distinct([(f"point#{n}", point.name) for n, point in enumerate(parts.point, 1)], ".name")
    for n, entry in thrusters:
        if curves and isinstance(curve := entry.get("curve"), str) and curve not in curves:
            reason = f"there is no such curve{only(curve, curves, join_names(curves))}"
            yield key_line(f"{entry_label('thruster', entries, n)}.curve", reason, curve)
    if "thruster" not in lost:
        yield from _check_use(parts, lost, [*names.values()])


def _entries(data: Toml, key: str, kind: type[Any]) -> Any:
    """Return the list or the table that a file has for a key, or an empty one."""
    entries = data.get(key)
    return entries if isinstance(entries, kind) else kind()


def _check_use(parts: Tables, lost: set[str], thrusters: Sequence[str]) -> Iterator[str]:
    """Check that thrusters have the curves, and that inputs drive the thrusters."""
    used = {thruster.curve for thruster in parts.thruster}
    for name in parts.curves:
        if name not in used:
            yield key_line(f"curves.{name}", "no thruster has this curve")
    if "inputs" not in lost:
        yield from _check_gains(parts.inputs, [*thrusters, *(fin.name for fin in parts.fin)])


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
    mistakes = []
    for name, gains in inputs.items():
        for actuator in gains:
            if actuator not in names:
                reason = f"there is no such thruster{only(actuator, names, join_names(names))}"
                mistakes.append(key_line(f"inputs.{name}.{actuator}", reason))
        if not any(gains.values()):
            mistakes.append(key_line(f"inputs.{name}", "drives no thruster: give one a gain other than 0"))
    yield from mistakes
    for name in names if inputs and not mistakes else ():
        if not any(gains.get(name) for gains in inputs.values()):
            yield key_line(f"inputs: no input drives the thruster {name}", "give a gain other than 0 in one of them")


def _check_keys(parts: Tables) -> Iterator[str]:
    """Check that each key of a curve or an axis has the other keys that it needs."""
    for name, curve in parts.curves.items():
        quantities = given_quantities(curve, CURVE)
        unpaired = [*_check_needed_by(f"curves.{name}", quantities, _REVERSE_PAIRS)]
        yield from unpaired
        if not unpaired and {"a_t", "b_t"} <= quantities.keys():
            thrust = Curve(name, tuple(quantities))
            values = {thrust.coefficient(key): q.value for key, q in quantities.items()}
            yield from no_thrust(thrust, values, f"curves.{name}")
        yield from _check_needed_by(f"curves.{name}", quantities, [(key + REVERSE, key) for key in ("c_0", "d")])
    for axis, table in parts.axis_tables.items():
        yield from _check_needed_by(f"axes.{axis.name}", given_quantities(table, AXIS), _REVERSE_PAIRS)


def check_tables_of_thrust(parts: Tables) -> Iterator[str]:
    """Check that each curve has either coefficients or tables, and that its voltages are complete."""
    for name, curve in parts.curves.items():
        yield from _check_keys_of_thrust(f"curves.{name}", curve)
        if curve.tables and parts.battery:
            low, high = curve.tables[0].voltage, curve.tables[-1].voltage
            if not low <= parts.battery.voltage.value <= high:
                reason = f"must be within the {low:g} ... {high:g} V of the tables of curves.{name}"
                yield key_line("battery.voltage.value", reason, parts.battery.voltage.value)
    needs_voltage = any(curve.V_0 or curve.tables for curve in parts.curves.values())
    if needs_voltage and not parts.battery:
        yield key_line("battery", "this table with the voltage is missing, and the thrust of a curve depends on it")
    elif parts.battery and not needs_voltage:
        yield key_line(
            "battery", "no thrust depends on the voltage: give a curve V_0 and n_V, or tables; or leave it out"
        )


def _check_keys_of_thrust(place: str, curve: schema.CurveTable) -> Iterator[str]:
    """Check that a curve has either coefficients or tables, and both keys of its voltage or neither."""
    given = given_quantities(curve, CURVE)
    if curve.table and curve.tables:
        yield key_line(f"{place}.tables", "must not be given together with table")
    if curve.table or curve.tables:
        replaced = (*REPLACED_BY_TABLE, *(("V_0", "n_V") if curve.tables else ()))
        reason = f"must not be given together with {'table' if curve.table else 'tables'}"
        yield from (key_line(f"{place}.{key}", reason) for key in replaced if key in given)
        if curve.lag == "speed":
            reason = "must be 'force' with a table, whose thrust is no quadratic of the speed: give a_t and b_t instead"
            yield key_line(f"{place}.lag", reason, curve.lag)
    else:
        yield from (key_line(f"{place}.{key}", "this key is missing") for key in ("a_t", "b_t") if key not in given)
        if "k_t" in given:
            yield key_line(f"{place}.k_t", "scales a table, and this curve has none: give table, or leave k_t out")
    needs = [*_both_ways("V_0", "n_V"), ("lag", "T")]
    yield from _check_needed_by(place, given.keys() | curve.model_fields_set, needs)


def _check_electric_currents(parts: File) -> Iterator[str]:
    """Check that all curves have the electric current at one voltage, or none has it."""
    given = {name: current for name, curve in parts.curves.items() if (current := curve.electric_current)}
    if not given:
        return
    first, known = next(iter(given.items()))
    for name in parts.curves:
        place = f"curves.{name}.electric_current"
        if name not in given:
            reason = f"this key is missing, and curves.{first} has it: the vehicle draws the sum over its thrusters"
            yield key_line(place, reason)
        elif given[name].voltage != known.voltage:
            reason = f"must be {known.voltage:g} V, as for curves.{first}: all thrusters have one battery"
            yield key_line(f"{place}.voltage", reason, given[name].voltage)


def _check_fins(parts: File, layout: Layout) -> Iterator[str]:
    """Check that each fin acts on an axis, and that the vehicle has surge, on whose velocity its force depends."""
    for fin in layout.fins:
        if not layout.has(SURGE):
            yield key_line(
                f"fin.{fin.name}", "its force depends on the velocity in surge, which the vehicle does not have"
            )
        elif not any(map(fin.effect, layout.bare_axes)):
            axes = join_names(layout.by_name)
            yield key_line(f"fin.{fin.name}", f"its lift acts on no axis of the vehicle, which are {axes}")
    names = {thruster.name for thruster in parts.thruster}
    for fin in layout.fins:
        if fin.name in names:
            yield key_line(f"fin.{fin.name}", "a thruster or a fin before it has this name")
        names.add(fin.name)


def _check_needed_tables(parts: File, lost: set[str]) -> Iterator[str]:
    """Check that [body], [arm] and [axes] hold what the vehicle needs, and nothing else."""
    if "axes" in lost:
        return
    if not parts.axis_tables:
        yield key_line("axes", "must have at least one of surge, sway, heave, roll, pitch, yaw")
        return
    if parts.body:
        inertias = {axis.inertia: axis for axis in reversed(parts.axis_tables)}
        yield from _check_needed_keys("body", parts.body, BODY, inertias)
        yield from _check_restoring(parts, parts.body)
    if lost & {"thruster", "arm"}:
        return
    has_arm = parts.layout.has_arm
    if parts.arm:
        yield from _check_needed_keys("arm", parts.arm, ARM, dict.fromkeys(ARM, YAW) if has_arm else {})
    elif has_arm:
        yield key_line("arm", "this table with R and gamma is missing, and a thruster has the key arm")


def _both_ways(one: str, other: str) -> list[tuple[str, str]]:
    """Return two keys of which each needs the other, for `_check_needed_by`."""
    return [(one, other), (other, one)]


_REVERSE_PAIRS = [*_both_ways("a_t_reverse", "b_t_reverse"), *_both_ways("a_d_reverse", "b_d_reverse")]
"""The quadratic and the linear coefficient in reverse."""


def _check_needed_by(table: str, keys: Collection[str], pairs: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Check that the second key of each pair is given where the first is."""
    for key, needed in pairs:
        if key in keys and needed not in keys:
            yield key_line(f"{table}.{needed}", f"this key is missing, and {key} is there")


def no_thrust(curve: Curve, values: Mapping[str, float], place: str) -> Iterator[str]:
    """Yield a line for each direction in which full command gives no force, or a force of the wrong sign."""
    for end in ("", REVERSE) if any(key.endswith(REVERSE) for key in curve.keys) else ("",):
        a_t, b_t, c_0 = (curve.coefficient(key + end) for key in ("a_t", "b_t", "c_0"))
        m = 1.0 - values.get(c_0, 0.0)
        force = (values[a_t] * m + values[b_t]) * m
        if force <= 0.0:
            direction = " in reverse" if end else ""
            reason = f"must give a force above 0 at full command{direction}, but {a_t} and {b_t} give {force:g} N"
            yield key_line(place, reason)


def _check_needed_keys(
    name: str, table: Strict, declarations: Mapping[str, Declaration], needed: Mapping[str, Axis]
) -> Iterator[str]:
    """Check that a table has the coefficients that are needed, each by an axis, and no others."""
    quantities = given_quantities(table, declarations)
    for key in declarations:
        if key in needed and key not in quantities:
            yield key_line(f"{name}.{key}", f"this key is missing, and the vehicle has {needed[key].name}")
        elif key in quantities and key not in needed:
            yield key_line(f"{name}.{key}", f"only {_users(key)}: remove it")


_WITHOUT_TILTING = {"W": HEAVE, "B": HEAVE, "x_G": YAW, "y_G": YAW}
"""For some keys of RESTORING, the axis in which they act even without roll and pitch."""


def _users(key: str) -> str:
    """Return the axes, in words, that need a coefficient of [body] or [arm]."""
    if key in ARM:
        return "yaw with thrusters that have the key arm needs it"
    first, *others = (axis.name for axis in AXES.values() if axis.inertia == key)
    return f"{listed([first, *others])} need it" if others else f"{first} needs it, and there is no [axes.{first}]"


def _check_restoring(parts: File, body: Body) -> Iterator[str]:
    """Check that weight, buoyancy and their centres act on the vehicle, and that W and B are given together."""
    given = given_quantities(body, RESTORING)
    for key in given:
        axes = [axis for axis in (_WITHOUT_TILTING.get(key), ROLL, PITCH) if axis]
        if not {*axes} & {*parts.axis_tables}:
            yield key_line(f"body.{key}", f"acts only in {listed([a.name for a in axes])}: remove it, or add an axis")
    for key in ("W", "B"):
        if given and key not in given:
            yield key_line(f"body.{key}", f"this key is missing, and {next(iter(given))} is there")


def _check_cross(parts: Tables) -> Iterator[str]:
    """Check that the coefficients in [cross] are of axes that the vehicle has, and are named in one way only."""
    has = {axis.velocity for axis in parts.axis_tables}
    for name, quantity in parts.cross.items():
        key, row = f"cross.{name}", cross_of(name)
        if row is None or len({*row[1:]}) == 1:
            default = ", only m_a_uq, b_d_uq, a_d_uq and Y_ur, or others of two axes; drag of one axis is in [axes]"
            yield key_line(key, f"there is no such key{derivative_hint(name) or default}")
            continue
        kind, *velocities = row
        missing = [axis.name for axis in AXES.values() if axis.velocity in velocities and axis.velocity not in has]
        free = 1 if kind == "lift" else 0 if kind == "m_a" else 2
        ordered = cross_name(kind, *velocities[:free], *sorted(velocities[free:], key=[*BY_VELOCITY].index))
        if missing:
            yield key_line(key, f"the vehicle has no {' and no '.join(missing)}: remove this key, or add the axis")
        elif ordered != name:
            yield key_line(key, f"write {ordered}, which is the same coefficient")
        else:
            yield from check_quantities("cross", {name: quantity}, {name: cross_declaration(kind, *velocities)})


# ---- Arm, coupling, coefficients -------------------------------------------------------------------------------------


def _check_arm(parts: File, layout: Layout) -> Iterator[str]:
    """Check that the arm R sin γ is not zero."""
    if layout.has_arm and parts.arm and parts.arm.R and parts.arm.gamma:
        reason = "must be more than 0, because otherwise the arm R sin γ is 0"
        for name, factor in (("R", parts.arm.R.value), ("gamma", sin(parts.arm.gamma.value))):
            if factor == 0.0:
                yield key_line(f"arm.{name}.value", reason, factor)


def _check_coupling(parts: File, layout: Layout) -> Iterator[str]:
    """Check that a coupled vehicle has the axes for it, and that β leaves each of them a finite inertia."""
    has_entries = "m_a" in {key for key, *_ in layout.cross} or not {"x_G", "y_G", "z_G"}.isdisjoint(layout.restoring)
    if not (layout.coupled or has_entries):
        return
    coupled = tuple(parts.axis_tables) if layout.has_attitude or has_entries else COUPLED_AXES
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
            mistakes.append(key_line(key, f"{name} has no interval, so it is not an estimate"))
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
    table: str, quantities: Mapping[str, Quantity], declarations: Mapping[str, Declaration]
) -> Iterator[str]:
    """Yield a line for each coefficient that is unknown, has a wrong unit, or is out of its bounds."""
    for name, quantity in quantities.items():
        key = f"{table}.{name}"
        if (declaration := declarations.get(name)) is None:
            yield key_line(key, f"there is no such coefficient of this vehicle{did_you_mean(name, declarations)}")
            continue
        if quantity.unit != declaration.unit:
            yield key_line(f"{key}.unit", f"must be {declaration.unit!r}; convert the value", quantity.unit)
        try:
            within(quantity.value, declaration)
        except ValueError as error:
            yield key_line(f"{key}.value", str(error), quantity.value)
