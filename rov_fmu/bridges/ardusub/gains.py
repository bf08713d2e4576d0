"""The gains of ArduSub for a vehicle: a rule in closed form, and flights that decide which of them are written.

What the loops do depends on the acceleration per demand, k/M or k/J, on the lag T of the thrust, and on the time from
the sensors to the thrust, which is the dead time T_d and DELAY. M and J are the mass and the inertia with added mass, k
is the force or moment along the axis per demand, at 30 %. So the scale of an assumed thrust cancels.

- depth: the acceleration loop has the gain 0.8, so PSC_ACCZ_P = 0.8 M/(0.2 k), and the speed loop the bandwidth
  min(8/s, 0.88/(T + T_d)), which is PSC_VELZ_P;
- turns: the rate loop has the bandwidth k_v = min(2.8/T, 0.585/(margin (T_d + 35 ms))), so ATC_RAT_*_P = k_v J/k, and
  ATC_ANG_*_P = k_v/ratio. Of the 35 ms, ArduSub's filters take 20.

Stiffness and chatter are the same product P k/J: a larger P turns a heading out of the dead band of its thrusters, and
chatters where k/J or the delay is larger than in the file. So the margin decides how good a heading can be. It is that
of the file's intervals if the vehicle was identified. The ratio, and the integrator of the heading, are chosen by
flights. In 48 flights of the real ArduSub with six vehicles, k_v of 11 to 13/s with 0.3/s of P as the integrator
overshot less and settled earlier than the firmware's gains. With less than 0.3/s its first turn overshoots by 8 deg.

`tuned` then flies vehicles that differ from the file, with thrusters biased to 50 %, and lowers the gains until nothing
chatters. What does not beat the gains that the vehicle has is left out.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, inf, nan, radians, sqrt
from pathlib import Path

import numpy as np

from rov_fmu.autopilot.ardusub import FIRMWARE, RATE, ROWS, FlownLeg, Leg, Mixer, fly
from rov_fmu.autopilot.figures import scaled_axis, step_figures
from rov_fmu.autopilot.gains import lag_along
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, YAW, Axis
from rov_fmu.io.messages import FileError, InputError, listed, shown
from rov_fmu.io.reading import read_text
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

BEFORE = Leg(YAW, radians(4.0))
"""A small turn, after which the integrator is as in a dive. It is not shown."""
LEGS = (
    Leg(SURGE, 0.0, 3.0),
    *(Leg(HEAVE, size) for size in (0.5, -0.5, 1.5, -1.5)),
    *(Leg(axis, radians(size)) for axis in (ROLL, PITCH) for size in (15.0, -15.0)),
    BEFORE,
    *(Leg(YAW, radians(size)) for size in (30.0, -30.0, 90.0, -90.0)),
    Leg(SURGE, 0.5, 6.0),
)
"""The flight: a start, steps of depth, of roll and pitch, and of heading, and six seconds ahead."""
NEW_NAMES = {"PSC_POSZ_": ("PSC_D_POS_", 1.0), "PSC_VELZ_": ("PSC_D_VEL_", 1.0), "PSC_ACCZ_": ("PSC_D_ACC_", 0.1)}
"""How names begin before ArduSub 4.7, and from 4.7 on, with the factor of the values: `AC_PosControl` in SI units."""
HEAD = "# The gains of ArduSub for "
"""How a file of gains begins, before the identifier of the vehicle."""
REST = 2 * RATE
"""The samples at the end of a leg in which the vehicle is at rest."""
_UNSTABLE = (radians(10.0), radians(10.0), radians(10.0), 0.25)
"""An error at rest above this, RMS, rad and m, means that an axis is not stable."""
_SWING = (radians(10.0), radians(10.0), radians(10.0), 0.25)
"""A single vehicle that swings by more than this at rest, from one end to the other, oscillates, rad and m."""
_CHATTER = 1.0
"""A demand that changes by more than this in a second at rest chatters. The gains that were flown have at most 0.1, and
those of another vehicle 8, as in the flight of the real ArduSub."""
_CORNER, _LEAST_CORNER = 1.3 / 0.7, 1.2
"""The acceleration per demand that is borne, relative to that of the file: of a vehicle of which nothing is known, and
the least."""
_CHOICES = tuple((ratio, integral) for ratio in (1.5, 2.0, 2.5) for integral in (0.3, 0.5))
"""What k_v/ATC_ANG_YAW_P and ATC_RAT_YAW_I/ATC_RAT_YAW_P (1/s) are chosen from."""
_OF_TILT = (2.5, 0.5)
"""The same of roll and pitch."""
_WORST = 1.1
"""Gains lose where a figure is worse than this, relative to the usual ones, or where they are no better on average."""
_LOST = (
    "with them it would have {:.0%} of the overshoot, {:.0%} of the settling time and {:.0%} of the error at rest that "
    "it has with {} gains"
)
_LOWER, _LEAST = 0.9, 0.25
"""By what gains are lowered at a time, and the least share of the rule's."""
_DRAWS = 8
_FAR = 1.96
"""The standard errors from a value to the end of its interval of 95 %."""
DELAY = 0.015
"""The time from the sensors to the thrust that a flight has: samples, estimator, and speed controllers, s."""
_DELAYS = (0.02, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2)
"""The delays that are flown to tell how much the gains bear, s."""
RANGES = {
    **dict.fromkeys(("ATC_RAT_RLL_P", "ATC_RAT_PIT_P"), (0.0, 0.3)),
    **dict.fromkeys(("ATC_RAT_RLL_I", "ATC_RAT_PIT_I", "ATC_RAT_YAW_P", "PSC_ACCZ_FF"), (0.0, 0.5)),
    **dict.fromkeys(("ATC_RAT_RLL_D", "ATC_RAT_PIT_D", "ATC_RAT_YAW_D"), (0.0, 0.02)),
    **{"ATC_RAT_YAW_I": (0.0, 0.05), "PSC_POSZ_P": (1.0, 3.0), "PSC_VELZ_P": (1.0, 8.0)},
    **dict.fromkeys(("ATC_ANG_RLL_P", "ATC_ANG_PIT_P", "ATC_ANG_YAW_P"), (3.0, 12.0)),
    **{"PSC_ACCZ_P": (0.2, 1.5), "PSC_ACCZ_I": (0.0, 3.0), "PSC_ACCZ_D": (0.0, 0.4)},
}
"""The ranges that ArduSub documents, which are no limits: those of `AC_AttitudeControl_Sub` and `AC_PosControl`."""
_LARGEST = 1e6
"""The largest gain, and the largest number of bytes, that are read from a file."""


FIGURES = ("overshoot", "settled in s", "error at rest", "changes of commands per s")
SHOWN = {
    HEAVE: ("depth", 3, 100.0, "cm", 0.05),
    ROLL: ("roll", 0, degrees(1.0), "deg", radians(2.0)),
    PITCH: ("pitch", 1, degrees(1.0), "deg", radians(2.0)),
    YAW: ("heading", 2, degrees(1.0), "deg", radians(2.0)),
}
"""The words, the row of the errors and demands, the factor and the unit that people read, and what counts as settled
(m, rad), by axis."""


@dataclass(frozen=True, eq=False)
class Tuned:
    """The gains of a vehicle, and their flight beside that of the firmware's."""

    vehicle: Vehicle
    frame: str
    gains: Mapping[str, tuple[float, str]]
    """The values and their reasons, by the names before ArduSub 4.7. An axis without gains of its own is left out."""
    notes: Sequence[str]
    """What the reader should know: an axis that has not the gains of the rule, or the delay that they bear."""
    legs: Sequence[FlownLeg]
    """The first vehicle has these gains, and the second one the usual ones."""
    compared: Mapping[Axis, Array]
    """Overshoot, settling time and error at rest by axis, 1 being those of the usual gains, also of gains that lost."""
    usual: Mapping[str, float]
    """The gains that were to be beaten, by the same names."""
    whose: str
    """Whose they are: `the firmware's` or `your`."""


def tuned(vehicle: Vehicle, given: Path | None = None) -> Tuned:
    """Return the gains of a vehicle that win a flight, also of vehicles with other lags and thrusts, and of draws.

    - `given`: a file of parameters with the gains that the vehicle has, which are to be beaten; the default is those of
      the firmware.

        tuned(load_vehicle(find_vehicle("bluerov2"))).gains["ATC_RAT_YAW_P"]

    Raises InputError if ArduSub has no frame for the thrusters, or if no axis has gains that win; FileError about given
    gains; and BuildError without an engine.
    """
    mixer, axes = Mixer(vehicle), [axis for axis in ROWS if vehicle.layout.has(axis)]
    own, owner = read_gains(given) if given else ({}, "")
    usual, whose = FIRMWARE | own, "your" if given else "the firmware's"
    why = {axis: _refusal(vehicle, mixer, axis) for axis in axes}
    margins = {axis: _margin(vehicle, mixer, axis) for axis in axes if not why[axis]}
    shares, judged = dict.fromkeys(axes, 1.0), dict[Axis, Array]()
    push = mixer.push(vehicle, HEAVE, 0.5) if HEAVE in axes else 0.0
    legs = [leg for leg in LEGS if leg.axis in (SURGE, *axes)]

    def flight(others: Sequence[tuple[Mapping[str, float], float]], gains: Mapping[str, float]) -> list[FlownLeg]:
        """Fly vehicles with delays. The second one has the usual gains; those after it are loaded."""
        flying = {n: np.where(np.arange(len(others)) == 1, x, gains.get(n, x)) for n, x in usual.items()}
        loads = np.where(np.arange(len(others)) < 2, 0.0, push)
        return [*fly(vehicle, flying, legs, [one for one, _ in others], loads, [delay for _, delay in others])]

    while True:
        rules = {
            axis: [_rule(vehicle, mixer, axis, shares[axis], margins[axis], one) for one in _CHOICES]
            for axis in margins
            if not why[axis]
        }
        if not rules:
            reasons = listed(f"{axis.name}: {words}" for axis, words in why.items())
            raise InputError(f"{vehicle.identifier}: there are no gains to load: {reasons}")
        chosen = {axis: choices[0] for axis, choices in rules.items()}
        lost = list[Axis]()
        for axis, ratios in _compared(vehicle, legs, rules, usual).items():
            costs = ratios.mean(axis=0) + 10.0 * (ratios.max(axis=0) > _WORST)
            best = int(costs.argmin())
            chosen[axis], judged[axis] = rules[axis][best], ratios[:, best]
            lost += [] if costs[best] < 1.0 else [axis]
        gains = {name: gain for rule in chosen.values() for name, gain in rule.items()}
        values = {name: value for name, (value, _) in gains.items()}
        flown = flight(_variations(vehicle, margins), values)
        flaws = {axis: words for axis, words in _flaws(flown).items() if axis in rules}
        for axis, words in flaws.items():
            shares[axis] *= _LOWER
            if shares[axis] < _LEAST:
                why[axis] = f"with {_LEAST:.0%} of the rule's gains, {words}"
        why |= {} if flaws else {axis: _LOST.format(*judged[axis], whose) for axis in lost}
        if not (flaws or lost):
            break
    others = [owner] if owner not in ("", vehicle.identifier) else []
    notes = [f"{given}: has the gains of {other}; the vehicle is {vehicle.identifier}" for other in others]
    notes += [vehicle.caution] if vehicle.caution else []
    notes += [f"{axis.name}: left out, so that it keeps its gains: {words}" for axis, words in why.items() if words]
    notes += [
        f"{axis.name}: the gains are {shares[axis]:.0%} of the rule's, so that nothing chatters and all is stable"
        for axis in rules
        if shares[axis] < 1.0
    ]
    notes += [f"{whose} gains are not recommended: {words}" for words in _flaws(flown, 1).values()]
    notes += _borne(vehicle, [*rules], margins, lambda others: flight([({}, DELAY), *others], values))
    return Tuned(vehicle, mixer.frame, gains, notes, [leg.of(0, 1) for leg in flown], judged, usual, whose)


def _borne(
    vehicle: Vehicle,
    axes: Sequence[Axis],
    margins: Mapping[Axis, float],
    flight: Callable[[Sequence[tuple[Mapping[str, float], float]]], list[FlownLeg]],
) -> Iterator[str]:
    """Yield which delays the gains bear with the vehicle and with the fastest one, and what an unknown lag costs."""
    late = [(one, delay) for one in ({}, _corner(vehicle, margins, 1)) for delay in _DELAYS]
    flown = flight([({}, DELAY), (_lag_ends(vehicle), DELAY), *late])
    calm = [{*axes}.isdisjoint(_flaws(flown, n)) for n in range(3, 3 + len(late))]
    count, beside = len(_DELAYS), ", beside T_d," if "T_d" in vehicle.coefficients else ""
    own, fast = (1e3 * (DELAY, *_DELAYS)[[*some, False].index(False)] for some in (calm[:count], calm[count:]))
    yield (
        f"the gains bear {own:.0f} ms from the sensors to the thrust{beside} with the vehicle of the file, and "
        f"{fast:.0f} ms with more acceleration per command "
        f"({listed(f'{axis.name} {margins[axis]:.2f} times' for axis in axes)}); {1e3 * DELAY:.0f} ms are assumed"
    )
    if vehicle.unknown_lags:
        rows = figures(vehicle, [leg.of(2, 0) for leg in flown])
        over = (f"{title} {x:.2g} {unit} ({y:.2g})" for axis, title, unit, ((x, y), *_) in rows if axis in axes)
        yield f"the gains are for a lag of {max(lag_along(vehicle, axis) for axis in axes):.2g} s"
        yield f"overshoot with the longest lag, in brackets with that of the file: {listed(over)}"


def _compared(
    vehicle: Vehicle,
    legs: Sequence[Leg],
    rules: Mapping[Axis, Sequence[Mapping[str, tuple[float, str]]]],
    usual: Mapping[str, float],
) -> dict[Axis, Array]:
    """Return overshoot, settling time and error at rest by axis for each choice of the rules (3 x choices).

    1 is that of the usual gains, of all steps along the axis. They fly with DELAY and with 20 ms more, because where a
    heading rests in the dead band differs from leg to leg. What nobody sees does not count: a tenth of what is settled.
    """
    count = 1 + len(_CHOICES)
    flying = {name: np.full(2 * count, value) for name, value in usual.items()}
    for rule in rules.values():
        flying |= {n: np.tile([usual[n], *(one[n][0] for one in rule)], 2) for n in rule[0]}
    delays = np.repeat([DELAY, DELAY + 0.02], count).tolist()
    flown = [*fly(vehicle, flying, legs, [{}] * (2 * count), 0.0, delays)]
    sums = dict[Axis, Array]()
    for one in flown:
        for axis, _, _, cells in figures(vehicle, [one]):
            if axis in rules and one.leg.axis is axis:
                least = 0.1 * SHOWN[axis][2] * SHOWN[axis][4]
                bounds = (least, inf), (0.0, one.leg.seconds), (least, inf)
                counted = [np.clip(cell, *bound) for cell, bound in zip(cells, bounds, strict=False)]
                sums[axis] = sums.get(axis, 0.0) + np.reshape(counted, (3, 2, count))
    return {axis: total.sum(axis=1)[:, 1:] / total.sum(axis=1)[:, :1] for axis, total in sums.items()}


def _refusal(vehicle: Vehicle, mixer: Mixer, axis: Axis) -> str:
    """Return why an axis has no gains of its own, or an empty text."""
    words = vehicle.provenance.words if vehicle.provenance else {}
    word = words.get(axis.name, "not identified") if words else "good"
    without = [c for t in vehicle.layout.thrusters_along(axis) if not (c := vehicle.layout.curve_of[t.name]).has_lag]
    if word not in ("good", "usable"):
        reason = f"the verdict is {word}"
    elif without:
        reason = f"curve {without[0].name} has no lag T, which limits how fast the loop may be"
    elif not _strength(vehicle, mixer, axis) > 0.0:
        reason = "a demand of 30 % gives no thrust"
    else:
        return ""
    return reason


def _strength(vehicle: Vehicle, mixer: Mixer, axis: Axis) -> float:
    """Return k, N or N.m per demand: the larger one of both directions."""
    return max(abs(mixer.push(vehicle, axis, demand)) for demand in (0.3, -0.3)) / 0.3


def _rule(
    vehicle: Vehicle, mixer: Mixer, axis: Axis, share: float, margin: float, choice: tuple[float, float]
) -> dict[str, tuple[float, str]]:
    """Return the gains of an axis with their reasons: a share of those of the rule, with one of _CHOICES for yaw."""
    inertia, k = vehicle.effective_inertia(axis), _strength(vehicle, mixer, axis)
    lag, dead = lag_along(vehicle, axis), vehicle.coefficients.get("T_d", 0.0)
    lowered = f"; {share:.0%} of it, so that it does not chatter" if share < 1.0 else ""
    behind = f", T = {lag:.3g} s" + (f", T_d = {dead:.3g} s" if dead else "")
    if axis is HEAVE:
        p, climb = share * 0.8 * inertia / (0.2 * k), min(FIRMWARE["PSC_VELZ_P"], 0.88 / (lag + dead))
        return {
            "PSC_ACCZ_P": (p, f"0.8 M/(0.2 k), M = {inertia:.3g} kg, k = {k:.3g} N{lowered}"),
            "PSC_ACCZ_I": (1.3 * p, "1.3/s of P, which carries the weight and crosses the dead band"),
            "PSC_ACCZ_D": (0.0, "as the firmware's"),
            "PSC_ACCZ_FF": (0.25 * p, "a quarter of P, which acts before there is an error"),
            "PSC_POSZ_P": (min(2.0, climb / 4.0), "a quarter of PSC_VELZ_P, at most 2, for less overshoot"),
            "PSC_VELZ_P": (climb, f"min(8/s, 0.88/(T + T_d)){behind}"),
        }
    ratio, integral = choice if axis is YAW else _OF_TILT
    chosen = ", chosen by flights" if axis is YAW else ""
    speed = share * min(2.8 / lag, 0.585 / (margin * (dead + 0.02 + DELAY)))
    p = speed * inertia / k
    rule = f"k_v = min(2.8/T, 0.585/({margin:.2f} (T_d + 35 ms))){behind}"
    return {
        f"ATC_RAT_{ROWS[axis]}_P": (p, f"k_v J/k, J = {inertia:.3g} kg.m2, k = {k:.3g} N.m, {rule}{lowered}"),
        f"ATC_RAT_{ROWS[axis]}_I": (
            integral * p,
            f"{integral:g}/s of P, against steady moments and the dead band{chosen}",
        ),
        f"ATC_RAT_{ROWS[axis]}_D": (0.5 * lag * p, "0.5 T of P, against the lag"),
        f"ATC_ANG_{ROWS[axis]}_P": (speed / ratio, f"k_v/{ratio:g}{chosen}"),
    }


def _margin(vehicle: Vehicle, mixer: Mixer, axis: Axis) -> float:
    """Return by what the acceleration per demand may be larger than the file says: 30 % more thrust and less inertia.

    Of an identified vehicle, it is the end of what the intervals leave open (97.5 %), at least 20 %. Roll and pitch,
    whose steps were not flown, have the wide one.
    """
    known = vehicle.uncertainty
    if not (vehicle.provenance and known.names) or axis in (ROLL, PITCH):
        return _CORNER
    drawn = known.drawn(np.random.default_rng(1).random((64, len(known.names)))).tolist()
    others = [vehicle, *(vehicle.with_(**dict(zip(known.names, one, strict=True))) for one in drawn)]
    own, *rest = (_strength(one, mixer, axis) / one.effective_inertia(axis) for one in others)
    return max(_LEAST_CORNER, float(np.quantile(rest, 0.975)) / own)


def _corner(vehicle: Vehicle, margins: Mapping[Axis, float], thrust: int, inertia: int = 0) -> dict[str, float]:
    """Return the coefficients of a vehicle with more (1) or less (-1) thrust and inertia, as far as the margins go."""
    inertia = inertia or -thrust
    return {
        name: x
        for axis in vehicle.layout.bare_axes
        for part in [sqrt(margins.get(axis, _CORNER))]
        for name, x in scaled_axis(vehicle, axis, part**thrust, part**inertia).items()
    }


def _lag_ends(vehicle: Vehicle) -> dict[str, float]:
    """Return the longest lags: 30 % more than in the file, or the far ends of their intervals."""
    known = vehicle.uncertainty
    lags = {c.coefficient("T"): 1.3 * vehicle[c.coefficient("T")] for c in vehicle.layout.curves if c.has_lag}
    ends = dict(zip(known.names, known.at(np.full(len(known.names), _FAR)).tolist(), strict=True))
    return {name: max(lag, ends.get(name, lag)) for name, lag in lags.items()}


def _variations(vehicle: Vehicle, margins: Mapping[Axis, float]) -> list[tuple[dict[str, float], float]]:
    """Return the coefficients of the vehicles that fly, where they are not those of the file, each with its delay (s).

    Three are as in the file. Then come all corners of more and less thrust and inertia with 20 ms, the fastest of them
    without delay, and two with more lag. Others are drawn.
    """
    known, lags = vehicle.uncertainty, _lag_ends(vehicle)
    fast, slow = (_corner(vehicle, margins, thrust) for thrust in (1, -1))
    corners = [(_corner(vehicle, margins, thrust, inertia), 0.02) for thrust in (1, -1) for inertia in (-1, 1)]
    drawn = known.drawn(np.random.default_rng(0).random((_DRAWS * bool(known.names), len(known.names)))).tolist()
    return [
        *(({}, DELAY),) * 3,
        *(*corners, (fast, 0.0), (fast | lags, DELAY), (slow | lags, DELAY)),
        *((dict(zip(known.names, one, strict=True)), DELAY) for one in drawn),
    ]


def _flaws(flown: Sequence[FlownLeg], which: int | None = None) -> dict[Axis, str]:
    """Return what the axes of a vehicle, or of all without the firmware's gains, do that they must not do, in words."""
    flaws: dict[Axis, str] = {}
    for leg in flown:
        members = [n for n in range(leg.errors.shape[2]) if n != 1] if which is None else [which]
        errors, demands = (part[-REST:, : len(ROWS), members] for part in (leg.errors, leg.demands))
        changes = np.abs(np.diff(demands, axis=0)).sum(axis=0).max(axis=1) * RATE / REST
        sizes = np.sqrt((errors**2).mean(axis=0)).max(axis=1)
        swings = np.ptp(errors, axis=0).max(axis=1) * (which is not None)
        for axis, change, size, most, swing, far in zip(ROWS, changes, sizes, _UNSTABLE, swings, _SWING, strict=True):
            if not change <= _CHATTER:
                flaws[axis] = (
                    f"{axis.name} chatters (its demand changes by {change:.1f} in a second, at most {_CHATTER:g})"
                )
            elif not size <= (inf if leg.leg.axis is SURGE else most):  # the load may push it aside
                flaws[axis] = f"{axis.name} is not stable"
            elif swing > far:
                flaws[axis] = f"{axis.name} oscillates"
    return flaws


def figures(vehicle: Vehicle, legs: Sequence[FlownLeg]) -> Iterator[tuple[Axis, str, str, Array]]:
    """Yield for each leg and axis what it is, its unit, and FIGURES of the vehicles (4 x vehicles).

    The overshoot is the largest error beyond the target; ahead, the largest error. The vehicle is settled when it stays
    within 5 cm or 2 deg, s. The error at rest is that of the last 2 s, RMS. The changes of the commands in a second, 1
    being the full command, are the mean over the thrusters.
    """
    for flown in legs:
        leg = flown.leg
        changes = np.abs(np.diff(flown.fractions, axis=0)).mean(axis=1).sum(axis=0) / leg.seconds
        for axis, (words, row, scale, unit, within) in SHOWN.items():
            if not vehicle.layout.has(axis) or leg.axis not in (axis, SURGE) or leg == BEFORE or not leg.size:
                continue
            ahead = leg.axis is SURGE
            found = step_figures(flown.errors[:, row], 0.0 if ahead else leg.size, 1.0 / RATE, within)
            title = f"{leg.size:.0%} ahead: {words}" if ahead else f"{words} {scale * leg.size:+.0f} {unit}"
            settled = np.full_like(found.settled, nan) if ahead else found.settled
            yield axis, title, unit, np.array([scale * found.overshoot, settled, scale * found.rest, changes])


def read_gains(path: Path) -> tuple[dict[str, float], str]:
    """Return the gains in a file of parameters by their names before 4.7, and the vehicle that the file names, if any.

    The lines have a name and a value, or what QGroundControl writes. Other parameters are left out. Raises FileError.
    """
    gains, owner = {}, ""
    for number, line in enumerate(read_text(path, most=int(_LARGEST)).splitlines(), 1):
        if line.startswith(HEAD):
            owner = line.removeprefix(HEAD).partition(",")[0]
        words = re.split(r"[\s,]+", line.partition("#")[0].strip())
        name, value = words[2:4] if len(words) == 5 else words if len(words) == 2 else ("", "")
        if words[0] and not name:
            raise FileError(f"{path}: line {number}: must be a parameter and its value, and is {shown(line)}")
        factor = 1.0
        for old, (new, scale) in NEW_NAMES.items():
            if name.startswith(new):
                name, factor = name.replace(new, old), scale
        if name in FIRMWARE:
            try:
                gains[name] = float(value) / factor
            except ValueError:
                gains[name] = nan
            if not 0.0 <= gains[name] <= _LARGEST:
                reason = f"must be a number from 0 to {_LARGEST:g}"
                raise FileError(f"{path}: line {number}: {name} = {shown(value)}: {reason}")
    if not gains:
        raise FileError(f"{path}: has none of the gains, such as ATC_RAT_YAW_P")
    return gains, owner
