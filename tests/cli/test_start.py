"""How the command starts: by name, quickly, with shell completion, with progress on a terminal, and not installed."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import click
import pytest
from fmpy import read_model_description

from rov_fmu.bridges.system.companion import COMPANIONS
from rov_fmu.c.compile import PLATFORMS, host_platform
from rov_fmu.cli import _Command, _commands, main
from rov_fmu.equation.catalogue import AXES
from rov_fmu.vehicle.shipped import SHIPPED
from tests.commands import BARE, ROOT, Capsys, python, without_progress
from tests.conftest import without_page
from tests.often import spread

_TUNE = ["tune", "videoray", "--axis=yaw", "--command=0.3", "--v-ss=1", "--tau=2"]

# ---- By name ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", spread(SHIPPED, (), ["videoray"]))
def test_a_vehicle_that_ships_is_built_by_its_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rov_fmu.report.page.fmu_page.inline_svg", lambda *_: "")  # plots take most of the time
    monkeypatch.setattr("rov_fmu.build.reference_results", lambda *_, **__: {})
    assert main(["build", name, "--backend", "pythonfmu"]) == 0
    assert capsys.readouterr().out.startswith(f"{name}-python.fmu: ")
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}-python.fmu"]


def test_an_fmu_of_fmi_3_has_it_in_its_name_and_shows_no_progress_without_a_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    with without_page():
        assert main(["build", str(BARE), "--fmi", "3", "--platform", "host"]) == 0
    out, err = capsys.readouterr()
    assert without_progress(err) == ""
    (path,) = tmp_path.iterdir()
    with zipfile.ZipFile(path) as fmu:
        (library,) = (info for info in fmu.infolist() if re.match("binaries/.*[^/]$", info.filename))
    whole, own = (f"{size / 1000:.0f} kB" for size in (path.stat().st_size, library.file_size))
    expected = (
        rf"bare\.fmi3\.fmu: {whole}, built in \d\d?\.\d s, GUID [-{{}}\w]+\n"
        rf"  {host_platform()} +{own} +\d\d?\.\d s\n.+\nWrote bare\.fmi3\.fmu\. Next: rov-fmu prove bare\.fmi3\.fmu\n"
    )
    assert re.fullmatch(expected, out)
    assert path.name == "bare.fmi3.fmu"
    assert read_model_description(str(path)).fmiVersion == "3.0"


# ---- Quickly ---------------------------------------------------------------------------------------------------------

_SLOW = ("asyncio", "jinja2", "lxml", "matplotlib", "numpy", "pydantic", "rich", "scipy")
"""The packages that take long to import."""
_NEEDED: list[tuple[list[str], set[str]]] = [
    (["--help"], set()),
    (["build", "--help"], set()),
    (["--version"], set()),
    (_TUNE, {"numpy", "pydantic", "rich", "scipy"}),
]
"""The arguments of commands that run one after the other, and the slow packages that are imported at most."""
_IMPORTED = """
import sys
before = set(sys.modules)
from rov_fmu.cli import _Command, _commands, main
for arguments in {!r}:
    try:
        code = main(arguments)
    except SystemExit as end:
        code = end.code
    print(code or 0, *sorted(set(sys.modules) - before), file=sys.stderr)
"""


def test_a_command_imports_what_it_uses() -> None:
    script = _IMPORTED.format([arguments for arguments, _ in _NEEDED])
    ran = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    for (arguments, allowed), line in zip(_NEEDED, without_progress(ran.stderr).splitlines(), strict=True):
        code, *imported = line.split()
        assert code == "0", arguments
        assert "click" in imported
        assert set(imported) & set(_SLOW) <= allowed, arguments


def test_a_vehicle_is_loaded_without_what_takes_long_to_import() -> None:
    script = "import sys, rov_fmu; rov_fmu.load('videoray'); print(*sys.modules)"
    assert {*python("-c", script).split()} & {*_SLOW} == {"pydantic"}


# ---- Help and list ---------------------------------------------------------------------------------------------------


def test_the_help_shows_each_command_in_its_section_with_an_example_that_it_takes(capsys: Capsys) -> None:
    assert main([]) == 0
    printed = capsys.readouterr().out
    sections = ["Options", "What most people do", "Your vehicle", "At work", "For others"]
    assert re.findall(r"^(\S.*):$", printed, re.MULTILINE) == sections
    context = click.Context(_commands, info_name="rov-fmu")
    listed = _commands.list_commands(context)
    assert listed[:3] == ["identify", "fly", "build"]
    assert sorted(listed) == sorted(_commands.commands)
    for name, command in _commands.commands.items():
        assert isinstance(command, _Command), name
        program, own, *arguments = shlex.split(command.example)
        assert (program, own) == ("rov-fmu", name)
        assert command.example in printed
        shown = command.make_context(name, ["--help", *arguments], context, resilient_parsing=True)
        assert f"Example: {command.example}" in command.get_help(shown)
        parsed = command.make_parser(shown).parse_args([*arguments])
        assert len(parsed[1]) <= sum(parameter.param_type_name == "argument" for parameter in command.params)


def test_list_has_vehicles_and_companions_and_says_what_the_files_of_a_folder_are_for(
    tmp_path: Path, capsys: Capsys
) -> None:
    for name in ("dive.bin", "my.fmu", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "prose.log").write_text("one, two\n1, 2\n")
    (tmp_path / "vr.txt").write_text("$PVRND,09/14/2026,10:08:02.0,6.0,0.0,0.3,-0.2*6B\n")
    (tmp_path / "plan.toml").write_text("stop_time = 1.0\n")
    (tmp_path / "rov.toml").write_text("[[thruster]]\n")
    (tmp_path / "broken.toml").write_text("[")
    shutil.copy(BARE, tmp_path / "mine.toml")
    assert main(["list", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    rows = dict(re.split(r"  +", line, maxsplit=1) for line in printed.splitlines() if re.search(r"\S  ", line))
    assert {*SHIPPED, *COMPANIONS} < rows.keys()
    assert "notes.txt" not in printed
    kinds = {name: rows[name].split("  ")[0] for name in rows if "." in name}
    assert kinds == {
        "broken.toml": "a TOML file",
        "dive.bin": "the log of an autopilot, of ROS or of MATLAB",
        "mine.toml": "a vehicle file (TOML)",
        "my.fmu": "an FMU",
        "plan.toml": "the plan of a study (TOML)",
        "rov.toml": "the rov.toml of a folder of tank tests",
        "vr.txt": "an export of VideoRay Cockpit",
    }
    assert "`rov-fmu inspect` lists what it contains" in rows["vr.txt"]
    assert "`rov-fmu study` carries it out" in rows["plan.toml"]
    assert main(["list", str(tmp_path / "notes.txt")]) == 2
    assert "must be a folder; `rov-fmu inspect` lists what a log contains" in capsys.readouterr().err


# ---- Completion ------------------------------------------------------------------------------------------------------


COMMANDS = [
    *("identify", "fly", "build"),
    *("inspect", "tune", "simulate", "list"),
    *("sitl", "system", "study"),
    *("export", "prove", "schema"),
]


@pytest.mark.parametrize(
    ("words", "completions"),
    [
        ("", COMMANDS),
        ("build video", ["file,video", "videoray", "videoray_refit"]),
        ("tune ./my", ["file,./my"]),
        ("build --platform ", ["host", *PLATFORMS]),
        ("build --fmi ", ["2", "3"]),
        ("tune videoray --axis ", [*AXES]),
    ],
)
def test_the_shell_completes_commands_vehicles_platforms_and_axes(
    words: str, completions: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.setenv("_ROV_FMU_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", f"rov-fmu {words}")
    monkeypatch.setenv("COMP_CWORD", str(words.count(" ") + 1))
    with pytest.raises(SystemExit, match=r"^0$"):
        main([])
    out, err = capsys.readouterr()
    assert err == ""
    assert out.replace("plain,", "").splitlines() == completions


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
    told = "rov-fmu: no vehicle is given, so this is the VideoRay\n"
    assert (ran.returncode, without_progress(ran.stderr)) == (0, told)
    assert (tmp_path / "x.fmu").read_bytes() == videoray_fmu.read_bytes()


@pytest.mark.parametrize("missing", spread(["click", "matplotlib"], ["matplotlib"], ["click"]))
def test_a_dependency_that_is_not_there_is_named(missing: str, tmp_path: Path) -> None:
    ran = _checkout(tmp_path, missing)
    assert ran.returncode == 1
    assert ran.stdout == ""
    assert ran.stderr == f"rov-fmu: the package {missing} is not installed: pip install -e . (in a checkout)\n"
    assert not (tmp_path / "x.fmu").exists()
