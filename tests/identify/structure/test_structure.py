"""Tests of the model's structure: what the model lacks is reported with its recording, and a complete one is not."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from math import radians

import numpy as np
import pytest

from rov_fmu.identify.findings import sentences
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.structure import on_structure
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.tank.description import Requests
from rov_fmu.tank.findings import Finding
from tests.identify.structure.disturbed import SECONDS, SENSORS, Disturbance, Dive, along, by_hand, dive
from tests.pool import NOISE
from tests.vehicles import VIDEORAY

UNKNOWN = VIDEORAY.replaced({f"{key}_{v}": 1.0 for v in "uwr" for key in ("a_d", "b_d", "beta")})
FILES = ("log_1.csv", "log_2.csv")
TILT = radians(10.0)


@dataclass(frozen=True)
class Case:
    """Two recordings of 60 s, along one axis or by hand."""

    axis: Axis | None
    """None for a pilot who moves in all axes at once."""
    sensors: tuple[str, ...]
    disturbance: Disturbance = field(default_factory=Disturbance)
    colour: float = 0.0
    lag: tuple[str, ...] = ()
    """The curves whose lag is fitted."""
    every: int = 1
    logged: bool = False
    cause: str = ""
    """The cause that is reported; empty where several are possible."""

    def dives(self, seed: int) -> list[Dive]:
        """Return both dives. The plans of the first include both the slowest and the fastest."""
        plans = (2 * seed, 2 * seed + 1) if self.axis is None else ((0, 2), (1, 2))[seed % 2]
        return [_dive(self.axis, plan, self.disturbance) for plan in plans]

    def findings(self, seed: int) -> list[Finding]:
        """Return the findings of a seed."""
        random, found = np.random.default_rng(seed), []
        for file, flown in zip(FILES, self.dives(seed), strict=True):
            options = {"colour": self.colour, "every": self.every, "logged": self.logged}
            found += flown.recorded(random, file, self.sensors, **options)  # type: ignore[arg-type]
        fits = fit_recordings(found, UNKNOWN, requests=Requests(self.lag))
        return [finding for fit in fits for finding in on_structure(fit)]


@cache
def _dive(axis: Axis | None, plan: int, disturbance: Disturbance) -> Dive:
    return dive(by_hand(plan) if axis is None else along(axis, plan), disturbance)


COMPLETE = {
    "load, delay, reverse, colour": Case(HEAVE, ("z",), Disturbance(load=0.3, delay=0.15, reverse=0.85), colour=0.9),
    "lag and delay": Case(YAW, ("psi",), Disturbance(lag=0.2, delay=0.1), lag=("rear",)),
    "current": Case(SURGE, ("x",), Disturbance(current=0.1)),
    "slow noise": Case(SURGE, ("u",), colour=0.99),
    "two sensors": Case(HEAVE, ("w", "z"), colour=0.9, logged=True),
    "by hand": Case(None, ("u", "z", "psi"), Disturbance(delay=0.1), colour=0.95, logged=True),
    "switches between rows": Case(None, ("z", "psi"), every=4),
}
DISTURBED = {
    "sag": Case(HEAVE, ("z",), Disturbance(sag=0.1)),
    "logged sag": Case(HEAVE, ("z",), Disturbance(sag=0.1), colour=0.9, logged=True, cause="voltage"),
    "sag in surge": Case(SURGE, ("u",), Disturbance(sag=0.1), logged=True, cause="voltage"),
    "tether": Case(SURGE, ("u",), Disturbance(tether=0.5), cause="tether"),
    "saturation": Case(HEAVE, ("z",), Disturbance(saturation=0.55)),
    "scale": Case(HEAVE, ("w", "z"), Disturbance(scale=1.02), cause="scale"),
}
TILTED = {
    "tilt": Case(None, ("z",), Disturbance(tilt=TILT), colour=0.9),
    "logged tilt": Case(None, ("z",), Disturbance(tilt=TILT), logged=True, cause="pitch"),
}
"""A fit to these takes long."""
BY_DEFAULT = ("load, delay, reverse, colour", "two sensors", "tether")
"""The cases of the default tests, which run one seed."""


def seeds(names: Iterable[str]) -> Iterator[object]:
    """Yield each name with 20 seeds: two of them for the long tests, the others once a week."""
    for name, seed in product(names, range(20)):
        is_default = seed == 0 and name in BY_DEFAULT
        yield pytest.param(name, seed, marks=() if is_default else pytest.mark.long if seed < 2 else pytest.mark.weekly)


@pytest.mark.parametrize(("name", "seed"), [*seeds(COMPLETE)])
def test_a_complete_model_raises_no_alarm(name: str, seed: int) -> None:
    assert COMPLETE[name].findings(seed) == []


@pytest.mark.parametrize(("name", "seed"), [*seeds(DISTURBED)])
def test_a_disturbance_is_reported(name: str, seed: int) -> None:
    check(DISTURBED[name], seed)


@pytest.mark.long
@pytest.mark.parametrize("name", TILTED)
def test_pitch_and_roll_are_reported(name: str) -> None:
    check(TILTED[name], 0)


def check(case: Case, seed: int) -> None:
    """Check that the findings of a seed name a recording, a time, and the cause if there is only one."""
    found = case.findings(seed)
    assert found
    for finding in found:
        assert finding.kind == "unexplained"
        assert finding.file in FILES
        assert 0.0 <= finding.numbers["start"] < SECONDS
        assert case.cause in ("", finding.names["cause"])


@pytest.mark.parametrize("name", [*DISTURBED, *TILTED])
def test_a_disturbance_changes_the_prediction(name: str) -> None:
    case = (DISTURBED | TILTED)[name]
    changes = [
        np.abs((flown.disturbance.scale if sensor == "z" else 1.0) * flown.motion[sensor] - still.motion[sensor]).max()
        / NOISE[SENSORS[sensor][1]]
        for flown, still in zip(case.dives(0), replace(case, disturbance=Disturbance()).dives(0), strict=True)
        for sensor in case.sensors
    ]
    assert max(changes) > 3.0


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.weekly) for n in range(1, 20))])
def test_a_lag_is_suggested_where_a_delay_took_its_place(seed: int) -> None:
    found = Case(YAW, ("psi",), Disturbance(lag=0.25)).findings(seed)
    assert {finding.kind for finding in found} == {"lag suggested"}


def test_the_sentence_names_recordings_time_and_remedy() -> None:
    found = [
        Finding("unexplained", "heave", file=file, names={"cause": "voltage"}, numbers={"start": start})
        for file, start in zip(FILES, (3.2, 41.0), strict=True)
    ]
    (at_once,) = sentences([replace(found[0], numbers={"start": 0.2})])
    assert at_once.startswith("heave: the model does not explain log_1.csv from the start: ")
    (sentence,) = sentences(found)
    when = "after the first 3 ... 41 s"
    assert sentence.startswith(f"heave: the model does not explain log_1.csv and log_2.csv {when}: ")
    assert "`voltage = true`" in sentence


@pytest.mark.long
@pytest.mark.parametrize("sensors", [("z",), ("w", "z")])
def test_a_short_recording_beside_others_is_no_obstacle(sensors: Sequence[str]) -> None:
    """It has too few samples for a spectrum of its noise, and is left out of the tests."""
    case = replace(DISTURBED["sag"], sensors=tuple(sensors))
    random = np.random.default_rng(0)
    long = [r for n, flown in enumerate(case.dives(0)) for r in flown.recorded(random, FILES[n], sensors)]
    few = slice(0, 1200, 40)
    assert long[0].command is not None
    short = replace(
        long[0],
        file="short.csv",
        time=long[0].time[few],
        command=long[0].command[few],
        values=long[0].values[few],
        thrusters={name: values[few] for name, values in long[0].thrusters.items()},
        beside={},
    )
    (fit,) = fit_recordings([*long, short], UNKNOWN)
    assert {finding.file for finding in on_structure(fit)} <= {*FILES}
    assert [*on_structure(fit)]


@pytest.mark.parametrize("sagging", [(1,), pytest.param((0, 1), marks=pytest.mark.long)])
def test_the_only_recording_that_is_unlike_the_others_is_named(sagging: Sequence[int]) -> None:
    """The voltage falls in one of three dives; where it falls in two, none of them is the odd one."""
    random = np.random.default_rng(0)
    files = ("log_1.csv", "log_2.csv", "log_3.csv")
    dives = [_dive(HEAVE, n, Disturbance(sag=0.2 if n in sagging else 0.0)) for n in range(3)]
    found = [r for file, flown in zip(files, dives, strict=True) for r in flown.recorded(random, file, ("z",))]
    (fit,) = fit_recordings(found, UNKNOWN)
    told = {(finding.file, finding.names["cause"]) for finding in on_structure(fit)}
    if len(sagging) == 1:
        assert told == {("log_2.csv", "odd one")}
    else:
        assert told
        assert "odd one" not in {cause for _, cause in told}


@pytest.mark.parametrize(("share", "told"), [pytest.param(0.5e-6, False, marks=pytest.mark.long), (2e-6, True)])
def test_residuals_of_rounding_need_no_explanation(share: float, told: bool) -> None:
    (fit,) = fit_recordings(
        [
            r
            for n, flown in enumerate(DISTURBED["sag"].dives(0))
            for r in flown.recorded(np.random.default_rng(n), FILES[n], ("z",))
        ],
        UNKNOWN,
    )
    simulations = [
        replace(s, measured=s.modelled + s.residuals * share * np.ptp(s.modelled) / np.ptp(s.residuals))
        for s in fit.simulations
    ]
    assert bool([*on_structure(replace(fit, simulations=tuple(simulations)))]) is told
