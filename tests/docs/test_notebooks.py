"""The pages that are notebooks: their cells run, and the filter and the controller do what the pages say."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.stats import chi2

from tests.commands import ROOT

NOTEBOOKS = [page for page in sorted((ROOT / "docs").glob("*.md")) if page.read_text("utf-8").startswith("---\nfile_f")]
CELL = re.compile(r"^```\{code-cell\} ipython3\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@contextmanager
def namespace_of(name: str) -> Iterator[dict[str, Any]]:
    """Run the cells of a notebook without Jupyter, and yield their variables. Its figures are closed in the end."""
    plt.switch_backend("Agg")
    variables: dict[str, Any] = {}
    try:
        for cell in CELL.findall((ROOT / "docs" / name).read_text(encoding="utf-8")):
            exec(compile(cell, name, "exec"), variables)
        yield variables
    finally:
        plt.close("all")


def test_the_notebooks_are_found() -> None:
    names = {"filter.md", "controller.md", "tutorial-dive-log.md", "tutorial-tank-tests.md"}
    assert {page.name for page in NOTEBOOKS} == names


@pytest.mark.parametrize("page", NOTEBOOKS, ids=lambda page: page.name)
def test_a_notebook_can_be_downloaded_and_has_cells(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert f"<{page.stem}.ipynb>`" in text
    assert len(CELL.findall(text)) == text.count("{code-cell}") > 0


@pytest.mark.long
def test_the_filter_is_consistent() -> None:
    """The squared errors, normalised by the covariance, have a chi-square distribution over the flights."""
    with namespace_of("filter.md") as found:
        flights, quantities = found["FLIGHTS"], len(found["SHOWN"])
        end, whole = found["nees"][True][:, -1], found["nees"][True].mean()
        assert flights * quantities == 40
        low, high = chi2.ppf([0.005, 0.995], flights * quantities)
        assert low <= end.sum() <= high
        assert whole == pytest.approx(quantities, rel=0.15)
        assert found["nees"][False].mean() > 1.05 * whole
        covered = found["covered"]
        for name in ("u", "r", *found["SHOWN"]):
            assert 0.9 <= covered[True][found["PLACE"][name]] <= 0.99, name
        assert covered[False][found["PLACE"]["u"]] < covered[True][found["PLACE"]["u"]] - 0.01


@pytest.mark.weekly
def test_the_controller_holds_station() -> None:
    """All drawn vehicles turn into the current and stay within 8 cm."""
    with namespace_of("controller.md") as found:
        assert len(found["distances"]) == 6
        assert max(found["distances"]) < 0.08
        for states, commands, _ in found["flights"]:
            assert np.degrees(states[-1, found["PLACE"]["psi"]]) == pytest.approx(found["into"], abs=2.0)
            assert np.abs(commands).max() <= found["MOST"] + 1e-6
        assert np.median(found["times"]) < 1e3 * found["H"]
