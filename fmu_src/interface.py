"""Every FMU variable, declared once.

modelDescription.xml, the C structs and value references, the documentation and the PythonFMU registration are all
derived from `variables`. The order is that of the C struct `rov_variables`: inputs, state, derivative, thrust,
coefficients; the value reference of a variable is its place in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import degrees

from models.dynamics import COEFFICIENTS, Coefficients, Inputs, State, Thrust


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


# name: description, unit, nominal
_INPUTS = {
    "u_l": ("Left thruster command u_l, positive forward; saturates at ±1", "1", 1.0),
    "u_r": ("Right thruster command u_r, positive forward; saturates at ±1", "1", 1.0),
    "u_t": ("Top thruster command u_t, positive down; saturates at ±1", "1", 1.0),
    "X_ext": ("Load from outside in surge (tether, contact), positive forward", "N", 10.0),
    "Z_ext": ("Load from outside in heave (tether, ballast), positive down", "N", 10.0),
    "N_ext": ("Load from outside in yaw (tether, contact), positive bow to starboard", "N.m", 1.0),
    "V_N": ("Velocity of a steady horizontal current, northward", "m/s", 1.0),
    "V_E": ("Velocity of a steady horizontal current, eastward", "m/s", 1.0),
}
_COMMANDS = ("u_l", "u_r", "u_t")

# name: description, unit, nominal, and of the derivative: description, unit, dependencies
_STATES = {
    "u": ("Surge velocity u through the water, positive forward", "m/s", 1.0),
    "w": ("Heave velocity w through the water, positive down", "m/s", 1.0),
    "r": ("Yaw velocity r, positive bow to starboard", "rad/s", 1.0),
    "x": ("Position north x", "m", 10.0),
    "y": ("Position east y", "m", 10.0),
    "z": ("Depth z, positive down", "m", 10.0),
    "psi": ("Heading ψ, positive north to east, not wrapped", "rad", 1.0),
}
_DERIVATIVES = {
    "u": (
        "Surge acceleration, (18a)",
        "m/s2",
        {"u_l": "dependent", "u_r": "dependent", "X_ext": "tunable", "u": "dependent"},
    ),
    "w": ("Heave acceleration, (18b)", "m/s2", {"u_t": "dependent", "Z_ext": "tunable", "w": "dependent"}),
    "r": (
        "Yaw acceleration, (18c)",
        "rad/s2",
        {"u_l": "dependent", "u_r": "dependent", "N_ext": "tunable", "r": "dependent"},
    ),
    "x": (
        "Velocity over ground northward, u cos ψ + V_N",
        "m/s",
        {"V_N": "constant", "u": "dependent", "psi": "dependent"},
    ),
    "y": (
        "Velocity over ground eastward, u sin ψ + V_E",
        "m/s",
        {"V_E": "constant", "u": "dependent", "psi": "dependent"},
    ),
    "z": ("Rate of change of depth, w", "m/s", {"w": "constant"}),
    "psi": ("Rate of change of heading, r", "rad/s", {"r": "constant"}),
}
_THRUST = {
    "F_l": ("Thrust of the left thruster F_l, half of (9) for the pair", "N", ("u_l",)),
    "F_r": ("Thrust of the right thruster F_r, half of (9) for the pair", "N", ("u_r",)),
    "F_t": ("Thrust of the top thruster F_t, (10), positive down", "N", ("u_t",)),
    "tau_rear": ("Torque of the rear thrusters τ_rear, (4), positive bow to starboard", "N.m", ("u_l", "u_r")),
}

# Which coefficients each calculated variable depends on during initialization.
_REAR = ("a_t_rear", "b_t_rear")
_TOP = ("a_t_top", "b_t_top")
_ARM = ("R", "gamma")
PARAMETERS_OF: dict[str, tuple[str, ...]] = {
    "F_l": _REAR,
    "F_r": _REAR,
    "F_t": _TOP,
    "tau_rear": _REAR + _ARM,
    "der(u)": (*_REAR, "m_rov", "a_d_u", "b_d_u", "alpha_u", "beta_u"),
    "der(w)": (*_TOP, "m_rov", "a_d_w", "b_d_w", "alpha_w", "beta_w"),
    "der(r)": (*_REAR, *_ARM, "I_r", "a_d_r", "b_d_r", "alpha_r", "beta_r"),
}


def variables(coefficients: Coefficients) -> tuple[Variable, ...]:
    """All variables of the FMU of a vehicle, in the order of their value references."""
    result: list[Variable] = []

    def add(name: str, description: str, unit: str, causality: str, variability: str, **rest: object) -> None:
        result.append(Variable(name, len(result), description, unit, causality, variability, **rest))  # type: ignore[arg-type]

    for name in _names(Inputs):
        description, unit, nominal = _INPUTS[name]
        bounds = {"minimum": -1.0, "maximum": 1.0} if name in _COMMANDS else {}
        add(name, description, unit, "input", "continuous", start=0.0, display_unit=UNITS[unit].display,
            nominal=nominal, **bounds)  # fmt: skip
    for name in _names(State):
        description, unit, nominal = _STATES[name]
        add(name, description, unit, "output", "continuous", initial="exact", start=0.0,
            display_unit=UNITS[unit].display, nominal=nominal, dependencies={name: "constant"})  # fmt: skip
    for name in _names(State):
        description, unit, known = _DERIVATIVES[name]
        add(f"der({name})", description, unit, "local", "continuous", initial="calculated",
            display_unit=UNITS[unit].display, derivative_of=name, dependencies=known)  # fmt: skip
    for name in _names(Thrust):
        description, unit, commands = _THRUST[name]
        add(name, description, unit, "output", "continuous", initial="calculated",
            dependencies=dict.fromkeys(commands, "dependent"))  # fmt: skip
    for name in _names(Coefficients):
        meta = COEFFICIENTS[name]
        add(name, meta.description, meta.unit, "parameter", "tunable" if meta.tunable else "fixed", initial="exact",
            start=getattr(coefficients, name), minimum=meta.minimum, maximum=meta.maximum,
            display_unit=None if meta.unit == "1" else UNITS[meta.unit].display)  # fmt: skip
    return tuple(result)


def _names(struct: type) -> list[str]:
    return [f.name for f in fields(struct)]


# Names by the standard (2.2.4) and what is said in each.
LOG_CATEGORIES = {
    "logEvents": "Changes of mode: initialization, event mode, reset, termination",
    "logStatusWarning": "A command beyond ±1 that saturates",
    "logStatusDiscard": "A value refused by fmi2SetReal or by a solver's state: not finite, or outside min ... max",
    "logStatusError": "Illegal calls and arguments, steps past stopTime, results that overflow",
}

# ---- The same declaration for the C compiler -----------------------------------------------------------------------


def model_header() -> str:
    """model.h: the structs of the mathematics, members in the order of the value references."""
    structs = {
        "rov_inputs": Inputs,
        "rov_state": State,
        "rov_thrust": Thrust,
        "rov_coefficients": Coefficients,
    }
    lines = [
        "/* Generated from fmu_src/interface.py: the variables of the model. */",
        "#ifndef MODEL_H",
        "#define MODEL_H",
        "",
    ]
    for name, struct in structs.items():
        lines += ["typedef struct {", *(f"    double {member};" for member in _names(struct)), f"}} {name};", ""]
    lines += [
        "typedef struct {",
        "    rov_inputs inputs;",
        "    rov_state state;",
        "    rov_state derivative;",
        "    rov_thrust thrust;",
        "    rov_coefficients coefficients;",
        "} rov_variables;",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def interface_header(variables: tuple[Variable, ...], identifier: str, guid: str) -> str:
    """interface.h: what the FMI layer knows of the variables, and the names of the functions in a static library."""
    kinds = {
        "input": "INPUT",
        "output": "CALCULATED",
        "local": "CALCULATED",
        "parameter": "FIXED",
    }
    rows = []
    for v in variables:
        kind = "STATE" if v.causality == "output" and v.initial == "exact" else kinds[v.causality]
        kind = "TUNABLE" if v.variability == "tunable" else kind
        low = "-INFINITY" if v.minimum is None else repr(v.minimum)
        high = "INFINITY" if v.maximum is None else repr(v.maximum)
        rows.append(f'    {{"{v.name}", {kind}, {v.start or 0.0!r}, {low}, {high}, {v.nominal or 1.0!r}}},')
    return "\n".join(
        [
            "/* Generated from fmu_src/interface.py: the FMI interface of the model. */",
            "#ifndef INTERFACE_H",
            "#define INTERFACE_H",
            "",
            f"#define FMI2_FUNCTION_PREFIX {identifier}_",
            '#include "fmi2Functions.h"',
            "",
            "#include <math.h>",
            "",
            f'#define MODEL_GUID "{guid}"',
            f"#define N_VARIABLES {len(variables)}",
            f"#define N_STATES {len(_names(State))}",
            f"#define FIRST_STATE {len(_names(Inputs))}",
            f"#define FIRST_CALCULATED {len(_names(Inputs)) + len(_names(State))}",
            "",
            f"typedef enum {{ {', '.join(LOG_CATEGORIES)}, N_LOG_CATEGORIES }} log_category;",
            "",
            "static const char *const LOG_CATEGORIES[N_LOG_CATEGORIES] = {",
            *(f'    "{name}",' for name in LOG_CATEGORIES),
            "};",
            "",
            "typedef enum { INPUT, STATE, CALCULATED, FIXED, TUNABLE } variable_kind;",
            "",
            "typedef struct {",
            "    const char *name;",
            "    variable_kind kind;",
            "    double start, minimum, maximum, nominal;",
            "} variable_info;",
            "",
            "/* by value reference */",
            "static const variable_info VARIABLES[N_VARIABLES] = {",
            *rows,
            "};",
            "",
            "#endif",
            "",
        ]
    )
