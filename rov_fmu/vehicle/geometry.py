"""Checks whether the thrusters of a vehicle can drive its axes, and whether its mass, damping and weight are possible.

Each mistake gives one line.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, combinations, pairwise
from math import hypot, sqrt
from typing import Any

from rov_fmu.equation.catalogue import GRAVITY, PITCH, ROLL, SWAY, YAW, Axis, cross_name
from rov_fmu.equation.expression import compiled
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Thruster
from rov_fmu.equation.terms import equation_of
from rov_fmu.io.messages import listed
from rov_fmu.io.toml_file import join_names, key_line

_RIGHTED = (ROLL, PITCH)
_PARALLEL = 1e-6
"""The least sine of an angle that is not a rounding error.

It decides whether the thrusters can drive two axes separately, and whether a thruster pushes sideways."""


def check_layout(layout: Layout, driven: Collection[str] = ()) -> Iterator[str]:
    """Yield a line for each mistake in the thrusters, axes and inputs of a vehicle.

    `driven` are the names of axes that thrusters must drive even if weight rights the vehicle about them.
    """
    wrong_places = [*check_thruster_places(layout)]
    if wrong_places:
        yield from wrong_places
    else:
        yield from check_axes(layout, driven)
        yield from check_inputs(layout)


def check_thruster_places(layout: Layout) -> Iterator[str]:
    """Check that each thruster has either a position or an arm, where the vehicle turns."""
    turning = [axis.name for axis in (ROLL, PITCH, YAW) if layout.has(axis)]
    for thruster in layout.thrusters:
        key, (x, y, _) = f"thruster.{thruster.name}", thruster.direction.value
        if thruster.arm:
            if reason := _why_no_arm(thruster):
                yield key_line(f"{key}.arm", reason)
        elif thruster.position is None and (layout.has_attitude or (turning and hypot(x, y) > _PARALLEL)):
            yield key_line(f"{key}.position", f"this key, or arm, is missing, and the vehicle has {turning[0]}")


def _why_no_arm(thruster: Thruster) -> str | None:
    """Return why a thruster cannot have the key arm, or None."""
    if thruster.position:
        return "must not be given together with position"
    if thruster.direction.value[0] <= 0.0:
        return "must be of a thruster that pushes ahead; give its position instead"
    return None


def check_axes(layout: Layout, driven: Collection[str] = ()) -> Iterator[str]:
    """Check that each thruster acts on an axis, and that the thrusters can drive each axis without the others.

    Roll and pitch need no thruster, because weight and buoyancy right the vehicle, unless they are in `driven`. An axis
    without thrusters may have fins.
    """
    for thruster in layout.thrusters:
        if not any(thruster in layout.thrusters_along(axis) for axis in layout.bare_axes):
            reason = f"acts on no axis of the vehicle, which are {join_names(layout.by_name)}"
            yield key_line(f"thruster.{thruster.name}", reason)
    for axis, reason in undriven_axes(layout, driven):
        yield key_line(f"axes.{axis.name}", reason)


def undriven_axes(layout: Layout, driven: Collection[str] = ()) -> Iterator[tuple[Axis, str]]:
    """Yield each axis that the thrusters cannot drive without the axes before it, and why.

    Sway comes last: two thrusters with a toe-in turn the vehicle, and their push to the side is a by-product.
    """
    if not layout.actuators:
        return
    axes = sorted(layout.bare_axes, key=lambda axis: axis is SWAY)
    independent: list[tuple[str, list[float]]] = []  # axes, with orthonormal rows of the thrusters' effects
    for axis in (axis for axis in axes if axis not in _RIGHTED or axis.name in driven):
        if not layout.thrusters_along(axis) and any(fin.effect(axis) for fin in layout.fins):
            continue
        if not layout.thrusters_along(axis):
            yield axis, _undriven(axis)
            continue
        rest, coupled = _rest(_unit([thruster.effect(axis) for thruster in layout.thrusters]), independent)
        if hypot(*rest) > _PARALLEL:
            independent.append((axis.name, _unit(rest)))
        else:
            reason = f"the thrusters cancel: they drive it only together with {join_names(coupled)}"
            yield axis, f"{reason}; correct a direction or a position, or remove this table"


def _rest(row: list[float], others: Sequence[tuple[str, list[float]]]) -> tuple[list[float], list[str]]:
    """Return the part of a row that is orthogonal to other rows, and the names of those with which it has a part."""
    coupled = []
    for name, other in others:
        projection = sum(a * b for a, b in zip(row, other, strict=True))
        row = [a - projection * b for a, b in zip(row, other, strict=True)]
        if abs(projection) > _PARALLEL:
            coupled.append(name)
    return row, coupled


def _undriven(axis: Axis) -> str:
    """Return what to do about an axis that no thruster drives."""
    if axis.is_rotation:
        return "no thruster turns the vehicle: give one a position beside the line of its force, or remove this table"
    return f"no thruster drives it: give one a direction with a part {axis.positive}, or remove this table"


def check_inputs(layout: Layout) -> Iterator[str]:
    """Check that each input drives an axis; if all do, check that each axis has an input."""
    driven = {axis: layout.signs(axis) for axis in layout.bare_axes if layout.thrusters_along(axis)}
    steering = {name for fin in layout.fins for name in layout.gains[fin.name]}
    used = steering.union(*driven.values())
    idle = [name for name in layout.mix if f"u_{name}" not in used]
    for name in idle:
        yield key_line(f"inputs.{name}", "drives no axis of the vehicle: its gains cancel")
    for axis, signs in driven.items():
        if not (idle or signs or axis in _RIGHTED):
            yield key_line(f"axes.{axis.name}", "no input drives it: the gains cancel")


def _unit(row: Sequence[float]) -> list[float]:
    """Return a row divided by its Euclidean norm."""
    norm = hypot(*row)
    return [part / norm for part in row]


# ---- Mass, damping, weight -------------------------------------------------------------------------------------------

_TOLERANCE = 0.03
"""The largest relative difference between W and the weight of m_rov that gives no warning."""
_FAR_ABOVE = 1.5
"""The largest ratio of the battery's voltage to V_0 that gives no warning."""
_LEAST = 1e-9
"""The smallest eigenvalue of a positive definite matrix, whose diagonal is 1."""


def check_mass(layout: Layout, coefficients: Mapping[str, float]) -> Iterator[str]:
    """Yield a line if the mass matrix is not positive definite: the vehicle would accelerate against its load."""
    entries = [(a, b) for key, a, b, *_ in layout.cross if key == "m_a"]
    if not entries and not any(coefficients.get(f"{axis}_G") for axis in "xyz"):
        return
    try:
        parameters = compiled(equation_of(layout).parameters)(coefficients)
    except ZeroDivisionError:  # a pivot of a singular matrix, or a β
        yield key_line(
            "cross", "the mass matrix must be positive definite, not singular: reduce m_a_.., or x_G, y_G, z_G"
        )
        return
    mass = {name.removeprefix("mass_"): x for name, x in parameters.items() if name.startswith("mass_")}
    names = {name[0]: layout.by_velocity[name[0]].axis.name for name in mass if name[0] == name[1]}
    for a, b in combinations(names, 2):  # an entry that alone makes it not positive definite
        most = sqrt(mass[a + a] * mass[b + b])
        if abs(mass.get(a + b, 0.0)) >= most:
            scale, is_added = sqrt(coefficients[f"beta_{a}"] * coefficients[f"beta_{b}"]), (a, b) in entries
            key = cross_name("m_a", a, b) if is_added else _centre(a, b)
            allowed = f"within ±{most * scale:.4g} for a positive definite matrix, but it is {mass[a + b] * scale:.4g}"
            of = f"the entry of the mass matrix for {listed([names[a], names[b]])}, with that of the centre of mass"
            place = f"{'cross' if is_added else 'body'}.{key}.value"
            yield key_line(place, f"{of}, must be {allowed}", coefficients[key])
            return
    if names and _least_eigenvalue(names, mass) < _LEAST:
        reduce = join_names([cross_name("m_a", a, b) for a, b in entries])
        reason = f"the mass matrix of {listed(names.values())} must be positive definite"
        yield key_line("cross" if entries else "body", f"{reason}: reduce {reduce or 'x_G, y_G, z_G'}")


def doubts(layout: Layout, coefficients: Mapping[str, float]) -> Iterator[str]:
    """Yield a line about each combination of numbers that is possible but probably wrong."""
    yield from _doubts_of_damping(layout, coefficients)
    yield from _doubts_of_weight(coefficients)
    yield from _doubts_of_voltage(layout, coefficients)


def _doubts_of_damping(layout: Layout, coefficients: Mapping[str, float]) -> Iterator[str]:
    """Yield a line if the linear damping adds energy to some motions.

    Its symmetric part then has a negative eigenvalue.
    """
    cross = {(a, b): coefficients[cross_name("b_d", a, b)] for key, a, b, *_ in layout.cross if key == "b_d"}
    if not cross:
        return
    damping = {
        vehicle_axis.axis.velocity: min(coefficients[vehicle_axis.coefficient(key)] for key in ("b_d", "b_d_reverse"))
        for vehicle_axis in layout.axes
    }
    entries = {a + a: value for a, value in damping.items()}
    adds = "the linear damping adds energy to some slow motions of"
    for a, b in combinations(damping, 2):
        given = {cross_name("b_d", *pair): cross[pair] for pair in ((a, b), (b, a)) if pair in cross}
        entries[a + b] = sum(given.values()) / 2.0
        if abs(entries[a + b]) > (most := sqrt(damping[a] * damping[b])) * (1.0 + _LEAST):
            first, *_ = given
            words = f"{adds} {_axes_of(layout, a, b)}: {' + '.join(given)} should be within ±{2.0 * most:.4g}"
            yield key_line(f"cross.{first}.value", words, given[first])
            return
    if _least_eigenvalue(damping, entries) < -_LEAST:
        yield key_line("cross", f"{adds} {_axes_of(layout, *chain(*cross))}: reduce its b_d_..")


def _axes_of(layout: Layout, *velocities: str) -> str:
    """Return the names of the axes with some velocities, in the order of the vehicle."""
    return listed(
        [vehicle_axis.axis.name for velocity, vehicle_axis in layout.by_velocity.items() if velocity in velocities]
    )


def _doubts_of_voltage(layout: Layout, coefficients: Mapping[str, float]) -> Iterator[str]:
    """Yield a line if thrust does not rise with the voltage, or if the voltage is far above that of the measurement."""
    voltage = layout.voltage or 0.0
    for curve in layout.curves:
        for low, high in pairwise(curve.tables):
            if high.values[-1] <= low.values[-1] or high.values[0] >= low.values[0]:
                same = f"at {high.voltage:g} V, full thrust is not stronger than at {low.voltage:g} V"
                yield key_line(f"curves.{curve.name}.tables", f"{same}: is one table a copy of the other?")
    for curve in layout.curves:
        if "V_0" in curve.keys and voltage > _FAR_ABOVE * (V_0 := coefficients[curve.coefficient("V_0")]):
            times = f"is {voltage / V_0:.3g} times V_0 = {V_0:g} V of curves.{curve.name}"
            yield key_line("battery.voltage.value", f"{times}: one of the two is probably wrong", voltage)
            return


def _doubts_of_weight(k: Mapping[str, float]) -> Iterator[str]:
    """Yield a line if the weight does not fit the mass, and one if the buoyancy turns the vehicle upside down."""
    if "W" not in k:
        return
    if (mass := k.get("m_rov")) and abs(k["W"] / (GRAVITY * mass) - 1.0) > _TOLERANCE:
        weighs = f"m_rov = {mass:g} kg weighs {GRAVITY * mass:.4g} N: one of the two is probably wrong"
        yield key_line("body.W.value", weighs, k["W"])
    z_G, z_B = (k.get(name, 0.0) for name in ("z_G", "z_B"))
    if k["W"] * z_G < k["B"] * z_B:
        below = f"buoyancy acts below the centre of mass, z_G = {z_G:g} m, and turns the vehicle upside down"
        yield key_line("body.z_B.value", f"{below}; z is positive down, so a centre of buoyancy above has less z", z_B)


def _centre(a: str, b: str) -> str:
    """Return the coordinate of the centre of mass in the entry of the mass matrix of a velocity and a rate."""
    return f"{'xyz'[3 - 'uvw'.index(a) - 'pqr'.index(b)]}_G"


def _least_eigenvalue(rows: Collection[str], entries: Mapping[str, float]) -> Any:
    """Return the smallest eigenvalue of a symmetric matrix that is scaled so that its diagonal is 1, or 0.

    `entries` are those of one half of it, by the names of the row and of the column.
    """
    from numpy.linalg import eigvalsh  # NumPy, which few files need

    scale = {row: sqrt(entries[row + row]) or 1.0 for row in rows}
    return eigvalsh(
        [[entries.get(a + b, entries.get(b + a, 0.0)) / (scale[a] * scale[b]) for b in rows] for a in rows]
    )[0]
