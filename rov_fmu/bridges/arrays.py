"""The equation of motion for NumPy arrays, CasADi symbols (SX, MX, DM) and JAX arrays, chosen by the arguments."""

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from rov_fmu.bridges.rates import Functions, force_names, forces_of_commands, rates_of
from rov_fmu.io.messages import InputError, did_you_mean
from rov_fmu.vehicle.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class _Library:
    functions: Functions
    stack: Callable[[Sequence[Any]], Any]
    """Makes one vector of its components, each a number or an array."""


def rates(vehicle: Vehicle, x: Any, forces: Any, p: Mapping[str, Any]) -> Any:
    """Return the time derivatives of the states, as described in `VehicleModel.rates`."""
    layout = vehicle.layout
    library = _library_of((x, forces, *p.values()))
    values = {
        **_coefficients(vehicle, p),
        **_components("x", x, tuple(layout.state)),
        **_components("forces", forces, force_names(layout)),
    }
    return library.stack(rates_of(layout, values, library.functions))


def forces(vehicle: Vehicle, inputs: Mapping[str, Any], p: Mapping[str, Any]) -> Any:
    """Return the forces for the inputs, as described in `VehicleModel.forces`."""
    layout = vehicle.layout
    _check_names("inputs", inputs, layout.inputs)
    library = _library_of((*inputs.values(), *p.values()))
    values = {**_coefficients(vehicle, p), **layout.usual_inputs, **inputs}
    return library.stack(forces_of_commands(layout, values, library.functions))


def _coefficients(vehicle: Vehicle, p: Mapping[str, Any]) -> dict[str, Any]:
    _check_names("p", p, vehicle.layout.coefficients)
    return {**vehicle.coefficients, **p}


def _check_names(what: str, given: Mapping[str, Any], known: Iterable[str]) -> None:
    for name in given:
        if name not in known:
            kind = {"inputs": "input", "p": "coefficient"}[what]
            raise InputError(f"{what}[{name!r}]: the vehicle has no such {kind}{did_you_mean(str(name), [*known])}")


def _components(what: str, vector: Any, names: Sequence[str]) -> dict[str, Any]:
    """Return the components of a vector by their names. Raises InputError if their number is another."""
    if isinstance(vector, Sequence):
        vector = np.array(vector, dtype=float)
    shape = tuple(vector.shape)
    if shape[:1] != (len(names),):
        raise InputError(f"{what}: must have {len(names)} rows ({', '.join(names)}), and has the shape {shape}")
    return {name: vector[n] for n, name in enumerate(names)}


# ---- Libraries -------------------------------------------------------------------------------------------------------


def _library_of(values: Iterable[Any]) -> _Library:
    """Return the library that computes with all of these values."""
    roots = {type(value).__module__.partition(".")[0] for value in values}
    if "casadi" in roots:
        return _casadi()
    return _jax() if roots & {"jax", "jaxlib"} else _numpy()


@cache
def _numpy() -> _Library:
    return _Library(_array_functions(np), lambda parts: np.stack(np.broadcast_arrays(*parts)).astype(float))


@cache
def _jax() -> _Library:
    jax = importlib.import_module("jax")
    jnp = importlib.import_module("jax.numpy")
    functions = _array_functions(jnp)

    def stack(parts: Sequence[Any]) -> Any:
        if not jax.config.jax_enable_x64:
            raise InputError('JAX computes in single precision: call jax.config.update("jax_enable_x64", True) first')
        return jnp.stack(jnp.broadcast_arrays(*parts))

    return _Library(functions, stack)


def _array_functions(library: Any) -> Functions:
    """Return the functions of NumPy, or of a library with the same names."""

    def interval(x: Any, knots: Sequence[float], columns: Sequence[Sequence[float]]) -> list[Any]:
        place = library.searchsorted(library.asarray(knots[1:-1]), x, side="right")
        return [library.asarray(column)[place] for column in columns]

    return {
        **{name: getattr(library, name) for name in ("sin", "cos", "sqrt", "where")},
        "abs": lambda x: library.where(x < 0.0, -x, x),  # with the derivative 1 at 0, as in the engine
        "pow": library.power,
        "both": library.logical_and,
        "either": library.logical_or,
        "interval": interval,
    }


@cache
def _casadi() -> _Library:
    casadi = importlib.import_module("casadi")

    def interval(x: Any, knots: Sequence[float], columns: Sequence[Sequence[float]]) -> list[Any]:
        t = casadi.SX.sym("t")  # pw_const does not take an MX, but a function does
        found = [casadi.pw_const(t, casadi.DM(knots[1:-1]), casadi.DM(column)) for column in columns]
        return [*casadi.Function("interval", [t], found)(x)]

    functions = {
        **{name: getattr(casadi, name) for name in ("sin", "cos", "sqrt")},
        "where": casadi.if_else,
        "abs": lambda x: casadi.if_else(x < 0.0, -x, x),  # with the derivative 1 at 0, as in the engine
        "pow": casadi.power,
        "both": casadi.logic_and,
        "either": casadi.logic_or,
        "interval": interval,
    }
    return _Library(functions, lambda parts: casadi.vertcat(*parts))
