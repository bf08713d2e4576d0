"""The command `rov-fmu export`: what it writes, and what it refuses in one line."""

from pathlib import Path

import pytest

from rov_fmu.bridges import mujoco
from rov_fmu.c.compile import host_platform
from rov_fmu.cli import main
from tests.commands import ROOT

IDENTIFIED = ROOT / "verification" / "references" / "vehicles" / "identified.toml"
REFIT = ROOT / "models" / "videoray_refit" / "videoray_refit.toml"


@pytest.fixture(autouse=True)
def for_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile no libraries for others, which takes seconds."""
    monkeypatch.setattr(mujoco, "HOSTS", [*filter(None, [host_platform(fmi=3)])])


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return the only line about wrong input."""
    assert main(["export", *arguments]) == 2
    error = capsys.readouterr().err
    (line,) = (line for line in error.splitlines() if "not every axis may be trusted" not in line)
    return line.removeprefix("rov-fmu: ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "urdf", "--world"], "--to urdf: leave out --world, because only sdf has it"),
        (["--to", "mujoco", "--added-mass", "link"], "--to mujoco: leave out --added-mass, because only sdf has it"),
        (["--to", "mujoco", "--seed", "3"], "--to mujoco: leave out --seed, or give --draws as well"),
        (["--to", "ardusub-gains", "--gains", "none"], "none: there is no such file"),
        (["--to", "ardusub-gains", "--gains", "a_file"], "a_file: has none of the gains, such as ATC_RAT_YAW_P"),
        (
            ["--to", "mujoco", "-o", "my-rov"],
            "my-rov: programs import this folder, so its name must begin with a letter",
        ),
        (["--to", "mujoco", "-o", "mujoco"], "mujoco: programs import this folder, so its name must"),
        (["--to", "mujoco", "-o", "a_file"], "a_file: is a file, and --to mujoco writes a folder"),
        (["--to", "mujoco", "-o", "none/rov"], "none/rov: there is no folder none"),
        (
            ["--to", "mjcf"],
            "Invalid value for '--to': 'mjcf' must be one of mujoco, allocation, autopilot, gains, ardusub-gains, sdf,",
        ),
        (
            ["--to", "mujoco", "--draws", "9"],
            "videoray: no coefficient has a confidence interval, so nothing can be drawn",
        ),
        (
            ["--to", "sdf", "-o", "rov.fmu"],
            "rov.fmu: would be a model for Gazebo (SDF), but .fmu is the suffix of an FMU",
        ),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a_file").touch()
    assert refused(["videoray", *arguments], capsys).startswith(message)
    assert [path.name for path in tmp_path.iterdir()] == ["a_file"]


@pytest.mark.parametrize(
    ("sentence", "changed", "axes"),
    [
        ("heave: usable.", "heave: do not use.", "heave: do not use"),
        ("heave: usable.", "sway: usable.", "heave: not identified"),
    ],
)
def test_axes_that_are_not_fit_for_use_are_drawn_by_force_only(
    sentence: str, changed: str, axes: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle = tmp_path / "rov.toml"
    vehicle.write_text(REFIT.read_text(encoding="utf-8").replace(sentence, changed), encoding="utf-8")
    draw = [str(vehicle), "--to", "mujoco", "-o", str(tmp_path / "rov"), "--draws", "2"]
    assert f"these axes may be off: {axes}; --force" in refused(draw, capsys)
    assert not (tmp_path / "rov").exists()
    assert main(["export", *draw, "--force"]) == 0
    assert len((tmp_path / "rov" / "draws.csv").read_text(encoding="utf-8").splitlines()) == 3


def test_the_next_command_runs_the_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "my folder" / "rov"
    folder.parent.mkdir()
    assert main(["export", str(IDENTIFIED), "--to", "mujoco", "-o", str(folder)]) == 0
    assert capsys.readouterr().out.endswith(f"Next: cd '{folder.parent}' && python -m rov\n")
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert "- yaw: good. The 95% bands contain 100% of the unseen samples." in readme
    assert "draws()" not in readme
    assert not (folder / "draws.csv").read_text(encoding="utf-8").strip()
