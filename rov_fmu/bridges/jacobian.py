"""The Jacobians of a step.

They are the derivatives of the states at its end with respect to the states at its start, the inputs and the
coefficients: differences of sixth order of exact steps. A number may be near a kink: where a command saturates or
leaves its dead band, at a point of a table, where a velocity begins in the other direction. There, the difference of
all points differs from that of four of them, and the points move to one side, or closer together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.simulation import Array, reasons, simulate
from rov_fmu.io.messages import InputError, did_you_mean, listed
from rov_fmu.io.numbers import LENGTHS
from rov_fmu.vehicle.vehicle import Vehicle

_SPACINGS = (3e-3, 1e-4, 3e-6)
"""The distances between the points, relative to the size of the number: first the one with the smallest rounding
errors."""
_SIDES = (np.array([-1, 1, 2, 3, -2, -3]), np.arange(1, 7), -np.arange(1, 7))
"""The places of the points: around the number, above it, below it. The first four give a difference of fourth order. It
is not symmetric, because symmetric differences agree about a kink in the middle."""
_SIZE, _SIZE_OF_COEFFICIENT = 1.0, 1e-2
"""The least sizes of a number, in SI units."""
_ENOUGH = 1e-9
"""The points stay where they are when both differences agree so well, relative to the states and their derivatives."""


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

    - `vehicle`: the vehicle, whose layout has the order of the derivatives.
    - `inputs`, `state`: all inputs and states of the vehicle by name, in SI units, as `Vehicle.step` takes them.
    - `h`: the length of the step, s.
    - `coefficients`: the names of the coefficients for which there shall be derivatives as well.

    Commands act at once, also in a vehicle with a dead time. At a kink of the thrust curve (saturation, dead band), the
    derivative is that of one side.

        inputs, state = rov.layout.usual_inputs | {"u_l": 0.3, "u_r": 0.3}, rov.layout.at_rest | {"u": 0.4}
        found = step_jacobian(rov, inputs, state, 0.1, ["a_d_u"])
        found.states[0, 0], found.coefficients[0, 0]  # d u / d u before the step; d u / d a_d_u, (m/s) / (N.s2/m2)

    Raises ValueError when the motion overflows or takes too many substeps, and InputError when a coefficient is
    unknown, an input or a state is missing, or h is not a time.
    """
    layout = vehicle.layout
    LENGTHS.checked("h", h)
    for what, needed, given in (("inputs", layout.inputs, inputs), ("state", layout.state, state)):
        if missing := [name for name in needed if name not in given]:
            raise InputError(f"{what}: {listed(missing)} must be given, too")
    for name in coefficients:
        if name not in vehicle.coefficients:
            raise InputError(f"coefficients: the vehicle has no {name!r}{did_you_mean(name, [*vehicle.coefficients])}")
    free = {**layout.state, **layout.inputs, **{name: layout.coefficients[name] for name in coefficients}}
    values = {**vehicle.coefficients, **inputs, **state}
    at = np.array([values[name] for name in free])
    least = [_SIZE_OF_COEFFICIENT if name in layout.coefficients else _SIZE for name in free]
    low, high = (np.array([getattr(one, bound) for one in free.values()]) for bound in ("minimum", "maximum"))

    def after(rows: Array) -> Array:
        """Return the states after a step with the numbers `free` in each row (states x rows)."""
        given = dict(zip(free, rows.T[:, :, np.newaxis], strict=True))
        given |= {later: given[name] for name, later in layout.acting.items()}
        return simulate(vehicle, [0.0, h], given, vehicles=len(rows), workers=1).values[:, :, 1]

    present = after(at[np.newaxis])
    slopes, error = np.zeros((len(present), len(free))), np.full(len(free), inf)
    for spacing, places in product(_SPACINGS, _SIDES):
        distance = spacing * np.maximum(np.abs(at), least)
        lowest, highest = (at + distance * end(places) for end in (np.min, np.max))
        leaves = ((lowest < low) & (at >= low)) | ((highest > high) & (at <= high))
        some = np.flatnonzero((error > _ENOUGH) & ~leaves)
        if not len(some):
            continue
        rows = np.tile(at, (len(some), len(places), 1))
        rows[np.arange(len(some)), :, some] += np.outer(distance[some], places)
        moved = after(rows.reshape(-1, len(free))).reshape(len(present), *rows.shape[:2]) - present[:, :, np.newaxis]
        fourth, sixth = (moved[:, :, :n] @ _weights(places[:n]) / distance[some] for n in (4, 6))
        own = np.max(np.abs(sixth - fourth) / (np.maximum(np.abs(present), 1.0) + np.abs(sixth)), axis=0)
        better = own < error[some]  # which NaN is not
        slopes[:, some[better]], error[some[better]] = sixth[:, better], own[better]
    if not np.isfinite(error).all():
        raise ValueError(f"the derivatives of the step cannot be computed: {reasons(layout, h)}")
    ends = np.cumsum([len(layout.state), len(layout.inputs)])
    return StepJacobian(dict(zip(layout.state, present[:, 0].tolist(), strict=True)), *np.split(slopes, ends, axis=1))


def _weights(places: NDArray[np.int_]) -> Array:
    """Return the weights of the values at some places in the slope at 0 of the polynomial through them and 0."""
    powers = np.vander(places, len(places) + 1, increasing=True)[:, 1:].T
    return np.linalg.solve(powers, np.eye(len(places))[0])
