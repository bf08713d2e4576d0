"""Read logs of ArduSub with pymavlink: DataFlash logs of the vehicle (.bin), telemetry of a ground station (.tlog).

The sources of each signal. The first source that has enough samples and changes is used:

              .bin                        .tlog
    servos    RCOU                        SERVO_OUTPUT_RAW (port 0)
    depth     CTUN.Alt, BARO, XKF1, NKF1  GLOBAL_POSITION_INT.relative_alt, VFR_HUD.alt, SCALED_PRESSURE2
    heading   ATT.Yaw, XKF1, NKF1         ATTITUDE.yaw
    velocity  XKF1, NKF1                  LOCAL_POSITION_NED, both where the filter knows it (XKF4, EKF_STATUS_REPORT)
    roll      ATT.Roll, XKF1, NKF1        ATTITUDE.roll; pitch from the same message
    voltage   BAT.Volt                    SYS_STATUS.voltage_battery

Thruster n of the vehicle is motor n of the autopilot: the servo that SERVOx_FUNCTION assigns to it, or else servo n. A
motor with MOT_n_DIRECTION = -1 turns in the opposite direction.
"""

import io
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from math import isfinite, nan, radians
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.io.csv_table import NO_OUTPUT, DataFileError, pulses
from rov_fmu.io.file_kinds import DATAFLASH_SUFFIX
from rov_fmu.io.reading import read_bytes
from rov_fmu.model.layout import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.formats.content import Content, Wanted
from rov_fmu.tank.signals import LEAST_SAMPLES, Commands, Signal, unwrapped

_DATAFLASH = b"\xa3\x95\x80"
"""The first bytes of a DataFlash log."""
_WRAP = 2.0**32 * 1e-6
"""The time after which the clock of SERVO_OUTPUT_RAW restarts at 0, s."""
_PRESSURE_GRADIENT = 1000.0 * 9.80665
"""The pressure gradient in fresh water, Pa/m."""
_NO_VOLTAGE = 65535
"""The voltage in SYS_STATUS that stands for none, mV."""
_VELOCITY_KNOWN, _CONSTANT_POSITION = 2, 128
"""Flags of the filter: it knows the horizontal velocity; it assumes that the vehicle does not move."""

_Samples = list[tuple[float, ...]]


def _filtered(m: Any) -> tuple[float, ...]:
    return m.PD, radians(m.Roll), radians(m.Pitch), radians(m.Yaw), m.VN, m.VE


_NUMBERS: dict[str, Callable[[Any], tuple[float, ...]]] = {
    "SERVO_OUTPUT_RAW": lambda m: tuple(getattr(m, f"servo{n}_raw", 0) for n in range(1, 17)),
    "RCOU": lambda m: tuple(getattr(m, f"C{n}", 0) for n in range(1, 15)),
    "GLOBAL_POSITION_INT": lambda m: (-m.relative_alt / 1000.0,),
    "VFR_HUD": lambda m: (-m.alt,),
    "SCALED_PRESSURE2": lambda m: (m.press_abs * 100.0 / _PRESSURE_GRADIENT,),
    "CTUN": lambda m: (-m.Alt,),
    "BARO": lambda m: (-m.Alt,),
    "ATTITUDE": lambda m: (m.roll, m.pitch, m.yaw),
    "ATT": lambda m: (radians(m.Roll), radians(m.Pitch), radians(m.Yaw)),
    "LOCAL_POSITION_NED": lambda m: (m.vx, m.vy),
    "XKF1": _filtered,
    "NKF1": _filtered,
    "EKF_STATUS_REPORT": lambda m: (m.flags,),
    "SYS_STATUS": lambda m: (m.voltage_battery / 1000.0 if m.voltage_battery != _NO_VOLTAGE else nan,),
    "BAT": lambda m: (m.Volt,),
    "XKF4": lambda m: (m.SS,),
    "NKF4": lambda m: (m.SS,),
}
_INSTANCES = ("I", "Inst", "Instance", "C")
"""The fields with the number of the sensor, of the battery or of the filter's core."""
_PARAMETERS = {"PARAM_VALUE": ("param_id", "param_value"), "PARM": ("Name", "Value")}
# Each source is a message and the index of the first number used.
_SERVOS = (("SERVO_OUTPUT_RAW", 0), ("RCOU", 0))
_DEPTHS = (
    ("GLOBAL_POSITION_INT", 0),
    ("VFR_HUD", 0),
    ("SCALED_PRESSURE2", 0),
    ("CTUN", 0),
    ("BARO", 0),
    ("XKF1", 0),
    ("NKF1", 0),
)
_ATTITUDES = (("ATTITUDE", 0), ("ATT", 0), ("XKF1", 1), ("NKF1", 1))
"""Roll, pitch and heading."""
_VELOCITIES = (("LOCAL_POSITION_NED", 0), ("XKF1", 4), ("NKF1", 4))
_VOLTAGES = (("SYS_STATUS", 0), ("BAT", 0))
_STATUS = (("EKF_STATUS_REPORT", 0), ("XKF4", 0), ("NKF4", 0))


@dataclass
class _Messages:
    """The messages of a log that are used."""

    file: str
    samples: defaultdict[tuple[str, int], _Samples] = field(default_factory=lambda: defaultdict(list))
    """Time (s) and numbers, by message and by instance of the sensor or system that sent it."""
    parameters: dict[str, float] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    """The number of messages of each kind that is not used."""

    def add_finding(self, kind: str, names: dict[str, str] | None = None, **numbers: float) -> None:
        """Add a finding about this log."""
        self.findings.append(Finding(kind, file=self.file, names=names or {}, numbers=numbers))

    def add(self, message: Any, instance: int, time: float) -> None:
        """Add one message, unless a field is missing or not a number."""
        kind = message.get_type()
        if kind in _PARAMETERS:
            name, value = (getattr(message, key) for key in _PARAMETERS[kind])
            self.parameters[str(name)] = float(value)
            return
        try:
            numbers = tuple(map(float, _NUMBERS[kind](message)))
        except (AttributeError, TypeError, ValueError):  # from another version of ArduSub
            return
        if isfinite(time) and all(map(isfinite, numbers)):
            self.samples[kind, instance].append((time, *numbers))

    def series(
        self, sources: Iterable[tuple[str, int]], *, width: int = 1, varies: bool = True
    ) -> tuple[str, Array, Array] | None:
        """Return message, time and numbers of the first source in the log; of several barometers, the one whose values
        vary most."""
        for kind, first in sources:
            instances = [np.array(rows) for (name, _), rows in sorted(self.samples.items()) if name == kind]
            if not instances:
                continue
            rows = max(instances, key=lambda rows: float(np.ptp(rows[:, 1]))) if kind == "BARO" else instances[0]
            rows = rows[np.argsort(rows[:, 0], kind="stable")]
            time, numbers = rows[:, 0], rows[:, 1 + first : 1 + first + width]
            if not varies or (len(rows) >= LEAST_SAMPLES and np.ptp(numbers, axis=0).any()):
                return kind, time, numbers
        return None


def read_mavlink(path: Path, wanted: Wanted) -> Content:
    """Read the commands of the thrusters and the signals. Findings about the log are in the result. Raises
    DataFileError."""
    try:
        import pymavlink  # noqa: F401 (to give a clear message)
    except ImportError:
        raise DataFileError(f"{path}: MAVLink logs need pymavlink: pip install 'rov-fmu[mavlink]'") from None
    content = read_bytes(path, DataFileError)
    if not content:
        raise DataFileError(f"{path}: the file is empty")
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):  # pymavlink prints about damage
            is_dataflash = path.suffix.lower() == DATAFLASH_SUFFIX
            log = _read_dataflash(path, content[:3]) if is_dataflash else _read_telemetry(path)
    except DataFileError:
        raise
    except Exception as error:  # a parser may raise anything on bytes that are not a log
        raise DataFileError(f"{path}: cannot be read as a {path.suffix} log: {type(error).__name__}") from error
    if printed.getvalue():
        log.add_finding("damaged log")
    commands = _commands(path, wanted, log)
    unread = {kind: f"{count} messages" for kind, count in log.others.items()}
    return Content(path.name, commands, list(_signals(log)), log.findings, unread)


def _read_dataflash(path: Path, head: bytes) -> _Messages:
    from pymavlink import DFReader

    class Reader(DFReader.DFReader_binary):  # type: ignore[misc]
        def init_clock(self) -> None:
            """Use the time since boot, without a search through the whole log for the time of a GPS."""
            self.init_clock_usec()

        def init_arrays(self, progress_callback: Any = None) -> None:
            """Close the file where the base class fails."""
            try:
                super().init_arrays(progress_callback)
            except Exception:
                self.close()
                raise

        init_arrays_fast = init_arrays  # the output of the compiled one cannot be redirected

    if head != _DATAFLASH:
        raise DataFileError(f"{path}: is not a DataFlash log, which begins with the bytes A3 95 80")
    log, untimed = _Messages(path.name), 0
    with closing(Reader(str(path))) as reader:
        while message := reader.recv_match(type=[*_NUMBERS, *_PARAMETERS]):
            stamp = getattr(message, "TimeUS", nan)
            instance = next((getattr(message, key) for key in _INSTANCES if hasattr(message, key)), 0)
            untimed += message.get_type() in _NUMBERS and not isfinite(stamp)
            log.add(message, int(instance), stamp * 1e-6)
        for kind, name in reader.id_to_name.items():
            if name not in (*_NUMBERS, *_PARAMETERS) and reader.counts[kind]:
                log.others[name] = reader.counts[kind]
    if untimed:
        log.add_finding("messages without time", count=untimed)
    return log


def _read_telemetry(path: Path) -> _Messages:
    """Read a log of a ground station, with times of the vehicle.

    A message without a time gets the time of its arrival, less the usual delay of the other messages.
    """
    log, received, damaged = _Messages(path.name), [], 0
    delays: defaultdict[bool, list[float]] = defaultdict(list)  # by the clock: True for that of SERVO_OUTPUT_RAW
    systems: Counter[int] = Counter()
    for message in _messages(path):
        kind, at = message.get_type(), float(message._timestamp)
        damaged += kind == "BAD_DATA"
        if kind in (*_NUMBERS, *_PARAMETERS) and getattr(message, "port", 0) == 0:
            is_servo = kind == "SERVO_OUTPUT_RAW"
            stamp = message.time_usec * 1e-6 if is_servo else getattr(message, "time_boot_ms", nan) * 1e-3
            received.append((message, stamp, at))
            systems[message.get_srcSystem()] += is_servo
            delays[is_servo] += [at - stamp] if isfinite(stamp) else []
        else:
            log.others[kind] += kind != "BAD_DATA"
    delay = float(np.median(delays[False] or delays[True] or [0.0]))
    vehicle = max(systems, key=lambda system: systems[system], default=None)
    untimed = 0
    for message, stamp, at in received:
        if message.get_srcSystem() == vehicle:
            time = stamp if isfinite(stamp) else at - delay
            untimed += message.get_type() == "VFR_HUD"
            if message.get_type() == "SERVO_OUTPUT_RAW":
                time += _WRAP * round((at - delay - time) / _WRAP)
            log.add(message, 0, time)
    if damaged:
        log.add_finding("damaged pieces", count=damaged)
    if sum(count > 0 for count in systems.values()) > 1:
        log.add_finding("several vehicles", {"system": str(vehicle)})
    if untimed:
        log.add_finding("arrival time", count=untimed)
    return log


def _messages(path: Path) -> Iterator[Any]:
    from pymavlink import mavutil

    log = mavutil.mavlogfile(str(path))
    try:
        while message := log.recv_msg():
            yield message
    finally:
        log.close()


def _commands(path: Path, wanted: Wanted, log: _Messages) -> Commands:
    """Return the commands of the thrusters. Raises DataFileError."""
    series = log.series(_SERVOS, width=16, varies=False)
    if not series:
        raise DataFileError(f"{path}: no outputs of servos (RCOU, SERVO_OUTPUT_RAW) in this log")
    _, time, outputs = series
    thrusters, reversed_motors, without_pulse = {}, [], 0
    names = wanted.thrusters or [str(n) for n in range(1, _motors(log, outputs) + 1)]
    for n, name in enumerate(names, start=1):
        servo = next((s for s in range(1, 17) if log.parameters.get(f"SERVO{s}_FUNCTION") == 32 + n), n)
        if servo > outputs.shape[1]:
            raise DataFileError(f"{path}: no output of thruster {name}: the log has {outputs.shape[1]} servos")
        direction = -1.0 if log.parameters.get(f"MOT_{n}_DIRECTION", 1.0) < 0.0 else 1.0
        if direction < 0.0:
            reversed_motors.append(name)
        widths = outputs[:, servo - 1]
        without_pulse += int(np.isin(widths, NO_OUTPUT).sum())
        thrusters[name] = np.clip(direction * np.array(list(map(pulses(), widths.tolist()))), -1.0, 1.0)
    if without_pulse:
        log.add_finding("no servo pulse", count=without_pulse)
    if reversed_motors:
        log.add_finding("reversed motors", {"thrusters": ", ".join(reversed_motors)})
    elif "MOT_1_DIRECTION" not in log.parameters:
        log.add_finding("unknown direction")
    return Commands(time, thrusters)


def _motors(log: _Messages, outputs: Array) -> int:
    """Return the number of motors: from the functions of the servos, or else the number of consecutive servos with
    pulses."""
    functions = [value for name, value in log.parameters.items() if re.fullmatch(r"SERVO\d+_FUNCTION", name)]
    motors = [int(value) - 32 for value in functions if 33 <= value <= 40]
    return max(motors, default=int(np.argmax(np.append(np.isin(outputs, NO_OUTPUT).all(axis=0), True))))


def _signals(log: _Messages) -> Iterator[Signal]:
    """Yield velocities, depth, the angles of the attitude, and the voltage of the battery."""
    attitude = log.series(_ATTITUDES, width=3, varies=False)
    if attitude and (series := log.series(_VELOCITIES, width=2)):
        _, time, numbers = series
        north, east = numbers.T
        known = _is_known(log, time)
        if not known.all():
            log.add_finding("unknown velocity", count=int((~known).sum()))
        psi = np.interp(time, attitude[1], unwrapped(attitude[1], attitude[2][:, 2]))
        along = {SURGE: north * np.cos(psi) + east * np.sin(psi), SWAY: east * np.cos(psi) - north * np.sin(psi)}
        for axis, values in along.items():
            yield Signal(axis, "velocity", time[known], values[known])
    if series := log.series(_DEPTHS):
        kind, time, numbers = series
        if kind == "SCALED_PRESSURE2":
            log.add_finding("depth by pressure")
        yield Signal(HEAVE, HEAVE.position, time, numbers[:, 0])
    if attitude:
        for axis, values in zip((ROLL, PITCH, YAW), attitude[2].T, strict=True):
            yield Signal(axis, axis.position, attitude[1], values)
    if series := log.series(_VOLTAGES, varies=False):
        _, time, numbers = series
        yield Signal(None, "voltage", time, numbers[:, 0])


def _is_known(log: _Messages, time: Array) -> Flags:
    """Return True at each time when the filter knew the horizontal velocity; without a status, it always did."""
    series = log.series(_STATUS, varies=False)
    if not series:
        return np.ones(len(time), bool)
    flags = series[2][np.maximum(np.searchsorted(series[1], time, side="right") - 1, 0), 0].astype(int)
    known: Flags = (flags & _VELOCITY_KNOWN > 0) & (flags & _CONSTANT_POSITION == 0)
    return known
