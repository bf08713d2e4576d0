"""What the equations of the page hold for one vehicle: sums of forces, written as one reads them."""

from collections.abc import Iterable
from dataclasses import dataclass

from rov_fmu.motion.layout import YAW, Curve, Layout, Thruster, VehicleAxis

Sum = list[tuple[float, list[tuple[int, str]]]]
"""Terms of the same size together: the size, and each term's sign and name."""


@dataclass(frozen=True)
class Force:
    """A thrust curve and its thrusters."""

    curve: Curve
    thrusters: list[Thruster]
    turns: bool
    by_arm: Sum
    """Of its torque, what R sin γ stands before."""
    by_place: Sum


@dataclass(frozen=True)
class Equations:
    """Of one vehicle."""

    thrust: dict[str, Sum]
    """Force along each axis, by its velocity; the torque is that of the curves."""
    forces: list[Force]
    commands: dict[str, Sum]
    """Of each thruster, the inputs that drive it, where they are mixed."""
    pose: dict[str, list[tuple[str, str, str]]]
    """The rate of each coordinate: terms of a sign, a velocity and a function of the heading, if there is one."""


def of(layout: Layout) -> Equations:
    """The equations of a vehicle."""
    forces = []
    for curve in layout.curves:
        thrusters = [t for t in layout.thrusters if t.curve == curve.name]
        turning = [t for t in layout.drivers(YAW) if t in thrusters] if layout.has(YAW) else []
        arms, places = ([(t.effect(YAW), t.name) for t in turning if (t.position is None) == by_arm]
                        for by_arm in (True, False))  # fmt: skip
        forces.append(Force(curve, thrusters, bool(turning), _summed(arms), _summed(places)))
    mixed = {name: _summed((gain, of.removeprefix("u_")) for of, gain in gains.items())
             for name, gains in layout.gains.items()} if layout.mix else {}  # fmt: skip
    return Equations({f.axis.velocity: _along(layout, f) for f in layout.axes}, forces, mixed, _pose(layout))


def _along(layout: Layout, form: VehicleAxis) -> Sum:
    if form.axis is YAW:
        return [(1.0, [(1, curve.name) for curve in layout.turning_curves])]
    return _summed((t.effect(form.axis), t.name) for t in layout.drivers(form.axis))


_POSE = {
    "x": [("+", "u", "cos"), ("−", "v", "sin"), ("+", "V_N", "")],
    "y": [("+", "u", "sin"), ("+", "v", "cos"), ("+", "V_E", "")],
    "z": [("+", "w", "")],
    "psi": [("+", "r", "")],
}


def _pose(layout: Layout) -> dict[str, list[tuple[str, str, str]]]:
    turns, known = layout.has(YAW), layout.velocities | layout.inputs
    return {
        "ψ" if name == "psi" else name: [
            (sign, of, function if turns else "") for sign, of, function in terms
            if of in known and (turns or function != "sin")
        ]
        for name, terms in _POSE.items() if name in layout.pose
    }  # fmt: skip


def _summed(terms: Iterable[tuple[float, str]]) -> Sum:
    found: dict[float, list[tuple[int, str]]] = {}
    for factor, name in terms:
        found.setdefault(float(f"{abs(factor):.4g}"), []).append((1 if factor > 0.0 else -1, name))
    return list(found.items())
