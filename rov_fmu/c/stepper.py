"""Step one vehicle again and again with the FMU's own C, as a simulation that waits for its commands needs it."""

import ctypes
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite

import numpy as np

from rov_fmu.c.library import load_library
from rov_fmu.c.simulation import numbers_of, places_of, tables_of
from rov_fmu.vehicle.vehicle import Vehicle


class Stepper:
    """One vehicle that is stepped from time 0 on. The inputs are held over each step, and each step is exact.

    All arrays and pointers are made once, so a step costs little more than its computation.
    """

    def __init__(self, vehicle: Vehicle, start: Mapping[str, float], record: Sequence[str]) -> None:
        """Begin at time 0 s. `start` contains inputs and states in SI units, and Euler angles at the start, by name.

        Others have their usual values. `record` names the variables that each step returns. The arguments are not
        checked. Raises BuildError when the engine cannot be compiled.
        """
        layout = vehicle.layout
        self._commands = tuple(layout.commands)
        self._dead_time = vehicle["T_d"] if layout.has_dead_time else 0.0
        # this object keeps the commands that wait, so the engine gets a vehicle without a dead time
        vehicle = Vehicle(replace(layout, has_dead_time=False), vehicle.coefficients)
        places, states = places_of(vehicle.layout), [*vehicle.layout.state]
        self._numbers = numbers_of(vehicle, start)
        continued = [f"{name}_0" for name in vehicle.layout.continued]  # the heading of a vehicle with an attitude
        tables = tables_of(self._numbers)
        kept = [*states, *vehicle.layout.continued]
        recorded = np.array([places[name] for name in (*kept, *record)], np.intc)
        self._kept = np.array([places[name] for name in (*states, *continued)])
        self._inputs = {name: places[name] for name in vehicle.layout.inputs}
        self._result = np.empty((len(recorded), 2))
        self._times = np.zeros(2)
        self._failed = np.empty(1, np.intp)
        self._arrays = tables, recorded, ctypes.c_int(0)  # keeps the arrays alive while C uses their addresses
        self._simulate = load_library(vehicle).simulate
        self._simulate.restype = None
        used = (tables, self._times, recorded, self._result, self._failed)
        sizes = map(ctypes.c_ssize_t, (2, 1, 0, 1, len(recorded)))
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in used]
        self._arguments = (*pointers, *sizes, ctypes.byref(self._arrays[2]))
        self._waiting: deque[tuple[float, list[float]]] = deque()
        self.time = 0.0
        """The time, s."""

    def step(self, commands: Sequence[float], h: float) -> list[float]:
        """Hold the commands, in the order of `layout.commands`, for h > 0 seconds. Return the recorded variables.

        They are those at the end of the step. Raises OverflowError if the motion cannot be computed.
        """
        end = self.time + h
        if not self._dead_time:
            self._act(commands)
            return self._move(end)
        self._waiting.append((self.time + self._dead_time, [*commands]))
        while self._waiting and self._waiting[0][0] < end:
            arrival, acting = self._waiting.popleft()
            if arrival > self.time:
                self._move(arrival)
            self._act(acting)
        return self._move(end)

    def _act(self, commands: Sequence[float]) -> None:
        for name, value in zip(self._commands, commands, strict=True):
            self._numbers[self._inputs[name]] = value

    def _move(self, end: float) -> list[float]:
        self._times[1] = end - self.time
        self._simulate(*self._arguments)
        results: list[float] = self._result[:, 1].tolist()
        if self._failed[0] < 2 or not all(map(isfinite, results)):
            raise OverflowError(f"the motion cannot be computed from {self.time:g} s on")
        count = len(self._kept)
        self._numbers[self._kept] = results[:count]
        self.time = end
        return results[count:]
