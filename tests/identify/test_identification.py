"""Fits to points, and a whole folder of tests to a vehicle file."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import linregress

from rov_fmu.identify import identify as module
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import load_tank_tests
from rov_fmu.identify.identification import AxisResult, Identification, compare
from rov_fmu.identify.identify import identify
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.quadratic_fit import fit_quadratic
from rov_fmu.identify.points.response_fit import fit_response
from rov_fmu.identify.points.step_responses import StepResponse
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, RecordingsFit
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.report.report import report_page
from rov_fmu.tank.findings import Finding
from rov_fmu.vehicle.published import load_tables, untuned
from rov_fmu.vehicle.shipped import PAPER, VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.commands import TESTS
from tests.recordings import AXES, PLANS, clean, write_log

REAR = ("a_t_rear", "b_t_rear")
COMMANDS = np.arange(0.1, 1.01, 0.1)


@pytest.fixture
def k(vehicle: Vehicle) -> Rov:
    """Return the VideoRay with every α and β at 1."""
    return untuned(vehicle.rov)


# ---- Thrust and drag, (6)-(16) ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axis", "a_d", "b_d"), [("surge", 4.99, 8.65), ("heave", 24.7, -0.92), ("yaw", 0.0789, 0.163)]
)
def test_unweighted_fits_of_tables_3_to_5(axis: str, a_d: float, b_d: float, vehicle: Vehicle, k: Rov) -> None:
    """The comparison is with (9) and (10); (14)-(16) have weights, or data that are only in figures."""
    table = next(t for t in load_tables(vehicle) if t.axis.name == axis)
    m = table.axis
    commands, V_ss = np.array([(float(c) / 100.0, float(V)) for c, V in table.steady.items()]).T
    forces = np.array([k.force(m, c) for c in commands.tolist()])
    fit = fit_quadratic((m.coefficient("a_d"), m.coefficient("b_d")), V_ss, forces, groups=commands)
    assert fit.unbounded == pytest.approx((a_d, b_d), rel=0.005)
    if b_d > 0.0:
        assert (fit.a, fit.b) == pytest.approx(fit.unbounded)
        assert fit.estimate.at_bound == ()
    else:
        assert fit.b == 0.0, "drag that pushes is not physical"
        assert fit.estimate.at_bound == (m.coefficient("b_d"),)
        assert fit.estimate.intervals["b_d_w"] == pytest.approx((0.0, 3.1), rel=0.01)


def test_window_of_weights_gives_the_lower_commands_their_curve() -> None:
    """Forces that follow (9) up to 70 % and fall off above are fitted by (9) within the window, (7)."""
    forces = 42.9 * COMMANDS**2 + 2.711 * COMMANDS - 30.0 * np.maximum(COMMANDS - 0.7, 0.0)
    weights = (COMMANDS < 0.75).astype(float)
    all_of_them, weighted = fit_quadratic(REAR, COMMANDS, forces), fit_quadratic(REAR, COMMANDS, forces, weights)
    assert (weighted.a, weighted.b) == pytest.approx((42.9, 2.711))
    assert abs(all_of_them.a - 42.9) > 3.0
    assert weighted.r_squared == pytest.approx(1.0)
    assert weighted.leave_one_out_error == pytest.approx(0.0, abs=1e-9)
    assert weighted.residuals[weights == 0.0] == pytest.approx(forces[weights == 0.0] - weighted.value(COMMANDS)[7:])


def test_covariance_correlation_and_band_are_those_of_a_straight_line() -> None:
    """With weights of 1/x^2, the fit is the straight line y/x = b + a x."""
    forces = 42.9 * COMMANDS**2 + 2.711 * COMMANDS + COMMANDS * np.random.default_rng(0).standard_normal(10)
    fit, line = fit_quadratic(REAR, COMMANDS, forces, COMMANDS**-2.0), linregress(COMMANDS, forces / COMMANDS)
    assert [fit.a, fit.b] == pytest.approx([line.slope, line.intercept])
    assert list(fit.estimate.errors.values()) == pytest.approx([line.stderr, line.intercept_stderr])
    assert fit.estimate.degrees_of_freedom == 8.0
    assert fit.estimate.noise == pytest.approx(np.sqrt(np.sum((fit.residuals / COMMANDS) ** 2) / 8.0))
    assert fit.estimate.correlation == pytest.approx(np.array([[1.0, -0.886], [-0.886, 1.0]]), abs=0.001)
    low, high = fit.band(COMMANDS)
    assert ((low < fit.value(COMMANDS)) & (fit.value(COMMANDS) < high)).all()


@pytest.mark.long
def test_intervals_and_bands_of_thrust_cover_the_truth() -> None:
    """The share of 500 seeds within the intervals is 95 %, within three standard deviations of 1 %."""
    truth = 42.9 * COMMANDS**2 + 2.711 * COMMANDS
    random = np.random.default_rng(1)
    a, b, band = [], [], []
    for _ in range(500):
        fit = fit_quadratic(REAR, COMMANDS, truth + 0.5 * random.standard_normal(10))
        (a_low, a_high), (b_low, b_high) = (fit.estimate.interval(name) or (0.0, 0.0) for name in REAR)
        low, high = fit.band(np.array([0.5]))
        a.append(a_low <= 42.9 <= a_high)
        b.append(b_low <= 2.711 <= b_high)
        band.append(low[0] <= 0.25 * 42.9 + 0.5 * 2.711 <= high[0])
    assert [np.mean(a), np.mean(b), np.mean(band)] == pytest.approx([0.95] * 3, abs=0.03)


def test_leaving_a_thrust_out_leaves_all_of_its_rows_out() -> None:
    x = np.array([0.2, 0.2, 0.4, 0.6, -0.2])
    y = 10.0 * np.abs(x) * x + np.array([0.1, 0.2, 0.0, 0.0, -0.3])
    fit = fit_quadratic(REAR, x, y)
    without = fit_quadratic(REAR, x[[2, 3]], y[[2, 3]])
    assert fit.leave_one_out[[0, 1, 4]] == pytest.approx(without.value(x[[0, 1, 4]]))
    assert np.isnan(fit_quadratic(REAR, x[:3], y[:3]).leave_one_out).all(), "one thrust left fixes no curve"


def test_two_points_have_a_curve_but_no_interval() -> None:
    fit = fit_quadratic(REAR, np.array([0.2, 0.6]), np.array([1.0, 9.0]))
    assert fit.residuals == pytest.approx([0.0, 0.0], abs=1e-12)
    assert fit.estimate.intervals == {}
    assert np.isinf(fit.band(np.array([0.4]))[0]).all()


# ---- V_ss and Tau ----------------------------------------------------------------------------------------------------


def points_of(m: Axis, k: Rov, commands: tuple[float, ...]) -> list[Point]:
    """Return V_ss and Tau of the model."""
    return [Point(q, c, k.response(m, c)[q == "Tau"], 1.0, "") for q in ("V_ss", "Tau") for c in commands]


@pytest.mark.parametrize("m", [SURGE, HEAVE, YAW], ids=lambda m: m.name)
def test_points_of_a_model_give_the_model(m: Axis, vehicle: Vehicle) -> None:
    k = vehicle.rov
    names = [m.coefficient(kind) for kind in ("a_d", "b_d", "beta")]
    start = k.replaced(dict.fromkeys(names, 1.0))
    fit = fit_response(m, points_of(m, k, (0.2, -0.3, 0.5, 0.7)), start)
    for name in names:
        assert fit.rov[name] == pytest.approx(k[name], rel=1e-5)
    assert fit.rms("V_ss") < 1e-7
    assert fit.rms("Tau", leave_one_out=True) < 1e-6


def test_steady_velocities_alone_leave_beta(k: Rov) -> None:
    fit = fit_response(SURGE, [p for p in points_of(SURGE, k, (0.2, 0.5, 0.7)) if p.quantity == "V_ss"], k)
    assert fit.estimate.names == ("a_d_u", "b_d_u")
    assert fit.rov["beta_u"] == 1.0
    assert "m_rov/beta_u is not identifiable from V_ss alone" in fit.assumed["beta_u"]


def test_one_thrust_leaves_linear_drag(k: Rov) -> None:
    fit = fit_response(HEAVE, points_of(HEAVE, k, (0.3,)), k)
    assert fit.estimate.names == ("a_d_w", "beta_w")
    assert fit.rov["b_d_w"] == 0.0
    assert "b_d_w" in fit.assumed
    assert fit.model == pytest.approx([p.value for p in fit.points])


def test_points_without_weight_do_not_count(k: Rov) -> None:
    points = points_of(YAW, k, (0.2, 0.5, 0.7))
    wrong = [replace(p, value=3.0 * p.value, weight=0.0) for p in points[:2]]
    assert fit_response(YAW, [*points, *wrong], k).rms("V_ss") < 1e-7


def test_thrust_that_is_uncertain_makes_drag_uncertain(k: Rov) -> None:
    thrust = np.array([k["a_t_top"], k["b_t_top"]])
    uncertain = Estimate(("a_t_top", "b_t_top"), thrust, 0.01 * np.outer(thrust, thrust), 6.0, 1.0)
    fit = fit_response(HEAVE, points_of(HEAVE, k, (0.2, 0.5, 0.7)), k, thrust=uncertain)
    assert fit.estimate.errors["a_d_w"] == pytest.approx(0.1 * k["a_d_w"], rel=0.01)
    assert fit.estimate.errors["beta_w"] == pytest.approx(0.1, rel=0.01)


@pytest.mark.long
def test_recordings_of_vehicles_that_differ_disagree(tmp_path: Path) -> None:
    """Drag differs between three recordings, so the interval is wide and there is a finding."""
    write_rov(tmp_path)
    k, random = load_vehicle(VIDEORAY).rov, np.random.default_rng(1)
    rows = [(c, k.force(HEAVE, c)) for c in (0.1, 0.3, 0.5, 0.7)]
    write_csv(tmp_path / "thrust_top.csv", "command [1],force [N]", rows)
    for n, factor in enumerate((0.8, 1.0, 1.2)):
        other = k.replaced({"alpha_w": 1.0, "a_d_w": factor * k["a_d_w"]})
        write_log(tmp_path, str(n), clean(other, HEAVE, PLANS["heave"][n], 25.0).noisy(random))
    found = identify(load_tank_tests(tmp_path))
    (fit,) = (result.recordings for result in found.axes if result.recordings)
    assert fit.disagreement["a_d_w"] > 3.0
    (disagreement,) = (finding for finding in found.findings if finding.kind == "disagreement")
    assert (disagreement.axis, "a_d_w" in disagreement.names["coefficients"]) == ("heave", True)
    low, high = found.vehicle.intervals["a_d_w"]
    assert low < k["a_d_w"] < high


# ---- A folder --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def full_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write thrust tests with noise, and a recording of 60 s at 40 Hz of each axis of the VideoRay with α = 1."""
    folder, random = tmp_path_factory.mktemp("full"), np.random.default_rng(0)
    write_rov(folder)
    k = load_vehicle(VIDEORAY).rov.replaced({"alpha_u": 1.0, "alpha_w": 1.0, "alpha_r": 1.0})
    for thruster, m in (("rear", SURGE), ("top", HEAVE)):
        rows = [(c, k.force(m, c) + 0.05 * random.standard_normal()) for c in np.arange(0.1, 0.81, 0.1).tolist()]
        write_csv(folder / f"thrust_{thruster}.csv", "command [1],force [N]", rows)
    for m in AXES:
        _, slow, fast = PLANS[m.name]
        write_log(folder, "1", clean(k, m, (*slow[:3], *fast[1:3]), 40.0).noisy(random))
    return folder


def write_rov(folder: Path, known: str = "", **windows: tuple[float, float]) -> None:
    """Write rov.toml with mass and geometry of the VideoRay."""
    head, table = (TESTS / "rov.toml").read_text(encoding="utf-8").split("[known]")
    lines = [line for line in table.splitlines() if line.startswith(("m_rov", "I_r", "R ", "gamma"))]
    text = head.replace('against = "videoray"', "") + "[known]\n" + known + "\n".join(lines) + "\n[windows]\n"
    text += "".join(f"{name} = [{low}, {high}]\n" for name, (low, high) in windows.items())
    (folder / "rov.toml").write_text(text, encoding="utf-8")


def write_csv(path: Path, header: str, rows: list[tuple[float, float]]) -> None:
    path.write_text("\n".join([header, *(f"{x:.6g},{y:.6g}" for x, y in rows)]) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def full(full_folder: Path) -> Identification:
    return identify(load_tank_tests(full_folder))


def test_full_folder_gives_the_vehicle_back(full: Identification, full_folder: Path) -> None:
    found = full.vehicle.rov
    true = load_vehicle(VIDEORAY).rov.replaced({"alpha_u": 1.0, "alpha_w": 1.0, "alpha_r": 1.0})
    for m in AXES:
        for command in np.linspace(0.2, 0.7, 11).tolist():
            V_ss, Tau = true.response(m, command)
            assert found.response(m, command) == pytest.approx((V_ss, Tau), rel=0.02)
    for name, (low, high) in full.vehicle.intervals.items():  # that the sensors' scale errs in, all coefficients share
        assert abs(true[name] - 0.5 * (low + high)) < 1.6 * 0.5 * (high - low), name
    assert set(full.vehicle.intervals) == {
        *("a_t_rear", "b_t_rear", "a_t_top", "b_t_top"),
        *(f"{kind}_{v}" for kind in ("a_d", "b_d", "beta") for v in "uwr"),
    }
    assert [axis.chosen for axis in full.axes] == ["recordings"] * 3
    points = [p for axis in full.axes for p in axis.points]
    assert points
    assert not any(p.weight for p in points), "the fit to the recordings has all that was read off them"
    assert full.vehicle.provenance
    assert set(full.vehicle.provenance.inputs) == {path.name for path in full_folder.iterdir()}
    assert full.vehicle.command_range == (0.2, 0.7)


def test_full_folder_reaches_the_vehicle_file(full: Identification, tmp_path: Path) -> None:
    path = tmp_path / "full.toml"
    write_vehicle(full.vehicle, path)
    read, made = load_vehicle(path), full.vehicle
    for name in PAPER.coefficients:
        assert read.rov[name] == pytest.approx(made.rov[name], rel=1e-5)
    assert read.intervals.keys() == made.intervals.keys()
    for name, (low, high) in made.intervals.items():
        assert read.intervals[name] == pytest.approx((low, high), rel=1e-5)
    one, other = read.uncertainty, made.uncertainty
    assert one.names == other.names
    assert one.errors == pytest.approx(other.errors, rel=1e-5)
    assert one.correlation == pytest.approx(other.correlation, abs=1e-6)
    assert replace(read, rov=made.rov, intervals=made.intervals, estimates=made.estimates) == made
    assert read.provenance
    assert "heave: output error over 1 recording" in read.provenance.method


def test_points_of_a_comparison_stand_beside_the_model(full: Identification) -> None:
    for comparison in compare(full):
        assert len(comparison.points) == len(comparison.model) == len(comparison.leave_one_out)
        deviations = comparison.model / [p.value for p in comparison.points] - 1.0
        assert np.sqrt(np.mean(deviations**2)) < 0.05
        assert comparison.counts == 0
        assert comparison.against is None, "there is nothing to set beside"


def axis_of(found: Identification, axis: str) -> AxisResult:
    return next(result for result in found.axes if result.axis.name == axis)


# ---- What is not identifiable ----------------------------------------------------------------------------------------

FORCES = [(c, 42.9 * c * c + 2.711 * c) for c in (0.1, 0.3, 0.5, 0.7)]
TOP = [(c, 6.494 * c * c + 0.0513 * c) for c in (0.1, 0.3, 0.5, 0.7)]
STEADY = {
    "surge": [(0.2, 0.22), (0.3, 0.43), (0.5, 0.97), (0.7, 1.6)],
    "heave": [(0.3, 0.163), (0.5, 0.28), (0.7, 0.4)],
    "yaw": [(0.2, 0.93), (0.4, 2.0), (0.7, 3.7)],
}


Tables = Mapping[str, list[tuple[float, float]]]


def folder_with(
    folder: Path,
    tables: Tables | None = None,
    axes: Sequence[str] = ("surge", "heave", "yaw"),
    known: str = "",
    **windows: tuple[float, float],
) -> Identification:
    """Identify a small folder with thrust and steady velocities of some axes, and with other tables by file name."""
    write_rov(folder, known, **windows)
    all_tables = {f"steady_{axis}": STEADY[axis] for axis in axes}
    all_tables |= {"thrust_top": TOP} if "heave" in axes else {}
    all_tables |= {"thrust_rear": FORCES} if {"surge", "yaw"} & {*axes} else {}
    for name, rows in {**all_tables, **(tables or {})}.items():
        velocity = "velocity [rad/s]" if "yaw" in name else "velocity [m/s]"
        kind = "force [N]" if "thrust" in name else "time constant [s]" if "time" in name else velocity
        write_csv(folder / f"{name}.csv", f"command [1],{kind}", rows)
    return identify(load_tank_tests(folder))


FOUND: list[tuple[Tables, list[Finding]]] = [
    (
        {
            "steady_heave": [(0.3, 0.15), (0.5, 0.29), (0.7, 0.38)],
            "steady_yaw": [(0.2, 1.6), (0.4, 2.0), (0.7, 3.7)],
            "thrust_top": TOP[:3],
        },
        [
            Finding("assumed beta", "surge", names={"beta": "beta_u", "inertia": "m_rov"}),
            Finding("assumed beta", "yaw", names={"beta": "beta_r", "inertia": "I_r"}),
            Finding("inseparable drag", "heave", names={"a_d": "a_d_w", "b_d": "b_d_w"}),
            Finding("leave-one-out error", "yaw", names={"quantity": "V_ss"}),
            Finding("untested thrust", "heave", curve="top", numbers={"tested_low": 0.1, "tested_high": 0.5}),
        ],
    ),
    (
        {
            "steady_heave": [(0.2, 0.2), (0.5, 0.28), (0.7, 0.36)],
            "steady_yaw": [(0.3, 1.5), (0.6, 3.1)],
            "thrust_rear": [(0.3, 1.0), (0.5, 11.5), (0.7, 30.0)],
        },
        [
            Finding("drag at zero", "heave", names={"coefficient": "b_d_w"}),
            Finding("drag without freedom", "yaw"),
            Finding("backward thrust", curve="rear", numbers={"command": 0.27}),
        ],
    ),
    (
        {
            "thrust_top": [(0.1, 0.0), (0.2, 0.0), (0.3, 0.42), (0.4, 0.98), (0.5, 1.62), (0.6, 2.37), (0.7, 3.2)],
            "steady_heave": [(0.1, 0.08), *STEADY["heave"], (-0.5, -0.25)],
        },
        [
            Finding("no push", "heave", names={"commands": "10%"}),
            Finding("asymmetry", "heave", numbers={"measured": -0.11}),
        ],
    ),
    (
        {"thrust_top": TOP[1:3], "steady_heave": [(0.3, 0.163), (0.5, 0.28)]},
        [Finding("thrust without freedom", curve="top", numbers={"count": 2})],
    ),
]
"""Tables, and findings about them with some of their names and numbers."""


@pytest.mark.parametrize("case", range(len(FOUND)))
def test_findings(case: int, tmp_path: Path) -> None:
    tables, findings = FOUND[case]
    about = {finding.axis or {"rear": "surge", "top": "heave"}[finding.curve] for finding in findings}
    results = folder_with(tmp_path, tables, [axis for axis in STEADY if axis in about])
    for expected in findings:
        subject = expected.kind, expected.axis, expected.curve
        (found,) = (f for f in results.findings if (f.kind, f.axis, f.curve) == subject)
        assert {name: found.names[name] for name in expected.names} == expected.names
        assert {name: found.numbers[name] for name in expected.numbers} == pytest.approx(expected.numbers, abs=0.005)
    assert results.vehicle.provenance
    made = results.vehicle.provenance
    assert (made.warnings, made.facts) == (results.warnings, results.facts)


def test_enough_good_data_raise_no_finding(tmp_path: Path, k: Rov) -> None:
    tables: dict[str, list[tuple[float, float]]] = {}
    for m in AXES:
        for quantity, kind in enumerate(("steady", "time_constant")):
            tables[f"{kind}_{m.name}"] = [(c, k.response(m, c)[quantity]) for c in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7)]
    assert folder_with(tmp_path, tables).findings == ()


def test_window_takes_reverse_thrust_out(tmp_path: Path, k: Rov) -> None:
    tables = {"thrust_rear": [*FORCES, (-0.5, -8.0)]}
    both = folder_with(tmp_path, tables, ["surge"])
    (asymmetry,) = (f for f in both.findings if (f.kind, f.curve) == ("asymmetry", "rear"))
    assert asymmetry.numbers["measured"] == pytest.approx(-0.34, abs=0.005)
    forward = folder_with(tmp_path, tables, ["surge"], thrust_rear=(0.0, 1.0))
    assert forward.thrust["rear"].weights.tolist() == [1.0] * 4 + [0.0]
    assert forward.vehicle.rov["a_t_rear"] == pytest.approx(42.9, rel=1e-3)
    assert both.thrust["rear"].leave_one_out_error > 1.0
    assert forward.vehicle.sources["a_t_rear"] == "(7) over 4 forces"
    assert both.vehicle.sources["a_t_rear"] == "(6) over 5 forces"
    drag = axis_of(forward, "surge").drag
    assert drag, "drag as in the paper stands beside the fit of the response"
    assert drag.y == pytest.approx([k.force(SURGE, c) for c, _ in STEADY["surge"]], rel=1e-4)
    assert drag.a == pytest.approx(k["a_d_u"], rel=0.2)


@pytest.mark.parametrize(("weaker", "back", "warns"), [(1.0, np.linspace(0.1, 1.0, 10), False), (0.7, [0.5], True)])
def test_forces_differ_by_direction_where_repetitions_do_not_explain_it(
    weaker: float, back: Sequence[float], warns: bool, tmp_path: Path, k: Rov
) -> None:
    """At 10 % the noise is a tenth of the force, and the directions differ by chance."""
    random = np.random.default_rng(3)
    forces = [(c, k.force(HEAVE, c)) for c in np.repeat(np.linspace(0.1, 1.0, 10), 2).tolist()]
    forces += [(-c, -weaker * k.force(HEAVE, c)) for c in np.repeat(back, 2).tolist()]
    noisy = [(c, force + 0.007 * random.standard_normal()) for c, force in forces]
    by_level = {c: float(np.mean([F for command, F in noisy if command == c])) for c, _ in noisy}
    assert max(abs(by_level[c] / by_level[-c] + 1.0) for c in by_level if -c in by_level) > 0.05
    found = folder_with(tmp_path, {"thrust_top": noisy}, ["heave"])
    assert any((f.kind, f.curve) == ("asymmetry", "top") for f in found.findings) is warns


def test_forces_that_a_person_rounds_do_not_differ_by_direction(tmp_path: Path, k: Rov) -> None:
    """The thrust in reverse is 76 % of that ahead; at 20 %, rounding to 0.5 N is a quarter of the force."""
    commands = (0.2, 0.4, 0.6, 0.8, 1.0)
    exact = [(c, 5.0 * k.force(HEAVE, c)) for c in commands]
    forces = [(c, round(2.0 * force) / 2.0) for c, force in (*exact, *((-c, -0.76 * force) for c, force in exact))]
    found = folder_with(tmp_path, {"thrust_top": forces}, ["heave"])
    assert "a_t_top_reverse" in found.thrust["top"].estimate.names
    assert not [finding for finding in found.findings if finding.kind == "asymmetry"]


@pytest.fixture(scope="module")
def by_direction(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    """Identify a vehicle with 60 % thrust in reverse, and with twice the drag upward."""
    k = untuned(load_vehicle(VIDEORAY).rov)
    ahead, back = (0.1, 0.2, 0.4, 0.6, 0.8), dict[str, float]()
    tables = {}
    for name, m in (("rear", SURGE), ("top", HEAVE)):
        forces = [(c, k.force(m, c)) for c in ahead]
        tables[f"thrust_{name}"] = [*forces, *((-c, -0.6 * F) for c, F in forces)]
        back |= {f"{key}_{name}": 0.6 * k[f"{key}_{name}"] for key in ("a_t", "b_t")}
    up = k.replaced({**back, "a_d_w": 2.0 * k["a_d_w"], "b_d_w": 2.0 * k["b_d_w"]})
    tables["steady_heave"] = [(c, k.response(HEAVE, c)[0]) for c in ahead]
    tables["steady_heave"] += [(-c, -up.response(HEAVE, c)[0]) for c in ahead]
    tables["time_constant_heave"] = [(c, k.response(HEAVE, c)[1]) for c in ahead]
    return folder_with(tmp_path_factory.mktemp("by_direction"), tables, ["surge", "heave"])


def test_thrust_and_drag_by_direction_reach_the_vehicle_file(
    by_direction: Identification, tmp_path: Path, k: Rov
) -> None:
    found = by_direction
    assert not any(f.curve or (f.kind, f.axis) == ("asymmetry", "heave") for f in found.findings)
    write_vehicle(found.vehicle, tmp_path / "made.toml")
    read = load_vehicle(tmp_path / "made.toml").rov
    for name in ("a_t_rear", "b_t_rear", "a_t_top", "b_t_top"):
        assert read[name] == pytest.approx(k[name], rel=1e-3)
        assert read[f"{name}_reverse"] == pytest.approx(0.6 * k[name], rel=1e-3)
    for name in ("a_d_w", "b_d_w"):
        assert [read[name], read[f"{name}_reverse"]] == pytest.approx([k[name], 2.0 * k[name]], rel=0.01)
    assert found.vehicle.sources["a_t_top_reverse"] == "(6) over 10 forces"
    assert found.vehicle.sources["b_d_w_reverse"] == "Least squares of the relative errors of 10 V_ss and 5 Tau"


@pytest.mark.long
def test_report_says_what_is_by_direction(by_direction: Identification) -> None:
    page = report_page(by_direction)
    assert page.count("<td>a curve of its own in reverse</td><td>taken</td>") == 2
    assert page.count("<td>drag by direction</td><td>taken</td>") == 1
    assert "a_d_w_reverse" in page


def test_tables_are_checked_against_recordings(full_folder: Path, tmp_path: Path) -> None:
    shutil.copy(full_folder / "log_surge_1.csv", tmp_path)
    found = folder_with(tmp_path, {"steady_surge": [(0.3, 0.6), (0.5, 1.2)]}, ["surge"])
    assert [axis.chosen for axis in found.axes] == ["recordings"]
    assert ("tables against recordings", "surge") in [(finding.kind, finding.axis) for finding in found.findings]


@pytest.mark.long
def test_tables_join_the_fit_to_recordings(full_folder: Path, tmp_path: Path) -> None:
    """With a lag of the thrusters Tau takes no part; the row at a command outside the window does not count."""
    k = load_vehicle(VIDEORAY).rov.replaced({"alpha_w": 1.0})
    random, commands = np.random.default_rng(5), (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    rows = {
        f"{name}_heave": [(c, k.response(HEAVE, c)[n] * (1.0 + 0.02 * random.standard_normal())) for c in commands]
        for n, name in enumerate(("steady", "time_constant"))
    }
    methods = []
    for lag in (False, True):
        folder = tmp_path / str(lag)
        folder.mkdir()
        for name in ("log_heave_1.csv", "thrust_top.csv"):
            shutil.copy(full_folder / name, folder)
        for name, values in rows.items():
            unit = "time constant [s]" if "time" in name else "velocity [m/s]"
            write_csv(folder / f"{name}.csv", f"command [1],{unit}", values)
        write_rov(folder, heave=(0.15, 1.0))
        if lag:
            path = folder / "rov.toml"
            path.write_text(path.read_text(encoding="utf-8") + "\n[fit]\nlag = true\n", encoding="utf-8")
        (heave,) = identify(load_tank_tests(folder)).axes
        methods.append(heave.method)
        for command in commands[1:]:
            assert heave.recordings
            assert heave.recordings.rov.response(HEAVE, command)[0] == pytest.approx(
                k.response(HEAVE, command)[0], rel=0.02
            )
    assert methods == [f"output error over 1 recording and {n} points" for n in (12, 6)]


def test_known_coefficients_are_kept(tmp_path: Path) -> None:
    """All tests are at one command, and the vehicle holds a twentieth of full thrust around it."""
    known = 'beta_u = { value = 0.8, unit = "1", source = "a guess", interval = [0.7, 0.9] }\n'
    found = folder_with(tmp_path, {"steady_surge": [(0.3, 0.43)]}, ["surge"], known)
    assert found.vehicle.command_range == pytest.approx((0.25, 0.35))
    assert (found.vehicle.rov["beta_u"], found.vehicle.sources["beta_u"]) == (0.8, "a guess")
    assert found.vehicle.intervals["beta_u"] == (0.7, 0.9)
    assert not any("beta_u" in warning for warning in found.warnings)


def test_estimate_without_freedom_has_no_interval() -> None:
    estimate = Estimate(("a_d_u", "beta_u"), np.array([1.0, 2.0]), np.diag([np.inf, 0.04]), 5.0, 0.1)
    assert estimate.interval("a_d_u") is None
    low, high = estimate.interval("beta_u") or (0.0, 0.0)
    assert low * high == pytest.approx(4.0), "a factor's interval is symmetric in its logarithm"
    assert np.isnan(estimate.correlation[0, 0])


# ---- Parts of an identification --------------------------------------------------------------------------------------


def test_progress_is_told_by_the_share_of_the_work(tmp_path: Path) -> None:
    """Units are checked in a tenth, recordings fitted up to nine tenths, and the next tests found in the rest."""
    rows = {
        "steady_surge": [(c, 1.1 * c) for c in (0.3, 0.5, 0.7)],
        "steady_heave": [(c, 0.5 * c) for c in (0.3, 0.5, 0.7)],
    }
    told: list[tuple[str, float]] = []
    for name, values in rows.items():
        write_csv(tmp_path / f"{name}.csv", "command [1],velocity [m/s]", values)
    for curve, a in (("rear", 40.0), ("top", 6.0)):
        write_csv(
            tmp_path / f"thrust_{curve}.csv", "command [1],force [N]", [(c, a * c * c) for c in (0.3, 0.5, 0.7, 0.9)]
        )
    write_rov(tmp_path)
    identify(load_tank_tests(tmp_path), lambda words, share: told.append((words, share)))
    words, shares = zip(*told, strict=True)
    assert words == (
        "thrust curves",
        "units and signs of surge",
        "units and signs of heave",
        "recordings of surge",
        "recordings of heave",
        "what to measure next of surge",
        "what to measure next of heave",
    )
    assert shares == pytest.approx((0.0, 0.0, 0.05, 0.1, 0.1, 0.9, 0.95))


@pytest.mark.parametrize(
    ("points", "dead_band", "expected"),
    [
        ([(0.3, 1.0), (-0.7, 1.0), (0.1, 0.0), (0.9, 0.0)], 0.0, (0.3, 0.7)),
        ([(0.05, 1.0), (0.3, 1.0), (0.6, 1.0)], 0.05, (0.3, 0.6)),
        ([(0.3, 1.0), (-0.3, 1.0)], 0.0, (0.25, 0.35)),
        ([(0.02, 1.0)], 0.0, (0.0, 0.07)),
        ([(1.0, 1.0)], 0.0, (0.95, 1.0)),
        ([], 0.0, (0.0, 1.0)),
    ],
)
def test_the_range_of_commands_is_that_of_the_points_beyond_the_dead_band(
    points: list[tuple[float, float]], dead_band: float, expected: tuple[float, float], k: Rov
) -> None:
    rov = k.extended({"c_0_top": dead_band, "c_0_rear": 0.01}) if dead_band else k
    result = AxisResult(
        HEAVE, tuple(Point("V_ss", c, c, weight, "") for c, weight in points), (), None, None, None, {}, ()
    )
    assert module._command_range([result], rov) == pytest.approx(expected)


def test_points_within_the_window_count_and_those_of_steps_have_their_time(tmp_path: Path) -> None:
    write_csv(tmp_path / "steady_heave.csv", "command [1],velocity [m/s]", [(0.2, 0.1), (0.5, 0.3), (0.8, 0.4)])
    write_csv(tmp_path / "thrust_top.csv", "command [1],force [N]", [(0.3, 0.6), (0.6, 2.4), (0.9, 5.4)])
    write_rov(tmp_path, heave=(0.5, 0.7))
    tests = load_tank_tests(tmp_path)
    steps = [
        StepResponse("log.csv", 3.04, 20.0, 0.0, 0.7, V_ss=0.35, V_ss_error=0.01, Tau=1.5, Tau_error=0.1),
        StepResponse("log.csv", 20.0, 40.0, 0.7, 0.71, V_ss=0.36, V_ss_error=0.02),
    ]
    assert module._points(tests, HEAVE, steps) == (
        Point("V_ss", 0.2, 0.1, 0.0, "steady_heave.csv, line 2"),
        Point("V_ss", 0.5, 0.3, 1.0, "steady_heave.csv, line 3"),
        Point("V_ss", 0.8, 0.4, 0.0, "steady_heave.csv, line 4"),
        Point("V_ss", 0.7, 0.35, 1.0, "log.csv, 3.0 s", 0.01),
        Point("Tau", 0.7, 1.5, 1.0, "log.csv, 3.0 s", 0.1),
        Point("V_ss", 0.71, 0.36, 0.0, "log.csv, 20.0 s", 0.02),
    )
    assert [module._weight(tests, "surge", c) for c in (-1.0, 1.0)] == [1.0, 1.0], "without a window all count"


@pytest.mark.parametrize(("delay", "Tau"), [(0.4, 1.1), (-0.2, 1.7), (1.5, 1.5), (2.0, 1.5)])
def test_the_delay_is_no_part_of_a_time_constant(delay: float, Tau: float, k: Rov) -> None:
    """A delay as long as the time constant explains nothing."""
    nothing = Estimate((), np.zeros(0), np.zeros((0, 0)), 1.0, 1.0)
    effects = [
        FittedEffect("delay", of, "s", value, None, kept)
        for of, value, kept in (("heave", delay, True), ("surge", 9.0, True), ("heave", 9.0, False))
    ]
    fit = RecordingsFit(HEAVE, k, nothing, nothing, (), tuple(effects), lambda: HeldOut((), by_halves=False))
    step = StepResponse("log.csv", 0.0, 20.0, 0.0, 0.5, V_ss=0.3, V_ss_error=0.01, Tau=1.5, Tau_error=0.1)
    assert module._in_time(step, fit).Tau == pytest.approx(Tau)
    assert module._in_time(step, None) == step
    assert module._in_time(replace(step, Tau=None), fit).Tau is None


def test_forces_at_one_command_are_no_curve(tmp_path: Path) -> None:
    write_csv(tmp_path / "steady_heave.csv", "command [1],velocity [m/s]", [(0.2, 0.1), (0.5, 0.3), (0.8, 0.4)])
    write_csv(tmp_path / "thrust_top.csv", "command [1],force [N]", [(0.3, 0.6), (-0.3, -0.6), (0.0, 0.0)])
    write_rov(tmp_path)
    with pytest.raises(DataFileError, match=r"thrust_top\*.csv: at least two commands must count"):
        identify(load_tank_tests(tmp_path))


@pytest.mark.parametrize(("full", "at_full"), [(0.19, False), (0.21, True)])
def test_saturation_is_the_likely_cause_from_a_fifth_of_the_time_on(full: float, at_full: bool, k: Rov) -> None:
    command = np.where(np.arange(100) < round(100 * full), -0.999, 0.3)
    recording = Recording("log.csv", HEAVE, "depth", np.arange(100.0), command, np.zeros(100))
    still = replace(recording, command=np.full(100, 0.998))
    cause = module._likely_cause([still, recording], k)
    assert cause.startswith(f"The thrusters are at full command for {full:.0%}") == at_full
