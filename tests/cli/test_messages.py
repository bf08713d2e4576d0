"""Mistakes of a user: one line that says what is wrong, what is allowed, and what was probably meant."""

import re
import shlex
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from rov_fmu import InputError, prove_fmu, run_study
from rov_fmu.cli import _commands, main
from rov_fmu.vehicle.shipped import SHIPPED
from tests.commands import ALONE, BARE, TESTS, Capsys


def refusal(arguments: list[str], capsys: Capsys) -> str:
    """Run a command that refuses its arguments, and return its one line on standard error."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    return err.rstrip("\n")


# ---- The command line ------------------------------------------------------------------------------------------------

_SHIPS = "there is no such file, and no vehicle of this name ships, only " + ", ".join(SHIPPED)
_PLATFORMS = "host, linux64, linux32, aarch64-linux, win64, win32, darwin64, aarch64-darwin"
_COMMAND = "must be a number within -1 ... 1 and not 0, a fraction of the full command: 30 % is 0.3"
# What is typed in a folder with the files of `FILES`, and the expected part of the line.
TYPED: dict[str, tuple[str, str]] = {
    "a vehicle misspelt": ("build videorey", f"videorey: {_SHIPS}; did you mean videoray?"),
    "a file misspelt": ("build mime.toml", "mime.toml: there is no such file; did you mean mine.toml?"),
    "no vehicle at all": ("build ''", "VEHICLE is empty: it must be the path of a vehicle file, or the name of"),
    "a folder for a vehicle": ("build .", ".: cannot be read: is a folder, and must be a vehicle file (TOML)"),
    "macos": (
        "build --platform macos",
        f"'--platform': 'macos' must be one of {_PLATFORMS}; did you mean darwin64 or aarch64-darwin?",
    ),
    "no axis": ("tune videoray", "Missing option '--axis'. Choose one of surge, sway, heave, roll, pitch, yaw."),
    "percent": ("tune videoray --axis heave --command 30% --v-ss 0.2", f"'--command': '30%' {_COMMAND}"),
    "a recording for a vehicle": ("fly log.csv", "log.csv: must be a vehicle file (TOML), and not a recording"),
    "an autopilot's log for a ghost": (
        "fly --against d.tlog",
        "and not the log of an autopilot, of ROS or of MATLAB; `rov-fmu inspect` lists what it contains, and",
    ),
    "rov.toml for a vehicle": (
        "build rov.toml",
        "rov.toml: must be a vehicle file (TOML), and not the rov.toml of "
        "a folder of tank tests; `rov-fmu identify FOLDER -o VEHICLE.toml` makes a vehicle file",
    ),
    "a vehicle for a plan": (
        "study mine.toml -o r",
        "mine.toml: must be the plan of a study (TOML), and not "
        "a vehicle file (TOML); `rov-fmu build` makes an FMU of it, and a plan names it",
    ),
    "a vehicle for an FMU": (
        "prove mine.toml",
        "mine.toml: must be an FMU, and not a TOML file; `rov-fmu build` makes an FMU of a vehicle file",
    ),
    "a vehicle for its tests": (
        "identify mine.toml",
        "mine.toml: must be a log, or a folder of tank tests, and not a TOML file",
    ),
    "no tests": ("inspect nowhere.bin", "nowhere.bin: there is no such file and no such folder"),
    "an FMU written to a vehicle file": (
        "build -o mine.toml",
        "mine.toml: would be an FMU, but .toml is the suffix of a TOML file",
    ),
    "Python and a platform": (
        "build --platform host --backend pythonfmu",
        "--platform: the PythonFMU flavour is the same for all platforms",
    ),
    "a draft of before": ("identify . --draft", "identify --draft is gone: use rov-fmu inspect --draft"),
    "a vehicle that is no FMU yet": (
        "prove videoray",
        "videoray: must be an FMU. `rov-fmu build videoray` builds one from the vehicle with this name",
    ),
    "a command alone": ("tune videoray --axis heave --command 1", "tune: give --command and --v-ss (and --tau), or "),
    "Python and FMI 3.0": ("build --fmi 3 --backend=pythonfmu", "--fmi 3: PythonFMU makes FMI 2.0 alone"),
    "no name for the file": ("build -o ''", ".: cannot be written: is a folder"),
}
_PLAN = 'vehicle = "{}"\nstop_time = 1.0\nstep = 0.1\nruns = 2\n[figures]\na = "max(u)"\n'
FILES = {
    "mine.toml": ALONE,
    "plan.toml": _PLAN.format("videoray"),
    "fmu.toml": _PLAN.format("x.fmu").replace("vehicle", "fmu"),
    "rov.toml": (TESTS / "rov.toml").read_text(encoding="utf-8"),
    "log.csv": "time [s],command [%],depth [m]\n0,30,0\n",
    "x.fmu": "no archive",
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with FILES."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("case", TYPED)
def test_a_mistake_on_the_command_line_is_one_line(case: str, here: Path, capsys: Capsys) -> None:
    arguments, expected = TYPED[case]
    assert expected in refusal(shlex.split(arguments), capsys)
    assert {path.name: path.read_text(encoding="utf-8") for path in here.iterdir()} == FILES


LIMITS = {
    "simulate --stop": ("1e-6", "9e-7", "1e300", "inf"),
    "sitl videoray --bottom": ("-1e6", "-1000001", "1e6", "1000001"),
    "sitl videoray --port": ("0", "-1", "65535", "65536"),
    "prove x.fmu --tolerance": ("5e-324", "0", "1e300", "inf"),
    "study plan.toml -o r --workers": ("1", "0", "1024", "1025"),
}
"""For each option, the least value and one below it, the largest value and one above it."""


@pytest.mark.parametrize("words", LIMITS)
def test_numbers_are_accepted_up_to_their_limits(words: str) -> None:
    name, *rest = words.split()
    least, below, largest, above = LIMITS[words]
    for value in (least, largest):
        _commands.commands[name].make_context(name, [*rest, value])
    for value in (below, above):
        with pytest.raises(click.BadParameter, match=f"^{value!r} must be "):
            _commands.commands[name].make_context(name, [*rest, value])


KEYWORDS: dict[str, tuple[Callable[..., object], tuple[object, ...]]] = {
    "workers": (run_study, (0, 1025, 2.5, "2", float("inf"))),
    "part": (run_study, ("0/3", "5/3", 3, "3-64", "1/")),
    "tolerance": (prove_fmu, (0.0, -1.0, float("nan"), "1e-6")),
    "time_limit": (prove_fmu, (0, 1e7, None)),
}
"""Keywords of functions in Python, with values that the option of the same name does not take either."""


@pytest.mark.parametrize("name", KEYWORDS)
def test_a_keyword_takes_what_the_option_of_its_name_takes(name: str) -> None:
    function, wrong = KEYWORDS[name]
    for value in wrong:
        with pytest.raises(InputError, match=rf"^{name} = {re.escape(repr(value))}: must be "):
            function("nowhere.fmu", **({"folder": "r"} if function is run_study else {}), **{name: value})


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is of Linux")
@pytest.mark.parametrize("command", ["build", "fly"])
def test_a_folder_that_takes_no_files_is_refused_before_the_work(command: str, capsys: Capsys) -> None:
    line = refusal([command, str(BARE), "-o", "/proc/x"], capsys)
    assert line == "rov-fmu: /proc/x: cannot be written: no new file can be made in the folder /proc"


# ---- Vehicle files, rov.toml, plans ----------------------------------------------------------------------------------

# A command, what is replaced in the file that it reads, by what, and what the one line says.
BUILD, IDENTIFY, STUDY = "build mine.toml -o new.fmu", "identify tests", "study plan.toml -o r"
KEYS: dict[str, tuple[str, str, str, str]] = {
    "a_tt": (BUILD, "a_t = ", "a_tt = ", "curves.rear.a_tt: there is no such key; did you mean a_t?"),
    "a vehicle in capital letters": (
        IDENTIFY,
        "[vehicle]",
        'base = "VideoRay"\n[vehicle]',
        "base = 'VideoRay': must be a vehicle file in this ",
    ),
    "a key of rov.toml": (
        IDENTIFY,
        "name = ",
        "nmae = ",
        "vehicle.nmae: there is no such key, only name, identifier, version, description, source; did you mean name?",
    ),
    "a vehicle of a plan": (
        STUDY,
        '"videoray"',
        '"BlueROV2"',
        "vehicle = 'BlueROV2': there is no such file beside the plan, ",
    ),
    "a sampler": (STUDY, "runs = 2", 'runs = 2\nsampler = "Sobol"', "sampler = 'Sobol': must be 'grid', 'sobol', "),
}


@pytest.mark.parametrize("case", KEYS)
def test_keys_and_words_of_a_file_are_guessed(case: str, here: Path, capsys: Capsys) -> None:
    command, old, new, expected = KEYS[case]
    if command is STUDY:
        pytest.importorskip("dask")
    shutil.copytree(TESTS, here / "tests")
    file = here / {BUILD: "mine.toml", IDENTIFY: "tests/rov.toml", STUDY: "plan.toml"}[command]
    text = FILES[file.name].replace(old, new, 1)
    assert text != FILES[file.name]
    file.write_text(text, encoding="utf-8")
    line = refusal(shlex.split(command), capsys)
    assert expected in line
    assert "; did you mean " in line


# ---- Tables and logs -------------------------------------------------------------------------------------------------

_ROWS = "".join(f"{n / 10:.1f},30,{n / 100:.2f}\n" for n in range(50))
_LOG = "time [s],command [%],depth [m]\n" + _ROWS
_NAMED = "is not an axis of this vehicle"
# A file of tank tests, and what the one line says of it.
TABLES: dict[str, tuple[str, str, str]] = {
    "a log of no axis": (
        "log_twist_1.csv",
        _LOG,
        f"log_twist_1.csv, line 1: column 'command [%]' is the command of one axis, but twist {_NAMED}: the "
        "name of the file must be log_surge*.csv or log_heave*.csv or log_yaw*.csv",
    ),
    "semicolons below commas": (
        "steady_surge.csv",
        "command [%],velocity [m/s]\n20;30,0.3\n",
        "= '20;30': must be a number; what separates the cells must be the same as in the header",
    ),
    "a table of no axis": ("steady_twist.csv", "", f"steady_twist.csv: twist {_NAMED}, only surge, heave and yaw"),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_wrong_table_is_one_line(case: str, tmp_path: Path, capsys: Capsys) -> None:
    name, text, expected = TABLES[case]
    tests = Path(shutil.copytree(TESTS, tmp_path / "tests"))
    (tests / name).write_text(text, encoding="utf-8")
    assert expected in refusal(["identify", str(tests)], capsys)


# ---- Tuning ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (
            "bluerov2 --axis sway --command 0.15 --v-ss 5",
            ["alpha_v = 107 is not within the usual 0.5 ... 2: the thrust would be 107 times that of the"],
        ),
        (
            "videoray --axis surge --command 0.3 --v-ss 0.5 --tau 500",
            ["beta_u = 0.00114 is not within the usual 0.05 ... 1.2. The vehicle would move as if its inertia were"],
        ),
        ("videoray --axis yaw --command 0.3 --v-ss 1.5 --tau 2", []),
    ],
)
def test_an_implausible_tuning_is_a_warning_with_the_reason(
    arguments: str, expected: list[str], capsys: Capsys
) -> None:
    assert main(["tune", *shlex.split(arguments)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(expected)
    for line, words in zip(lines, expected, strict=True):
        assert line.startswith(f"rov-fmu: warning: {words}")
        assert "Check the wanted" in line


def test_a_command_without_a_vehicle_says_that_it_takes_the_videoray(tmp_path: Path, capsys: Capsys) -> None:
    said = "rov-fmu: no vehicle is given, so this is the VideoRay\n"
    for vehicle in ([], ["videoray"]):
        assert main(["export", *vehicle, "--to", "sdf", "-o", str(tmp_path / f"{len(vehicle)}.sdf")]) == 0
        assert capsys.readouterr().err.count(said) == (not vehicle)
    assert (tmp_path / "0.sdf").read_bytes() == (tmp_path / "1.sdf").read_bytes()
