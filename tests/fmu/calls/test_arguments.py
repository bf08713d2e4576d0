"""A call with bad arguments is refused with one log line and has no effect. Unusual calls of real importers work."""

import ctypes
from ctypes import c_size_t, c_void_p
from math import inf, nan
from typing import Any, NamedTuple

import pytest

from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests import fmi2, fmi3
from tests.fmi import (
    CO_SIMULATION,
    CONTINUOUS,
    DISCARD,
    ERROR,
    EVENT,
    INITIALIZATION,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    STEP,
    WARNING,
    WITH_EVENTS,
    Fmu,
    contents,
    integers,
    reals,
    references,
    room,
    strings,
)
from tests.fmi3 import CLOCKS, TYPES, flags
from tests.fmu.calls.conftest import failures

CS, ME = CO_SIMULATION, MODEL_EXCHANGE
WRAPPERS: tuple[type[Fmu], ...] = (fmi2.Fmu, fmi3.Fmu)


class References(NamedTuple):
    """Arrays of one value reference of the VideoRay in a version of FMI."""

    u_l: Any
    u: Any
    der_u: Any
    f_l: Any
    beta_u: Any
    nothing: Any
    """The lowest value reference above those of all variables."""


def _references(fmi: int) -> References:
    found = {v.name: v.reference(fmi) for v in variables(load_vehicle(VIDEORAY))}
    chosen = (found[name] for name in ("u_l", "u", "der(u)", "F_l", "beta_u"))
    return References(*(references(n) for n in (*chosen, max(found.values()) + (1 if fmi == 2 else 2))))


R2, R3 = _references(2), _references(3)
TIME, ZERO = references(R3.nothing[0] - 1), references(0)
"""References to the time and to no variable in FMI 3.0, whose references begin at 1."""
FOREIGN = ctypes.create_string_buffer(4096)
"""Memory that is not a saved state."""

Case = tuple[int, str, str, tuple[Any, ...]]
"""The kind of instance, the mode, the function and its arguments."""


def counted(*arrays: Any) -> tuple[Any, ...]:
    """Return the arguments that pass arrays, each followed by its length."""
    return tuple(argument for array in arrays for argument in (array, len(array)))


def calls_of(version: int, cases: list[Case]) -> list[Case]:
    """Return the cases whose function is of this version of FMI."""
    return [case for case in cases if case[2].startswith(f"fmi{version}")]


# Calls in both versions, by the functions' common names.
_BAD: list[Case] = [
    (CS, STEP, "SetDebugLogging", (1, 1, None)),
    (CS, STEP, "SetDebugLogging", (1, 1, strings(None))),
    (CS, STEP, "SetDebugLogging", (0, 2, strings(b"logEvents", b"logNoSuch"))),
    (CS, STEP, "GetFMUState", (None,)),
    (CS, STEP, "GetFMUState", (ctypes.pointer(ctypes.cast(FOREIGN, c_void_p)),)),
    (CS, STEP, "SetFMUState", (None,)),
    (CS, STEP, "SetFMUState", (FOREIGN,)),
    (CS, STEP, "FreeFMUState", (ctypes.pointer(ctypes.cast(FOREIGN, c_void_p)),)),
    (CS, STEP, "SerializedFMUStateSize", (None, ctypes.pointer(c_size_t(7)))),
    (CS, STEP, "SerializedFMUStateSize", (FOREIGN, ctypes.pointer(c_size_t(7)))),
    (CS, STEP, "SerializeFMUState", (None, ctypes.create_string_buffer(1000), 1000)),
    (CS, STEP, "SerializeFMUState", (FOREIGN, ctypes.create_string_buffer(1000), 1000)),
    (CS, STEP, "DeserializeFMUState", (None, 1000, ctypes.pointer(c_void_p()))),
    (CS, STEP, "DeserializeFMUState", (FOREIGN, 0, ctypes.pointer(c_void_p()))),
    (CS, STEP, "DeserializeFMUState", (FOREIGN, 1000, None)),
    *((ME, CONTINUOUS, "SetTime", (t,)) for t in (nan, inf, -inf)),
    *((ME, CONTINUOUS, "SetContinuousStates", a) for a in [(None, 7), (room(7), 6), (room(8), 8), (room(), 0)]),
    *(
        (ME, CONTINUOUS, function, a)
        for function in ("GetContinuousStateDerivatives", "GetContinuousStates", "GetNominalsOfContinuousStates")
        for a in [(None, 7), (room(7), 6), (room(8), 8), (room(), 0)]
    ),
    (ME, CONTINUOUS, "GetEventIndicators", (room(), 1)),
]


def _unknowns_and_knowns(of: References) -> list[tuple[Any, Any]]:
    return [
        (of.nothing, of.u),
        (of.u, of.nothing),
        (of.u_l, of.u),  # an input is no unknown
        (of.u, of.f_l),  # a calculated output is no known
        (of.u, of.beta_u),  # a parameter is a known in Initialization Mode only
    ]


def _outputs_and_orders(of: References) -> list[tuple[Any, int]]:
    return [
        (of.nothing, 1),
        (of.u_l, 1),
        (of.der_u, 1),  # der(u) is no output
        (of.beta_u, 1),
        *((of.u, order) for order in (-1, 0, 2)),
    ]


_BAD_TIMES = [
    *((0.0, h) for h in (0.0, -0.0, -0.1, nan, inf, -inf)),
    *((t, 0.1) for t in (nan, inf, -inf)),
    (1e308, 1e308),
]
BAD_CALLS: list[Case] = [
    *((kind, mode, of.name(name), a) for of in WRAPPERS for kind, mode, name, a in _BAD),
    # ---- FMI 2.0 ----
    *((CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, start, 0, 0.0)) for start in (nan, inf, -inf)),
    *((CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, 1.0, 1, stop)) for stop in (nan, -inf, 0.999)),
    *((CS, STEP, "fmi2GetReal", a) for a in [(None, 1, room()), (R2.u, 1, None), (R2.nothing, 1, room())]),
    (CS, STEP, "fmi2GetReal", (references(R2.u[0], 2**32 - 1), 2, room(2))),
    *((CS, STEP, "fmi2SetReal", a) for a in [(None, 1, room()), (R2.u_l, 1, None), (R2.nothing, 1, room())]),
    (CS, STEP, "fmi2SetReal", (references(R2.u_l[0], 2**32 - 1), 2, room(2))),
    *((CS, STEP, f"fmi2{f}{t}", (R2.u, 1, integers(-7))) for f in ("Get", "Set") for t in ("Integer", "Boolean")),
    *((CS, STEP, f"fmi2{f}String", (R2.u, 1, strings(b"x"))) for f in ("Get", "Set")),
    *(
        (CS, STEP, "fmi2GetDirectionalDerivative", a)
        for a in [
            (None, 1, R2.u, 1, reals(1.0), room()),
            (R2.u, 1, None, 1, reals(1.0), room()),
            (R2.u, 1, R2.u, 1, None, room()),
            (R2.u, 1, R2.u, 1, reals(1.0), None),
            *((unknown, 1, known, 1, reals(1.0), room()) for unknown, known in _unknowns_and_knowns(R2)),
        ]
    ),
    (ME, EVENT, "fmi2NewDiscreteStates", (None,)),
    (ME, CONTINUOUS, "fmi2CompletedIntegratorStep", (1, None, integers(-7))),
    (ME, CONTINUOUS, "fmi2CompletedIntegratorStep", (1, integers(-7), None)),
    (CS, STEP, "fmi2SetRealInputDerivatives", (R2.u_l, 1, integers(1), reals(0.0))),
    *(
        (CS, STEP, "fmi2GetRealOutputDerivatives", a)
        for a in [
            (None, 1, integers(1), room()),
            (R2.u, 1, None, room()),
            (R2.u, 1, integers(1), None),
            *((vr, 1, integers(order), room()) for vr, order in _outputs_and_orders(R2)),
        ]
    ),
    *((CS, STEP, "fmi2DoStep", (*times, 1)) for times in _BAD_TIMES),
    (CS, STEP, "fmi2CancelStep", ()),
    *((CS, STEP, f"fmi2Get{t}Status", (2, None)) for t in ("", "Real", "Integer", "Boolean", "String")),
    # ---- FMI 3.0 ----
    *((CS, INSTANTIATED, "fmi3EnterInitializationMode", (0, 0.0, start, 0, 0.0)) for start in (nan, inf, -inf)),
    *((CS, INSTANTIATED, "fmi3EnterInitializationMode", (0, 0.0, 1.0, 1, stop)) for stop in (nan, -inf, 0.999)),
    *(
        (CS, STEP, f"fmi3{do}Float64", a)
        for do, of in [("Get", R3.u), ("Set", R3.u_l)]
        for a in [
            (None, 1, room(), 1),
            (of, 1, None, 1),
            (R3.nothing, 1, room(), 1),
            (ZERO, 1, room(), 1),
            (references(of[0], 2**32 - 1), 2, room(2), 2),
            *((of, 1, room(2), n) for n in (0, 2)),  # a value too few or too many
            (None, 0, None, 1),
        ]
    ),
    (CS, STEP, "fmi3SetFloat64", (TIME, 1, room(), 1)),
    *(
        (WITH_EVENTS, INITIALIZATION, name, tuple(1 if t is c_size_t else None for t in of))
        for name, of in {**TYPES, **CLOCKS}.items()
    ),
    *(
        (CS, STEP, function, a)
        for function in ("fmi3GetDirectionalDerivative", "fmi3GetAdjointDerivative")
        for a in [
            (None, 1, *counted(R3.u, reals(1.0), room())),
            (*counted(R3.u), None, 1, *counted(reals(1.0), room())),
            (*counted(R3.u, R3.u), None, 1, *counted(room())),
            (*counted(R3.u, R3.u, reals(1.0)), None, 1),
            (*counted(R3.u, R3.u), reals(1.0), 0, *counted(room())),
            (*counted(R3.u, R3.u, reals(1.0)), room(), 0),
            *(counted(unknown, known, reals(1.0), room()) for unknown, known in _unknowns_and_knowns(R3)),
        ]
    ),
    *(
        (ME, EVENT, "fmi3UpdateDiscreteStates", (*(None if i == n else flags(True) for i in range(5)), room()))
        for n in range(5)
    ),
    (ME, EVENT, "fmi3UpdateDiscreteStates", (*(flags(True) for _ in range(5)), None)),
    (ME, CONTINUOUS, "fmi3CompletedIntegratorStep", (True, None, flags(True))),
    (ME, CONTINUOUS, "fmi3CompletedIntegratorStep", (True, flags(True), None)),
    *((ME, EVENT, f"fmi3GetNumberOf{what}", (None,)) for what in ("EventIndicators", "ContinuousStates")),
    *(
        (CS, STEP, "fmi3GetOutputDerivatives", a)
        for a in [
            (None, 1, integers(1), room(), 1),
            (R3.u, 1, None, room(), 1),
            (R3.u, 1, integers(1), None, 1),
            *((R3.u, 1, integers(1), room(2), n) for n in (0, 2)),
            *((vr, 1, integers(order), room(), 1) for vr, order in _outputs_and_orders(R3)),
        ]
    ),
    *((CS, STEP, "fmi3DoStep", (*times, True, *(flags(True) for _ in range(3)), room())) for times in _BAD_TIMES),
    *(
        (CS, STEP, "fmi3DoStep", (0.0, 0.1, True, *(None if i == n else flags(True) for i in range(3)), room()))
        for n in range(3)
    ),
    (CS, STEP, "fmi3DoStep", (0.0, 0.1, True, *(flags(True) for _ in range(3)), None)),
]


@pytest.mark.parametrize("version", [2, 3])
def test_a_bad_argument_is_an_error_with_one_log_line_and_no_effect(fmus: dict[int, Fmu], version: int) -> None:
    def check(case: Case) -> None:
        kind, mode, function, arguments = case
        given = contents(arguments)
        with fmus[version].instance(kind) as rov:
            rov.reach(mode)
            before = rov.save()
            assert rov.call(function, *arguments) == ERROR
            (message,) = rov.log
            assert (message.status, message.category) == (ERROR, "logStatusError")
            assert message.text.startswith(f"{function}: ")
            assert rov.save() == before
        if "DoStep" not in function:  # whose results are where the step ended
            assert contents(arguments) == given

    assert failures(calls_of(version, BAD_CALLS), check) == []


def test_a_call_without_an_instance_is_an_error(fmu: Fmu) -> None:
    zero = dict.fromkeys((ctypes.c_int, ctypes.c_uint, ctypes.c_size_t, ctypes.c_bool), 0) | {ctypes.c_double: 0.0}
    for function, types in fmu.SIGNATURES.items():
        assert fmu.call(function, None, *(zero.get(t) for t in types)) == ERROR, function


UNUSUAL_CALLS: list[Case] = [
    *((ME, CONTINUOUS, of.name("GetEventIndicators"), (None, 0)) for of in WRAPPERS),
    *((CS, STEP, of.name("SetDebugLogging"), (-1, 0, None)) for of in WRAPPERS),
    # ---- FMI 2.0 ----
    (CS, INSTANTIATED, "fmi2SetupExperiment", (-1, nan, 0.0, -1, 10.0)),
    (CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, 0.0, 0, nan)),
    (CS, INSTANTIATED, "fmi2SetupExperiment", (0, 0.0, -5.0, 2, inf)),
    *((CS, STEP, f"fmi2{f}{t}", (None, 0, None)) for f in ("Get", "Set") for t in ("Real", "Integer", "String")),
    (CS, STEP, "fmi2GetDirectionalDerivative", (None, 0, None, 0, None, None)),
    (CS, STEP, "fmi2GetDirectionalDerivative", (R2.u, 1, None, 0, None, room())),
    (CS, STEP, "fmi2GetRealOutputDerivatives", (None, 0, None, None)),
    (CS, STEP, "fmi2SetRealInputDerivatives", (None, 0, None, None)),
    *((CS, STEP, "fmi2DoStep", (t, 0.09999999999999998, -1)) for t in (-1.4e-17, -1.0, 0.1, 1e6)),
    (ME, CONTINUOUS, "fmi2CompletedIntegratorStep", (-1, integers(1), integers(1))),
    # ---- FMI 3.0 ----
    (CS, INSTANTIATED, "fmi3EnterInitializationMode", (True, nan, 0.0, True, 10.0)),
    (CS, INSTANTIATED, "fmi3EnterInitializationMode", (False, 0.0, 0.0, False, nan)),
    (CS, INSTANTIATED, "fmi3EnterInitializationMode", (False, 0.0, -5.0, True, inf)),
    *((CS, STEP, f"fmi3{f}Float64", (None, 0, None, 0)) for f in ("Get", "Set")),
    *((CS, STEP, f"fmi3Get{f}Derivative", (None, 0) * 4) for f in ("Directional", "Adjoint")),
    (CS, STEP, "fmi3GetDirectionalDerivative", (R3.u, 1, None, 0, None, 0, room(), 1)),
    (CS, STEP, "fmi3GetAdjointDerivative", (None, 0, R3.u, 1, None, 0, room(), 1)),
    (CS, STEP, "fmi3GetOutputDerivatives", (None, 0, None, None, 0)),
]


@pytest.mark.parametrize("version", [2, 3])
def test_unusual_arguments_of_real_importers_work(fmus: dict[int, Fmu], version: int) -> None:
    def check(case: Case) -> None:
        kind, mode, function, arguments = case
        with fmus[version].instance(kind) as rov:
            rov.reach(mode)
            rov.expect(function, *arguments)

    assert failures(calls_of(version, UNUSUAL_CALLS), check) == []


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
        rov.start(stop=stop, at=start)
        before = rov.save()
        assert rov.step(t, h) == status
        assert (rov.save() == before) == (status == ERROR)
        assert rov.mode() == STEP
        assert [m.status for m in rov.log] == ([ERROR] if status == ERROR else [WARNING] * (t != start))


JUMPS: list[tuple[float, list[tuple[float, float, bool]]]] = [
    (0.0, [(0.0, 0.1, False), (0.1, 0.1, False), (0.2, 0.1, False)]),
    (
        0.0,
        [(0.1, 0.1, True), (0.2, 0.1, False), (0.5, 0.1, False)],
    ),  # only the first of two jumps gives a warning
    (0.0, [(-1.4e-17, 0.1, False), (0.1, 0.1, False), (0.1, 0.1, True)]),  # repeated
    (-2.0, [(-2.0, 0.5, False), (-1.0, 0.5, True)]),  # skipped
    (0.0, [(0.0, 0.1, False), (0.1 + 1e-11, 0.1, False)]),
    (0.0, [(0.0, 0.1, False), (0.1 + 1e-9, 0.1, True)]),
    (1e6, [(1e6 + 1e-4, 0.1, False)]),
    (1e6, [(1e6 - 1e-2, 0.1, True)]),
    (1e9, [(1e9 + 1e-7, 1e-6, False)]),
    (1e9, [(1e9 + 1e-6, 1e-6, True)]),  # a whole step is not rounding
]
"""A start time, then t, h and whether there is a warning for each step."""


@pytest.mark.parametrize(("start", "steps"), JUMPS)
def test_a_repeated_or_skipped_communication_point_gives_one_warning(
    fmu: Fmu, start: float, steps: list[tuple[float, float, bool]]
) -> None:
    with fmu.instance() as rov, fmu.instance() as regular:
        for instance in (rov, regular):
            instance.start({"u_l": 0.5, "r": 1.0}, at=start)
        at = start
        for t, h, warned in steps:
            assert rov.step(t, h) == regular.step(at, h) == OK
            at += h
            assert [(m.status, m.category) for m in rov.log] == [(WARNING, "logStatusWarning")] * warned
            rov.log.clear()
            assert rov.get(fmu.outputs) == regular.get(fmu.outputs)


def test_status_after_a_step(fmu2: fmi2.Fmu) -> None:
    time, flag = room(), integers(-7)
    with fmu2.instance() as rov:
        rov.start()
        assert rov.step(0.0, 0.25) == OK
        rov.expect("fmi2GetRealStatus", 2, time)
        rov.expect("fmi2GetBooleanStatus", 3, flag)
        assert (time[0], flag[0]) == (0.25, 0)
        for function, kind in [("fmi2GetRealStatus", 3), ("fmi2GetBooleanStatus", 2), ("fmi2GetRealStatus", 99)]:
            assert rov.call(function, kind, time if "Real" in function else flag) == DISCARD
        assert (time[0], flag[0]) == (0.25, 0)
        assert {m.category for m in rov.log} == {"logStatusDiscard"}
