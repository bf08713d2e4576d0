"""The equations that a page shows are those of the vehicle: evaluated as they stand, they give its rates and forces."""

import random
from collections.abc import Mapping
from math import copysign

import pytest
from lxml import html
from mpmath import mp

from rov_fmu.equation.expression import Expression, Name, Operation, compiled, where
from rov_fmu.equation.layout import Layout
from rov_fmu.report.page import equations
from rov_fmu.report.page.equations import Equations, Line, formula_text, mathml
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import EVERYTHING, SIX, VEHICLES, random_body, random_inputs, random_state, random_vehicle
from verification.references.equations import calculated

ROVS = {
    **VEHICLES,
    "six axes": SIX,
    **{name: load_vehicle(path) for name, path in SHIPPED.items()},
    "everything": load_vehicle(EVERYTHING),
}
Values = Mapping[str, float]
FUNCTIONS = {
    "sgn": lambda x: copysign(1.0, x) if x else 0.0,
    "rate": lambda x: x,
    "square": lambda x: x * x,
    "cube": lambda x: x * x * x,
}


def value_of(x: Expression, at: Values) -> float:
    return float(compiled({"value": x}, FUNCTIONS)(at)["value"])


def exactly(rov: Vehicle, inputs: Values, state: Values) -> dict[str, float]:
    """Return the rates and the calculated variables of a vehicle."""
    if rov.layout.has_attitude:
        rates = {f"der({name})": x for name, x in rov.derivatives(inputs, state).items()}
        return rates | rov.calculated(inputs, state)
    return {name: float(x) for name, x in calculated(rov, {**rov.coefficients, **inputs, **state}, mp).items()}


def evaluated(rov: Vehicle, shown: Equations, inputs: Values, state: Values) -> dict[str, float]:
    """Return the value of every name to the left of an equation by what is to its right; rates as der(<name>).

    Of several rates on the left, the first is found, and the others are exact.
    """
    exact = exactly(rov, inputs, state)
    at = {**rov.coefficients, **inputs, **state}
    at |= {name: max(-1.0, min(1.0, at[name])) for name in rov.layout.commands}
    rates = {name: exact[f"der({name})"] for name in rov.layout.state}
    found: dict[str, float] = {}

    def calculate(line: Line) -> None:
        right = value_of(line.right, at)
        if isinstance(line.left, Name):
            found[line.left.identifier] = right
            at[line.left.identifier] = max(-1.0, min(1.0, right)) if line in shown.commands else right
            return
        first = line.left
        while isinstance(first, Operation) and first.op == "+":
            first = first.args[0]
        (name,) = first.names & rov.layout.state.keys()
        others, gain = (value_of(line.left, {**at, **rates, name: x}) for x in (0.0, 1.0))
        found[f"der({name})"] = (right - others) / (gain - others)

    for line in shown.commands:
        calculate(line)
    for curve in shown.curves:
        for line in [*curve.thrust[::-1], *curve.advance, *curve.lag]:
            calculate(line)
    for curve in shown.curves:
        first = curve.thrusters[0].name
        for line in curve.advance:  # the page mentions the other thrusters in words: "likewise"
            for t in curve.thrusters:
                own = {f"{kind}_{first}": at[f"{kind}_{t.name}"] for kind in ("u", "health")}
                at[f"loss_{t.name}"] = value_of(line.right, {**at, **own})
    for name in rov.layout.calculated:
        if name not in at and name.startswith("F_"):
            at[name] = exact[name]
    for curve in shown.curves:
        for line in curve.torque:
            calculate(line)
    for line in [*shown.rotation, *shown.inertia, *shown.motion, *shown.pose, *shown.angles]:
        calculate(line)
    return found


def check(rov: Vehicle, rng: random.Random, times: int) -> set[str]:
    """Check the equations at random inputs and states under water, and return the names that they give."""
    shown = equations.equations_of(rov.layout)
    for _ in range(times):
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        state |= {"z": abs(state["z"])} if "z" in state else {}
        exact = exactly(rov, inputs, state)
        found = evaluated(rov, shown, inputs, state)
        largest = max(map(abs, exact.values()))
        for name in found.keys() & exact.keys():
            assert found[name] == pytest.approx(exact[name], rel=1e-9, abs=1e-12 * largest), name
    return {*found}


@pytest.mark.parametrize("kind", ROVS)
def test_the_equations_shown_are_those_of_the_vehicle(kind: str) -> None:
    rov = ROVS[kind]
    found = check(rov, random.Random(1), 10)
    states = {name for name in rov.layout.state if not name.startswith("F_")}
    assert {f"der({name})" for name in states} <= found, "every rate has its equation"
    named = {name for name in rov.layout.calculated if not name.startswith("F_")}
    assert named - rov.layout.added.keys() <= found, "the page has these in words"


@pytest.mark.parametrize(
    "vehicles", [4, pytest.param(60, marks=pytest.mark.long), pytest.param(300, marks=pytest.mark.weekly)]
)
def test_the_equations_shown_are_those_of_any_vehicle(vehicles: int) -> None:
    rng = random.Random(2)
    for axes in ("uvwpqr", "uwq", "pq", "uvwpqr"):
        check(random_body(rng, axes), rng, 2)
    for _ in range(vehicles):
        rov = random_vehicle(rng)
        if {t.curve for t in rov.layout.thrusters} == {curve.name for curve in rov.layout.curves}:
            check(rov, rng, 2)


def _text(layout: Layout) -> list[str]:
    return [f"{line}  {line.reference}".strip() for line in equations.equations_of(layout)]


def test_the_equations_of_the_paper_are_those_of_the_paper() -> None:
    assert _text(VEHICLES["VideoRay"].layout) == [
        "m_rov u' = β_u (α_u (F_l + F_r) + X_ext − b_d_u u − a_d_u |u| u)  (18a)",
        "m_rov w' = β_w (α_w F_t + Z_ext − b_d_w w − a_d_w |w| w)  (18b)",
        "I_r r' = β_r (α_r τ_rear + N_ext − b_d_r r − a_d_r |r| r)  (18c)",
        "F_l = 0.5 h_l (a_t_rear |u_l| u_l + b_t_rear u_l)  (9)",
        "τ_rear = R sin γ (F_l − F_r)  (4)",
        "F_t = h_t (a_t_top |u_t| u_t + b_t_top u_t)  (10)",
        "x' = V_N + u cos ψ",
        "y' = V_E + u sin ψ",
        "z' = w",
        "ψ' = r",
    ]


@pytest.mark.parametrize("kind", ROVS)
def test_mathml_says_what_the_text_says(kind: str) -> None:
    """Letters, numbers and signs stand in the same order; in MathML a coefficient's marks are above its indices."""
    for line in equations.equations_of(ROVS[kind].layout):
        sides = f"<math>{mathml(line.left)}<mo>=</mo>{mathml(line.right)}</math>"
        written = html.fromstring(sides).text_content()
        plain = str(line)
        spelt = {" where": "for", "else": "otherwise", "_reverse": "−", "'": "˙", "²": "2", "√": ""}
        for old, new in spelt.items():
            plain = plain.replace(old, new)
        left_out = "_ \xa0,()/{"  # a fraction and the cases need no brackets in MathML
        assert sorted(c for c in written if c not in left_out) == sorted(c for c in plain if c not in left_out)


def test_a_form_that_cannot_be_shown_is_an_error() -> None:
    choice = where(Name("u") > 3.0, 2.0, Name("w"))
    with pytest.raises(ValueError, match=r"2\.0 if u > 3\.0 else w: there is no way to show this"):
        formula_text(choice)
