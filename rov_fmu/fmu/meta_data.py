"""The meta-data of an FMU: a file SRMD of SSP-LS-Traceability 1.0 with the hashes of all that it was made from.

The hashes are SHA3-256, as the standard demands. They cover every file of the FMU, the program that made it, and, if
the vehicle was identified, its logs. The hash of this file itself is that of the file with zeros in place of this hash.
"""

import re
from collections.abc import Iterator, Mapping
from functools import cache
from hashlib import sha3_256
from pathlib import Path
from typing import TYPE_CHECKING

from rov_fmu import __version__
from rov_fmu.fmu.archive import META_DATA
from rov_fmu.io.paths import FMU_SRC
from rov_fmu.io.templates import render

if TYPE_CHECKING:
    from rov_fmu.vehicle.vehicle import Vehicle

FILES, INPUTS, GENERATOR, ARCHIVE = "rov-fmu.files", "rov-fmu.inputs", "rov-fmu.generator", "rov-fmu.archive"
"""The classifications: the files of the FMU, the files that identification read, the program, and the bytes of the
archive before the meta-data. Each entry has a name and a hash."""
BEFORE = "bytes before this file"
"""The name of the entry in ARCHIVE. Its hash shows a change of bits that change no file, such as a date."""
_ZEROS = "0" * 64
_OWN_HASH = re.compile(rb'(keyword="' + re.escape(META_DATA).encode() + rb'">)[^<]*')
_PACKAGE = Path(__file__).parents[1]
_SOURCES = (".py", ".c", ".h", ".js", ".j2")
"""The kinds of files that the program consists of."""


def meta_data(vehicle: "Vehicle", files: Mapping[str, bytes], before: bytes, summary: str = "") -> bytes:
    """Return the document for an FMU that has these other files.

    `summary` says in words what it is of, if this is not the vehicle itself. `before` are the bytes of the archive that
    precede the document. The same files give the same bytes.
    """
    made, generator = vehicle.provenance, f"rov-fmu {__version__}"
    hashes = [(name, sha3_256(content).hexdigest()) for name, content in sorted(files.items())]
    classifications = {
        FILES: [*hashes, (META_DATA, _ZEROS)],
        INPUTS: [(name, f"{made.hash}: {digest}") for name, digest in made.inputs.items()] if made else [],
        GENERATOR: [(generator, generator_hash())],
        ARCHIVE: [(BEFORE, sha3_256(before).hexdigest())],
    }
    given = {
        "vehicle": vehicle,
        "summary": summary or vehicle.summary,
        "generator": generator,
        "classifications": classifications,
    }
    document = render("resourceMetaData.srmd.j2", **given).encode()
    return _with_own_hash(document, own_hash(document))


def own_hash(document: bytes) -> str:
    """Return the SHA3-256 of the meta-data, in which zeros stand for this hash."""
    return sha3_256(_with_own_hash(document, _ZEROS)).hexdigest()


def _with_own_hash(document: bytes, digest: str) -> bytes:
    return _OWN_HASH.sub(rb"\g<1>" + digest.encode(), document)


@cache
def generator_hash() -> str:
    """Return the SHA3-256 of the program: of the names and the contents of its files, in the order of their names."""
    digest = sha3_256()
    for name, content in sorted(_program()):
        digest.update(name.encode() + b"\0" + content + b"\0")
    return digest.hexdigest()


def _program() -> Iterator[tuple[str, bytes]]:
    """Yield the files of the program. Their names are the same in a checkout and in an installed package."""
    for folder, top in ((_PACKAGE, "rov_fmu"), (FMU_SRC, "fmu_src")):
        for path in folder.rglob("*"):
            name = path.relative_to(folder).as_posix()
            if path.suffix in _SOURCES and not name.startswith("data/"):
                yield f"{top}/{name}", path.read_bytes()
