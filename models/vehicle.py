"""Vehicle file (TOML) to `Vehicle`, checked: every number has its unit and source, and lies within its bounds."""

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

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
    alternatives: Mapping[str, Mapping[str, float]]
    """Coefficients published beside the ones used, by name of the alternative."""
    data: Path | None
    """The folder with the published tables."""


def load_vehicle(path: Path) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise VehicleFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise VehicleFileError(f"{path}: not UTF-8 text, at byte {error.start}") from error
    except tomllib.TOMLDecodeError as error:
        raise VehicleFileError(f"{path}: not TOML: {error}") from error
    try:
        checked = _File.model_validate(document)
    except ValidationError as error:
        raise VehicleFileError(f"{path}: {_first_line(error)}") from error
    head, low, high = checked.vehicle, checked.validity.command_min, checked.validity.command_max
    if low >= high:
        raise VehicleFileError(f"{path}: validity.command_min = {low}: must be less than command_max = {high}")
    data = path.parent / head.data if head.data else None
    if data and not data.is_dir():
        raise VehicleFileError(f"{path}: vehicle.data = {head.data!r}: there is no folder {data}")
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
        alternatives={name: a.values() for name, a in checked.alternatives.items()},
        data=data,
    )


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _Quantity(_Strict):
    value: Annotated[float, Field(allow_inf_nan=False)]
    unit: str
    source: Annotated[str, Field(min_length=1)]


def _within(meta: Meta) -> Any:
    """A quantity in the unit and within the bounds of its coefficient."""

    def check(q: _Quantity) -> _Quantity:
        if q.unit != meta.unit:
            raise ValueError(f"unit {q.unit!r} must be {meta.unit!r}")
        if not meta.minimum <= q.value <= meta.maximum:
            raise ValueError(f"value {q.value!r} must be within {meta.minimum:g} ... {meta.maximum:g} {meta.unit}")
        return q

    return Annotated[_Quantity, AfterValidator(check)]


_REQUIRED: dict[str, Any] = {name: (_within(meta), ...) for name, meta in COEFFICIENTS.items()}
_OPTIONAL: dict[str, Any] = {name: (_within(meta) | None, None) for name, meta in COEFFICIENTS.items()}
_Coefficients = create_model("_Coefficients", __base__=_Strict, **_REQUIRED)
_Some = create_model("_Some", __base__=_Strict, **_OPTIONAL)


class _Alternative(_Some):  # type: ignore[misc, valid-type]
    description: str

    def values(self) -> dict[str, float]:
        return {n: q.value for n in COEFFICIENTS if (q := getattr(self, n)) is not None}


def _identifier(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", text):
        raise ValueError("must be a C identifier: letters, digits and underscores, no digit first")
    return text


_Text = Annotated[str, Field(min_length=1)]
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


def _first_line(error: ValidationError) -> str:
    """The first problem of the file in one line: key, value, what is allowed."""
    problem = error.errors()[0]
    key = ".".join(map(str, problem["loc"]))
    if problem["type"] == "missing":
        return f"{key}: this key is missing"
    if problem["type"] == "extra_forbidden":
        return f"{key}: there is no such key"
    reason = problem["msg"].removeprefix("Value error, ")
    value = problem["input"]
    return f"{key}: {reason}" if isinstance(value, BaseModel) else f"{key} = {value!r}: {reason}"
