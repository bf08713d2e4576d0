"""Identify the vehicle of a scenario, and keep what is judged: all of it is read from the result object."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, nan
from pathlib import Path

import numpy as np

from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import Identification, Interval, Prediction
from rov_fmu.io.messages import FileError
from rov_fmu.vehicle.description import Word
from tests.identify.scenarios.scenario import Truths, steady_name
from tests.identify.scenarios.tank import Tank

_POSSIBLE = {
    "lag": (0.0, 2.0),
    "dead time": (0.0, 1.0),
    "dead band": (0.0, 0.3),
    "current": (-1.0, 1.0),
    "reverse thrust": (0.2, 5.0),
    "drag astern": (0.4, 2.5),
    "voltage": (0.0, 4.0),
}
"""The possible values of effects by kind: s, s, commands, m/s, two ratios, and an exponent."""


@dataclass(frozen=True)
class Estimate:
    """A number as it was identified, with its 95 % interval, and its true value."""

    axis: str
    """Empty for a number of a thrust curve."""
    quantity: str
    """A coefficient, or `V_ss 30 %`."""
    value: float
    interval: Interval | None
    truth: float
    narrowed: float = 0.0
    """The standard error relative to that of the prior. 1 if the data told nothing."""

    @property
    def covered(self) -> bool:
        """True if the interval contains the truth. Without an interval it does not."""
        return self.interval is not None and self.interval[0] <= self.truth <= self.interval[1]

    @property
    def error(self) -> float:
        """The relative error; NaN where the truth is 0."""
        return self.value / self.truth - 1.0 if self.truth else nan

    @property
    def width(self) -> float:
        """The width of the interval; NaN without one."""
        return self.interval[1] - self.interval[0] if self.interval else nan


@dataclass(frozen=True)
class Band:
    """A prediction of held-out samples, in squares, so that those of many seeds can be added."""

    axis: str
    quantity: str
    coverage: float
    """The share of the samples inside the 95 % band."""
    error: float
    """The mean square of measured minus predicted."""
    claimed: float
    """The same as the model claims it."""


@dataclass(frozen=True)
class Outcome:
    """What the identification of one seed of a scenario gave."""

    estimates: tuple[Estimate, ...] = ()
    effects: tuple[tuple[str, str, float], ...] = ()
    """The kind of each effect and hypothesis that is reported, what has it, and its value; 0 where it has none."""
    disturbances: tuple[tuple[str, str], ...] = ()
    """The axis of each disturbance that is reported (`thrust` for all of them), and its cause: empty if unknown."""
    verdicts: Mapping[str, Word] = field(default_factory=dict)
    """By axis."""
    bands: tuple[Band, ...] = ()
    error: str = ""
    """The message of a refusal or of a crash; empty without."""
    seconds: float = 0.0
    """The processor time of reading and identification, s."""

    @property
    def unusable(self) -> tuple[str, ...]:
        """The axes whose model should not be used."""
        return tuple(axis for axis, word in self.verdicts.items() if word == "do not use")

    @property
    def alarms(self) -> tuple[str, ...]:
        """The axes whose model does not explain the data: those with a disturbance, and those not to use."""
        return tuple(dict.fromkeys([*(axis for axis, _ in self.disturbances), *self.unusable]))

    @property
    def impossible(self) -> tuple[str, ...]:
        """The effects whose value no vehicle has."""
        limits = [_POSSIBLE.get(kind, (-inf, inf)) for kind, _, _ in self.effects]
        return tuple(
            f"{kind} of {of or 'the vehicle'} {value:.3g}"
            for (kind, of, value), (low, high) in zip(self.effects, limits, strict=True)
            if not low <= value <= high
        )

    def false_effects(self, true: Sequence[str]) -> tuple[str, ...]:
        """Return what has an effect that is not there. `true` has the kinds that are, perhaps of one thing only."""
        return tuple(
            sorted({f"{kind} of {of}" for kind, of, _ in self.effects if not {kind, f"{kind} of {of}"} & {*true}})
        )


def outcome(scenario: Tank, seed: int, folder: Path) -> Outcome:
    """Write the tests of a scenario to a new folder, identify the vehicle from them, and return what is judged."""
    scenario.write(seed, folder)
    begin = time.process_time()
    try:
        result = identify(load_tests(folder))
    except FileError as error:
        return Outcome(error=str(error), seconds=time.process_time() - begin)
    except Exception as error:  # a crash is judged like a refusal, so that the other seeds are still run
        return Outcome(error=f"{type(error).__name__}: {error}", seconds=time.process_time() - begin)
    seconds = time.process_time() - begin
    predictions = [p for axis in result.axes for p in axis.predictions if p.is_judged]
    return read_result(result, scenario.truths(), predictions, seconds)


def read_result(result: Identification, truths: Truths, predictions: Sequence[Prediction], seconds: float) -> Outcome:
    """Return what is judged of a result."""
    return Outcome(
        tuple(_estimates(result, truths)),
        (
            *((effect.kind, effect.of, effect.value) for effect in result.effects if effect.kept),
            *((one.kind, one.of, one.value if isfinite(one.value) else 0.0) for one in result.structures),
        ),
        tuple((d.axis.name if d.axis else "thrust", "") for d in result.disturbances if d.kept),
        {each.axis.name: each.verdict.word for each in result.axes},
        tuple(map(_band, predictions)),
        seconds=seconds,
    )


def _estimates(result: Identification, truths: Truths) -> Iterator[Estimate]:
    """Yield each number that has a truth. One that the result does not have has no interval, and covers nothing.

    Answers to negative commands are judged where there are some.
    """
    found: dict[tuple[str, str], tuple[float, Interval | None, float]] = {}
    for each in result.axes:
        found |= {(each.axis.name, k.name): (k.value, k.interval, k.narrowed) for k in each.known}
        found |= {(each.axis.name, steady_name(a.command)): (*a.steady, 0.0) for a in each.answers}
    for known in result.curves.values():
        found |= {("", k.name): (k.value, k.interval, k.narrowed) for k in known}
    for key, truth in truths.items():
        if key in found or not key[1].startswith("V_ss -"):
            value, interval, narrowed = found.get(key, (nan, None, 1.0))
            yield Estimate(*key, value, interval, truth, narrowed)


def _band(prediction: Prediction) -> Band:
    """Return the coverage and the errors of a prediction, by its samples and not by what the result says of them."""
    error = prediction.measured - prediction.predicted
    there = np.isfinite(error)
    error, deviation = error[there], prediction.deviation[there]
    inside = np.abs(error) <= 1.96 * deviation
    return Band(
        prediction.axis.name,
        prediction.quantity,
        float(np.mean(inside)),
        float(np.mean(error**2)),
        float(np.mean(deviation**2)),
    )
