"""Formulas as text. They are evaluated in Python, differentiated, and translated to C.

A formula is a Python expression of names, numbers, + - * /, comparisons, `and`, `or`, a choice `a if test else b`, and
the functions sin, cos, abs, sqrt, pow, log and atan2. Any other name that is called is the name of a thrust table. The
value of a formula is a float.
"""

import ast
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, reduce
from types import MappingProxyType

FUNCTIONS = {"sin": "sin", "cos": "cos", "abs": "fabs", "sqrt": "sqrt", "pow": "pow", "log": "log", "atan2": "atan2"}
"""The functions that a formula may call, with their names in C."""
SLOPE = "slope_of_"
"""The name of the derivative of a thrust table begins with this."""
CHANGE = "change_of_"
"""The name of the change of a number begins with this. No name that comes from a vehicle file begins so."""
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
    tree = parsed(formula)
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    found = sorted(
        (node for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called),
        key=lambda node: (node.lineno, node.col_offset),
    )
    return tuple(dict.fromkeys(node.id for node in found))


def joined(parts: Iterable[str]) -> str:
    """Write a sum as one formula. A part that begins with a minus is subtracted."""
    text = ""
    for part in parts:
        if not text:
            text = part
        elif part.startswith("-"):
            text += f" - {part[1:]}"
        else:
            text += f" + {part}"
    return text


def weighted(parts: Sequence[tuple[float, str]]) -> str:
    """Write a weighted sum as one formula.

    Each part must be a formula that needs no brackets as a factor, and must not begin with a minus.
    """
    return joined(
        part if weight == 1.0 else f"-{part}" if weight == -1.0 else f"{weight!r} * {part}" for weight, part in parts
    )


# ---- Python ----------------------------------------------------------------------------------------------------------

_IN_PYTHON = {
    "__builtins__": {},
    "sin": math.sin,
    "cos": math.cos,
    "abs": abs,
    "sqrt": math.sqrt,
    "pow": math.pow,
    "log": math.log,
    "atan2": math.atan2,
}


def compiled(
    formulas: Mapping[str, str], tables: Mapping[str, Callable[[float], float]] = MappingProxyType({})
) -> Callable[[Mapping[str, float]], dict[str, float]]:
    """Compile formulas into one function. It takes values by name, and adds the values of the formulas to them.

    The formulas are evaluated in their order, and each may use those before it. `tables` are the functions that they
    call besides FUNCTIONS, by their names. Raises SyntaxError when a text is not Python, and ValueError when it is not
    a formula.
    """
    lines: list[ast.stmt] = []
    for name, formula in formulas.items():
        to_c(formula, str)  # raises ValueError for any syntax that a formula may not have
        lines.append(ast.Assign([ast.Name(name, ast.Store())], parsed(formula)))
    known = {**_IN_PYTHON, **tables}
    code = compile(ast.fix_missing_locations(ast.Module(lines, [])), "<formulas>", "exec")

    def evaluate(values: Mapping[str, float]) -> dict[str, float]:
        found = dict(values)
        exec(code, known, found)
        return found

    return evaluate


class _Branchless(ast.NodeTransformer):
    """Replace choices, `and` and `or` by calls of functions."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        self.generic_visit(node)
        return ast.Call(ast.Name("where", ast.Load()), [node.test, node.body, node.orelse], [])

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        self.generic_visit(node)
        name = "both" if isinstance(node.op, ast.And) else "either"
        return reduce(lambda a, b: ast.Call(ast.Name(name, ast.Load()), [a, b], []), node.values)


def branchless(formula: str) -> str:
    """Write a formula without choices, for arrays and symbols, which have no single truth value.

    `a if test else b` becomes where(test, a, b), and `and` and `or` become both(…, …) and either(…, …).
    """
    return ast.unparse(_Branchless().visit(ast.parse(formula, mode="eval")))


# ---- C ---------------------------------------------------------------------------------------------------------------


def to_c(formula: str, name_in_c: Callable[[str], str]) -> str:
    """Write a formula in C. `name_in_c` gives the C expression for a name."""
    return _c(parsed(formula), name_in_c)[0]


def _c(node: ast.expr, name_in_c: Callable[[str], str]) -> tuple[str, int]:  # noqa: PLR0911 - a case for each syntax
    """Return an expression in C and its precedence, which is 9 for expressions that never need parentheses."""

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
        case ast.Call(func=ast.Name(id=function), args=arguments):
            return f"{FUNCTIONS.get(function, function)}({', '.join(part(argument, 0) for argument in arguments)})", 9
    raise ValueError(f"{ast.unparse(node)}: a formula has no such part")


# ---- Derivatives -----------------------------------------------------------------------------------------------------


def tangent(formula: str, change_of: Callable[[str], str | None]) -> str | None:
    """Return the change of a formula as a formula: the sum of its partial derivatives times the changes of its names.

    `change_of` gives the formula of the change of a name, or None for a name that does not change. The result is None
    when the formula does not change. The derivative of `a if test else b` is that of the branch that is taken.
    """
    node = _tangent(parsed(formula), change_of)
    return ast.unparse(node) if node is not None else None


def _tangent(  # noqa: PLR0911, PLR0912 - a case for each syntax
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
                None if first is None else _product(first, right),
                ast.Add(),
                None if second is None else _product(left, second),
            )
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            above, below = change(left), change(right)
            rest = None if below is None else _product(node, below)
            total = _added(above, ast.Sub(), rest)
            return None if total is None else ast.BinOp(total, ast.Div(), right)
        case ast.IfExp():
            return _choice(node.test, change(node.body), change(node.orelse))
        case ast.Call(func=ast.Name(id=function), args=[argument]):
            inner = change(argument)
            if inner is None:
                return None
            if function == "abs":
                is_negative = ast.Compare(argument, [ast.Lt()], [ast.Constant(0.0)])
                return ast.IfExp(is_negative, _negative(inner), inner)
            if function == "sqrt":
                return ast.BinOp(inner, ast.Div(), _product(ast.Constant(2.0), node))
            if function not in FUNCTIONS:
                return _product(ast.Call(ast.Name(f"{SLOPE}{function}"), [argument], []), inner)
            if function == "log":
                return ast.BinOp(inner, ast.Div(), argument)
            slope = ast.Call(ast.Name("cos" if function == "sin" else "sin"), [argument], [])
            return _product(slope if function == "sin" else _negative(slope), inner)
        case ast.Call(func=ast.Name(id="pow"), args=[base, exponent]):  # the base is not negative
            first, second = change(base), change(exponent)
            less = ast.BinOp(exponent, ast.Sub(), ast.Constant(1.0))
            power = ast.Call(ast.Name("pow"), [base, less], [])
            logarithm = ast.IfExp(
                ast.Compare(base, [ast.Gt()], [ast.Constant(0.0)]),
                ast.Call(ast.Name("log"), [base], []),
                ast.Constant(0.0),
            )
            return _added(
                None if first is None else _product(_product(exponent, power), first),
                ast.Add(),
                None if second is None else _product(_product(node, logarithm), second),
            )
        case ast.Call(func=ast.Name(id="atan2"), args=[above, below]):
            first, second = change(above), change(below)
            total = _added(
                None if first is None else _product(first, below),
                ast.Sub(),
                None if second is None else _product(second, above),
            )
            square = ast.BinOp(_product(above, above), ast.Add(), _product(below, below))
            return None if total is None else ast.BinOp(total, ast.Div(), square)
    raise ValueError(f"{ast.unparse(node)}: a formula has no such part")


def _negative(node: ast.expr) -> ast.expr:
    return ast.UnaryOp(ast.USub(), node)


def _product(left: ast.expr, right: ast.expr) -> ast.expr:
    return ast.BinOp(left, ast.Mult(), right)


def _added(left: ast.expr | None, operator: ast.operator, right: ast.expr | None) -> ast.expr | None:
    if left is None or right is None:
        return left if right is None else right if isinstance(operator, ast.Add) else _negative(right)
    return ast.BinOp(left, operator, right)


def _choice(test: ast.expr, body: ast.expr | None, otherwise: ast.expr | None) -> ast.expr | None:
    if body is None and otherwise is None:
        return None
    return ast.IfExp(test, body or ast.Constant(0.0), otherwise or ast.Constant(0.0))
