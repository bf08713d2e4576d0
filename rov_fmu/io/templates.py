"""Text made from the templates of fmu_src/ and of the pages: what comes from files is escaped."""

from collections.abc import Callable, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from jinja2 import BytecodeCache, Environment, FileSystemLoader, StrictUndefined
from jinja2.bccache import Bucket
from markupsafe import Markup

from rov_fmu.io.paths import FMU_SRC


class _Compiled(BytecodeCache):
    """Templates compiled before, as long as the process lives: to compile one takes longer than to render it."""

    def __init__(self) -> None:
        self._code: dict[str, bytes] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        if code := self._code.get(bucket.key):
            bucket.bytecode_from_string(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        self._code[bucket.key] = bucket.bytecode_to_string()


_COMPILED = _Compiled()


def render(template: str, folder: Path | None = None, /, **content: object) -> str:
    """A template of fmu_src/, or of another folder that may include those; a name misspelt is an error.

    Functions among the content are filters.
    """
    folders = [*filter(None, [folder]), FMU_SRC / "templates"]
    templates = Environment(
        loader=FileSystemLoader(folders),
        autoescape=lambda name: bool(name) and not str(name).endswith(".h.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        bytecode_cache=_COMPILED,
    )
    filters: dict[str, Callable[..., str]] = {n: f for n, f in content.items() if callable(f)}
    templates.filters |= {"attributes": _attributes} | filters
    return templates.get_template(template).render(content)


def _attributes(given: Mapping[str, object]) -> Markup:
    """XML attributes, those that have a value; a number is the shortest decimal that is exactly this double."""
    return Markup("".join(f" {name}={quoteattr(str(v))}" for name, v in given.items() if v is not None))
