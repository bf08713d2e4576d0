"""From the topics of a log to channels: units, frames, attitude and pressure, and which of several sources is used.

Every reader of a format returns topics. Here the catalogue says what their fields measure, and the rules about sources
are applied:

- A name with a word such as `setpoint` or `desired` is no measurement.
- If the log has several vehicles, one is used.
- Of several senders of the same message, the one that sends the commands is used.
- Of several sources of a quantity, the first in the catalogue that has enough samples and changes is used. Of several
  barometers, it is the one that changes most.
- A velocity that contradicts the positions in the same messages is left out.
- A velocity in a frame of the earth is rotated into the body frame by the attitude, and left out without one.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from rov_fmu.tank.arrays import Array, Flags, rms, spread
from rov_fmu.tank.catalogue import (
    ATMOSPHERE,
    DOWN,
    EARTH,
    EAST,
    EULER,
    HULL,
    LEAST_PRESSURE,
    MESSAGES,
    NED,
    NORTH,
    NOT_MEASURED,
    POSITION,
    PRESSURE_GRADIENT,
    QUANTITIES,
    QUATERNION,
    RATES,
    UP,
    VECTORS,
    VELOCITY,
    MeasuredQuantity,
    Message,
    words_of,
)
from rov_fmu.tank.clocks import ascending, first_in_each
from rov_fmu.tank.log import LEAST_SAMPLES, Channel, Source

_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Turns east, north, up into north, east, down."""
_FLU = np.diag([1.0, -1.0, -1.0])
"""Turns forward, left, up into forward, starboard, down."""
IMPOSSIBLE = 1e12
"""The size of a time or of a value that no clock and no sensor shows."""
_COMPARED, _LEAST_COMPARED = 1.0, 8
"""The time over which the changes of a position are compared with a velocity, s, and the least number of changes."""
_CONTRADICTS, _LEAST_ERROR, _EXPLAINED = 0.3, 0.05, 0.5
"""A velocity contradicts the positions if the root mean square of the difference is more than the first share of the
motion and more than the distance, m, and if another frame, scale or sign leaves less than the last share of it."""
_LEAST_TURN = 0.1
"""The turn within _COMPARED of a vehicle that surely turns, rad."""
_EARTH_WORDS = {"map", "odom", "world", "earth", "enu", "ned", "local", "global", "inertial"}
"""Words in the names of frames that are fixed to the earth."""


_NO_HEADING = "no heading beside velocities north and east turns them into those of the body"
"""Why velocities in directions of the earth are left out."""
_WATERS = 0.9, 1.1
"""The range of specific gravities of water in which vehicles dive."""
Gravity = Callable[[Array], Array]
"""Returns the specific gravity of the water at some times, s, as the autopilot is told. Another one than that of water
counts as that of fresh water, 1."""


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one kind by one sender, with numbers as they stand in the log."""

    source: Source
    time: Array
    """n: s, ascending, all different."""
    fields: Mapping[str, Array]
    """n each: the numbers by their field in a message, such as `pose.pose.position.x` or `channels[0]`. They are NaN
    where the sender marks them as unknown."""
    unused: str = ""
    """Why the reader says that it must not be used; empty if it may be."""

    @classmethod
    def of_messages(cls, source: Source, time: Array, fields: Mapping[str, Array]) -> "Topic":
        """Return the topic of messages in any order. Of messages with the same time, the last number counts.

        Values that no sensor shows become NaN.
        """
        known = (np.where(np.abs(values) < IMPOSSIBLE, values, np.nan) for values in fields.values())
        ordered, *columns = ascending(time, *known)
        return cls(source, ordered, dict(zip(fields, columns, strict=True)))

    def has(self, message: Message) -> bool:
        """Return True if the messages are what an entry of the catalogue describes."""
        name, kind = self.source.topic, self.source.kind
        is_meant = re.fullmatch(message.kind, kind) and re.search(message.topic, name)
        return bool(is_meant) and {*message.fields} - {""} <= self.fields.keys()

    def where(self, kept: Flags) -> "Topic":
        """Return the topic with only some of its messages."""
        return replace(self, time=self.time[kept], fields={name: own[kept] for name, own in self.fields.items()})

    def full_fields(self) -> Iterator[tuple[str, Array]]:
        """Yield the fields with the name of the topic, as rov.toml names them."""
        return ((self.full_name(field), values) for field, values in self.fields.items())

    def full_name(self, field: str) -> str:
        """Return the name of a field with that of the topic, as rov.toml names it."""
        return f"{self.source.topic}.{field}".removeprefix(".")


Attitude = tuple[Array, Rotation]
"""Times, and the rotations from the body (forward, starboard, down) to north-east-down."""


@dataclass(frozen=True, eq=False)
class _Measurement:
    """What an entry of the catalogue found in a topic: n x k numbers in SI units."""

    message: Message
    topic: Topic
    values: Array
    unused: str
    """Why the topic is not used; empty if it may be."""

    @cached_property
    def attitude(self) -> Attitude:
        """The attitude at the times at which the measurement knows it: at none if it is of something else."""
        gives, values, time = self.message.gives, self.values, self.topic.time
        known = np.isfinite(values).all(axis=1) & (gives in (EULER, QUATERNION))
        if gives != QUATERNION or not known.any():
            return time[known], Rotation.from_euler("ZYX", np.reshape(values[known, ::-1], (-1, 3)))
        earth, body = frames_of(self.message, self.topic.source)
        rotation = Rotation.from_quat(values[known], scalar_first=True).as_matrix()
        return time[known], Rotation.from_matrix(earth @ rotation @ body)


def channels_of(
    topics: Sequence[Topic],
    sender: Source | None,
    others: Collection[str] = (),
    named: Sequence[Channel] = (),
    gravity: Gravity = np.ones_like,
) -> list[Channel]:
    """Return all channels of the topics, with the reason for each that is not used; preferred ones come first.

    `sender` is the source of the commands, and `others` are the names of other vehicles that have commands. `named` are
    the channels that rov.toml names, which are preferred to all others. `gravity` tells the water.
    """
    measurements = [*_measurements(topics, sender, others)]
    measurements = [replace(one, unused=one.unused or _standstill(one, measurements)) for one in measurements]
    attitude = _attitude(measurements)
    channels = [*named]
    for one in measurements:
        channels += _channels(one, one.unused or _contradiction(one, measurements), attitude, gravity)
    return with_one_source(in_body_frame(with_one_source(channels)))


def _measurements(topics: Sequence[Topic], sender: Source | None, others: Collection[str]) -> Iterator[_Measurement]:
    """Yield what the catalogue knows, in the order of its preference."""
    for message in MESSAGES:
        found = []
        for topic in (topic for topic in topics if topic.has(message)):
            values = np.column_stack([topic.fields[field] for field in message.fields])
            reason = _reason_against(topic, topics, sender, others)
            known = np.where(values == message.unknown, np.nan, values * message.factor)
            found.append(_Measurement(message, topic, known, reason))
        if message.gives in ("depth", "pressure"):  # of several barometers, the one in the water changes most
            found.sort(key=lambda measurement: -spread(measurement.values))
        yield from found


def _reason_against(topic: Topic, topics: Sequence[Topic], sender: Source | None, others: Collection[str]) -> str:
    """Return why a topic is not used: it is no measurement, or of another vehicle or part; or an empty text."""
    own = topic.source
    if topic.unused:
        return topic.unused
    if words := NOT_MEASURED & words_of(own.topic):
        return f"its name has the word {min(words)}, so it is no measurement of the vehicle"
    if own.vehicle in others:
        return f"it is of {own.vehicle}, another vehicle"
    if sender and sender.part.startswith("component") and own.part != sender.part:
        sent = {(other.source.kind, other.source.vehicle, other.source.part) for other in topics}
        if (own.kind, own.vehicle, sender.part) in sent:
            return f"{sender.part}, which sent the commands, sent it too"
    return ""


def with_one_source(channels: Sequence[Channel]) -> list[Channel]:
    """Mark all channels of a quantity but one as unused: the first with enough samples that change, or else the first.

    The position and the velocity along an axis are two quantities, and may come from different sources.
    """
    chosen: dict[str, Channel] = {}
    for channel in sorted(channels, key=lambda c: c.count < LEAST_SAMPLES or not spread(c.values)):
        if not channel.unused:
            chosen.setdefault(channel.quantity.name, channel)
    return [
        channel
        if channel.unused or channel is (used := chosen[channel.quantity.name])
        else replace(channel, unused=f"{used.source} is used")
        for channel in channels
    ]


# ---- Attitude and frames ---------------------------------------------------------------------------------------------


def _attitude(measurements: Iterable[_Measurement]) -> Slerp | None:
    """Return the attitude that is preferred, for interpolation."""
    found = (m.attitude for m in measurements if not m.unused)
    return next((Slerp(*attitude) for attitude in found if len(attitude[0]) >= LEAST_SAMPLES), None)


def _standstill(attitude: _Measurement, measurements: Sequence[_Measurement]) -> str:
    """Return the reason against an attitude that never changes although the vehicle turns, by the rates of turn in the
    same messages, or else in others; or an empty text. Some sensors send a constant where they measure none."""
    values = attitude.values[np.isfinite(attitude.values).all(axis=1)]
    is_attitude = attitude.message.gives in (EULER, QUATERNION)
    if not is_attitude or len(values) < LEAST_SAMPLES or np.ptp(values, axis=0).any():
        return ""
    rates = [m for m in measurements if m.message.gives == RATES and not m.unused]
    for rate in sorted(rates, key=lambda m: m.topic is not attitude.topic)[:1]:
        ends = first_in_each(rate.topic.time, 1.0 / _COMPARED)
        angles = np.cumsum(np.nan_to_num(rate.values[1:]) * np.diff(rate.topic.time)[:, None], axis=0)
        turned = np.abs(np.diff(angles[ends[:-1]], axis=0)).max(initial=0.0)
        if turned > _LEAST_TURN:
            degrees = f"{np.degrees(turned):.3g} deg"
            return f"it never changes, although {rate.topic.source} tells turns of {degrees} in a second"
    return ""


def frames_of(message: Message, source: Source) -> tuple[Array, Array]:
    """Return two matrices: from the earth frame of a source to north, east, down, and from its body frame to forward,
    starboard, down. The catalogue may know the frames of a message."""
    if message.frame:
        return np.eye(3), np.eye(3)
    earth, body = source.frames
    earth_words, body_words = words_of(earth), words_of(body)
    is_frd = bool(body_words & {"ned", "frd"}) or ("ned" in earth_words and "flu" not in body_words)
    is_ned = "ned" in earth_words or (not earth and is_frd)
    return np.eye(3) if is_ned else _ENU, np.eye(3) if is_frd else _FLU


def _is_of_earth(measurement: _Measurement) -> bool:
    """Return True for a velocity in a frame that is fixed to the earth."""
    if measurement.message.frame:
        return measurement.message.frame == NED
    return bool(words_of(measurement.topic.source.frames[1]) & _EARTH_WORDS)


def _contradiction(velocity: _Measurement, measurements: Iterable[_Measurement]) -> str:
    """Return the reason against a velocity that contradicts the positions in the same messages, or an empty text.

    The changes of the position over some time are compared with the integral of the velocity, both north, east and
    down. Noise of the position is no contradiction: the velocity must agree with it in another frame, or after another
    scale, sign or order of its components.
    """
    same = {m.message.gives: m for m in measurements if m.topic is velocity.topic}
    position, quaternion, time = same.get(POSITION), same.get(QUATERNION), velocity.topic.time
    if velocity.message.gives != VELOCITY or not position or not quaternion or len(time) < LEAST_SAMPLES:
        return ""
    from scipy.integrate import cumulative_trapezoid  # imported here because it is slow

    known, rotation = quaternion.attitude
    if len(known) < len(time) or not np.isfinite(np.hstack([velocity.values, position.values])).all():
        return ""
    earth, body = frames_of(velocity.message, velocity.topic.source)
    ends = first_in_each(time, 1.0 / _COMPARED)
    moved = np.diff((position.values @ earth.T)[ends], axis=0)
    rates = {"the body": rotation.apply(velocity.values @ body.T), "the earth": velocity.values @ earth.T}
    paths = (cumulative_trapezoid(values, time, axis=0, initial=0.0) for values in rates.values())
    travelled = dict(zip(rates, (np.diff(path[ends], axis=0) for path in paths), strict=True))
    stated, other = sorted(rates, reverse=_is_of_earth(velocity))
    error = rms(travelled[stated] - moved)
    if error <= max(_CONTRADICTS * rms(moved), _LEAST_ERROR):
        return ""
    against = "it contradicts the positions in the same messages"
    if rms(travelled[other] - moved) < _EXPLAINED * error:
        return f"{against}, unless it is in a frame of {other}, not of {stated}"
    mapped = travelled[stated] @ np.linalg.lstsq(travelled[stated], moved, rcond=None)[0]
    is_explained = len(moved) >= _LEAST_COMPARED and rms(mapped - moved) < _EXPLAINED * error
    return f"{against} by its scale, signs or axes" if is_explained else ""


def _at(attitude: Slerp, time: Array) -> Rotation:
    """Return the attitude at some times; before and after all that are known, the first and the last one."""
    return attitude(np.clip(time, *attitude.times[[0, -1]]))


def in_body_frame(channels: Sequence[Channel]) -> list[Channel]:
    """Return the channels with velocities of the body in place of those north, east, and down or up.

    Without a roll and a pitch, or without a vertical velocity, the vehicle is taken as level, as it is for a vertical
    one alone. Without a heading, which may be in another file of the dive, those north and east are left out.
    """
    may_be_used = (c for c in reversed(channels) if c.count and c.unused in ("", _NO_HEADING))
    found = {channel.quantity.name: channel for channel in may_be_used}
    if found.keys().isdisjoint(EARTH):
        return [*channels]
    north, east, down, heading = map(found.get, (NORTH, EAST, DOWN, "heading"))
    if up := found.get(UP):
        down = down or replace(up, values=-up.values)
    others = [c for c in channels if c.quantity.name not in EARTH]
    if down and not (north or east):
        return [replace(down, quantity=QUANTITIES["heave velocity"]), *others]
    if not (north and east and heading):
        return [replace(c, unused=c.unused or _NO_HEADING) if c.quantity.name in EARTH else c for c in channels]
    time, tilt = north.time, [found.get(name) for name in ("pitch angle", "roll angle")]
    known = [heading, *(tilt if down and all(tilt) else [None, None])]
    angles = [np.interp(time, *one.unwrapped) if one else np.zeros(len(time)) for one in known]
    vector = [_interpolated(one, time) if one else np.zeros(len(time)) for one in (north, east, down)]
    turn = Rotation.from_euler("ZYX", np.column_stack(angles)).inv()
    moved = zip(VECTORS[VELOCITY][: 3 if down else 2], turn.apply(np.column_stack(vector)).T, strict=False)
    source = Source("velocities north and east, which the heading turns", kind="earth")
    return [
        *(replace(north, quantity=QUANTITIES[of], source=source, values=own, unused="") for of, own in moved),
        *others,
    ]


def _interpolated(channel: Channel, time: Array) -> Array:
    """Return the values of a channel at some times, s; NaN at its own times without a measurement."""
    return channel.values if np.array_equal(channel.time, time) else np.interp(time, *channel.samples)


# ---- Channels --------------------------------------------------------------------------------------------------------


def _channels(measurement: _Measurement, unused: str, attitude: Slerp | None, gravity: Gravity) -> Iterator[Channel]:
    """Yield the channels of a measurement; `unused` is why it is not used."""
    gives, topic, values = measurement.message.gives, measurement.topic, measurement.values
    earth, body = frames_of(measurement.message, topic.source)
    time, columns = topic.time, dict[str, Array]()
    if gives == POSITION:
        columns = _of_position(_turned(values, earth))
    elif gives in (EULER, QUATERNION):
        time, rotation = measurement.attitude
        columns = dict(zip(VECTORS[gives], rotation.as_euler("ZYX")[:, ::-1].T, strict=True)) if len(time) else {}
    elif gives in (VELOCITY, RATES):
        if not _is_of_earth(measurement):
            values = _turned(values, body)
        elif attitude:
            values = _at(attitude, topic.time).inv().apply(_turned(values, earth))
        else:
            frame = topic.source.frames[1] or "the earth"
            unused = unused or f"its frame is {frame}, and the log has no attitude to rotate it into that of the body"
        columns = dict(zip(VECTORS[gives], values.T, strict=True))
    else:
        yield from of_scalar(QUANTITIES[gives], topic.source, time, values[:, 0], unused, gravity)
    for name, column in columns.items():
        yield Channel(QUANTITIES[name], topic.source, time, column, unused=unused)


def _turned(values: Array, axes: Array) -> Array:
    """Return n x 3 numbers along other axes. A component that is unknown leaves those that do not follow from it."""
    unknown = np.isnan(values) @ (axes != 0.0).T
    return np.where(unknown, np.nan, np.nan_to_num(values) @ axes.T)


def _of_position(position: Array) -> dict[str, Array]:
    """Return the depth, and how far north and east the vehicle is of the first place, and the distance from there, from
    n x 3 positions north, east and down."""
    columns = {"depth": position[:, 2]}
    there = np.isfinite(position[:, :2]).all(axis=1)
    if there.any():
        north, east = (position - position[there][0])[:, :2].T
        columns |= {"surge distance": north, "sway distance": east, "distance": np.hypot(north, east)}
    return columns


def of_scalar(
    quantity: MeasuredQuantity,
    source: Source,
    time: Array,
    values: Array,
    unused: str = "",
    gravity: Gravity = np.ones_like,
) -> Iterator[Channel]:
    """Yield a channel, and the depth that a pressure implies in the water that `gravity` tells."""
    yield Channel(quantity, source, time, values, unused=unused)
    if quantity.name == "pressure":
        told, (low, high) = gravity(time), _WATERS
        relative = np.where((told >= low) & (told <= high), told, 1.0)
        depth, reason = (values - ATMOSPHERE) / PRESSURE_GRADIENT / relative, unused or _reason_against_pressure(values)
        water = "fresh water (1000 kg/m3). In sea water the true depth is 2.5 % smaller"
        if (relative != 1.0).any():
            water = f"water of {1000.0 * relative[-1]:.4g} kg/m3, which the autopilot is told"
        yield Channel(QUANTITIES["depth"], source, time, depth, unused=reason, derived_from=f"pressure, for {water}")


def _reason_against_pressure(values: Array) -> str:
    """Return why no depth follows from pressures in Pa, or an empty text."""
    known = values[np.isfinite(values)]
    if not len(known):
        return ""
    low, high = float(known.min()), float(known.max())
    if high < LEAST_PRESSURE * ATMOSPHERE:
        return (
            f"its pressures of {low:.4g} ... {high:.4g} are below 1 % of an atmosphere, so they are not in Pa. Name "
            'their unit in rov.toml, such as "pressure [kPa]"'
        )
    change, from_air = (high - low) / PRESSURE_GRADIENT, abs(high / ATMOSPHERE - 1.0)
    if change < HULL[0] and from_air < HULL[1]:
        return (
            f"its pressure changes by only {1000.0 * change:.2g} mm of water and is that of the air, so the barometer "
            "seems to be inside the hull"
        )
    return ""
