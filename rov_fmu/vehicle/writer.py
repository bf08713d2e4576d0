"""`Vehicle` to vehicle file (TOML), whole or not at all."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Array, InlineTable

from rov_fmu.files.messages import shown
from rov_fmu.files.output import Output, write_whole
from rov_fmu.files.reading import read_text
from rov_fmu.motion.rov import COEFFICIENTS
from rov_fmu.vehicle.vehicle import Head, Vehicle, VehicleFileError, load_vehicle

_DIGITS = 6  # significant ones: more than any tank test has, few enough to be the same on every machine


def vehicle_text(vehicle: Vehicle, folder: Path = Path()) -> str:
    """The vehicle file, in a folder, of a vehicle without tables, pictures and alternatives."""
    document = tomlkit.document()
    if vehicle.provenance:
        words = "Made from tank tests: [provenance] tells how, and `interval` is 95 % confidence."
        document.add(tomlkit.comment(words)).add(tomlkit.nl())
    low, high = map(_rounded, vehicle.command_range)
    document["vehicle"] = {key: getattr(vehicle, key) for key in Head.model_fields}
    document["validity"] = {"command_min": low, "command_max": high, **_lines("limits", vehicle.limits)}
    document["coefficients"] = {name: _quantity(vehicle, name) for name in COEFFICIENTS}
    if made := vehicle.provenance:
        report = {"report": _seen_from(folder, made.report)} if made.report else {}
        head = {"tool": made.tool, "method": made.method, **report, **_lines("warnings", made.warnings)}
        document["provenance"] = {**head, "inputs": dict(made.inputs)}
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
    document: Any = tomlkit.parse(read_text(source, VehicleFileError))
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
    entry |= {"value": value, "unit": COEFFICIENTS[name].unit}
    if interval:
        entry["interval"] = [min(_rounded(interval[0]), value), max(_rounded(interval[1]), value)]
    entry["source"] = vehicle.sources[name]
    return entry


def _lines(key: str, texts: Iterable[str]) -> dict[str, Array]:
    """The texts a line each, where there are any."""
    lines = tomlkit.array().multiline(True)
    lines.extend(texts)
    return {key: lines} if lines else {}


def _seen_from(folder: Path, path: Path) -> str:
    """The path from a folder; as a whole where they are on two drives of Windows."""
    path, folder = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    return Path(os.path.relpath(path, folder)).as_posix() if path.drive == folder.drive else path.as_posix()


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
