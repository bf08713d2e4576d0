"""What the recordings of an axis tell: coefficients with their uncertainty, and what else acts."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.extras import EffectKind, Extra
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.response_fit import response_band
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis, Simulation
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import is_factor, quantile

_DISAGREEMENT = 3.0
"""Times a standard error: three recordings of what the model has differ by more once in 10,000 cases."""


@dataclass(frozen=True)
class Effect:
    """Something beside thrust, drag and β that acts in the recordings, or was looked for in vain."""

    kind: EffectKind
    of: str
    """An axis, one recording by its file, or a curve."""
    unit: str
    value: float
    interval: tuple[float, float] | None
    """95 %; None where it cannot be told."""
    kept: bool
    """Whether it earns its place in the fit; if not, it is as if it were not there."""


@dataclass(frozen=True, eq=False)
class RecordingsFit:
    """What the recordings of one axis tell."""

    axis: Axis
    rov: Rov
    """With the coefficients that were found, and those that came with them: F_0, T, reverse."""
    together: Estimate
    """Of all that the axes recorded have, and their thrust curves; those standard errors are not widened."""
    estimate: Estimate
    """Of what concerns this axis."""
    simulations: tuple[Simulation, ...]
    effects: tuple[Effect, ...]
    hold_out: Callable[[], HeldOut] = field(repr=False)
    disagreement: Mapping[str, float] = field(default_factory=dict)
    """By how much standard errors were widened, since the recordings disagree: see `spread`."""

    @cached_property
    def held_out(self) -> HeldOut:
        """Each recording predicted by the others; takes its time when it is first asked for. Raises MotionError."""
        return self.hold_out()

    def spread(self) -> dict[str, float]:
        """How far the recordings disagree on a coefficient: its jackknife standard error by that of the fit.

        Of those that differ by more than chance explains; there must be three recordings. Raises MotionError.
        """
        found, n = {}, len(self.held_out.predictions)
        if n < 3 or self.held_out.by_halves:
            return {}
        for name, error in self.estimate.errors.items():
            each = np.array([p.coefficients[name] for p in self.held_out.predictions if name in p.coefficients])
            if len(each) == n and error > 0.0:
                ratio = float(np.sqrt((n - 1.0) / n * np.sum((each - each.mean()) ** 2))) / error
                if ratio > _DISAGREEMENT:
                    found[name] = ratio
        return found

    def delay_of(self, file: str) -> float:
        """By how much the commands of a recording act late, s."""
        late = (e.value for e in self.effects if e.kept and e.kind == "delay" and e.of in (self.axis.name, file))
        return sum(late)

    def widened(self) -> "RecordingsFit":
        """With standard errors as large as the recordings disagree. Raises MotionError."""
        by = self.spread()
        factors = np.array([by.get(name, 1.0) for name in self.estimate.names])
        wide = replace(self.estimate, covariance=self.estimate.covariance * np.outer(factors, factors))
        other = replace(self, estimate=wide, disagreement=by)
        other.__dict__["held_out"] = self.held_out  # it took its time
        return other

    @property
    def method(self) -> str:
        """In words."""
        return f"output error over {count(len(self.simulations), 'recording')}"

    def band(self, commands: Array) -> tuple[Array, Array, Array, Array]:
        """95 % confidence band of the curves over commands: V_ss low and high, Tau low and high."""
        return response_band(self.axis, self.rov, self.estimate, commands)


def estimate_of(analysis: ResidualAnalysis) -> Estimate:
    """Of the coefficients of the vehicle, those that come with extras among them."""
    model = analysis.model
    rov, p = model.rov(analysis.x), len(model.names)
    slopes: dict[str, Array] = {}
    for n, name in enumerate(model.names):
        slopes[name] = np.zeros(len(analysis.x))
        slopes[name][n] = rov[name] if is_factor(name) else 1.0
    for n, (extra, value) in enumerate(model.extra_values(analysis.x).items(), p):
        for name in extra.coefficients(rov, value):
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
    """The part of the coefficients that concern an axis."""
    form = rov.layout.kinds[axis.name]
    concerned = {form.coefficient(key) for key in (*form.keys, "beta")}
    concerned |= {c.coefficient(key) for c in curves_of(rov.layout, axis) for key in c.keys}
    return together.part([name for name in together.names if name in concerned])


def effects_of(analysis: ResidualAnalysis, kept: Collection[Extra]) -> dict[Extra, Effect]:
    """Each extra of a fit with its 95 % interval, and whether it is among those kept."""
    model, found, reach = analysis.model, analysis.covariance(), quantile(max(analysis.degrees_of_freedom, 1.0))
    effects = {}
    for n, (extra, value) in enumerate(model.extra_values(analysis.x).items(), len(model.names)):
        half = reach * float(np.sqrt(found[n, n]))
        axis = next((d.axis for d in model.data if extra.concerns(d.recording)), model.data[0].axis)
        interval = (value - half, value + half) if np.isfinite(half) else None
        effects[extra] = Effect(extra.kind, extra.of, extra.unit(axis), value, interval, extra in kept)
    return effects


def count(n: int, what: str) -> str:
    """1 force, 2 forces."""
    many = f"{what.removesuffix('y')}ies" if what.endswith("y") else f"{what}s"
    return f"{n} {what if n == 1 else many}"
