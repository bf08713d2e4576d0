"""Files that `identify` replaces: unchanged files that it wrote itself, and all others only with --force."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.identify import identify as identification
from rov_fmu.io.output import WriteError, check_replaced, sealed
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import without_progress
from tests.folders import small_folder

Capsys = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def tank_tests(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small folder of tank tests."""
    return small_folder(tmp_path_factory.mktemp("tests"))


@pytest.fixture(scope="module")
def made(tank_tests: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the command writes."""
    folder = tmp_path_factory.mktemp("made")
    assert _identify(tank_tests, folder) == 0
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of the folder that a test may change."""
    return Path(shutil.copytree(made, tmp_path / "copy"))


def _identify(tank_tests: Path, folder: Path, *options: str) -> int:
    return main(
        ["identify", str(tank_tests), "-o", str(folder / "rov.toml"), "--report", str(folder / "r.html"), *options]
    )


def _edited(path: Path) -> bytes:
    """Change a file as somebody would by hand, and return its new content."""
    changed = path.read_bytes().replace(b"Mine", b"My own", 1)
    path.write_bytes(changed)
    return changed


def test_unchanged_files_are_replaced_and_reported(tank_tests: Path, folder: Path, capsys: Capsys) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    capsys.readouterr()
    assert _identify(tank_tests, folder) == 0
    out, err = capsys.readouterr()
    assert without_progress(err) == ""
    assert out.splitlines()[:2] == [
        f"{folder / name}: replaced the result of an earlier run" for name in ("rov.toml", "r.html")
    ]
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert load_vehicle(folder / "rov.toml").provenance


@pytest.mark.parametrize("name", ["rov.toml", "r.html"])
@pytest.mark.parametrize(
    ("made_by_hand", "reason"),
    [
        (False, "has changed since identify wrote it"),
        (True, "does not begin with a digest by identify, so it may have been made by hand"),
    ],
)
def test_the_work_of_others_is_refused_before_anything_is_computed(
    name: str,
    made_by_hand: bool,
    reason: str,
    tank_tests: Path,
    folder: Path,
    capsys: Capsys,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if made_by_hand:
        own = b"\xff my notes"
        (folder / name).write_bytes(own)
    else:
        own = _edited(folder / name)
    monkeypatch.setattr(identification, "identify", lambda *_: pytest.fail("it is computed before it is refused"))
    monkeypatch.setattr("rov_fmu.tank.folder.read_rows", lambda *_: pytest.fail("tests are read before it is refused"))
    capsys.readouterr()
    assert _identify(tank_tests, folder) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"rov-fmu: {folder / name}: cannot be written: the file there {reason}; --force replaces it\n"
    assert (folder / name).read_bytes() == own
    assert len([*folder.iterdir()]) == 2


def test_force_replaces_the_work_of_others_and_reports_it(
    tank_tests: Path, made: Path, folder: Path, capsys: Capsys
) -> None:
    _edited(folder / "rov.toml")
    (folder / "r.html").write_text("my notes", encoding="utf-8")
    capsys.readouterr()
    assert _identify(tank_tests, folder, "--force") == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        f"{folder / 'rov.toml'}: replaced a file that has changed since identify wrote it",
        f"{folder / 'r.html'}: replaced a file that does not begin with a digest by identify, so it may have been "
        "made by hand",
    ]
    assert [path.read_bytes() for path in sorted(folder.iterdir())] == [p.read_bytes() for p in sorted(made.iterdir())]


def _check(paths: Sequence[Path]) -> list[str]:
    return check_replaced(paths, force=False)


def test_a_seal_outlasts_another_form_of_line_breaks_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "some.toml"
    assert _check([path]) == []
    text = sealed("a = 1\nb = 2\n", "# {}")
    for whole in (text, text.replace("\n", "\r\n"), f"\ufeff{text}"):
        path.write_bytes(whole.encode())
        assert _check([path]) == [f"{path}: replaced the result of an earlier run"]
    for other in (text + "\n", text.replace("a", "c", 1), text.partition("\n")[2], f"\n{text}", "", text[:40]):
        path.write_bytes(other.encode())
        with pytest.raises(WriteError):
            _check([path])
