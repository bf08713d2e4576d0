"""The forces and moments that depend on velocities and attitude. Each kind is a function that `forces_of` calls."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

from .attitude import entry
from .formula import weighted
from .layout import FAINT, REVERSE, Layout, cross_name, effect_along


@dataclass(frozen=True)
class Force:
    """A force or moment along an axis: a coefficient times one or two states of the table."""

    effect: str
    """The name of the effect: linear and quadratic drag, lift, restoring, advance, steering."""
    axis: str
    """The velocity of the axis."""
    coefficient: str
    """The formula of the coefficient, a product that may begin with a minus."""
    factors: tuple[str, ...]
    velocity: str = ""
    """The velocity on whose direction the coefficient depends, or an empty text."""
    reverse: str = ""
    """The formula of the coefficient for a negative velocity."""
    is_held: bool = False
    """True when the coefficient depends on inputs.

    If `velocity` is given, the coefficient is multiplied by the sign of that velocity."""


def forces_of(layout: Layout) -> Iterator[Force]:
    """Yield all forces and moments of a vehicle that depend on its velocities and its attitude."""
    yield from chain(_drag(layout), _restoring(layout), _advance(layout), _steering(layout))


def _drag(layout: Layout) -> Iterator[Force]:
    """Yield the damping: linear and quadratic drag of each axis, and the cross terms."""
    for form in layout.axes:
        v = form.axis.velocity
        linear, back = (f"-{form.coefficient('b_d' + end)}" for end in ("", REVERSE))
        yield Force("linear", v, linear, (v,), v, back)
        yield Force("quadratic", v, f"-{form.coefficient('a_d')}", (v, v), v, form.coefficient("a_d" + REVERSE))
    for key, axis, *others in layout.cross:
        name = cross_name(key, axis, *others)
        if key == "b_d":
            yield Force("linear", axis, f"-{name}", (others[0],))
        elif key == "a_d":
            yield Force("quadratic", axis, f"-{name}", (others[0], others[0]), others[0], name)
        elif key == "lift":
            yield Force("lift", axis, name, (others[0], others[1]))


def _restoring(layout: Layout) -> Iterator[Force]:
    """Yield the forces and moments of weight and buoyancy. The moment is W r_G x k - B r_B x k, where k points down."""
    if not (layout.restoring and layout.has_attitude):
        return
    x, y, z = (entry(3, n) for n in (1, 2, 3))
    arms = {"p": (("y", z), ("z", y)), "q": (("z", x), ("x", z)), "r": (("x", y), ("y", x))}
    for form in layout.axes:
        v = form.axis.velocity
        if v in "uvw":
            yield Force("restoring", v, "net_weight", ((x, y, z)["uvw".index(v)],))
        else:
            (plus, first), (minus, second) = arms[v]
            if {f"{plus}_G", f"{plus}_B"} & set(layout.restoring):
                yield Force("restoring", v, f"righting_{plus}", (first,))
            if {f"{minus}_G", f"{minus}_B"} & set(layout.restoring):
                yield Force("restoring", v, f"-righting_{minus}", (second,))


def _advance(layout: Layout) -> Iterator[Force]:
    """Yield the loss of thrust by the speed of advance.

    The thrust is F - d |c| v_a, and the speed of advance v_a is linear in the velocities.
    """
    for form in layout.axes:
        for other in layout.axes:
            parts = []
            for t in layout.thrusters:
                effect = t.effect(form.axis) * t.effect(other.axis)
                if "d" in layout.curve_of[t.name].keys and abs(effect) > FAINT:
                    parts.append((effect, f"loss_{t.name}"))
            if parts:
                v = form.axis.velocity
                text = f"-{form.axis.coefficient('alpha')} * ({weighted(parts)})"
                yield Force("advance", v, text, (other.axis.velocity,), is_held=True)


def _steering(layout: Layout) -> Iterator[Force]:
    """Yield the lift of the fins, lift |u|u δ, and their drag, which is proportional to |u|u δ²."""
    ahead = (1.0, 0.0, 0.0)
    for form in layout.axes:
        parts = []
        for fin in layout.fins:
            angle = f"angle_{fin.name}"
            parts.append((fin.effect(form.axis), f"{fin.coefficient('lift')} * {angle}"))
            if fin.has_drag:
                effect = effect_along(form.axis, ahead, fin.position)
                parts.append((-effect, f"{fin.coefficient('drag')} * {angle} * {angle}"))
        acting = [(effect, text) for effect, text in parts if abs(effect) > FAINT]
        if acting:
            yield Force("steering", form.axis.velocity, f"({weighted(acting)})", ("u", "u"), "u", is_held=True)
