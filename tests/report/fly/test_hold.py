"""The page holds a vehicle level as ArduSub does: its law beside the one in Python, and what a pilot does with it."""

from collections.abc import Callable
from math import cos, degrees, sin
from pathlib import Path
from typing import Any

import pytest

from rov_fmu.c.stepper import Stepper
from rov_fmu.fmu.archive import web_module
from rov_fmu.report.page.live import Flown, fly_page
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import ROOT
from tests.report.conftest import Visit
from tests.report.test_live import flying, until
from verification.references.autopilot.ardusub import STICK, VECTORED_6DOF, Hold, Motion

pytestmark = pytest.mark.interop

REMUS = ROOT / "examples" / "remus100" / "remus100.toml"
RATE = 400
"""The steps of ArduSub in a second."""
NAMES = ("u", "v", "w", "p", "q", "r", "z", "phi", "theta", "psi", "x", "y", "der(u)", "der(v)", "der(w)")


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of the page of the BlueROV2 Heavy, which rolls and pitches."""
    path = tmp_path_factory.mktemp("held") / "heavy.html"
    heavy = load_vehicle(SHIPPED["bluerov2_heavy"])
    path.write_text(fly_page([Flown(heavy, web_module(heavy.layout))]), encoding="utf-8")
    return path.as_uri()


@pytest.fixture
def page(address: str, visit: Callable[..., Visit]) -> Any:
    return flying(visit, address).page


def by_the_law(seconds: float, ahead: float, aside: float) -> dict[str, float]:
    """Return the motion of the Heavy after a flight from a depth of 2 m, with the law in Python and exact steps."""
    vehicle = load_vehicle(SHIPPED["bluerov2_heavy"])
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
    values = page.evaluate(
        """([ahead, aside, names]) => {
            live.pause(true);
            const { flight } = live;
            const { model } = flight.pilot;
            model.set("z", 2);
            model.set("psi", 0.5);
            model.turn();
            flight.steer({ demands: new Map([["surge", ahead], ["sway", aside]]), added: {} });
            flight.advance(6);
            return names.map((name) => model.get(name));
        }""",
        [ahead, aside, NAMES],
    )
    expected = by_the_law(6.0, ahead, aside)
    assert dict(zip(NAMES, values, strict=True)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_motor_matrix_is_that_of_ardusub(page: Any) -> None:
    """ArduSub's throttle is positive upward, and heave downward."""
    columns = {"roll": (0, 1), "pitch": (1, 1), "yaw": (2, 1), "heave": (3, -1), "surge": (4, 1), "sway": (5, 1)}
    held = page.evaluate("Object.fromEntries(live.vehicle.axes.map(({ name, held }) => [name, held]))")
    for name, (column, sign) in columns.items():
        factors = {f"u_{n}": sign * row[column] for n, row in enumerate(VECTORED_6DOF, 1) if row[column]}
        assert held[name] == factors, name


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
    assert page.evaluate("live.flight.pilot.model.get('x')") > 15.0
    page.keyboard.up("KeyW")
    time = page.evaluate("live.flight.time")
    until(page, f"live.flight.time > {time + 20}")
    assert abs(page.evaluate("live.flight.pilot.model.get('theta')")) < 0.05, "it levels when the key is released"


def test_it_dives_and_turns_by_keys_and_holds_what_it_reached(page: Any) -> None:
    page.evaluate("live.speed = 5")
    page.focus("#live-stage")
    for key, name in (("KeyF", "z"), ("KeyD", "psi")):
        page.keyboard.down(key)
        until(page, f"live.flight.pilot.model.get('{name}') > 1")
        page.keyboard.up(key)
        time = page.evaluate("live.flight.time")
        until(page, f"live.flight.time > {time + 15}")
        before = page.evaluate(f"live.flight.pilot.model.get('{name}')")
        until(page, f"live.flight.time > {time + 30}")
        after = page.evaluate(f"live.flight.pilot.model.get('{name}')")
        assert after == pytest.approx(before, abs=0.1), "the dead band of the thrusters lets the heading swing"
        assert after > 1.0
    tilt = page.evaluate("['phi', 'theta'].map((name) => Math.abs(live.flight.pilot.model.get(name)))")
    assert max(tilt) < 0.05


def test_a_frame_does_not_ask_for_the_layout_of_the_page(page: Any) -> None:
    """To lay out the page for its sizes in each frame took ten times as long as to draw it."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")

    def layouts() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        count: float = next(one["value"] for one in metrics if one["name"] == "LayoutCount")
        return count

    page.evaluate("""() => {
        live.pause(true);
        live.flight.steer({ demands: new Map([["surge", 1]]), added: {} });
        live.flight.advance(20);
    }""")
    before = layouts()
    page.evaluate("() => { for (let n = 0; n < 100; n++) { live.fly(1 / 60); live.draw(); } }")
    assert layouts() - before < 5


def test_without_the_hold_the_keys_drive_the_thrusters_alone(page: Any) -> None:
    page.locator("#live-hold").uncheck()
    assert "nothing is held" in page.inner_text("#live-message")
    shares = page.evaluate("live.vehicle.axes[0].shares")
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.time > 0.1")
    commands = page.evaluate(
        "Object.fromEntries(live.vehicle.commands.map((c) => [c, live.flight.pilot.model.get(c)]))"
    )
    assert commands == pytest.approx({name: 0.5 * shares.get(name, 0.0) for name in commands})
    page.keyboard.up("KeyW")
    until(page, "live.vehicle.commands.every((name) => live.flight.pilot.model.get(name) === 0)")


def test_a_vehicle_that_cannot_tilt_has_no_switch(tmp_path: Path, visit: Callable[..., Visit]) -> None:
    vehicle, target = load_vehicle(SHIPPED["videoray"]), tmp_path / "videoray.html"
    target.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))]), encoding="utf-8")
    page = flying(visit, target.as_uri()).page
    assert page.locator("#live-hold").count() == 0
    assert not page.evaluate("live.flight.isHeld")


def test_a_vehicle_that_no_thruster_rolls_or_pitches_is_not_held(tmp_path: Path, visit: Callable[..., Visit]) -> None:
    """The REMUS 100 tilts by its fins, which need speed."""
    vehicle, target = load_vehicle(REMUS), tmp_path / "remus.html"
    target.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))]), encoding="utf-8")
    page = flying(visit, target.as_uri()).page
    assert page.locator("#live-hold").count() == 0
    assert page.inner_text("#live-message").startswith("It is not held level, because no thruster rolls or pitches it.")
    page.focus("#live-stage")
    page.keyboard.down("KeyW")
    until(page, "live.flight.pilot.model.get('u') > 0.1")
    assert page.evaluate("live.flight.pilot.hold") is None
