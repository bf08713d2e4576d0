"""The judge passes outcomes that keep every promise, and each promise can be broken."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.identify.scenarios.judge import Promise, broken, promises
from tests.identify.scenarios.outcome import Band, Estimate, Outcome
from tests.identify.scenarios.scenario import Expected

COMPLETE = Expected(("load of heave",))
INCOMPLETE = replace(COMPLETE, causes=("voltage", "time"), complete=False)
OWNER = replace(COMPLETE, like_owners=True)
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


@pytest.mark.parametrize("n", [2, 20, 200])
@pytest.mark.parametrize("expected", [COMPLETE, INCOMPLETE, OWNER])
def test_kept_promises_pass(n: int, expected: Expected) -> None:
    assert wrong(seeds(n), expected, family=300) == []


# ---- Chance ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("p_values", "family", "failed"),
    [((0.0003, 0.0004, 0.5), 0, "ab"), ((0.0003, 0.0006, 0.5), 0, "a"), ((0.0009,), 10, ""), ((0.0,), 10**9, "a")],
)
def test_holms_correction(p_values: Sequence[float], family: int, failed: str) -> None:
    """The smallest of m probabilities is compared with 0.1 %/m, the next with 0.1 %/(m - 1) ..."""
    assert broken([Promise(name, p) for name, p in zip("abc", p_values, strict=False)], family) == [*failed]


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
        (100, CURRENT, OWNER, 15, 30, "30 of 200 axes have a false effect: current of log.csv"),
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
        (100, of_bands(1.1), OWNER, 0, 100, "bands contain 110.0% of the held-out samples"),
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


@pytest.mark.parametrize(("n", "share"), [(2, 1.0), (5, 0.6), (200, 0.2)])
def test_intervals_that_cover_too_seldom_fail(n: int, share: float) -> None:
    found = wrong(seeds(n, lambda seed, _: seed % 20 < min(n, 20) * share), family=300)
    assert found
    assert all("intervals cover" in words for words in found)


def test_intervals_that_always_cover_fail_if_the_data_narrow_them() -> None:
    """V_ss has a least error, and an interval may be that of the prior: these may cover always."""
    always = seeds(200, lambda *_: False)
    assert wrong(always, family=1000) == ["as many as 600 of 600 intervals cover"]
    wide = [replace(o, estimates=tuple(replace(e, narrowed=0.9) for e in o.estimates)) for o in always]
    assert wrong(wide) == []


def test_a_bias_fails() -> None:
    """The intervals are ± 10 %, so a standard error is 5.1 %: 200 seeds allow about 2 %, and 2 seeds more."""
    assert wrong(seeds(200, offset=0.019)) == []
    found = wrong(seeds(200, offset=0.04))
    assert len(found) == len(TRUTHS)
    assert all("a bias of 4.0%" in words for words in found)
    assert wrong(seeds(2, offset=0.04)) == []
    assert wrong(seeds(2, offset=0.04, half=0.01))
