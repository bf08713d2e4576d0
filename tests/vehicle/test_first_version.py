"""The first version of the vehicle file: still read, and converted to the form of today with its comments."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.vehicle.paper import PAPER
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle

FIRST = Path(__file__).with_name("first_version.toml")
TEXT = FIRST.read_text(encoding="utf-8")
COEFFICIENTS = TEXT[TEXT.index("[coefficients]") : TEXT.index("# Thrust curve")]


def test_it_is_the_same_vehicle(vehicle: Vehicle) -> None:
    first = load_vehicle(FIRST)
    assert first.layout == PAPER
    assert first == replace(vehicle, data=None, pictures=None, thruster_sources=first.thruster_sources)


# What is done to the file, and all that the one line must name: key, value, what is allowed.
BAD_FILES: dict[str, tuple[Callable[[str], str], tuple[str, ...]]] = {
    "missing coefficient": (lambda text: re.sub("m_rov = .*", "", text), ("coefficients.m_rov", "missing")),
    "unknown coefficient": (
        lambda text: text.replace("R = {", "radius = {", 1),
        ("coefficients.radius", "no such key"),
    ),
    "missing section": (lambda text: text.replace(COEFFICIENTS, ""), ("format: this key is missing",)),
    "thrust of the wrong sign": (
        lambda text: text.replace("a_t_top = { value = ", "a_t_top = { value = -"),
        ("coefficients: must give a force above 0 at full command, but a_t_top and b_t_top give -6.4427 N",),
    ),
    "negative mass": (lambda text: text.replace("6.57", "-6.57"), ("coefficients.m_rov.value", "-6.57", "0.001")),
    "wrong unit": (lambda text: text.replace('"kg"', '"lb"'), ("coefficients.m_rov.unit", "'lb'", "'kg'")),
    "a table of today": (lambda text: text + "\n[axes]\n", ("axes", "no such key")),
    "unknown alternative": (
        lambda text: text.replace("a_t_rear = { value = 100.3", "a_t_side = { value = 100.3"),
        ("alternatives.unweighted_rear_thrust.a_t_side", "no such key"),
    ),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_file_is_one_clear_line_a_mistake(case: str, tmp_path: Path) -> None:
    change, named = BAD_FILES[case]
    path = tmp_path / "bad.toml"
    path.write_text(change(TEXT), encoding="utf-8")
    with pytest.raises(VehicleFileError) as caught:
        load_vehicle(path)
    (line,) = [line for line in str(caught.value).splitlines() if "coefficients.R" not in line]
    for word in (str(path), *named):
        assert word in line


# ---- Conversion ------------------------------------------------------------------------------------------------------

_INLINE = ", ".join(re.findall(r"^\w+ = {.*}", COEFFICIENTS, re.M))
_AS_TABLES = re.sub(r"^(\w+) = { (value = \S+), (unit = \S+), (source = .*) }", r"[coefficients.\1]\n\2\n\3\n\4",
                    COEFFICIENTS.removeprefix("[coefficients]"), flags=re.M)  # fmt: skip
ARRANGED = {
    "as it is": TEXT,
    "coefficients inline": f"coefficients = {{ {_INLINE} }}\n" + TEXT.replace(COEFFICIENTS, ""),
    "coefficients as tables": TEXT.replace(COEFFICIENTS, _AS_TABLES),
    "coefficients first": COEFFICIENTS + TEXT.replace(COEFFICIENTS, ""),
    "coefficients last": TEXT.replace(COEFFICIENTS, "") + "\n" + COEFFICIENTS,
    "no blank lines": re.sub(r"\n+", "\n", TEXT),
    "lines of Windows": TEXT.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("case", ARRANGED)
def test_a_converted_file_is_the_same_vehicle(case: str, tmp_path: Path) -> None:
    old, new = tmp_path / "old.toml", tmp_path / "new.toml"
    old.write_bytes(ARRANGED[case].encode())
    assert main(["convert", str(old), "-o", str(new)]) == 0
    assert new.read_bytes().count(b"format = 2") == 1
    assert b"[coefficients" not in new.read_bytes()
    assert load_vehicle(new) == load_vehicle(old) == load_vehicle(FIRST)


def test_a_converted_file_reads_as_the_one_that_ships(tmp_path: Path) -> None:
    """Words, comments and places of all that both have."""
    assert main(["convert", str(FIRST), "-o", str(tmp_path / "new.toml")]) == 0
    sources = re.compile(r"^(direction = .*|data = .*|pictures = .*)\n", re.M)
    converted, shipped = ((sources.sub("", p.read_text(encoding="utf-8"))) for p in (tmp_path / "new.toml", VIDEORAY))
    assert converted == shipped
    assert "{value" not in (tmp_path / "new.toml").read_text(encoding="utf-8")


def test_comments_go_with_their_coefficients(tmp_path: Path) -> None:
    old, new = tmp_path / "old.toml", tmp_path / "new.toml"
    text = TEXT.replace("R = {", "# The arm,\n# measured.\nR = {").replace(
        '"Table 9, (10)" }\n\n', '"Table 9, (10)" }  # top\n\n'
    )
    old.write_text(text, encoding="utf-8")
    assert main(["convert", str(old), "-o", str(new)]) == 0
    converted = new.read_text(encoding="utf-8")
    assert "[arm]\n# The arm,\n# measured.\nR = {" in converted
    assert re.search(r"^b_t = .* # top\n\n\[\[thruster\]\]", converted, re.M)


def test_folders_beside_it_are_named_from_its_new_place(tmp_path: Path) -> None:
    old, new = tmp_path / "deeper" / "old.toml", tmp_path / "new.toml"
    (tmp_path / "deeper" / "tables").mkdir(parents=True)
    old.write_text(TEXT.replace("[validity]", 'data = "tables"\n[validity]', 1), encoding="utf-8")
    assert main(["convert", str(old), "-o", str(new)]) == 0
    assert 'data = "deeper/tables"' in new.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (re.sub(r"^(\w+ = {)", r"coefficients.\1", COEFFICIENTS.removeprefix("[coefficients]"), flags=re.M)
         + TEXT.replace(COEFFICIENTS, ""), "coefficients: must be one table [coefficients] to be converted"),
        (TEXT.replace("6.57", "-1"), "coefficients.m_rov.value = -1: must be within"),
    ],
)  # fmt: skip
def test_what_cannot_be_converted(text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = tmp_path / "old.toml"
    old.write_text(text, encoding="utf-8")
    assert main(["convert", str(old), "-o", str(tmp_path / "new.toml")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert f"{old}: {words}" in err
    assert [*tmp_path.iterdir()] == [old]


def test_a_file_of_today_needs_no_conversion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", "videoray", "-o", str(tmp_path / "new.toml")]) == 2
    assert "videoray.toml: format = 2: needs no conversion" in capsys.readouterr().err
