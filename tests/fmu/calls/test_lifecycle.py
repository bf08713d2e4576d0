"""Every function in every mode of every interface: legal calls work, illegal ones are refused and change nothing."""

import ctypes
from collections.abc import Callable
from ctypes import c_size_t, c_void_p
from typing import Any

import pytest
from fmpy.fmi2 import fmi2EventInfo

from tests import fmi2, fmi3
from tests.fmi import (
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
    INTERMEDIATE,
    MODEL_EXCHANGE,
    MODES,
    OK,
    STEP,
    TERMINATED,
    WARNING,
    WITH_EVENTS,
    AnyInstance,
    Fmu,
    contents,
    integers,
    reals,
    references,
    room,
    strings,
)
from tests.fmi2 import LAST_SUCCESSFUL_TIME, TERMINATED_STATUS
from tests.fmi3 import CLOCKS, TYPES, flags
from verification.references import legal

# The modes of the standard's tables as the log names them.
_MODE = {
    "INSTANTIATED": INSTANTIATED,
    "INITIALIZATION": INITIALIZATION,
    "EVENT": EVENT,
    "CONTINUOUS": CONTINUOUS,
    "STEP": STEP,
    "INTERMEDIATE": INTERMEDIATE,
    "TERMINATED": TERMINATED,
    "FAILED": FAILED,
}
_MODES = {
    2: EVERY_MODE,
    3: [*fmi3.EVERY_MODE, (CO_SIMULATION, INTERMEDIATE), (WITH_EVENTS, INTERMEDIATE)],
}
SIGNATURES = {2: fmi2.SIGNATURES, 3: fmi3.SIGNATURES}
Call = tuple[int, int, str, str]
"""The version of FMI, the kind of instance, the mode and the function."""
LEGAL: set[Call] = {
    (version, kind, _MODE[column], function)
    for version, modes in _MODES.items()
    for kind in dict(modes)
    for function, columns in legal.legal_modes(kind, version).items()
    for column in columns
}
EVERY_CALL: list[Call] = [
    (version, kind, mode, function)
    for version, modes in _MODES.items()
    for kind, mode in modes
    for function in SIGNATURES[version]
]
EVERY_VERSION_AND_MODE = [(version, kind, mode) for version, modes in _MODES.items() for kind, mode in modes]

# Calls that lead elsewhere: from any mode to this one.
LEADS_TO = {
    "EnterInitializationMode": INITIALIZATION,
    "Terminate": TERMINATED,
    "Reset": INSTANTIATED,
    "EnterEventMode": EVENT,
    "EnterContinuousTimeMode": CONTINUOUS,
    "EnterStepMode": STEP,
}
# What cannot be asked for, as no step is ever pending.
UNAVAILABLE = {"fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"}
# What this FMU does not have is an error in every mode.
LACKING = {
    "fmi3EnterConfigurationMode": "structural parameters",
    "fmi3ExitConfigurationMode": "structural parameters",
    "fmi3GetNumberOfVariableDependencies": "dependencies by element",
    "fmi3GetVariableDependencies": "dependencies by element",
    "fmi3ActivateModelPartition": "Scheduled Execution",
}


def new(fmu: Fmu, kind: int, mode: str) -> AnyInstance:
    """An instance, with intermediate update where that is the mode."""
    if mode == INTERMEDIATE and isinstance(fmu, fmi3.Fmu):
        return fmu.instance(kind, intermediate=["u_l", "u"])
    return fmu.instance(kind)


def inside(rov: AnyInstance, mode: str, act: Callable[[], None]) -> None:
    """Do something in a mode that is reached; intermediate update is reached by a step."""
    if mode != INTERMEDIATE:
        act()
        return
    told: list[fmi3.Update] = []

    def once(_: fmi3.Instance, update: fmi3.Update) -> None:
        if not told:
            told.append(update)
            act()

    assert isinstance(rov, fmi3.Instance)
    rov.on_update = once
    assert rov.step(0.0, 1e-3) == OK
    assert told


def reach(rov: AnyInstance, mode: str) -> None:
    """As far as it goes without a step."""
    rov.reach(STEP if mode == INTERMEDIATE else mode)


def now(rov: AnyInstance, mode: str) -> Any:
    """All that an instance holds; inside a step its values."""
    return rov.get(list(rov.fmu.variables)) if mode == INTERMEDIATE else rov.save()


def good_arguments(rov: AnyInstance, function: str) -> tuple[Any, ...]:
    """Arguments with which the call succeeds where it is legal."""
    u_l, u = rov.fmu.references(["u_l"]), rov.fmu.references(["u"])
    state = c_void_p()
    rov.expect("GetFMUState", ctypes.byref(state))
    saved = rov.save(state)
    n = len(rov.fmu.states)
    alike: dict[str, tuple[Any, ...]] = {
        "SetDebugLogging": (1, 1, strings(b"logStatusError")),
        "GetFMUState": (ctypes.pointer(c_void_p()),),
        "SetFMUState": (state,),
        "FreeFMUState": (ctypes.pointer(state),),
        "SerializedFMUStateSize": (state, ctypes.pointer(c_size_t())),
        "SerializeFMUState": (state, ctypes.create_string_buffer(len(saved)), len(saved)),
        "DeserializeFMUState": (ctypes.create_string_buffer(saved), len(saved), ctypes.pointer(c_void_p())),
        "SetTime": (0.5,),
        "SetContinuousStates": (reals(*range(n)), n),
        "GetContinuousStateDerivatives": (room(n), n),
        "GetEventIndicators": (None, 0),
        "GetContinuousStates": (room(n), n),
        "GetNominalsOfContinuousStates": (room(n), n),
    }
    own: dict[str, tuple[Any, ...]] = {
        **{f"fmi2{do}{t}": (None, 0, None) for do in ("Get", "Set") for t in ("Integer", "Boolean", "String")},
        "fmi2SetupExperiment": (0, 0.0, 0.0, 1, 10.0),
        "fmi2GetReal": (references(u[0], u_l[0]), 2, room(2)),
        "fmi2SetReal": (u_l, 1, reals(0.5)),
        "fmi2GetDirectionalDerivative": (u, 1, u, 1, reals(1.0), room()),
        "fmi2NewDiscreteStates": (ctypes.pointer(fmi2EventInfo(nextEventTime=-7.0)),),
        "fmi2CompletedIntegratorStep": (1, integers(-7), integers(-7)),
        "fmi2SetRealInputDerivatives": (None, 0, None, None),
        "fmi2GetRealOutputDerivatives": (u, 1, integers(1), room()),
        "fmi2DoStep": (0.0, 0.1, 1),
        "fmi2GetStatus": (0, integers(-7)),
        "fmi2GetRealStatus": (LAST_SUCCESSFUL_TIME, room()),
        "fmi2GetIntegerStatus": (0, integers(-7)),
        "fmi2GetBooleanStatus": (TERMINATED_STATUS, integers(-7)),
        "fmi2GetStringStatus": (1, strings(None)),
        **{name: tuple(0 if t is c_size_t else None for t in of) for name, of in {**TYPES, **CLOCKS}.items()},
        "fmi3EnterInitializationMode": (False, 0.0, 0.0, True, 10.0),
        "fmi3GetFloat64": (references(u[0], u_l[0]), 2, room(2), 2),
        "fmi3SetFloat64": (u_l, 1, reals(0.5), 1),
        "fmi3GetNumberOfVariableDependencies": (u[0], ctypes.pointer(c_size_t(7))),
        "fmi3GetVariableDependencies": (u[0], *[None] * 4, 0),
        "fmi3GetDirectionalDerivative": (u, 1, u, 1, reals(1.0), 1, room(), 1),
        "fmi3GetAdjointDerivative": (u, 1, u, 1, reals(1.0), 1, room(), 1),
        "fmi3UpdateDiscreteStates": (*(flags(True) for _ in range(5)), room()),
        "fmi3CompletedIntegratorStep": (True, flags(True), flags(True)),
        "fmi3GetNumberOfEventIndicators": (ctypes.pointer(c_size_t(7)),),
        "fmi3GetNumberOfContinuousStates": (ctypes.pointer(c_size_t(7)),),
        "fmi3GetOutputDerivatives": (u, 1, integers(1), room(), 1),
        "fmi3DoStep": (0.0, 0.1, True, *(flags(True) for _ in range(3)), room()),
        "fmi3ActivateModelPartition": (0, 0.0),
        **{rov.fmu.name(name): arguments for name, arguments in alike.items()},
    }
    return own.get(function, ())


def _ids(value: str | int) -> str:
    return str(value)


def common(function: str) -> str:
    """The name without its prefix."""
    return function.removeprefix("fmi2").removeprefix("fmi3")


@pytest.mark.parametrize(("version", "kind", "mode", "function"), [c for c in EVERY_CALL if c in LEGAL], ids=_ids)
def test_a_legal_call_works_and_leads_to_the_right_mode(
    fmus: dict[int, Fmu], version: int, kind: int, mode: str, function: str
) -> None:
    after = LEADS_TO.get(common(function), mode)
    if function.endswith("ExitInitializationMode"):
        after = STEP if kind == CO_SIMULATION else EVENT
    with new(fmus[version], kind, mode) as rov:
        reach(rov, mode)
        if isinstance(rov, fmi2.Instance) and function == "fmi2EnterInitializationMode":
            rov.setup()
        arguments = good_arguments(rov, function)
        rov.log.clear()

        def act() -> None:
            assert rov.call(function, *arguments) == (DISCARD if function in UNAVAILABLE else OK), rov.log
            assert [m for m in rov.log if m.status == ERROR] == []
            assert rov.mode() == after

        inside(rov, mode, act)


@pytest.mark.parametrize(("version", "kind", "mode", "function"), [c for c in EVERY_CALL if c not in LEGAL], ids=_ids)
def test_an_illegal_call_is_refused_logs_one_line_and_changes_nothing(
    fmus: dict[int, Fmu], version: int, kind: int, mode: str, function: str
) -> None:
    other = INTERFACES[CO_SIMULATION if kind == MODEL_EXCHANGE else MODEL_EXCHANGE]
    reasons = [mode, f"only an instance for {other}", "no step is pending", LACKING.get(function, mode)]
    if (kind, mode, function) == (CO_SIMULATION, STEP, "fmi3EnterEventMode"):
        reasons = ["eventModeUsed = false"]
    with new(fmus[version], kind, mode) as rov:
        reach(rov, mode)
        arguments = good_arguments(rov, function)
        given = contents(arguments)

        def act() -> None:
            before = now(rov, mode)
            rov.log.clear()
            assert rov.call(function, *arguments) == ERROR
            (message,) = rov.log
            assert (message.status, message.category) == (ERROR, "logStatusError")
            assert message.text.startswith(f"{function}: ")
            assert any(reason in message.text for reason in reasons)
            assert now(rov, mode) == before
            assert rov.mode() == mode
            assert contents(arguments) == given

        inside(rov, mode, act)


def test_every_function_is_in_the_table() -> None:
    for version, functions in SIGNATURES.items():
        named = {name for name, *_ in legal.table(version)}
        assert named == functions.keys()


@pytest.mark.parametrize(("version", "kind", "mode"), EVERY_VERSION_AND_MODE, ids=_ids)
def test_a_variable_can_be_set_in_the_modes_of_its_causality_and_variability(
    fmus: dict[int, Fmu], version: int, kind: int, mode: str
) -> None:
    for name in fmus[version].variables:
        with new(fmus[version], kind, mode) as rov:
            reach(rov, mode)

            def act(name: str = name, rov: AnyInstance = rov) -> None:
                before = now(rov, mode)
                rov.log.clear()
                if name in fmus[version].settable(mode):
                    assert rov.set({name: 0.75}) == OK, name
                    assert now(rov, mode) != before, name
                else:
                    assert rov.set({"u_l": 0.5, name: 0.75}) == ERROR, name
                    (message,) = rov.log
                    assert message.text.startswith(f"{rov.fmu.name('SetFloat64')}: ")
                    assert mode in message.text or name == "time"
                    assert now(rov, mode) == before, name

            inside(rov, mode, act)


@pytest.mark.parametrize(("version", "kind", "mode"), EVERY_VERSION_AND_MODE, ids=_ids)
def test_every_variable_can_be_read(fmus: dict[int, Fmu], version: int, kind: int, mode: str) -> None:
    fmu = fmus[version]
    with new(fmu, kind, mode) as rov:
        reach(rov, mode)

        def act() -> None:
            assert rov.get(fmu.parameters) == [float(fmu.variables[name].start) for name in fmu.parameters]
            assert rov.get(fmu.states) == [0.0] * len(fmu.states)
            assert len(rov.get(list(fmu.variables))) == len(fmu.variables)

        inside(rov, mode, act)


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


def _warnings(rov: AnyInstance) -> list[str]:
    told = [m for m in rov.log if m.category != "logEvents"]
    assert {(m.status, m.category) for m in told} <= {(WARNING, "logStatusWarning")}
    said = [m.text for m in told]
    rov.log.clear()
    return said


def test_what_the_standard_forbids_and_importers_do_is_done_and_warned_of_once(fmu: Fmu) -> None:
    n = max(fmu.vr.values()) + 1
    with fmu.instance(MODEL_EXCHANGE) as rov:
        for _ in range(2):  # again after a reset
            assert rov.get_by(references(n), reals(0.0)) == ERROR
            assert [m.status for m in rov.log] == [ERROR]  # what is refused is not warned of
            rov.log.clear()
            for _ in range(3):
                assert rov.get(["alpha_u"]) == [float(fmu.variables["alpha_u"].start)]
            (said,) = _warnings(rov)
            assert said.startswith(f"{fmu.name('GetFloat64')}: ")
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
            assert said.startswith(f"{fmu.name('SetFloat64')}: beta_u ")
            rov.expect("EnterEventMode")
            assert rov.set({"beta_r": 0.5}) == OK
            assert _warnings(rov) == []
            rov.expect("Reset")
            rov.reach(INITIALIZATION)
            rov.expect("Terminate")
            (said,) = _warnings(rov)
            assert said.startswith(f"{fmu.name('Terminate')}: ")
            rov.expect("Reset")
            rov.log.clear()


def test_warnings_are_no_part_of_the_state(fmu: Fmu) -> None:
    with fmu.instance() as rov, fmu.instance() as quiet:
        new = rov.save()
        rov.get(["u"])
        assert rov.save() == new
        assert rov.load(new) == OK
        rov.get(["u"])
        assert len(_warnings(rov)) == 1
        quiet.expect("SetDebugLogging", 0, 1, strings(b"logStatusWarning"))
        quiet.get(["u"])
        assert quiet.log == []
        quiet.expect("SetDebugLogging", 1, 1, strings(b"logStatusWarning"))
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
        rov.expect("Reset")
        assert rov.mode() == INSTANTIATED
        assert rov.save() == new
        rov.reach(mode)
        assert rov.mode() == mode


@pytest.mark.parametrize("kind", MODES, ids=_ids)
def test_initialization_is_refused_without_an_experiment(fmu2: fmi2.Fmu, kind: int) -> None:
    with fmu2.instance(kind) as rov:
        rov.setup()
        rov.expect("Reset")  # the experiment is forgotten, too
        assert rov.call("fmi2EnterInitializationMode") == ERROR
        assert "fmi2SetupExperiment" in rov.log[-1].text
        assert rov.mode() == INSTANTIATED


def test_a_step_that_overflows_leads_to_error_mode_with_the_state_from_before(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start({"u": 0.5, "psi": 0.25, "V_N": 1e308, "x": 3.0})
        assert rov.step(0.0, 0.5) == OK
        before = rov.get(list(fmu.variables))
        state = c_void_p()
        rov.expect("GetFMUState", ctypes.byref(state))
        rov.log.clear()
        assert rov.step(0.5, 5.0) == ERROR
        (message,) = rov.log
        assert message.text.startswith(f"{fmu.name('DoStep')}: ")
        assert "overflow" in message.text
        assert rov.mode() == FAILED
        assert rov.get(list(fmu.variables)) == before
        rov.expect("SetFMUState", state)  # the way back
        assert rov.mode() == STEP
        assert rov.step(0.5, 0.5) == OK
        rov.expect("FreeFMUState", ctypes.byref(state))


@pytest.mark.parametrize(("logging", "modes"), [(False, 0), (True, 4)])
def test_changes_of_mode_are_logged_only_where_logging_is_on(fmu: Fmu, logging: bool, modes: int) -> None:
    with fmu.instance(MODEL_EXCHANGE, logging=logging) as rov:
        rov.reach(CONTINUOUS)
        rov.expect("Terminate")
        events = [m for m in rov.log if m.category == "logEvents"]
        assert len(events) == modes
        assert all(m.status == OK for m in events)
        rov.log.clear()
        rov.expect("Reset")
        assert [(m.status, m.category) for m in rov.log] == [(OK, "logEvents")] * logging


@pytest.mark.parametrize("kind", [MODEL_EXCHANGE, CO_SIMULATION])
def test_without_logging_fmi_3_tells_nothing_until_it_is_switched_on(fmu: Fmu, kind: int) -> None:
    with fmu.instance(kind, logging=False) as rov:
        assert rov.call("ExitInitializationMode") == ERROR
        told = ["logStatusError"] if fmu.VERSION == 2 else []
        assert [m.category for m in rov.log] == told
        rov.log.clear()
        rov.expect("SetDebugLogging", True, 1, strings(b"logStatusError"))
        assert rov.call("ExitInitializationMode") == ERROR
        assert [m.category for m in rov.log] == ["logStatusError"]


def test_the_libraries_are_those_of_the_standard(fmu2: fmi2.Fmu, fmu3: fmi3.Fmu) -> None:
    assert fmu2.dll.fmi2GetVersion() == b"2.0"
    assert fmu2.dll.fmi2GetTypesPlatform() == b"default"
    assert fmu3.dll.fmi3GetVersion() == b"3.0"
