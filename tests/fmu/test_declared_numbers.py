"""The bounds, nominal values and units in modelDescription.xml equal a second list of them."""

from math import pi
from pathlib import Path

import pytest
from lxml import etree

from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.fmu.test_versions import described
from tests.vehicles import THRUST_EFFECTS, VEHICLES, pulsed

DRAG, CURVES, TUNING = (
    " ".join(f"{kind}_{which}" for kind in kinds.split() for which in whiches.split())
    for kinds, whiches in (("a_d b_d", "u w r"), ("a_t b_t", "rear top"), ("alpha beta", "u w r"))
)
# Minimum, maximum, nominal value.
NUMBERS = {
    "u_l u_r u_t": (-1.0, 1.0, 1.0),
    "X_ext Z_ext x y z": (None, None, 10.0),
    "N_ext V_N V_E u w r psi": (None, None, 1.0),
    "der(u) der(w) der(r) der(x) der(y) der(z) der(psi) F_l F_r F_t tau_rear": (None, None, None),
    "m_rov": (1e-3, 1e6, None),
    "I_r": (1e-6, 1e6, None),
    "R": (0.0, 100.0, None),
    "gamma": (0.0, 1.5708, None),
    CURVES: (-1e6, 1e6, None),
    DRAG: (0.0, 1e6, None),
    TUNING: (0.0, 1e3, None),
}
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
    "N.s2/(m2.rad)": (1, -1, 0, -1, 0),
    "N.s2/(m2.rad2)": (1, -1, 0, -2, 0),
}
"""Those that only a vehicle with pulse widths, a battery, lag and a fin has; a µs is 1e-6 s."""


@pytest.fixture(scope="module")
def description(videoray_dir: Path) -> etree._ElementTree:
    return etree.parse(str(videoray_dir / "modelDescription.xml"))


def test_bounds_and_nominal_values(description: etree._ElementTree) -> None:
    expected = {name: numbers for names, numbers in NUMBERS.items() for name in names.split()}
    found = {}
    for variable in description.iter("ScalarVariable"):
        values = (variable[0].get(key) for key in ("min", "max", "nominal"))
        found[variable.get("name")] = tuple(None if value is None else float(value) for value in values)
    assert found == expected


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
