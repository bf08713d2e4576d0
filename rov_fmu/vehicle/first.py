"""The first version of the vehicle file: the paper's vehicle, its coefficients in one table."""

from typing import Any

from pydantic import Field

from rov_fmu.files.toml_file import Strict, table_of
from rov_fmu.vehicle.form import FileHead, Made, Validity
from rov_fmu.vehicle.paper import PAPER
from rov_fmu.vehicle.quantity import Quantity, Text, quantity

QUANTITIES = {name: quantity(name, meta) for name, meta in PAPER.coefficients.items()}
_REQUIRED: dict[str, Any] = {name: (q, ...) for name, q in QUANTITIES.items()}
_OPTIONAL: dict[str, Any] = {name: (q | None, None) for name, q in QUANTITIES.items()}
_All = table_of("_All", Strict, _REQUIRED)
_Some = table_of("_Some", Strict, _OPTIONAL)


def quantities(table: Strict) -> dict[str, Quantity]:
    """Those that a table of the file gives, by name."""
    return {name: q for name in QUANTITIES if (q := getattr(table, name)) is not None}


class FirstAlternative(_Some):  # type: ignore[misc, valid-type]
    """Some coefficients that may stand in for the ones used."""

    description: Text


class FirstFile(Strict):
    """The first version of the file."""

    vehicle: FileHead
    validity: Validity
    coefficients: _All  # type: ignore[valid-type]
    alternatives: dict[str, FirstAlternative] = Field(default={})
    provenance: Made | None = None
