"""The equation of motion of a vehicle as a table of terms.

Between reversals, and while the inputs are held, the motion is a quadratic system of ordinary differential equations,

    y_i' = k_i + sum of L_ij y_j + sum of Q_ijk y_j y_k.

`equation_of` derives this table from the layout of a vehicle: the states y, the terms in the rate of each state, and a
formula for each coefficient. `step.py` computes a step from it in Python, and the C code is generated from it. A new
effect is a new term with its formula.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from .layout import HEAVE, REVERSE, SURGE, SWAY, YAW, Curve, Layout, VehicleAxis


@dataclass(frozen=True)
class Term:
    """A term in the rate of a state: a coefficient, which is multiplied by one or two states or stands alone."""

    coefficient: str
    """A number or the name of a formula, possibly with a minus before it."""
    factors: tuple[str, ...] = ()
    """The states that are multiplied with the coefficient."""

    @property
    def formula(self) -> str:
        """The term as a formula."""
        if self.factors and self.coefficient in ("1", "-1"):
            return self.coefficient[:-1] + " * ".join(self.factors)
        return " * ".join((self.coefficient, *self.factors))


@dataclass(frozen=True)
class Directed:
    """A coefficient that depends on the direction of a velocity. Each of its terms contains that velocity."""

    velocity: str
    forward: str
    """The formula for a positive velocity."""
    reverse: str
    """The formula for a negative velocity."""

    @property
    def formula(self) -> str:
        """One formula for both directions."""
        if self.forward == self.reverse:
            return self.forward
        return f"{self.reverse} if {self.velocity} < 0 else {self.forward}"


@dataclass(frozen=True)
class Equation:
    """The equation of motion of a vehicle. Formulas are evaluated in their order, and each may use those before it."""

    parameters: Mapping[str, str]
    """Formulas for the numbers that follow from the coefficients alone."""
    directed: Mapping[str, Directed]
    """The coefficients that depend on the direction of a velocity."""
    thrust: Mapping[str, str]
    """Formulas from the commands to the steady thrust of every thruster."""
    forces: Mapping[str, str]
    """Formulas for torques and other outputs, and for the accelerations that are constant while the inputs are held."""
    rows: Mapping[str, tuple[Term, ...]]
    """The terms in the rate of every state of the table."""
    starts: Mapping[str, str]
    """Formulas from the vehicle's states to the states of the table at the start of a step. The states without a
    formula start at 0: the integrals, which no term contains, and the progress of the lags."""
    lags: Mapping[str, Mapping[str, str]]
    """For the progress of each lag: the forces that lag, each with the name of the steady thrust that it approaches.

    The progress p rises from 0 towards 1 during a piece of a step, and each force is then F + (steady - F) p."""

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The states of the table."""
        return tuple(self.rows)

    @cached_property
    def lagging(self) -> dict[str, tuple[str, str]]:
        """For each force that lags: the formulas of its rate, and of its value after a piece of a step."""
        return {
            force: (
                f"{self.rows[progress][0].coefficient} * ({steady} - {force})",
                f"{force} + ({steady} - {force}) * {progress}",
            )
            for progress, forces in self.lags.items()
            for force, steady in forces.items()
        }

    @cached_property
    def inputs_of(self) -> dict[str, frozenset[str]]:
        """The states that the rate of each state depends on."""
        return {
            name: frozenset(factor for term in terms for factor in term.factors) for name, terms in self.rows.items()
        }

    @cached_property
    def used(self) -> frozenset[str]:
        """The states that a term contains. The other states are integrals of these."""
        return frozenset().union(*self.inputs_of.values())

    @cached_property
    def components(self) -> tuple[tuple[str, ...], ...]:
        """Groups of states that depend on each other. Each group comes after those that it depends on."""
        reach = {name: set(inputs) for name, inputs in self.inputs_of.items()}
        for middle in self.states:
            for name in self.states:
                if middle in reach[name]:
                    reach[name] |= reach[middle]
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
        return tuple(done)

    @cached_property
    def dynamic(self) -> tuple[tuple[str, ...], ...]:
        """The components that may settle. The others are kinematic: only the heading and integrals."""
        settling = self.used - self.heading.keys()
        return tuple(group for group in self.components if not settling.isdisjoint(group))

    @cached_property
    def heading(self) -> dict[str, str]:
        """Formulas for the states of the table that are not states of the vehicle: cosine and sine of the heading."""
        return {name: formula for name, formula in self.starts.items() if name != formula}

    @cached_property
    def program(self) -> dict[str, str]:
        """All formulas from the inputs, states and coefficients of a vehicle to the numbers in its thrust and rates."""
        directed = {name: d.formula for name, d in self.directed.items()}
        by_lag = {term.coefficient for terms in self.rows.values() for term in terms if self._is_lag(term)}
        forces = {name: formula for name, formula in self.forces.items() if name not in by_lag}
        return {**self.parameters, **directed, **self.heading, **self.thrust, **forces}

    @cached_property
    def rates(self) -> dict[str, str]:
        """The time derivative of each state of the vehicle, as a formula of its states and of `program`."""
        found = {name: rate for name, (rate, _) in self.lagging.items()}
        for name, terms in self.rows.items():
            found[name] = rate_formula(term for term in terms if not self._is_lag(term))
        return found

    def _is_lag(self, term: Term) -> bool:
        """Return True for a term with the progress of a lag, which is 0 at the start of a piece."""
        return not self.lags.keys().isdisjoint(term.factors)

    @cached_property
    def monitored(self) -> tuple[str, ...]:
        """The velocities whose reversals end a piece of a step."""
        return tuple(dict.fromkeys(directed.velocity for directed in self.directed.values()))


def rate_formula(terms: Iterable[Term]) -> str:
    """Write the rate of a state as one formula."""
    return _joined(term.formula for term in terms)


def equation_of(layout: Layout) -> Equation:
    """Derive the equation of motion of a vehicle: (18) with the coupling, the lags and the kinematics."""
    parameters = _parameters(layout)
    directed: dict[str, Directed] = {}
    rows: dict[str, tuple[Term, ...]] = {}
    for form in layout.axes:
        v = form.axis.velocity
        linear = [f"-gain_{v} * {form.coefficient('b_d' + end)}" for end in ("", REVERSE)]
        quadratic = [f"{sign}gain_{v} * {form.coefficient('a_d' + end)}" for sign, end in (("-", ""), ("", REVERSE))]
        directed[f"linear_{v}"] = Directed(v, *linear)
        directed[f"quadratic_{v}"] = Directed(v, *quadratic)
        remaining = [
            Term(f"remaining_{v}_{curve.name}", (f"progress_{curve.name}",)) for curve in _lagging(layout, form)
        ]
        drag = Term(f"linear_{v}", (v,)), Term(f"quadratic_{v}", (v, v))
        rows[v] = (Term(f"held_{v}"), *remaining, *drag, *_coupling(layout, form))
    lags = {}
    for curve in layout.curves:
        if curve.has_lag:
            progress = f"progress_{curve.name}"
            rows[progress] = (Term(f"rate_{curve.name}"), Term(f"-rate_{curve.name}", (progress,)))
            lags[progress] = {f"F_{t.name}": f"steady_{t.name}" for t in layout.thrusters if t.curve == curve.name}
    rows |= _kinematics(layout)
    starts = {form.axis.velocity: form.axis.velocity for form in layout.axes}
    if "cos_psi" in rows:
        starts |= {"cos_psi": "cos(psi)", "sin_psi": "sin(psi)"}
    return Equation(parameters, directed, _thrust(layout), _forces(layout), rows, starts, lags)


# ---- Parts of the equation -------------------------------------------------------------------------------------------


def _parameters(layout: Layout) -> dict[str, str]:
    """Return formulas for the acceleration per load β/m (18), the arm (4), the rates of the lags, and the coupling."""
    found = {}
    for form in layout.axes:
        axis = form.axis
        inertia = f"({axis.inertia} + {form.coefficient('m_a')})" if "m_a" in form.keys else axis.inertia
        found[f"gain_{axis.velocity}"] = f"{axis.coefficient('beta')} / {inertia}"
    if layout.has_arm:
        found["arm"] = "R * sin(gamma)"
    for curve in layout.curves:
        if curve.has_lag:
            found[f"rate_{curve.name}"] = f"1 / {curve.coefficient('T')}"
    if layout.coupled:  # with M = m/β, these are M_v/M_u, -M_u/M_v and (M_u - M_v)/M_r
        found["coupling_u"] = "gain_u / gain_v"
        found["coupling_v"] = "-(gain_v / gain_u)"
        found["coupling_r"] = "gain_r / gain_u - gain_r / gain_v"
    return found


def _coupling(layout: Layout, form: VehicleAxis) -> tuple[Term, ...]:
    """Return the Coriolis and Munk terms of an axis, for a diagonal mass matrix."""
    products = {"u": ("v", "r"), "v": ("u", "r"), "r": ("u", "v")}
    v = form.axis.velocity
    return (Term(f"coupling_{v}", products[v]),) if layout.coupled and v in products else ()


def _thrust(layout: Layout) -> dict[str, str]:
    """Return formulas for the steady thrust (2), (9), (10) of every thruster.

    Each input saturates at ±1, and so does each sum of inputs.
    """
    found: dict[str, str] = {}
    for thruster in layout.thrusters:
        name, curve, gains = thruster.name, layout.curve_of[thruster.name], layout.gains[thruster.name]
        parts = []
        for command, gain in gains.items():
            found[f"saturated_{command}"] = _saturated(command)
            parts.append((gain, f"saturated_{command}"))
        if list(gains.values()) == [1.0]:
            found[f"command_{name}"] = parts[0][1]
        else:
            found[f"mixed_{name}"] = _weighted(parts)
            found[f"command_{name}"] = _saturated(f"mixed_{name}")
        found |= _steady_thrust(name, curve)
    return found


def curve_formulas(curve: Curve) -> dict[str, str]:
    """Return formulas for the steady thrust of one thruster: from its command u_one to the thrust, the last formula."""
    return {"command_one": _saturated("u_one"), **_steady_thrust("one", curve)}


def _saturated(name: str) -> str:
    return f"1 if {name} > 1 else -1 if {name} < -1 else {name}"


def _steady_thrust(name: str, curve: Curve) -> dict[str, str]:
    """Return formulas from the command of a thruster to its steady thrust, a_t m^2 + b_t m.

    m is the part of the command beyond the dead band. The coefficients are those for the direction of the
    command. Adding 0 turns a negative zero into a positive one.
    """
    is_reverse = f"command_{name} < 0"

    def chosen(key: str) -> str:
        forward, reverse = curve.coefficient(key), curve.coefficient(key + REVERSE)
        return forward if forward == reverse else f"({reverse} if {is_reverse} else {forward})"

    share = f" * {1.0 / curve.together!r}" if curve.together != 1 else ""
    signed = f"(-magnitude_{name} if {is_reverse} else magnitude_{name})"
    dead = f" - {chosen('c_0')}" if "c_0" in curve.keys else ""
    beyond = f"beyond_{name}"
    if dead:
        signed = f"(0 if {beyond} < 0 or {beyond} == 0 and {chosen('c_0')} > 0 else {signed})"
    return {
        beyond: f"abs(command_{name}){dead}",
        f"magnitude_{name}": f"({chosen('a_t')} * {beyond} + {chosen('b_t')}) * {beyond}{share}",
        f"steady_{name}" if curve.has_lag else f"F_{name}": f"{signed} + 0",
    }


def _forces(layout: Layout) -> dict[str, str]:
    """Return formulas for the torque of every curve, (4), and for the held accelerations of every axis, (18).

    A lag gives the axis a second one: the change of acceleration that remains until the thrust is steady.
    """
    found: dict[str, str] = {}
    for curve in layout.turning_curves:
        found[f"tau_{curve.name}"] = _weighted(_torques(layout, curve, "F_{}"))
    for form in layout.axes:
        axis, v = form.axis, form.axis.velocity
        if axis is YAW:
            thrust = [(1.0, f"tau_{curve.name}") for curve in layout.turning_curves]
        else:
            thrust = [(t.effect(axis), f"F_{t.name}") for t in layout.drivers(axis)]
        parts = [f"{axis.coefficient('alpha')} * ({_weighted(thrust)})"] if thrust else []
        parts += [axis.external, *([form.coefficient("F_0")] if "F_0" in form.keys else [])]
        found[f"held_{v}"] = f"gain_{v} * ({_joined(parts)})"
        for curve in _lagging(layout, form):
            change = "(steady_{0} - F_{0})"
            if axis is YAW:
                changes = _torques(layout, curve, change)
            else:
                drivers = [t for t in layout.drivers(axis) if t.curve == curve.name]
                changes = [(t.effect(axis), change.format(t.name)) for t in drivers]
            found[f"remaining_{v}_{curve.name}"] = f"gain_{v} * ({axis.coefficient('alpha')} * ({_weighted(changes)}))"
    for name, current in (("x", "V_N"), ("y", "V_E")):
        if name in layout.pose:
            found[f"held_{name}"] = current
    return found


def _torques(layout: Layout, curve: Curve, force: str) -> list[tuple[float, str]]:
    """Return the torques of a curve's thrusters: weights and formulas. `force` has {} for the thruster's name."""
    found = []
    for thruster in layout.drivers(YAW):
        if thruster.curve == curve.name:
            by_arm = thruster.position is None and thruster.arm
            found.append((thruster.effect(YAW), ("arm * " if by_arm else "") + force.format(thruster.name)))
    return found


def _lagging(layout: Layout, form: VehicleAxis) -> list[Curve]:
    """Return the curves with lag whose thrusters act on an axis."""
    drivers = {t.curve for t in layout.drivers(form.axis)}
    return [curve for curve in layout.curves if curve.has_lag and curve.name in drivers]


def _kinematics(layout: Layout) -> dict[str, tuple[Term, ...]]:
    """Return the rows of the pose, which follows from the velocities and a steady current.

    A vehicle that heads north has cos_psi = 1, sin_psi = 0.
    """
    rows: dict[str, tuple[Term, ...]] = {}
    if layout.has(SURGE, SWAY):
        turns = layout.has(YAW)
        if turns:
            rows["cos_psi"] = (Term("-1", ("r", "sin_psi")),)
            rows["sin_psi"] = (Term("1", ("r", "cos_psi")),)
        north, east = [Term("held_x")], [Term("held_y")]
        if layout.has(SURGE):
            north.append(Term("1", ("u", "cos_psi") if turns else ("u",)))
            east += [Term("1", ("u", "sin_psi"))] if turns else []
        if layout.has(SWAY):
            north += [Term("-1", ("v", "sin_psi"))] if turns else []
            east.append(Term("1", ("v", "cos_psi") if turns else ("v",)))
        rows["x"], rows["y"] = tuple(north), tuple(east)
    if layout.has(HEAVE):
        rows["z"] = (Term("1", ("w",)),)
    if layout.has(YAW):
        rows["psi"] = (Term("1", ("r",)),)
    return rows


# ---- Formulas --------------------------------------------------------------------------------------------------------


def _joined(parts: Iterable[str]) -> str:
    """Write a sum as one formula. A part that begins with a minus is subtracted."""
    text = ""
    for part in parts:
        if not text:
            text = part
        elif part.startswith("-"):
            text += f" - {part[1:]}"
        else:
            text += f" + {part}"
    return text


def _weighted(parts: Sequence[tuple[float, str]]) -> str:
    """Write a weighted sum as one formula. Each part must be a product, or need no brackets in one."""
    return _joined(
        part if weight == 1.0 else f"-{part}" if weight == -1.0 else f"{weight!r} * {part}" for weight, part in parts
    )
