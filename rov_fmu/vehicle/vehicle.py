"""The class Vehicle, and reading and checking vehicle files (TOML)."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import isfinite, sin
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

from typing_extensions import Self

from rov_fmu.io.file_kinds import VEHICLE_FILE, check_keys
from rov_fmu.io.messages import FileError, InputError, did_you_mean, lines_on, one_line, shown
from rov_fmu.io.toml_file import key_line, problem_lines, read_toml, validate
from rov_fmu.model.layout import Layout
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.checks import check_parts, no_thrust, readable_parts
from rov_fmu.vehicle.description import PICTURES, TABLES
from rov_fmu.vehicle.geometry import check_mass, doubts
from rov_fmu.vehicle.quantity import within
from rov_fmu.vehicle.schema import FORMAT, NOT_GIVEN, UNTUNED, Estimated, File, Parts
from rov_fmu.vehicle.thrust_table import CurrentTable

if TYPE_CHECKING:
    from rov_fmu.vehicle.uncertainty import Uncertainty

BY_HAND = "set by hand"
"""The source of a coefficient that was set by `Vehicle.with_`."""


class VehicleFileError(FileError):
    """A vehicle file that cannot be used. Each mistake is a line with file, key, value and what is allowed."""


@dataclass(frozen=True)
class Provenance:
    """The tool that made a vehicle file, its method, and its input files."""

    tool: str
    method: str
    inputs: Mapping[str, str]
    """The SHA-256 of every input file, by file name."""
    warnings: tuple[str, ...] = ()
    """What the data do not determine, and what speaks against the model, in sentences."""
    facts: tuple[str, ...] = ()
    """What was found, and what was done with the data, in sentences."""
    verdicts: tuple[str, ...] = ()
    """Whether the model of each axis may be trusted, with the reasons."""
    errors: tuple[str, ...] = ()
    """The errors of predictions of unseen data."""
    tested: tuple[str, ...] = ()
    """The ranges of what was measured, such as `depth: 0.2 to 3.1 m`."""
    report: Path | None = None
    """The report on the identification."""
    data: str = field(default="measurements", compare=False)
    """What the vehicle was identified from, in words. A vehicle file has it in a comment only."""


@dataclass(frozen=True)
class Alternative:
    """A set of published coefficients that the model does not use."""

    description: str
    values: Mapping[str, float]
    """The coefficients by name."""
    sources: Mapping[str, str]
    """The sources of the coefficients by name."""


@dataclass(frozen=True, repr=False)
class Vehicle:
    """A vehicle: its model, and where its numbers come from."""

    name: str
    identifier: str
    """A C identifier, which becomes modelIdentifier and modelName of the FMU."""
    version: str
    description: str
    source: str
    rov: Rov
    """The model of the vehicle: its layout and its coefficients."""
    sources: Mapping[str, str]
    """The sources of the coefficients by name."""
    command_range: tuple[float, float]
    """The weakest and the strongest thruster command for which the model was identified."""
    alternatives: Mapping[str, Alternative]
    """Other sets of published coefficients, by a name for each set."""
    data: Path | None
    """The folder with the published tables."""
    pictures: Path | None = None
    """The folder with the vehicle's own PICTURES, any of which may be missing."""
    limits: tuple[str, ...] = ()
    """Known effects on the vehicle that the model leaves out, in sentences."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """The 95 % confidence intervals of identified coefficients, by name."""
    estimates: Mapping[str, Estimated] = field(default_factory=dict)
    """The standard errors and correlations of identified coefficients, by name."""
    provenance: Provenance | None = None
    voltage_source: str = ""
    """The source of the battery's voltage."""
    thrust_files: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    """The files of the thrust tables, by curve, in the order of the curve's tables."""
    electric_currents: Mapping[str, CurrentTable] = field(default_factory=dict)
    """The current of one thruster, by curve, for all curves or none."""
    thruster_sources: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """The sources of `direction` and `position`, by the name of the thruster."""

    def __repr__(self) -> str:
        """Return the name of the vehicle, its axes, its inputs, and the coefficients that were set by hand."""
        axes, inputs = ", ".join(self.layout.kinds), ", ".join(self.layout.commands)
        title = f"{type(self).__name__} {self.identifier}: {self.name}"
        return f"<{title}; axes {axes}; inputs {inputs}{self._by_hand('; ')}>"

    def with_(self, **coefficients: float) -> Self:
        """Return this vehicle with other values of some coefficients, in SI units: `vehicle.with_(a_d_u=10)`.

        Their source becomes "set by hand", which also appears in the FMU and on its page, and they have no confidence
        intervals. `vehicle.layout.coefficients` has the names, units and bounds.

        Raises InputError if the vehicle has no such coefficient, or cannot have the value.
        """
        values = {name: _number(name, value) for name, value in coefficients.items()}
        check_coefficients(self.layout, values)
        rov = self.rov.replaced(values)
        if mistake := next(_contradictions(rov), None):
            raise InputError(mistake)
        estimates = {}
        for name, estimated in self.estimates.items():
            if name not in values:
                kept = {other: r for other, r in estimated.correlation.items() if other not in values}
                estimates[name] = estimated.model_copy(update={"correlation": kept})
        return replace(
            self,
            rov=rov,
            sources={**self.sources, **dict.fromkeys(values, BY_HAND)},
            intervals={name: interval for name, interval in self.intervals.items() if name not in values},
            estimates=estimates,
        )

    @property
    def summary(self) -> str:
        """The description, followed by the coefficients that were set by hand."""
        return f"{self.description}{self._by_hand(' (', ')')}"

    def _by_hand(self, before: str, after: str = "") -> str:
        """Return the list of coefficients that were set by hand, or an empty text if there are none."""
        items = []
        for name, declaration in self.layout.coefficients.items():
            if self.sources[name] == BY_HAND:
                unit = "" if declaration.unit == "1" else f" {declaration.unit}"
                items.append(f"{name} = {self.rov[name]:.12g}{unit}")
        return f"{before}{BY_HAND}: {', '.join(items)}{after}" if items else ""

    @property
    def layout(self) -> Layout:
        """The axes, curves, thrusters and inputs of the vehicle."""
        return self.rov.layout

    @property
    def files(self) -> list[Path]:
        """The existing files that belong to the vehicle file: its tables, pictures and report."""
        report = self.provenance.report if self.provenance else None
        tables = [self.data / name for names in TABLES.values() for name in names] if self.data else []
        tables += [path for paths in self.thrust_files.values() for path in paths]
        tables += [table.path for table in self.electric_currents.values()]
        pictures = [self.pictures / name for name in PICTURES] if self.pictures else []
        return [path for path in (*tables, *pictures, report) if path and path.is_file()]

    @property
    def uncertainty(self) -> "Uncertainty":
        """The joint distribution of the coefficients that have a confidence interval."""
        from rov_fmu.vehicle.uncertainty import uncertainty  # NumPy and SciPy: few need it

        return uncertainty(self.rov, self.intervals, self.estimates)

    def picture(self, name: str) -> Path | None:
        """Return the path of the vehicle's own picture with this name, or None."""
        own = self.pictures / name if self.pictures else None
        return own if own and own.is_file() else None


def check_coefficients(layout: Layout, values: Mapping[str, float]) -> None:
    """Raise InputError about the first value that is out of its bounds or belongs to no coefficient of the vehicle."""
    for name, value in values.items():
        if name not in layout.coefficients:
            hint = did_you_mean(name, layout.coefficients)
            raise InputError(f"{name}: there is no such coefficient of this vehicle{hint}")
        try:
            within(value, layout.coefficients[name])
        except ValueError as error:
            raise InputError(f"{name} = {shown(value)}: {error}") from error


def _number(name: str, value: object) -> float:
    """Return a finite number as a float. Raises InputError."""
    if not isinstance(value, Real) or isinstance(value, bool) or not isfinite(value):
        raise InputError(f"{name} = {shown(value)}: must be a finite number")
    return float(value)


def _contradictions(rov: Rov) -> Iterator[str]:
    """Yield a line for each set of coefficients that are possible alone but not together."""
    for curve in (curve for curve in rov.layout.curves if not curve.tables):
        yield from no_thrust(curve, rov.coefficients, f"curve {curve.name}")
    if rov.layout.has_arm and rov["R"] * sin(rov["gamma"]) == 0.0:
        yield "R, gamma: must both be more than 0, because R sin γ is the arm of the thrusters"
    yield from check_mass(rov)


def load_vehicle(path: Path, *, coming: Path | None = None) -> Vehicle:
    """Read a vehicle file. Raises VehicleFileError, and warns about numbers that are probably wrong.

    `coming` is the path of a report that is about to be written, so it need not exist yet.
    """
    path = Path(path)
    data = read_toml(path, VehicleFileError)
    check_keys(path, data, VEHICLE_FILE, VehicleFileError)
    if "format" not in data:
        raise VehicleFileError(f"{path}: format: this key is missing: write format = {FORMAT}")
    if data["format"] != FORMAT:  # the rest of the file may have another meaning
        reason = f"must be {FORMAT}, the only version of the vehicle file"
        raise VehicleFileError(f"{path}: {key_line('format', reason, data['format'])}")
    context = {"folder": path.parent, "coming": coming}
    file, problems = validate(data, File, **context)
    mistakes = [
        *problem_lines(problems, data, File),
        *check_parts(*readable_parts(data, problems, context, Parts), data),
    ]
    if file is None or mistakes:
        raise VehicleFileError(*lines_on(path, mistakes))
    head, made, layout = file.vehicle, file.provenance, file.layout
    folders, found = head.folders_from(path.parent), file.quantities(layout)
    rov = Rov(layout, {name: q.value if q else UNTUNED for name, q in found.items()})
    if mistakes := [*check_mass(rov)]:
        raise VehicleFileError(*lines_on(path, mistakes))
    for doubt in doubts(rov):
        warnings.warn(one_line(f"{path}: {doubt}"), UserWarning, stacklevel=2)
    provenance = None
    if made:
        provenance = Provenance(
            made.tool,
            made.method,
            made.inputs,
            made.warnings,
            made.facts,
            made.verdicts,
            made.errors,
            made.tested,
            made.report_in(path.parent),
        )
    return Vehicle(
        name=head.name,
        identifier=head.identifier,
        version=head.version,
        description=head.description,
        source=head.source,
        rov=rov,
        sources={name: q.source if q else NOT_GIVEN for name, q in found.items()},
        command_range=file.validity.command_range,
        alternatives={
            name: Alternative(
                alternative.description,
                {coefficient: q.value for coefficient, q in alternative.quantities.items()},
                {coefficient: q.source for coefficient, q in alternative.quantities.items()},
            )
            for name, alternative in file.alternatives.items()
        },
        data=folders["data"],
        pictures=folders["pictures"],
        limits=file.validity.limits,
        intervals={name: q.interval for name, q in found.items() if q and q.interval},
        estimates=file.estimates,
        provenance=provenance,
        voltage_source=file.battery.voltage.source if file.battery else "",
        thrust_files={name: curve.thrust_files for name, curve in file.curves.items() if curve.thrust_files},
        electric_currents=file.electric_currents,
        thruster_sources=file.thruster_sources,
    )
