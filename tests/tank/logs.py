"""Logs for tests: made of arrays, or read with their recordings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import recordings_of_logs
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.model.layout import Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.columns import Names
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import Channel, Commands, Log, Source
from rov_fmu.tank.quality import checked
from rov_fmu.tank.read_log import read_logs


def commands(time: Array, thrusters: Mapping[str, Array]) -> Commands:
    """Return the commands of thrusters, n each at n times."""
    return Commands.of_rows([*thrusters], time, np.column_stack([*thrusters.values()]), Source("commands"))


def channel(quantity: str, time: Array, values: Array) -> Channel:
    """Return a channel of a quantity of the catalogue."""
    return Channel(QUANTITIES[quantity], Source(quantity), time, values)


def log(commanded: Commands, *channels: Channel, file: str = "a.csv") -> Log:
    """Return a log."""
    return Log(file, commanded, channels)


@dataclass(frozen=True)
class Read:
    """A log that was read, and its recordings."""

    logs: Sequence[Log]
    recordings: Sequence[Recording]
    findings: Sequence[Finding]
    """All but those about the sources of channels."""


def read_log(path: Path, layout: Layout, axis: Axis | None = None, names: Names = Names()) -> Read:  # noqa: B008 (frozen)
    """Read a log with its recordings. Raises DataFileError, as the command does."""
    logs = [checked(one) for one in read_logs(path, layout, names, axis)]
    findings = [finding for one in logs for finding in one.findings]
    if not any(one.commands for one in logs):
        raise DataFileError(f"{path}: no commands of thrusters were found")
    commanded = [one for one in logs if one.commands]
    recordings, useless, mistakes = recordings_of_logs(path.parent, commanded, layout, layout)
    if mistakes and not recordings:
        raise DataFileError(*mistakes)
    findings += useless
    return Read(logs, recordings, [finding for finding in findings if finding.kind != "source"])
