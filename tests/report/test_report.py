"""The identification report: whole, self-contained, the same bytes every time, and in the FMU of its vehicle."""

import re
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from lxml import html

from rov_fmu.cli import main
from rov_fmu.fmu.archive import native_content, python_content
from rov_fmu.identify.adapter.tank_tests import kind_of_data, load_tank_tests
from rov_fmu.identify.findings import _SENTENCES, DOUBTS, FACTS, by_heading
from rov_fmu.identify.identification import Identification, compare
from rov_fmu.identify.identify import identify
from rov_fmu.identify.next_test import NextTest
from rov_fmu.identify.recordings.recordings_fit import FittedEffect
from rov_fmu.model.layout import HEAVE, SURGE, YAW
from rov_fmu.model.rov import Rov
from rov_fmu.report import report
from rov_fmu.report.console_results import print_identification
from rov_fmu.report.overview import shown_prediction
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.templates import number, sentence, with_interval
from rov_fmu.tank.findings import Finding
from rov_fmu.vehicle.shipped import PAPER, SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import TESTS
from tests.folders import DOWN, SPEED, folder_of, pulled, read
from tests.identify.test_identification import COMMANDS, FORCES, STEADY, TOP, Tables, folder_with, write_csv, write_rov
from tests.recordings import PLANS, clean, write_log
from tests.report.conftest import Visit
from tests.report.pages import check_breaks_long_words, check_is_whole, check_refers_to_itself_alone, rows, text_of

report_page = partial(report.report_page, made=date(2026, 11, 23))
PAGES = ["of_tables", "of_recordings"]
ONE_AXIS = {"thrust_t200.csv": pulled(40.0, 2.0), "steady_heave.csv": f"{SPEED}\n0.3,0.4\n0.5,0.62\n0.8,1.0\n"}
"""The tank tests of a vehicle with one axis."""


@pytest.fixture(scope="module")
def of_tables() -> Identification:
    """The results of the VideoRay's tank tests that ship."""
    return identify(load_tank_tests(TESTS))


@pytest.fixture(scope="module")
def of_recordings(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    """The results of thrust tests and of recordings of surge and heave."""
    folder, random = tmp_path_factory.mktemp("logs"), np.random.default_rng(1)
    write_rov(folder, thrust_rear=(0.0, 0.7))
    k = load_vehicle(VIDEORAY).rov.replaced({"alpha_u": 1.0, "alpha_w": 1.0, "alpha_r": 1.0})
    for thruster, m in (("rear", SURGE), ("top", HEAVE)):
        rows = [(c, k.force(m, c) + 0.05 * random.standard_normal()) for c in COMMANDS.tolist()]
        write_csv(folder / f"thrust_{thruster}.csv", "command [1],force [N]", rows)
        write_log(folder, "a&b $1", clean(k, m, PLANS[m.name][0], rate=20.0).noisy(random))
    return identify(load_tank_tests(folder))


@pytest.fixture(params=PAGES)
def results(request: pytest.FixtureRequest) -> Identification:
    found: Identification = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="module")
def pages(of_tables: Identification, of_recordings: Identification) -> Mapping[int, str]:
    return {id(found): report_page(found) for found in (of_tables, of_recordings)}


@pytest.fixture
def page(results: Identification, pages: Mapping[int, str]) -> str:
    return pages[id(results)]


def leave_plots_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the plots out, because drawing takes most of the time, and words do not need it."""
    for module in ("rov_fmu.report.report", "rov_fmu.report.page.fmu_page"):
        monkeypatch.setattr(f"{module}.inline_svg", lambda *_: "")


@pytest.fixture
def without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_plots_out(monkeypatch)


def sections(page: str) -> list[str]:
    return [h2.get("id") for h2 in html.fromstring(page).iter("h2")]


def test_the_page_is_whole_loads_nothing_and_answers_three_questions_first(page: str) -> None:
    check_is_whole(page)
    check_refers_to_itself_alone(page)
    assert not list(html.fromstring(page).iter("script"))
    assert sections(page)[:5] == ["overview", "predicts", "known", "next", "warnings"]
    assert "nan" not in re.findall(r"[a-z]+", text_of(page)), "a dash stands where there is no number"


def test_long_words_break(
    of_tables: Identification, pages: Mapping[int, str], tmp_path: Path, visit: Callable[..., Visit]
) -> None:
    check_breaks_long_words(pages[id(of_tables)], tmp_path / "report.html", visit)


@pytest.mark.long
def test_the_same_twice(results: Identification, page: str) -> None:
    assert report_page(results) == page


def test_inputs_coefficients_and_intervals_have_their_rows(results: Identification, page: str) -> None:
    table = rows(page)
    for name, digest in results.tests.inputs.items():
        ((holds, found),) = [row[1:] for row in table if len(row) == 3 and row[0] == name]
        assert holds
        assert found == digest
    coefficients = {row[0]: row for row in reversed(table) if len(row) == 7}  # the first of each name
    for name in results.vehicle.layout.coefficients:
        row, interval = coefficients[name], results.vehicle.intervals.get(name)
        value = results.vehicle.rov[name]
        assert row[2:5] == (with_interval(value, interval) if interval else [number(value, 5), "", ""])
        assert row[6] == results.vehicle.sources[name]


def test_fitted_coefficients_are_in_a_plot_and_a_table(results: Identification, page: str) -> None:
    table = {row[0]: row for row in reversed(rows(page)) if len(row) in (4, 5)}
    fitted = {name for result in results.axes if result.estimate for name in result.estimate.names}
    for name in fitted:
        assert table[name][1:4] == with_interval(results.vehicle.rov[name], results.vehicle.intervals[name])
    (plot,) = [svg for svg in html.fromstring(page).iter("svg") if svg.get("aria-label") == "What is known"]
    labels = {text.text_content() for text in plot.iter("text")}
    assert {"a_d_u", "b_d_w"} <= fitted <= labels
    assert not [label for label in labels if label.startswith(("alpha", "m_rov"))], "what is given, or by convention"


def test_inertia_and_added_mass_follow_from_beta(results: Identification, page: str) -> None:
    """The inertia is m/β, and the smallest β is that of the largest inertia."""
    table = {row[0]: row for row in rows(page) if len(row) == 8 and row[7] in ("kg", "kg·m²")}
    vehicle = results.vehicle
    for axis, own, beta in (("Surge", "m_rov", "beta_u"), ("Heave", "m_rov", "beta_w"), ("Yaw", "I_r", "beta_r")):
        fitted = any(beta in result.estimate.names for result in results.axes if result.estimate)
        assert (axis in table) is fitted
        if fitted:
            low, high = vehicle.intervals[beta]
            ends = vehicle.rov[own] / high, vehicle.rov[own] / low
            total = vehicle.rov[own] / vehicle.rov[beta]
            assert table[axis][1:4] == with_interval(total, ends)
            mass = vehicle.rov[own]
            assert table[axis][4:7] == with_interval(total - mass, (ends[0] - mass, ends[1] - mass))


def test_warnings_points_and_predictions_of_tables(of_tables: Identification, pages: Mapping[int, str]) -> None:
    page = pages[id(of_tables)]
    items = [item.text_content().strip() for item in html.fromstring(page).iter("li")]
    assert of_tables.warnings
    assert {sentence(f"{warning}.") for warning in of_tables.warnings + of_tables.facts} <= set(items)
    table = rows(page)
    for comparison in compare(of_tables):
        for n, p in enumerate(comparison.points):
            numbers = [f"{column[n]:.4g}".replace("-", "−") for column in comparison.columns]
            assert [row for row in table if len(row) == 9 and row[2::2][:3] == numbers and p.source in row[8]]
    assert ["Surge, Vss", "6", "5.3 %", "9.7 %", "16.6 %"] in table
    for words, error in (("Vss of 6 points", "9.7 %"), ("Tau of 4 points", "17.0 %")):
        assert [row for row in table if row[1:2] == [f"{words}, each by a fit without its thrust"] and row[-1] == error]


@pytest.mark.usefixtures("without_plots")
def test_a_vehicle_of_another_kind_is_compared(of_tables: Identification) -> None:
    heavy = load_vehicle(SHIPPED["bluerov2_heavy"])
    axes = tuple(form for form in heavy.layout.axes if form.axis is not YAW)
    rov = Rov(replace(heavy.layout, axes=axes, coupled=False), heavy.rov.coefficients)
    results = replace(of_tables, against=replace(heavy, rov=rov))
    for comparison in compare(results):
        assert len(comparison.columns) == 3
        assert np.isnan(comparison.columns[-1]).all() == (comparison.result.axis is YAW)
    page = report_page(results)
    assert f"“compared” is {heavy.name}" in " ".join(page.split())
    of_yaw = [row for row in rows(page) if "steady_yaw" in row[-1]]
    assert of_yaw
    assert all(row[-3:-1] == ["–", "–"] for row in of_yaw)


def test_recordings_are_drawn_listed_and_predicted(of_recordings: Identification, pages: Mapping[int, str]) -> None:
    """The errors of predictions are in units, beside no change and the noise of the sensor."""
    page = pages[id(of_recordings)]
    labels = {svg.get("aria-label") for svg in html.fromstring(page).iter("svg")}
    assert {"Thrust: rear", "Thrust: top"} <= labels
    table = rows(page)
    assert ["80 %", "weight 0"] in [[row[0], row[-1]] for row in table if len(row) == 6]
    for result in of_recordings.axes[:2]:
        file = f"log_{result.axis.name}_a&b $1.csv"
        assert f"Recording of {result.axis.name}: {file}" in labels
        assert sum(row[0] == file for row in table) >= len(result.steps) > 0
        first, *others = (row for row in table if row[-1] == f"halves of {file}, each by a fit to the other")
        assert not others
        assert first[:3] == [result.axis.name.capitalize(), "10 s", result.axis.position]
        predicted, unchanged, noise = (float(number) for number in first[3:6])
        assert noise < predicted < 0.1 * unchanged
        assert first[6] == "m"
        whole = [row for row in table if row[1:3] == ["whole recording", "velocity"] and row[-1] == ""]
        assert len(whole) == 2
        assert all(float(row[3]) < 0.3 * float(row[4]) and row[6] == "m/s" for row in whole)


def test_measured_and_fitted_values_stand_side_by_side(of_recordings: Identification, pages: Mapping[int, str]) -> None:
    listed = {
        row[0]: row
        for row in rows(pages[id(of_recordings)])
        if row[4:5] in (["thrust tests of rear"], ["thrust tests of top"])
    }
    assert {*listed} == {"a_t_rear", "b_t_rear", "a_t_top", "b_t_top"}
    for name, row in listed.items():
        measured = of_recordings.thrust[name[4:]].estimate
        assert row[1:4] == with_interval(measured[name], measured.interval(name))
        assert row[5] == with_interval(of_recordings.vehicle.rov[name], of_recordings.vehicle.intervals[name])[0]
        assert row[-1] in ("agree", "they differ")
    assert "A thruster may also push less in motion than when it is held" in text_of(pages[id(of_recordings)])


def test_the_opening_screen_shows_an_unseen_recording_with_its_band(
    of_recordings: Identification, pages: Mapping[int, str]
) -> None:
    """Most of the predicted samples are inside; the band of a prediction by half a recording is an approximation."""
    shown = shown_prediction(of_recordings)
    assert shown
    assert shown.half_band is not None
    assert 0.7 <= (shown.share_inside or 0.0) <= 1.0
    later = shown.later
    assert np.all(shown.half_band[later] < 0.1 * np.ptp(shown.measured))
    page = pages[id(of_recordings)]
    assert shown.file in text_of(page)
    labels = [svg.get("aria-label") for svg in html.fromstring(page).iter("svg")]
    assert labels[:2] == ["Prediction of an unseen recording", "Error of this prediction"]
    assert "Correlation: surge" in labels
    assert "Identification from tank tests · 2026-11-23" in text_of(page)
    assert "a_d: quadratic drag, b_d: linear drag" in text_of(page)
    assert "_u: surge, _w: heave" in text_of(page)


@pytest.mark.usefixtures("without_plots")
def test_a_band_that_misses_most_samples_has_a_consequence(
    of_recordings: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = "so the intervals below may be too narrow"
    assert words not in text_of(report_page(of_recordings))
    shown = shown_prediction(of_recordings)
    assert shown
    assert shown.half_band is not None
    narrow = replace(shown, half_band=0.05 * shown.half_band)
    monkeypatch.setattr("rov_fmu.report.report.shown_prediction", lambda _: narrow)
    assert words in text_of(report_page(of_recordings))


def test_every_kind_of_finding_is_a_fact_a_doubt_or_a_warning() -> None:
    assert {*_SENTENCES} >= FACTS | DOUBTS
    assert not FACTS & DOUBTS
    groups = by_heading([Finding("constant motion", "surge", file="A b.csv", names={"quantity": "depth"})])
    assert groups["Facts"] == ("A b.csv: the recording of surge is left out: the depth never changes",)
    assert sentence("a b.csv: 3 pulses of 0 or 65535 us, -55%") == "a b.csv: 3 pulses of 0 or 65535 µs, −55 %"


def test_a_log_of_several_axes_is_a_dive_log(of_recordings: Identification) -> None:
    tests = of_recordings.tests
    assert kind_of_data(tests) == "tank tests"
    dives = {
        axis: tuple(replace(r, file="dive.bin") for r in recordings) for axis, recordings in tests.recordings.items()
    }
    assert kind_of_data(replace(tests, recordings=dives, dives=1)) == "tank tests and a dive log"
    assert kind_of_data(replace(tests, recordings=dives, dives=1, thrust={})) == "a dive log"


# ---- Without plots ---------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("without_plots")
def test_captions_speak_of_points_only_where_there_are_some(of_recordings: Identification) -> None:
    assert "measured points (bars" in text_of(report_page(of_recordings))
    axes = tuple(replace(result, points=()) for result in of_recordings.axes)
    page = text_of(report_page(replace(of_recordings, axes=axes)))
    assert "measured points" not in page
    assert "Steady velocity and time constant" in page


@pytest.mark.usefixtures("without_plots")
def test_the_next_tests_begin_with_the_worst_axis(of_tables: Identification) -> None:
    def test_of(n: int, interval: tuple[float, float] | None, width: float) -> NextTest:
        return NextTest(
            of_tables.axes[n].axis, PAPER.axes[n].axis.coefficient("a_d"), interval, width, 0.4, f"do {n} < 3"
        )

    tests = [test_of(0, (0.9, 1.1), 0.1), test_of(1, None, np.inf), test_of(2, (0.1, 0.3), 0.5)]
    axes = tuple(replace(result, next_test=test) for result, test in zip(of_tables.axes, tests, strict=True))
    (listed,) = html.fromstring(report_page(replace(of_tables, axes=axes))).iter("ol")
    items = [" ".join(item.text_content().split()) for item in listed.iter("li")]
    assert [item.split(":")[0] for item in items] == ["Heave", "Yaw", "Surge"]
    assert items[0] == "Heave: do 1 < 3. It makes a_d_w identifiable, which it is not yet."
    assert items[1].endswith("would shrink to 40 % of its width.")


@pytest.mark.usefixtures("without_plots")
def test_other_effects_are_listed_kept_or_not(of_recordings: Identification) -> None:
    heave = of_recordings.axes[1]
    assert heave.recordings
    file = heave.recordings.simulations[0].recording.file
    acts = (
        FittedEffect("load", "heave", "N", -0.25, (-0.3, -0.2), kept=True),
        FittedEffect("delay", "heave", "s", 0.21, (0.2, 0.22), kept=True),
        FittedEffect("delay", file, "s", 0.001, None, kept=False),
    )
    axes = (of_recordings.axes[0], replace(heave, recordings=replace(heave.recordings, effects=acts)))
    page = report_page(replace(of_recordings, axes=axes))
    assert ["Constant load", "heave", "−0.25", "−0.30", "−0.20", "N", "kept"] in rows(page)
    assert ["Delay from the commands to the motion", file, "0.001000", "", "", "s", "left at 0"] in rows(page)
    assert "The fitted delay of 0.21 s is shaded." in text_of(page)
    folded = [fold.text_content() for fold in html.fromstring(page).iter("details")]
    assert any(
        "Effects that were looked for in single recordings, and left at zero: 1" in fold and file in fold
        for fold in folded
    )


@pytest.mark.usefixtures("without_plots")
def test_long_tables_are_folded_without_a_script(of_recordings: Identification) -> None:
    surge = of_recordings.axes[0]
    many = replace(of_recordings, axes=(replace(surge, steps=surge.steps[:1] * 201),))
    root = html.fromstring(report_page(many))
    (fold,) = [fold for fold in root.iter("details") if fold.find("summary").text == "Held commands: 201 rows"]
    assert len(list(fold.iter("tr"))) == 202
    assert not [fold for fold in root.iter("details") if fold.get("open") is not None]


@pytest.mark.usefixtures("without_plots")
def test_the_report_of_another_vehicle_speaks_of_it_alone(tmp_path: Path) -> None:
    results = identify(read(tmp_path / "mine", DOWN, ONE_AXIS))
    page = report_page(results)
    assert sections(page)[-3:] == ["thrust", "heave", "inputs"]
    assert not re.search(r"videoray|rear|top thruster|surge|yaw", text_of(page), re.IGNORECASE)


# ---- The same in the terminal ----------------------------------------------------------------------------------------


def test_the_printout_is_short_and_says_the_same(
    of_recordings: Identification, capsys: pytest.CaptureFixture[str]
) -> None:
    surge, heave, *others = of_recordings.axes
    assert heave.recordings
    acts = (FittedEffect("delay", "heave", "s", 0.21, (0.2, 0.22), kept=True),)
    heave = replace(
        heave,
        recordings=replace(heave.recordings, effects=acts),
        next_test=NextTest(HEAVE, "a_d_w", (10.0, 20.0), 0.5, 0.25, "a dive"),
    )
    print_identification(replace(of_recordings, axes=(surge, heave, *others)))
    out = capsys.readouterr().out
    words = [" ".join(line.split()) for line in out.splitlines()]
    (first,) = (line for line in words if line.startswith("heave depth, 10 s"))
    predicted, unchanged, noise = (float(n) for n in first.split()[4:10:2])
    assert noise < predicted < 3.0 * noise < 0.1 * unchanged
    assert first.endswith(" halves of log_heave_a&b $1.csv")
    assert "What else acts: delay from the commands to the motion (heave 0.210 s)." in words
    assert any(line.startswith("To measure next: heave: a dive (narrows a_d_w by 75%).") for line in words)
    order = [
        out.index(part)
        for part in ("RMS errors of predictions", "Identified coefficients", "What else acts", "To measure")
    ]
    assert order == sorted(order)
    assert len(words) < 24


# ---- Any data -------------------------------------------------------------------------------------------------------

CASES: Mapping[str, Tables] = {
    "no more than a fit needs": {"steady_yaw": [(0.3, 1.5), (0.6, 3.1)], "thrust_top": TOP[1:3]},
    "one thrust": {"steady_heave": [(0.3, 0.163)]},
    "drag at its bound": {"steady_heave": [(0.2, 0.2), (0.5, 0.28), (0.7, 0.36)]},
    "backward too": {"thrust_rear": [*FORCES, (-0.5, -8.0)], "steady_heave": [*STEADY["heave"], (-0.5, -0.25)]},
    "no warning but of Tau": {},
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_any_data(case: str, tmp_path: Path) -> None:
    text = text_of(report_page(folder_with(tmp_path, CASES[case])))
    assert "nan" not in re.findall(r"[a-z]+", text)
    assert "inf" not in re.findall(r"[a-z]+", text)


@pytest.mark.usefixtures("without_plots")
def test_text_of_the_files_is_escaped(of_tables: Identification) -> None:
    odd = replace(of_tables, vehicle=replace(of_tables.vehicle, name='<script>$1</script> & "Söhne"'))
    root = html.fromstring(report_page(odd))
    assert root.findtext(".//h1") == odd.vehicle.name
    assert not list(root.iter("script"))


# ---- The file, and the FMU -------------------------------------------------------------------------------------------


def test_a_report_that_cannot_be_written_leaves_no_vehicle_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = str(tmp_path / "no" / "report.html")
    assert main(["identify", str(TESTS), "--report", report, "-o", str(tmp_path / "v.toml")]) == 2
    error = capsys.readouterr().err
    assert "there is no folder" in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.fixture
def identified(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A vehicle file that names its report, which is in a folder of its own."""
    leave_plots_out(monkeypatch)
    (tmp_path / "pages").mkdir()
    options = ["-o", str(tmp_path / "vehicle.toml"), "--report", str(tmp_path / "pages" / "report.html")]
    assert main(["identify", str(folder_of(tmp_path / "tests", DOWN, ONE_AXIS)), *options]) == 0
    return tmp_path / "vehicle.toml"


def test_the_fmu_has_the_report(identified: Path) -> None:
    assert 'report = "pages/report.html"' in identified.read_text(encoding="utf-8")
    vehicle = load_vehicle(identified)
    for content in (native_content(vehicle), python_content(vehicle)):
        report = content.files["documentation/identification.html"]
        assert report == (identified.parent / "pages" / "report.html").read_bytes()
    links = html.fromstring(documentation_page(vehicle)).iter("a")
    assert "identification.html" in [a.get("href") for a in links]


def test_a_report_that_is_gone(identified: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(tmp_path / "pages")
    assert main(["build", str(identified), "-o", str(tmp_path / "out.fmu")]) == 2
    error = capsys.readouterr().err
    assert "provenance.report = 'pages/report.html': there is no such file" in error
    assert error.count("\n") == 1


def test_a_tuned_vehicle_keeps_its_report_where_that_is_inside_its_folder(
    identified: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = identified.parent
    tune = ["tune", str(identified), "--axis", "heave", "--command", "0.3", "--v-ss", "0.175", "-o"]
    assert main([*tune, str(folder / "tuned.toml")]) == 0
    provenance = load_vehicle(folder / "tuned.toml").provenance
    assert provenance
    assert provenance.report
    assert provenance.report.samefile(folder / "pages" / "report.html")
    (folder / "other").mkdir()
    capsys.readouterr()
    assert main([*tune, str(folder / "other" / "tuned.toml")]) == 2
    error = capsys.readouterr().err
    assert "provenance.report = 'pages/report.html': must be inside the folder of the new file" in error
    assert error.count("\n") == 1
    assert not list((folder / "other").iterdir())


def test_a_report_outside_the_folder_of_the_vehicle_file_is_refused_before_the_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other").mkdir()
    report = tmp_path / "report.html"
    assert main(["identify", "no/tests", "-o", str(tmp_path / "other" / "v.toml"), "--report", str(report)]) == 2
    assert capsys.readouterr().err.startswith(f"rov-fmu: {report}: must be inside the folder of ")


# ---- In a browser ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scheme", "width"),
    [
        ("light", 390),
        *(pytest.param(*case, marks=pytest.mark.long) for case in (("dark", 390), ("light", 1440), ("dark", 1440))),
    ],
)
def test_the_page_is_accessible_and_as_wide_as_the_screen(
    page: str, visit: Callable[..., Visit], tmp_path: Path, width: int, scheme: str
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    shown = visit(width=width, scheme=scheme)
    shown.page.goto((tmp_path / "report.html").as_uri())
    assert shown.page.evaluate("document.documentElement.scrollWidth") <= width
    found = axe.Axe().run(shown.page)
    assert not [(one["id"], one["nodes"][0]["html"]) for one in found.response["violations"]]
    widths = shown.page.evaluate("[...document.querySelectorAll('svg')].map((svg) => svg.clientWidth)")
    assert max(widths) - min(widths) <= 2, "so the text of all plots has one size"
    assert not shown.problems()
