"""The dependencies of rates and calculated variables, derived from the equation of a vehicle (standard library only).

FMI wants to know on which inputs and states each output and each derivative depends, and of which kind the dependency
is (dependenciesKind). The formulas of the equation are differentiated symbolically, one after the other. The names that
remain in a derivative give the kind: without any name, the factor is constant.
"""

from collections.abc import Mapping

from .attitude import QUATERNION, start_angle_formulas, start_formulas
from .catalogue import rate_name
from .expression import ZERO, Expression, change_of, tangent
from .layout import Layout
from .python.step import formula_name
from .terms import equation_of

KINDS = ("constant", "fixed", "tunable", "dependent")
"""The kinds of factors (FMI 2.0, section 2.2.8).

They are in this order: an importer knows most about a constant factor, and least about a dependent one."""


def dependencies_of(layout: Layout) -> dict[str, dict[str, str]]:
    """Return, for each rate and each calculated variable, the inputs and states that it depends on, each with its kind.

    The rate of a state is called `der(<state>)`. Inputs and states without influence are left out.
    """
    formulas = _formulas(layout)
    slopes: dict[str, dict[str, int]] = {name: {} for name in formulas}
    kinds = _kinds(layout, formulas)
    for known in (*layout.inputs, *layout.state):
        kind_of_slope = {known: 0}  # the derivative of the known itself is 1
        for name, formula in formulas.items():
            changing = {other: change_of(other) for other in formula.names if other in kind_of_slope}
            if (slope := tangent(formula, changing)) != ZERO:
                inner = kinds | {change.identifier: kind_of_slope[other] for other, change in changing.items()}
                kind_of_slope[name] = slopes[name][known] = max(inner[word] for word in slope.names)
    return {
        variable: {known: KINDS[kind] for known, kind in slopes[name].items()}
        for variable, name in _calculated(layout).items()
    }


def parameters_of(layout: Layout) -> dict[str, tuple[str, ...]]:
    """Return for each variable that is calculated at the start the parameters that it depends on, in the FMU's order.

    The parameters are the coefficients and the Euler angles at the start, which the quaternion follows from.
    """
    formulas = _formulas(layout)
    if layout.has_attitude:
        formulas = start_formulas() | formulas | start_angle_formulas()
    used: dict[str, set[str]] = {}
    for name, formula in formulas.items():
        used[name] = set().union(*(used.get(other, {other}) for other in formula.names))
    parameters = (*layout.coefficients, *layout.initial)
    calculated = _calculated(layout) | {name: name for name in QUATERNION if name in layout.state}
    return {variable: tuple(p for p in parameters if p in used[name]) for variable, name in calculated.items()}


def _calculated(layout: Layout) -> dict[str, str]:
    """Return the names in formulas of the rates and the calculated variables."""
    return {name: formula_name(name) for name in (*map(rate_name, layout.state), *layout.calculated)}


def _formulas(layout: Layout) -> dict[str, Expression]:
    """Return all formulas of a vehicle. Each uses only inputs, states, parameters and formulas before it."""
    equation = equation_of(layout)
    rates = {formula_name(rate_name(name)): equation.rates[name] for name in layout.state}
    return equation.program | rates | dict(equation.outputs)


def _kinds(layout: Layout, formulas: Mapping[str, Expression]) -> dict[str, int]:
    """Return for each name its kind as a factor, which is an index of KINDS."""
    kinds = dict.fromkeys((*layout.inputs, *layout.state), KINDS.index("dependent"))
    kinds |= dict.fromkeys(layout.memory, KINDS.index("fixed"))  # it changes only in events
    for name, declaration in layout.coefficients.items():
        kinds[name] = KINDS.index("tunable" if declaration.tunable else "fixed")
    for name, formula in formulas.items():
        kinds[name] = max((kinds[other] for other in formula.names), default=0)
    return kinds
