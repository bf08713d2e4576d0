"""The archive of an FMU, in the one form that the builder writes.

The same files give the same bytes, and each of its bits follows from the files and their compressed bytes. So `prove`
finds a bit that was changed, wherever it is.
"""

import struct
import zipfile
from collections.abc import Callable, Iterable, Mapping
from io import BytesIO

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
"""The folder of the layered standard FMI-LS-REF, with the experiments and their results."""
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
META_DATA = "extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd"
"""The path that SSP-LS-Traceability prescribes for the meta-data, which are the last file of the archive."""
CARD = "documentation/model_card.txt"
"""The path of the model card."""
_EPOCH = (1980, 1, 1, 0, 0, 0)
_UNIX, _VERSION, _UTF_8, _MODE = 3, 20, 0x800, 0o644 << 16
"""What the headers say: the system, the version of the format, the encoding of a name, and the mode of each file."""


def archive(files: Mapping[str, bytes], meta_data: Callable[[bytes], bytes] | None = None) -> bytes:
    """Return the FMU that contains these files, given by their path.

    `meta_data` returns the meta-data from the bytes of the archive that precede them.
    """
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as zipped:
        # The description comes first, so that an importer that reads a stream finds it at once.
        for name in sorted(files, key=lambda f: (f != "modelDescription.xml", f)):
            zipped.writestr(_entry(name), files[name], zipfile.ZIP_DEFLATED, compresslevel=9)
        if meta_data:  # Deflated, they would have bits that mean nothing.
            zipped.writestr(_entry(META_DATA), meta_data(packed.getvalue()), zipfile.ZIP_STORED)
    return packed.getvalue()


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.create_system, entry.external_attr = _UNIX, _MODE  # the same when built on Windows
    return entry


def _header(entry: zipfile.ZipInfo) -> bytes:
    """Return what both headers of a file have in common, from the version needed to the lengths."""
    name, (year, month, day, *_) = entry.orig_filename, _EPOCH
    date = (year - 1980) << 9 | month << 5 | day
    flags, sizes = 0 if name.isascii() else _UTF_8, (entry.CRC, entry.compress_size, entry.file_size)
    return struct.pack("<5H3L2H", _VERSION, flags, entry.compress_type, 0, date, *sizes, len(name.encode()), 0)


def local_header(entry: zipfile.ZipInfo) -> bytes:
    """Return the bytes before the content of a file (APPNOTE 4.3.7)."""
    return b"PK\3\4" + _header(entry) + entry.orig_filename.encode()


def directory(entries: Iterable[zipfile.ZipInfo]) -> bytes:
    """Return the bytes after the last file: the entry of each file, and the end of the directory (4.3.12, 4.3.16)."""
    records, place = [], 0
    for entry in entries:
        end = struct.pack("<3H2L", 0, 0, 0, _MODE, place)
        first = struct.pack("<4s2B", b"PK\1\2", _VERSION, _UNIX)
        records.append(first + _header(entry) + end + entry.orig_filename.encode())
        place += len(local_header(entry)) + entry.compress_size
    count, size = len(records), sum(map(len, records))
    return b"".join(records) + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, count, count, size, place, 0)
