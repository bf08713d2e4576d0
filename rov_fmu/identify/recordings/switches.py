"""Decide whether the commands of logs switch between rows, and allow for the unknown times of the switches.

A log shows a new command in the first row after it, so the command changed at any time since the row before: on average
in the middle, with a standard deviation of the time between the rows divided by √12. Where a test program wrote the
log itself, the command changes at the row. The residuals tell which it is.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from rov_fmu.identify.effects.effect import delay_of
from rov_fmu.identify.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.simulation.linear_response import LONGEST, LinearResponse
from rov_fmu.identify.simulation.prepared import PreparedRecording, switched_rows
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.smoothing import without_spikes

_TESTED = 60
"""The number of switches of a recording that the test uses, strongest first."""
_COEFFICIENTS = 256
"""The number of coefficients of the cosine transform that the test uses."""


def allow_for_switches(model: Simulator, x: Array) -> tuple[PreparedRecording, ...]:
    """Return the recordings, with switches at unknown times between rows if this explains the residuals better.

    `x` has the parameters of a fit without this allowance. Raises MotionError.
    """
    rov, extras, J = model.rov(x), model.extra_values(x), model.jacobian(x)
    gain, shifts = 0.0, []
    for d, output, rows in zip(model.data, model.run(x), model.rows, strict=True):
        delay = d.delay + delay_of(extras, d.recording)
        S = LinearResponse(rov, d.recording, d.time, output.velocity, delay).by_switches
        gain += _gain(without_spikes(d.values - output.values), S[:, :_TESTED], J[rows])
        shifts.append(S)
    if gain <= 0.0:
        return model.data
    return tuple(
        replace(d, switches=_middle(d, model), shifts=S if S.shape[1] else None)
        for d, S in zip(model.data, shifts, strict=True)
    )


def _gain(residuals: Array, S: Array, jacobian: Array) -> float:
    """Return how much larger the logarithm of the likelihood is with unknown times of the switches."""
    if not S.shape[1]:
        return 0.0
    spectrum = noise_spectrum(residuals, np.hstack([S, jacobian]))
    if spectrum is None:
        return 0.0
    noise = np.sqrt(spectrum[:_COEFFICIENTS])
    r, A = cosines(residuals)[:_COEFFICIENTS] / noise, cosines(S)[:_COEFFICIENTS] / noise[:, None]
    factor = cho_factor(np.eye(S.shape[1]) + A.T @ A)  # the covariance is I + A A'
    explained = r @ A @ cho_solve(factor, A.T @ r)
    return float(0.5 * explained - np.log(np.diag(factor[0])).sum())


def _middle(data: PreparedRecording, model: Simulator) -> Array:
    """Return the times midway between the rows at which commands differ, but the first at its row, s."""
    time = data.recording.time
    switched = switched_rows(data.recording.reaching(model.base.layout))
    before = np.maximum(switched - 1, 0)
    return np.asarray(time[switched] - 0.5 * np.minimum(time[switched] - time[before], LONGEST))
