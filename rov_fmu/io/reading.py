"""Opening and reading files; if one cannot be read, the error names it and says why."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from rov_fmu.io.messages import NO_FILE, FileError, brief

_MOST_BYTES = 1_000_000_000
"""The largest file that is read as a whole, in bytes, where nothing else is said."""


@contextmanager
def open_file(path: Path, kind: type[FileError] = FileError) -> Iterator[IO[bytes]]:
    """Open a file to read bytes. Raises `kind` if it cannot be opened or read, or is a device or a pipe.

    A stranger's folder may have a link to a device, which never ends, or a pipe, which would wait for a writer. Every
    file that a user names is opened here.
    """
    try:
        with open(path, "rb", opener=_without_waiting) as file:
            yield file
    except FileNotFoundError as error:
        raise kind(f"{path}: {'is a link to a file that is not there' if path.is_symlink() else NO_FILE}") from error
    except (OSError, ValueError) as error:
        if isinstance(error, ValueError) and "null byte" not in str(error):  # a name from a file may have a NUL
            raise
        raise kind(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error


def _without_waiting(path: str, flags: int) -> int:
    """Open a file, and not a device or a pipe, for which the caller could wait. Raises OSError."""
    descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
        raise OSError(errno.EINVAL, "is a device or a pipe, and must be a file", path)
    return descriptor


def read_bytes(path: Path, kind: type[FileError] = FileError, *, most: int = _MOST_BYTES) -> bytes:
    """Return the content of a file. Raises `kind` if it cannot be read, or has more bytes than `most`."""
    with open_file(path, kind) as file:
        size = os.fstat(file.fileno()).st_size
        check_size(f"{path}:", size, most, kind)
        content = file.read(size + 1)
        if len(content) > size:
            raise kind(f"{path}: cannot be read: it has more bytes than its size, {size}")
        return content


def check_size(where: str, size: int, most: int, kind: type[Exception] = FileError) -> None:
    """Raise `kind`, with a message that begins with `where`, if a file has more bytes than `most`."""
    if size > most:
        raise kind(f"{where} has {size:,} bytes; at most {most:,} are read")


def read_text(path: Path, kind: type[FileError] = FileError, *, most: int = _MOST_BYTES) -> str:
    """Return the text of a file in UTF-8, as `text_of` does. Raises `kind`."""
    return text_of(path, read_bytes(path, kind, most=most), kind)


def text_of(path: Path, content: bytes, kind: type[FileError] = FileError) -> str:
    """Return the content of a file as text with \\n as line end and without a byte order mark. Raises `kind`."""
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise kind(f"{path}: is not UTF-8 text, at byte {error.start}") from error


def root_of_xml(content: bytes) -> Any:
    """Return the root element of XML that may come from a stranger. Raises ValueError with only the reason.

    An entity could stand for another file or for gigabytes of text, so none is replaced, and nothing is fetched.
    """
    from lxml import etree  # most commands read no XML

    try:
        return etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        raise ValueError(f"not XML: {brief(error.msg.partition(', try XML_PARSE_HUGE')[0], 240)}") from error
