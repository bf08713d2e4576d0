"""Writing vehicle files (TOML), completely or not at all."""

import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable

from rov_fmu.equation.catalogue import POINT
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import EVERY_COMMAND, Actuator, Curve, Point
from rov_fmu.io.messages import brief, shown
from rov_fmu.io.output import Output, is_same, sealed, without_seal, write_whole
from rov_fmu.io.paths import inside_or_shipped, name_of
from rov_fmu.io.reading import read_bytes
from rov_fmu.io.toml_file import LARGEST, key_line, toml_text
from rov_fmu.vehicle.description import UNIT_OF_RANGE, FileHead, why_no_identifier
from rov_fmu.vehicle.schema import FORMAT, NOT_GIVEN
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, VehicleWarning, load_vehicle

_DEPTHS = {"curves": 2, "axes": 2, "alternatives": 2, "provenance": 2, "validity": 2}
"""How deep the tables in some tables of a file are written with headings; in the others, one deep. Those inside are
written in one line."""


def vehicle_text(vehicle: Vehicle, folder: Path = Path()) -> str:
    """Return the text of a vehicle file in a folder. Its numbers have all digits: they are read back to the last bit.

    Raises ValueError if a file or folder of the vehicle is outside the folder, so that the vehicle file cannot name it.
    """
    document = tomlkit.document()
    if made := vehicle.provenance:
        comment = f"Made from {vehicle.measured_from}: [provenance] tells how, and `interval` is 95 % confidence."
        document.add(tomlkit.comment(comment)).add(tomlkit.nl())
    document["format"] = FORMAT
    if vehicle.layout.current_passes:
        document["current"] = "passes"
    if vehicle.layout.waves:
        document["waves"] = True
    for name, table in _tables(vehicle).items():
        if table:
            document[name] = _item(table, folder, _DEPTHS.get(name, 1))
    text: str = tomlkit.dumps(document)
    return sealed(text, "identify") if made else text


def _tables(vehicle: Vehicle) -> dict[str, Any]:
    """Return the tables of the file. Those that the vehicle does not have are empty."""
    layout, made = vehicle.layout, vehicle.provenance
    low, high = vehicle.command_range
    voltage = {"value": layout.voltage, "unit": "V", "source": layout.voltage_source}
    tables: dict[str, Any] = {
        "vehicle": {key: getattr(vehicle, key) for key in FileHead.model_fields},
        "validity": {
            "command_min": low,
            "command_max": high,
            "limits": vehicle.limits,
            "tested": vehicle.tested or None,
            "stated": {name: one.model_dump(exclude_none=True) for name, one in vehicle.stated.items()} or None,
            "identified": _ranges(layout),
        },
        "body": {"coupling": True} if layout.coupled else {},
        "arm": {},
        "commands": {"pulse": layout.pulse} if layout.pulse else {},
        "surface": {},
        "battery": {} if layout.voltage is None else {"voltage": voltage},
        "curves": {curve.name: _curve(curve) for curve in layout.curves},
        "thruster": [
            {"name": t.name, "description": t.description, "curve": t.curve, **_vectors(t), "arm": t.arm}
            for t in layout.thrusters
        ],
        "fin": [{"name": fin.name, "description": fin.description, **_vectors(fin)} for fin in layout.fins],
        "point": [_point(vehicle, point) for point in layout.points],
        "axes": {name: {} for name in layout.by_name},
        "cross": {},
        "inputs": layout.mix,
        "alternatives": {name: one.model_dump() for name, one in vehicle.alternatives.items()},
        "estimates": {
            name: {"error": row.error, "correlation": row.correlation or None}
            for name, row in vehicle.estimates.items()
        },
        "provenance": made.model_dump() if made else {},
    }
    for name, (*above, key) in layout.keys_in_file.items():
        basis = vehicle.basis.get(name)
        if basis and basis.source != NOT_GIVEN and above[0] != "point":
            value = {"value": vehicle[name], "unit": layout.coefficients[name].unit}
            _table_at(tables, above)[key] = value | {"interval": basis.interval or (), "source": basis.source}
    return tables


def _ranges(layout: Layout) -> dict[str, Any] | None:
    """Return the table of the ranges over which the vehicle was identified, if they are known."""
    ranges = [one for one in layout.identified if one.name != EVERY_COMMAND]
    return {one.name: {"range": (one.low, one.high), "unit": UNIT_OF_RANGE[one.name]} for one in ranges} or None


def _item(value: Any, folder: Path, depth: int) -> Any:
    """Return a value as TOML has it, without keys that are not given. Raises ValueError.

    Tables below `depth` are written in one line, and a path is written as a name in the folder.
    """
    if isinstance(value, Mapping):
        entries = {key: _item(one, folder, depth - 1) for key, one in value.items() if one not in (None, "", ())}
        return entries if depth > 0 else _inline_table(entries)
    if isinstance(value, list) and depth > 0:
        tables = tomlkit.aot()
        for one in value:
            tables.append(tomlkit.item(_item(one, folder, depth)))
        return tables
    if isinstance(value, list | tuple):
        lines = tomlkit.array().multiline(isinstance(value[0], str))
        lines.extend(_item(one, folder, 0) for one in value)
        return lines
    return name_of(value, folder) if isinstance(value, Path) else value


def _curve(curve: Curve) -> dict[str, Any]:
    """Return the keys of a curve without its coefficients."""
    tables = [{"voltage": table.voltage, "table": table.path} for table in curve.tables]
    current = curve.electric_current
    return {
        "description": curve.description,
        "equation": curve.equation,
        "together": curve.n_thrusters if curve.n_thrusters != 1 else None,
        "table": tables[0]["table"] if len(tables) == 1 else None,
        "tables": tables if len(tables) > 1 else None,
        "lag": curve.lag if curve.has_rotors else None,
        "electric_current": {"voltage": current.voltage, "table": current.path} if current else None,
    }


def _vectors(actuator: Actuator) -> dict[str, Any]:
    """Return the tables of the direction and the position of a thruster or a fin."""
    at = actuator.position
    position = at and {"value": at.value, "unit": "m", "source": at.source}
    return {"direction": actuator.direction._asdict(), "position": position}


def _point(vehicle: Vehicle, point: Point) -> dict[str, Any]:
    """Return the keys of a point. Its coordinates share a source, which names each that they have."""
    names = [point.coefficient(key) for key in point.keys]
    sources = dict.fromkeys(vehicle.basis[name].source for name in names if name in vehicle.basis)
    position = {"value": tuple(vehicle[name] for name in names), "unit": "m", "source": "; ".join(sources)}
    return {"name": point.name, "description": point.description, "position": position}


def _table_at(tables: Any, path: Iterable[str]) -> Any:
    """Return a table inside others. One of a list is found by its name."""
    for key in path:
        tables = next(one for one in tables if one["name"] == key) if isinstance(tables, list) else tables[key]
    return tables


def vehicle_output(vehicle: Vehicle, path: Path) -> Output:
    """Return the vehicle file to write; its report may be written together with it. Raises VehicleFileError."""
    report = vehicle.provenance.report if vehicle.provenance else None
    try:
        text = vehicle_text(vehicle, path.parent)
    except ValueError as error:
        raise VehicleFileError(f"{path}: {error}") from error
    return _checked(path, text, coming=report)


def check_report(path: Path, report: Path) -> None:
    """Raise VehicleFileError if the vehicle file at a path cannot name this report."""
    try:
        name_of(report, path.parent)
    except ValueError as error:
        raise VehicleFileError(f"{report}: must be inside the folder of {path}, which names it") from error


def write_vehicle(vehicle: Vehicle, path: str | Path, *, force: bool = False) -> None:
    """Write the vehicle file. Raises VehicleFileError if it could not be read again, or OSError.

    - `vehicle`: a vehicle with all its texts, such as `load_vehicle` and `identify` return. Numbers have all digits.
    - `path`: the file. The tables, pictures and the report of the vehicle must be in its folder or below it.
    - `force`: True to replace a file that this program did not write, or that has changed since.

        write_vehicle(load_vehicle(find_vehicle("bare.toml")).with_(m_rov=7.2), "heavier.toml")
    """
    write_whole(vehicle_output(vehicle, Path(path)), force=force)


def write_tuned(
    source: Path, path: Path, values: Mapping[str, float], reason: str, *, force: bool = False
) -> dict[Path, str]:
    """Write a copy of the vehicle file `source` with other values of some coefficients. Return what it replaced.

    - `source`, `path`: the vehicle file, and the file to write. If that is a new one, it is a vehicle of its own: its
      name, its identifier and so its FMU have other names than those of `source`.
    - `values`: the new values by name, in SI units. Everything else stays as it is, with the comments.
    - `reason`: the source of the coefficients that change.
    - `force`: True to replace a file that this program did not write, or that has changed since.

        write_tuned(Path("bare.toml"), Path("tuned.toml"), {"alpha_w": 0.9}, "Tuned by hand in the harbour")

    Raises VehicleFileError or OSError, as write_vehicle does.
    """
    document, vehicle = _read_document(source), load_vehicle(source)
    for name, value in values.items():
        if value == vehicle[name]:
            continue
        *above, key = vehicle.layout.keys_in_file[name]
        table = _table_at(document, above)
        if above[0] == "point":
            table["position"]["value"][[*POINT].index(key)], table["position"]["source"] = value, reason
        elif key in table:
            table[key]["value"], table[key]["source"] = value, reason
            table[key].pop("interval", None)
        else:
            unit = vehicle.layout.coefficients[name].unit
            table[key] = _inline_table({"value": value, "unit": unit, "source": reason})
        _remove_estimate(document, name)
    if not is_same(source, path):
        document["vehicle"]["identifier"] = _own_identifier(path.stem, vehicle)
        stem = "".join(c if c.isprintable() else "_" for c in path.stem)
        document["vehicle"]["name"] = f"{vehicle.name.partition(_TUNED_AS)[0][:50]}{_TUNED_AS}{stem[:30]}"
    return write_whole(_moved(document, source, path), force=force)


_TUNED_AS = ", tuned: "
"""What stands between the name of a vehicle and that of the file with a tuned copy."""


def _own_identifier(stem: str, vehicle: Vehicle) -> str:
    """Return an identifier for a copy of a vehicle from the name of its file, which no vehicle has that ships."""
    identifier = re.sub(r"\W|^(?=\d)", "_", stem, flags=re.ASCII)[:90]
    taken = {name.lower() for name in (vehicle.identifier, *SHIPPED)}
    return f"{identifier}_tuned" if identifier.lower() in taken or why_no_identifier(identifier) else identifier


def _remove_estimate(document: Any, name: str) -> None:
    """Remove a coefficient from [estimates], with its correlations; the other estimates stay."""
    rows = document.get("estimates", {})
    rows.pop(name, None)
    for row in rows.values():
        row.get("correlation", {}).pop(name, None)
        if not row.get("correlation", True):
            del row["correlation"]
    if "estimates" in document and not rows:
        del document["estimates"]


def _read_document(source: Path) -> Any:
    """Read a vehicle file with its comments, in order to change it. Raises VehicleFileError."""
    try:
        content = read_bytes(source, VehicleFileError, most=LARGEST)
        document: Any = tomlkit.parse(without_seal(toml_text(source, content, VehicleFileError)))
    except (TOMLKitError, RecursionError) as error:
        raise VehicleFileError(f"{source}: cannot be written again as it is: {brief(str(error))}") from error
    if "vehicle" not in document:
        raise VehicleFileError(f"{source}: cannot be read a second time, as it must be to write it anew")
    return document


def _moved(document: Any, source: Path, path: Path) -> Output:
    """Return the file to write. It names its folders and report relative to its new place. Raises VehicleFileError."""
    for place, table, key in _names_of_files(document):
        name = table[key]
        try:
            table[key] = name_of(inside_or_shipped(source.parent, name), path.parent)
        except ValueError as error:
            reason = f"must be inside the folder of the new file: write that beside {source}, or leave this key out"
            raise VehicleFileError(f"{path}: {key_line(f'{place}.{key}', reason, str(name))}") from error
    return _checked(path, tomlkit.dumps(document))


def _names_of_files(document: Any) -> Iterator[tuple[str, Any, str]]:
    """Yield each key that names a folder or another file: the name of its table, the table and the key."""
    tables = [(name, document.get(name, {})) for name in ("vehicle", "provenance")]
    for name, curve in document.get("curves", {}).items():
        tables.append((f"curves.{name}", curve))
        tables += [(f"curves.{name}.tables", row) for row in curve.get("tables", ())]
        tables.append((f"curves.{name}.electric_current", curve.get("electric_current", {})))
    for name, table in tables:
        for key in ("data", "pictures", "report", "table"):
            if key in table:
                yield name, table, key


def _checked(path: Path, text: str, coming: Path | None = None) -> Output:
    """Return the file to write, whose draft is checked by loading it. Raises VehicleFileError."""

    def check(draft: Path) -> None:
        def named(message: object) -> str:
            return str(message).replace(str(draft), str(path))

        try:
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                load_vehicle(draft, coming=coming)
        except VehicleFileError as error:
            raise VehicleFileError(named(error)) from error
        for warning in told:
            if warning.category is not VehicleWarning:  # it is written, and not used
                warnings.warn(named(warning.message), warning.category, stacklevel=2)

    try:
        return Output(path, (sealed(text) if text == without_seal(text) else text).encode(), check)
    except UnicodeEncodeError as error:
        part = shown(text[max(error.start - 20, 0) : error.end])
        raise VehicleFileError(f"{path}: {part}: the name of a file that is not Unicode cannot stand here") from error


def _inline_table(entries: Mapping[str, Any]) -> InlineTable:
    """Return an inline table with spaces inside the braces."""
    table = tomlkit.inline_table()
    table |= dict(entries)
    return cast(InlineTable, tomlkit.value(f"{{ {table.as_string()[1:-1]} }}"))
