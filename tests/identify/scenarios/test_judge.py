"""The judge passes outcomes that keep every promise, and each promise can be broken."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from tests.identify.scenarios.judge import BY_CHANCE, Gate, Promise, at_least, at_most, broken, promises
from tests.identify.scenarios.outcome import Band, Estimate, Outcome
from tests.identify.scenarios.scenario import Expected

COMPLETE = Expected(("load of heave",))
INCOMPLETE = replace(COMPLETE, causes=("voltage", "time"), complete=False)
OWNER = replace(COMPLETE, like_owners=True)
TRUTHS = {("surge", "a_d_u"): 20.0, ("surge", "beta_u"): 0.8, ("heave", "a_d_w"): 40.0, ("heave", "V_ss 30 %"): 0.2}
NO_GATE: Gate = {}
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


def wrong(
    outcomes: Sequence[Outcome], expected: Expected = COMPLETE, gate: Gate = NO_GATE, family: int = 0
) -> list[str]:
    return broken(promises("a", outcomes, expected, gate), family)


def some(outcomes: Sequence[Outcome], count: int, **changed: object) -> list[Outcome]:
    """Return the outcomes with the first of them changed."""
    return [*(replace(o, **changed) for o in outcomes[:count]), *outcomes[count:]]  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [2, 20, 200])
@pytest.mark.parametrize("expected", [COMPLETE, INCOMPLETE, OWNER])
def test_kept_promises_pass(n: int, expected: Expected) -> None:
    assert wrong(seeds(n), expected, family=300) == []


# ---- Chance ----------------------------------------------------------------------------------------------------------


def test_exact_binomial_limits() -> None:
    """Of 200 intervals, 179 to 198 pass at 0.1 % on each side; the limit of rare things is that of binom.ppf."""
    covered = range(201)
    assert next(k for k in covered if at_least("", k, 200, 0.95).p_value > BY_CHANCE) == 179
    assert max(k for k in covered if at_most("", k, 200, 0.95).p_value > BY_CHANCE) == 198
    assert max(k for k in covered if at_most("", k, 200, 0.02).p_value > BY_CHANCE) == binom.ppf(
        1 - BY_CHANCE, 200, 0.02
    )
    assert at_least("", 0, 0, 0.95).p_value == 0.0
    assert at_most("", 0, 0, 0.02).p_value == 1.0


def test_holms_correction() -> None:
    """The smallest of m probabilities is compared with 0.1 %/m, the next with 0.1 %/(m - 1) ..."""

    def failed(*p_values: float, family: int = 0) -> list[str]:
        return broken([Promise(name, p) for name, p in zip("abc", p_values, strict=False)], family)

    assert failed(0.0004, 0.0004, 0.5) == []
    assert failed(0.0003, 0.0004, 0.5) == ["a", "b"]
    assert failed(0.0003, 0.0006, 0.5) == ["a"]
    assert failed(0.0009) == ["a"]
    assert failed(0.0009, family=10) == []
    assert failed(0.0, family=10**9) == ["a"]


# ---- Each promise can be broken --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "share"), [(2, 1.0), (20, 0.3), (200, 0.2)])
def test_intervals_that_cover_too_seldom_fail(n: int, share: float) -> None:
    found = wrong(seeds(n, lambda seed, _: seed % 20 < 20 * share), family=300)
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


def test_a_refusal_fails() -> None:
    for expected in (COMPLETE, INCOMPLETE):
        assert "seed 0: refused: log.csv: no" in wrong(some(seeds(20), 1, error="log.csv: no"), expected)


def test_false_effects_fail() -> None:
    """Of 200 runs, 2 % may have one. It is told by its kind, or by its kind and what has it."""
    false = (("current", "log.csv", 0.1),)
    assert wrong(some(seeds(200), 9, effects=false)) == []
    assert wrong(some(seeds(200), 20, effects=false)) == ["20 of 200 runs report a false effect: current of log.csv"]
    assert wrong(seeds(20, effects=(("load", "surge", 0.3),)))
    assert wrong(seeds(200, effects=false), replace(COMPLETE, effects=("current",))) == []
    assert wrong(some(seeds(100), 15, effects=false), OWNER) == []
    assert wrong(some(seeds(100), 30, effects=false), OWNER) == [
        "30 of 200 axes have a false effect: current of log.csv"
    ]


@pytest.mark.parametrize(
    "alarm", [{"disturbances": (("surge", ""),)}, {"verdicts": {"surge": "do not use", "heave": "good"}}]
)
def test_alarms_on_a_complete_model_fail(alarm: dict[str, object]) -> None:
    assert wrong(some(seeds(200), 9, **alarm)) == []
    assert wrong(some(seeds(200), 20, **alarm)) == ["20 of 200 runs raise an alarm"]
    assert wrong(some(seeds(20), 20, **alarm), INCOMPLETE) == []


def test_a_wrong_cause_fails_and_an_unknown_one_does_not() -> None:
    for cause in ("the voltage", ""):
        assert wrong(seeds(100, disturbances=(("surge", cause),)), INCOMPLETE) == []
    tether = {"disturbances": (("thrust", "the voltage"), ("surge", "the distance"))}
    assert wrong(some(seeds(100), 15, **tether), INCOMPLETE) == []
    assert wrong(some(seeds(100), 25, **tether), INCOMPLETE) == ["25 of 100 runs name a wrong cause: the distance"]


@pytest.mark.parametrize(
    ("expected", "passes", "fails"), [(COMPLETE, 0.9, 0.75), (INCOMPLETE, 0.85, 0.7), (OWNER, 0.98, 1.1)]
)
def test_bands_that_contain_too_few_samples_fail(expected: Expected, passes: float, fails: float) -> None:
    """For owners too many are wrong as well."""

    def with_bands(coverage: float) -> list[Outcome]:
        return seeds(100, bands=(Band("surge", "velocity", coverage, 1.0, 1.0),))

    assert wrong(with_bands(passes), expected) == []
    assert wrong(with_bands(fails), expected) == [f"bands contain {fails:.1%} of the held-out samples"]
    assert "bands contain 0.0% of the held-out samples" in wrong(seeds(20, bands=()), expected)


def gate(half: float, *, covers: bool = True) -> Gate:
    """Return what the gate did on 20 seeds."""
    widths = {key: 2.0 * half * truth for key, truth in TRUTHS.items()}
    return {("a", seed, *key): (covers, width) for seed in range(20) for key, width in widths.items()}


def test_intervals_that_are_wider_than_those_of_the_gate_fail() -> None:
    """Those of V_ss, of another scenario, and of an axis that the gate did not cover do not count."""
    assert wrong(seeds(20), gate=gate(0.1 / 2.49)) == []
    found = wrong(seeds(20), gate=gate(0.1 / 2.51))
    assert found == [f"{axis}: intervals are 2.51 times as wide as the gate's" for axis in ("surge", "heave")]
    assert wrong(seeds(20), gate=gate(0.01, covers=False)) == []
    assert wrong(seeds(20), gate={("b", *key): value for (_, *key), value in gate(0.01).items()}) == []  # type: ignore[misc]
    only_answers = {key: value for key, value in gate(0.01).items() if key[3].startswith("V_ss")}
    assert wrong(seeds(20), gate=only_answers) == []


def test_a_slow_identification_fails() -> None:
    assert wrong(seeds(2, seconds=9.0), replace(COMPLETE, seconds=8.0)) == ["9.0 s of processor time, at most 8 s"]
