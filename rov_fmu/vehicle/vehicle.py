"""Vehicle file (TOML) to `Vehicle`, checked: every number has its unit and source, and lies within its bounds."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, create_model

from rov_fmu.files.messages import FileError
from rov_fmu.files.output import is_same
from rov_fmu.files.places import FMU_SRC
from rov_fmu.files.toml_file import Strict, beside, pair, read_checked
from rov_fmu.motion.layout import Layout, Meta
from rov_fmu.motion.rov import Rov
from rov_fmu.vehicle.paper import PAPER

TABLES = {
    "heave": ("table6_heave_response.csv", "table3_heave_steady.csv"),
    "yaw": ("table7_yaw_response.csv", "table5_yaw_steady.csv"),
    "surge": ("table8_surge_response.csv", "table4_surge_steady.csv"),
}
"""Files of published tables in the data folder, by axis: responses, and measured steady velocities."""
PICTURES = ("model.png", "from_above.svg", "from_starboard.svg")
"""Files in the folder of pictures."""


class VehicleFileError(FileError):
    """A vehicle file that cannot be used: a line a mistake with file, key, value and what is allowed."""


@dataclass(frozen=True)
class Provenance:
    """What made a vehicle file, how, and from which files."""

    tool: str
    method: str
    inputs: Mapping[str, str]
    """SHA-256 of every input file, by its name."""
    warnings: tuple[str, ...] = ()
    """What is not identifiable from the data, and what speaks against the model, in words."""
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
    rov: Rov
    """What it has, and its coefficients."""
    sources: Mapping[str, str]
    """Where each coefficient comes from."""
    command_range: tuple[float, float]
    """Thruster commands over which the model was identified."""
    alternatives: Mapping[str, "Alternative"]
    """Coefficients published beside the ones used."""
    data: Path | None
    """The folder with the published tables."""
    pictures: Path | None = None
    """The folder with the vehicle's own PICTURES, each if it has one."""
    limits: tuple[str, ...] = ()
    """What was found of the vehicle that the model leaves out, in sentences."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """95 % confidence intervals of the coefficients that have one."""
    provenance: Provenance | None = None

    @property
    def layout(self) -> Layout:
        """What it has."""
        return self.rov.layout

    @property
    def files(self) -> list[Path]:
        """Every file that is read beside the vehicle file."""
        report = self.provenance.report if self.provenance else None
        tables = [self.data / name for names in TABLES.values() for name in names] if self.data else []
        pictures = [self.pictures / name for name in PICTURES] if self.pictures else []
        return [path for path in (*tables, *pictures, report) if path and path.is_file()]

    def picture(self, name: str) -> Path:
        """The vehicle's own picture of this name, or the neutral one."""
        own = self.pictures / name if self.pictures else None
        return own if own and own.is_file() else FMU_SRC / "pictures" / name


def load_vehicle(path: Path, *, coming: Path | None = None) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError. A report that is coming need not be there yet."""
    checked = read_checked(Path(path), _File, VehicleFileError, coming=coming)
    head = checked.vehicle
    quantities: dict[str, Quantity] = {name: getattr(checked.coefficients, name) for name in PAPER.coefficients}
    return Vehicle(
        **{key: getattr(head, key) for key in Head.model_fields},
        rov=Rov(PAPER, {name: q.value for name, q in quantities.items()}),
        sources={name: q.source for name, q in quantities.items()},
        command_range=checked.validity.command_range,
        alternatives=checked.alternatives,
        data=path.parent / head.data if head.data else None,
        pictures=path.parent / head.pictures if head.pictures else None,
        limits=checked.validity.limits,
        intervals={name: q.interval for name, q in quantities.items() if q.interval},
        provenance=checked.provenance.plain(path.parent) if checked.provenance else None,
    )


def _printable(text: str) -> str:
    if found := re.search(r"[^\n\t -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", text):
        raise ValueError(f"must be without the control character {found[0]!a}")
    return text


_Text = Annotated[str, Field(min_length=1, max_length=10_000), AfterValidator(_printable)]
_Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\n\t]*$"), AfterValidator(_printable)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


Interval = Annotated[tuple[Finite, Finite], BeforeValidator(pair)]
"""[low, high] in a TOML file."""


def _encloses(interval: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
    if not interval[0] <= (value := info.data.get("value", interval[0])) <= interval[1]:
        raise ValueError(f"must be [low, high] around the value {value}")
    return interval


class Quantity(Strict):
    """The value of a coefficient, and its 95 % confidence interval if it has one."""

    value: float
    unit: str
    source: _Text
    interval: Annotated[Interval, AfterValidator(_encloses)] | None = None


def _quantity(name: str, meta: Meta) -> Any:
    """A quantity in the unit and within the bounds of its coefficient."""

    def within(value: float) -> float:
        if not meta.minimum <= value <= meta.maximum:
            raise ValueError(f"must be within {meta.minimum:g} ... {meta.maximum:.12g} {meta.unit}")
        return value

    fields: dict[str, Any] = {
        "value": (Annotated[Finite, AfterValidator(within)], ...),
        "unit": (Literal[meta.unit], ...),
    }
    return create_model(name, __base__=Quantity, **fields)


QUANTITIES = {name: _quantity(name, meta) for name, meta in PAPER.coefficients.items()}
_REQUIRED: dict[str, Any] = {name: (q, ...) for name, q in QUANTITIES.items()}
_OPTIONAL: dict[str, Any] = {name: (q | None, None) for name, q in QUANTITIES.items()}
_Coefficients = create_model("_Coefficients", __base__=Strict, **_REQUIRED)
_Some = create_model("_Some", __base__=Strict, **_OPTIONAL)


class Alternative(_Some):  # type: ignore[misc, valid-type]
    """Some coefficients that may stand in for the ones used."""

    description: _Text

    @property
    def values(self) -> Mapping[str, float]:
        """By name."""
        return {n: q.value for n in PAPER.coefficients if (q := getattr(self, n)) is not None}


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


def _folder(name: str, info: ValidationInfo) -> str:
    if not os.path.isdir(beside(name, info)):  # noqa: PTH112 (Path.is_dir raises on names that cannot be)
        raise ValueError("there is no such folder beside the file")
    return name


_Folder = Annotated[str, AfterValidator(_folder)]


class _FileHead(Head):
    data: _Folder | None = None
    pictures: _Folder | None = None


def _below(low: float, info: ValidationInfo) -> float:
    if low >= (high := info.data.get("command_max", inf)):
        raise ValueError(f"must be less than command_max = {high}")
    return low


class Validity(Strict):
    """Thruster commands over which the model holds."""

    command_max: _Command
    command_min: Annotated[_Command, AfterValidator(_below)]
    limits: Annotated[tuple[_Text, ...], BeforeValidator(pair)] = ()

    @property
    def command_range(self) -> tuple[float, float]:
        """From the weakest to the strongest."""
        return self.command_min, self.command_max


def _report(name: str, info: ValidationInfo) -> str:
    path, coming = beside(name, info), (info.context or {})["coming"]
    if not (os.path.isfile(path) or (coming and is_same(path, coming))):  # noqa: PTH113 (as above)
        raise ValueError("there is no such file beside this one")
    return name


class _Provenance(Strict):
    tool: _Text
    method: _Text
    inputs: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    warnings: Annotated[tuple[_Text, ...], BeforeValidator(pair)] = ()
    report: Annotated[_Text, AfterValidator(_report)] | None = None

    def plain(self, folder: Path) -> Provenance:
        return Provenance(**dict(self) | {"report": folder / self.report if self.report else None})


class _File(Strict):
    vehicle: _FileHead
    validity: Validity
    coefficients: _Coefficients  # type: ignore[valid-type]
    alternatives: dict[str, Alternative] = Field(default={})
    provenance: _Provenance | None = None
