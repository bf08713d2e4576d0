"""Whether the thrusters and axes of a vehicle make one: a line for everything that does not fit."""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import hypot

from rov_fmu.io.toml_file import join_names, key_line
from rov_fmu.model.layout import YAW, Layout
from rov_fmu.vehicle.schema import where

_PARALLEL = 1e-6
"""Two axes that the thrusters drive in ratios that differ by less can only be driven together."""


def check_layout(layout: Layout) -> Iterator[str]:
    """A line for all of what a vehicle has that makes no vehicle."""
    placed = [*places(layout)]
    yield from placed or geometry(layout)
    if not placed:
        yield from mixed(layout)
    yield from coincidences(layout)


def places(layout: Layout) -> Iterator[str]:
    """The place of each thruster, said once and where it matters."""
    for thruster in layout.thrusters:
        key, (x, y, _) = f"thruster.{thruster.name}", thruster.direction
        if thruster.arm and thruster.position:
            yield key_line(f"{key}.arm", "must not stand beside position")
        elif thruster.arm and x <= 0.0:
            yield key_line(f"{key}.arm", "must be of a thruster that pushes ahead; give its position instead")
        elif layout.has(YAW) and not thruster.arm and thruster.position is None and hypot(x, y) > _PARALLEL:
            yield key_line(f"{key}.position", "this key, or arm, is missing, and the vehicle has yaw")


def geometry(layout: Layout) -> Iterator[str]:
    """Whether every axis can be driven, by itself, and everything that drives does."""
    axes = [form.axis for form in layout.axes]
    for thruster in layout.thrusters:
        if not any(thruster in layout.drivers(axis) for axis in axes):
            reason = f"acts on no axis of the vehicle, which are {join_names([axis.name for axis in axes])}"
            yield key_line(f"thruster.{thruster.name}", reason)
    free: list[tuple[str, list[float]]] = []  # axes that can be driven apart, as orthonormal rows of effects
    for axis in axes:
        if not layout.drivers(axis):
            reason = "no thruster has an arm about the vertical axis" if axis is YAW else "no thruster drives it"
            yield key_line(f"axes.{axis.name}", reason)
            continue
        left = _unit([thruster.effect(axis) for thruster in layout.thrusters])
        together = []
        for name, other in free:
            along = sum(a * b for a, b in zip(left, other, strict=True))
            left = [a - along * b for a, b in zip(left, other, strict=True)]
            together += [name] if abs(along) > _PARALLEL else []
        if hypot(*left) > _PARALLEL:
            free.append((axis.name, _unit(left)))
        else:
            yield key_line(
                f"axes.{axis.name}", f"the thrusters cancel: they drive it only together with {join_names(together)}"
            )


def mixed(layout: Layout) -> Iterator[str]:
    """Inputs whose gains cancel; and only where there are none, axes that no input drives."""
    driven = {axis: layout.signs(axis) for axis in (form.axis for form in layout.axes) if layout.drivers(axis)}
    idle = [name for name in layout.mix if not any(f"u_{name}" in signs for signs in driven.values())]
    for name in idle:
        yield key_line(f"inputs.{name}", "drives no axis of the vehicle: its gains cancel")
    for axis in (axis for axis, signs in driven.items() if not (signs or idle)):
        yield key_line(f"axes.{axis.name}", "no input drives it: the gains cancel")


def _unit(row: Sequence[float]) -> list[float]:
    length = hypot(*row)
    return [part / length for part in row]


def coincidences(layout: Layout) -> Iterator[str]:
    """Two variables of the FMU with one name."""
    names = [*layout.inputs, *layout.state, *layout.thrust, *(name for name, _ in where(layout))]
    for name in (name for name, count in Counter(names).items() if count > 1):
        yield key_line(name, "two variables of the FMU would have this name; rename a curve or a thruster")
