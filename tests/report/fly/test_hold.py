"""The page holds a vehicle by its own gains or as ArduSub does, by the law in C, and what a pilot does with it."""

from collections.abc import Callable, Iterator
from math import degrees
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rov_fmu.autopilot.ardusub import RATE, Mixer, loops_of
from rov_fmu.autopilot.flights import Flights
from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.autopilot.law import GAINS, LOOP, PLACE, SENSORS, STICK, Sharing
from tests.often import spread
from tests.report.conftest import flown_vehicle, get, until

pytestmark = pytest.mark.interop


@pytest.fixture
def page(fly: Callable[..., Any]) -> Any:
    """The page of the BlueROV2 Heavy, which rolls and pitches."""
    return fly("bluerov2_heavy")


@pytest.mark.parametrize("kind", spread(["bluerov2_heavy", "videoray"], ["bluerov2_heavy"]))
@pytest.mark.parametrize("law", ["own", "ardusub"])
def test_the_page_flies_as_the_law_does_in_python(kind: str, law: str, fly: Callable[..., Any]) -> None:
    """6 s ahead and aside by sticks, at a depth of 2 m and a heading of 0.5 rad, to which it has to turn."""
    page, vehicle, ahead, aside = fly(kind), flown_vehicle(kind), 0.4, 0.6
    page.evaluate(
        """([law, ahead, aside]) => {
            live.pause(true);
            const { flight } = live;
            const { model } = flight.pilot;
            Object.assign(flight, { held: law, isBounded: false });
            model.set("z", 2);
            model.turn();
            flight.steer({ demands: new Map([["surge", ahead], ["sway", aside]]), added: {} });
            flight.advance(0.05);
            Object.assign(flight.pilot.helm, { heading: 0.5, depth: 2.3 });
            flight.advance(5.95);
        }""",
        [law, ahead, aside],
    )
    numbers = np.array(page.evaluate("name => live.flight.pilot.model.lawOf(name).numbers", law))
    own = autopilot_of(vehicle)
    loops, sharing = own.loops, own.sharing
    if law == "ardusub":
        loops, sharing = loops_of({}, 1)[0], Mixer(vehicle).sharing
    assert numbers[: loops.size * len(GAINS)] == pytest.approx(loops.view("f8"), rel=1e-6)
    given = SimpleNamespace(numbers=numbers[loops.size * len(GAINS) :], of_axis=sharing.of_axis, pulse=sharing.pulse)
    loops = numbers[: loops.size * len(GAINS)].view(LOOP)
    rate = 60 if law == "own" else RATE  # the page steps 0.05 s, in which it samples three times
    has = vehicle.layout.has_attitude
    mode = [STICK, STICK, PLACE, *([PLACE, PLACE] if has else [STICK, STICK]), PLACE]
    aims = np.tile([ahead, aside, 2.3, 0.0, 0.0, 0.5], (6 * rate + 1, 1))
    aims[: rate // 20, [2, 5]] = 2.0, 0.0
    flights = Flights(vehicle, cast(Sharing, given), [{"z": 2.0}])
    flown = flights.fly(loops, np.tile(mode, (len(aims), 1)), aims, 1.0 / rate)
    expected = dict(zip(SENSORS, flown.sensors[0, -1], strict=True))
    names = [name for name in SENSORS if name in vehicle.layout.places]
    assert abs(expected["psi"] - 0.5) < 0.1
    assert get(page, *names) == pytest.approx([expected[name] for name in names], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("law", "most"), [("own", 60.0), ("ardusub", 35.0)])
def test_the_heavy_flies_ahead_at_full_thrust_without_turning_over(page: Any, law: str, most: float) -> None:
    """It goes on with the keys of a pilot: 20 s of W at 100 %, which leaves little thrust to level it.

    It begins at the surface, where the own gains let it lean by 47 degrees for a moment.
    """
    assert page.input_value("#live-hold") == "own"
    assert "Depth, heading, roll and pitch are held with gains that are" in page.inner_text("#live-message")
    page.select_option("#live-hold", law)
    page.evaluate("live.speed = 10")
    page.locator("#live-strength").fill("1")
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.time > 20")
    tilts = page.evaluate(
        "live.flight.times.map((_, n) => Math.hypot(live.flight.pilot.at(n, 'phi'), live.flight.pilot.at(n, 'theta')))"
    )
    assert degrees(max(tilts)) < most
    assert get(page, "x")[0] > 15.0
    page.keyboard.up("KeyW")
    time = page.evaluate("live.flight.time")
    until(page, f"live.flight.time > {time + 20}")
    assert abs(get(page, "theta")[0]) < 0.05, "it levels when the key is released"


def moved_by_keys(page: Any) -> Iterator[tuple[str, float]]:
    """Dive and turn by keys, and yield the variable that exceeds 1 m or rad, and the time when its key is released."""
    page.evaluate("live.speed = 5")
    page.focus("#live-stage")
    for key, name in (("KeyF", "z"), ("KeyD", "psi")):
        page.keyboard.down(key)
        until(page, f"live.flight.pilot.model.get('{name}') > 1")
        page.keyboard.up(key)
        yield name, page.evaluate("live.flight.time")


def test_it_dives_and_turns_by_keys_and_holds_what_it_reached(page: Any) -> None:
    """The heading swings by 0.16 rad in 25 s, because the thrusters have a dead band. So the test looks at 30 s."""
    for name, time in moved_by_keys(page):
        until(page, f"live.flight.time > {time + 45}")
        held = page.evaluate(
            """([name, from]) => live.flight.times.flatMap(
                (time, n) => (time > from ? [live.flight.pilot.at(n, name)] : []))""",
            [name, time + 15],
        )
        assert max(held) - min(held) < (0.1 if name == "z" else 0.2)
        assert min(held) > 0.8
    assert get(page, "phi", "theta") == pytest.approx([0.0, 0.0], abs=0.05)


def test_another_autopilot_takes_over_without_a_jump(page: Any) -> None:
    page.evaluate("live.speed = 5")
    page.focus("#live-stage")
    page.keyboard.down("KeyF")
    until(page, "live.flight.pilot.model.get('z') > 1")
    page.keyboard.up("KeyF")
    time = page.evaluate("live.flight.time")
    until(page, f"live.flight.time > {time + 20}")
    (before,) = get(page, "z")
    page.select_option("#live-hold", "ardusub")
    assert "ArduSub's law and default gains" in page.inner_text("#live-message")
    until(page, f"live.flight.time > {time + 30}")
    assert get(page, "z") == pytest.approx([before], abs=0.1)
    page.select_option("#live-hold", "")
    assert "nothing is held" in page.inner_text("#live-message")


def test_a_vehicle_that_keeps_level_is_held_if_the_pilot_asks_for_it(fly: Callable[..., Any]) -> None:
    page = fly("videoray")
    assert page.input_value("#live-hold") == ""
    page.select_option("#live-hold", "own")
    assert "Depth and heading are held with gains that are made for this vehicle." in page.inner_text("#live-message")
    for name, time in moved_by_keys(page):
        until(page, f"live.flight.time > {time + 15}")
        (before,) = get(page, name)
        until(page, f"live.flight.time > {time + 20}")
        assert get(page, name) == pytest.approx([before], abs=0.01)


def test_a_vehicle_that_thrusters_alone_do_not_hold_says_so(fly: Callable[..., Any]) -> None:
    """The REMUS 100 tilts by its fins, which need speed."""
    page = fly("remus100")
    assert page.locator("#live-hold").count() == 0
    words = "It is not held: the autopilot moves thrusters alone, and not the fins rudder and plane."
    assert page.inner_text("#live-message").startswith(words)
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.pilot.model.get('u') > 0.1")
    assert page.evaluate("live.flight.pilot.helm") is None
