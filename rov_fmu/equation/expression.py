"""Expressions as values: built with operators, printed as C or Python, differentiated, and evaluated.

An expression is a number, a name, or an operation on expressions. Formulas are written as one writes them in Python:

    gain = Name("beta_u") / (Name("m_rov") + Name("m_a_u"))
    rate = gain * (Name("alpha_u") * Name("F_t") - Name("b_d_u") * Name("u"))
    to_c(rate)  # 'beta_u / (m_rov + m_a_u) * (alpha_u * F_t - b_d_u * u)'

Printing changes neither the order nor the association of operations, so C and Python compute the same floats.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce
from operator import mul
from types import MappingProxyType
from typing import Any, TypeAlias

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
    number, found = 1, text
    while found in taken:
        number += 1
        found = f"{text}_{number}"
    return found


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
_RANK = {"if": 0, "or": 1, "and": 2, "<": 3, ">": 3, ">=": 3, "==": 3, "+": 4, "-": 4, "*": 5, "/": 5, "neg": 6}
"""How strongly operations bind."""
_CALL = 9


@dataclass(frozen=True)
class Language:
    """How a language writes what differs between languages."""

    choice: str
    both: str = " and "
    either: str = " or "
    functions: Mapping[str, str] = field(default_factory=dict)
    """The names of functions, if they are others."""
    infinity: str = "inf"
    is_branchless: bool = False
    """True if choices, `both` and `either` are functions."""


C = Language("{0} ? {1} : {2}", " && ", " || ", {"abs": "fabs"}, "INFINITY")
PYTHON = Language("{1} if {0} else {2}")
ARRAYS = Language("where({0}, {1}, {2})", "both({}, {})", "either({}, {})", is_branchless=True)
"""Python for arrays and symbols, which have no single truth value."""


def to_c(x: Expression, name_in_c: Callable[[str], str] = str) -> str:
    """Write an expression in C. `name_in_c` gives the C expression for an identifier."""
    return written(x, C, name_in_c)


def written(x: Expression, language: Language, name_of: Callable[[str], str] = str, least: int = 0) -> str:
    """Write an expression in a language, in brackets if it binds less than the rank `least`."""

    def part(x: Expression, least: int) -> str:
        return written(x, language, name_of, least)

    x = plain(x)
    if isinstance(x, Name):
        return name_of(x.identifier)
    if isinstance(x, Number):
        return language.infinity if x.value == math.inf else repr(x.value)
    assert isinstance(x, Operation)
    rank = _CALL if language.is_branchless and x.op in ("if", "and", "or") else _RANK.get(x.op, _CALL)
    match x.op, x.args:
        case "neg", (a,):
            text = f"-{part(a, 6)}"
        case "if", (test, a, b):
            text = language.choice.format(part(test, 1), part(a, 1), part(b, 0))
        case "and" | "or" as op, args:
            word = language.both if op == "and" else language.either
            texts = [part(a, 3) for a in args]
            text = reduce(word.format, texts) if language.is_branchless else word.join(texts)
        case op, (a, b) if rank == 3:
            text = f"{part(a, 4)} {op} {part(b, 4)}"
        case op, (a, b) if rank < _CALL:
            text = f"{part(a, rank)} {op} {part(b, rank + 1)}"
        case function, args:
            text = f"{language.functions.get(function, function)}({', '.join(part(a, 0) for a in args)})"
    return text if rank >= least else f"({text})"


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
        found = dict(values)
        exec(code, known, found)
        return found

    return evaluate


# ---- Derivatives -----------------------------------------------------------------------------------------------------


def slope_name(table: str) -> str:
    """Return the name of the derivative of a thrust table."""
    return f"slope_of_{table}"


def change_of(name: str) -> Name:
    """Return the name of the change of a quantity. No other identifier begins so."""
    return Name(f"change_of_{name}", "change", (name,))


Change: TypeAlias = "Expression | None"
"""The change of an expression, or None if it does not change."""


def tangent(  # noqa: PLR0911 - a case for each operation
    x: Expression, changes: Callable[[str], Change]
) -> Change:
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
    if all(change is None for change in d):
        return None
    if len(args) == 1:
        return _of_function(x, args[0], of(d[0] or 0.0))
    (a, b), (left, right) = d, args
    match x.op:
        case "if":
            return where(x.args[0], a or 0.0, b or 0.0)
        case "+" | "-":
            return _added(a, x.op, b)
        case "*":
            return _added(a and a * right, "+", b and left * b)
        case "/":
            return of(_added(a, "-", b and x * b) or 0.0) / right
        case "atan2":
            rate = _added(a and a * right, "-", b and b * left)
            return of(rate or 0.0) / (left * left + right * right)
    assert x.op == "pow"  # the base is not negative
    logarithm = where(left > 0.0, call("log", left), 0.0)
    return _added(a and right * call("pow", left, right - 1.0) * a, "+", b and x * logarithm * b)


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


def _added(a: Change, op: str, b: Change) -> Change:
    if a is None or b is None:
        return a if b is None else b if op == "+" else -b
    return Operation(op, (a, b))
