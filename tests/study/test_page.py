"""The page about a study shows what is in its data frames."""

import re
from collections.abc import Callable, Iterable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from lxml import html
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from rov_fmu.cli import main
from rov_fmu.io.messages import FileError
from rov_fmu.report.plots.svg import LIGHT
from rov_fmu.study import Results
from rov_fmu.study.results.page import study_page
from rov_fmu.study.results.plots import draw_band, draw_distribution, draw_indices, draw_lines, indices_height
from rov_fmu.study.results.results import statistics
from tests.commands import without_progress
from tests.folders import beside
from tests.report.conftest import Visit
from tests.report.fly.boxes import SCREENS
from tests.report.pages import check_fits_and_is_accessible, check_is_whole
from tests.report.plots.test_identification import bands, bars, lines


def numbers_of(cells: Iterable[str]) -> list[float]:
    return [float(cell.replace("−", "-")) for cell in cells]


def made(folder: Path, fmu: Path, scheduler: str, plan: str, code: int = 0) -> Path:
    """Do a study by the command, which ends with this code, and return the folder of its results."""
    (folder / "plan.toml").write_text(f'fmu = "{beside(fmu, folder)}"\nstop_time = 2.0\nstep = 0.1\n{plan}')
    arguments = [str(folder / "plan.toml"), "-o", str(folder / "results"), "--scheduler", scheduler]
    assert main(["study", *arguments]) == code
    return folder / "results"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, foreign: Callable[..., Path], scheduler: str) -> Path:
    """The results of a study with its page, made by the command in 7 s, of which the workers need 3 s to start.

    Some runs fail; the others lack the figure `odd`.
    """
    folder = tmp_path_factory.mktemp("page")
    plan = """title = "A <foreign> study"
runs = 600
sampler = "saltelli"
[vary]
a.uniform = [0.0, 1.0]
b.normal = { mean = 0.0, sd = 1.0 }
mode.values = [0, 0, 0, 0, 0, 0, 0, 1]
[keep]
outputs = ["y"]
[figures]
offset = "2.0 + 0*b"
end = "y[-1]"
twice = "2 * y[-1]"
odd = "y[y > 1e9][0]"
"""
    with redirect_stdout(StringIO()) as printed, redirect_stderr(printed), pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.study.run.cluster.perf_counter", iter([100.0, 103.0, 107.0]).__next__)
        results = made(folder, foreign(), scheduler, plan, code=1)
    (folder / "printed.txt").write_text(without_progress(printed.getvalue()), encoding="utf-8")
    return results


def test_the_page_has_bands_distributions_indices_and_failures(done: Path) -> None:
    results = Results(done)
    text = (done / "study.html").read_text(encoding="utf-8").partition("\n")[2]  # below the digest
    page = html.fromstring(text)
    rows = {row[0].text_content(): [cell.text_content() for cell in row] for row in page.iter("tr")}
    ended = results.runs[results.runs.status != "failed"]
    assert [element.text_content() for element in page.iter("h1")] == ["A <foreign> study"]
    assert (
        f"Model foreign: 600 of 600 runs, {len(results.failed)} failed, {len(ended)} incomplete." in page.text_content()
    )
    quantiles, drawn = ended.end.quantile([0.05, 0.25, 0.5, 0.75, 0.95]), results.runs.b
    numbers = [*quantiles, ended.end.mean(), ended.end.std(), len(ended)]
    assert numbers_of(rows["end"][1:]) == pytest.approx(numbers, rel=3e-3)
    assert rows["odd"] == ["odd", *"–––––––", "0"]
    assert rows["mode"][1] == "values: 0, 0, 0, 0, 0, 0, …"
    assert rows["b"][1] == "normal: mean 0, sd 1"
    extremes = [drawn.min(), drawn.median(), drawn.max()]
    assert numbers_of(rows["b"][2:5]) == pytest.approx(extremes, rel=1e-3, abs=1e-3)
    index = results.sensitivity("end").loc["b"]
    indices = page.xpath("//h2[@id='sensitivity']/following::table[1]//tr[td/code='b']/td")
    assert float(indices[1].text_content().replace("−", "-")) == pytest.approx(index.S1, abs=1e-3)
    assert "odd has no indices: too few runs have odd." in page.text_content()
    reasons = {
        "incomplete": (ended, "odd: IndexError: index 0 is out of bounds for axis 0 with size 0"),
        "failed": (results.failed, "the step at 1 s: error; the FMU: the pump is blocked"),
    }
    assert [[cell.text_content() for cell in row] for row in page.xpath("//table[last()]//tr")][-2:] == [
        [str(len(some)), status, reason, ", ".join(map(str, some.index[:5]))]
        for status, (some, reason) in reasons.items()
    ]
    printed = [" ".join(line.split()) for line in (done.parent / "printed.txt").read_text("utf-8").splitlines()]
    counts = f"600 runs, {len(results.failed)} failed, {len(ended)} incomplete"
    turned = f"in {sum(abs(ended.end) > 0.5 * np.pi)} of 600 runs the vehicle turned over"
    assert printed[1:4] == [
        f"rov-fmu: warning: {turned}: phi or theta passed 90 degrees",
        f"{done}: {counts}",
        "600 of them now, in 4.0 s; 150 runs/s",
    ]
    three = [f"{number:.5g}" for number in (*quantiles[[0.05, 0.5, 0.95]], ended.end.mean())]
    assert " ".join(["end", *three, str(len(ended))]) in printed
    assert [line for line in printed if " runs: " in line] == [
        f"{len(some)} runs: {reason}" for some, reason in reasons.values()
    ]
    labels = re.findall(r'aria-label="([^"]*)"', text)
    shown = [f"{what} {of}" for what in ("Distribution of", "Sobol indices of") for of in ("end", "twice")]
    assert labels == [*shown, "Trajectories of y"]
    assert text.count('data-plot="{&quot;box') == len(labels), "the script of the page knows each panel"
    check_is_whole(text)
    assert "offset = 2.0 + 0*b does not vary: it is 2 in all" in " ".join(page.text_content().split())
    assert study_page(results) == text, "the page is the same for the same results"
    pd.testing.assert_frame_equal(results.sensitivity("end", seed=1), results.sensitivity("end"))


@pytest.mark.interop
@pytest.mark.parametrize(("width", "scheme"), SCREENS)
def test_the_page_asks_for_nothing_fits_and_is_accessible(
    done: Path, width: int, scheme: str, visit: Callable[..., Visit]
) -> None:
    check_fits_and_is_accessible(visit(width=width, scheme=scheme), done / "study.html")


def test_a_grid_of_one_or_two_variables_has_lines(done: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr("rov_fmu.study.results.plots.inline_svg", lambda label, *_, **__: shown.append(label))
    results = Results(done)
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


def test_a_study_of_which_all_runs_failed_has_a_page_and_nothing_to_plot(
    foreign: Callable[..., Path], tmp_path: Path, scheduler: str
) -> None:
    plan = 'sampler = "grid"\n[set]\nmode = 1\n[keep]\noutputs = ["y"]\n[figures]\nend = "y[-1]"\n'
    results = made(tmp_path, foreign(), scheduler, plan, code=1)
    page = html.parse(results / "study.html")
    assert "1 of 1 runs, 1 failed, 0 incomplete." in page.xpath("string(//body)")
    assert not page.xpath("//svg")
    assert Results(results).trajectories().empty
    assert str(statistics(np.array([2.0]), [0.5])) == "([2.0], 2.0, nan)"


def test_a_grid_shows_figures_over_what_varies_and_says_how_many_rows_and_reasons_are_left_out(
    videoray_fmu: Path, tmp_path: Path, scheduler: str, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = """sampler = "grid"
inputs.u_r = 0.3
[vary]
u_l.values = [0.3, 0.2]
m_rov.range = { from = 5.0, to = 8.0, count = 31 }
[keep]
outputs = ["u"]
[figures]
V = "final(u) - u[0]"
way = "max(x)"
sway = "1.0 * t[0]"
T = "Tau(u)"
far = "u[round(300*m_rov + 30*u_l)]"
"""
    results = made(tmp_path, videoray_fmu, scheduler, plan, code=1)
    printed = " ".join(capsys.readouterr().out.split())
    assert re.findall(r"(\d+) runs: (\w+)", printed) == [*[("1", "far")] * 5, ("57", "other")]
    assert "57 runs: other reasons (57), which are on the page" in printed
    text = (results / "study.html").read_text(encoding="utf-8")
    page, runs = html.fromstring(text), Results(results).runs
    labels = re.findall(r'aria-label="([^"]*)"', text)
    assert labels == [*(f"{name} over m_rov and u_l" for name in ("V", "way", "T")), "Trajectories of u"]
    head, *rows = [
        [cell.text_content() for cell in row] for row in page.xpath("//h2[@id='figures']/following::table[1]//tr")
    ]
    columns = ["u_l", "m_rov", "V", "way", "sway", "T"]
    assert head == ["u_l", "m_rov (kg)", *columns[2:], "far"]
    shown = [numbers_of(row[:-1]) for row in rows]
    assert shown == [pytest.approx(row, rel=1e-5) for row in runs[columns].to_numpy()[:60]]
    assert "And 2 more rows:" in text
    assert (len(page.xpath("//table")[-1].xpath(".//tr")), "And 12 more reasons:" in text) == (51, True)


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


def test_plots_have_all_runs_their_quantiles_and_the_intervals_of_indices() -> None:
    spread, over_time, indices, over_grid = (Figure() for _ in range(4))
    draw_distribution(spread, np.arange(1.0, 101.0), [5.0, 30.0, 50.0, 70.0, 95.0])
    (ax,) = spread.axes
    assert [height for _, _, height in bars(ax)[1:]] == pytest.approx([10.0] * 10), "ten bars of 10 % of the runs"
    assert bars(ax)[0][:2] == (5.0, 90.0)
    assert np.asarray(ax.lines[0].get_xdata()).tolist() == [50.0, 50.0]
    values = np.outer([0.0, 1.0, 2.0], [1.0, 2.0, 3.0, 4.0, 5.0])
    draw_band(over_time, pd.DataFrame(values, [0.0, 0.5, 1.0]), "m/s")
    (ax,) = over_time.axes
    assert {label: y[-1] for label, (_, y) in lines(ax).items()} == {"5 %": 2.0, "median": 6.0, "95 %": 10.0}
    assert [(band[:, 1].max(), band[band[:, 0] == 1.0, 1].min()) for band in bands(ax)] == [(10.0, 2.0), (8.0, 4.0)]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "m/s")
    tells = {"S1_tells": True, "ST_tells": False, "S1_95": 0.1, "ST_95": 0.2}
    draw_indices(indices, [{"name": f"x{n}", "S1": 0.5, "ST": 0.6 + n, **tells} for n in range(15)])
    (ax,) = indices.axes
    alone, with_others = (list(shown) for shown in ax.containers[::2])
    assert [len(alone), len(with_others), len(ax.get_yticks())] == [12] * 3, "the largest twelve"
    assert (alone[0].get_width(), with_others[1].get_width()) == (0.5, 1.6)
    assert alone[0].get_y() < 0.0 == pytest.approx(alone[0].get_y() + alone[0].get_height()), "one above the other"
    assert [to_hex(shown[0].get_facecolor()) for shown in (alone, with_others)] == [LIGHT["blue"], LIGHT["grey"]]
    assert ax.get_xlim() == pytest.approx((-0.02, 1.32))
    assert indices_height(2) < indices_height(12) == indices_height(13)
    runs = pd.DataFrame([(a, b, a * b) for b in range(7) for a in (2.0, 1.0)], columns=["a", "b", "y"])
    draw_lines(over_grid, "y", SimpleNamespace(runs=runs, units={"a": "N.m", "b": "1"}), ["a", "b"])  # type: ignore[arg-type]
    (ax,) = over_grid.axes
    assert lines(ax) == {f"{b}": ([1.0, 2.0], [1.0 * b, 2.0 * b]) for b in (0, 2, 4, 6)}, (
        "four even values of the other"
    )
    assert ax.get_xlabel() == "a (N·m)"
