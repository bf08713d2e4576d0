"""The packets of ArduPilot's JSON interface: servo packets, replies, and which of the packets are new.

The layout is that of `libraries/SITL/SIM_JSON.h` and of `libraries/SITL/examples/JSON/readme.md` of ArduPilot.
"""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from rov_fmu.io.columns import NO_OUTPUT

_HEAD = struct.Struct("<HHI")
_CHANNELS = {18458: 16, 29569: 32}
"""The number of channels in a packet, by its magic number."""
_BODIES = {magic: struct.Struct(f"<{count}H") for magic, count in _CHANNELS.items()}
_JSON = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
_MOST_LOST = 10
"""A packet whose count has risen by more than this is probably not the next one."""
_HIGHEST_RATE = 20_000
_PULSE = range(500, 2501)
_WRAP = 2**32
Address = tuple[Any, ...]


@dataclass(frozen=True)
class ServoPacket:
    """The outputs of the autopilot for one frame."""

    frame_rate: int
    """The number of frames in a second that the autopilot asks for."""
    frame_count: int
    pulses: tuple[int, ...]
    """The pulse widths of 16 or 32 channels, µs; 0 stands for no pulse."""

    @property
    def is_plausible(self) -> bool:
        """True if an autopilot would send these numbers."""
        return 0 < self.frame_rate <= _HIGHEST_RATE and all(p in _PULSE or p in NO_OUTPUT for p in self.pulses)


def servo_packet(data: bytes) -> ServoPacket | None:
    """Return the servo packet in a datagram, or None if it is none."""
    if len(data) < _HEAD.size:
        return None
    magic, frame_rate, frame_count = _HEAD.unpack_from(data)
    body = _BODIES.get(magic)
    if body is None or len(data) != _HEAD.size + body.size:
        return None
    return ServoPacket(frame_rate, frame_count, body.unpack_from(data, _HEAD.size))


def reply(values: Mapping[str, Any]) -> bytes:
    """Return the datagram that answers a servo packet: JSON without blanks, between two line breaks.

    The newest ArduPilot parses JSON (AP_JSON_FieldParser, at most 4096 bytes). Older versions search for the first
    occurrence of `"key":` and read the number or the bracket behind it. So there are no blanks, and no key contains
    one that stands behind it. Raises ValueError if a number is not finite.
    """
    return f"\n{_JSON.encode(values)}\n".encode()


class PacketKind(Enum):
    """What to do with a servo packet."""

    NEW = "a step"
    REPEATED = "the last reply again"
    RESTART = "a step from the start, for an autopilot that was started again"
    STRANGE = "nothing"


@dataclass
class Sequence:
    """The order of servo packets. ArduPilot counts a frame when it has the reply, and repeats the packet until then."""

    last: int | None = None
    """The count of the last packet that was answered with a step."""
    lost: int = 0
    """The number of counts that were left out."""
    _is_sure: bool = False
    """True when the next packet has come after the first one. Until then, any plausible packet may be the first one."""
    _before: int | None = None
    """The last count before a jump, until the next packet shows whether the jump was damage."""
    _strange: int | None = field(default=None, repr=False)

    def kind(self, packet: ServoPacket) -> PacketKind:
        """Return what to do with a packet.

        A packet whose count is older, or much newer, came late or is damaged. It is believed if it comes a second time
        with no other in between, since ArduPilot repeats a packet that is not answered. After a jump of the count, the
        packet that should have come is believed, too. An autopilot that is started again counts from 0.
        """
        count = packet.frame_count
        if self.last is None or not self._is_sure:
            if count == self.last:
                return PacketKind.REPEATED
            if not packet.is_plausible:
                return PacketKind.STRANGE
            self._is_sure = self.last is not None and count == (self.last + 1) % _WRAP
            self.last = count
            return PacketKind.NEW
        ahead = (count - self.last) % _WRAP
        if ahead == 0:
            return PacketKind.REPEATED
        is_next = ahead == 1 or (self._before is not None and count == (self._before + 1) % _WRAP)
        if not is_next and ahead > _MOST_LOST and count != self._strange:
            self._strange = count
            return PacketKind.STRANGE
        if is_next:
            self._before = None
        elif self._before is None:
            self._before = self.last
        if ahead <= _MOST_LOST:
            self.lost += ahead - 1
        self.last, self._strange = count, None
        return PacketKind.NEW if count or is_next or ahead <= _MOST_LOST else PacketKind.RESTART

    def restart(self) -> None:
        """Forget which packet is the next one."""
        self.last = self._before = self._strange = None
