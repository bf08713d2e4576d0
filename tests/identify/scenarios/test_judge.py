"""The judge passes outcomes that keep every promise, and each promise can be broken."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.identify.scenarios.judge import broken, promises
from tests.identify.scenarios.outcome import Band, Estimate, Outcome
from tests.identify.scenarios.scenario import Expected

COMPLETE = Expected(("load of heave",))
INCOMPLETE = replace(COMPLETE, causes=("voltage", "time"), complete=False)
TRUTHS = {("surge", "a_d_u"): 20.0, ("surge", "beta_u"): 0.8, ("heave", "a_d_w"): 40.0, ("heave", "V_ss 30 %"): 0.2}
Misses = Callable[[int, str], bool]


def seeds(
    n: int, misses: Misses = lambda seed, _: seed % 20 == 7, *, offset: float = 0.0, half: float = 0.1, **more: object
) -> list[Outcome]:
    """Return outcomes with intervals of ± `half` that miss the truth where `misses` says so."""
    random, found = np.random.default_rng(0), []
    for seed in range(n):
        estimates = []
        for (axis, name), truth in TRUTHS.items():
            value = truth * (1.0 + offset + 0.001 * random.standard_normal())
            low, high = (1.0 + 0.5 * half, 1.0 + 2.5 * half) if misses(seed, name) else (1.0 - half, 1.0 + half)
            estimates.append(Estimate(axis, name, value, (low * truth, high * truth), truth, 0.1))
        good = Outcome(
            tuple(estimates),
            (("load", "heave", 0.3),),
            verdicts={"surge": "good", "heave": "usable"},
            bands=(Band("surge", "velocity", 0.95, 1.0, 1.1),),
            seconds=2.0,
        )
        found.append(replace(good, **more))  # type: ignore[arg-type]
    return found


def wrong(outcomes: Sequence[Outcome], expected: Expected = COMPLETE, family: int = 0) -> list[str]:
    return broken(promises(outcomes, expected), family)


@pytest.mark.parametrize("expected", [COMPLETE, INCOMPLETE])
def test_kept_promises_pass(expected: Expected) -> None:
    assert wrong(seeds(20), expected, family=300) == []


# ---- Each promise can be broken --------------------------------------------------------------------------------------

CURRENT = {"effects": (("current", "log.csv", 0.1),)}
TETHER = {"disturbances": (("thrust", "the voltage"), ("surge", "the distance"))}
FORCE = {"disturbances": (("surge", ""),)}
UNUSABLE = {"verdicts": {"surge": "do not use", "heave": "good"}}
REFUSED = {"error": "log.csv: no"}


def of_bands(coverage: float) -> dict[str, object]:
    return {"bands": (Band("surge", "velocity", coverage, 1.0, 1.0),)}


@pytest.mark.parametrize(
    ("total", "changed", "expected", "passes", "fails", "words"),
    [
        (200, CURRENT, COMPLETE, 9, 20, "20 of 200 runs report a false effect: current of log.csv"),
        (100, CURRENT, INCOMPLETE, 15, 30, "30 of 200 axes have a false effect: current of log.csv"),
        (200, CURRENT, replace(COMPLETE, effects=("current",)), 200, 0, ""),
        (200, FORCE, COMPLETE, 9, 20, "20 of 200 runs raise an alarm"),
        (200, UNUSABLE, COMPLETE, 9, 20, "20 of 200 runs raise an alarm"),
        (20, FORCE, INCOMPLETE, 20, 0, ""),
        (100, TETHER, INCOMPLETE, 15, 25, "25 of 100 runs name a wrong cause: the distance"),
        (100, UNUSABLE, replace(INCOMPLETE, unusable=("surge",)), 100, 0, ""),
        (100, {}, replace(INCOMPLETE, unusable=("surge",)), -1, 1, "only 0 of 100 runs say `do not use` of surge"),
        (20, REFUSED, INCOMPLETE, 0, 1, "seed 0: refused: log.csv: no"),
        (100, of_bands(0.75), COMPLETE, 0, 100, "bands contain 75.0% of the held-out samples"),
        (100, of_bands(0.7), INCOMPLETE, 0, 100, "bands contain 70.0% of the held-out samples"),
        (20, {"bands": ()}, COMPLETE, 0, 20, "bands contain 0.0% of the held-out samples"),
        (2, {"seconds": 9.0}, replace(COMPLETE, seconds=8.0), 0, 2, "9.0 s of processor time, at most 8 s"),
    ],
)
def test_some_runs_may_be_wrong_and_no_more(
    total: int, changed: dict[str, object], expected: Expected, passes: int, fails: int, words: str
) -> None:
    """Chance allows a few wrong runs; more of them break one promise, which says what is wrong."""

    def with_changes(count: int) -> list[str]:
        good = seeds(total)
        return wrong([*(replace(o, **changed) for o in good[:count]), *good[count:]], expected)  # type: ignore[arg-type]

    if passes >= 0:
        assert with_changes(passes) == []
    if fails:
        assert any(found.startswith(words) for found in with_changes(fails))
