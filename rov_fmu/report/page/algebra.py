"""Arrange formulas as a person writes them: sums of products, with fractions, common factors and absolute values.

`Reader` turns a formula of rov_fmu/model/equation.py into a `Sum` of the same value. It leaves out only the saturation
of commands, which the text beside the equations mentions.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from rov_fmu.model.expression import FUNCTIONS, PYTHON, Expression, Name, Number, Operation, written


@dataclass(frozen=True)
class Product:
    """A sign, the factors above the fraction bar, and those below it."""

    sign: int = 1
    above: "tuple[Factor, ...]" = ()
    below: "tuple[Factor, ...]" = ()


Sum: TypeAlias = tuple[Product, ...]
"""A sum of products. It is 0 if it is empty."""


@dataclass(frozen=True)
class Group:
    """A sum in brackets."""

    inner: Sum


@dataclass(frozen=True)
class Call:
    """A function of a sum: sin, cos, abs, sqrt, sgn (the sign), or atan2, which has a second argument."""

    function: str
    inner: Sum
    second: Sum = ()


@dataclass(frozen=True)
class Choice:
    """One of two parameters: the first where a variable is positive, the other where it is negative."""

    forward: str
    reverse: str
    subject: str


@dataclass(frozen=True)
class Cases:
    """A value where a variable is at most 0, and another value elsewhere."""

    name: str
    at_most_zero: Sum
    otherwise: Sum


Factor: TypeAlias = "str | float | Group | Call | Choice | Cases"


class Reader:
    """Reads formulas.

    The names in `inlined` are replaced by their formulas.
    """

    def __init__(self, inlined: Mapping[str, Expression]) -> None:
        self._inlined = inlined

    def read(self, x: Expression) -> Sum:
        """Return a formula as a sum. Raises ValueError if there is no way to show it."""
        match x:
            case Number(value):
                return _number(value)
            case Name(identifier):
                inlined = self._inlined.get(identifier)
                return (Product(1, (identifier,)),) if inlined is None else self.read(inlined)
            case Operation("directed", (subject, forward, reverse)):
                (name,) = self.read(subject)
                return _directed(name, self.read(forward), self.read(reverse))
            case Operation("dead band", (Name(identifier), _, force)):
                return (Product(1, (Cases(identifier, (), self.read(force)),)),)
            case Operation(op, args) if op in _ALGEBRA:
                return _ALGEBRA[op](*map(self.read, args))
            case Operation(op, args) if op in FUNCTIONS:
                return (Product(1, (Call(op, *map(self.read, args)),)),)
        raise ValueError(f"{written(x, PYTHON)}: there is no way to show this")


# ---- Sums and products -----------------------------------------------------------------------------------------------


def _number(value: float) -> Sum:
    """Return a number as a sum of one product, or as an empty sum."""
    return (Product(1, () if value == 1.0 else (value,)),) if value else ()


def negative(terms: Sum) -> Sum:
    """Return the sum with the other sign."""
    return tuple(replace(product, sign=-product.sign) for product in terms)


def inverse(terms: Sum) -> Sum:
    """Return 1 over the sum."""
    single = _single(terms)
    return (Product(single.sign, single.below, single.above),)


def times(left: Sum, right: Sum) -> Sum:
    """Return the product of two sums. A sum times names is multiplied out: (a x + b) x is a x x + b x."""
    if not left or not right:
        return ()
    last = _single(right)
    if len(left) > 1 and not last.below and all(isinstance(factor, str | Call) for factor in last.above):
        return tuple(product for term in left for product in times((term,), right))
    first = _single(left)
    above, below = [*first.above, *last.above], [*first.below, *last.below]
    for factor in [*above]:
        if factor in below:
            above.remove(factor)
            below.remove(factor)
    return (Product(first.sign * last.sign, _signs_absorbed(tuple(above)), tuple(below)),)


def _single(terms: Sum) -> Product:
    """Return a sum as one product, in brackets unless it is one already."""
    return terms[0] if len(terms) == 1 else Product(1, (Group(terms),))


def _signs_absorbed(factors: tuple[Factor, ...]) -> tuple[Factor, ...]:
    """Write sgn(x) x as |x| and sgn(x) |x| as x, also where each term of a sum in brackets has this factor."""
    for sign in [f for f in factors if isinstance(f, Call) and f.function == "sgn"]:
        rest = list(factors)
        rest.remove(sign)
        x, size = _single(sign.inner).above[0], Call("abs", sign.inner)
        for place, factor in enumerate(rest):
            if isinstance(factor, Group):
                terms = [found for product in factor.inner if (found := _replaced(product, size, x))]
                if len(terms) == len(factor.inner):
                    return (*rest[:place], Group(tuple(terms)), *rest[place + 1 :])
        for old, new in ((size, x), (x, size)):
            if old in rest:
                rest[rest.index(old)] = new
                return tuple(rest)
    return factors


def _replaced(product: Product, old: Factor, new: Factor) -> Product | None:
    """Return the product with the last of its factors `old` replaced, or None if it has no such factor."""
    if old not in product.above:
        return None
    place = len(product.above) - 1 - product.above[::-1].index(old)
    return replace(product, above=(*product.above[:place], new, *product.above[place + 1 :]))


_ALGEBRA: Mapping[str, Callable[..., Sum]] = {
    "neg": negative,
    "+": lambda left, right: left + right,
    "-": lambda left, right: left + negative(right),
    "*": times,
    "/": lambda left, right: times(left, inverse(right)),
    "saturated": lambda x: x,
}
"""What operations make of the sums that they are applied to."""


def _directed(subject: Product, forward: Sum, reverse: Sum) -> Sum:
    """Return two values, of which one holds forward and the other in reverse, as one sum.

    Parameters that differ become a `Choice`; if the signs differ, the product gets the factor sgn.
    """
    if not forward and not reverse:
        return ()
    sign = Product(1, (Call("sgn", (subject,)),))
    if forward == negative(reverse):
        return times((sign,), (_single(forward),))
    (one,), (other,) = forward, reverse
    (name,) = subject.above
    above: list[Factor] = []
    for a, b in zip(one.above, other.above, strict=True):
        if a == b:
            above.append(a)
        elif isinstance(a, str) and isinstance(b, str) and isinstance(name, str):
            above.append(Choice(a, b, name))
        else:
            raise ValueError(f"{a} and {b}: there is no way to show this choice")
    both = Product(one.sign, tuple(above), one.below)
    return (both,) if one.sign == other.sign else times((both,), (sign,))


def arranged(terms: Sum) -> Sum:
    """Return the sum with numbers first, common first factors before brackets, and no unnecessary brackets."""
    flat: list[Product] = []
    for product in terms:
        above = sorted((_tidied(factor) for factor in product.above), key=lambda f: not isinstance(f, float))
        if above and isinstance(above[0], Group) and len(above) == 1 and not product.below:
            flat += [replace(p, sign=p.sign * product.sign) for p in above[0].inner]
            continue
        sign, factors = product.sign, list[Factor]()
        for factor in above:
            if isinstance(factor, Group) and all(p.sign < 0 for p in factor.inner):
                sign, factor = -sign, Group(negative(factor.inner))  # noqa: PLW2901
            if isinstance(factor, Group) and len(factor.inner) == 1 and not factor.inner[0].below:
                sign *= factor.inner[0].sign
                factors += factor.inner[0].above
            else:
                factors.append(factor)
        flat.append(Product(sign, tuple(sorted(factors, key=lambda f: not isinstance(f, float))), product.below))
    return _with_common_factors(tuple(flat))


def _tidied(factor: Factor) -> Factor:
    """Return the factor with the sums inside it arranged."""
    if isinstance(factor, Group):
        return Group(arranged(factor.inner))
    if isinstance(factor, Cases):
        return replace(factor, at_most_zero=arranged(factor.at_most_zero), otherwise=arranged(factor.otherwise))
    return factor


def _with_common_factors(terms: Sum) -> Sum:
    """Return the sum with a common first factor of several products before a bracket: a x - a y becomes a (x - y).

    Numbers count as equal if their first twelve digits are.
    """
    together: dict[object, list[Product]] = {}
    for place, product in enumerate(terms):
        head = product.above[0] if len(product.above) > 1 else None
        key: object = head
        if head is None:
            key = place  # a product of one factor shares it with no other
        elif isinstance(head, float):
            key = f"{head:.12g}"
        together.setdefault(key, []).append(product)
    found: list[Product] = []
    for first, *others in together.values():
        if not others:
            found.append(first)
            continue
        rest = tuple(Product(p.sign * first.sign, p.above[1:], p.below) for p in (first, *others))
        found += arranged((Product(first.sign, (first.above[0], Group(arranged(rest)))),))
    return tuple(found)
