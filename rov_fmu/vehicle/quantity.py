"""The values in the tables of a vehicle file, with their unit and source.

Hydrodynamic derivatives in the notation of Fossen and SNAME (X_udot, X_u|u|, X_u) are negative; hints say what to give
instead of them.
"""

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ValidationInfo, WithJsonSchema

from rov_fmu.equation.catalogue import BY_LETTER, BY_VELOCITY, Axis, Declaration, cross_name
from rov_fmu.io.toml_file import AS_TUPLE, SYMBOL, SYMBOL_SCHEMA, Finite, Strict, Text, numbers_schema, table_model


def _cross_symbol(text: str) -> str:
    """Return the text if it is no derivative in the notation of other programs. Raises ValueError."""
    if "|" in text and (hint := derivative_hint(text)):
        raise ValueError(f"is not a coefficient of several axes{hint}")
    return text


CrossSymbol = Annotated[str, AfterValidator(_cross_symbol), SYMBOL, SYMBOL_SCHEMA]
"""A key of [cross], which is also a name in the FMU."""

Interval = Annotated[
    tuple[Finite, Finite],
    AS_TUPLE,
    numbers_schema(2),
]
"""The ends of an interval, `[low, high]` in a TOML file."""


def _encloses(interval: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
    """Return the interval if the value is within it, or is missing. Raises ValueError."""
    value = info.data.get("value", interval[0])
    if not interval[0] <= value <= interval[1]:
        raise ValueError(f"must be [low, high] around the value {value}")
    return interval


class Quantity(Strict):
    """The value of a coefficient, and its 95 % confidence interval if it has one."""

    value: float
    unit: str
    source: Text
    """Where the value comes from."""
    interval: Annotated[Interval, AfterValidator(_encloses)] | None = None
    """The 95 % confidence interval: [low, high] around the value."""


def within(value: float, declaration: Declaration) -> float:
    """Return the value if it is within the bounds of its coefficient. Raises ValueError."""
    if not declaration.minimum <= value <= declaration.maximum:
        raise ValueError(f"must be within {declaration.minimum:.12g} ... {declaration.written(declaration.maximum)}")
    return value


def quantity(name: str, declaration: Declaration, negative: str = "") -> Any:
    """Return a kind of Quantity that has the unit and the bounds of a coefficient.

    `negative` says what to give instead of a negative value.
    """

    def check(value: float) -> float:
        try:
            return within(value, declaration)
        except ValueError as error:
            raise ValueError(f"{error}{negative if value < 0.0 else ''}") from error

    bounds = {"type": "number", "minimum": declaration.minimum, "maximum": declaration.maximum}
    fields: dict[str, Any] = {
        "value": (
            Annotated[Finite, AfterValidator(check), WithJsonSchema(bounds)],
            ...,
        ),
        "unit": (Literal[declaration.unit], ...),
    }
    return table_model(name, Quantity, fields, declaration.description)


# ---- Fossen's notation -----------------------------------------------------------------------------------------------

_VELOCITY = "([uvwpqr])"
_BARS = r"(?:_?\|_?|_?abs_?)"
_FORMS = {
    "m_a": re.compile(f"([XYZKMN])_?(?:{_VELOCITY}_?(?:dot|d)|(?:dot_?|d){_VELOCITY})"),
    "a_d": re.compile(
        f"([XYZKMN])_?(?:{_BARS}{_VELOCITY}{_BARS}?{_VELOCITY}|{_VELOCITY}{_BARS}{_VELOCITY}{_BARS}?|{_VELOCITY}{_BARS}"
        rf"|{_VELOCITY}\7)"
    ),
    "b_d": re.compile(f"([XYZKMN])_?{_VELOCITY}"),
}
"""How programs write the derivatives of added mass, quadratic and linear damping."""


def derivative(key: str, axis: Axis) -> str:
    """Return the derivative of an axis that m_a, a_d or b_d replaces, in Fossen's notation: X_udot, X_u|u| or X_u."""
    v = axis.velocity
    return f"{axis.letter}_{v}{ {'m_a': 'dot', 'a_d': f'|{v}|', 'b_d': ''}[key] }"


def derivative_hint(key: str) -> str:
    """Return the end of a message about a key in another notation.

    It says what to write instead of a derivative or a moment of inertia. It is empty for other keys.
    """
    if inertia := re.fullmatch(r"I_?([xyz])\1?", key):
        return f"; write I_{dict(zip('xyz', 'pqr', strict=True))[inertia[1]]} in [body]"
    for name, form in _FORMS.items():
        if not (match := form.fullmatch(key)):
            continue
        along = BY_LETTER[match[1]]
        velocities = [velocity for velocity in match.groups()[1:] if velocity]
        if {*velocities} == {along.velocity}:
            return f"; give -{derivative(name, along)}, which is positive, as {name} of [axes.{along.name}]"
        pair = [along.velocity, velocities[-1]]
        if name == "m_a":
            pair.sort(key=[*BY_VELOCITY].index)
        elif len({*velocities}) > 1:
            return ""
        return f"; give its negative as {cross_name(name, *pair)} in [cross]"
    return ""
