"""The model card: one source, which the page, a text file and the annotations of the FMU share."""

import re
from collections.abc import Callable
from dataclasses import replace

import pytest
from lxml import etree, html

from rov_fmu.fmu.card import card, card_text
from rov_fmu.fmu.content import FmuContent, native_content, python_content
from rov_fmu.report.page.fmu_page import documentation
from rov_fmu.report.templates import sentence
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.report.pages import text_of, unfolded

MOST_WORDS = 1200
"""The most words of the FMU's page that are not folded."""


@pytest.mark.parametrize(
    ("content_of", "path"),
    [
        (native_content, "fmi:VendorAnnotations/Tool/ModelCard"),
        (lambda vehicle: native_content(vehicle, fmi=3), "fmi:Annotations/Annotation"),
        (python_content, "fmi:VendorAnnotations/Tool/ModelCard"),
    ],
)
def test_the_description_of_the_fmu_contains_the_card(
    vehicle: Vehicle, content_of: Callable[..., FmuContent], path: str
) -> None:
    odd = replace(vehicle, limits=("Less than <1> & more",))
    root = etree.fromstring(content_of(odd).files["modelDescription.xml"])
    (found,) = root.findall(path.removeprefix("fmi:"))
    text = found.get("text", found.text)
    assert text == card_text(odd)
    assert "Less than <1> & more" in text


@pytest.mark.parametrize("name", SHIPPED)
def test_page_and_text_file_have_the_card_and_little_of_the_page_is_unfolded(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rov_fmu.report.page.fmu_page.inline_svg", lambda *_, **__: "")
    monkeypatch.setattr("rov_fmu.report.page.fmu_page.pictures", lambda _: {})
    vehicle = load_vehicle(SHIPPED[name])
    files = documentation(vehicle, native=True)
    text = " ".join(files["documentation/model_card.txt"].decode().split())
    page = files["documentation/index.html"].decode()
    shown = unfolded(page)
    assert {*card(vehicle)} <= {h.text_content() for h in html.fromstring(page).iter("h3")}
    for paragraph in (one for paragraphs in card(vehicle).values() for one in paragraphs):
        assert f"- {' '.join(paragraph.split())}" in text
        assert " ".join(sentence(paragraph).split()) in shown
    words = len(shown.split())
    assert 300 < words <= MOST_WORDS
    assert len(text_of(page).split()) > 2.0 * words
    h2 = [h2.text_content() for h2 in html.fromstring(page).iter("h2") if h2.getparent().tag != "summary"]
    assert h2 == ["How to drive it", "Steady velocities and steps of the command", "Thrust", "Model card"], "unfolded"
    assert re.search(r"V<sub>ss</sub>", page)
