"""Logs of ArduSub, which the tests write with pymavlink (.tlog) and in the DataFlash format (.bin)."""

import sys
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.readers import parsers
from tests.tank.logs import commanded, measured, read_log, used
from tests.tank.readers.motion import BLUEROV2, DIVE
from tests.tank.readers.writers import altitude, attitude, flash, parameter, pulse, servos, write_tlog

N = 60


# ---- .tlog -----------------------------------------------------------------------------------------------------------


def dive(start: float = 100.0) -> list[tuple[float, Any]]:
    """Return messages of a dive: from 1 s on, the vertical thrusters push down and the depth grows at 0.2 m/s."""
    found = []
    for n in range(N):
        time = start + 0.1 * n
        down = pulse(0.5) if n >= 10 else 1500
        found += [servos(time, 1500, 1500, 1500, 1500, down, down)]
        found += [altitude(time + 0.03, -1.0 - 0.02 * max(n - 10, 0)), attitude(time + 0.05, 1.0)]
    return found


def test_thrusters_by_the_parameters_of_the_autopilot(tmp_path: Path) -> None:
    """Motor 6 is on servo 9 and turns in the opposite direction; the lights are on servo 6."""
    numbers = {"MOT_6_DIRECTION": -1.0, "MOT_1_DIRECTION": 1.0, "SERVO9_FUNCTION": 38}
    parameters = [parameter(name, value) for name, value in numbers.items()]
    messages = []
    for n in range(N):
        down = 0.5 * (n >= 10)
        messages += [servos(0.1 * n, 1500, 1500, 1500, 1500, pulse(down), 1100, 1500, 1500, pulse(-down))]
        messages += [altitude(0.1 * n, -0.01 * n)]
    log = read_log(write_tlog(tmp_path / "dive.tlog", [*parameters, *messages]), BLUEROV2)
    assert commanded(log.log, "6")[-1] == 0.5
    assert log.findings == [Finding("reversed motors", file="dive.tlog", names={"thrusters": "6"})]


def test_a_clock_of_servos_that_begins_anew(tmp_path: Path) -> None:
    start = 2.0**32 * 1e-6 - 3.0
    log = read_log(write_tlog(tmp_path / "dive.tlog", dive(start)), BLUEROV2).log
    assert log.commands is not None
    since = log.commands.rows - log.commands.rows[0]
    assert used(log, "depth").time[-1] - log.commands.rows[0] == pytest.approx(0.1 * (N - 1) + 0.03, abs=2e-3)
    assert since[np.flatnonzero(commanded(log, "5"))[0]] == pytest.approx(1.0, abs=2e-3)


def test_velocities_are_turned_into_the_body(tmp_path: Path) -> None:
    """The vehicle moves ahead at 0.01 n m/s over ground while it turns, with a pitch of -0.2 and a roll of 0.1 rad.

    The first nine velocities are unknown.
    """
    ahead, messages = pulse(0.4), []
    flags = [0, 253, 255, *[126] * 20]  # 2: it knows the horizontal velocity, 128: it assumes that the vehicle rests
    for n in range(N):
        psi, V = -pi / 4 + 0.01 * n, 0.01 * n
        outputs = [3000 - ahead, 3000 - ahead, ahead, ahead, 1500, 1500] if n > 5 else [1500] * 6
        local = mavlink.MAVLink_local_position_ned_message(100 * n, 0, 0, 0, V * cos(psi), V * sin(psi), 0)
        state = mavlink.MAVLink_ekf_status_report_message(flags[n // 3], 0, 0, 0, 0, 0)
        messages += [(0.1 * n - 0.01, state), servos(0.1 * n, *outputs), attitude(0.1 * n, psi), (0.1 * n, local)]
    read = read_log(write_tlog(tmp_path / "dive.tlog", messages), BLUEROV2)
    log, speed = read.log, 0.01 * np.arange(9, N)
    assert measured(log, "surge velocity") == pytest.approx(cos(-0.2) * speed, abs=1e-6)
    assert measured(log, "sway velocity") == pytest.approx(sin(0.1) * sin(-0.2) * speed, abs=1e-6)
    assert [commanded(log, thruster)[-1] for thruster in "1234"] == pytest.approx([-0.4, -0.4, 0.4, 0.4])
    assert Finding("unknown velocity", file="dive.tlog", numbers={"count": 9}) in read.findings


def test_another_vehicle_another_port_and_outputs_that_are_none(tmp_path: Path) -> None:
    path = write_tlog(tmp_path / "dive.tlog", [servos(99.0, *[0] * 5, 65535), *dive()])
    write_tlog(path, [servos(100.0 + n, *[1900] * 6) for n in range(5)], system=2)
    write_tlog(path, [servos(100.0 + n, *[1900] * 6, port=1) for n in range(5)])
    log = read_log(path, BLUEROV2)
    assert not commanded(log.log, "1").any()
    assert commanded(log.log, "5")[0] == 0.0
    names = {"vehicles": "1 and 2", "vehicle": "1"}
    assert Finding("several vehicles", file="dive.tlog", names=names) in log.findings
    assert Finding("no servo pulse", file="dive.tlog", numbers={"count": 6}) in log.findings


# ---- .bin ------------------------------------------------------------------------------------------------------------


def test_a_log_that_ends_amid_a_message_is_read_so_far(tmp_path: Path) -> None:
    path = flash(tmp_path, DIVE)
    path.write_bytes(path.read_bytes()[:-500])
    assert 90 < len(measured(read_log(path, BLUEROV2).log, "heading")) <= 100


# ---- Neither ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.bin", None, "cannot be read: Is a directory"),
        ("a.bin", b"", "the file is empty"),
        ("a.bin", b"time [s],command [%]\n" * 50, "line 1: column 'command \\[%\\]' is the command of one axis"),
        ("a.bin", b"\xa3\x95\x80" + b"\xff" * 2000, "no commands of thrusters|damaged or was cut short"),
        ("a.tlog", b"nonsense\n" * 50, "none of these headers is known"),
        (
            "a.tlog",
            bytes(range(256)) * 20,
            "its first bytes are those of none of the formats that are read",
        ),
    ],
)
def test_what_is_no_log_is_one_clear_line(
    name: str, content: bytes | None, told: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.mkdir() if content is None else path.write_bytes(content)
    with pytest.raises(DataFileError, match=told) as error:
        read_log(path, BLUEROV2)
    assert str(error.value).startswith(f"{path}")
    assert len(str(error.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


def test_without_pymavlink_the_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    path = write_tlog(tmp_path / "a.tlog", [])
    with pytest.raises(DataFileError, match=r"a telemetry log needs pymavlink: pip install 'rov-fmu\[mavlink\]'"):
        parsers.read_guarded(tmp_path, path, parsers._TELEMETRY, ())
