"""What the companions compute, and a system that is run, against what is known in closed form."""

import shutil
import zipfile
from io import BytesIO
from math import cos, cosh, hypot, pi, sin, sinh
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder
from scipy.optimize import brentq

from rov_fmu.bridges.system.companion import companion, slave_of
from rov_fmu.bridges.system.companions.current import Current
from rov_fmu.bridges.system.connections import Connection
from rov_fmu.bridges.system.half_step import half_step
from rov_fmu.bridges.system.part import read_part
from rov_fmu.bridges.system.run import run_system
from rov_fmu.bridges.system.ssp import Structure
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import FileError
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.bridges.system.fmus import foreign
from tests.commands import without_progress
from tests.vehicles import tied

HERE = Path(__file__).parent


def test_the_new_companions_are_short() -> None:
    for name in ("tether", "current"):
        source = Path(slave_of(name).__module__.replace(".", "/")).with_suffix(".py")
        assert len((HERE.parents[2] / source).read_text(encoding="utf-8").splitlines()) <= 150


# ---- A current -------------------------------------------------------------------------------------------------------


def test_a_current_follows_its_profile() -> None:
    water = Current(instance_name="water")
    water.speed, water.direction, water.seabed, water.z, water.rise = 0.4, 0.5, 20.0, 5.0, 10.0
    water.exit_initialization_mode()
    assert (water.V_N, water.V_E) == (0.0, 0.0)
    water.do_step(2.0, 3.0)
    speed = 0.5 * 0.4 * 0.75 ** (1 / 7)
    assert pytest.approx([speed * cos(0.5), speed * sin(0.5)]) == [water.V_N, water.V_E]
    levels = [[getattr(water, f"{name}_{n}") for n in range(1, 7)] for name in ("depth", "V_N")]
    assert levels[0] == [0.0, 4.0, 8.0, 12.0, 16.0, 20.0]
    assert levels[1][0] == pytest.approx(0.2 * cos(0.5))
    assert levels[1][-1] == 0.0


ROWS = "time,z,V_N,V_E\n0,0,0.4,0\n0,10,0.2,0.1\n20,0,0,0\n"
AT = {(0.0, 0.0): (0.4, 0.0), (0.0, 5.0): (0.3, 0.05), (10.0, 5.0): (0.15, 0.025), (30.0, 50.0): (0.0, 0.0)}
"""The velocity by time and depth: on straight lines between the rows, and outside of them that of the nearest one."""


def test_a_current_follows_its_file(tmp_path: Path) -> None:
    file = tmp_path / "current.csv"
    file.write_text(ROWS, encoding="utf-8")
    with zipfile.ZipFile(BytesIO(companion("current", file))) as fmu:
        fmu.extract("resources/table.json", tmp_path)
    water = Current(instance_name="water", resources=tmp_path / "resources")
    for (time, z), velocity in AT.items():
        water.z = z
        water.do_step(time - 1.0, 1.0)
        assert pytest.approx(velocity) == [water.V_N, water.V_E]
    for text, message in (
        (ROWS.replace("V_E", "V_X"), "column 'V_X': must be one of time, z, V_N, V_E"),
        ("time,z\n0,1\n", "column 'V_N' is missing"),
    ):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(DataFileError, match=message):
            companion("current", file)


# ---- A tether --------------------------------------------------------------------------------------------------------

WEIGHT = (0.2 - 1025.0 * pi / 4 * 0.0076**2) * 9.80665 * 20.0
"""That of the tether below, in water, N."""


def tether(seconds: float, step: float = 0.05, **values: float) -> Any:
    """Return a heavy tether of 20 m between two ends at the same depth, 15 m apart, after some time."""
    pytest.importorskip("moordyn")
    made: Any = slave_of("tether")(instance_name="tether")
    vars(made).update({"length": 20.0, "mass": 0.2, "y_top": 15.0, "z_top": 5.0, "z_bottom": 5.0, **values})
    for n in range(round(seconds / step)):
        assert made.do_step(n * step, step)
    made.terminate()
    return made


def test_a_tether_at_rest_pulls_like_a_catenary() -> None:
    """Half of the weight hangs at each end, and H = w a, where 2 a sinh(15 / 2a) is the length."""
    at_rest = tether(15.0)
    assert at_rest.F_D_top == pytest.approx(0.5 * WEIGHT, rel=0.01)
    assert at_rest.F_D_bottom == pytest.approx(0.5 * WEIGHT, rel=0.01)
    a = brentq(lambda a: 2.0 * a * sinh(7.5 / a) - 20.0, 1.0, 100.0)
    assert -at_rest.F_E_top == pytest.approx(WEIGHT / 20.0 * a, rel=0.02)
    assert at_rest.F_E_bottom == pytest.approx(WEIGHT / 20.0 * a, rel=0.02)
    assert abs(at_rest.F_N_top) < 0.01
    assert at_rest.z_5 - 5.0 == pytest.approx(a * (cosh(7.5 / a) - 1.0), rel=0.02)
    assert (at_rest.x_0, at_rest.y_0, at_rest.z_0) == (0.0, 15.0, 5.0)
    assert at_rest.tension_top == pytest.approx(hypot(0.5 * WEIGHT, WEIGHT / 20.0 * a), rel=0.02)


def test_a_current_drags_a_tether_along_at_the_depths_where_it_flows() -> None:
    profile = {f"depth_{n}": 4.0 * (n - 1) for n in range(1, 7)}
    flows = tether(15.0, **profile, **{f"V_N_{n}": 0.5 for n in range(1, 7)})
    drag = flows.F_N_top + flows.F_N_bottom
    most = 0.5 * 1025.0 * 1.2 * 0.0076 * 20.0 * 0.5**2
    assert 0.7 * most < drag < most
    below = tether(15.0, **profile, V_N_5=0.5, V_N_6=0.5)  # the tether hangs between 5 m and 11 m
    assert abs(below.F_N_top + below.F_N_bottom) < 0.01 * most


def test_steps_that_differ_in_their_last_bits_make_no_difference() -> None:
    """Those of an importer that counts in nanoseconds do."""
    first, second = tether(0.5), tether(0.5, step=0.05 + 1e-15)
    assert all(getattr(first, name) == getattr(second, name) for name in slave_of("tether").variables)


def test_the_peak_of_a_snap_load_grows_with_the_step_as_the_page_says() -> None:
    """A BlueROV2 sets off ahead with 60 %, and a tether of 60 m with 1 m of slack stops it.

    Steps of 1 ms give 85.4 N.
    """
    pytest.importorskip("moordyn")
    rov = tied(load_vehicle(SHIPPED["bluerov2"]), tether=(-0.2, 0.0, -0.1))
    inputs = rov.layout.usual_inputs | rov.layout.commands_along(SURGE, 0.6)
    ports = {f"{x}_bottom": f"{x}_tether" for x in ("x", "y", "z", "vg_N", "vg_E", "vg_D")}
    excess = []
    for h in (0.05, 0.1):
        line: Any = slave_of("tether")(instance_name="tether")
        line.x_top, line.z_top = -59.2, 9.9
        state, most = rov.layout.at_rest | {"z": 10.0}, 0.0
        for n in range(round(0.9 / h)):
            now = state | rov.calculated(inputs, state)
            vars(line).update({place: now[name] for place, name in ports.items()})
            force = {f"F_{d}_tether": getattr(line, f"F_{d}_bottom") for d in "NED"}
            assert line.do_step(n * h, h)
            state = rov.step(inputs | force, state, h)
            most = max(most, line.tension_bottom)
        line.terminate()
        excess.append(most / 85.4 - 1.0)
    assert excess == pytest.approx([0.09, 0.25], abs=0.005)


def test_a_step_that_moordyn_cannot_do_is_refused() -> None:
    pytest.importorskip("moordyn")
    made: Any = slave_of("tether")(instance_name="tether")
    made.x_top = float("nan")
    assert not made.do_step(0.0, 0.1)
    assert made.log_queue[0].msg.startswith("MoorDyn: ")
    made.terminate()


# ---- A system that is run --------------------------------------------------------------------------------------------


def test_a_run_writes_the_motion_and_a_plot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["system", str(HERE / "current.toml"), "-o", str(tmp_path / "my.ssp"), "--run"]
    assert main(line) == 0
    assert "water: nothing" not in capsys.readouterr().err, "its input has a start value"
    motion = np.genfromtxt(tmp_path / "my.csv", delimiter=",", names=True, deletechars="")
    assert motion["time"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert motion["water.V_N"] == pytest.approx(0.4 * 0.75 ** (1 / 7) * cos(0.5) * motion["time"] / 4.0)
    assert "water.V_N" in (tmp_path / "my.svg").read_text(encoding="utf-8")
    assert main(line) == 0, "a second run replaces what the first one wrote"
    with (tmp_path / "my.csv").open("a") as file:
        file.write("9,9\n")
    assert main(line) == 2
    assert "my.csv: cannot be written: the file there has no mark" in capsys.readouterr().err


def test_a_file_that_a_plan_reads_is_not_replaced_by_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, rows = tmp_path / "plan.toml", tmp_path / "my.csv"
    parts = '[component.w]\ncompanion = "current"\nfile = "my.csv"\n[component.r]\nvehicle = "rov/bluerov2.toml"\n'
    plan.write_text(f"step = 1.0\nstop_time = 1.0\n{parts}", encoding="utf-8")
    rows.write_text("time (s),z (m),V_N (m/s),V_E (m/s)\n0,0,1,0\n", encoding="utf-8")
    models = shutil.copytree(SHIPPED["bluerov2"].parent, tmp_path / "rov")
    table = next(path for path in load_vehicle(models / "bluerov2.toml").files if path.suffix == ".csv")
    for path in (rows, table):
        before = path.read_bytes()
        assert main(["system", str(plan), "-o", str(path.with_suffix(".ssp")), "--run", "--force"]) == 2
        assert f"would overwrite {path}, an input" in capsys.readouterr().err
        assert path.read_bytes() == before


def test_an_output_arrives_a_step_later(tmp_path: Path) -> None:
    """All pass on their outputs, then all take a step: z of the second water is V_N of the first, a step before."""
    part = read_part(Path("water"), companion("current"), is_ours=True)
    values = {"speed": 1.0, "exponent": 1.0, "seabed": 1.0, "z": 0.5}
    connections = [Connection(("a", "V_N"), ("b", "z"), 0.5)]
    structure = Structure({"a": part, "b": part}, {"a": {**values, "rise": 2.0}, "b": values}, connections)
    names = [("a", "V_N"), ("b", "V_N")]
    rows = run_system(structure, tmp_path, names, 1.0, 3).rows
    assert rows[:, 0].tolist() == [0.0, 0.25, 0.5, 0.5]
    assert rows[:, 1].tolist() == [0.5, 1.0, 1.0 - 0.5 * 0.25, 1.0 - 0.5 * 0.5]
    # Half the step: V_N of the first half a step before.
    halved = run_system(structure, tmp_path, names, 1.0, 3, parts=2).rows
    assert halved[:, 1].tolist() == [0.5, 1.0 - 0.5 * 0.125, 1.0 - 0.5 * 0.375, 1.0 - 0.5 * 0.5]
    half = half_step(rows, halved)
    assert half.largest.tolist() == [0.0, 0.0625]
    assert half.typical.tolist() == [0.0, pytest.approx(0.0625 / np.sqrt(2.0) / 0.5)]
    assert half.shares.tolist() == [0.0, 0.125, 0.125, 0.0]
    assert half.words(names).startswith("half the step changes b.V_N by 8.8% of its range: the numbers of this step")


def test_the_command_tells_what_half_the_step_changes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two waters, V = 1 - z, of which each is as deep as the other one was fast: they swing with every step."""
    water = 'companion = "current"\nstart = { speed = 1.0, exponent = 1.0, seabed = 1.0 }\n'
    connections = 'connect = [["a.V_N", "b.z", 0.9], ["b.V_N", "a.z", 0.5]]\n'
    plan = tmp_path / "plan.toml"
    plan.write_text(f"step = 1\nstop_time = 4\n{connections}[component.a]\n{water}[component.b]\n{water}", "utf-8")
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == 0
    printed = capsys.readouterr()
    assert "V_N by " in printed.err
    assert "of its range: the numbers of this step are not to be trusted" in printed.err
    (row,) = (line.split() for line in printed.out.splitlines() if line.startswith("a.V_N"))
    motion = np.genfromtxt(tmp_path / "my.csv", delimiter=",", names=True, deletechars="")
    assert row[:4] == ["a.V_N", "m/s", f"{motion['a.V_N'].min():.4g}", f"{motion['a.V_N'].max():.4g}"]
    assert motion["half_step"].max() > 0.5


STRANGE = {
    1: ("the step at 0.5 s: fmi2DoStep failed with status 2 (discard); the FMU: the rope is cut", 2),
    2: ("the step at 0.5 s: fmi2DoStep failed with status 4 (fatal); the FMU: Fatal py exception", 2),
    3: ("reading the outputs at 1 s: y is no number (NaN)", 2),
    4: ("warning: a: the rope is thin (at 0.5 s)", 0),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_an_fmu_says_is_told_with_its_name_and_the_time(
    kind: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    FmuBuilder.build_FMU(HERE / "strange.py", dest=tmp_path)
    plan = tmp_path / "plan.toml"
    start = f'fmu = "Strange.fmu"\nstart = {{ kind = {kind} }}\n'
    plan.write_text(f"step = 0.5\nstop_time = 2\n[component.a]\n{start}", encoding="utf-8")
    message, code = STRANGE[kind]
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == code
    assert capsys.readouterr().err.count(message) == 1


def test_a_run_that_fails_is_one_line_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "dead.fmu").write_bytes(foreign())  # it has no binary
    plan = tmp_path / "plan.toml"
    plan.write_text('step = 1.0\nstop_time = 1.0\n[component.a]\nfmu = "dead.fmu"\n', encoding="utf-8")
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == 2
    *_, line = without_progress(capsys.readouterr().err).splitlines()
    assert "the system cannot be run: a: the initialization at 0 s: " in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dead.fmu", "plan.toml"]


def test_a_run_with_too_many_values_is_refused(tmp_path: Path) -> None:
    part = read_part(Path("water"), companion("current"), is_ours=True)
    with pytest.raises(FileError, match="give 300,000,003 values"):
        run_system(Structure({"a": part}, {}, []), tmp_path, [("a", "V_N")] * 3, 1.0, 10**8)
