"""Noise, correlation and outliers of the residuals, and the resulting uncertainty of the parameters."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import robust_deviation
from rov_fmu.identify.effects.effect import Effect
from rov_fmu.identify.least_squares import Solution, covariance
from rov_fmu.identify.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.points.step_responses import correlation_time
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.identify.simulation.solver import HUBER
from rov_fmu.tank.arrays import Array

_LEAST_FREEDOM = 8.0
"""The least number of degrees of freedom, unless the samples are fewer: the spectrum of slow noise has more."""
_COLOURED = 2.0
"""If the correlation time in samples is longer, the fit absorbs a relevant part of the noise."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """A recording and the fitted model of it; arrays over the measured samples, SI units."""

    recording: Recording
    time: Array
    measured: Array
    modelled: Array
    velocity: Array
    """The velocity of the model through the water."""
    noise: float
    """The robust standard deviation of the residuals."""
    correlation_time: float
    """The correlation time of the noise in samples; 1 for white noise."""
    outliers: int
    """The number of samples beyond 2.5 of these standard deviations. They count less than their square."""

    @property
    def residuals(self) -> Array:
        """The measured less the modelled values."""
        return self.measured - self.modelled


def _variances(residuals: Array, rates: Array) -> Array:
    """Return the variances of n residuals, for values that change at some rates.

    Errors of the time stamps are errors of the values in proportion to their rates of change, so the variance is
    a + b rate², with a and b >= 0 by least squares.
    """
    squares = residuals * residuals
    regressors = np.column_stack([np.ones(len(rates)), rates * rates])
    regressors /= np.maximum(regressors.max(axis=0), 1e-300)
    found, _ = nnls(regressors, squares)
    return np.asarray(regressors @ found)


class ResidualAnalysis:
    """The analysis of the residuals of a fit to recordings."""

    def __init__(self, model: Simulator, solution: Solution, *, robust: bool) -> None:
        self.x, self.model = solution.x, model
        self.solution, self.robust = solution, robust
        r, J = solution.residuals, solution.jacobian
        inside = np.abs(r) <= HUBER if robust else np.ones(len(r), bool)
        psi = np.clip(r, -HUBER, HUBER) if robust else r
        self.simulations: list[Simulation] = []
        self.degrees_of_freedom = float(model.count_of_tables - len(self.x))
        excess = len(r) / (len(r) - len(self.x))
        rest = slice(model.rows[-1].stop, None)  # tables and priors
        self.gram, self.meat = (J * inside[:, None]).T @ J, J[rest].T @ J[rest]
        size = np.abs(r)
        losses = np.where(inside, r * r, (2.0 * size - HUBER) * HUBER)
        cost: list[float] = []
        outputs = model.run(self.x)
        for pieces in model.recordings:
            d, sigma = model.data[pieces[0]], float(model.sigma[pieces[0]])
            rows = slice(model.rows[pieces[0]].start, model.rows[pieces[-1]].stop)
            time, measured = (
                np.concatenate([getattr(model.data[n], key) for n in pieces]) for key in ("time", "values")
            )
            modelled, velocity = (
                np.concatenate([getattr(outputs[n], key) for n in pieces]) for key in ("values", "velocity")
            )
            variance = excess * float(np.mean(psi[rows] ** 2))
            correlation = correlation_time(psi[rows])
            part, weights = J[rows], correlation * excess * _variances(psi[rows], np.gradient(modelled, time))
            if correlation > _COLOURED:
                spectrum = noise_spectrum(psi[rows], part * inside[rows, None])
                if spectrum is not None:
                    part, weights, correlation = cosines(part), spectrum, max(float(spectrum[0]) / variance, 1.0)
            self.meat += part.T @ (part * weights[:, None])
            cost.append(float(losses[rows].sum()))
            self.degrees_of_freedom += len(time) / correlation
            # `sigma` leaves out slow noise and uncertain switches, which the deviation of the residuals contains
            deviation = robust_deviation(r[rows])
            outliers = int((np.abs(r[rows]) > HUBER * max(deviation, 1.0)).sum())
            self.simulations.append(
                Simulation(d.recording, time, measured, modelled, velocity, sigma * deviation, correlation, outliers)
            )
        samples = len(r) - len(self.x)
        self.degrees_of_freedom = max(self.degrees_of_freedom, min(_LEAST_FREEDOM, samples))
        self.cost = np.array(cost)
        """The contribution of each recording to the cost."""

    def gain(self, other: "ResidualAnalysis") -> float:
        """Return the reduction of the cost relative to another model, for the number of independent residuals.

        The correlation is that of this model, the larger one, because misfit increases it.
        """
        correlation = np.array([s.correlation_time for s in self.simulations])
        return float(np.sum((other.cost - self.cost) / correlation))

    def significance(self, extra: Effect) -> float:
        """Return Wald's statistic: approximately the increase of the cost if the effect is left out."""
        n = len(self.model.names) + self.model.extras.index(extra)
        return float((self.x[n] - extra.neutral) ** 2 / self.covariance()[n, n])

    def covariance(self) -> Array:
        """Return the covariance of the parameters of a robust fit, increased for correlated residuals."""
        return covariance(self.gram, self.meat)
