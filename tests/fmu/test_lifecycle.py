"""Every function in every mode of both interfaces: legal calls work, illegal ones are refused and change nothing."""

import ctypes
from ctypes import c_size_t, c_void_p
from typing import Any

import pytest
from fmpy.fmi2 import fmi2EventInfo

from checks import legal
from tests.fmi2 import (
    CO_SIMULATION,
    CONTINUOUS,
    DISCARD,
    ERROR,
    EVENT,
    EVERY_MODE,
    FAILED,
    INITIALIZATION,
    INSTANTIATED,
    INTERFACES,
    LAST_SUCCESSFUL_TIME,
    MODEL_EXCHANGE,
    MODES,
    OK,
    SIGNATURES,
    STEP,
    TERMINATED,
    TERMINATED_STATUS,
    WARNING,
    Fmu,
    Instance,
    integers,
    reals,
    references,
    strings,
)

# The modes of the standard's tables as the log names them.
_MODE = {column: mode for kind in MODES for column, mode in zip(legal.MODES[kind], MODES[kind], strict=True)}
LEGAL = {
    (kind, function, _MODE[column])
    for kind in MODES
    for function, columns in legal.legal_modes(kind).items()
    for column in columns
}
EVERY_CALL = [(kind, mode, function) for kind, mode in EVERY_MODE for function in SIGNATURES]

# Calls that lead elsewhere: from any mode to this one.
LEADS_TO = {
    "fmi2EnterInitializationMode": INITIALIZATION,
    "fmi2Terminate": TERMINATED,
    "fmi2Reset": INSTANTIATED,
    "fmi2EnterEventMode": EVENT,
    "fmi2EnterContinuousTimeMode": CONTINUOUS,
}
# What cannot be asked for, as no step is ever pending.
UNAVAILABLE = {"fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"}


def good_arguments(rov: Instance, function: str) -> tuple[Any, ...]:
    """Arguments with which the call succeeds where it is legal."""
    u_l, u = rov.fmu.vr["u_l"], rov.fmu.vr["u"]
    state = c_void_p()
    rov.expect("fmi2GetFMUstate", ctypes.byref(state))
    saved = rov.save(state)
    n = len(rov.fmu.states)
    getting = {f"fmi2Get{t}": (None, 0, None) for t in ("Integer", "Boolean", "String")}
    setting = {f"fmi2Set{t}": (None, 0, None) for t in ("Integer", "Boolean", "String")}
    stateless: dict[str, tuple[Any, ...]] = {
        **getting,
        **setting,
        "fmi2SetDebugLogging": (1, 1, strings(b"logStatusError")),
        "fmi2SetupExperiment": (0, 0.0, 0.0, 1, 10.0),
        "fmi2GetReal": (references(u, u_l), 2, reals(-7.0, -7.0)),
        "fmi2SetReal": (references(u_l), 1, reals(0.5)),
        "fmi2GetFMUstate": (ctypes.pointer(c_void_p()),),
        "fmi2SetFMUstate": (state,),
        "fmi2FreeFMUstate": (ctypes.pointer(state),),
        "fmi2SerializedFMUstateSize": (state, ctypes.pointer(c_size_t())),
        "fmi2SerializeFMUstate": (state, ctypes.create_string_buffer(len(saved)), len(saved)),
        "fmi2DeSerializeFMUstate": (ctypes.create_string_buffer(saved), len(saved), ctypes.pointer(c_void_p())),
        "fmi2GetDirectionalDerivative": (references(u), 1, references(u), 1, reals(1.0), reals(-7.0)),
        "fmi2NewDiscreteStates": (ctypes.pointer(fmi2EventInfo(nextEventTime=-7.0)),),
        "fmi2CompletedIntegratorStep": (1, integers(-7), integers(-7)),
        "fmi2SetTime": (0.5,),
        "fmi2SetContinuousStates": (reals(*range(n)), n),
        "fmi2GetDerivatives": (reals(*[-7.0] * n), n),
        "fmi2GetEventIndicators": (None, 0),
        "fmi2GetContinuousStates": (reals(*[-7.0] * n), n),
        "fmi2GetNominalsOfContinuousStates": (reals(*[-7.0] * n), n),
        "fmi2SetRealInputDerivatives": (None, 0, None, None),
        "fmi2GetRealOutputDerivatives": (references(u), 1, integers(1), reals(-7.0)),
        "fmi2DoStep": (0.0, 0.1, 1),
        "fmi2GetStatus": (0, integers(-7)),
        "fmi2GetRealStatus": (LAST_SUCCESSFUL_TIME, reals(-7.0)),
        "fmi2GetIntegerStatus": (0, integers(-7)),
        "fmi2GetBooleanStatus": (TERMINATED_STATUS, integers(-7)),
        "fmi2GetStringStatus": (1, strings(None)),
    }
    return stateless.get(function, ())


def contents(arguments: tuple[Any, ...]) -> list[bytes]:
    """What the arguments point to."""
    pointed = [a.contents if hasattr(a, "contents") else a for a in arguments]
    return [bytes(a) for a in pointed if isinstance(a, (ctypes.Array, ctypes.Structure, c_void_p, c_size_t))]


def _ids(value: str | int) -> str:
    return INTERFACES[value] if isinstance(value, int) else value


@pytest.mark.parametrize(("kind", "mode", "function"), [c for c in EVERY_CALL if (c[0], c[2], c[1]) in LEGAL], ids=_ids)
def test_a_legal_call_works_and_leads_to_the_right_mode(fmu: Fmu, kind: int, mode: str, function: str) -> None:
    after = LEADS_TO.get(function, mode)
    if function == "fmi2ExitInitializationMode":
        after = STEP if kind == CO_SIMULATION else EVENT
    with fmu.instance(kind) as rov:
        rov.reach(mode)
        if function == "fmi2EnterInitializationMode":
            rov.setup()
        arguments = good_arguments(rov, function)
        rov.log.clear()
        assert rov.call(function, *arguments) == (DISCARD if function in UNAVAILABLE else OK), rov.log
        assert [m for m in rov.log if m.status == ERROR] == []
        assert rov.mode() == after


@pytest.mark.parametrize(
    ("kind", "mode", "function"), [c for c in EVERY_CALL if (c[0], c[2], c[1]) not in LEGAL], ids=_ids
)
def test_an_illegal_call_is_refused_logs_one_line_and_changes_nothing(
    fmu: Fmu, kind: int, mode: str, function: str
) -> None:
    with fmu.instance(kind) as rov:
        rov.reach(mode)
        arguments = good_arguments(rov, function)
        before, given = rov.save(), contents(arguments)
        rov.log.clear()
        assert rov.call(function, *arguments) == ERROR
        (message,) = rov.log
        assert (message.status, message.category) == (ERROR, "logStatusError")
        assert message.text.startswith(f"{function}: ")
        reasons = (mode, f"only an instance for {INTERFACES[1 - kind]}", "no step is pending")
        assert any(reason in message.text for reason in reasons)
        assert rov.save() == before
        assert contents(arguments) == given


def settable(mode: str, variable: Any) -> bool:
    """Conditions 1, 3, 4, 5 and 6 of the tables; + inputs before initialization and tuning in Continuous-Time Mode."""
    if variable.causality == "input":
        return mode not in (TERMINATED, FAILED)
    if mode in (INSTANTIATED, INITIALIZATION):
        return bool(variable.initial == "exact")
    if mode in (STEP, EVENT, CONTINUOUS) and variable.variability == "tunable":
        return True
    return mode == CONTINUOUS and variable.causality == "output" and variable.initial == "exact"


@pytest.mark.parametrize(("kind", "mode"), EVERY_MODE, ids=_ids)
def test_a_variable_can_be_set_in_the_modes_of_its_causality_and_variability(fmu: Fmu, kind: int, mode: str) -> None:
    for name, variable in fmu.variables.items():
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            before = rov.save()
            rov.log.clear()
            if settable(mode, variable):
                assert rov.set({name: 0.75}) == OK, name
                assert rov.save() != before, name
            else:
                assert rov.set({"u_l": 0.5, name: 0.75}) == ERROR, name
                (message,) = rov.log
                assert message.text.startswith("fmi2SetReal: ")
                assert mode in message.text
                assert rov.save() == before, name


@pytest.mark.parametrize(("kind", "mode"), EVERY_MODE, ids=_ids)
def test_every_variable_can_be_read(fmu: Fmu, kind: int, mode: str) -> None:
    with fmu.instance(kind) as rov:
        rov.reach(mode)
        assert rov.get(fmu.parameters) == [float(fmu.variables[name].start) for name in fmu.parameters]
        assert rov.get(fmu.states) == [0.0] * len(fmu.states)
        assert len(rov.get(list(fmu.variables))) == len(fmu.variables)


@pytest.mark.parametrize("kind", MODES, ids=_ids)
def test_what_is_calculated_can_be_read_right_after_instantiation(fmu: Fmu, kind: int) -> None:
    calculated = [name for name in fmu.outputs + fmu.derivatives if name not in fmu.states]
    values = {"u_l": 0.5, "u_t": -0.25, "u": 0.4, "r": -0.2, "psi": 1.0, "beta_u": 0.5, "m_rov": 9.0}
    with fmu.instance(kind) as rov:
        assert rov.get(calculated) == [0.0] * len(calculated)  # at rest, nothing pushes
        assert rov.set(values) == OK
        early = rov.get(calculated)
        rov.start(values)
        assert rov.get(calculated) == early
        assert {name for name, value in zip(calculated, early, strict=True) if value == 0.0} == {"F_r", "der(z)"}


def _warnings(rov: Instance) -> list[str]:
    assert {(m.status, m.category) for m in rov.log} <= {(WARNING, "logStatusWarning")}
    said = [m.text for m in rov.log]
    rov.log.clear()
    return said


def test_what_the_standard_forbids_and_importers_do_is_done_and_warned_of_once(fmu: Fmu) -> None:
    n = len(fmu.variables)
    with fmu.instance(MODEL_EXCHANGE) as rov:
        for _ in range(2):  # again after a reset
            assert rov.call("fmi2GetReal", references(n), 1, reals(0.0)) == ERROR
            assert [m.status for m in rov.log] == [ERROR]  # what is refused is not warned of
            rov.log.clear()
            for _ in range(3):
                assert rov.get(["alpha_u"]) == [float(fmu.variables["alpha_u"].start)]
            (said,) = _warnings(rov)
            assert said.startswith("fmi2GetReal: ")
            rov.reach(CONTINUOUS)
            assert rov.set({"u_l": 0.5, "u": 0.1}) == OK
            assert _warnings(rov) == []
            before = rov.get(["der(u)"])
            assert rov.set({"beta_u": 0.5, "m_rov": 7.0}) == ERROR
            rov.log.clear()
            for value in (0.5, 0.25):
                assert rov.set({"beta_u": value, "alpha_w": value}) == OK
                assert rov.get(["beta_u", "alpha_w"]) == [value, value]
            assert rov.get(["der(u)"])[0] == pytest.approx(before[0] * 0.25 / float(fmu.variables["beta_u"].start))
            (said,) = _warnings(rov)
            assert said.startswith("fmi2SetReal: beta_u ")
            rov.expect("fmi2EnterEventMode")
            assert rov.set({"beta_r": 0.5}) == OK
            assert _warnings(rov) == []
            rov.expect("fmi2Reset")
            rov.setup()
            rov.expect("fmi2EnterInitializationMode")
            rov.expect("fmi2Terminate")
            (said,) = _warnings(rov)
            assert said.startswith("fmi2Terminate: ")
            rov.expect("fmi2Reset")


def test_warnings_are_no_part_of_the_state(fmu: Fmu) -> None:
    with fmu.instance() as rov, fmu.instance() as quiet:
        new = rov.save()
        rov.get(["u"])
        assert rov.save() == new
        assert rov.load(new) == OK
        rov.get(["u"])
        assert len(_warnings(rov)) == 1
        quiet.expect("fmi2SetDebugLogging", 0, 1, strings(b"logStatusWarning"))
        quiet.get(["u"])
        assert quiet.log == []
        quiet.expect("fmi2SetDebugLogging", 1, 1, strings(b"logStatusWarning"))
        quiet.get(["u"])  # what was not heard has not been said
        assert len(_warnings(quiet)) == 1


@pytest.mark.parametrize(("kind", "mode"), EVERY_MODE, ids=_ids)
def test_an_instance_can_be_freed_in_every_mode(fmu: Fmu, kind: int, mode: str) -> None:
    rov = fmu.instance(kind)
    rov.reach(mode)
    rov.log.clear()
    rov.free()
    assert rov.log == []
    with fmu.instance(kind) as another:
        another.reach(mode)


@pytest.mark.parametrize(("kind", "mode"), EVERY_MODE, ids=_ids)
def test_reset_leads_from_every_mode_to_what_was_instantiated(fmu: Fmu, kind: int, mode: str) -> None:
    with fmu.instance(kind) as rov:
        new = rov.save()
        assert rov.set({"u": 1.0, "beta_u": 0.5, "m_rov": 9.0, "u_l": 0.3}) == OK
        rov.reach(mode)
        assert rov.save() != new
        rov.expect("fmi2Reset")
        assert rov.mode() == INSTANTIATED
        assert rov.save() == new
        assert rov.call("fmi2EnterInitializationMode") == ERROR  # the experiment is forgotten, too
        rov.reach(mode)
        assert rov.mode() == mode


@pytest.mark.parametrize("kind", MODES, ids=_ids)
def test_initialization_is_refused_without_an_experiment(fmu: Fmu, kind: int) -> None:
    with fmu.instance(kind) as rov:
        assert rov.call("fmi2EnterInitializationMode") == ERROR
        assert "fmi2SetupExperiment" in rov.log[-1].text
        assert rov.mode() == INSTANTIATED


def test_a_step_that_overflows_leads_to_error_mode_with_the_state_from_before(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start({"u": 0.5, "psi": 0.25, "V_N": 1e308, "x": 3.0})
        assert rov.step(0.0, 0.5) == OK
        before = rov.get(list(fmu.variables))
        state = c_void_p()
        rov.expect("fmi2GetFMUstate", ctypes.byref(state))
        rov.log.clear()
        assert rov.step(0.5, 5.0) == ERROR
        (message,) = rov.log
        assert message.text.startswith("fmi2DoStep: ")
        assert "overflow" in message.text
        assert rov.mode() == FAILED
        assert rov.get(list(fmu.variables)) == before
        rov.expect("fmi2SetFMUstate", state)  # the way back
        assert rov.mode() == STEP
        assert rov.step(0.5, 0.5) == OK
        rov.expect("fmi2FreeFMUstate", ctypes.byref(state))


@pytest.mark.parametrize(("logging", "modes"), [(False, 0), (True, 4)])
def test_changes_of_mode_are_logged_only_where_logging_is_on(fmu: Fmu, logging: bool, modes: int) -> None:
    with fmu.instance(MODEL_EXCHANGE, logging=logging) as rov:
        rov.reach(CONTINUOUS)
        rov.expect("fmi2Terminate")
        events = [m for m in rov.log if m.category == "logEvents"]
        assert len(events) == modes
        assert all(m.status == OK for m in events)
        rov.log.clear()
        rov.expect("fmi2Reset")
        assert [(m.status, m.category) for m in rov.log] == [(OK, "logEvents")] * logging


def test_the_library_is_that_of_the_standard(fmu: Fmu) -> None:
    assert fmu.dll.fmi2GetVersion() == b"2.0"
    assert fmu.dll.fmi2GetTypesPlatform() == b"default"
