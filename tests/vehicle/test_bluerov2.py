"""The numbers of BlueROV2 and BlueROV2 Heavy against their sources."""

import csv
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.signal import TransferFunction, step

from rov_fmu.equation.catalogue import AXES
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

BOTH = ["bluerov2", "bluerov2_heavy"]
NEWTON = 9.80665  # in 1 kgf


@pytest.fixture(scope="module", params=BOTH)
def ship(request: pytest.FixtureRequest) -> Vehicle:
    return load_vehicle(SHIPPED[request.param])


# ---- T200 ------------------------------------------------------------------------------------------------------------


def points() -> tuple[Any, Any]:
    """Return every third of the maker's points: the commands, and the thrust in N."""
    with (SHIPPED["bluerov2"].parent / "t200" / "t200_16_v.csv").open(encoding="utf-8", newline="") as file:
        pulse, force = np.array([[float(cell) for cell in row] for row in [*csv.reader(file)][1:]]).T
    assert len(pulse) == 67
    assert np.all(np.diff(pulse) == 12.0)
    assert (pulse[0], pulse[-1]) == (1104.0, 1896.0)
    return (pulse - 1500.0) / 400.0, force * NEWTON


def rms(residuals: Any) -> float:
    return float(np.sqrt(np.mean(residuals**2)))


def test_the_curve_is_that_of_the_makers_points_to_0_35_newton(ship: Vehicle) -> None:
    c, thrust = points()
    curve = ship.layout.curves[0]
    shipped = np.array([ship.curve_force(curve, float(x)) for x in c])
    assert rms((shipped - thrust)[c > 0.0]) < 0.35
    assert rms((shipped - thrust)[c < 0.0]) < 0.35
    assert np.all(shipped[np.abs(c) < 0.0872] == 0.0)
    ends = [ship.curve_force(curve, command) for command in (1.0, -1.0)]
    assert ends == pytest.approx([5.25 * NEWTON, -4.1 * NEWTON], rel=0.04), "forward is the strong side"


def test_the_lag_loses_the_impulse_of_the_published_transfer_function() -> None:
    t = np.linspace(0.0, 3.0, 30_001)
    _, rise = step(TransferFunction([6136.0, 108700.0], [1.0, 89.0, 9258.0, 108700.0]), T=t)
    lost = float(np.trapezoid(1.0 - rise, t))
    for name in BOTH:
        assert load_vehicle(SHIPPED[name])["T_t200"] == pytest.approx(lost, abs=5e-5)


# ---- ArduSub ---------------------------------------------------------------------------------------------------------

_HORIZONTAL = {"1": (1, 0, -1, 1), "2": (-1, 0, -1, -1), "3": (-1, 0, 1, 1), "4": (1, 0, 1, -1)}
_VERTICAL = (0, -1, 0, 0)
ARDUSUB = {
    "bluerov2": _HORIZONTAL | dict.fromkeys("56", _VERTICAL),
    "bluerov2_heavy": _HORIZONTAL | dict.fromkeys("5678", _VERTICAL),
}
"""ArduSub's factors of each motor for yaw, throttle (up), forward, lateral; frames vectored and vectored_6dof."""
ROLLS = {"roll": (1, -1, 1, -1), "pitch": (-1, -1, 1, 1)}
"""ArduSub's factors of motors 5 ... 8 of vectored_6dof; those of 5 and 6 in roll are the same in vectored."""
STICKS = {"yaw": (0, 1.0), "heave": (1, -1.0), "surge": (2, 1.0), "sway": (3, 1.0)}
"""The index of each axis in the factors, and the sign that turns the factor into our direction."""


@pytest.mark.parametrize("name", BOTH)
def test_thrusters_are_numbered_and_directed_as_ardusubs_motors(name: str) -> None:
    layout = load_vehicle(SHIPPED[name]).layout
    assert [thruster.name for thruster in layout.thrusters] == list(ARDUSUB[name])
    for thruster in layout.thrusters:
        for axis, (place, sign) in STICKS.items():
            factor = sign * ARDUSUB[name][thruster.name][place]
            effect = thruster.effect(AXES[axis])
            assert effect == pytest.approx(factor * abs(effect), abs=1e-12), f"{thruster.name} {axis}"
            assert (abs(effect) > 0.1) == (factor != 0), f"{thruster.name} {axis}"


@pytest.mark.parametrize(("name", "axis"), [("bluerov2", "roll"), *product(["bluerov2_heavy"], ROLLS)])
def test_vertical_thrusters_roll_and_pitch_as_ardusub_tells(name: str, axis: str) -> None:
    thrusters = load_vehicle(SHIPPED[name]).layout.thrusters[4:]
    signs = [1 if thruster.effect(AXES[axis]) > 0.0 else -1 for thruster in thrusters]
    assert signs == [*ROLLS[axis]][: len(thrusters)]


# ---- Publications ----------------------------------------------------------------------------------------------------

PUBLISHED = {
    "bluerov2": (
        11.5,
        0.16,
        112.8 - 114.8,
        [(5.5, 4.03, 18.18), (12.7, 6.22, 21.66), (14.57, 5.18, 36.99), (0.12, 0.07, 1.55)],
    ),
    "bluerov2_heavy": (
        13.5,
        0.37,
        9.82 * (13.5 - 1000.0 * 0.0134),
        [(6.36, 13.7, 141.0), (7.12, 0.0, 217.0), (18.68, 33.0, 190.0), (0.222, 0.0, 1.5)],
    ),
}
"""Mass, inertia about z, net weight, and added mass, linear and quadratic drag of surge, sway, heave and yaw."""
ROLLING = {"p": (0.26, 0.189, 0.0, 1.19), "q": (0.23, 0.135, 0.8, 0.47)}
"""Inertia, added inertia, linear and quadratic drag of the Heavy in roll and pitch."""


@pytest.mark.parametrize("name", BOTH)
def test_the_coefficients_are_those_of_the_publication(name: str) -> None:
    rov = load_vehicle(SHIPPED[name])
    mass, inertia, weight, axes = PUBLISHED[name]
    assert (rov["m_rov"], rov["I_r"]) == (mass, inertia)
    net_weight = rov["W"] - rov["B"] if rov.layout.has_attitude else rov["F_0_w"]
    assert net_weight == pytest.approx(weight, abs=1e-12)
    for axis, numbers in zip("uvwr", axes, strict=True):
        assert tuple(rov[f"{key}_{axis}"] for key in ("m_a", "b_d", "a_d")) == numbers


def test_the_heavy_rolls_and_pitches_as_published() -> None:
    """The centre of buoyancy is 1 cm above that of mass, and the horizontal thrusters push 8.5 cm below it."""
    rov = load_vehicle(SHIPPED["bluerov2_heavy"])
    for axis, numbers in ROLLING.items():
        assert tuple(rov[name] for name in (f"I_{axis}", f"m_a_{axis}", f"b_d_{axis}", f"a_d_{axis}")) == numbers
    assert (rov["W"], rov["B"], rov["z_B"]) == pytest.approx((9.82 * 13.5, 9.82 * 13.4, -0.01), abs=1e-12)
    assert rov.layout.restoring == ("W", "B", "z_B")
    for thruster in rov.layout.thrusters:
        assert abs(thruster.effect(AXES["roll"])) == pytest.approx(0.06 if thruster.name in "1234" else 0.218, abs=2e-4)
        assert abs(thruster.effect(AXES["pitch"])) == pytest.approx(0.06 if thruster.name in "1234" else 0.12, abs=2e-4)


@pytest.mark.parametrize("name", BOTH)
def test_all_thrusters_turn_with_the_arm_of_the_publications(name: str) -> None:
    """The arm is 0.1888 m in Wu's thruster matrix, and by von Benzon's positions."""
    for thruster in load_vehicle(SHIPPED[name]).layout.thrusters[:4]:
        assert abs(thruster.effect(AXES["yaw"])) == pytest.approx(0.1888, abs=5e-5)
