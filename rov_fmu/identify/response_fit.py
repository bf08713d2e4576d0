"""Drag and β of one axis from measured V_ss and Tau: least squares of their relative errors, in closed form (17)."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from rov_fmu.identify.least_squares import (
    Array,
    Estimate,
    Flags,
    Solution,
    estimate_alike,
    external,
    fit_named,
    leave_one_out,
    rms,
)
from rov_fmu.identify.tank_tests import thrust_names
from rov_fmu.motion.layout import Axis
from rov_fmu.motion.rov import Rov


@dataclass(frozen=True)
class Point:
    """One measured V_ss (m/s, rad/s) or Tau (s) of an axis at a held command, signs as in the test."""

    quantity: str
    """V_ss or Tau."""
    command: float
    value: float
    weight: float
    source: str
    """File and line, or file and time."""
    error: float | None = None
    """Standard error, of a point from a recording."""


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """Drag and β of one axis by least squares of the relative errors of V_ss and Tau over n points."""

    axis: Axis
    points: tuple[Point, ...]
    rov: Rov
    estimate: Estimate
    given_thrust: Estimate
    """The same, were the thrust curve certain; V_ss and Tau are hardly less so if it is not, for drag bends with it."""
    assumed: Mapping[str, str]
    """Coefficients that are not identifiable from the points, and what is assumed instead."""
    leave_one_out: Array
    """n: prediction of every point by a fit without the points of its thrust; NaN where too few are left."""

    @property
    def model(self) -> Array:
        """n: the fitted model at every point."""
        return predict(self.axis, self.rov, self.points)

    def rms(self, quantity: str, *, leave_one_out: bool = False) -> float:
        """RMS relative error over the points of V_ss or Tau that count."""
        return relative_rms(self.points, self.leave_one_out if leave_one_out else self.model, quantity)

    def band(self, commands: Array) -> tuple[Array, Array, Array, Array]:
        """95 % confidence band of the curves over commands: V_ss low and high, Tau low and high."""
        return response_band(self.axis, self.rov, self.given_thrust, commands)


def fit_response(
    axis: Axis,
    points: Sequence[Point],
    base: Rov,
    known: Collection[str] = (),
    thrust_covariance: Array | None = None,
) -> ResponseFit:
    """Fit what is not known of a_d, b_d and β of the axis; `base` holds the rest, α included.

    The thrust coefficients' covariance (2 x 2, a_t and b_t), where they were fitted, widens the intervals.
    """
    used = [p for p in points if p.weight > 0.0]
    names, assumed = free_coefficients(axis, used, known)
    base = base.replaced({name: value for name, (value, _) in assumed.items()})
    solution = _solve(axis, used, base, names)
    thrust = None
    if thrust_covariance is not None and names:
        steps = {name: 1e-5 * max(abs(base[name]), 0.1) for name in thrust_names(axis)}
        by_thrust = _slopes(lambda k: _residuals(axis, used, k, external(names, solution.x)), base, steps)
        thrust = by_thrust, thrust_covariance

    def without(out: Flags) -> Array | None:
        rest = [p for p, is_out in zip(points, out, strict=True) if not is_out and p.weight > 0.0]
        if not set(free_coefficients(axis, rest, known)[0]) >= set(names) or len(rest) < len(names):
            return None
        other = base.replaced(external(names, _solve(axis, rest, base, names).x))
        return predict(axis, other, [p for p, is_out in zip(points, out, strict=True) if is_out])

    return ResponseFit(
        axis,
        tuple(points),
        base.replaced(external(names, solution.x)),
        estimate_alike(names, solution, len(used), thrust),
        estimate_alike(names, solution, len(used)),
        {name: reason for name, (_, reason) in assumed.items()},
        leave_one_out(np.array([round(abs(p.command), 6) for p in points]), without),
    )


def responses(axis: Axis, rov: Rov, commands: Array) -> Array:
    """n x 2: V_ss and Tau of the model at n commands."""
    return np.array([rov.response(axis, c) for c in commands.tolist()])


def predict(axis: Axis, rov: Rov, points: Iterable[Point]) -> Array:
    """V_ss or Tau of the model at every point."""
    responses = (rov.response(axis, p.command)[p.quantity == "Tau"] for p in points)
    return np.fromiter(responses, float)


def holding_force(rov: Rov, axis: Axis, V: float) -> float:
    """α F that balances drag and constant load at a velocity, a_d V^2 + b_d V = α F + F_0, by its direction."""
    plain, form = rov.replaced({axis.coefficient("beta"): 1.0}), rov.layout.kinds[axis.name]
    return -plain.effective_inertia(form) * plain.acceleration_of(form, 0.0).acceleration(V)


def relative_rms(points: Sequence[Point], model: Array, quantity: str) -> float:
    """RMS relative error over the points of one quantity that count; NaN without any."""
    errors = [m / p.value - 1.0 for p, m in zip(points, model.tolist(), strict=True)
              if p.quantity == quantity and p.weight > 0.0 and isfinite(m)]  # fmt: skip
    return rms(np.array(errors))


def response_band(axis: Axis, rov: Rov, found: Estimate, commands: Array) -> tuple[Array, Array, Array, Array]:
    """95 % confidence band of V_ss and Tau over commands, to first order in the estimate."""
    steps = {name: 1e-5 * (found[name] or min(found.errors[name], 1.0)) for name in found.names}
    with np.errstate(invalid="ignore"):  # without any drag both are infinite
        curve = responses(axis, rov, commands)
        reach = found.half_band(_slopes(lambda k: responses(axis, k, commands), rov, steps))
        low, high = curve - reach, curve + reach
    return low[:, 0], high[:, 0], low[:, 1], high[:, 1]


def _slopes(numbers: Callable[[Rov], Array], rov: Rov, steps: Mapping[str, float]) -> Array:
    """... x p: derivative of numbers (...) by p of the coefficients, by central differences of the given steps."""
    columns = []
    for name, h in steps.items():
        up, down = (numbers(rov.replaced({name: rov[name] + step})) for step in (h, -h))
        columns.append((up - down) / (2.0 * h))
    return np.stack(columns, axis=-1)


def drag_and_beta(axis: Axis, known: Collection[str] = ()) -> tuple[str, ...]:
    """Names of a_d, b_d and β of an axis, as far as they are not known."""
    return tuple(name for kind in ("a_d", "b_d", "beta") if (name := axis.coefficient(kind)) not in known)


def free_coefficients(
    axis: Axis, used: Sequence[Point], known: Collection[str]
) -> tuple[tuple[str, ...], dict[str, tuple[float, str]]]:
    """Coefficients to fit, and those that are not identifiable: the value assumed, and the reason."""
    a_d, b_d, beta = drag_and_beta(axis)
    assumed: dict[str, tuple[float, str]] = {}
    if b_d not in known and a_d not in known and len({round(abs(p.command), 6) for p in used}) < 2:
        assumed[b_d] = (0.0, "Linear and quadratic drag are not identifiable apart from one thrust; assumed 0")
    if beta not in known and not any(p.quantity == "Tau" for p in used):
        assumed[beta] = (1.0, f"{axis.inertia}/{beta} is not identifiable from V_ss alone; assumed 1")
    return drag_and_beta(axis, {*known, *assumed}), assumed


def _solve(axis: Axis, used: Sequence[Point], base: Rov, names: tuple[str, ...]) -> Solution:
    return fit_named(lambda values: _residuals(axis, used, base, values), _start(axis, used, base, names))


def _residuals(axis: Axis, used: Sequence[Point], base: Rov, values: Mapping[str, float]) -> Array:
    model = predict(axis, base.replaced(values), used)
    measured, weights = np.array([p.value for p in used]), np.array([p.weight for p in used])
    return np.asarray(np.sqrt(weights) * (model / measured - 1.0))


def _start(axis: Axis, used: Sequence[Point], base: Rov, names: tuple[str, ...]) -> dict[str, float]:
    """Where to begin: half of the drag linear, half quadratic, at the mean V_ss; then β by the mean Tau."""
    a_d, b_d, beta = drag_and_beta(axis)
    alpha = base[axis.coefficient("alpha")]
    steady = [p for p in used if p.quantity == "V_ss"]
    drag = [d for p in steady if (d := alpha * base.force(axis, p.command) / p.value) > 0.0]
    speed = float(np.mean([abs(p.value) for p in steady])) if steady else 1.0
    mean = float(np.mean(drag)) if drag else 1.0
    start = {a_d: 0.5 * mean / speed, b_d: 0.5 * mean, beta: 1.0}
    rov = base.replaced({name: start[name] for name in names})
    ratios = [rov.response(axis, p.command)[1] / p.value for p in used if p.quantity == "Tau"]
    if ratios:
        start[beta] = float(np.median(ratios)) * rov[beta]
    return {name: start[name] for name in names}
