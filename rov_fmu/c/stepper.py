"""Step vehicles again and again with the FMU's own C, as a simulation that waits for its commands needs it.

Each vehicle goes on from where it was, with all that its states do not tell: the commands that wait for the dead time,
and the turns of its heading.
"""

import ctypes
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.compile import ENGINE_FILE, LANES_FILE
from rov_fmu.c.library import load_library
from rov_fmu.c.simulation import on_cores, pointer, reasons, tables_of
from rov_fmu.vehicle.vehicle import Vehicle


class EngineMemory:
    """The memory in which C keeps vehicles of the same layout between their steps.

    It is an array, so Python frees it, and a copy of this object is a copy of the vehicles.
    """

    def __init__(self, vehicle: Vehicle, count: int, file: Path = ENGINE_FILE) -> None:
        self.vehicle, self._file = vehicle, file
        library = load_library(vehicle, file)
        library.single_size.restype = ctypes.c_size_t
        self._memory = np.zeros((count, library.single_size() // 8))
        self._connect()

    def _connect(self) -> None:
        """Find the functions of the library, and the variables of each vehicle at the beginning of its memory."""
        layout, library = self.vehicle.layout, load_library(self.vehicle, self._file)
        library.single_step.restype = ctypes.c_bool
        inputs, states = len(layout.inputs), len(layout.state)
        begin, width = self._memory.ctypes.data, self._memory.strides[0]
        self._c = library, [ctypes.c_void_p(begin + n * width) for n in range(len(self._memory))]
        self._variables = self._memory[:, : len(layout.places)]
        self.inputs = self._memory[:, :inputs]
        """The inputs (vehicles x inputs), which are held until they are set."""
        self.states = self._memory[:, inputs : inputs + states]
        """The states (vehicles x states), which may be set."""

    @property
    def in_c(self) -> tuple[ctypes.CDLL, int, int]:
        """The library, the address of the first vehicle, and the bytes from one vehicle to the next."""
        return self._c[0], self._memory.ctypes.data, self._memory.strides[0]

    def __getstate__(self) -> dict[str, Any]:
        made = ("_c", "_variables", "inputs", "states")
        return {name: value for name, value in vars(self).items() if name not in made}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._connect()

    def begin(self, values: Mapping[str, Any], which: Sequence[int] = (0,)) -> None:
        """Let some vehicles begin anew, with no command on its way. `values` are those of `simulate`, for these."""
        library, addresses = self._c
        tables, _alive = tables_of(self.vehicle, values, (len(which), 1))
        for n, vehicle in enumerate(which):
            library.single_begin(addresses[vehicle], pointer(tables), ctypes.c_ssize_t(n))

    def variables(self, vehicle: int = 0) -> NDArray[np.float64]:
        """Return all variables of a vehicle now, in the order of `layout.places`."""
        library, addresses = self._c
        library.single_calculate(addresses[vehicle])
        own: NDArray[np.float64] = self._variables[vehicle]
        return own


class Stepper(EngineMemory):
    """One vehicle that is stepped from time 0 on, with the bits of the FMU. Each step is exact."""

    def __init__(self, vehicle: Vehicle, start: Mapping[str, float], record: Sequence[str]) -> None:
        """Begin at time 0 s. `start` contains inputs and states in SI units, and Euler angles at the start, by name.

        Others have their usual values. `record` names the variables that each step returns. The arguments are not
        checked. Raises BuildError when the engine cannot be compiled.
        """
        places = vehicle.layout.places
        self._recorded = np.array([places[name] for name in record], int)
        self.time = 0.0
        """The time, s."""
        super().__init__(vehicle, 1, ENGINE_FILE)
        self.begin(start)

    def step(self, inputs: Sequence[float], h: float) -> list[float]:
        """Hold the inputs for h > 0 seconds, and return the recorded variables at the end.

        `inputs` are the commands, or all inputs, in the order of `layout.inputs`, which begins with the commands. The
        others stay as they are. Raises OverflowError if the motion cannot be computed.
        """
        library, (address,) = self._c
        self.inputs[0, : len(inputs)] = inputs
        done = library.single_step(address, ctypes.c_double(self.time), ctypes.c_double(h))
        results = self.recorded()
        if not done or not all(map(isfinite, results)):
            reason = reasons(self.vehicle.layout, h)
            raise OverflowError(f"the motion cannot be computed from {self.time:g} s on: {reason}")
        self.time += h
        return results

    def recorded(self) -> list[float]:
        """Return the recorded variables now."""
        results: list[float] = self.variables().take(self._recorded).tolist()
        return results


class LaneStepper(EngineMemory):
    """Many vehicles that are stepped together, in the lanes of vectors on all cores, as `simulate` does with `lanes`.

    They begin at rest with the usual inputs. Raises BuildError when the engine cannot be compiled.
    """

    def __init__(self, vehicle: Vehicle, count: int) -> None:
        super().__init__(vehicle, count, LANES_FILE)
        self.begin({}, range(count))

    def step(self, h: float) -> NDArray[np.bool_]:
        """Step all vehicles over h > 0 seconds. Return True for those whose motion cannot be computed; they stay."""
        library, addresses = self._c
        times, length, failed = np.zeros(2), np.array([h]), np.empty(len(addresses), np.intp)
        of_steps = [pointer(times), pointer(length)]  # each vehicle has a time of its own

        def run_part(first: int, last: int, stop: ctypes.c_int) -> None:
            sizes = map(ctypes.c_ssize_t, (2, len(addresses), first, last, 0))
            library.simulate_in_lanes(
                None, *of_steps, None, None, pointer(failed), *sizes, 0, ctypes.byref(stop), addresses[0]
            )

        on_cores(run_part, len(addresses), 2, lanes=True)
        return failed < 2
