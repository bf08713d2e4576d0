"""The Jacobians of a step.

They are the derivatives of the states at its end with respect to the states at its start, the inputs and the
coefficients. In the table of terms, the states are y' = sum of c y_j y_k, where y_j or y_k may be 1. A derivative of
the motion solves the variational equation, which follows by the product rule:

    s' = sum of (dc y_j y_k + c s_j y_k + c y_j s_k).

Both equations are solved together, for all derivatives at once: each state, and each coefficient c, is a row with its
value and its derivatives. A reversal does not interrupt the derivatives: every term with a coefficient that depends on
the direction of a velocity is 0 where this velocity is 0, so the rates are continuous there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.equation.expression import change_of, compiled, slope_name, tangents
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import equation_of
from rov_fmu.io.messages import InputError, did_you_mean, listed
from rov_fmu.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]
_TOLERANCE = 1e-10
"""The relative tolerance of a substep."""
_MOST = 1_000_000
"""The largest number of evaluations of the rates. Only a very long step, or a motion that overflows, needs more."""


@dataclass(frozen=True, eq=False)
class StepJacobian:
    """A step and its derivatives."""

    after: dict[str, float]
    """The states after the step, by name."""
    states: Array
    """The derivatives of the states after the step with respect to the states before it (states x states)."""
    inputs: Array
    """The derivatives of the states after the step with respect to the inputs (states x inputs)."""
    coefficients: Array
    """The derivatives of the states after the step with respect to the coefficients that were asked for (states x
    coefficients)."""


def step_jacobian(
    vehicle: Vehicle,
    inputs: Mapping[str, float],
    state: Mapping[str, float],
    h: float,
    coefficients: Sequence[str] = (),
) -> StepJacobian:
    """Return the states after h > 0 seconds with the inputs held, and their derivatives.

    The states and inputs are in the order of `vehicle.layout.state` and `vehicle.layout.inputs`. `coefficients` are the
    names of the coefficients for which there shall be derivatives as well. Commands act at once, also in a vehicle with
    a dead time. At a kink of the thrust curve (saturation, dead band), the derivative is that of one side.

    Raises ValueError when the motion overflows or takes too many substeps, and InputError when a coefficient is
    unknown, an input or a state is missing, or h is not a time.
    """
    layout = vehicle.layout
    if not 0.0 < h < inf:
        raise InputError(f"h = {h}: must be a time above 0, s")
    for what, needed, given in (("inputs", layout.inputs, inputs), ("state", layout.state, state)):
        if missing := [name for name in needed if name not in given]:
            raise InputError(f"{what}: {listed(missing)} must be given, too")
    for name in coefficients:
        if name not in vehicle.coefficients:
            raise InputError(f"coefficients: the vehicle has no {name!r}{did_you_mean(name, [*vehicle.coefficients])}")
    values: dict[str, Any] = {**vehicle.coefficients, **inputs, **state}
    changes = dict(zip([*layout.state, *layout.inputs, *coefficients], np.eye(len(values)), strict=False))
    if layout.has_dead_time:
        values |= {delayed_name(name): values[name] for name in layout.commands}
        changes |= {delayed_name(name): changes[name] for name in layout.commands}
    width = len(layout.state) + len(layout.inputs) + len(coefficients)
    values |= {change_of(name).identifier: changes[name][:width] if name in changes else 0.0 for name in values}
    with np.errstate(all="ignore"):  # an overflow ends the motion
        after = _variational(layout).after(values, h, width)
    if not np.isfinite(after).all():
        raise ValueError(
            "the derivatives of the step cannot be computed: it overflows, or never settles and needs to be shorter"
        )
    ends = np.cumsum([len(layout.state), len(layout.inputs)])
    numbers = dict(zip(layout.state, after[:, 0].tolist(), strict=True))
    return StepJacobian(numbers, *np.split(after[:, 1:], ends, axis=1))


class _Variational:
    """The variational equation of a layout."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.equation = layout, equation_of(layout)
        equation, states = self.equation, [*self.equation.states]
        terms = [term for row in equation.rows.values() for term in row]
        self.places = {name: n for n, name in enumerate(states)}
        self.factors = np.array(
            [[*map(states.index, term.factors), *[len(states)] * (2 - len(term.factors))] for term in terms]
        ).T
        self.sums = np.repeat(np.eye(len(states)), [len(row) for row in equation.rows.values()], axis=1)
        """The matrix that adds the terms of each state."""
        self.coefficients = [f"coefficient_of_term_{n}" for n in range(len(terms))]
        slopes = {slope_name(name): table.slope for name, table in equation.tables.items()}
        given = [*layout.inputs, *layout.state, *layout.delayed, *layout.coefficients]
        own = dict(zip(self.coefficients, (term.coefficient for term in terms), strict=True))
        before, changes = tangents({**equation.program, **equation.forces, **own}, given)
        ends = {f"next_{force}": end for force, (_, end) in equation.lagging.items()}
        after, _ = tangents({**ends, **equation.ends}, [*changes, *states])
        self._before, self._after = compiled(before, equation.measured | slopes), compiled(after)

    def after(self, values: Mapping[str, Any], h: float, width: int) -> Array:
        """Return the states of the vehicle after h seconds, each with its derivatives; NaN if the motion overflows.

        `values` are the inputs, states and coefficients, and the changes of each: an array of this width, or 0.
        """
        equation, count = self.equation, len(self.places)

        def rows(found: Mapping[str, Any], names: Sequence[str]) -> Array:
            table = np.zeros((len(names), 1 + width))
            for row, name in zip(table, names, strict=True):
                row[0], row[1:] = found[name], found.get(change_of(name).identifier, 0.0)
            return table

        held = self._before(values)
        monitored = [self.places[name] for name in equation.monitored]
        by_direction: dict[bytes, Array] = {}

        def coefficients(reverse: NDArray[np.bool_]) -> Array:
            if reverse.tobytes() not in by_direction:
                signs = dict(zip(equation.monitored, np.where(reverse, -1.0, 1.0).tolist(), strict=True))
                by_direction[reverse.tobytes()] = rows(self._before({**values, **signs}), self.coefficients)
            return by_direction[reverse.tobytes()]

        evaluations = 0

        def rates(_: float, y: Array) -> Array:
            nonlocal evaluations
            evaluations += 1
            table = np.vstack([y.reshape(count, 1 + width), np.eye(1, 1 + width)])  # with a row for 1
            first, second = table[self.factors]
            terms = _product(coefficients(table[monitored, 0] < 0.0), _product(first, second))
            derivatives = self.sums @ terms
            return derivatives.ravel() if evaluations < _MOST else np.full_like(y, np.nan)

        start = np.zeros((count, 1 + width))
        starting = [name for name in equation.states if name in equation.starts]
        start[[self.places[name] for name in starting]] = rows(held, starting)
        tolerances = {"rtol": _TOLERANCE, "atol": 1e-2 * _TOLERANCE}
        solved = solve_ivp(rates, (0.0, h), start.ravel(), "DOP853", first_step=0.1 * h, **tolerances)
        if not solved.success:
            return np.full((len(self.layout.state), 1 + width), np.nan)
        by_name = dict(zip(equation.states, solved.y[:, -1].reshape(start.shape), strict=True))
        moved = {name: row[0] for name, row in by_name.items()}
        moved |= {change_of(name).identifier: row[1:] for name, row in by_name.items()}
        results = self._after({**held, **moved})
        own = {name: f"next_{name}" for name in (*equation.lagging, *QUATERNION)}
        found = rows(results, [own.get(name, name) for name in self.layout.state])
        for n, name in enumerate(self.layout.state):
            if name in self.places and name not in equation.starts:
                found[n] += rows(values, [name])[0]  # an integral, which began at 0
        return found


@lru_cache(maxsize=100)
def _variational(layout: Layout) -> _Variational:
    return _Variational(layout)


def _product(a: Array, b: Array) -> Array:
    """Return the products of rows with derivatives."""
    products = a[:, :1] * b
    products[:, 1:] += a[:, 1:] * b[:, :1]
    return products
