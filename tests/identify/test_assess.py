"""How far a model may be trusted: its verdict with each reason, and the uncertainty of answers and predictions."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.identify.assess import answers, answers_of_file, unseen_current, verdict
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.result import Disturbance, Effect, Point, Slip
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import REFIT
from tests.report import results
from tests.vehicles import VIDEORAY, extended

DEPTH = results.prediction(HEAVE, "depth", span=10.0)
WORSE = replace(DEPTH, error=0.8, unchanged=0.7)
SLOW = Effect("lag", "", "time constant of the thrusters", 0.6, (0.5, 0.7), "s", 12.0, 2.6)
FORCE = Disturbance("force", SURGE, "log.csv", 1.0, "N", 0.06, None, 9.0)


def point(off: float) -> Point:
    """A row of a table that is predicted without itself with this relative error."""
    return Point("heave", "V_ss", "m/s", "steady_heave.csv", 0.3, 0.2, 0.2, 0.2 * (1.0 + off), counts=True)


COVERED = "The 95% bands contain 95% of the unseen samples."
NO_CHANGE = "A prediction of no change is better for the depth in log_2.csv."


@pytest.mark.parametrize(
    ("changes", "word", "reason"),
    [
        ({}, "good", ""),
        ({"found": [WORSE, replace(WORSE, file="log_3.csv"), DEPTH]}, "do not use", NO_CHANGE),
        ({"found": [WORSE, replace(WORSE, file="log_3.csv"), DEPTH, DEPTH]}, "usable", NO_CHANGE),
        ({"found": [replace(WORSE, noise=0.23)]}, "do not use", NO_CHANGE),
        ({"found": [replace(WORSE, noise=0.24)]}, "good", ""),
        ({"slow": [FORCE]}, "do not use", "An unknown slow force is as large as 6% of the thrusters' in log.csv."),
        ({"slow": [replace(FORCE, evidence=5.0)]}, "good", ""),
        (
            {"slow": [replace(FORCE, share=0.02), replace(FORCE, axis=YAW, share=0.04)]},
            "do not use",
            "An unknown slow torque is as large as 4% of the thrusters' in log.csv.",
        ),
        (
            {"slow": [replace(FORCE, kind="gain", axis=None)]},
            "do not use",
            "The thrust changes for an unknown reason by 6% in log.csv.",
        ),
        (
            {"slow": [replace(FORCE, kind="velocity")]},
            "do not use",
            "An unknown slow velocity over ground is as large as 6% of the vehicle's in log.csv.",
        ),
        ({"given": results.answers(1.0, 0.4)}, "do not use", "The steady velocities are known to no better than 30%."),
        ({"given": results.answers(1.0, 0.02)[::5]}, "do not use", "No steady velocity is determined."),
        (
            {"steady": [point(0.25)]},
            "usable",
            "The other commands predict a V_ss of the tables with an error of 25% (RMS).",
        ),
        (
            {"slips": [Slip("log.csv", "depth", "is it in cm", 20.0)]},
            "do not use",
            "The depth in log.csv seems to have another unit or sign, and all axes are fitted to this log.",
        ),
        ({"effects": [SLOW]}, "usable", "The time constant of the thrusters is unusual."),
        ({"effects": [replace(SLOW, beyond=2.4)]}, "good", ""),
        ({"difference": 40.5}, "do not use", "Two starts of the fit led to different vehicles."),
        ({"difference": 40.0}, "good", ""),
    ],
)
def test_a_verdict_has_a_reason_for_each_doubt(changes: dict[str, Any], word: str, reason: str) -> None:
    usual: dict[str, Any] = {"found": [DEPTH], "given": results.answers(1.0, 0.02), "slow": [], "difference": 0.0}
    judged = verdict(**(usual | changes))
    assert (judged.word, judged.reasons) == (word, tuple(filter(None, [COVERED, reason])))


def test_other_motors_than_the_thrusters_lower_a_verdict_whatever_was_predicted() -> None:
    judged = verdict([DEPTH], results.answers(1.0, 0.02), [], 0.0, misfits=["dive.tlog"])
    words = "The motors of dive.tlog are not the thrusters of the vehicle."
    assert (judged.word, judged.reasons) == ("do not use", (words, COVERED))


def test_the_limits_of_a_verdict() -> None:
    """The coverage, half the width of the best interval of V_ss, and the error of a table of V_ss without its row."""
    limits: list[tuple[str, Any, tuple[float, ...]]] = [
        ("found", lambda x: [replace(DEPTH, coverage=x)], (0.8, 0.799, 0.6, 0.599)),
        ("given", lambda x: results.answers(1.0, x), (0.149, 0.151, 0.299, 0.301)),
        ("steady", lambda x: [point(x)], (0.199, 0.201, 0.399, 0.401)),
    ]
    usual: dict[str, Any] = {"found": [DEPTH], "given": results.answers(1.0, 0.02), "slow": [], "difference": 0.0}
    for key, made, numbers in limits:
        words = [verdict(**{**usual, key: made(x)}).word for x in numbers]
        assert words == ["good", "usable", "usable", "do not use"], key


def test_the_current_of_an_unseen_log_is_about_that_of_the_others() -> None:
    """Its variance is at least that of 2 cm/s. It may exceed that of the prior."""
    currents = tuple(Parameter("current", file, deviation=0.1, log=n) for n, file in enumerate("abc"))
    table = Table(VIDEORAY.layout, VIDEORAY.coefficients, {}, currents)
    covariance = np.diag([9.0, 0.01**2, 0.02**2])
    usual = 0.02**2 + (0.03**2 + 0.01**2 + 0.04**2 + 0.02**2) / 2.0
    assert unseen_current(table, np.array([5.0, 0.03, -0.04]), covariance, "a") == pytest.approx(usual)
    assert unseen_current(table, np.array([5.0, 0.3, -0.4]), covariance, "a") == pytest.approx(
        0.02**2 + (0.3**2 + 0.01**2 + 0.4**2 + 0.02**2) / 2.0
    )


def test_a_verdict_without_predictions_rests_on_the_tables() -> None:
    judged = verdict([], results.answers(1.0, 0.02), [], 0.0)
    words = "The tables determine the steady velocities; no unseen motion was predicted."
    assert (judged.word, judged.reasons) == ("good", (words,))


def of_drag(deviation: float, gain: float) -> Posterior:
    """Return the posterior of the drag in surge, and of a slow change of thrust of a known size."""
    drag = Parameter("quadratic drag", "surge", is_log=True)
    slow = Parameter("slow gain", "", is_log=True, of_motion=False)
    table = Table(VIDEORAY.layout, VIDEORAY.coefficients, {}, (drag, slow))
    return Posterior(table, np.log([VIDEORAY["a_d_u"], gain]), np.diag([deviation**2, 0.0]))


def test_answers_are_as_uncertain_as_the_drag_the_thrust_and_the_vehicle_file() -> None:
    """V_ss and Tau follow 0.7 of a slow change of thrust; the file has other curves than the fit, and none is exact."""
    uncertain, file = of_drag(0.04, 0.05), VIDEORAY.with_(b_d_u=1.1 * VIDEORAY["b_d_u"])
    axis = VIDEORAY.layout.by_name["surge"]

    def numbers(rov: Vehicle, command: float) -> np.ndarray:
        V, Tau = rov.response(SURGE, command)
        return np.array([abs(V), Tau, rov.alone(SURGE, rov.layout.usual_inputs).stopping_way(abs(V), 0.1)])

    more, less = (VIDEORAY.with_(a_d_u=VIDEORAY["a_d_u"] * np.exp(s)) for s in (0.01, -0.01))
    found = answers(uncertain, SURGE, file)
    assert axis
    assert [one.command for one in found] == [0.3, -0.3, 0.5, -0.5, 1.0, -1.0]
    for one in found:
        c = one.command
        slopes = np.log(numbers(more, c) / numbers(less, c)) / 0.02
        errors = np.hypot(0.04 * slopes, [0.035, 0.035, 0.0])
        half = t.ppf(0.975, 10) * errors + abs(np.log(numbers(file, c) / numbers(VIDEORAY, c)))
        for (value, (low, high)), number, width in zip(
            (one.steady, one.rise, one.stop), numbers(file, c), half, strict=True
        ):
            assert abs(value) == pytest.approx(number)
            assert low < value < high
            assert sorted(map(abs, (low, high))) == pytest.approx(
                [number * np.exp(-width), number * np.exp(width)], rel=1e-3
            )
    for one in answers(of_drag(0.0, 1e-9), SURGE, VIDEORAY):
        for value, (low, high) in (one.steady, one.rise):
            assert sorted((low / value, high / value)) == pytest.approx([np.exp(-0.01), np.exp(0.01)])


def test_the_way_to_stop_is_without_the_loss_of_thrust_and_answers_beyond_the_tests_are_wider() -> None:
    losing, exact = extended(VIDEORAY, d_rear=3.0), of_drag(0.0, 1e-9)
    table = replace(exact.table, layout=losing.layout, base=losing.coefficients)
    half, full = (
        next(a for a in answers(replace(exact, table=table), SURGE, losing, strongest=0.5) if a.command == command)
        for command in (0.5, 1.0)
    )
    V, _ = losing.response(SURGE, 0.5)
    assert VIDEORAY.response(SURGE, 0.5)[0] > V
    coasting = VIDEORAY.alone(SURGE, VIDEORAY.layout.usual_inputs)
    assert half.stop[0] == pytest.approx(coasting.stopping_way(V, 0.1))
    assert half.steady[1][1] / half.steady[0] == pytest.approx(np.exp(0.01))
    for value, (_, high) in (full.steady, full.rise, full.stop):
        assert np.log(high / value) == pytest.approx(t.ppf(0.975, 10) * 0.15 * np.log(2.0))
    assert answers_of_file(losing, SURGE)[2].stop[0] == pytest.approx(half.stop[0])


def test_answers_of_a_file_have_the_intervals_of_its_estimates() -> None:
    """A file without estimates has no intervals: both ends are the value."""
    rov = load_vehicle(REFIT)
    names, rows = rov.uncertainty.names, np.random.default_rng(0).random((1000, len(rov.uncertainty.names)))
    drawn = [rov.with_(**dict(zip(names, row, strict=True))) for row in rov.uncertainty.drawn(rows).tolist()]
    for one, exact in zip(answers_of_file(rov, HEAVE), answers_of_file(VIDEORAY, HEAVE), strict=True):
        numbers = np.array([k.response(HEAVE, one.command) for k in drawn])
        for (value, interval), some, own in zip(
            (one.steady, one.rise), numbers.T, rov.response(HEAVE, one.command), strict=True
        ):
            assert value == pytest.approx(own)
            assert interval == pytest.approx(np.quantile(some, (0.025, 0.975)), abs=0.3 * np.std(some))
        assert exact.steady == (exact.steady[0], (exact.steady[0], exact.steady[0]))
