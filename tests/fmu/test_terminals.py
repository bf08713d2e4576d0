"""terminalsAndIcons.xml contains every input and output in the terminals of FMI 3.0."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from rov_fmu.equation.parts import Range
from rov_fmu.fmu.content import Content, native_content, python_content
from rov_fmu.fmu.terminals import terminals_and_icons
from rov_fmu.fmu.variables import variables
from rov_fmu.report.page.pictures import pictures
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import SIX, THRUST_EFFECTS, VEHICLES, pulsed

SCHEMA = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema/fmi3/fmi3TerminalsAndIcons.xsd"))
_WITH_ALL = pulsed(load_vehicle(THRUST_EFFECTS), (1100.0, 1480.0, 1900.0))
ROVS = {**VEHICLES, "six axes": SIX}
TERMINALS = {
    "thrusters": ("input", "bus", "Commands to the thrusters, -1 to 1"),
    "battery": ("input", "bus", "Voltage of the battery"),
    "load": ("input", "bus", "Forces and torque from outside, body frame"),
    "current": ("input", "bus", "Velocity of the water, north and east"),
    "body_velocity": ("output", "plug", "Velocity through the water, body frame"),
    "pose": ("output", "plug", "Position north, east, down, and heading"),
    "attitude": ("output", "plug", "Euler angles: roll, pitch and heading"),
    "thrust": ("output", "bus", "Forces and torques of the thrusters"),
    "validity": ("output", "plug", "How far the motion is beyond what was identified"),
}
"""The causality, the rule and the description of each terminal of a vehicle without roll and pitch."""
OTHER_WORDS = {
    "VideoRay": {},
    "every effect": {"thrusters": "Commands to the thrusters and fins, pulse widths"},
    "six axes": {
        "current": "Velocity of the water, north, east and down",
        "pose": "Position north, east, down, and quaternion",
    },
}


def read(document: bytes) -> dict[str, etree._Element]:
    """Return the terminals of a document by name, after a check against the schema."""
    root = etree.fromstring(document)
    SCHEMA.assertValid(root)
    found = root.findall("Terminals/Terminal")
    named = {terminal.get("name"): terminal for terminal in found}
    assert len(named) == len(found)
    return named


def members(terminal: etree._Element) -> list[str]:
    return [member.get("variableName") for member in terminal.iter("TerminalMemberVariable")]


@pytest.mark.parametrize("kind", ROVS)
def test_every_input_and_output_is_in_one_terminal(kind: str) -> None:
    """The members of a terminal have the same causality, and its name is unique."""
    declared = {v.name: v.causality for v in variables(ROVS[kind])}
    found = read(terminals_and_icons(ROVS[kind].layout))
    grouped = [name for terminal in found.values() for name in members(terminal)]
    assert sorted(grouped) == sorted(name for name, causality in declared.items() if causality in {"input", "output"})
    for name, terminal in found.items():
        assert {declared[member] for member in members(terminal)} == {TERMINALS[name][0]}
        assert terminal.get("terminalKind") is None
        variable_names = terminal.findall("TerminalMemberVariable")
        assert {v.get("variableKind") for v in variable_names} == {"signal"}
        assert len({v.get("memberName") for v in variable_names}) == len(variable_names)


@pytest.mark.parametrize(("kind", "words"), OTHER_WORDS.items(), ids=OTHER_WORDS)
def test_a_terminal_says_what_it_holds_and_how_it_is_connected(kind: str, words: dict[str, str]) -> None:
    ranges = (Range("u", -0.5, 0.5),)
    layout = replace(_WITH_ALL.layout, identified=ranges) if kind == "every effect" else ROVS[kind].layout
    found = read(terminals_and_icons(layout))
    lacking = {"VideoRay": {"battery", "attitude", "validity"}, "every effect": {"attitude"}}
    assert TERMINALS.keys() - found.keys() == lacking.get(kind, {"battery", "validity"})
    for name, terminal in found.items():
        _, rule, usual = TERMINALS[name]
        assert (terminal.get("matchingRule"), terminal.get("description")) == (rule, words.get(name, usual))


@pytest.mark.long
@pytest.mark.parametrize("content_of", [native_content, python_content])
def test_the_fmu_has_them_with_their_pictures(content_of: Callable[..., Content]) -> None:
    vehicle = load_vehicle(SHIPPED["bluerov2_heavy"])
    files = content_of(vehicle, pictures(vehicle)).files
    document = files["terminalsAndIcons/terminalsAndIcons.xml"]
    assert read(document).keys() == read(terminals_and_icons(vehicle.layout)).keys()
    places = etree.fromstring(document).iter("TerminalGraphicalRepresentation")
    drawn = {f"{place.get('iconBaseName')}.png" for place in places}
    in_folder = {path.removeprefix("terminalsAndIcons/") for path in files if path.startswith("terminalsAndIcons/")}
    assert in_folder == drawn | {"terminalsAndIcons.xml", "icon.png", "icon.svg"}
    assert "documentation/diagram.png" in files
