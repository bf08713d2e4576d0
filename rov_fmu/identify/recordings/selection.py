"""Select the extras of a fit: those that are identifiable and that the data justify."""

from collections.abc import Collection, Iterator, Sequence
from math import log

import numpy as np

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.coupling import EAST, NORTH, is_in_flow
from rov_fmu.identify.effects.extras import EffectKind, Extra
from rov_fmu.identify.least_squares import covariance
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis
from rov_fmu.identify.recordings.runs import PreparedRecording, axes_of
from rov_fmu.model.layout import AXES, REVERSE, SURGE, SWAY, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_SIGNIFICANT = 6.63
"""The reduction of the sum of squares, in variances, that a load, a delay, a current or a lag needs: 1 % by chance.

Akaike's criterion needs 2, the Bayesian one the logarithm of the number of independent samples, 6 to 10.
"""
_ORDER = ("", "reverse drag", "", "reverse thrust", "current", "dead band", "load", "lag", "delay")


def candidates(
    data: Sequence[PreparedRecording], base: Rov, known: Collection[str], lag: Collection[str]
) -> Iterator[Extra]:
    """Yield all extras that might act in the recordings."""
    axes = axes_of(data)
    curves = {curve.name: curve for axis in axes for curve in curves_of(base.layout, axis)}
    yield from (Extra("lag", name) for name in curves if name in lag)
    for axis in axes:
        recordings = [d.recording for d in data if d.axis is axis]
        kinds: tuple[EffectKind, ...] = ("load", "delay")
        for kind in kinds:
            if kind == "delay" or axis.coefficient("F_0") not in known:
                yield Extra(kind, axis.name)
                yield from (Extra(kind, r.file, axis.name) for r in recordings[1:])
        if axis in (SURGE, SWAY):
            yield from (Extra("current", r.file, axis.name) for r in recordings if not is_in_flow(r))
        if "a_d" + REVERSE not in base.layout.kinds[axis.name].keys and axis.coefficient("a_d") not in known:
            yield Extra("reverse drag", axis.name)
    for file in dict.fromkeys(d.recording.file for d in data if is_in_flow(d.recording)):
        yield from (Extra(kind, file) for kind in (NORTH, EAST))
    for name, curve in curves.items():
        if "a_t" + REVERSE not in curve.keys:
            yield Extra("reverse thrust", name)
        if "c_0" not in curve.keys:
            yield Extra("dead band", name)


def likely(extras: Sequence[Extra], data: Sequence[PreparedRecording], base: Rov) -> Array:
    """Return the prior standard deviation of each extra; it keeps unidentifiable extras near their neutral values."""
    found = []
    for extra in extras:
        axis: Axis = next((d.axis for d in data if extra.concerns(d.recording)), data[0].axis)
        size = {"load": 0.2 * base.strongest(axis), "delay": 0.5, "lag": 0.5, "dead band": 0.1}.get(
            extra.kind, 0.3 if extra.is_current else 0.5
        )
        found.append(0.2 * size if extra.of not in AXES and extra.kind in ("load", "delay") else size)
    return np.array(found)


def _order(extra: Extra) -> int:
    """Return the order of elimination: the least likely extra is dropped first.

    Ballast is a load in heave. In surge and sway a current is more likely than a load.
    """
    if extra.is_current:
        return _ORDER.index("current")
    if extra.is_of_file:
        return 0
    if extra.kind == "load" and extra.of in (SURGE.name, SWAY.name):
        return 2
    return _ORDER.index(extra.kind)


def earn_their_place(analysis: ResidualAnalysis) -> tuple[tuple[Extra, ...], Array]:
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
            many = (extra.is_of_file and not extra.is_current) or extra.pairs() or extra.kind == "dead band"
            penalty = strict if many else _SIGNIFICANT
            is_none = extra.kind == "dead band" and off <= 0.0
            ratios.append(0.0 if is_none else off * off / found[n, n] / penalty)
        weak = [n for n, ratio in enumerate(ratios) if ratio < 1.0]
        if not weak:
            break
        worst = min(weak, key=lambda n: (_order(kept[n]), ratios[n]))
        n = first + worst
        if np.isfinite(plain[n, n]):
            x[places] -= plain[:, n] / plain[n, n] * (x[places[n]] - kept[worst].neutral)
        del kept[worst], places[n]
    return tuple(kept), x[places]
