"""The tuning guide of section 5 in closed form: α for the wanted V_ss, then β for the wanted Tau, (17), (18)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

import numpy as np

from rov_fmu.files.csv_table import read_columns
from rov_fmu.identify.least_squares import Array, Estimate, estimate_alike, fit_named
from rov_fmu.identify.response_fit import Point, predict
from rov_fmu.identify.tank_tests import HELD_COMMAND, time_constant_column, velocity_column
from rov_fmu.motion.rov import COEFFICIENTS, Axis, Coefficients


class TuningError(ValueError):
    """A response that no tuning gives: one line."""


@dataclass(frozen=True)
class Tuning:
    """α and β of one axis for the wanted points, in the vehicle's coefficients."""

    axis: Axis
    coefficients: Coefficients
    points: tuple[Point, ...]
    estimate: Estimate | None = None
    """Where they are fitted to many points."""

    @property
    def alpha(self) -> float:
        """Factor of thrust."""
        return float(getattr(self.coefficients, self.axis.coefficient("alpha")))

    @property
    def beta(self) -> float:
        """Factor of acceleration."""
        return float(getattr(self.coefficients, self.axis.coefficient("beta")))

    @property
    def model(self) -> Array:
        """V_ss or Tau of the tuned model at every point."""
        return predict(self.axis, self.coefficients, self.points)


def tune(k: Coefficients, axis: Axis, command: float, V_ss: float, Tau: float | None = None) -> Tuning:
    """α and β that give V_ss (m/s, rad/s) and Tau (s) at one command; without Tau β stays. Raises TuningError."""
    wanted = {"V_ss": V_ss} if Tau is None else {"V_ss": V_ss, "Tau": Tau}
    points = tuple(Point(quantity, command, value, 1.0, "") for quantity, value in wanted.items())
    return Tuning(axis, _each_median(k, axis, points), points)


def tune_over(k: Coefficients, axis: Axis, points: Sequence[Point]) -> Tuning:
    """α and β with the least relative errors over many V_ss and Tau, drag as it is; without Tau β stays.

    Raises TuningError.
    """
    start = _each_median(k, axis, points)
    kinds = ("alpha", "beta") if any(p.quantity == "Tau" for p in points) else ("alpha",)
    measured = np.array([p.value for p in points])
    solution = fit_named(
        lambda values: predict(axis, replace(k, **values), points) / measured - 1.0,
        {name: getattr(start, name) for name in map(axis.coefficient, kinds)},
    )
    found = estimate_alike(tuple(map(axis.coefficient, kinds)), solution, len(points))
    return Tuning(axis, replace(k, **found.named), tuple(points), found)


def _each_median(k: Coefficients, axis: Axis, points: Sequence[Point]) -> Coefficients:
    """The median of the α that give each V_ss, and then of the β that give each Tau. Raises TuningError.

    Thrust α F balances drag at V_ss, a_d V^2 + b_d V = α F, and Tau is inversely proportional to β.
    """
    for p in points:
        if reason := _impossible(axis, p):
            raise TuningError(f"{axis.name}: {reason}")
    a_d, b_d = (getattr(k, axis.coefficient(kind)) for kind in ("a_d", "b_d"))
    alphas, beta = [], axis.coefficient("beta")
    for p in (p for p in points if p.quantity == "V_ss"):
        force = axis.force(k, p.command)
        if p.value * force <= 0.0:
            raise TuningError(f"{axis.name}: a command of {p.command:g} gives a force of {force:g} {axis.load}")
        alphas.append((a_d * abs(p.value) + b_d) * p.value / force)
    if not alphas:
        raise TuningError(f"{axis.name}: there is no V_ss, which alpha is tuned by")
    tuned = _with(k, axis.coefficient("alpha"), alphas)
    plain = replace(tuned, **{beta: 1.0})
    betas = [axis.response(plain, p.command)[1] / p.value for p in points if p.quantity == "Tau"]
    return _with(tuned, beta, [float(np.median(betas))]) if betas else tuned


def tuned_values(tuning: Tuning) -> tuple[dict[str, float], str]:
    """α and β by name, and in words what they are tuned to."""
    names = [tuning.axis.coefficient(kind) for kind in ("alpha", "beta")]
    wanted = ", ".join(f"{p.quantity} = {p.value:g} at {p.command:.0%}" for p in tuning.points[:2])
    reason = f"Tuned to {wanted}{', ...' if len(tuning.points) > 2 else ''}"
    return {name: getattr(tuning.coefficients, name) for name in names}, reason


def read_points(path: Path, axis: Axis) -> tuple[Point, ...]:
    """Wanted points from a CSV file: command, velocity, time constant; blanks where nothing is wanted.

    Raises DataFileError.
    """
    columns = {
        "command": HELD_COMMAND,
        "velocity": velocity_column(axis, optional=True),
        "time constant": time_constant_column(optional=True),
    }
    table = read_columns(path, columns)
    points = []
    for quantity, column in (("V_ss", "velocity"), ("Tau", "time constant")):
        for n, value in enumerate(table.values.get(column, ())):
            command, source = table.values["command"][n], f"{path.name}, line {table.lines[n]}"
            if not isfinite(value):
                continue
            point = Point(quantity, command, value, 1.0, source)
            if reason := _impossible(axis, point):
                raise table.error(n, column, reason)
            points.append(point)
    return tuple(points)


def _impossible(axis: Axis, point: Point) -> str | None:
    """Why no tuning gives the point."""
    if not 0.0 < abs(point.command) <= 1.0:
        return f"a command of {point.command:g} must be within -1 ... 1 and not 0, a fraction of full thrust"
    if point.quantity == "Tau":
        return None if 0.0 < point.value < np.inf else f"Tau = {point.value:g} s must be above 0"
    if not 0.0 < point.value * point.command < np.inf:
        return f"V_ss = {point.value:g} {axis.unit} must have the sign of the command {point.command:g}"
    return None


def _with(k: Coefficients, name: str, wanted: Sequence[float]) -> Coefficients:
    """With the median of the wanted values of a coefficient, each of which must be one that it may have."""
    maximum = COEFFICIENTS[name].maximum
    for value in wanted:
        if not 0.0 < value <= maximum:
            raise TuningError(f"{name} = {value:g} would do it: must be above 0 and at most {maximum:g}")
    return replace(k, **{name: float(np.median(wanted))})
