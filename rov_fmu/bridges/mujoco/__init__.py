"""Write a vehicle as a folder for MuJoCo, which is a Python package: the model (MJCF) and what adds the water to it.

The package needs only MuJoCo and NumPy. It contains `plugin.py` as it is, the names and the numbers of the vehicle, and
its equation in C (`source.py`), with its libraries.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil, isinf
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from rov_fmu.bridges import sdf
from rov_fmu.bridges.mujoco.source import memory_size, water_sources
from rov_fmu.c.compile import (
    HOSTS,
    MACHINES,
    PLATFORMS,
    compile_engine,
    compile_for,
    compiler,
    host_platform,
    is_zig,
    processor,
)
from rov_fmu.c.library import load_sources
from rov_fmu.equation.catalogue import UPWARD
from rov_fmu.equation.parts import Point, Thruster
from rov_fmu.equation.python.printed import left_out_of_accelerations
from rov_fmu.io.messages import listed
from rov_fmu.io.numbers import csv_of
from rov_fmu.report.plots.geometry import hull_size, thruster_place
from rov_fmu.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from rov_fmu.bridges.mujoco.plugin import Rov

_PLUGIN = Path(__file__).with_name("plugin.py")
"""The file of this folder that is part of each exported one."""
_SYSTEMS = {"Linux": "linux", "Windows": "win32", "Darwin": "darwin"}
"""The names in `sys.platform`, by those of `platform.system()`. plugin.py looks for a library with such a name."""
_PACKAGE = '''\
"""A vehicle in MuJoCo: see README.md. `load` returns it in its world, and `Rov` connects it in a world of your own."""

from functools import partial
from pathlib import Path

from . import equation, plugin
from .plugin import step

FOLDER = Path(__file__).parent
Rov = partial(plugin.connect, FOLDER, equation)
load = partial(plugin.load, Rov, FOLDER / "scene.xml")
draws = partial(plugin.draws, FOLDER / "draws.csv")
'''
_MAIN = '''\
"""Open MuJoCo's viewer with the vehicle, or write a picture: python -m {package} [FILE.png]."""

import sys
from pathlib import Path

from . import load
from .plugin import show

show(load(), *map(Path, sys.argv[1:2]))
'''
_LEAST_WAITING = 64
"""The fewest changes of commands that may wait for the dead time. There may be one in each millisecond of it."""
_FLIP = np.array(UPWARD[:3])
"""The signs of components in MuJoCo's frame of the body, relative to forward, starboard, down."""
_PROPELLER = 0.05
"""The radius, and half the length, of what is drawn for a thruster, relative to the size of the vehicle."""


def mujoco_files(texts: Mapping[str, str], platforms: Sequence[str | None] | None = None) -> dict[str, str | bytes]:
    """Return the files of the folder by name: its texts, and libraries that take the step.

    There is one for each of `platforms`, of which None is this machine. By default these are this machine and HOSTS, if
    the compiler has them. Raises BuildError if the C cannot be compiled.
    """
    if platforms is None:
        platforms = [*dict.fromkeys([*(HOSTS if is_zig(compiler()) else ()), host_platform(fmi=3)])]
    libraries = compile_for([*filter(None, platforms)], _c_of(texts))
    names = {
        name: f"water_{_SYSTEMS[system]}_{machine}{PLATFORMS[name].suffix}"
        for (system, machine), name in MACHINES.items()
    }
    own = {f"water_{sys.platform}_{processor()}.so": compile_engine(_c_of(texts))} if None in platforms else {}
    return {**texts, **own, **{names[name]: library for name, library in libraries.items()}}


def mujoco_texts(
    vehicle: Vehicle, package: str, card: Mapping[str, Sequence[str]], draws: Mapping[str, Sequence[float]]
) -> dict[str, str]:
    """Return the files of the folder without its libraries, by name. `package` is its own name.

    `card` are the paragraphs about the vehicle by heading, and `draws` the drawn coefficients by name. Raises
    InputError about a vehicle without a mass or with β = 0.
    """
    sdf.check_body(vehicle, "MuJoCo")
    points = [_point(vehicle, point) for point in vehicle.layout.points]
    vehicle = _in_mujoco(vehicle)
    layout = vehicle.layout
    example = layout.example(layout.axes[0].axis)
    hull = hull_size(vehicle) / 2.0
    low, _, high = layout.pulse or (-1.0, 0.0, 1.0)
    waiting = max(_LEAST_WAITING, ceil(1000.0 * vehicle["T_d"])) if layout.has_dead_time else 0
    content = {
        "gravity": sdf.gravity(vehicle),
        "body": sdf.link_of(vehicle, 1.0),
        "hull": hull,
        "foam": {"at": hull * (0.0, 0.0, 0.72), "size": hull * (1.01, 0.9, 0.3)},
        "range": np.array([low, high]),
        "memory": memory_size(layout)[0] + waiting * memory_size(layout)[1],
        "thrusters": [_drawn(vehicle, thruster, _PROPELLER * float(hull.max()) * 2.0) for thruster in layout.thrusters],
        "points": points,
        "package": package,
        "example": example,
        "card": card,
        "draws": len(next(iter(draws.values()), ())),
        "commands": ", ".join(layout.commands) or "none",
        "others": ", ".join(name for name in layout.inputs if name not in layout.commands),
    }
    notes = tuple(_notes(vehicle))
    files = {
        "README.md": sdf.rendered_model("mujoco.md.j2", vehicle, notes, **content),
        "vehicle.xml": sdf.rendered_model("mujoco.xml.j2", vehicle, notes, **content),
        "scene.xml": sdf.rendered_model("scene.xml.j2", vehicle, notes, **content),
        "__init__.py": _PACKAGE,
        "__main__.py": _MAIN.format(package=package),
        _PLUGIN.name: _PLUGIN.read_text(encoding="utf-8"),
        "equation.py": _equation(vehicle),
        **water_sources(layout),
    }
    rows = zip(*draws.values(), strict=True)  # without draws, the file replaces that of an earlier export
    files["draws.csv"] = csv_of(draws, rows)
    return files


def load_mujoco(vehicle: Vehicle, **coefficients: float) -> "Rov":
    """Return a vehicle in its world in MuJoCo, as `load` of the folder does. Needs the extra `mujoco`.

    - `vehicle`: the vehicle, which needs a mass.
    - `coefficients`: other values of coefficients by name, in SI units. They may change at any time.

        rov = rov_fmu.load_mujoco(rov_fmu.load("bluerov2"), health_1=0.5)
        rov.data.ctrl[:] = 0.2  # the commands, -1 to 1
        rov.step()

    Raises InputError and BuildError as `mujoco_texts` and `mujoco_files` do.
    """
    import mujoco

    from rov_fmu.bridges.mujoco.plugin import Library, Rov

    files = mujoco_texts(vehicle, "rov", {}, {})
    equation = ModuleType("equation")
    exec(compile(files["equation.py"], "<equation>", "exec"), equation.__dict__)
    model = mujoco.MjModel.from_xml_string(files["scene.xml"], {"vehicle.xml": files["vehicle.xml"].encode()})
    library = load_sources(files["equation.h"], lambda: _c_of(files))
    return Rov(Library(library, equation), equation, model, None, "", **coefficients)


def _equation(vehicle: Vehicle) -> str:
    """Return the module with the names and the numbers of a vehicle, as `plugin.py` takes it."""
    layout = vehicle.layout
    bounds = {name: (one.minimum, one.maximum) for name, one in layout.coefficients.items()}
    data = {
        "IDENTIFIER": vehicle.identifier,
        "COEFFICIENTS": {name: vehicle[name] for name in layout.coefficients},
        "BOUNDS": {name: pair for name, pair in bounds.items() if not all(map(isinf, pair))},
        "COMMANDS": {name: layout.usual_inputs[name] for name in layout.commands},
        "INPUTS": {name: x for name, x in layout.usual_inputs.items() if name not in layout.commands},
        "FORCES": [f"F_{thruster.name}" for thruster in layout.thrusters],
        "EXAMPLE": layout.example(layout.axes[0].axis),
    }
    lines = [f"{name} = {value!r}" for name, value in data.items()]
    words = '"""The names and the numbers of a vehicle, in SI units. water.c has its equation."""'
    return "\n".join([words, "", "from math import inf", "", *lines, ""])


def _c_of(files: Mapping[str, str]) -> dict[str, str]:
    """Return the C files of a folder. The last one includes the others."""
    return {name: text for name, text in files.items() if name.endswith((".c", ".h"))}


def _in_mujoco(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle without its points, where MuJoCo has sites at which forces act on the body, and without waves.

    Where the velocity of the water changes, the body keeps its velocity over ground, which loses what A does with it.
    """
    return vehicle.with_(replace(vehicle.layout, points=(), waves=False))


def _point(vehicle: Vehicle, point: Point) -> dict[str, object]:
    """Return the name and the position of a point, in MuJoCo's frame."""
    return {"name": point.name, "position": _FLIP * [vehicle[point.coefficient(key)] for key in point.keys]}


def _drawn(vehicle: Vehicle, thruster: Thruster, radius: float) -> dict[str, object]:
    """Return where and how a thruster is drawn, in MuJoCo's frame."""
    position, direction = _FLIP * thruster_place(vehicle, thruster), _FLIP * thruster.direction.value
    ends = np.concatenate([position - radius * direction, position + radius * direction])
    return {"name": thruster.name, "position": position, "direction": direction, "radius": radius, "ends": ends}


def _notes(vehicle: Vehicle) -> list[str]:
    """Return what is different in MuJoCo, without full stops."""
    layout = vehicle.layout
    notes = [
        "Steps of `Euler`, `implicit` or `implicitfast` are taken; with `RK4`, those of `Euler`",
        "The water has no surface and no waves",
    ]
    if lacking := layout.lacking:
        notes.append(
            f"The vehicle file has no {listed(lacking)}: along and about such an axis the body is held, with a million "
            "times its mass"
        )
    notes += [f"Left out: {words}" for words in left_out_of_accelerations(layout)]
    if not layout.coupled and len(layout.axes) > 1:
        notes.append("The vehicle file has no Coriolis and Munk terms, and there are none here")
    return notes
