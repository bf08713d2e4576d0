"""The identification report: whole, self-contained, the same bytes every time, and in the FMU of its vehicle."""

import base64
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from hashlib import sha256
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from lxml import html

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE
from rov_fmu.fmu.content import native_content, python_content
from rov_fmu.identify.findings import STOPPING, driven_aside, next_tests, told
from rov_fmu.identify.result import AxisResult, Coefficient, Identification, Slip
from rov_fmu.io.output import write_whole
from rov_fmu.report import report
from rov_fmu.report.console import _Console
from rov_fmu.report.console_results import print_identification
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.templates import number, readable, with_interval
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import vehicle_output
from tests.conftest import Made
from tests.report.conftest import Visit
from tests.report.pages import (
    check_breaks_long_words,
    check_is_whole,
    check_refers_to_itself_alone,
    rows,
    text_of,
    unfolded,
)
from tests.report.results import FILES, GOOD, compared_with, example, prediction, without_findings
from tests.vehicles import extended

report_page = partial(report.report_page, made=date(2026, 11, 23))
SECTIONS = [
    *("findings", "predictions", "answers", "known"),
    *("effects", "disturbances", "logging", "tables", "card"),
]
"""What is folded, in its order."""


@pytest.fixture(scope="module")
def page(made_once: Made) -> str:
    """The report, which is drawn once in a run."""
    folder = made_once("report", lambda folder: (folder / "report.html").write_text(report_page(example()), "utf-8"))
    return (folder / "report.html").read_text("utf-8")


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
    axis = AxisResult(SURGE, GOOD, (), (0.0, 0.7), (), (), (), None)
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


@pytest.mark.usefixtures("without_plots")
def test_numbers_in_units_of_an_assumed_thrust_say_so(page: str) -> None:
    """Beside drag, load, β and the inertias; neither beside a time nor where a force was measured."""
    words = "in units of the assumed thrust"
    assert words not in text_of(page)
    curves = {"top": (Coefficient("a_t_top", 6.0, (5.0, 7.0), "N", "6.0 ± 1.0 N", 0.5),)}
    made = report_page(told(replace(without_findings(), forces=(), curves=curves)))
    heads = [th.text_content() for th in html.fromstring(made).xpath("//th[@class='quantity']")]
    assert heads
    assert all(head.endswith(f", {words}") for head in heads)
    (load,) = [row[0] for row in rows(made) if row[0].startswith("Constant load")]
    (lag,) = [row[0] for row in rows(made) if row[0].startswith("Lag of the thrusters")]
    assert (load, lag) == (f"Constant load, {words}", "Lag of the thrusters")


@pytest.mark.interop
def test_long_words_break(page: str, tmp_path: Path, visit: Callable[..., Visit]) -> None:
    check_breaks_long_words(page, tmp_path / "report.html", visit)


@pytest.mark.long
def test_the_same_twice(page: str) -> None:
    assert report_page(example()) == page


@pytest.mark.usefixtures("without_plots")
def test_progress_tells_each_plot_and_the_picture_shows_the_log_that_is_predicted_worst(
    page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[tuple[str, float]] = []
    report_page(example(), lambda step, share: steps.append((step, share)))
    assert [step for step, _ in steps] == [f"drawing: {label}" for label in labels(page)]
    assert [share for _, share in steps] == pytest.approx([n / len(steps) for n in range(len(steps))])
    surge, heave, yaw = example().axes
    other = prediction(HEAVE, "depth", FILES[0], span=10.0, error=0.05)
    first = [prediction(SURGE, name, FILES[0], span=10.0, error=0.2) for name in ("surge velocity", "distance")]
    every = "(started again every 10 s)"
    for unchanged, told_ in {
        0.7: f"the distance {every} and the heading {every} of log_2.csv",
        0.1: f"the distance {every} and the depth {every} of log_1.csv",
    }.items():
        own = (*(replace(p, unchanged=unchanged) for p in first), *surge.predictions)
        axes = (replace(surge, predictions=own), replace(heave, predictions=(other,)), yaw)
        assert f"{told_}, predicted" in unfolded(report_page(replace(example(), axes=axes)))
    unjudged = replace(surge, predictions=(prediction(SURGE, "distance", FILES[0]),))
    assert "Unseen motion: the distance of log_1.csv, predicted" in unfolded(
        report_page(replace(example(), axes=(unjudged,)))
    )
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert report.today() == date(1970, 1, 2)


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
        "how fast in knots": "Downheave0.15 m/s0.14 to 0.170.29 knots",
        "can I trust yaw": "Yaw: do not useThe bands contain only 40 % of the unseen data. Two starts disagree.",
        "can I trust surge": "Surge: good",
        "from which data": "2 logs with 120 s in total (log_1.csv, log_2.csv), 3 forces, 9 points, commands of 20 %",
        "when was it identified": "Identification from two dive logs · 2026-11-23",
        "may I use full power": "The tests had commands of 20 % to 70 %, so the speed at 100 % is extrapolated.",
        "what is wrong with log_2": "it disagrees with the other log. Check the depth: is it in cm?",
        "what to do first": "First: Repair log_2.csv or take it out of the folder",
        "what to measure next": "hold 0.6 for 8 s, then −0.6 for 8 s. V_ss at 50 %, now ±60 %, becomes ±30 %.",
        "what does the picture show": "the heading (started again every 10 s) of log_2.csv, predicted from the",
        "how well is an unseen dive predicted": "they contain 95 % for surge, 90 % for heave and 40 % for yaw",
    }
    assert [question for question, answer in key.items() if answer not in words] == []
    told_first = " ".join(" ".join(printed(told(wrong), monkeypatch, 80)).split())
    assert told_first.index("First: Repair log_2.csv") < told_first.index("surge: good")
    assert words.index("First: Repair") < words.index("Surge: good") < words.index("What you can expect")
    assert "Repair" not in unfolded(report_page(example(), made=date(2026, 11, 23)))


ANSWER = (
    *with_interval(0.3, (0.294, 0.306)),
    "m/s",
    *with_interval(5.0 / 3.0, (1.633, 1.7)),
    *with_interval(0.6, (0.588, 0.612)),
    "m",
)
ROWS = [
    ["Surge", "distance", "10 s", "0.050 m", "0.70 m", "0.010 m", "95 %", FILES[1], "the other log"],
    ["Yaw", "heading", "10 s", "52 °", "40 °", "0.57 °", "40 %", FILES[1], "the other log"],
    ["30 %", "this fit", *ANSWER],
    ["a_d_u", "10.0", "9.0", "11.0", "N·s²/m²", "20 within a factor of 2, from the base", "10 %"],
    ["Top thrust"],
    ["Lag of the thrusters", "top", "0.120", "0.110", "0.130", "s", "50", "reported"],
    ["Constant load", "heave", "0.010", "−0.50", "0.50", "N", "−3", "not shown by the data"],
    ["Slow force", "Heave", "2.1 N", "16 %", FILES[1], "41", "unknown", "30"],
    ["Change of thrust", "All", "1.0 %", "1 %", FILES[0], "–", "unknown", "2"],
    [FILES[0], "0.1", "−0.080", "−0.090", "−0.070", "0.1"],
    ["Yaw", "heading", "1200", "1.0 °", "0 °", "0"],
    ["surge", "V_ss", "30 %", "0.29", "0.3", "+3.4 %", "0.31", "+6.9 %", "m/s", "steady.csv"],
]
"""A row of each table: predictions, answers, coefficients, effects, disturbances, clocks, sensors and tank tests."""


def test_everything_that_was_found_has_its_row(page: str) -> None:
    table = rows(page)
    assert [row for row in ROWS if row not in table] == []
    off = [td.text_content() for td in html.fromstring(page).xpath("//td[contains(@class, 'off')]")]
    assert off == ["52 °"], "worse than no change"
    assert any(row[:3] == ["−50 %", "this fit", "−45"] and row[5] == "°/s" for row in table), "yaw in degrees"
    assert any(row[0] == "top" and row[2] == "20 %" and row[-1].endswith("(does not count)") for row in table)
    vehicle = example().vehicle
    given = {row[0]: row for row in table if len(row) == 5}
    assert given["m_rov"][2:] == [number(vehicle["m_rov"], 5), "kg", vehicle.sources["m_rov"]]
    assert "a_d_u" not in given, "it is among what was identified"


# ---- Without plots ---------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("without_plots")
def test_a_report_of_almost_nothing_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
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
    assert printed(bare(), monkeypatch)[-2:] == ["No warnings.", "--report shows 2 more doubts and facts."]
    seen = replace(example(), axes=(replace(example().axes[0], predictions=()),), findings=())
    lines = [" ".join(line.split()) for line in printed(seen, monkeypatch, 120)]
    assert "surge V_ss, 2 points 5.1% - -" in lines
    assert "What else acts: lag of the thrusters (top 0.12 s), current to the north (log_1.csv 0.10 m/s)." in lines


@pytest.mark.usefixtures("without_plots")
def test_another_fit_is_compared_in_every_table_that_it_has_numbers_for() -> None:
    other = load_vehicle(VIDEORAY)
    page = report_page(compared_with(other))
    table = rows(page)
    assert f"“Compared” is {other.name}." in unfolded(page)
    V = other.response(SURGE, 0.5)[0]
    columns = {
        ("Forwardsurge",): (2, number(V, 3)),
        ("a_d_u",): (4, number(other["a_d_u"], 4)),
        ("Surge", "distance", "10 s"): (4, "0.50 m"),
        ("surge", "V_ss", "50 %", "0.51"): (8, number(V, 4)),
        ("top", "force", "60 %"): (8, number(other.curve_force(other.layout.curves_by_name["top"], 0.6), 4)),
    }
    for begin, (column, value) in columns.items():
        (row,) = [row for row in table if row[: len(begin)] == [*begin]]
        assert value in row[column], begin
    assert "compared" not in text_of(report_page(example()))


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
    assert ["yaw heading, 10 s ahead", "52 deg", "40 deg", "0.57 deg"] in cells
    text = " ".join(" ".join(lines).split())
    assert "forward (surge) 0.300 m/s ±2% 0.500 m/s ±2% 1.00 m/s ±2% 1.00 s ±2% 1.00 m ±2%" in text
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
        "--report shows 4 more doubts and facts.",
        *(f"To measure next: {words}" for words in next_tests(example())),
    ]
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    shown = unfolded(page).casefold()
    for sentence_ in (STOPPING, *made.warnings, *next_tests(example()), *example().axes[2].verdict.reasons):
        assert " ".join(readable(sentence_).split()).casefold() in shown


def driven_by(names: Sequence[str]) -> Identification:
    """The example with some of the thrusters of its vehicle."""
    vehicle = without_findings().vehicle
    layout = vehicle.layout
    kept = replace(layout, thrusters=tuple(t for t in layout.thrusters if t.name in names))
    return told(replace(without_findings(), vehicle=vehicle.with_(kept)))


@pytest.mark.usefixtures("without_plots")
def test_an_axis_whose_thrusters_drive_others_is_told_so_beside_its_speeds(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of two rear thrusters turns the vehicle, too. Both together do not, as those of the vehicles that ship, and
    push it forward in a turn only if they are much weaker astern."""
    turned = driven_by(["l", "t"])
    lines = driven_aside(turned)
    end = "These numbers hold only if something prevents that."
    assert lines == [
        f"surge: its thrusters also drive the vehicle bow to starboard (yaw). {end}",
        f"yaw: its thrusters also drive the vehicle forward (surge). {end}",
    ]
    text = "\n".join(printed(turned, monkeypatch, 200))
    after_table = text.partition(STOPPING[-20:])[2].partition("Unseen data")[0]
    assert after_table.split("\n")[1:3] == [f"- {line}" for line in lines]
    first_screen = unfolded(report_page(turned)).partition("What you can expect")[2].partition("What to measure")[0]
    assert all(line[1:] in first_screen for line in lines)
    symmetric = example().vehicle
    astern = [{f"{name}_reverse": share * symmetric[name] for name in ("a_t_rear", "b_t_rear")} for share in (0.7, 0.5)]
    weaker, weak = (replace(example(), vehicle=extended(symmetric, **values)) for values in astern)
    assert not driven_aside(weaker)
    assert driven_aside(weak) == lines[1:]
    for path in SHIPPED.values():
        vehicle = load_vehicle(path)
        axes = tuple(replace(example().axes[0], axis=form.axis) for form in vehicle.layout.axes)
        assert not driven_aside(replace(example(), vehicle=vehicle, axes=axes))


# ---- The file, and the FMU -------------------------------------------------------------------------------------------


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
    assert folder / "pages" / "report.html" in load_vehicle(folder / "tuned.toml").files
    (folder / "other").mkdir()
    capsys.readouterr()
    assert main([*tune, str(folder / "other" / "tuned.toml")]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert "provenance.report = 'pages/report.html': must be inside the folder of the new file" in error
    assert not list((folder / "other").iterdir())


def test_a_report_outside_the_folder_of_the_vehicle_file_is_refused_before_the_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other").mkdir()
    report = tmp_path / "report.html"
    assert main(["identify", "no/tests", "-o", str(tmp_path / "other" / "v.toml"), "--report", str(report)]) == 2
    assert capsys.readouterr().err.startswith(f"rov-fmu: {report}: must be inside the folder of ")
