"""FMI 2.0: the FMU's shared library function by function; any argument may be NULL."""

import ctypes
from ctypes import POINTER, c_char_p, c_double, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, fmi2EventInfo

from tests import fmi
from tests.fmi import ALIKE, CO_SIMULATION, INTEGERS, OK, REALS, REFERENCES, STRINGS, Message, Signatures, reals

_RENAMED = {
    "GetFloat64": "GetReal",
    "SetFloat64": "SetReal",
    "GetFMUState": "GetFMUstate",
    "SetFMUState": "SetFMUstate",
    "FreeFMUState": "FreeFMUstate",
    "SerializedFMUStateSize": "SerializedFMUstateSize",
    "SerializeFMUState": "SerializeFMUstate",
    "DeserializeFMUState": "DeSerializeFMUstate",
    "GetContinuousStateDerivatives": "GetDerivatives",
    "GetOutputDerivatives": "GetRealOutputDerivatives",
    "UpdateDiscreteStates": "NewDiscreteStates",
}
SIGNATURES: Signatures = {
    **{f"fmi2{_RENAMED.get(name, name)}": arguments for name, arguments in ALIKE.items()},
    "fmi2SetDebugLogging": (c_int, c_size_t, STRINGS),
    "fmi2SetupExperiment": (c_int, c_double, c_double, c_int, c_double),
    "fmi2EnterInitializationMode": (),
    "fmi2GetReal": (REFERENCES, c_size_t, REALS),
    "fmi2GetInteger": (REFERENCES, c_size_t, INTEGERS),
    "fmi2GetBoolean": (REFERENCES, c_size_t, INTEGERS),
    "fmi2GetString": (REFERENCES, c_size_t, STRINGS),
    "fmi2SetReal": (REFERENCES, c_size_t, REALS),
    "fmi2SetInteger": (REFERENCES, c_size_t, INTEGERS),
    "fmi2SetBoolean": (REFERENCES, c_size_t, INTEGERS),
    "fmi2SetString": (REFERENCES, c_size_t, STRINGS),
    "fmi2GetDirectionalDerivative": (REFERENCES, c_size_t, REFERENCES, c_size_t, REALS, REALS),
    "fmi2NewDiscreteStates": (POINTER(fmi2EventInfo),),
    "fmi2CompletedIntegratorStep": (c_int, INTEGERS, INTEGERS),
    "fmi2SetRealInputDerivatives": (REFERENCES, c_size_t, INTEGERS, REALS),
    "fmi2GetRealOutputDerivatives": (REFERENCES, c_size_t, INTEGERS, REALS),
    "fmi2DoStep": (c_double, c_double, c_int),
    "fmi2CancelStep": (),
    "fmi2GetStatus": (c_int, INTEGERS),
    "fmi2GetRealStatus": (c_int, REALS),
    "fmi2GetIntegerStatus": (c_int, INTEGERS),
    "fmi2GetBooleanStatus": (c_int, INTEGERS),
    "fmi2GetStringStatus": (c_int, STRINGS),
}
LAST_SUCCESSFUL_TIME, TERMINATED_STATUS = 2, 3


class Fmu(fmi.Fmu):
    SIGNATURES = SIGNATURES
    VERSION = 2
    PLATFORM = fmpy.platform
    RENAMED = _RENAMED

    def __init__(self, folder: Path, library: Path | None = None) -> None:
        super().__init__(folder, library)
        self.dll.fmi2Instantiate.argtypes = (c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int)
        self.dll.fmi2Instantiate.restype = c_void_p
        self.dll.fmi2FreeInstance.argtypes = (c_void_p,)
        self.dll.fmi2FreeInstance.restype = None
        self.dll.fmi2GetVersion.restype = self.dll.fmi2GetTypesPlatform.restype = c_char_p

    def instance(self, kind: int = CO_SIMULATION, name: str = "rov", logging: bool | None = None) -> "Instance":
        return Instance(self, kind, name, logging)


def recording_callbacks(log: list[Message]) -> Any:
    """Callbacks whose logger appends to a list. They must outlive the instance."""

    def record(_environment: int, instance: bytes, status: int, category: bytes, text: bytes) -> None:
        log.append(Message(status, category.decode(), text.decode(), instance.decode()))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(record)
    return callbacks


class Instance(fmi.Instance[Fmu]):
    def __init__(self, fmu: Fmu, kind: int, name: str, logging: bool | None) -> None:
        super().__init__(fmu, kind)
        self._callbacks = recording_callbacks(self.log)
        self.component = fmu.dll.fmi2Instantiate(
            name.encode(), kind, fmu.token, None, ctypes.byref(self._callbacks), 0, bool(logging)
        )
        assert self.component, self.log

    def setup(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("fmi2SetupExperiment", 0, 0.0, start, stop is not None, stop or 0.0)

    def initialize(self, start: float = 0.0, stop: float | None = None) -> int:
        status = self.setup(start, stop)
        return status if status != OK else self.call("fmi2EnterInitializationMode")

    def update(self) -> None:
        self.expect("fmi2NewDiscreteStates", ctypes.byref(fmi2EventInfo()))

    def step(self, t: float, h: float) -> int:
        return self.call("fmi2DoStep", t, h, 1)

    def set_by(self, vr: Any, values: Any) -> int:
        return self.call("fmi2SetReal", vr, len(vr), values)

    def get_by(self, vr: Any, values: Any) -> int:
        return self.call("fmi2GetReal", vr, len(vr), values)

    def time(self) -> float:
        value = reals(0.0)
        self.expect("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, value)
        return float(value[0])

    def differentiate(self, unknowns: Any, knowns: Any, seed: Any, sensitivity: Any) -> int:
        sizes = len(unknowns), len(knowns)
        return self.call("fmi2GetDirectionalDerivative", unknowns, sizes[0], knowns, sizes[1], seed, sensitivity)

    def rates_by(self, vr: Any, orders: Any, values: Any) -> int:
        return self.call("fmi2GetRealOutputDerivatives", vr, len(vr), orders, values)
