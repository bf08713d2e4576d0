"""Everything that goes into the FMU, and the archive: the same bytes for the same inputs."""

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from types import MappingProxyType

from rov_fmu import __version__
from rov_fmu.export.compile import C_SOURCES, UNITY_FILE, fmi_headers
from rov_fmu.export.interface import Variable, interface_header, model_header, variables
from rov_fmu.export.model_description import NATIVE, PYTHON, model_description
from rov_fmu.export.python_flavour import python_files, python_sources
from rov_fmu.files.places import LICENSE
from rov_fmu.files.reading import read_bytes
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError

TOOL = f"rov-fmu {__version__}"
_EPOCH = (1980, 1, 1, 0, 0, 0)
REPORT = "identification.html"
"""The report in documentation/, where the vehicle file names one."""


@dataclass(frozen=True)
class Content:
    """What an FMU is made of but its compiled binaries."""

    identifier: str
    guid: str
    files: Mapping[str, bytes]
    """Path in the archive to content."""
    sources: Mapping[str, str]
    """The C files to compile; none in pure Python."""


def native_content(vehicle: Vehicle, pages: Mapping[str, bytes] = MappingProxyType({})) -> Content:
    """The FMU in C, for Co-Simulation and Model Exchange; `pages` go into it by their path."""
    declared = variables(vehicle.coefficients)
    sources = {path.name: path.read_text(encoding="utf-8") for path in sorted(C_SOURCES.iterdir())}
    sources["model.h"] = model_header()
    describe = partial(_describe, vehicle, declared, interfaces=NATIVE, source_files=(UNITY_FILE,))
    guid = _guid(describe(guid=""), sources)
    sources["interface.h"] = interface_header(declared, vehicle.identifier, guid)
    files = {
        **_common_files(vehicle),
        **pages,
        "modelDescription.xml": describe(guid=guid),
        "documentation/licenses/fmi-headers.txt": _fmi_license(),
        **{f"sources/{name}": text.encode() for name, text in sources.items()},
    }
    return Content(vehicle.identifier, guid, files, sources)


def python_content(vehicle: Vehicle, pages: Mapping[str, bytes] = MappingProxyType({})) -> Content:
    """The FMU in pure Python, for Co-Simulation."""
    declared = variables(vehicle.coefficients)
    sources = python_sources(vehicle, declared)
    describe = partial(_describe, vehicle, declared, interfaces=PYTHON)
    guid = _guid(describe(guid=""), sources)
    files = {
        **_common_files(vehicle),
        **pages,
        "modelDescription.xml": describe(guid=guid),
        **python_files(vehicle, sources),
    }
    return Content(vehicle.identifier, guid, files, {})


def _describe(
    vehicle: Vehicle,
    declared: tuple[Variable, ...],
    *,
    guid: str,
    interfaces: Mapping[str, Mapping[str, str]],
    source_files: tuple[str, ...] = (),
) -> bytes:
    head = {
        "guid": guid,
        "description": vehicle.description,
        "author": vehicle.source,
        "version": vehicle.version,
        "license": "MIT, see documentation/licenses/license.txt",
        "generationTool": TOOL,
    }
    return model_description(
        declared, identifier=vehicle.identifier, head=head, interfaces=interfaces, source_files=source_files
    )


def _guid(description: bytes, sources: Mapping[str, str]) -> str:
    """A GUID that stands for the interface and the code behind it, so a binary refuses another one's description."""
    digest = hashlib.sha256(description)
    for name, text in sorted(sources.items()):
        digest.update(name.encode() + b"\0" + text.encode() + b"\0")
    d = digest.hexdigest()
    return f"{{{d[:8]}-{d[8:12]}-{d[12:16]}-{d[16:20]}-{d[20:32]}}}"


def _common_files(vehicle: Vehicle) -> dict[str, bytes]:
    report = vehicle.provenance.report if vehicle.provenance else None
    files = {"model.png": vehicle.picture("model.png"), "documentation/licenses/license.txt": LICENSE}
    if report:
        files[f"documentation/{REPORT}"] = report
    return {name: read_bytes(path, VehicleFileError) for name, path in files.items()}


def _fmi_license() -> bytes:
    """The licence in the comment of the FMI headers that the binaries are compiled with."""
    text = (fmi_headers() / "fmi2Functions.h").read_text(encoding="utf-8")
    start = text.index("Copyright (C)")
    lines = text[start : text.index("*/", start)].splitlines()
    return ("\n".join(line.strip() for line in lines).strip() + "\n").encode()


def archive(files: Mapping[str, bytes]) -> bytes:
    """The FMU: path in the archive to content, zipped, the same bytes for the same files."""
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as zipped:
        # the description comes first, so that importers which stream find it at once
        for member in sorted(files, key=lambda f: (f != "modelDescription.xml", f)):
            zipped.writestr(_entry(member), files[member], compresslevel=9)
    return packed.getvalue()


def _entry(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.create_system = 3  # the same on Windows
    info.external_attr = 0o644 << 16
    return info
