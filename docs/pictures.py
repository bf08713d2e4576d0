"""Make the pictures of the README and the pages from the product: `python -m docs.pictures [NAME ...]`.

Without a name, those are made whose page or plot has changed since. `docs/pictures.toml` has, for each picture, a
digest of what draws it, and a test compares them. Look at each picture that is made. `--same` takes over the digests
of pictures that a change did not alter. Pages are drawn by headless Chromium, driven by Playwright
(`pip install -e ".[interop]"`). `ardusub.webp` shows a flight of ArduSub: `--flight LOG` names its log.
"""

import ast
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import click
import tomllib
from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parent
DIGESTS = HERE / "pictures.toml"
WIDTH = 1340

# ---- What the pictures show ------------------------------------------------------------------------------------------


def _cells(page: str, folder: Path, until: str) -> None:
    """Run the shell commands of a tutorial in a folder, up to the cell with a command."""
    text = (HERE / page).read_text(encoding="utf-8")
    for cell in re.findall(r"^(?:%%|```)sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        _run("sh", "-c", cell, folder=folder)
        if until in cell:
            return
    raise ValueError(f"{page} has no cell with {until}")


def _run(*command: str | Path, folder: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT), "MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl")}
    subprocess.run([*map(str, command)], cwd=folder, env=environment, check=True, stdout=sys.stderr)


def _rov_fmu(*words: str | Path, folder: Path) -> None:
    _run(sys.executable, "-m", "rov_fmu", *words, folder=folder)


def _report(folder: Path) -> bytes:
    _cells("tutorial-tank-tests.md", folder, "rov-fmu identify")
    return _webp(_screen(folder / "otter.html", 800))


def _report_of_dive(folder: Path) -> bytes:
    _cells("tutorial-dive-log.md", folder, "rov-fmu identify")
    return _webp(_screen(folder / "harbour.html", 980))


def _no_velocity(folder: Path) -> bytes:
    _run(sys.executable, "-m", "examples.dive_log", "dive.tlog", "--no-dvl", folder=folder)
    _rov_fmu("identify", "dive.tlog", "-o", "mine.toml", "--report", "mine.html", folder=folder)
    return _webp(_screen(folder / "mine.html", 820))


def _study(folder: Path) -> bytes:
    _cells("tutorial-stopping-distance.md", folder, "-o wall")
    return _webp(_screen(folder / "wall" / "study.html", 980))


def _mujoco(folder: Path) -> bytes:
    _rov_fmu("export", "bluerov2", "--to", "mujoco", folder=folder)
    _run(sys.executable, "-m", "bluerov2_mujoco", "rov.png", folder=folder)
    return _webp((folder / "rov.png").read_bytes())


def _system(folder: Path) -> bytes:
    _run(sys.executable, "-m", "examples.system.run", "system", "--figure", "system.svg", folder=folder)
    return (folder / "system.svg").read_bytes()


def _plan_of(page: str, word: str) -> str:
    """Return the first plan in a page that has a word."""
    text = (HERE / page).read_text(encoding="utf-8")
    plans: list[str] = re.findall(r"^```toml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return next(one for one in plans if word in one)


def _plan(page: str, folder: Path, name: str) -> None:
    """Run the first system that a page describes."""
    plan = _plan_of(page, "component")
    heavy = (ROOT / "models/bluerov2_heavy/bluerov2_heavy.toml").read_text(encoding="utf-8")
    shutil.copytree(ROOT / "models/bluerov2_heavy", folder, dirs_exist_ok=True)
    (folder / "my_rov.toml").write_text(f"waves = true\n{heavy}", encoding="utf-8")
    (folder / f"{name}.toml").write_text(plan, encoding="utf-8")
    _rov_fmu("system", f"{name}.toml", "-o", f"{name}.ssp", "--run", folder=folder)


def _tether(folder: Path) -> bytes:
    _plan("system.md", folder, "tether")
    _run(sys.executable, "-m", "examples.tether", "tether.csv", "shape.svg", folder=folder)
    return (folder / "shape.svg").read_bytes()


def _waves(folder: Path) -> bytes:
    _plan("waves.md", folder, "sea")
    return (folder / "sea.svg").read_bytes()


def _flight(folder: Path) -> bytes:
    """The plots of a flight of ArduSub in its simulator, whose log is in the folder."""
    log = next(folder.iterdir(), None)
    if not log:
        raise click.UsageError("ardusub.webp shows a flight of ArduSub: add --flight LOG")
    page = folder / "flight.html"
    _rov_fmu("inspect", log, "--report", page, folder=folder)
    return _webp(_screen(page, 900, part="figure.picture .broad"))


# ---- The page that flies, as a moving picture ------------------------------------------------------------------------

_FRAME, _PLAYED, _LAST = 0.4, 130, 1500
"""The simulated seconds between two frames; the milliseconds for which a frame, and the last one, is shown."""
_MANOEUVRE: list[tuple[float, dict[str, float]]] = [
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


def _fly(folder: Path) -> bytes:
    _rov_fmu("fly", "videoray", "-o", "fly.html", folder=folder)
    frames = []
    with _opened(folder / "fly.html", 1000, 596) as page:
        page.wait_for_selector("#live-section:not([hidden])")
        page.evaluate(_PREPARE)
        for seconds, commands in _MANOEUVRE:
            for _ in range(round(seconds / _FRAME)):
                page.evaluate(_FLY, [commands, _FRAME])
                frames.append(Image.open(BytesIO(page.screenshot())).convert("RGB"))
    first, *others = frames
    times, drawn = [_PLAYED] * len(others) + [_LAST], BytesIO()
    moving = {"save_all": True, "append_images": others, "duration": times, "loop": 0, "minimize_size": True}
    first.save(drawn, "WEBP", quality=40, method=6, **moving)
    return drawn.getvalue()


# ---- How they are made -----------------------------------------------------------------------------------------------


@contextmanager
def _opened(page: Path, width: int, height: int) -> Iterator[Any]:
    """Open a page in a window of a size in pixels."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as engine:
        chromium = engine.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        opened = chromium.new_page(viewport={"width": width, "height": height})
        opened.goto(page.resolve().as_uri())
        opened.wait_for_load_state("networkidle")
        yield opened
        chromium.close()


def _screen(page: Path, height: int, part: str = "") -> bytes:
    """Return the picture of the first screen of a page, or of a part of it."""
    with _opened(page, WIDTH, height) as opened:
        picture: bytes = opened.locator(part).first.screenshot() if part else opened.screenshot()
        return picture


def _webp(picture: bytes) -> bytes:
    drawn = BytesIO()
    Image.open(BytesIO(picture)).convert("RGB").save(drawn, "WEBP", quality=70, method=6)
    return drawn.getvalue()


@dataclass(frozen=True)
class Picture:
    """A picture: what makes it in a folder that has at most the log of --flight, and the files that draw it, as
    patterns in the checkout."""

    make: Callable[[Path], bytes]
    drawn_by: tuple[str, ...]

    @property
    def digest(self) -> str:
        """A digest of the files that draw it. Comments and docstrings of Python do not count."""
        found = hashlib.sha256()
        files = sorted({file for pattern in self.drawn_by for file in ROOT.glob(pattern)})
        for file in files:
            content = file.read_bytes()
            found.update(file.relative_to(ROOT).as_posix().encode())
            found.update(_code(content).encode() if file.suffix == ".py" else content)
        return found.hexdigest()[:16]


def _code(content: bytes) -> str:
    """Return what a module does, without its comments and docstrings."""
    tree = ast.parse(content)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [  # type: ignore[attr-defined]
                one for one in body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))
            ]
    return repr(_plain(tree))


def _plain(value: object) -> object:
    """Return a tree of code as lists, without what only some versions of Python write into it: fields with nothing."""
    if isinstance(value, ast.AST):
        fields = [(name, _plain(field)) for name, field in ast.iter_fields(value) if field not in (None, [])]
        return type(value).__name__, fields
    return [*map(_plain, value)] if isinstance(value, list) else value


_PAGE = ("rov_fmu/report/palette.py", *(f"rov_fmu/report/templates/{name}.css.j2" for name in ("page", "plots")))
_PLOTS = ("rov_fmu/report/palette.py", "rov_fmu/report/plots/svg.py", "rov_fmu/report/plots/plots.mplstyle")
_LOGS = (*_PLOTS, "rov_fmu/report/plots/logs.py")
_REPORT = (*_PAGE, *_LOGS, "rov_fmu/report/templates/report.*", "rov_fmu/report/templates/fold.html.j2")
PICTURES = {
    "report.webp": Picture(_report, _REPORT),
    "report_dive.webp": Picture(_report_of_dive, _REPORT),
    "no_velocity_sensor.webp": Picture(_no_velocity, _REPORT),
    "study.webp": Picture(
        _study, (*_PAGE, *_PLOTS, "rov_fmu/report/templates/study.html.j2", "rov_fmu/study/plots.py")
    ),
    "ardusub.webp": Picture(_flight, _LOGS),
    "mujoco.webp": Picture(_mujoco, ("rov_fmu/bridges/mujoco/*.py", "rov_fmu/report/plots/geometry.py")),
    "system.svg": Picture(_system, (*_PLOTS, "examples/system/*.py")),
    "tether.svg": Picture(_tether, (*_PLOTS, "examples/tether.py")),
    "waves.svg": Picture(_waves, (*_PLOTS, "rov_fmu/bridges/system/run.py")),
    "fly.webp": Picture(
        _fly, (*_PAGE, "fmu_src/live/*.js", "rov_fmu/report/templates/fly.html.j2", "rov_fmu/report/templates/live.*")
    ),
}
"""The pictures of pages and plots by their names."""
ELSEWHERE = {
    "cost_error.svg": "python -m verification.benchmarks",
}
"""Pictures that other commands draw."""


def changed() -> dict[str, str]:
    """Return the pictures whose pages or plots have changed since, with the digests as they are now."""
    own = tomllib.loads(DIGESTS.read_text(encoding="utf-8")) if DIGESTS.exists() else {}
    now = {name: picture.digest for name, picture in PICTURES.items()}
    return {name: digest for name, digest in now.items() if own.get(name) != digest}


def _note(names: Iterable[str]) -> None:
    """Write the digests of some pictures as they are now."""
    own = tomllib.loads(DIGESTS.read_text(encoding="utf-8")) if DIGESTS.exists() else {}
    own |= {name: PICTURES[name].digest for name in names}
    lines = [f'"{name}" = "{own[name]}"\n' for name in PICTURES if name in own]
    DIGESTS.write_text(f"# The digests of what drew the pictures: docs/pictures.py\n{''.join(lines)}", encoding="utf-8")


@click.command(help=__doc__)
@click.argument("names", nargs=-1, type=click.Choice([*PICTURES]))
@click.option("--same", is_flag=True, help="Make no picture: they look as before.")
@click.option("--flight", type=click.Path(path_type=Path, exists=True), help="Log of a flight of ArduSub.")
def main(names: tuple[str, ...], same: bool, flight: Path | None) -> None:
    """Make pictures."""
    for name in names or changed():
        if not same:
            with tempfile.TemporaryDirectory() as folder:
                if flight:
                    shutil.copy(flight, folder)
                (HERE / name).write_bytes(PICTURES[name].make(Path(folder)))
        _note([name])
        click.echo(f"docs/{name}")


if __name__ == "__main__":
    main()
