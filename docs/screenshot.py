"""Draw the top of a page: `python -m docs.screenshot otter.html docs/report.webp`.

The pictures at the head of the tutorials are made so, from the pages that their commands write: `report.webp` from
`otter.html`, and, 980 pixels high, `report_dive.webp` from `harbour.html` and `study.webp` from `wall/study.html`.
Headless Chromium, driven by Playwright (`pip install -e ".[interop]"`), opens the page.
"""

import shutil
import sys
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

WIDTH = 1340


def main(page: Path, target: Path, height: int = 800) -> None:
    """Write the picture of the first screen of a page, a WebP of this height in pixels."""
    with sync_playwright() as engine:
        browser = engine.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        opened = browser.new_page(viewport={"width": WIDTH, "height": height})
        opened.goto(page.resolve().as_uri())
        opened.wait_for_load_state("networkidle")
        picture = opened.screenshot()
        browser.close()
    Image.open(BytesIO(picture)).convert("RGB").save(target, quality=70, method=6)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:]))
