"""The gains of ArduSub for a vehicle: a rule in closed form, and a check in flight before they are written.

What the loops do depends on the acceleration per demand, k/M or k/J, on the lag T of the thrust, and on the time from
the sensors to the thrust, which is the dead time T_d and DELAY. M and J are the mass and the inertia with added mass, k
is the force or moment along the axis per demand, at 30 %. So the scale of an assumed thrust cancels.

- depth: the acceleration loop has the gain 0.8, so PSC_ACCZ_P = 0.8 M/(0.2 k), and the speed loop the bandwidth
  min(8/s, 0.88/(T + T_d)), which is PSC_VELZ_P;
- turns: the rate loop has the bandwidth k_v = min(2.8/T, 0.315/(T_d + 35 ms)), so ATC_RAT_*_P = k_v J/k, and
  ATC_ANG_*_P = k_v/2.5. Of the 35 ms, ArduSub's filters take 20.

The real ArduSub flew such gains of depth. Its gains of yaw were up to three times as large, which is calm there, and
chatters with 15 ms more delay, or with 30 % more thrust and less inertia: off the dead band, the slope of the thrust is
2 to 4 times the k of the rule. `tuned` flies such vehicles with thrusters biased to 50 %, and lowers the gains until
nothing chatters.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from math import degrees, inf, nan, radians
from pathlib import Path

import numpy as np

from rov_fmu.autopilot.ardusub import FIRMWARE, RATE, ROWS, FlownLeg, Leg, Mixer, fly
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.io.messages import FileError, InputError, listed, shown
from rov_fmu.io.reading import read_text
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

LEGS = (
    Leg(SURGE, 0.0, 3.0),
    *(Leg(HEAVE, size) for size in (0.5, -0.5, 1.5, -1.5)),
    *(Leg(YAW, radians(size)) for size in (30.0, -30.0, 90.0, -90.0)),
    Leg(SURGE, 0.5, 6.0),
)
"""The flight: a start, steps of depth and of heading, and six seconds ahead."""
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
_LOWER, _LEAST = 0.8, 0.25
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
SHOWN = {HEAVE: ("depth", 3, 100.0, "cm", 0.05), YAW: ("heading", 2, degrees(1.0), "deg", radians(2.0))}
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
    """What the reader should know: an axis that has not the gains of the rule, or gains of another vehicle."""
    legs: Sequence[FlownLeg]
    """The first vehicle has these gains, and the second one the firmware's."""


def tuned(vehicle: Vehicle, given: Path | None = None) -> Tuned:
    """Return the gains of a vehicle after a flight, also of vehicles with other lags and thrusts, and of draws.

    - `given`: a file of parameters, whose gains are flown in place of the rule's.

        tuned(load_vehicle(find_vehicle("bluerov2"))).gains["ATC_RAT_YAW_P"]

    Raises InputError if ArduSub has no frame for the thrusters, or if no axis has gains of its own; FileError about
    given gains, also if they chatter or are not stable; and BuildError without an engine.
    """
    mixer, axes = Mixer(vehicle), [axis for axis in ROWS if vehicle.layout.has(axis)]
    usual, owner = read_gains(given) if given else (FIRMWARE, "")
    whose = f"has the gains of {owner}; " if owner not in ("", vehicle.identifier) else ""
    notes = [f"{given}: {whose}the vehicle is {vehicle.identifier}"] if whose else []
    notes += [vehicle.caution] if vehicle.caution else []
    why = dict.fromkeys(axes, "as given") if given else {axis: _refusal(vehicle, mixer, axis) for axis in axes}
    shares = dict.fromkeys(axes, 1.0)
    push = mixer.push(vehicle, HEAVE, 0.5) if HEAVE in axes else 0.0
    legs = [leg for leg in LEGS if leg.axis in (SURGE, *axes)]

    def flight(others: Sequence[tuple[Mapping[str, float], float]], gains: Mapping[str, float]) -> list[FlownLeg]:
        """Fly vehicles with delays. The second one has the firmware's gains; those after it are loaded."""
        flying = {name: np.where(np.arange(len(others)) == 1, FIRMWARE[name], value) for name, value in gains.items()}
        loads = np.where(np.arange(len(others)) < 2, 0.0, push)
        return [*fly(vehicle, flying, legs, [one for one, _ in others], loads, [delay for _, delay in others])]

    def gains_along(axis: Axis) -> dict[str, tuple[float, str]]:
        if given:
            return {name: (usual.get(name, FIRMWARE[name]), "as given") for name in FIRMWARE if ROWS[axis] in name}
        return {} if why[axis] else _rule(vehicle, mixer, axis, shares[axis])

    while True:
        gains = {name: gain for axis in axes for name, gain in gains_along(axis).items()}
        if not gains:
            reasons = listed(f"{axis.name}: {words}" for axis, words in why.items())
            raise InputError(f"{vehicle.identifier}: there are no gains to load: {reasons}")
        flown = flight(_variations(vehicle), {name: value for name, (value, _) in gains.items()})
        flaws = {axis: words for axis, words in _flaws(flown).items() if given or not why.get(axis, "no axis")}
        if given and flaws:
            raise FileError(f"{given}: {whose}on {vehicle.identifier} {listed(flaws.values())}")
        if not flaws:
            break
        for axis, words in flaws.items():
            shares[axis] *= _LOWER
            if shares[axis] < _LEAST:
                why[axis] = f"with {_LEAST:.0%} of the rule's gains, {words}"
    if not given:
        notes += [f"{axis.name}: left out, so that it keeps its gains: {words}" for axis, words in why.items() if words]
    notes += [
        f"{axis.name}: the gains are {share:.0%} of the rule's, so that nothing chatters and all is stable"
        for axis, share in shares.items()
        if share < 1.0 and not why[axis]
    ]
    notes += [f"the firmware's gains are not recommended: {words}" for words in _flaws(flown, 1).values()]
    notes += [*_losses(vehicle, flown)]
    if not given:
        held, own = {a for a in axes if not why[a]}, {name: value for name, (value, _) in gains.items()}
        bearing = flight([*(({}, DELAY),) * 2, *(({}, delay) for delay in _DELAYS)], own)
        borne = [*takewhile(lambda n: held.isdisjoint(_flaws(bearing, n)), range(2, 2 + len(_DELAYS)))]
        most = 1e3 * ([DELAY, *_DELAYS][len(borne)])
        notes.append(f"the gains bear {most:.0f} ms from the sensors to the thrust; {1e3 * DELAY:.0f} ms are assumed")
    return Tuned(vehicle, mixer.frame, gains, notes, [leg.of_first(2) for leg in flown])


def _losses(vehicle: Vehicle, flown: Sequence[FlownLeg]) -> Iterator[str]:
    """Yield where the gains settle later than the firmware's, by 0.2 s at least."""
    for title, _, (_, (new, old), *_) in figures(vehicle, flown):
        if new > old + 0.2:
            words = "do not settle" if new == inf else f"settle after {new:.2g} s"
            yield f"{title}: these gains {words}, and the firmware's after {old:.2g} s"


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


def _rule(vehicle: Vehicle, mixer: Mixer, axis: Axis, share: float) -> dict[str, tuple[float, str]]:
    """Return the gains of an axis with their reasons: a share of those of the rule."""
    inertia, k = vehicle.effective_inertia(axis), _strength(vehicle, mixer, axis)
    curves = {vehicle.layout.curve_of[thruster.name] for thruster in vehicle.layout.thrusters_along(axis)}
    lag = max(vehicle[curve.coefficient("T")] for curve in curves)
    lowered = f"; {share:.0%} of it, so that it does not chatter" if share < 1.0 else ""
    dead = vehicle.coefficients.get("T_d", 0.0)
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
    speed = share * min(2.8 / lag, 0.315 / (dead + 0.02 + DELAY))
    p = speed * inertia / k
    rule = f"k_v = min(2.8/T, 0.315/(T_d + 35 ms)){behind}"
    reason = f"k_v J/k, J = {inertia:.3g} kg.m2, k = {k:.3g} N.m, {rule}{lowered}"
    return {
        f"ATC_RAT_{ROWS[axis]}_P": (p, reason),
        f"ATC_RAT_{ROWS[axis]}_I": (
            0.5 * p,
            "0.5/s of P, against steady moments and the dead band",
        ),
        f"ATC_RAT_{ROWS[axis]}_D": (0.5 * lag * p, "0.5 T of P, against the lag"),
        f"ATC_ANG_{ROWS[axis]}_P": (speed / 2.5, "k_v/2.5"),
    }


def _variations(vehicle: Vehicle) -> list[tuple[dict[str, float], float]]:
    """Return the coefficients of the vehicles that fly, where they are not those of the file, each with its delay (s).

    Three are as in the file. Then come all corners of 30 % more or less thrust and inertia with 20 ms, the fastest of
    them without delay, and two with more lag: by 30 %, or the far end of its interval. Others are drawn.
    """
    known, layout = vehicle.uncertainty, vehicle.layout
    lags = {curve.coefficient("T"): 1.3 * vehicle[curve.coefficient("T")] for curve in layout.curves if curve.has_lag}
    ends = dict(zip(known.names, known.at(np.full(len(known.names), _FAR)).tolist(), strict=True))
    lags = {name: max(lag, ends.get(name, lag)) for name, lag in lags.items()}

    def corner(thrust: float, inertia: float) -> dict[str, float]:
        by = (("alpha", thrust), ("beta", 1.0 / inertia))
        return {
            name: factor * vehicle[name]
            for a in layout.bare_axes
            for key, factor in by
            for name in [a.coefficient(key)]
        }

    fast, slow = corner(1.3, 0.7), corner(0.7, 1.3)
    corners = [(corner(thrust, inertia), 0.02) for thrust in (1.3, 0.7) for inertia in (0.7, 1.3)]
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


def figures(vehicle: Vehicle, legs: Sequence[FlownLeg]) -> Iterator[tuple[str, str, Array]]:
    """Yield for each leg what it is, its unit, and FIGURES with these gains and with the firmware's (4 x 2).

    The overshoot is the largest error beyond the target; ahead, the largest error. The vehicle is settled when it stays
    within 5 cm or 2 deg, s. The error at rest is that of the last 2 s, RMS. The changes of the commands in a second, 1
    being the full command, are the mean over the thrusters.
    """
    for flown in legs[1:]:
        leg = flown.leg
        changes = np.abs(np.diff(flown.fractions[..., :2], axis=0)).mean(axis=1).sum(axis=0) / leg.seconds
        for axis, (words, row, scale, unit, within) in SHOWN.items():
            if not vehicle.layout.has(axis) or leg.axis not in (axis, SURGE):
                continue
            errors = flown.errors[:, row, :2]
            settled = (RATE * leg.seconds - (np.abs(errors[::-1]) > within).argmax(axis=0)) / RATE
            settled[np.abs(errors[-1]) > within] = inf
            over, title = (errors * np.sign(leg.size)).max(axis=0).clip(0.0), f"{words} {scale * leg.size:+.0f} {unit}"
            if leg.axis is SURGE:
                settled, over, title = np.full(2, nan), np.abs(errors).max(axis=0), f"{leg.size:.0%} ahead: {words}"
            rest = np.sqrt((errors[-REST:] ** 2).mean(axis=0))
            yield title, unit, np.array([scale * over, settled, scale * rest, changes])


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
