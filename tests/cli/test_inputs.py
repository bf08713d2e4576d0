"""Files that cannot be read: one line that names the file and the reason, and does not mention writing."""

import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.cli.test_targets import bound_by_permissions
from tests.commands import TESTS, Capsys, run_elsewhere, without_progress

pytestmark = pytest.mark.skipif(os.name != "posix", reason="permissions are POSIX")

# A file of the folder that `copied` makes, {f}, and a command that reads it.
READING: dict[str, tuple[str, str]] = {
    "the vehicle of a build": ("videoray.toml", "build {f}/videoray.toml"),
    "the vehicle to tune": ("videoray.toml", "tune {f}/videoray.toml --axis=heave --command=0.3 --v-ss=0.2"),
    "the points": ("points.csv", "tune {f}/videoray.toml --axis=heave --points {f}/points.csv"),
    "a drawing": ("pictures/from_above.svg", "build {f}/videoray.toml"),
    "a drawing of the FMU in Python": (
        "pictures/from_starboard.svg",
        "build {f}/videoray.toml --backend=pythonfmu",
    ),
    "the icon": ("pictures/model.png", "build {f}/videoray.toml"),
    "the report": ("report.html", "build {f}/refit.toml"),
    "rov.toml": ("tests/rov.toml", "identify {f}/tests"),
    "a tank test": ("tests/steady_surge.csv", "identify {f}/tests"),
    "the base": ("tests/beside.toml", "identify {f}/tests"),
    "the plan": ("plan.toml", "study {f}/plan.toml -o {f}/results"),
    "the FMU of a plan": ("rov.fmu", "study {f}/of_fmu.toml -o {f}/results"),
    "the commands": ("commands.csv", "simulate {f}/videoray.toml --input {f}/commands.csv"),
    "the recording": ("log.csv", "fly {f}/videoray.toml --recording {f}/log.csv -o {f}/fly.html"),
    "the FMU": ("rov.fmu", "prove {f}/rov.fmu"),
}
PICTURES = {"a drawing", "a drawing of the FMU in Python", "the icon"}
"""The cases whose file may be missing, because a neutral picture replaces it."""


def _words(case: str, folder: Path) -> list[str]:
    """Return the arguments of a command that reads this folder, and may build an FMU in the current one."""
    words = [word.format(f=folder) for word in READING[case][1].split()]
    return [*words, "-o", str(Path.cwd() / "rov.fmu")] if words[0] == "build" else words


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder, beside the current one, with the shipped vehicles and all files that they read."""
    folder = tmp_path / "inputs"
    shutil.copytree(VIDEORAY.parent, folder)
    shutil.copytree(TESTS, folder / "tests")
    write_vehicle(load_vehicle(VIDEORAY), folder / "tests" / "beside.toml")
    (folder / "points.csv").write_text("command [%],velocity [m/s]\n20,0.1\n", encoding="utf-8")
    (folder / "report.html").write_text("a report", encoding="utf-8")
    (folder / "plan.toml").write_text('vehicle = "videoray.toml"\nstop_time = 1.0\n', encoding="utf-8")
    plan = 'fmu = "rov.fmu"\nstop_time = 1.0\nstep = 0.1\nruns = 1\nfigures = { top = "max(u)" }\n'
    (folder / "of_fmu.toml").write_text(plan, encoding="utf-8")
    (folder / "commands.csv").write_text("time,u_l\n0,0.3\n", encoding="utf-8")
    (folder / "log.csv").write_text("time [s],depth [m]\n0,1\n", encoding="utf-8")
    with zipfile.ZipFile(folder / "rov.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    refit = SHIPPED["videoray_refit"].read_text(encoding="utf-8")
    reported = refit.replace("\n[provenance]", '\n[provenance]\nreport = "report.html"')
    (folder / "refit.toml").write_text(reported, encoding="utf-8")
    rov = (folder / "tests" / "rov.toml").read_text(encoding="utf-8")
    beside = rov.replace("\n[vehicle]", '\nbase = "beside.toml"\n[vehicle]')
    assert beside != rov
    (folder / "tests" / "rov.toml").write_text(beside, encoding="utf-8")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return folder


def _check(err: str, named: str) -> None:
    err = without_progress(err)
    assert err.startswith("rov-fmu: ")
    assert err.count("\n") == 1
    assert named in err
    assert "written" not in err
    assert not list(Path.cwd().iterdir())


def _folder(path: Path, _: pytest.MonkeyPatch) -> None:
    path.unlink()
    path.mkdir()


def _pipe(path: Path, _: pytest.MonkeyPatch) -> None:
    path.unlink()
    os.mkfifo(path)


def _device(path: Path, _: pytest.MonkeyPatch) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def _gone(path: Path, _: pytest.MonkeyPatch) -> None:
    path.unlink()


def _gone_as_it_is_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = os.open

    def gone(name: str, *how: Any, **more: Any) -> int:
        if path.exists() and os.path.realpath(name) == os.path.realpath(path):
            path.unlink()
        return opened(name, *how, **more)

    monkeypatch.setattr(os, "open", gone)


_SLOW = {"the icon", "the report", "a drawing of the FMU in Python"}
"""The cases that read their file in the middle of a build, except one that runs by default."""
_CASES = [
    # of each case one kind by default, and all of them once a week
    *(
        pytest.param(case, what, marks=() if n % 3 == m else pytest.mark.weekly)
        for n, case in enumerate(READING)
        for m, what in enumerate((_folder, _pipe, _device))
        # a folder of tests is read without them, and they are named (tests/tank/test_listing.py)
        if case not in {*PICTURES, *["a tank test"] * (what is not _folder)}
    ),
    # without rov.toml, a folder of tests is inspected and a draft is offered
    *(
        pytest.param(case, _gone, marks=() if n % 2 else pytest.mark.weekly)
        for n, case in enumerate(READING)
        if case not in {*PICTURES, "a tank test", "rov.toml"}
    ),
    *(
        pytest.param(case, _gone_as_it_is_read, marks=pytest.mark.weekly if case in _SLOW else ())
        for case in READING
        if case != "a tank test"  # which another process reads
    ),
]


@pytest.mark.parametrize(("case", "what"), _CASES)
def test_what_is_no_file_is_one_line_that_names_it(
    case: str,
    what: Callable[[Path, pytest.MonkeyPatch], None],
    copied: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capsys,
) -> None:
    name, _ = READING[case]
    what(copied / name, monkeypatch)
    assert main(_words(case, copied)) == 2
    _check(capsys.readouterr().err, Path(name).name)


SOME = ["the vehicle to tune", "the points", "rov.toml", "a tank test"]
"""The quick cases; the weekly tests try all."""


@pytest.mark.parametrize(
    ("cases", "modes"),
    [
        pytest.param(SOME, [0o600], marks=pytest.mark.long),
        pytest.param([*READING], [0o600, 0o000, 0o300], marks=pytest.mark.weekly),
    ],
    ids=["some", "all"],
)
def test_what_may_not_be_read_is_one_line_that_names_it(
    cases: list[str], modes: list[int], copied: Path, tmp_path: Path
) -> None:
    """The modes are those of folders."""
    (tmp_path / "temporary").mkdir()
    commands, locked = [], []
    files = [(READING[case][0], 0, case) for case in cases]
    folders = [("tests", mode, "rov.toml") for mode in modes] + [("pictures", 0o000, "a drawing")]
    for n, (name, mode, case) in enumerate([*files, *folders]):
        folder = Path(shutil.copytree(copied, tmp_path / str(n)))
        locked.append(folder / name)
        locked[-1].chmod(mode)
        commands.append(_words(case, folder))
    ends = run_elsewhere(commands, tmp_path / "temporary", bound_by_permissions())
    for path, (code, err) in zip(locked, ends, strict=True):
        path.chmod(0o755)
        assert code == 2, path
        assert ("Permission denied" if path.is_dir() else "cannot be read: Permission denied") in err
        _check(err, str(path) if path.is_dir() else path.name)
