"""What the page that flies gets of a vehicle: keys, sliders, labels, step tests, and columns of commands."""

import json
from collections.abc import Iterable, Sequence
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


def shown(rows: Iterable[Sequence[Any]]) -> str:
    """Return rows of texts and numbers as one text."""
    return ", ".join(" ".join(part if isinstance(part, str) else f"{part:.4g}" for part in row) for row in rows)


def test_keys_loads_and_places_of_the_heavy() -> None:
    """A T200 of the Heavy gives 53.2 N ahead and 41.4 N in reverse, so that four aslant push with 134 N."""
    heavy = flown_vehicle("bluerov2_heavy")
    found, axes = live([FlyingVehicle(heavy, b"")]), data_of(heavy)["axes"]
    keys = ", ".join(f"{axis.name} {keys}" for axis, keys in found.keys)
    assert keys == "surge WS, sway EQ, heave FR, roll LJ, pitch IK, yaw DA"
    positions = ", ".join(f"{axis['position']} {axis['positionUnit']}" for axis in axes)
    assert positions == "None m, None m, z m, phi rad, theta rad, psi rad"
    loads = "X_ext 100 N, Y_ext 100 N, Z_ext 200 N, K_ext 50 N·m, M_ext 30 N·m, N_ext 40 N·m"
    assert shown(found.loads) == f"{loads}, V_N 1 m/s, V_E 1 m/s, V_D 1 m/s"
    around = "right front, left front, right rear, left rear"
    assert ", ".join(found.places.values()) == f"{around}, {around.replace(',', ' vertical,')} vertical"
    assert [*found.places] == [*heavy.layout.commands]
    assert [law["held"] for law in found.laws] == [["heave", "yaw", "roll", "pitch"]] * 2
    other = live([FlyingVehicle(flown_vehicle("videoray"), b""), FlyingVehicle(heavy, b"")])
    assert [law["held"] for law in other.laws] == [["heave", "yaw"]] * 2, "the ghost does not matter"
    assert (found.title, found.other) == ("BlueROV2 Heavy", None)
    assert ", ".join(found.tests[:5]) == "surge 10 %, surge 40 %, surge 70 %, surge 100 %, sway 10 %"


def test_sliders_reach_from_half_to_twice_a_mass_and_20_cm_beside_a_centre() -> None:
    found = live([FlyingVehicle(flown_vehicle("bluerov2_heavy").with_(alpha_u=0.05, beta_w=2.0, health_8=1.1), b"")])
    ballast, health, tuning = found.tunable.values()
    mass = "m_rov m_rov 6.75 27 13.5 kg, W W 106.1 165.7 132.6 N, B B 105.3 164.5 131.6 N"
    assert shown(row[:-1] for row in ballast) == f"{mass}, z_B z_B -0.21 0.19 -0.01 m"
    assert shown(row[:-1] for row in (health[0], health[7])) == (
        "health_1 right front 0 1 1 , health_8 left rear vertical 0 1.1 1.1 "
    )
    assert shown(row[:-1] for row in (tuning[0], tuning[1], tuning[8])) == (
        "alpha_u α of surge 0.05 3 0.05 , alpha_v α of sway 0.1 3 1 , beta_w β of heave 0.1 4 2 "
    )
    effects = live([FlyingVehicle(flown_vehicle("thrust effects"), b"")])
    assert shown(effects.loads).endswith(", voltage 29.6 V"), "twice its start value"
    sliders = shown(row[1:-1] for row in effects.tunable["Ballast and payload"])
    assert sliders == "m_rov 10 40 20 kg, k_t_main 0.45 1.8 0.9 , k_t_bow 0.5 2 1 "
    assert shown(effects.places.items()) == "u_l left rear, u_r right rear, u_bow front, u_top vertical"
    assert not effects.laws, "it has a fin"
    with_mix = flown_vehicle("everything")
    assert live([FlyingVehicle(with_mix, b"")]).places == {}
    assert ", ".join(thruster["label"] for thruster in data_of(with_mix)["thrusters"]) == (
        "right front, left front, 3 right rear, 4 left rear, vertical, l left rear, r right rear"
    )


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
