"""The equation of a vehicle as text: M nu' is the sum of its forces, each with what makes it, and the thrust."""

from collections.abc import Iterator

from rov_fmu.equation.expression import CALL, RANKS, Language, written
from rov_fmu.equation.forces import forces_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import equation_of, mass_matrix
from rov_fmu.report.templates import number

_TEXT = Language(
    {
        "neg": "−{}",
        "-": "{} − {}",
        "*": "{} {}",
        "square": "{}²",
        "cube": "{}³",
        "abs": "|{}|",
        "directed": "{}±",
        "saturated": "{} within ±1",
    },
    {**RANKS, **dict.fromkeys(("square", "cube"), (CALL, (CALL,)))},
    lambda value: number(value, 4),
)
"""A coefficient that depends on a direction has a ±."""


def equations_of(layout: Layout) -> Iterator[tuple[str, str, str]]:
    """Yield what each formula is: a name or an axis, what it stands for, and its text."""
    equation = equation_of(layout)
    for force in forces_of(layout, equation.names):
        yield layout.by_velocity[force.axis].axis.name, force.effect.words, written(force.formula, _TEXT)
    for pair, formula in mass_matrix(layout, equation.names).entries.items():
        yield f"m_{''.join(pair)}", "entry of the mass matrix", written(formula, _TEXT)
    for name, formula in equation.thrust.items():
        yield name, "thrust", written(formula, _TEXT)
    for name in layout.pose:
        yield f"{name}'", "pose", written(equation.rates[name], _TEXT)
