"""The variables of an FMU, alike for both versions of FMI."""

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any

_TYPES = {"Real": "f8", "Integer": "i4", "Boolean": "i4", "String": "O"}
_TYPES_OF_3 = {
    **{name: name.lower() for name in ("Float32", "Float64")},
    **{f"{u}Int{bits}": f"{u}int{bits}".lower() for u in ("", "U") for bits in (8, 16, 32, 64)},
    **{"Boolean": "?", "String": "O"},
}
"""The NumPy type of each type of variables that are numbers or texts, in FMI 2.0 and 3.0."""

Value = float | int | bool | str


@dataclass(frozen=True)
class Variable:
    """A variable that is one number or one text."""

    name: str
    reference: int
    type: str
    """The name of its type in FMI, which is also the end of the names of its functions, as Real of fmi2GetReal."""
    causality: str
    can_be_set: bool
    """True when it can be set before a run."""
    is_continuous: bool
    minimum: float
    maximum: float
    unit: str
    """An empty text if the FMU gives none."""
    start: float
    """The start value, or 0 if the FMU gives no number."""
    description: str = ""
    nominal: float = 0.0
    """The nominal value, or 0 if the FMU gives none."""
    dtype: str = "f8"
    """The NumPy name of its type."""

    @property
    def is_whole(self) -> bool:
        """True when it holds only whole numbers."""
        return "Int" in self.type

    @property
    def kind(self) -> str:
        """The type of SSP: Real, Integer, Boolean or String."""
        return self.type if self.type in ("Boolean", "String") else "Integer" if self.is_whole else "Real"

    def wrong(self, value: float) -> str:
        """Return why the variable cannot have this number, or an empty text."""
        if self.type == "Boolean" and value not in (0.0, 1.0):
            return "must be true or false, or 1 or 0"
        if self.is_whole and value != int(value):
            return "must be a whole number"
        if not self.minimum <= value <= self.maximum:
            unit = f" {self.unit}" * (self.unit not in ("", "1"))
            return f"must be within {self.minimum:.12g} ... {self.maximum:.12g}{unit}"
        return ""


class Described:
    """What has FMPy's description of an FMU."""

    description: Any

    @cached_property
    def variables(self) -> dict[str, Variable]:
        """The variables that are one number or one text, by name."""
        return variables_of(self.description)

    def names(self, causality: str) -> list[str]:
        """Return the names of the variables of a causality."""
        return [name for name, v in self.variables.items() if v.causality == causality]

    def numbers(self, causality: str) -> list[str]:
        """Return the names of those that are numbers."""
        return [name for name in self.names(causality) if self.variables[name].kind != "String"]


def variables_of(description: Any) -> dict[str, Variable]:
    """Return the variables in FMPy's description that are one number or one text, by name."""
    is_3 = description.fmiVersion.startswith("3")
    types, enumeration = (_TYPES_OF_3, "Int64") if is_3 else (_TYPES, "Integer")
    found = {}
    for v in description.modelVariables:
        kind = enumeration if v.type == "Enumeration" else v.type  # the functions of an enumeration are those of this
        if kind in types and not v.dimensions:
            found[v.name] = _variable(v, kind, types[kind])
    return found


def _variable(v: Any, kind: str, dtype: str) -> Variable:
    low, high, unit, nominal = (
        getattr(v, key) or getattr(v.declaredType, key, None) for key in ("min", "max", "unit", "nominal")
    )
    return Variable(
        v.name,
        v.valueReference,
        kind,
        v.causality,
        v.causality == "input" or (v.variability != "constant" and v.initial in ("exact", "approx")),
        v.variability == "continuous",
        -inf if low is None else float(low),
        inf if high is None else float(high),
        unit or "",
        _number(v.start),
        v.description or "",
        float(nominal or 0.0),
        dtype,
    )


def _number(start: Any) -> float:
    """Return a start value that FMPy read as a number, or 0."""
    try:
        return float({"true": 1.0, "false": 0.0}.get(str(start), start))
    except (TypeError, ValueError):
        return 0.0
