"""The tuning guide of section 5 in closed form: α for the wanted V_ss, then β for the wanted Tau, (17), (18).

Of any vehicle and axis, by direction: thrust curves in reverse and their dead band, drag by direction, constant load.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

import numpy as np

from rov_fmu.files.csv_table import read_columns
from rov_fmu.identify.drag_forms import Point
from rov_fmu.identify.least_squares import Estimate, estimate_alike, fit_named, kind_of
from rov_fmu.identify.response_fit import holding_force, predict
from rov_fmu.motion.layout import Axis
from rov_fmu.motion.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import HELD_COMMAND, refuse_slips, time_constant_column, velocity_column


class TuningError(ValueError):
    """A response that no tuning gives: one line."""


@dataclass(frozen=True)
class Tuning:
    """α and β of one axis for the wanted points, in the vehicle."""

    axis: Axis
    rov: Rov
    points: tuple[Point, ...]
    estimate: Estimate | None = None
    """Where they are fitted to many points."""

    @property
    def model(self) -> Array:
        """V_ss or Tau of the tuned model at every point."""
        return predict(self.axis, self.rov, self.points)


def tune(rov: Rov, axis: Axis, command: float, V_ss: float, Tau: float | None = None) -> Tuning:
    """α and β that give V_ss (m/s, rad/s) and Tau (s) at one command; without Tau β stays. Raises TuningError."""
    wanted = {"V_ss": V_ss} if Tau is None else {"V_ss": V_ss, "Tau": Tau}
    points = tuple(Point(quantity, command, value, 1.0, "") for quantity, value in wanted.items())
    return Tuning(axis, _each_median(rov, axis, points), points)


def tune_over(rov: Rov, axis: Axis, points: Sequence[Point]) -> Tuning:
    """α and β with the least relative errors over many V_ss and Tau, drag as it is; without Tau β stays.

    Raises TuningError.
    """
    start = _each_median(rov, axis, points)
    kinds = ("alpha", "beta") if any(p.quantity == "Tau" for p in points) else ("alpha",)
    measured = np.array([p.value for p in points])
    solution = fit_named(
        lambda values: predict(axis, rov.replaced(values), points) / measured - 1.0,
        {name: start[name] for name in map(axis.coefficient, kinds)},
    )
    found = estimate_alike(tuple(map(axis.coefficient, kinds)), solution, len(points))
    return Tuning(axis, rov.replaced(found.named), tuple(points), found)


def _each_median(rov: Rov, axis: Axis, points: Sequence[Point]) -> Rov:
    """The median of the α that give each V_ss, and then of the β that give each Tau. Raises TuningError.

    Tau is inversely proportional to β.
    """
    for p in points:
        if reason := _impossible(rov, axis, p):
            raise TuningError(f"{axis.name}: {reason}")
    steady = [p for p in points if p.quantity == "V_ss"]
    if not steady:
        raise TuningError(f"{axis.name}: there is no V_ss, which alpha is tuned by")
    alphas = [holding_force(rov, axis, p.value) / rov.force(axis, p.command) for p in steady]
    tuned, beta = _with(rov, axis.coefficient("alpha"), alphas), axis.coefficient("beta")
    plain = tuned.replaced({beta: 1.0})
    betas = [plain.response(axis, p.command)[1] / p.value for p in points if p.quantity == "Tau"]
    return _with(tuned, beta, [float(np.median(betas))]) if betas else tuned


def tuned_values(tuning: Tuning) -> tuple[dict[str, float], str]:
    """α and β by name, and in words what they are tuned to."""
    names = [tuning.axis.coefficient(kind) for kind in ("alpha", "beta")]
    wanted = ", ".join(f"{p.quantity} = {p.value:g} at {p.command:.0%}" for p in tuning.points[:2])
    reason = f"Tuned to {wanted}{', ...' if len(tuning.points) > 2 else ''}"
    return {name: tuning.rov[name] for name in names}, reason


def read_points(path: Path, rov: Rov, axis: Axis) -> tuple[Point, ...]:
    """Wanted points from a CSV file: command, velocity, time constant; blanks where nothing is wanted.

    Raises DataFileError.
    """
    columns = {
        "command": HELD_COMMAND,
        "velocity": velocity_column(axis, optional=True),
        "time constant": time_constant_column(optional=True),
    }
    table = read_columns(path, columns)
    refuse_slips(table, ["command"])
    points = []
    for quantity, column in (("V_ss", "velocity"), ("Tau", "time constant")):
        for n, value in enumerate(table.values.get(column, ())):
            command, source = table.values["command"][n], f"{path.name}, line {table.lines[n]}"
            if not isfinite(value):
                continue
            point = Point(quantity, command, value, 1.0, source)
            if reason := _impossible(rov, axis, point):
                raise table.error(n, column, reason)
            points.append(point)
    return tuple(points)


def _impossible(rov: Rov, axis: Axis, point: Point) -> str | None:
    """Why no tuning gives the point."""
    command, value = point.command, point.value
    if not 0.0 < abs(command) <= 1.0:
        return f"a command of {command:g} must be within -1 ... 1 and not 0, a fraction of full thrust"
    if not (force := rov.force(axis, command)):
        dead = all("c_0" in rov.layout.curve_of[t.name].keys for t in rov.layout.drivers(axis))
        return f"a command of {command:g} gives no {axis.push}{', it is within the dead band' if dead else ''}"
    if point.quantity == "Tau":
        return None if 0.0 < value < inf else f"Tau = {value:g} s must be above 0"
    if not 0.0 < abs(value) < inf:
        return f"V_ss = {value:g} {axis.unit} must be a number other than 0"
    if (needed := holding_force(rov, axis, value)) * force > 0.0:
        return None
    form, words = rov.layout.kinds[axis.name], f"V_ss = {value:g} {axis.unit} needs a {axis.push} of {needed:g}"
    drift = rov.acceleration_of(form, 0.0).steady_velocity()
    alone = f"; F_0 alone gives {drift:g} {axis.unit}" if "F_0" in form.keys else ""
    return f"{words} {axis.load}, but a command of {command:g} gives {force:g} {axis.load}{alone}"


def _with(rov: Rov, name: str, wanted: Sequence[float]) -> Rov:
    """With the median of the wanted values of a coefficient, each of which must be one that it may have."""
    maximum = kind_of(name).maximum
    for value in wanted:
        if not 0.0 < value <= maximum:
            raise TuningError(f"{name} = {value:g} would do it: must be above 0 and at most {maximum:g}")
    return rov.replaced({name: float(np.median(wanted))})
