"""Decide how exactly a log gives the times of its commands, and allow for the uncertain times of the switches.

A log shows a new command in the first row after it, so the command changed at any time since the row before: on average
in the middle, with a standard deviation of the time between the rows divided by √12. Where a test program wrote the log
itself, the command changes at the row, or near it if the time stamps have errors. The residuals decide between the two.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rov_fmu.identify.adapter.smoothing import without_spikes
from rov_fmu.identify.effects.effect import delay_of
from rov_fmu.identify.least_squares import basis, scaled
from rov_fmu.identify.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.simulation.linear_response import LONGEST, LinearResponse
from rov_fmu.identify.simulation.prepared import PreparedRecording, switched_rows
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.tank.arrays import Array

_TESTED = 60
"""The number of switches of a recording that the test uses, strongest first."""
_COEFFICIENTS = 256
"""The number of coefficients of the cosine transform that the test uses."""
_SHARES = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0])
"""The tested scatters of the switches, relative to the scatter of switches between rows. The last value means switches
between rows."""
_LARGEST = 5.0
"""The largest loss of log-likelihood of one piece, so that a few pieces with another misfit do not decide."""

_CLEAR = 3.0
"""The least gain of log-likelihood of a scatter compared with no scatter. Chance rarely reaches it."""
_RANK = 1e-6
"""The least singular value of columns that are independent of the others."""


def allow_for_switches(model: Simulator, x: Array) -> tuple[PreparedRecording, ...]:
    """Return the recordings, with switches at uncertain times if this explains the residuals better.

    `x` has the parameters of a fit without this allowance. Raises MotionError.
    """
    rov, extras, J = model.rov(x), model.extra_values(x), model.jacobian(x)
    pieces, responses, shifts = [], [], []
    for d, output, rows in zip(model.data, model.run(x), model.rows, strict=True):
        response = LinearResponse(rov, d.recording, d.time, output.velocity, d.delay + delay_of(extras, d.recording))
        S = response.by_switches()
        responses.append(response)
        shifts.append(S)
        pieces.append(_whitened(without_spikes(d.values - output.values), S, J[rows], model.shared))
    share = _share([_gains(piece) for piece in _without_fit([piece for piece in pieces if piece])])
    if share == 0.0:
        return model.data
    if share == _SHARES[-1]:
        return tuple(_between_rows(d, response) for d, response in zip(model.data, responses, strict=True))
    found = zip(model.data, shifts, strict=True)
    return tuple(replace(d, shifts=share * S if S.shape[1] else None) for d, S in found)


def _share(gains: Sequence[Array]) -> float:
    """Return the most likely scatter of the switches, by the gains of all pieces."""
    losses = np.sum([np.minimum(each.max() - each, _LARGEST) for each in gains] or np.zeros((1, len(_SHARES))), axis=0)
    return float(_SHARES[np.argmin(losses)]) if losses[0] - losses.min() > _CLEAR else 0.0


def _between_rows(data: PreparedRecording, response: LinearResponse) -> PreparedRecording:
    """Return a recording whose switches lie midway between rows, but the first at its row."""
    time = data.recording.time
    switched = switched_rows(data.recording.reaching(response.rov.layout))
    early = 0.5 * np.minimum(time[switched] - time[np.maximum(switched - 1, 0)], LONGEST)
    middles = time[switched] - early
    if len(switched) < 2:
        return replace(data, switches=middles, between_rows=True)
    at = middles[1:] + early[1:].mean()  # the delay was fitted to switches at rows
    S = np.hstack([response.by_switches(at), response.by_switches(at, squared=True)])
    return replace(data, switches=middles, shifts=S if S.shape[1] else None, between_rows=True)


@dataclass(frozen=True)
class _Piece:
    """The slow coefficients of the transform of one piece of a recording, in standard deviations of the noise."""

    residuals: Array
    shifts: Array
    """The response to a late switch, n x switches."""
    fit: Array
    """The response to the parameters that all pieces share, n x p."""


def _whitened(residuals: Array, S: Array, jacobian: Array, shared: int) -> _Piece | None:
    """Return a piece after removing the part that the values at its start explain.

    The first columns of the Jacobian are those of the shared parameters. Returns None for a piece without switches, or
    with too few samples.
    """
    S = S[:, :_TESTED]
    spectrum = noise_spectrum(residuals, np.hstack([S, jacobian])) if S.shape[1] else None
    if spectrum is None:
        return None
    noise = np.sqrt(spectrum[:_COEFFICIENTS, None])
    fit, start = np.split(jacobian, [shared], axis=1)
    own = basis(scaled(cosines(start)[:_COEFFICIENTS] / noise), _RANK)
    white = cosines(np.column_stack([residuals, S, fit]))[:_COEFFICIENTS] / noise
    white -= own @ (own.T @ white)
    return _Piece(white[:, 0], *np.split(white[:, 1:], [S.shape[1]], axis=1))


def _without_fit(pieces: Sequence[_Piece]) -> list[_Piece]:
    """Return the pieces without what the shared parameters explain.

    The fit has followed the largest errors of the switches, so its residuals show less of them than there is.
    """
    if not pieces:
        return []
    ends = np.cumsum([len(piece.residuals) for piece in pieces])[:-1]
    parts = np.split(basis(scaled(np.concatenate([piece.fit for piece in pieces])), _RANK), ends)
    explained = np.sum([Q.T @ piece.residuals for Q, piece in zip(parts, pieces, strict=True)], axis=0)
    return [
        _Piece(piece.residuals - Q @ explained, piece.shifts - Q @ (Q.T @ piece.shifts), piece.fit)
        for Q, piece in zip(parts, pieces, strict=True)
    ]


def _gains(piece: _Piece) -> Array:
    """Return the gain of log-likelihood for each share of scatter."""
    U, s, _ = np.linalg.svd(piece.shifts, full_matrices=False)
    explained, scatter = (U.T @ piece.residuals) ** 2, np.outer(_SHARES, s) ** 2  # the covariance is I + share^2 A A'
    return np.asarray(0.5 * np.sum(explained * scatter / (1.0 + scatter) - np.log1p(scatter), axis=1))
