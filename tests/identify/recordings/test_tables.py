"""Tables of points and of forces take part in the fit to recordings. The truth is integrated with DOP853."""

import re
from functools import cache
from math import exp

import numpy as np
import pytest

from rov_fmu.identify.diagnostics import on_forces
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.response_fit import fit_response
from rov_fmu.identify.points.tables import TableForces, TablePoints
from rov_fmu.identify.points.thrust_fit import fit_thrust
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.model.layout import HEAVE, Curve
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.pool import NOISE, run, with_more

TRUTH = load_vehicle(VIDEORAY).rov
NAMES = ("a_d_w", "b_d_w", "beta_w")
UNKNOWN = TRUTH.replaced(dict.fromkeys(NAMES, 1.0))
COMMANDS = tuple(np.linspace(0.2, 0.8, 7).tolist())
PLAN = ((0.0, 2.0), (0.4, 8.0), (-0.4, 8.0), (0.5, 6.0), (-0.5, 6.0))
ERROR = 0.02
RATE = 200.0


@cache
def responses(command: float) -> tuple[float, float]:
    """Return V_ss and Tau by integration from rest."""
    swum = run(TRUTH, HEAVE, ((command, 25.0),), RATE)
    V_ss = float(swum.velocity[-1])
    return V_ss, float(np.interp((1.0 - exp(-1.0)) * V_ss, swum.velocity, swum.time))


def table(seed: int, scale: float = 1.0) -> TablePoints:
    """Return points with random relative errors, and a common factor of V_ss."""
    random = np.random.default_rng(seed)
    points = []
    for command in COMMANDS:
        V_ss, Tau = responses(command)
        for quantity, value in (("V_ss", scale * V_ss), ("Tau", Tau)):
            measured = value * (1.0 + ERROR * random.standard_normal())
            points.append(Point(quantity, command, measured, 1.0, "table"))
    found = TablePoints.of(fit_response(HEAVE, points, UNKNOWN))
    assert found is not None
    return found


@cache
def fitted(seed: int, *, tables: bool, scale: float = 1.0) -> RecordingsFit:
    """Return the fit to a short recording of depth, with or without a table."""
    recording = run(TRUTH, HEAVE, PLAN, 10.0).recorded(np.random.default_rng(100 + seed), "depth")
    (fit,) = fit_recordings([recording], UNKNOWN, points=[table(seed, scale)] if tables else [])
    return fit


def information(found: Estimate) -> np.ndarray:
    """Return the inverse of the covariance of the coefficients of drag and β."""
    return np.linalg.inv(found.part(NAMES).covariance)


def test_the_fit_weighs_points_and_recordings_by_their_information() -> None:
    """To first order, the information of independent measurements adds up, and so does information times values."""
    alone, both, points = fitted(0, tables=False), fitted(0, tables=True), table(0)
    of_points = fit_response(HEAVE, points.points, UNKNOWN).estimate
    of_points = Estimate(
        of_points.names,
        of_points.values,
        of_points.covariance * (points.error / of_points.noise) ** 2,
        of_points.degrees_of_freedom,
        points.error,
    )
    parts = [(information(found), found.part(NAMES).values) for found in (alone.estimate, of_points)]
    total = sum((H for H, _ in parts), np.zeros((3, 3)))
    expected = np.linalg.solve(total, sum((H @ values for H, values in parts), np.zeros(3)))
    errors = np.sqrt(np.diag(np.linalg.inv(total)))
    found = both.estimate.part(NAMES)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(errors, rel=0.1)
    assert np.abs((found.values - expected) / errors).max() < 0.3
    assert np.abs((found.values - alone.estimate.part(NAMES).values) / errors).max() > 0.3, "the table does nothing"


def test_intervals_cover_and_are_narrower_with_the_table() -> None:
    seeds, covered = range(3), []
    for seed in seeds:
        alone, both = (fitted(seed, tables=tables).estimate for tables in (False, True))
        for name in NAMES:
            assert both.errors[name] < 1.02 * alone.errors[name], (seed, name)
            low, high = both.intervals[name]
            covered.append(low <= TRUTH[name] <= high)
    assert sum(covered) >= len(covered) - 2


@pytest.mark.parametrize("scale", [*(pytest.param(x, marks=pytest.mark.long) for x in (1.02, 1.05, 1.1)), 1.3])
def test_a_wrong_table_does_not_spoil_the_fit(scale: float) -> None:
    """A velocity that is far off, as with a wrong unit, counts linearly and not by its square."""
    fit = fitted(0, tables=True, scale=scale)
    for command in COMMANDS[1:6]:
        assert fit.rov.response(HEAVE, command)[0] == pytest.approx(responses(command)[0], rel=0.01)
    if scale <= 1.05:
        assert all(low <= TRUTH[name] <= high for name, (low, high) in fit.estimate.part(NAMES).intervals.items())


def test_the_points_are_counted() -> None:
    assert fitted(0, tables=True).method == "output error over 1 recording and 14 points"
    assert fitted(0, tables=False).method == "output error over 1 recording"


def test_a_table_without_freedom_takes_no_part() -> None:
    points = [Point("V_ss", c, responses(c)[0], 1.0, "table") for c in (0.3, 0.5)]
    assert TablePoints.of(fit_response(HEAVE, points, UNKNOWN)) is None


@pytest.mark.long
def test_points_scatter_more_than_few_of_them_show() -> None:
    """The median of the errors over many small tables is at least the true one."""
    errors = []
    for seed in range(20):
        points = table(seed).points[:8]
        found = TablePoints.of(fit_response(HEAVE, points, UNKNOWN))
        assert found is not None
        errors.append(found.error)
    assert ERROR < np.median(errors) < 2.0 * ERROR


def test_residuals_are_finite_without_drag() -> None:
    still = TRUTH.replaced({"a_d_w": 0.0, "b_d_w": 0.0})
    assert np.isfinite(table(0).residuals(still)).all()


# ---- Forces ----------------------------------------------------------------------------------------------------------

PULLS = np.array([sign * c for sign in (-1.0, 1.0) for c in (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8)])
CURVE = ("a_t_top", "b_t_top", "c_0_top")
SCALE = 0.1
"""The standard error of a force, N."""


def with_dead_band(b_t: float) -> Rov:
    """Return a vehicle whose top thruster begins at 8 %."""
    return with_more(TRUTH, c_0_top=0.08, b_t_top=b_t)


def pulled(k: Rov, seed: int) -> Array:
    """Return forces of the top thruster with noise."""
    m = np.maximum(np.abs(PULLS) - k["c_0_top"], 0.0)
    F = np.sign(PULLS) * (k["a_t_top"] * m**2 + k["b_t_top"] * m)
    return np.asarray(F + SCALE * np.random.default_rng(seed).standard_normal(len(PULLS)))


@cache
def with_forces(b_t: float, seed: int, held: float | None = None) -> tuple[RecordingsFit, float]:
    """Return the fit to a depth and to forces, and its cost; b_t may be held."""
    k = with_dead_band(b_t)
    names = tuple(name for name in CURVE if held is None or name != "b_t_top")
    start = Estimate(names, np.array([k[name] for name in names]), np.eye(len(names)), 13.0, SCALE)
    forces = TableForces("top", PULLS, pulled(k, seed), SCALE, start)
    recording = run(k, HEAVE, PLAN, 10.0).recorded(np.random.default_rng(200 + seed), "depth")
    base = k.replaced(dict.fromkeys(NAMES, 1.0) | ({} if held is None else {"b_t_top": held}))
    (fit,) = fit_recordings([recording], base, forces=[forces])
    (simulation,) = fit.simulations
    noise = NOISE["depth"]
    return fit, float(np.sum((simulation.residuals / noise) ** 2) + np.sum(forces.residuals(fit.rov) ** 2))


@pytest.mark.parametrize("b_t", [*(pytest.param(b_t, marks=pytest.mark.long) for b_t in (0.0, 0.3)), 3.0])
def test_intervals_beside_a_dead_band(b_t: float) -> None:
    """The cost with b_t held at an end of its interval is higher by about that of 1.96 standard errors, 3.8.

    At b_t = 0 the cost grows with the fourth power of b_t, so a factor of two in the cost is one of 1.2 in b_t.
    """
    truth, missed = with_dead_band(b_t), 0
    for seed in range(2):
        fit, least = with_forces(b_t, seed)
        for name, (low, high) in fit.estimate.intervals.items():
            missed += not low <= truth[name] <= high
        _, end = fit.estimate.intervals["b_t_top"]
        assert 2.5 < with_forces(b_t, seed, end)[1] - least < 10.0, seed
    assert missed <= 1


def test_forces_of_exact_curves_take_no_part() -> None:
    exact = fit_thrust(Curve("top"), PULLS, TRUTH["a_t_top"] * np.abs(PULLS) * PULLS + TRUTH["b_t_top"] * PULLS)
    assert TableForces.of(exact) is None


@pytest.mark.parametrize("wrong", [False, True])
def test_forces_that_the_recording_contradicts_are_told(*, wrong: bool) -> None:
    """A scale that reads more, the stronger the pull, shows another curve. No drag and no β explains that."""
    F = TRUTH["a_t_top"] * np.abs(PULLS) * PULLS + TRUTH["b_t_top"] * PULLS + (2.0 * PULLS if wrong else 0.0)
    thrust = fit_thrust(Curve("top"), PULLS, F + 0.05 * np.random.default_rng(3).standard_normal(len(PULLS)))
    forces = TableForces.of(thrust)
    assert forces is not None
    recording = run(TRUTH, HEAVE, PLAN, 20.0).recorded(np.random.default_rng(9), "depth")
    (fit,) = fit_recordings([recording], UNKNOWN.extended(thrust.values), forces=[forces])
    found = list(on_forces(fit, thrust))
    assert bool(found) is wrong
    if wrong:
        (line,) = sentences(found)
        told = re.fullmatch(
            r"heave: .* another top thrust than the measured forces: (.*) N instead of (.*) N at .* of (.*)%\. .*", line
        )
        assert told, line
        joint, alone, command = map(float, told.groups())
        at = np.array([0.01 * command])
        for number, curve in ((joint, fit.rov.coefficients), (alone, thrust.values)):
            assert number == pytest.approx(curve["a_t_top"] * at * np.abs(at) + curve["b_t_top"] * at, rel=0.01)
