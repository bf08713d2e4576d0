"""The page that compares the vehicles with their publications: its tables against numbers computed here or printed."""

import re
from math import sqrt

import pytest

from docs import reference
from docs.compared import VON_BENZON, WU, Table, tables
from rov_fmu.io.toml_file import read_toml
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle
from tests.commands import ROOT


@pytest.fixture(scope="module")
def computed() -> dict[str, Table]:
    return tables()


def numbers(row: tuple[str, ...]) -> list[float]:
    """Of the cells of a row after its first, those that begin with one."""
    cells = (re.match(r"[+-]?\d+(\.\d+)?", cell) for cell in row[1:])
    return [float(cell[0]) for cell in cells if cell]


def test_the_drawings_show_the_vehicles_as_they_are() -> None:
    """Their bytes depend on the version of Matplotlib, their elements do not."""
    assert {*reference.drawings()} == {*(ROOT / "docs" / "drawings").iterdir()}
    for path, drawing in reference.drawings().items():
        shown, drawn = (re.findall(r"<(\w+)|>([^<>]+)<", text) for text in (path.read_text(encoding="utf-8"), drawing))
        assert shown == drawn
        assert len(drawn) > 100


def test_videoray_is_as_far_from_the_tables_as_the_design_says(computed: dict[str, Table]) -> None:
    heave, yaw, surge = computed["videoray_printed"][2:]
    assert numbers(heave) == [4.4, 14.3, 2.9, -5.7]
    assert numbers(yaw) == [0.2, 4.0, -4.7, 3.4]
    assert not numbers(surge), "Table 8 is lost"
    assert [numbers(row)[0] for row in computed["videoray_measured"][2:]] == [-13.5, -21.8, 21.8]


def test_thrust_is_as_far_from_the_makers_points_as_the_design_says(computed: dict[str, Table]) -> None:
    shipped, symmetric = computed["t200"][2:]
    assert numbers(shipped)[:2] == pytest.approx([0.30, 0.32], abs=0.011)
    assert numbers(symmetric)[:2] == pytest.approx([2.93, 2.93], abs=0.021)  # every third of the points


@pytest.mark.parametrize("column", [1, 2])
def test_top_speeds_balance_thrust_and_drag(computed: dict[str, Table], column: int) -> None:
    file = read_toml(SHIPPED[["bluerov2", "bluerov2_heavy"][column - 1]], VehicleFileError)
    k = {key: q["value"] for key, q in file["curves"]["t200"].items() if key not in ("description", "electric_current")}
    m = 1.0 - k["c_0"]
    strong, weak = (k["a_t" + end] * m * m + k["b_t" + end] * m for end in ("", "_reverse"))
    pairs, verticals = 2.0 * (strong + weak), len(file["thruster"]) - 4
    arm = (0.156 + 0.111) / sqrt(2.0)
    forces = [pairs / sqrt(2.0)] * 4 + [verticals * strong, -verticals * weak] + [pairs * arm] * 2
    for n, row in enumerate(computed["top_speeds"][2:10]):
        axis = file["axes"][["surge", "sway", "heave", "yaw"][n // 2]]
        force = abs(forces[n] + axis.get("F_0", {"value": 0.0})["value"])
        a, b = axis["a_d"]["value"], axis["b_d"]["value"]
        assert numbers(row)[column - 1] == pytest.approx((sqrt(b * b + 4.0 * a * force) - b) / (2.0 * a), abs=0.006), (
            row
        )


def test_the_numbers_of_the_publications_are_those_of_the_files() -> None:
    for name, published in (("bluerov2", WU), ("bluerov2_heavy", VON_BENZON)):
        rov = load_vehicle(SHIPPED[name])
        for form in rov.layout.axes:
            axis, i = form.axis, "uvwpqr".index(form.axis.velocity)
            found = (rov[axis.inertia], *(rov[axis.coefficient(key)] for key in ("m_a", "b_d", "a_d")))
            assert found == (published.mass[i], published.added_mass[i], published.linear[i], published.quadratic[i])
        net_weight = rov["W"] - rov["B"] if rov.layout.has_attitude else rov["F_0_w"]
        assert net_weight == pytest.approx(published.weight - published.buoyancy, abs=1e-12)


def test_vehicles_tilt_as_the_page_says(computed: dict[str, Table]) -> None:
    heavy, higher = ([cell == "turns over" for cell in row[1:]] for row in computed["tilting"][2:])
    assert heavy == [False, False, True, True, True]
    assert higher == [False, False, False, False, True]
