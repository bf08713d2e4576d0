"""Commands that switch between the rows of a log: their times are unknown, and the fit allows for it where they are."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.switches import _LARGEST, _gains, _share, _whitened, _without_fit
from rov_fmu.identify.simulation.linear_response import LinearResponse
from rov_fmu.model.layout import HEAVE
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
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


SCATTER = {"at rows": 0.0, "near rows": 0.01, "between rows": 0.2 / np.sqrt(12.0)}
"""The standard deviation of the times of the switches, s."""


def switches(seed: int, where: str) -> Array:
    """Return the times of the switches: at rows, near rows because time stamps have errors, or at any time."""
    random, rows = np.random.default_rng(seed), 6.0 * np.arange(len(LEVELS))
    if where == "between rows":
        early = random.uniform(0.0, 0.2, len(rows))
    else:
        early = SCATTER[where] * np.abs(random.standard_normal(len(rows)))  # the row after the switch is the first one
    return np.asarray(np.maximum(rows - early, 0.0))


@pytest.mark.parametrize(
    "where", ["between rows", *(pytest.param(w, marks=pytest.mark.long) for w in ("at rows", "near rows"))]
)
def test_unknown_times_are_allowed_for_where_they_are_unknown(k: Rov, where: str) -> None:
    recordings = [recording(k, switches(seed, where), seed) for seed in range(3)]
    base = k.replaced({"a_d_w": 1.0, "b_d_w": 1.0, "beta_w": 1.0})
    (fit,) = fit_recordings(recordings, base)
    assert fit.between_rows == (where == "between rows")
    for name in ("a_d_w", "b_d_w", "beta_w"):
        assert abs(fit.estimate[name] - k[name]) < 4.0 * fit.estimate.errors[name]
        assert fit.estimate.errors[name] < 0.02 * k[name]
    assert [s.noise for s in fit.simulations] == pytest.approx([NOISE] * 3, rel=0.2)
    assert all(effect.kind == "delay" and abs(effect.value) < 0.02 for effect in fit.effects if effect.kept)


def test_a_few_pieces_with_another_misfit_do_not_decide() -> None:
    """One recording of ten has residuals that look like unknown times of switches."""
    random, S = np.random.default_rng(0), np.zeros((200, 4))
    for n in range(4):
        S[40 * (n + 1) :, n] = 5.0
    pieces = [random.standard_normal(200) for _ in range(10)]
    pieces[3] = pieces[3] + S @ np.array([1.0, -1.0, 1.0, -1.0])
    gains = [_gains(white) for piece in pieces if (white := _whitened(piece, S, np.ones((200, 1)), 1))]
    assert gains[3][-1] > 5.0 * _LARGEST
    assert _share(gains) == 0.0
    assert _share(gains[3:4]) >= 0.4


def test_what_a_fit_has_followed_does_not_hide_the_scatter() -> None:
    """Ten parameters follow the errors of twelve switches, so the residuals show less than there is."""
    random, S = np.random.default_rng(0), np.zeros((400, 6))
    for n in range(6):
        S[50 * (n + 1) :, n] = 20.0
    hidden, shown = [], []
    for _ in range(20):
        J = np.hstack([block_diag(S, S) @ random.standard_normal((12, 10)), random.standard_normal((800, 1))])
        residuals = np.concatenate([S @ random.standard_normal(6) for _ in range(2)]) + random.standard_normal(800)
        residuals -= J @ np.linalg.lstsq(J, residuals)[0]
        parts = [_whitened(residuals[part], S, J[part], 10) for part in (slice(400), slice(400, 800))]
        pieces = [part for part in parts if part]
        assert len(pieces) == 2
        hidden += [_gains(piece) for piece in pieces]
        shown += [_gains(piece) for piece in _without_fit(pieces)]
    assert np.sum(hidden, axis=0).argmax() < len(hidden[0]) - 1
    assert np.sum(shown, axis=0).argmax() == len(shown[0]) - 1
    assert _without_fit([]) == []


@pytest.mark.parametrize("early", [0.0, 0.05, 0.1, 0.17])
def test_the_response_to_a_late_switch_is_that_of_the_equations(k: Rov, early: float) -> None:
    """A shift by one standard deviation is compared with the difference of two solutions."""
    exact, time = switches(0, "at rows"), np.arange(0.0, 60.0, 0.2)
    exact[1:] -= early
    shift = 0.2 / np.sqrt(12.0)
    base, velocity = depth(k, exact, time)
    found = LinearResponse(k, recording(k, exact, 0), time, velocity, 0.0).by_switches(exact[1:])
    assert found.shape == (len(time), len(LEVELS) - 1)
    late = np.array([depth(k, replace_one(exact, n, 0.01 * shift), time)[0] - base for n in range(1, len(exact))])
    for expected, response in zip(sorted(100.0 * late, key=onset), sorted(found.T, key=onset), strict=True):
        assert np.abs(expected - response).max() < 0.06 * np.abs(expected).max()


@pytest.mark.parametrize("early", [0.05, 0.1])
def test_the_response_to_the_square_of_a_time_is_that_of_the_equations(k: Rov, early: float) -> None:
    """The root of the mean square of the square of a time within 0.2 s is that of a fourth power, 0.2^4 / 80."""
    exact, time, h = switches(0, "at rows"), np.arange(0.0, 60.0, 0.2), 0.02
    exact[1:] -= early
    base, velocity = depth(k, exact, time)
    fine = LinearResponse(k, recording(k, exact, 0), time, velocity, 0.0).by_switches(exact[1:], squared=True)
    found = sorted(np.abs(fine).max(axis=0))
    late, soon = (
        np.array([depth(k, replace_one(exact, n, change), time)[0] - base for n in range(1, len(exact))])
        for change in (h, -h)
    )
    expected = sorted(np.abs(late + soon).max(axis=1) / h**2 * 0.5 * 0.2**2 / np.sqrt(80.0))
    assert found == pytest.approx(expected, rel=0.35)  # the rows are coarse


def onset(change: Array) -> int:
    """Return the first sample at which a change is a tenth of its largest value."""
    return int(np.argmax(np.abs(change) > 0.1 * np.abs(change).max()))


def replace_one(values: Array, n: int, change: float) -> Array:
    """Return values of which one is larger."""
    found = values.copy()
    found[n] += change
    return found
