"""The Jacobians of a step.

They are the derivatives of the states at its end with respect to the states at its start, the inputs and the
coefficients.

In a Taylor series, the derivatives of the coefficients follow from the same table of terms as the coefficients
themselves (rov_fmu/model/step.py), because each term is a product of at most two states. A reversal does not
interrupt the derivatives: every term with a coefficient that depends on the direction of a velocity is 0 where this
velocity is 0, so the rates are continuous there.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rov_fmu.io.messages import InputError, did_you_mean
from rov_fmu.model.attitude import QUATERNION
from rov_fmu.model.catalogue import delayed_name
from rov_fmu.model.equation import Equation, equation_of
from rov_fmu.model.expression import Expression, Name, change_of, compiled, slope_name, tangent
from rov_fmu.model.layout import Layout
from rov_fmu.model.step import ORDER, Motion, Series, Table, usable_time
from rov_fmu.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]


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
    """Return the states after h > 0 seconds with the inputs held, and their derivatives from the series of the step.

    The states and inputs are in the order of `vehicle.layout.state` and `vehicle.layout.inputs`. `coefficients` are the
    names of the coefficients for which there shall be derivatives as well. Commands act at once, also in a vehicle with
    a dead time. At a kink of the thrust curve (saturation, dead band), the derivative is that of one side.

    Raises ValueError when the motion overflows or takes too many pieces, and InputError when a coefficient is unknown.
    """
    layout = vehicle.layout
    for name in coefficients:
        if name not in vehicle.coefficients:
            raise InputError(f"coefficients: the vehicle has no {name!r}{did_you_mean(name, [*vehicle.coefficients])}")
    motion = _Tangents(_formulas_of(layout, tuple(coefficients)), vehicle, inputs, state)
    if not motion.advance(h):
        raise ValueError(
            "the derivatives of the step cannot be computed: it overflows, or never settles and needs to be shorter"
        )
    after, derivatives = motion.result()
    n, m = len(layout.state), len(layout.state) + len(layout.inputs)
    return StepJacobian(after, derivatives[:, :n], derivatives[:, n:m], derivatives[:, m:])


class _Formulas:
    """The compiled derivatives of the formulas of a layout."""

    def __init__(self, layout: Layout, coefficients: tuple[str, ...]) -> None:
        equation = equation_of(layout)
        self.layout, self.table, self.coefficients = layout, Table(equation), coefficients
        changing = [*layout.inputs, *layout.state, *layout.delayed, *coefficients]
        given = {name: change_of(name) for name in changing}
        formulas = {**equation.program, **equation.forces, **self.table.coefficient_formulas}
        self.held_formulas, self.held = _with_tangents(formulas, given, equation)
        lagging = {force: after for force, (_, after) in equation.lagging.items()}
        progress = {name: change_of(name) for name in equation.lags}
        self.lag_formulas, _ = _with_tangents(lagging, {**self.held, **given, **progress}, equation)
        moved = {name: change_of(name) for name in equation.states}
        self.end_formulas, self.finished = _with_tangents(equation.ends, {**given, **moved}, equation)
        pairs = self.table.products
        self.first = np.array([pair[0] for pair in pairs], int)
        self.second = np.array([pair[1] for pair in pairs], int)
        columns: dict[tuple[int, ...], int] = {(): 0}
        columns |= {(i,): 1 + i for i in range(len(self.table.states))}
        columns |= {pair: len(columns) + n for n, pair in enumerate(pairs)}
        terms = [
            (row, columns[factors], place) for row, found in enumerate(self.table.rows) for place, factors in found
        ]
        self.rows, self.columns, self.places = np.array(terms, int).T
        self.width = len(columns)


_formulas_of = lru_cache(maxsize=100)(_Formulas)


def _change(name: str) -> str:
    return change_of(name).identifier


def _with_tangents(
    formulas: Mapping[str, Expression], changing: Mapping[str, Name], equation: Equation
) -> tuple[Callable[[Mapping[str, object]], dict[str, object]], dict[str, Name]]:
    """Compile formulas together with their changes. Return also the names of the changes, by name."""
    changes = dict(changing)
    both: dict[str, Expression] = {}
    for name, formula in formulas.items():
        if change := tangent(formula, changes.get):
            changes[name] = change_of(name)
            both[changes[name].identifier] = change  # before the formula, which may overwrite a value that it needs
        both[name] = formula
    slopes = {slope_name(name): table.slope for name, table in equation.tables.items()}
    return compiled(both, {**equation.measured, **slopes}), changes


class _Tangents(Motion):
    """A motion, and its derivatives with respect to the states at its start, the inputs and the coefficients.

    No state settles.
    """

    def __init__(
        self, formulas: _Formulas, vehicle: Vehicle, inputs: Mapping[str, float], state: Mapping[str, float]
    ) -> None:
        layout = formulas.layout
        self.formulas = formulas
        delayed = {delayed_name(name): inputs[name] for name in layout.commands} if layout.has_dead_time else {}
        given = {name: float(inputs[name]) for name in layout.inputs} | delayed
        given |= {name: float(state[name]) for name in layout.state}
        names = [*layout.state, *layout.inputs, *formulas.coefficients]
        unit = dict(zip(names, np.eye(len(names)), strict=True))
        unit |= {name: unit[command] for name, command in zip(delayed, layout.commands, strict=False)}
        self.changes: dict[str, Array] = {_change(name): change for name, change in unit.items()}
        self.zero = np.zeros(len(names))
        super().__init__(formulas.table, {**vehicle.coefficients, **given})
        found = self._at({})
        starts = formulas.table.equation.starts
        self.d = np.array([self._change(found, name) if name in starts else self.zero for name in self.table.states])
        """The derivatives of the states of the table (states of the table x directions)."""

    def _at(self, more: Mapping[str, float]) -> dict[str, object]:
        return self.formulas.held_formulas({**self.values, **more, **self.changes})

    def _change(self, found: Mapping[str, object], name: str) -> Array:
        return np.asarray(found.get(_change(name), self.changes.get(_change(name), self.zero)), float)

    def hold(self) -> None:
        """Compute the coefficients and their derivatives for both directions of the velocities."""
        for progress in self.table.equation.lags:
            self.put(self.table.place[progress], 0.0)
        both = [self._at(dict.fromkeys(self.table.equation.monitored, sign)) for sign in (1.0, -1.0)]
        names = self.table.coefficients
        self.forward, self.reverse = ([float(found[name]) for name in names] for found in both)  # type: ignore[arg-type]
        self.d_both = np.array([[self._change(found, name) for name in names] for found in both])
        self.direct(self.y)

    def direct(self, signs: Sequence[float]) -> None:
        """Choose the coefficients and their derivatives for the signs of the velocities."""
        super().direct(signs)
        side = [int(v is not None and signs[v] < 0.0) for v in self.table.velocities]
        self.d_k = self.d_both[side, np.arange(len(side))]

    def settle(self) -> None:
        """Choose the coefficients. No state settles, because its derivatives may still change."""
        self.direct(self.y)

    def series(self, unit: float) -> Series:
        """Return the series of all states, and compute that of their derivatives."""
        found = super().series(unit)
        f, c = self.formulas, np.array(found)
        shape = len(c), f.width
        weights, d_weights = np.zeros(shape), np.zeros((*shape, len(self.zero)))
        np.add.at(weights, (f.rows, f.columns), np.array(self.k)[f.places])
        np.add.at(d_weights, (f.rows, f.columns), self.d_k[f.places])
        d = np.zeros((ORDER + 1, *self.d.shape))
        d[0] = self.d
        with np.errstate(all="ignore"):  # `reach` sees an overflow
            self._grow(c, d, weights, d_weights, unit)
        self.d_series = d
        return found

    def _grow(self, c: Array, d: Array, weights: Array, d_weights: Array, unit: float) -> None:
        """Compute the coefficients of the derivatives from those of the states."""
        f = self.formulas
        for n in range(ORDER):
            a, b = c[f.first, : n + 1], c[f.second, n::-1]
            d_a, d_b = d[: n + 1, f.first], d[n::-1, f.second]
            factors = np.concatenate(([float(n == 0)], c[:, n], np.sum(a * b, axis=1)))
            d_products = np.einsum("jpd,pj->pd", d_a, b) + np.einsum("pj,jpd->pd", a, d_b)
            d_factors = np.concatenate((self.zero[np.newaxis], d[n], d_products))
            d[n + 1] = unit / (n + 1) * (weights @ d_factors + np.einsum("iwd,w->id", d_weights, factors))

    def reach(self, series: Series) -> float:
        """Return the time up to which the series of the states and of their derivatives may be used, at most 1."""
        largest = np.abs(self.d_series).max(axis=2, initial=0.0).T.tolist()
        if not np.isfinite(self.d_series[-3:]).all():
            return 0.0
        return min(super().reach(series), *(usable_time(largest[i]) for i in self.table.used))

    def move(self, series: Series, length: float) -> float:
        """Move to the end of a piece, which is at `length` or at the first reversal, and return that time."""
        self.d_start = self.d
        length = self.end_of_piece(series, length)[0]
        self.d = np.tensordot(length ** np.arange(ORDER + 1.0), self.d_series, axes=1)
        return super().move(series, length)

    def arrive(self) -> None:
        """Update the forces that lag, the coefficients, and the derivatives of both."""
        states = self.table.states
        values = {name: self.y[self.table.place[name]] for name in self.table.equation.lags}
        changes = {_change(name): self.d[self.table.place[name]] for name in values}
        steady = self._at({})
        found = self.formulas.lag_formulas({**steady, **values, **changes})
        self.changes |= {_change(force): self._change(found, force) for force in self.table.equation.lagging}
        for name in values:
            self.d[states.index(name)] = 0.0
        super().arrive()

    def result(self) -> tuple[dict[str, float], Array]:
        """Return the states of the vehicle by name, and their derivatives."""
        equation, layout = self.table.equation, self.formulas.layout
        place = self.table.place
        starts = {_change(name): row for name, row in zip(layout.state, np.eye(len(self.zero)), strict=False)}
        rows = {name: self.changes[_change(name)] for name in equation.lagging}
        for name, n in place.items():
            if name in layout.state:
                rows[name] = self.d[n] + (0.0 if name in equation.starts else starts[_change(name)])
        if equation.ends:
            moved = {name: self.y[n] for name, n in place.items()} | {
                _change(name): self.d[n] for name, n in place.items()
            }
            found = self.formulas.end_formulas({**self.start, **starts, **moved})
            rows |= {name: self._change(found, f"next_{name}") for name in QUATERNION}
        end = self.end()
        return {name: end[name] for name in layout.state}, np.array([rows[name] for name in layout.state])
