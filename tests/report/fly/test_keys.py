"""Keys and sticks: a turn leaves the force ahead, commands stay in the tested range, and both are shown."""

from collections.abc import Callable
from typing import Any

import pytest

from rov_fmu.equation.catalogue import SURGE
from tests.often import spread
from tests.report.conftest import flown_vehicle, get, until
from tests.report.test_live import BOX

pytestmark = pytest.mark.interop

_COMMANDS = "([demands, most]) => commandsOf(live.vehicle, new Map(Object.entries(demands)), most)"
_STEADY = """([demands, most]) => {
    live.pause(true);
    const { flight } = live;
    flight.set(commandsOf(live.vehicle, new Map(Object.entries(demands)), most));
    flight.advance(20);
    return flight.pilot.model.get("u");
}"""


def test_a_turn_leaves_force_and_speed_and_stays_in_the_tested_range(page: Any) -> None:
    """W alone gives the steady velocity of 50 %, 1.05 m/s. With D the VideoRay once went ahead at 1.70 m/s, because
    thrust grows with the square of a command."""
    V, _ = flown_vehicle("videoray").response(SURGE, 0.5)
    assert page.evaluate(_STEADY, [{"surge": 0.5}, 0.7]) == pytest.approx(V, rel=1e-6)
    assert page.evaluate(_STEADY, [{"surge": 0.5, "yaw": 0.5}, 0.7]) == pytest.approx(V, rel=0.01)
    for demands, most in (
        ({"surge": 0.5, "yaw": 0.5}, 0.7),
        ({"surge": -0.5, "yaw": 0.5}, 0.7),
        ({"surge": 0.6, "yaw": 1.0}, 1.0),
        ({"surge": 0.1, "yaw": 0.5}, 0.7),
    ):
        given = page.evaluate(_COMMANDS, [demands, most])
        ahead = sum(command * abs(command) for command in (given["u_l"], given["u_r"]))
        assert ahead == pytest.approx(2.0 * demands["surge"] * abs(demands["surge"])), "as much quadratic thrust"
        assert max(map(abs, given.values())) <= most
        assert given["u_l"] > given["u_r"], "it turns to starboard"
    hardest = page.evaluate(_COMMANDS, [{"surge": 0.7, "yaw": 0.7}, 0.7])
    assert 0.6 < hardest["u_l"] <= 0.7
    assert hardest["u_r"] < 0.4, "it can still turn"


@pytest.mark.parametrize(
    "kind", spread(["bluerov2", "heavy", "everything", "six", "thrust effects"], ["everything", "six"])
)
def test_no_demand_of_any_vehicle_exceeds_the_largest_command(kind: str, fly: Callable[..., Any]) -> None:
    page = fly(kind)
    axes = page.evaluate("live.vehicle.axes.map(({ name }) => name)")
    for n in range(3 ** len(axes)):
        signs = {name: float(n // 3**k % 3 - 1) for k, name in enumerate(axes)}
        given = page.evaluate(_COMMANDS, [signs, 0.6])
        assert max(map(abs, given.values())) <= 0.6 + 1e-12


def test_keys_stay_in_the_range_until_the_pilot_asks_for_more_and_that_is_marked(page: Any) -> None:
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    page.keyboard.down("KeyD")
    until(page, "live.flight.time > 0.5")
    assert get(page, "u_l", "u_r") == pytest.approx([0.21**0.5 + 0.2, 0.21**0.5 - 0.2])
    assert "beyond" not in page.inner_text("#live-readings")
    assert not page.locator("#live-untested").is_visible()
    page.locator("#live-strength").fill("1")
    assert page.locator(".untested").inner_text() == "100 %", "that of the keys"
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.pilot.model.get('u_l') > 0.7")
    until(page, "document.querySelector('#live-readings').textContent.includes('beyond the tested range: u_l')")
    assert page.locator("#live-untested").is_visible()
    slider = page.locator("input[name=u_l]")
    assert (slider.get_attribute("aria-valuetext") or "").endswith("beyond the tested range")
    strip = page.evaluate(
        """() => {
            const { board, plot } = live.charts[0];
            live.draw();
            const ratio = board.canvas.width / board.width;
            const row = Math.round((plot.bottom - 2) * ratio);
            const { data } = board.pen.getImageData(0, row, board.canvas.width, 1);
            let marked = 0;
            for (let n = 0; n < data.length; n += 4) marked += data[n] > 150 && data[n + 2] < 80 && data[n + 3] > 200;
            return marked;
        }"""
    )
    assert strip > 0, "the chart marks when"


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("videoray", {"left": "↔ turn ↕ depth", "right": "↕ ahead"}),
        ("bluerov2", {"left": "↔ turn ↕ depth", "right": "↔ aside ↕ ahead"}),
        ("remus100", {"right": "↕ ahead"}),
    ],
)
def test_a_stick_says_what_it_moves_and_moves_nothing_else(
    kind: str, expected: dict[str, str], fly: Callable[..., Any]
) -> None:
    """No thruster of the REMUS 100 turns it or makes it dive: its fins need speed."""
    page = fly(kind)
    words = {}
    for side in ("left", "right"):
        stick = page.locator(f"#live-{side}")
        if stick.count():
            words[side] = " ".join(stick.locator("xpath=following-sibling::span").inner_text().split())
            box = stick.evaluate(BOX)
            page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            page.mouse.down()
            page.mouse.move(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2, steps=3)
            moved = page.evaluate("live.sticks.map((stick) => stick?.at)")[side == "right"]
            assert (moved[0] > 0.9) == ("↔" in words[side])
            page.mouse.up()
    assert words == expected
    driven = page.evaluate("[...new Set(Object.values(live.driving).map(([name]) => name))]")
    shown = page.evaluate("live.vehicle.axes.filter(({ signs }) => Object.keys(signs).length).map(({ name }) => name)")
    assert {*driven} == {*shown}
