"""The companions of a vehicle in a system: FMUs in Python, each made from one file of companions/ by PythonFMU."""

import hashlib
import json
import re
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any
from uuid import UUID
from xml.etree.ElementTree import Element, SubElement, tostring

from rov_fmu.bridges.system.companions import _common
from rov_fmu.bridges.system.companions._common import Companion
from rov_fmu.equation.parts import Point
from rov_fmu.equation.units import parsed_unit
from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.python_flavour import python_files
from rov_fmu.fmu.terminals import FOLDER, Terminal, port_of, terminals_document
from rov_fmu.io.csv_table import DataFileError, read_series
from rov_fmu.io.interrupts import temporary_folder

_FILES = {path.stem: path for path in Path(__file__).with_name("companions").glob("[a-z]*.py")}
_COMMON = "rov_fmu_companion"
"""The name of the module that companions have in common, in their FMUs."""
AUTOPILOT, SENSORS = "autopilot", "sensors"
OF_VEHICLES = {
    AUTOPILOT: "holds the vehicle of `for`, with gains that are made for it",
    SENSORS: "tells what instruments on the vehicle of `for` measure, with their noise, delays and faults",
}
"""The companions in C, which are made for a vehicle, and what they do."""
COMPANIONS = tuple(sorted({*OF_VEHICLES, *_FILES}))
"""The names of the companions."""
_PORT = port_of(Point(name="point")).names
"""The names of the members of a vehicle's port, by which a port of a companion fits it: force, place, velocity."""


def slave_of(name: str) -> type[Companion]:
    """Return the class of a companion."""
    if name in OF_VEHICLES:
        return Companion  # it has no class in Python
    found: type[Companion] = getattr(import_module(f"{_common.__package__}.{name}"), name.capitalize())
    return found


def lack(name: str) -> str:
    """Return why a companion cannot run here, or an empty text."""
    needs = slave_of(name).needs
    return f"needs {needs}: pip install 'rov-fmu[system]'" if needs and find_spec(needs) is None else ""


Rows = list[tuple[float, list[list[float]]]]
"""The rows of a table by their times."""


def companion(name: str, **shape: Any) -> bytes:
    """Return the FMU of a companion, of a shape.

    - `rows`: those of its table, if it takes one.
    - `places`: whom it serves beside the first one, each with terminals of its own.
    - `levels`: with how many levels it passes on or gets a profile of the water; 0 for the usual number.
    - `lines`: the number of points at which it moves each tether, by the tethers' names.
    - `waves`: True for a tether that a seaway moves.
    - `start`, `experiment`: start values, and the stop time and the step of the default experiment, s.
    """
    slave = slave_of(name)
    sources = {
        f"{slave.__name__}_slave.py": _FILES[name].read_text(encoding="utf-8").replace(_common.__name__, _COMMON),
        f"{_COMMON}.py": Path(_common.__file__).read_text(encoding="utf-8"),
    }
    if shape := {key: one for key, one in shape.items() if one}:
        sources["shape.json"] = json.dumps(shape)
    with temporary_folder("companion-") as folder:
        Path(folder, "shape.json").write_text(sources.get("shape.json", "{}"), encoding="utf-8")
        made = slave(instance_name="", resources=folder)
    description = _description(made, sources)
    terminals = terminals_document(_terminals(made))
    files = {"modelDescription.xml": description, f"{FOLDER}/terminalsAndIcons.xml": terminals}
    return archive(files | python_files(slave.__name__, sources))


def _description(made: Companion, sources: Mapping[str, str]) -> bytes:
    """Return PythonFMU's description, with the units and the dependencies that it does not write.

    No output follows an input before the step. Without the time, the same file gives the same bytes.
    """
    made.guid = ""
    root: Element = made.to_xml()
    del root.attrib["generationDateAndTime"]
    definitions = Element("UnitDefinitions")
    root.insert(1, definitions)
    for unit in sorted({unit for _, _, unit, _ in made.variables.values()}):
        defined = SubElement(definitions, "Unit", name=unit)
        try:
            exponents = parsed_unit(unit).exponents
        except KeyError:  # a unit that no vehicle has
            continue
        SubElement(defined, "BaseUnit", {base: str(exponent) for base, exponent in exponents.items()})
    for variable in root.iter("ScalarVariable"):
        for kind in variable.iter("Real"):
            name = variable.attrib["name"]
            kind.set("unit", made.variables[name][2])
            for key, limit in zip(("min", "max"), made.limits.get(name, ()), strict=False):
                kind.set(key, f"{limit:.16g}")
    for output in root.iter("Unknown"):
        output.set("dependencies", "")
    content = json.dumps([tostring(root, "unicode"), *sources.items()])
    root.set("guid", f"{{{UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}'.encode()


def _terminals(made: Companion) -> list[Terminal]:
    """Return the terminals of a companion: its groups of variables, and its ports with the members of a vehicle's."""
    causality = {name: causality for name, (causality, *_) in made.variables.items()}
    found = [
        Terminal(name, causality[own[0]], "bus", "", (*own,), (*members,)) for name, own, members in made.terminals
    ]
    for point in made.points:
        names = tuple(name for name in made.variables if name.endswith(f"_{point}"))[: len(_PORT)]
        found.append(Terminal(point, "port", "bus", "", names, _PORT))
    return found


def _bare(title: str) -> str:
    """Return the name in a header that may have the unit of the column in brackets: `z (m)`."""
    return re.sub(r" \((s|m|m/s)\)$", "", title)


def timed_rows(path: Path, columns: tuple[str, ...]) -> Rows:
    """Return the rows of a table by their times, with the depth first. Raises DataFileError."""
    wrong = f"must be one of {', '.join(columns)}"
    read = read_series(path, lambda name: None if _bare(name) in columns else wrong)
    series = {_bare(name): values for name, values in read.items()}
    if missing := [name for name in columns[1:-1] if name not in series]:
        raise DataFileError(f"{path}: column {missing[0]!r} is missing: the columns are {', '.join(columns)}")
    time, *others = ([*series[next(iter(series))]], *(series.get(name) for name in columns[1:]))
    rows = [*zip(time, *([0.0] * len(time) if one is None else one for one in others), strict=True)]
    found = [(t, sorted([*row[1:]] for row in some)) for t, some in groupby(rows, lambda row: row[0])]
    for t, some in found:
        if alike := [above[0] for above, below in pairwise(some) if above[0] == below[0]]:
            raise DataFileError(f"{path}: time {t:g} s has two rows of z = {alike[0]:g} m")
    return found


def levels_of(rows: Rows) -> int:
    """Return the number of levels of the water between two times: the depths of the rows of both, and the seabed."""
    profiles = [{depth for depth, *_ in some} for _, some in rows]
    return 1 + max(len(before | after) for before, after in pairwise([profiles[0], *profiles]))
