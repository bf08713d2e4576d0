"""Expressions: how they are written in C, named and differentiated (equation/expression.py).

Their values are those of the vehicles, which other tests compare with 50 digits.
"""

import math

import pytest

from rov_fmu.equation.expression import (
    ZERO,
    Expression,
    Language,
    Name,
    Names,
    beyond_dead_band,
    call,
    compiled,
    directed,
    equal,
    product,
    saturated,
    tangent,
    to_c,
    total,
    where,
    with_positive_zero,
    written,
)
from rov_fmu.report.page.typeset import MATHML, TEXT

a, b, c, d = map(Name, "abcd")


@pytest.mark.parametrize(
    ("expression", "in_c"),
    [
        (a / (b * c), "a / (b * c)"),
        ((a + b) * c, "(a + b) * c"),
        (call("abs", a) + call("pow", b, 2.0), "fabs(a) + pow(b, 2.0)"),
        (call("table", where(b < 0.0, a, c)), "table(b < 0.0 ? a : c)"),
        (saturated(a), "a > 1.0 ? 1.0 : a < -1.0 ? -1.0 : a"),
        (directed(b, a, -a) * c, "(b < 0.0 ? -a : a) * c"),
        (beyond_dead_band(a, b, c), "a < 0.0 || (a == 0.0 && b > 0.0) ? 0.0 : c"),
        (a - b - (c - d) + (a + b), "a - b - (c - d) + (a + b)"),
        (a / b / (c / d) * (a * b), "a / b / (c / d) * (a * b)"),
        (-(a + b) - c * -(a + b), "-(a + b) - c * -(a + b)"),
        (where(a + b > c * d, a, b) + c, "(a + b > c * d ? a : b) + c"),
        (where(equal(a, -1.5), math.inf, 2.0) * where(a >= b, a, c), "(a == -1.5 ? INFINITY : 2.0) * (a >= b ? a : c)"),
        (total([a, -b * c, -(b * c), -(a / b) / c, d]), "a - b * c - b * c - a / b / c + d"),
        (total([]) + product() + product(a, 2.0, b), "1.0 + a * 2.0 * b"),
        (-2.0 * (a * b) + 1.0 * (a / b) + 0.5 * (a + b), "-2.0 * a * b + a / b + 0.5 * (a + b)"),
        (where(where(b < c, a, b) < 1.0, 1.0, 2.0), "(b < c ? a : b) < 1.0 ? 1.0 : 2.0"),
        (where(b >= c, where(a < b, 1.0, 2.0), 3.0), "b >= c ? (a < b ? 1.0 : 2.0) : 3.0"),
    ],
)
def test_c_has_the_brackets_that_it_needs(expression: Expression, in_c: str) -> None:
    assert to_c(expression) == in_c


@pytest.mark.parametrize(
    ("expression", "same"),
    [
        *(
            (a + 0.0, a),
            (0.0 + a, a),
            (a - 0.0, a),
            (0.0 - a, -a),
            (a * 1.0, a),
            (1.0 * a, a),
            (a / 1.0, a),
            (-1.0 * a, -a),
        ),
        *(
            (a * 0.0, ZERO),
            (0.0 * a, ZERO),
            (0.0 / a, ZERO),
            (-ZERO, ZERO),
            (-(0.0 - a), a),
            (a + -b, a - b),
            (a - -b / c, a + b / c),
        ),
        *((-(a * b), -a * b), (-(a / b) * c, -a / b * c), (-1.0 * (a * b), -a * b), (a + -(b * c), a - b * c)),
        *(
            (where(a < b, c, c), c),
            (directed(a, b, b), b),
            (total([ZERO, a, ZERO]), a),
            (product(1.0, a, -1.0), -a),
        ),
    ],
)
def test_operators_leave_out_what_0_and_1_and_minus_1_do_not_change(expression: Expression, same: Expression) -> None:
    assert expression == same


@pytest.mark.parametrize("x", [-0.0, 0.0, 1.5])
def test_a_zero_is_made_positive(x: float) -> None:
    found = compiled({"y": with_positive_zero(a)})({"a": x})["y"]
    assert math.copysign(1.0, found) == 1.0
    assert found == x


@pytest.mark.parametrize("language", [TEXT, MATHML], ids=["text", "MathML"])
def test_what_readers_cannot_be_shown_is_told(language: Language) -> None:
    with pytest.raises(ValueError, match=r"^hypot\(a, b \+ c\): there is no way to show this$"):
        written(2.0 * call("hypot", a, b + c), language)


def test_two_quantities_never_have_the_same_identifier() -> None:
    names = Names(["angle_max_rudder", "F_1"])
    rudder = names("angle", "max_rudder")
    assert (rudder.identifier, rudder.kind, rudder.owners) == ("angle_max_rudder_2", "angle", ("max_rudder",))
    assert names("angle", "max_rudder") is rudder
    assert names("angle_max", "rudder").identifier == "angle_max_rudder_3"
    assert names("angle", "max_rudder_2").identifier == "angle_max_rudder_2_2"
    assert [name.owners for name in names.of_kind("angle")] == [("max_rudder",), ("max_rudder_2",)]


@pytest.mark.parametrize(
    "expression",
    [
        *(a * b - c / d, -a + a * a, call("sqrt", a) * call("log", b), call("sin", a) + call("cos", a * b)),
        *(call("pow", a / b, c), call("atan2", a, b), call("abs", a - b), saturated(a - b), directed(a - b, a, c)),
        *(beyond_dead_band(a - c, b, a * b), 2.0 - a, a - 2.0, 1.0 / a, a / 2.0, 3.0 * a, a * 3.0, -call("log", a)),
        *(call("pow", a, 3.0), call("pow", 2.0, a), call("atan2", 2.0, a), call("atan2", a, 2.0), call("abs", -a)),
        *(where(a < b, 3.0, b * c), where(a < b, b * c, 3.0), where(a > b, a, c), directed(a, 2.0, b)),
    ],
    ids=to_c,
)
def test_the_derivative_of_an_expression_is_its_slope(expression: Expression) -> None:
    at, change = {"a": 0.7, "b": 1.3, "c": 0.4, "d": 2.1}, {"d_a": 0.3, "d_b": -0.5, "d_c": 0.9, "d_d": 0.2}
    slope = tangent(expression, {name: Name(f"d_{name}") for name in at})

    def moved(t: float) -> float:
        return float(compiled({"y": expression})({name: x + t * change[f"d_{name}"] for name, x in at.items()})["y"])

    found = compiled({"slope": slope})({**at, **change})["slope"]
    assert found == pytest.approx((moved(1e-5) - moved(-1e-5)) / 2e-5, rel=1e-8)
