"""What a reader returns: the messages of a log by topic, before anything is known about the vehicle."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from rov_fmu.tank.arrays import Array, range_in_words
from rov_fmu.tank.channels import IMPOSSIBLE, Topic
from rov_fmu.tank.clocks import parts_of_clock, restarts, usual_delay
from rov_fmu.tank.commands import AutopilotParameters
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.log import Source

Messages = dict[Source, list[tuple[float, float, Mapping[str, float]]]]
"""The messages of each source in the order of their arrival: the time, NaN where it has none, that of the arrival, s,
and the numbers."""


@dataclass(eq=False)
class Piece:
    """The messages of a log between two restarts of its clock."""

    topics: list[Topic]
    parameters: AutopilotParameters = field(default_factory=AutopilotParameters)
    since: float = 0.0
    """The time of its first message after that of the log, on a clock that does not restart, s."""

    @property
    def fields(self) -> dict[str, str]:
        """The name of the topic of each field, by the field's name in rov.toml."""
        return {field: topic.source.topic for topic in self.topics for field, _ in topic.full_fields()}


@dataclass(eq=False)
class Content:
    """What a file contains."""

    file: str
    pieces: list[Piece]
    findings: list[Finding] = field(default_factory=list)
    unread: dict[str, str] = field(default_factory=dict)
    """A description of everything that is not recognised, by name."""
    names: frozenset[str] = frozenset()
    """All headers of a table."""
    without_thruster: Mapping[str, int] = field(default_factory=dict)
    """The motors of a table for which the vehicle has no thruster, by their headers."""

    def count(self, kind: str, count: int, **words: str | float) -> None:
        """Add a finding about something that was counted, if there is any."""
        if count:
            self.findings.append(about(self.file, kind, count=count, **words))

    def add_cut(self) -> None:
        """Add a finding that the file ends before its end mark, with the time that could be read."""
        times = [topic.time for piece in self.pieces for topic in piece.topics if len(topic.time)]
        read = max((time[-1] for time in times), default=0.0) - min((time[0] for time in times), default=0.0)
        words = f"The {read:.4g} s before that are" if read else "What is before that is"
        self.findings.append(about(self.file, "cut", read=words))

    def split_by_clock(self) -> None:
        """Split the log where a clock was set, and leave out and count the messages with times that none has shown.

        Topics that have clocks of their own, so that no topic shows both, stay together.
        """
        times = [topic.time for piece in self.pieces for topic in piece.topics]
        together = np.concatenate([np.empty(0), *times])
        is_possible = np.abs(together) < IMPOSSIBLE
        part = parts_of_clock(together)
        if is_possible.any():
            part[~is_possible] = -1
        self.count("stray times", int((part < 0).sum()))
        if not part.any():
            return
        own = iter(np.split(part, np.cumsum([*map(len, times)])[:-1]))
        pieces, self.pieces = self.pieces, []
        for piece in pieces:
            parts = [next(own) for _ in piece.topics]
            shown = [np.unique(of[of >= 0]) for of in parts]
            is_set = any(len(numbers) > 1 for numbers in shown)
            all_shown = np.unique(np.concatenate([np.empty(0, np.intp), *shown]))
            since = piece.since
            for numbers in all_shown[:, None] if is_set else [all_shown]:
                kept = (topic.where(np.isin(of, numbers)) for topic, of in zip(piece.topics, parts, strict=True))
                topics = [topic for topic in kept if len(topic.time)]
                self.pieces.append(Piece(topics, piece.parameters, since))
                since += float(np.ptp([end for topic in topics for end in topic.time[[0, -1]]])) if topics else 0.0


def content_of(
    file: str,
    messages: Messages,
    parameters: Mapping[str, Sequence[tuple[float, float]]],
) -> Content:
    """Return the content of a log whose messages have times of their own and of their arrival.

    `parameters` has the arrival (s) and the value of each message about a parameter, by name. A clock that restarts
    splits the log.
    """
    content, late = Content(file, []), Counter[str]()
    for rows in messages.values():
        rows.sort(key=lambda message: message[1])
    stamps = [np.array([message[:2] for message in own]) for own in messages.values()]
    again = restarts(stamps)
    begin = min((float(pairs[0, 1]) for pairs in stamps), default=0.0)
    for n, first in enumerate([begin, *again]):
        inside = [np.searchsorted(again, pairs[:, 1], side="right") == n for pairs in stamps]
        own = [pairs[there] for pairs, there in zip(stamps, inside, strict=True)]
        delay = usual_delay(np.concatenate([np.empty((0, 2)), *own]))
        topics = []
        for source, (stamp, arrival), there in zip(messages, (pairs.T for pairs in own), inside, strict=True):
            if len(stamp):
                numbers = [messages[source][row][2] for row in np.flatnonzero(there)]
                topics.append(topic_of(source, np.where(np.isnan(stamp), arrival - delay, stamp), numbers))
                late[source.topic] += len(stamp) if np.isnan(stamp).any() else 0
        topics = [topic for topic in topics if len(topic.time)]
        content.pieces.append(Piece(topics, AutopilotParameters.of_pairs(parameters, delay), first - begin))
    content.count("time of arrival", late.total(), topics=", ".join(+late))
    return content


def topic_of(source: Source, time: Array, numbers: Sequence[Mapping[str, float]]) -> Topic:
    """Return the topic of messages with these times, s, and numbers."""
    keys = dict.fromkeys(key for row in numbers for key in row)
    return Topic.of_messages(source, time, {key: np.array([row.get(key, np.nan) for row in numbers]) for key in keys})


def described_topics(topics: Iterable[Topic], messages: Mapping[str, int] = MappingProxyType({})) -> dict[str, str]:
    """Return the descriptions of topics that are not recognised, and of the range of each number in their messages.

    `messages` has the number of all messages, if the topics have only the first ones.
    """
    found = {}
    for topic in topics:
        name, kind, count = topic.source.topic, topic.source.kind, len(topic.time)
        found[name] = f"{kind}, {messages.get(name, count)} messages"
        first = f" in the first {count} messages" if messages.get(name, count) > count else ""
        ranges = {field: range_in_words(values) for field, values in topic.full_fields() if np.isfinite(values).any()}
        found |= {field: f"{words}{first}" for field, words in ranges.items()}
    return found
