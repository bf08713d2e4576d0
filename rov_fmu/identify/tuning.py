"""The tuning guide of section 5: α for the wanted V_ss, then β for the wanted Tau, in closed form, (17), (18).

It holds for any vehicle and axis, with thrust and drag by direction, dead band, loss of thrust by the speed of advance,
and constant load. α and β for many points minimise the sum of the squared relative errors, and the closed form is where
this fit starts.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, inf, log

import numpy as np
from scipy.optimize import least_squares

from rov_fmu.equation.catalogue import TUNING, Axis
from rov_fmu.identify.result import Interval
from rov_fmu.io.messages import RovError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.vehicle.uncertainty import quantile
from rov_fmu.vehicle.vehicle import Vehicle

ALPHA = 0.5, 2.0
"""The range of a plausible α. Thrust that is measured in a tank is known to better than a factor of 2; the paper has α
of 1.1 to 1.2."""
BETA, BETA_WITH_ADDED_MASS = (0.05, 1.2), (0.3, 3.0)
"""The range of a plausible β: without added mass, the inertia is between 20 times that of the vehicle and a little less
than it, which wrong forces or masses may explain."""

_LEAST = 1e-9
"""The least size of a wanted V_ss or Tau. The relative errors of smaller ones overflow."""


class TuningError(RovError, ValueError):
    """No tuning gives the wanted response. The message is one line."""


@dataclass(frozen=True)
class Target:
    """A wanted V_ss (m/s, rad/s) or Tau (s) at a held command, a fraction of the full command."""

    quantity: str
    """V_ss or Tau."""
    command: float
    value: float

    def by(self, vehicle: Vehicle, axis: Axis) -> float:
        """Return the V_ss or the Tau of a vehicle at the command."""
        V_ss, Tau = vehicle.response(axis, self.command)
        return V_ss if self.quantity == "V_ss" else Tau


@dataclass(frozen=True)
class Tuning:
    """A vehicle with the α and β of one axis that suit the wanted points best."""

    axis: Axis
    vehicle: Vehicle
    points: Sequence[Target]
    intervals: Mapping[str, Interval | None]
    """The 95 % interval of each tuned coefficient, by its name; None if there are not more points than coefficients."""


def tune(vehicle: Vehicle, axis: Axis, points: Sequence[Target]) -> Tuning:
    """Find α and β for wanted points. Without any Tau, β stays. Raises TuningError.

    The intervals of many points follow from their scatter, by Student's distribution.
    """
    start = _closed_form(vehicle, axis, points)
    kinds = ("alpha", "beta") if any(p.quantity == "Tau" for p in points) else ("alpha",)
    names = [axis.coefficient(kind) for kind in kinds]
    declared = [vehicle.layout.coefficients[name] for name in names]
    lowest, largest = [one.minimum for one in declared], [one.maximum for one in declared]
    highest = [log(most) for most in largest]

    def tuned(logs: Array) -> Vehicle:
        return start.with_(**dict(zip(names, np.clip(np.exp(logs), lowest, largest).tolist(), strict=True)))

    def errors(logs: Array) -> list[float]:
        return [p.by(tuned(logs), axis) / p.value - 1.0 for p in points]

    first, ends = np.log([start[name] for name in names]), dict.fromkeys(("ftol", "xtol", "gtol"), 1e-14)
    fit = least_squares(errors, first, jac="3-point", bounds=(-inf, highest), method="dogbox", **ends)
    intervals: dict[str, Interval | None] = dict.fromkeys(names)
    if (degrees := len(points) - len(names)) > 0:
        covariance = np.linalg.inv(fit.jac.T @ fit.jac) * 2.0 * fit.cost / degrees
        for name, x, variance, most in zip(names, fit.x, np.diag(covariance), highest, strict=True):
            reach = min(quantile(degrees) * variance**0.5, 100.0)
            intervals[name] = exp(x - reach), exp(min(x + reach, most))
    return Tuning(axis, tuned(fit.x), points, intervals)


def _closed_form(vehicle: Vehicle, axis: Axis, points: Sequence[Target]) -> Vehicle:
    """Take the median of the α that give each V_ss, then of the β that give each Tau. Raises TuningError."""
    for p in points:
        if reason := impossible(vehicle, axis, p):
            raise TuningError(f"{axis.name}: {reason}")
    steady = [p for p in points if p.quantity == "V_ss"]
    alphas = [_holding(vehicle, axis, p.value) / _thrust(vehicle, axis, p.command, p.value) for p in steady]
    if not alphas:
        raise TuningError(f"{axis.name}: there is no V_ss, and alpha is tuned to V_ss")
    tuned, beta = _with(vehicle, axis.coefficient("alpha"), alphas), axis.coefficient("beta")
    plain = tuned.with_(**{beta: 1.0})  # Tau is proportional to 1/β
    betas = [p.by(plain, axis) / p.value for p in points if p.quantity == "Tau"]
    return _with(tuned, beta, betas) if betas else tuned


def _with(vehicle: Vehicle, name: str, wanted: Sequence[float]) -> Vehicle:
    """Set a coefficient to the median of the wanted values, each of which must be possible. Raises TuningError."""
    maximum = vehicle.layout.coefficients[name].maximum
    for value in wanted:
        if not 0.0 < value <= maximum:
            raise TuningError(f"{name} would have to be {value:g}, but it must be above 0 and at most {maximum:g}")
    return vehicle.with_(**{name: float(np.median(wanted))})


def _thrust(vehicle: Vehicle, axis: Axis, command: float, V: float) -> float:
    """Return F - L V, the thrust or torque at a velocity before α, with what it loses by the speed of advance.

    L is the part of the linear drag that appears with the command.
    """
    plain = vehicle.with_(**{axis.coefficient(kind): 1.0 for kind in TUNING})
    lost = plain.motion_at(axis, command).B - plain.motion_at(axis, 0.0).B
    return vehicle.force(axis, command) - plain.effective_inertia(axis) * lost * V


def _holding(vehicle: Vehicle, axis: Axis, V: float) -> float:
    """Return the thrust that balances drag and constant load at a velocity: a_d V^2 + b_d V = α (F - L V) + F_0."""
    plain, form = vehicle.with_(**{axis.coefficient("beta"): 1.0}), vehicle.layout.by_name[axis.name]
    return -plain.effective_inertia(form.axis) * plain.motion_at(axis, 0.0).acceleration(V)


def impossible(vehicle: Vehicle, axis: Axis, point: Target) -> str | None:
    """Return the reason why no tuning gives the point, or None."""
    c, value = point.command, point.value
    if not 0.0 < abs(c) <= 1.0:
        return f"a command of {c:g} must be within -1 ... 1 and not 0, a fraction of the full command: 30 % is 0.3"
    if not (force := vehicle.force(axis, c)):
        dead = all("c_0" in vehicle.layout.curve_of[t.name].keys for t in vehicle.layout.thrusters_along(axis))
        return f"a command of {c:g} gives no {axis.push}{', it is within the dead band' if dead else ''}"
    if point.quantity == "Tau":
        return None if _LEAST <= value < inf else f"Tau = {value:g} s must be at least {_LEAST:g} s"
    if not _LEAST <= abs(value) < inf:
        return f"V_ss = {value:g} {axis.unit} must have a size of at least {_LEAST:g} {axis.unit}"
    if _holding(vehicle, axis, value) * (thrust := _thrust(vehicle, axis, c, value)) > 0.0:
        return None
    form, allowed = vehicle.layout.by_name[axis.name], "positive" if force > 0.0 else "negative"
    if "F_0" in form.keys:
        drift = vehicle.motion_at(axis, 0.0).steady_velocity()
        allowed = f"{'above' if force > 0.0 else 'below'} the {drift:g} {axis.unit} that F_0 alone gives"
    reason = f"a command of {c:g} gives a {axis.push} of {force:g} {axis.load}"
    if thrust * force <= 0.0:
        allowed = f"slower than {value * force / (force - thrust):g} {axis.unit}"
        reason = f"a command of {c:g} has lost its {axis.push} there by the speed of advance (d)"
    return f"V_ss = {value:g} {axis.unit} must be {allowed}, for {reason}"


def implausible(tuning: Tuning) -> Iterator[Finding]:
    """Yield a finding about each tuned coefficient that is implausible."""
    axis, has_added = tuning.axis, "m_a" in tuning.vehicle.layout.by_name[tuning.axis.name].keys
    for kind, (low, high) in {"alpha": ALPHA, "beta": BETA_WITH_ADDED_MASS if has_added else BETA}.items():
        value = tuning.vehicle[name := axis.coefficient(kind)]
        if name in tuning.intervals and not low <= value <= high:
            inertia = f"{1.0 / value:.3g} times {axis.inertia}{' and the added one' if has_added else ''}"
            words = {kind: name, "push": axis.push, "unit": axis.unit, "inertia": inertia, "mass": axis.inertia}
            numbers = {"value": value, "low": low, "high": high}
            yield Finding(f"implausible tuned {kind}", axis.name, words={**words, **numbers})
