"""A folder of tests becomes a vehicle: end to end, with logs of one axis, tables, or both, and what is refused."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from rov_fmu.c.simulation import simulate
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.identify import given
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.identified_vehicle import _head
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood.kinds import PRIORS, USUAL_EXPONENT
from rov_fmu.identify.result import AxisResult, Identification, coverage_of
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.commands import REFIT, Capsys, without_progress
from tests.folders import BLUEROV2, DOWN, FORCE, HEAD, SPEED, folder_of, read, responses
from tests.identify.conftest import FORCES, KNOWN, Identified, add_voltage
from tests.often import spread
from tests.recordings import PLANS, Measured, run, with_more, write_log
from tests.vehicles import VIDEORAY

TRUTH = VIDEORAY.with_(alpha_u=1.0, alpha_w=1.0, alpha_r=1.0, beta_u=0.8)
"""The true vehicle. Its forces are those of a scale in a tank, so that every α is 1."""
COMMANDS = (0.3, -0.3, 0.5, -0.5)
STILL = "time [s],command [%],depth [m]\n" + "".join(f"{n / 10},{30 * (n > 9)},1.5\n" for n in range(50))


def with_logs(folder: Path, axis: Axis, count: int, rov: str = KNOWN, tables: Mapping[str, str] = FORCES) -> Path:
    """Write a folder with the first logs of an axis at 5 Hz, with noise."""
    path, random = folder_of(folder, rov, tables), np.random.default_rng(0)
    for n, plan in enumerate(PLANS[axis.name][:count]):
        write_log(path, str(n), run(TRUTH, axis, plan, 5.0).noisy(random))
    return path


def of_axis(found: Identification, axis: Axis) -> AxisResult:
    return next(result for result in found.axes if result.axis == axis)


def kinds(found: Identification) -> set[tuple[str, str]]:
    """Return the kinds of all findings, with what they are about."""
    return {(finding.kind, finding.axis or finding.curve or finding.file) for finding in found.findings}


def check_answers(result: AxisResult, near: float, commands: tuple[float, ...] = COMMANDS) -> None:
    """Check V_ss, Tau and the stopping distance: each interval contains the truth (if it is 1.6 times as wide).

    One of twenty intervals misses the truth, and a single log has twelve of them.
    """
    assert {answer.command for answer in result.answers} >= {*commands}
    for answer in (answer for answer in result.answers if answer.command in commands):
        V_ss, Tau = TRUTH.response(result.axis, answer.command)
        truths = {"V_ss": (answer.steady, V_ss), "Tau": (answer.rise, Tau), "stop": (answer.stop, stop(result, V_ss))}
        for name, ((value, (low, high)), true) in truths.items():
            assert value == pytest.approx(true, rel=near), (name, answer.command)
            assert abs(true - 0.5 * (low + high)) < 1.6 * 0.5 * (high - low), (name, answer.command)


def stop(result: AxisResult, V_ss: float) -> float:
    """Return the way from a velocity to a tenth of it without thrust, by the engine."""
    axis, at = result.axis, np.linspace(0.0, 60.0, 30_001)
    position = {"surge": "x", "heave": "z", "yaw": "psi"}[axis.name]
    v, x = simulate(TRUTH, at, {axis.velocity: abs(V_ss)}, [axis.velocity, position]).values[:, 0]
    return float(np.interp(-0.1 * abs(V_ss), -v, x))


# ---- Tables alone ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def of_tables(identified: Identified) -> Identification:
    """Identify heave from forces, V_ss and Tau without errors, and a row that [windows] leaves out."""
    tables = {**FORCES, **responses(TRUTH, HEAVE)}
    tables["steady_heave.csv"] += "0.9,2.5\n"
    rov = f"{KNOWN}[windows]\nheave = [-1.0, 0.85]\n"
    return identified("tables of heave", lambda folder: read(folder, rov, tables))


def test_tables_of_a_vehicle_give_the_vehicle(of_tables: Identification) -> None:
    (heave,) = of_tables.axes
    check_answers(heave, 1e-3)
    for name in ("a_d_w", "b_d_w", "beta_w", "a_t_top", "b_t_top"):
        low, high = of_tables.vehicle.intervals[name]
        assert of_tables.vehicle[name] == pytest.approx(TRUTH[name], rel=2e-3)
        assert low <= TRUTH[name] <= high
    assert heave.verdict.word == "good"
    left_out = {("axis left out", "surge"), ("axis left out", "yaw"), ("unused curve", "rear")}
    assert kinds(of_tables) == {("nothing predicted", "heave"), *left_out}
    used = [p for p in (*heave.points, *of_tables.forces) if p.counts]
    assert {(p.quantity, p.unit) for p in used} == {("V_ss", "m/s"), ("Tau", "s"), ("force", "N")}
    for p in used:
        assert p.model == pytest.approx(p.measured, rel=1e-3)
        assert p.held_out == pytest.approx(p.measured, rel=0.03)
    (outside,) = (p for p in heave.points if not p.counts)
    assert (outside.command, outside.measured, np.isnan(outside.held_out)) == (0.9, 2.5, True)


# ---- The vehicle file ------------------------------------------------------------------------------------------------


def check_file(found: Identification, path: Path) -> Vehicle:
    """Check that the vehicle is the same after it is written and read; the vehicle as read."""
    write_vehicle(found.vehicle, path)
    read_again, made = load_vehicle(path), found.vehicle
    for name, value in made.coefficients.items():
        assert read_again[name] == pytest.approx(value, rel=1e-5)
    assert read_again.intervals.keys() == made.intervals.keys()
    for name, interval in made.intervals.items():
        assert read_again.intervals[name] == pytest.approx(interval, rel=1e-5)
    assert read_again.uncertainty.errors == pytest.approx(made.uncertainty.errors, rel=1e-5)
    assert read_again.uncertainty.correlation == pytest.approx(made.uncertainty.correlation, abs=2e-6)
    assert read_again.sources == made.sources
    same = {key: getattr(made, key) for key in ("layout", "coefficients", "basis")}
    assert replace(read_again, **same) == made
    return read_again


def test_the_vehicle_file_is_read_as_it_was_written(of_tables: Identification, tmp_path: Path) -> None:
    vehicle = check_file(of_tables, tmp_path / "made.toml")
    made = vehicle.provenance
    assert made
    assert {*made.inputs} == {"rov.toml", "thrust_top.csv", "thrust_rear.csv", "steady_heave.csv"} | {
        "time_constant_heave.csv"
    }
    assert of_tables.vehicle.provenance
    assert of_tables.vehicle.measured_from == "tank tests"
    groups = by_heading(of_tables.findings)
    assert (made.warnings, made.facts) == ((*groups["Warnings"], *groups["Doubts"]), groups["Facts"])
    assert vehicle.command_range == (0.2, 0.8)


@pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # of what no test told
def test_what_a_base_knows_is_kept_where_no_test_tells_anew(tmp_path: Path) -> None:
    base = load_vehicle(REFIT)
    by_hand = '[known]\nbeta_w = { value = 0.6, unit = "1", source = "by hand", interval = [0.5, 0.7] }\n'
    tests = read(tmp_path, f'base = "videoray_refit"\n{HEAD}{by_hand}', responses(TRUTH, YAW))
    assert tests.layout == base.layout
    assert tests.folder.inputs.keys() == {"rov.toml", "videoray_refit", "steady_yaw.csv", "time_constant_yaw.csv"}
    result = identify(tests)
    about = {finding.axis or finding.curve for finding in result.findings}
    assert about == {"yaw", "rear"}, "the untested axes lack nothing"
    found = check_file(result, tmp_path / "made.toml")
    assert (found["beta_w"], found.sources["beta_w"], found.intervals["beta_w"]) == (0.6, "by hand", (0.5, 0.7))
    for name in ("a_d_u", "b_d_u", "a_d_w", "b_d_w", "beta_u", "m_rov", "a_t_top"):
        assert (found[name], found.sources[name]) == (base[name], base.sources[name])
        assert found.intervals.get(name) == base.intervals.get(name)
    for command in (0.3, -0.5):
        assert found.response(YAW, command) == pytest.approx(TRUTH.response(YAW, command), rel=0.02)
    assert "a_d_r" in found.intervals


@pytest.mark.long
def test_intervals_of_tables_cover_the_truth(tmp_path: Path) -> None:
    """Forces scatter by 2 % and motion by 3 %; of 8 vehicles, fewer than the limit miss once in 1,000 cases."""
    random, exact = np.random.default_rng(2), {**FORCES, **responses(TRUTH, HEAVE)}
    covered: dict[str, list[bool]] = {}
    for n in range(8):
        tables = {}
        for name, text in exact.items():
            share, (header, *lines) = 0.02 if name.startswith("thrust") else 0.03, text.splitlines()
            rows = (line.split(",") for line in lines if line)
            noisy = (f"{c},{float(y) * (1.0 + share * random.standard_normal())}" for c, y in rows)
            tables[name] = "\n".join([header, *noisy, ""])
        found = identify(read(tmp_path / str(n), KNOWN, tables))
        for name in {"a_d_w", "b_d_w", "beta_w"} & found.vehicle.intervals.keys():  # a lag may hide the inertia
            low, high = found.vehicle.intervals[name]
            covered.setdefault(name, []).append(low <= TRUTH[name] <= high)
        for answer in found.axes[0].answers:
            V_ss, Tau = TRUTH.response(HEAVE, answer.command)
            for name, (_, (low, high)), true in (("V_ss", answer.steady, V_ss), ("Tau", answer.rise, Tau)):
                covered.setdefault(f"{name} {answer.command}", []).append(low <= true <= high)
    assert len(covered) == 3 + 2 * 8
    missed = {key: (sum(v), len(v)) for key, v in covered.items() if sum(v) < binom.ppf(0.001, len(v), 0.95)}
    assert not missed


@pytest.mark.weekly
@pytest.mark.parametrize("astern", [0.08, 0.05])
def test_dead_bands_are_found_from_forces_and_dives(astern: float, tmp_path: Path) -> None:
    """The pool simulates two dives of 80 s with commands of whole per cent, at which J has kinks, for each vehicle."""
    random, covered = np.random.default_rng(0), dict[str, list[bool]]()
    numbers = {"a_t_top": 20.0, "b_t_top": 3.0, "a_t_top_reverse": 15.0, "b_t_top_reverse": 2.0, "c_0_top": 0.08}
    true = with_more(TRUTH, **numbers, c_0_top_reverse=astern, T_top=0.12)

    def force(c: float) -> float:
        a, b, band = (20.0, 3.0, 0.08) if c > 0.0 else (-15.0, -2.0, astern)
        beyond = max(abs(c) - band, 0.0)
        return (a * beyond + b) * beyond

    for n in range(4):
        rows = (
            f"{c:.1f},{force(c) + 0.3 * random.standard_normal():.3f}\n" for c in np.repeat(np.arange(-10, 11), 2) / 10
        )
        path = folder_of(tmp_path / str(n), KNOWN, {"thrust_top.csv": f"{FORCE}\n" + "".join(rows)})
        for dive in range(2):
            commands = random.choice([-1.0, 0.0, 1.0], 20) * random.uniform(0.05, 0.9, 20).round(2)
            plan = ((0.0, 2.0), *((c, 4.0) for c in commands.tolist()))
            write_log(path, str(dive), run(true, HEAVE, plan, 10.0).noisy(random, noise=0.01))
        found = identify(load_tests(path)).vehicle
        assert found.uncertainty
        for name, value in (numbers | {"c_0_top_reverse": astern}).items():
            low, high = found.intervals.get(name, found.intervals["c_0_top"])
            covered.setdefault(name, []).append(low <= value <= high)
            assert name[:2] == "a_" or high - low < 3.0, "an interval is not just wide"
    assert min(map(sum, covered.values())) >= binom.ppf(0.001, 4, 0.95), covered


@pytest.mark.parametrize(
    ("power", "band"),
    [
        pytest.param(1.45, 0.06, marks=pytest.mark.long),
        *(pytest.param(*law, marks=pytest.mark.weekly) for law in ((2.2, 0.0), (2.0, 0.1))),
    ],
)
def test_the_file_of_a_measured_curve_tells_how_far_off_its_forces_are(
    power: float, band: float, tmp_path: Path
) -> None:
    """The force grows with a power of the command beyond a dead band. A file has a quadratic curve, which misses the
    first two laws; the third is quadratic without a linear share, which may not be negative."""
    random, covered = np.random.default_rng(5), []

    def force(c: float) -> float:
        share = max(abs(c) - band, 0.0) / (1.0 - band)
        return float((22.0 if c > 0.0 else -15.0) * share**power)

    for n in range(3):
        forces, speeds = f"{FORCE}\n", f"{SPEED}\n"
        for c in (sign * size for size in (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0) for sign in (1.0, -1.0)):
            forces += "".join(f"{c},{force(c) + 0.3 * random.standard_normal():.4f}\n" for _ in range(2))
            V = np.sign(c) * (np.sqrt(36.0 + 180.0 * abs(force(c))) - 6.0) / 90.0  # 45 V² + 6 V = F
            speeds += f"{c},{V * (1.0 + 0.02 * random.standard_normal()):.5f}\n"
        found = identify(read(tmp_path / str(n), DOWN, {"thrust_t200.csv": forces, "steady_heave.csv": speeds})).vehicle
        write_vehicle(found, tmp_path / f"{n}.toml")
        vehicle = load_vehicle(tmp_path / f"{n}.toml")
        known = vehicle.uncertainty
        rows = known.drawn(random.random((1000, len(known.names)))).tolist()
        drawn = [vehicle.with_(**dict(zip(known.names, row, strict=True))) for row in rows]
        for c in (sign * size for size in (0.3, 0.5, 0.7, 1.0) for sign in (1.0, -1.0)):
            some = [one.curve_force(one.layout.curves[0], c) for one in drawn]
            low, high = np.quantile(some, [0.025, 0.975])
            covered.append(low <= force(c) <= high)
            assert high - low < 0.2 * 22.0, "an interval is not just wide"
    assert sum(covered) >= binom.ppf(0.001, len(covered), 0.95), covered


# ---- Logs of one axis ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def of_logs(identified: Identified) -> Identification:
    """Identify heave from forces, two logs, and one that teaches nothing."""

    def tests(folder: Path) -> given.Tests:
        (with_logs(folder, HEAVE, 2) / "log_heave_2.csv").write_text(STILL, encoding="utf-8")
        return load_tests(folder)

    return identified("logs of heave", tests)


@pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # of what no test told
def test_logs_of_a_vehicle_give_the_vehicle(of_logs: Identification, tmp_path: Path) -> None:
    (heave,) = of_logs.axes
    check_answers(heave, 0.03)
    for name in ("a_d_w", "b_d_w", "beta_w"):
        low, high = of_logs.vehicle.intervals[name]
        assert low <= TRUTH[name] <= high
    assert heave.verdict.word == "good"
    vehicle = check_file(of_logs, tmp_path / "made.toml")
    for answer in heave.answers:  # the file has the quadratic curve that is nearest to the fitted one
        assert vehicle.response(HEAVE, answer.command) == pytest.approx((answer.steady[0], answer.rise[0]), rel=0.02)
    made = vehicle.provenance
    assert made
    assert ("constant motion", "heave") in kinds(of_logs)
    assert "log_heave_2.csv" in made.inputs
    assert any(line.startswith("log_heave_2.csv") for line in made.facts)


def test_a_vehicle_that_rocked_unseen_is_within_the_intervals(tmp_path: Path) -> None:
    """Rocking raised the drag of the dives by 4 %. Speeds, times and ways are those of the vehicle that is level."""
    path, random = folder_of(tmp_path, KNOWN, FORCES), np.random.default_rng(0)
    rocking = TRUTH.with_(**{name: 1.04 * TRUTH[name] for name in ("a_d_w", "b_d_w")})
    for n, plan in enumerate(PLANS["heave"]):
        write_log(path, str(n), run(rocking, HEAVE, plan, 5.0).noisy(random))
        log = path / f"log_heave_{n}.csv"
        text = log.read_text(encoding="utf-8").replace("command", "u_t")
        log.rename(path / f"dive_{n}.csv").write_text(text, encoding="utf-8")
    (heave,) = identify(load_tests(path)).axes
    for answer in (one for one in heave.answers if one.command in COMMANDS):
        V_ss, Tau = TRUTH.response(HEAVE, answer.command)
        truth = V_ss, Tau, stop(heave, V_ss)
        for true, (_, (low, high)) in zip(truth, (answer.steady, answer.rise, answer.stop), strict=True):
            assert low <= true <= high, answer


def test_unseen_logs_are_predicted_and_the_noise_of_the_sensor_is_found(of_logs: Identification) -> None:
    """Each log is predicted from the other one: over its length, and anew after each 10 s."""
    predictions = of_axis(of_logs, HEAVE).predictions
    assert {(p.file, p.span) for p in predictions} == {
        (f"log_heave_{n}.csv", span) for n in (0, 1) for span in (10.0, np.inf)
    }
    for p in predictions:
        assert (p.quantity, p.unit, p.by) == ("depth", "m", "the other log")
        assert p.error < 0.1 * p.unchanged
        begins = p.span * np.floor((p.time - p.time[0]) / p.span) if np.isfinite(p.span) else 0.0 * p.time
        changed = p.measured - p.measured[np.searchsorted(p.time - p.time[0], begins)]
        assert p.unchanged == pytest.approx(np.sqrt(np.mean(changed**2)))
        assert (p.time[0], p.time[-1]) == pytest.approx((5.0, 59.8)), "after the time in which the filter settles"
        assert p.noise == pytest.approx(0.005, rel=0.2)
        off = p.measured - p.predicted
        assert p.error == pytest.approx(np.sqrt(np.mean(off**2)))
        assert p.coverage == pytest.approx(np.mean(np.abs(off) < 1.96 * p.deviation))
    assert coverage_of(of_axis(of_logs, HEAVE).predictions) > 0.9
    (sensor,) = of_logs.sensors
    assert (sensor.axis, sensor.quantity, sensor.unit, sensor.samples) == (HEAVE, "depth", "m", 2 * 300)
    assert np.hypot(sensor.white, sensor.coloured) == pytest.approx(0.005, rel=0.15)


Change = Callable[[Measured, np.random.Generator], Measured]


def with_outliers(log: Measured, random: np.random.Generator) -> Measured:
    """Return a log of which 3 % of the samples are off by metres."""
    return replace(log, values=log.values + 1.5 * random.standard_normal(300) * (random.random(300) < 0.03))


def with_gaps(log: Measured, random: np.random.Generator) -> Measured:
    """Return a log that begins in motion, at irregular times, without some of its values."""
    some = np.sort(random.choice(np.arange(35, 300), 200, replace=False))
    values = np.where(random.random(200) < 0.1, np.nan, log.values[some])
    return replace(log, time=log.time[some], command=log.command[some], values=values)


def with_both(log: Measured, random: np.random.Generator) -> Measured:
    return with_gaps(with_outliers(log, random), random)


@pytest.mark.parametrize(
    ("change", "near", "share"),
    [
        pytest.param(with_both, 0.15, 0.55, marks=pytest.mark.long),
        pytest.param(with_outliers, 0.15, 0.45, marks=pytest.mark.weekly),
        pytest.param(with_gaps, 0.05, 0.1, marks=pytest.mark.weekly),
    ],
)
def test_a_log_with_faults_gives_the_vehicle(change: Change, near: float, share: float, tmp_path: Path) -> None:
    """Outliers count as errors of the predictions: the errors are below this share of those of no change."""
    path, random = folder_of(tmp_path / "tests", KNOWN, FORCES), np.random.default_rng(3)
    write_log(path, "0", change(run(TRUTH, HEAVE, PLANS["heave"][0], 5.0).noisy(random), random))
    stages = dict[str, list[float]]()
    (heave,) = identify(load_tests(path), lambda stage, share: stages.setdefault(stage, []).append(share)).axes
    first, *others = stages
    assert (stages.pop(first), others[-1]) == ([0.0], "predicting what was left out")
    assert np.isnan(np.concatenate([*stages.values()])).all(), "nothing tells how long a stage will be"
    check_answers(heave, near)
    by = {p.by: (p.time[0], p.time[-1]) for p in heave.predictions}
    assert by["the first half"][0] > by["the second half"][1] > 25.0, "each half is predicted from the other one"
    assert all(p.error < share * p.unchanged for p in heave.predictions)
    assert coverage_of(heave.predictions) > 0.75


# ---- What rov.toml says ----------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # of what no test told
@pytest.mark.parametrize(
    "key",
    spread([key for key in PRIORS if not key.endswith("noise")], (), ["thrust_shape", "voltage"]),
)
def test_any_prior_but_that_of_noise_may_be_exact(key: str, tmp_path: Path) -> None:
    rov = f'base = "videoray"\n{HEAD}[fit]\nvoltage = true\n[priors]\n{key} = 0\n'
    folder = with_logs(tmp_path, HEAVE, 1, rov, {})
    (path,) = folder.glob("log_*.csv")
    add_voltage(path)
    found = identify(load_tests(folder))
    assert all(np.isfinite(value) for value in found.vehicle.coefficients.values())
    assert all(np.isfinite(effect.evidence) for effect in found.effects)
    assert key.replace("_", " ") not in {effect.kind for effect in found.effects}
    if key == "voltage":
        assert found.vehicle["n_V_top"] == USUAL_EXPONENT
        assert found.vehicle.layout.voltage_source == "Mean voltage of the logs"
        write_vehicle(found.vehicle, tmp_path / "own.toml")
        vehicle = load_vehicle(tmp_path / "own.toml")
        assert vehicle["V_0_top"] == pytest.approx(found.vehicle["V_0_top"], rel=1e-5)
        assert vehicle["V_0_top"] == pytest.approx(vehicle.layout.voltage, abs=1e-3)
    if key.startswith("slow_"):
        assert key.replace("_", " ") not in {one.kind for one in found.disturbances}


# ---- A log that its commands do not explain --------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::rov_fmu.VehicleWarning")  # of what no test told
@pytest.mark.parametrize("seed", spread(range(6), (), [1]))
def test_a_log_that_has_nothing_to_do_with_its_commands_must_not_be_used(
    seed: int, tmp_path: Path, capsys: Capsys
) -> None:
    """Beside exact measurements, rounding decides whether motions that no sensor measures diverge; the fit ends."""
    names, random = ",".join(f"u_{n} [1]" for n in range(1, 7)), np.random.default_rng(seed)
    time = np.arange(0.0, 6.0, 0.1)
    up = np.repeat(random.uniform(-0.45, 0.45, (6, 2)), 10, axis=0)
    rows = np.column_stack([time, np.zeros((60, 4)), up, np.sin(time), 0.01 * np.sin(3.0 * time)])
    lines = [f"time [s],{names},depth [m],heading [rad]", *(",".join(f"{x:.6f}" for x in row) for row in rows)]
    folder, out = folder_of(tmp_path / "tests", BLUEROV2, {"dive.csv": "\n".join(lines) + "\n"}), tmp_path / "rov.toml"
    code = main(["identify", str(folder), "-o", str(out)])
    printed, err = capsys.readouterr()
    if code == 2:  # the commands that this seed drew push in one direction only
        assert "that determines nothing. Fly longer" in err
        return
    assert code == 0
    assert "heave: do not use." in printed
    assert "more than 100% of the thrust" in printed
    assert load_vehicle(out).layout.bare_axes


# ---- Tests that cannot be used ---------------------------------------------------------------------------------------


BACKWARD = f"{FORCE}\n0.2,0.0\n0.5,-0.5\n0.8,-2.0\n"
UP = f"{SPEED}\n0.3,-0.2\n0.5,-0.3\n0.8,-0.5\n"
ALL = "".join(
    f'{name} = {{ value = {TRUTH[name]}, unit = "{TRUTH.layout.coefficients[name].unit}", source = "s" }}\n'
    for name in ("a_t_top", "b_t_top", "a_d_w", "b_d_w", "beta_w")
)
TABLES = {**FORCES, **responses(TRUTH, HEAVE)}


@pytest.mark.parametrize(
    ("rov", "tables", "words"),
    [
        (KNOWN, {"thrust_top.csv": f"{FORCE}\n0.2,0\n0.5,0\n"}, "thrust_top*.csv: must give a force above 0"),
        (KNOWN + ALL, {"steady_heave.csv": TABLES["steady_heave.csv"]}, "nothing is identifiable: rov.toml gives all"),
        (KNOWN, {**TABLES, "thrust_top.csv": BACKWARD}, "thrust_top"),
        (KNOWN, {**FORCES, "steady_heave.csv": UP}, "steady_heave"),
        (
            KNOWN,
            {**responses(TRUTH, SURGE), **responses(TRUTH, HEAVE)},
            "no thrust_rear*.csv, and [known] in rov.toml does not give a_t_rear … no thrust_top*.csv, and [known]",
        ),
        (f"{KNOWN}[priors]\nthrst = 0.0\n", TABLES, "priors.thrst"),
        (f"{KNOWN}[priors]\nthrust = -1.0\n", TABLES, "priors.thrust"),
        (f"{KNOWN}[priors]\nwhite_noise = 0\n", TABLES, "priors.white_noise = 0: must be above 0"),
    ],
)
def test_a_folder_that_cannot_be_used_is_one_line(
    rov: str, tables: Mapping[str, str], words: str, tmp_path: Path, capsys: Capsys
) -> None:
    folder, out = folder_of(tmp_path / "tests", rov, tables), tmp_path / "rov.toml"
    code = main(["identify", str(folder), "-o", str(out)])
    printed, err = capsys.readouterr()
    said = without_progress(err)
    assert (code, printed, out.exists()) == (2, "", False), said
    lines = said.splitlines()
    assert all(str(folder) in line and line.isprintable() for line in lines), "a line for each mistake"
    assert all(word in line for word, line in zip(words.split(" … "), lines, strict=False)), lines


@pytest.mark.parametrize(("written", "now"), [("old.csv", "log_heave_0.csv"), ("Nobody", "Nobody")])
def test_the_sentence_of_a_draft_does_not_outlive_its_log(written: str, now: str, tmp_path: Path) -> None:
    """Nor does it name a log that rov.toml leaves out of all axes. A source that a person wrote stays."""
    tests = load_tests(with_logs(tmp_path, HEAVE, 1))
    head = tests.description.tables.vehicle
    assert head
    description = f"A vehicle identified from {written}" if now != written else "Mine"
    tables = tests.description.tables.model_copy(
        update={"vehicle": head.model_copy(update={"source": written, "description": description})}
    )
    rov_file = replace(tests.folder.rov_file, description=replace(tests.description, tables=tables))
    tests.folder.rov_file = rov_file
    tests.folder.inputs = {name: "" for name in tests.folder.inputs if not name.startswith("thrust")} | {"out.csv": ""}
    tests.folder.logs.append(replace(tests.folder.logs[0], file="out.csv", channels=()))
    found = _head(tests)
    assert found["source"] == now
    assert found["description"] == description.replace(written, now)
