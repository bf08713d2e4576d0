"""Vehicle file (TOML) to `Vehicle`, checked: every number has its unit and source, and lies within its bounds."""

import os
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import ErrorDetails

from rov_fmu.files.messages import FileError, brief, shown
from rov_fmu.files.output import is_same
from rov_fmu.files.places import FMU_SRC
from rov_fmu.motion.rov import COEFFICIENTS, Coefficients, Meta

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class VehicleFileError(FileError):
    """A vehicle file that cannot be used: one line with file, key, value and what is allowed."""


@dataclass(frozen=True)
class Alternative:
    """Some coefficients that may stand in for the ones used."""

    description: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Provenance:
    """What made a vehicle file, how, and from which files."""

    tool: str
    method: str
    inputs: Mapping[str, str]
    """SHA-256 of every input file, by its name."""
    warnings: tuple[str, ...] = ()
    """What the data do not determine, in words."""
    report: Path | None = None
    """The page on the identification."""


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
    pictures: Path | None = None
    """The folder with the vehicle's own model.png, from_above.svg, from_starboard.svg, each if it has one."""
    limits: tuple[str, ...] = ()
    """What was found of the vehicle that the model leaves out, in sentences."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """95 % confidence intervals of the coefficients that have one."""
    provenance: Provenance | None = None

    @property
    def files(self) -> list[Path]:
        """Every file that the vehicle file names."""
        report = self.provenance.report if self.provenance else None
        folders = filter(None, (self.data, self.pictures))
        return [*(path for folder in folders for path in folder.glob("*")), *filter(None, (report,))]

    def picture(self, name: str) -> Path:
        """The vehicle's own picture of this name, or the neutral one."""
        own = self.pictures / name if self.pictures else None
        return own if own and own.is_file() else FMU_SRC / "pictures" / name


class Strict(BaseModel):
    """A table of a TOML file: no keys but these, no number in quotes."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


Checked = TypeVar("Checked", bound=Strict)


def load_vehicle(path: Path, *, coming: Path | None = None) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError. A report that is coming need not be there yet."""
    checked = read_checked(path, _File)
    head, low, high = checked.vehicle, checked.validity.command_min, checked.validity.command_max
    wrong = []
    if low >= high:
        wrong.append(f"{path}: validity.command_min = {low}: must be less than command_max = {high}")
    folders = {key: path.parent / name if (name := getattr(head, key)) else None for key in ("data", "pictures")}
    wrong += [
        f"{path}: vehicle.{key} = {shown(getattr(head, key))}: there is no such folder beside the file"
        for key, folder in folders.items()
        if folder and not os.path.isdir(folder)  # noqa: PTH112 (Path.is_dir raises on names that cannot be)
    ]
    named = checked.provenance.report if checked.provenance else None
    report = path.parent / named if named else None
    if report and not (os.path.isfile(report) or (coming and is_same(report, coming))):  # noqa: PTH113 (as above)
        wrong.append(f"{path}: provenance.report = {shown(named)}: there is no such file beside this one")
    if wrong:
        raise VehicleFileError(*wrong)
    quantities: dict[str, Quantity] = {name: getattr(checked.coefficients, name) for name in COEFFICIENTS}
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
        **folders,
        limits=checked.validity.limits,
        intervals={name: q.interval for name, q in quantities.items() if q.interval},
        provenance=Provenance(**dict(checked.provenance) | {"report": report}) if checked.provenance else None,
    )


def read_checked(path: Path, model: type[Checked]) -> Checked:
    """Read a TOML file of the given form. Raises VehicleFileError."""
    document = _read_toml(path)
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise VehicleFileError(*(f"{path}: {_problem(problem)}" for problem in error.errors())) from error


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise VehicleFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise VehicleFileError(f"{path}: not UTF-8 text, at byte {error.start}") from error
    except (ValueError, RecursionError) as error:
        raise VehicleFileError(f"{path}: not TOML: {brief(str(error))}") from error


def _printable(text: str) -> str:
    if found := re.search(r"[^\n\t -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", text):
        raise ValueError(f"must be without the control character {found[0]!a}")
    return text


_Text = Annotated[str, Field(min_length=1, max_length=10_000), AfterValidator(_printable)]
_Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\n\t]*$"), AfterValidator(_printable)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


def pair(value: object) -> object:
    """TOML knows lists, not tuples."""
    return tuple(value) if isinstance(value, list) else value


Interval = Annotated[tuple[Finite, Finite], BeforeValidator(pair)]
"""[low, high] in a TOML file."""


class Quantity(Strict):
    """The value of a coefficient, and its 95 % confidence interval if it has one."""

    value: float
    unit: str
    source: _Text
    interval: Interval | None = None

    @model_validator(mode="after")
    def _encloses(self) -> "Quantity":
        if self.interval and not self.interval[0] <= self.value <= self.interval[1]:
            raise ValueError("interval: must be [low, high] around the value")
        return self


def _quantity(name: str, meta: Meta) -> Any:
    """A quantity in the unit and within the bounds of its coefficient."""

    def within(value: float) -> float:
        if not meta.minimum <= value <= meta.maximum:
            raise ValueError(f"must be within {meta.minimum:g} ... {meta.maximum:g} {meta.unit}")
        return value

    fields: dict[str, Any] = {
        "value": (Annotated[Finite, AfterValidator(within)], ...),
        "unit": (Literal[meta.unit], ...),
    }
    return create_model(name, __base__=Quantity, **fields)


QUANTITIES = {name: _quantity(name, meta) for name, meta in COEFFICIENTS.items()}
_REQUIRED: dict[str, Any] = {name: (q, ...) for name, q in QUANTITIES.items()}
_OPTIONAL: dict[str, Any] = {name: (q | None, None) for name, q in QUANTITIES.items()}
_Coefficients = create_model("_Coefficients", __base__=Strict, **_REQUIRED)
_Some = create_model("_Some", __base__=Strict, **_OPTIONAL)


class _Alternative(_Some):  # type: ignore[misc, valid-type]
    description: _Text

    def plain(self) -> Alternative:
        values = {n: q.value for n in COEFFICIENTS if (q := getattr(self, n)) is not None}
        return Alternative(self.description, values)


def _identifier(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,99}", text):
        raise ValueError("must be a C identifier: at most 100 letters, digits and underscores, no digit first")
    return text


_Command = Annotated[float, Field(ge=0.0, le=1.0)]


class Head(Strict):
    """What a vehicle is called and where it comes from."""

    name: _Name
    identifier: Annotated[str, AfterValidator(_identifier)]
    version: _Name
    description: _Text
    source: _Text


class _FileHead(Head):
    data: str | None = None
    pictures: str | None = None


class Validity(Strict):
    """Thruster commands over which the model holds."""

    command_min: _Command
    command_max: _Command
    limits: Annotated[tuple[_Text, ...], BeforeValidator(pair)] = ()


class _Provenance(Strict):
    tool: _Text
    method: _Text
    inputs: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    warnings: Annotated[tuple[_Text, ...], BeforeValidator(pair)] = ()
    report: _Text | None = None


class _File(Strict):
    vehicle: _FileHead
    validity: Validity
    coefficients: _Coefficients  # type: ignore[valid-type]
    alternatives: dict[str, _Alternative] = {}
    provenance: _Provenance | None = None


def _problem(problem: ErrorDetails) -> str:
    """A problem of the file in one line: key, value, what is allowed."""
    key = brief(".".join(map(str, problem["loc"])))
    match problem["type"]:
        case "missing":
            return f"{key}: this key is missing"
        case "extra_forbidden":
            return f"{key}: there is no such key"
        case "model_type":
            return f"{key} = {shown(problem['input'])}: must be a table of keys and values"
    reason = problem["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    return f"{key} = {shown(problem['input'])}: {reason}"
