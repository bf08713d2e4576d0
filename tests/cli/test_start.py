"""How the command starts: by name, quickly, with shell completion, with progress on a terminal, and not installed."""

import asyncio
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from fmpy import read_model_description

from rov_fmu.build import build
from rov_fmu.cli import main
from rov_fmu.engine.compile import PLATFORMS
from rov_fmu.model.layout import AXES
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, ROOT, TESTS, endless_compiler, start

_TUNE = ["tune", "videoray", "--axis=yaw", "--command=0.3", "--v-ss=1", "--tau=2"]
_posix = pytest.mark.skipif(os.name != "posix", reason="terminals and signals are POSIX")

# ---- By name ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [n if n == "videoray" else pytest.param(n, marks=pytest.mark.long) for n in SHIPPED])
def test_a_vehicle_that_ships_is_built_by_its_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rov_fmu.report.page.fmu_page.inline_svg", lambda *_: "")  # plots take most of the time
    assert main(["build", name, "--backend", "pythonfmu"]) == 0
    assert capsys.readouterr().out.startswith(f"{name}-python.fmu  ")
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}-python.fmu"]


def test_an_fmu_of_fmi_3_bears_it_in_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["build", str(BARE), "--fmi", "3", "--platform", "host"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("bare.fmi3.fmu  ")
    assert "compiling" not in out
    (path,) = tmp_path.iterdir()
    assert path.name == "bare.fmi3.fmu"
    assert read_model_description(str(path)).fmiVersion == "3.0"


def test_fly_opens_the_page_that_it_wrote(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert main(["fly", str(BARE), "--against", str(BARE)]) == 0
    path = Path(capsys.readouterr().out.strip())
    assert opened == [path.as_uri()]
    text = path.read_text(encoding="utf-8")
    assert "The ghost is Bare, under the same commands." in text
    shutil.rmtree(path.parent)


@pytest.mark.parametrize("command", [["build"], ["fly", "--against"], ["tables"], ["tune", "--axis=yaw"]])
def test_an_unknown_name_is_one_line_with_those_that_ship(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "videorey"]) == 2
    ships = ", ".join(SHIPPED)
    line = f"rov-fmu: videorey: there is no such file, and no vehicle of this name ships, only {ships}"
    assert capsys.readouterr() == ("", f"{line}; did you mean videoray?\n")


# ---- Quickly ---------------------------------------------------------------------------------------------------------

_SLOW = ("asyncio", "jinja2", "lxml", "matplotlib", "numpy", "pydantic", "rich", "scipy")
"""The packages that take long to import."""
NEEDED: dict[str, tuple[list[str], set[str]]] = {
    "--help": (["--help"], set()),
    "help of build": (["build", "--help"], set()),
    "--version": (["--version"], set()),
    "tables": (["tables"], {"pydantic", "rich"}),
    "tune": (_TUNE, {"numpy", "pydantic", "rich", "scipy"}),
    "identify": (["identify", str(TESTS)], {"numpy", "pydantic", "rich", "scipy"}),
}
"""The arguments of a command, and the slow packages that it may import."""


@pytest.mark.parametrize("case", [c if c != "identify" else pytest.param(c, marks=pytest.mark.long) for c in NEEDED])
def test_a_command_imports_what_it_uses(case: str) -> None:
    arguments, allowed = NEEDED[case]
    script = (
        "import sys\nbefore = set(sys.modules)\nfrom rov_fmu.cli import main\n"
        f"try:\n    code = main({arguments!r})\nexcept SystemExit as end:\n    code = end.code\n"
        "print(code or 0, *sorted(set(sys.modules) - before), file=sys.stderr)"
    )
    ran = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    code, *imported = ran.stderr.split()
    assert code == "0"
    assert "click" in imported
    assert set(imported) & set(_SLOW) <= allowed


# ---- Completion ------------------------------------------------------------------------------------------------------


def _completed(*words: str, shell: str = "bash") -> list[str]:
    asked = {
        "_ROV_FMU_COMPLETE": f"{shell}_complete",
        "COMP_WORDS": " ".join(["rov-fmu", *words]),
        "COMP_CWORD": str(len(words)) if shell == "bash" else words[-1],
    }
    process = start([], environment=asked, stdout=subprocess.PIPE)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (0, "")
    return out.splitlines()


def test_the_shell_completes_commands_vehicles_platforms_and_axes() -> None:
    commands = ["build", "figures", "fly", "identify", "prove", "schema", "simulate", "study", "tables", "tune"]
    assert _completed("") == [f"plain,{name}" for name in commands]
    assert _completed("build", "video") == ["file,video", "plain,videoray", "plain,videoray_refit"]
    assert _completed("tables", "videoray_") == ["file,videoray_", "plain,videoray_refit"]
    assert _completed("tune", "./my") == ["file,./my"]
    assert _completed("build", "--platform", "") == [f"plain,{name}" for name in ("host", *PLATFORMS)]
    assert _completed("build", "--backend", "p") == ["plain,pythonfmu"]
    assert _completed("build", "--fmi", "") == ["plain,2", "plain,3"]
    assert _completed("tune", "videoray", "--axis", "") == [f"plain,{name}" for name in AXES]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_for_a_shell_is_there(shell: str) -> None:
    if shell == "bash" and not shutil.which("bash"):
        pytest.skip("click asks bash for its version")
    process = start([], environment={"_ROV_FMU_COMPLETE": f"{shell}_source"}, stdout=subprocess.PIPE)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (0, "")
    assert f"_ROV_FMU_COMPLETE={shell}_complete" in out


# ---- Progress --------------------------------------------------------------------------------------------------------

_BUILD = ["build", str(BARE), "--platform=host", "-o"]


@_posix
def test_a_build_tells_its_progress_on_a_terminal(tmp_path: Path) -> None:
    shown = _on_a_terminal([*_BUILD, str(tmp_path / "x.fmu")])
    assert b"compiling " in shown
    assert shown.index(b"compiling ") < shown.index(b"built in")
    assert b"\x1b[2K" in shown, "the lines of the progress are taken back"


@_posix
@pytest.mark.long
def test_an_identification_tells_its_progress_on_a_terminal() -> None:
    shown = _on_a_terminal(["identify", str(TESTS)])
    before = shown[: shown.index(b"Coefficients")]
    assert b"%" in before
    assert b"heave" in before
    assert b"\x1b[2K" in shown, "the bar is taken back"


def _on_a_terminal(arguments: Sequence[str]) -> bytes:
    """Return what a command that succeeds prints on a terminal."""
    ours, theirs = os.openpty()
    process = start(arguments, environment={"TERM": "xterm", "NO_COLOR": "1"}, stdout=theirs)
    os.close(theirs)
    shown = b""
    while part := _read(ours):
        shown += part
    os.close(ours)
    assert process.communicate(timeout=300)[1] == ""
    assert process.returncode == 0
    return shown


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # on Linux the end of a terminal is an error
        return b""


@pytest.mark.long
def test_a_build_is_quiet_where_there_is_no_terminal(tmp_path: Path) -> None:
    process = start([*_BUILD, str(tmp_path / "x.fmu")], stdout=subprocess.PIPE)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (0, "")
    assert "compiling" not in out
    assert "\x1b" not in out
    assert "\r" not in out
    assert len(out.splitlines()) == 4  # the file, the platform, what the run gave, the time


# ---- Not installed ---------------------------------------------------------------------------------------------------


_HIDES = """
import sys
from importlib.metadata import Distribution, PackageNotFoundError

class Missing:
    def find_spec(self, name, *_):
        if name == {!r}:
            raise ModuleNotFoundError(name, name=name)

sys.meta_path.insert(0, Missing())
find = Distribution.from_name
def from_name(name):
    if name == "rov-fmu":
        raise PackageNotFoundError(name)
    return find(name)
Distribution.from_name = from_name
"""


def _checkout(folder: Path, missing: str) -> subprocess.CompletedProcess[str]:
    """Run build_fmu.py of a checkout that is not installed, without one of the dependencies."""
    copy = folder / "checkout"
    for name in ("rov_fmu", "fmu_src", "models"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("build_fmu.py", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    hidden = folder / "sitecustomize.py"  # found before others, like any module in PYTHONPATH
    hidden.write_text(_HIDES.format(missing), encoding="utf-8")
    return subprocess.run(
        [sys.executable, str(copy / "build_fmu.py"), "--platform=host", "-o", str(folder / "x.fmu")],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.long
def test_a_checkout_that_is_not_installed_builds_the_same(videoray_fmu: Path, tmp_path: Path) -> None:
    ran = _checkout(tmp_path, "nothing_at_all")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert (tmp_path / "x.fmu").read_bytes() == videoray_fmu.read_bytes()


@pytest.mark.parametrize("missing", ["click", "fat_macho", "pydantic", "matplotlib"])
def test_a_dependency_that_is_not_there_is_named(missing: str, tmp_path: Path) -> None:
    ran = _checkout(tmp_path, missing)
    assert ran.returncode == 1
    assert ran.stdout == ""
    assert ran.stderr == f"rov-fmu: the package {missing} is not installed: pip install -e . (in a checkout)\n"
    assert not (tmp_path / "x.fmu").exists()


# ---- In a notebook ---------------------------------------------------------------------------------------------------


def test_a_build_runs_inside_a_running_loop(tmp_path: Path) -> None:
    async def cell() -> list[str]:
        done: list[str] = []
        built = build(load_vehicle(BARE), tmp_path / "x.fmu", platforms=["host"], on_compiled=done.append)
        assert list(built.binaries) == list(built.seconds) == done
        return done

    assert len(asyncio.run(cell())) == 1
    assert (tmp_path / "x.fmu").is_file()


_CELL = """
import asyncio, sys
from pathlib import Path
from rov_fmu.build import build
from rov_fmu.vehicle.vehicle import load_vehicle

async def cell():
    try:
        build(load_vehicle(Path(sys.argv[2])), Path(sys.argv[1]), platforms=["host"])
    except KeyboardInterrupt:
        print("interrupted")

asyncio.new_event_loop().run_until_complete(cell())
"""


@_posix
def test_an_interrupted_build_in_a_notebook_ends_at_once_and_leaves_nothing(tmp_path: Path) -> None:
    """The compiler never ends by itself; the time limits only end a test that hangs."""
    (tmp_path / "tmp").mkdir()
    environment = os.environ | endless_compiler(tmp_path) | {"TMPDIR": str(tmp_path / "tmp")}
    process = subprocess.Popen(
        [sys.executable, "-c", _CELL, str(tmp_path / "x.fmu"), str(BARE)],
        env=environment,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        # a shell that starts a process in the background makes it ignore interrupts, and children inherit that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
    )
    deadline = time.monotonic() + 300.0
    while not (tmp_path / "number").exists():
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=300)
    assert (process.returncode, out) == (0, "interrupted\n")
    assert list((tmp_path / "tmp").iterdir()) == []
    assert not (tmp_path / "x.fmu").exists()
