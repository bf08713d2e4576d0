"""Small folders of tank tests of different vehicles, and the parts of their rov.toml."""

import shutil
from collections.abc import Mapping
from pathlib import Path

from rov_fmu.equation.catalogue import YAW, Axis
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.given import Tests
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.readers.tank_tables import Row
from rov_fmu.vehicle.vehicle import Vehicle

HEAD = """
[vehicle]
name = "Mine"
identifier = "mine"
version = "1"
description = "Mine"
source = "A tank"
"""
BLUEROV2 = f'base = "bluerov2"\n{HEAD}'
MASS = 'm_rov = { value = 6.57, unit = "kg", source = "weighed" }\n'
TURNS = 'I_r = { value = 0.105, unit = "kg.m2", source = "drawn" }\n'
ARM = 'R = { value = 0.22, unit = "m", source = "drawn" }\ngamma = { value = 0.423, unit = "rad", source = "drawn" }\n'
TOP = "".join(
    f'{name}_top = {{ value = {value}, unit = "N", source = "pulled" }}\n'
    for name, value in (("a_t", 6.494), ("b_t", 0.0513))
)
THRUSTER = """
[[thruster]]
name = "{name}"
curve = "t200"
direction = {{ value = [{x}, {y}, {z}], source = "drawn: {name}" }}
"""
PLACE = 'position = {{ value = [{0}, {1}, 0], unit = "m", source = "drawn too" }}\n'
PLACES = {"1": (-1, 1, 0.15, 0.11), "2": (-1, -1, 0.15, -0.11), "3": (1, 1, -0.15, 0.11), "4": (1, -1, -0.15, -0.11)}
VECTORED = (
    HEAD
    + f"[body]\n{MASS}{TURNS}[curves.t200]\n"
    + "".join(THRUSTER.format(name=name, x=x, y=y, z=0) + PLACE.format(*at) for name, (x, y, *at) in PLACES.items())
    + '[axes.sway]\nm_a = { value = 7.1, unit = "kg", source = "a strip" }\n'
)
DOWN = HEAD + f"[known]\n{MASS}\n[curves.t200]\n" + THRUSTER.format(name="v", x=0, y=0, z=1)

FORCE, SPEED, RATE = "command [1],force [N]", "command [1],velocity [m/s]", "command [1],velocity [rad/s]"
TAU = "command [1],time constant [s]"
COMMANDS = (0.2, 0.4, 0.6, 0.8, -0.3, -0.7)


def folder_of(folder: Path, rov: str, tables: Mapping[str, str]) -> Path:
    """Write a folder of tests."""
    folder.mkdir(exist_ok=True)
    (folder / ROV_FILE).write_text(rov, encoding="utf-8")
    for name, text in tables.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def small_folder(folder: Path) -> Path:
    """Write a folder of a few tests of a vehicle with one thruster, which are quickly identified."""
    tables = {"thrust_t200.csv": pulled(40.0, 2.0), "steady_heave.csv": f"{SPEED}\n0.3,0.4\n0.5,0.62\n0.8,1.0\n"}
    return folder_of(folder, DOWN, tables)


def responses(k: Vehicle, axis: Axis) -> dict[str, str]:
    """Return tables of steady velocities and time constants of a vehicle, in closed form."""
    rows = [(c, *k.response(axis, c)) for c in COMMANDS]
    steady = "".join(f"{c},{V:.6f}\n" for c, V, _ in rows)
    taus = "".join(f"{c},{T:.6f}\n" for c, _, T in rows)
    return {
        f"steady_{axis.name}.csv": f"{RATE if axis is YAW else SPEED}\n{steady}",
        f"time_constant_{axis.name}.csv": f"{TAU}\n{taus}",
    }


def pulled(a: float, b: float) -> str:
    """Return a table of forces of a thrust curve."""
    return f"{FORCE}\n" + "".join(f"{c},{(a * abs(c) + b) * c:.6f}\n" for c in COMMANDS)


def read(folder: Path, rov: str, tables: Mapping[str, str]) -> Tests:
    return load_tests(folder_of(folder, rov, tables))


def rows_of(tests: Tests, kind: str) -> dict[str, list[Row]]:
    """Return the rows of all tables of a kind, `thrust`, `steady` or `time_constant`, by curve or axis."""
    return {subject: [*rows] for subject, rows in tests.rows(kind)}


def beside(file: Path, folder: Path) -> str:
    """Copy a file into a folder if it is not there already, so that a file there can name it; the name."""
    if file.parent != folder:
        shutil.copy(file, folder)
    return file.name
