"""One dive in every format gives the same log: commands as changes, and channels in SI units and the model's frames."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import Names, names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.read_log import read_logs
from tests.tank.readers import writers
from tests.tank.readers.motion import BLUEROV2, LACKING, check
from tests.tank.readers.writers import Dive

N = 60
TIME: Array = np.linspace(0.0, 0.1 * (N - 1), N)
FORMATS: dict[str, Callable[[Path, Dive], Path]] = {
    "CSV": writers.csv,
    "MATLAB": writers.mat,
    "telemetry": writers.tlog,
    "BlueOS": writers.blueos,
    "DataFlash": writers.flash,
    "ULog": writers.ulog,
    "ROS 1": writers.bag(".bag"),
    "ROS 2": writers.bag(".mcap"),
}


@st.composite
def dives(draw: st.DrawFn) -> Dive:
    """Draw a dive: switches of the thrusters, and a motion of slow waves."""
    pulses = np.full((N, 6), 1500.0)
    change = st.tuples(st.integers(1, N - 1), st.integers(0, 5), st.integers(1100, 1900))
    for row, thruster, pulse in draw(st.lists(change, min_size=1, max_size=12)):
        pulses[row:, thruster] = pulse
    waves = []
    for largest in (0.6, 0.4, 3.0, 1.5, 0.8, 0.5):
        size, rate, phase = (draw(st.floats(low, high)) for low, high in ((0.05, 1.0), (0.2, 1.5), (0.0, 6.0)))
        waves.append(largest * size * np.sin(rate * TIME + phase))
    motion = np.column_stack(waves)
    voltage = np.round(draw(st.floats(12.0, 16.0)) - 0.01 * TIME, 3)
    return Dive(draw(st.integers(1, 4000)) * 0.5, pulses, motion[:, :3], motion[:, 3:], voltage, TIME)


@pytest.mark.parametrize("examples", [2, pytest.param(25, marks=pytest.mark.long)])
def test_one_dive_gives_the_same_log_in_every_format(examples: int) -> None:
    settings(max_examples=examples, suppress_health_check=[HealthCheck.too_slow])(given(dive=dives())(read_all))()


def read_all(dive: Dive) -> None:
    """Write a dive in every format, and check what is read."""
    matlab, _ = names_of(BLUEROV2, RovTables(columns={f"log.{name}": title for name, title in writers.MATLAB.items()}))
    with TemporaryDirectory() as folder:
        for name, write in FORMATS.items():
            (log,) = read_logs(write(Path(folder), dive), BLUEROV2, matlab if name == "MATLAB" else Names())
            try:
                check(log, dive, LACKING.get(write, ()))
            except AssertionError as error:
                raise AssertionError(f"{name}: {error}") from error
