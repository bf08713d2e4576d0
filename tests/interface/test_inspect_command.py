"""`rov-fmu inspect`: what logs contain, what no fit can learn from them, and a draft with which they are read."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
import tomlkit
from lxml import html

from rov_fmu.cli import main
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.inspection.inspected import inspect_logs
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import VehicleFileError
from tests.folders import VECTORED
from tests.report.pages import check_refers_to_itself_alone
from tests.tank.logs import commanded, measured
from tests.tank.readers import motion
from tests.tank.readers.motion import DIVE, TIME
from tests.tank.readers.writers import LOGS, Ros, parameter, servos, table, write_tlog

Capsys = pytest.CaptureFixture[str]

DEPTH: Array = motion.DEPTH


def three_files(folder: Path) -> Path:
    """Write commands, a depth and a heading of a sensor whose clock begins at 0."""
    names = [f"thruster{n} (us)" for n in range(1, 7)]
    table(folder / "out.csv", ",".join(["time [s]", *names]), TIME + 99.0, *(1500 + 400 * c for c in THRUSTERS))
    table(folder / "bar30.csv", "t,Depth (m),Voltage", TIME + 99.0, DEPTH, motion.VOLTAGE)
    table(folder / "imu.csv", "Time(ms),yaw,temperature", 1000.0 * TIME, np.degrees(motion.HEADING), TIME)
    return folder


def one_file(folder: Path) -> Path:
    titles = ["time [s]", *(f"u_{name} [%]" for name in motion.THRUSTERS), "depth [m]", "roll [deg]"]
    table(folder / "log_a.csv", ",".join(titles), TIME, *(100 * c for c in THRUSTERS), DEPTH, np.degrees(motion.ROLL))
    return folder / "log_a.csv"


THRUSTERS = [*motion.THRUSTERS.values()]


def of_format(suffix: str) -> Callable[[Path], object]:
    return lambda folder: LOGS[suffix](folder, DIVE)


ALL = {"surge", "sway", "heave", "yaw"}
FILES: dict[str, tuple[Callable[[Path], object], set[str]]] = {
    **{suffix: (of_format(suffix), ALL) for suffix in LOGS},
    "three files": (three_files, {"heave", "yaw"}),
    "one file": (one_file, {"heave"}),
}


Inspect = Callable[..., tuple[str, str]]


@pytest.fixture
def inspect(tmp_path: Path, capsys: Capsys) -> Inspect:
    """A function that inspects logs, and returns what is printed and the draft of rov.toml."""

    def inspected(path: Path = tmp_path, option: str = "--draft") -> tuple[str, str]:
        assert main(["inspect", *[option] * bool(option), str(path)]) == 0
        draft = tmp_path / "rov.toml"
        return capsys.readouterr().out, draft.read_text(encoding="utf-8") if draft.exists() else ""

    return inspected


def parsed(draft: str) -> dict[str, Any]:
    """Return the content of a draft."""
    return tomlkit.parse(draft).unwrap()


def weigh(folder: Path) -> None:
    """Complete a draft with what only the owner of the vehicle can tell."""
    path = folder / "rov.toml"
    draft = path.read_text(encoding="utf-8")
    path.write_text(draft.replace('\nm_rov = { value = "?"', "\nm_rov = { value = 12"), encoding="utf-8")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if name in (".bag", ".db3") else ()) for name in FILES]
)
def test_a_log_is_read_with_its_draft_and_a_mass(name: str, tmp_path: Path, inspect: Inspect) -> None:
    write, axes = FILES[name]
    write(tmp_path)
    out, draft = inspect()
    assert out.endswith(f"Wrote {tmp_path / 'rov.toml'}. Next: edit this draft, then rov-fmu identify {tmp_path}\n")
    assert 'base = "bluerov2"' in draft
    with pytest.raises(VehicleFileError, match=r"known\.m_rov\.value = '\?': must be a number$"):
        load_tests(tmp_path)
    weigh(tmp_path)
    tests = load_tests(tmp_path)
    assert tests.vehicle["m_rov"] == 12.0
    assert axes <= {*tests.logged}
    (log,) = tests.folder.logs
    assert measured(log, "depth") == pytest.approx(DEPTH, abs=1e-5)
    assert commanded(log, "6") == pytest.approx(motion.THRUSTERS["6"], abs=2e-3)
    if name == ".ulg":
        assert [line for line in draft.splitlines() if "cpuload" in line] == ['# "cpuload.load" = "?"   # always 0.5']
    if name == "three files":
        assert "aligned clock" in {finding.kind for finding in log.findings}
        assert measured(log, "voltage") == pytest.approx(motion.VOLTAGE, abs=1e-6)


def test_samples_rates_ranges_gaps_and_what_is_not_recognised(tmp_path: Path, inspect: Inspect) -> None:
    there = (TIME < 3.95) | (TIME > 7.95)
    columns = [TIME, np.where(TIME > 1.0, 30.0, 0.0), DEPTH, TIME, 16.0 + TIME, TIME, TIME]
    table(
        tmp_path / "log_heave.csv",
        "time [s],command [%],depth [m],Lux,voltage [V],note,note",
        *(c[there] for c in columns),
    )
    out, draft = inspect(tmp_path / "log_heave.csv")
    rows = {line.split("  ")[0]: line.split() for line in out.splitlines() if line}
    assert rows["command"][1:] == [
        "1",
        "60",
        "10",
        "0",
        "0.3",
        "▁▁▁▆█████████",
        "███████",
        "4.1",
        "s",
        "at",
        "3.9",
        "s",
    ]
    assert rows["depth"][1:6] == ["m", "60", "10", "1", "1.99"]
    assert rows["voltage"][1:6] == ["V", "60", "10", "16", "25.9"]
    assert "\n# voltage = true\n" in draft
    assert "attitude" not in draft, "there is no roll or pitch"
    assert {"- Lux: 0 to 9.9", "- note"} <= rows.keys()
    assert '# "Lux" = "?"   # 0 to 9.9' in draft.splitlines(), "nothing suggests what it stands for"


def test_a_rov_toml_tells_the_names_of_thrusters_and_columns(tmp_path: Path, inspect: Inspect) -> None:
    titles = "time [s],fore [%],aft [%],sonde [m],battery [%]"
    table(tmp_path / "log_dive.csv", titles, TIME, 100 * THRUSTERS[0], 100 * THRUSTERS[1], DEPTH, TIME)
    out, draft = inspect()
    assert 'name = "fore"' in draft, "a column in percent is a command"
    assert "- battery [%]: 0 to 9.9" not in out.split("Not recognised")[0]
    thrusters = "".join(
        f'[[thruster]]\nname = "{name}"\ncurve = "t"\ndirection = {{ value = [0, 0, 1], source = "CAD" }}\n'
        for name in ("fore", "aft")
    )
    own = f'[columns]\n"sonde [m]" = "depth [m]"\n[curves.t]\ntogether = 2\n{thrusters}[axes.heave]\n'
    (tmp_path / "rov.toml").write_text(own, encoding="utf-8")
    out, draft = inspect()
    rows = {line.split("  ")[0] for line in out.splitlines()}
    assert {"thruster fore", "thruster aft", "depth", "- battery [%]: 0 to 9.9"} <= rows
    assert "- sonde [m]" not in rows
    assert draft.startswith(own.strip()), "what was there stays as it is"
    assert parsed(draft)["vehicle"]["identifier"]
    assert f"Wrote {tmp_path / 'rov.toml'}. Next: rov-fmu identify {tmp_path}" in out


def test_the_draft_for_a_vehicle_of_ones_own_lacks_only_its_hardware(
    tmp_path: Path, inspect: Inspect, capsys: Capsys
) -> None:
    """Columns have the names that their user chose, and the name of the file is no name of a test."""
    titles = "time [s],bow [%],stern [%],vertical speed [cm/s],sonar range [m/s],turn rate [deg/s],set heading [deg]"
    log = tmp_path / "dive 7.csv"
    table(log, titles, TIME, 100 * THRUSTERS[0], 100 * THRUSTERS[1], 100 * DEPTH, DEPTH, TIME, TIME)
    _, text = inspect(log)
    assert '"vertical speed [cm/s]" = "heave velocity [cm/s]"' in text
    assert '"turn rate [deg/s]" = "yaw velocity [deg/s]"' in text
    assert '# "sonar range [m/s]" = "?"' in text
    assert '# "set heading [deg]" = "?"' in text
    assert main(["identify", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "body.m_rov.value = '?': must be a number" in told
    assert "thruster.bow.direction.value" in told
    assert "(and in 5 more entries)" in told, "each mistake of all thrusters is one line"
    text = text.replace('direction = { value = ["?", "?", "?"]', "direction = { value = [0, 0, 1]")
    text = text.replace('["?", "?", "?"]', "[0, 0, 0]").replace('"?"', "9.0")
    text = text.replace("[axes.yaw]", "")  # its column may stay
    thrust = "".join(f'{key}_all = {{ value = 10.0, unit = "N", source = "Guessed" }}\n' for key in ("a_t", "b_t"))
    (tmp_path / "rov.toml").write_text(f"{text}\n[known]\n{thrust}", encoding="utf-8")
    assert [*load_tests(tmp_path).vehicle.layout.by_name] == ["heave"]


def test_a_log_in_another_language_lacks_only_what_units_do_not_tell(tmp_path: Path, inspect: Inspect) -> None:
    """The column that only rises is the time, although its numbers of ten digits differ little."""
    start = 1732712345.25
    tables: dict[str, list[Array]] = {
        "dive.csv": [TIME + start, 100.0 * THRUSTERS[0], 100.0 * THRUSTERS[1], TIME + start, DEPTH],
        "short.csv": [TIME[:9], TIME[:9], TIME[:9], TIME[:9] + start, DEPTH[:9]],
    }
    for name, columns in tables.items():
        table(tmp_path / name, "Stempel,Bug %,Heck (%),Zweite Uhr,Tiefe (m)", *columns)
    out, draft = inspect(tmp_path / "dive.csv")
    assert "- Zweite Uhr: 1732712345 to 1732712355" in out
    assert "always" not in out
    assert parsed(draft)["columns"] == {"Bug %": "u_Bug [%]", "Heck (%)": "u_Heck [%]", "Stempel": "time [s]"}
    assert 'name = "Bug"' in draft
    assert "Stempel" not in out.partition("Notes:")[0], "what is taken as the time is recognised"
    (tmp_path / "rov.toml").unlink()
    assert "Stempel is taken" not in inspect(tmp_path / "short.csv")[0], "commands may rise in so short a table"


BOLLARD = "Befehl (%),Zug (kgf)\n-50,-1\n50,2\n"


@pytest.mark.parametrize(
    ("text", "name", "columns"),
    [
        (BOLLARD, "thrust_<curve>", {"Befehl (%)": "command [%]", "Zug (kgf)": "force [kgf]"}),
        (
            BOLLARD.replace("kgf", "deg/s"),
            "steady_<axis>",
            {"Befehl (%)": "command [%]", "Zug (deg/s)": "velocity [deg/s]"},
        ),
        ("command [%],Tau (ms)\n50,900\n", "time_constant_<axis>", {"Tau (ms)": "time constant [ms]"}),
        (BOLLARD.replace("-1", "1"), "", None),
        ("Befehl (%),Zug (kgf),Druck (N)\n50,1,2\n", "", None),
    ],
)
def test_a_table_of_any_name_is_recognised_by_its_units_and_told_its_name(
    text: str, name: str, columns: Mapping[str, str] | None, tmp_path: Path, inspect: Inspect
) -> None:
    """With its draft, too. Not if it has two columns of forces, or a force against its command."""
    (tmp_path / "pool.csv").write_text(text, encoding="utf-8")
    for _ in range(2):
        out, draft = inspect()
        assert (f": name it {name}.csv" in out) == bool(name)
        assert bool(re.search("(then|Next:) rename the tables, then rov-fmu", out)) == bool(name)
        assert ("Not enough is recognised" in out) == (not name)
        assert "Not recognised" not in out or not name
    if columns:
        assert parsed(draft)["columns"] == columns


@pytest.mark.parametrize(
    ("titles", "base"),
    [
        ([f"T{n}" for n in range(1, 7)], "bluerov2"),
        ([f"servo{n}_raw" for n in range(1, 7)], "bluerov2"),
        ([f"motor_{n} [us]" for n in range(6, 0, -1)], "bluerov2"),
        (["H1", "H2", "H3", "H4", "V1", "V2"], ""),
        ([f"Leg{n} (mbar)" for n in range(1, 7)], "?"),
        ([f"RC{n}" for n in range(1, 7)], "?"),
        (["T1"], "?"),
    ],
)
def test_pulses_that_rest_at_1500_are_commands(titles: list[str], base: str, tmp_path: Path, inspect: Inspect) -> None:
    """A vehicle that ships is the base where the names are numbers; each number is that of its thruster."""
    pulses = [np.where(TIME < 6.0, 1500.0, 1500.0 + 400.0 * c) for c in THRUSTERS[: len(titles)]]
    table(tmp_path / "dive.csv", ",".join(["time [s]", *titles, "depth [m]"]), TIME, *pulses, DEPTH)
    _, text = inspect()
    assert [*re.findall(r'^base = "(.*)"', text, re.M)] == [base] * bool(base)
    assert ("These logs do not tell which thrusters" in text) == (base == "?")
    if base == "bluerov2":
        assert all(f'"{title}" = "u_{re.sub("[^0-9]", "", title)} [us]"' in text for title in titles)


def test_outputs_that_never_change_drive_no_thruster(tmp_path: Path, inspect: Inspect) -> None:
    """The vehicle of a telemetry log with eight outputs has six thrusters."""
    pulses = [*(1500 + 400 * c for c in THRUSTERS), np.full(len(TIME), 1500), np.full(len(TIME), 1100)]
    messages = [servos(100.0 + time, *map(round, row)) for time, row in zip(TIME, np.transpose(pulses), strict=True)]
    write_tlog(tmp_path / "dive.tlog", messages)
    out, draft = inspect()
    assert 'base = "bluerov2"\n' in draft
    assert "thruster 8" in out


@pytest.mark.parametrize(("frame", "base"), [(0, ""), (1, "bluerov2")])
def test_the_frame_of_the_autopilot_tells_the_base(frame: int, base: str, tmp_path: Path, inspect: Inspect) -> None:
    """A BlueROV1 has six thrusters, too, and is no BlueROV2."""
    messages = [parameter("FRAME_CONFIG", frame)]
    pulses = np.transpose([1500 + 400 * c for c in THRUSTERS])
    messages += [servos(100.0 + time, *map(round, row)) for time, row in zip(TIME, pulses, strict=True)]
    write_tlog(tmp_path / "dive.tlog", messages)
    assert parsed(inspect()[1]).get("base", "") == base
    (tmp_path / "rov.toml").unlink()
    if base:
        reason = inspect_logs([tmp_path / "dive.tlog"]).draft_for(None).reason
        assert reason == "the log has FRAME_CONFIG 1 (vectored)"


def test_what_is_used_is_not_called_unrecognised(tmp_path: Path, inspect: Inspect) -> None:
    """Flags of validity, and all topics of commands, where each thruster has its own."""
    titles = ",".join(["time [s]", *(f"u_{n} [1]" for n in motion.THRUSTERS), "depth [m]", "depth_valid"])
    table(tmp_path / "a.csv", titles, TIME, *THRUSTERS, DEPTH, np.where(TIME < 5.0, 1.0, 0.0))
    ros = Ros(2)
    number = ros.store.types["std_msgs/msg/Float64"]
    topics = {**{f"/thruster_{n}/input": own for n, own in motion.THRUSTERS.items()}, "/depth": DEPTH}
    messages = [(name, TIME[n], number(data=v)) for name, own in topics.items() for n, v in enumerate(own)]
    for path in tmp_path / "a.csv", ros.write(tmp_path / "b", messages):
        out, _ = inspect(path)
        assert "Not recognised" not in out
        assert "thruster 6" in out
        assert "the log has the vehicles" not in out


OWN: dict[str, str | bytes] = {
    "thrust_main_1.csv": "Command (%),Pull (N)\n50,9\n",
    "thrust_main_2.csv": "Command (%),Pull (N)\n50,8\n",
    "thrust_vert.csv": "Throttle (1),force [N],Battery\n0.5,9,16\n",
    "thrust_side.csv": b"\xff\xfe\xb5",
    "Steady_yaw.csv": "command [%],turning speed (deg/s)\n50,30\n",
    "time_constant_yaw.csv": "command [%],Tau (s),Pull (kg)\n50,1,2\n",
}
"""Tables with the headers of their owner."""


def pool_run(folder: Path, tables: Mapping[str, str | bytes]) -> list[str]:
    """Write tables and a log of two thrusters; return the lines of the draft."""
    for name, text in tables.items():
        (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    pulses = [np.where(TIME < 2.0, 1500.0, 1500.0 + 400.0 * c) for c in THRUSTERS[:2]]
    titles = "time [s],thr_FS_pwm,thr_FP_pwm,Compass (deg),Gyro_Z (deg/s)"
    table(folder / "pool.csv", titles, TIME, *pulses, TIME, TIME)
    assert main(["inspect", "--draft", str(folder)]) == 0
    return (folder / "rov.toml").read_text(encoding="utf-8").splitlines()


def test_the_draft_has_the_curves_and_headers_of_the_tables(tmp_path: Path, capsys: Capsys) -> None:
    lines = pool_run(tmp_path, OWN)
    document = parsed("\n".join(lines))
    assert [*document["curves"]] == ["main", "side", "vert"]
    assert "dives" not in document, "tables have no times"
    assert lines.count('curve = "?"   # main or side or vert') == 2
    assert document["columns"] == {
        "turning speed (deg/s)": "velocity [deg/s]",
        "Command (%)": "command [%]",
        "Pull (N)": "force [N]",
        "Throttle (1)": "command [1]",
        "Tau (s)": "time constant [s]",
        "thr_FS_pwm": "u_FS [us]",
        "thr_FP_pwm": "u_FP [us]",
        "Compass (deg)": "heading [deg]",
        "Gyro_Z (deg/s)": "yaw velocity [deg/s]",
    }
    assert {'# "Battery" = "?"', '# "Pull (kg)" = "?"', "[axes.yaw]"} <= {*lines}
    for name in ("thrust_side.csv", "thrust_vert.csv", "time_constant_yaw.csv"):
        (tmp_path / name).unlink()
    assert main(["identify", str(tmp_path)]) == 2
    told = capsys.readouterr().err.splitlines()
    assert all(f"{tmp_path / 'rov.toml'}: " in line for line in told), "its tables are read with the draft as it is"


MAKER = "PWM (µs),RPM,Power (W),Force (Kg f)\n1100,3000,400,-4\n1500,0,0,0\n1900,3000,400,5\n"
"""A table as a maker publishes it."""
TABLES = {
    "thrust_t200.csv": (MAKER, ["force", "N", "3", "-", "-39.23", "49.03"]),
    "steady_yaw.csv": (
        "command [us],velocity [deg/s]\n1100,-40\n1900,50\n",
        ["velocity", "deg/s", "2", "-", "-40", "50"],
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_alone_are_listed_as_they_will_be_read(name: str, tmp_path: Path, inspect: Inspect) -> None:
    text, row = TABLES[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    for path in (tmp_path, tmp_path / name):  # without rov.toml, and with its draft
        out, draft = inspect(path)
        rows = [re.split(" {2,}", line.strip()) for line in out.splitlines()]
        assert ["command", "1", row[2], "-", "-1", "1"] in rows
        assert row in rows
        if text is MAKER:
            assert {"- RPM: 0 to 3000", "- PWM (µs) is taken as command [µs]"} <= {*out.splitlines()}
    columns = {"PWM (µs)": "command [µs]", "Force (Kg f)": "force [Kgf]"} if text is MAKER else {}
    assert parsed(draft).get("columns", {}) == columns


@pytest.mark.parametrize(("tables", "curve"), [({"thrust_main.csv": OWN["thrust_main_1.csv"]}, "main"), ({}, "all")])
def test_thrusters_of_one_kind_have_its_curve(tables: Mapping[str, str | bytes], curve: str, tmp_path: Path) -> None:
    lines = pool_run(tmp_path, tables)
    assert f"[curves.{curve}]   # thrust_{curve}.csv has the forces of one thruster" in lines
    assert lines.count(f'curve = "{curve}"') == 2


def test_thousands_of_columns_take_seconds_and_are_not_all_shown(tmp_path: Path, inspect: Inspect) -> None:
    """If each header were compared with all others, it would take minutes."""
    start = process_time()
    titles = ["time [s]", "depth [m]", *(f"x{n}" for n in range(2500))]
    table(tmp_path / "log.csv", ",".join(titles), *(DEPTH[:3] for _ in titles))
    shown = inspect()
    assert process_time() - start < 20.0
    assert "depth" in shown[0]
    for text in shown:
        assert "2400 more" in text
        assert len(text.splitlines()) < 200


def test_headers_with_control_characters(tmp_path: Path, inspect: Inspect) -> None:
    """The terminal shows them escaped, each on one line. The draft keeps them, so its keys are those headers."""
    odd = ["heading\t(deg)", "\x1b[31mred [V]", 'gyro\nbase = "x"', "\x9b2J\u202e\u2028b"]
    titles = ",".join('"{}"'.format(title.replace('"', '""')) for title in odd)
    header = f"time [s],{','.join(f'thr_{n}_pwm' for n in range(1, 7))},{titles}"
    rows = [",".join([f"{0.1 * n:g}", *["1600"] * 6, *[f"{n}"] * 4]) for n in range(50)]
    (tmp_path / "log.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
    out, draft = inspect()
    assert all(character.isprintable() for line in out.split("\n") for character in line)
    assert "\n- gyro\\nbase = " in out
    assert {*odd} <= {*parsed(draft.replace('# "', '"').partition("[columns]")[2])}


# ---- Folders without rov.toml ----------------------------------------------------------------------------------------


def test_the_lines_to_paste_are_printed_and_nothing_is_written_unasked(tmp_path: Path, capsys: Capsys) -> None:
    """The option of `identify` is the same command."""
    folder = tmp_path / "A ROV (2)"
    folder.mkdir()
    one_file(folder)
    draft = folder / "rov.toml"
    printed = []
    for command in (["inspect"], ["identify", "--inspect"]):
        assert main([*command, str(folder)]) == 0
        printed.append(capsys.readouterr().out)
        assert not draft.exists()
    assert printed[0] == printed[1]
    assert "thruster 1" in printed[0]
    assert printed[0].endswith(f"Next: rov-fmu identify '{folder}'\n")
    lines = printed[0].partition("--draft writes them:\n")[2].splitlines()
    assert main(["inspect", str(folder), "--draft"]) == 0
    text = draft.read_text(encoding="utf-8")
    assert [line.removeprefix("  ") for line in lines[: len(text.splitlines())]] == text.splitlines()
    document = parsed(text)
    assert (document["vehicle"]["name"], document["vehicle"]["identifier"]) == ("A ROV (2)", "a_rov_2")
    assert (document["base"], document["against"]) == ("bluerov2", "bluerov2")
    assert "dives" not in document, "its log is one file"
    capsys.readouterr()
    assert main(["identify", str(folder), "--draft"]) == 0
    assert "Wrote" not in capsys.readouterr().out, "it lacks nothing"
    assert draft.read_text(encoding="utf-8") == text
    assert {path.name for path in folder.iterdir()} == {"rov.toml", "log_a.csv"}


INCOMPLETE: dict[str, tuple[str, set[str]]] = {
    "": (" ", {"base", "against", "vehicle", "known", "columns"}),
    "a base": ('base = "bluerov2"  # mine\n', {"vehicle", "columns"}),
    "a part of a table": ('# Mine.\nbase = "bluerov2"\n[vehicle]\nname = "Ours"\n', {"vehicle", "columns"}),
    "a column": ('[columns]\n"Sonde" = "depth [ft]"  # my unit\n\n[limits]\nduration = 60.0\n', {"base", "vehicle"}),
    "thrusters": (
        f"{VECTORED.partition('[body]')[0]}[curves.t200]\n{VECTORED.partition('[curves.t200]')[2]}",
        {"body", "columns"},
    ),
}
"""What a rov.toml has, and what `--draft` adds."""


@pytest.mark.parametrize("name", INCOMPLETE)
def test_a_draft_completes_what_is_there_and_keeps_it(name: str, tmp_path: Path, inspect: Inspect) -> None:
    own, added = INCOMPLETE[name]
    (tmp_path / "rov.toml").write_text(own, encoding="utf-8")
    pulses = [1500.0 + 400.0 * c for c in THRUSTERS[: 4 if name == "thrusters" else 6]]
    titles = [f"T{n} (us)" for n, _ in enumerate(pulses, start=1)]
    table(tmp_path / "dive.csv", ",".join(["t", *titles, "Sonde", "Tiefe (m)"]), TIME, *pulses, DEPTH, DEPTH)
    _, text = inspect()
    before, after = parsed(own), parsed(text)
    assert {line.strip() for line in own.splitlines()} <= {line.strip() for line in text.splitlines()}
    assert {key for key in after if after[key] != before.get(key)} >= added
    for key, value in before.items():
        assert after[key] == value or after[key] == after[key] | value
    assert inspect()[1] == text, "a second time, nothing is lacking"


def test_what_no_fit_can_learn_is_told_with_its_reason(tmp_path: Path, inspect: Inspect) -> None:
    """Sway is not measured, yaw is only commanded together with surge, and its commands change in each row."""
    time = 0.1 * np.arange(400.0)
    surge, yaw, down = 0.3 * np.sin(time), 0.3 * np.sin(time + 0.1), np.tile([0.3, 0.0, 0.1, -0.2], 100)
    sides = [-surge + yaw, -surge - yaw, surge - yaw, surge + yaw, down, down]
    titles = ",".join(["time [s]", *(f"u_{n} [1]" for n in range(1, 7)), "surge velocity [m/s]", "heading [deg]"])
    table(tmp_path / "dive.csv", titles, time, *sides, np.sin(time), np.cos(time))
    told = inspect(option="")[0].partition("What no fit can learn from these logs:\n")[2].partition("\n\n")[0]
    for words in (
        "sway stays that of bluerov2: no log has a velocity or a position of sway. Command it both ways, and log its",
        "heave stays that of bluerov2: no log has a velocity or a position of heave. Command it both ways, and log the",
        "yaw: known less well, because it is never commanded alone, only together with surge",
        "speeds beyond the strongest commands, 30% in surge and 30% in yaw, are extrapolated",
        "dive.csv: the log has momentary commands: about 85% of the heave command is lost between its rows (10 per",
        "t200 thrust: no force was measured, so loads, drag, masses and β are in units of the assumed thrust",
    ):
        assert f"- {words}" in told
    still = [np.where(time < 20.0, 0.3, 0.0) for _ in range(4)] + [np.zeros(400)] * 2
    table(tmp_path / "dive.csv", titles, time, *still, np.sin(time), np.cos(time))
    told = inspect(option="")[0]
    assert "the thrusters along surge and yaw cancel each other all the time" in told
    assert "momentary" not in told


def test_a_log_of_one_axis_commands_it_alone_and_measured_forces_are_not_assumed(
    tmp_path: Path, inspect: Inspect
) -> None:
    """Both rear thrusters drive surge and yaw, and a log of surge has one command for both."""
    time, command = 0.1 * np.arange(400.0), np.linspace(-100.0, 100.0, 11)
    (tmp_path / "rov.toml").write_text('base = "videoray"\n[vehicle]\nname = "A"\nidentifier = "a"\n')
    for curve in ("rear", "top"):
        table(tmp_path / f"thrust_{curve}.csv", "command [%],force [N]", command, 0.2 * command)
    table(tmp_path / "log_surge.csv", "time [s],command [1],velocity [m/s]", time, 0.5 * np.sin(time), np.sin(time))
    told = inspect(option="")[0].partition("What no fit can learn from these logs:\n")[2].partition("\n\n")[0]
    assert "speeds beyond the strongest commands, 50% in surge, are extrapolated" in told
    assert not re.search("alone|assumed thrust", told)
    (tmp_path / "thrust_top.csv").unlink()
    assert "write command and force into thrust_top.csv" in inspect(option="")[0]


def test_the_page_of_logs_has_a_picture_of_each(tmp_path: Path) -> None:
    one_file(tmp_path)
    (tmp_path / "bad.csv").write_text("time [s],depth [m]\n", encoding="utf-8")
    page = tmp_path / "logs.html"
    for _ in range(2):
        assert main(["inspect", str(tmp_path), "--report", str(page)]) == 0
    root = html.fromstring(page.read_text(encoding="utf-8"))
    assert [svg.get("aria-label") for svg in root.iter("svg")] == ["log_a.csv over time"]
    told = root.text_content()
    assert "Bad.csv: left out as unreadable" in told or "bad.csv: left out as unreadable" in told
    for words in ("What no fit can learn from these logs", "thruster 6", "surge and sway", 'base = "bluerov2"'):
        assert words in told
    check_refers_to_itself_alone(page.read_text(encoding="utf-8"))
    page.write_text("mine", encoding="utf-8")
    assert main(["inspect", str(tmp_path), "--report", str(page)]) == 2
    assert page.read_text(encoding="utf-8") == "mine"


UNREADABLE: dict[str, bytes] = {
    "cut.mcap": b"\x89MCAP0\r\n\x01",
    "empty.csv": b"",
    "image.bin": b"\x89PNG\r\n\x1a\n\0\0",
    "no_text.csv": b"time [s],temp\x81rature\n0,1\n",
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_file_that_cannot_be_read_is_a_warning_unless_nothing_is_left(
    name: str, tmp_path: Path, capsys: Capsys
) -> None:
    log = one_file(tmp_path)
    (tmp_path / name).write_bytes(UNREADABLE[name])
    assert main(["identify", str(tmp_path), "--draft"]) == 0
    (warning,) = capsys.readouterr().err.splitlines()
    assert warning.startswith(f"rov-fmu: warning: {name}: left out as unreadable: ")
    weigh(tmp_path)
    tests = load_tests(tmp_path)
    assert tests.logged == ["heave"]
    assert f"{name}: left out as unreadable" in by_heading(tests.folder.findings)["Warnings"][0]
    log.unlink()
    for arguments in ([str(tmp_path)], [str(tmp_path), "--inspect"]):
        assert main(["identify", *arguments]) == 2
        (error,) = [line for line in capsys.readouterr().err.splitlines() if str(tmp_path / name) in line]
        assert error.startswith(f"rov-fmu: {tmp_path / name}")


def test_files_of_several_dives_are_paired_by_their_times(tmp_path: Path, inspect: Inspect) -> None:
    for n in (1, 2):
        table(tmp_path / f"out_{n}.csv", "time [s],u_1 [%],u_2 [%]", TIME + 99 * n, 9 * TIME, -9 * TIME)
        table(tmp_path / f"in_{n}.csv", "time [s],depth [m]", TIME + 99 * n + 9.5, DEPTH)
    table(tmp_path / "other_clock.csv", "time [s],heading [deg]", TIME + 9e5, TIME)
    _, draft = inspect()
    paired = {f"dive_{n}": {"files": [f"out_{n}.csv", f"in_{n}.csv"]} for n in (1, 2)}
    assert parsed(draft)["dives"] == paired | {"dive_3": {"files": ["?", "other_clock.csv"]}}


def test_outputs_that_never_change_may_be_those_of_lights(tmp_path: Path, inspect: Inspect) -> None:
    """With its seven outputs, the vehicle would be no vehicle that ships."""
    lights = np.full((len(TIME), 1), 1100)
    LOGS[".tlog"](tmp_path, replace(DIVE, pulses=np.column_stack([DIVE.pulses, lights])))
    out, draft = inspect()
    assert "thruster 7" in out
    assert parsed(draft)["base"] == "bluerov2"


def test_forces_are_turned_with_a_position_that_points_up(tmp_path: Path, inspect: Inspect) -> None:
    table(tmp_path / "log.csv", "time [s],force_x,force_z,torque_y,pos_z", TIME, TIME, TIME, TIME, -DEPTH)
    assert parsed(inspect()[1])["columns"] == {
        "force_x": "X_ext [N]",
        "force_z": "-Z_ext [N]",
        "torque_y": "-M_ext [N.m]",
        "pos_z": "-depth [m]",
    }


def test_a_vehicle_with_an_arm_asks_for_it(tmp_path: Path, inspect: Inspect) -> None:
    """The mass and the place of the rear thrusters are the owner's; a moment of inertia may be that of the base."""
    table(tmp_path / "log.csv", "time [s],u_l [%],u_r [%],u_t [%],depth [m]", TIME, TIME, TIME, TIME, DEPTH)
    _, draft = inspect()
    assert [line.partition("   #")[::2] for line in draft.splitlines() if "value = " in line] == [
        ('m_rov = { value = "?", unit = "kg", source = "Measured" }', " 6.57 in the base"),
        ('# I_r = { value = "?", unit = "kg.m2", source = "Measured" }', " 0.105 in the base"),
        ('R = { value = "?", unit = "m", source = "Measured" }', " 0.22 in the base"),
        ('gamma = { value = "?", unit = "rad", source = "Measured" }', " 0.423 in the base"),
    ]
    assert parsed(draft)["base"] == "videoray"
    (tmp_path / "rov.toml").unlink()
    (tmp_path / "thrust_other.csv").write_bytes(b"command [%],force [N]\n50,9\n")
    assert "base" not in parsed(inspect()[1]), "it has no such curve"


def test_logs_without_commands_are_not_said_to_be_identifiable(
    tmp_path: Path, inspect: Inspect, capsys: Capsys
) -> None:
    """A file with motion alone, and one with commands alone, are refused with the table that joins them."""
    table(tmp_path / "in.csv", "time [s],depth [m]", TIME, DEPTH)
    end = f"add the commands, or name their columns, then rov-fmu identify {tmp_path}\n"
    assert inspect()[0].endswith(f"Next: edit this draft, then {end}")
    assert inspect()[0].endswith(f"Next: {end}")
    (tmp_path / "rov.toml").unlink()
    table(tmp_path / "out.csv", "time [s],u_l [%],u_r [%],u_t [%]", TIME + 900.0, TIME, TIME, TIME)
    _, draft = inspect()
    weigh(tmp_path)
    text = re.sub(r'= "\?"', "= 0.3", draft).partition("[dives")[0]
    (tmp_path / "rov.toml").write_text(text, encoding="utf-8")
    assert main(["identify", str(tmp_path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert [line.rpartition("; ")[2] for line in lines] == [
        "if another file of the same dive has it, [dives] in rov.toml joins the files"
    ] * 2
