"""Judge the outcomes of many seeds: figures are pooled, and chance is taken into account exactly.

Each promise gives the probability of a figure as bad as the one that was found, if the promise is kept. Together, by
Holm's correction, they fail by chance once in 1,000 cases. A promise that chance cannot break has the probability 0
where it is broken.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import binomtest, norm
from scipy.stats import t as student

from tests.identify.scenarios.outcome import Estimate, Outcome
from tests.identify.scenarios.scenario import Expected

BY_CHANCE = 0.001
"""The probability that chance alone breaks any of the promises that are judged together."""
LEVEL = 0.95
_BY_DATA = 0.5
"""An interval is that of the data, and must not cover more often than it says, if it is narrower than this share of
that of the prior."""
_MANY = 200
"""With so many seeds too low a coverage is judged for each number, with fewer for all of them together."""
_BIAS, _BIAS_IN_ERRORS = 0.02, 0.2
"""The allowed bias, relative and in standard errors; the larger one counts."""
_FALSE_RUNS, _FALSE_AXES = 0.02, 0.05
"""The share of runs with a false effect, and with an alarm; of incomplete models, that of axes with a
false effect."""
_WRONG_CAUSES = 0.1
"""The share of runs in which a cause that is named is not the true one."""
_UNUSABLE = 0.95
"""The least share of runs that advise against a model which must not be used."""
_BANDS = {True: 0.90, False: 0.85}
"""The smallest mean coverage of bands of a complete and of an incomplete model."""
_LEAST_SPREAD = 0.03
"""The coverage of bands varies at least so much between seeds; a few equal ones do not show that it never does."""


@dataclass(frozen=True)
class Promise:
    """A figure of a scenario, and how probable one as bad is if the promise is kept."""

    words: str
    p_value: float

    def within(self, scenario: str) -> "Promise":
        """Return the promise with the name of its scenario."""
        return Promise(f"{scenario}: {self.words}", self.p_value)


def at_least(words: str, count: int, total: int, share: float) -> Promise:
    """Return the promise that something happens with at least this probability. Nothing to count breaks it."""
    return Promise(words, float(binomtest(count, total, share, "less").pvalue) if total else 0.0)


def at_most(words: str, count: int, total: int, share: float) -> Promise:
    """Return the promise that something happens with at most this probability."""
    return Promise(words, float(binomtest(count, total, share, "greater").pvalue) if total else 1.0)


def broken(promises: Sequence[Promise], family: int = 0) -> list[str]:
    """Return the words of the promises that are broken at 0.1 % after Holm's correction.

    `family` is the number of promises of which these are a part, where the others are judged elsewhere. The first one
    to fail must then pass the strictest limit, so that all together fail by chance once in 1,000 cases.
    """
    failed = []
    for n, promise in enumerate(sorted(promises, key=lambda each: each.p_value)):
        if promise.p_value > BY_CHANCE / max(max(family, len(promises)) - n, 1):
            break
        failed.append(promise.words)
    return failed


def promises(outcomes: Sequence[Outcome], expected: Expected) -> list[Promise]:
    """Return all promises of a scenario, with what became of them."""
    answered = [o for o in outcomes if not o.error]
    found = [Promise(f"seed {n}: refused: {o.error}", 0.0) for n, o in enumerate(outcomes) if o.error]
    found += [Promise(f"an impossible {effect}", 0.0) for o in answered for effect in o.impossible]
    if expected.complete:
        found += _of_numbers(outcomes)
        found += _of_bias(answered)
        alarmed = sum(bool(o.alarms) for o in answered)
        found.append(at_most(f"{alarmed} of {len(answered)} runs raise an alarm", alarmed, len(answered), _FALSE_RUNS))
    found.append(_of_effects(answered, expected))
    found.append(_of_causes(answered, expected))
    if expected.unusable:
        told = sum(bool({*o.unusable} & {*expected.unusable}) for o in answered)
        words = f"only {told} of {len(answered)} runs say `do not use` of {' or '.join(expected.unusable)}"
        found.append(at_least(words, told, len(answered), _UNUSABLE))
    else:
        found += _of_bands(answered, expected)
    seconds = float(np.mean([o.seconds for o in outcomes]))
    words = f"{seconds:.1f} s of processor time, at most {expected.seconds:g} s"
    return [*found, Promise(words, float(seconds <= expected.seconds))]


# ---- Intervals -------------------------------------------------------------------------------------------------------


def by_number(outcomes: Sequence[Outcome]) -> dict[str, list[Estimate]]:
    """Return the estimates of each number over the seeds, by its axis and name."""
    found: dict[str, list[Estimate]] = {}
    for o in outcomes:
        for estimate in o.estimates:
            found.setdefault(f"{estimate.axis} {estimate.quantity}".strip(), []).append(estimate)
    return found


def _of_numbers(outcomes: Sequence[Outcome]) -> Iterator[Promise]:
    """Yield the promises that 95 % intervals cover as often as they say.

    An interval at a bound, and one that the prior or the least error of a velocity makes wider, may cover more often.
    """
    everything = {"all": [estimate for o in outcomes for estimate in o.estimates]}
    for name, estimates in (by_number(outcomes) if len(outcomes) >= _MANY else everything).items():
        covered = sum(e.covered for e in estimates)
        yield at_least(f"{name}: only {covered} of {len(estimates)} intervals cover", covered, len(estimates), LEVEL)
    exact = [e for e in everything["all"] if _is_by_data(e) and e.truth != 0.0]
    covered = sum(e.covered for e in exact)
    yield at_most(f"as many as {covered} of {len(exact)} intervals cover", covered, len(exact), LEVEL)


def _is_by_data(estimate: Estimate) -> bool:
    return estimate.narrowed < _BY_DATA and not estimate.quantity.startswith("V_ss")


def _of_bias(outcomes: Sequence[Outcome]) -> Iterator[Promise]:
    """Yield the promises that the mean relative error of each number is below 2 % or 0.2 standard errors."""
    for name, estimates in by_number(outcomes).items():
        some = [e for e in estimates if e.truth and e.interval]
        if not some:
            continue
        mean = float(np.mean([e.error for e in some]))
        error = float(np.median([0.5 * e.width / abs(e.truth) for e in some])) / float(norm.isf(0.5 * (1.0 - LEVEL)))
        beyond = abs(mean) - max(_BIAS, _BIAS_IN_ERRORS * error)
        p_value = 2.0 * float(norm.sf(beyond * sqrt(len(some)) / max(error, 1e-12))) if beyond > 0.0 else 1.0
        yield Promise(f"{name}: a bias of {mean:.1%} with a standard error of {error:.1%}", p_value)


# ---- Effects, causes and bands ---------------------------------------------------------------------------------------


def _of_effects(outcomes: Sequence[Outcome], expected: Expected) -> Promise:
    """Return the promise that effects which are not there are rare."""
    false = [o.false_effects(expected.effects) for o in outcomes]
    kinds = ", ".join(sorted({effect for some in false for effect in some}))
    if not expected.complete:
        count = sum(min(len(some), len(o.verdicts)) for o, some in zip(outcomes, false, strict=True))
        total = sum(len(o.verdicts) for o in outcomes)
        return at_most(f"{count} of {total} axes have a false effect: {kinds}", count, total, _FALSE_AXES)
    count = sum(map(bool, false))
    return at_most(f"{count} of {len(outcomes)} runs report a false effect: {kinds}", count, len(outcomes), _FALSE_RUNS)


def _of_causes(outcomes: Sequence[Outcome], expected: Expected) -> Promise:
    """Return the promise that each cause that is named is the true one; unknown causes are never wrong."""
    named = [[cause for _, cause in o.disturbances if cause] for o in outcomes]
    wrong = [[c for c in some if not any(word in c for word in expected.causes)] for some in named]
    words = ", ".join(sorted({cause for some in wrong for cause in some}))
    count, total = sum(map(bool, wrong)), len(outcomes)
    return at_most(f"{count} of {total} runs name a wrong cause: {words}", count, total, _WRONG_CAUSES)


def _of_bands(outcomes: Sequence[Outcome], expected: Expected) -> Iterator[Promise]:
    """Yield the promise that bands contain the held-out samples.

    Samples are correlated, so the coverages of the seeds are compared with their own scatter.
    """
    low = _BANDS[expected.complete]
    coverages = [float(np.mean([band.coverage for band in o.bands])) for o in outcomes if o.bands]
    n, mean = len(coverages), float(np.mean(coverages)) if coverages else 0.0
    spread = max(float(np.std(coverages, ddof=1)) if n > 1 else 0.0, _LEAST_SPREAD) / sqrt(max(n, 1))
    words = f"bands contain {mean:.1%} of the held-out samples"
    yield Promise(words, float(student.cdf((mean - low) / spread, max(n - 1, 1))) if n else 0.0)


def band_widths(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Return how wide the bands of each quantity are, relative to what the errors of all seeds imply."""
    sums: dict[str, list[float]] = {}
    for band in (band for o in outcomes for band in o.bands):
        so_far = sums.setdefault(f"{band.axis} {band.quantity}", [0.0, 0.0])
        so_far[0] += band.claimed
        so_far[1] += band.error
    return {name: sqrt(claimed / max(error, 1e-30)) for name, (claimed, error) in sums.items()}
