"""The bounds, nominal values and units in modelDescription.xml."""

from math import inf, pi
from pathlib import Path

import pytest
from lxml import etree

from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.fmu.test_versions import described
from tests.vehicles import THRUST_EFFECTS, VEHICLES, pulsed

# Exponents of kg, m, s, rad, A; then what is displayed, and how often it is contained in the unit.
UNITS: dict[str, tuple[object, ...]] = {
    "1": (0, 0, 0, 0, 0, "%", 100.0),
    "kg": (1, 0, 0, 0, 0),
    "m": (0, 1, 0, 0, 0),
    "rad": (0, 0, 0, 1, 0, "deg", 180.0 / pi),
    "m/s": (0, 1, -1, 0, 0, "knot", 3600.0 / 1852.0),
    "rad/s": (0, 0, -1, 1, 0, "deg/s", 180.0 / pi),
    "m/s2": (0, 1, -2, 0, 0),
    "rad/s2": (0, 0, -2, 1, 0),
    "N": (1, 1, -2, 0, 0),
    "N.m": (1, 2, -2, 0, 0),
    "kg.m2": (1, 2, 0, 0, 0),
    "N.s/m": (1, 0, -1, 0, 0),
    "N.s2/m2": (1, -1, 0, 0, 0),
    "N.m.s/rad": (1, 2, -1, -1, 0),
    "N.m.s2/rad2": (1, 2, 0, -2, 0),
}
OTHER_UNITS: dict[str, tuple[object, ...]] = {
    "us": (0, 0, 1, 0, 0, 1e-6),
    "V": (1, 2, -3, 0, -1),
    "s": (0, 0, 1, 0, 0),
    "N/s": (1, 1, -3, 0, 0),
    "1/s": (0, 0, -1, 0, 0),
    "N.s2/(m2.rad)": (1, -1, 0, -1, 0),
    "N.s2/(m2.rad2)": (1, -1, 0, -2, 0),
}
"""Those that only a vehicle with pulse widths, a battery, both lags and a fin has; a µs is 1e-6 s."""


@pytest.fixture(scope="module")
def description(videoray_dir: Path) -> etree._ElementTree:
    return etree.parse(str(videoray_dir / "modelDescription.xml"))


def test_bounds_and_nominal_values(description: etree._ElementTree, vehicle: Vehicle) -> None:
    """They are those of the catalogue, which tests/equation/table/test_layout.py and tests/docs/test_docs.py check."""
    layout = vehicle.layout
    declared = layout.inputs | layout.state | layout.calculated | layout.coefficients
    for variable in description.iter("ScalarVariable"):
        low, high, nominal = (variable[0].get(key) for key in ("min", "max", "nominal"))
        one, is_moved = declared.get(variable.get("name")), variable.get("name") in layout.inputs | layout.state
        bounds = (one.minimum, one.maximum) if one else (-inf, inf)
        assert (float(low or -inf), float(high or inf)) == bounds, variable.get("name")
        assert nominal == (f"{one.nominal}" if one and is_moved else None), variable.get("name")


def units(description: etree._ElementTree) -> dict[str, tuple[object, ...]]:
    """Return the exponents of each unit, its size if it is no SI unit, and what is displayed."""
    found = {}
    for unit in description.iter("Unit"):
        size = [float(size)] if (size := unit.find("BaseUnit").get("factor")) is not None else []
        exponents = (int(unit.find("BaseUnit").get(base, "0")) for base in ("kg", "m", "s", "rad", "A"))
        shown = ((shown.get("name"), pytest.approx(float(shown.get("factor")))) for shown in unit.iter("DisplayUnit"))
        found[unit.get("name")] = (*exponents, *size, *(part for pair in shown for part in pair))
    return found


def test_units(description: etree._ElementTree) -> None:
    assert units(description) == UNITS
    of_effects = units(described(pulsed(load_vehicle(THRUST_EFFECTS), (1100.0, 1480.0, 1900.0)), 2))
    assert of_effects == {**{name: UNITS.get(name) for name in of_effects}, **OTHER_UNITS}


@pytest.mark.parametrize(
    ("kind", "north", "east"),
    [
        ("VideoRay", "u cos ψ + V_N", "u sin ψ + V_E"),
        ("Heavy", "u cos ψ - v sin ψ + V_N", "u sin ψ + v cos ψ + V_E"),
        ("surge and sway without yaw", "u + V_N", "v + V_E"),
    ],
)
def test_the_velocities_over_ground_have_their_formulas(kind: str, north: str, east: str) -> None:
    words = {v.name: v.description for v in variables(VEHICLES[kind])}
    assert (words["der(x)"], words["der(y)"]) == (
        f"Velocity over ground northward, {north}",
        f"Velocity over ground eastward, {east}",
    )
