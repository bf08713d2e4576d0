"""A stand-in for ArduSub: its side of the JSON interface, its motor matrix, and depth and heading hold.

It follows ArduPilot's sources and imports nothing of the package. `libraries/SITL/SIM_JSON.cpp`: packets, the parser of
replies, the repetition of a packet without a reply, and the clock. `AP_Motors6DOF.cpp`: the factors of the frames.
`AC_AttitudeControl_Sub.h` and `AC_PosControl.cpp`: the default gains. What it leaves out: sensors with noise, the
filter that estimates the state, and the shaping of inputs.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, sin
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
KEYS |= {"voltage": 1}
_OPTIONAL = {"rng_1", "voltage"}


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


class Pid:
    """A controller with a limited integrator, as AC_PID without its filters."""

    def __init__(self, p: float, i: float, d: float, most: float) -> None:
        self.p, self.i, self.d, self.most = p, i, d, most
        self.integral = 0.0
        self.last: float | None = None

    def __call__(self, error: float, dt: float) -> float:
        self.integral = max(-self.most, min(self.most, self.integral + self.i * error * dt))
        slope = 0.0 if self.last is None or dt <= 0.0 else (error - self.last) / dt
        self.last = error
        return self.p * error + self.integral + self.d * slope


@dataclass
class ArduSub:
    """Depth hold and heading hold with ArduSub's default gains."""

    port: int
    rate: int = 400
    depth: float = 1.0
    """The depth to hold, m."""
    heading: float = 0.0
    """The heading to hold, rad."""
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
        self.roll, self.pitch = Pid(0.135, 0.09, 0.0036, 0.444), Pid(0.135, 0.09, 0.0036, 0.444)
        self.yaw = Pid(0.18, 0.018, 0.0, 0.222)
        self.climb = Pid(0.5, 0.1, 0.0, 100.0)  # of accelerations in cm/s2; 1000 is full throttle

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
        wanted = (-6.0 * phi, -6.0 * theta, 6.0 * error)  # the rate of each angle by ATC_ANG_*_P
        roll, pitch, yaw = (
            pid(target - rate, dt)
            for pid, target, rate in zip((self.roll, self.pitch, self.yaw), wanted, gyro, strict=True)
        )
        up, down = -self.at["position"][2], self.at["velocity"][2]
        speed = 3.0 * 100.0 * (-self.depth - up)  # PSC_POSZ_P, cm/s
        speed = max(-50.0, min(50.0, speed))
        acceleration = 8.0 * (speed + 100.0 * down)  # PSC_VELZ_P, cm/s2
        ax, ay, az = self.at["accel_body"]
        measured = -100.0 * (-sin(theta) * ax + sin(phi) * cos(theta) * ay + cos(phi) * cos(theta) * az + 9.80665)
        throttle = max(-1.0, min(1.0, 2e-3 * self.climb(acceleration - measured, dt)))
        forward, lateral = self.sticks(self.time)
        turns = [roll * f[0] + pitch * f[1] + throttle * f[3] for f in VECTORED_6DOF]
        moves = [yaw * f[2] + forward * f[4] + lateral * f[5] for f in VECTORED_6DOF]
        most_turn, most_move = max(1.0, *map(abs, turns)), max(1.0, *map(abs, moves))
        for n, (turn, move) in enumerate(zip(turns, moves, strict=True)):
            out = max(-1.0, min(1.0, turn / most_turn + move / most_move))
            found[n] = int(1500 + 400 * out)
        return found
