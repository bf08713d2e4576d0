"""What one recording tells by itself, of any scale and sign: how its velocity follows the force.

The velocity is taken as a delayed first-order lag of v_ss(F), v_ss the steady velocity by linear or by quadratic drag
alone, whichever tells more of it. But for the rate and the delay, which are tried one after the other, this is a
linear fit: it has one best answer whatever the scale, where a search would need a start near it; and where the motion
is turned round its gain is negative. Other forces (coupling, swell) that do not follow the commands leave it as it is.
It is good to some 30 %, enough to tell a unit or a sign and not to be printed as a result.
"""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from rov_fmu.identify.points.step_responses import correlation_time
from rov_fmu.identify.recordings.runs import PreparedRecording, push
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_DELAYS = (0.0, 0.1, 0.2, 0.4, 0.8)  # s, from the commands to the motion
_RATES = np.geomspace(0.03, 20.0, 27)  # 1/s
_POWERS = (1.0, 0.5)  # v_ss ~ F^power of linear and of quadratic drag
_MOST = 2000  # samples of the grid
_LEAST = 0.3  # share of the variance that the commands must explain, or there is no telling
_CLEAR, _CLEAR_ERROR = 0.5, 0.2  # share, and error of drag


@dataclass(frozen=True)
class Alone:
    """Motion along one axis by one recording; SI units."""

    turned: bool
    """Whether it moves against its commands."""
    inertia: float
    """m/β: force by acceleration."""
    a: float
    """Drag on the vehicle in N: a v^2 + b v."""
    b: float
    speed: float
    """About the highest."""
    errors: tuple[float, float]
    """Relative standard errors of the inertia, and of drag at the highest speed."""
    share: float
    """Of the variance of the velocity that it explains."""

    @property
    def is_clear(self) -> bool:
        """Whether it is beyond doubt that it moves by its commands."""
        return self.share > _CLEAR and self.errors[1] < _CLEAR_ERROR

    def drag(self, v: float) -> float:
        """N, at a velocity of 0 or more."""
        return (self.a * v + self.b) * v

    def steady(self, force: float) -> float:
        """The velocity at which drag is this force, of 0 or more."""
        return 2.0 * force / (self.b + sqrt(self.b**2 + 4.0 * self.a * force))


def alone(data: PreparedRecording, base: Rov) -> Alone | None:
    """The motion by this recording; None where it tells none: at rest, or not by its commands."""
    count, speed = min(len(data.time), _MOST), data.speed
    time = np.linspace(data.time[0], data.time[-1], count)
    v = np.interp(time, data.time, data.velocity)
    pushes = [push(base, data.axis, curve, data.commands).force for curve in base.layout.curves]
    force = base[data.axis.coefficient("alpha")] * np.sum(pushes, axis=0)
    strongest = float(np.abs(force).max(initial=0.0))
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
    """The force at these times."""
    return np.asarray(force[np.maximum(np.searchsorted(data.switches, time, side="right") - 1, 0)])


def _fits(time: Array, v: Array, steady: Array, rate: float) -> tuple[Array, Array, Array]:
    """The velocity as a gain times a lag of each of k steady ones (k x n), from rest, and a constant.

    The gains, the sums of squares that are left, and the residuals of the best.
    """
    from scipy.signal import lfilter  # late: it takes long to import, and tables need none of it

    fall = np.exp(-rate * float(time[1] - time[0]))
    lagging = lfilter([1.0 - fall], [1.0, -fall], np.pad(steady[:, :-1], ((0, 0), (1, 0))), axis=1)
    left, lagging = v - v.mean(), lagging - lagging.mean(axis=1, keepdims=True)
    gains = lagging @ left / np.maximum(np.sum(lagging**2, axis=1), 1e-300)
    residuals = left - gains[:, None] * lagging
    sums = np.sum(residuals**2, axis=1)
    return gains, sums, residuals[int(sums.argmin())]
