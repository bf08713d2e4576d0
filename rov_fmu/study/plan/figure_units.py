"""The unit of a figure, as far as it follows from the units of the variables in its expression."""

import ast
from collections.abc import Mapping

from rov_fmu.study.plan.expression import BY_NAME, CONSTANTS, TIME

_PLAIN = ""
"""The unit of a number in the text, which may be anything in a sum, and nothing in a product."""
_SAME = {
    *("abs", "ceil", "clip", "cumsum", "diff", "floor", "hypot", "max", "maximum", "mean", "median", "min", "minimum"),
    *("percentile", "ptp", "round", "sorted", "std", "sum", "unwrap", "at", "final", "V_ss"),
}
"""The functions whose result has the unit of their first value."""
_KNOWN = {
    **dict.fromkeys(("Tau", "settling_time"), "s"),
    **dict.fromkeys(("arcsin", "arccos", "arctan", "arctan2", "radians"), "rad"),
    "degrees": "deg",
    **dict.fromkeys(("all", "any", "argmax", "argmin", "cos", "isfinite", "isnan", "len", "overshoot"), "1"),
    **dict.fromkeys(("searchsorted", "sign", "sin", "tan"), "1"),
}
"""The units of the results of other functions."""


def unit_of(expression: str, units: Mapping[str, str]) -> str:
    """Return the unit of an expression that `FigureExpression` accepts, or an empty text where it does not follow.

    `units` has those of the variables. Products of two units, powers, logarithms and sums of different units have none.

    Examples:
        unit_of("x[-1] - at(x, 10)", {"x": "m"})  # "m"
    """
    return _unit(ast.parse(expression.strip(), mode="eval").body, {**units, TIME: "s"}) or ""


def _unit(node: ast.expr, units: Mapping[str, str]) -> str | None:  # noqa: C901, PLR0911, PLR0912 (a case for each kind)
    """Return the unit of a node, _PLAIN for a number, or None where it does not follow."""
    match node:
        case ast.Constant():
            return _PLAIN
        case ast.Name(id=name):
            return _PLAIN if name in CONSTANTS else units.get(name)
        case ast.Attribute(value=ast.Name(id=component), attr=name):
            return units.get(f"{component}.{name}")
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=str(variable))) if name == BY_NAME:
            return units.get(variable)
        case ast.Subscript(value=ast.Call(func=ast.Name(id="where"), args=[_])):
            return "1"
        case ast.Subscript(value=value) | ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=value):
            return _unit(value, units)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return _common(_unit(left, units), _unit(right, units))
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return _scaled(_unit(left, units), _unit(right, units)) or _scaled(_unit(right, units), _unit(left, units))
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            above, below = _unit(left, units), _unit(right, units)
            return "1" if above and above == below else _scaled(above, below)
        case ast.IfExp(body=body, orelse=otherwise):
            return _common(_unit(body, units), _unit(otherwise, units))
        case ast.Compare() | ast.BoolOp() | ast.UnaryOp():
            return "1"
        case ast.Call(func=ast.Name(id="where"), args=[_, one, other]):
            return _common(_unit(one, units), _unit(other, units))
        case ast.Call(func=ast.Name(id="interp"), args=[*_, values]):
            return _unit(values, units)
        case ast.Call(func=ast.Name(id=name), args=[first, *others]):
            unit = _unit(first, units)
            alike = others if name in ("hypot", "max", "maximum", "min", "minimum", "clip") else []
            for other in alike:
                unit = _common(unit, _unit(other, units))
            return unit if name in _SAME else _KNOWN.get(name)
    return None


def _common(one: str | None, other: str | None) -> str | None:
    """Return the unit of a sum, of which a plain number may have any unit."""
    if one is None or other is None:
        return None
    return one or other if _PLAIN in (one, other) or one == other else None


def _scaled(one: str | None, other: str | None) -> str | None:
    """Return the unit of a value that is multiplied or divided by another one without a unit."""
    return one if other in (_PLAIN, "1") else None
