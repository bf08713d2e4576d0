"""The cost of a sample of the identification's filter, beside that of other extended Kalman filters of the same model.

The model is the motion of a vehicle with a slow force along each axis (an Ornstein-Uhlenbeck process), whose velocities
are measured 20 times per second. All filters take one Runge-Kutta step of the mean per sample, and the covariance by
the derivatives in its middle. The others compute the rates by `VehicleModel.rates`: with NumPy one sample after the
other, and with JAX, which compiles the filter for many sets of parameters at once.
"""

import importlib
import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.bridges.arrays import force_names, forces, rates
from rov_fmu.identify.likelihood.filter import Filter, Parameters, Record, Sensor, Slow
from rov_fmu.vehicle.vehicle import Vehicle

from .page import Section, duration

Array = NDArray[np.float64]
STEP, SHARE, TIME_CONSTANT, NOISE, ERROR = 0.05, 0.05, 8.0, 0.01, 0.3
"""The time between two samples (s), the size of a slow force relative to full thrust, its time constant (s), the noise
of each sensor, and the standard deviation of each state at the start (SI units)."""
_COMMANDS, _HELD, _SETS = (0.3, 0.2, 0.4, 0.1, 0.3), 20, 64
"""The commands, how many samples each is held, and the sets of parameters of a batch."""


@dataclass(frozen=True, eq=False)
class Case:
    """A log in which all velocities of a vehicle without an attitude are measured through the water."""

    vehicle: Vehicle
    held: int = 5
    """The number of commands that are held one after the other."""

    @cached_property
    def inputs(self) -> list[dict[str, float]]:
        """The inputs of each command, which differ between the thrusters."""
        names = [*self.vehicle.layout.commands]
        commands = [_COMMANDS[n % len(_COMMANDS)] for n in range(self.held)]
        return [
            {**self.vehicle.layout.usual_inputs, **{name: c * 0.8**n for n, name in enumerate(names)}} for c in commands
        ]

    @cached_property
    def samples(self) -> Array:
        """Samples x sensors: what the sensors show."""
        velocities, state, rows = [*self.vehicle.layout.velocities], dict(self.vehicle.layout.at_rest), []
        for inputs in self.inputs:
            for _ in range(_HELD):
                rows.append([state[name] for name in velocities])
                state = self.vehicle.step(inputs, state, STEP)
        return np.array(rows) + NOISE * np.random.default_rng(0).standard_normal((len(rows), len(velocities)))

    @cached_property
    def sizes(self) -> Array:
        """The standard deviation of the slow force along each axis."""
        return np.array([SHARE * self.vehicle.strongest(form.axis) for form in self.vehicle.layout.axes])

    # ---- Ours ----

    def ours(self, count: int) -> Callable[[], Array]:
        """Return a function that runs our filter with sets of parameters, which are all the same: sets x samples."""
        layout, sensors = self.vehicle.layout, self.samples.shape[1]
        told: Array = STEP * _HELD * np.arange(self.held, dtype=np.float64)
        inputs = np.array([[one[n] if n in layout.commands else 0.0 for n in layout.inputs] for one in self.inputs])
        record = Record(
            tuple(Sensor(form.axis, is_velocity=True, over_ground=False) for form in layout.axes),
            np.repeat(STEP * np.arange(len(self.samples)), sensors),
            self.samples.ravel(),
            np.tile(np.arange(sensors, dtype=np.intc), len(self.samples)),
            told,
            told,
            inputs,
            layout.at_rest,
            dict.fromkeys(layout.state, ERROR),
        )
        parameters = Parameters(
            self.vehicle.coefficients,
            tuple(Slow(size, TIME_CONSTANT) for size in self.sizes),
            Slow(),
            (Slow(), Slow(), Slow()),
            (NOISE,) * sensors,
            (Slow(),) * sensors,
            count=count,
        )
        own = Filter(self.vehicle, changing=STEP, share=1e9)
        if count == 1:
            return lambda: own.run(record, parameters).innovations[None]
        first = own.run(record, parameters)

        def run() -> Array:
            runs = own.run_many(record, parameters, first, frozen=False)
            return np.array([one.innovations for one in runs if one])

        return run

    # ---- The same model for others ----

    def rate(self, y: Any, thrust: Any, library: Any) -> Any:
        """Return the rates of the states under the thrust and the slow forces, which y has after the states."""
        count, names = len(self.vehicle.layout.state), force_names(self.vehicle.layout)
        slow = {form.axis.external: y[count + n] for n, form in enumerate(self.vehicle.layout.axes)}
        acting = library.stack([slow.get(name, thrust[n]) for n, name in enumerate(names)])
        return rates(self.vehicle, y[:count], acting, {})

    def moved(self, y: Any, thrust: Any, library: Any) -> tuple[Any, Any]:
        """Return y after a Runge-Kutta step, and in the middle of the step."""
        count = len(self.vehicle.layout.state)
        x, slow, h = y[:count], y[count:], STEP

        def rate(x: Any) -> Any:
            return self.rate(library.concatenate([x, slow]), thrust, library)

        k_1 = rate(x)
        k_2 = rate(x + 0.5 * h * k_1)
        middle = x + 0.5 * h * k_2
        k_3 = rate(middle)
        after = x + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + rate(x + h * k_3))
        return library.concatenate([after, self.remains * slow]), library.concatenate([x + 0.5 * h * k_1, slow])

    @property
    def remains(self) -> float:
        """How much of a slow force remains after a step."""
        return float(np.exp(-STEP / TIME_CONSTANT))

    @cached_property
    def noise(self) -> Array:
        """The growth of the covariance in a step."""
        zeros = np.zeros(len(self.vehicle.layout.state))
        return np.diag(np.concatenate([zeros, self.sizes**2 * (1.0 - self.remains**2)]))

    @cached_property
    def start(self) -> tuple[Array, Array]:
        """The mean and the covariance at the start."""
        state = self.vehicle.layout.at_rest.values()
        errors = np.concatenate([np.full(len(state), ERROR), self.sizes])
        return np.concatenate([[*state], np.zeros(len(self.sizes))]), np.diag(errors**2)

    @cached_property
    def thrusts(self) -> list[Array]:
        return [np.asarray(forces(self.vehicle, inputs, {})) for inputs in self.inputs]

    def transition(self, slope: Any, library: Any) -> Any:
        """Return the derivatives of y after a step, by those of the rates in its middle (states x y)."""
        A, count = STEP * slope, len(self.vehicle.layout.state)
        above = library.eye(len(self.start[0]))[:count] + A + 0.5 * A[:, :count] @ A
        return library.concatenate([above, self.remains * library.eye(len(self.start[0]))[count:]])

    def slope(self, y: Array, thrust: Array) -> Array:
        """Return the derivatives of the rates, by differences."""
        base, changes = self.rate(y, thrust, np), 1e-6 * (1.0 + np.abs(y))
        return np.array(
            [(self.rate(y + h * e, thrust, np) - base) / h for h, e in zip(changes, np.eye(len(y)), strict=True)]
        ).T

    def by_hand(self) -> Array:
        """Run a filter that is written with NumPy: 1 x samples."""
        (y, P), found = self.start, []
        for n, sample in enumerate(self.samples):
            if n:
                thrust = self.thrusts[(n - 1) // _HELD]
                after, middle = self.moved(y, thrust, np)
                phi = self.transition(self.slope(middle, thrust), np)
                y, P = after, phi @ P @ phi.T + self.noise
            for place, value in enumerate(sample):
                off, S = value - y[place], P[place, place] + NOISE**2
                gain = P[place] / S
                y, P = y + gain * off, P - np.outer(gain, P[place])
                found.append(off)
        return np.array(found)[None]

    def by_jax(self, count: int) -> Callable[[], Array]:
        """Return a function that runs a filter that JAX compiles for sets of parameters: sets x samples."""
        jax = importlib.import_module("jax")
        jax.config.update("jax_enable_x64", True)
        jnp = jax.numpy
        thrusts = jnp.array([self.thrusts[max(n - 1, 0) // _HELD] for n in range(len(self.samples))])
        first = jnp.arange(len(self.samples)) == 0

        def step(carry: Any, row: Any) -> tuple[Any, Any]:
            (y, P), (sample, thrust, is_first) = carry, row
            after, middle = self.moved(y, thrust, jnp)
            slope = jax.jacfwd(lambda y: self.rate(y, thrust, jnp))(middle)
            phi = self.transition(slope, jnp)
            y, P = jnp.where(is_first, y, after), jnp.where(is_first, P, phi @ P @ phi.T + self.noise)
            found = []
            for place in range(sample.shape[0]):
                off, S = sample[place] - y[place], P[place, place] + NOISE**2
                gain = P[place] / S
                y, P = y + gain * off, P - jnp.outer(gain, P[place])
                found.append(off)
            return (y, P), jnp.stack(found)

        def run(scale: Any) -> Any:
            y, P = (jnp.array(array) for array in self.start)
            return jax.lax.scan(step, (y, P), (jnp.array(self.samples), thrusts * scale, first))[1].ravel()

        compiled, ones = jax.jit(jax.vmap(run)), jnp.ones(count)
        return lambda: np.asarray(compiled(ones))


def section(vehicle: Vehicle, repetitions: int) -> Section:
    """Return the processor time per sample and set of parameters of each filter, and its ratio to ours in lanes."""
    case = Case(vehicle)
    ways: list[tuple[str, Callable[[], Array]]] = [
        ("ours, in lanes", case.ours(_SETS)),
        ("ours, one set", case.ours(1)),
        ("NumPy, by hand", case.by_hand),
    ]
    if importlib.util.find_spec("jax"):
        ways.append((f"JAX, {_SETS} sets", case.by_jax(_SETS)))
    rows: list[Sequence[str]] = [
        [f"A sample of the filter: {vehicle.name}", "time", "times ours", "innovations differ"]
    ]
    expected, ours = ways[0][1]()[0], 0.0
    for words, run in ways:
        found, cost = run(), []
        for _ in range(repetitions):
            began = process_time()
            run()
            cost.append((process_time() - began) / found.size)
        ours = ours or median(cost)
        off = float(np.abs(found[0] - expected).max())
        rows.append([words, duration(median(cost)), f"{median(cost) / ours:.3g}", f"{off:.0e}"])
    return rows
