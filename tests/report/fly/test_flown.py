"""What the page that flies gets of a vehicle: keys, sliders, labels, step tests, and columns of commands."""

import json
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest

from rov_fmu.report.page.live import FlyingVehicle, live
from rov_fmu.vehicle.vehicle import Vehicle
from tests.report.conftest import flown_vehicle
from tests.vehicles import VEHICLES, a_vehicle


def data_of(vehicle: Vehicle) -> Any:
    """Return the data of a vehicle that the scripts of the page read."""
    return json.loads(live([FlyingVehicle(vehicle, b"")]).data)[0]


def test_keys_and_held_axes_are_those_of_the_vehicle_that_is_flown() -> None:
    heavy = flown_vehicle("bluerov2_heavy")
    found = live([FlyingVehicle(heavy, b"")])
    keys = ", ".join(f"{axis.name} {keys}" for axis, keys in found.keys)
    assert keys == "surge WS, sway EQ, heave FR, roll LJ, pitch IK, yaw DA"
    around = "right front, left front, right rear, left rear"
    assert ", ".join(found.places.values()) == f"{around}, {around.replace(',', ' vertical,')} vertical"
    assert [law["held"] for law in found.laws] == [["heave", "yaw", "roll", "pitch"]] * 2
    other = live([FlyingVehicle(flown_vehicle("videoray"), b""), FlyingVehicle(heavy, b"")])
    assert [law["held"] for law in other.laws] == [["heave", "yaw"]] * 2, "the ghost does not matter"
    assert not live([FlyingVehicle(flown_vehicle("thrust effects"), b"")]).laws, "it has a fin"


@pytest.mark.parametrize("name", ["bluerov2_heavy", "thrust effects", "everything"])
def test_every_slider_begins_at_the_number_of_the_vehicle_within_what_it_may_be(name: str) -> None:
    """A vehicle with unusual numbers has longer sliders."""
    usual = flown_vehicle(name)
    for vehicle in (usual, usual.with_(alpha_u=0.05, beta_w=2.0)):
        rows = [row for group in live([FlyingVehicle(vehicle, b"")]).tunable.values() for row in group]
        assert {row[0] for row in rows} > {"m_rov", "alpha_u", "beta_w"}
        for key, _, low, high, start, *_ in rows:
            known = vehicle.layout.coefficients[key]
            assert start == pytest.approx(vehicle[key])
            assert known.minimum <= low <= start <= high <= known.maximum
            assert low < high


def test_a_key_pushes_along_its_axis_alone() -> None:
    heavy = flown_vehicle("bluerov2_heavy")
    data = data_of(heavy)
    for driven in data["axes"]:
        assert max(map(abs, driven["shares"].values())) == 1.0
        for form in heavy.layout.axes:
            pushed = sum(t.effect(form.axis) * driven["shares"].get(f"u_{t.name}", 0.0) for t in heavy.layout.thrusters)
            assert pushed > 0.3 if form.axis.name == driven["name"] else abs(pushed) < 1e-3
    m, slant = 1.0 - heavy["c_0_t200"], sqrt(0.5)
    for way, vehicle in {"": heavy, "_reverse": heavy.with_(a_t_t200_reverse=60.0)}.items():
        strongest = vehicle[f"a_t_t200{way}"] * m**2 + vehicle[f"b_t_t200{way}"] * m
        assert [t["most"] for t in data_of(vehicle)["thrusters"]] == pytest.approx([strongest] * 8), way
    assert (data["thrusters"][0]["at"], data["size"]) == ([0.156, 0.111, 0.085], 0.218)
    assert data["thrusters"][0]["along"] == pytest.approx([-slant, slant, 0.0])
    assert dict(data["variables"])["eta"] == 1.0, "a quaternion of no turn"
    assert (data["inputs"], data["states"]) == (17, 21)


def test_columns_of_thrusters_become_the_commands_that_give_them_best() -> None:
    vehicle = a_vehicle(VEHICLES["with an input mix"])
    columns, names = data_of(vehicle)["columns"], [*vehicle.layout.commands]
    kinds = {kind: [one for one in columns if one["kind"] == kind] for kind in ("inputs", "thrusters")}
    assert [one["name"] for one in kinds["inputs"]] == names
    assert [one["name"] for one in kinds["thrusters"]] == [f"thruster {n}" for n in range(1, 7)]
    for own in kinds.values():
        gains, shares = (
            np.array([[one[of].get(name, 0.0) for name in names] for one in own]) for of in ("gains", "shares")
        )
        assert shares.T @ gains == pytest.approx(np.eye(len(names)), abs=1e-12)
    assert kinds["thrusters"][2]["gains"] == {"u_ahead": -1.0, "u_aside": -1.0, "u_turn": 0.5}


@pytest.mark.parametrize(
    ("changes", "title"),
    [
        ({"name": "Other"}, "VideoRay Pro 4 beside Other"),
        ({"version": "9"}, "VideoRay Pro 4 {version} beside VideoRay Pro 4 9"),
        ({}, "VideoRay Pro 4 (old.toml) beside VideoRay Pro 4 (new.toml)"),
    ],
)
def test_vehicles_of_the_same_name_are_told_apart(vehicle: Vehicle, changes: dict[str, Any], title: str) -> None:
    found = live([FlyingVehicle(vehicle, b"", "old.toml"), FlyingVehicle(replace(vehicle, **changes), b"", "new.toml")])
    assert found.title == title.format(version=vehicle.version)
    assert found.other == found.title.split(" beside ")[1]
