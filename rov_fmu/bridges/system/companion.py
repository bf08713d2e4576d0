"""The companions of a vehicle in a system: FMUs in Python, each made from one file of companions/ by PythonFMU."""

import hashlib
import json
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from typing import Any
from uuid import UUID
from xml.etree.ElementTree import Element, SubElement, tostring

from rov_fmu.equation.parts import Point
from rov_fmu.equation.units import unit_of
from rov_fmu.fmu.archive import archive
from rov_fmu.fmu.python_flavour import python_files
from rov_fmu.fmu.terminals import FOLDER, Terminal, port_of, terminals_document
from rov_fmu.io.csv_table import DataFileError, read_series

_FILES = {path.stem: path for path in Path(__file__).with_name("companions").glob("[a-z]*.py")}
COMPANIONS = tuple(sorted(_FILES))
"""The names of the companions."""
_PORT = port_of(Point(name="point")).names
"""The names of the members of a vehicle's port, by which a port of a companion fits it: force, place, velocity."""


def slave_of(name: str) -> Any:
    """Return the class of a companion. Its `variables` have causality, start value, unit and description by name.

    It may also have: `terminals`, groups of variables by name; `points`, the ports, whose variables end with the name
    of the port and are in the order of a vehicle's; `columns`, those of its file; and `needs`, a package.
    """
    return getattr(import_module(f"rov_fmu.bridges.system.companions.{name}"), name.capitalize())


def lack(name: str) -> str:
    """Return why a companion cannot run here, or an empty text."""
    needs: str = getattr(slave_of(name), "needs", "")
    return f"needs {needs}: pip install 'rov-fmu[system]'" if needs and find_spec(needs) is None else ""


def companion(name: str, table: Path | None = None) -> bytes:
    """Return the FMU of a companion, with the table of a file if it takes one. Raises DataFileError about this file."""
    slave = slave_of(name)
    sources = {f"{slave.__name__}_slave.py": _FILES[name].read_text(encoding="utf-8")}
    if table:
        sources["table.json"] = _table(table, slave.columns)
    description = _description(slave, sources)
    terminals = terminals_document(_terminals(slave))
    files = {"modelDescription.xml": description, f"{FOLDER}/terminalsAndIcons.xml": terminals}
    return archive(files | python_files(slave.__name__, sources))


def _description(slave: Any, sources: Mapping[str, str]) -> bytes:
    """Return PythonFMU's description, with the units and the dependencies that it does not write.

    No output follows an input before the step. Without the time, the same file gives the same bytes.
    """
    made = slave(instance_name="")
    made.guid = ""
    root: Element = made.to_xml()
    del root.attrib["generationDateAndTime"]
    definitions = Element("UnitDefinitions")
    root.insert(1, definitions)
    for unit in sorted({unit for _, _, unit, _ in slave.variables.values()}):
        defined = SubElement(definitions, "Unit", name=unit)
        try:
            exponents = unit_of(unit).exponents
        except KeyError:  # a unit that no vehicle has
            continue
        SubElement(defined, "BaseUnit", {base: str(exponent) for base, exponent in exponents.items()})
    for variable in root.iter("ScalarVariable"):
        for kind in variable.iter("Real"):
            kind.set("unit", slave.variables[variable.attrib["name"]][2])
    for output in root.iter("Unknown"):
        output.set("dependencies", "")
    content = json.dumps([tostring(root, "unicode"), *sources.items()])
    root.set("guid", f"{{{UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}'.encode()


def _terminals(slave: Any) -> list[Terminal]:
    """Return the terminals of a companion: its groups of variables, and its ports with the members of a vehicle's."""
    causality = {name: causality for name, (causality, *_) in slave.variables.items()}
    found = [Terminal(name, causality[names[0]], "bus", "", names) for name, names in getattr(slave, "terminals", ())]
    for point in getattr(slave, "points", ()):
        names = tuple(name for name in slave.variables if name.endswith(f"_{point}"))[: len(_PORT)]
        found.append(Terminal(point, "port", "bus", "", names, _PORT))
    return found


def _table(path: Path, columns: tuple[str, ...]) -> str:
    """Return the rows of a file by their times, in JSON. Raises DataFileError."""
    series = read_series(path, lambda name: None if name in columns else f"must be one of {', '.join(columns)}")
    if missing := [name for name in columns[1:] if name not in series]:
        raise DataFileError(f"{path}: column {missing[0]!r} is missing: the columns are {', '.join(columns)}")
    rows = [*zip(series[next(iter(series))], *(series[name] for name in columns[1:]), strict=True)]
    return json.dumps([[t, sorted(row[1:] for row in some)] for t, some in groupby(rows, lambda row: row[0])])
