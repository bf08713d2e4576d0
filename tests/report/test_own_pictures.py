"""A vehicle's own pictures may come from a stranger: the page shows them as images, in which nothing runs."""

import base64
import re
import shutil
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest
from lxml import html
from PIL import Image

from rov_fmu.fmu.content import native_content
from rov_fmu.io.messages import FileError
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.report.conftest import Visit
from tests.report.pages import UNFOLD

_OPEN = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 200 100"'
_FULL = '<rect width="200" height="100" fill="#c43e12"/>'
_OWN = "document.title='owned'"
_HTML = 'xmlns="http://www.w3.org/1999/xhtml"'
_REFRESH = 'http-equiv="refresh" content="0;url=about:blank"'
_FRAME = f"""<iframe {_HTML} srcdoc="&lt;script>top.{_OWN}&lt;/script>"/>"""
# Each would set the title of the page, leave it or ask for something, if it had an effect.
HOSTILE = {
    "onload": f'{_OPEN} onload="{_OWN}">{_FULL}</svg>',
    "onclick": f'{_OPEN}><g onclick="{_OWN}">{_FULL}</g></svg>',
    "script": f"{_OPEN}>{_FULL}<script>{_OWN}</script></svg>",
    "script without a namespace": f'{_OPEN}>{_FULL}<script xmlns="">{_OWN}</script></svg>',
    "script of HTML": f"{_OPEN}>{_FULL}<script {_HTML}>{_OWN}</script></svg>",
    "javascript link": f'{_OPEN}><a href="javascript:{_OWN}">{_FULL}</a></svg>',
    "javascript xlink": f'{_OPEN}><a xlink:href="javascript:{_OWN}">{_FULL}</a></svg>',
    "link": f'{_OPEN}><a href="about:blank" target="_top">{_FULL}</a></svg>',
    "refresh": f"{_OPEN}>{_FULL}<meta {_HTML} {_REFRESH}/></svg>",
    "refresh without a namespace": f'{_OPEN}>{_FULL}<meta xmlns="" {_REFRESH}/></svg>',
    "a page in it": f'{_OPEN}>{_FULL}<foreignObject width="9" height="9">{_FRAME}</foreignObject></svg>',
    "the end of the attribute": f'{_OPEN}>{_FULL}<desc>"><![CDATA[</div><script>{_OWN}</script>]]></desc></svg>',
    "a request": f'{_OPEN}>{_FULL}<image href="http://127.0.0.1:9/seen" width="9" height="9"/></svg>',
}


def _page(folder: Path, picture: str) -> Path:
    """Write the page of the VideoRay with this picture of it, and return its path."""
    vehicle = folder / "videoray.toml"
    (folder / "pictures").mkdir()
    (folder / "pictures" / "from_above.svg").write_text(picture, encoding="utf-8")
    text = VIDEORAY.read_text(encoding="utf-8")
    vehicle.write_text(re.sub("^data = .*$", "", text, flags=re.M), encoding="utf-8")
    page = folder / "index.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rov_fmu.report.page.fmu_page.inline_svg", lambda *_: "")  # plots take most of the time
        page.write_text(documentation_page(load_vehicle(vehicle)), encoding="utf-8")
    return page


@pytest.mark.interop
@pytest.mark.parametrize("case", HOSTILE)
def test_nothing_in_a_picture_runs_or_navigates(case: str, visit: Callable[..., Visit], tmp_path: Path) -> None:
    path = _page(tmp_path, HOSTILE[case])
    seen = visit()
    seen.page.goto(path.as_uri())
    seen.page.evaluate(UNFOLD)
    picture = seen.page.get_by_alt_text("The vehicle from above")
    assert picture.evaluate("image => image.complete && image.naturalWidth > 0"), "it is shown"
    title = seen.page.title()
    picture.click()
    seen.page.wait_for_timeout(300)
    assert seen.page.title() == title != "owned"
    assert seen.page.url == path.as_uri()
    assert [url for url in seen.requests if not url.startswith("data:image/svg+xml;base64,")] == [path.as_uri()]
    assert len(seen.page.context.pages) == 1
    assert seen.problems() == []


def test_a_picture_stands_in_the_page_as_an_image_alone(tmp_path: Path) -> None:
    for case in ("onload", "script of HTML", "the end of the attribute"):
        folder, picture = tmp_path / case, HOSTILE[case]
        folder.mkdir()
        text = _page(folder, picture).read_text(encoding="utf-8")
        assert "owned" not in text
        (image,) = html.fromstring(text).iter("img")
        kind, _, data = image.get("src").partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert base64.b64decode(data).decode() == picture
        (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)
        assert "img-src data:" in policy
        assert "script-src" not in policy, "without the live section no script at all"


# ---- What is refused -------------------------------------------------------------------------------------------------


def _picture(name: str, folder: Path, content: bytes) -> Path:
    """Write a vehicle with its pictures, one of which is replaced; return the path of its file."""
    shutil.copytree(VIDEORAY.parent, folder, dirs_exist_ok=True)
    (folder / "pictures" / name).write_bytes(content)
    return folder / "videoray.toml"


_PNG = (VIDEORAY.parent / "pictures" / "model.png").read_bytes()
_JPEG = BytesIO()
Image.new("RGB", (8, 8)).save(_JPEG, "JPEG")
NO_PNG = {
    "text": b"root:x:0:0\n",
    "nothing": b"",
    "a JPEG": _JPEG.getvalue(),
    "the beginning of one": _PNG[:200],
    "half of one": _PNG[: len(_PNG) // 2],
    "a page behind its signature": _PNG[:8] + b"<html>",
    "far too many pixels": _PNG[:16] + (100_000).to_bytes(4, "big") * 2 + _PNG[24:],
}


@pytest.mark.parametrize("case", NO_PNG)
def test_a_model_png_that_is_none_is_refused(case: str, tmp_path: Path) -> None:
    vehicle = load_vehicle(_picture("model.png", tmp_path, NO_PNG[case]))
    with pytest.raises(FileError, match=r"model\.png: not a PNG picture"):
        native_content(vehicle)


@pytest.mark.parametrize("content", [b"a drawing", b"<svg/>", b"<html xmlns='http://www.w3.org/1999/xhtml'/>", b""])
def test_a_drawing_that_is_no_svg_is_refused(content: bytes, tmp_path: Path) -> None:
    vehicle = load_vehicle(_picture("from_above.svg", tmp_path, content))
    with pytest.raises(FileError, match=r"from_above\.svg: not an SVG picture"):
        documentation_page(vehicle)
