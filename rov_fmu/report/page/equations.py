"""The equations of a vehicle as lines of text: its motion, thrust, lag and pose.

They follow from the forces and formulas of the equation, so that no law stands here. The text of the page says what
these lines leave out: commands saturate, and buoyancy and thrust fade out above the surface.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import add, sub, truediv

from rov_fmu.equation.attitude import TURN
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.equation.expression import (
    CALL,
    RANKS,
    Expression,
    Language,
    Name,
    Number,
    Operation,
    call,
    of,
    product,
    replaced,
    total,
    written,
)
from rov_fmu.equation.forces import AT_SURFACE, COUPLING, forces_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import Equation, equation_of, mass_matrix
from rov_fmu.equation.thrust import steady_name
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import listed
from rov_fmu.report.templates import number

_TEXT = Language(
    {
        **{"neg": "−{}", "-": "{} − {}", "*": "{} {}", "square": "{}²", "cube": "{}³", "pow": "{}^{}", "abs": "|{}|"},
        **{name: f"{name} {{}}" for name in ("sin", "cos")},
        **{"sqrt": "√({})", "rate": "{}'", "directed": "{}±", "dead band": "{2} where {0} > 0, else 0"},
    },
    {
        **{**RANKS, "*": (6, (6, 7)), "/": (5, (5, 7))},  # a product without a sign binds more than a fraction
        **dict.fromkeys(("sin", "cos"), (8, (CALL,))),
        **dict.fromkeys(("square", "cube", "rate"), (CALL, (CALL,))),
        **{"pow": (CALL, (CALL, CALL)), "dead band": (0, (0, 0, 0))},
    },
    lambda value: number(value, 4),
)
"""Plain text. A coefficient that depends on a direction has a ±."""
_LETTERS = {
    **{"alpha": "α", "beta": "β", "gamma": "γ", "phi": "φ", "theta": "θ", "psi": "ψ", "eta": "η", "epsilon": "ε"},
    **{"tau": "τ", "angle": "δ", "fraction": "u", "command": "c", "beyond": "m", "loss": "k", "table": "f"},
    **{"steady": "F", "speed": "n", "battery": "U"},
}
"""The letters of quantities whose names begin with a word."""


@dataclass(frozen=True)
class Line:
    """An equation: what is on its left, and the terms of the sum on its right, each with what it is in words."""

    left: Expression
    terms: tuple[tuple[str, Expression], ...]

    @property
    def right(self) -> Expression:
        """The sum of the terms."""
        return total(term for _, term in self.terms)

    def rows(self) -> Iterator[tuple[str, str, str]]:
        """Yield a row for each term: the left side, which only the first has, the term with its sign, and its words."""
        for n, (words, term) in enumerate(self.terms):
            text = written_out(term)
            sign = "=" if n == 0 else "" if text.startswith("−") else "+"
            yield "" if n else written_out(self.left), f"{sign} {text}" if sign else text.replace("−", "− ", 1), words


def written_out(x: Expression) -> str:
    """Write a formula as text. A quantity of the equation has a letter; a steady force or speed has a star."""

    def name_of(name: Name) -> str:
        if not name.kind:
            head, *rest = name.identifier.split("_", 1)
            return "_".join([_LETTERS.get(head, head), *rest])
        star = "*" if name.kind in ("steady", "speed") else ""
        return (
            "_".join([_LETTERS.get(name.kind, name.kind), *(owner.removeprefix("u_") for owner in name.owners)]) + star
        )

    return written(x, _TEXT, name_of)


def equations_of(layout: Layout) -> list[Line]:
    """Return the equations of a vehicle in the order of the page."""
    equation = equation_of(layout)
    inlined = _inlined(layout, equation)
    lines = [*_motion(layout, equation), *_thrust(layout, equation), *_pose(layout, equation)]
    return [
        Line(line.left, tuple((words, _as_written(replaced(term, inlined))) for words, term in line.terms))
        for line in lines
    ]


def _motion(layout: Layout, equation: Equation) -> Iterator[Line]:
    """Yield the equation of each axis, with the forces on its right, and the entries of the mass matrix."""
    mass = mass_matrix(layout, equation.names)
    forces = [force for force in forces_of(layout, equation.names) if force.effect is not AT_SURFACE]
    for v, form in layout.by_velocity.items():
        by_effect = grouped((force.effect.words, force.formula) for force in forces if force.axis == v)
        terms = {words: total(formulas) for words, formulas in by_effect.items()}
        if layout.coupled and (products := mass.products(v)):
            munk = (sign * product(_mass(*e), *map(Name, pair)) for pair, own in products.items() for sign, e in own)
            terms[COUPLING.words] = total(munk)
        partners = {b if a == v else a: _mass(a, b) for a, b in mass.entries if v in (a, b)}
        rates = {v: _mass(v, v), **{other: m for other, m in partners.items() if other in layout.by_velocity}}
        first, *others = terms.items()
        yield Line(
            total(m * _rate(other) for other, m in rates.items()),
            ((f"{form.axis.name} {form.axis.equations[1]}: {first[0]}", first[1]), *others),
        )
    for v, form in layout.by_velocity.items():
        yield _line(_mass(v, v), f"the inertia in {form.axis.name}, with its tuning", 1.0 / mass.gains[v])
    for pair, formula in mass.entries.items():
        yield _line(_mass(*pair), "an entry of the symmetric mass matrix", formula)


def _thrust(layout: Layout, equation: Equation) -> Iterator[Line]:
    """Yield the commands, and for the first thruster of each curve its thrust, its loss, its lag, and the torque."""
    names, formulas = equation.names, {**equation.thrust, **equation.forces}

    def found(name: Name, words: str, left: Name | None = None) -> Iterator[Line]:
        if formula := formulas.get(name.identifier):
            yield _line(left or name, words, formula)

    for one in layout.actuators:
        yield from found(names("mixed", one.name), f"the command of {one.name}", names("command", one.name))
    for fin in layout.fins:
        yield from found(names("angle", fin.name), f"the angle of {fin.name}")
    lags = {lag.curve.name: lag for lag in equation.lags}
    for curve in layout.curves:
        first, *others = (t.name for t in layout.thrusters if t.curve == curve.name)
        likewise = f", likewise {listed(others)}" if others else ""
        reference = f" ({curve.equation.strip('()')})" if curve.equation else ""
        lagging, steady = Name(curve.lagging(first)), steady_name(first, curve, names)
        if curve.has_rotors:
            yield from found(Name(f"F_{first}"), f"the thrust of {first}{reference}{likewise}")
            steady, reference = names("speed", first), ""
        words = "steady speed" if curve.has_rotors else "steady thrust" if curve.has_lag else "thrust"
        yield from found(steady, f"the {words} of {first}{reference}{likewise}")
        if "c_0" in curve.keys:
            yield from found(names("beyond", first), "the command beyond the dead band")
        yield from found(names("loss", first), f"the loss of {first} per speed of advance{likewise}")
        if curve.name in lags:
            yield _line(Name(curve.coefficient("T")) * _rate(lagging.identifier), "the lag", steady - lagging)
        yield from found(Name(f"tau_{curve.name}"), f"the torque of {curve.name}")


def _pose(layout: Layout, equation: Equation) -> Iterator[Line]:
    """Yield the rates of the pose and, of a vehicle that rolls or pitches, the rotation matrix and its angles."""
    for name in layout.pose:
        yield _line(_rate(name), layout.pose[name].description, equation.rates[name])
    if layout.has_attitude:
        for name, formula in equation.orientation.items():
            if name in equation.rows:
                yield _line(Name(name), "rotation from the body frame to the earth frame", formula)
        for name in layout.angles:
            yield _line(Name(name), layout.angles[name].description, equation.outputs[name])


def _line(left: Expression, words: str, formula: Expression) -> Line:
    return Line(left, ((words, formula),))


def _rate(name: str) -> Expression:
    return call("rate", Name(name))


def _mass(a: str, b: str) -> Name:
    """Return the name on the page of an entry of the effective mass matrix."""
    return Name(f"M_{a}" if a == b else f"m_{a}{b}")


def _inlined(layout: Layout, equation: Equation) -> dict[str, Expression]:
    """Return the formulas that stand in the place of their names, because the page has no line for these names."""
    names = equation.names
    kinds = ("saturated", "command", "magnitude", "by_voltage", "speed_by_voltage", "net_weight", "righting", "arm")
    inlined = {name.identifier for kind in (*kinds, "constant") for name in names.of_kind(kind)} | {*TURN}
    whole = {t.name for t in layout.thrusters if "c_0" not in layout.curve_of[t.name].keys}  # without a dead band
    inlined |= {name.identifier for name in names.of_kind("beyond") if whole.issuperset(name.owners)}
    mixed = [name for name in names.of_kind("mixed") if name.identifier in equation.thrust]
    inlined -= {names("command", *name.owners).identifier for name in mixed}
    found = {name: formula for name, formula in equation.program.items() if name in inlined}
    if layout.has_dead_time:  # a fraction is that of the command that acts
        found |= {name.identifier: Name(delayed_name(*name.owners)) for name in names.of_kind("fraction")}
    return found | ({"square_length": Number(1.0)} if layout.has_attitude else {})


def _as_written(x: Expression) -> Expression:  # noqa: PLR0911 - a case for each form
    """Return a formula as one writes it: numbers first, powers of equal factors, c in place of sgn(c) |c|."""
    match x:
        case Operation("+", (inner, Number(0.0))) | Operation("saturated", (inner,)):
            return _as_written(inner)
        case Operation("directed", (c, size, Operation("neg", (same,)))) if size == same:
            return _as_written(product(*_with_sign_of(c, [*_factors(size)])))
        case Operation("*"):
            factors = [one for factor in _factors(x) for one in _factors(_as_written(factor))]
            sizes = sorted((one for one in factors if one != _MINUS), key=lambda one: bool(one.names))
            size = product(*(_power(one, len([*equal])) for one, equal in groupby(sizes)))
            return -size if factors.count(_MINUS) % 2 else size
        case Operation("/", (Number(1.0), Operation("/", (below, above)))):
            return _as_written(above) / _as_written(below)
        case Operation("+" | "-" | "/" as op, (left, right)):
            operated: Expression = _OPERATORS[op](_as_written(left), _as_written(right))
            return operated
        case Operation(op, args):
            return Operation(op, tuple(map(_as_written, args)))
    return x


_MINUS = of(-1.0)
_OPERATORS = {"+": add, "-": sub, "/": truediv}


def _factors(x: Expression) -> Iterator[Expression]:
    """Yield the factors of a product, with -1 for each sign before one."""
    match x:
        case Operation("*", (left, right)):
            yield from (*_factors(left), *_factors(right))
        case Operation("neg", (inner,)) if x != _MINUS:
            yield from (_MINUS, *_factors(inner))
        case _:
            yield x


def _with_sign_of(c: Expression, factors: list[Expression]) -> list[Expression]:
    """Return factors times sgn(c): the last |c| becomes c, if there is one."""
    if abs(c) not in factors:
        return [call("sgn", c), *factors]
    last = len(factors) - 1 - factors[::-1].index(abs(c))
    return [*factors[:last], c, *factors[last + 1 :]]


def _power(x: Expression, count: int) -> Expression:
    return x if count == 1 else call({2: "square", 3: "cube"}[count], x)
