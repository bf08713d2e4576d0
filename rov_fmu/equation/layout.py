"""The layout of a vehicle: its axes, thrust curves, thrusters and fins, and which coefficients it has.

A layout does not contain the values of the coefficients. `catalogue.py` declares the kinds of coefficients and
variables.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from math import inf
from types import MappingProxyType
from typing import NamedTuple

from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import listed

from .catalogue import (
    ANGLES,
    ANGLES_AT_START,
    ARM,
    ATTITUDE,
    AXES,
    AXIS,
    BODY,
    COMMANDS,
    COUPLED_TUNING,
    CURRENT,
    CURRENT_DOWN,
    CURVE,
    EARTH,
    ELEVATION,
    FIN,
    GEOMETRY,
    HEADING,
    HEAVE,
    OUTSIDE,
    PITCH,
    POINT,
    POSITION,
    RESTORING,
    ROLL,
    SURFACE,
    SURGE,
    SWAY,
    THRUSTER,
    TUNING,
    WATER_ACCELERATION,
    YAW,
    Axis,
    Declaration,
    axis_words,
    before_declaration,
    before_name,
    command_declaration,
    cross_declaration,
    cross_name,
    delayed_declaration,
    delayed_name,
    load_declaration,
    over_ground_declaration,
    over_ground_name,
    rate_name,
    velocity_declaration,
    voltage_declaration,
)
from .parts import FAINT, BodyForce, Curve, Fin, Part, Point, Range, SourcedVector, Thruster, VehicleAxis, effect_along
from .words import (
    actuator_words,
    command_words,
    curve_words,
    electric_declarations,
    point_declarations,
    point_words,
    rotor_declaration,
    thrust_declaration,
    torque_declaration,
)


class Coefficient(NamedTuple):
    """A coefficient of a vehicle, without its value."""

    name: str
    """The name in the FMU: a_d_u."""
    keys: tuple[str, ...]
    """The tables around it in the vehicle file, and its key: axes, surge, a_d."""
    declaration: Declaration


def _declared(
    place: tuple[str, ...],
    declarations: Mapping[str, Declaration],
    keys: Container[str],
    name_of: Callable[[str], str] = str,
    words: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[Coefficient]:
    """Yield the coefficients of a table of the vehicle file that have these keys; `words` fill their texts."""
    for key, declaration in declarations.items():
        if key in keys:
            yield Coefficient(name_of(key), (*place, key), declaration.filled(**words))


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
    voltage_source: str = field(default="", compare=False)
    """The source of `voltage`."""
    points: tuple[Point, ...] = ()
    """The points at which forces act."""
    surface: bool = False
    """True when buoyancy and thrust fade out above the surface, over the height H."""
    current_passes: bool = False
    """True when the vehicle keeps its velocity over ground where the current changes, in place of that through the
    water."""
    waves: bool = False
    """True when the acceleration and the elevation of the water are inputs, and the water also moves up and down."""
    is_uncertain: bool = False
    """True while a vehicle is identified whose geometry has the coefficients of GEOMETRY."""
    identified: tuple[Range, ...] = ()
    """The ranges over which the vehicle was identified. With them, it has the output `outside`."""

    def with_keys(self, has: Callable[[Part, str], bool]) -> "Layout":
        """Return the layout whose curves and axes have just the coefficients for which `has(part, key)` is true."""

        def keys(part: Part, allowed: Iterable[str]) -> tuple[str, ...]:
            return tuple(key for key in allowed if has(part, key))

        return replace(
            self,
            axes=tuple(replace(vehicle_axis, keys=keys(vehicle_axis, AXIS)) for vehicle_axis in self.axes),
            curves=tuple(replace(curve, keys=keys(curve, CURVE)) for curve in self.curves),
        )

    @classmethod
    def of_wrench(cls, axes: "Iterable[VehicleAxis]") -> "Layout":
        """Return the layout of a vehicle whose commands are a wrench in the body frame.

        Each axis has a force of its own, which is linear in its command. It has the name of the load from outside.
        """
        axes, source = tuple(axes), "The axis of the body"
        centre = SourcedVector((0.0, 0.0, 0.0), source)
        forces = []
        for axis in (vehicle_axis.axis for vehicle_axis in axes):
            x, y, z = (float(n == axis.place) for n in range(3))
            along, name = SourcedVector((x, y, z), source), axis.external
            forces.append(BodyForce(name=name, curve=name, direction=along, position=centre, axis=axis))
        return cls(axes, tuple(Curve(force.name) for force in forces), tuple(forces))

    def extended(self, names: Iterable[str]) -> "Layout":
        """Return the layout with additional coefficients of its curves and axes, by their names."""
        wanted = set(names) - self.coefficients.keys()
        return self.with_keys(lambda part, key: key in part.keys or part.name_of(key) in wanted)

    # -- lookup --

    @cached_property
    def bare_axes(self) -> tuple[Axis, ...]:
        """The axes without the keys of their coefficients."""
        return tuple(vehicle_axis.axis for vehicle_axis in self.axes)

    @cached_property
    def by_name(self) -> dict[str, VehicleAxis]:
        """The axes by name."""
        return {vehicle_axis.axis.name: vehicle_axis for vehicle_axis in self.axes}

    @cached_property
    def by_velocity(self) -> dict[str, VehicleAxis]:
        """The axes by their velocities."""
        return {vehicle_axis.axis.velocity: vehicle_axis for vehicle_axis in self.axes}

    @cached_property
    def curves_by_name(self) -> dict[str, Curve]:
        """The thrust curves by name."""
        return {curve.name: curve for curve in self.curves}

    @cached_property
    def curve_of(self) -> dict[str, Curve]:
        """The curve of each thruster, by its name."""
        return {thruster.name: self.curves_by_name[thruster.curve] for thruster in self.thrusters}

    @property
    def lacking(self) -> list[str]:
        """The names of the axes that the vehicle does not have."""
        return [name for name in AXES if name not in self.by_name]

    def has(self, *axes: Axis) -> bool:
        """Return True when the vehicle has one of these axes."""
        return any(axis.name in self.by_name for axis in axes)

    @cached_property
    def has_arm(self) -> bool:
        """True when R and γ are among the coefficients."""
        return self.has(YAW) and any(t.position is None and t.arm for t in self.thrusters)

    @cached_property
    def has_wrench(self) -> bool:
        """True when the commands are forces and moments along the axes of the body, in place of thrusters."""
        return any(isinstance(thruster, BodyForce) for thruster in self.thrusters)

    @cached_property
    def has_attitude(self) -> bool:
        """True when the vehicle rolls or pitches, so that its attitude is a quaternion."""
        return self.has(ROLL, PITCH)

    @cached_property
    def has_only_water(self) -> bool:
        """True when the vehicle may leave the water, and moves on there as under water."""
        return "z" in self.pose and not self.surface

    @cached_property
    def continued(self) -> tuple[str, ...]:
        """Variables that are carried from step to step although they are no states. With roll or pitch this is psi: a
        quaternion does not know how many turns the vehicle has made."""
        return ("psi",) if self.has_attitude else ()

    @cached_property
    def actuators(self) -> "tuple[Thruster | Fin, ...]":
        """Everything that commands drive: the thrusters and the fins."""
        return (*self.thrusters, *self.fins)

    @cached_property
    def gains(self) -> dict[str, dict[str, float]]:
        """For each thruster and each fin, the gains of the inputs that drive it."""
        if not self.mix:
            return {one.name: {f"u_{one.name}": 1.0} for one in self.actuators}
        return {
            one.name: {f"u_{name}": gains[one.name] for name, gains in self.mix.items() if gains.get(one.name)}
            for one in self.actuators
        }

    def gain_rows(self, actuators: Iterable[str]) -> list[list[float]]:
        """Return the gains of all commands in each of some thrusters or fins, which are given by name."""
        return [[self.gains[name].get(command, 0.0) for command in self.commands] for name in actuators]

    def thrusters_along(self, axis: Axis) -> list[Thruster]:
        """Return the thrusters that act on an axis, perhaps only because their places are uncertain."""

        def acts(t: Thruster) -> bool:
            moved = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) if self.is_uncertain and axis.is_rotation else ()
            by_places = (effect_along(axis, t.direction.value, place) for place in moved)
            return any(abs(effect) > FAINT for effect in (t.effect(axis), *by_places))

        return [t for t in self.thrusters if acts(t)]

    def shares_thrusters(self, one: Axis, other: Axis) -> bool:
        """Return True if a thruster acts on both axes."""
        return any(thruster in self.thrusters_along(other) for thruster in self.thrusters_along(one))

    def signs(self, axis: Axis) -> dict[str, float]:
        """Return the sign of each command that acts on an axis: 1 or -1, whichever drives it in its positive direction.

        When the thrusters are symmetric, these commands leave the other axes at rest.
        """
        effects: dict[str, float] = {}
        for thruster in self.thrusters_along(axis):
            for name, gain in self.gains[thruster.name].items():
                effects[name] = effects.get(name, 0.0) + gain * thruster.effect(axis)
        return {name: 1.0 if effect > 0.0 else -1.0 for name, effect in effects.items() if abs(effect) > FAINT}

    def commands_along(self, axis: Axis, fraction: float) -> dict[str, float]:
        """Return the commands that drive an axis in its positive direction with a fraction of the full command."""
        return {name: self.command_of(fraction * sign) for name, sign in self.signs(axis).items()}

    def example(self, axis: Axis) -> dict[str, float]:
        """Return inputs that drive an axis in its positive direction: 30 % of the command, or 5 N or N.m from outside
        where nothing drives it."""
        return self.commands_along(axis, 0.3) or {axis.external: 5.0}

    # -- declarations --

    @cached_property
    def declared(self) -> "tuple[Coefficient, ...]":
        """The coefficients, in the order of the FMU's variables."""
        axes = [(("axes", one.axis.name), one, axis_words(one.axis)) for one in self.axes]
        is_coupled = self.coupled or any(key == "m_a" for key, *_ in self.cross)
        alone = () if is_coupled and self.has_attitude else (HEAVE,) if is_coupled else self.bare_axes
        tables = [
            _declared(("body",), BODY, {axis.inertia for axis in self.bare_axes}),
            _declared(("body",), RESTORING, self.restoring),
            _declared(("arm",), ARM, ARM if self.has_arm else ()),
            _declared(("commands",), COMMANDS, COMMANDS if self.has_dead_time else ()),
            *(_declared(("curves", c.name), CURVE, c.keys, c.coefficient, curve_words(c)) for c in self.curves),
            *(_declared(("fin", f.name), FIN, f.keys, f.coefficient, actuator_words(f)) for f in self.fins),
            *(_declared(place, AXIS, one.keys, one.coefficient, words) for place, one, words in axes),
            *(
                _declared(place, TUNING if one.axis in alone else COUPLED_TUNING, TUNING, one.coefficient, words)
                for place, one, words in axes
            ),
            *(
                _declared(("thruster", t.name), THRUSTER, t.keys, t.coefficient, actuator_words(t))
                for t in self.thrusters
            ),
            (Coefficient(cross_name(*row), ("cross", cross_name(*row)), cross_declaration(*row)) for row in self.cross),
            _declared(("geometry",), GEOMETRY, GEOMETRY if self.is_uncertain else ()),
            *(_declared(("point", p.name), POINT, p.keys, p.coefficient, point_words(p)) for p in self.points),
            _declared(("surface",), SURFACE, SURFACE if self.surface else ()),
        ]
        return tuple(chain(*tables))

    @cached_property
    def keys_in_file(self) -> dict[str, tuple[str, ...]]:
        """The tables and the key of each coefficient in the vehicle file, by its name in the FMU."""
        return {one.name: one.keys for one in self.declared}

    @cached_property
    def coefficients(self) -> dict[str, Declaration]:
        """The declarations of the coefficients by name."""
        return {one.name: one.declaration for one in self.declared}

    @cached_property
    def tuning(self) -> tuple[str, ...]:
        """The names of the tuning factors α and β. They are tunable in the FMU, as the mass and the ballast are."""
        return tuple(axis.coefficient(key) for axis in self.bare_axes for key in TUNING)

    @cached_property
    def health(self) -> dict[str, str]:
        """The names of the health of each thruster, by its name. A vehicle file need not give it; it is 1 then."""
        return {thruster.name: thruster.coefficient("health") for thruster in self.thrusters}

    @cached_property
    def ballast(self) -> tuple[str, ...]:
        """The other tunable coefficients: mass, weight, buoyancy, their centres, and the scales of tables of thrust."""
        factors = {*self.tuning, *self.health.values()}
        return tuple(name for name, one in self.coefficients.items() if one.tunable and name not in factors)

    @cached_property
    def commands(self) -> dict[str, Declaration]:
        """The inputs that drive the thrusters and the fins: fractions of the full command, or of the largest angle.

        If the vehicle has `pulse`, they are pulse widths instead.
        """
        words = {
            name: f"Command u_{name} of thruster{'s' if len(gains) > 1 else ''} {listed(gains)}"
            for name, gains in self.mix.items()
        } or {one.name: command_words(one) for one in self.actuators}
        return {f"u_{name}": command_declaration(text, self.pulse) for name, text in words.items()}

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
    def acting(self) -> dict[str, str]:
        """The variable with the command that acts, by the name of the command, if commands act after a dead time."""
        return {name: delayed_name(name) for name in self.commands} if self.has_dead_time else {}

    @cached_property
    def delayed(self) -> dict[str, Declaration]:
        """The commands that act after the dead time, if the vehicle has one."""
        return {later: delayed_declaration(name, self.commands[name]) for name, later in self.acting.items()}

    @cached_property
    def before(self) -> dict[str, str]:
        """The variable with the current during the step before, by the name of each component of the current, if a
        current that changes passes the vehicle."""
        names = (name for name in CURRENT | CURRENT_DOWN if name in self.inputs)
        return {name: before_name(name) for name in names} if self.current_passes else {}

    @cached_property
    def memory(self) -> dict[str, Declaration]:
        """What is kept from step to step beside the states: the current before, and the commands that act."""
        kept = {later: before_declaration(self.inputs[name]) for name, later in self.before.items()}
        return kept | self.delayed

    @cached_property
    def inputs(self) -> dict[str, Declaration]:
        """The inputs: commands, loads from outside, current, voltage."""
        inputs = dict(self.commands)
        inputs |= {axis.external: load_declaration(axis) for axis in self.bare_axes}
        moves_horizontally = self.has(SURGE, SWAY) or (self.has_attitude and self.has(HEAVE))
        if moves_horizontally:
            inputs |= CURRENT
        if (moves_horizontally and self.has_attitude) or (self.waves and self.has(HEAVE)):
            inputs |= CURRENT_DOWN
        if self.voltage is not None:
            inputs["voltage"] = voltage_declaration(*self.voltage_range, self.voltage)
        return inputs | self.acceleration | (ELEVATION if self.waves and self.surface else {}) | self.forces_at_points

    @cached_property
    def acceleration(self) -> dict[str, Declaration]:
        """The acceleration of the water, for a vehicle in waves."""
        return WATER_ACCELERATION if self.waves else {}

    @cached_property
    def in_earth_frame(self) -> dict[str, Declaration]:
        """The loads whose directions are those of the earth. While one is not 0, all depends on the attitude."""
        return self.acceleration | self.forces_at_points

    @cached_property
    def forces_at_points(self) -> dict[str, Declaration]:
        """The forces at the points, which are the last inputs."""
        return {name: one for point in self.points for name, one in point_declarations(point)[0].items()}

    @cached_property
    def motion_of_points(self) -> dict[str, Declaration]:
        """The position and the velocity over ground of each point."""
        return {name: one for point in self.points for name, one in point_declarations(point)[1].items()}

    @cached_property
    def has_heading_states(self) -> bool:
        """True when the cosine and the sine of the heading are states: the vehicle stays level, and they turn what is
        in the earth frame."""
        return self.has(YAW) and not self.has_attitude and (self.has(SURGE, SWAY) or bool(self.points))

    @cached_property
    def voltage_ranges(self) -> dict[tuple[float, float], str]:
        """The lowest and the highest voltage of the curves with several tables, with the names of the curves.

        Beyond its range, the thrust of a curve stays that of the nearest table.
        """
        several = [curve for curve in self.curves if len(curve.tables) > 1]
        names = grouped(((curve.tables[0].voltage, curve.tables[-1].voltage), curve.name) for curve in several)
        return {bounds: " and ".join(curves) for bounds, curves in names.items()}

    @cached_property
    def voltage_range(self) -> tuple[float, float]:
        """The range of the voltage, V, beyond which no curve changes: that of the tables if all curves have several."""
        if any(len(curve.tables) < 2 for curve in self.curves):
            return 0.0, inf
        lows, highs = zip(*self.voltage_ranges, strict=True)
        return min(lows), max(highs)

    @cached_property
    def usual_inputs(self) -> dict[str, float]:
        """The inputs that are not given: no command, load or current, and the usual voltage."""
        return {name: declaration.start for name, declaration in self.inputs.items()}

    @cached_property
    def velocities(self) -> dict[str, Declaration]:
        """The velocities through the water, which are the first states."""
        return {axis.velocity: velocity_declaration(axis) for axis in self.bare_axes}

    @cached_property
    def pose(self) -> dict[str, Declaration]:
        """The position, and the heading or the quaternion, as far as the axes change them.

        These states come after the velocities.
        """
        if self.has_attitude:
            return (POSITION if self.has(SURGE, SWAY, HEAVE) else {}) | ATTITUDE
        changed = {"x": (SURGE, SWAY), "y": (SURGE, SWAY), "z": (HEAVE,)}
        position = {name: declaration for name, declaration in POSITION.items() if self.has(*changed[name])}
        return position | (HEADING if self.has(YAW) else {})

    @cached_property
    def over_ground(self) -> dict[str, Declaration]:
        """The velocity over ground north, east and down: the derivatives of the position."""
        axes = (axis for x, axis in EARTH.items() if x in self.pose)
        return {over_ground_name(letter): over_ground_declaration(letter, words) for letter, words in axes}

    @cached_property
    def lagging(self) -> dict[str, Declaration]:
        """The forces and the speeds of rotors that follow the commands with a lag, which are the last states."""
        curves = ((t, self.curve_of[t.name]) for t in self.thrusters)
        return {
            curve.lagging(t.name): rotor_declaration(t) if curve.has_rotors else thrust_declaration(t, curve)
            for t, curve in curves
            if curve.has_lag
        }

    @cached_property
    def state(self) -> dict[str, Declaration]:
        """All states in their order."""
        return self.velocities | self.pose | self.lagging

    @cached_property
    def calculated(self) -> dict[str, Declaration]:
        """The calculated variables that are neither states nor rates."""
        return self.thrust | self.angles | self.outside | self.motion_of_points | self.added

    @cached_property
    def electric(self) -> dict[str, Declaration]:
        """The electric current and the power of the thrusters, if the curves have tables of the current."""
        return electric_declarations(self.thrusters) if any(curve.electric_current for curve in self.curves) else {}

    @cached_property
    def added(self) -> dict[str, Declaration]:
        """The calculated variables that were added after the first release: last, so that no value reference moves."""
        return self.over_ground | self.electric

    @cached_property
    def thrust(self) -> dict[str, Declaration]:
        """The forces of the thrusters that are no states, and the torque of the thrusters of each curve.

        They are those before the tuning α.
        """
        forces = {f"F_{t.name}": thrust_declaration(t, self.curve_of[t.name]) for t in self.thrusters}
        torques = {f"tau_{curve.name}": torque_declaration(curve) for curve in self.turning_curves}
        return {name: declaration for name, declaration in forces.items() if name not in self.lagging} | torques

    @cached_property
    def angles(self) -> dict[str, Declaration]:
        """The Euler angles, which are calculated from the quaternion."""
        return ANGLES if self.has_attitude else {}

    @cached_property
    def outside(self) -> dict[str, Declaration]:
        """The output that says how far the vehicle is outside of what was identified, if the ranges are known."""
        return {"outside": OUTSIDE} if self.identified else {}

    @cached_property
    def at_rest(self) -> dict[str, float]:
        """The states of a vehicle that is at rest at the origin, is level and heads north."""
        return dict.fromkeys(self.state, 0.0) | ({"eta": 1.0} if self.has_attitude else {})

    @cached_property
    def initial(self) -> dict[str, Declaration]:
        """The parameters that give the attitude at the start."""
        return ANGLES_AT_START if self.has_attitude else {}

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """All variables in their one order: that of modelDescription.xml, the arrays of the C code, and the groups."""
        rates, last = map(rate_name, self.state), [*self.health.values(), *(SURFACE if self.surface else ())]
        calculated = (name for name in self.calculated if name not in self.added)
        parameters = (name for name in (*self.coefficients, *self.initial) if name not in last)
        return (*self.inputs, *self.state, *rates, *calculated, *self.memory, *parameters, *last, *self.added)

    @cached_property
    def places(self) -> dict[str, int]:
        """The place of each variable in this order. It is the index in the arrays of the C code."""
        return {name: place for place, name in enumerate(self.variables)}

    @cached_property
    def turning_curves(self) -> tuple[Curve, ...]:
        """The curves whose thrusters turn the vehicle."""
        driving = {t.curve for t in self.thrusters_along(YAW)} if self.has(YAW) else set()
        return tuple(curve for curve in self.curves if curve.name in driving)
