"""The JSON schema of the vehicle file, which editors read."""

from typing import Any

import pytest

from rov_fmu.cli import main
from rov_fmu.io.paths import MODELS
from rov_fmu.vehicle.json_schema import json_schema

KEPT = MODELS / "vehicle.schema.json"


def test_the_file_in_the_repository_is_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert capsys.readouterr().out == KEPT.read_text(encoding="utf-8")


def test_every_key_has_a_description() -> None:
    """Editors show it for the key at the cursor."""
    schema = json_schema()

    def described(node: dict[str, Any]) -> bool:
        target = schema["$defs"][node["$ref"].removeprefix("#/$defs/")] if "$ref" in node else node
        return bool(target.get("description"))

    assert schema["description"]
    for table in (schema, *schema["$defs"].values()):
        for key, entry in table["properties"].items():
            assert described(entry) or key in ("value", "unit"), f"{table['description']} {key}"
