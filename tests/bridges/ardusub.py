"""A stand-in for ArduSub: its side of the JSON interface, its motor matrix, and its depth, heading and position hold.

It follows ArduPilot's sources and imports nothing of the package. `libraries/SITL/SIM_JSON.cpp`: packets, the parser of
replies, the repetition of a packet without a reply, and the clock. `AP_Motors6DOF.cpp`: the factors of the frames, and
the mixing. `AC_AttitudeControl_Sub.h`, `AC_PosControl.cpp` and `AC_PID.cpp`: the cascades, their default gains, filters
and limits. What it leaves out: sensors with noise, the filter that estimates the state, and the shaping of targets.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan, copysign, cos, pi, radians, sin, sqrt
from socket import AF_INET, SOCK_DGRAM, socket

VECTORED_6DOF = (
    (0, 0, 1, 0, -1, 1),
    (0, 0, -1, 0, -1, -1),
    (0, 0, -1, 0, 1, 1),
    (0, 0, 1, 0, 1, -1),
    (1, -1, 0, -1, 0, 0),
    (-1, -1, 0, -1, 0, 0),
    (1, 1, 0, -1, 0, 0),
    (-1, 1, 0, -1, 0, 0),
)
"""Roll, pitch, yaw, throttle, forward and lateral factor of each motor."""
KEYS = {"gyro": 3, "accel_body": 3, "position": 3, "attitude": 3, "velocity": 3, "timestamp": 1, "rng_1": 1}
KEYS |= {"voltage": 1, "current": 1}
_OPTIONAL = {"rng_1", "voltage", "current"}


def packet(rate: int, count: int, pulses: list[int]) -> bytes:
    """The bytes of a servo packet, as the compiler lays out the struct on a little-endian machine."""
    magic = {16: 18458, 32: 29569}[len(pulses)]
    return struct.pack(f"<HHI{len(pulses)}H", magic, rate, count, *pulses)


def parsed(text: bytes) -> dict[str, list[float]]:
    """The numbers of a reply, found as ArduPilot finds them: by the first occurrence of each key.

    Old versions read vectors with sscanf("[%f, %f, %f]"), which allows no blank before the bracket.
    """
    assert text[:1] == b"\n" == text[-1:], "a line break before and after"
    assert text.count(b"\n") == 2
    line, found = text[1:-1].decode("ascii"), {}
    assert len(text) < 65000
    for key, count in KEYS.items():
        place = line.find(key, 1)
        if place < 0:
            assert key in _OPTIONAL, f"mandatory: {key}"
            continue
        rest = line[place + len(key) + 2 :]
        if count == 1:
            found[key] = [_atof(rest)]
        else:
            assert rest[0] == "["
            found[key] = [_atof(number) for number in rest[1 : rest.index("]")].split(",")]
            assert len(found[key]) == count
    return found


def _atof(text: str) -> float:
    """What C's atof reads."""
    end = 0
    while end < len(text) and text[end] in "+-.0123456789eE":
        end += 1
    return float(text[:end])


def part_of(frequency: float, dt: float) -> float:
    """The part of a change that passes ArduPilot's low-pass filter of first order in a step."""
    return dt / (dt + 0.5 / pi / frequency) if frequency else 1.0


def sqrt_controller(error: float, p: float, most: float) -> float:
    """The rate that removes an error: proportional at first, then such that the deceleration is at most `most`."""
    linear = most / p**2
    return p * error if abs(error) <= linear else copysign(sqrt(2.0 * most * (abs(error) - 0.5 * linear)), error)


@dataclass
class Pid:
    """AC_PID: the filters of target, error and derivative (Hz, 0 for none), and the limit of the integrator."""

    p: float
    i: float
    d: float
    most: float
    target_filter: float = 0.0
    error_filter: float = 0.0
    slope_filter: float = 0.0
    integral: float = 0.0
    slope: float = 0.0
    _last: tuple[float, float] | None = None
    """The filtered target and error of the last step."""

    def __call__(self, target: float, measured: float, dt: float) -> float:
        if self._last is None:
            self._last = target, target - measured
        wanted, before = self._last
        wanted += part_of(self.target_filter, dt) * (target - wanted)
        error = before + part_of(self.error_filter, dt) * (wanted - measured - before)
        self.slope += part_of(self.slope_filter, dt) * ((error - before) / dt - self.slope)
        self.integral = max(-self.most, min(self.most, self.integral + self.i * error * dt))
        self._last = wanted, error
        return self.p * error + self.integral + self.d * self.slope


@dataclass
class ArduSub:
    """ArduSub's depth hold, or its position hold if `place` is given, with the default gains."""

    port: int
    rate: int = 400
    depth: float = 1.0
    """The depth to hold, m."""
    heading: float = 0.0
    """The heading to hold, rad."""
    place: tuple[float, float] | None = None
    """The position to hold, north and east, m."""
    sticks: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0)
    """Forward and lateral from -1 to 1 over time."""
    timeout: float = 1.0
    """The time after which a packet without a reply is sent again, s."""
    channels: int = 16
    loses: Callable[[], bool] = lambda: False
    repeats: Callable[[], bool] = lambda: False
    """Whether the network loses or doubles the next packet, in either direction."""
    count: int = 0
    time: float = 0.0
    """The time that has passed by the time stamps of the replies, s."""
    last: float = 0.0
    resent: int = 0
    history: list[dict[str, list[float]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.socket = socket(AF_INET, SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", self.port))
        self.socket.settimeout(self.timeout)
        self.at: dict[str, list[float]] = {}
        self.roll, self.pitch = (Pid(0.135, 0.09, 0.0036, 0.444, 30.0, 0.0, 30.0) for _ in range(2))
        self.yaw = Pid(0.18, 0.018, 0.0, 0.222, 5.0, 0.0, 5.0)
        self.climb = Pid(8.0, 0.0, 0.0, 1000.0, error_filter=5.0)  # from cm/s to cm/s2
        self.rise = Pid(0.5, 0.1, 0.0, 100.0, error_filter=20.0)  # from cm/s2; 1000 is full throttle
        self.north, self.east = (Pid(1.0, 0.5, 0.0, 10.0, error_filter=5.0) for _ in range(2))  # from m/s to m/s2
        self.throttle = 0.0

    def close(self) -> None:
        self.socket.close()

    def fly(self, seconds: float) -> None:
        """Fly frame by frame, in lockstep."""
        end = self.time + seconds
        while self.time < end - 0.5 / self.rate:
            self.frame()

    def frame(self) -> None:
        """Send the servos and wait for the motion."""
        self.exchange(packet(self.rate, self.count, self.pulses()))

    def exchange(self, sent: bytes) -> None:
        """Send a packet until a reply comes, and take over the motion and the time of the reply."""
        self._send(sent)
        while True:
            try:
                text = self.socket.recv(65000)
            except TimeoutError:
                self.resent += 1
                self._send(sent)
                continue
            if not self.loses():
                break
        self.at = parsed(text)
        (stamp,) = self.at["timestamp"]
        self.time += max(stamp - self.last, 0.0)
        self.last = stamp
        self.count += 1
        self.history.append(self.at)

    def _send(self, data: bytes) -> None:
        for _ in range(2 if self.repeats() else 1):
            if not self.loses():
                self.socket.send(data)

    def pulses(self) -> list[int]:
        """The outputs of the motors, µs."""
        found = [1500] * 8 + [0] * (self.channels - 8)
        if not self.at:
            return found
        dt = 1.0 / self.rate
        (phi, theta, psi), gyro = self.at["attitude"], self.at["gyro"]
        error = (self.heading - psi + pi) % (2 * pi) - pi
        most = radians(120.0)  # AC_ATTITUDE_ACCEL_Y_CONTROLLER_MAX_RADSS, which also limits the error
        yaw_rate = sqrt_controller(max(-most / 6.0, min(most / 6.0, error)), 6.0, most)
        wanted = (-6.0 * phi, -6.0 * theta, yaw_rate)  # the rates by ATC_ANG_*_P
        roll, pitch, yaw = (
            pid(target, rate, dt)
            for pid, target, rate in zip((self.roll, self.pitch, self.yaw), wanted, gyro, strict=True)
        )
        throttle = self._throttle(dt)
        forward, lateral = self.sticks(self.time) if self.place is None else self._to_place(self.place, dt)
        turns = [roll * f[0] + pitch * f[1] + throttle * f[3] for f in VECTORED_6DOF]
        moves = [yaw * f[2] + forward * f[4] + lateral * f[5] for f in VECTORED_6DOF]
        most_turn, most_move = max(1.0, *map(abs, turns)), max(1.0, *map(abs, moves))
        for n, (turn, move) in enumerate(zip(turns, moves, strict=True)):
            out = max(-1.0, min(1.0, turn / most_turn + move / most_move))
            found[n] = int(1500 + 400 * out)
        return found

    def _throttle(self, dt: float) -> float:
        """The throttle from -1 to 1: PSC_POSZ_P = 3, PILOT_ACCEL_Z = 100 cm/s2, and a filter of 2 Hz."""
        (phi, theta, _), (ax, ay, az) = self.at["attitude"], self.at["accel_body"]
        depth, down = self.at["position"][2], self.at["velocity"][2]
        acceleration = self.climb(sqrt_controller(100.0 * (depth - self.depth), 3.0, 100.0), -100.0 * down, dt)
        measured = -100.0 * (-sin(theta) * ax + sin(phi) * cos(theta) * ay + cos(phi) * cos(theta) * az + 9.80665)
        asked = max(-1.0, min(1.0, 2e-3 * self.rise(acceleration, measured, dt)))
        self.throttle += part_of(2.0, dt) * (asked - self.throttle)
        return self.throttle

    def _to_place(self, place: tuple[float, float], dt: float) -> tuple[float, float]:
        """Forward and lateral from -1 to 1, as lean angles of a copter over 45 degrees: PSC_POSXY_P = 1."""
        psi, (north, east, _), (v_north, v_east, _) = self.at["attitude"][2], self.at["position"], self.at["velocity"]
        a_north = self.north(place[0] - north, v_north, dt)
        a_east = self.east(place[1] - east, v_east, dt)
        ahead, right = cos(psi) * a_north + sin(psi) * a_east, cos(psi) * a_east - sin(psi) * a_north
        forward, lateral = (max(-1.0, min(1.0, atan(a / 9.80665) / radians(45.0))) for a in (ahead, right))
        return forward, lateral
