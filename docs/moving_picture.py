"""Draw the README's moving picture: `python -m docs.moving_picture docs/fly.webp`.

Headless Chromium, driven by Playwright (`pip install -e ".[interop]"`), opens the page of `rov-fmu fly videoray` and
flies a manoeuvre on it. Every frame is one screenshot, and the time between two frames is simulated time.
"""

import shutil
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from rov_fmu.fmu.content import web_module
from rov_fmu.report.page.live import FlyingVehicle, fly_page
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

WIDTH, HEIGHT = 1000, 596
FRAME = 0.4
"""The simulated seconds between two frames."""
PLAYED = 130
"""The milliseconds that a frame is shown: the flight is played about three times as fast as it is."""
LAST = 1500
"""The milliseconds that the last frame is shown."""

MANOEUVRE = [
    (1.0, {}),
    (4.5, {"u_l": 0.45, "u_r": 0.45}),
    (5.0, {"u_l": 0.5, "u_r": 0.3, "u_t": 0.5}),
    (5.0, {"u_l": 0.2, "u_r": 0.5, "u_t": -0.4}),
    (4.5, {}),
]
"""The seconds of each part, and the commands that hold during it."""

_PREPARE = """() => {
    live.frame = () => {};  // the script below steps the flight, not the clock
    live.zoom(1.5);
    live.say("");
    for (const below of document.querySelectorAll(".legend, .keys, .live > p, footer")) below.style.display = "none";
}"""
_FLY = """([commands, seconds]) => {
    for (const name of Object.keys(live.held)) live.held[name] = commands[name] ?? 0;
    live.command();
    live.flight.advance(seconds);
    live.show();
    live.draw();
}"""


def frames(page: Any) -> list[Image.Image]:
    """Fly the manoeuvre on the open page and return its pictures."""
    found = []
    for seconds, commands in MANOEUVRE:
        for _ in range(round(seconds / FRAME)):
            page.evaluate(_FLY, [commands, FRAME])
            found.append(Image.open(BytesIO(page.screenshot())).convert("RGB"))
    return found


def main(target: Path) -> None:
    """Write the moving picture, a WebP."""
    vehicle = load_vehicle(SHIPPED["videoray"])
    with sync_playwright() as engine:
        browser = engine.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_content(fly_page([FlyingVehicle(vehicle, web_module(vehicle.layout))]))
        page.wait_for_selector("#live-section:not([hidden])")
        page.evaluate(_PREPARE)
        first, *others = frames(page)
        browser.close()
    shown = [PLAYED] * len(others) + [LAST]
    first.save(
        target, save_all=True, append_images=others, duration=shown, loop=0, quality=40, method=6, minimize_size=True
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
