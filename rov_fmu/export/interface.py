"""Every FMU variable, declared once.

modelDescription.xml, the C structs and value references, the documentation and the PythonFMU registration are all
derived from `variables`. The order is that of the C struct `rov_variables`: inputs, state, derivative, thrust,
coefficients; the value reference of a variable is its place in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, isfinite
from typing import Any

from rov_fmu.files.templates import render
from rov_fmu.motion.rov import (
    AXES,
    COEFFICIENTS,
    HEAVE,
    SURGE,
    YAW,
    Coefficients,
    Inputs,
    Meta,
    State,
    Thrust,
    declared,
)


@dataclass(frozen=True)
class Unit:
    """An SI unit: its exponents of the FMI base units, and the unit a person reads, value times factor."""

    exponents: Mapping[str, int]
    display: str | None = None
    factor: float = 1.0


_KNOT = 1852.0 / 3600.0  # m/s

UNITS: dict[str, Unit] = {
    "1": Unit({}, "%", 100.0),
    "kg": Unit({"kg": 1}),
    "m": Unit({"m": 1}),
    "rad": Unit({"rad": 1}, "deg", degrees(1.0)),
    "m/s": Unit({"m": 1, "s": -1}, "knot", 1.0 / _KNOT),
    "rad/s": Unit({"rad": 1, "s": -1}, "deg/s", degrees(1.0)),
    "m/s2": Unit({"m": 1, "s": -2}),
    "rad/s2": Unit({"rad": 1, "s": -2}),
    "N": Unit({"kg": 1, "m": 1, "s": -2}),
    "N.m": Unit({"kg": 1, "m": 2, "s": -2}),
    "kg.m2": Unit({"kg": 1, "m": 2}),
    "N.s/m": Unit({"kg": 1, "s": -1}),
    "N.s2/m2": Unit({"kg": 1, "m": -1}),
    "N.m.s/rad": Unit({"kg": 1, "m": 2, "s": -1, "rad": -1}),
    "N.m.s2/rad2": Unit({"kg": 1, "m": 2, "rad": -2}),
}


@dataclass(frozen=True)
class Variable:
    """One scalar variable as FMI 2.0 describes it. Every one is a Real.

    `dependencies` maps each known that the variable depends on to its dependenciesKind, for outputs and derivatives.
    """

    name: str
    value_reference: int
    description: str
    unit: str
    causality: str
    variability: str
    initial: str | None = None
    start: float | None = None
    display_unit: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    derivative_of: str | None = None
    dependencies: Mapping[str, str] | None = None

    @property
    def index(self) -> int:
        """Position in <ModelVariables>, from 1."""
        return self.value_reference + 1

    @property
    def kind(self) -> str:
        """What it is in C: variable_kind of variable.h."""
        if self.causality == "input":
            return "INPUT"
        if self.causality == "parameter":
            return self.variability.upper()
        return "STATE" if self.initial == "exact" else "CALCULATED"


# What is calculated from the state, and the knowns that it depends on with their dependenciesKind: derivatives ...
_ALONG = {"u": "dependent", "psi": "dependent"}
_DERIVATIVES = {
    axis.velocity: (
        f"{axis.name.capitalize()} acceleration, {axis.equations[1]}",
        f"{axis.unit}2",
        {**dict.fromkeys(axis.signs, "dependent"), axis.external: "tunable", axis.velocity: "dependent"},
    )
    for axis in AXES.values()
} | {
    "x": ("Velocity over ground northward, u cos ψ + V_N", "m/s", {"V_N": "constant"} | _ALONG),
    "y": ("Velocity over ground eastward, u sin ψ + V_E", "m/s", {"V_E": "constant"} | _ALONG),
    "z": ("Rate of change of depth, w", "m/s", {"w": "constant"}),
    "psi": ("Rate of change of heading, r", "rad/s", {"r": "constant"}),
}
# ... and thrust: its commands.
_COMMANDS_OF = {"F_l": ("u_l",), "F_r": ("u_r",), "F_t": ("u_t",), "tau_rear": tuple(YAW.signs)}

# Which coefficients each calculated variable depends on during initialization.
_ARM = ("R", "gamma")
PARAMETERS_OF: dict[str, tuple[str, ...]] = {
    "F_l": SURGE.thrust_names,
    "F_r": SURGE.thrust_names,
    "F_t": HEAVE.thrust_names,
    "tau_rear": YAW.thrust_names + _ARM,
} | {
    f"der({axis.velocity})": (
        *axis.thrust_names,
        *(_ARM if axis is YAW else ()),
        axis.inertia,
        *(axis.coefficient(kind) for kind in ("a_d", "b_d", "alpha", "beta")),
    )
    for axis in AXES.values()
}


def variables(coefficients: Coefficients) -> tuple[Variable, ...]:
    """All variables of the FMU of a vehicle, in the order of their value references."""
    result: list[Variable] = []

    def add(name: str, meta: Meta, causality: str, variability: str, **rest: Any) -> None:
        bounds = {end: x for end, x in (("minimum", meta.minimum), ("maximum", meta.maximum)) if isfinite(x)}
        given = {"display_unit": UNITS[meta.unit].display, **bounds, **rest}
        result.append(Variable(name, len(result), meta.description, meta.unit, causality, variability, **given))

    for name, meta in declared(Inputs).items():
        add(name, meta, "input", "continuous", start=0.0, nominal=meta.nominal)
    for name, meta in declared(State).items():
        add(name, meta, "output", "continuous", initial="exact", start=0.0, nominal=meta.nominal,
            dependencies={name: "constant"})  # fmt: skip
    for name in declared(State):
        description, unit, known = _DERIVATIVES[name]
        add(f"der({name})", Meta(unit, description), "local", "continuous", initial="calculated", derivative_of=name,
            dependencies=known)  # fmt: skip
    for name, meta in declared(Thrust).items():
        add(name, meta, "output", "continuous", initial="calculated", display_unit=None,
            dependencies=dict.fromkeys(_COMMANDS_OF[name], "dependent"))  # fmt: skip
    for name, meta in COEFFICIENTS.items():
        add(name, meta, "parameter", "tunable" if meta.tunable else "fixed", initial="exact",
            start=getattr(coefficients, name),
            display_unit=None if meta.unit == "1" else UNITS[meta.unit].display)  # fmt: skip
    return tuple(result)


# Names by the standard (2.2.4) and what is said in each.
LOG_CATEGORIES = {
    "logEvents": "Changes of mode: initialization, event mode, reset, termination",
    "logStatusWarning": "A command beyond ±1 that saturates, a call or a time that the standard does not foresee; once",
    "logStatusDiscard": "A value refused by fmi2SetReal or by a solver's state: not finite, or outside min ... max",
    "logStatusError": "Illegal calls and arguments, steps past stopTime, results that overflow",
}

# ---- The same declaration for the C compiler -----------------------------------------------------------------------


def model_header() -> str:
    """model.h: the structs of the mathematics, members in the order of the value references."""
    structs = {"inputs": Inputs, "state": State, "thrust": Thrust, "coefficients": Coefficients}
    return render("model.h.j2", structs={name: declared(struct) for name, struct in structs.items()})


def interface_header(variables: tuple[Variable, ...], identifier: str, guid: str) -> str:
    """interface.h: what the FMI layer knows of the variables, and the names of the functions in a static library."""
    return render(
        "interface.h.j2",
        variables=variables,
        identifier=identifier,
        guid=guid,
        n_inputs=len(declared(Inputs)),
        n_states=len(declared(State)),
        log_categories=LOG_CATEGORIES,
        c_double=lambda value, otherwise: otherwise if value is None else repr(value),
    )
