"""Rendering of the templates in fmu_src/ and of the pages. Values are escaped, so they cannot inject markup."""

from collections.abc import Callable, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from jinja2 import BytecodeCache, Environment, FileSystemLoader, StrictUndefined
from jinja2.bccache import Bucket
from markupsafe import Markup

from rov_fmu.io.paths import FMU_SRC


class _Compiled(BytecodeCache):
    """The compiled templates of this process, kept because compiling one takes longer than rendering it."""

    def __init__(self) -> None:
        self._code: dict[str, bytes] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        if code := self._code.get(bucket.key):
            bucket.bytecode_from_string(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        self._code[bucket.key] = bucket.bytecode_to_string()


_COMPILED = _Compiled()


def render(template: str, folder: Path | None = None, /, **content: object) -> str:
    """Render a template of fmu_src/, or of another folder, whose templates may include those. Unknown names are errors.

    Functions in `content` become filters.
    """
    folders = [*filter(None, [folder]), FMU_SRC / "templates"]
    templates = Environment(
        loader=FileSystemLoader(folders),
        autoescape=lambda name: bool(name) and not str(name).endswith((".h.j2", ".md.j2", ".toml.j2", ".yaml.j2")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        bytecode_cache=_COMPILED,
    )
    filters: dict[str, Callable[..., str]] = {name: value for name, value in content.items() if callable(value)}
    templates.filters |= {"attributes": _attributes} | filters
    return templates.get_template(template).render(content)


def _attributes(values: Mapping[str, object]) -> Markup:
    """Return XML attributes for the values that are not None; floats are the shortest decimals that are exact."""
    return Markup("".join(f" {name}={quoteattr(str(v))}" for name, v in values.items() if v is not None))
