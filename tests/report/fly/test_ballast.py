"""Ballast and thrusters change while the page flies: its motion is that of the rigid body, an impossible mass is
refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.fmu.results.test_ballast import CHANGES, INPUTS, ROV, expected
from tests.report.conftest import get, write_page
from verification.references.rigid_vehicle import compared, places

pytestmark = pytest.mark.interop
__all__ = ["expected"]


@pytest.fixture
def page(tmp_path: Path, fly: Callable[..., Any]) -> Any:
    """The page of a vehicle with six axes, weight and buoyancy."""
    return fly(write_page(tmp_path / "six.html", ROV))


def test_a_flight_with_changes_from_10_s_on_is_the_rigid_body_restarted_there(page: Any, expected: list[float]) -> None:
    done = page.evaluate(
        """([inputs, changes]) => {
            live.pause(true);
            const { flight } = live;
            Object.assign(flight, { held: "", isBounded: false });
            flight.set(inputs);
            flight.advance(10);
            const done = flight.tune(changes);
            flight.advance(10);
            return done;
        }""",
        [INPUTS, CHANGES],
    )
    assert done
    state = dict(zip(ROV.layout.state, get(page, *ROV.layout.state), strict=True))
    assert compared(ROV, places(ROV, state)) == pytest.approx(expected, abs=1e-9)


def test_a_slider_moves_the_ballast_and_the_ghost_keeps_that_of_the_file(page: Any) -> None:
    page.locator("summary", has_text="Ballast").click()
    page.locator("input[name=W]").fill("140")
    weights = page.evaluate("[live.flight.pilot, live.flight.ghost].map(({ model }) => model.get('W'))")
    assert weights == [140.0, ROV["W"]]
    assert page.is_checked("#live-ghost")
    assert page.evaluate("live.flight.pilot.model.get('der(w)') > live.flight.ghost.model.get('der(w)')")
    page.locator("summary", has_text="Tuning").click()
    page.click("#live-ones")
    assert get(page, "W", "alpha_u") == [140.0, 1.0]
    page.click("#live-file")
    assert get(page, "W") == [ROV["W"]]


def test_a_slider_lets_a_thruster_die(page: Any) -> None:
    page.evaluate("live.pause(true)")
    page.locator("summary", has_text="Health").click()
    page.locator("input[name=u_a]").fill("0.5")
    page.locator("input[name=health_a]").fill("0")
    page.evaluate("live.flight.advance(1)")
    forces = page.evaluate("[live.flight.pilot, live.flight.ghost].map(({ model }) => model.get('F_a'))")
    assert abs(forces[0]) < 0.01 < forces[1]
    assert page.is_checked("#live-ghost")


def test_a_mass_that_is_not_positive_definite_is_refused_in_one_line(page: Any) -> None:
    page.locator("summary", has_text="Ballast").click()
    page.locator("input[name=m_rov]").fill("27")
    before = page.evaluate("[...live.flight.pilot.model.values]")
    page.locator("input[name=z_G]").fill("0.23")
    words = "z_G = 0.23: the mass matrix would not be positive definite, so it stays as it was."
    assert page.inner_text("#live-message") == words
    assert page.input_value("input[name=z_G]") == f"{ROV['z_G']:g}"
    assert page.evaluate("[...live.flight.pilot.model.values]") == before
