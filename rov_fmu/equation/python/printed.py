"""The equation of motion of a vehicle, printed as a Python module that needs only the standard library and step.py.

It is for step.py, and part of the FMU in pure Python. The formulas for simulators that move the body are here as well.
"""

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from types import ModuleType
from typing import NamedTuple

from ..attitude import QUATERNION, ROTATION, quaternion_rates, start_formulas
from ..catalogue import BY_VELOCITY
from ..expression import FUNCTIONS, PYTHON, Expression, Name, call, of, total, written
from ..layout import Layout
from ..parts import CommandTable
from ..terms import Equation, Term, equation_of, mass_matrix, rate_formula
from .step import interpolated

_IMPORTED = ["expm1", "inf", "log1p", *(name for name in FUNCTIONS if name != "abs")]


def printed(layout: Layout, step: str) -> str:
    """Return the module. `step` is the name of the module that step.py has there."""
    return f"""\
\"\"\"The equation of motion of a vehicle, for {step}.py. All numbers are in SI units.\"\"\"

from math import {", ".join(_IMPORTED)}

from {step} import interpolated

{equation_text(layout)}"""


def equation_text(layout: Layout) -> str:
    """Return the module without its imports: _IMPORTED from math, and `interpolated`."""
    equation = equation_of(layout)
    quaternion = QUATERNION if layout.has_attitude else ()
    states = [*equation.states, *quaternion]
    offsets = [name for name in equation.states if name not in equation.starts]

    def places(names: Iterable[str]) -> dict[str, int]:
        return {name: states.index(name) for name in names}

    alike = (BY_VELOCITY, ("x", "y", *(() if "z" in equation.used else "z"), "psi"), ROTATION, quaternion)
    groups = [[states.index(name) for name in names if name in states] for names in alike]
    numbers = {**equation.program, **equation.forces}
    shifted = (f'    v.setdefault("{name}", {written(x, PYTHON, _value)})\n' for name, x in equation.shifted.items())
    numbers = {name: x for name, x in numbers.items() if name not in equation.shifted}
    numbers |= {f"start_{v}": x for v, x in equation.starts.items() if v in layout.velocities and x != Name(v)}
    rates = {f"der_{name}": rate for name, rate in equation.rates.items()}
    return f"""\
STATES = {tuple(states)!r}
MONITORED = {places(equation.monitored)!r}  # velocities on whose direction coefficients depend, and their places
OFFSETS = {places(offsets)!r}  # the states on which no rate depends, as offsets from the start
GROUPS = {[*filter(None, groups)]!r}  # the states of like size
QUATERNION = {places(quaternion)!r}
PIVOTS = {[name.identifier for name in equation.names.of_kind("pivot")]!r}  # of the mass matrix, all above 0
{_tables(equation.tables)}

def numbers(values):
    \"\"\"Return all numbers that follow from the coefficients, inputs and states, together with these.\"\"\"
    v = dict(values)
{"".join(shifted)}{_assignments(numbers)}
    return v


def outputs(values):
    \"\"\"Return the rates of the vehicle's states and its calculated variables, together with all numbers.\"\"\"
    v = numbers(values)
{_assignments({**rates, **equation.outputs})}
    return v


def attitude(values):
    \"\"\"Return the quaternion for the Euler angles at the start, together with other numbers.\"\"\"
    v = dict(values)
{_assignments(start_formulas() if layout.has_attitude else {})}
    return v


def motion(_numbers):
    \"\"\"Return the function from the time since the start of the step and the states to the rates of the states.\"\"\"
{_rates(equation, layout, states)}

{_sizes(equation, layout, states)}

{_lagging_text(equation)}"""


@lru_cache(maxsize=100)
def printed_model(layout: Layout) -> ModuleType:
    """Return the module of a vehicle."""
    module = ModuleType("equation")
    module.__dict__.update({name: getattr(math, name) for name in _IMPORTED}, interpolated=interpolated)
    exec(compile(equation_text(layout), "<equation>", "exec"), module.__dict__)
    return module


# ---- For a simulator that moves the body itself ----------------------------------------------------------------------


_KNOWN = (*BY_VELOCITY, *ROTATION[6:])
"""The states that the simulator gives: the velocities through the water, and the third row of the rotation matrix."""


def _terms_of_known(equation: Equation, layout: Layout) -> tuple[dict[str, list[Term]], list[str]]:
    """Return the terms of the accelerations that contain no other state, and the words of the effects of the others."""
    known = {*_KNOWN, *(lag.arrived for lag in equation.lags)}
    terms = {v: [term for term in equation.rows[v] if known.issuperset(term.factors)] for v in layout.velocities}
    lacking = (term.effect for v, own in terms.items() for term in equation.rows[v] if term not in own)
    return terms, [effect.words for effect in dict.fromkeys(lacking) if effect]


def left_out_of_accelerations(layout: Layout) -> list[str]:
    """Return the words of the effects that need another state than those that the simulator gives."""
    return _terms_of_known(equation_of(layout), layout)[1]


class Accelerations(NamedTuple):
    """The formulas for a simulator that moves the body itself."""

    equation: Equation
    numbers: Mapping[str, Expression]
    """All numbers that follow from coefficients, inputs, directions of motion and what lags, in their order."""
    mass: list[list[Expression]]
    """The 6x6 mass matrix; 0 along axes that the vehicle lacks."""
    rates: Mapping[str, Expression]
    """The accelerations, by the velocities of the axes that the vehicle has."""


def accelerations_of(layout: Layout) -> Accelerations:
    """Return the formulas for a simulator that moves the body itself."""
    equation = equation_of(layout)
    terms, _ = _terms_of_known(equation, layout)
    rates = {v: rate_formula(own) for v, own in terms.items()}
    formulas = {**equation.program, **equation.forces}
    unknown = {*equation.states, *equation.orientation} - {*_KNOWN}
    numbers = {name: x for name, x in formulas.items() if name not in unknown and unknown.isdisjoint(x.names)}
    mass = mass_matrix(layout, equation.names)
    masses: dict[tuple[str, str], Expression] = {(v, v): 1.0 / equation.names("gain", v) for v in mass.gains}
    for a, b in (pair for pair in mass.entries if {*pair} <= {*mass.gains}):
        masses[a, b] = masses[b, a] = equation.names("mass", a + b)
    return Accelerations(
        equation, numbers, [[masses.get((a, b), of(0.0)) for b in BY_VELOCITY] for a in BY_VELOCITY], rates
    )


# ---- What lags ----

TIME = Name("_time")
"""The time since the numbers were computed, s. No other identifier begins so."""


def arrived(equation: Equation) -> dict[str, Expression]:
    """Return the fraction of each lag that has arrived, by its name."""
    return {lag.arrived: -call("expm1", -lag.rate * TIME) for lag in equation.lags}


def lagging(equation: Equation) -> dict[str, Expression]:
    """Return the forces and the speeds of rotors that lag, by their names."""
    return {
        force: Name(force) - (Name(steady) - Name(force)) * call("expm1", -lag.rate * TIME)
        for lag in equation.lags
        for force, steady in lag.steady.items()
    }


def reversals(equation: Equation) -> list[Expression]:
    """Return the time until each rotor reverses, from when the numbers were computed; infinite if it never does."""
    return [call("log1p", x) / lag.rate for lag in equation.lags for x in lag.reversals]


# ---- Parts of the module ---------------------------------------------------------------------------------------------


def _assignments(formulas: Mapping[str, Expression]) -> str:
    lines = [f'    v["{name}"] = {written(x, PYTHON, _value)}' for name, x in formulas.items()]
    return "\n".join(lines)


def _value(name: Name) -> str:
    return name.identifier if name == TIME else f'v["{name.identifier}"]'


def _rates(equation: Equation, layout: Layout, states: list[str]) -> str:
    """Print the inner function of `motion`, after the coefficients that it uses."""
    formulas = {name: rate_formula(terms) for name, terms in equation.rows.items()} | _quaternion_rates(layout, states)
    rates = "".join(f"            {written(x, PYTHON)},  # {name}\n" for name, x in formulas.items())
    return f"""\
{_coefficients(formulas.values(), equation, states)}
    def rates(_time, _state):
{_states(equation, states, " " * 8)}
        return [
{rates}        ]

    return rates
"""


def _sizes(equation: Equation, layout: Layout, states: list[str]) -> str:
    """Print the function of the sizes of the terms in the rates."""
    formulas = {name: total(abs(term.formula) for term in terms) for name, terms in equation.rows.items()} | {
        name: abs(rate) for name, rate in _quaternion_rates(layout, states).items()
    }
    sizes = "".join(f"        {written(x, PYTHON)},  # {name}\n" for name, x in formulas.items())
    return f"""\
def sizes(_numbers, _time, _state):
    \"\"\"Return the sum of the sizes of the terms in the rate of each state.\"\"\"
{_coefficients(formulas.values(), equation, states)}{_states(equation, states, " " * 4)}
    return [
{sizes}    ]
"""


def _quaternion_rates(layout: Layout, states: list[str]) -> dict[str, Expression]:
    return quaternion_rates(frozenset(states)) if layout.has_attitude else {}


def _coefficients(formulas: Iterable[Expression], equation: Equation, states: list[str]) -> str:
    """Print assignments of the numbers that formulas use besides the states."""
    rates = (lag.rate for lag in equation.lags)
    used = dict.fromkeys(name for x in [*formulas, *rates] for name in sorted(x.names) if name not in states)
    return "".join(f'    {name} = _numbers["{name}"]\n' for name in used)


def _states(equation: Equation, states: list[str], indent: str) -> str:
    """Print assignments of the states. The progress of a lag follows from the time alone."""
    return f"{indent}{', '.join(states)}, = _state\n{_arrived(equation, indent)}".rstrip("\n")


def _arrived(equation: Equation, indent: str) -> str:
    """Print assignments of the arrived fractions of the lags."""
    return "".join(f"{indent}{name} = {written(x, PYTHON)}\n" for name, x in arrived(equation).items())


def _lagging_text(equation: Equation) -> str:
    """Print the functions of the forces and speeds that lag, and of the time until the first rotor reverses."""
    return f"""\
def lagging(v, _time):
    \"\"\"Return the forces and the speeds of rotors that lag, at a time since the numbers were computed.\"\"\"
    return {{{", ".join(_lagging(equation))}}}


def until_reversal(v):
    \"\"\"Return the time from when the numbers were computed until a rotor reverses, and they no longer hold.\"\"\"
    return min([inf{"".join(_reversals(equation))}])
"""


def _lagging(equation: Equation) -> Iterable[str]:
    """Print the entries of a dictionary of the forces that lag."""
    return (f'"{force}": {written(x, PYTHON, _value)}' for force, x in lagging(equation).items())


def _reversals(equation: Equation) -> Iterable[str]:
    """Print the time until each rotor reverses, each after a comma."""
    return (f", {written(x, PYTHON, _value)}" for x in reversals(equation))


def _tables(tables: Mapping[str, CommandTable]) -> str:
    """Print the functions of tables."""
    return "".join(
        f"""

def {name}(command):
    \"\"\"Return the measured {table.kind} of a thruster.\"\"\"
    return interpolated(command, {(table.commands, table.values, table.slopes)!r})
"""
        for name, table in tables.items()
    )
