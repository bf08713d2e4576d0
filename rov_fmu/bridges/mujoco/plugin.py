"""A vehicle in MuJoCo, with the motion of its FMU. This file is a part of each exported folder.

MuJoCo moves the body and solves contacts. In each time step, a `Rov` adds two things: what the vehicle's mass matrix
has beyond that of the rigid body, above all the added mass, so that contacts, loads and payloads feel it; and the
forces that give the body the accelerations of the equation. These are computed in the middle of the step, so that the
errors of the motion are of second order in the length of the step. native.py does the same in C, where the folder has a
library for this machine.

The world of the model is north, west, up, and the body forward, port, up. The equation has north, east, down and
forward, starboard, down, so components along and about the second and third axis have the other sign.
"""

import csv
import os
import struct
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from copy import copy, deepcopy
from pathlib import Path
from typing import Any

if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
    os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it as it is imported

import mujoco
import numpy as np

from rov_fmu.equation.python.step import Memory

_FLIP = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""The signs of the components in MuJoCo's frames, relative to those in the equation's."""
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_IMPLICIT = int(mujoco.mjtIntegrator.mjINT_IMPLICIT), int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
"""The integrators that treat gyroscopic forces as implicit."""
_HEAVY = 1e6
"""The mass along, or the inertia about, an axis that the vehicle lacks, relative to that of the rigid body."""
_REST = 0.1
"""The time constant, s, with which the body comes to rest along such an axis, and becomes level."""
NO_BODY = "coefficients: the mass matrix must be positive definite; check m_rov and beta"
APART = "step: all vehicles must be in the same simulation, with the same data"


class Numbers(MutableMapping[str, float]):
    """Coefficients or inputs by their names. They are in an array, which the step in C reads as well."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.places = {name: n for n, name in enumerate(values)}
        self.array = np.array([*values.values()], float)

    def __getitem__(self, name: str) -> float:
        return float(self.array[self.places[name]])

    def __setitem__(self, name: str, value: float) -> None:
        if name not in self.places:
            raise ValueError(f"{name}: the vehicle has no such coefficient or input")
        self.array[self.places[name]] = value

    def __delitem__(self, name: str) -> None:
        raise ValueError(f"{name}: a coefficient or an input can only change")

    def __iter__(self) -> Iterator[str]:
        return iter(self.places)

    def __len__(self) -> int:
        return len(self.places)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __ior__(self, values: Mapping[str, float]) -> "Numbers":
        self.update(values)
        return self


class Water:
    """The equation of a vehicle: its commands, the thrust that lags behind them, and the accelerations.

    All frames, signs and units are those of the FMU.
    """

    def __init__(self, equation: Any) -> None:
        self.equation = equation
        self.coefficients, self.inputs = Numbers(equation.COEFFICIENTS), Numbers(equation.INPUTS)
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
        """Return the 6x6 mass matrix with added mass and tuning. Raises ValueError if no body has the coefficients."""
        still, there = dict.fromkeys("uvwpqr", 0.0), [n for n in range(6) if n not in self.lacking]
        try:
            mass = np.array(self.equation.mass(self._numbers({**self.equation.COMMANDS, **still})))
            root = np.linalg.cholesky(mass[np.ix_(there, there)])
        except (ZeroDivisionError, np.linalg.LinAlgError) as error:
            raise ValueError(NO_BODY) from error
        if not np.isfinite(root).all():
            raise ValueError(NO_BODY)
        return mass

    def __copy__(self) -> "Water":
        other = object.__new__(Water)
        other.__dict__ = {**self.__dict__, "memory": copy(self.memory)}
        other.coefficients, other.inputs = Numbers(self.coefficients), Numbers(self.inputs)
        return other

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
        R = first, second, third = _rotation(quaternion)
        x, y, z = (v - self.inputs.get(name, 0.0) for v, name in zip(velocity, ("V_N", "V_E", "V_D"), strict=False))
        u, v, w = (a * x + b * y + c * z for a, b, c in zip(first, second, third, strict=True))
        nu = u, v, w, p, q, r = u, v, w, *velocity[3:]
        self._hold(commands, nu)
        rates: list[float] = self.rates(self.since + after, *nu, *third)
        for n in self.lacking:
            tilt = (0.0, 0.0, 0.0, third[1], -third[0], 0.0)[n]
            rates[n] = -2.0 * nu[n] / _REST - tilt / _REST**2
        # the velocity of the origin changes in the earth frame by v' + omega x v
        a, b, c = rates[0] + q * w - r * v, rates[1] + r * u - p * w, rates[2] + p * v - q * u
        return [*(row[0] * a + row[1] * b + row[2] * c for row in R), *rates[3:]]

    def _hold(self, commands: Mapping[str, float], nu: tuple[float, ...]) -> None:
        """Compute the numbers that are constant while the inputs and the directions of motion are held."""
        directions = [-1.0 if x < 0.0 else 1.0 for x in nu]
        outer = *self.coefficients.array.tolist(), *self.inputs.array.tolist()
        held = *outer, *commands.values(), *directions
        if held != self.held or self.since >= self.until:
            if self.held:
                self.forces = self.equation.lagging(self.numbers, self.since)
            self.held, self.since = held, 0.0
            self.numbers = self._numbers({**commands, **dict(zip("uvwpqr", directions, strict=True))})
            self.rates = self.equation.accelerations(self.numbers)
            self.until = self.equation.until_reversal(self.numbers)


def _rotation(quaternion: list[float]) -> list[list[float]]:
    """Return the rotation matrix of a quaternion, scalar first, which need not have length 1."""
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


class Rov:
    """A vehicle in a simulation of MuJoCo.

    `data.ctrl` has the commands, by actuators with the names of the FMU's inputs. `coefficients` and `inputs` (loads
    from outside, current, voltage) may change at any time: `rov.coefficients["m_rov"] += 0.5` takes ballast on board.
    """

    def __init__(self, equation: Any, model: Any, data: Any = None, prefix: str = "", **coefficients: float) -> None:
        """Connect the equation with its body in a model.

        All names in the model begin with `prefix`, if the vehicle was attached with one. Other `coefficients` replace
        those of the vehicle. Raises ValueError about a model or a coefficient that cannot be used.
        """
        self.model, self.data = model, mujoco.MjData(model) if data is None else data
        self.water = Water(equation)
        self.coefficients.update(coefficients)
        name = prefix + equation.IDENTIFIER
        self.body = model.body(name).id
        self._actuators = [model.actuator(prefix + command).id for command in equation.COMMANDS]
        _check(model, self.body, name)
        joint = model.body_jntadr[self.body]
        place, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        self._pose, self._dofs = slice(place, place + 7), slice(dof, dof + 6)
        self._lower = np.tril_indices(6)
        self._entries = model.M_rowadr[dof + self._lower[0]] + self._lower[1]
        self._rigid = _rigid_mass(model, self.body)
        self._turning = self._rigid[:, 3:]
        # implicitfast treats gyroscopic forces as implicit if the free joint moves the whole tree of bodies
        self._implicit = _IMPLICIT if model.tree_dofnum[model.dof_treeid[dof]] == len(_FLIP) else _IMPLICIT[:1]
        self.reset()

    def __copy__(self) -> "Rov":
        """Return the same vehicle in a simulation of its own, in the same state. The model is shared."""
        return self._copied(self.model, copy(self.data))

    def __deepcopy__(self, memo: dict[int, Any]) -> "Rov":
        """Return the same with a model of its own. Vehicles that are copied together stay together."""
        return self._copied(deepcopy(self.model, memo), deepcopy(self.data, memo))

    def _copied(self, model: Any, data: Any) -> "Rov":
        other = object.__new__(type(self))
        own = {name: x.copy() for name, x in self.__dict__.items() if isinstance(x, np.ndarray)}
        other.__dict__ = {**self.__dict__, **own, "water": copy(self.water)}
        other.model, other.data = model, data
        return other

    @property
    def coefficients(self) -> Numbers:
        """The coefficients by their names in the FMU, in SI units."""
        return self.water.coefficients

    @coefficients.setter
    def coefficients(self, values: Mapping[str, float]) -> None:
        self.water.coefficients.update(values)

    @property
    def inputs(self) -> Numbers:
        """The inputs that are no commands, by their names in the FMU, in SI units."""
        return self.water.inputs

    @inputs.setter
    def inputs(self, values: Mapping[str, float]) -> None:
        self.water.inputs.update(values)

    def reset(self) -> None:
        """Stop the thrusters and forget the commands that wait for the dead time.

        `step` does this when the time is not that at the end of the last step, as after a reset of MuJoCo.
        """
        self.water.reset()
        self._time, self._outside = self.data.time, np.zeros(6)
        self._weighed: list[float] = []

    @property
    def forces(self) -> dict[str, float]:
        """The force of each thruster, N, by its name in the FMU."""
        water = self.water
        if not water.held:
            return {}
        now = water.equation.numbers({**water.numbers, **water.equation.lagging(water.numbers, water.since)})
        return {name: now[name] for name in water.equation.FORCES}

    def step(self, steps: int = 1) -> None:
        """Move the simulation by some time steps. For several vehicles in one model, there is the function `step`."""
        step(self, steps=steps)

    # ---- The parts of a step, in their order ----

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
        pose, velocity = self._start = data.qpos[self._pose].copy(), data.qvel[self._dofs].copy()
        held = dict(zip(commands, data.ctrl[self._actuators].tolist(), strict=True))
        e, a, b, c = pose[3:].tolist()
        state = (_FLIP * velocity).tolist(), [e, a, -b, -c]
        outside = (_FLIP * self._outside).tolist()
        mean = self.water.accelerate(held, state, outside, data.time, self.model.opt.timestep)
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


def step(*rovs: Rov, steps: int = 1) -> None:
    """Move the simulation of some vehicles, which share a model and its data, by some time steps.

    This is MuJoCo's own step (`mj_step1`, `mj_step2`) by its integrator Euler, implicit or implicitfast. Raises
    ValueError about vehicles in different simulations, and when more commands wait for the dead time than a vehicle
    can keep.
    """
    model, data = rovs[0].model, rovs[0].data
    if any(rov.data is not data for rov in rovs):
        raise ValueError(APART)
    for _ in range(steps):
        mujoco.mj_step1(model, data)
        for rov in rovs:
            rov.add_mass()
        mujoco.mj_factorM(model, data)
        mujoco.mj_projectConstraint(model, data)
        for rov in rovs:
            rov.add_forces()
        mujoco.mj_step2(model, data)
        for rov in rovs:
            rov.move()


def _check(model: Any, body: int, name: str) -> None:
    """Raise ValueError if the equation cannot move a body."""
    if hasattr(mujoco.MjData, "qM"):  # contacts there do not feel what is added to M
        raise ValueError(f"MuJoCo {mujoco.__version__}: must be 3.17 or later: pip install --upgrade mujoco")
    if model.body_parentid[body] or model.body_jntnum[body] != 1 or model.jnt_type[model.body_jntadr[body]] != _FREE:
        raise ValueError(f"body {name}: must be in <worldbody> and have a <freejoint>, and no other joint")
    if model.body_simple[body]:
        raise ValueError(f"body {name}: must contain another body, else MuJoCo keeps only the diagonal of its inertia")
    if model.body_gravcomp[body] != 1.0:
        raise ValueError(f'body {name}: must have gravcomp="1", because the equation contains weight and buoyancy')
    if model.opt.density or model.opt.viscosity:
        raise ValueError(
            "option: density and viscosity must be 0, because the equation contains the forces of the water"
        )


def _rigid_mass(model: Any, body: int) -> Any:
    """Return the 6x6 mass matrix of a rigid body about its origin, in its own frame."""
    mass, centre, entries = model.body_mass[body], model.body_ipos[body], np.empty(9)
    mujoco.mju_quat2Mat(entries, model.body_iquat[body])
    axes = entries.reshape(3, 3)
    cross = np.cross(np.eye(3), centre)  # cross @ x is centre x x
    about_centre = axes @ np.diag(model.body_inertia[body]) @ axes.T
    return np.block([[mass * np.eye(3), -mass * cross], [mass * cross, about_centre - mass * cross @ cross]])


def _crossed(omega: Any, other: Any) -> Any:
    """Return the cross products of the rates with two vectors, one after the other."""
    p, q, r = omega.tolist()
    a, b, c, d, e, f = other.tolist()
    return np.array([q * c - r * b, r * a - p * c, p * b - q * a, q * f - r * e, r * d - p * f, p * e - q * d])


# ---- The exported folder ---------------------------------------------------------------------------------------------


def load(rov: Callable[..., Rov], scene: Path, **coefficients: float) -> Rov:
    """Return the vehicle in its world (MJCF), with other values of some coefficients. `rov` connects it there."""
    return rov(mujoco.MjModel.from_xml_path(str(scene)), None, "", **coefficients)


def draws(path: Path) -> list[dict[str, float]]:
    """Return the sets of coefficients that were drawn, from a table with a set in each row: load(**draws()[0])."""
    with path.open(encoding="utf-8", newline="") as file:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


def show(rov: Rov, picture: Path | None = None) -> None:
    """Open MuJoCo's viewer with a vehicle, or write a picture (.png) of it, 2 s after the start of an example.

    Raises SystemExit with a line about what is missing.
    """
    for name, value in rov.water.equation.EXAMPLE.items():
        if name in rov.inputs:
            rov.inputs[name] = value
        else:
            rov.data.actuator(name).ctrl = value
    if picture is None:
        _view(rov)
        return
    while rov.data.time < 2.0:
        rov.step()
    mujoco.mj_forward(rov.model, rov.data)
    try:
        with mujoco.Renderer(rov.model, 720, 1280) as renderer:
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = True
            renderer.update_scene(rov.data, "chase")
            pixels = renderer.render()
    except (AttributeError, ImportError, OSError, RuntimeError, mujoco.FatalError) as error:
        raise SystemExit(
            f"MuJoCo cannot draw ({error}): on Linux without a display, it needs EGL (packages libegl1 and "
            "libgl1-mesa-dri), or MUJOCO_GL=osmesa and the package libosmesa6"
        ) from error
    picture.write_bytes(_png(pixels))


def _view(rov: Rov) -> None:
    import time

    import mujoco.viewer

    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        raise SystemExit("There is no display for a window: give the name of a picture, such as rov.png, to draw one")
    try:
        viewer = mujoco.viewer.launch_passive(rov.model, rov.data)
    except RuntimeError as error:
        raise SystemExit(f"MuJoCo cannot open a window ({error}); on macOS, run mjpython in place of python") from error
    with viewer:
        ahead = rov.data.time - time.monotonic()
        while viewer.is_running():
            with viewer.lock():
                rov.step()
            viewer.sync()
            wait = rov.data.time - time.monotonic() - ahead
            if abs(wait) > 1.0:  # a pause, or a reset
                ahead += wait
            elif wait > 0.0:
                time.sleep(wait)


def _png(pixels: Any) -> bytes:
    """Return a picture (height x width x 3 bytes) as the content of a PNG file."""
    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
