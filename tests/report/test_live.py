"""The page that flies its model, in headless Chromium: its results, its messages, its requests, and its files."""

import random
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import ceil, exp, log
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, Axis
from rov_fmu.fmu.archive import web_module
from rov_fmu.fmu.variables import variables
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.report.page.live import Flown, fly_page
from rov_fmu.tank.clocks import restart_rows
from rov_fmu.tank.columns import Names, columns_of_log
from rov_fmu.tank.quality import unwrapped
from rov_fmu.tank.read_log import read_logs
from rov_fmu.vehicle.published import load_tables
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE
from tests.report.conftest import Visit
from tests.vehicles import EVERYTHING, SIX, THRUST_EFFECTS, a_vehicle, four_axes, pulsed, thruster
from verification.references.fmpy_slave import fmpy_slave

pytestmark = pytest.mark.interop

Visitor = Callable[..., Visit]
FILES = {"videoray": SHIPPED["videoray"], "heavy": SHIPPED["bluerov2_heavy"], "everything": EVERYTHING, "bare": BARE}


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """A function that returns the address of the page of a vehicle."""
    folder = tmp_path_factory.mktemp("pages")

    def page(kind: str) -> str:
        path = folder / f"{kind}.html"
        if not path.exists():
            vehicle = a_vehicle(SIX) if kind == "six" else four_axes(load_vehicle(FILES[kind]))
            path.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))]), encoding="utf-8")
        return path.as_uri()

    return page


def flying(visit: Visitor, address: str, **options: Any) -> Visit:
    seen = visit(**options)
    seen.page.goto(address)
    seen.page.wait_for_selector("#live-section:not([hidden])")
    return seen


BOX = "element => element.getBoundingClientRect().toJSON()"


def until(page: Any, condition: str) -> None:
    """Wait for a condition. Playwright's own waiting evaluates strings in the page, which the page forbids."""
    for _ in range(2400):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"never: {condition}")


@pytest.fixture
def quiet(visit: Visitor) -> Iterator[Visitor]:
    """Pages that must print nothing to the console and request nothing but themselves."""
    seen: list[Visit] = []

    def new(**options: Any) -> Visit:
        seen.append(visit(**options))
        return seen[-1]

    yield new
    for one in seen:
        assert one.messages == []
        assert len(one.requests) == 1


@pytest.fixture
def page(pages: Callable[[str], str], quiet: Visitor) -> Any:
    """The page of the VideoRay, in which its model flies."""
    return flying(quiet, pages("videoray")).page


# ---- What it computes ------------------------------------------------------------------------------------------------

Leg = dict[str, Any]
"""A part of a manoeuvre: its length (s), its inputs, and the α and β that change before it."""

_FLY = """legs => {
    live.pause(true);
    Object.assign(live.flight, { isHeld: false, isBounded: false });
    live.flight.reset();
    const { model } = live.flight.pilot;
    return legs.map(({ length, inputs, tuning }) => {
        live.flight.tune(tuning);
        live.flight.set(inputs);
        return [live.flight.advance(length), [...model.values]];
    });
}"""


def a_manoeuvre(vehicle: Vehicle) -> list[Leg]:
    """Return random commands (some of which saturate), loads, currents and tunings, for 5 ms to 5 s each."""
    rng, layout = random.Random(vehicle.identifier), vehicle.layout
    tunable = [*layout.tuning]
    return [
        {
            "length": exp(rng.uniform(log(5e-3), log(5.0))),
            "inputs": {name: rng.uniform(-1.2, 1.2) for name in layout.inputs},
            "tuning": {name: rng.uniform(0.4, 1.6) for name in rng.sample(tunable, 2)} if n % 5 == 4 else {},
        }
        for n in range(60)
    ]


def natively(folder: Path, vehicle: Vehicle, legs: list[Leg]) -> Iterator[list[float]]:
    """Yield all variables after each leg, computed by the FMU's binary."""
    declared = variables(vehicle)
    reference = {v.name: v.value_reference for v in declared}
    slave = fmpy_slave(folder)
    try:
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        time = 0.0
        for leg in legs:
            for given in (leg["tuning"], leg["inputs"]):
                slave.setReal([reference[name] for name in given], list(given.values()))
            slave.doStep(time, leg["length"])
            time += leg["length"]
            yield slave.getReal([v.value_reference for v in declared])
    finally:
        slave.terminate()
        slave.freeInstance()


@pytest.mark.parametrize("kind", ["videoray", "heavy", "everything"])
def test_a_manoeuvre_is_that_of_the_native_fmu(
    kind: str, pages: Callable[[str], str], quiet: Visitor, request: pytest.FixtureRequest
) -> None:
    page = flying(quiet, pages(kind)).page
    check_manoeuvre(page, four_axes(load_vehicle(FILES[kind])), request.getfixturevalue(f"{kind}_dir"))


def test_a_manoeuvre_is_that_of_the_native_fmu_in_firefox(
    pages: Callable[[str], str], firefox: Any, heavy: Vehicle, heavy_dir: Path
) -> None:
    seen, address = Visit(firefox), pages("heavy")
    seen.page.goto(address)
    seen.page.wait_for_selector("#live-section:not([hidden])")
    check_manoeuvre(seen.page, heavy, heavy_dir)
    assert seen.messages == []
    assert set(seen.requests) <= {address}  # Firefox need not report the page itself, which is a file


def check_manoeuvre(page: Any, vehicle: Vehicle, folder: Path, longest: float = 5.0) -> None:
    """Check that all variables equal those of the FMU in this folder after each leg."""
    legs = [{**leg, "length": min(longest, leg["length"])} for leg in a_manoeuvre(vehicle)]
    flown = page.evaluate(_FLY, legs)
    names = [v.name for v in variables(vehicle)]
    worst = 0.0
    for (done, values), expected in zip(flown, natively(folder, vehicle, legs), strict=True):
        assert done
        assert len(values) == len(names)
        worst = max(worst, *(abs(x - y) / max(1.0, abs(y)) for x, y in zip(values, expected, strict=True)))
    assert worst < 1e-12


@pytest.mark.parametrize("kind", ["videoray", "heavy"])
def test_a_step_costs_little_beside_arithmetic_in_javascript(
    kind: str, pages: Callable[[str], str], visit: Visitor
) -> None:
    """A step takes at most as long as 500 multiplications and additions in JavaScript, timed in the same rounds.

    A core that does one in 3 ns then does 10,000 steps in 15 ms, less than a frame at 60 Hz.
    """
    page = flying(visit, pages(kind)).page
    step, arithmetic = page.evaluate(
        """() => {
            live.pause(true);
            const { pilot } = live.flight;
            const { commands } = live.vehicle;
            let sum = 0;
            const works = [
                () => {
                    for (let i = 0; i < 1000; i++) {
                        if (i % 50 === 0) commands.forEach((name, n) => pilot.model.set(name, Math.sin(i + n)));
                        pilot.model.step(1 / 60);
                    }
                },
                () => { for (let i = 0; i < 1000000; i++) sum = sum * 0.999 + i; },
            ];
            const best = works.map(() => Infinity);
            for (let round = 0; round < 100; round++) {
                works.forEach((work, n) => {
                    const start = performance.now();
                    work();
                    best[n] = Math.min(best[n], performance.now() - start);
                });
            }
            return [...best, sum];
        }"""
    )[:2]
    assert step < 0.5 * arithmetic, "a thousand steps beside a million multiplications and additions"


FRAMES = """() => Array.from({ length: 100 }, () => {
    const start = performance.now();
    live.fly(1 / 60);
    live.draw();
    return performance.now() - start;
}).sort((one, other) => one - other)[20]"""
"""How long a frame takes, ms, in the fifth of the frames that other programs disturb least."""


def test_a_frame_is_drawn_in_time(pages: Callable[[str], str], visit: Visitor) -> None:
    page = flying(visit, pages("heavy")).page
    page.evaluate("""() => {
        live.flight.set({ u_1: -0.5, u_2: -0.3, u_3: 0.5, u_4: 0.5, u_5: 0.2 });
        live.flight.advance(30);
    }""")
    took = page.evaluate(FRAMES)
    assert took < 8.0, "half of a frame at 60 Hz is left to the browser, also on a busy machine"


# ---- Roll and pitch --------------------------------------------------------------------------------------------------


@pytest.fixture
def tilting(tmp_path: Path, quiet: Visitor) -> Any:
    """The page of a vehicle with six axes."""
    target = tmp_path / "six.html"
    target.write_text(fly_page([Flown(a_vehicle(SIX), web_module(SIX.layout))]), encoding="utf-8")
    return flying(quiet, target.as_uri()).page


def test_roll_and_pitch_are_those_of_the_native_fmu(tilting: Any, six_dir: Path) -> None:
    check_manoeuvre(tilting, a_vehicle(SIX), six_dir, longest=0.05)  # a step of the page


def test_the_horizon_shows_the_attitude(tilting: Any) -> None:
    """Port side down, bow up and heading east; a reset returns to the start."""
    tilting.evaluate("""() => {
        live.pause(true);
        const { model } = live.flight.pilot;
        model.set("phi", -0.5); model.set("theta", 0.25); model.set("psi", Math.PI / 2);
        model.turn();
        model.observe();
        live.draw();
    }""")
    words = tilting.locator("#live-horizon > text").all_text_contents()
    assert words == ["φ −29°", "θ 14°", "ψ 90°"]
    assert tilting.get_attribute("#live-horizon g", "transform") == "rotate(28.6) translate(0 11.5)"
    assert tilting.inner_text("#live-readings").endswith("roll −29° · pitch 14° · heading 90°")
    tilting.click("#live-reset")
    until(tilting, "live.flight.pilot.model.get('phi') === 0 && live.flight.pilot.model.get('eta') === 1")
    tilting.locator("summary", has_text="Attitude").click()
    tilting.locator("input[name=theta_0]").fill("45")
    until(tilting, "document.querySelectorAll('#live-horizon > text')[1].textContent === 'θ 45°'")


@pytest.mark.parametrize(("key", "velocity"), [("KeyL", "p"), ("KeyI", "q"), ("KeyD", "r")])
def test_each_rotation_has_its_key(tilting: Any, key: str, velocity: str) -> None:
    tilting.locator("#live-hold").uncheck()
    tilting.focus("#live-stage")
    tilting.keyboard.down(key)
    until(tilting, f"live.flight.pilot.model.get('{velocity}') > 0.05")


def test_a_command_acts_after_the_dead_time(tmp_path: Path, quiet: Visitor) -> None:
    """The dead time is 0.1 s. A reset forgets the command on its way."""
    vehicle, target = load_vehicle(THRUST_EFFECTS), tmp_path / "late.html"
    target.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))]), encoding="utf-8")
    before, after, anew = flying(quiet, target.as_uri()).page.evaluate("""() => {
        live.pause(true);
        live.flight.set({ u_bow: 1 });
        return [0.05, 0.1, 0.05].map((h, n) => {
            if (n === 2) live.flight.reset();
            live.flight.advance(h);
            return live.flight.pilot.model.get("F_bow");
        });
    }""")
    assert vehicle["T_d"] == 0.1
    assert before == anew == 0.0
    assert after > 1.0


def test_pulse_widths_are_flown_by_fractions(tmp_path: Path, quiet: Visitor) -> None:
    """The model gets pulse widths, from the sliders, the step tests and a reset alike."""
    vehicle, target = load_vehicle(SHIPPED["videoray"]), tmp_path / "pulses.html"
    of_pulses = pulsed(vehicle, (1100.0, 1480.0, 1900.0))
    flown = [Flown(of_pulses, web_module(of_pulses.layout)), Flown(vehicle, web_module(vehicle.layout))]
    target.write_text(fly_page(flown), encoding="utf-8")
    moved = flying(quiet, target.as_uri()).page.evaluate("""() => {
        live.pause(true);
        const { pilot, ghost } = live.flight;
        const seen = () => [pilot, ghost].map(({ model }) => ["u", "w", "r"].map((name) => model.get(name)));
        live.flight.advance(1);
        const still = [...seen(), [...pilot.model.values.slice(0, 3)], live.flight.begun];
        live.flight.set({ u_l: 0.3, u_r: -0.7, u_t: 1.5 });
        live.flight.advance(1);
        const given = [...seen(), [...pilot.model.values.slice(0, 3)], pilot.model.get("u_r")];
        live.flight.set({ u_r: -0.7 });
        live.flight.run(live.vehicle.tests[0]);
        live.flight.advance(1);
        return [still, given, seen()];
    }""")
    still, given, tested = moved
    assert still == [[0.0] * 3, [0.0] * 3, [1480.0] * 3, False]
    assert given[2:] == [[1480.0 + 0.3 * 420.0, 1480.0 - 0.7 * 380.0, 1480.0 + 1.5 * 420.0], -0.7]
    for ours, others in (given[:2], tested):
        assert ours == pytest.approx(others, rel=1e-13, abs=1e-15)
        assert any(ours)


# ---- What a person does with it --------------------------------------------------------------------------------------


def test_it_is_flown_by_keys_alone(pages: Callable[[str], str], quiet: Visitor) -> None:
    page = flying(quiet, pages("heavy")).page
    assert page.evaluate("document.activeElement.id") == "live-stage"
    page.keyboard.down("KeyW")
    until(page, "live.flight.pilot.model.get('x') > 0.1")
    page.keyboard.down("KeyD")
    until(page, "live.flight.pilot.model.get('psi') > 0.1")
    page.keyboard.up("KeyW")
    page.keyboard.up("KeyD")
    until(page, "live.vehicle.commands.every(name => live.flight.pilot.model.get(name) === 0)")
    page.keyboard.press("Space")
    time = page.evaluate("live.flight.time")
    page.wait_for_timeout(200)
    assert page.evaluate("live.flight.time") == time, "it pauses"
    reached: list[str] = []
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.id || document.activeElement.name || ''"))
    buttons = {"live-pause", "live-slower", "live-faster", "live-reset", "live-still", "live-test", "live-run"}
    assert buttons | {"u_1", "u_8", "live-recording"} <= set(reached)
    page.focus("input[name=u_5]")
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    until(page, "live.flight.pilot.model.get('u_5') > 0")


def test_keys_act_at_once_on_a_page_that_is_only_flown(tmp_path: Path, quiet: Visitor, vehicle: Vehicle) -> None:
    """A compact page is embedded in another one, whose focus it leaves alone."""
    for compact in (False, True):
        target = tmp_path / f"{compact}.html"
        target.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))], compact=compact), encoding="utf-8")
        page = flying(quiet, target.as_uri()).page
        assert (page.evaluate("document.activeElement.id") == "live-stage") != compact
        if not compact:
            page.keyboard.down("KeyW")
            until(page, "live.flight.pilot.model.get('x') > 0.1")


def test_a_gamepad_steers_and_lets_go(pages: Callable[[str], str], quiet: Visitor, heavy: Vehicle) -> None:
    page = flying(quiet, pages("heavy")).page
    sticks = {"yaw": 0.5, "heave": -0.25, "sway": 0.05, "surge": 0.75}  # sway is within the dead zone
    axes = [sticks["yaw"], sticks["heave"], sticks["sway"], -sticks["surge"]]
    page.evaluate("axes => { navigator.getGamepads = () => [null, { mapping: 'standard', axes }]; }", axes)
    until(page, "live.flight.pilot.model.get('r') > 0.1")
    asked = page.evaluate("Object.fromEntries(live.vehicle.commands.map(c => [c, live.flight.pilot.model.get(c)]))")
    expected = dict.fromkeys(heavy.layout.commands, 0.0)
    for form in heavy.layout.axes:
        for name, sign in heavy.layout.signs(form.axis).items():
            expected[name] += sign * sticks[form.axis.name] * (form.axis.name != "sway")
    assert asked == pytest.approx({name: max(-1.0, min(1.0, value)) for name, value in expected.items()})
    page.evaluate("() => { navigator.getGamepads = () => []; }")
    until(page, "live.vehicle.commands.every(name => live.flight.pilot.model.get(name) === 0)")


def test_a_step_test_stands_beside_what_was_measured(page: Any, vehicle: Vehicle) -> None:
    (heave,) = (table for table in load_tables(vehicle) if table.axis is HEAVE)
    for row in heave.rows:
        page.select_option("#live-test", label=f"heave {row.command} %")
        page.click("#live-run")
        V, Tau = vehicle.response(HEAVE, float(row.command) / 100.0)
        until(page, "live.flight.time > 0.1")
        title = page.text_content("#live-chart-heave .marks") or ""
        assert title.endswith(f"V_ss {V:.3f} · Tau {Tau:.2f} s")
        line = page.inner_text("#live-message")
        assert f"measured: V_ss {row.scaled.V_ss.measured} m/s, Tau {row.scaled.Tau.measured} s" in line
        assert page.get_attribute("#live-chart-heave .point", "visibility") == "visible"
    page.locator("input[name=u_l]").fill("0.25")
    until(page, "document.querySelector('#live-chart-heave .point').getAttribute('visibility') === 'hidden'")


def test_alpha_and_beta_are_felt_and_the_ghost_keeps_those_of_the_file(page: Any, vehicle: Vehicle) -> None:
    page.locator("summary", has_text="Tuning").click()
    page.locator("input[name=alpha_w]").fill("2")
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.pilot.model.marks[2] !== 0")
    pilot, ghost = page.evaluate("[live.flight.pilot.model.marks[2], live.flight.ghost.model.marks[2]]")
    assert pilot == pytest.approx(vehicle.replaced({"alpha_w": 2.0}).response(HEAVE, 0.5)[0], rel=1e-12)
    assert ghost == pytest.approx(vehicle.response(HEAVE, 0.5)[0], rel=1e-12)
    assert page.is_checked("#live-ghost")
    page.click("#live-file")
    tuned = page.evaluate("names => names.map(name => live.flight.pilot.model.get(name))", [*vehicle.layout.tuning])
    assert tuned == [vehicle[name] for name in vehicle.layout.tuning]


def test_a_vehicle_of_one_axis_flies_too(pages: Callable[[str], str], quiet: Visitor) -> None:
    page = flying(quiet, pages("bare")).page
    page.select_option("#live-test", index=0)
    page.click("#live-run")
    until(page, "live.flight.time > 0.3")
    assert page.evaluate("live.flight.pilot.model.get('z')") > 0.0
    assert page.locator("#live-picture").count() == page.locator("#live-compass").count() == 0
    chart = page.locator("#live-chart-heave")
    assert chart.evaluate("svg => svg.viewBox.baseVal.width === svg.clientWidth"), "text has the page's size"


def test_words_fit_their_places(tmp_path: Path, quiet: Visitor) -> None:
    file, target = tmp_path / "long.toml", tmp_path / "long.html"
    name = "a_name_of_a_thruster_as_may_be"
    file.write_text(BARE.read_text(encoding="utf-8").replace('name = "t"', f'name = "{name}"'), encoding="utf-8")
    assert main(["fly", str(file), "-o", str(target)]) == 0
    page = flying(quiet, target.as_uri()).page
    wide, room = page.evaluate("(span => [span.scrollWidth, span.clientWidth])(document.querySelector('label span'))")
    assert wide <= room
    title, marks = "surge: u \N{MINUS SIGN}1.165 m/s", "V_ss \N{MINUS SIGN}1.211 · Tau 10.65 s"
    lengths = page.evaluate(
        """words => [live.charts[0].title, live.charts[0].marks].map((text, n) => {
            text.textContent = words[n];
            return text.getComputedTextLength();
        })""",
        [title, marks],
    )
    assert sum(lengths) < 298, "the width from which both stand on one line"


def test_a_heading_is_below_360_and_a_track_far_away_is_drawn(page: Any) -> None:
    page.evaluate("() => { live.flight.pilot.model.set('psi', -0.005); live.draw(); }")
    assert page.inner_text("#live-readings").endswith("heading 0°")
    lines = page.evaluate("""() => {
        live.flight.pilot.model.set("x", 1e17);
        live.zoom(1000);
        live.draw();
        return live.picture.grid.getAttribute("d").split("M").length;
    }""")
    assert lines < 40
    assert "north 1.00e17 m" in page.inner_text("#live-readings")


def test_loads_and_current_act(page: Any, vehicle: Vehicle) -> None:
    page.locator("summary", has_text="Loads").click()
    page.evaluate("live.pause(true)")  # so that both act from the start
    page.locator("input[name=Z_ext]").fill("1")
    page.locator("input[name=V_E]").fill("0.5")
    assert page.evaluate("live.flight.time") == 0.0
    page.evaluate("live.pause(false)")
    until(page, "live.flight.time > 1")
    time, y, z = page.evaluate("[live.flight.time, ...['y', 'z'].map(name => live.flight.pilot.model.get(name))]")
    rest = dict.fromkeys([*vehicle.layout.inputs, *vehicle.layout.state], 0.0)
    assert z > 0.9 * vehicle.step(rest | {"Z_ext": 1.0}, rest, time)["z"] > 0.0
    assert 0.4 * time < y <= 0.5 * time


def test_another_vehicle_flies_the_same_commands_as_a_ghost(tmp_path: Path, quiet: Visitor) -> None:
    target = tmp_path / "both.html"
    assert main(["fly", "videoray", "--against", "bluerov2", "-o", str(target)]) == 0
    page = flying(quiet, target.as_uri()).page
    other = load_vehicle(SHIPPED["bluerov2"])
    ghost = page.evaluate("""() => {
        live.pause(true);
        live.flight.isBounded = false;
        live.flight.set({ u_l: 0.5, u_r: 0.3, u_t: -0.2 });
        live.flight.advance(3);
        return [...live.flight.ghost.model.values];
    }""")
    demands = {"surge": 0.4, "yaw": 0.1, "heave": -0.2}
    inputs = dict.fromkeys(other.layout.inputs, 0.0)
    for form in other.layout.axes:
        for name, sign in other.layout.signs(form.axis).items():
            inputs[name] += sign * demands.get(form.axis.name, 0.0)
    expected = other.step(inputs, dict.fromkeys(other.layout.state, 0.0), 3.0)
    names = [v.name for v in variables(other)]
    assert {name: ghost[names.index(name)] for name in expected} == pytest.approx(expected, rel=1e-11, abs=1e-12)
    assert page.is_checked("#live-ghost")


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_the_ring_around_the_chosen_picture_leaves_the_title_free(
    pages: Callable[[str], str], quiet: Visitor, width: int, height: int
) -> None:
    page = flying(quiet, pages("videoray"), width=width, height=height).page
    style = page.locator("#live-stage").evaluate(
        "stage => (({ outlineStyle, outlineWidth, outlineOffset }) => "
        "[outlineStyle, parseFloat(outlineWidth), parseFloat(outlineOffset)])(getComputedStyle(stage))"
    )
    assert style[0] == "solid", "the picture has the focus on load"
    title, stage = page.locator("h1").evaluate(BOX), page.locator("#live-stage").evaluate(BOX)
    assert title["bottom"] <= stage["top"] - style[1] - style[2]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
@pytest.mark.parametrize("kind", ["videoray", "heavy", "six"])
def test_the_picture_and_an_even_grid_of_charts_fit_one_screen(
    kind: str, pages: Callable[[str], str], quiet: Visitor, tmp_path: Path, width: int, height: int, scheme: str
) -> None:
    page = flying(quiet, pages(kind), width=width, height=height, scheme=scheme).page
    page.select_option("#live-test", index=0)
    page.click("#live-run")
    until(page, "live.flight.time > 0.1")
    page.evaluate("scrollTo({ top: 0, behavior: 'instant' })")
    page.screenshot(path=tmp_path / f"{kind}-{width}-{scheme}.png")
    picture = page.locator("#live-picture").evaluate(BOX)
    boxes = [chart.evaluate(BOX) for chart in page.locator(".charts svg").all()]
    assert len(boxes) == page.evaluate("live.vehicle.axes.length")
    assert picture["width"] > 0.6 * width
    assert picture["height"] > 0.25 * height
    for box in (picture, *boxes):
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= width
        assert box["y"] + box["height"] <= height
    assert {(round(box["width"]), round(box["height"])) for box in boxes} == {
        (round(boxes[0]["width"]), round(boxes[0]["height"]))
    }
    assert min(boxes[0]["width"], 2 * boxes[0]["height"]) > 150
    in_rows = Counter(round(box["y"]) for box in boxes)
    assert len({*in_rows.values()}) == 1, "each row has as many charts"


_FOUR = (
    ("PS", "rear", (1.0, 0.0, 0.0), (-0.2, -0.19, 0.0)),
    ("SB", "rear", (1.0, 0.0, 0.0), (-0.2, 0.19, 0.0)),
    ("VF", "top", (0.0, 0.0, -1.0), (0.15, 0.0, 0.0)),
    ("VA", "top", (0.0, 0.0, -1.0), (-0.15, 0.0, 0.0)),
)
"""Two thrusters at the stern, and two that push vertically: name, curve, direction and position."""


@pytest.fixture(scope="module")
def four_thrusters(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of the page of a vehicle whose thrusters have long labels and are close together."""
    vehicle = load_vehicle(SHIPPED["videoray"])
    layout = replace(vehicle.layout, thrusters=tuple(thruster(*one) for one in _FOUR))
    rov = Vehicle(layout, {name: vehicle.coefficients[name] for name in layout.coefficients})
    target = tmp_path_factory.mktemp("four") / "four.html"
    target.write_text(fly_page([Flown(a_vehicle(rov), web_module(rov.layout))]), encoding="utf-8")
    return target.as_uri()


@pytest.mark.parametrize("heading", [0.0, 0.7, 2.0, 3.5, 5.0])
@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_labels_cover_no_thruster_no_other_label_and_neither_north_nor_a_stick(
    four_thrusters: str, quiet: Visitor, width: int, height: int, heading: float
) -> None:
    page = flying(quiet, four_thrusters, width=width, height=height).page
    for _ in range(2):  # from an angle, and from above
        found = page.evaluate(
            """heading => {
                live.pause(true);
                live.flight.pilot.model.set("psi", heading);
                live.look();
                live.draw();
                return ["text", ".tube"].map(kind =>
                    [...document.querySelectorAll(`#live-picture .craft:not(.ghostly) ${kind}`)])
                    .concat([[...document.querySelectorAll("#live-picture > .needle, .stick")]])
                    .map(list => list.map(one => one.getBoundingClientRect().toJSON()));
            }""",
            heading,
        )
        labels, tubes, others = found
        assert (len(labels), len(tubes), len(others)) == (4, 4, 3)
        for n, label in enumerate(labels):
            for other in (*labels[:n], *tubes, *others):
                assert shared(label, other) < 0.15 * label["width"] * label["height"], (label, other)


def shared(one: dict[str, float], other: dict[str, float]) -> float:
    """Return the area that two rectangles share."""
    wide = min(one["right"], other["right"]) - max(one["left"], other["left"])
    high = min(one["bottom"], other["bottom"]) - max(one["top"], other["top"])
    return max(0.0, wide) * max(0.0, high)


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_nothing_moves_when_a_message_comes_or_goes(
    pages: Callable[[str], str], quiet: Visitor, width: int, height: int
) -> None:
    page = flying(quiet, pages("videoray"), width=width, height=height).page
    assert page.inner_text("#live-message").startswith("Time starts")

    def places() -> list[Any]:
        return [page.locator(part).evaluate(BOX) for part in ("#live-stage", "#live-charts", "#live-controls")]

    before = places()
    page.evaluate("live.say('')")
    assert places() == before
    page.evaluate("live.say('short')")
    assert places() == before


def test_each_thruster_has_its_label_and_throws_its_jet_against_its_force(
    pages: Callable[[str], str], quiet: Visitor, heavy: Vehicle
) -> None:
    page = flying(quiet, pages("heavy"), width=1440).page
    labels = page.locator("#live-picture .craft:not(.ghostly) text").all_text_contents()
    # The file describes the thrusters by their corners too, in the words of the sea.
    for label, one in zip(labels, heavy.layout.thrusters, strict=True):
        words = label.replace("left", "port").replace("right", "starboard").split()
        assert all(word in one.description for word in words), (label, one.description)
        assert ("vertical" in words) == ("vertical" in one.description)
    tubes, jets, forces = page.evaluate("""() => {
        live.pause(true);
        live.look();
        live.flight.set({ u_1: -0.4, u_3: 0.4 });
        live.flight.advance(0.5);
        live.flight.pilot.model.set("psi", 0);
        live.draw();
        const middles = kind => [...document.querySelectorAll(`#live-picture .craft:not(.ghostly) ${kind}`)]
            .filter(path => path.getAttribute("d"))
            .map(path => path.getBBox()).map(({ x, y, width, height }) => [x + width / 2, y + height / 2])
            .sort((one, other) => one[1] - other[1]);
        const forces = ["F_1", "F_3"].map(name => live.flight.pilot.model.get(name));
        return [middles(".tube"), middles(".jet:not(.core)"), forces];
    }""")
    assert forces[0] < 0.0 < forces[1]
    assert (len(tubes), len(jets)) == (8, 2)
    middle = sum(x for x, _ in tubes) / 8
    # Those of the horizontal thrusters on the starboard side, seen from above with the bow up.
    inner = sorted((at for at in tubes if at[0] > middle), key=lambda at: at[0])[:2]
    front, rear = sorted(inner, key=lambda at: at[1])
    (front_jet, rear_jet) = jets
    assert heavy.layout.thrusters[0].direction.value[0] < 0.0 < heavy.layout.thrusters[2].direction.value[0]
    for jet, tube, n, force in ((front_jet, front, 0, forces[0]), (rear_jet, rear, 2, forces[1])):
        ahead, aside, _ = heavy.layout.thrusters[n].direction.value
        assert (tube[1] - jet[1]) * force * ahead < 0.0
        assert (jet[0] - tube[0]) * force * aside < 0.0


def test_reset_restores_commands_camera_speed_and_time(page: Any) -> None:
    before = page.evaluate("[{ ...live.picture.camera }, live.picture.magnified]")
    page.locator("input[name=u_t]").fill("0.5")
    for button in ("above", "nearer", "faster", "faster"):
        page.click(f"#live-{button}")
    until(page, "live.flight.time > 0.2")
    page.click("#live-pause")
    assert page.evaluate("[{ ...live.picture.camera }, live.picture.magnified]") != before
    assert page.inner_text("#live-speed") == "5×"
    page.click("#live-reset")
    page.wait_for_timeout(200)
    assert page.evaluate("[{ ...live.picture.camera }, live.picture.magnified]") == before
    assert page.evaluate("[live.flight.time, live.flight.pilot.model.get('z'), live.paused]") == [0, 0, False]
    assert page.inner_text("#live-speed") == "1×"
    assert page.input_value("input[name=u_t]") == "0"
    assert page.inner_text("#live-readings").startswith("0.0 s")


def test_time_stands_still_while_nothing_is_commanded(page: Any) -> None:
    page.wait_for_timeout(200)
    assert page.evaluate("live.flight.time") == 0
    page.evaluate("live.speed = 50")
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.time > 1")
    page.click("#live-still")
    until(page, "live.flight.isAtRest()")
    time = page.evaluate("live.flight.time")
    page.wait_for_timeout(200)
    assert page.evaluate("live.flight.time") == time
    page.locator("input[name=u_t]").fill("0.1")
    until(page, f"live.flight.time > {time}")


def test_a_step_test_stops_at_its_end_and_keeps_its_curve(page: Any, vehicle: Vehicle) -> None:
    page.evaluate("live.speed = 10")
    page.select_option("#live-test", label="heave 50 %")
    page.click("#live-run")
    until(page, "live.paused")
    V, Tau = vehicle.response(HEAVE, 0.5)
    assert page.evaluate("[live.flight.time, live.flight.times[0]]") == pytest.approx([ceil(6.0 * Tau), 0.0])
    assert "The test has ended." in page.inner_text("#live-message")
    marks = page.text_content("#live-chart-heave .marks")
    assert marks == f"V_ss {V:.3f} · Tau {Tau:.2f} s"
    curve = page.locator("#live-chart-heave path.line:not(.ghostly)").evaluate(BOX)
    chart = page.locator("#live-chart-heave").evaluate(BOX)
    assert curve["width"] > 0.8 * chart["width"]
    page.locator("input[name=u_t]").fill("0.2")
    until(page, f"live.flight.time > {ceil(6.0 * Tau)}")


def test_commands_that_are_set_while_time_stands_still_have_their_tau(page: Any) -> None:
    """Tau holds from rest: a command that is changed in motion shows V_ss only."""
    page.evaluate("live.pause(true)")
    for name in ("u_l", "u_r"):
        page.locator(f"input[name={name}]").fill("0.5")
    page.evaluate("live.pause(false)")
    until(page, "live.flight.time > 0.5 && live.flight.pilot.model.get('u') > 0.05")
    assert "Tau" in page.text_content("#live-chart-surge .marks")
    page.locator("input[name=u_r]").fill("0.4")
    until(page, "live.flight.pilot.model.get('u_r') === 0.4 && !live.changed")
    marks = page.text_content("#live-chart-surge .marks")
    assert "V_ss" in marks
    assert "Tau" not in marks


def test_sliders_show_the_command_that_acts_and_fill_from_the_middle(page: Any) -> None:
    slider = page.locator("input[name=u_l]")
    filled = "slider => ['--from', '--to'].map(name => Number(slider.style.getPropertyValue(name)))"
    assert slider.evaluate(filled) == [0.5, 0.5]
    slider.fill("0.25")
    assert slider.evaluate(filled) == [0.5, 0.625]
    page.focus("#live-stage")
    page.keyboard.down("KeyS")
    until(page, "live.flight.pilot.model.get('u_l') === -0.25")
    assert slider.input_value() == "-0.25"
    assert slider.get_attribute("aria-valuetext") == "−25 %"
    assert slider.evaluate(filled) == [0.375, 0.5]
    page.keyboard.up("KeyS")
    until(page, "document.querySelector('input[name=u_l]').value === '0.25'")
    page.evaluate("() => { navigator.getGamepads = () => [{ mapping: 'standard', axes: [0, 0, 0, -0.5] }]; }")
    until(page, "document.querySelector('input[name=u_l]').value === '0.75'")


def test_a_finger_on_a_stick_steers_until_it_is_lifted(browser: Any, pages: Callable[[str], str]) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto(pages("videoray"))
    page.wait_for_selector("#live-section:not([hidden])")
    box = page.locator("#live-right").evaluate(BOX)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    finger = context.new_cdp_session(page)
    touch = "Input.dispatchTouchEvent"
    finger.send(touch, {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    finger.send(touch, {"type": "touchMove", "touchPoints": [{"x": x, "y": y - 60}]})
    until(page, "live.flight.pilot.model.get('u_l') === 1 && live.flight.pilot.model.get('x') > 0.01")
    assert page.evaluate("scrollY") == 0
    finger.send(touch, {"type": "touchEnd", "touchPoints": []})
    until(page, "live.flight.pilot.model.get('u_l') === 0")
    context.close()


def test_the_charts_tell_the_values_under_the_pointer(page: Any, vehicle: Vehicle) -> None:
    page.locator("input[name=u_t]").fill("0.5")
    page.evaluate("() => { live.pause(true); live.flight.reset(); live.flight.advance(10); live.draw(); }")
    page.locator("#live-chart-surge").hover(position={"x": 150, "y": 60})
    until(page, "live.pointed !== null && !live.changed")
    words = page.text_content("#live-chart-heave .marks")
    (time,) = re.findall(r"^at (\S+) s$", words)
    rest = dict.fromkeys([*vehicle.layout.inputs, *vehicle.layout.state], 0.0)
    w = vehicle.step(rest | {"u_t": 0.5}, rest, float(time))["w"]
    title = page.text_content("#live-chart-heave .title")
    assert float(re.findall(r"w (\S+) m/s", title)[0]) == pytest.approx(w, abs=2e-3)
    box = page.locator("#live-chart-heave .scale").evaluate(BOX)
    chart = page.locator("#live-chart-surge").evaluate(BOX)
    heave = page.locator("#live-chart-heave").evaluate(BOX)
    assert box["x"] - heave["x"] == pytest.approx(150, abs=2), chart
    page.mouse.move(5, 5)
    until(page, "live.pointed === null && !live.changed")
    assert "V_ss" in page.text_content("#live-chart-heave .marks")


def test_an_exported_flight_can_be_flown_and_inspected(page: Any, tmp_path: Path) -> None:
    page.evaluate("""() => {
        live.pause(true);
        live.flight.isBounded = false;
        for (const commands of [{ u_l: 0.5, u_r: 0.4 }, { u_t: -0.3 }, { u_r: -0.2 }]) {
            live.flight.set(commands);
            live.flight.advance(2);
        }
        Object.assign(live.held, { u_l: 0.5, u_r: -0.2, u_t: -0.3 });
    }""")
    with page.expect_download() as download:
        page.click("#live-export")
    assert download.value.suggested_filename == "videoray.csv"
    log = tmp_path / "videoray.csv"
    download.value.save_as(log)
    check_replay(page, log)
    assert main(["identify", "--inspect", str(log)]) == 0


def check_replay(page: Any, log: Path) -> None:
    """Check that the page moves as in this flight, of which it has written the file."""
    drop(page, log.name, log.read_bytes())
    until(page, "live.flight.replay !== null")
    page.evaluate("live.pause(false); live.speed = 50")
    until(page, "live.paused && live.flight.replay && live.hasEnded()")
    line = page.inner_text("#live-message")
    deviations = [float(number) for number in re.findall(r"(?:surge|heave|yaw) (\S+) ", line)]
    assert len(deviations) == 3
    assert max(deviations) < 1e-12, line


@pytest.mark.parametrize("speed", [0.1, 1, 5])
def test_an_exported_flight_has_times_of_whole_microseconds(page: Any, tmp_path: Path, speed: float) -> None:
    """Frames of any length are flown again as they were, although their times are rounded."""
    page.evaluate(
        """speed => {
            live.speed = speed;
            const { frame } = live;
            live.frame = now => frame.call(live, now + Math.random());
        }""",
        speed,
    )
    page.locator("input[name=u_l]").fill("0.5")
    until(page, "live.flight.times.length > 20")
    page.locator("input[name=u_t]").fill("0.3")
    until(page, "live.flight.times.length > 40")
    page.evaluate("live.pause(true)")
    log = tmp_path / "videoray.csv"
    with page.expect_download() as download:
        page.click("#live-export")
    download.value.save_as(log)
    times = [line.split(",")[0] for line in log.read_text(encoding="utf-8").splitlines()[1:]]
    assert len(times) > 40
    assert all(re.fullmatch(r"\d+(\.\d{1,6})?", time) for time in times), times
    check_replay(page, log)


def test_a_link_contains_vehicle_commands_and_tuning(page: Any, pages: Callable[[str], str], visit: Visitor) -> None:
    page.locator("summary", has_text="Tuning").click()
    page.locator("input[name=u_t]").fill("-0.4")
    page.locator("input[name=alpha_w]").fill("1.5")
    page.evaluate("() => { navigator.clipboard.writeText = async () => { throw new Error('not allowed'); }; }")
    page.click("#live-share")
    link = page.url
    assert link == f"{pages('videoray')}#vehicle=videoray&u_t=-0.4&alpha_w=1.5"
    assert "address of this page" in page.inner_text("#live-message")
    there = flying(visit, link).page
    until(there, "live.flight.time > 0.2")
    assert there.evaluate("['u_t', 'alpha_w', 'u_l'].map(name => live.flight.pilot.model.get(name))") == [-0.4, 1.5, 0]
    for hash, message in (
        ("vehicle=heavy&u_1=1", "The link is for the vehicle “heavy”, and this page flies “videoray”."),
        (
            "vehicle=videoray&u_t=fast&u_x=1",
            "The link has values that this page cannot use: u_t=fast (must be a number from -1 to 1), "
            "u_x (not a value of this vehicle).",
        ),
    ):
        there.evaluate("hash => { location.hash = hash; }", hash)
        until(there, "!document.getElementById('live-message').textContent.startsWith('Time')")
        there.wait_for_timeout(100)
        assert there.inner_text("#live-message") == message


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ("u_t=7", "u_t=7 (must be a number from -1 to 1)"),
        ("u_t=", "u_t= (must be a number from -1 to 1)"),
        ("alpha_u=-3", "alpha_u=-3 (must be a number from 0.1 to 3.0)"),
        ("&".join(f"x{n}=1" for n in range(6)), "x3 (not a value of this vehicle), 2 more"),
    ],
)
def test_a_link_with_values_that_are_not_allowed_says_so_and_leaves_them_out(
    page: Any, given: str, reason: str
) -> None:
    page.evaluate("hash => { location.hash = hash; }", f"vehicle=videoray&u_l=0.25&{given}")
    until(page, "document.getElementById('live-message').textContent.startsWith('The link')")
    assert page.inner_text("#live-message").endswith(f"{reason}.")
    set_to = page.evaluate("['u_l', 'u_t', 'alpha_u'].map(name => live.flight.pilot.model.get(name))")
    start = page.evaluate("Number(document.querySelector('input[name=alpha_u]').dataset.start)")
    assert set_to == [0.25, 0.0, start]


def test_the_ghost_is_lightly_filled_and_each_line_has_its_own_dash(page: Any) -> None:
    style = "(path, name) => getComputedStyle(path)[name]"
    page.evaluate("() => { live.flight.ghostShown = true; live.draw(); }")
    assert 0.0 < float(page.locator(".ghostly .float.end").evaluate(style, "fillOpacity")) < 0.3
    assert page.locator(".ghostly .float.end").evaluate(style, "fill") != "none"
    chart = "#live-chart-heave "
    dashes = [
        page.locator(chart + name).evaluate(style, "strokeDasharray") for name in (".steady", ".measured", ".ghostly")
    ]
    assert len({*dashes}) == 3
    assert dashes[0].count(",") == 3, "the legend says: dashes and dots"
    assert page.inner_text(".legend").startswith("Dashes and dots: V")
    assert dashes[2] == "none"


def test_the_legend_tells_what_was_measured_only_where_something_was(
    pages: Callable[[str], str], quiet: Visitor
) -> None:
    """That is during a step test, and beside a recording."""
    legend = "#live-measured"
    tested = flying(quiet, pages("videoray")).page
    assert not tested.locator(legend).is_visible()
    tested.click("#live-run")
    until(tested, "live.flight.time > 0.1")
    assert tested.locator(legend).is_visible()
    page = flying(quiet, pages("everything")).page
    assert not page.locator(legend).is_visible()
    command, axis = page.evaluate("[live.vehicle.commands[0], live.vehicle.axes[0]]")
    header = f"time [s],{command} [%],{axis['name']} velocity [{axis['unit']}]"
    drop(page, "pool.csv", f"{header}\n0,0,0\n1,9,0\n2,9,0.1\n".encode())
    until(page, "live.flight.replay !== null && !live.changed || live.paused")
    assert page.locator(legend).is_visible()
    page.click("#live-reset")
    until(page, "live.flight.replay === null && !live.changed")
    assert not page.locator(legend).is_visible()


def test_a_compact_page_shows_the_picture_and_the_charts_in_a_small_frame(tmp_path: Path, quiet: Visitor) -> None:
    target, vehicle = tmp_path / "compact.html", load_vehicle(SHIPPED["videoray"])
    target.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))], compact=True), encoding="utf-8")
    page = flying(quiet, target.as_uri(), width=720, height=620).page
    for shown in ("#live-picture", "#live-chart-surge", "#live-reset", "#live-right"):
        box = page.locator(shown).evaluate(BOX)
        assert box["height"] > 15
        assert box["y"] + box["height"] <= 620
    assert not page.locator("#live-controls").is_visible()
    assert page.evaluate("document.documentElement.scrollHeight") <= 620


# ---- Recordings ------------------------------------------------------------------------------------------------------


def drop(page: Any, name: str, content: bytes) -> None:
    page.set_input_files("#live-recording", [{"name": name, "mimeType": "text/csv", "buffer": content}])


def a_recording(vehicle: Vehicle, form: Callable[[float], str] = repr) -> str:
    """A log of all axes at 10 Hz over 20 s, of the model itself in Python."""
    rng, lines = random.Random(1), ["time [s],u_l [%],u_r [%],u_t [%],surge velocity [m/s],depth [m],heading [deg]"]
    state = dict.fromkeys(vehicle.layout.state, 0.0)
    inputs = dict.fromkeys(vehicle.layout.inputs, 0.0)
    for n in range(200):
        if n % 25 == 5:
            inputs |= {name: rng.uniform(-0.8, 0.8) for name in vehicle.layout.commands}
        heading = (state["psi"] * 57.29577951308232 + 180.0) % 360.0 - 180.0
        cells = [n / 10.0, *(100.0 * inputs[c] for c in ("u_l", "u_r", "u_t")), state["u"], state["z"], heading]
        lines.append(",".join(map(form, cells)))
        state = vehicle.step(inputs, state, 0.1)
    return "\n".join(lines)


def test_a_recording_flies_again_beside_its_prediction(page: Any, vehicle: Vehicle) -> None:
    drop(page, "log_of_a_pool.csv", a_recording(vehicle).encode())
    until(page, "live.flight.replay !== null")
    page.evaluate("live.speed = 20")
    until(page, "live.paused")
    line = page.inner_text("#live-message")
    deviations = [float(number) for number in re.findall(r"(?:surge|heave|yaw) (\S+) ", line)]
    assert len(deviations) == 3
    assert max(deviations) < 1e-8, line  # the recording is that of the model
    assert page.is_checked("#live-ghost")
    page.click("#live-reset")
    assert not page.is_checked("#live-ghost"), "what was measured is gone"


@pytest.mark.parametrize("other", ["bluerov2_heavy", "bare"])
def test_what_was_measured_is_of_the_same_axes_in_a_ghost_of_others(other: str, tmp_path: Path, quiet: Visitor) -> None:
    target = tmp_path / "both.html"
    against = str(SHIPPED.get(other, BARE))
    assert main(["fly", "videoray", "--against", against, "-o", str(target)]) == 0
    page = flying(quiet, target.as_uri()).page
    page.evaluate("live.pause(true)")
    drop(
        page, "pool.csv", b"time [s],u_l [%],u_r [%],u_t [%],depth [m]\n0,0,0,9,0\n1,0,0,9,0.5\n2,0,0,9,1\n3,0,0,9,2\n"
    )
    until(page, "live.flight.replay !== null")
    page.evaluate("live.flight.advance(3)")
    ghost = page.evaluate("['z', 'w', 'v'].map(name => live.flight.ghost.model.get(name))")
    assert ghost == pytest.approx([2.0, 1.0, 0.0])


def test_a_log_may_be_written_otherwise_and_have_other_columns(pages: Callable[[str], str], quiet: Visitor) -> None:
    page = flying(quiet, pages("heavy")).page
    rows = [f"{n},1700,{0.5 * n},12.6,," for n in range(3)]
    header = "Time [S],U_5 [\N{GREEK SMALL LETTER MU}s],DEPTH [M],v [V]"
    drop(page, "pool.csv", "\n".join([header, *rows]).encode())
    until(page, "live.flight.replay !== null")
    recording = page.evaluate("live.flight.replay.recording")
    assert recording["commands"]["u_5"][2] == 0.5
    assert [signal["values"] for signal in recording["signals"]] == [[0.0, 0.5, 1.0]]
    assert recording["left"] == 0


STAMPS = [f"2026-07-01T23:59:5{n % 10},{25 * n:03}+02{':' * (n % 2)}00" for n in range(10)]
WRITTEN = {
    "dates": ["time [s];u_t [%];depth [m]", *(f"{stamp};{n};{n}" for n, stamp in enumerate(STAMPS))],
    "dates of UTC": ["time [s],u_t [%],depth [m]", *(f"2026-02-28 23:59:{50 + n}.5,{n},{n}" for n in range(10))],
    "rostopic": ["%time,u_t [%],-z [m]", *(f"{1_669_909_208_000_000_000 + 10**8 * n},{n},{-n}" for n in range(10))],
    "pressure": ["time [s],t [us 1520 320],pressure [kPa]", *(f"{n},{1520 + n},{101.325 + n}" for n in range(10))],
    "depth before pressure": ["time [s],-u_t [%],depth [cm],pressure [kPa]", *(f"{n},{n},{n},120" for n in range(10))],
    "force": ["time [us],u_t [N.m 40],z [mm],voltage [V]", *(f"{10**6 * n},{n},{n},16" for n in range(10))],
}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_log_is_read_as_identify_reads_it(name: str, page: Any, vehicle: Vehicle, tmp_path: Path) -> None:
    log = tmp_path / "pool.csv"
    log.write_text("\n".join(WRITTEN[name]), encoding="utf-8")
    drop(page, log.name, log.read_bytes())
    until(page, "live.flight.replay !== null")
    recording = page.evaluate("live.flight.replay.recording")
    (read,) = read_logs(log, vehicle.layout, Names())
    depth = read.used("depth")
    assert depth is not None
    assert read.commands is not None
    assert recording["times"] == pytest.approx(depth.time - depth.time[0], abs=1e-6)
    command = read.commands.at(read.commands.rows)[:, read.commands.thrusters.index("t")]
    assert recording["commands"]["u_t"] == pytest.approx(command)
    assert command.any()
    (signal,) = recording["signals"]
    assert signal["values"] == pytest.approx(depth.values, abs=1e-9)


def test_the_restarts_of_a_clock_are_those_that_identify_sees(page: Any) -> None:
    """Random clocks: set back, set to 0, late rows, and rows in no order."""
    rng = np.random.default_rng(5)
    clocks = [np.arange(30.0)]
    for _ in range(300):
        pieces = [rng.integers(-40, 40) + np.sort(rng.integers(0, 40, rng.integers(1, 40))) for _ in range(4)]
        clocks.append(np.concatenate(pieces).astype(float))
    clocks += [rng.permutation(40).astype(float) for _ in range(20)]
    found = page.evaluate(
        "clocks => clocks.map((times) => restarts(times, live.vehicle.csv))", [times.tolist() for times in clocks]
    )
    restarting = 0
    for times, one in zip(clocks, found, strict=True):
        rows = restart_rows(times)
        parts = np.split(times, rows)
        late = sum(int((part < np.maximum.accumulate(part)).sum()) for part in parts)
        assert one == {"starts": [0, *rows], "back": late}
        restarting += bool(rows)
    assert 50 < restarting < len(clocks) - 50


def test_the_units_and_names_are_those_that_identify_reads(page: Any, vehicle: Vehicle, tmp_path: Path) -> None:
    """The last rows come after the clock was set back, so they are another recording."""
    titles = ["time [ms]", "Thruster, port [V]", "l [\N{MICRO SIGN}s 1500 -400]", "u_r [N 40]", "u_t [%]"]
    titles += ["heave depth [cm]", "yaw rate [deg/s]", "HEADING [deg]", "surge speed [mm/s]", "Notes"]
    header = ";".join(f'"{title}"' for title in titles)
    cells = ((100 * n, 12.5, 1500 - n, -10, n, 2.5 * n, 1.5 * n, 15 * n, -n, "-") for n in range(30))
    lines = [header, *(";".join(map(str, row)).replace(".", ",") for row in cells)]
    lines += lines[1:13]
    log = tmp_path / "pool.csv"
    log.write_text("\n".join(lines), encoding="utf-8")
    drop(page, log.name, log.read_bytes())
    until(page, "live.flight.replay !== null")
    recording = page.evaluate("live.flight.replay.recording")
    read, _ = read_logs(log, vehicle.layout, Names())
    assert recording["times"] == pytest.approx(np.arange(30) / 10)
    assert read.commands is not None
    commands = [recording["commands"][f"u_{name}"] for name in read.commands.thrusters]
    assert pytest.approx(read.commands.at(read.commands.rows)) == np.array(commands).T
    signals = {(s["axis"], s["isPosition"]): s["values"] for s in recording["signals"]}
    axes = [form.axis for form in vehicle.layout.axes]
    expected = {(axes.index(c.quantity.axis), not c.quantity.is_velocity): c for c in read.channels if c.quantity.axis}
    assert {"surge velocity", "yaw velocity", "depth", "heading"} == {c.quantity.name for c in read.channels}
    for key, values in signals.items():
        assert values == pytest.approx(expected[key].values, rel=1e-12)
    assert recording["left"] == 12


def test_commands_of_thrusters_are_flown_by_a_vehicle_with_mixed_inputs(
    pages: Callable[[str], str], quiet: Visitor, tmp_path: Path
) -> None:
    """The inputs give the commands in the first log, but not those in the second, which has one thruster alone."""
    vehicle = four_axes(load_vehicle(FILES["everything"]))
    layout, rng = vehicle.layout, np.random.default_rng(3)
    mix = np.array([[layout.gains[t.name].get(name, 0.0) for name in layout.commands] for t in layout.thrusters])
    inputs = rng.uniform(-0.3, 0.3, (30, len(layout.commands)))
    titles = [f"thruster {t.name} [%]" if n % 2 else f"{t.name.upper()} [1]" for n, t in enumerate(layout.thrusters)]
    page, log = flying(quiet, pages("everything")).page, tmp_path / "pool.csv"
    for fractions, told in ((inputs @ mix.T, False), (np.eye(len(titles))[np.zeros(30, int)], True)):
        cells = fractions * [100.0 if "%" in title else 1.0 for title in titles]
        rows = [",".join(map(repr, [n / 10, *row, n / 100])) for n, row in enumerate(cells.tolist())]
        log.write_text("\n".join([",".join(["time [s]", *titles, "depth [m]"]), *rows]), encoding="utf-8")
        page.evaluate("live.flight.replay = null")
        drop(page, log.name, log.read_bytes())
        until(page, "live.flight.replay !== null")
        recording = page.evaluate("live.flight.replay.recording")
        (read,) = read_logs(log, layout, Names())
        assert read.commands is not None
        assert read.commands.at(read.commands.rows) == pytest.approx(fractions)
        flown = np.array([recording["commands"][name] for name in layout.commands]).T @ mix.T
        assert bool(np.abs(flown - fractions).max() > 0.1) is told
        assert ("The inputs of this vehicle give these commands only to" in page.inner_text("#live-message")) is told
        best = np.linalg.lstsq(mix, fractions.T, rcond=None)[0].T
        assert flown == pytest.approx(np.clip(best, -1.0, 1.0) @ mix.T)


@pytest.mark.parametrize("kind", ["videoray", "everything"])
@pytest.mark.parametrize("axis", [None, HEAVE], ids=["dive", "log of heave"])
def test_every_column_that_identify_reads_is_read(
    kind: str, axis: Axis | None, pages: Callable[[str], str], quiet: Visitor, tmp_path: Path
) -> None:
    """Each name of each column of the catalogue, in each of its units, beside a column of another kind."""
    layout = four_axes(load_vehicle(FILES[kind])).layout
    known = columns_of_log(layout, axis)
    command = next(name for name, one in known.items() if one.commands)
    logs = []
    for name, one in known.items():
        beside = f"{command} [%]" if not one.commands else "depth [m]"
        for title in (name, *one.column.also):
            for unit in (
                *one.column.units,
                *(f"{unit} 2000" for unit in one.column.conversions if unit[0] == "N"),
                "us",
            ):
                header = f"time [s],{beside},{title.upper()} [{unit}]" + ("" if one.commands else ",voltage [V]")
                rows = [f"{n},{n},{1000 + n}{'' if one.commands else ',12'}" for n in range(30)]
                logs.append("\n".join([header, *rows]))
    path = tmp_path / ("log_heave.csv" if axis else "dive.csv")
    page = flying(quiet, pages(kind)).page
    flown = page.evaluate(
        """([texts, name]) => texts.map((text) => {
            try { return readRecording(text, name, live.vehicle); } catch (error) { return error.message; }
        })""",
        [logs, path.name],
    )
    read_by_both = 0
    for text, recording in zip(logs, flown, strict=True):
        path.write_text(text, encoding="utf-8")
        try:
            (log,) = read_logs(path, layout, Names(), axis)
        except DataFileError:
            continue
        axes = [form.axis for form in layout.axes]
        used = {
            (c.quantity.axis, not c.quantity.is_velocity): c for c in log.channels if c.quantity.axis and not c.unused
        }
        used = {key: channel for key, channel in used.items() if key[0] in axes}
        if not used or not log.commands:
            continue
        assert isinstance(recording, dict), f"{text[:80]}: {recording}"
        for signal in recording["signals"]:
            channel = used[axes[signal["axis"]], signal["isPosition"]]
            assert np.sin(signal["values"]) == pytest.approx(np.sin(unwrapped(channel)), abs=1e-6), text[:80]
        assert {axes[signal["axis"]] for signal in recording["signals"]} == {one for one, _ in used}
        read_by_both += 1
    assert read_by_both > 20


HULL: dict[str, tuple[str, Callable[[int], str], list[str]]] = {
    "in the water": (
        "pressure [kPa],surge velocity [m/s]",
        lambda n: f"{101.3 + 0.1 * n},{0.01 * n}",
        ["heave", "surge"],
    ),
    "in the hull": ("pressure [kPa],surge velocity [m/s]", lambda n: f"{101.3 + 0.001 * n},{0.01 * n}", ["surge"]),
    "of another unit": ("pressure [Pa],surge velocity [m/s]", lambda n: f"{101.3 + 0.1 * n},{0.01 * n}", ["surge"]),
    "beside a depth that froze": ("depth [m],pressure [kPa]", lambda n: f"1,{101.3 + 0.1 * n}", ["heave"]),
}


@pytest.mark.parametrize("name", HULL)
def test_a_barometer_is_used_as_identify_uses_it(name: str, page: Any, vehicle: Vehicle, tmp_path: Path) -> None:
    titles, cells, axes = HULL[name]
    log = tmp_path / "pool.csv"
    rows = [f"{n},{n},{cells(n)}" for n in range(40)]
    log.write_text("\n".join([f"time [s],u_t [%],{titles}", *rows]), encoding="utf-8")
    drop(page, log.name, log.read_bytes())
    until(page, "live.flight.replay !== null")
    signals = page.evaluate("live.flight.replay.recording.signals")
    (read,) = read_logs(log, vehicle.layout, Names())
    used = {c.quantity.axis.name: c.values for c in read.channels if c.quantity.axis and not c.unused}
    flown = {vehicle.layout.axes[s["axis"]].axis.name: s["values"] for s in signals}
    assert sorted(flown) == sorted(used) == axes
    for axis, values in flown.items():
        assert values == pytest.approx(used[axis])
    assert ("The pressure is not used" in page.inner_text("#live-message")) is ("heave" not in axes)


def test_a_log_of_one_axis_is_known_by_its_name(page: Any) -> None:
    rows = [f"{n / 5:g};{0 if n < 5 else 40};{0.01 * n:g}".replace(".", ",") for n in range(100)]
    drop(page, "log_heave_2.csv", "\n".join(["time [s];command [%];depth [cm]", *rows]).encode())
    until(page, "live.flight.replay !== null")
    recording = page.evaluate("live.flight.replay.recording")
    assert {name: values[5] for name, values in recording["commands"].items()} == {"u_l": 0.0, "u_r": 0.0, "u_t": 0.4}
    (depth,) = recording["signals"]
    assert depth["isPosition"]
    assert depth["values"][-1] == pytest.approx(0.0099)


BAD = {
    "empty": (b"", "less than two rows"),
    "bytes": (bytes(range(256)) * 40, "no column"),
    "other columns": (b"a,b\n1,2\n3,4\n", "no column \N{LEFT DOUBLE QUOTATION MARK}time"),
    "header of another logger": (
        b"t [s],u_l [%],depth [m]\n0,9,0\n1,9,1\n",
        "; if another header stands for it, rename that one: this page does not read [columns] of rov.toml.",
    ),
    "no command": (
        b"time [s],depth [m]\n0,1\n1,2\n",
        "no column of a command, such as \N{LEFT DOUBLE QUOTATION MARK}u_l [%]",
    ),
    "no motion": (
        b"time [s],u_l [%],Depth (m)\n0,1,0\n1,2,0\n",
        "such as \N{LEFT DOUBLE QUOTATION MARK}surge velocity [m/s]\N{RIGHT DOUBLE QUOTATION MARK}; if another header",
    ),
    "no axis": (b"time [s],command [%],depth [m]\n0,1,0\n1,2,0\n", "call it log_surge.csv"),
    "unit": (b"time [s],u_l [kg],depth [m]\n0,1,0\n1,2,0\n", "u_l [kg]\N{RIGHT DOUBLE QUOTATION MARK} has no unit"),
    "length": (b"time [s],u_l [%],depth [deg]\n0,1,0\n1,2,0\n", "has no unit that this column can have"),
    "velocity": (b"time [s],u_l [%],surge velocity [m]\n0,1,0\n1,2,0\n", "has no unit that this column can have"),
    "words": (b"time [s],u_l [%],depth [m]\nx,y,z\nx,y,z\n", "no two of its rows"),
    "many rows": (b"time [s],u_l [%],depth [m]\n" + b"0,1,0\n" * 200_001, "more than 200000 rows"),
    "huge": (b"time [s],u_l [%],depth [m]\n" + b"0,1,0\n" * 4_000_000, "larger than 20 MB"),
    "fractions": (
        b"time [s],u_l [%],depth [m]\n0,0.2,0\n1,0.5,0\n",
        "no command exceeds 1 %. Are they fractions? Then write [1]",
    ),
    "fractional pulses": (b"time [s],u_l [us],depth [m]\n0,0.2,0\n1,0.5,0\n", "fractions under [us]? Write [1]"),
    "pulses in percent": (b"time [s],u_l [us],depth [m]\n0,20,0\n1,50,0\n", "percent under [us]? Write [%]"),
    "dates": (b"time [s],u_l [%],depth [m]\n2026-13-01 00:00,9,0\n1.2.2026,9,0\n", "no two of its rows"),
    "two logs": (b"time [s],u_l [%],depth [m]\n" + b"0,9,0\n1,9,0\n2,9,0\n" * 2, "its time goes back, and stays back"),
    "far": (b"time [s],u_l [%],depth [m]\n0,9,0\n1,9,1e308\n", "numbers that no vehicle reaches"),
    "hull": (b"time [s],u_t [%],pressure [Pa]\n0,9,101000\n1,9,101002\n", "the barometer seems to be inside the hull"),
    "twice": (b"time [s],u_l [%],depth [m],z [m]\n0,9,0,0\n1,9,1,1\n", "two of its columns tell the same of heave"),
    "long": (b"time [s],u_l [%],depth [m]\n0,9,0\n1e9,9,0\n", "longer than a day"),
}


def test_the_page_says_why_a_file_is_no_recording_and_the_model_flies_on(page: Any) -> None:
    page.locator("input[name=u_l]").fill("0.5")
    for name, (content, expected) in BAD.items():
        page.evaluate("live.say('')")
        drop(page, f"{name}.csv", content)
        until(page, "document.getElementById('live-message').textContent !== ''")
        line = page.inner_text("#live-message")
        assert line.startswith(f"{name}.csv cannot be flown: "), line
        assert expected in line, line
        time = page.evaluate("live.flight.time")
        until(page, f"live.flight.time > {time}")
        assert page.evaluate("live.flight.pilot.model.get('u_l')") == 0.5


# ---- The page --------------------------------------------------------------------------------------------------------


def test_a_file_is_taken_where_it_is_dropped(page: Any, vehicle: Vehicle) -> None:
    page.evaluate("document.getElementById('live-picture').dispatchEvent(new DragEvent('dragover', { bubbles: true }))")
    outline = "() => getComputedStyle(document.querySelector('.deck')).outlineStyle"
    assert page.evaluate(outline) == "dashed", "the page shows that it takes the file"
    page.evaluate(
        """text => {
            const dataTransfer = new DataTransfer();
            dataTransfer.items.add(new File([text], "pool.csv"));
            document.getElementById("live-picture").dispatchEvent(
                new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
        }""",
        a_recording(vehicle),
    )
    until(page, "live.flight.replay !== null")
    assert page.evaluate(outline) == "none"
    page.locator("input[name=u_t]").fill("0.5")
    until(page, "live.flight.pilot.model.get('u_t') === 0.5")
    assert page.evaluate("live.flight.replay") is None, "the pilot has control again"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_axe_finds_nothing_and_it_fits(
    pages: Callable[[str], str], quiet: Visitor, tmp_path: Path, width: int, scheme: str
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page = flying(quiet, pages("videoray"), width=width, scheme=scheme).page
    for summary in page.locator("summary").all():
        summary.click()
    page.click("#live-run")
    page.wait_for_timeout(500)
    page.screenshot(path=tmp_path / f"fly-{width}-{scheme}.png", full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert axe.Axe().run(page).response["violations"] == []


def test_the_page_says_that_a_browser_cannot_fly_it(pages: Callable[[str], str], quiet: Visitor) -> None:
    seen = quiet()
    seen.page.add_init_script("delete globalThis.WebAssembly")
    seen.page.goto(pages("videoray"))
    seen.page.wait_for_selector("#live-sorry:not([hidden])")
    assert not seen.page.locator("#live-section").is_visible()


def test_without_scripts_and_on_paper_the_page_of_the_fmu_is_as_it_was(
    videoray_dir: Path, browser: Any, visit: Visitor
) -> None:
    url = (videoray_dir / "documentation" / "index.html").as_uri()
    plain = browser.new_page(java_script_enabled=False)
    plain.goto(url)
    assert not plain.locator("#live-section").is_visible()
    assert not plain.locator("#live-link").is_visible()
    plain.close()
    page = flying(visit, url).page
    assert page.locator("#live-link").is_visible()
    page.emulate_media(media="print")
    assert not page.locator("#live-section").is_visible()


def test_on_paper_the_flight_page_has_its_picture_and_charts_without_controls(page: Any) -> None:
    page.emulate_media(media="print")
    for place in ("#live-picture", "#live-readings", "#live-chart-surge"):
        assert page.locator(place).is_visible()
    for place in ("#live-controls", "#live-pause", "#live-keys"):
        assert not page.locator(place).is_visible()
