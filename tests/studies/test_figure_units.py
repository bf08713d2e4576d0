"""A figure has a unit where its expression says it."""

import pytest

from rov_fmu.studies.figure_units import figure_unit

UNITS = {"u": "m/s", "v": "m/s", "x": "m", "der(u)": "m/s2", "a": "1"}


@pytest.mark.parametrize(
    ("expression", "unit"),
    [
        ("x[-1] - at(x, 10)", "m"), ("max(abs(u - v))", "m/s"), ('final(out["der(u)"])', "m/s2"), ("Tau(u, 0)", "s"),
        ("overshoot(u)", "1"), ("-u[0]", "m/s"), ("t[u > 0.3][0]", "s"), ("final(a)", "1"),
        ("final(u) * 3.6", ""), ("final(u) - final(x)", ""), ("final(u) + 1.0", ""), ("sqrt(final(x))", ""),
        ("max([u for u in x])", ""), ("1.0", ""),
    ],
)  # fmt: skip
def test_the_unit_follows_from_the_variables_or_is_left_out(expression: str, unit: str) -> None:
    assert figure_unit(expression, UNITS) == unit
