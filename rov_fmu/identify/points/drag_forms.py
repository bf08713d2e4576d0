"""The possible forms of drag: linear, quadratic or both; the same in both directions, or not, or with a net weight."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from rov_fmu.identify.points.forms import widened
from rov_fmu.model.layout import HEAVE, REVERSE, Axis
from rov_fmu.model.rov import Rov

LEFT_OUT = "Left at 0, because neither AICc nor the leave-one-thrust-out error is better with it"


@dataclass(frozen=True)
class Point:
    """One measured V_ss (m/s, rad/s) or Tau (s) of an axis at a held command, signs as in the test."""

    quantity: str
    """V_ss or Tau."""
    command: float
    value: float
    weight: float
    source: str
    """File and line, or file and time."""
    error: float | None = None
    """The standard error of a point that was read off a recording; None for one of a table."""

    @property
    def is_read_off(self) -> bool:
        """True for a point that was read off a recording."""
        return self.error is not None


@dataclass(frozen=True)
class DragForm:
    """One form of drag: the coefficients that are fitted, and those that stay zero."""

    axis: Axis
    base: Rov
    """The vehicle with the keys of the form and the values of coefficients that are not fitted."""
    names: tuple[str, ...]
    zero: tuple[str, ...]
    assumed: dict[str, str]
    """Coefficients that are not identifiable, and the assumption about each."""
    what: str = ""

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the axis's coefficients."""
        return self.base.layout.kinds[self.axis.name].keys

    @property
    def is_open(self) -> bool:
        """True when this is not the plain form."""
        return bool(self.what)

    def is_identifiable_from(self, points: Sequence[Point]) -> bool:
        """Return True when the points suffice for a fit of this form."""
        beta = self.axis.coefficient("beta")
        if beta in self.names and not any(p.quantity == "Tau" for p in points):
            return False
        load = self.axis.coefficient("F_0")
        directions = (1.0, -1.0) if {self.axis.coefficient("a_d" + REVERSE), load} & {*self.names} else (0.0,)
        drag = [name for name in self.names if name not in (beta, load)]
        least = min(max(len(drag) // len(directions), 1), 2)
        return all(len(levels(points, direction)) >= least for direction in directions)


def level(point: Point) -> float:
    """Return the absolute value of the command, rounded."""
    return round(abs(point.command), 6)


def levels(points: Sequence[Point], direction: float = 0.0) -> set[float]:
    """Return the absolute values of the commands in one direction (1, -1) or both (0)."""
    return {level(p) for p in points if direction * p.command >= 0.0}


def drag_and_beta(axis: Axis, known: Collection[str] = ()) -> tuple[str, ...]:
    """Return the names of a_d, b_d and β of an axis that are not known."""
    return tuple(name for kind in ("a_d", "b_d", "beta") if (name := axis.coefficient(kind)) not in known)


def free_coefficients(
    axis: Axis, used: Sequence[Point], known: Collection[str]
) -> tuple[tuple[str, ...], dict[str, tuple[float, str]]]:
    """Return the coefficients to fit, and the assumed value and reason for each that is not identifiable."""
    a_d, b_d, beta = drag_and_beta(axis)
    assumed: dict[str, tuple[float, str]] = {}
    if b_d not in known and a_d not in known and len(levels(used)) < 2:
        assumed[b_d] = (0.0, "Linear and quadratic drag cannot be separated with one thrust only. Assumed to be 0")
    if beta not in known and not any(p.quantity == "Tau" for p in used):
        assumed[beta] = (1.0, f"{axis.inertia}/{beta} is not identifiable from V_ss alone; assumed 1")
    return drag_and_beta(axis, {*known, *assumed}), assumed


def candidate_forms(axis: Axis, points: Sequence[Point], base: Rov, known: Collection[str]) -> Iterator[DragForm]:
    """Yield the plain form (linear and quadratic drag, the same in both directions), and then the other identifiable
    forms."""
    used = [p for p in points if p.weight > 0.0]
    names, held = free_coefficients(axis, used, known)
    assumed = {name: words for name, (_, words) in held.items()}
    base = _having(base, axis, known, by_direction=False).replaced({name: value for name, (value, _) in held.items()})
    plain = DragForm(axis, base, names, (), assumed)
    yield plain
    if {axis.coefficient("a_d"), axis.coefficient("b_d")} <= set(names):
        yield from (_alone(plain, key, "") for key in ("a_d", "b_d"))
        steady = [p for p in used if p.quantity == "V_ss"]
        reverse = tuple(axis.coefficient(key + REVERSE) for key in ("a_d", "b_d"))
        if not all(len(levels(steady, side)) >= 2 for side in (1.0, -1.0)):
            return
        if not set(reverse) & set(known):
            by_direction = _having(base, axis, known, by_direction=True)
            both = DragForm(axis, by_direction, (*names, *reverse), (), assumed, "drag by direction")
            yield both
            yield from (_alone(both, key, ", by direction") for key in ("a_d", "b_d"))
        load = axis.coefficient("F_0")
        if axis is HEAVE and load not in base.coefficients:
            heavy = DragForm(
                axis, base.extended({load: 0.0}), (*names, load), (), assumed, "a constant load (net weight)"
            )
            yield heavy
            yield from (_alone(heavy, key, " with a constant load") for key in ("a_d", "b_d"))


def _alone(form: DragForm, kind: str, suffix: str) -> DragForm:
    """Return the form with quadratic or linear drag alone."""
    other, words = {"a_d": ("b_d", "quadratic"), "b_d": ("a_d", "linear")}[kind]
    zero = tuple(name for name in form.names if name.startswith(other))
    names = tuple(name for name in form.names if name not in zero)
    what = f"{words} drag alone{suffix}"
    return replace(form, base=form.base.replaced(dict.fromkeys(zero, 0.0)), names=names, zero=zero, what=what)


def _having(base: Rov, axis: Axis, known: Collection[str], *, by_direction: bool) -> Rov:
    """Return the vehicle with drag by direction, or with equal drag unless the drag in reverse is known."""
    if by_direction:
        return base.extended({axis.coefficient(key + REVERSE): base[axis.coefficient(key)] for key in ("a_d", "b_d")})
    form = base.layout.kinds[axis.name]
    keys = tuple(k for k in form.keys if k.removesuffix(REVERSE) == k or axis.coefficient(k) in known)
    return Rov(widened(base.layout, replace(form, keys=keys)), base.coefficients)
