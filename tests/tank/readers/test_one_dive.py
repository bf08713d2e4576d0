"""One dive in every format gives the same log: commands as changes, and channels in SI units and the model's frames."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import Names, names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.log import Log
from rov_fmu.tank.read_log import read_logs
from tests.tank.readers import motion, test_mavlink
from tests.tank.readers.motion import BLUEROV2
from tests.tank.readers.test_bags import ENU, FLU, Ros
from tests.tank.readers.test_mavlink import BOOT, dataflash, packed, rcou
from tests.tank.readers.test_ulog import ULogWriter
from tests.tank.test_several_files import table

N = 60
TIME: Array = np.linspace(0.0, 0.1 * (N - 1), N)
THRUSTERS = [f"u_{n} [us]" for n in range(1, 7)]
MOTION = ["depth [m]", "roll [rad]", "pitch [rad]", "heading [rad]", "surge velocity [m/s]", "sway velocity [m/s]"]


@dataclass
class Dive:
    """A dive of the BlueROV2, with a row each 0.1 s."""

    start: float
    """The time since the vehicle was booted, s."""
    pulses: Array
    """N x 6, whole µs."""
    euler: Array
    """N x 3: roll, pitch and heading."""
    velocity: Array
    """N x 3: in surge, sway and heave."""
    voltage: Array
    time: Array = field(default_factory=lambda: TIME)
    """N: since the start, s."""
    noise: float | Array = 0.0
    """That of the depth, m."""

    @property
    def rotation(self) -> Array:
        """N x 3 x 3: from the body (forward, starboard, down) to north, east, down."""
        return np.asarray(Rotation.from_euler("ZYX", self.euler[:, ::-1]).as_matrix())

    @property
    def over_ground(self) -> Array:
        """N x 3: the velocity to the north, to the east and down."""
        return np.asarray(np.einsum("nij,nj->ni", self.rotation, self.velocity))

    @property
    def position(self) -> Array:
        """N x 3: north, east, down."""
        rate = self.over_ground
        steps = 0.5 * np.diff(self.time)[:, None] * (rate[1:] + rate[:-1])
        travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        travelled[:, 2] += self.noise
        return np.asarray(np.array([3.0, -2.0, 5.0]) + travelled)


@st.composite
def dives(draw: st.DrawFn) -> Dive:
    """Draw a dive: switches of the thrusters, and a motion of slow waves."""
    pulses = np.full((N, 6), 1500.0)
    change = st.tuples(st.integers(1, N - 1), st.integers(0, 5), st.integers(1100, 1900))
    for row, thruster, pulse in draw(st.lists(change, min_size=1, max_size=12)):
        pulses[row:, thruster] = pulse
    waves = []
    for largest in (0.6, 0.4, 3.0, 1.5, 0.8, 0.5):
        size, rate, phase = (draw(st.floats(low, high)) for low, high in ((0.05, 1.0), (0.2, 1.5), (0.0, 6.0)))
        waves.append(largest * size * np.sin(rate * TIME + phase))
    motion = np.column_stack(waves)
    voltage = np.round(draw(st.floats(12.0, 16.0)) - 0.01 * TIME, 3)
    return Dive(draw(st.integers(1, 4000)) * 0.5, pulses, motion[:, :3], motion[:, 3:], voltage)


# ---- The formats -----------------------------------------------------------------------------------------------------


def columns(dive: Dive) -> list[Array]:
    moved = [dive.position[:, 2], *dive.euler.T, *dive.velocity[:, :2].T, dive.voltage]
    return [dive.start + dive.time, *dive.pulses.T, *moved]


def csv(folder: Path, dive: Dive) -> Path:
    table(folder / "dive.csv", ",".join(["time [s]", *THRUSTERS, *MOTION, "voltage [V]"]), *columns(dive))
    return folder / "dive.csv"


MATLAB = {f"c{n}": title for n, title in enumerate(["time [s]", *THRUSTERS, *MOTION, "voltage [V]"])}


def mat(folder: Path, dive: Dive) -> Path:
    savemat(folder / "dive.mat", {"log": dict(zip(MATLAB, columns(dive), strict=True))})
    return folder / "dive.mat"


def _mavlink(dive: Dive) -> Iterator[tuple[float, str, dict[str, float]]]:
    """Yield the time, the name and the fields of each message."""
    for n, time in enumerate(dive.start + dive.time):
        servos = {f"servo{k}_raw": int(pulse) for k, pulse in enumerate(dive.pulses[n], start=1)}
        yield time, "SERVO_OUTPUT_RAW", {"time_usec": round(time * 1e6), "port": 0, **servos}
        boot = {"time_boot_ms": round(time * 1e3)}
        angles = dict(zip(("roll", "pitch", "yaw"), dive.euler[n].tolist(), strict=True))
        yield time, "ATTITUDE", {**boot, **angles, "rollspeed": 0.0, "pitchspeed": 0.0, "yawspeed": 0.0}
        local = [*dive.position[n].tolist(), *dive.over_ground[n].tolist()]
        yield time, "LOCAL_POSITION_NED", {**boot, **dict(zip(("x", "y", "z", "vx", "vy", "vz"), local, strict=True))}
        yield time, "SYS_STATUS", {"voltage_battery": round(1000.0 * dive.voltage[n])}


def tlog(folder: Path, dive: Dive) -> Path:
    messages = []
    for time, name, fields in _mavlink(dive):
        kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
        messages.append((time, kind(**{key: fields.get(key, 0) for key in kind.fieldnames})))
    return test_mavlink.tlog(folder / "dive.tlog", messages)


def blueos(folder: Path, dive: Dive) -> Path:
    path = folder / "blueos.mcap"
    with path.open("wb") as file:
        writer, channels = Writer(file), {}
        writer.start(profile="", library="blueos")
        for time, name, fields in _mavlink(dive):
            topic = f"mavlink/1/1/{name}"
            if topic not in channels:
                schema = writer.register_schema(topic.replace("/", "."), "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            data = json.dumps({"header": {"system_id": 1, "component_id": 1}, "message": {"type": name, **fields}})
            stamp = round((BOOT + time) * 1e9)
            writer.add_message(channels[topic], stamp, data.encode(), stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def flash(folder: Path, dive: Dive) -> Path:
    messages = []
    for n, time in enumerate(dive.start + dive.time):
        degrees, stamp = np.degrees(dive.euler[n]), round(time * 1e6)
        heading = degrees[2] % 360.0
        messages += [rcou(time, *dive.pulses[n].astype(int).tolist())]
        messages += [packed("ATT", stamp, 0.0, degrees[0], 0.0, degrees[1], 0.0, heading, 0.0, 0.0, 3)]
        filtered = [*degrees[:2], heading, *dive.over_ground[n], 0.0, *dive.position[n], 0.0, 0.0, 0.0, 0.0]
        messages += [packed("XKF1", stamp, 0, *filtered), packed("BAT", stamp, 0, dive.voltage[n])]
    return dataflash(folder / "dive.bin", messages)


def ulog(folder: Path, dive: Dive) -> Path:
    log = ULogWriter()
    for n, time in enumerate(dive.time):
        log.message("actuator_outputs", time, 6, *[0] * 4, *dive.pulses[n], *[0.0] * 10)
        log.message("vehicle_attitude", time, 0, *motion.quaternion(dive.rotation[n]))
        log.message("vehicle_local_position", time, *dive.position[n], *dive.over_ground[n], True)
        log.message("battery_status", time, dive.voltage[n])
    return log.write(folder / "dive.ulg")


def bag(version: int) -> Callable[[Path, Dive], Path]:
    def write(folder: Path, dive: Dive) -> Path:
        ros, messages = Ros(version), []
        for n, time in enumerate(dive.time):
            header, R = ros.header(time, "map"), dive.rotation[n]
            place, velocity = ENU @ dive.position[n], FLU @ dive.velocity[n]
            odometry = ros.odometry(header, place, ENU @ R @ FLU, velocity)
            pulses = dive.pulses[n].astype(np.uint16)
            outputs = ros.message("mavros_msgs/msg/RCOut", header=header, channels=pulses)
            battery = ros.message("sensor_msgs/msg/BatteryState", header=header, voltage=dive.voltage[n])
            messages += [("/odom", time, odometry), ("/rc/out", time, outputs), ("/battery", time, battery)]
        return ros.write(folder, messages, ".bag" if version == 1 else ".mcap")

    return write


FORMATS: dict[str, Callable[[Path, Dive], Path]] = {
    "CSV": csv,
    "MATLAB": mat,
    "telemetry": tlog,
    "BlueOS": blueos,
    "DataFlash": flash,
    "ULog": ulog,
    "ROS 1": bag(1),
    "ROS 2": bag(2),
}


# ---- The log ---------------------------------------------------------------------------------------------------------


def check(log: Log, dive: Dive) -> None:
    """Check the log within the resolution of the formats: 1 ms, 0.01 degrees, 1 mV, and numbers of 32 bits."""
    commands = log.commands
    assert commands is not None
    start = commands.rows[0]
    assert commands.rows - start == pytest.approx(TIME, abs=1e-3)
    assert commands.thrusters == tuple("123456")
    fractions = (dive.pulses - 1500.0) / 400.0
    row, thruster = np.nonzero(np.vstack([np.ones((1, 6), bool), np.diff(fractions, axis=0) != 0.0]))
    assert commands.thruster.tolist() == thruster.tolist()
    assert commands.time - start == pytest.approx(TIME[row], abs=1e-3)
    assert commands.since - start == pytest.approx(TIME[np.maximum(row - 1, 0)], abs=1e-3)
    assert commands.value == pytest.approx(fractions[row, thruster], abs=1e-6)
    expected = {
        "depth": (dive.position[:, 2], 1e-5),
        "roll angle": (dive.euler[:, 0], 1e-4),
        "pitch angle": (dive.euler[:, 1], 1e-4),
        "heading": (dive.euler[:, 2], 1e-4),
        "surge velocity": (dive.velocity[:, 0], 4e-4),
        "sway velocity": (dive.velocity[:, 1], 4e-4),
        "voltage": (dive.voltage, 1e-3),
    }
    for name, (values, within) in expected.items():
        channel = log.used(name)
        assert channel is not None, name
        assert channel.time - start == pytest.approx(TIME, abs=1e-3), name
        difference = channel.values - values
        if channel.quantity.wraps:
            difference = (difference + np.pi) % (2.0 * np.pi) - np.pi
        assert np.abs(difference).max() < within, name


@pytest.mark.parametrize("examples", [2, pytest.param(25, marks=pytest.mark.long)])
def test_one_dive_gives_the_same_log_in_every_format(examples: int) -> None:
    settings(max_examples=examples, suppress_health_check=[HealthCheck.too_slow])(given(dive=dives())(read_all))()


def read_all(dive: Dive) -> None:
    """Write a dive in every format, and check what is read."""
    matlab, _ = names_of(BLUEROV2, RovTables(columns={f"log.{name}": title for name, title in MATLAB.items()}))
    with TemporaryDirectory() as folder:
        for name, write in FORMATS.items():
            (log,) = read_logs(write(Path(folder), dive), BLUEROV2, matlab if name == "MATLAB" else Names())
            try:
                check(log, dive)
            except AssertionError as error:
                raise AssertionError(f"{name}: {error}") from error
