"""The layout of a vehicle, and the declarations of its coefficients and variables (standard library only).

A layout says which axes, thrust curves, thrusters and fins a vehicle has, and which coefficients. It does not contain
the values of the coefficients.

Signs and symbols follow Fossen/SNAME and the paper. The axes of the body frame are x forward, y starboard and z down.
The earth frame is north-east-down. u, v, w are the velocities in surge, sway and heave through the water, and p, q, r
are the angular velocities in roll, pitch and yaw. Heave is positive down.

A coefficient is declared by its key in the vehicle file. Its name in the FMU also contains the axis or the curve to
which it belongs: the key a_d of surge gives a_d_u, the key a_t_reverse of the curve t200 gives a_t_t200_reverse.
"""

import re
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, pi, sin
from typing import TypeVar

from .attitude import INITIAL, QUATERNION
from .expression import unused
from .step import interpolated

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

    @property
    def is_rotation(self) -> bool:
        """True when the vehicle turns about the axis instead of moving along it."""
        return self.unit == "rad/s"

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
COUPLED_AXES = (SURGE, SWAY, YAW)
"""The axes that the Coriolis and Munk terms couple in a vehicle without roll and pitch."""


_PAPER = "Enevoldsen et al. 2018"


def cited(reference: str) -> str:
    """Return a reference with its source: a bare number in brackets, such as (9), is an equation of the paper."""
    return f"equation {reference} of {_PAPER}" if re.fullmatch(r"\(\d+[a-z]?\)", reference) else reference


# ---- Kinds of coefficients -------------------------------------------------------------------------------------------

REVERSE = "_reverse"
"""The end of the keys of coefficients for negative commands or velocities."""


def cross_name(key: str, *velocities: str) -> str:
    """Return the name in the FMU of a coefficient of two or three axes: m_a_uq, or Y_ur for lift."""
    if key == "lift":
        along, *factors = velocities
        return f"{dict(zip('uvwpqr', 'XYZKMN', strict=True))[along]}_{''.join(factors)}"
    return f"{key}_{''.join(velocities)}"


def cross_of(name: str) -> tuple[str, ...] | None:
    """Return the key and the velocities of a coefficient of two or three axes, by its name, or None."""
    if found := re.fullmatch(r"(m_a|b_d|a_d)_([uvwpqr])([uvwpqr])", name):
        return found.groups()
    if found := re.fullmatch(r"([XYZKMN])_([uvwpqr])([uvwpqr])", name):
        return ("lift", "uvwpqr"["XYZKMN".index(found[1])], found[2], found[3])
    return None


def cross_declaration(key: str, *velocities: str) -> "Declaration":
    """Return the declaration of a coefficient of two or three axes."""
    axes = {axis.velocity: axis for axis in AXES.values()}
    first, *others = (axes[velocity] for velocity in velocities)
    rotations = sum(axis.is_rotation for axis in (first, *others))
    lengths = ".".join(axis.position_unit for axis in others)
    return CROSS[key].declaration(
        inertia=("kg", "kg.m", "kg.m2")[min(rotations, 2)],
        load=first.load,
        axis=first.name,
        other=others[0].name,
        axes=" and ".join(axis.name for axis in (others if key == "lift" else (first, *others))),
        length=others[0].position_unit,
        lengths={"m.m": "m2", "rad.rad": "rad2"}.get(lengths, "(m.rad)"),
    )


def delayed_name(command: str) -> str:
    """Return the name of a command that acts after the dead time."""
    return f"delayed_{command}"


def coefficient_name(key: str, of: str) -> str:
    """Return the name in the FMU of a coefficient of a curve or of an axis."""
    stem = key.removesuffix(REVERSE)
    return f"{stem}_{of}{key[len(stem) :]}"


@dataclass(frozen=True)
class Declaration:
    """The declaration of a coefficient or a variable: SI unit, description, bounds (included), and a typical size."""

    unit: str
    description: str
    minimum: float = -inf
    maximum: float = inf
    nominal: float = 1.0
    tunable: bool = False
    start: float = 0.0
    """The value of an input that is not given. A delayed command also has it until the first change arrives."""


@dataclass(frozen=True)
class CoefficientKind:
    """A kind of coefficient.

    `unit` and `words` are templates. Their fields {...} are filled with the texts of an axis or a curve.
    """

    unit: str
    words: str
    minimum: float
    maximum: float
    needed: bool = True
    tunable: bool = False

    def declaration(self, **of: str) -> Declaration:
        """Return the declaration of this coefficient for one axis or curve. `of` has the texts for the fields."""
        words = self.words.format(**of)
        return Declaration(self.unit.format(**of), words, self.minimum, self.maximum, tunable=self.tunable)


BODY = {
    "m_rov": CoefficientKind("kg", f"Mass m_rov, equations (3a) and (3b) of {_PAPER}", 1e-3, 1e6),
    "I_p": CoefficientKind("kg.m2", "Moment of inertia about the longitudinal axis I_p", 1e-6, 1e6),
    "I_q": CoefficientKind("kg.m2", "Moment of inertia about the transverse axis I_q", 1e-6, 1e6),
    "I_r": CoefficientKind("kg.m2", f"Moment of inertia about the vertical axis I_r, {cited('(3c)')}", 1e-6, 1e6),
}
RESTORING = {
    "W": CoefficientKind("N", "Weight W", 0.0, 1e8),
    "B": CoefficientKind("N", "Buoyancy B", 0.0, 1e8),
    "x_G": CoefficientKind("m", "Position of the centre of mass, forward x_G", -100.0, 100.0, needed=False),
    "y_G": CoefficientKind("m", "Position of the centre of mass, to starboard y_G", -100.0, 100.0, needed=False),
    "z_G": CoefficientKind("m", "Position of the centre of mass, down z_G", -100.0, 100.0, needed=False),
    "x_B": CoefficientKind("m", "Position of the centre of buoyancy, forward x_B", -100.0, 100.0, needed=False),
    "y_B": CoefficientKind("m", "Position of the centre of buoyancy, to starboard y_B", -100.0, 100.0, needed=False),
    "z_B": CoefficientKind("m", "Position of the centre of buoyancy, down z_B", -100.0, 100.0, needed=False),
}
"""The weight and the buoyancy of a vehicle, with their centres."""
CROSS = {
    "m_a": CoefficientKind("{inertia}", "Added mass m_a of {axes}", -1e6, 1e6),
    "b_d": CoefficientKind("{load}.s/{length}", "Linear damping b_d in {axis} by {other}", -1e6, 1e6),
    "a_d": CoefficientKind("{load}.s2/{length}2", "Quadratic damping a_d in {axis} by {other}", -1e6, 1e6),
    "lift": CoefficientKind("{load}.s2/{lengths}", "Lift in {axis} by {axes}", -1e6, 1e6),
}
"""The coefficients of two or three axes.

Their names end in the velocities, as in m_a_uq. The name of a lift begins with the letter of the force, as in Y_ur."""
COMMANDS = {"T_d": CoefficientKind("s", "Dead time T_d from a command to its effect", 1e-4, 1.0, needed=False)}
"""The coefficients of all commands together."""
_QUARTER = 1.5708
"""A quarter of a turn, rad. It is rounded up, because a file may have 1.5708."""
ARM = {
    "R": CoefficientKind("m", f"Distance from the centre of mass to a rear thruster R, {cited('(4)')}", 0.0, 100.0),
    "gamma": CoefficientKind(
        "rad", f"Angle of the rear thrusters' force about the centre of mass γ, {cited('(4)')}", 0.0, _QUARTER
    ),
}
FIN = {
    "lift": CoefficientKind("N.s2/(m2.rad)", "Lift of the {fin} per u|u| and angle", 0.0, 1e6),
    "drag": CoefficientKind(
        "N.s2/(m2.rad2)", "Drag of the {fin} per u|u| and square of its angle", 0.0, 1e6, needed=False
    ),
    "angle_max": CoefficientKind("rad", "Angle of the {fin} at full command", 1e-3, _QUARTER),
}
"""The coefficients of a control surface."""
CURVE = {
    "k_t": CoefficientKind("1", "Scale k_t of the table of the {curve}", 1e-3, 1e3, needed=False),
    "V_0": CoefficientKind("V", "Voltage V_0 at which the {curve} was measured", 0.1, 1e3, needed=False),
    "n_V": CoefficientKind(
        "1", "Exponent n_V of the {curve}: thrust is proportional to (voltage / V_0)^n_V", 1.0, 4.0, needed=False
    ),
    "a_t": CoefficientKind("N", "Quadratic thrust coefficient a_t of the {curve}, {equation}", -1e6, 1e6),
    "b_t": CoefficientKind("N", "Linear thrust coefficient b_t of the {curve}, {equation}", -1e6, 1e6),
    "a_t_reverse": CoefficientKind(
        "N", "Quadratic thrust coefficient a_t of the {curve} in reverse", -1e6, 1e6, needed=False
    ),
    "b_t_reverse": CoefficientKind(
        "N", "Linear thrust coefficient b_t of the {curve} in reverse", -1e6, 1e6, needed=False
    ),
    "c_0": CoefficientKind(
        "1", "Dead band c_0 of the {curve}: the command at which thrust begins", 0.0, 0.9, needed=False
    ),
    "c_0_reverse": CoefficientKind("1", "Dead band c_0 of the {curve} in reverse", 0.0, 0.9, needed=False),
    "d": CoefficientKind(
        "N.s/m", "Loss of thrust d of the {curve} per speed of advance at full command", 0.0, 1e6, needed=False
    ),
    "d_reverse": CoefficientKind(
        "N.s/m", "Loss of thrust d of the {curve} per speed of advance in reverse", 0.0, 1e6, needed=False
    ),
    "T": CoefficientKind(
        "s", "Time constant T of the lag of the {curve}, T dF/dt = F(c) - F", 1e-3, 60.0, needed=False
    ),
}
REPLACED_BY_TABLE = ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "c_0_reverse")
"""The keys of CURVE that a curve with measured forces does not have."""
AXIS = {
    "m_a": CoefficientKind("{inertia}", "Added {what} m_a of {axis}", 0.0, 1e6, needed=False),
    "a_d": CoefficientKind("{load}.s2/{length}2", "Quadratic drag coefficient a_d of {axis}, {drag}", 0.0, 1e6),
    "b_d": CoefficientKind("{load}.s/{length}", "Linear drag coefficient b_d of {axis}, {drag}", 0.0, 1e6),
    "a_d_reverse": CoefficientKind(
        "{load}.s2/{length}2", "Quadratic drag coefficient a_d of {axis} {negative}", 0.0, 1e6, needed=False
    ),
    "b_d_reverse": CoefficientKind(
        "{load}.s/{length}", "Linear drag coefficient b_d of {axis} {negative}", 0.0, 1e6, needed=False
    ),
    "F_0": CoefficientKind("{load}", "Constant load F_0 in {axis}, positive {positive}", -1e6, 1e6, needed=False),
}
_AT_ZERO = "; at 0 the velocity never changes"
"""The end of the description of β for the axes whose β may be 0."""
TUNING = {
    "alpha": CoefficientKind(
        "1", "Tuning α_{velocity}: scales {push} in {axis}, {motion}", 0.0, 1e3, needed=False, tunable=True
    ),
    "beta": CoefficientKind(
        "1",
        "Tuning β_{velocity}: scales acceleration in {axis}, {motion}" + _AT_ZERO,
        0.0,
        1e3,
        needed=False,
        tunable=True,
    ),
}
"""The tuning factors of every axis; each is 1 unless the file gives it."""
LEAST_BETA = 1e-3
"""The least β of coupled axes."""


# ---- Layout ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ThrustTable:
    """Measured forces of one thruster, with a monotone cubic between the commands."""

    name: str
    commands: tuple[float, ...]
    """The commands, from -1 to 1 in rising order."""
    forces: tuple[float, ...]
    """The force at each command, N."""
    slopes: tuple[float, ...]
    """The derivative of the force with respect to the command, at each command, N."""
    voltage: float = 0.0
    """The voltage at which the table was measured, V; 0 if the curve has only this table."""

    @property
    def function(self) -> str:
        """The name of the function that formulas call."""
        return f"thrust_{self.name}"

    def force(self, command: float) -> float:
        """Return the force at a command between -1 and 1.

        It is the cubic that has the forces and the slopes at the ends of the interval of the command.
        """
        return float(interpolated(command, (self.commands, self.forces, self.slopes)))

    def slope(self, command: float) -> float:
        """Return the derivative of `force` with respect to the command."""
        f, g, a, b, h, t = self._interval(command)
        return (a + t * (2.0 * (3.0 * (g - f) - 2.0 * a - b) + t * 3.0 * (a + b - 2.0 * (g - f)))) / h

    def _interval(self, command: float) -> tuple[float, float, float, float, float, float]:
        """Return the interval of a command.

        It has the forces at its ends, the slopes there times its length, its length, and the share of it that lies
        below the command.
        """
        n = min(max(bisect_right(self.commands, command) - 1, 0), len(self.commands) - 2)
        h = self.commands[n + 1] - self.commands[n]
        t = (command - self.commands[n]) / h
        return self.forces[n], self.forces[n + 1], h * self.slopes[n], h * self.slopes[n + 1], h, t


@dataclass(frozen=True)
class Curve:
    """A thrust curve.

    For c > 0, the force of `together` thrusters is F(c) = a_t (c - c_0)^2 + b_t (c - c_0). For c < 0 the curve is
    mirrored, unless it has coefficients for reverse. Tables replace both.
    """

    name: str
    keys: tuple[str, ...] = ("a_t", "b_t")
    """The keys of CURVE that the vehicle has."""
    together: int = 1
    description: str = ""
    equation: str = "(2)"
    """The number of the paper's equation, or another source."""
    tables: tuple[ThrustTable, ...] = ()
    """The measured forces, in place of a_t and b_t: one table, or one per voltage in rising order."""
    others: tuple[tuple[str, str], ...] = ()
    """The keys and the names of the coefficients whose usual names are taken. The layout gives these names."""

    def coefficient(self, key: str) -> str:
        """Return the name of a coefficient by its key. Without one for reverse, it is the name of the forward one."""
        return _coefficient(self, key, self.name)

    @property
    def has_lag(self) -> bool:
        """True when the force follows the command with a lag."""
        return "T" in self.keys


Vector = tuple[float, float, float]
FAINT = 1e-9
"""Smaller effects, in N per N or m, are rounding errors of a direction."""


def effect_along(axis: Axis, force: Vector, position: Vector) -> float:
    """Return the part of a force along an axis, or its moment about the axis."""
    (X, Y, Z), (x, y, z) = force, position
    if axis.is_rotation:
        return (y * Z - z * Y, z * X - x * Z, x * Y - y * X)[axis.place]
    return force[axis.place]


@dataclass(frozen=True)
class Thruster:
    """A thruster. Its moments follow from its position.

    A thruster with an arm instead of a position has only the torque ±R sin γ F about z, (4).
    """

    name: str
    curve: str
    """The name of its thrust curve."""
    direction: tuple[float, float, float]
    """The direction of a positive force: a unit vector in the body frame."""
    position: tuple[float, float, float] | None = None
    """The position relative to the centre of mass, m."""
    arm: int = 0
    """1 on the port side, where a force ahead turns the bow to starboard; -1 on the starboard side; 0 without arm."""
    description: str = ""

    def effect(self, axis: Axis) -> float:
        """Return the force along an axis, or the torque about it, of a thrust of 1 N.

        The torque by an arm is in units of R sin γ.
        """
        if self.position is None and axis.is_rotation:
            return float(self.arm) if axis is YAW else 0.0
        return effect_along(axis, self.direction, self.position or (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Fin:
    """A control surface. Its lift is proportional to its angle."""

    name: str
    direction: tuple[float, float, float]
    """The direction of the lift at a positive command ahead: a unit vector in the body frame."""
    position: tuple[float, float, float]
    """The position relative to the centre of mass, m."""
    has_drag: bool = False
    description: str = ""

    def effect(self, axis: Axis) -> float:
        """Return the part of a lift of 1 N along an axis, or its moment about the axis; 0 if it is a rounding error."""
        found = effect_along(axis, self.direction, self.position)
        return found if abs(found) > FAINT else 0.0

    def coefficient(self, key: str) -> str:
        """Return the name of a coefficient by its key."""
        return f"{key}_{self.name}"


@dataclass(frozen=True)
class VehicleAxis:
    """An axis of a vehicle."""

    axis: Axis
    keys: tuple[str, ...] = ("a_d", "b_d")
    """The keys of AXIS that the vehicle has. It always has α and β."""
    others: tuple[tuple[str, str], ...] = ()
    """The keys and the names of the coefficients whose usual names are taken. The layout gives these names."""

    def coefficient(self, key: str) -> str:
        """Return the name of a coefficient by its key. Without one for reverse, it is the name of the forward one."""
        return _coefficient(self, key, self.axis.velocity)


def _coefficient(part: Curve | VehicleAxis, key: str, owner: str) -> str:
    key = key if key in part.keys else key.removesuffix(REVERSE)
    return dict(part.others).get(key) or coefficient_name(key, owner)


_Part = TypeVar("_Part", Curve, VehicleAxis)


@dataclass(frozen=True)
class Layout:
    """The structure of a vehicle: everything except the values of its coefficients.

    It has the axes, curves, thrusters, fins and inputs.
    """

    axes: tuple[VehicleAxis, ...]
    """The axes in the order of AXES."""
    curves: tuple[Curve, ...]
    thrusters: tuple[Thruster, ...]
    mix: Mapping[str, Mapping[str, float]] = field(default_factory=dict, hash=False)
    """For each input, the gains of the thrusters that it drives. If this is empty, each thruster has its own input."""
    coupled: bool = False
    """True when the axes are coupled by the Coriolis and Munk terms of the mass matrix."""
    cross: tuple[tuple[str, ...], ...] = ()
    """The coefficients of two or three axes: the key of CROSS, then the velocities."""
    restoring: tuple[str, ...] = ()
    """The keys of RESTORING that the vehicle has."""
    fins: tuple[Fin, ...] = ()
    has_dead_time: bool = False
    """True when commands act after the dead time T_d."""
    voltage: float | None = None
    """The usual voltage of the battery, V, if the thrust depends on it."""
    pulse: tuple[float, float, float] | None = None
    """The pulse widths of full reverse, no thrust and full thrust, us, if the commands are pulse widths."""

    def __post_init__(self) -> None:
        """Name the coefficients. The curves main and main_reverse would both have a coefficient d_main_reverse.

        A name that is taken gets a number, so the names of parts are free.
        """
        taken = {*(f"F_{thruster.name}" for thruster in self.thrusters), *(COMMANDS if self.has_dead_time else ())}

        def named(part: _Part, owner: str) -> _Part:
            others = []
            for key in part.keys:
                name = coefficient_name(key, owner)
                found = unused(name, taken)
                taken.add(found)
                others += [(key, found)] if found != name else []
            return replace(part, others=tuple(others)) if others or part.others else part

        object.__setattr__(self, "axes", tuple(named(form, form.axis.velocity) for form in self.axes))
        object.__setattr__(self, "curves", tuple(named(curve, curve.name) for curve in self.curves))

    def extended(self, names: Iterable[str]) -> "Layout":
        """Return the layout with additional coefficients of its curves and axes, by their names."""
        wanted = set(names) - self.coefficients.keys()

        def keys(kinds: Iterable[str], has: tuple[str, ...], of: str) -> tuple[str, ...]:
            return tuple(key for key in kinds if key in has or coefficient_name(key, of) in wanted)

        return replace(
            self,
            axes=tuple(replace(form, keys=keys(AXIS, form.keys, form.axis.velocity)) for form in self.axes),
            curves=tuple(replace(curve, keys=keys(CURVE, curve.keys, curve.name)) for curve in self.curves),
        )

    # -- lookup --

    @cached_property
    def kinds(self) -> dict[str, VehicleAxis]:
        """The axes by name."""
        return {form.axis.name: form for form in self.axes}

    @cached_property
    def by_velocity(self) -> dict[str, VehicleAxis]:
        """The axes by their velocities."""
        return {form.axis.velocity: form for form in self.axes}

    @cached_property
    def curves_by_name(self) -> dict[str, Curve]:
        """The thrust curves by name."""
        return {curve.name: curve for curve in self.curves}

    @cached_property
    def curve_of(self) -> dict[str, Curve]:
        """The curve of each thruster, by its name."""
        return {thruster.name: self.curves_by_name[thruster.curve] for thruster in self.thrusters}

    def has(self, *axes: Axis) -> bool:
        """Return True when the vehicle has one of these axes."""
        return any(axis.name in self.kinds for axis in axes)

    @cached_property
    def has_arm(self) -> bool:
        """True when R and γ are among the coefficients."""
        return self.has(YAW) and any(t.position is None and t.arm for t in self.thrusters)

    @cached_property
    def has_attitude(self) -> bool:
        """True when the vehicle rolls or pitches, so that its attitude is a quaternion."""
        return self.has(ROLL, PITCH)

    @cached_property
    def continued(self) -> tuple[str, ...]:
        """The variables that a step continues besides the states: with an attitude, the heading, which counts turns."""
        return ("psi",) if self.has_attitude else ()

    @cached_property
    def driven(self) -> "tuple[Thruster | Fin, ...]":
        """Everything that commands drive: the thrusters and the fins."""
        return (*self.thrusters, *self.fins)

    @cached_property
    def gains(self) -> dict[str, dict[str, float]]:
        """For each thruster and each fin, the gains of the inputs that drive it."""
        if not self.mix:
            return {driven.name: {f"u_{driven.name}": 1.0} for driven in self.driven}
        return {
            driven.name: {f"u_{name}": gains[driven.name] for name, gains in self.mix.items() if gains.get(driven.name)}
            for driven in self.driven
        }

    def drivers(self, axis: Axis) -> list[Thruster]:
        """Return the thrusters that act on an axis."""
        return [t for t in self.thrusters if abs(t.effect(axis)) > FAINT]

    def signs(self, axis: Axis) -> dict[str, float]:
        """Return the sign of each command that acts on an axis: 1 or -1, whichever drives it in its positive direction.

        When the thrusters are symmetric, these commands leave the other axes at rest.
        """
        effects: dict[str, float] = {}
        for thruster in self.drivers(axis):
            for name, gain in self.gains[thruster.name].items():
                effects[name] = effects.get(name, 0.0) + gain * thruster.effect(axis)
        return {name: 1.0 if effect > 0.0 else -1.0 for name, effect in effects.items() if abs(effect) > FAINT}

    def driving(self, axis: Axis, fraction: float) -> dict[str, float]:
        """Return the commands that drive an axis in its positive direction with a fraction of the full command."""
        return {name: self.command_of(fraction * sign) for name, sign in self.signs(axis).items()}

    # -- declarations --

    @cached_property
    def coefficients(self) -> dict[str, Declaration]:
        """The coefficients, in the order of the FMU's variables."""
        inertias = {form.axis.inertia for form in self.axes}
        found = {name: kind.declaration() for name, kind in BODY.items() if name in inertias}
        found |= {key: RESTORING[key].declaration() for key in self.restoring}
        if self.has_arm:
            found |= {key: kind.declaration() for key, kind in ARM.items()}
        if self.has_dead_time:
            found |= {key: kind.declaration() for key, kind in COMMANDS.items()}
        for curve in self.curves:
            words = {"curve": curve.description or f"curve {curve.name}", "equation": cited(curve.equation)}
            found |= {
                curve.coefficient(key): kind.declaration(**words) for key, kind in CURVE.items() if key in curve.keys
            }
        for fin in self.fins:
            fins = {"fin": fin.description or f"fin {fin.name}"}
            keys = (key for key in FIN if key != "drag" or fin.has_drag)
            found |= {fin.coefficient(key): FIN[key].declaration(**fins) for key in keys}
        for form in self.axes:
            declared = declarations_of(form.axis)
            found |= {form.coefficient(key): declared[key] for key in AXIS if key in form.keys}
        for form in self.axes:
            declared = declarations_of(form.axis)
            found |= {form.axis.coefficient(key): declared[key] for key in TUNING}
        for key, *velocities in self.cross:
            found[cross_name(key, *velocities)] = cross_declaration(key, *velocities)
        if self.coupled or any(key == "m_a" for key, *_ in self.cross):  # these effective inertias m/β must be finite
            for axis in (form.axis for form in self.axes if self.has_attitude or form.axis is not HEAVE):
                beta = axis.coefficient("beta")
                description = found[beta].description.removesuffix(_AT_ZERO)
                found[beta] = replace(found[beta], description=description, minimum=LEAST_BETA)
        return found

    @cached_property
    def commands(self) -> dict[str, Declaration]:
        """The inputs that drive the thrusters and the fins: fractions of the full command, or of the largest angle.

        If the vehicle has `pulse`, they are pulse widths instead.
        """
        if self.mix:
            words = {name: f"Command u_{name} of {_listed(gains)}" for name, gains in self.mix.items()}
        else:
            words = {driven.name: _command(driven) for driven in self.driven}
        return {f"u_{name}": self._commanding(text) for name, text in words.items()}

    def _commanding(self, words: str) -> Declaration:
        """Return the declaration of a command, which `words` describe."""
        if self.pulse is None:
            return Declaration("1", f"{words}; saturates at ±1", -1.0, 1.0)
        low, neutral, high = self.pulse
        text = (
            f"{words}; pulse width, {neutral:g} is neutral, saturates at {low:g} and {high:g}; 0 is no signal: neutral"
        )
        return Declaration("us", text, low, high, neutral, start=neutral)

    def command_of(self, fraction: float) -> float:
        """Return the value of a command that stands for a fraction: the fraction itself, or the pulse width."""
        if self.pulse is None:
            return fraction
        low, neutral, high = self.pulse
        return neutral + fraction * (high - neutral if fraction > 0.0 else neutral - low)

    def fraction_of(self, command: float) -> float:
        """Return the fraction from -1 to 1 that a command stands for. A pulse of 0 is no signal, and stands for 0."""
        if self.pulse is not None:
            low, neutral, high = self.pulse
            command = command or neutral
            command = (command - neutral) / (high - neutral if command > neutral else neutral - low)
        return max(-1.0, min(1.0, command))

    @cached_property
    def delayed(self) -> dict[str, Declaration]:
        """The commands that act after the dead time, if the vehicle has one."""
        if not self.has_dead_time:
            return {}
        return {
            delayed_name(name): Declaration(
                declaration.unit, f"Command {name} that acts after the dead time", start=declaration.start
            )
            for name, declaration in self.commands.items()
        }

    @cached_property
    def inputs(self) -> dict[str, Declaration]:
        """The inputs: commands, loads from outside, current, voltage."""
        found = dict(self.commands)
        for form in self.axes:
            axis = form.axis
            example = "ballast" if axis is HEAVE else "contact"
            words = f"Load from outside in {axis.name} (tether, {example}), positive {axis.positive}"
            found[axis.external] = Declaration(axis.load, words, nominal=1.0 if axis.is_rotation else 10.0)
        if self.has(SURGE, SWAY) or (self.has_attitude and self.has(HEAVE)):
            for name, direction in (("V_N", "northward"), ("V_E", "eastward")):
                found[name] = Declaration("m/s", f"Velocity of a steady horizontal current, {direction}")
            if self.has_attitude:
                found["V_D"] = Declaration("m/s", "Velocity of a steady current, downward")
        if self.voltage is not None:
            lows, highs = zip(*(self.voltage_ranges or [(0.0, inf)]), strict=True)
            low, high = min(lows), max(highs)
            found["voltage"] = Declaration("V", "Voltage of the battery", low, high, 10.0, start=self.voltage)
        return found

    @cached_property
    def voltage_ranges(self) -> dict[tuple[float, float], str]:
        """The lowest and the highest voltage of the curves with several tables, with the names of the curves.

        Beyond its range, the thrust of a curve stays that of the nearest table.
        """
        names: dict[tuple[float, float], list[str]] = {}
        for curve in self.curves:
            if len(curve.tables) > 1:
                names.setdefault((curve.tables[0].voltage, curve.tables[-1].voltage), []).append(curve.name)
        return {bounds: " and ".join(curves) for bounds, curves in names.items()}

    @cached_property
    def usual_inputs(self) -> dict[str, float]:
        """The inputs that are not given: no command, load or current, and the usual voltage."""
        return {name: declaration.start for name, declaration in self.inputs.items()}

    @cached_property
    def velocities(self) -> dict[str, Declaration]:
        """The velocities through the water, which are the first states."""
        found = {}
        for axis in (form.axis for form in self.axes):
            through = "" if axis.is_rotation else " through the water"
            words = f"{axis.name.capitalize()} velocity {axis.velocity}{through}, positive {axis.positive}"
            found[axis.velocity] = Declaration(axis.unit, words)
        return found

    @cached_property
    def pose(self) -> dict[str, Declaration]:
        """The position, and the heading or the quaternion, as far as the axes change them.

        These states come after the velocities.
        """
        found = {}
        if self.has_attitude:
            if self.has(SURGE, SWAY, HEAVE):
                found["x"] = Declaration("m", "Position north x", nominal=10.0)
                found["y"] = Declaration("m", "Position east y", nominal=10.0)
                found["z"] = Declaration("m", "Depth z, positive down", nominal=10.0)
            found |= {name: Declaration("1", f"Attitude quaternion {name}") for name in QUATERNION}
            return found
        if self.has(SURGE, SWAY):
            found["x"] = Declaration("m", "Position north x", nominal=10.0)
            found["y"] = Declaration("m", "Position east y", nominal=10.0)
        if self.has(HEAVE):
            found["z"] = Declaration("m", "Depth z, positive down", nominal=10.0)
        if self.has(YAW):
            found["psi"] = Declaration("rad", "Heading ψ, positive north to east, not wrapped")
        return found

    @cached_property
    def lagging(self) -> dict[str, Declaration]:
        """The forces that follow the commands with a lag, which are the last states."""
        return {
            f"F_{t.name}": _thrust(t, self.curve_of[t.name]) for t in self.thrusters if self.curve_of[t.name].has_lag
        }

    @cached_property
    def state(self) -> dict[str, Declaration]:
        """All states in their order."""
        return self.velocities | self.pose | self.lagging

    @cached_property
    def calculated(self) -> dict[str, Declaration]:
        """The calculated variables that are neither states nor rates.

        They are the forces of the thrusters without a lag, the torque of the thrusters of each curve, and the Euler
        angles of a vehicle with an attitude. Forces and torques are those before the tuning α.
        """
        found = {
            f"F_{t.name}": _thrust(t, self.curve_of[t.name])
            for t in self.thrusters
            if not self.curve_of[t.name].has_lag
        }
        for curve in self.turning_curves:
            of = f"of the {curve.description}" if curve.description else curve.name
            by_arm = any(t.curve == curve.name and t.position is None for t in self.drivers(YAW))
            words = f"Torque τ_{curve.name} of the thrusters with the curve {of}, positive bow to starboard"
            found[f"tau_{curve.name}"] = Declaration("N.m", f"{words}, {cited('(4)')}" if by_arm else words)
        return found | self.angles

    @cached_property
    def angles(self) -> dict[str, Declaration]:
        """The Euler angles, which are calculated from the quaternion."""
        if not self.has_attitude:
            return {}
        return {
            "phi": Declaration("rad", "Roll angle φ, positive starboard side down", -pi, pi),
            "theta": Declaration("rad", "Pitch angle θ, positive bow up", -pi / 2, pi / 2),
            "psi": Declaration("rad", "Heading ψ, positive north to east, not wrapped"),
        }

    @cached_property
    def at_rest(self) -> dict[str, float]:
        """The states of a vehicle that is at rest at the origin, is level and heads north."""
        return dict.fromkeys(self.state, 0.0) | ({"eta": 1.0} if self.has_attitude else {})

    @cached_property
    def initial(self) -> dict[str, Declaration]:
        """The parameters that give the attitude at the start."""
        if not self.has_attitude:
            return {}
        return {name: Declaration("rad", f"{words} at the start") for name, words in INITIAL.items()}

    @cached_property
    def places(self) -> dict[str, int]:
        """The index of each variable in the arrays of the C code. That of der(x) is the index of x plus len(state)."""
        found = {name: place for place, name in enumerate([*self.inputs, *self.state])}
        first = len(found) + len(self.state)
        return found | {
            name: first + place
            for place, name in enumerate([*self.calculated, *self.delayed, *self.coefficients, *self.initial])
        }

    @cached_property
    def turning_curves(self) -> tuple[Curve, ...]:
        """The curves whose thrusters turn the vehicle."""
        driving = {t.curve for t in self.drivers(YAW)} if self.has(YAW) else set()
        return tuple(curve for curve in self.curves if curve.name in driving)


def declarations_of(axis: Axis) -> dict[str, Declaration]:
    """Return the declarations of all coefficients that an axis can have, by their keys."""
    drag, motion = map(cited, axis.equations)
    words = {
        "axis": axis.name,
        "velocity": axis.velocity,
        "push": axis.push,
        "drag": drag,
        "motion": motion,
        "load": axis.load,
        "length": axis.position_unit,
        "inertia": BODY[axis.inertia].unit,
        "what": "moment of inertia" if axis.is_rotation else "mass",
        "positive": axis.positive,
        "negative": axis.negative,
    }
    return {key: kind.declaration(**words) for key, kind in (AXIS | TUNING).items()}


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"thrusters {', '.join(first)} and {last}" if first else f"thruster {last}"


def _pushes(direction: tuple[float, float, float]) -> str:
    """Return the direction of a positive force in words."""
    words = [
        axis.positive if part > 0.0 else axis.negative
        for axis, part in zip((SURGE, SWAY, HEAVE), direction, strict=True)
        if abs(part) > FAINT
    ]
    return " and ".join(words)


def _command(driven: Thruster | Fin) -> str:
    kind = "fin" if isinstance(driven, Fin) else "thruster"
    words = f"Command u_{driven.name}: {driven.description or f'{kind} {driven.name}'}"
    return f"{words}, positive {_pushes(driven.direction)}"


def _thrust(thruster: Thruster, curve: Curve) -> Declaration:
    words = f"Thrust F_{thruster.name}: {thruster.description or f'thruster {thruster.name}'}"
    share = {1: "", 2: ", half of the pair's"}.get(curve.together, f", 1/{curve.together} of their curve")
    rest = ", in water at rest" if "d" in curve.keys else ""
    return Declaration("N", f"{words}{share}{rest}, positive {_pushes(thruster.direction)}, {cited(curve.equation)}")


def arm(R: float, gamma: float) -> float:
    """Return R sin γ, the torque per difference of thrust (m), (4)."""
    return R * sin(gamma)
