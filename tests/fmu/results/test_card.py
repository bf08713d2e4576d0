"""The model card says where a vehicle holds; whole cards are in tests/frozen."""

from dataclasses import replace

import pytest

from rov_fmu.equation.parts import EVERY_COMMAND, Range
from rov_fmu.fmu.card import card, card_text
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import EVERYTHING, SIX, THRUST_EFFECTS, VEHICLES, VIDEORAY, a_vehicle, tied

_ROVS = {name: a_vehicle(rov) for name, rov in (VEHICLES | {"six axes": SIX}).items()}
_ROVS |= {path.stem: load_vehicle(path) for path in (EVERYTHING, THRUST_EFFECTS)}


@pytest.mark.parametrize("name", _ROVS)
def test_the_lines_of_a_card_are_short(name: str) -> None:
    rov = replace(_ROVS[name], limits=(f"Words: {'long' * 20}{' and short' * 20}.", "long" * 30))
    text = card_text(rov)
    assert [line for line in text.splitlines() if len(line) > 100] == [f"- {'long' * 30}"]


def _holds(rov: Vehicle) -> list[str]:
    return card(rov)["Where it holds"]


def test_commands_at_which_thrust_pushes_backward_are_told() -> None:
    first = "Commands of 20% to 70%; beyond them the thrust curves extrapolate."
    assert _holds(VIDEORAY) == [first]
    turned = VIDEORAY.with_(a_t_rear=100.3, b_t_rear=-27.09)  # of the paper's equation (8)
    assert _holds(turned) == [first, "The rear thrust is negative below 27%."]
    turned = _ROVS["everything"].with_(a_t_frame_reverse=20.0, b_t_frame_reverse=-4.0, b_t_boost=0.0)
    assert _holds(turned)[1:] == ["The frame thrust in reverse is negative below 29%."], "after a dead band of 8.7 %"


def test_the_axes_along_which_forces_at_points_act_are_told() -> None:
    rov = tied(_ROVS["VideoRay"], tether=(-0.2, 0.0, -0.1), hook=(0.1, 0.0, 0.2))
    words = "Forces at the points tether and hook act in surge, heave and yaw; the vehicle does not move in "
    assert [*_holds(_ROVS["VideoRay"]), f"{words}sway, pitch and roll."] == _holds(rov)
    assert _holds(tied(_ROVS["six axes"], tether=(0.0, 0.0, 0.0)))[-1] == (
        "Forces at the point tether act in surge, sway, heave, roll, pitch and yaw."
    )


def test_ranges_are_told_in_degrees() -> None:
    ranges = (Range(EVERY_COMMAND, 0.0, 1.0), Range("p", -0.3, 0.5), Range("theta", -0.1, 0.1), Range("z", 0.0, 2.5))
    found = _holds(replace(_ROVS["six axes"], layout=replace(SIX.layout, identified=ranges)))
    assert [words for words in found if words.startswith("Tested")] == [
        "Tested: roll velocity: -17 to 29 deg/s.",
        "Tested: pitch: -5.7 to 5.7 deg.",
        "Tested: depth: 0 to 2.5 m.",
    ]
    assert found[-1].startswith("The output outside is 0 while the commands, velocities, roll and pitch are within")
