"""`Vehicle` to vehicle file (TOML), whole or not at all."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Array, InlineTable

from rov_fmu.files.messages import shown
from rov_fmu.files.output import Output, write_whole
from rov_fmu.motion.rov import COEFFICIENTS
from rov_fmu.vehicle.vehicle import Provenance, Vehicle, VehicleFileError, load_vehicle

_DIGITS = 6  # significant ones: more than any tank test has, few enough to be the same on every machine


def vehicle_text(vehicle: Vehicle, folder: Path = Path()) -> str:
    """The vehicle file, in a folder, of a vehicle without tables, pictures and alternatives."""
    document = tomlkit.document()
    if vehicle.provenance:
        document.add(
            tomlkit.comment("Made from tank tests: [provenance] tells how, and `interval` is 95 % confidence.")
        )
        document.add(tomlkit.nl())
    head = tomlkit.table()
    for key in ("name", "identifier", "version", "description", "source"):
        head.add(key, getattr(vehicle, key))
    document.add("vehicle", head)
    validity = tomlkit.table()
    for key, value in zip(("command_min", "command_max"), vehicle.command_range, strict=True):
        validity.add(key, _rounded(value))
    if vehicle.limits:
        validity.add("limits", _lines(vehicle.limits))
    document.add("validity", validity)
    coefficients = tomlkit.table()
    for name in COEFFICIENTS:
        coefficients.add(name, _quantity(vehicle, name))
    document.add("coefficients", coefficients)
    if vehicle.provenance:
        document.add("provenance", _provenance(vehicle.provenance, folder))
    return tomlkit.dumps(document)


def vehicle_output(vehicle: Vehicle, path: Path) -> Output:
    """The vehicle file to write, perhaps together with its report. Raises VehicleFileError."""
    report = vehicle.provenance.report if vehicle.provenance else None
    return _checked(path, vehicle_text(vehicle, path.parent), coming=report)


def write_vehicle(vehicle: Vehicle, path: Path) -> None:
    """Write the vehicle file. Raises VehicleFileError where it could not be read again, OSError where not written."""
    write_whole(vehicle_output(vehicle, path))


def write_tuned(source: Path, path: Path, values: Mapping[str, float], reason: str) -> None:
    """Write the vehicle file `source` with other values of some coefficients, all else in it as it is.

    `reason` is the source of those that change. Raises as write_vehicle.
    """
    document: Any = tomlkit.parse(source.read_text(encoding="utf-8-sig"))
    if "coefficients" not in document:
        raise VehicleFileError(f"{source}: cannot be read a second time, as it must be to write it tuned")
    for name, exact in values.items():
        entry = document["coefficients"][name]
        if (value := _rounded(exact)) == entry["value"]:
            continue
        entry["value"], entry["source"] = value, reason
        entry.pop("interval", None)
    for table, key in (("vehicle", "data"), ("vehicle", "pictures"), ("provenance", "report")):
        if key in document.get(table, {}):
            document[table][key] = _seen_from(path.parent, source.parent / document[table][key])
    write_whole(_checked(path, tomlkit.dumps(document)))


def _checked(path: Path, text: str, coming: Path | None = None) -> Output:
    """The text of a vehicle file, to write once it has proved to be one."""

    def check(draft: Path) -> None:
        try:
            load_vehicle(draft, coming=coming)
        except VehicleFileError as error:
            raise VehicleFileError(str(error).replace(str(draft), str(path))) from error

    try:
        return Output(path, text.encode(), check)
    except UnicodeEncodeError as error:
        part = shown(text[max(error.start - 20, 0) : error.end])
        raise VehicleFileError(f"{path}: {part}: the name of a file that is not Unicode cannot stand here") from error


def _quantity(vehicle: Vehicle, name: str) -> InlineTable:
    value, interval = _rounded(getattr(vehicle.coefficients, name)), vehicle.intervals.get(name)
    entry = tomlkit.inline_table()
    entry.append("value", value)
    entry.append("unit", COEFFICIENTS[name].unit)
    if interval:
        entry.append("interval", [min(_rounded(interval[0]), value), max(_rounded(interval[1]), value)])
    entry.append("source", vehicle.sources[name])
    return entry


def _provenance(provenance: Provenance, folder: Path) -> Any:
    table = tomlkit.table()
    table.add("tool", provenance.tool)
    table.add("method", provenance.method)
    if provenance.report:
        table.add("report", _seen_from(folder, provenance.report))
    if provenance.warnings:
        table.add("warnings", _lines(provenance.warnings))
    inputs = tomlkit.table()
    for name, digest in provenance.inputs.items():
        inputs.add(name, digest)
    table.add("inputs", inputs)
    return table


def _lines(texts: Iterable[str]) -> Array:
    lines = tomlkit.array().multiline(True)
    lines.extend(texts)
    return lines


def _seen_from(folder: Path, path: Path) -> str:
    """The path from a folder; as a whole where they are on two drives of Windows."""
    path, folder = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    return Path(os.path.relpath(path, folder)).as_posix() if path.drive == folder.drive else path.as_posix()


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
