"""Find sensors whose values stop changing before a log ends, and leave out their later values."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from rov_fmu.io.messages import listed
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.recording import signal_name
from rov_fmu.tank.signals import LEAST_SAMPLES, Signal

_LEAST_SHARE, _LEAST_TIME = 0.2, 5.0
"""A sensor is frozen if it keeps its last value for more than this share of the log, and for more than this time, s."""
_CHANGING, _TURNING, _VISIBLE = 0.5, 0.2, 1.5
"""The noise of a sensor is visible if three conditions hold. At least the first share of the samples differ from the
sample before. At least the second share of the changes have the opposite sign of the change before. The median change
is more than the third number times the smallest change, which is the resolution of the sensor."""
_TOGETHER = 2.0
"""Sensors froze together if they froze within this time, s."""


def without_frozen(file: str, signals: Sequence[Signal]) -> tuple[list[Signal], list[Finding]]:
    """Return the signals without the values of sensors that froze together, and a finding about these.

    A single constant sensor may be right: for example the depth at the surface, or a coarse heading at rest.
    """
    frozen = {n: start for n, signal in enumerate(signals) if (start := _frozen_from(signal, signals)) is not None}
    together = _together(frozen)
    if len({(signals[n].axis, signals[n].quantity) for n in together}) < 2:
        return [*signals], []
    kept = [_until(signal, frozen[n]) if n in together else signal for n, signal in enumerate(signals)]
    first, last = _ends(signals)
    sensors = listed([_name(signals[n]) for n in together])
    numbers = {"start": min(frozen[n] for n in together) - first, "end": last - first}
    return kept, [Finding("frozen sensors", file=file, names={"sensors": sensors}, numbers=numbers)]


def _frozen_from(signal: Signal, signals: Iterable[Signal]) -> float | None:
    """Return the time after which a sensor with visible noise keeps its last value exactly, or None."""
    there = np.isfinite(signal.values)
    time, values = signal.time[there], signal.values[there]
    steps = np.diff(values)
    (changes,) = np.nonzero(steps)
    if not len(changes):
        return None
    start = int(changes[-1]) + 1
    first, last = _ends(signals)
    held = float(time[-1] - time[start])
    if start < LEAST_SAMPLES or held <= max(_LEAST_TIME, _LEAST_SHARE * (last - first)):
        return None
    return float(time[start]) if _is_noisy(steps[:start]) else None


def _is_noisy(steps: Array) -> bool:
    """Return True if the noise of a sensor is visible. Without noise, a slow motion in coarse steps may simply have
    ended."""
    changes = steps[steps != 0.0]
    sizes = np.abs(changes)
    turning = np.count_nonzero(changes[1:] * changes[:-1] < 0.0)
    changing = len(changes) >= _CHANGING * len(steps) and turning >= _TURNING * len(changes)
    return bool(changing and np.median(sizes) > _VISIBLE * sizes.min())


def _together(frozen: dict[int, float]) -> list[int]:
    """Return the largest group of sensors that froze together, in the order of the signals."""
    groups = [[n for n, at in frozen.items() if start <= at <= start + _TOGETHER] for start in frozen.values()]
    return max(groups, key=len, default=[])


def _until(signal: Signal, end: float) -> Signal:
    return replace(signal, values=np.where(signal.time < end, signal.values, np.nan))


def _ends(signals: Iterable[Signal]) -> tuple[float, float]:
    times = [signal.time for signal in signals if len(signal.time)]
    return float(min(time[0] for time in times)), float(max(time[-1] for time in times))


def _name(signal: Signal) -> str:
    return signal_name(signal.axis, signal.quantity) if signal.axis else signal.quantity
