"""Writing files completely or not at all."""

import errno
import hashlib
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rov_fmu.io.interrupts import UNINTERRUPTED, cleaned_up
from rov_fmu.io.messages import FileError
from rov_fmu.io.reading import read_text


class WriteError(OSError):
    """A path that cannot be written."""


@dataclass(frozen=True)
class Output:
    """A file to write."""

    path: Path
    content: bytes
    check: Callable[[Path], None] = lambda _: None
    """A function that raises an exception if the written draft of the file is wrong."""


def check_targets(targets: Iterable[Path], inputs: Iterable[Path] = ()) -> None:
    """Raise WriteError about the first path that cannot be written, or that is an input or another target."""
    taken = list(inputs)
    for path in targets:
        if path.is_dir():
            raise WriteError(errno.EISDIR, "is a folder, not a file to write", str(path))
        if not path.parent.is_dir():
            raise WriteError(errno.ENOENT, f"there is no folder {path.parent}", str(path))
        if path.exists() and not path.is_file():
            raise WriteError(errno.EINVAL, "is a device or a pipe, and cannot be replaced by a file", str(path))
        if path.exists() and not os.access(path, os.W_OK):
            raise WriteError(errno.EACCES, "is read-only", str(path))
        _check_folder(path)
        for other in taken:
            if is_same(path, other):
                raise WriteError(errno.EEXIST, f"would overwrite {other}, an input or another output", str(path))
        taken.append(path)


def _check_folder(path: Path) -> None:
    """Raise WriteError if no new file can be made in the folder of a path. Only an attempt shows this."""
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        reason = f"no new file can be made in the folder {path.parent}"
        if error.errno in (errno.EACCES, errno.EROFS):
            reason = "its folder is read-only"
        elif error.errno != errno.ENOENT:
            reason += f": {error.strerror}"
        raise WriteError(error.errno, reason, str(path)) from error


def write_whole(*outputs: Output) -> None:
    """Write all files, once their drafts have passed the checks, or none of them.

    Existing files are replaced. If a path is a link, the link is replaced and its target stays. Raises WriteError about
    a path that cannot be written, and whatever a check raises.
    """
    check_targets(output.path for output in outputs)
    with ExitStack() as drafts:
        ready = [(output.path, _draft(output, drafts)) for output in outputs]
        with UNINTERRUPTED:
            for path, draft in ready:
                with _errors_about(path):
                    draft.replace(path)


def _draft(output: Output, drafts: ExitStack) -> Path:
    """Write and check a draft beside the target. It is removed when the stack closes, unless it has been moved."""
    path = output.path
    with _errors_about(path):
        with UNINTERRUPTED:
            descriptor, name = tempfile.mkstemp(prefix=f".{path.name[:40]}.", suffix=".part", dir=path.parent)
            draft = Path(name)
            drafts.enter_context(cleaned_up(partial(draft.unlink, missing_ok=True)))
        with os.fdopen(descriptor, "wb") as file:
            file.write(output.content)
            file.flush()
            os.fsync(file.fileno())
    output.check(draft)
    with _errors_about(path):
        mask = os.umask(0)
        os.umask(mask)
        draft.chmod(0o666 & ~mask)  # the permissions that open() would give
    return draft


def is_same(path: Path, other: Path) -> bool:
    """Return True if two paths lead to the same file, whether or not it exists."""
    if path.exists() and other.exists():
        return path.samefile(other)
    return os.path.realpath(path) == os.path.realpath(other)


@contextmanager
def _errors_about(path: Path) -> Iterator[None]:
    """Raise WriteError about the path instead of any OSError in the block."""
    try:
        yield
    except OSError as error:
        raise WriteError(error.errno, error.strerror, str(path)) from error


# ---- A digest in the first line shows whether anybody has changed a file since ---------------------------------------

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
