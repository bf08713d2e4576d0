"""An FMU has its terminals and their pictures."""

from collections.abc import Callable

import pytest
from lxml import etree

from rov_fmu.fmu.content import FmuContent, native_content, python_content
from rov_fmu.fmu.terminals import terminals_and_icons
from rov_fmu.report.page.pictures import pictures
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.fmu.test_properties import terminals_of


@pytest.mark.long
@pytest.mark.parametrize("content_of", [native_content, python_content])
def test_the_fmu_has_them_with_their_pictures(content_of: Callable[..., FmuContent]) -> None:
    vehicle = load_vehicle(SHIPPED["bluerov2_heavy"])
    files = content_of(vehicle, pictures(vehicle)).files
    document = files["terminalsAndIcons/terminalsAndIcons.xml"]
    assert terminals_of(document).keys() == terminals_of(terminals_and_icons(vehicle.layout)).keys()
    places = etree.fromstring(document).iter("TerminalGraphicalRepresentation")
    drawn = {f"{place.get('iconBaseName')}.png" for place in places}
    in_folder = {path.removeprefix("terminalsAndIcons/") for path in files if path.startswith("terminalsAndIcons/")}
    assert in_folder == drawn | {"terminalsAndIcons.xml", "icon.png", "icon.svg"}
    assert "documentation/diagram.png" in files
