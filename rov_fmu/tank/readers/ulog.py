"""Read logs of PX4 (.ulg) with pyulog.

The catalogue says which topics are read and what they measure. Times are those of the sample, where a message has one,
and otherwise of the message.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rov_fmu.tank.catalogue import is_known_kind
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.commands import AutopilotParameters
from rov_fmu.tank.findings import about
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.content import Content, Piece, described_topics

_T = TypeVar("_T")
_FRAMES = {1: "ned", 3: "frd"}
"""The numbers of the frames of vehicle_odometry; others are not usable."""


def read_ulog(path: Path, named: Collection[str]) -> Content:
    """Read the topics that the catalogue knows, and those in `named`."""
    from pyulog import ULog

    with path.open("rb") as file:
        log = ULog(file)
    names = Counter(data.name for data in log.data_list)
    topics = [_topic(data, names[data.name] > 1) for data in log.data_list if "timestamp" in data.data]
    known = (topic for topic in topics if is_known_kind(topic.source.kind) or topic.source.topic in named)
    read = [topic for topic in known if len(topic.time)]
    unread = described_topics(topic for topic in topics if topic not in read)
    content = Content(path.name, [Piece(read, _parameters(log))], unread=unread)
    if log.file_corruption:
        content.findings.append(about(path.name, "damaged log"))
    if log.dropouts:
        longest = max(dropout.duration for dropout in log.dropouts) / 1000.0
        content.count("dropouts", len(log.dropouts), longest=longest)
    return content


def _parameters(log: Any) -> AutopilotParameters:
    values = {name: [(0.0, value)] for name, value in log.initial_parameters.items()}
    for stamp, name, value in log.changed_parameters:
        values.setdefault(name, []).append((stamp * 1e-6, value))
    return AutopilotParameters.of_pairs(values)


def _topic(data: Any, several: bool) -> Topic:
    """Return a topic; the name of every instance but the first ends with its number."""
    columns = {key: values.astype(float) for key, values in data.data.items()}
    sampled = columns.get("timestamp_sample", columns["timestamp"])
    stamp = np.where(sampled > 0.0, sampled, columns["timestamp"]) * 1e-6
    frames = velocity_frames(int(np.median(columns.get("velocity_frame", np.ones(1)))))
    fields = fields_of(data.name, columns, frames)
    name = f"{data.name}_{data.multi_id}" if data.multi_id else data.name
    part = f"instance {data.multi_id}" if several else ""
    return Topic.of_messages(Source(name, data.name, part=part, frames=frames), stamp, fields)


def velocity_frames(number: int) -> tuple[str, str]:
    """Return the frame of the position and that of the velocity for a number of vehicle_odometry; others are empty."""
    return "ned", _FRAMES.get(number, "")


def fields_of(kind: str, fields: Mapping[str, _T], frames: tuple[str, str]) -> dict[str, _T]:
    """Return the fields of a message that may measure something: no time stamps, and no velocity in another frame."""
    left_out = ("timestamp", "velocity") if kind == "vehicle_odometry" and not frames[1] else ("timestamp",)
    return {name: value for name, value in fields.items() if not name.startswith(left_out)}
