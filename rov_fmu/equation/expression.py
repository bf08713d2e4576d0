"""Expressions as values: built with operators, printed as C, Python, text or MathML, differentiated, and evaluated.

An expression is a number, a name, or an operation on expressions. Formulas are written as one writes them in Python:

    gain = Name("beta_u") / (Name("m_rov") + Name("m_a_u"))
    rate = gain * (Name("alpha_u") * Name("F_t") - Name("b_d_u") * Name("u"))
    to_c(rate)  # 'beta_u / (m_rov + m_a_u) * (alpha_u * F_t - b_d_u * u)'

Printing changes neither the order nor the association of operations, so C and Python compute the same floats.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import groupby
from operator import mul
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

Real: TypeAlias = "Expression | float"


def _operator(op: str) -> "Callable[[Expression, Real], Operation]":
    return lambda self, other: Operation(op, (self, of(other)))


def _from_right(op: str) -> "Callable[[Expression, Real], Operation]":
    return lambda self, other: Operation(op, (of(other), self))


class Expression:
    """A number, a name or an operation. Two expressions are equal if they are built alike."""

    __add__, __radd__ = _operator("+"), _from_right("+")
    __sub__, __rsub__ = _operator("-"), _from_right("-")
    __mul__, __rmul__ = _operator("*"), _from_right("*")
    __truediv__, __rtruediv__ = _operator("/"), _from_right("/")
    __lt__, __gt__, __ge__ = _operator("<"), _operator(">"), _operator(">=")

    def __neg__(self) -> "Operation":
        return Operation("neg", (self,))

    @cached_property
    def names(self) -> frozenset[str]:
        """The identifiers of the names in the expression."""
        return frozenset()


@dataclass(frozen=True)
class Number(Expression):
    """A number that is not negative."""

    value: float


@dataclass(frozen=True)
class Name(Expression):
    """A quantity: a variable of the FMU, or a quantity of the equation with its kind and its owners."""

    identifier: str
    """How the quantity is called in C and Python."""
    kind: str = ""
    """What the quantity is, such as "gain" or "command"; empty for a variable of the FMU."""
    owners: tuple[str, ...] = ()
    """Whose quantity it is: the name of a part of the vehicle, or the velocities of axes."""

    @cached_property
    def names(self) -> frozenset[str]:
        return frozenset({self.identifier})


@dataclass(frozen=True)
class Operation(Expression):
    """An operator, a choice or a function of expressions. A function that is not in FUNCTIONS is a thrust table."""

    op: str
    args: tuple[Expression, ...]

    @cached_property
    def names(self) -> frozenset[str]:
        return frozenset().union(*(arg.names for arg in self.args))


class Names:
    """The names of the quantities of one equation.

    An identifier is the kind and the owners of the quantity. Only where it is taken does the later quantity get a
    number: with the parts `rudder` and `max_rudder`, one of the two is `angle_max_rudder_2`.
    """

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._names: dict[tuple[str, ...], Name] = {}

    def __call__(self, kind: str, *owners: str) -> Name:
        """Return the name of a quantity, which is always the same."""
        key = kind, *owners
        if key not in self._names:
            identifier = unused("_".join(key), self._taken)
            self._taken.add(identifier)
            self._names[key] = Name(identifier, kind, owners)
        return self._names[key]

    def of_kind(self, kind: str) -> list[Name]:
        """Return the names of one kind so far."""
        return [name for name in self._names.values() if name.kind == kind]


def unused(text: str, taken: Iterable[str]) -> str:
    """Return a text, with the first number from 2 on that makes it none of the taken ones, if it is one of them."""
    number, free = 1, text
    while free in taken:
        number += 1
        free = f"{text}_{number}"
    return free


# ---- Building --------------------------------------------------------------------------------------------------------


def of(x: Real) -> Expression:
    """Return an expression, or a number as one."""
    if isinstance(x, Expression):
        return x
    return Operation("neg", (Number(-float(x)),)) if x < 0.0 else Number(float(x))


def call(function: str, *arguments: Real) -> Operation:
    """Return the value of one of FUNCTIONS, or of a thrust table, by its name."""
    return Operation(function, tuple(map(of, arguments)))


def where(test: Expression, then: Real, otherwise: Real) -> Operation:
    """Return a choice. Its derivative is that of the branch that is taken."""
    return Operation("if", (test, of(then), of(otherwise)))


def equal(a: Real, b: Real) -> Operation:
    """Return the test whether two numbers are equal."""
    return Operation("==", (of(a), of(b)))


def saturated(x: Expression) -> Operation:
    """Return a number, limited to [-1, 1]."""
    return Operation("saturated", (x,))


def directed(subject: Expression, forward: Real, reverse: Real) -> Expression:
    """Return the value for a subject that is not negative, or the other one for a negative subject."""
    one, other = of(forward), of(reverse)
    return one if one == other else Operation("directed", (subject, one, other))


def beyond_dead_band(beyond: Expression, dead_band: Expression, force: Expression) -> Operation:
    """Return a force where the command is beyond a dead band, whose width may be 0, and 0 within it."""
    return Operation("dead band", (beyond, dead_band, force))


def product(*factors: Real) -> Expression:
    """Return a product, from left to right. No factors give 1."""
    first, *others = map(of, factors or (1.0,))
    return reduce(mul, others, first)


def total(parts: Iterable[Expression]) -> Expression:
    """Return a sum, from left to right. A part that begins with a minus is subtracted. No parts give 0."""
    first, *others = [*parts] or [Number(0.0)]
    return reduce(lambda sum_, part: sum_ - minus(part) if _is_negative(part) else sum_ + part, others, first)


def minus(x: Expression) -> Expression:
    """Return a product with the other sign before its first factor: minus(a * b) is (-a) * b."""
    match x:
        case Operation("*" | "/" as op, (first, other)):
            return Operation(op, (minus(first), other))
        case Operation("neg", (inner,)):
            return inner
    return -x


def _is_negative(x: Expression) -> bool:
    while isinstance(x, Operation) and x.op in ("*", "/"):
        x = x.args[0]
    return isinstance(x, Operation) and x.op == "neg"


def scaled(weight: float, x: Expression) -> Expression:
    """Return a product with a weight before its first factor, or only with its sign if the weight is 1 or -1."""
    if weight < 0.0:
        return minus(scaled(-weight, x))
    if weight == 1.0:
        return x
    match x:
        case Operation("*", (first, other)):
            return scaled(weight, first) * other
    return weight * x


def replaced(x: Expression, formulas: Mapping[str, Expression]) -> Expression:
    """Return an expression in which formulas stand for some names, also for the names in these formulas."""
    match x:
        case Name(identifier) if identifier in formulas:
            return replaced(formulas[identifier], formulas)
        case Operation(op, args):
            return Operation(op, tuple(replaced(arg, formulas) for arg in args))
    return x


def plain(x: Expression) -> Expression:
    """Write the outermost operation as choices if it is `saturated`, `directed` or `beyond_dead_band`."""
    match x:
        case Operation("saturated", (a,)):
            return where(a > 1.0, 1.0, where(a < -1.0, -1.0, a))
        case Operation("directed", (subject, forward, reverse)):
            return where(subject < 0.0, reverse, forward)
        case Operation("dead band", (beyond, dead_band, force)):
            at_end = Operation("and", (equal(beyond, 0.0), dead_band > 0.0))
            return where(Operation("or", (beyond < 0.0, at_end)), 0.0, force)
    return x


# ---- Printing --------------------------------------------------------------------------------------------------------

FUNCTIONS = ("sin", "cos", "abs", "sqrt", "hypot", "pow", "log", "atan2", "atanh")
"""The functions of expressions besides the thrust tables."""
Ranks: TypeAlias = Mapping[str, tuple[int, tuple[int, ...]]]
_CALL = 9
_RANKS: Ranks = {
    **dict.fromkeys(("<", ">", ">=", "=="), (3, (4, 4))),
    **dict.fromkeys("+-", (4, (4, 5))),
    **dict.fromkeys("*/", (5, (5, 6))),
    "neg": (6, (6,)),
}
_CHOICES: Ranks = {"if": (0, (1, 1, 0)), "or": (1, (3, 3)), "and": (2, (3, 3))}


@dataclass(frozen=True)
class Language:
    """How a language writes expressions."""

    forms: Mapping[str, str]
    """The texts of operations, with {} or {0}, {1} ... for their operands."""
    ranks: Ranks = field(default_factory=lambda: {**_RANKS, **_CHOICES})
    """How strongly operations bind, and how strongly an operand must bind to stand without brackets.

    An operation that is not among them is a call, which binds with _CALL and whose operands need no brackets."""
    number: Callable[[float], str] = repr
    bracket: str = "({})"
    is_code: bool = True
    """True if an operation without a form is written as a + b or f(a, b). False if it cannot be written."""


C = Language(
    {"neg": "-{}", "if": "{} ? {} : {}", "and": "{} && {}", "or": "{} || {}", "abs": "fabs({})"},
    number=lambda value: "INFINITY" if value == math.inf else repr(value),
)
PYTHON = Language({"neg": "-{}", "if": "{1} if {0} else {2}"})
ARRAYS = Language({"neg": "-{}", "if": "where({}, {}, {})", "and": "both({}, {})", "or": "either({}, {})"}, _RANKS)
"""Python for arrays and symbols, which have no single truth value."""
_READERS: Ranks = {
    **_RANKS,
    "neg": (5, (5,)),
    "dead band": (0, (0, 0, 0)),
    **dict.fromkeys(("sin", "cos", "log"), (_CALL, (6,))),
    **dict.fromkeys(("square", "cube", "rate"), (_CALL, (_CALL,))),
    "pow": (_CALL, (_CALL, _CALL)),
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
    {**_READERS, "/": (8, (0, 0)), "dead band": (_CALL, (0, 0, 0))},
    "<mn>{:.4g}</mn>".format,
    _BRACKET,
    is_code=False,
)
"""The same as MathML, in which the bar of a fraction and the brace of a choice replace brackets."""


def to_c(x: Expression, name_in_c: Callable[[str], str] = str) -> str:
    """Write an expression in C. `name_in_c` gives the C expression for an identifier."""
    return written(x, C, lambda name: name_in_c(name.identifier))


def written(
    x: Expression, language: Language, name_of: Callable[[Name], str] = lambda name: name.identifier, least: int = 0
) -> str:
    """Write an expression in a language, in brackets if it binds less than the rank `least`.

    `name_of` says how a name is written. Raises ValueError if the language has no form for an operation.
    """
    match x:
        case Name():
            return name_of(x)
        case Number(value):
            return language.number(value)
        case Operation("directed", (_, Name(identifier, kind, owners), _)) if "directed" in language.forms:
            return name_of(Name(language.forms["directed"].format(identifier), kind, owners))
    shown = x if isinstance(x, Operation) and x.op in language.forms else plain(x)
    assert isinstance(shown, Operation)
    form = _form(shown, language)
    rank, operands = language.ranks.get(shown.op, (_CALL, (0,) * len(shown.args)))
    parts = [written(arg, language, name_of, need) for arg, need in zip(shown.args, operands, strict=True)]
    text = form.format(*parts)
    return text if rank >= least else language.bracket.format(text)


def _form(x: Operation, language: Language) -> str:
    if x.op not in language.forms and not language.is_code:
        raise ValueError(f"{written(x, PYTHON)}: there is no way to show this")
    usual = f"{{}} {x.op} {{}}" if x.op in language.ranks else f"{x.op}({', '.join('{}' for _ in x.args)})"
    return language.forms.get(x.op, usual)


# ---- Sums of products for readers ------------------------------------------------------------------------------------


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
        fraction = above / below if self.below else above
        return -fraction if self.sign < 0 else fraction


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
    for place, one in enumerate(_terms(x)):
        head = one.above[0] if len(one.above) > 1 else None
        key = f"{head.value:.12g}" if isinstance(head, Number) else head or place
        alike.setdefault(key, []).append(one)
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


# ---- Evaluation ------------------------------------------------------------------------------------------------------

_IN_PYTHON = {
    **{name: getattr(math, name) for name in FUNCTIONS if name != "abs"},
    "abs": abs,
    "inf": math.inf,
    "__builtins__": {},
}
_NOTHING: Mapping[str, Any] = MappingProxyType({})


def compiled(
    formulas: Mapping[str, Expression],
    functions: Mapping[str, Callable[..., Any]] = _NOTHING,
    language: Language = PYTHON,
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Compile formulas into one function. It takes values by name, and adds the values of the formulas to them.

    The formulas are evaluated in their order, and each may use those before it. `functions` are those of thrust tables,
    and replace others of the same name; with ARRAYS they are those of a library of arrays or symbols.
    """
    lines = [f"{name} = {written(formula, language)}" for name, formula in formulas.items()]
    known, code = {**_IN_PYTHON, **functions}, compile("\n".join(lines), "<formulas>", "exec")

    def evaluate(values: Mapping[str, Any]) -> dict[str, Any]:
        variables = dict(values)
        exec(code, known, variables)
        return variables

    return evaluate


def array_functions(library: Any) -> dict[str, Callable[..., Any]]:
    """Return the functions of formulas in ARRAYS, of NumPy or of a library that has the same names."""
    other = {"pow": "power", "both": "logical_and", "either": "logical_or", "atanh": "arctanh", "atan2": "arctan2"}
    names = {name: name for name in (*FUNCTIONS, "where")} | other
    return {name: getattr(library, theirs) for name, theirs in names.items()}


# ---- Derivatives -----------------------------------------------------------------------------------------------------


def slope_name(table: str) -> str:
    """Return the name of the derivative of a thrust table."""
    return f"slope_of_{table}"


def change_of(name: str) -> Name:
    """Return the name of the change of a quantity. No other identifier begins so."""
    return Name(f"change_of_{name}", "change", (name,))


Change: TypeAlias = "Expression | None"
"""The change of an expression, or None if it does not change."""


def tangent(x: Expression, changes: Callable[[str], Change]) -> Change:
    """Return the change of an expression: the sum of its partial derivatives times the changes of its names.

    `changes` gives the change of a name by its identifier.
    """
    x = plain(x)
    if isinstance(x, Name):
        return changes(x.identifier)
    if not isinstance(x, Operation):
        return None
    args = x.args[1:] if x.op == "if" else x.args
    d = [tangent(arg, changes) for arg in args]
    changing = [change for change in d if change]
    if not changing:
        return None
    return _of_function(x, args[0], changing[0]) if len(args) == 1 else _of_two(x, args, d)


def _of_two(x: Operation, args: Sequence[Expression], changes: Sequence[Change]) -> Change:
    """Return the change of an operation with two arguments, by the changes of these."""
    (a, b), (left, right) = changes, args
    match x.op:
        case "if":
            return where(x.args[0], a or 0.0, b or 0.0)
        case "+" | "-":
            return _added(a, x.op, b)
        case "*":
            return _added(_times(a, right), "+", b and left * b)
        case "/":
            return _over(_added(a, "-", b and x * b), right)
        case "atan2":
            return _over(_added(_times(a, right), "-", _times(b, left)), left * left + right * right)
    assert x.op == "pow"  # the base is not negative
    logarithm = where(left > 0.0, call("log", left), 0.0)
    return _added(a and right * call("pow", left, right - 1.0) * a, "+", b and x * logarithm * b)


def tangents(
    formulas: Mapping[str, Expression], given: Iterable[str]
) -> tuple[dict[str, Expression], dict[str, Expression]]:
    """Return formulas, each with the formula of its change after it, and the changes by the names that change.

    `given` are the variables whose changes are known.
    """
    changes: dict[str, Expression] = {name: change_of(name) for name in given}
    steps: dict[str, Expression] = {}
    for name, formula in formulas.items():
        steps[name] = formula
        if change := tangent(formula, changes.get):
            changes[name] = change_of(name)
            steps[change_of(name).identifier] = change
    return steps, changes


def _of_function(x: Operation, argument: Expression, change: Expression) -> Expression:
    """Return the change of a function of one argument, or of its negative, by the change of the argument."""
    slopes: dict[str, Callable[[], Expression]] = {
        "neg": lambda: -change,
        "abs": lambda: where(argument < 0.0, -change, change),
        "sqrt": lambda: change / (2.0 * x),
        "log": lambda: change / argument,
        "sin": lambda: call("cos", argument) * change,
        "cos": lambda: -call("sin", argument) * change,
    }
    return slopes[x.op]() if x.op in slopes else call(slope_name(x.op), argument) * change


def _times(change: Change, factor: Expression) -> Change:
    return change and change * factor


def _over(change: Change, divisor: Expression) -> Change:
    return change and change / divisor


def _added(a: Change, op: str, b: Change) -> Change:
    if a is None or b is None:
        return a if b is None else b if op == "+" else -b
    return Operation(op, (a, b))
