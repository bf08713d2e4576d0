"""Vehicles drawn anew: are verdicts as honest as intervals? python -m tests.identify.scenarios.verdicts --seeds N.

The table has a line for each kind of water and logger: how many axes are *good*, how many intervals of answers contain
the truth, how far the farthest one is off in half-widths, how wide the intervals are relative to the errors, and the
largest error of predictions over 10 s relative to the noise, R. The kinds are run one after the other, in parts if
wanted: `--keep` keeps the outcomes in a file, and tells all that it has.
"""

import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np

from rov_fmu.identify.assess import EXACT, ROCKING
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


def least_width(estimate: Estimate) -> float:
    """Return the half-width below which no answer is claimed, with its rounding."""
    return 1.02 * (ROCKING if estimate.quantity.startswith("V_ss") else EXACT)


@dataclass(frozen=True)
class Line:
    """A line of the table: what the axes of some vehicles of one kind were called, and how right their answers are."""

    words: Sequence[str]
    """The verdict of each axis."""
    farthest: Sequence[float]
    """How far the farthest answer of each axis is off, in half-widths; NaN without answers."""
    printed: Sequence[Estimate]
    structure: Sequence[float]
    """The error over 10 s of each axis, relative to the noise."""
    seconds: float

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
        structure = [error for o in outcomes for error in o.structure.values()]
        return cls(words, farthest, printed, structure, sum(o.seconds for o in outcomes) / max(len(outcomes), 1))

    @property
    def good(self) -> float:
        """The share of the axes that are *good*."""
        return self.words.count("good") / max(len(self.words), 1)

    @property
    def coverage(self) -> float:
        """The share of the intervals that contain the truth."""
        return sum(e.covered for e in self.printed) / max(len(self.printed), 1)

    @property
    def width(self) -> float:
        """The half-width of the intervals relative to the errors, both RMS of logarithms, of those beyond the least."""
        pairs = [
            (half, log(e.value / e.truth))
            for e in self.printed
            if e.interval and e.value * e.truth > 0.0 and (half := half_width_of(e.interval)) > least_width(e)
        ]
        halves, errors = np.square(pairs).T if pairs else (np.nan, np.nan)
        return float(np.sqrt(np.mean(halves) / np.mean(errors)))

    @property
    def far(self) -> tuple[int, int]:
        """How many axes with an answer that is far off are called *good*, and how many there are."""
        some = [word for word, x in zip(self.words, self.farthest, strict=True) if x > FAR]
        return some.count("good"), len(some)

    @property
    def told(self) -> tuple[str, ...]:
        counts = "/".join(str(self.words.count(word)) for word in ("good", "usable", "do not use"))
        worst = max([x for x in self.farthest if not np.isnan(x)], default=np.nan)
        missed = f"{self.far[0]}/{self.far[1]}"
        R, coverage = max(self.structure, default=np.nan), f"{self.coverage:.1%}"
        return counts, coverage, f"{worst:.1f}", missed, f"{self.width:.1f}", f"{R:.1f}", f"{self.seconds:.1f}"


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


@click.command(help=__doc__)
@click.argument("names", nargs=-1)
@click.option("--seeds", default=2, show_default=True, help="The number of seeds.")
@click.option("--first", default=0, show_default=True, help="The first seed.")
@click.option("--keep", type=click.Path(path_type=Path), help="A file of outcomes to continue.")
def main(names: Sequence[str], seeds: int, first: int, keep: Path | None) -> None:
    """Run all kinds, or those whose names contain one of the words, and print the table."""
    kept: dict[tuple[str, int], Outcome] = pickle.loads(keep.read_bytes()) if keep and keep.exists() else {}
    for seed in range(first, first + seeds):
        for name in (n for n in (*RIGHT, *WRONG) if not names or any(word in n for word in names)):
            if (name, seed) not in kept:
                kept[name, seed] = run(name, seed)
                if keep:
                    keep.write_bytes(pickle.dumps(kept))
    form = "{:30} {:>11} {:>8} {:>9} {:>9} {:>6} {:>6} {:>6}"
    click.echo(form.format("kind", "g/u/do not", "covered", "farthest", "far good", "width", "R", "CPU s"))
    by_kind = {name: [o for (n, _), o in kept.items() if n == name] for name in dict.fromkeys(n for n, _ in kept)}
    everything = {"right": [*RIGHT], "wrong": [*WRONG], "all": [*by_kind]}
    for name, some in [
        *by_kind.items(),
        *((n, [o for k in of for o in by_kind.get(k, [])]) for n, of in everything.items()),
    ]:
        click.echo(form.format(name, *Line.of(some).told) if some else name)
    click.echo("\n".join(broken(by_kind)))


if __name__ == "__main__":
    main()
