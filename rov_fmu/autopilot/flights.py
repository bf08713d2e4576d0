"""Flights of many vehicles in closed loop with the autopilot, in C on all cores."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.autopilot.law import AXES, SENSED, SENSORS, STATE, Sharing, load_law
from rov_fmu.c.simulation import on_cores
from rov_fmu.c.stepper import EngineMemory
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle


class _Numbers(ctypes.Structure):
    _fields_ = (("at", ctypes.c_void_p), ("per_vehicle", ctypes.c_ssize_t), ("per_step", ctypes.c_ssize_t))


class _Flight(ctypes.Structure):
    """The struct `flight` of flights.c."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("step", "calculate", "vehicles", "states", "waiting")),
        *((name, ctypes.c_void_p) for name in ("sensors", "delays", "share")),
        *((name, _Numbers) for name in ("gains", "modes", "aims", "inputs")),
        *((name, ctypes.c_ssize_t) for name in ("size", "done", "steps", "longest", "others")),
        ("h", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("seen", "demands", "outputs", "failed")),
    )


@dataclass(frozen=True, eq=False)
class FlownSteps:
    """Some steps of a flight, as arrays of vehicles x steps x numbers."""

    sensors: Array
    """What the sensors tell at the beginning of each step, by SENSORS."""
    demands: Array
    """The demands along AXES."""
    outputs: Array
    """The outputs of the thrusters, as fractions of the full command."""


class Flights:
    """Vehicles of the same layout, each with an autopilot, that go on from where they were."""

    def __init__(
        self,
        vehicle: Vehicle,
        share: Sharing,
        values: Sequence[Mapping[str, float]],
        delays: Sequence[int] | None = None,
    ) -> None:
        """Begin at time 0 s.

        - `values`: for each vehicle, its coefficients that are not those of `vehicle`, inputs and states at the start.
        - `delays`: for each vehicle, the number of steps from its sensors to its commands, 0 by default.

        Raises BuildError when the engine cannot be compiled.
        """
        count, layout = len(values), vehicle.layout
        self._vehicles = EngineMemory(vehicle, count)
        for n, one in enumerate(values):
            self._vehicles.begin(one, (n,))
        self._delays = np.array(delays or [0] * count, np.intp)
        self._sensors = np.array([layout.places.get(name, -1) for name in SENSORS], np.intc)
        self._share, self._done, self._thrusters = share.numbers, 0, len(share.of_axis)
        self._states = np.zeros((count, len(AXES), STATE))
        self._waiting = np.full((count, self._delays.max(), len(layout.commands)), share.pulse[0])
        self.failed = np.zeros(count, np.bool_)
        """True for vehicles whose motion cannot be computed."""

    def fly(
        self,
        loops: NDArray[np.void],
        modes: Array,
        aims: Array,
        h: float,
        inputs: Mapping[str, Any] = MappingProxyType({}),
    ) -> FlownSteps:
        """Fly steps of h > 0 seconds, one for each row of `aims`.

        `loops` are of the type LOOP (6, or vehicles x 6), and `modes` and `aims` have a column for each of AXES.
        `inputs` are those beside the commands, which broadcast to vehicles x steps; others stay as they are.
        """
        layout, count, steps = self._vehicles.vehicle.layout, len(self._states), len(aims)
        commands, others = len(layout.commands), [*layout.inputs][len(layout.commands) :]
        held = np.repeat(self._vehicles.inputs[:, np.newaxis, commands:], steps, axis=1)
        for name, value in inputs.items():
            held[:, :, others.index(name)] = value
        gains = np.ascontiguousarray(loops).view(np.float64)
        modes, aims = (np.ascontiguousarray(part, np.float64) for part in (modes, aims))
        sizes = SENSED, len(AXES), self._thrusters
        results = [np.full((count, steps, size), np.nan) for size in sizes]
        engine, first_vehicle, size = self._vehicles.in_c
        own = gains[0].size if loops.ndim > 1 else 0
        flight = _Flight(
            *(ctypes.cast(function, ctypes.c_void_p) for function in (engine.single_step, engine.single_calculate)),
            first_vehicle,
            *(part.ctypes.data for part in (self._states, self._waiting, self._sensors, self._delays, self._share)),
            _Numbers(gains.ctypes.data, own, 0),
            *(_Numbers(part.ctypes.data, 0, len(AXES)) for part in (modes, aims)),
            _Numbers(held.ctypes.data, steps * len(others), len(others)),
            *(size, self._done, steps, self._waiting.shape[1], len(others), h),
            *(part.ctypes.data for part in (*results, self.failed)),
        )
        law = load_law()

        def run_part(first: int, last: int, stop: ctypes.c_int) -> None:
            law.autopilot_fly(ctypes.byref(flight), ctypes.c_ssize_t(first), ctypes.c_ssize_t(last), ctypes.byref(stop))

        on_cores(run_part, count, steps)
        self._done += steps
        return FlownSteps(*results)
