"""The companion `sensors` against the truth, the statistics that its parameters tell, and the same noise in Python."""

from collections.abc import Mapping
from io import StringIO
from math import exp, sqrt
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.spatial.transform import Rotation
from scipy.stats import kstest, kurtosis

from rov_fmu.bridges.system.sensors import CHANNELS, sensors_model
from rov_fmu.build import model_fmu
from rov_fmu.cli import main
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.fmus.fmu import Fmu
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

H = 0.01
TOLD = [name for name in CHANNELS if name != "psi"]
STATUS = [f"{what}_{name}" for what in ("time_of", "valid") for name in ("position", "depth", "velocity", "attitude")]
QUIET = {f"noise_{kind}": 0.0 for kind in ("position", "depth", "sinking", "velocity", "heading", "tilt", "turn")}
QUIET |= {name.replace("noise", what): 0.0 for name in QUIET for what in ("wander", "resolution")} | {"outliers": 0.0}
"""Parameters without which an instrument has a rate and a delay alone."""
AT_ONCE = {
    f"{what}_{name}": 0.0 for what in ("rate", "delay") for name in ("position", "depth", "velocity", "attitude")
}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Fmu]:
    """The FMUs of the sensors of two vehicles for this machine, in both versions of FMI."""
    folder, found = tmp_path_factory.mktemp("sensors"), {}
    for name in ("bluerov2_heavy", "videoray"):
        for fmi in (2, 3):
            path = folder / f"{name}_{fmi}.fmu"
            path.write_bytes(model_fmu(sensors_model(load_vehicle(SHIPPED[name]), H), ["host"], fmi=fmi))
            assert validate_fmu(str(path)) == []
            found[name, fmi] = Fmu.open(path, is_ours=True)
    return found


def times(count: int, h: float = H) -> Array:
    """Return the times at the start and after each of some steps."""
    return np.array([n * h for n in range(count + 1)])


def moved(t: Array, names: list[str]) -> dict[str, Array]:
    """Return a motion: each input is another sine, and the quaternion is one."""
    made = {name: np.sin((0.3 + 0.1 * n) * t + n) for n, name in enumerate(names)}
    if QUATERNION[0] in names:
        size = np.sqrt(sum(made[name] ** 2 for name in QUATERNION))
        made |= {name: made[name] / size for name in QUATERNION}
    return made


def told(
    fmu: Fmu, seconds: float, start: Mapping[str, float], inputs: Mapping[str, Array] | None = None, h: float = H
) -> dict[str, Array]:
    """Return what the sensors tell after each step; `inputs` are what is true at its start."""
    t = times(round(seconds / h), h)
    names = [name for name in [*CHANNELS, *STATUS] if name in fmu.variables]
    given = {f"true_{name}": values[:-1] for name, values in (inputs or {}).items()}
    result = fmu.run(t, given, names, start)
    return {name: np.array(result[name]) for name in names}


@pytest.mark.parametrize("name", ["bluerov2_heavy", "videoray"])
def test_without_faults_the_sensors_tell_the_truth_to_the_bit(fmus: dict[tuple[str, int], Fmu], name: str) -> None:
    fmu, t = fmus[name, 2], times(300)
    motion = moved(t, [one for one in CHANNELS if one in fmu.variables])
    found = told(fmu, 3.0, {"ideal": 1.0}, motion)
    assert len(motion) == {"bluerov2_heavy": 16, "videoray": 10}[name]
    for one, values in motion.items():
        assert found[one][0] == values[0], f"{one} at the start"
        assert (found[one][1:] == values[:-1]).all(), one
    quiet = told(fmu, 3.0, QUIET | AT_ONCE, motion)
    assert all((quiet[one] == found[one]).all() for one in motion), "each fault has a parameter that is 0"


def test_the_same_bits_in_both_versions_of_fmi_and_with_two_steps(fmus: dict[tuple[str, int], Fmu]) -> None:
    one = told(fmus["bluerov2_heavy", 2], 20.0, {"true_z": 3.0})
    other = told(fmus["bluerov2_heavy", 3], 20.0, {"true_z": 3.0})
    half = told(fmus["bluerov2_heavy", 2], 20.0, {"true_z": 3.0}, h=0.5 * H)
    for name in [*TOLD, *STATUS]:
        assert (one[name] == other[name]).all(), name
        assert (one[name] == half[name][::2]).all(), name  # every delay is a step or more
    seed = told(fmus["bluerov2_heavy", 2], 20.0, {"true_z": 3.0, "seed": 2.0})
    assert (seed["x"] != one["x"]).any()


def drawn(seed: int, number: int, stream: int) -> float:
    """Return a number of the normal distribution as the page says, in integers and doubles of Python."""

    def mixed(x: int) -> int:
        x = (x + 0x9E3779B97F4A7C15) % 2**64
        x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9 % 2**64
        x = (x ^ x >> 27) * 0x94D049BB133111EB % 2**64
        return x ^ x >> 31

    total = 0.0
    for i in range(4):
        bits = mixed((mixed(mixed(seed) ^ number) + 4 * stream + i) % 2**64)
        for j in range(3):
            total += ((bits >> 21 * j & 0x1FFFFF) + 0.5) / 2097152.0
    x = 0.25 * (total - 6.0)
    y = x * x
    return ((((0.029899776 * y + 0.008355968) * y + 0.076542912) * y + 0.252408784) * y + 3.949846138) * x


def test_the_noise_has_the_bits_of_ieee_754(fmus: dict[tuple[str, int], Fmu]) -> None:
    """So it has them on every platform: Python computes with the same doubles everywhere."""
    found = told(fmus["videoray", 2], 2.0, QUIET | AT_ONCE | {"noise_velocity": 0.01, "seed": 7.0})
    expected = [0.01 * drawn(7, k, CHANNELS.index("u")) for k in range(200)]
    assert found["u"][1:].tolist() == expected


# ---- Statistics ------------------------------------------------------------------------------------------------------

COUNT = 100_000
SIGMA, WANDER, TIME = 0.02, 0.05, 1.0


@pytest.fixture(scope="module")
def long(fmus: dict[tuple[str, int], Fmu]) -> dict[str, Array]:
    """Each channel with noise or wander, 10^5 samples at 100 Hz."""
    start = QUIET | {name: 100.0 if name.startswith("rate") else 0.0 for name in AT_ONCE}
    start |= dict.fromkeys(("noise_position", "noise_depth", "noise_velocity", "noise_turn"), SIGMA)
    start |= {"wander_sinking": WANDER, "time_depth": TIME}
    return {name: values[1:] for name, values in told(fmus["videoray", 2], COUNT * H, start).items()}


@pytest.mark.parametrize("name", ["x", "y", "z", "u", "vg_N", "r"])
def test_noise_is_white_and_normal(long: dict[str, Array], name: str) -> None:
    noise = long[name] / SIGMA
    assert noise.mean() == pytest.approx(0.0, abs=4.0 / sqrt(COUNT))
    assert noise.std() == pytest.approx(1.0, abs=4.0 / sqrt(2.0 * COUNT))
    assert kurtosis(noise) == pytest.approx(0.0, abs=4.0 * sqrt(24.0 / COUNT))
    assert kstest(noise, "norm").pvalue > 1e-3
    for lag in (1, 2, 10):
        assert np.mean(noise[lag:] * noise[:-lag]) == pytest.approx(0.0, abs=4.0 / sqrt(COUNT))
    assert np.corrcoef(noise, long["x" if name != "x" else "y"])[0, 1] == pytest.approx(0.0, abs=4.0 / sqrt(COUNT))


def test_the_wander_has_the_allan_deviation_of_gauss_and_markov(long: dict[str, Array]) -> None:
    """sigma_A^2 = 2 s^2 T/tau (1 - T/(2 tau) (3 - 4 exp(-tau/T) + exp(-2 tau/T))) of a process with s and T."""
    offset = long["vg_D"]
    assert offset.std() == pytest.approx(WANDER, rel=0.1)
    sums = np.cumsum([0.0, *offset])
    for count in (10, 30, 100, 300):
        tau = count * H
        means = np.diff(sums[::count]) / count
        found = sqrt(0.5 * np.mean(np.diff(means) ** 2))
        a = tau / TIME
        expected = WANDER * sqrt(2.0 / a * (1.0 - (3.0 - 4.0 * exp(-a) + exp(-2.0 * a)) / (2.0 * a)))
        assert found == pytest.approx(expected, rel=0.05), tau


# ---- Faults ----------------------------------------------------------------------------------------------------------


def test_a_value_is_held_between_samples_and_comes_late(fmus: dict[tuple[str, int], Fmu]) -> None:
    t = times(1000)
    start = QUIET | AT_ONCE | {"rate_position": 2.0, "delay_position": 0.7}
    found = told(fmus["videoray", 2], 10.0, start, {"x": t, "psi": 0.0 * t})
    expected = np.maximum(np.floor((t - 0.7) / 0.5 + 1e-6) * 0.5, 0.0)
    np.testing.assert_allclose(found["x"], expected, atol=1e-9)
    np.testing.assert_allclose(found["time_of_position"], expected, atol=1e-9)


def test_a_dvl_has_lock_between_two_altitudes_and_else_tells_its_last_velocity(
    fmus: dict[tuple[str, int], Fmu],
) -> None:
    t = times(1000)
    start = QUIET | AT_ONCE | {"seabed": 60.0, "altitude_least": 2.0, "altitude_most": 50.0, "down_velocity": 1.0}
    found = told(fmus["videoray", 2], 10.0, start, {"z": 6.0 * t, "u": t})
    altitude = 59.0 - 6.0 * t
    expected = (altitude >= 2.0) & (altitude <= 50.0)
    assert (found["valid_velocity"][1:] == expected[:-1]).all()
    assert set(found["u"][found["valid_velocity"] == 0.0]) == {0.0, t[expected][-1]}
    assert (found["valid_depth"] == 1.0).all()
    lost = told(fmus["videoray", 2], 4.0, QUIET | AT_ONCE | {"lost_from_depth": 1.005, "lost_for_depth": 2.0})
    assert (lost["valid_depth"] == 0.0).sum() == 200


def test_a_lever_arm_a_lag_a_resolution_and_a_current_act_as_they_should(fmus: dict[tuple[str, int], Fmu]) -> None:
    fmu, t = fmus["bluerov2_heavy", 2], times(300)
    motion = moved(t, [one for one in CHANNELS if one in fmu.variables])
    place = {"forward": 0.3, "starboard": -0.2, "down": 0.5}
    start = (
        QUIET | AT_ONCE | {f"{side}_{of}": x for side, x in place.items() for of in ("position", "depth", "velocity")}
    )
    found = told(fmu, 3.0, start, motion)
    turn = Rotation.from_quat(np.array([motion[name] for name in (*QUATERNION[1:], QUATERNION[0])]).T)
    rate, arm = np.array([motion[name] for name in "pqr"]).T, np.array([*place.values()])
    expected = {
        ("x", "y", "z"): turn.apply(arm),
        ("u", "v", "w"): np.cross(rate, arm),
        ("vg_N", "vg_E", "vg_D"): turn.apply(np.cross(rate, arm)),
    }
    for names, added in expected.items():
        change = np.array([found[name][1:] - motion[name][:-1] for name in names]).T
        np.testing.assert_allclose(change, added[:-1], atol=1e-14)
    by_heading = told(fmus["videoray", 2], 0.1, QUIET | AT_ONCE | {"forward_position": 1.0, "true_psi": 100.0})
    assert (by_heading["x"][-1], by_heading["y"][-1]) == pytest.approx((np.cos(100.0), np.sin(100.0)), abs=1e-13)
    step = {"z": np.where(t > 0.0, 1.0, 0.0)}
    late = told(fmus["videoray", 2], 3.0, QUIET | AT_ONCE | {"lag_depth": 0.5}, step)["z"]
    assert late[51] == pytest.approx(1.0 - exp(-1.0), abs=0.01)
    coarse = told(fmus["videoray", 2], 0.1, QUIET | AT_ONCE | {"resolution_depth": 0.25, "true_z": 3.1})
    assert coarse["z"][-1] == 3.0
    pulled = {"heading_per_ampere": 0.01, "electric_current": 8.0}
    assert told(fmus["videoray", 2], 0.1, QUIET | AT_ONCE | pulled)["psi"][-1] == pytest.approx(0.08)
    pulled |= {"true_eta": np.cos(0.5), "true_epsilon_3": np.sin(0.5)}
    compass = told(fmu, 0.1, QUIET | AT_ONCE | pulled)
    heading = 2.0 * np.arctan2(compass["epsilon_3"][-1], compass["eta"][-1])
    assert heading == pytest.approx(1.0 + 0.08, abs=1e-4)


def test_outliers_have_their_share_and_size(fmus: dict[tuple[str, int], Fmu]) -> None:
    start = QUIET | AT_ONCE | {"outliers": 0.05, "outlier_size": 3.0}
    x = told(fmus["videoray", 2], 100.0, start)["x"][1:]
    assert np.mean(x != 0.0) == pytest.approx(0.05, abs=4.0 * sqrt(0.05 / len(x)))
    assert x[x != 0.0].std() == pytest.approx(3.0, rel=4.0 / sqrt(2.0 * 0.05 * len(x)))


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_state_that_is_restored_goes_on_with_the_same_samples(
    fmus: dict[tuple[str, int], Fmu], fmi: int, tmp_path: Path
) -> None:
    path = fmus["bluerov2_heavy", fmi].path
    description = fmpy.read_model_description(str(path))
    references = {one.name: one.valueReference for one in description.modelVariables}
    folder = fmpy.extract(str(path), unzipdir=str(tmp_path))
    pilot = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    if fmi == 2:
        pilot.setupExperiment(startTime=0.0)
    pilot.enterInitializationMode()
    pilot.exitInitializationMode()
    get = pilot.getReal if fmi == 2 else pilot.getFloat64
    names = [references[name] for name in [*TOLD, *STATUS]]

    def steps(first: int) -> list[list[float]]:
        rows = []
        for n in range(first, first + 100):
            pilot.doStep(n * H, H)
            rows.append(get(names))
        return rows

    steps(0)
    state = pilot.getFMUstate() if fmi == 2 else pilot.getFMUState()
    content = pilot.serializeFMUstate(state) if fmi == 2 else pilot.serializeFMUState(state)
    before = steps(100)
    back = pilot.deSerializeFMUstate(content) if fmi == 2 else pilot.deserializeFMUState(content)
    (pilot.setFMUstate if fmi == 2 else pilot.setFMUState)(back)
    assert steps(100) == before
    pilot.terminate()
    pilot.freeInstance()


# ---- The log of a dive -----------------------------------------------------------------------------------------------

DIVE = """
step = 0.02
stop_time = 2.0
connect = [
  ["rov.pose", "sensors.true_pose"], ["rov.velocity", "sensors.true_velocity"],
  ["rov.body_velocity", "sensors.true_body_velocity"],
  ["sensors.pose", "autopilot.pose"], ["sensors.velocity", "autopilot.velocity"],
  ["sensors.body_velocity", "autopilot.body_velocity"], ["sensors.valid", "autopilot.valid"],
  ["autopilot.thrusters", "rov.thrusters"],
]
[component.rov]
vehicle = "bluerov2_heavy"
start = { z = 10, psi_0 = 2.0 }
[component.sensors]
companion = "sensors"
for = "rov"
start = { lost_from_velocity = 1.0, lost_for_velocity = 5.0 }
[component.autopilot]
companion = "autopilot"
for = "rov"
start = { stick_u = 0.5, mode_r = 1, ref_r = 0.5 }
"""


def test_a_run_writes_a_log_whose_samples_are_those_of_the_dive(tmp_path: Path) -> None:
    plan = tmp_path / "dive.toml"
    plan.write_text(DIVE, encoding="utf-8")
    assert main(["system", str(plan), "-o", str(tmp_path / "my.ssp"), "--run"]) == 0
    motion = np.genfromtxt(tmp_path / "my.csv", delimiter=",", names=True, deletechars="")
    header, _, rows = (tmp_path / "my_sensors.csv").read_text(encoding="utf-8").partition("\n")
    log = dict(zip(header.split(","), np.genfromtxt(StringIO(rows), delimiter=",").T, strict=True))
    assert (log["time [s]"] == motion["time"]).all()
    for n in range(1, 9):
        assert (log[f"u_{n} [1]"] == motion[f"autopilot.u_{n}"]).all()
    taken = {name: motion["time"][np.isfinite(values)] for name, values in log.items()}
    np.testing.assert_allclose(np.diff(taken["north velocity [m/s]"]), 0.2)
    assert taken["east velocity [m/s]"][-1] == pytest.approx(0.8), "what is not valid is empty"
    due = np.arange(0.0, 1.9, 0.05)
    np.testing.assert_allclose(taken["depth [m]"][: len(due)], np.ceil(due / 0.02 - 1e-6) * 0.02, atol=1e-9)
    for name, truth, noise in (
        ("depth [m]", "z", 0.05),
        ("north velocity [m/s]", "vg_N", 0.03),
        ("yaw velocity [rad/s]", "r", 0.005),
        ("heading [rad]", "psi", 0.06),
        ("roll angle [rad]", "phi", 0.02),
        ("pitch angle [rad]", "theta", 0.02),
    ):
        told = np.isfinite(log[name])
        assert np.abs(log[name] - motion[f"rov.{truth}"])[told].max() < noise, name
    assert np.ptp(motion["rov.psi"]) > 0.5
    assert np.ptp(motion["rov.vg_N"]) > 0.3
