"""The parameters of every run. They depend only on the plan, its seed and the number of the run."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import isclose, isinf, log
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from rov_fmu.fmus.variable import Variable
from rov_fmu.io.messages import first_of, listed
from rov_fmu.io.toml_file import key_line
from rov_fmu.study.plan.model import unsettable
from rov_fmu.study.plan.plan import Plan, Varied
from rov_fmu.vehicle.uncertainty import NOTHING, Array, Uncertainty
from rov_fmu.vehicle.vehicle import Vehicle

_LARGEST = float(np.finfo(float).max)
_MOST_DRAWN = 50_000_000
"""The largest number of values in a Latin hypercube, which is drawn as a whole: they take 2 GB for some time."""
_SHOWN = 5
_FROM = "vary_from"


class Design:
    """The varied variables and their values: first the estimates, which are drawn jointly, and then the variables of
    [vary], which are independent.

    The estimates are the coefficients that have an interval in the vehicle file `vary_from`, and that the plan itself
    does not give.
    """

    def __init__(self, plan: Plan, variables: Mapping[str, Variable], vehicle: Vehicle | None = None) -> None:
        self._plan, self._has, self._vehicle = plan, variables, vehicle
        self._given = plan.vary.keys() | plan.set.keys()
        self._whole = vehicle.uncertainty if vehicle else NOTHING
        errors = zip(self._whole.names, self._whole.errors.tolist(), strict=True)
        self._known = self._whole.part([name for name, error in errors if error and name not in self._given])
        self.names = (*self._known.names, *plan.vary)
        self.groups = (*self._known.groups, *((name,) for name in plan.vary))
        """The names in groups; variables in different groups are independent."""
        blocks = len(self.groups) + 2 if plan.sampler == "saltelli" else 1
        self.runs = plan.points if plan.sampler == "grid" else -(-(plan.runs or 0) // blocks) * blocks
        """The number of runs."""

    @property
    def mark(self) -> dict[str, Any]:
        """The estimates that the results depend on, as JSON values."""
        known = self._known
        numbers = zip(known.names, known.values.tolist(), known.errors.tolist(), strict=True)
        estimates = {name: {"value": value, "error": error} for name, value, error in numbers}
        return {_FROM: {"estimates": estimates, "correlation": known.correlation.tolist()}} if estimates else {}

    def rows(self, first: int, end: int) -> Array:
        """Return the values from run `first` to the one before `end`: a row per run, a column per variable."""
        draws = {"grid": self._grid, "sobol": self._sobol, "saltelli": self._saltelli, "random": self._random}
        draws["latin-hypercube"] = lambda first, end: self._hypercube[first:end]
        drawn, together = draws[self._plan.sampler](first, end), len(self._known.names)
        found = np.empty_like(drawn)
        found[:, :together] = self._within_bounds.drawn(drawn[:, :together])
        for n, (name, varied) in enumerate(self._plan.vary.items(), together):
            with np.errstate(over="ignore"):
                found[:, n] = _values(varied, self._has[name], drawn[:, n])
        return np.clip(found, -_LARGEST, _LARGEST)

    @cached_property
    def _within_bounds(self) -> Uncertainty:
        """The distribution of the estimates within the bounds of the FMU's variables."""
        known = self._known
        own = np.array([(self._has[name].minimum, self._has[name].maximum) for name in known.names]).reshape(-1, 2)
        bounds = [np.maximum(known.bounds, own)[:, 0], np.minimum(known.bounds, own)[:, 1]]
        return replace(known, bounds=np.column_stack(bounds))

    # ---- Numbers in 0 ... 1: a row for each run, and a column for each variable --------------------------------------

    def _grid(self, first: int, end: int) -> Array:
        """Go through all combinations; the last variable changes fastest."""
        counts = [len(varied.choices or ()) for varied in self._plan.vary.values()]
        places = np.array(np.unravel_index(np.arange(first, end), (1, *counts))).T  # one point without variables
        return np.asarray((places[:, 1:] + 0.5) / counts)

    @cached_property
    def _sequence(self) -> qmc.Sobol:
        """A Sobol sequence with Owen scrambling."""
        return qmc.Sobol(len(self.names) * (1 + (self._plan.sampler == "saltelli")), seed=self._plan.seed)

    def _sobol(self, first: int, end: int) -> Array:
        """Continue after the last number drawn where possible."""
        source = self._sequence
        if first < source.num_generated:
            source.reset()
        if first > source.num_generated:
            source.fast_forward(first - source.num_generated)
        with warnings.catch_warnings():  # about samples whose length is not a power of two
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(source.random(end - first))

    def _saltelli(self, first: int, end: int) -> Array:
        """Draw blocks of rows: a row of a matrix A; for each group, this row with the group's columns of B; the row of
        B.

        The method is that of Saltelli et al. (2010), with groups of correlated variables by Jacques et al. (2006). The
        order is that of SALib. A and B are the halves of a Sobol sequence.
        """
        width, block = len(self.names), len(self.groups) + 2
        rows, start = np.arange(first, end), first // block
        both = self._sobol(start, (end - 1) // block + 1)[rows // block - start]
        drawn, indices = both[:, :width].copy(), rows % block
        for n, group in enumerate(self.groups):
            of_b = (indices == n + 1) | (indices == block - 1)
            for column in map(self.names.index, group):
                drawn[of_b, column] = both[of_b, width + column]
        return drawn

    @cached_property
    def _hypercube(self) -> Array:
        return np.asarray(qmc.LatinHypercube(len(self.names), seed=self._plan.seed).random(self.runs))

    def _random(self, first: int, end: int) -> Array:
        """Draw independent numbers; each run has its own place in the sequence of a generator that can jump."""
        source = np.random.PCG64(self._plan.seed).advance(first * len(self.names))
        return np.random.Generator(source).random((end - first, len(self.names)))

    # ---- What does not fit, and what a reader may not expect ---------------------------------------------------------

    def check(self, inputs: Mapping[str, object]) -> Iterator[str]:
        """Yield a line for each part that does not fit the FMU, or that is also in [set] or one of the inputs."""
        plan, known, width = self._plan, self._known, len(self.names)
        yield from (key_line(_FROM, reason, plan.vary_from) for reason in self._misfits())
        if plan.sampler == "saltelli" and len(known.names) > len(self.groups) == 1:
            reason = "Sobol indices need independent variables, but all varied variables are correlated"
            yield key_line("sampler", reason, plan.sampler)
        for name, varied in plan.vary.items():
            key = f"vary.{name}"
            if reason := unsettable(name, self._has):
                yield key_line(key, reason)
            elif name in plan.set or name in inputs:
                yield key_line(key, "is given in [set] or [inputs] too")
            elif plan.sampler == "grid" and varied.choices is None:
                yield key_line(key, "a grid needs values or a range", varied.model_dump(exclude_none=True))
            else:
                wrong = ((value, self._has[name].wrong(value)) for value in varied.extremes)
                yield from [key_line(key, reason, value) for value, reason in wrong if reason][:1]
        if not (width or plan.vary_from) and plan.sampler != "grid":
            yield 'vary: nothing varies: write [vary], or sampler = "grid" for the one run'
        if plan.sampler == "latin-hypercube" and (plan.runs or 0) * width > _MOST_DRAWN:
            most = f"at most {_MOST_DRAWN // width} runs with {width} variables"
            yield key_line("runs", f"a Latin hypercube is drawn as a whole, {most}", plan.runs)

    def _misfits(self) -> Iterator[str]:
        """Yield why the estimates do not fit."""
        if self._vehicle and not self._vehicle.intervals:
            yield "no coefficient of this vehicle has an interval"
        elif self._vehicle and not self.names:
            yield "nothing varies, because [set] gives every coefficient that has an interval"
        if self._known.names and self._plan.sampler == "grid":
            yield "a grid needs values or a range, but estimated coefficients have distributions"
        for name, value in zip(self._known.names, self._known.values.tolist(), strict=True):
            if reason := unsettable(name, self._has):
                yield reason
            elif reason := self._has[name].wrong(value):
                yield f"{name} of this vehicle does not fit the FMU: it {reason}"

    def warnings(self) -> Iterator[str]:
        """Yield a sentence for each property of the results that a reader may not expect."""
        plan, is_saltelli = self._plan, self._plan.sampler == "saltelli"
        if self._vehicle:
            yield from self._warnings_of(self._vehicle)
        together = [some_of(group) for group in self._known.groups if len(group) > 1]
        if is_saltelli and together:
            yield f"what is correlated has one Sobol index together: {'; '.join(together)}"
        if is_saltelli and self.runs > (plan.runs or 0):
            block = len(self.groups) + 2
            yield f"runs = {plan.runs} becomes {self.runs}, which are {self.runs // block} whole blocks of {block}"

    def _warnings_of(self, vehicle: Vehicle) -> Iterator[str]:
        file, names, has = self._plan.vary_from, self._known.names, self._has
        if (made := vehicle.provenance) and made.verdicts and (axes := vehicle.unfit_axes):
            yield f"the estimates of {file} do not show how far these axes may be off: {', '.join(axes)}"
        alone = [name for name in names if name not in vehicle.estimates]
        if alone and len(names) > 1:
            yield (
                f"no row in [estimates] of {file}: {some_of(alone)} vary as if correlated with nothing, which makes "
                "what was found together far too uncertain"
            )
        for name, row in zip(self._whole.names, self._whole.correlation, strict=True):
            pairs = zip(self._whole.names, row, strict=True)
            if name in self._given and (with_it := [other for other, value in pairs if value and other in names]):
                yield f"the plan gives {name}: its correlation with {some_of(with_it)} in {file} is left out"
        others = vehicle.coefficients.keys() & has.keys() - {*names} - self._given
        differ = [
            f"{name} ({has[name].start:g}, not {value:g})"
            for name, value in vehicle.coefficients.items()
            if name in others and not isclose(has[name].start, value, rel_tol=1e-9)
        ]
        if differ:
            yield f"the FMU has other values than {file} of {some_of(differ)}: the estimates were found beside those"


def some_of(words: Sequence[str]) -> str:
    """Return the first words as a list in a sentence."""
    return listed(first_of(words, _SHOWN))


# ---- From 0 ... 1 to values ------------------------------------------------------------------------------------------


def _values(varied: Varied, variable: Variable, drawn: Array) -> Array:
    if (choices := varied.choices) is not None:
        picked: Array = np.array(choices)[np.minimum((drawn * len(choices)).astype(int), len(choices) - 1)]
        return picked
    if varied.uniform:
        low, high = varied.uniform
        if variable.is_whole:  # every whole number is equally likely
            return np.minimum(np.floor(low + drawn * (high - low + 1.0)), high)
        if isinf(high - low):
            return low + drawn * high - drawn * low
        return low + drawn * (high - low)
    if varied.normal:
        middle, sd = varied.normal.mean, varied.normal.sd
        found = _normal(middle, sd, variable.minimum, variable.maximum, drawn)
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
