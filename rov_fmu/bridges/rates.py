"""The rates of a vehicle's states as functions of numbers, arrays or symbols of any library.

The rates need only + - * /, sin, cos, sqrt, and a choice by the sign of a velocity. The thrust also needs powers and
thrust tables. So the rates take forces, and another function gives the forces for the commands.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.equation.expression import ARRAYS, Expression, Name, compiled
from rov_fmu.equation.layout import Layout, ThrustTable
from rov_fmu.equation.step import cubic
from rov_fmu.equation.terms import Equation, equation_of

Functions = Mapping[str, Callable[..., Any]]
"""The functions of a library that formulas may call: sin, cos, sqrt, pow, where, both, either; and `interval`.

`interval(x, knots, columns)` returns from each column the number of the interval between the rising knots that contains
x; the outer intervals have no end."""
Values = Mapping[str, Any]
_FORMULAS = 100
"""The most layouts and libraries whose compiled formulas are kept."""


@lru_cache(maxsize=_FORMULAS)
def force_names(layout: Layout) -> tuple[str, ...]:
    """Return the names of the forces that the rates take.

    These are the steady thrust of each thruster, F_… or, when it lags, steady_…; the loss of thrust by the speed of
    advance, loss_…, and the angle of each fin, angle_…, where the vehicle has them; and the inputs that are no
    commands: the loads from outside (X_ext …) and the current (V_N …).
    """
    equation = equation_of(layout)
    formulas = (*_before_rates(equation).values(), *equation.rates.values())
    used = frozenset().union(*(formula.names for formula in formulas))
    return tuple(name for name in (*equation.thrust, *layout.inputs) if name in used)


def rates_of(layout: Layout, values: Values, functions: Functions) -> list[Any]:
    """Return the time derivatives of the states, in the order of `layout.state`.

    `values` contains the coefficients, the states and the forces of `force_names` by name.
    """
    found = _rates(layout, tuple(functions.items()))(values)
    return [found[f"der_{name}"] for name in layout.state]


def forces_of_commands(layout: Layout, values: Values, functions: Functions) -> list[Any]:
    """Return the forces in the order of `force_names`. `values` contains the coefficients and the inputs by name."""
    found = _thrust(layout, tuple(functions.items()))(values)
    return [found[name] for name in force_names(layout)]


_Known = tuple[tuple[str, Callable[..., Any]], ...]


@lru_cache(maxsize=_FORMULAS)
def _rates(layout: Layout, functions: _Known) -> Callable[[Values], dict[str, Any]]:
    equation = equation_of(layout)
    rates = {f"der_{name}": rate for name, rate in equation.rates.items()}
    return compiled({**_before_rates(equation), **rates}, dict(functions), ARRAYS)


@lru_cache(maxsize=_FORMULAS)
def _thrust(layout: Layout, functions: _Known) -> Callable[[Values], dict[str, Any]]:
    known = dict(functions)
    equation = equation_of(layout)
    tables = {name: _table_force(table, known["interval"]) for name, table in equation.tables.items()}
    delayed = {delayed_name(name): Name(name) for name in layout.commands} if layout.has_dead_time else {}
    return compiled({**delayed, **equation.thrust}, {**known, **tables}, ARRAYS)


def _before_rates(equation: Equation) -> dict[str, Expression]:
    """Return the formulas from coefficients, states and forces to the numbers in the rates."""
    return {name: formula for name, formula in equation.program.items() if name not in equation.thrust}


def _table_force(table: ThrustTable, interval: Callable[..., Any]) -> Callable[[Any], Any]:
    """Return the force of a thrust table as a function of the command, as `ThrustTable.force` computes it."""
    rows = table.commands, table.forces, table.slopes
    columns = [row[:-1] for row in rows] + [row[1:] for row in rows]

    def force(command: Any) -> Any:
        low, f, slope, high, g, slope_after = interval(command, table.commands, columns)
        h = high - low
        return cubic(f, g, h * slope, h * slope_after, (command - low) / h)

    return force
