"""Tables and equations in the pages that follow from the code; `python -m docs.reference` writes them anew.

They stand in the pages, so that these can be read in a checkout, each between its name and an end, in comments.
"""

import re
from pathlib import Path
from typing import Any

from rov_fmu.fmu.terminals import terminals
from rov_fmu.fmu.variables import LOG_CATEGORIES
from rov_fmu.io.toml_file import Strict
from rov_fmu.model.layout import AXES
from rov_fmu.report.page import equations
from rov_fmu.report.page.equations import Text
from rov_fmu.report.templates import number
from rov_fmu.study.plan.plan import InputFile, Keep, Plan, Signal, Varied
from rov_fmu.vehicle.json_schema import json_schema
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

Table = list[tuple[str, ...]]
PAGES = [Path(__file__).with_name(name) for name in ("model.md", "vehicle-file.md", "variables.md", "studies.md")]

_TYPES = {"string": "text", "boolean": "true, false", "integer": "whole number", "object": "table", "array": "list"}


def tables() -> dict[str, Table]:
    """By name."""
    schema = json_schema()
    named = {"vehicle": "FileHead", "provenance": "Made", "estimated": "Estimated"} | {
        f"axis_{name}": f"_{name.capitalize()}" for name in AXES
    }
    named |= {
        name.lower(): name for name in ("Validity", "Body", "Arm", "Curve", "Thruster", "Fin", "Battery", "Commands")
    }
    categories = [("category", "what"), ("---",) * 2, *((f"`{name}`", words) for name, words in LOG_CATEGORIES.items())]
    found = {"log_categories": categories, "terminals": _terminals(), "file": _table(schema, schema)}
    plans = {"plan": Plan, "varied": Varied, "signal": Signal, "input_file": InputFile, "keep": Keep}
    found |= {name: _plan_table(of) for name, of in plans.items()}
    return found | {name: _table(schema["$defs"][of], schema) for name, of in named.items()}


def markdown(table: Table) -> str:
    """As a page has it."""
    return "\n".join(f"| {' | '.join(row)} |" for row in table)


def filled(page: str) -> str:
    """The text of a page with its tables and equations as they are to be."""
    found = tables()

    def text(match: re.Match[str]) -> str:
        return f"{match[1]}\n\n{markdown(found[match[2]])}\n\n"

    def block(match: re.Match[str]) -> str:
        return f"{match[1]}\n\n```text\n{_equations(match[2])}\n```\n\n"

    page = re.sub(r"(<!-- equations: (\w+) -->)\n.*?(?=<!-- end -->)", block, page, flags=re.DOTALL)
    return re.sub(r"(<!-- table: (\w+) -->)\n.*?(?=<!-- end -->)", text, page, flags=re.DOTALL)


def _equations(name: str) -> str:
    """The equations of a vehicle that ships, a line each; the number of the paper's equation behind."""
    layout = load_vehicle(SHIPPED[name]).layout
    write = Text(layout).line
    return "\n".join(f"{write(line):<96} {line.reference}".rstrip() for line in equations.of(layout))


def _terminals() -> Table:
    """A row a terminal of the VideoRay, which has them all."""
    rows = [
        (
            f"`{terminal.name}`",
            terminal.causality,
            terminal.rule,
            terminal.description,
            ", ".join(f"`{name}`" for name in terminal.members),
        )
        for terminal in terminals(load_vehicle(VIDEORAY).layout)
    ]
    return [("terminal", "of", "matching", "what", "members in the VideoRay"), ("---",) * 5, *rows]


def _table(table: dict[str, Any], schema: dict[str, Any]) -> Table:
    """A row a key."""
    rows = []
    for key, entry in table["properties"].items():
        found = _resolved(entry, schema)
        of_value = found.get("properties", {}).get("value")
        unit = found["properties"].get("unit", {}).get("const", "") if of_value else ""
        needed = "needed" if key in table.get("required", ()) else ""
        rows.append((f"`{key}`", needed, unit, _allowed(of_value or found), _words(found)))
    return [("key", "", "unit", "allowed", "what"), ("---",) * 5, *rows]


def _plan_table(of: type[Strict]) -> Table:
    """A row a key of a plan of a study, or of a table in it."""
    schema, rows = json_schema(of), []
    for (key, entry), field in zip(schema["properties"].items(), of.model_fields.values(), strict=True):
        found = _resolved(entry, schema)
        without = "needed" if field.is_required() else f"`{field.default}`" if field.default not in (None, {}) else ""
        keys = ", ".join(f"{inner} = ..." for inner in found.get("properties", ()))
        allowed = f"`{{ {keys} }}`" if keys else _allowed(found)
        rows.append((f"`{key}`", without, allowed, _words(found)))
    return [("key", "without it", "allowed", "what"), ("---",) * 4, *rows]


def _resolved(entry: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = schema["$defs"][entry["$ref"].removeprefix("#/$defs/")] if "$ref" in entry else entry
    return found


def _words(entry: dict[str, Any]) -> str:
    return str(entry.get("description", "")).replace("\n", " ").replace("|", r"\|")


def _allowed(entry: dict[str, Any]) -> str:
    if "minimum" in entry and "maximum" in entry:
        return f"{number(entry['minimum'], 6)}\xa0…\xa0{number(entry['maximum'], 6)}"
    if choices := entry.get("enum", [entry["const"]] if "const" in entry else []):
        return ", ".join(f"`{choice}`" for choice in choices)
    if "exclusiveMinimum" in entry:
        most = f", at most {number(entry['maximum'], 6)}" if "maximum" in entry else ""
        return f"more than {number(entry['exclusiveMinimum'], 6)}{most}"
    if entry.get("minItems") == entry.get("maxItems", 0):
        return f"{entry['minItems']} numbers"
    return _TYPES.get(entry.get("type", ""), "number")


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
