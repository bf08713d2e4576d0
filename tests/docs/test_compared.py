"""The page that compares the vehicles with their publications: its tables against numbers computed here or printed."""

import re
from functools import partial

import pytest

from docs import reference
from docs.compared import Table, tables
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ROOT


@pytest.fixture(scope="module")
def computed() -> dict[str, Table]:
    return tables()


def numbers(row: tuple[str, ...]) -> list[float]:
    """Of the cells of a row after its first, those that begin with one."""
    cells = (re.match(r"[+-]?\d+(\.\d+)?", cell) for cell in row[1:])
    return [float(cell[0]) for cell in cells if cell]


@pytest.mark.long
def test_the_drawings_show_the_vehicles_as_they_are() -> None:
    """Their bytes depend on the version of Matplotlib, their elements do not."""
    assert {*reference.drawings()} == {*(ROOT / "docs" / "drawings").iterdir()}
    for path, drawing in reference.drawings().items():
        shown, drawn = map(reference.elements, (path.read_text(encoding="utf-8"), drawing))
        assert shown == drawn
        assert len(drawn) > 50


def test_the_videoray_is_as_fast_as_the_page_says() -> None:
    vehicle, page = load_vehicle(SHIPPED["videoray"]), (ROOT / "docs" / "vehicles.md").read_text("utf-8")
    (low, high), speed = vehicle.command_range, partial(vehicle.response, SURGE)
    holds = f"holds from {low:.0%} to {high:.0%} of the full command, that is up to {speed(high)[0]:.2f} m/s ahead"
    assert f"{holds}; its {speed(1.0)[0]:.2f} m/s at full command".replace("%", " %") in page


def test_thrust_is_as_far_from_the_makers_points_as_the_design_says(computed: dict[str, Table]) -> None:
    shipped, symmetric = computed["t200"][1:]
    assert numbers(shipped)[:2] == pytest.approx([0.30, 0.32], abs=0.011)
    assert numbers(symmetric)[:2] == pytest.approx([2.93, 2.93], abs=0.021)  # every third of the points


def test_vehicles_tilt_as_the_page_says(computed: dict[str, Table]) -> None:
    heavy, higher = ([cell == "turns over" for cell in row[1:]] for row in computed["tilting"][1:])
    assert heavy == [False, False, True, True, True]
    assert higher == [False, False, False, False, True]
