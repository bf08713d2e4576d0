"""Variables of MATLAB, logs with the names of tables, and jumps of sensors."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.inspection.inspection import inspect
from rov_fmu.tank.quality import checked_log, uninterrupted
from rov_fmu.tank.readers.tables import open_matlab
from rov_fmu.vehicle.vehicle import VehicleFileError
from tests.folders import rows_of
from tests.tank.logs import channel, commanded, commands, log, measured, used
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, TIME
from tests.tank.readers.writers import table
from tests.tank.test_several_files import ROV

FOLDER = ROV.replace("Dive of May", "x")


def folder(path: Path, more: str = "") -> Path:
    path.mkdir(exist_ok=True)
    (path / "rov.toml").write_text(f"{FOLDER}{more}", encoding="utf-8")
    return path


def dive(path: Path) -> Path:
    names = ",".join(f"u_{name} [1]" for name in motion.THRUSTERS)
    table(path, f"time [s],{names},depth [m]", TIME, *motion.THRUSTERS.values(), motion.DEPTH)
    return path


# ---- Formats ---------------------------------------------------------------------------------------------------------


def test_variables_of_matlab(tmp_path: Path) -> None:
    """A structure of vectors with a matrix of pulses, as theses publish them."""
    pulses = np.column_stack([1500.0 + 400.0 * c for c in motion.THRUSTERS.values()])
    savemat(tmp_path / "dive.mat", {"log": {"t": TIME, "pwm": pulses, "z": motion.DEPTH, "note": "a dive"}})
    columns = '[columns]\n"log.t" = "time [s]"\n"log.z" = "depth [m]"\n'
    columns += "".join(f'"log.pwm({n})" = "u_{n} [us]"\n' for n in range(1, 7))
    (seen,) = inspect(Path(shutil.copy(tmp_path / "dive.mat", tmp_path / "any")), [BLUEROV2])
    assert seen.columns["log.t"] == "time [s]"
    assert seen.columns["log.pwm(1)"] == "u_1 [us]"
    (tmp_path / "any").unlink()
    (log,) = load_tests(folder(tmp_path, columns)).folder.logs
    assert measured(log, "depth") == pytest.approx(motion.DEPTH)
    assert commanded(log, "6") == pytest.approx(motion.THRUSTERS["6"])


MATLAB = {
    "t m(1) m(2)": {"t": [0.0, 1.0, 2.0], "m": np.ones((2, 3)), "x": [0.0, 1.0], "s": "text"},
    "tout m(1) m(2) m(3)": {"tout": [0.0, 1.0, 2.0], "m": np.ones((3, 3)), "t": 1.0},
    "a b": {"a": [0, 1, 2], "b": [True, False, True], "c": [0.0, 1.0]},
}
"""The headers of variables: of all vectors and columns of matrices that are as long as the time, or as most others."""


@pytest.mark.parametrize("headers", MATLAB)
def test_vectors_of_matlab(headers: str, tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", MATLAB[headers])
    assert open_matlab(tmp_path / "a.mat")().readline() == headers.replace(" ", ";") + "\n"


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (None, "has no vectors of numbers"),
        (
            b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + bytes(99),
            "is a .mat file of version 7.3 (HDF5), which SciPy does not read: save it with -v7",
        ),
    ],
)
def test_what_cannot_be_read_of_matlab(content: bytes | None, line: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(content) if content else savemat(path, {"x": 1.0, "y": "text"})
    with pytest.raises(DataFileError) as error:
        inspect(path, [BLUEROV2])
    assert str(error.value) == f"{path}: {line}"


@pytest.mark.parametrize("row", [1, 2, 60])
@pytest.mark.parametrize("quote", ['"', ""])
def test_zero_bytes_in_a_cell_of_text_say_nothing_about_the_format(row: int, quote: str, tmp_path: Path) -> None:
    path, lines = tmp_path / "a.csv", ["time [s],depth [m],source"]
    lines += [f"{n},{5 + n % 3},{quote}\0\0{quote}" if n == row else f"{n},{5 + n % 3},dvl" for n in range(1, 80)]
    path.write_text("\n".join(lines), encoding="utf-8")
    (seen,) = inspect(path, [BLUEROV2])
    assert (seen.unread, [channel.samples for channel in seen.channels]) == ({"source": "text"}, [79])
    for content in (b"\0" + path.read_bytes(), "a,b\n1,2\n".encode("utf-16-le"), b"a;b\x01\n\0\0"):
        path.write_bytes(content)
        with pytest.raises(DataFileError, match="its first bytes are those of none of the formats"):
            inspect(path, [BLUEROV2])


def test_what_is_listed_of_headers_that_are_not_known(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = ["0,1,x,1,5,5", "1,2,y,2,5,5", "2,3,z,a,5,5", "3,4,3,b,5,5", "4,5,4,,5,5"]
    listed = {"p": "text", "q": "1 to 2", "n": ""}
    for header, channels in ("time [s],depth [m],p,q,n,n", ["depth"]), ("time [s],r,p,q,n,n", []):
        path.write_text("\n".join([header, *rows]), encoding="utf-8")
        (seen,) = inspect(path, [BLUEROV2])
        assert seen.unread == ({} if channels else {"r": "1 to 5"}) | listed
        assert [row.name for row in seen.channels] == channels
    path.write_text("a,b\nx,y\n", encoding="utf-8")
    with pytest.raises(DataFileError) as error:
        inspect(path, [BLUEROV2])
    assert str(error.value) == f"{path}, line 1 = 'a, b': no column below these headers has numbers"


@pytest.mark.parametrize("name", ["thrust_t200_dive.csv", "steady_surge.csv"])
def test_a_log_with_the_name_of_a_table_is_a_log(name: str, tmp_path: Path) -> None:
    if "surge" in name:  # a log of the axis in its name
        table(tmp_path / name, "time [s],command [1],distance [m]", TIME, motion.THRUSTERS["5"], TIME)
    else:
        dive(tmp_path / name)
    tests = load_tests(folder(tmp_path))
    assert [one.file for one in tests.folder.logs] == [name]
    assert not rows_of(tests, "thrust")


# ---- Jumps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (
            motion.DEPTH + 1.5 * (TIME > 4.95) - (TIME > 7.95),
            "2 jumps of the depth, as by a reset: +1.51 m at 5 s, -0.99 m at 8 s",
        ),
        (motion.DEPTH + 0.195 * (TIME > 4.95), "1 jump of the depth, as by a reset: +0.205 m at 5 s"),
        (motion.HEADING + 0.5 * (TIME > 4.95), "1 jump of the heading, as by a reset: +30.4 deg at 5 s"),
        (motion.DEPTH + 0.185 * (TIME > 4.95), ""),
        (motion.DEPTH + 0.7 * (np.arange(len(TIME)) == 50), ""),
        (10.0 * TIME, ""),
        (motion.DEPTH + 0.5 * np.random.default_rng(2).standard_normal(len(TIME)), ""),
        (0.25 * np.round(4.0 * motion.DEPTH), ""),
    ],
    ids=["two", "the least", "of an angle", "too small", "an outlier", "a fast motion", "noise", "a coarse sensor"],
)
def test_a_jump_of_a_sensor_is_told(values: Array, told: str) -> None:
    down = commands(100.0 + TIME, {"t": np.where(TIME > 2.0, 0.5, 0.0)})
    quantity = "heading" if "heading" in told else "depth"
    found = checked_log(
        log(down, channel(quantity, 100.0 + TIME, values % (2.0 * np.pi) if "heading" in told else values))
    )
    assert sentences(found.findings) == ((f"a.csv: {told}. What follows counts as another log",) if told else ())


def test_a_log_is_divided_where_its_depth_is_reset() -> None:
    """The sample before a jump belongs to the piece before it. Other positions, which jump often, divide nothing."""
    jumped = motion.DEPTH + 1.5 * (TIME > 4.95)
    down = commands(TIME, {"t": np.where(TIME > 2.0, 0.5, 0.0)})
    first, second = uninterrupted(log(down, channel("depth", TIME, jumped)))
    assert np.array_equal(np.concatenate([used(one, "depth").time for one in (first, second)]), TIME)
    assert used(second, "depth").time[0] == pytest.approx(5.0)
    along = log(down, channel("surge distance", TIME, jumped))
    assert uninterrupted(along) == [along]


@pytest.mark.parametrize("least", [0.0, 0.3, 2.0])
@pytest.mark.parametrize(("turned", "at"), [(0.0, 0), (30.0, 60), (-25.0, 20)])
def test_an_attitude_jumps_by_its_rotation_also_where_the_bow_is_vertical(turned: float, at: int, least: float) -> None:
    """A vehicle that pitches over passes the vertical as closely as `least`, degrees, where roll and heading change by
    half a turn. The first reset is there, the second one elsewhere."""
    noise = Rotation.from_rotvec(0.003 * np.random.default_rng(5).standard_normal((len(TIME), 3)))
    pitching = Rotation.from_euler("ZYX", np.column_stack([0.4 + 0.0 * TIME, 0.5 * (TIME - 3.0), 0.0 * TIME]))
    tilted = Rotation.from_euler("X", np.radians(least))
    reset = Rotation.from_rotvec(np.outer(np.arange(len(TIME)) > at, [0.0, 0.0, np.radians(turned)]))
    yaw, pitch, roll = (reset * tilted * pitching * noise).as_euler("ZYX").T
    assert np.abs(np.diff(np.unwrap(yaw))).max() > 0.4
    down = commands(TIME, {"t": np.where(TIME > 2.0, 0.5, 0.0)})
    angles = {"roll angle": roll, "pitch angle": pitch, "heading": yaw % (2.0 * np.pi)}
    whole = log(down, *(channel(name, TIME, values) for name, values in angles.items()))
    told = [one.words["jumps"] for one in checked_log(whole).findings]
    pieces = uninterrupted(checked_log(whole))
    if not turned:
        assert (told, len(pieces)) == ([], 1)
    else:
        (words,) = told
        size, _, _, time, *_ = str(words).split()
        assert float(size) == pytest.approx(abs(turned), abs=3.0)
        assert float(time) == pytest.approx(TIME[at + 1])
        assert len(pieces) == 2


TOE = """[vehicle]
name = "Toe"
identifier = "toe"
version = "1.0"
description = "Two thrusters with a toe-in"
source = "x"
[body]
m_rov = { value = 10.0, unit = "kg", source = "x" }
I_r = { value = 0.3, unit = "kg.m2", source = "x" }
[curves.t]
[[thruster]]
name = "l"
curve = "t"
direction = { value = [0.966, 0.259, 0.0], source = "x" }
position = { value = [-0.2, -0.15, 0.0], unit = "m", source = "x" }
[[thruster]]
name = "r"
curve = "t"
direction = { value = [0.966, -0.259, 0.0], source = "x" }
position = { value = [-0.2, 0.15, 0.0], unit = "m", source = "x" }
[known]
a_t_t = { value = 20.0, unit = "N", source = "x" }
b_t_t = { value = 5.0, unit = "N", source = "x" }
"""


@pytest.mark.parametrize("axes", ["", "[axes.surge]\n[axes.yaw]\n"])
def test_thrusters_with_a_toe_in_and_a_log_with_sway(axes: str, tmp_path: Path) -> None:
    """The thrusters drive sway only together with yaw, so the column must not make the vehicle impossible."""
    (tmp_path / "rov.toml").write_text(TOE + axes, encoding="utf-8")
    titles = "time [s],u_l [1],u_r [1],surge velocity [m/s],sway velocity [m/s],heading [rad]"
    left, right = np.where(TIME > 2.0, 0.5, 0.0), np.where(TIME > 5.0, 0.3, 0.0)
    table(tmp_path / "dive.csv", titles, TIME, left, right, motion.U, motion.V, motion.HEADING)
    tests = load_tests(tmp_path)
    assert [*tests.layout.by_name] == tests.logged == ["surge", "yaw"]
    assert "dive.csv: the motion in sway is left out, because the thrusters drive it only together with" in (
        "\n".join(sentences(tests.folder.findings))
    )


def test_rov_toml_leaves_an_axis_out_of_a_log(tmp_path: Path) -> None:
    """Its channel is told as left out, and what the log shows of another axis stays."""
    (log,) = load_tests(folder(dive(tmp_path / "dive.csv").parent)).folder.logs
    assert log.used("depth")
    names = ",".join(f"u_{name} [1]" for name in motion.THRUSTERS)
    columns = TIME, *motion.THRUSTERS.values(), motion.DEPTH, np.sin(TIME)
    table(tmp_path / "dive.csv", f"time [s],{names},depth [m],surge velocity [m/s]", *columns)
    tests = load_tests(folder(tmp_path, '[leave_out]\n"dive.csv" = ["heave"]\n'))
    (log,) = tests.folder.logs
    assert not log.used("depth")
    assert log.used("surge velocity")
    told = [line for line in sentences(tests.folder.findings) if "[leave_out]" in line]
    assert told == ["dive.csv: heave left out, as [leave_out] in rov.toml says"]


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ('"dive2.csv" = ["heave"]', "leave_out.dive2.csv"),
        ('"dive.csv" = ["depth"]', "must name axes"),
    ],
)
def test_a_wrong_entry_of_leave_out_is_one_line(entry: str, told: str, tmp_path: Path) -> None:
    dive(tmp_path / "dive.csv")
    with pytest.raises(VehicleFileError, match=told) as error:
        load_tests(folder(tmp_path, f"[leave_out]\n{entry}\n"))
    assert len(str(error.value).splitlines()) == 1
