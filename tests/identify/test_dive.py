"""Identification from a dive with simultaneous motion in all axes and a current, by an independent integrator."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.effects.current import CurrentEast, CurrentNorth
from rov_fmu.identify.effects.effect import Effect
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.identify.simulation.limits import NoFitError, check_limits, check_thrust, limits
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.identify.simulation.solver import settled, solve
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, YAW
from rov_fmu.model.rov import Rov
from rov_fmu.tank.description import Requests
from tests.dives import CURRENT, LAG, TRUTH, Dive, dive

FILE = "dive.tlog"
FLOW: dict[Effect, float] = {
    kind(FILE): value for kind, value in zip((CurrentNorth, CurrentEast), CURRENT, strict=True)
}
NAMES = tuple(f"{key}_{v}" for v in "uvr" for key in ("a_d", "b_d", "beta"))


@cache
def dived(seconds: float, seed: int = 0) -> Dive:
    return dive(seconds, seed)


def simulator(recordings: tuple[Recording, ...]) -> tuple[Simulator, np.ndarray]:
    """Return a simulator of surge, sway and yaw with the current, and x at the truth."""
    data = tuple(prepare(r, TRUTH) for r in recordings if r.axis is not HEAVE)
    model = Simulator(data, TRUTH, NAMES, tuple(FLOW), np.array([0.01, 0.01, 0.005]))
    return model, model.start(dict(TRUTH.coefficients), FLOW)


@pytest.mark.parametrize("quantity", ["velocity", "distance"])
def test_derivatives_are_those_of_differences(quantity: str) -> None:
    model, x = simulator(dived(20.0).recorded(0.0, quantity=quantity))
    x = x + 0.03 * np.random.default_rng(0).standard_normal(len(x))
    J = model.jacobian(x)
    for n in range(model.shared):
        h = 1e-4 * max(abs(x[n]), 0.1)
        up, down = (model.residuals(x + sign * h * (np.arange(len(x)) == n)) for sign in (1.0, -1.0))
        errors = np.abs((up - down) / (2.0 * h) - J[:, n])
        assert np.abs(J[:, n]).max() > 0.0
        assert np.quantile(errors, 0.99) < 2e-4 * np.abs(J[:, n]).max(), n  # at a reversal the drag has a kink


@pytest.mark.parametrize("quantity", ["velocity", "distance"])
def test_what_a_pool_does_is_what_the_simulator_does(quantity: str) -> None:
    """A distance of the dive is by the trapezoidal rule."""
    model, x = simulator(dived(20.0).recorded(0.0, quantity=quantity))
    x[model.shared :] = 0.0  # from rest
    of_samples = slice(0, model.rows[-1].stop)
    assert np.abs(model.residuals(x)[of_samples]).max() < (1e-4 if quantity == "velocity" else 0.2)
    still = x.copy()
    still[len(NAMES) : model.shared] = 0.0
    assert np.abs(model.residuals(still)).max() > 1.0


@pytest.mark.long
def test_a_short_dive_is_solved_from_afar() -> None:
    model, _ = simulator(dived(60.0).recorded())
    thin = replace(model, data=tuple(d.thinned(300) for d in model.data))
    coefficients = {name: (0.5 if name.startswith("beta") else 2.0) * TRUTH[name] for name in NAMES}
    with threadpool_limits(1, user_api="blas"):  # as in fit_recordings()
        found = solve(thin, thin.start(coefficients, {}), "linear", 1e-6).x
    rov, flow = thin.rov(found), thin.extra_values(found)
    assert [rov[f"beta_{v}"] for v in "uv"] == pytest.approx([1.0, 1.0], rel=0.03)
    for v in "uvr":  # drag at a usual velocity: a_d and b_d are hardly told apart in a minute
        assert rov[f"a_d_{v}"] * 0.5 + rov[f"b_d_{v}"] == pytest.approx(
            TRUTH[f"a_d_{v}"] * 0.5 + TRUTH[f"b_d_{v}"], 0.05
        )
    assert list(flow.values()) == pytest.approx(CURRENT, abs=0.01)


def replace_at(x: np.ndarray, n: int, value: float) -> np.ndarray:
    """Return a copy of x with another value in one place."""
    changed = x.copy()
    changed[n] = value
    return changed


def test_the_search_leaves_an_absurd_velocity_at_the_start() -> None:
    """Drag would stop 700 m/s within a sample, so the distances alone hardly show it: a prior does."""
    model, x = simulator(dived(20.0).recorded(quantity="distance"))
    best = settled(model, x)
    (place,) = model.flights
    n = place.own.start + list(place.flight.start).index("u")
    far = replace_at(best, n, -700.0)
    for _ in range(3):  # as in a search, which settles at each of its steps
        far = settled(model, far)
    assert far[n] == pytest.approx(best[n], abs=0.001)
    assert np.abs(model.deviations_of(place, replace_at(best, n, -700.0))).max() > 500.0
    assert np.abs(model.deviations_of(place, best)).max() < 0.5, "the error of the first velocity hardly matters"


def test_a_fit_at_a_limit_is_refused_with_one_line() -> None:
    """The load is larger than any thrust of the vehicle."""
    model, _ = simulator(dived(20.0).recorded())
    extras = (Load("surge"),)
    x = replace(model, extras=extras).start(dict(TRUTH.coefficients), {})
    check_limits(TRUTH, model.data, NAMES, extras, x)
    _, high = limits(TRUTH, model.data, NAMES, extras, len(x))
    x[len(NAMES)] = high[len(NAMES)]
    with pytest.raises(
        NoFitError,
        match=r"^dive\.tlog: no vehicle with this thrust .* in surge\. The best fit .*: a load of [0-9.]+ N\.",
    ):
        check_limits(TRUTH, model.data, NAMES, extras, x)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"a_t_t200": -60.0}, r"-?[0-9.]+ N at 100%"),
        ({"a_t_t200_reverse": -60.0}, r"[0-9.]+ N at -100%"),
        ({"c_0_t200": -0.056}, r"c_0_t200 = -0\.056"),
    ],
)
def test_a_fitted_thrust_that_is_impossible_is_a_misfit_of_the_recordings(
    changed: dict[str, float], words: str
) -> None:
    """The tables of forces are right, so the line names the recordings and the thrusters."""
    model, _ = simulator(dived(20.0).recorded())
    check_thrust(TRUTH, model.data)
    with pytest.raises(
        NoFitError, match=rf"^dive\.tlog: no possible t200 thrust .* in surge, sway, yaw\. The best fit has {words}\."
    ):
        check_thrust(TRUTH.replaced(changed), model.data)


def unknown() -> Rov:
    """Return the vehicle that a folder with `base = "bluerov2"` and a dive leads to."""
    layout = TRUTH.layout
    axes = tuple(replace(f, keys=tuple(k for k in f.keys if k != "F_0")) for f in layout.axes)
    curves = tuple(replace(c, keys=tuple(k for k in c.keys if k != "T")) for c in layout.curves)
    drag = {f"{key}_{v}": 1.0 for v in "uvwr" for key in ("a_d", "b_d", "beta")}
    return Rov(replace(layout, axes=axes, curves=curves), {**TRUTH.coefficients, **drag})


@pytest.mark.parametrize(
    "seed",
    [pytest.param(1, marks=pytest.mark.long), *(pytest.param(seed, marks=pytest.mark.weekly) for seed in (0, 2))],
)
def test_a_dive_is_identified(seed: int) -> None:
    fits = fit_recordings(dived(240.0, seed).recorded(seed=seed), unknown(), requests=Requests(lag=("t200",)))
    assert [fit.axis for fit in fits] == [SURGE, SWAY, HEAVE, YAW]
    for fit in fits:
        of = fit.axis.velocity
        assert fit.rov[f"a_d_{of}"] == pytest.approx(TRUTH[f"a_d_{of}"], rel=0.07)
        # by hand one turns fast or not at all, which tells little of how long it takes
        assert fit.rov[f"beta_{of}"] == pytest.approx(1.0, rel=0.1 if fit.axis is YAW else 0.05)
        for effect in (e for e in fit.effects if e.kind == "reverse drag" and e.kept):
            assert effect.value == pytest.approx(1.0, abs=0.02), "drag is that of both directions"
        assert fit.held_out.by_halves
        assert all(e.explained > 0.95 for (span, _), e in fit.held_out.errors.items() if span == "10 s")
    assert fits[2].rov["F_0_w"] == pytest.approx(TRUTH["F_0_w"], rel=0.05)
    assert fits[0].rov["T_t200"] == pytest.approx(LAG, abs=0.02)
    assert currents(fits[0]) == pytest.approx(CURRENT, abs=0.005)
    assert not any(currents(fit) for fit in fits[1:]), "it is told once"


def currents(fit: RecordingsFit) -> list[float]:
    return [effect.value for effect in fit.effects if effect.kind in ("current north", "current east")]
