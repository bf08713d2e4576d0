"""The parameters of a run depend only on its number and the seed, and have the distributions of the plan."""

import numpy as np
import pytest
from SALib.sample import sobol as salib
from scipy import stats

from rov_fmu.fmus.variable import Variable
from rov_fmu.study.plan.plan import Plan
from rov_fmu.study.plan.sampling import Design

SAMPLERS = ["sobol", "latin-hypercube", "random", "saltelli"]
VARIED = {
    "a": {"uniform": (2.0, 3.0)},
    "b": {"normal": {"mean": 1.0, "sd": 2.0}},
    "c": {"lognormal": {"median": 3.0, "sd": 0.5}},
    "d": {"values": (1.0, 4.0, 9.0)},
    "e": {"range": {"from": -1.0, "to": 1.0, "count": 5}},
    "n": {"uniform": (1.0, 6.0)},
    "w": {"uniform": (-1.5e308, 1.5e308)},  # wider than the largest number
}


def _variable(name: str) -> Variable:
    low = 0.0 if name == "b" else -np.inf
    return Variable(name, 0, "Integer" if name == "n" else "Real", "parameter", True, False, low, np.inf, "1", 0.0)


def _design(sampler: str, runs: int | None, seed: int = 7, names: str = "abcdenw") -> Design:
    keys = {"fmu": "v.fmu", "sampler": sampler, "runs": runs, "seed": seed, "stop_time": 1.0, "step": 1.0}
    plan = Plan.model_validate({**keys, "vary": {name: VARIED[name] for name in names}})
    return Design(plan, {name: _variable(name) for name in names})


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_run_has_its_parameters_in_whatever_part_and_order_it_comes(sampler: str) -> None:
    whole = _design(sampler, 400).rows(0, 400)
    parts = _design(sampler, 400)
    for first, end in ((390, 400), (0, 1), (1, 17), (17, 390), (0, 400), (33, 34)):
        assert parts.rows(first, end).tolist() == whole[first:end].tolist()
    assert _design(sampler, 400, seed=8).rows(0, 400).tolist() != whole.tolist()
    if sampler != "latin-hypercube":
        assert _design(sampler, 4000).rows(0, 400).tolist() == whole.tolist()


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_parameters_are_distributed_as_the_plan_says(sampler: str) -> None:
    a, b, c, d, e, n, w = _design(sampler, 8000).rows(0, 8000).T
    cut = stats.truncnorm(-0.5, np.inf, 1.0, 2.0)  # the FMU's minimum is 0
    flat = (a, stats.uniform(2.0, 1.0)), (w / 1.5e308, stats.uniform(-1.0, 2.0))
    for found, expected in (*flat, (b, cut), (c, stats.lognorm(0.5, scale=3.0))):
        assert stats.kstest(found, expected.cdf).statistic < 0.025  # independent numbers exceed this once in 10^4 times
    for found, values in ((d, [1.0, 4.0, 9.0]), (e, [-1.0, -0.5, 0.0, 0.5, 1.0]), (n, [1, 2, 3, 4, 5, 6])):
        there, counts = np.unique(found, return_counts=True)
        assert there.tolist() == values
        assert counts == pytest.approx(8000 / len(values), rel=0.12)


def test_a_grid_has_every_combination_once() -> None:
    design = _design("grid", None, names="de")
    assert design.runs == 15
    rows = design.rows(0, 15).tolist()
    assert rows == [[d, e] for d in (1, 4, 9) for e in (-1, -0.5, 0, 0.5, 1)]
    assert design.rows(4, 9).tolist() == rows[4:9]
    assert _design("grid", None, names="").runs == 1


def test_blocks_of_saltelli_are_in_the_order_of_salib() -> None:
    """SALib scrambles its sample differently, but its analysis needs only the same equal values within each block."""
    ours = _design("saltelli", 5 * 64, names="abc").rows(0, 5 * 64).reshape(64, 5, 3)
    theirs = salib.sample({"num_vars": 3, "names": list("abc"), "bounds": [[0, 1]] * 3}, 64, calc_second_order=False)
    equal = [(block[:, None, :] == block[None, :, :]).tolist() for block in theirs.reshape(64, 5, 3)]
    assert [(block[:, None, :] == block[None, :, :]).tolist() for block in ours] == equal
    rounded = _design("saltelli", 9, names="ab")
    assert (rounded.runs, [*rounded.warnings()]) == (12, ["runs = 9 becomes 12, which are 3 whole blocks of 4"])
