"""The forces and moments that depend on velocities and attitude. Each kind is a function that `forces_of` calls."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

from .attitude import entry
from .catalogue import REVERSE, cross_name
from .expression import Expression, Name, Names, call, directed, product, scaled, total
from .layout import FAINT, Layout, effect_along


@dataclass(frozen=True)
class Force:
    """A force or moment along an axis: a coefficient times one or two states of the table."""

    effect: str
    """The name of the effect: linear and quadratic drag, lift, restoring, advance, steering."""
    axis: str
    """The velocity of the axis."""
    sign: int
    coefficient: tuple[Expression, ...]
    """The factors of the coefficient."""
    factors: tuple[str, ...]
    """The states that multiply the coefficient."""
    velocity: str = ""
    """The velocity on whose direction the coefficient depends, or an empty text."""
    reverse: tuple[Expression, ...] = ()
    """The factors of the coefficient for a negative velocity, if they are others."""
    turns: bool = False
    """True when the force has the other sign for a negative velocity."""
    is_held: bool = False
    """True when the coefficient depends on inputs."""

    @property
    def formula(self) -> Expression:
        """The force as a formula, for both directions of the velocity."""
        both = zip(self.coefficient, self.reverse or self.coefficient, strict=True)
        coefficient = [directed(Name(self.velocity), *pair) for pair in both]
        first, *others = map(Name, self.factors)
        return scaled(self.sign, product(*coefficient, call("abs", first) if self.turns else first, *others))

    def along(self, inverse: Expression, *, reverse: bool = False) -> Expression:
        """Return the coefficient of an acceleration: `inverse` is the acceleration per load."""
        factors = (self.reverse or self.coefficient) if reverse else self.coefficient
        return scaled(-self.sign if reverse and self.turns else self.sign, product(inverse, *factors))


def forces_of(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield all forces and moments of a vehicle that depend on its velocities and its attitude."""
    yield from chain(_drag(layout), _restoring(layout, names), _advance(layout, names), _steering(layout, names))


def _drag(layout: Layout) -> Iterator[Force]:
    """Yield the damping: linear and quadratic drag of each axis, and the cross terms."""
    for form in layout.axes:
        v = form.axis.velocity
        for key, effect, factors in (("b_d", "linear", (v,)), ("a_d", "quadratic", (v, v))):
            ahead, astern = (Name(form.coefficient(key + end)) for end in ("", REVERSE))
            yield Force(effect, v, -1, (ahead,), factors, v, (astern,), turns=key == "a_d")
    for key, axis, *others in layout.cross:
        coefficient = (Name(cross_name(key, axis, *others)),)
        if key == "b_d":
            yield Force("linear", axis, -1, coefficient, (others[0],))
        elif key == "a_d":
            yield Force("quadratic", axis, -1, coefficient, (others[0], others[0]), others[0], turns=True)
        elif key == "lift":
            yield Force("lift", axis, 1, coefficient, (others[0], others[1]))


def _restoring(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield the forces and moments of weight and buoyancy. The moment is W r_G x k - B r_B x k, where k points down."""
    if not (layout.restoring and layout.has_attitude):
        return
    x, y, z = (entry(3, n) for n in (1, 2, 3))
    arms = {"p": (("y", z), ("z", y)), "q": (("z", x), ("x", z)), "r": (("x", y), ("y", x))}
    for form in layout.axes:
        v = form.axis.velocity
        if v in "uvw":
            yield Force("restoring", v, 1, (names("net_weight"),), ((x, y, z)["uvw".index(v)],))
            continue
        for sign, (coordinate, direction) in zip((1, -1), arms[v], strict=True):
            if {f"{coordinate}_G", f"{coordinate}_B"} & set(layout.restoring):
                yield Force("restoring", v, sign, (names("righting", coordinate),), (direction,))


def _advance(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield the loss of thrust by the speed of advance.

    The thrust is F - d |c| v_a, and the speed of advance v_a is linear in the velocities.
    """
    for form in layout.axes:
        for other in layout.axes:
            parts = []
            for t in layout.thrusters:
                effect = t.effect(form.axis) * t.effect(other.axis)
                if "d" in layout.curve_of[t.name].keys and abs(effect) > FAINT:
                    parts.append(scaled(effect, names("loss", t.name)))
            if parts:
                lost = Name(form.axis.coefficient("alpha")), total(parts)
                yield Force("advance", form.axis.velocity, -1, lost, (other.axis.velocity,), is_held=True)


def _steering(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield the lift of the fins, lift |u|u δ, and their drag, which is proportional to |u|u δ²."""
    ahead = (1.0, 0.0, 0.0)
    for form in layout.axes:
        parts = []
        for fin in layout.fins:
            angle = names("angle", fin.name)
            parts.append((fin.effect(form.axis), Name(fin.coefficient("lift")) * angle))
            if fin.has_drag:
                effect = effect_along(form.axis, ahead, fin.position)
                parts.append((-effect, Name(fin.coefficient("drag")) * angle * angle))
        acting = total(scaled(*part) for part in parts if abs(part[0]) > FAINT)
        if acting.names:
            yield Force("steering", form.axis.velocity, 1, (acting,), ("u", "u"), "u", turns=True, is_held=True)
