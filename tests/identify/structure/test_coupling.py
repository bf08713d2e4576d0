"""A vehicle file that leaves coupling out is named, and so is what a single recording adds to its axis."""

from dataclasses import replace

import numpy as np
import pytest

from rov_fmu.identify.diagnostics import on_coupling
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.recordings.recordings_fit import FittedEffect
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.report.console_results import acting_words
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.recording import Recording
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


def test_what_a_recording_adds_is_not_taken_for_the_whole() -> None:
    """A delay of a single recording comes on top of that of its axis."""
    of_axis = Finding("delay", "surge", names={"unit": "s", "of": "surge"}, numbers={"value": 0.2})
    of_file = Finding("delay", "surge", file="a.csv", names={"unit": "s"}, numbers={"value": 0.05})
    whole, more = sentences([of_axis, of_file])
    assert whole.startswith("surge: the motion of surge follows the commands 0.2 s late;")
    assert more.startswith("surge: the motion in a.csv follows the commands 0.05 s later than in the other recordings;")


def test_the_printout_tells_more_or_less_of_a_recording() -> None:
    effects = [
        FittedEffect("delay", of, "s", value, (value - 0.01, value + 0.01), kept=True)
        for of, value in (("surge", 0.2), ("a.csv", 0.05), ("b.csv", -0.05))
    ]
    whole, more, less = acting_words(effects).split(", ")
    assert "more" not in whole
    assert more == "a.csv 0.050 s more"
    assert less == "b.csv 0.050 s less)"
