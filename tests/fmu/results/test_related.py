"""The origin in an FMU: the vehicle file with its tables."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import rov_fmu
from rov_fmu.fmu.archive import FOLDER
from rov_fmu.fmu.related import origin
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import write_tuned, write_vehicle
from tests.commands import BARE
from tests.vehicles import THRUST_EFFECTS

_REFIT = SHIPPED["videoray_refit"]


# ---- The files and their roles ---------------------------------------------------------------------------------------


def test_a_vehicle_can_be_read_from_its_fmu(tmp_path: Path) -> None:
    """Its file is that of the user with its table of thrust, or is written anew if coefficients have changed."""
    source, name = SHIPPED["bluerov2_heavy"], f"{FOLDER}/vehicle/bluerov2_heavy.toml"
    for vehicle in (load_vehicle(source), load_vehicle(source).with_(a_d_u=150.0)):
        files, related = origin(vehicle)
        assert {f"{FOLDER}/{one.source}" for one in related} == files.keys()
        for path, content in files.items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_bytes(content)
        assert load_vehicle(tmp_path / name) == vehicle
        assert (files[name] == source.read_bytes()) == (vehicle["a_d_u"] != 150.0)
    assert origin(replace(vehicle, file=None)) == ({}, []), "of a vehicle that was made in Python there is no file"


def _shipped(name: str) -> Callable[[Path], Path]:
    return lambda _: SHIPPED[name]


def _tuned(folder: Path) -> Path:
    write_tuned(_REFIT, path := folder / "tuned.toml", {"alpha_u": 1.0 / 3.0}, "Tuned to V_ss = 0.5 at 30%")
    return path


def _by_hand(folder: Path) -> Path:
    """Written by the package, with a number of many digits."""
    write_vehicle(replace(load_vehicle(_REFIT).with_(a_d_u=100.0 / 7.0)), path := folder / "by_hand.toml")
    return path


VEHICLE_FILES = {**{name: _shipped(name) for name in SHIPPED}, "tuned": _tuned, "by hand": _by_hand}


@pytest.mark.parametrize("kind", VEHICLE_FILES)
def test_both_interfaces_put_the_bytes_of_the_users_file_into_the_fmu(kind: str, tmp_path: Path) -> None:
    path = VEHICLE_FILES[kind](tmp_path)
    one, other = load_vehicle(path), rov_fmu.load(path)
    assert one == other
    assert origin(one) == origin(other)
    assert path.read_bytes() in origin(one)[0].values()
    assert origin(one.with_(m_rov=9.87654321)) == origin(other.with_(m_rov=9.87654321)) != origin(one)
    name = f"{FOLDER}/vehicle/{one.identifier}.toml"
    for changed in (one.with_(m_rov=9.87654321), replace(one, version="2"), replace(one, limits=("It leaks.",))):
        written = changed.file_content or origin(changed)[0][name]
        assert written != path.read_bytes()
        assert b"9.87654321" in written or changed["m_rov"] == one["m_rov"]
    assert origin(replace(one.with_(m_rov=9.0), coefficients=one.coefficients, basis=one.basis)) == origin(one)


def test_a_file_that_changes_while_its_vehicle_is_in_use_does_not_change_the_vehicle(tmp_path: Path) -> None:
    path = tmp_path / "rov.toml"
    path.write_bytes(BARE.read_bytes())
    vehicle = load_vehicle(path)
    path.write_text("something else", encoding="utf-8")
    assert BARE.read_bytes() in origin(vehicle)[0].values()


ROLES = """
bluerov2_heavy.toml: model application/toml The vehicle file
t200_current_16_v.csv: model text/csv Measured electric current, curve t200
thrust_effects.toml: model application/toml The vehicle file
thrust_12_v.csv: model text/csv Measured thrust, curve main
thrust_16_v.csv: model text/csv Measured thrust, curve main
thrust_16_v.csv: model text/csv Measured thrust, curve bow
videoray_refit.toml: model application/toml The vehicle file
"""


def test_each_file_has_its_role_and_its_description() -> None:
    vehicles = (SHIPPED["bluerov2_heavy"], THRUST_EFFECTS, _REFIT)
    found = [one for path in vehicles for one in origin(load_vehicle(path))[1]]
    told = [f"{one.source.rpartition('/')[2]}: {one.role} {one.type} {one.description}" for one in found]
    assert told == ROLES.strip().splitlines()
