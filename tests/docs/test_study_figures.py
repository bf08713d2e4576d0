"""What the docs say of figures holds."""

import re
from math import log

import numpy as np

from rov_fmu.study.expression import CONSTANTS, FUNCTIONS
from rov_fmu.study.figures import Figures
from tests.commands import ROOT

DOCS = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")


def test_the_docs_list_all_functions_and_constants_and_no_others() -> None:
    listed = DOCS.split("<!-- functions -->")[1].split("<!-- end of functions -->")[0]
    assert set(re.findall(r"`(\w+)", listed)) == FUNCTIONS.keys() | CONSTANTS.keys()
    assert not FUNCTIONS.keys() & {"quantile", "trapezoid"}, "the docs say what to write for them"


def test_figures_are_as_exact_as_the_docs_say() -> None:
    """Of 1 - exp(-t), with steps that begin anywhere to the point that is sought."""
    told = [
        (float(percent) / 100.0, 1.0 / float(parts or 1))
        for percent, parts in re.findall(r"([\d.]+)\s%\swith\s(?:a\sstep\sof\s)?Tau(?:/(\d+))?", DOCS)
    ]
    assert [step for _, step in told] == [0.1, 0.2, 0.5, 1.0]
    for most, longest in told:
        off, late = [], []
        for step in np.linspace(0.8 * longest, longest, 81):
            t = step * np.arange(round(12.0 / step) + 1)
            (Tau, settled), _ = Figures({"Tau": "Tau(y)", "settled": "settling_time(y)"}, t).of({"y": 1.0 - np.exp(-t)})
            assert Tau is not None
            assert settled is not None
            off.append(Tau - 1.0)
            late.append((settled - log(20.0)) / step)
        assert most / 3.0 < max(off) < 1.2 * most
        assert 0.9 < max(late) < 1.01
