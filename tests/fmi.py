"""What the wrappers of both versions of FMI share: functions return a status, nothing raises.

Functions can be called by the name that both versions have, which is that of FMI 3.0 without its prefix.
"""

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from ctypes import POINTER, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import fmpy

OK, WARNING, DISCARD, ERROR = range(4)
MODEL_EXCHANGE, CO_SIMULATION, WITH_EVENTS = range(3)
"""Kinds of instances; of FMI 3.0 alone is Co-Simulation with Event Mode."""
INTERFACES = {
    CO_SIMULATION: "Co-Simulation",
    MODEL_EXCHANGE: "Model Exchange",
    WITH_EVENTS: "Co-Simulation with Event Mode",
}

# The modes as the log names them.
INSTANTIATED = "Instantiated"
INITIALIZATION = "Initialization Mode"
STEP = "Step Mode"
EVENT = "Event Mode"
CONTINUOUS = "Continuous-Time Mode"
INTERMEDIATE = "Intermediate Update Mode"
TERMINATED = "Terminated"
FAILED = "Error"
# Nothing that a call computes puts Model Exchange into error mode.
MODES = {
    CO_SIMULATION: (INSTANTIATED, INITIALIZATION, STEP, TERMINATED, FAILED),
    MODEL_EXCHANGE: (INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, TERMINATED),
}
EVERY_MODE = [(kind, mode) for kind, modes in MODES.items() for mode in modes]
"""In both versions."""

REALS, INTEGERS, STRINGS, SIZES = POINTER(c_double), POINTER(c_int), POINTER(c_char_p), POINTER(c_size_t)
REFERENCES, BYTES, STATE = POINTER(c_uint), POINTER(c_char), POINTER(c_void_p)

Signatures = Mapping[str, tuple[Any, ...]]
"""Functions whose first argument is the instance and whose result a status: their further arguments."""
ALIKE: Signatures = {
    "ExitInitializationMode": (),
    "Terminate": (),
    "Reset": (),
    "GetFMUState": (STATE,),
    "SetFMUState": (c_void_p,),
    "FreeFMUState": (STATE,),
    "SerializedFMUStateSize": (c_void_p, SIZES),
    "SerializeFMUState": (c_void_p, BYTES, c_size_t),
    "DeserializeFMUState": (BYTES, c_size_t, STATE),
    "EnterEventMode": (),
    "EnterContinuousTimeMode": (),
    "SetTime": (c_double,),
    "SetContinuousStates": (REALS, c_size_t),
    "GetContinuousStateDerivatives": (REALS, c_size_t),
    "GetEventIndicators": (REALS, c_size_t),
    "GetContinuousStates": (REALS, c_size_t),
    "GetNominalsOfContinuousStates": (REALS, c_size_t),
}
"""By their common names."""


def reals(*values: float) -> Any:
    return (c_double * len(values))(*values)


def integers(*values: int) -> Any:
    return (c_int * len(values))(*values)


def references(*values: int) -> Any:
    return (c_uint * len(values))(*values)


def strings(*values: bytes | None) -> Any:
    return (c_char_p * len(values))(*values)


def room(n: int = 1) -> Any:
    """For numbers, filled with one that nothing is."""
    return reals(*[-7.0] * n)


def contents(arguments: Sequence[Any]) -> list[bytes]:
    """What arguments point to."""
    pointed = [a.contents if hasattr(a, "contents") else a for a in arguments]
    return [bytes(a) for a in pointed if isinstance(a, (ctypes.Array, ctypes.Structure, ctypes._SimpleCData))]


class Message(NamedTuple):
    """What the logger was given; of FMI 2.0 the text is still a printf format, of FMI 3.0 there is no instance."""

    status: int
    category: str
    text: str
    instance: str


class Fmu(ABC):
    """An unzipped FMU: its description as FMPy reads it, and its shared library for this machine."""

    SIGNATURES: ClassVar[Signatures]
    VERSION: ClassVar[int]
    PLATFORM: ClassVar[str]
    RENAMED: ClassVar[Mapping[str, str]] = {}
    """Names that differ from those of FMI 3.0."""

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
            "binaries", self.PLATFORM, self.description.coSimulation.modelIdentifier + fmpy.sharedLibraryExtension
        )
        self.dll = ctypes.CDLL(str(self.library))
        for name, arguments in self.SIGNATURES.items():
            getattr(self.dll, name).argtypes = (c_void_p, *arguments)

    @classmethod
    def name(cls, function: str) -> str:
        """The full name of a function, which may be given by the common one."""
        prefix = f"fmi{cls.VERSION}"
        return function if function.startswith(prefix) else prefix + cls.RENAMED.get(function, function)

    def call(self, function: str, component: int | None, *arguments: Any) -> int:
        """The status of a function of `SIGNATURES`."""
        status: int = getattr(self.dll, self.name(function))(component, *arguments)
        return status

    def references(self, names: Sequence[str]) -> Any:
        return references(*(self.vr[name] for name in names))

    def number(self, name: str, attribute: str) -> float | None:
        """The `min`, `max` or `nominal` of a variable, which in FMI 3.0 is that of its declared type."""
        variable = self.variables[name]
        value = getattr(variable if self.VERSION == 2 else variable.declaredType, attribute)
        return None if value is None else float(value)

    def bounds(self, name: str) -> tuple[float, float]:
        """The range of a variable that has one."""
        low, high = self.number(name, "min"), self.number(name, "max")
        assert low is not None
        assert high is not None
        return low, high

    @property
    def commands(self) -> list[str]:
        """The inputs that have bounds."""
        found = [name for name in self.inputs if self.number(name, "min") is not None]
        assert found
        return found

    def settable(self, mode: str) -> list[str]:
        """What may be set when; beyond the standard, inputs of FMI 2.0 before initialization, and tuning between the
        integrator's steps."""
        chosen = [] if mode in (TERMINATED, FAILED) else [*self.inputs]
        if mode in (INSTANTIATED, INITIALIZATION):
            return chosen + self.states + self.parameters
        if mode in (EVENT, CONTINUOUS, STEP):
            chosen += [name for name in self.parameters if self.variables[name].variability == "tunable"]
        return chosen + (self.states if mode == CONTINUOUS or (mode == EVENT and self.VERSION == 3) else [])

    @property
    def token(self) -> bytes:
        """The GUID, or the instantiation token."""
        token: str = self.description.guid
        return token.encode()

    @abstractmethod
    def instance(self, kind: int = CO_SIMULATION, name: str = "rov", logging: bool | None = None) -> "AnyInstance":
        """A new instance with a recorded log; without `logging` of what is no mere event."""

    def unload(self) -> None:
        fmpy.freeLibrary(self.dll._handle)


Of = TypeVar("Of", bound=Fmu)


class Instance(ABC, Generic[Of]):
    """An instance with a recorded log, freed at the end of its `with` block."""

    def __init__(self, fmu: Of, kind: int) -> None:
        self.fmu = fmu
        self.kind = kind
        self.log: list[Message] = []
        self.component: int | None = None

    def __enter__(self: "Self") -> "Self":
        return self

    def __exit__(self, _type: type | None, _error: BaseException | None, _trace: TracebackType | None) -> None:
        self.free()

    def free(self) -> None:
        getattr(self.fmu.dll, self.fmu.name("FreeInstance"))(self.component)
        self.component = None

    def call(self, function: str, *arguments: Any) -> int:
        return self.fmu.call(function, self.component, *arguments)

    def expect(self, function: str, *arguments: Any) -> None:
        """Call, where nothing but OK is possible."""
        assert self.call(function, *arguments) == OK, (function, self.log)

    # ---- The common sequence ----

    @abstractmethod
    def initialize(self, start: float = 0.0, stop: float | None = None) -> int:
        """From Instantiated to Initialization Mode."""

    @abstractmethod
    def update(self) -> None:
        """Update the discrete states: there are none."""

    @abstractmethod
    def step(self, t: float, h: float) -> int: ...

    def reach(self, mode: str) -> None:
        """Go from Instantiated to a mode of the interface."""
        if mode == INSTANTIATED:
            return
        assert self.initialize() == OK
        if mode == INITIALIZATION:
            return
        self.expect("ExitInitializationMode")
        if mode == EVENT:
            return
        if self.kind != CO_SIMULATION:
            self.update()
            self.expect("EnterContinuousTimeMode" if self.kind == MODEL_EXCHANGE else "EnterStepMode")
        if mode == TERMINATED:
            self.expect("Terminate")
        elif mode == FAILED:
            assert self.set({"V_N": 1e308}) == OK
            assert self.step(0.0, 10.0) == ERROR

    def start(self, values: Mapping[str, float] = {}, stop: float | None = None, at: float = 0.0) -> None:
        """Set values and go to Step Mode or Event Mode."""
        assert self.set(values) == OK, self.log
        assert self.initialize(at, stop) == OK
        self.expect("ExitInitializationMode")

    def mode(self) -> str:
        """The mode, as a call that is refused in every mode tells it."""
        before = len(self.log)
        assert self.initialize(float("nan")) == ERROR
        message = self.log[before]
        del self.log[before:]
        if "allowed" not in message.text:
            return INSTANTIATED
        return message.text.removesuffix(".").rpartition("not allowed in ")[2]

    # ---- Values ----

    @abstractmethod
    def set_by(self, vr: Any, values: Any) -> int:
        """Set as many values as there are references."""

    @abstractmethod
    def get_by(self, vr: Any, values: Any) -> int:
        """Get as many values as there are references."""

    def set(self, values: Mapping[str, float]) -> int:
        return self.set_by(self.fmu.references(list(values)), reals(*values.values()))

    def get(self, names: Sequence[str]) -> list[float]:
        values = room(len(names))
        assert self.get_by(self.fmu.references(names), values) == OK, self.log
        return list(values)

    @abstractmethod
    def time(self) -> float: ...

    # ---- Derivatives ----

    @abstractmethod
    def differentiate(self, unknowns: Any, knowns: Any, seed: Any, sensitivity: Any) -> int:
        """Of references to unknowns by references to knowns, a seed each."""

    def derivatives(self, unknowns: Sequence[str], knowns: Mapping[str, float] | str) -> list[float]:
        """The change of unknowns with those of knowns; or by one known."""
        seeds = {knowns: 1.0} if isinstance(knowns, str) else knowns
        change = room(len(unknowns))
        of = self.fmu.references
        assert self.differentiate(of(unknowns), of(list(seeds)), reals(*seeds.values()), change) == OK, self.log
        return list(change)

    @abstractmethod
    def rates_by(self, vr: Any, orders: Any, values: Any) -> int:
        """Time derivatives of references to outputs."""

    def rates(self, names: Sequence[str]) -> list[float]:
        """First time derivatives of outputs."""
        values = room(len(names))
        assert self.rates_by(self.fmu.references(names), integers(*[1] * len(names)), values) == OK, self.log
        return list(values)

    # ---- State ----

    def save(self, state: c_void_p | None = None) -> bytes:
        """The serialized state: of a saved one, or of now."""
        saved = c_void_p() if state is None else state
        if state is None:
            self.expect("GetFMUState", ctypes.byref(saved))
        size = c_size_t()
        self.expect("SerializedFMUStateSize", saved, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.expect("SerializeFMUState", saved, buffer, size)
        if state is None:
            self.expect("FreeFMUState", ctypes.byref(saved))
        return buffer.raw

    def deserialize(self, serialized: bytes, state: c_void_p) -> int:
        """Bytes to a saved state."""
        buffer = (c_char * len(serialized)).from_buffer_copy(serialized)
        return self.call("DeserializeFMUState", buffer, len(serialized), ctypes.byref(state))

    def load(self, serialized: bytes) -> int:
        """Restore a serialized state; the first status that is not OK, if any."""
        state = c_void_p()
        if (status := self.deserialize(serialized, state)) != OK:
            return status
        status = self.call("SetFMUState", state)
        self.expect("FreeFMUState", ctypes.byref(state))
        return status


Self = TypeVar("Self", bound=Instance[Any])
AnyInstance = Instance[Any]
