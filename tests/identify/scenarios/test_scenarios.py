"""Identification in every scenario: what it is held to, and that the scenarios are what they say."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.identify.scenarios.catalogue import OWNERS, SCENARIOS
from tests.identify.scenarios.judge import broken, promises
from tests.identify.scenarios.outcome import outcome, read_result
from tests.report.results import without_findings

OFTEN = {"gaps while turning": 1}
"""The scenarios of the long tests, and the number of their seeds. All are run with more seeds once a week."""
WEEKLY = {
    **dict.fromkeys(SCENARIOS, 200),
    **dict.fromkeys(OWNERS, 20),
    "heavy": 20,
    "heavy in a current": 20,
    "owner": 40,
}
FAMILY = sum(3 * len(scenario.truths(0)) + 12 for scenario in SCENARIOS.values())
"""At least the number of promises of all scenarios."""


def judged() -> Iterator[object]:
    """Yield each scenario with each number of seeds."""
    for name in SCENARIOS:
        yield pytest.param(name, WEEKLY[name], marks=pytest.mark.weekly, id=f"{name}-{WEEKLY[name]}")
    for name, seeds in OFTEN.items():
        yield pytest.param(name, seeds, marks=pytest.mark.long, id=f"{name}-{seeds}")


@pytest.mark.parametrize(("name", "seeds"), [*judged()])
def test_a_scenario_is_identified(name: str, seeds: int, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    outcomes = [outcome(scenario, seed, tmp_path / str(seed)) for seed in range(seeds)]
    assert not broken(promises(outcomes, scenario.expected), FAMILY)


def test_what_is_judged_is_read_from_the_result() -> None:
    """A lag that is told, a load without evidence, a force in heave, and yaw that must not be used."""
    result = without_findings()
    truths = {("surge", "a_d_u"): 8.0, ("heave", "b_d_w"): 2.0, ("", "T_top"): 0.3, ("", "b_t_top"): 0.0}
    truths |= {("surge", "V_ss 30 %"): 0.3, ("surge", "V_ss -70 %"): -0.7}
    prediction = replace(result.axes[0].predictions[0], measured=np.array([0.0, 1.0, np.nan, 5.0]))
    prediction = replace(prediction, predicted=np.zeros(4), deviation=np.ones(4))
    found = read_result(result, truths, [prediction], 2.0)
    covered = {estimate.quantity: estimate.covered for estimate in found.estimates}
    assert covered == {"a_d_u": False, "b_d_w": True, "T_top": False, "b_t_top": False, "V_ss 30 %": True}
    assert found.effects == (("lag", "top", 0.12), ("current", "log_1.csv", 0.1))
    assert found.false_effects(["lag", "current of heave"]) == ("current of log_1.csv",)
    assert found.disturbances == (("heave", ""),)
    assert (found.alarms, found.unusable) == (("heave", "yaw"), ("yaw",))
    (band,) = found.bands
    assert (band.coverage, band.error, band.claimed) == pytest.approx((2.0 / 3.0, 26.0 / 3.0, 1.0))
