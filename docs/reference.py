"""Tables of the pages that follow from the code; `python -m docs.reference` writes them anew.

They stand in the pages, so that these can be read in a checkout, each between its name and an end, in comments.
"""

import re
from pathlib import Path
from typing import Any

from rov_fmu.export.interface import LOG_CATEGORIES
from rov_fmu.export.terminals import terminals
from rov_fmu.motion.layout import AXES
from rov_fmu.pages.templates import number
from rov_fmu.vehicle.json_schema import json_schema
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

Table = list[tuple[str, ...]]
PAGES = [Path(__file__).with_name(name) for name in ("vehicle-file.md", "variables.md")]

_TYPES = {"string": "text", "boolean": "true, false", "integer": "whole number", "object": "table", "array": "list"}


def tables() -> dict[str, Table]:
    """By name."""
    schema = json_schema()
    named = {"vehicle": "FileHead", "provenance": "Made", "estimated": "Estimated"} | {
        f"axis_{name}": f"_{name.capitalize()}" for name in AXES
    }
    named |= {name.lower(): name for name in ("Validity", "Body", "Arm", "Curve", "Thruster")}
    categories = [("category", "what"), ("---",) * 2, *((f"`{name}`", words) for name, words in LOG_CATEGORIES.items())]
    found = {"log_categories": categories, "terminals": _terminals(), "file": _table(schema, schema)}
    return found | {name: _table(schema["$defs"][of], schema) for name, of in named.items()}


def markdown(table: Table) -> str:
    """As a page has it."""
    return "\n".join(f"| {' | '.join(row)} |" for row in table)


def filled(page: str) -> str:
    """The text of a page with its tables as they are to be."""
    found = tables()

    def text(match: re.Match[str]) -> str:
        return f"{match[1]}\n\n{markdown(found[match[2]])}\n\n"

    return re.sub(r"(<!-- table: (\w+) -->)\n.*?(?=<!-- end -->)", text, page, flags=re.DOTALL)


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
        found = schema["$defs"][entry["$ref"].removeprefix("#/$defs/")] if "$ref" in entry else entry
        of_value = found.get("properties", {}).get("value")
        unit = found["properties"].get("unit", {}).get("const", "") if of_value else ""
        needed = "needed" if key in table.get("required", ()) else ""
        words = found.get("description", "").replace("\n", " ").replace("|", r"\|")
        rows.append((f"`{key}`", needed, unit, _allowed(of_value or found), words))
    return [("key", "", "unit", "allowed", "what"), ("---",) * 5, *rows]


def _allowed(entry: dict[str, Any]) -> str:
    if "minimum" in entry and "maximum" in entry:
        return f"{number(entry['minimum'], 6)}\xa0…\xa0{number(entry['maximum'], 6)}"
    if choices := entry.get("enum", [entry["const"]] if "const" in entry else []):
        return ", ".join(f"`{choice}`" for choice in choices)
    if entry.get("minItems") == entry.get("maxItems", 0):
        return f"{entry['minItems']} numbers"
    return _TYPES.get(entry.get("type", ""), "number")


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
