"""What a steady speed takes: the command that gives it, the thrust against drag and loads, the electric power."""

import re
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE
from rov_fmu.fmu.card import card_text
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.description import StatedSpeed
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.steady import speed_table, steady_at
from rov_fmu.vehicle.vehicle import Vehicle
from tests.commands import BARE, Capsys
from tests.often import spread
from tests.vehicles import VEHICLES

DRIVEN = {name: one for name, one in VEHICLES.items() if any(one.layout.signs(axis) for axis in one.layout.bare_axes)}


@pytest.mark.parametrize("name", DRIVEN)
def test_the_command_of_a_speed_gives_it_and_the_thrust_balances_drag_and_loads(name: str) -> None:
    vehicle = rov_fmu.load(DRIVEN[name])
    for axis in (axis for axis in vehicle.layout.bare_axes if vehicle.layout.signs(axis)):
        for command in (0.37, -0.8):
            there = steady_at(vehicle, axis, command)
            if not 1e-6 < abs(there.velocity) < inf:
                continue
            found = vehicle.find(axis, there.velocity)
            assert vehicle.response(axis, found.command)[0] == pytest.approx(there.velocity, rel=1e-9)
            assert abs(found.command) <= abs(command) * (1.0 + 1e-9)
            assert found.thrust == pytest.approx(_balance(vehicle, axis.name, found.velocity), rel=1e-8, abs=1e-9)


def _balance(vehicle: Vehicle, axis: str, V: float) -> float:
    """Drag of the hull less the constant load and the net weight, from the coefficients alone: (17)."""
    own = vehicle.layout.by_name[axis]
    a_d, b_d = (
        vehicle[own.coefficient(f"{key}_reverse" if V < 0.0 else key)] if key in own.keys else 0.0
        for key in ("a_d", "b_d")
    )
    load = vehicle.coefficients.get(own.coefficient("F_0"), 0.0)
    if axis == HEAVE.name and vehicle.layout.restoring:
        load += vehicle["W"] - vehicle["B"]
    return a_d * abs(V) * V + b_d * V - load


def test_the_engine_reaches_the_speed_that_was_found() -> None:
    """1 m/s takes 18.18 + 4.03 N by the drag of Wu; the power is that of four T200 by their table at 16 V."""
    rov = rov_fmu.load("bluerov2")
    found = rov.find("surge", 1.0)
    deep = rov.simulate([0.0, 60.0], {"surge": found.command}, start={"z": 100.0})
    assert deep["u"][-1] == pytest.approx(1.0, rel=1e-6)
    assert found.thrust == pytest.approx(22.21, rel=1e-9)
    (curve,) = rov.layout.curves
    assert curve.electric_current
    ahead, astern = (curve.electric_current.value(sign * found.command) for sign in (1.0, -1.0))
    assert found.power == pytest.approx(16.0 * 2.0 * (ahead + astern))
    assert rov.find("surge", 1.0, {"X_ext": -20.0}).thrust == pytest.approx(42.21)
    assert rov.find("heave", 0.0).thrust == pytest.approx(2.0), "against its buoyancy"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("surge", "fast"), "velocity = 'fast': must be a number"),
        (("surge", nan), "velocity = nan: must be a finite number"),
        (("surge", [0.3, 0.5]), "velocity: must be one number"),
        ((None, 0.1), "axis = None: the vehicle has no such axis"),
        (("surge", 0.5, {"X_etx": 1.0}), "did you mean X_ext?"),
        (("surge", 0.5, {"X_ext": "x"}), "inputs['X_ext'] = 'x': must be a number"),
        (("surge", 0.5, {"u_1": 0.9}), "inputs['u_1']: the commands are what is found"),
    ],
)
def test_what_is_no_speed_or_no_load_is_refused(arguments: tuple[Any, ...], reason: str) -> None:
    with pytest.raises(InputError) as error:
        rov_fmu.load("bluerov2").find(*arguments)
    assert reason in str(error.value)


def test_a_speed_that_no_command_gives_is_refused_with_the_largest_one(capsys: Capsys) -> None:
    largest = rov_fmu.load("bluerov2").response("surge", -1.0)[0]
    assert main(["simulate", "bluerov2", "--find", "surge=-3"]) == 2
    assert f"surge reaches {largest:.3f} m/s at -100%" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"reaches 0\.000 m/s"):
        rov_fmu.load("videoray").with_(health_t=0.0).find("heave", 0.1)
    with pytest.raises(InputError, match="nothing limits the velocity"):
        rov_fmu.load("videoray").with_(a_d_u=0.0, b_d_u=0.0).find(SURGE, 0.1)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_table_ends_with_the_strongest_tested_command(name: str) -> None:
    vehicle = rov_fmu.load(SHIPPED[name])
    table = dict(speed_table(vehicle))
    assert {one.axis for rows in table.values() for one in rows} == {*vehicle.layout.bare_axes}
    for rows in table.values():
        speeds = [abs(one.velocity) for one in rows]
        assert speeds == sorted(speeds)
        assert rows[-1].command in vehicle.tested_along(rows[-1].axis)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ("--find surge=fast", "--find surge=fast: 'fast' must be a finite number, m/s"),
        ("--find sway=1", "the vehicle has no such axis, only surge, heave, yaw"),
        ("--find surge=1 --set u_l=0.3", "--set u_l: --find chooses commands and states itself"),
        ("--find surge=1 --set z=2", "--set z: --find chooses commands and states itself"),
        ("--find surge=1 --stop 3", "--find simulates nothing: leave --stop out"),
        ("--find surge=1 --input log.csv", "--find simulates nothing: leave --input out"),
    ],
)
def test_what_cannot_be_found_gives_one_line(arguments: str, reason: str, capsys: Capsys) -> None:
    assert main(["simulate", "videoray", *arguments.split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert reason in line


def test_the_command_prints_what_is_found(capsys: Capsys) -> None:
    assert main(["simulate", "bluerov2", "--find", "surge=1"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"^surge +1 m/s +0\.3158 +22\.21 N +86\.91 W$", said, re.MULTILINE)
    assert said.endswith("Next: rov-fmu simulate bluerov2 --set surge=0.3158\n")


def test_the_vehicles_that_ship_are_listed_with_their_descriptions(capsys: Capsys) -> None:
    assert main(["list"]) == 0
    said = capsys.readouterr().out
    for name in SHIPPED:
        assert re.search(rf"^{name} +{re.escape(rov_fmu.load(name).description)}$", said, re.MULTILINE)


@pytest.mark.parametrize("share", spread([0.5, 0.92, 1.0, 1.08, 2.0], [0.5, 1.0], [1.08]))
def test_another_top_speed_than_the_stated_one_is_told_where_it_is_flown(
    share: float, tmp_path: Path, capsys: Capsys
) -> None:
    rov = rov_fmu.load("videoray")
    reached = rov.response("surge", 1.0)[0]
    stated = StatedSpeed(value=share * reached, unit="m/s", source="the yard", measured=(0.3, 1.5))
    path = tmp_path / "own.toml"
    rov_fmu.write_vehicle(replace(rov, data=None, pictures=None, stated={"surge": stated}), path)
    assert rov_fmu.load(path).stated == {"surge": stated}, "as it was written"
    assert main(["fly", str(path), "-o", str(tmp_path / "fly.html")]) == 0
    words = f"At full command, surge forward reaches {reached:.2f} m/s, and the yard states {stated.value:g} m/s; "
    words += "its coefficients were measured between 0.3 and 1.5 m/s."
    is_told = not 0.9 <= share <= 1.1
    said = [
        capsys.readouterr().err,
        (tmp_path / "fly.html").read_text(encoding="utf-8"),
        card_text(rov_fmu.load(path)).replace("\n  ", " "),
    ]
    assert [words in one.replace("\xa0", " ") for one in said] == [is_told] * 3


@pytest.mark.parametrize(
    ("stated", "reason"),
    [
        (
            'sway = { value = 1.5, unit = "m/s", source = "x" }',
            "sway: the vehicle has no such axis, only heave",
        ),
        ('yaw = { value = 1.5, unit = "m/s", source = "x" }', "must have the speed of yaw in rad/s, and not in m/s"),
        (
            'ahead = { value = 1.5, unit = "m/s", source = "x" }',
            "must have speeds of surge, sway, heave",
        ),
        ('surge = { value = 0.0, unit = "m/s", source = "x" }', "surge.value = 0.0: must be"),
    ],
)
def test_a_stated_speed_that_cannot_be_gives_one_line(stated: str, reason: str, tmp_path: Path, capsys: Capsys) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f"{BARE.read_text(encoding='utf-8')}\n[validity.stated]\n{stated}\n", encoding="utf-8")
    assert main(["simulate", str(path), "--find", "surge=1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "validity.stated" in line
    assert reason in line
