"""The page about a study shows what is in its data frames."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from lxml import html
from scipy.stats import spearmanr

from rov_fmu import Results
from rov_fmu.cli import main
from rov_fmu.study.page import study_page
from rov_fmu.study.results import statistics
from tests.folders import beside
from tests.report.conftest import Visit
from tests.report.fly.boxes import SCREENS
from tests.report.pages import check_fits_and_is_accessible

PLAN = """stop_time = 2.0
step = 0.1
runs = 60
time_limit = 60.0
[inputs]
u.steps = [[1.0, 0.5]]
[vary]
a.uniform = [0.0, 1.0]
b.uniform = [0.0, 1.0]
mode.values = [0, 1, 6]
[keep]
outputs = ["y"]
[figures]
end = "y[-1]"
still = "0*a + 2"
bad = "1/(mode - mode)"
"""


def made(folder: Path, fmu: Path, plan: str, code: int = 0) -> Path:
    """Do a study by the command, which ends with this code, and return the folder of its results."""
    (folder / "plan.toml").write_text(f'fmu = "{beside(fmu, folder)}"\n{plan}')
    arguments = [str(folder / "plan.toml"), "-o", str(folder / "results"), "--workers", "2"]
    assert main(["study", *arguments]) == code
    return folder / "results"


def most_with(figure: str, results: Results) -> str:
    """Return the parameter that varied most with a figure, by Spearman's correlation as SciPy computes it."""
    runs = results.runs.dropna(subset=[figure])
    varied = [name for name in results.parameters if runs[name].nunique() > 1]
    most: str = max(varied, key=lambda name: float(abs(spearmanr(runs[figure], runs[name]).statistic)))
    return most


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, foreign: Callable[..., Path]) -> Path:
    """A study of which some runs failed, and the others lack a figure."""
    return made(tmp_path_factory.mktemp("study"), foreign(), PLAN, code=1)


@pytest.mark.interop
@pytest.mark.parametrize(("width", "scheme"), SCREENS)
def test_the_page_asks_for_nothing_fits_and_is_accessible(
    folder: Path, width: int, scheme: str, visit: Callable[..., Visit]
) -> None:
    check_fits_and_is_accessible(visit(width=width, scheme=scheme), folder / "study.html")


def test_the_page_is_one_table_and_its_plots(folder: Path) -> None:
    page, results = html.parse(folder / "study.html"), Results(folder)
    failed, incomplete = len(results.failed), len(results.incomplete)
    assert f"60 of 60 runs, {failed} failed, {incomplete} incomplete." in page.xpath("string(//header)")
    (table,) = page.xpath("//table")
    assert [row.findtext("td/code") for row in table.xpath("tbody/tr")] == ["end", "still", "bad", "a", "b", "mode"]
    heads = [head.text for head in table.xpath("thead/tr/th")]
    for row in table.xpath("tbody/tr"):
        column: Any = results.runs[row.findtext("td/code")]
        texts = [(cell.text or "").strip().replace("\N{MINUS SIGN}", "-") for cell in row]
        cells = dict(zip(heads[1:], texts[1:], strict=True))
        assert [*cells] == ["Least", "5 %", "50 %", "95 %", "Greatest", "Mean", "Standard deviation", "Runs"]
        assert int(cells.pop("Runs")) == column.count()
        expected = [column.min(), *column.quantile([0.05, 0.5, 0.95]), column.max(), column.mean(), column.std()]
        if column.count():
            assert [*map(float, cells.values())] == pytest.approx(expected, rel=1e-3, abs=1e-12)
        else:
            assert {*cells.values()} == {"–"}
    assert table.xpath("string(//tr[td/code='end']/td/div)") == "y[-1]"
    shown = [svg.get("aria-label") for svg in page.xpath("//svg")]
    assert shown == ["Distribution of end", f"end over {most_with('end', results)}", "Trajectories of y"]


def test_the_page_gives_each_reason_with_the_first_runs_that_have_it(folder: Path) -> None:
    results = Results(folder)
    lines = [line.text for line in html.parse(folder / "study.html").xpath("//ul[@class='warnings']/li")]
    assert len(lines) == 3
    counts = [int(line.partition(" ")[0]) for line in lines]
    assert counts == sorted(counts, reverse=True)
    assert sum(counts) == 60
    first = ", ".join(map(str, results.incomplete.index[:5]))
    more = len(results.incomplete) - 5
    assert f"{more + 5} runs are incomplete ({first} and {more} more): bad: division by zero." in lines
    assert any(line.endswith("setting the inputs at 1 s: discard.") and " runs are failed (" in line for line in lines)


def test_units_and_descriptions_stand_below_the_names(folder: Path) -> None:
    results = Results(folder)
    results.units["a"], results.descriptions["a"] = "N.m", "A moment <b>"
    page = html.fromstring(study_page(results))
    assert page.xpath("string(//tr[td/code='a']/td[1])") == "a (N·m)A moment <b>"


def test_a_grid_of_one_or_two_variables_has_lines(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr("rov_fmu.study.plots.inline_svg", lambda label, *_, **__: shown.append(label))
    results = Results(folder)
    results.plan["sampler"] = "grid"
    for parameters, labels in {
        ("a",): ["end over a"],
        ("mode", "a"): ["end over a and mode"],
        ("mode", "b", "a"): ["Distribution of end", f"end over {most_with('end', results)}"],
    }.items():
        results.parameters = parameters
        page = study_page(results)
        assert shown == [*labels, "Trajectories of y"]
        assert ("A line for each of up to four values of <code>mode</code>" in page) == (len(parameters) == 2)
        assert ("Distributions: share of the runs" in page) == (len(parameters) == 3)
        shown.clear()


def test_a_study_of_which_all_runs_failed_has_a_page_and_nothing_to_plot(
    foreign: Callable[..., Path], tmp_path: Path
) -> None:
    plan = (
        'stop_time = 2.0\nstep = 0.1\nsampler = "grid"\n[set]\nmode = 1\n[keep]\noutputs = ["y"]\n'
        '[figures]\nend = "y[-1]"\n'
    )
    results = made(tmp_path, foreign(), plan, code=1)
    page = html.parse(results / "study.html")
    assert "1 of 1 runs, 1 failed, 0 incomplete." in page.xpath("string(//body)")
    assert not page.xpath("//svg")
    assert Results(results).trajectories().empty
    told = statistics(pd.Series([2.0]))
    assert (told["count"], told["50%"], told["mean"], str(told["std"])) == (1.0, 2.0, 2.0, "nan")
    assert np.isnan(statistics(pd.Series([np.nan]))["mean"])
