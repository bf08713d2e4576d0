"""Fit drag and β of one axis to measured V_ss and Tau: least squares of their relative errors, in closed form (17)."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite

import numpy as np

from rov_fmu.identify.least_squares import (
    Estimate,
    Solution,
    estimate_alike,
    external,
    fit_named,
    gain,
    leave_one_out,
    rms,
)
from rov_fmu.identify.points.choice import MARGIN, Choice, aicc
from rov_fmu.identify.points.drag_forms import LEFT_OUT, DragForm, Point, candidate_forms, level
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.vehicle.uncertainty import is_factor

_DIGITS = 1e-5
"""The smallest possible relative error of a measurement."""


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """Drag and β of one axis, fitted to the relative errors of V_ss and Tau at n points."""

    axis: Axis
    points: tuple[Point, ...]
    rov: Rov
    estimate: Estimate
    given_thrust: Estimate
    """The estimate for an exact thrust curve. An error of the curve hardly changes V_ss and Tau, because the drag
    compensates for it."""
    assumed: Mapping[str, str]
    """Coefficients that are not identifiable from the points, and the assumption about each."""
    by_thrust: Mapping[str, Array]
    """The derivatives of the p fitted coefficients by each coefficient of thrust."""
    leave_one_out: Array
    """n: the prediction of every point by a fit without the points of its thrust; NaN where too few remain."""
    choices: tuple[Choice, ...] = ()
    """The other forms of drag, and whether the fit has one of them."""

    @property
    def model(self) -> Array:
        """The fitted model at every point, n."""
        return predict(self.axis, self.rov, self.points)

    def rms(self, quantity: str, *, leave_one_out: bool = False) -> float:
        """Return the RMS relative error over the points of V_ss or Tau that count."""
        return relative_rms(self.points, self.leave_one_out if leave_one_out else self.model, quantity)

    def band(self, commands: Array) -> tuple[Array, Array, Array, Array]:
        """Return the 95 % confidence band over commands: V_ss low and high, Tau low and high."""
        return response_band(self.axis, self.rov, self.given_thrust, commands)


def fit_response(
    axis: Axis, points: Sequence[Point], base: Rov, known: Collection[str] = (), thrust: Estimate | None = None
) -> ResponseFit:
    """Fit the unknown coefficients among a_d, b_d and β of the axis; `base` has the others, including α.

    The plain form has linear and quadratic drag, the same in both directions. Another form is chosen if both the
    information criterion and leave-one-thrust-out prefer it to the plain form, and to every form that has only some of
    its coefficients. The intervals are those of the fit with all coefficients, including the ones that are left out.
    `thrust` is the estimate of measured thrust curves; its uncertainty widens the intervals.
    """
    data = tuple(points)
    plain, *others = (_Candidate(axis, data, form) for form in candidate_forms(axis, data, base, known))
    better = [c for c in others if c.beats(plain) and all(c.beats(part) for part in others if part.is_part_of(c))]
    chosen = min(better, key=lambda c: c.aicc, default=plain)
    whole = next(c for c in (plain, *others) if c.form.keys == chosen.form.keys and not c.form.zero)
    at = chosen.rov
    reasons = dict.fromkeys(chosen.form.zero, LEFT_OUT)
    return ResponseFit(
        axis,
        data,
        at,
        whole.estimate(at, thrust),
        whole.estimate(at),
        {**chosen.form.assumed, **reasons},
        whole.gains(at, thrust) if thrust is not None else {},
        chosen.leave_one_out,
        tuple(other.choice(plain, other is chosen) for other in others if other.form.is_open and isfinite(other.aicc)),
    )


class _Candidate:
    """One form of the drag, fitted."""

    def __init__(self, axis: Axis, points: tuple[Point, ...], form: DragForm) -> None:
        self.axis, self.points, self.form = axis, points, form
        self.used = [p for p in points if p.weight > 0.0]
        self._solution = _solve(axis, self.used, form.base, _start(axis, self.used, form.base, form.names))
        self.rov = form.base.replaced(external(form.names, self._solution.x))

    @cached_property
    def aicc(self) -> float:
        """The information criterion over the points that count."""
        r = self._solution.residuals
        return aicc(float(r @ r), len(self.used), len(self.form.names), _DIGITS)

    def estimate(self, at: Rov, thrust: Estimate | None = None) -> Estimate:
        """Return the estimate with the values of `at` and the uncertainty of this fit."""
        names = self.form.names
        by_thrust = (self._slopes(at, thrust), thrust.covariance) if thrust is not None and names else None
        found = estimate_alike(names, self._solution, len(self.used), by_thrust)
        return replace(found, values=np.array([at[name] for name in names]))

    def gains(self, at: Rov, thrust: Estimate) -> dict[str, Array]:
        """Return the derivatives of the fitted coefficients, around other values, by each coefficient of thrust."""
        found = external(self.form.names, self._solution.x)
        scale = np.array([value if is_factor(name) else 1.0 for name, value in found.items()])
        moved = gain(self._solution.jacobian, self._slopes(at, thrust)) * scale[:, None]
        return dict(zip(thrust.names, moved.T, strict=True))

    def _slopes(self, at: Rov, thrust: Estimate) -> Array:
        """Return the derivatives of the residuals by the coefficients of thrust."""
        steps = {name: 1e-5 * max(abs(at[name]), 0.1) for name in thrust.names}
        values = external(self.form.names, self._solution.x)
        return _slopes(lambda k: _residuals(self.axis, self.used, k, values), self.form.base, steps)

    @cached_property
    def leave_one_out(self) -> Array:
        """The prediction of every point by a fit without its thrust."""
        return leave_one_out(np.array([level(p) for p in self.points]), self._without)

    def _without(self, out: Flags) -> Array | None:
        rest = [p for p, is_out in zip(self.points, out, strict=True) if not is_out and p.weight > 0.0]
        names = self.form.names
        if not self.form.is_identifiable_from(rest) or len(rest) < len(names):
            return None
        start = external(names, self._solution.x)
        other = self.form.base.replaced(external(names, _solve(self.axis, rest, self.form.base, start).x))
        return predict(self.axis, other, [p for p, is_out in zip(self.points, out, strict=True) if is_out])

    def is_part_of(self, other: "_Candidate") -> bool:
        """Return True when the other form has all of its coefficients, and more."""
        return set(self.form.names) < set(other.form.names)

    def beats(self, other: "_Candidate") -> bool:
        """Return True when both criteria prefer this form; more coefficients must explain clearly more."""
        margin = MARGIN if len(self.form.names) > len(other.form.names) else 0.0
        if not self.aicc + margin < other.aicc:
            return False
        theirs, own = self._errors(other)
        return own <= theirs

    def _errors(self, other: "_Candidate") -> tuple[float, float]:
        """Return the leave-one-thrust-out errors of the other form and this one, over points that both predict."""
        both = [
            n
            for n, p in enumerate(self.points)
            if p.weight > 0.0 and isfinite(other.leave_one_out[n] + self.leave_one_out[n])
        ]
        value = np.array([self.points[n].value for n in both])
        theirs, own = (rms(c.leave_one_out[both] / value - 1.0) for c in (other, self))
        return theirs, own

    def choice(self, plain: "_Candidate", kept: bool) -> Choice:
        """Return the comparison with the plain form, and whether this form is taken."""
        return Choice(self.form.what, kept, plain.aicc - self.aicc, self._errors(plain))


def responses(axis: Axis, rov: Rov, commands: Array) -> Array:
    """Return V_ss and Tau of the model at n commands, n x 2."""
    return np.array([rov.response(axis, c) for c in commands.tolist()])


def predict(axis: Axis, rov: Rov, points: Sequence[Point], thrust: Sequence[float] | None = None) -> Array:
    """Return V_ss or Tau of the model at every point; the thrust at each, without α, may be given."""
    form, thrust = rov.layout.kinds[axis.name], thrust or [rov.force(axis, p.command) for p in points]
    motions = zip(points, (rov.acceleration_of(form, F) for F in thrust), strict=True)
    return np.fromiter((m.time_constant() if p.quantity == "Tau" else m.steady_velocity() for p, m in motions), float)


def holding_force(rov: Rov, axis: Axis, V: float) -> float:
    """Return α F that balances drag and constant load at a velocity: a_d V^2 + b_d V = α F + F_0."""
    plain, form = rov.replaced({axis.coefficient("beta"): 1.0}), rov.layout.kinds[axis.name]
    return -plain.effective_inertia(form) * plain.acceleration_of(form, 0.0).acceleration(V)


def relative_rms(points: Sequence[Point], model: Array, quantity: str) -> float:
    """Return the RMS relative error over the points of one quantity that count; NaN without any."""
    return rms(relative_errors(points, model, quantity)[1])


def relative_errors(points: Sequence[Point], model: Array, quantity: str) -> tuple[Array, Array]:
    """Return the commands and the relative errors of the n points of one quantity that count."""
    found = [
        (p.command, m / p.value - 1.0)
        for p, m in zip(points, model.tolist(), strict=True)
        if p.quantity == quantity and p.weight > 0.0 and isfinite(m)
    ]
    commands, errors = np.array(found).reshape(-1, 2).T
    return commands, errors


def response_band(axis: Axis, rov: Rov, found: Estimate, commands: Array) -> tuple[Array, Array, Array, Array]:
    """Return the 95 % confidence band of V_ss and Tau over commands, to first order in the estimate."""
    steps = {name: 1e-5 * (found[name] or min(found.errors[name], 1.0)) for name in found.names}
    with np.errstate(invalid="ignore"):  # without any drag both are infinite
        curve = responses(axis, rov, commands)
        reach = found.half_band(_slopes(lambda k: responses(axis, k, commands), rov, steps))
        low, high = curve - reach, curve + reach
    return low[:, 0], high[:, 0], low[:, 1], high[:, 1]


def _slopes(numbers: Callable[[Rov], Array], rov: Rov, steps: Mapping[str, float]) -> Array:
    """Return the derivatives of numbers (...) by p coefficients, ... x p, by differences of the given steps.

    The differences are central, and one-sided at 0, where drag has its bound.
    """
    columns = []
    for name, h in steps.items():
        back = h if rov[name] else 0.0
        up, down = (numbers(rov.replaced({name: rov[name] + step})) for step in (h, -back))
        columns.append((up - down) / (h + back))
    return np.stack(columns, axis=-1)


def _solve(axis: Axis, used: Sequence[Point], base: Rov, start: Mapping[str, float]) -> Solution:
    thrust = [base.force(axis, p.command) for p in used]
    return fit_named(lambda values: _residuals(axis, used, base, values, thrust), start)


def _residuals(
    axis: Axis, used: Sequence[Point], base: Rov, values: Mapping[str, float], thrust: Sequence[float] | None = None
) -> Array:
    model = predict(axis, base.replaced(values), used, thrust)
    measured, weights = np.array([p.value for p in used]), np.array([p.weight for p in used])
    return np.asarray(np.sqrt(weights) * (model / measured - 1.0))


def _start(axis: Axis, used: Sequence[Point], base: Rov, names: tuple[str, ...]) -> dict[str, float]:
    """Return the start of the fit. At the mean V_ss, half of the drag is linear and half is quadratic. β follows from
    Tau."""
    beta, alpha = axis.coefficient("beta"), base[axis.coefficient("alpha")]
    steady = [p for p in used if p.quantity == "V_ss"]
    drag = [d for p in steady if (d := alpha * base.force(axis, p.command) / p.value) > 0.0]
    speed = float(np.mean([abs(p.value) for p in steady])) if steady else 1.0
    mean = float(np.mean(drag)) if drag else 1.0
    share = {"a_d": 0.5 * mean / speed, "b_d": 0.5 * mean, "beta": 1.0, "F_0": 0.0}
    start = {name: share[next(key for key in share if name.startswith(key))] for name in names}
    rov = base.replaced(start)
    ratios = [rov.response(axis, p.command)[1] / p.value for p in used if p.quantity == "Tau"]
    if ratios and beta in names:
        start[beta] = float(np.median(ratios)) * rov[beta]
    return start
