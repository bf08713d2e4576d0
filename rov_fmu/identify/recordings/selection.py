"""Select the extras of a fit: those that are identifiable and that the data justify."""

from collections.abc import Iterator, Sequence
from math import inf, log

import numpy as np

from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.identify.least_squares import covariance
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis
from rov_fmu.tank.arrays import Array

_SIGNIFICANT = 6.63
"""The reduction of the sum of squares, in variances, that a load, a delay, a current or a lag needs: 1 % by chance.

Akaike's criterion needs 2, the Bayesian one the logarithm of the number of independent samples, 6 to 10.
"""


def candidates(setting: Setting) -> Iterator[Effect]:
    """Yield all extras that might act in the recordings."""
    for kind in EFFECTS.values():
        yield from kind.candidates(setting)


def likely(extras: Sequence[Effect], setting: Setting, *, all_of_them: bool) -> Array:
    """Return the prior standard deviation of each extra; infinite for those that have none in the last fit."""
    return np.array([extra.prior(setting) if all_of_them or extra.keeps_prior else inf for extra in extras])


def earn_their_place(analysis: ResidualAnalysis) -> tuple[tuple[Effect, ...], Array]:
    """Eliminate extras backward by Wald's statistic; return the remaining ones and x without the others.

    x is of first order. An extra of the whole axis must be significant at 1 %. One of a recording, a direction or a
    curve must pass the Bayesian information criterion, because there are many of them.
    """
    model = analysis.model
    x, places = analysis.x.copy(), list(range(len(analysis.x)))
    kept = list(model.extras)
    strict = log(max(analysis.degrees_of_freedom, 8.0))
    while kept:
        of = np.ix_(places, places)
        found, plain = covariance(analysis.gram[of], analysis.meat[of]), covariance(analysis.gram[of])
        first = len(model.names)
        ratios = []
        for n, extra in enumerate(kept, first):
            off = x[places[n]] - extra.neutral
            penalty = strict if extra.is_one_of_many else _SIGNIFICANT
            ratios.append(0.0 if extra.is_none(x[places[n]]) else off * off / found[n, n] / penalty)
        weak = [n for n, ratio in enumerate(ratios) if ratio < 1.0]
        if not weak:
            break
        worst = min(weak, key=lambda n: (kept[n].rank, ratios[n]))
        n = first + worst
        if np.isfinite(plain[n, n]):
            x[places] -= plain[:, n] / plain[n, n] * (x[places[n]] - kept[worst].neutral)
        del kept[worst], places[n]
    return tuple(kept), x[places]
