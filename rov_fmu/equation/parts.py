"""The parts of a vehicle without their numbers: axes, thrust curves and tables, thrusters and fins."""

from dataclasses import dataclass, field, replace
from math import sin
from pathlib import Path
from typing import Literal, NamedTuple

from .catalogue import POINT, REVERSE, YAW, Axis, Lag, coefficient_name
from .python.step import interpolated


@dataclass(frozen=True)
class CommandTable:
    """Measured thrust or electric current of one thruster over its command, with a cubic between the commands.

    The cubics of a thrust are monotone, and those of a current are straight lines. Of two equal commands, the first
    one ends an interval, and the second one begins the next.
    """

    name: str
    commands: tuple[float, ...]
    """The commands, from -1 to 1 in rising order."""
    values: tuple[float, ...]
    """The force (N) or the current (A) at each command."""
    slopes: tuple[float, ...]
    """The derivative with respect to the command, at each command."""
    voltage: float = 0.0
    """The voltage at which the table was measured, V; 0 if the curve has only this table of thrust."""
    path: Path | None = field(default=None, compare=False)
    """The file with the table."""
    kind: Literal["thrust", "current"] = "thrust"

    @property
    def function(self) -> str:
        """The name of the function that formulas call."""
        return f"{self.kind}_{self.name}"

    def value(self, command: float) -> float:
        """Return the force or the current at a command between -1 and 1.

        It is the cubic that has the values and the slopes at the ends of the interval of the command.
        """
        return float(interpolated(command, (self.commands, self.values, self.slopes)))


class Part:
    """A part of a layout with coefficients: a thrust curve, an axis, a thruster, a fin or a point."""

    name: str
    keys: tuple[str, ...]

    @property
    def suffix(self) -> str:
        """The end of the names of its coefficients."""
        return self.name

    def coefficient(self, key: str) -> str:
        """Return the name of a coefficient by its key. Without one for reverse, it is the name of the forward one."""
        return self.name_of(key if key in self.keys else key.removesuffix(REVERSE))

    def name_of(self, key: str) -> str:
        """Return the name that the coefficient with a key has, or would have if it were added."""
        return coefficient_name(key, self.suffix)


@dataclass(frozen=True)
class Curve(Part):
    """A thrust curve.

    n thrusters share this curve; each has 1/n of F(c) = a_t (c - c_0)^2 + b_t (c - c_0), for c > c_0. For c < 0 the
    curve is mirrored, unless it has coefficients for reverse. Tables replace both.
    """

    name: str
    keys: tuple[str, ...] = ("a_t", "b_t")
    """The keys of CURVE that the vehicle has."""
    n_thrusters: int = 1
    description: str = ""
    equation: str = ""
    """Where the curve is published: the number of an equation of the paper, or another source."""
    tables: tuple[CommandTable, ...] = ()
    """The measured forces, in place of a_t and b_t: one table, or one per voltage in rising order."""
    lag: Lag = "force"
    """What lags with the time constant T: the force, T F' = F(c) - F, or the rotor's speed, T n' = n_c - n."""
    electric_current: CommandTable | None = None
    """The current of one thruster. All curves of a vehicle have it, or none."""

    @property
    def has_lag(self) -> bool:
        """True when the force, or the rotor's speed, follows the command with a lag."""
        return "T" in self.keys

    @property
    def has_rotors(self) -> bool:
        """True when the speeds of the rotors lag, so that the forces follow from these speeds."""
        return self.has_lag and self.lag == "speed"

    def lagging(self, thruster: str) -> str:
        """Return the name of what lags of a thruster: its force, or the speed of its rotor."""
        return f"{'n' if self.has_rotors else 'F'}_{thruster}"


Vector = tuple[float, float, float]
FAINT = 1e-9
"""Smaller effects, in N per N or m, are rounding errors of a direction."""


def effect_along(axis: Axis, force: Vector, position: Vector) -> float:
    """Return the part of a force along an axis, or its moment about the axis."""
    (X, Y, Z), (x, y, z) = force, position
    if axis.is_rotation:
        return (y * Z - z * Y, z * X - x * Z, x * Y - y * X)[axis.place]
    return force[axis.place]


class SourcedVector(NamedTuple):
    """A direction or a position in the body frame, and where it comes from."""

    value: Vector
    """Forward, starboard, down: a unit vector, or a position from the origin (m)."""
    source: str


@dataclass(frozen=True, kw_only=True)
class Actuator(Part):
    """A thruster or a fin: a part that commands drive, without its numbers."""

    name: str
    """The name in the FMU: the command is `u_<name>`, and the force of a thruster `F_<name>`."""
    description: str = ""
    """For example "left thruster" or "rudder"."""
    direction: SourcedVector
    """The direction of the force at a positive command, or of a fin's lift ahead."""
    position: SourcedVector | None = None

    @property
    def place(self) -> Vector:
        """The position (m), or the centre of mass where there is none."""
        return self.position.value if self.position else (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Thruster(Actuator):
    """A thruster: its curve, its direction and its place."""

    curve: str
    """The name of the thrust curve."""
    keys: tuple[str, ...] = ("health",)
    """The keys of THRUSTER."""
    arm: Literal["port", "starboard"] | None = None
    """The side of a thruster that pushes ahead with the arm R sin γ, (4), in place of a position."""

    @property
    def side(self) -> float:
        """1 on the port side, where a force ahead turns the bow to starboard; -1 on the other side; 0 without arm."""
        return {None: 0.0, "port": 1.0, "starboard": -1.0}[self.arm]

    @property
    def opposite(self) -> "Thruster":
        """The thruster if it is mounted the other way: it pushes in the opposite direction."""
        x, y, z = (0.0 - one for one in self.direction.value)
        return replace(self, direction=self.direction._replace(value=(x, y, z)))

    def effect(self, axis: Axis) -> float:
        """Return the force along an axis, or the torque about it, of a thrust of 1 N.

        The torque by an arm is in units of R sin γ.
        """
        if self.position is None and axis.is_rotation:
            return self.side if axis is YAW else 0.0
        return effect_along(axis, self.direction.value, self.place)


@dataclass(frozen=True, kw_only=True)
class BodyForce(Thruster):
    """The force along one axis of the body, or the moment about it, where logs have a wrench and not thrusters."""

    axis: Axis

    def effect(self, axis: Axis) -> float:
        """Return 1 for its own axis, and 0 for the others."""
        return float(axis is self.axis)


@dataclass(frozen=True, kw_only=True)
class Fin(Actuator):
    """A control surface. Its lift is proportional to its angle."""

    keys: tuple[str, ...] = ("lift", "angle_max")
    """The keys of FIN that the vehicle has."""

    def effect(self, axis: Axis) -> float:
        """Return the part of a lift of 1 N along an axis, or its moment about the axis; 0 if it is a rounding error."""
        effect = effect_along(axis, self.direction.value, self.place)
        return effect if abs(effect) > FAINT else 0.0


@dataclass(frozen=True, kw_only=True)
class Point(Part):
    """A point of the vehicle at which forces act on it, such as that of a tether."""

    name: str
    """The name in the FMU: the force has the components `F_N_<point>`, `F_E_<point>` and `F_D_<point>`."""
    description: str = ""
    keys: tuple[str, ...] = tuple(POINT)
    """The keys of POINT."""

    def force(self, direction: str) -> str:
        """Return the name of a component of the force, on the vehicle: along N, E or D."""
        return f"F_{direction}_{self.name}"

    def coordinate(self, name: str) -> str:
        """Return the name of a coordinate of the point, x, y or z, or of a component of its velocity, vg_N ..."""
        return f"{name}_{self.name}"


@dataclass(frozen=True)
class VehicleAxis(Part):
    """An axis of a vehicle."""

    axis: Axis
    keys: tuple[str, ...] = ("a_d", "b_d")
    """The keys of AXIS that the vehicle has. It always has α and β."""

    @property
    def suffix(self) -> str:
        """The velocity along the axis."""
        return self.axis.velocity


class Range(NamedTuple):
    """The range of a quantity over which a vehicle was identified."""

    name: str
    """The variable, or EVERY_COMMAND."""
    low: float
    high: float


EVERY_COMMAND = "command"
"""The quantity whose range limits the size of the commands of all thrusters."""


def arm(R: float, gamma: float) -> float:
    """Return R sin γ, the torque per difference of thrust (m), (4)."""
    return R * sin(gamma)
