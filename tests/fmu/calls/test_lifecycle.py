"""Every function in every mode of every interface: a legal call works, an illegal one is refused and has no effect."""

import ctypes
from collections.abc import Callable
from ctypes import c_size_t, c_void_p
from typing import Any

import pytest
from fmpy.fmi2 import fmi2EventInfo

from tests import fmi, fmi2, fmi3
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
from tests.fmi3 import ABSENT, flags
from tests.fmu.calls.conftest import WRAPPERS, failures, modes_of
from verification.references import legal

in_every_mode = pytest.mark.parametrize(
    ("version", "kind", "mode"),
    [
        *((version, *case) for version in WRAPPERS for case in modes_of(version)),
        *((3, kind, INTERMEDIATE) for kind in (CO_SIMULATION, WITH_EVENTS)),
    ],
)
LEADS_TO = {
    "EnterInitializationMode": INITIALIZATION,
    "Terminate": TERMINATED,
    "Reset": INSTANTIATED,
    "EnterEventMode": EVENT,
    "EnterContinuousTimeMode": CONTINUOUS,
    "EnterStepMode": STEP,
}
"""The modes to which calls lead from any mode, by the functions' common names."""
UNAVAILABLE = {"fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"}
"""Functions that are legal but have nothing to return, because no step is ever pending."""
LACKING = {
    "fmi3EnterConfigurationMode": "structural parameters",
    "fmi3ExitConfigurationMode": "structural parameters",
    "fmi3GetNumberOfVariableDependencies": "dependencies by element",
    "fmi3GetVariableDependencies": "dependencies by element",
    "fmi3ActivateModelPartition": "Scheduled Execution",
}
"""Functions for features that this FMU does not have: a call is an error in every mode, and the message names these."""


def new(fmu: Fmu, kind: int, mode: str) -> AnyInstance:
    """Return an instance, which has intermediate update if that is the mode to reach."""
    if mode == INTERMEDIATE and isinstance(fmu, fmi3.Fmu):
        return fmu.instance(kind, intermediate=["u_l", "u"])
    return fmu.instance(kind)


def inside(rov: AnyInstance, mode: str, act: Callable[[], None]) -> None:
    """Call `act` in a mode that `reach` has prepared. Intermediate Update Mode is entered by a step."""
    if mode != INTERMEDIATE:
        act()
        return
    updates: list[fmi3.Update] = []

    def act_once(_: fmi3.Instance, update: fmi3.Update) -> None:
        updates.append(update)
        if len(updates) == 1:
            act()

    assert isinstance(rov, fmi3.Instance)
    rov.on_update = act_once
    rov.step(0.0, 1e-3)
    assert updates


def reach(rov: AnyInstance, mode: str) -> None:
    """Go to a mode. Intermediate Update Mode exists only inside a step, so Step Mode is reached for it."""
    rov.reach(STEP if mode == INTERMEDIATE else mode)


def now(rov: AnyInstance, mode: str) -> Any:
    """Return all that an instance holds: its serialized state, or inside a step the values of its variables."""
    return rov.get(list(rov.fmu.variables)) if mode == INTERMEDIATE else rov.save()


def good_arguments(rov: AnyInstance) -> dict[str, tuple[Any, ...]]:
    """Return arguments for every function, with which a call succeeds in the modes in which it is legal."""
    u_l, u = rov.fmu.references(["u_l"]), rov.fmu.references(["u"])
    state = c_void_p()
    rov.expect("GetFMUState", ctypes.byref(state))
    saved = rov.save(state)
    n, sized = len(rov.fmu.states), rov.fmu.sized
    by_common_name: dict[str, tuple[Any, ...]] = {
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
        "GetFloat64": (references(u[0], u_l[0]), 2, *sized(room(2))),
        "SetFloat64": (u_l, 1, *sized(reals(0.5))),
        "GetDirectionalDerivative": (u, 1, u, 1, *sized(reals(1.0)), *sized(room())),
        "GetAdjointDerivative": (u, 1, u, 1, *sized(reals(1.0)), *sized(room())),
        "GetOutputDerivatives": (u, 1, integers(1), *sized(room())),
    }
    given: dict[str, tuple[Any, ...]] = {
        **{f"fmi2{do}{t}": (None, 0, None) for do in ("Get", "Set") for t in ("Integer", "Boolean", "String")},
        "fmi2SetupExperiment": (0, 0.0, 0.0, 1, 10.0),
        "fmi2NewDiscreteStates": (ctypes.pointer(fmi2EventInfo(nextEventTime=-7.0)),),
        "fmi2CompletedIntegratorStep": (1, integers(-7), integers(-7)),
        "fmi2SetRealInputDerivatives": (None, 0, None, None),
        "fmi2DoStep": (0.0, 0.1, 1),
        "fmi2GetStatus": (0, integers(-7)),
        "fmi2GetRealStatus": (LAST_SUCCESSFUL_TIME, room()),
        "fmi2GetIntegerStatus": (0, integers(-7)),
        "fmi2GetBooleanStatus": (TERMINATED_STATUS, integers(-7)),
        "fmi2GetStringStatus": (1, strings(None)),
        **{name: tuple(0 if t is c_size_t else None for t in of) for name, of in ABSENT.items()},
        "fmi3EnterInitializationMode": (False, 0.0, 0.0, True, 10.0),
        "fmi3GetNumberOfVariableDependencies": (u[0], ctypes.pointer(c_size_t(7))),
        "fmi3GetVariableDependencies": (u[0], *[None] * 4, 0),
        "fmi3UpdateDiscreteStates": (*(flags(True) for _ in range(5)), room()),
        "fmi3CompletedIntegratorStep": (True, flags(True), flags(True)),
        "fmi3GetNumberOfEventIndicators": (ctypes.pointer(c_size_t(7)),),
        "fmi3GetNumberOfContinuousStates": (ctypes.pointer(c_size_t(7)),),
        "fmi3DoStep": (0.0, 0.1, True, *(flags(True) for _ in range(3)), room()),
        "fmi3ActivateModelPartition": (0, 0.0),
        **{rov.fmu.name(name): arguments for name, arguments in by_common_name.items()},
    }
    return {function: given.get(function, ()) for function in rov.fmu.SIGNATURES}


def legal_functions(version: int, kind: int, mode: str) -> list[str]:
    """Return the functions that the standard allows in a mode."""
    modes = legal.legal_modes(kind, version)
    return [f for f in WRAPPERS[version].SIGNATURES if mode in (getattr(fmi, column) for column in modes.get(f, ()))]


def mode_after(function: str, kind: int, mode: str) -> str:
    """Return the mode to which a legal call leads."""
    if function.endswith("ExitInitializationMode"):
        return STEP if kind == CO_SIMULATION else EVENT
    return LEADS_TO.get(function.removeprefix("fmi2").removeprefix("fmi3"), mode)


def reasons_for_refusal(function: str, kind: int, mode: str) -> list[str]:
    """Return the texts of which the message about an illegal call contains at least one."""
    if (kind, mode, function) == (CO_SIMULATION, STEP, "fmi3EnterEventMode"):
        return ["eventModeUsed = false"]
    other = INTERFACES[CO_SIMULATION if kind == MODEL_EXCHANGE else MODEL_EXCHANGE]
    return [mode, f"only an instance for {other}", "no step is pending", LACKING.get(function, mode)]


@in_every_mode
def test_every_legal_call_works_and_leads_to_the_right_mode(
    fmus: dict[int, Fmu], version: int, kind: int, mode: str
) -> None:
    def check(function: str) -> None:
        with new(fmus[version], kind, mode) as rov:
            reach(rov, mode)
            if isinstance(rov, fmi2.Instance) and function == "fmi2EnterInitializationMode":
                rov.setup()
            arguments = good_arguments(rov)[function]
            rov.log.clear()

            def act() -> None:
                assert rov.call(function, *arguments) == (DISCARD if function in UNAVAILABLE else OK), rov.log
                assert [m for m in rov.log if m.status == ERROR] == []
                assert rov.mode() == mode_after(function, kind, mode)

            inside(rov, mode, act)

    assert failures(legal_functions(version, kind, mode), check) == []


@in_every_mode
def test_every_illegal_call_is_refused_logs_one_line_and_changes_nothing(
    fmus: dict[int, Fmu], version: int, kind: int, mode: str
) -> None:
    illegal = fmus[version].SIGNATURES.keys() - legal_functions(version, kind, mode)
    assert illegal
    with new(fmus[version], kind, mode) as rov:
        reach(rov, mode)
        arguments = good_arguments(rov)

        def check(function: str) -> None:
            given, before = contents(arguments[function]), now(rov, mode)
            rov.log.clear()
            rov.refuse(function, *arguments[function])
            (message,) = rov.log
            assert (message.status, message.category) == (ERROR, "logStatusError")
            assert message.text.startswith(f"{function}: ")
            assert any(reason in message.text for reason in reasons_for_refusal(function, kind, mode))
            assert now(rov, mode) == before
            assert rov.mode() == mode
            assert contents(arguments[function]) == given

        found: list[str] = []
        inside(rov, mode, lambda: found.extend(failures(sorted(illegal), check)))
        assert found == []


def test_every_function_is_in_the_table() -> None:
    for version, wrapper in WRAPPERS.items():
        assert {name for name, *_ in legal.table(version)} == wrapper.SIGNATURES.keys()


@in_every_mode
def test_a_variable_can_be_read_in_every_mode_and_set_in_those_of_its_causality_and_variability(
    fmus: dict[int, Fmu], version: int, kind: int, mode: str
) -> None:
    known = fmus[version].parameters + fmus[version].states
    for name in fmus[version].variables:
        with new(fmus[version], kind, mode) as rov:
            reach(rov, mode)

            def act(name: str = name, rov: AnyInstance = rov) -> None:
                (value,) = rov.get([name])
                assert name not in known or value == float(fmus[version].variables[name].start)
                before = now(rov, mode)
                rov.log.clear()
                if name in fmus[version].settable(mode):
                    rov.set({name: 0.75})
                    assert now(rov, mode) != before, name
                else:
                    rov.set({"u_l": 0.5, name: 0.75}, ERROR)
                    (message,) = rov.log
                    assert message.text.startswith(f"{rov.fmu.name('SetFloat64')}: ")
                    assert mode in message.text or name == "time"
                    assert now(rov, mode) == before, name

            inside(rov, mode, act)


def _warnings(rov: AnyInstance) -> list[str]:
    """Return the texts of the messages about more than events, all of which are warnings, and clear the log."""
    messages = [m for m in rov.log if m.category != "logEvents"]
    assert {(m.status, m.category) for m in messages} <= {(WARNING, "logStatusWarning")}
    rov.log.clear()
    return [m.text for m in messages]


@pytest.mark.parametrize(("kind", "mode"), EVERY_MODE)
def test_an_instance_can_be_reset_and_freed_in_every_mode(fmu: Fmu, kind: int, mode: str) -> None:
    with fmu.instance(kind) as rov:
        new = rov.save()
        rov.set({"u": 1.0, "beta_u": 0.5, "m_rov": 9.0, "u_l": 0.3})
        rov.reach(mode)
        assert rov.save() != new
        rov.expect("Reset")
        assert rov.mode() == INSTANTIATED
        assert rov.save() == new
        rov.reach(mode)
        assert rov.mode() == mode
        rov.log.clear()
    assert rov.log == []  # also after it was freed


@pytest.mark.parametrize("kind", MODES)
def test_initialization_without_an_experiment_begins_at_0_with_one_warning(fmu2: fmi2.Fmu, kind: int) -> None:
    with fmu2.instance(kind) as rov, fmu2.instance(kind) as usual:
        assert rov.setup(3.0, 5.0) == OK
        rov.expect("Reset")  # the experiment is forgotten, too
        rov.expect("fmi2EnterInitializationMode")
        (warning,) = _warnings(rov)
        assert warning.startswith("fmi2EnterInitializationMode: done without fmi2SetupExperiment")
        usual.initialize()
        assert _warnings(usual) == []
        assert rov.save() == usual.save()
        for instance in (rov, usual):
            instance.expect("ExitInitializationMode")
        if kind == CO_SIMULATION:
            rov.step(0.0, 100.0)
            assert rov.time() == 100.0
        assert _warnings(rov) == []


def test_every_function_in_a_mode_that_only_importers_use_warns_once(fmus: dict[int, Fmu]) -> None:
    def check(case: tuple[int, int, str, str]) -> None:
        version, kind, function, column = case
        mode = getattr(fmi, column)
        with fmus[version].instance(kind) as rov:
            rov.reach(mode)
            arguments = good_arguments(rov)[function]
            _warnings(rov)
            for _ in range(1 if function.endswith("Terminate") else 3):
                rov.expect(function, *arguments)
            (warning,) = _warnings(rov)
            assert warning.startswith(f"{function}: done, although the standard does not allow this call in {mode}")

    cases = [
        (version, kind, function, column)
        for version in fmus
        for kind in (MODEL_EXCHANGE, CO_SIMULATION, WITH_EVENTS)[:version]
        for function, columns in legal.tolerated_modes(kind, version).items()
        for column in columns
    ]
    assert len({function for _, _, function, _ in cases}) == 9
    assert failures(cases, check) == []


@pytest.mark.parametrize(
    ("kind", "mode"),
    [(CO_SIMULATION, STEP), (WITH_EVENTS, STEP), (MODEL_EXCHANGE, EVENT), (MODEL_EXCHANGE, CONTINUOUS)],
)
def test_a_value_that_a_variable_has_already_is_set_with_one_warning(
    fmus: dict[int, Fmu], kind: int, mode: str
) -> None:
    for fmu in fmus.values():
        if kind == WITH_EVENTS and fmu.VERSION == 2:
            continue
        with fmu.instance(kind) as rov:
            rov.set({"I_r": 0.3, "u": 0.5})
            rov.reach(mode)
            fixed = [name for name in fmu.parameters if fmu.variables[name].variability == "fixed"]
            fixed += [name for name in fmu.states if name not in fmu.settable(mode)]
            before = rov.save()
            for _ in range(2):
                rov.set({"u_l": 0.0, **dict(zip(fixed, rov.get(fixed), strict=True))})
            (warning,) = _warnings(rov)
            assert warning.startswith(f"{fmu.name('SetFloat64')}: I_r must not be set in {mode}, but it has this value")
            assert rov.save() == before
            rov.set({"u_l": 0.5, "I_r": 0.5}, ERROR)
            rov.set({"der(u)": rov.get(["der(u)"])[0]}, ERROR)
            assert rov.save() == before


def test_a_step_that_overflows_leads_to_error_mode_with_the_state_from_before(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start({"u": 0.5, "psi": 0.25, "V_N": 1e308, "x": 3.0})
        rov.step(0.0, 0.5)
        before = rov.get(list(fmu.variables))
        state = c_void_p()
        rov.expect("GetFMUState", ctypes.byref(state))
        rov.log.clear()
        rov.step(0.5, 5.0, ERROR)
        (message,) = rov.log
        assert message.text.startswith(f"{fmu.name('DoStep')}: ")
        assert "overflow" in message.text
        assert rov.mode() == FAILED
        assert rov.get(list(fmu.variables)) == before
        rov.expect("SetFMUState", state)  # leaves error mode
        assert rov.mode() == STEP
        rov.step(0.5, 0.5)
        rov.expect("FreeFMUState", ctypes.byref(state))
