"""The expressions of a study's figures: a small closed language over numbers and arrays.

A plan may come from anyone, so an expression can compute and do nothing else. This holds by construction: `Expression`
accepts only the kinds of syntax that `_Reader` lists, the operators of `_KEPT` and `_CALLED`, and calls of named
functions with a fixed number of values. There are no attributes, texts, lists, comprehensions or statements. What is
compiled is not the text, but a new syntax tree that the reader makes; it is evaluated without Python's builtins. Every
value is a number or an array with one dimension, and no operation gives an array that is longer than those it was
given, so sizes and times are bounded by the length of the text.
"""

import ast
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from inspect import Parameter, signature
from math import e, inf, nan, pi
from types import MappingProxyType
from typing import Any

import numpy as np

from rov_fmu.io.messages import RovError, brief, did_you_mean, shown

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
_VALUES = "_values"
"""The name that the values of variables and constants have in the code."""


class ExpressionError(RovError, ValueError):
    """A text is not an expression that a figure may have; the message is the reason."""


class BeyondError(RovError, IndexError):
    """An array has no such index; `length` is its length."""

    def __init__(self, index: int, length: int) -> None:
        super().__init__(f"index {index} is out of bounds for axis 0 with size {length}")
        self.length = length


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

    def __call__(self, *values: _Value, **by_name: _Value) -> _Value:
        """Return the result, a number or an array with one dimension. Raises TypeError if it is neither."""
        result = self.compute(*values, **by_name)
        if isinstance(result, np.ndarray) and result.ndim == 0:
            return result[()]
        if not isinstance(result, float | np.number | np.bool_ | np.ndarray):
            raise TypeError("a function needs an array, and gets a number")
        return result


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
    {
        name: Function(getattr(np, name), count, count)
        for count, names in enumerate((_OF_ONE_VALUE, _OF_TWO_VALUES), 1)
        for name in names
    }
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

_KEPT = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod)
"""Python's own operators that an expression may use, beside signs. Of two floats, they give a float."""
_CALLED: Mapping[str, Callable[..., _Value]] = {
    "Pow": np.float_power,  # always gives a float, never a huge integer or a complex number
    "BitAnd": np.logical_and,
    "BitOr": np.logical_or,
    "BitXor": np.logical_xor,
    "Invert": np.logical_not,
    "Not": lambda value: np.bool_(not _truth(value)),
    "Lt": np.less,
    "LtE": np.less_equal,
    "Gt": np.greater,
    "GtE": np.greater_equal,
    "Eq": np.equal,
    "NotEq": np.not_equal,
}
"""Functions in place of operators, by the name of the operator in the syntax tree. Comparisons are NumPy's, because
Python's True + True is an integer, and integers would grow without end."""


# ---- Reading ---------------------------------------------------------------------------------------------------------


class Expression:
    """An expression that was read and found to be allowed. Raises ExpressionError with the reason if it is not."""

    def __init__(self, text: str, functions: Mapping[str, Function]) -> None:
        reader = _Reader(functions)
        try:
            with warnings.catch_warnings():  # Python's own about the text, such as "1if" without a space
                warnings.simplefilter("ignore")
                tree = ast.parse(text.strip(), mode="eval")
            code = ast.Expression(reader.read(tree.body))
        except (RecursionError, MemoryError) as error:
            raise ExpressionError(f"is nested too deeply: at most {_DEEPEST} levels") from error
        except (SyntaxError, UnicodeError) as error:
            raise ExpressionError(f"is no expression: {getattr(error, 'msg', error)}") from error
        self.names = frozenset(reader.names)
        """The variables and constants that it names."""
        self._program = compile(ast.fix_missing_locations(code), "<figure>", "eval")
        self._globals = {"__builtins__": {}, **_HELPERS, **functions}

    def value(self, values: Mapping[str, _Value]) -> _Value:
        """Return the value, a number or an array, for the values of all names. May raise any exception."""
        return eval(self._program, self._globals, {_VALUES: values})


class _Reader:
    """Turns the syntax tree of a text into that of the code. Whatever is not listed here is refused."""

    def __init__(self, functions: Mapping[str, Function]) -> None:
        self.names: set[str] = set()
        self._functions = functions
        self._depth = 0

    def read(self, node: ast.expr) -> ast.expr:
        """Return the code of a node. Raises ExpressionError."""
        if self._depth == _DEEPEST:
            raise ExpressionError(f"is nested too deeply: at most {_DEEPEST} levels")
        self._depth += 1
        try:
            return self._read(node)
        finally:
            self._depth -= 1

    def _read(self, node: ast.expr) -> ast.expr:  # noqa: C901, PLR0911, PLR0912 (a case for each kind of syntax)
        match node:
            case ast.Constant(value=int() | float() as value):
                return _constant(value)
            case ast.Name(id=name):
                return self._variable(name)
            case ast.Attribute(value=ast.Name(id=component), attr=name):  # a variable of a component of a system
                return self._variable(f"{component}.{name}")
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=str(variable))) if name == BY_NAME:
                return self._variable(variable)
            case ast.Subscript(
                value=ast.Call(func=ast.Name(id="where"), args=[condition], keywords=[]), slice=ast.Constant(value=0)
            ):
                return _call("flatnonzero", self.read(condition))
            case ast.Subscript(value=value, slice=ast.Slice(lower=lower, upper=upper, step=step)):
                ends = (ast.Constant(None) if part is None else self.read(part) for part in (lower, upper, step))
                return _call("slice", self.read(value), *ends)
            case ast.Subscript(value=value, slice=index):
                return _call("index", self.read(value), self.read(index))
            case ast.UnaryOp(op=ast.UAdd() | ast.USub() as op, operand=value):
                return ast.UnaryOp(op, self.read(value))
            case ast.UnaryOp(op=op, operand=value):
                return _call(_kind(op), self.read(value))
            case ast.BinOp(left=left, op=op, right=right) if isinstance(op, _KEPT):
                return ast.BinOp(self.read(left), op, self.read(right))
            case ast.BinOp(left=left, op=op, right=right) if _kind(op) in _CALLED:
                return _call(_kind(op), self.read(left), self.read(right))
            case ast.Compare(left=left, ops=ops, comparators=others) if {*map(_kind, ops)} <= _CALLED.keys():
                compared = ast.Tuple([_name(f"_{_kind(op)}") for op in ops], ast.Load())
                return _call("compare", compared, *map(self.read, (left, *others)))
            case ast.BoolOp(op=op, values=values):
                return ast.BoolOp(op, [_call("truth", self.read(value)) for value in values])
            case ast.IfExp(test=test, body=body, orelse=otherwise):
                return ast.IfExp(_call("truth", self.read(test)), self.read(body), self.read(otherwise))
            case ast.Call(func=ast.Name(id=name)):
                return self._function(name, node)
            case ast.Call(func=function):
                raise self._refused(function)
        raise self._refused(node)

    def _refused(self, node: ast.expr) -> ExpressionError:
        text = brief(ast.unparse(node), 40)
        if isinstance(node, ast.Attribute) and node.attr in self._functions:
            return ExpressionError(f"{text} is an attribute, which is not allowed: write {node.attr}(...)")
        return ExpressionError(f"{text} is not allowed; {_ALLOWED}")

    def _variable(self, name: str) -> ast.expr:
        self.names.add(name)
        return ast.Subscript(_name(_VALUES), ast.Constant(name), ast.Load())

    def _function(self, name: str, node: ast.Call) -> ast.expr:
        function = self._functions.get(name)
        if function is None:
            near = did_you_mean(name, self._functions)
            raise ExpressionError(f"{shown(name)} is neither a function nor a variable of the FMU{near}")
        if name == "where" and len(node.args) == 1:
            raise ExpressionError("where with one value gives a tuple of one array: write where(...)[0]")
        by_name = [k.arg for k in node.keywords]
        if strange := [key for key in by_name if key not in function.parameters]:
            raise ExpressionError(f"{name} has no parameter named {strange[0] or '**'}")
        given = [*function.parameters[: len(node.args)], *by_name]
        needed = {*function.parameters[: function.least]} - {*given}
        count = len(node.args) + len(by_name)
        if needed or len({*given}) < len(given) or not function.least <= count <= function.most:
            most = f" to {function.most}" if function.most > function.least else ""
            what = f" ({', '.join(function.parameters)})" if function.parameters else ""
            raise ExpressionError(f"{name} takes {function.least}{most} values{what}, each once, and not {count}")
        keywords = [ast.keyword(k.arg, self.read(k.value)) for k in node.keywords]
        return ast.Call(_name(name), [*map(self.read, node.args)], keywords)


# ---- Code ------------------------------------------------------------------------------------------------------------


def _constant(value: float) -> ast.Constant:
    """Return a number as a float: whole numbers would grow without end, and turn into objects in NumPy."""
    try:
        return ast.Constant(float(value))
    except OverflowError:
        raise ExpressionError("has a number that is too large") from None


def _kind(operator: ast.AST) -> str:
    return type(operator).__name__


def _name(name: str) -> ast.Name:
    return ast.Name(name, ast.Load())


def _call(helper: str, *values: ast.expr) -> ast.Call:
    """Return the call of a function of `_HELPERS`, whose names no function of an expression has."""
    return ast.Call(_name(f"_{helper}"), [*values], [])


def _compare(operators: Sequence[Callable[..., _Value]], *values: _Value) -> _Value:
    """Compare two values, or several element by element, as in 0 < y < 1."""
    compared = map(lambda compare, a, b: compare(a, b), operators, values, values[1:])
    return reduce(np.logical_and, compared)


def _truth(value: _Value) -> np.bool_:
    if isinstance(value, np.ndarray):
        raise ValueError("an array is neither true nor false: write any(...) or all(...), and & or | between arrays")
    return np.bool_(value)


def elements(value: _Value) -> _Value:
    """Return an array. Raises TypeError for a single number."""
    if not isinstance(value, np.ndarray):
        raise TypeError("a single number has no elements")
    return value


def _slice(array: _Value, *ends: _Value) -> _Value:
    return elements(array)[slice(*(None if end is None else _whole_number(end) for end in ends))]


def _index(array: _Value, index: _Value) -> _Value:
    """Return the part of an array that has an index: a whole number, an array of these, or an array of Booleans."""
    array = elements(array)
    if isinstance(index, np.ndarray) and index.dtype.kind == "b":
        return array[index]
    whole: Any = index.astype(np.intp) if isinstance(index, np.ndarray) else _whole_number(index)
    if not np.all(whole == index):
        raise IndexError("an index must be a whole number")
    beyond = np.atleast_1d(whole)
    beyond = beyond[(beyond < -len(array)) | (beyond >= len(array))]
    if beyond.size:
        raise BeyondError(beyond[0], len(array))
    return array[whole]


def _whole_number(value: _Value) -> int:
    if isinstance(value, np.ndarray) or not np.isfinite(value) or value != int(value):
        raise IndexError("an index must be a whole number")
    return int(value)


_HELPERS: Mapping[str, Callable[..., _Value]] = {
    **{f"_{kind}": function for kind, function in _CALLED.items()},
    "_compare": _compare,
    "_flatnonzero": np.flatnonzero,
    "_index": _index,
    "_slice": _slice,
    "_truth": _truth,
}
"""What the code calls in place of operators, comparisons and indices."""
