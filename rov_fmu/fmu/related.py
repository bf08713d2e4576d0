"""What an FMU carries of its origin: the vehicle file with its tables, and the covariance of its coefficients.

The layered standard FMI-LS-REF lists these files with their roles in its manifest.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from rov_fmu.fmu.archive import CARD, FOLDER
from rov_fmu.io.paths import name_of
from rov_fmu.io.reading import read_bytes
from rov_fmu.io.templates import render
from rov_fmu.vehicle.description import TABLES
from rov_fmu.vehicle.uncertainty import NORMAL
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError
from rov_fmu.vehicle.writer import vehicle_text

_ORIGIN = "vehicle"
"""The folder of the vehicle file and its tables, beside the manifest."""
COVARIANCE = "covariance.csv"
"""The name of the file with the covariance, beside the manifest."""
_DIGITS = ".6g"
"""How numbers are written that follow from standard errors, which are known to fewer digits."""


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
    """Return the vehicle file, its tables and the covariance, by their paths in the FMU, with their roles.

    The vehicle file is that of the user, byte for byte. If the vehicle has changed since it was read, it is written
    anew. A vehicle that was made in Python has none, unless `identify` made it. Pictures and the report of an
    identification are elsewhere in the FMU already.
    """
    files, roles = dict[str, bytes](), list[Related]()

    def add(name: str, content: bytes, role: str, kind: str, description: str) -> None:
        files[f"{FOLDER}/{name}"] = content
        roles.append(Related(name, role, kind, description))

    if vehicle.file or vehicle.provenance:
        folder = vehicle.file.path.parent if vehicle.file else Path()
        content = _vehicle_file(vehicle, folder)
        add(f"{_ORIGIN}/{vehicle.identifier}.toml", content, "model", "application/toml", "The vehicle file")
        for path, role, description in _tables(vehicle):
            name = f"{_ORIGIN}/{name_of(path, folder)}"
            add(name, read_bytes(path, VehicleFileError), role, "text/csv", description)
    if vehicle.uncertainty.names:
        words = "Standard errors and covariance of the identified coefficients"
        add(COVARIANCE, covariance(vehicle).encode(), "result", "text/csv", words)
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


# ---- The uncertainty -------------------------------------------------------------------------------------------------


def covariance(vehicle: Vehicle) -> str:
    """Return the covariance of the coefficients with an interval as CSV.

    The columns are the name, the unit, the value, the standard error, and the covariance with each coefficient, whose
    unit is the product of both units. Those of a factor α or β are its value times those of its logarithm.
    """
    known = vehicle.uncertainty
    rows = [["name", "unit", "value", "standard_error", *known.names]]
    for n, name in enumerate(known.names):
        error, unit = float(known.errors[n]), vehicle.layout.coefficients[name].unit
        entries = [float(r) * error * float(other) for r, other in zip(known.correlation[n], known.errors, strict=True)]
        rows.append([name, unit, repr(vehicle[name]), *(format(x, _DIGITS) for x in (error, *entries))])
    return "".join(",".join(row) + "\n" for row in rows)


def ends_of_intervals(vehicle: Vehicle) -> Iterator[tuple[str, str, Mapping[str, float]]]:
    """Yield, for each end of the 95 % interval of each coefficient, a name, words, and the coefficients.

    The others are those that are most probable beside it: they follow by their correlations. Physical bounds hold.
    """
    known = vehicle.uncertainty
    for n, name in enumerate(known.names):
        for end, score in (("low", -NORMAL), ("high", NORMAL)):
            moved = zip(known.names, known.at(score * known.correlation[n]), known.correlation[n], strict=True)
            values = {other: float(format(x, _DIGITS)) for other, x, r in moved if r}
            yield f"{name}_{end}", f"{name} at the {end} end of its 95 % interval", values
