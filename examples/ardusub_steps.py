"""Fly steps of depth and heading in ArduSub's simulator with several sets of gains, and draw them.

    python -m examples.ardusub_steps rov.toml ardupilot/build/sitl/bin/ardusub own.param gains-from-4.7.param

For each file of parameters, and for the firmware's own gains, `rov-fmu sitl` flies the vehicle and the program ArduSub
holds its depth. Build it by `./waf configure --board sitl && ./waf sub` in ArduPilot. pymavlink must be installed.
"""

import subprocess
import sys
from collections.abc import Iterator
from math import cos, degrees, pi, radians, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from pymavlink import mavutil

from rov_fmu.autopilot.figures import step_figures

STEPS = (
    *((size, 0.0) for size in (0.5, -0.5, 1.5)),
    *((0.0, radians(size)) for size in (4.0, 30.0, -30.0, 90.0, -90.0)),
)
"""The changes of the depth (m) and of the heading (rad)."""
SECONDS, RATE = 8.0, 25
"""The length of a step, s, and the messages in a second."""
START, DEPTH_HOLD, FORCE = 14.0, 2, 21196
"""The depth at the start, m; the number of the mode; what arms without checks."""
_ONLY_DEPTH = 0b0000110111111011
"""The bits of SET_POSITION_TARGET_GLOBAL_INT that leave out all but the altitude."""
_ONLY_ATTITUDE = 0b01000111
"""The bits of SET_ATTITUDE_TARGET that leave out rates and throttle."""
Rows = NDArray[np.float64]
MAV: Any = mavutil.mavlink


def flight(link: Any) -> Rows:
    """Fly the steps by a MAVLink connection. Return rows of time (s), depth (m), heading (rad) and both targets.

    The times are those of the vehicle, so the simulator may run faster than the clock.
    """
    link.wait_heartbeat()
    for number in (MAV.MAVLINK_MSG_ID_ATTITUDE, MAV.MAVLINK_MSG_ID_LOCAL_POSITION_NED):
        _command(link, MAV.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / RATE)
    time, depth, heading = next(_seen(link))  # ArduSub knows its position after 45 s
    link.set_mode(DEPTH_HOLD)
    _command(link, MAV.MAV_CMD_COMPONENT_ARM_DISARM, 1, FORCE)
    rows = []
    for down, turn in ((0.0, 0.0), *STEPS):
        depth, heading, end = depth + down, heading + turn, time + SECONDS
        for time, *at in _seen(link):
            rows.append((time, *at, depth, heading))
            if time >= end:
                break
            _aim(link, time, depth, heading)
    _command(link, MAV.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCE)
    return np.array(rows)


def _command(link: Any, number: int, *values: float) -> None:
    link.mav.command_long_send(
        link.target_system, link.target_component, number, 0, *values, *[0.0] * (7 - len(values))
    )


def _seen(link: Any) -> Iterator[tuple[float, float, float]]:
    """Yield the time (s), the depth (m) and the heading (rad) whenever the attitude comes."""
    depth = None
    while True:
        message = link.recv_match(type=["ATTITUDE", "LOCAL_POSITION_NED"], blocking=True, timeout=60)
        if message is None:
            raise TimeoutError("ArduSub has sent nothing for 60 s")
        if message.get_type() == "LOCAL_POSITION_NED":
            depth = message.z
        elif depth is not None:
            yield 1e-3 * message.time_boot_ms, depth, message.yaw


def _aim(link: Any, time: float, depth: float, heading: float) -> None:
    """Send both targets, which ArduSub forgets after some seconds."""
    to, stamp = (link.target_system, link.target_component), round(1e3 * time)
    frame = MAV.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    link.mav.set_position_target_global_int_send(stamp, *to, frame, _ONLY_DEPTH, 0, 0, -depth, *[0.0] * 8)
    attitude = [cos(0.5 * heading), 0.0, 0.0, sin(0.5 * heading)]
    link.mav.set_attitude_target_send(stamp, *to, _ONLY_ATTITUDE, attitude, 0.0, 0.0, 0.0, 0.0)


def flown(vehicle: str, ardusub: str, parameters: Path | None) -> Rows:
    """Return the flight of a vehicle by ArduSub with parameters, or with the gains of the firmware."""
    with TemporaryDirectory() as folder:
        own = Path(folder) / "rov.parm"
        sitl = [sys.executable, "-m", "rov_fmu", "sitl", vehicle, "--set", f"z={START}", "--parameters", str(own)]
        with subprocess.Popen(sitl) as physics:
            while not own.exists() and physics.poll() is None:
                sleep(0.1)
            files = ",".join(map(str, filter(None, [own, parameters and parameters.resolve()])))
            given = ["--model", "JSON:127.0.0.1", "--speedup", "10", "--wipe", "--defaults", files]
            with subprocess.Popen([ardusub, *given], cwd=folder) as autopilot:
                try:
                    return flight(mavutil.mavlink_connection("tcp:127.0.0.1:5760"))
                finally:
                    autopilot.terminate()
                    physics.terminate()


def figures(rows: Rows) -> Iterator[tuple[str, float, float, float]]:
    """Yield for each step what it is, the overshoot (cm, deg), when it is settled (s), and the error at rest."""
    time, depth, heading, *targets = rows.T
    begins = [0, *(np.flatnonzero(np.diff(targets[0]) + np.diff(targets[1])) + 1), len(rows)]
    for begin, end, (down, turn) in zip(begins[1:], begins[2:], STEPS, strict=False):
        part, h = slice(begin, end), (time[end - 1] - time[begin]) / (end - 1 - begin)
        if down:
            found = step_figures(100.0 * (depth - targets[0])[part, np.newaxis], down, h, 5.0)
            words = f"depth {down:+.1f} m"
        else:
            errors = (heading - targets[1] + pi) % (2.0 * pi) - pi
            found = step_figures(np.degrees(errors)[part, np.newaxis], turn, h, 2.0)
            words = f"heading {degrees(turn):+.0f} deg"
        yield words, float(found.overshoot[0]), float(found.settled[0]), float(found.rest[0])


def draw(flights: dict[str, Rows], path: Path) -> None:
    """Draw the errors of depth and heading over time, by the names of the gains."""
    figure, (above, below) = plt.subplots(2, sharex=True, layout="constrained")
    for name, rows in flights.items():
        time = rows[:, 0] - rows[0, 0]
        above.plot(time, 100.0 * (rows[:, 1] - rows[:, 3]), label=name)
        below.plot(time, np.degrees((rows[:, 2] - rows[:, 4] + pi) % (2.0 * pi) - pi), label=name)
    above.set_ylabel("depth beyond the target (cm)")
    below.set(ylabel="heading beyond the target (deg)", xlabel="time (s)")
    above.legend()
    figure.savefig(path)


def main() -> None:
    """Fly and draw; the arguments are the vehicle, the program, and files of parameters."""
    vehicle, ardusub, *files = sys.argv[1:]
    flights = {"firmware": flown(vehicle, ardusub, None)}
    flights |= {name: flown(vehicle, ardusub, Path(name)) for name in files}
    for name, rows in flights.items():
        for words, over, settled, rest in figures(rows):
            print(f"{name}: {words}: overshoot {over:.1f}, settled after {settled:.1f} s, at rest {rest:.1f}")
    draw(flights, Path("steps.png"))


if __name__ == "__main__":
    main()
