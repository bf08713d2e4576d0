"""Simulate one vehicle or many with the FMU's own C, on all cores."""

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rov_fmu.engine.library import load_library
from rov_fmu.model.rov import Rov

Array = NDArray[np.float64]
_POLL = 0.5
"""Seconds after which the waiting thread looks for Ctrl-C: on Windows it does not end a wait."""
_SHORT = 30
"""Steps that take less time than a thread to start; even the slowest are over before anyone waits for Ctrl-C."""
_SHARES = 8
"""Parts of the vehicles that each worker computes on average, so that no worker waits long for another."""


_TABLE = np.dtype([("at", np.uintp), ("per_vehicle", np.intp), ("per_time", np.intp)])
"""An array by vehicle and time as engine.c reads it: its address, and its strides in numbers; they may be 0."""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """What was recorded of one vehicle or many."""

    values: Array
    """Recorded variables x vehicles x times; NaN from the first time on that cannot be computed."""
    failed: NDArray[np.intp]
    """For each vehicle, the index of the first time that cannot be computed, or the number of times."""


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simulate(
    rov: Rov,
    time: ArrayLike,
    values: Mapping[str, Any] = MappingProxyType({}),
    record: Sequence[str] | None = None,
    *,
    vehicles: int = 1,
    workers: int | None = None,
) -> Trajectories:
    """Simulate vehicles over the same rising times (s), with all inputs held from each time to the next.

    `values` are those of inputs, states at the first time, and coefficients, by name; each broadcasts to vehicles x
    times. Inputs and states that are not given are 0, coefficients are those of the vehicle. `record` names the
    variables to record, the states by default. The results do not depend on the number of workers.

    Raises BuildError where the engine cannot be compiled. The arguments are not checked.
    """
    layout = rov.layout
    record = list(layout.state) if record is None else record
    times = np.require(time, np.float64, ["C", "A"])
    shape = vehicles, len(times)
    places = layout.places | {f"der({name})": layout.places[name] + len(layout.state) for name in layout.state}
    numbers = np.zeros(len(places))
    tables = np.zeros(len(places), _TABLE)
    tables["at"] = numbers.ctypes.data + numbers.itemsize * np.arange(len(places))
    arrays = []  # which must live as long as their addresses are in use
    for name, value in {**rov.coefficients, **values}.items():
        array = np.require(value, np.float64, ["C", "A"])
        if array.ndim == 0:
            numbers[places[name]] = array
        else:
            arrays.append(table := np.broadcast_to(array, shape))
            tables[places[name]] = table.ctypes.data, *(stride // table.itemsize for stride in table.strides)
    recorded = np.array([places[name] for name in record], np.intc)
    result = np.empty((len(record), *shape))
    failed = np.empty(vehicles, np.intp)
    run = load_library(rov).simulate
    run.restype = None
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (tables, times, recorded, result, failed)]
    stop = ctypes.c_int(0)

    def part(first: int) -> None:
        sizes = len(times), vehicles, first, min(first + share, vehicles), len(record)
        run(*pointers, *map(ctypes.c_ssize_t, sizes), ctypes.byref(stop))

    workers = min(workers or usable_cores(), vehicles)
    share = -(-vehicles // (_SHARES * workers))
    firsts = range(0, vehicles, share)
    if vehicles * len(times) <= _SHORT:
        for first in firsts:
            part(first)
    else:
        _run_parts(part, firsts, workers, stop)
    for vehicle in np.flatnonzero(failed < len(times)):
        result[:, vehicle, failed[vehicle] :] = np.nan
    return Trajectories(result, failed)


def _run_parts(part: Callable[[int], None], firsts: range, workers: int, stop: ctypes.c_int) -> None:
    """Run the parts in threads, which C does without Python's lock. Ctrl-C ends them."""
    with ThreadPoolExecutor(workers) as pool:
        parts = [pool.submit(part, first) for first in firsts]
        try:
            while wait(parts, _POLL).not_done:
                pass
        except BaseException:
            stop.value = 1  # the parts end after their step, and those that have not begun do nothing
            raise
    for done in parts:
        done.result()
