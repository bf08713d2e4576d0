"""Files read whole; where one cannot be, a line that names it and says why."""

from collections.abc import Callable
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import TextIO

from rov_fmu.io.messages import FileError


def read_bytes(path: Path, kind: type[FileError] = FileError, *, most: int | None = None) -> bytes:
    """The content of a file. Raises `kind`, and reads nothing of a file of more bytes than `most`."""
    try:
        if most is not None and (size := path.stat().st_size) > most:
            raise kind(f"{path}: is too large, with {size / 1e6:.0f} MB: at most {most / 1e6:.0f} MB are read")
        return path.read_bytes()
    except OSError as error:
        raise kind(f"{path}: cannot be read: {error.strerror or error}") from error


def read_text(path: Path, kind: type[FileError] = FileError, *, most: int | None = None) -> str:
    """The text of a file in UTF-8, lines ended by \\n, without a byte order mark. Raises `kind` as read_bytes does."""
    return read_lines(path, kind, most=most)().read()


def read_lines(path: Path, kind: type[FileError] = FileError, *, most: int | None = None) -> Callable[[], TextIO]:
    """The same as a stream of lines, which takes less memory; each call of what is returned begins it anew."""
    content = read_bytes(path, kind, most=most)
    try:
        content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise kind(f"{path}: not UTF-8 text, at byte {error.start}") from error
    return lambda: TextIOWrapper(BytesIO(content), "utf-8-sig")
