"""Identification keeps its promises in every scenario."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.identify.scenarios.catalogue import SCENARIOS
from tests.identify.scenarios.judge import broken, promises
from tests.identify.scenarios.outcome import outcome

OFTEN = {"gaps while turning": 1}
"""The scenarios of the long tests, and the number of their seeds. All are run with more seeds once a week."""
WEEKLY = {**dict.fromkeys(SCENARIOS, 200), "heavy": 20, "heavy in a current": 20}


@cache
def family() -> int:
    """Return at least the number of promises of all scenarios."""
    return sum(3 * len(scenario.truths()) + 12 for scenario in SCENARIOS.values())


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
    assert not broken(promises(outcomes, scenario.expected), family())
