"""The FMU's shared library function by function: a status is returned, nothing raises, any argument may be NULL."""

import ctypes
from collections.abc import Mapping, Sequence
from ctypes import POINTER, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import fmpy
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, fmi2EventInfo

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
MODEL_EXCHANGE, CO_SIMULATION = range(2)
INTERFACES = {CO_SIMULATION: "Co-Simulation", MODEL_EXCHANGE: "Model Exchange"}

# The modes as the log names them.
INSTANTIATED = "Instantiated"
INITIALIZATION = "Initialization Mode"
STEP = "Step Mode"
EVENT = "Event Mode"
CONTINUOUS = "Continuous-Time Mode"
TERMINATED = "Terminated"
FAILED = "Error"
# Nothing that a call computes puts Model Exchange into error mode.
MODES = {
    CO_SIMULATION: (INSTANTIATED, INITIALIZATION, STEP, TERMINATED, FAILED),
    MODEL_EXCHANGE: (INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, TERMINATED),
}
EVERY_MODE = [(kind, mode) for kind, modes in MODES.items() for mode in modes]

_REALS, _INTEGERS, _STRINGS = POINTER(c_double), POINTER(c_int), POINTER(c_char_p)
_REFERENCES, _BYTES, _STATE = POINTER(c_uint), POINTER(c_char), POINTER(c_void_p)

# Every function whose first argument is the component and whose result a status: its further arguments.
SIGNATURES: dict[str, tuple[Any, ...]] = {
    "fmi2SetDebugLogging": (c_int, c_size_t, _STRINGS),
    "fmi2SetupExperiment": (c_int, c_double, c_double, c_int, c_double),
    "fmi2EnterInitializationMode": (),
    "fmi2ExitInitializationMode": (),
    "fmi2Terminate": (),
    "fmi2Reset": (),
    "fmi2GetReal": (_REFERENCES, c_size_t, _REALS),
    "fmi2GetInteger": (_REFERENCES, c_size_t, _INTEGERS),
    "fmi2GetBoolean": (_REFERENCES, c_size_t, _INTEGERS),
    "fmi2GetString": (_REFERENCES, c_size_t, _STRINGS),
    "fmi2SetReal": (_REFERENCES, c_size_t, _REALS),
    "fmi2SetInteger": (_REFERENCES, c_size_t, _INTEGERS),
    "fmi2SetBoolean": (_REFERENCES, c_size_t, _INTEGERS),
    "fmi2SetString": (_REFERENCES, c_size_t, _STRINGS),
    "fmi2GetFMUstate": (_STATE,),
    "fmi2SetFMUstate": (c_void_p,),
    "fmi2FreeFMUstate": (_STATE,),
    "fmi2SerializedFMUstateSize": (c_void_p, POINTER(c_size_t)),
    "fmi2SerializeFMUstate": (c_void_p, _BYTES, c_size_t),
    "fmi2DeSerializeFMUstate": (_BYTES, c_size_t, _STATE),
    "fmi2GetDirectionalDerivative": (_REFERENCES, c_size_t, _REFERENCES, c_size_t, _REALS, _REALS),
    "fmi2EnterEventMode": (),
    "fmi2NewDiscreteStates": (POINTER(fmi2EventInfo),),
    "fmi2EnterContinuousTimeMode": (),
    "fmi2CompletedIntegratorStep": (c_int, _INTEGERS, _INTEGERS),
    "fmi2SetTime": (c_double,),
    "fmi2SetContinuousStates": (_REALS, c_size_t),
    "fmi2GetDerivatives": (_REALS, c_size_t),
    "fmi2GetEventIndicators": (_REALS, c_size_t),
    "fmi2GetContinuousStates": (_REALS, c_size_t),
    "fmi2GetNominalsOfContinuousStates": (_REALS, c_size_t),
    "fmi2SetRealInputDerivatives": (_REFERENCES, c_size_t, _INTEGERS, _REALS),
    "fmi2GetRealOutputDerivatives": (_REFERENCES, c_size_t, _INTEGERS, _REALS),
    "fmi2DoStep": (c_double, c_double, c_int),
    "fmi2CancelStep": (),
    "fmi2GetStatus": (c_int, _INTEGERS),
    "fmi2GetRealStatus": (c_int, _REALS),
    "fmi2GetIntegerStatus": (c_int, _INTEGERS),
    "fmi2GetBooleanStatus": (c_int, _INTEGERS),
    "fmi2GetStringStatus": (c_int, _STRINGS),
}
LAST_SUCCESSFUL_TIME, TERMINATED_STATUS = 2, 3


def reals(*values: float) -> Any:
    return (c_double * len(values))(*values)


def integers(*values: int) -> Any:
    return (c_int * len(values))(*values)


def references(*values: int) -> Any:
    return (c_uint * len(values))(*values)


def strings(*values: bytes | None) -> Any:
    return (c_char_p * len(values))(*values)


class Message(NamedTuple):
    """What the logger was given; the text is still a printf format."""

    status: int
    category: str
    text: str
    instance: str


class Fmu:
    """An unzipped FMU: its description as FMPy reads it, and its shared library for this machine."""

    def __init__(self, folder: Path, library: Path | None = None) -> None:
        self.folder = folder
        self.description = fmpy.read_model_description(str(folder))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.vr: dict[str, int] = {name: v.valueReference for name, v in self.variables.items()}
        self.states: list[str] = [unknown.variable.derivative.name for unknown in self.description.derivatives]
        self.derivatives: list[str] = [unknown.variable.name for unknown in self.description.derivatives]
        self.outputs: list[str] = [unknown.variable.name for unknown in self.description.outputs]
        self.inputs = [name for name, v in self.variables.items() if v.causality == "input"]
        self.parameters = [name for name, v in self.variables.items() if v.causality == "parameter"]
        self.library = library or folder.joinpath(
            "binaries", fmpy.platform, self.description.coSimulation.modelIdentifier + fmpy.sharedLibraryExtension
        )
        self.dll = ctypes.CDLL(str(self.library))
        for name, arguments in SIGNATURES.items():
            getattr(self.dll, name).argtypes = (c_void_p, *arguments)
        self.dll.fmi2Instantiate.argtypes = (c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int)
        self.dll.fmi2Instantiate.restype = c_void_p
        self.dll.fmi2FreeInstance.argtypes = (c_void_p,)
        self.dll.fmi2FreeInstance.restype = None
        self.dll.fmi2GetVersion.restype = self.dll.fmi2GetTypesPlatform.restype = c_char_p

    def call(self, function: str, component: int | None, *arguments: Any) -> int:
        """The status of a function of `SIGNATURES`."""
        status: int = getattr(self.dll, function)(component, *arguments)
        return status

    def instance(self, kind: int = CO_SIMULATION, name: str = "rov", logging: bool = False) -> "Instance":
        return Instance(self, kind, name, logging)

    def unload(self) -> None:
        fmpy.freeLibrary(self.dll._handle)


def recording_callbacks(log: list[Message]) -> Any:
    """Callbacks whose logger appends to a list. They must outlive the instance."""

    def record(_environment: int, instance: bytes, status: int, category: bytes, text: bytes) -> None:
        log.append(Message(status, category.decode(), text.decode(), instance.decode()))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(record)
    return callbacks


class Instance:
    """An instance with a recorded log, freed at the end of its `with` block."""

    def __init__(self, fmu: Fmu, kind: int, name: str, logging: bool) -> None:
        self.fmu = fmu
        self.kind = kind
        self.log: list[Message] = []
        self._callbacks = recording_callbacks(self.log)
        self.component: int | None = fmu.dll.fmi2Instantiate(
            name.encode(), kind, fmu.description.guid.encode(), None, ctypes.byref(self._callbacks), 0, logging
        )
        assert self.component, self.log

    def __enter__(self) -> "Instance":
        return self

    def __exit__(self, _type: type | None, _error: BaseException | None, _trace: TracebackType | None) -> None:
        self.free()

    def free(self) -> None:
        self.fmu.dll.fmi2FreeInstance(self.component)
        self.component = None

    def call(self, function: str, *arguments: Any) -> int:
        return self.fmu.call(function, self.component, *arguments)

    def expect(self, function: str, *arguments: Any) -> None:
        """Call, where nothing but fmi2OK is possible."""
        assert self.call(function, *arguments) == OK, (function, self.log)

    # ---- The common sequence ----

    def setup(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("fmi2SetupExperiment", 0, 0.0, start, stop is not None, stop or 0.0)

    def reach(self, mode: str) -> None:
        """Go from Instantiated to a mode of the interface."""
        if mode == INSTANTIATED:
            return
        assert self.setup() == OK
        self.expect("fmi2EnterInitializationMode")
        if mode == INITIALIZATION:
            return
        self.expect("fmi2ExitInitializationMode")
        if mode == CONTINUOUS:
            self.expect("fmi2NewDiscreteStates", ctypes.byref(fmi2EventInfo()))
            self.expect("fmi2EnterContinuousTimeMode")
        elif mode == TERMINATED:
            self.expect("fmi2Terminate")
        elif mode == FAILED:
            assert self.set({"V_N": 1e308}) == OK
            assert self.step(0.0, 10.0) == ERROR

    def start(self, values: Mapping[str, float] = {}, stop: float | None = None) -> None:
        """Set values and go to Step Mode or Event Mode."""
        assert self.setup(stop=stop) == OK
        assert self.set(values) == OK, self.log
        self.expect("fmi2EnterInitializationMode")
        self.expect("fmi2ExitInitializationMode")

    def step(self, t: float, h: float) -> int:
        return self.call("fmi2DoStep", t, h, 1)

    # ---- Values ----

    def set(self, values: Mapping[str, float]) -> int:
        vr = references(*(self.fmu.vr[name] for name in values))
        return self.call("fmi2SetReal", vr, len(values), reals(*values.values()))

    def get(self, names: Sequence[str]) -> list[float]:
        values = reals(*[0.0] * len(names))
        self.expect("fmi2GetReal", references(*(self.fmu.vr[name] for name in names)), len(names), values)
        return list(values)

    def derivatives(self, unknowns: Sequence[str], known: str) -> list[float]:
        """The partial derivatives of unknowns by one known."""
        values = reals(*[0.0] * len(unknowns))
        self.expect(
            "fmi2GetDirectionalDerivative",
            references(*(self.fmu.vr[name] for name in unknowns)),
            len(unknowns),
            references(self.fmu.vr[known]),
            1,
            reals(1.0),
            values,
        )
        return list(values)

    def mode(self) -> str:
        """The mode, as a call that is refused in every mode tells it."""
        before = len(self.log)
        assert self.call("fmi2SetupExperiment", 0, 0.0, float("nan"), 0, 0.0) == ERROR
        (message,) = self.log[before:]
        del self.log[before:]
        return (
            message.text.removesuffix(".").rpartition("not allowed in ")[2]
            if "allowed" in message.text
            else INSTANTIATED
        )

    # ---- State ----

    def save(self, state: c_void_p | None = None) -> bytes:
        """The serialized state: of a saved one, or of now."""
        saved = c_void_p() if state is None else state
        if state is None:
            self.expect("fmi2GetFMUstate", ctypes.byref(saved))
        size = c_size_t()
        self.expect("fmi2SerializedFMUstateSize", saved, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.expect("fmi2SerializeFMUstate", saved, buffer, size)
        if state is None:
            self.expect("fmi2FreeFMUstate", ctypes.byref(saved))
        return buffer.raw

    def deserialize(self, serialized: bytes, state: c_void_p) -> int:
        """Bytes to a saved state."""
        buffer = (c_char * len(serialized)).from_buffer_copy(serialized)
        return self.call("fmi2DeSerializeFMUstate", buffer, len(serialized), ctypes.byref(state))

    def load(self, serialized: bytes) -> int:
        """Restore a serialized state; the first status that is not fmi2OK, if any."""
        state = c_void_p()
        if (status := self.deserialize(serialized, state)) != OK:
            return status
        status = self.call("fmi2SetFMUstate", state)
        self.expect("fmi2FreeFMUstate", ctypes.byref(state))
        return status
