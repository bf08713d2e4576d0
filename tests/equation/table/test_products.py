"""Products of three states become products of two, with states for products, which move as the product rule says."""

import random
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations_with_replacement
from math import prod

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu.c.jacobian import step_jacobian
from rov_fmu.equation import terms
from rov_fmu.equation.expression import Name, Names, compiled, of
from rov_fmu.equation.forces import Effect, Force, forces_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.printed import model_of
from rov_fmu.equation.step import step
from rov_fmu.equation.terms import Rows, Term, equation_of, quadratic
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import VEHICLES


def _system(rng: random.Random, states: str) -> Rows:
    """Return rows with integer coefficients for random products of up to three states."""
    products = [pair for n in range(4) for pair in combinations_with_replacement(states, n)]
    return {
        name: tuple(Term(of(float(rng.randint(-9, 9))), pair) for pair in rng.sample(products, 4)) for name in states
    }


def _rate(terms: tuple[Term, ...], at: dict[str, float]) -> float:
    return sum(float(compiled({"k": t.coefficient})({})["k"]) * prod(at[name] for name in t.factors) for t in terms)


@pytest.mark.parametrize("seed", range(20))
def test_the_new_rows_give_the_same_rates(seed: int) -> None:
    """Integers are exact, so the rates are equal to the last bit."""
    rng = random.Random(seed)
    rows = _system(rng, "uvwz"[: rng.randint(1, 4)])
    found, products = quadratic(rows, Names(rows))
    at = {name: float(rng.randint(-9, 9)) for name in rows}
    rates = {name: _rate(terms, at) for name, terms in rows.items()}
    assert all(len(term.factors) < 3 for terms in found.values() for term in terms)
    assert found.keys() == rows.keys() | products.keys()
    both = compiled(products)(at)
    assert {name: _rate(found[name], both) for name in rows} == rates
    for name in products:
        a, b = name.removeprefix("product_").split("_")
        assert _rate(found[name], both) == at[a] * rates[b] + at[b] * rates[a]


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
