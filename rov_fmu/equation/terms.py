"""The equation of motion of a vehicle as a table of terms.

In Fossen's notation, with the velocities nu = (u, v, w, p, q, r) through the water and the pose eta,

    M nu' + C(nu) nu + D(nu) nu + g(eta) = tau,    eta' = J(eta) nu + current.

    M            mass with added mass and tuning       mass_matrix here, MassMatrix.parameters (mass.py)
    C(nu) nu     Coriolis and Munk terms               MassMatrix.coriolis (mass.py)
    D(nu) nu     linear and quadratic damping, lift    _drag (forces.py)
    g(eta)       weight and buoyancy                   _restoring, or the net weight in _loads (forces.py)
    tau          thrust, its loss with speed, fins,    _loads, advance, _steering, _at_points (forces.py),
                 loads from outside, forces at points  from the commands: thrust_formulas (thrust.py)
    J(eta) nu    kinematics                            _Table.pose here, rotation_terms (attitude.py)

Multiplied by M^-1, and with the cosine and sine of the heading (or the rotation matrix) as states, this is a quadratic
system of ordinary differential equations, as long as no velocity reverses and the inputs are held:

    y_i' = k_i + sum of L_ij y_j + sum of Q_ijk y_j y_k.

`equation_of` derives this table from the layout of a vehicle: the states y, the terms in the rate of each state, and a
formula for each coefficient. `python/step.py` computes a step from it in Python, and the C code is generated from it. A
new effect is a new force (forces.py).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from operator import mul

from rov_fmu.io.groups import grouped

from .attitude import (
    TURN,
    angle_formulas,
    entry,
    quaternion_formulas,
    quaternion_rates,
    rotation_formulas,
    rotation_terms,
)
from .catalogue import (
    BELOW_SURFACE,
    CURRENT,
    CURRENT_DOWN,
    EARTH,
    GRAVITY,
    HEAVE,
    OUT_OF_WATER,
    POINT,
    SURGE,
    SWAY,
    YAW,
    cross_name,
    over_ground_name,
)
from .expression import ONE, ZERO, Expression, Formulas, Name, Names, Operation, call, of, product, total, where
from .forces import (
    AT_SURFACE,
    COUPLING,
    KINEMATICS,
    POINTS,
    WAVES,
    Effect,
    Force,
    above,
    advance,
    forces_of,
    rotation,
    thrusts,
)
from .layout import Layout
from .mass import MassMatrix
from .parts import EVERY_COMMAND, CommandTable, Curve, Range
from .thrust import Lag, add_rotor, lags_of, steady_name, thrust_formulas


@dataclass(frozen=True)
class Term:
    """A term in the rate of a state: a coefficient alone, or a coefficient times one or two states."""

    coefficient: Expression
    factors: tuple[str, ...] = ()
    """The states that are multiplied with the coefficient."""
    effect: Effect | None = None
    """The effect of the force that the term belongs to; None for a term of the kinematics or of a lag."""

    @property
    def formula(self) -> Expression:
        """The term as a formula."""
        return product(self.coefficient, *map(Name, self.factors))


@dataclass(frozen=True)
class Equation:
    """The equation of motion of a vehicle. Formulas are evaluated in their order, and each may use those before it.

    From the table follow, in this order: its states, and which of them the formulas of the orientation and the depth
    set; which states depend on which, and so the components that are solved one after the other; what ends a piece of a
    step, and what lags; all formulas as one program, and the rates of the vehicle's states; the functions of tables.
    """

    parameters: Mapping[str, Expression]
    """Formulas for the numbers that follow from the coefficients alone."""
    directed: Mapping[str, Operation]
    """The coefficients that depend on the direction of a velocity."""
    thrust: Mapping[str, Expression]
    """Formulas from the commands to the steady thrust of every thruster."""
    forces: Mapping[str, Expression]
    """Formulas for torques and other outputs, and for the accelerations that are constant while the inputs are held."""
    rows: Mapping[str, tuple[Term, ...]]
    """The terms in the rate of every state of the table."""
    starts: Mapping[str, Expression]
    """How a step begins: each state of the table from the vehicle's states, and `square_length`, which some of these
    formulas use. Positions begin at 0, because the step returns their change; so do the arrived fractions. A velocity
    through the water changes at the start where the current passes the vehicle."""
    lags: tuple[Lag, ...]
    outputs: Mapping[str, Expression] = field(default_factory=dict)
    """Formulas for calculated variables that follow from the states, the orientation and the other formulas, and for
    what they need."""
    ends: Mapping[str, Expression] = field(default_factory=dict)
    """Formulas for the states of the vehicle that are neither in the table nor lag, from the states of the table."""
    tables: Mapping[str, CommandTable] = field(default_factory=dict)
    """The tables that the formulas call, by their names."""
    names: Names = field(default_factory=Names)
    """The names of the quantities of the equation."""

    # ---- The states of the table ----

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The states of the table."""
        return tuple(self.rows)

    @cached_property
    def states_in_rate(self) -> dict[str, frozenset[str]]:
        """For each state, the states in its rate."""
        return {
            name: frozenset(factor for term in terms for factor in term.factors) for name, terms in self.rows.items()
        }

    @cached_property
    def shifted(self) -> dict[str, Expression]:
        """The formulas of the states that follow from the depth of a vehicle with a surface."""
        return {name: self.starts[name] for name in (BELOW_SURFACE, OUT_OF_WATER) if name in self.starts}

    @cached_property
    def orientation(self) -> dict[str, Expression]:
        """Formulas for the orientation in the table.

        It is the cosine and the sine of the heading, or the rotation matrix with its helper `square_length`.
        """
        return {
            name: formula for name, formula in self.starts.items() if name not in formula.names | self.shifted.keys()
        }

    @cached_property
    def used(self) -> frozenset[str]:
        """The states that a term contains, and the orientation. The other states are integrals of these.

        In `rows`, the used states come first, so that C needs one number, N_USED, to tell states from integrals.
        """
        return frozenset(self.orientation.keys() & self.rows.keys()).union(*self.states_in_rate.values())

    # ---- Which states depend on which ----

    @cached_property
    def _reach(self) -> dict[str, set[str]]:
        """For each state, the states on which it depends, directly or through others."""
        reach = {name: set(states) for name, states in self.states_in_rate.items()}
        for middle in self.states:
            for name in self.states:
                if middle in reach[name]:
                    reach[name] |= reach[middle]
        return reach

    @cached_property
    def _settling(self) -> frozenset[str]:
        """The used states that may settle."""
        return self.used - self.orientation.keys()

    @cached_property
    def components(self) -> tuple[tuple[str, ...], ...]:
        """Groups of states that depend on each other. Each group comes after those that it depends on.

        The groups that may settle come before the kinematic ones.
        """
        reach = self._reach
        groups = dict.fromkeys(
            tuple(n for n in self.states if n == name or (n in reach[name] and name in reach[n]))
            for name in self.states
        )
        done: list[tuple[str, ...]] = []
        while groups:
            placed = {name for group in done for name in group}
            done.append(next(g for g in groups if all(reach[name] <= placed.union(g) for name in g)))
            del groups[done[-1]]
        settling = self._settling.union(*(reach[name] for name in self._settling))
        return tuple(sorted(done, key=settling.isdisjoint))

    @cached_property
    def dynamic(self) -> tuple[tuple[str, ...], ...]:
        """The components that may settle. The others are kinematic: only the heading and integrals."""
        last = max(n for n, group in enumerate(self.components) if not self._settling.isdisjoint(group))
        return self.components[: last + 1]

    # ---- What ends a piece of a step, and what lags ----

    @cached_property
    def monitored(self) -> tuple[str, ...]:
        """The velocities whose reversals end a piece of a step."""
        return tuple(name for name in self.states if any(Name(name) == x.args[0] for x in self.directed.values()))

    @property
    def has_rotors(self) -> bool:
        """True when the speeds of rotors lag, which may reverse."""
        return any(lag.reversals for lag in self.lags)

    @cached_property
    def lagging(self) -> dict[str, tuple[Expression, Expression]]:
        """For each force or speed that lags: the formulas of its rate, and of its value after a piece of a step."""
        return {
            force: (
                lag.rate * (Name(steady) - Name(force)),
                Name(force) + (Name(steady) - Name(force)) * Name(lag.arrived),
            )
            for lag in self.lags
            for force, steady in lag.steady.items()
        }

    def _is_lag(self, term: Term) -> bool:
        """Return True for a term with the arrived fraction of a lag. Such a term is 0 at the start of a piece."""
        return any(lag.arrived in term.factors for lag in self.lags)

    # ---- The formulas as a whole ----

    @cached_property
    def program(self) -> dict[str, Expression]:
        """All formulas from the inputs, states and coefficients of a vehicle to the numbers in its thrust and rates."""
        lags = [term.coefficient.names for terms in self.rows.values() for term in terms if self._is_lag(term)]
        by_lag = frozenset().union(*lags)
        by_lag = by_lag.union(*(self.forces[name].names for name in by_lag & self.forces.keys()))
        forces = {name: formula for name, formula in self.forces.items() if name not in by_lag}
        return {**self.parameters, **self.shifted, **self.directed, **self.orientation, **self.thrust, **forces}

    @cached_property
    def rates(self) -> dict[str, Expression]:
        """The time derivative of each state of the vehicle, as a formula of its states and of `program`."""
        rates = {name: rate for name, (rate, _) in self.lagging.items()}
        for name, terms in self.rows.items():
            rates[name] = rate_formula(term for term in terms if not self._is_lag(term))
        if self.ends:
            rates |= quaternion_rates(frozenset(self.states))
        return rates

    @cached_property
    def unloaded(self) -> "Equation":
        """The equation while all inputs in the earth frame are 0. Fewer of its states depend on each other."""
        earth = POINTS, WAVES
        rows = {name: tuple(term for term in terms if term.effect not in earth) for name, terms in self.rows.items()}
        return replace(self, rows=rows)

    # ---- Tables ----

    @cached_property
    def measured(self) -> dict[str, Callable[[float], float]]:
        """The functions of all tables, from a command to the force (N) or the current (A), by their names."""
        return {name: table.value for name, table in self.tables.items()}

    @property
    def thrust_tables(self) -> dict[str, CommandTable]:
        """The tables of thrust. Those of electric current are for `outputs` alone."""
        return {name: table for name, table in self.tables.items() if table.kind == "thrust"}


def rate_formula(terms: Iterable[Term]) -> Expression:
    """Return the rate of a state as one formula."""
    return total(term.formula for term in terms)


@lru_cache(maxsize=100)
def equation_of(layout: Layout) -> Equation:
    """Return the equation of motion of a vehicle: (18) with the coupling, the lags and the kinematics.

    Raises ValueError when two tables have the same name.
    """
    rotation, quaternion, angles = (
        (rotation_formulas(), quaternion_formulas(), angle_formulas()) if layout.has_attitude else ({}, {}, {})
    )
    table = _Table(layout, Names([*layout.places, *rotation, *quaternion, BELOW_SURFACE, OUT_OF_WATER]))
    rows: Rows = {v: table.motion(v) for v in layout.velocities}
    pose = table.pose()
    if layout.surface:
        rows |= dict.fromkeys(above(layout), pose["z"])  # the forces change where these states are 0
    pose = {name: terms for name, terms in pose.items() if name not in rows}
    attitude = _attitude(layout)
    if layout.restoring and attitude:  # the restoring forces contain the third row
        rows |= {entry(3, n): attitude.pop(entry(3, n)) for n in (1, 2, 3)}
    for lag in table.lags:
        rows[lag.arrived] = Term(lag.rate), Term(-lag.rate, (lag.arrived,))
    rows |= attitude | pose
    used = {factor for terms in rows.values() for term in terms for factor in term.factors}.union(layout.velocities)
    starts: dict[str, Expression] = {name: Name(name) for name in layout.state if name in used}
    if TURN[0] in rows:
        starts |= {"cos_psi": call("cos", Name("psi")), "sin_psi": call("sin", Name("psi"))}
    starts |= rotation | _after_current(layout)
    if layout.surface:
        depth: Expression = Name("z")
        if layout.waves:
            depth = starts[BELOW_SURFACE] = depth + Name("elevation")
        starts[OUT_OF_WATER] = depth + Name("height")
    return Equation(
        table.parameters,
        table.directed,
        thrust_formulas(layout, table.names),
        table.forces,
        {name: rows[name] for name in sorted(rows, key=lambda name: name not in used | starts.keys())},
        starts,
        table.lags,
        outputs={
            **angles,
            **_outside(layout, table.names),
            **_over_ground(layout, rows),
            **_motion_of_points(layout),
            **_electric(layout, table.names),
        },
        ends=quaternion,
        tables=_tables(layout),
        names=table.names,
    )


def _tables(layout: Layout) -> dict[str, CommandTable]:
    """Return the tables by the functions that formulas call. Raises ValueError when two have the same name."""
    measured = [table for curve in layout.curves for table in (*curve.tables, curve.electric_current) if table]
    tables = {table.function: table for table in measured}
    if len(tables) < len(measured):
        raise ValueError("two tables have the same name")
    return tables


# ---- Parts of the equation -------------------------------------------------------------------------------------------


class _Table:
    """The rows of the table of terms, and the formulas of their coefficients, which each row adds.

    `motion` makes the rows of the velocities from `_term` and `_arriving`, in which a formula becomes a `_named`
    number, and `pose` those of the position and the heading.
    """

    def __init__(self, layout: Layout, names: Names) -> None:
        self.layout, self.names = layout, names
        self._mass = mass_matrix(layout, names)
        self._declared = [*forces_of(layout, names)]
        self.lags = lags_of(layout, names)
        self.parameters = _parameters(layout, self._mass, self.lags)
        self.directed: dict[str, Operation] = {}
        self.forces = Formulas(names)
        for name, curve in layout.curve_of.items():
            if curve.has_rotors:
                add_rotor(self.forces, name, curve, Name(layout.health[name]))
        self.forces |= {
            f"tau_{curve.name}": total(thrusts(layout, YAW, names, curve)) for curve in layout.turning_curves
        }

    def _is_constant(self, formula: Expression) -> bool:
        """Return True for a formula of coefficients alone."""
        return formula.names <= self.layout.coefficients.keys() | self.parameters.keys()

    def _named(self, formula: Expression, kind: str, *owners: str) -> Name:
        """Return a name for a formula, which becomes one of `parameters` or of `forces`."""
        return (self.parameters if self._is_constant(formula) else self.forces).define(formula, kind, *owners)

    def motion(self, v: str) -> tuple[Term, ...]:
        """Return the terms of the acceleration of an axis, (18).

        A force along another axis accelerates this one through the inverse of the mass matrix.
        """
        inverse = self._mass.inverse(v)
        loads: dict[str, list[Expression]] = {other: [] for other in inverse}
        alike: dict[tuple[Effect, tuple[str, ...]], list[Force]] = {}
        for force in (force for force in self._declared if force.axis in inverse):
            if force.factors:
                alike.setdefault((force.effect, force.factors), []).append(force)
            else:
                loads[force.axis].append(force.formula)
        if len({(effect.name, frozenset(factors)) for effect, factors in alike}) < len(alike):
            raise ValueError("a force with another power of the same states needs an effect of its own")
        constant = total(gain * total(loads[other]) for other, gain in inverse.items())
        coriolis = self._mass.coriolis(v) if self.layout.coupled else {}
        has_one_product = len(coriolis) == 1
        return (
            Term(self._named(constant, "constant", v)),
            *self._arriving(v, inverse),
            *(self._term(v, forces, inverse) for forces in alike.values()),
            *(
                Term(self._named(formula, "coupling", v, *([] if has_one_product else ["".join(pair)])), pair, COUPLING)
                for pair, formula in coriolis.items()
            ),
        )

    def _arriving(self, v: str, inverse: Mapping[str, Name]) -> Iterator[Term]:
        """Yield, for each lag, the change of acceleration until the thrust is steady, in powers of what has arrived."""

        def change_of(thruster: str, curve: Curve) -> Expression:
            return steady_name(thruster, curve, self.names) - Name(f"F_{thruster}")

        def of_rotor(kind: str) -> Callable[..., Expression]:
            return lambda thruster, *_: self.names(kind, thruster)

        for lag in self.lags:
            curve, arrived = lag.curve, lag.arrived
            powers = {"arriving": change_of}
            if curve.has_rotors:
                powers = {"arriving": of_rotor("rise"), "arriving_squared": of_rotor("bend")}
            for power, (kind, of_thruster) in enumerate(powers.items(), 1):
                changes = []
                for other, gain in inverse.items():
                    axis = self.layout.by_velocity[other].axis
                    if arriving := thrusts(self.layout, axis, self.names, curve, of_thruster):
                        changes.append(gain * (Name(axis.coefficient("alpha")) * total(arriving)))
                if changes:
                    name = self._named(total(changes), kind, v, curve.name)
                    yield Term(name, (arrived,) * power)
                    for state in above(self.layout):
                        yield Term(self._above(Name(state)) * name, (arrived, state), AT_SURFACE)
            rising = advance(self.layout, self.names, curve, of_rotor("loss_rise")) if curve.has_rotors else ()
            along = [(force.factors[0], force.along(inverse[force.axis])) for force in rising if force.axis in inverse]
            for other, parts in grouped(along).items():
                yield Term(self._named(total(parts), "arriving_loss", v, other, curve.name), (arrived, other))

    def _term(self, v: str, forces: Sequence[Force], inverse: Mapping[str, Name]) -> Term:
        """Return the sum of forces with one effect and equal factors.

        Raises ValueError if they depend on directions in a way that the equation cannot have.
        """
        first, directions = forces[0], {force.velocity for force in forces} - {""}
        ahead, astern = (
            total(force.along(inverse[force.axis], reverse=reverse) for force in forces) for reverse in (False, True)
        )
        own = first.effect.name, v, *(() if set(first.factors) == {v} else dict.fromkeys(first.factors))
        if not directions:
            return Term(self._named(ahead, *own), first.factors, first.effect)
        velocity, *others = map(Name, directions)
        if others:
            raise ValueError("a force with the direction of another velocity needs an effect of its own")
        if first.effect is AT_SURFACE:  # equal for both states
            rest = (state for state in first.factors if state != velocity.identifier)
            coefficient: Expression = self._above(velocity) * self._named(astern, first.effect.name, v, *rest)
        elif self._is_constant(ahead) and self._is_constant(astern):
            coefficient = self.names(*own)
            self.directed[self.names(*own).identifier] = Operation("directed", (velocity, ahead, astern))
        elif all(force.along() == -force.along(reverse=True) for force in forces):
            direction = self.names("direction", velocity.identifier)
            self.directed[direction.identifier] = Operation("directed", (velocity, ONE, -ONE))
            coefficient = direction * self._named(ahead, *own)
        else:
            raise ValueError("a force whose size depends on a direction may contain coefficients alone")
        return Term(coefficient, first.factors, first.effect)

    def _above(self, state: Name) -> Name:
        """Return a coefficient that is 1/H with its sign while a state is negative, and 0 otherwise."""
        side = self.names("beyond", state.identifier)
        self.directed[side.identifier] = Operation(
            "directed", (state, ZERO, above(self.layout)[state.identifier] * self.names("per_height"))
        )
        return side

    def pose(self) -> dict[str, tuple[Term, ...]]:
        """Return the rows of the pose, which follows from the velocities and a steady current.

        A vehicle without yaw always heads north, so its cos_psi is 1 and its sin_psi is 0.
        """
        layout = self.layout
        rows: dict[str, tuple[Term, ...]] = {}
        if layout.has_heading_states:
            rows = {"cos_psi": (Term(-ONE, ("r", "sin_psi")),), "sin_psi": (Term(ONE, ("r", "cos_psi")),)}
        for x, current, row in zip("xyz", CURRENT | CURRENT_DOWN, rotation(layout), strict=True):
            if x in layout.pose:
                steady = [Term(self._named(Name(current), "constant", x))] if current in layout.inputs else []
                turned = [(v, part) for v, part in zip("uvw", row, strict=True) if v in layout.velocities]
                moving = (Force(KINEMATICS, x, Name(v) * part) for v, part in turned if part != ZERO)
                rows[x] = (*steady, *(Term(one.along(), one.factors) for one in moving))
        if "psi" in layout.pose:
            rows["psi"] = (Term(ONE, ("r",)),)
        return rows


Rows = dict[str, tuple[Term, ...]]


def mass_matrix(layout: Layout, names: Names) -> MassMatrix:
    """Return the mass matrix with the tuning of (18)."""
    gains: dict[str, Expression] = {}
    for vehicle_axis in layout.axes:
        inertia: Expression = Name(vehicle_axis.axis.inertia)
        if "m_a" in vehicle_axis.keys:
            inertia = inertia + Name(vehicle_axis.coefficient("m_a"))
        gains[vehicle_axis.axis.velocity] = Name(vehicle_axis.axis.coefficient("beta")) / inertia
    entries = {}
    for pair, sums in _inertia_of_two_axes(layout).items():
        betas = product(*(Name(f"beta_{axis}") for axis in pair if axis in gains))
        entries[pair] = total(sums) / call("sqrt", betas)
    return MassMatrix(gains, entries, names)


def _inertia_of_two_axes(layout: Layout) -> dict[tuple[str, str], list[Expression]]:
    """Return the parts of the entries beside the diagonal, before the tuning: added mass, and the centre of mass."""
    parts: dict[tuple[str, str], list[Expression]] = {}
    for key, *axes in layout.cross:
        if key == "m_a":
            parts.setdefault((axes[0], axes[1]), []).append(Name(cross_name(key, *axes)))
    # with the coupling, momentum along an axis that the vehicle lacks still acts on its other axes
    moves = layout.coupled and layout.has(SURGE, SWAY, HEAVE)
    for pair, (sign, coordinate) in _OF_CENTRE.items():
        present = [axis for axis in pair if axis in layout.by_velocity]
        if coordinate in layout.restoring and (len(present) == 2 or (present and moves)):
            parts.setdefault(pair, []).append(sign * (Name("m_rov") * Name(coordinate)))
    return parts


_OF_CENTRE = {
    ("u", "q"): (1, "z_G"),
    ("u", "r"): (-1, "y_G"),
    ("v", "p"): (-1, "z_G"),
    ("v", "r"): (1, "x_G"),
    ("w", "p"): (1, "y_G"),
    ("w", "q"): (-1, "x_G"),
}
"""The entries of the mass matrix that follow from a centre of mass outside the origin, divided by the mass. Each is a
sign and a coordinate."""


def _parameters(layout: Layout, mass: MassMatrix, lags: Iterable[Lag]) -> Formulas:
    """Return formulas for the inverse of the mass matrix (18), the arm (4), the lags' rates, and restoring."""
    formulas = mass.parameters()
    if layout.has_arm:
        formulas.define(Name("R") * call("sin", Name("gamma")), "arm")
    for lag in lags:
        formulas[lag.rate.identifier] = 1.0 / Name(lag.curve.coefficient("T"))
    if layout.restoring:
        formulas.define(Name("W") - Name("B"), "net_weight")
        for axis in "xyz":
            moments = (1, "W", f"{axis}_G"), (-1, "B", f"{axis}_B")
            own = [(sign, Name(force) * Name(centre)) for sign, force, centre in moments if centre in layout.restoring]
            formulas.define(total(sign * moment for sign, moment in own), "righting", axis)
    if layout.surface:
        formulas.define(1.0 / Name("height"), "per_height")
        if not layout.restoring:
            heave = layout.by_name[HEAVE.name]
            load = [-Name(heave.coefficient("F_0"))] if "F_0" in heave.keys else []
            formulas.define(total([GRAVITY * Name("m_rov"), *load]), "buoyancy")
    return formulas


def _after_current(layout: Layout) -> dict[str, Expression]:
    """Return formulas for the velocities through the water after a change of the current that passes the vehicle.

    The velocity over ground stays, so that nu changes by -R^T times the change of the current.
    """
    change = [Name(name) - Name(before) for name, before in layout.before.items()]
    changed = zip("uvw"[: len(change)], zip(*rotation(layout), strict=True), strict=False)
    return {
        v: Name(v) - total(x * part for x, part in zip(column, change, strict=False))
        for v, column in changed
        if v in layout.velocities
    }


def _attitude(layout: Layout) -> dict[str, tuple[Term, ...]]:
    """Return the rows of the rotation matrix, if the vehicle rolls or pitches."""
    terms = rotation_terms(frozenset(layout.velocities)) if layout.has_attitude else {}
    return {name: tuple(Term(of(sign), factors) for sign, factors in own) for name, own in terms.items()}


def _outside(layout: Layout, names: Names) -> dict[str, Expression]:
    """Return formulas for the output `outside`, if the identified ranges are known.

    Each quantity x with the range [low, high] gives max(x - high, low - x, 0) / (high - low), and the largest of these
    counts. A range always includes 0, from where every motion begins. Of a command, the size counts.
    """
    if not layout.identified:
        return {}
    formulas = Formulas(names)
    limited = {*layout.velocities, *(name for name in ("phi", "theta") if name in layout.angles)}
    largest: Expression = of(0.0)
    for one in layout.identified:
        quantities: dict[tuple[str, ...], Expression] = {(one.name,): Name(one.name)} if one.name in limited else {}
        if one.name == EVERY_COMMAND:
            quantities = {(one.name, t.name): abs(names("command", t.name)) for t in layout.thrusters}
        for owners, x in quantities.items():
            beyond = formulas.define(_beyond(x, one), "outside", *owners)
            largest = formulas.define(where(largest < beyond, beyond, largest), "largest", *owners)
    return {**formulas, "outside": largest}


def _over_ground(layout: Layout, rows: Mapping[str, Sequence[Term]]) -> dict[str, Expression]:
    """Return formulas for the velocity of the vehicle over ground."""
    return {over_ground_name(letter): rate_formula(rows[x]) for x, (letter, _) in EARTH.items() if x in layout.pose}


def _electric(layout: Layout, names: Names) -> dict[str, Expression]:
    """Return formulas for the electric current and the power of the thrusters, which follow the commands without lag.

    The current is that of its table, at any voltage of the battery.
    """
    formulas: dict[str, Expression] = {}
    for name, curve in layout.curve_of.items():
        if table := curve.electric_current:
            current, voltage = f"electric_current_{name}", of(table.voltage)
            formulas[current] = call(table.function, names("command", name))
            formulas[f"electric_power_{name}"] = (voltage if layout.voltage is None else names("battery")) * Name(
                current
            )
    for total_of in ("electric_current", "electric_power") if formulas else ():
        formulas[total_of] = total(Name(f"{total_of}_{thruster.name}") for thruster in layout.thrusters)
    return formulas


def _motion_of_points(layout: Layout) -> dict[str, Expression]:
    """Return formulas for the position of each point, that of the vehicle and R r, and for the velocity over ground."""
    formulas: dict[str, Expression] = {}
    omega = [Name(v) if v in layout.velocities else of(0.0) for v in "pqr"]
    for point in layout.points:
        r = [Name(point.coefficient(key)) for key in POINT]
        turning = [omega[n - 2] * r[n - 1] - omega[n - 1] * r[n - 2] for n in range(3)]  # omega x r
        for (x, (letter, _)), row in zip(EARTH.items(), rotation(layout), strict=True):
            velocity = over_ground_name(letter)
            at, moving = (Name(name) if x in layout.pose else of(0.0) for name in (x, velocity))
            formulas[point.coordinate(x)] = at + total(map(mul, row, r))
            formulas[point.coordinate(velocity)] = moving + total(map(mul, row, turning))
    return formulas


def _beyond(x: Expression, known: Range) -> Expression:
    """Return how far a quantity is beyond a range, relative to the range with 0 in it."""
    low, high = min(known.low, 0.0), max(known.high, 0.0)
    beyond = where(x > high, x - high, where(x < low, low - x, 0.0))
    return beyond / (high - low)
