"""Call the functions of an FMU of either version of FMI with any arguments, and get their status.

FMPy's classes raise an exception for an error and replace some arguments, so only their prototypes are used here.
A function can be called by a common name, which is the name in FMI 3.0 without its prefix.
"""

import ctypes
import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from types import TracebackType, UnionType
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar, get_args

import fmpy

OK, WARNING, DISCARD, ERROR = range(4)
MODEL_EXCHANGE, CO_SIMULATION, WITH_EVENTS = range(3)
"""The kinds of instances. Only FMI 3.0 has Co-Simulation with Event Mode."""
INTERFACES = {
    CO_SIMULATION: "Co-Simulation",
    MODEL_EXCHANGE: "Model Exchange",
    WITH_EVENTS: "Co-Simulation with Event Mode",
}

# The names of the modes in the log.
INSTANTIATED = "Instantiated"
INITIALIZATION = "Initialization Mode"
STEP = "Step Mode"
EVENT = "Event Mode"
CONTINUOUS = "Continuous-Time Mode"
INTERMEDIATE = "Intermediate Update Mode"
TERMINATED = "Terminated"
FAILED = "Error"
MODES = {
    CO_SIMULATION: (INSTANTIATED, INITIALIZATION, STEP, TERMINATED, FAILED),
    MODEL_EXCHANGE: (INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, TERMINATED),
}
"""The modes of the kinds that both versions have. No call puts an instance of Model Exchange into error mode."""
EVERY_MODE = [(kind, mode) for kind, modes in MODES.items() for mode in modes]

Prototypes = Mapping[str, tuple[Any, list[Any]]]
"""The type of the result and of the arguments of each function of an FMU."""
Signatures = Mapping[str, tuple[Any, ...]]
"""The types of the arguments after the instance, for functions that return a status."""


def prototypes(version: int, *classes: type) -> Prototypes:
    """Return the prototypes of the functions of a version of FMI, as FMPy's classes annotate them."""
    result_types = {int: c_int, bytes: c_char_p}
    found = {}
    for wrapper in classes:
        for name in (name for name in dir(wrapper) if name.startswith(f"fmi{version}")):
            signature = inspect.signature(getattr(wrapper, name))
            _, *annotations = (parameter.annotation for parameter in signature.parameters.values())
            arguments = [get_args(a)[0] if isinstance(a, UnionType) else a for a in annotations]
            returned = signature.return_annotation
            found[name] = result_types.get(returned, returned), arguments
    return found


def signatures(of: Prototypes) -> dict[str, tuple[Any, ...]]:
    """Return the signatures of the functions that return a status."""
    return {name: tuple(arguments[1:]) for name, (returned, arguments) in of.items() if returned is c_int}


def reals(*values: float) -> Any:
    return (c_double * len(values))(*values)


def integers(*values: int) -> Any:
    return (c_int * len(values))(*values)


def references(*values: int) -> Any:
    return (c_uint * len(values))(*values)


def strings(*values: bytes | None) -> Any:
    return (c_char_p * len(values))(*values)


def room(n: int = 1) -> Any:
    """Return an array for results, filled with a number that is no result of any test."""
    return reals(*[-7.0] * n)


def contents(arguments: Sequence[Any]) -> list[bytes]:
    """Return the bytes of the arrays and structures that arguments are or point to."""
    pointed = [a.contents if hasattr(a, "contents") else a for a in arguments]
    return [bytes(a) for a in pointed if isinstance(a, (ctypes.Array, ctypes.Structure, ctypes._SimpleCData))]


class Message(NamedTuple):
    """The arguments of the logger. In FMI 2.0 the text is a printf format; in FMI 3.0 the instance is empty."""

    status: int
    category: str
    text: str
    instance: str


class Log(list[Message]):
    """The messages of an instance. Those that it leaves the water are apart: most tests begin at the surface."""

    def __init__(self) -> None:
        super().__init__()
        self.of_water: list[Message] = []

    def append(self, message: Message) -> None:
        """Add a message."""
        if "the vehicle has left the water" in message.text:
            self.of_water.append(message)
        else:
            super().append(message)


class Fmu(ABC):
    """An unzipped FMU with its description and its shared library for this machine."""

    PROTOTYPES: ClassVar[Prototypes]
    SIGNATURES: ClassVar[Signatures]
    VERSION: ClassVar[int]
    PLATFORM: ClassVar[str]
    RENAMED: ClassVar[Mapping[str, str]] = {}
    """The names without prefix that differ from those of FMI 3.0, by the common name."""

    def __init__(self, folder: Path, library: Path | None = None) -> None:
        self.folder = folder
        self.description = fmpy.read_model_description(str(folder))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.vr: dict[str, int] = {name: v.valueReference for name, v in self.variables.items()}
        self.states: list[str] = [unknown.variable.derivative.name for unknown in self.description.derivatives]
        self.derivatives: list[str] = [unknown.variable.name for unknown in self.description.derivatives]
        self.outputs: list[str] = [unknown.variable.name for unknown in self.description.outputs]
        self.unknowns = [*dict.fromkeys(self.outputs + self.derivatives)]
        self.inputs = [name for name, v in self.variables.items() if v.causality == "input"]
        self.parameters = [name for name, v in self.variables.items() if v.causality == "parameter"]
        self.library = library or folder.joinpath(
            "binaries", self.PLATFORM, self.description.coSimulation.modelIdentifier + fmpy.sharedLibraryExtension
        )
        self.dll = ctypes.CDLL(str(self.library))
        for name, (returned, arguments) in self.PROTOTYPES.items():
            function = getattr(self.dll, name)
            function.restype, function.argtypes = returned, arguments

    @classmethod
    def name(cls, function: str) -> str:
        """Return the full name of a function, given by its full or its common name."""
        prefix = f"fmi{cls.VERSION}"
        return function if function.startswith(prefix) else prefix + cls.RENAMED.get(function, function)

    def call(self, function: str, component: int | None, *arguments: Any) -> int:
        """Call a function of `SIGNATURES`, and return its status."""
        status: int = getattr(self.dll, self.name(function))(component, *arguments)
        return status

    def references(self, names: Sequence[str]) -> Any:
        return references(*(self.vr[name] for name in names))

    def sized(self, values: Any) -> tuple[Any, ...]:
        """Return the arguments that pass an array of values: FMI 3.0 also takes its length."""
        return (values,) if self.VERSION == 2 else (values, len(values))

    def number(self, name: str, attribute: str) -> float | None:
        """Return the `min`, `max` or `nominal` of a variable, which in FMI 3.0 stands in its declared type."""
        variable = self.variables[name]
        value = getattr(variable if self.VERSION == 2 else variable.declaredType, attribute)
        return None if value is None else float(value)

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the minimum and the maximum of a variable that has both."""
        low, high = self.number(name, "min"), self.number(name, "max")
        assert low is not None
        assert high is not None
        return low, high

    @property
    def commands(self) -> list[str]:
        """The inputs that have two bounds."""
        found = [name for name in self.inputs if self.number(name, "max") is not None]
        assert found
        return found

    def settable(self, mode: str) -> list[str]:
        """Return the variables that can be set in a mode.

        Beyond the standard these are inputs of FMI 2.0 in Instantiated, and tunable parameters in Continuous-Time Mode.
        """
        chosen = [] if mode in (TERMINATED, FAILED) else [*self.inputs]
        if mode in (INSTANTIATED, INITIALIZATION):
            return chosen + self.states + self.parameters
        if mode in (EVENT, CONTINUOUS, STEP):
            chosen += [name for name in self.parameters if self.variables[name].variability == "tunable"]
        return chosen + (self.states if mode == CONTINUOUS or (mode == EVENT and self.VERSION == 3) else [])

    @property
    def token(self) -> bytes:
        """The GUID or the instantiation token."""
        token: str = self.description.guid
        return token.encode()

    @abstractmethod
    def instance(self, kind: int = CO_SIMULATION, **how: Any) -> "AnyInstance":
        """Return a new instance that records its log. By default all messages except events are logged.

        `how` has its name, whether messages are logged, and in FMI 3.0 what is done in intermediate update.
        """


AnyFmu = TypeVar("AnyFmu", bound=Fmu)


class Instance(ABC, Generic[AnyFmu]):
    """An instance that records its log, and is freed at the end of its `with` block."""

    def __init__(self, fmu: AnyFmu, kind: int) -> None:
        self.fmu = fmu
        self.kind = kind
        self.log = Log()
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

    def expect(self, function: str, *arguments: Any, status: int = OK) -> int:
        """Call a function that must return this status."""
        assert self.call(function, *arguments) == status, (function, self.log)
        return status

    def refuse(self, function: str, *arguments: Any) -> None:
        """Call a function that must return an error."""
        self.expect(function, *arguments, status=ERROR)

    # ---- The common sequence ----

    @abstractmethod
    def initialize(self, start: float = 0.0, stop: float | None = None, status: int = OK) -> int:
        """Go from Instantiated to Initialization Mode, which must return this status."""

    @abstractmethod
    def update(self) -> None:
        """Update the discrete states, as every importer does in Event Mode."""

    @abstractmethod
    def step(self, t: float, h: float, status: int = OK) -> int:
        """Take a step, which must return this status."""

    def reach(self, mode: str) -> None:
        """Go from Instantiated to a mode of the interface."""
        if mode == INSTANTIATED:
            return
        self.initialize()
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
            self.set({"V_N": 1e308})
            self.step(0.0, 10.0, ERROR)

    def start(self, values: Mapping[str, float] = {}, stop: float | None = None, at: float = 0.0) -> None:
        """Set values and go to Step Mode or Event Mode."""
        self.set(values)
        self.initialize(at, stop)
        self.expect("ExitInitializationMode")

    def mode(self) -> str:
        """Return the mode, which the message about a call names that is refused in every mode."""
        before = len(self.log)
        self.initialize(float("nan"), status=ERROR)
        message = self.log[before]
        del self.log[before:]
        if "allowed" not in message.text:
            return INSTANTIATED
        return message.text.removesuffix(".").rpartition("not allowed in ")[2]

    # ---- Values ----

    def set_by(self, vr: Any, values: Any) -> int:
        """Set variables by value reference."""
        return self.call("SetFloat64", vr, len(vr), *self.fmu.sized(values))

    def get_by(self, vr: Any, values: Any) -> int:
        """Get variables by value reference."""
        return self.call("GetFloat64", vr, len(vr), *self.fmu.sized(values))

    def set(self, values: Mapping[str, float], status: int = OK) -> int:
        """Set variables, which must return this status."""
        found = self.set_by(self.fmu.references(list(values)), reals(*values.values()))
        assert found == status, (values, self.log)
        return status

    def get(self, names: Sequence[str]) -> list[float]:
        values = room(len(names))
        assert self.get_by(self.fmu.references(names), values) == OK, self.log
        return list(values)

    @abstractmethod
    def time(self) -> float: ...

    def trajectory(
        self, steps: range, h: float = 0.1, inputs: Callable[[int], Mapping[str, float]] | None = None
    ) -> bytes:
        """Return the outputs after each of consecutive steps, whose inputs are given by the number of the step."""
        found = b""
        for n in steps:
            if inputs:
                self.set(inputs(n))
            self.step(h * n, h)
            found += bytes(reals(*self.get(self.fmu.outputs)))
        return found

    # ---- Derivatives ----

    def derivatives(self, unknowns: Sequence[str], knowns: Mapping[str, float] | str) -> list[float]:
        """Return the directional derivatives of unknowns for seeds of knowns, or for the seed 1 of one known."""
        seeds = {knowns: 1.0} if isinstance(knowns, str) else knowns
        change, references = room(len(unknowns)), self.fmu.references
        self.expect(
            "GetDirectionalDerivative",
            *(references(unknowns), len(unknowns)),
            *(references(list(seeds)), len(seeds)),
            *self.fmu.sized(reals(*seeds.values())),
            *self.fmu.sized(change),
        )
        return list(change)

    def rates_by(self, vr: Any, orders: Any, values: Any) -> int:
        """Get time derivatives of outputs by value reference."""
        return self.call("GetOutputDerivatives", vr, len(vr), orders, *self.fmu.sized(values))

    def rates(self, names: Sequence[str]) -> list[float]:
        """Return the first time derivatives of outputs."""
        values = room(len(names))
        assert self.rates_by(self.fmu.references(names), integers(*[1] * len(names)), values) == OK, self.log
        return list(values)

    # ---- State ----

    def save(self, state: c_void_p | None = None) -> bytes:
        """Return a serialized state: the given one, or the current state of the instance."""
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
        """Deserialize bytes to a saved state."""
        buffer = (c_char * len(serialized)).from_buffer_copy(serialized)
        return self.call("DeserializeFMUState", buffer, len(serialized), ctypes.byref(state))

    def load(self, serialized: bytes, status: int = OK) -> int:
        """Restore a serialized state. The first status that is not OK, if any, must be this one."""
        state = c_void_p()
        found = self.deserialize(serialized, state)
        if found == OK:
            found = self.call("SetFMUState", state)
            self.expect("FreeFMUState", ctypes.byref(state))
        assert found == status, self.log
        return status


Self = TypeVar("Self", bound=Instance[Any])
AnyInstance = Instance[Any]
