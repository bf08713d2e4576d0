"""The cost of a sample of the identification's filter, beside that of other extended Kalman filters of the same model.

The model is the motion of a vehicle with a slow force along each axis (an Ornstein-Uhlenbeck process), measured ten
times per second. All filters take one Runge-Kutta step of the mean per sample, and the covariance by the derivatives in
its middle. The others compute the rates by `VehicleModel.rates`: with NumPy one sample after the other (written by hand,
and by filterpy), and with JAX, which compiles the filter for many sets of parameters in one batch.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.bridges.arrays import force_names, forces, rates
from rov_fmu.c.filter import Filter, Parameters, Record, Run, Sensor, Slow
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.vehicle.vehicle import Vehicle

from .page import Section, duration

Array = NDArray[np.float64]
STEP, SIZE, TIME_CONSTANT, NOISE, ERROR = 0.1, 0.05, 8.0, 0.01, 0.3
"""The time between two samples (s), the size (relative to full thrust) and the time constant (s) of the slow forces, the
noise of each sensor, and the standard deviation of each state at the start (SI units)."""
_COMMANDS, _HELD = (0.3, -0.2, 0.5, 0.0, -0.4), 20
"""The commands of the first thruster, and how many samples each is held."""


@dataclass(frozen=True, eq=False)
class Case:
    """A log of a vehicle without an attitude: the velocities and the depth are measured at each of n times."""

    vehicle: Vehicle
    samples: int = 200

    @property
    def sensors(self) -> list[Sensor]:
        axes = [form.axis for form in self.vehicle.layout.axes]
        return [*(Sensor(axis, True, over_ground=False) for axis in axes), *(Sensor(a, False) for a in axes if a is HEAVE)]

    @property
    def places(self) -> list[int]:
        """The states that are measured, in the order of the sensors."""
        names = [*self.vehicle.layout.state]
        return [names.index(s.axis.velocity if s.is_velocity else "z") for s in self.sensors]

    @property
    def sizes(self) -> Array:
        """The standard deviation of the slow force along each axis."""
        return np.array([SIZE * self.vehicle.strongest(form.axis) for form in self.vehicle.layout.axes])

    @property
    def commands(self) -> Array:
        """samples: the command of each thruster."""
        return np.array([_COMMANDS[n // _HELD % len(_COMMANDS)] for n in range(self.samples)])

    def inputs(self, command: float) -> dict[str, float]:
        names = [*self.vehicle.layout.commands]
        return {**self.vehicle.layout.usual_inputs, **{name: command * 0.8**n for n, name in enumerate(names)}}

    def values(self) -> Array:
        """samples x sensors: what the sensors show."""
        random, states = np.random.default_rng(0), [*self.vehicle.layout.state]
        state, rows = dict(self.vehicle.layout.at_rest), []
        for command in self.commands:
            rows.append([state[states[place]] for place in self.places])
            state = self.vehicle.step(self.inputs(command), state, STEP)
        return np.array(rows) + NOISE * random.standard_normal((self.samples, len(self.places)))

    def ours(self, sets: Mapping[str, Array], count: int, *, lanes: bool) -> Callable[[], list[Array]]:
        """Return a function that runs our filter and returns the innovations of each set of parameters."""
        layout, sensors = self.vehicle.layout, len(self.sensors)
        time = np.repeat(STEP * np.arange(self.samples), sensors)
        told = STEP * np.arange(0, self.samples, _HELD)
        rows = [self.inputs(command) for command in self.commands[::_HELD]]
        names = [name for name in layout.inputs if name in layout.commands]
        inputs = np.array([[row[name] if name in names else 0.0 for name in layout.inputs] for row in rows])
        errors = dict.fromkeys(layout.state, ERROR)
        which = np.tile(np.arange(sensors, dtype=np.intc), self.samples)
        record = Record(
            tuple(self.sensors), time, self.values().ravel(), which, told, told, inputs, layout.at_rest, errors
        )
        drift = (Slow(), Slow(), Slow())
        white = (NOISE,) * sensors
        slow = tuple(Slow(size, TIME_CONSTANT) for size in self.sizes)
        one = Parameters(
            {**self.vehicle.coefficients, **sets}, slow, Slow(), drift, white, (Slow(),) * sensors, count=count
        )
        run_of, alone = Filter(self.vehicle, share=1e9, changing=STEP), Parameters(
            self.vehicle.coefficients, slow, Slow(), drift, white, (Slow(),) * sensors
        )
        if not lanes:
            return lambda: [run_of.run(record, alone).innovations]
        first: Run = run_of.run(record, alone)
        return lambda: [run.innovations for run in run_of.run_many(record, one, first, frozen=False) if run]


def steps(vehicle: Vehicle, x: Any, thrust: Any, p: Mapping[str, Any], loads: list[int], library: Any) -> tuple[Any, Any]:
    """Return the states after a Runge-Kutta step, and those in its middle. x is states and then slow forces."""
    count = len(vehicle.layout.state)

    def rate(y: Any) -> Any:
        return rates(vehicle, y, _with_loads(thrust, x[count:], loads, library), p)

    y, h = x[:count], STEP
    k_1 = rate(y)
    k_2 = rate(y + 0.5 * h * k_1)
    middle = y + 0.5 * h * k_2
    k_3 = rate(middle)
    k_4 = rate(y + h * k_3)
    after = y + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + k_4)
    remains = float(np.exp(-h / TIME_CONSTANT))
    return library.concatenate([after, remains * x[count:]]), library.concatenate([middle, x[count:]])


def _with_loads(thrust: Any, slow: Any, loads: list[int], library: Any) -> Any:
    if library is np:
        found = np.array(np.broadcast_to(thrust.reshape(len(thrust), *[1] * (np.ndim(slow) - 1)), (len(thrust), *np.shape(slow)[1:])))
        found[loads] += slow
        return found
    return thrust.at[np.array(loads)].add(slow)
