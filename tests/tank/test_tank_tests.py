"""A folder of tank tests: what is read, and a clear line for each mistake."""

import hashlib
import re
import shutil
from math import radians
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import SEVERITY, result_sentences
from rov_fmu.io.messages import FileError
from rov_fmu.tank.readers.tank_tables import Row, read_rows
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError
from tests.commands import TESTS
from tests.folders import rows_of
from verification.published import load_tables


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Copy the VideoRay's tests."""
    return Path(shutil.copytree(TESTS, tmp_path / "tests"))


# ---- What is read ----------------------------------------------------------------------------------------------------


def test_the_folder_of_the_videoray_holds_tables_3_to_7_and_the_numbers_of_table_9(
    vehicle: Vehicle,
) -> None:
    found = load_tests(TESTS)
    tables = {table.axis.name: table for table in load_tables(vehicle)}
    steady, Taus_of = rows_of(found, "steady"), rows_of(found, "time_constant")
    for axis, table in tables.items():
        forward = {row.command: row.value for row in steady[axis] if row.command > 0.0}
        assert forward == {float(c) / 100.0: float(V) for c, V in table.steady.items()}
        Taus = {row.command: row.value for row in Taus_of.get(axis, ())}
        assert Taus == {
            float(row.command) / 100.0: float(Tau) for row in table.rows if (Tau := row.scaled.Tau.measured) is not None
        }
    upward = [(row.command, row.value) for row in steady["heave"] if row.command < 0.0]
    assert upward == [(-0.7, -0.37), (-0.5, -0.25), (-0.3, -0.17), (-0.2, -0.13)][::-1]
    known = found.known
    assert {name: q.value for name, q in known.items()} == {
        name: vehicle[name] for name in ("m_rov", "I_r", "R", "gamma", "a_t_rear", "b_t_rear", "a_t_top", "b_t_top")
    }
    assert all("Table 9" in q.source for q in known.values())
    assert found.folder.inputs == {
        path.name: hashlib.sha3_256(path.read_bytes()).hexdigest()
        for path in TESTS.iterdir()
        if path.suffix == ".csv" or path.name == "rov.toml"
    }


@pytest.mark.parametrize("unit", ["N 50", "kgf 50", "N.m 50", "us 0 50", "% ", "us -50 -50"])
def test_a_command_of_a_table_may_be_a_force_or_any_pulse(unit: str, tmp_path: Path) -> None:
    numbers = {"us -50 -50": (-75, -25, 0), "% ": (50, -50, -100)}.get(unit, (25, -25, -50))
    rows = "".join(f"{number},{value}\n" for number, value in zip(numbers, (0.3, -0.2, -0.4), strict=True))
    (tmp_path / "steady_surge.csv").write_text(f"command [{unit}],velocity [m/s]\n{rows}", encoding="utf-8")
    found, _, _ = read_rows(tmp_path / "steady_surge.csv", "steady")
    assert [row.command for row in found] == [0.5, -0.5, -1.0]


def test_the_table_columns_of_rov_toml_serves_tables_too(folder: Path) -> None:
    """An entry about logs leaves the headers of tables as they are."""
    before = rows_of(load_tests(folder), "steady")
    (folder / "thrust_top_a.csv").write_text("Throttle (%),Pull (kgf)\n50,2\n", encoding="utf-8")
    (folder / "steady_yaw_a.csv").write_text("Throttle (%),Rate\n50,60\n", encoding="utf-8")
    (folder / "time_constant_yaw.csv").write_text("command [%],Tau\n50,300\n", encoding="utf-8")
    (folder / "log_dive.csv").write_text(
        "time [s],Throttle (%),command [%],depth [m]\n" + "".join(f"{n},{n},{n},{n}\n" for n in range(30)),
        encoding="utf-8",
    )
    names = {
        "Throttle (%)": "command [%]",
        "Pull (kgf)": "force [kgf]",
        "Rate": "velocity [deg/s]",
        "Tau": "time constant [ms]",
        "command [%]": "u_t [%]",
    }
    rov = folder / "rov.toml"
    columns = "".join(f'"{title}" = "{meant}"\n' for title, meant in names.items())
    given = re.sub(r"[ab]_t_top = .*\n", "", rov.read_text(encoding="utf-8"))
    rov.write_text(f"{given}\n[columns]\n{columns}", encoding="utf-8")
    found = load_tests(folder)
    assert rows_of(found, "thrust")["top"] == [Row("thrust_top_a.csv", 2, 0.5, 2.0 * 9.80665)]
    steady = rows_of(found, "steady")
    assert steady["yaw"][-1] == Row("steady_yaw_a.csv", 2, 0.5, radians(60.0))
    assert rows_of(found, "time_constant")["yaw"] == [Row("time_constant_yaw.csv", 2, 0.5, 0.3)]
    assert steady["surge"] == before["surge"]
    rov.write_text(f'{rov.read_text(encoding="utf-8")}"Pul" = "force [kgf]"\n', encoding="utf-8")
    with pytest.raises(VehicleFileError, match=r"columns.Pul = 'force \[kgf\]': no CSV file has such a column"):
        load_tests(folder)


def without_curve(folder: Path, name: str) -> None:
    """Return a folder without a given thrust curve."""
    path = folder / "rov.toml"
    path.write_text(re.sub(rf"^[ab]_t_{name} .*$", "", path.read_text(encoding="utf-8"), flags=re.M), encoding="utf-8")


def test_names_in_any_case(folder: Path) -> None:
    before = load_tests(folder)
    (folder / "time_constant_heave.csv").rename(folder / "time_constant_heave.CSV")
    (folder / "steady_yaw.csv").rename(folder / "Steady_YAW.Csv")
    (folder / "Log_Heave.csv").write_text(LOG + "\n".join(f"{n},30,{n}" for n in range(30)) + "\n", encoding="utf-8")
    (folder / "steady_surge.csv.txt").write_text("not a test", encoding="utf-8")
    found = load_tests(folder)
    for kind, axis in (("time_constant", "heave"), ("steady", "yaw")):
        now, then = (rows_of(tests, kind)[axis] for tests in (found, before))
        assert [row.value for row in now] == [row.value for row in then]
    assert [(one.file, one.axis) for one in found.folder.logs] == [("Log_Heave.csv", HEAVE)]
    assert {"time_constant_heave.CSV", "Steady_YAW.Csv", "Log_Heave.csv"} <= set(found.folder.inputs)


def test_a_copy_of_a_file_is_left_out(folder: Path) -> None:
    """The same data would count twice; equal tables of two axes are no copies."""
    log = LOG + "".join(f"{n / 10},{30 * (n > 9)},{0.01 * n * n}\n" for n in range(50))
    for name in ("log_heave_1.csv", "log_heave_2.csv"):
        (folder / name).write_text(log, encoding="utf-8")
    shutil.copy(folder / "steady_surge.csv", folder / "steady_surge_copy.csv")
    shutil.copy(folder / "steady_surge.csv", folder / "steady_heave.csv")
    found = load_tests(folder)
    assert [one.file for one in found.folder.logs] == ["log_heave_1.csv"]
    steady = rows_of(found, "steady")
    assert {row.file for row in steady["surge"]} == {"steady_surge.csv"}
    assert "steady_heave.csv" in {row.file for row in steady["heave"]}
    assert not {"log_heave_2.csv", "steady_surge_copy.csv"} & found.folder.inputs.keys()
    copies = [finding for finding in found.folder.findings if finding.kind == "copy"]
    assert {SEVERITY[finding.kind] for finding in copies} == {"Warnings"}
    assert result_sentences(copies) == (
        "log_heave_2.csv: left out as a copy of log_heave_1.csv, because the same data must not count twice",
        "steady_surge_copy.csv: left out as a copy of steady_surge.csv, because the same data must not count twice",
    )


# ---- What is refused -------------------------------------------------------------------------------------------------

STEADY, TAU, LOG = (
    "command [%],velocity [m/s]\n",
    "command [%],time constant [s]\n",
    "time [s],command [%],depth [m]\n",
)
BAD: list[tuple[str, str, str]] = [
    ("steady_surge.csv", f"{STEADY}20,fast\n", "line 2 | 'velocity [m/s]' = 'fast' | number"),
    ("steady_surge.csv", f"{STEADY}20,0\n", "line 2 | 'velocity [m/s]' = 0 | sign"),
    ("steady_surge.csv", f"{STEADY}0,0.1\n", "line 2 | 'command [%]' = 0 | must not be 0, because nothing moves then"),
    ("steady_surge.csv", f"{STEADY}120,0.3\n", "line 2 | [%]' = '120' | at most 100"),
    ("steady_surge.csv", STEADY.replace("%", "us") + "1901,0.3\n", "[us]' = 1901: is beyond full thrust; [us NEUTRAL"),
    ("thrust_rear.csv", "command [%],force [N]\n60,10\n-9,0.49\n-8,0.51\n", "line 4 | = 0.51: must have the sign"),
    ("steady_surge.csv", f"{STEADY}0.2,0.3\n", "'command [%]' | Are they fractions? Then write [1]"),
    ("steady_surge.csv", "command [%],velocity\n20,0.3\n", "line 1 | column 2 = 'velocity' | [m/s]"),
    ("steady_surge.csv", "command [%],velocity [m/s],command [1]\n", "line 1 | column 3 | [1]' | twice"),
    ("steady_yaw.csv", f"{STEADY}20,1\n", "line 1 | column 2 | 'velocity [rad/s]' or 'velocity [deg/s]'"),
    ("time_constant_yaw.csv", f"{TAU}20,-3\n", "line 2 | 'time constant [s]' = -3 | above 0"),
    ("log_heave.csv", f"{LOG}0,30,0\n0.1,30,0\n0,30,0\n", "line 4 | 'time [s]' = 0: | goes back"),
    ("log_heave.csv", "time [s],command [%],heading [deg]\n0,0,0\n", "line 1 | 'depth [m]' or"),
    ("stedy_surge.csv", STEADY, "neither a log, which has a column 'time [s]' | ; did you mean steady?"),
    ("dive.csv", "time,u_l [%],depth [m]\n0,0,0\n", "line 1 | 'time': must be 'time [s]' or 'time [ms]'"),
    ("steady_sway.csv", STEADY, "no thruster of the vehicle drives sway"),
    ("steady_twist.csv", STEADY, "twist is not an axis | surge, heave and yaw"),
    ("thrust_left.csv", STEADY, "left is not a thrust curve | rear and top"),
]
"""Files, their content, and all that the one line must name beside the file."""


@pytest.mark.parametrize("case", range(len(BAD)))
def test_bad_file_is_one_clear_line(case: int, folder: Path) -> None:
    name, content, named = BAD[case]
    path = folder / name
    without_curve(folder, name.removesuffix(".csv").rpartition("_")[2])
    path.write_text(content, encoding="utf-8", errors="surrogateescape")
    (line,) = refused(folder)
    assert all(word in line for word in (str(path), *named.split(" | ")))


STILL = [f"{n / 10},{30 * (n > 9)},1.5" for n in range(50)]


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        (STILL, "the depth never changes, so it is left out"),
        (STILL[:19], "the depth has 19 samples and needs at least 20, so it is left out"),
    ],
)
def test_a_log_that_teaches_nothing_is_refused_where_there_is_no_other_test(
    rows: list[str], reason: str, folder: Path
) -> None:
    for path in folder.glob("[st]*.csv"):
        path.unlink()
    log = folder / "log_heave.csv"
    log.write_text(LOG + "\n".join(rows) + "\n", encoding="utf-8")
    assert refused(folder) == [f"{log}: {reason}: nothing is identifiable"]
    (folder / "log_heave_2.csv").write_text(log.read_text(encoding="utf-8") + "9,,\n", encoding="utf-8")
    assert [line.partition(": ")[0] for line in refused(folder)] == [
        str(folder / name) for name in ("log_heave.csv", "log_heave_2.csv")
    ]


def test_a_folder_with_the_name_of_a_table_is_refused(folder: Path) -> None:
    (folder / "steady_surge.csv").unlink()
    (folder / "steady_surge.csv").mkdir()
    assert refused(folder) == [f"{folder / 'steady_surge.csv'}: cannot be read: Is a directory"]


def refused(folder: Path) -> list[str]:
    """Return the lines of the refusal."""
    with pytest.raises(FileError) as error:
        load_tests(folder)
    return str(error.value).splitlines()


def test_a_refusal_leaves_the_output_as_it_was(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "steady_surge.csv").write_text(STEADY, encoding="utf-8")
    (folder / "out.toml").write_text("before", encoding="utf-8")
    there = {path: path.read_bytes() for path in folder.iterdir()}
    assert main(["identify", str(folder), "--force", "-o", str(folder / "out.toml")]) == 2
    assert capsys.readouterr().out == ""
    assert {path: path.read_bytes() for path in folder.iterdir()} == there
