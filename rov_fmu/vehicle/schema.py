"""The vehicle file: every table and key, made of the kinds of coefficients that a vehicle can have."""

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
from rov_fmu.vehicle.form import FileHead, Made, Validity
from rov_fmu.vehicle.quantity import Finite, Name, Quantity, Symbol, Text, not_blank, quantity

FORMAT = 2
UNTUNED = 1.0
"""α and β where the file does not give them."""
NOT_GIVEN = "not given"
"""Their source then."""
MOST = 32
"""Thrusters, curves, inputs: more than any vehicle has."""
_MOST_COEFFICIENTS = 1000
"""More than a vehicle of so many has."""


def _coefficients(
    name: str, metas: Mapping[str, Declaration], kinds: Mapping[str, CoefficientKind] | None = None, words: str = ""
) -> Any:
    """A table with a coefficient a key; those are needed that are needed by their kind, if these are given."""
    fields: dict[str, Any] = {}
    for key, meta in metas.items():
        one = quantity(f"{name}_{key}", meta)
        if kinds and key in kinds and kinds[key].needed:
            fields[key] = (one, Field(description=meta.description))
        else:
            fields[key] = (one | None, Field(None, description=meta.description))
    return table_of(f"_{name}", Strict, fields, words)


def given(table: Strict, kinds: Mapping[str, CoefficientKind]) -> dict[str, Quantity]:
    """The coefficients that a table of the file gives, by key."""
    return {key: q for key in kinds if (q := getattr(table, key)) is not None}


def keys(table: Strict, kinds: Mapping[str, CoefficientKind]) -> tuple[str, ...]:
    """The coefficients that a vehicle has by a table of the file: those needed, and those given."""
    has = given(table, kinds)
    return tuple(key for key, kind in kinds.items() if key in has or kind.needed)


def _opened(table: Any, kinds: Mapping[str, CoefficientKind]) -> Any:
    """A table none of whose coefficients is needed."""
    fields: dict[str, Any] = {
        key: (field.annotation | None, Field(None, description=field.description))
        for key, field in table.model_fields.items()
        if key in kinds and field.is_required()
    }
    return table_of(f"_Open{table.__name__}", table, fields, table.__doc__)


# ---- Body, arm, curves, axes -----------------------------------------------------------------------------------------


class Body(_coefficients("Body", {key: kind.meta() for key, kind in BODY.items()})):  # type: ignore[misc]
    """Mass, needed for surge, sway and heave, and moment of inertia, needed for yaw."""

    model_config = DOCUMENTED

    coupling: bool = False
    """Whether surge, sway and yaw are coupled: Coriolis and Munk terms of a diagonal mass matrix."""


class Arm(_coefficients("Arm", {key: kind.meta() for key, kind in ARM.items()}, ARM)):  # type: ignore[misc]
    """The arm R sin γ of the thrusters that say `arm`, (4)."""


_CURVE = {key: kind.meta(curve="curve", equation="(2)") for key, kind in CURVE.items()}


class Curve(_coefficients("Curve", _CURVE, CURVE)):  # type: ignore[misc]
    """A thrust curve: a_t m² + b_t m, m the command beyond the dead band. In reverse it is mirrored, unless it has
    coefficients of its own there."""

    model_config = DOCUMENTED

    description: Name | None = None
    """Words for what has this curve: "rear pair"."""
    equation: Name = "(2)"
    """Where the curve is published."""
    together: Annotated[int, Field(ge=1, le=MOST)] = 1
    """How many thrusters gave the force together when the curve was measured."""


_WORDS = "Velocity {0.velocity} in {0.unit}, positive {0.positive}."
_tables = {
    axis.name: _coefficients(axis.name.capitalize(), layout.metas_of(axis), AXIS, _WORDS.format(axis))
    for axis in AXES.values()
}
_axes: dict[str, Any] = {name: (table | None, None) for name, table in _tables.items()}
_open_axes: dict[str, Any] = {name: (_opened(table, AXIS) | None, None) for name, table in _tables.items()}


class Axes(table_of("_Axes", Strict, _axes)):  # type: ignore[misc]
    """The axes that the vehicle has."""


OpenArm, OpenCurve = _opened(Arm, ARM), _opened(Curve, CURVE)
OpenAxes = table_of("_OpenAxes", Strict, _open_axes, Axes.__doc__)


# ---- Thrusters -------------------------------------------------------------------------------------------------------


_FARTHEST = 100.0  # m, from the centre of mass


def _vector(vector: object) -> object:
    if not isinstance(vector, list) or len(vector) != 3:
        raise ValueError("must be three numbers: forward, starboard, down")
    return as_tuple(vector)


def _near(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if max(map(abs, vector)) > _FARTHEST:
        raise ValueError(f"must be within -{_FARTHEST:g} ... {_FARTHEST:g} m")
    return vector


def _some_length(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not 1e-6 <= hypot(*vector) <= 1e6:
        raise ValueError("must have a length, from 1e-6 to 1e6")
    return vector


_Vector = Annotated[
    tuple[Finite, Finite, Finite],
    BeforeValidator(_vector),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}),
]


class Direction(Strict):
    """Of its force at a positive command: forward, starboard, down; of any length but zero."""

    value: Annotated[_Vector, AfterValidator(_some_length)]
    """Forward, starboard, down."""
    source: Text
    """Where it comes from."""


class Position(Strict):
    """From the centre of mass: forward, starboard, down. Needed for yaw, unless the thruster says `arm` or acts
    straight up or down."""

    value: Annotated[_Vector, AfterValidator(_near)]
    """Forward, starboard, down."""
    unit: Literal["m"]
    source: Text
    """Where it comes from."""


class Thruster(Strict):
    """A thruster: its curve and its place."""

    name: Symbol
    """Stands in the names of its command and its force in the FMU: `u_<name>`, `F_<name>`."""
    description: Name | None = None
    """Words for it: "left thruster"."""
    curve: str
    """Name of its curve."""
    direction: Direction
    position: Position | None = None
    arm: Literal["port", "starboard"] | None = None
    """Instead of a position: the side of a thruster that pushes ahead with the arm R sin γ, (4)."""

    def plain(self) -> layout.Thruster:
        """As the mathematics takes it."""
        x, y, z = self.direction.value
        length = hypot(x, y, z) if abs(hypot(x, y, z) - 1.0) > 1e-12 else 1.0  # a unit vector stays as it is
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
    """Coefficients published beside the ones used, by their names in the FMU: a_t_rear, a_d_u, ... They go into the
    documentation, not into the model."""

    __pydantic_extra__: dict[str, Quantity]
    description: Text
    """What they are."""

    @property
    def quantities(self) -> Mapping[str, Quantity]:
        """By name."""
        return self.__pydantic_extra__


class Estimated(Strict):
    """How tests tell of a coefficient, beside its interval: what a draw of vehicles needs."""

    error: Annotated[Finite, Field(ge=0.0)]
    """Standard error, in the unit of the coefficient, as of a normal distribution."""
    correlation: dict[str, Annotated[Finite, Field(ge=-1.0, le=1.0)]] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """With other coefficients of this table, by their names in the FMU; each pair once, and 0 where it is not given."""


_Gain = Annotated[Finite, Field(ge=-100.0, le=100.0)]


class _Opening(Strict):
    """What stands first in a vehicle file."""

    format: Literal[2] | None = None
    """Version of the form of this file."""
    vehicle: FileHead | None = None
    validity: Validity | None = None


class Hardware(Strict):
    """The tables that say what a vehicle has."""

    body: Body | None = None
    arm: Arm | None = None
    curves: dict[Symbol, Curve] = Field(default={}, max_length=MOST)
    """By name, which stands in the names of their coefficients in the FMU: `a_t_<name>`."""
    thruster: list[Thruster] = Field(default=[], max_length=MOST)
    axes: Axes | None = None
    inputs: dict[Symbol, dict[str, _Gain]] = Field(default={}, max_length=MOST)
    """Where one command drives several thrusters: name of the command to the thrusters that it drives, with gains."""

    @property
    def axis_tables(self) -> dict[Axis, Any]:
        """The axes that the vehicle has."""
        return {axis: table for name, axis in AXES.items() if (table := getattr(self.axes, name, None)) is not None}

    @property
    def layout(self) -> Layout:
        """What the vehicle has."""
        axes = tuple(VehicleAxis(axis, keys(table, AXIS)) for axis, table in self.axis_tables.items())
        curves = tuple(
            layout.Curve(name, keys(curve, CURVE), curve.together, curve.description or "", curve.equation)
            for name, curve in self.curves.items()
        )
        coupled = bool(self.body and self.body.coupling)
        return Layout(axes, curves, tuple(t.plain() for t in self.thruster), self.inputs, coupled)

    def quantities(self, of: Layout) -> dict[str, Quantity | None]:
        """Every coefficient that a vehicle has, as these tables give it; None where they do not."""
        found: dict[str, Quantity | None] = {}
        for name, place in where(of):
            table: Any = self
            for key in place:
                table = table.get(key) if isinstance(table, dict) else getattr(table, key, None)
            found[name] = table
        return found

    @property
    def thruster_sources(self) -> dict[str, dict[str, str]]:
        """Where `direction` and `position` of each thruster come from, by its name."""
        return {
            t.name: {"direction": t.direction.source} | ({"position": t.position.source} if t.position else {})
            for t in self.thruster
        }


class OpenHardware(Hardware):
    """The same without the coefficients that are yet to be found."""

    arm: OpenArm | None = None  # type: ignore[valid-type]
    curves: dict[Symbol, OpenCurve] = Field(default={}, max_length=MOST)  # type: ignore[valid-type]
    axes: OpenAxes | None = None  # type: ignore[valid-type]


class Parts(Hardware, _Opening):
    """A vehicle file as far as it could be read."""

    alternatives: dict[Annotated[str, AfterValidator(not_blank)], Alternative] = Field(default={})
    """Coefficients published beside the ones used, under a name each."""
    estimates: dict[str, Estimated] = Field(default={}, max_length=_MOST_COEFFICIENTS)
    """Coefficients that tests tell, by their names in the FMU: how far they hang together. Each has an `interval`."""
    provenance: Made | None = None


class File(Parts):
    """A vehicle file (TOML): an ROV of any thrusters, axes and curves."""

    format: Literal[2]
    """Version of the form of this file."""
    vehicle: FileHead
    validity: Validity
    body: Body
    curves: dict[Symbol, Curve] = Field(min_length=1, max_length=MOST)
    """By name, which stands in the names of their coefficients in the FMU: `a_t_<name>`."""
    thruster: list[Thruster] = Field(min_length=1, max_length=MOST)
    """The thrusters, a table [[thruster]] each, in the order of their variables in the FMU."""
    axes: Axes


def where(of: Layout) -> Iterator[tuple[str, tuple[str, ...]]]:
    """The name of each coefficient in the FMU, and the tables and the key where it stands in the vehicle file."""
    yield from ((key, ("body", key)) for key in BODY if key in of.coefficients)
    yield from ((key, ("arm", key)) for key in ARM if key in of.coefficients)
    for curve in of.curves:
        yield from ((curve.coefficient(key), ("curves", curve.name, key)) for key in CURVE if key in curve.keys)
    for keys in (AXIS, TUNING):
        for form in of.axes:
            has = (key for key in keys if key in form.keys or keys is TUNING)
            yield from ((form.axis.coefficient(key), ("axes", form.axis.name, key)) for key in has)
