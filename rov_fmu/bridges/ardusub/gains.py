"""The gains of ArduSub for a vehicle: a rule in closed form, and a check in flight before they are written.

What the loops do depends on the acceleration per demand, k/M or k/J, and on the lag T of the thrust. M and J are the
mass and the inertia with added mass, k is the force or moment along the axis per demand, at 30 %. So the scale of an
assumed thrust cancels. The real ArduSub flew these gains of depth and yaw on three vehicles:

- depth: the acceleration loop has the gain 0.8, so PSC_ACCZ_P = 0.8 M/(0.2 k);
- turns: the rate loop has the bandwidth k_v = min(2.8/T, 25/s), so ATC_RAT_*_P = k_v J/k, and ATC_ANG_*_P = k_v/5. The
  lag limits the bandwidth, and where it is short, the filters of ArduSub do.

Off the dead band, the slope of the thrust is 2 to 4 times the k of the rule, so steps alone do not show whether the
loops chatter. `tuned` flies with thrusters biased to 50 %, and lowers the gains until nothing chatters.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan, radians
from pathlib import Path

import numpy as np

from rov_fmu.bridges.ardusub.law import FIRMWARE, RATE, ROWS, Flown, Leg, Mixer, fly
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.io.messages import FileError, listed, shown
from rov_fmu.io.reading import read_text
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
_CHATTER = 1.0
"""A demand that changes by more than this in a second at rest chatters. The gains that were flown have at most 0.1, and
those of another vehicle 8, as in the flight of the real ArduSub."""
_LOWER, _LEAST = 0.8, 0.25
"""By what gains are lowered at a time, and the least share of the rule's."""
_DRAWS = 8
_LARGEST = 1e6
"""The largest gain, and the largest number of bytes, that are read from a file."""


@dataclass(frozen=True, eq=False)
class Tuned:
    """The gains of a vehicle, and their flight beside that of the firmware's."""

    vehicle: Vehicle
    frame: str
    gains: Mapping[str, tuple[float, str]]
    """The values and their reasons, by the names before ArduSub 4.7."""
    notes: Sequence[str]
    """What the reader should know: an axis that has not the gains of the rule, or gains of another vehicle."""
    legs: Sequence[Flown]
    """The first vehicle has these gains, and the second one the firmware's."""


def tuned(vehicle: Vehicle, given: Path | None = None) -> Tuned:
    """Return the gains of a vehicle after a flight, also of vehicles with other lags and thrusts, and of draws.

    - `given`: a file of parameters, whose gains are flown in place of the rule's.

        tuned(load_vehicle(find_vehicle("bluerov2"))).gains["ATC_RAT_YAW_P"]

    Raises InputError if ArduSub has no frame for the thrusters, FileError about given gains, also if they chatter or
    are not stable, and BuildError without an engine.
    """
    mixer, axes = Mixer(vehicle), [axis for axis in ROWS if vehicle.layout.has(axis)]
    usual, owner = read_gains(given) if given else (FIRMWARE, "")
    whose = f"has the gains of {owner}; " if owner not in ("", vehicle.identifier) else ""
    notes = [f"{given}: {whose}the vehicle is {vehicle.identifier}"] if whose else []
    why = dict.fromkeys(axes, "as given") if given else {axis: _refusal(vehicle, mixer, axis) for axis in axes}
    shares = dict.fromkeys(axes, 1.0)
    others = _variations(vehicle)
    is_usual = np.arange(len(others)) == 1
    loads = np.where(np.arange(len(others)) < 2, 0.0, mixer.push(vehicle, HEAVE, 0.5) if HEAVE in axes else 0.0)

    def gains_along(axis: Axis) -> dict[str, tuple[float, str]]:
        if not why[axis]:
            return _rule(vehicle, mixer, axis, shares[axis])
        return {name: (usual.get(name, FIRMWARE[name]), why[axis]) for name in FIRMWARE if ROWS[axis] in name}

    while True:
        gains = {name: gain for axis in axes for name, gain in gains_along(axis).items()}
        flying = {name: np.where(is_usual, FIRMWARE[name], value) for name, (value, _) in gains.items()}
        flown = [*fly(vehicle, flying, [leg for leg in LEGS if leg.axis in (SURGE, *axes)], others, loads)]
        flaws = {axis: words for axis, words in _flaws(flown).items() if given or not why.get(axis, "no axis")}
        if given and flaws:
            raise FileError(f"{given}: {whose}on {vehicle.identifier} {listed(flaws.values())}")
        if not flaws:
            break
        for axis, words in flaws.items():
            shares[axis] *= _LOWER
            if shares[axis] < _LEAST:
                why[axis] = f"the firmware's, because with {_LEAST:.0%} of the rule's, {words}"
    notes += [f"{axis.name}: the gains are {words}" for axis, words in why.items() if words and not given]
    notes += [
        f"{axis.name}: the gains are {share:.0%} of the rule's, so that nothing chatters and all is stable"
        for axis, share in shares.items()
        if share < 1.0 and not why[axis]
    ]
    return Tuned(vehicle, mixer.frame, gains, notes, flown)


def _refusal(vehicle: Vehicle, mixer: Mixer, axis: Axis) -> str:
    """Return why an axis has the firmware's gains, or an empty text."""
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
    return f"the firmware's, because {reason}"


def _strength(vehicle: Vehicle, mixer: Mixer, axis: Axis) -> float:
    """Return k, N or N.m per demand: the larger one of both directions."""
    return max(abs(mixer.push(vehicle, axis, demand)) for demand in (0.3, -0.3)) / 0.3


def _rule(vehicle: Vehicle, mixer: Mixer, axis: Axis, share: float) -> dict[str, tuple[float, str]]:
    """Return the gains of an axis with their reasons: a share of those of the rule."""
    inertia, k = vehicle.effective_inertia(vehicle.layout.by_name[axis.name]), _strength(vehicle, mixer, axis)
    curves = {vehicle.layout.curve_of[thruster.name] for thruster in vehicle.layout.thrusters_along(axis)}
    lag = max(vehicle[curve.coefficient("T")] for curve in curves)
    lowered = f"; {share:.0%} of it, so that it does not chatter" if share < 1.0 else ""
    if axis is HEAVE:
        p = share * 0.8 * inertia / (0.2 * k)
        return {
            "PSC_ACCZ_P": (p, f"0.8 M/(0.2 k), M = {inertia:.3g} kg, k = {k:.3g} N{lowered}"),
            "PSC_ACCZ_I": (1.3 * p, "1.3/s of P, which carries the weight and crosses the dead band"),
            "PSC_ACCZ_D": (0.0, "as the firmware's"),
            "PSC_ACCZ_FF": (0.25 * p, "a quarter of P, which acts before there is an error"),
            "PSC_POSZ_P": (2.0, "below the firmware's, for less overshoot"),
            "PSC_VELZ_P": (FIRMWARE["PSC_VELZ_P"], "as the firmware's"),
        }
    speed = share * min(2.8 / lag, 25.0)
    p = speed * inertia / k
    reason = f"k_v J/k, J = {inertia:.3g} kg.m2, k = {k:.3g} N.m, k_v = min(2.8/T, 25/s), T = {lag:.3g} s{lowered}"
    return {
        f"ATC_RAT_{ROWS[axis]}_P": (p, reason),
        f"ATC_RAT_{ROWS[axis]}_I": (0.15 * p, "0.15/s of P, which turns against steady moments"),
        f"ATC_RAT_{ROWS[axis]}_D": (0.15 * lag * p, "0.15 T of P, against the lag"),
        f"ATC_ANG_{ROWS[axis]}_P": (speed / 5.0, "k_v/5"),
    }


def _variations(vehicle: Vehicle) -> list[dict[str, float]]:
    """Return the coefficients of the vehicles that fly, where they are not those of the file.

    Three are as in the file, two have 30 % more lag with 30 % more or less thrust, and others are drawn.
    """
    known, layout = vehicle.uncertainty, vehicle.layout
    lags = {curve.coefficient("T"): 1.3 for curve in layout.curves if curve.has_lag}
    thrusts = [axis.coefficient("alpha") for axis in layout.bare_axes]
    factors = [lags | dict.fromkeys(thrusts, factor) for factor in (1.3, 0.7)]
    drawn = known.drawn(np.random.default_rng(0).random((_DRAWS * bool(known.names), len(known.names)))).tolist()
    return [
        *({}, {}, {}),
        *({name: factor * vehicle[name] for name, factor in one.items()} for one in factors),
        *(dict(zip(known.names, one, strict=True)) for one in drawn),
    ]


def _flaws(flown: Sequence[Flown]) -> dict[Axis, str]:
    """Return what the axes do that they must not do, with gains that are not the firmware's, in words."""
    flaws: dict[Axis, str] = {}
    for leg in flown:
        errors, demands = (np.delete(part[-REST:, : len(ROWS)], 1, axis=2) for part in (leg.errors, leg.demands))
        changes = np.abs(np.diff(demands, axis=0)).sum(axis=0).max(axis=1) * RATE / REST
        sizes = np.sqrt((errors**2).mean(axis=0)).max(axis=1)
        for axis, change, size, most in zip(ROWS, changes, sizes, _UNSTABLE, strict=True):
            if not change <= _CHATTER:
                flaws[axis] = (
                    f"{axis.name} chatters (its demand changes by {change:.1f} in a second, at most {_CHATTER:g})"
                )
            elif not size <= (inf if leg.leg.axis is SURGE else most):  # the load may push it aside
                flaws[axis] = f"{axis.name} is not stable"
    return flaws


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
