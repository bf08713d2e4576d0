"""Call the functions of an FMU of FMI 2.0 with any arguments, and get their status."""

import ctypes
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, fmi2EventInfo

from tests import fmi
from tests.fmi import CO_SIMULATION, OK, Message, room

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
_PROTOTYPES = fmi.prototypes(2, FMU2Model, FMU2Slave)
SIGNATURES = fmi.signatures(_PROTOTYPES)
LAST_SUCCESSFUL_TIME, TERMINATED_STATUS = 2, 3


class Fmu(fmi.Fmu):
    PROTOTYPES = _PROTOTYPES
    SIGNATURES = SIGNATURES
    VERSION = 2
    PLATFORM = fmpy.platform
    RENAMED = _RENAMED

    def instance(self, kind: int = CO_SIMULATION, **how: Any) -> "Instance":
        return Instance(self, kind, **how)


def recording_callbacks(log: list[Message]) -> Any:
    """Return callbacks whose logger appends to a list. They must outlive the instance."""

    def record(_environment: int, instance: bytes, status: int, category: bytes, text: bytes) -> None:
        log.append(Message(status, category.decode(), text.decode(), instance.decode()))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(record)
    return callbacks


class Instance(fmi.Instance[Fmu]):
    def __init__(self, fmu: Fmu, kind: int, name: str = "rov", logging: bool | None = None) -> None:
        super().__init__(fmu, kind)
        self._callbacks = recording_callbacks(self.log)
        self.component = fmu.dll.fmi2Instantiate(
            name.encode(), kind, fmu.token, None, ctypes.byref(self._callbacks), 0, bool(logging)
        )
        assert self.component, self.log

    def setup(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("fmi2SetupExperiment", 0, 0.0, start, stop is not None, stop or 0.0)

    def initialize(self, start: float = 0.0, stop: float | None = None, status: int = OK) -> int:
        if self.setup(start, stop) != OK:
            assert status != OK, self.log
            return status
        return self.expect("fmi2EnterInitializationMode", status=status)

    def update(self) -> None:
        self.expect("fmi2NewDiscreteStates", ctypes.byref(fmi2EventInfo()))

    def step(self, t: float, h: float, status: int = OK) -> int:
        return self.expect("fmi2DoStep", t, h, 1, status=status)

    def time(self) -> float:
        value = room()
        self.expect("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, value)
        return float(value[0])
