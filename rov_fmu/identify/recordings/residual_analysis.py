"""Noise, correlation and outliers of a solution's residuals, and the uncertainty of the parameters that follows."""

from dataclasses import dataclass

import numpy as np

from rov_fmu.identify.effects.extras import Extra
from rov_fmu.identify.least_squares import Solution, covariance
from rov_fmu.identify.points.step_responses import correlation_time
from rov_fmu.identify.recordings.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.recordings.simulator import HUBER, Simulator
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import robust_deviation

_COLOURED = 2.0  # samples of correlation; below, a fit takes nothing to speak of from the noise


@dataclass(frozen=True, eq=False)
class Simulation:
    """A recording beside the fitted model; arrays over the measured samples, SI units."""

    recording: Recording
    time: Array
    measured: Array
    modelled: Array
    velocity: Array
    """Of the model, through the water."""
    noise: float
    """Standard deviation of the residuals, robust."""
    correlation_time: float
    """Of the noise, in samples; 1 where it is white."""
    outliers: int
    """Samples farther off than 2.5 standard deviations, which count less than their square."""

    @property
    def residuals(self) -> Array:
        """Measured less modelled."""
        return self.measured - self.modelled


class ResidualAnalysis:
    """Of a solution of a simulator's recordings."""

    def __init__(self, model: Simulator, solution: Solution, *, robust: bool) -> None:
        self.x, self.model = solution.x, model
        r, J = solution.residuals, solution.jacobian
        inside = np.abs(r) <= HUBER if robust else np.ones(len(r), bool)
        psi = np.clip(r, -HUBER, HUBER) if robust else r
        self.simulations: list[Simulation] = []
        self.degrees_of_freedom = float(len(model.thrust.names) if model.thrust else 0) - len(self.x)
        excess = len(r) / (len(r) - len(self.x))
        rest = slice(sum(len(d.time) for d in model.data), None)  # the thrust curve and what extras are likely to be
        self.gram, self.meat = (J * inside[:, None]).T @ J, J[rest].T @ J[rest]
        size = np.abs(r)
        losses = np.where(inside, r * r, (2.0 * size - HUBER) * HUBER)
        cost: list[float] = []
        for output, (d, rows, _, sigma) in zip(model.run(self.x), model.places, strict=True):
            variance = excess * float(np.mean(psi[rows] ** 2))
            correlation = correlation_time(psi[rows])
            part, weights = J[rows], np.full(len(d.time), correlation * variance)
            if correlation > _COLOURED:
                spectrum = noise_spectrum(psi[rows], part * inside[rows, None])
                if spectrum is not None:
                    part, weights, correlation = cosines(part), spectrum, max(float(spectrum[0]) / variance, 1.0)
            self.meat += part.T @ (part * weights[:, None])
            cost.append(float(losses[rows].sum()))
            self.degrees_of_freedom += len(d.time) / correlation
            outliers, noise = int((np.abs(r[rows]) > HUBER).sum()), sigma * robust_deviation(r[rows])
            self.simulations.append(
                Simulation(d.recording, d.time, d.values, output.values, output.velocity, noise, correlation, outliers)
            )
        self.cost = np.array(cost)
        """Of each recording: the sum of what is minimized."""

    def gain(self, other: "ResidualAnalysis") -> float:
        """By how much the cost is lower than another model's, correlated residuals counting as so many fewer.

        How far they are correlated is told by this model, the larger one: misfit makes another's more so.
        """
        correlation = np.array([s.correlation_time for s in self.simulations])
        return float(np.sum((other.cost - self.cost) / correlation))

    def significance(self, extra: Extra) -> float:
        """Wald's statistic: about what the cost would rise by without it."""
        n = len(self.model.names) + self.model.extras.index(extra)
        return float((self.x[n] - extra.neutral) ** 2 / self.covariance()[n, n])

    def covariance(self) -> Array:
        """Of the parameters of a robust fit; correlated residuals count as so many fewer."""
        return covariance(self.gram, self.meat)
