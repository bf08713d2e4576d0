"""Damaged logs and tables of every format are read, or refused in one line, within a minute and 2 GB."""

from pathlib import Path

import pytest

from rov_fmu.tank.readers.parsers import FORMATS
from tests.often import often
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import SEEDS
from verification.fuzzing.logs import try_damaged


@often("count", 1, 8, 300)
@pytest.mark.parametrize("name", [kind.name for kind in FORMATS])
def test_a_damaged_file_is_read_or_refused_in_one_line(name: str, count: int, tmp_path: Path) -> None:
    path = SEEDS[name](tmp_path, DIVE)
    tried = try_damaged(path, range(count), tmp_path)
    assert tried.read + tried.refused == count
    assert count < 8 or name == "a file that zstd compressed" or tried.read
