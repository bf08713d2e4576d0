"""The expressions of a study's figures: numbers, arrays with one dimension, and some functions of NumPy.

A plan may come from anyone, so an expression can compute and do nothing else: every kind of syntax that is not listed
here is refused, numbers are floats, which do not grow without end, and no function gives an array that is longer than
those it was given.
"""

import ast
import re
from collections.abc import Callable, Mapping
from functools import reduce
from itertools import pairwise
from keyword import iskeyword
from math import e, inf, nan, pi
from typing import Any

import numpy as np

from rov_fmu.io.messages import RovError, brief, did_you_mean, shown

TIME = "t"
"""The times of the communication points, in an expression."""
BY_NAME = "out"
"""The name by which an expression gets variables whose name is not a valid Python identifier: out["der(u)"]."""
CONSTANTS: Mapping[str, float] = {"pi": pi, "e": e, "nan": nan, "inf": inf}
_SYNTAX = (
    *(ast.Expression, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.IfExp, ast.Call, ast.Name, ast.Constant),
    *(ast.Subscript, ast.Slice, ast.Load, ast.keyword, ast.operator, ast.unaryop, ast.boolop),
)
_COMPARISONS = {
    **{ast.Lt: "less", ast.LtE: "less_equal", ast.Gt: "greater", ast.GtE: "greater_equal"},
    **{ast.Eq: "equal", ast.NotEq: "not_equal"},
}
"""The functions of NumPy, because `~` of Python's True is a number that is true."""
_MOST_DECIMALS = 300
_LONGER = ast.LShift | ast.RShift | ast.MatMult
_ALLOWED = "an expression has numbers, variables, operators, indices and the functions that docs/studies.md lists"


class ExpressionError(RovError, ValueError):
    """A text is not an expression that a figure may have; the message is the reason."""


def elements(value: Any) -> Any:
    """Return an array. Raises TypeError for a single number."""
    if not isinstance(value, np.ndarray):
        raise TypeError("a single number has no elements")
    return value


def _taking(count: int, of: Callable[..., Any]) -> Callable[..., Any]:
    """Keep a function of NumPy from its other parameters: `out`, for example, writes into an array."""

    def call(*values: Any) -> Any:
        if len(values) != count:
            raise TypeError(f"{of.__name__} takes {count} value{'s' * (count > 1)}, and not {len(values)}")
        return of(*values)

    return call


def _of_all(of_one: Callable[[Any], Any], of_two: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """Return a function that reduces one array as in NumPy, or several values as in Python."""
    return lambda y, *others: reduce(of_two, others, y) if others else of_one(y)


_OF_NUMPY = {
    1: "abs all any arccos arcsin arctan argmax argmin ceil cos cosh cumsum degrees diff exp floor isfinite isnan log "
    "log10 mean median prod ptp radians sign sin sinh sqrt std sum tan tanh unwrap var",
    2: "arctan2 hypot maximum minimum percentile searchsorted",
    3: "clip interp",
}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    name: _taking(count, getattr(np, name)) for count, names in _OF_NUMPY.items() for name in names.split()
} | {
    "gradient": lambda y, t=1.0: np.gradient(elements(y), t),
    "len": lambda y: float(len(y)),
    "max": _of_all(np.max, np.maximum),  # Python's own may skip NaN
    "min": _of_all(np.min, np.minimum),
    "round": lambda y, decimals=0.0: np.round(y, _within(_whole(decimals))),
    "sorted": lambda y: np.sort(elements(y)),
    "where": lambda x, y, z: np.asarray(np.where(x, y, z))[()],
}
"""The functions of numbers and arrays. None gives an array that is longer than the longest one it is given."""


class FigureExpression:
    """An expression that was read and found to be allowed. Raises ExpressionError with the reason if it is not."""

    def __init__(self, text: str, functions: Mapping[str, Callable[..., Any]]) -> None:
        self.names: set[str] = set()
        """The variables and constants that it names."""
        try:
            tree = _Reader(self.names, functions).visit(ast.parse(text.strip(), mode="eval"))
            self._code = compile(ast.fix_missing_locations(tree), "<figure>", "eval")
        except ExpressionError:
            raise
        except (SyntaxError, ValueError, RecursionError, MemoryError, OverflowError) as error:
            words = [name for name in re.findall(r"[\w.]+", text) if _is_word(name)]
            hint = f"; {words[0]} ends with a word of Python: write {BY_NAME}[{words[0]!r}]" if words else ""
            raise ExpressionError(f"is no expression: {getattr(error, 'msg', error)}{hint}") from error
        self._functions = {"__builtins__": {}, **functions, **_OWN}

    def value(self, values: Mapping[str, Any]) -> Any:
        """Return the value, a number or an array, for the values of all names. May raise any exception."""
        return eval(self._code, {**self._functions, "_values": values})  # only what _Reader lets through


class _Reader(ast.NodeTransformer):
    """Refuses what is not allowed, makes numbers floats, and gives names, powers and indices functions of their own."""

    def __init__(self, names: set[str], functions: Mapping[str, Callable[..., Any]]) -> None:
        self._names, self._functions = names, functions

    def generic_visit(self, node: ast.AST) -> ast.AST:
        if not isinstance(node, _SYNTAX) or isinstance(node, _LONGER):
            raise ExpressionError(f"{brief(ast.unparse(node), 40)} is not allowed; {_ALLOWED}")
        return super().generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if not isinstance(node.value, int | float):
            raise ExpressionError(f"{brief(ast.unparse(node), 40)} is not allowed; {_ALLOWED}")
        return ast.Constant(float(node.value))

    def visit_Name(self, node: ast.Name) -> ast.AST:
        self._names.add(node.id)
        return ast.Subscript(ast.Name("_values", ast.Load()), ast.Constant(node.id), ast.Load())

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if isinstance(node.value, ast.Name):  # a variable of a component of a system
            return self.visit_Name(ast.Name(f"{node.value.id}.{node.attr}", ast.Load()))
        return self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        if isinstance(node.op, ast.Pow):  # float_power gives a float, never a complex number
            return _call("_power", self.visit(node.left), self.visit(node.right))
        return self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        found: Any = self.generic_visit(node)
        return _call("_truth", found)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        found: Any = self.generic_visit(node)
        return _call("_truth", found) if isinstance(node.op, ast.Not) else found

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        if not all(type(op) in _COMPARISONS for op in node.ops):
            return self.generic_visit(node)
        words = ast.Constant(" ".join(_COMPARISONS[type(op)] for op in node.ops))
        return _call("_compared", words, *map(self.visit, (node.left, *node.comparators)))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if not isinstance(node.func, ast.Name) or node.func.id not in self._functions:
            name = brief(ast.unparse(node.func), 40)
            near = did_you_mean(name, self._functions)
            raise ExpressionError(f"{shown(name)} is neither a function nor a variable of the FMU{near}")
        keywords = [ast.keyword(one.arg, self.visit(one.value)) for one in node.keywords if one.arg]
        if len(keywords) < len(node.keywords) or any(isinstance(one, ast.Starred) for one in node.args):
            raise ExpressionError(f"{brief(ast.unparse(node), 40)} is not allowed; {_ALLOWED}")
        return ast.Call(node.func, [self.visit(one) for one in node.args], keywords)

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        index = node.slice
        if isinstance(node.value, ast.Name) and node.value.id == BY_NAME and isinstance(index, ast.Constant):
            return self.visit_Name(ast.Name(str(index.value), ast.Load()))
        match node.value, index:
            case ast.Call(ast.Name("where"), [condition], []), ast.Constant(0):
                return _call("_places", self.visit(condition))
        array = self.visit(node.value)
        if isinstance(index, ast.Slice):
            ends = (index.lower, index.upper, index.step)
            return _call("_slice", array, *(ast.Constant(None) if one is None else self.visit(one) for one in ends))
        return _call("_index", array, self.visit(index))


def _is_word(name: str) -> bool:
    """Return True for a variable whose name Python takes for a word of its own, such as `w.in`."""
    return iskeyword(name.rpartition(".")[2]) and name not in ("and", "or", "not", "if", "else")


def _call(name: str, *given: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), [*given], [])


def _compared(words: str, *values: Any) -> Any:
    """Compare values as 0 < y < 1 does, element by element."""
    pairs = zip(words.split(), pairwise(values), strict=True)
    return reduce(np.logical_and, (getattr(np, word)(*pair) for word, pair in pairs))


def _slice(array: Any, *ends: Any) -> Any:
    return elements(array)[slice(*(None if end is None else _whole(end) for end in ends))]


def _index(array: Any, index: Any) -> Any:
    """Return the part of an array that has an index: a whole number, an array of these, or an array of Booleans."""
    is_array = isinstance(index, np.ndarray) and index.dtype.kind in "bi"
    return elements(array)[index if is_array else _whole(index)]


def _whole(value: Any) -> int:
    if isinstance(value, np.ndarray) or value != int(value):
        raise IndexError("an index must be a whole number")
    return int(value)


def _within(decimals: int) -> int:
    if abs(decimals) > _MOST_DECIMALS:
        raise ValueError(f"decimals must be within -{_MOST_DECIMALS} ... {_MOST_DECIMALS}")
    return decimals


_OWN = {
    "_power": np.float_power,
    "_truth": lambda value: np.bool_(bool(value)),
    "_slice": _slice,
    "_index": _index,
    "_places": np.flatnonzero,
    "_compared": _compared,
}
