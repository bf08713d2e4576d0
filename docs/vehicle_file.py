"""The tables and keys of the vehicle file, as its schema has them: the tables of vehicle-file.md."""

from typing import Any

from rov_fmu.motion.layout import AXES
from rov_fmu.pages.templates import number
from rov_fmu.vehicle.json_schema import json_schema

Table = list[tuple[str, ...]]

_TYPES = {"string": "text", "boolean": "true, false", "integer": "whole number", "object": "table", "array": "list"}


def tables() -> dict[str, Table]:
    """By name."""
    schema = json_schema()
    named = {"vehicle": "FileHead", "provenance": "Made"} | {f"axis_{name}": f"_{name.capitalize()}" for name in AXES}
    named |= {name.lower(): name for name in ("Validity", "Body", "Arm", "Curve", "Thruster")}
    return {"file": _table(schema, schema)} | {name: _table(schema["$defs"][of], schema) for name, of in named.items()}


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
