"""The gate of equal bits: it finds the smallest difference."""

from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np

from verification.same_bits import STEPS, Flight, differences, random_runs


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
