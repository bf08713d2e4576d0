"""Mistakes of unit and sign in logs, as scalings of channels under the objective of the identification.

A scaling says that the values of some channels in the files are k times the true ones, such as 100 for centimetres
in a column of metres, or -1 for a depth that is positive upwards. Its evidence against the files as they stand is

    2 ln of the Bayes factor = evidence(values / k) - 2 n ln |k| - evidence(files as they stand)

for n such values: the density of the values in a file is 1/|k| times that of the true ones. Two vehicles explain a
common scale of all data of an axis equally well, and only the priors of drag, inertia and thrust tell them apart.

Added mass is never negative, so an inertia below the vehicle's own is as unlikely as its distance from it says. That
distance, squared in standard errors, is subtracted here: it shows knots, which are 1.94 times as many as m/s. So is
the distance of the drag from that of a body of the vehicle's mass, where the data alone give the prior of the drag.

Only few scalings are fitted. The vehicle of the priors first simulates every log, which takes two runs of the filter:
only a channel that would agree with this motion for another k, but not for 1, is suspected. The priors do not tell
knots and feet from metres. These are suspected where the inertia is too small, or where two channels of an axis differ
by such a factor. The scale of commands is checked where they are read.
"""

from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, log, pi

import numpy as np

from rov_fmu.equation.catalogue import REVERSE, Axis
from rov_fmu.identify.beginning import begin
from rov_fmu.identify.given import Tests
from rov_fmu.identify.likelihood.filter import DivergedError, Slow
from rov_fmu.identify.likelihood.hypotheses import Starts, applied
from rov_fmu.identify.likelihood.kinds import INERTIA
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import AHEAD, SampledChannel, changes, unchanged
from rov_fmu.identify.likelihood.search import structure, worst
from rov_fmu.identify.likelihood.solve import (
    ENOUGH,
    MOST_STEPS,
    QUICK,
    REST,
    Minimum,
    best_explanations,
    evidence,
    minimise,
    start_of,
)
from rov_fmu.identify.result import KEPT, Slip
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Channel

_CERTAIN, _WEIGHED = 2.0, 0.05
"""An inertia is too small if it is so many standard errors below the vehicle's own, which is known within 5 %: weights
and the water inside change from dive to dive."""
_CLOSE = KEPT + 2.0 * QUICK
"""Up to which difference of evidence quick fits go on to their end, each of which may be QUICK from it."""
_LENGTHS = {1000.0: "in m{}", 100.0: "in c{}", 10.0: "in d{}", 0.1: "", 0.01: "", 0.001: "in k{}"}
_ANGLES = {180.0 / pi: "in degrees instead of radians", pi / 180.0: "in radians instead of degrees"}
_ANGLES |= {100.0: "in hundredths of its unit", 10.0: "in tenths of its unit"}
"""What the scales of lengths, of angles and of their rates mean, the most usual ones first; `{}` is the unit."""
_KNOTS, _FEET = 3600.0 / 1852.0, 1.0 / 0.3048
_CUSTOMARY = {_KNOTS: "in knots", _FEET: "in {}"}
"""What the scales of other units of length and speed mean; `{}` is the unit with feet."""
_SAME = 0.15
"""The largest logarithm of the ratio of two channels to that of their units."""
_NEAR = 0.5 * log(10.0)
"""The largest logarithm of the ratio of measured to simulated motion: the drag of the priors is right within a factor
of 2.7, and thus the velocity within one of 1.6."""
_ALIKE, _WORSE = 0.5, 4.0
"""The least correlation of measured and simulated motion. A scale is unlikely if it leaves so many times more
unexplained than another one does: a heading that is scaled and then wrapped may still look a little like the motion."""
_DENSITY, _MOVING, _TURNING, _SLOWEST, _USUAL = 1000.0, 1.5, 6.0, 0.1, log(8.0)
"""The density of water, and the usual drag of vehicles of the volume V = m/rho: 1.5 rho V^(2/3) v^2 / 2, and about an
axis 6 I r^2 / 2, both within a factor of 8. The drag becomes linear below 0.1 m/s or rad/s."""
_EXCITED = 10.0
"""A unit is doubted only where the motion over 10 s is so many times the noise: 35 to 300 in most logs, and 5 where the
depth hardly moved and was doubted wrongly."""
_UNHEEDED = 1e6
"""The factor of a sensor's noise with which it corrects nothing."""


@dataclass(frozen=True, eq=False)
class _Match:
    """A channel of a log beside the simulation of it by the vehicle of the priors."""

    file: str
    channel: Channel
    """As the file has it."""
    count: int
    """The number of its samples in a quick fit."""
    ratios: Mapping[float, float]
    """By scale: the ratio of the values, divided by it, to the simulated motion, where the two are alike."""

    @property
    def axis(self) -> Axis | None:
        """The axis of the motion that it measures, if it is one."""
        return self.channel.quantity.axis

    @property
    def scales(self) -> list[float]:
        """The scales that lead to a ratio near 1, the most usual mistake first; none if the scale 1 does."""
        likely = [scale for scale, ratio in self.ratios.items() if abs(log(ratio)) < _NEAR]
        return [] if 1.0 in likely else likely


Scaling = frozenset[tuple[_Match, float]]
"""Channels with their scales."""
Fits = dict[Hashable, tuple[Objective, Minimum]]
"""Fits by the channels with their scales, the hypotheses, and whether only a quick fit was made."""


def slips(
    tests: Tests,
    objective: Objective,
    best: Array,
    errors: Array,
    starts: Starts,
    made: Fits,
) -> tuple[tuple[Slip, ...], float]:
    """Return the mistakes that explain the logs much better, and the error R that the best leaves along its axes.

    `best` is where J is least for the files as they stand, `errors` are the standard errors there, and `starts` has the
    hypotheses about the structure that won. Where several explanations are about as good, each is told for its files.
    `made` keeps the fits of scaled channels, which do not depend on `best`, for a call with the same hypotheses.
    """
    known = objective.table.known
    compared = [one for n in range(len(objective.logs)) for one in _matches(objective, n, known.guessed)]
    inertias = {*_inertias(known, objective, best, errors)}
    light = {axis for axis, ratio, error in inertias if ratio < -_CERTAIN * error}
    suspected = {one: scales for one in compared if (scales := [*one.scales, *_customary(one, compared, light)])}
    untried, as_it_is = {*_scalings(suspected)}, frozenset[tuple[_Match, float]]()
    if not untried:
        return (), inf
    fits, found = dict[Scaling, tuple[Objective, Minimum]](), dict[Scaling, float]()

    def is_close(value: float) -> bool:
        return value > max(found.values(), default=-inf) - _CLOSE

    def fit(scaling: Scaling, start: Array | None = None, most: int = MOST_STEPS) -> float:
        """Return the evidence of a quick fit, or of one to its end if a quick fit was made before."""
        unlikely = sum(_lightness(scaling, *one) for one in inertias) + _drag(scaling, compared, known.guessed)
        unlikely += sum(2.0 * one.count * log(abs(scale)) for one, scale in scaling)

        before = fits.get(scaling)
        key = frozenset((one.file, one.channel, k) for one, k in scaling), frozenset(starts.items()), before is None

        def end() -> tuple[Objective, Minimum]:
            quick = before[0] if before else applied(_corrected(tests, scaling), starts, thinned=True)
            z = before[1].z if before else start_of(quick) if start is None else start

            def promises(end: Minimum, gain: float) -> bool:
                return is_close(evidence(quick, end) + REST * gain - unlikely)

            enough = ENOUGH if before else QUICK
            return quick, minimise(quick, z, most=most, enough=enough, last=False, promises=promises)

        try:
            fits[scaling] = made[key] = made[key] if key in made and start is None else end()
        except DivergedError:
            return -inf
        return evidence(*fits[scaling]) - unlikely

    found[as_it_is] = fit(as_it_is, best, 1)
    while untried:  # The best explanation may need fewer channels than it has.
        found |= {one: fit(one) for one in untried}
        found |= {one: fit(one) for one in untried if is_close(found[one])}
        first = max(filter(None, found), key=lambda one: found[one])
        fewer = {first - {member} for member in first} if is_close(found[first]) else set()
        untried = fewer - found.keys()
    if is_close(found[first]) and is_close(found[as_it_is]):
        found[as_it_is] = fit(as_it_is)
    gains = {one: value - found[as_it_is] for one, value in found.items() if one}
    told = dict[tuple[str, str], dict[str, float]]()
    for scaling in best_explanations(gains):
        for match, scale in scaling:
            name, question = match.channel.quantity.name, _words(match.channel, scale)
            told.setdefault((match.file, name), {}).setdefault(question, gains[scaling])
    mistakes = (
        Slip(file, quantity, ", or ".join(words), max(words.values()))
        for (file, quantity), words in sorted(told.items(), key=lambda item: item[0])
    )
    if first not in fits:
        return tuple(mistakes), inf
    concerned = {one.axis for one, _ in first}
    return tuple(mistakes), worst({axis: one for axis, one in structure(*fits[first]).items() if axis in concerned})


def _inertias(known: Prior, objective: Objective, z: Array, errors: Array) -> Iterator[tuple[Axis, float, float]]:
    """Yield the translations that are fitted, with ln of their inertia relative to the mass, and its error."""
    vehicle, _ = objective.table.model(z)
    for axis in known.fitted:
        index = objective.table.index(INERTIA, axis.name)
        if index is not None and not axis.is_rotation:
            inertia = vehicle.effective_inertia(axis)
            yield axis, float(np.log(inertia / vehicle[axis.inertia])), hypot(float(errors[index]), _WEIGHED)


def _lightness(scaling: Scaling, axis: Axis, ratio: float, error: float) -> float:
    """Return how unlikely an inertia is that is below the vehicle's own. With k, it is k times as large."""
    scale = min((abs(scale) for one, scale in scaling if one.axis is axis), default=1.0)
    return max(-(ratio + log(scale)) / error, 0.0) ** 2


def _drag(scaling: Scaling, compared: Sequence[_Match], guessed: Sequence[str]) -> float:
    """Return how unlikely the drag of the axes is whose prior of the drag follows from the data.

    The drag is relative to the usual one as the simulated velocity, squared, to the measured one.
    """
    scales, ratios = dict(scaling), dict[str, list[float]]()
    for match in compared:
        axis = match.axis
        if axis and axis.name in guessed and match.ratios:
            scale, ratio = next(iter(match.ratios.items()))
            ratios.setdefault(axis.name, []).append(log(ratio * abs(scale / scales.get(match, 1.0))))
    return sum((2.0 * float(np.mean(some)) / _USUAL) ** 2 for some in ratios.values())


def _customary(match: _Match, compared: Sequence[_Match], light: Collection[Axis]) -> Iterator[float]:
    """Yield the scales of knots and feet, where something speaks for them."""
    quantity = match.channel.quantity
    others = [other for other in compared if other.axis is quantity.axis and 1.0 in other.ratios]
    for scale in _CUSTOMARY if quantity.axis and not quantity.axis.is_rotation and 1.0 in match.ratios else ():
        differs = any(abs(log(match.ratios[1.0] / other.ratios[1.0] / scale)) < _SAME for other in others)
        if (quantity.axis in light or differs) and (quantity.is_velocity or scale != _KNOTS):
            yield scale


def _words(channel: Channel, scale: float) -> str:
    """Return a mistake as a question."""
    unit, axis = channel.quantity.unit, channel.quantity.axis
    if scale < 0.0:
        assert axis
        return f"is its sign right ({axis.positive} is positive), and are the signs of the commands right"
    if scale in _CUSTOMARY:
        return f"is it {_CUSTOMARY[scale].format(unit.replace('m', 'ft'))}"
    meaning = (_ANGLES if unit.startswith("rad") else _LENGTHS)[scale].format(unit)
    return f"is it {meaning}" if meaning else f"are its numbers {1.0 / scale:g} times too small for its unit"


def _scalings(likely: Mapping[_Match, Sequence[float]]) -> Iterator[Scaling]:
    """Yield all suspected channels with one scale, for each scale, and all of them with their most usual scales."""
    for scale in {scale for scales in likely.values() for scale in scales}:
        yield frozenset((one, scale) for one, scales in likely.items() if scale in scales)
    if likely:
        yield frozenset((one, scales[0]) for one, scales in likely.items())


def _corrected(tests: Tests, scaling: Scaling) -> Objective:
    """Return J of the logs with the true values of some of their channels."""
    scales = {one.channel: scale for one, scale in scaling}
    channels = ([replace(c, values=c.values / scales.get(c, 1.0)) for c in one.channels] for one in tests.folder.logs)
    logs = [replace(log, channels=tuple(own)) for log, own in zip(tests.folder.logs, channels, strict=True)]
    return Objective.of_known(*begin(replace(tests, folder=replace(tests.folder, logs=logs))))


# ---- Comparison with the vehicle of the priors -----------------------------------------------------------------------


def _matches(objective: Objective, number: int, guessed: Sequence[str]) -> Iterator[_Match]:
    """Yield all channels of a log that the filter reads, beside their simulation."""
    sampled, record = objective.logs[number], objective.records[number]
    try:
        simulated = _simulated(objective, number, guessed)
    except DivergedError:
        return
    for n, m in enumerate(sampled.measured):
        at, used = record.sensor == n, (m.quantity, m.channel.source)
        channel = next(c for c in sampled.log.channels if not c.unused and (c.quantity, c.source) == used)
        time, raw = channel.samples
        units = _ANGLES if channel.quantity.unit.startswith("rad") else _LENGTHS
        motion, likenesses = unchanged(m.channel.time, m.channel.values, AHEAD), {}
        for scale in (1.0, -1.0, *(units if motion > _EXCITED * m.noise else ())):
            values = np.unwrap(raw / scale) if channel.quantity.wraps else raw / scale
            likenesses[scale] = _likeness(m, record.time[at], np.interp(record.time[at], time, values), simulated[at])
        most = 1.0 - _ALIKE**2, _WORSE * min(unexplained for _, unexplained in likenesses.values())
        ratios = {k: ratio for k, (ratio, unexplained) in likenesses.items() if ratio > 0.0 and unexplained < min(most)}
        yield _Match(sampled.file, channel, int(np.sum(sampled.thinned.sensor == n)), ratios)


def _simulated(objective: Objective, number: int, guessed: Sequence[str]) -> Array:
    """Return the samples of a log by the vehicle of the priors. Measured angles correct only the other channels.

    The slow gain of the thrust stays 0: a heading of the wrong sign would drive it to -2, and all motion with it.
    `guessed` names the axes whose prior of the drag follows from the data: they have the drag of a body of their mass.
    """
    sampled, record = objective.logs[number], objective.records[number]
    parameters = objective.table.of_log(objective.mean, sampled)
    usual = dict(parameters.coefficients)
    for axis in (axis for axis in sampled.layout.bare_axes if axis.name in guessed):
        volume = usual[axis.inertia] / _DENSITY
        drag = 0.5 * _DENSITY * (_TURNING * volume if axis.is_rotation else _MOVING * volume ** (2.0 / 3.0))
        for end in ("", REVERSE):
            usual |= {axis.coefficient(f"a_d{end}"): drag, axis.coefficient(f"b_d{end}"): _SLOWEST * drag}
    parameters = replace(parameters, coefficients=usual)
    is_angle = np.array([m.quantity.unit == "rad" for m in sampled.measured])
    parameters = replace(parameters, gain=Slow())
    heeding = replace(parameters, white=tuple(np.where(is_angle, 1.0, _UNHEEDED) * parameters.white))
    run = objective.filters[number].run
    alone, corrected = run(record, parameters, begin=0.0), run(record, heeding)
    return record.value - np.where(is_angle[record.sensor], alone.innovations, corrected.innovations)


def _likeness(m: SampledChannel, time: Array, measured: Array, simulated: Array) -> tuple[float, float]:
    """Return the ratio of measured to simulated motion, and the share of the variance that it leaves unexplained."""
    if not m.sensor.is_velocity:
        simulated = np.unwrap(simulated) if m.quantity.wraps else simulated
        measured, simulated = changes(time, measured), changes(time, simulated)
    if len(measured) < 2 or not np.ptp(measured) or not np.ptp(simulated):
        return 0.0, 1.0
    covariance = np.cov(measured, simulated)
    ratio, share = covariance[0, 1] / covariance[1, 1], covariance[0, 1] ** 2 / np.prod(np.diag(covariance))
    return float(ratio), float(1.0 - share)
