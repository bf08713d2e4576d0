"""The command `rov-fmu identify --inspect`: the content of a log as a table, and a draft of rov.toml."""

import errno
import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.file_kinds import LOG_SUFFIXES
from rov_fmu.io.messages import NO_FILE, brief
from rov_fmu.io.output import Output, WriteError, write_whole
from rov_fmu.model.layout import AXES, BODY, PITCH, ROLL
from rov_fmu.tank.description import ROV_FILE, read_description
from rov_fmu.tank.inspection.inspection import Inspection, fitting, inspect, logs_of
from rov_fmu.tank.inspection.table_headers import TableHeaders, headers_of_tables
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

_BAG = "metadata.yaml"
"""The file in the folder of a bag of ROS 2."""


def inspect_logs(path: Path) -> tuple[list[Inspection], Path, str]:
    """Return what a log, or each log in a folder, contains, with the place and the text of a draft of rov.toml.

    If there is a rov.toml already, thrusters and columns have its names, unless its hardware tables have a mistake.
    Raises DataFileError, and VehicleFileError if rov.toml is not TOML.
    """
    if not path.exists():
        raise DataFileError(f"{path}: {NO_FILE}")
    vehicles = {name: load_vehicle(file) for name, file in SHIPPED.items()}
    layouts = [vehicle.layout for vehicle in vehicles.values()]
    folder = path if path.is_dir() else path.parent
    folder = folder.parent if (folder / _BAG).is_file() else folder
    described = read_description(folder / ROV_FILE) if (folder / ROV_FILE).is_file() else None
    found = [inspect(log, layouts, described) for log in logs_of(path)]
    if not found:
        raise DataFileError(f"{path}: there is no log (*.csv, {', '.join(f'*{s}' for s in LOG_SUFFIXES)}) in it")
    most = max(found, key=lambda one: (len(one.commands), _changing(one)))
    thrusters = [row.name.removeprefix("thruster ") for row in most.commands]
    fits = fitting(thrusters, layouts)
    if not fits and most.path.suffix.lower() in LOG_SUFFIXES:
        thrusters = thrusters[: _changing(most)]
        fits = fitting(thrusters, layouts)
    base = next((name for name, vehicle in vehicles.items() if vehicle.layout == fits), "")
    lines = _draft(found, headers_of_tables(folder), thrusters, base, vehicles.get(base))
    return found, folder / ROV_FILE, "\n".join(lines) + "\n"


def _changing(inspection: Inspection) -> int:
    """Return the number of commands up to the last one that changes; more of them may be lights or servos."""
    return max((n for n, row in enumerate(inspection.commands, start=1) if row.low < row.high), default=0)


def write_draft(path: Path, text: str) -> None:
    """Write a draft of rov.toml. Raises WriteError if the file exists."""
    if path.exists():
        raise WriteError(errno.EEXIST, "the file there is not replaced by a draft", str(path))
    write_whole(Output(path, text.encode()))


# ---- The draft -------------------------------------------------------------------------------------------------------


def _draft(
    found: Sequence[Inspection], tables: TableHeaders, thrusters: Sequence[str], base: str, vehicle: Vehicle | None
) -> Iterator[str]:
    """Yield the lines of a draft, which is a complete rov.toml if a vehicle that ships has such thrusters."""
    first = found[0].path
    names = brief(", ".join(one.path.name for one in found))
    word = re.sub(r"[^a-z0-9]+", "_", first.stem.lower()).strip("_")
    yield f"# A draft by `rov-fmu identify --inspect` of {names}: edit it, then run `rov-fmu identify` on its folder."
    signals = {row.name for one in found for row in one.signals}
    is_own = not base and len(thrusters) > 1
    if is_own:
        those = f"{len(thrusters)} thrusters of these names"
        yield f'# No vehicle that ships has {those}, so the draft describes them. Replace each "?".'
        yield '# For a vehicle file that you have, write base = "its path" here, and remove the tables from [body] on.'
        yield f"# A vehicle that ships has its name instead of the path: {', '.join(SHIPPED)}."
    else:
        first_fitting = f"The first vehicle that ships with {len(thrusters)} thrusters"
        why = first_fitting if base else "These logs do not tell which thrusters the vehicle has"
        yield f"# {why}. Write the path of your vehicle file, or {', '.join(SHIPPED)}."
        yield f"base = {_quoted(base or '?')}"
    yield from ("", "[vehicle]", f"name = {_quoted(first.stem)}")
    yield f"identifier = {_quoted(word if word[:1].isalpha() else f'rov_{word}')}"
    yield from ('version = "1.0"', f'description = "A vehicle identified from {_quoted(names)[1:-1]}"')
    yield f"source = {_quoted(names)}"
    if is_own:
        yield from _hardware(thrusters, tables.curves, signals)
    else:
        yield from (
            "",
            ("[known]  # values that no log determines: replace the values of the base by those of your vehicle"),
        )
    for key in BODY:
        if vehicle and key in vehicle.layout.coefficients:
            unit = vehicle.layout.coefficients[key].unit
            yield f'# {key} = {{ value = {vehicle.rov[key]:g}, unit = "{unit}", source = "..." }}'
    effects = {"voltage": {"voltage"}}
    if not (vehicle and vehicle.layout.has_attitude):
        effects["attitude"] = {"roll", "pitch"}
    if fitted := [key for key, names in effects.items() if names <= signals]:
        yield from ("", "[fit]  # every log has the columns for these: remove # to fit them")
        yield from (f"# {key} = true" for key in fitted)
    is_csv = {one.path: one.path.suffix.lower() not in LOG_SUFFIXES for one in found}
    yield from _columns([one for one in found if is_csv[one.path]], tables)
    topics = {name: what for one in found if not is_csv[one.path] for name, what in one.unread.items()}
    mappable = [f"{name}.{what.rpartition(': ')[2].split(', ')[0]}" for name, what in topics.items() if ": " in what]
    if mappable:
        yield from ("", '[topics]  # what other fields of topics stand for, such as "depth [m]"')
        yield from (f'# {_quoted(field)} = "?"' for field in mappable)
    if len([one for one in found if one.commands]) == 1 and len(found) > 1:
        files = ", ".join(_quoted(one.path.name) for one in found)
        yield from ("", f"[dives.{word or 'dive'}]", f"files = [{files}]")
        yield "# other_clock = [...]  # files with another clock than the commands"


def _columns(found: Sequence[Inspection], tables: TableHeaders) -> Iterator[str]:
    """Yield the table [columns]. Unknown headers are comments."""
    columns = {**tables.columns, **{title: meant for one in found for title, meant in one.columns.items()}}
    unknown = dict.fromkeys(tables.unknown, "") | {name: what for one in found for name, what in one.unread.items()}
    others = {name: what for name, what in unknown.items() if name not in columns}
    if columns or others:
        yield from ("", "[columns]  # what headers of the CSV files stand for: check their units and signs")
        yield from (f"{_quoted(title)} = {_quoted(meant)}" for title, meant in columns.items())
    if others:
        yield ("# These headers are not known. The comments show their values. Remove the first # of a header that you")
        yield '# need, and write what it stands for, such as "depth [m]" or "surge velocity [m/s]".'
    yield from (f'# {_quoted(title)} = "?"{what and f"   # {what}"}' for title, what in sorted(others.items()))


def _hardware(thrusters: Sequence[str], curves: Sequence[str], signals: Collection[str]) -> Iterator[str]:
    """Yield tables for the hardware of a vehicle; the values that must be given are question marks."""
    curves = curves or ["all"]
    yield from ("", "[body]", 'm_rov = { value = "?", unit = "kg", source = "Weighed" }')
    yield 'I_r = { value = "?", unit = "kg.m2", source = "CAD" }   # moment of inertia about the vertical axis'
    yield "# coupling = true   # if the vehicle turns while it moves in surge or sway"
    yield from ("", "# a curve for each kind of thruster")
    yield from (f"[curves.{name}]   # thrust_{name}.csv has the forces of one thruster" for name in curves)
    curve = f'curve = "{curves[0]}"' if len(curves) == 1 else f'curve = "?"   # {" or ".join(curves)}'
    for name in thrusters:
        yield from ("", "[[thruster]]", f"name = {_quoted(name)}", curve)
        yield 'direction = { value = ["?", "?", "?"], source = "CAD" }   # of its thrust: forward, starboard, down'
        yield 'position = { value = ["?", "?", "?"], unit = "m", source = "CAD" }   # from the centre of mass'
    measured = [axis for axis in AXES.values() if {axis.position, f"{axis.name} velocity"} & {*signals}]
    yield from ("", "# axes that the logs measure: remove those that no thruster drives")
    yield from (f"[axes.{axis.name}]" for axis in measured if axis not in (ROLL, PITCH))


def _quoted(text: str) -> str:
    """Return a text as a basic string of TOML."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return '"{}"'.format(clean.replace("\\", "\\\\").replace('"', '\\"'))
