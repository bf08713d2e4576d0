"""The page about a study shows what is in its data frames."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lxml import html

from rov_fmu import Results
from rov_fmu.cli import main
from rov_fmu.io.messages import FileError
from rov_fmu.study.results.page import study_page
from rov_fmu.study.results.results import statistics
from tests.folders import beside
from tests.report.conftest import Visit
from tests.report.fly.boxes import SCREENS
from tests.report.pages import check_fits_and_is_accessible


def made(folder: Path, fmu: Path, scheduler: str, plan: str, code: int = 0) -> Path:
    """Do a study by the command, which ends with this code, and return the folder of its results."""
    (folder / "plan.toml").write_text(f'fmu = "{beside(fmu, folder)}"\nstop_time = 2.0\nstep = 0.1\n{plan}')
    arguments = [str(folder / "plan.toml"), "-o", str(folder / "results"), "--scheduler", scheduler]
    assert main(["study", *arguments]) == code
    return folder / "results"


SOBOL = Path(__file__).parents[1] / "frozen" / "saved" / "sobol"
"""A study of which some runs failed, and the others lack a figure."""


@pytest.mark.interop
@pytest.mark.parametrize(("width", "scheme"), SCREENS)
def test_the_page_asks_for_nothing_fits_and_is_accessible(
    tmp_path: Path, width: int, scheme: str, visit: Callable[..., Visit]
) -> None:
    (tmp_path / "study.html").write_text(study_page(Results(SOBOL)), encoding="utf-8")
    check_fits_and_is_accessible(visit(width=width, scheme=scheme), tmp_path / "study.html")


def test_a_grid_of_one_or_two_variables_has_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr("rov_fmu.study.results.plots.inline_svg", lambda label, *_, **__: shown.append(label))
    results = Results(SOBOL)
    results.plan["sampler"] = "grid"
    for parameters, label in {
        ("a",): "end over a",
        ("mode", "a"): "end over a and mode",
        ("mode", "b", "a"): "Distribution of end",
    }.items():
        results.parameters = parameters
        study_page(results)
        assert shown[0] == label
        shown.clear()


def test_the_page_leads_with_the_figures_and_their_units() -> None:
    results = Results(SOBOL)
    results.units["y"] = "m/s"
    page = html.fromstring(study_page(results))
    leads = {
        p.findtext("code"): p.text_content().replace("\N{MINUS SIGN}", "-") for p in page.xpath("//p[@class='lead']")
    }
    assert {*leads} == {"end", "twice"}, "what varies and has a value"
    for name, lead in leads.items():
        (told,) = re.findall(rf"^{name}: (\S+) m/s, and (\S+) to (\S+) m/s in 90 % of the runs$", lead)
        expected = results.runs[name].quantile([0.5, 0.05, 0.95])
        assert [*map(float, told)] == pytest.approx(expected.tolist(), abs=0.06)
        assert page.xpath(f"string(//tr[td/code='{name}']/td[2])").strip() == "m/s"


@pytest.mark.long
def test_a_study_of_which_all_runs_failed_has_a_page_and_nothing_to_plot(
    foreign: Callable[..., Path], tmp_path: Path, scheduler: str
) -> None:
    plan = 'sampler = "grid"\n[set]\nmode = 1\n[keep]\noutputs = ["y"]\n[figures]\nend = "y[-1]"\n'
    results = made(tmp_path, foreign(), scheduler, plan, code=1)
    page = html.parse(results / "study.html")
    assert "1 of 1 runs, 1 failed, 0 incomplete." in page.xpath("string(//body)")
    assert not page.xpath("//svg")
    assert Results(results).trajectories().empty
    told = statistics(pd.Series([2.0]))
    assert (told["count"], told["50%"], told["mean"], str(told["std"])) == (1.0, 2.0, 2.0, "nan")


@pytest.mark.long
def test_the_page_shows_which_sobol_indices_are_uncertain(
    foreign: Callable[..., Path], tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """S1 is 1/2 for both terms of `sum`, which 15 blocks do not show and 200 do. 16 blocks are no longer few.

    A term with a millionth of the variance has an index of 0.000, without the sign that chance gives it.
    """
    monkeypatch.setattr("rov_fmu.study.results.plots.inline_svg", lambda *_, **__: "")
    pages = {}
    for runs in (60, 64, 800):
        (tmp_path / f"{runs}").mkdir()
        plan = f"""runs = {runs}
sampler = "saltelli"
[vary]
a.uniform = [0.0, 1.0]
u.uniform = [0.0, 1.0]
[figures]
sum = "a + u"
up = "a + u / 1000"
down = "a - u / 1000"
"""
        pages[runs] = html.parse(made(tmp_path / f"{runs}", foreign(), scheduler, plan) / "study.html")
    few, many = (pages[runs].xpath("string(//body)") for runs in (60, 800))
    cells = "//h2[@id='sensitivity']/following::table[1]//td[@class='number same' or @class='number first same']"
    for text in (
        "An index whose whole interval is wider than itself (grey) is uncertain",
        "With so few blocks, the indices",
    ):
        assert text in few
        assert text not in many
    assert "With so few blocks" not in pages[64].xpath("string(//body)")
    assert pages[60].xpath(cells)
    assert not pages[800].xpath(cells)
    assert "from 200 blocks" in many
    small = [Results(tmp_path / "800" / "results").sensitivity(name).loc["u"].S1 for name in ("up", "down")]
    assert -0.0005 < min(small) < -1e-5
    some = Results(tmp_path / "60" / "results")
    some.runs.loc[8:, "sum"] = np.nan
    assert some.sensitivity("sum").shape == (2, 4), "of two blocks"
    some.runs.loc[7, "sum"] = np.nan
    with pytest.raises(FileError, match="too few runs have sum"):
        some.sensitivity("sum")
    rows = pages[800].xpath("//h2[@id='sensitivity']/following::tr[td/code='u']/td[2]")
    assert [row.text_content() for row in rows[1:3]] == ["0.000", "0.000"]
