"""FMI 3.0: the FMU's shared library function by function; any argument may be NULL."""

from collections.abc import Callable, Sequence
from ctypes import (
    POINTER,
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int64,
    c_size_t,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
from fmpy.fmi3 import fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from tests import fmi
from tests.fmi import (
    ALIKE,
    CO_SIMULATION,
    EVENT,
    FAILED,
    INITIALIZATION,
    INSTANTIATED,
    INTEGERS,
    MODEL_EXCHANGE,
    OK,
    REALS,
    REFERENCES,
    SIZES,
    STEP,
    STRINGS,
    TERMINATED,
    WITH_EVENTS,
    Message,
    Signatures,
    reals,
    room,
    strings,
)

MODES = {**fmi.MODES, WITH_EVENTS: (INSTANTIATED, INITIALIZATION, EVENT, STEP, TERMINATED, FAILED)}
"""By kind; those of intermediate update are inside a step."""
EVERY_MODE = [(kind, mode) for kind, modes in MODES.items() for mode in modes]

FLAGS, COUNTS = POINTER(c_bool), POINTER(c_uint64)
_NONE_OF = {
    "Float32": c_float,
    "Int8": c_int8,
    "UInt8": c_uint8,
    "Int16": c_int16,
    "UInt16": c_uint16,
    "Int32": c_int,
    "UInt32": c_uint,
    "Int64": c_int64,
    "UInt64": c_uint64,
    "Boolean": c_bool,
    "String": c_char_p,
}
_BINARY = (REFERENCES, c_size_t, SIZES, POINTER(c_void_p), c_size_t)
_PARTIAL = (REFERENCES, c_size_t, REFERENCES, c_size_t, REALS, c_size_t, REALS, c_size_t)
TYPES: Signatures = {
    **{
        f"fmi3{do}{name}": (REFERENCES, c_size_t, POINTER(of), c_size_t)
        for do in ("Get", "Set")
        for name, of in _NONE_OF.items()
    },
    "fmi3GetBinary": _BINARY,
    "fmi3SetBinary": _BINARY,
}
"""Getters and setters of the types of which there are no variables."""
CLOCKS: Signatures = {
    "fmi3GetClock": (REFERENCES, c_size_t, FLAGS),
    "fmi3SetClock": (REFERENCES, c_size_t, FLAGS),
    "fmi3GetIntervalDecimal": (REFERENCES, c_size_t, REALS, INTEGERS),
    "fmi3GetIntervalFraction": (REFERENCES, c_size_t, COUNTS, COUNTS, INTEGERS),
    "fmi3GetShiftDecimal": (REFERENCES, c_size_t, REALS),
    "fmi3GetShiftFraction": (REFERENCES, c_size_t, COUNTS, COUNTS),
    "fmi3SetIntervalDecimal": (REFERENCES, c_size_t, REALS),
    "fmi3SetIntervalFraction": (REFERENCES, c_size_t, COUNTS, COUNTS),
    "fmi3SetShiftDecimal": (REFERENCES, c_size_t, REALS),
    "fmi3SetShiftFraction": (REFERENCES, c_size_t, COUNTS, COUNTS),
}
SIGNATURES: Signatures = {
    **{f"fmi3{name}": arguments for name, arguments in ALIKE.items()},
    **TYPES,
    **CLOCKS,
    "fmi3SetDebugLogging": (c_bool, c_size_t, STRINGS),
    "fmi3EnterInitializationMode": (c_bool, c_double, c_double, c_bool, c_double),
    "fmi3EnterConfigurationMode": (),
    "fmi3ExitConfigurationMode": (),
    "fmi3GetFloat64": (REFERENCES, c_size_t, REALS, c_size_t),
    "fmi3SetFloat64": (REFERENCES, c_size_t, REALS, c_size_t),
    "fmi3GetNumberOfVariableDependencies": (c_uint, SIZES),
    "fmi3GetVariableDependencies": (c_uint, SIZES, REFERENCES, SIZES, INTEGERS, c_size_t),
    "fmi3GetDirectionalDerivative": _PARTIAL,
    "fmi3GetAdjointDerivative": _PARTIAL,
    "fmi3EvaluateDiscreteStates": (),
    "fmi3UpdateDiscreteStates": (FLAGS, FLAGS, FLAGS, FLAGS, FLAGS, REALS),
    "fmi3CompletedIntegratorStep": (c_bool, FLAGS, FLAGS),
    "fmi3GetNumberOfEventIndicators": (SIZES,),
    "fmi3GetNumberOfContinuousStates": (SIZES,),
    "fmi3EnterStepMode": (),
    "fmi3GetOutputDerivatives": (REFERENCES, c_size_t, INTEGERS, REALS, c_size_t),
    "fmi3DoStep": (c_double, c_double, c_bool, FLAGS, FLAGS, FLAGS, REALS),
    "fmi3ActivateModelPartition": (c_uint, c_double),
}
_LOGGED = (c_char_p, c_char_p, c_char_p, c_bool, c_bool)
_INSTANTIATE: Signatures = {
    "fmi3InstantiateModelExchange": (*_LOGGED, c_void_p, fmi3LogMessageCallback),
    "fmi3InstantiateCoSimulation": (
        *(*_LOGGED, c_bool, c_bool, REFERENCES, c_size_t),
        *(c_void_p, fmi3LogMessageCallback, fmi3IntermediateUpdateCallback),
    ),
    "fmi3InstantiateScheduledExecution": (*_LOGGED, c_void_p, fmi3LogMessageCallback, *[c_void_p] * 3),
}


def flags(*values: bool) -> Any:
    return (c_bool * len(values))(*values)


class Update(NamedTuple):
    """What intermediate update is told."""

    time: float
    set_requested: bool
    get_allowed: bool
    step_finished: bool
    can_return_early: bool


class Stepped(NamedTuple):
    """What a step gives back."""

    event_handling_needed: bool
    terminate_simulation: bool
    early_return: bool
    last_successful_time: float


OnUpdate = Callable[["Instance", Update], float | None]
"""Called inside a step; may give the time at which it shall end early."""


class Fmu(fmi.Fmu):
    SIGNATURES = SIGNATURES
    VERSION = 3
    PLATFORM = fmpy.platform_tuple

    def __init__(self, folder: Path, library: Path | None = None) -> None:
        super().__init__(folder, library)
        for name, arguments in _INSTANTIATE.items():
            function = getattr(self.dll, name)
            function.argtypes, function.restype = arguments, c_void_p
        self.dll.fmi3FreeInstance.argtypes = (c_void_p,)
        self.dll.fmi3FreeInstance.restype = None
        self.dll.fmi3GetVersion.restype = c_char_p

    def instance(
        self,
        kind: int = CO_SIMULATION,
        name: str = "rov",
        logging: bool | None = None,
        on_update: OnUpdate | None = None,
        intermediate: Sequence[str] = (),
        early: bool = False,
    ) -> "Instance":
        return Instance(self, kind, name, logging, on_update, intermediate, early)


def recorder(log: list[Message]) -> Any:
    """A logger that appends to a list. It must outlive the instance."""

    def record(_environment: int, status: int, category: bytes, text: bytes) -> None:
        log.append(Message(status, category.decode(), text.decode(), ""))

    return fmi3LogMessageCallback(record)


class Instance(fmi.Instance[Fmu]):
    """`on_update` is called in intermediate update, where variables are registered for it or a step may end early."""

    def __init__(
        self,
        fmu: Fmu,
        kind: int,
        name: str,
        logging: bool | None,
        on_update: OnUpdate | None,
        intermediate: Sequence[str],
        early: bool,
    ) -> None:
        super().__init__(fmu, kind)
        self.stepped: Stepped | None = None
        self.on_update = on_update
        self._raised: BaseException | None = None
        self._log = recorder(self.log)
        self._update = fmi3IntermediateUpdateCallback(self._inside)
        arguments: tuple[Any, ...] = (name.encode(), fmu.token, None, False, logging is not False)
        if kind == MODEL_EXCHANGE:
            self.component = fmu.dll.fmi3InstantiateModelExchange(*arguments, None, self._log)
        else:
            vr = fmu.references(intermediate)
            arguments = (*arguments, kind == WITH_EVENTS, early, vr, len(vr), None, self._log, self._update)
            self.component = fmu.dll.fmi3InstantiateCoSimulation(*arguments)
        assert self.component, self.log
        if logging is None:
            self.expect("SetDebugLogging", False, 1, strings(b"logEvents"))

    def _inside(self, _: int, time: float, *told: Any) -> None:
        *booleans, early, wanted = told
        try:
            end = self.on_update(self, Update(time, *booleans)) if self.on_update else None
        except BaseException as error:  # nothing can be raised through C
            self._raised = error
            return
        if end is not None:
            early[0], wanted[0] = True, end

    def initialize(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("fmi3EnterInitializationMode", False, 0.0, start, stop is not None, stop or 0.0)

    def update(self) -> None:
        self.expect("fmi3UpdateDiscreteStates", *(flags(True) for _ in range(5)), room())

    def step(self, t: float, h: float) -> int:
        told, last = [flags(True) for _ in range(3)], room()
        status = self.call("fmi3DoStep", t, h, True, *told, last)
        needed, terminate, early = (bool(flag[0]) for flag in told)
        self.stepped = Stepped(needed, terminate, early, float(last[0]))
        if self._raised is not None:
            raise self._raised
        return status

    def set_by(self, vr: Any, values: Any) -> int:
        return self.call("fmi3SetFloat64", vr, len(vr), values, len(values))

    def get_by(self, vr: Any, values: Any) -> int:
        return self.call("fmi3GetFloat64", vr, len(vr), values, len(values))

    def time(self) -> float:
        return self.get(["time"])[0]

    def differentiate(self, unknowns: Any, knowns: Any, seed: Any, sensitivity: Any) -> int:
        return self._partial("fmi3GetDirectionalDerivative", unknowns, knowns, seed, sensitivity)

    def _partial(self, function: str, unknowns: Any, knowns: Any, seed: Any, sensitivity: Any) -> int:
        pairs = [(array, len(array)) for array in (unknowns, knowns, seed, sensitivity)]
        return self.call(function, *(argument for pair in pairs for argument in pair))

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """The seed's combination of unknowns by each known."""
        found, of = room(len(knowns)), self.fmu.references
        status = self._partial("fmi3GetAdjointDerivative", of(unknowns), of(knowns), reals(*seed), found)
        assert status == OK, self.log
        return list(found)

    def rates_by(self, vr: Any, orders: Any, values: Any) -> int:
        return self.call("fmi3GetOutputDerivatives", vr, len(vr), orders, values, len(values))
