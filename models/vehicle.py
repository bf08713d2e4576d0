"""Vehicle file (TOML) to `Vehicle`, checked: every number has its unit and source, and lies within its bounds."""

import os
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, create_model

from .dynamics import COEFFICIENTS, Coefficients, Meta

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

VIDEORAY = Path(__file__).with_name("videoray.toml")


class VehicleFileError(ValueError):
    """A vehicle file that cannot be used: one line with file, key, value and what is allowed."""


@dataclass(frozen=True)
class Alternative:
    """Some coefficients that may stand in for the ones used."""

    description: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Vehicle:
    """An identified ROV."""

    name: str
    identifier: str
    """A C identifier: modelIdentifier and modelName of the FMU."""
    version: str
    description: str
    source: str
    coefficients: Coefficients
    sources: Mapping[str, str]
    """Where each coefficient comes from."""
    command_range: tuple[float, float]
    """Thruster commands over which the model was identified."""
    alternatives: Mapping[str, "Alternative"]
    """Coefficients published beside the ones used."""
    data: Path | None
    """The folder with the published tables."""


def load_vehicle(path: Path) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError."""
    document = _read_toml(path)
    try:
        checked = _File.model_validate(document)
    except ValidationError as error:
        raise VehicleFileError(f"{path}: {_first_problem(error)}") from error
    head, low, high = checked.vehicle, checked.validity.command_min, checked.validity.command_max
    if low >= high:
        raise VehicleFileError(f"{path}: validity.command_min = {low}: must be less than command_max = {high}")
    data = path.parent / head.data if head.data else None
    if data and not os.path.isdir(data):  # noqa: PTH112 (Path.is_dir raises on names that cannot be)
        raise VehicleFileError(f"{path}: vehicle.data = {_shown(head.data)}: there is no such folder beside the file")
    quantities: dict[str, _Quantity] = {name: getattr(checked.coefficients, name) for name in COEFFICIENTS}
    return Vehicle(
        name=head.name,
        identifier=head.identifier,
        version=head.version,
        description=head.description,
        source=head.source,
        coefficients=Coefficients(**{name: q.value for name, q in quantities.items()}),
        sources={name: q.source for name, q in quantities.items()},
        command_range=(low, high),
        alternatives={name: a.plain() for name, a in checked.alternatives.items()},
        data=data,
    )


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise VehicleFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise VehicleFileError(f"{path}: not UTF-8 text, at byte {error.start}") from error
    except (ValueError, RecursionError) as error:
        raise VehicleFileError(f"{path}: not TOML: {_on_one_line(str(error))}") from error


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Text = Annotated[str, Field(min_length=1)]


class _Quantity(_Strict):
    value: float
    unit: str
    source: _Text


def _quantity(name: str, meta: Meta) -> Any:
    """A quantity in the unit and within the bounds of its coefficient."""

    def within(value: float) -> float:
        if not meta.minimum <= value <= meta.maximum:
            raise ValueError(f"must be within {meta.minimum:g} ... {meta.maximum:g} {meta.unit}")
        return value

    fields: dict[str, Any] = {
        "value": (Annotated[float, Field(allow_inf_nan=False), AfterValidator(within)], ...),
        "unit": (Literal[meta.unit], ...),
    }
    return create_model(name, __base__=_Quantity, **fields)


_QUANTITIES = {name: _quantity(name, meta) for name, meta in COEFFICIENTS.items()}
_REQUIRED: dict[str, Any] = {name: (q, ...) for name, q in _QUANTITIES.items()}
_OPTIONAL: dict[str, Any] = {name: (q | None, None) for name, q in _QUANTITIES.items()}
_Coefficients = create_model("_Coefficients", __base__=_Strict, **_REQUIRED)
_Some = create_model("_Some", __base__=_Strict, **_OPTIONAL)


class _Alternative(_Some):  # type: ignore[misc, valid-type]
    description: str

    def plain(self) -> Alternative:
        values = {n: q.value for n in COEFFICIENTS if (q := getattr(self, n)) is not None}
        return Alternative(self.description, values)


def _identifier(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", text):
        raise ValueError("must be a C identifier: letters, digits and underscores, no digit first")
    return text


_Command = Annotated[float, Field(ge=0.0, le=1.0)]


class _Head(_Strict):
    name: _Text
    identifier: Annotated[str, AfterValidator(_identifier)]
    version: _Text
    description: _Text
    source: _Text
    data: str | None = None


class _Validity(_Strict):
    command_min: _Command
    command_max: _Command


class _File(_Strict):
    vehicle: _Head
    validity: _Validity
    coefficients: _Coefficients  # type: ignore[valid-type]
    alternatives: dict[str, _Alternative] = {}


def _first_problem(error: ValidationError) -> str:
    """The first problem of the file in one line: key, value, what is allowed."""
    problem = error.errors()[0]
    key = _on_one_line(".".join(map(str, problem["loc"])))
    match problem["type"]:
        case "missing":
            return f"{key}: this key is missing"
        case "extra_forbidden":
            return f"{key}: there is no such key"
        case "model_type":
            return f"{key} = {_shown(problem['input'])}: must be a table of keys and values"
    reason = problem["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    return f"{key} = {_shown(problem['input'])}: {reason}"


def _shown(value: object) -> str:
    return _on_one_line(repr(value))


def _on_one_line(text: str) -> str:
    """Text for a message: no line breaks or other control characters, and not endless."""
    clean = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    return clean if len(clean) <= 80 else f"{clean[:77]}..."
