"""The pydantic models of the vehicle file, with every table and key; `model.layout` declares the coefficients."""

from collections.abc import Iterator, Mapping
from math import hypot
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from rov_fmu.io.toml_file import DOCUMENTED, Strict, as_tuple, table_of
from rov_fmu.model import layout
from rov_fmu.model.layout import (
    ARM,
    AXES,
    AXIS,
    BODY,
    CURVE,
    TUNING,
    Axis,
    CoefficientKind,
    Declaration,
    Layout,
    VehicleAxis,
)
from rov_fmu.vehicle.description import FileHead, Made, Validity
from rov_fmu.vehicle.quantity import Finite, Name, Quantity, Symbol, Text, not_blank, quantity

FORMAT = 2
UNTUNED = 1.0
"""The value of α and β where the file does not give them."""
NOT_GIVEN = "not given"
"""The source of α and β where the file does not give them."""
MOST = 32
"""The largest number of thrusters, curves or inputs."""
_MOST_COEFFICIENTS = 1000
"""The largest number of coefficients in a table; it exceeds that of the largest vehicle."""


def _coefficients(
    name: str,
    declarations: Mapping[str, Declaration],
    kinds: Mapping[str, CoefficientKind] | None = None,
    words: str = "",
) -> Any:
    """Return a table with a key for each coefficient. A key is required if its kind says so; without kinds, none is."""
    fields: dict[str, Any] = {}
    for key, declaration in declarations.items():
        one = quantity(f"{name}_{key}", declaration)
        if kinds and key in kinds and kinds[key].needed:
            fields[key] = (one, Field(description=declaration.description))
        else:
            fields[key] = (one | None, Field(None, description=declaration.description))
    return table_of(f"_{name}", Strict, fields, words)


def given_quantities(table: Strict, kinds: Mapping[str, CoefficientKind]) -> dict[str, Quantity]:
    """Return the coefficients that a table of the file gives, by key."""
    return {key: q for key in kinds if (q := getattr(table, key)) is not None}


def _coefficient_keys(table: Strict, kinds: Mapping[str, CoefficientKind]) -> tuple[str, ...]:
    """Return the keys of the coefficients that the vehicle has: those that are required, and those that are given."""
    quantities = given_quantities(table, kinds)
    return tuple(key for key, kind in kinds.items() if key in quantities or kind.needed)


def _all_optional(table: Any, kinds: Mapping[str, CoefficientKind]) -> Any:
    """Return a copy of a table in which no coefficient is required."""
    fields: dict[str, Any] = {
        key: (field.annotation | None, Field(None, description=field.description))
        for key, field in table.model_fields.items()
        if key in kinds and field.is_required()
    }
    return table_of(f"_Open{table.__name__}", table, fields, table.__doc__)


# ---- Body, arm, curves, axes -----------------------------------------------------------------------------------------


class Body(_coefficients("Body", {key: kind.meta() for key, kind in BODY.items()})):  # type: ignore[misc]
    """The mass, needed for surge, sway and heave, and the moment of inertia, needed for yaw."""

    model_config = DOCUMENTED

    coupling: bool = False
    """True if surge, sway and yaw are coupled by the Coriolis and Munk terms of a diagonal mass matrix."""


class Arm(_coefficients("Arm", {key: kind.meta() for key, kind in ARM.items()}, ARM)):  # type: ignore[misc]
    """The arm R sin γ, (4), of the thrusters that have the key `arm`."""


_CURVE = {key: kind.meta(curve="curve", equation="(2)") for key, kind in CURVE.items()}


class Curve(_coefficients("Curve", _CURVE, CURVE)):  # type: ignore[misc]
    """A thrust curve a_t m² + b_t m, where m is the command beyond the dead band. In reverse the curve is mirrored,
    unless it has its own coefficients there."""

    model_config = DOCUMENTED

    description: Name | None = None
    """A short description of the thrusters with this curve, for example "rear pair"."""
    equation: Name = "(2)"
    """The equation or table in which the curve is published."""
    together: Annotated[int, Field(ge=1, le=MOST)] = 1
    """The number of thrusters that gave the force together when the curve was measured."""


_AXIS_DESCRIPTION = "Velocity {0.velocity} in {0.unit}, positive {0.positive}."
_tables = {
    axis.name: _coefficients(axis.name.capitalize(), layout.metas_of(axis), AXIS, _AXIS_DESCRIPTION.format(axis))
    for axis in AXES.values()
}
_axes: dict[str, Any] = {name: (table | None, None) for name, table in _tables.items()}
_open_axes: dict[str, Any] = {name: (_all_optional(table, AXIS) | None, None) for name, table in _tables.items()}


class Axes(table_of("_Axes", Strict, _axes)):  # type: ignore[misc]
    """The axes that the vehicle has."""


OpenArm, OpenCurve = _all_optional(Arm, ARM), _all_optional(Curve, CURVE)
OpenAxes = table_of("_OpenAxes", Strict, _open_axes, Axes.__doc__)


# ---- Thrusters -------------------------------------------------------------------------------------------------------


_FARTHEST = 100.0
"""The largest coordinate of a thruster from the centre of mass, in m."""


def _vector(vector: object) -> object:
    """Return a list of three entries as a tuple. Raises ValueError."""
    if not isinstance(vector, list) or len(vector) != 3:
        raise ValueError("must be three numbers: forward, starboard, down")
    return as_tuple(vector)


def _near(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a position if it can be on a vehicle. Raises ValueError."""
    if max(map(abs, vector)) > _FARTHEST:
        raise ValueError(f"must be within -{_FARTHEST:g} ... {_FARTHEST:g} m")
    return vector


def _not_zero(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a direction if its length is neither zero nor extreme. Raises ValueError."""
    if not 1e-6 <= hypot(*vector) <= 1e6:
        raise ValueError("must have a length, from 1e-6 to 1e6")
    return vector


_Vector = Annotated[
    tuple[Finite, Finite, Finite],
    BeforeValidator(_vector),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}),
]


class Direction(Strict):
    """The direction of the force at a positive command: forward, starboard, down. It has any length except zero."""

    value: Annotated[_Vector, AfterValidator(_not_zero)]
    """Three numbers: forward, starboard, down."""
    source: Text
    """Where the value comes from."""


class Position(Strict):
    """The position from the centre of mass: forward, starboard, down. It is needed for yaw, unless the thruster has
    the key `arm` or acts straight up or down."""

    value: Annotated[_Vector, AfterValidator(_near)]
    """Three numbers: forward, starboard, down."""
    unit: Literal["m"]
    source: Text
    """Where the value comes from."""


class Thruster(Strict):
    """A thruster: its curve, its direction and its place."""

    name: Symbol
    """The name. The FMU's variables for the command and the force contain it: `u_<name>`, `F_<name>`."""
    description: Name | None = None
    """A short description, for example "left thruster"."""
    curve: str
    """The name of the thrust curve."""
    direction: Direction
    position: Position | None = None
    arm: Literal["port", "starboard"] | None = None
    """The side of a thruster that pushes ahead with the arm R sin γ, (4). This key replaces a position."""

    def plain(self) -> layout.Thruster:
        """Return the thruster of the model, with a unit vector as its direction."""
        x, y, z = self.direction.value
        length = hypot(x, y, z)
        if abs(length - 1.0) <= 1e-12:  # a unit vector stays as it is
            length = 1.0
        return layout.Thruster(
            self.name,
            self.curve,
            (x / length, y / length, z / length),
            self.position.value if self.position else None,
            {None: 0, "port": 1, "starboard": -1}[self.arm],
            self.description or "",
        )


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


class Estimated(Strict):
    """The standard error and the correlations of an identified coefficient, from which a study draws vehicles."""

    error: Annotated[Finite, Field(ge=0.0)]
    """The standard error of a normal distribution, in the unit of the coefficient."""
    correlation: dict[str, Annotated[Finite, Field(ge=-1.0, le=1.0)]] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """The correlations with other coefficients of this table, by their names in the FMU. Each pair is given once; the
    correlation of a pair that is not given is 0."""


_Gain = Annotated[Finite, Field(ge=-100.0, le=100.0)]


class _Opening(Strict):
    """The first keys and tables of a vehicle file."""

    format: Literal[2] | None = None
    """The version of this file format."""
    vehicle: FileHead | None = None
    validity: Validity | None = None


class Hardware(Strict):
    """The tables that describe the body, the thrusters, the axes and the inputs of a vehicle."""

    body: Body | None = None
    arm: Arm | None = None
    curves: dict[Symbol, Curve] = Field(default={}, max_length=MOST)
    """The thrust curves by name. The names of their coefficients in the FMU contain it: `a_t_<name>`."""
    thruster: list[Thruster] = Field(default=[], max_length=MOST)
    axes: Axes | None = None
    inputs: dict[Symbol, dict[str, _Gain]] = Field(default={}, max_length=MOST)
    """Commands that drive several thrusters. Each has a table of the thrusters that it drives, with their gains."""

    @property
    def axis_tables(self) -> dict[Axis, Any]:
        """The table of each axis that the vehicle has."""
        return {axis: table for name, axis in AXES.items() if (table := getattr(self.axes, name, None)) is not None}

    @property
    def layout(self) -> Layout:
        """The layout of the vehicle, for the model."""
        axes = tuple(VehicleAxis(axis, _coefficient_keys(table, AXIS)) for axis, table in self.axis_tables.items())
        curves = tuple(
            layout.Curve(name, _coefficient_keys(curve, CURVE), curve.together, curve.description or "", curve.equation)
            for name, curve in self.curves.items()
        )
        coupled = bool(self.body and self.body.coupling)
        return Layout(axes, curves, tuple(t.plain() for t in self.thruster), self.inputs, coupled)

    def quantities(self, of: Layout) -> dict[str, Quantity | None]:
        """Return what these tables give for each coefficient of a vehicle; None where they do not give it."""
        found: dict[str, Quantity | None] = {}
        for name, place in where(of):
            table: Any = self
            for key in place:
                table = table.get(key) if isinstance(table, dict) else getattr(table, key, None)
            found[name] = table
        return found

    @property
    def thruster_sources(self) -> dict[str, dict[str, str]]:
        """The sources of `direction` and `position`, by the name of the thruster."""
        return {
            t.name: {"direction": t.direction.source} | ({"position": t.position.source} if t.position else {})
            for t in self.thruster
        }


class OpenHardware(Hardware):
    """The tables of Hardware, in which the coefficients that are still to be identified may be missing."""

    arm: OpenArm | None = None  # type: ignore[valid-type]
    curves: dict[Symbol, OpenCurve] = Field(default={}, max_length=MOST)  # type: ignore[valid-type]
    axes: OpenAxes | None = None  # type: ignore[valid-type]


class Parts(Hardware, _Opening):
    """The tables of a vehicle file, of which any may be missing because it could not be read."""

    alternatives: dict[Annotated[str, AfterValidator(not_blank)], Alternative] = Field(default={})
    """Other sets of published coefficients, by a name for each set."""
    estimates: dict[str, Estimated] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """Standard errors and correlations of identified coefficients, by their names in the FMU. Each such coefficient has
    an `interval`."""
    provenance: Made | None = None


class File(Parts):
    """A vehicle file (TOML): an ROV with any thrusters, axes and curves."""

    format: Literal[2]
    """The version of this file format."""
    vehicle: FileHead
    validity: Validity
    body: Body
    curves: dict[Symbol, Curve] = Field(min_length=1, max_length=MOST)
    """The thrust curves by name. The names of their coefficients in the FMU contain it: `a_t_<name>`."""
    thruster: list[Thruster] = Field(min_length=1, max_length=MOST)
    """The thrusters, one table [[thruster]] each, in the order of their variables in the FMU."""
    axes: Axes


def where(of: Layout) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the name of each coefficient in the FMU, and its place in the vehicle file: the tables and the key."""
    yield from ((key, ("body", key)) for key in BODY if key in of.coefficients)
    yield from ((key, ("arm", key)) for key in ARM if key in of.coefficients)
    for curve in of.curves:
        yield from ((curve.coefficient(key), ("curves", curve.name, key)) for key in CURVE if key in curve.keys)
    for keys in (AXIS, TUNING):
        for vehicle_axis in of.axes:
            axis = vehicle_axis.axis
            present = keys if keys is TUNING else (key for key in keys if key in vehicle_axis.keys)
            yield from ((axis.coefficient(key), ("axes", axis.name, key)) for key in present)
