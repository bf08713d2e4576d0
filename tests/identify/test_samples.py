"""How many samples a recording needs: twenty, blanks not counted."""

import shutil
from pathlib import Path

import pytest

from checks.commands import TESTS
from rov_fmu.files.csv_table import DataFileError
from rov_fmu.identify.tank_tests import load_tank_tests


@pytest.mark.parametrize("samples", [19, 20])
def test_twenty_samples_are_enough(samples: int, tmp_path: Path) -> None:
    shutil.copytree(TESTS, tmp_path / "tests")
    rows = [f"{0.1 * n:g},30,{0.01 * n:g}" for n in range(samples)] + ["5,30,"]
    log = tmp_path / "tests" / "log_heave.csv"
    log.write_text("\n".join(("time [s],command [%],depth [m]", *rows)), encoding="utf-8")
    if samples < 20:
        with pytest.raises(DataFileError, match="19 samples of depth, at least 20 are needed"):
            load_tank_tests(log.parent)
    else:
        (recording,) = load_tank_tests(log.parent).recordings["heave"]
        assert len(recording.values) == 21
