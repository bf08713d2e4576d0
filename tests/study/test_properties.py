"""The parameters of a run depend only on its number and the seed, and have the distributions of the plan."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from rov_fmu.fmus.variable import Variable
from rov_fmu.study.plan import Plan
from rov_fmu.study.sampling import Design

SAMPLERS = ["sobol", "latin-hypercube", "random"]
VARIED = {
    "a": {"uniform": (2.0, 3.0)},
    "b": {"normal": {"mean": 1.0, "sd": 2.0}},
    "c": {"lognormal": {"median": 3.0, "sd": 0.5}},
    "d": {"values": (1.0, 4.0, 9.0)},
    "e": {"range": {"from": -1.0, "to": 1.0, "count": 5}},
    "n": {"uniform": (1.0, 6.0)},
}


def _variable(name: str) -> Variable:
    low = 0.0 if name == "b" else -np.inf
    return Variable(name, 0, "Integer" if name == "n" else "Real", "parameter", True, False, low, np.inf, "1", 0.0)


def _design(sampler: str, runs: int | None, seed: int = 7, names: str = "abcden") -> Design:
    keys = {"fmu": "v.fmu", "sampler": sampler, "runs": runs, "seed": seed, "stop_time": 1.0, "step": 1.0}
    plan = Plan.model_validate({**keys, "vary": {name: VARIED[name] for name in names}})
    return Design(plan, Path("plan.toml"), {name: _variable(name) for name in names})


@pytest.mark.parametrize("sampler", ["sobol", "random"])
def test_a_run_has_its_parameters_in_a_plan_with_more_runs(sampler: str) -> None:
    assert _design(sampler, 4000).rows()[:400].tolist() == _design(sampler, 400).rows().tolist()
    assert _design(sampler, 400, seed=8).rows().tolist() != _design(sampler, 400).rows().tolist()


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_parameters_are_distributed_as_the_plan_says(sampler: str) -> None:
    a, b, c, d, e, n = _design(sampler, 8000).rows().T
    cut = stats.truncnorm(-0.5, np.inf, 1.0, 2.0)  # the FMU's minimum is 0
    flat = ((a, stats.uniform(2.0, 1.0)),)
    for found, expected in (*flat, (b, cut), (c, stats.lognorm(0.5, scale=3.0))):
        assert stats.kstest(found, expected.cdf).statistic < 0.025  # independent numbers exceed this once in 10^4 times
    for found, values in ((d, [1.0, 4.0, 9.0]), (e, [-1.0, -0.5, 0.0, 0.5, 1.0]), (n, [1, 2, 3, 4, 5, 6])):
        there, counts = np.unique(found, return_counts=True)
        assert there.tolist() == values
        assert counts == pytest.approx(8000 / len(values), rel=0.12)


def test_a_grid_has_every_combination_once() -> None:
    design = _design("grid", None, names="de")
    assert design.runs == 15
    rows = design.rows().tolist()
    assert rows == [[d, e] for d in (1, 4, 9) for e in (-1, -0.5, 0, 0.5, 1)]
    assert _design("grid", None, names="").runs == 1
