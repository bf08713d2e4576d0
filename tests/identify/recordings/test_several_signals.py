"""Two sensors of one axis, each with its own rate and noise, are fitted together. DOP853 integrates the truth."""

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.pool import run

TRUTH = load_vehicle(VIDEORAY).rov
PLAN = ((0.0, 2.0), (0.4, 8.0), (-0.4, 8.0), (0.6, 6.0), (-0.6, 6.0))
POSITIONS = {HEAVE: "depth", YAW: "heading", SURGE: "distance"}


def names(m: Axis) -> list[str]:
    return [m.coefficient(key) for key in ("a_d", "b_d", "beta")]


def base(m: Axis) -> Rov:
    return TRUTH.replaced(dict.fromkeys(names(m), 1.0))


def recorded(m: Axis, seed: int, file: str = "log.csv", *, current: float = 0.0) -> tuple[Recording, Recording]:
    """Return a position at 5 Hz and a velocity at 20 Hz of the same motion; the velocity has half the usual noise."""
    random = np.random.default_rng(seed)
    slow, fast = (run(TRUTH, m, PLAN, rate, current=current) for rate in (5.0, 20.0))
    return slow.recorded(random, POSITIONS[m], file), fast.recorded(random, "velocity", file, noise=0.5)


def fitted(m: Axis, *recordings: Recording) -> RecordingsFit:
    (fit,) = fit_recordings(recordings, base(m))
    return fit


@pytest.mark.parametrize(
    "m", [HEAVE, *(pytest.param(m, marks=pytest.mark.long) for m in (SURGE, YAW))], ids=lambda m: m.name
)
def test_a_position_and_a_velocity_of_one_axis_add_their_information(m: Axis) -> None:
    covered = []
    for seed in range(4):
        position, velocity = recorded(m, seed)
        both = fitted(m, position, velocity).estimate
        alone = [fitted(m, signal).estimate for signal in (position, velocity)]
        for name in names(m):
            least = min(found.errors[name] for found in alone)
            assert both.errors[name] < 1.05 * least, (seed, name)
            low, high = both.intervals[name]
            covered.append(low <= TRUTH[name] <= high)
    assert sum(covered) >= len(covered) - 3, "95 % of 12 intervals; a_d and b_d miss together"


def test_each_signal_has_its_own_noise_and_samples() -> None:
    position, velocity = recorded(HEAVE, 0)
    depth, w = fitted(HEAVE, position, velocity).simulations
    assert (len(depth.time), len(w.time)) == (150, 600)
    assert (depth.noise, w.noise) == pytest.approx((0.005, 0.01), rel=0.15)


def test_signals_of_one_file_share_its_load_and_delay() -> None:
    """What a file adds to the load or delay of its axis is one parameter for both of its signals."""
    signals = [signal for n in range(2) for signal in recorded(HEAVE, n, f"log_{n}.csv")]
    fit = fitted(HEAVE, *signals)
    for kind in ("load", "delay"):
        assert [effect.of for effect in fit.effects if effect.kind == kind] == ["heave", "log_1.csv"]


def test_signals_of_one_file_share_its_current() -> None:
    fit = fitted(SURGE, *recorded(SURGE, 0, current=0.1))
    (current,) = [effect for effect in fit.effects if effect.kind == "current"]
    assert current.kept
    assert current.interval
    assert current.interval[0] < 0.1 < current.interval[1]
