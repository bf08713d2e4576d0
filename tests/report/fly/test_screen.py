"""What the page that flies shows: surface and seabed, one screen, legible instruments, one north, and what is drawn."""

from collections.abc import Callable
from math import cos, sin
from pathlib import Path
from typing import Any

import pytest

import rov_fmu
from tests.often import spread
from tests.report.conftest import chart, flown_vehicle, get, write_page
from tests.report.fly.boxes import SCREENS, WIDTHS, drawn_problems, problems, record_drawn_texts
from tests.report.pages import UNFOLD
from tests.report.test_live import BOX

pytestmark = pytest.mark.interop
SHOWN = ("videoray", "bluerov2", "bluerov2_heavy")

FLOWN_FOR_6_S = """() => {
    live.pause(true);
    live.frame = () => {};
    const { flight } = live;
    const demands = new Map([["surge", 0.5], ["yaw", 0.2]]);
    if (flight.held) flight.steer({ demands, added: {} });
    else flight.set(commandsOf(live.vehicle, demands));
    flight.advance(6);
    live.show();
    live.draw();
}"""


def test_a_vehicle_neither_flies_through_air_nor_enters_the_seabed(page: Any) -> None:
    page.evaluate("""() => {
        live.pause(true);
        live.flight.set({ u_t: -0.8 });
        live.flight.advance(5);
        live.draw();
    }""")
    assert get(page, "z") == [0.0]
    assert "depth 0.00 m (at the surface)" in page.inner_text("#live-readings")
    page.locator("input[name=bed]").fill("2")
    page.evaluate("() => { live.flight.set({ u_t: 0.8 }); live.flight.advance(60); live.draw(); }")
    assert get(page, "z") == pytest.approx([2.0 - 0.55 * page.evaluate("live.vehicle.size")])
    assert "(on the seabed)" in page.inner_text("#live-readings")
    assert page.evaluate("live.picture.isBedded")


def test_at_the_surface_no_steady_rise_is_marked_and_angles_are_in_degrees(fly: Callable[..., Any]) -> None:
    """A BlueROV2 is lighter than water: deep it rises steadily, and at the surface it bobs."""
    page = fly("bluerov2")
    page.evaluate("() => { live.pause(true); live.draw(); }")
    assert "V_ss" not in chart(page, "heave")["words"]
    page.evaluate("() => { live.flight.pilot.model.set('z', 2); live.draw(); }")
    assert chart(page, "heave")["words"].startswith("V_ss \N{MINUS SIGN}0.173")
    assert chart(page, "yaw")["title"].endswith(" °/s")


def test_a_step_test_that_leaves_the_water_says_that_the_surface_is_off(fly: Callable[..., Any]) -> None:
    """The BlueROV2 is lighter than water, so it rises in a step test along another axis, too. Else it floats."""
    page = fly("bluerov2")
    page.evaluate("""() => {
        live.run();
        live.pause(true);
        live.flight.advance(5);
        live.draw();
    }""")
    deep = rov_fmu.load("bluerov2").simulate([0.0, 5.0], start={"z": 9.0})
    assert get(page, "z")[0] == pytest.approx(deep["z"][-1] - 9.0, rel=1e-3)
    assert "(surface off)" in page.inner_text("#live-readings")
    page.evaluate("() => { live.flight.reset(); live.flight.advance(60); live.draw(); }")
    assert get(page, "z")[0] == pytest.approx(-0.254 * 2.0 / (2.0 + 9.80665 * 11.5), rel=1e-3)
    assert "(at the surface)" in page.inner_text("#live-readings")


def test_a_phone_shows_how_fast_the_maker_says_it_is(fly: Callable[..., Any]) -> None:
    page = fly("bluerov2")
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.get_by_text("its maker states 1.5 m/s").is_visible()


@pytest.mark.parametrize(("width", "scheme"), SCREENS)
@pytest.mark.parametrize("kind", spread(SHOWN, ["bluerov2_heavy"]))
def test_picture_and_charts_are_on_one_screen_and_nothing_overlaps_or_is_cut(
    kind: str, fly: Callable[..., Any], width: int, scheme: str
) -> None:
    """Nothing moves when a message of one line comes or goes, and axe finds nothing of what can be unfolded."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    height = 850 if width < 1000 else 800
    page = fly(kind, width=width, height=height, scheme=scheme)
    record_drawn_texts(page)
    page.evaluate(FLOWN_FOR_6_S)
    assert page.locator("#live-picture").evaluate(BOX)["height"] > 0.25 * height
    charts = [chart.evaluate(BOX) for chart in page.locator(".charts canvas").all()]
    assert len(charts) == page.evaluate("live.vehicle.axes.length")
    over = page.locator(".over").evaluate(BOX)
    assert max(box["bottom"] for box in charts) <= (over["top"] if width < 1000 else height)
    assert over["bottom"] <= height, "sticks and buttons are under the thumbs"
    assert len({(round(box["width"]), round(box["height"])) for box in charts}) == 1
    assert (problems(page), drawn_problems(page)) == ([], [])
    boxes = []
    for words in ("", "short"):
        page.evaluate("words => live.say(words)", words)
        boxes.append([page.locator(f"#live-{part}").evaluate(BOX) for part in ("stage", "charts", "controls")])
    assert boxes[0] == boxes[1]
    page.evaluate(UNFOLD)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert axe.run(page).response["violations"] == []


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", spread(["videoray", "bluerov2_heavy"], ["bluerov2_heavy"]))
def test_the_frame_on_the_first_page_of_the_site_shows_all_of_itself(
    kind: str, width: int, fly: Callable[..., Any], tmp_path: Path
) -> None:
    """The site leaves it 350 to 740 px."""
    address = write_page(tmp_path / "compact.html", flown_vehicle(kind), compact=True)
    page = fly(address, width=min(width - 50, 740), height=640)
    record_drawn_texts(page)
    page.evaluate(FLOWN_FOR_6_S)
    assert (problems(page), drawn_problems(page)) == ([], [])
    assert page.evaluate("document.documentElement.scrollHeight") <= 640
    assert page.evaluate("live.picture.instruments.boxes.length") == (4 if kind == "bluerov2_heavy" else 3)


_FAR_FROM_ITS_OWN = """azimuth => {
    const { picture, flight, vehicle } = live;
    picture.camera = { azimuth, elevation: 0.6 };
    live.draw();
    const { model } = flight.pilot;
    const body = viewOfFrame(picture.look(positionOf(model)), rotationOf(model), [0, 0, 0]);
    const texts = drawnTexts.get(picture.board);
    const shown = new Map(texts.map(([words, x, y, width, height]) => [words, { x, y, width, height }]));
    const { shape } = picture.pilot;
    const places = vehicle.thrusters.map(({ label, force, most }, n) => {
        const { at, along } = shape.thrusters[n];
        const jet = jetOf(model.get(force) / most, shape.radius, vehicle.size);
        return { label, ends: [at, plus(at, [jet, along])].map((point) => seen(body, point)) };
    });
    const far = (box, points) => Math.min(...points.map(([x, y]) => Math.hypot(
        Math.max(box.x - x, 0, x - box.x - box.width), Math.max(box.y - y, 0, y - box.y - box.height))));
    const labelled = places.filter(({ label }) => shown.has(label));
    return {
        shown: labelled.length / places.length,
        wrong: labelled.filter(({ label, ends }) => {
            const box = shown.get(label);
            return places.some((other) => far(box, other.ends) + 4 < far(box, ends));
        }).map(({ label }) => label),
    };
}"""
"""Returns the share of thrusters with a label, and the labels that are nearer to another thruster or its jet."""


@pytest.mark.parametrize("kind", spread(SHOWN, ["bluerov2_heavy"]))
def test_a_label_stands_nearest_to_its_own_thruster(kind: str, fly: Callable[..., Any]) -> None:
    page = fly(kind, width=1280)
    record_drawn_texts(page)
    page.evaluate(FLOWN_FOR_6_S)
    found = [page.evaluate(_FAR_FROM_ITS_OWN, azimuth / 4.0) for azimuth in range(25)]
    assert [one["wrong"] for one in found if one["wrong"]] == []
    assert min(one["shown"] for one in found) >= 0.5
    words = page.evaluate(
        "[...drawnTexts].map(([board, texts]) => [board.canvas.id, texts.map((text) => text[0]).join()])"
    )
    through = [name for name, text in words if name.startswith("live-chart") and "through the water" in text]
    assert through == [
        f"live-chart-{name}" for name in ("surge", "sway", "heave") if f"live-chart-{name}" in dict(words)
    ]


_HIDDEN = """azimuth => {
    const { picture, flight, vehicle } = live;
    const { board, pilot } = picture;
    picture.camera = { azimuth, elevation: 0.62 };
    live.draw();
    const labels = new Set(drawnTexts.get(board).map(([words]) => words));
    const { model } = flight.pilot;
    const view = viewOfFrame(picture.look(positionOf(model)), rotationOf(model), [0, 0, 0]);
    const { width, height } = board.canvas;
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const own = board.pen;
    board.pen = canvas.getContext("2d", { willReadFrequently: true });
    board.pen.setTransform(own.getTransform());
    const pixels = () => {
        board.clear();
        pilot.draw(board, view, model, false);
        return board.pen.getImageData(0, 0, width, height).data;
    };
    const whole = pixels();
    const disc = Math.PI * (pilot.shape.radius * view.scale * devicePixelRatio) ** 2;
    const hidden = pilot.shape.thrusters.flatMap((one, n) => {
        const { label, at } = { ...vehicle.thrusters[n], at: one.at };
        one.at = [0, 0, -1e4];
        const without = pixels();
        one.at = at;
        const changed = whole.filter((value, k) => k % 4 === 0 && value !== without[k]).length;
        return labels.has(label) && changed < 0.1 * disc ? [label] : [];
    });
    board.pen = own;
    return hidden;
}"""
"""Returns the labels of thrusters without which the picture is almost the same."""


@pytest.mark.parametrize("kind", spread(SHOWN, ["bluerov2_heavy"]))
def test_a_thruster_that_the_hull_hides_has_no_label(kind: str, fly: Callable[..., Any]) -> None:
    page = fly(kind, width=1280)
    record_drawn_texts(page)
    page.evaluate("() => { live.pause(true); live.frame = () => {}; }")
    assert [page.evaluate(_HIDDEN, azimuth / 2.0) for azimuth in range(13)] == [[]] * 13


def test_there_is_one_north(page: Any) -> None:
    """The rose, the picture from above and the track turn together, wherever the camera is."""
    for azimuth in (0.0, 0.5, -2.0):
        north = page.evaluate(
            """azimuth => {
                live.picture.camera = { azimuth, elevation: Math.PI / 2 };
                live.draw();
                const { right, down } = live.picture.look([0, 0, 0]);
                return [right[0], down[0]];
            }""",
            azimuth,
        )
        assert north == pytest.approx([-sin(azimuth), -cos(azimuth)]), "that of the picture, to the right and down"
    record_drawn_texts(page)
    page.evaluate("() => { live.picture.camera.azimuth = Math.PI / 2; live.draw(); }")
    letters = page.evaluate("[...drawnTexts.values()].flat().filter(([words]) => words === 'N' || words === 'E')")
    assert [one[0] for one in letters] == ["N", "E"], "no other drawing names a north"
    (_, x, *_), (_, u, *_) = letters
    assert x < u - 20.0, "for who looks to the east, north is to the left"


def test_a_frame_of_the_heavy_changes_no_layout(fly: Callable[..., Any]) -> None:
    """What moves is drawn on canvases. The numbers beside them change ten times a second at most."""
    page = fly("bluerov2_heavy")
    page.evaluate(FLOWN_FOR_6_S)
    metrics = page.context.new_cdp_session(page)
    metrics.send("Performance.enable")

    def layouts() -> float:
        found = {m["name"]: float(m["value"]) for m in metrics.send("Performance.getMetrics")["metrics"]}
        return found["LayoutCount"]

    before = layouts()
    page.evaluate(
        """() => new Promise((done) => {
            let left = 30;
            const next = () => {
                live.flight.advance(1 / 60);
                live.paint();
                if (left--) requestAnimationFrame(next);
                else done();
            };
            next();
        })"""
    )
    assert layouts() == before


_SHAPE = """factor => {
    const moved = ({ at: [x, y, z], ...rest }) => ({ ...rest, at: [x, factor * y, z] });
    const vehicle = { ...live.vehicle, thrusters: live.vehicle.thrusters.map(moved) };
    const { plates, thrusters, tubes } = new Shape(vehicle);
    const arms = tubes.filter(({ kind }) => kind === "arm");
    const ends = arms.map(({ at, along, ends }) => plus(at, [ends[1], along]));
    const far = (at) => Math.min(...ends.map((end) => Math.hypot(...plus(at, [-1, end]))));
    return { plates, far: thrusters.map(({ at }) => far(at)) };
}"""
"""Returns the distance of the side plates from the middle, and of each thruster from the end of an arm, with the
thrusters farther from the middle by a factor."""


def test_a_vehicle_is_drawn_from_the_places_of_its_own_thrusters(fly: Callable[..., Any]) -> None:
    """Side plates enclose the thrusters that push horizontally, at 0.111 m; arms hold the vertical ones, at 0.218 m."""
    page = fly("bluerov2_heavy")
    own, wide = page.evaluate(_SHAPE, 1.0), page.evaluate(_SHAPE, 2.0)
    assert 0.111 < own["plates"] < 0.218
    assert 0.222 < wide["plates"] < 0.436
    for shape in (own, wide):
        assert shape["far"][4:] == pytest.approx([0.0] * 4, abs=1e-9)
