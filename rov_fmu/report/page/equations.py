"""The equations of a vehicle for readers, made from the formulas of its equation of motion (rov_fmu/model/)."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

from markupsafe import escape

from rov_fmu.model.equation import Equation, equation_of
from rov_fmu.model.layout import AXIS, BODY, CURVE, REVERSE, TUNING, YAW, Curve, Layout, Thruster
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


@dataclass(frozen=True)
class CurveLines:
    """The equations of a thrust curve, for the first of its thrusters."""

    curve: Curve
    thrusters: list[Thruster]
    thrust: list[Line]
    lag: list[Line]
    torque: list[Line]


@dataclass(frozen=True)
class Equations:
    """The equations of a vehicle."""

    motion: list[Line]
    inertia: list[Line]
    """The effective inertias M, if axes are coupled or have an added mass."""
    commands: list[Line]
    """The command of each thruster, if inputs are mixed."""
    curves: list[CurveLines]
    pose: list[Line]

    def __iter__(self) -> Iterator[Line]:
        """Iterate over all equations in the order of the page."""
        of_curves = (line for curve in self.curves for line in (*curve.thrust, *curve.lag, *curve.torque))
        yield from (*self.motion, *self.inertia, *self.commands, *of_curves, *self.pose)


def of(layout: Layout) -> Equations:
    """Return the equations of a vehicle."""
    equation = equation_of(layout)
    inlined = _inlined(layout, equation)
    reader = Reader(inlined)

    def line(name: str, formula: str, reference: str = "") -> Line:
        return Line((), name, False, arranged(reader.read(formula)), reference)

    def rate(name: str, formula: str, reference: str = "") -> Line:
        """Return the equation of a time derivative, multiplied by the divisors that all its terms share."""
        right = reader.read(formula)
        below = [factor for factor in right[0].below if all(factor in p.below for p in right)]
        for factor in below:
            right = tuple(Product(p.sign, p.above, tuple(f for f in p.below if f != factor)) for p in right)
        return Line(tuple(below), name, True, arranged(right), reference)

    inertia = []
    for v in (form.axis.velocity for form in layout.axes if _has_effective_inertia(layout)):
        inertia.append(Line((), f"M_{v}", False, inverse(Reader({}).read(equation.parameters[f"gain_{v}"]))))
    curves = []
    for curve in layout.curves:
        thrusters = [t for t in layout.thrusters if t.curve == curve.name]
        first = thrusters[0].name
        name = f"steady_{first}" if curve.has_lag else f"F_{first}"
        thrust = [line(name, equation.thrust[name], curve.equation)]
        if f"beyond_{first}" not in inlined:
            thrust.append(line(f"beyond_{first}", equation.thrust[f"beyond_{first}"]))
        lag = [rate(f"F_{first}", equation.lagging[f"F_{first}"][0])] if curve.has_lag else []
        by_arm = any(t.position is None for t in layout.drivers(YAW) if t in thrusters)
        tau = f"tau_{curve.name}"
        torque = [line(tau, equation.forces[tau], "(4)" if by_arm else "")] if tau in equation.forces else []
        curves.append(CurveLines(curve, thrusters, thrust, lag, torque))
    mixed = [t.name for t in layout.thrusters if f"mixed_{t.name}" in equation.thrust]
    return Equations(
        [rate(f.axis.velocity, equation.rates[f.axis.velocity], f.axis.equations[1]) for f in layout.axes],
        inertia,
        [line(f"command_{name}", f"mixed_{name}") for name in mixed],
        curves,
        [rate(name, equation.rates[name]) for name in layout.pose],
    )


def _inlined(layout: Layout, equation: Equation) -> dict[str, str]:
    """Return the formulas to write in place of their names. A name with an equation of its own stays."""
    found = {
        name: formula for name, formula in equation.program.items() if not name.startswith(("F_", "tau_", "steady_"))
    }
    for thruster in layout.thrusters:
        if f"mixed_{thruster.name}" in equation.thrust:
            del found[f"command_{thruster.name}"]
        if "c_0" in layout.curve_of[thruster.name].keys:
            del found[f"beyond_{thruster.name}"]
    if _has_effective_inertia(layout):
        found |= {f"gain_{form.axis.velocity}": f"1 / M_{form.axis.velocity}" for form in layout.axes}
    return found


def _has_effective_inertia(layout: Layout) -> bool:
    """Return True if the effective inertias have equations of their own."""
    return layout.coupled or any("m_a" in form.keys for form in layout.axes)


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
    found = {name: Symbol(name) for name in (*layout.velocities, *layout.pose)} | {"psi": Symbol("ψ")}
    found |= {name: Symbol(*name.split("_", 1)) for name in (*layout.inputs, *BODY)}
    found |= {"R": Symbol("R"), "gamma": Symbol("γ")}
    for t in layout.thrusters:
        letters = {"F": "F", "command": "c", "beyond": "m"}
        found |= {f"{word}_{t.name}": Symbol(letter, t.name) for word, letter in letters.items()}
        found[f"steady_{t.name}"] = Symbol("F", t.name, mark="*")
    for curve in layout.curves:
        found[f"tau_{curve.name}"] = Symbol("τ", curve.name)
        found |= {curve.coefficient(key): _coefficient(key, curve.name) for key in CURVE if key in curve.keys}
    for form in layout.axes:
        v = form.axis.velocity
        found |= {form.coefficient(key): _coefficient(key, v) for key in AXIS if key in form.keys}
        found |= {form.axis.coefficient(key): Symbol({"alpha": "α", "beta": "β"}[key], v) for key in TUNING}
        found[f"M_{v}"] = Symbol("M", v)
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
        "function": "{} {}",
        "cases": "{1} where {0} > 0, else {2}",
    }

    def __init__(self, layout: Layout) -> None:
        self._symbols = symbols(layout)

    def line(self, line: Line) -> str:
        """Write one equation."""
        name = self.factor(line.name)
        rate = self.write("dotted", name) if line.is_rate else name
        return self.write("equal", self.side_by_side([*map(self.factor, line.factors), rate]), self.sum(line.right))

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
                inner = self.sum(factor.inner)
                is_own = factor.function in self.forms
                return self.write(factor.function, inner) if is_own else self.write("function", factor.function, inner)
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
        "sgn": '<mi>sgn</mi><mrow><mo stretchy="false">(</mo>{}<mo stretchy="false">)</mo></mrow>',
        "function": '<mspace width=".17em"/><mi>{}</mi><mspace width=".17em"/>{}<mspace width=".17em"/>',
        "cases": f"<mrow><mo>{{{{</mo><mtable><mtr>{_CELL}{{1}}</mtd>"
        f"{_CELL}<mtext>for\xa0</mtext>{{0}}<mo>&gt;</mo><mn>0</mn></mtd></mtr><mtr>{_CELL}{{2}}</mtd>{_CELL}<mtext>otherwise</mtext></mtd></mtr></mtable></mrow>",
    }

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
