"""The gate of equal bits: it finds the smallest difference."""

import re
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from click.testing import CliRunner

from verification.checkouts import ROOT, copy_checkout
from verification.same_bits import STEPS, Flight, differences, main, random_runs


def test_the_smallest_difference_is_found(videoray_dir: Path, videoray3_dir: Path) -> None:
    for folder in (videoray_dir, videoray3_dir):
        description = fmpy.read_model_description(str(folder))
        flight = Flight(folder, description)
        (run,) = random_runs(description, 1)
        old = flight.fly(run)
        assert np.isfinite(old).all()
        assert len(old) == STEPS + 1
        assert differences(flight.columns, [(old, flight.fly(run))]) == []
        name = next(name for name, value in run.steps[3].values.items() if value)
        values = {**run.steps[3].values, name: np.nextafter(run.steps[3].values[name], np.inf)}
        new = flight.fly(replace(run, steps=[*run.steps[:3], replace(run.steps[3], values=values), *run.steps[4:]]))
        lines = differences(flight.columns, [(old, old), (old, new)])
        assert any(line.startswith(f"  {name} differs in 1 runs, by") and line.endswith("first in 1") for line in lines)


@pytest.mark.long
def test_a_changed_rounding_is_found(tmp_path: Path) -> None:
    changed = copy_checkout(tmp_path) / "fmu_src" / "c" / "series.c"
    text = changed.read_text(encoding="utf-8")
    assert "1.0 / 3.0," in text
    changed.write_text(text.replace("1.0 / 3.0,", "1.0 / (3.0 + 1e-15),"), encoding="utf-8")
    arguments = [str(ROOT), str(tmp_path), "--vehicle", "videoray", "--fmi", "2", "--runs", "3"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1
    assert result.output.startswith("videoray, FMI 2.0: 3 runs, 0 with equal bits; a call fails in 0 runs of OLD\n")
    # Which variables differ depends on how the compiler of this machine contracts products.
    assert re.search(r"^  \S+ differs in \d runs, by \d", result.output, re.MULTILINE)
