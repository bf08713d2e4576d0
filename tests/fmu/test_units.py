"""Units as exponents of base units, with what is displayed (rov_fmu/fmu/variables.py)."""

from math import pi

import pytest

from rov_fmu.fmu.variables import Unit, unit_of

UNITS = {
    "1": Unit({}, "%", 100.0),
    "N": Unit({"kg": 1, "m": 1, "s": -2}),
    "N.m": Unit({"kg": 1, "m": 2, "s": -2}),
    "kg.m2": Unit({"kg": 1, "m": 2}),
    "V": Unit({"kg": 1, "m": 2, "s": -3, "A": -1}),
    "us": Unit({"s": 1}, size=1e-6),
    "1/s": Unit({"s": -1}),
    "N/s": Unit({"kg": 1, "m": 1, "s": -3}),
    "rad": Unit({"rad": 1}, "deg", 180.0 / pi),
    "rad/s": Unit({"rad": 1, "s": -1}, "deg/s", 180.0 / pi),
    "m/s": Unit({"m": 1, "s": -1}, "knot", 3600.0 / 1852.0),
    "N.s2/(m2.rad2)": Unit({"kg": 1, "m": -1, "rad": -2}),
    "N.m.s2/rad2": Unit({"kg": 1, "m": 2, "rad": -2}),
    "N.m.s/rad": Unit({"kg": 1, "m": 2, "s": -1, "rad": -1}),
}


@pytest.mark.parametrize("text", UNITS)
def test_a_unit_is_read_from_its_text(text: str) -> None:
    found = unit_of(text)
    assert (found.exponents, found.display, found.size) == (
        UNITS[text].exponents,
        UNITS[text].display,
        UNITS[text].size,
    )
    assert found.factor == pytest.approx(UNITS[text].factor, rel=1e-15)
