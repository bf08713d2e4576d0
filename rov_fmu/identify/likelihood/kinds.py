"""The kinds of the parameters of the likelihood: one table with what each is, its prior, and what is told of it.

Every parameter has a coordinate z with a normal prior, z ~ N(mean, deviation). A positive number enters as exp(z). The
deviations are those that an engineer would accept, with their reasons; [priors] of rov.toml may change them. No
deviation is estimated from one effect.
"""

from dataclasses import dataclass
from math import inf, log

from rov_fmu.equation.catalogue import CURVE

LEAST_LAG = 0.02
"""The least time constant of a lag, s. A shorter one cannot be told from the time of the commands."""
USUAL_EXPONENT = 1.5
"""The usual exponent of thrust over voltage, of thrusters whose speed nothing regulates."""
PLACED = {True: "velocity sensor", False: "position sensor"}
"""The sensors that may be beside the origin: those of velocities, and those of positions."""
SLOW = {"slow force": 8.0, "slow gain": 60.0, "slow velocity": 8.0}
"""The time constants of the slow processes, s."""
SIZES = (*SLOW, "short force")
"""The kinds of the sizes of all processes."""


@dataclass(frozen=True)
class Prior:
    """A deviation that priors use, with its reason."""

    key: str
    """Its key in [priors] of rov.toml."""
    deviation: float
    words: str
    """What deviates."""
    reason: str


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """The coordinate z of a parameter, with its prior and its bounds."""

    mean: float = 0.0
    deviation: float = 1.0
    """The prior of z."""
    is_log: bool = False
    """True if the number is exp(z)."""
    low: float = -inf
    high: float = inf
    """The bounds of z."""
    null: float | None = None
    """The z at which an effect is absent."""
    of_motion: bool = True
    """False for noise and slow processes, which change the covariance of the filter and not its mean."""
    unit: str = "1"


@dataclass(frozen=True)
class Kind(Coordinate):
    """What the parameters of a kind are, if nothing else is known of them."""

    prior: Prior | None = None
    """None where `deviation` is always the same, or follows from the log."""
    words: str = ""
    """What an effect is."""
    why_not: str = ""
    """Why the vehicle file does not have the effect, after a full stop."""
    is_ratio: bool = False
    """True if the coordinate of the effect is the logarithm of a ratio."""
    keys: tuple[str, ...] = ()
    """The keys of the coefficients that only a vehicle with the effect has."""
    adds_input: bool = False
    """True if a vehicle with the effect has an input more."""


def _slow(prior: Prior, usual: float, least: float, largest: float) -> Kind:
    """Return the kind of the size of a slow process by its usual, its least and its largest size."""
    low = log(least)
    return Kind(prior, is_log=True, of_motion=False, mean=log(usual), low=low, high=log(largest), null=low)


_SHAPE = Prior("thrust_shape", 0.10, "the shape of a curve, relative to its force", "published curves differ so")
_PLACE = Prior(
    "sensor_place", 0.3, "the place of a sensor of velocity or position, m", "it is near the vehicle's origin"
)
_COLOURED = Prior(
    "coloured_noise", 1.0, "ln of a sensor's coloured noise, and of its correlation time", "filters in sensors"
)
_WITHOUT_PLACES = ". The vehicle file does not have it, because it tells the motion of the origin"

KINDS = {
    "thrust scale": Kind(
        Prior("thrust", 0.10, "all forces of a curve, relatively", "two thrusters of one type, or a maker's table"),
        is_log=True,
    ),
    "thrust shape": Kind(_SHAPE),
    "linear thrust": Kind(_SHAPE),
    "reverse thrust": Kind(
        Prior(
            "thrust_reverse", 0.10, "thrust astern to thrust ahead, relatively", "propellers are made for one direction"
        ),
        "thrust astern relative to thrust ahead",
        keys=("a_t_reverse", "b_t_reverse"),
        is_ratio=True,
        null=0.0,
    ),
    "dead band": Kind(
        Prior("dead_band", 0.05, "the command at which thrust begins", "speed controllers have 2 to 8 %"),
        "dead band",
        keys=("c_0",),
        low=0.0,
        high=0.5,
        null=0.0,
    ),
    "dead band astern": Kind(
        Prior(
            "dead_band_astern", 0.3, "ln of the dead band astern to that ahead", "propellers are made for one direction"
        ),
        "dead band astern relative to dead band ahead",
        keys=("c_0_reverse",),
        is_ratio=True,
        null=0.0,
    ),
    "advance": Kind(
        Prior(
            "advance", 0.2, "the share of full thrust lost per m/s ahead", "propellers give no thrust at 3 to 10 m/s"
        ),
        "loss of thrust with the speed of advance, relative to full thrust",
        keys=("d",),
        low=0.0,
        null=0.0,
        unit="s/m",
    ),
    "lag": Kind(
        Prior("lag", 0.15, "the time constant of the thrusters, s", "small thrusters need 0.05 to 0.3 s"),
        "time constant of the thrusters",
        keys=("T",),
        mean=0.05,
        low=LEAST_LAG,
        null=LEAST_LAG,
        unit="s",
    ),
    "dead time": Kind(
        Prior("dead_time", 0.05, "the time from a command to its effect, s", "links of one or two control periods"),
        "dead time of the commands",
        ". The vehicle file does not have it; T_d in [commands] would add it",
        low=0.0,
        null=0.0,
        unit="s",
    ),
    "inertia": Kind(
        Prior("inertia", 0.5, "ln of the effective inertia", "added mass is 0.3 to 2 times the mass"), is_log=True
    ),
    "quadratic drag": Kind(
        Prior("quadratic_drag", 1.0, "ln of the quadratic drag", "a factor of 2.7 about another vehicle or the data"),
        is_log=True,
    ),
    "linear drag": Kind(
        Prior("linear_drag", 1.5, "ln of the linear drag", "it depends on the speed range, the hull and the tether"),
        is_log=True,
    ),
    "drag astern": Kind(
        Prior("drag_astern", 0.2, "ln of the drag astern to the drag ahead", "few hulls differ by more than 20 %"),
        "drag astern relative to drag ahead",
        keys=("a_d_reverse", "b_d_reverse"),
        is_ratio=True,
        null=0.0,
    ),
    "centre of buoyancy": Kind(
        Prior(
            "buoyancy", 0.005, "each coordinate of the centre of buoyancy, m", "trimmed vehicles tilt by a few degrees"
        ),
        "centre of buoyancy",
        null=0.0,
        unit="m",
    ),
    "load": Kind(
        Prior("load", 0.05, "a constant load relative to full thrust", "vehicles are trimmed to a few per cent"),
        "constant load",
        keys=("F_0",),
        null=0.0,
    ),
    "current": Kind(
        Prior("current", 0.1, "the current, m/s", "tests are made in calm water"),
        "current",
        ". It belongs to the water, so the vehicle file does not have it",
        null=0.0,
        unit="m/s",
    ),
    "sensor lag": Kind(
        Prior("sensor_lag", 0.3, "the time constant of a sensor, s", "navigation filters smooth over 0 to 0.5 s"),
        "time constant",
        ". The vehicle file does not have it, because it describes the vehicle without its sensors",
        low=0.0,
        null=0.0,
        unit="s",
    ),
    **{kind: Kind(_PLACE, f"place of the {kind}", _WITHOUT_PLACES, null=0.0, unit="m") for kind in PLACED.values()},
    "voltage": Kind(
        Prior("voltage", 0.75, "the exponent of thrust over voltage", "0 if regulated, else 1 to 2"),
        "exponent of thrust over voltage",
        keys=("n_V",),
        adds_input=True,
        mean=0.75,
        low=CURVE["n_V"].minimum,
        high=CURVE["n_V"].maximum,
        null=0.0,
    ),
    "slow force": _slow(
        Prior("slow_force", 2.5, "ln of the size of a slow force", "0.1 % of full thrust, within a factor of 12"),
        0.001,
        1e-7,
        0.1,
    ),
    "short force": Kind(
        Prior(
            "short_force",
            1.0,
            "ln of the force that momentary commands lack",
            "a quarter of the second differences between rows",
        ),
        is_log=True,
        of_motion=False,
        mean=log(0.25),
        low=log(1e-3),
    ),
    "slow gain": _slow(
        Prior(
            "slow_gain",
            0.35,
            "ln of the size of a slow change of thrust",
            "1 %, to a factor of 2, or it acts as thrust",
        ),
        0.01,
        1e-6,
        0.2,
    ),
    "slow velocity": _slow(
        Prior("slow_velocity", 2.5, "ln of the size of a slow velocity over ground", "1 mm/s, within a factor of 12"),
        0.001,
        1e-7,
        0.3,
    ),
    "health": Kind(
        None,
        "force of the thruster relative to a whole one",
        keys=("health",),
        mean=0.75,
        deviation=0.5,
        low=0.0,
        high=1.0,
        null=1.0,
    ),
    "command limit": Kind(
        None,
        "command beyond which the thrusters push no more",
        ". The vehicle file does not have it",
        mean=0.8,
        deviation=0.3,
        low=0.1,
        high=1.0,
        null=1.0,
    ),
    "slew limit": Kind(
        None,
        "rate at which commands act at most",
        ". The vehicle file does not have it",
        is_log=True,
        mean=log(2.0),
        deviation=1.5,
        low=log(0.05),
        high=log(50.0),
        null=log(50.0),
        unit="1/s",
    ),
    "white noise": Kind(
        Prior("white_noise", 0.7, "ln of a sensor's white noise", "seen in the differences of its samples"),
        is_log=True,
        of_motion=False,
    ),
    "coloured noise": Kind(_COLOURED, is_log=True, of_motion=False, mean=log(0.3)),
    "correlation time": Kind(_COLOURED, is_log=True, of_motion=False, mean=log(2.0), unit="s"),
    "row noise": Kind(is_log=True, of_motion=False, mean=log(0.03), low=log(1e-3)),
    "logging offset": Kind(unit="s"),
    "logging width": Kind(of_motion=False, mean=0.5, deviation=0.5, low=0.0, high=1.0),
}
"""All kinds. The sizes of slow processes are relative to full thrust, fractions, and in m/s. Coloured noise is relative
to white noise."""
EFFECTS = {name: kind for name, kind in KINDS.items() if kind.words}
PRIORS = {kind.prior.key: kind.prior for kind in KINDS.values() if kind.prior}
"""All deviations by their keys in [priors] of rov.toml. 0 means that the number is exact, or that a slow process is
absent. The noise of a sensor is never exact."""
EFFECT_OF = {key: name for name, kind in EFFECTS.items() for key in kind.keys}
"""The effect that each key of an optional coefficient belongs to."""
ABSENT = {
    key: kind.null for kind in EFFECTS.values() if kind.null is not None and not kind.is_ratio for key in kind.keys
}
"""The values of coefficients that a vehicle file may lack. Those astern are then equal to those ahead."""
