"""A log that shows a turning motion needs a vehicle with coupling."""

from dataclasses import replace

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.diagnostics import on_coupling
from rov_fmu.identify.findings import sentences
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

LAYOUT = load_vehicle(SHIPPED["bluerov2"]).layout
UNCOUPLED = replace(LAYOUT, coupled=False)


def recording(axis: Axis, file: str) -> Recording:
    time = np.arange(30.0)
    return Recording(file, axis, "velocity", time, np.sin(time), np.sin(time))


@pytest.mark.parametrize(
    ("logs", "told"),
    [
        ({SURGE: "dive", YAW: "dive"}, True),
        ({SWAY: "dive", YAW: "dive", HEAVE: "dive"}, True),
        ({SURGE: "dive", SWAY: "dive"}, False),
        ({SURGE: "surge", YAW: "yaw", SWAY: "sway"}, False),
    ],
)
def test_a_log_that_turns_and_moves_needs_coupling(logs: dict[Axis, str], told: bool) -> None:
    """Surge and sway without a turn have no Coriolis force, and a log of one axis has no other motion."""
    recordings = {axis.name: [recording(axis, f"{name}.csv")] for axis, name in logs.items()}
    found = [*on_coupling(recordings, UNCOUPLED)]
    assert [finding.file for finding in found] == ["dive.csv"] * told
    assert [*on_coupling(recordings, LAYOUT)] == []
    assert all("`coupling = true`" in sentence for sentence in sentences(found))
