"""A stand-in for ArduSub: its side of the JSON interface, and its depth, heading and position hold.

It follows ArduPilot's sources. `libraries/SITL/SIM_JSON.cpp`: packets, the parser of replies, the repetition of a
packet without a reply, and the clock. The law of depth and heading is that of
`verification/references/autopilot/ardusub.py`.
"""

import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from math import cos, sin
from socket import AF_INET, SOCK_DGRAM, socket

from verification.references.autopilot.ardusub import Hold, Motion

KEYS = {"gyro": 3, "accel_body": 3, "position": 3, "attitude": 3, "velocity": 3, "timestamp": 1, "rng_1": 1}
KEYS |= {"voltage": 1, "current": 1}
_OPTIONAL = {"rng_1", "voltage", "current"}
START = 1.8
"""The time during which ArduSub 4.7 starts, s."""


def started(time: float, pulses: list[int], channels: int = 16, start: float = START) -> list[int]:
    """What ArduSub sends: 1500 us to servos 1 to 8 while it starts, and then nothing to servos without a function."""
    sent = [1500] * 8 if time < start else pulses
    return [*sent, *[0] * (channels - len(sent))]


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


@dataclass
class ArduSub:
    """ArduSub's depth hold, with the default gains unless `hold` has others. The pulses of the motors are in `sent`."""

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
    start: float = START
    """The time during which it starts, s; 0 for one that has started before."""
    count: int = 0
    time: float = 0.0
    """The time that has passed by the time stamps of the replies, s."""
    last: float = 0.0
    history: list[dict[str, list[float]]] = field(default_factory=list)
    sent: list[list[int]] = field(default_factory=list)
    hold: Hold = field(default_factory=Hold)

    def __post_init__(self) -> None:
        self.socket = socket(AF_INET, SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", self.port))
        self.socket.settimeout(self.timeout)
        self.at: dict[str, list[float]] = {}
        self.hold.depth, self.hold.heading = self.depth, self.heading

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
        text = b""
        while not text:
            self.socket.send(sent)
            with suppress(TimeoutError):
                text = self.socket.recv(65000)
        self.at = parsed(text)
        (stamp,) = self.at["timestamp"]
        self.time += max(stamp - self.last, 0.0)
        self.last = stamp
        self.count += 1
        self.history.append(self.at)

    def pulses(self) -> list[int]:
        """The outputs of the motors, µs."""
        if not self.at or self.time < self.start:
            return started(0.0, [], self.channels)
        dt = 1.0 / self.rate
        (phi, theta, _), (ax, ay, az) = self.at["attitude"], self.at["accel_body"]
        fall = -sin(theta) * ax + sin(phi) * cos(theta) * ay + cos(phi) * cos(theta) * az + 9.80665
        attitude, gyro = (self._vector(key) for key in ("attitude", "gyro"))
        motion = Motion(attitude, gyro, self.at["position"][2], self.at["velocity"][2], fall)
        forward, lateral = self.sticks(self.time)
        outputs = self.hold.outputs(motion, forward, lateral, dt)
        self.sent.append(started(self.time, [int(1500 + 400 * out) for out in outputs], self.channels, self.start))
        return self.sent[-1]

    def _vector(self, key: str) -> tuple[float, float, float]:
        x, y, z = self.at[key]
        return x, y, z
