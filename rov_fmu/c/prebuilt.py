"""What a wheel has compiled for the vehicles that ship, so that they need no compiler.

The folder PREBUILT contains the engine for each platform, the module of the page, and the FMUs. Only a wheel has it
(build_backend.py). Each file counts only for the sources that it was compiled from.
"""

import hashlib
import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from rov_fmu.c.compile import PLATFORMS
from rov_fmu.io.paths import PREBUILT

MODULE = "module"
"""The kind of the WebAssembly module of a page. The kind of an engine is its platform."""


def prebuilt_path(folder: Path, kind: str, sources: Mapping[str, str]) -> Path:
    """Return the path in a folder of what is compiled from sources (file name to text)."""
    digest = hashlib.sha256(json.dumps(sources, sort_keys=True).encode()).hexdigest()
    return folder / f"{kind}-{digest[:32]}"


def prebuilt(kind: str | None, sources: Mapping[str, str]) -> bytes | None:
    """Return what was compiled from these sources, or None if it has to be compiled. A machine may have no kind."""
    path = prebuilt_path(PREBUILT, kind or "", sources)
    return path.read_bytes() if path.is_file() else None


def prebuilt_binaries(identifier: str, guid: str, platforms: Sequence[str]) -> dict[str, bytes]:
    """Return the binaries of the prebuilt FMU (2.0) by platform; none if it has another GUID.

    The GUID is a digest of the sources and of the description, so the compiler would make the same binaries.
    """
    path = PREBUILT / f"{identifier}.fmu"
    if not path.is_file():
        return {}
    with zipfile.ZipFile(path) as fmu:
        if f'guid="{guid}"'.encode() not in fmu.read("modelDescription.xml"):
            return {}
        names = {name: f"binaries/{name}/{identifier}{PLATFORMS[name].suffix}" for name in platforms}
        return {name: fmu.read(path) for name, path in names.items() if path in fmu.namelist()}
