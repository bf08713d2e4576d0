"""The equation of motion for NumPy arrays, CasADi symbols (SX, MX, DM) and JAX arrays, chosen by the arguments.

The rates need only + - * /, sin, cos, sqrt, and a choice by the sign of a velocity. The thrust also needs powers and
thrust tables. So the rates take forces, and another function gives the forces for the commands.
"""

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np

from rov_fmu.equation.expression import ARRAYS, Expression, Name, array_functions, compiled
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import CommandTable
from rov_fmu.equation.python.step import cubic
from rov_fmu.equation.terms import Equation, equation_of
from rov_fmu.io.messages import InputError, did_you_mean
from rov_fmu.vehicle.vehicle import Vehicle

_FORMULAS = 100
"""The most layouts and libraries whose compiled formulas are kept."""


_Stack = Callable[[Sequence[Any]], Any]
"""Makes one vector of its components, each a number or an array."""


@dataclass(frozen=True, eq=False)
class _Library:
    functions: Mapping[str, Callable[..., Any]]
    """The functions that formulas may call: sin, cos, sqrt, pow, where, both, either; and `interval`.

    `interval(x, knots, columns)` returns from each column the number of the interval between the rising knots that
    contains x; the outer intervals have no end."""
    stack: _Stack


def rates(vehicle: Vehicle, x: Any, forces: Any, p: Mapping[str, Any]) -> Any:
    """Return the time derivatives of the states, as described in `VehicleModel.rates`."""
    layout = vehicle.layout
    library = _library_of((x, forces, *p.values()))
    values = {
        **_coefficients(vehicle, p),
        **_components("x", x, tuple(layout.state)),
        **_components("forces", forces, force_names(layout)),
    }
    numbers = _rates(layout, library)(values)
    return library.stack([numbers[f"der_{name}"] for name in layout.state])


def forces(vehicle: Vehicle, inputs: Mapping[str, Any], p: Mapping[str, Any]) -> Any:
    """Return the forces for the inputs, as described in `VehicleModel.forces`."""
    layout = vehicle.layout
    _check_names("inputs", "input", inputs, layout.inputs)
    library = _library_of((*inputs.values(), *p.values()))
    numbers = _thrust(layout, library)({**_coefficients(vehicle, p), **layout.usual_inputs, **inputs})
    return library.stack([numbers[name] for name in force_names(layout)])


@lru_cache(maxsize=_FORMULAS)
def force_names(layout: Layout) -> tuple[str, ...]:
    """Return the names of the forces that the rates take.

    These are the steady thrust of each thruster, F_… or, when it lags, steady_…; the loss of thrust by the speed of
    advance, loss_…, and the angle of each fin, angle_…, where the vehicle has them; and the inputs that are no
    commands: the loads from outside (X_ext …) and the current (V_N …). A rotor that lags has its steady speed,
    speed_…, in place of the thrust and the loss, and the factor of its thrust by the voltage, by_voltage_….
    """
    equation = equation_of(layout)
    formulas = (*_before_rates(equation).values(), *equation.rates.values())
    used = frozenset().union(*(formula.names for formula in formulas))
    return tuple(name for name in (*equation.thrust, *layout.inputs) if name in used)


def _coefficients(vehicle: Vehicle, p: Mapping[str, Any]) -> dict[str, Any]:
    _check_names("p", "coefficient", p, vehicle.layout.coefficients)
    return {**vehicle.coefficients, **p}


def _check_names(what: str, kind: str, given: Iterable[str], known: Iterable[str]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"{what}[{name!r}]: the vehicle has no such {kind}{did_you_mean(str(name), [*known])}")


def _components(what: str, vector: Any, names: Sequence[str]) -> dict[str, Any]:
    """Return the components of a vector by their names. Raises InputError if their number is another."""
    if isinstance(vector, Sequence):
        vector = np.array(vector, dtype=float)
    shape = tuple(vector.shape)
    if shape[:1] != (len(names),):
        raise InputError(f"{what}: must have {len(names)} rows ({', '.join(names)}), and has the shape {shape}")
    return {name: vector[n] for n, name in enumerate(names)}


# ---- Formulas --------------------------------------------------------------------------------------------------------

_Compiled = Callable[[Mapping[str, Any]], dict[str, Any]]


@lru_cache(maxsize=_FORMULAS)
def _rates(layout: Layout, library: _Library) -> _Compiled:
    """Compile the formulas from the coefficients, the states and the forces to the rates, der_… by state."""
    equation = equation_of(layout)
    rates = {f"der_{name}": rate for name, rate in equation.rates.items()}
    return compiled({**_before_rates(equation), **rates}, library.functions, ARRAYS)


@lru_cache(maxsize=_FORMULAS)
def _thrust(layout: Layout, library: _Library) -> _Compiled:
    """Compile the formulas from the coefficients and the inputs to the forces."""
    equation, interval = equation_of(layout), library.functions["interval"]
    tables = {name: _table_force(table, interval) for name, table in equation.tables.items()}
    delayed = {later: Name(name) for name, later in layout.acting.items()}
    return compiled({**delayed, **equation.thrust}, {**library.functions, **tables}, ARRAYS)


def _before_rates(equation: Equation) -> dict[str, Expression]:
    """Return the formulas from coefficients, states and forces to the numbers in the rates."""
    return {name: formula for name, formula in equation.program.items() if name not in equation.thrust}


def _table_force(table: CommandTable, interval: Callable[..., Any]) -> Callable[[Any], Any]:
    """Return the force of a thrust table as a function of the command, as `CommandTable.value` computes it."""
    rows = table.commands, table.values, table.slopes
    columns = [row[:-1] for row in rows] + [row[1:] for row in rows]

    def force(command: Any) -> Any:
        low, f, slope, high, g, slope_after = interval(command, table.commands, columns)
        h = high - low
        return cubic(f, g, h * slope, h * slope_after, (command - low) / h)

    return force


# ---- Libraries -------------------------------------------------------------------------------------------------------


def _library_of(values: Iterable[Any]) -> _Library:
    """Return the library that computes with all of these values."""
    roots = {type(value).__module__.partition(".")[0] for value in values}
    if "casadi" in roots:
        return _casadi()
    return _jax() if roots & {"jax", "jaxlib"} else _numpy()


@cache
def _numpy() -> _Library:
    return _of_arrays(np, lambda parts: np.stack(np.broadcast_arrays(*parts)).astype(float))


@cache
def _jax() -> _Library:
    jax, jnp = map(importlib.import_module, ("jax", "jax.numpy"))

    def stack(parts: Sequence[Any]) -> Any:
        if not jax.config.jax_enable_x64:
            raise InputError('JAX computes in single precision: call jax.config.update("jax_enable_x64", True) first')
        return jnp.stack(jnp.broadcast_arrays(*parts))

    return _of_arrays(jnp, stack)


def _of_arrays(library: Any, stack: _Stack) -> _Library:
    """Return the library with the functions of NumPy, or of another one with the same names."""

    def interval(x: Any, knots: Sequence[float], columns: Sequence[Sequence[float]]) -> list[Any]:
        place = library.searchsorted(library.asarray(knots[1:-1]), x, side="right")
        return [library.asarray(column)[place] for column in columns]

    return _library(stack, array_functions(library), interval)


@cache
def _casadi() -> _Library:
    casadi = importlib.import_module("casadi")

    def interval(x: Any, knots: Sequence[float], columns: Sequence[Sequence[float]]) -> list[Any]:
        t = casadi.SX.sym("t")  # pw_const does not take an MX, but a function does
        pieces = [casadi.pw_const(t, casadi.DM(knots[1:-1]), casadi.DM(column)) for column in columns]
        return [*casadi.Function("interval", [t], pieces)(x)]

    named = {"pow": casadi.power, "both": casadi.logic_and, "either": casadi.logic_or, "where": casadi.if_else}
    named |= {name: getattr(casadi, name) for name in ("sin", "cos", "sqrt")}
    return _library(lambda parts: casadi.vertcat(*parts), named, interval)


def _library(stack: _Stack, named: Mapping[str, Callable[..., Any]], interval: Callable[..., Any]) -> _Library:
    def size(x: Any) -> Any:
        return named["where"](x < 0.0, -x, x)  # with the derivative 1 at 0, as in the engine

    return _Library({**named, "abs": size, "interval": interval}, stack)
