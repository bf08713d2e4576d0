"""The derivative of an expression is its slope, whatever its operations. Other tests compare values with 50 digits."""

import pytest

from rov_fmu.equation.expression import (
    Expression,
    Name,
    beyond_dead_band,
    call,
    compiled,
    directed,
    saturated,
    tangent,
    to_c,
    where,
)

a, b, c, d = map(Name, "abcd")


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
