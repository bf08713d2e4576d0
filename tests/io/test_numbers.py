"""Numbers as text: an interval keeps its width, and contains its value."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rov_fmu.io.numbers import with_interval


@pytest.mark.parametrize(
    ("value", "interval", "texts"),
    [
        (36.98, (36.974, 37.004), ("36.98", "36.97", "37.00")),
        (12345.0, (12201.0, 12500.0), ("12340", "12200", "12500")),
        (-0.04, (-1.2, 1.2), ("-0.040", "-1.2", "1.2")),
        (-0.004, (-1.2, 1.2), ("0", "-1.2", "1.2")),
        (5.8e-12, (-0.35, 0.35), ("0", "-0.35", "0.35")),
        (2.5, None, ("2.500", "", "")),
        (1234567.0, None, ("1.235e+6", "", "")),
        (123456.0, None, ("123500", "", "")),
        (1.23456e-5, None, ("0.00001235", "", "")),
        (1.23456e-6, None, ("1.235e-6", "", "")),
        (39.99999999999999, (39.99999999999998, 40.00000000000001), ("40.00", "40.00", "40.00")),
    ],
)
def test_a_value_has_the_digits_of_its_interval(
    value: float, interval: tuple[float, float] | None, texts: tuple[str, str, str]
) -> None:
    assert with_interval(value, interval) == texts


SIZES = st.floats(-1e12, 1e12).filter(lambda x: x == 0.0 or abs(x) > 1e-12)
"""Numbers of every size that a coefficient may have."""
PARTS = st.floats(1e-9, 1e9)
"""Half the width of an interval, as a part of its value."""


@given(SIZES, PARTS, PARTS)
def test_no_written_interval_excludes_its_value_or_hides_its_width(value: float, below: float, above: float) -> None:
    size = abs(value) or 1.0
    low, high = value - below * size, value + above * size
    middle, *ends = (float(text) for text in with_interval(value, (low, high)))
    assert ends[0] <= middle <= ends[1]
    assert 0.5 * (high - low) <= ends[1] - ends[0] <= 1.5 * (high - low)
    if abs(value) > 0.01 * (high - low):
        assert abs(middle / value - 1.0) < 0.051, "the value keeps two digits"
