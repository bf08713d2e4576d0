"""Vehicle files with intervals and provenance: written whole or not at all, read back as they were."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import vehicle_text, write_vehicle
from tests.commands import ALONE, REFIT, TESTS

TEXT = REFIT.read_text(encoding="utf-8")
HASH = "0123456789abcdef" * 4


def test_everything_reads_back(vehicle: Vehicle, tmp_path: Path) -> None:
    made = replace(
        vehicle,
        name='ROV "Döv" \\ 1',
        data=None,
        pictures=None,
        alternatives={},
        intervals={"m_rov": (6.5, 6.6), "b_d_w": (0.0, 1.25)},
        provenance=Provenance("tool", "heave: a\nyaw: b", {"log heave.csv": HASH, "ä.csv": HASH}, ("a warning", "b")),
    )
    path = tmp_path / "made.toml"
    write_vehicle(made, path)
    assert load_vehicle(path) == made
    assert vehicle_text(made) == path.read_text(encoding="utf-8")
    assert [p.name for p in tmp_path.iterdir()] == ["made.toml"]


def test_without_provenance_there_is_none(vehicle: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "plain.toml"
    write_vehicle(vehicle, path)
    read = load_vehicle(path)
    assert (read.provenance, read.intervals) == (None, {})
    assert "provenance" not in path.read_text(encoding="utf-8")


def test_interval_encloses_a_rounded_value(vehicle: Vehicle, tmp_path: Path) -> None:
    k = replace(vehicle.coefficients, a_d_w=18.72000049, b_d_w=0.63240051)
    narrow = {"a_d_w": (18.72000048, 18.7200005), "b_d_w": (0.6324005, 0.6324006)}
    write_vehicle(replace(vehicle, coefficients=k, intervals=narrow), tmp_path / "narrow.toml")
    read = load_vehicle(tmp_path / "narrow.toml")
    for name, (low, high) in read.intervals.items():
        assert low <= getattr(read.coefficients, name) <= high


def test_a_file_that_could_not_be_read_is_not_written(vehicle: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    path.write_text("before", encoding="utf-8")
    with pytest.raises(VehicleFileError) as caught:
        write_vehicle(replace(vehicle, coefficients=replace(vehicle.coefficients, m_rov=-1.0)), path)
    assert re.fullmatch(rf"{re.escape(str(path))}: coefficients\.m_rov\.value = -1\.0: .*", str(caught.value))
    assert path.read_text(encoding="utf-8") == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["kept.toml"]


@pytest.mark.parametrize("name", ["nowhere/out.toml", "."])
def test_nowhere_to_write(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", str(TESTS), "-o", str(tmp_path / name)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert str(tmp_path) in err
    assert "folder" in err
    assert not any(tmp_path.iterdir())


def edit(pattern: str, replacement: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        changed, count = re.subn(pattern, lambda _: replacement, text, count=1, flags=re.M)
        assert count == 1
        return changed

    return change


BAD: dict[str, tuple[Callable[[str], str], tuple[str, ...]]] = {
    "value outside": (edit(r"interval = \[4\.", "interval = [14."), ("coefficients.a_d_u", "[low, high] around")),
    "upside down": (edit(r"interval = \[[^]]*\]", "interval = [9.0, 8.0]"), ("coefficients.a_d_u", "around the value")),
    "three numbers": (edit(r"interval = \[", "interval = [1.0, "), ("coefficients.a_d_u.interval", "2")),
    "no number": (edit(r"interval = \[[^]]*\]", 'interval = "wide"'), ("coefficients.a_d_u.interval", "'wide'")),
    "infinite": (edit(r"interval = \[[^]]*\]", "interval = [0.0, inf]"), ("coefficients.a_d_u.interval", "finite")),
    "no hash": (edit(r'^"rov.toml" = ".*"', '"rov.toml" = "abc"'), ("provenance.inputs.rov.toml", "'abc'")),
    "no method": (edit(r"^method = .*$", ""), ("provenance.method", "missing")),
    "unknown key": (edit(r"^method = ", "author = 'me'\nmethod = "), ("provenance.author", "no such key")),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_file_is_one_clear_line(case: str, tmp_path: Path) -> None:
    change, named = BAD[case]
    path = tmp_path / "bad.toml"
    path.write_text(change(TEXT), encoding="utf-8")
    with pytest.raises(VehicleFileError) as caught:
        load_vehicle(path)
    assert len(str(caught.value).splitlines()) == 1
    for word in (str(path), *named):
        assert word in str(caught.value)


def test_an_interval_may_stand_in_any_vehicle_file(tmp_path: Path) -> None:
    path = tmp_path / "with.toml"
    text = ALONE
    path.write_text(text.replace('6.57, unit = "kg"', '6.57, unit = "kg", interval = [6.5, 6.7]'), encoding="utf-8")
    assert load_vehicle(path).intervals == {"m_rov": (6.5, 6.7)}
