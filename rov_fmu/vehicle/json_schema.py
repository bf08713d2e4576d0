"""JSON schema of the vehicle file: for editors, and for its reference page, as that of other files."""

import json
from typing import Any

from rov_fmu.io.toml_file import Strict
from rov_fmu.vehicle.schema import File

_NULL = {"type": "null"}


def json_schema(of: type[Strict] = File) -> dict[str, Any]:
    """The schema."""
    found: dict[str, Any] = _plain(of.model_json_schema())
    return found


def json_schema_text() -> str:
    """The schema as a file."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


def _plain(node: Any) -> Any:
    """As every version of pydantic could say it: without null, which TOML has not, titles and empty defaults."""
    if isinstance(node, list):
        return [*map(_plain, node)]
    if not isinstance(node, dict):
        return node
    plain = {key: _plain(value) for key, value in node.items() if key != "title" and (key != "default" or value)}
    choices = [choice for key in ("allOf", "anyOf") for choice in plain.pop(key, []) if choice != _NULL]
    if len(choices) > 1:
        plain["anyOf"] = choices
    elif choices:
        plain |= choices[0]
    if "const" in plain:
        plain.pop("enum", None)
    return {"$ref": plain["$ref"]} if "$ref" in plain else plain
