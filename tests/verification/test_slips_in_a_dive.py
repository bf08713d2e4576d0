"""Slips are recognised in a dive in which all axes move at once."""

from dataclasses import replace

import numpy as np
import pytest

from examples.dive_log import bluerov2, dive
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.slips.search import slips


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=pytest.mark.weekly if n else pytest.mark.long) for n in range(3)]
)
def test_nothing_is_said_of_a_dive_by_hand_with_all_axes_at_once(seed: int) -> None:
    swum, k = dive(240.0, seed), bluerov2()
    outputs = {name: (output - 1500.0) / 400.0 for name, output in swum.outputs.items()}
    random = np.random.default_rng(seed)
    for axis in (form.axis for form in k.layout.axes):
        values = swum.motion[axis.velocity] + 0.01 * random.standard_normal(len(swum.time))
        log = Recording("dive.tlog", axis, "velocity", swum.time, None, values, outputs)
        assert not slips({axis.name: [log]}, k)
        (turned,) = slips({axis.name: [replace(log, values=-values)]}, k)
        assert turned.kind == "wrong sign"
