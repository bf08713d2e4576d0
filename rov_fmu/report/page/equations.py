"""The equations of a vehicle for readers, made from its forces and from the formulas of its thrust and its pose.

A formula is shown as a sum of products. The page leaves out only the saturation of commands, which its text mentions.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from markupsafe import escape

from rov_fmu.equation.attitude import TURN
from rov_fmu.equation.catalogue import REVERSE, YAW, delayed_name
from rov_fmu.equation.expression import (
    Expression,
    Name,
    Number,
    Operation,
    call,
    product,
    replaced,
    total,
    written,
)
from rov_fmu.equation.forces import AT_SURFACE, COUPLING, forces_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, Thruster, VehicleAxis
from rov_fmu.equation.terms import Equation, equation_of, mass_matrix
from rov_fmu.equation.thrust import steady_name
from rov_fmu.report.page.typeset import MATHML, TEXT, collected
from rov_fmu.report.templates import number


@dataclass(frozen=True)
class Line:
    """An equation. Its left side is a name, or a sum of factors times the rate of a name."""

    left: Expression
    right: Expression
    reference: str = ""
    """The number of the equation in the paper, or another publication of it."""

    def __str__(self) -> str:
        """Return the equation as plain text."""
        return f"{formula_text(self.left)} = {formula_text(self.right)}"


@dataclass(frozen=True)
class CurveLines:
    """The equations of a thrust curve, for the first of its thrusters."""

    curve: Curve
    thrusters: list[Thruster]
    thrust: list[Line]
    advance: list[Line]
    """The loss of thrust per speed of advance, if there is one."""
    lag: list[Line]
    """How the force, or the speed of the rotor, follows the command, if it lags."""
    torque: list[Line]


@dataclass(frozen=True)
class Equations:
    """The equations of a vehicle."""

    motion: list[Line]
    inertia: list[Line]
    """The entries of the effective mass matrix M, if axes are coupled or have an added mass."""
    commands: list[Line]
    """The command of each thruster, if inputs are mixed, and the angle of each fin."""
    curves: list[CurveLines]
    pose: list[Line]
    rotation: list[Line]
    """The entries of the rotation matrix R, if the vehicle rolls or pitches."""
    angles: list[Line]
    """The Euler angles, if the vehicle rolls or pitches."""

    @property
    def has_full_mass(self) -> bool:
        """True if the left side of an equation of motion has the rates of several velocities."""
        return any(isinstance(line.left, Operation) and line.left.op == "+" for line in self.motion)

    def __iter__(self) -> Iterator[Line]:
        """Iterate over all equations in the order of the page."""
        of_curves = (
            line for curve in self.curves for line in (*curve.thrust, *curve.advance, *curve.lag, *curve.torque)
        )
        yield from (*self.motion, *self.inertia, *self.commands, *of_curves)
        yield from (*self.pose, *self.rotation, *self.angles)


def equations_of(layout: Layout) -> Equations:
    """Return the equations of a vehicle."""
    equation = equation_of(layout)
    names = equation.names
    formulas = _inlined(layout, equation)
    mass = mass_matrix(layout, names)
    has_effective_inertia = layout.coupled or bool(mass.entries) or any("m_a" in form.keys for form in layout.axes)

    def line(left: Expression, formula: Expression, reference: str = "") -> Line:
        return Line(left, collected(replaced(formula, formulas)), reference)

    def thrust(name: Name, shown: Name | None = None) -> list[Line]:
        """Return the equation of a quantity that follows from the commands, if the vehicle has it."""
        formula = {**equation.thrust, **equation.forces}.get(name.identifier)
        return [line(shown or name, _with_sign(replaced(formula, formulas)))] if formula else []

    def motion(form: VehicleAxis) -> Line:
        """Return the equation of motion of an axis: with effective masses on the left, if the axis has several."""
        v = form.axis.velocity
        shown = (force for force in forces_of(layout, names) if force.effect is not AT_SURFACE)
        loads = [force.formula for force in shown if force.axis == v]
        if not has_effective_inertia:
            right = Name(form.axis.coefficient("beta")) * total(loads)
            return line(Name(form.axis.inertia) * _rate(v), right, form.axis.equations[1])
        if layout.coupled:
            munk = [(sign, _entry(*entry), pair) for pair, own in mass.products(v).items() for sign, entry in own]
            loads += [sign * product(entry, *map(Name, pair)) for sign, entry, pair in munk]
        partners = {b if a == v else a: _entry(a, b) for a, b in mass.entries if v in (a, b)}
        masses = {v: _entry(v, v), **partners}
        left = total(entry * _rate(axis) for axis, entry in masses.items() if axis in layout.by_velocity)
        return line(left, total(loads), form.axis.equations[1])

    inertia = [line(_entry(v, v), 1.0 / mass.gains[v]) for v in layout.by_velocity] if has_effective_inertia else []
    inertia += [line(_entry(*pair), formula) for pair, formula in mass.entries.items()]
    curves = []
    for curve in layout.curves:
        thrusters = [t for t in layout.thrusters if t.curve == curve.name]
        first = thrusters[0].name
        steady, lagging = steady_name(first, curve, names), Name(curve.lagging(first))
        shown = thrust(Name(f"F_{first}") if curve.has_rotors else steady)
        shown = [replace(one, reference=curve.equation) for one in shown]
        if curve.has_rotors:
            steady = names("speed", first)
            shown += thrust(steady)
        shown += thrust(names("beyond", first)) if "c_0" in curve.keys else []
        T = Name(curve.coefficient("T"))
        lag = [line(T * _rate(lagging.identifier), steady - lagging)] if curve.has_lag else []
        by_arm = any(t.position is None for t in layout.thrusters_along(YAW) if t in thrusters)
        tau = Name(f"tau_{curve.name}")
        turning = equation.forces.get(tau.identifier)
        torque = [] if turning is None else [line(tau, turning, "(4)" if by_arm else "")]
        curves.append(CurveLines(curve, thrusters, shown, thrust(names("loss", first)), lag, torque))
    mixed = [one for t in layout.thrusters for one in thrust(names("mixed", t.name), names("command", t.name))]
    angles = [one for fin in layout.fins for one in thrust(names("angle", fin.name))]
    return Equations(
        [motion(form) for form in layout.axes],
        inertia,
        mixed + angles,
        curves,
        [line(_rate(name), equation.rates[name]) for name in layout.pose],
        [line(Name(name), formula) for name, formula in _rotation(layout, equation).items()],
        [line(Name(name), formula) for name, formula in equation.outputs.items() if name in layout.angles],
    )


def _rate(name: str) -> Expression:
    """Return the time derivative of a variable, as the page shows it."""
    return call("rate", Name(name))


def _entry(a: str, b: str) -> Name:
    """Return the name on the page of an entry of the effective mass matrix."""
    return Name(f"M_{a}" if a == b else f"m_{a}{b}")


def _with_sign(x: Expression) -> Expression:
    """Write sgn(c) F, in which sgn(c) |c| is c, in place of the choice between F and -F by the sign of c."""
    match x:
        case Operation("directed", (c, size, Operation("neg", (opposite,)))) if size == opposite:
            return total(product(*_times_sign(c, factors)) for factors in _multiplied_out(size))
        case Operation(op, args):
            return Operation(op, tuple(map(_with_sign, args)))
    return x


def _times_sign(c: Expression, factors: Sequence[Expression]) -> list[Expression]:
    """Return the factors of a product times sgn(c): the last |c| becomes c, if there is one."""
    size = abs(c)
    if size not in factors:
        return [call("sgn", c), *factors]
    last = max(index for index, factor in enumerate(factors) if factor == size)
    return [*factors[:last], c, *factors[last + 1 :]]


def _multiplied_out(x: Expression) -> list[tuple[Expression, ...]]:
    """Return the products of which an expression is the sum, each with its factors: (a + b) m gives a m and b m."""
    match x:
        case Operation("+", (left, right)):
            return _multiplied_out(left) + _multiplied_out(right)
        case Operation("*", (left, right)):
            return [(*one, *other) for one in _multiplied_out(left) for other in _multiplied_out(right)]
    return [(x,)]


def coupled(layout: Layout) -> list[str]:
    """Return the names of the axes with Coriolis and Munk terms."""
    rows = equation_of(layout).rows
    return [axis.name for axis in layout.bare_axes if any(term.effect is COUPLING for term in rows[axis.velocity])]


def _rotation(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas of the entries of the rotation matrix, if the vehicle rolls or pitches."""
    found = equation.orientation if layout.has_attitude else {}
    return {name: formula for name, formula in found.items() if name in equation.rows}


def _inlined(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas that replace their names, because the page has no equation of these names."""
    names = equation.names
    kinds = (
        "saturated",
        "command",
        "magnitude",
        "by_voltage",
        "speed_by_voltage",
        "net_weight",
        "righting",
        "arm",
        "constant",
    )
    inlined = {name.identifier for kind in kinds for name in names.of_kind(kind)} | {*TURN}
    full = {t.name for t in layout.thrusters if "c_0" not in layout.curve_of[t.name].keys}  # without a dead band
    inlined |= {name.identifier for name in names.of_kind("beyond") if full.issuperset(name.owners)}
    mixed = [name for name in names.of_kind("mixed") if name.identifier in equation.thrust]
    inlined -= {names("command", *name.owners).identifier for name in mixed}
    found = {name: _unsaturated(formula) for name, formula in equation.program.items() if name in inlined}
    if layout.has_dead_time:  # a fraction is that of the command that acts
        found |= {name.identifier: Name(delayed_name(*name.owners)) for name in names.of_kind("fraction")}
    return found | ({"square_length": Number(1.0)} if layout.has_attitude else {})


def _unsaturated(x: Expression) -> Expression:
    return x.args[0] if isinstance(x, Operation) and x.op == "saturated" else x


def choices(lines: Iterable[Line]) -> list[Operation]:
    """Return the parameters in these equations that depend on a direction."""
    return list(dict.fromkeys(choice for line in lines for choice in _choices(line.right)))


def _choices(x: Expression) -> Iterator[Operation]:
    if isinstance(x, Operation):
        if x.op == "directed":
            yield x
        for arg in x.args[2:] if x.op == "dead band" else x.args:  # its width has an equation of its own
            yield from _choices(arg)


# ---- Written ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Symbol:
    """A letter with its indices.

    `mark` is − for a parameter that holds in reverse, ± for one of two parameters by direction, * for a steady force or
    speed.
    """

    letter: str
    index: str = ""
    upper: str = ""
    mark: str = ""


_LETTERS = {
    **{"alpha": "α", "beta": "β", "gamma": "γ", "phi": "φ", "theta": "θ", "psi": "ψ", "eta": "η", "epsilon": "ε"},
    **{"tau": "τ", "angle": "δ", "lift": "l", "drag": "d", "delayed": "u", "health": "h", "fraction": "u"},
    **{"command": "c", "beyond": "m", "loss": "k", "table": "f", "steady": "F", "speed": "n", "battery": "U"},
}
"""The letters of quantities whose names begin with a word or whose letter is another one."""
_INDICES = ("t", "d", "a", "0", "V", "max", "u")
"""What stands below a letter, so that the name of a part or an axis stands above: a_t_rear, but T_rear."""


def symbol_of(name: Name) -> Symbol:
    """Return the symbol of a name: a letter with the indices that its identifier has, as in m_a_u or alpha_u."""
    stem = name.identifier.removesuffix("±").removesuffix(REVERSE)
    head, _, rest = stem.partition("_")
    if name.kind:
        head, index, upper = name.kind, "_".join(name.owners).removeprefix("u_"), ""
    elif head == "delayed":
        index, upper = rest.removeprefix("u_"), "d"
    else:
        index, _, upper = rest.partition("_")
        if upper and index not in _INDICES:
            index, upper = rest, ""
    mark = {"": "*" if head in ("steady", "speed") else "", REVERSE: "−"}.get(name.identifier.removeprefix(stem), "±")
    return Symbol(_LETTERS.get(head, head), index, upper, mark)


def formula_text(x: Expression) -> str:
    """Write a formula as plain text, with the names of the FMU's variables."""

    def name_of(name: Name) -> str:
        symbol = symbol_of(name)
        shown = "_".join(part for part in (symbol.letter, symbol.index, symbol.upper) if part)
        return shown + (REVERSE if symbol.mark == "−" else symbol.mark)

    return written(x, replace(TEXT, number=lambda value: number(value, 4)), name_of)


def mathml(x: Expression) -> str:
    """Write a formula in MathML, for the page."""

    def name_of(name: Name) -> str:
        symbol = symbol_of(name)
        parts = (symbol.letter, symbol.index, symbol.upper)
        letter, index, upper = (f"<mi>{escape(part)}</mi>" if part else "" for part in parts)
        if symbol.mark:
            upper = f'<mrow>{upper}<mo lspace="0" rspace="0">{symbol.mark}</mo></mrow>'
        if upper:
            return f"<msubsup>{letter}{index or '<mrow/>'}{upper}</msubsup>"
        return f"<msub>{letter}{index}</msub>" if index else letter

    return written(x, replace(MATHML, number=lambda value: f"<mn>{number(value, 4)}</mn>"), name_of)


def parts_in_mathml(line: Line) -> list[str]:
    """Return the left side with the first term, and then each term: a line may break between them."""

    def parts(x: Expression) -> list[str]:
        match x:
            case Operation("+" | "-" as op, (before, last)):
                sign = {"-": "−"}.get(op, op)
                return [*parts(before), f'<mo form="infix">{sign}</mo>{mathml(last)}']
        return [mathml(x)]

    first, *others = parts(line.right)
    return [f"{mathml(line.left)}<mo>=</mo>{first}", *others]
