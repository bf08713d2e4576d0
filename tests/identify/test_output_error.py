"""Fits of drag and β to whole recordings: the intervals contain the truth, and disturbances are found."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.tables import TableForces
from rov_fmu.identify.points.thrust_fit import ThrustFit, fit_thrust
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis, Curve
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.vehicle import Vehicle
from tests.recordings import AXES, NOISE, PLANS, clean

COMMANDS = np.linspace(0.2, 0.7, 11)
RATE = 20.0
Disturb = Callable[[Recording, np.random.Generator], Recording]


@pytest.fixture
def k(vehicle: Vehicle) -> Rov:
    return vehicle.rov


def unknowing(k: Rov, m: Axis) -> Rov:
    """Return the vehicle without the coefficients to be fitted."""
    return k.replaced({m.coefficient(kind): 1.0 for kind in ("a_d", "b_d", "beta")})


def only(recordings: Sequence[Recording], base: Rov, **options: Any) -> RecordingsFit:
    """Return the fit of one axis."""
    (fit,) = fit_recordings(each_by_itself(recordings), base, **options)
    return fit


def recorded(k: Rov, m: Axis, seed: int, plans: int = 3) -> list[Recording]:
    """Return recordings of the first plans of an axis, with noise."""
    random = np.random.default_rng(seed)
    return [clean(k, m, plan, RATE).noisy(random) for plan in PLANS[m.name][:plans]]


def each_by_itself(recordings: Sequence[Recording]) -> list[Recording]:
    """Give each recording its own file."""
    return [replace(recording, file=f"log_{n}.csv") for n, recording in enumerate(recordings)]


def steady_error(fit: RecordingsFit, k: Rov) -> float:
    """Return the largest relative error of V_ss over 20-70 %."""
    m = fit.axis
    pairs = [(fit.rov.response(m, c)[0], k.response(m, c)[0]) for c in COMMANDS.tolist()]
    return max(abs(found / true - 1.0) for found, true in pairs)


# ---- Round trip ------------------------------------------------------------------------------------------------------


def round_trip(
    k: Rov, m: Axis, seeds: Sequence[int], disturb: Disturb | None = None, rate: float = RATE
) -> dict[str, float]:
    """Return the share of seeds whose 95 % interval covers the truth; check that V_ss is within 2 % in all."""
    recordings = [clean(k, m, plan, rate) for plan in PLANS[m.name]]
    names = [m.coefficient(kind) for kind in ("a_d", "b_d", "beta")]
    covered: dict[str, list[bool]] = {name: [] for name in names}
    for seed in seeds:
        random = np.random.default_rng(seed)
        noisy = [recording.noisy(random) for recording in recordings]
        fit = only([disturb(r, random) for r in noisy] if disturb else noisy, unknowing(k, m))
        assert steady_error(fit, k) < 0.02
        for name in names:
            low, high = fit.estimate.intervals[name]
            covered[name].append(low <= k[name] <= high)
    return {name: float(np.mean(hits)) for name, hits in covered.items()}


@pytest.mark.parametrize(
    ("m", "seeds", "least"),
    [
        *(pytest.param(m, 12, 0.75, marks=pytest.mark.long) for m in AXES),
        *(pytest.param(m, 100, 0.87, marks=pytest.mark.weekly) for m in AXES),
    ],
    ids=lambda of: getattr(of, "name", of),
)
def test_intervals_cover_the_truth(m: Axis, seeds: int, least: float, k: Rov) -> None:
    """A 95 % interval misses more than 13 of 100 seeds, or more than 3 of 12, once in 1,000 cases; seeds are fixed."""
    shares = round_trip(k, m, range(seeds))
    assert min(shares.values()) >= least, shares


def turbulence(recording: Recording, random: np.random.Generator) -> Recording:
    spread = NOISE[recording.axis.name]
    colour = lfilter([spread], [1.0, -0.95], random.standard_normal(len(recording.values)))
    return replace(recording, values=recording.values + colour)


def outliers(recording: Recording, random: np.random.Generator) -> Recording:
    n = len(recording.values)
    far = 100.0 * NOISE[recording.axis.name] * random.standard_normal(n) * (random.random(n) < 0.03)
    return replace(recording, values=recording.values + far)


@pytest.mark.parametrize(
    "seeds", [pytest.param(15, marks=pytest.mark.long), pytest.param(40, marks=pytest.mark.weekly)]
)
@pytest.mark.parametrize("disturb", [turbulence, outliers])
def test_intervals_hold_with_coloured_noise_and_outliers(disturb: Disturb, k: Rov, seeds: int) -> None:
    shares = round_trip(k, HEAVE, range(seeds), disturb, 100.0)
    assert min(shares.values()) >= 0.8, shares


def test_outliers_hardly_move_a_robust_fit(k: Rov) -> None:
    random = np.random.default_rng(0)
    recordings = [outliers(recording, random) for recording in recorded(k, HEAVE, 0, plans=1)]
    robust, plain = (only(recordings, unknowing(k, HEAVE), loss=loss) for loss in ("huber", "linear"))
    assert robust.estimate.errors["b_d_w"] < 0.3 * plain.estimate.errors["b_d_w"]
    for name, (low, high) in robust.estimate.intervals.items():
        assert low <= k[name] <= high
    assert all(s.outliers > 0.02 * len(s.time) for s in robust.simulations)


@pytest.mark.long
def test_coloured_noise_widens_the_intervals(k: Rov) -> None:
    random = np.random.default_rng(0)
    white = [clean(k, YAW, plan).noisy(random) for plan in PLANS["yaw"]]
    plain, coloured = (only(r, unknowing(k, YAW)) for r in (white, [turbulence(w, random) for w in white]))
    assert [s.correlation_time for s in plain.simulations] == pytest.approx([1.0] * 3, abs=0.1)
    assert all(s.correlation_time > 20.0 for s in coloured.simulations)
    assert coloured.estimate.errors["a_d_r"] > 5.0 * plain.estimate.errors["a_d_r"]


# ---- Recordings of all kinds -----------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("rate", [10.0, 33.0, 400.0])
def test_any_rate(rate: float, k: Rov) -> None:
    fit = only([clean(k, YAW, PLANS["yaw"][0], rate).noisy(np.random.default_rng(1))], unknowing(k, YAW))
    assert steady_error(fit, k) < 0.005
    assert fit.rov["beta_r"] == pytest.approx(k["beta_r"], rel=0.01)


def test_gaps_an_uneven_clock_and_a_start_in_motion(k: Rov) -> None:
    whole = clean(k, HEAVE, PLANS["heave"][0])
    random = np.random.default_rng(2)
    recording = whole.noisy(random)
    some = np.sort(random.choice(np.arange(700, 6000), 3000, replace=False))  # from 7 s on, in the middle of a step
    values = recording.values[some].copy()
    values[:40] = np.nan
    values[random.choice(len(values), 500, replace=False)] = np.nan
    time = recording.time[some] - recording.time[some[0]]
    assert recording.command is not None
    cut = replace(recording, time=time, command=recording.command[some], values=values)
    fit = only([cut], unknowing(k, HEAVE))
    assert steady_error(fit, k) < 0.01
    assert fit.rov["beta_w"] == pytest.approx(k["beta_w"], rel=0.01)
    assert len(fit.simulations[0].time) == 3000 - np.isnan(values).sum()


def test_a_first_stamp_long_before_the_others(k: Rov) -> None:
    """Both halves of a recording have as many samples, but not the same duration."""
    recording = clean(k, HEAVE, PLANS["heave"][0], 5.0).noisy(np.random.default_rng(2))
    early = np.concatenate([[-900.0], recording.time[1:]])
    fit = only([replace(recording, time=early)], unknowing(k, HEAVE))
    assert fit.held_out.by_halves
    assert [len(p.time) > 100 for p in fit.held_out.predictions] == [True, True]


def test_command_that_never_rests(k: Rov) -> None:
    """A joystick gives another command at every sample."""
    rate, time = 50.0, np.arange(2000) / 50.0
    commands = 0.45 * np.sin(0.4 * time) + 0.25 * np.sin(1.3 * time)
    recording = clean(k, SURGE, [(c, 1.0 / rate) for c in commands.tolist()], rate).noisy(np.random.default_rng(3))
    fit = only([recording], unknowing(k, SURGE))
    for name, (low, high) in fit.estimate.intervals.items():
        assert low <= k[name] <= high
    assert steady_error(fit, k) < 0.02


def test_sensors_of_two_kinds_weigh_by_their_noise(k: Rov) -> None:
    """A noisy camera in addition to a good depth gauge hardly changes the fit; each has its own noise."""
    depth, other = recorded(k, HEAVE, 4, plans=1)[0], clean(k, HEAVE, PLANS["heave"][1], RATE)
    values = other.velocity + 0.2 * np.random.default_rng(5).standard_normal(len(other.velocity))
    camera = replace(depth, quantity="velocity", command=other.command, values=values)
    alone, both = (only(r, unknowing(k, HEAVE)) for r in ([depth], [depth, camera]))
    assert both.simulations[1].noise == pytest.approx(0.2, rel=0.05)
    assert both.simulations[0].noise == pytest.approx(0.005, rel=0.05)
    assert both.estimate.errors["beta_w"] == pytest.approx(alone.estimate.errors["beta_w"], rel=0.3)


def test_what_is_known_is_kept(k: Rov) -> None:
    fit = only(recorded(k, YAW, 5, plans=1), unknowing(k, YAW).replaced({"b_d_r": k["b_d_r"]}), known=("b_d_r",))
    assert fit.estimate.names == ("a_d_r", "beta_r")
    assert fit.rov["b_d_r"] == k["b_d_r"]
    assert fit.rov["a_d_r"] == pytest.approx(k["a_d_r"], rel=1e-3)


def thrust_test(k: Rov, thruster: str, spread: float, seed: int) -> ThrustFit:
    """Return the fit to a bollard pull with a noisy sensor."""
    commands = np.arange(0.1, 0.81, 0.1)
    measured = k[f"a_t_{thruster}"] * commands**2 + k[f"b_t_{thruster}"] * commands
    noise = spread * np.random.default_rng(seed).standard_normal(len(commands))
    return fit_thrust(Curve(thruster), commands, measured + noise)


def forces_of(fit: ThrustFit) -> list[TableForces]:
    """Return the forces of a fit as residuals of the fit to recordings."""
    table = TableForces.of(fit)
    assert table is not None
    return [table]


def test_scale_of_uncertain_thrust_is_that_of_drag(k: Rov) -> None:
    """A common error of thrust of 5 % goes into drag and β, but not into V_ss.

    The motion tells the shape of the curve much better than the forces, which then only tell its scale: forces F with
    the standard error s tell it to s / |F|.
    """
    commands = np.arange(0.1, 0.81, 0.1)
    names = ("a_t_rear", "b_t_rear")
    F = k["a_t_rear"] * commands**2 + k["b_t_rear"] * commands
    start = Estimate(names, np.array([k[name] for name in names]), np.eye(2), 6.0, 1.0)
    thrust = TableForces("rear", commands, F, 0.05 * float(np.linalg.norm(F)), start)
    fit = only(recorded(k, YAW, 6, plans=1), unknowing(k, YAW), forces=[thrust])
    for name in ("a_t_rear", "a_d_r", "b_d_r", "beta_r"):
        assert fit.estimate.errors[name] == pytest.approx(0.05 * k[name], rel=0.05)
    low, high, *_ = fit.band(COMMANDS)
    assert (high - low < 0.001 * high).all()


def test_recordings_mend_the_shape_of_the_thrust_curve(k: Rov) -> None:
    """A force sensor with 0.05 N noise gives a wrong thrust at 20 %; motion under many commands corrects it."""
    recordings, thrust = recorded(k, HEAVE, 7), thrust_test(k, "top", 0.05, 3)
    base = unknowing(k, HEAVE).replaced(thrust.estimate.named)
    taken, mended = only(recordings, base), only(recordings, base, forces=forces_of(thrust))
    assert mended.estimate.errors["b_t_top"] < 0.1 * thrust.estimate.errors["b_t_top"]
    assert steady_error(mended, k) < 0.1 * steady_error(taken, k)


def test_surge_and_yaw_share_the_thrust_of_the_rear_pair(k: Rov) -> None:
    recordings = [*recorded(k, SURGE, 8, plans=1), *recorded(k, YAW, 8, plans=1)]
    thrust = thrust_test(k, "rear", 0.3, 4)
    base = unknowing(unknowing(k, SURGE), YAW).replaced(thrust.estimate.named)
    surge, yaw = fit_recordings(each_by_itself(recordings), base, forces=forces_of(thrust))
    assert surge.rov == yaw.rov
    assert surge.estimate.names == ("a_t_rear", "b_t_rear", "a_d_u", "b_d_u", "beta_u")
    assert yaw.estimate.names == ("a_t_rear", "b_t_rear", "a_d_r", "b_d_r", "beta_r")
    for fit in (surge, yaw):
        assert steady_error(fit, k) < 0.005
        assert {s.recording.axis.name for s in fit.simulations} == {fit.axis.name}
        for name, (low, high) in fit.estimate.intervals.items():
            assert low <= k[name] <= high, name


# ---- What else acts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.weekly) for seed in (1, 2))])
def test_nothing_is_found_in_clean_recordings(seed: int, k: Rov) -> None:
    """Each effect is left at zero, except in one of twenty cases."""
    fit = only(recorded(k, HEAVE, seed), unknowing(k, HEAVE))
    assert {effect.kind for effect in fit.effects} == {"load", "delay", "dead band", "reverse thrust", "reverse drag"}
    kept = {effect.kind: effect.value for effect in fit.effects if effect.kept}
    assert kept.keys() <= {"load", "delay"}
    assert abs(kept.get("load", 0.0)) < 1e-3
    assert abs(kept.get("delay", 0.0)) < 5e-3
    assert fit.rov.layout == k.layout or "load" in kept


def test_band_encloses_the_truth(k: Rov) -> None:
    fit = only(recorded(k, SURGE, 12), unknowing(k, SURGE))
    low, high, early, late = fit.band(COMMANDS)
    truth = np.array([k.response(SURGE, c) for c in COMMANDS.tolist()])
    assert ((low < truth[:, 0]) & (truth[:, 0] < high)).all()
    assert ((early < truth[:, 1]) & (truth[:, 1] < late)).all()
    assert ((high - low) < 0.01 * truth[:, 0]).all()


def test_each_step_of_a_search_is_reported(k: Rov) -> None:
    shown: list[tuple[str, float]] = []
    fit = only(recorded(k, SURGE, 0), unknowing(k, SURGE), on_progress=lambda step, share: shown.append((step, share)))
    chosen = len(shown)
    assert fit.held_out.predictions
    assert len(shown) > chosen > 5, "the predictions are a search too"
    assert shown[0][0] == "recordings of surge, step 1"
    shares = [share for _, share in shown]
    assert shares == sorted(shares)
    assert 0.0 < shares[0] <= shares[-1] < 1.0
