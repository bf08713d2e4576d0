"""The equations of a vehicle for readers, made from its forces and from the formulas of its thrust and its pose.

A formula is shown as a sum of products, in the order in which it is built. Numbers come first, and a common first
factor stands before a bracket. The page leaves out only the saturation of commands, which its text mentions.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

from markupsafe import escape

from rov_fmu.equation.catalogue import REVERSE, YAW
from rov_fmu.equation.expression import (
    FUNCTIONS,
    PYTHON,
    Expression,
    Name,
    Number,
    Operation,
    beyond_dead_band,
    call,
    product,
    replaced,
    scaled,
    total,
    written,
)
from rov_fmu.equation.forces import COUPLING, forces_of
from rov_fmu.equation.layout import Curve, Layout, Thruster, VehicleAxis
from rov_fmu.equation.terms import ONE, Equation, equation_of, mass_matrix
from rov_fmu.equation.thrust import by_direction, steady_name
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
    """An equation: on the left a name, or a factor times a time derivative, on the right a formula."""

    name: Name
    right: Expression
    reference: str = ""
    """The number of the equation in the paper, or another publication of it."""
    factor: Expression | None = None
    """The factor of the time derivative of the name."""
    coupled: tuple[tuple[Name, Name], ...] = ()
    """The other rates on the left: their factors and the names of the variables."""


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
    formulas = _inlined(layout, equation)
    mass = mass_matrix(layout, names)
    has_effective_inertia = layout.coupled or bool(mass.entries) or any("m_a" in form.keys for form in layout.axes)

    def line(name: Name, formula: Expression, reference: str = "") -> Line:
        return Line(name, replaced(formula, formulas), reference)

    def rate(name: str, formula: Expression, factor: Expression = ONE) -> Line:
        return replace(line(Name(name), formula), factor=factor)

    def thrust(name: Name) -> list[Line]:
        """Return the equation of a quantity that follows from the commands, if the vehicle has it."""
        return [line(name, equation.thrust[name.identifier])] if name.identifier in equation.thrust else []

    def motion(form: VehicleAxis) -> Line:
        """Return the equation of motion of an axis: with effective masses on the left, if the axis has several."""
        v = form.axis.velocity
        loads = total(force.formula for force in forces_of(layout, names) if force.axis == v)
        if not has_effective_inertia:
            found = rate(v, Name(form.axis.coefficient("beta")) * loads, Name(form.axis.inertia))
            return replace(found, reference=form.axis.equations[1])
        if layout.coupled:
            by_pair = mass.products(v).items()
            munk = [(sign, _entry(*entry), pair) for pair, entries in by_pair for sign, entry in entries]
            loads = total([loads, *(scaled(sign, product(entry, *map(Name, pair))) for sign, entry, pair in munk)])
        partners = [((b if a == v else a), _entry(a, b)) for a, b in mass.entries if v in (a, b)]
        coupled = tuple((entry, Name(other)) for other, entry in partners if other in layout.by_velocity)
        return replace(rate(v, loads, _entry(v, v)), reference=form.axis.equations[1], coupled=coupled)

    inertia = [line(_entry(v, v), 1.0 / mass.gains[v]) for v in layout.by_velocity] if has_effective_inertia else []
    inertia += [line(_entry(*pair), formula) for pair, formula in mass.entries.items()]
    curves = []
    for curve in layout.curves:
        thrusters = [t for t in layout.thrusters if t.curve == curve.name]
        first = thrusters[0].name
        steady, force = steady_name(first, curve, names), Name(f"F_{first}")
        shown = [line(steady, _steady(first, curve, equation), curve.equation)]
        shown += thrust(names("beyond", first)) if "c_0" in curve.keys else []
        lag = [rate(force.identifier, steady - force, Name(curve.coefficient("T")))] if curve.has_lag else []
        by_arm = any(t.position is None for t in layout.drivers(YAW) if t in thrusters)
        tau = Name(f"tau_{curve.name}")
        turning = equation.forces.get(tau.identifier)
        torque = [] if turning is None else [line(tau, turning, "(4)" if by_arm else "")]
        curves.append(CurveLines(curve, thrusters, shown, thrust(names("loss", first)), lag, torque))
    mixed = [one for t in layout.thrusters for one in thrust(names("mixed", t.name))]
    return Equations(
        [motion(form) for form in layout.axes],
        inertia,
        [
            *(replace(one, name=names("command", *one.name.owners)) for one in mixed),
            *(one for fin in layout.fins for one in thrust(names("angle", fin.name))),
        ],
        curves,
        [rate(name, equation.rates[name]) for name in layout.pose],
        [line(Name(name), formula) for name, formula in _rotation(layout, equation).items()],
        [line(Name(name), formula) for name, formula in equation.outputs.items()],
    )


def _entry(a: str, b: str) -> Name:
    """Return the name on the page of an entry of the effective mass matrix."""
    return Name(f"M_{a}" if a == b else f"m_{a}{b}")


def _steady(thruster: str, curve: Curve, equation: Equation) -> Expression:
    """Return the steady thrust of a thruster as one writes it: with |c| c in place of a choice by the sign of c."""
    names = equation.names
    c, m = names("command", thruster), names("beyond", thruster)
    a_t, b_t, c_0 = (by_direction(c, curve, key) for key in ("a_t", "b_t", "c_0"))
    if curve.tables:
        force: Expression = Name(curve.coefficient("k_t")) * names("table", thruster)
    elif "c_0" in curve.keys:
        force = beyond_dead_band(m, c_0, call("sgn", c) * (a_t * m * m + b_t * m))
    else:
        force = a_t * call("abs", c) * c + b_t * c
    if "V_0" in curve.keys:
        by_voltage = names("battery") / Name(curve.coefficient("V_0"))
        force = force * call("pow", by_voltage, Name(curve.coefficient("n_V")))
    return scaled(1.0 / curve.together, force)


def coupled(layout: Layout) -> list[str]:
    """Return the names of the axes with Coriolis and Munk terms."""
    rows = equation_of(layout).rows
    axes = (form.axis for form in layout.axes)
    return [axis.name for axis in axes if any(term.effect is COUPLING for term in rows[axis.velocity])]


def _rotation(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas of the entries of the rotation matrix, if the vehicle rolls or pitches."""
    found = equation.orientation if layout.has_attitude else {}
    return {name: formula for name, formula in found.items() if name in equation.rows}


def _inlined(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas that replace their names, because the page has no equation of these names."""
    names = equation.names
    kinds = ("saturated", "command", "net_weight", "righting", "arm", "constant")
    inlined = {name.identifier for kind in kinds for name in names.of_kind(kind)} | {"cos_psi", "sin_psi"}
    inlined -= {
        names("command", t.name).identifier
        for t in layout.thrusters
        if names("mixed", t.name).identifier in equation.thrust
    }
    found = {name: formula for name, formula in equation.program.items() if name in inlined}
    return found | ({"square_length": Number(1.0)} if layout.has_attitude else {})


def choices(lines: Iterable[Line]) -> list[Operation]:
    """Return the parameters in these equations that depend on a direction."""
    return list(dict.fromkeys(choice for line in lines for choice in _choices(line.right)))


def _choices(x: Expression) -> Iterator[Operation]:
    if isinstance(x, Operation):
        if x.op == "directed":
            yield x
        for arg in x.args[2:] if x.op == "dead band" else x.args:  # its width has an equation of its own
            yield from _choices(arg)


# ---- Sums of products ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Product:
    """A sign, the factors above the fraction bar, and those below it. A factor is not a product itself."""

    sign: int = 1
    above: tuple[Expression, ...] = ()
    below: tuple[Expression, ...] = ()

    def __mul__(self, other: "Product") -> "Product":
        """Return the product of both, with numbers first."""
        above = sorted((*self.above, *other.above), key=lambda factor: not isinstance(factor, Number))
        return Product(self.sign * other.sign, tuple(above), (*self.below, *other.below))


def products(x: Expression) -> list[Product]:
    """Return a formula as a sum of products. Common first factors stand before a bracket: a x - a y becomes a (x - y).

    Numbers count as equal if their first twelve digits are.
    """
    alike: dict[object, list[Product]] = {}
    for place, one in enumerate(_terms(x)):
        head = one.above[0] if len(one.above) > 1 else None
        key = f"{head.value:.12g}" if isinstance(head, Number) else head or place
        alike.setdefault(key, []).append(one)
    found = []
    for first, *others in alike.values():
        rest = total(scaled(one.sign * first.sign, _quotient(one.above[1:], one.below)) for one in (first, *others))
        found.append(Product(first.sign, first.above[:1]) * _product(rest) if others else first)
    return found


def _quotient(above: Iterable[Expression], below: tuple[Expression, ...]) -> Expression:
    return product(*above) / product(*below) if below else product(*above)


def _terms(x: Expression) -> list[Product]:
    match x:
        case Number(0.0):
            return []
        case Operation("+" | "-" as op, (left, right)):
            sign = Product(1 if op == "+" else -1)
            return _terms(left) + [sign * one for one in _terms(right)]
    one = _product(x)
    is_sum = len(one.above) == 1 and not one.below and _is_sum(one.above[0])
    return [Product(one.sign) * term for term in _terms(one.above[0])] if is_sum else [one]


def _is_sum(x: Expression) -> bool:
    return isinstance(x, Operation) and x.op in ("+", "-")


def _product(x: Expression) -> Product:  # noqa: PLR0911 - a case for each operation
    """Return a formula as one product, in which a sum of several products is a factor."""
    match x:
        case Number(1.0):
            return Product()
        case Operation("neg", (inner,)):
            return Product(-1) * _product(inner)
        case Operation("saturated", (inner,)):
            return _product(inner)
        case Operation("*", (left, right)):
            return _product(left) * _product(right)
        case Operation("/", (left, right)):
            below = _product(right)
            return _product(left) * Product(below.sign, below.below, below.above)
        case Operation("+" | "-"):
            terms = products(x)
            if len(terms) == 1:
                return terms[0]
            if all(one.sign < 0 for one in terms):
                return Product(-1, (total(_quotient(one.above, one.below) for one in terms),))
    return Product(1, (x,))


# ---- Written ---------------------------------------------------------------------------------------------------------


_LETTERS = {
    **{"alpha": "α", "beta": "β", "gamma": "γ", "phi": "φ", "theta": "θ", "psi": "ψ", "eta": "η", "epsilon": "ε"},
    **{"tau": "τ", "angle": "δ", "lift": "l", "drag": "d", "delayed": "u"},
    **{"command": "c", "beyond": "m", "loss": "k", "table": "f", "steady": "F", "battery": "U", "fraction": "u"},
}
"""The letters of quantities whose names begin with a word or whose letter is another one."""
_INDICES = ("t", "d", "a", "0", "V", "max", "u")
"""What stands below a letter, so that the name of a part or an axis stands above: a_t_rear, but T_rear."""


def symbol_of(name: Name) -> Symbol:
    """Return the symbol of a name: a letter with the indices that its identifier has, as in m_a_u or alpha_u."""
    stem = name.identifier.removesuffix(REVERSE)
    head, *rest = stem.split("_", 1)
    if name.kind:
        head, index, upper = name.kind, "_".join(name.owners).removeprefix("u_"), ""
    elif head == "delayed":
        index, upper = rest[0].removeprefix("u_"), "d"
    else:
        index, _, upper = rest[0].partition("_") if rest else ("", "", "")
        if upper and index not in _INDICES:
            index, upper = rest[0], ""
    mark = "−" if stem != name.identifier else "*" if head == "steady" else ""
    return Symbol(_LETTERS.get(head, head), index, upper, mark)


class Text:
    """Equations as plain text, with the names of the FMU's variables."""

    forms: Mapping[str, str] = {
        "rate": "{}'",
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
        self._is_late = layout.has_dead_time

    def line(self, line: Line) -> str:
        """Write one equation."""
        left = self.factor(line.name)
        if line.factor is not None:
            left = self.rate(line.factor, line.name)
        for factor, name in line.coupled:
            left += self.write("sign", "+") + self.rate(factor, name)
        return self.write("equal", left, self.sum(line.right))

    def rate(self, factor: Expression, name: Name) -> str:
        """Write a factor times a time derivative."""
        return self.factors((factor, call("rate", name)) if factor != ONE else (call("rate", name),))

    def sum(self, x: Expression) -> str:
        """Write a formula as a sum of products."""
        return self.terms(products(x))

    def terms(self, terms: Iterable[Product]) -> str:
        """Write a sum of products."""
        text = ""
        for one in terms:
            if text or one.sign < 0:
                text += self.write("sign" if text else "first", "−" if one.sign < 0 else "+")
            if one.below:
                text += self.write("fraction", self.part(one.above), self.part(one.below))
            else:
                text += self.factors(one.above)
        return text or self.write("number", "0")

    def factors(self, factors: tuple[Expression, ...]) -> str:
        """Write a product."""
        counts = [(self.factor(factor), len(list(equal))) for factor, equal in groupby(factors)]
        texts = [self.write("power", text, n, str(n).translate(RAISED)) if n > 1 else text for text, n in counts]
        return self.side_by_side(texts) or self.write("number", "1")

    def part(self, factors: tuple[Expression, ...]) -> str:
        """Write the numerator or the denominator of a fraction."""
        return self.factors(factors) if len(factors) < 2 else self.write("bracket", self.factors(factors))

    def factor(self, x: Expression) -> str:  # noqa: PLR0911 - a case for each kind of factor
        """Write a factor. Raises ValueError if there is no way to show it."""
        match x:
            case Name():
                return self.symbol(self.symbol_of(x))
            case Number(value):
                return self.write("number", number(value, 4))
            case Operation("directed", (_, Name() as forward, _)):
                return self.symbol(replace(self.symbol_of(forward), mark="±"))
            case Operation("dead band", (beyond, _, force)):
                return self.write("cases", self.factor(beyond), self.sum(force), self.sum(Number(0.0)))
            case Operation("+" | "-"):
                return self.write("bracket", self.sum(x))
            case Operation(function, args) if function in self.forms:
                return self.write(function, *map(self.sum, args))
            case Operation(function, (argument,)) if function in FUNCTIONS:
                return self.write("function", function, self.sum(argument))
        raise ValueError(f"{written(x, PYTHON)}: there is no way to show this")

    def symbol_of(self, name: Name) -> Symbol:
        """Return the symbol of a name. A fraction of the command is one that acts after the dead time."""
        symbol = symbol_of(name)
        return replace(symbol, upper="d") if name.kind == "fraction" and self._is_late else symbol

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
        "rate": "<mover>{}<mo>˙</mo></mover>",
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

    def parts(self, line: Line) -> Iterator[str]:
        """Yield the left side with the first term, and then each term: a line may break between them."""
        first, *others = products(line.right)
        left = self.line(replace(line, right=Number(0.0))).removesuffix(self.sum(Number(0.0)))
        yield left + self.terms([first])
        for one in others:
            sign = "−" if one.sign < 0 else "+"
            yield f'<mo form="infix">{sign}</mo>{self.terms([replace(one, sign=1)])}'

    def symbol(self, symbol: Symbol) -> str:
        letter, index, upper = (
            f"<mi>{escape(part)}</mi>" if part else "" for part in (symbol.letter, symbol.index, symbol.upper)
        )
        if symbol.mark:
            upper = f'<mrow>{upper}<mo lspace="0" rspace="0">{symbol.mark}</mo></mrow>'
        if upper:
            return f"<msubsup>{letter}{index or '<mrow/>'}{upper}</msubsup>"
        return f"<msub>{letter}{index}</msub>" if index else letter

    def part(self, factors: tuple[Expression, ...]) -> str:
        if len(factors) == 1 and _is_sum(factors[0]):  # the bar replaces the brackets
            return self.sum(factors[0])
        return self.factors(factors)

    def side_by_side(self, factors: Iterable[str]) -> str:
        text = ""
        for factor in factors:  # without a space, an index touches the letter after it
            space = text.endswith(("</mn>", "</msub>")) and not factor.startswith("<mrow>")
            text += f'<mspace width=".1em"/>{factor}' if space else factor
        return text
