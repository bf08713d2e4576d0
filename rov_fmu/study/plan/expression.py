"""The expressions of a study's figures: a small closed language over numbers and arrays.

A plan may come from anyone, so an expression can compute and do nothing else. This holds by construction:
`FigureExpression` turns the kinds of syntax that it lists into functions of the values, and refuses all else. There
are no attributes, texts, lists, comprehensions or statements, and functions take a fixed number of values, because
further ones of NumPy write into arrays. Every value is a number or an array with one dimension, and no operation gives
an array that is longer than those it was given, so sizes and times are bounded by the length of the text.

The unit of a value follows from the units of what it is made of. Products of two units, powers, logarithms and sums of
different units have none here.
"""

import ast
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from inspect import signature
from itertools import pairwise
from math import e, inf, nan, pi
from typing import Any, NamedTuple

import numpy as np

from rov_fmu.io.messages import RovError, brief, did_you_mean, shown

TIME = "t"
"""The times of the communication points, in an expression."""
BY_NAME = "out"
"""The name by which an expression gets variables whose name is not a valid Python identifier: out["der(u)"]."""
CONSTANTS: Mapping[str, float] = {"pi": pi, "e": e, "nan": nan, "inf": inf}
"""Numbers by their names in an expression."""
_DEEPEST = 100
"""The deepest nesting of an expression. Reading and evaluating it use Python's stack."""
_TOO_DEEP = f"is nested too deeply: at most {_DEEPEST} levels"
_MOST_DECIMALS = 300
_ALLOWED = "an expression has numbers, variables, operators, indices and the functions that docs/studies.md lists"

_Value = Any
"""A number or an array with one dimension."""
_Compute = Callable[[Mapping[str, _Value]], _Value]
"""Returns the value of a part of an expression for the values of all names."""
_Unit = str | None
"""The unit of a value, _PLAIN for a number, or None where it does not follow."""
_PLAIN = ""
"""The unit of a number in the text, which may be anything in a sum, and nothing in a product."""
_UnitRule = Callable[..., _Unit] | _Unit
"""The unit of a result, or the function that returns it for the units of the values."""


class ExpressionError(RovError, ValueError):
    """A text is not an expression that a figure may have; the message is the reason."""


class FigureFunction(NamedTuple):
    """A function that an expression may call."""

    compute: Callable[..., _Value]
    """Its parameters are those that an expression may give, by name unless they stand before a slash."""
    unit: _UnitRule = None


# ---- Units -----------------------------------------------------------------------------------------------------------


def unit_of_first(first: _Unit, *_: _Unit) -> _Unit:
    """Return the unit of the first value."""
    return first


def _common(*units: _Unit) -> _Unit:
    """Return the unit of a sum, of which a plain number may have any unit."""
    others = {*units} - {_PLAIN}
    return None if len(others) > 1 else next(iter(others), _PLAIN)


def _scaled(one: _Unit, other: _Unit) -> _Unit:
    """Return the unit of a value that is multiplied or divided by another one without a unit."""
    return one if other in (_PLAIN, "1") else None


def _quotient(above: _Unit, below: _Unit) -> _Unit:
    return "1" if above and above == below else _scaled(above, below)


# ---- What an expression may use --------------------------------------------------------------------------------------


def _of_all(of_one: Callable[[_Value], _Value], of_two: Callable[[_Value, _Value], _Value]) -> FigureFunction:
    """Return a function that reduces one array as in NumPy, or several values as in Python."""
    return FigureFunction(lambda y, /, *others: reduce(of_two, others, y) if others else of_one(y), _common)


def _round(y: _Value, decimals: float = 0.0, /) -> _Value:
    if not abs(decimals) <= _MOST_DECIMALS:
        raise ValueError(f"decimals must be within -{_MOST_DECIMALS} ... {_MOST_DECIMALS}")
    return np.round(y, _whole_number(decimals))


_OF_NUMPY: Mapping[tuple[int, _UnitRule], Sequence[str]] = {
    (1, unit_of_first): ("abs", "ceil", "cumsum", "diff", "floor", "mean", "median", "ptp", "std", "sum", "unwrap"),
    (1, "1"): ("all", "any", "argmax", "argmin", "cos", "isfinite", "isnan", "sign", "sin", "tan"),
    (1, "rad"): ("arcsin", "arccos", "arctan", "radians"),
    (1, "deg"): ("degrees",),
    (1, None): ("cosh", "exp", "log", "log10", "prod", "sinh", "sqrt", "tanh", "var"),
    (2, _common): ("hypot", "maximum", "minimum"),
    (2, unit_of_first): ("percentile",),
    (2, "1"): ("searchsorted",),
    (2, "rad"): ("arctan2",),
    (3, _common): ("clip",),
    (3, lambda *units: units[-1]): ("interp",),
}
"""Functions of NumPy, by the number of their values and the unit of their result."""
_TAKING: Mapping[int, Callable[[Callable[..., _Value]], Callable[..., _Value]]] = {
    1: lambda of: lambda y, /: of(y),
    2: lambda of: lambda y, z, /: of(y, z),
    3: lambda of: lambda x, y, z, /: of(x, y, z),
}
"""By the number of values, what keeps a function of NumPy from its other parameters: `out`, for example, writes into an
array."""
FUNCTIONS: Mapping[str, FigureFunction] = {
    name: FigureFunction(_TAKING[count](getattr(np, name)), unit)
    for (count, unit), names in _OF_NUMPY.items()
    for name in names
} | {
    "gradient": FigureFunction(lambda y, t=1.0, /: np.gradient(elements(y), t)),
    "len": FigureFunction(lambda y, /: float(len(y)), "1"),
    "max": _of_all(np.max, np.maximum),  # Python's own may skip NaN
    "min": _of_all(np.min, np.minimum),
    "round": FigureFunction(_round, unit_of_first),
    "sorted": FigureFunction(lambda y, /: np.sort(y), unit_of_first),
    "where": FigureFunction(lambda x, y, z, /: np.asarray(np.where(x, y, z))[()], lambda _, *either: _common(*either)),
}
"""The functions of numbers and arrays. None gives an array that is longer than the longest one it is given."""

_OF_OPERATORS: Mapping[_UnitRule, Mapping[type[ast.AST], Callable[..., _Value]]] = {
    _common: {ast.Add: operator.add, ast.Sub: operator.sub},
    lambda one, other: _scaled(one, other) or _scaled(other, one): {ast.Mult: operator.mul},
    _quotient: {ast.Div: operator.truediv},
    unit_of_first: {ast.UAdd: operator.pos, ast.USub: operator.neg},
    "1": {
        ast.Not: lambda value: np.bool_(not _truth(value)),
        ast.Invert: np.logical_not,
        ast.Lt: np.less,
        ast.LtE: np.less_equal,
        ast.Gt: np.greater,
        ast.GtE: np.greater_equal,
        ast.Eq: np.equal,
        ast.NotEq: np.not_equal,
    },
    None: {
        ast.FloorDiv: operator.floordiv,
        ast.Mod: operator.mod,
        ast.Pow: np.float_power,  # always gives a float, never a huge integer or a complex number
        ast.BitAnd: np.logical_and,
        ast.BitOr: np.logical_or,
        ast.BitXor: np.logical_xor,
    },
}
"""What operators compute, by the unit of their results. Comparisons are NumPy's, because Python's True + True is an
integer, and integers would grow without end."""
_OPERATORS = {kind: (compute, unit) for unit, some in _OF_OPERATORS.items() for kind, compute in some.items()}


# ---- Reading ---------------------------------------------------------------------------------------------------------


class FigureExpression:
    """An expression that was read and found to be allowed. Raises ExpressionError with the reason if it is not."""

    def __init__(self, text: str, functions: Mapping[str, FigureFunction], units: Mapping[str, str]) -> None:
        """`units` has those of the variables."""
        self.names: set[str] = set()
        """The variables and constants that it names."""
        self._functions, self._depth = functions, 0
        self._units = {**dict.fromkeys(CONSTANTS, _PLAIN), TIME: "s", **units}
        try:
            with warnings.catch_warnings():  # Python's own about the text, such as "1if" without a space
                warnings.simplefilter("ignore")
                tree = ast.parse(text.strip(), mode="eval")
            self.value, unit = self._read(tree.body)
            """Returns the value, a number or an array, for the values of all names. May raise any exception."""
        except ExpressionError:
            raise
        except (RecursionError, MemoryError) as error:
            raise ExpressionError(_TOO_DEEP) from error
        except OverflowError as error:
            raise ExpressionError("has a number that is too large") from error
        except (SyntaxError, ValueError) as error:
            raise ExpressionError(f"is no expression: {getattr(error, 'msg', error)}") from error
        self.unit = unit or ""
        """The unit of the value, or an empty text where it does not follow."""

    def _read(self, node: ast.expr | None) -> tuple[_Compute, _Unit]:
        """Return what computes a node, and its unit. An end of a slice may be None, which gives None."""
        if self._depth == _DEEPEST:
            raise ExpressionError(_TOO_DEEP)
        self._depth += 1
        found = self._computed(node)
        self._depth -= 1
        return found

    def _computed(self, node: ast.expr | None) -> tuple[_Compute, _Unit]:  # noqa: PLR0911, PLR0912 (each kind)
        match node:
            case None:
                return lambda _: None, None
            case ast.Constant(int() | float() as value):
                number = float(value)  # whole numbers would grow without end, and turn into objects in NumPy
                return lambda _: number, _PLAIN
            case ast.Name(name):
                return self._variable(name)
            case ast.Attribute(ast.Name(component), name):  # a variable of a component of a system
                return self._variable(f"{component}.{name}")
            case ast.Subscript(ast.Name(name), ast.Constant(str() as variable)) if name == BY_NAME:
                return self._variable(variable)
            case ast.Subscript(ast.Call(ast.Name("where"), [condition], []), ast.Constant(0)):
                return self._of(np.flatnonzero, "1", condition)
            case ast.Subscript(array, ast.Slice(lower, upper, step)):
                return self._of(_slice, unit_of_first, array, lower, upper, step)
            case ast.Subscript(array, index):
                return self._of(_index, unit_of_first, array, index)
            case ast.UnaryOp(op=op) | ast.BinOp(op=op) if type(op) in _OPERATORS:
                operands = (part for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr))
                return self._of(*_OPERATORS[type(op)], *operands)
            case ast.Compare(left, ops, others) if {*map(type, ops)} <= _OPERATORS.keys():
                return self._of(partial(_compare, [_OPERATORS[type(op)][0] for op in ops]), "1", left, *others)
            case ast.BoolOp(op, operands):
                is_enough = any if isinstance(op, ast.Or) else all
                computes = [self._read(operand)[0] for operand in operands]
                return lambda values: np.bool_(is_enough(_truth(one(values)) for one in computes)), "1"
            case ast.IfExp(test, body, otherwise):
                (is_true, _), (one, unit), (other, other_unit) = map(self._read, (test, body, otherwise))
                return lambda values: (one if _truth(is_true(values)) else other)(values), _common(unit, other_unit)
            case ast.Call(ast.Name(name), given, keywords):
                return self._call(name, given, keywords)
            case ast.Call(ast.Attribute(_, name) as own) if name in self._functions:
                text = brief(ast.unparse(own), 40)
                raise ExpressionError(f"{text} is an attribute, which is not allowed: write {name}(...)")
        assert node
        raise ExpressionError(f"{brief(ast.unparse(node), 40)} is not allowed; {_ALLOWED}")

    def _of(self, function: Callable[..., _Value], unit: _UnitRule, *nodes: ast.expr | None) -> tuple[_Compute, _Unit]:
        """Return what computes nodes and a function of their values, and its unit."""
        computes, units = zip(*map(self._read, nodes), strict=True)
        result = unit(*units) if callable(unit) else unit
        return lambda values: function(*[compute(values) for compute in computes]), result

    def _variable(self, name: str) -> tuple[_Compute, _Unit]:
        self.names.add(name)
        return operator.itemgetter(name), self._units.get(name)

    def _call(self, name: str, given: Sequence[ast.expr], keywords: Sequence[ast.keyword]) -> tuple[_Compute, _Unit]:
        if not (function := self._functions.get(name)):
            near = did_you_mean(name, self._functions)
            raise ExpressionError(f"{shown(name)} is neither a function nor a variable of the FMU{near}")
        compute, unit = function
        form, named, count = signature(compute), {k.arg or "**": k.value for k in keywords}, len(given)
        try:
            form.bind(*given, **named)
        except TypeError as error:
            raise ExpressionError(f"{name}({', '.join(form.parameters)}): {error}") from error

        def called(*of: _Value) -> _Value:
            return compute(*of[:count], **dict(zip(named, of[count:], strict=True)))

        return self._of(called, unit, *given, *named.values())


# ---- Computing -------------------------------------------------------------------------------------------------------


def _compare(operators: Sequence[Callable[..., _Value]], *values: _Value) -> _Value:
    """Compare two values, or several element by element, as in 0 < y < 1."""
    return reduce(np.logical_and, (of(*two) for of, two in zip(operators, pairwise(values), strict=True)))


def _truth(value: _Value) -> bool:
    if isinstance(value, np.ndarray):
        raise ValueError("an array is neither true nor false: write any(...) or all(...), and & or | between arrays")
    return bool(value)


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
    return array[whole]


def _whole_number(value: _Value) -> int:
    if isinstance(value, np.ndarray) or not np.isfinite(value) or value != int(value):
        raise IndexError("an index must be a whole number")
    return int(value)
