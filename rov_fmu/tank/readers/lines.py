"""Read logs that instruments write as lines of text, each a message: VideoRay Cockpit and the DVL A50 of Water Linked.

A line that is broken, such as the last one of a file that was cut, is left out and counted.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np

from rov_fmu.io.csv_table import UnreadableFileError, open_text
from rov_fmu.tank.catalogue import COCKPIT, DVL_ANGLES, DVL_PLACE, DVL_VELOCITY
from rov_fmu.tank.columns import seconds
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.content import Content, content_of

_Message = tuple[Source, float, Mapping[str, float]]
"""The source of a message, its time, s, and its numbers by the names of their fields."""
_SENTENCE = re.compile(r"\$([^$*]+)\*([0-9A-F]{2})", re.IGNORECASE)
_AGAIN = 1e-6
"""The time that passes between two messages of which the second one has an earlier time, s."""
_POSITION = "position_local"
_BROKEN = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)
"""What reading a broken line raises; a report of the DVL may be any JSON."""


def read_videoray(path: Path, _: Collection[str]) -> Content:
    """Read the sentences of NMEA that VideoRay Cockpit exports: $PVRND,mm/dd/yyyy,hh:mm:ss.s,depth,heading,pitch,roll*
    with a checksum. Sentences of other kinds have no time."""

    def messages_in(line: str) -> Iterator[_Message | str]:
        sentence = _SENTENCE.search(line)
        if not sentence or reduce(xor, sentence[1].encode()) != int(sentence[2], 16):
            raise ValueError("a wrong checksum")
        kind, *cells = sentence[1].split(",")
        if kind != COCKPIT:
            yield kind
            return
        date, clock, *numbers = cells
        month, day, year = date.split("/")
        fields = zip(("depth", "heading", "pitch", "roll"), map(float, numbers), strict=True)
        yield Source(COCKPIT, COCKPIT), seconds(f"{year}-{month}-{day}T{clock}"), dict(fields)

    return _read(path, messages_in)


def read_waterlinked(path: Path, _: Collection[str]) -> Content:
    """Read the reports in JSON of Water Linked's DVL A50: velocities, and positions by dead reckoning with angles.

    Reports before json_v3 tell only the time since the last velocity. The positions are the sums of the velocities in a
    frame of the DVL's own, so they are not used beside these.
    """
    elapsed, is_dated = 0.0, True

    def messages_in(line: str) -> Iterator[_Message | str]:
        nonlocal elapsed, is_dated
        report = json.loads(line)
        kind = report.get("type", "velocity" if "vx" in report else "")
        numbers = {name: float(value) for name, value in report.items() if isinstance(value, (int, float))}
        if kind == "velocity":
            is_dated = "time_of_validity" in numbers
            elapsed += 1e-3 * numbers["time"]
            yield Source(kind, DVL_VELOCITY), 1e-6 * numbers["time_of_validity"] if is_dated else elapsed, numbers
        elif kind == _POSITION:
            time = numbers["ts"] if is_dated else elapsed
            angles = {name: numbers.pop(name) for name in ("roll", "pitch", "yaw")}
            yield Source(kind, DVL_ANGLES), time, angles
            yield Source(kind, DVL_PLACE), time, numbers
        else:
            yield kind or "others"

    content = _read(path, messages_in)
    for piece in content.pieces:
        if any(topic.source.kind == DVL_VELOCITY for topic in piece.topics):
            reason = "it is the sum of the velocities, which are used"
            piece.topics = [
                replace(one, unused=reason) if one.source.kind == DVL_PLACE else one for one in piece.topics
            ]
    return content


def _read(path: Path, messages_in: Callable[[str], Iterator[_Message | str]]) -> Content:
    """Return the messages in the lines of a file. `messages_in` yields those of a line, or the kind of one that is not
    read; and raises one of _BROKEN."""
    found, others, broken = dict[Source, list[tuple[float, Mapping[str, float]]]](), Counter[str](), 0
    with open_text(path)() as file:
        for line in filter(str.strip, file):
            try:
                messages = [*messages_in(line)]
            except _BROKEN:
                broken += 1
                continue
            for one in messages:
                if isinstance(one, str):
                    others[one] += 1
                else:
                    found.setdefault(one[0], []).append(one[1:])
    if not found:
        what = f"its {broken} lines are broken or have a wrong checksum" if broken else "its lines measure no motion"
        raise UnreadableFileError(f"{path}: {what}")
    content = content_of(path.name, {source: _timed(own) for source, own in found.items()}, {})
    content.unread |= {kind: f"{count} messages" for kind, count in others.items()}
    content.count("broken lines", broken)
    return content


def _timed(messages: list[tuple[float, Mapping[str, float]]]) -> list[tuple[float, float, Mapping[str, float]]]:
    """Return messages with their times, and with those of a clock that goes on where their own goes back."""
    stamps = np.array([time for time, _ in messages])
    steps = np.diff(stamps, prepend=stamps[0])
    goes_on = stamps[0] + np.cumsum(np.where(steps > 0.0, steps, _AGAIN))
    return [(time, at, numbers) for (time, numbers), at in zip(messages, goes_on.tolist(), strict=True)]
