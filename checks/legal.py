"""Which FMI 2.0 function is legal in which mode: the tables of sections 3.2.3 and 4.2.4, as Python and as C."""

from collections.abc import Mapping

MODEL_EXCHANGE, CO_SIMULATION = range(2)

# The columns of the tables, by their names in fmi2_instance.h.
MODES = {
    CO_SIMULATION: ("INSTANTIATED", "INITIALIZATION", "STEP", "TERMINATED", "FAILED"),
    MODEL_EXCHANGE: ("INSTANTIATED", "INITIALIZATION", "EVENT", "CONTINUOUS", "TERMINATED"),
}

# x where a call is allowed. + where the standard does not allow it and importers do it all the same. A function that is
# not listed belongs to the other interface.
_COMMON = """
    fmi2SetDebugLogging                 x x x x x
    fmi2SetupExperiment                 x . . . .
    fmi2EnterInitializationMode         x . . . .
    fmi2ExitInitializationMode          . x . . .
    fmi2Reset                           x x x x x
    fmi2GetReal                         + x x x x
    fmi2GetInteger                      . x x x x
    fmi2GetBoolean                      . x x x x
    fmi2GetString                       . x x x x
    fmi2GetFMUstate                     x x x x x
    fmi2SetFMUstate                     x x x x x
    fmi2FreeFMUstate                    x x x x x
    fmi2SerializedFMUstateSize          x x x x x
    fmi2SerializeFMUstate               x x x x x
    fmi2DeSerializeFMUstate             x x x x x
    fmi2GetDirectionalDerivative        . x x x x
"""
_ONLY = {
    CO_SIMULATION: """
    fmi2Terminate                       . + x . .
    fmi2SetReal                         x x x . .
    fmi2SetInteger                      x x x . .
    fmi2SetBoolean                      x x x . .
    fmi2SetString                       x x x . .
    fmi2SetRealInputDerivatives         x x x . .
    fmi2GetRealOutputDerivatives        . . x x x
    fmi2DoStep                          . . x . .
    fmi2GetStatus                       . . x x .
    fmi2GetRealStatus                   . . x x .
    fmi2GetIntegerStatus                . . x x .
    fmi2GetBooleanStatus                . . x x .
    fmi2GetStringStatus                 . . x x .
""",
    MODEL_EXCHANGE: """
    fmi2Terminate                       . + x x .
    fmi2SetReal                         x x x x .
    fmi2SetInteger                      x x x . .
    fmi2SetBoolean                      x x x . .
    fmi2SetString                       x x x . .
    fmi2EnterEventMode                  . . x x .
    fmi2NewDiscreteStates               . . x . .
    fmi2EnterContinuousTimeMode         . . x . .
    fmi2CompletedIntegratorStep         . . . x .
    fmi2SetTime                         . . + x .
    fmi2SetContinuousStates             . . . x .
    fmi2GetEventIndicators              . x x x x
    fmi2GetContinuousStates             . x x x x
    fmi2GetDerivatives                  . x x x x
    fmi2GetNominalsOfContinuousStates   x x x x x
""",
}


def legal_modes(kind: int) -> Mapping[str, tuple[str, ...]]:
    """The functions of an interface, each with the modes in which it is legal."""
    rows = [line.split() for line in (_COMMON + _ONLY[kind]).splitlines() if line.strip()]
    return {
        name: tuple(mode for mode, mark in zip(MODES[kind], marks, strict=True) if mark != ".") for name, *marks in rows
    }


def legal_header() -> str:
    """legal.h: every function that takes an instance, its name, and its modes by interface."""
    tables = {kind: legal_modes(kind) for kind in MODES}
    names = [*dict.fromkeys(name for table in tables.values() for name in table), "fmi2CancelStep"]
    lines = [
        "/* Generated from checks/legal.py. */",
        "#define EACH_CALL(F) \\",
        *(f"    F({name}) \\" for name in names),
        "",
    ]
    lines += ["#define CALL_OF(name) CALL_##name,", "typedef enum { EACH_CALL(CALL_OF) N_CALLS } call;"]
    lines += ["#define NAME_OF(name) #name,", "static const char *const CALL_NAMES[N_CALLS] = {EACH_CALL(NAME_OF)};"]
    lines += ["static const int LEGAL[2][N_CALLS] = {"]
    for interface, kind in (("fmi2ModelExchange", MODEL_EXCHANGE), ("fmi2CoSimulation", CO_SIMULATION)):
        masks = (" | ".join(tables[kind].get(name, ("0",))) for name in names)
        lines += [f"    [{interface}] = {{", *(f"        {mask}," for mask in masks), "    },"]
    return "\n".join([*lines, "};", ""])
