"""The building blocks of the tables of a vehicle file: texts, names, and values with their unit and source."""

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, WithJsonSchema

from rov_fmu.io.toml_file import Strict, as_tuple, table_of
from rov_fmu.model.layout import Declaration


def _printable(text: str) -> str:
    """Return the text if it has no control characters. Raises ValueError."""
    if found := re.search(r"[^\n\t -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", text):
        raise ValueError(f"must be without the control character {found[0]!a}")
    return text


def not_blank(text: str) -> str:
    """Return the text if it has more than white space. Raises ValueError."""
    if not text.strip():
        raise ValueError("must not be blank")
    return text


Text = Annotated[str, Field(min_length=1, max_length=10_000), AfterValidator(_printable), AfterValidator(not_blank)]
Name = Annotated[
    str,
    Field(min_length=1, max_length=100, pattern=r"^[^\n\t]*$"),
    AfterValidator(_printable),
    AfterValidator(not_blank),
]
Finite = Annotated[float, Field(allow_inf_nan=False)]


def _symbol(text: str) -> str:
    """Return the text if it can be part of a variable's name. Raises ValueError."""
    if not re.fullmatch(r"[A-Za-z0-9_]{1,30}", text):
        raise ValueError("must be at most 30 letters, digits and underscores")
    return text


Symbol = Annotated[str, AfterValidator(_symbol), WithJsonSchema({"type": "string", "pattern": "^[A-Za-z0-9_]{1,30}$"})]
"""A name that becomes part of the names of FMU variables."""

Interval = Annotated[
    tuple[Finite, Finite],
    BeforeValidator(as_tuple),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}),
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
        unit = "" if declaration.unit == "1" else f" {declaration.unit}"
        raise ValueError(f"must be within {declaration.minimum:.12g} ... {declaration.maximum:.12g}{unit}")
    return value


def quantity(name: str, declaration: Declaration) -> Any:
    """Return a kind of Quantity that has the unit and the bounds of a coefficient."""
    bounds = {"type": "number", "minimum": declaration.minimum, "maximum": declaration.maximum}
    fields: dict[str, Any] = {
        "value": (
            Annotated[Finite, AfterValidator(lambda value: within(value, declaration)), WithJsonSchema(bounds)],
            ...,
        ),
        "unit": (Literal[declaration.unit], ...),
    }
    return table_of(name, Quantity, fields, declaration.description)
