"""Names in files lead to places inside the folder of the file; any other name is refused in one line."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.io.paths import MODELS, inside_or_shipped, name_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ALONE, BARE, TESTS, Capsys

NOT_RELATIVE = "must be a relative path with / between its parts"
OUTSIDE = "must lead to a place inside the folder of this file"
# Names that a file must not contain, as TOML writes them, and the message about each. The folder above the file has the
# files `secret` and `secrets/model.png`; `link` and `links` beside the file lead to these.
WRONG = {
    "absolute": ("/etc/passwd", NOT_RELATIVE),
    "above": ("../secret", OUTSIDE),
    "above, by a folder inside": ("tables/../../secret", OUTSIDE),
    "a link": ("link", OUTSIDE),
    "inside a linked folder": ("links/model.png", OUTSIDE),
    "a drive": ("C:/secret", NOT_RELATIVE),
    "on a drive": ("c:secret", NOT_RELATIVE),
    "a share": ("//host/share/secret", NOT_RELATIVE),
    "backslashes": ("..\\\\secret", NOT_RELATIVE),
    "a share with backslashes": ("\\\\\\\\host\\\\share", NOT_RELATIVE),
    "a NUL": ("secret\\u0000", NOT_RELATIVE),
    "nothing": ("", NOT_RELATIVE),
}
OF_ANY_TEXT = {"a NUL": "must be without the control character", "nothing": "must have at least 1 character"}
"""The messages about these names for a key that must be a valid text first."""


def _vehicle(folder: Path, old: str, new: str) -> list[str]:
    path = folder / "rov.toml"
    refit = SHIPPED["videoray_refit"].read_text(encoding="utf-8")
    assert old in refit
    path.write_text(refit.replace(old, new, 1), encoding="utf-8")
    return ["build", str(path), "--platform", "host", "-o", str(folder / "out.fmu")]


def _tests(folder: Path, new: str) -> list[str]:
    shutil.copytree(TESTS, folder, dirs_exist_ok=True)
    path = folder / "rov.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("[vehicle]", f"{new}\n[vehicle]", 1), encoding="utf-8")
    return ["identify", str(folder), "-o", str(folder / "out.toml")]


# For each key, a function that writes a file with a value and returns the command that reads it. The keys of a plan are
# tested in tests/study/test_plans.py.
KEYS: dict[str, Callable[[Path, str], list[str]]] = {
    "provenance.report": lambda f, n: _vehicle(f, "\n[provenance]", f'\n[provenance]\nreport = "{n}"'),
    "vehicle.data": lambda f, n: _vehicle(f, "\n[validity]", f'data = "{n}"\n[validity]'),
    "vehicle.pictures": lambda f, n: _vehicle(f, "\n[validity]", f'pictures = "{n}"\n[validity]'),
    "base": lambda f, n: _tests(f, f'base = "{n}"'),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder of a file, with links that lead out of it."""
    folder = tmp_path / "here"
    (folder / "tables").mkdir(parents=True)
    (tmp_path / "secrets").mkdir()
    (tmp_path / "secrets" / "model.png").write_bytes(b"a secret")
    (tmp_path / "secret").write_text(BARE.read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "link").symlink_to(tmp_path / "secret")
    (folder / "links").symlink_to(tmp_path / "secrets", target_is_directory=True)
    return folder


def _check_refused(arguments: list[str], message: str, capsys: Capsys) -> str:
    """Check that a command prints one line with the message and writes nothing; return the line."""
    assert main(arguments) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert message in line
    assert not Path(arguments[-1]).exists()
    return line


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("case", WRONG)
def test_a_name_that_does_not_stay_in_the_folder_is_refused(key: str, case: str, folder: Path, capsys: Capsys) -> None:
    name, message = WRONG[case]
    arguments = KEYS[key](folder, name)
    if key == "provenance.report":
        message = OF_ANY_TEXT.get(case, message)
    assert _check_refused(arguments, message, capsys).startswith(f"rov-fmu: {folder / 'rov.toml'}: {key} = ")


@pytest.mark.parametrize(("key", "file"), [("pictures", "model.png"), ("data", "table7_yaw_response.csv")])
def test_a_link_inside_a_folder_that_leads_out_of_it_is_refused(
    key: str, file: str, folder: Path, capsys: Capsys
) -> None:
    (folder / "own").mkdir()
    (folder / "own" / file).symlink_to(folder.parent / "secret")
    message = f"vehicle.{key} = 'own': its file {file} {OUTSIDE}, after links are followed"
    _check_refused(KEYS[f"vehicle.{key}"](folder, "own"), message, capsys)


def test_a_link_that_stays_in_the_folder_is_followed(folder: Path) -> None:
    (folder / "kept").mkdir()
    (folder / "kept" / "page.html").write_text("the report", encoding="utf-8")
    (folder / "report.html").symlink_to(Path("kept", "page.html"))
    KEYS["provenance.report"](folder, "tables/../report.html")
    (report,) = (path for path in load_vehicle(folder / "rov.toml").files if path.suffix == ".html")
    assert report.read_text(encoding="utf-8") == "the report"


def test_tables_are_searched_in_the_folder_and_then_among_the_shipped_ones(folder: Path) -> None:
    vehicle, own = folder / "own.toml", folder / "videoray" / "tables"
    text = ALONE.replace("[validity]", 'data = "videoray/tables"\npictures = "videoray/pictures"\n[validity]', 1)
    vehicle.write_text(text, encoding="utf-8")
    loaded = load_vehicle(vehicle)
    assert (loaded.data, loaded.pictures) == (MODELS / "videoray" / "tables", MODELS / "videoray" / "pictures")
    own.mkdir(parents=True)
    assert load_vehicle(vehicle).data == own
    with pytest.raises(ValueError, match=OUTSIDE):
        inside_or_shipped(folder, "../models/videoray")


def test_the_name_of_a_place_leads_back_to_it(folder: Path) -> None:
    for path, name in ((folder / "tables" / "a.csv", "tables/a.csv"), (MODELS / "videoray", "videoray")):
        assert name_of(path, folder) == name
        assert inside_or_shipped(folder, name) == path
    with pytest.raises(ValueError, match=r"secret is not inside the folder of this file$"):
        name_of(folder.parent / "secret", folder)
