"""One dive in every format gives the same log: commands as changes, and channels in SI units and the model's frames."""

import shutil
from pathlib import Path

import pytest

from rov_fmu.equation.catalogue import AXES
from rov_fmu.tank.inspection.inspection import inspect
from tests.tank.logs import read_log
from tests.tank.readers import motion, writers
from tests.tank.readers.motion import BLUEROV2, DIVE, LACKING

TOLD = {
    ".csv": [],
    ".tlog": ["time of arrival", "unknown direction"],
    "BlueOS": ["time of arrival", "damaged pieces", "source of commands"],
    ".bin": [],
    "text": [],
    ".ulg": ["unknown direction"],
}
"""The kinds of findings by format but for bags of ROS."""
FORMATS = {**writers.LOGS, ".csv": writers.csv, "text": writers.flash_text, "BlueOS": writers.blueos}


def test_axes_are_the_same_objects_in_what_another_process_read(tmp_path: Path) -> None:
    """They are compared by identity."""
    channels = read_log(writers.csv(tmp_path, DIVE), BLUEROV2).log.channels
    axes = [channel.quantity.axis for channel in channels if channel.quantity.axis]
    assert axes
    assert all(axis is AXES[axis.name] for axis in axes)


@pytest.mark.parametrize("name", FORMATS)
def test_one_dive_is_read_under_any_name(name: str, tmp_path: Path) -> None:
    """What a file contains tells its format. What is listed of it is what was written."""
    path = Path(shutil.copy(FORMATS[name](tmp_path, DIVE), tmp_path / "any.log"))
    read = read_log(path, BLUEROV2)
    motion.check(read.log, lacking=LACKING.get(FORMATS[name], ()))
    assert [finding.kind for finding in read.findings] == TOLD.get(name, ["source of commands", "unknown direction"])
    (one,) = inspect(path, [BLUEROV2])
    written = {f"thruster {name}": (values, 1e-6) for name, values in motion.THRUSTERS.items()} | motion.expected()
    assert [row.name for row in one.commands] == [*written][:6]
    assert [row.unit for row in one.commands] == ["1"] * 6
    for row in (*one.commands, *one.channels):
        values, within = written[row.name]
        if row.name != "heading":  # which wraps
            assert (row.low, row.high) == pytest.approx((values.min(), values.max()), abs=within), row.name
        assert (row.samples, row.gaps) == (100, [])
        assert (row.end - row.start, row.rate) == pytest.approx((9.9, 10.0), abs=1e-3)
