"""The gate of equal bits: it finds the smallest difference."""

import re
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from click.testing import CliRunner

from tests.commands import ROOT
from verification.new_tests import copy_checkout
from verification.same_bits import STEPS, Runs, differences, main, random_runs, trajectories


def _described(folder: Path) -> tuple[list[str], list[str], Runs]:
    description = fmpy.read_model_description(str(folder))
    unknowns = [unknown.variable.name for unknown in description.derivatives]
    return [v.name for v in description.modelVariables], unknowns, random_runs(description, 4)


def test_the_smallest_difference_is_found(videoray_dir: Path, videoray3_dir: Path) -> None:
    for folder in (videoray_dir, videoray3_dir):
        names, unknowns, runs = _described(folder)
        old = trajectories(folder, names, unknowns, runs)
        assert np.isfinite(old[1]).all()
        assert (old[0] == STEPS + 1).all()
        columns = [*names, *unknowns]
        assert differences(columns, old, trajectories(folder, names, unknowns, runs)) == ([], 4)
        place = (2, 3, np.flatnonzero(~np.isnan(runs.values[2, 3]))[-1])
        values = runs.values.copy()
        values[place] = np.nextafter(values[place], np.inf)
        new = trajectories(folder, names, unknowns, replace(runs, values=values))
        lines, equal = differences(columns, old, new)
        assert equal == 3
        assert lines
        assert all("differs in 1 runs" in line for line in lines)


@pytest.mark.long
def test_a_changed_rounding_is_found(tmp_path: Path) -> None:
    changed = copy_checkout(tmp_path) / "fmu_src" / "c" / "series.c"
    text = changed.read_text(encoding="utf-8")
    assert "1.0 / 3.0," in text
    changed.write_text(text.replace("1.0 / 3.0,", "1.0 / (3.0 + 1e-15),"), encoding="utf-8")
    arguments = [str(ROOT), str(tmp_path), "--vehicle", "videoray", "--fmi", "2", "--runs", "3"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1
    assert result.output.startswith("videoray, FMI 2.0: 3 runs, 0 with equal bits; a call fails in 0 and 0 runs\n")
    # Which variables differ depends on how the compiler of this machine contracts products.
    assert re.search(r"^  \S+ differs in \d runs, by \d", result.output, re.MULTILINE)
