"""What is told of a fit: its effects, loggers and sensors, the errors of its predictions, and effects found in logs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import log
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import t

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import CURVE, HEAVE, SURGE
from rov_fmu.identify import given
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.effects import loggers_of, optional_effects, sensors_of
from rov_fmu.identify.findings import findings_of, result_sentences
from rov_fmu.identify.held_out import ahead, cautious
from rov_fmu.identify.identified_vehicle import identified_vehicle
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood import kinds
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.parameters import table_of
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.likelihood.solve import minimise
from rov_fmu.identify.result import KEPT, Identification, Interval
from tests.folders import ARM, HEAD, MASS, TURNS, folder_of
from tests.often import spread
from tests.report.results import without_findings
from tests.vehicles import VIDEORAY

Columns = dict[str, np.ndarray]
"""The columns of a log, by their titles."""
ERROR = 0.004
HALF = t.ppf(0.975, 10) * ERROR
FOUND = {"lag": 0.2, "dead time": 0.1, "dead band": 0.05, "advance": 0.1, "drag astern": log(1.3), "load": 0.03}
FOUND |= {"power of drag": 0.0, "power of drag astern": 0.0}
"""The coordinates of effects that are clear with this standard error."""


def found(fit: Fit, **others: float) -> Fit:
    """Return the fit with these effects and independent parameters. The power of drag is exact unless it is given."""
    parameters, z = (
        fit.posterior.table.parameters,
        {**FOUND, "power of drag": 0.0, **{k.replace("_", " "): v for k, v in others.items()}},
    )
    at = np.array([z.get(p.kind, old) for p, old in zip(parameters, fit.posterior.z, strict=True)])
    errors = np.array([1e-9 if p.kind.startswith("power of drag") else ERROR for p in parameters])
    posterior = Posterior(fit.posterior.table, at, np.diag(errors**2))
    null = {n: p.null for n, p in enumerate(parameters) if p.null is not None and posterior.evidence(n) < KEPT}
    absent = np.array([n in null for n in range(len(at))])
    kept = np.array([null.get(n, old) for n, old in enumerate(at.tolist())])
    file = Posterior(fit.posterior.table, kept, np.diag(~absent * errors**2), frozenset(null))
    return replace(fit, posterior=replace(posterior, z=kept), file=replace(fit.file, posterior=file))


@pytest.mark.parametrize("wider", ["file", "all effects"])
def test_an_effect_has_the_interval_of_its_coefficient(wider: str, fit: Fit, short: given.Tests) -> None:
    """It contains those of both fits, in the facts as in the table of the coefficients."""
    wide = found(fit)
    widened = [replace(of, covariance=4.0 * of.covariance) for of in wide.posteriors]
    if wider == "file":
        wide = replace(wide, file=replace(wide.file, posterior=widened[0]))
    else:
        wide = replace(wide, posterior=widened[1])
    _, coefficients = identified_vehicle(short, wide)
    (band,) = [effect for effect in optional_effects(wide) if effect.kind == "dead band" and effect.of == "top"]
    assert band.interval == pytest.approx(coefficients["c_0_top"].interval, rel=1e-6)
    assert band.interval[1] - band.interval[0] == pytest.approx(4.0 * HALF, rel=1e-6)


def test_the_vehicle_of_a_fit_has_its_effects_and_says_what_the_tests_determine(fit: Fit, short: given.Tests) -> None:
    """A number is determined where its error is at most 0.8 times that of its prior, which is 0.5 for the inertia."""
    clear = found(fit, dead_band_astern=0.0, advance_astern=log(1.2))
    inertia = {"heave": 0.79 * 0.5, "yaw": 0.81 * 0.5}
    table = fit.posterior.table
    of = [inertia.get(p.of, 0.0) * (p.kind == "inertia") for p in table.parameters]
    covariance = clear.posterior.covariance + np.diag(np.square(of))
    pair = [n for n, p in enumerate(table.parameters) if p.of == "yaw" and p.kind in ("inertia", "quadratic drag")]
    covariance[pair, pair[::-1]] = 0.6 * np.sqrt(np.prod(np.diag(covariance)[pair]))
    clear = replace(clear, posterior=replace(clear.posterior, covariance=covariance))
    vehicle, numbers = identified_vehicle(short, clear)
    assert [numbers[f"beta_{v}"].narrowed for v in "wr"] == pytest.approx([0.79, 0.81], abs=1e-3)
    assert ("beta_w" in vehicle.intervals, "beta_r" in vehicle.intervals) == (True, False)
    assert vehicle.sources["beta_r"] == "Assumed: the tests do not determine it"
    z, full = clear.file.posterior.z, fit.known.full["heave"]
    drag = table.coefficients(z.tolist())["a_d_w"]
    expected = {
        "c_0_top": (0.05, 0.04, 0.06),
        "T_top": (0.2, 0.2 - HALF, 0.2 + HALF),
        "F_0_w": (0.03 * full, (0.03 - HALF) * full, (0.03 + HALF) * full),
        "a_d_w": (drag, drag * np.exp(-HALF), drag * np.exp(HALF)),
        "a_d_w_reverse": (1.3 * drag, 1.3 * drag * np.exp(-(2.0**0.5) * HALF), 1.3 * drag * np.exp(2.0**0.5 * HALF)),
    }
    for name, (value, *ends) in expected.items():
        assert vehicle[name] == numbers[name].value == pytest.approx(value), name
        assert vehicle.intervals[name] == numbers[name].interval == pytest.approx(ends), name
        assert vehicle.sources[name] == "Identified from the tests, as the method says"
    assert vehicle.estimates["a_d_w_reverse"].correlation["a_d_w"] == pytest.approx(0.5**0.5, abs=1e-3)
    assert vehicle.estimates["F_0_w"].error * 1.96 == pytest.approx(HALF * full, rel=1e-3)
    low, high = vehicle.intervals["a_d_r"]
    assert np.log(high / low) == pytest.approx(2.0 * HALF)
    given_inertia = vehicle.estimates["a_d_r"].error * 1.96 / vehicle["a_d_r"]
    assert given_inertia == pytest.approx(0.8 * HALF, rel=1e-3), "beta_r, with which it is correlated, has no error"
    assert [numbers[name].began for name in ("T_top", "c_0_top")] == ["0.05 ± 0.15 s", "0 ± 0.05"]
    assert numbers["T_top"].narrowed == pytest.approx(ERROR / 0.15)
    assert (vehicle.command_range, vehicle.measured_from) == ((0.2, 0.8), "tank tests")
    assert vehicle["d_top"] == pytest.approx(0.1 * (vehicle["a_t_top"] + vehicle["b_t_top"]))
    assert vehicle["d_top_reverse"] == pytest.approx(0.12 * (vehicle["a_t_top_reverse"] + vehicle["b_t_top_reverse"]))
    keys = ["a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "d", "d_reverse", "T"]
    assert [[*curve.keys] for curve in vehicle.layout.curves] == [[key for key in CURVE if key in keys]] * 2


def test_the_vehicle_of_a_fit_without_effects_has_none(fit: Fit, short: given.Tests) -> None:
    bare = dict.fromkeys(("dead_time", "dead_band", "advance", "drag_astern", "load"), 0.0)
    plain, _ = identified_vehicle(short, found(fit, dead_band_astern=0.0, advance_astern=0.0, lag=0.02, **bare))
    assert [[*curve.keys] for curve in plain.layout.curves] == [["a_t", "b_t", "a_t_reverse", "b_t_reverse"]] * 2
    assert [form.keys for form in plain.layout.axes] == [("a_d", "b_d")] * 2


def test_a_made_up_kind_goes_through_fit_result_sentence_and_file(
    fit: Fit, short: given.Tests, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is declared only: the thrust along heave differs from that along other axes, as by a wake."""
    wake = kinds.Kind(
        kinds.Deviation("wake", 0.1, "thrust along an axis", "a made-up reason"),
        "made-up share of the thrust",
        ". Nobody knows why",
        keys=("alpha",),
        is_coefficient=True,
        of_axis=("alpha",),
        own=lambda _, form: {} if form.axis is HEAVE else {"deviation": 0.0},
        mean=1.0,
        null=1.0,
    )
    monkeypatch.setitem(kinds.KINDS, "wake", wake)
    assert wake.prior
    monkeypatch.setitem(kinds.PRIORS, "wake", wake.prior)
    known, old = replace(fit.known, deviations={"wake": 0.3}), fit.posterior.table
    table = table_of(known, fit.objective.logs, [p.of for p in old.parameters if p.kind == "row noise"])
    index = table.index("wake", "heave")
    assert index is not None
    assert table.parameters[index].deviation == 0.3
    z = np.insert(fit.best.z, index, 1.0)
    objective = Objective(table, fit.objective.logs, fit.objective.rows, thinned=True)
    end = minimise(objective, z, most=1, last=False)
    assert end.value <= objective.value(z, objective.runs(z))
    assert end.information[index, index] > 2.0 / 0.3**2, "the logs tell something of it"
    clear = found(replace(fit, posterior=Posterior(table, z, np.eye(len(z)))), wake=1.2)
    (effect,) = (one for one in optional_effects(clear) if one.kind == "wake")
    assert (effect.value, effect.of, effect.kept) == (1.2, "heave", True)
    result = replace(without_findings(), effects=(effect,))
    (sentence,) = result_sentences(findings_of(result), "effect")
    interval = f"({1.2 - HALF:.3f} to {1.2 + HALF:.3f})"
    assert sentence == f"heave: the made-up share of the thrust is 1.200 {interval}. Nobody knows why"
    vehicle, numbers = identified_vehicle(short, clear)
    assert vehicle["alpha_w"] == numbers["alpha_w"].value == 1.2
    assert vehicle.sources["alpha_w"] == "Identified from the tests, as the method says"
    plain, _ = identified_vehicle(short, found(clear, wake=1.0))
    assert plain["alpha_w"] == 1.0


def test_a_lag_faster_than_the_sampling_shows_is_not_told(fit: Fit) -> None:
    """However clear: a lag of 0.0159 s has a corner frequency of 10 Hz, at which the sensor is sampled."""
    for lag, is_told in ((0.0155, False), (0.0163, True)):
        some = [one for one in optional_effects(found(fit, sensor_lag=lag)) if one.kind == "sensor lag"]
        assert some
        assert all((one.evidence > KEPT, one.kept) == (True, is_told) for one in some)


def test_a_lag_at_its_least_has_its_whole_error(fit: Fit) -> None:
    shortest = found(fit, lag=kinds.LEAST_LAG).posterior
    _, covariance, _ = shortest.numbers(lambda z: np.array([shortest.table.coefficients(z)["T_top"]]))
    assert covariance == pytest.approx(np.array([[ERROR**2]]))


@pytest.mark.parametrize(("lag", "offset"), [(0.2, -0.05), (0.02, -0.03)])
def test_a_delay_that_the_vehicle_does_not_keep_is_the_loggers(lag: float, offset: float, fit: Fit) -> None:
    heave, yaw = loggers_of(found(fit, logging_offset=-0.05, logging_width=0.6, lag=lag))
    assert (heave.file, yaw.file) == ("log_heave_a.csv", "log_yaw_a.csv")
    assert (heave.interval, heave.offset, heave.width) == pytest.approx((0.1, offset, 0.06))
    assert heave.offset_interval == pytest.approx((offset - HALF, offset + HALF))


def test_sensors_have_their_noise_and_their_outliers(fit: Fit) -> None:
    """Of 200 depths, 3 are 6.5 standard deviations beside their predictions, and all others 5.5."""
    data, table = fit.best.data[0], fit.posterior.table
    off = np.where(np.arange(200) < 3, -6.5, 5.5) * np.sqrt(data.variances)
    numbers = {"white noise": log(0.01), "coloured noise": log(0.4), "correlation time": log(3.0)}
    z = np.array([numbers.get(p.kind, 0.0) for p in table.parameters])
    best = replace(fit.best, z=z, data=[replace(data, innovations=off), *fit.best.data[1:]])
    depth, heading = sensors_of(replace(fit, best=best))
    assert (depth.axis, depth.quantity, depth.unit, depth.samples, depth.outliers) == (HEAVE, "depth", "m", 200, 0.015)
    assert (depth.white, depth.coloured, depth.correlation) == pytest.approx((0.01, 0.004, 3.0))
    assert (heading.quantity, heading.outliers) == ("heading", 0.0)


def test_a_prediction_is_as_uncertain_as_its_parameters(fit: Fit) -> None:
    """Nothing is known of a heading at 1.8 rad, and thrust is never known to better than 3 %."""
    objective, z, table = fit.objective, fit.file.posterior.z, fit.posterior.table
    index, gain = table.index("quadratic drag", "yaw"), table.index("slow gain")
    assert index is not None
    assert gain is not None

    def deviations(error: float) -> np.ndarray:
        covariance = np.diag(np.where(np.arange(len(z)) == index, error**2, 0.0))
        return ahead(objective, 1, z, covariance, 5.0, 10.0)[1]

    ends = [z + step * np.eye(len(z))[index] for step in (0.01, -0.01)]
    above, below = (objective.run(end, 1, begin=5.0, span=10.0).innovations for end in ends)
    slope = (above - below) / 0.02
    assert deviations(0.2) == pytest.approx(np.hypot(deviations(0.0), 0.2 * slope), rel=0.02)
    assert deviations(10.0).max() == 1.8
    quiet, loud = (np.where(np.arange(len(z)) == gain, log(size), z) for size in (0.01, 0.05))
    assert np.exp(cautious(objective, quiet)[gain]) == pytest.approx(0.03)
    assert cautious(objective, loud).tolist() == loud.tolist()


# ---- Effects that no table of tank tests shows, in logs whose equations are written out here ----

THRUST = "".join(
    f'{key} = {{ value = {value}, unit = "N", source = "bollard pull" }}\n'
    for key, value in (("a_t_rear", 78.0), ("b_t_rear", 0.0))
)
HELD = (0.0, 0.3, 0.0, 0.6, 0.0, -0.4, 0.7, 0.0, -0.7, 0.5, 0.0, -0.3, 0.0, 0.8, 0.2)
"""Commands, each for 4 s."""


def contains(interval: Interval | None, truth: float) -> bool:
    return bool(interval and interval[0] <= truth <= interval[1])


def identified(folder: Path, rov: str, columns: Mapping[str, np.ndarray], name: str) -> Identification:
    rows = (",".join(f"{value:.6g}" for value in row) for row in zip(*columns.values(), strict=True))
    return identify(load_tests(folder_of(folder, rov, {name: "\n".join([",".join(columns), *rows])})))


@pytest.mark.weekly
@pytest.mark.parametrize("lost", [12.0, 0.0])
def test_thrust_that_falls_with_the_speed_is_found(lost: float, tmp_path: Path) -> None:
    """The thrust at rest is exact, 78 c |c| N. Of it, d |c| v is lost; the stopping distance has no thrust."""
    h, speeds, v = 0.001, [], 0.0
    commands = np.repeat(HELD, round(4.0 / h))
    for c in commands.tolist():
        speeds.append(v)
        v += h * (78.0 * c * abs(c) - lost * abs(c) * v - 38.0 * abs(v) * v - 9.0 * v) / 31.0
    measured = np.array(speeds) + 0.01 * np.random.default_rng(1).standard_normal(len(speeds))
    time = h * np.arange(len(commands))
    columns = {"time [s]": time, "command [1]": commands, "velocity [m/s]": measured}
    mass = 'm_rov = { value = 20.0, unit = "kg", source = "scale" }\n'
    every = {title: values[::100] for title, values in columns.items()}
    result = identified(tmp_path, f"{HEAD}[known]\n{mass}{THRUST}", every, "log_surge.csv")
    (surge,) = result.axes
    truth = {"a_d_u": 38.0, "b_d_u": 9.0, "beta_u": 20.0 / 31.0}
    assert [one.name for one in surge.known if contains(one.interval, truth[one.name])] == [*truth]
    kept = {effect.kind: effect for effect in result.effects if effect.kept}
    assert ("advance" in kept) == ("d_rear" in result.vehicle.coefficients) == (lost > 0.0)
    if lost:
        assert contains(kept["advance"].interval, lost / 78.0)
        assert contains(result.vehicle.intervals["d_rear"], lost)
    for answer in surge.answers:
        c = abs(answer.command)
        V = 2.0 * 78.0 * c**2 / (9.0 + lost * c + np.hypot(9.0 + lost * c, np.sqrt(4.0 * 38.0 * 78.0) * c))
        way = 31.0 / 38.0 * np.log((38.0 * V + 9.0) / (3.8 * V + 9.0))
        assert contains(answer.stop[1], way), answer
        assert contains(answer.steady[1], np.copysign(V, answer.command)), answer


@pytest.mark.parametrize("R", [0.99, 1.01])
def test_a_power_of_drag_is_unusual_beyond_a_half_unless_predictions_are_as_exact_as_the_sensors(
    R: float, fit: Fit
) -> None:
    of_heave = {axis: replace(one, ratio=R) for axis, one in fit.structure.items()}
    for power, is_far in ((-0.49, False), (0.51, True)):
        bent = replace(found(fit, power_of_drag=power), structure=of_heave)
        some = [effect for effect in optional_effects(bent) if effect.kind == "power of drag"]
        assert [effect.is_unusual for effect in some] == [is_far and R > 1.0] * 2


def moved(drag: Callable[[float], float]) -> tuple[Columns, np.ndarray, np.ndarray]:
    """Return the times and commands of 31 v' = 78 c |c| - drag(v), and position and velocity by DOP853."""
    state, some = [0.0, 0.0], list[np.ndarray]()
    for c in HELD[:9]:
        rate = partial(lambda _, x, c: [x[1], (78.0 * c * abs(c) - drag(x[1])) / 31.0], c=c)
        held = solve_ivp(rate, (0.0, 4.0), state, "DOP853", t_eval=np.linspace(0.0, 4.0, 21), rtol=1e-9, atol=1e-9).y
        some.append(held[:, :-1])
        state = held[:, -1].tolist()
    position, velocity = np.hstack(some)
    return {"time [s]": 0.2 * np.arange(180), "command [1]": np.repeat(HELD[:9], 20)}, position, velocity


@pytest.mark.parametrize(
    ("scale", "offset"),
    [
        (1.05, 0.02),
        pytest.param(1.0, 0.0, marks=pytest.mark.long),
        pytest.param(1.25, 0.2, marks=pytest.mark.long),
        pytest.param(0.8, -0.2, marks=pytest.mark.long),
    ],
)
@pytest.mark.weekly
def test_scale_and_offset_of_a_velocity_beside_a_position_are_told(scale: float, offset: float, tmp_path: Path) -> None:
    """They move no answer: V_ss are those of 78 c |c| = 38 |V| V + 9 V. Without them, nothing is told."""
    columns, position, velocity = moved(lambda v: 38.0 * abs(v) * v + 9.0 * v)
    noise = 0.01 * np.random.default_rng(1).standard_normal((2, 180))
    columns |= {"depth [m]": position + noise[0], "velocity [m/s]": scale * velocity + offset + noise[1]}
    mass = 'm_rov = { value = 20.0, unit = "kg", source = "scale" }\n'
    result = identified(tmp_path, f"{HEAD}[known]\n{mass}{THRUST.replace('rear', 'top')}", columns, "log_heave.csv")
    (heave,) = result.axes
    for answer in heave.answers:
        V = 2.0 * 78.0 * answer.command**2 / (9.0 + np.hypot(9.0, np.sqrt(4.0 * 38.0 * 78.0) * answer.command))
        assert contains(answer.steady[1], np.copysign(V, answer.command)), answer
    truth = {"sensor scale": scale, "sensor offset": offset} if offset else {}
    kept = {effect.kind: effect for effect in result.effects if effect.kept}
    assert {*kept} == {*truth}
    assert all(contains(kept[kind].interval, value) for kind, value in truth.items())
    assert any(effect.is_unusual for effect in kept.values()) == (abs(log(scale)) > 0.2)


@pytest.mark.weekly
def test_another_power_of_drag_is_found(tmp_path: Path) -> None:
    """The drag is 38 |u| u |2 u|^(-1/2) + 4 u. The file has the nearest linear and quadratic drag.

    Such a form is a doubt of its own: drag that falls at a speed has it, too, and is no power. So the axis is *usable*.
    """

    def drag(v: float) -> float:
        return 38.0 * abs(v) * v / float(np.sqrt(max(abs(2.0 * v), 1e-9))) + 4.0 * v

    columns, _, speeds = moved(drag)
    columns["velocity [m/s]"] = speeds + 0.01 * np.random.default_rng(1).standard_normal(len(speeds))
    mass = 'm_rov = { value = 20.0, unit = "kg", source = "scale" }\n'
    result = identified(tmp_path, f"{HEAD}[known]\n{mass}{THRUST}", columns, "log_surge.csv")
    (surge,) = result.axes
    (effect,) = (effect for effect in result.effects if effect.kind == "power of drag")
    assert effect.kept
    assert contains(effect.interval, -0.5)
    assert surge.verdict.word == "usable"
    assert surge.structure < 1.0, "its predictions are as exact as the sensor"
    for answer in surge.answers:
        low, high = sorted(abs(drag(end)) for end in answer.steady[1])
        assert low < 78.0 * answer.command**2 < high


def of_depth(
    folder: Path, held: Sequence[float], noise: float, *, sensor: float = 0.0, thruster: float = 0.0
) -> Identification:
    """Identify 31 w' = F - 38 |w| w - 9 w from a log at 10 Hz of a depth that is measured through a filter.

    The force F follows 78 c |c| with the lag of the thruster. Both lags are of the first order.
    """
    h, w, z, F, shown, depths = 0.005, 0.0, 5.0, 0.0, 5.0, []
    commands = np.repeat(held, round(4.0 / h))
    seen, followed = ((1.0 - np.exp(-h / lag)) if lag else 1.0 for lag in (sensor, thruster))
    for c in commands.tolist():
        depths.append(shown)
        shown += seen * (z - shown)
        z += h * w
        w += h * (F - 38.0 * abs(w) * w - 9.0 * w) / 31.0
        F += followed * (78.0 * c * abs(c) - F)
    measured = np.array(depths) + noise * np.random.default_rng(3).standard_normal(len(depths))
    columns = {"time [s]": h * np.arange(len(commands)), "command [1]": commands, "depth [m]": measured}
    mass = 'm_rov = { value = 20.0, unit = "kg", source = "scale" }\n'
    every = {title: values[::20] for title, values in columns.items()}
    thrust = THRUST.replace("rear", "top")
    return identified(folder, f"{HEAD}[known]\n{mass}{thrust}", every, "log_heave.csv")


@pytest.mark.parametrize(
    ("lag", "noise", "is_short"), [pytest.param(0.11, 0.02, False, marks=pytest.mark.long), (0.0, 0.0003, True)]
)
def test_a_lag_is_left_out_only_if_the_log_tells_that_it_is_short(
    lag: float, noise: float, is_short: bool, tmp_path: Path
) -> None:
    """Otherwise, the file has it, and a sentence names what stands in its place."""
    result = of_depth(tmp_path, HELD[:8], noise, thruster=lag)
    names = [f"the {time}" for time in result.times]
    assert names[:1] == ([] if is_short else ["the lag of the thrusters"])
    assert ("the lag of the sensors" in names) == (not is_short)
    assert len(result_sentences(findings_of(result), "times")) == (not is_short)
    assert ("T_top" in result.vehicle.layout.coefficients) == (not is_short)
    assert is_short or contains(result.vehicle.intervals["T_top"], lag)


@pytest.mark.weekly
@pytest.mark.parametrize("lag", [0.6, 0.0])
def test_a_lag_of_a_sensor_is_not_one_of_the_thrusters(lag: float, tmp_path: Path) -> None:
    result = of_depth(tmp_path, HELD, 0.005, sensor=lag)
    (heave,) = result.axes
    truth = {"a_d_w": 38.0, "b_d_w": 9.0, "beta_w": 20.0 / 31.0}
    of = {one.name: truth[one.name.removesuffix("_reverse")] for one in heave.known}
    assert {*truth} <= {*of}
    assert all(contains(one.interval, of[one.name]) for one in heave.known)
    kept = {effect.kind: effect for effect in result.effects if effect.kept}
    assert "lag" not in kept
    assert ("sensor lag" in kept) == (lag > 0.0)
    if lag:
        assert kept["sensor lag"].name == "time constant of the depth sensor"
        assert contains(kept["sensor lag"].interval, lag)
        beta = next(one for one in heave.known if one.name == "beta_w")
        assert beta.interval
        assert beta.interval[1] / beta.interval[0] < 1.08  # 1 % of a speed and 1 % of a time are always unknown


@pytest.mark.parametrize("aside", spread([0.3, 0.0], (), [0.3]))
def test_a_velocity_sensor_beside_the_origin_is_found(aside: float, tmp_path: Path) -> None:
    """A sensor to starboard measures u - r y."""
    random, step = np.random.default_rng(2), 0.1
    rov = VIDEORAY
    commands = {name: np.repeat(random.uniform(-0.5, 0.5, 30), 30) for name in ("u_l", "u_r")}
    time = step * np.arange(900.0)
    motion = simulate(rov, time, commands).values[:, 0]
    u, r = (motion[[*rov.layout.state].index(name)] for name in "ur")
    noise = 0.005 * random.standard_normal((2, len(time)))
    columns = {
        "time [s]": time,
        **{f"{name} [1]": values for name, values in commands.items()},
        "surge velocity [m/s]": u - aside * r + noise[0],
        "yaw velocity [rad/s]": r + noise[1],
    }
    thrust = "".join(
        f'{key} = {{ value = {rov[key]}, unit = "N", source = "bollard pull" }}\n' for key in ("a_t_rear", "b_t_rear")
    )
    result = identified(tmp_path, f"{HEAD}[known]\n{MASS}{TURNS}{ARM}{thrust}", columns, "dive.csv")
    kept = {effect.name: effect for effect in result.effects if effect.kept}
    assert ("place of the velocity sensor to starboard" in kept) == (aside > 0.0)
    if aside:
        assert contains(kept["place of the velocity sensor to starboard"].interval, aside)
    surge = next(one for one in result.axes if one.axis is SURGE)
    for answer in surge.answers:
        V, _ = rov.response(SURGE, answer.command)
        assert contains(answer.steady[1], V), answer
