"""The Jacobians of a step.

They are the derivatives of the states at its end with respect to the states at its start, the inputs and the
coefficients.

The step of rov_fmu/equation/step.py is taken with dual numbers, which carry their derivatives through every operation
(forward differentiation). A reversal does not interrupt the derivatives: every term with a coefficient that depends on
the direction of a velocity is 0 where this velocity is 0, so the rates are continuous there.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation import step
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.printed import loaded
from rov_fmu.io.messages import InputError, did_you_mean
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
    """Return the states after h > 0 seconds with the inputs held, and their derivatives.

    The states and inputs are in the order of `vehicle.layout.state` and `vehicle.layout.inputs`. `coefficients` are the
    names of the coefficients for which there shall be derivatives as well. Commands act at once, also in a vehicle with
    a dead time. At a kink of the thrust curve (saturation, dead band), the derivative is that of one side.

    Raises ValueError when the motion overflows or takes too many substeps, and InputError when a coefficient is
    unknown.
    """
    layout = vehicle.layout
    for name in coefficients:
        if name not in vehicle.coefficients:
            raise InputError(f"coefficients: the vehicle has no {name!r}{did_you_mean(name, [*vehicle.coefficients])}")
    names = [*layout.state, *layout.inputs, *coefficients]
    numbers = np.hstack([[[{**vehicle.coefficients, **inputs, **state}[name]] for name in names], np.eye(len(names))])
    known = {**vehicle.coefficients, **dict(zip(names, map(Dual, numbers), strict=True))}
    if layout.has_dead_time:
        known |= {delayed_name(name): known[name] for name in layout.commands}
    with np.errstate(all="ignore"):  # an overflow ends the motion
        motion = _Tangents(_model_of(layout), known)
        is_done = motion.move(h)
    if not is_done:
        raise ValueError(
            "the derivatives of the step cannot be computed: it overflows, or never settles and needs to be shorter"
        )
    after = motion.end()
    derivatives = np.array([_row(after[name], numbers.shape[1])[1:] for name in layout.state])
    n, m = len(layout.state), len(layout.state) + len(layout.inputs)
    return StepJacobian(
        {name: float(after[name]) for name in layout.state}, derivatives[:, :n], derivatives[:, n:m], derivatives[:, m:]
    )


class Dual:
    """A number and its derivatives, in one array: the number is first."""

    __slots__ = ("row",)

    def __init__(self, row: Array) -> None:
        self.row = row

    def __float__(self) -> float:
        return float(self.row[0])

    def __bool__(self) -> bool:
        return float(self) != 0.0

    def __neg__(self) -> "Dual":
        return Dual(-self.row)

    def __abs__(self) -> "Dual":
        return -self if self < 0.0 else self

    def __add__(self, other: "Dual | float") -> "Dual":
        return Dual(self.row + other.row) if isinstance(other, Dual) else self._with(float(self) + other, 1.0)

    def __sub__(self, other: "Dual | float") -> "Dual":
        return self + -other

    def __mul__(self, other: "Dual | float") -> "Dual":
        if not isinstance(other, Dual):
            return Dual(self.row * other)
        product = float(self) * other.row + float(other) * self.row
        product[0] = float(self) * float(other)
        return Dual(product)

    def __truediv__(self, other: "Dual | float") -> "Dual":
        if not isinstance(other, Dual):
            return Dual(self.row / other)
        return self * other._with(1.0 / float(other), -1.0 / float(other) ** 2)

    def __pow__(self, exponent: float) -> "Dual":
        return self._with(float(self) ** exponent, exponent * float(self) ** (exponent - 1.0))

    def __radd__(self, other: float) -> "Dual":
        return self + other

    def __rsub__(self, other: float) -> "Dual":
        return -self + other

    def __rmul__(self, other: float) -> "Dual":
        return self * other

    def __rtruediv__(self, other: float) -> "Dual":
        return self._with(other / float(self), -other / float(self) ** 2)

    def __lt__(self, other: "Dual | float") -> bool:
        return float(self) < float(other)

    def __gt__(self, other: "Dual | float") -> bool:
        return float(self) > float(other)

    def __le__(self, other: "Dual | float") -> bool:
        return float(self) <= float(other)

    def __ge__(self, other: "Dual | float") -> bool:
        return float(self) >= float(other)

    def __eq__(self, other: object) -> bool:
        return float(self) == other

    __hash__ = None  # type: ignore[assignment]

    def _with(self, value: float, slope: float) -> "Dual":
        """Return a function of this number by its value and its derivative."""
        row = slope * self.row
        row[0] = value
        return Dual(row)


def _row(x: "Dual | float", width: int) -> Array:
    """Return a number and its derivatives, which are 0 for a float."""
    return x.row if isinstance(x, Dual) else np.concatenate(([x], np.zeros(width - 1)))


def _function(value: Callable[[float], float], slope: Callable[[float], float]) -> Callable[[Any], Any]:
    """Return a function of dual numbers and floats."""
    return lambda x: x._with(value(float(x)), slope(float(x))) if isinstance(x, Dual) else value(x)


def _power(base: Any, exponent: Any) -> Any:
    """Return the power of a base that is not negative."""
    x, n = float(base), float(exponent)
    found: Any = x**n
    if isinstance(base, Dual):
        found = base._with(found, n * x ** (n - 1.0) if x > 0.0 or n >= 1.0 else 0.0)
    if isinstance(exponent, Dual):
        found = exponent._with(0.0, x**n * math.log(x) if x > 0.0 else 0.0) + found
    return found


def _arctangent(y: Any, x: Any) -> Any:
    """Return atan2."""
    square = float(x) ** 2 + float(y) ** 2
    change = y * (float(x) / square) - x * (float(y) / square)
    return change + (math.atan2(float(y), float(x)) - float(change))


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "expm1": _function(math.expm1, math.exp),
    "sin": _function(math.sin, math.cos),
    "cos": _function(math.cos, lambda x: -math.sin(x)),
    "sqrt": _function(math.sqrt, lambda x: 0.5 / math.sqrt(x)),
    "log": _function(math.log, lambda x: 1.0 / x),
    "pow": _power,
    "atan2": _arctangent,
}


@lru_cache(maxsize=100)
def _model_of(layout: Layout) -> ModuleType:
    return loaded(layout, _FUNCTIONS)


class _Slopes(list[Any]):
    """The rates of the states as dual numbers, which are the rows of a matrix."""

    def __init__(self, matrix: Array) -> None:
        super().__init__(map(Dual, matrix))
        self.matrix = matrix


_TOLERANCE = 1e-10  # of a derivative in a substep
_SHARE = 1e-4  # derivatives below this share of the others of their direction may be rounding errors


class _Tangents(step.Motion):
    """A motion of dual numbers. No state settles, because its derivatives may still change."""

    def __init__(self, model: ModuleType, values: Mapping[str, Any]) -> None:
        self.width = len(next(x for x in values.values() if isinstance(x, Dual)).row)
        super().__init__(model, values)
        self.settled.clear()  # a lag whose forces have arrived still has derivatives
        self.begin()

    def rates(self, after: float, y: list[Any]) -> _Slopes:
        """Return the rates of the states some seconds after the start of the substep."""
        return _Slopes(np.array([_row(x, self.width) for x in super().rates(after, y)]))

    def combined(self, weights: Mapping[int, float], slopes: Sequence[Any]) -> _Slopes:
        """Return a weighted sum of slopes."""
        total = np.zeros_like(slopes[0].matrix)
        for n, weight in weights.items():
            total += weight * slopes[n].matrix
        return _Slopes(total)

    def error(self, h: float, y: list[Any], fifth: Any, third: Any) -> float:
        """Return the largest error of a state or of a derivative, relative to its tolerance."""
        change = h * np.abs(self.rate.matrix[:, 1:])  # type: ignore[attr-defined]
        size = np.abs(np.array([_row(x, self.width)[1:] for x in y])) + change
        least = np.maximum(size, _SHARE * size.max(axis=0)) * _TOLERANCE
        errors = h * np.abs(fifth.matrix[:, 1:])
        worst = np.divide(errors, least, out=np.zeros_like(errors), where=errors > 0.0).max(initial=0.0)
        return max(super().error(h, y, fifth, third), float(worst)) if np.isfinite(size).all() else math.inf

    def settle(self, h: float) -> bool:  # noqa: ARG002
        """Return False."""
        return False
