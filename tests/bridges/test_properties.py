"""vehicle.rates with NumPy, CasADi and JAX agrees with the engine over random states of all vehicles."""

import random
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import pytest

import rov_fmu
from rov_fmu.bridges import arrays
from rov_fmu.c.simulation import simulate
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import python
from tests.vehicles import (
    EVERYTHING,
    SIX,
    SIX_AXES,
    THRUST_EFFECTS,
    VEHICLES,
    random_inputs,
    random_state,
)

FILES = {**SHIPPED, "everything": EVERYTHING, "thrust_effects": THRUST_EFFECTS, "six_axes": SIX_AXES}
LOADED = {name: load_vehicle(path) for name, path in FILES.items()}
ALL = {**VEHICLES, "six_coupled": SIX, **LOADED}
CASES = 20
Array = np.ndarray[Any, np.dtype[np.float64]]


def cases(rov: Vehicle, seed: str, count: int = CASES) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return arrays of random inputs and states by name."""
    rng = random.Random(seed)
    inputs = [random_inputs(rng, rov) for _ in range(count)]
    if rov.layout.voltage is not None:
        for one in inputs:
            one["voltage"] = rng.uniform(8.0, 21.0)
    if rov.layout.pulse:
        for one in inputs:
            one |= {name: rov.layout.command_of(one[name]) for name in rov.layout.commands}
    states = [random_state(rng, rov) for _ in range(count)]
    return _columns(inputs), _columns(states)


def _columns(rows: list[dict[str, float]]) -> dict[str, Array]:
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def by_engine(rov: Vehicle, inputs: dict[str, Array], states: dict[str, Array]) -> tuple[Array, Array]:
    """Return the rates of the compiled engine, and the size of each rate over all cases."""
    wanted = [f"der({name})" for name in rov.layout.state]
    columns = {name: values[:, np.newaxis] for name, values in {**inputs, **states}.items()}
    delayed = replace(rov.layout, has_dead_time=False)
    alone = Vehicle(delayed, {name: rov[name] for name in delayed.coefficients})
    found = simulate(alone, [0.0], columns, wanted, vehicles=CASES).values[:, :, 0]
    return found, np.abs(found).max(axis=1, keepdims=True)


def check(found: Any, expected: Array, scale: Array) -> None:
    assert np.all(np.abs(np.asarray(found) - expected) <= 1e-14 * scale)


def _from_numpy(rov: Vehicle, inputs: dict[str, Array], states: dict[str, Array]) -> Any:
    return arrays.rates(rov, np.stack([*states.values()]), arrays.forces(rov, inputs, {}), {})


def _from_casadi(rov: Vehicle, inputs: dict[str, Array], states: dict[str, Array], kind: Any) -> Any:
    x, u = kind.sym("x", len(states)), kind.sym("u", len(inputs))
    forces = arrays.forces(rov, {name: u[n] for n, name in enumerate(inputs)}, {})
    function = casadi.Function("rates", [x, u], [arrays.rates(rov, x, forces, {})])
    return function(np.stack([*states.values()]), np.stack([*inputs.values()]))


@pytest.mark.parametrize("name", ALL)
def test_numpy_and_casadi_agree_with_the_engine(name: str) -> None:
    rov = ALL[name]
    inputs, states = cases(rov, name)
    expected, scale = by_engine(rov, inputs, states)
    check(_from_numpy(rov, inputs, states), expected, scale)
    check(_from_casadi(rov, inputs, states, casadi.SX), expected, scale)
    check(_from_casadi(rov, inputs, states, casadi.MX), expected, scale)


@pytest.mark.weekly
def test_jax_agrees_with_the_engine() -> None:
    """The program runs in a process of its own: JAX starts threads, and other tests start processes by forks."""
    assert python("-m", "tests.bridges.jax_rates").splitlines() == [*ALL]


def test_the_coefficients_may_be_symbols() -> None:
    rov = LOADED["bluerov2_heavy"]
    inputs, states = cases(rov, "symbols", 1)
    x, forces = np.stack([*states.values()])[:, 0], arrays.forces(rov, inputs, {})[:, 0]
    drag = casadi.SX.sym("a_d_u")
    function = casadi.Function("rates", [drag], [arrays.rates(rov, x, forces, {"a_d_u": drag})])
    expected = arrays.rates(rov.with_(a_d_u=77.0), x, forces, {})
    assert np.allclose(np.asarray(function(77.0))[:, 0], expected, rtol=1e-14, atol=1e-14)


def test_wrong_arguments_give_one_line() -> None:
    vehicle = rov_fmu.load("videoray")
    n, m = len(vehicle.layout.state), len(vehicle.force_names)
    with pytest.raises(InputError, match=r"^x: must have 7 rows \(u, w, r, x, y, z, psi\), and has the shape \(3,\)$"):
        vehicle.rates([0.0, 0.0, 0.0], np.zeros(m))
    with pytest.raises(InputError, match=r"^forces: must have .* rows"):
        vehicle.rates(np.zeros(n), np.zeros(m + 1))
    with pytest.raises(InputError, match=r"^p\['a_d_x'\]: the vehicle has no such coefficient"):
        vehicle.rates(np.zeros(n), np.zeros(m), {"a_d_x": 1.0})
    with pytest.raises(InputError, match=r"^inputs\['u_q'\]: the vehicle has no such input"):
        vehicle.forces({"u_q": 1.0})
