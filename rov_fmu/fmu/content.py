"""Collect everything that goes into an FMU. The same inputs give the same bytes."""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from uuid import UUID

from rov_fmu.autopilot.law import LAW_FILE, law_sources
from rov_fmu.c.compile import (
    C_SOURCES,
    INTERFACES,
    MODULE_SOURCES,
    PLATFORMS,
    UNITY_FILE,
    compile_module,
    fmi_headers,
)
from rov_fmu.c.prebuilt import MODULE, prebuilt
from rov_fmu.c.source import c_sources as motion_sources
from rov_fmu.equation.layout import Layout
from rov_fmu.fmu.model_description import build_description, model_description, model_of
from rov_fmu.fmu.picture import read_png
from rov_fmu.fmu.python_flavour import python_files, python_sources
from rov_fmu.fmu.terminals import FOLDER, ICON
from rov_fmu.fmu.variables import FmuModel, interface_header
from rov_fmu.io.paths import LICENSE
from rov_fmu.io.reading import read_bytes
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError

REPORT = "identification.html"
"""The name of the report in documentation/, if the vehicle file names one."""
_EXTERNAL_DEPENDENCIES = {
    ".so": "Linux    GLIBC 2.17 or newer (libc.so.6, libm.so.6)",
    ".dll": "Windows  the Universal C Runtime (ucrtbase.dll), which is part of Windows since 10",
    ".dylib": "macOS    11 or newer",
}
"""What the binaries need of the system, by their suffix."""


@dataclass(frozen=True)
class FmuContent:
    """Everything in an FMU except its compiled binaries."""

    identifier: str
    guid: str
    files: Mapping[str, bytes]
    """The content of each file by its path in the archive."""
    sources: Mapping[str, str]
    """The C files to compile by name; none in pure Python."""


def native_content(
    subject: Vehicle | FmuModel,
    pages: Mapping[str, bytes] = MappingProxyType({}),
    fmi: int = 2,
    interface: str = "both",
    platforms: Collection[str] = PLATFORMS.keys(),
) -> FmuContent:
    """Return the FMU in C of a vehicle or another model for one of INTERFACES.

    `pages` are further files, by their paths. `platforms` are those of PLATFORMS for which it will have binaries.
    """
    own_files = dict(pages)
    if isinstance(subject, FmuModel):
        model = subject
    else:
        model, own_files = motion_model(subject), _own_files(subject, pages)
    other_version = {2: "fmi3_", 3: "fmi2_"}[fmi]
    names = [path.name for path in sorted(C_SOURCES.iterdir())]
    own = [name for name in names if name.startswith(("fmi", "fmu", "instance", "saved"))]
    sources = {name: C_SOURCES.joinpath(name).read_text(encoding="utf-8") for name in own if other_version not in name}
    sources |= model.c_files
    source_files = (UNITY_FILE,) if fmi == 2 else ()
    interfaces = INTERFACES[interface]
    describe = partial(model_description, model, interfaces=interfaces, source_files=source_files, fmi=fmi)
    guid = _guid(describe(guid=""), sources)
    sources["interface.h"] = interface_header(model, guid, fmi, interfaces)
    files = {"documentation/licenses/fmi-headers.txt": _fmi_license(fmi)}
    files |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    if fmi == 3:
        files["sources/buildDescription.xml"] = build_description(model.identifier)
        files["documentation/externalDependencies.txt"] = _external_dependencies(platforms).encode()
    documents = _common_files(model, describe(guid=guid)) | own_files
    return FmuContent(model.identifier, guid, documents | files, sources)


def motion_model(vehicle: Vehicle) -> FmuModel:
    """Return the model of a vehicle with its C files."""
    return replace(model_of(vehicle), c_files=motion_sources(vehicle.layout))


def python_content(vehicle: Vehicle, pages: Mapping[str, bytes] = MappingProxyType({})) -> FmuContent:
    """Return the FMU in pure Python, for Co-Simulation. `pages` are further files by their path."""
    model = model_of(vehicle)
    sources = python_sources(vehicle, model.variables)
    describe = partial(model_description, model, interfaces=INTERFACES["cs"], native=False)
    guid = _guid(describe(guid=""), sources)
    files = python_files(vehicle.identifier, sources)
    documents = _common_files(model, describe(guid=guid)) | _own_files(vehicle, pages)
    return FmuContent(vehicle.identifier, guid, documents | files, {})


def _external_dependencies(platforms: Collection[str]) -> str:
    suffixes = {PLATFORMS[name].suffix for name in platforms}
    needed = [words for suffix, words in _EXTERNAL_DEPENDENCIES.items() if suffix in suffixes]
    return "\n".join(["What the binaries need of the system, and nothing else:", "", *needed]) + "\n"


def _guid(description: bytes, sources: Mapping[str, str]) -> str:
    """Return a GUID that is computed from the interface and the code.

    A binary can then refuse the description of another FMU.
    """
    digest = hashlib.sha256(description)
    for name, text in sorted(sources.items()):
        digest.update(name.encode() + b"\0" + text.encode() + b"\0")
    return f"{{{UUID(digest.hexdigest()[:32])}}}"


def _common_files(model: FmuModel, description: bytes) -> dict[str, bytes]:
    """Return the files that FMUs in C and in Python both have, by their path."""
    terminals = {f"{FOLDER}/terminalsAndIcons.xml": model.terminals}
    license_text = {"documentation/licenses/license.txt": read_bytes(LICENSE, VehicleFileError)}
    return {"modelDescription.xml": description, **terminals, **license_text}


def _own_files(vehicle: Vehicle, pages: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the report and the picture of a vehicle, and its pages, by their path."""
    read = dict[str, bytes]()
    if report := vehicle.provenance.report if vehicle.provenance else None:
        read[f"documentation/{REPORT}"] = read_bytes(report, VehicleFileError)
    if picture := vehicle.picture("model.png"):
        read["model.png"] = read_png(picture)
    elif ICON in pages:
        read["model.png"] = pages[ICON]
    return {**read, **pages}


def _fmi_license(fmi: int) -> bytes:
    """Return the licence of the FMI headers, which is a comment in them."""
    text = (fmi_headers() / f"fmi{fmi}Functions.h").read_text(encoding="utf-8")
    start = text.index("Copyright (C)")
    lines = text[start : text.index("*/", start)].splitlines()
    return ("\n".join(line.strip() for line in lines).strip() + "\n").encode()


def module_sources(layout: Layout) -> dict[str, str]:
    """Return the C files of the module of a page by their names: those of the FMU's motion, the autopilot's law, and
    what the page calls."""
    page = {path.name: path.read_text(encoding="utf-8") for path in sorted(MODULE_SOURCES.glob("*.[ch]"))}
    return page | law_sources(LAW_FILE) | motion_sources(layout)


def web_module(layout: Layout) -> bytes:
    """Return the C of the FMU's motion, unchanged, as a WebAssembly module for the page that flies the vehicle.

    The page passes the coefficients to it. Raises BuildError.
    """
    sources = module_sources(layout)
    return prebuilt(MODULE, sources) or compile_module(sources)
