"""Dependencies follow from the equation alone: a new term of the equation appears in them with the right kind."""

from dataclasses import replace

import pytest

from rov_fmu.equation import dependencies
from rov_fmu.equation.dependencies import dependencies_of, parameters_of
from rov_fmu.equation.expression import Name, directed, of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import ONE, Equation, Term, equation_of
from tests.vehicles import HEAVY, SIX, VIDEORAY

ADDED = {
    "a number": (Term(of(-2.5), ("z",)), "constant", ()),
    "a formula of numbers": (Term((of(3.0) - 1.0) / 4.0, ("z",)), "constant", ()),
    "a fixed parameter": (Term(Name("R"), ("z",)), "fixed", ("R",)),
    "a formula of fixed parameters": (Term(Name("arm"), ("z",)), "fixed", ("R", "gamma")),
    "a tunable parameter": (Term(Name("alpha_w"), ("z",)), "tunable", ("alpha_w",)),
    "a formula of fixed and tunable parameters": (Term(Name("gain_w"), ("z",)), "tunable", ("m_rov", "beta_w")),
    "another state": (Term(ONE, ("z", "psi")), "dependent", ()),
    "itself": (Term(ONE, ("z", "z")), "dependent", ()),
    "an input": (Term(Name("Z_ext"), ("z",)), "dependent", ()),
    "a formula of inputs": (Term(Name("F_t"), ("z",)), "dependent", ("a_t_top", "b_t_top")),
    "a choice by a state": (Term(directed(Name("psi"), ONE, of(2.0)), ("z",)), "dependent", ()),
    "a coefficient of zero": (Term(of(0.0), ()), None, ()),
}
"""For each case: a term that is added to the rate of u, the expected kind of dependency on z, and its parameters."""


@pytest.mark.parametrize("case", ADDED)
def test_a_term_that_is_added_to_the_equation_is_found(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    term, kind, brought = ADDED[case]

    def changed(layout: Layout) -> Equation:
        equation = equation_of(layout)
        return replace(equation, rows={**equation.rows, "u": (*equation.rows["u"], term)})

    layout = VIDEORAY.layout
    before, parameters = dependencies_of(layout), parameters_of(layout)
    monkeypatch.setattr(dependencies, "equation_of", changed)
    assert dependencies_of(layout)["der(u)"].get("z") == kind
    assert {*parameters_of(layout)["der(u)"]} == {*parameters["der(u)"], *brought}
    assert {name: known for name, known in dependencies_of(layout).items() if name != "der(u)"} == {
        name: known for name, known in before.items() if name != "der(u)"
    }


def test_every_kind_of_dependency_of_a_vehicle_with_lag() -> None:
    """The expected kinds can be read off the equations of the BlueROV2 Heavy."""
    found = dependencies_of(HEAVY.layout)
    assert found["der(z)"] == {"w": "constant"}
    assert found["der(F_1)"]["F_1"] == "fixed"
    assert found["der(w)"] == {"Z_ext": "tunable", "w": "dependent"} | {f"F_{n}": "tunable" for n in "5678"}
    assert found["der(x)"] == {"V_N": "constant", "u": "dependent", "v": "dependent", "psi": "dependent"}


def test_an_attitude_at_the_start_depends_on_the_angles_that_give_it() -> None:
    """An angle beyond its range turns the other two, so roll and heading depend on the pitch."""
    found = parameters_of(SIX.layout)
    assert {name: found[name] for name in ("eta", "phi", "theta", "psi")} == {
        "eta": ("phi_0", "theta_0", "psi_0"),
        "phi": ("phi_0", "theta_0"),
        "theta": ("theta_0",),
        "psi": ("theta_0", "psi_0"),
    }
    assert {"W", "z_B", "theta_0"} <= {*found["der(q)"]}
