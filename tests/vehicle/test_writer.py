"""A vehicle file is written whole, in its form, or not at all; tuning changes the given coefficients alone."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from rov_fmu.equation.parts import EVERY_COMMAND, Range
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle, read_vehicle
from rov_fmu.vehicle.writer import vehicle_text, write_tuned, write_vehicle
from tests.commands import REFIT
from tests.vehicles import EVERYTHING, SIX_AXES, VEHICLES, a_vehicle, bases, passed, tied

TEXT = REFIT.read_text(encoding="utf-8")


def test_a_file_that_was_made_is_written_as_it_stands() -> None:
    refit = replace(load_vehicle(REFIT), measured_from="tank tests")
    assert vehicle_text(refit, REFIT.parent) == TEXT


def test_ranges_and_alternatives_are_tables_with_headings(vehicle: Vehicle) -> None:
    layout = replace(vehicle.layout, identified=(Range(EVERY_COMMAND, 0.0, 0.7), Range("u", -0.5, 1.0)))
    text = vehicle_text(replace(vehicle, layout=layout), VIDEORAY.parent)
    assert '\n\n[validity.identified]\nu = { range = [-0.5, 1.0], unit = "m/s" }\n' in text
    assert "\n\n[alternatives.unweighted_rear_thrust]\n" in text


@pytest.mark.parametrize("source", [EVERYTHING, SIX_AXES, VIDEORAY], ids=lambda path: path.stem)
def test_tuning_changes_only_the_given_coefficients(source: Path, tmp_path: Path) -> None:
    before, path = load_vehicle(source), tmp_path / "tuned.toml"
    kept = float(before["alpha_w"])
    write_tuned(source, path, {"alpha_w": kept, "beta_w": 0.25, "a_d_w": 12.5}, "a test")
    after = load_vehicle(path)
    assert after.coefficients == {**before.coefficients, "beta_w": 0.25, "a_d_w": 12.5}
    assert after.sources == {**before.sources, "beta_w": "a test", "a_d_w": "a test"}
    assert (after.layout, after.alternatives, after.limits) == (before.layout, before.alternatives, before.limits)
    lines = [file.read_text(encoding="utf-8").splitlines() for file in (source, path)]
    new = [line for line in lines[1] if line not in lines[0] and not line.startswith("# rov-fmu wrote this file")]
    assert sum("a test" in line for line in new) == 2
    assert all("a test" in line or line.startswith(("data", "pictures", "name", "identifier")) for line in new)
    assert (after.name, after.identifier) == (f"{before.name}, tuned: tuned", "tuned")


def test_a_file_that_could_not_be_read_is_not_written(vehicle: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    path.write_text("before", encoding="utf-8")
    with pytest.raises(VehicleFileError) as caught:
        write_vehicle(replace(vehicle, coefficients={**vehicle.coefficients, "m_rov": -1.0}), path, force=True)
    assert re.fullmatch(rf"{re.escape(str(path))}: body\.m_rov\.value = -1\.0: .*", str(caught.value))
    assert path.read_text(encoding="utf-8") == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["kept.toml"]


def test_a_point_is_written_with_its_place_and_tuned_in_it(tmp_path: Path) -> None:
    """Its coordinates are coefficients, which share a key and a source in the file."""
    rov = tied(a_vehicle(VEHICLES["Heavy"]), hook=(0.2, -0.1, 0.4), tether=(-0.3, 0.0, -1.0 / 3.0))
    rov = replace(rov, basis=bases(dict.fromkeys(rov.coefficients, "A tank test")))
    write_vehicle(rov, tmp_path / "rov.toml")
    assert load_vehicle(tmp_path / "rov.toml") == rov
    write_tuned(tmp_path / "rov.toml", tmp_path / "moved.toml", {"r_y_hook": 0.25}, "a test")
    moved = load_vehicle(tmp_path / "moved.toml")
    assert {name: x for name, x in moved.coefficients.items() if x != rov[name]} == {"r_y_hook": 0.25}
    assert {name for name, source in moved.sources.items() if source == "a test"} == {f"r_{x}_hook" for x in "xyz"}


def test_what_a_current_does_is_written_and_read(vehicle: Vehicle) -> None:
    path = VIDEORAY.with_name("passed.toml")
    text = vehicle_text(passed(vehicle), VIDEORAY.parent)
    assert '\nformat = 2\ncurrent = "passes"\n' in f"\n{text}"
    again = read_vehicle(path, text.encode())
    assert again.layout == passed(vehicle).layout
    with pytest.raises(VehicleFileError, match=r"current = 'past': must be 'carries' or 'passes'"):
        read_vehicle(path, text.replace('"passes"', '"past"').encode())
