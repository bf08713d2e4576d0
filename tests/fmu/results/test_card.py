"""The model card says what a vehicle leaves out and where it holds, and can be read again from its text."""

from dataclasses import replace

import pytest

from rov_fmu.equation.parts import EVERY_COMMAND, Range
from rov_fmu.fmu.card import card, card_text, read_card
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import EVERYTHING, SIX, THRUST_EFFECTS, VEHICLES, VIDEORAY, a_vehicle

_ROVS = {name: a_vehicle(rov) for name, rov in (VEHICLES | {"six axes": SIX}).items()}
_ROVS |= {path.stem: load_vehicle(path) for path in (EVERYTHING, THRUST_EFFECTS)}
_TETHER = "A tether: it acts only if its force is connected as a load."
_WATER = "Surface, bottom, walls and waves."
_CURRENT = "A current is steady, horizontal and everywhere the same."
LEFT_OUT = {
    "VideoRay": [
        "Coupling between the axes.",
        "Sway, pitch, roll. The vehicle does not drift outward in a turn.",
        "What differs between the two directions of thrust and drag.",
        "Thrusters as machines: there is no lag, dead band, delay or loss of thrust with speed.",
        "Separate terms for added mass, static drag and a delay at the start; β < 1 stands for a slow start.",
        "Buoyancy is neutral.",
        *(_TETHER, f"{_WATER} Depth has no limits.", _CURRENT),
    ],
    "everything": [
        "Pitch, roll.",
        "What differs between the two directions of thrust of curve boost and drag in surge, sway, yaw.",
        "Thrusters as machines: there is no delay or loss of thrust with speed.",
        "Separate terms for static drag and a delay at the start; β < 1 stands for a slow start.",
        "Beyond the constant load F_0_w, buoyancy is neutral.",
        *(_TETHER, f"{_WATER} Depth has no limits.", _CURRENT),
        "It does not roll.",
    ],
    "thrust_effects": [
        "Pitch, roll.",
        "What differs between the two directions of thrust of curve lift and drag.",
        "Separate terms for static drag; β < 1 stands for a slow start.",
        "Buoyancy is neutral.",
        *(_TETHER, f"{_WATER} Depth has no limits.", _CURRENT),
    ],
    "six axes": [
        "Thrusters as machines: there is no delay.",
        "Separate terms for static drag and a delay at the start; β < 1 stands for a slow start.",
        *(_TETHER, f"{_WATER} Depth has no limits.", "A current is steady and everywhere the same."),
    ],
    "surge and sway without yaw": [
        "Coupling between the axes.",
        "Heave, yaw, pitch, roll.",
        "Thrusters as machines: there is no lag, delay or loss of thrust with speed.",
        "Separate terms for added mass, static drag and a delay at the start; β < 1 stands for a slow start.",
        *(_TETHER, _WATER, _CURRENT),
    ],
    "yaw only": [
        "Surge, sway, heave, pitch, roll.",
        "What differs between the two directions of drag.",
        "Thrusters as machines: there is no lag, delay or loss of thrust with speed.",
        "Separate terms for added mass, static drag and a delay at the start; β < 1 stands for a slow start.",
        *(_TETHER, _WATER, "The water is at rest."),
    ],
}


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_the_equation_lacks_is_told(name: str) -> None:
    assert card(_ROVS[name])["What it leaves out"] == LEFT_OUT[name]


@pytest.mark.parametrize("name", _ROVS)
def test_a_card_is_read_as_it_was_written(name: str) -> None:
    rov = replace(_ROVS[name], limits=(f"Words: {'long' * 20}{' and short' * 20}.", "long" * 30))
    text = card_text(rov)
    assert [line for line in text.splitlines() if len(line) > 100] == [f"- {'long' * 30}"]
    assert read_card(text) == {f"Model card of {rov.name}": [], **card(rov)}


def _holds(rov: Vehicle) -> list[str]:
    return card(rov)["Where it holds"]


def test_commands_at_which_thrust_pushes_backward_are_told() -> None:
    first = "Commands of 20% to 70%; beyond them the thrust curves extrapolate."
    assert _holds(VIDEORAY) == [first]
    turned = VIDEORAY.with_(a_t_rear=100.3, b_t_rear=-27.09)  # of the paper's equation (8)
    assert _holds(turned) == [first, "The rear thrust is negative below 27%."]
    turned = _ROVS["everything"].with_(a_t_frame_reverse=20.0, b_t_frame_reverse=-4.0, b_t_boost=0.0)
    assert _holds(turned)[1:] == ["The frame thrust in reverse is negative below 29%."], "after a dead band of 8.7 %"


def test_ranges_are_told_in_degrees() -> None:
    ranges = (Range(EVERY_COMMAND, 0.0, 1.0), Range("p", -0.3, 0.5), Range("theta", -0.1, 0.1), Range("z", 0.0, 2.5))
    found = _holds(replace(_ROVS["six axes"], layout=replace(SIX.layout, identified=ranges)))
    assert [words for words in found if words.startswith("Tested")] == [
        "Tested: roll velocity: -17 to 29 deg/s.",
        "Tested: pitch: -5.7 to 5.7 deg.",
        "Tested: depth: 0 to 2.5 m.",
    ]
    assert found[-1].startswith("The output outside is 0 while the commands, velocities, roll and pitch are within")
