"""The unit of a figure, as far as it follows from the expression."""

import ast
from collections.abc import Mapping

from rov_fmu.study.plan.expression import BY_NAME, TIME

_OWN = {"Tau": "s", "settling_time": "s", "overshoot": "1"}
"""The units of functions that have their own."""
_SAME = ("V_ss", "at", "final", "abs", "max", "min", "mean", "median", "std", "ptp", "sum", "percentile")
"""The functions whose value has the unit of their first argument."""


def figure_unit(expression: str, units: Mapping[str, str]) -> str:
    """Return the unit that follows from those of the variables, or an empty text, for example for a product."""
    return _unit(ast.parse(expression.strip(), mode="eval").body, {TIME: "s", **units}) or ""


def _unit(node: ast.AST, units: Mapping[str, str]) -> str | None:
    found = None
    match node:
        case ast.Name(id=name):
            found = units.get(name)
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=str(variable))) if name == BY_NAME:
            found = units.get(variable)
        case ast.Subscript(value=value) | ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=value):
            found = _unit(value, units)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            unit = _unit(left, units)
            found = unit if unit == _unit(right, units) else None
        case ast.Call(func=ast.Name(id=name), args=[first, *_]):
            found = _OWN.get(name) or (_unit(first, units) if name in _SAME else None)
    return found
