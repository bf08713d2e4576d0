"""The identification report: whole, self-contained, the same bytes every time, and in the FMU of its vehicle."""

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from hashlib import sha256
from pathlib import Path

import pytest
from lxml import html

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW
from rov_fmu.fmu.content import native_content, python_content
from rov_fmu.identify.findings import driven_aside
from rov_fmu.io.output import Output, sealed, write_whole
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.report import report_page
from rov_fmu.report.templates import today
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import VehicleWarning, load_vehicle
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
from tests.report.results import FILES, example, prediction
from tests.vehicles import extended


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


def labels(page: str) -> list[str]:
    return [svg.get("aria-label") for svg in html.fromstring(page).iter("svg")]


def test_the_page_is_whole_loads_nothing_and_its_script_alone_is_allowed(page: str) -> None:
    check_is_whole(page)
    check_refers_to_itself_alone(page)
    root = html.fromstring(page)
    (script,) = root.iter("script")
    digest = base64.b64encode(sha256(script.text.encode()).digest()).decode()
    policy = root.xpath("string(//meta[@http-equiv]/@content)")
    assert policy == f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    assert not any(fold.get("open") for fold in root.iter("details"))
    assert "nan" not in re.findall(r"[a-z]+", text_of(page)), "a dash stands where there is no number"


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
    assert today() == date(1970, 1, 2)


@pytest.mark.usefixtures("without_plots")
def test_text_of_the_files_is_escaped() -> None:
    odd = replace(example(), vehicle=replace(example().vehicle, name='<script>$1</script> & "Söhne"'))
    root = html.fromstring(report_page(odd))
    assert root.findtext(".//h1") == odd.vehicle.name
    assert len(list(root.iter("script"))) == 1


@pytest.mark.usefixtures("without_plots")
def test_what_is_0_in_theory_has_no_digits_and_no_order() -> None:
    """On another processor, the evidence of what no data reach, and the size of what is not there, round elsewhere."""
    told = []
    for rest in (4.4e-16, -1.6e-15, 0.00083, -0.04):
        first, *effects = example().effects
        slow, other = example().disturbances
        nothing = replace(slow, value=abs(rest), share=5e-4, evidence=-rest)
        page = report_page(
            replace(
                example(),
                effects=(
                    replace(first, evidence=370.42),
                    *(replace(e, evidence=rest * n) for n, e in enumerate(effects)),
                ),
                disturbances=(nothing, other, replace(nothing, evidence=6.1)),
            )
        )
        shown = {row[0]: row for row in rows(page) if row[-1] in ("reported", "not shown by the data")}
        assert [(name, row[-2]) for name, row in shown.items()] == [
            ("Lag of the thrusters", "370.4"),
            ("Current to the north", "0.0"),
            ("Constant load", "0.0"),
        ]
        told.append([(row[2], row[5]) for row in rows(page) if row[0] in ("Slow force", "Change of thrust")])
    assert {one[2] for one in told} == {("0 N", "0.0")}
    assert {one[0][1] for one in told} == {"6.1"}
    assert {one[0][0] for one in told} != {"0 N"}, "strong evidence is for a size, however small"


def test_thrusters_that_also_drive_another_axis_are_told_only_where_they_do() -> None:
    """Both rear thrusters together do not turn the vehicle, as in the vehicles that ship, and push it forward in a turn
    only if they are weaker astern. With one of them weak, surge turns the vehicle, and a turn drives it forward."""
    symmetric = example().vehicle
    astern = [{f"{name}_reverse": share * symmetric[name] for name in ("a_t_rear", "b_t_rear")} for share in (0.9, 0.7)]
    weaker, weak = (replace(example(), vehicle=extended(symmetric, **values)) for values in astern)
    assert not driven_aside(weaker)
    assert [line.partition(":")[0] for line in driven_aside(weak)] == ["yaw"]
    thruster = symmetric.layout.thrusters_along(YAW)[0].name
    lame = replace(example(), vehicle=symmetric.with_(**{f"health_{thruster}": 0.7}))
    assert [line.partition(":")[0] for line in driven_aside(lame)] == ["surge", "yaw"]
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
    page = Output(tmp_path / "pages" / "report.html", sealed(report_page(example()), "identify").encode())
    vehicle = load_vehicle(VIDEORAY)
    made = example().vehicle.provenance
    assert made
    made = made.model_copy(update={"report": page.path})
    vehicle = replace(vehicle, alternatives={}, data=None, pictures=None, provenance=made)
    write_whole(page, vehicle_output(vehicle, tmp_path / "vehicle.toml"))
    return tmp_path / "vehicle.toml"


def test_the_fmu_has_the_report(identified: Path) -> None:
    assert 'report = "pages/report.html"' in identified.read_text(encoding="utf-8")
    with pytest.warns(VehicleWarning, match="yaw: do not use"):
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
    with pytest.warns(VehicleWarning, match="yaw: do not use"):
        assert folder / "pages" / "report.html" in load_vehicle(folder / "tuned.toml").files
    (folder / "other").mkdir()
    capsys.readouterr()
    assert main([*tune, str(folder / "other" / "tuned.toml")]) == 2
    _caution, error = capsys.readouterr().err.splitlines()
    assert "provenance.report = 'pages/report.html': must be inside the folder of the new file" in error
    assert not list((folder / "other").iterdir())


def test_a_report_outside_the_folder_of_the_vehicle_file_is_refused_before_the_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other").mkdir()
    report = tmp_path / "report.html"
    assert main(["identify", "no/tests", "-o", str(tmp_path / "other" / "v.toml"), "--report", str(report)]) == 2
    assert capsys.readouterr().err.startswith(f"rov-fmu: {report}: must be inside the folder of ")
