"""The page holds a vehicle level as ArduSub does: its law beside the one in Python, and what a pilot does with it."""

from collections.abc import Callable
from math import cos, degrees, sin
from typing import Any

import pytest

from rov_fmu.c.stepper import Stepper
from tests.report.conftest import flown_vehicle, get, until
from verification.references.autopilot.ardusub import STICK, Hold, Motion

pytestmark = pytest.mark.interop

RATE = 400
"""The steps of ArduSub in a second."""
NAMES = ("u", "v", "w", "p", "q", "r", "z", "phi", "theta", "psi", "x", "y", "der(u)", "der(v)", "der(w)")


@pytest.fixture
def page(fly: Callable[..., Any]) -> Any:
    """The page of the BlueROV2 Heavy, which rolls and pitches."""
    return fly("bluerov2_heavy")


def by_the_law(seconds: float, ahead: float, aside: float) -> dict[str, float]:
    """Return the motion of the Heavy after a flight from a depth of 2 m, with the law in Python and exact steps."""
    vehicle = flown_vehicle("bluerov2_heavy")
    stepper, hold = Stepper(vehicle, {"z": 2.0, "psi_0": 0.5}, NAMES), Hold(2.0, 0.5)
    motion = dict.fromkeys(NAMES, 0.0) | vehicle.calculated(vehicle.layout.usual_inputs, vehicle.layout.at_rest)
    motion |= {"z": 2.0, "psi": 0.5}
    forward = lateral = 0.0
    for _ in range(round(seconds * RATE)):
        phi, theta = motion["phi"], motion["theta"]
        down = (-sin(theta), sin(phi) * cos(theta), cos(phi) * cos(theta))
        u, v, w, p, q, r = (motion[name] for name in NAMES[:6])
        spun = (q * w - r * v, r * u - p * w, p * v - q * u)
        fall = sum(d * (motion[f"der({name})"] + s) for d, name, s in zip(down, "uvw", spun, strict=True))
        sinking = sum(d * x for d, x in zip(down, (u, v, w), strict=True))
        now = Motion((phi, theta, motion["psi"]), (p, q, r), motion["z"], sinking, fall)
        forward += (ahead - forward) / RATE / (1.0 / RATE + STICK)
        lateral += (aside - lateral) / RATE / (1.0 / RATE + STICK)
        outputs = hold.outputs(now, forward, lateral, 1.0 / RATE)
        motion = dict(zip(NAMES, stepper.step(outputs, 1.0 / RATE)[-len(NAMES) :], strict=True))
    return motion


@pytest.mark.parametrize(("ahead", "aside"), [(1.0, 0.0), (-0.4, 0.6), (0.0, 0.0)])
def test_the_law_of_the_page_is_that_of_the_stand_in(page: Any, ahead: float, aside: float) -> None:
    page.evaluate(
        """([ahead, aside]) => {
            live.pause(true);
            const { flight } = live;
            const { model } = flight.pilot;
            model.set("z", 2);
            model.set("psi", 0.5);
            model.turn();
            flight.steer({ demands: new Map([["surge", ahead], ["sway", aside]]), added: {} });
            flight.advance(6);
        }""",
        [ahead, aside],
    )
    expected = by_the_law(6.0, ahead, aside)
    assert dict(zip(NAMES, get(page, *NAMES), strict=True)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_heavy_flies_ahead_at_full_thrust_without_turning_over(page: Any) -> None:
    """It goes on with the keys of a pilot: 20 s of W at 100 %, at ten times real time."""
    assert page.is_checked("#live-hold")
    assert "Depth, heading and attitude are held" in page.inner_text("#live-message")
    page.evaluate("live.speed = 10")
    page.locator("#live-strength").fill("1")
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.time > 20")
    tilts = page.evaluate(
        "live.flight.times.map((_, n) => Math.hypot(live.flight.pilot.at(n, 'phi'), live.flight.pilot.at(n, 'theta')))"
    )
    assert degrees(max(tilts)) < 35.0
    assert get(page, "x")[0] > 15.0
    page.keyboard.up("KeyW")
    time = page.evaluate("live.flight.time")
    until(page, f"live.flight.time > {time + 20}")
    assert abs(get(page, "theta")[0]) < 0.05, "it levels when the key is released"


def test_it_dives_and_turns_by_keys_and_holds_what_it_reached(page: Any) -> None:
    """The heading swings by 0.16 rad in 25 s, because the thrusters have a dead band. So the test looks at 30 s."""
    page.evaluate("live.speed = 5")
    page.focus("#live-stage")
    for key, name in (("KeyF", "z"), ("KeyD", "psi")):
        page.keyboard.down(key)
        until(page, f"live.flight.pilot.model.get('{name}') > 1")
        page.keyboard.up(key)
        time = page.evaluate("live.flight.time")
        until(page, f"live.flight.time > {time + 45}")
        held = page.evaluate(
            """([name, from]) => live.flight.times.flatMap(
                (time, n) => (time > from ? [live.flight.pilot.at(n, name)] : []))""",
            [name, time + 15],
        )
        assert max(held) - min(held) < (0.1 if name == "z" else 0.2)
        assert min(held) > 0.8
    assert get(page, "phi", "theta") == pytest.approx([0.0, 0.0], abs=0.05)


@pytest.mark.parametrize(
    ("kind", "words"),
    [("videoray", "Time starts"), ("remus100", "It is not held level, because no thruster rolls or pitches it.")],
)
def test_a_vehicle_that_no_thruster_rolls_or_pitches_is_not_held(
    kind: str, words: str, fly: Callable[..., Any]
) -> None:
    """The VideoRay cannot tilt. The REMUS 100 tilts by its fins, which need speed."""
    page = fly(kind)
    assert page.locator("#live-hold").count() == 0
    assert page.inner_text("#live-message").startswith(words)
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.pilot.model.get('u') > 0.1")
    assert page.evaluate("live.flight.pilot.hold") is None
