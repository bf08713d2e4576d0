"""What the pages say that happens, where no other test asks: against theory, or equations that are written here.

Each docstring is the sentence, or its sense, and its page.
"""

from dataclasses import replace
from math import degrees, exp, radians
from typing import Any

import numpy as np
import pytest

import rov_fmu
from rov_fmu.bridges.mujoco import load_mujoco
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.interface.model import VehicleModel
from tests.vehicles import surfaced, with_rotors

G = 9.80665
may_turn_over = pytest.mark.filterwarnings("ignore:.*turns over:UserWarning")


@pytest.fixture(scope="module")
def heavy() -> VehicleModel:
    return rov_fmu.load("bluerov2_heavy")


def tilt(run: Any) -> float:
    """Return the largest angle of a run between the vehicle's axis and the vertical, deg."""
    return degrees(float(np.arccos(np.cos(run["phi"]) * np.cos(run["theta"])).max()))


# ---- model.md --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rotors", [False, True])
def test_the_two_laws_of_lag(rotors: bool) -> None:
    """From rest, thrust with b_t = 0 reaches 40 % after T, and not 63 %. Without a command, it ends twice as fast."""
    vehicle = rov_fmu.load("bluerov2")
    linear = {name: 1e-12 for name in vehicle.coefficients if name.startswith(("b_t", "c_0"))}
    quadratic = (with_rotors(vehicle) if rotors else vehicle).with_(**linear)
    times = quadratic["T_t200"] * np.array([0.0, 1.0, 40.0, 41.0])
    thrust = quadratic.simulate(times, {"u_1": np.array([1.0, 1.0, 0.0, 0.0])})["F_1"] / quadratic["a_t_t200"]
    power = 2 if rotors else 1
    assert thrust == pytest.approx([0.0, (1.0 - exp(-1.0)) ** power, 1.0, exp(-power)], abs=1e-9)
    assert thrust[1] == pytest.approx(0.40 if rotors else 0.63, abs=0.005)


@may_turn_over
def test_thrust_ahead_turns_a_heavy_over_at_the_surface_as_below(heavy: VehicleModel) -> None:
    floats = surfaced(heavy).with_(B=1.05 * heavy["W"])
    times, ahead = np.linspace(0.0, 30.0, 301), heavy.layout.commands_along(SURGE, 0.3)
    for depth in (0.0, 20.0):
        assert tilt(floats.simulate(times, ahead, start={"z": depth})) > 90.0
        assert tilt(floats.simulate(times, start={"z": depth})) < 1.0


# ---- variables.md, vehicle-file.md -----------------------------------------------------------------------------------


@may_turn_over
def test_psi_jumps_by_half_a_turn_where_the_bow_passes_through_the_vertical(heavy: VehicleModel) -> None:
    run = heavy.simulate([0.0, 0.05], start={"theta_0": radians(89.0), "q": 1.0, "psi_0": 0.5})
    assert abs(run["psi"][1] - run["psi"][0]) == pytest.approx(np.pi, abs=1e-6)
    assert run["theta"][1] < radians(90.0)


def test_an_input_saturates_and_so_does_the_sum_that_reaches_a_thruster() -> None:
    """Of surge = { l = 1, r = 1 } and yaw = { l = 0.5, r = -0.5 }."""
    vehicle = rov_fmu.load("videoray")
    mix = {"surge": {"l": 1.0, "r": 1.0}, "yaw": {"l": 0.5, "r": -0.5}, "heave": {"t": 1.0}}
    mixed = vehicle.with_(replace(vehicle.layout, mix=mix))
    full = vehicle.calculated(vehicle.layout.usual_inputs | {"u_l": 1.0, "u_r": 1.0}, vehicle.layout.at_rest)
    now = mixed.calculated(mixed.layout.usual_inputs | {"u_surge": 3.0, "u_yaw": 0.4}, mixed.layout.at_rest)
    assert now["F_l"] == pytest.approx(full["F_l"])
    assert now["F_r"] < full["F_r"]


# ---- vehicles.md, drive.md, remus100.md, python.md -------------------------------------------------------------------


@may_turn_over
def test_a_heavy_turns_over_from_a_quarter_of_full_command_on(heavy: VehicleModel) -> None:
    times = np.linspace(0.0, 30.0, 3001)
    tilts = [tilt(heavy.simulate(times, heavy.layout.commands_along(SURGE, x))) for x in (0.24, 0.26, 0.28)]
    assert [one > 90.0 for one in tilts] == [False, True, True], tilts


def test_in_sea_water_the_buoyancy_of_the_heavy_is_134_88_newtons(heavy: VehicleModel) -> None:
    assert 1.025 * heavy["B"] == pytest.approx(134.88, abs=0.005)


def test_30_percent_give_about_a_tenth_of_the_full_thrust() -> None:
    vehicle = rov_fmu.load("videoray")
    some, full = (
        vehicle.calculated(vehicle.layout.usual_inputs | {"u_l": x}, vehicle.layout.at_rest)["F_l"] for x in (0.3, 1.0)
    )
    assert some / full == pytest.approx(0.1, abs=0.005)


def test_with_fixed_fins_a_remus_is_directionally_unstable() -> None:
    """Y_uv N_ur < N_uv (Y_ur - m), so a small turn grows until it circles."""
    remus = rov_fmu.load("examples/remus100/remus100.toml")
    turn = remus.simulate(np.linspace(0.0, 60.0, 7), {"u_prop": 1.0}, start={"u": 1.5, "r": 1e-4})["r"]
    assert abs(turn[1]) > 1e-4
    assert abs(turn[-1]) > 0.05


def test_without_the_correlations_the_interval_would_be_wide() -> None:
    """0.64 ... 1.26 m/s, and not 0.88 ... 0.94 m/s."""
    vehicle = rov_fmu.load("videoray_refit")
    known, random = vehicle.uncertainty, np.random.default_rng(0)
    alone = replace(known, correlation=np.eye(len(known.names)))
    drawn = alone.drawn(random.random((4000, len(known.names))))
    rovs = [vehicle.with_(**dict(zip(known.names, row.tolist(), strict=True))) for row in drawn]
    low, high = np.quantile([rov.response(SURGE, 0.5)[0] for rov in rovs], [0.025, 0.975])
    assert (low, high) == pytest.approx((0.64, 1.26), abs=0.03)


# ---- simulator.md ----------------------------------------------------------------------------------------------------


def test_at_full_thrust_a_bluerov2_turns_aside_in_mujoco_and_its_fmu_does_not() -> None:
    vehicle = rov_fmu.load("bluerov2")
    ahead = vehicle.layout.commands_along(SURGE, 1.0)
    rov = load_mujoco(vehicle)
    rov.model.geom_contype[:] = 0
    for name, value in ahead.items():
        rov.data.actuator(name).ctrl = value
    rov.step(5000)
    assert rov.data.time == pytest.approx(10.0)
    R = rov.data.xmat[rov.body].reshape(3, 3)
    assert abs(np.arctan2(R[1, 0], R[0, 0])) > 0.1
    run = vehicle.simulate([0.0, 10.0], ahead)
    assert (run["psi"][-1], run["y"][-1]) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_in_mujoco_there_is_no_surface_and_a_current_takes_a_vehicle_at_rest_along(heavy: VehicleModel) -> None:
    depths = []
    for height in (-1.0, 3.0):
        rov = load_mujoco(surfaced(heavy))
        rov.data.qpos[2], rov.inputs["V_N"] = height, 0.3
        rov.step(500)
        depths.append(rov.data.qpos[2] - height)
        assert 0.0 < rov.data.qvel[0] < 0.3
    assert depths[0] == pytest.approx(depths[1], rel=1e-9)


def test_a_payload_in_mujoco_has_no_buoyancy(heavy: VehicleModel) -> None:
    import mujoco

    from rov_fmu.bridges.mujoco import mujoco_texts

    texts, connected = mujoco_texts(heavy, "rov", {}, {}), load_mujoco(heavy)
    spec = mujoco.MjSpec.from_string(texts["scene.xml"], include={"vehicle.xml": texts["vehicle.xml"].encode()})
    payload = spec.body(heavy.identifier).add_body()
    payload.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0.0, 0.0], mass=2.0, contype=0, conaffinity=0)
    rov = type(connected)(connected.library, connected.equation, spec.compile())
    rov.coefficients["B"] = heavy["W"]
    rov.step()
    expected = -2.0 * G / (2.0 + (heavy["m_rov"] + heavy["m_a_w"]) / heavy["beta_w"])
    assert rov.data.qacc[2] == pytest.approx(expected, rel=2e-3)
