"""Call the functions of an FMU of FMI 3.0 with any arguments, and get their status."""

import re
from collections.abc import Callable, Sequence
from ctypes import POINTER, c_bool, c_char
from typing import Any, NamedTuple

import fmpy
from fmpy.fmi3 import FMU3Slave, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from tests import fmi
from tests.fmi import (
    CO_SIMULATION,
    EVENT,
    FAILED,
    INITIALIZATION,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    STEP,
    TERMINATED,
    WITH_EVENTS,
    Message,
    reals,
    room,
    strings,
)

MODES = {**fmi.MODES, WITH_EVENTS: (INSTANTIATED, INITIALIZATION, EVENT, STEP, TERMINATED, FAILED)}
"""The modes by kind. Intermediate Update Mode exists only inside a step."""
EVERY_MODE = [(kind, mode) for kind, modes in MODES.items() for mode in modes]

_PROTOTYPES = fmi.prototypes(3, FMU3Slave)
SIGNATURES = fmi.signatures(_PROTOTYPES)
_ABSENT = r"fmi3[GS]et(Float32|U?Int\d+|Boolean|String|Binary|Clock|(Interval|Shift)(Decimal|Fraction))"
ABSENT = {name: arguments for name, arguments in SIGNATURES.items() if re.fullmatch(_ABSENT, name)}
"""The getters and setters of types that no variable has, and of clocks."""
_STRING_BUFFERS = {"fmi3SerializeFMUState": 2, "fmi3DeserializeFMUState": 1}
"""Arguments that FMPy declares as arrays of c_uint8, for which ctypes accepts no string buffer."""
for _name, _position in _STRING_BUFFERS.items():
    _PROTOTYPES[_name][1][_position] = POINTER(c_char)


def flags(*values: bool) -> Any:
    return (c_bool * len(values))(*values)


class Update(NamedTuple):
    """The arguments of the callback for intermediate update."""

    time: float
    set_requested: bool
    get_allowed: bool
    step_finished: bool
    can_return_early: bool


class Stepped(NamedTuple):
    """The results of a step."""

    event_handling_needed: bool
    terminate_simulation: bool
    early_return: bool
    last_successful_time: float


OnUpdate = Callable[["Instance", Update], float | None]
"""A function that is called inside a step, and may return the time at which the step shall end early."""


class Fmu(fmi.Fmu):
    PROTOTYPES = _PROTOTYPES
    SIGNATURES = SIGNATURES
    VERSION = 3
    PLATFORM = fmpy.platform_tuple

    def instance(self, kind: int = CO_SIMULATION, **how: Any) -> "Instance":
        return Instance(self, kind, **how)


def recorder(log: list[Message]) -> Any:
    """Return a logger that appends to a list. It must outlive the instance."""

    def record(_environment: int, status: int, category: bytes, text: bytes) -> None:
        log.append(Message(status, category.decode(), text.decode(), ""))

    return fmi3LogMessageCallback(record)


class Instance(fmi.Instance[Fmu]):
    """An instance. The FMU calls `on_update` if intermediate variables are registered or early return is allowed."""

    def __init__(
        self,
        fmu: Fmu,
        kind: int,
        name: str = "rov",
        logging: bool | None = None,
        on_update: OnUpdate | None = None,
        intermediate: Sequence[str] = (),
        early: bool = False,
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

    def _inside(self, _: int, time: float, *rest: Any) -> None:
        """Call `on_update`, and pass the time at which the step shall end to the FMU."""
        *booleans, early, wanted = rest
        try:
            end = self.on_update(self, Update(time, *booleans)) if self.on_update else None
        except BaseException as error:  # no exception can pass through C
            self._raised = error
            return
        if end is not None:
            early[0], wanted[0] = True, end

    def initialize(self, start: float = 0.0, stop: float | None = None, status: int = OK) -> int:
        arguments = (False, 0.0, start, stop is not None, stop or 0.0)
        return self.expect("fmi3EnterInitializationMode", *arguments, status=status)

    def update(self) -> None:
        self.expect("fmi3UpdateDiscreteStates", *(flags(True) for _ in range(5)), room())

    def step(self, t: float, h: float, status: int = OK) -> int:
        results, last = [flags(True) for _ in range(3)], room()
        found = self.call("fmi3DoStep", t, h, True, *results, last)
        needed, terminate, early = (bool(flag[0]) for flag in results)
        self.stepped = Stepped(needed, terminate, early, float(last[0]))
        if self._raised is not None:
            raise self._raised
        assert found == status, self.log
        return status

    def time(self) -> float:
        return self.get(["time"])[0]

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Return the adjoint derivatives: by each known, the derivative of the unknowns' combination by the seed."""
        found = room(len(knowns))
        arrays = self.fmu.references(unknowns), self.fmu.references(knowns), reals(*seed), found
        self.expect("fmi3GetAdjointDerivative", *(argument for array in arrays for argument in (array, len(array))))
        return list(found)
