"""documentation/index.html: complete, self-contained, and about its own vehicle alone."""

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lxml import html

from rov_fmu.fmu.content import FmuContent, native_content, python_content
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.plots.steps import held_commands
from rov_fmu.vehicle.vehicle import Vehicle
from tests.report.pages import check_is_whole, check_refers_to_itself_alone, rows, text_of
from tests.vehicles import with_intervals

ODD_NAME = 'Größe <b>$1</b> & "Söhne"'


@pytest.fixture(scope="module")
def page(videoray_dir: Path) -> str:
    """The page of the VideoRay's FMU, in which its model flies."""
    return (videoray_dir / "documentation" / "index.html").read_text(encoding="utf-8")


def page_without_plots(vehicle: Vehicle, **how: Any) -> str:
    """Return the page without its plots, which take most of the time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.report.page.fmu_page.inline_svg", lambda *_: "")
        return documentation_page(vehicle, **how)


def test_the_page_is_whole_loads_nothing_and_is_small(page: str) -> None:
    check_is_whole(page)
    check_refers_to_itself_alone(page)
    root = html.fromstring(page)
    plots = [svg for svg in root.iter("svg") if not svg.get("id")]  # the script fills those with an id
    assert (len(plots), len(list(root.iter("img")))) == (10, 2)
    assert len(page.encode()) - len(live_section(page).encode()) < 163_000  # 9 kB are the style of the live section


def live_section(page: str) -> str:
    """Return the section in which the model flies."""
    (section,) = re.findall(r'<section class="live".*?</section>', page, re.DOTALL)
    return str(section)


def test_what_flies_is_small_and_its_script_alone_is_allowed(page: str, vehicle: Vehicle) -> None:
    section = live_section(page).encode()
    # With the reading of logs, in which times of day alone take 5,000, the autopilots, which take 6,000, and what tells
    # the labels of hidden thrusters, 1,400.
    assert len(section) < 139_000
    assert len(zlib.compress(section, 9)) < 50_500
    root = html.fromstring(page)
    data, script = root.iter("script")
    assert [dict(data.attrib), dict(script.attrib)] == [{"type": "application/json", "id": "live-vehicles"}, {}]
    digest = base64.b64encode(hashlib.sha256((script.text or "").encode()).digest()).decode()
    (policy,) = (m.get("content") for m in root.iter("meta") if m.get("http-equiv") == "Content-Security-Policy")
    assert dict(part.strip().split(" ", 1) for part in policy.split(";")) == {
        "default-src": "'none'",
        "style-src": "'unsafe-inline'",
        "img-src": "data:",
        "script-src": f"'sha256-{digest}' 'wasm-unsafe-eval'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    (one,) = json.loads(data.text or "")
    assert {(one["axes"][test["axis"]]["name"], test["command"]) for test in one["tests"]} == {
        (form.axis.name, float(command) / 100.0) for form in vehicle.layout.axes for command in held_commands(vehicle)
    }


def test_text_of_the_vehicle_file_is_escaped(vehicle: Vehicle) -> None:
    odd = replace(vehicle, name=ODD_NAME, description="<script>", data=None)
    root = html.fromstring(page_without_plots(odd))
    assert root.findtext(".//h1") == ODD_NAME
    assert not list(root.iter("script"))


# ---- Other vehicles ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def heavy_page(heavy: Vehicle) -> str:
    return page_without_plots(with_intervals(heavy, {"a_d_u": (130.5, 151.5)}))


@pytest.mark.parametrize("content_of", [native_content, python_content])
def test_nothing_of_the_videoray_stands_in_the_fmu_of_another_vehicle(
    vehicle: Vehicle, heavy: Vehicle, heavy_page: str, content_of: Callable[..., FmuContent]
) -> None:
    """Neither its name nor its pictures nor what was found of it alone."""
    assert vehicle.pictures
    own = {path.read_bytes() for path in vehicle.pictures.iterdir()}
    for name, content in content_of(heavy, {"documentation/index.html": heavy_page.encode()}).files.items():
        assert content not in own, name
        if not name.endswith((".png", ".so", ".dll")):
            text = content.decode("utf-8").lower()
            for claim in ("videoray", "#f6b90c", *(limit.lower() for limit in vehicle.limits)):
                assert claim not in text, (name, claim)


def test_the_listed_commands_drive_the_vehicle_as_listed(heavy: Vehicle, heavy_page: str) -> None:
    """Both directions where they differ, by the equation of the steady state: a_d V^2 + b_d V = F + F_0."""
    table = {row[0]: row for row in rows(heavy_page) if row and row[0].startswith(("Surge (", "Heave "))}
    assert table["Heave up (m/s)"][1] == "u_5 = −c, u_6 = −c, u_7 = −c, u_8 = −c"
    k = heavy
    for name, end, sign in (("Heave down (m/s)", "", 1.0), ("Heave up (m/s)", "_reverse", -1.0)):
        V = sign * float(table[name][-2].replace("−", "-"))  # at full command, to three digits
        m = 1.0 - k["c_0_t200"]
        force = 4.0 * (k[f"a_t_t200{end}"] * m**2 + k[f"b_t_t200{end}"] * m) + sign * k["F_0_w"]
        assert k["a_d_w"] * V**2 + k["b_d_w"] * V == pytest.approx(force, rel=2e-3)
    assert "With all inputs zero, the constant load moves it." in text_of(heavy_page)
    assert "videoray" not in heavy_page.lower(), "nothing of it stands on the page of another vehicle"
