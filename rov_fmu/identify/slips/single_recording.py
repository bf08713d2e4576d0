"""Analyse one recording by itself, whatever its scale and sign: how its velocity follows the force.

The velocity is modelled as a delayed first-order lag of v_ss(F), where v_ss is the steady velocity by linear or by
quadratic drag alone, whichever explains more. Rate and delay are tried from a list; the rest is a linear fit, which has
one solution for any scale, while a search would need a start near it. A wrong sign leads to a negative gain. Forces
that are independent of the commands (coupling, swell) hardly affect the result. The result is accurate to about 30 %,
which is enough to recognize a wrong unit or sign, but not to be reported.
"""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from rov_fmu.identify.driving import thrust_along
from rov_fmu.identify.points.step_responses import correlation_time
from rov_fmu.identify.simulation.prepared import PreparedRecording
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_DELAYS = (0.0, 0.1, 0.2, 0.4, 0.8)  # s, from the commands to the motion
_RATES = np.geomspace(0.03, 20.0, 27)  # 1/s
_POWERS = (1.0, 0.5)  # v_ss ~ F^power of linear and of quadratic drag
_MOST = 2000  # samples of the grid
_LEAST = 0.3
"""The smallest share of the variance that the commands must explain."""
_CLEAR, _CLEAR_ERROR = 0.5, 0.2
"""The share of the variance, and the error of drag, of a clear result."""


@dataclass(frozen=True)
class Alone:
    """The motion along one axis from one recording, in SI units."""

    turned: bool
    """True when it moves against its commands."""
    inertia: float
    """m/β: force divided by acceleration."""
    a: float
    """Quadratic drag; the whole drag in N is a v^2 + b v."""
    b: float
    speed: float
    """About the highest speed."""
    errors: tuple[float, float]
    """Relative standard errors of the inertia, and of drag at the highest speed."""
    share: float
    """The share of the variance of the velocity that this motion explains."""

    @property
    def is_clear(self) -> bool:
        """True when the motion clearly follows the commands."""
        return self.share > _CLEAR and self.errors[1] < _CLEAR_ERROR

    def drag(self, v: float) -> float:
        """Return the drag at a velocity of 0 or more, N."""
        return (self.a * v + self.b) * v

    def steady(self, force: float) -> float:
        """Return the velocity at which drag balances a force of 0 or more."""
        return 2.0 * force / (self.b + sqrt(self.b**2 + 4.0 * self.a * force))


def alone(data: PreparedRecording, base: Rov) -> Alone | None:
    """Analyse the motion of a recording; return None at rest, or where the motion does not follow the commands."""
    count, speed = min(len(data.time), _MOST), data.speed
    time = np.linspace(data.time[0], data.time[-1], count)
    v = np.interp(time, data.time, data.velocity)
    force = base[data.axis.coefficient("alpha")] * thrust_along(base, data.axis, data.commands)
    strongest = float(np.abs(force).max())
    if strongest == 0.0 or speed == 0.0 or count < 20 or np.ptp(data.values) == 0.0:
        return None
    steady = [
        np.sign(F) * np.abs(F) ** power
        for power in _POWERS
        for F in (_held(data, force / strongest, time - delay) for delay in _DELAYS)
    ]
    fits = [_fits(time, v / speed, np.array(steady), rate) for rate in _RATES.tolist()]
    sums = np.array([sums for _, sums, _ in fits])
    place, kind = np.unravel_index(int(sums.argmin()), sums.shape)
    gains, _, residuals = fits[place]
    power, rate, gain = _POWERS[kind // len(_DELAYS)], float(_RATES[place]), abs(float(gains[kind]))
    centred, least = v / speed - np.mean(v / speed), float(sums.min())
    share, independent = 1.0 - least / float(centred @ centred), count / correlation_time(residuals)
    if share < _LEAST:
        return None
    error = sqrt((1.0 - share) / (share * independent))
    near = np.log(_RATES[(sums <= least * (1.0 + 4.0 / independent)).any(axis=1)])
    of_rate = 0.25 * float(np.ptp(near)) if _RATES[0] < rate < _RATES[-1] else inf
    # F/strongest = (v/speed / gain)^(1/power)
    a, b = (0.0, strongest / (gain * speed)) if power == 1.0 else (strongest / (gain * speed) ** 2, 0.0)
    inertia = (a * speed + b) / rate  # for Tau (17) is about V_ss (m/β) / F
    return Alone(bool(gains[kind] < 0.0), inertia, a, b, speed, (error + of_rate, error / power), share)


def _held(data: PreparedRecording, force: Array, time: Array) -> Array:
    """Return the force at these times."""
    return np.asarray(force[np.maximum(np.searchsorted(data.switches, time, side="right") - 1, 0)])


def _fits(time: Array, v: Array, steady: Array, rate: float) -> tuple[Array, Array, Array]:
    """Fit the velocity by a constant plus a gain times the lagged response to each of k steady velocities (k x n).

    Return the gains, the remaining sums of squares, and the residuals of the best fit.
    """
    from scipy.signal import lfilter  # imported here because it is slow, and tables do not need it

    fall = np.exp(-rate * float(time[1] - time[0]))
    lagging = lfilter([1.0 - fall], [1.0, -fall], np.pad(steady[:, :-1], ((0, 0), (1, 0))), axis=1)
    centred, lagging = v - v.mean(), lagging - lagging.mean(axis=1, keepdims=True)
    gains = lagging @ centred / np.maximum(np.sum(lagging**2, axis=1), 1e-300)
    residuals = centred - gains[:, None] * lagging
    sums = np.sum(residuals**2, axis=1)
    return gains, sums, residuals[int(sums.argmin())]
