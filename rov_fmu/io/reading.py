"""Reading and hashing whole files; if one cannot be read, the error names it and says why."""

import hashlib
from pathlib import Path
from typing import IO, Any

from rov_fmu.io.messages import NO_FILE, FileError

_PIECE = 2**20
"""The number of bytes that are hashed at a time: a file may be larger than the memory."""


def hash_of(file: IO[bytes], kind: str) -> bytes:
    """Return the hash of the content of an open file, of a kind that hashlib has."""
    digest = hashlib.new(kind)
    while piece := file.read(_PIECE):
        digest.update(piece)
    return digest.digest()


def read_bytes(path: Path, kind: type[FileError] = FileError, *, most: int | None = None) -> bytes:
    """Return the content of a file. Raises `kind` if it cannot be read, or has more bytes than `most`."""
    try:
        if most is not None and (size := path.stat().st_size) > most:
            raise kind(f"{path}: is too large, with {size / 1e6:.0f} MB: at most {most / 1e6:.0f} MB are read")
        return path.read_bytes()
    except FileNotFoundError as error:
        raise kind(f"{path}: {NO_FILE}") from error
    except OSError as error:
        raise kind(f"{path}: cannot be read: {error.strerror or error}") from error


def read_text(path: Path, kind: type[FileError] = FileError, *, most: int | None = None) -> str:
    """Return the text of a file in UTF-8 with \\n as line end and without a byte order mark. Raises `kind`."""
    content = read_bytes(path, kind, most=most)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise kind(f"{path}: not UTF-8 text, at byte {error.start}") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def root_of_xml(content: bytes) -> Any:
    """Return the root element of XML that may come from a stranger. Raises `lxml.etree.XMLSyntaxError`.

    An entity could stand for another file or for gigabytes of text, so none is replaced, and nothing is fetched.
    """
    from lxml import etree  # most commands read no XML

    return etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True))
