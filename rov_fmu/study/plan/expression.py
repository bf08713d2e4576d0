"""The expressions of a study's figures: a small closed language over numbers and arrays.

A plan may come from anyone, so an expression can compute and do nothing else. This holds by construction: `Expression`
accepts only the kinds of syntax that `_Reader` lists, the operators of `_BINARY`, `_UNARY` and `_COMPARED`, and calls
of named functions with a fixed number of values. There are no attributes, texts, lists, comprehensions or statements,
and Python's `eval` is not used. Every value is a number or an array with one dimension, and no operation gives an
array that is longer than those it was given, so sizes and times are bounded by the length of the text.
"""

import ast
import operator
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from functools import reduce
from inspect import Parameter, signature
from math import e, inf, nan, pi
from types import MappingProxyType
from typing import Any

import numpy as np

from rov_fmu.io.messages import brief, shown

TIME = "t"
"""The times of the communication points, in an expression."""
BY_NAME = "out"
"""The name by which an expression gets variables whose name is not a valid Python identifier: out["der(u)"]."""
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": pi, "e": e, "nan": nan, "inf": inf})
"""Numbers by their names in an expression."""
_DEEPEST = 100
"""The deepest nesting of an expression. Reading and evaluating it use Python's stack."""
_MOST_DECIMALS = 300
_ALLOWED = "an expression has numbers, variables, operators, indices and the functions that docs/studies.md lists"

_Value = Any
"""A number or an array with one dimension."""
_Term = Callable[[Mapping[str, _Value]], _Value]
"""A part of an expression: it computes its value from those of the variables."""


class ExpressionError(ValueError):
    """A text is not an expression that a figure may have; the message is the reason."""


@dataclass(frozen=True)
class Function:
    """A function that an expression may call."""

    compute: Callable[..., _Value]
    least: int = 1
    """The number of values that it needs."""
    most: int = 1
    """The number of values that it takes."""
    parameters: tuple[str, ...] = ()
    """The names of all parameters, if values may be given by name."""

    @classmethod
    def by_name(cls, compute: Callable[..., _Value]) -> "Function":
        """Return a function whose values may be given by the names of its parameters."""
        parameters = signature(compute).parameters
        needed = sum(p.default is Parameter.empty for p in parameters.values())
        return cls(compute, needed, len(parameters), tuple(parameters))


# ---- What an expression may use --------------------------------------------------------------------------------------


def _of_all(of_one: Callable[[_Value], _Value], of_two: Callable[[_Value, _Value], _Value]) -> Function:
    """Return a function that reduces one array as in NumPy, or several values as in Python."""
    return Function(lambda y, *others: reduce(of_two, others, y) if others else of_one(y), 1, 100)


def _round(y: _Value, decimals: float = 0.0) -> _Value:
    if not abs(decimals) <= _MOST_DECIMALS:
        raise ValueError(f"decimals must be within -{_MOST_DECIMALS} ... {_MOST_DECIMALS}")
    return np.round(y, _whole_number(decimals))


_OF_ONE_VALUE = (
    *("abs", "sign", "sqrt", "exp", "log", "log10", "ceil", "floor", "degrees", "radians", "isfinite", "isnan"),
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh"),
    *("all", "any", "argmax", "argmin", "mean", "median", "prod", "ptp", "std", "sum", "var"),
    *("cumsum", "diff", "unwrap"),
)
"""Functions of NumPy with one value. Their other parameters are not allowed, because `out`, for example, writes into an
array."""
_OF_TWO_VALUES = ("arctan2", "hypot", "maximum", "minimum", "percentile", "searchsorted")
FUNCTIONS: Mapping[str, Function] = MappingProxyType(
    {name: Function(getattr(np, name)) for name in _OF_ONE_VALUE}
    | {name: Function(getattr(np, name), 2, 2) for name in _OF_TWO_VALUES}
    | {
        "clip": Function(np.clip, 3, 3),
        "gradient": Function(np.gradient, 1, 2),
        "interp": Function(np.interp, 3, 3),
        "len": Function(lambda y: float(len(y))),
        "max": _of_all(np.max, np.maximum),  # Python's own may skip NaN
        "min": _of_all(np.min, np.minimum),
        "round": Function(_round, 1, 2),
        "sorted": Function(np.sort),
        "where": Function(np.where, 3, 3),
    }
)
"""The functions of numbers and arrays. None gives an array that is longer than the longest one it is given."""

_BINARY: Mapping[type[ast.operator], Callable[[_Value, _Value], _Value]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: np.float_power,  # always gives a float, never a huge integer or a complex number
    ast.BitAnd: np.logical_and,
    ast.BitOr: np.logical_or,
    ast.BitXor: np.logical_xor,
}
_UNARY: Mapping[type[ast.unaryop], Callable[[_Value], _Value]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Invert: np.logical_not,
    ast.Not: lambda value: np.bool_(not _truth(value)),
}
_COMPARED: Mapping[type[ast.cmpop], Callable[[_Value, _Value], _Value]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
"""NumPy's comparisons, because Python's True + True is an integer, and integers would grow without end."""


# ---- Reading ---------------------------------------------------------------------------------------------------------


class Expression:
    """An expression that was read and found to be allowed. Raises ExpressionError with the reason if it is not."""

    def __init__(self, text: str, functions: Mapping[str, Function]) -> None:
        reader = _Reader(functions)
        try:
            with warnings.catch_warnings():  # Python's own about the text, such as "1if" without a space
                warnings.simplefilter("ignore")
                tree = ast.parse(text.strip(), mode="eval")
            self._term = reader.term(tree.body)
        except (RecursionError, MemoryError) as error:
            raise ExpressionError(f"is nested too deeply: at most {_DEEPEST} levels") from error
        except (SyntaxError, UnicodeError) as error:
            raise ExpressionError(f"is no expression: {getattr(error, 'msg', error)}") from error
        self.names = frozenset(reader.names)
        """The variables and constants that it names."""
        self.constant_values = tuple(reader.constant_values)
        """For each call of a function whose parameters have names: the numbers given in the text, by parameter."""

    def value(self, values: Mapping[str, _Value]) -> _Value:
        """Return the value, a number or an array, for the values of all names. May raise any exception."""
        return self._term(values)


class _Reader:
    """Turns a syntax tree into terms. Whatever is not listed here is refused."""

    def __init__(self, functions: Mapping[str, Function]) -> None:
        self.names: list[str] = []
        """The variables and constants, once for each time that they occur."""
        self.constant_values: list[dict[str, _Value]] = []
        self._functions = functions
        self._depth = 0
        self._readers: Mapping[type[ast.expr], Callable[[Any], _Term | None]] = {
            ast.Constant: self._constant,
            ast.Name: self._name,
            ast.Subscript: self._subscript,
            ast.Call: self._call,
            ast.UnaryOp: self._unary,
            ast.BinOp: self._binary,
            ast.Compare: self._compare,
            ast.BoolOp: self._bool,
            ast.IfExp: self._choice,
        }

    def term(self, node: ast.expr) -> _Term:
        """Return the term of a node. Raises ExpressionError."""
        if self._depth == _DEEPEST:
            raise ExpressionError(f"is nested too deeply: at most {_DEEPEST} levels")
        self._depth += 1
        read = self._readers.get(type(node))
        found = read(node) if read else None
        self._depth -= 1
        if found is None:
            raise self._refused(node)
        return found

    def _refused(self, node: ast.expr) -> ExpressionError:
        text = brief(ast.unparse(node), 40)
        if isinstance(node, ast.Attribute) and node.attr in self._functions:
            return ExpressionError(f"{text} is an attribute, which is not allowed: write {node.attr}(...)")
        return ExpressionError(f"{text} is not allowed; {_ALLOWED}")

    def _constant(self, node: ast.Constant) -> _Term | None:
        if not isinstance(node.value, int | float):
            return None
        try:
            value = float(node.value)  # whole numbers would grow without end, and turn into objects in NumPy
        except OverflowError:
            raise ExpressionError("has a number that is too large") from None
        return lambda _: value

    def _name(self, node: ast.Name) -> _Term:
        return self._variable(node.id)

    def _variable(self, name: str) -> _Term:
        self.names.append(name)
        return operator.itemgetter(name)

    def _subscript(self, node: ast.Subscript) -> _Term | None:
        match node:
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=str(variable))) if name == BY_NAME:
                return self._variable(variable)
            case ast.Subscript(
                value=ast.Call(func=ast.Name(id="where"), args=[one], keywords=[]), slice=ast.Constant(value=0)
            ):
                condition = self.term(one)
                return lambda values: np.flatnonzero(condition(values))
            case ast.Subscript(slice=ast.Slice(lower=lower, upper=upper, step=step)):
                array = self.term(node.value)
                first, last, stride = (None if part is None else self.term(part) for part in (lower, upper, step))
                return lambda values: _array(array(values))[
                    slice(*(None if part is None else _whole_number(part(values)) for part in (first, last, stride)))
                ]
        array, index = self.term(node.value), self.term(node.slice)
        return lambda values: _array(array(values))[_index(index(values))]

    def _unary(self, node: ast.UnaryOp) -> _Term | None:
        if (compute := _UNARY.get(type(node.op))) is None:
            return None
        operand = self.term(node.operand)
        return lambda values: compute(operand(values))

    def _binary(self, node: ast.BinOp) -> _Term | None:
        if (compute := _BINARY.get(type(node.op))) is None:
            return None
        left, right = self.term(node.left), self.term(node.right)
        return lambda values: compute(left(values), right(values))

    def _compare(self, node: ast.Compare) -> _Term | None:
        """Compare two values, or several element by element, as in 0 < y < 1."""
        operators = [_COMPARED[type(op)] for op in node.ops if type(op) in _COMPARED]
        if len(operators) < len(node.ops):
            return None
        terms = [self.term(part) for part in (node.left, *node.comparators)]
        if len(operators) == 1:
            compare, (left, right) = operators[0], terms
            return lambda values: compare(left(values), right(values))

        def compare_all(values: Mapping[str, _Value]) -> _Value:
            found = [term(values) for term in terms]
            return reduce(np.logical_and, map(lambda f, a, b: f(a, b), operators, found, found[1:]))

        return compare_all

    def _bool(self, node: ast.BoolOp) -> _Term:
        terms = [self.term(part) for part in node.values]
        decides = all if isinstance(node.op, ast.And) else any
        return lambda values: np.bool_(decides(_truth(term(values)) for term in terms))

    def _choice(self, node: ast.IfExp) -> _Term:
        condition, then, otherwise = (self.term(part) for part in (node.test, node.body, node.orelse))
        return lambda values: then(values) if _truth(condition(values)) else otherwise(values)

    def _call(self, node: ast.Call) -> _Term | None:
        if not isinstance(node.func, ast.Name):
            raise self._refused(node.func)
        name = node.func.id
        function = self._functions.get(name)
        if function is None:
            near = get_close_matches(name, self._functions, 1, 0.7)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise ExpressionError(f"{shown(name)} is neither a function nor a variable of the FMU{hint}")
        if name == "where" and len(node.args) == 1:
            raise ExpressionError("where with one value gives a tuple of one array: write where(...)[0]")
        if strange := [k.arg for k in node.keywords if k.arg not in function.parameters]:
            raise ExpressionError(f"{name} has no parameter named {strange[0] or '**'}")
        by_name = [k.arg for k in node.keywords if k.arg]
        given = [*function.parameters[: len(node.args)], *by_name]
        needed = set(function.parameters[: function.least]) - set(given)
        count = len(node.args) + len(by_name)
        if needed or len(set(given)) < len(given) or not function.least <= count <= function.most:
            most = f" to {function.most}" if function.most > function.least else ""
            what = f" ({', '.join(function.parameters)})" if function.parameters else ""
            raise ExpressionError(f"{name} takes {function.least}{most} values{what}, each once, and not {count}")
        terms, numbers = [], {}
        for n, part in enumerate([*node.args, *(k.value for k in node.keywords)]):
            named = len(self.names)
            terms.append(self.term(part))
            if function.parameters and len(self.names) == named:
                with suppress(Exception):  # the error is reported when the run is evaluated
                    if not isinstance(value := terms[n]({}), np.ndarray):
                        numbers[given[n]] = value
        if function.parameters:
            self.constant_values.append(numbers)
        return _called(function.compute, terms, by_name)


def _called(compute: Callable[..., _Value], terms: list[_Term], names: list[str]) -> _Term:
    """Return the call of a function with the values of these terms, the last ones by name."""
    places = len(terms) - len(names)

    def call(values: Mapping[str, _Value]) -> _Value:
        given = [term(values) for term in terms]
        found = compute(*given[:places], **dict(zip(names, given[places:], strict=True)))
        if isinstance(found, np.ndarray) and found.ndim == 0:
            return found[()]
        if not isinstance(found, float | np.number | np.bool_ | np.ndarray):
            raise TypeError("a function needs an array, and gets a number")
        return found

    return call


# ---- Values ----------------------------------------------------------------------------------------------------------


def _truth(value: _Value) -> bool:
    if isinstance(value, np.ndarray):
        raise ValueError("an array is neither true nor false: write any(...) or all(...), and & or | between arrays")
    return bool(value)


def _array(value: _Value) -> _Value:
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value).__name__!r} object is not subscriptable")
    return value


def _index(value: _Value) -> _Value:
    """Return the index that NumPy takes: an integer, an array of integers, or an array of Booleans."""
    if not isinstance(value, np.ndarray):
        return _whole_number(value)
    if value.dtype.kind == "b":
        return value
    whole = value.astype(np.intp)
    if not (whole == value).all():
        raise IndexError("an index must be a whole number")
    return whole


def _whole_number(value: _Value) -> int:
    if isinstance(value, np.ndarray) or not np.isfinite(value) or value != int(value):
        raise IndexError("an index must be a whole number")
    return int(value)
