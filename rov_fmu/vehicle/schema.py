"""The pydantic models of the vehicle file, with every table and key.

`equation/catalogue.py` declares the coefficients.
"""

import os
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import replace
from functools import cached_property, reduce
from itertools import pairwise
from math import hypot
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, InstanceOf, ValidationInfo
from pydantic_core import ErrorDetails

from rov_fmu.equation import parts
from rov_fmu.equation.catalogue import (
    ARM,
    AXES,
    AXIS,
    BODY,
    COMMANDS,
    CURVE,
    FIN,
    LAGS,
    POINT,
    REPLACED_BY_TABLE,
    RESTORING,
    SURFACE,
    THRUSTER,
    Axis,
    Declaration,
    Lag,
    cross_of,
    declarations_of,
)
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import CommandTable, SourcedVector, Vector, VehicleAxis
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.paths import inside_or_shipped
from rov_fmu.io.toml_file import (
    DOCUMENTED,
    NOT_BLANK,
    TEXT_SCHEMA,
    Finite,
    Name,
    Strict,
    Symbol,
    Text,
    Toml,
    folder_of,
    numbers_schema,
    rule,
    table_model,
    validate,
)
from rov_fmu.vehicle.description import FileHead, Provenance, Validity
from rov_fmu.vehicle.quantity import CrossSymbol, Quantity, derivative, derivative_hint, quantity
from rov_fmu.vehicle.thrust_table import read_current, read_thrust

FORMAT = 2
UNTUNED = 1.0
"""The value of α and β, and of the health of a thruster, where the file does not give them."""
NOT_GIVEN = "not given"
"""Their source there."""
UNDETERMINED = "Assumed: the tests do not determine it"
"""The source of a coefficient that an identification needs, and that no test tells."""
MOST = 32
"""The largest number of thrusters, curves or inputs."""
_NONE: Mapping[str, Any] = MappingProxyType({})
_MOST_COEFFICIENTS = 1000
"""The largest number of coefficients in a table. The largest possible vehicle has fewer."""


def _coefficients(
    name: str,
    declarations: Mapping[str, Declaration],
    words: str = "",
    negative: Mapping[str, str] = _NONE,
    needed: bool = True,
    base: type[Strict] = Strict,
) -> Any:
    """Return a table with a key for each coefficient.

    Any may be missing if it depends on other tables which are `needed`. `negative` says, by the key, what to give
    instead of a negative value.
    """
    fields: dict[str, Any] = {}
    for key, declaration in declarations.items():
        one = quantity(f"{name}_{key}", declaration, negative.get(key, ""))
        is_required = needed and declaration.needed
        kind, default = (one, ...) if is_required else (one | None, None)
        fields[key] = (kind, Field(default, description=declaration.description))
    return table_model(f"_{name}", base, fields, words)


def to_fit(table: type[Strict]) -> Any:
    """Return a table of which any key may be missing, because tests tell it."""
    fields = table.model_fields.items()
    open_ = {key: (one.annotation | None, None) for key, one in fields if one.is_required()}  # type: ignore[operator]
    return table_model(table.__name__, table, open_, table.__doc__)


def given_quantities(table: Strict, declarations: Mapping[str, Declaration]) -> dict[str, Quantity]:
    """Return the coefficients that a table of the file gives, by key."""
    return {key: q for key in declarations if (q := getattr(table, key)) is not None}


def _coefficient_keys(table: Strict, declarations: Mapping[str, Declaration]) -> tuple[str, ...]:
    """Return the keys of the coefficients that the vehicle has: those that are required, and those that are given."""
    quantities = given_quantities(table, declarations)
    return tuple(key for key, kind in declarations.items() if key in quantities or kind.needed)


# ---- Body, arm, curves, axes -----------------------------------------------------------------------------------------


class Body(_coefficients("Body", BODY | RESTORING, needed=False)):  # type: ignore[misc]
    """Mass and moments of inertia, weight and buoyancy with their centres."""

    model_config = DOCUMENTED

    coupling: bool = False
    """True if the Coriolis and Munk terms of the mass matrix couple the axes: a vehicle that turns while it moves is
    pushed sideways. Set it for a vehicle that moves along several axes at once. Without roll and pitch, the vehicle
    needs surge, sway and yaw."""


_PULSES = (500.0, 2500.0)
"""The shortest and the longest pulse that a speed controller or servo understands, us."""
_CLOSEST = 10.0
"""The least distance of full reverse and of full thrust from neutral, us."""


def _pulses(given: object) -> tuple[float, ...]:
    """Return pulse widths as a tuple. Raises ValueError."""
    low, high = _PULSES
    numbers = given if isinstance(given, list) else []
    usable = [float(x) for x in numbers if type(x) in (int, float) and low <= x <= high]
    if not len(numbers) == len(usable) == 3 or any(b - a < _CLOSEST for a, b in pairwise(usable)):
        reason = f"three rising numbers within {low:g} ... {high:g} us and at least {_CLOSEST:g} us apart"
        raise ValueError(f"must be {reason}: full reverse, neutral, full thrust ahead")
    return tuple(usable)


class CommandsTable(_coefficients("Commands", COMMANDS)):  # type: ignore[misc]
    """The dead time and the form of the commands."""

    model_config = DOCUMENTED

    pulse: Annotated[tuple[float, float, float], BeforeValidator(_pulses), numbers_schema(3)] | None = None
    """Pulse widths of full reverse, neutral and full thrust ahead, µs: `[1100, 1500, 1900]`. With this key, the
    commands of the FMU are pulse widths."""


class Arm(_coefficients("Arm", ARM)):  # type: ignore[misc]
    """The arm R sin γ, (4), of the thrusters that have the key `arm`."""


_CURVE = {key: kind.filled(curve="curve", equation="", lag=LAGS["force"]) for key, kind in CURVE.items()}


def _file_read_by(read: Callable[[Path], object]) -> BeforeValidator:
    """Return the validator of the name of a CSV file beside the vehicle file, which it reads."""

    def read_file(name: object, info: ValidationInfo) -> object:
        if not isinstance(name, str):
            raise ValueError("must be text in quotes")
        path = inside_or_shipped(folder_of(info), name)
        if not os.path.isfile(path):  # noqa: PTH113 (Path.is_file raises an exception if the name is too long)
            raise ValueError("there is no such file beside the vehicle file")
        try:
            return read(path)
        except DataFileError as error:
            raise ValueError(str(error).splitlines()[0]) from error

    return BeforeValidator(read_file)


_Thrust = Annotated[InstanceOf[CommandTable], _file_read_by(read_thrust), TEXT_SCHEMA]
_Current = Annotated[InstanceOf[CommandTable], _file_read_by(read_current), TEXT_SCHEMA]


_Volts = Annotated[Finite, Field(ge=0.1, le=1000.0)]


class TableAtVoltage(Strict):
    """A table of thrust that was measured at a voltage."""

    voltage: _Volts
    """The voltage, V."""
    table: _Thrust
    """The name of the CSV file."""


class ElectricCurrent(Strict):
    """The electric current of one thruster: the `voltage` (V) at which it was measured, and the `table`, a CSV file
    with the columns `command [1]`, `[%]` or `[us]`, and `current [A]`. All curves have it, or none."""

    voltage: _Volts
    """The voltage, V."""
    table: _Current
    """The name of the CSV file."""


_RISING = rule(
    "must be at least two tables with rising voltages",
    lambda tables: len(tables) > 1 and all(low.voltage < high.voltage for low, high in pairwise(tables)),
)


class CurveTable(_coefficients("Curve", _CURVE, needed=False)):  # type: ignore[misc]
    """A thrust curve: a_t m² + b_t m, where m is the command beyond the dead band, or a measured table. In reverse the
    coefficients hold as ahead, unless the curve has its own there."""

    model_config = DOCUMENTED

    description: Name = ""
    """The thrusters with this curve, for example "rear pair"."""
    equation: Name = ""
    """Where the curve is published. A bare number, (9), is an equation of Enevoldsen et al. 2018."""
    together: Annotated[int, Field(ge=1, le=MOST)] = 1
    """Number of thrusters whose force together the curve describes, with a_t and b_t."""
    table: _Thrust | None = None
    """A CSV file with the columns `command [1]`, `[%]` or `[us]`, and `thrust [N]`, `[kgf]` or `[lbf]`. It replaces
    a_t, b_t and c_0."""
    tables: Annotated[list[TableAtVoltage], _RISING, Field(max_length=MOST)] | None = None
    """Tables at several voltages, which replace `table`."""
    lag: Lag = "force"
    """What follows the command with the time constant T: the force, or the speed n of the rotor, on which the force
    (a_t |n| + b_t) n and the loss d |n| depend."""

    electric_current: ElectricCurrent | None = None

    def for_model(self, name: str) -> parts.Curve:
        """Return the curve of the model."""
        keys, current = _coefficient_keys(self, CURVE), self.electric_current
        tables = {0: (0.0, self.table)} if self.table else {}
        tables = tables or {n: (row.voltage, row.table) for n, row in enumerate(self.tables or (), 1)}
        if tables:
            keys = ("k_t", *(key for key in keys if key not in ("k_t", *REPLACED_BY_TABLE)))
        return parts.Curve(
            name,
            keys,
            **{key: getattr(self, key) for key in ("description", "equation", "lag")},
            n_thrusters=self.together,
            tables=tuple(replace(t, name=f"{n}_{name}", voltage=voltage) for n, (voltage, t) in tables.items()),
            electric_current=replace(current.table, name=name, voltage=current.voltage) if current else None,
        )


_AXIS_DESCRIPTION = "Velocity {0.velocity} in {0.unit}, positive {0.positive}."
AXIS_TABLES = {
    axis.name: _coefficients(
        axis.name.capitalize(),
        declarations_of(axis),
        _AXIS_DESCRIPTION.format(axis),
        {key: f"; give -{derivative(key, axis)} as a positive {key}" for key in ("m_a", "a_d", "b_d")},
    )
    for axis in AXES.values()
}
_axes: dict[str, Any] = {name: (table | None, None) for name, table in AXIS_TABLES.items()}


class Axes(table_model("_Axes", Strict, _axes)):  # type: ignore[misc]
    """The axes that the vehicle has."""


# ---- Thrusters, fins, battery ----------------------------------------------------------------------------------------


_FARTHEST = 100.0
"""The largest coordinate of a position, m."""


def _vector(vector: object) -> object:
    """Return a list of three entries as a tuple. Raises ValueError."""
    if not isinstance(vector, list | tuple) or len(vector) != 3:
        raise ValueError("must be three numbers: forward, starboard, down")
    return tuple(vector)


def _unit_vector(direction: Vector) -> Vector:
    """Return a direction as a unit vector. Raises ValueError if its length is zero or extreme."""
    x, y, z = direction
    length = hypot(x, y, z)
    if not 1e-6 <= length <= 1e6:
        raise ValueError("must have a length, from 1e-6 to 1e6")
    if abs(length - 1.0) <= 1e-12:  # a unit vector stays as it is
        length = 1.0
    return x / length, y / length, z / length


_NEAR = rule(f"must be within -{_FARTHEST:g} ... {_FARTHEST:g} m", lambda at: max(map(abs, at)) <= _FARTHEST)
_Vector = Annotated[tuple[Finite, Finite, Finite], BeforeValidator(_vector), numbers_schema(3)]


class Direction(Strict):
    """The direction of the force at a positive command, or of a fin's lift ahead: forward, starboard, down. It has any
    length except zero."""

    value: Annotated[_Vector, AfterValidator(_unit_vector)]
    """Three numbers: forward, starboard, down."""
    source: Text
    """Where the value comes from."""


class Position(Strict):
    """The position from the origin of the body frame: forward, starboard, down. It is needed for roll, pitch and yaw,
    unless the thruster has the key `arm`, or only turns in yaw and acts straight up or down."""

    value: Annotated[_Vector, _NEAR]
    """Three numbers: forward, starboard, down."""
    unit: Literal["m"]
    source: Text
    """Where the value comes from."""


class ActuatorTable(Strict):
    """A thruster or a fin."""

    name: Symbol
    """The name in the FMU: the command is `u_<name>`, and the force of a thruster `F_<name>`."""
    description: Name = ""
    """For example "left thruster" or "rudder"."""
    direction: Direction
    position: Position | None = None

    @property
    def in_model(self) -> dict[str, Any]:
        """The arguments of the thruster or fin of the model, which has no other numbers than these vectors."""
        at = self.position and SourcedVector(self.position.value, self.position.source)
        along = SourcedVector(self.direction.value, self.direction.source)
        return {"name": self.name, "description": self.description, "direction": along, "position": at}


_THRUSTER = {key: kind.filled(thruster="thruster") for key, kind in THRUSTER.items()}


class ThrusterTable(_coefficients("Thruster", _THRUSTER, base=ActuatorTable)):  # type: ignore[misc]
    """A thruster: its curve, its direction and its place."""

    model_config = DOCUMENTED

    curve: str
    """The name of the thrust curve."""
    arm: Literal["port", "starboard"] | None = None
    """The side of a thruster that pushes ahead with the arm R sin γ, (4), in place of a position."""

    def for_model(self) -> parts.Thruster:
        """Return the thruster of the model."""
        return parts.Thruster(**self.in_model, curve=self.curve, arm=self.arm)


_FIN = {key: kind.filled(fin="fin") for key, kind in FIN.items()}


class FinTable(_coefficients("Fin", _FIN, base=ActuatorTable)):  # type: ignore[misc]
    """A control surface: its lift is `lift` u|u| δ, its drag is `drag` u|u| δ², and its angle δ is angle_max times the
    command."""

    model_config = DOCUMENTED

    position: Position

    def for_model(self) -> parts.Fin:
        """Return the fin of the model."""
        return parts.Fin(**self.in_model, keys=_coefficient_keys(self, FIN))


class Place(Position):
    """The position from the origin of the body frame: forward, starboard, down."""


class PointTable(Strict):
    """A point of the vehicle at which forces act on it, such as that of a tether."""

    name: Symbol
    """The name in the FMU: the components of the force are `F_N_<name>`, `F_E_<name>` and `F_D_<name>`."""
    description: Name = ""
    """For example "tether" or "crane hook"."""
    position: Place

    @property
    def coordinates(self) -> dict[str, Quantity]:
        """The coordinates of the position by the keys of POINT."""
        at = self.position
        return {key: Quantity(value=x, unit=at.unit, source=at.source) for key, x in zip(POINT, at.value, strict=True)}

    def for_model(self) -> parts.Point:
        """Return the point of the model."""
        return parts.Point(name=self.name, description=self.description)


class BatteryTable(Strict):
    """The battery, if thrust depends on its voltage."""

    voltage: quantity("Battery_voltage", Declaration("V", "Voltage of the battery", 0.1, 1000.0))  # type: ignore[valid-type]
    """The value of the FMU's input `voltage` that holds unless it is set."""


class Surface(_coefficients("Surface", SURFACE)):  # type: ignore[misc]
    """The surface, above which buoyancy and thrust fade out: the height H of the part that leaves the water."""

    model_config = DOCUMENTED


# ---- The file --------------------------------------------------------------------------------------------------------


class Alternative(Strict, extra="allow"):
    """Other published coefficients, by their names in the FMU: a_t_rear, a_d_u, ... They go into the documentation,
    not into the model."""

    __pydantic_extra__: dict[str, Quantity]
    description: Text
    """What these coefficients are."""

    @property
    def quantities(self) -> Mapping[str, Quantity]:
        """The coefficients, by their names in the FMU."""
        return self.__pydantic_extra__

    @property
    def values(self) -> dict[str, float]:
        """The values of the coefficients."""
        return {name: quantity.value for name, quantity in self.quantities.items()}


class Estimated(Strict):
    """The standard error and the correlations of an identified coefficient, from which a study draws vehicles."""

    error: Annotated[Finite, Field(ge=0.0)]
    """The standard error, in the unit of the coefficient."""
    correlation: dict[str, Annotated[Finite, Field(ge=-1.0, le=1.0)]] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """The correlations with other coefficients. Each pair is given once; without it, the correlation is 0."""


class Basis(NamedTuple):
    """What the value of a coefficient rests on."""

    source: str
    interval: tuple[float, float] | None = None
    """The 95 % confidence interval of an identified coefficient."""
    estimate: Estimated | None = None
    """Its standard error, and its correlations with others."""

    def among(self, names: Container[str]) -> "Basis":
        """Return this without the correlations with coefficients that have other names."""
        if self.estimate is None:
            return self
        correlation = {name: r for name, r in self.estimate.correlation.items() if name in names}
        return self._replace(estimate=self.estimate.model_copy(update={"correlation": correlation}))


_Gain = Annotated[Finite, Field(ge=-100.0, le=100.0)]


Passing = Literal["carries", "passes"]
"""What a current that changes does with the vehicle."""


class Tables(Strict):
    """The tables that describe the body, the thrusters, the axes and the inputs of a vehicle.

    Any of them may be missing, because it could not be read or is still to be identified.
    """

    hint = staticmethod(derivative_hint)

    body: Body | None = None
    arm: Arm | None = None
    curves: dict[Symbol, CurveTable] = Field(default={}, max_length=MOST)
    """The thrust curves by name."""
    thruster: list[ThrusterTable] = Field(default=[], max_length=MOST)
    """The thrusters, in the order of their variables in the FMU."""
    fin: list[FinTable] = Field(default=[], max_length=MOST)
    """The control surfaces."""
    point: list[PointTable] = Field(default=[], max_length=MOST)
    """The points at which forces act."""
    battery: BatteryTable | None = None
    commands: CommandsTable | None = None
    surface: Surface | None = None
    current: Passing = "carries"
    """What a current that changes does with the vehicle: `"carries"`, so that it keeps its velocity through the water,
    or `"passes"`, so that it keeps its velocity over ground. The FMU is then for Co-Simulation alone."""
    waves: bool = False
    """True for inputs of waves: the water's vertical velocity, its acceleration, and with [surface] its elevation."""
    axes: Axes | None = None
    cross: dict[CrossSymbol, Quantity] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """Added mass, damping and lift that couple axes."""
    inputs: dict[Symbol, dict[str, _Gain]] = Field(default={}, max_length=MOST)
    """Commands that drive several thrusters, with gains."""

    @property
    def axis_tables(self) -> dict[Axis, Any]:
        """The table of each axis that the vehicle has."""
        return {axis: table for name, axis in AXES.items() if (table := getattr(self.axes, name, None)) is not None}

    @cached_property
    def layout(self) -> Layout:
        """The layout of the vehicle, for the model."""
        body, commands, voltage = self.body, self.commands, self.battery.voltage if self.battery else None
        return Layout(
            axes=tuple(VehicleAxis(axis, _coefficient_keys(table, AXIS)) for axis, table in self.axis_tables.items()),
            curves=tuple(curve.for_model(name) for name, curve in self.curves.items()),
            thrusters=tuple(thruster.for_model() for thruster in self.thruster),
            mix=self.inputs,
            coupled=bool(body and body.coupling),
            cross=tuple(filter(None, map(cross_of, self.cross))),
            restoring=tuple(given_quantities(body, RESTORING)) if body else (),
            fins=tuple(fin.for_model() for fin in self.fin),
            has_dead_time=bool(commands and commands.T_d),
            voltage=voltage.value if voltage else None,
            voltage_source=voltage.source if voltage else "",
            pulse=commands.pulse if commands else None,
            points=tuple(point.for_model() for point in self.point),
            surface=self.surface is not None,
            current_passes=self.current == "passes",
            waves=self.waves,
        )

    def quantities(self, of: Layout) -> dict[str, Quantity | None]:
        """Return, for each coefficient of a vehicle, the quantity in these tables, or None if it is missing."""
        lists: dict[str, list[Any]] = {"thruster": self.thruster, "fin": self.fin, "point": self.point}
        tables: Any = dict(self) | {key: {one.name: one for one in ones} for key, ones in lists.items()}

        def entry(table: Any, key: str) -> Any:
            table = table.coordinates if isinstance(table, PointTable) else table
            return table.get(key) if isinstance(table, dict) else getattr(table, key, None)

        return {name: reduce(entry, keys, tables) for name, keys in of.keys_in_file.items()}


class _Head(Strict):
    """The first keys and tables of a vehicle file."""

    format: Literal[2] | None = None
    vehicle: FileHead | None = None
    validity: Validity | None = None


def _needed_by_thrusters(schema: dict[str, Any]) -> None:
    """Tell editors what the file of a vehicle with thrusters must have."""
    schema["dependentRequired"] = {"curves": ["thruster"], "thruster": ["curves"]}
    schema["properties"]["curves"]["minProperties"] = 1
    schema["properties"]["thruster"]["minItems"] = 1


class File(Tables, _Head):
    """The tables of a vehicle file that could be read."""

    alternatives: dict[Annotated[str, NOT_BLANK], Alternative] = Field(default={})
    """Other published coefficients."""
    estimates: dict[str, Estimated] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """Standard errors and correlations of identified coefficients."""
    provenance: Provenance | None = None


class WholeFile(File, json_schema_extra=_needed_by_thrusters):
    """A vehicle file (TOML): an ROV with any thrusters, axes and curves."""

    format: Literal[2]
    """The version of this file format."""
    vehicle: FileHead
    validity: Validity
    body: Body
    axes: Axes


class DrivenFile(WholeFile):
    """The file of a vehicle that thrusters drive, and not only loads from outside."""

    curves: dict[Symbol, CurveTable] = Field(min_length=1, max_length=MOST)
    thruster: list[ThrusterTable] = Field(min_length=1, max_length=MOST)


DRIVING = ("curves", "thruster", "arm", "fin", "inputs")
"""A file that has one of these is that of a vehicle that thrusters drive."""
_TABLES_OF_TABLES = ("curves", "thruster", "axes", "inputs", "alternatives", "estimates", "known", "windows")
"""If an entry of one of these tables has a mistake, the other entries can still be checked."""
_Model = TypeVar("_Model", bound=Tables)


def read_tables(
    data: Toml, model: type[_Model], whole: type[_Model], context: Mapping[str, object]
) -> tuple[_Model, list[ErrorDetails], set[str]]:
    """Return what could be read of a file, the problems with the rest, and the top-level tables with a problem.

    `whole` is the model of a file without a mistake, and in `model`, any table may be missing.
    """
    file, problems = validate(data, whole, **context)
    problems = _in_order(problems, model)
    wrong: dict[str, set[int | str | None]] = {}
    for place in (problem["loc"] for problem in problems):
        wrong.setdefault(str(place[0]), set()).add(place[1] if len(place) > 1 else None)
    if file is None:
        parts: dict[str, Any] = dict(data)
        for name, entries in wrong.items():
            table = parts.pop(name, None)
            if name in _TABLES_OF_TABLES and None not in entries:
                if isinstance(table, list):
                    parts[name] = [entry for n, entry in enumerate(table) if n not in entries]
                elif isinstance(table, dict):
                    parts[name] = {key: entry for key, entry in table.items() if key not in entries}
        file, _ = validate(parts, model, **context)
    assert file, "every table with a mistake is left out"
    return file, problems, {*wrong}


def _in_order(problems: Iterable[ErrorDetails], model: type[Strict]) -> list[ErrorDetails]:
    """Return the problems with a file in the order of the tables of its model.

    Unknown keys come last in a table, because one of them may be a missing key, misspelt.
    """
    order = {name: n for n, name in enumerate(model.model_fields)}

    def place(problem: ErrorDetails) -> tuple[int, bool]:
        return order.get(str(problem["loc"][0]), len(order)), problem["type"] == "extra_forbidden"

    return sorted(problems, key=place)
