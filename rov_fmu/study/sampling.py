"""The parameters of every run. They depend only on the plan, its seed and the number of the run."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isclose, log
from pathlib import Path

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.csv_table import read_series
from rov_fmu.io.messages import first_of, listed
from rov_fmu.io.toml_file import key_line
from rov_fmu.study.figures import Array
from rov_fmu.study.model import unsettable
from rov_fmu.study.plan import Plan, Varied
from rov_fmu.vehicle.uncertainty import NOTHING
from rov_fmu.vehicle.vehicle import Vehicle

_MOST_DRAWN = 50_000_000
"""The largest number of values that are drawn: they take 2 GB for some time."""
_NAMED = 5
"""The number of names that a sentence has."""


class Design:
    """The varied variables and their values: the estimates of `vary_from`, which are drawn jointly, and [vary]; or the
    rows of `samples`."""

    def __init__(self, plan: Plan, path: Path, has: Mapping[str, Variable], vehicle: Vehicle | None = None) -> None:
        self._plan, self._has, self._vehicle = plan, has, vehicle
        self._rows: Array | None = None
        self._given = plan.vary.keys() | plan.set.keys()
        if plan.samples:
            table = read_series(path.parent / plan.samples, lambda name: unsettable(name, has), has_time=False)
            self.names = [*table]
            self._rows = np.column_stack([*table.values()])
            self.runs = len(self._rows)
            return
        known = vehicle.uncertainty if vehicle else NOTHING
        errors = zip(known.names, known.errors, strict=True)
        some = known.part([name for name, error in errors if error and name not in self._given])
        own = np.array([(has[n].minimum, has[n].maximum) if n in has else (0, 0) for n in some.names]).reshape(-1, 2)
        bounds = [np.maximum(some.bounds, own)[:, 0], np.minimum(some.bounds, own)[:, 1]]
        self._known = replace(some, bounds=np.column_stack(bounds))
        self.names = [*some.names, *plan.vary]
        self.runs = plan.points if plan.sampler == "grid" else plan.runs or 0

    def rows(self) -> Array:
        """Return all values: a row for each run, and a column for each variable."""
        if self._rows is not None:
            return self._rows
        drawn, together = self._drawn(), len(self._known.names)
        found = np.empty_like(drawn)
        found[:, :together] = self._known.drawn(drawn[:, :together])
        for n, (name, varied) in enumerate(self._plan.vary.items(), together):
            found[:, n] = _values(varied, self._has[name], drawn[:, n])
        return found

    def _drawn(self) -> Array:
        """Return numbers in 0 ... 1: a row for each run, and a column for each variable."""
        width, seed, kind = len(self.names), self._plan.seed, self._plan.sampler
        if kind == "grid":  # the last variable changes fastest
            counts = [len(varied.choices or ()) for varied in self._plan.vary.values()]
            places = np.array(np.unravel_index(np.arange(self.runs), (1, *counts))).T
            return np.asarray((places[:, 1:] + 0.5) / counts)
        if kind == "random":
            return np.random.default_rng(seed).random((self.runs, width))
        with warnings.catch_warnings():  # about samples whose length is not a power of two
            warnings.simplefilter("ignore", UserWarning)
            source = {"sobol": qmc.Sobol, "latin-hypercube": qmc.LatinHypercube}[kind](width, seed=seed)
            return np.asarray(source.random(self.runs))

    def wrong(self, inputs: Mapping[str, object]) -> Iterator[str]:
        """Yield a line for each part that does not fit the FMU, or that is also in [set] or one of the inputs."""
        plan, is_grid = self._plan, self._plan.sampler == "grid"
        if self._vehicle and len(self.names) == len(plan.vary):
            reason = "no coefficient of this vehicle that [vary] and [set] leave has an interval"
            yield key_line("vary_from", reason, plan.vary_from)
        if plan.vary_from and is_grid:
            reason = "a grid needs values or a range, but estimates have distributions"
            yield key_line("vary_from", reason, plan.vary_from)
        for n, name in enumerate(self.names):
            varied = plan.vary.get(name)
            if self._rows is not None:
                key, values = f"samples: {name}", self._rows[:, n].tolist()
            elif varied:
                key, values = f"vary.{name}", varied.extremes
            else:
                key, values = f"vary_from: {name}", self._known.values[n : n + 1].tolist()
            if reason := unsettable(name, self._has):
                yield key_line(key, reason)
            elif name in plan.set or name in inputs:
                yield key_line(key, "is given in [set] or [inputs] too")
            elif is_grid and varied and varied.choices is None:
                yield key_line(key, "a grid needs values or a range", varied.model_dump(exclude_none=True))
            elif wrong := next(((x, why) for x in values if (why := self._has[name].wrong(x))), None):
                yield key_line(key, wrong[1], wrong[0])
        if not self.names and not is_grid:
            yield 'vary: nothing varies: write [vary], or sampler = "grid" for the one run'
        if self.runs * len(self.names) > _MOST_DRAWN:
            most = f"at most {_MOST_DRAWN // len(self.names)} with {len(self.names)} variables"
            yield key_line("runs", f"all are drawn before the first one, {most}", self.runs)

    def warnings(self) -> Iterator[str]:
        """Yield a sentence for each property of the results that a reader may not expect."""
        if not (vehicle := self._vehicle):
            return
        file, known, names = self._plan.vary_from, vehicle.uncertainty, self._known.names
        if (made := vehicle.provenance) and made.verdicts and vehicle.unfit_axes:
            axes = listed(vehicle.unfit_axes)
            yield f"the estimates of {file} do not show how far these axes may be off: {axes}"
        alone = [name for name in names if name not in vehicle.estimates]
        if alone and len(names) > 1:
            yield (
                f"no row in [estimates] of {file}: {_some(alone)} vary as if correlated with nothing, which makes what "
                "was found together far too uncertain"
            )
        for name, row in zip(known.names, known.correlation, strict=True):
            others = [other for other, value in zip(known.names, row, strict=True) if value and other in names]
            if name in self._given and others:
                yield f"the plan gives {name}: its correlation with {_some(others)} in {file} is left out"
        differ = [
            f"{name} ({own.start:g}, not {value:g})"
            for name, value in vehicle.coefficients.items()
            if name not in {*names, *self._given}
            if (own := self._has.get(name)) and not isclose(own.start, value, rel_tol=1e-9)
        ]
        if differ:
            yield f"the FMU has other values than {file} of {_some(differ)}: the estimates were found beside those"


def _some(words: Sequence[str]) -> str:
    """Return the first words as a list in a sentence."""
    return listed(first_of(words, _NAMED))


def _values(varied: Varied, variable: Variable, drawn: Array) -> Array:
    if (choices := varied.choices) is not None:
        picked: Array = np.array(choices)[np.minimum((drawn * len(choices)).astype(int), len(choices) - 1)]
        return picked
    if varied.uniform:
        low, high = varied.uniform
        if variable.is_whole:  # every whole number is equally likely
            return np.minimum(np.floor(low + drawn * (high - low + 1.0)), high)
        return low + drawn * (high - low)
    if varied.normal:
        found = _normal(varied.normal.mean, varied.normal.sd, variable.minimum, variable.maximum, drawn)
    else:
        assert varied.lognormal
        with np.errstate(divide="ignore"):
            low, high = np.log(np.maximum((variable.minimum, variable.maximum), 0.0))
        found = np.exp(_normal(log(varied.lognormal.median), varied.lognormal.sd, low, high, drawn))
    found = np.clip(found, variable.minimum, variable.maximum)  # rounding may exceed the bounds
    return np.rint(found) if variable.is_whole else found


def _normal(mean: float, sd: float, low: float, high: float, drawn: Array) -> Array:
    """Turn numbers in 0 ... 1 into a normal distribution, cut off at bounds; 0 and 1 would be infinite."""
    below, above = ndtr((low - mean) / sd), ndtr((high - mean) / sd)
    inside = np.clip(drawn, 1e-14, 1.0 - 1e-14)
    return np.asarray(mean + sd * ndtri(below + inside * (above - below)))
