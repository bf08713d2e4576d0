"""Files that cannot be written: one clear line, old files stay, no drafts remain, and all files are written or none."""

import errno
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.commands import BARE, COMMANDS, FEW_TESTS, REFIT, TESTS, Command, run_elsewhere, without_progress
from tests.folders import small_folder
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


_CASES = {f"{name}-{case}": (command, case) for name, command in COMMANDS.items() for case in IMPOSSIBLE}


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


def check_refusals(ends: list[tuple[int, str]], reason: str, target: Path, temporary: Path) -> None:
    """Check that every command printed one line about its own file, and that only the old files are there."""
    assert len(ends) == len(COMMANDS)
    for code, printed in ends:
        err = without_progress(printed)
        assert code == (1 if ": cannot compile: " in err else 2)
        assert err.endswith("\n")
        assert err[:-1].isprintable()
        assert reason in err
    assert {path.name: path.read_bytes() for path in target.iterdir()} == {c.name: OLD for c in COMMANDS.values()}
    assert list(temporary.iterdir()) == []


def full_folder(folder: Path) -> tuple[Path, Path]:
    """Return a folder with an old file of every command, and a folder for temporary files."""
    target, temporary = folder / "target", folder / "temporary"
    temporary.mkdir()
    target.mkdir(exist_ok=True)
    for command in COMMANDS.values():
        (target / command.name).write_bytes(OLD)
    return target, temporary


def bound_by_permissions() -> list[str]:
    """Return the words before a command that make permissions bind it, even if the administrator runs it."""
    if os.geteuid() != 0:
        return []
    if not shutil.which("setpriv"):
        pytest.skip("there is no setpriv to bind the administrator by permissions")
    return ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-dac_override,-dac_read_search"]


@_posix
@pytest.mark.parametrize("what", ["folder", pytest.param("files", marks=pytest.mark.long)])
def test_what_is_read_only_stays(what: str, tmp_path: Path) -> None:
    target, temporary = full_folder(tmp_path)
    for path in target.iterdir():
        path.chmod(0o644 if what == "folder" else 0o444)
    target.chmod(0o555 if what == "folder" else 0o755)
    ends = run_elsewhere([(c, target / c.name) for c in COMMANDS.values()], temporary, bound_by_permissions())
    check_refusals(
        ends, "its folder is read-only" if what == "folder" else "cannot be written: is read-only", target, temporary
    )


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="a disk of a given size is mounted as on Linux")
def test_a_full_disk_leaves_the_old_files(tmp_path: Path) -> None:
    (tmp_path / "target").mkdir()
    disk = [str(tmp_path / "target")]
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "full", *disk], check=False, capture_output=True
    ).returncode:
        pytest.skip("only the administrator can mount a small disk")
    try:
        target, temporary = full_folder(tmp_path)
        filler = target / "filler"
        with pytest.raises(OSError, match="No space left"):
            filler.write_bytes(bytes(10**6))
        check = [(command, target / command.name) for command in COMMANDS.values()]
        ends = run_elsewhere(check, temporary)
        filler.unlink()
        check_refusals(ends, "No space left on device", target, temporary)
    finally:
        subprocess.run(["umount", *disk], check=True)


# ---- Several files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["build", pytest.param("identify", marks=pytest.mark.long)])
def test_two_files_are_written_both_or_neither(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    first, second = (
        tmp_path / ("rov.fmu" if command == "build" else "rov.toml"),
        tmp_path / "bare_OspModelDescription.xml",
    )
    second.write_bytes(OLD)
    calls = 0

    def full(_: int) -> None:
        nonlocal calls
        calls += 1
        if calls == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def run() -> int:
        if command == "identify":
            return main(["identify", str(FEW_TESTS), "--force", "-o", str(first), "--report", str(second)])
        return main(["build", str(BARE), "--platform", "host", "-o", str(first), "--osp"])

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        assert run() == 2
    assert "No space left" in one_line(capsys)
    assert list(tmp_path.iterdir()) == [second]
    assert second.read_bytes() == OLD
    assert run() == 0
    assert sorted(tmp_path.iterdir()) == [second, first]
    if command == "identify":
        provenance = load_vehicle(first).provenance
        assert provenance
        assert provenance.report == second


def _refused(arguments: list[str], folder: Path, capsys: Capsys) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert main(arguments) == 2
    assert "would overwrite" in one_line(capsys)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_no_command_writes_over_what_it_reads_or_writes_itself(tmp_path: Path, capsys: Capsys) -> None:
    shutil.copy(REFIT, tmp_path)
    shutil.copytree(VIDEORAY.parent, tmp_path, dirs_exist_ok=True)
    tests = Path(shutil.copytree(TESTS, tmp_path / "tests"))
    given = (tests / "rov.toml").read_text(encoding="utf-8")
    (tests / "rov.toml").write_text(given.replace('"videoray"\n', '"other.toml"\n', 1), encoding="utf-8")
    write_vehicle(load_vehicle(VIDEORAY), tests / "other.toml")
    rov, report, points = tmp_path / "videoray.toml", tmp_path / "report.html", tmp_path / "points.csv"
    report.write_text("a report", encoding="utf-8")
    points.write_text("command [%],velocity [m/s]\n20,0.1\n", encoding="utf-8")
    refit = tmp_path / "videoray_refit.toml"
    refit.write_text(
        refit.read_text(encoding="utf-8").replace("\n[provenance]", '\n[provenance]\nreport = "report.html"'),
        encoding="utf-8",
    )
    linked, hard = tmp_path / "linked.toml", tmp_path / "hard.toml"
    linked.symlink_to(rov)
    hard.hardlink_to(rov)
    osp = Path(shutil.copy(rov, tmp_path / "videoray_OspModelDescription.xml"))
    for vehicle, output in (
        (rov, rov),
        (rov, linked),
        (linked, rov),
        (rov, hard),
        (refit, report),
        (osp, tmp_path / "x"),
        (rov, tmp_path / "tables" / "table3_heave_steady.csv"),
    ):
        _refused(["build", str(vehicle), "-o", str(output), "--osp"], tmp_path, capsys)
    _refused(["build", "-o", str(tmp_path / osp.name), "--osp"], tmp_path, capsys)
    for output in (rov, refit, tmp_path / "tables" / "table3_heave_steady.csv"):
        _refused(["fly", str(rov), "--against", str(refit), "-o", str(output)], tmp_path, capsys)
    for options in (
        ["-o", str(tests / "rov.toml")],
        ["-o", str(tests / "other.toml")],
        ["--report", str(tests / "steady_surge.csv")],
        ["-o", str(tmp_path / "new"), "--report", str(tests / ".." / "new")],
    ):
        _refused(["identify", str(tests), *options], tmp_path, capsys)
    tune = ["tune", str(rov), "--axis", "heave", "--points", str(points), "-o"]
    _refused([*tune, str(points)], tmp_path, capsys)
    assert main([*tune, str(rov)]) == 0, "a vehicle may be tuned in its place"
    assert load_vehicle(rov).sources["alpha_w"].startswith("Tuned to")


@pytest.mark.parametrize(
    ("vehicle", "names"),
    [
        (THRUST_EFFECTS, {"thrust_12_v.csv", "thrust_16_v.csv"}),
        (SHIPPED["bluerov2"], {"t200_current_16_v.csv"}),
    ],
    ids=["thrust", "electric current"],
)
def test_no_command_writes_over_a_table_of_the_vehicle(
    vehicle: Path, names: set[str], tmp_path: Path, capsys: Capsys
) -> None:
    for path in (vehicle, *load_vehicle(vehicle).files):
        copy = tmp_path / path.relative_to(vehicle.parent)
        copy.parent.mkdir(exist_ok=True)
        shutil.copy(path, copy)
    rov = tmp_path / vehicle.name
    tables = {path for path in load_vehicle(rov).files if path.suffix == ".csv"}
    assert {path.name for path in tables} == names
    for table in map(str, tables):
        _refused(["simulate", str(rov), "-o", table], tmp_path, capsys)
        _refused(["sitl", str(rov), "--log", table], tmp_path, capsys)
        _refused(["tune", str(rov), "--axis", "surge", "--command", "1", "--v-ss", "1", "-o", table], tmp_path, capsys)
        _refused(["build", str(rov), "-o", table], tmp_path, capsys)


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_replaced_and_what_it_leads_to_stays(there: bool, tmp_path: Path) -> None:
    target, other = tmp_path / "target", tmp_path / "other"
    if there:
        other.write_bytes(OLD)
    target.symlink_to(other)
    assert COMMANDS["the tuned vehicle"].run(target) == 0
    assert not target.is_symlink()
    assert target.stat().st_size > 1000
    assert other.exists() == there
    assert not there or other.read_bytes() == OLD


def test_a_path_of_any_characters_is_written_and_printed(tmp_path: Path, capsys: Capsys) -> None:
    for name in ("Röv [bold] 4 [", "\udcff", "a\nb", "n" * 250):
        folder = tmp_path / name[:200]
        try:
            folder.mkdir()
        except OSError:  # a file system that takes Unicode alone
            continue
        assert COMMANDS["the tuned vehicle"].run(folder / name) == 0
        assert load_vehicle(folder / name)
        assert COMMANDS["the tuned vehicle"].run(folder / "no" / name) == 2
        capsys.readouterr()
        assert COMMANDS["the tuned vehicle"].run(folder) == 2
        one_line(capsys)
    tests = small_folder(tmp_path / "tests")
    there = sorted(tmp_path.rglob("*"))
    assert main(["identify", str(tests), "-o", str(tmp_path / "x"), "--report", str(tmp_path / "\udcff.html")]) == 2
    assert "not Unicode" in one_line(capsys)
    assert sorted(tmp_path.rglob("*")) == there
    assert COMMANDS["the FMU"].run(tmp_path / "Röv [bold] 4 [" / "] [bold] x.fmu") == 0
    assert "Röv [bold] 4 [/] [bold] x.fmu" in capsys.readouterr().out.replace("\n", "")
