"""Formulas as text. They are evaluated in Python, differentiated, and translated to C.

A formula is a Python expression of names, numbers, + - * /, comparisons, `and`, `or`, a choice `a if test else b`, and
the functions sin, cos and abs. Its value is a float.
"""

import ast
import math
from collections.abc import Callable, Mapping
from functools import cache

FUNCTIONS = {"sin": "sin", "cos": "cos", "abs": "fabs"}
"""The functions that a formula may call, with their names in C."""
_OPERATORS: Mapping[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.And: "&&",
    ast.Or: "||",
}
_PRECEDENCE = {"||": 1, "&&": 2, "<": 3, "<=": 3, ">": 3, ">=": 3, "==": 3, "+": 4, "-": 4, "*": 5, "/": 5}


@cache
def parsed(formula: str) -> ast.expr:
    """Return the syntax tree of a formula, in which all numbers are floats. Raises SyntaxError."""
    tree = ast.parse(formula, mode="eval")
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):
            node.value = float(node.value)  # type: ignore[arg-type]
    return tree.body


@cache
def names(formula: str) -> tuple[str, ...]:
    """Return the names in a formula without functions, each once, in the order of their first use."""
    found = sorted(
        (node for node in ast.walk(parsed(formula)) if isinstance(node, ast.Name) and node.id not in FUNCTIONS),
        key=lambda node: (node.lineno, node.col_offset),
    )
    return tuple(dict.fromkeys(node.id for node in found))


# ---- Python ----------------------------------------------------------------------------------------------------------

_IN_PYTHON = {"__builtins__": {}, "sin": math.sin, "cos": math.cos, "abs": abs}


def compiled(formulas: Mapping[str, str]) -> Callable[[Mapping[str, float]], dict[str, float]]:
    """Compile formulas into one function. It takes values by name, and adds the values of the formulas to them.

    The formulas are evaluated in their order, and each may use those before it. Raises ValueError when one of the texts
    is not a formula.
    """
    lines: list[ast.stmt] = []
    for name, formula in formulas.items():
        to_c(formula, str)  # raises ValueError for any syntax that a formula may not have
        lines.append(ast.Assign([ast.Name(name, ast.Store())], parsed(formula)))
    code = compile(ast.fix_missing_locations(ast.Module(lines, [])), "<formulas>", "exec")

    def evaluate(values: Mapping[str, float]) -> dict[str, float]:
        found = dict(values)
        exec(code, _IN_PYTHON, found)
        return found

    return evaluate


# ---- C ---------------------------------------------------------------------------------------------------------------


def to_c(formula: str, name_in_c: Callable[[str], str]) -> str:
    """Write a formula in C. `name_in_c` gives the C expression for a name."""
    return _c(parsed(formula), name_in_c)[0]


def _c(node: ast.expr, name_in_c: Callable[[str], str]) -> tuple[str, int]:  # noqa: PLR0911 - a case for each syntax
    """Return an expression in C, and its precedence. It is 9 for expressions that never need parentheses."""

    def part(node: ast.expr, least: int) -> str:
        text, precedence = _c(node, name_in_c)
        return text if precedence >= least else f"({text})"

    match node:
        case ast.Constant():
            return repr(node.value), 9
        case ast.Name():
            return name_in_c(node.id), 9
        case ast.UnaryOp(op=ast.USub()):
            return f"-{part(node.operand, 6)}", 6
        case ast.BinOp():
            operator = _OPERATORS[type(node.op)]
            precedence = _PRECEDENCE[operator]
            return f"{part(node.left, precedence)} {operator} {part(node.right, precedence + 1)}", precedence
        case ast.Compare(ops=[operation], comparators=[right]):
            operator = _OPERATORS[type(operation)]
            return f"{part(node.left, 4)} {operator} {part(right, 4)}", 3
        case ast.BoolOp():
            operator = _OPERATORS[type(node.op)]
            return f" {operator} ".join(part(value, 3) for value in node.values), _PRECEDENCE[operator]
        case ast.IfExp():
            return f"{part(node.test, 1)} ? {part(node.body, 1)} : {part(node.orelse, 0)}", 0
        case ast.Call(func=ast.Name(id=function), args=[argument]):
            return f"{FUNCTIONS[function]}({part(argument, 0)})", 9
    raise ValueError(f"{ast.unparse(node)}: a formula has no such part")


# ---- Derivatives -----------------------------------------------------------------------------------------------------


def tangent(formula: str, change_of: Callable[[str], str | None]) -> str | None:
    """Return the change of a formula as a formula: the sum of its partial derivatives times the changes of its names.

    `change_of` gives the formula of the change of a name, or None for a name that does not change. The result is None
    when the formula does not change. The derivative of `a if test else b` is that of the branch that is taken.
    """
    node = _tangent(parsed(formula), change_of)
    return ast.unparse(node) if node is not None else None


def _tangent(  # noqa: PLR0911 - a case for each syntax
    node: ast.expr, change_of: Callable[[str], str | None]
) -> ast.expr | None:
    def change(part: ast.expr) -> ast.expr | None:
        return _tangent(part, change_of)

    match node:
        case ast.Constant():
            return None
        case ast.Name():
            found = change_of(node.id)
            return parsed(found) if found is not None else None
        case ast.UnaryOp(op=ast.USub()):
            inner = change(node.operand)
            return None if inner is None else _negative(inner)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as operator, right=right):
            return _added(change(left), operator, change(right))
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            first, second = change(left), change(right)
            return _added(
                None if first is None else _times(first, right),
                ast.Add(),
                None if second is None else _times(left, second),
            )
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            above, below = change(left), change(right)
            rest = None if below is None else _times(node, below)
            total = _added(above, ast.Sub(), rest)
            return None if total is None else ast.BinOp(total, ast.Div(), right)
        case ast.IfExp():
            return _chosen(node.test, change(node.body), change(node.orelse))
        case ast.Call(func=ast.Name(id=function), args=[argument]):
            inner = change(argument)
            if inner is None:
                return None
            if function == "abs":
                is_negative = ast.Compare(argument, [ast.Lt()], [ast.Constant(0.0)])
                return ast.IfExp(is_negative, _negative(inner), inner)
            slope = ast.Call(ast.Name("cos" if function == "sin" else "sin"), [argument], [])
            return _times(slope if function == "sin" else _negative(slope), inner)
    raise ValueError(f"{ast.unparse(node)}: a formula has no such part")


def _negative(node: ast.expr) -> ast.expr:
    return ast.UnaryOp(ast.USub(), node)


def _times(left: ast.expr, right: ast.expr) -> ast.expr:
    return ast.BinOp(left, ast.Mult(), right)


def _added(left: ast.expr | None, operator: ast.operator, right: ast.expr | None) -> ast.expr | None:
    if left is None or right is None:
        return left if right is None else right if isinstance(operator, ast.Add) else _negative(right)
    return ast.BinOp(left, operator, right)


def _chosen(test: ast.expr, body: ast.expr | None, otherwise: ast.expr | None) -> ast.expr | None:
    if body is None and otherwise is None:
        return None
    return ast.IfExp(test, body or ast.Constant(0.0), otherwise or ast.Constant(0.0))
