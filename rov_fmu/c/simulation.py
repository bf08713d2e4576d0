"""Simulate one vehicle or many with the FMU's own C, on all cores."""

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from math import nan
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rov_fmu.c.compile import LANES_FILE
from rov_fmu.c.library import load_library
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.python.step import MOST_WAITING
from rov_fmu.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]
_POLL = 0.5
"""The waiting thread looks for Ctrl-C after this number of seconds, because Ctrl-C does not end a wait on Windows."""
_SHORT = 200
"""A simulation of at most this many steps takes less time than starting a thread, and is over before anyone presses
Ctrl-C."""
_BRIEF = 100_000
"""A simulation of at most this many steps takes about 0.1 s, so a single worker runs it without a thread of its own."""
_FULL = 32
"""A part of this many vehicles keeps the lanes of the vectors full for most of the time."""
_PARTS = 8
"""The number of parts that each worker computes on average. Small parts keep workers from waiting for each other."""

TABLE = np.dtype([("at", np.uintp), ("per_vehicle", np.intp), ("per_time", np.intp)])
"""The struct `table` of engine.c. It has the address of an array of numbers by vehicle and time, and the two strides of
this array in doubles."""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """The recorded variables of one vehicle or many."""

    values: Array
    """An array of recorded variables x vehicles x times. It is NaN from the first time on that cannot be computed."""
    failed: NDArray[np.intp]
    """For each vehicle, the index of the first time that cannot be computed, or the number of times."""


def tables_of(
    vehicle: Vehicle, values: Mapping[str, Any], shape: tuple[int, int]
) -> tuple[NDArray[np.void], list[Array]]:
    """Return a table for each variable of the C code, and the arrays whose addresses they contain.

    `values` broadcast to vehicles x times, the shape. Others are the usual ones, as `simulate` says.
    """
    layout = vehicle.layout
    places = layout.places
    numbers = np.zeros(len(places))
    tables = np.zeros(len(places), TABLE)
    tables["at"] = numbers.ctypes.data + numbers.itemsize * np.arange(len(numbers))
    arrays = [numbers]
    neutral = {name: declaration.start for name, declaration in layout.delayed.items()}
    neutral |= dict.fromkeys(layout.before.values(), nan)  # the present one
    coefficients = {name: vehicle[name] for name in layout.coefficients}
    for name, value in {**neutral, **layout.usual_inputs, **coefficients, **values}.items():
        array = np.require(value, np.float64, ["C", "A"])
        if array.ndim == 0:
            numbers[places[name]] = array
        else:
            arrays.append(table := np.broadcast_to(array, shape))
            tables[places[name]] = table.ctypes.data, *(stride // table.itemsize for stride in table.strides)
    return tables, arrays


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simulate(
    vehicle: Vehicle,
    time: ArrayLike,
    values: Mapping[str, Any] = MappingProxyType({}),
    record: Sequence[str] | None = None,
    *,
    vehicles: int = 1,
    workers: int | None = None,
    lanes: bool = False,
    ended: bool = False,
) -> Trajectories:
    """Simulate vehicles over the same rising times (s), with all inputs held from each time to the next.

    A hundred vehicles with other masses, at 30 % ahead, over ten seconds:

        values = {"u_l": 0.3, "u_r": 0.3, "m_rov": np.linspace(6.0, 7.0, 100)[:, None]}  # vehicles x 1, kg
        result = simulate(vehicle, np.linspace(0.0, 10.0, 101), values, ["u"], vehicles=100)
        result.values[0, :, -1]  # u of each vehicle at 10 s, m/s

    `values` contains inputs, states at the first time, and coefficients by name. Each broadcasts to vehicles x times.
    Inputs that are not given have their usual values (`Layout.usual_inputs`): no command, load or current, and the
    usual voltage. States that are not given are 0, and coefficients that are not given are those of the vehicle.
    `record` names the variables to record, by default the states. The results do not depend on the number of workers.

    Of a vehicle with a dead time, the delayed commands may be given, too: those that act at the first time. Otherwise
    no command acts yet. So may the current before the first time, `V_N_before` ..., of a vehicle that it passes; it is
    otherwise the one at that time.

    The attitude of a vehicle with roll or pitch begins at the Euler angles phi_0, theta_0 and psi_0, which are 0 by
    default, or at the quaternion among the states.

    With `lanes`, the processor's vectors step several vehicles at once, each in a lane of its own. The states then
    differ from those of the FMU by rounding errors, and a vehicle does not depend on the others.

    What is recorded at a time follows from the inputs that begin there. With `ended`, it follows from those of the step
    that ends there, as an importer reads the outputs of an FMU.

    Raises BuildError when the engine cannot be compiled. The arguments are not checked.
    """
    record = list(vehicle.layout.state) if record is None else record
    times = np.require(time, np.float64, ["C", "A"])
    lengths = np.diff(times)
    tables, arrays = tables_of(vehicle, values, (vehicles, len(times)))
    places = vehicle.layout.places
    recorded = np.array([places[name] for name in record], np.intc)
    result = np.empty((len(record), vehicles, len(times)))
    failed = np.empty(vehicles, np.intp)
    run = load_library(vehicle, LANES_FILE).simulate_in_lanes if lanes else load_library(vehicle).simulate
    run.restype = ctypes.c_int if lanes else None
    pointers = [*map(pointer, (tables, times, lengths, recorded, result, failed))]

    def run_part(first: int, last: int, stop: ctypes.c_int, _alive: list[Array] = arrays) -> None:
        sizes = map(ctypes.c_ssize_t, (len(times), vehicles, first, last, len(record)))
        if run(*pointers, *sizes, ctypes.c_int(ended), ctypes.byref(stop), *([None] if lanes else [])) == 0:
            raise MemoryError

    on_cores(run_part, vehicles, len(times), workers, lanes=lanes)
    for one in np.flatnonzero(failed < len(times)):
        result[:, one, failed[one] :] = np.nan
    return Trajectories(result, failed)


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return the address of an array, which stays alive as long as the address."""
    return array.ctypes.data_as(ctypes.c_void_p)


def reasons(layout: Layout, h: float) -> str:
    """Return why the motion in a step of h seconds may be one that cannot be computed."""
    waiting = f"; at most {MOST_WAITING} changes of commands can wait for the dead time" if layout.delayed else ""
    return f"it overflows, is too fast, or never settles and needs shorter steps than {h:g} s{waiting}"


def on_cores(
    run_part: Callable[[int, int, ctypes.c_int], None],
    vehicles: int,
    times: int,
    workers: int | None = None,
    *,
    lanes: bool = False,
) -> None:
    """Call a function for parts of the vehicles, each from a first one to before a last one, on all cores.

    C runs without Python's lock, so the parts run at the same time. Ctrl-C ends them: their third argument becomes 1.
    The function must keep alive what it works on: where Ctrl-C comes as a thread starts, nobody waits for this thread.
    """
    workers = min(workers or usable_cores(), vehicles)
    stop = ctypes.c_int(0)
    if vehicles * times <= (_BRIEF if workers == 1 else _SHORT):
        run_part(0, vehicles, stop)
        return
    size = -(-vehicles // (_PARTS * workers))
    if lanes:
        size = max(size, min(_FULL, -(-vehicles // workers)))
    with ThreadPoolExecutor(workers) as pool:
        try:
            firsts = range(0, vehicles, size)
            parts = [pool.submit(run_part, first, min(first + size, vehicles), stop) for first in firsts]
            while wait(parts, _POLL).not_done:
                pass
        except BaseException:
            stop.value = 1  # running parts end after their current step, and the others do nothing
            raise
    for done in parts:
        done.result()
