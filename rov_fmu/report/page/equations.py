"""The equations of a vehicle for readers, made from the formulas of its equation of motion (rov_fmu/model/)."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

from markupsafe import escape

from rov_fmu.model.attitude import rotation_formulas
from rov_fmu.model.equation import Equation, equation_of
from rov_fmu.model.expression import Expression, Name, Number
from rov_fmu.model.layout import (
    AXIS,
    BODY,
    CURVE,
    RESTORING,
    REVERSE,
    TUNING,
    YAW,
    Curve,
    Layout,
    Thruster,
    VehicleAxis,
    cross_name,
)
from rov_fmu.model.thrust import steady_name
from rov_fmu.report.page.algebra import Call, Cases, Choice, Factor, Group, Product, Reader, Sum, arranged, inverse
from rov_fmu.report.templates import RAISED, number


@dataclass(frozen=True)
class Symbol:
    """A letter with its indices.

    `mark` is − for a parameter that holds in reverse, ± for one of two parameters by direction, * for a steady force.
    """

    letter: str
    index: str = ""
    upper: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Line:
    """An equation: on the left some factors times a name or its time derivative, on the right a sum."""

    factors: tuple[Factor, ...]
    name: str
    is_rate: bool
    right: Sum
    reference: str = ""
    """The number of the equation in the paper, or another publication of it."""
    coupled: tuple[tuple[str, str], ...] = ()
    """The other rates on the left: the names of their factors and of the variables."""


@dataclass(frozen=True)
class CurveLines:
    """The equations of a thrust curve, for the first of its thrusters."""

    curve: Curve
    thrusters: list[Thruster]
    thrust: list[Line]
    advance: list[Line]
    """The loss of thrust per speed of advance, if there is one."""
    lag: list[Line]
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

    def __iter__(self) -> Iterator[Line]:
        """Iterate over all equations in the order of the page."""
        of_curves = (
            line for curve in self.curves for line in (*curve.thrust, *curve.advance, *curve.lag, *curve.torque)
        )
        yield from (*self.motion, *self.inertia, *self.commands, *of_curves)
        yield from (*self.pose, *self.rotation, *self.angles)


def of(layout: Layout) -> Equations:
    """Return the equations of a vehicle."""
    equation = equation_of(layout)
    names = equation.names
    rotation = _rotation(layout, equation)
    reader = Reader(_inlined(layout, equation))
    plain = Reader({})

    def line(name: str, formula: Expression, reference: str = "") -> Line:
        return Line((), name, False, arranged(reader.read(formula)), reference)

    def thrust(name: Name, reference: str = "") -> list[Line]:
        """Return the equation of a quantity that follows from the commands, if the vehicle has it."""
        formula = equation.thrust.get(name.identifier)
        return [line(name.identifier, formula, reference)] if formula is not None else []

    def rate(name: str, formula: Expression, reference: str = "") -> Line:
        """Return the equation of a time derivative, multiplied by the divisors that all its terms share."""
        right = reader.read(formula)
        below = [factor for factor in right[0].below if all(factor in p.below for p in right)]
        for factor in below:
            right = tuple(Product(p.sign, p.above, tuple(f for f in p.below if f != factor)) for p in right)
        return Line(tuple(below), name, True, arranged(right), reference)

    entries = _mass_entries(equation)

    def motion(form: VehicleAxis) -> Line:
        """Return the equation of motion of an axis: with effective masses on the left, if the axis has several."""
        v = form.axis.velocity
        found = rate(v, equation.rates[v], form.axis.equations[1])
        pairs = [((b if a == v else a), name) for (a, b), name in entries.items() if v in (a, b)]
        others = [(name, other) for other, name in pairs if other in layout.by_velocity]
        return replace(found, factors=(f"M_{v}",), coupled=tuple(others)) if others else found

    inertia = []
    if _has_effective_inertia(layout, equation):
        for v in layout.by_velocity:
            gain = plain.read(equation.parameters[names("gain", v).identifier])
            inertia.append(Line((), f"M_{v}", False, inverse(gain)))
        for (a, b), name in entries.items():
            mass = plain.read(equation.parameters[names("mass", a + b).identifier])
            inertia.append(Line((), name, False, arranged(mass)))
    curves = []
    for curve in layout.curves:
        thrusters = [t for t in layout.thrusters if t.curve == curve.name]
        first = thrusters[0].name
        force = thrust(steady_name(first, curve, names), curve.equation)
        if "c_0" in curve.keys:
            force += thrust(names("beyond", first))
        lag = [rate(f"F_{first}", equation.lagging[f"F_{first}"][0])] if curve.has_lag else []
        by_arm = any(t.position is None for t in layout.drivers(YAW) if t in thrusters)
        tau = f"tau_{curve.name}"
        torque = [line(tau, equation.forces[tau], "(4)" if by_arm else "")] if tau in equation.forces else []
        curves.append(CurveLines(curve, thrusters, force, thrust(names("loss", first)), lag, torque))
    mixed = [(t.name, equation.thrust.get(names("mixed", t.name).identifier)) for t in layout.thrusters]
    return Equations(
        [motion(form) for form in layout.axes],
        inertia,
        [
            *(line(names("command", name).identifier, formula) for name, formula in mixed if formula is not None),
            *(one for fin in layout.fins for one in thrust(names("angle", fin.name))),
        ],
        curves,
        [rate(name, equation.rates[name]) for name in layout.pose],
        [line(name, formula) for name, formula in rotation.items()],
        [line(name, formula) for name, formula in equation.outputs.items()],
    )


def coupled(layout: Layout) -> list[str]:
    """Return the names of the axes with Coriolis and Munk terms."""
    rows = equation_of(layout).rows
    axes = (form.axis for form in layout.axes)
    return [axis.name for axis in axes if any(term.effect == "coupling" for term in rows[axis.velocity])]


def _rotation(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas of the entries of the rotation matrix, if the vehicle rolls or pitches."""
    found = equation.orientation if layout.has_attitude else {}
    return {name: formula for name, formula in found.items() if name in equation.rows}


def _mass_entries(equation: Equation) -> dict[tuple[str, str], str]:
    """Return the entries of the mass matrix off the diagonal: by two velocities, the name on the page."""
    entries = {name.identifier: name.owners[0] for name in equation.names.of_kind("mass")}
    pairs = [tuple(entries[name]) for name in equation.parameters if name in entries]
    return {(a, b): f"m_{a}{b}" for a, b in pairs if a != b}


_SHOWN = ("steady", "loss", "table", "angle", "battery", "fraction")
"""The kinds of quantities that have their own equations, or are described in words."""


def _inlined(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas that replace their names. A name stays if it has its own equation."""
    names = equation.names
    kept = {name.identifier for kind in _SHOWN for name in names.of_kind(kind)} | layout.places.keys()
    kept |= _rotation(layout, equation).keys()
    for thruster in layout.thrusters:
        if names("mixed", thruster.name).identifier in equation.thrust:
            kept.add(names("command", thruster.name).identifier)
        if "c_0" in layout.curve_of[thruster.name].keys:
            kept.add(names("beyond", thruster.name).identifier)
    found = {name: formula for name, formula in equation.program.items() if name not in kept}
    if layout.has_attitude:
        found["square_length"] = Number(1.0)
    for v in layout.by_velocity:
        if _has_effective_inertia(layout, equation):
            found[names("gain", v).identifier] = 1.0 / Name(f"M_{v}")
        found[names("mass", v + v).identifier] = Name(f"M_{v}")
    for (a, b), name in _mass_entries(equation).items():
        found[names("mass", a + b).identifier] = Name(name)
    for inverse_mass in names.of_kind("inverse"):  # the page multiplies by the mass matrix instead of its inverse
        row, column = tuple(inverse_mass.owners[0])
        found[inverse_mass.identifier] = Number(float(row == column))
    return found


def _has_effective_inertia(layout: Layout, equation: Equation) -> bool:
    """Return True if the effective inertias have equations of their own."""
    return layout.coupled or bool(_mass_entries(equation)) or any("m_a" in form.keys for form in layout.axes)


def choices(lines: Iterable[Line]) -> list[Choice]:
    """Return the parameters in these equations that depend on a direction."""
    return list(dict.fromkeys(choice for line in lines for choice in _choices(line.right)))


def _choices(terms: Sum) -> Iterator[Choice]:
    """Yield the parameters in a sum that depend on a direction."""
    for factor in (factor for product in terms for factor in (*product.above, *product.below)):
        if isinstance(factor, Choice):
            yield factor
        elif isinstance(factor, Group | Call):
            yield from _choices(factor.inner)
        elif isinstance(factor, Cases):
            yield from _choices((*factor.at_most_zero, *factor.otherwise))


# ---- Written ---------------------------------------------------------------------------------------------------------


def symbols(layout: Layout) -> dict[str, Symbol]:
    """Return the symbol of every name in the equations of a vehicle."""
    names = equation_of(layout).names
    found = {name: Symbol(name) for name in (*layout.velocities, *layout.pose)}
    found |= {"phi": Symbol("φ"), "theta": Symbol("θ"), "psi": Symbol("ψ"), "eta": Symbol("η")}
    found |= {f"epsilon_{n}": Symbol("ε", f"{n}") for n in (1, 2, 3)}
    found |= {name: Symbol(*name.split("_", 1)) for name in (*layout.inputs, *BODY, *RESTORING, *rotation_formulas())}
    found |= {"R": Symbol("R"), "gamma": Symbol("γ")}
    for key, *velocities in layout.cross:
        name = cross_name(key, *velocities)
        letter, _, rest = name.partition("_")
        found[name] = Symbol(letter, *rest.split("_"))
    found |= {name: Symbol("u", name.removeprefix("delayed_u_"), "d") for name in layout.delayed}
    mark = "d" if layout.has_dead_time else ""
    found |= {
        names("fraction", name).identifier: Symbol("u", name.removeprefix("u_"), mark) for name in layout.commands
    }
    found |= {names("battery").identifier: Symbol("U"), "T_d": Symbol("T", "d")}
    for fin in layout.fins:
        found[names("angle", fin.name).identifier] = Symbol("δ", fin.name)
        found |= {fin.coefficient(key): Symbol(letter, fin.name) for key, letter in (("lift", "l"), ("drag", "d"))}
        found[fin.coefficient("angle_max")] = Symbol("δ", "max", fin.name)
    for t in layout.thrusters:
        letters = {"command": "c", "beyond": "m", "loss": "k"}
        found |= {names(kind, t.name).identifier: Symbol(letter, t.name) for kind, letter in letters.items()}
        found |= {names("table", t.name).identifier: Symbol("f", t.curve), f"F_{t.name}": Symbol("F", t.name)}
        found[names("steady", t.name).identifier] = Symbol("F", t.name, mark="*")
    for curve in layout.curves:
        found[f"tau_{curve.name}"] = Symbol("τ", curve.name)
        found |= {curve.coefficient(key): _coefficient(key, curve.name) for key in CURVE if key in curve.keys}
    for form in layout.axes:
        v = form.axis.velocity
        found |= {form.coefficient(key): _coefficient(key, v) for key in AXIS if key in form.keys}
        found |= {form.axis.coefficient(key): Symbol({"alpha": "α", "beta": "β"}[key], v) for key in TUNING}
        found[f"M_{v}"] = Symbol("M", v)
        found |= {f"m_{v}{other}": Symbol("m", f"{v}{other}") for other in layout.velocities}
    return found


def _coefficient(key: str, owner: str) -> Symbol:
    """Return the symbol of a coefficient of a curve or an axis.

    a_t of the curve rear is the letter a with the index t below and rear above; T has only the index below.
    """
    letter, _, index = key.removesuffix(REVERSE).partition("_")
    mark = "−" if key.endswith(REVERSE) else ""
    return Symbol(letter, index, owner, mark) if index else Symbol(letter, owner, "", mark)


class Text:
    """Equations as plain text, with the names of the FMU's variables."""

    forms: Mapping[str, str] = {
        "dotted": "{}'",
        "number": "{}",
        "equal": "{} = {}",
        "sign": " {} ",
        "first": "{}",
        "fraction": "{} / {}",
        "power": "{0}{2}",
        "bracket": "({})",
        "abs": "|{}|",
        "sgn": "sgn({})",
        "sqrt": "√({})",
        "atan2": "atan2({}, {})",
        "pow": "({})^{}",
        "function": "{} {}",
        "cases": "{1} where {0} > 0, else {2}",
    }

    def __init__(self, layout: Layout) -> None:
        self._symbols = symbols(layout)

    def line(self, line: Line) -> str:
        """Write one equation."""
        name = self.factor(line.name)
        rate = self.write("dotted", name) if line.is_rate else name
        left = self.side_by_side([*map(self.factor, line.factors), rate])
        for factor, other in line.coupled:
            left += self.write("sign", "+")
            left += self.side_by_side([self.factor(factor), self.write("dotted", self.factor(other))])
        return self.write("equal", left, self.sum(line.right))

    def sum(self, terms: Sum) -> str:
        """Write a sum."""
        text = ""
        for product in terms:
            if text or product.sign < 0:
                text += self.write("sign" if text else "first", "−" if product.sign < 0 else "+")
            if product.below:
                text += self.write("fraction", *map(self.part, (product.above, product.below)))
            else:
                text += self.factors(product.above)
        return text or self.write("number", "0")

    def factors(self, factors: tuple[Factor, ...]) -> str:
        """Write a product."""
        counts = [(self.factor(factor), len(list(equal))) for factor, equal in groupby(factors)]
        texts = [self.write("power", text, n, str(n).translate(RAISED)) if n > 1 else text for text, n in counts]
        return self.side_by_side(texts) or self.write("number", "1")

    def part(self, factors: tuple[Factor, ...]) -> str:
        """Write the numerator or the denominator of a fraction."""
        return self.factors(factors) if len(factors) < 2 else self.write("bracket", self.factors(factors))

    def factor(self, factor: Factor) -> str:
        """Write a factor."""
        match factor:
            case str():
                return self.symbol(self._symbols[factor])
            case float():
                return self.write("number", number(factor, 4))
            case Choice():
                return self.symbol(replace(self._symbols[factor.forward], mark="±"))
            case Group():
                return self.write("bracket", self.sum(factor.inner))
            case Call():
                parts = self.sum(factor.inner), self.sum(factor.second)
                is_own = factor.function in self.forms
                return self.write(*([] if is_own else ["function"]), factor.function, *parts)
            case Cases():
                values = self.sum(factor.otherwise), self.sum(factor.at_most_zero)
                return self.write("cases", self.factor(factor.name), *values)

    def write(self, form: str, *parts: object) -> str:
        """Fill the parts into one of the forms."""
        return self.forms[form].format(*parts)

    def symbol(self, symbol: Symbol) -> str:
        """Write a letter and its indices."""
        name = "_".join(part for part in (symbol.letter, symbol.index, symbol.upper) if part)
        return name + {"−": REVERSE}.get(symbol.mark, symbol.mark)

    def side_by_side(self, factors: Iterable[str]) -> str:
        """Write factors one after the other."""
        return " ".join(factors)


class MathML(Text):
    """Equations in MathML, for the page."""

    _CELL = '<mtd style="text-align: left">'
    forms: Mapping[str, str] = {
        "dotted": "<mover>{}<mo>˙</mo></mover>",
        "number": "<mn>{}</mn>",
        "equal": "{}<mo>=</mo>{}",
        "sign": "<mo>{}</mo>",
        "first": '<mo form="prefix">{}</mo>',
        "fraction": "<mfrac><mrow>{}</mrow><mrow>{}</mrow></mfrac>",
        "power": "<msup>{0}<mn>{1}</mn></msup>",
        "bracket": '<mrow><mo stretchy="false">(</mo>{}<mo stretchy="false">)</mo></mrow>',
        "abs": '<mrow><mo stretchy="false">|</mo>{}<mo stretchy="false">|</mo></mrow>',
        "sqrt": "<msqrt>{}</msqrt>",
        "atan2": '<mi>atan2</mi><mrow><mo stretchy="false">(</mo>{}<mo>,</mo>{}<mo stretchy="false">)</mo></mrow>',
        "pow": '<msup><mrow><mo stretchy="false">(</mo>{}<mo stretchy="false">)</mo></mrow><mrow>{}</mrow></msup>',
        "sgn": '<mi>sgn</mi><mrow><mo stretchy="false">(</mo>{}<mo stretchy="false">)</mo></mrow>',
        "function": '<mspace width=".17em"/><mi>{}</mi><mspace width=".17em"/>{}<mspace width=".17em"/>',
        "cases": f"<mrow><mo>{{{{</mo><mtable><mtr>{_CELL}{{1}}</mtd>"
        f"{_CELL}<mtext>for\xa0</mtext>{{0}}<mo>&gt;</mo><mn>0</mn></mtd></mtr><mtr>{_CELL}{{2}}</mtd>{_CELL}<mtext>otherwise</mtext></mtd></mtr></mtable></mrow>",
    }

    def terms(self, line: Line) -> Iterator[str]:
        """Yield the left side with the first term, and then each term: a line may break between them."""
        first, *others = line.right
        yield self.line(replace(line, right=(first,)))
        for product in others:
            sign = "−" if product.sign < 0 else "+"
            yield f'<mo form="infix">{sign}</mo>{self.sum((replace(product, sign=1),))}'

    def symbol(self, symbol: Symbol) -> str:
        letter, index, upper = (
            f"<mi>{escape(part)}</mi>" if part else "" for part in (symbol.letter, symbol.index, symbol.upper)
        )
        if symbol.mark:
            upper = f'<mrow>{upper}<mo lspace="0" rspace="0">{symbol.mark}</mo></mrow>'
        if upper:
            return f"<msubsup>{letter}{index or '<mrow/>'}{upper}</msubsup>"
        return f"<msub>{letter}{index}</msub>" if index else letter

    def part(self, factors: tuple[Factor, ...]) -> str:
        match factors:
            case (Group(inner=inner),):  # the bar replaces the brackets
                return self.sum(inner)
        return self.factors(factors)

    def side_by_side(self, factors: Iterable[str]) -> str:
        text = ""
        for factor in factors:  # without a space, an index touches the letter after it
            space = text.endswith(("</mn>", "</msub>")) and not factor.startswith("<mrow>")
            text += f'<mspace width=".1em"/>{factor}' if space else factor
        return text
