"""The kinds of the parameters of the likelihood: one table with what each is, its prior, and what is told of it.

Every parameter has a coordinate z with a normal prior, z ~ N(mean, deviation). A positive number enters as exp(z). The
deviations are those that an engineer would accept, with their reasons; [priors] of rov.toml may change them. No
deviation is estimated from one effect.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf, log, pi
from typing import Any, Literal

import numpy as np

from rov_fmu.equation.catalogue import CURVE, REVERSE
from rov_fmu.equation.parts import VehicleAxis
from rov_fmu.identify.likelihood.prior import Prior

LEAST_LAG = 0.02
"""The least time constant of a lag, s. A shorter one cannot be told from the time of the commands."""
SHORTEST_LAG = 1.0 / (2.0 * pi)
"""The shortest lag that samples show, relative to the time between two of them: its corner frequency is theirs."""
USUAL_EXPONENT = 1.5
"""The usual exponent of thrust over voltage, of thrusters whose speed nothing regulates."""
PLACED = {True: "velocity sensor", False: "position sensor"}
"""The sensors that may be beside the origin: those of velocities, and those of positions."""
INERTIA, LAG, OFFSET, WIDTH, WHITE = "inertia", "lag", "logging offset", "logging width", "white noise"
QUADRATIC, LINEAR, WANDER = "quadratic drag", "linear drag", "wander"
POWER, POWER_ASTERN = "power of drag", "power of drag astern"
TURN = "turned velocity sensor"
DIRECTION, ARMS, SHIFT = "angle of the thrusters", "arms of the thrusters", "shift of the thrusters"
STRENGTH, OWN_CURVE, NEUTRAL = "health", "curve of its own", "neutral"
SENSOR_SCALE, SENSOR_OFFSET = "sensor scale", "sensor offset"
"""Kinds whose parameters are looked up by their name."""
OWN_KEYS = ("a_t", "b_t", "c_0")
"""What a thruster with a curve of its own has, ahead and astern, beside what it shares."""
EXACT_BAND = 0.01
"""A dead band is never claimed to better than this command: thrust begins gradually."""


@dataclass(frozen=True)
class Deviation:
    """A deviation that priors use, with its reason."""

    key: str
    """Its key in [priors] of rov.toml."""
    deviation: float
    words: str
    """What deviates."""
    reason: str


Action = Literal["force", "gain", "velocity"]
"""A force along an axis, told relative to the thrust along it; a gain of all thrust; or a velocity over ground, told
relative to that of the vehicle."""


@dataclass(frozen=True)
class Process:
    """A slow process."""

    time_constant: float
    """s, fixed."""
    title: str
    """Its name in a table."""
    acts_as: Action
    sentence: str
    """What it does, with `push` (`force` or `torque`), its `size`, and
    the `share` of the `thrust` (or `torque`) that this is."""
    finding: str
    """The kind of the finding about one."""


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """The coordinate z of a parameter, with its prior and its bounds, and the number that it stands for."""

    mean: float = 0.0
    deviation: float = 1.0
    """The prior of z."""
    is_log: bool = False
    """True if the number is exp(z)."""
    factor: float = 1.0
    offset: float = 0.0
    """The number is z times the factor plus the offset, if it is not exp(z)."""
    low: float = -inf
    high: float = inf
    """The bounds of z."""
    null: float | None = None
    """The z at which an effect is absent."""
    of_motion: bool = True
    """False for noise and slow processes, which change the covariance of the filter and not its mean."""
    unit: str = "1"

    def number(self, z: Any) -> Any:
        """Return the number that a coordinate stands for."""
        return np.exp(z) if self.is_log else self.offset + self.factor * z


@dataclass(frozen=True)
class Kind(Coordinate):
    """What the parameters of a kind are, if nothing else is known of them."""

    prior: Deviation | None = None
    """None where `deviation` is always the same, or follows from the log."""
    words: str = ""
    """What an effect is; empty for one that is told only relative to others of its kind."""
    why_not: str = ""
    """Why the vehicle file does not have the effect, after a full stop."""
    is_ratio: bool = False
    """True if the coordinate of the effect is the logarithm of a ratio."""
    keys: tuple[str, ...] = ()
    """The keys of the coefficients that only a vehicle with the effect has."""
    is_coefficient: bool = False
    """True if its number is the coefficient with the first of these keys."""
    of_axis: tuple[str, ...] = ()
    """The keys of the coefficients that the fit may change of each axis that has such a parameter; empty if none has.
    """
    is_of_fitted: bool = False
    """True if only the axes have one whose motion is tested."""
    own: Callable[[Prior, VehicleAxis], Mapping[str, Any]] = lambda *_: {}
    """What the parameter of an axis has in place of the fields above."""
    told_by: tuple[str, ...] = ()
    """The tests of an axis that tell it, which replace a coefficient of the base: `log`, `steady`, `astern` (steady
    velocities of negative commands) and `time_constant`."""
    needs_evidence: bool = False
    """True if the file has it only with positive evidence: the FMU would have one more input for it, or the file can
    only approximate it."""
    is_in_all: bool = False
    """True if every vehicle has it: the file has it unless the data tell that it is smaller than usual."""
    time: str = ""
    """What it is among the times from a command to what a sensor shows of it, which a log may not tell apart."""
    is_lag: bool = False
    """True for a time constant, which the samples of sensors must be close enough to show."""
    unusual: float = 2.5
    """The number of deviations of its prior, from the usual size on, at which an effect is unusual."""
    is_usual_if_right: bool = False
    """True if no size is unusual where predictions over 10 s along its axis have no larger errors than the noise."""
    finest: float = 0.0
    """The half-width of the narrowest interval: what is smaller is no effect."""
    roughest: float = 0.0
    """The same relative to the coordinate."""
    force_power: float = 0.0
    """Its number is proportional to this power of the common scale of all forces, which motion does not tell."""
    speed_power: float = 0.0
    """Its number is proportional to this power of the common scale of all measured velocities and positions."""
    starts: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """How many deviations above its mean the fit begins in each of its starts."""
    adapts: bool = False
    """True if one linear step adapts it to a hypothesis about the structure, where J compares these before any fit."""
    is_size: bool = False
    """True for the size of a slow or short process."""
    slow: Process | None = None
    """The slow process whose size it is."""
    is_of_sensor: bool = False
    """True for a slow process that is an error of a sensor, and no disturbance of the motion."""
    hides_structure: bool = False
    """True if it may make up for a wrong structure. Where this is judged, it is no larger than usual."""
    least_unseen: float = 0.0
    """The least size of a process where unseen data are predicted, or the least standard deviation in an unseen log of
    what differs by log."""
    is_of_structure: bool = False
    """True for the number of a hypothesis about the structure: it is in the model because the hypothesis won."""
    of_thruster: bool = False
    """True if each thruster has one."""
    differs_by_log: bool = False
    """True if it differs from log to log, but is about as large in all of them."""

    def concerns(self, prior: Prior, form: VehicleAxis) -> bool:
        """Return True if an axis has such a parameter."""
        names, axis = {form.axis.coefficient(key) for key in self.of_axis}, form.axis
        is_free = bool(names) and names <= {*prior.layout.coefficients} - prior.exact
        return is_free and (axis in prior.fitted or not self.is_of_fitted)


_of_noise = partial(Kind, is_log=True, of_motion=False)
"""Make the kind of a size or a time of noise or of a slow process."""
_of_structure = partial(Kind, None, is_of_structure=True)
"""Make the kind of the number of a hypothesis about the structure."""


def _slow(prior: Deviation, slow: Process, usual: float, least: float, largest: float, **own: Any) -> Kind:
    """Return the kind of the size of a slow process by its usual, its least and its largest size."""
    low, high = log(least), log(largest)
    return _of_noise(
        prior,
        mean=log(usual),
        low=low,
        high=high,
        null=low,
        is_size=True,
        starts=(1.0, 1.0, 1.0),
        slow=slow,
        **own,
    )


# ---- What the parameters of an axis have -----------------------------------------------------------------------------


def _drag(key: str, deviation: Deviation, **own: Any) -> Kind:
    """Return the kind of a drag coefficient of an axis, ahead."""

    def own_mean(prior: Prior, form: VehicleAxis) -> Mapping[str, Any]:
        return {"mean": log(max(prior.coefficients[form.axis.coefficient(key)], 1e-9))}

    return Kind(
        deviation,
        keys=(key,),
        is_coefficient=True,
        told_by=("log", "steady"),
        of_axis=(key,),
        own=own_mean,
        is_log=True,
        force_power=1.0,
        adapts=True,
        **own,
    )


def _power_of_drag(prior: Deviation, end: str = "", **own: Any) -> Kind:
    """Return the kind of the power of drag ahead, or of how much larger it is astern, of an axis that is fitted."""

    note = ". The vehicle file has the linear and the quadratic drag that are nearest to it at the tested speeds"
    words = prior.words.removeprefix("the ")
    return Kind(
        prior,
        words,
        note,
        of_axis=(f"a_d{end}", f"b_d{end}"),
        is_of_fitted=True,
        low=-0.8,
        null=0.0,
        is_usual_if_right=True,
        needs_evidence=True,
        **own,
    )


def _astern(prior: Deviation, words: str, **own: Any) -> Kind:
    """Return the kind of what something is astern relative to what it is ahead, which is the same if it is absent."""
    return Kind(prior, words, is_ratio=True, null=0.0, **own)


def _load(prior: Prior, form: VehicleAxis) -> Mapping[str, Any]:
    full = prior.full[form.axis.name]
    if not full:
        return {"deviation": 0.0}  # none
    given = prior.coefficients[form.axis.coefficient("F_0")]
    return {"null": -given / full, "factor": full, "offset": given, "unit": form.axis.load}


_SHAPE = Deviation("thrust_shape", 0.10, "the shape of a curve, relative to its force", "published curves differ so")
_PLACE = Deviation(
    "sensor_place", 0.3, "the place of a sensor of velocity or position, m", "it is near the vehicle's origin"
)
_COLOURED = Deviation(
    "coloured_noise", 1.0, "ln of a sensor's coloured noise, and of its correlation time", "filters in sensors"
)
_MOST_SCALE = 0.5
"""The largest size of ln of a sensor's scale. What is beyond has another unit, such as knots or feet."""
_WITHOUT_SENSORS = ". The vehicle file does not have it, because it describes the vehicle without its sensors"
_POSITION_COUNTS = ". The fit takes the position for the right one of the two, and the vehicle file does not have it"
_WITHOUT_PLACES = ". The vehicle file does not have it, because it tells the motion of the origin"

KINDS = {
    "thrust scale": Kind(
        Deviation("thrust", 0.10, "all forces of a curve, relatively", "two thrusters of one type, or a maker's table"),
        is_log=True,
        force_power=1.0,
        adapts=True,
    ),
    "linear thrust": Kind(_SHAPE),
    "reverse thrust": _astern(
        Deviation(
            "thrust_reverse", 0.10, "thrust astern to thrust ahead, relatively", "propellers are made for one direction"
        ),
        "thrust astern relative to thrust ahead",
        keys=("a_t_reverse", "b_t_reverse", "d_reverse"),
        adapts=True,
    ),
    "dead band": Kind(
        Deviation("dead_band", 0.05, "the command at which thrust begins", "speed controllers have 2 to 8 %"),
        "dead band",
        keys=("c_0",),
        is_coefficient=True,
        finest=EXACT_BAND,
        low=0.0,
        high=0.5,
        null=0.0,
    ),
    "dead band astern": _astern(
        Deviation(
            "dead_band_astern", 0.3, "ln of the dead band astern to that ahead", "propellers are made for one direction"
        ),
        "dead band astern relative to dead band ahead",
        keys=("c_0_reverse",),
    ),
    "advance": Kind(
        Deviation("advance", 0.2, "the share of full thrust lost per m/s", "propellers give no thrust at 3 to 10 m/s"),
        "loss of thrust with the speed of advance, relative to full thrust",
        keys=("d",),
        low=0.0,
        null=0.0,
        unit="s/m",
        adapts=True,
    ),
    "advance astern": _astern(
        Deviation(
            "advance_astern", 0.3, "ln of the share lost astern to that ahead", "propellers are made for one direction"
        ),
        "loss of thrust with the speed of advance astern relative to that ahead",
        keys=("d_reverse",),
        adapts=True,
    ),
    "lag": Kind(
        Deviation("lag", 0.15, "the time constant of the thrusters, s", "small thrusters need 0.05 to 0.3 s"),
        "time constant of the thrusters",
        keys=("T",),
        is_in_all=True,
        time="lag of the thrusters",
        is_lag=True,
        mean=0.05,
        low=LEAST_LAG,
        null=LEAST_LAG,
        unit="s",
        adapts=True,
    ),
    "dead time": Kind(
        Deviation("dead_time", 0.05, "the time from a command to its effect, s", "links of one or two control periods"),
        "dead time of the commands",
        ". The vehicle file does not have it; T_d in [commands] would add it",
        time="dead time of the commands",
        low=0.0,
        null=0.0,
        unit="s",
    ),
    "inertia": Kind(
        Deviation("inertia", 0.5, "ln of the effective inertia", "added mass is 0.3 to 2 times the mass"),
        is_log=True,
        keys=("beta",),
        told_by=("log", "time_constant"),
        of_axis=("beta",),
        force_power=1.0,
        speed_power=-1.0,
        starts=(0.0, 0.0, 1.0),
        adapts=True,
    ),
    QUADRATIC: _drag(
        "a_d",
        Deviation(
            "quadratic_drag", 1.0, "ln of the quadratic drag", "a factor of 2.7 about another vehicle or the data"
        ),
        speed_power=-2.0,
        starts=(0.7, 0.0, -1.0),
    ),
    LINEAR: _drag(
        "b_d",
        Deviation(
            "linear_drag", 1.5, "ln of the linear drag", "it depends on the speed range, the hull and the tether"
        ),
        speed_power=-1.0,
        starts=(0.0, 0.0, -1.0),
    ),
    "drag astern": _astern(
        Deviation("drag_astern", 0.2, "ln of the drag astern to the drag ahead", "few hulls differ by more than 20 %"),
        "drag astern relative to drag ahead",
        keys=("a_d_reverse", "b_d_reverse"),
        told_by=("log", "astern"),
        of_axis=("a_d_reverse",),
        is_of_fitted=True,
        adapts=True,
    ),
    POWER: _power_of_drag(
        Deviation("drag_power", 0.3, "the excess of the power of drag over 2", "measured drag has 1.5 to 2.5"),
        told_by=("log", "steady"),
        high=1.5,
        unusual=5.0 / 3.0,
    ),
    POWER_ASTERN: _power_of_drag(
        Deviation(
            "drag_power_astern",
            0.2,
            "the excess of the power of drag astern over that ahead",
            "hulls are alike both ways",
        ),
        REVERSE,
        keys=("a_d_reverse", "b_d_reverse"),
        told_by=("log", "astern"),
        high=0.8,
    ),
    "centre of buoyancy": Kind(
        Deviation(
            "buoyancy", 0.005, "each coordinate of the centre of buoyancy, m", "trimmed vehicles tilt by a few degrees"
        ),
        "centre of buoyancy",
        null=0.0,
        unit="m",
    ),
    DIRECTION: Kind(
        Deviation("direction", 0.1, "the angle of the thrusters from ahead, rad", "frames differ by some degrees"),
        "angle of the thrusters from ahead",
        ". The vehicle file has their directions with it, in place of those given",
        unit="rad",
        finest=0.005,
        adapts=True,
    ),
    ARMS: Kind(
        Deviation("arms", 0.1, "the arms of the thrusters to the given ones", "places are known to some centimetres"),
        mean=1.0,
        low=0.3,
        high=3.0,
        null=1.0,
        finest=0.01,
        adapts=True,
    ),
    SHIFT: Kind(
        Deviation("shift", 0.02, "the places of all thrusters about the centre of mass, m", "batteries are moved"),
        "shift of the thrusters from their places,",
        null=0.0,
        unit="m",
        finest=0.001,
        roughest=0.15,
        adapts=True,
    ),
    "load": Kind(
        Deviation("load", 0.05, "a constant load relative to full thrust", "vehicles are trimmed to a few per cent"),
        "constant load",
        keys=("F_0",),
        is_coefficient=True,
        told_by=("log",),
        of_axis=("F_0",),
        own=_load,
        finest=0.001,
        null=0.0,
        force_power=1.0,
        adapts=True,
    ),
    "current": Kind(
        Deviation("current", 0.1, "the current, m/s", "tests are made in calm water"),
        "current",
        ". It belongs to the water, so the vehicle file does not have it",
        null=0.0,
        unit="m/s",
        differs_by_log=True,
        least_unseen=0.02,
        adapts=True,
    ),
    "sensor lag": Kind(
        Deviation("sensor_lag", 0.3, "the time constant of a sensor, s", "navigation filters smooth over 0 to 0.5 s"),
        "time constant",
        _WITHOUT_SENSORS,
        time="lag of the sensors",
        is_lag=True,
        low=0.0,
        null=0.0,
        unit="s",
    ),
    SENSOR_SCALE: Kind(
        Deviation("sensor_scale", 0.05, "ln of a velocity's scale beside a position", "sound differs by 3 % in water"),
        "scale of the measured velocity beside the position",
        _POSITION_COUNTS,
        is_ratio=True,
        finest=0.005,
        low=-_MOST_SCALE,
        high=_MOST_SCALE,
        null=0.0,
    ),
    SENSOR_OFFSET: Kind(
        Deviation("sensor_offset", 0.05, "a velocity's offset beside a position, m/s or rad/s", "zeros drift by cm/s"),
        "offset of the measured",
        _POSITION_COUNTS,
        finest=0.005,
        null=0.0,
        differs_by_log=True,
        adapts=True,
    ),
    **{kind: Kind(_PLACE, f"place of the {kind}", _WITHOUT_PLACES, null=0.0, unit="m") for kind in PLACED.values()},
    "voltage": Kind(
        Deviation("voltage", 0.75, "the exponent of thrust over voltage", "0 if regulated, else 1 to 2"),
        "exponent of thrust over voltage",
        keys=("n_V",),
        is_coefficient=True,
        needs_evidence=True,
        mean=0.75,
        low=CURVE["n_V"].minimum,
        high=CURVE["n_V"].maximum,
        null=0.0,
    ),
    "slow force": _slow(
        Deviation("slow_force", 2.5, "ln of the size of a slow force", "0.1 % of full thrust, within a factor of 12"),
        Process(
            8.0,
            "Slow force",
            "force",
            "an unknown slow {push} of {size} (RMS), {share} of the {thrust}, acts",
            "unknown force",
        ),
        0.001,
        1e-7,
        0.1,
    ),
    "short force": _of_noise(
        Deviation(
            "short_force",
            1.0,
            "ln of the force that momentary commands lack",
            "a quarter of the second differences between rows",
        ),
        is_size=True,
        hides_structure=True,
        mean=log(0.25),
        low=log(1e-3),
    ),
    "slow gain": _slow(
        Deviation(
            "slow_gain",
            0.35,
            "ln of the size of a slow change of thrust",
            "1 %, to a factor of 2, or it acts as thrust",
        ),
        Process(60.0, "Change of thrust", "gain", "the thrust changes slowly by {size} (RMS)", "change of thrust"),
        0.01,
        1e-6,
        0.2,
        least_unseen=0.03,  # batteries and water differ from day to day
    ),
    "wander": _slow(
        Deviation(
            "wander", 2.5, "ln of the size of the wander of an estimator's velocity", "1 mm/s, within a factor of 12"
        ),
        Process(8.0, "Wander of the velocity", "velocity", "", ""),
        0.001,
        1e-7,
        0.3,
        unit="m/s",
        is_of_sensor=True,
    ),
    "slow velocity": _slow(
        Deviation(
            "slow_velocity", 2.5, "ln of the size of a slow velocity over ground", "1 mm/s, within a factor of 12"
        ),
        Process(
            8.0,
            "Velocity over ground",
            "velocity",
            "an unknown slow velocity over ground of {size} (RMS) acts",
            "velocity over ground",
        ),
        0.001,
        1e-7,
        0.3,
        unit="m/s",
    ),
    STRENGTH: Kind(
        Deviation(
            "strength", 0.1, "the force of a thruster relative to its curve", "two thrusters of one type differ so"
        ),
        keys=("health",),
        is_coefficient=True,
        is_of_structure=True,
        of_thruster=True,
        mean=1.0,
        low=0.0,
        high=2.0,
        null=1.0,
        finest=0.005,
    ),
    OWN_CURVE: _of_structure(
        "thrust of the thruster astern relative to ahead, as a multiple of that of the others",
        is_ratio=True,
        deviation=0.5,
        null=0.0,
        of_thruster=True,
    ),
    NEUTRAL: _of_structure(
        "command by which the neutral is off: the dead band is so much narrower ahead, and wider astern",
        deviation=0.05,
        low=-0.2,
        high=0.2,
        null=0.0,
        of_thruster=True,
    ),
    "command limit": _of_structure(
        "command beyond which the thrusters push no more",
        ". The vehicle file does not have it",
        mean=0.8,
        deviation=0.3,
        low=0.1,
        high=1.0,
        null=1.0,
    ),
    "slew limit": _of_structure(
        "time that commands take from rest to full command",
        ". The vehicle file does not have it",
        mean=0.5,
        deviation=0.5,
        low=0.0,
        high=20.0,
        null=0.0,
        unit="s",
    ),
    "voltage drop": _of_structure(
        "share of the thrust that is lost while all thrusters have full command",
        ". The vehicle file does not have it",
        mean=0.15,
        deviation=0.15,
        low=0.0,
        high=0.5,  # with half of the thrust, the voltage has fallen by a third, and speed controllers switch off
        null=0.0,
    ),
    TURN: _of_structure(
        "angle of the velocity sensor about the vertical axis",
        _WITHOUT_SENSORS,
        deviation=1.5,
        low=-pi,
        high=pi,
        null=0.0,
        unit="rad",
    ),
    "white noise": _of_noise(
        Deviation("white_noise", 0.7, "ln of a sensor's white noise", "seen in the differences of its samples"),
        starts=(4.0, 2.0, 4.0),
    ),
    "coloured noise": _of_noise(_COLOURED, mean=log(0.3), hides_structure=True),
    "correlation time": _of_noise(_COLOURED, mean=log(2.0), unit="s"),
    "row noise": _of_noise(mean=log(0.03), low=log(1e-3)),
    "logging offset": Kind(unit="s", time="time of the rows", adapts=True),
    "logging width": Kind(of_motion=False, mean=0.5, deviation=0.5, low=0.0, high=1.0),
}
"""All kinds. The sizes of slow processes are relative to full thrust, fractions, and in m/s. Coloured noise is relative
to white noise."""
SLOW = {name: kind.slow for name, kind in KINDS.items() if kind.slow and not kind.is_of_sensor}
"""The slow processes that disturb the motion, by the kinds of their sizes."""
EFFECTS = {name: kind for name, kind in KINDS.items() if kind.words}
PRIORS = {kind.prior.key: kind.prior for kind in KINDS.values() if kind.prior}
"""All deviations by their keys in [priors] of rov.toml. 0 means that the number is exact, or that a slow process is
absent. The noise of a sensor is never exact."""
ABSENT = {
    key: kind.null
    for kind in EFFECTS.values()
    for key in kind.keys
    if kind.null is not None and not key.endswith(REVERSE)
}
"""The values of coefficients that a vehicle file may lack. Those astern are then equal to those ahead."""
