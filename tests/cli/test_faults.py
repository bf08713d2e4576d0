"""Commands that are killed, interrupted, run at once, or cannot print: whole files, and at most one line."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.fmu.archive import native_content
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ALONE, BARE, COMMANDS, FEW_TESTS, ROOT, TESTS, start, without_progress

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals, pipes and shells are POSIX")
OLD = b"the old one"


# ---- Killed ----------------------------------------------------------------------------------------------------------


def _kill(process: subprocess.Popen[str], folder: Path, after: float | None) -> None:
    """Kill a process after some seconds, or as soon as a draft is in the folder."""
    deadline = time.monotonic() + (300.0 if after is None else after)
    while time.monotonic() < deadline and not (after is None and list(folder.glob(".*.part"))):
        assert after is not None or process.poll() is None
        time.sleep(0.001)
    process.kill()
    process.communicate(timeout=300)


def _moments(seconds: float, number: int) -> list[float | None]:
    """Return when to kill a command that takes so many seconds: as it writes, and most often near its end."""
    return [None, *(seconds * (n / number) ** 0.5 for n in range(1, number))]


_few_or_many = pytest.mark.parametrize(
    "number", [pytest.param(5, marks=pytest.mark.long), pytest.param(20, marks=pytest.mark.weekly)]
)
"""The number of moments at which a command is killed."""


def _succeeds(arguments: list[str]) -> None:
    process = start(arguments, stdout=subprocess.DEVNULL)
    assert without_progress(process.communicate(timeout=300)[1]) == ""
    assert process.returncode == 0


@_few_or_many
def test_a_killed_build_leaves_a_whole_fmu_and_the_next_one_is_right(number: int, tmp_path: Path) -> None:
    reference, target = tmp_path / "reference.fmu", tmp_path / "target" / "rov.fmu"
    target.parent.mkdir()
    started = time.monotonic()
    arguments = ["build", str(BARE), "--platform", "host", "-o"]
    _succeeds([*arguments, str(reference)])
    took = time.monotonic() - started
    for moment in _moments(took, number):
        target.write_bytes(OLD)
        _kill(start([*arguments, str(target)], stdout=subprocess.DEVNULL), target.parent, moment)
        assert target.read_bytes() in (OLD, reference.read_bytes())
    _succeeds([*arguments, str(target)])
    assert target.read_bytes() == reference.read_bytes()


@_few_or_many
def test_a_killed_identification_leaves_whole_files(number: int, tmp_path: Path) -> None:
    def arguments(folder: Path) -> list[str]:
        folder.mkdir()
        files = ["-o", str(folder / "rov.toml"), "--report", str(folder / "r.html")]
        return ["identify", str(FEW_TESTS), "--force", *files]

    started = time.monotonic()
    _succeeds(arguments(tmp_path / "reference"))
    took = time.monotonic() - started
    for n, moment in enumerate(_moments(took, number)):
        folder = tmp_path / str(n)
        process = start(arguments(folder), stdout=subprocess.DEVNULL)
        for name in ("rov.toml", "r.html"):
            (folder / name).write_bytes(OLD)
        _kill(process, folder, moment)
        for name in ("rov.toml", "r.html"):
            assert (folder / name).read_bytes() in (OLD, (tmp_path / "reference" / name).read_bytes())


@pytest.mark.long
def test_of_two_builds_at_once_one_is_whole(tmp_path: Path) -> None:
    target, guids, builds = tmp_path / "target" / "rov.fmu", [], []
    target.parent.mkdir()
    shutil.copytree(VIDEORAY.parent, tmp_path, dirs_exist_ok=True)
    for n in (1, 2):
        vehicle = tmp_path / f"{n}.toml"
        vehicle.write_text(VIDEORAY.read_text(encoding="utf-8").replace("6.57", f"6.5{n}"), encoding="utf-8")
        guids.append(native_content(load_vehicle(vehicle)).guid)
        arguments = ["build", str(vehicle), "--platform", "host", "-o", str(target)]
        builds.append(start(arguments, stdout=subprocess.DEVNULL))
    assert [build.communicate(timeout=300)[1] for build in builds] == ["", ""]
    from fmpy import simulate_fmu
    from fmpy.model_description import read_model_description

    assert read_model_description(str(target)).guid in guids
    assert simulate_fmu(str(target), start_values={"u_l": 0.3, "u_r": 0.3})["u"][-1] > 0.4
    assert list(target.parent.iterdir()) == [target]


# ---- Interrupted -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "signal_"),
    [
        ("tune", signal.SIGINT),
        pytest.param("identify", signal.SIGTERM, marks=pytest.mark.long),
    ],
)
def test_an_interrupted_command_says_so_and_leaves_nothing(
    command: str, signal_: signal.Signals, tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(TESTS, tmp_path / "tests"))
    pipe, output = folder / "steady_surge_more.csv", tmp_path / "out" / "rov.toml"
    output.parent.mkdir()
    os.mkfifo(pipe)
    arguments = {
        "identify": ["identify", str(folder)],
        "tune": ["tune", str(VIDEORAY), "--axis", "surge", "--points", str(pipe)],
    }[command]
    process = start(
        [*arguments, "-o", str(output)],
        stdout=subprocess.DEVNULL,
        # a shell starts what it runs in the background with interrupts ignored, and that is inherited
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    with pipe.open("wb"):  # opens when the command reads it
        process.send_signal(signal_)
        _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    assert without_progress(err) == "rov-fmu: interrupted, no file is half-written\n"
    assert not any(output.parent.iterdir())


_INTERRUPTING = "os.kill(os.getpid(), signal.SIGINT); time.sleep({})"


ACTIONS = {
    "text": f"exec({_INTERRUPTING.format(600.0)!r})",
    "finalizer": f"type('Ended', (), {{'__del__': lambda _: exec({_INTERRUPTING.format(0.0)!r})}})()",
    "caught": f"""
    try:
        {_INTERRUPTING.format(0.1)}
    except BaseException:
        pass""",
}


@pytest.mark.parametrize("action", ACTIONS.values(), ids=ACTIONS)
def test_no_code_can_make_something_else_of_an_interrupt(action: str, tmp_path: Path) -> None:
    ran = _interrupted(f"def action():\n    {action}\n    time.sleep(600.0)", tmp_path)
    assert (ran.returncode, without_progress(ran.stderr)) == (130, "rov-fmu: interrupted, no file is half-written\n")


"""Code in which a KeyboardInterrupt would be lost or turned into something else."""


def _interrupted(action: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a function `action` as the process of a command."""
    (folder / "interrupted.py").write_text(
        "import os, signal, sys, time\nfrom pathlib import Path\nfrom rov_fmu.process import exit_code, run_process\n"
        f"{action}\nsys.exit(run_process('rov-fmu', lambda: exit_code('rov-fmu', action, {{OSError: 2}})))\n"
    )
    return subprocess.run(
        [sys.executable, "-m", "interrupted"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ | {"PYTHONPATH": str(ROOT)},  # this checkout, whichever is installed
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


_SLOW = [pytest.param(name, marks=pytest.mark.long) for name in ("the vehicle", "the report")]


@pytest.mark.parametrize("name", ["the tuned vehicle", *_SLOW])
def test_an_interrupt_before_the_last_move_leaves_nothing(name: str, tmp_path: Path) -> None:
    command = COMMANDS[name]
    target = tmp_path / "out" / command.name
    target.parent.mkdir()
    action = f"""
def interrupt(_):
    assert [*Path({str(target.parent)!r}).iterdir()], "the draft is there"
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(600.0)
os.fsync = interrupt
def action():
    from rov_fmu.cli import main
    main({list(command.arguments(target))!r})
"""
    ran = _interrupted(action, tmp_path)
    assert (ran.returncode, without_progress(ran.stderr)) == (130, "rov-fmu: interrupted, no file is half-written\n")
    assert not any(target.parent.iterdir())


def test_an_interrupt_between_two_moves_waits_for_the_second(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    action = f"""
def replace(self, target):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.5)
    self.rename(target)
Path.replace = replace
def action():
    from rov_fmu.io.output import Output, write_whole
    write_whole(*(Output(Path({str(out)!r}, name), b"new") for name in ("rov.toml", "report.html")))
    time.sleep(600.0)
"""
    ran = _interrupted(action, tmp_path)
    assert (ran.returncode, without_progress(ran.stderr)) == (130, "rov-fmu: interrupted, no file is half-written\n")
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "rov.toml"]


def test_a_vehicle_out_of_a_pipe_is_refused_where_it_must_be_read_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    read, write = os.pipe()
    os.write(write, ALONE.encode())
    os.close(write)
    tune = ["tune", f"/dev/fd/{read}", "--axis", "yaw", "--command", "0.3", "--v-ss", "1", "-o", str(tmp_path / "x")]
    assert main(tune) == 2
    os.close(read)
    assert capsys.readouterr() == (
        "",
        f"rov-fmu: /dev/fd/{read}: cannot be read a second time, as it must be to write it anew\n",
    )
    assert not any(tmp_path.iterdir())


# ---- What is printed -------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("command", ["tables", "--help"])
def test_output_that_nobody_reads_or_that_has_no_room(command: str) -> None:
    """The first prints with Rich, the second with click."""
    end, start_ = os.pipe()
    os.close(end)
    process = start([command], stdout=start_)
    os.close(start_)
    _, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (1, "")
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        process = start([command], stdout=full)
        _, err = process.communicate(timeout=300)
    assert (
        without_progress(err)
        == "rov-fmu: the output, or a temporary file: cannot be written: No space left on device\n"
    )
    assert process.returncode == 2


def test_a_terminal_with_ascii_only_gets_every_line(tmp_path: Path) -> None:
    path = tmp_path / "Röv \udcff.toml"
    try:
        path.write_text(VIDEORAY.read_text(encoding="utf-8").replace("VideoRay Pro 4", "Röv α"), encoding="utf-8")
    except OSError:
        pytest.skip("a file system that takes Unicode alone")
    shutil.copytree(VIDEORAY.parent, tmp_path, dirs_exist_ok=True)
    ascii_ = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii", "COLUMNS": "3"}
    process = start(["tables", str(path)], environment=ascii_, stdout=subprocess.PIPE)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (0, "")
    assert out.startswith("R\\xf6v \\u03b1. ")
    assert "Table 8. Surge, alpha_u = 1.1, beta_u = 1" in out
    process = start(["tables", str(path) + "x"], environment=ascii_, stdout=subprocess.PIPE)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, out) == (2, "")
    assert err.isascii()
    assert err.startswith("rov-fmu: ")
    assert ": there is no such file" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "begin"),
    [
        (["tune", str(VIDEORAY), "--axis", "sway"], "rov-fmu: "),
        (["tune", str(VIDEORAY), "--axis", "yaw", "--command", ""], "rov-fmu: "),
        (["build", "--platform", "amiga"], "rov-fmu: "),
        (["build", "--backend", ""], "rov-fmu: "),
        (["build", "--fmi", "1"], "rov-fmu: "),
        (["build", "a", "b"], "rov-fmu: "),
        (["build", "-o", ""], "rov-fmu: "),
        (["build", "", "-o", "x.fmu"], "rov-fmu: "),
        (["build", "--platform", "host", "--backend", "pythonfmu"], "rov-fmu: "),
        (["build", "--fmi", "3", "--backend=pythonfmu"], "rov-fmu: --fmi 3: PythonFMU makes FMI 2.0 alone\n"),
        (["build", "--fmi", "3", "--osp"], "rov-fmu: --fmi 3: libcosim and the OSP tools, "),
    ],
)
def test_wrong_and_clashing_options_are_one_line(
    arguments: list[str],
    begin: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(begin)
    assert err.count("\n") == 1
    assert not any(tmp_path.iterdir())
