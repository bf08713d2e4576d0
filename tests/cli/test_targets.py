"""Files that cannot be written: one clear line, old files stay, no drafts remain, and all files are written or none."""

import errno
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import (
    ALONE,
    COMMANDS,
    FEW_TESTS,
    FILES,
    READING,
    REFIT,
    TESTS,
    WRITING,
    Command,
    run_elsewhere,
    without_progress,
)
from tests.conftest import without_page
from tests.vehicles import THRUST_EFFECTS

Capsys = pytest.CaptureFixture[str]
OLD = b"the old one"
_posix = pytest.mark.skipif(os.name != "posix", reason="permissions, pipes and limits are POSIX")


def one_line(capsys: Capsys) -> str:
    out, err = capsys.readouterr()
    err = without_progress(err)
    assert not out.strip()
    assert err.endswith("\n")
    assert err[:-1].isprintable()
    return err


def _file_for_folder(path: Path) -> None:
    path.parent.rmdir()
    path.parent.touch()


# What is at the target before, and what the line must say about it.
IMPOSSIBLE: dict[str, tuple[Callable[[Path], object], str]] = {
    "a folder": (lambda path: path.mkdir(), "is a folder"),
    "no folder": (lambda path: path.parent.rmdir(), "there is no folder"),
    "a file for a folder": (_file_for_folder, "there is no folder"),
    "a pipe": (os.mkfifo, "is a device or a pipe"),
    "a link to a device": (lambda path: path.symlink_to("/dev/full"), "is a device or a pipe"),
}


_CASES = {f"{' '.join(key)}-{case}": (of, case) for key, of in COMMANDS.items() for case in IMPOSSIBLE}


@_posix
@pytest.mark.parametrize(("command", "case"), [*_CASES.values()], ids=[*_CASES])
def test_an_impossible_target_is_refused_before_the_work(
    command: Command, case: str, tmp_path: Path, capsys: Capsys
) -> None:
    target = tmp_path / "target" / command.name
    target.parent.mkdir()
    make, reason = IMPOSSIBLE[case]
    make(target)
    before = sorted(tmp_path.rglob("*"))
    assert command.run(target) == 2
    line = one_line(capsys)
    assert str(target.parent) in line
    assert reason in line
    assert sorted(tmp_path.rglob("*")) == before


SUFFIXED = {key: of for key, of in WRITING.items() if of.line.endswith(f"{{f}}/{of.name}")}
"""What is written to the path that the command line ends with."""


@pytest.mark.parametrize("key", SUFFIXED, ids=" ".join)
@pytest.mark.parametrize("suffix", ["", ".txt", ".ulg"])
def test_a_name_that_does_not_tell_its_kind_is_refused_before_the_work(
    key: tuple[str, str], suffix: str, tmp_path: Path, capsys: Capsys
) -> None:
    command = SUFFIXED[key]
    assert main(command.arguments(tmp_path / f"x{suffix}", "--force", fmu=str(VIDEORAY))) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1), "no part of the work is done"
    assert f"x{suffix}: " in err
    assert "must end with ." in err or "is the suffix of" in err
    assert not list(tmp_path.iterdir())


def bound_by_permissions() -> list[str]:
    """Return the words before a command that make permissions bind it, even if the administrator runs it."""
    if os.geteuid() != 0:
        return []
    if not shutil.which("setpriv"):
        pytest.skip("there is no setpriv to bind the administrator by permissions")
    return ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-dac_override,-dac_read_search"]


@_posix
@pytest.mark.parametrize(
    ("file_mode", "folder_mode", "reason"),
    [
        pytest.param(0o644, 0o555, "its folder is read-only", marks=pytest.mark.long),
        pytest.param(0o444, 0o755, "cannot be written: is read-only", marks=pytest.mark.long),
    ],
)
def test_what_is_read_only_stays(file_mode: int, folder_mode: int, reason: str, tmp_path: Path) -> None:
    target, temporary = tmp_path / "target", tmp_path / "temporary"
    temporary.mkdir()
    target.mkdir()
    files = {command.name: OLD for command in COMMANDS.values()}
    for name in files:
        (target / name).write_bytes(OLD)
        (target / name).chmod(file_mode)
    target.chmod(folder_mode)
    for code, printed in run_elsewhere(
        [command.arguments(target / command.name, "--force") for command in COMMANDS.values()],
        temporary,
        bound_by_permissions(),
    ):
        assert code == 2
        (line,) = without_progress(printed).splitlines()
        assert line.isprintable()
        assert reason in line
    assert {path.name: path.read_bytes() for path in target.iterdir()} == files
    assert list(temporary.iterdir()) == []


# ---- Several files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "options"),
    [pytest.param("identify", ("output", "report"), marks=pytest.mark.long)],
)
def test_two_files_are_written_both_or_neither(
    command: str, options: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    commands = [COMMANDS[command, option] for option in options]
    words = [*dict.fromkeys(word for one in commands for word in one.arguments(tmp_path / one.name, "--force"))]
    old = tmp_path / commands[1].name
    old.write_bytes(OLD)
    calls = 0

    def full(_: int) -> None:
        nonlocal calls
        calls += 1
        if calls == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched, without_page():
        patched.setattr(os, "fsync", full)
        assert main(words) == 2
    assert "No space left" in one_line(capsys)
    assert list(tmp_path.iterdir()) == [old]
    assert old.read_bytes() == OLD
    with without_page():
        assert main(words) == 0
    assert {*tmp_path.iterdir()} == {tmp_path / one.name for one in commands}
    assert old.read_bytes() != OLD


# Vehicles that are built, and where.
BUILT = [
    ("videoray.toml", "videoray.toml"),
    ("videoray.toml", "linked.toml"),
    ("linked.toml", "videoray.toml"),
    ("videoray.toml", "hard.toml"),
    ("refit.toml", "report.html"),
    ("videoray.toml", "tables/table3_heave_steady.csv"),
    ("effects.toml", "thrust_16_v.csv"),
]
OVERWRITING = [
    *(f"build {vehicle} -o {output}" for vehicle, output in BUILT),
    "identify tests --force -o tests/rov.toml",
    "tune videoray.toml --axis heave --points points.csv -o points.csv",
    "tune effects.toml --axis surge --command 1 --v-ss 1 -o thrust_12_v.csv",
    "simulate effects.toml -o thrust_12_v.csv",
    "sitl effects.toml --log thrust_12_v.csv",
]
"""Commands in the folder `reading` whose output is one of their inputs, or another output."""
OVERWRITING += [
    f"{line} --force {FILES[key[0], option]} {'.' if key[0] == 'study' else line.split()[-1]}"
    for key, line in READING.items()
    for name, option in sorted(FILES.keys() - READING.keys())
    if name == key[0] and key != ("tune", "vehicle")  # which may be tuned in its place
]


@pytest.fixture(scope="module")
def reading(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with vehicles, links to one of them, tables and tank tests."""
    folder = tmp_path_factory.mktemp("reading")
    shutil.copytree(VIDEORAY.parent, folder, dirs_exist_ok=True)
    shutil.copytree(TESTS, folder / "tests")
    shutil.copy(THRUST_EFFECTS, folder / "effects.toml")
    for path in load_vehicle(THRUST_EFFECTS).files:
        shutil.copy(path, folder)
    (folder / "linked.toml").symlink_to("videoray.toml")
    (folder / "hard.toml").hardlink_to(folder / "videoray.toml")
    refit = REFIT.read_text(encoding="utf-8")
    texts = {
        "refit.toml": refit.replace("\n[provenance]", '\n[provenance]\nreport = "report.html"'),
        "report.html": "a report",
        "points.csv": "time,command [%],velocity [m/s]\n0,20,0.1\n",
        "study.json": 'vehicle = "videoray.toml"\nstop_time = 1.0\n',
        **dict.fromkeys(("videoray.fmu",), "is read once the output is checked"),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("command", OVERWRITING)
def test_no_command_writes_over_what_it_reads_or_writes_itself(
    command: str, reading: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(reading)
    before = {path: path.read_bytes() for path in reading.rglob("*") if path.is_file()}
    assert main(command.split()) == 2
    assert re.search("would overwrite|the name must end with|is the suffix of|writes a folder", one_line(capsys))
    assert {path: path.read_bytes() for path in reading.rglob("*") if path.is_file()} == before


def test_a_vehicle_may_be_tuned_in_its_place(tmp_path: Path) -> None:
    """A file that somebody wrote by hand is replaced with --force only, as by every command."""
    rov = tmp_path / "rov.toml"
    rov.write_text(ALONE, encoding="utf-8")
    points = tmp_path / "points.csv"
    points.write_text("command [%],velocity [m/s]\n20,0.1\n30,0.2\n40,0.3\n", encoding="utf-8")
    words = ["tune", str(rov), "--axis", "heave", "--points", str(points), "-o", str(rov)]
    assert main(words) == 2
    assert rov.read_text(encoding="utf-8") == ALONE
    assert [main([*words, "--force"]), main(words)] == [0, 0]
    assert load_vehicle(rov).sources["alpha_w"] == "Tuned to V_ss = 0.1 at 20%, V_ss = 0.2 at 30%, ..."


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_replaced_and_what_it_leads_to_stays(there: bool, tmp_path: Path) -> None:
    target, other = tmp_path / "target.toml", tmp_path / "other"
    if there:
        other.write_bytes(OLD)
    target.symlink_to(other)
    assert COMMANDS["tune", "output"].run(target) == 0
    assert not target.is_symlink()
    assert target.stat().st_size > 1000
    assert other.exists() == there
    assert not there or other.read_bytes() == OLD


def test_a_path_of_any_characters_is_written_and_printed(tmp_path: Path, capsys: Capsys) -> None:
    for stem in ("Röv [bold] 4 [", "\udcff", "a\nb", "n" * 245):
        folder, name = tmp_path / stem[:200], f"{stem}.toml"
        try:
            folder.mkdir()
        except OSError:  # a file system that takes Unicode alone
            continue
        (folder / "folder.toml").mkdir()
        for target, code in ((folder / name, 0), (folder / "no" / name, 2), (folder / "folder.toml", 2)):
            capsys.readouterr()
            assert COMMANDS["tune", "output"].run(target) == code
        one_line(capsys)
        assert load_vehicle(folder / name)
    there = sorted(tmp_path.rglob("*"))
    report = ["--report", str(tmp_path / "\udcff.html")]
    assert main(["identify", str(FEW_TESTS), "--force", "-o", str(tmp_path / "x.toml"), *report]) == 2
    assert "not Unicode" in one_line(capsys)
    assert sorted(tmp_path.rglob("*")) == there
    with without_page():
        assert COMMANDS["build", "output"].run(tmp_path / "Röv [bold] 4 [" / "] [bold] x.fmu") == 0
    assert "Röv [bold] 4 [/] [bold] x.fmu" in capsys.readouterr().out.replace("\n", "")
