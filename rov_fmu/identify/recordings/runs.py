"""Cut recordings into steps for the series, with the forces of the thrusters in each step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.coupling import Coupling, Current, carried, coupling
from rov_fmu.identify.recordings.trajectory import REACH, ROUGH, Steps, recursion
from rov_fmu.model.layout import REVERSE, Axis, Curve, VehicleAxis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import velocity, without_spikes

_MOST_PARTS = 64
"""The largest number of steps between two samples."""
_FEW = 500
"""The number of samples of a thinned recording."""
_FEWEST = 50
"""The smallest number of samples of a part of a recording."""


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """A recording that is ready to be simulated, with J holds of the commands and n measured samples."""

    recording: Recording
    switches: Array
    """J: the time at which each hold begins, s."""
    commands: Array
    """J x thrusters: the command of each."""
    time: Array
    values: Array
    velocity: Array
    """n: the smoothed velocity."""
    current: Current = (0.0, 0.0)
    """The known part of the current."""
    reach: float = REACH
    """The largest rate times length of its steps."""

    @property
    def axis(self) -> Axis:
        """The axis of the recording."""
        return self.recording.axis

    @property
    def initial_count(self) -> int:
        """The number of initial values: the velocity, and the position where that is measured."""
        return 2 if self.recording.is_position else 1

    @cached_property
    def speed(self) -> float:
        """About the highest speed."""
        return float(np.quantile(np.abs(self.velocity), 0.95))

    @cached_property
    def carried(self) -> Array:
        """The change of the samples due to a current of 1 m/s north and east, 2 x n."""
        return carried(self.recording, self.time)

    def part(self, which: slice | Flags) -> "PreparedRecording":
        """Return the recording with some of its samples."""
        return replace(self, time=self.time[which], values=self.values[which], velocity=self.velocity[which])

    def liveliest(self, seconds: float) -> "PreparedRecording":
        """Return the part of at most so many seconds in which the velocity varies most."""
        if self.time[-1] - self.time[0] <= seconds:
            return self
        starts = np.arange(self.time[0], self.time[-1] - seconds, 0.25 * seconds)
        parts = [slice(*np.searchsorted(self.time, [start, start + seconds]).tolist()) for start in starts.tolist()]
        part = max(
            parts, key=lambda part: float(np.std(self.velocity[part])) if part.stop - part.start > _FEWEST else 0.0
        )
        if part.stop - part.start <= _FEWEST:
            return self
        return self.part(part)

    def thinned(self, few: int = _FEW) -> "PreparedRecording":
        """Return the recording with fewer samples, without spikes, for computations with less precision."""
        some = slice(None, None, max(1, len(self.time) // few))
        return replace(self, values=without_spikes(self.values), reach=ROUGH).part(some)


def axes_of(data: Sequence[PreparedRecording]) -> list[Axis]:
    """Return the axes of recordings."""
    return list({d.axis.name: d.axis for d in data}.values())


def prepare(recording: Recording, base: Rov) -> PreparedRecording:
    """Prepare a recording: find the holds, the measured samples and the smoothed velocity."""
    there = np.isfinite(recording.values)
    time, values = recording.time[there], recording.values[there]
    reaching = recording.reaching(base.layout)
    holds = np.concatenate([[0], np.flatnonzero(np.any(np.diff(reaching, axis=0) != 0.0, axis=1)) + 1])
    even, v = velocity(time, without_spikes(values), is_position=recording.is_position)
    return PreparedRecording(recording, recording.time[holds], reaching[holds], time, values, np.interp(time, even, v))


@dataclass(frozen=True, eq=False)
class Push:
    """The force of a curve's thrusters along an axis without α, and its derivatives by coefficient, J each."""

    force: Array
    slopes: dict[str, Array]


def push(rov: Rov, axis: Axis, curve: Curve, commands: Array) -> Push:
    """Return the steady thrust (2) of a curve along an axis, for commands of J x thrusters of the layout."""
    force = np.zeros(len(commands))
    slopes: dict[str, Array] = {}
    for n, thruster in enumerate(rov.layout.thrusters):
        if thruster.curve != curve.name or not (effect := rov.effect(thruster, axis)):
            continue
        c = commands[:, n]
        for side, end in ((c > 0.0, ""), (c < 0.0, REVERSE)):
            names = {key: curve.coefficient(key + end) for key in ("a_t", "b_t", "c_0")}
            a_t, b_t = rov[names["a_t"]], rov[names["b_t"]]
            dead = rov[names["c_0"]] if "c_0" in curve.keys else 0.0
            m = np.where(side, np.maximum(np.abs(c) - dead, 0.0), 0.0)
            share = effect / curve.together * np.sign(c)
            force = force + share * (a_t * m + b_t) * m
            by = {"a_t": share * m * m, "b_t": share * m, "c_0": np.where(m > 0.0, -share * (2.0 * a_t * m + b_t), 0.0)}
            for key, slope in by.items():
                slopes[names[key]] = slopes.get(names[key], np.zeros_like(slope)) + slope
    return Push(force, slopes)


@dataclass(frozen=True, eq=False)
class Run:
    """One recording cut into steps: the start, length and hold of each, and the step that begins at each sample."""

    start: Array
    h: Array
    hold: NDArray[np.intp]
    sample: NDArray[np.intp]
    switched: NDArray[np.intp]
    """The steps at whose start the commands change, except the first."""


def _cut(data: PreparedRecording, delay: float, longest: float) -> Run:
    switches = data.switches + delay
    inside = switches[(switches > data.time[0]) & (switches < data.time[-1])]
    nodes = np.union1d(data.time, inside) if len(inside) else data.time
    gaps = np.diff(nodes)
    parts = np.clip(np.ceil(gaps / longest), 1.0, _MOST_PARTS).astype(int)
    first = np.concatenate([[0], np.cumsum(parts)])
    h = np.repeat(gaps / parts, parts)
    start = np.repeat(nodes[:-1], parts) + h * (np.arange(first[-1]) - np.repeat(first[:-1], parts))
    hold = np.maximum(np.searchsorted(switches, start, side="right") - 1, 0)
    sample = first[np.searchsorted(nodes, data.time)]
    return Run(start, h, hold, sample, np.flatnonzero(np.diff(hold)) + 1)


@dataclass(frozen=True, eq=False)
class ForcedRun:
    """The forces of a run: of each curve in its holds, and the lagging forces at the start of each step."""

    run: Run
    form: VehicleAxis
    pushes: list[tuple[Curve, Push]]
    lags: list[tuple[int, Array]]
    """The index of each curve with a lag, and its force at the start of each step, N."""
    coupling: Coupling | None
    """The coupling in the middle of each step."""


def forced_run(rov: Rov, data: PreparedRecording, delay: float, v0: float, current: Current = (0.0, 0.0)) -> ForcedRun:
    """Return the run of a recording with delayed commands, an initial velocity and a current."""
    layout = rov.layout
    form = layout.kinds[data.axis.name]
    pushes = [(c, push(rov, data.axis, c, data.commands)) for c in curves_of(layout, data.axis)]
    beside = coupling(rov, data.recording, current)
    besides = float(np.abs(beside.force).max()) if beside else 0.0
    run = _cut(data, delay, data.reach / max(_rate(rov, form, pushes, v0, besides), 1e-6))
    lags = [
        (n, lagging(run, found.force, 1.0 / rov[curve.coefficient("T")]))
        for n, (curve, found) in enumerate(pushes)
        if curve.has_lag
    ]
    held = beside.at(data.recording.time, run.start + 0.5 * run.h) if beside else None
    return ForcedRun(run, form, pushes, lags, held)


def _rate(rov: Rov, form: VehicleAxis, pushes: Sequence[tuple[Curve, Push]], v0: float, besides: float) -> float:
    """Return an upper bound of all rates, 1/s, under thrust, load and the forces `besides`."""
    gain, alpha = rov.gain(form), abs(rov[form.axis.coefficient("alpha")])
    A, B = (gain * max(rov[form.coefficient(key + end)] for end in ("", REVERSE)) for key in ("a_d", "b_d"))
    thrust = sum(float(np.abs(p.force).max()) for _, p in pushes)
    strongest = gain * (alpha * thrust + abs(rov.load(form)) + besides)
    lag = max((1.0 / rov[curve.coefficient("T")] for curve, _ in pushes if curve.has_lag), default=0.0)
    return float(B + 2.0 * np.sqrt(A * strongest) + A * abs(v0) + lag)


def lagging(run: Run, steady: Array, kappa: float) -> Array:
    """Return the lagging force at the start of each step; it begins at the steady force."""
    fall = np.exp(-kappa * run.h)
    target = steady[run.hold]
    return recursion(fall, np.concatenate([target[:1], ((1.0 - fall) * target)[:-1]]))


def steps_of(rov: Rov, forced: ForcedRun, load: float) -> Steps:
    """Return the steps of a run, with an additional load (N, N.m)."""
    form, run = forced.form, forced.run
    N, gain = len(run.h), rov.gain(form)
    by_force = gain * rov[form.axis.coefficient("alpha")]
    drag = [[gain * rov[form.coefficient(key + end)] for end in ("", REVERSE)] for key in ("a_d", "b_d")]
    A, B = (np.outer(sides, np.ones(N)) for sides in drag)
    steady = np.sum([p.force[run.hold] for _, p in forced.pushes], axis=0)
    D, kappa = np.zeros((len(forced.lags), N)), np.zeros((len(forced.lags), N))
    for line, (n, lagging_force) in enumerate(forced.lags):
        curve, found = forced.pushes[n]
        D[line] = by_force * (lagging_force - found.force[run.hold])
        kappa[line] = 1.0 / rov[curve.coefficient("T")]
    held = gain * (rov.load(form) + load + (forced.coupling.force if forced.coupling else 0.0))
    return Steps(run.h, np.array([0]), A, B, by_force * steady + held, D, kappa)


def joined(runs: Sequence[Steps]) -> Steps:
    """Join all runs; those without lag get terms of zero."""
    most = max(len(run.D) for run in runs)
    first = np.cumsum([0, *(len(run.h) for run in runs)])[:-1]

    def all_of(key: str) -> Array:
        parts = [getattr(run, key) for run in runs]
        if key in ("D", "kappa"):
            parts = [np.vstack([part, np.zeros((most - len(part), part.shape[1]))]) for part in parts]
        return np.concatenate(parts, axis=-1)

    return Steps(all_of("h"), first, *map(all_of, ("A", "B", "C", "D", "kappa")))


def at_samples(run: Run, adds: Array) -> Array:
    """Return the cumulative sum of what the steps add (N or N x P) at the samples."""
    total = np.concatenate([np.zeros((1, *adds.shape[1:])), np.cumsum(adds, axis=0)])
    return np.asarray(total[run.sample])
