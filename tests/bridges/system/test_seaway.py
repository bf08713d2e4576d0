"""The companion `seaway` against the theory of waves, and vehicles in its water against theirs (docs/waves.md)."""

import re
from collections.abc import Callable
from dataclasses import replace
from math import pi, tanh
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.bridges.system.companion import slave_of
from rov_fmu.bridges.system.companions.seaway import VARIABLES, Seaway
from rov_fmu.c.stepper import Stepper
from rov_fmu.cli import main
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface
from rov_fmu.vehicle.writer import vehicle_text
from tests.commands import ROOT, Capsys
from tests.vehicles import a_vehicle, in_waves, passed, tied

G = 9.80665
HEAVY, BLUEROV2, VIDEORAY = (load_vehicle(SHIPPED[name]) for name in ("bluerov2_heavy", "bluerov2", "videoray"))
OUTPUTS = ("V_N", "V_E", "V_D", "A_N", "A_E", "A_D", "elevation")


def sea(**parameters: float) -> Any:
    made = Seaway(instance_name="sea", resources="")
    for name, value in parameters.items():
        setattr(made, name, value)
    made.exit_initialization_mode()
    return made


def water(sea: Any, t: float, *place: float) -> Array:
    """Return the velocity, the acceleration and the elevation of the water at a time and a place."""
    sea._put("", t, [*place])
    return np.array([getattr(sea, name) for name in OUTPUTS])


@pytest.mark.parametrize(("T_p", "seed"), [(3.0, 1), (6.0, 2), (12.0, 3)])
def test_the_sea_has_its_significant_height_and_its_mean_period(T_p: float, seed: int) -> None:
    a, omega, _, _, phase = np.array(sea(H_s=1.5, T_p=T_p, seed=seed).waves).T
    t = np.arange(0.0, 3600.0, 0.05 * T_p)
    height = (a * np.cos(omega * t[:, None] + phase)).sum(axis=1)
    assert 4.0 * height.std() == pytest.approx(1.5, rel=0.02)
    crossings = np.count_nonzero((height[1:] > 0.0) & (height[:-1] <= 0.0))
    # DNV-RP-C205, 3.5.5.4, has 0.7775 for gamma = 3.3; without the frequencies above 4 omega_p it is 3 % more
    assert 3600.0 / crossings == pytest.approx(1.03 * 0.7775 * T_p, rel=0.02)


def test_two_seeds_are_two_seas_of_one_spectrum_and_spreading_turns_the_waves() -> None:
    one, same, other = (sea(seed=seed, spreading=4.0, direction=0.3).waves for seed in (1, 1, 2))
    assert one == same != other
    directions = np.array(one)[:, 3] - 0.3
    assert np.std(directions) == pytest.approx(0.44, abs=0.08)  # of cos^4, between ±pi/2
    assert np.mean(directions) == pytest.approx(0.0, abs=0.1)
    assert {wave[3] for wave in sea(direction=0.3).waves} == {0.3}


@pytest.mark.parametrize("depth", [2.0, 20.0, 1e4])
def test_waves_of_any_depth_obey_airys_equations(depth: float) -> None:
    """The water is incompressible, does not pass the bed, and moves with its surface; A is the change of V."""
    made, (t, *place), h = sea(components=20, spreading=2.0, seabed=depth, T_p=5.0), (3.0, 2.0, -1.0, 1.5), 1e-4
    for _, omega, k, *_ in made.waves:
        assert G * k * tanh(k * depth) == pytest.approx(omega**2, rel=1e-12)
    change = [
        (water(made, t, *(np.array(place) + h * e)) - water(made, t, *(np.array(place) - h * e))) / (2.0 * h)
        for e in np.eye(3)
    ]
    assert sum(change[n][n] for n in range(3)) == pytest.approx(0.0, abs=1e-8)
    rate = (water(made, t + h, *place) - water(made, t - h, *place)) / (2.0 * h)
    assert rate[:3] == pytest.approx(water(made, t, *place)[3:6], abs=1e-7)
    assert water(made, t, *place[:2], depth)[2] == pytest.approx(0.0, abs=1e-12)
    surface = (water(made, t + h, *place[:2], 0.0) - water(made, t - h, *place[:2], 0.0)) / (2.0 * h)
    assert -water(made, t, *place[:2], 0.0)[2] == pytest.approx(surface[6], abs=1e-7)


@pytest.mark.parametrize(("north", "east", "depth"), [(0.5, 0.0, 1e4), (-0.4, 0.2, 20.0), (2.0, -1.0, 3.0)])
def test_waves_on_a_current_obey_its_dispersion_and_are_those_without_it_in_moving_water(
    north: float, east: float, depth: float
) -> None:
    """(omega - k U)^2 = g k tanh(k d), and A = dV/dt + (U grad) V, of velocities that obey Airy's equations."""
    made, h = sea(components=30, spreading=2.0, seabed=depth, T_p=6.0, current_N=north, current_E=east), 1e-4
    t, place, U = 3.0, np.array([2.0, -1.0, 1.5]), np.array([north, east, 0.0])
    assert len(made.waves) == 30
    for _, omega, k, direction, _ in made.waves:
        sigma = omega - k * (north * np.cos(direction) + east * np.sin(direction))
        assert sigma**2 == pytest.approx(G * k * tanh(k * depth), rel=1e-9)
        assert sigma > 0.0
    carried = (water(made, t + h, *(place + h * U)) - water(made, t - h, *(place - h * U))) / (2.0 * h)
    assert carried[:3] == pytest.approx(water(made, t, *place)[3:6], abs=1e-7)
    surface = [water(made, t + sign * h, *(place[:2] + sign * h * U[:2]), 0.0)[6] for sign in (1.0, -1.0)]
    assert -water(made, t, *place[:2], 0.0)[2] == pytest.approx((surface[0] - surface[1]) / (2.0 * h), abs=1e-7)


def test_a_wave_that_a_current_stops_is_left_out() -> None:
    """In deep water, none runs against U > g / (4 omega)."""
    most = G / (4.0 * 2.0 * pi / 3.0)
    for share, count in ((0.99, 1), (1.01, 0)):
        made = sea(components=1, T_p=3.0, seabed=1e4, current_N=-share * most)
        assert len(made.waves) == count
        assert sea(components=1, T_p=3.0, current_N=share * most).waves[0][2] > 0.0
    some = sea(components=100, T_p=3.0, seabed=1e4, current_N=-0.5 * most).waves
    assert 30 < len(some) < 100
    assert max(omega for _, omega, *_ in some) < G / (4.0 * 0.5 * most)


def test_a_sea_that_rises_is_calm_at_first_and_then_the_sea_without_a_rise() -> None:
    rising, full, h, place = sea(rise=4.0, spreading=2.0), sea(spreading=2.0), 1e-4, (2.0, -1.0, 1.5)
    assert water(rising, 0.0, *place)[[0, 1, 2, 6]] == pytest.approx(0.0, abs=1e-15)
    for t in (0.5, 3.9):
        rate = (water(rising, t + h, *place) - water(rising, t - h, *place)) / (2.0 * h)
        assert rate[:3] == pytest.approx(water(rising, t, *place)[3:6], abs=1e-7), "A is the change of V"
        assert water(rising, t, *place)[6] == pytest.approx(t / 4.0 * water(full, t, *place)[6])
    for t in (4.0, 7.0):
        assert (water(rising, t, *place) == water(full, t, *place)).all()


def flown(
    rov: Vehicle,
    made: Any,
    h: float,
    seconds: float,
    start: dict[str, float],
    pull: Callable[[Array], dict[str, float]] = lambda _: {},
) -> Array:
    """Return position, then velocity over ground, of a vehicle in a sea: both exchange their outputs once per step."""
    names = [name for name in ("x", "y", "z", "vg_N", "vg_E", "vg_D") if name in rov.layout.places]
    stepper, inputs = Stepper(rov, start, names), rov.layout.usual_inputs
    now, path = np.array([0.0, 0.0, start["z"], 0.0, 0.0, 0.0]), []
    made.x, made.y, made.z = now[:3]
    made.step = h
    made.exit_initialization_mode()
    for n in range(round(seconds / h)):
        path.append(now)
        given = {name: getattr(made, name) for name in OUTPUTS if name in inputs}
        made.x, made.y, made.z = now[:3]
        made.do_step(n * h, h)
        now = np.array(stepper.step([*(inputs | given | pull(now)).values()], h))
    return np.array([*path, now])


@pytest.mark.parametrize(("h", "limit"), [(0.02, 1e-4), (0.1, 3e-3)])
def test_a_neutral_vehicle_follows_the_particle_of_water(h: float, limit: float) -> None:
    rov = in_waves(without_surface(HEAVY)).with_(m_rov=13.4, W=13.4 * G, B=13.4 * G)
    made = sea(components=1, H_s=0.5, T_p=6.0, direction=0.4)
    path = flown(rov, made, h, 30.0, {"z": 3.0})[:, :3]
    times = h * np.arange(len(path))
    other = sea(components=1, H_s=0.5, T_p=6.0, direction=0.4)
    particle = solve_ivp(
        lambda t, y: water(other, t, *y)[:3], (0.0, times[-1]), [0.0, 0.0, 3.0], t_eval=times, rtol=1e-9, atol=1e-10
    ).y.T
    assert np.linalg.norm(path - particle, axis=1).max() < limit


@pytest.mark.parametrize("rov", [HEAVY, BLUEROV2, VIDEORAY], ids=["Heavy", "BlueROV2", "VideoRay"])
def test_a_held_vehicle_feels_the_load_of_morison(rov: Vehicle) -> None:
    """A stiff spring holds it. The load in phase with A is that of the displaced and the added mass."""
    layout = rov.layout
    if "W" in rov.coefficients:
        rov = rov.with_(W=rov["m_rov"] * G, B=rov["m_rov"] * G)
    elif "F_0_w" in rov.coefficients:
        rov = rov.with_(F_0_w=0.0)
    rov = tied(in_waves(rov.with_(replace(layout, surface=False))), hook=(0.0, 0.0, 0.0))
    made, K, h = sea(components=1, H_s=0.02, T_p=2.0), 4000.0, 0.004
    path = flown(rov, made, h, 12.0, {"z": 3.0}, lambda now: {"F_N_hook": -K * (now[0] + 0.5 * h * now[3])})
    t, omega = h * np.arange(len(path)), 2.0 * pi / 2.0
    late = t > 8.0 - 1e-9
    inertia = rov["m_rov"] + rov.coefficients.get("m_a_u", 0.0)
    load = (K - inertia * omega**2) * path[late, 0]  # what the spring pulls, and what the motion that it allows takes
    basis = np.stack([np.cos(omega * t[late]), np.sin(omega * t[late]), np.ones(late.sum())], axis=1)
    _, in_phase, _ = np.linalg.lstsq(basis, load, rcond=None)[0]
    acceleration = 0.01 * omega**2 * np.exp(-3.0 * omega**2 / G)  # A_N = -a omega^2 e^(-kz) sin(omega t)
    assert -in_phase == pytest.approx(inertia * acceleration, rel=0.01)


def test_a_floating_vehicle_rides_a_long_wave() -> None:
    path = flown(in_waves(BLUEROV2), sea(components=1, H_s=0.5, T_p=12.0), 0.02, 48.0, {"z": 0.0})
    other = sea(components=1, H_s=0.5, T_p=12.0)
    late = range(1200, len(path), 10)
    surface = np.array([water(other, 0.02 * n, *path[n, :3])[6] for n in late])
    assert np.ptp(path[[*late], 2]) == pytest.approx(np.ptp(surface), rel=0.02)
    assert np.abs(path[[*late], 2] + surface - np.mean(path[[*late], 2] + surface)).max() < 0.02 * np.ptp(surface)


TAUT = {"length": 19.9, "mass": 0.5, "diameter": 0.03, "EA": 1e7, "z_top": 3.0, "y_bottom": 12.0, "z_bottom": 19.0}
"""A line of 20 m that hangs obliquely and is so taut that waves do not move it."""
SHORT = {
    "length": 1.1,
    "mass": 1025.0 * pi / 4.0 * 0.03**2,
    "diameter": 0.03,
    "z_top": 2.0,
    "y_bottom": 0.6,
    "z_bottom": 2.8,
}
"""A neutral line of 1.1 m between ends that are 1 m apart."""


def line_in(
    made: Any, folder: Path, h: float, seconds: float, ends: dict[str, float], *, carried: bool = False
) -> Array:
    """Return time, force of both ends, and the position of the middle of a tether in a sea, a row for each step.

    Both exchange their outputs once per step. `carried`: the ends move with the particles of water there.
    """
    pytest.importorskip("moordyn")
    (folder / "shape.json").write_text('{"waves": true, "lines": {"line": 21}}')
    line: Any = slave_of("tether")(instance_name="line", resources=folder)
    water_of_line: Any = Seaway(instance_name="sea", resources=folder)
    vars(water_of_line).update({name: getattr(made, name) for name in VARIABLES} | {"step": h})
    water_of_line.exit_initialization_mode()
    vars(line).update(ends)
    rows = []
    for n in range(round(seconds / h)):
        for end in ("top", "bottom") if carried else ():
            place = [getattr(line, f"{x}_{end}") for x in "xyz"]
            middle = place + 0.5 * h * water(made, n * h, *place)[:3]
            V = water(made, (n + 0.5) * h, *middle)[:3]  # the middle of a step, of second order
            vars(line).update({f"vg_{d}_{end}": v for d, v in zip("NED", V, strict=True)})
        given = {f"{name}_p{k}": getattr(water_of_line, f"{name}_line_{k}") for k in range(21) for name in OUTPUTS[:6]}
        told = {f"{x}_line_{k}": getattr(line, f"{x}_p{k}") for k in range(21) for x in "xyz"}
        vars(line).update(given)
        vars(water_of_line).update(told)
        assert line.do_step(n * h, h)
        assert water_of_line.do_step(n * h, h)
        for end in ("top", "bottom"):
            for x, d in zip("xyz", "NED", strict=True):
                moved = getattr(line, f"{x}_{end}") + h * getattr(line, f"vg_{d}_{end}")
                setattr(line, f"{x}_{end}", moved)
        force = [getattr(line, f"F_{d}_top") + getattr(line, f"F_{d}_bottom") for d in "NED"]
        rows.append([(n + 1) * h, *force, *(getattr(line, f"{x}_p10") for x in "xyz")])
    line.terminate()
    return np.array(rows)


@pytest.mark.parametrize("direction", [0.0, 1.0])
def test_a_tether_feels_the_load_of_morison(direction: float, tmp_path: Path) -> None:
    """Along the line the force of Froude and Krylov and friction, across it that and the added mass, and drag."""
    made = sea(components=1, H_s=0.6, T_p=5.0, direction=direction)
    found = line_in(made, tmp_path, 0.02, 10.0, TAUT)
    late = found[found[:, 0] > 4.99]
    ends = np.array([[0.0, 0.0, 3.0], [0.0, 12.0, 19.0]])
    along = (ends[1] - ends[0]) / 20.0
    area, load = pi / 4.0 * 0.03**2, []
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for t in late[::10, 0]:
        total = np.zeros(3)
        for node, weight in zip(nodes, weights, strict=True):
            V, A = np.split(water(made, t, *(ends[0] + 10.0 * (1.0 + node) * along))[:6], 2)
            V_q, A_q = (one @ along * along for one in (V, A))
            V_p, A_p = V - V_q, A - A_q
            drag = 1.2 * 0.03 * np.linalg.norm(V_p) * V_p + 0.02 * pi * 0.03 * np.linalg.norm(V_q) * V_q
            total = total + 10.0 * weight * (1025.0 * area * (A_q + 2.0 * A_p) + 0.5 * 1025.0 * drag)
        load.append(total)
    expected = np.array(load)
    of_line = late[::10, 1:4] - [0.0, 0.0, (0.5 - 1025.0 * area) * G * 19.9]
    most = np.abs(expected).max()
    assert most > 2.0
    assert np.abs(of_line - expected).max() < 0.03 * most


def test_a_neutral_tether_moves_with_the_water(tmp_path: Path) -> None:
    """With its ends carried by the water, it needs hardly a force, and its middle swings as the water there does.

    It drifts slower than the water, whose convective acceleration is of second order and left out.
    """
    made = sea(components=1, H_s=0.2, T_p=5.0)
    held, carried = (line_in(made, tmp_path, 0.02, 10.0, SHORT, carried=carried) for carried in (False, True))
    assert np.abs(carried[250:, 1:4]).max() < 0.2 * np.abs(held[250:, 1:4]).max()
    late = carried[250:]
    t, omega = late[:, 0], 2.0 * pi / 5.0
    basis = np.stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t), t], axis=1)
    speed = np.gradient(late[:, 4:], t, axis=0)
    there = np.array([water(made, row[0], *row[4:])[:3] for row in late])
    of_line, of_water = (np.linalg.lstsq(basis, one, rcond=None)[0][:2] for one in (speed, there))
    assert np.abs(of_line - of_water).max() < 0.03 * np.abs(of_water).max()


@pytest.mark.parametrize(("name", "value"), [("T_p", 0.0), ("H_s", -1.0), ("seabed", float("nan")), ("rise", -1.0)])
def test_a_sea_that_cannot_be_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be from"):
        sea(**{name: value})


def test_a_vehicle_that_the_current_passes_is_refused_in_a_sea(
    tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would lose the load of the waves, (m + M_A) A."""
    monkeypatch.chdir(tmp_path)
    Path("rov.toml").write_text(vehicle_text(passed(a_vehicle(without_surface(HEAVY)))))
    Path("sea.toml").write_text(
        'step = 0.1\nstop_time = 1\nconnect = [["sea.current", "rov.current"]]\n'
        '[component.rov]\nvehicle = "rov.toml"\n[component.sea]\ncompanion = "seaway"\n'
    )
    assert main(["system", "sea.toml", "-o", "sea.ssp"]) == 2
    assert 'sea.current moves rov, whose vehicle file has current = "passes"' in capsys.readouterr().err


def test_a_tether_is_moved_by_the_sea_of_a_plan(tmp_path: Path) -> None:
    """FMPy runs both FMUs, and the tether gets what the classes above exchange."""
    pytest.importorskip("moordyn")
    values = ", ".join(f"{name} = {value}" for name, value in TAUT.items())
    plan = (
        'step = 0.1\nstop_time = 3\nconnect = [["line.waves", "sea.waves"]]\n'
        f'[component.line]\ncompanion = "tether"\nstart = {{ {values} }}\n[component.sea]\ncompanion = "seaway"\n'
        "start = { components = 1, H_s = 0.6, T_p = 5 }\n"
    )
    (tmp_path / "line.toml").write_text(plan)
    assert main(["system", str(tmp_path / "line.toml"), "-o", str(tmp_path / "line.ssp"), "--run"]) == 0
    motion = np.genfromtxt(tmp_path / "line.csv", delimiter=",", names=True, deletechars="")
    expected = line_in(sea(components=1, H_s=0.6, T_p=5.0), tmp_path, 0.1, 3.0, TAUT)
    of_line = motion["line.F_N_top"] + motion["line.F_N_bottom"]
    np.testing.assert_allclose(of_line[1:], expected[:, 1], rtol=1e-9, atol=1e-9)
    assert np.ptp(of_line) > 2.0
    plot = (tmp_path / "line.svg").read_text("utf-8")
    assert "tension_top" in plot
    assert "_p10" not in plot, "its nodes have no lines"


@pytest.mark.weekly
def test_a_held_vehicle_keeps_station_up_to_the_sea_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    plan, _ = re.findall(r"^```toml\n(.*?)^```", (ROOT / "docs" / "waves.md").read_text("utf-8"), re.M | re.S)
    Path("my_rov.toml").write_text(f"waves = true\n{SHIPPED['bluerov2_heavy'].read_text()}")
    off = {}
    for height in (0.5, 1.5, 2.0):
        Path("station.toml").write_text(plan.replace("H_s = 0.5", f"H_s = {height}"))
        assert main(["system", "station.toml", "-o", "station.ssp", "--run", "--force"]) == 0, capsys.readouterr().err
        motion = np.genfromtxt("station.csv", delimiter=",", names=True, deletechars="")
        x, y, z = (
            motion[next(name for name in motion.dtype.names or () if name.startswith(f"rov.{x}"))] for x in "xyz"
        )
        off[height] = float(np.sqrt(x**2 + y**2 + (z - 3.0) ** 2).max())
    assert off[0.5] < 0.065
    assert off[1.5] < 0.3 < off[2.0]
