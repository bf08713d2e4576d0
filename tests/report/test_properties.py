"""The equations that a page shows are those of the vehicle: evaluated as they stand, they give its rates and forces."""

import random
import re
from collections.abc import Mapping
from math import copysign

import pytest
from mpmath import mp

from rov_fmu.equation.expression import Expression, Name, Operation, compiled
from rov_fmu.equation.forces import AT_SURFACE, DEAD_BAND, DEAD_TIME, LAG, ROTOR_LAG, effects_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import equation_of
from rov_fmu.report.page.equations import Line, equations_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import (
    EVERYTHING,
    SIX,
    VEHICLES,
    in_waves,
    random_body,
    random_inputs,
    random_state,
    random_vehicle,
    tied,
)
from verification.references.equations import calculated

ROVS = {
    **VEHICLES,
    "six axes": SIX,
    "with a point, in waves": in_waves(tied(SIX, bow=(0.4, 0.1, -0.2))),
    "level, with a point, in waves": in_waves(tied(VEHICLES["Heavy"], bow=(0.4, 0.1, -0.2))),
    **{name: load_vehicle(path) for name, path in SHIPPED.items()},
    "everything": load_vehicle(EVERYTHING),
    "effects of thrust": load_vehicle(EVERYTHING.with_name("thrust_effects.toml")),
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
    layout = rov.layout
    if layout.has_attitude or layout.points or layout.waves or layout.has_dead_time:
        rates = {f"der({name})": x for name, x in rov.derivatives(inputs, state).items()}
        return rates | rov.calculated(inputs, state)
    return {name: float(x) for name, x in calculated(rov, {**rov.coefficients, **inputs, **state}, mp).items()}


def in_words(rov: Vehicle, at: Values) -> dict[str, float]:
    """Return what the page tells in words: delayed commands, measured thrust, the voltage, and where a rotor turns."""
    equation = equation_of(rov.layout)
    program = compiled(equation.program, equation.measured)({**at, **{n: at[c] for c, n in rov.layout.acting.items()}})
    found = {name: at[command] for command, name in rov.layout.acting.items()}
    found |= {f"heads_{name[2:]}": at[name] for name in rov.layout.state if name.startswith("n_")}
    told = [name.identifier for kind in ("battery", "table") for name in equation.names.of_kind(kind)]
    return found | {name: program[name] for name in told}


def evaluated(rov: Vehicle, inputs: Values, state: Values) -> dict[str, float]:
    """Return the value of what is to the left of each equation by what is to its right; rates as der(<name>).

    Of several rates on the left, the first is found, and the others are exact. So is the thrust of those thrusters that
    the page mentions in words: "likewise".
    """
    exact, waiting = exactly(rov, inputs, state), equations_of(rov.layout)
    at = {**rov.coefficients, **inputs, **state}
    at |= {name: max(-1.0, min(1.0, at[name])) for name in rov.layout.commands}
    at |= in_words(rov, at)
    rates = {name: exact[f"der({name})"] for name in rov.layout.state}
    found: dict[str, float] = {}

    def calculate(line: Line) -> None:
        right = value_of(line.right, at)
        if isinstance(line.left, Name):
            found[line.left.identifier] = right
            at[line.left.identifier] = max(-1.0, min(1.0, right)) if line.left.kind == "command" else right
            return
        first = line.left
        while isinstance(first, Operation) and first.op == "+":
            first = first.args[0]
        (name,) = first.names & rov.layout.state.keys()
        others, gain = (value_of(line.left, {**at, **rates, name: x}) for x in (0.0, 1.0))
        found[f"der({name})"] = (right - others) / (gain - others)

    shown = {line.left.identifier for line in waiting if isinstance(line.left, Name)}
    likewise = [t.name for t in rov.layout.thrusters if f"F_{t.name}" not in shown]
    at |= {f"F_{name}": exact[f"F_{name}"] for name in likewise if f"F_{name}" not in at}
    while waiting:
        ready = [one for one in waiting if one.right.names | needed(one.left) <= {*at, *rates}]
        assert ready, [str(line.left) for line in waiting]
        for line in ready:
            calculate(line)
            if isinstance(line.left, Name) and line.left.kind == "loss":
                (first,) = line.left.owners
                for t in rov.layout.thrusters:  # the same equation with another command and health
                    kinds = {name.rpartition(first)[0] for name in line.right.names if name.endswith(first)}
                    own = {f"{kind}{first}": at.get(f"{kind}{t.name}", 0.0) for kind in kinds}
                    if t.curve == rov.layout.curve_of[first].name:
                        at[f"loss_{t.name}"] = value_of(line.right, {**at, **own})
        waiting = [line for line in waiting if line not in ready]
    return found


def needed(left: Expression) -> frozenset[str]:
    """Return the names that have to be known before an equation with this left side can be solved."""
    return frozenset() if isinstance(left, Name) else left.names


def check(rov: Vehicle, rng: random.Random, times: int) -> set[str]:
    """Check the equations at random inputs and states under water, and return the names that they give."""
    for _ in range(times):
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        inputs |= {"voltage": rng.uniform(11.0, 18.0)} if "voltage" in inputs else {}
        state |= {"z": 30.0 + abs(state["z"])} if "z" in state else {}  # below the crests, too
        exact = exactly(rov, inputs, state)
        found = evaluated(rov, inputs, state)
        largest = max(map(abs, exact.values()))
        for name in found.keys() & exact.keys():
            assert found[name] == pytest.approx(exact[name], rel=1e-9, abs=1e-12 * largest), name
    return {*found}


@pytest.mark.parametrize("kind", ROVS)
def test_the_equations_shown_are_those_of_the_vehicle(kind: str) -> None:
    layout = ROVS[kind].layout
    found = check(ROVS[kind], random.Random(1), 10)
    lagging = {name for name in layout.state if name[:2] in ("F_", "n_")}
    assert {f"der({name})" for name in layout.state if name not in lagging} <= found, "every rate has its equation"
    assert len(found & {f"der({name})" for name in lagging}) == sum(curve.has_lag for curve in layout.curves)
    named = {name for name in layout.calculated if not name.startswith("F_")} - layout.motion_of_points.keys()
    assert named - layout.added.keys() <= found, "the page has these in words"


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


def _rows(layout: Layout) -> list[str]:
    return ["  ".join(row).strip() for line in equations_of(layout) for row in line.rows()]


def test_the_equations_of_the_paper_are_those_of_the_paper() -> None:
    assert _rows(VEHICLES["VideoRay"].layout) == [
        "M_u u'  = α_u (F_l + F_r)  surge (18a): the thrust",
        "+ X_ext  the constant load and the load from outside",
        "− b_d_u u  linear drag",
        "− a_d_u |u| u  quadratic drag",
        "M_w w'  = α_w F_t  heave (18b): the thrust",
        "+ Z_ext  the constant load and the load from outside",
        "− b_d_w w  linear drag",
        "− a_d_w |w| w  quadratic drag",
        "M_r r'  = α_r τ_rear  yaw (18c): the thrust",
        "+ N_ext  the constant load and the load from outside",
        "− b_d_r r  linear drag",
        "− a_d_r |r| r  quadratic drag",
        "M_u  = m_rov / β_u  the inertia in surge, with its tuning",
        "M_w  = m_rov / β_w  the inertia in heave, with its tuning",
        "M_r  = I_r / β_r  the inertia in yaw, with its tuning",
        "F_l  = 0.5 health_l (a_t_rear |u_l| + b_t_rear) u_l  the thrust of l (9), likewise r",
        "τ_rear  = R sin γ F_l − R sin γ F_r  the torque of rear",
        "F_t  = health_t (a_t_top |u_t| + b_t_top) u_t  the thrust of t (10)",
        "x'  = V_N + u cos ψ  Position north x",
        "y'  = V_E + u sin ψ  Position east y",
        "z'  = w  Depth z, positive down",
        "ψ'  = r  Heading ψ, positive north to east, not wrapped",
    ]


def test_a_dead_band_and_both_lags_read_as_formulas() -> None:
    rows = _rows(ROVS["effects of thrust"].layout)
    assert "n_top*  = sgn(delayed_u_top) m_top where m_top > 0, else 0  the steady speed of top" in rows
    assert "T_lift n_top'  = n_top* − n_top  the lag" in rows
    assert "T_main F_l'  = F_l* − F_l  the lag" in rows
    assert "k_bow  = health_bow d_bow |delayed_u_bow| (U / V_0_bow)^(0.5 n_V_bow)" in " ".join(rows)


@pytest.mark.parametrize("kind", ROVS)
def test_each_row_is_text_without_remains_of_code(kind: str) -> None:
    """No row has a sign twice, a choice as a call, or a name of the equation without its letter."""
    layout, of_forces = ROVS[kind].layout, {AT_SURFACE, DEAD_TIME, DEAD_BAND, LAG, ROTOR_LAG}
    rows = _rows(layout)
    code = r"if\(|or\(|\+ −|− −| - |\bpsi|steady_|command_|beyond_|saturated|\+ 0(?!\.)|z±"
    assert [row for row in rows if re.search(code, row)] == []
    told = " ".join(rows)
    assert [one.words for one in effects_of(layout) if one not in of_forces and one.words not in told] == []
