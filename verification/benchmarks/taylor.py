"""heyoka, an integrator by Taylor series that LLVM compiles, on the equation of a vehicle.

It gets the table of terms of rov_fmu/equation/terms.py, so it has the same states as ours, with the cosine and sine of
the heading. It is compiled once. The forces of a held command and the direction of each drag are runtime parameters, so
commands must not turn any velocity back. It computes no thrust and looks for no reversal, which favours it.
"""

import time
from collections.abc import Mapping
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation.expression import Expression, compiled
from rov_fmu.equation.terms import ONE, Term, equation_of
from rov_fmu.vehicle.vehicle import Vehicle

NOT_INSTALLED = 'not measured: it is not installed (pip install "rov-fmu[benchmarks]")'
Reals = NDArray[np.float64]


def installed() -> bool:
    """Return True when heyoka can be imported."""
    return find_spec("heyoka") is not None


def _value(formula: Expression, at: Mapping[str, float]) -> float:
    return float(compiled({"value": formula})(at)["value"])


class Heyoka:
    """The integrator of a vehicle. Its tolerance is the rounding error, heyoka's default."""

    def __init__(self, rov: Vehicle) -> None:
        import heyoka

        self._rov, self._equation = rov, equation_of(rov.layout)
        rows = self._equation.rows
        coefficients = dict.fromkeys(term.coefficient for terms in rows.values() for term in terms)
        self._parameters = [formula for formula in coefficients if formula not in (ONE, -ONE)]
        parameter = {formula: heyoka.par[n] for n, formula in enumerate(self._parameters)}
        symbols = dict(zip(rows, heyoka.make_vars(*rows), strict=True))

        def product(term: Term) -> object:
            coefficient = parameter.get(term.coefficient)
            first = heyoka.expression(_value(term.coefficient, {})) if coefficient is None else coefficient
            return heyoka.prod([first, *(symbols[name] for name in term.factors)])

        system = [(symbols[name], heyoka.sum([product(term) for term in terms])) for name, terms in rows.items()]
        self._integrator = heyoka.taylor_adaptive(system, np.zeros(len(rows)), pars=np.zeros(len(self._parameters)))

    def hold(self, h: float, steps: int, commands: Reals, start: Reals) -> tuple[float, Reals]:
        """Hold commands one after the other, each for `steps` steps of h. Return seconds per step, and the final state.

        The steps run in a loop in C++: propagate_for takes none that is longer than h. Each command begins with a call
        from Python, which is timed too.
        """
        integrator, end, seconds = self._integrator, start.copy(), 0
        for command in commands:
            at = self._at(command, end)
            values, initial = [_value(formula, at) for formula in self._parameters], self._initial(at)
            integrator.time = 0.0
            integrator.state[:], integrator.pars[:] = initial, values
            began = time.thread_time_ns()
            _, _, _, taken, *_ = integrator.propagate_for(h * steps, max_delta_t=h)
            seconds += time.thread_time_ns() - began
            assert taken >= steps
            end = self._end(at, integrator.state)
        return 1e-9 * seconds / (len(commands) * steps), end

    def _initial(self, at: dict[str, float]) -> list[float]:
        return [at.get(name, 0.0) for name in self._equation.states]

    def _end(self, at: dict[str, float], state: Reals) -> Reals:
        """Return the states of the vehicle. Forces that lag and the quaternion are not states of the equation."""
        at = at | dict(zip(self._equation.states, state.tolist(), strict=True))
        found = at | {force: _value(after, at) for force, (_, after) in self._equation.lagging.items()}
        for name, formula in self._equation.ends.items():
            at[name] = found[name.removeprefix("next_")] = _value(formula, at)
        return np.array([found[name] for name in self._rov.layout.state])

    def _at(self, command: Reals, state: Reals) -> dict[str, float]:
        """Return the values of all formulas at the start of a held command."""
        layout, equation = self._rov.layout, self._equation
        at = dict.fromkeys(layout.inputs, 0.0) | dict(zip(layout.commands, command.tolist(), strict=True))
        at |= {**self._rov.coefficients, **dict(zip(layout.state, state.tolist(), strict=True))}
        for name, formula in {**equation.program, **equation.forces}.items():
            at[name] = _value(formula, at)
        for name, directed in equation.directed.items():  # a velocity at rest goes where its force pushes it
            v = directed.velocity
            is_reverse = at[v] < 0.0 or (at[v] == 0.0 and at[f"constant_{v}"] < 0.0)
            at[name] = _value(directed.reverse if is_reverse else directed.forward, at)
        return at
