"""Drag and β from whole recordings: the simulated output against the measured one (output error).

What the sensor measures is fitted, depth or heading and not its derivative, so white noise of the sensor stays white.
Commands and motion tell A, B and C of v' = C - B v - A |v| v: with thrust, inertia and α given, a_d, b_d and β. Motion
under many commands tells the shape of the thrust curve too, so a curve from tests takes part, as uncertain as they left
it; then all axes that the thruster drives are fitted at once. Each recording adds its first velocity and position.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import t as student

from rov_fmu.identify.least_squares import (
    LEVEL,
    Array,
    Estimate,
    Solution,
    bounds,
    covariance,
    estimate,
    external,
    internal,
    minimize,
)
from rov_fmu.identify.response_fit import response_band
from rov_fmu.identify.simulator import Prepared, Simulator, prepare
from rov_fmu.identify.step_responses import correlation_time, spread, white_noise
from rov_fmu.identify.tank_tests import Recording
from rov_fmu.motion.rov import Axis, Coefficients

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
class Suspicion:
    """A cause that the model leaves out, estimated to first order beside the fit: value and 95 % interval."""

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
    coefficients: Coefficients
    estimate: Estimate
    simulations: tuple[Simulation, ...]
    load: Suspicion
    """A constant force (N) or torque (N.m) beside thrust and drag: ballast, tether."""
    delay: Suspicion
    """Time (s) from the command to the thrust, or by which the clocks differ."""

    def band(self, commands: Array) -> tuple[Array, Array, Array, Array]:
        """95 % confidence band of the curves over commands: V_ss low and high, Tau low and high."""
        return response_band(self.axis, self.coefficients, self.estimate, commands)


def fit_recordings(
    recordings: Sequence[Recording],
    base: Coefficients,
    known: Collection[str] = (),
    thrust: Estimate | None = None,
    loss: Loss = "huber",
) -> tuple[RecordingsFit, ...]:
    """Fit what is not known of a_d, b_d and β of every axis recorded; `base` holds the rest, α included.

    `thrust` is the estimate of a_t and b_t by tests, where they are not known; all recordings must be of its thruster.
    The intervals count the correlation that the residuals have beyond white noise.
    """
    axes = list(dict.fromkeys(r.axis.name for r in recordings))
    data = tuple(prepare(r, base) for axis in axes for r in recordings if r.axis.name == axis)
    parts = [_alone(tuple(d for d in data if d.axis.name == axis), base, known, loss) for axis in axes]
    values = dict(thrust.named if thrust else {})
    for simulator, x in parts:
        values |= external(simulator.names, x)
    model = Simulator(data, base, tuple(values), thrust)
    x = np.concatenate([internal(model.names, values), *(x[len(s.names) :] for s, x in parts)])
    sigma = np.concatenate([_noise(simulator, x) for simulator, x in parts])
    ends = _Ends(model, _solve(model, x, sigma, loss), sigma, loss)
    coefficients = replace(base, **external(model.names, ends.x))
    whole = estimate(model.names, ends.x, ends.covariance(), ends.freedom, 1.0)
    found = []
    for axis in axes:
        m = next(d.axis for d in data if d.axis.name == axis)
        names = [n for n in model.names if n in m.thrust_names or n.endswith(f"_{m.velocity}")]
        simulations = tuple(s for s in ends.simulations if s.recording.axis.name == axis)
        load, delay = ends.suspicion(model.by_load(m, ends.x, sigma)), ends.suspicion(ends.by_delay(m))
        found.append(RecordingsFit(m, coefficients, whole.of(names), simulations, load, delay))
    return tuple(found)


def _alone(
    data: tuple[Prepared, ...], base: Coefficients, known: Collection[str], loss: Loss
) -> tuple[Simulator, Array]:
    """One axis, thrust as it is, from a part of the samples: enough to come near, and fast."""
    m = data[0].axis
    names = tuple(n for kind in ("a_d", "b_d", "beta") if (n := m.coefficient(kind)) not in known)
    thin = Simulator(tuple(d.thinned() for d in data), base, names)
    sigma = np.array([max(white_noise(d.values), _least_noise(d.values)) for d in data])
    starts = (thin.start(beta) for beta in _BETAS)
    start = min(starts, key=lambda x: float(np.sum(np.sqrt(1.0 + thin.residuals(x, sigma) ** 2))))
    return Simulator(data, base, names), _solve(thin, start, sigma, "soft_l1" if loss == "huber" else loss).x


def _noise(simulator: Simulator, x: Array) -> Array:
    """Standard deviation of every recording's residuals, robust."""
    left = simulator.split(simulator.residuals(x, np.ones(len(simulator.data))))
    return np.array([max(spread(r), _least_noise(d.values)) for r, d in zip(left, simulator.data, strict=True)])


def _least_noise(values: Array) -> float:
    return max(1e-6 * float(np.ptp(values)), 1e-12)


def _solve(model: Simulator, start: Array, sigma: Array, loss: Literal["soft_l1", "huber", "linear"]) -> Solution:
    return minimize(
        lambda x: model.residuals(x, sigma),
        start,
        bounds(model.names, sum(d.own for d in model.data)),
        jacobian=lambda x: model.jacobian(x, sigma),
        loss=loss,
        threshold=_HUBER if loss == "huber" else 1.0,
    )


class _Ends:
    """What the solution leaves over, and what follows from it."""

    def __init__(self, model: Simulator, solution: Solution, sigma: Array, loss: Loss) -> None:
        self.x, self._jacobian, self._sigma = solution.x, solution.jacobian, sigma
        r = solution.residuals
        self._inside = np.abs(r) <= _HUBER if loss == "huber" else np.ones(len(r), bool)
        self._psi = np.where(self._inside, r, _HUBER * np.sign(r))
        self._variance = np.ones(len(r))  # of each psi, correlation counted; of the thrust curve it is 1
        simulations, row = [], 0
        excess = len(r) / (len(r) - len(solution.x))
        for d, own, s in zip(model.data, model.own(solution.x), sigma.tolist(), strict=True):
            rows = slice(row, row + len(d.time))
            left, correlation = r[rows], correlation_time(self._psi[rows])
            self._variance[rows] = correlation * excess * np.mean(self._psi[rows] ** 2)
            outliers = int((np.abs(left) > _HUBER).sum())
            run = model.run(d, solution.x, own)
            simulations.append(Simulation(d.recording, d.time, d.values, *run, s * spread(left), correlation, outliers))
            row = rows.stop
        self.simulations = tuple(simulations)
        self.freedom = sum(len(s.time) / s.correlation_time for s in simulations) + len(r) - row - len(solution.x)

    def covariance(self, jacobian: Array | None = None) -> Array:
        """Of the parameters of a robust fit; correlated residuals count as so many fewer."""
        J = self._jacobian if jacobian is None else jacobian
        return covariance(*((J * weights[:, None]).T @ J for weights in (self._inside, self._variance)))

    def by_delay(self, m: Axis) -> Array:
        """Derivative of the residuals by a delay on an axis."""
        column, row = np.zeros(len(self._psi)), 0
        for s, sigma in zip(self.simulations, self._sigma.tolist(), strict=True):
            rows = slice(row, row + len(s.time))
            if s.recording.axis is m:
                column[rows] = -(s.velocity if s.recording.is_position else s.acceleration) / sigma
            row = rows.stop
        return column

    def suspicion(self, column: Array) -> Suspicion:
        """One Gauss-Newton step with one more parameter, from the solution."""
        J = np.column_stack([self._jacobian, column])
        gram = (J * self._inside[:, None]).T @ J
        value = -float(np.linalg.lstsq(gram, J.T @ self._psi, rcond=None)[0][-1])
        error = float(np.sqrt(self.covariance(J)[-1, -1]))
        reach = float(student.ppf(0.5 + 0.5 * LEVEL, max(self.freedom, 1.0))) * error
        return Suspicion(value, (value - reach, value + reach))
