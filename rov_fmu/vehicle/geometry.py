"""Checks whether the thrusters of a vehicle can drive its axes; each mistake gives one line."""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import hypot

from rov_fmu.io.toml_file import join_names, key_line
from rov_fmu.model.layout import YAW, Layout
from rov_fmu.vehicle.schema import where

_PARALLEL = 1e-6
"""Thrusters can drive two axes only together if the sine of the angle between the axes' rows of effects is smaller."""


def check_layout(layout: Layout) -> Iterator[str]:
    """Yield a line for each mistake in the thrusters, axes, inputs and names of a vehicle."""
    wrong_places = [*check_thruster_places(layout)]
    if wrong_places:
        yield from wrong_places
    else:
        yield from check_axes(layout)
        yield from check_inputs(layout)
    yield from check_variable_names(layout)


def check_thruster_places(layout: Layout) -> Iterator[str]:
    """Check that each thruster has either a position or an arm, where yaw needs one."""
    for thruster in layout.thrusters:
        key, (x, y, _) = f"thruster.{thruster.name}", thruster.direction
        if thruster.arm and thruster.position:
            yield key_line(f"{key}.arm", "must not stand beside position")
        elif thruster.arm and x <= 0.0:
            yield key_line(f"{key}.arm", "must be of a thruster that pushes ahead; give its position instead")
        elif layout.has(YAW) and not thruster.arm and thruster.position is None and hypot(x, y) > _PARALLEL:
            yield key_line(f"{key}.position", "this key, or arm, is missing, and the vehicle has yaw")


def check_axes(layout: Layout) -> Iterator[str]:
    """Check that each thruster acts on an axis, and that the thrusters can drive each axis without the others."""
    axes = [vehicle_axis.axis for vehicle_axis in layout.axes]
    for thruster in layout.thrusters:
        if not any(thruster in layout.drivers(axis) for axis in axes):
            reason = f"acts on no axis of the vehicle, which are {join_names([axis.name for axis in axes])}"
            yield key_line(f"thruster.{thruster.name}", reason)
    independent: list[tuple[str, list[float]]] = []  # axes, with orthonormal rows of the thrusters' effects
    for axis in axes:
        if not layout.drivers(axis):
            reason = "no thruster has an arm about the vertical axis" if axis is YAW else "no thruster drives it"
            yield key_line(f"axes.{axis.name}", reason)
            continue
        rest = _unit([thruster.effect(axis) for thruster in layout.thrusters])
        coupled = []
        for name, row in independent:
            projection = sum(a * b for a, b in zip(rest, row, strict=True))
            rest = [a - projection * b for a, b in zip(rest, row, strict=True)]
            if abs(projection) > _PARALLEL:
                coupled.append(name)
        if hypot(*rest) > _PARALLEL:
            independent.append((axis.name, _unit(rest)))
        else:
            reason = f"the thrusters cancel: they drive it only together with {join_names(coupled)}"
            yield key_line(f"axes.{axis.name}", reason)


def check_inputs(layout: Layout) -> Iterator[str]:
    """Check that each input drives an axis; if all do, check that each axis has an input."""
    driven = {axis: layout.signs(axis) for axis in (one.axis for one in layout.axes) if layout.drivers(axis)}
    idle = [name for name in layout.mix if not any(f"u_{name}" in signs for signs in driven.values())]
    for name in idle:
        yield key_line(f"inputs.{name}", "drives no axis of the vehicle: its gains cancel")
    if idle:
        return
    for axis, signs in driven.items():
        if not signs:
            yield key_line(f"axes.{axis.name}", "no input drives it: the gains cancel")


def _unit(row: Sequence[float]) -> list[float]:
    """Return a row divided by its Euclidean norm."""
    norm = hypot(*row)
    return [part / norm for part in row]


def check_variable_names(layout: Layout) -> Iterator[str]:
    """Check that no two variables of the FMU have the same name."""
    names = [*layout.inputs, *layout.state, *layout.thrust, *(name for name, _ in where(layout))]
    for name, count in Counter(names).items():
        if count > 1:
            yield key_line(name, "two variables of the FMU would have this name; rename a curve or a thruster")
