"""Damaged logs and tables of every format are read, or refused in one line, within a minute and 2 GB."""

import subprocess
import sys
from pathlib import Path

import pytest

from rov_fmu.tank.readers.parsers import FORMATS
from tests.often import often
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import SEEDS
from verification.fuzzing.logs import forget_peaks, peak_since, try_damaged


@often("count", 1, 4, 300)
@pytest.mark.parametrize("name", [kind.name for kind in FORMATS])
def test_a_damaged_file_is_read_or_refused_in_one_line(name: str, count: int, tmp_path: Path) -> None:
    path = SEEDS[name](tmp_path, DIVE)
    tried = try_damaged(path, range(count), tmp_path)
    assert tried.read + tried.refused == count
    assert count < 300 or name == "a file that zstd compressed" or tried.read


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell the peak of the memory")
def test_the_memory_is_that_of_the_programs_since_then() -> None:
    def use(size: int) -> None:
        subprocess.run([sys.executable, "-c", f"b'x' * {size}"], check=True)

    size = 3 * 10**8
    use(2 * size)
    before = forget_peaks()
    without = peak_since(before)
    use(size)
    assert peak_since(before) < without + 0.5 * size, "a larger one ended before"
    use(4 * size)
    assert peak_since(before) > without + 2 * size
