"""The forces and moments along the axes of a vehicle. Each is declared once, by a function that `forces_of` calls.

The table of terms (terms.py), the motion of one axis alone (alone.py), the dependencies and derivatives, and the
equations on the page of an FMU follow from these declarations. So does what other simulators lack, and what the page
lists as left out, from the effects.
"""

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from .attitude import ROTATION, TURN, entry
from .catalogue import (
    BELOW_SURFACE,
    BY_VELOCITY,
    GRAVITY,
    HEADING,
    HEAVE,
    OUT_OF_WATER,
    PITCH,
    POINT,
    POSITION,
    REVERSE,
    ROLL,
    YAW,
    Axis,
    cross_name,
)
from .expression import ONE, ZERO, Expression, Name, Names, Operation, directed, product, total
from .layout import Layout
from .parts import FAINT, Curve, Thruster, effect_along


@dataclass(frozen=True)
class Effect:
    """What a force comes from, or what changes it."""

    name: str
    """The beginning of the names of its coefficients."""
    words: str
    """What people read: "the fins"."""
    missed: str = ""
    """What the model card calls it in "There is no lag, delay ..."; empty if nobody expects it."""


THRUST = Effect("thrust", "the thrust")
LOAD = Effect("load", "the constant load and the load from outside")
WEIGHT = Effect("weight", "the net weight")
LINEAR = Effect("linear", "linear drag")
QUADRATIC = Effect("quadratic", "quadratic drag")
LIFT = Effect("lift", "lift of the hull")
RESTORING = Effect("restoring", "weight and buoyancy")
COUPLING = Effect("coupling", "Coriolis and Munk terms")
LAG = Effect("lag", "the lag of the thrust (T)", "lag")
ROTOR_LAG = Effect("rotor lag", "the lag of the rotors' speed (T)", LAG.missed)
DEAD_BAND = Effect("dead band", "the dead band (c_0)", "dead band")
DEAD_TIME = Effect("dead time", "the dead time (T_d)", "delay")
ADVANCE = Effect("advance", "the loss of thrust by the speed of advance (d)", "loss of thrust with speed")
STEERING = Effect("steering", "the fins")
POINTS = Effect("points", "the forces at points")
WAVES = Effect("waves", "the acceleration of the water")
AT_SURFACE = Effect("surface", "the surface, above which buoyancy and thrust fade out")
KINEMATICS = Effect("kinematics", "the kinematics, which are no force")
EXPECTED = (LAG, DEAD_BAND, DEAD_TIME, ADVANCE)
"""The effects that a reader expects of thrusters, and is told about where a model lacks them."""


STATES = frozenset([*BY_VELOCITY, *POSITION, *HEADING, *TURN, *ROTATION, BELOW_SURFACE, OUT_OF_WATER])
"""The states of the table of terms that a force may contain."""


@dataclass(frozen=True)
class Force:
    """A force or moment along an axis as a formula: a coefficient, alone or times one or two states of the table.

    Quadratic drag is `Force(QUADRATIC, "u", -(a_d * abs(u) * u))`: of one or two factors in the formula, |u| stands for
    a state as u does. `directed(u, a, b)` in the place of a_d is the coefficient a ahead and b astern.
    """

    effect: Effect
    axis: str
    """The velocity of the axis."""
    formula: Expression

    def __post_init__(self) -> None:
        """Raise ValueError for a force that the equation cannot have."""
        hidden = STATES & (self.along().names | self.along(reverse=True).names)
        if hidden or len(self.factors) > 2 or len(self._directions) > 1:
            reason = "must be a coefficient times at most two states, and depend on the direction of one (terms.py)"
            raise ValueError(f"{self.effect.words}: {reason}")

    @cached_property
    def _parts(self) -> tuple[int, tuple[Expression, ...]]:
        """The sign and the factors of the formula."""
        sign, rest, factors = 1, self.formula, list[Expression]()
        while isinstance(rest, Operation) and rest.op in ("*", "neg"):
            sign = -sign if rest.op == "neg" else sign
            factors = [*rest.args[1:], *factors]
            rest = rest.args[0]
        for n, x in enumerate(factors):
            if isinstance(x, Operation) and x.op == "neg" and _state(x.args[0]):
                sign, factors[n] = -sign, x.args[0]
        return sign, (rest, *factors)

    @cached_property
    def factors(self) -> tuple[str, ...]:
        """The states that multiply the coefficient. A force without them is constant while the inputs are held."""
        return tuple(filter(None, map(_state, self._parts[1])))

    @cached_property
    def velocity(self) -> str:
        """The velocity on whose direction the force depends, or an empty text."""
        return "".join(self._directions)

    @property
    def _directions(self) -> set[str]:
        return {*map(_direction, self._parts[1])} - {""}

    def along(self, inverse: Expression = ONE, *, reverse: bool = False) -> Expression:
        """Return the coefficient of an acceleration: `inverse` is the acceleration per load."""
        sign, factors = self._parts
        coefficient = [inverse]
        for x in factors:
            if _state(x):
                sign = -sign if reverse and _direction(x) else sign
            else:
                coefficient.append(x.args[1 + reverse] if isinstance(x, Operation) and _direction(x) else x)
        return sign * product(*coefficient)


def _state(x: Expression) -> str:
    """Return the state that a factor is, also as |v|, or an empty text."""
    if isinstance(x, Operation) and x.op == "abs":
        x = x.args[0]
    return x.identifier if isinstance(x, Name) and x.identifier in STATES else ""


def _direction(x: Expression) -> str:
    """Return the state on whose direction a factor depends, or an empty text."""
    return _state(x.args[0]) if isinstance(x, Operation) and x.op in ("abs", "directed") else ""


def forces_of(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield all forces and moments of a vehicle along its axes, in the order of its equation."""
    yield from _loads(layout, names)
    yield from chain(_drag(layout), _restoring(layout, names), advance(layout, names), _steering(layout, names))
    yield from _at_points(layout)
    if layout.waves:
        yield from _waves(layout, names)
    if layout.surface:
        yield from _surface(layout, names)


def effects_of(layout: Layout) -> list[Effect]:
    """Return the effects that a vehicle has, each once."""
    of_forces = [force.effect for force in forces_of(layout, Names())]
    has = {
        LAG: any(curve.has_lag and not curve.has_rotors for curve in layout.curves),
        ROTOR_LAG: any(curve.has_rotors for curve in layout.curves),
        DEAD_BAND: any("c_0" in curve.keys or curve.tables for curve in layout.curves),  # a table may have one
        DEAD_TIME: layout.has_dead_time,
        COUPLING: layout.coupled,
    }
    return list(dict.fromkeys([*(effect for effect, is_there in has.items() if is_there), *of_forces]))


def left_out(layout: Layout, has: Container[Effect]) -> list[str]:
    """Return the words of the effects of a vehicle that something lacks which has only some effects."""
    return [effect.words for effect in effects_of(layout) if effect not in has]


# ---- The forces ------------------------------------------------------------------------------------------------------


def _loads(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield what is constant while the inputs are held: thrust, external and constant load, and the net weight."""
    for vehicle_axis in layout.axes:
        axis, v = vehicle_axis.axis, vehicle_axis.axis.velocity
        if thrust := _total_thrust(layout, axis, names):
            yield Force(THRUST, v, Name(axis.coefficient("alpha")) * total(thrust))  # tau
        yield Force(LOAD, v, Name(axis.external))  # tau_ext
        if "F_0" in vehicle_axis.keys:
            yield Force(LOAD, v, Name(vehicle_axis.coefficient("F_0")))
        if axis is HEAVE and layout.restoring and not layout.has_attitude:
            yield Force(WEIGHT, v, names("net_weight"))  # W - B


def _total_thrust(layout: Layout, axis: Axis, names: Names) -> list[Expression]:
    """Return the parts of the thrust along an axis."""
    if axis is YAW:  # each of these torques is an output
        return [Name(f"tau_{curve.name}") for curve in layout.turning_curves]
    return thrusts(layout, axis, names)


def thrusts(
    layout: Layout,
    axis: Axis,
    names: Names,
    curve: Curve | None = None,
    force_of: Callable[[str, Curve], Expression] = lambda thruster, _: Name(f"F_{thruster}"),
) -> list[Expression]:
    """Return the thrusts along an axis, or their moments about it: all of them, or only those of a curve.

    `force_of` gives another force of a thruster in place of its thrust, by its name and its curve.
    """
    parts = []
    for t in layout.thrusters_along(axis):
        own = layout.curve_of[t.name]
        if curve in (None, own):
            parts.append(_effect(layout, t, axis) * _with_arm(t, axis, force_of(t.name, own), names))
    return parts


def _effect(layout: Layout, thruster: Thruster, axis: Axis) -> Expression | float:
    """Return the part of a thrust along an axis, or its moment about it, which coefficients change whose geometry is
    uncertain."""
    if not layout.is_uncertain:
        return thruster.effect(axis)
    X, Y, Z = (0.0 if abs(part) < FAINT else part for part in thruster.direction.value)
    x, y, z = thruster.place
    force = Name("g_u") * X, Name("g_v") * Y, ONE * Z
    place = Name("g_r") * x + Name("x_T"), Name("g_r") * y + Name("y_T"), ONE * z
    if not axis.is_rotation:
        return force[axis.place]
    return total(sign * (place[coordinate] * force[direction]) for sign, coordinate, direction in _levers(axis))


def _with_arm(thruster: Thruster, axis: Axis, force: Expression, names: Names) -> Expression:
    """Return the force of a thruster, or its moment where the effect of the thruster is in units of R sin γ."""
    return names("arm") * force if axis is YAW and thruster.position is None and thruster.arm else force


def _drag(layout: Layout) -> Iterator[Force]:
    """Yield the damping D(nu) nu: linear and quadratic drag of each axis, and the cross terms."""
    for one in layout.axes:
        axis, v = one.axis.velocity, Name(one.axis.velocity)
        b_d, a_d = (directed(v, Name(one.coefficient(k)), Name(one.coefficient(k + REVERSE))) for k in ("b_d", "a_d"))
        yield Force(LINEAR, axis, -(b_d * v))  # X_u u
        yield Force(QUADRATIC, axis, -(a_d * abs(v) * v))  # X_|u|u |u| u
    for key, axis, *others in layout.cross:
        coefficient, v, last = Name(cross_name(key, axis, *others)), Name(others[0]), Name(others[-1])
        if key == "b_d":
            yield Force(LINEAR, axis, -(coefficient * v))  # Y_r r
        elif key == "a_d":
            yield Force(QUADRATIC, axis, -(coefficient * abs(v) * v))  # Y_|r|r |r| r
        elif key == "lift":
            yield Force(LIFT, axis, coefficient * v * last)  # Y_uv u v


def _restoring(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield -g(eta), the forces and moments of weight and buoyancy: (W - B) k and (W r_G - B r_B) x k.

    The third row of the rotation matrix is k, which points down.
    """
    if layout.restoring and layout.has_attitude:
        down = rotation(layout)[2]
        weight, arm = _net_weight(layout, names)
        yield from (
            Force(RESTORING, v, formula) for v, formula in _load_along(down, weight, arm) if v in layout.by_velocity
        )


def _net_weight(layout: Layout, names: Names) -> tuple[Expression, dict[str, Expression]]:
    """Return W - B and the coordinates of W r_G - B r_B that a vehicle has. Without W and B, W - B is the load F_0."""
    if not layout.restoring:
        heave = layout.by_name.get(HEAVE.name)
        return Name(heave.coefficient("F_0")) if heave and "F_0" in heave.keys else ZERO, {}
    has = [x for x in "xyz" if {f"{x}_G", f"{x}_B"} & set(layout.restoring)]
    return names("net_weight"), {x: names("righting", x) for x in has}


def _load_along(
    k: Sequence[Expression], force: Expression, arm: Mapping[str, Expression]
) -> Iterator[tuple[str, Expression]]:
    """Yield a force along a direction k of the body, force k, and its moment, arm x k, by the velocities of their axes.

    `arm` has the coordinates of the force times its lever, N.m.
    """
    yield from ((v, force * along) for v, along in zip("uvw", k, strict=True))
    for axis in (ROLL, PITCH, YAW):
        for sign, coordinate, direction in _levers(axis):
            if "xyz"[coordinate] in arm:
                yield axis.velocity, sign * (arm["xyz"[coordinate]] * k[direction])


def _levers(axis: Axis) -> tuple[tuple[int, int, int], ...]:
    """Return the parts of the moment r x F about an axis: a sign, the index of a coordinate, and that of a force."""
    second, third = (axis.place + 1) % 3, (axis.place + 2) % 3
    return (1, second, third), (-1, third, second)


def _waves(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield (m_d - m) R^T A and (m_d r_B - m r_G) x R^T A, what is left of the water's acceleration A.

    In the equation of a small body, M nu' = tau(nu_r) + (m_d + M_A) R^T A with the displaced mass m_d, the current that
    carries the vehicle has the rest, (m + M_A) R^T A (Auton, Hunt and Prud'homme 1988, doi:10.1017/S0022112088003246).
    These are the forces of weight and buoyancy with -A/g in the place of the vertical k.
    """
    weight, arm = _net_weight(layout, names)
    for direction, row in zip("NED", rotation(layout), strict=True):
        share = Name(f"A_{direction}") * (-1.0 / GRAVITY)
        for v, formula in _load_along(row, weight, arm):
            if v in layout.by_velocity and formula.names:
                yield Force(WAVES, v, formula * share)


def advance(
    layout: Layout, names: Names, curve: Curve | None = None, loss_of: Callable[[str], Expression] | None = None
) -> Iterator[Force]:
    """Yield the loss of thrust by the speed of advance: that of all thrusters, or only that of a curve.

    The thrust is F - d |c| v_a, and the speed of advance v_a is linear in the velocities. `loss_of` gives another
    factor of v_a in place of d |c|, by the name of a thruster.
    """
    for axis in layout.bare_axes:
        for other in layout.bare_axes:
            parts = []
            for t in layout.thrusters:
                effect, own = _effect(layout, t, axis) * _effect(layout, t, other), layout.curve_of[t.name]
                is_some = effect != ZERO if isinstance(effect, Expression) else abs(effect) > FAINT
                if "d" in own.keys and curve in (None, own) and is_some:
                    of_thruster = loss_of(t.name) if loss_of else names("loss", t.name)
                    loss = _with_arm(t, axis, of_thruster, names)
                    parts.append(effect * _with_arm(t, other, loss, names))
            if parts:
                lost = Name(axis.coefficient("alpha")) * total(parts)
                yield Force(ADVANCE, axis.velocity, -(lost * Name(other.velocity)))  # T_|n|v |n| v_a


def above(layout: Layout) -> dict[str, int]:
    """Return the signs of what is added above the surface, by state.

    While the state s is negative, each force below the surface adds sign · force · s/H.

    The share of buoyancy and thrust that is left is 1 below, 1 + z/H up to the height H, and 0 above it. Where the
    surface moves, z counts from it.
    """
    return {BELOW_SURFACE if layout.waves else "z": 1, OUT_OF_WATER: -1} if layout.surface else {}


def _surface(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield the buoyancy and the thrust, once for each state of `above`. The table divides them by H."""
    lifting: list[tuple[str, Expression]] = []
    for axis in layout.bare_axes:
        if thrust := _total_thrust(layout, axis, names):
            lifting.append((axis.velocity, Name(axis.coefficient("alpha")) * total(thrust)))
    lifting += [(force.axis, force.formula) for force in advance(layout, names)]
    lifting += [(v, force) for v, force in _buoyancy(layout, names) if v in layout.by_velocity]
    for v, force in lifting:
        yield from (Force(AT_SURFACE, v, product(force, directed(x, 0.0, 1.0), x)) for x in map(Name, above(layout)))


def _buoyancy(layout: Layout, names: Names) -> Iterator[tuple[str, Expression]]:
    """Yield the force -B k and the moment -B r_B x k of the buoyancy, by the velocities of their axes.

    Without W and B in the file, the weight is m g, and the buoyancy is what balances it but for the load F_0 in heave.
    """
    B = Name("B") if "B" in layout.restoring else names("buoyancy")
    if not layout.has_attitude:
        yield HEAVE.velocity, -B
        return
    arm = {x: B * Name(f"{x}_B") for x in "xyz" if f"{x}_B" in layout.restoring}
    yield from ((v, -formula) for v, formula in _load_along(rotation(layout)[2], B, arm))


def _steering(layout: Layout, names: Names) -> Iterator[Force]:
    """Yield the lift of the fins, lift |u|u δ, and their drag, which is proportional to |u|u δ²."""
    ahead, u = (1.0, 0.0, 0.0), Name("u")
    for axis in layout.bare_axes:
        parts = []
        for fin in layout.fins:
            angle = names("angle", fin.name)
            parts.append((fin.effect(axis), Name(fin.coefficient("lift")) * angle))
            if "drag" in fin.keys:
                effect = effect_along(axis, ahead, fin.place)
                parts.append((-effect, Name(fin.coefficient("drag")) * angle * angle))
        acting = total(effect * lift for effect, lift in parts if abs(effect) > FAINT)
        if acting.names:
            yield Force(STEERING, axis.velocity, acting * abs(u) * u)  # Y_uuδ |u| u δ


def _at_points(layout: Layout) -> Iterator[Force]:
    """Yield the forces at points, R^T F, and their moments, r x R^T F. F is held in the earth frame."""
    R = rotation(layout)
    for point in layout.points:
        F, r = [Name(point.force(direction)) for direction in "NED"], [Name(point.coefficient(key)) for key in POINT]
        for axis in layout.bare_axes:
            arms: list[tuple[Expression, int]] = [(ONE, axis.place)]
            if axis.is_rotation:
                arms = [(sign * r[coordinate], direction) for sign, coordinate, direction in _levers(axis)]
            for arm, column in arms:
                for force, row in zip(F, R, strict=True):  # R^T F
                    if row[column] != ZERO:
                        yield Force(POINTS, axis.velocity, row[column] * arm * force)


def rotation(layout: Layout) -> list[list[Expression]]:
    """Return the rotation matrix from the body frame to the earth frame by its rows, as the table of terms has it."""
    if layout.has_attitude:
        return [[Name(entry(row, column)) for column in (1, 2, 3)] for row in (1, 2, 3)]
    c, s = map(Name, TURN) if layout.has(YAW) else (ONE, ZERO)
    return [[c, -s, ZERO], [s, c, ZERO], [ZERO, ZERO, ONE]]
