"""Products of three states become products of two, with states for products, which move as the product rule says."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu.c.jacobian import step_jacobian
from rov_fmu.equation import terms
from rov_fmu.equation.expression import Name, Names
from rov_fmu.equation.forces import Effect, Force, forces_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.printed import model_of
from rov_fmu.equation.step import step
from rov_fmu.equation.terms import equation_of
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import VEHICLES


@pytest.mark.parametrize("start", [-0.7, 0.0, 1.3])
def test_a_step_follows_a_cubic_force(start: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The state of the product begins at the square of the velocity."""

    def with_cubic(layout: Layout, names: Names) -> Iterator[Force]:
        yield from forces_of(layout, names)
        yield Force(Effect("cubic", "cubic drag"), "w", -1, (Name("m_rov"),), ("w", "w", "w"))

    monkeypatch.setattr(terms, "forces_of", with_cubic)
    plain = VEHICLES["heave only"]
    (curve,) = plain.layout.curves
    layout = replace(plain.layout, curves=(replace(curve, description=f"cubic from {start}"),))
    assert "product_w_w" in equation_of(layout).states
    m, a, b = (plain[name] for name in ("m_rov", "a_d_w", "b_d_w"))
    plain = plain.with_(a_d_w_reverse=a, b_d_w_reverse=b)
    inputs = {**layout.usual_inputs, "Z_ext": 40.0}

    def rate(_: float, y: NDArray[np.float64]) -> list[float]:
        return [(40.0 - b * y[0] - a * abs(y[0]) * y[0]) / m - y[0] ** 3, y[0]]

    exact = solve_ivp(rate, (0.0, 0.8), [start, 0.0], "DOP853", rtol=1e-12, atol=1e-13, max_step=0.01).y[:, -1]
    found = step(model_of(layout), {**plain.coefficients, **inputs, "w": start, "z": 0.0}, 0.8)
    assert [found["w"], found["z"]] == pytest.approx(exact.tolist(), rel=1e-10, abs=1e-10)
    after = step_jacobian(Vehicle(layout, plain.coefficients), inputs, {"w": start, "z": 0.0}, 0.8).after
    assert after == pytest.approx(found, rel=1e-8, abs=1e-8)
