"""Recordings as a function of the coefficients: what the model's sensors would have measured, and its derivatives."""

from dataclasses import dataclass, replace

import numpy as np

from rov_fmu.identify.least_squares import Array, Estimate, external, internal
from rov_fmu.identify.step_responses import velocity, without_spikes
from rov_fmu.identify.tank_tests import Recording
from rov_fmu.identify.trajectory import trajectory
from rov_fmu.motion.riccati import Riccati
from rov_fmu.motion.rov import Axis, Coefficients

_STEP = 1e-6  # of the differences that stand for derivatives


@dataclass(frozen=True, eq=False)
class Prepared:
    """A recording made ready: holds of the command with what thrust they give, and the measured samples."""

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
    def own(self) -> int:
        """Number of parameters of its own: first velocity, first position."""
        return 2 if self.recording.is_position else 1

    def thinned(self) -> "Prepared":
        """With some 500 of its samples."""
        some = slice(None, None, max(1, len(self.time) // 500))
        return replace(self, time=self.time[some], values=self.values[some])


def prepare(recording: Recording, base: Coefficients) -> Prepared:
    """Find the holds; commands before the first measured sample are left out."""
    m, there = recording.axis, np.isfinite(recording.values)
    time, values = recording.time[there], recording.values[there]
    holds = np.concatenate([[0], np.flatnonzero(np.diff(recording.command)) + 1])
    holds = holds[max(int(np.searchsorted(holds, np.flatnonzero(there)[0], side="right")) - 1, 0) :]
    levels, place = np.unique(recording.command[holds], return_inverse=True)
    units = [replace(base, **dict(zip(m.thrust_names, unit, strict=True))) for unit in ((1.0, 0.0), (0.0, 1.0))]
    thrust = np.array([[m.force(k, c) for k in units] for c in levels.tolist()])[place]
    starts = recording.time[holds]
    starts[0] = time[0]
    inner = starts <= time[-1]
    _, v = velocity(time, without_spikes(values), is_position=recording.is_position)
    force = np.abs(thrust @ [getattr(base, name) for name in m.thrust_names]).max()
    speed = float(np.quantile(np.abs(v), 0.95))
    return Prepared(recording, starts[inner], thrust[inner], time, values, speed, float(force))


@dataclass(frozen=True, eq=False)
class Simulator:
    """Recordings as a function of x: named coefficients (internal parameters), then each recording's own.

    Residuals are modelled less measured, in standard deviations (one a recording), one recording after the other; the
    thrust coefficients, where they are among the names, stand behind as two more that were measured.
    """

    data: tuple[Prepared, ...]
    base: Coefficients
    names: tuple[str, ...]
    thrust: Estimate | None = None

    def start(self, beta: float) -> Array:
        """Drag half linear, half quadratic, such that the strongest force gives about the highest speed; at rest."""
        fastest = max(self.data, key=lambda d: d.speed)
        m = fastest.axis
        drag = getattr(self.base, m.coefficient("alpha")) * fastest.force / fastest.speed
        kinds = {"a_d": 0.5 * drag / fastest.speed, "b_d": 0.5 * drag, "beta": beta}
        shared = internal(self.names, {m.coefficient(kind): value for kind, value in kinds.items()})
        return np.concatenate([shared, *(np.array([0.0, d.values[0]][: d.own]) for d in self.data)])

    def own(self, x: Array) -> list[Array]:
        """Each recording's own parameters."""
        return np.split(x[len(self.names) :], np.cumsum([d.own for d in self.data])[:-1])

    def split(self, samples: Array) -> list[Array]:
        """Samples by recording; what stands behind is left out."""
        return np.split(samples, np.cumsum([len(d.time) for d in self.data]))[:-1]

    def run(self, data: Prepared, x: Array, own: Array, load: float = 0.0) -> tuple[Array, Array, Array]:
        """Output, velocity and acceleration at the measured samples, with a constant load (N, N.m) besides."""
        k, m = replace(self.base, **external(self.names, x)), data.axis
        full = m.held(k, 1.0)
        forces = data.thrust @ [getattr(k, name) for name in m.thrust_names]
        C = full.C / m.force(k, 1.0) * (forces + load / getattr(k, m.coefficient("alpha")))
        v, s = trajectory([Riccati(full.A, full.B, c) for c in C.tolist()], data.starts, float(own[0]), data.time)
        held = C[np.searchsorted(data.starts, data.time, side="right") - 1]
        output = s + own[1] if data.recording.is_position else v
        return output, v, held - (full.B + full.A * np.abs(v)) * v

    def residuals(self, x: Array, sigma: Array) -> Array:
        """See the class."""
        runs = zip(self.data, self.own(x), sigma, strict=True)
        parts = [(self.run(d, x, own)[0] - d.values) / s for d, own, s in runs]
        if self.thrust:
            parts.append(self._whitening @ (x[:2] - self.thrust.values))
        return np.concatenate(parts)

    def jacobian(self, x: Array, sigma: Array) -> Array:
        """Of the residuals, by forward differences."""
        J = np.zeros((sum(len(d.time) for d in self.data) + 2 * bool(self.thrust), len(x)))
        row, column = 0, len(self.names)
        for d, own, s in zip(self.data, self.own(x), sigma, strict=True):
            rows = slice(row, row + len(d.time))
            here = self.run(d, x, own)[0]
            concerns = (*d.axis.thrust_names, *(d.axis.coefficient(kind) for kind in ("a_d", "b_d", "beta")))
            for n, name in enumerate(self.names):
                if name in concerns:
                    moved = x.copy()
                    moved[n] += _STEP * max(abs(x[n]), 1e-2)
                    J[rows, n] = (self.run(d, moved, own)[0] - here) / ((moved[n] - x[n]) * s)
            h = _STEP * max(d.speed, 1e-3)
            J[rows, column] = (self.run(d, x, np.array([own[0] + h, *own[1:]]))[0] - here) / (h * s)
            if d.recording.is_position:
                J[rows, column + 1] = 1.0 / s
            row, column = rows.stop, column + d.own
        if self.thrust:
            J[row:, :2] = self._whitening
        return J

    def by_load(self, m: Axis, x: Array, sigma: Array) -> Array:
        """Derivative of the residuals by a constant load on an axis."""
        parts = []
        for d, own, s in zip(self.data, self.own(x), sigma, strict=True):
            h = 1e-4 * d.force if d.axis is m else 0.0
            up, down = (self.run(d, x, own, load)[0] for load in (h, -h))
            parts.append((up - down) / (2.0 * h * s) if h else np.zeros(len(d.time)))
        return np.concatenate([*parts, np.zeros(2 * bool(self.thrust))])

    @property
    def _whitening(self) -> Array:
        assert self.thrust
        return np.linalg.inv(np.linalg.cholesky(self.thrust.covariance))
