"""Prepare recordings for a fit: find the switches of the commands, and divide recordings into pieces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import velocity, without_spikes
from rov_fmu.identify.effects.attitude import Attitude
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array, Flags

_FEW = 500
"""The number of samples of a thinned recording."""
_FEW_PIECES = 4
"""The number of pieces of each file from which a search can begin."""
_FEW_PIECES_OF_ALL = 12
"""A search begins with at least this many pieces of all files, if they exist."""
_FEWEST_OF_PIECE = 8
"""A piece with fewer samples determines only its own start."""
_GAP = 1.0
"""The shortest gap, s."""


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """A recording, or a piece of it, that is ready to be simulated: J intervals with constant commands, and n measured
    samples."""

    recording: Recording
    switches: Array
    """J: the time at which each hold begins, s."""
    commands: Array
    """J x thrusters: the command of each."""
    time: Array
    values: Array
    velocity: Array
    """n: the smoothed velocity."""
    piece: int = 0
    """The number of the piece. Recordings of the same file with the same number are simulated together."""
    delay: float = 0.0
    """The known part of the delay from the commands to the motion, s."""
    shifts: Array | None = None
    """n x switches: the change of the values when a switch comes later by one standard deviation; None when the times
    of all switches are known."""
    between_rows: bool = False
    """True when the commands switch between the rows of the log."""
    attitude: Attitude | None = None
    """The measured attitude at which the vehicle is simulated; None for a level vehicle, or one with roll or pitch."""

    @property
    def axis(self) -> Axis:
        """The axis of the recording."""
        return self.recording.axis

    @cached_property
    def speed(self) -> float:
        """About the highest speed."""
        return float(np.quantile(np.abs(self.velocity), 0.95))

    def part(self, which: slice | Flags) -> "PreparedRecording":
        """Return the recording with some of its samples."""
        shifts = None if self.shifts is None else self.shifts[which]
        time, values, velocity = self.time[which], self.values[which], self.velocity[which]
        return replace(self, time=time, values=values, velocity=velocity, shifts=shifts)

    def thinned(self, few: int = _FEW) -> "PreparedRecording":
        """Return the recording with fewer samples, without spikes, for computations with less precision."""
        some = slice(None, None, max(1, len(self.time) // few))
        return replace(self, values=without_spikes(self.values)).part(some)


def axes_of(data: Sequence[PreparedRecording]) -> list[Axis]:
    """Return the axes of recordings."""
    return list({d.axis.name: d.axis for d in data}.values())


def prepare(recording: Recording, base: Rov) -> PreparedRecording:
    """Prepare a recording: find the holds, the measured samples and the smoothed velocity."""
    there = np.isfinite(recording.values)
    time, values = recording.time[there], recording.values[there]
    reaching = recording.reaching(base.layout)
    holds = switched_rows(reaching)
    even, v = velocity(time, without_spikes(values), is_position=recording.is_position)
    return PreparedRecording(recording, recording.time[holds], reaching[holds], time, values, np.interp(time, even, v))


def switched_rows(reaching: Array) -> NDArray[np.intp]:
    """Return the rows at which the commands differ from the row before (rows x thrusters), and the first row."""
    return np.concatenate([[0], np.flatnonzero(np.any(np.diff(reaching, axis=0) != 0.0, axis=1)) + 1])


def divided(data: Sequence[PreparedRecording], longest: float) -> tuple[PreparedRecording, ...]:
    """Divide the recordings of every file at gaps, and into pieces of about `longest` (s) at most.

    Every piece has its own start, so that errors of a simulated position or heading grow only over the length of a
    piece.
    """
    bounds = {file: _bounds([d for d in data if d.recording.file == file], longest) for file in _files(data)}
    found = []
    for d in data:
        own = bounds[d.recording.file]
        pieces = d.piece * (len(own) + 1) + np.searchsorted(own, d.time, side="right")  # d may be a piece itself
        parts = {int(n): pieces == n for n in np.unique(pieces)}
        found += [replace(d.part(part), piece=n) for n, part in parts.items() if part.sum() >= _FEWEST_OF_PIECE]
    return tuple(found)


def some_pieces(data: Sequence[PreparedRecording]) -> list[int]:
    """Return the places of pieces from which a search can begin: a few of each file, evenly spaced."""
    files = _files(data)
    most = max(_FEW_PIECES, -(-_FEW_PIECES_OF_ALL // len(files)))
    chosen: set[tuple[str, int]] = set()
    for file in files:
        pieces = sorted({d.piece for d in data if d.recording.file == file})
        places = np.linspace(0, len(pieces) - 1, min(most, len(pieces))).round().astype(int)
        chosen |= {(file, pieces[n]) for n in places.tolist()}
    return [n for n, d in enumerate(data) if (d.recording.file, d.piece) in chosen]


def undivided(data: Sequence[PreparedRecording]) -> list[PreparedRecording]:
    """Join the pieces of each recording again."""
    found: dict[int, list[PreparedRecording]] = {}
    for d in data:
        found.setdefault(id(d.recording), []).append(d)
    return [
        replace(
            parts[0],
            time=np.concatenate([d.time for d in parts]),
            values=np.concatenate([d.values for d in parts]),
            velocity=np.concatenate([d.velocity for d in parts]),
            piece=0,
            shifts=None,
        )
        for parts in found.values()
    ]


def _files(data: Sequence[PreparedRecording]) -> list[str]:
    return list(dict.fromkeys(d.recording.file for d in data))


def _bounds(data: Sequence[PreparedRecording], longest: float) -> Array:
    """Return the times at which the recordings of a file are divided."""
    ends = sorted({min(d.time[0] for d in data), max(d.time[-1] for d in data), *(t for d in data for t in _gaps(d))})
    bounds: list[float] = []
    for start, end in pairwise(ends):
        count = max(1, round((end - start) / longest))
        bounds += np.linspace(start, end, count + 1)[1:].tolist()
    return np.array(bounds[:-1])


def _gaps(data: PreparedRecording) -> list[float]:
    """Return the middle of every gap in a recording."""
    steps = np.diff(data.time)
    wide = steps > max(_GAP, 10.0 * float(np.median(steps)))
    return [float(t) for t in data.time[:-1][wide] + 0.5 * steps[wide]]
