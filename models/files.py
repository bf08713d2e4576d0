"""Files written whole or not at all."""

import errno
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def write_whole(path: Path, content: bytes, check: Callable[[Path], None] = lambda _: None) -> None:
    """Put content in place of whatever file was there, once `check` has passed a draft of it.

    Raises OSError about this path where it cannot be written, and what `check` raises.
    """
    if path.is_dir():
        raise OSError(errno.EISDIR, "is a folder, not a file to write", str(path))
    if not path.parent.is_dir():
        raise OSError(errno.ENOENT, f"there is no folder {path.parent}", str(path))
    draft: Path | None = None
    try:
        with _errors_about(path):
            descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
            draft = Path(name)
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        check(draft)
        with _errors_about(path):
            mask = os.umask(0)
            os.umask(mask)
            draft.chmod(0o666 & ~mask)  # as if it had been opened like any file
            draft.replace(path)
    finally:
        if draft is not None:
            draft.unlink(missing_ok=True)


@contextmanager
def _errors_about(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
