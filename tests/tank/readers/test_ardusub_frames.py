"""Which servo of ArduSub drives which thruster: by force and torque, never by the order of the file."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Thruster
from rov_fmu.io.messages import InputError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import MISFITS as KINDS
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.readers.ardusub_frames import FRAMES, config_of, fitting_frames, servos_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.tank.logs import commanded, read_log
from tests.tank.readers.writers import attitude, dataflash, packed, parameter, rcou, servos, write_tlog
from tests.vehicles import thruster
from verification.references.autopilot.ardusub import VECTORED_6DOF

HEAVY, BLUEROV2, VIDEORAY = (load_vehicle(SHIPPED[name]).layout for name in ("bluerov2_heavy", "bluerov2", "videoray"))

# AP_Motors6DOF::setup_motors of ArduPilot 4.7, as it writes them: roll, pitch, yaw, throttle, forward, lateral.
ARDUSUB: dict[str, list[list[float]]] = {
    "bluerov1": [
        [0, 0, -1, 0, 1, 0],
        [0, 0, 1, 0, 1, 0],
        [-0.5, 0.5, 0, 0.45, 0, 0],
        [0.5, 0.5, 0, 0.45, 0, 0],
        [0, -1, 0, 1, 0, 0],
        [-0.25, 0, 0, 0, 0, 1],
    ],
    "vectored": [
        [0, 0, 1, 0, -1, 1],
        [0, 0, -1, 0, -1, -1],
        [0, 0, -1, 0, 1, 1],
        [0, 0, 1, 0, 1, -1],
        [1, 0, 0, -1, 0, 0],
        [-1, 0, 0, -1, 0, 0],
    ],
    "vectored_6dof": [list(map(float, motor)) for motor in VECTORED_6DOF],
    "vectored_6dof_90deg": [
        [1, 1, 0, 1, 0, 0],
        [0, 0, 1, 0, 1, 0],
        [1, -1, 0, 1, 0, 0],
        [0, 0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0, 1],
        [-1, 1, 0, 1, 0, 0],
        [0, 0, -1, 0, 1, 0],
        [-1, -1, 0, 1, 0, 0],
    ],
    "simplerov_3": [[0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 1, 0], [0, 0, 0, -1, 0, 0]],
    "simplerov_4": [[0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 1, 0], [1, 0, 0, -1, 0, 0], [-1, 0, 0, -1, 0, 0]],
    "simplerov_5": [
        [0, 0, -1, 0, 1, 0],
        [0, 0, 1, 0, 1, 0],
        [1, 0, 0, -1, 0, 0],
        [-1, 0, 0, -1, 0, 0],
        [0, 0, 0, 0, 0, 1],
    ],
}


def with_thrusters(thrusters: Sequence[Thruster]) -> Layout:
    return replace(HEAVY, thrusters=tuple(thrusters))


def a_thruster(name: str, motor: Sequence[float], sign: float, chance: Random) -> Thruster:
    """A thruster with the force of a motor, at a random place where its torque has the signs of the motor's factors."""
    roll, pitch, yaw, up, forward, lateral = motor
    x, y, z = (sign * size * chance.uniform(0.5, 2.0) for size in (forward, lateral, -up))
    while True:
        place = chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5)
        torque = np.cross(place, (x, y, z)) * sign
        if all(not factor or factor * own > 1e-3 for factor, own in zip((roll, pitch, yaw), torque, strict=True)):
            return thruster(name, "t200", (x, y, z), place)


def test_the_frames_are_those_of_ardusub_in_the_order_of_frame_config() -> None:
    """FRAME_CONFIG of ArduSub: 0 BlueROV1, 1 Vectored, 2 Vectored_6DOF, 3 Vectored_6DOF_90, 4 to 6 SimpleROV-3 to 5."""
    signs = {frame: [["-.+"[int(np.sign(f)) + 1] for f in m] for m in motors] for frame, motors in ARDUSUB.items()}
    assert {frame: [*map(list, motors)] for frame, motors in FRAMES.items()} == signs
    assert [*FRAMES] == [*ARDUSUB]
    assert config_of("vectored") == "FRAME_CONFIG 1 (vectored)"


@given(st.sampled_from([*FRAMES]), st.integers(0, 2**32).map(Random))
def test_force_and_torque_decide_whatever_the_order_of_the_thrusters(frame: str, chance: Random) -> None:
    """Names are no help here: they are numbers, of other motors. Motors with equal factors always get equal pulses."""
    motors = ARDUSUB[frame]
    names = chance.sample([*map(str, range(1, len(motors) + 1))], len(motors))
    signs = [chance.choice([1.0, -1.0]) for _ in motors]
    parts = [a_thruster(*one, chance) for one in zip(names, motors, signs, strict=True)]
    expected = {f"u_{name}": (n, sign) for n, (name, sign) in enumerate(zip(names, signs, strict=True), 1)}
    first = servos_of(with_thrusters(parts), None, {})
    assert servos_of(with_thrusters(chance.sample(parts, len(parts))), None, {}) == first
    assert servos_of(with_thrusters(parts), frame, {}) == first
    assert frame in fitting_frames(with_thrusters(parts))
    for name, (number, sign) in first.items():
        own = expected[name]
        assert (motors[number - 1], sign) == (motors[own[0] - 1], own[1])
    assert Counter(number for number, _ in first.values()) == Counter(range(1, len(motors) + 1))


@given(st.sampled_from(["simplerov_4", "simplerov_5", "vectored"]), st.integers(0, 2**32).map(Random))
def test_what_the_torques_leave_open_is_said_and_can_be_set(frame: str, chance: Random) -> None:
    """Two vertical thrusters on the centre line do not roll, so nothing tells which is which."""
    motors = ARDUSUB[frame]
    vertical = [n for n, motor in enumerate(motors) if motor[3]]
    parts = [a_thruster("abcdefgh"[n], motor, 1.0, chance) for n, motor in enumerate(motors)]
    for n in vertical:
        parts[n] = thruster(parts[n].name, "t200", (0.0, 0.0, 1.0), (chance.uniform(-1.0, 1.0), 0.0, 0.0))
    servo, other = (n + 1 for n in vertical)
    names = f"u_{parts[servo - 1].name} and u_{parts[other - 1].name}"
    said = f"--frame {frame}: which of the servos {servo} and {other} drives {names} does not follow from the torques"
    layout = with_thrusters(chance.sample(parts, len(parts)))
    for chosen in (None, frame):
        with pytest.raises(InputError, match=said):
            servos_of(layout, chosen, {})
    a, b = (parts[n].name for n in vertical)
    for first, second in ((a, b), (b, a)):
        found = servos_of(layout, frame, {servo: first})
        assert (found[f"u_{first}"], found[f"u_{second}"]) == ((servo, 1.0), (other, 1.0))
    numbered = [thruster(f"{n + 1}", "t200", p.direction.value, p.place) for n, p in enumerate(parts)]
    by_name = servos_of(with_thrusters(chance.sample(numbered, len(numbered))), None, {})
    assert {name: number for name, (number, _) in by_name.items()} == {f"u_{n + 1}": n + 1 for n in range(len(motors))}


def test_a_torque_of_zero_gives_way_to_one_that_the_frame_asks_for() -> None:
    """Motor 3 has the roll factor +1 and motor 4 has -1: the thruster on the starboard side cannot be motor 4."""
    ahead = [thruster(name, "t200", (1.0, 0.0, 0.0), (0.0, y, 0.0)) for name, y in (("l", -0.2), ("r", 0.2))]
    middle, starboard = (thruster(name, "t200", (0.0, 0.0, 1.0), (0.0, y, 0.0)) for name, y in (("m", 0.0), ("s", 0.2)))
    for thrusters in ([*ahead, middle, starboard], [*ahead, starboard, middle]):
        servos = servos_of(with_thrusters(thrusters), None, {})
        assert {name: number for name, (number, _) in servos.items()} == {"u_r": 1, "u_l": 2, "u_s": 3, "u_m": 4}


def test_tables_replace_the_frame_or_change_it() -> None:
    assert servos_of(VIDEORAY, None, {}) == {"u_r": (1, 1.0), "u_l": (2, 1.0), "u_t": (3, 1.0)}
    assert servos_of(VIDEORAY, "simplerov_3", {5: "-t"}) == {"u_r": (1, 1.0), "u_l": (2, 1.0), "u_t": (5, -1.0)}
    assert servos_of(VIDEORAY, None, {4: "l"}) == {"u_l": (4, 1.0)}
    assert {name: servo for name, (servo, _) in servos_of(BLUEROV2, None, {}).items()} == {
        f"u_{n}": n for n in range(1, 7)
    }
    heavy = servos_of(HEAVY, "vectored", {4: "-7"})
    assert heavy["u_7"] == (4, -1.0)
    assert {name: servo for name, (servo, _) in heavy.items()} == {
        **{f"u_{n}": n for n in (1, 2, 3, 5, 6)},
        "u_7": 4,
    }, "servo 4 no longer drives u_4"


# ---- Logs of other vehicles ------------------------------------------------------------------------------------------


def functions(*motors: int) -> dict[str, float]:
    """The parameters of servos 1, 2, ..., each of which drives a motor, or a camera (7) for 0."""
    return {f"SERVO{n}_FUNCTION": 32.0 + motor if motor else 7.0 for n, motor in enumerate(motors, 1)}


SIMPLE = with_thrusters(
    [a_thruster("abcd"[n], motor, 1.0, Random(n)) for n, motor in enumerate(ARDUSUB["simplerov_4"])]
)
BEYOND = ", but the vehicle has no thruster for them, so that forces and inertias come out wrong"
SILENT = "no pulses come to the thrusters {}, so that forces and inertias come out wrong"
HAS_2, FITS_1, FITS_2 = (
    "the log has FRAME_CONFIG 2 (vectored_6dof)",
    "FRAME_CONFIG 1 (vectored) fits the vehicle",
    "FRAME_CONFIG 2 (vectored_6dof) fits the vehicle",
)
ASSIGNED = "motor 7 (SERVO7_FUNCTION 39) and motor 8 (SERVO8_FUNCTION 40)"
EIGHT, SIX = functions(*range(1, 9)), functions(1, 2, 3, 4, 5, 6, 0, 0)
ALL = "surge, sway, heave, yaw"
# The vehicle, the outputs that change, those that rest at 1500 us, the parameters, the words, and the axes.
MISFITS: dict[str, tuple[Layout, Sequence[int], Sequence[int], dict[str, float], str, str]] = {
    "eight motors, six thrusters": (
        BLUEROV2,
        range(5, 9),
        range(1, 5),
        {**EIGHT, "FRAME_CONFIG": 2},
        f"there are commands of {ASSIGNED}{BEYOND}: {HAS_2}, and {FITS_1}",
        "heave",
    ),
    "no frame": (
        BLUEROV2,
        range(5, 9),
        range(1, 5),
        EIGHT,
        f"there are commands of {ASSIGNED}{BEYOND}: {FITS_1}",
        ALL,
    ),
    "no parameters": (
        BLUEROV2,
        range(5, 9),
        range(1, 5),
        {},
        f"there are commands of output 7 and output 8{BEYOND}: {FITS_1}",
        ALL,
    ),
    "motors that rest": (BLUEROV2, [5, 6], [1, 2, 3, 4, 7, 8], {**EIGHT, "FRAME_CONFIG": 2}, "", ""),
    "a camera": (BLUEROV2, range(5, 9), range(1, 5), SIX, "", ""),
    "all motors": (HEAVY, range(1, 9), [], {**EIGHT, "FRAME_CONFIG": 2}, "", ""),
    "six motors, eight thrusters": (
        HEAVY,
        range(1, 7),
        [],
        {**functions(*range(1, 7)), "FRAME_CONFIG": 1},
        f"{SILENT.format('7 and 8')}: the log has FRAME_CONFIG 1 (vectored), and {FITS_2}",
        "heave, roll, pitch",
    ),
    "six motors and a camera, eight thrusters": (
        HEAVY,
        range(1, 9),
        [],
        SIX,
        f"{SILENT.format('7 and 8')}: {FITS_2}",
        "heave, roll, pitch",
    ),
    "a motor with two outputs": (
        BLUEROV2,
        [*range(1, 7), 9],
        [],
        {**functions(*range(1, 7)), "SERVO9_FUNCTION": 33},
        "",
        "",
    ),
    "a motor of the frame that the vehicle lacks": (
        SIMPLE,
        range(1, 6),
        [],
        {**functions(*range(1, 6)), "FRAME_CONFIG": 5},
        "",
        "",
    ),
    "an unknown frame": (VIDEORAY, range(1, 5), [], {"FRAME_CONFIG": 99}, f"output 4{BEYOND}: FRAME_CONFIG 4 (", "*"),
}


@pytest.mark.parametrize("name", [".tlog", ".bin"])
@pytest.mark.parametrize("case", MISFITS)
def test_motors_of_a_log_that_are_not_the_thrusters_are_named(case: str, name: str, tmp_path: Path) -> None:
    layout, changing, resting, parameters, words, axes = MISFITS[case]
    path = tmp_path / f"dive{name}"
    rows = [[0] * 14 for _ in range(40)]
    for n, row in enumerate(rows):
        for number in (*changing, *resting):
            row[number - 1] = 1500 + (10 * (n % 20) if number in changing else 0)
    if name == ".tlog":
        sent = [parameter(key, value) for key, value in parameters.items()]
        for n, row in enumerate(rows):
            sent += [servos(2.0 + 0.1 * n, *row), attitude(2.0 + 0.1 * n, 0.01 * n)]
        write_tlog(path, sent)
    else:
        told = [packed("PARM", 10**6, key.encode(), value, 0.0) for key, value in parameters.items()]
        dataflash(path, [*told, *(rcou(2.0 + 0.1 * n, *row) for n, row in enumerate(rows))])
    found = [finding for finding in read_log(path, layout).findings if finding.kind in KINDS]
    said = sentences(found)
    assert len(said) == bool(words)
    assert all(line.startswith(f"{path.name}: ") and words in line for line in said)
    if axes != "*":
        assert ", ".join(finding.axis for finding in found) == axes


def test_columns_of_numbered_thrusters_that_the_vehicle_lacks_are_named(tmp_path: Path) -> None:
    header = ",".join(["time [s]", *(f"u_{n} [%]" for n in range(1, 9)), "u_light [%]", "depth [m]"])
    path = tmp_path / "dive.csv"
    np.savetxt(path, _rows(), "%.4g", ",", header=header, comments="")
    for layout, words in ((BLUEROV2, f"'u_7 [%]' and 'u_8 [%]'{BEYOND}: {FITS_1}"), (HEAVY, "")):
        found = [finding for finding in read_log(path, layout).findings if finding.kind in KINDS]
        (said,) = sentences(found) or ("",)
        assert said.endswith(words)
        assert len(found) == (len(layout.axes) if words else 0)


@pytest.mark.parametrize("neutral", [1500.0, 1530.0])
def test_columns_whose_neutral_is_where_they_rest_have_their_thrusters(neutral: float, tmp_path: Path) -> None:
    rows, header = _rows()[:, :8], ",".join(["time [s]", *(f"u_{n} [us]" for n in range(1, 7)), "depth [m]"])
    rows[:, 1:7] = neutral + 100.0 * (rows[:, :1] > 2.0)
    np.savetxt(tmp_path / "dive.csv", rows, "%.4g", ",", header=header, comments="")
    read = read_log(tmp_path / "dive.csv", BLUEROV2)
    assert not [finding for finding in read.findings if finding.kind in KINDS]
    assert commanded(read.log, "1")[0] == 0.0


def _rows() -> Array:
    time = 0.1 * np.arange(40.0)
    return np.column_stack([time, *[20.0 * np.sin(time + n) for n in range(9)], 2.0 + 0.1 * time])
