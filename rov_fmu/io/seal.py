"""A digest in the first line of a file, which shows whether anybody has changed the file since it was written."""

import errno
import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from rov_fmu.io.messages import FileError
from rov_fmu.io.output import WriteError
from rov_fmu.io.reading import read_text

_WORDS = "rov-fmu identify wrote this file. SHA-256 of the lines below:"
_SEAL = re.compile(rf"(?:#|<!--) {re.escape(_WORDS)} ([0-9a-f]{{64}})(?: -->)?")


def sealed(text: str, comment: str) -> str:
    """Return the text with a first line that has its digest. `comment` is how this kind of file writes one: `# {}`."""
    return f"{comment.format(f'{_WORDS} {_digest(text)}')}\n{text}"


def check_replaced(paths: Iterable[Path], *, force: bool) -> list[str]:
    """Return a line for each existing file that will be replaced.

    Raises WriteError about the first file that `identify` did not write, or that has changed since, unless `force`.
    """
    lines = []
    for path in paths:
        if not path.exists():
            continue
        if (reason := _not_as_written(path)) and not force:
            raise WriteError(errno.EEXIST, f"the file there {reason}; --force replaces it", str(path))
        replaced = f"a file that {reason}" if reason else "the result of an earlier run"
        lines.append(f"{path}: replaced {replaced}")
    return lines


def _not_as_written(path: Path) -> str:
    """Return why a file is not as `identify` wrote it, or an empty text if it is."""
    try:
        first, _, rest = read_text(path).partition("\n")
    except FileError:
        first = rest = ""
    seal = _SEAL.fullmatch(first)
    if not seal:
        return "does not begin with a digest by identify, so it may have been made by hand"
    return "" if seal[1] == _digest(rest) else "has changed since identify wrote it"


def _digest(text: str) -> str:
    """Return the SHA-256 of a text in hexadecimal."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()
