"""documentation/index.html and model.png: complete, self-contained, the same bytes every time."""

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Callable
from dataclasses import replace
from math import atan2, hypot, sin
from pathlib import Path
from typing import Any

import pytest
from lxml import html
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from rov_fmu.fmu.archive import Content, native_content, python_content
from rov_fmu.fmu.module import module
from rov_fmu.fmu.variables import variables
from rov_fmu.report.page.fmu_page import documentation, documentation_page
from rov_fmu.report.page.pictures import pictures
from rov_fmu.report.plots.drawing import VIEWS, draw_thrusters, place, scenes
from rov_fmu.report.plots.paper_figures import write_figures
from rov_fmu.report.templates import number, pretty_unit
from rov_fmu.vehicle.published import load_tables
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE
from tests.vehicles import VEHICLES, a_vehicle

ODD_NAME = 'Größe <b>$1</b> & "Söhne"'


@pytest.fixture(scope="module")
def page(vehicle: Vehicle) -> str:
    return documentation_page(vehicle)


@pytest.fixture(scope="module")
def bare_page(vehicle: Vehicle) -> str:
    """The page of a vehicle without a data folder."""
    return documentation_page(replace(vehicle, data=None))


def page_without_plots(vehicle: Vehicle, **how: Any) -> str:
    """Return the page without its plots, which take most of the time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.report.page.fmu_page.inline_svg", lambda *_: "")
        return documentation_page(vehicle, **how)


def rows(page: str) -> list[list[str]]:
    """Return the text of the cells of all rows of all tables."""
    return [[cell.text_content().strip() for cell in row.iter("th", "td")] for row in html.fromstring(page).iter("tr")]


def test_page_is_whole_html(page: str) -> None:
    assert page.startswith("<!DOCTYPE html>")
    root = html.document_fromstring(page, ensure_head_body=True)
    assert root.get("lang") == "en"
    assert (len(root.findall(".//svg")), len(root.findall(".//img"))) == (10, 2)
    links = {a.get("href").removeprefix("#") for a in root.iter("a")}
    ids = [e.get("id") for e in root.iter() if isinstance(e.tag, str) and e.get("id")]
    assert links <= set(ids)
    assert len(ids) == len(set(ids))
    for tag in "table tbody tr td th div p ul li math mrow msub msubsup mfrac svg text".split():  # noqa: SIM905
        assert len(re.findall(rf"<{tag}[\s>]", page)) == page.count(f"</{tag}>"), tag


def test_every_variable_has_its_row(page: str, vehicle: Vehicle) -> None:
    table = rows(page)
    for v in variables(vehicle.rov):
        unit = f"{pretty_unit(v.unit)} ({v.display_unit})" if v.display_unit else pretty_unit(v.unit)
        limits = ["" if value is None else number(value) for value in (v.start, v.minimum, v.maximum)]
        assert [v.name, v.description, v.causality, v.variability, unit, *limits] in table


def test_every_coefficient_has_its_source(page: str, vehicle: Vehicle) -> None:
    table = {row[0]: row for row in rows(page) if len(row) == 5}  # that of the coefficients comes last
    for name, source in vehicle.sources.items():
        assert table[name][2] == number(vehicle.rov[name])
        assert table[name][4] == source


def test_published_tables_side_by_side(page: str, vehicle: Vehicle) -> None:
    table = rows(page)
    for published in load_tables(vehicle):
        for row in published.rows:
            for quantity, digits in (("V_ss", 4), ("Tau", 3)):
                cells = [getattr(response, quantity) for response in (row.non_linear, row.scaled)]
                numbers = [text for cell in cells for text in (str(cell.printed or "–"), f"{cell.computed:.{digits}f}")]
                found = [r for r in table if len(r) == 9 and [r[1], r[2], r[4], r[5]] == numbers]
                assert [r[0] for r in found] == [f"{row.command} %"]
                assert found[0][7] == str(cells[1].measured or "–")
    # the worst of them, by hand: Tau of the non-linear model at 20 % in heave is 2.012 s, and printed as 1.76 s
    assert ["20 %", "1.76", "2.012", "+14.3 %", "3.08", "3.211", "+4.2 %", "2.87", "+11.9 %"] in table


def test_says_where_it_is_valid(page: str) -> None:
    text = " ".join(html.fromstring(page).text_content().split())
    assert "hold for commands of 20–70 %" in text
    assert "rear thrust is then negative below 27 %" in text  # curve (8), the alternative


def check_refers_to_itself_alone(page: str) -> None:
    """Check that no element loads anything, that links stay in the page, and that images are embedded."""
    root = html.fromstring(page)
    assert not list(root.iter("script", "link", "iframe", "object", "embed", "base"))
    for element in root.iter():
        for name, value in element.items():
            assert name != "src" or (element.tag == "img" and value.startswith("data:image/svg+xml;base64,"))
            assert not name.startswith("on")
            assert name not in {"href", "xlink:href"} or value.startswith("#")


@pytest.mark.parametrize("which", ["page", "bare_page"])
def test_loads_nothing(which: str, request: pytest.FixtureRequest) -> None:
    text: str = request.getfixturevalue(which)
    check_refers_to_itself_alone(text)
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text
    assert set(re.findall(r"url\((.)", text)) == {"#"}


def test_references_within_plots_resolve(page: str) -> None:
    ids = set(re.findall(r' id="(\w+)"', page))
    assert set(re.findall(r"url\(#(\w+)\)", page)) | set(re.findall(r'<use [^>]*href="#(\w+)"', page)) <= ids


def test_small_and_the_same_twice(page: str) -> None:
    bare = load_vehicle(BARE)
    assert documentation_page(bare) == documentation_page(bare)
    assert len(page.encode()) < 150_000


@pytest.mark.parametrize("name", ["videoray", pytest.param("bluerov2_heavy", marks=pytest.mark.long)])
def test_what_flies_is_small_allowed_alone_and_the_same_twice(name: str) -> None:
    flown = load_vehicle(SHIPPED[name])
    compiled = module(flown.rov)
    still, page = page_without_plots(flown), page_without_plots(flown, module=compiled)
    assert len(page.encode()) - len(still.encode()) < 80_000
    assert len(zlib.compress(page.encode(), 9)) - len(zlib.compress(still.encode(), 9)) < 60_000
    assert module(flown.rov) == compiled
    root = html.fromstring(page)
    scripts = [s for s in root.iter("script") if s.get("type") != "application/json"]
    assert [dict(s.attrib) for s in root.iter("script")] == [{"type": "application/json", "id": "live-vehicles"}, {}]
    digest = base64.b64encode(hashlib.sha256((scripts[0].text or "").encode()).digest()).decode()
    (policy,) = (m.get("content") for m in root.iter("meta") if m.get("http-equiv") == "Content-Security-Policy")
    allowed = dict(part.strip().split(" ", 1) for part in policy.split(";"))
    assert allowed == {
        "default-src": "'none'",
        "style-src": "'unsafe-inline'",
        **({"img-src": "data:"} if flown.pictures else {}),
        "script-src": f"'sha256-{digest}' 'wasm-unsafe-eval'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    (one,) = json.loads(root.get_element_by_id("live-vehicles").text)
    measured = {test["V"] for test in one["tests"]} - {None}
    published = load_tables(flown) if flown.data else ()
    assert measured == {float(V) for table in published for row in table.rows if (V := row.scaled.V_ss.measured)}


def test_goes_without_a_data_folder(bare_page: str) -> None:
    root = html.fromstring(bare_page)
    assert root.get_element_by_id("tables", None) is None
    assert (len(root.findall(".//svg")), len(root.findall(".//img"))) == (10, 2)
    assert "printed" not in bare_page


def test_text_of_the_vehicle_file_is_escaped(vehicle: Vehicle) -> None:
    odd = replace(vehicle, name=ODD_NAME, description="<script>", data=None)
    root = html.fromstring(page_without_plots(odd))
    assert root.findtext(".//h1") == ODD_NAME
    assert not list(root.iter("script"))


@pytest.mark.parametrize(
    ("changes", "limits"),
    [
        ({"a_t_rear": 100.3, "b_t_rear": -27.09}, (0.0, 1.0)),
        pytest.param(
            {"alpha_u": 0.0, "beta_w": 0.0, "R": 0.0, "a_d_u": 0.0, "b_d_w": 0.0, "a_t_top": -6.0},
            (0.2, 0.201),
            marks=pytest.mark.long,
        ),
        pytest.param({"m_rov": 1e-3, "a_t_rear": 1e6}, (0.001, 0.002), marks=pytest.mark.long),
    ],
    ids=str,
)
def test_any_coefficients_and_any_range_of_commands(
    vehicle: Vehicle, changes: dict[str, float], limits: tuple[float, float]
) -> None:
    changed = replace(vehicle, rov=vehicle.rov.replaced(changes), command_range=limits, data=None)
    page = documentation_page(changed)
    assert ("The rear thrust is negative below 27 %." in page) == (changed.rov["b_t_rear"] < 0.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0"),
        (-1.0, "−1"),
        (1e6, "10⁶"),
        (-1e6, "−10⁶"),
        (1e-6, "10⁻⁶"),
        (2.5e7, "2.5·10⁷"),
        (0.0513, "0.0513"),
    ],
)
def test_number(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize("content_of", [native_content, python_content])
def test_model_png_is_the_own_picture_or_else_the_icon(vehicle: Vehicle, content_of: Callable[..., Content]) -> None:
    drawn = pictures(vehicle.rov)
    assert vehicle.pictures
    own = (vehicle.pictures / "model.png").read_bytes()
    assert len(own) < 20_000
    assert b"tEXt" not in own
    assert content_of(vehicle, drawn).files["model.png"] == own
    bare = replace(vehicle, pictures=None)
    assert content_of(bare, drawn).files["model.png"] == drawn["terminalsAndIcons/icon.png"]


@pytest.mark.long
def test_picture_of_the_readme(tmp_path: Path) -> None:
    write_figures(tmp_path)
    text = (tmp_path / "videoray.svg").read_text(encoding="utf-8")
    assert text.startswith("<svg ")
    assert text.count("measured</text>") == 3
    write_figures(tmp_path)
    assert (tmp_path / "videoray.svg").read_text(encoding="utf-8") == text


def test_the_page_of_the_python_flavour_claims_no_more_than_it_does(vehicle: Vehicle, page: str) -> None:
    python = page_without_plots(vehicle, native=False)
    for claim in ("Model Exchange", "fmi2Discard", "Directional derivatives", "first time derivatives"):
        assert claim in page
        assert claim not in python


def test_the_page_tells_of_the_version_of_fmi_that_it_is_in(vehicle: Vehicle, page: str) -> None:
    two, three = page, page_without_plots(vehicle, fmi=3)
    for page_of_version in (two, three):
        assert " ".join(page_of_version.split()).count("The first time derivatives of the outputs are available.") == 1
    assert "rov-fmu prove videoray.fmu" in two
    assert "rov-fmu prove videoray.fmi3.fmu" in three
    for claim in (
        "FMI 3.0",
        "fmi3Discard",
        "adjoint",
        "intermediate update",
        "Event Mode between",
        "videoray.fmi3.fmu",
    ):
        assert claim in three
        assert claim not in two
    for claim in ("FMI 2.0", "fmi2Discard", "simulate videoray.fmu"):
        assert claim in two
        assert claim not in three


@pytest.mark.parametrize("content_of", [native_content, pytest.param(python_content, marks=pytest.mark.long)])
def test_nothing_of_the_videoray_stands_in_the_fmu_of_another_vehicle(
    vehicle: Vehicle, content_of: Callable[..., Content]
) -> None:
    """Neither its name nor its picture nor what was found of it alone."""
    other = replace(
        vehicle,
        name="Pilchard",
        identifier="pilchard",
        description="An ROV",
        source="A tank test",
        data=None,
        pictures=None,
        limits=("It leaks.",),
        alternatives={},
        sources=dict.fromkeys(vehicle.sources, "A tank test"),
    )
    files = content_of(other, documentation(other, native=content_of is native_content)).files
    own = vehicle.pictures and {path.read_bytes() for path in vehicle.pictures.iterdir()}
    assert own
    for name, content in files.items():
        assert content not in own, name
        if not name.endswith((".png", ".so", ".dll")):
            text = content.decode("utf-8").lower()
            for claim in ("videoray", "#f6b90c", *(limit.lower() for limit in vehicle.limits)):
                assert claim not in text, (name, claim)
    assert b"It leaks." in files["documentation/index.html"]


# ---- Other vehicles ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def heavy_page(heavy: Vehicle) -> str:
    intervals = {"a_d_u": (130.5, 151.5)}
    return page_without_plots(replace(heavy, intervals=intervals))


def words(page: str) -> str:
    """Return the visible text without the plots."""
    root = html.fromstring(page)
    for plot in root.findall(".//svg"):
        plot.drop_tree()
    return " ".join(root.text_content().split())


def test_a_vehicle_with_lag_and_coupling_is_told_as_it_is(heavy_page: str) -> None:
    text, table = words(heavy_page), rows(heavy_page)
    for claim in (
        "eight thrusters",
        "surge, sway, heave and yaw",
        "lag of first order",
        "Coriolis and Munk",
        "dead band",
        "16 continuous states",
        "a_t_t200_reverse",
        "tau_t200",
        "With all inputs zero, the constant load",
    ):
        assert claim in text, claim
    for claim in (
        "rear thruster",
        "Table 9",
        "Tables 6",
        "closed-form solution",
        "one axis reads",
        "R sin",
        "paper calls",
    ):
        assert claim not in text, claim
    assert ["1 thruster 1 (front starboard)", "u_1", "t200", "−0.7071, 0.7071, 0", "0.156, 0.111, 0.085"] in table
    (row,) = [row for row in table if row[0] == "a_d_u" and len(row) == 6]
    assert row[2:4] == ["141", "130.5 … 151.5"]


def test_the_commands_told_drive_the_vehicle_as_told(heavy: Vehicle, heavy_page: str) -> None:
    """Both directions where they differ, by the equation of the steady state: a_d V^2 + b_d V = F + F_0."""
    table = {row[0]: row for row in rows(heavy_page) if row and row[0].startswith(("Surge (", "Heave "))}
    assert table["Heave up (m/s)"][1] == "u_5 = −c, u_6 = −c, u_7 = −c, u_8 = −c"
    k = heavy.rov
    for name, end, sign in (("Heave down (m/s)", "", 1.0), ("Heave up (m/s)", "_reverse", -1.0)):
        V = sign * float(table[name][-2].replace("−", "-"))  # at full command, to three digits
        m = 1.0 - k["c_0_t200"]
        force = 4.0 * (k[f"a_t_t200{end}"] * m**2 + k[f"b_t_t200{end}"] * m) + sign * k["F_0_w"]
        assert k["a_d_w"] * V**2 + k["b_d_w"] * V == pytest.approx(force, rel=2e-3)


@pytest.mark.parametrize("kind", ["coupled without lag, three commands, no heave", "surge and sway without yaw"])
def test_what_a_vehicle_does_not_have_is_not_on_its_page(kind: str) -> None:
    vehicle = a_vehicle(VEHICLES[kind])
    page = page_without_plots(vehicle)
    check_refers_to_itself_alone(page)
    text = words(page)
    turns = ["psi", "ψ"] if "yaw" in kind else []
    for name in ("Z_ext", "u_l", "F_t", "tau_rear", "m_a_w", "rear", "top thruster", *turns):
        assert name not in text, name
    for v in variables(vehicle.rov):
        assert v.name in text


def test_thrusters_are_drawn_where_they_are_and_push_where_they_push(heavy: Vehicle) -> None:
    """An arrow begins at the thruster and points along its direction; in pixels y is down."""
    figure = Figure(figsize=(6.0, 6.0))
    ax = figure.subplots()
    draw_thrusters(ax, heavy.rov, scenes(heavy.rov)["from above"])
    arrows = {(round(a.xyann[0], 2), round(a.xyann[1], 2)): a.xy for a in ax.texts if isinstance(a, Annotation)}
    names = {text.get_text() for text in ax.texts}
    for thruster in heavy.layout.thrusters:
        assert f"$F_{{{thruster.name}}}$" in names
        x, y, _ = thruster.position or (0.0, 0.0, 0.0)
        if thruster.direction[2] == 0.0:
            ((start, tip),) = [(a, b) for a, b in arrows.items() if hypot(a[0] - x, a[1] - y) < 0.03]
            along = tip[0] - start[0], tip[1] - start[1]
            expected = atan2(thruster.direction[1], thruster.direction[0])
            assert atan2(along[1], along[0]) == pytest.approx(expected, abs=0.2)
    assert ax.yaxis_inverted()


def test_the_arm_of_the_paper_stands_where_its_torque_says(vehicle: Vehicle) -> None:
    """(4): x F_y - y F_x of a force ahead is ±R sin γ, behind the centre of mass."""
    k = vehicle.rov
    for thruster, side in zip(vehicle.layout.thrusters[:2], (1.0, -1.0), strict=True):
        x, y, _ = place(k, thruster)
        assert x < 0.0
        assert hypot(x, y) == pytest.approx(k["R"])
        assert -y == pytest.approx(side * k["R"] * sin(k["gamma"]))


@pytest.mark.parametrize(
    ("kind", "absent"),
    [
        ("heave only", ("north,", "current", "each axis", "axes heave", "x north", "(4)")),
        ("yaw only", ("depth", "Depth", "buoyancy", "Buoyancy", "current", "each axis", "(4)")),
    ],
)
def test_a_vehicle_of_one_axis_is_told_as_one(kind: str, absent: tuple[str, ...]) -> None:
    text = words(page_without_plots(a_vehicle(VEHICLES[kind])))
    for name in absent:
        assert name not in text, name
    assert f"drive {kind.split(maxsplit=1)[0]} with quadratic and linear drag" in text


def test_directions_that_differ_are_not_said_to_mirror() -> None:
    by_direction, yaw = (
        words(page_without_plots(a_vehicle(VEHICLES[kind])))
        for kind in ("drag by direction, coupled, late", "yaw only")
    )
    assert "change sign with the direction" not in by_direction
    assert "Directions. Drag only changes sign" in yaw


def test_what_commands_push_beside_their_axis_is_told() -> None:
    """A turn of a pair: one thruster ahead, one in reverse, which is weaker; F = a_t m^2 + b_t m, m = 1 - c_0."""
    rov = VEHICLES["lag without coupling"]
    table = {row[0]: row for row in rows(page_without_plots(a_vehicle(rov))) if len(row) > 2}
    m = 1.0 - rov["c_0_t200"]
    ahead, back = (rov[f"a_t_t200{end}"] * m**2 + rov[f"b_t_t200{end}"] * m for end in ("", "_reverse"))
    hold = "u_l = c, u_r = −c"
    assert table["Yaw bow to starboard (rad/s)"][1] == f"{hold}also pushes surge with {number(ahead - back, 3)} N"
    assert table["Surge forward (m/s)"][1] == "u_l = c, u_r = c"


def test_a_sum_has_its_signs_before_its_numbers() -> None:
    page = page_without_plots(a_vehicle(VEHICLES["with an input mix"]))
    sums = {"".join(math.text_content().split()) for math in html.fromstring(page).iter("math")}
    assert {"c1=uahead−uaside−0.5uturn", "c2=uahead+uaside+0.5uturn", "c5=−udown"} <= sums


def test_words_of_variables_fit_what_they_are_of(vehicle: Vehicle) -> None:
    layout, other = vehicle.layout, VEHICLES["neither lag nor coupling"].layout
    assert layout.inputs["u_l"].description == "Command u_l: left thruster, positive forward; saturates at ±1"
    assert "(4)" in layout.thrust["tau_rear"].description
    assert "(4)" not in other.thrust["tau_t200"].description
    assert other.coefficients["m_a_r"].description == "Added moment of inertia m_a of yaw"
    assert other.coefficients["m_a_u"].description == "Added mass m_a of surge"


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", ["paper", "neither lag nor coupling", "heave only", "yaw only", "sway and yaw"])
def test_a_drawing_holds_its_arrows_and_names_which_do_not_cover_each_other(
    vehicle: Vehicle, kind: str, view: str
) -> None:
    rov = vehicle.rov if kind == "paper" else VEHICLES[kind]
    scene = scenes(rov)[view]
    figure = Figure(figsize=scene.inches, layout="constrained")
    ax = figure.subplots()
    draw_thrusters(ax, rov, scene)
    figure.draw_without_rendering()
    names = [text for text in ax.texts if text.get_text()]
    boxes = [text.get_window_extent() for text in names]
    for text, box in zip(names, boxes, strict=True):
        assert box.x0 >= 0.0, text
        assert box.y0 >= 0.0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= ax.bbox.y1, text
        assert sum(box.overlaps(other) for other in boxes) == 1, text
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    tips = [text.xy for text in ax.texts if isinstance(text, Annotation)]
    assert tips
    for x, y in tips:
        assert left < x < right
        assert high < y < low
