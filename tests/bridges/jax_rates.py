"""Compare the rates of JAX with those of the engine, for all vehicles: a program that prints the names of the vehicles.

Arrays of single precision are refused before that.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rov_fmu
from rov_fmu.bridges import arrays
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.vehicle import Vehicle
from tests.bridges.test_properties import ALL, Array, by_engine, cases, check


def by_jax(rov: Vehicle, inputs: dict[str, Array], states: dict[str, Array]) -> Any:
    """Return the rates of random states, compiled by JAX."""

    def function(x: Any, u: Any) -> Any:
        forces = arrays.forces(rov, {name: u[n] for n, name in enumerate(inputs)}, {})
        return arrays.rates(rov, x, forces, {})

    found = jax.jit(function)(jnp.stack([*states.values()]), jnp.stack([*inputs.values()]))
    assert found.dtype == jnp.float64
    return found


def refuse_single_precision() -> None:
    """Check that arrays of single precision give one line."""
    vehicle = rov_fmu.load("videoray")
    with pytest.raises(InputError, match=r"^JAX computes in single precision"):
        vehicle.rates(jnp.zeros(len(vehicle.layout.state)), np.zeros(len(vehicle.force_names)))


if __name__ == "__main__":
    refuse_single_precision()
    jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]
    for name, rov in ALL.items():
        inputs, states = cases(rov, name)
        expected, scale = by_engine(rov, inputs, states)
        check(by_jax(rov, inputs, states), expected, scale)
        print(name)
