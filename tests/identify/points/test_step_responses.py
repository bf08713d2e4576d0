"""V_ss and Tau from recordings with known coefficients and noise (sections 4.1-4.3, (17))."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.points.step_responses import StepResponse, correlation_time, steps
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.vehicle.vehicle import Vehicle
from tests.recordings import AXES, PLANS, clean


def record(vehicle: Vehicle, axis: Axis, *plan: tuple[float, float], seed: int = 0, **options: float) -> Recording:
    noise = options.pop("noise", None)
    return clean(vehicle.rov, axis, plan, **options).noisy(np.random.default_rng(seed), noise=noise)


@pytest.mark.parametrize("axis", AXES, ids=lambda m: m.name)
@pytest.mark.parametrize("command", [0.2, 0.7, -0.5])
def test_step_from_rest_gives_both(axis: Axis, command: float, vehicle: Vehicle) -> None:
    V_ss, Tau = vehicle.rov.response(axis, command)
    recording = record(vehicle, axis, (0.0, 3.0), (command, 12.0 * Tau + 4.0))
    (step,) = steps(recording)
    assert step.steady is not None
    assert step.steady[1] == recording.time[-1], "what is steady is so to the last sample"
    assert step.steady[0] > 3.0
    assert step.V_ss == pytest.approx(V_ss, rel=0.01)
    assert step.Tau == pytest.approx(Tau, rel=0.1)
    assert (step.start, step.command, step.before, step.note) == (3.0, command, 0.0, "")


@pytest.mark.parametrize("axis", AXES, ids=lambda m: m.name)
def test_steps_up_and_down_in_both_directions(axis: Axis, vehicle: Vehicle) -> None:
    commands = (0.3, 0.7, 0.3, -0.5, -0.7, 0.5)
    found = steps(record(vehicle, axis, (0.0, 3.0), *((c, 20.0) for c in commands)))
    assert [step.command for step in found] == list(commands)
    assert [step.before for step in found] == [0.0, *commands[:-1]]
    for step in found:
        assert step.V_ss == pytest.approx(vehicle.rov.response(axis, step.command)[0], rel=0.01)
        assert (step.Tau is None) == (step.before != 0.0), "Tau (17) is that of a start from rest"


@pytest.mark.parametrize(
    "axis", [YAW, *(pytest.param(a, marks=pytest.mark.long) for a in (SURGE, HEAVE))], ids=lambda m: m.name
)
def test_standard_errors_tell_the_scatter(axis: Axis, vehicle: Vehicle) -> None:
    """Over 8 seeds, about 95 % are within two standard errors, which are not much larger than the scatter."""
    recordings = [clean(vehicle.rov, axis, plan, 50.0) for plan in PLANS[axis.name]]
    found: list[StepResponse] = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        found += [step for recording in recordings for step in steps(recording.noisy(random))]
    true = {step.command: vehicle.rov.response(axis, step.command) for step in found}
    steady = [(s.V_ss - true[s.command][0]) / s.V_ss_error for s in found if s.V_ss is not None and s.V_ss_error]
    taus = [(s.Tau - true[s.command][1]) / s.Tau_error for s in found if s.Tau is not None and s.Tau_error]
    for deviations in (steady, taus):
        assert len(deviations) >= 15
        assert np.mean(np.abs(deviations) < 2.0) > 0.85
        assert 0.4 < np.std(deviations) < 1.3


def test_coloured_noise_widens_the_standard_error(vehicle: Vehicle) -> None:
    """Turbulence that is correlated over about 40 samples increases the error about sqrt(39) times."""
    white = record(vehicle, SURGE, (0.0, 3.0), (0.5, 60.0), noise=0.02)
    random = np.random.default_rng(1)
    rest = record(vehicle, SURGE, (0.0, 3.0), (0.5, 60.0), noise=0.0)
    colour = lfilter([0.02 * np.sqrt(1.0 - 0.95**2)], [1.0, -0.95], random.standard_normal(len(rest.values)))
    (plain,), (turbulent,) = steps(white), steps(replace(rest, values=rest.values + colour))
    assert plain.V_ss_error
    assert turbulent.V_ss_error
    assert 3.0 < turbulent.V_ss_error / plain.V_ss_error < 12.0


def test_hold_too_short_for_a_steady_state_has_none(vehicle: Vehicle) -> None:
    (step,) = steps(record(vehicle, HEAVE, (0.0, 3.0), (0.3, 3.0)))
    assert (step.V_ss, step.Tau) == (None, None)
    assert "to tell whether the velocity still changes" in step.note
    (step,) = steps(record(vehicle, HEAVE, (0.0, 3.0), (0.3, 3.0), noise=0.0))
    assert step.note == "the velocity still changes at the end: no V_ss"
    (step,) = steps(record(vehicle, HEAVE, (0.0, 3.0), (0.3, 0.1)))
    assert step.note == "too short"


def test_motion_against_the_command_is_no_response(vehicle: Vehicle) -> None:
    recording = record(vehicle, HEAVE, (0.0, 3.0), (0.5, 15.0))
    (step,) = steps(replace(recording, values=-recording.values))
    assert step.V_ss is None
    assert "against the command" in step.note


def test_spikes_and_gaps_do_not_matter(vehicle: Vehicle) -> None:
    recording = record(vehicle, HEAVE, (0.0, 3.0), (0.5, 15.0))
    random = np.random.default_rng(7)
    values = recording.values.copy()
    values[random.choice(len(values), 40, replace=False)] += 3.0
    values[random.choice(len(values), 300, replace=False)] = np.nan
    (step,), (clear,) = steps(replace(recording, values=values)), steps(recording)
    assert step.V_ss == pytest.approx(clear.V_ss, rel=0.005)
    assert step.Tau == pytest.approx(clear.Tau, rel=0.05)


@pytest.mark.parametrize("rate", [10.0, 250.0])
def test_any_rate(rate: float, vehicle: Vehicle) -> None:
    V_ss, Tau = vehicle.rov.response(YAW, 0.5)
    (step,) = steps(record(vehicle, YAW, (0.0, 4.0), (0.5, 16.0), rate=rate))
    assert step.V_ss == pytest.approx(V_ss, rel=0.01)
    assert step.Tau == pytest.approx(Tau, rel=0.05)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlation_time_of_first_order_noise(rho: float) -> None:
    noise = lfilter([1.0], [1.0, -rho], np.random.default_rng(2).standard_normal(50_000))
    assert correlation_time(noise) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.12)


@pytest.mark.parametrize("residuals", [[0.0] * 50, [0.5] * 50, [1.0, -1.0], [2.0]])
def test_residuals_that_tell_no_correlation_count_as_white(residuals: list[float]) -> None:
    assert correlation_time(np.array(residuals)) == 1.0
