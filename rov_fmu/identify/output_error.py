"""Drag and β from whole recordings: the simulated output against the measured one (output error).

What the sensor measures is fitted, depth or heading and not its derivative, so white noise of the sensor stays white.
Commands and motion tell A, B and C of v' = C - B v - A |v| v: with thrust, inertia and α given, a_d, b_d and β. Motion
under many commands tells the shape of the thrust curve too, so a curve from tests takes part, as uncertain as they left
it; then all axes that the thruster drives are fitted at once. Each recording adds its first velocity and position.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rov_fmu.identify.least_squares import (
    Array,
    Estimate,
    Solution,
    bounds,
    covariance,
    estimate,
    external,
    internal,
    minimize,
    quantile,
)
from rov_fmu.identify.response_fit import drag_and_beta, response_band
from rov_fmu.identify.simulator import PreparedRecording, Simulator, prepare
from rov_fmu.identify.step_responses import correlation_time, robust_deviation, white_noise
from rov_fmu.identify.tank_tests import Recording, thrust_names
from rov_fmu.motion.layout import Axis
from rov_fmu.motion.rov import Rov

Loss = Literal["huber", "linear"]

_HUBER = 2.5  # residuals beyond so many standard deviations count by their size, not its square
_BETAS = (0.03, 0.1, 0.3, 1.0, 3.0)  # to begin with


@dataclass(frozen=True, eq=False)
class Simulation:
    """A recording beside the fitted model; arrays over the measured samples, SI units."""

    recording: Recording
    time: Array
    measured: Array
    modelled: Array
    velocity: Array
    """Of the model, and so is the acceleration."""
    acceleration: Array
    noise: float
    """Standard deviation of the residuals, robust."""
    correlation_time: float
    """Of the residuals, in samples; 1 where they are white."""
    outliers: int
    """Samples farther off than 2.5 standard deviations, which count less than their square."""

    @property
    def residuals(self) -> Array:
        """Measured less modelled."""
        return self.measured - self.modelled


@dataclass(frozen=True)
class UnmodelledEffect:
    """An effect that is not in the model, estimated to first order beside the fit: value and 95 % interval."""

    value: float
    interval: tuple[float, float]

    @property
    def is_significant(self) -> bool:
        """Whether the interval leaves zero out."""
        return self.interval[0] * self.interval[1] > 0.0


@dataclass(frozen=True, eq=False)
class RecordingsFit:
    """Drag and β of one axis from its recordings, and its thrust curve where that took part."""

    axis: Axis
    rov: Rov
    estimate: Estimate
    simulations: tuple[Simulation, ...]
    load: UnmodelledEffect
    """A constant force (N) or torque (N.m) beside thrust and drag: ballast, tether."""
    delay: UnmodelledEffect
    """Time (s) from the command to the thrust, or by which the clocks differ."""

    def band(self, commands: Array) -> tuple[Array, Array, Array, Array]:
        """95 % confidence band of the curves over commands: V_ss low and high, Tau low and high."""
        return response_band(self.axis, self.rov, self.estimate, commands)


def fit_recordings(
    recordings: Sequence[Recording],
    base: Rov,
    known: Collection[str] = (),
    thrust: Estimate | None = None,
    loss: Loss = "huber",
) -> tuple[RecordingsFit, ...]:
    """Fit what is not known of a_d, b_d and β of every axis recorded; `base` holds the rest, α included.

    `thrust` is the estimate of a_t and b_t by tests, where they are not known; all recordings must be of its thruster.
    The intervals count the correlation that the residuals have beyond white noise.
    """
    axes = list({r.axis.name: r.axis for r in recordings}.values())
    by_axis = [tuple(prepare(r, base) for r in recordings if r.axis is axis) for axis in axes]
    data = tuple(d for part in by_axis for d in part)
    parts = [_fit_alone(part, base, known, loss) for part in by_axis]
    values = dict(thrust.named if thrust else {})
    for found_alone, *_ in parts:
        values |= found_alone
    model = Simulator(data, base, tuple(values), np.array([s for *_, sigma in parts for s in sigma]), thrust)
    start = np.concatenate([internal(model.names, values), *(initial for _, initial, _ in parts)])
    analysis = _ResidualAnalysis(model, _solve(model, start, loss), loss)
    rov = base.replaced(external(model.names, analysis.x))
    whole = estimate(model.names, analysis.x, analysis.covariance(), analysis.degrees_of_freedom, 1.0)
    found = []
    for axis in axes:
        names = [n for n in model.names if n in thrust_names(axis) or n.endswith(f"_{axis.velocity}")]
        simulations = tuple(s for s in analysis.simulations if s.recording.axis is axis)
        columns = model.by_load(axis, analysis.x), analysis.by_delay(axis)
        effects = (analysis.unmodelled_effect(column) for column in columns)
        found.append(RecordingsFit(axis, rov, whole.part(names), simulations, *effects))
    return tuple(found)


def _fit_alone(
    data: tuple[PreparedRecording, ...], base: Rov, known: Collection[str], loss: Loss
) -> tuple[dict[str, float], Array, list[float]]:
    """One axis, thrust as it is, from a part of the samples: enough to come near, and fast.

    Coefficients, initial values of the recordings, and the standard deviation of each one's residuals, robust.
    """
    names = drag_and_beta(data[0].axis, known)
    sigma = np.array([_at_least(white_noise(d.values), d) for d in data])
    thin = Simulator(tuple(d.thinned() for d in data), base, names, sigma)
    starts = (thin.start(beta) for beta in _BETAS)
    start = min(starts, key=lambda x: float(np.sum(np.sqrt(1.0 + thin.residuals(x) ** 2))))
    x = _solve(thin, start, "soft_l1" if loss == "huber" else loss).x
    plain = Simulator(data, base, names, np.ones(len(data)))
    residuals = plain.residuals(x)
    noise = [_at_least(robust_deviation(residuals[rows]), d) for d, rows, *_ in plain.places]
    return external(names, x), x[len(names) :], noise


def _at_least(noise: float, data: PreparedRecording) -> float:
    return max(noise, 1e-6 * float(np.ptp(data.values)), 1e-12)


def _solve(model: Simulator, start: Array, loss: Literal["soft_l1", "huber", "linear"]) -> Solution:
    limits = bounds(model.names, len(start) - len(model.names))
    threshold = _HUBER if loss == "huber" else 1.0
    return minimize(model.residuals, start, limits, jacobian=model.jacobian, loss=loss, threshold=threshold)


class _ResidualAnalysis:
    """Noise, correlation and outliers of a solution's residuals, and the uncertainty that follows from them."""

    def __init__(self, model: Simulator, solution: Solution, loss: Loss) -> None:
        self.x, self._jacobian, self._model = solution.x, solution.jacobian, model
        r = solution.residuals
        self._inside = np.abs(r) <= _HUBER if loss == "huber" else np.ones(len(r), bool)
        self._psi = np.clip(r, -_HUBER, _HUBER) if loss == "huber" else r
        self._variance = np.ones(len(r))  # of each psi, correlation counted; of the thrust curve it is 1
        self.simulations: list[Simulation] = []
        self.degrees_of_freedom = 2.0 * bool(model.thrust) - len(self.x)
        excess = len(r) / (len(r) - len(self.x))
        for d, rows, initial, sigma in model.places:
            correlation = correlation_time(self._psi[rows])
            self._variance[rows] = correlation * excess * np.mean(self._psi[rows] ** 2)
            self.degrees_of_freedom += len(d.time) / correlation
            run, noise = model.run(d, self.x, self.x[initial]), sigma * robust_deviation(r[rows])
            outliers = int((np.abs(r[rows]) > _HUBER).sum())
            self.simulations.append(Simulation(d.recording, d.time, d.values, *run, noise, correlation, outliers))

    def covariance(self, jacobian: Array | None = None) -> Array:
        """Of the parameters of a robust fit; correlated residuals count as so many fewer."""
        J = self._jacobian if jacobian is None else jacobian
        return covariance(*((J * weights[:, None]).T @ J for weights in (self._inside, self._variance)))

    def by_delay(self, axis: Axis) -> Array:
        """Derivative of the residuals by a delay on an axis."""
        column = np.zeros(len(self._psi))
        for s, (d, rows, _, sigma) in zip(self.simulations, self._model.places, strict=True):
            if d.axis is axis:
                column[rows] = -(s.velocity if d.recording.is_position else s.acceleration) / sigma
        return column

    def unmodelled_effect(self, column: Array) -> UnmodelledEffect:
        """One Gauss-Newton step with one more parameter, from the solution."""
        J = np.column_stack([self._jacobian, column])
        gram = (J * self._inside[:, None]).T @ J
        value = -float(np.linalg.lstsq(gram, J.T @ self._psi, rcond=None)[0][-1])
        reach = quantile(max(self.degrees_of_freedom, 1.0)) * float(np.sqrt(self.covariance(J)[-1, -1]))
        return UnmodelledEffect(value, (value - reach, value + reach))
