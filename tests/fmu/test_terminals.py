"""terminalsAndIcons.xml contains every input and output in the terminals of FMI 3.0."""

from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from rov_fmu.fmu.archive import Content, native_content, python_content
from rov_fmu.fmu.terminals import terminals_and_icons
from rov_fmu.fmu.variables import variables
from rov_fmu.report.page.pictures import pictures
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import HEAVY, SIX, VEHICLES, VIDEORAY

SCHEMA = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema/fmi3/fmi3TerminalsAndIcons.xsd"))
INPUTS, OUTPUTS = {"thrusters", "load", "current"}, {"thrust", "body_velocity", "pose", "attitude"}
PLUGS = {"body_velocity", "pose", "attitude"}
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
    for name, terminal in found.items():
        assert {declared[member] for member in members(terminal)} == {"input" if name in INPUTS else "output"}
        assert name in INPUTS | OUTPUTS
        assert terminal.get("matchingRule") == ("plug" if name in PLUGS else "bus")
        assert terminal.get("terminalKind") is None
        variable_names = terminal.findall("TerminalMemberVariable")
        assert {v.get("variableKind") for v in variable_names} == {"signal"}
        assert len({v.get("memberName") for v in variable_names}) == len(variable_names)


CONNECTED = {
    "thrusters": ("u_l u_r u_t", "u_1 u_2 u_3 u_4 u_5 u_6 u_7 u_8", "u_a u_b u_c"),
    "load": ("X_ext Z_ext N_ext", "X_ext Y_ext Z_ext N_ext", "X_ext Y_ext Z_ext K_ext M_ext N_ext"),
    "current": ("V_N V_E", "V_N V_E", "V_N V_E V_D"),
    "body_velocity": ("u w r", "u v w r", "u v w p q r"),
    "pose": ("x y z psi", "x y z psi", "x y z eta epsilon_1 epsilon_2 epsilon_3"),
    "thrust": ("F_l F_r F_t tau_rear", "F_1 F_2 F_3 F_4 F_5 F_6 F_7 F_8 tau_t200", "F_a F_b F_c tau_t200"),
}
"""The members of terminals of the VideoRay, the Heavy and a vehicle with six axes."""


@pytest.mark.parametrize("place", range(3))
def test_what_systems_connect_by(place: int) -> None:
    found = read(terminals_and_icons((VIDEORAY, HEAVY, SIX)[place].layout))
    expected = {name: words[place] for name, words in CONNECTED.items()}
    assert {name: " ".join(members(found[name])) for name in CONNECTED} == expected


def test_there_are_no_terminals_for_variables_that_a_vehicle_does_not_have() -> None:
    assert read(terminals_and_icons(VEHICLES["heave only"].layout)).keys() == (INPUTS | OUTPUTS) - {
        "current",
        "attitude",
    }


@pytest.mark.parametrize("kind", ROVS)
def test_terminals_are_placed_around_the_icon_without_overlap(kind: str) -> None:
    """Inputs are on its left and outputs on its right; each picture is a square."""
    document = terminals_and_icons(ROVS[kind].layout)
    (icon,) = etree.fromstring(document).iter("Icon")
    left, bottom, right, top = (float(icon.get(end)) for end in ("x1", "y1", "x2", "y2"))
    ends: dict[bool, list[float]] = {True: [top], False: [top]}
    for name, terminal in read(document).items():
        (place,) = terminal.iter("TerminalGraphicalRepresentation")
        x1, y1, x2, y2 = (float(place.get(end)) for end in ("x1", "y1", "x2", "y2"))
        assert x2 - x1 == y2 - y1 == 20.0
        assert (x2 == left) if name in INPUTS else (x1 == right)
        side = ends[name in INPUTS]
        assert bottom < y1 < y2 < side[-1]
        side.append(y1)


@pytest.mark.parametrize(
    ("name", "content_of"),
    [
        pytest.param(name, of, marks=() if (name, of) == ("bluerov2_heavy", native_content) else pytest.mark.long)
        for name in SHIPPED
        for of in (native_content, python_content)
    ],
)
def test_the_fmu_has_them_with_their_pictures(name: str, content_of: Callable[..., Content]) -> None:
    vehicle = load_vehicle(SHIPPED[name])
    files = content_of(vehicle, pictures(vehicle)).files
    document = files["terminalsAndIcons/terminalsAndIcons.xml"]
    assert read(document).keys() == read(terminals_and_icons(vehicle.layout)).keys()
    places = etree.fromstring(document).iter("TerminalGraphicalRepresentation")
    drawn = {f"{place.get('iconBaseName')}.png" for place in places}
    in_folder = {path.removeprefix("terminalsAndIcons/") for path in files if path.startswith("terminalsAndIcons/")}
    assert in_folder == drawn | {"terminalsAndIcons.xml", "icon.png", "icon.svg"}
    assert "documentation/diagram.png" in files
