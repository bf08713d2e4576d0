"""The intervals in the sentences of findings: none excludes its value, or hides its width behind too few digits."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.identify.findings import _SENTENCES, sentences
from rov_fmu.tank.findings import Finding

_NUMBER = r"(-?[\d.]+(?:[eE][+-]?\d+)?)"
_INTERVAL = re.compile(
    rf"{_NUMBER}(?: \.\.\. {_NUMBER})? ?[^\s(]*(?: late| times the (?:thrust|drag) ahead)? \({_NUMBER} to {_NUMBER}\)"
)
_NAMES = {"beta": "beta_u", "mass": "m_rov", "curve": "rear", "unit": "N", "of": "surge", "a_d": "a_d_u"}
_VALUES = st.floats(1e-3, 1e3)
_PARTS = st.floats(1e-5, 1e3)
"""Half the width of an interval, as a part of its value."""


def about_value(name: str) -> bool:
    """Return True if the sentence of a kind of finding contains a value with its interval."""
    numbers = {"value": 1.0, "low": 0.9, "high": 1.1}
    try:
        (written,) = sentences([Finding(name, "surge", "rear", "a.csv", _NAMES, numbers)])
    except KeyError:  # it needs other words or numbers
        return False
    return bool(_INTERVAL.search(written))


KINDS = [name for name in _SENTENCES if about_value(name)]


def test_every_effect_has_its_interval() -> None:
    assert {*KINDS} == {*EFFECTS, "delay not modelled", "inertia below mass"}


@pytest.mark.parametrize("kind", KINDS)
@given(value=_VALUES, other=_VALUES, sign=st.sampled_from([-1.0, 1.0]), below=_PARTS, above=_PARTS)
def test_no_interval_in_a_sentence_excludes_its_value_or_hides_its_width(
    kind: str, value: float, other: float, sign: float, below: float, above: float
) -> None:
    """Two findings that share a sentence have one interval around both."""
    found = [
        Finding(kind, "surge", "rear", file, _NAMES, {"value": sign * v, "low": low, "high": high})
        for file, v in (("a.csv", value), ("b.csv", other))
        for low, high in [sorted((sign * v * (1.0 - below), sign * v * (1.0 + above)))]
    ]
    for some in (found[:1], found):
        (written,) = sentences(some)
        match = _INTERVAL.search(written)
        assert match, written
        first, last, low, high = (float(number) for number in (match[1], match[2] or match[1], match[3], match[4]))
        assert low <= first <= last <= high, written
        width = max(f.numbers["high"] for f in some) - min(f.numbers["low"] for f in some)
        assert 0.5 * width <= high - low <= 1.5 * width, written


@given(low=st.floats(0.0, 1e3), width=st.floats(1e-3, 1e3))
def test_the_ends_of_a_drag_that_is_hardly_known_are_told_apart(low: float, width: float) -> None:
    numbers = {"a_d low": low, "a_d high": low + width}
    (written,) = sentences([Finding("inseparable drag", "surge", names={"a_d": "a_d_u"}, numbers=numbers)])
    ends = re.search(rf"from {_NUMBER} to {_NUMBER}\. Only", written)
    assert ends, written
    assert 0.5 * width <= float(ends[2]) - float(ends[1]) <= 1.5 * width, written
