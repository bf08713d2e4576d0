"""The parameters of every run: they depend on the plan, its seed and the run's number alone."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import log, prod

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from rov_fmu.study.plan.model import Variable
from rov_fmu.study.plan.plan import Plan, Varied
from rov_fmu.vehicle.uncertainty import NOTHING, Uncertainty

Array = npt.NDArray[np.float64]
_Draw = Callable[[int, int], Array]
"""From the first run to the one after the last: numbers in 0 ... 1, a row a run."""


class Design:
    """What varies, and how: first what is known of a vehicle, together, then what the plan tells, each alone."""

    def __init__(self, plan: Plan, variables: Mapping[str, Variable], known: Uncertainty = NOTHING) -> None:
        self._known, self._varied = known, plan.vary
        self._variables, self._planned = variables, plan.runs
        self.names = (*known.names, *plan.vary)
        self.groups = (*known.groups, *((name,) for name in plan.vary))
        """The names; what is in different groups is independent."""
        self.runs = _runs(plan, len(self.groups))
        """How many."""
        width, seed = len(self.names), plan.seed
        places = [[self.names.index(name) for name in group] for group in self.groups]
        draws: dict[str, Callable[[], _Draw]] = {
            "grid": lambda: _grid([len(way.choices or ()) for way in plan.vary.values()]),
            "sobol": lambda: _sobol(width, seed),
            "saltelli": lambda: _saltelli(places, seed),
            "latin-hypercube": lambda: _latin_hypercube(width, seed, self.runs),
            "random": lambda: _random(width, seed),
        }
        self._draw = draws[plan.sampler]()

    def warnings(self) -> Iterator[str]:
        """What the results have in them that a reader may not expect, a sentence each."""
        if self._planned is not None and self.runs > self._planned:
            block = len(self.groups) + 2
            yield f"runs = {self._planned} becomes {self.runs}, which are {self.runs // block} whole blocks of {block}"

    def rows(self, first: int, end: int) -> Array:
        """The values of what varies, a row a run, a column a variable, from the first run to the one before `end`."""
        drawn, together = self._draw(first, end), len(self._known.names)
        found = np.empty_like(drawn)
        found[:, :together] = self._known.drawn(drawn[:, :together])
        for n, (name, way) in enumerate(self._varied.items(), together):
            found[:, n] = _values(way, self._variables[name], drawn[:, n])
        return found


def _runs(plan: Plan, groups: int) -> int:
    if plan.sampler == "grid":
        return prod(len(way.choices or ()) for way in plan.vary.values())
    runs = plan.runs or 0
    block = groups + 2
    return -(-runs // block) * block if plan.sampler == "saltelli" else runs


# ---- From 0 ... 1 to values ------------------------------------------------------------------------------------------


def _values(way: Varied, variable: Variable, drawn: Array) -> Array:
    if (choices := way.choices) is not None:
        picked: Array = np.array(choices)[np.minimum((drawn * len(choices)).astype(int), len(choices) - 1)]
        return picked
    if way.uniform:
        low, high = way.uniform
        if variable.is_whole:  # each whole number is as likely
            return np.minimum(np.floor(low + drawn * (high - low + 1.0)), high)
        return low + drawn * (high - low)
    if way.normal:
        middle, sd = way.normal.mean, way.normal.sd
        found = _normal(middle, sd, variable.minimum, variable.maximum, drawn)
    else:
        assert way.lognormal
        with np.errstate(divide="ignore"):
            low, high = np.log(np.maximum((variable.minimum, variable.maximum), 0.0))
        found = np.exp(_normal(log(way.lognormal.median), way.lognormal.sd, low, high, drawn))
    found = np.clip(found, variable.minimum, variable.maximum)  # but for rounding it is within
    return np.rint(found) if variable.is_whole else found


def _normal(mean: float, sd: float, low: float, high: float, drawn: Array) -> Array:
    """Normal between bounds. What is drawn is kept from 0 and 1 by less than can be told of a million million runs."""
    below, above = ndtr((low - mean) / sd), ndtr((high - mean) / sd)
    inside = np.clip(drawn, 1e-14, 1.0 - 1e-14)
    return np.asarray(mean + sd * ndtri(below + inside * (above - below)))


# ---- Numbers in 0 ... 1 ----------------------------------------------------------------------------------------------


def _grid(counts: Sequence[int]) -> _Draw:
    """Every combination; what is varied last changes first."""

    def draw(first: int, end: int) -> Array:
        left = np.arange(first, end)
        drawn = np.empty((end - first, len(counts)))
        for column in range(len(counts) - 1, -1, -1):
            drawn[:, column] = (left % counts[column] + 0.5) / counts[column]
            left = left // counts[column]
        return drawn

    return draw


def _sobol(width: int, seed: int) -> _Draw:
    """Scrambled (Owen). What was drawn last is the place from which the next ones are reached soonest."""
    source = qmc.Sobol(width, seed=seed)

    def draw(first: int, end: int) -> Array:
        if first < source.num_generated:
            source.reset()
        if first > source.num_generated:
            source.fast_forward(first - source.num_generated)
        with warnings.catch_warnings():  # that a sample is balanced where it is a power of two long
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(source.random(end - first))

    return draw


def _saltelli(groups: Sequence[Sequence[int]], seed: int) -> _Draw:
    """Blocks of rows: one of a matrix A, for each group of columns the same with those of a matrix B, and that of B.

    Saltelli et al. (2010); for groups of what is correlated, Jacques et al. (2006). The order is SALib's. A and B are
    the halves of a Sobol sequence.
    """
    width, block = sum(map(len, groups)), len(groups) + 2
    pairs = _sobol(2 * width, seed)

    def draw(first: int, end: int) -> Array:
        rows = np.arange(first, end)
        start = first // block
        both = pairs(start, (end - 1) // block + 1)[rows // block - start]
        drawn = both[:, :width].copy()
        places = rows % block
        for n, group in enumerate(groups):
            taken = (places == n + 1) | (places == block - 1)
            for column in group:
                drawn[taken, column] = both[taken, width + column]
        return drawn

    return draw


def _latin_hypercube(width: int, seed: int, runs: int) -> _Draw:
    all_of_it = qmc.LatinHypercube(width, seed=seed).random(runs)
    return lambda first, end: all_of_it[first:end]


def _random(width: int, seed: int) -> _Draw:
    """A run has its own place in the sequence of a generator that can go to any place at once."""

    def draw(first: int, end: int) -> Array:
        return np.random.Generator(np.random.PCG64(seed).advance(first * width)).random((end - first, width))

    return draw
