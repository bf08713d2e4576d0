"""The tuning guide of section 5 in closed form: α for the wanted V_ss, then β for the wanted Tau, (17), (18).

It holds for any vehicle and axis, with thrust and drag by direction, dead band and constant load.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path

import numpy as np

from rov_fmu.identify.least_squares import Estimate, estimate_alike, fit_named, kind_of
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.response_fit import holding_force, predict
from rov_fmu.identify.slips.search import beta_range
from rov_fmu.io.csv_table import DataFileError, read_columns
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import columns_of, refuse_slips
from rov_fmu.tank.findings import Finding

ALPHA = 0.5, 2.0
"""The range of a plausible α. Thrust that is measured in a tank is known to better than a factor of 2; the paper has α
of 1.1 to 1.2."""


class TuningError(ValueError):
    """No tuning gives the wanted response. The message is one line."""


@dataclass(frozen=True)
class Tuning:
    """A vehicle with the α and β of one axis that give the wanted points."""

    axis: Axis
    rov: Rov
    points: tuple[Point, ...]
    estimate: Estimate | None = None
    """The estimate, where α and β are fitted to many points."""

    @property
    def model(self) -> Array:
        """V_ss or Tau of the tuned vehicle at every point."""
        return predict(self.axis, self.rov, self.points)


def tune(rov: Rov, axis: Axis, command: float, V_ss: float, Tau: float | None = None) -> Tuning:
    """Find α and β for V_ss (m/s, rad/s) and Tau (s) at one command; without Tau, β stays. Raises TuningError."""
    wanted = {"V_ss": V_ss} if Tau is None else {"V_ss": V_ss, "Tau": Tau}
    points = tuple(Point(quantity, command, value, 1.0, "") for quantity, value in wanted.items())
    return Tuning(axis, _each_median(rov, axis, points), points)


def tune_over(rov: Rov, axis: Axis, points: Sequence[Point]) -> Tuning:
    """Fit α and β to the relative errors of many V_ss and Tau, without changing the drag.

    Without any Tau, β stays. Raises TuningError.
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
    """Take the median of the α that give each V_ss, then of the β that give each Tau. Raises TuningError.

    Tau is inversely proportional to β.
    """
    if rov.loss(axis, rov.held_inputs(axis, 1.0)):
        raise TuningError(
            f"{axis.name}: its thrust decreases with the speed of advance. Tuning cannot take this into "
            "account: remove d"
        )
    for p in points:
        if reason := _impossible(rov, axis, p):
            raise TuningError(f"{axis.name}: {reason}")
    steady = [p for p in points if p.quantity == "V_ss"]
    if not steady:
        raise TuningError(f"{axis.name}: there is no V_ss, and alpha is tuned to V_ss")
    alphas = [holding_force(rov, axis, p.value) / rov.force(axis, p.command) for p in steady]
    tuned, beta = _with(rov, axis.coefficient("alpha"), alphas), axis.coefficient("beta")
    plain = tuned.replaced({beta: 1.0})
    betas = [plain.response(axis, p.command)[1] / p.value for p in points if p.quantity == "Tau"]
    return _with(tuned, beta, [float(np.median(betas))]) if betas else tuned


def tuned_values(tuning: Tuning) -> tuple[dict[str, float], str]:
    """Return α and β by name, and a phrase about the points that they are tuned to."""
    names = [tuning.axis.coefficient(kind) for kind in ("alpha", "beta")]
    wanted = ", ".join(f"{p.quantity} = {p.value:g} at {p.command:.0%}" for p in tuning.points[:2])
    reason = f"Tuned to {wanted}{', ...' if len(tuning.points) > 2 else ''}"
    return {name: tuning.rov[name] for name in names}, reason


def read_points(path: Path, rov: Rov, axis: Axis) -> tuple[Point, ...]:
    """Read wanted points from a CSV file with command, velocity and time constant, which may have blanks.

    Raises DataFileError.
    """
    columns = columns_of("steady", axis) | columns_of("time_constant")
    optional = {name: replace(column, optional=True, blanks=True) for name, column in columns.items()}
    table = read_columns(path, optional | {"command": columns["command"]})
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
    if not any(point.quantity == "V_ss" for point in points):
        raise DataFileError(f"{path}: no row has a velocity, and alpha is tuned to velocities")
    return tuple(points)


def implausible(tuning: Tuning) -> Iterator[Finding]:
    """Yield a finding about an implausible α, and one about an implausible β."""
    axis, rov = tuning.axis, tuning.rov
    alpha, beta = map(axis.coefficient, ("alpha", "beta"))
    if not ALPHA[0] <= rov[alpha] <= ALPHA[1]:
        names = {"alpha": alpha, "push": axis.push, "unit": axis.unit}
        numbers = {"value": rov[alpha], "low": ALPHA[0], "high": ALPHA[1]}
        yield Finding("implausible tuned alpha", axis=axis.name, names=names, numbers=numbers)
    low, high, inertia = beta_range(rov, axis)
    if any(p.quantity == "Tau" for p in tuning.points) and not low <= rov[beta] <= high:
        names = {"beta": beta, "inertia": inertia, "mass": axis.inertia}
        numbers = {"value": rov[beta], "low": low, "high": high}
        yield Finding("implausible tuned beta", axis=axis.name, names=names, numbers=numbers)


def _impossible(rov: Rov, axis: Axis, point: Point) -> str | None:
    """Return the reason why no tuning gives the point, or None."""
    command, value = point.command, point.value
    if not 0.0 < abs(command) <= 1.0:
        return (
            f"a command of {command:g} must be within -1 ... 1 and not 0, a fraction of the full command: 30 % is 0.3"
        )
    if not (force := rov.force(axis, command)):
        dead = all("c_0" in rov.layout.curve_of[t.name].keys for t in rov.layout.drivers(axis))
        return f"a command of {command:g} gives no {axis.push}{', it is within the dead band' if dead else ''}"
    if point.quantity == "Tau":
        return None if 0.0 < value < inf else f"Tau = {value:g} s must be above 0"
    if not 0.0 < abs(value) < inf:
        return f"V_ss = {value:g} {axis.unit} must be a number other than 0"
    if holding_force(rov, axis, value) * force > 0.0:
        return None
    form, allowed = rov.layout.kinds[axis.name], "positive" if force > 0.0 else "negative"
    if "F_0" in form.keys:
        drift = rov.acceleration_of(form, 0.0).steady_velocity()
        allowed = f"{'above' if force > 0.0 else 'below'} the {drift:g} {axis.unit} that F_0 alone gives"
    thrust = f"a command of {command:g} gives a {axis.push} of {force:g} {axis.load}"
    return f"V_ss = {value:g} {axis.unit} must be {allowed}, for {thrust}"


def _with(rov: Rov, name: str, wanted: Sequence[float]) -> Rov:
    """Set a coefficient to the median of the wanted values, each of which must be possible. Raises TuningError."""
    maximum = kind_of(name).maximum
    for value in wanted:
        if not 0.0 < value <= maximum:
            raise TuningError(f"{name} would have to be {value:g}, but it must be above 0 and at most {maximum:g}")
    return rov.replaced({name: float(np.median(wanted))})
