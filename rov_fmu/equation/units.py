"""The units of variables and coefficients: one table, from which all that files and pages say of a unit follows.

A unit is written as in modelDescription.xml, N.m.s2/rad2 or N.s2/(m.rad), with a digit after a symbol for its power.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import degrees


@dataclass(frozen=True)
class Unit:
    """What follows from a unit. A unit without a row in UNITS belongs to a coefficient that couples axes."""

    quantity: str = "Coupling coefficient"
    """The name of its types in FMI 3.0."""
    words: str = ""
    """What a plot calls its variables."""
    exponents: Mapping[str, int] = field(default_factory=dict)
    """The exponents of the FMI base units, which follow from those of its symbols if it has several."""
    size: float = 1.0
    """The unit in SI units."""
    display: str | None = None
    """The unit in which people read its values."""
    factor: float = 1.0
    """Converts values to the display unit."""


_DEGREES = degrees(1.0)
UNITS = {
    "1": Unit("Number", "command", display="%", factor=100.0),
    "us": Unit("Pulse width", "command", {"s": 1}, size=1e-6),
    "V": Unit("Voltage", exponents={"kg": 1, "m": 2, "s": -3, "A": -1}),
    "A": Unit("Electric current", "electric current", {"A": 1}),
    "W": Unit("Power", "power", {"kg": 1, "m": 2, "s": -3}),
    "N": Unit("Force", "force", {"kg": 1, "m": 1, "s": -2}),
    "N.m": Unit("Torque", "torque"),
    "m/s": Unit("Velocity", "velocity", display="knot", factor=1.0 / (1852.0 / 3600.0)),
    "rad/s": Unit("Angular velocity", "rate of turn", {}, 1.0, "deg/s", _DEGREES),
    "m": Unit("Length", "position", {"m": 1}),
    "rad": Unit("Angle", "angle", {"rad": 1}, 1.0, "deg", _DEGREES),
    "m/s2": Unit("Acceleration", "acceleration"),
    "rad/s2": Unit("Angular acceleration", "angular acceleration"),
    "s": Unit("Duration", exponents={"s": 1}),
    "1/s": Unit("Rate"),
    "N/s": Unit("Rate of force"),
    "kg": Unit("Mass", exponents={"kg": 1}),
    "kg.m": Unit("Coupled mass"),
    "kg.m2": Unit("Moment of inertia"),
    "N.s/m": Unit("Linear damping"),
    "N.s2/m2": Unit("Quadratic damping"),
    "N.m.s/rad": Unit("Linear rotational damping"),
    "N.m.s2/rad2": Unit("Quadratic rotational damping"),
    "N.s2/(m2.rad)": Unit("Lift"),
    "N.s2/(m2.rad2)": Unit("Induced drag"),
}
"""The units that have a quantity, and every symbol in a unit."""


@cache
def parsed_unit(text: str) -> Unit:
    """Return the `Unit` of a symbol such as N.s/m, from UNITS or from its parts."""
    unit, exponents = UNITS.get(text, Unit()), Counter[str]()
    if unit.exponents:
        return unit
    above, _, below = text.partition("/")
    for sign, symbols in ((1, above), (-1, below.strip("()"))):
        for symbol in filter(None, symbols.split(".")):
            name = symbol.rstrip("23") if symbol != "1" else symbol
            for base, exponent in UNITS[name].exponents.items():
                exponents[base] += sign * exponent * int(symbol[len(name) :] or 1)
    return replace(unit, exponents={base: exponent for base, exponent in exponents.items() if exponent})


def in_degrees(unit: str) -> tuple[float, str]:
    """Return the factor from an SI unit to the printed unit, and the name of the printed unit. Angles are printed in
    degrees."""
    return (_DEGREES, unit.replace("rad", "deg")) if "rad" in unit else (1.0, unit)
