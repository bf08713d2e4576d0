"""terminalsAndIcons.xml contains every input and output in the terminals of FMI 3.0."""

from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from rov_fmu.fmu.content import Content, native_content, python_content
from rov_fmu.fmu.terminals import terminals_and_icons
from rov_fmu.fmu.variables import variables
from rov_fmu.report.page.pictures import pictures
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import SIX, VEHICLES

SCHEMA = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema/fmi3/fmi3TerminalsAndIcons.xsd"))
ROVS = {**VEHICLES, "six axes": SIX}


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
    for terminal in found.values():
        assert len({declared[member] for member in members(terminal)}) == 1
        assert terminal.get("terminalKind") is None
        variable_names = terminal.findall("TerminalMemberVariable")
        assert {v.get("variableKind") for v in variable_names} == {"signal"}
        assert len({v.get("memberName") for v in variable_names}) == len(variable_names)


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
