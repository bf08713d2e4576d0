"""The JSON schemas of the vehicle file and of other TOML files, for editors and for the reference page."""

import json
from typing import Any

from rov_fmu.io.toml_file import Strict
from rov_fmu.vehicle.schema import WholeFile

_NULL = {"type": "null"}


def json_schema(of: type[Strict] = WholeFile) -> dict[str, Any]:
    """Return the schema of a TOML file."""
    schema: dict[str, Any] = _simplified(of.model_json_schema())
    return schema


def json_schema_text() -> str:
    """Return the schema of the vehicle file as the text of a file."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


def _is_left_out(key: str, value: Any) -> bool:
    """Return True for an empty default and for the title of a part of a schema, but not for a key called title."""
    return (key == "title" and isinstance(value, str)) or (key == "default" and not value)


def _simplified(node: Any) -> Any:
    """Return a part of a schema in a form that does not depend on the version of pydantic.

    It has no null, which TOML does not have, no titles and no empty defaults.
    """
    if isinstance(node, list):
        return [*map(_simplified, node)]
    if not isinstance(node, dict):
        return node
    simple = {key: _simplified(value) for key, value in node.items() if not _is_left_out(key, value)}
    choices = [choice for key in ("allOf", "anyOf") for choice in simple.pop(key, []) if choice != _NULL]
    if len(choices) > 1:
        simple["anyOf"] = choices
    elif choices:
        simple |= choices[0]
    if "const" in simple:
        simple.pop("enum", None)
    return {"$ref": simple["$ref"]} if "$ref" in simple else simple
