"""In every format, one dive is the same log, a clock is followed, and only the guarded process reads it."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import AXES
from rov_fmu.interface.command_files import read_inputs
from rov_fmu.io.child_process import Limits
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.inspection.inspection import inspect
from rov_fmu.tank.readers import parsers
from rov_fmu.tank.readers.parsers import FORMATS, Format, format_of, header_of
from rov_fmu.tank.readers.tank_tables import read_rows
from tests.often import spread
from tests.tank.logs import read_log
from tests.tank.readers import motion, writers
from tests.tank.readers.motion import BLUEROV2, DIVE, LACKING
from tests.tank.readers.writers import SEEDS

TOLD = {
    ".csv": [],
    ".tlog": ["time of arrival", "unknown direction"],
    "BlueOS": ["time of arrival", "damaged pieces", "source of commands"],
    ".bin": [],
    "text": [],
    ".ulg": ["unknown direction"],
}
"""The kinds of findings by format but for bags of ROS."""
WRITERS = {**writers.LOGS, ".csv": writers.csv, "text": writers.flash_text, "BlueOS": writers.blueos}


def test_axes_are_the_same_objects_in_what_another_process_read(tmp_path: Path) -> None:
    """They are compared by identity."""
    channels = read_log(writers.csv(tmp_path, DIVE), BLUEROV2).log.channels
    axes = [channel.quantity.axis for channel in channels if channel.quantity.axis]
    assert axes
    assert all(axis is AXES[axis.name] for axis in axes)


@pytest.mark.parametrize("name", spread(WRITERS, {*WRITERS} - {".db3", ".zstd"}, [".db3"]))
def test_one_dive_is_read_under_any_name(name: str, tmp_path: Path) -> None:
    """What a file contains tells its format. What is listed of it is what was written."""
    path = Path(shutil.copy(WRITERS[name](tmp_path, DIVE), tmp_path / "any.log"))
    read = read_log(path, BLUEROV2)
    motion.check(read.log, lacking=LACKING.get(WRITERS[name], ()))
    assert [finding.kind for finding in read.findings] == TOLD.get(name, ["source of commands", "unknown direction"])
    (inspection,) = inspect(path, [BLUEROV2])
    logged = {f"thruster {name}": (values, 1e-6) for name, values in motion.THRUSTERS.items()} | motion.expected()
    assert [row.name for row in inspection.commands] == [*logged][:6]
    assert [row.unit for row in inspection.commands] == ["1"] * 6
    for row in (*inspection.commands, *inspection.channels):
        values, within = logged[row.name]
        if row.name != "heading":  # which wraps
            assert (row.low, row.high) == pytest.approx((values.min(), values.max()), abs=within), row.name
        assert (row.samples, row.gaps) == (100, [])
        assert (row.end - row.start, row.rate) == pytest.approx((9.9, 10.0), abs=1e-3)


UNCOMMANDED = ("an export of VideoRay Cockpit", "a log of Water Linked's DVL")
STRAY = ("a CSV file", "a DataFlash log", "a telemetry log", "a ULog", "an MCAP file")
"""The formats of the default tests: each has a reader of its own, and one stands for all bags."""


@pytest.mark.parametrize(
    "kind", spread(FORMATS, [one for one in FORMATS if one.name in STRAY], FORMATS), ids=lambda kind: kind.name
)
def test_in_every_format_a_stray_time_is_left_out_and_a_clock_that_is_set_splits_the_log(
    kind: Format, tmp_path: Path
) -> None:
    """By twelve days, which all clocks can show: one of 32 bits counts milliseconds. Makers' files lack commands."""
    has_commands = kind.name not in UNCOMMANDED
    names, _ = names_of(BLUEROV2, RovTables(columns=writers.VARIABLES if kind.name == "a .mat file" else {}))
    days, n = 1e6, np.arange(100)
    stray, later = DIVE.time + days * (n == 60), DIVE.time + days * (n >= 50)
    path = SEEDS[kind.name](tmp_path, replace(DIVE, time=stray))
    read = read_log(path, BLUEROV2, names=names, is_part=not has_commands)
    assert bool(read.log.commands) == has_commands
    assert not read.log.commands or len(read.log.commands.rows) == 99
    assert read.log.channels
    assert all(channel.count == 99 for channel in read.log.channels)
    assert [finding.kind for finding in read.findings].count("stray times") == 1
    (tmp_path / "set").mkdir()
    path = SEEDS[kind.name](tmp_path / "set", replace(DIVE, time=later))
    read = read_log(path, BLUEROV2, names=names, is_part=not has_commands)
    assert [{channel.count for channel in log.channels} for log in read.logs] == [{50}, {50}]
    assert [len(log.commands.rows) for log in read.logs if log.commands] == [50, 50][: 2 * has_commands]
    (told,) = (finding for finding in read.findings if finding.kind == "clock restarts")
    assert float(told.words["at"]) == pytest.approx(4.9, abs=1e-2)


@pytest.mark.parametrize("kind", FORMATS, ids=lambda kind: kind.name)
def test_every_format_is_read_in_the_guarded_process_alone(
    kind: Format, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever a command wants of a file, it gets nothing without a budget. A new format needs a writer in SEEDS."""
    path = SEEDS[kind.name](tmp_path, DIVE)
    assert format_of(path) is kind
    assert bool(kind.open) + bool(kind.read) + bool(kind.unpack) == 1
    with pytest.raises(AssertionError, match="only a guarded function"):
        parsers.open_table(path)
    assert inspect(path, [BLUEROV2])
    monkeypatch.setattr(parsers, "budget_for", lambda _: Limits(time=0.0))
    uses: list[Callable[[], object]] = [
        lambda: read_log(path, BLUEROV2),
        lambda: inspect(path, [BLUEROV2]),
        lambda: header_of(path),
        lambda: parsers.read_topics(path, ()),
        lambda: read_rows(path, "thrust"),
        lambda: read_inputs(path, BLUEROV2),
    ]
    for use in uses:
        with pytest.raises(DataFileError, match="needs more than 0 s to be read"):
            use()
