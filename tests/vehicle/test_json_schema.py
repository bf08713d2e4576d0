"""The JSON schema of the vehicle file, which editors read."""

import json
from typing import Any

import pytest

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import AXES as AXIS_KINDS
from rov_fmu.equation.catalogue import AXIS, BODY, CURVE, RESTORING, TUNING, declarations_of
from rov_fmu.io.paths import MODELS
from rov_fmu.vehicle.json_schema import json_schema

KEPT = MODELS / "vehicle.schema.json"


def test_the_file_in_the_repository_is_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert capsys.readouterr().out == KEPT.read_text(encoding="utf-8")


def test_it_has_every_kind_of_coefficient_with_unit_and_bounds() -> None:
    tables: dict[str, Any] = json_schema()["$defs"]
    kinds = {
        "Body": BODY | RESTORING,
        "Curve": {key: kind.filled(curve="", equation="") for key, kind in CURVE.items()},
        **{f"_{axis.name.capitalize()}": declarations_of(axis) for axis in AXIS_KINDS.values()},
    }
    assert {*kinds["_Yaw"]} == {*AXIS, *TUNING}
    for table, declarations in kinds.items():
        for key, declaration in declarations.items():
            entry = tables[tables[table]["properties"][key]["$ref"].removeprefix("#/$defs/")]
            value, unit = (entry["properties"][name] for name in ("value", "unit"))
            assert (value["minimum"], value["maximum"], unit["const"]) == (
                declaration.minimum,
                declaration.maximum,
                declaration.unit,
            )
            assert {"value", "unit", "source"} <= set(entry["required"])


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


def test_it_is_plain_json() -> None:
    text = KEPT.read_text(encoding="utf-8")
    assert json.loads(text) == json_schema()
    assert "null" not in text
