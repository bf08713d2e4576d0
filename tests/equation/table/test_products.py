"""Products of three states become products of two, with states for products, which move as the product rule says."""

import random
from itertools import combinations_with_replacement
from math import prod

import pytest

from rov_fmu.equation.expression import Names, compiled, of
from rov_fmu.equation.terms import Rows, Term, quadratic


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


def test_rows_of_products_of_two_states_stay() -> None:
    rows = {"u": (Term(of(2.0)), Term(of(-1.0), ("u", "v"))), "v": (Term(of(3.0), ("u", "u")),)}
    assert quadratic(rows, Names(rows)) == (rows, {})
