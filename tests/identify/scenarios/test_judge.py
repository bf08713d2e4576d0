"""The judge of scenarios passes what is right, and fails what is wrong."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rov_fmu.model.layout import HEAVE, SWAY
from rov_fmu.tank.findings import Finding
from tests.identify.scenarios.catalogue import DEPTH, Logs, Scenario, Sensor
from tests.identify.scenarios.judge import Bias, Coverage, coverages, pooled, problems, rejected
from tests.identify.scenarios.outcome import ALARMS, EFFECTS, Estimate, Outcome

SCENARIO = Scenario(logs=Logs(axes=(HEAVE,)), sensors=(DEPTH,))
TRUTH = SCENARIO.truth
ALARM = Finding(min(ALARMS), axis="heave")
EFFECT = Finding(min(EFFECTS), axis="heave")


def seeds(
    n: int,
    *,
    misses: Callable[[str, int], bool] = lambda _, seed: seed % 20 == 7,
    offset: float = 0.0,
    findings: Sequence[Finding] = (),
    some: int = 10**9,
) -> list[Outcome]:
    """Return outcomes in which intervals miss the truth where `misses` says so; `some` of them have the findings."""
    random, found = np.random.default_rng(0), []
    for seed in range(n):
        coefficients = {}
        for name in SCENARIO.coefficients:
            truth = TRUTH[name]
            value = truth * (1.0 + offset + 0.001 * random.standard_normal())
            low, high = (1.1, 1.2) if misses(name, seed) else (0.9, 1.1)
            coefficients[name] = Estimate(value, (low * truth, high * truth))
        found.append(Outcome(coefficients, TRUTH, tuple(findings) if seed < some else (), (), "", 1.0))
    return found


@pytest.mark.parametrize("n", [2, 20, 200])
def test_right_outcomes_pass(n: int) -> None:
    assert problems(seeds(n), SCENARIO, 40) == []


@pytest.mark.parametrize("n", [20, 200])
@pytest.mark.parametrize("share", [0.0, 0.25])
def test_wrong_coverages_fail(n: int, share: float) -> None:
    """20 seeds of three coefficients are too few to tell 100 % from 95 %; 200 seeds of each are enough."""
    outcomes = seeds(n, misses=lambda _, seed: seed % 20 < round(20 * share))
    found = problems(outcomes, SCENARIO, 3)
    assert bool(found) == (share > 0.0 or n == 200), found
    assert all("intervals cover" in line for line in found)


def test_one_wrong_coefficient_fails() -> None:
    outcomes = seeds(200, misses=lambda name, seed: seed % 20 < (4 if name == "b_d_w" else 1))
    (line,) = problems(outcomes, SCENARIO, 300)
    assert line.startswith("b_d_w: 160 of 200")


def test_a_missing_interval_is_no_coverage() -> None:
    outcomes = [
        replace(o, coefficients={name: Estimate(TRUTH[name], None) for name in o.coefficients}) for o in seeds(20)
    ]
    assert "0 of 60 intervals cover" in problems(outcomes, SCENARIO)[0]


def test_exact_binomial_limits() -> None:
    """Of 200 intervals, 179 to 198 pass alone at 0.1 %; at a bound all of them may cover."""
    limits = [covered for covered in range(201) if not rejected({"": Coverage("", covered, 200).p_value})]
    assert (limits[0], limits[-1]) == (179, 198)
    bound = [covered for covered in range(201) if not rejected({"": Coverage("", covered, 200, True).p_value})]
    assert (bound[0], bound[-1]) == (179, 200)


def test_holms_correction() -> None:
    """The smallest of m values is compared with 0.1 %/m, the next with 0.1 %/(m - 1) ..."""
    assert rejected({"a": 0.0004, "b": 0.0004, "c": 0.5}) == []
    assert rejected({"a": 0.0003, "b": 0.0004, "c": 0.5}) == ["a", "b"]
    assert rejected({"a": 0.0003, "b": 0.0006, "c": 0.5}) == ["a"]
    assert rejected({"a": 0.0009}) == ["a"]
    assert rejected({"a": 0.0009}, family=10) == []


def test_coefficients_at_their_bound_are_pooled_apart() -> None:
    found = pooled([Coverage("a", 18, 20), Coverage("b", 20, 20, True), Coverage("c", 19, 20)])
    assert found == [Coverage("all", 37, 40), Coverage("at the bound", 20, 20, True)]
    heavy = Scenario("bluerov2_heavy", Logs("pilot", (SWAY,)), (Sensor(SWAY, "velocity", 0.01),))
    assert [c.at_bound for c in coverages([], heavy)] == [False, True, False], "b_d of sway is 0"


@pytest.mark.parametrize(
    ("bias", "limit"),
    [
        (Bias("", 0.0, 0.0, 200), 0.02),
        (Bias("", 0.0, 0.05, 200), 0.02),
        (Bias("", 0.0, 1.0, 10**6), 0.2),
        (Bias("", 0.0, 0.1, 4), 0.1645),
    ],
)
def test_the_limit_of_a_bias(bias: Bias, limit: float) -> None:
    """It is 2 % or 0.2 standard errors, or in few seeds what chance explains at 0.1 %."""
    assert bias.limit == pytest.approx(limit, rel=1e-3)
    assert replace(bias, mean=-0.99 * limit).passes
    assert not replace(bias, mean=1.01 * limit).passes
    assert not replace(bias, n=0).passes


def test_a_bias_of_beta_fails() -> None:
    """The intervals are ±10 %, so 200 seeds allow 2 % and 2 seeds 12 %."""
    found = problems(seeds(200, offset=0.03), SCENARIO)
    assert found == ["beta_w: a bias of 3.0%, at most 2.0%"]
    assert problems(seeds(2, offset=0.03), SCENARIO) == []


def test_a_refusal_fails() -> None:
    outcomes = seeds(20)
    outcomes[3] = Outcome({}, None, (), (), "log.csv: no", 1.0)
    assert problems(outcomes, SCENARIO)[0] == "seed 3: refused: log.csv: no"
    assert problems(outcomes, replace(SCENARIO, unexplained=("heave",)))[0] == "seed 3: refused: log.csv: no"


def test_alarms_and_invented_effects_on_a_complete_model_fail() -> None:
    assert problems(seeds(200, findings=[ALARM], some=8), SCENARIO) == []
    (line,) = problems(seeds(200, findings=[ALARM], some=16), SCENARIO)
    assert line.startswith("16 of 200 seeds raise an alarm")
    assert problems(seeds(200, findings=[EFFECT], some=16), SCENARIO) == []
    (line,) = problems(seeds(200, findings=[EFFECT], some=30), SCENARIO)
    assert line.startswith("30 of 200 axes have an effect")
    assert problems(seeds(200, findings=[EFFECT]), replace(SCENARIO, effects=(EFFECT.kind,))) == []


def test_an_incomplete_model_must_raise_an_alarm_about_its_axis() -> None:
    incomplete = replace(SCENARIO, unexplained=("heave",))
    assert problems(seeds(20, findings=[ALARM], some=19), incomplete) == []
    (line,) = problems(seeds(20, findings=[ALARM], some=10), incomplete)
    assert line == "only 10 of 20 seeds report that heave is unexplained"
    assert problems(seeds(20, findings=[replace(ALARM, axis="yaw")]), incomplete)
