"""Expressions as values: built with operators, printed as C or Python, evaluated, and differentiated.

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
from operator import add, mul
from types import MappingProxyType
from typing import Any, TypeAlias

Real: TypeAlias = "Expression | float"


def _operator(op: str) -> "Callable[[Expression, Real], Expression]":
    return lambda self, other: _folded(op, self, of(other))


def _from_right(op: str) -> "Callable[[Expression, Real], Expression]":
    return lambda self, other: _folded(op, of(other), self)


class Expression:
    """A number, a name or an operation. Two expressions are equal if they are built alike.

    Operators leave out what 0, 1 and -1 do not change: 0 + x and 1 * x are x, 0 * x is 0, and -1 * x is -x. A sign
    stands before the first factor of a product, and x + -a * b becomes x - a * b. None of this changes a bit of a
    value, except for the sign of a zero. A number becomes the first factor of a product, 2 * (a * b) = (2 * a) * b.
    """

    __add__, __radd__ = _operator("+"), _from_right("+")
    __sub__, __rsub__ = _operator("-"), _from_right("-")
    __mul__, __rmul__ = _operator("*"), _from_right("*")
    __truediv__, __rtruediv__ = _operator("/"), _from_right("/")
    __lt__, __gt__, __ge__ = _operator("<"), _operator(">"), _operator(">=")

    def __neg__(self) -> "Expression":
        return _negative(self)

    def __abs__(self) -> "Expression":
        return Operation("abs", (self,))

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
    """An operator, a choice, or a function of expressions: one of the language, or a table of thrust by its name."""

    op: str
    args: tuple[Expression, ...]

    @cached_property
    def names(self) -> frozenset[str]:
        return frozenset().union(*(arg.names for arg in self.args))


ZERO, ONE = Number(0.0), Number(1.0)


def _number(x: Expression) -> float | None:
    """Return the value of a number, or None for other expressions."""
    if isinstance(x, Operation) and x.op == "neg":
        inner = _number(x.args[0])
        return None if inner is None else -inner
    return x.value if isinstance(x, Number) else None


def _folded(op: str, a: Expression, b: Expression) -> Expression:  # noqa: PLR0911 - a case for each rule
    match op, _number(a), _number(b):
        case (_, None, None) if op not in "+-" or not _is_negative(b):
            return Operation(op, (a, b))
        case ("*" | "/", 0.0, _) | ("*", _, 0.0):
            return ZERO
        case ("+", 0.0, _) | ("*", 1.0, _):
            return b
        case ("+" | "-", _, 0.0) | ("*" | "/", _, 1.0):
            return a
        case ("-", 0.0, _) | ("*", -1.0, _):
            return -b
        case ("*", _, -1.0):
            return -a
        case ("+" | "-", _, _) if _is_negative(b):
            return a - -b if op == "+" else a + -b
        case ("*", float(), _) if isinstance(b, Operation) and b.op == "*":
            return a * b.args[0] * b.args[1]
    return Operation(op, (a, b))


def _negative(x: Expression) -> Expression:
    match x:
        case Number(0.0):
            return x
        case Operation("neg", (inner,)):
            return inner
        case Operation("*" | "/" as op, (first, other)):
            return Operation(op, (-first, other))
    return Operation("neg", (x,))


def _is_negative(x: Expression) -> bool:
    while isinstance(x, Operation) and x.op in ("*", "/"):
        x = x.args[0]
    return isinstance(x, Operation) and x.op == "neg"


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


class Formulas(dict[str, Expression]):
    """Formulas by the identifiers of their names, in the order of their evaluation: each may use those before it."""

    def __init__(self, names: Names, formulas: "Mapping[str, Expression]" = MappingProxyType({})) -> None:
        super().__init__(formulas)
        self.names = names

    def define(self, formula: Expression, kind: str, *owners: str) -> Name:
        """Add a formula for a quantity of the equation, and return the name of the quantity."""
        name = self.names(kind, *owners)
        self[name.identifier] = formula
        return name


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


def where(test: Expression, then: Real, otherwise: Real) -> Expression:
    """Return a choice. Its derivative is that of the branch that is taken."""
    return _chosen("if", test, then, otherwise)


def _chosen(op: str, by: Expression, one: Real, other: Real) -> Expression:
    """Return a choice, or what both branches have in common."""
    branches = of(one), of(other)
    return branches[0] if branches[0] == branches[1] else Operation(op, (by, *branches))


def equal(a: Real, b: Real) -> Operation:
    """Return the test whether two numbers are equal."""
    return Operation("==", (of(a), of(b)))


def saturated(x: Expression) -> Operation:
    """Return a number, limited to [-1, 1]."""
    return Operation("saturated", (x,))


def directed(subject: Expression, forward: Real, reverse: Real) -> Expression:
    """Return the value for a subject that is not negative, or the other one for a negative subject."""
    return _chosen("directed", subject, forward, reverse)


def beyond_dead_band(beyond: Expression, dead_band: Expression, force: Expression) -> Operation:
    """Return 0 for |c| < c_0, and otherwise the force. `beyond` is |c| - c_0. The width c_0 may be 0."""
    return Operation("dead band", (beyond, dead_band, force))


def product(*factors: Real) -> Expression:
    """Return a product, from left to right. No factors give 1."""
    return reduce(mul, map(of, factors), Number(1.0))


def total(parts: Iterable[Expression]) -> Expression:
    """Return a sum, from left to right. No parts give 0."""
    return reduce(add, parts, Number(0.0))


def with_positive_zero(x: Expression) -> Operation:
    """Return x + 0, which makes 0.0 of -0.0. The operator + would leave it out."""
    return Operation("+", (x, Number(0.0)))


def replaced(x: Expression, formulas: Mapping[str, Expression]) -> Expression:
    """Return an expression in which formulas stand for some names, also for the names in these formulas."""
    match x:
        case Name(identifier) if identifier in formulas:
            return replaced(formulas[identifier], formulas)
        case Operation(op, args):
            return Operation(op, tuple(replaced(arg, formulas) for arg in args))
    return x


_CHOICES_BY_NAME = frozenset({"saturated", "directed", "dead band"})
"""The operations that `plain` writes as choices."""


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
CALL = 9
RANKS: Ranks = {
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
    ranks: Ranks = field(default_factory=lambda: {**RANKS, **_CHOICES})
    """How strongly operations bind, and how strongly an operand must bind to stand without brackets.

    An operation that is not among them is a call, which binds with CALL and whose operands need no brackets."""
    number: Callable[[float], str] = repr
    bracket: str = "({})"


C = Language(
    {"neg": "-{}", "if": "{} ? {} : {}", "and": "{} && {}", "or": "{} || {}", "abs": "fabs({})"},
    number=lambda value: "INFINITY" if value == math.inf else repr(value),
)
PYTHON = Language({"neg": "-{}", "if": "{1} if {0} else {2}"})
ARRAYS = Language({"neg": "-{}", "if": "where({}, {}, {})", "and": "both({}, {})", "or": "either({}, {})"}, RANKS)
"""Python for arrays and symbols, which have no single truth value."""


def to_c(x: Expression, name_in_c: Callable[[str], str] = str) -> str:
    """Write an expression in C. `name_in_c` gives the C expression for an identifier."""
    return written(x, C, lambda name: name_in_c(name.identifier))


def written(
    x: Expression, language: Language, name_of: Callable[[Name], str] = lambda name: name.identifier, least: int = 0
) -> str:
    """Write an expression in a language, in brackets if it binds less than the rank `least`.

    `name_of` says how a name is written.
    """
    match x:
        case Name():
            return name_of(x)
        case Number(value):
            return language.number(value)
        case Operation("directed", (_, Name(identifier, kind, owners), _)) if "directed" in language.forms:
            return name_of(Name(language.forms["directed"].format(identifier), kind, owners))
    assert isinstance(x, Operation)
    shown = plain(x) if x.op in _CHOICES_BY_NAME and x.op not in language.forms else x
    assert isinstance(shown, Operation)
    form = language.forms.get(shown.op) or _usual_form(shown, language)
    rank, operands = language.ranks.get(shown.op, (CALL, (0,) * len(shown.args)))
    parts = [written(arg, language, name_of, need) for arg, need in zip(shown.args, operands, strict=True)]
    text = form.format(*parts)
    return text if rank >= least else language.bracket.format(text)


def _usual_form(x: Operation, language: Language) -> str:
    """Return the form of an operation for which a language has none of its own: a + b or f(a, b)."""
    return f"{{}} {x.op} {{}}" if x.op in language.ranks else f"{x.op}({', '.join('{}' for _ in x.args)})"


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


def tangent(x: Expression, changes: Mapping[str, Expression]) -> Expression:  # noqa: PLR0911 - a case for each operation
    """Return the change of an expression: the sum of its partial derivatives times the changes of its names.

    `changes` has the changes of the names that change. The base of a power is not negative.
    """

    def change(part: Expression) -> Expression:
        return tangent(part, changes)

    if x.names.isdisjoint(changes):
        return ZERO
    match plain(x):
        case Name(identifier):
            return changes[identifier]
        case Operation("if", (test, then, otherwise)):
            return where(test, change(then), change(otherwise))
        case Operation("+", (a, b)):
            return change(a) + change(b)
        case Operation("-", (a, b)):
            return change(a) - change(b)
        case Operation("*", (a, b)):
            return change(a) * b + a * change(b)
        case Operation("/", (a, b)):
            return (change(a) - x * change(b)) / b
        case Operation("atan2", (a, b)):
            return (change(a) * b - change(b) * a) / (a * a + b * b)
        case Operation("pow", (a, b)):
            logarithm = where(a > 0.0, call("log", a), 0.0)
            return b * call("pow", a, b - 1.0) * change(a) + x * logarithm * change(b)
        case Operation(op, (a,)):
            return _change_of_function(op, a, x, change(a))
    return ZERO


def _change_of_function(op: str, a: Expression, x: Expression, change: Expression) -> Expression:
    """Return the change of x, a function of a, by the change of a."""
    changes = {
        "neg": -change,
        "abs": where(a < 0.0, -change, change),
        "sqrt": change / (2.0 * x),
        "log": change / a,
        "sin": call("cos", a) * change,
        "cos": -call("sin", a) * change,
    }
    return changes.get(op, call(slope_name(op), a) * change)


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
        if (change := tangent(formula, changes)) != ZERO:
            changes[name] = change_of(name)
            steps[change_of(name).identifier] = change
    return steps, changes
