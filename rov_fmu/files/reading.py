"""Files read whole; where one cannot be, a line that names it and says why."""

from pathlib import Path

from rov_fmu.files.messages import FileError


def read_bytes(path: Path, kind: type[FileError] = FileError) -> bytes:
    """The content of a file. Raises `kind`."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise kind(f"{path}: cannot be read: {error.strerror or error}") from error


def read_text(path: Path, kind: type[FileError] = FileError) -> str:
    """The text of a file in UTF-8, lines ended by \\n, without a byte order mark. Raises `kind`."""
    try:
        text = read_bytes(path, kind).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise kind(f"{path}: not UTF-8 text, at byte {error.start}") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")
