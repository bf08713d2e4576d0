"""The plots of a vehicle: its thrusters from above and from starboard, its thrust, and its velocities."""

from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from itertools import combinations
from math import hypot, sin
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.report.page.fmu_page import plot_steps
from rov_fmu.report.plots.drawing import draw_thrusters
from rov_fmu.report.plots.geometry import scenes, thruster_place
from rov_fmu.report.plots.steps import held_commands
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import HEAVY, SIX, VEHICLES, VIDEORAY

ONE = VEHICLES["yaw only"]


def panel(draw: Callable[..., None], *given: Any, size: tuple[float, float] = (3.7, 2.9)) -> Axes:
    """Return the panel that a function draws, laid out."""
    figure = Figure(figsize=size, layout="constrained")
    draw(ax := figure.subplots(), *given)
    figure.draw_without_rendering()
    return ax


# ---- Thrusters -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", ["from above", "from starboard"])
@pytest.mark.parametrize("vehicle", [VIDEORAY, SIX, ONE], ids=["VideoRay", "six axes", "yaw only"])
def test_a_drawing_holds_its_arrows_and_names_which_do_not_cover_each_other(vehicle: Vehicle, view: str) -> None:
    """An arrow points along its force; y and z are down. Its name is within 0.35 inches of its end, beside the axes."""
    scene = scenes(vehicle)[view]
    size, (down, sight, sign) = scene.size, (1, 2, -1.0) if view == "from above" else (2, 1, 1.0)
    ax = panel(draw_thrusters, vehicle, scene, size=scene.inches)
    boxes = {text.get_text(): text.get_window_extent() for text in ax.texts if text.get_text()}
    for text, box in boxes.items():
        assert min(box.x0, box.y0) >= 0.0, text
        assert box.x1 <= ax.figure.bbox.x1, text
        assert box.y1 <= ax.bbox.y1, text
        assert sum(box.overlaps(other) for other in boxes.values()) == 1, text
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    tips = [text.xy for text in ax.texts if isinstance(text, Annotation)]
    assert all(left < x < right and high < y < low for x, y in tips)
    axes = ax.transData.transform([(1.4 * n * size, 0.0) for n in np.linspace(0.0, 1.0, 200)])
    for thruster in vehicle.layout.thrusters:
        at, d = thruster_place(vehicle, thruster), thruster.direction.value
        assert max(map(abs, at)) <= size
        (mark,) = (mark for mark in scene.marks if f"$F_{{{thruster.name}}}$" in mark.label)
        assert (*mark.at, *mark.along) == pytest.approx((at[0], at[down], d[0], d[down]), abs=1e-3)
        assert mark.toward == pytest.approx(sign * d[sight] if abs(d[sight]) > 0.995 else 0.0)
        assert (mark.tip(size) in tips) is not bool(mark.toward)
        box, (x, y) = boxes[mark.label], ax.transData.transform(mark.at if mark.toward else mark.tip(size))
        assert hypot(max(box.x0 - x, x - box.x1, 0.0), max(box.y0 - y, y - box.y1, 0.0)) < 35.0
        assert not any(box.contains(*point) for point in axes)


def test_the_arm_of_the_paper_stands_where_its_torque_says() -> None:
    """(4): x F_y - y F_x of a force ahead is ±R sin γ, behind the centre of mass. The drawing has R, γ and a scale."""
    k = VIDEORAY
    for thruster, side in zip(k.layout.thrusters[:2], (1.0, -1.0), strict=True):
        x, y, _ = thruster_place(k, thruster)
        assert x < 0.0
        assert hypot(x, y) == pytest.approx(k["R"])
        assert -y == pytest.approx(side * k["R"] * sin(k["gamma"]))
    texts = {text.get_text() for text in panel(draw_thrusters, k, scenes(k)["from above"]).texts}
    forces = ("$F_{l}$", "$F_{r}$", "$F_{t}$")
    assert texts == {"", "$R$", r"$\gamma$", "$x, u$", "$y$", r"$\psi, r$", *forces, "0.1 m"}


# ---- Over the command and over time ----------------------------------------------------------------------------------


def test_names_of_lines_near_each_other_do_not_overlap_and_a_scale_is_in_knots() -> None:
    """A knot is 1852 m in an hour."""
    steps = panel(plot_steps, HEAVY, HEAVE, [*map(Decimal, (10, 12, 100))])
    assert [text.get_text() for text in steps.texts] == ["−100 %", "−12 %", "−10 %", "10 %", "12 %", "100 %"]
    boxes = [text.get_window_extent() for text in steps.texts]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    (knots,) = steps.child_axes
    numbers = [label.get_window_extent() for label in knots.get_yticklabels()]
    assert not any(box.overlaps(number) for box in boxes for number in numbers)
    assert knots.get_ylim() == pytest.approx([end * 3600.0 / 1852.0 for end in steps.get_ylim()])


def test_step_responses_have_even_tens() -> None:
    for ends, commands in {
        (0.1, 1.0): (10, 40, 70, 100),
        (0.2, 0.7): (20, 40, 50, 70),
        (0.001, 0.002): (1,),
        (0.41, 0.48): (41, 43, 46, 48),
    }.items():
        assert held_commands(replace(VIDEORAY, command_range=ends)) == [*map(Decimal, commands)]
