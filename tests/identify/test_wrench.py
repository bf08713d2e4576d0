"""Logs whose commands are a wrench in the body frame: the drag and the inertia of an independent simulation are found.

The equations of motion stand here, written by hand and solved by SciPy's DOP853.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu import load
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.findings import by_heading, findings_of
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood.hypotheses import HYPOTHESES
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.tank.readers.writers import Ros

MASS, BALLAST = 20.0, 1.5
INERTIA = {"u": 26.0, "w": 34.0}
LINEAR, QUADRATIC = {"u": 9.0, "w": 14.0}, {"u": 38.0, "w": 65.0}
ROV = """
[vehicle]
name = "Mixer"
identifier = "mixer"
version = "1.0"
description = "An AUV whose mixer logs forces"
source = "Dives"

[body]
m_rov = { value = 20.0, unit = "kg", source = "Weighed" }

[axes.surge]
[axes.heave]
"""


@dataclass
class Dive:
    """What a dive of 40 s measures."""

    time: NDArray[np.float64]
    X: NDArray[np.float64]
    Z: NDArray[np.float64]
    u: NDArray[np.float64]
    z: NDArray[np.float64]


@cache
def dive(seed: int) -> Dive:
    """Simulate m u' = X - d |u| u - b u, and the same downward with a load."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 40.0, 0.1)
    phases = random.uniform(-1.0, 1.0, (2, 10)).repeat(40, axis=1)
    X, Z = 45.0 * phases[0], 40.0 * phases[1]
    u, depth = motion(X, Z)
    return Dive(time, X, Z, u + random.normal(0.0, 0.01, len(u)), depth + 5.0 + random.normal(0.0, 0.01, len(u)))


def motion(X: NDArray[np.float64], Z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the velocity ahead and the depth, every 0.1 s from rest, under forces that are held for 4 s."""
    state, rows = np.zeros(3), []
    for x, z in zip(X[::40], Z[::40], strict=True):

        def rates(_: float, y: NDArray[np.float64], x: float = x, z: float = z) -> list[float]:
            u, w, _ = y
            surge = (x - QUADRATIC["u"] * abs(u) * u - LINEAR["u"] * u) / INERTIA["u"]
            heave = (z + BALLAST - QUADRATIC["w"] * abs(w) * w - LINEAR["w"] * w) / INERTIA["w"]
            return [surge, heave, w]

        at = np.linspace(0.0, 4.0, 41)
        found = solve_ivp(rates, (0.0, 4.0), state, "DOP853", at, rtol=1e-9, atol=1e-12).y
        rows.append(found[:, :-1])
        state = found[:, -1]
    u, _, depth = np.hstack(rows)
    return u, depth


def write(path: Path, header: str, *columns: NDArray[np.float64]) -> None:
    np.savetxt(path, np.column_stack(columns), "%.17g", ",", header=header, comments="")


HEADER = "time [s],X_ext [N],Z_ext [N],surge velocity [m/s],depth [m]"


def write_dives(folder: Path, rov: str, count: int = 2) -> None:
    (folder / "rov.toml").write_text(rov, encoding="utf-8")
    for n in range(1, count + 1):
        d = dive(n)
        write(folder / f"dive_{n}.csv", HEADER, d.time, d.X, d.Z, d.u, d.z)


def test_drag_and_inertia_are_those_of_the_simulation(tmp_path: Path) -> None:
    write_dives(tmp_path, ROV)
    found = identify(load_tests(tmp_path))
    vehicle = found.vehicle
    assert not vehicle.layout.thrusters
    assert vehicle.measured_from == "2 dive logs"
    assert [*vehicle.layout.inputs] == ["X_ext", "Z_ext", "V_N", "V_E"]
    truths = {f"a_d_{v}": QUADRATIC[v] for v in "uw"} | {f"b_d_{v}": LINEAR[v] for v in "uw"}
    truths |= {f"beta_{v}": MASS / INERTIA[v] for v in "uw"} | {"F_0_w": BALLAST}
    for name, truth in truths.items():
        low, high = vehicle.intervals[name]
        least = 0.005 * abs(truth)  # the lag is at least 0.02 s, of which the effective inertia has a part
        assert low - least <= truth <= high + least, name
        assert high - low < 0.55 * truth, name
    assert {result.verdict.word for result in found.axes} == {"good"}
    largest = max(abs(dive(n).X).max() for n in (1, 2))
    told = f"100% of a command is the largest of all logs: X_ext = {largest:.3g} N and Z_ext"
    assert any(told in fact for fact in by_heading(found.findings)["Facts"])
    write_vehicle(vehicle, tmp_path / "mixer.toml")
    again = load_vehicle(tmp_path / "mixer.toml")
    assert again.layout == vehicle.layout
    assert again.layout.example(SURGE) == {"X_ext": 5.0}
    rate = again.derivatives(again.layout.usual_inputs | {"X_ext": 10.0}, again.layout.at_rest)["u"]
    assert rate == pytest.approx(10.0 / INERTIA["u"], rel=0.1)


def test_a_force_along_an_axis_is_no_thruster_that_may_be_ill(tmp_path: Path) -> None:
    write_dives(tmp_path, ROV, 1)
    known, logs, _ = begin(load_tests(tmp_path))
    assert not [*HYPOTHESES["curve of its own"].suspects(known, logs)]
    assert not [*HYPOTHESES["neutral"].suspects(known, logs)]


def test_a_force_whose_sign_is_wrong_may_be_reversed(tmp_path: Path) -> None:
    write_dives(tmp_path, f'{ROV}[logs]\nreversed = ["Z_ext"]\n', 1)
    (log,) = load_tests(tmp_path).folder.logs
    assert log.commands
    commands, d = log.commands.at(log.commands.rows), dive(1)
    for name, force in {"X_ext": d.X, "Z_ext": -d.Z}.items():
        assert commands[:, log.commands.thrusters.index(name)] == pytest.approx(force / abs(force).max(), abs=1e-12)


def of_topics(folder: Path, d: Dive) -> None:
    """Write topics as `rostopic echo -p` does, whose z points up, as does the heading."""
    none, stamp = np.zeros(len(d.time)), 1.7e18 + 1e9 * d.time
    part = "field.force.x,field.force.y,field.force.z,field.torque.x,field.torque.y,field.torque.z"
    write(folder / "wrench.csv", f"%time,{part}", stamp, d.X, none, -d.Z, none, none, none)
    write(folder / "state.csv", "%time,field.velocity.x,field.position.z", stamp, d.u, -d.z)


def of_symbols(folder: Path, d: Dive) -> None:
    write(folder / "dive.csv", "time,X_ext,Z_ext,N_ext,u,depth,r", d.time, d.X, d.Z, 0.1 * d.X, d.u, d.z, 0.1 * d.u)


@pytest.mark.parametrize(("write_log", "axes"), [(of_topics, "surge heave"), (of_symbols, "surge heave yaw")])
def test_a_draft_of_a_wrench_needs_one_edit(write_log: Callable[[Path, Dive], None], axes: str, tmp_path: Path) -> None:
    """Forces and velocities may have their symbols alone, or be topics as text."""
    d = dive(1)
    write_log(tmp_path, d)
    assert main(["inspect", str(tmp_path), "--draft"]) == 0
    path = tmp_path / "rov.toml"
    draft = path.read_text(encoding="utf-8")
    lines = [line for line in draft.splitlines() if '"?"' in line and not line.startswith("#")]
    assert [line.partition(" ")[0] for line in lines] == ["m_rov", "I_r"]
    path.write_text(draft.replace('value = "?"', "value = 20.0"), encoding="utf-8")
    tests = load_tests(tmp_path)
    assert tests.logged == axes.split()
    (log,) = tests.folder.logs
    assert log.commands
    indices = [log.commands.thrusters.index(name) for name in ("X_ext", "Z_ext")]
    commands = log.commands.at(log.commands.rows)[:, indices]
    assert commands == pytest.approx(np.column_stack([d.X, d.Z]) / [abs(d.X).max(), abs(d.Z).max()], abs=1e-6)


@pytest.mark.parametrize(("frame", "side"), [("base_link", -1.0), ("base_link_frd", 1.0)])
def test_a_wrench_in_a_bag_is_turned_into_the_body_frame(tmp_path: Path, frame: str, side: float) -> None:
    """The frame of REP 103 is forward, left, up."""
    d, ros = dive(1), Ros(2)
    messages = []
    for t, X, Z, z in zip(d.time, d.X, d.Z, d.z, strict=True):
        wrench = ros.message("geometry_msgs/msg/Wrench", force=ros.vector("Vector3", [X, 0.0, side * Z]))
        stamped = ros.message("geometry_msgs/msg/WrenchStamped", header=ros.header(t, frame), wrench=wrench)
        messages.append(("/auv/cmd_wrench", t, stamped))
        messages.append(("/auv/depth", t, ros.message("std_msgs/msg/Float64", data=float(z))))
    ros.write(tmp_path, messages, ".mcap")
    (tmp_path / "rov.toml").write_text(ROV, encoding="utf-8")
    tests = load_tests(tmp_path)
    (log,) = tests.folder.logs
    assert log.commands
    assert log.commands.source.topic == "/auv/cmd_wrench"
    Z = log.commands.at(log.commands.rows)[:, log.commands.thrusters.index("Z_ext")]
    assert pytest.approx(d.Z / abs(d.Z).max(), abs=1e-6) == Z


TOE, TILT = 0.6, 0.2
"""The angles of the rear thrusters to the bow, and of the vertical one to straight down, rad."""
QUADRATIC_THRUST, LINEAR_THRUST = 40.0, 8.0
"""The thrust of each thruster, N: 40 c |c| + 8 c at the command c."""
CURVE = """[curves.all]
a_t = { value = 40.0, unit = "N", source = "Bollard pull" }
b_t = { value = 8.0, unit = "N", source = "Bollard pull" }
"""
MIX = ROV.replace("[axes.surge]", "") + f"\n[logs]\nwrench = true\n\n{CURVE}\n"
for name, direction in {
    "l": (np.cos(TOE), np.sin(TOE), 0.0),
    "r": (np.cos(TOE), -np.sin(TOE), 0.0),
    "t": (np.sin(TILT), 0.0, np.cos(TILT)),
}.items():
    value = ", ".join(f"{x:.17g}" for x in direction)
    MIX += f'\n[[thruster]]\nname = "{name}"\ncurve = "all"\ndirection = {{ value = [{value}], source = "CAD" }}\n'
MIX += "[axes.surge]\n"


@pytest.mark.weekly
def test_thrusters_give_the_forces_of_a_wrench(tmp_path: Path) -> None:
    """The motion under commands is that of the simulation under the sum of the thrusters, written by hand.

    So are the steady velocities that the result tells, whose commands are those of the thrusters.
    """
    write_dives(tmp_path, MIX)
    found = identify(load_tests(tmp_path))
    assert not {"beyond thrusters", "saturation"} & {finding.kind for finding in findings_of(found)}
    (wrench,) = (finding for finding in found.findings if finding.kind == "wrench")
    assert str(wrench.words["full"]).count(" = ") == 2, "only of the forces that the logs command"
    for answer in found.axes[0].answers:
        thrust = (QUADRATIC_THRUST * abs(answer.command) + LINEAR_THRUST) * abs(answer.command)
        force = (2.0 * np.cos(TOE) + np.sin(TILT)) * thrust
        a, b = QUADRATIC["u"], LINEAR["u"]
        steady = np.copysign((np.sqrt(b * b + 4.0 * a * force) - b) / (2.0 * a), answer.command)
        assert answer.steady[0] == pytest.approx(steady, rel=0.01)
        low, high = answer.steady[1]
        assert low <= steady <= high
    write_vehicle(found.vehicle, tmp_path / "mixer.toml")
    vehicle = load(tmp_path / "mixer.toml")
    assert [*vehicle.layout.commands] == ["u_l", "u_r", "u_t"]
    assert (vehicle["a_t_all"], vehicle.sources["a_t_all"]) == (40.0, "Bollard pull")
    assert vehicle.command_range == (0.0, 1.0)
    commands = np.random.default_rng(7).uniform(-0.7, 0.7, (3, 5)).repeat(40, axis=1)
    left, right, top = QUADRATIC_THRUST * commands * abs(commands) + LINEAR_THRUST * commands
    u, depth = motion(np.cos(TOE) * (left + right) + np.sin(TILT) * top, np.cos(TILT) * top)
    time = np.arange(0.0, 20.0, 0.1)
    run = vehicle.simulate(time, dict(zip(vehicle.layout.commands, commands, strict=True)))
    assert run["u"] == pytest.approx(u, abs=0.03 * np.ptp(u))
    assert run["z"] == pytest.approx(depth, abs=0.03 * np.ptp(depth))


@pytest.mark.weekly
def test_weak_thrusters_are_told_and_their_forces_are_those_of_loads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_dives(tmp_path, MIX.replace("value = 40.0", "value = 20.0"), 1)
    out = tmp_path / "mixer.toml"
    assert main(["identify", str(tmp_path), "-o", str(out)]) == 0
    most = 28.0 * np.cos(TILT)
    largest = abs(dive(1).Z).max()
    words = " ".join(capsys.readouterr().out.split())
    assert f"heave: the logs have {largest:.3g} N and the thrusters of rov.toml give {most:.3g} N at full" in words
    vehicle = load(out)
    usual, at_rest, F = vehicle.layout.usual_inputs, vehicle.layout.at_rest, 20.0 * 0.25 + 8.0 * 0.5
    pushed = vehicle.derivatives(usual | {"u_l": 0.5, "u_t": -0.5}, at_rest)
    load_ahead, load_down = F * (np.cos(TOE) - np.sin(TILT)), -F * np.cos(TILT)
    loaded = vehicle.derivatives(usual | {"X_ext": load_ahead, "Z_ext": load_down}, at_rest)
    assert pushed == pytest.approx(loaded, rel=1e-12)


_CAD = 'source = "CAD" }'
_UP = 'direction = { value = [0.19866933079506122, 0, 0.98006657784124163], source = "CAD" }'
_LOSS = 'd = { value = 1, unit = "N.s/m", source = "" }'
PITCHING = """[body]
I_q = { value = 1.0, unit = "kg.m2", source = "CAD" }
W = { value = 196.2, unit = "N", source = "Weighed" }
B = { value = 196.2, unit = "N", source = "Weighed" }
z_B = { value = -0.05, unit = "m", source = "CAD" }"""
MOMENT = {
    _CAD: f'{_CAD}\nposition = {{ value = [0, 0, 0], unit = "m", source = "CAD" }}',
    "[body]": PITCHING,
    "[axes.surge]": "[axes.pitch]\n[axes.surge]",
}
"""Weight may right a vehicle in pitch, but the logs command a moment, which no thruster gives."""


@pytest.mark.parametrize(
    ("changes", "header", "line"),
    [
        ({_UP: _UP.replace("0.98006657784124163", "0")}, HEADER, "axes.heave: no thruster drives it: give one a dir"),
        ({"[logs]": "[inputs]\nahead = { q = 1 }\n[logs]"}, HEADER, "inputs.ahead.q: there is no such thruster"),
        ({CURVE: f"{CURVE}{_LOSS}\n"}, HEADER, "curves.all.d"),
        ({"[vehicle]": 'base = "bluerov2"\n[vehicle]'}, HEADER, "logs.wrench = True: is not allowed with base"),
        (
            MOMENT,
            "time [s],X_ext [N],M_ext [N.m],surge velocity [m/s],pitch [rad]",
            "axes.pitch: no thruster turns the vehicle: give one a position beside the line of its force, or remove",
        ),
        (
            {"wrench = true": ""},
            HEADER,
            "'X_ext [N]' and 'Z_ext [N]' are forces on the body, if wrench = true stands in [logs]",
        ),
        (
            {MIX: ROV},
            HEADER.replace("X_ext [N],Z_ext [N]", "u_1 [%],x"),
            "there is no column of commands. Possible columns: X_ext, Y_ext, Z_ext, K_ext, M_ext, N_ext, in [N] or [N",
        ),
    ],
)
def test_what_cannot_give_a_wrench_is_refused(
    changes: Mapping[str, str], header: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rov, d = MIX, dive(1)
    for old, new in changes.items():
        assert old in rov
        rov = rov.replace(old, new)
    (tmp_path / "rov.toml").write_text(rov, encoding="utf-8")
    write(tmp_path / "dive.csv", header, d.time, d.X, d.Z, d.u, d.z)
    assert main(["identify", str(tmp_path), "-o", str(tmp_path / "out.toml")]) == 2
    assert line in capsys.readouterr().err
