"""One dive in five formats is inspected, identified, flown and written as MCAP, and the five results agree."""

from math import radians
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.cli import main
from rov_fmu.report.page.recording import recording_of, topic_name
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.bridges.test_mcap import messages
from tests.dives import NOISE, TRUTH
from tests.dives import dive as sticks
from tests.tank.readers.test_one_dive import FORMATS, Dive
from verification.references.pool import swim

CHOSEN = ("CSV", "BlueOS", "DataFlash", "ULog", "ROS 2")
ROV = """base = "bluerov2"
[vehicle]
name = "BlueROV2"
identifier = "mine"
version = "1.0"
description = "An ROV with a log"
source = "A dive"
"""


def simulated(seconds: float) -> Dive:
    """Return a dive of a BlueROV2 with the noise of its sensors, simulated by the equations written separately."""
    random, planned = np.random.default_rng(4), sticks(seconds)
    time, names = planned.rows, planned.thrusters
    pulses = np.round(1500.0 + 400.0 * planned.at(time))
    moved = swim(TRUTH, time, dict(zip(names, (pulses.T - 1500.0) / 400.0, strict=True)))
    velocity, zero = np.column_stack([moved[name] for name in "uvw"]), np.zeros_like(time)
    velocity[:, :2] += NOISE["velocity"] * random.standard_normal((len(time), 2))
    heading = moved["psi"] + radians(0.3) * random.standard_normal(len(time))
    euler, noise = np.column_stack([zero, zero, heading]), NOISE["depth"] * random.standard_normal(len(time))
    return Dive(100.0, pulses, euler, velocity, zero + 16.0, time, noise)


def through_all(folder: Path, log: Path, capsys: pytest.CaptureFixture[str]) -> Vehicle:
    """Inspect, identify and fly a log, check what is written as MCAP, and return the identified vehicle."""
    assert main(["identify", str(log), "--inspect"]) == 0
    content = capsys.readouterr().out
    assert all(word in content for word in ("depth", "heading", "surge velocity"))
    (folder / "rov.toml").write_text(ROV, encoding="utf-8")
    file, mcap, page = folder / "mine.toml", folder / "out" / "logs.mcap", folder / "page.html"
    mcap.parent.mkdir()
    assert main(["identify", str(folder), "-o", str(file), "--mcap", str(mcap)]) == 0
    assert main(["fly", str(file), "--recording", str(log), "--identified", str(mcap), "-o", str(page)]) == 0
    recording = recording_of(log, load_vehicle(file), mcap)
    for signal in recording["signals"]:
        written = messages(mcap.read_bytes())[f"/{topic_name(log.name)}/{topic_name(signal['quantity'])}"]
        measured = [values["measured"] for _, values in written]
        assert np.cos(measured) == pytest.approx(np.cos(signal["values"]), abs=1e-6)
        assert np.isfinite(signal["band"]["values"]).all()
    return load_vehicle(file)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_dive_in_five_formats_gives_one_vehicle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dive = simulated(60.0)
    found = []
    for name in CHOSEN:
        folder = tmp_path / name.replace(" ", "_")
        folder.mkdir()
        found.append(through_all(folder, FORMATS[name](folder, dive), capsys))
    identified = {name for name, interval in found[0].intervals.items() if interval}
    assert {"a_d_u", "a_d_w", "beta_u", "beta_w"} <= identified
    for name in identified:
        lows, highs = zip(*(one.intervals[name] for one in found), strict=True)
        assert max(lows) <= TRUTH[name] <= min(highs), name
