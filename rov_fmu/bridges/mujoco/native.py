"""The step of plugin.py in C, by the vehicle's library for this machine. This file is a part of each exported folder.

The C calls the functions of the MuJoCo that Python has loaded, and knows its arrays by their addresses. It computes the
same numbers as plugin.py, up to rounding errors.
"""

import ctypes
import platform
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from rov_fmu.equation.python.step import TOO_MANY_WAIT

from . import plugin

FORMAT = 1
"""What the step of a scene takes for a vehicle in it (`member` in water.c). Others step in Python, part by part."""
_NAMES = {"linux": "libmujoco.so*", "darwin": "libmujoco*.dylib", "win32": "mujoco.dll"}
_FUNCTIONS = (
    *("mj_step1", "mj_factorM", "mj_projectConstraint", "mj_step2", "mju_quatIntegrate", "mj_getState"),
    *(f"mjcb_{name}" for name in ("passive", "control", "contactfilter", "sensor")),
    *(f"mjcb_act_{name}" for name in ("dyn", "gain", "bias")),
)
"""The functions and the callbacks of MuJoCo, as water.c has them. A callback in Python needs a step in Python."""
_DONE, _NO_BODY, _TOO_MANY_WAIT, _APART, _HAS_CALLBACKS = range(5)
_REASONS = {_NO_BODY: plugin.NO_BODY, _TOO_MANY_WAIT: TOO_MANY_WAIT, _APART: plugin.APART}


class Library:
    """The functions of a vehicle in C, and those of MuJoCo."""

    def __init__(self, own: ctypes.CDLL, equation: Any) -> None:
        """Raises OSError, AttributeError or ValueError without MuJoCo's library, or with that of another vehicle."""
        files = [*Path(mujoco.__file__).parent.glob(_NAMES.get(sys.platform, "none"))]
        if len(files) != 1 or not all(hasattr(kind, "_address") for kind in (mujoco.MjModel, mujoco.MjData)):
            raise OSError("MuJoCo's library is not beside its Python package, or that does not tell its addresses")
        its = ctypes.CDLL(str(files[0]))
        self.functions = [_address(its, name) for name in _FUNCTIONS]
        sizes = (ctypes.c_int * 5)()
        own.water_sizes(sizes)
        self.size, self.outer, *counts = sizes
        if counts != [len(equation.COMMANDS), len(equation.COEFFICIENTS), len(equation.INPUTS)]:
            raise OSError("the library belongs to another equation")
        self.step = own.water_step
        self.step.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_double, ctypes.c_int, ctypes.c_int]
        self.connect, self.forces = own.water_connect, own.water_forces
        self.connect.argtypes, self.forces.argtypes = [ctypes.c_void_p] * 4, [ctypes.c_void_p] * 2
        self.forces.restype = ctypes.c_bool
        self.reset, self.add_mass = own.water_reset, own.water_add_mass
        self.reset.argtypes, self.add_mass.argtypes = [ctypes.c_void_p], [ctypes.c_void_p, ctypes.c_double]
        self.add_forces, self.move = own.water_add_forces, own.water_move
        self.move.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double]
        self.add_forces.argtypes = [*self.move.argtypes, ctypes.c_int]
        for function in (self.connect, self.reset, self.move):
            function.restype = None


def _address(library: ctypes.CDLL, name: str) -> int:
    return ctypes.addressof(ctypes.c_char.in_dll(library, name))


class NativeRov(plugin.Rov):
    """A vehicle in a simulation of MuJoCo, whose step is in C."""

    FORMAT = FORMAT
    address = 0
    """Where the memory of the vehicle is. 0 before it is connected."""
    scene: Any = None
    """The vehicles that moved together with this one in the last step, and the arguments of the C."""

    def __init__(self, library: Library, *arguments: Any, **coefficients: Any) -> None:
        """Connect it as `plugin.Rov` does, by the library of its equation."""
        self.library, self.memory = library, np.zeros(library.size)
        super().__init__(*arguments, **coefficients)

    @property
    def data(self) -> Any:
        """The state of the simulation. It may be exchanged for other data of the same model."""
        return self._data

    @data.setter
    def data(self, data: Any) -> None:
        self._data = data
        if self.address:
            self._connect()

    def _connect(self) -> None:
        """Tell the C where everything is, and let both share the coefficients and inputs."""
        model, data, memory, first = self.model, self.data, self.memory, self.library.outer
        for numbers in (self.coefficients, self.inputs):
            view = memory[first : first + len(numbers)]
            view[:], numbers.array, first = numbers.array, view, first + len(numbers)
        arrays = (data.M, data.qpos, data.qvel, data.ctrl, data.qfrc_passive, data.xmat)
        pointers = [model._address, data._address, *(one.ctypes.data for one in arrays), *self.library.functions]
        implicit = sum(1 << integrator for integrator in self._implicit)
        places = [self.body, self._pose.start, self._dofs.start, implicit, *self._entries, *self._actuators]
        given = np.array(pointers, np.uintp), np.array(places, np.intc), np.ascontiguousarray(self._rigid)
        self.address, self.scene = memory.ctypes.data, None
        self.library.connect(self.address, *(one.ctypes.data for one in given))

    def reset(self) -> None:
        """Stop the thrusters and forget the commands that wait for the dead time, as `plugin.Rov.reset` does."""
        if not self.address:
            self._connect()
        self.library.reset(self.address)

    @property
    def forces(self) -> dict[str, float]:
        """The force of each thruster, N, by its name in the FMU."""
        names = self.water.equation.FORCES
        found = np.zeros(len(names) + 1)
        has_moved = self.library.forces(self.address, found.ctypes.data)
        return dict(zip(names, found.tolist(), strict=False)) if has_moved else {}

    def step(self, steps: int = 1) -> None:
        """Move the simulation by some time steps. Other threads run meanwhile."""
        step(self, steps=steps)

    # ---- The parts of a step, where some of it is in Python ----

    def add_mass(self) -> None:
        """Add the added mass, as `plugin.Rov` does."""
        _raise(self.library.add_mass(self.address, self.data.time))

    def add_forces(self) -> None:
        """Add the forces of the water, as `plugin.Rov` does."""
        option = self.model.opt
        _raise(self.library.add_forces(self.address, self.data.time, option.timestep, option.integrator))

    def move(self) -> None:
        """Move the body, as `plugin.Rov` does."""
        self.library.move(self.address, self.data.time, self.model.opt.timestep)


def step(*rovs: Any, steps: int = 1) -> None:
    """Move the simulation of some vehicles by some time steps, as `plugin.step` does.

    The vehicles may be of several kinds, from several folders. Other threads run meanwhile.
    """
    first, others = rovs[0], rovs[1:]
    scene = getattr(first, "scene", None)
    if scene is None or scene[0] != others:
        if any(getattr(rov, "FORMAT", None) != FORMAT for rov in rovs):
            plugin.step(*rovs, steps=steps)
            return
        members = (ctypes.c_void_p * len(rovs))(*(rov.address for rov in rovs))
        scene = first.scene = others, members, ctypes.addressof(members), len(rovs), first.model.opt
    _, _, members_at, count, option = scene
    result = first.library.step(members_at, count, option.timestep, option.integrator, steps)
    if result == _HAS_CALLBACKS:  # their errors could not pass through the C
        plugin.step(*rovs, steps=steps)
    else:
        _raise(result)


def _raise(result: int) -> None:
    """Raise ValueError unless a step was taken."""
    if result != _DONE:
        raise ValueError(_REASONS[result])


def connector(equation: Any, library: ctypes.CDLL | None) -> Callable[..., plugin.Rov]:
    """Return the function that connects a vehicle with a model: in C, or in Python without a library that fits."""
    if library is not None:
        with suppress(AttributeError, OSError, ValueError):
            return partial(NativeRov, Library(library, equation), equation)
    return partial(plugin.Rov, equation)


def library_in(folder: Path) -> ctypes.CDLL | None:
    """Return the library in a folder for this machine, or None if there is none."""
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    with suppress(OSError):
        return next((ctypes.CDLL(str(file)) for file in folder.glob(f"water_{sys.platform}_{processor}.*")), None)
    return None
