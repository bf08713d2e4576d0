"""Vehicle file (TOML) to `Vehicle`, checked: every number has its unit and source, and lies within its bounds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rov_fmu.files.kinds import VEHICLE_FILE, check_keys
from rov_fmu.files.messages import FileError, lines_on
from rov_fmu.files.toml_file import Toml, check, read_toml, told
from rov_fmu.motion.layout import Layout
from rov_fmu.motion.rov import Rov
from rov_fmu.vehicle.first import FirstFile, quantities
from rov_fmu.vehicle.form import PICTURES, TABLES, Head
from rov_fmu.vehicle.paper import PAPER, PAPER_SOURCES
from rov_fmu.vehicle.quantity import Quantity
from rov_fmu.vehicle.schema import FORMAT, NOT_GIVEN, UNTUNED, Estimated, File, Parts
from rov_fmu.vehicle.sense import as_far_as_readable, no_thrust, nonsense

if TYPE_CHECKING:
    from rov_fmu.vehicle.uncertainty import Uncertainty

_SECOND = {"format", "body", "arm", "curves", "thruster", "axes", "inputs"}
"""Keys that tell the second version of the file."""


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
class Alternative:
    """Some coefficients that may stand in for the ones used."""

    description: str
    values: Mapping[str, float]
    """By name."""
    sources: Mapping[str, str]


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
    alternatives: Mapping[str, Alternative]
    """Coefficients published beside the ones used."""
    data: Path | None
    """The folder with the published tables."""
    pictures: Path | None = None
    """The folder with the vehicle's own PICTURES, each if it has one."""
    limits: tuple[str, ...] = ()
    """What was found of the vehicle that the model leaves out, in sentences."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """95 % confidence intervals of the coefficients that have one."""
    estimates: Mapping[str, Estimated] = field(default_factory=dict)
    """How far those that tests tell hang together, by name."""
    provenance: Provenance | None = None
    thruster_sources: Mapping[str, Mapping[str, str]] = field(default_factory=lambda: PAPER_SOURCES)
    """Where `direction` and `position` of each thruster come from, by its name."""

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

    @property
    def uncertainty(self) -> "Uncertainty":
        """How well its coefficients are known, and how far they hang together."""
        from rov_fmu.vehicle.uncertainty import uncertainty  # NumPy and SciPy: few need it

        return uncertainty(self.rov, self.intervals, self.estimates)

    def picture(self, name: str) -> Path | None:
        """The vehicle's own picture of this name, if it has one."""
        own = self.pictures / name if self.pictures else None
        return own if own and own.is_file() else None


def load_vehicle(path: Path, *, coming: Path | None = None) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError. A report that is coming need not be there yet."""
    path = Path(path)
    data = read_toml(path, VehicleFileError)
    check_keys(path, data, VEHICLE_FILE, VehicleFileError)
    context = {"folder": path.parent, "coming": coming}
    if "format" in data or "coefficients" not in data:
        if not data.keys() & _SECOND:
            raise VehicleFileError(f"{path}: format: this key is missing: write format = {FORMAT}")
        return _second(path, data, context)
    first, problems = check(data, FirstFile, **context)
    if first is None:
        raise VehicleFileError(*lines_on(path, told(problems, data, FirstFile)))
    found = quantities(first.coefficients)
    values = {name: q.value for name, q in found.items()}
    if weak := [line for curve in PAPER.curves for line in no_thrust(curve, values, "coefficients")]:
        raise VehicleFileError(*(f"{path}: {line}" for line in weak))
    alternatives = {name: _alternative(a.description, quantities(a)) for name, a in first.alternatives.items()}
    return _vehicle(path, first, PAPER, found, alternatives)


def _second(path: Path, data: Toml, context: Mapping[str, object]) -> Vehicle:
    """The second version of the file."""
    file, problems = check(data, File, **context)
    mistakes = [*told(problems, data, File), *nonsense(*as_far_as_readable(data, problems, context, Parts), data)]
    if file is None or mistakes:
        raise VehicleFileError(*lines_on(path, mistakes))
    alternatives = {name: _alternative(a.description, a.quantities) for name, a in file.alternatives.items()}
    found = file.quantities(file.layout)
    return _vehicle(path, file, file.layout, found, alternatives, file.thruster_sources, file.estimates)


def _alternative(description: str, found: Mapping[str, Quantity]) -> Alternative:
    values = {name: q.value for name, q in found.items()}
    return Alternative(description, values, {name: q.source for name, q in found.items()})


def _vehicle(
    path: Path,
    file: FirstFile | File,
    layout: Layout,
    found: Mapping[str, Quantity | None],
    alternatives: Mapping[str, Alternative],
    thruster_sources: Mapping[str, Mapping[str, str]] = PAPER_SOURCES,
    estimates: Mapping[str, Estimated] | None = None,
) -> Vehicle:
    head, made = file.vehicle, file.provenance
    folders = head.folders_from(path.parent)
    words = {key: getattr(made, key) for key in ("tool", "method", "inputs", "warnings")} if made else {}
    return Vehicle(
        **{key: getattr(head, key) for key in Head.model_fields},
        rov=Rov(layout, {name: q.value if q else UNTUNED for name, q in found.items()}),
        sources={name: q.source if q else NOT_GIVEN for name, q in found.items()},
        command_range=file.validity.command_range,
        alternatives=alternatives,
        data=folders["data"],
        pictures=folders["pictures"],
        limits=file.validity.limits,
        intervals={name: q.interval for name, q in found.items() if q and q.interval},
        estimates=estimates or {},
        provenance=Provenance(**words, report=made.report_in(path.parent)) if made else None,
        thruster_sources=thruster_sources,
    )
