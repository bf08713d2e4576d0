"""Bad arguments are refused with one log line and change nothing; the odd ones of real importers work."""

import ctypes
from ctypes import c_size_t, c_void_p
from math import inf, nan
from typing import Any

import pytest
from fmpy.fmi2 import fmi2CallbackFunctions

from rov_fmu.export.interface import variables
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.fmi2 import (
    CO_SIMULATION,
    CONTINUOUS,
    DISCARD,
    ERROR,
    EVENT,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    SIGNATURES,
    STEP,
    WARNING,
    Fmu,
    Message,
    integers,
    reals,
    recording_callbacks,
    references,
    strings,
)

CS, ME = CO_SIMULATION, MODEL_EXCHANGE
_VR = {v.name: v.value_reference for v in variables(load_vehicle(VIDEORAY).rov)}
U_L, U, DER_U, F_L, BETA_U = (references(_VR[name]) for name in ("u_l", "u", "der(u)", "F_l", "beta_u"))
NOTHING, U_AND_NOTHING, U_L_AND_NOTHING = (
    references(len(_VR)),
    references(U[0], 2**32 - 1),
    references(U_L[0], 2**32 - 1),
)
FOREIGN = ctypes.create_string_buffer(4096)


def room(n: int = 1) -> Any:
    return reals(*[-7.0] * n)


# interface, mode, function, bad arguments
BAD_CALLS: list[tuple[int, str, str, tuple[Any, ...]]] = [
    (CS, STEP, "fmi2SetDebugLogging", (1, 1, None)),
    (CS, STEP, "fmi2SetDebugLogging", (1, 1, strings(None))),
    (CS, STEP, "fmi2SetDebugLogging", (0, 2, strings(b"logEvents", b"logAll"))),
    *((CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, start, 0, 0.0)) for start in (nan, inf, -inf)),
    *((CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, 1.0, 1, stop)) for stop in (nan, -inf, 0.999)),
    *((CS, STEP, "fmi2GetReal", a) for a in [(None, 1, room()), (U, 1, None), (NOTHING, 1, room())]),
    (CS, STEP, "fmi2GetReal", (U_AND_NOTHING, 2, room(2))),
    *((CS, STEP, "fmi2SetReal", a) for a in [(None, 1, room()), (U_L, 1, None), (NOTHING, 1, room())]),
    (CS, STEP, "fmi2SetReal", (U_L_AND_NOTHING, 2, room(2))),
    *((CS, STEP, f"fmi2{f}{t}", (U, 1, integers(-7))) for f in ("Get", "Set") for t in ("Integer", "Boolean")),
    *((CS, STEP, f"fmi2{f}String", (U, 1, strings(b"x"))) for f in ("Get", "Set")),
    (CS, STEP, "fmi2GetFMUstate", (None,)),
    (CS, STEP, "fmi2GetFMUstate", (ctypes.pointer(ctypes.cast(FOREIGN, c_void_p)),)),
    (CS, STEP, "fmi2SetFMUstate", (None,)),
    (CS, STEP, "fmi2SetFMUstate", (FOREIGN,)),
    (CS, STEP, "fmi2FreeFMUstate", (ctypes.pointer(ctypes.cast(FOREIGN, c_void_p)),)),
    (CS, STEP, "fmi2SerializedFMUstateSize", (None, ctypes.pointer(c_size_t(7)))),
    (CS, STEP, "fmi2SerializedFMUstateSize", (FOREIGN, ctypes.pointer(c_size_t(7)))),
    (CS, STEP, "fmi2SerializeFMUstate", (None, ctypes.create_string_buffer(1000), 1000)),
    (CS, STEP, "fmi2SerializeFMUstate", (FOREIGN, ctypes.create_string_buffer(1000), 1000)),
    (CS, STEP, "fmi2DeSerializeFMUstate", (None, 1000, ctypes.pointer(c_void_p()))),
    (CS, STEP, "fmi2DeSerializeFMUstate", (FOREIGN, 0, ctypes.pointer(c_void_p()))),
    (CS, STEP, "fmi2DeSerializeFMUstate", (FOREIGN, 1000, None)),
    *(
        (CS, STEP, "fmi2GetDirectionalDerivative", a)
        for a in [
            (None, 1, U, 1, reals(1.0), room()),
            (U, 1, None, 1, reals(1.0), room()),
            (U, 1, U, 1, None, room()),
            (U, 1, U, 1, reals(1.0), None),
            (NOTHING, 1, U, 1, reals(1.0), room()),
            (U, 1, NOTHING, 1, reals(1.0), room()),
            (U_L, 1, U, 1, reals(1.0), room()),  # an input is no unknown
            (U, 1, F_L, 1, reals(1.0), room()),  # a calculated output is no known
            (U, 1, BETA_U, 1, reals(1.0), room()),  # a parameter is one in Initialization Mode alone
        ]
    ),
    (ME, EVENT, "fmi2NewDiscreteStates", (None,)),
    (ME, CONTINUOUS, "fmi2CompletedIntegratorStep", (1, None, integers(-7))),
    (ME, CONTINUOUS, "fmi2CompletedIntegratorStep", (1, integers(-7), None)),
    *((ME, CONTINUOUS, "fmi2SetTime", (t,)) for t in (nan, inf, -inf)),
    *((ME, CONTINUOUS, "fmi2SetContinuousStates", a) for a in [(None, 7), (room(7), 6), (room(8), 8), (room(), 0)]),
    *(
        (ME, CONTINUOUS, function, a)
        for function in ("fmi2GetDerivatives", "fmi2GetContinuousStates", "fmi2GetNominalsOfContinuousStates")
        for a in [(None, 7), (room(7), 6), (room(8), 8), (room(), 0)]
    ),
    (ME, CONTINUOUS, "fmi2GetEventIndicators", (room(), 1)),
    (CS, STEP, "fmi2SetRealInputDerivatives", (U_L, 1, integers(1), reals(0.0))),
    *(
        (CS, STEP, "fmi2GetRealOutputDerivatives", a)
        for a in [
            (None, 1, integers(1), room()),
            (U, 1, None, room()),
            (U, 1, integers(1), None),
            (NOTHING, 1, integers(1), room()),
            (U_L, 1, integers(1), room()),
            (DER_U, 1, integers(1), room()),  # der(u) is no output
            (BETA_U, 1, integers(1), room()),
            *((U, 1, integers(order), room()) for order in (-1, 0, 2)),
        ]
    ),
    *((CS, STEP, "fmi2DoStep", (0.0, h, 1)) for h in (0.0, -0.0, -0.1, nan, inf, -inf)),
    *((CS, STEP, "fmi2DoStep", (t, 0.1, 1)) for t in (nan, inf, -inf)),
    (CS, STEP, "fmi2DoStep", (1e308, 1e308, 1)),
    (CS, STEP, "fmi2CancelStep", ()),
    *((CS, STEP, f"fmi2Get{t}Status", (2, None)) for t in ("", "Real", "Integer", "Boolean", "String")),
]


@pytest.mark.parametrize(("kind", "mode", "function", "arguments"), BAD_CALLS)
def test_a_bad_argument_is_an_error_with_one_log_line_and_no_effect(
    fmu: Fmu, kind: int, mode: str, function: str, arguments: tuple[Any, ...]
) -> None:
    given = [bytes(a) for a in arguments if isinstance(a, ctypes.Array)]
    with fmu.instance(kind) as rov:
        rov.reach(mode)
        before = rov.save()
        assert rov.call(function, *arguments) == ERROR
        (message,) = rov.log
        assert (message.status, message.category) == (ERROR, "logStatusError")
        assert message.text.startswith(f"{function}: ")
        assert rov.save() == before
    assert [bytes(a) for a in arguments if isinstance(a, ctypes.Array)] == given


@pytest.mark.parametrize("function", SIGNATURES)
def test_no_instance_is_an_error(fmu: Fmu, function: str) -> None:
    zero = {ctypes.c_int: 0, ctypes.c_double: 0.0, ctypes.c_size_t: 0}
    assert fmu.call(function, None, *(zero.get(t) for t in SIGNATURES[function])) == ERROR


def test_nothing_can_be_freed(fmu: Fmu) -> None:
    fmu.dll.fmi2FreeInstance(None)
    with fmu.instance() as rov:
        rov.expect("fmi2FreeFMUstate", None)
        rov.expect("fmi2FreeFMUstate", ctypes.byref(c_void_p()))


ODD_CALLS: list[tuple[int, str, str, tuple[Any, ...]]] = [
    (CS, INSTANTIATED, "fmi2SetupExperiment", (-1, nan, 0.0, -1, 10.0)),
    (CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, 0.0, 0, nan)),
    (CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, -5.0, 2, inf)),
    *((CS, STEP, f"fmi2{f}{t}", (None, 0, None)) for f in ("Get", "Set") for t in ("Real", "Integer", "String")),
    (CS, STEP, "fmi2GetDirectionalDerivative", (None, 0, None, 0, None, None)),
    (CS, STEP, "fmi2GetDirectionalDerivative", (U, 1, None, 0, None, room())),
    (CS, STEP, "fmi2GetRealOutputDerivatives", (None, 0, None, None)),
    (CS, STEP, "fmi2SetRealInputDerivatives", (None, 0, None, None)),
    *((CS, STEP, "fmi2DoStep", (t, 0.09999999999999998, -1)) for t in (-1.4e-17, -1.0, 0.1, 1e6)),
    (ME, CONTINUOUS, "fmi2GetEventIndicators", (None, 0)),
    (ME, CONTINUOUS, "fmi2CompletedIntegratorStep", (-1, integers(1), integers(1))),
    (CS, STEP, "fmi2SetDebugLogging", (-1, 0, None)),
]


@pytest.mark.parametrize(("kind", "mode", "function", "arguments"), ODD_CALLS)
def test_what_importers_really_pass_works(
    fmu: Fmu, kind: int, mode: str, function: str, arguments: tuple[Any, ...]
) -> None:
    with fmu.instance(kind) as rov:
        rov.reach(mode)
        rov.expect(function, *arguments)


def test_a_step_depends_on_its_length_alone(fmu: Fmu) -> None:
    results = []
    for t in (0.0, -1.4e-17, 0.1, 1e6):
        with fmu.instance() as rov:
            rov.start({"u_l": 0.5, "u_r": -0.3, "u_t": 0.2})
            assert rov.step(t, 0.1) == OK
            results.append(bytes(reals(*rov.get(fmu.outputs))))
    assert len(set(results)) == 1


@pytest.mark.parametrize(
    ("start", "stop", "t", "h", "status"),
    [
        (0.0, 1.0, 0.0, 1.0, OK),
        (0.0, 1.0, 0.9999999999999999, 0.1 - 0.1 + 2e-16, OK),
        (0.0, 0.3, 0.2, 0.1, OK),  # 0.30000000000000004
        (1e6, 1e6 + 0.3, 1e6 + 0.2, 0.1, OK),
        (-1.0, 0.0, -0.09999999999999987, 0.1, OK),
        (0.0, 1e-6, 9e-7, 1.0000000001e-7, OK),
        (0.0, 1.0, 0.95, 0.1, ERROR),
        (0.0, 1.0, 1.0, 1e-6, ERROR),
        (0.0, 1e-6, 9e-7, 1.1e-7, ERROR),
        (-2.0, -1.0, -1.0, 0.1, ERROR),
        (0.0, 0.0, 0.0, 1e-6, ERROR),
        (0.0, inf, 1e300, 1.0, OK),
        (0.0, None, 1e300, 1.0, OK),
    ],
)
def test_a_step_past_the_stop_time_is_refused_up_to_rounding(
    fmu: Fmu, start: float, stop: float | None, t: float, h: float, status: int
) -> None:
    with fmu.instance() as rov:
        assert rov.setup(start, stop) == OK
        rov.expect("fmi2EnterInitializationMode")
        rov.expect("fmi2ExitInitializationMode")
        before = rov.save()
        assert rov.step(t, h) == status
        assert (rov.save() == before) == (status == ERROR)
        assert rov.mode() == STEP
        assert [m.status for m in rov.log] == ([ERROR] if status == ERROR else [WARNING] * (t != start))  # of the jump


# start time; then of each step t and h, and whether it is warned of
JUMPS: list[tuple[float, list[tuple[float, float, bool]]]] = [
    (0.0, [(0.0, 0.1, False), (0.1, 0.1, False), (0.2, 0.1, False)]),
    (0.0, [(0.1, 0.1, True), (0.2, 0.1, False), (0.5, 0.1, False)]),  # a first step at t = h; said once
    (0.0, [(-1.4e-17, 0.1, False), (0.1, 0.1, False), (0.1, 0.1, True)]),  # repeated
    (-2.0, [(-2.0, 0.5, False), (-1.0, 0.5, True)]),  # skipped
    (0.0, [(0.0, 0.1, False), (0.1 + 1e-11, 0.1, False)]),
    (0.0, [(0.0, 0.1, False), (0.1 + 1e-9, 0.1, True)]),
    (1e6, [(1e6 + 1e-4, 0.1, False)]),
    (1e6, [(1e6 - 1e-2, 0.1, True)]),
    (1e9, [(1e9 + 1e-7, 1e-6, False)]),
    (1e9, [(1e9 + 1e-6, 1e-6, True)]),  # a whole step is not rounding
]


@pytest.mark.parametrize(("start", "steps"), JUMPS)
def test_a_repeated_or_skipped_communication_point_is_warned_of_once(
    fmu: Fmu, start: float, steps: list[tuple[float, float, bool]]
) -> None:
    with fmu.instance() as rov, fmu.instance() as regular:
        for either in (rov, regular):
            assert either.setup(start) == OK
            assert either.set({"u_l": 0.5, "r": 1.0}) == OK
            either.expect("fmi2EnterInitializationMode")
            either.expect("fmi2ExitInitializationMode")
        at = start
        for t, h, warned in steps:
            assert rov.step(t, h) == regular.step(at, h) == OK
            at += h
            assert [(m.status, m.category) for m in rov.log] == [(WARNING, "logStatusWarning")] * warned
            rov.log.clear()
            assert rov.get(fmu.outputs) == regular.get(fmu.outputs)


def test_a_step_tried_again_from_a_restored_state_is_no_jump(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start()
        assert rov.step(0.0, 0.5) == OK
        before = rov.save()
        assert rov.step(0.5, 0.5) == OK
        assert rov.load(before) == OK
        assert rov.step(0.5, 0.25) == OK
        assert rov.log == []


def test_a_thousand_steps_added_up_reach_the_stop_time(fmu: Fmu) -> None:
    with fmu.instance() as rov:
        rov.start(stop=10.0)
        t = 0.0
        for _ in range(1000):
            assert rov.step(t, 0.01) == OK, rov.log
            t += 0.01
        assert t != 10.0
        assert rov.step(t, 0.01) == ERROR


def test_status_after_a_step(fmu: Fmu) -> None:
    time, flag = room(), integers(-7)
    with fmu.instance() as rov:
        rov.start()
        assert rov.step(0.0, 0.25) == OK
        rov.expect("fmi2GetRealStatus", 2, time)
        rov.expect("fmi2GetBooleanStatus", 3, flag)
        assert (time[0], flag[0]) == (0.25, 0)
        for function, kind in [("fmi2GetRealStatus", 3), ("fmi2GetBooleanStatus", 2), ("fmi2GetRealStatus", 99)]:
            assert rov.call(function, kind, time if "Real" in function else flag) == DISCARD
        assert (time[0], flag[0]) == (0.25, 0)
        assert {m.category for m in rov.log} == {"logStatusDiscard"}


GUID = object()  # the FMU's own


@pytest.mark.parametrize(
    ("name", "kind", "guid", "said"),
    [
        (None, CS, GUID, "name"),
        (b"", CS, GUID, "name"),
        (b" \t\r\n", ME, GUID, "name"),
        (b"rov", 2, GUID, "fmuType = 2"),
        (b"rov", -1, GUID, "fmuType = -1"),
        (b"rov", CS, None, "NULL"),
        (b"rov", CS, b"", "GUID"),
        (b"rov", ME, b"{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}", "{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"),
        (b"rov", CS, b"%n" * 300, "GUID"),
    ],
)
def test_a_bad_instantiation_gives_no_instance_and_one_log_line(
    fmu: Fmu, name: bytes | None, kind: int, guid: Any, said: str
) -> None:
    log: list[Message] = []
    callbacks = recording_callbacks(log)
    own = fmu.description.guid.encode()
    component = fmu.dll.fmi2Instantiate(name, kind, own if guid is GUID else guid, None, ctypes.byref(callbacks), 0, 0)
    assert component is None
    (message,) = log
    assert (message.status, message.category) == (ERROR, "logStatusError")
    assert message.text.startswith("fmi2Instantiate: ")
    assert said in message.text
    silent = fmi2CallbackFunctions()  # no logger
    assert fmu.dll.fmi2Instantiate(name, kind, own if guid is GUID else guid, None, ctypes.byref(silent), 0, 0) is None


def test_no_callbacks_give_no_instance(fmu: Fmu) -> None:
    assert fmu.dll.fmi2Instantiate(b"rov", CS, fmu.description.guid.encode(), None, None, 0, 0) is None


@pytest.mark.parametrize(
    "uri",
    [
        None,
        b"",
        b"file:/x",
        b"file:///x",
        b"file:////x/",
        b"file:///no such%20folder",
        b"\xff%n%s",
        b"C:\\x",
        b"x" * 9999,
    ],
)
def test_any_resource_location_will_do(fmu: Fmu, uri: bytes | None) -> None:
    callbacks = fmi2CallbackFunctions()  # NULL, all of them
    component = fmu.dll.fmi2Instantiate(b"rov", CS, fmu.description.guid.encode(), uri, ctypes.byref(callbacks), -1, -1)
    assert fmu.call("fmi2SetupExperiment", component, 0, 0.0, 0.0, 0, 0.0) == OK
    assert fmu.call("fmi2DoStep", component, 0.0, 0.1, 1) == ERROR  # without a logger, too
    fmu.dll.fmi2FreeInstance(component)


def test_the_callbacks_are_copied(fmu: Fmu) -> None:
    log: list[Message] = []
    callbacks = recording_callbacks(log)
    given = fmi2CallbackFunctions.from_buffer_copy(callbacks)
    component = fmu.dll.fmi2Instantiate(b"rov", CS, fmu.description.guid.encode(), None, ctypes.byref(given), 0, 0)
    ctypes.memset(ctypes.byref(given), 0xAA, ctypes.sizeof(given))
    assert fmu.call("fmi2DoStep", component, 0.0, 0.1, 1) == ERROR
    fmu.dll.fmi2FreeInstance(component)
    assert len(log) == 1
