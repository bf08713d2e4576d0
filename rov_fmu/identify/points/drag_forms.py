"""The forms that the drag of an axis may have by its points: both parts or one of them, the same both ways or not."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from rov_fmu.identify.forms import widened
from rov_fmu.model.layout import REVERSE, Axis
from rov_fmu.model.rov import Rov

LEFT_OUT = "Left at 0: neither the information criterion (AICc) nor leave-one-thrust-out misses it"


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
    """Standard error, of a point from a recording."""


@dataclass(frozen=True)
class DragForm:
    """One form: what is fitted, what is left at zero."""

    axis: Axis
    base: Rov
    """With the keys of the form; holds all that is not fitted."""
    names: tuple[str, ...]
    zero: tuple[str, ...]
    assumed: dict[str, str]
    """Coefficients that are not identifiable, and what is assumed instead."""
    what: str = ""

    @property
    def keys(self) -> tuple[str, ...]:
        """Of AXIS."""
        return self.base.layout.kinds[self.axis.name].keys

    @property
    def is_open(self) -> bool:
        """Whether it is another than the plain one."""
        return bool(self.what)

    def is_told_by(self, points: Sequence[Point]) -> bool:
        """Whether so few points would tell it too."""
        beta = self.axis.coefficient("beta")
        if beta in self.names and not any(p.quantity == "Tau" for p in points):
            return False
        ways = (1.0, -1.0) if self.axis.coefficient("a_d" + REVERSE) in self.names else (0.0,)
        drag = [name for name in self.names if name != beta]
        return all(len(levels(points, way)) >= min(len(drag) // len(ways), 2) for way in ways)


def level(point: Point) -> float:
    """The strength of the command."""
    return round(abs(point.command), 6)


def levels(points: Sequence[Point], way: float = 0.0) -> set[float]:
    """Strengths of the commands, of one direction (1, -1) or both (0)."""
    return {level(p) for p in points if way * p.command >= 0.0}


def drag_and_beta(axis: Axis, known: Collection[str] = ()) -> tuple[str, ...]:
    """Names of a_d, b_d and β of an axis, as far as they are not known."""
    return tuple(name for kind in ("a_d", "b_d", "beta") if (name := axis.coefficient(kind)) not in known)


def free_coefficients(
    axis: Axis, used: Sequence[Point], known: Collection[str]
) -> tuple[tuple[str, ...], dict[str, tuple[float, str]]]:
    """Coefficients to fit, and those that are not identifiable: the value assumed, and the reason."""
    a_d, b_d, beta = drag_and_beta(axis)
    assumed: dict[str, tuple[float, str]] = {}
    if b_d not in known and a_d not in known and len(levels(used)) < 2:
        assumed[b_d] = (0.0, "Linear and quadratic drag are not identifiable apart from one thrust; assumed 0")
    if beta not in known and not any(p.quantity == "Tau" for p in used):
        assumed[beta] = (1.0, f"{axis.inertia}/{beta} is not identifiable from V_ss alone; assumed 1")
    return drag_and_beta(axis, {*known, *assumed}), assumed


def candidate_forms(axis: Axis, points: Sequence[Point], base: Rov, known: Collection[str]) -> Iterator[DragForm]:
    """The plain form first, linear and quadratic drag the same both ways; then what the points could tell beside it."""
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
        if not set(reverse) & set(known) and all(len(levels(steady, way)) >= 2 for way in (1.0, -1.0)):
            base = _having(base, axis, known, by_direction=True)
            both = DragForm(axis, base, (*names, *reverse), (), assumed, "drag by direction")
            yield both
            yield from (_alone(both, key, ", by direction") for key in ("a_d", "b_d"))


def _alone(form: DragForm, kind: str, way: str) -> DragForm:
    """The form with quadratic or linear drag alone."""
    other, words = {"a_d": ("b_d", "quadratic"), "b_d": ("a_d", "linear")}[kind]
    zero = tuple(name for name in form.names if name.startswith(other))
    names = tuple(name for name in form.names if name not in zero)
    what = f"{words} drag alone{way}"
    return replace(form, base=form.base.replaced(dict.fromkeys(zero, 0.0)), names=names, zero=zero, what=what)


def _having(base: Rov, axis: Axis, known: Collection[str], *, by_direction: bool) -> Rov:
    """The vehicle with drag by direction, or the same both ways unless the reverse is known."""
    if by_direction:
        return base.extended({axis.coefficient(key + REVERSE): base[axis.coefficient(key)] for key in ("a_d", "b_d")})
    form = base.layout.kinds[axis.name]
    keys = tuple(k for k in form.keys if k.removesuffix(REVERSE) == k or axis.coefficient(k) in known)
    return Rov(widened(base.layout, replace(form, keys=keys)), base.coefficients)
