"""A vehicle in MuJoCo, with the motion of its FMU. This file is a part of each exported folder.

MuJoCo moves the body and solves contacts. In each time step, the vehicle's library (water.c) adds two things: what the
vehicle's mass matrix has beyond that of the rigid body, above all the added mass, so that contacts, loads and payloads
feel it; and the forces that give the body the accelerations of the equation. These are computed in the middle of the
step, so that the errors of the motion are of second order in the length of the step.

The library calls the functions of the MuJoCo that Python has loaded, and knows its arrays by their addresses. What a
vehicle remembers from step to step, such as thrust that lags, is in the activations of its first actuator (`data.act`).
So it belongs to the data: MuJoCo copies, saves and resets it with them.

The world of the model is north, west, up, and the body forward, port, up. The equation has north, east, down and
forward, starboard, down, so components along and about the second and third axis have the other sign.
"""

import csv
import ctypes
import os
import platform
import struct
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from copy import copy, deepcopy
from math import inf, isfinite
from pathlib import Path
from typing import Any

if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
    os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it as it is imported

import mujoco
import numpy as np

FORMAT = 2
"""What the step of a scene takes for a vehicle in it (`member` in water.c). Others are stepped part by part."""
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_FREEDOMS = 6
"""Those of a free joint."""
_USER = int(mujoco.mjtDyn.mjDYN_USER)
_IMPLICIT = int(mujoco.mjtIntegrator.mjINT_IMPLICIT), int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
"""The integrators that treat gyroscopic forces as implicit."""
_LIBRARIES = {"linux": "libmujoco.so*", "darwin": "libmujoco*.dylib", "win32": "mujoco.dll"}
_PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}
"""The usual names of processors, by other names."""
_FUNCTIONS = (
    *("mj_step1", "mj_factorM", "mj_projectConstraint", "mj_step2", "mju_quatIntegrate", "mj_getState"),
    *("mju_error", "mju_user_error"),
    *(f"mjcb_{name}" for name in ("passive", "control", "contactfilter", "sensor")),
    *(f"mjcb_act_{name}" for name in ("dyn", "gain", "bias")),
)
"""The functions, and the variables with functions, of MuJoCo, as water.c has them."""
_DONE, _NO_BODY, _TOO_MANY_WAIT, _APART, _HAS_CALLBACKS, _MUJOCO_FAILS = range(6)
_REASONS = {
    _NO_BODY: "coefficients: the mass matrix must be positive definite; check m_rov and beta",
    _TOO_MANY_WAIT: "more changes of commands wait for the dead time than the model keeps; change them less often, or "
    "raise actdim of the vehicle's first actuator in vehicle.xml",
    _APART: "step: all vehicles must be in the same simulation, with the same data",
}


class Numbers(MutableMapping[str, float]):
    """Coefficients or inputs by their names. They are in an array, which the step reads."""

    def __init__(self, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]) -> None:
        self.places = {name: n for n, name in enumerate(values)}
        self.array, self.bounds = np.array([*values.values()], float), bounds

    def __getitem__(self, name: str) -> float:
        return float(self.array[self.places[name]])

    def __setitem__(self, name: str, value: float) -> None:
        if name not in self.places:
            raise ValueError(f"{name}: the vehicle has no such coefficient or input")
        low, high = self.bounds.get(name, (-inf, inf))
        if not (isfinite(value) and low <= value <= high):
            raise ValueError(f"{name} = {value!r}: must be a number within {low:g} ... {high:g}")
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


class Library:
    """The functions of a vehicle in C, and those of MuJoCo."""

    def __init__(self, own: ctypes.CDLL, equation: Any) -> None:
        """Raises ValueError without MuJoCo's library, or with that of another vehicle."""
        files = [*Path(mujoco.__file__).parent.glob(_LIBRARIES.get(sys.platform, "libmujoco*"))]
        try:
            its = ctypes.CDLL(str(files[0]))
            self.functions = [ctypes.addressof(ctypes.c_char.in_dll(its, name)) for name in _FUNCTIONS]
        except (IndexError, OSError, ValueError) as error:
            raise ValueError(f"MuJoCo {mujoco.__version__}: its library cannot be used: {error}") from error
        sizes = (ctypes.c_int * 7)()
        own.water_sizes(sizes)
        self.size, self.outer, *counts, self.kept, self.change = sizes
        if counts != [len(equation.COMMANDS), len(equation.COEFFICIENTS), len(equation.INPUTS)]:
            raise ValueError(f"{own._name}: the library belongs to another vehicle")
        address, integer, number = ctypes.c_void_p, ctypes.c_int, ctypes.c_double
        self.step, self.connect, self.forces = own.water_step, own.water_connect, own.water_forces
        self.step.argtypes = [address, integer, number, integer, integer, ctypes.c_char_p, integer]
        self.connect.argtypes, self.forces.argtypes = [address] * 4, [address] * 2
        self.add_mass, self.add_forces, self.move = own.water_add_mass, own.water_add_forces, own.water_move
        self.add_mass.argtypes, self.move.argtypes = [address, number], [address, number, number]
        self.add_forces.argtypes = [address, number, number, integer]
        for function in (self.connect, self.forces, self.move):
            function.restype = None


class Rov:
    """A vehicle in a simulation of MuJoCo.

    `data.ctrl` has the commands, by actuators with the names of the FMU's inputs. `coefficients` and `inputs` (loads
    from outside, current, voltage) may change at any time: `rov.inputs["Z_ext"] = 3.0` is a load of 3 N.
    """

    FORMAT = FORMAT
    scene: Any = None
    """The vehicles that moved together with this one in the last step, and the arguments of the C."""

    def __init__(
        self, library: Library, equation: Any, model: Any, data: Any = None, prefix: str = "", **coefficients: float
    ) -> None:
        """Connect the equation with its body in a model.

        All names in the model begin with `prefix`, if the vehicle was attached with one. Other `coefficients` replace
        those of the vehicle. Raises ValueError about a model, its data or a coefficient that cannot be used.
        """
        self.library, self.equation, self.memory = library, equation, np.zeros(library.size)
        self._coefficients = Numbers(equation.COEFFICIENTS, equation.BOUNDS)
        self._inputs = Numbers(equation.INPUTS, {})
        self.coefficients.update(coefficients)
        name = prefix + equation.IDENTIFIER
        self.body = model.body(name).id
        self._actuators = [model.actuator(prefix + command).id for command in equation.COMMANDS]
        first = model.actuator(prefix + next(iter(equation.COMMANDS), "memory")).id
        _check(model, self.body, name)
        self._kept = model.actuator_actadr[first], model.actuator_actnum[first] - library.kept
        if model.actuator_dyntype[first] != _USER or self._kept[1] < 0:
            raise ValueError(
                f'actuator {model.actuator(first).name}: must have dyntype="user" and actdim="{library.kept}" or more, '
                "because it has the vehicle's memory: take vehicle.xml of the same export"
            )
        joint = model.body_jntadr[self.body]
        place, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        lower = np.tril_indices(6)
        # implicitfast treats gyroscopic forces as implicit if the free joint moves the whole tree of bodies
        implicit = _IMPLICIT if model.tree_dofnum[model.dof_treeid[dof]] == _FREEDOMS else _IMPLICIT[:1]
        self._places = [
            *(self.body, place, dof, sum(1 << integrator for integrator in implicit)),
            *(self._kept[0], self._kept[1] // library.change if library.change else 0),
            *(model.M_rowadr[dof + lower[0]] + lower[1]),
            *self._actuators,
        ]
        self._rigid = _rigid_mass(model, self.body)
        self._model = model
        self.data = mujoco.MjData(model) if data is None else data

    def __copy__(self) -> "Rov":
        """Return the same vehicle in a simulation of its own, in the same state. The model is shared."""
        return self._copied(self.model, copy(self.data))

    def __deepcopy__(self, memo: dict[int, Any]) -> "Rov":
        """Return the same with a model of its own. Vehicles that are copied together stay together."""
        return self._copied(deepcopy(self.model, memo), deepcopy(self.data, memo))

    def _copied(self, model: Any, data: Any) -> "Rov":
        other = object.__new__(type(self))
        other.__dict__ = {**self.__dict__, "memory": self.memory.copy(), "_model": model}
        other._coefficients, other._inputs = copy(self._coefficients), copy(self._inputs)
        other.data = data
        return other

    @property
    def model(self) -> Any:
        """The model. It cannot be exchanged: connect the vehicle with another one by another `Rov`."""
        return self._model

    @property
    def data(self) -> Any:
        """The state of the simulation. It may be exchanged for other data of the same model at any time.

        Thrust that lags, commands that wait for the dead time and all else that a vehicle remembers are in the data.
        """
        return self._data

    @data.setter
    def data(self, data: Any) -> None:
        model, its = self.model, data.model if isinstance(data, mujoco.MjData) else None
        same = ("nq", "nv", "nu", "na", "nbody", "nM", "signature")
        if its is None or any(getattr(model, name) != getattr(its, name) for name in same):
            raise ValueError("data: must be those of the vehicle's model, MjData(rov.model)")
        self._data = data
        memory, first = self.memory, self.library.outer
        for numbers in (self.coefficients, self.inputs):  # which the C and Python share
            view = memory[first : first + len(numbers)]
            view[:], numbers.array, first = numbers.array, view, first + len(numbers)
        arrays = (data.M, data.qpos, data.qvel, data.act, data.ctrl, data.qfrc_passive, data.xmat)
        pointers = [model._address, data._address, *(one.ctypes.data for one in arrays), *self.library.functions]
        given = np.array(pointers, np.uintp), np.array(self._places, np.intc), np.ascontiguousarray(self._rigid)
        self.address, self.scene = memory.ctypes.data, None
        self.library.connect(self.address, *(one.ctypes.data for one in given))

    @property
    def coefficients(self) -> Numbers:
        """The coefficients by their names in the FMU, in SI units."""
        return self._coefficients

    @coefficients.setter
    def coefficients(self, values: Mapping[str, float]) -> None:
        self._coefficients.update(values)

    @property
    def inputs(self) -> Numbers:
        """The inputs that are no commands, by their names in the FMU, in SI units."""
        return self._inputs

    @inputs.setter
    def inputs(self, values: Mapping[str, float]) -> None:
        self._inputs.update(values)

    def reset(self) -> None:
        """Stop the thrusters and forget the commands that wait for the dead time, as a reset of MuJoCo does."""
        place, more = self._kept
        self.data.act[place : place + self.library.kept + more] = 0.0

    @property
    def forces(self) -> dict[str, float]:
        """The force of each thruster, N, by its name in the FMU."""
        names = self.equation.FORCES
        found = np.zeros(len(names) + 1)
        self.library.forces(self.address, found.ctypes.data)
        return dict(zip(names, found.tolist(), strict=False))

    def step(self, steps: int = 1) -> None:
        """Move the simulation by some time steps. For several vehicles in one model, there is the function `step`."""
        step(self, steps=steps)

    # ---- The parts of a step, where some of it is in Python ----

    def add_mass(self) -> None:
        """Add to MuJoCo's inertia matrix what the mass matrix of the vehicle has beyond that of the rigid body."""
        _raise(self.library.add_mass(self.address, self.data.time))

    def add_forces(self) -> None:
        """Add the forces that give the body the accelerations of the equation, unless other forces act."""
        option = self.model.opt
        _raise(self.library.add_forces(self.address, self.data.time, option.timestep, option.integrator))

    def move(self) -> None:
        """Move the body with its mean velocity during the step, where MuJoCo took the last one."""
        self.library.move(self.address, self.data.time, self.model.opt.timestep)


def step(*rovs: Any, steps: int = 1) -> None:
    """Move the simulation of some vehicles, which share a model and its data, by some time steps.

    This is MuJoCo's own step (`mj_step1`, `mj_step2`) by its integrator Euler, implicit or implicitfast. The vehicles
    may be of several kinds, from several folders. Other threads run meanwhile. Raises ValueError about vehicles in
    different simulations, and when more commands wait for the dead time than a vehicle can keep; mujoco.FatalError
    where MuJoCo gives up, after which its data must be reset.
    """
    first, others = rovs[0], rovs[1:]
    scene = getattr(first, "scene", None)
    if scene is None or scene[0] != others:
        if any(getattr(rov, "FORMAT", None) != FORMAT for rov in rovs):
            _step_by_parts(rovs, steps)
            return
        members = (ctypes.c_void_p * len(rovs))(*(rov.address for rov in rovs))
        said = ctypes.create_string_buffer(500)
        scene = first.scene = others, members, ctypes.addressof(members), len(rovs), first.model.opt, said
    _, _, members_at, count, option, said = scene
    result = first.library.step(members_at, count, option.timestep, option.integrator, steps, said, len(said))
    if result == _HAS_CALLBACKS:  # their errors could not pass through the C
        _step_by_parts(rovs, steps)
    elif result == _MUJOCO_FAILS:
        raise mujoco.FatalError(said.value.decode(errors="replace"))
    else:
        _raise(result)


def _step_by_parts(rovs: tuple[Any, ...], steps: int) -> None:
    """Take some steps as `step` does, for functions in Python that MuJoCo calls, and for vehicles of other folders."""
    model, data = rovs[0].model, rovs[0].data
    if any(rov.data is not data for rov in rovs):
        _raise(_APART)
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


def _raise(result: int) -> None:
    """Raise ValueError unless a step was taken."""
    if result != _DONE:
        raise ValueError(_REASONS[result])


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


# ---- The exported folder ---------------------------------------------------------------------------------------------


def library_name() -> str:
    """Return the name of a vehicle's library for this machine, without its suffix."""
    processor = platform.machine().lower()
    return f"water_{sys.platform}_{_PROCESSORS.get(processor, processor)}"


def connect(folder: Path, equation: Any, *arguments: Any, **coefficients: Any) -> Rov:
    """Return the vehicle of a folder, connected as by `Rov`. Raises ValueError also without a library for it here."""
    file = next(folder.glob(f"{library_name()}.*"), None)
    try:
        own = ctypes.CDLL(str(file)) if file else None
    except OSError as error:
        raise ValueError(f"{file}: this library cannot be loaded: {error}") from error
    if own is None:
        here = f"{folder}: there is no {library_name()}, the library for this machine"
        raise ValueError(f"{here}; export the vehicle on it: rov-fmu export {equation.IDENTIFIER} --to mujoco")
    return Rov(Library(own, equation), equation, *arguments, **coefficients)


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
    for name, value in rov.equation.EXAMPLE.items():
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
