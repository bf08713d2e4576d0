"""Logs for tests: made of arrays, or read from files, and what is in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.columns import ColumnNames
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import Channel, Commands, Log, Source
from rov_fmu.tank.quality import checked_log
from rov_fmu.tank.read_log import read_logs


def commands(time: Array, thrusters: Mapping[str, Array]) -> Commands:
    """Return the commands of thrusters, n each at n times."""
    return Commands.of_rows([*thrusters], time, np.column_stack([*thrusters.values()]), Source("commands"))


def channel(quantity: str, time: Array, values: Array) -> Channel:
    """Return a channel of a quantity of the catalogue."""
    return Channel(QUANTITIES[quantity], Source(quantity), time, values)


def log(commanded: Commands | None, *channels: Channel, file: str = "a.csv") -> Log:
    """Return a log."""
    return Log(file, commanded, channels)


def used(log: Log, quantity: str) -> Channel:
    """Return the channel that is used for a quantity."""
    found = log.used(quantity)
    assert found is not None, f"no {quantity}"
    return found


def measured(log: Log, quantity: str) -> Array:
    """Return the values that were measured of a quantity; angles are unwrapped."""
    return used(log, quantity).unwrapped[1]


def commanded(log: Log, thruster: str, time: Array | None = None) -> Array:
    """Return the commands of a thruster at some times, or in all rows of commands."""
    found = log.commands
    assert found is not None
    return found.at(found.rows if time is None else time)[:, found.thrusters.index(thruster)]


def axes(log: Log) -> list[str]:
    """Return the names of the axes whose motion a log measures and is used, in the order of its channels."""
    return [*dict.fromkeys(c.quantity.axis.name for c in log.channels if c.quantity.axis and c.count and not c.unused)]


@dataclass(frozen=True)
class Read:
    """The logs of a file."""

    logs: Sequence[Log]
    findings: Sequence[Finding]
    """All but those about the sources of channels."""

    @property
    def log(self) -> Log:
        """The only log."""
        (found,) = self.logs
        return found


def read_log(
    path: Path,
    layout: Layout,
    axis: Axis | None = None,
    names: ColumnNames = ColumnNames(),  # noqa: B008 (frozen)
    *,
    is_part: bool = False,
) -> Read:
    """Read the logs of a file, or of one file of a dive, which needs no commands. Raises DataFileError."""
    logs = [checked_log(one) for one in read_logs(path, layout, names, axis, is_part=is_part)]
    if not is_part and not any(one.commands for one in logs):
        raise DataFileError(f"{path}: no commands of thrusters were found")
    findings = [finding for one in logs for finding in one.findings]
    return Read(logs, [finding for finding in findings if finding.kind != "source"])
