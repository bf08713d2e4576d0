"""What an FMU carries of its origin: the vehicle file with its tables.

The layered standard FMI-LS-REF lists these files with their roles in its manifest.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rov_fmu.fmu.archive import CARD, FOLDER
from rov_fmu.io.paths import name_of
from rov_fmu.io.reading import read_bytes
from rov_fmu.io.templates import render
from rov_fmu.vehicle.description import TABLES
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError
from rov_fmu.vehicle.writer import vehicle_text

_ORIGIN = "vehicle"
"""The folder of the vehicle file and its tables, beside the manifest."""


@dataclass(frozen=True)
class Related:
    """A file of the FMU, as the manifest lists it."""

    source: str
    """The path, relative to the folder of the manifest."""
    role: str
    """A role of FMI-LS-REF, with its purpose after a slash if it has one."""
    type: str
    """The MIME type."""
    description: str


def manifest(related: Iterable[Related]) -> bytes:
    """Return fmi-ls-manifest.xml, which names these files and the model card."""
    card = Related(f"../../{CARD}", "report", "text/plain", "Model card")
    return render("fmi-ls-manifest.xml.j2", related=[*related, card]).encode()


def documents(vehicle: Vehicle) -> Iterator[Related]:
    """Yield the pages of the FMU of a vehicle."""
    if vehicle.provenance and vehicle.provenance.report:
        yield Related("../../documentation/identification.html", "report", "text/html", "Report of the identification")
    yield Related("../../documentation/index.html", "document", "text/html", "Documentation")


def origin(vehicle: Vehicle) -> tuple[dict[str, bytes], list[Related]]:
    """Return the vehicle file and its tables by their paths in the FMU, with their roles.

    The vehicle file is that of the user, byte for byte. If the vehicle has changed since it was read, it is written
    anew. A vehicle that was made in Python has none, unless `identify` made it. Pictures and the report of an
    identification are elsewhere in the FMU already.
    """
    if not (vehicle.file or vehicle.provenance):
        return {}, []
    folder = vehicle.file.path.parent if vehicle.file else Path()
    name = f"{_ORIGIN}/{vehicle.identifier}.toml"
    files = {f"{FOLDER}/{name}": _vehicle_file(vehicle, folder)}
    roles = [Related(name, "model", "application/toml", "The vehicle file")]
    for path, role, description in _tables(vehicle):
        name = f"{_ORIGIN}/{name_of(path, folder)}"
        files[f"{FOLDER}/{name}"] = read_bytes(path, VehicleFileError)
        roles.append(Related(name, role, "text/csv", description))
    return files, roles


def _vehicle_file(vehicle: Vehicle, folder: Path) -> bytes:
    """Return the content of the vehicle file, whose folder is given. Raises VehicleFileError."""
    if content := vehicle.file_content:
        return content
    try:
        return vehicle_text(vehicle, folder).encode()
    except ValueError as error:
        raise VehicleFileError(f"{folder}: {error}") from error


def _tables(vehicle: Vehicle) -> Iterator[tuple[Path, str, str]]:
    """Yield the tables that the vehicle file names, with their roles and in words."""
    for curve in vehicle.layout.curves:
        for table in (*curve.tables, curve.electric_current):
            if table and table.path:
                quantity = {"thrust": "thrust", "current": "electric current"}[table.kind]
                yield table.path, "model", f"Measured {quantity}, curve {curve.name}"
    if not vehicle.data:
        return
    for axis, names in TABLES.items():
        for name, words in zip(names, ("response", "steady velocities"), strict=True):
            if (path := vehicle.data / name).is_file():
                yield path, "result", f"Published table: {words} in {axis}, printed and measured"
