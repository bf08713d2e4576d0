"""The archive of an FMU, or of a system of FMUs. The same files give the same bytes."""

import hashlib
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

from rov_fmu.io.reading import read_bytes

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
"""The folder of the layered standard FMI-LS-REF, with the experiments and their results."""
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
CARD = "documentation/model_card.txt"
"""The path of the model card."""
_MARK = b"rov-fmu wrote this file. SHA-256 of what precedes its end: "
_END = 22
"""The bytes of the end of an archive without a comment (APPNOTE 4.3.16)."""


def archive(files: Mapping[str, bytes]) -> bytes:
    """Return the archive of these files, by their path. Its comment has a digest, by which `is_unchanged` knows it."""
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as zipped:
        # The description comes first, so that an importer that reads a stream finds it at once.
        for name in sorted(files, key=lambda f: (f != "modelDescription.xml", f)):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.create_system, entry.external_attr = 3, 0o644 << 16  # the same when built on Windows
            zipped.writestr(entry, files[name], zipfile.ZIP_DEFLATED, compresslevel=9)
    comment = _comment(packed.getvalue())
    return packed.getvalue()[:-2] + len(comment).to_bytes(2, "little") + comment


def is_unchanged(path: Path) -> bool:
    """Return True for an archive of this program that nobody has changed since."""
    content = read_bytes(path)
    packed, mark, _ = content.rpartition(_MARK)
    return bool(mark) and content == packed + _comment(packed)


def _comment(packed: bytes) -> bytes:
    return _MARK + hashlib.sha256(packed[:-_END]).hexdigest().encode()
