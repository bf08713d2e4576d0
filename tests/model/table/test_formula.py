"""Formulas as text: how they are written, translated to C, differentiated, and refused (rov_fmu/model/formula.py)."""

from math import cos, log, sin

import pytest

from rov_fmu.model.formula import branchless, compiled, joined, names, tangent, to_c, weighted


@pytest.mark.parametrize(
    ("formula", "in_c"),
    [
        ("a - (b - c)", "a - (b - c)"),
        ("(a - b) - c", "a - b - c"),
        ("a / (b * c)", "a / (b * c)"),
        ("(a + b) * c", "(a + b) * c"),
        ("a * b + c", "a * b + c"),
        ("-(a + b)", "-(a + b)"),
        ("-(a * b)", "-(a * b)"),
        ("-a * 2", "-a * 2.0"),
        ("abs(a) + pow(b, 2)", "fabs(a) + pow(b, 2.0)"),
        ("table(a if b < 0 else c)", "table(b < 0.0 ? a : c)"),
        ("1 if a > 1 else -1 if a < -1 else a", "a > 1.0 ? 1.0 : a < -1.0 ? -1.0 : a"),
        ("(1 if a == b else 2) * c", "(a == b ? 1.0 : 2.0) * c"),
        ("1 if (a <= b or a >= c) and b > 0 else 2", "(a <= b || a >= c) && b > 0.0 ? 1.0 : 2.0"),
        ("(a if b < c else b) + 1", "(b < c ? a : b) + 1.0"),
        ("1 if (a if b < c else b) < 1 else 2", "(b < c ? a : b) < 1.0 ? 1.0 : 2.0"),
        ("(1 if a < b else 2) if b < c else 3", "b < c ? (a < b ? 1.0 : 2.0) : 3.0"),
    ],
)
def test_a_formula_in_c_has_the_brackets_that_it_needs(formula: str, in_c: str) -> None:
    assert to_c(formula, str) == in_c


@pytest.mark.parametrize("text", ["a ** b", "a[0]", "a < b < c", "not a", "a.b", "a % b", "lambda: 1"])
def test_other_syntax_is_no_formula(text: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        compiled({"x": text})


def test_names_are_those_of_variables_in_the_order_of_their_use() -> None:
    assert names("b * sin(a) + table(b) - c / a") == ("b", "a", "c")


def test_sums_begin_without_a_plus_and_subtract_what_begins_with_a_minus() -> None:
    assert joined(["a", "-b", "c * d"]) == "a - b + c * d"
    assert joined(["-a"]) == "-a"
    assert joined([]) == ""
    assert weighted([(1.0, "a"), (-1.0, "b"), (0.5, "c"), (-2.0, "d")]) == "a - b + 0.5 * c - 2.0 * d"


def test_choices_become_calls_for_arrays() -> None:
    assert branchless("a if b < 0 and c > 1 or d == 0 else -a") == "where(either(both(b < 0, c > 1), d == 0), a, -a)"


VALUES = {"a": 0.7, "b": -1.3, "c": 2.5, "n": 1.5}
SLOPES = {
    "a + 3": 1.0,
    "3 - a": -1.0,
    "-a": -1.0,
    "a - b": 1.0,
    "b - a": -1.0,
    "a - a * b": 1.0 + 1.3,
    "a * a": 1.4,
    "a * b": -1.3,
    "b / a": 1.3 / 0.49,
    "a / b": -1.0 / 1.3,
    "a / (a + c)": 2.5 / 3.2**2,
    "sin(a)": cos(0.7),
    "cos(a)": -sin(0.7),
    "sqrt(a)": 0.5 / 0.7**0.5,
    "abs(a)": 1.0,
    "abs(-a)": 1.0,
    "abs(b - a)": 1.0,
    "abs(a - a)": 0.0,
    "pow(a, n)": 1.5 * 0.7**0.5,
    "pow(c, a)": log(2.5) * 2.5**0.7,
    "log(a)": 1.0 / 0.7,
    "pow(a, a)": 0.7**0.7 * (1.0 + log(0.7)),
    "pow(0, a)": 0.0,
    "pow(0 if a > 0 else 1, a)": 0.0,
    "atan2(a, c)": 2.5 / (0.49 + 6.25),
    "atan2(c, a)": -2.5 / (0.49 + 6.25),
    "atan2(a, a)": 0.0,
    "table(a)": 1.4,
    "a * a if b < 0 else a": 1.4,
    "a * a if b > 0 else a": 1.0,
    "a if b < 0 else c": 1.0,
    "c if b < 0 else a": 0.0,
}
"""The derivatives by a, where it is 0.7 and the table is that of squares."""


@pytest.mark.parametrize("formula", SLOPES)
def test_the_derivative_of_a_formula(formula: str) -> None:
    slope = tangent(formula, {"a": "d_a"}.get)
    assert slope is not None
    tables = {"table": lambda x: x * x, "slope_of_table": lambda x: 2.0 * x}
    found = compiled({"slope": slope}, tables)({**VALUES, "d_a": 1.0})["slope"]
    assert found == pytest.approx(SLOPES[formula], rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("formula", ["3", "-b", "b + c", "b * c", "b / c", "sin(b)", "atan2(b, c)", "pow(b, 2)"])
def test_a_formula_without_changing_names_has_no_derivative(formula: str) -> None:
    assert tangent(formula, {"a": "d_a"}.get) is None
    assert tangent(f"{formula} if a > 0 else c", {"a": "d_a"}.get) is None
