"""Formulas as readers see them: plain text and MathML, and the sums of products that people write.

`collected` brings a formula into the form in which one writes it by hand. TEXT and MATHML are languages for `written`.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from typing import NamedTuple

from rov_fmu.equation.expression import (
    CALL,
    RANKS,
    Expression,
    Language,
    Number,
    Operation,
    Ranks,
    call,
    product,
    total,
)

_READERS: Ranks = {
    **RANKS,
    "neg": (5, (5,)),
    "dead band": (0, (0, 0, 0)),
    **dict.fromkeys(("sin", "cos", "log"), (CALL, (6,))),
    **dict.fromkeys(("square", "cube", "rate"), (CALL, (CALL,))),
    "pow": (CALL, (CALL, CALL)),
}
TEXT = Language(
    {
        **{"+": "{} + {}", "-": "{} − {}", "*": "{} {}", "/": "{} / {}", "neg": "−{}"},
        **{"square": "{}²", "cube": "{}³", "pow": "{}^{}", "abs": "|{}|", "sqrt": "√({})", "atan2": "atan2({}, {})"},
        **{name: f"{name} {{}}" for name in ("sin", "cos", "log")},
        **{"sgn": "sgn({})", "rate": "{}'", "directed": "{}±", "dead band": "{2} where {0} > 0, else 0"},
    },
    _READERS,
    "{:.4g}".format,
    is_code=False,
)
"""Plain text for readers, of what `collected` returns. A coefficient that depends on a direction has a ±."""
_BRACKET = '<mrow><mo stretchy="false">(</mo>{}<mo stretchy="false">)</mo></mrow>'
_CELL = '<mtd style="text-align: left">'
MATHML = Language(
    {
        **{"+": "{}<mo>+</mo>{}", "-": "{}<mo>−</mo>{}", "neg": '<mo form="prefix">−</mo>{}'},
        "*": '{}<mspace width=".1em"/>{}',
        "/": "<mfrac><mrow>{}</mrow><mrow>{}</mrow></mfrac>",
        **{"square": "<msup>{}<mn>2</mn></msup>", "cube": "<msup>{}<mn>3</mn></msup>", "pow": "<msup>{}{}</msup>"},
        "abs": '<mrow><mo stretchy="false">|</mo>{}<mo stretchy="false">|</mo></mrow>',
        **{"sqrt": "<msqrt>{}</msqrt>", "atan2": f"<mi>atan2</mi>{_BRACKET.format('{}<mo>,</mo>{}')}"},
        **{
            name: f'<mspace width=".07em"/><mi>{name}</mi><mspace width=".17em"/>{{}}' for name in ("sin", "cos", "log")
        },
        **{"sgn": f"<mi>sgn</mi>{_BRACKET}", "rate": "<mover>{}<mo>˙</mo></mover>", "directed": "{}±"},
        "dead band": "<mrow><mo>{{</mo><mtable>"
        f"<mtr>{_CELL}{{2}}</mtd>{_CELL}<mtext>for\xa0</mtext>{{0}}<mo>&gt;</mo><mn>0</mn></mtd></mtr>"
        f"<mtr>{_CELL}<mn>0</mn></mtd>{_CELL}<mtext>otherwise</mtext></mtd></mtr></mtable></mrow>",
    },
    {**_READERS, "/": (8, (0, 0)), "dead band": (CALL, (0, 0, 0))},
    "<mn>{:.4g}</mn>".format,
    _BRACKET,
    is_code=False,
)
"""The same as MathML, in which the bar of a fraction and the brace of a choice replace brackets."""


class _Product(NamedTuple):
    """A sign, the factors above the fraction bar, and those below it. A factor is not a product itself."""

    sign: int = 1
    above: tuple[Expression, ...] = ()
    below: tuple[Expression, ...] = ()

    def times(self, other: "_Product") -> "_Product":
        """Return the product of both, with numbers first."""
        above = sorted((*self.above, *other.above), key=lambda factor: not isinstance(factor, Number))
        return _Product(self.sign * other.sign, tuple(above), (*self.below, *other.below))

    def formula(self, factors: Callable[[Iterable[Expression]], Iterable[Expression]] = iter) -> Expression:
        """Return the product as an expression. `factors` changes its factors."""
        above, below = product(*factors(self.above)), product(*factors(self.below))
        fraction = above / below
        return Operation("neg", (fraction,)) if self.sign < 0 else fraction  # before the bar of the fraction


def collected(x: Expression) -> Expression:
    """Return a formula as one writes it: a sum of products, in the order in which it is built.

    Numbers come first, equal factors form a power, and a common first factor stands before a bracket: a x - a y becomes
    a (x - y). Numbers count as equal if their first twelve digits are. The value changes by rounding only.
    """
    return total(one.formula(_powers) for one in _products(x))


def _powers(factors: Iterable[Expression]) -> Iterator[Expression]:
    """Yield factors, with what is within them collected. A factor that repeats becomes a square or a cube."""
    for factor, equal_ones in groupby(factors):
        inner, count = factor, len([*equal_ones])
        if isinstance(factor, Operation):
            within = tuple(map(collected, factor.args))
            inner = collected(factor) if _is_sum(factor) else Operation(factor.op, within)
        yield from [inner] if count == 1 else [call({2: "square", 3: "cube"}[count], inner)]


def _products(x: Expression) -> list[_Product]:
    """Return the products of which a formula is the sum, with each common first factor before a bracket."""
    alike: dict[object, list[_Product]] = {}
    for index, term in enumerate(_terms(x)):
        head = term.above[0] if len(term.above) > 1 else None
        key = f"{head.value:.12g}" if isinstance(head, Number) else head or index
        alike.setdefault(key, []).append(term)
    products = []
    for first, *others in alike.values():
        rest = total(_Product(one.sign * first.sign, one.above[1:], one.below).formula() for one in (first, *others))
        products.append(_Product(first.sign, first.above[:1]).times(_product(rest)) if others else first)
    return products


def _terms(x: Expression) -> list[_Product]:
    match x:
        case Number(0.0):
            return []
        case Operation("+" | "-" as op, (left, right)):
            sign = _Product(1 if op == "+" else -1)
            return _terms(left) + [sign.times(one) for one in _terms(right)]
    whole = _product(x)
    if len(whole.above) == 1 and not whole.below and _is_sum(whole.above[0]):
        return [_Product(whole.sign).times(one) for one in _terms(whole.above[0])]
    return [whole]


def _is_sum(x: Expression) -> bool:
    return isinstance(x, Operation) and x.op in ("+", "-")


def _product(x: Expression) -> _Product:  # noqa: PLR0911 - a case for each operation
    """Return a formula as one product, in which a sum of several products is a factor."""
    match x:
        case Number(1.0):
            return _Product()
        case Operation("neg", (inner,)):
            return _Product(-1).times(_product(inner))
        case Operation("*", (left, right)):
            return _product(left).times(_product(right))
        case Operation("/", (left, right)):
            below = _product(right)
            return _product(left).times(_Product(below.sign, below.below, below.above))
        case Operation("+" | "-"):
            terms = _products(x)
            if len(terms) == 1:
                return terms[0]
            if all(one.sign < 0 for one in terms):
                return _Product(-1, (total(one._replace(sign=1).formula() for one in terms),))
    return _Product(1, (x,))
