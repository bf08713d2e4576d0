"""`Vehicle` to vehicle file (TOML), whole or not at all."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Array, InlineTable, Item

from rov_fmu.io.messages import brief, shown
from rov_fmu.io.output import Output, write_whole
from rov_fmu.io.paths import inside_or_shipped, name_of
from rov_fmu.io.reading import read_text
from rov_fmu.io.seal import sealed
from rov_fmu.io.toml_file import key_line
from rov_fmu.model.layout import Curve, Declaration, Thruster
from rov_fmu.vehicle.form import Head
from rov_fmu.vehicle.schema import FORMAT, NOT_GIVEN, Estimated, where
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle

_DECIMALS = 6
"""Of a correlation: thrust and drag that tests tell hardly apart are correlated by nearly 1."""
_DIGITS = 6  # significant ones: more than any tank test has, few enough to be the same on every machine


def vehicle_text(vehicle: Vehicle, folder: Path = Path()) -> str:
    """The vehicle file, in a folder, of a vehicle. Raises ValueError where it cannot name a folder or a report."""
    document = tomlkit.document()
    if vehicle.provenance:
        words = "Made from tank tests: [provenance] tells how, and `interval` is 95 % confidence."
        document.add(tomlkit.comment(words)).add(tomlkit.nl())
    low, high = map(_rounded, vehicle.command_range)
    beside = {key: getattr(vehicle, key) for key in ("data", "pictures")}
    folders = {key: name_of(path, folder) for key, path in beside.items() if path}
    document["format"] = FORMAT
    document["vehicle"] = {key: getattr(vehicle, key) for key in Head.model_fields} | folders
    document["validity"] = {"command_min": low, "command_max": high, **_lines("limits", vehicle.limits)}
    entries = {name: _quantity(vehicle, name) for name, source in vehicle.sources.items() if source != NOT_GIVEN}
    for key, table in _hardware(vehicle, entries).items():
        document[key] = table
    if vehicle.alternatives:
        document["alternatives"] = {
            name: {"description": other.description}
            | {n: _inline(value, vehicle.layout.coefficients[n], other.sources[n]) for n, value in other.values.items()}
            for name, other in vehicle.alternatives.items()
        }
    if vehicle.estimates:
        document["estimates"] = {name: _estimated(row) for name, row in vehicle.estimates.items()}
    if made := vehicle.provenance:
        report = {"report": name_of(made.report, folder)} if made.report else {}
        head = {"tool": made.tool, "method": made.method, **report, **_lines("warnings", made.warnings)}
        document["provenance"] = {**head, "inputs": dict(made.inputs)}
    text: str = tomlkit.dumps(document)
    return sealed(text, "# {}") if vehicle.provenance else text


def _hardware(vehicle: Vehicle, entries: Mapping[str, Item]) -> dict[str, Any]:
    """The tables that say what the vehicle has, with the entries of its coefficients."""
    layout = vehicle.layout
    tables: dict[str, Any] = {"body": {"coupling": True} if layout.coupled else {}}
    tables |= {"arm": {}} if layout.has_arm else {}
    tables["curves"] = {curve.name: _curve(curve) for curve in layout.curves}
    tables["thruster"] = tomlkit.aot()
    for thruster in layout.thrusters:
        tables["thruster"].append(tomlkit.item(_thruster(thruster, vehicle.thruster_sources[thruster.name])))
    tables["axes"] = {form.axis.name: {} for form in layout.axes}
    tables |= {"inputs": {name: _inline_of(gains) for name, gains in layout.mix.items()}} if layout.mix else {}
    for name, (*above, key) in where(layout):
        table = tables
        for step in above:
            table = table[step]
        if name in entries:
            table[key] = entries[name]
    return tables


def vehicle_output(vehicle: Vehicle, path: Path) -> Output:
    """The vehicle file to write, perhaps together with its report. Raises VehicleFileError."""
    report = vehicle.provenance.report if vehicle.provenance else None
    try:
        text = vehicle_text(vehicle, path.parent)
    except ValueError as error:
        raise VehicleFileError(f"{path}: {error}") from error
    return _checked(path, text, coming=report)


def check_report(path: Path, report: Path) -> None:
    """Raise VehicleFileError where the vehicle file at a path could not name this report."""
    try:
        name_of(report, path.parent)
    except ValueError as error:
        raise VehicleFileError(f"{report}: must be inside the folder of {path}, which names it") from error


def write_vehicle(vehicle: Vehicle, path: Path) -> None:
    """Write the vehicle file. Raises VehicleFileError where it could not be read again, OSError where not written."""
    write_whole(vehicle_output(vehicle, path))


def write_tuned(source: Path, path: Path, values: Mapping[str, float], reason: str) -> None:
    """Write the vehicle file `source` with other values of some coefficients, all else in it as it is.

    `reason` is the source of those that change. Raises as write_vehicle.
    """
    document, vehicle = _read_document(source), load_vehicle(source)
    places = dict(where(vehicle.layout))
    for name, exact in values.items():
        if (value := _rounded(exact)) == _rounded(vehicle.rov[name]):
            continue
        *above, key = places[name]
        table = document
        for step in above:
            table = table[step]
        if key in table:
            table[key]["value"], table[key]["source"] = value, reason
            table[key].pop("interval", None)
        else:
            table[key] = _inline(value, vehicle.layout.coefficients[name], reason)
        _forget(document, name)
    write_whole(_moved(document, source, path))


def _forget(document: Any, name: str) -> None:
    """A coefficient that is no estimate any more; what is known of the others stays."""
    rows = document.get("estimates", {})
    rows.pop(name, None)
    for row in rows.values():
        row.get("correlation", {}).pop(name, None)
        if not row.get("correlation", True):
            del row["correlation"]
    if "estimates" in document and not rows:
        del document["estimates"]


def _read_document(source: Path) -> Any:
    """The vehicle file with its comments, to write it otherwise. Raises VehicleFileError."""
    try:
        document: Any = tomlkit.parse(read_text(source, VehicleFileError))
    except TOMLKitError as error:
        raise VehicleFileError(f"{source}: cannot be written again as it is: {brief(str(error))}") from error
    if "vehicle" not in document:
        raise VehicleFileError(f"{source}: cannot be read a second time, as it must be to write it anew")
    return document


def _moved(document: Any, source: Path, path: Path) -> Output:
    """The document to write, with what is beside it named from its new place. Raises VehicleFileError."""
    for table, key in (("vehicle", "data"), ("vehicle", "pictures"), ("provenance", "report")):
        if key in document.get(table, {}):
            name = document[table][key]
            try:
                document[table][key] = name_of(inside_or_shipped(source.parent, name), path.parent)
            except ValueError as error:
                reason = f"must be inside the folder of the new file: write that beside {source}, or leave this key out"
                raise VehicleFileError(f"{path}: {key_line(f'{table}.{key}', reason, str(name))}") from error
    return _checked(path, tomlkit.dumps(document))


def _checked(path: Path, text: str, coming: Path | None = None) -> Output:
    """The text of a vehicle file, to write once it has proved to be one. Raises VehicleFileError."""

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


def _curve(curve: Curve) -> dict[str, Any]:
    words = {key: getattr(curve, key) for key in ("description", "equation", "together")}
    return {key: word for key, word in words.items() if word != getattr(Curve, key)}


def _thruster(thruster: Thruster, sources: Mapping[str, str]) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": thruster.name}
    if thruster.description:
        entry["description"] = thruster.description
    entry["curve"] = thruster.curve
    entry["direction"] = _inline_of({"value": [*thruster.direction], "source": sources["direction"]})
    if thruster.position:
        position = {"value": [*thruster.position], "unit": "m", "source": sources["position"]}
        entry["position"] = _inline_of(position)
    if thruster.arm:
        entry["arm"] = "port" if thruster.arm > 0 else "starboard"
    return entry


def _quantity(vehicle: Vehicle, name: str) -> InlineTable:
    value, interval = _rounded(vehicle.rov[name]), vehicle.intervals.get(name)
    ends = [min(_rounded(interval[0]), value), max(_rounded(interval[1]), value)] if interval else None
    return _inline(value, vehicle.layout.coefficients[name], vehicle.sources[name], ends)


def _estimated(row: Estimated) -> InlineTable:
    shares = {name: share for name, value in row.correlation.items() if (share := round(value, _DECIMALS))}
    entry: dict[str, Any] = {"error": _rounded(row.error)}
    return _inline_of(entry | ({"correlation": _inline_of(shares)} if shares else {}))


def _inline(value: float, meta: Declaration, source: str, interval: list[float] | None = None) -> InlineTable:
    ends = {"interval": interval} if interval else {}
    return _inline_of({"value": value, "unit": meta.unit, **ends, "source": source})


def _inline_of(entries: Mapping[str, Any]) -> InlineTable:
    """With spaces inside the braces, as people write it."""
    table = tomlkit.inline_table()
    table |= dict(entries)
    return cast(InlineTable, tomlkit.value(f"{{ {table.as_string()[1:-1]} }}"))


def _lines(key: str, texts: Iterable[str]) -> dict[str, Array]:
    """The texts a line each, where there are any."""
    lines = tomlkit.array().multiline(True)
    lines.extend(texts)
    return {key: lines} if lines else {}


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
