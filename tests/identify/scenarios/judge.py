"""Judge the intervals, the bias and the findings of many seeds of a scenario."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import binom, norm

from tests.identify.scenarios.catalogue import COMPLETE, Scenario
from tests.identify.scenarios.outcome import EFFECTS, Estimate, Outcome

LEVEL = 0.95
"""The share of intervals that should contain the truth."""
BY_CHANCE = 0.001
"""The probability that chance alone fails any of the judgements of a family."""
_BIAS, _BIAS_IN_ERRORS = 0.02, 0.2
"""The allowed bias of β, relative and in standard errors; the larger one counts."""
_MOST_INVENTED = 0.05
"""The share of axes that may have an effect which is not there."""
_MANY = 200
"""With so many seeds each coefficient is judged by itself, with fewer all of them together."""
FAMILY = sum(len(scenario.coefficients) for scenario in COMPLETE.values())
"""The number of coverages that are judged at most."""
_MOST_ALARMS, _LEAST_ALARMS = 0.02, 0.95
"""The largest share of seeds with an alarm on a complete model, and the smallest on an incomplete one."""


@dataclass(frozen=True)
class Coverage:
    """How many intervals contain the truth."""

    name: str
    covered: int
    total: int
    at_bound: bool = False
    """True when the truth is at its bound: an interval that ends there may cover more often than it promises."""

    @property
    def p_value(self) -> float:
        """The probability of a coverage at least as unlikely, if the intervals held what they promise."""
        low = float(binom.cdf(self.covered, self.total, LEVEL))
        high = float(binom.sf(self.covered - 1, self.total, LEVEL))
        return low if self.at_bound else min(1.0, 2.0 * min(low, high))


def coverages(outcomes: Sequence[Outcome], scenario: Scenario) -> list[Coverage]:
    """Return the coverage of each coefficient. One without an interval is not covered."""
    found, truth = [], scenario.truth
    for name in scenario.coefficients:
        estimates = [o.coefficients.get(name) for o in outcomes]
        covered = sum(estimate is not None and _covers(estimate, truth[name]) for estimate in estimates)
        found.append(Coverage(name, covered, len(outcomes), truth[name] == 0.0))
    return found


def _covers(estimate: Estimate, truth: float) -> bool:
    return estimate.interval is not None and estimate.interval[0] <= truth <= estimate.interval[1]


def pooled(found: Iterable[Coverage]) -> list[Coverage]:
    """Return the coverage of all coefficients together, and of those whose truth is at its bound."""
    sums: dict[bool, Coverage] = {}
    for each in found:
        name = "at the bound" if each.at_bound else "all"
        so_far = sums.get(each.at_bound, Coverage(name, 0, 0, each.at_bound))
        sums[each.at_bound] = Coverage(name, so_far.covered + each.covered, so_far.total + each.total, each.at_bound)
    return list(sums.values())


def rejected(p_values: Mapping[str, float], family: int = 0) -> list[str]:
    """Return the names that fail at 0.1 % after Holm's correction.

    `family` is the number of judgements of which these are a part, where the others are judged elsewhere: the first one
    to fail must then pass the strictest limit, so that all together fail by chance once in 1,000 cases.
    """
    failed = []
    for n, (name, p) in enumerate(sorted(p_values.items(), key=lambda item: item[1])):
        if p > BY_CHANCE / (max(family, len(p_values)) - n):
            break
        failed.append(name)
    return failed


@dataclass(frozen=True)
class Bias:
    """The mean relative error of a coefficient over n seeds, and its standard error as the fits state it."""

    name: str
    mean: float
    error: float
    n: int

    @property
    def limit(self) -> float:
        """The largest bias that passes: 2 %, 0.2 standard errors, or what chance explains in so few seeds."""
        by_chance = float(norm.isf(0.5 * BY_CHANCE)) / sqrt(self.n) * self.error if self.n else 0.0
        return max(_BIAS, _BIAS_IN_ERRORS * self.error, by_chance)

    @property
    def passes(self) -> bool:
        """True when the bias is within the limit; never without any seed."""
        return self.n > 0 and abs(self.mean) < self.limit


def biases(outcomes: Sequence[Outcome], scenario: Scenario) -> list[Bias]:
    """Return the bias of each coefficient whose truth is not 0."""
    found, truth = [], scenario.truth
    for name in (name for name in scenario.coefficients if truth[name] != 0.0):
        estimates = [o.coefficients[name] for o in outcomes if name in o.coefficients]
        errors = [estimate.value / truth[name] - 1.0 for estimate in estimates]
        halves = [0.5 * (e.interval[1] - e.interval[0]) for e in estimates if e.interval]
        error = float(np.median(halves)) / float(norm.isf(0.5 * (1.0 - LEVEL))) / abs(truth[name]) if halves else 0.0
        found.append(Bias(name, float(np.mean(errors)) if errors else float("nan"), error, len(errors)))
    return found


def invented(outcome: Outcome, scenario: Scenario) -> set[str]:
    """Return the axes of which an outcome reports an effect that is not there."""
    return {f.axis for f in outcome.findings if f.kind in EFFECTS and f.kind not in scenario.effects}


def problems(outcomes: Sequence[Outcome], scenario: Scenario, family: int = 0) -> list[str]:
    """Return what is wrong with the outcomes of a scenario, a line each.

    On a complete model intervals cover, β is unbiased, and alarms and invented effects are rare. On an incomplete one
    nearly every seed raises an alarm about one of its unexplained axes. Nothing is ever refused. `family` is the
    number of coverages that are judged in all scenarios.
    """
    n = len(outcomes)
    wrong = [f"seed {seed}: refused: {o.error}" for seed, o in enumerate(outcomes) if o.error]
    if scenario.unexplained:
        alarmed = sum(any(f.axis in scenario.unexplained for f in o.alarms) for o in outcomes)
        if binom.cdf(alarmed, n, _LEAST_ALARMS) < BY_CHANCE:
            wrong.append(f"only {alarmed} of {n} seeds report that {', '.join(scenario.unexplained)} is unexplained")
        return wrong
    found = coverages(outcomes, scenario)
    judged = {each.name: each for each in (found if n >= _MANY else pooled(found))}
    failed = rejected({name: each.p_value for name, each in judged.items()}, family)
    wrong += [f"{name}: {judged[name].covered} of {judged[name].total} intervals cover" for name in failed]
    betas = (bias for bias in biases(outcomes, scenario) if bias.name.startswith("beta"))
    wrong += [f"{b.name}: a bias of {b.mean:.1%}, at most {b.limit:.1%}" for b in betas if not b.passes]
    alarmed = sum(bool(o.alarms) for o in outcomes)
    if binom.sf(alarmed - 1, n, _MOST_ALARMS) < BY_CHANCE:
        kinds = {finding.kind for o in outcomes for finding in o.alarms}
        wrong.append(f"{alarmed} of {n} seeds raise an alarm without a reason: {', '.join(sorted(kinds))}")
    made_up, fits = sum(len(invented(o, scenario)) for o in outcomes), n * len(scenario.recorded)
    if binom.sf(made_up - 1, fits, _MOST_INVENTED) < BY_CHANCE:
        wrong.append(f"{made_up} of {fits} axes have an effect that is not there")
    return wrong
