"""Vehicles drawn anew, by kinds of water and logger: are verdicts as honest as intervals?"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rov_fmu.identify.result import Interval
from tests.identify.scenarios.drawn import Battery, Drawn, Fault
from tests.identify.scenarios.outcome import Estimate, Outcome, outcome

_ALL = ("surge", "heave", "yaw")
RIGHT: dict[str, Drawn] = {
    "correct form": Drawn(lag=0.02),
    "lag not asked": Drawn(),
    "sag": Drawn(fault=Fault(sag=0.12)),
    "current": Drawn(fault=Fault(current=0.08)),
    "filtered sensors": Drawn(fault=Fault(filter=0.4)),
    "no velocity sensor": Drawn(_ALL, ("yaw", "heave")),
    "neither velocity nor heading": Drawn(_ALL, ("heave",)),
    "one log per axis": Drawn(alone=True),
    **{f"load of {100.0 * load:g} %": Drawn(("heave",), ("heave",), load=load) for load in (0.002, 0.006, 0.02)},
}
"""The kinds that the model of a log knows."""
WRONG: dict[str, Drawn] = {
    "speed of rotors": Drawn(fault=Fault(rotor=True), lag=0.15),
    "speed of slow rotors": Drawn(fault=Fault(rotor=True), lag=0.3),
    "weak thruster": Drawn(fault=Fault(health=(0.8, 1.0))),
    "dead thruster": Drawn(fault=Fault(health=(1.0, 0.0))),
    "reversed thruster": Drawn(fault=Fault(health=(-1.0, 1.0))),
    "swapped thrusters": Drawn(fault=Fault(is_swapped=True)),
    "slew of 2/s": Drawn(fault=Fault(slew=2.0)),
    "slew of 0.8/s": Drawn(fault=Fault(slew=0.8)),
    "tether": Drawn(fault=Fault(tether=0.5)),
    "knots as m/s": Drawn(fault=Fault(unit=1.944)),
    "saturation": Drawn(fault=Fault(saturation=0.5)),
    "cubic thrust": Drawn(power=3.0),
    "late sensors": Drawn(fault=Fault(late=0.3)),
    "feet as m": Drawn(fault=Fault(unit=3.281)),
    "voltage that falls under load": Drawn(fault=Fault(battery=Battery(1.5, droop=0.2))),
    "voltage without a column": Drawn(fault=Fault(battery=Battery(1.5, sag=0.15, droop=0.05))),
}
"""The kinds that it does not know."""
FAR = 3.0
"""An answer is far off if it misses the truth by more half-widths of its interval."""
LEAST_GOOD, MOST_WRONG = 0.9, 0.05
"""The least share of axes of right models that are *good*, and the most of axes with an answer that is far off."""


def off(estimate: Estimate) -> float:
    """Return the error of the logarithm of an answer, in half-widths of its interval."""
    assert estimate.interval
    if not estimate.value * estimate.truth > 0.0:
        return inf
    return abs(log(estimate.value / estimate.truth)) / half_width_of(estimate.interval)


def half_width_of(interval: Interval) -> float:
    """Return half the width of the interval of the logarithm of an answer."""
    low, high = sorted(map(abs, interval))
    return 0.5 * log(high / max(low, 1e-12))


@dataclass(frozen=True)
class Line:
    """What the axes of some vehicles of one kind were called, and how right their answers are."""

    words: Sequence[str]
    """The verdict of each axis."""
    farthest: Sequence[float]
    """How far the farthest answer of each axis is off, in half-widths; NaN without answers."""
    printed: Sequence[Estimate]

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> "Line":
        """Return the line of some vehicles. Axes without answers have no interval to judge."""
        words, farthest, printed = [], [], []
        for o in outcomes:
            for axis, word in o.verdicts.items():
                own = [
                    e
                    for e in o.estimates
                    if e.axis == axis and e.interval and e.quantity[:4] in ("V_ss", "time", "way ")
                ]
                words.append(word)
                farthest.append(max(map(off, own), default=np.nan))
                printed += own
        return cls(words, farthest, printed)

    @property
    def good(self) -> float:
        """The share of the axes that are *good*."""
        return self.words.count("good") / max(len(self.words), 1)

    @property
    def coverage(self) -> float:
        """The share of the intervals that contain the truth."""
        return sum(e.covered for e in self.printed) / max(len(self.printed), 1)

    @property
    def far(self) -> tuple[int, int]:
        """How many axes with an answer that is far off are called *good*, and how many there are."""
        some = [word for word, x in zip(self.words, self.farthest, strict=True) if x > FAR]
        return some.count("good"), len(some)


def broken(kept: Mapping[str, Sequence[Outcome]]) -> Iterator[str]:
    """Yield what verdicts promise and some outcomes do not keep."""
    right = Line.of([o for name, some in kept.items() if name in RIGHT for o in some])
    if right.words and right.good < LEAST_GOOD:
        yield f"only {right.good:.0%} of the axes of right models are good"
    good, far = Line.of([o for some in kept.values() for o in some]).far
    if good > MOST_WRONG * far:
        yield f"{good} of {far} axes with an answer that is off by more than {FAR:g} half-widths are good"
    yield from (f"{name}: {o.error}" for name, some in kept.items() for o in some if o.error)


def run(name: str, seed: int) -> Outcome:
    """Identify a vehicle of a kind."""
    with TemporaryDirectory() as folder:
        return outcome({**RIGHT, **WRONG}[name], seed, Path(folder))
