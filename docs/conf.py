"""The site: `sphinx-build -W docs site`. {{ README.md }} stands for that file, {{ t200 }} for a table.

With `-D nb_execution_mode=off` the notebooks are not run, and the build takes a quarter of a minute.
"""

import os
import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

from rov_fmu import __version__

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from docs import compared, reference  # noqa: E402 (they stand beside this file)
from rov_fmu.fmu.module import web_module  # noqa: E402
from rov_fmu.io.output import Output, write_whole  # noqa: E402
from rov_fmu.report.page.live import Flown, fly_page  # noqa: E402
from rov_fmu.report.page.pictures import diagram  # noqa: E402
from rov_fmu.vehicle.shipped import SHIPPED  # noqa: E402
from rov_fmu.vehicle.vehicle import load_vehicle  # noqa: E402

project = "rov-fmu"
release = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_click", "sphinx_copybutton"]

# Notebooks are pages too, and an error in one is a warning of the build. Their commands are those of this Python, and
# print without colours.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ["TTY_COMPATIBLE"] = "0"
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_output_stderr = "remove"  # the progress of commands, with times that differ

myst_heading_anchors = 3
smartquotes = False  # a prime is a derivative
default_role = "code"
autodoc_default_options = {"members": True, "undoc-members": True, "exclude-members": "__init__"}
autodoc_class_signature = "separated"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = "rov-fmu"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0a5cad", "color-brand-content": "#0a5cad"},
    "dark_css_variables": {"color-brand-primary": "#6db3f2", "color-brand-content": "#6db3f2"},
}

TABLES = compared.tables()

FLOWN = [load_vehicle(SHIPPED[name]) for name in ("videoray", "bluerov2_heavy")]
_LINKS = " or ".join(
    f'<a href="fly/compact/{one.identifier}.html" target="fly">{one.name}</a> '
    f'(<a href="fly/{one.identifier}.html">with all controls</a>)'
    for one in FLOWN
)
COCKPIT = f"""<p>Fly it here: the {_LINKS}. Drag a stick in the picture, or click the picture and use the keys.</p>
<iframe class="fly" name="fly" src="fly/compact/{FLOWN[0].identifier}.html" title="A vehicle in flight"></iframe>

"""
"""On the first page, in place of the README's moving picture."""
MOVING_PICTURE = re.compile(r"^\[!\[[^\]]*\]\(fly\.webp\)\].*\n", re.MULTILINE)

DRAWN = {name: load_vehicle(SHIPPED[name]) for name in ("videoray", "bluerov2", "bluerov2_heavy")}
"""The vehicles of the gallery. The refit of the VideoRay has the same thrusters."""
GALLERY = "".join(
    f'<figure class="drawing"><figcaption>{one.name}</figcaption>'
    f'<img src="drawings/{name}.svg" alt="Thrusters and axes of the {one.name}"></figure>\n\n'
    for name, one in DRAWN.items()
)
"""On the page of the vehicles."""


def _fill(_app: Sphinx, _page: str, source: list[str]) -> None:
    """Put in what stands elsewhere; its links are seen from docs/, and to what is not on the site there is none.

    The first page of the site is the README.
    """

    def text(match: re.Match[str]) -> str:
        if match[1] == "gallery":
            return GALLERY
        if match[1] in TABLES:
            return reference.markdown(TABLES[match[1]])
        whole = (ROOT / match[1]).read_text(encoding="utf-8").replace("](docs/", "](")
        whole = MOVING_PICTURE.sub(lambda _: COCKPIT, whole)
        whole = re.sub(r"\]\((CHANGELOG|CONTRIBUTING)\.md\)", lambda name: f"]({name[1].lower()}.md)", whole)
        return re.sub(r"\[([^\]]+)\]\(CITATION\.cff\)", r"\1 (`CITATION.cff`)", whole)

    source[0] = re.sub(r"\{\{ (\S+) \}\}", text, source[0]).replace("](../README.md", "](index.md")


def _fly(app: Sphinx, error: Exception | None) -> None:
    """Write the pages that fly, each also in the compact form that the first page embeds."""
    folder = Path(app.outdir, "fly")
    if error is None:
        (folder / "compact").mkdir(parents=True, exist_ok=True)
        for one in FLOWN:
            flown, name = [Flown(one, web_module(one.layout))], f"{one.identifier}.html"
            write_whole(Output(folder / name, fly_page(flown).encode()))
            write_whole(Output(folder / "compact" / name, fly_page(flown, compact=True).encode()))


def _draw(app: Sphinx, error: Exception | None) -> None:
    """Write the drawings of the vehicles, those of the FMU's diagram."""
    folder = Path(app.outdir, "drawings")
    if error is None:
        folder.mkdir(exist_ok=True)
        for name, one in DRAWN.items():
            write_whole(Output(folder / f"{name}.svg", diagram(one.rov).encode()))


def _plain(*arguments: list[str]) -> None:
    """Docstrings are plain text: |v| in one is a magnitude, not a substitution, and thrust_ is not a link."""
    lines = arguments[-1]
    lines[:] = [re.sub(r"\||\*|_(?!\w)", r"\\\g<0>", line) for line in lines]


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _fill)
    app.connect("build-finished", _fly)
    app.connect("build-finished", _draw)
    app.connect("autodoc-process-docstring", _plain)
    app.connect("sphinx-click-process-description", _plain)
