"""The step of a vehicle in MuJoCo, written in Python: what the C must compute up to rounding errors.

It keeps numbers until a command, a coefficient or a direction changes, and remembers what lags itself. The C computes
them at each step from its memory in MuJoCo's data.
"""

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from rov_fmu.bridges.mujoco import _in_mujoco
from rov_fmu.bridges.mujoco.plugin import Numbers, _rigid_mass, _step_by_parts
from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.expression import PYTHON, written
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.python import printed
from rov_fmu.equation.python.printed import accelerations_of
from rov_fmu.equation.python.step import Memory, interpolated
from rov_fmu.vehicle.vehicle import Vehicle

_FLIP = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
_IMPLICIT = int(mujoco.mjtIntegrator.mjINT_IMPLICIT), int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
_HEAVY, _REST = 1e6, 0.1


def equation_in_python(vehicle: Vehicle) -> Any:
    """Return the equation of a vehicle and its names."""
    layout = _in_mujoco(vehicle).layout
    module = {name: getattr(math, name) for name in printed._IMPORTED} | {"interpolated": interpolated}
    exec(compile(_accelerations_text(layout), "<equation>", "exec"), module)
    return SimpleNamespace(
        **module,
        IDENTIFIER=vehicle.identifier,
        COEFFICIENTS={name: vehicle[name] for name in layout.coefficients},
        COMMANDS={name: layout.usual_inputs[name] for name in layout.commands},
        INPUTS={name: x for name, x in layout.usual_inputs.items() if name not in layout.commands},
        DELAYED=layout.acting,
        LAGGING=[*layout.lagging],
        FORCES=[f"F_{thruster.name}" for thruster in layout.thrusters],
    )


def _accelerations_text(layout: Layout) -> str:
    """Return the mass matrix and the accelerations of a vehicle (forward, starboard, down) as a Python module."""
    equation, numbers, mass, rates = accelerations_of(layout)
    every = [axis.velocity for axis in AXES.values()]
    states = [*printed._KNOWN]
    rows = "".join(f"        [{', '.join(written(x, PYTHON, printed._value) for x in row)}],\n" for row in mass)
    accelerations = "".join(f"            {written(rates[v], PYTHON) if v in rates else None},  # {v}\n" for v in every)
    return f"""\
VELOCITIES = {tuple(layout.velocities)!r}  # of the axes that the vehicle has
{printed._tables(equation.thrust_tables)}

def numbers(values):
    \"\"\"Return all numbers that follow from coefficients, inputs, velocities and what lags, and these.\"\"\"
    v = dict(values)
{printed._assignments(numbers)}
    return v


def mass(v):
    \"\"\"Return the mass matrix about the origin, with added mass and tuning, for some numbers.\"\"\"
    return [
{rows}    ]


def accelerations(_numbers):
    \"\"\"Return the function from the time since `_numbers`, the velocities through the water, and the third row of the
    rotation matrix to the accelerations, which are None along axes that the vehicle lacks.\"\"\"
{printed._coefficients(rates.values(), equation, [*states, *(lag.arrived for lag in equation.lags)])}
    def rates(_time, {", ".join(states)}):
{printed._arrived(equation, " " * 8)}        return [
{accelerations}        ]

    return rates


{printed._lagging_text(equation)}"""


class Water:
    """The equation of a vehicle: its commands, the thrust that lags behind them, and the accelerations.

    All frames, signs and units are those of the FMU.
    """

    def __init__(self, equation: Any) -> None:
        self.equation = equation
        self.coefficients, self.inputs = Numbers(equation.COEFFICIENTS, {}), Numbers(equation.INPUTS, {})
        self.lacking = [n for n, v in enumerate("uvwpqr") if v not in equation.VELOCITIES]
        self.reset()

    def reset(self) -> None:
        """Stop the thrusters, and forget the commands that wait for the dead time."""
        self.forces = dict.fromkeys(self.equation.LAGGING, 0.0)
        self.memory = Memory(self.equation.COMMANDS, self.equation.DELAYED)
        self.held: tuple[float, ...] = ()
        self.numbers: dict[str, float] = {}
        self.since = 0.0
        """The time since the numbers of the equation were last computed, s."""
        self.until = 0.0
        """The time until a rotor reverses, after which they no longer hold, s."""

    def mass(self) -> Any:
        """Return the 6x6 mass matrix with added mass and tuning."""
        still = dict.fromkeys("uvwpqr", 0.0)
        return np.array(self.equation.mass(self._numbers({**self.equation.COMMANDS, **still})))

    def _numbers(self, values: Mapping[str, float]) -> dict[str, float]:
        delayed = {later: values[name] for name, later in self.equation.DELAYED.items()}
        found: dict[str, float] = self.equation.numbers(
            {**self.coefficients, **self.inputs, **delayed, **values, **self.forces}
        )
        return found

    def accelerate(
        self,
        commands: Mapping[str, float],
        state: tuple[list[float], list[float]],
        outside: list[float],
        t: float,
        h: float,
    ) -> list[float]:
        """Return the mean acceleration during a time step of h seconds from time t, with the commands held.

        It is that of the origin in the earth frame, and that of the rates in the body frame. `state` are the velocities
        in the same frames, and the quaternion; `outside` is the acceleration by other forces than those of the water.
        """
        self.velocity, self.quaternion = state
        self.outside, self.change = outside, [0.0] * 6
        self.memory.step(self, commands, {}, t, h)
        return [x / h for x in self.change]

    def __getitem__(self, name: str) -> float:
        """Return a coefficient, as the memory asks for it."""
        return self.coefficients[name]

    def step(self, commands: Mapping[str, float], _: Mapping[str, float], h: float) -> dict[str, float]:
        """Move for a part of the time step, during which some commands act. The memory calls this."""
        before, outside = self.velocity, self.outside
        start = self._acceleration(commands, 0.0, before, self.quaternion)
        middle = [v + 0.5 * h * (a + b) for v, a, b in zip(before, start, outside, strict=True)]
        turned = _turned(self.quaternion, before[3:], 0.5 * h)
        mean = self._acceleration(commands, 0.5 * h, middle, turned)
        self.change = [x + h * a for x, a in zip(self.change, mean, strict=True)]
        self.quaternion = _turned(self.quaternion, middle[3:], h)
        self.velocity = [v + h * (a + b) for v, a, b in zip(before, mean, outside, strict=True)]
        self.since += h
        return {}

    def _acceleration(
        self, commands: Mapping[str, float], after: float, velocity: list[float], quaternion: list[float]
    ) -> list[float]:
        """Return the acceleration some seconds after the start of a part of the step."""
        nu, R = self.through(velocity, quaternion)
        (u, v, w, p, q, r), third = nu, R[2]
        self._hold(commands, nu)
        rates: list[float] = self.rates(self.since + after, *nu, *third)
        for n in self.lacking:
            tilt = (0.0, 0.0, 0.0, third[1], -third[0], 0.0)[n]
            rates[n] = -2.0 * nu[n] / _REST - tilt / _REST**2
        # the velocity of the origin changes in the earth frame by v' + omega x v
        a, b, c = rates[0] + q * w - r * v, rates[1] + r * u - p * w, rates[2] + p * v - q * u
        return [*(row[0] * a + row[1] * b + row[2] * c for row in R), *rates[3:]]

    def through(self, velocity: list[float], quaternion: list[float]) -> tuple[tuple[float, ...], list[list[float]]]:
        """Return the velocities through the water with the rates, and the rotation matrix."""
        R = first, second, third = _rotation(quaternion)
        x, y, z = (v - self.inputs.get(name, 0.0) for v, name in zip(velocity, ("V_N", "V_E", "V_D"), strict=False))
        u, v, w = (a * x + b * y + c * z for a, b, c in zip(first, second, third, strict=True))
        return (u, v, w, *velocity[3:]), R

    def _hold(self, commands: Mapping[str, float], nu: tuple[float, ...]) -> None:
        """Compute the numbers that are constant while the inputs and the directions of motion are held."""
        directions = _directions(nu)
        outer = *self.coefficients.array.tolist(), *self.inputs.array.tolist()
        held = *outer, *commands.values(), *directions
        if held != self.held or self.since >= self.until:
            if self.held:
                self.forces = self.equation.lagging(self.numbers, self.since)
            self.held, self.since = held, 0.0
            self.numbers = self._numbers({**commands, **dict(zip("uvwpqr", directions, strict=True))})
            self.rates = self.equation.accelerations(self.numbers)
            self.until = self.equation.until_reversal(self.numbers)


def _directions(nu: tuple[float, ...]) -> list[float]:
    return [-1.0 if x < 0.0 else 1.0 for x in nu]


def _rotation(quaternion: list[float]) -> list[list[float]]:
    """Return the rotation matrix of a quaternion, scalar first."""
    e, a, b, c = quaternion
    s = 2.0 / (e * e + a * a + b * b + c * c)
    return [
        [1.0 - s * (b * b + c * c), s * (a * b - c * e), s * (a * c + b * e)],
        [s * (a * b + c * e), 1.0 - s * (a * a + c * c), s * (b * c - a * e)],
        [s * (a * c - b * e), s * (b * c + a * e), 1.0 - s * (a * a + b * b)],
    ]


def _turned(quaternion: list[float], rates: list[float], h: float) -> list[float]:
    """Return a quaternion after a turn of h seconds, to first order."""
    e, a, b, c = quaternion
    p, q, r = (0.5 * h * rate for rate in rates)
    return [e - a * p - b * q - c * r, a + e * p + b * r - c * q, b + e * q + c * p - a * r, c + e * r + a * q - b * p]


class Reference:
    """A vehicle in a simulation of MuJoCo, whose step is in Python."""

    def __init__(self, vehicle: Vehicle, model: Any, data: Any = None, prefix: str = "") -> None:
        self.water = Water(equation_in_python(vehicle))
        equation = self.water.equation
        self.coefficients, self.inputs = self.water.coefficients, self.water.inputs
        self.model, self.data = model, mujoco.MjData(model) if data is None else data
        self.body = model.body(prefix + equation.IDENTIFIER).id
        self._actuators = [model.actuator(prefix + command).id for command in equation.COMMANDS]
        joint = model.body_jntadr[self.body]
        place, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        self._pose, self._dofs = slice(place, place + 7), slice(dof, dof + 6)
        self._lower = np.tril_indices(6)
        self._entries = model.M_rowadr[dof + self._lower[0]] + self._lower[1]
        self._rigid = _rigid_mass(model, self.body)
        self._turning = self._rigid[:, 3:]
        self._implicit = _IMPLICIT if model.tree_dofnum[model.dof_treeid[dof]] == 6 else _IMPLICIT[:1]
        self.reset()

    def reset(self) -> None:
        """Stop the thrusters and forget the commands that wait, as also if the time is not that of the last step."""
        self.water.reset()
        self._time, self._outside = self.data.time, np.zeros(6)
        self._weighed: list[float] = []

    @property
    def forces(self) -> dict[str, float]:
        """The force of each thruster, N."""
        water, (nu, _) = self.water, self.water.through(*self._state())
        present = dict(zip("uvwpqr", _directions(nu), strict=True)) | water.memory.delayed
        now = water.equation.numbers({**water.numbers, **present, **water.equation.lagging(water.numbers, water.since)})
        return {name: now[name] for name in water.equation.FORCES}

    def _state(self) -> tuple[list[float], list[float]]:
        """Return the velocity over ground with the rates, and the quaternion, in the frames of the equation."""
        e, a, b, c = self.data.qpos[self._pose][3:].tolist()
        return (_FLIP * self.data.qvel[self._dofs]).tolist(), [e, a, -b, -c]

    def step(self, steps: int = 1) -> None:
        """Move the simulation by some time steps."""
        _step_by_parts((self,), steps)

    def add_mass(self) -> None:
        """Add to MuJoCo's inertia matrix what the mass matrix of the vehicle has beyond that of the rigid body."""
        data = self.data
        if data.time != self._time:
            self.reset()
        if self._weighed != self.coefficients.array.tolist():
            self._weighed = self.coefficients.array.tolist()
            self._mass = np.outer(_FLIP, _FLIP) * self.water.mass()
            for n in self.water.lacking:
                self._mass[n] = self._mass[:, n] = 0.0
                self._mass[n, n] = _HEAVY * self._rigid[n, n]
        self._turn = np.eye(6)
        self._turn[:3, :3] = data.xmat[self.body].reshape(3, 3).T
        added = self._turn.T @ (self._mass - self._rigid) @ self._turn
        data.M[self._entries] += added[self._lower]

    def add_forces(self) -> None:
        """Add the forces that give the body the accelerations of the equation, unless other forces act."""
        data, commands = self.data, self.water.equation.COMMANDS
        _, velocity = self._start = data.qpos[self._pose].copy(), data.qvel[self._dofs].copy()
        held = dict(zip(commands, data.ctrl[self._actuators].tolist(), strict=True))
        outside = (_FLIP * self._outside).tolist()
        mean = self.water.accelerate(held, self._state(), outside, data.time, self.model.opt.timestep)
        self._accelerated = _FLIP * np.array(mean)
        data.qfrc_passive[self._dofs] += self._turn.T @ (
            self._mass @ (self._turn @ self._accelerated) + self._subtracted(velocity[3:])
        )

    def _subtracted(self, rates: Any) -> Any:
        """Return the rigid body's part of what MuJoCo subtracts: m omega x (omega x r_G) and omega x I omega.

        Integrators that treat it as implicit subtract its value at the end of the step, linearised about the start.
        """
        turning = self._turning @ rates
        subtracted = _crossed(rates, turning)
        if self.model.opt.integrator in self._implicit:
            change = self.model.opt.timestep * (self._accelerated + self._outside)[3:]
            subtracted += _crossed(change, turning) + _crossed(rates, self._turning @ change)
        return subtracted

    def move(self) -> None:
        """Move the body with its mean velocity during the step, where MuJoCo took the last one."""
        data, h = self.data, self.model.opt.timestep
        if data.time <= self._time:  # MuJoCo has reset a simulation that became unstable
            self.reset()
            return
        self._time = data.time
        pose, velocity = self._start
        mean = 0.5 * (velocity + data.qvel[self._dofs])
        pose[:3] += h * mean[:3]
        mujoco.mju_quatIntegrate(pose[3:], mean[3:], h)
        data.qpos[self._pose] = pose
        self._outside = (data.qvel[self._dofs] - velocity) / h - self._accelerated


def _crossed(omega: Any, other: Any) -> Any:
    """Return the cross products of the rates with two vectors, one after the other."""
    p, q, r = omega.tolist()
    a, b, c, d, e, f = other.tolist()
    return np.array([q * c - r * b, r * a - p * c, p * b - q * a, q * f - r * e, r * d - p * f, p * e - q * d])
