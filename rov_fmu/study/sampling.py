"""The parameters of every run. They depend only on the plan, its seed and the number of the run."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.csv_table import CsvFile, finite, read_numbers
from rov_fmu.io.messages import listed, shown
from rov_fmu.io.toml_file import key_line
from rov_fmu.study.figures import Array
from rov_fmu.study.model import unsettable
from rov_fmu.study.plan import Plan, Varied
from rov_fmu.vehicle.uncertainty import NOTHING
from rov_fmu.vehicle.vehicle import Vehicle


class Design:
    """The varied variables and their values: the estimates of `vary_from`, which are drawn jointly, and [vary]; or the
    rows of `samples`."""

    def __init__(self, plan: Plan, path: Path, has: Mapping[str, Variable], vehicle: Vehicle | None = None) -> None:
        self._plan, self._has, self._vehicle = plan, has, vehicle
        self._rows: Array | None = None
        if plan.samples:
            file = CsvFile(path.parent / plan.samples, None)
            _, header = next(iter(file))
            columns = {n: (name, lambda cell, _: finite(cell)) for n, name in enumerate(header)}
            table, *_ = read_numbers(file, header, columns, lambda cell: f" = {shown(cell)}")
            self.names = [*table]
            self._rows = np.column_stack([*table.values()])
            self.runs = len(self._rows)
            return
        known, given = (vehicle.uncertainty if vehicle else NOTHING), plan.vary.keys() | plan.set.keys()
        some = known.part([n for n, error in zip(known.names, known.errors, strict=True) if error and n not in given])
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
        if self._vehicle and not plan.samples and len(self.names) == len(plan.vary):
            yield key_line("vary_from", "no coefficient of this vehicle has an interval", plan.vary_from)
        if plan.samples and (plan.vary or plan.vary_from):
            yield key_line("samples", "has all that varies: leave [vary] and vary_from out", plan.samples)
        if plan.vary_from and is_grid:
            yield key_line("vary_from", "a grid needs values or a range, but estimates have distributions")
        for name in self.names:
            key, varied = f"vary.{name}", plan.vary.get(name)
            values = varied.extremes if varied else []
            if self._rows is not None:
                values = self._rows[:, self.names.index(name)].tolist()
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

    def warnings(self) -> Iterator[str]:
        """Yield a sentence for each property of the results that a reader may not expect."""
        if (vehicle := self._vehicle) and (made := vehicle.provenance) and made.verdicts and vehicle.unfit_axes:
            axes = listed(vehicle.unfit_axes)
            yield f"the estimates of {self._plan.vary_from} do not show how far these axes may be off: {axes}"


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
