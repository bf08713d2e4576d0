"""The correlations in the vehicle file, compared with the scatter of estimates from simulated tests."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import stdtrit
from scipy.stats import binom, chi2

from rov_fmu.identify.identification import Identification
from rov_fmu.identify.identify import identify
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.tables import TableForces
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.model.layout import SURGE, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.published import untuned
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.uncertainty import Uncertainty
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.commands import REFIT
from tests.folders import ARM, FORCE, HEAD, MASS, RATE, SPEED, TAU, TURNS, read
from tests.recordings import PLANS, clean, write_log

K = untuned(load_vehicle(VIDEORAY).rov)
COMMANDS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8])
M = np.column_stack([COMMANDS**2, COMMANDS])
THRUST = ("a_t_rear", "b_t_rear")
KNOWN = f"{HEAD}[known]\n{MASS}{TURNS}{ARM}"


def names_of(axis: Axis) -> list[str]:
    return [axis.coefficient(kind) for kind in ("a_d", "b_d", "beta")]


def measured(k: Rov, random: np.random.Generator, newton: float, share: dict[str, float]) -> dict[str, Array]:
    """Return forces of the rear pair, V_ss and Tau of surge and yaw at COMMANDS, with noise."""
    data = {"rear": M @ [k[name] for name in THRUST] + newton * random.standard_normal(7)}
    for axis in (SURGE, YAW):
        exact = np.array([k.response(axis, c) for c in COMMANDS.tolist()])
        data[axis.name] = exact * (1.0 + share[axis.name] * random.standard_normal((7, 2)))
    return data


def table(header: str, values: Array) -> str:
    return "\n".join([header, *(f"{c},{value:.9f}" for c, value in zip(COMMANDS, values, strict=True))]) + "\n"


def identified(data: dict[str, Array], folder: Path) -> Identification:
    tables = {"thrust_rear.csv": table(FORCE, data["rear"])}
    for axis, header in ((SURGE, SPEED), (YAW, RATE)):
        tables[f"steady_{axis.name}.csv"] = table(header, data[axis.name][:, 0])
        tables[f"time_constant_{axis.name}.csv"] = table(TAU, data[axis.name][:, 1])
    return identify(read(folder, KNOWN, tables))


def refitted(data: dict[str, Array], start: Rov) -> dict[str, float]:
    """Fit the data with NumPy and SciPy alone: forces by (6), then relative errors of V_ss and Tau."""
    found = dict(zip(THRUST, np.linalg.lstsq(M, data["rear"], rcond=None)[0].tolist(), strict=True))
    for axis in (SURGE, YAW):
        k, names = start.replaced(found), names_of(axis)

        def errors(x: Array, axis: Axis = axis, k: Rov = k, names: list[str] = names) -> Array:
            other = k.replaced(dict(zip(names, np.exp(x).tolist(), strict=True)))
            return np.ravel([other.response(axis, c) for c in COMMANDS.tolist()] / data[axis.name] - 1.0)

        x = least_squares(errors, np.log([start[name] for name in names]), x_scale="jac").x
        found |= dict(zip(names, np.exp(x).tolist(), strict=True))
    return found


@pytest.mark.parametrize(
    "sets", [pytest.param(150, marks=pytest.mark.long), pytest.param(600, marks=pytest.mark.weekly)]
)
def test_drag_and_thrust_scatter_as_the_file_says(sets: int, tmp_path: Path) -> None:
    """Surge and yaw share the rear curve; other fits of data about the result scatter as the file says."""
    found = identified(measured(K, np.random.default_rng(3), 0.2, {"surge": 0.005, "yaw": 0.005}), tmp_path / "tests")
    write_vehicle(found.vehicle, tmp_path / "made.toml")
    vehicle = load_vehicle(tmp_path / "made.toml")
    told, random = vehicle.uncertainty, np.random.default_rng(4)
    assert told.names == (*THRUST, "a_d_u", "b_d_u", "a_d_r", "b_d_r", "beta_u", "beta_r")
    newton = found.thrust["rear"].estimate.noise * stdtrit(7.0 - 2.0, 0.975) / 1.96  # so few tell it so badly
    share = {
        r.axis.name: r.response.estimate.noise * stdtrit(14.0 - 3.0, 0.975) / 1.96 for r in found.axes if r.response
    }
    fits = [refitted(measured(vehicle.rov, random, newton, share), vehicle.rov) for _ in range(sets)]
    near = 0.12 * np.sqrt(600 / sets)
    scatter = np.array([[fit[name] for name in told.names] for fit in fits])
    assert scatter.std(axis=0) == pytest.approx(told.errors, rel=near)
    pairs = np.triu_indices(8, 1)
    fisher = [np.arctanh(matrix[pairs]) for matrix in (np.corrcoef(scatter.T), told.correlation)]
    assert fisher[0] == pytest.approx(fisher[1], abs=4.0 / np.sqrt(sets))
    numbers = scatter, told.drawn(random.random((sets, 8))), told_apart(vehicle).drawn(random.random((sets, 8)))
    measured_ones, drawn, alone = (spread(vehicle, told.names, rows, SURGE) for rows in numbers)
    assert drawn == pytest.approx(measured_ones, rel=near)
    assert alone > 4.0 * measured_ones, "thrust and drag that do not know of each other"


def told_apart(vehicle: Vehicle) -> Uncertainty:
    """Return the uncertainty without correlations."""
    return replace(vehicle.uncertainty, correlation=np.eye(len(vehicle.uncertainty.names)))


def spread(vehicle: Vehicle, names: Sequence[str], numbers: Array, axis: Axis) -> float:
    """Return the relative standard deviation of V_ss at half command over n sets of coefficients (n x p)."""
    drawn = (vehicle.rov.replaced(dict(zip(names, row, strict=True))) for row in numbers.tolist())
    V_ss = [k.response(axis, 0.5)[0] for k in drawn]
    return float(np.std(V_ss) / np.mean(V_ss))


@pytest.mark.parametrize("seeds", [pytest.param(3, marks=pytest.mark.long), pytest.param(12, marks=pytest.mark.weekly)])
def test_recordings_scatter_as_the_fit_of_all_axes_says(seeds: int) -> None:
    """The errors of all coefficients follow their joint covariance (χ²), with recordings and an uncertain thrust curve.

    The ratio of thrust to drag is known a hundred times better than either.
    """
    clean_ones = {axis: [clean(K, axis, plan, 5.0) for plan in PLANS[axis.name]] for axis in (SURGE, YAW)}
    far = []
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        recordings = [
            recording.noisy(random, f"log_{axis.name}_{n}.csv")
            for axis, found in clean_ones.items()
            for n, recording in enumerate(found)
        ]
        F = M @ [K[name] for name in THRUST] + 0.3 * random.standard_normal(len(M))
        pulled = np.linalg.lstsq(M, F, rcond=None)[0]
        forces = TableForces("rear", COMMANDS, F, 0.3, Estimate(THRUST, pulled, np.eye(2), 5.0, 0.3))
        unknown = dict.fromkeys((*names_of(SURGE), *names_of(YAW)), 1.0)
        base = K.replaced(unknown | dict(zip(THRUST, pulled.tolist(), strict=True)))
        fits = fit_recordings(recordings, base, forces=[forces])
        together = fits[0].together
        if {*together.names} != {*THRUST, *unknown}:  # a load or the like, by chance
            continue
        errors = np.sqrt(np.diag(together.covariance))
        off = (together.values - [K[name] for name in together.names]) / errors
        shared = np.round(together.correlation, 6)  # as it is written
        assert np.linalg.eigvalsh(shared)[0] > 1e-6
        far.append(off @ np.linalg.solve(shared, off))
    assert len(far) >= binom.ppf(0.001, seeds, 0.95)
    low, high = chi2.ppf([0.001, 0.999], 8 * len(far))
    assert low < sum(far) < (high if seeds < 10 else 1.25 * high), "the spectrum of the noise is found, not known"


def test_points_of_one_axis_and_recordings_of_another(tmp_path: Path) -> None:
    """They share a thrust curve: drag of yaw, from points, depends on the curve from recordings of surge."""
    random = np.random.default_rng(5)
    data = measured(K, random, 0.4, {"surge": 0.0, "yaw": 0.005})
    folder = tmp_path / "tests"
    folder.mkdir()
    for n, plan in enumerate(PLANS["surge"][1:]):
        write_log(folder, str(n), clean(K, SURGE, plan, 5.0).noisy(random))
    tables = {
        "thrust_rear.csv": table(FORCE, data["rear"]),
        "steady_yaw.csv": table(RATE, data["yaw"][:, 0]),
        "time_constant_yaw.csv": table(TAU, data["yaw"][:, 1]),
    }
    found = identify(read(folder, KNOWN, tables))
    assert [result.chosen for result in found.axes] == ["recordings", "points"]
    write_vehicle(found.vehicle, tmp_path / "made.toml")
    vehicle = load_vehicle(tmp_path / "made.toml")
    told = vehicle.uncertainty
    by_name = dict(zip(told.names, told.correlation, strict=True))
    assert by_name["a_d_u"][told.names.index("b_d_r")] != 0.0
    uniform = random.random((600, len(told.names)))
    together, alone = (spread(vehicle, told.names, of.drawn(uniform), YAW) for of in (told, told_apart(vehicle)))
    assert together < 0.005
    assert alone > 3.0 * together


def test_what_a_base_knows_is_kept_where_no_test_tells_anew(tmp_path: Path) -> None:
    base = load_vehicle(REFIT)
    rows = measured(K, np.random.default_rng(6), 0.0, {"surge": 0.0, "yaw": 0.01})["yaw"]
    tables = {"steady_yaw.csv": table(RATE, rows[:, 0]), "time_constant_yaw.csv": table(TAU, rows[:, 1])}
    by_hand = '[known]\nbeta_w = { value = 0.6, unit = "1", source = "by hand" }\n'
    found = identify(read(tmp_path / "tests", f'base = "videoray_refit"\n{HEAD}{by_hand}', tables)).vehicle
    assert found.estimates["b_d_u"] == base.estimates["b_d_u"]
    assert found.estimates["b_d_w"] == base.estimates["b_d_w"]
    assert "beta_w" not in found.estimates
    assert {*found.estimates["beta_r"].correlation} == {"a_d_r", "b_d_r"}
    write_vehicle(found, tmp_path / "made.toml")
    assert load_vehicle(tmp_path / "made.toml").estimates.keys() == found.estimates.keys()


def test_coefficients_without_an_interval_are_no_estimates(tmp_path: Path) -> None:
    """Two V_ss determine two coefficients, but not their uncertainty."""
    data = measured(K, np.random.default_rng(7), 0.1, {"surge": 0.01, "yaw": 0.0})
    two = "\n".join(table(SPEED, data["surge"][:, 0]).splitlines()[:3]) + "\n"
    found = identify(read(tmp_path, KNOWN, {"thrust_rear.csv": table(FORCE, data["rear"]), "steady_surge.csv": two}))
    assert {*found.vehicle.estimates} == {*found.vehicle.intervals} == {*THRUST}
    (a_t, b_t) = found.vehicle.estimates.values()
    errors = np.linalg.inv(M.T @ M)
    assert a_t.correlation == {}
    assert b_t.correlation["a_t_rear"] == pytest.approx(errors[0, 1] / np.sqrt(errors[0, 0] * errors[1, 1]))
