"""`rov-fmu simulate`: the model without an FMU, from the command line."""

import csv
import sys
import webbrowser
from pathlib import Path

import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.interface.command_files import read_inputs
from tests.commands import BARE
from tests.tank.readers import test_mavlink
from tests.vehicles import VIDEORAY

Capsys = pytest.CaptureFixture[str]
COMMANDS = "time,u_l,u_r\n0,0.3,0.3\n2.25,0.5,0.2\n5,0,0\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a table of commands."""
    monkeypatch.chdir(tmp_path)
    Path("commands.csv").write_text(COMMANDS, encoding="utf-8")
    return tmp_path


def test_the_values_at_the_end_are_printed(capsys: Capsys) -> None:
    assert main(["simulate", "--set", "u_l=0.3", "--set", "u_r = 0.3", "--set", "a_d_u=10", "--set", "z=2"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    expected = rov_fmu.load("videoray").with_(a_d_u=10).simulate([0, 10], {"u_l": 0.3, "u_r": 0.3}, start={"z": 2})
    lines = [line.split() for line in out.splitlines()]
    assert lines[0] == ["VideoRay", "Pro", "4", "after", "10", "s"]
    assert lines[3:] == [
        [name, f"{expected[name][-1]:.6g}", expected.units[name]]
        for name in (*VIDEORAY.layout.state, *VIDEORAY.layout.calculated)
    ]


def test_a_vehicle_that_rolls_begins_at_the_given_angles(capsys: Capsys) -> None:
    angles = {"phi_0": 0.1, "theta_0": 0.2, "psi_0": 7.0}
    settings = [f"--set={name}={value}" for name, value in angles.items()]
    assert main(["simulate", "bluerov2_heavy", *settings, "--stop", "1"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    expected = rov_fmu.load("bluerov2_heavy").simulate([0, 1], start=angles)
    values = {name: value for name, value, *_ in (line.split() for line in out.splitlines()[3:])}
    assert {name: values[name] for name in ("phi", "psi")} == {n: f"{expected[n][-1]:.6g}" for n in ("phi", "psi")}


def test_a_table_of_commands_gives_a_table_of_results(here: Path) -> None:
    """Up to its last time; a command holds from its own time, also between two results."""
    assert main(["simulate", "--input", "commands.csv", "--step", "0.5", "-o", "result.csv"]) == 0
    rows = list(csv.reader((here / "result.csv").read_text(encoding="utf-8").splitlines()))
    result = rov_fmu.load("videoray").simulate(
        [0.5 * n for n in range(11)], {"time": [0, 2.25, 5], "u_l": [0.3, 0.5, 0], "u_r": [0.3, 0.2, 0]}
    )
    assert rows[0] == ["time", *result.names]
    found = [[float(cell) for cell in row] for row in rows[1:]]
    assert found == [list(row) for row in zip(result.time, *result.values(), strict=True)]


LOGS = {
    "percent": ("log.csv", "time [s],u_l [%],u_r [%],surge velocity [m/s]\n5,30,30,0\n7.25,50,20,0.1\n10,0,0,0.2\n"),
    "pulses": ("log.csv", "t;r [us];l [us]\n0;1620;1620\n2250;1580;1700\n5000;1500;1500\n"),
    "aliases": ("log.csv", "sec,left,right\n0,30,30\n2.25,50,20\n5,0,0\n"),
    "one axis": ("log_surge_1.csv", "Time [ms],Command [%],u [cm/s]\n0,30,0\n2250,35,1\n5000,0,2\n"),
}
"""The same commands in logs: the last one has those of surge."""


@pytest.mark.parametrize("name", LOGS)
def test_the_commands_of_a_log_are_read_as_identify_reads_them(name: str, here: Path, capsys: Capsys) -> None:
    file, text = LOGS[name]
    (here / file).write_text(text, encoding="utf-8")
    columns = {"sec": "time [s]", "left": "u_l [%]", "right": "-u_r [%]", "t": "time [ms]"}
    if name in ("pulses", "aliases"):
        of_file = {
            header: meant
            for header, meant in columns.items()
            if header in text.partition("\n")[0].replace(";", ",").split(",")
        }
        lines = "".join(f'"{header}" = "{meant}"\n' for header, meant in of_file.items())
        (here / "rov.toml").write_text(f"[vehicle]\n[columns]\n{lines}", encoding="utf-8")
    assert main(["simulate", "--input", file, "--step", "0.5", "-o", "result.csv"]) == 0
    assert "warning" not in capsys.readouterr().err
    rows = list(csv.reader((here / "result.csv").read_text(encoding="utf-8").splitlines()))
    left, right = ([0.3, 0.35, 0], [0.3, 0.35, 0]) if name == "one axis" else ([0.3, 0.5, 0], [0.3, 0.2, 0])
    sign = -1.0 if name == "aliases" else 1.0
    inputs = {"time": [0, 2.25, 5], "u_l": left, "u_r": [sign * c for c in right]}
    result = rov_fmu.load("videoray").simulate([0.5 * n for n in range(11)], inputs)
    assert [float(cell) for cell in rows[-1]] == pytest.approx([float(v[-1]) for v in (result.time, *result.values())])


@pytest.mark.parametrize(
    ("logs", "header", "u"),
    [
        ("", "[us]", 0.25),
        ("neutral = 1520\nspan = 320", "[us]", 0.25),
        ("neutral = 1480", "[us]", 0.3),
        ("span = 200", "[us]", 0.5),
        ("neutral = 1400\nspan = 200", "[us 1500 400]", 0.25),
    ],
)
def test_rov_toml_tells_the_pulses_of_the_columns(logs: str, header: str, u: float, here: Path) -> None:
    (here / "rov.toml").write_text(f"[vehicle]\n[logs]\n{logs}\n", encoding="utf-8")
    log = here / "log.csv"
    log.write_text(f"time [s],u_t {header},voltage [V]\n0,1600,16\n5,1600,16\n", encoding="utf-8")
    assert read_inputs(log, VIDEORAY.layout)["u_t"].tolist() == pytest.approx([u, u])


@pytest.mark.parametrize("named", ["commands.csv", "depth.csv"])
def test_a_dive_in_several_files_gives_its_commands(named: str, here: Path) -> None:
    (here / "commands.csv").write_text("time [s],u_t [1]\n10,0.5\n12,-0.25\n", encoding="utf-8")
    (here / "depth.csv").write_text("time [s],depth [m]\n10,1\n11,2\n12,3\n", encoding="utf-8")
    files = '[dives.may]\nfiles = ["commands.csv", "depth.csv"]\n'
    (here / "rov.toml").write_text(f"[vehicle]\n{files}", encoding="utf-8")
    found = read_inputs(here / named, VIDEORAY.layout)
    assert found["time"].tolist() == [0.0, 2.0]
    assert found["u_t"].tolist() == [0.5, -0.25]


def test_the_commands_of_an_autopilot_drive_a_simulation(here: Path) -> None:
    test_mavlink.tlog(here / "dive.tlog", test_mavlink.dive())
    assert main(["simulate", "bluerov2", "--input", "dive.tlog", "--step", "1", "-o", "result.csv"]) == 0
    *_, last = csv.DictReader((here / "result.csv").read_text(encoding="utf-8").splitlines())
    half = {f"u_{n}": [0.0, 0.5] for n in (5, 6)}
    result = rov_fmu.load("bluerov2").simulate([0.0, 5.9], {"time": [0.0, 1.0], **half})
    assert float(last["time"]) == pytest.approx(5.9)
    assert float(last["z"]) == pytest.approx(result["z"][-1], rel=1e-3)


@pytest.mark.parametrize(("name", "begins"), [("plot.png", b"\x89PNG"), ("plot.svg", b"<?xml"), ("plot.pdf", b"%PDF")])
def test_a_plot_is_written(name: str, begins: bytes, here: Path, capsys: Capsys) -> None:
    assert main(["simulate", str(BARE), "--plot", name]) == 0
    assert capsys.readouterr() == (f"Wrote {name}. Next: open the plot\n", "")
    assert (here / name).read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("options", "says_so"),
    [([], True), (["--set", "a_d_w=10"], True), (["--set", "u_t=0.3"], False), (["--set", "w=0.3"], False)],
)
def test_a_simulation_without_commands_says_how_to_set_one(options: list[str], says_so: bool, capsys: Capsys) -> None:
    assert main(["simulate", str(BARE), *options]) == 0
    out = capsys.readouterr().out
    assert out.endswith("\nNo command is set: try --set u_t=0.3\n") == says_so
    assert ("No command" in out) == says_so


def test_a_plot_opens_in_a_browser(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda uri: opened.append(uri) or True)  # type: ignore[func-returns-value]
    monkeypatch.setattr("tempfile.tempdir", str(here))
    assert main(["simulate", str(BARE), "--plot"]) == 0
    path = Path(capsys.readouterr().out.strip())
    assert opened == [path.as_uri()]
    assert path.read_bytes().startswith(b"<?xml")


def test_a_command_beyond_full_is_a_warning(capsys: Capsys) -> None:
    assert main(["simulate", str(BARE), "--set", "u_t=1.5"]) == 0
    assert capsys.readouterr().err == "rov-fmu: warning: u_t reaches 1.5, which acts as 1: commands saturate at ±1\n"


WRONG = {
    "unknown vehicle": (["videorey"], "videorey: there is no such file, "),
    "unknown name": (["--set", "ul=1"], "--set ul=1: the vehicle has no such input, state or coefficient; did you"),
    "an output": (["--set", "F_l=3"], "--set F_l=3: F_l is an output, which cannot be set\n"),
    "percent": (["--set", "u_l=30%"], "--set u_l=30%: '30%' must be a finite number: 30 % is 0.3\n"),
    "percent of a length": (["--set", "z=30%"], "--set z=30%: '30%' must be a finite number\n"),
    "no value": (["--set", "u_l"], "'--set': 'u_l' must be NAME=VALUE, such as u_l=0.3"),
    "a word": (["--set", "u_l=a"], "--set u_l=a: 'a' must be a finite number"),
    "NaN": (["--set", "u_l=nan"], "--set u_l=nan: 'nan' must be a finite number"),
    "twice": (["--set", "u_l=1", "--set", "u_l=2"], "--set u_l=2: u_l is set twice"),
    "out of bounds": (["--set", "a_d_u=-1"], "a_d_u = -1.0: must be within 0 ... 1000000 N.s2/m2"),
    "no table": (["--input", "none.csv"], "none.csv: there is no such file\n"),
    "a column of no input": (
        ["--input", "wrong.csv"],
        "wrong.csv, line 1, column 'ul': there is no such input, only u_l",
    ),
    "a cell that is no number": (
        ["--input", "cell.csv"],
        "cell.csv, line 3, column 'u_l' = 'x': must be a finite number\n",
    ),
    "an input twice": (["--input", "commands.csv", "--set", "u_l=1"], "--set u_l: commands.csv has this input, too"),
    "no time": (["--input", "short.csv"], "short.csv: the last time is 0 s, and must be at least 1e-06"),
    "no duration": (["--stop", "0"], "'--stop': '0' must be a number of at least 1e-6 s\n"),
    "a time in words": (["--step", "x"], "'--step': 'x' must be a number of at least 1e-6 s\n"),
    "too many results": (["--step", "1e-6"], "--step 1e-06: gives more than 1000000 results up to 10 s"),
    "a late end": (["--stop", "1e9"], "--stop 1e+09 needs a longer --step than 0.01 s: at least 1000 s\n"),
    "an end that is later still": (["--stop", "1234567"], " at least 1.24 s\n"),
    "a long table": (
        ["--input", "long.csv"],
        "long.csv, up to 20000 s, needs a longer --step than 0.01 s: at least 0",
    ),
    "a time that goes back": (["--input", "back.csv"], "back.csv, line 5: the time goes back\n"),
    "a cell that is not finite": (["--input", "nan.csv"], "nan.csv, line 3, column 'u_l' = 'nan': must be a finite nu"),
    "another table": (["-o", "result.txt"], "--output result.txt: the name must end with .csv, .parquet or .mcap"),
    "another picture": (["--plot", "a.gif"], "--plot a.gif: the name must end with .png, .svg or .pdf\n"),
    "a plot before the vehicle": (["--plot", "videoray"], ".png, .svg or .pdf; put --plot without a file after VEH"),
    "a value after a blank": (["--set", "u_l", "0.3"], "'--set': 'u_l' must be NAME=VALUE, such as u_l=0.3"),
    "a load with a unit": (
        ["--input", "load.csv"],
        "load.csv: column 'X_ext [N]': a log has no such input; a table without units may have",
    ),
    "a log without commands": (["--input", "motion.csv"], "motion.csv: no commands of u_l, u_r, u_t were found"),
    "no folder": (["-o", "none/result.csv"], "none/result.csv: cannot be written: there is no folder none"),
    "its own input": (["--input", "commands.csv", "-o", "commands.csv"], "commands.csv: cannot be written: would"),
    "too fast": (["-o", "a.csv", "--plot", "a.png", "--set", "r=1e300", "--set", "u=1"], "the motion cannot be"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_one_line_and_writes_nothing(case: str, here: Path, capsys: Capsys) -> None:
    (here / "wrong.csv").write_text("time,ul\n0,1\n1,1\n", encoding="utf-8")
    (here / "cell.csv").write_text("time,u_l\n0,1\n1,x\n", encoding="utf-8")
    (here / "back.csv").write_text("time,u_l\n0,1\n\n2,1\n1,1\n", encoding="utf-8")
    (here / "nan.csv").write_text("time,u_l\n0,1\n1,nan\n", encoding="utf-8")
    (here / "long.csv").write_text("time,u_l\n0,1\n20000,1\n", encoding="utf-8")
    (here / "load.csv").write_text("time [s],u_l [%],X_ext [N]\n0,30,1\n1,30,1\n", encoding="utf-8")
    (here / "motion.csv").write_text("time [s],depth [m]\n0,1\n1,1\n", encoding="utf-8")
    (here / "short.csv").write_text("time,u_l\n0,1\n", encoding="utf-8")
    before = {path.name: path.read_bytes() for path in here.iterdir()}
    arguments, expected = WRONG[case]
    assert main(["simulate", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert expected in err
    assert err.startswith("rov-fmu: ")
    assert err.count("\n") == 1
    assert {path.name: path.read_bytes() for path in here.iterdir()} == before


def test_parquet_that_is_not_installed_is_named(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["simulate", str(BARE), "-o", "result.parquet"]) == 2
    expected = "rov-fmu: --output result.parquet: Parquet needs pandas and pyarrow: pip install pandas pyarrow\n"
    assert capsys.readouterr() == ("", expected)
    assert not (here / "result.parquet").exists()
