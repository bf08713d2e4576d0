"""The equation of motion of a vehicle as a table of terms.

Between reversals, and while the inputs are held, the motion is a quadratic system of ordinary differential equations,

    y_i' = k_i + sum of L_ij y_j + sum of Q_ijk y_j y_k.

`equation_of` derives this table from the layout of a vehicle: the states y, the terms in the rate of each state, and a
formula for each coefficient. `step.py` computes a step from it in Python, and the C code is generated from it. A new
effect is a new term with its formula. If the term contains a state that no other term contains, that state also needs
an entry in `starts`, and its row must come before those of the states that no term contains.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

from .attitude import angle_formulas, entry, quaternion_formulas, quaternion_rates, rotation_formulas, rotation_terms
from .catalogue import HEAVE, SURGE, SWAY, YAW, Axis, cross_name
from .expression import Expression, Name, Names, call, directed, of, product, scaled, total
from .forces import Force, forces_of
from .layout import Curve, Layout, ThrustTable, VehicleAxis
from .mass import MassMatrix
from .thrust import steady_name, thrust_formulas


@dataclass(frozen=True)
class Term:
    """A term in the rate of a state: a coefficient alone, or a coefficient times one or two states."""

    coefficient: Expression
    factors: tuple[str, ...] = ()
    """The states that are multiplied with the coefficient."""
    effect: str = ""
    """The name of the effect of a force, as in forces.py, or "coupling"."""

    @property
    def formula(self) -> Expression:
        """The term as a formula."""
        states = map(Name, self.factors)
        if self.factors and self.coefficient in (ONE, -ONE):
            return scaled(1.0 if self.coefficient == ONE else -1.0, product(*states))
        return product(self.coefficient, *states)


ONE = of(1.0)


@dataclass(frozen=True)
class Directed:
    """A coefficient that depends on the direction of a velocity. Every term with it contains that velocity."""

    velocity: str
    forward: Expression
    """The formula for a positive velocity."""
    reverse: Expression
    """The formula for a negative velocity."""

    @property
    def formula(self) -> Expression:
        """One formula for both directions."""
        return directed(Name(self.velocity), self.forward, self.reverse)


@dataclass(frozen=True)
class Equation:
    """The equation of motion of a vehicle. Formulas are evaluated in their order, and each may use those before it."""

    parameters: Mapping[str, Expression]
    """Formulas for the numbers that follow from the coefficients alone."""
    directed: Mapping[str, Directed]
    """The coefficients that depend on the direction of a velocity."""
    thrust: Mapping[str, Expression]
    """Formulas from the commands to the steady thrust of every thruster."""
    forces: Mapping[str, Expression]
    """Formulas for torques and other outputs, and for the accelerations that are constant while the inputs are held."""
    rows: Mapping[str, tuple[Term, ...]]
    """The terms in the rate of every state of the table."""
    starts: Mapping[str, Expression]
    """Formulas from the states of the vehicle to the states of the table at the start of a step, and `square_length`,
    which some of them use. States without a formula start at 0. These are the integrals, which no term contains, and
    the progress of the lags. A state that a term contains must have a formula."""
    lags: Mapping[str, Mapping[str, str]]
    """For the progress of each lag: the forces that lag, each with the name of the steady thrust that it approaches.

    The progress p rises from 0 towards 1 during a piece of a step, and each force is then F + (steady - F) p."""

    outputs: Mapping[str, Expression] = field(default_factory=dict)
    """Formulas for calculated variables that follow from the states, the orientation and the other formulas."""
    ends: Mapping[str, Expression] = field(default_factory=dict)
    """Formulas for the states of the vehicle that are neither in the table nor lag, from the states of the table."""
    tables: Mapping[str, ThrustTable] = field(default_factory=dict)
    """The thrust tables that the formulas call, by their names."""
    names: Names = field(default_factory=Names)
    """The names of the quantities of the equation."""

    @cached_property
    def measured(self) -> dict[str, Callable[[float], float]]:
        """The functions of the thrust tables, from a command to the force (N), by their names."""
        return {name: table.force for name, table in self.tables.items()}

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The states of the table."""
        return tuple(self.rows)

    @cached_property
    def lagging(self) -> dict[str, tuple[Expression, Expression]]:
        """For each force that lags: the formulas of its rate, and of its value after a piece of a step."""
        return {
            force: (
                self.rows[progress][0].coefficient * (Name(steady) - Name(force)),
                Name(force) + (Name(steady) - Name(force)) * Name(progress),
            )
            for progress, forces in self.lags.items()
            for force, steady in forces.items()
        }

    @cached_property
    def states_in_rate(self) -> dict[str, frozenset[str]]:
        """For each state, the states in its rate."""
        return {
            name: frozenset(factor for term in terms for factor in term.factors) for name, terms in self.rows.items()
        }

    @cached_property
    def used(self) -> frozenset[str]:
        """The states that a term contains, and the orientation. The other states are integrals of these.

        In `rows`, the used states must come first, because the C code knows only their number.
        """
        return frozenset(self.orientation.keys() & self.rows.keys()).union(*self.states_in_rate.values())

    @cached_property
    def components(self) -> tuple[tuple[str, ...], ...]:
        """Groups of states that depend on each other. Each group comes after those that it depends on.

        The groups that may settle come before the kinematic ones.
        """
        reach = self._reach
        groups: list[tuple[str, ...]] = []
        for name in self.states:
            group = tuple(n for n in self.states if n == name or (n in reach[name] and name in reach[n]))
            if group not in groups:
                groups.append(group)
        done: list[tuple[str, ...]] = []
        while groups:
            placed = {name for group in done for name in group}
            following = next(g for g in groups if all(reach[name] <= placed | set(g) for name in g))
            done.append(following)
            groups.remove(following)
        settling = self._settling.union(*(reach[name] for name in self._settling))
        return tuple(sorted(done, key=settling.isdisjoint))

    @cached_property
    def _reach(self) -> dict[str, set[str]]:
        """For each state, the states on which it depends, directly or through others."""
        found = {name: set(states) for name, states in self.states_in_rate.items()}
        for middle in self.states:
            for name in self.states:
                if middle in found[name]:
                    found[name] |= found[middle]
        return found

    @cached_property
    def _settling(self) -> frozenset[str]:
        """The used states that may settle."""
        return self.used - self.orientation.keys()

    @cached_property
    def dynamic(self) -> tuple[tuple[str, ...], ...]:
        """The components that may settle. The others are kinematic: only the heading and integrals."""
        last = max(n for n, group in enumerate(self.components) if not self._settling.isdisjoint(group))
        return self.components[: last + 1]

    @cached_property
    def orientation(self) -> dict[str, Expression]:
        """Formulas for the orientation in the table.

        It is the cosine and the sine of the heading, or the rotation matrix with its helper `square_length`.
        """
        return {name: formula for name, formula in self.starts.items() if formula != Name(name)}

    @cached_property
    def program(self) -> dict[str, Expression]:
        """All formulas from the inputs, states and coefficients of a vehicle to the numbers in its thrust and rates."""
        directed = {name: d.formula for name, d in self.directed.items()}
        lags = [term.coefficient.names for terms in self.rows.values() for term in terms if self._is_lag(term)]
        by_lag = frozenset().union(*lags)
        forces = {name: formula for name, formula in self.forces.items() if name not in by_lag}
        return {**self.parameters, **directed, **self.orientation, **self.thrust, **forces}

    @cached_property
    def rates(self) -> dict[str, Expression]:
        """The time derivative of each state of the vehicle, as a formula of its states and of `program`."""
        found = {name: rate for name, (rate, _) in self.lagging.items()}
        for name, terms in self.rows.items():
            found[name] = rate_formula(term for term in terms if not self._is_lag(term))
        if self.ends:
            found |= quaternion_rates(frozenset(self.states))
        return found

    def _is_lag(self, term: Term) -> bool:
        """Return True for a term that contains the progress of a lag. Such a term is 0 at the start of a piece."""
        return not self.lags.keys().isdisjoint(term.factors)

    @cached_property
    def monitored(self) -> tuple[str, ...]:
        """The velocities whose reversals end a piece of a step."""
        found = {directed.velocity for directed in self.directed.values()}
        return tuple(name for name in self.states if name in found)


def rate_formula(terms: Iterable[Term]) -> Expression:
    """Return the rate of a state as one formula."""
    return total(term.formula for term in terms)


@lru_cache(maxsize=100)
def equation_of(layout: Layout) -> Equation:
    """Return the equation of motion of a vehicle: (18) with the coupling, the lags and the kinematics.

    Raises ValueError when two thrust tables have the same name.
    """
    measured = [table for curve in layout.curves for table in curve.tables]
    tables = {table.function: table for table in measured}
    if len(tables) < len(measured):
        raise ValueError("two thrust tables have the same name")
    by_attitude = rotation_formulas() | quaternion_formulas() if layout.has_attitude else {}
    names = Names([*layout.places, *by_attitude])
    mass = mass_matrix(layout, names)
    parameters = _parameters(layout, mass, names)
    by_direction: dict[str, Directed] = {}
    held = _held_forces(layout, mass, names)
    rows: dict[str, tuple[Term, ...]] = {}
    for v in layout.velocities:
        terms = [Term(names("held", v))]
        terms += [
            Term(names("remaining", v, curve), (names("progress", curve).identifier,))
            for curve in _lagging(layout, mass, v)
        ]
        for name, forces in _accelerations(layout, mass, v, names).items():
            first = forces[0][1]
            ahead, astern = (total(f.along(one, reverse=reverse) for one, f in forces) for reverse in (False, True))
            coefficient: Expression = name
            if first.velocity and first.is_held:
                held[name.identifier] = ahead
                direction = names("direction", first.velocity)
                by_direction[direction.identifier] = Directed(first.velocity, ONE, -ONE)
                coefficient = direction * name
            elif first.velocity:
                by_direction[name.identifier] = Directed(first.velocity, ahead, astern)
            else:
                (held if first.is_held else parameters)[name.identifier] = ahead
            terms.append(Term(coefficient, first.factors, first.effect))
        coriolis = mass.coriolis(v) if layout.coupled else {}
        for factors, formula in coriolis.items():
            name = names("coupling", v, *([] if len(coriolis) == 1 else ["".join(factors)]))
            parameters[name.identifier] = formula
            terms.append(Term(name, factors, "coupling"))
        rows[v] = tuple(terms)
    attitude = _attitude(layout)
    if layout.restoring and attitude:  # the restoring forces contain the third row
        rows |= {entry(3, n): attitude.pop(entry(3, n)) for n in (1, 2, 3)}
    lags: dict[str, dict[str, str]] = {}
    for curve in layout.curves:
        if curve.has_lag:
            progress, rate = names("progress", curve.name).identifier, names("rate", curve.name)
            rows[progress] = (Term(rate), Term(-rate, (progress,)))
            own = [t.name for t in layout.thrusters if t.curve == curve.name]
            lags[progress] = {f"F_{name}": steady_name(name, curve, names).identifier for name in own}
    rows |= attitude
    rows |= _kinematics(layout, names)
    starts: dict[str, Expression] = {v: Name(v) for v in layout.velocities}
    if "cos_psi" in rows:
        starts |= {"cos_psi": call("cos", Name("psi")), "sin_psi": call("sin", Name("psi"))}
    if layout.has_attitude:
        starts |= rotation_formulas()
    return Equation(
        parameters,
        by_direction,
        thrust_formulas(layout, names),
        held,
        rows,
        starts,
        lags,
        outputs=angle_formulas() if layout.has_attitude else {},
        ends=quaternion_formulas() if layout.has_attitude else {},
        tables=tables,
        names=names,
    )


# ---- Parts of the equation -------------------------------------------------------------------------------------------


def _accelerations(layout: Layout, mass: MassMatrix, axis: str, names: Names) -> dict[Name, list[tuple[Name, Force]]]:
    """Return the forces that accelerate an axis, by the names of their coefficients, each with its inverse mass.

    A force along another axis accelerates this one through the inverse of the mass matrix. Forces with the same effect
    and the same factors are added. They must agree in `velocity` and `is_held`.
    """
    inverse = mass.inverse(axis)
    found: dict[Name, list[tuple[Name, Force]]] = {}
    for force in forces_of(layout, names):
        if force.axis in inverse:
            others = dict.fromkeys(factor for factor in force.factors if factor != axis or force.effect not in _DRAG)
            found.setdefault(names(force.effect, axis, *others), []).append((inverse[force.axis], force))
    return found


_DRAG = ("linear", "quadratic")


def mass_matrix(layout: Layout, names: Names) -> MassMatrix:
    """Return the mass matrix with the tuning of (18)."""
    gains: dict[str, Expression] = {}
    for form in layout.axes:
        inertia: Expression = Name(form.axis.inertia)
        if "m_a" in form.keys:
            inertia = inertia + Name(form.coefficient("m_a"))
        gains[form.axis.velocity] = Name(form.axis.coefficient("beta")) / inertia
    parts: dict[tuple[str, str], list[Expression]] = {}
    for key, *axes in layout.cross:
        if key == "m_a":
            parts.setdefault((axes[0], axes[1]), []).append(Name(cross_name(key, *axes)))
    # with the coupling, momentum along an axis that the vehicle lacks still acts on its other axes
    moves = layout.coupled and layout.has(SURGE, SWAY, HEAVE)
    for pair, (sign, coordinate) in _OF_CENTRE.items():
        present = [axis for axis in pair if axis in gains]
        if coordinate in layout.restoring and (len(present) == 2 or (present and moves)):
            parts.setdefault(pair, []).append(scaled(sign, Name("m_rov") * Name(coordinate)))
    entries = {}
    for pair, sums in parts.items():
        betas = product(*(Name(f"beta_{axis}") for axis in pair if axis in gains))
        entries[pair] = total(sums) / call("sqrt", betas)
    return MassMatrix(gains, entries, names)


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


def _parameters(layout: Layout, mass: MassMatrix, names: Names) -> dict[str, Expression]:
    """Return formulas for the inverse of the mass matrix (18), the arm (4), the lags' rates, and restoring."""
    found = mass.parameters()
    if layout.has_arm:
        found[names("arm").identifier] = Name("R") * call("sin", Name("gamma"))
    for curve in layout.curves:
        if curve.has_lag:
            found[names("rate", curve.name).identifier] = 1.0 / Name(curve.coefficient("T"))
    if layout.restoring:
        found[names("net_weight").identifier] = Name("W") - Name("B")
        for axis in "xyz":
            moments = (1, "W", f"{axis}_G"), (-1, "B", f"{axis}_B")
            found[names("righting", axis).identifier] = total(
                scaled(sign, Name(force) * Name(centre))
                for sign, force, centre in moments
                if centre in layout.restoring
            )
    return found


def _held_forces(layout: Layout, mass: MassMatrix, names: Names) -> dict[str, Expression]:
    """Return formulas for the torque of every curve, (4), and for the held accelerations of every axis, (18).

    For each curve with a lag, an axis has another formula: the change of acceleration until the thrust is steady.
    """
    found = {f"tau_{curve.name}": total(_thrusts(layout, YAW, names, curve)) for curve in layout.turning_curves}
    loads = {form.axis.velocity: load_along(layout, form, names) for form in layout.axes}
    lagging = [curve for curve in layout.curves if curve.has_lag]
    for form in layout.axes:
        v = form.axis.velocity
        inverse = mass.inverse(v)
        found[names("held", v).identifier] = total(gain * loads[other] for other, gain in inverse.items())
        for curve in lagging:
            changes = []
            for other, gain in inverse.items():
                axis = layout.by_velocity[other].axis
                if thrusts := _thrusts(layout, axis, names, curve, remaining=True):
                    changes.append(gain * (Name(axis.coefficient("alpha")) * total(thrusts)))
            if changes:
                found[names("remaining", v, curve.name).identifier] = total(changes)
    for name, current in (("x", "V_N"), ("y", "V_E"), ("z", "V_D")):
        if name in layout.pose and current in layout.inputs:
            found[names("held", name).identifier] = Name(current)
    return found


def load_along(layout: Layout, form: VehicleAxis, names: Names) -> Expression:
    """Return the force along an axis, or the moment about it, that is constant while the inputs are held."""
    axis = form.axis
    if axis is YAW:
        thrust: list[Expression] = [Name(f"tau_{curve.name}") for curve in layout.turning_curves]
    else:
        thrust = _thrusts(layout, axis, names)
    parts: list[Expression] = [Name(axis.coefficient("alpha")) * total(thrust)] if thrust else []
    parts += [Name(axis.external), *([Name(form.coefficient("F_0"))] if "F_0" in form.keys else [])]
    if axis is HEAVE and layout.restoring and not layout.has_attitude:
        parts.append(names("net_weight"))
    return total(parts)


def _thrusts(
    layout: Layout, axis: Axis, names: Names, curve: Curve | None = None, *, remaining: bool = False
) -> list[Expression]:
    """Return the thrusts along an axis, or their moments about it: all of them, or only those of a curve.

    `remaining` gives the changes of these thrusts until they are steady.
    """
    found = []
    for t in layout.drivers(axis):
        own = layout.curve_of[t.name]
        if curve in (None, own):
            force: Expression = Name(f"F_{t.name}")
            if remaining:
                force = steady_name(t.name, own, names) - force
            if axis is YAW and t.position is None and t.arm:
                force = names("arm") * force
            found.append(scaled(t.effect(axis), force))
    return found


def _lagging(layout: Layout, mass: MassMatrix, axis: str) -> list[str]:
    """Return the curves with lag whose thrusters accelerate an axis."""
    forms = [layout.by_velocity[other] for other in mass.inverse(axis)]
    drivers = {thruster.curve for form in forms for thruster in layout.drivers(form.axis)}
    return [curve.name for curve in layout.curves if curve.has_lag and curve.name in drivers]


def _attitude(layout: Layout) -> dict[str, tuple[Term, ...]]:
    """Return the rows of the rotation matrix, if the vehicle rolls or pitches."""
    rows: dict[str, tuple[Term, ...]] = {}
    if layout.has_attitude:
        velocities = frozenset(layout.velocities)
        for row in (1, 2, 3):
            for name, terms in rotation_terms(row, velocities).items():
                rows[name] = tuple(Term(of(sign), factors) for sign, factors in terms)
    return rows


def _kinematics(layout: Layout, names: Names) -> dict[str, tuple[Term, ...]]:
    """Return the rows of the pose, which follows from the velocities and a steady current.

    A vehicle without yaw always heads north, so its cos_psi is 1 and its sin_psi is 0.
    """
    rows: dict[str, tuple[Term, ...]] = {}
    if layout.has_attitude:
        velocities = frozenset(layout.velocities)
        for row, name in enumerate("xyz", 1):
            if name in layout.pose:
                moving = [Term(ONE, (v, entry(row, n))) for n, v in enumerate("uvw", 1) if v in velocities]
                rows[name] = (Term(names("held", name)), *moving)
        return rows
    if layout.has(SURGE, SWAY):
        turns = layout.has(YAW)
        if turns:
            rows["cos_psi"] = (Term(-ONE, ("r", "sin_psi")),)
            rows["sin_psi"] = (Term(ONE, ("r", "cos_psi")),)
        north, east = [Term(names("held", "x"))], [Term(names("held", "y"))]
        if layout.has(SURGE):
            north.append(Term(ONE, ("u", "cos_psi") if turns else ("u",)))
            east += [Term(ONE, ("u", "sin_psi"))] if turns else []
        if layout.has(SWAY):
            north += [Term(-ONE, ("v", "sin_psi"))] if turns else []
            east.append(Term(ONE, ("v", "cos_psi") if turns else ("v",)))
        rows["x"], rows["y"] = tuple(north), tuple(east)
    if layout.has(HEAVE):
        rows["z"] = (Term(ONE, ("w",)),)
    if layout.has(YAW):
        rows["psi"] = (Term(ONE, ("r",)),)
    return rows
