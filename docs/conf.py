"""The site: `sphinx-build -W docs site`. {{ README.md }} stands for that file, {{ t200 }} for a table."""

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

from rov_fmu import __version__

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from docs import compared, reference  # noqa: E402 (they stand beside this file)

project = "rov-fmu"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]

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


def _fill(_app: Sphinx, _page: str, source: list[str]) -> None:
    """Put in what stands elsewhere; its links are seen from docs/, and to what is not on the site there is none."""

    def text(match: re.Match[str]) -> str:
        if match[1] in TABLES:
            return reference.markdown(TABLES[match[1]])
        whole = (ROOT / match[1]).read_text(encoding="utf-8").replace("](docs/", "](")
        whole = re.sub(r"\]\((CHANGELOG|CONTRIBUTING)\.md\)", lambda name: f"]({name[1].lower()}.md)", whole)
        return re.sub(r"\[([^\]]+)\]\(CITATION\.cff\)", r"\1 (`CITATION.cff`)", whole)

    source[0] = re.sub(r"\{\{ (\S+) \}\}", text, source[0])


def _plain(*arguments: list[str]) -> None:
    """Docstrings are plain text: |v| in one is a magnitude, not a substitution."""
    lines = arguments[-1]
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _fill)
    app.connect("autodoc-process-docstring", _plain)
