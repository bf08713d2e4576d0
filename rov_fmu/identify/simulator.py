"""Recordings as a function of the coefficients: what the model's sensors would have measured, and its derivatives."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rov_fmu.identify.least_squares import Array, Estimate, external, internal
from rov_fmu.identify.response_fit import drag_and_beta
from rov_fmu.identify.step_responses import velocity, without_spikes
from rov_fmu.identify.tank_tests import Recording, thrust_names
from rov_fmu.identify.trajectory import trajectory
from rov_fmu.motion.layout import Axis
from rov_fmu.motion.riccati import Riccati
from rov_fmu.motion.rov import Rov

_STEP = 1e-6  # of the differences that stand for derivatives


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """A recording ready to be simulated: holds of the command with the thrust they give, and the measured samples."""

    recording: Recording
    starts: Array
    thrust: Array
    """holds x 2: force before α for a_t = 1 and for b_t = 1."""
    time: Array
    values: Array
    speed: float
    """About the highest."""
    force: float
    """The strongest, before α."""

    @property
    def axis(self) -> Axis:
        """Its axis."""
        return self.recording.axis

    @property
    def initial_count(self) -> int:
        """Number of its initial values: of the velocity, of the position where that is measured."""
        return 2 if self.recording.is_position else 1

    def thinned(self) -> "PreparedRecording":
        """With some 500 of its samples."""
        some = slice(None, None, max(1, len(self.time) // 500))
        return replace(self, time=self.time[some], values=self.values[some])


def prepare(recording: Recording, base: Rov) -> PreparedRecording:
    """Find the holds, from the one of the first measured sample on."""
    axis, there = recording.axis, np.isfinite(recording.values)
    time, values = recording.time[there], recording.values[there]
    holds = np.concatenate([[0], np.flatnonzero(np.diff(recording.command)) + 1])
    holds = holds[max(int(np.searchsorted(holds, np.flatnonzero(there)[0], side="right")) - 1, 0) :]
    levels, place = np.unique(recording.command[holds], return_inverse=True)
    names = thrust_names(axis)
    units = [base.replaced(dict(zip(names, unit, strict=True))) for unit in ((1.0, 0.0), (0.0, 1.0))]
    thrust = np.array([[k.force(axis, c) for k in units] for c in levels.tolist()])[place]
    starts = recording.time[holds]
    starts[0] = time[0]
    inner = starts <= time[-1]
    _, v = velocity(time, without_spikes(values), is_position=recording.is_position)
    force = np.abs(thrust @ [base[name] for name in names]).max()
    speed = float(np.quantile(np.abs(v), 0.95))
    return PreparedRecording(recording, starts[inner], thrust[inner], time, values, speed, float(force))


@dataclass(frozen=True, eq=False)
class Simulator:
    """Recordings as a function of x: named coefficients (internal parameters), then each recording's initial values.

    Residuals are modelled less measured, in standard deviations (sigma, one a recording), one recording after the
    other; the thrust coefficients, where they are among the names, stand behind as two more that were measured.
    """

    data: tuple[PreparedRecording, ...]
    base: Rov
    names: tuple[str, ...]
    sigma: Array
    thrust: Estimate | None = None

    @property
    def places(self) -> list[tuple[PreparedRecording, slice, slice, float]]:
        """Each recording, its rows of the residuals, its initial values in x, its standard deviation."""
        rows = np.cumsum([0, *(len(d.time) for d in self.data)]).tolist()
        initial = np.cumsum([len(self.names), *(d.initial_count for d in self.data)]).tolist()
        slices = ([slice(*ends) for ends in pairwise(bounds)] for bounds in (rows, initial))
        return list(zip(self.data, *slices, self.sigma.tolist(), strict=True))

    def start(self, beta: float) -> Array:
        """Drag half linear, half quadratic, such that the strongest force gives about the highest speed; at rest."""
        fastest = max(self.data, key=lambda d: d.speed)
        axis = fastest.axis
        drag = self.base[axis.coefficient("alpha")] * fastest.force / fastest.speed
        kinds = {"a_d": 0.5 * drag / fastest.speed, "b_d": 0.5 * drag, "beta": beta}
        shared = internal(self.names, {axis.coefficient(kind): value for kind, value in kinds.items()})
        return np.concatenate([shared, *(np.array([0.0, d.values[0]][: d.initial_count]) for d in self.data)])

    def run(self, data: PreparedRecording, x: Array, initial: Array, load: float = 0.0) -> tuple[Array, Array, Array]:
        """Output, velocity and acceleration at the measured samples, with a constant load (N, N.m) besides."""
        k, axis = self.base.replaced(external(self.names, x)), data.axis
        unit = k.acceleration_of(k.layout.kinds[axis.name], 0.0, 1.0)  # under a load of 1
        thrust = data.thrust @ [k[name] for name in thrust_names(axis)]
        C = unit.C * (k[axis.coefficient("alpha")] * thrust + load)
        v, s = trajectory([Riccati(unit.A, unit.B, c) for c in C.tolist()], data.starts, float(initial[0]), data.time)
        held = C[np.searchsorted(data.starts, data.time, side="right") - 1]
        output = s + initial[1] if data.recording.is_position else v
        return output, v, held - (unit.B + unit.A * np.abs(v)) * v

    def residuals(self, x: Array) -> Array:
        """See the class."""
        parts = [(self.run(d, x, x[initial])[0] - d.values) / sigma for d, _, initial, sigma in self.places]
        if self.thrust:
            parts.append(self._whitening @ (x[:2] - self.thrust.values))
        return np.concatenate(parts)

    def jacobian(self, x: Array) -> Array:
        """Of the residuals, by forward differences."""
        J = np.zeros((self._size, len(x)))
        for d, rows, initial, sigma in self.places:
            here = self.run(d, x, x[initial])[0]
            concerns = (*thrust_names(d.axis), *drag_and_beta(d.axis))
            steps = {n: _STEP * max(abs(x[n]), 1e-2) for n, name in enumerate(self.names) if name in concerns}
            for n, h in {**steps, initial.start: _STEP * max(d.speed, 1e-3)}.items():
                moved = x.copy()
                moved[n] += h
                J[rows, n] = (self.run(d, moved, moved[initial])[0] - here) / ((moved[n] - x[n]) * sigma)
            if d.recording.is_position:
                J[rows, initial.start + 1] = 1.0 / sigma
        if self.thrust:
            J[-2:, :2] = self._whitening
        return J

    def by_load(self, axis: Axis, x: Array) -> Array:
        """Derivative of the residuals by a constant load on an axis."""
        column = np.zeros(self._size)
        for d, rows, initial, sigma in self.places:
            if d.axis is axis and (h := 1e-4 * d.force):
                up, down = (self.run(d, x, x[initial], load)[0] for load in (h, -h))
                column[rows] = (up - down) / (2.0 * h * sigma)
        return column

    @property
    def _size(self) -> int:
        """How many residuals there are."""
        return sum(len(d.time) for d in self.data) + 2 * bool(self.thrust)

    @property
    def _whitening(self) -> Array:
        assert self.thrust
        return np.linalg.inv(np.linalg.cholesky(self.thrust.covariance))
