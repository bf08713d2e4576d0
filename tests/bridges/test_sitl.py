"""`rov-fmu sitl` as ArduPilot's simulator sees it: packets, lockstep, lost packets, what the sensors tell, the log."""

import json
import random
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import nan, pi, remainder
from pathlib import Path
from shlex import quote, split
from socket import AF_INET, SOCK_DGRAM, socket
from threading import Thread
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rov_fmu.bridges.sitl import MOST_LOGS, Outputs, Setup, SitlConnection
from rov_fmu.bridges.sitl_protocol import ServoPacket, reply, servo_packet
from rov_fmu.c.simulation import Array
from rov_fmu.c.stepper import Stepper
from rov_fmu.cli import main
from rov_fmu.identify.beginning import load_tests
from rov_fmu.interface.sitl_command import _setup
from rov_fmu.tank.readers.ardusub_frames import FRAMES, servos_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.bridges.ardusub import START, ArduSub, packet, parsed, started
from tests.commands import ROOT, Capsys
from tests.tank.logs import commanded, used
from tests.vehicles import numbered, pulsed, thruster

HEAVY: Vehicle = load_vehicle(SHIPPED["bluerov2_heavy"])
HERE, THERE = ("127.0.0.1", 40000), ("127.0.0.1", 40001)
NEUTRAL = [1500] * 16
ROV_TOML = """
base = "bluerov2_heavy"
[vehicle]
name = "A"
identifier = "a"
version = "1"
description = "A Heavy in a simulator"
source = "A simulated flight"
"""


def setup_of(rov: Vehicle = HEAVY, **start: float) -> Setup:
    return Setup(rov, servos_of(rov.layout, None, {}), start, bottom=20.0)


def stamp(answer: bytes) -> float:
    return parsed(answer)["timestamp"][0]


@contextmanager
def served(setup: Setup, hint: Callable[[str], None] = lambda _: None) -> Iterator[tuple[SitlConnection, int]]:
    """Serve a vehicle in a thread, and yield the connection and its port."""
    with socket(AF_INET, SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        connection = SitlConnection(setup, hint)

        def serve() -> None:
            try:
                connection.serve(server)
            except OSError:
                return  # the test is over

        thread = Thread(target=serve, daemon=True)
        thread.start()
        yield connection, server.getsockname()[1]


# ---- Packets ---------------------------------------------------------------------------------------------------------


def test_servo_packets_byte_by_byte() -> None:
    """From SIM_JSON.h: uint16 magic, uint16 frame_rate, uint32 frame_count, uint16 pwm[16 or 32], little-endian."""
    sixteen = bytes.fromhex("1a48 9001 04030201") + bytes.fromhex("4c04dc056c07") + bytes(26)
    assert len(sixteen) == 40
    assert servo_packet(sixteen) == ServoPacket(400, 0x01020304, (1100, 1500, 1900, *[0] * 13))
    thirty_two = bytes.fromhex("8173 b004 ffffffff" + "dc05" * 31 + "6c07")
    assert len(thirty_two) == 72
    assert servo_packet(thirty_two) == ServoPacket(1200, 2**32 - 1, (*[1500] * 31, 1900))
    for wrong in (b"", sixteen[:7], sixteen[:-1], sixteen + b"\0", thirty_two[:40], b"\x1b" + sixteen[1:]):
        assert servo_packet(wrong) is None


class Server:
    """A socket to which packets come, some seconds apart, and a clock."""

    def __init__(self, packets: list[tuple[float, bytes]]) -> None:
        self.now, self.packets, self.sent = 0.0, packets, 0

    def clock(self) -> float:
        return self.now

    def getsockname(self) -> tuple[str, int]:
        return HERE

    def settimeout(self, seconds: float) -> None:
        assert 0.0 < seconds <= 5.0

    def recvfrom(self, _: int) -> tuple[bytes, tuple[str, int]]:
        after, data = self.packets.pop(0)
        self.now += after
        if not data:
            raise TimeoutError
        return data, HERE

    def sendto(self, *_: object) -> None:
        self.sent += 1


def test_the_duration_is_the_time_of_all_flights_and_of_the_silences() -> None:
    """Two flights of 0.5 s and a silence of 6 s, which all end after 7 s; what comes then is not received."""
    flight = [(0.0, packet(20, count, NEUTRAL)) for count in range(11)]
    wait, again, late = [(5.0, b""), (1.0, b"")], flight[:1] * 2 + flight[1:10], [(0.0, b"late")]
    server: Any = Server(flight[:10] + wait + again + late)
    hints: list[str] = []
    connection = SitlConnection(setup_of(), hints.append, server.clock)
    connection.serve(server, 7.0)
    assert (server.sent, server.packets) == (20, late)
    assert 0.0 < connection.traffic.own_time < 0.5
    assert hints == ["waiting for packets of ArduSub to UDP port 40000: start it with --model JSON"]


def test_a_reply_byte_by_byte() -> None:
    rest = SitlConnection(setup_of(load_vehicle(SHIPPED["videoray"]), z=3.0))
    answer = rest.answer(packet(400, 0, NEUTRAL), HERE)
    assert answer == (
        b'\n{"timestamp":0.0025,"imu":{"gyro":[0.0,0.0,0.0],"accel_body":[0.0,0.0,-9.80665]},"position":[0.0,0.0,3.0],'
        b'"attitude":[0.0,0.0,0.0],"velocity":[0.0,0.0,0.0],"rng_1":17.0}\n'
    )
    with pytest.raises(ValueError, match="not JSON compliant"):
        reply({"timestamp": nan})


def test_the_battery_of_the_reply_is_the_sum_over_the_thrusters() -> None:
    """The maker's sheet at 16 V: 23.90 A at 1896 us, 4.58 A at 1700 us, 4.40 A at 1300 us, and 0 A at rest.

    The file has every third point. Without a current and a voltage, ArduPilot uses its own battery.
    """
    connection, found = SitlConnection(setup_of()), []
    for count, pulses in enumerate(([1500] * 8, [0] * 8, [1896, 1700, 1300, *[1500] * 5])):
        battery = json.loads(connection.answer(packet(400, count, [*pulses, *[0] * 8]), HERE))["battery"]
        found += [battery["voltage"], battery["current"]]
    assert found == pytest.approx([16.0, 0.0, 16.0, 0.0, 16.0, 23.9 + 4.58 + 4.4], abs=0.1)
    curves = tuple(replace(curve, electric_current=None) for curve in HEAVY.layout.curves)
    without = SitlConnection(setup_of(replace(HEAVY, layout=replace(HEAVY.layout, curves=curves))))
    assert b"battery" not in without.answer(packet(400, 0, NEUTRAL), HERE)


def test_a_repeated_frame_gets_the_same_bytes_without_a_step() -> None:
    connection = SitlConnection(setup_of())
    first = connection.answer(packet(400, 7, NEUTRAL), HERE)
    assert connection.answer(packet(400, 7, NEUTRAL), HERE) == first
    assert stamp(connection.answer(packet(400, 8, NEUTRAL), HERE)) == pytest.approx(0.005)
    assert stamp(connection.answer(packet(1200, 10, [1500] * 32), HERE)) == pytest.approx(0.005 + 1 / 1200)
    assert connection.order.lost == 1
    expected = pytest.approx(0.005 + 1 / 1200 + 1 / 20)
    assert stamp(connection.answer(packet(1, 11, NEUTRAL), HERE)) == expected, "ArduPilot refuses steps of 0.1 s"


def test_the_count_goes_on_after_its_largest_value_and_a_jump_is_believed_when_it_is_repeated() -> None:
    connection = SitlConnection(setup_of())
    for count, is_answered in (
        (2**32 - 2, True),
        (2**32 - 1, True),
        (0, True),
        (1, True),
        (12, False),
        (12, True),
        (2, True),
        (3, True),
        (13, True),
    ):
        assert bool(connection.answer(packet(400, count, NEUTRAL), HERE)) == is_answered, count
    assert (connection.order.lost, connection.traffic.restarts) == (9, 0)


def test_what_an_autopilot_would_send() -> None:
    for rate, pulse, is_plausible in (
        (0, 1500, False),
        (1, 500, True),
        (20_000, 2500, True),
        (20_001, 1500, False),
        (400, 499, False),
        (400, 2501, False),
        (400, 0, True),
    ):
        assert ServoPacket(rate, 0, (1500, pulse)).is_plausible == is_plausible, (rate, pulse)


def test_late_packets_do_not_move_the_vehicle_and_a_restart_begins_again() -> None:
    now = [0.0]
    connection = SitlConnection(setup_of(z=1.0), clock=lambda: now[0])
    for count in range(50):
        connection.answer(packet(400, count, [1900] * 16), HERE)
    assert connection.answer(packet(400, 45, NEUTRAL), HERE) == b""
    assert connection.answer(packet(400, 0, NEUTRAL), HERE) == b"", "perhaps only late"
    assert connection.flight.time == pytest.approx(50 / 400)
    assert stamp(connection.answer(packet(400, 50, NEUTRAL), HERE)) == pytest.approx(51 / 400)
    assert connection.answer(packet(400, 0, NEUTRAL), THERE) == b"", "another autopilot, unless this one has ended"
    now[0] = 4.9
    assert connection.answer(packet(400, 0, NEUTRAL), THERE) == b"", "it may be late"
    now[0] = 5.0
    assert connection.answer(packet(400, 0, NEUTRAL), ("192.0.2.1", 40000)) == b"", "from another host"
    assert connection.answer(packet(0, 0, NEUTRAL), THERE) == b"", "no autopilot asks for 0 frames a second"
    again = parsed(connection.answer(packet(400, 0, NEUTRAL), THERE))
    assert again["timestamp"] == [1 / 400]
    assert again["position"] == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)
    for count in range(1, 4):
        connection.answer(packet(400, count, NEUTRAL), THERE)
    assert connection.answer(packet(400, 0, NEUTRAL), THERE) == b""
    assert stamp(connection.answer(packet(400, 0, NEUTRAL), THERE)) == 1 / 400, "repeated, so it is meant"
    assert connection.traffic.restarts == 2


def test_random_and_damaged_packets() -> None:
    """None of 10,000 of them raises anything, and the autopilot is served as before."""
    chance = random.Random(1)
    connection = SitlConnection(setup_of(z=1.0))
    for n in range(10_000):
        whole = bytearray(packet(chance.randrange(2**16), chance.randrange(2**32), [chance.randrange(2**16)] * 32))
        flipped = bytearray(whole)
        flipped[chance.randrange(8)] ^= 1 << chance.randrange(8)
        kinds = [chance.randbytes(chance.randrange(100)), whole[: chance.randrange(73)], whole, flipped]
        answer = connection.answer(bytes(kinds[n % 4]), HERE)
        assert not answer or all(np.isfinite(value).all() for value in parsed(answer).values())
    assert connection.traffic.ignored > 9000
    before = connection.flight.time
    assert stamp(connection.answer(packet(400, 123, NEUTRAL), HERE)) == pytest.approx(before + 0.0025)
    for n in range(300):  # damaged copies of the next packet, of which some come twice
        for _ in range(1 + n % 2):
            connection.answer(packet(400, 124 ^ 1 << chance.randrange(32), NEUTRAL), HERE)
    assert connection.answer(packet(400, 124, NEUTRAL), HERE)


def test_two_senders_and_old_files(tmp_path: Path) -> None:
    """One sender is followed, no file is replaced, and the number of logs is bounded."""
    for name in ("dive.csv", "dive_2.csv"):
        (tmp_path / name).write_text("kept", encoding="utf-8")
    hints: list[str] = []
    connection = SitlConnection(replace(setup_of(), log=tmp_path / "dive.csv"), hints.append)
    for count in range(100):
        assert connection.answer(packet(50, count, NEUTRAL), HERE)
        assert connection.answer(packet(50, 0, NEUTRAL), THERE) == b""
    for _ in range(MOST_LOGS + 5):  # restarts of the same sender
        for count in (0, 0, *range(1, 20), 10**6):
            connection.answer(packet(50, count, NEUTRAL), HERE)
    connection.write_log()
    assert {path.read_text(encoding="utf-8") for path in (tmp_path / "dive.csv", tmp_path / "dive_2.csv")} == {"kept"}
    assert connection.logs == {tmp_path / f"dive_{n}.csv": "" for n in range(3, MOST_LOGS + 3)}
    assert len(list(tmp_path.iterdir())) == MOST_LOGS + 2
    assert [hint.partition(",")[0] for hint in hints] == ["packets of other senders", "a run has 20 logs with 1"]
    assert hints[0].endswith("An autopilot that was started again is followed when the old one has been silent for 5 s")


def test_the_rows_of_the_logs_of_a_run_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two flights of 0.5 s and 2 s would have 4 and 19 rows."""
    monkeypatch.setattr("rov_fmu.bridges.sitl.MOST_ROWS", 9)
    hints: list[str] = []
    connection = SitlConnection(replace(setup_of(), log=tmp_path / "dive.csv"), hints.append)
    for count in (*range(25), 0, *range(100)):
        connection.answer(packet(50, count, NEUTRAL), HERE)
    connection.write_log()
    lengths = [len((tmp_path / name).read_text("utf-8").splitlines()) for name in ("dive.csv", "dive_2.csv")]
    assert lengths == [1 + 4, 1 + 5]
    assert [hint.partition(":")[0] for hint in hints] == ["a run has 20 logs with 1,000,000 rows in all at most"]


def _simple() -> Vehicle:
    """Return a vehicle of the frame simplerov_4: two thrusters push ahead and two down, each on another side."""
    places = {"a": ((1.0, 0.0, 0.0), 0.2), "b": ((1.0, 0.0, 0.0), -0.2), "c": ((0.0, 0.0, 1.0), 0.2)}
    places["d"] = (0.0, 0.0, 1.0), -0.2
    thrusters = tuple(thruster(name, "t200", to, (0.0, y, 0.0)) for name, (to, y) in places.items())
    return numbered(replace(HEAVY.layout, thrusters=thrusters), **HEAVY.coefficients)


SIMPLE = _simple()
NO_PULSES = "no pulses come to servos 7 and 8 (u_7 and u_8): does ArduSub have FRAME_CONFIG 2 (vectored_6dof)?"
TOO_MANY = "the pulses of {} change, but no thruster of the vehicle follows them: does ArduSub have FRAME_CONFIG {}?"


@pytest.mark.parametrize(
    ("vehicle", "motors", "moving", "said"),
    [
        ("bluerov2_heavy", 6, False, [NO_PULSES]),
        ("bluerov2_heavy", 8, True, []),
        ("bluerov2", 8, False, []),  # such as a gripper at rest
        ("bluerov2", 8, True, [TOO_MANY.format("servos 7 and 8", "1 (vectored)")]),
        ("videoray", 4, True, [TOO_MANY.format("servo 4", "4 (simplerov_3)")]),
        ("simplerov_4", 5, True, []),  # ArduSub drives five motors in this frame
        ("simplerov_4", 6, True, [TOO_MANY.format("servo 6", "5 (simplerov_4)")]),
    ],
)
def test_servos_that_do_not_fit_the_vehicle_are_named_once(
    vehicle: str, motors: int, moving: bool, said: list[str]
) -> None:
    """They are named when they have not fitted for 1 s, or at the end of a shorter flight.

    ArduSub sends pulses to servos 1 to 8 while it starts; an older one that starts at once sends them late.
    """
    for frames, start in ((120, START), (20, START), (120, 0.0), (20, 0.0)):
        hints: list[str] = []
        rov = SIMPLE if vehicle == "simplerov_4" else load_vehicle(SHIPPED[vehicle])
        connection = SitlConnection(setup_of(rov, z=9.0), hints.append)
        for count in range(frames + round(50 * start)):
            pulses = [1500 + moving * (count % 7)] * motors if count > 3 else []
            sent = started(count / 50.0 + START - start, pulses)
            connection.answer(packet(50, count, sent), HERE)
        assert hints == (said if frames == 120 else [])
        connection.end()
        connection.end()
        assert hints == said


@pytest.mark.parametrize(
    ("flight", "said"),
    [
        ([(3.0, [1500] * 6 + [1100])], []),  # a light that is off
        ([(3.0, [1500] * 6 + [0, 1900])], []),  # what follows servo 7, which has no pulse
        ([(2.0, [1500] * 6), (0.9, [1500] * 5), (2.0, [1500] * 6)], []),
        ([(2.0, [1500] * 6), (3.0, [0] * 6), (2.0, [1500] * 6)], []),  # no servo has a pulse
        ([(2.0, [1500] * 6), (1.1, [1500] * 5)], ["no pulses come to servo 6 (u_6)"]),
        ([(3.0, [0] * 6 + [1500])], ["no pulses come to servos 1, 2, 3, 4, 5 and 6 (u_1, u_2, u_3, u_4, u_5 and u_6)"]),
        (
            [(2.0, [1500] * 6 + [1100]), (1.1, [1500] * 6 + [1900])],
            ["the pulses of servo 7 change, but no thruster of"],
        ),
    ],
)
def test_servos_at_rest_and_short_silences_fit(flight: list[tuple[float, list[int]]], said: list[str]) -> None:
    hints: list[str] = []
    connection = SitlConnection(setup_of(load_vehicle(SHIPPED["bluerov2"]), z=9.0), hints.append)
    sent = [pulses for seconds, pulses in [(START, []), *flight] for _ in range(round(50 * seconds))]
    for count, pulses in enumerate(sent):
        connection.answer(packet(50, count, started(count / 50.0, pulses)), HERE)
    connection.end()
    assert [hint[: len(words)] for hint, words in zip(hints, said, strict=True)] == said


@pytest.mark.parametrize(
    ("name", "setting", "newtons"),
    [("bluerov2", 0.0, 2.0), ("bluerov2", -5.5, 7.5), ("bluerov2", 5.0, 0.0), ("bluerov2_heavy", -4.0, 3.0)],
)
def test_how_far_a_vehicle_rises_before_ardusub_knows_its_position(
    name: str, setting: float, newtons: float, capsys: Capsys
) -> None:
    """By SciPy: (m + m_a) w' = F - b_d w - a_d |w| w, with the numbers of the vehicle file."""
    rov = load_vehicle(SHIPPED[name])
    mass, linear, quadratic = rov["m_rov"] + rov["m_a_w"], rov["b_d_w"], rov["a_d_w"]
    loads = {"F_0_w": 1.0, "W": 1.0, "B": -1.0}
    force = setting + sum(sign * rov.coefficients.get(load, 0.0) for load, sign in loads.items())
    fall = solve_ivp(
        lambda _, y: (y[1], (force - linear * y[1] - quadratic * abs(y[1]) * y[1]) / mass), (0.0, 45.0), (0.0, 0.0)
    )
    given = [f"--set=Z_ext={setting}", "--set=z=50"]
    assert main(["sitl", name, *given, "--duration", "0.01", "--port", "0"]) == 0
    said = re.findall(r"rises with (.*) N: (.*) m in the 45 s before", capsys.readouterr().err)
    expected = [newtons, pytest.approx(-fall.y[0, -1], rel=0.05)]
    assert [[*map(float, found)] for found in said] == ([expected] if newtons else [])


def test_a_vehicle_without_roll_gets_a_word_about_the_roll_integrator(capsys: Capsys) -> None:
    for vehicle, is_told in (("bluerov2", True), ("bluerov2_heavy", False), ("videoray", False)):
        assert main(["sitl", vehicle, "--duration", "0.01", "--port", "0"]) == 0
        assert ("ATC_RAT_RLL_I 0" in capsys.readouterr().err) == is_told, vehicle


# ---- Motion ----------------------------------------------------------------------------------------------------------


def rotation(phi: float, theta: float, psi: float) -> Array:
    """The matrix from the body to north, east, down."""
    return np.asarray(Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix())


@pytest.mark.parametrize("name", ["bluerov2_heavy", "videoray"])
def test_the_sensors_agree_with_each_other(name: str) -> None:
    """Specific force, gyro and velocity are the derivatives of what the other sensors tell."""
    rov = load_vehicle(SHIPPED[name])
    connection = SitlConnection(setup_of(rov, V_N=0.4, V_E=-0.2, z=2.0))
    pulses = [1600, 1450, 1480, 1530, 1700, 1450, 1500, 1520] + [0] * 8
    rate, at = 5000, []
    for count in range(2500):
        at.append(connection.answer(packet(rate, count, pulses), HERE))
    for n in range(1000, 2499, 250):
        before, now, after = map(parsed, at[n - 1 : n + 2])
        R = rotation(*now["attitude"])

        def slope(key: str) -> Array:
            return 0.5 * rate * (np.array(after[key]) - before[key])  # noqa: B023

        force = R.T @ (slope("velocity") - [0.0, 0.0, 9.80665])
        assert now["accel_body"] == pytest.approx(force, abs=1e-5)
        assert now["velocity"] == pytest.approx(slope("position"), abs=1e-6)
        turning = 0.5 * rate * R.T @ (rotation(*after["attitude"]) - rotation(*before["attitude"]))
        assert now["gyro"] == pytest.approx([turning[2, 1], turning[0, 2], turning[1, 0]], abs=1e-5)
        assert now["rng_1"][0] * R[2, 2] == pytest.approx(20.0 - now["position"][2])
    assert max(map(abs, parsed(at[-1])["velocity"])) > 0.05


def test_no_log_replaces_a_table_of_the_vehicle(tmp_path: Path) -> None:
    """Also not the later logs, and not with --force, which replaces all others and tells so."""
    table, old = tmp_path / "dive_2.csv", tmp_path / "dive_3.csv"
    for path in (table, old):
        path.write_text("kept", encoding="utf-8")
    with patch.object(type(HEAVY), "files", [table]):
        connection = SitlConnection(replace(setup_of(), log=tmp_path / "dive.csv", force=True))
        for _ in range(2):
            for count in (0, 0, *range(1, 20), 10**6):
                connection.answer(packet(50, count, NEUTRAL), HERE)
        connection.write_log()
    assert table.read_text(encoding="utf-8") == "kept"
    foreign = "a file that has no mark of rov-fmu: it may have been made or changed by hand"
    assert connection.logs == {tmp_path / "dive.csv": "", old: foreign}


def test_the_pulses_of_the_vehicle_file_count() -> None:
    rov = load_vehicle(SHIPPED["videoray"])
    usual = SitlConnection(setup_of(rov)).answer(packet(400, 0, [1700, 1900, *[1500] * 14]), HERE)
    own = setup_of(pulsed(rov, (1000.0, 1500.0, 2000.0)))
    assert SitlConnection(own).answer(packet(400, 0, [1750, 2000, 0, *[1500] * 13]), HERE) == usual


@pytest.mark.parametrize(
    ("bottom", "start", "distance"),
    [(500.0, {}, 100.0), (3.0, {}, 0.0), (20.0, {"phi_0": 3.0}, 100.0), (110.0, {}, 100.0), (90.0, {"psi_0": 9}, 85.0)],
)
def test_the_distance_to_the_bottom_is_that_of_a_sensor_with_a_range_of_100_m(
    bottom: float, start: dict[str, float], distance: float
) -> None:
    """The heading is told within half a turn."""
    connection = SitlConnection(replace(setup_of(HEAVY, z=5.0, **start), bottom=bottom))
    found = parsed(connection.answer(packet(400, 0, NEUTRAL), HERE))
    assert found["rng_1"] == pytest.approx([distance], abs=1e-3)
    assert found["attitude"][2] == pytest.approx(remainder(start.get("psi_0", 0.0), 2.0 * pi), abs=1e-3)


# ---- The command -----------------------------------------------------------------------------------------------------


def test_the_command_flies_and_writes_a_log_that_identify_reads(tmp_path: Path) -> None:
    folder = tmp_path / "a dive"
    folder.mkdir()
    log = folder / "log_dive.csv"
    options = ["--set", "V_N=0.1", "--set", "z=1", "--duration", "6", "--log", str(log), "--port", "0"]
    command = [sys.executable, "-u", "-m", "rov_fmu", "sitl", "bluerov2_heavy", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout
        for number in range(1, 9):
            assert process.stdout.readline().startswith(f"servo {number} drives u_{number}: ")
        assert process.stdout.readline() == "ArduSub must have FRAME_CONFIG 2 (vectored_6dof)\n"
        found = re.search(r"UDP port (\d+)", process.stdout.readline())
        assert found
        autopilot = ArduSub(int(found[1]), rate=200, sticks=lambda t: (0.4 if t % 3 < 1.5 else -0.4, 0.2))
        autopilot.fly(6.0)
        autopilot.close()
        said = process.stdout.read()
        assert process.wait(30) == 0
    end = re.match(r"6\.000 s of flight; 1200 frames, (\d+) µs each; 0 repeated, 0 lost, 0 ignored, 0 restarts\n", said)
    assert end
    assert 1 < int(end[1]) < 5000
    (folder / "rov.toml").write_text(ROV_TOML, encoding="utf-8")
    (one,) = load_tests(folder).folder.logs
    at = [autopilot.history[n] for n in range(0, 1180, 20)]
    rows = [[*rotation(*a["attitude"]).T @ a["velocity"], a["position"][2], *a["attitude"]] for a in at]
    surge, sway, _, depth, *angles = np.transpose(rows)
    names = ("surge velocity", "sway velocity", "depth", "roll angle", "pitch angle", "heading")
    for name, expected in zip(names, (surge, sway, depth, *angles), strict=True):
        channel = used(one, name)
        assert channel.values[: len(at)] == pytest.approx(expected, abs=1e-8)
        assert np.diff(channel.time) == pytest.approx(0.1, abs=1e-9)
    assert np.ptp(commanded(one, "3")) > 0.4


def test_a_flight_without_packets_ends_with_its_duration_and_has_no_log(tmp_path: Path, capsys: Capsys) -> None:
    log = tmp_path / "dive.csv"
    options = ["--frame", "simplerov_3", "--servo", "16=-t", "--duration", "0.2", "--port", "0", "--log", str(log)]
    assert main(["sitl", "videoray", *options]) == 0
    assert re.sub(r"port \d+", "port 0", capsys.readouterr().out).splitlines() == [
        "servo 1 drives u_r: right thruster, positive forward",
        "servo 2 drives u_l: left thruster, positive forward",
        "servo 16 drives u_t: top thruster, positive down, reversed",
        "ArduSub must have FRAME_CONFIG 4 (simplerov_3)",
        "listening on 127.0.0.1, UDP port 0; Ctrl-C ends it",
        "0.000 s of flight; 0 frames, 0 µs each; 0 repeated, 0 lost, 0 ignored, 0 restarts",
        "No log was written, because no row was complete.",
    ]
    assert not log.exists()
    log.touch()
    assert main(["sitl", "videoray", *options]) == 2
    assert capsys.readouterr().err == (
        f"rov-fmu: --log {log}: the file exists; choose another name, or replace it with --force\n"
    )
    assert main(["sitl", "videoray", *options, "--force"]) == 0
    waiting = r"rov-fmu: waiting for packets of ArduSub to UDP port \d+: start it with --model JSON\n"
    assert re.fullmatch(waiting, capsys.readouterr().err)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            "videoray --frame vectord",
            "--frame 'vectord': must be one of bluerov1, vectored, vectored_6dof, vectored_6dof_90deg, simplerov_3, "
            "simplerov_4, simplerov_5; did you mean vectored?",
        ),
        ("videoray --frame vectored", "--frame vectored: the motors of this frame do not push"),
        ("videoray --servo 17=t", "--servo 17=t: must be N=NAME with N from 1 to 16, such as 3=l"),
        ("videoray --servo 0=t", "--servo 0=t: must be N=NAME"),
        ("videoray --servo 1=x", "--servo 1=x: there is no such input, only l, r, t"),
        ("videoray --servo 1=t --servo 2=-t", "--servo 2=-t: another servo drives this input"),
        ("videoray --servo 1=t --servo 1=l", "--servo 1=l: servo 1 is given before"),
        ("videoray --set u_l=0.5", "--set u_l: servo 2 drives this input"),
        ("videoray --set V_X=0.5", "--set V_X=0.5: the vehicle has no such"),
        ("videoray --log a.txt", "--log a.txt: the name must end with .csv"),
        ("videoray --host 192.0.2.1", "--host 192.0.2.1, --port 9002: cannot listen there"),
        (quote(f"{ROOT / 'verification' / 'fuzzing' / 'bare.toml'}"), "VEHICLE: none of ArduSub's frames"),
    ],
)
def test_bad_options_are_one_line(options: str, said: str, capsys: Capsys) -> None:
    assert main(["sitl", *split(options)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"rov-fmu: {said}")


FAST = 400


def frame_pulses(frame: str, seconds: float) -> list[list[int]]:
    """Return what a frame sends when sticks move ahead, aside and around, one after the other and together."""
    factors = np.array([["-.+".index(sign) - 1.0 for sign in motor] for motor in FRAMES[frame]])
    time = np.arange(round(seconds * FAST)) / FAST
    demands = np.array(
        [0.0 * time, 0.0 * time, 0.2 * np.sin(time), 0.2 + 0.0 * time, 0.4 + 0.0 * time, 0.3 * np.cos(time)]
    )
    outputs = np.clip(factors @ demands, -1.0, 1.0).T.tolist()
    return [[int(1500 + 400 * x) for x in row] for row in outputs]


@pytest.mark.parametrize("name", ["vectored", "vectored_6dof", "bluerov1", "vectored_6dof_90deg"])
def test_another_frame_with_as_many_motors_is_noticed_and_the_own_one_is_not(name: str) -> None:
    """FRAME_CONFIG 0 for 1, or 3 for 2, drives it astern or sideways when the stick is ahead. It takes 3 s to tell."""
    own = "vectored" if len(FRAMES[name]) == 6 else "vectored_6dof"
    vehicle = HEAVY if own == "vectored_6dof" else load_vehicle(SHIPPED["bluerov2"])
    setup = replace(setup_of(vehicle, z=10.0), frame=own)
    outputs = Outputs(setup.servos, len(FRAMES[own]), own)
    told = []
    for pulses in frame_pulses(name, 6.0):
        outputs.add(1.0 / FAST, (*pulses, *[0] * (16 - len(pulses))))
        told.append([words for words, *_ in outputs.doubts()])
    assert told[-1] == ([] if name == own else ["no demands give these pulses together"])
    assert not any(told[: 3 * FAST - 1])


def test_the_parameters_of_ardusub_are_written_as_the_simulator_loads_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    """ArduPilot's simulator reads a name and a value from each line of a file of --add-param-file."""
    monkeypatch.chdir(tmp_path)
    expected = {"bluerov2": (1, 0.0), "bluerov2_heavy": (2, None)}
    for name, (config, integral) in expected.items():
        options = [name, "--port", "0", "--duration", "0.01", "--parameters", "rov.parm", "--force"]
        assert main(["sitl", *options]) == 0
        values = {n: float(x) for n, x in (line.split() for line in Path("rov.parm").read_text("utf-8").splitlines())}
        assert values.pop("ATC_RAT_RLL_I", None) == integral
        assert values == {"FRAME_CONFIG": config, "BARO_SPEC_GRAV": 1.0264, "SIM_RATE_HZ": 400.0}
    capsys.readouterr()
    assert main(["sitl", *options[:-1]]) == 2
    assert capsys.readouterr().err == (
        "rov-fmu: --parameters rov.parm: the file exists; choose another name, or replace it with --force\n"
    )


def test_a_dead_time_may_be_set_where_the_file_has_none() -> None:
    options: dict[str, Any] = {"frame": None, "servos": (), "bottom": 20.0, "log": None, "log_rate": 10.0}
    setup, _ = _setup(SHIPPED["bluerov2"], settings=["T_d=0.02", "z=2"], force=False, **options)
    assert (setup.vehicle["T_d"], setup.start) == (0.02, {"z": 2.0})
    late, now = (Stepper(rov, {}, ["F_1"]) for rov in (setup.vehicle, load_vehicle(SHIPPED["bluerov2"])))
    commands = [0.5] * 6
    assert late.step(commands, 0.019)[-1] == 0.0 < abs(now.step(commands, 0.019)[-1])
