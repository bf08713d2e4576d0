"""A force is a formula: its coefficient for each direction, and the states that multiply it, follow from it."""

import random
from collections.abc import Iterator

import pytest

from rov_fmu.equation import terms
from rov_fmu.equation.expression import Expression, Name, Names, compiled, directed
from rov_fmu.equation.forces import STATES, Effect, Force, forces_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import equation_of
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import FINNED, OUTSIDE, SIX, VEHICLES, in_waves, surfaced

CUBIC = Effect("cubic", "cubic drag")
a, b, u, v = map(Name, "abuv")


@pytest.mark.parametrize("rov", [*VEHICLES.values(), SIX, FINNED, OUTSIDE], ids=lambda rov: rov.identifier)
def test_a_force_is_its_coefficient_for_each_direction_times_its_states(rov: Vehicle) -> None:
    random.seed(1)
    for force in forces_of(rov.layout, Names()):
        parts = {"force": force.formula, "ahead": force.along(), "astern": force.along(reverse=True)}
        at = {name: random.uniform(-1.0, 1.0) for name in frozenset().union(*(x.names for x in parts.values()))}
        for side, sign in (("ahead", 1.0), ("astern", -1.0)):
            if force.velocity:
                at[force.velocity] = sign * abs(at[force.velocity])
            values = compiled(parts)(at)
            expected = values[side]
            for state in force.factors:
                expected *= values[state]
            assert values["force"] == pytest.approx(expected, rel=1e-14), (force, side)


def test_the_states_of_forces_are_those_of_the_table() -> None:
    in_tables = set[str]()
    for rov in (*VEHICLES.values(), SIX, FINNED, surfaced(SIX), in_waves(surfaced(SIX))):
        equation = equation_of(rov.layout)
        in_tables |= {*equation.states} - {lag.arrived for lag in equation.lags}
    assert in_tables == STATES


REFUSED = (
    a * u * u * u,
    a * (u + b) * v,
    a / v,
    a * abs(u) * abs(v),
    directed(u, a, b) * abs(v) * v,
    directed(u, a, b * v) * u,
)


@pytest.mark.parametrize("formula", REFUSED, ids=range(len(REFUSED)))
def test_a_formula_that_the_equation_cannot_have_is_refused(formula: Expression) -> None:
    reason = r"must be a coefficient times at most two states, and depend on the direction of one \(terms.py\)"
    with pytest.raises(ValueError, match=f"^cubic drag: {reason}$"):
        Force(CUBIC, "u", formula)


UNLIKE: dict[str, list[Expression]] = {
    "a force with another power of the same states needs an effect of its own": [a * u * u, a * u],
    "a force with the direction of another velocity needs an effect of its own": [a * abs(u) * v, a * u * abs(v)],
    "a force whose size depends on a direction may contain coefficients alone": [directed(u, a, b) * u],
}


@pytest.mark.parametrize(("reason", "formulas"), UNLIKE.items(), ids=range(len(UNLIKE)))
def test_forces_of_one_effect_that_are_no_term_are_refused(
    reason: str, formulas: list[Expression], monkeypatch: pytest.MonkeyPatch
) -> None:
    def forces(_: Layout, __: Names) -> Iterator[Force]:
        yield from (Force(CUBIC, "u", formula) for formula in formulas)

    monkeypatch.setattr(terms, "forces_of", forces)
    with pytest.raises(ValueError, match=f"^{reason}$"):
        equation_of.__wrapped__(SIX.layout)
