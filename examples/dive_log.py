"""A dive log of a BlueROV2 to try `rov-fmu identify` on, as QGroundControl saves it (.tlog), made by a simulated dive.

No vehicle was in the water. It is the BlueROV2 that ships, with thrusters that follow their commands 0.15 s late and
2 N of buoyancy, in a current, flown by hand: surge, sway, heave and yaw at once, and coupled. The integrator is SciPy's
DOP853. Logged are what ArduSub sends: the outputs to the six thrusters, attitude, depth, and the velocity of a DVL.
"""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import click
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rov_fmu.io.output import Output, write_whole
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.references.pool import Array, stick, swim

LAG = 0.15
"""The time constant of the thrusters (s)."""
CURRENT = (0.06, -0.03)
"""The current north and east (m/s)."""
DEPTH = 8.0
"""The depth at the start of the dive (m)."""
_RATE = 20  # Hz, of the attitude; commands, depth and velocity have half of it
_BEGUN = 1_700_000_000.0  # s since 1970, of the first message
_NEUTRAL, _SPAN = 1500, 400  # us, of a thruster's signal
_NOISE = {"z": 0.005, "psi": radians(0.3), "u": 0.01, "v": 0.01, "w": 0.01}
# ArduSub's frame `vectored`: what forward, lateral, down and yaw to starboard add to the output of each thruster.
_FRAME = {
    "1": (-1.0, 1.0, 0.0, 1.0),
    "2": (-1.0, -1.0, 0.0, -1.0),
    "3": (1.0, 1.0, 0.0, -1.0),
    "4": (1.0, -1.0, 0.0, 1.0),
    "5": (0.0, 0.0, 1.0, 0.0),
    "6": (0.0, 0.0, 1.0, 0.0),
}
_STICKS = ((0.4, 0.4, 4.0), (0.3, 0.3, 4.0), (0.55, 0.4, 5.0), (0.18, 0.18, 3.0))
"""Forward, lateral, down, yaw: the most to either side, and for how long about it stays (s). Buoyancy helps upwards."""


@dataclass(frozen=True, eq=False)
class Dive:
    """n samples in SI units, without noise. The commands are quantized like the outputs of the autopilot."""

    time: Array
    outputs: Mapping[str, Array]
    """The pulse width (us) by thruster."""
    motion: Mapping[str, Array]
    """u, v, w, r through the water, and x, y, z, psi."""

    @property
    def over_ground(self) -> Array:
        """Return the velocity north, east and down, n x 3."""
        u, v, w, psi = (self.motion[name] for name in ("u", "v", "w", "psi"))
        c, s = np.cos(psi), np.sin(psi)
        return np.column_stack([c * u - s * v + CURRENT[0], s * u + c * v + CURRENT[1], w])


def bluerov2() -> Vehicle:
    """Return the simulated vehicle."""
    k = load_vehicle(SHIPPED["bluerov2"])
    return k.with_(T_t200=LAG)


def dive(seconds: float = 90.0, seed: int = 0) -> Dive:
    """A dive by hand: each stick stays for a few seconds and then moves elsewhere, often back to the middle."""
    random = np.random.default_rng(seed)
    time = np.arange(round(seconds * _RATE)) / _RATE
    sticks = np.array(  # which move when the outputs are logged
        [stick(random, len(time), most, _RATE * hold, every=2) for *most, hold in _STICKS]
    )
    sticks[:, time < 3.0] = 0.0
    outputs = {
        name: np.rint(_NEUTRAL + _SPAN * np.clip(np.array(factors) @ sticks, -1.0, 1.0))
        for name, factors in _FRAME.items()
    }
    commands = {name: (output - _NEUTRAL) / _SPAN for name, output in outputs.items()}
    motion = swim(bluerov2(), time, commands, current=CURRENT)
    return Dive(time, outputs, motion | {"z": motion["z"] + DEPTH})


def write_log(path: Path, dived: Dive, seed: int = 0, *, force: bool = False, dvl: bool = True) -> None:
    """Write the messages, each after the time at which it arrived; without `dvl` those that most vehicles have."""
    packer, random = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), np.random.default_rng(seed)
    packed = (
        struct.pack(">Q", round(1e6 * (_BEGUN + time))) + message.pack(packer)
        for time, message in _messages(dived, random)
        if dvl or message.get_type() != "LOCAL_POSITION_NED"
    )
    write_whole(Output(path, b"".join(packed)), force=force)


def _messages(dived: Dive, random: np.random.Generator) -> Iterator[tuple[float, Any]]:
    """Yield all messages in their order, with the noise of the sensors."""
    n = len(dived.time)
    noise = {name: spread * random.standard_normal(n) for name, spread in _NOISE.items()}
    heading = (dived.motion["psi"] + noise["psi"] + np.pi) % (2.0 * np.pi) - np.pi
    turning = dived.motion["r"]
    depth = dived.motion["z"] + noise["z"]
    velocity = dived.over_ground + np.column_stack([noise[name] for name in "uvw"])
    speed, course = np.hypot(velocity[:, 0], velocity[:, 1]), np.rint(np.degrees(heading)).astype(int) % 360
    where = np.column_stack([dived.motion[name] for name in "xyz"])
    outputs = np.column_stack(list(dived.outputs.values())).astype(int).tolist()
    armed = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    for i, t in enumerate(dived.time.tolist()):
        ms = round(1000.0 * t)
        if i % _RATE == 0:
            yield (
                t,
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_SUBMARINE,
                    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
                    armed,
                    19,
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                ),
            )
        if i % 2 == 0:
            yield t, mavlink.MAVLink_servo_output_raw_message(1000 * ms, 0, *outputs[i], 0, 0)
            yield t, mavlink.MAVLink_vfr_hud_message(0.0, speed[i], course[i], 0, -depth[i], -velocity[i, 2])
            yield t, mavlink.MAVLink_local_position_ned_message(ms, *where[i].tolist(), *velocity[i].tolist())
        yield t, mavlink.MAVLink_attitude_message(ms, 0.0, 0.0, heading[i], 0.0, 0.0, turning[i])


@click.command(help=__doc__)
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@click.option(
    "--force", is_flag=True, help="Replace a file that this example did not write, or that has changed since."
)
@click.option("--no-dvl", "dvl", is_flag=True, default=True, flag_value=False, help="Log no velocity.")
def main(file: Path, *, force: bool, dvl: bool) -> None:
    """Write the log."""
    write_log(file, dive(), force=force, dvl=dvl)


if __name__ == "__main__":
    main()
