"""The page about a study shows what is in its data frames."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import html

from rov_fmu.cli import main
from rov_fmu.study import Results
from rov_fmu.study.results.page import study_page
from tests.folders import beside
from tests.report.pages import check_is_whole


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, foreign: Callable[..., Path], scheduler: str) -> Path:
    """The results of a study with its page, made by the command. Some runs fail; the others lack the figure `odd`."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "plan.toml").write_text(f"""title = "A <foreign> study"
fmu = "{beside(foreign(), folder)}"
stop_time = 2.0
step = 0.1
runs = 600
sampler = "saltelli"
[vary]
a.uniform = [0.0, 1.0]
b.normal = {{ mean = 0.0, sd = 1.0 }}
mode.values = [0, 0, 0, 0, 0, 0, 0, 1]
[keep]
outputs = ["y"]
[figures]
end = "y[-1]"
twice = "2 * y[-1]"
odd = "y[y > 1e9][0]"
offset = "2.0 + 0*b"
""")
    assert main(["study", str(folder / "plan.toml"), "-o", str(folder / "results"), "--scheduler", scheduler]) == 1
    return folder / "results"


def test_the_page_has_bands_distributions_indices_and_failures(done: Path) -> None:
    results = Results(done)
    text = (done / "study.html").read_text(encoding="utf-8")
    page = html.fromstring(text)
    rows = {row[0].text_content(): [cell.text_content() for cell in row] for row in page.iter("tr")}
    ended = results.runs[results.runs.status != "failed"]
    assert [element.text_content() for element in page.iter("h1")] == ["A <foreign> study"]
    assert (
        f"Model foreign: 600 of 600 runs, {len(results.failed)} failed, {len(ended)} incomplete." in page.text_content()
    )
    assert float(rows["end"][3].replace("−", "-")) == pytest.approx(ended.end.median(), rel=1e-3)
    assert rows["end"][-1] == str(len(ended))
    assert rows["odd"][-1] == "0"
    index = results.sensitivity("end").loc["b"]
    indices = page.xpath("//h2[@id='sensitivity']/following::table[1]//tr[td/code='b']/td")
    assert float(indices[1].text_content().replace("−", "-")) == pytest.approx(index.S1, abs=1e-3)
    assert "odd has no indices: too few runs have odd." in page.text_content()
    failed = next(row for row in page.iter("tr") if "the pump is blocked" in row.text_content())
    assert failed[0].text_content() == str(len(results.failed))
    labels = re.findall(r'aria-label="([^"]*)"', text)
    shown = [f"{what} {of}" for what in ("Distribution of", "Sobol indices of") for of in ("end", "twice")]
    assert labels == [*shown, "Trajectories of y"]
    check_is_whole(text)
    assert "offset = 2.0 + 0*b does not vary: it is 2 in all" in " ".join(page.text_content().split())
    assert study_page(results) == text, "the page is the same for the same results"


def test_a_grid_shows_figures_over_what_varies(videoray_fmu: Path, tmp_path: Path, scheduler: str) -> None:
    (tmp_path / "plan.toml").write_text(f"""fmu = "{beside(videoray_fmu, tmp_path)}"
stop_time = 2.0
step = 0.1
sampler = "grid"
inputs.u_r = 0.3
[vary]
u_l.values = [0.3, 0.2]
m_rov.range = {{ from = 6.0, to = 8.0, count = 5 }}
[keep]
outputs = ["u"]
[figures]
V = "final(u) - u[0]"
way = "max(x)"
sway = "1.0 * t[0]"
T = "Tau(u)"
""")
    arguments = [str(tmp_path / "plan.toml"), "-o", str(tmp_path / "results"), "--scheduler", scheduler]
    assert main(["study", *arguments]) == 0
    text = (tmp_path / "results" / "study.html").read_text(encoding="utf-8")
    page, runs = html.fromstring(text), Results(tmp_path / "results").runs
    labels = re.findall(r'aria-label="([^"]*)"', text)
    assert labels == [*(f"{name} over m_rov and u_l" for name in ("V", "way", "T")), "Trajectories of u"]
    head, *rows = [
        [cell.text_content() for cell in row] for row in page.xpath("//h2[@id='figures']/following::table[1]//tr")
    ]
    assert head == ["u_l", "m_rov (kg)", "V", "way", "sway", "T"]
    shown = [[float(cell.replace("−", "-")) for cell in row] for row in rows]
    assert shown == [pytest.approx(row, rel=1e-5) for row in runs[["u_l", "m_rov", "V", "way", "sway", "T"]].to_numpy()]


def test_the_page_shows_which_sobol_indices_are_uncertain(
    foreign: Callable[..., Path], tmp_path: Path, scheduler: str
) -> None:
    """S1 is 1/2 for both terms of `sum`, which 3 blocks do not show and 200 do.

    A term with a millionth of the variance has an index of 0.000, without the sign that chance gives it.
    """
    pages = {}
    for runs in (12, 800):
        plan, results = tmp_path / f"{runs}.toml", tmp_path / f"{runs}"
        plan.write_text(f"""fmu = "{beside(foreign(), tmp_path)}"
stop_time = 1.0
step = 0.5
runs = {runs}
sampler = "saltelli"
[vary]
a.uniform = [0.0, 1.0]
u.uniform = [0.0, 1.0]
[figures]
sum = "a + u"
up = "a + u / 1000"
down = "a - u / 1000"
""")
        assert main(["study", str(plan), "-o", str(results), "--scheduler", scheduler]) == 0
        pages[runs] = html.parse(results / "study.html")
    few, many = (pages[runs].xpath("string(//body)") for runs in (12, 800))
    cells = "//h2[@id='sensitivity']/following::table[1]//td[@class='number same' or @class='number first same']"
    for text in (
        "An index whose whole interval is wider than itself (grey) is uncertain",
        "With so few blocks, the indices",
    ):
        assert text in few
        assert text not in many
    assert pages[12].xpath(cells)
    assert not pages[800].xpath(cells)
    assert "from 200 blocks" in many
    small = [Results(tmp_path / "800").sensitivity(name).loc["u"].S1 for name in ("up", "down")]
    assert -0.0005 < min(small) < -1e-5
    rows = pages[800].xpath("//h2[@id='sensitivity']/following::tr[td/code='u']/td[2]")
    assert [row.text_content() for row in rows[1:3]] == ["0.000", "0.000"]


def test_another_page_of_this_name_is_not_overwritten(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "study.html"
    own.write_text("<p>My studies</p>")
    assert main(["study", str(done.parent / "plan.toml"), "-o", str(tmp_path)]) == 2
    reason = "is not a page of this tool, and would be overwritten. Choose another folder"
    assert capsys.readouterr().err == f"rov-fmu: {own}: {reason}\n"
    assert [*tmp_path.iterdir()] == [own]
    assert own.read_text() == "<p>My studies</p>"
