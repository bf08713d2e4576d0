"""`rov-fmu simulate`: the model without an FMU, from the command line."""

import csv
import re
import shlex
import shutil
import webbrowser
from pathlib import Path

import pandas as pd
import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.interface.command_files import read_inputs
from rov_fmu.interface.simulate_command import read_settings
from rov_fmu.io.messages import FileError, InputError
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import BARE, Capsys
from tests.often import spread
from tests.vehicles import EVERYTHING, THRUST_EFFECTS, VIDEORAY

COMMANDS = "time [s],u_l,u_r\n0,0.3,0.3\n2.25,0.5,0.2\n5,0,0\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a table of commands."""
    monkeypatch.chdir(tmp_path)
    Path("commands.csv").write_text(COMMANDS, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", spread(SHIPPED, ["videoray", "bluerov2_heavy"]))
def test_every_state_and_angle_can_be_set_at_the_start(name: str) -> None:
    """Those of the attitude under the names that the results have; the quaternion as a whole."""
    vehicle = rov_fmu.load(name)
    angles = [name.removesuffix("_0") for name in vehicle.layout.initial]
    states = [one for one in vehicle.layout.state if one not in QUATERNION]
    for state in (*states, *angles):
        start = read_settings([f"{state}=0.25"], vehicle.layout).start
        assert vehicle.simulate([0.0, 0.001], start=start)[state][0] == pytest.approx(0.25, rel=1e-14)
        assert vehicle.simulate([0.0, 0.001], start={state: 0.25})[state][0] == pytest.approx(0.25, rel=1e-14)
    for state in angles:
        with pytest.raises(InputError, match=rf"^--set {state}_0=1: {state}_0 is set twice$"):
            read_settings([f"{state}=1", f"{state}_0=1"], vehicle.layout)
        with pytest.raises(InputError, match=rf"^start\['{state}_0'\]: {state}_0 is given, too, which is the same$"):
            vehicle.simulate(1.0, start={state: 1.0, f"{state}_0": 1.0})


def test_a_vehicle_that_nothing_moves_is_said_to_need_a_command(capsys: Capsys) -> None:
    assert main(["simulate", "videoray", "--set", "m_rov=7"]) == 0
    out, err = capsys.readouterr()
    assert (out.splitlines()[-1], err) == ("No command is set: try --set u_l=0.3", "")


def test_a_table_of_commands_gives_a_table_of_results(here: Path, capsys: Capsys) -> None:
    """Up to its last time; a command holds from its own time, also between two results."""
    arguments = ["simulate", "--input", "commands.csv", "--step", "0.5"]
    assert main(arguments) == 0
    assert "No command" not in capsys.readouterr().out
    assert main([*arguments, "-o", "result.parquet"]) == 0
    assert main([*arguments, "-o", "result.csv"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"Wrote result.{suffix}. Next: add --plot to see the curves" for suffix in ("parquet", "csv")
    ]
    rows = list(csv.reader((here / "result.csv").read_text(encoding="utf-8").splitlines()))
    result = rov_fmu.load("videoray").simulate(
        [0.5 * n for n in range(11)], {"time": [0, 2.25, 5], "u_l": [0.3, 0.5, 0], "u_r": [0.3, 0.2, 0]}
    )
    assert rows[0] == ["time", *result.names]
    found = [[float(cell) for cell in row] for row in rows[1:]]
    assert found == [list(row) for row in zip(result.time, *result.values(), strict=True)]
    parquet = pd.read_parquet("result.parquet")
    assert [[*parquet], *parquet.to_numpy().tolist()] == [rows[0], *found]


LOGS = {
    "log_percent.csv": "time [s],u_l [%],u_r [%],surge velocity [m/s]\n5,30,30,0\n7.25,50,20,0.1\n10,0,0,0.2\n",
    "log_pulses.csv": "t;r [us];l [us]\n0;1620;1620\n2250;1580;1700\n5000;1500;1500\n",
    "log_aliases.csv": "sec,left,right\n0,30,-30\n2.25,50,-20\n5,0,0\n",
    "log_surge_1.csv": "Time [ms],Command [%],u [cm/s]\n0,30,0\n2250,35,1\n5000,0,2\n",
}
"""The same commands in logs: the last one has those of surge."""
COLUMNS = {
    "log_pulses.csv": '"t" = "time [ms]"\n',
    "log_aliases.csv": '"sec" = "time [s]"\n"left" = "u_l [%]"\n"right" = "-u_r [%]"\n',
}
"""What rov.toml tells of their headers."""


@pytest.mark.parametrize("name", LOGS)
def test_the_commands_of_a_log_are_read_as_identify_reads_them(name: str, here: Path) -> None:
    (here / name).write_text(LOGS[name], encoding="utf-8")
    if name in COLUMNS:
        (here / "rov.toml").write_text(f"[vehicle]\n[columns]\n{COLUMNS[name]}", encoding="utf-8")
    found = read_inputs(here / name, VIDEORAY.layout)
    assert found["time"].tolist() == pytest.approx([0.0, 2.25, 5.0]), "a log begins at 0 s"
    left, right = (0.35, 0.35) if name == "log_surge_1.csv" else (0.5, 0.2)
    assert found["u_l"].tolist() == pytest.approx([0.3, left, 0.0])
    assert found["u_r"].tolist() == pytest.approx([0.3, right, 0.0])


def test_a_log_has_the_voltage_and_no_commands_of_mixed_thrusters(here: Path) -> None:
    rov, mixed = load_vehicle(THRUST_EFFECTS).layout, load_vehicle(EVERYTHING).layout
    titles = ",".join(f"{name} [%]" for name in rov.commands)
    rows = "".join(f"{t},{','.join(['20'] * len(rov.commands))},{volts}\n" for t, volts in ((1, 15), (2, ""), (3, 14)))
    (here / "dive.csv").write_text(f"time [s],{titles},voltage [V]\n{rows}", encoding="utf-8")
    found = read_inputs(here / "dive.csv", rov)
    assert found["voltage"].tolist() == [15.0, 15.0, 14.0]
    (here / "dive.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(FileError, match=rf"commands of thrusters, but those of .* are {', '.join(mixed.commands)}$"):
        read_inputs(here / "dive.mcap", mixed)


@pytest.mark.parametrize(("name", "begins"), [("plot.png", b"\x89PNG"), ("plot.svg", b"<?xml"), ("plot.pdf", b"%PDF")])
def test_a_plot_is_written(name: str, begins: bytes, here: Path, capsys: Capsys) -> None:
    assert main(["simulate", str(BARE), "--plot", name]) == 0
    assert capsys.readouterr() == (f"Wrote {name}. Next: open the plot\n", "")
    assert (here / name).read_bytes().startswith(begins)


SEEN = {
    f"simulate '{BARE}' --plot": "Bare: no commands",
    f"fly '{BARE}' --against bare.toml": f"Bare ({BARE}) beside Bare (bare.toml)",
    f"fly '{BARE}' --against twin.toml": "Bare (bare.toml) beside Bare (twin.toml)",
}


@pytest.mark.parametrize("command", SEEN)
@pytest.mark.parametrize("opens", [True, False])
def test_what_is_to_be_seen_opens_in_a_browser(
    command: str, opens: bool, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    opened: list[str] = []
    for name in ("bare.toml", "twin.toml"):
        shutil.copy(BARE, here / name)

    def browse(address: str) -> bool:
        opened.append(address)
        return opens

    monkeypatch.setattr(webbrowser, "open", browse)
    monkeypatch.setattr("tempfile.tempdir", str(here))
    assert main(shlex.split(command)) == 0
    out, err = capsys.readouterr()
    path = Path(out.splitlines()[0])
    assert opened == [path.as_uri()]
    assert SEEN[command] in path.read_text(encoding="utf-8")
    assert err.count("\n") == (not opens)
    assert err.startswith("" if opens else "rov-fmu: no browser could be opened. Open this file in a browser, ")


WRONG = {
    "unknown name": (
        "--set ul=1",
        "--set ul=1: the vehicle has no such input, axis, state or coefficient, only surge, ",
    ),
    "an output": ("--set F_l=3", "--set F_l=3: F_l is an output, which cannot be set\n"),
    "percent": ("--set u_l=30%", "--set u_l=30%: '30%' must be a finite number: 30 % is 0.3\n"),
    "no value": ("--set u_l", "'--set': 'u_l' must be NAME=VALUE, such as u_l=0.3"),
    "percent of no fraction": ("--set m_rov=5%", "--set m_rov=5%: '5%' must be a finite number\n"),
    "percent in words": ("--set u_l=x%", "--set u_l=x%: 'x%' must be a finite number\n"),
    "a table and an option": ("--input commands.csv --set u_l=1", "--set u_l: commands.csv has this input, too\n"),
    "twice": ("--set u_l=1 --set u_l=2", "--set u_l=2: u_l is set twice"),
    "a column of no input": (
        "--input wrong.csv",
        "wrong.csv, line 1, column 'ul': there is no such input, only u_l",
    ),
    "a cell that is no number": (
        "--input cell.csv",
        "cell.csv, line 3, column 'u_l' = 'x': must be a finite number\n",
    ),
    "no time": ("--input short.csv", "short.csv: the last time is 0 s, and must be at least 1e-06"),
    "too many results": ("--step 1e-6", "--step 1e-06: gives more than 1000000 results up to 10 s"),
    "a late table": (
        "--input late.csv",
        "late.csv, up to 1e+09 s, needs a longer --step than 0.01 s: at least 1000 s\n",
    ),
    "a time that goes back": ("--input back.csv", "back.csv, line 5: the time goes back\n"),
    "another table": ("-o result.txt", "--output result.txt: the name must end with .csv or .parquet"),
    "a plot before the vehicle": ("--plot videoray", ".png, .svg or .pdf; put --plot without a file after VEH"),
    "a load with a unit": (
        "--input load.csv",
        "load.csv: column 'X_ext [N]': a log has no such input; a table without units may have",
    ),
    "a log without commands": ("--input motion.csv", "motion.csv: no commands of u_l, u_r, u_t were found"),
    "its own input": ("--input commands.csv -o commands.csv", "commands.csv: cannot be written: would"),
}


TABLES = {
    "wrong.csv": "time,ul\n0,1\n1,1\n",
    "cell.csv": "time,u_l\n0,1\n1,x\n",
    "back.csv": "time,u_l\n0,1\n\n2,1\n1,1\n",
    "load.csv": "time [s],u_l [%],X_ext [N]\n0,30,1\n1,30,1\n",
    "motion.csv": "time [s],depth [m]\n0,1\n1,1\n",
    "short.csv": "time,u_l\n0,1\n",
    "late.csv": "time,u_l\n0,1\n1e9,1\n",
}


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_one_line_and_writes_nothing(case: str, here: Path, capsys: Capsys) -> None:
    for name, text in TABLES.items():
        (here / name).write_text(text, encoding="utf-8")
    before = {path.name: path.read_bytes() for path in here.iterdir()}
    arguments, expected = WRONG[case]
    assert main(["simulate", *shlex.split(arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(f"rov-fmu: .*{re.escape(expected)}.*\n?", err)
    assert {path.name: path.read_bytes() for path in here.iterdir()} == before
