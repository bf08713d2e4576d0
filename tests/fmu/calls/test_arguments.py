"""A call with bad arguments is refused with one log line and has no effect. Unusual calls of real importers work."""

import ctypes
from collections.abc import Iterator, Sequence
from ctypes import c_size_t, c_void_p
from itertools import product
from math import inf, nan
from typing import Any

import pytest

from tests.fmi import (
    CO_SIMULATION,
    CONTINUOUS,
    ERROR,
    INITIALIZATION,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    STEP,
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
from tests.fmi3 import ABSENT, flags
from tests.fmu.calls.conftest import failures, modes_of
from tests.fmu.calls.test_lifecycle import good_arguments, legal_functions

CS, ME = CO_SIMULATION, MODEL_EXCHANGE
FOREIGN = ctypes.create_string_buffer(4096)
"""Memory that is not a saved state."""

Case = tuple[int, str, str, tuple[Any, ...]]
"""The kind of instance, the mode, the function and its arguments."""


def assert_refused(rov: AnyInstance, function: str, arguments: Sequence[Any]) -> None:
    """Assert that a call is an error, and that its only effect is one log line."""
    given, before = contents(arguments), rov.save()
    rov.log.clear()
    rov.refuse(function, *arguments)
    (message,) = rov.log
    assert (message.status, message.category) == (ERROR, "logStatusError")
    assert message.text.startswith(f"{rov.fmu.name(function)}: ")
    assert rov.save() == before
    if "DoStep" not in function:  # whose results are where the step ended
        assert contents(arguments) == given


def first_legal(fmu: Fmu) -> Iterator[tuple[int, str, str]]:
    """Yield each function with the kind of instance and the mode in which it is legal first."""
    done = set[str]()
    for kind, mode in modes_of(fmu.VERSION):
        for function in legal_functions(fmu.VERSION, kind, mode):
            if function not in done:
                done.add(function)
                yield kind, mode, function


def test_a_null_pointer_is_an_error_with_one_log_line_and_no_effect(fmu: Fmu) -> None:
    """In place of each array, result or state of a call that works otherwise. A state that is freed may be NULL."""
    replaced = 0
    for kind, mode, function in first_legal(fmu):
        if function == fmu.name("FreeFMUState"):
            continue
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            arguments = good_arguments(rov)[function]
            for n, argument in enumerate(arguments):
                if argument is not None and not isinstance(argument, int | float):
                    assert_refused(rov, function, (*arguments[:n], None, *arguments[n + 1 :]))
                    replaced += 1
    assert replaced > 30


def step_arguments(fmu: Fmu, t: float, h: float) -> tuple[Any, ...]:
    return (t, h, 1) if fmu.VERSION == 2 else (t, h, True, *(flags(True) for _ in range(3)), room())


def experiment(fmu: Fmu, *arguments: Any) -> Case:
    """Return the call that defines the experiment."""
    return CS, INSTANTIATED, "fmi2SetupExperiment" if fmu.VERSION == 2 else "EnterInitializationMode", arguments


def bad_calls(fmu: Fmu) -> Iterator[Case]:
    """Yield calls with numbers, sizes or states that are wrong."""
    for number in (nan, inf, -inf):
        yield experiment(fmu, 0, 0.0, number, 0, 0.0)
        yield ME, CONTINUOUS, "SetTime", (number,)
    for stop in (nan, -inf, 0.999):
        yield experiment(fmu, 0, 0.0, 1.0, 1, stop)
    for t, h in [
        *((0.0, h) for h in (0.0, -0.0, -0.1, nan, inf, -inf)),
        *((t, 0.1) for t in (nan, inf, -inf)),
        (1e308, 1e308),
    ]:
        yield CS, STEP, "DoStep", step_arguments(fmu, t, h)
    for categories in ((1, 1, strings(None)), (0, 2, strings(b"logEvents", b"logNoSuch"))):
        yield CS, STEP, "SetDebugLogging", categories
    for function in ("GetFMUState", "FreeFMUState"):
        yield CS, STEP, function, (ctypes.pointer(ctypes.cast(FOREIGN, c_void_p)),)
    yield CS, STEP, "SetFMUState", (FOREIGN,)
    yield CS, STEP, "SerializedFMUStateSize", (FOREIGN, ctypes.pointer(c_size_t(7)))
    yield CS, STEP, "SerializeFMUState", (FOREIGN, ctypes.create_string_buffer(1000), 1000)
    yield CS, STEP, "DeserializeFMUState", (FOREIGN, 0, ctypes.pointer(c_void_p()))
    for what in ("SetContinuousStates", "GetContinuousStates", "GetContinuousStateDerivatives"):
        for n in (6, 8, 0):
            yield ME, CONTINUOUS, what, (room(max(n, 7)), n)
            yield ME, CONTINUOUS, "GetNominalsOfContinuousStates", (room(max(n, 7)), n)
    yield ME, CONTINUOUS, "GetEventIndicators", (room(), 1)
    for name, types in ABSENT.items() if fmu.VERSION == 3 else ():
        yield WITH_EVENTS, INITIALIZATION, name, tuple(1 if t is c_size_t else None for t in types)


def bad_references(fmu: Fmu) -> Iterator[Case]:
    """Yield calls about variables that do not exist or must not be used, with numbers of values that do not fit."""
    u_l, u, der_u, f_l, beta_u = (fmu.references([name]) for name in ("u_l", "u", "der(u)", "F_l", "beta_u"))
    two, nothing = fmu.VERSION == 2, references(max(fmu.vr.values()) + 1)
    for do, vr in (("Get", u), ("Set", u_l)):
        for unknown in (nothing, *(() if two else (references(0),))):
            yield CS, STEP, f"{do}Float64", (unknown, 1, *fmu.sized(room()))
        yield CS, STEP, f"{do}Float64", (references(vr[0], 2**32 - 1), 2, *fmu.sized(room(2)))
        if two:
            for kind, values in (("Integer", integers(-7)), ("Boolean", integers(-7)), ("String", strings(b"x"))):
                yield CS, STEP, f"{do}{kind}", (u, 1, values)
        else:
            for n in (0, 2):  # a value too few or too many
                yield CS, STEP, f"{do}Float64", (vr, 1, room(2), n)
            yield CS, STEP, f"{do}Float64", (None, 0, None, 1)
    for unknown, known in [
        (nothing, u),
        (u, nothing),
        (u_l, u),  # an input is no unknown
        (u, f_l),  # a calculated output is no known
        (u, beta_u),  # a parameter is a known in Initialization Mode only
    ]:
        for derivative in ("Directional", *(() if two else ("Adjoint",))):
            arguments = (unknown, 1, known, 1, *fmu.sized(reals(1.0)), *fmu.sized(room()))
            yield CS, STEP, f"Get{derivative}Derivative", arguments
    for vr, order in [
        *((vr, 1) for vr in (nothing, u_l, der_u, beta_u)),  # none of these is an output
        *((u, order) for order in (-1, 0, 2)),
    ]:
        yield CS, STEP, "GetOutputDerivatives", (vr, 1, integers(order), *fmu.sized(room()))
    if two:
        yield CS, STEP, "CancelStep", ()
        yield CS, STEP, "SetRealInputDerivatives", (u_l, 1, integers(1), reals(0.0))
    else:
        yield CS, STEP, "SetFloat64", (fmu.references(["time"]), 1, room(), 1)
        for n in (0, 2):
            yield CS, STEP, "GetOutputDerivatives", (u, 1, integers(1), room(2), n)
        yield from (
            (CS, STEP, f"Get{derivative}Derivative", (u, 1, u, 1, room(), seeds, room(), found))
            for derivative, (seeds, found) in product(("Directional", "Adjoint"), ((0, 1), (1, 0)))
        )


def test_a_bad_argument_is_an_error_with_one_log_line_and_no_effect(fmu: Fmu) -> None:
    def check(case: Case) -> None:
        kind, mode, function, arguments = case
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            assert_refused(rov, function, arguments)

    assert failures([*bad_calls(fmu), *bad_references(fmu)], check) == []


def test_a_call_without_an_instance_is_an_error(fmu: Fmu) -> None:
    zero = dict.fromkeys((ctypes.c_int, ctypes.c_uint, ctypes.c_size_t, ctypes.c_bool), 0) | {ctypes.c_double: 0.0}
    for function, types in fmu.SIGNATURES.items():
        assert fmu.call(function, None, *(zero.get(t) for t in types)) == ERROR, function


def unusual_calls(fmu: Fmu) -> Iterator[Case]:
    u = fmu.references(["u"])
    yield experiment(fmu, -1, nan, 0.0, -1, 10.0)
    yield experiment(fmu, 0, 0.0, 0.0, 0, nan)
    yield experiment(fmu, 0, 0.0, -5.0, 2, inf)
    yield ME, CONTINUOUS, "GetEventIndicators", (None, 0)
    yield CS, STEP, "SetDebugLogging", (-1, 0, None)
    for function, types in fmu.SIGNATURES.items():
        if "Derivative" in function and function != fmu.name("GetContinuousStateDerivatives"):
            yield CS, STEP, function, tuple(0 if t is c_size_t else None for t in types)
    nothing = (None, 0) if fmu.VERSION == 3 else (None,)
    yield CS, STEP, "GetDirectionalDerivative", (u, 1, None, 0, *nothing, *fmu.sized(room()))
    for do in ("Get", "Set"):
        yield CS, STEP, f"{do}Float64", (None, 0, *nothing)
    if fmu.VERSION == 2:
        for t in (-1.4e-17, -1.0, 0.1, 1e6):
            yield CS, STEP, "DoStep", (t, 0.09999999999999998, -1)
        yield ME, CONTINUOUS, "CompletedIntegratorStep", (-1, integers(1), integers(1))
    else:
        yield CS, STEP, "GetAdjointDerivative", (None, 0, u, 1, None, 0, room(), 1)


def test_unusual_arguments_of_real_importers_work(fmu: Fmu) -> None:
    def check(case: Case) -> None:
        kind, mode, function, arguments = case
        with fmu.instance(kind) as rov:
            rov.reach(mode)
            rov.expect(function, *arguments)

    assert failures(unusual_calls(fmu), check) == []


STOPS = [
    (0.0, 0.3, 0.2, 0.1, OK),  # 0.30000000000000004
    (0.0, 1.0, 0.9, 0.1 + 1.0e-9, OK),
    (0.0, 1.0, 0.9, 0.1 + 1.2e-9, ERROR),
    (0.0, 1e-6, 9e-7, 1.0e-7 + 1.2e-15, ERROR),
    (0.0, 1e6, 1e6, 1e-2, ERROR),  # within 1e-9 of the stop time, but a whole step
    (0.0, 1e6, 1e6 - 0.9e-3, 1e-3, OK),
    (0.0, 1e6, 1e6 - 0.4e-3, 1e-3, ERROR),
    (-2.0, -1.0, -1.1, 0.1 + 1.2e-9, ERROR),
    (0.0, 0.0, 0.0, 1e-6, ERROR),
    (0.0, inf, 1e300, 1.0, OK),
    (0.0, None, 1e300, 1.0, OK),
]
"""The start and the stop time, the beginning and the length of a step, and its status."""


@pytest.mark.parametrize(("start", "stop", "t", "h", "status"), STOPS)
def test_a_step_past_the_stop_time_is_refused_up_to_rounding(
    fmu: Fmu, start: float, stop: float | None, t: float, h: float, status: int
) -> None:
    with fmu.instance() as rov:
        rov.start(stop=stop, at=start)
        before = rov.save()
        rov.step(t, h, status)
        assert (rov.save() == before) == (status == ERROR)
        assert rov.mode() == STEP
        assert [m.status for m in rov.log] == ([ERROR] if status == ERROR else [WARNING] * (t != start))


JUMPS: list[tuple[float, list[tuple[float, float, bool]]]] = [
    (0.0, [(0.1, 0.1, True), (0.2, 0.1, False), (0.5, 0.1, False)]),  # only the first of two jumps gives a warning
    (0.0, [(-1.4e-17, 0.1, False), (0.1, 0.1, False), (0.1, 0.1, True)]),  # repeated
    (0.0, [(0.0, 0.1, False), (0.1 + 1e-11, 0.1, False)]),
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
            rov.step(t, h)
            regular.step(at, h)
            at += h
            assert [(m.status, m.category) for m in rov.log] == [(WARNING, "logStatusWarning")] * warned
            rov.log.clear()
            assert rov.get(fmu.outputs) == regular.get(fmu.outputs)
