"""The parameters of every run. They depend only on the plan, its seed and the number of the run."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isinf, log

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from rov_fmu.fmus.variable import Variable
from rov_fmu.study.plan.plan import Plan, Varied
from rov_fmu.vehicle.uncertainty import NOTHING, Array, Uncertainty

_LARGEST = float(np.finfo(float).max)
_Draw = Callable[[int, int], Array]
"""A function of the first run and the one after the last; it returns a row of numbers in 0 ... 1 for each run."""


class Design:
    """The varied variables and their values: first the estimates, which are drawn jointly, and then the variables of
    [vary], which are independent."""

    def __init__(self, plan: Plan, variables: Mapping[str, Variable], known: Uncertainty = NOTHING) -> None:
        self._known, self._varied = known, plan.vary
        self._variables, self._planned = variables, plan.runs
        self.names = (*known.names, *plan.vary)
        self.groups = (*known.groups, *((name,) for name in plan.vary))
        """The names in groups; variables in different groups are independent."""
        self.runs = _runs(plan, len(self.groups))
        """The number of runs."""
        width, seed = len(self.names), plan.seed
        indices = [[self.names.index(name) for name in group] for group in self.groups]
        draws: dict[str, Callable[[], _Draw]] = {
            "grid": lambda: _grid([len(varied.choices or ()) for varied in plan.vary.values()]),
            "sobol": lambda: _sobol(width, seed),
            "saltelli": lambda: _saltelli(indices, seed),
            "latin-hypercube": lambda: _latin_hypercube(width, seed, self.runs),
            "random": lambda: _random(width, seed),
        }
        self._draw = draws[plan.sampler]()

    def warnings(self) -> Iterator[str]:
        """Yield a sentence for each property of the results that a reader may not expect."""
        if self._planned is not None and self.runs > self._planned:
            block = len(self.groups) + 2
            yield f"runs = {self._planned} becomes {self.runs}, which are {self.runs // block} whole blocks of {block}"

    def rows(self, first: int, end: int) -> Array:
        """Return the values from run `first` to the one before `end`: a row per run, a column per variable."""
        drawn, together = self._draw(first, end), len(self._known.names)
        found = np.empty_like(drawn)
        found[:, :together] = self._known.drawn(drawn[:, :together])
        for n, (name, varied) in enumerate(self._varied.items(), together):
            with np.errstate(over="ignore"):
                found[:, n] = _values(varied, self._variables[name], drawn[:, n])
        return np.clip(found, -_LARGEST, _LARGEST)


def _runs(plan: Plan, groups: int) -> int:
    if plan.sampler == "grid":
        return plan.points
    runs = plan.runs or 0
    block = groups + 2
    return -(-runs // block) * block if plan.sampler == "saltelli" else runs


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


# ---- Numbers in 0 ... 1 ----------------------------------------------------------------------------------------------


def _grid(counts: Sequence[int]) -> _Draw:
    """Go through all combinations; the last variable changes fastest."""

    def draw(first: int, end: int) -> Array:
        drawn = np.empty((end - first, len(counts)))
        _, *indices = np.unravel_index(np.arange(first, end), (1, *counts))  # a grid without variables has one point
        for column, index in enumerate(indices):
            drawn[:, column] = (index + 0.5) / counts[column]
        return drawn

    return draw


def _sobol(width: int, seed: int) -> _Draw:
    """Draw a Sobol sequence with Owen scrambling, continuing after the last number drawn where possible."""
    source = qmc.Sobol(width, seed=seed)

    def draw(first: int, end: int) -> Array:
        if first < source.num_generated:
            source.reset()
        if first > source.num_generated:
            source.fast_forward(first - source.num_generated)
        with warnings.catch_warnings():  # about samples whose length is not a power of two
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(source.random(end - first))

    return draw


def _saltelli(groups: Sequence[Sequence[int]], seed: int) -> _Draw:
    """Draw blocks of rows: a row of a matrix A; for each group, this row with the group's columns of B; the row of B.

    The method is that of Saltelli et al. (2010), with groups of correlated variables by Jacques et al. (2006). The
    order is that of SALib. A and B are the halves of a Sobol sequence.
    """
    width, block = sum(map(len, groups)), len(groups) + 2
    pairs = _sobol(2 * width, seed)

    def draw(first: int, end: int) -> Array:
        rows = np.arange(first, end)
        start = first // block
        both = pairs(start, (end - 1) // block + 1)[rows // block - start]
        drawn = both[:, :width].copy()
        indices = rows % block
        for n, group in enumerate(groups):
            taken = (indices == n + 1) | (indices == block - 1)
            for column in group:
                drawn[taken, column] = both[taken, width + column]
        return drawn

    return draw


def _latin_hypercube(width: int, seed: int, runs: int) -> _Draw:
    sample = qmc.LatinHypercube(width, seed=seed).random(runs)
    return lambda first, end: sample[first:end]


def _random(width: int, seed: int) -> _Draw:
    """Draw independent numbers; each run has its own place in the sequence of a generator that can jump."""

    def draw(first: int, end: int) -> Array:
        return np.random.Generator(np.random.PCG64(seed).advance(first * width)).random((end - first, width))

    return draw
