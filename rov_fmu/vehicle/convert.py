"""A vehicle file of the first version in the form of today, with its comments."""

from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Comment, Item

from rov_fmu.files.kinds import VEHICLE_FILE, check_written
from rov_fmu.files.output import Output, check_targets
from rov_fmu.vehicle.schema import FORMAT
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import hardware, moved, read_document


def converted(source: Path, path: Path) -> Output:
    """The file to write, checked. Raises VehicleFileError, and WriteError where it would overwrite what it reads."""
    vehicle, document = load_vehicle(source), read_document(source)
    check_targets([path], [source, *vehicle.files])
    check_written(path, VEHICLE_FILE)
    if "format" in document:
        raise VehicleFileError(f"{source}: format = {FORMAT}: needs no conversion; the first version has no format")
    new = tomlkit.document()
    new.parsing(True)  # adds no blank lines of its own
    for key, item in document.body:
        if key is None:
            new.add(item)
            continue
        if "format" not in new:
            new.add("format", tomlkit.item(FORMAT)).add(tomlkit.nl())
        if key.key != "coefficients":
            new.add(key, item)
        elif key.is_dotted():
            raise VehicleFileError(f"{source}: coefficients: must be one table [coefficients] to be converted")
        else:
            _add_hardware(new, vehicle, item)
    return moved(new, source, path)


def _add_hardware(new: tomlkit.TOMLDocument, vehicle: Vehicle, coefficients: Any) -> None:
    """The coefficients as they stand, each with the comments before it, in the tables where they belong."""
    entries: dict[str, Item] = {}
    comments = ""
    for key, item in coefficients.value.body:
        if key is None:
            comments += item.as_string() if isinstance(item, Comment) else ""
        else:
            item.trivia.indent, comments = comments, ""
            entries[key.key] = item
    for name, table in hardware(vehicle, entries).items():
        new.add(name, tomlkit.item(table)).add(tomlkit.nl())
    for comment in comments.splitlines():  # those that tell of the table that follows
        new.add(tomlkit.comment(comment.strip("# ")))
