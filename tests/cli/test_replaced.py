"""Files that a command replaces: unchanged files that rov-fmu wrote, and all others only with --force."""

import shutil
import zipfile
from collections.abc import Sequence
from pathlib import Path

import click
import pytest

from rov_fmu.build import build
from rov_fmu.cli import _commands, main
from rov_fmu.identify import identify as identification
from rov_fmu.io.output import Output, WriteError, check_replaced, sealed, write_whole
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, COMMANDS, WRITING, without_progress
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
    ("own", "reason"),
    [
        (b"", "has changed since rov-fmu wrote it"),
        (b"\xff my notes", "is not as rov-fmu wrote it: it may have been made or changed by hand"),
        (b"%s\xff damaged", "is not UTF-8 text, at byte {}"),
    ],
)
def test_the_work_of_others_is_refused_before_anything_is_computed(
    name: str,
    own: bytes,
    reason: str,
    tank_tests: Path,
    folder: Path,
    capsys: Capsys,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An empty text stands for the file with a change, and %s for its first line."""
    if own:
        own = own.replace(b"%s", (folder / name).read_bytes().splitlines(keepends=True)[0])
        (folder / name).write_bytes(own)
    else:
        own = _edited(folder / name)
    monkeypatch.setattr(identification, "identify", lambda *_: pytest.fail("it is computed before it is refused"))
    monkeypatch.setattr("rov_fmu.tank.folder.read_rows", lambda *_: pytest.fail("tests are read before it is refused"))
    capsys.readouterr()
    assert _identify(tank_tests, folder) == 2
    out, err = capsys.readouterr()
    assert out == ""
    reason = reason.format(own.find(b"\xff"))
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
        f"{folder / 'rov.toml'}: replaced a file that has changed since rov-fmu wrote it",
        f"{folder / 'r.html'}: replaced a file that is not as rov-fmu wrote it: it may have been made or changed by "
        "hand",
    ]
    assert [path.read_bytes() for path in sorted(folder.iterdir())] == [p.read_bytes() for p in sorted(made.iterdir())]


def _check(paths: Sequence[Path]) -> list[str]:
    return check_replaced(paths, force=False)


def test_a_seal_outlasts_another_form_of_line_breaks_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "some.toml"
    assert _check([path]) == []
    text = sealed("a = 1\nb = 2\n", "# {}", "identify")
    for whole in (text, text.replace("\n", "\r\n"), f"\ufeff{text}"):
        path.write_bytes(whole.encode())
        assert _check([path]) == [f"{path}: replaced the result of an earlier run"]
    for other in (text + "\n", text.replace("a", "c", 1), text.partition("\n")[2], f"\n{text}", "", text[:40]):
        path.write_bytes(other.encode())
        with pytest.raises(WriteError):
            _check([path])


# ---- Every command ---------------------------------------------------------------------------------------------------

READING = {
    *{("build", "sign"), ("simulate", "commands"), ("fly", "recording"), ("fly", "identified")},
    *{("prove", "fmu"), ("prove", "key"), ("study", "plan"), ("tune", "points")},
    *{("identify", "tests"), ("inspect", "tests")},
}
"""The arguments and options that name a file to read."""
AGAIN = [key for key in COMMANDS if key[0] in ("simulate", "fly", "sdf", "export", "tune")]
"""What is quick enough to be written several times."""


def test_every_file_that_a_command_writes_is_known_here() -> None:
    named = {
        (name, parameter.name)
        for name, command in _commands.commands.items()
        for parameter in command.params
        if isinstance(parameter.type, click.Path)
    }
    assert named - READING == WRITING.keys() - {("build", "osp"), ("export", "folder"), ("study", "run")}
    assert {name for name, command in _commands.commands.items() for p in command.params if p.name == "force"} == {
        name for name, _ in WRITING
    }


@pytest.mark.parametrize("key", WRITING, ids=" ".join)
def test_no_command_replaces_the_work_of_others(
    key: tuple[str, str], videoray_fmu: Path, tmp_path: Path, capsys: Capsys
) -> None:
    command = WRITING[key]
    (tmp_path / "plan.toml").write_text(f'vehicle = "{BARE.name}"\nstop_time = 1.0\n', encoding="utf-8")
    shutil.copy(BARE, tmp_path)
    target = tmp_path / command.name
    target.write_bytes(b"my work")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert main(command.arguments(target, fmu=str(videoray_fmu))) == 2
    out, err = capsys.readouterr()
    assert (out, without_progress(err).count("\n")) == ("", 1)
    assert str(target) in err
    assert "--force" in err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("key", AGAIN, ids=" ".join)
def test_a_command_replaces_its_own_file_until_somebody_changes_it(
    key: tuple[str, str], tmp_path: Path, capsys: Capsys
) -> None:
    target = tmp_path / COMMANDS[key].name
    words = COMMANDS[key].arguments(target)
    assert [main(words), main(words)] == [0, 0]
    with target.open("ab") as file:
        file.write(b"\n")
    assert main(words) == 2
    assert "wrote it" in capsys.readouterr().err
    assert main([*words, "--force"]) == 0


def test_an_fmu_proves_itself_on_any_machine(
    videoray_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where there is no list of what was written, its hashes tell."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "elsewhere"))
    monkeypatch.setattr("rov_fmu.build.compile_all", lambda *_: pytest.fail("it is not refused"))
    whole, vehicle = videoray_fmu.read_bytes(), load_vehicle(BARE)
    path = tmp_path / "rov.fmu"
    path.write_bytes(whole)
    with pytest.raises(pytest.fail.Exception):
        build(vehicle, path, platforms="host")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("extra/notes.txt", "my notes")
    changed = path.read_bytes()
    for content in (changed, whole + b"x", b"x" + whole, whole[:-1000], b"PK\x03\x04"):
        path.write_bytes(content)
        with pytest.raises(WriteError, match="--force"):
            build(vehicle, path, platforms="host")


def test_what_is_written_is_listed_and_the_list_stays_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr("rov_fmu.io.output._LARGEST_LIST", 65 * 20)
    path = tmp_path / "some.csv"
    for n in range(45):
        write_whole(Output(path, b"%d" % n))
    (listed,) = (tmp_path / "state").rglob("written")
    assert 65 * 10 <= listed.stat().st_size <= 65 * 22
    path.write_bytes(b"my work")
    with pytest.raises(WriteError):
        write_whole(Output(path, b"new"))
    path.write_bytes(b"43")
    write_whole(Output(path, b"new"))
    listed.unlink()
    with pytest.raises(WriteError):
        write_whole(Output(path, b"newer"))


def test_where_nothing_can_be_listed_files_are_written_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "state").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    path = tmp_path / "some.csv"
    with pytest.warns(UserWarning, match="the list of the files that rov-fmu wrote cannot be written, so that"):
        write_whole(Output(path, b"1"))
    with pytest.raises(WriteError):
        write_whole(Output(path, b"2"))
    with pytest.warns(UserWarning, match="will need --force: Not a directory"):
        write_whole(Output(path, b"2"), force=True)
    assert path.read_bytes() == b"2"
