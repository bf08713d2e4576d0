"""What the companions compute, and a system that is run, against what is known in closed form."""

import re
import shutil
import sys
import zipfile
from io import BytesIO, StringIO
from math import cos, cosh, hypot, pi, sin, sinh, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder
from scipy.optimize import brentq

from rov_fmu.bridges.system.companion import companion, slave_of, timed_rows
from rov_fmu.bridges.system.companion import levels_of as levels_of_rows
from rov_fmu.bridges.system.companions.current import Current
from rov_fmu.bridges.system.connections import Connection, SystemStructure
from rov_fmu.bridges.system.half_step import half_step
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.bridges.system.run import passed, picture, recorded_names, run_system
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.fmus.variable import Value
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import FileError
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.bridges.system.fmus import foreign
from tests.commands import Capsys, without_progress
from tests.vehicles import tied

HERE = Path(__file__).parent


# ---- A current -------------------------------------------------------------------------------------------------------


def levels_of(water: Any) -> Any:
    """Return depth and velocity of the levels of a water, a row for each."""
    count = sum(name.startswith("depth_") for name in water.variables)
    return np.array([[getattr(water, f"{name}_{n + 1}") for name in NAMES] for n in range(count)])


NAMES = ("depth", "V_N", "V_E", "V_D")


def test_a_current_follows_its_profile() -> None:
    water = Current(instance_name="water")
    water.speed, water.direction, water.seabed, water.z, water.rise = 0.4, 0.5, 20.0, 5.0, 10.0
    water.exit_initialization_mode()
    assert (water.V_N, water.V_E) == (0.0, 0.0)
    water.do_step(2.0, 3.0)
    speed = 0.5 * 0.4 * 0.75 ** (1 / 7)
    assert pytest.approx([speed * cos(0.5), speed * sin(0.5)]) == [water.V_N, water.V_E]
    depth, V_N, *_ = levels_of(water).T
    z, most = np.linspace(0.0, 19.8, 500), 0.2 * cos(0.5)
    np.testing.assert_allclose(np.interp(z, depth, V_N), most * (1.0 - z / 20.0) ** (1 / 7), atol=0.005 * most)
    assert (depth[-1], V_N[-1]) == (20.0, 0.0)


ROWS = "time,z,V_N,V_E,V_D\n0,0,0.4,0,0\n0,10,0.2,0.1,0.4\n20,0,0,0,0\n20,4,0.4,0,0\n20,30,0,0,0\n"
AT = {
    (0.0, 0.0): (0.4, 0.0, 0.0),
    (0.0, 5.0): (0.3, 0.05, 0.2),
    (10.0, 5.0): (0.5 * (0.3 + 0.4 * 25.0 / 26.0), 0.025, 0.1),
    (30.0, 50.0): (0.0, 0.0, 0.0),
}
"""The velocity by time and depth: on straight lines between the rows, and outside of them that of the nearest one."""


def water_of(folder: Path, text: str, *places: str) -> Any:
    """Return a current with a file, as its FMU has it."""
    (folder / "current.csv").write_text(text, encoding="utf-8")
    rows = timed_rows(folder / "current.csv", Current.columns)
    with zipfile.ZipFile(BytesIO(companion("current", rows=rows, places=places, levels=levels_of_rows(rows)))) as fmu:
        fmu.extract("resources/shape.json", folder)
    return Current(instance_name="water", resources=folder / "resources")


def test_a_current_follows_its_file_at_every_place_and_as_a_profile(tmp_path: Path) -> None:
    water = water_of(tmp_path, ROWS, "b")
    for (time, z), velocity in AT.items():
        water.z, water.z_b = 0.5 * z, z
        water.do_step(time - 1.0, 1.0)
        assert pytest.approx(velocity) == [water.V_N_b, water.V_E_b, water.V_D_b]
        levels = levels_of(water)
        assert pytest.approx(velocity, abs=1e-15) == [np.interp(z, levels[:, 0], levels[:, k]) for k in (1, 2, 3)]
        half = [np.interp(0.5 * z, levels[:, 0], levels[:, k]) for k in (1, 2, 3)]
        assert pytest.approx(half, abs=1e-15) == [water.V_N, water.V_E, water.V_D]
    title, _, rows = ROWS.partition("\n")
    units = {"time": "time (s)", "z": "z (m)", **{name: f"{name} (m/s)" for name in ("V_N", "V_E", "V_D")}}
    with_units = ",".join(units[name] for name in title.split(","))
    assert levels_of(water_of(tmp_path, f"{with_units}\n{rows}", "b")).shape == levels_of(water).shape
    for text, message in (
        (ROWS.replace("V_E", "V_X"), "column 'V_X': must be one of time, z, V_N, V_E"),
        ("time,z\n0,1\n", "column 'V_N' is missing"),
        ("time,z,V_N,V_E\n0,1,0,0\n0,1,1,0\n", "time 0 s has two rows of z = 1 m"),
    ):
        with pytest.raises(DataFileError, match=message):
            water_of(tmp_path, text)


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


JET = "time,z,V_N,V_E\n0,0,0,0\n0,2,0,0\n0,3,0,0.5\n0,7,0,0.5\n0,8,0,0\n"


def test_a_tether_feels_a_jet_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The water between 3 and 7 m flows; at each node of the tether it has the velocity of the file."""
    water = water_of(tmp_path, JET)
    water.seabed = 30.0
    water.exit_initialization_mode()
    profile = {
        f"{name}_{n}": x for n, row in enumerate(levels_of(water), 1) for name, x in zip(NAMES, row, strict=True)
    }
    ends = {"mass": 0.0465, "y_top": 0.0, "z_top": 0.0, "z_bottom": 14.9, "x_bottom": -0.2}
    found = tether(60.0, **ends, **profile)
    depths, speeds = np.loadtxt(StringIO(JET), delimiter=",", skiprows=1).T[[1, 3]]
    module = sys.modules[type(found).__module__]
    monkeypatch.setattr(module, "at", lambda _, depth: [0.0, np.interp(depth, depths, speeds), 0.0])
    expected = tether(60.0, **ends)
    assert found.tension_bottom == pytest.approx(expected.tension_bottom, rel=1e-3)
    assert (found.F_E_bottom, found.tension_bottom) == pytest.approx((1.741, 2.906), rel=0.01)


def test_water_that_wells_up_lifts_a_tether() -> None:
    """Across a tether that is nearly level, as much as water that flows across it."""
    ends = {"mass": 0.0465, "length": 15.5}
    levels = {"depth_1": 0.0, "depth_2": 100.0}
    up = tether(30.0, **ends, **levels, V_D_1=-0.5, V_D_2=-0.5)
    across = tether(30.0, **ends, **levels, V_N_1=0.5, V_N_2=0.5)
    assert up.F_D_top + up.F_D_bottom == pytest.approx(-(across.F_N_top + across.F_N_bottom), rel=0.02)
    assert up.F_D_top < -1.0


def test_a_tether_on_the_seabed_pulls_like_a_catenary() -> None:
    """T - H = w h for a line that hangs down to the seabed, h below its end, and ends there."""
    on_it = tether(60.0, seabed=12.0, length=25.0, z_top=2.0, z_bottom=11.9)
    assert max(getattr(on_it, f"z_{n}") for n in range(11)) == pytest.approx(12.0, abs=0.01)
    H = hypot(on_it.F_N_top, on_it.F_E_top)
    assert on_it.tension_top - H == pytest.approx(WEIGHT / 20.0 * 10.0, rel=0.02)


@pytest.mark.parametrize(
    "values",
    [
        {"mass": 0.0465, "length": 60.0, "seabed": 12.0, "y_top": -25.0, "z_top": 0.0, "z_bottom": 8.0},
        {"mass": 0.6, "diameter": 0.025, "EA": 1e6, "length": 300.0, "seabed": 20.0},
        {"mass": 0.05, "diameter": 0.004, "EA": 5e3, "length": 150.0, "seabed": 5.0, "z_bottom": 4.9},
        {"mass": 0.2, "length": 60.0, "depth_1": 0.0, "depth_2": 20.0},
    ],
)
def test_no_tether_shakes_on_the_seabed(values: dict[str, float]) -> None:
    """A slack one begins as a shape that hangs far below the seabed."""
    at_rest = tether(20.0, **values)
    ground = values.get("seabed", 20.0)
    assert max(getattr(at_rest, f"z_{n}") for n in range(11)) == pytest.approx(ground, abs=0.05)
    assert at_rest.tension_top < 60.0
    later = tether(22.0, **values)
    assert later.tension_top == pytest.approx(at_rest.tension_top, abs=0.5)


def test_what_the_seabed_and_the_numbers_forbid_is_told() -> None:
    below = tether(0.1, seabed=4.0)
    assert "the upper end begins 5 m deep, below the seabed at 4 m" in below.log_queue[0].msg
    made: Any = slave_of("tether")(instance_name="tether")
    made.mass = 0.0
    assert not made.do_step(0.0, 0.1)
    assert made.log_queue[0].msg == "MoorDyn: mass must be from 0.0001 to 10000: 0"


@pytest.mark.parametrize("h", [0.02, 0.1])
def test_the_velocity_of_an_end_may_follow_from_its_place(h: float) -> None:
    """A tip that heaves by half a metre in 8 s."""
    pytest.importorskip("moordyn")
    tensions = []
    for difference in (False, True):
        made: Any = slave_of("tether")(instance_name="tether")
        vars(made).update(length=30.0, mass=0.3, x_bottom=25.0, z_bottom=15.0, difference_top=difference)
        some = []
        for n in range(round(24.0 / h)):
            made.z_top, omega = 0.5 * sin(pi / 4.0 * n * h), pi / 4.0
            made.vg_D_top = 0.0 if difference else 0.5 * omega * cos(omega * n * h)
            assert made.do_step(n * h, h)
            some.append(made.tension_top)
        made.terminate()
        tensions.append(np.array(some[round(8.0 / h) :]))
    assert np.ptp(tensions[0]) > 45.0
    np.testing.assert_allclose(tensions[1], tensions[0], rtol=0.002)


def test_steps_that_differ_in_their_last_bits_make_no_difference() -> None:
    """Those of an importer that counts in nanoseconds do."""
    first, second = tether(0.5), tether(0.5, step=0.05 + 1e-15)
    assert all(getattr(first, name) == getattr(second, name) for name in first.variables)


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


def catenary(length: float, span: float = 15.0) -> float:
    """Return the tension at the ends of a catenary of the tether above, N."""
    a = brentq(lambda a: 2.0 * a * sinh(0.5 * span / a) - length, 1.0, 1000.0)
    return WEIGHT / 20.0 * hypot(0.5 * length, a)


def test_a_tether_is_paid_out_and_hauled_in_as_a_catenary_that_changes_slowly() -> None:
    pytest.importorskip("moordyn")
    made: Any = slave_of("tether")(instance_name="tether")
    vars(made).update(length=20.0, mass=0.2, y_top=15.0, z_top=5.0, z_bottom=5.0, shortest=18.0, reel_speed=0.05)
    lengths = []
    for n in range(2400):
        made.length = 20.0 if n < 200 else 22.0 if n < 1200 else 5.0
        assert made.do_step(0.05 * n, 0.05)
        lengths.append(made.paid)
        if n in (100, 500, 800, 1150, 1500, 2000, 2300):  # not where the reel begins and ends to turn, which jerks
            assert made.tension_top == pytest.approx(catenary(made.paid), rel=0.005)
    made.terminate()
    assert np.diff(lengths).max() == pytest.approx(0.05 * 0.05)
    assert np.diff(lengths).min() == pytest.approx(-0.05 * 0.05)
    assert lengths[1199] == pytest.approx(22.0)
    assert lengths[-1] > 18.0
    assert lengths[:200] == [20.0] * 200


def test_a_weight_that_is_lowered_sinks_as_fast_as_the_winch_turns_and_pulls_by_its_weight() -> None:
    """The winch gains speed with its acceleration, and pays out when it renders."""
    pytest.importorskip("moordyn")
    line: Any = slave_of("tether")(instance_name="tether")
    winch: Any = slave_of("winch")(instance_name="winch")
    vars(line).update(length=10.0, mass=0.0465, seabed=200.0, z_bottom=10.0)
    vars(winch).update(length_0=10.0, fastest=0.4, acceleration=0.2)
    winch.exit_initialization_mode()
    m, weight, z, w, h = 20.0, 100.0, 10.0, 0.0, 0.01
    speeds, tensions = [], []
    for n in range(3000):
        winch.speed = 1.0 if n >= 1000 else 0.0
        line.z_bottom, line.vg_D_bottom, line.length = z, w, winch.length
        assert line.do_step(n * h, h)
        assert winch.do_step(n * h, h)
        w += h * (weight + line.F_D_bottom - 60.0 * w * abs(w)) / m
        z += h * w
        speeds.append(w)
        tensions.append(line.tension_bottom)
    line.terminate()
    assert np.mean(speeds[800:1000]) == pytest.approx(0.0, abs=1e-3)
    assert np.mean(speeds[2000:]) == pytest.approx(0.4, rel=0.01)
    assert winch.length == pytest.approx(10.0 + 0.5 * 0.2 * 2.0**2 + 0.4 * 18.0, abs=0.01)
    assert np.mean(tensions[2000:]) == pytest.approx(weight - 60.0 * 0.4**2, rel=0.02)
    winch.speed, winch.render, winch.tension = -1.0, 80.0, 90.0
    for _ in range(400):
        winch.do_step(0.0, h)
    assert winch.turning == 0.4
    winch.tension = 70.0
    for _ in range(800):
        winch.do_step(0.0, h)
    assert winch.turning == -0.4


def test_a_step_that_moordyn_cannot_do_is_refused() -> None:
    pytest.importorskip("moordyn")
    made: Any = slave_of("tether")(instance_name="tether")
    made.x_top = float("nan")
    assert not made.do_step(0.0, 0.1)
    assert made.log_queue[0].msg.startswith("MoorDyn: ")
    made.terminate()


# ---- A battery -------------------------------------------------------------------------------------------------------


def test_a_battery_ends_after_the_time_of_peukerts_law() -> None:
    """148 W at 14.8 V are 10 A; 18 A.h, stated for 20 h, then last 20 (18 / (20 10))^1.1 h."""
    battery: Any = slave_of("battery")(instance_name="battery")
    values = {"E_full": 14.8, "E_empty": 14.8, "capacity": 18.0, "resistance": 0.0, "peukert": 1.1}
    vars(battery).update(values, hotel_load=48.0, electric_power=100.0)
    battery.exit_initialization_mode()
    assert battery.voltage == 14.8
    steps = 0
    while not battery.empty:
        assert battery.do_step(10.0 * steps, 10.0)
        steps += 1
    assert battery.electric_current == pytest.approx(10.0)
    assert 10.0 * steps == pytest.approx(3600.0 * 20.0 * (18.0 / (20.0 * 10.0)) ** 1.1, abs=10.0)
    battery.do_step(0.0, 10.0)
    assert [one.msg for one in battery.log_queue] == ["the battery is empty: its 18 A.h have been drawn"]


def test_a_battery_gives_at_most_the_power_at_half_of_its_voltage() -> None:
    battery: Any = slave_of("battery")(instance_name="battery")
    vars(battery).update(E_full=16.0, resistance=0.1, hotel_load=0.0, capacity=1e6)
    for power, voltage, overloaded in ((600.0, 8.0 + sqrt(64.0 - 60.0), False), (700.0, 8.0, True)):
        battery.electric_power = power
        battery.do_step(0.0, 1.0)
        assert battery.voltage == pytest.approx(voltage, rel=1e-3)
        assert battery.overloaded is overloaded
    assert "overloaded: 700 W" in battery.log_queue[0].msg


# ---- A system that is run --------------------------------------------------------------------------------------------


def test_a_run_writes_the_motion_and_a_plot(tmp_path: Path, capsys: Capsys) -> None:
    line = ["system", str(HERE / "current.toml"), "-o", str(tmp_path / "my.ssp"), "--run"]
    assert main(line) == 0
    assert "water: nothing" not in capsys.readouterr().err, "its input has a start value"
    motion = np.genfromtxt(tmp_path / "my.csv", delimiter=",", names=True, deletechars="")
    assert motion["time"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert motion["water.V_N"] == pytest.approx(0.4 * 0.75 ** (1 / 7) * cos(0.5) * motion["time"] / 4.0)
    drawn = (tmp_path / "my.svg").read_text(encoding="utf-8")
    assert "Velocity of water (m/s)" in drawn
    assert ">V_N<" in drawn
    assert main(line) == 0, "a second run replaces what the first one wrote"
    with (tmp_path / "my.csv").open("a") as file:
        file.write("9,9\n")
    assert main(line) == 2
    assert "my.csv: cannot be written: the file there has no mark" in capsys.readouterr().err


def test_a_plot_has_a_panel_for_each_quantity_and_few_lines_in_it() -> None:
    """Eight lines are two panels, a tension is shown although nothing is connected to it, and levels are left out."""
    parts = {
        name: SystemFmu.open(Path(name), companion(kind), is_ours=True)
        for name, kind in {"water": "current", "rope": "tether"}.items()
    }
    start = ("water", "V_N")
    structure = SystemStructure(
        parts, {}, [Connection(start, ("rope", "V_N_1")), Connection(("water", "V_N_1"), start)]
    )
    read = [name for name in recorded_names(structure) if name[1].startswith(("V_N", "tension_", "F_"))]
    rows = np.arange(4.0)[:, None] + np.arange(len(read))
    drawn = picture(structure, read, [], 1.0, rows)
    titles = re.findall(r"font-weight:700[^>]*>([^<]+)<", drawn)
    assert titles == ["Velocity of water (m/s)", "Force of rope, top (N)", "Force of rope, bottom (N)"]
    assert ">V_N_1<" not in drawn
    chosen = [".".join(name) for name in read if name[1].startswith("V_N")][:8]
    drawn = picture(structure, read, chosen, 1.0, rows)
    assert re.findall(r"font-weight:700[^>]*>([^<]+)<", drawn) == ["Velocity of water (m/s)"] * 2
    assert all(f">{name.partition('.')[2]}<" in drawn for name in chosen)


def test_a_length_is_a_place_if_a_terminal_has_it_as_one(videoray_fmu: Path) -> None:
    """The elevation of a sea is none."""
    sea = SystemFmu.open(Path("sea"), companion("seaway"), is_ours=True)
    structure = SystemStructure({"rov": SystemFmu.open(videoray_fmu), "sea": sea}, {}, [])
    rows = np.arange(4.0)[:, None] + np.arange(2)
    drawn = picture(structure, [("rov", "z"), ("sea", "elevation")], ["rov.z", "sea.elevation"], 1.0, rows)
    assert re.findall(r"font-weight:700[^>]*>([^<]+)<", drawn) == ["Place of rov (m)", "Sea (m)"]


def test_a_stranger_may_number_its_outputs() -> None:
    """Nodes and levels are members of terminals; another output whose name ends like theirs is drawn and compared."""
    parts = {name: SystemFmu.open(Path(name), foreign(output="y_p1")) for name in ("a", "b")}
    structure = SystemStructure(parts, {}, [Connection(("a", "y_p1"), ("b", "u"))])
    read = recorded_names(structure)
    assert passed(structure) == [("a", "y_p1")]
    assert ">y_p1<" in picture(structure, read, [], 1.0, np.arange(4.0)[:, None] + np.arange(len(read)))


def test_a_file_that_a_plan_reads_is_not_replaced_by_force(tmp_path: Path, capsys: Capsys) -> None:
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
    part = SystemFmu.open(Path("water"), companion("current"), is_ours=True)
    values: dict[str, Value] = {"speed": 1.0, "exponent": 1.0, "seabed": 1.0, "z": 0.5}
    connections = [Connection(("a", "V_N"), ("b", "z"), 0.5)]
    structure = SystemStructure({"a": part, "b": part}, {"a": {**values, "rise": 2.0}, "b": values}, connections)
    names = [("a", "V_N"), ("b", "V_N")]
    rows = run_system(structure, tmp_path, names, 1.0, 3).rows
    assert rows[:, 0].tolist() == [0.0, 0.25, 0.5, 0.5]
    assert rows[:, 1].tolist() == [1.0, 1.0, 1.0 - 0.5 * 0.25, 1.0 - 0.5 * 0.5]
    # Half the step: V_N of the first half a step before.
    halved = run_system(structure, tmp_path, names, 1.0, 3, parts=2).rows
    assert halved[:, 1].tolist() == [1.0, 1.0 - 0.5 * 0.125, 1.0 - 0.5 * 0.375, 1.0 - 0.5 * 0.5]
    half = half_step(rows, halved, ["m/s", "m/s"])
    assert half.largest.tolist() == [0.0, 0.0625]
    assert half.typical.tolist() == [0.0, pytest.approx(0.0625 / np.sqrt(2.0) / 0.25)]
    assert half.shares.tolist() == [0.0, 0.25, 0.25, 0.0]
    assert half.words(names).startswith("untrustworthy: half the step changes b.V_N by 17.7% of its range: take")


def test_the_command_tells_what_half_the_step_changes(tmp_path: Path, capsys: Capsys) -> None:
    """Two waters, V = 1 - z, of which each is as deep as the other one was fast: they swing with every step."""
    water = 'companion = "current"\nstart = { speed = 1.0, exponent = 1.0, seabed = 1.0 }\n'
    connections = 'connect = [["a.V_N", "b.z", 0.9], ["b.V_N", "a.z", 0.5]]\n'
    plan = tmp_path / "plan.toml"
    plan.write_text(f"step = 1\nstop_time = 4\n{connections}[component.a]\n{water}[component.b]\n{water}", "utf-8")
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == 0
    printed = capsys.readouterr()
    assert "V_N by " in printed.err
    assert "untrustworthy: half the step changes" in printed.err
    (row,) = (line.split() for line in printed.out.splitlines() if line.startswith("a.V_N"))
    motion = np.genfromtxt(tmp_path / "my.csv", delimiter=",", names=True, deletechars="")
    assert row[:4] == ["a.V_N", "m/s", f"{motion['a.V_N'].min():.4g}", f"{motion['a.V_N'].max():.4g}"]
    assert motion["half_step"].max() > 0.5


STRANGE = {
    1: ("a: the step at 0.5 s: discard; the FMU: the rope is cut", 2),
    2: ("a: the step at 0.5 s: fatal; the FMU: Fatal py exception", 2),
    3: ("a: reading values at 1 s: y is no number (NaN)", 2),
    4: ("warning: a: the rope is thin (at 0.5 s)", 0),
    5: ("the system cannot be run: a needs more than 2 s", 2),
    6: ("the system cannot be run: a ended its process: SIGABRT", 2),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_an_fmu_says_or_does_is_told_with_its_name_and_the_time(kind: int, tmp_path: Path, capsys: Capsys) -> None:
    FmuBuilder.build_FMU(HERE / "strange.py", dest=tmp_path)
    plan = tmp_path / "plan.toml"
    start, plain = f'fmu = "Strange.fmu"\nstart = {{ kind = {kind} }}\n', '[component.b]\nfmu = "Strange.fmu"\n'
    plan.write_text(f"step = 0.5\nstop_time = 2\ntime_limit = 2\n{plain}[component.a]\n{start}", encoding="utf-8")
    message, code = STRANGE[kind]
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == code
    assert capsys.readouterr().err.count(message) == 1


def test_a_run_that_fails_is_one_line_and_writes_nothing(tmp_path: Path, capsys: Capsys) -> None:
    (tmp_path / "dead.fmu").write_bytes(foreign())  # it has no binary
    plan = tmp_path / "plan.toml"
    plan.write_text('step = 1.0\nstop_time = 1.0\n[component.a]\nfmu = "dead.fmu"\n', encoding="utf-8")
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == 2
    *_, line = without_progress(capsys.readouterr().err).splitlines()
    assert "the system cannot be run: a: " in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dead.fmu", "plan.toml"]


def test_a_run_with_too_many_values_is_refused(tmp_path: Path) -> None:
    part = SystemFmu.open(Path("water"), companion("current"), is_ours=True)
    with pytest.raises(FileError, match="give 300,000,003 values"):
        run_system(SystemStructure({"a": part}, {}, []), tmp_path, [("a", "V_N")] * 3, 1.0, 10**8)
