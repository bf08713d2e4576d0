"""Files that a command replaces: unchanged files that rov-fmu wrote, and all others only with --force."""

import re
import shutil
import zipfile
from pathlib import Path

import pytest

from rov_fmu.build import build_fmu
from rov_fmu.cli import _commands, main
from rov_fmu.io.output import Output, WriteError, check_targets, sealed, write_whole
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, FILES, READING, WRITING, Capsys, without_progress
from tests.conftest import without_page
from tests.often import spread

FOREIGN = "has no mark of rov-fmu: it may have been made or changed by hand"
CHANGED = "has changed since rov-fmu wrote it"


def _check(path: Path) -> str:
    """Return what would be replaced."""
    return check_targets([(path, "")], force=False)[path]


@pytest.mark.parametrize("begins", ["", "<a/>", '<?xml version="1.0"?>\n<a/>'])
def test_a_seal_outlasts_another_form_of_line_breaks_and_nothing_else(begins: str, tmp_path: Path) -> None:
    path = tmp_path / "some.toml"
    assert _check(path) == ""
    text = sealed(begins + "a = 1\nb = 2\n", "identify")
    for whole in (text, text.replace("\n", "\r\n"), f"\ufeff{text}"):
        path.write_bytes(whole.encode())
        assert _check(path) == "the result of an earlier run"
    ours = text.encode()
    for other, reason in (
        (ours + b"\n", CHANGED),
        (ours.replace(b"a = 1", b"c = 1"), CHANGED),
        (ours.replace(b"a = 1", b"\xff"), f"is not UTF-8 text, at byte {ours.index(b'a = 1')}"),
        *((other, FOREIGN) for other in (_unsealed(ours), b"\n" + ours, b"", ours[:40], b"\xff")),
    ):
        path.write_bytes(other)
        with pytest.raises(WriteError, match=f"the file there {reason}; --force replaces it"):
            _check(path)


def _unsealed(ours: bytes) -> bytes:
    return b"".join(line for line in ours.splitlines(keepends=True) if b"SHA-256" not in line)


def test_a_table_is_known_by_its_place_and_its_content(tmp_path: Path) -> None:
    path, other = tmp_path / "a.csv", tmp_path / "b.csv"
    for content in (b"t\n0\n", b"t\n1\n"):
        write_whole(Output(path, content))
        assert _check(path) == "the result of an earlier run"
    other.write_bytes(b"t\n1\n")
    path.write_bytes(b"t\n2\n")
    for foreign in (path, other):
        with pytest.raises(WriteError, match=FOREIGN):
            _check(foreign)


def test_the_list_of_what_was_written_forgets_the_oldest_half(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: tmp_path / "cache")
    monkeypatch.setattr("rov_fmu.io.output._LONGEST_LIST", 65 * 9)
    paths = [tmp_path / f"{n}.csv" for n in range(11)]
    for path in paths:
        write_whole(Output(path, b"x"))
    for path in paths[:5]:
        with pytest.raises(WriteError, match=FOREIGN):
            _check(path)
    assert {*map(_check, paths[5:])} == {"the result of an earlier run"}


# ---- Every command ---------------------------------------------------------------------------------------------------

_WORK = (
    "rov_fmu.tank.folder.read_rows",
    "rov_fmu.interface.identify_command.identify",
    "rov_fmu.identify.inspection.inspected.inspect_paths",
    "rov_fmu.interface.fly_command.fly_page",
    "rov_fmu.interface.simulate_command.simulation_of",
    "rov_fmu.interface.tune_command.tune",
    "rov_fmu.study.study_command.do_study",
    "rov_fmu.build.compile_all",
)
_SLOW = ("build", "study", "identify", "inspect")
_OFTEN = (("study", "output"), ("identify", "output"))


def test_every_file_that_a_command_reads_or_writes_is_known_here() -> None:
    assert WRITING.keys() - {("export", "folder")} == FILES.keys() - READING.keys()
    assert {name for name, command in _commands.commands.items() for p in command.params if p.name == "force"} == {
        name for name, _ in WRITING
    }


@pytest.mark.parametrize("key", WRITING, ids=" ".join)
def test_no_command_replaces_the_work_of_others(
    key: tuple[str, str], videoray_fmu: Path, tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is refused before tests are read and before anything is computed."""
    for work in _WORK:
        monkeypatch.setattr(work, lambda *_, **__: pytest.fail("the work is done before it is refused"))
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


@pytest.mark.parametrize(
    "key",
    spread([key for key in WRITING if key[0] != "sitl"], [key for key in WRITING if key[0] not in _SLOW], _OFTEN),
    ids=" ".join,
)
def test_a_command_tells_what_it_replaces(
    key: tuple[str, str], videoray_fmu: Path, tmp_path: Path, capsys: Capsys
) -> None:
    """It replaces its own file until somebody changes it, and then with --force only. For `sitl`, see its tests."""
    shutil.copy(BARE, tmp_path)
    plan = f'vehicle = "{BARE.name}"\nstop_time = 1.0\nstep = 0.5\nsampler = "grid"\n'
    plan += '[keep]\noutputs = ["w"]\nevery = 0.5\n'
    (tmp_path / "plan.toml").write_text(plan, encoding="utf-8")
    target = tmp_path / WRITING[key].name
    words = WRITING[key].arguments(target, fmu=str(videoray_fmu))

    def told() -> str:
        with without_page():
            assert main(words) == 0
        out = " ".join(capsys.readouterr().out.split())
        return out.partition(f"Wrote {target.parent if key[1] == 'folder' else ''}")[2]

    write_whole(Output(target, b"of an earlier version"))
    assert "(replaced the result of an earlier run)" in told()
    with target.open("ab") as file:
        file.write(b"\n")
    assert main(words) == 2
    assert re.search(f"{FOREIGN}|{CHANGED}", capsys.readouterr().err)
    words.append("--force")
    assert re.search(rf"\(replaced a file that ({FOREIGN}|{CHANGED})", told())


def test_an_fmu_proves_itself_on_any_machine(
    videoray_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its hashes tell."""
    monkeypatch.setattr("rov_fmu.build.compile_all", lambda *_: pytest.fail("it is not refused"))
    whole, vehicle = videoray_fmu.read_bytes(), load_vehicle(BARE)
    path = tmp_path / "rov.fmu"
    path.write_bytes(whole)
    with pytest.raises(pytest.fail.Exception):
        build_fmu(vehicle, path, platforms="host")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("extra/notes.txt", "my notes")
    changed = path.read_bytes()
    for content in (changed, whole + b"x", b"x" + whole, whole[:-1000], b"PK\x03\x04"):
        path.write_bytes(content)
        with pytest.raises(WriteError, match="--force"):
            build_fmu(vehicle, path, platforms="host")
