"""`rov-fmu inspect`: what logs contain, what no fit can learn from them, and a draft with which they are read."""

import re
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
import tomlkit

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, YAW
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.inspection.inspected import inspect_paths
from rov_fmu.io.messages import FileError
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import VehicleFileError
from tests.folders import VECTORED
from tests.often import spread
from tests.tank.inspection.test_outputs import TIME as DIVE_TIME
from tests.tank.inspection.test_outputs import dive, held
from tests.tank.logs import commanded, measured, used
from tests.tank.readers import motion
from tests.tank.readers.motion import DIVE, TIME
from tests.tank.readers.writers import LOGS, Ros, parameter, servos, table, write_mcap, write_tlog

Capsys = pytest.CaptureFixture[str]
Inspect = Callable[..., tuple[str, str]]
DEPTH: Array = motion.DEPTH
THRUSTERS = [*motion.THRUSTERS.values()]


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


def of_format(suffix: str) -> Callable[[Path], object]:
    return lambda folder: LOGS[suffix](folder, DIVE)


ALL = {"surge", "sway", "heave", "yaw"}
FILES: dict[str, tuple[Callable[[Path], object], set[str]]] = {
    **{suffix: (of_format(suffix), ALL) for suffix in LOGS},
    "three files": (three_files, {"heave", "yaw"}),
    "one file": (one_file, {"heave"}),
}
"""What is written, and the axes that it shows at least."""


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


@pytest.mark.parametrize("name", spread(FILES, (".tlog", ".mcap", "three files", "one file"), (".bin", ".ulg")))
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
    assert tests.base["m_rov"] == 12.0
    assert axes <= {*tests.logged}
    (log,) = tests.folder.logs
    assert measured(log, "depth") == pytest.approx(DEPTH, abs=1e-5)
    assert commanded(log, "6") == pytest.approx(motion.THRUSTERS["6"], abs=2e-3)
    if name == ".ulg":
        assert [line for line in draft.splitlines() if "cpuload" in line] == ['# "cpuload.load" = "?"   # always 0.5']
    if name == "three files":
        assert "aligned clock" in {finding.kind for finding in log.findings}
        assert measured(log, "voltage") == pytest.approx(motion.VOLTAGE, abs=1e-6)


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
    (tmp_path / "rov.toml").write_text(text, encoding="utf-8")
    assert [*load_tests(tmp_path).layout.by_name] == ["heave"]


def test_a_draft_has_the_axes_that_no_log_measures_with_the_reason(tmp_path: Path, inspect: Inspect) -> None:
    """Two thrusters turn the vehicle and push it ahead, as far as anybody knows; two push down."""
    effects = {YAW: [3.0, -3.0, 0.0, 0.0], HEAVE: [0.0, 0.0, 0.6, 0.6]}
    rng = np.random.default_rng(1)
    log = dive(effects, "abcd", held(rng, 4), 1, ["depth", "heading"])
    rows = (commanded(log, name, DIVE_TIME) for name in "abcd")
    titles = "time [s],thruster_a,thruster_b,thruster_c,thruster_d,depth [m],heading [rad]"
    table(tmp_path / "dive.csv", titles, DIVE_TIME, *rows, *(one.values for one in log.channels))
    _, text = inspect()
    assert parsed(text)["axes"].keys() == {"surge", "heave", "yaw"}
    (line,) = (line for line in text.splitlines() if line.startswith("[axes.surge]"))
    assert "no log measures it" in line
    assert "a guess will do: 0.02 m2 times m_rov" in text


@pytest.mark.parametrize(
    ("titles", "unit"),
    [
        ("time [s],command [%],position [m]", 1.0),
        ("time,command,distance", 1.0),
        ("ms,command,position", 1000.0),
        ("time [ms],command [%],distance [cm]", 1000.0),
    ],
)
def test_a_log_of_one_axis_is_read_by_the_words_of_the_guide(
    titles: str, unit: float, tmp_path: Path, inspect: Inspect
) -> None:
    """At 250 Hz, a time in ms has steps that a time in seconds might have."""
    at = np.arange(0.0, 60.0, 0.004)
    cm = 100.0 if "[cm]" in titles else 1.0
    table(tmp_path / "log_surge_1.csv", titles, unit * at, 50.0 * np.sign(np.sin(at)), cm * 0.3 * at)
    _, text = inspect()
    path = tmp_path / "rov.toml"
    path.write_text(text.replace('base = "?"', 'base = "videoray"'), encoding="utf-8")
    (log,) = load_tests(tmp_path).folder.logs
    assert measured(log, "surge distance")[-1] == pytest.approx(0.3 * at[-1], abs=1e-3)
    assert used(log, "surge distance").time[-1] == pytest.approx(at[-1], abs=1e-3)
    assert np.abs(commanded(log, "command")).max() == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("titles", "base"),
    [
        ([f"T{n}" for n in range(1, 7)], "bluerov2"),
        ([f"motor_{n} [us]" for n in range(6, 0, -1)], "bluerov2"),
        (["H1", "H2", "H3", "H4", "V1", "V2"], ""),
        ([f"Leg{n} (mbar)" for n in range(1, 7)], "?"),
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
        reason = inspect_paths([tmp_path / "dive.tlog"]).draft_for(None).reason
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


@pytest.mark.parametrize("last", ["", ",u_6 [1]"])
def test_commands_that_count_from_0_are_those_of_thrusters_from_1_on(
    last: str, tmp_path: Path, inspect: Inspect, capsys: Capsys
) -> None:
    """Of seven outputs, the last one rests and drives no thruster, although its header is that of thruster 6."""
    names = ",".join(f"u_{n} [1]" for n in range(6))
    rest = [0.0 * TIME] if last else []
    table(tmp_path / "dive.csv", f"time [s],depth [m],{names}{last}", TIME, DEPTH, *THRUSTERS, *rest)
    out, draft = inspect()
    assert parsed(draft)["columns"] == {f"u_{n} [1]": f"u_{n + 1} [1]" for n in range(6)}
    assert "no thruster" not in out
    weigh(tmp_path)
    (log,) = load_tests(tmp_path).folder.logs
    assert [commanded(log, f"{n}") for n in range(1, 7)] == [pytest.approx(own) for own in THRUSTERS]
    rov = tmp_path / "rov.toml"
    rov.write_text(rov.read_text("utf-8").partition("[columns]")[0], encoding="utf-8")
    assert main(["identify", str(tmp_path)]) == 2
    assert "column 'u_0 [1]': these columns count from 0" in capsys.readouterr().err


def test_headers_of_loggers_are_read_and_no_sentence_contradicts_them(tmp_path: Path, inspect: Inspect) -> None:
    """Of two headers with the same meaning, one is read, and the other is told as such. A speed without an axis may be
    that of surge."""
    titles = "dvl_vx,gyro_z_dps,batt_V,Gyroscope (z) [rad/s],Tiefe [m],Kompass [°],depth_m,Fahrgeschwindigkeit [m/s]"
    names = ",".join(f"u_{name} [1]" for name in motion.THRUSTERS)
    rate = 0.3 + 0.01 * TIME
    numbers = (
        *THRUSTERS,
        motion.U,
        np.degrees(rate),
        motion.VOLTAGE,
        rate,
        DEPTH,
        np.degrees(motion.HEADING),
        DEPTH,
        motion.U,
    )
    table(tmp_path / "dive.csv", f"time [s],{names},{titles}", TIME, *numbers)
    out, draft = inspect()
    assert parsed(draft)["columns"] == {
        "dvl_vx": "surge velocity [m/s]",
        "gyro_z_dps": "yaw velocity [dps]",
        "batt_V": "voltage [V]",
        "Tiefe [m]": "depth [m]",
        "Kompass [°]": "heading [°]",
    }
    assert re.search(r"\n- Gyroscope \(z\) \[rad/s\]: .*, another yaw velocity \[rad/s\]\n", out)
    assert re.search(r"\n- depth_m: .*, another depth \[m\]\n", out)
    assert "no log has a velocity or a position of surge" not in out
    assert "no log has a velocity or a position of sway, unless Fahrgeschwindigkeit [m/s] is one. " in out


def test_thousands_of_columns_take_seconds_and_are_not_all_shown(tmp_path: Path, inspect: Inspect) -> None:
    """If each header were compared with all others, it would take a minute."""
    start = process_time()
    titles = ["time [s]", "depth [m]", *(f"x{n}" for n in range(1100))]
    table(tmp_path / "log.csv", ",".join(titles), *(DEPTH[:3] for _ in titles))
    shown = inspect()
    assert process_time() - start < 10.0
    assert "depth" in shown[0]
    for text in shown:
        assert "1000 more" in text
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
    folder = tmp_path / "A ROV (2)"
    folder.mkdir()
    one_file(folder)
    draft = folder / "rov.toml"
    assert main(["inspect", str(folder)]) == 0
    printed, warned = capsys.readouterr()
    assert not draft.exists()
    assert "thruster 1" in printed
    assert "nothing is pushed both ways" in warned
    assert printed.endswith(f"Next: correct this, then rov-fmu identify '{folder}'\n")
    lines = printed.partition("--draft writes them:\n")[2].splitlines()
    assert main(["inspect", str(folder), "--draft"]) == 0
    text = draft.read_text(encoding="utf-8")
    assert [line.removeprefix("  ") for line in lines[: len(text.splitlines())]] == text.splitlines()
    document = parsed(text)
    assert (document["vehicle"]["name"], document["vehicle"]["identifier"]) == ("A ROV (2)", "a_rov_2")
    assert document["base"] == "bluerov2"
    assert "dives" not in document, "its log is one file"
    capsys.readouterr()
    assert main(["inspect", str(folder), "--draft"]) == 0
    assert "Wrote" not in capsys.readouterr().out, "it lacks nothing"
    assert draft.read_text(encoding="utf-8") == text
    assert {path.name for path in folder.iterdir()} == {"rov.toml", "log_a.csv"}


INCOMPLETE: dict[str, tuple[str, set[str]]] = {
    "": (" ", {"base", "vehicle", "known", "columns"}),
    "a base": ('base = "bluerov2"  # mine\n', {"vehicle", "columns"}),
    "a column": ('[columns]\n"Sonde" = "depth [ft]"  # my unit\n', {"base", "vehicle"}),
    "thrusters": (VECTORED, {"columns"}),
}
"""What a rov.toml has, and what `--draft` adds."""


@pytest.mark.parametrize("name", spread(INCOMPLETE, [*INCOMPLETE][::2], INCOMPLETE))
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
    assert {key: after[key] for key in before} == before
    assert inspect()[1] == text, "a second time, nothing is lacking"


REFUSED = {
    "an axis": ("rov.toml", "[axes.sway]", "[axes.sawy]"),
    "a curve": ("rov.toml", 'curve = "t200"', 'curve = "t300"'),
    "a column": ("log_sway_1.csv", "distance [m]", "distance [furlong]"),
    "a time": ("log_sway_1.csv", "time [s],", "when,"),
    "nothing": ("rov.toml", "[axes.sway]", "[axes.sway]"),
}
"""What is misspelt in a folder: the file, the word, and what stands there in its place."""


@pytest.mark.parametrize("name", spread(REFUSED, ("a column", "nothing"), REFUSED))
def test_what_identify_refuses_is_not_recommended(name: str, tmp_path: Path, capsys: Capsys) -> None:
    (tmp_path / "rov.toml").write_text(VECTORED, encoding="utf-8")
    for n in (1, 2):
        table(tmp_path / f"log_sway_{n}.csv", "time [s],command [%],distance [m]", TIME, 100 * THRUSTERS[n], DEPTH)
    file, word, other = REFUSED[name]
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert word in text
    (tmp_path / file).write_text(text.replace(word, other), encoding="utf-8")
    assert main(["inspect", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    try:
        load_tests(tmp_path)
    except FileError as error:
        refusals = str(error).splitlines()
        assert "\nNext: correct this, then rov-fmu identify " in out
        assert all(err.count(line) == 1 for line in refusals)
        assert "left out as unreadable" not in err, "it is told already"
    else:
        assert name == "nothing"
        assert "\nNext: rov-fmu identify " in out


UNREADABLE: dict[str, bytes] = {
    "cut.mcap": b"\x89MCAP0\r\n\x01",
    "empty.csv": b"",
    "image.bin": b"\x89PNG\r\n\x1a\n\0\0",
    "no_text.csv": b"time [s],temp\x81rature\n0,1\n",
}


@pytest.mark.parametrize("name", spread(UNREADABLE, ("cut.mcap", "image.bin"), UNREADABLE))
def test_a_file_that_cannot_be_read_is_a_warning_unless_nothing_is_left(
    name: str, tmp_path: Path, capsys: Capsys
) -> None:
    log = one_file(tmp_path)
    (tmp_path / name).write_bytes(UNREADABLE[name])
    assert main(["inspect", str(tmp_path), "--draft"]) == 0
    (warning,) = capsys.readouterr().err.splitlines()
    assert warning.startswith(f"rov-fmu: warning: {name}: left out as unreadable: ")
    weigh(tmp_path)
    tests = load_tests(tmp_path)
    assert tests.logged == ["heave"]
    assert f"{name}: left out as unreadable" in by_heading(tests.folder.findings)["Warnings"][0]
    log.unlink()
    for command in ("identify", "inspect"):
        assert main([command, str(tmp_path)]) == 2
        (error,) = [line for line in capsys.readouterr().err.splitlines() if str(tmp_path / name) in line]
        assert error.startswith(f"rov-fmu: {tmp_path / name}")


def test_a_draft_proposes_what_fields_of_unknown_messages_mean(tmp_path: Path, inspect: Inspect) -> None:
    """With the proposals in force, commands, velocities in an earth frame and a depth are read of such messages."""
    north, east, down = DIVE.over_ground.T
    fields = {
        "/thrusters": {f"pwm{n}": pulses for n, pulses in enumerate(DIVE.pulses.T, start=1)},
        "/dvl": {"velocity_north": north, "velocity_east": east, "velocity_down": down, "velocity_valid": 0 * TIME + 1},
        "/imu": {"yaw_deg": np.degrees(motion.HEADING), "roll_deg": np.degrees(motion.ROLL), "temperature": TIME},
        "/attitude": {"pitch": np.degrees(motion.PITCH), "x": TIME, "w": TIME},
    }
    messages = [
        (topic, f"own.{topic.strip('/').title()}", float(time), {name: float(own[n]) for name, own in of.items()})
        for n, time in enumerate(TIME)
        for topic, of in fields.items()
    ]
    write_mcap(tmp_path / "dive.mcap", "json", messages)
    _, draft = inspect()
    assert '# "/dvl.velocity_north" = "north velocity [m/s]"   # ' in draft
    assert '# "/thrusters.pwm6" = "u_6 [us]"   # ' in draft
    assert '# "/imu.yaw_deg" = "heading [deg]"   # ' in draft
    for unknown in ("/imu.temperature", "/dvl.velocity_valid", "/attitude.x"):
        assert f'# "{unknown}" = "?"' in draft
    used_lines = re.sub(r'^# ("/[^"]+" = "[a-z-])', r"\1", draft.replace('base = "?"', 'base = "bluerov2"'), flags=re.M)
    (tmp_path / "rov.toml").write_text(used_lines, encoding="utf-8")
    weigh(tmp_path)
    (log,) = load_tests(tmp_path).folder.logs
    assert measured(log, "surge velocity") == pytest.approx(motion.U, abs=1e-5)
    assert commanded(log, "6") == pytest.approx(motion.THRUSTERS["6"], abs=2e-3)


def with_gap(folder: Path, *titles: str) -> Path:
    """Write a dive of 60 s whose DVL begins 12 s late and has a gap of 6 s from 24 s on."""
    time: Array = np.arange(0.0, 60.0, 0.1)
    push, columns = 0.3 * np.sign(np.sin(2.0 * time) + 0.2), ["l", "r", "t"]
    blank = (time < 12.0) | ((time > 24.01) & (time < 29.99))
    speed = np.zeros(len(time))
    for n, c in enumerate(push[:-1]):
        speed[n + 1] = speed[n] + 0.2 * (c - speed[n])  # a time constant of half a second
    rows = [
        f"{t:.1f},{c},{c},{c},{t:.2f}{f',{v:.4f}' * len(titles) if not b else ',' * len(titles)}"
        for t, c, v, b in zip(time, push, speed, blank, strict=True)
    ]
    header = ",".join(["time [s]", *(f"u_{name} [1]" for name in columns), "depth [m]", *titles])
    (folder / "dive.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
    return folder / "dive.csv"


def test_gaps_and_courses_count_from_the_begin_of_the_log(tmp_path: Path, inspect: Inspect) -> None:
    out, _ = inspect(with_gap(tmp_path, "surge velocity [m/s]"), "")
    (line,) = (line for line in out.splitlines() if line.startswith("surge velocity"))
    assert line.endswith("6 s at 24 s")
    course = line[: -len("6 s at 24 s")].rstrip()[-32:]
    assert [n for n, level in enumerate(course) if level == " "] == [*range(6), 13, 14, 15]
    (depth,) = inspect_paths([tmp_path / "dive.csv"]).logs[0].channels[:1]
    assert np.isfinite(depth.course).all()


def test_identify_is_not_next_while_headers_that_it_needs_are_unknown(tmp_path: Path, inspect: Inspect) -> None:
    log = with_gap(tmp_path, "dvl_fwd")
    out, _ = inspect(log, "")
    assert "no log has a velocity or a position of surge, unless dvl_fwd is one" in out
    assert out.rstrip().endswith(f"Next: rov-fmu inspect {log} --draft")
    draft = inspect(log)[1].replace('{ value = "?"', "{ value = 0.5")
    (tmp_path / "rov.toml").write_text(draft, encoding="utf-8")
    out, _ = inspect(log, "")
    assert out.rstrip().endswith(f"Next: write into {tmp_path / 'rov.toml'} what these headers mean: dvl_fwd")
    named = draft.replace('# "dvl_fwd" = "?"', '"dvl_fwd" = "surge velocity [m/s]"')
    (tmp_path / "rov.toml").write_text(named, encoding="utf-8")
    assert inspect(log, "")[0].rstrip().endswith(f"Next: rov-fmu identify {log}")


def test_a_header_of_several_logs_is_named_once(tmp_path: Path, inspect: Inspect) -> None:
    log = with_gap(tmp_path, "dvl_fwd", "dvl_stbd")
    (tmp_path / "dive_2.csv").write_text(log.read_text(encoding="utf-8").replace("0.3", "0.2"), encoding="utf-8")
    assert "unless dvl_fwd or dvl_stbd is one" in inspect(tmp_path, "")[0]


def test_a_base_that_the_owner_removed_stays_removed(tmp_path: Path, inspect: Inspect) -> None:
    one_file(tmp_path)
    _, draft = inspect()
    assert 'base = "bluerov2"' in draft
    (tmp_path / "rov.toml").write_text(re.sub("(?m)^base = .*$", "", draft).partition("[known]")[0], encoding="utf-8")
    _, again = inspect()
    found = parsed(again)
    assert "base" not in found
    assert [thruster["name"] for thruster in found["thruster"]] == [*motion.THRUSTERS]
    assert "body" in found


def test_a_folder_without_a_log_ends_with_2(tmp_path: Path, capsys: Capsys) -> None:
    table(tmp_path / "prices.csv", "name,price", TIME, TIME)
    assert main(["inspect", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert "Not enough is recognised" in out
    assert err == f"rov-fmu: {tmp_path}: nothing that is recognised as a log or a table of tests\n"
    (tmp_path / "prices.csv").rename(tmp_path / "dive.csv")
    assert main(["list", str(tmp_path)]) == 0
    assert "`rov-fmu inspect` lists what it contains" in " ".join(capsys.readouterr().out.split())
