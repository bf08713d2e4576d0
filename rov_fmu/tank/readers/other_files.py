"""Files that are neither logs nor tables: what they are by their first bytes, and what to do with them."""

from pathlib import Path

PICTURE = "pictures, films and documents are neither logs nor tables"
_WORKBOOK = "a workbook must first be saved as CSV, sheet by sheet"
_PACKED = "a packed file must first be unpacked into the same folder"
_BEGINNINGS = {
    _PACKED: (
        b"PK\3\4",
        b"\x1f\x8b\x08",
        b"\x28\xb5\x2f\xfd",
        b"BZh91AY&SY",
        b"\xfd7zXZ\0",
        b"7z\xbc\xaf\x27\x1c",
        b"Rar!\x1a",
    ),
    _WORKBOOK: (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",),
    PICTURE: (
        *(b"\x89PNG\r\n", b"\xff\xd8\xff", b"GIF8", b"II*\0", b"MM\0*", b"RIFF", b"OggS\0", b"%PDF-", b"\x1aE\xdf\xa3"),
    ),
    "a binary table must first be saved as CSV": (b"\x89HDF\r\n", b"PAR1", b"\x93NUMPY"),
}
_IN_ZIP = {
    **dict.fromkeys((".xlsx", ".xlsm", ".xlsb", ".ods"), _WORKBOOK),
    **dict.fromkeys((".docx", ".odt", ".pptx", ".odp"), PICTURE),
}
"""What packed files (ZIP) with these suffixes are."""
_FILM = b"ftyp"
"""The bytes behind the first four of a film or picture of a telephone (ISO 14496-12)."""


def reason_against(path: Path, head: bytes) -> str:
    """Return what a file is that begins with these bytes, and what to do with it; an empty text if that is unknown."""
    if head.startswith(b"PK") and (reason := _IN_ZIP.get(path.suffix.lower())):
        return reason
    if head[4:8] == _FILM:
        return PICTURE
    return next((reason for reason, beginnings in _BEGINNINGS.items() if head.startswith(beginnings)), "")
