"""The identification report: whole, self-contained, the same bytes every time, and in the FMU of its vehicle."""

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from functools import partial
from hashlib import sha256
from io import StringIO
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from lxml import html

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.fmu.archive import native_content, python_content
from rov_fmu.identify import assess
from rov_fmu.identify.findings import STOPPING, next_tests, told
from rov_fmu.identify.result import AxisResult, Identification, Slip
from rov_fmu.io.output import write_whole
from rov_fmu.report import report
from rov_fmu.report.console import _Console
from rov_fmu.report.console_results import print_identification
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.templates import number, readable, sentence, with_interval
from rov_fmu.tank.description import read_description
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import vehicle_output
from tests.commands import TESTS
from tests.folders import HEAD
from tests.report.conftest import Visit
from tests.report.pages import (
    UNFOLD,
    check_breaks_long_words,
    check_is_whole,
    check_refers_to_itself_alone,
    rows,
    text_of,
    unfolded,
)
from tests.report.results import FILES, GOOD, example, without_findings

report_page = partial(report.report_page, made=date(2026, 11, 23))
SECTIONS = [
    *("findings", "predictions", "answers", "known"),
    *("effects", "disturbances", "logging", "tables", "card"),
]
"""What is folded, in its order."""


@pytest.fixture(scope="module")
def page() -> str:
    return report_page(example())


def leave_plots_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the plots out, because drawing takes most of the time, and words do not need it."""
    for module in ("rov_fmu.report.report", "rov_fmu.report.page.fmu_page"):
        monkeypatch.setattr(f"{module}.inline_svg", lambda *_, **__: "")


@pytest.fixture
def without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_plots_out(monkeypatch)


def bare() -> Identification:
    """A result of one axis without logs, tables, effects or anything else that a report shows."""
    result = without_findings()
    axis = AxisResult(SURGE, GOOD, (), (), (), (), None)
    empty: dict[str, Any] = dict.fromkeys(("forces", "effects", "disturbances", "logging", "sensors"), ())
    folder = replace(result.folder, logs=[])
    correlation = (), result.correlation[1][:0, :0]
    return told(replace(result, axes=(axis,), curves={}, folder=folder, correlation=correlation, **empty))


def labels(page: str) -> list[str]:
    return [svg.get("aria-label") for svg in html.fromstring(page).iter("svg")]


def test_the_page_is_whole_loads_nothing_and_answers_the_owners_questions_first(page: str) -> None:
    check_is_whole(page)
    check_refers_to_itself_alone(page)
    root = html.fromstring(page)
    (script,) = root.iter("script")
    digest = base64.b64encode(sha256(script.text.encode()).digest()).decode()
    policy = root.xpath("string(//meta[@http-equiv]/@content)")
    assert policy == f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    folds = root.xpath("//main/details")
    assert [fold.find("div").get("id") for fold in folds] == SECTIONS
    assert not any(fold.get("open") for fold in folds)
    assert "nan" not in re.findall(r"[a-z]+", text_of(page)), "a dash stands where there is no number"
    shown = [h2.text_content() for h2 in root.iter("h2") if h2.getparent().tag != "summary"]
    verdicts = ["Surge: good", "Heave: usable", "Yaw: do not use"]
    assert shown == [*verdicts, "What you can expect", "What to measure next", "Warnings"]


def test_long_words_break(page: str, tmp_path: Path, visit: Callable[..., Visit]) -> None:
    check_breaks_long_words(page, tmp_path / "report.html", visit)


def test_the_same_twice_with_its_progress(page: str) -> None:
    steps: list[tuple[str, float]] = []
    assert report_page(example(), lambda step, share: steps.append((step, share))) == page
    assert [step for step, _ in steps] == [f"drawing: {label}" for label in labels(page)]
    assert [share for _, share in steps] == pytest.approx([n / len(steps) for n in range(len(steps))])


def test_the_first_screen_has_verdicts_answers_the_worst_prediction_and_the_data(page: str) -> None:
    table = rows(page)
    knots = [f"{speed * 3600 / 1852:.2g} knots" for speed in (0.15, 0.25)]
    assert [
        "Downheave",
        f"0.15 m/s0.14 to 0.17{knots[0]}",
        f"0.25 m/s0.23 to 0.28{knots[1]}",
        "0.50 m/s0.45 to 0.550.97 knots",
        "1.00 s0.90 to 1.10",
        "0.50 m0.45 to 0.55",
    ] in table
    assert labels(page)[:2] == ["Main prediction"] * 2, "one of them for phones"
    words = unfolded(page)
    for part in (
        "Yaw: do not useThe bands contain only 40 % of the unseen data. Two starts disagree.",
        "the heading (started again every 10 s) of log_2.csv, predicted from the commands alone by a fit to the other "
        "log",
        "The bands should contain 95 % of the samples; they contain 95 % for surge, 90 % for heave and 40 % for yaw.",
        "Identification from two dive logs · 2026-11-23",
        "2 logs with 120 s in total (log_1.csv, log_2.csv), 3 forces, 9 points, commands of 20 % to 70 %.",
        "The tests had commands of 20 % to 70 %: the speed at 100 % is extrapolated.",
        "Yaw: hold 0.6 for 8 s, then −0.6 for 8 s. V_ss at 50 %, now ±60 %, becomes ±30 %.",
        "Yaw: the prediction of the heading in log_2.csv is off by 52 ° (RMS)",
    ):
        assert part in words


@pytest.mark.usefixtures("without_plots")
def test_ten_questions_of_an_owner_are_answered_before_anything_is_unfolded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The key is the result: V_ss is the command times 1 m/s ahead, and the second of two logs has a depth in cm."""
    wrong = replace(without_findings(), slips=(Slip(FILES[1], "depth", "is it in cm", 20.0),))
    made = report_page(told(wrong), made=date(2026, 11, 23))
    words, forward = unfolded(made), next(row for row in rows(made) if row[0] == "Forwardsurge")
    assert forward[2].startswith("0.500 m/s0.490 to 0.510"), "how fast at half power"
    assert forward[3].startswith("1.00 m/s0.98 to 1.02"), "how fast at full power"
    assert forward[4].startswith("1.00 s0.98 to 1.02"), "how long until it moves"
    assert forward[5].startswith("1.00 m0.98 to 1.02"), "how far it coasts"
    key = {
        "can I trust yaw": "Yaw: do not use",
        "can I trust surge": "Surge: good",
        "from which data": "2 logs with 120 s in total (log_1.csv, log_2.csv)",
        "what is wrong with log_2": "it disagrees with the other log. Check the depth: is it in cm?",
        "what to do first": "First: Repair log_2.csv or take it out of the folder",
        "what to measure next": "Yaw: hold 0.6 for 8 s",
        "how well is an unseen dive predicted": "they contain 95 % for surge, 90 % for heave and 40 % for yaw",
    }
    assert [question for question, answer in key.items() if answer not in words] == []
    told_first = " ".join(" ".join(printed(told(wrong), monkeypatch, 80)).split())
    assert told_first.index("First: Repair log_2.csv") < told_first.index("surge: good")
    assert words.index("First: Repair") < words.index("Surge: good") < words.index("What you can expect")
    assert "Repair" not in unfolded(report_page(example(), made=date(2026, 11, 23)))


def test_findings_stand_under_their_headings(page: str) -> None:
    made = example().vehicle.provenance
    assert made
    lists = {
        ul.get("class"): [" ".join(li.text_content().split()) for li in ul] for ul in html.fromstring(page).iter("ul")
    }
    assert lists["warnings"] == [f"{sentence(warning)}." for warning in made.warnings]
    assert lists["facts"] == [f"{sentence(fact)}." for fact in made.facts]
    assert "doubts" not in lists
    assert sentence("the thrust changes in log_1.csv") == "The thrust changes in log_1.csv"
    assert sentence("a b.csv: 3 pulses of 0 or 65535 us, -55%") == "a b.csv: 3 pulses of 0 or 65535 µs, −55 %"


def test_every_prediction_has_a_row_and_a_plot(page: str) -> None:
    table = rows(page)
    assert ["Surge", "distance", "10 s", "0.050 m", "0.70 m", "0.010 m", "95 %", FILES[1], "the other log"] in table
    assert ["Yaw", "heading", "10 s", "52 °", "40 °", "0.57 °", "40 %", FILES[1], "the other log"] in table
    off = [td.text_content() for td in html.fromstring(page).xpath("//td[contains(@class, 'off')]")]
    assert off == ["52 °"], "worse than no change"
    predicted = [label for label in labels(page) if label.startswith("Prediction of")]
    assert len(predicted) == len(set(predicted)) == 4
    assert predicted[1] == "Prediction of surge: surge velocity of log_2.csv, whole log"


def test_answers_have_their_rows_and_plots(page: str) -> None:
    table = [row[:1] + row[2:] for row in rows(page) if len(row) == 13 and row[1] == "this fit"]
    ends = (0.294, 0.306), (1.633, 1.7), (0.588, 0.612)
    row = [*with_interval(0.3, ends[0]), "m/s", *with_interval(5.0 / 3.0, ends[1]), *with_interval(0.6, ends[2]), "m"]
    assert ["30 %", *row] in table
    assert any(row[:2] == ["−50 %", "−45"] and row[4] == "°/s" for row in table), "yaw in degrees"
    for axis in (SURGE, HEAVE, YAW):
        words = ("Steady velocity", "Time to 63 % of the steady velocity")
        assert {f"{one} over the command: {axis.name}" for one in words} <= {*labels(page)}


def test_coefficients_have_their_prior_and_interval(page: str) -> None:
    table = rows(page)
    row = ["a_d_u", "10.0", "9.0", "11.0", "N·s²/m²", "20 within a factor of 2, from the base", "10 %"]
    assert row in table
    assert ["top thrust".capitalize()] in table
    given = {row[0]: row for row in table if len(row) == 5}
    vehicle = example().vehicle
    assert given["m_rov"][2:] == [number(vehicle["m_rov"], 5), "kg", vehicle.sources["m_rov"]]
    assert "a_d_u" not in given


def test_effects_disturbances_and_sensors_have_their_rows(page: str) -> None:
    table = rows(page)
    assert ["Lag of the thrusters", "top", "0.120", "0.110", "0.130", "s", "50", "reported"] in table
    assert ["Constant load", "heave", "0.010", "−0.50", "0.50", "N", "−3", "not shown by the data"] in table
    assert ["Slow force", "Heave", "2.1 N", "16 %", FILES[1], "41", "unknown", "30"] in table
    assert ["Change of thrust", "All", "1.0 %", "1 %", FILES[0], "–", "unknown", "2"] in table
    assert [FILES[0], "0.1", "−0.080", "−0.090", "−0.070", "0.1"] in table
    assert ["Yaw", "heading", "1200", "1.0 °", "0 °", "0"] in table


def test_points_forces_and_input_files_have_their_rows(page: str) -> None:
    table = rows(page)
    row = ["surge", "V_ss", "30 %", "0.29", "0.3", "+3.4 %", "0.31", "+6.9 %", "m/s", "steady.csv"]
    assert row in table
    assert any(row[0] == "top" and row[2] == "20 %" and row[-1].endswith("(does not count)") for row in table)
    assert "Force over the command: top" in labels(page)
    for name, digest in example().vehicle.provenance.inputs.items():  # type: ignore[union-attr]
        assert f"{name}: SHA3-256 {digest}" in text_of(page)


# ---- Without plots ---------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("without_plots")
def test_the_first_screen_names_the_base(tmp_path: Path) -> None:
    rov_file = tmp_path / "rov.toml"
    rov_file.write_text(f'base = "bluerov2"\n{HEAD}', encoding="utf-8")
    result = example()
    based = replace(result, folder=replace(result.folder, rov_file=read_description(rov_file)))
    assert "commands of 20 % to 70 %. The fit began from the vehicle bluerov2." in unfolded(report_page(based))


@pytest.mark.usefixtures("without_plots")
def test_a_report_of_almost_nothing_says_so() -> None:
    page = report_page(bare())
    check_is_whole(page)
    words = text_of(page)
    for part in (
        "Nothing was predicted: there is no data that the fit had not seen.",
        "No effect besides thrust, drag and inertia was looked for.",
        "None was looked for, because there is no log.",
        "There is no log.",
        "There are no tables of tank tests.",
        "No further test is needed.",
    ):
        assert part in words
    assert "nan" not in re.findall(r"[a-z]+", words)


@pytest.mark.usefixtures("without_plots")
def test_numbers_that_are_not_known_are_dashes() -> None:
    result = without_findings()
    surge, *others = result.axes
    points = tuple(replace(p, held_out=nan) for p in surge.points)
    known = tuple(replace(one, interval=None) for one in surge.known)
    answers = tuple(replace(a, rise=(inf, (inf, inf))) for a in surge.answers)
    axis = replace(surge, points=points, known=known, answers=answers)
    page = report_page(told(replace(result, axes=(axis, *others))))
    assert not {"nan", "inf"} & {*re.findall(r"[a-z]+", text_of(page))}
    assert ["a_d_u", "10", "not determined", "N·s²/m²", "20 within a factor of 2, from the base", "10 %"] in rows(page)


def test_another_fit_is_compared_in_every_table_and_plot_that_it_has_numbers_for() -> None:
    other = load_vehicle(VIDEORAY)
    axes = []
    for result in example().axes:
        predictions = tuple(replace(p, compared=p.predicted + 0.5) for p in result.predictions)
        compared = assess.answers_of_file(other, result.axis)
        axes.append(replace(result, predictions=predictions, compared=compared))
    page = report_page(replace(example(), against=other, axes=tuple(axes)))
    table = rows(page)
    assert f"“Compared” is {other.name}." in unfolded(page)
    V, Tau = other.response(SURGE, 0.5)
    (speed,) = [row[2] for row in table if row[0] == "Forwardsurge"]
    assert speed.endswith(f"compared: {number(V, 3)} m/s")
    (answer,) = [row for row in table if row[:2] == ["50 %", "compared"] and row[5] == "m/s" and float(row[2]) > 1.0]
    assert [float(answer[2]), float(answer[6])] == pytest.approx([V, Tau], rel=1e-3)
    (drag,) = [row for row in table if row[0] == "a_d_u"]
    assert drag[4:6] == [number(other["a_d_u"], 4), "not determined"]
    (error,) = [row for row in table if row[:3] == ["Surge", "distance", "10 s"]]
    assert error[3:5] == ["0.050 m", "0.50 m"]
    (point,) = [row for row in table if row[:4] == ["surge", "V_ss", "50 %", "0.51"]]
    assert float(point[8]) == pytest.approx(V, rel=1e-3)
    (force,) = [row for row in table if row[:3] == ["top", "force", "60 %"]]
    assert float(force[8]) == pytest.approx(other.curve_force(other.layout.curves_by_name["top"], 0.6), rel=1e-3)
    plots = [svg for svg in html.fromstring(page).iter("svg") if "Main" not in svg.get("aria-label")]
    assert all('"compared"' in html.tostring(svg, encoding="unicode").replace("&quot;", '"') for svg in plots)
    assert "compared" not in text_of(report_page(example()))


def test_the_answers_of_a_file_are_those_of_its_vehicle_with_the_intervals_of_its_estimates() -> None:
    vehicle = load_vehicle(SHIPPED["videoray_refit"])
    (half,) = [a for a in assess.answers_of_file(vehicle, HEAVE) if a.command == 0.5]
    assert (half.steady[0], half.rise[0]) == pytest.approx(vehicle.response(HEAVE, 0.5), rel=1e-12)
    low, high = half.steady[1]
    assert 0.8 < low / half.steady[0] < 0.99
    assert 1.01 < high / half.steady[0] < 1.2
    (exact,) = [a for a in assess.answers_of_file(load_vehicle(VIDEORAY), HEAVE) if a.command == 0.5]
    assert exact.steady[1] == (exact.steady[0], exact.steady[0]), "a file without estimates"


@pytest.mark.usefixtures("without_plots")
def test_text_of_the_files_is_escaped() -> None:
    odd = replace(example(), vehicle=replace(example().vehicle, name='<script>$1</script> & "Söhne"'))
    root = html.fromstring(report_page(odd))
    assert root.findtext(".//h1") == odd.vehicle.name
    assert len(list(root.iter("script"))) == 1


# ---- The same in the terminal ----------------------------------------------------------------------------------------


def printed(result: Identification, monkeypatch: pytest.MonkeyPatch, width: int = 80) -> list[str]:
    """The lines that a terminal of this width shows."""
    file = StringIO()

    def terminal() -> _Console:
        return _Console(
            file=file, width=width, force_terminal=True, color_system=None, markup=False, highlight=False, emoji=False
        )

    monkeypatch.setattr("rov_fmu.report.console_results.console", terminal)
    print_identification(result)
    return [line.rstrip() for line in file.getvalue().splitlines()]


def test_the_printout_has_the_words_of_the_report_and_answers_the_owners_questions_first(
    monkeypatch: pytest.MonkeyPatch, page: str
) -> None:
    lines = printed(example(), monkeypatch, 100)
    assert max(map(len, lines)) <= 100
    cells = [re.split(r"  +", line) for line in lines]
    speeds = [f"{speed} m/s ±2%" for speed in ("0.300", "0.500", "1.00")]
    assert ["forward (surge)", *speeds, "1.00 s ±2%", "1.00 m ±2%"] in cells
    assert ["yaw heading, 10 s ahead", "52 deg", "40 deg", "0.57 deg"] in cells
    text = " ".join(" ".join(lines).split())
    made = example().vehicle.provenance
    assert made
    parts = [
        "Tadpole. Two dives in a pond",
        *(f"- {verdict}" for verdict in made.verdicts),
        "What to expect, with 95% intervals",
        STOPPING,
        "Unseen data, RMS",
        "What else acts: lag of the thrusters (top 0.12 s)",
        *(f"- {warning}" for warning in made.warnings),
        "The report has 4 more doubts and facts.",
        *(f"To measure next: {words}" for words in next_tests(example())),
    ]
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    shown = unfolded(page).casefold()
    for sentence_ in (STOPPING, *made.warnings, *next_tests(example()), *example().axes[2].verdict.reasons):
        assert readable(sentence_).casefold() in shown


@pytest.mark.parametrize("width", [40, 80])
def test_a_narrow_terminal_gets_several_tables_and_no_number_is_broken(
    monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    lines = printed(example(), monkeypatch, width)
    assert max(map(len, lines)) <= width
    speeds = [line for line in lines if line.startswith("bow to starboard (yaw)")]
    assert len(speeds) == {40: 5, 80: 2}[width]
    assert "".join(speeds).count("±30%") == 5
    assert any("90 deg/s ±30%" in line for line in speeds)
    text = "".join("".join(lines).split())
    assert "…" not in text
    for number_ in ("0.300", "0.500", "1.00", "±30%"):
        assert number_ in text


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
    page = report.report_output(example(), tmp_path / "pages" / "report.html")
    vehicle = load_vehicle(VIDEORAY)
    made = example().vehicle.provenance
    assert made
    made = made.model_copy(update={"report": page.path})
    vehicle = replace(vehicle, alternatives={}, data=None, pictures=None, provenance=made)
    write_whole(page, vehicle_output(vehicle, tmp_path / "vehicle.toml"))
    return tmp_path / "vehicle.toml"


def test_the_fmu_has_the_report(identified: Path) -> None:
    assert 'report = "pages/report.html"' in identified.read_text(encoding="utf-8")
    vehicle = load_vehicle(identified)
    for content in (native_content(vehicle), python_content(vehicle)):
        report = content.files["documentation/identification.html"]
        assert report == (identified.parent / "pages" / "report.html").read_bytes()
    links = html.fromstring(documentation_page(vehicle)).iter("a")
    assert "identification.html" in [a.get("href") for a in links]


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
    shown.page.evaluate(UNFOLD)
    found = axe.Axe().run(shown.page)
    assert not [(one["id"], one["nodes"][0]["html"]) for one in found.response["violations"]]
    widths = shown.page.evaluate("[...document.querySelectorAll('.plots svg')].map((svg) => svg.clientWidth)")
    assert max(widths) - min(widths) <= 2, "so the text of all plots has one size"
    assert not shown.problems()
