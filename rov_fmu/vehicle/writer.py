"""Writing vehicle files (TOML), completely or not at all."""

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Array, InlineTable, Item

from rov_fmu.equation.catalogue import Declaration
from rov_fmu.equation.layout import Curve, Fin, Thruster
from rov_fmu.io.messages import brief, shown
from rov_fmu.io.output import Output, sealed, write_whole
from rov_fmu.io.paths import inside_or_shipped, name_of
from rov_fmu.io.reading import read_text
from rov_fmu.io.toml_file import key_line
from rov_fmu.vehicle.description import Head
from rov_fmu.vehicle.schema import FORMAT, NOT_GIVEN, Alternative, Estimated, keys_in_file
from rov_fmu.vehicle.thrust_table import CurrentTable
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle

_TOLD = ("verdicts", "errors", "tested", "warnings", "facts")
"""The lists of sentences in [provenance]."""
_DECIMALS = 6
"""The number of decimals of a correlation. It is large because a correlation may be very close to 1."""
_DIGITS = 6
"""The significant digits of a number: more than any tank test gives, but few enough to be equal on every machine."""


def vehicle_text(vehicle: Vehicle, folder: Path = Path()) -> str:
    """Return the text of a vehicle file in a folder.

    Raises ValueError if a file or folder of the vehicle is outside the folder, so that the vehicle file cannot name it.
    """
    document = tomlkit.document()
    if made := vehicle.provenance:
        comment = f"Made from {vehicle.measured_from}: [provenance] tells how, and `interval` is 95 % confidence."
        document.add(tomlkit.comment(comment)).add(tomlkit.nl())
    low, high = map(_rounded, vehicle.command_range)
    paths = {"data": vehicle.data, "pictures": vehicle.pictures}
    folders = {key: name_of(path, folder) for key, path in paths.items() if path}
    document["format"] = FORMAT
    document["vehicle"] = {key: getattr(vehicle, key) for key in Head.model_fields} | folders
    document["validity"] = {"command_min": low, "command_max": high} | _texts("limits", vehicle.limits)
    quantities = {name: _quantity(vehicle, name) for name, source in vehicle.sources.items() if source != NOT_GIVEN}
    for key, table in _hardware(vehicle, quantities, folder).items():
        document[key] = table
    if vehicle.alternatives:
        document["alternatives"] = {name: _alternative(one) for name, one in vehicle.alternatives.items()}
    if vehicle.estimates:
        document["estimates"] = {name: _estimated(row) for name, row in vehicle.estimates.items()}
    if made:
        report = {"report": name_of(made.report, folder)} if made.report else {}
        told = {key: value for name in _TOLD for key, value in _texts(name, getattr(made, name)).items()}
        head = {"tool": made.tool, "method": made.method} | report | told
        document["provenance"] = {**head, "inputs": dict(made.inputs)}
    text: str = tomlkit.dumps(document)
    return sealed(text, "# {}") if made else text


def _hardware(vehicle: Vehicle, quantities: Mapping[str, Item], folder: Path) -> dict[str, Any]:
    """Return the tables of the body, the curves, the thrusters, the fins, the axes and the inputs."""
    layout = vehicle.layout
    tables: dict[str, Any] = {"body": {"coupling": True} if layout.coupled else {}}
    if layout.has_arm:
        tables["arm"] = {}
    if layout.has_dead_time or layout.pulse:
        tables["commands"] = {"pulse": [*layout.pulse]} if layout.pulse else {}
    if layout.voltage is not None:
        tables["battery"] = {
            "voltage": _inline_table({"value": layout.voltage, "unit": "V", "source": vehicle.voltage_source})
        }
    if layout.curves:
        tables["curves"] = _curves(vehicle, folder)
    if layout.thrusters:
        tables["thruster"] = tomlkit.aot()
    for thruster in layout.thrusters:
        tables["thruster"].append(tomlkit.item(_thruster(thruster, vehicle.thruster_sources[thruster.name])))
    fins = {fin.name: tomlkit.item(_fin(fin, vehicle.thruster_sources[fin.name])) for fin in layout.fins}
    if fins:
        tables["fin"] = tomlkit.aot()
        for fin in fins.values():
            tables["fin"].append(fin)
    tables["axes"] = {vehicle_axis.axis.name: {} for vehicle_axis in layout.axes}
    if layout.cross:
        tables["cross"] = {}
    if layout.mix:
        tables["inputs"] = {name: _inline_table(gains) for name, gains in layout.mix.items()}
    for name, (*above, key) in keys_in_file(layout):
        if name in quantities:
            table = fins[above[1]] if above[0] == "fin" else _table_at(tables, above)
            table[key] = quantities[name]
    return tables


def _curves(vehicle: Vehicle, folder: Path) -> dict[str, Any]:
    """Return the table of each curve, without its coefficients. Raises ValueError."""
    return {
        curve.name: _curve(curve)
        | _thrust_tables(curve, vehicle.thrust_files.get(curve.name, ()), folder)
        | _electric_current(vehicle.electric_currents.get(curve.name), folder)
        for curve in vehicle.layout.curves
    }


def _thrust_tables(curve: Curve, files: Sequence[Path], folder: Path) -> dict[str, Any]:
    """Return the keys that name the thrust tables of a curve. Raises ValueError."""
    names = [name_of(file, folder) for file in files]
    if not names:
        return {}
    if not curve.tables[0].voltage:
        return {"table": names[0]}
    rows = zip(curve.tables, names, strict=True)
    return {"tables": [_inline_table({"voltage": table.voltage, "table": name}) for table, name in rows]}


def _electric_current(table: CurrentTable | None, folder: Path) -> dict[str, Any]:
    """Return the key with the electric current of a curve. Raises ValueError."""
    if table is None:
        return {}
    return {"electric_current": _inline_table({"voltage": table.voltage, "table": name_of(table.path, folder)})}


def _fin(fin: Fin, sources: Mapping[str, str]) -> dict[str, Any]:
    """Return the table of a fin, without its coefficients."""
    words = {"description": fin.description} if fin.description else {}
    return {
        "name": fin.name,
        **words,
        "direction": _inline_table({"value": [*fin.direction], "source": sources["direction"]}),
        "position": _inline_table({"value": [*fin.position], "unit": "m", "source": sources["position"]}),
    }


def _table_at(tables: Any, path: Iterable[str]) -> Any:
    """Return a table inside others."""
    for key in path:
        tables = tables[key]
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


def write_vehicle(vehicle: Vehicle, path: Path) -> None:
    """Write the vehicle file. Raises VehicleFileError if it could not be read again, or OSError."""
    write_whole(vehicle_output(vehicle, path))


def write_tuned(source: Path, path: Path, values: Mapping[str, float], reason: str) -> None:
    """Write a copy of the vehicle file `source` with other values of some coefficients.

    `reason` becomes the source of the coefficients that change. Everything else in the file stays as it is. Raises
    VehicleFileError or OSError, as write_vehicle does.
    """
    document, vehicle = _read_document(source), load_vehicle(source)
    places = dict(keys_in_file(vehicle.layout))
    for name, exact in values.items():
        if (value := _rounded(exact)) == _rounded(vehicle[name]):
            continue
        *above, key = places[name]
        table = _fin_of(document, above[1]) if above[0] == "fin" else _table_at(document, above)
        if key in table:
            table[key]["value"], table[key]["source"] = value, reason
            table[key].pop("interval", None)
        else:
            table[key] = _quantity_table(value, vehicle.layout.coefficients[name], reason)
        _remove_estimate(document, name)
    write_whole(_moved(document, source, path))


def _fin_of(document: Any, name: str) -> Any:
    """Return the table of a fin."""
    return next(fin for fin in document["fin"] if fin["name"] == name)


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
        document: Any = tomlkit.parse(read_text(source, VehicleFileError))
    except TOMLKitError as error:
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
            warnings.warn(named(warning.message), warning.category, stacklevel=2)

    try:
        return Output(path, text.encode(), check)
    except UnicodeEncodeError as error:
        part = shown(text[max(error.start - 20, 0) : error.end])
        raise VehicleFileError(f"{path}: {part}: the name of a file that is not Unicode cannot stand here") from error


def _curve(curve: Curve) -> dict[str, Any]:
    """Return the keys of a curve that differ from their defaults, without its coefficients."""
    entries = {key: getattr(curve, key) for key in ("description", "equation", "together")}
    return {key: entry for key, entry in entries.items() if entry != getattr(Curve, key)}


def _thruster(thruster: Thruster, sources: Mapping[str, str]) -> dict[str, Any]:
    """Return the table of a thruster."""
    entry: dict[str, Any] = {"name": thruster.name}
    if thruster.description:
        entry["description"] = thruster.description
    entry["curve"] = thruster.curve
    entry["direction"] = _inline_table({"value": [*thruster.direction], "source": sources["direction"]})
    if thruster.position:
        position = {"value": [*thruster.position], "unit": "m", "source": sources["position"]}
        entry["position"] = _inline_table(position)
    if thruster.arm:
        entry["arm"] = "port" if thruster.arm > 0 else "starboard"
    return entry


def _alternative(alternative: Alternative) -> dict[str, Any]:
    """Return the table of a set of published coefficients that the model does not use."""
    rows = {name: _inline_table(q.model_dump(exclude_none=True)) for name, q in alternative.quantities.items()}
    return {"description": alternative.description, **rows}


def _quantity(vehicle: Vehicle, name: str) -> InlineTable:
    """Return the table of a coefficient, with rounded numbers, and an interval that includes the rounded value."""
    value, interval = _rounded(vehicle[name]), vehicle.intervals.get(name)
    ends = [min(_rounded(interval[0]), value), max(_rounded(interval[1]), value)] if interval else None
    return _quantity_table(value, vehicle.layout.coefficients[name], vehicle.sources[name], ends)


def _estimated(row: Estimated) -> InlineTable:
    """Return the table of a standard error and those correlations that are not rounded to 0."""
    rounded = {name: round(value, _DECIMALS) for name, value in row.correlation.items()}
    correlation = {name: value for name, value in rounded.items() if value}
    entry: dict[str, Any] = {"error": _rounded(row.error)}
    if correlation:
        entry["correlation"] = _inline_table(correlation)
    return _inline_table(entry)


def _quantity_table(
    value: float, declaration: Declaration, source: str, interval: list[float] | None = None
) -> InlineTable:
    """Return the table of a value with its unit and source."""
    ends = {"interval": interval} if interval else {}
    return _inline_table({"value": value, "unit": declaration.unit, **ends, "source": source})


def _inline_table(entries: Mapping[str, Any]) -> InlineTable:
    """Return an inline table with spaces inside the braces."""
    table = tomlkit.inline_table()
    table |= dict(entries)
    return cast(InlineTable, tomlkit.value(f"{{ {table.as_string()[1:-1]} }}"))


def _texts(key: str, texts: Iterable[str]) -> dict[str, Array]:
    """Return a key with a list of texts, one on each line, or nothing if there are no texts."""
    lines = tomlkit.array().multiline(True)
    lines.extend(texts)
    return {key: lines} if lines else {}


def _rounded(value: float) -> float:
    """Return a number rounded to _DIGITS significant digits."""
    return float(f"{value:.{_DIGITS}g}")
