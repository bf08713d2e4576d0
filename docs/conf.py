"""The site: `sphinx-build -W docs site`.

With `-D nb_execution_mode=off` the notebooks are not run, and the build takes a quarter of a minute.
"""

import os
import re
import sys
from itertools import pairwise
from pathlib import Path

from sphinx.application import Sphinx

from rov_fmu import __version__
from rov_fmu.fmu.content import web_module
from rov_fmu.io.output import Output, write_whole
from rov_fmu.report.page.live import FlyingVehicle, fly_page
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

ROOT = Path(__file__).parent.parent

project = "rov-fmu"
release = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton"]

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

FLOWN = [load_vehicle(SHIPPED[name]) for name in ("videoray", "bluerov2_heavy")]
_LINKS = " or ".join(
    f'<a href="fly/compact/{one.identifier}.html" target="fly">{one.name}</a> '
    f'(<a href="fly/{one.identifier}.html">with all controls</a>)'
    for one in FLOWN
)
COCKPIT = f"""<p>Fly it here: the {_LINKS}. Drag a stick in the picture, or click the picture and use the keys.</p>
<iframe class="fly" name="fly" src="fly/compact/{FLOWN[0].identifier}.html" title="A vehicle in flight"></iframe>

"""
"""In place of the moving picture, which nobody can stop."""
MOVING_PICTURE = re.compile(r"^\[?!\[[^\]]*\]\(fly\.webp\).*\n", re.MULTILINE)

SHOWN_HERE = re.compile(r"^The site shows \[(.+)\]\(\.\./\1\) here\.$", re.MULTILINE)
"""In a page, in place of a file at the top of the repository."""


def _fill(_app: Sphinx, _page: str, source: list[str]) -> None:
    """Put in the files that the site shows. Their links are seen from docs/, and lead to pages of the site.

    The first page of the site is the README.
    """

    def text(match: re.Match[str]) -> str:
        whole = (ROOT / match[1]).read_text(encoding="utf-8").replace("](docs/", "](")
        return re.sub(
            r"\]\((CHANGELOG|CODE_OF_CONDUCT|CONTRIBUTING|SECURITY)\.md\)",
            lambda name: f"]({name[1].lower().replace('_', '-')}.md)",
            whole,
        )

    source[0] = SHOWN_HERE.sub(text, source[0]).replace("](../README.md", "](index.md")
    source[0] = MOVING_PICTURE.sub(lambda _: COCKPIT, source[0])


def _fly(app: Sphinx, error: Exception | None) -> None:
    """Write the pages that fly, each also in the compact form that the first page embeds."""
    folder = Path(app.outdir, "fly")
    if error is None:
        (folder / "compact").mkdir(parents=True, exist_ok=True)
        for one in FLOWN:
            flown, name = [FlyingVehicle(one, web_module(one.layout))], f"{one.identifier}.html"
            write_whole(Output(folder / name, fly_page(flown).encode()), force=True)
            write_whole(Output(folder / "compact" / name, fly_page(flown, compact=True).encode()), force=True)


def _plain(*arguments: list[str]) -> None:
    """Docstrings are plain text: |v| in one is a magnitude, not a substitution, and thrust_ is not a link.

    Their examples, which are indented after an empty line, are shown as they are.
    """
    lines, shown = arguments[-1], list[str]()
    for before, line in pairwise(["", *lines]):
        is_example = line.startswith(" " * 4)
        shown += ["::", ""] if is_example and not before.strip() else []
        shown.append(line if is_example else re.sub(r"\||\*|_(?!\w)", r"\\\g<0>", line))
    lines[:] = shown


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _fill)
    app.connect("build-finished", _fly)
    app.connect("autodoc-process-docstring", _plain)
