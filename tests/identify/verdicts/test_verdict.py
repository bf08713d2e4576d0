"""Whether a model may be trusted: every rule lowers a verdict beyond its limits, and says why."""

import re
from dataclasses import replace
from math import log
from typing import Any

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.identify.identify import _axis_of
from rov_fmu.identify.result import AxisResult, IdentifiedEffect, MeasuredPoint, Slip, score_of
from rov_fmu.identify.verdict import RULES, WORDS, verdict
from tests.report import results

DEPTH = results.prediction(HEAVE, "depth", span=10.0)
WORSE = replace(DEPTH, error=0.8, unchanged=0.7)
SLOW = IdentifiedEffect("lag", "", "time constant of the thrusters", 0.6, (0.5, 0.7), "s", 12.0, 2.6)
FORCE = results.disturbance("slow force", SURGE, "log.csv", 1.0, "N", 0.06, 9.0)


def point(off: float) -> MeasuredPoint:
    """A row of a table that is predicted without itself with this relative error."""
    return MeasuredPoint("heave", "V_ss", "m/s", "steady_heave.csv", 0.3, 0.2, 0.2, 0.2 * (1.0 + off), counts=True)


def scored(score: float) -> list[Any]:
    """A prediction with this score."""
    all_ = 2.0 * log(DEPTH.unchanged / DEPTH.least)
    return [replace(DEPTH, loss=1.0 + 2.0 * log(DEPTH.unchanged) - score * all_)]


USUAL: dict[str, Any] = {"predictions": [DEPTH], "answers": results.answers(1.0, 0.02)}
COVERED = "The 95% bands contain 95% of the unseen samples."
NO_CHANGE = "A prediction of no change is better for the depth in log_2.csv."


@pytest.mark.parametrize(
    ("changes", "word", "reason"),
    [
        ({}, "good", ""),
        ({"predictions": [WORSE, replace(WORSE, file="log_3.csv"), DEPTH]}, "do not use", NO_CHANGE),
        ({"predictions": [WORSE, replace(WORSE, file="log_3.csv"), DEPTH, DEPTH]}, "usable", NO_CHANGE),
        ({"predictions": [replace(WORSE, noise=0.23)]}, "do not use", NO_CHANGE),
        ({"predictions": [replace(WORSE, noise=0.24)]}, "usable", "Nothing of this axis was checked on unseen data."),
        (
            {"disturbances": [FORCE]},
            "usable",
            "An unknown slow force of 1.0 N (RMS), 6% of the thrust, acts in log.csv.",
        ),
        ({"disturbances": [replace(FORCE, evidence=5.0)]}, "good", ""),
        (
            {"disturbances": [replace(FORCE, share=0.02), replace(FORCE, axis=YAW, share=0.04)]},
            "usable",
            "An unknown slow torque of 1.0 N (RMS), 4% of the torque, acts in log.csv.",
        ),
        (
            {"disturbances": [replace(FORCE, kind="slow gain", axis=None, value=0.06, unit="1")]},
            "usable",
            "The thrust changes slowly by 6% (RMS) in log.csv.",
        ),
        (
            {"disturbances": [replace(FORCE, kind="slow velocity", share=0.16)]},
            "do not use",
            "An unknown slow velocity over ground of 1.0 N (RMS) acts in log.csv.",
        ),
        (
            {"slips": [Slip("log.csv", "depth", "is it in cm", 20.0)]},
            "do not use",
            "The depth in log.csv seems to have another unit or sign.",
        ),
        ({"effects": [replace(SLOW, beyond=0.96)]}, "good", ""),
        ({"effects": [replace(SLOW, axes=frozenset({"surge"}))]}, "good", ""),
        (
            {"effects": [replace(SLOW, axes=frozenset({"heave"}))]},
            "usable",
            "The time constant of the thrusters (0.60 s) is unusual.",
        ),
        ({"effects": [SLOW]}, "usable", "The time constant of the thrusters (0.60 s) is unusual."),
    ],
)
def test_a_verdict_has_a_reason_for_each_doubt(changes: dict[str, Any], word: str, reason: str) -> None:
    judged = verdict(AxisResult(HEAVE, **(USUAL | changes)))
    assert (judged.word, judged.reasons) == (word, tuple(filter(None, [reason, COVERED])))
    assert bool(judged.remedy) == (word != "good")


def test_what_was_done_already_is_not_asked_for_again() -> None:
    doubtful = AxisResult(HEAVE, **USUAL, structure=2.0, soon=2.0, mixed=["a.csv", "b.csv"])
    alone = replace(doubtful, alone=["c.csv"])
    apart = replace(alone, mixed=())
    frequent = (replace(DEPTH, time=np.arange(len(DEPTH.time)) / 20.0),)
    leave = "eave it out of a.csv and b.csv by [leave_out] in rov.toml"
    assert [verdict(one).remedy for one in (doubtful, alone, apart)] == [
        "Log this axis alone, both ways, each command for 8 s. If it is known there, the other axes disturb it here.",
        f"L{leave}, because it is alone in c.csv.",
        "Log at 20 Hz or more, with steps of the command from rest.",
    ]
    for badly in (tuple(scored(0.2)), (WORSE,)):
        first, then = (verdict(replace(one, predictions=badly, structure=0.0, soon=0.0)) for one in (doubtful, alone))
        assert "og this axis alone, both ways" in first.remedy
        assert then.remedy == f"L{leave}, because it is alone in c.csv."
    done = verdict(replace(apart, predictions=frequent))
    assert (done.word, done.remedy) == ("usable", "")


def test_the_voltage_is_asked_for_where_the_thrust_changes_and_no_log_has_it() -> None:
    gain = replace(FORCE, kind="slow gain", axis=None, value=0.06, unit="1")
    ask = [
        verdict(AxisResult(HEAVE, **USUAL, disturbances=[one], has_voltage=has_voltage)).remedy
        for one, has_voltage in ((gain, False), (gain, True), (FORCE, False))
    ]
    assert ["with the voltage" in remedy for remedy in ask] == [True, False, False]


def test_a_mistake_in_a_quantity_concerns_its_axis() -> None:
    found = [_axis_of(Slip("a.csv", name, "is it in cm", 9.0)) for name in ("depth", "yaw velocity")]
    assert found == [HEAVE, YAW]


def test_other_motors_than_the_thrusters_lower_a_verdict_whatever_was_predicted() -> None:
    judged = verdict(AxisResult(HEAVE, **USUAL, misfits=["dive.tlog"]))
    words = "The motors of dive.tlog are not the thrusters of the vehicle."
    assert (judged.word, judged.reasons) == ("do not use", (words, COVERED))


def of_times(x: float) -> dict[str, Any]:
    """Answers whose times and distances have this half-width."""
    wide, narrow = results.answers(1.0, x), results.answers(1.0, 0.02)
    return {"answers": [replace(a, steady=b.steady) for a, b in zip(wide, narrow, strict=True)]}


MADE: dict[str, tuple[Any, float | None, float | None, float | None]] = {
    "logs with other": (lambda x: {"misfits": ["a.tlog"] * round(x)}, 0, None, 1),
    "unseen samples": (lambda x: {"predictions": [replace(DEPTH, coverage=x)]}, 0.81, 0.79, 0.59),
    "score G": (lambda x: {"predictions": scored(x)}, 0.51, 0.49, 0.24),
    "moving quantities": (
        lambda x: {"predictions": [replace(DEPTH, error=2.0 * (n < x)) for n in range(10)]},
        0,
        1,
        6,
    ),
    "nothing predicted": (lambda x: {"predictions": [DEPTH] * (x < 0.5)}, 0, 1, None),
    "errors R of": (lambda x: {"structure": x}, 1.2, 1.3, 5.1),
    "errors R₂": (lambda x: {"soon": x}, 1.25, 1.35, None),
    "unknown dist": (lambda x: {"disturbances": [replace(FORCE, share=x)]}, 0.049, 0.051, 0.151),
    "no answers": (lambda x: {"answers": results.answers(1.0, 0.02) * (x < 0.5)}, 0, None, 1),
    "half-width of the widest V_ss": (lambda x: {"answers": results.answers(1.0, x)}, 0.14, 0.16, 0.31),
    "the same of times": (of_times, 0.29, 0.31, None),
    "held-out V_ss": (lambda x: {"points": [point(x)]}, 0.19, 0.21, 0.41),
    "upper end": (lambda x: {"inertia": x}, 1.01, None, 0.99),
    "effects of unusual": (lambda x: {"effects": [SLOW] * round(x)}, 0, 1, None),
    "slips": (lambda x: {"slips": [Slip("log.csv", "depth", "is it in cm", 20.0)] * round(x)}, 0, None, 1),
    "an assumed": (lambda x: {"is_assumed": x > 0.5}, 0, 1, None),
    "difference of J": (lambda x: {"difference": x}, 39.0, None, 41.0),
}
"""How to make evidence of a value, and values with which a model is *good*, *usable* and *do not use*, None where none
is, by the beginning of the words of a rule. The values are beside the limits that an owner relies on."""


@pytest.mark.parametrize("name", MADE)
def test_a_rule_lowers_the_verdict_from_where_nobody_should_rely_on_the_model(name: str) -> None:
    made, *values = MADE[name]
    for value, word in zip(values, WORDS, strict=True):
        if value is not None:
            assert verdict(AxisResult(HEAVE, **(USUAL | made(value)))).word == word


def test_each_rule_is_tried() -> None:
    assert len(RULES) == len(MADE)
    assert all(rule.of.startswith(tuple(MADE)) for rule in RULES)


@pytest.mark.parametrize(
    ("tested", "loose", "word"),
    [
        ((0.0, 0.7), (-1.0, -0.5, -0.3), "good"),
        ((0.7, 0.0), (0.3, 0.5, 1.0), "good"),
        ((0.7, 0.7), (-1.0, 1.0), "good"),
        ((0.0, 0.7), (0.5,), "do not use"),
        ((0.7, 0.7), (-0.5,), "do not use"),
        ((0.7, 0.7), (-0.3,), "usable"),  # 40 % of this speed are 24 % of the largest one
        ((1.0, 1.0), (1.0,), "do not use"),
        ((0.0, 0.0), (-1.0,), "do not use"),
    ],
)
def test_what_nobody_tested_does_not_decide(tested: tuple[float, float], loose: tuple[float, ...], word: str) -> None:
    narrow, wide = results.answers(1.0, 0.02), results.answers(1.0, 0.4)
    some = [w if n.command in loose else n for n, w in zip(narrow, wide, strict=True)]
    assert verdict(AxisResult(HEAVE, **(USUAL | {"answers": some, "tested": tested}))).word == word


@pytest.mark.parametrize("size", [1.7, 1e20])
def test_no_reason_has_a_percentage_beyond_0_and_100(size: float) -> None:
    kinds = ("unknown dist", "half-width of the widest V_ss", "the same of times", "held-out V_ss")
    for made in [*(MADE[kind][0](size) for kind in kinds), MADE["score G"][0](-size)]:
        reasons = " ".join(verdict(AxisResult(HEAVE, **(USUAL | made))).reasons)
        reasons = re.sub(r"at -?\d+%", "", reasons)  # a command
        shares = [float(number) for number in re.findall(r"(-?[\d.]+)%", reasons)]
        assert all(0.0 <= share <= 100.0 for share in shares), reasons
        assert re.search("more than 100%|worse than no change|is not known", reasons)


def test_the_score_is_0_for_no_change_and_1_for_the_noise() -> None:
    """Also a prediction by a right model scores more than one whose bands are 20 times too wide."""
    random, n = np.random.default_rng(0), 20_000
    e0, noise = random.standard_normal(n), 0.01 * random.standard_normal(n)

    def score(error: np.ndarray, deviation: float) -> float:
        loss = float(np.mean(np.log(deviation**2) + (error / deviation) ** 2))
        return score_of([replace(DEPTH, unchanged=1.0, noise=0.01, loss=loss)])

    assert score(e0, 1.0) == pytest.approx(0.0, abs=0.01)
    assert score(noise, 0.01) == pytest.approx(1.0, abs=0.01)
    assert score(0.95 * e0, 20.0) < 0.0
    assert 0.5 < score(3.0 * noise, 0.03) < 1.0
