"""Logs of ArduSub through pymavlink: DataFlash logs of the vehicle (.bin), telemetry logs of a ground station (.tlog).

What is read, in this order; the first that has enough samples and changes is taken:

              .bin                        .tlog
    servos    RCOU                        SERVO_OUTPUT_RAW (port 0)
    depth     CTUN.Alt, BARO, XKF1, NKF1  GLOBAL_POSITION_INT.relative_alt, VFR_HUD.alt, SCALED_PRESSURE2
    heading   ATT.Yaw, XKF1, NKF1         ATTITUDE.yaw
    velocity  XKF1, NKF1                  LOCAL_POSITION_NED, both where the filter knows it (XKF4, EKF_STATUS_REPORT)

Thruster n of the vehicle is motor n of the autopilot: the servo whose SERVOx_FUNCTION says so, or else servo n. A motor
with MOT_n_DIRECTION = -1 turns the other way round.
"""

import io
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from math import isfinite, nan, radians
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.reading import read_bytes
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, YAW, Layout
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.columns import NO_OUTPUT, pulses
from rov_fmu.tank.signals import LEAST_SAMPLES, Commands, Signal

SUFFIXES = (".bin", ".tlog")
_DATAFLASH = b"\xa3\x95\x80"
"""How a DataFlash log begins: with a message that tells the format of others."""
_WRAP = 2.0**32 * 1e-6  # s, after which the clock of SERVO_OUTPUT_RAW begins anew
_WATER = 1000.0 * 9.80665  # Pa/m, fresh water
_VELOCITY_KNOWN, _STANDS_STILL = 2, 128  # flags of the filter: it knows the velocity; it assumes that nothing moves

_Samples = list[tuple[float, ...]]


def _filtered(m: Any) -> tuple[float, ...]:
    return m.PD, radians(m.Yaw), m.VN, m.VE


_NUMBERS: dict[str, Callable[[Any], tuple[float, ...]]] = {
    "SERVO_OUTPUT_RAW": lambda m: tuple(getattr(m, f"servo{n}_raw", 0) for n in range(1, 17)),
    "RCOU": lambda m: tuple(getattr(m, f"C{n}", 0) for n in range(1, 15)),
    "GLOBAL_POSITION_INT": lambda m: (-m.relative_alt / 1000.0,),
    "VFR_HUD": lambda m: (-m.alt,),
    "SCALED_PRESSURE2": lambda m: (m.press_abs * 100.0 / _WATER,),
    "CTUN": lambda m: (-m.Alt,),
    "BARO": lambda m: (-m.Alt,),
    "ATTITUDE": lambda m: (m.yaw,),
    "ATT": lambda m: (radians(m.Yaw),),
    "LOCAL_POSITION_NED": lambda m: (m.vx, m.vy),
    "XKF1": _filtered,
    "NKF1": _filtered,
    "EKF_STATUS_REPORT": lambda m: (m.flags,),
    "XKF4": lambda m: (m.SS,),
    "NKF4": lambda m: (m.SS,),
}
_PARAMETERS = {"PARAM_VALUE": ("param_id", "param_value"), "PARM": ("Name", "Value")}
# Message, and the first of its numbers that is meant.
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
_HEADINGS = (("ATTITUDE", 0), ("ATT", 0), ("XKF1", 1), ("NKF1", 1))
_VELOCITIES = (("LOCAL_POSITION_NED", 0), ("XKF1", 2), ("NKF1", 2))
_STATUS = (("EKF_STATUS_REPORT", 0), ("XKF4", 0), ("NKF4", 0))


@dataclass
class _Found:
    """What a log holds."""

    samples: defaultdict[tuple[str, int], _Samples] = field(default_factory=lambda: defaultdict(list))
    """By message, and instance of the sensor or system that sent it: time (s) and numbers."""
    parameters: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def take(self, message: Any, instance: int, time: float) -> None:
        """One message; without a number where a field is missing or none."""
        kind = message.get_type()
        if kind in _PARAMETERS:
            name, value = (getattr(message, key) for key in _PARAMETERS[kind])
            self.parameters[str(name)] = float(value)
            return
        try:
            numbers = tuple(map(float, _NUMBERS[kind](message)))
        except (AttributeError, TypeError, ValueError):  # of another version of ArduSub
            return
        if isfinite(time) and all(map(isfinite, numbers)):
            self.samples[kind, instance].append((time, *numbers))

    def series(
        self, sources: Iterable[tuple[str, int]], *, width: int = 1, varies: bool = True
    ) -> tuple[str, Array, Array] | None:
        """Message, time and numbers of the first source that is there; of several sensors, that which sees most."""
        for kind, first in sources:
            of = [np.array(rows) for (name, _), rows in sorted(self.samples.items()) if name == kind]
            if of and kind == "BARO":
                of = [max(of, key=lambda rows: float(np.ptp(rows[:, 1])))]
            for rows in of[:1]:
                rows = rows[np.argsort(rows[:, 0], kind="stable")]  # noqa: PLW2901 (the same, in order)
                time, numbers = rows[:, 0], rows[:, 1 + first : 1 + first + width]
                if not varies or (len(rows) >= LEAST_SAMPLES and np.ptp(numbers, axis=0).any()):
                    return kind, time, numbers
        return None


def read_mavlink(path: Path, layout: Layout) -> tuple[Commands, list[Signal], tuple[str, ...]]:
    """What reached the thrusters, what was measured, and what is to be told of the log. Raises DataFileError."""
    try:
        import pymavlink  # noqa: F401 (said here, before it is used)
    except ImportError:
        raise DataFileError(f"{path}: MAVLink logs need pymavlink: pip install 'rov-fmu[mavlink]'") from None
    content = read_bytes(path, DataFileError)
    if not content:
        raise DataFileError(f"{path}: the file is empty")
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):  # pymavlink prints what it trips over
            found = _read_bin(path, content[:3]) if path.suffix.lower() == ".bin" else _read_tlog(path)
    except DataFileError:
        raise
    except Exception as error:  # whatever a parser raises on bytes that are no log
        raise DataFileError(f"{path}: cannot be read as a {path.suffix} log: {type(error).__name__}") from error
    if said.getvalue():
        found.notes.append("damaged in places: what could be read is used")
    commands = _commands(path, layout, found)
    return commands, list(_signals(layout, found)), tuple(found.notes)


def _read_bin(path: Path, head: bytes) -> _Found:
    from pymavlink import DFReader

    class Reader(DFReader.DFReader_binary):  # type: ignore[misc]
        def init_clock(self) -> None:
            """Without a search through the whole log for the time of a GPS."""
            self.init_clock_usec()

        def init_arrays(self, progress_callback: Any = None) -> None:
            """As it is, and closed where that fails."""
            try:
                super().init_arrays(progress_callback)
            except Exception:
                self.close()
                raise

        init_arrays_fast = init_arrays  # the compiled one prints where no one can keep it from it

    if head != _DATAFLASH:
        raise DataFileError(f"{path}: no DataFlash log: it must begin with the bytes A3 95 80")
    found, untimed = _Found(), 0
    with closing(Reader(str(path))) as log:
        while message := log.recv_match(type=[*_NUMBERS, *_PARAMETERS]):
            stamp = getattr(message, "TimeUS", nan)
            instance = getattr(message, "I", getattr(message, "C", 0))
            untimed += message.get_type() in _NUMBERS and not isfinite(stamp)
            found.take(message, int(instance), stamp * 1e-6)
    if untimed:
        found.notes.append(f"{untimed} messages without a time left out")
    return found


def _read_tlog(path: Path) -> _Found:
    """Times of the vehicle; messages that have none get that of their arrival, less what the others take to arrive."""
    found, received, damaged = _Found(), [], 0
    delays: defaultdict[bool, list[float]] = defaultdict(list)  # by whether the clock is that of SERVO_OUTPUT_RAW
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
    delay = float(np.median(delays[False] or delays[True] or [0.0]))
    vehicle = max(systems, key=lambda system: systems[system], default=None)
    untimed = 0
    for message, stamp, at in received:
        if message.get_srcSystem() == vehicle:
            time = stamp if isfinite(stamp) else at - delay
            untimed += message.get_type() == "VFR_HUD"
            if message.get_type() == "SERVO_OUTPUT_RAW":
                time += _WRAP * round((at - delay - time) / _WRAP)
            found.take(message, 0, time)
    if damaged:
        found.notes.append(f"{damaged} damaged piece{'s' if damaged > 1 else ''} left out")
    if sum(count > 0 for count in systems.values()) > 1:
        found.notes.append(f"several vehicles in it: that of system {vehicle} is taken")
    if untimed:
        found.notes.append(
            f"{untimed} messages VFR_HUD have no time of the vehicle: that of their arrival stands for it"
        )
    return found


def _messages(path: Path) -> Iterator[Any]:
    from pymavlink import mavutil

    log = mavutil.mavlogfile(str(path))
    try:
        while message := log.recv_msg():
            yield message
    finally:
        log.close()


def _commands(path: Path, layout: Layout, found: _Found) -> Commands:
    """What reached the thrusters, by their order."""
    series = found.series(_SERVOS, width=16, varies=False)
    if not series:
        raise DataFileError(f"{path}: no outputs of servos (RCOU, SERVO_OUTPUT_RAW) in this log")
    _, time, outputs = series
    thrusters, turned, none = {}, [], 0
    for n, thruster in enumerate(layout.thrusters, start=1):
        servo = next((s for s in range(1, 17) if found.parameters.get(f"SERVO{s}_FUNCTION") == 32 + n), n)
        if servo > outputs.shape[1]:
            raise DataFileError(f"{path}: no output of thruster {thruster.name}: the log has {outputs.shape[1]} servos")
        direction = -1.0 if found.parameters.get(f"MOT_{n}_DIRECTION", 1.0) < 0.0 else 1.0
        turned += [thruster.name] if direction < 0.0 else []
        widths = outputs[:, servo - 1]
        none += int(np.isin(widths, NO_OUTPUT).sum())
        thrusters[thruster.name] = np.clip(direction * np.array(list(map(pulses(), widths.tolist()))), -1.0, 1.0)
    if none:
        found.notes.append(f"{none} pulses of 0 or 65535 us taken as no command")
    if turned:
        found.notes.append(f"MOT_n_DIRECTION turns the thrusters {', '.join(turned)}")
    elif "MOT_1_DIRECTION" not in found.parameters:
        found.notes.append("no parameters MOT_n_DIRECTION in it: every thruster is taken to push ahead above 1500 us")
    return Commands(time, thrusters)


def _signals(layout: Layout, found: _Found) -> Iterator[Signal]:
    """Depth, heading and velocities, as far as the vehicle has the axes."""
    heading = found.series(_HEADINGS, varies=False)
    if layout.has(SURGE, SWAY) and heading and (series := found.series(_VELOCITIES, width=2)):
        _, time, numbers = series
        north, east = numbers.T
        known = _is_known(found, time)
        if not known.all():
            lost = len(time) - np.count_nonzero(known)
            found.notes.append(f"{lost} velocities left out, which the filter says it does not know")
        psi = np.interp(time, heading[1], np.unwrap(heading[2][:, 0]))
        along = {SURGE: north * np.cos(psi) + east * np.sin(psi), SWAY: east * np.cos(psi) - north * np.sin(psi)}
        for axis, values in along.items():
            if layout.has(axis):
                yield Signal(axis, "velocity", time[known], values[known])
    if layout.has(HEAVE) and (series := found.series(_DEPTHS)):
        kind, time, numbers = series
        if kind == "SCALED_PRESSURE2":
            found.notes.append("depth by the pressure of fresh water, 1000 kg/m3; in the sea it is 2.5 % less")
        yield Signal(HEAVE, HEAVE.position, time, numbers[:, 0])
    if layout.has(YAW) and heading:
        yield Signal(YAW, YAW.position, heading[1], heading[2][:, 0])


def _is_known(found: _Found, time: Array) -> Flags:
    """Whether the filter knew the horizontal velocity; where the log does not tell, it did."""
    series = found.series(_STATUS, varies=False)
    if not series:
        return np.ones(len(time), bool)
    flags = series[2][np.maximum(np.searchsorted(series[1], time, side="right") - 1, 0), 0].astype(int)
    known: Flags = (flags & _VELOCITY_KNOWN > 0) & (flags & _STANDS_STILL == 0)
    return known
