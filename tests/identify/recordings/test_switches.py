"""Commands that switch between the rows of a log: their times are unknown, and the fit allows for it where they are."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.simulation.linear_response import LinearResponse
from rov_fmu.model.layout import HEAVE
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.vehicle.vehicle import Vehicle

LEVELS = (0.0, 0.5, 0.2, 0.7, -0.4, 0.6, 0.0, -0.6, 0.3, -0.3)
NOISE = 0.001


@pytest.fixture
def k(vehicle: Vehicle) -> Rov:
    return vehicle.rov


def depth(k: Rov, switches: Array, time: Array) -> tuple[Array, Array]:
    """Return the depth (m) and the velocity (m/s) in heave of the equations of motion, by DOP853."""
    thrust = [k["alpha_w"] * k.curve_force(k.layout.curve_of["t"], c) for c in LEVELS]
    gain, a, b = k.gain(k.layout.kinds["heave"]), k["a_d_w"], k["b_d_w"]
    state, found = np.zeros(2), np.zeros((2, len(time)))
    ends = [*switches[1:], time[-1] + 1.0]
    for force, begin, end in zip(thrust, switches, ends, strict=True):

        def rates(_: float, y: Array, force: float = force) -> list[float]:
            return [y[1], gain * (force - a * abs(y[1]) * y[1] - b * y[1])]

        inside = (begin <= time) & (time < end)
        solved = solve_ivp(rates, (begin, end), state, "DOP853", np.append(time[inside], end), rtol=1e-10, atol=1e-12)
        found[:, inside], state = solved.y[:, :-1], solved.y[:, -1]
    return found[0], found[1]


def recording(k: Rov, switches: Array, seed: int) -> Recording:
    """Return the log of a dive at 5 rows a second with these times of the switches."""
    time = np.arange(0.0, 60.0, 0.2)
    command = np.array(LEVELS)[np.searchsorted(switches, time, side="right") - 1]
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(time))
    return Recording(f"log_{seed}.csv", HEAVE, "depth", time, command, depth(k, switches, time)[0] + noise)


def switches(seed: int, *, between: bool) -> Array:
    """Return the times of the switches, at rows or at any time."""
    rows = 6.0 * np.arange(len(LEVELS))
    early = np.random.default_rng(seed).uniform(0.0, 0.2, len(rows)) if between else np.zeros(len(rows))
    return np.asarray(np.maximum(rows - early, 0.0))


@pytest.mark.parametrize("between", [False, True])
def test_unknown_times_are_allowed_for_where_they_are_unknown(k: Rov, between: bool) -> None:
    recordings = [recording(k, switches(seed, between=between), seed) for seed in range(3)]
    base = k.replaced({"a_d_w": 1.0, "b_d_w": 1.0, "beta_w": 1.0})
    (fit,) = fit_recordings(recordings, base)
    assert fit.between_rows == between
    assert not [effect for effect in fit.effects if effect.kept]
    for name in ("a_d_w", "b_d_w", "beta_w"):
        assert abs(fit.estimate[name] - k[name]) < 4.0 * fit.estimate.errors[name]
        assert fit.estimate.errors[name] < 0.02 * k[name]


def test_the_response_to_a_late_switch_is_that_of_the_equations(k: Rov) -> None:
    """A shift by one standard deviation is compared with the difference of two solutions."""
    exact, time = switches(0, between=False), np.arange(0.0, 60.0, 0.2)
    shift = 0.2 / np.sqrt(12.0)
    base, velocity = depth(k, exact, time)
    found = LinearResponse(k, recording(k, exact, 0), time, velocity, 0.0).by_switches
    assert found.shape == (len(time), len(LEVELS) - 1)
    late = np.array([depth(k, replace_one(exact, n, 0.01 * shift), time)[0] - base for n in range(1, len(exact))])
    strongest_first = sorted(100.0 * late, key=lambda change: -float(np.abs(change).max()))
    found_first = sorted(found.T, key=lambda change: -float(np.abs(change).max()))
    for expected, response in zip(strongest_first, found_first, strict=True):
        assert np.abs(np.abs(expected) - np.abs(response)).max() < 0.1 * np.abs(expected).max()


def replace_one(values: Array, n: int, change: float) -> Array:
    """Return values of which one is larger."""
    found = values.copy()
    found[n] += change
    return found
