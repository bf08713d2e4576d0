"""The fit to the recordings of an axis: coefficients with their uncertainty, and other effects."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.effect import Effect, axis_of
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.response_fit import response_band
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis, Simulation
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import is_factor, quantile

_DISAGREEMENT = 3.0
"""The ratio of `spread` that counts as disagreement. If the model holds, three recordings differ by more once
in 10,000 cases."""


@dataclass(frozen=True)
class FittedEffect:
    """An effect in addition to thrust, drag and β that was fitted to the recordings, whether or not it is kept."""

    kind: str
    of: str
    """An axis, one recording by its file, or a curve."""
    unit: str
    value: float
    interval: tuple[float, float] | None
    """The 95 % interval; None where it is not finite, or is beyond both limits of the search."""
    kept: bool
    """True when the data justify the effect; otherwise the fit is without it."""
    axis: str = ""
    """The axis of the recording, for an effect of one recording along one axis."""


@dataclass(frozen=True, eq=False)
class RecordingsFit:
    """The fit to the recordings of one axis."""

    axis: Axis
    rov: Rov
    """The vehicle with the fitted coefficients, including those of effects: F_0, T, reverse."""
    together: Estimate
    """The estimate of all axes that were fitted at once and their thrust curves; its errors are not widened."""
    estimate: Estimate
    """The estimate of the coefficients of this axis."""
    simulations: tuple[Simulation, ...]
    effects: tuple[FittedEffect, ...]
    hold_out: Callable[[], HeldOut] = field(repr=False)
    points: int = 0
    """The number of points of tables that took part."""
    between_rows: bool = False
    """True when the commands were found to switch between the rows of the logs, at unknown times."""
    disagreement: Mapping[str, float] = field(default_factory=dict)
    """The factors by which standard errors were widened because the recordings disagree, see `spread`."""

    @cached_property
    def held_out(self) -> HeldOut:
        """The prediction of each recording by the others, computed at the first use. Raises MotionError."""
        return self.hold_out()

    def spread(self) -> dict[str, float]:
        """Return, for each coefficient, the ratio of the differences between fits to their expected standard deviation.

        Each fit to the other recordings is compared with the fit to all. The variance of this difference is that of the
        former estimate less that of the latter, because the latter is efficient (Hausman 1978). Only ratios that chance
        does not explain are returned, and none for less than three recordings. Raises MotionError.
        """
        found, n = {}, len(self.held_out.predictions)
        if n < 3 or self.held_out.by_halves:
            return {}
        for name, error in self.estimate.errors.items():
            squares = [
                (p.coefficients[name] - self.rov[name]) ** 2
                / max(p.errors_of_fit.get(name, 0.0) ** 2 - error**2, error**2 / (n - 1.0))
                for p in self.held_out.predictions
                if name in p.coefficients and error > 0.0
            ]
            if len(squares) == n and (ratio := float(np.sqrt(np.mean(squares)))) > _DISAGREEMENT:
                found[name] = ratio
        return found

    def delay_of(self, file: str) -> float:
        """Return the delay from the commands of a recording to the motion, s."""
        delays = (e.value for e in self.effects if e.kept and e.kind == "delay" and e.of in (self.axis.name, file))
        return sum(delays)

    def widened(self) -> "RecordingsFit":
        """Increase the standard errors to the disagreement of the recordings. Raises MotionError."""
        spread = self.spread()
        factors = np.array([spread.get(name, 1.0) for name in self.estimate.names])
        wide = replace(self.estimate, covariance=self.estimate.covariance * np.outer(factors, factors))
        held_out = self.held_out  # is slow, so the copy must not compute it again
        return replace(self, estimate=wide, disagreement=spread, hold_out=lambda: held_out)

    @property
    def method(self) -> str:
        """A phrase about the method."""
        points = f" and {count(self.points, 'point')}" if self.points else ""
        return f"output error over {count(len(self.simulations), 'recording')}{points}"

    def band(self, commands: Array) -> tuple[Array, Array, Array, Array]:
        """Return the 95 % confidence band over commands: V_ss low and high, Tau low and high."""
        return response_band(self.axis, self.rov, self.estimate, commands)


def estimate_of(analysis: ResidualAnalysis) -> Estimate:
    """Return the estimate of the vehicle's coefficients, including those that extras set."""
    model = analysis.model
    rov, p = model.rov(analysis.x), len(model.names)
    slopes: dict[str, Array] = {}
    for n, name in enumerate(model.names):
        slopes[name] = np.zeros(len(analysis.x))
        slopes[name][n] = rov[name] if is_factor(name) else 1.0
    for n, (extra, value) in enumerate(model.extra_values(analysis.x).items(), p):
        for name in extra.coefficients(rov.coefficients, value):
            slopes[name] = np.zeros(len(analysis.x))
            forward = dict(extra.pairs()).get(name)
            slopes[name][n] = rov[forward] if forward else 1.0
            if forward in model.names:
                slopes[name] += value * slopes[forward]
    names = tuple(slopes)
    M = np.array([slopes[name] for name in names])
    found = analysis.covariance()
    vague = ~np.isfinite(np.diag(found))
    of = M @ np.where(np.isfinite(found), found, 0.0) @ M.T
    of[np.diag_indices(len(names))] += np.where((M[:, vague] != 0.0).any(axis=1), np.inf, 0.0)
    return Estimate(names, np.array([rov[name] for name in names]), of, analysis.degrees_of_freedom, 1.0)


def part_of(together: Estimate, axis: Axis, rov: Rov) -> Estimate:
    """Return the estimate of the coefficients of an axis and its thrust curves."""
    form = rov.layout.kinds[axis.name]
    concerned = {form.coefficient(key) for key in (*form.keys, "beta")}
    concerned |= {c.coefficient(key) for c in curves_of(rov.layout, axis) for key in c.keys}
    return together.part([name for name in together.names if name in concerned])


def effects_of(analysis: ResidualAnalysis, kept: Collection[Effect]) -> dict[Effect, FittedEffect]:
    """Return the fitted effects with their 95 % intervals."""
    model, found, reach = analysis.model, analysis.covariance(), quantile(max(analysis.degrees_of_freedom, 1.0))
    effects, recordings = {}, [d.recording for d in model.data]
    for n, (extra, value) in enumerate(model.extra_values(analysis.x).items(), len(model.names)):
        half = reach * float(np.sqrt(found[n, n]))
        axis = axis_of(extra, recordings)
        low, high = extra.limits
        is_known = np.isfinite(half) and not (value - half < low and high < value + half)
        interval = (value - half, value + half) if is_known else None
        effects[extra] = FittedEffect(
            extra.kind, extra.of, extra.unit(axis), value, interval, extra in kept, extra.axis
        )
    return effects


def count(n: int, what: str) -> str:
    """Return a count with its noun, such as "1 force" or "2 forces"."""
    many = f"{what.removesuffix('y')}ies" if what.endswith("y") else f"{what}s"
    return f"{n} {what if n == 1 else many}"
